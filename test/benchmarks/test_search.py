# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The search: successive halving, its checkpoint, and the program."""
from __future__ import annotations

import csv
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip('torch')
pytest.importorskip('matplotlib')

from benchmarks.paper import halving, search
from benchmarks.paper.halving import (
    Candidate,
    CheckpointError,
    Rung,
)

QUICK = ['--quick', '--candidates', '48', '--seed', '2']


class Toy(halving.Search):
    """Error: |rate − 0.3| + 1 / effort; number 6 diverges."""

    name = 'toy'
    seed = 5
    rungs = (Rung(20, 1, 1, 4), Rung(8, 2, 1, 4), Rung(3, 4, 1, 4))

    def __init__(self, stop_after: int | None = None) -> None:
        self.trained: list[tuple[int, int]] = []
        self.seeds: list[int] = []
        self.stop_after = stop_after

    def candidates(self) -> list[Candidate]:
        return [Candidate(k, (4, 4 + k % 3), 0.05 * k, shipped=k == 19) for k in range(20)]

    def cost(self, candidate: Candidate) -> int:
        return candidate.hidden[0] * candidate.hidden[1]

    def train(self, rung: Rung, group: Sequence[Candidate], seed: int) -> list[dict[str, float]]:
        if self.stop_after is not None and len(self.seeds) == self.stop_after:
            raise KeyboardInterrupt
        self.seeds.append(seed)
        self.trained += [(rung.effort, one.number) for one in group]
        return [{'error': float('nan') if one.number == 6 else
                 abs(one.rate - 0.3) + 1.0 / rung.effort} for one in group]


def test_the_better_part_goes_on(tmp_path: Path) -> None:
    """Rate 0.3 is number 6, which diverges; 5 and 7 are next; 19, in use, is kept though worst."""
    toy = Toy()
    done = toy.run(tmp_path / 'c')
    assert [len(scores) for scores in done] == [20, 8, 3]
    assert set(done[1]) == {2, 3, 4, 5, 7, 8, 9, 19}
    assert set(done[2]) == {5, 7, 19}
    assert len(set(toy.seeds)) == len(toy.seeds)  # no two groups see the same random numbers
    costs = [[toy.cost(one) for one in group] for group in
             toy.groups(toy.candidates(), 4)]
    flat = [cost for group in costs for cost in group]
    assert flat == sorted(flat) and max(map(len, costs)) == 4


@pytest.mark.parametrize('stop_after', range(8))
def test_stopped_anywhere_it_ends_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                           stop_after: int) -> None:
    monkeypatch.setattr(halving, 'SAVE_EVERY', 0.0)
    whole = Toy().run(tmp_path / 'whole')
    path = tmp_path / 'stopped'
    first = Toy(stop_after)
    with pytest.raises(KeyboardInterrupt):
        first.run(path)
    second = Toy()
    resumed = second.run(path)
    assert not set(first.trained) & set(second.trained)  # nothing is done twice
    assert len(first.trained) + len(second.trained) == 20 + 8 + 3
    np.testing.assert_equal(resumed, whole)  # equal NaN included


def test_checkpoint_of_another_search_is_refused(tmp_path: Path) -> None:
    Toy().run(tmp_path / 'c')
    other = Toy()
    other.seed = 6
    with pytest.raises(CheckpointError, match='with other options'):
        other.run(tmp_path / 'c')
    for damaged in (b'not a checkpoint', b'{"scores": [{"0": {}}]', b'\xff', b'[]'):
        (tmp_path / 'c').write_bytes(damaged)
        with pytest.raises(CheckpointError, match='cannot be read, remove it'):
            Toy().run(tmp_path / 'c')


def table(folder: Path, name: str) -> str:
    return (folder / f'{name}.csv').read_text('utf-8')


def test_killed_and_started_again_it_ends_the_same(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The program, killed when its first checkpoint is there; then the page, table and plot."""
    whole, killed, name = tmp_path / 'whole', tmp_path / 'killed', 'search_paper'
    assert search.main([*QUICK, '--out', str(whole)]) == 0
    # A checkpoint after every group.
    process = subprocess.Popen(
        [sys.executable, '-c', 'import sys\n'
         'from benchmarks.paper import search, halving\n'
         'halving.SAVE_EVERY = 0.0\n'
         'sys.exit(search.main(sys.argv[1:]))', *QUICK, '--out', str(killed)],
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 150
    while not list(killed.glob('*.checkpoint')) and process.poll() is None:
        assert time.monotonic() < deadline
        time.sleep(0.002)
    process.send_signal(signal.SIGKILL)
    process.wait()
    if (killed / f'{name}.csv').exists():
        pytest.skip('it was faster than the signal')
    assert search.main([*QUICK, '--out', str(killed)]) == 0
    assert 'going on from' in capsys.readouterr().out
    assert table(killed, name) == table(whole, name)
    rows = list(csv.DictReader(table(whole, name).splitlines()))
    assert len(rows) == 48
    assert {row['shipped'] for row in rows} == {'True', 'False'}
    assert {int(row['rungs']) for row in rows} == {1, 2}
    assert sorted(path.name for path in whole.iterdir()) == [
        f'{name}.csv', f'{name}.md', f'{name}.png']
    page = (whole / f'{name}.md').read_text('utf-8')
    assert 'in use' in page and 'nan' not in page


@pytest.mark.parametrize(('arguments', 'message'), [
    (['mlp'], 'unrecognized arguments: mlp'),
    (['--candidates', '3'], '--candidates: must be at least 16, got 3'),
    (['--seed', '-1'], "'-1' is not a whole number from 0"),
])
def test_refused_arguments(arguments: list[str], message: str,
                           capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        search.main(arguments)
    assert ended.value.code == 2
    assert message in capsys.readouterr().err


def test_a_checkpoint_of_other_options_is_said_in_one_line(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / 'search_paper_0.checkpoint').write_bytes(b'x')
    assert search.main([*QUICK, '--out', str(tmp_path)]) == 1
    assert 'search_paper_0.checkpoint cannot be read, remove it' in capsys.readouterr().err

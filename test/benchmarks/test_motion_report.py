# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report `motion`: its judge proves and refutes, and finds what is late, early and too high."""
from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from benchmarks import motion, motions, native_calls

pytestmark = [pytest.mark.reports,
              pytest.mark.skipif(shutil.which('g++') is None, reason='no compiler')]

JUDGED = """
#include <cstdio>
#include "judge.hpp"

int main() {
  // A cube of .04 flies through a plate of .04, turning about the way; they touch from .496 on.
  bc_sweep plate{{{0, 0, 0}, {0, 0, 0, 1}}, {{0, 0, 0}, {0, 0, 0, 1}}, {{4, 4, 0.04}}, {0, 0, 0}};
  bc_sweep bullet{{{2, 0, 5}, {0, 0, 0, 1}}, {{2, 0, -5}, {0, 0, 0.6, 0.8}}, {{.04, .04, .04}}, {}};
  judge::Judge judge(plate, bullet);
  auto show = [&](double target, double end) {
    std::printf("%d ", int(judge.stays_above(target, end, 0)));
  };
  show(0.0, 0.496 - 1e-15), show(0.0, 0.496 + 1e-9), show(0.0, 1.0);
  show(1.0, 0.396 - 1e-12), show(1.0, 0.396 + 1e-9), show(0.0, 0.0);
  std::printf("%.3Lf\\n", judge::distance(judge.at(0.25L)));
}
"""


def test_the_judge_proves_and_refutes(tmp_path: Path) -> None:
    """0: proved, 1: refuted; to a nanosecond of a second's way."""
    (tmp_path / 'judged.cpp').write_text(JUDGED)
    native_calls.run_compiler(f'-I{motion.CALLS_FOLDER}', tmp_path / 'judged.cpp', '-o',
                              tmp_path / 'judged', *native_calls.library_beside(tmp_path))
    assert subprocess.run([tmp_path / 'judged'], capture_output=True, text=True,
                          check=True).stdout == '0 1 1 0 1 0 2.460\n'


def test_a_report_of_a_few_motions_is_right(tmp_path: Path) -> None:
    """All kinds, timed; and a kind whose box A stands beside what is sampled."""
    program = motion.compiled(tmp_path)
    found = {kind: motion.judged(program, motions.draw(kind, 2, 30), 5, 0)
             for kind in motions.KINDS}
    assert all(motion.faults(one) == (0, 0, 0, 0) for one in found.values())
    assert sum(np.isfinite(one['time']).sum() for one in found.values()) > 100
    assert '| no motion | 30 |' in motion.verdicts_table(found)
    assert '**all**' in motion.costs_table(found)
    assert (found['both turning']['distance_ns'] > 0.0).sum() == 5
    for kind in motion.STANDING:
        drawn = motions.draw(kind, 2, 30)
        assert np.array_equal(drawn.start_a, drawn.end_a) and not drawn.clearance.any()
        one = motion.judged(program, drawn, 1, 30)
        row = motion.compared(kind, '1 mm', one['sampled'], one['time'], 1.0)
        assert row['invented'] == row['early'] == 0


def test_wrong_times_are_counted() -> None:
    true = np.array([0.5, 0.5, 0.5, 0.5, np.nan, np.nan])
    times = np.array([0.5005, 0.6, 0.4, np.nan, 0.3, np.nan])
    row = motion.compared('kind', 'engine', times, true, 1.0)
    assert [row[name] for name in ('late', 'early', 'missed', 'invented')] == [1, 1, 1, 1]


def test_goals_that_are_missed_are_named() -> None:
    names = dict.fromkeys(motion.COLUMNS, np.zeros(10))
    good = {kind: {**names, 'distance_ns': np.ones(10), 'time_ns': np.ones(10)}
            for kind in motions.KINDS}
    assert motion.missed_goals(good) == []
    late = {**good['no motion'], 'late': np.array([1.0] + [0.0] * 9)}
    slow = {**good['both turning'], 'time_ns': np.full(10, 11.0),
            'time_distances': np.full(10, 99.0)}
    assert [line.split(':')[0] for line in motion.missed_goals(
        {**good, 'no motion': late, 'both turning': slow})] == [
            'no motion', 'distances of time', 'both turning']


@pytest.mark.parametrize('kind', [kind for kind in motions.KINDS if 'graz' in kind])
def test_motions_graze(kind: str) -> None:
    """Their least distance is a micron to a millimetre beside the clearance."""
    drawn = motions.draw(kind, 3, 200)
    off = np.abs(drawn.least(1e-7 if 'UTM' in kind else 1e-8).nearest.distance - drawn.clearance)
    assert (off < 1.2e-3).mean() > 0.8  # some turn so that no way aside leads there


@pytest.fixture(scope='module')
def asked(tmp_path_factory: pytest.TempPathFactory) -> dict[str, motion.Rival]:
    found, missing = motion.engines(tmp_path_factory.mktemp('engines'))
    assert len(found) + len(missing) == 3
    return found


def one_motion(start_a: list, end_a: list, start_b: list, end_b: list, size_a: list, size_b: list,
               centre_b: list) -> motions.Motions:
    parts = (start_a, end_a, start_b, end_b, size_a, size_b, [0, 0, 0], centre_b)
    return motions.Motions(*(np.array([part], float) for part in parts), np.zeros(1))


def yaw(degrees: float) -> list[float]:
    half = np.radians(degrees) / 2.0
    return [0.0, 0.0, float(np.sin(half)), float(np.cos(half))]


@pytest.mark.parametrize('name', ['Rapier', 'Box3D', 'FCL'])
def test_engines_answer_a_motion(asked: dict[str, motion.Rival], name: str) -> None:
    """A cube falls onto another at half of the way, or past it; Box3D stops 5 mm above.

    It falls a little off the middle: FCL is late by an eighth of the way where it does not.
    """
    if name not in asked:
        pytest.skip(f'{name} is not here')
    stands, cube = [0, 0, 0, *yaw(0)], [1, 1, 1]
    for x, touches in ((0.01, True), (1.1, False)):
        falls = one_motion(stands, stands, [x, 0, 3, *yaw(0)], [x, 0, -1, *yaw(0)], cube, cube,
                           [0, 0, 0])
        times, nanoseconds = asked[name].ask(falls)
        assert (0.498 <= times[0] <= 0.502) if touches else np.isnan(times[0])
        assert nanoseconds[0] > 0.0


@pytest.mark.parametrize('name', ['Box3D', 'FCL'])
def test_engines_turn_a_box_about_its_centre(asked: dict[str, motion.Rival], name: str) -> None:
    """A bar turns about its end, from 0 to 90 degrees, onto a face at 45; both also rise."""
    if name not in asked:
        pytest.skip(f'{name} is not here')
    along, out = np.array([[1.0, 1.0], [-1.0, 1.0]]) / np.sqrt(2.0)
    x, y = 2.8 * along + 2.1 * out  # a bar about its middle would be 0.1 m short of the face
    turns = one_motion([x, y, 0, *yaw(45)], [x, y, 3, *yaw(45)], [1, 0, 0, *yaw(0)],
                       [0, 1, 3, *yaw(90)], [2, 4, 1], [2, 0.2, 0.2], [-1, 0, 0])
    ours, theirs = turns.first(0.0).time[0], asked[name].ask(turns)[0][0]
    assert ours == pytest.approx(0.5, abs=1e-5)
    assert theirs == pytest.approx(ours, abs=3e-3)  # Box3D's slop of 5 mm takes 2e-3


def test_an_engine_that_is_not_made_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                            capsys: pytest.CaptureFixture[str]) -> None:
    """A full run ends at once; the page of a quick one says what is left out."""
    monkeypatch.setattr(motion, 'MADE', tmp_path / 'nothing')
    monkeypatch.setattr(motion, 'KINDS', {kind: motions.KINDS[kind]
                                          for kind in motion.RIVALED_KINDS})
    monkeypatch.setattr(motion, 'EVERYDAY', ())
    assert motion.main(['--out', str(tmp_path)]) == 2
    assert 'add --leave-out box3d' in capsys.readouterr().err and not list(tmp_path.glob('*.md'))
    assert motion.main(['--quick', '--out', str(tmp_path)]) == 0
    page = (tmp_path / 'motion.md').read_text('utf-8')
    assert 'Left out: box3d is not here (make rivals).' in page
    assert '| both turning | box_contact | 10 | 0 | 0 | 0 | 0 |' in page
    assert '| Box3D |' not in page

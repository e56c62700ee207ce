# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report on hard poses: it finds planted faults, survives a child's end, and is complete."""
from __future__ import annotations

import csv
import dataclasses
from pathlib import Path

import numpy as np
import pytest

from benchmarks import hard_poses, stability
from benchmarks.contestant import Solved, ours
from benchmarks.pose_sets import Pairs

ROOT = Path(__file__).resolve().parents[2]
CASES = hard_poses.load()


def planted(fault: str) -> stability.StabilityRow:
    """Return the row of a model that is wrong in one way for its first contact of a family."""
    exact = ours('exact')

    def solve(pairs: Pairs) -> Solved:
        found = exact.solve(pairs).contacts
        row = int(np.flatnonzero(found.colliding)[0])
        if fault == 'verdicts':
            found.colliding[row] = False
        elif fault == 'normals':
            found.normal[row] *= -1.0
        elif fault == 'outside':
            found.point[row] += 100.0
        elif fault == 'not_finite':
            found.point[row] = np.nan
        elif fault == 'depth':
            found.separation[row] *= 1.001
        return Solved(found, 0)

    return stability.examine(dataclasses.replace(exact, solve=solve), 'c1_depths',
                             CASES['c1_depths'])


@pytest.mark.parametrize('fault', ['verdicts', 'normals', 'outside', 'not_finite'])
def test_planted_faults_are_counted(fault: str) -> None:
    row = planted(fault)
    assert getattr(row, fault) == 1
    assert stability.gates([row]) == [f'exact, c1_depths: 1 {fault}']


def test_a_planted_depth_is_seen() -> None:
    assert planted('depth').depth > 1e-6


def test_a_model_that_ends_its_process_is_a_row() -> None:
    """As python-fcl's signed distance does, which aborts; here, one that cannot even start."""
    row = stability.examine_apart('no such model', 'c1_depths', CASES['c1_depths'])
    assert row.failure == 'ended with status 1'
    assert 'ended with status 1' in stability.table([row])


def test_the_program(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip('fcl')
    arguments = ['--models', 'exact', 'fcl', '--families', 'a4_ridges', 'd5_edge_against_face']
    assert stability.main([*arguments, '--out', str(tmp_path)]) == 0
    with (tmp_path / 'stability.csv').open() as file:
        rows = list(csv.DictReader(file))
    assert [(row['model'], row['family']) for row in rows] == [
        (model, family) for model in ('exact', 'fcl')
        for family in ('a4_ridges', 'd5_edge_against_face')]
    # FCL prefers faces: depths of edge contacts are too large, along another axis.
    assert int(rows[2]['normals']) > 0 and int(rows[0]['normals']) == 0
    assert 'every verdict and normal is right' in (tmp_path / 'stability.md').read_text()
    assert '**all**' in capsys.readouterr().out


def test_the_committed_report_is_complete() -> None:
    with (ROOT / 'docs' / 'results' / 'stability.csv').open() as file:
        rows = list(csv.DictReader(file))
    for model in ('exact', 'mlp', 'fcl', 'soup-8'):
        assert [row['family'] for row in rows if row['model'] == model] == list(CASES)
    assert not stability.gates([stability.StabilityRow(
        row['model'], row['family'], int(row['cases']),
        **{name: int(row[name]) for name in stability.COUNTS}) for row in rows])

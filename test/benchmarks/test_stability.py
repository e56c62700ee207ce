# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report on hard poses: it finds planted faults, and is complete."""
from __future__ import annotations

import csv
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from benchmarks import hard_poses, stability
from benchmarks.contestant import CORE_MODELS, ours
from benchmarks.engines import installed
from benchmarks.pose_sets import Pairs
from box_contact_ros.solver.contact import Contacts

pytestmark = pytest.mark.reports

ROOT = Path(__file__).resolve().parents[2]
CASES = hard_poses.load()


def planted(fault: str) -> stability.StabilityRow:
    """Return the row of a model that is wrong in one way for its first contact of a family."""
    def solve(pairs: Pairs) -> Contacts:
        found = pairs.contacts()
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
        elif fault in ('volume', 'covariance'):
            getattr(found, fault)[row] *= 1.001
        return found

    return stability.examine('exact', 'c1_depths', CASES['c1_depths'], solve)


@pytest.mark.parametrize('fault', stability.FAULTS)
def test_planted_faults_are_counted(fault: str) -> None:
    row = planted(fault)
    assert getattr(row, fault) == 1
    assert stability.gates([row]) == [f'exact, c1_depths: 1 {fault}']


def test_what_an_engine_of_other_tolerances_answers_is_judged_by_these() -> None:
    """A direction that is off by less than the tolerance is right, and one by more is wrong."""
    def turned(angle: float) -> int:
        def solve(pairs: Pairs) -> Contacts:
            found = pairs.contacts()
            across = np.cross(found.normal, [0.6, 0.0, 0.8])
            across /= np.linalg.norm(across, axis=1, keepdims=True)
            found.normal[:] = np.cos(angle) * found.normal + np.sin(angle) * across
            return found
        return stability.examine('engine', 'c1_depths', CASES['c1_depths'], solve,
                                 tolerance=stability.TOLERANT).normals

    assert turned(1e-8) == 0 < turned(0.01)


def test_an_engine_answers_by_its_deepest_point() -> None:
    """Of two cubes that overlap by .1, FCL's depth and direction are those of `exact`."""
    engines, _ = installed(('fcl',))
    if not engines:
        pytest.skip('FCL is not installed')
    pairs = Pairs(*(np.array([row], float) for row in (
        (0, 0, 0, 0, 0, 0, 1), (0.2, 0.1, 0.9, 0, 0, 0, 1), (1, 1, 1), (1, 1, 1))))
    found = stability.answers_of(engines[0])(pairs)
    assert found.colliding[0] and found.separation[0] == pytest.approx(-0.1)
    assert found.normal[0] == pytest.approx([0, 0, 1])
    assert np.isnan(found.volume).all()


def test_planted_errors_are_seen() -> None:
    assert planted('depth').depth > 1e-6
    assert planted('volume').volume > 0.09 > 1e-6 > planted('depth').volume
    assert planted('covariance').covariance > 0.05 > 1e-6 > planted('depth').covariance


def test_the_program(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The soup's normals are wrong, and break no gate."""
    pytest.importorskip('fcl')
    assert stability.main(['--quick', '--out', str(tmp_path)]) == 0
    with (tmp_path / 'stability.csv').open() as file:
        rows = list(csv.DictReader(file))
    families = list(CASES)[::stability.QUICK]
    models = list(dict.fromkeys(row['model'] for row in rows))
    assert models[:3] == list(stability.MODELS) and stability.ENGINES[0] in models[3:]
    assert [(row['model'], row['family']) for row in rows] == [
        (model, family) for model in models for family in families]
    soup = [row for row in rows if row['model'] == stability.MODELS[2]]
    assert int(soup[-1]['normals']) > 0 and int(rows[0]['normals']) == 0
    assert 'every verdict and normal is right' in (tmp_path / 'stability.md').read_text()
    assert '| `exact` |' in capsys.readouterr().out


def test_the_committed_report_is_complete_and_true() -> None:
    """All families of all models are there, without faults; the core's own rows are made anew."""
    with (ROOT / 'docs' / 'results' / 'stability.csv').open() as file:
        rows = list(csv.DictReader(file))
    for model in (*stability.MODELS, *stability.ENGINES):
        assert [row['family'] for row in rows if row['model'] == model] == list(CASES)
    assert not [row for row in rows if row['model'] in stability.GATED
                for fault in stability.FAULTS
                if int(row[fault]) and (row['model'], row['family'], fault) != stability.KNOWN]
    for row in rows:
        if row['model'] in CORE_MODELS:
            found = stability.examine(row['model'], row['family'], CASES[row['family']],
                                      ours(row['model']).solve)
            for name, value in asdict(found).items():
                assert row[name] == value or float(row[name]) == pytest.approx(
                    value, rel=1e-3, abs=1e-12), (row['model'], row['family'], name)

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Public reports about pairs of boxes: the stored truth, the models, and the judge's own faults."""
from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers import oracle

from benchmarks import judge
from benchmarks.contestant import APART, Manifold, ours
from benchmarks.named_failures import NamedFailure, fault, load, main, replay
from benchmarks.stability import GATED

ROOT = Path(__file__).resolve().parents[2]
FAILURES = load()


def rounding(one: NamedFailure) -> float:
    """Return the error that a model may have: 1e-12 of the size, or the coordinates' ulp."""
    return float(judge.rounding(*one.pairs)[0])


@pytest.mark.parametrize('one', FAILURES.values(), ids=FAILURES)
def test_the_stored_truth(one: NamedFailure) -> None:
    """The separation is the oracle's, and the normal is a direction of it."""
    a, b = oracle.make_box(one.pose_a, one.size_a), oracle.make_box(one.pose_b, one.size_b)
    assert one.separation == float(oracle.separation(a, b))
    if one.normal is None:
        assert one.separation > 0.0
        return
    ties = [axis for _, axis, gap in oracle.axis_gaps(a, b)
            if gap >= one.separation - rounding(one)]
    assert min(np.abs(sign * oracle.as_array(axis) - one.normal).max()
               for axis in ties for sign in (1.0, -1.0)) < 1e-9


@pytest.mark.parametrize('model', GATED)
def test_our_models_pass(model: str) -> None:
    """To rounding; the swapped pair, too."""
    swapped = {name: replace(one, pose_a=one.pose_b, size_a=one.size_b, pose_b=one.pose_a,
                             size_b=one.size_a) for name, one in FAILURES.items()}
    bounds = {name: rounding(one) for name, one in FAILURES.items()}
    for failures in (FAILURES, swapped):
        assert set(replay(ours(model), failures, bounds).values()) == {''}


def test_every_fault_is_found() -> None:
    """Planted in a right answer."""
    one = FAILURES['mujoco_warp-1635']
    right = Manifold(np.array([[0.0, 0, 0.195]]), np.array([[0.0, 0, 1]]), np.array([0.01]))
    assert fault(one, right, 1e-9) == ''
    assert fault(one, APART, 1e-9) == 'missed'
    phantom = Manifold(np.repeat(right.points, 2, axis=0), np.repeat(right.normals, 2, axis=0),
                       np.array([0.01, 2.01]))
    assert fault(one, phantom, 1e-9) == 'depth 2.01 for 0.01'
    for normal, depth in ((-right.normals, 0.39), (np.array([[1.0, 0, 0]]), 1.1)):
        assert fault(one, right._replace(normals=normal), 1e-9) == f'normal {depth:.3g}'
    assert 'outside' in fault(one, right._replace(points=right.points + [0, 0, 0.1]), 1e-9)
    apart = replace(one, pose_b=[0, 0, 0.4, 0, 0, 0, 1], separation=0.1)
    assert fault(apart, right, 1e-9) == 'invented'
    assert fault(apart, APART, 1e-9) == ''


def test_the_page_has_every_report(tmp_path: Path) -> None:
    """The one that is committed, and the one of a quick run."""
    assert main(['--quick', '--out', str(tmp_path)]) == 0
    for folder in (tmp_path, ROOT / 'docs' / 'results'):
        text = (folder / 'named_failures.md').read_text()
        assert all(one.link in text and one.report in text for one in FAILURES.values())
        assert all(f'{model} {len(FAILURES)}' in text for model in GATED)

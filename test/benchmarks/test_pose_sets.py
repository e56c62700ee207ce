# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sets of poses: each keeps the depth, tilt and sizes that its docstring states."""
from __future__ import annotations

import numpy as np
import pytest

from benchmarks import pose_sets
from benchmarks.errors import degrees_between
from benchmarks.pose_sets import CUBE, SETS, Pairs
from box_contact_ros.solver.pose import rotation_matrix

pytestmark = pytest.mark.reports

N = 200
DEPTHS = {'random cubes': (2e-3, 0.2), 'touching': (0.0, 0.0), 'stacks': (1e-3, 1e-3),
          'tilted stacks': (1e-3, 1e-3), 'containers': (2.438e-3, 0.2438)}
"""Least and largest depth [m]."""


def drawn(name: str) -> Pairs:
    return SETS[name](np.random.default_rng(1), N)


@pytest.mark.parametrize('name', SETS)
def test_nearly_all_draws_meet_at_the_stated_depth(name: str) -> None:
    pairs = drawn(name)
    found = pairs.contacts()
    assert 0.9 * N < len(found.colliding) <= N and found.colliding.all()
    shortest = np.minimum(pairs.size_a.min(axis=1), pairs.size_b.min(axis=1))
    shares = (0.1, 0.7) if name == 'deep' else (1e-3, 0.1)
    low, high = DEPTHS.get(name, [share * shortest for share in shares])
    rounding = 1e-13 * pairs.size
    assert (-found.separation > low - rounding).all()
    assert (-found.separation < high + rounding).all()


@pytest.mark.parametrize('name, least, most', [
    ('stacks', 1e-6, 1e-3), ('tilted stacks', 1e-3, 0.1)])
def test_stacks_are_tilted_as_stated(name: str, least: float, most: float) -> None:
    pairs = drawn(name)
    up = rotation_matrix(pairs.pose_b[:, 3:])[:, :, 2]
    tilt = np.radians(degrees_between(up, np.tile([0.0, 0.0, 1.0], (len(up), 1))))
    assert (tilt > 0.999 * least).all() and (tilt < 1.001 * most).all()
    decades = np.histogram(np.log10(tilt), np.arange(np.log10(least), np.log10(most) + 0.5))[0]
    assert (decades > 0.7 * len(tilt) / len(decades)).all()


def test_what_is_laid_lies_on_a_face() -> None:
    """B is above A with any of its axes up, and touches it to the depth."""
    rng = np.random.default_rng(2)
    size_a, size_b = pose_sets.random_sizes(rng, N)
    pairs = pose_sets.laid(rng, size_a, size_b, np.full(N, 1e-3), np.full(N, 1e-4))
    assert len(pairs.pose_b) > 0.3 * N  # many are placed beside A, and left out
    assert pairs.contacts().separation == pytest.approx(-1e-4, abs=1e-12)
    assert (pairs.pose_b[:, 2] > 0.0).all()
    assert len(np.unique(pairs.size_a, axis=0)) > len(pairs.size_a) - 5


def test_the_right_angles_are_all_24() -> None:
    """Matrices of 0 and ±1 with determinant 1, no two alike."""
    matrices = rotation_matrix(np.array(pose_sets.right_angles()))
    whole = matrices.round()
    assert np.abs(matrices - whole).max() < 1e-12
    assert len(np.unique(whole.reshape(-1, 9), axis=0)) == len(matrices) == 24
    assert np.linalg.det(matrices) == pytest.approx(1.0)


def test_flush_stacks_are_aligned_and_flush() -> None:
    """Right angles to rounding; of the sides, those along y in one plane; the depth is small."""
    pairs = pose_sets.flush_stacks(np.random.default_rng(1), 2000)
    turn = rotation_matrix(pairs.pose_a[:, 3:])
    between = turn.swapaxes(1, 2) @ rotation_matrix(pairs.pose_b[:, 3:])
    offset = np.einsum('nji,nj->ni', turn, pairs.pose_b[:, :3])
    np.testing.assert_allclose(np.abs(between), np.broadcast_to(np.eye(3), (2000, 3, 3)),
                               atol=1e-15)
    assert np.abs(offset[:, 1]).max() < 1e-14
    assert 0.3 < np.mean(np.abs(offset[:, 0]) < 1e-14) < 0.7
    contacts = pairs.contacts()
    depth = -contacts.separation / pairs.size_a[:, 2]
    assert contacts.colliding.all()
    assert 0.99e-5 < depth.min() < 2e-5 and 0.008 < depth.max() < 1.1e-2


def test_boxes_just_apart_have_the_stated_gap() -> None:
    gaps = pose_sets.apart(np.random.default_rng(1), N).contacts().separation
    assert len(gaps) > 0.9 * N and (gaps > 0.99e-6).all() and (gaps < 0.101).all()


def test_sizes_of_pairs_are_the_units_of_errors() -> None:
    pairs = Pairs(*np.zeros((2, 1, 7)), np.array([CUBE]), np.array([(1.0, 5.0, 0.5)]))
    assert pairs.size == 5.0 and pairs.edge == 2.0


@pytest.mark.parametrize('angle', [0.0, 1e-12, 1.0, np.pi - 1e-9])
def test_small_angles_are_kept(angle: float) -> None:
    found = degrees_between(np.array([[1.0, 0.0, 0.0]]),
                            np.array([[np.cos(angle), np.sin(angle), 0.0]]))
    assert np.radians(found) == pytest.approx(angle, rel=1e-12)

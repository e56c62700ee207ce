# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The columns of model `mlp` and what upper faces cut off them, against columns in 60 digits.

In the frame of the reference box P, a column stands on each face of the incident box Q and ends at
P's best face. P's side faces cut it. A∩B is what the columns over Q's lower faces have more than
those over its upper faces.
"""
from __future__ import annotations

from typing import Any

import numpy as np
import oracle
import poses
import pytest
from gmpy2 import mpfr

pytest.importorskip('benchmarks.pose_sets')

from benchmarks.pose_sets import LOADS, SETS, Pairs
from box_contact_ros.core import Stages, native, stages

DEEP_SETS = {name: make for name, make in {**SETS, **LOADS}.items() if name != 'touching'}
"""Those whose pairs are not pressed in."""
N = 12
NAMES = Stages._fields
ROUNDING = 3000 * 2.0**-24
"""Of float32, as the model's header bounds it [of volume and covariance]."""
UNIT = (1.0, 1.0, 1.0)


class Columns:
    """Volume and moments of columns, summed: about the origin of 60 digits, in P's frame."""

    def __init__(self) -> None:
        self.volume = mpfr(0)
        self.first = [mpfr(0)] * 3
        self.second = [[mpfr(0)] * 3 for _ in range(3)]

    def add(self, base: list, up: tuple, top: Any, sign: int) -> None:
        """Add the columns from a convex polygon to the plane up · p = top, times the sign."""
        roof = [oracle.add(p, up, top - oracle.dot(up, p)) for p in base]
        for i in range(1, len(base) - 1):
            p, q, r, a, b, c = (part[k] for part in (base, roof) for k in (0, i, i + 1))
            for corners in ((p, q, r, c), (p, q, c, b), (p, b, c, a)):
                self.add_tetrahedron(corners, sign)

    def add_tetrahedron(self, corners: tuple, sign: int) -> None:
        edges = [oracle.add(corner, corners[0], -1) for corner in corners[1:]]
        v = sign * abs(oracle.dot(edges[0], oracle.cross(*edges[1:]))) / 6
        total = [sum(corner[k] for corner in corners) for k in range(3)]
        self.volume += v
        for j in range(3):
            self.first[j] += v / 4 * total[j]
            for k in range(3):
                self.second[j][k] += v / 20 * (
                    sum(corner[j] * corner[k] for corner in corners) + total[j] * total[k])

    def moments(self) -> tuple[np.ndarray, np.ndarray]:
        """Return centroid (3,) and covariance (3, 3)."""
        mean = [x / self.volume for x in self.first]
        covariance = [[float(self.second[j][k] / self.volume - mean[j] * mean[k])
                       for k in range(3)] for j in range(3)]
        return oracle.as_array(mean), np.array(covariance)


class Truth:
    """The columns of one pair: `lower`, all, and `cut`, what each upper face cuts off (3,)."""

    def __init__(self, pair: Pairs, row: int, face: int) -> None:
        a, b = (oracle.make_box(pose[row], size[row]) for pose, size in
                ((pair.pose_a, pair.size_a), (pair.pose_b, pair.size_b)))
        p, q = (a, b) if face < 3 else (b, a)
        k = face % 3
        over = oracle.dot(oracle.add(q.centre, p.centre, -1), p.axes[k]) > 0
        up = oracle.scaled(p.axes[k], 1 if over else -1)
        top = oracle.dot(p.centre, up) + p.half[k]
        sides = [(oracle.scaled(p.axes[j], sign),
                  sign * oracle.dot(p.centre, p.axes[j]) + p.half[j])
                 for j in range(3) if j != k for sign in (1, -1)]
        self.axes, self.up, self.overlap, self.lower = q.axes, up, Columns(), Columns()
        rises = [oracle.dot(axis, up) for axis in q.axes]
        self.signs = np.array([1.0 if z > 0 else -1.0 for z in rises])
        self.has_level_edges = any(abs(z) < 1e-15 for z in rises)
        self.cut, self.whole = np.zeros(3), np.zeros(3)
        for j in range(3):
            for sign in (1, -1):
                base = oracle._clip(q.face(j, sign), up, top, False)
                upper = sign == self.signs[j]
                self.whole[j] += upper * self._volume(base, top)
                for axis, bound in sides:
                    base = oracle._clip(base, axis, bound, False)
                self.cut[j] += upper * self._volume(base, top)
                self.overlap.add(base, up, top, -1 if upper else 1)
                if not upper:
                    self.lower.add(base, up, top, 1)

    def _volume(self, base: list, top: Any) -> float:
        columns = Columns()
        columns.add(base, self.up, top, 1)
        return float(columns.volume)

    def in_incident(self, mean: np.ndarray, covariance: np.ndarray, found: Stages, row: int,
                    ) -> tuple[np.ndarray, np.ndarray]:
        """Return both along the edges of Q that rise, in the row's unit, as the stages do.

        The origin is where it puts the exact centroid.
        """
        axes = self.signs[:, None] * np.array([oracle.as_array(axis) for axis in self.axes])
        unit = found.unit[row]
        exact = oracle.as_array([x / self.overlap.volume for x in self.overlap.first])
        return (found.true_mean[row] + axes @ (mean - exact) / unit,
                axes @ covariance @ axes.T / unit**2)


def open_share(found: Stages) -> np.ndarray:
    """Return how far the brackets of the volume are apart, (n,), of the volume of the columns."""
    open_volume = found.upper_volume * (found.upper_most - found.upper_least)
    return open_volume.sum(axis=1) / found.columns_volume


def drawn(name: str) -> tuple[Pairs, Stages]:
    """Return pairs of a set and their stages: some as drawn, and those of the widest brackets."""
    pairs = DEEP_SETS[name](np.random.default_rng(12), 3000)
    found = stages(*pairs, names=NAMES)
    fit = found.accurate & (found.columns_volume > 0.0)
    order = np.argsort(np.where(fit, -open_share(found), 1.0))
    rows = np.unique(np.concatenate([order[:N], np.flatnonzero(fit)[:N]]))
    return pairs.rows(rows), Stages(*(part[rows] for part in found))


@pytest.mark.parametrize('name', DEEP_SETS)
def test_columns_and_brackets_hold_the_truth(name: str) -> None:
    """Of each upper face, what P's side faces leave is between the brackets.

    Volume, centroid and covariance of all columns are those in 60 digits, but for float32.
    """
    pairs, found = drawn(name)
    for row, face in enumerate(found.face):
        truth = Truth(pairs, row, face)
        scale = found.volume[row] / found.true_volume[row]  # of volumes, to m³
        assert float(truth.overlap.volume) == pytest.approx(found.volume[row], rel=1e-6)
        volume = float(truth.lower.volume)
        assert found.columns_volume[row] * scale == pytest.approx(volume, rel=ROUNDING)
        whole, slack = found.upper_volume[row] * scale, ROUNDING * volume
        assert np.all(found.upper_least[row] * whole <= truth.cut + slack)
        assert np.all(truth.cut <= found.upper_most[row] * whole + slack)
        assert np.all(whole <= truth.whole + slack)
        if truth.has_level_edges:  # their sign is free
            continue
        for columns, mean_of, covariance_of in (
                (truth.lower, found.columns_mean, found.columns_covariance),
                (truth.overlap, found.true_mean, found.true_covariance)):
            mean, covariance = truth.in_incident(*columns.moments(), found, row)
            trace = np.trace(covariance)
            np.testing.assert_allclose(mean_of[row], mean, atol=ROUNDING * np.sqrt(trace))
            np.testing.assert_allclose(covariance_of[row], covariance, atol=ROUNDING * trace)


@pytest.mark.parametrize('name', DEEP_SETS)
def test_brackets_are_shares_and_points_carry_all(name: str) -> None:
    """0 ≤ least ≤ most ≤ 1; the two points of an upper face carry all or, above the water, none."""
    _, found = drawn(name)
    assert np.all((0.0 <= found.upper_least) & (found.upper_least <= found.upper_most)
                  & (found.upper_most <= 1.0))
    carried = found.upper_carries.sum(axis=2)
    under_water = found.upper_volume > 0.0
    np.testing.assert_allclose(carried[under_water], 1.0, atol=1e-6)
    assert np.isfinite(found.upper_features).all() and np.isfinite(found.upper_points).all()


# --- the arrays -----------------------------------------------------------------------------------


@pytest.mark.parametrize('name', {**SETS, **LOADS})
def test_stages_are_those_of_a_batch(name: str) -> None:
    """Bit for bit: verdict, separation, normal, and the exact point and volume, in A's frame."""
    pairs = {**SETS, **LOADS}[name](np.random.default_rng(5), 500)
    at_origin = np.tile(poses.IDENTITY, (len(pairs.pose_a), 1))
    turn = pairs.pose_a[:, 3:] * (-1, -1, -1, 1)
    b = np.concatenate([poses.rotate(turn, pairs.pose_b[:, :3] - pairs.pose_a[:, :3]),
                        poses.multiply(turn, pairs.pose_b[:, 3:])], axis=1)
    found = stages(at_origin, b, *pairs[2:], names=NAMES)
    rows, _ = native.PairSolver('exact', UNIT, UNIT).solve(at_origin, b, *pairs[2:], 1)
    for one, other in zip((found.colliding, found.separation, found.normal, found.centroid,
                           found.volume, found.covariance), rows):
        assert np.array_equal(one, other)
    assert np.all(found.face < 6) and np.all(found.axis < 15)
    assert np.all(found.axis[found.axis < 6] == found.face[found.axis < 6])

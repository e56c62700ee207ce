# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pairs of boxes apart, by families that break distances, and a judge of nearest points.

The judge knows no nearest points. It proves those that it is given: two points on the boxes are an
upper bound of the distance, and the gap between the boxes along any direction is a lower bound.
Both are computed in extended precision (64 bits).
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from box_contact_ros.solver.contact_solver import ContactSolver
from box_contact_ros.solver.nearest import Nearests
from box_contact_ros.solver.pose import rotation_matrix

from .judge import AXES, _axes, _axis, _dot
from .pose_sets import CONTAINER, Pairs, log_uniform, quaternion_multiply, turns, unit_quaternions

ROUNDS = 60  # of a bisection: as many as a double has digits, and some
Shape = Callable[[np.random.Generator, int], tuple[np.ndarray, np.ndarray]]


def _any_size(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    return rng.uniform(0.2, 2.0, (n, 3)), rng.uniform(0.2, 2.0, (n, 3))


def _needles(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Draw boxes of which two extents are 10,000 times shorter than the third."""
    size_a, size_b = _any_size(rng, n)
    size_a[:, :2] *= 1e-4
    size_b[:, :2] *= 1e-4
    return rng.permuted(size_a, axis=1), rng.permuted(size_b, axis=1)


def _plates(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    size_a, size_b = _any_size(rng, n)
    size_a[:, 0] *= 1e-5
    size_b[:, 1] *= 1e-5
    return size_a, size_b


def _containers(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    return np.tile(CONTAINER, (n, 1)), np.tile(CONTAINER, (n, 1))


def _unequal(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Draw boxes of 1e-6 to 1e6, and others up to a million times smaller."""
    size_a, size_b = _any_size(rng, n)
    scale = log_uniform(rng, 1e-6, 1e6, n)[:, None]
    return scale * size_a, scale * log_uniform(rng, 1e-6, 1.0, n)[:, None] * size_b


@dataclass(frozen=True)
class Family:
    """How pairs are drawn. Lengths are in the unit that the sizes of about 1 have."""

    gap: tuple[float, float] = (1e-9, 1.0)
    turn: str = 'none'
    """How B is turned against A: 'any', 'yaw' or 'none'."""
    tilt: tuple[float, float] | None = None
    """Angle of another turn of B about any axis [rad]."""
    along: str = 'axis'
    """Where B is: 'any' direction, beside a 'side' of A, 'above' it, or along any 'axis'."""
    moved: bool = True
    """Whether both boxes are turned together."""
    shape: Shape = _any_size


FAMILIES = {
    'random': Family((0.01, 2.0), 'any', along='any'),
    'swaying containers': Family((1e-3, 0.16), 'yaw', (1e-3, 0.05), shape=_containers),
    'close': Family((1e-12, 1e-3), 'any', along='any'),
    'far': Family((1e3, 1e6), 'any', along='any'),
    'aligned': Family(moved=False),
    'aligned, moved': Family(),
    'yaw, side by side': Family(turn='yaw', along='side', moved=False),
    'yaw, stacked': Family(turn='yaw', along='above', moved=False),
    'yaw, stacked, moved': Family(turn='yaw', along='above'),
    'tilts 1e-12 to 1e-3': Family(tilt=(1e-12, 1e-3)),
    'tilts 1e-17 to 1e-12': Family(tilt=(1e-17, 1e-12)),
    'yaw and tilts': Family(turn='yaw', tilt=(1e-12, 1e-3)),
    'needles': Family((0.01, 2.0), 'any', along='any', shape=_needles),
    'plates': Family((0.01, 2.0), 'any', along='any', shape=_plates),
    'sizes 1e-6 to 1e6': Family((0.01, 2.0), 'any', along='any', shape=_unequal),
    'nearly touching': Family((1e-17, 1e-14), 'any', along='any')}


def draw(name: str, rng: np.random.Generator, n: int) -> Pairs:
    """Draw n pairs of a family, nearly all of them apart: B is moved to the gap by bisection."""
    family = FAMILIES[name]
    size_a, size_b = family.shape(rng, n)
    unit = size_a.max(axis=1) / 2.0
    turn_b = {'any': lambda: unit_quaternions(rng, n),
              'yaw': lambda: turns((0, 0, 1), rng.uniform(0.0, 6.0, n)),
              'none': lambda: np.tile([0.0, 0.0, 0.0, 1.0], (n, 1))}[family.turn]()
    if family.tilt:
        tilt = log_uniform(rng, *family.tilt, n)
        turn_b = quaternion_multiply(turn_b, turns(rng.normal(size=(n, 3)), tilt))
    aside, direction = _placement(family.along, rng, n)
    gap = log_uniform(rng, *family.gap, n) * unit
    low, high = np.zeros(n), 10.0 * unit + 2.0 * gap
    poses_a, poses_b = np.zeros((2, n, 7))
    poses_a[:, 6], poses_b[:, 3:] = 1.0, turn_b
    for _ in range(ROUNDS):
        middle = 0.5 * (low + high)
        poses_b[:, :3] = aside * size_a + middle[:, None] * direction
        near = ContactSolver().distance_batch(poses_a, poses_b, size_a=size_a, size_b=size_b,
                                              ).distance < gap
        low, high = np.where(near, middle, low), np.where(near, high, middle)
    poses_b[:, :3] = aside * size_a + high[:, None] * direction
    if family.moved:
        turn, shift = unit_quaternions(rng, n), unit[:, None] * rng.uniform(-3.0, 3.0, (n, 3))
        for poses in (poses_a, poses_b):
            poses[:, :3] = np.einsum('nij,nj->ni', rotation_matrix(turn), poses[:, :3]) + shift
            poses[:, 3:] = quaternion_multiply(turn, poses[:, 3:])
    return Pairs(poses_a, poses_b, size_a, size_b)


def _placement(along: str, rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return where B is beside A's centre [A's extents], and along which direction, (n, 3) each.

    Three in ten of the boxes beside an axis or a side are along a diagonal: edge to edge.
    """
    if along == 'any':
        direction = rng.normal(size=(n, 3))
        return np.zeros((n, 3)), direction / np.linalg.norm(direction, axis=1, keepdims=True)
    rows, axis = np.arange(n), {'side': rng.integers(0, 2, n), 'above': np.full(n, 2),
                                'axis': rng.integers(0, 3, n)}[along]
    aside, direction = rng.uniform(-0.5, 0.5, (n, 3)), np.zeros((n, 3))
    aside[rows, axis], direction[rows, axis] = 0.0, 1.0
    diagonal = (rng.random(n) < 0.3) & (along != 'above')
    direction[rows, (axis + 1) % 3] = diagonal
    return aside, direction / np.linalg.norm(direction, axis=1, keepdims=True)


class Proof(NamedTuple):
    """What nearest points are worth, in units of 2⁻⁵³ times the largest size or coordinate.

    No error is larger than it says, and the doubt of the true distance is in it.
    """

    true: np.ndarray  # (n,) the middle of both bounds of the distance [m]
    unit: np.ndarray  # (n,) [m]
    doubt: np.ndarray  # (n,) of the true distance
    above: np.ndarray  # (n,) by how much the distance may exceed the true one
    below: np.ndarray  # (n,) by how much it may stay below
    outside: np.ndarray  # (n,) how far the points are outside their boxes
    length: np.ndarray  # (n,) by how much the points' distance differs from the distance


def prove(pairs: Pairs, found: Nearests) -> Proof:
    """Prove nearest points of pairs apart. Rows in contact get NaN."""
    parts = [part.T.astype(np.longdouble) for part in pairs]
    distance, normal, point_a, point_b = (
        np.where(found.colliding, np.nan, part.T).astype(np.longdouble)
        for part in (found.distance, found.normal, found.point_a, found.point_b))
    boxes = [_Box(pose[:3], _axes(pose[3:]), size / 2)
             for pose, size in zip(parts[:2], parts[2:])]
    # From any point of a box to the nearest one of the other is a bound from above, whatever was
    # wrong with a point. This way is across a face or an edge to the last digit.
    starts = boxes[0].nearest(point_b), boxes[1].nearest(point_a)
    ways = boxes[1].nearest(starts[0]) - starts[0], starts[1] - boxes[0].nearest(starts[1])
    length = point_b - point_a
    lower = _lower_bound(*boxes, (normal, *ways))
    upper = np.minimum(*(np.sqrt(_dot(way, way)) for way in ways))
    unit = 2.0**-53 * np.abs(np.hstack([pairs.pose_a[:, :3], pairs.pose_b[:, :3], *pairs[2:]])
                             ).max(axis=1)
    return Proof(np.asarray((lower + upper) / 2, dtype=np.float64), unit, *(
        np.asarray(part / unit, dtype=np.float64) for part in (
            (upper - lower) / 2, distance - lower, upper - distance,
            np.maximum(*(box.outside(point) for box, point in zip(boxes, (point_a, point_b)))),
            np.abs(np.sqrt(_dot(length, length)) - distance))))


class _Box(NamedTuple):
    """n boxes: centres (3, n), axes (axis 3, component 3, n), half extents (3, n)."""

    centre: np.ndarray
    axes: np.ndarray
    half: np.ndarray

    def local(self, point: np.ndarray) -> np.ndarray:
        return np.array([_dot(axis, point - self.centre) for axis in self.axes])

    def outside(self, point: np.ndarray) -> np.ndarray:
        return np.max(np.abs(self.local(point)) - self.half, axis=0)

    def nearest(self, point: np.ndarray) -> np.ndarray:
        place = np.clip(self.local(point), -self.half, self.half)
        return self.centre + sum(part * axis for part, axis in zip(place, self.axes))

    def reach(self, direction: np.ndarray) -> np.ndarray:
        return sum(half * np.abs(_dot(axis, direction)) for half, axis in zip(self.half, self.axes))


def _lower_bound(a: _Box, b: _Box, directions: tuple[np.ndarray, ...]) -> np.ndarray:
    """Return the largest gap (n,) along directions (3, n): each of them is a bound.

    The axes of the separating-axis test are good where edges are almost parallel.
    """
    axes = (_axis(a.axes, b.axes, number) for number in range(AXES))
    return np.nanmax([_gap(a, b, direction) for direction in (*directions, *axes)], axis=0)


def _gap(a: _Box, b: _Box, direction: np.ndarray) -> np.ndarray:
    """Return the gap (n,) along directions (3, n) of any length, from either box to the other."""
    length = np.sqrt(_dot(direction, direction))
    way = np.abs(_dot(b.centre - a.centre, direction)) - a.reach(direction) - b.reach(direction)
    return np.asarray(way / np.where(length > 0.0, length, np.nan))

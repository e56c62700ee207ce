# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Named sets of posed pairs of boxes: reports and training draw from them.

A set is a function (rng, n) -> Pairs with about n pairs: a few draws miss and are left out. A pair
that overlaps deeply is drawn first, then a depth. B moves out along SAT's normal to that depth,
which keeps the axis.
"""
from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from box_contact_ros.scene.boxes import CONTAINER as CONTAINER
from box_contact_ros.solver.contact import Contacts
from box_contact_ros.solver.contact_solver import ContactSolver
from box_contact_ros.solver.pose import rotation_matrix

CUBE = (2.0, 2.0, 2.0)
TWENTY, HIGH_CUBE = (6.058, 2.438, 2.591), (12.192, 2.438, 2.896)
"""ISO 20 ft, and 40 ft high cube [m]."""
Z = (0.0, 0.0, 1.0)


class Pairs(NamedTuple):
    """n pairs: poses (n, 7), full extents (n, 3)."""

    pose_a: np.ndarray
    pose_b: np.ndarray
    size_a: np.ndarray
    size_b: np.ndarray

    @property
    def size(self) -> np.ndarray:
        """Return the largest extents (n,) of both boxes [m]: the unit of depths."""
        return np.maximum(self.size_a.max(axis=1), self.size_b.max(axis=1))

    @property
    def edge(self) -> np.ndarray:
        """Return the longest edges (n,) of the smaller boxes [m]: the unit of point errors."""
        return np.minimum(self.size_a.max(axis=1), self.size_b.max(axis=1))

    def rows(self, chosen: np.ndarray | slice) -> Pairs:
        """Return some of the pairs, in contiguous arrays."""
        return Pairs(*(np.ascontiguousarray(part[chosen]) for part in self))

    def beyond(self, points: np.ndarray) -> np.ndarray:
        """Return how far points (n, 3) are outside either box, along its axes [m], (n,).

        A single pair takes any number of points.
        """
        farthest = []
        for pose, size in ((self.pose_a, self.size_a), (self.pose_b, self.size_b)):
            local = np.einsum('nji,nj->ni', rotation_matrix(pose[:, 3:]), points - pose[:, :3])
            farthest.append((np.abs(local) - 0.5 * size).max(axis=1))
        return np.maximum(*farthest)

    def contacts(self, solver: ContactSolver | None = None) -> Contacts:
        """Return the contacts by a solver, without one the exact ones."""
        solver = solver or ContactSolver()
        return solver.batch(self.pose_a, self.pose_b, size_a=self.size_a, size_b=self.size_b)


Generator = Callable[[np.random.Generator, int], Pairs]


def joined(parts: Sequence[Pairs]) -> Pairs:
    """Return the pairs of all parts, one part after the other."""
    return Pairs(*(np.concatenate(columns) for columns in zip(*parts)))



def unit_quaternions(rng: np.random.Generator, n: int) -> np.ndarray:
    """Orientations (n, 4) xyzw, uniform over all."""
    q = rng.normal(size=(n, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def quaternion_multiply(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the Hamilton product p ⊗ q of quaternions (..., 4) xyzw: first q, then p."""
    px, py, pz, pw = np.moveaxis(np.asarray(p, dtype=np.float64), -1, 0)
    qx, qy, qz, qw = np.moveaxis(np.asarray(q, dtype=np.float64), -1, 0)
    return np.stack([pw * qx + px * qw + py * qz - pz * qy,
                     pw * qy - px * qz + py * qw + pz * qx,
                     pw * qz + px * qy - py * qx + pz * qw,
                     pw * qw - px * qx - py * qy - pz * qz], axis=-1)


def turns(axes: ArrayLike, angles: np.ndarray) -> np.ndarray:
    """Quaternions (n, 4) xyzw of rotations about axes (n, 3) or (3,) by angles (n,) [rad]."""
    axes = np.broadcast_to(np.asarray(axes, dtype=np.float64), (len(angles), 3))
    axes = axes / np.linalg.norm(axes, axis=1, keepdims=True)
    return np.concatenate([axes * np.sin(0.5 * angles)[:, None], np.cos(0.5 * angles)[:, None]],
                          axis=1)


def turned(axis: ArrayLike, angle: float) -> np.ndarray:
    """Return the quaternion (4,) xyzw of a rotation about an axis (3,) by an angle [rad]."""
    return turns(axis, np.array([angle]))[0]


@cache
def right_angles() -> list[np.ndarray]:
    """Return the 24 orientations that map axes on axes."""
    found = [np.array([0.0, 0.0, 0.0, 1.0])]
    for q in found:  # grows while the loop runs
        for axis in np.eye(3):
            new = quaternion_multiply(q, turned(axis, 0.5 * np.pi))
            if all(min(np.abs(new - p).max(), np.abs(new + p).max()) > 1e-6 for p in found):
                found.append(new)
    return found


def log_uniform(rng: np.random.Generator, low: float, high: float, n: int | tuple[int, ...],
                ) -> np.ndarray:
    """Numbers of shape `n` whose logarithms are uniform."""
    return np.exp(rng.uniform(np.log(low), np.log(high), n))


def at_depth(pairs: Pairs, depth: np.ndarray) -> Pairs:
    """Return the pairs that overlap, with B moved along SAT's normal to `depth` (n,) [m]."""
    a, b, size_a, size_b = pairs
    found = pairs.contacts()
    rows = found.colliding
    moved = b[rows].copy()
    moved[:, :3] += (-found.separation - depth)[rows, None] * found.normal[rows]
    return Pairs(a[rows], moved, size_a[rows], size_b[rows])


def any_pose(rng: np.random.Generator, size_a: np.ndarray, size_b: np.ndarray,
             depth: np.ndarray) -> Pairs:
    """Boxes in any orientation: a random place of A meets a random place of B, then `depth`."""
    n = len(size_a)
    turn_a, turn_b = unit_quaternions(rng, n), unit_quaternions(rng, n)
    at_a = np.einsum('nij,nj->ni', rotation_matrix(turn_a), rng.uniform(-0.5, 0.5, (n, 3)) * size_a)
    at_b = np.einsum('nij,nj->ni', rotation_matrix(turn_b), rng.uniform(-0.5, 0.5, (n, 3)) * size_b)
    a = np.concatenate([np.zeros((n, 3)), turn_a], axis=1)
    b = np.concatenate([at_a - at_b, turn_b], axis=1)
    return at_depth(Pairs(a, b, size_a, size_b), depth)


def _level(heading: np.ndarray) -> np.ndarray:
    """Return the level unit vectors (n, 3) of headings (n,) [rad]."""
    return np.stack([np.cos(heading), np.sin(heading), np.zeros(len(heading))], axis=1)


def _tilted(heading: np.ndarray, tilt: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """Return orientations (n, 4): turned by yaw, then tilted about a level axis [rad]."""
    return quaternion_multiply(turns(_level(heading), tilt), turns(Z, yaw))


def onto(place: np.ndarray, turn: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
         depth: np.ndarray) -> Pairs:
    """Return pairs with A at the origin and B at places (n, 3), orientations (n, 4), to `depth`."""
    a = np.tile([0.0, 0, 0, 0, 0, 0, 1], (len(place), 1))
    return at_depth(Pairs(a, np.concatenate([place, turn], axis=1), size_a, size_b), depth)


def stacked(rng: np.random.Generator, size: tuple[float, float, float], tilt: np.ndarray,
            yaw: np.ndarray, depth: np.ndarray) -> Pairs:
    """Draw one box on another of the same size, tilted about a random level axis, turned by yaw.

    Both angles are in [rad]. The box is off the other's middle by up to 0.98 of the size.
    """
    n = len(tilt)
    sizes = np.tile(np.array(size), (n, 1))
    turn = _tilted(rng.uniform(-np.pi, np.pi, n), tilt, yaw)
    place = np.concatenate([0.98 * rng.uniform(-1, 1, (n, 2)) * sizes[:, :2],
                            0.98 * sizes[:, 2:]], axis=1)
    return onto(place, turn, sizes, sizes, depth)


def laid(rng: np.random.Generator, size_a: np.ndarray, size_b: np.ndarray, tilt: np.ndarray,
         depth: np.ndarray) -> Pairs:
    """Draw B anywhere on A, tilted about a random level axis [rad], turned by any yaw.

    Any axis of either box is up; sizes (n, 3).
    """
    n = len(tilt)
    orders = np.array([[0, 1, 2], [1, 2, 0], [2, 0, 1]])
    size_a = np.take_along_axis(size_a, orders[rng.integers(0, 3, n)], axis=1)
    size_b = np.take_along_axis(size_b, orders[rng.integers(0, 3, n)], axis=1)
    heading, yaw = (rng.uniform(-np.pi, np.pi, n) for _ in range(2))
    turn = _tilted(heading, tilt, yaw)
    # A random place of A's top meets a random place of B's bottom.
    at_b = 0.49 * rng.uniform(-2, 2, (n, 2)) * size_b[:, :2]
    across = np.stack([np.cos(yaw) * at_b[:, 0] - np.sin(yaw) * at_b[:, 1],
                       np.sin(yaw) * at_b[:, 0] + np.cos(yaw) * at_b[:, 1]], axis=1)
    place = np.concatenate([0.49 * rng.uniform(-2, 2, (n, 2)) * size_a[:, :2] - across,
                            0.5 * (size_a + size_b)[:, 2:]], axis=1)
    place[:, 2] -= 0.01 * np.minimum(size_a[:, 2], size_b[:, 2])
    return onto(place, turn, size_a, size_b, depth)


def drawn(make: Generator, rng: np.random.Generator, n: int) -> Pairs:
    """Draw exactly n pairs of a set: up to 7 draws in 100 miss."""
    return make(rng, n + n // 10 + 20).rows(slice(n))


def cubes(rng: np.random.Generator, n: int) -> Pairs:
    """Cubes of edge 2 in any pose, 0.1–10 % of the edge deep."""
    sizes = np.tile(CUBE, (n, 1))
    return any_pose(rng, sizes, sizes, 2.0 * log_uniform(rng, 1e-3, 0.1, n))


def touching(rng: np.random.Generator, n: int) -> Pairs:
    """Cubes of edge 2 in any pose that just touch: the paper's boxes, but for its angles."""
    sizes = np.tile(CUBE, (n, 1))
    return any_pose(rng, sizes, sizes, np.zeros(n))


def stacks(rng: np.random.Generator, n: int) -> Pairs:
    """Cubes of edge 2 stacked almost parallel: tilt 1e-6–1e-3 rad, 1e-3 m deep, any yaw."""
    return stacked(rng, CUBE, log_uniform(rng, 1e-6, 1e-3, n), rng.uniform(-np.pi, np.pi, n),
                   np.full(n, 1e-3))


def tilted(rng: np.random.Generator, n: int) -> Pairs:
    """Cubes of edge 2 stacked with a tilt of 1e-3–0.1 rad, 1e-3 m deep, any yaw."""
    return stacked(rng, CUBE, log_uniform(rng, 1e-3, 0.1, n), rng.uniform(-np.pi, np.pi, n),
                   np.full(n, 1e-3))


def on_cube(pose_b: np.ndarray) -> Pairs:
    """Return pairs of cubes of edge 2, A at the origin and B at poses (n, 7)."""
    sizes = np.tile(CUBE, (len(pose_b), 1))
    return Pairs(np.tile([0.0, 0, 0, 0, 0, 0, 1], (len(pose_b), 1)), pose_b, sizes, sizes)


def containers(rng: np.random.Generator, n: int) -> Pairs:
    """40 ft containers with sway: roll, pitch, yaw within ±5°, met anywhere, 0.1–10 % deep."""
    sizes = np.tile(CONTAINER, (n, 1))
    roll, pitch, yaw = np.radians(rng.uniform(-5, 5, (3, n)))
    turn = quaternion_multiply(quaternion_multiply(
        turns(Z, yaw), turns((0.0, 1.0, 0.0), pitch)), turns((1.0, 0.0, 0.0), roll))
    place = 0.95 * rng.uniform(-1, 1, (n, 3)) * sizes
    return onto(place, turn, sizes, sizes, 2.438 * log_uniform(rng, 1e-3, 0.1, n))


def random_sizes(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Sizes (n, 3) of two boxes: each of aspect to 1:20, longest edges to 1:20."""
    sizes = log_uniform(rng, 1.0, 20.0, (2, n, 3))
    size_a, size_b = sizes / sizes.max(axis=2, keepdims=True)
    return size_a, size_b * log_uniform(rng, 1.0 / 20.0, 20.0, n)[:, None]


def size_pairs(rng: np.random.Generator, n: int) -> Pairs:
    """Random pairs of sizes, aspect to 1:20, size ratio to 1:20, any pose, 0.1–10 % deep."""
    size_a, size_b = random_sizes(rng, n)
    shortest = np.minimum(size_a.min(axis=1), size_b.min(axis=1))
    return any_pose(rng, size_a, size_b, shortest * log_uniform(rng, 1e-3, 0.1, n))


def parcels(rng: np.random.Generator, n: int) -> Pairs:
    """Parcels of 0.4 × 0.3 × 0.2 m on a pallet, tilt to 1°, any yaw, 0.1–5 % of its height deep."""
    pallet, parcel = (np.tile(size, (n, 1)) for size in ((1.2, 0.8, 0.144), (0.4, 0.3, 0.2)))
    turn = _tilted(rng.uniform(-np.pi, np.pi, n), log_uniform(rng, 1e-5, np.radians(1.0), n),
                   rng.uniform(-np.pi, np.pi, n))
    place = np.column_stack([rng.uniform(-1, 1, (n, 2)) * (0.55, 0.38), np.full(n, 0.17)])
    return onto(place, turn, pallet, parcel, 0.144 * log_uniform(rng, 1e-3, 0.05, n))


def crossed_bars(rng: np.random.Generator, n: int) -> Pairs:
    """Bars of 6 × 0.3 × 0.3 m laid across each other, tilt to 2°, 0.1–5 % of their width deep."""
    sizes = np.tile((6.0, 0.3, 0.3), (n, 1))
    yaw = rng.uniform(np.radians(20.0), np.radians(160.0), n)
    turn = _tilted(rng.uniform(-np.pi, np.pi, n), log_uniform(rng, 1e-5, np.radians(2.0), n), yaw)
    along, across = rng.uniform(-2.8, 2.8, (2, n, 1))
    place = (np.eye(3)[0] * along - across * np.column_stack([_level(yaw)])
             + np.array([0.0, 0.0, 0.295]))
    return onto(place, turn, sizes, sizes, 0.3 * log_uniform(rng, 1e-3, 0.05, n))


def overhang(rng: np.random.Generator, n: int) -> Pairs:
    """Containers that overhang others by 85–97 %, tilt to 1°, 1e-4–1e-2 m deep."""
    sizes = np.tile(CONTAINER, (n, 1))
    turn = _tilted(rng.uniform(-np.pi, np.pi, n), log_uniform(rng, 1e-6, np.radians(1.0), n),
                   np.radians(rng.uniform(-2.0, 2.0, n)))
    beyond, other = rng.uniform(0.85, 0.97, n), rng.uniform(-0.2, 0.2, n)
    place = np.where(rng.random((n, 1)) < 0.5, np.column_stack([beyond, other]),
                     np.column_stack([other, beyond])) * CONTAINER[:2]
    place = np.column_stack([place, np.full(n, 0.995 * CONTAINER[2])])
    return onto(place, turn, sizes, sizes, log_uniform(rng, 1e-4, 1e-2, n))


def near_flush(rng: np.random.Generator, n: int) -> Pairs:
    """Containers stacked squarely: offsets of 1e-9–1e-2 m or none, yaw to 1e-3 rad or none."""
    def often(values: np.ndarray) -> np.ndarray:
        return values * (rng.random(values.shape) < 0.7)

    sizes = np.tile(CONTAINER, (n, 1))
    turn = _tilted(rng.uniform(-np.pi, np.pi, n), often(log_uniform(rng, 1e-9, 1e-3, n)),
                   often(log_uniform(rng, 1e-9, 1e-3, n)))
    shift = often(log_uniform(rng, 1e-9, 1e-2, (n, 2))) * rng.choice([-1.0, 1.0], (n, 2))
    place = np.column_stack([shift, np.full(n, 0.995 * CONTAINER[2])])
    return onto(place, turn, sizes, sizes, log_uniform(rng, 1e-6, 1e-2, n))


def landings(rng: np.random.Generator, n: int) -> Pairs:
    """Containers set down on containers: off by 0.5 and 0.25 m, tilt to 0.02 rad, yaw to 1°."""
    sizes = np.tile(CONTAINER, (n, 1))
    turn = _tilted(rng.uniform(-np.pi, np.pi, n), log_uniform(rng, 1e-5, 2e-2, n),
                   np.radians(rng.uniform(-1.0, 1.0, n)))
    place = np.column_stack([rng.uniform(-0.5, 0.5, n), rng.uniform(-0.25, 0.25, n),
                             np.full(n, 0.98 * CONTAINER[2])])
    return onto(place, turn, sizes, sizes, log_uniform(rng, 5e-4, 2e-2, n))


def flush_stacks(rng: np.random.Generator, n: int) -> Pairs:
    """Equal boxes stacked flush, sides in one plane, 1e-5 to 0.01 of the height deep.

    Half are cubes and half containers. B is right above A, or displaced along x; half of all B have
    a half turn about z. Half of the pairs are turned as a whole, which rounds their angles.
    """
    size = np.where(rng.random(n)[:, None] < 0.5, CUBE, CONTAINER)
    place = np.zeros((n, 3))
    place[:, 0] = size[:, 0] * rng.uniform(-0.5, 0.5, n) * (rng.random(n) < 0.5)
    place[:, 2] = size[:, 2] * (1.0 - log_uniform(rng, 1e-5, 1e-2, n))
    half_turn = turns(Z, np.pi * rng.integers(0, 2, n))
    whole = turns(rng.normal(size=(n, 3)), rng.uniform(0.0, np.pi, n) * (rng.random(n) < 0.5))
    above = np.einsum('nij,nj->ni', rotation_matrix(whole), place)
    return Pairs(np.hstack([np.zeros((n, 3)), whole]),
                 np.hstack([above, quaternion_multiply(whole, half_turn)]), size, size.copy())


def plates(rng: np.random.Generator, n: int) -> np.ndarray:
    """Sizes (n, 3) of plates of aspect to 1:50."""
    return np.column_stack([rng.uniform(0.3, 1.0, (n, 2)), log_uniform(rng, 0.02, 0.2, n)])


def needles(rng: np.random.Generator, n: int) -> np.ndarray:
    """Sizes (n, 3) of needles of aspect to 1:50."""
    return np.column_stack([np.ones(n), *log_uniform(rng, 0.02, 0.2, (2, n))])


KINDS: dict[str, Callable[[np.random.Generator, int], tuple[np.ndarray, np.ndarray]]] = {
    'cubes': lambda rng, n: (np.ones((n, 3)), np.ones((n, 3))),
    'sizes to 1:20': random_sizes,
    'plates': lambda rng, n: (plates(rng, n), plates(rng, n)),
    'needles': lambda rng, n: (needles(rng, n), needles(rng, n)),
}
"""Sizes of both boxes (n, 3) each, by the kind of pairs that may be deep in each other."""


def deep(rng: np.random.Generator, n: int) -> Pairs:
    """Boxes deep in each other, a quarter of each of `KINDS`, 10–70 % of the shortest edge deep."""
    parts = []
    for make in KINDS.values():
        a, b = make(rng, n // 4)
        shortest = np.minimum(a.min(axis=1), b.min(axis=1))
        parts.append(any_pose(rng, a, b, shortest * rng.uniform(0.1, 0.7, n // 4)))
    return joined(parts)


def through(kind: str, rng: np.random.Generator, n: int) -> Pairs:
    """Boxes of a kind that are through or in each other: centres meet, to a fifth of an edge."""
    a, b = KINDS[kind](rng, n)
    turn_a, turn_b = unit_quaternions(rng, n), unit_quaternions(rng, n)
    reach = 0.2 * np.minimum(a.max(axis=1), b.max(axis=1))[:, None]
    pairs = Pairs(np.hstack([np.zeros((n, 3)), turn_a]),
                  np.hstack([reach * rng.uniform(-1.0, 1.0, (n, 3)), turn_b]), a, b)
    return pairs.rows(pairs.contacts().colliding)


def symmetric(rng: np.random.Generator, n: int) -> Pairs:
    """Pairs with a mirror or a two-fold turn, as plans and plain landings have them.

    A quarter each: pitched alone and off along x alone, rolled alone and off along y alone, centre
    above centre at any yaw, and flush at rest. A third each of the first three are cubes,
    containers, and boxes of any two sizes.
    """
    share = n // 4

    def sizes() -> tuple[np.ndarray, np.ndarray]:
        kind = rng.integers(0, 3, (share, 1))
        a, b = (np.where(kind == 0, CUBE, np.where(kind == 1, CONTAINER, size))
                for size in random_sizes(rng, share))
        return a, b

    parts = []
    for axis in (0, 1, None):  # along which the boxes are off
        size_a, size_b = sizes()
        place = np.zeros((share, 3))
        place[:, 2] = 0.49 * (size_a + size_b)[:, 2]
        turn = turns(Z, rng.uniform(-np.pi, np.pi, share))
        if axis is not None:
            reach = 0.5 * (size_a + size_b)[:, axis]
            place[:, axis] = 0.98 * reach * rng.uniform(-1.0, 1.0, share)
            turn = turns(np.eye(3)[1 - axis], log_uniform(rng, 1e-6, 0.1, share)
                         * rng.choice([-1.0, 1.0], share))
        lower = np.minimum(size_a.min(axis=1), size_b.min(axis=1))
        parts.append(onto(place, turn, size_a, size_b, lower * log_uniform(rng, 1e-4, 0.05, share)))
    return joined([*parts, flush_stacks(rng, share)])


def apart(rng: np.random.Generator, n: int) -> Pairs:
    """Boxes 1e-6 to 0.1 m apart: half containers almost stacked, half cubes in any pose."""
    half = n // 2
    size = np.tile(CUBE, (half, 1))
    loose = any_pose(rng, size, size, np.full(half, 0.01))
    yard = stacked(rng, CONTAINER, log_uniform(rng, 1e-6, 0.05, n - half),
                   rng.uniform(-0.1, 0.1, n - half), np.full(n - half, 0.01))
    parts = [at_depth(pairs, -log_uniform(rng, 1e-6, 0.1, len(pairs.size)))
             for pairs in (loose, yard)]
    both = joined(parts)
    return both.rows(rng.permutation(len(both.size)))  # the first ones are of both kinds


SETS: dict[str, Generator] = {
    'random cubes': cubes,
    'touching': touching,
    'random sizes': size_pairs,
    'stacks': stacks,
    'tilted stacks': tilted,
    'containers': containers,
    'deep': deep,
}
"""The sets of all reports."""
LOADS: dict[str, Generator] = {
    'parcels': parcels,
    'crossed bars': crossed_bars,
    'overhang': overhang,
    'near flush': near_flush,
    'landings': landings,
}
"""Loads on what they stand on: more sets of `accuracy` and `native`."""
THROUGH: dict[str, Generator] = {f'{kind} through each other': partial(through, kind)
                                 for kind in KINDS}
"""More sets of `accuracy`: the network of `mlp` is not trained for them."""
FLUSH: dict[str, Generator] = {'aligned flush stacks': flush_stacks}
"""One more set of `native`: the slowest for most ways to the overlap."""

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recipes of the hard poses, by what makes them hard: parallel, touching, deep, tied, thin, far.

Each family is a generator of pairs in a plain frame; `variants` then turns them, swaps the boxes,
renames their axes and scales them. `make_hard_poses.py` stores what they draw, with the truth.
"""
from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from poses import NEEDLE, needles

from benchmarks.pose_sets import CONTAINER as FORTY
from benchmarks.pose_sets import (
    CUBE,
    HIGH_CUBE,
    TWENTY,
    Pairs,
    quaternion_multiply,
    right_angles,
    turned,
)
from box_contact_ros.solver.pose import rotation_matrix

X, Y, Z = np.eye(3)
UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0])

Case = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""pose_a, pose_b (7,), size_a, size_b (3,)."""


# --- tools ----------------------------------------------------------------------------------------


def at(place: tuple[float, ...] | np.ndarray, turn: np.ndarray = UPRIGHT,
       size_a: tuple[float, ...] | np.ndarray = CUBE,
       size_b: tuple[float, ...] | np.ndarray | None = None) -> Case:
    """Return the case of A at the origin and B at a place [m]; without `size_b`, of equal boxes."""
    size_b = size_a if size_b is None else size_b
    return (np.append(np.zeros(3), UPRIGHT), np.append(place, turn),
            np.array(size_a, dtype=np.float64), np.array(size_b, dtype=np.float64))


def placed(size_a: tuple[float, ...], size_b: tuple[float, ...], turn: np.ndarray,
           along: np.ndarray, gap: float, lateral: tuple[float, ...] | np.ndarray = (0.0, 0.0, 0.0),
           turn_a: np.ndarray = UPRIGHT) -> Case:
    """Return A at the origin, B beyond A along a unit direction, `gap` between projections."""
    reach = 0.5 * sum(np.abs(along @ rotation_matrix(q)) @ np.asarray(size, dtype=np.float64)
                      for q, size in ((turn_a, size_a), (turn, size_b)))
    a, *rest = at((reach + gap) * along + lateral, turn, size_a, size_b)
    return np.append(a[:3], turn_a), *rest


def unit(vector: tuple[float, ...] | np.ndarray) -> np.ndarray:
    """Return the vector, of length 1."""
    return np.asarray(vector, dtype=np.float64) / np.linalg.norm(vector)


def edge_crossing(gap: float, angle: float = 1.1, along: float = 0.0, size: float = 2.0,
                  length: float = 2.0) -> Case:
    """Return two bars on edge, A's ridge up along x, B's ridge down, crossing at an angle.

    B is shifted along A's ridge.
    """
    a = turned(X, 0.25 * np.pi)
    b = quaternion_multiply(turned(Z, angle), turned(X, 0.25 * np.pi))
    return placed((length, size, size), (length, size, size), b, Z, gap, (along, 0.0, 0.0), a)


VERTEX_DOWN = quaternion_multiply(turned(Y, -np.arctan(np.sqrt(0.5))), turned(X, 0.25 * np.pi))
"""A cube on its corner: its body diagonal is vertical."""
EDGE_DOWN = turned(X, 0.25 * np.pi)


def feature_pairs(gap: float) -> list[Case]:
    """Return the four ways in which two convex bodies touch, `gap` apart."""
    return [placed(CUBE, CUBE, UPRIGHT, Z, gap, (0.3, 0.2, 0.0)),
            placed(CUBE, CUBE, EDGE_DOWN, Z, gap, (0.1, 0.3, 0.0)),
            placed(CUBE, CUBE, VERTEX_DOWN, Z, gap, (0.2, -0.1, 0.0)),
            edge_crossing(gap)]


# --- the families ---------------------------------------------------------------------------------

Family = Callable[[np.random.Generator], Iterator[Case]]
AXES = ((1, 0.5, 3), (1, 1, 1), (1, 0, 1), (1, 2, 3), (1, 0, 0))
TILTS = (0.0, 1e-16, 1e-15, 1e-14, 1e-12, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 5e-3, 0.05)


def a1_tilted_faces(rng: np.random.Generator) -> Iterator[Case]:
    """Yield face on face, tilted about generic and in-face axes, overlapping."""
    for tilt in TILTS:
        for axis in AXES:
            for overlap in (1e-9, 1e-5, 1e-2):
                yield placed(FORTY, FORTY, turned(axis, tilt), Z, -12.192 * overlap,
                             (*(rng.uniform(-0.8, 0.8, 2) * FORTY[:2]), 0.0))


def a2_tilted_gaps(rng: np.random.Generator) -> Iterator[Case]:
    """Yield a1 with a gap: what a constant added to |R| turns into contacts."""
    for tilt in TILTS[::2]:
        for gap in (1e-12, 1e-9, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3):
            yield placed(FORTY, FORTY, turned(AXES[rng.integers(5)], tilt), Z, gap,
                         (*(rng.uniform(-0.8, 0.8, 2) * FORTY[:2]), 0.0))


def a3_parallel_edges(rng: np.random.Generator) -> Iterator[Case]:
    """Yield an edge direction in common to the last bit, faces at an angle."""
    for angle in np.radians(np.arange(5.0, 90.0, 10.0)):
        for offset in (0.0, 0.3, 0.9, 1.0, 1.1):
            yield placed(FORTY, FORTY, turned(X, angle), Z, -10.0**rng.uniform(-6, -1),
                         (offset * 12.192, rng.uniform(-1, 1), 0.0))


def a4_ridges(rng: np.random.Generator) -> Iterator[Case]:
    """Yield bars turned by 45°, ridge on ridge, crossing at small angles."""
    for crossing in (0.0, 1e-7, 1e-5, 1e-3, 3e-3, 0.02, 0.05, 0.1, 0.2, 0.5):
        for overlap in (0.001, 0.01, 0.05):
            yield edge_crossing(-overlap, crossing, size=1.0, length=15.0)


def a5_right_angles(rng: np.random.Generator) -> Iterator[Case]:
    """Yield all 24 right-angled orientations, and tilts about them."""
    for base in right_angles():
        for tilt in (0.0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3, 0.05, 0.25 * np.pi):
            turn = quaternion_multiply(turned(rng.normal(size=3), tilt), base)
            yield placed((3.0, 2.0, 1.0), (2.5, 1.5, 0.5), turn,
                         (X, Y, Z)[rng.integers(3)], rng.choice([-1e-3, -1e-6, 1e-6]),
                         rng.uniform(-0.2, 0.2, 3))


def a6_float32_quaternions(rng: np.random.Generator) -> Iterator[Case]:
    """Yield orientations that have been through float32: a tilt of 1e-7 in aligned stacks."""
    for _ in range(30):
        turn = unit(rng.normal(size=4))
        a, b, size_a, size_b = placed(FORTY, FORTY, turn, rotation_matrix(turn)[:, 2],
                                      rng.choice([-1e-2, -1e-4, 1e-4]), turn_a=turn)
        b[3:] = turn.astype(np.float32)
        yield a, b, size_a, size_b


def b1_exact_touch(rng: np.random.Generator) -> Iterator[Case]:
    """Yield exact touch in dyadic numbers: face, edge and corner on each other, nothing rounded."""
    for place in ((2, 0, 0), (2, 1, 0.5), (2, 2, 0), (2, 2, 1), (2, 2, 2), (2, -2, 2), (0, 2, -2),
                  (2, 0, 2)):
        for turn in (UPRIGHT, np.array([0.5, 0.5, 0.5, 0.5]), np.array([1.0, 0, 0, 0])):
            yield at(place, turn)
    yield from feature_pairs(0.0)


def b2_shared_lines(rng: np.random.Generator) -> Iterator[Case]:
    """Yield boxes on one floor that share a line of their sides, or a corner, but no area."""
    for offset in (-1.0, -0.5, 0.0, 0.5, 1.0):
        for gap in (0.0, 1e-15, -1e-15, 1e-9, -1e-9):
            yield placed(FORTY, FORTY, UPRIGHT, Y, gap, (offset * 12.192, 0.0, 0.0))
            yield placed(FORTY, TWENTY, UPRIGHT, X, gap, (0.0, 2.438 * offset, 2.591))


def b3_ladder(rng: np.random.Generator) -> Iterator[Case]:
    """Yield gaps and overlaps from 1e-15 of the size on, on each pair of features."""
    rungs = 10.0**np.array([-15, -12, -9, -8, -7, -6, -5, -4, -3, -2, -1])
    for step in (*-2.0 * rungs[::-1], *2.0 * rungs, 1.0, 1e2, 1e4, 1e8):
        yield from feature_pairs(float(step))


def b4_one_axis(rng: np.random.Generator) -> Iterator[Case]:
    """Yield poses that one of the fifteen axes alone separates, and twins that overlap."""
    for number in range(15):
        wanted = 2
        while wanted:
            turn = unit(rng.normal(size=4))
            size_a, size_b = np.exp(rng.uniform(-1, 1, (2, 3)))
            r = rotation_matrix(turn)
            axes = [*np.eye(3), *r.T, *(np.cross(e, f) for e in np.eye(3) for f in r.T)]
            axes = [axis / np.linalg.norm(axis) for axis in axes]
            n = axes[number]
            lateral = rng.normal(size=3) * size_a
            lateral -= n * (n @ lateral)
            case = placed(size_a, size_b, turn, n, 1e-2, lateral)
            gaps = [abs(axis @ case[1][:3]) - 0.5 * (np.abs(axis) @ size_a
                                                     + np.abs(axis @ r) @ size_b) for axis in axes]
            if all(gap < -2e-2 for k, gap in enumerate(gaps) if k != number):
                wanted -= 1
                yield case
                yield placed(size_a, size_b, turn, n, -1e-2, lateral)


def b5_beyond_an_end(rng: np.random.Generator) -> Iterator[Case]:
    """Yield two edges whose lines cross beyond an edge's end."""
    for share in np.linspace(0.95, 1.05, 21):
        for gap in (-1e-3, 1e-3):
            yield edge_crossing(gap, 0.5 * np.pi, along=share, length=2.0)


def b6_spin(rng: np.random.Generator) -> Iterator[Case]:
    """Yield a gap of 1 cm, B turning about the normal, or tumbling."""
    for degrees in range(0, 360, 15):
        yield placed(FORTY, FORTY, turned(Z, np.radians(degrees)), Z, 0.01, (0.5, 0.3, 0.0))
        yield placed(CUBE, CUBE, turned((1, 2, 3), np.radians(degrees)), Z, 0.01, (0.3, 0.1, 0.0))


def b7_corner_gaps(rng: np.random.Generator) -> Iterator[Case]:
    """Yield corners and edges apart along no axis: the gap is less than the distance."""
    for gap in (1e-9, 1e-6, 1e-3, 0.1):
        for place in ((1, 1, 1), (1, 1, 0), (1, -1, 0.3)):
            step = np.array(place) * np.where(np.abs(place) == 1, 2.0 + gap, 1.0)
            yield at(step)


def c1_depths(rng: np.random.Generator) -> Iterator[Case]:
    """Yield overlaps of 1 to 99 % of the extent, on each pair of features."""
    for share in (0.01, 0.1, 0.3, 0.49, 0.51, 0.7, 0.9, 0.99):
        yield from feature_pairs(-2.0 * share)


def c2_half_through(rng: np.random.Generator) -> Iterator[Case]:
    """Yield a small box across the middle of a slab, where the normal turns round."""
    for share in (0.4, 0.499, 0.4999999, 0.5, 0.5000001, 0.501, 0.6):
        for turn in (UPRIGHT, turned((1, 2, 3), 0.4)):
            yield placed((5.0, 4.0, 1.0), (0.2, 0.15, 0.1), turn, Z, -share, (0.2, 0.1, 0.0))


def c3_contained(rng: np.random.Generator) -> Iterator[Case]:
    """Yield a box inside another, off its middle."""
    for ratio in (2.0, 10.0, 100.0):
        for share in (0.01, 0.3, 0.9):
            for turn in (UPRIGHT, unit(rng.normal(size=4))):
                size = np.array((2.0, 1.5, 1.2)) / ratio
                place = share * 0.5 * (np.array(CUBE) - np.linalg.norm(size)) * (0.3, 0.7, 1.0)
                yield at(place, turn, CUBE, size)


def c4_concentric(rng: np.random.Generator) -> Iterator[Case]:
    """Yield centres at one place: the normal's sign is free."""
    for size in (CUBE, (1.0, 1.0, 1.0), (3.0, 1.0, 0.5)):
        for turn in (UPRIGHT, turned(Z, 0.25 * np.pi), unit(rng.normal(size=4))):
            yield at(np.zeros(3), turn, CUBE, size)


def c5_identical(rng: np.random.Generator) -> Iterator[Case]:
    """Yield the same box twice, its axes renamed."""
    for turn in right_angles():
        size = (3.0, 2.0, 1.0)
        yield at(np.zeros(3), turn, size, np.abs(rotation_matrix(turn).T.round()) @ size)


def c6_bars_through(rng: np.random.Generator) -> Iterator[Case]:
    """Yield a thin bar through a wide box."""
    for _ in range(15):
        yield placed((4.0, 3.0, 1.0), (10.0, 0.1, 0.15), unit(rng.normal(size=4)), Z, -1.0,
                     rng.uniform(-0.5, 0.5, 3))


def d1_two_axes(rng: np.random.Generator) -> Iterator[Case]:
    """Yield two axes with equal depth, and nearly."""
    for nudge in (0.0, 1e-15, -1e-15, 1e-12, -1e-12, 1e-9, -1e-9, 1e-6, -1e-6):
        for t in (1.999, 1.9, 1.0):
            yield at((t + 2 * nudge, t, 0.1))


def d2_three_axes(rng: np.random.Generator) -> Iterator[Case]:
    """Yield three axes with equal depth, and nearly."""
    for nudge in (0.0, 1e-15, 1e-12, 1e-9, 1e-6):
        for t in (1.999, 1.9, 1.0):
            yield at((t + nudge, t, t - nudge))


def d3_eighth_turns(rng: np.random.Generator) -> Iterator[Case]:
    """Yield turns of 45°: edge on face, edge on edge, the octagon between two squares."""
    for nudge in (0.0, 1e-12, -1e-12, 1e-9, 1e-6, 1e-3, -1e-3):
        angle = 0.25 * np.pi + nudge
        yield placed(CUBE, CUBE, turned(X, angle), Z, -0.01, (0.2, 0.1, 0.0))
        yield placed(CUBE, CUBE, turned(Z, angle), Z, -0.01)
        yield placed(CUBE, CUBE, turned(X, angle), Z, -0.01, turn_a=turned(X, 0.25 * np.pi))


def d4_diagonals(rng: np.random.Generator) -> Iterator[Case]:
    """Yield a body diagonal upright, and the common mistake of 45° twice."""
    for turn in (VERTEX_DOWN, quaternion_multiply(turned(Y, 0.25 * np.pi), EDGE_DOWN)):
        for gap in (-0.1, -1e-3, -1e-9, 1e-9, 1e-3):
            yield placed(CUBE, CUBE, turn, Z, gap, (0.2, 0.1, 0.0))


def d5_edge_against_face(rng: np.random.Generator) -> Iterator[Case]:
    """Yield a shallow crossing of edges, a face axis within a few per cent of it.

    Libraries with a preference for faces answer it with the face.
    """
    for angle in (0.3, 0.5, 0.7, 0.9, 1.1):
        for depth in (0.02, 0.1, 0.2, 0.3):
            yield edge_crossing(-depth, angle, along=0.6)


def e1_thin(rng: np.random.Generator) -> Iterator[Case]:
    """Yield plates, rods, cards: 1:10 to 1:10,000, stacked and leaning."""
    for aspect in (10.0, 100.0, 1e3, 1e4):
        for size in ((3.5, 2.0, 3.5 / aspect), (3.5, 3.5 / aspect, 3.5 / aspect)):
            for turn in (UPRIGHT, turned(X, 1e-6), turned((1, 1, 0), 0.3),
                         unit(rng.normal(size=4))):
                yield placed(size, size, turn, Z, -0.1 * size[2],
                             (0.1 * size[0], 0.1 * size[1], 0.0))


def e2_small_on_large(rng: np.random.Generator) -> Iterator[Case]:
    """Yield size ratios of 100 to 1,000,000."""
    for ratio in (1e2, 1e4, 1e6):
        for turn in (UPRIGHT, turned(X, 1e-7), unit(rng.normal(size=4))):
            for place in ((0.0, 0.0), (0.31, -0.47)):
                yield placed((ratio, ratio, ratio), (1.0, 0.8, 0.6), turn, Z, -1e-2,
                             (place[0] * ratio, place[1] * ratio, 0.0))


def e3_scales(rng: np.random.Generator) -> Iterator[Case]:
    """Yield one shape at 1e-6 to 1e6 m."""
    for scale in (1e-6, 1e-3, 1.0, 1e3, 1e6):
        for case in feature_pairs(-2e-3):
            yield scaled(case, scale)


def e4_shallow_in_big(rng: np.random.Generator) -> Iterator[Case]:
    """Yield overlaps at float32's rounding of a large pair, and far below."""
    for overlap in (7e-8, 1e-12):
        for turn in (UPRIGHT, turned((1, 2, 3), 1e-7), turned((1, 2, 0), 0.01),
                     unit(rng.normal(size=4))):
            yield placed(FORTY, FORTY, turn, Z, -12.192 * overlap, (0.5, 0.3, 0.0))


def f_far(rng: np.random.Generator) -> Iterator[Case]:
    """Yield pairs far from the origin, in UTM coordinates too, turned about the far place."""
    for far in ((1e3, 0, 0), (1e4, -1e4, 10), (1e5, 1e5, 0), (5e5, 5.8e6, 20), (1e7, -1e7, 1e7)):
        for turn in (UPRIGHT, unit(rng.normal(size=4))):
            for gap in (-0.1, -5e-3, -1e-6, 1e-6, 5e-3):
                yield moved(placed(FORTY, FORTY, turned(AXES[rng.integers(5)], 10.0**rng.uniform(
                    -9, -1)), Z, gap, (0.5, 0.3, 0.0)), np.array(far, dtype=np.float64), turn)


def h1_stacks(rng: np.random.Generator) -> Iterator[Case]:
    """Yield 40 on 40, 20 on 20, two 20s on a 40, at the gaps of yards; twist-lock offsets."""
    for gap in (-5e-3, -1e-3, -1e-4, 0.0, 1e-4, 1e-3, 5e-3, 0.025):
        for below, above, shift in ((FORTY, FORTY, 0.0), (TWENTY, TWENTY, 0.0),
                                    (FORTY, TWENTY, 3.067), (FORTY, TWENTY, -3.067),
                                    (HIGH_CUBE, FORTY, 0.0)):
            for misaligned in (0.0, 0.01, 0.05):
                yaw = np.radians(rng.uniform(-0.5, 0.5)) * (misaligned > 0.0)
                yield placed(below, above, turned(Z, yaw), Z, gap,
                             (shift + misaligned, 0.5 * misaligned, 0.0))


def h3_between_stacks(rng: np.random.Generator) -> Iterator[Case]:
    """Yield a box lowered into a slot: side gaps of 20 to 150 mm, swaying until they close."""
    for gap in (0.02, 0.05, 0.15):
        for degrees in (0.1, 0.5, 1.0, 2.0, 5.0):
            for axis in (X, Z, (1, 0.3, 1)):
                yield at((0.3, 2.438 + gap, 1.2), turned(axis, np.radians(degrees)), FORTY)


def h6_spreader(rng: np.random.Generator) -> Iterator[Case]:
    """Yield a thin spreader on a container, a trolley beam across it."""
    for degrees in (0.0, 1e-5, 0.1, 1.0, 5.0):
        for gap in (-0.01, -1e-4, 1e-4):
            turn = turned((1, 0.2, 0.1), np.radians(degrees))
            yield placed(FORTY, (12.0, 2.4, 0.3), turn, Z, gap, (0.05, 0.02, 0.0))
            yield placed(FORTY, (30.0, 0.6, 0.9),
                         quaternion_multiply(turned(Z, 0.5 * np.pi), turn), Z, gap)


def h7_bay(rng: np.random.Generator) -> Iterator[Case]:
    """Yield neighbours of a bay that touch at shared planes."""
    for step in ((0, 1, 0), (0, 0, 1), (1, 0, 0), (0, 1, 1), (0, 2, 0), (1, 1, 0)):
        case = at(np.array(step) * FORTY, UPRIGHT, FORTY)
        yield case
        yield moved(case, np.full(3, 100.3), UPRIGHT)


def c7_almost_coincident(rng: np.random.Generator) -> Iterator[Case]:
    """Yield a box and its twin, displaced, turned or grown by 1e-16 to 1e-3 of its size."""
    for size in (CUBE, FORTY, (3.0, 2.0, 1.0)):
        for step in (1e-16, 1e-14, 1e-12, 1e-9, 1e-6, 1e-3):
            yield at(step * max(size) * unit(rng.normal(size=3)), UPRIGHT, size)
            yield at(np.zeros(3), turned(AXES[rng.integers(5)], step), size)
            yield at(step * max(size) * unit(rng.normal(size=3)),
                     turned(rng.normal(size=3), step), size, (1.0 + step) * np.array(size))


def e5_needles(rng: np.random.Generator) -> Iterator[Case]:
    """Yield rods and plates of aspects 1e3 to 1e8, deep in each other, many almost parallel."""
    a, b, size_a, size_b = (np.array(part, dtype=np.float64) for part in NEEDLE)
    yield a, b, size_a, size_b
    for aspect in (1e3, 1e5, 1e6, 1e7, 1e8):
        yield from zip(*needles(rng, 12, aspect))


FAMILIES: dict[str, Family] = {function.__name__: function for function in (
    a1_tilted_faces, a2_tilted_gaps, a3_parallel_edges, a4_ridges, a5_right_angles,
    a6_float32_quaternions, b1_exact_touch, b2_shared_lines, b3_ladder, b4_one_axis,
    b5_beyond_an_end, b6_spin, b7_corner_gaps, c1_depths, c2_half_through, c3_contained,
    c4_concentric, c5_identical, c6_bars_through, d1_two_axes, d2_three_axes, d3_eighth_turns,
    d4_diagonals, d5_edge_against_face, e1_thin, e2_small_on_large, e3_scales, e4_shallow_in_big,
    f_far, h1_stacks, h3_between_stacks, h6_spreader, h7_bay, c7_almost_coincident, e5_needles)}
"""By name; the letter is the group: A parallel, B touching, C deep, D tied, E aspect and scale, F
far from the origin, H a container yard. G is input that is no pose, and I is motion: tests of their
own."""


# --- variants -------------------------------------------------------------------------------------


def scaled(case: Case, by: float) -> Case:
    """Return the case with all lengths times a factor."""
    a, b = (np.append(pose[:3] * by, pose[3:]) for pose in case[:2])
    return a, b, case[2] * by, case[3] * by


def moved(case: Case, shift: np.ndarray, turn: np.ndarray) -> Case:
    """Return the case with both boxes turned about the origin, then shifted."""
    a, b = (np.append(rotation_matrix(turn) @ pose[:3] + shift,
                      quaternion_multiply(turn, pose[3:])) for pose in case[:2])
    return a, b, case[2], case[3]


def renamed(case: Case, box: int, turn: np.ndarray) -> Case:
    """Return the case with a box's axes called by other names: the same body."""
    parts = list(case)
    parts[box] = np.append(case[box][:3], quaternion_multiply(case[box][3:], turn))
    parts[2 + box] = np.abs(rotation_matrix(turn).T.round()) @ case[2 + box]
    return parts[0], parts[1], parts[2], parts[3]


def swapped(case: Case) -> Case:
    """Return the case with B for A."""
    return case[1], case[0], case[3], case[2]


def variants(case: Case, rng: np.random.Generator) -> Iterator[Case]:
    """Yield the case as it is, and once turned, swapped, renamed or scaled, or several of it."""
    yield case
    other = case
    if rng.random() < 0.6:
        far = np.abs(case[0][:3]).max() > 100.0
        other = moved(other, rng.uniform(-20, 20, 3) * (not far), unit(rng.normal(size=4)))
    if rng.random() < 0.5:
        other = swapped(other)
    for box in (0, 1):
        if rng.random() < 0.3:
            other = renamed(other, box, right_angles()[rng.integers(24)])
    if rng.random() < 0.3:
        other = scaled(other, 10.0**rng.integers(-6, 7))
    yield other


def generate(name: str, seed: int = 2026) -> Pairs:
    """Return the pairs of a family, each with a variant."""
    rng = np.random.default_rng([seed, list(FAMILIES).index(name)])
    cases = [variant for case in FAMILIES[name](rng) for variant in variants(case, rng)]
    return Pairs(*(np.array(column, dtype=np.float64) for column in zip(*cases)))

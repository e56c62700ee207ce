# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The bounds of A∩B (a bounding box, a point inside) against the corners of A∩B in 60 digits.

The oracle clips faces; the core cuts edges. They share no code and no idea.
"""
from __future__ import annotations

import numpy as np
import oracle
import poses
import pytest
from gmpy2 import mpfr

from box_contact_ros.core import DEPTH_FLOOR, Stages, stages
from box_contact_ros.core.stages import BOUNDS

N = 64
CLEARLY_SMALLER = 0.8
"""Share of A's bounding box below which B's is chosen."""
FLUSH = 2.0**-46
"""By which slabs are widened [of the size]: a point may be so far outside."""
ROUNDING = 2.0**-48
"""Rounding of a corner's place, of the size."""


def sheared(rng, n, size_a, size_b, turns, depth, *, lateral=(0.0, 0.0), rigid=True):
    """B on A's top, `depth` (n,) deep at the lowest corner, `lateral` times A's extents aside."""
    size_a, size_b = np.asarray(size_a, dtype=float), np.asarray(size_b, dtype=float)
    low = np.full(n, np.inf)
    for signs in np.ndindex(2, 2, 2):
        corner = np.tile((np.array(signs) - 0.5) * size_b, (n, 1))
        low = np.minimum(low, poses.rotate(turns, corner)[:, 2])
    place = np.column_stack([np.tile(np.asarray(lateral) * size_a[:2], (n, 1)),
                             0.5 * size_a[2] - low - depth])
    a, b = np.tile(poses.IDENTITY, (n, 1)), np.column_stack([place, turns])
    if rigid:
        turn, shift = poses.unit_quaternions(rng, n), rng.uniform(-20, 20, (n, 3))
        turn[: n // 2], shift[: n // 2] = poses.IDENTITY[3:], 0.0
        a, b = poses.moved(a, shift, turn), poses.moved(b, shift, turn)
    return a, b, np.tile(size_a, (n, 1)), np.tile(size_b, (n, 1))


def about(axis, angles):
    return poses.small_rotations(np.tile(np.array(axis, dtype=float), (len(angles), 1)), angles)


def random_family(rng):
    a, b, size_a, size_b = poses.random_pairs(rng, 4 * N)
    return a, b, size_a, size_b


def near_parallel_family(rng):
    return poses.near_parallel_pairs(rng, 4 * N)


def tilted_faces(rng):
    """A1: face on face, tilt 0 to 0.05 rad about generic and in-face axes."""
    axes = np.array([(1, 0.5, 3), (1, 1, 1), (1, 0, 1), (1, 2, 3), (1, 0, 0)], dtype=float)
    tilt = rng.choice([0, 1e-16, 1e-15, 1e-14, 1e-12, 1e-9, 1e-8, 1e-6, 1e-4, 5e-3, 0.05], N)
    turns = poses.small_rotations(axes[rng.integers(0, 5, N)], tilt)
    return sheared(rng, N, poses.CONTAINER, poses.CONTAINER, turns,
                   12.0 * 10.0**rng.uniform(-9, -2, N), lateral=(0.1, -0.3))


def aligned_stacks(rng):
    """A1: tilt exactly 0, sides flush: all vertical sides of both boxes in pairs of one plane."""
    turns = np.tile(poses.IDENTITY[3:], (N, 1))
    return sheared(rng, N, poses.CONTAINER, poses.CONTAINER, turns, np.full(N, 1e-3))


def half_flush_stacks(rng):
    """One side flush, the other half overhanging; quarter turns of a square box."""
    turns = about((0, 0, 1), 0.5 * np.pi * rng.integers(0, 4, N))
    return sheared(rng, N, (2.0, 2.0, 1.0), (2.0, 2.0, 3.0), turns, np.full(N, 1e-4),
                   lateral=(0.0, 0.5))


def shared_edge_direction(rng):
    """A3: one edge direction in common, faces turned by 5 to 85 degrees about it."""
    return sheared(rng, N, poses.CUBE, poses.CUBE, about((1, 0, 0), np.radians(
        rng.uniform(5, 85, N))), 2.0 * 10.0**rng.uniform(-6, -1, N), lateral=(0.3, 0.2))


def crossing_ridges(rng):
    """A4: two bars turned by 45 degrees, ridge on ridge, crossing at 1e-7 to 0.5 rad."""
    up = about((1, 0, 0), np.full(N, np.pi / 4))
    crossing = about((0, 0, 1), rng.choice([1e-7, 1e-5, 1e-3, 0.02, 0.1, 0.5], N))
    size = (15.0, 1.0, 1.0)
    a = np.column_stack([np.zeros((N, 3)), up])
    rise = np.sqrt(2.0) - rng.choice([0.01, 0.05], N)
    b = np.column_stack([np.zeros((N, 2)), rise, poses.multiply(crossing, up)])
    return a, b, np.tile(size, (N, 1)), np.tile(size, (N, 1))


def right_angles(rng):
    """A5: the 24 right-angle turns with a tilt of 0, 1e-15 … 1e-3 rad."""
    turns = np.tile(poses.IDENTITY[3:], (N, 1))
    for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1)):
        turns = poses.multiply(turns, about(axis, 0.5 * np.pi * rng.integers(0, 4, N)))
    tilt = about((1, 2, 3), rng.choice([0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3], N))
    return sheared(rng, N, poses.CUBE, (1.0, 2.0, 3.0), poses.multiply(tilt, turns),
                   np.full(N, 0.01), lateral=(0.2, 0.1))


def float32_quaternions(rng):
    """A6: a stack whose quaternion went through float32."""
    yaw = about((0, 0, 1), rng.uniform(-np.pi, np.pi, N))
    turns = yaw.astype(np.float32).astype(np.float64)
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    return sheared(rng, N, poses.CONTAINER, poses.CONTAINER, turns, np.full(N, 1e-3), rigid=False)


def exact_touch(rng):
    """B1: dyadic poses that touch exactly: face, edge and corner."""
    place = np.zeros((N, 3))
    place[:, 2] = 2.0
    kind = rng.integers(0, 3, N)
    place[kind >= 1, 0] = 2.0
    place[kind == 2, 1] = 2.0
    place[kind == 0, :2] = rng.integers(-7, 8, (int((kind == 0).sum()), 2)) / 4.0
    b = np.column_stack([place, np.tile(poses.IDENTITY[3:], (N, 1))])
    return np.tile(poses.IDENTITY, (N, 1)), b, np.full((N, 3), 2.0), np.full((N, 3), 2.0)


def identical_and_concentric(rng):
    """C4, C5: the same box twice, and boxes with one centre."""
    turn, shift = poses.unit_quaternions(rng, N), rng.uniform(-20, 20, (N, 3))
    a = np.column_stack([shift, turn])
    b = a.copy()
    b[N // 2:, 3:] = poses.unit_quaternions(rng, N - N // 2)
    size = np.exp(rng.uniform(-1, 1, (N, 3)))
    return a, b, size, size.copy()


def contained(rng):
    """C3: B inside A."""
    a = np.column_stack([rng.uniform(-9, 9, (N, 3)), poses.unit_quaternions(rng, N)])
    b = np.column_stack([a[:, :3] + rng.uniform(-1, 1, (N, 3)), poses.unit_quaternions(rng, N)])
    return a, b, np.full((N, 3), 10.0), np.tile((0.5, 1.0, 3.0), (N, 1))


def corner_ties(rng):
    """D1, D2: cubes offset by (t, t, 0) and (t, t, t), exact or off by 1e-15 … 1e-6."""
    place = np.full((N, 3), 1.75)
    place[: N // 2, 2] = 0.0
    place[:, 0] += rng.choice([0, 1e-15, -1e-12, 1e-9, 1e-6], N)
    b = np.column_stack([place, np.tile(poses.IDENTITY[3:], (N, 1))])
    return np.tile(poses.IDENTITY, (N, 1)), b, np.full((N, 3), 2.0), np.full((N, 3), 2.0)


def eighth_turns(rng):
    """D3: 45 degrees about the normal (an octagon), exact or off by 1e-12 … 1e-3 rad."""
    turns = about((0, 0, 1), np.pi / 4 + rng.choice([0, 1e-12, -1e-9, 1e-6, 1e-3], N))
    return sheared(rng, N, poses.CUBE, poses.CUBE, turns, np.full(N, 1e-3))


def plates(rng):
    """E1: plates 1:10 to 1:1e4, leaning and stacked."""
    thin = 10.0 / 10.0**rng.uniform(1, 4, N)
    tilt = rng.choice([0, 1e-6, 1e-3, 0.3], N)
    a, b, size_a, size_b = sheared(rng, N, (10.0, 8.0, 1.0), (10.0, 8.0, 1.0), about(
        (1, 0.3, 0), tilt), np.zeros(N), lateral=(0.2, 0.1), rigid=False)
    size_a[:, 2] = size_b[:, 2] = thin
    b[:, 2] = thin * 0.95 + 5.0 * np.abs(np.sin(tilt))
    return a, b, size_a, size_b


def small_on_large(rng):
    """E2: 0.2 m on a 100 m floor, flush with its side or not."""
    shift = rng.choice([0.0, 49.9, 0.3], (N, 2))
    b = np.column_stack([shift, np.full(N, 50.1 - 1e-3), about(
        (0, 0, 1), rng.choice([0.0, 0.3], N))])
    return np.tile(poses.IDENTITY, (N, 1)), b, np.full((N, 3), 100.0), np.full((N, 3), 0.2)


FAMILIES = {function.__name__: function for function in (
    random_family, near_parallel_family, tilted_faces, aligned_stacks, half_flush_stacks,
    shared_edge_direction, crossing_ridges, right_angles, float32_quaternions, exact_touch,
    identical_and_concentric, contained, corner_ties, eighth_turns, plates, small_on_large)}


def bounds_of(a, b, size_a, size_b, method='edges'):
    """Return the stages of the pairs that touch, and the numbers of their rows."""
    found = stages(a, b, size_a, size_b, names=(
        'colliding', 'separation', 'normal', 'size', 'rotation', 'pressed_offset_a',
        'pressed_offset_b', 'frame_b', 'bounds_middle', 'bounds_half', 'other_axes',
        'other_offset', 'other_half'), bounds=method)
    rows = np.flatnonzero(found.colliding)
    return Stages(*(values[rows] if len(values) else values for values in found)), rows


def accuracy(found, row):
    """Accuracy of the bounding box [m]: max(1e-9, 3e-14·size/depth)·size.

    A wedge of tilt θ is longer by FLUSH·size/θ where its slabs are wider by FLUSH·size, and its
    depth is θ·length.
    """
    size = found.size[row]
    depth = max(-found.separation[row], DEPTH_FLOOR * size)
    return max(1e-9, 3e-14 * size / depth) * size


def extremes(box, corners):
    """Return the least and largest coordinates (3,) of points in a box's frame."""
    local = np.array([[float(oracle.dot(e, oracle.add(p, box.centre, -1))) for e in box.axes]
                      for p in corners])
    return local.min(axis=0), local.max(axis=0)


def swapped(a, b, size_a, size_b):
    return b, a, size_b, size_a


@pytest.mark.parametrize('order', [lambda *pair: pair, swapped], ids=['A B', 'B A'])
@pytest.mark.parametrize('family', FAMILIES)
def test_bounding_boxes_are_those_of_the_corners(family, order):
    """To max(1e-9, 3e-14·size/depth) of the size, in the frame that is chosen.

    A's is chosen, unless B's has less than CLEARLY_SMALLER of its volume. So swapping A and B
    brings in the frames that were not chosen, but for those of clearly larger volume.
    """
    a, b, size_a, size_b = order(*FAMILIES[family](np.random.default_rng(2027)))
    found, rows = bounds_of(a, b, size_a, size_b)
    assert len(rows) > len(a) / 4
    for k, row in enumerate(rows):
        where = f'{family}[{row}]: {a[row].tolist()}, {b[row].tolist()}, ' \
                f'{size_a[row].tolist()}, {size_b[row].tolist()}'
        box_a, box_b = oracle.make_box(a[row], size_a[row]), oracle.make_box(b[row], size_b[row])
        # Pressed in along the very normal that the core took.
        n = [mpfr(float(v)) for v in found.normal[k]]
        axis = tuple(sum(box_a.axes[j][c] * n[j] for j in range(3)) for c in range(3))
        box_b = oracle.pressed(box_a, box_b, axis, -mpfr(float(found.separation[k])),
                               mpfr(10)**-9 * mpfr(float(found.size[k])))
        corners = {p for face in oracle.overlap_faces(box_a, box_b) for p in face}
        assert corners, where
        both = [extremes(box, corners) for box in (box_a, box_b)]
        low, high = both[int(found.frame_b[k])]
        for mine, its in ((low, found.bounds_middle[k] - found.bounds_half[k]),
                          (high, found.bounds_middle[k] + found.bounds_half[k])):
            assert np.abs(mine - its).max() <= accuracy(found, k), where
        volume_a, volume_b = (np.prod(above - below) for below, above in both)
        if family == 'random_family' and abs(volume_b / volume_a - CLEARLY_SMALLER) > 1e-6:
            assert found.frame_b[k] == (volume_b < CLEARLY_SMALLER * volume_a), where
    if family == 'random_family':
        assert 0.2 < found.frame_b.mean() < 0.8


@pytest.mark.parametrize('family', FAMILIES)
def test_bounds_by_the_slab_hold_the_overlap(family):
    """They hold those of the edges, in the frame that both chose, and lie in the frame's box."""
    pairs = FAMILIES[family](np.random.default_rng(2029))
    edges, rows = bounds_of(*pairs)
    slab, _ = bounds_of(*pairs, method='slab')
    slack = (4 * FLUSH * slab.size)[:, None]
    own = 0.5 * np.where(slab.frame_b[:, None], pairs[3][rows], pairs[2][rows])
    assert np.all(np.abs(slab.bounds_middle) + slab.bounds_half <= own + slack)
    same = slab.frame_b == edges.frame_b
    assert same.mean() > 0.5
    tolerance = np.array([[accuracy(edges, k)] for k in range(len(rows))])
    for sign in (-1.0, 1.0):
        beyond = sign * (edges.bounds_middle - slab.bounds_middle) + (
            edges.bounds_half - slab.bounds_half)
        assert np.all((beyond <= tolerance)[same])


@pytest.mark.parametrize('family', FAMILIES)
def test_the_other_box_is_where_it_is(family):
    """Its axes, its half extents and its place in the bounds' frame are those of the poses."""
    a, b, size_a, size_b = FAMILIES[family](np.random.default_rng(2028))
    found, rows = bounds_of(a, b, size_a, size_b)
    axes = np.where(found.frame_b[:, None, None], found.rotation,
                    np.swapaxes(found.rotation, 1, 2))
    assert np.array_equal(found.other_axes, axes)
    other = np.where(found.frame_b[:, None], size_a[rows], size_b[rows])
    assert np.array_equal(found.other_half, 0.5 * other)
    rounding = (64 * ROUNDING * found.size)[:, None]
    centre = np.where(found.frame_b[:, None], -found.pressed_offset_b, found.pressed_offset_a)
    offset = np.einsum('nij,nj->ni', axes, found.bounds_middle - centre)
    assert np.all(np.abs(found.other_offset - offset) <= rounding)
    # The same pair in the frame of A and in that of B.
    there = np.einsum('nji,nj->ni', found.rotation, found.pressed_offset_a)
    assert np.all(np.abs(there - found.pressed_offset_b) <= rounding)
    pressed = np.maximum(0.0, DEPTH_FLOOR * found.size + found.separation)[:, None]
    offset = stages(a[rows], b[rows], size_a[rows], size_b[rows], names=('offset_a',)).offset_a
    assert np.all(np.abs(offset - pressed * found.normal - found.pressed_offset_a) <= rounding)


@pytest.mark.parametrize('method', BOUNDS)
def test_boxes_that_lie_on_each_other_keep_their_frame(method):
    """A container rocks on another: its frame does not change, or the point would jump."""
    rng = np.random.default_rng(6)
    n = 2000
    # Tilt and yaw of containers that have landed: docs/results/landing.csv.
    axes = rng.normal(size=(n, 3)) * (1.0, 0.1, 1.0)
    turns = poses.small_rotations(axes, rng.uniform(0, 0.01, n))
    a, b, size_a, size_b = sheared(rng, n, poses.CONTAINER, poses.CONTAINER, turns,
                                   np.full(n, 5e-3))
    found, rows = bounds_of(a, b, size_a, size_b, method=method)
    assert len(rows) == n and not found.frame_b.any()


@pytest.mark.parametrize('method', BOUNDS)
def test_an_aligned_stack_has_its_whole_patch(method):
    """Containers exactly one on the other, turned anywhere.

    Every side of one lies in a side's plane of the other, and rounding alone says whose edges are
    outside. Without wider slabs nothing or one side was left, and the point was half a container
    off, outside both.
    """
    rng = np.random.default_rng(9)
    n = 2000
    turns = np.tile(poses.IDENTITY[3:], (n, 1))
    pairs = sheared(rng, n, poses.CONTAINER, poses.CONTAINER, turns, np.full(n, 1e-3))
    half = np.array([poses.CONTAINER[0] / 2, poses.CONTAINER[1] / 2, 0.5e-3])
    found, rows = bounds_of(*pairs, method=method)
    assert len(rows) == n
    assert np.abs(found.bounds_half - half).max() <= 1e-12

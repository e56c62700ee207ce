"""The outline of A∩B (its bounding boxes, a point inside) against the corners of A∩B in 60 digits.

The oracle clips faces; the outline cuts edges. They share no code and no idea.
"""
from __future__ import annotations

import mpmath as mp
import numpy as np
import oracle
import poses
import pytest

from box_contact_ros.block import (
    HALF,
    HALF_A,
    HALF_B,
    HIGH_A,
    HIGH_B,
    IN_B,
    INSIDE,
    LANES,
    LOW_A,
    LOW_B,
    MIDDLE,
    NORMAL,
    OFFSET_A,
    OFFSET_B,
    ROTATION,
    SEPARATION,
    SIZE,
    TOUCH,
    new_work,
)
from box_contact_ros.outline import outline_block
from box_contact_ros.overlap import DEPTH_FLOOR, press
from box_contact_ros.pose import load_block
from box_contact_ros.sat import query_block

N = 64
ALIKE = 0.2
"""Share by which B's bounding box has to be smaller than A's to be chosen."""
FLUSH = 2.0**-46
"""By which the outline widens slabs, of the size: a point may be so far outside."""
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


def outlines(a, b, size_a, size_b):
    """A dict per pair that touches: what the kernels leave of it."""
    work = new_work()
    found = []
    for start in range(0, len(a), LANES):
        count = min(LANES, len(a) - start)
        assert load_block(a, b, size_a, size_b, start, count, work) == 0
        query_block(LANES, work)
        touching = [i for i in range(count) if work[SEPARATION + i] <= work[TOUCH + i]]
        for i in touching:
            press(work, i)
        outline_block(LANES, work)
        for i in touching:
            def rows(name, many, i=i):
                return work[name + i:name + many * LANES:LANES].copy()

            found.append({
                'row': start + i, 'low_a': rows(LOW_A, 3), 'high_a': rows(HIGH_A, 3),
                'low_b': rows(LOW_B, 3), 'high_b': rows(HIGH_B, 3), 'in_b': work[IN_B + i] > 0.5,
                'middle': rows(MIDDLE, 3), 'half': rows(HALF, 3), 'inside': rows(INSIDE, 3),
                'offset_a': rows(OFFSET_A, 3), 'offset_b': rows(OFFSET_B, 3),
                'rotation': rows(ROTATION, 9).reshape(3, 3), 'normal': rows(NORMAL, 3),
                'half_a': rows(HALF_A, 3), 'half_b': rows(HALF_B, 3), 'size': work[SIZE + i],
                'separation': work[SEPARATION + i]})
    return found


def bound(outline):
    """Accuracy of the bounding box [m]: max(1e-9, 3e-14·size/depth)·size.

    A wedge of tilt θ is longer by FLUSH·size/θ where its slabs are wider by FLUSH·size, and its
    depth is θ·length.
    """
    depth = max(-outline['separation'], DEPTH_FLOOR * outline['size'])
    return max(1e-9, 3e-14 * outline['size'] / depth) * outline['size']


@pytest.mark.parametrize('family', FAMILIES)
def test_bounding_boxes_are_those_of_the_corners(family):
    """In A's and in B's frame, to max(1e-9, 3e-14·size/depth) of the size."""
    a, b, size_a, size_b = FAMILIES[family](np.random.default_rng(2027))
    found = outlines(a, b, size_a, size_b)
    assert len(found) > len(a) / 4
    for outline in found:
        row = outline['row']
        where = f'{family}[{row}]: {a[row].tolist()}, {b[row].tolist()}, ' \
                f'{size_a[row].tolist()}, {size_b[row].tolist()}'
        box_a, box_b = oracle.make_box(a[row], size_a[row]), oracle.make_box(b[row], size_b[row])
        # Pressed in along the very normal that the kernel took.
        n = [mp.mpf(float(v)) for v in outline['normal']]
        axis = tuple(sum(box_a.axes[k][c] * n[k] for k in range(3)) for c in range(3))
        box_b = oracle.pressed(box_a, box_b, axis, -mp.mpf(float(outline['separation'])),
                               mp.mpf(10)**-9 * mp.mpf(float(outline['size'])))
        corners = {p for face in oracle.overlap_faces(box_a, box_b) for p in face}
        assert corners, where
        for box, low, high in ((box_a, 'low_a', 'high_a'), (box_b, 'low_b', 'high_b')):
            local = np.array([[float(oracle.dot(e, oracle.add(p, box.centre, -1)))
                               for e in box.axes] for p in corners])
            assert np.abs(local.min(axis=0) - outline[low]).max() <= bound(outline), where
            assert np.abs(local.max(axis=0) - outline[high]).max() <= bound(outline), where


@pytest.mark.parametrize('family', FAMILIES)
def test_the_point_inside_is_in_both_boxes(family):
    """In its own frame within the bounding box, and in the other box to 2^-46 of the size."""
    a, b, size_a, size_b = FAMILIES[family](np.random.default_rng(2028))
    for o in outlines(a, b, size_a, size_b):
        point = o['inside']
        turn, shift = o['rotation'], o['offset_a']
        in_a = turn @ point + shift if o['in_b'] else point
        in_b = point if o['in_b'] else turn.T @ point - o['offset_b']
        slack = (FLUSH + 4 * ROUNDING) * o['size']
        assert np.all(np.abs(in_a) <= o['half_a'] + slack), (family, o['row'])
        assert np.all(np.abs(in_b) <= o['half_b'] + slack), (family, o['row'])


def test_the_clearly_smaller_bounding_box_is_chosen():
    """By volume: A's, unless B's is smaller by ALIKE; both choices occur."""
    found = outlines(*poses.random_pairs(np.random.default_rng(5), 4 * N))
    assert 0.2 < np.mean([o['in_b'] for o in found]) < 0.8
    for o in found:
        volume_a = np.prod(o['high_a'] - o['low_a'])
        volume_b = np.prod(o['high_b'] - o['low_b'])
        if abs(volume_b / volume_a - (1.0 - ALIKE)) > 1e-9:
            assert o['in_b'] == (volume_b < (1.0 - ALIKE) * volume_a)


def test_boxes_that_lie_on_each_other_keep_their_frame():
    """A container rocks on another: its frame does not change, or the point would jump."""
    rng = np.random.default_rng(6)
    n = 2000
    # Tilt and yaw of containers that have landed: docs/landing.csv.
    axes = rng.normal(size=(n, 3)) * (1.0, 0.1, 1.0)
    turns = poses.small_rotations(axes, rng.uniform(0, 0.01, n))
    a, b, size_a, size_b = sheared(rng, n, poses.CONTAINER, poses.CONTAINER, turns,
                                   np.full(n, 5e-3))
    assert not any(o['in_b'] for o in outlines(a, b, size_a, size_b))


def test_an_aligned_stack_has_its_whole_patch():
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
    found = outlines(*pairs)
    assert len(found) == n
    for o in found:
        assert o['half'] == pytest.approx(half, abs=1e-12)
        assert np.abs(o['inside'] - o['middle']).max() < 1e-9

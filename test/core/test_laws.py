# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Laws that a right answer obeys, over random and near-parallel pairs."""
from __future__ import annotations

import itertools

import numpy as np
import poses
import pytest

from box_contact_ros import ContactSolver

N = 2000
SOLVERS = {model: ContactSolver(model=model) for model in ('exact', 'mlp')}
SAME_NORMAL = 1e-6
"""Two faces tilted by θ tie when θ² is lost in rounding, so either may give the normal."""
FAMILIES = {'random': poses.random_pairs, 'near-parallel': poses.near_parallel_pairs}


@pytest.fixture(params=FAMILIES)
def pairs(request):
    return FAMILIES[request.param](np.random.default_rng(77), N)


def every_pair():
    """Pairs of both families, and the hard poses."""
    return poses.joined(*(family(np.random.default_rng(77), N) for family in FAMILIES.values()),
                        poses.hard_pairs())


def solve(a, b, size_a, size_b, model='exact'):
    return SOLVERS[model].batch(a, b, size_a=size_a, size_b=size_b)


def largest(size_a, size_b):
    return np.maximum(size_a.max(axis=1), size_b.max(axis=1))


def point_bound(found, size):
    """Accuracy of the centroid [m]: max(1e-9, 1e-14·size/depth)·size."""
    depth = np.maximum(-found.separation, 1e-9 * size)
    return np.maximum(1e-9, 1e-14 * size / depth) * size


def share_bounds(found, size):
    """Accuracy of volume, of itself, and of covariance, of its trace."""
    rounding = 1e-14 * size / np.maximum(-found.separation, 1e-9 * size)
    return np.maximum(1e-9, rounding), np.maximum(1e-8, rounding)


def trace(covariance):
    return np.trace(covariance, axis1=1, axis2=2)


def turned(turn, covariance):
    """Covariances (n, 3, 3) turned by quaternions (n, 4)."""
    axes = np.stack([poses.rotate(turn, np.tile(axis, (len(turn), 1))) for axis in np.eye(3)],
                    axis=2)
    return np.einsum('nik,nkl,njl->nij', axes, covariance, axes)


def assert_same_patch(one, two, volume, covariance, rows, size, roundings=0.0):
    """Volume and covariance of `two` are those given, to two times the bound and the roundings."""
    of_volume, of_covariance = (2.0 * bound + roundings for bound in share_bounds(one, size))
    assert np.all((np.abs(two.volume - volume) <= of_volume * volume)[rows])
    off = np.linalg.norm(two.covariance - covariance, axis=(1, 2))
    assert np.all((off <= of_covariance * trace(covariance))[rows])


def clear_normal(a, b, size_a, size_b, found, size):
    """Rows whose normal no tie can flip: the boxes moved a little keep it to SAME_NORMAL."""
    rows = found.colliding.copy()
    for k in range(3):
        for sign in (-1e-9, 1e-9):
            nudged = b.copy()
            nudged[:, k] += sign * size
            other = solve(a, nudged, size_a, size_b)
            rows &= np.abs(other.normal - found.normal).max(axis=1) < SAME_NORMAL
    return rows


def assert_swapped(a, b, size_a, size_b):
    """Of B against A all bits are those of A against B, and the normal is reversed.

    Two boxes that are the same have the same normal both ways.
    """
    one, two = solve(a, b, size_a, size_b), solve(b, a, size_b, size_a)
    poses.assert_same_bits(one, two, 'colliding', 'separation', 'point', 'volume', 'covariance')
    same = (a == b).all(axis=1) & (size_a == size_b).all(axis=1)
    sign = np.where(same, 1.0, -1.0)[:, None]
    assert np.array_equal(one.normal, sign * two.normal, equal_nan=True)


def test_swap(pairs):
    """The boxes are put in an order of the data, so it does not matter which is called A."""
    assert solve(*pairs).colliding.sum() > N / 5
    assert_swapped(*pairs)


TIED = {kind.__name__: kind for kind in (
    poses.near_parallel_pairs, poses.flush_pairs, poses.equal_thickness)}


@pytest.mark.parametrize('kind', [*TIED, 'hard poses'])
def test_swap_of_boxes_with_ties(kind):
    """Faces of both boxes in one plane, or axes of one gap."""
    pairs = (TIED[kind](np.random.default_rng(15), 20_000) if kind in TIED else
             poses.hard_pairs())
    if not len(pairs[0]):
        pytest.skip('benchmarks/ is not here')
    assert solve(*pairs).colliding.mean() > 0.3
    assert_swapped(*pairs)


def test_swap_of_concentric_boxes():
    """No offset says which box comes first: their sizes do, or their axes."""
    rng = np.random.default_rng(12)
    a, b = (np.concatenate([np.ones((20_000, 3)), poses.unit_quaternions(rng, 20_000)], axis=1)
            for _ in range(2))
    sizes = np.exp(rng.uniform(-1, 1, (2, 20_000, 3)))
    for size_a, size_b in (sizes, sizes[[0, 0]], np.ones_like(sizes)):
        assert solve(a, b, size_a, size_b).colliding.all()
        assert_swapped(a, b, size_a, size_b)


@pytest.mark.parametrize('sizes', [[2.0] * 3, [12.192, 2.438, 2.591], None])
def test_swap_of_grazing_boxes(sizes):
    """Corner on corner after quarter turns and a tilt of 1e-14 to 1e-10 rad: gaps are nearly 0.

    Evaluated from A, whatever the digits, 3 % of these separations changed in the last bits.
    """
    rng, n = np.random.default_rng(14), 20_000
    sizes = rng.choice([0.5, 1.0, 2.0], (2, n, 3)) if sizes is None else np.full((2, n, 3), sizes)
    corner_a, corner_b = rng.choice([-0.5, 0.5], (2, n, 3)) * sizes
    quarter = rng.choice([-1.0, 0.0, 1.0], (n, 4))
    quarter[~quarter.any(axis=1)] = 1.0
    tilt = np.ones((n, 4))
    tilt[:, :3] = rng.normal(size=(n, 3)) * 10.0**rng.uniform(-14, -10, (n, 1))
    offset = (poses.rotate(quarter / np.linalg.norm(quarter, axis=1, keepdims=True), corner_a)
              - poses.rotate(tilt / np.linalg.norm(tilt, axis=1, keepdims=True), corner_b))
    a, b = np.hstack([np.zeros((n, 3)), quarter]), np.hstack([offset, tilt])
    one, two = solve(a, b, *sizes), solve(b, a, *sizes[::-1])
    assert one.colliding.mean() > 0.9
    assert np.array_equal(one.separation, two.separation)
    assert np.array_equal(one.colliding, two.colliding)


@pytest.mark.parametrize('power', [-330, -270, -266, -250, 250, 266, 330])
def test_quaternions_of_any_length(power):
    """Both scaled by 2^k, to lengths of 1e-99 to 1e99: everything is the same to the bit.

    Grazing containers, whose rotation is computed again from the quaternions.
    """
    a, b, size_a, size_b = poses.near_parallel_pairs(np.random.default_rng(13), 20_000)
    scaling = np.array([1.0] * 3 + [2.0**power] * 4)
    poses.assert_same_bits(solve(a, b, size_a, size_b),
                           solve(a * scaling, b * scaling, size_a, size_b))


def test_rigid_motion(pairs):
    """Moved together, verdict and separation stay, normal and point move along."""
    a, b, size_a, size_b = pairs
    rng = np.random.default_rng(3)
    turn, shift = poses.unit_quaternions(rng, N), rng.uniform(-30, 30, (N, 3))
    one = solve(a, b, size_a, size_b)
    two = solve(poses.moved(a, shift, turn), poses.moved(b, shift, turn), size_a, size_b)
    size = largest(size_a, size_b)
    rounding = 64 * np.finfo(float).eps * np.maximum(size, 60)
    assert np.all(np.abs(one.separation - two.separation) <= rounding)
    clear = np.abs(one.separation) > rounding
    assert np.array_equal(one.colliding[clear], two.colliding[clear])
    rows = clear_normal(a, b, size_a, size_b, one, size) & (one.separation < -1e-6 * size)
    assert rows.sum() > N / 5
    assert np.abs(poses.rotate(turn, one.normal) - two.normal)[rows].max() < SAME_NORMAL
    moved = poses.rotate(turn, one.point) + shift
    bound = (rounding / -one.separation + 1e-9) * size
    assert np.all(np.abs(moved - two.point).max(axis=1)[rows] <= bound[rows])
    assert_same_patch(one, two, one.volume, turned(turn, one.covariance), rows, size,
                      8 * rounding / -one.separation)


@pytest.mark.parametrize('power', [-20, 20])
@pytest.mark.parametrize('model', ['exact', 'mlp'])
def test_scale_by_powers_of_two_is_exact(model, power):
    """Everything scaled by 2^k: separation and point scale to the bit, the normal stays.

    The volume scales by 2^3k, the covariance by 2^2k: there is no absolute length anywhere.
    """
    a, b, size_a, size_b = every_pair()
    factor = 2.0**power
    scaling = np.array([factor] * 3 + [1.0] * 4)
    one = solve(a, b, size_a, size_b, model)
    two = solve(a * scaling, b * scaling, size_a * factor, size_b * factor, model)
    assert np.array_equal(one.colliding, two.colliding)
    assert np.array_equal(one.separation * factor, two.separation)
    assert np.array_equal(one.normal, two.normal, equal_nan=True)
    assert np.array_equal(one.point * factor, two.point, equal_nan=True)
    assert np.array_equal(one.volume * factor**3, two.volume)
    assert np.array_equal(one.covariance * factor**2, two.covariance, equal_nan=True)


@pytest.mark.parametrize('model', ['exact', 'mlp'])
def test_q_and_minus_q(model):
    """The same orientation: the same bits."""
    a, b, size_a, size_b = every_pair()
    minus = np.array([1, 1, 1, -1, -1, -1, -1])
    one = solve(a, b, size_a, size_b, model)
    for other in (solve(a * minus, b, size_a, size_b, model),
                  solve(a, b * minus, size_a, size_b, model)):
        poses.assert_same_bits(one, other)


def test_box_symmetries(pairs):
    """A box's 24 relabellings change nothing but roundings."""
    a, b, size_a, size_b = pairs
    one = solve(a, b, size_a, size_b)
    size = largest(size_a, size_b)
    rows = clear_normal(a, b, size_a, size_b, one, size) & (one.separation < -1e-8 * size)
    half = np.sqrt(0.5)
    turns = {'x': (half, 0, 0, half), 'y': (0, half, 0, half), 'z': (0, 0, half, half)}
    swapped = {'x': (0, 2, 1), 'y': (2, 1, 0), 'z': (1, 0, 2)}
    for first, second in itertools.product('xyz', repeat=2):
        renamed, extents = b.copy(), size_b
        for axis in (first, second):
            renamed[:, 3:] = poses.multiply(renamed[:, 3:], np.tile(turns[axis], (N, 1)))
            extents = extents[:, swapped[axis]]
        two = solve(a, renamed, size_a, extents)
        rounding = 64 * np.finfo(float).eps * np.maximum(size, 30)
        assert np.all(np.abs(one.separation - two.separation) <= rounding)
        assert np.abs(one.normal - two.normal)[rows].max() < SAME_NORMAL
        bound = (rounding / -one.separation + 1e-9) * size
        assert np.all(np.abs(one.point - two.point).max(axis=1)[rows] <= bound[rows])
        assert_same_patch(one, two, one.volume, one.covariance, rows, size,
                          8 * rounding / -one.separation)


def test_separated_after_moving_by_the_depth(pairs):
    """B moved along the normal by the depth plus a margin is free; minus a margin it is not."""
    a, b, size_a, size_b = pairs
    one = solve(a, b, size_a, size_b)
    coordinates = np.maximum(np.abs(a[:, :3]).max(axis=1), np.abs(b[:, :3]).max(axis=1))
    reach = np.maximum(coordinates, largest(size_a, size_b))
    margin = np.maximum(1e-9 * -one.separation, 24 * np.spacing(reach))
    rows = one.colliding & (-one.separation > 2 * margin)
    assert rows.sum() > N / 5
    for sign in (1, -1):
        moved = b.copy()
        step = (-one.separation + sign * margin)[:, None] * one.normal
        moved[rows, :3] += step[rows]
        assert np.all(solve(a, moved, size_a, size_b).colliding[rows] == (sign < 0))


def test_no_direction_separates_in_less(pairs):
    """Along any direction the projections overlap by at least the depth (support functions)."""
    a, b, size_a, size_b = pairs
    one = solve(a, b, size_a, size_b)
    rng = np.random.default_rng(11)
    least = np.full(N, np.inf)
    for _ in range(300):
        direction = rng.normal(size=(N, 3))
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        width = np.zeros(N)
        for pose, size in ((a, size_a), (b, size_b)):
            inverse = pose[:, 3:] * (-1, -1, -1, 1)
            width += (np.abs(poses.rotate(inverse, direction)) * size).sum(axis=1) / 2
        least = np.minimum(least, width - np.abs(((b - a)[:, :3] * direction).sum(axis=1)))
    rows = one.colliding
    assert np.all((-one.separation <= least + 1e-12 * largest(size_a, size_b))[rows])


def test_point_lies_in_both_boxes(pairs):
    """The point is inside both boxes, up to the pressing depth and rounding."""
    a, b, size_a, size_b = pairs
    found = solve(a, b, size_a, size_b)
    slack = 1.1e-9 * largest(size_a, size_b)
    for pose, size in ((a, size_a), (b, size_b)):
        inverse = pose[:, 3:] * (-1, -1, -1, 1)
        local = np.abs(poses.rotate(inverse, found.point - pose[:, :3]))
        assert np.all((local - size / 2).max(axis=1)[found.colliding] <= slack[found.colliding])


def parts_of(rng, pose, size):
    """Boxes (pose, size) each cut in two across one of its axes: the parts, as two such pairs."""
    n = len(pose)
    across = np.eye(3)[rng.integers(0, 3, n)]
    cut = rng.uniform(0.02, 0.98, n)[:, None]
    turn = pose[:, 3:] / np.linalg.norm(pose[:, 3:], axis=1, keepdims=True)
    for begin, end in ((np.zeros((n, 1)), cut), (cut, np.ones((n, 1)))):
        part = pose.copy()
        part[:, :3] += poses.rotate(turn, across * size * (0.5 * (begin + end) - 0.5))
        yield part, np.where(across > 0, size * (end - begin), size)


PARTED = {kind.__name__: kind for kind in (
    poses.random_pairs, poses.near_parallel_pairs, poses.flush_pairs, poses.equal_thickness,
    poses.ridges, poses.cards, poses.sharing_an_axis)}


@pytest.mark.parametrize('kind', PARTED)
def test_the_point_is_between_those_of_the_parts(kind):
    """B is cut in two: the centroid of the whole lies on the way between the parts' centroids.

    100,000 pairs. It needs no oracle, so that it can be asked of as many as one likes.
    """
    rng = np.random.default_rng(21)
    assert_between_the_parts(rng, *PARTED[kind](rng, 100_000))


def assert_between_the_parts(rng, a, b, size_a, size_b):
    size = largest(size_a, size_b)
    whole = solve(a, b, size_a, size_b)
    # Far from the origin, cutting would round the parts' places.
    rows = whole.colliding & (np.abs(a[:, :3]).max(axis=1) < 20.0 * size)
    points, bound = [], point_bound(whole, size)
    for part, its_size in parts_of(rng, b, size_b):
        found = solve(a, part, size_a, its_size)
        rows &= found.colliding & (found.separation < -1e-8 * size)  # else it has been pressed in
        points.append(found.point)
        bound += point_bound(found, size)
    assert rows.sum() > 5_000
    one, two, point = points[0][rows], points[1][rows], whole.point[rows]
    way = two - one
    share = np.sum((point - one) * way, axis=1) / np.sum(way * way, axis=1)
    off = np.linalg.norm(one + np.clip(share, 0.0, 1.0)[:, None] * way - point, axis=1)
    assert np.all(off <= bound[rows])


@pytest.mark.parametrize('kind', PARTED)
def test_moments_are_those_of_the_parts(kind):
    """B is cut in two: volumes add, centroids weigh by them, covariances add by Steiner's rule.

    100,000 pairs.
    """
    rng = np.random.default_rng(22)
    a, b, size_a, size_b = PARTED[kind](rng, 100_000)
    size = largest(size_a, size_b)
    rows = (np.abs(a[:, :3]).max(axis=1) < 20.0 * size) & solve(a, b, size_a, size_b).colliding
    a, b, size_a, size_b, size = (part[rows] for part in (a, b, size_a, size_b, size))
    whole, rows = solve(a, b, size_a, size_b), np.ones(len(a), dtype=bool)
    of_volume, of_covariance = share_bounds(whole, size)
    volume, first, second = np.zeros(len(a)), np.zeros((len(a), 3)), np.zeros((len(a), 3, 3))
    volume_off, trace_off = of_volume * whole.volume, of_covariance * trace(whole.covariance)
    for part, its_size in parts_of(rng, b, size_b):
        found = solve(a, part, size_a, its_size)
        rows &= found.colliding & (found.separation < -1e-8 * size)  # else it has been pressed in
        from_whole = found.point - whole.point
        volume += found.volume
        first += found.volume[:, None] * from_whole
        second += found.volume[:, None, None] * (
            found.covariance + from_whole[:, :, None] * from_whole[:, None, :])
        its_volume, its_covariance = share_bounds(found, largest(size_a, its_size))
        volume_off += its_volume * found.volume
        reach = np.linalg.norm(from_whole, axis=1)
        trace_off += found.volume / whole.volume * (
            (its_covariance + its_volume) * (trace(found.covariance) + reach**2)
            + 2.0 * reach * (point_bound(found, size) + point_bound(whole, size)))
    assert rows.sum() > 5_000
    assert np.all((np.abs(volume - whole.volume) <= volume_off)[rows])
    centroid_off = volume_off / whole.volume * np.sqrt(trace(whole.covariance)) \
        + 2.0 * point_bound(whole, size)
    assert np.all((np.linalg.norm(first, axis=1) / whole.volume <= centroid_off)[rows])
    off = np.linalg.norm(second / whole.volume[:, None, None] - whole.covariance, axis=(1, 2))
    assert np.all((off <= trace_off + of_volume * trace(whole.covariance))[rows])


@pytest.mark.parametrize('kind', PARTED)
def test_covariance_is_symmetric_and_positive(kind):
    """To rounding: no eigenvalue below −1e-8 of the trace, or its accuracy where that is less."""
    a, b, size_a, size_b = PARTED[kind](np.random.default_rng(23), 50_000)
    found = solve(a, b, size_a, size_b)
    rows = found.colliding
    covariance, bound = found.covariance[rows], share_bounds(found, largest(size_a, size_b))[1]
    assert np.array_equal(covariance, covariance.transpose(0, 2, 1))
    assert np.all(found.volume[rows] > 0.0)
    least = np.linalg.eigvalsh(covariance)[:, 0]
    assert np.all(least >= -0.1 * bound[rows] * trace(covariance))


def test_volume_grows_with_the_depth(pairs):
    """B pushed in along the normal of a face: the volume grows.

    Before the overlap reaches the opposite face, dV = area of the face in the other box · way.
    """
    a, b, size_a, size_b = pairs
    one = solve(a, b, size_a, size_b)
    size = largest(size_a, size_b)
    axis = one.axis
    thickness = np.hstack([size_a, size_b])[np.arange(N), np.minimum(axis, 5)]
    rows = one.colliding & (axis < 6) & (-2.0 * one.separation < thickness)
    rows &= one.separation < -1e-6 * size
    assert rows.sum() > N / 10
    before = one
    for share in (0.001, 0.01, 0.1, 1.0):
        pushed = b.copy()
        pushed[rows, :3] += (share * one.separation[:, None] * one.normal)[rows]
        after = solve(a, pushed, size_a, size_b)
        slack = 2.0 * share_bounds(before, size)[0] * before.volume
        assert np.all((after.volume >= before.volume - slack)[rows])
        before = after


def test_volume_grows_with_the_boxes(pairs):
    """A larger B holds the smaller one, so the overlap grows."""
    a, b, size_a, size_b = pairs
    one, two = solve(a, b, size_a, size_b), solve(a, b, size_a, 1.01 * size_b)
    rows = one.separation < -1e-8 * largest(size_a, size_b)
    slack = 2.0 * share_bounds(one, largest(size_a, size_b))[0] * one.volume
    assert np.all((two.volume >= one.volume - slack)[rows])


def test_reflection(pairs):
    """The scene mirrored at x = 0: same verdict and separation, point and normal mirrored."""
    a, b, size_a, size_b = pairs
    mirror = np.array([-1, 1, 1, 1, -1, -1, 1.0])  # M R M, M = diag(−1, 1, 1): qy, qz change sign
    one, two = solve(a, b, size_a, size_b), solve(a * mirror, b * mirror, size_a, size_b)
    size = largest(size_a, size_b)
    assert np.all(np.abs(one.separation - two.separation) <= 1e-14 * size)
    rows = clear_normal(a, b, size_a, size_b, one, size)
    assert np.abs(one.normal * mirror[:3] - two.normal)[rows].max() < SAME_NORMAL
    error = np.abs(one.point * mirror[:3] - two.point).max(axis=1)
    assert np.all(error[rows] <= 2 * point_bound(one, size)[rows] + 1e-12)
    mirrored = one.covariance * np.outer(mirror[:3], mirror[:3])
    deep = rows & (one.separation < -1e-8 * size)
    assert_same_patch(one, two, one.volume, mirrored, deep, size)


def test_depth_is_continuous(pairs):
    """Moving B by a vector changes the separation by at most its length."""
    a, b, size_a, size_b = pairs
    rng = np.random.default_rng(4)
    one = solve(a, b, size_a, size_b)
    for length in (1e-6, 1e-3, 0.1):
        step = rng.normal(size=(N, 3))
        step *= length / np.linalg.norm(step, axis=1, keepdims=True)
        moved = b.copy()
        moved[:, :3] += step
        change = np.abs(solve(a, moved, size_a, size_b).separation - one.separation)
        assert np.all(change <= length + 1e-13 * largest(size_a, size_b))

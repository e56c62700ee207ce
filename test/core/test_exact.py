# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Model `exact` against the 60-digit oracle.

5,000 random and near-parallel pairs, and 2,500 of slivers, rods, sides flush to some ulps, edges
in sides, and plates of one thickness.
"""
from __future__ import annotations

import numpy as np
import oracle
import poses
import pytest
from gmpy2 import mpfr

from benchmarks import probes
from box_contact_ros import ContactSolver
from box_contact_ros.core import DEPTH_FLOOR

CHUNK = 500
SOLVER = ContactSolver()
FAMILIES = {'random': poses.random_pairs, 'near-parallel': poses.near_parallel_pairs}
THIN = {'ridges': poses.ridges, 'cards': poses.cards, 'flush': poses.flush_pairs,
        'sharing an axis': poses.sharing_an_axis, 'equal thickness': poses.equal_thickness}

CHUNKS = [0, 1, *(pytest.param(chunk, marks=pytest.mark.slow) for chunk in range(2, 5))]

# Rows of 200,000 ridges.
SLIVERS = [3650, 16297, 79049, 85246, 85698, 105096, 105366, 110647, 158096, 158626]


@pytest.mark.parametrize('chunk', CHUNKS)
@pytest.mark.parametrize('family', FAMILIES)
def test_agrees_with_the_oracle(family, chunk):
    """Verdict beyond 1e-12·size; depth and axis to 1e-12·size.

    The centroid to max(1e-9, 1e-14·size/depth)·size, the volume to as much of itself, and the
    covariance to max(1e-8, 1e-14·size/depth) of its trace.
    """
    colliding = check(family, chunk, *FAMILIES[family](np.random.default_rng([2026, chunk]), CHUNK))
    assert 0.2 < colliding.mean() < 0.9  # both verdicts are really tested


@pytest.mark.parametrize('family', THIN)
def test_thin_overlaps(family):
    """Overlaps a millionth as thick as long, cut off obliquely; sides in one plane but for ulps.

    And edges exactly in sides, where sums over edges go wrong: docs/explanation/contact_point.md.
    """
    colliding = check(family, 0, *THIN[family](np.random.default_rng([2027, 0]), CHUNK))
    assert colliding.mean() > 0.4


def check(family, chunk, a, b, size_a, size_b):
    """All that `exact` says of these pairs; returns which of them touch (n,)."""
    found = SOLVER.batch(a, b, size_a=size_a, size_b=size_b)
    for i in range(len(a)):
        size = max(size_a[i].max(), size_b[i].max())
        box_a, box_b = oracle.make_box(a[i], size_a[i]), oracle.make_box(b[i], size_b[i])
        gaps = oracle.axis_gaps(box_a, box_b)
        separation = max(gap for _, _, gap in gaps)
        where = f'{family}[{chunk}][{i}]: {a[i].tolist()}, {b[i].tolist()}'
        assert abs(float(separation - float(found.separation[i]))) <= 1e-12 * size, where
        if abs(separation) > 1e-12 * size:
            assert found.colliding[i] == (separation < 0), where
        if not found.colliding[i]:
            assert np.isnan(found.normal[i]).all() and np.isnan(found.point[i]).all(), where
            assert found.volume[i] == 0.0 and np.isnan(found.covariance[i]).all(), where
            continue
        # The normal is one of the axes whose gap is within 1e-12·size of the largest; either way
        # along it where B's centre is neither ahead nor behind.
        offset = oracle.add(box_b.centre, box_a.centre, -1)
        best = [oracle.as_array(oracle.scaled(axis, sign)) for _, axis, gap in gaps
                for sign in (1, -1) if gap >= separation - 1e-12 * size
                and (sign == 1 or abs(oracle.dot(offset, axis)) <= 1e-12 * size)]
        assert min(np.abs(axis - found.normal[i]).max() for axis in best) < 1e-9, where
        assert abs(np.linalg.norm(found.normal[i]) - 1) < 1e-14, where
        axis = tuple(mpfr(float(v)) for v in found.normal[i])
        volume, point, spread = oracle.contact_moments(box_a, box_b, axis, -separation, size)
        rounding = 1e-14 * size / max(-float(separation), 1e-9 * size)
        off = np.abs(oracle.as_array(point) - found.point[i]).max()
        assert off <= max(1e-9, rounding) * size, where
        if volume is None:
            continue
        assert abs(float(found.volume[i] / volume - 1)) <= max(1e-9, rounding), where
        spread = np.array([oracle.as_array(row) for row in spread])
        off = np.linalg.norm(spread - found.covariance[i])
        assert off <= max(1e-8, rounding) * np.trace(spread), where
    return found.colliding


def planes_against_clipping(pairs, least):
    """Differences of points, volumes and covariances, each by its documented bound.

    Of pairs that touch, of which at least `least` are not clipped anyway.
    """
    solver = ContactSolver()
    found = solver.batch(*pairs[:2], size_a=pairs[2], size_b=pairs[3])
    rows = found.colliding
    touching = [part[rows] for part in pairs]
    assert np.count_nonzero(~probes.is_clipped(touching)) > least
    point, volume, covariance = probes.clipped(touching)
    size = np.maximum(pairs[2], pairs[3]).max(axis=1)[rows]
    rounding = 1e-14 / np.maximum(-found.separation[rows] / size, DEPTH_FLOOR)
    bound, trace = np.maximum(1e-9, rounding), np.trace(covariance, axis1=1, axis2=2)
    apart = np.linalg.norm(found.covariance[rows] - covariance, axis=(1, 2))
    return (np.linalg.norm(found.point[rows] - point, axis=1) / (bound * size),
            np.abs(found.volume[rows] / volume - 1) / bound,
            apart / trace / np.maximum(1e-8, rounding))


@pytest.mark.parametrize('family', FAMILIES)
def test_clipping_is_planes(family):
    """Both methods give the moments to half the bound."""
    pairs = FAMILIES[family](np.random.default_rng(6), 20_000)
    for errors in planes_against_clipping(pairs, 5_000):
        assert errors.max() < 0.5


def test_pieces_far_outside_the_overlap_are_found():
    """Sides in one plane but for a tilt of 1e-9 to 1e-7 rad, over a corner: 400,000 pairs.

    Where sides cross far from the overlap, rounding left pieces that moved the centroid by nothing,
    and the covariance by six times its bound.
    """
    for seed in range(4):
        pairs = poses.near_parallel_pairs(np.random.default_rng([31, seed]), 100_000)
        assert planes_against_clipping(pairs, 60_000)[2].max() <= 1.0


def test_moments_of_boxes_through_each_other():
    """A bar across a slab, and a box in a box: the overlap is a box, moved and turned.

    The depth of a box in a box is the way out through the nearest face.
    """
    rng, n = np.random.default_rng(8), 2000
    size_a, size_b = np.exp(rng.uniform(-1, 1, (2, n, 3)))
    offset = rng.uniform(-0.5, 0.5, (n, 3)) * (size_a + size_b) * 0.98
    low = np.maximum(-0.5 * size_a, offset - 0.5 * size_b)
    high = np.minimum(0.5 * size_a, offset + 0.5 * size_b)
    whole, place = poses.unit_quaternions(rng, n), rng.uniform(-5, 5, (n, 3))
    a = np.tile(poses.IDENTITY, (n, 1))
    b = np.hstack([offset, a[:, 3:]])
    found = SOLVER.batch(poses.moved(a, place, whole), poses.moved(b, place, whole),
                         size_a=size_a, size_b=size_b)
    assert found.colliding.all()
    extents, size = high - low, np.maximum(size_a, size_b).max(axis=1)
    rounding = 1e-14 * size / extents.min(axis=1)
    separation = (np.abs(offset) - 0.5 * (size_a + size_b)).max(axis=1)
    assert (np.abs(found.separation - separation) <= 1e-12 * size).all()
    middle = place + poses.rotate(whole, 0.5 * (low + high))
    assert (np.abs(found.point - middle).max(axis=1) <= np.maximum(1e-9, rounding) * size).all()
    assert (np.abs(found.volume / extents.prod(axis=1) - 1) <= np.maximum(1e-9, rounding)).all()
    axes = np.stack([poses.rotate(whole, np.tile(axis, (n, 1))) for axis in np.eye(3)], axis=2)
    wanted = np.einsum('nik,nk,njk->nij', axes, extents**2 / 12, axes)
    off = np.linalg.norm(found.covariance - wanted, axis=(1, 2))
    assert (off <= np.maximum(1e-8, rounding) * (extents**2).sum(axis=1) / 12).all()


@pytest.mark.parametrize('gap', [0.0, -1e-12, -2.591e-6])
def test_touching_containers_have_the_pressed_volume(gap):
    """A container on another, half overhanging: the patch, as thick as pressing or depth."""
    length, width, height = poses.CONTAINER
    contact = ContactSolver(poses.CONTAINER, poses.CONTAINER, model='exact')(
        poses.IDENTITY, (6.096, 0.0, height + gap, 0, 0, 0, 1))
    extents = np.array([length / 2, width, max(-gap, DEPTH_FLOOR * length)])
    depth = extents[2]
    assert contact.volume == pytest.approx(extents.prod(), rel=1e-14 * length / depth)
    wanted = np.diag(extents**2) / 12
    assert contact.covariance == pytest.approx(
        wanted, abs=max(1e-8, 1e-14 * length / depth) * np.trace(wanted))


def test_concentric_boxes_meet_in_their_middle():
    """Flush on both sides, in any orientation, 100,000 pairs: the point is where both centres are.

    Where a face lies in the other box's far face, rounding lets its corners be below and above it
    by turns. When such a face was cut in two as a whole, both parts had its middle. The point was
    then off by 8 % of the size.
    """
    a, b, size_a, size_b = poses.equal_thickness(np.random.default_rng(5), 200_000)
    middle = (b[:, :3] == 0).all(axis=1)
    a, b, size_a, size_b = (part[middle] for part in (a, b, size_a, size_b))
    assert len(a) > 90_000
    found = SOLVER.batch(a, b, size_a=size_a, size_b=size_b)
    assert found.colliding.all()
    size = np.maximum(size_a, size_b).max(axis=1)
    clipped, *_ = probes.clipped((a, b, size_a, size_b))
    for point in (found.point, clipped):  # clipping cuts such a face triangle by triangle
        assert (np.abs(point).max(axis=1) / size).max() < 1e-13


@pytest.mark.parametrize('turned', [False, True])
def test_concentric_boxes_almost_aligned(turned):
    """A box and the same one tilted by 1e-13 to 1e-5 rad: the point is their centre.

    Rounding is mirrored through the middle, so it cancels in many sums, but not in the point.
    """
    rng, n = np.random.default_rng(3), 100_000
    size = np.exp(rng.uniform(-1, 1, (n, 3)))
    tilt = 10.0**rng.uniform(-13, -5, n)
    b = np.hstack([np.zeros((n, 3)), poses.small_rotations(rng.normal(size=(n, 3)), tilt)])
    a, zero = np.tile(poses.IDENTITY, (n, 1)), np.zeros((n, 3))
    if turned:
        whole = poses.unit_quaternions(rng, n)
        a, b = poses.moved(a, zero, whole), poses.moved(b, zero, whole)
    found = SOLVER.batch(a, b, size_a=size, size_b=size)
    assert found.colliding.all()
    assert np.all(np.abs(found.point).max(axis=1) <= 1e-10 * size.max(axis=1))


@pytest.mark.parametrize('model', ['exact', 'mlp'])
@pytest.mark.parametrize('kind', [poses.corners_that_touch, poses.columns_that_touch])
def test_boxes_that_touch_in_a_point(kind, model):
    """A corner on a corner or on a side, in any orientation: the point is there.

    Several axes have a gap of zero at once. Pressed in along one of them only, some of these boxes
    had no overlap, and a point a quarter of the size away.
    """
    (a, b, size_a, size_b), wanted = kind(np.random.default_rng(17), 20_000)
    size = np.maximum(size_a, size_b).max(axis=1)
    for first, other in (((a, size_a), (b, size_b)), ((b, size_b), (a, size_a))):
        found = ContactSolver(model=model).batch(
            first[0], other[0], size_a=first[1], size_b=other[1])
        touching = found.colliding  # rounding leaves a gap between some
        assert touching.mean() > 0.999
        assert np.all((np.linalg.norm(found.point - wanted, axis=1) <= 1e-6 * size)[touching])


def test_slivers_that_are_cut_off_obliquely():
    """Of 200,000 ridges, those that sums over faces had wrong by more than the bound.

    Both ends of a sliver had areas that rounding had changed by as much, one up, the other down.
    """
    pairs = poses.ridges(np.random.default_rng(99), 200_000)
    check('ridges', 99, *(part[SLIVERS] for part in pairs))


def test_a_needle_whose_covariance_clipping_had_wrong():
    """Found by a search; clipping was wrong by 4.5 % of the trace."""
    check('needle', 0, *(np.array([part], dtype=float) for part in poses.NEEDLE))


def test_columns_whose_covariance_planes_had_wrong():
    """The origin of their sums was 6 to 12 radii from the centroid: second moments cancelled."""
    for column in poses.COLUMNS:
        check('column', 0, *(np.array([part]) for both in column for part in both))


def test_pointed_overlaps_whose_covariance_planes_had_wrong():
    """A wrong tip changes the variance by 15 times its share of the volume."""
    for pair in poses.SMALL_ON_LARGE:
        check('small on large', 0, *(np.array([part]) for both in pair for part in both))


@pytest.mark.parametrize('aspect', [1e3, 1e4, 1e5])
def test_needles(aspect):
    """Within all bounds up to an aspect of 100,000."""
    pairs = poses.needles(np.random.default_rng([36, int(aspect)]), 150, aspect)
    assert check('needles', int(aspect), *pairs).mean() > 0.8


@pytest.mark.parametrize('aspect', [1e6, 1e7, 1e8])
def test_needles_beyond_have_possible_covariances(aspect):
    """No eigenvalue is negative, but by rounding."""
    a, b, size_a, size_b = poses.needles(np.random.default_rng([37, int(aspect)]), 20_000, aspect)
    found = SOLVER.batch(a, b, size_a=size_a, size_b=size_b)
    least = np.linalg.eigvalsh(found.covariance[found.colliding])[:, 0]
    trace = np.trace(found.covariance[found.colliding], axis1=1, axis2=2)
    assert (least / trace).min() > -1e-15


@pytest.mark.parametrize('gap', [-0.1, -0.01, -1e-3, -1e-6, -1e-9])
@pytest.mark.parametrize('shift', [(0.0, 0.0), (6.096, 0.0), (0.0, 1.219), (6.096, 1.219)])
def test_flush_containers(gap, shift):
    """A container on another, sides exactly in one plane (or half overhanging).

    The point is the middle of the patch, at half the depth. Counting a shared side twice would move
    it.
    """
    length, width, height = poses.CONTAINER
    solver = ContactSolver(poses.CONTAINER, poses.CONTAINER, model='exact')
    contact = solver(poses.IDENTITY, (*shift, height + gap, 0, 0, 0, 1))
    assert contact.colliding
    assert contact.separation == pytest.approx(gap, abs=1e-14)
    assert contact.normal.tolist() == [0, 0, 1]
    assert contact.point == pytest.approx(
        (shift[0] / 2, shift[1] / 2, (height + gap) / 2), abs=1e-6 * 1e-9 / -gap + 1e-12)


def test_vertex_on_face_at_touch_is_the_vertex():
    """One vertex exactly on a face: the paper's impact point, to the pressing depth 1e-9·size."""
    a = np.array([0.0, 0, 0, 0, 0, 0, 1])
    turn = poses.small_rotations(np.array([[1.0, -0.7, 0.2]]), np.array([0.6]))
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    turned = poses.rotate(np.tile(turn, (8, 1)), corners)
    lowest = turned[np.argmin(turned[:, 2])]
    b = np.concatenate([np.array([0.3, -0.2, 1.0]) - lowest, turn[0]])
    contact = ContactSolver(poses.CUBE, poses.CUBE, model='exact')(a, b)
    assert contact.colliding
    assert contact.point == pytest.approx((0.3, -0.2, 1.0), abs=2e-8)


def test_edges_crossing_at_touch_is_the_crossing():
    """Two edges exactly crossing: roof ridge along x on one along y, touching at one point."""
    up = poses.small_rotations(np.array([[1.0, 0, 0], [0, 1.0, 0]]), np.full(2, np.pi / 4))
    a = np.concatenate([(0, 0, 0), up[0]])
    b = np.concatenate([(0.25, -0.5, 2 * np.sqrt(2)), up[1]])
    contact = ContactSolver(poses.CUBE, poses.CUBE, model='exact')(a, b)
    assert contact.colliding
    assert contact.normal == pytest.approx((0, 0, 1), abs=1e-12)
    # A's ridge is y = 0, B's is x = 0.25.
    assert contact.point == pytest.approx((0.25, 0, np.sqrt(2)), abs=1e-8)

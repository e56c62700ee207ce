# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Model `soup-N`: the triangles, what is made of FCL's contacts, and what stays SAT's."""
from __future__ import annotations

import collections

import numpy as np
import poses
import pytest

pytest.importorskip('fcl')

from box_contact_ros import ContactSolver, make_model
from box_contact_ros.models import soup

IDENTITY = poses.IDENTITY
EXACT = ContactSolver(poses.CUBE, poses.CUBE, model='exact')
ORIENTATION = np.array([0.2, -0.35, 0.1, 0.9])  # no axis of B is near one of A


def cubes(divisions):
    return ContactSolver(poses.CUBE, poses.CUBE, model=make_model(f'soup-{divisions}'))


def corner_on_top(depth, x=0.31, y=-0.17):
    """B with its lowest corner `depth` [m] below A's top, at (x, y); the corner."""
    turn = (ORIENTATION / np.linalg.norm(ORIENTATION))[None]
    corners = poses.rotate(turn.repeat(8, 0), np.array(
        [[i, j, k] for i in (-1.0, 1) for j in (-1, 1) for k in (-1, 1)]))
    lowest = corners[np.argmin(corners[:, 2])]
    corner = np.array([x, y, 1.0 - depth])
    return np.concatenate([corner - lowest, turn[0]]), corner


@pytest.mark.parametrize('divisions', [1, 2, 8, 22])
def test_triangles_cover_the_box_once(divisions):
    """12 N² of them, the box's area; normals leave the box.

    Every edge is met once from either side, so that there are no holes, no doubles, and one sense
    of winding.
    """
    size = np.array(poses.CONTAINER)
    corners = soup.triangles(size, divisions)
    assert corners.shape == (12 * divisions**2, 3, 3)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = 2 * (size[0] * size[1] + size[1] * size[2] + size[2] * size[0])
    assert 0.5 * np.linalg.norm(across, axis=1).sum() == pytest.approx(area, rel=1e-12)
    assert soup.mesh(tuple(size), divisions).areas.sum() == pytest.approx(area, rel=1e-12)
    assert (np.sum(across * corners.mean(axis=1), axis=1) > 0).all()
    # Divergence theorem: the signed pyramids from the centre fill the box.
    assert np.sum(across * corners[:, 0]) / 6 == pytest.approx(np.prod(size), rel=1e-12)
    edges = collections.Counter((tuple(t[i]), tuple(t[i - 2])) for t in corners for i in range(3))
    assert set(edges.values()) == {1}
    assert all((end, start) in edges for start, end in edges)


@pytest.mark.parametrize('depth', [0.0, 1e-3])
@pytest.mark.parametrize('divisions', [4, 8, 16, 32])
def test_a_corner_on_a_face(depth, divisions):
    """The point is the corner, within a triangle's long side."""
    b, corner = corner_on_top(depth)
    model = cubes(divisions)
    contact = model(IDENTITY, b)
    assert np.linalg.norm(contact.point - corner) < np.sqrt(2) * 2.0 / divisions
    assert contact.separation == EXACT(IDENTITY, b).separation
    assert contact.separation == pytest.approx(-depth, abs=1e-15)
    if depth:
        assert model.model.fallbacks == 0


def test_the_error_shrinks_with_the_triangles():
    """In any pose, 1 mm deep: about in proportion to 1/N, and less than a triangle's side."""
    a, b = poses.at_depth(poses.CUBE, n=60, depth=1e-3)
    exact = EXACT.batch(a, b)
    errors = []
    for divisions in (2, 8, 32):
        found = cubes(divisions).batch(a, b)
        errors.append(np.linalg.norm(found.point - exact.point, axis=1).mean())
        assert errors[-1] < 2.0 / divisions
    assert errors[1] < 0.5 * errors[0] and errors[2] < 0.5 * errors[1]


@pytest.mark.parametrize('axis', range(3))
@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_the_normal_points_from_a_to_b(axis, sign):
    """B 1.9 m beside A along an axis and off centre: that axis, in either order.

    The side faces' normals lie evenly enough about it.
    """
    b = np.array([0.31, 0.31, 0.31, 0, 0, 0, 1])
    b[axis] = sign * 1.9
    for first, second, way in ((IDENTITY, b, 1.0), (b, IDENTITY, -1.0)):
        contact = cubes(8)(first, second)
        assert contact.normal @ (way * sign * np.eye(3)[axis]) > 0.8
        assert np.linalg.norm(contact.normal) == pytest.approx(1.0)


def test_depth_and_verdict_are_sats():
    a, b = poses.at_depth(poses.CUBE, n=60, depth=0.02)
    b[::3, :3] += 9.0
    found, exact = cubes(8).batch(a, b), EXACT.batch(a, b)
    assert np.array_equal(found.colliding, exact.colliding)
    assert np.array_equal(found.separation, exact.separation)
    assert np.isnan(found.point[~found.colliding]).all()
    with pytest.raises(ValueError, match='pose_b'):
        cubes(8)(IDENTITY, [0, 0, np.nan, 0, 0, 0, 1])


def test_a_box_inside_another_is_counted_and_answered():
    """Surfaces that do not meet: SAT's normal and the exact point, never NaN."""
    sizes = (poses.CUBE, (0.5, 0.5, 0.5))
    inside = np.array([0.2, 0.1, 0.5, 0, 0, 0, 1])
    model, exact = (ContactSolver(*sizes, model=make_model(name)) for name in ('soup-8', 'exact'))
    found, wanted = model(IDENTITY, inside), exact(IDENTITY, inside)
    assert found.colliding and model.model.fallbacks == 1
    assert np.array_equal(found.point, wanted.point)
    assert np.array_equal(found.normal, wanted.normal)
    model.batch([IDENTITY] * 3, [inside, inside + [9, 0, 0, 0, 0, 0, 0], inside])
    assert model.model.fallbacks == 3


def test_exact_touch_is_always_answered():
    """Cubes in any pose that touch to within rounding: no NaN, whether the soup found it or not."""
    a, b = poses.at_depth(poses.CUBE, n=200)
    found = cubes(8)
    many, exact = found.batch(a, b), EXACT.batch(a, b)
    touch = exact.colliding
    assert touch.mean() > 0.5
    assert np.isfinite(many.point[touch]).all() and np.isfinite(many.normal[touch]).all()
    assert 0 < found.model.fallbacks < touch.sum()


def test_batch_is_row_by_row_with_sizes_of_their_own():
    a, b, size_a, size_b = poses.random_pairs(np.random.default_rng(3), 40)
    many = cubes(4).batch(a, b, size_a=size_a, size_b=size_b)
    assert 10 < many.colliding.sum() < 40
    for row in range(len(a)):
        one = ContactSolver(size_a[row], size_b[row], model=make_model('soup-4'))(a[row], b[row])
        poses.assert_same_bits(one, many[row])


def test_boxes_in_one_place_are_left_to_exact():
    """The finest soup took 23 s for two cubes on each other; contacts have a limit."""
    contacts = soup.collide(*soup.Soup(64).place(IDENTITY, IDENTITY, poses.CUBE, poses.CUBE))
    assert len(contacts) == soup.MOST_CONTACTS
    solver = cubes(64)
    found, exact = solver(IDENTITY, IDENTITY), EXACT(IDENTITY, IDENTITY)
    assert solver.model.fallbacks == 1
    assert (found.separation, *found.normal) == (exact.separation, *exact.normal)
    assert found.point == pytest.approx(exact.point)

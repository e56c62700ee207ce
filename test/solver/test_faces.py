# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The patch of two faces: closed forms, frames, tilts of a micron, and pressures beneath a load."""
from __future__ import annotations

import numpy as np
import poses
import pytest

from box_contact_ros import ContactSolver, contacts_of, face_patches
from box_contact_ros.core import native
from box_contact_ros.solver.faces import corner_shares
from box_contact_ros.solver.pose import rotation_matrix

TOLERANCE = 1e-4
AT = (0.0, 0.0, 0.0, 1.0)


def patch(sizes, pose, tolerance=TOLERANCE):
    pairs, contacts = contacts_of(sizes, pose, tolerance=tolerance)
    assert len(pairs) == 1
    return face_patches(sizes, pose, pairs, contacts.normal, tolerance=tolerance)


def clipped(size_a, size_b, offset, yaw):
    """Return the area in which two upright rectangles overlap, by 2,000 strips of A."""
    x = (np.arange(2000) + 0.5) / 2000 * size_a[0] - size_a[0] / 2
    corners = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * size_b / 2
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    corners = corners @ turn.T + offset
    low, high = np.full(2000, np.inf), np.full(2000, -np.inf)
    for p, q in zip(corners, np.roll(corners, -1, axis=0)):
        with np.errstate(divide='ignore', invalid='ignore'):
            t = (x - p[0]) / (q[0] - p[0])
        y = np.where((t >= 0) & (t <= 1), p[1] + t * (q[1] - p[1]), np.nan)
        low, high = np.fmin(low, y), np.fmax(high, y)
    length = np.minimum(high, size_a[1] / 2) - np.maximum(low, -size_a[1] / 2)
    return np.maximum(length, 0.0).sum() * size_a[0] / 2000


def test_areas_of_turned_faces_are_those_of_strips():
    rng = np.random.default_rng(1)
    for _ in range(100):
        size_a, size_b = rng.uniform(0.5, 2, (2, 2))
        offset, yaw = rng.uniform(-0.5, 0.5, 2), rng.uniform(0, np.pi)
        found = patch([(*size_a, 1), (*size_b, 1)],
                      [(0, 0, 0, *AT), (*offset, 1, 0, 0, np.sin(yaw / 2), np.cos(yaw / 2))])
        assert found.area[0] == pytest.approx(clipped(size_a, size_b, offset, yaw), abs=1e-5)


def by_corners(size, pose, normal, tolerance):
    """Return area and centroid of a patch by all points in which two of its nine lines meet.

    And how far rounding may move the line at which the gap is the tolerance. 0 where edges meet.
    """
    if max(np.abs(normal @ rotation_matrix(q)).max() for q in pose[:, 3:]) < np.cos(0.1):
        return 0.0, np.full(3, np.nan), 0.0
    u = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    u /= np.linalg.norm(u)
    plane = np.stack((u, np.cross(normal, u)))
    lines, heights = [], []  # of each line: along its normal, and how far
    for side in (0, 1):
        axes, half = rotation_matrix(pose[side, 3:]), size[side] / 2
        face = np.abs(normal @ axes).argmax()
        outward = axes[:, face] * np.sign(normal @ axes[:, face]) * (1 - 2 * side)
        centre = pose[side, :3] - pose[0, :3] + half[face] * outward
        edges = [plane @ axes[:, k] * half[k] for k in range(3) if k != face]
        for edge, other in (edges, edges[::-1]):
            across = np.array((-other[1], other[0]))
            for sign in (1, -1):
                lines.append((*(sign * across), sign * across @ (plane @ centre)
                              + abs(across @ edge)))
        # The plane: outward · (x − centre) = 0 for x = uv + height · normal.
        heights.append(np.append(-(plane @ outward), outward @ centre) / (outward @ normal))
    gap = heights[1] - heights[0]
    blur = 1e-14 * size.max() / max(np.linalg.norm(gap[:2]), 1e-14)
    lines = np.array([*lines, (*gap[:2], tolerance - gap[2])])
    lines /= np.maximum(np.linalg.norm(lines[:, :2], axis=1, keepdims=True), 1e-12)
    points = [np.linalg.solve(pair[:, :2], pair[:, 2]) for n, first in enumerate(lines)
              for pair in (np.array((first, second)) for second in lines[:n])
              if abs(np.linalg.det(pair[:, :2])) > 1e-12]
    points = [p for p in points if (lines[:, :2] @ p <= lines[:, 2] + 1e-10).all()]
    if len(points) < 3:
        return 0.0, np.full(3, np.nan), blur
    middle = np.mean(points, axis=0)
    points = sorted(points, key=lambda p: np.arctan2(*(p - middle)[::-1])) - middle
    after = np.roll(points, -1, axis=0)
    parts = (points[:, 0] * after[:, 1] - points[:, 1] * after[:, 0]) / 2
    at = middle + parts @ (points + after) / 3 / parts.sum()
    height = np.mean(heights, axis=0) @ (*at, 1.0)
    return parts.sum(), pose[0, :3] + at @ plane + height * normal, blur


@pytest.mark.parametrize('tolerance', [0.0, 1e-4, 0.05])
def test_patches_are_those_of_all_corners(tolerance):
    """Containers with tilts of up to 0.1 rad, and boxes that cut each other any way."""
    rng = np.random.default_rng(7)
    pairs = poses.joined(poses.near_parallel_pairs(rng, 300), poses.random_pairs(rng, 300))
    solved = ContactSolver(margin=0.1).batch(*pairs[:2], size_a=pairs.size_a, size_b=pairs.size_b)
    compared = 0
    for row in np.flatnonzero(solved.separation <= tolerance):
        size, pose = (np.stack(part) for part in zip(*(
            (getattr(pairs, f'size_{k}')[row], getattr(pairs, f'pose_{k}')[row]) for k in 'ab')))
        normal = solved.normal[row]
        found = face_patches(size, pose, [(0, 1)], normal[None], tolerance=tolerance)
        area, centre, blur = by_corners(size, pose, normal, tolerance)
        scale = size.max()
        assert found.area[0] == pytest.approx(area, abs=(1e-8 * scale + 2 * blur) * scale)
        if area > 1e-4 * scale**2 and blur < 1e-8:
            assert found.centre[0] == pytest.approx(centre, abs=1e-6 * scale)
            compared += 1
    assert compared > 100


@pytest.mark.parametrize('moved, area', [
    ((0, 0, 0), 12.192 * 2.438), ((3, -0.5, 0), 9.192 * 1.938), ((12.192, 0, 0), 0.0),
    ((0, 0, 45), 2.438**2 * np.sqrt(2)), ((0, 0, 90), 2.438**2)])
def test_a_container_on_another_has_the_area_that_they_share(moved, area):
    """Shifted along and across; turned by 45°, it is a rhombus; and by 90° a square."""
    size, (x, y, degrees) = poses.CONTAINER, moved
    half = np.radians(degrees) / 2
    found = face_patches(size, [(0, 0, 0, *AT), (x, y, size[2], 0, 0, np.sin(half), np.cos(half))],
                         [(0, 1)], [(0, 0, 1)])
    assert found.area[0] == pytest.approx(area, abs=1e-12)
    if area:
        assert found.centre[0] == pytest.approx((x / 2, y / 2, size[2] / 2), abs=1e-12)


@pytest.mark.parametrize('tilt', [1e-6, 8e-6, 2e-5, 1e-4, 1e-2])
def test_a_tilted_container_has_the_part_of_its_face_that_is_near(tilt):
    """On its lower edge: up to the tolerance divided by the tilt from it."""
    length, width, height = size = poses.CONTAINER
    turn = (0, np.sin(tilt / 2), 0, np.cos(tilt / 2))
    # The lower edge at +x is at the height of the face below.
    z = height / 2 + (length * np.sin(tilt) + height * np.cos(tilt)) / 2
    found = face_patches(size, [(0, 0, 0, *AT), (0, 0, z, *turn)], [(0, 1)], [(0, 0, 1)])
    shared = length / 2 * (1 + np.cos(tilt)) - height / 2 * np.sin(tilt)
    near = min(shared, TOLERANCE / np.tan(tilt))
    assert found.area[0] == pytest.approx(width * near, rel=1e-9)


@pytest.mark.parametrize('tilt', [0.0, 1e-8, 1e-6, 3e-6])
@pytest.mark.parametrize('depth', [0.0, 4e-6, -3e-5])
def test_tilts_of_microns_change_no_patch(tilt, depth):
    """Of a container on a floor. Its overlap is a wedge whose centroid is up to 2.6 m off."""
    size = np.array((12.192, 2.438, 2.591))
    found = patch([(50, 50, 1), size], [
        (0, 0, -0.5, *AT), (1, 2, size[2] / 2 - depth, tilt / 3, tilt / 2, tilt / 2, 1)])
    assert found.area[0] == pytest.approx(12.192 * 2.438, rel=1e-5)
    assert found.centre[0] == pytest.approx((1, 2, 0), abs=4e-5)  # the gap
    outside = np.abs(found.rectangle[0, :, :2] - (1, 2)) - size[:2] / 2
    assert np.abs(outside).max() < 8 * tilt + 1e-12 and 4 <= found.corner_count[0] <= 8


def test_in_any_frame_and_order_the_patch_is_the_same():
    rng = np.random.default_rng(2)
    sizes = np.array([(2, 1.5, 1), (1, 0.8, 0.6)])
    half = np.radians(15)
    pose = np.array([(0, 0, 0, *AT), (0.8, 0.5, 0.8, 0, 0, np.sin(half), np.cos(half))])
    wanted = patch(sizes, pose)
    for turn in poses.unit_quaternions(rng, 20):
        moved = poses.moved(pose, rng.uniform(-5, 5, 3), turn[None])
        for order in ([0, 1], [1, 0]):
            found = patch(sizes[order], moved[order])
            assert found.area[0] == pytest.approx(wanted.area[0], rel=1e-9)
            edges = np.linalg.norm(np.diff(found.rectangle[0], axis=0), axis=1)
            assert np.sort(edges) == pytest.approx(np.sort(np.linalg.norm(
                np.diff(wanted.rectangle[0], axis=0), axis=1)), rel=1e-9)


def test_an_edge_has_the_strip_that_the_tolerance_gives():
    """A cube on its edge: on one side of it, the tolerance and the depth wide."""
    for depth in (0.0, 1e-3):
        half = np.pi / 8
        found = patch([(50, 50, 1), (1, 1, 1)], [
            (0, 0, -0.5, *AT), (0, 0, np.sqrt(0.5) - depth, np.sin(half), 0, 0, np.cos(half))])
        assert found.width[0] == pytest.approx(TOLERANCE + depth, rel=1e-6)
        assert found.area[0] == pytest.approx(TOLERANCE + depth, rel=1e-6)


def test_faces_apart_have_no_patch():
    found = face_patches(np.ones((2, 3)), np.array([(0, 0, 0, *AT), (0, 0, 1.1, *AT)]),
                         np.array([(0, 1)]), np.array([(0.0, 0.0, 1.0)]))
    assert found.corner_count[0] == found.area[0] == 0 and np.isnan(found.rectangle).all()


def test_corner_shares_balance_the_load():
    """They are not negative, sum to one, and have its centre; for one outside, the nearest."""
    rng = np.random.default_rng(3)
    rectangle = np.array([(1, 2), (1, -2), (-1, -2), (-1, 2)], float)
    at = np.column_stack((rng.uniform(-1, 1, 50), rng.uniform(-2, 2, 50), np.zeros(50)))
    corners = np.tile(np.column_stack((rectangle, np.zeros(4))), (50, 1, 1))
    shares = corner_shares(corners, at)
    assert shares.min() >= 0 and shares.sum(axis=1) == pytest.approx(1)
    assert np.einsum('kc,kci->ki', shares, corners) == pytest.approx(at)
    assert corner_shares(corners[:1], np.array([(3.0, 0, 0)]))[0] == pytest.approx(
        (0.5, 0.5, 0, 0))


@pytest.mark.parametrize('at', [0.0, 0.2, 1 / 3, 0.5, 0.9, 0.999, 1.0, 1.2])
def test_pressures_below_a_load_are_those_of_a_bed_that_does_not_pull(at):
    """Linear up to a third of the half edge; then a triangle, which has its third at the load."""
    square = np.zeros((1, 9, 2))
    square[0, :4] = (1, 1), (-1, 1), (-1, -1), (1, -1)
    found = native.bed_pressures(square, np.array([4]), np.array([[at, 0.0]]))[0]
    wanted = (1 + 3 * at) / 4 if at <= 1 / 3 else 1 / (3 * (1 - at)) if at < 1 else np.inf
    assert found == pytest.approx(wanted, rel=1e-9)


def test_pressures_on_any_polygon_balance_the_load():
    """By a grid: the pressure that is found has the load's force and its centre."""
    rng = np.random.default_rng(4)
    grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, 150)] * 2), axis=-1).reshape(-1, 2)
    for share in np.linspace(0, 0.9, 10):
        angle = np.sort(rng.uniform(0, 2 * np.pi, 6))
        polygon = np.stack((np.cos(angle), np.sin(angle)), axis=1)
        edge = np.roll(polygon, -1, axis=0) - polygon
        inside = (edge[:, 0] * (grid[:, None, 1] - polygon[:, 1])
                  >= edge[:, 1] * (grid[:, None, 0] - polygon[:, 0])).all(axis=1)
        places = grid[inside]
        at = (1 - share) * places.mean(axis=0) + share * polygon[rng.integers(6)]
        padded = np.zeros((1, 9, 2))
        padded[0, :6] = polygon
        found = native.bed_pressures(padded, np.array([6]), at[None])[0]
        basis = np.column_stack((np.ones(len(places)), places - at)) * np.sqrt(4 / 150**2)
        field = np.zeros(3)
        for _ in range(30):  # Newton on the grid
            pressed = basis[basis @ field >= 0]
            field = np.linalg.solve(pressed.T @ pressed, (1, 0, 0))
        assert found == pytest.approx((field[0] + (polygon - at) @ field[1:]).max(), rel=0.02)


@pytest.mark.parametrize('seed', range(20))
def test_the_corners_of_a_hull(seed):
    """Counter-clockwise, each once; a point is a corner unless it is between or among others."""
    rng = np.random.default_rng(seed)
    points = rng.integers(0, 5, (rng.integers(1, 12), 2)).astype(float)
    corners = native.hull(points)
    edges = np.roll(corners, -1, axis=0) - corners
    to = points[:, None] - corners
    assert (edges[:, 0] * to[..., 1] - edges[:, 1] * to[..., 0] >= 0).all()
    assert {*map(tuple, corners)} <= {*map(tuple, points)}
    assert len({*map(tuple, corners)}) == len(corners) >= 1
    if len(corners) > 2:
        after = np.roll(edges, -1, axis=0)
        assert (edges[:, 0] * after[:, 1] - edges[:, 1] * after[:, 0] > 0).all()
    assert native.hull(points[:0]).shape == (0, 2)


@pytest.mark.parametrize('at, depth', [((0.3, 0.4), 0.3), ((1, 1), 0.0), ((2, 0.5), -1.0),
                                       ((2, 2), -np.sqrt(2))])
def test_depths_inside_a_hull(at, depth):
    square = np.array([(0, 0), (1, 0), (0.5, 0.5), (1, 1), (0, 1), (1, 1)], float)
    found = native.hull_depths(square, np.array([0, 6, 6]), np.array([at, at], float))
    assert found[0] == pytest.approx(depth) and found[1] == -np.inf
    assert native.hull_depths(square[:1], np.array([0, 1]), np.array([(3.0, 4.0)]))[0] == -5

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Corner loads of what has landed tilted: those of statics, at the corners of the faces.

At rest a load is some microns deep and tilted by 1e-8 to 1e-6 rad, so that the overlap is a wedge.
"""
from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from box_contact_ros import Body, PatchForces, Plan, contacts_of, inspect_plan
from box_contact_ros.solver.pose import rotation_matrix

G = 9.81
GROUND = (0, 0, -0.5, 0, 0, 0, 1)
FORTY, TWENTY, CARTON, CUBE = (12.192, 2.438, 2.591), (6.058, 2.438, 2.591), (0.4, 0.3, 0.25), (
    1, 1, 1)
STEPS = pytest.mark.parametrize('step', [1e-3, 2e-4])
OWN = pytest.mark.parametrize('own', [True, False])


def about(axis, degrees):
    half = np.radians(degrees) / 2
    return (*np.sin(half) * np.array(axis) / np.linalg.norm(axis), np.cos(half))


def land(size, mass, off, step, *, own=True, degrees=1.0, down=(0, 0, -1)):
    """Drop a load, its centre of mass off by shares of its half edges. Return loads, and poses."""
    sizes = np.array([(50, 50, 1), size], float)
    centre = np.array((*off, 0)) * size / 2
    forces = PatchForces([Body.fixed(), Body(
        mass=mass, inertia=Body.of_box(size, mass).inertia, centre=centre)])
    forces.set_boxes(sizes)
    drop = 0.05 + np.sin(np.radians(degrees)) * (size[0] + size[1]) / 2 if degrees else 0.0
    poses = np.array([GROUND, (0, 0, size[2] / 2 + drop, *about((0.3, 1, 0), degrees))])
    weights = np.zeros((2, 6))
    weights[1, :3] = mass * G * np.array(down)
    poses = settled(forces, sizes, poses, weights, step, own=own)
    return forces.loads(), sizes, poses


def settled(forces, sizes, poses, weights, step, *, own, duration=3.0):
    """Return the poses after some seconds: by own contacts, or by answers two steps late."""
    velocities = np.zeros((len(poses), 6))
    for tick in range(round(duration / step)):
        if own and tick == 0:
            forces.hold(list(combinations(range(len(poses)), 2)))
        if not own and tick % 5 == 0:
            asked, answer = poses, contacts_of(sizes, poses)
        if not own and tick % 5 == 2:
            forces.hold(*answer, asked, age=2 * step, period=5 * step)
        poses, velocities, *_ = forces.advance(step, poses, velocities, weights)[:3]
    return poses


def in_box(points, pose):
    return (points - pose[:3]) @ rotation_matrix(pose[3:])


def beyond(corners, size, pose):
    """Return how far a corner is beyond the sides of a box at most [m]."""
    return (np.abs(in_box(corners, pose)) - size / 2)[:, :2].max()


def assert_at_rest(loads, sizes, poses, wanted, weight, off):
    """Corner loads are within 1 % of those wanted, and all corners within the face."""
    found = loads.corner_loads[0]
    assert np.sort(found) == pytest.approx(np.sort(wanted), rel=0.01)
    assert found.sum() == pytest.approx(weight, rel=0.001)
    assert beyond(loads.corners[0], sizes[1], poses[1]) < 1e-7
    heaviest = in_box(loads.corners[0], poses[1])[found.argmax(), :2]
    assert (np.sign(heaviest) == np.sign(off))[np.array(off) != 0].all()


@pytest.mark.parametrize('size, mass, off', [
    (FORTY, 24e3, (0.1, 0.2)), (FORTY, 24e3, (0.3, 0)), (TWENTY, 24e3, (0.1, 0.2)),
    (CARTON, 6, (0.2, 0.1)), (CARTON, 6, (0.6, 0)), (CUBE, 100, (0.2, 0.1))])
@STEPS
@OWN
def test_a_load_that_has_landed_weighs_on_its_corners_as_statics_say(size, mass, off, step, own):
    """And it stands: its overlap alone would say that it tips."""
    loads, sizes, poses = land(size, mass, off, step, own=own)
    wanted = [mass * G / 4 * (1 + x * off[0]) * (1 + y * off[1]) for x in (1, -1) for y in (1, -1)]
    assert_at_rest(loads, sizes, poses, wanted, mass * G, off)
    found = inspect_plan(Plan(sizes, poses, ground=0))
    assert found.stands[1] and found.share[1] > 0.999
    assert found.margin[1] == pytest.approx(min(size[:2]) / 2, rel=1e-3)


@STEPS
@OWN
def test_a_cube_on_a_slope_weighs_on_its_lower_edge(step, own):
    """On 20°: the centre of pressure is half an edge times the tangent down the slope."""
    slope = np.radians(20)
    loads, sizes, poses = land(CUBE, 1, (0, 0), step, own=own, degrees=0.0,
                               down=(np.sin(slope), 0, -np.cos(slope)))
    pressing = G * np.cos(slope)
    wanted = [pressing / 4 * (1 + x * np.tan(slope)) for x in (1, 1, -1, -1)]
    assert_at_rest(loads, sizes, poses, wanted, pressing, (1, 0))
    found = inspect_plan(Plan(sizes, poses, ground=0),
                         acceleration=(G * np.sin(slope), 0, -G * np.cos(slope)))
    assert found.stands[1] and found.share[1] > 0.999


@OWN
def test_a_stack_that_has_landed_weighs_on_each_of_its_boxes_as_statics_say(own):
    """Five containers, tilted, turned and set off, as docs/examples/container_stack.py drops them.

    Each patch carries all that is above it, below the centre of that.
    """
    count, mass = 5, 20e3
    sizes = np.array([(40, 40, 1), *[FORTY] * count], float)
    poses = np.array([GROUND, *((
        0.1 * (-1)**n, 0, (n + 0.5) * FORTY[2] + 0.01 * (n + 1), *about((0.05, 0, n), np.hypot(
            0.05, n))) for n in range(count))])
    weights = np.zeros((count + 1, 6))
    weights[1:, 2] = -G * mass
    forces = PatchForces([Body.fixed(), *[Body.of_box(FORTY, mass)] * count])
    forces.set_boxes(sizes)
    poses = settled(forces, sizes, poses, weights, 1e-3, own=own)
    found = inspect_plan(Plan(sizes, poses, ground=0))
    assert found.stands.all() and found.share[1] > 0.999 and found.share.min() > 0.96
    loads = forces.loads()
    assert np.sort(loads.pairs).tolist() == [[n, n + 1] for n in range(count)]
    for pair, corners, carried in zip(np.sort(loads.pairs), loads.corners, loads.corner_loads):
        above, middle = poses[pair[1]:, :3], corners.mean(axis=0)
        u, v = (corners[0] - corners[3]) / 2, (corners[0] - corners[1]) / 2
        x, y = ((above.mean(axis=0) - middle) @ side / (side @ side) for side in (u, v))
        wanted = G * mass * len(above) / 4 * np.array([
            (1 + x) * (1 + y), (1 + x) * (1 - y), (1 - x) * (1 - y), (1 - x) * (1 + y)])
        assert carried == pytest.approx(wanted, rel=0.01)
        # The rectangle is along the edges of one of both, and within it.
        assert min(beyond(corners, size, pose) for size, pose in zip(
            sizes[pair], poses[pair])) < 1e-7


def test_corners_without_sizes_are_those_of_the_moments():
    """Contacts of others and no boxes: the rectangle of the overlap, whose loads sum up too."""
    forces = PatchForces([Body.fixed(), Body.of_box(CUBE, 10)])
    poses = np.array([GROUND, (0, 0, 0.5 - 1e-5, 0, 0, 0, 1)])
    sizes = np.array([(5, 5, 1), CUBE])
    forces.hold(*contacts_of(sizes, poses), poses)
    weights = np.array([(0,) * 6, (0, 0, -10 * G, 0, 0, 0)])
    forces.advance(1e-3, poses, np.zeros((2, 6)), weights)
    loads = forces.loads()
    assert loads.corner_loads[0] == pytest.approx(np.full(4, loads.pressing[0] / 4), rel=1e-6)
    assert np.abs(loads.corners[0, :, :2]) == pytest.approx(0.5, abs=1e-6)

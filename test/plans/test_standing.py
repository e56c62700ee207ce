# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which boxes of a plan without masses stand: closed forms, many directions, any frame."""
from __future__ import annotations

import numpy as np
import poses
import pytest

from box_contact_ros import Plan, inspect_plan
from box_contact_ros.plans.standing import standing


def upright(*places):
    return np.hstack((np.array(places, float), np.tile([0.0, 0, 0, 1], (len(places), 1))))


def inspected(size, pose, *, ground=0, up=(0.0, 0.0, 1.0), **options):
    return inspect_plan(Plan(size, pose, ground=ground), acceleration=-9.81 * np.array(up),
                        **options)


@pytest.mark.parametrize('overhang', [-0.3, 0.0, 0.4, 0.5, 0.6, 1.2])
def test_a_box_that_overhangs(overhang):
    """A cube of 1 m on a table: half a metre is the most that it may overhang."""
    found = inspected([(4, 3, 1), (1, 1, 1)], upright((0, 0, 0), (1.5 + overhang, 0, 1)))
    if overhang > 1.0:
        assert len(found.carried_by) == found.share[1] == 0 and found.margin[1] == -np.inf
        assert found.stands.tolist() == [True, False]
        return
    assert found.carried_by.tolist() == [[0, 1]]
    assert found.share == pytest.approx([1.0, 1.0 - max(overhang, 0.0)], abs=1e-8)
    assert found.margin[0] == np.inf
    assert found.margin[1] == pytest.approx(0.5 - max(overhang, 0.0), abs=1e-8)
    assert found.stands.tolist() == [True, overhang < 0.5]


def test_a_bridge_stands_while_its_pillars_do():
    """Its centre is above none of them; and one pillar that hangs in the air takes it down."""
    size = [(9, 9, 1), (1, 1, 1), (1, 1, 1), (5, 1, 1)]
    pose = upright((0, 0, -0.5), (-2, 0, 0.5), (2, 0, 0.5), (0, 0, 1.5))
    bridge = inspected(size, pose)
    assert bridge.share[3] == pytest.approx(0.4, abs=1e-8)
    assert bridge.margin[3] == pytest.approx(0.5, abs=1e-8) and bridge.stands.all()
    pose[0, 0] = -3.5  # no longer below the second pillar
    fallen = inspected(size, pose)
    assert fallen.stands.tolist() == [True, True, False, False]
    assert fallen.margin[3] == bridge.margin[3]


@pytest.mark.parametrize('floor', [1.0, 100.0, 10_000.0])
@pytest.mark.parametrize('width', [0.1, 1.0, 2.0])
def test_a_box_on_its_edge_does_not_stand(floor, width):
    """Its centre is above the edge, which merely touches a floor of any size."""
    turn = np.arctan(width) / 2
    pose = upright((0, 0, -0.5), (0, 0, np.hypot(width, 1.0) / 2))
    pose[1, 3:] = 0, np.sin(turn), 0, np.cos(turn)
    found = inspected([(floor, floor, 1), (width, 1, 1)], pose)
    assert found.cause.tolist() == ['', 'unsupported']


def test_without_ground_nothing_stands():
    """A pile in the air, and four boxes of which each carries the next, in a ring."""
    pile = inspected((1, 1, 1), upright((0, 0, 0), (0, 0, 1)), ground=())
    assert not pile.stands.any() and pile.margin[1] == pytest.approx(0.5, abs=1e-8)
    nothing = np.zeros(4, bool)
    assert not standing(np.arange(4), (np.arange(4) + 1) % 4, ~nothing, nothing).any()


def many_directions(size, pose, carried_by):
    """Return the least reach (n,) of the corners of shared rectangles, in 7,200 directions."""
    lower, upper = carried_by.T
    low = np.maximum(*((pose[box, :2] - size[box, :2] / 2) for box in (lower, upper)))
    high = np.minimum(*((pose[box, :2] + size[box, :2] / 2) for box in (lower, upper)))
    angle = np.linspace(0.0, 2.0 * np.pi, 7200, endpoint=False)
    directions = np.stack((np.cos(angle), np.sin(angle)))
    reach = np.full((len(size), 7200), -np.inf)
    for x, y in ((low, low), (low, high), (high, low), (high, high)):
        corner = np.stack((x[:, 0], y[:, 1]), axis=1) - pose[upper, :2]
        np.maximum.at(reach, upper, corner @ directions)
    return reach.min(axis=1)


def layers(rng):
    """Return sizes and poses of layers of boxes, each beside and above others."""
    size = np.column_stack((rng.uniform(0.3, 1.5, (300, 2)), np.ones(300)))
    place = np.column_stack((rng.uniform(-4, 4, (300, 2)), np.arange(300) % 6))
    return size, upright(*place)


def test_margins_are_those_of_all_directions():
    """Within what 0.05° of a hull's edge can hide; of boxes with any number of carriers."""
    size, pose = layers(np.random.default_rng(3))
    found = inspected(size, pose, ground=())
    wanted = many_directions(size, pose, found.carried_by)
    carried = np.isfinite(wanted)
    assert np.array_equal(carried, found.margin > -np.inf) and (wanted[carried] < 0).sum() > 20
    assert (found.margin <= wanted + 1e-8)[carried].all()
    assert found.margin[carried] == pytest.approx(wanted[carried], abs=4e-4)
    assert np.bincount(found.carried_by[:, 1]).max() > 5


def test_up_is_any_direction():
    """In another frame, with a stronger gravity: the same boxes stand."""
    rng = np.random.default_rng(4)
    size, pose = layers(rng)
    wanted = inspected(size, pose, ground=np.arange(0, 300, 6))
    turn = poses.unit_quaternions(rng, 1)
    moved = poses.moved(pose, rng.uniform(-5, 5, 3), turn)
    up = poses.moved(upright((0, 0, 3)), np.zeros(3), turn)[0, :3]
    found = inspected(size, moved, ground=np.arange(0, 300, 6), up=up)
    assert set(map(tuple, found.carried_by)) == set(map(tuple, wanted.carried_by))
    assert found.share == pytest.approx(wanted.share, abs=1e-7)
    assert found.margin == pytest.approx(wanted.margin, abs=1e-7)
    assert np.array_equal(found.stands, wanted.stands) and 50 < found.stands.sum() < 250


@pytest.mark.parametrize('yaw', range(0, 91, 5))
def test_a_square_patch_has_the_sides_of_its_box(yaw):
    """A crate with 0.4 x 0.4 m on its pallet, both turned. A cube that is turned on a floor."""
    half = np.radians(yaw) / 2
    turn = np.array([[0.0, 0.0, np.sin(half), np.cos(half)]])
    pose = poses.moved(upright((0, 0, 0.05), (0.45, 0, 0.25)), np.zeros(3), turn)
    crate = inspected([(0.85, 0.4, 0.1), (0.85, 0.4, 0.3)], pose)
    assert crate.margin[1] == pytest.approx(-0.025, abs=1e-8) and not crate.stands[1]
    pose[0] = upright((0, 0, 0.05))[0]
    cube = inspected([(30, 30, 0.1), (0.4, 0.4, 0.3)], pose)
    assert cube.margin[1] == pytest.approx(0.2, abs=1e-8) and cube.stands[1]


def test_corners_that_rounding_parts_are_one():
    """Five boxes below a sixth, in one of many frames: the margin is that of the hull."""
    size = [(1, 1, 1)] * 4 + [(2, 2, 1)]
    pose = upright((-0.5, -0.5, 0), (0.5, -0.5, 0), (-0.5, 0.5, 0), (0.5, 0.5, 0), (0, 0, 1))
    for turn in poses.unit_quaternions(np.random.default_rng(5), 200):
        up = poses.moved(upright((0, 0, 1)), np.zeros(3), turn[None])[0, :3]
        found = inspected(size, poses.moved(pose, np.zeros(3), turn[None]), up=up)
        assert found.margin[4] == pytest.approx(1.0, abs=1e-7)


@pytest.mark.parametrize('degrees, carries', [(0.0, True), (30.0, True), (44.9, True),
                                              (45.1, False), (60.0, False)])
def test_a_steep_slope_carries_nothing(degrees, carries):
    """Of two boxes in one frame, tilted: up to 45° the lower carries the upper."""
    tilt = np.radians(degrees)
    found = inspected((1, 1, 0.2), upright((0, 0, 0), (0, 0, 0.2)),
                      up=(np.sin(tilt), 0.0, np.cos(tilt)))
    assert len(found.carried_by) == carries == found.stands[1]
    if carries:  # the centre is 0.1 m above the patch
        assert found.margin[1] == pytest.approx(0.5 * np.cos(tilt) - 0.1 * np.sin(tilt), abs=1e-8)


def quaternion_to(direction, target):
    """Return the shortest turn that takes a direction to a unit vector."""
    direction = direction / np.linalg.norm(direction)
    turn = np.append(np.cross(direction, target), 1.0 + direction @ target)
    return turn / np.linalg.norm(turn)


@pytest.mark.parametrize('size', [(1, 1, 1), (1, 1, 0.05), (0.3, 0.3, 2), (0.4, 0.3, 0.25),
                                  (12.192, 2.438, 2.591), (0.05, 1, 3)])
@pytest.mark.parametrize('place', [(1, 1, 1), (1, 1, 0), (1, 0, 1), (0, 1, 1)])
def test_a_box_in_balance_does_not_stand(size, place):
    """On a corner or an edge, flush and up to 1 mm deep, at four tolerances: 672 cases."""
    down = -np.array(place) * size / 2
    turn = quaternion_to(down, (0, 0, -1))
    for depth in (0, 1e-9, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3):
        pose = [upright((0, 0, -0.5))[0], (0, 0, np.linalg.norm(down) - depth, *turn)]
        for tolerance in (0, 1e-6, 1e-4, 1e-3):
            found = inspected([(50, 50, 1), size], pose, tolerance=tolerance)
            assert found.cause.tolist() == ['', 'unsupported']


@pytest.mark.parametrize('size', [(0.6, 0.4, 0.3), (12.192, 2.438, 2.591)])
def test_stacks_in_float32_stand_by_a_tolerance(size):
    """200 boxes with gaps of up to 27 µm; without the tolerance fewer than 130 pairs touch."""
    sizes = np.array([(20, 20, 1), *[size] * 200], np.float32)
    pose = upright((0, 0, -0.5), *[(0, 0, (k + 0.5) * size[2]) for k in range(200)])
    pose = pose.astype(np.float32)
    for tolerance in (1e-5, 1e-4):
        found = inspected(sizes, pose, tolerance=tolerance)
        assert len(found.carried_by) == 200 and found.stands.all()
        assert found.share == pytest.approx(1.0)
    found = inspected(sizes, pose, tolerance=0)
    assert len(found.carried_by) < 130 and found.stands.sum() < 130


def test_boxes_that_stand_beside_carry_nothing():
    """A column reaches beneath a box by less than the tolerance: that is no pillar."""
    for reach, stands in ((5e-5, False), (1e-2, True)):
        pose = upright((0, 0, -0.5), (-1, 0, 0.5), (1.5 - reach, 0, 0.5), (-0.1, 0, 1.5))
        size = [(9, 9, 1), (1, 1, 1), (1, 1, 1), (2.2, 1, 1)]
        assert inspected(size, pose).stands[3] == stands

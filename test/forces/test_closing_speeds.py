# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is fast is met in time: gaps count closing speeds, and impacts travel before boxes touch."""
from __future__ import annotations

import numpy as np
import pytest
from worlds import FIXED, FLOOR, World, turned

from box_contact_ros import PatchForces
from box_contact_ros.forces.patch_forces import GRAVITY

FRAME = 1.0 / 60.0  # [s]
SHORT = (6.058, 2.438, 2.591)  # a container of 20 ft
CUBE = (0.5, 0.5, 0.5)


@pytest.mark.parametrize('held', [False, True])
@pytest.mark.parametrize('dt', [1 / 120, FRAME])
@pytest.mark.parametrize('height', [1.0, 5.0, 12.0, 20.0])
def test_what_falls_far_is_not_deep(height: float, dt: float, held: bool) -> None:
    """Less than 1 mm, and at rest within .2 s: from 20 m it was 321 mm deep, for 3.2 s."""
    world = World(FLOOR, (SHORT, 2e4, (0, 0, 0.5 * SHORT[2] + height)), find_pairs=not held)
    lands, deepest = np.sqrt(2.0 * height / GRAVITY), 0.0
    for _ in range(round((lands + 0.2) / dt)):
        deepest = max(deepest, 0.5 * SHORT[2] - world.step(dt).poses[1, 2])
    assert deepest < 1e-3
    assert np.abs(world.velocities[1]).max() < 1e-3


@pytest.mark.parametrize('speed', [4.0, 10.0, 30.0, 100.0, 300.0])
def test_a_wall_stops_what_is_faster_than_its_thickness_a_step(speed: float) -> None:
    """A box of 60 mm at a plate of 20 mm, at 1/60 s, wherever a step ends."""
    for start in np.linspace(1.0, 1.0 + speed * FRAME, 7):
        world = World(((0.02, 4.0, 4.0), 0.0, (0, 0, 0)), ((0.06,) * 3, 1.0, (-start, 0, 0)),
                      find_pairs=True)
        world.outside[:] = 0.0
        world.velocities[1, 0] = speed
        world.run(start / speed + 0.1, FRAME)
        assert world.poses[1, 0] == pytest.approx(-0.04, abs=1e-3)
        assert np.abs(world.velocities[1]).max() < 1e-3 * speed


def test_two_fast_boxes_meet_half_way() -> None:
    world = World(*((CUBE, 10.0, (side * 5.1, 0, 0)) for side in (-1, 1)), find_pairs=True)
    world.outside[:] = 0.0
    world.velocities[:, 0] = 60.0, -60.0
    world.run(0.2, FRAME)
    assert world.poses[:, 0] == pytest.approx((-0.25, 0.25), abs=1e-3)


def test_what_spins_fast_is_met_in_time() -> None:
    """A bar that turns by 20 rad/s sweeps 1 m beyond its bounding box in a step: it hits a post."""
    world = World(((4.0, 0.1, 0.1), 10.0, (0, 0, 0)), ((0.02, 0.02, 1.0), 0.0, (1.9, 0.35, 0)),
                  find_pairs=True)
    world.outside[:] = 0.0
    world.velocities[0, 5] = 20.0
    before = world.energies()[0]
    world.step(FRAME)
    assert world.energies()[0] < 0.9 * before


def test_a_carrier_that_is_moved_by_its_poses_is_met_in_time() -> None:
    """A plate that rises by 12 m/s through a box at rest in the air."""
    forces = PatchForces([World((CUBE, 10.0, (0, 0, 0)), pairs=[]).bodies[0], FIXED])
    forces.set_boxes([CUBE, (2, 2, 0.05)], find_pairs=True)
    poses, velocities = np.zeros((2, 7)), np.zeros((2, 6))
    poses[:, 6], poses[1, 2] = 1.0, -1.0
    for _ in range(12):
        poses, velocities = poses.copy(), velocities.copy()
        poses[1, 2] += 0.2
        poses, velocities, *_ = forces.advance(FRAME, poses, velocities)
        assert poses[0, 2] - poses[1, 2] > 0.27
    assert velocities[0, 2] == pytest.approx(12.0, rel=0.01)


@pytest.mark.parametrize('dt', [0.001, 1 / 120, FRAME])
@pytest.mark.parametrize('friction, speed', [(0.0, 6.0), (0.0, 1.0)])
def test_a_row_that_is_hit_goes_on_together(friction: float, speed: float, dt: float) -> None:
    """A cube hits five in a row on ice: all go on by a sixth of its speed, to 3.5 %.

    An impact is seen before the touch, and has to travel all the same.
    """
    rows = [(CUBE, 10.0, (0.5 * k + 0.05 * (k > 0), 0, 0.25)) for k in range(6)]
    world = World(FLOOR, *rows, find_pairs=True, friction=friction).run(0.1, dt)
    world.velocities[1, 0] = speed
    world.run(0.5, dt)
    assert world.velocities[1:, 0] == pytest.approx(speed / 6.0, rel=0.035)


def test_what_turns_in_the_air_goes_on() -> None:
    """It is within reach of the floor, and does not meet it: no gap holds it."""
    world = World(FLOOR, ((0.2, 0.2, 1.0), 5.0, (0, 0, 2.0), turned((0, 1, 0), 0.3)),
                  find_pairs=True)
    world.velocities[1, 4] = 3.0
    world.run(0.3, FRAME)
    assert world.velocities[1, 4] == pytest.approx(3.0, rel=1e-6)


def test_what_flies_past_a_wall_meets_it_where_it_is_by_then() -> None:
    """Obliquely at 30 m/s, .4 m aside in a step: it hits, or passes beside the edge untouched."""
    way = np.array((1.0, 0.8, 0.0)) / np.hypot(1.0, 0.8)
    for at, hits in ((0.0, True), (1.2, True), (2.1, False)):
        for start in np.linspace(1.0, 1.5, 7):
            world = World(((0.1, 4.0, 4.0), 0.0, (0, 0, 0)),
                          ((0.06,) * 3, 1.0, np.array((0, at, 0)) - start * way),
                          find_pairs=True, friction=0.0)
            world.outside[:] = 0.0
            world.velocities[1, :3] = 30.0 * way
            world.run(0.07, FRAME)
            assert (world.poses[1, 0] < 0.0) == hits
            assert hits or world.velocities[1, :3] == pytest.approx(30.0 * way)

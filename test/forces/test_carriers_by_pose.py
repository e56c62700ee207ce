# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Carriers that the caller moves by their poses alone: a lorry, a lift, a turntable."""
from __future__ import annotations

import math

import numpy as np
import pytest
from helpers.worlds import World, turned

from box_contact_ros import Body, PatchForces
from box_contact_ros.solver.pose import rotation_matrix

SECONDS = 4.0  # of a ride [s]


def ride(kind: str, time: float) -> np.ndarray:
    """Return the carrier's pose: it starts, goes by 6 m, 3 m or 2 rad, and stops."""
    part = min(max(time / SECONDS, 0.0), 1.0)
    share = part - math.sin(2.0 * math.pi * part) / (2.0 * math.pi)
    pose = np.array([0, 0, -0.5, 0, 0, 0, 1.0])
    if kind == 'lorry':
        pose[0] += 6.0 * share
    elif kind == 'lift':
        pose[2] += 3.0 * share
    else:
        pose[3:] = turned((0, 0, 1), 2.0 * share)
    return pose


def aside(world: World) -> np.ndarray:
    """Return where the load is, seen from the carrier."""
    carrier, load = world.poses
    return (load[:3] - carrier[:3]) @ rotation_matrix(carrier[3:])


def loaded(dt: float) -> World:
    return World(((6.0, 3.0, 1.0), 0.0, (0, 0, -0.5)), ((1.0, 1.0, 0.5), 100.0, (1.0, 0, 0.25)),
                 find_pairs=True).run(1.0, dt)


@pytest.mark.parametrize('dt', [0.001, 1 / 60])
@pytest.mark.parametrize('kind', ['lorry', 'lift', 'turntable'])
def test_a_load_rides_on_a_carrier_moved_by_its_poses(kind: str, dt: float) -> None:
    """At each step it is where it stood on the carrier, but for what lets it sink or rise."""
    world = loaded(dt)
    stood, worst = aside(world), 0.0
    for k in range(round((SECONDS + 1.0) / dt)):
        world.poses[0] = ride(kind, k * dt)
        world.step(dt)
        worst = max(worst, float(np.abs(aside(world) - stood).max()))
    assert worst < 2e-4 and np.abs(aside(world) - stood).max() < 1e-5
    assert not world.awake.any()


@pytest.mark.parametrize('dt', [1 / 240, 1 / 60])
def test_a_load_keeps_its_place_in_a_curve(dt: float) -> None:
    """5 m/s on a circle of 15 m. A load a step late moves aside by turn · v · dt: 56 mm at 38°."""
    world = loaded(dt)
    stood = aside(world)
    for k in range(round(3.0 / dt)):
        speed = min(2.0 * k * dt, 5.0)
        along = (k * dt * speed / 2.0 if speed < 5.0 else 5.0 * k * dt - 6.25)
        angle = along / 15.0
        world.poses[0] = [15.0 * math.sin(angle), 15.0 * (1.0 - math.cos(angle)), -0.5,
                          *turned((0, 0, 1), angle)]
        world.step(dt)
    assert np.abs(aside(world) - stood).max() < 2e-4


@pytest.mark.parametrize('by_poses', [True, False])
def test_boards_beside_a_load_do_not_push_it(by_poses: bool) -> None:
    """Boards 5 mm beside a load on a lorry at 8 m/s: one that came a step early pressed on it."""
    dt, gap = 1 / 60, 0.005
    sizes = [(6.0, 3.0, 1.0), (0.1, 3.0, 0.5), (0.1, 3.0, 0.5), (1.0, 1.0, 0.5)]
    at = [(0, 0, 0), (0.55 + gap, 0, 0.75), (-0.55 - gap, 0, 0.75), (0, 0, 0)]
    forces = PatchForces([Body.of_box(sizes[0], 0.0), Body.of_box(sizes[3], 100.0)])
    forces.set_boxes(sizes, body=[0, 0, 0, 1], poses=[(*place, 0, 0, 0, 1) for place in at],
                     find_pairs=True)
    poses = np.array([(0, 0, -0.5, 0, 0, 0, 1), (0, 0, 0.25, 0, 0, 0, 1.0)])
    velocities, weight = np.zeros((2, 6)), np.array([[0.0] * 6, [0, 0, -981.0, 0, 0, 0]])

    def way(time: float) -> float:
        speeding = min(time, 4.0)
        return speeding**2 + 8.0 * max(time - 4.0, 0.0)
    for k in range(round(6.0 / dt)):
        if by_poses:
            poses[0, 0] = way(k * dt)
        else:
            velocities[0, 0] = (way((k + 1) * dt) - way(k * dt)) / dt
        poses, velocities, _, _ = forces.advance(dt, poses, velocities, weight)
    assert poses[1, 0] - poses[0, 0] == pytest.approx(0.0, abs=2e-4)


def test_a_carrier_put_elsewhere_has_no_speed_once_forgotten() -> None:
    """Nor has one in the first step; else it drags its load along for a step."""
    dragged = []
    for forgets in (True, False):
        world = loaded(1 / 60)
        world.poses[0, 0] += 1.0
        if forgets:
            world.forces.forget([0])
        dragged.append(world.step(1 / 60).velocities[1, 0])
    assert dragged[0] == 0.0
    assert dragged[1] > 0.05


def test_velocities_that_are_given_hold() -> None:
    """Poses that tell another speed do not count, and a carrier that stopped has none."""
    dt = 1 / 60
    world, twin = loaded(dt), loaded(dt)
    for each in (world, twin):
        each.velocities[0, 0] = 0.6
        each.run(1.0, dt)
    world.poses[:, 0] += 1.0  # both
    assert world.step(dt).poses[1, 0] - twin.step(dt).poses[1, 0] == pytest.approx(1.0, abs=1e-12)
    twin.velocities[:] = 0.0
    assert twin.step(dt).velocities[1, 0] == pytest.approx(0.0, abs=1e-12)


def test_a_rope_on_a_carrier_moved_by_its_poses_is_taken_ahead() -> None:
    """As one on a carrier of that velocity: by 3/8 of a step of four sub-steps."""
    dt = 1 / 60
    world = loaded(dt)
    start = world.poses[0, 0]
    world.poses[0, 0] += 0.5 * dt
    ahead = world.forces.ahead(dt, world.poses, world.velocities)
    assert ahead[0, 0] - start == pytest.approx(0.375 * 0.5 * dt, rel=1e-9)

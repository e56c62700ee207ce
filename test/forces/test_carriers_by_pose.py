# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Carriers that the caller moves by their poses alone: a lorry, a lift, a turntable."""
from __future__ import annotations

import math

import numpy as np
import pytest
from helpers.worlds import World, turned

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
@pytest.mark.parametrize('kind, line', [('lorry', 1e-6), ('lift', 1e-6), ('turntable', 1e-5)])
def test_a_load_rides_on_a_carrier_moved_by_its_poses(kind: str, line: float, dt: float) -> None:
    """It follows a step late, and stands in the end where it stood on the carrier."""
    world = loaded(dt)
    stood, fastest = aside(world), 3.0
    for k in range(round((SECONDS + 1.0) / dt)):
        world.poses[0] = ride(kind, k * dt)
        assert np.abs(aside(world) - stood).max() < 1.001 * fastest * dt
        world.step(dt)
    assert np.abs(aside(world) - stood).max() < line
    assert not world.awake.any()


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
    world.poses[0, 0] += 0.5 * dt
    ahead = world.forces.ahead(dt, world.poses, world.velocities)
    assert ahead[0, 0] - world.poses[0, 0] == pytest.approx(0.375 * 0.5 * dt, rel=1e-9)

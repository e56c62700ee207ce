# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Belts whose speed is set once, and lasts, however late pairs and contacts are."""
from __future__ import annotations

import numpy as np
import pytest
from helpers.worlds import STEP, World

from box_contact_ros import contacts_of

BELT, CRATE = (20.0, 2.0, 1.0), (0.6, 0.4, 0.3)
EVERY, LATE = 20, 5  # steps of 1 ms: answers at 50 Hz, 5 ms late


def speed(time: float) -> float:
    """Return that of a belt that starts and stops by 4 m/s²; friction holds 4.9."""
    return min(1.0, max(0.0, 4.0 * (time - 0.5)), max(0.0, 4.0 * (2.0 - time)))


def crate_on_a_belt(*, find_pairs: bool = False) -> World:
    world = World((BELT, 0.0, (0, 0, -0.5)), (CRATE, 10.0, (0, 0, 0.15)), pairs=[],
                  find_pairs=find_pairs)
    world.forces.set_boxes(world.size, find_pairs=find_pairs)
    return world


def slip(way: str) -> float:
    """Return how much faster or slower than its belt a crate is at most [mm/s]."""
    world, slips, told = crate_on_a_belt(find_pairs=way == 'pairs found'), [], 0.0
    for k in range(2600):
        now = speed((k + 0.5) * STEP)
        if k % EVERY == 0:
            told, asked = now, world.poses.copy()
            pairs, contacts = contacts_of(world.size, asked)
        if k % EVERY == LATE and way != 'pairs found':
            late = (contacts, asked) if way == 'contacts late' else ()
            world.forces.hold(pairs, *late, age=LATE * STEP if late else 0.0,
                              period=EVERY * STEP if late else 0.0, surface_velocity=None
                              if way != 'speed late' else np.tile((-told, 0, 0), (len(pairs), 1)))
        if way != 'speed late':
            world.forces.set_surface(0, (now, 0, 0))
        world.step()
        slips.append(abs(world.velocities[1, 0] - now))
    return 1e3 * max(slips[100:])


@pytest.mark.parametrize('way, line', [('pairs found', 0.01), ('pairs late', 0.01),
                                       ('contacts late', 5.0)])
def test_a_late_list_makes_no_late_belt(way: str, line: float) -> None:
    """With its speed in the late list, the crate slips by 96 mm/s."""
    assert slip(way) < line
    assert slip('speed late') > 90.0


@pytest.mark.parametrize('belt', [0, 1])
def test_a_belt_wakes_what_lies_on_it_and_lasts(belt: int) -> None:
    """Through other boxes, a reset and what the list says, until it is set again."""
    rows = [(BELT, 0.0, (0, 0, -0.5)), (CRATE, 10.0, (0, 0, 0.15))]
    crate = 1 - belt
    world = World(*rows[::1 - 2 * belt], find_pairs=True).run(1.0)
    assert not world.awake.any()
    world.forces.set_surface(crate, (0, 0, 0))
    assert not world.step().awake.any()
    world.forces.set_surface(belt, (0.5, 0, 0))
    assert world.step().awake[crate]
    world.run(1.0)
    assert world.velocities[crate, 0] == pytest.approx(0.5, abs=1e-6)
    world.forces.set_boxes([*world.size, (1, 1, 1)], body=[0, 1, belt], find_pairs=True, poses=[
        (0, 0, 0, 0, 0, 0, 1)] * 2 + [(0, 5, 0, 0, 0, 0, 1)])
    world.forces.reset()
    world.run(1.0)
    assert world.velocities[crate, 0] == pytest.approx(0.5, abs=1e-6)
    world.forces.set_boxes(world.size)
    world.forces.hold([(belt, crate)], surface_velocity=[(0, -0.2, 0)])
    world.run(0.5)
    assert world.velocities[crate, :2] == pytest.approx((0.5, 0.2), abs=1e-6)
    world.forces.hold([(belt, crate)])
    world.forces.set_surface(belt, (0, 0, 0))
    world.run(1.0)
    assert not world.awake.any()


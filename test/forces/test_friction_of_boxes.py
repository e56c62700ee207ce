# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Boxes have their own friction, and a pair has the lesser of both, as in `inspect_plan`."""
from __future__ import annotations

from dataclasses import replace
from math import nan

import numpy as np
import pytest
from worlds import FLOOR, World, turned

from box_contact_ros import Plan, contacts_of, inspect_plan
from box_contact_ros.forces.patch_forces import GRAVITY

CRATE = (0.6, 0.4, 0.3)
FRAME = 1.0 / 60.0  # [s]


def braking(world: World, crate: int, way: str = 'found', **told: object) -> float:
    """Return with what friction a crate that is pushed along the floor slides [1].

    way: its pair is found, held, or comes in answers, which may have a friction.
    """
    push = 1.5 * world.mass[crate] * GRAVITY
    world.outside[crate, 0] = push
    for _ in range(30):
        if way == 'answers':
            pairs, contacts = contacts_of(world.size, world.poses)
            world.forces.hold(pairs, contacts, world.poses, **told)
        world.step(FRAME)
    speed = world.velocities[crate, 0]
    world.outside[crate, 0] = world.velocities[crate, 0] = 0.0
    return (push / world.mass[crate] - speed / 0.5) / GRAVITY


def crate_on_a_floor(way: str) -> World:
    world = World(FLOOR, (CRATE, 10.0, (0, 0, 0.15)), pairs=[], find_pairs=way == 'found',
                  friction=0.5)
    world.forces.set_boxes(world.size, find_pairs=way == 'found')
    if way == 'held':
        world.forces.hold([(0, 1)])
    return world


@pytest.mark.parametrize('way', ['found', 'held', 'answers'])
def test_a_pair_has_the_lesser_friction_of_its_boxes(way: str) -> None:
    """A box without its own has that of the forces; NaN takes it away again."""
    world = crate_on_a_floor(way)
    for floor, crate, both in ((None, None, 0.5), (0.3, None, 0.3), (None, 0.2, 0.2),
                               (nan, 0.8, 0.5), (1.2, None, 0.8), (nan, nan, 0.5)):
        for box, friction in enumerate((floor, crate)):
            world.forces.set_surface(box, friction=friction)
        assert braking(world, 1, way) == pytest.approx(both, abs=0.01)


@pytest.mark.parametrize('way', ['held', 'answers'])
def test_the_friction_of_a_row_wins(way: str) -> None:
    world = crate_on_a_floor(way)
    world.forces.set_surface(1, friction=0.2)
    if way == 'held':
        world.forces.hold([(0, 1)], friction=[0.9])
    assert braking(world, 1, way, friction=[0.9]) == pytest.approx(0.9, abs=0.01)


def test_friction_lasts_beside_the_speed_of_a_belt_and_wakes_what_rests() -> None:
    world = World((FLOOR[0], 0.0, FLOOR[2], turned((0, 1, 0), 0.3)),
                  (CRATE, 10.0, (0.65 * np.sin(0.3), 0, 0.65 * np.cos(0.3) - 0.5),
                   turned((0, 1, 0), 0.3)), find_pairs=True, friction=0.5).run(1.0, FRAME)
    assert not world.awake.any()
    world.forces.set_surface(0, friction=0.5)  # as before, but its own
    world.forces.set_surface(0, friction=0.2)
    assert world.step(FRAME).awake[1]
    world.forces.set_surface(0, (0, 1.0, 0))
    assert world.run(0.5, FRAME).velocities[1, 0] > 0.3  # it slides still
    world.forces.set_surface(0, (0, 0, 0), 0.9)
    assert not world.run(2.0, FRAME).awake.any()


def test_the_plan_says_the_same_as_the_forces() -> None:
    """On a lorry that brakes by .4 g: a crate of .3 slides, one on a mat of .6 does not."""
    sizes = [FLOOR[0], CRATE, CRATE, CRATE, CRATE]
    at = [FLOOR[2], (0, 0, 0.15), (0, 0, 0.45), (2, 0, 0.15), (2, 0, 0.45)]
    friction = [0.6, 0.6, 0.3, 0.9, 0.6]
    world = World(*((size, 10.0 * (k > 0), place) for k, (size, place) in enumerate(
        zip(sizes, at))), find_pairs=True)
    for box, each in enumerate(friction):
        world.forces.set_surface(box, friction=each)
    world.outside[1:, 0] = 0.4 * GRAVITY * 10.0
    world.run(1.0, FRAME)
    poses = np.column_stack((at, np.tile((0, 0, 0, 1), (5, 1))))
    plan = Plan(sizes, poses, masses=world.mass, ground=[0], friction=friction)
    braked = (0.4 * GRAVITY, 0, -GRAVITY)
    stays = np.abs(world.poses[:, 0] - np.array(at)[:, 0]) < 0.01
    found = inspect_plan(plan, friction=0.6, acceleration=braked).stands
    assert found.tolist() == stays.tolist() == [True, True, False, True, True]
    alike = replace(plan, friction=np.full(5, nan))
    assert inspect_plan(alike, friction=0.6, acceleration=braked).stands.all()

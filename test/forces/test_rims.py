# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Boxes that only pass each other by a rim do not hold each other: planned stacks are flush.

What rests is microns deep, so it overlaps a neighbour that it is flush with by microns. All is
compared with the same .1 mm off flush, with theory, or with what `inspect_plan` says.
"""
from __future__ import annotations

from functools import partial
from itertools import product

import numpy as np
import pytest
from worlds import FLOOR, World

from box_contact_ros import Body, ContactSolver, PatchForces, Plan, inspect_plan
from box_contact_ros.forces.patch_forces import GRAVITY

FRAME = 1.0 / 60.0  # [s]
FRICTION = 0.4
OFF = 1e-4  # [m]
SHORT = (6.058, 2.438, 2.591)  # a container of 20 ft
CARTON = (0.4, 0.3, 0.25)


def hold_all(world: World) -> None:
    """Hold answers of pairs and poses, as of a node that is never late."""
    pairs = np.array(np.triu_indices(len(world.size), 1)).T
    pairs = pairs[(world.mass[pairs] > 0).any(axis=1)]
    world.forces.hold(pairs, ContactSolver().batch(world.poses, sizes=world.size, pairs=pairs),
                      world.poses)


def braked(off: float, dt: float, share: float, held: bool = False) -> float:
    """Return how far a container slides that stands on the first of two in a row [m].

    They are carried, and brake toward the second for 1.5 s, by a share of what friction holds.
    """
    world = World(*((SHORT, 0.0, (SHORT[0] * k, 0, 0.5 * SHORT[2])) for k in range(2)),
                  (SHORT, 1e4, (off, 0, 1.5 * SHORT[2])), find_pairs=not held, pairs=[],
                  friction=FRICTION)
    if held:
        world.forces.set_boxes(world.size)
    for step in range(round(2.5 / dt)):
        world.velocities[:2, 0] = -share * FRICTION * GRAVITY * max(0.0, (step + 1) * dt - 1.0)
        if held:
            hold_all(world)
        world.step(dt)
    return world.poses[2, 0] - world.poses[0, 0] - off


@pytest.mark.parametrize('held', [False, True])
@pytest.mark.parametrize('dt', [0.001, 1 / 120, FRAME])
def test_a_container_that_is_flush_slides_as_one_that_is_not(dt: float, held: bool) -> None:
    """By 1.5 of what friction holds 2.207 m, and 0 where its neighbour's rim held it."""
    flush, off = braked(0.0, dt, 1.5, held), braked(OFF, dt, 1.5, held)
    assert flush == pytest.approx(off, rel=0.002)
    if dt == 0.001:
        assert flush == pytest.approx(0.5 * 0.5 * FRICTION * GRAVITY * 1.5**2, rel=0.02)


@pytest.mark.parametrize('dt', [0.001, 1 / 120, FRAME])
def test_a_carton_is_pushed_off_a_packed_row(dt: float) -> None:
    """By 1.2 of its friction, over rows that are free: it went 0 mm."""
    rows = [(CARTON, 8.0, (CARTON[0] * k, 0, 0.125)) for k in range(6)]
    world = World(FLOOR, *rows, (CARTON, 8.0, (CARTON[0], 0, 0.375)), find_pairs=True,
                  friction=FRICTION).run(0.5, dt)
    world.outside[7, 0] = 1.2 * FRICTION * 8.0 * GRAVITY
    world.run(1.0, dt)
    assert world.poses[7, 0] - CARTON[0] == pytest.approx(0.1 * FRICTION * GRAVITY, rel=0.02)
    assert np.abs(world.poses[1:7, 0] - CARTON[0] * np.arange(6)).max() < 1e-3


@pytest.mark.parametrize('whole', [True, False])
@pytest.mark.parametrize('dt', [0.001, FRAME])
def test_what_slides_over_flush_tiles_is_not_thrown_back(whole: bool, dt: float) -> None:
    """Without friction it keeps its speed, where it begins flush with a seam as well."""
    tiles = [((0.3, 2.0, 0.3), 0.0, (0.3 * k - 0.53 + (0.03 if whole else 0.013), 0, -0.15))
             for k in range(14)]
    world = World(((0.5, 0.4, 0.2), 10.0, (0, 0, 0.1)), *tiles, find_pairs=True, friction=0.0)
    world.velocities[0, 0] = 1.0
    world.run(1.5, dt)
    assert world.velocities[0, 0] == pytest.approx(1.0, abs=1e-3)
    assert abs(world.poses[0, 2] - 0.1) < 5e-4


@pytest.mark.parametrize('dt, ledge', [(FRAME, 5e-5), *product(
    (0.001, 1 / 120, FRAME), (2e-4, 5e-4, 9e-4, 1.1e-3, 5e-3))])
def test_a_ledge_carries_as_inspect_plan_says(ledge: float, dt: float) -> None:
    """A crate between two posts, each of which reaches under it by so much [m]."""
    size, post = (1.0, 1.0, 0.5), (1.0, 1.0, 1.0)
    rows = [(size, 100.0, (0, 0, 0.25)), *((post, 0.0, (side * (1.0 - ledge), 0, -0.5))
                                           for side in (-1, 1))]
    world = World(*rows, find_pairs=True)
    stands = inspect_plan(Plan(world.size, world.poses, masses=world.mass, ground=[1, 2])).stands
    world.run(1.0, dt)
    assert (abs(world.poses[0, 2] - 0.25) < 1e-3) == stands[0]


@pytest.mark.parametrize('dt', [0.001, FRAME])
@pytest.mark.parametrize('thick', [1e-4, 3e-4])
def test_thin_plates_beside_each_other_push_each_other(dt: float, thick: float) -> None:
    """The lip is a tenth of them at most: else plates of .1 mm pass through each other."""
    world = World(FLOOR, *(((0.2, 0.2, thick), 0.1, (0.2 * k, 0, 0.5 * thick)) for k in range(2)),
                  find_pairs=True).run(0.2, dt)
    world.outside[1, 0] = 1.5 * 0.5 * 0.2 * GRAVITY
    world.run(0.5, dt)
    assert world.poses[2, 0] > 0.4
    assert world.poses[2, 0] - world.poses[1, 0] == pytest.approx(0.2, abs=1e-4)


def test_feet_in_a_groove_stay_in_it() -> None:
    """A table whose feet stand 2 mm deep between two bars is pushed across the groove."""
    forces = PatchForces([Body.of_box((1, 1, 0.5), 50.0), Body.of_box((1, 1, 1), 0.0)])
    feet = [(x, y, -0.3, 0, 0, 0, 1) for x in (-0.4, 0.4) for y in (-0.4, 0.4)]
    bars = [(side * 0.6, 0, 0.201 - 0.2, 0, 0, 0, 1) for side in (-1, 1)]
    forces.set_boxes([(1, 1, 0.5), *[(0.1, 0.1, 0.1)] * 4, (4, 4, 0.4), *[(0.3, 4, 0.402)] * 2],
                     body=[0] * 5 + [1] * 3, find_pairs=True,
                     poses=[(0, 0, 0, 0, 0, 0, 1), *feet, (0, 0, 0, 0, 0, 0, 1), *bars])
    poses = np.array([(0, 0, 0.55, 0, 0, 0, 1), (0, 0, 0, 0, 0, 0, 1.0)])
    velocities, outside = np.zeros((2, 6)), np.zeros((2, 6))
    outside[0] = 0.7 * 50.0 * GRAVITY, 0, -50.0 * GRAVITY, 0, 0, 0
    for _ in range(60):
        poses, velocities, *_ = forces.advance(FRAME, poses, velocities, outside)
    assert poses[0, 0] < 0.01


def random_stack(seed: int, kind: str, off: float, dt: float) -> tuple[np.ndarray, float]:
    """Return how far a load on the first of two flush columns goes [m], and how it turns [rad]."""
    rng = np.random.default_rng(seed)
    tiers, fixed = int(rng.integers(1, 4)), seed % 2 == 0 or kind == 'brakes'
    size, mass = rng.uniform((0.3, 0.3, 0.1), (1.2, 0.8, 0.5)), rng.uniform(5, 200, 2)
    load = size * rng.uniform((0.5, 0.6, 0.5), (1.0, 1.4, 1.5))
    if kind == 'tips':
        load[2] = 2.5 * load[0]
    columns = [(size, 0.0 if fixed else mass[0], (size[0] * column, 0, size[2] * (tier + 0.5)))
               for column in range(2) for tier in range(tiers)]
    start = np.array((0.5 * (size[0] - load[0]) + off, 0, size[2] * tiers + 0.5 * load[2]))
    world = World(FLOOR, *columns, (load, mass[1], start), find_pairs=True, friction=FRICTION)
    world.run(0.5, dt)
    if kind == 'turns':
        world.velocities[-1] = 0.8, 0, 0, 0, 0, 3.0
    for step in range(round((0.5 if kind == 'tips' else 0.8) / dt)):
        if kind == 'slides':
            world.outside[-1, 0] = 1.3 * FRICTION * mass[1] * GRAVITY
        elif kind == 'brakes':
            world.velocities[:-1, 0] = -1.3 * FRICTION * GRAVITY * (step + 1) * dt
        elif kind == 'tips':
            push = 0.35 * mass[1] * GRAVITY
            world.outside[-1, (0, 4)] = push, 0.5 * push * load[2]
        world.step(dt)
    way = world.poses[-1, :3] - start - (world.poses[0, :3] - FLOOR[2])
    turn = 2.0 * np.arccos(min(1.0, abs(world.poses[-1, 6])))
    return way, float(turn)


@pytest.mark.parametrize('kind, share', [('slides', 0.003), ('brakes', 0.001), ('turns', 0.08),
                                         ('tips', 0.03)])
def test_random_stacks_go_flush_as_off_flush(kind: str, share: float) -> None:
    """A load on columns of one to three boxes, at their rim beside the other column, at 1/60 s.

    Off flush a sliver rests on the other column, and two supports share friction by chance.
    """
    for seed in range(50):
        (flush, flush_turn), (off, off_turn) = map(
            partial(random_stack, seed, kind, dt=FRAME), (0.0, OFF))
        assert flush == pytest.approx(off, abs=1e-4 + share * np.linalg.norm(off)), seed
        assert flush_turn == pytest.approx(off_turn, abs=share + 1e-6), seed

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pairs that the forces find themselves: no bit differs from all pairs held."""
from __future__ import annotations

from copy import deepcopy

import numpy as np
import pytest
from forces.test_sleep import asleep, give_speed, heap, move, push
from helpers.worlds import CONTAINER, FIXED, FLOOR, World

from box_contact_ros import Body, ContactSolver, PatchForces
from box_contact_ros.forces.patch_forces import GRAVITY

DT = 1 / 60  # [s]


def assert_same(found: World, held: World) -> None:
    for one, other in ((found.poses, held.poses), (found.velocities, held.velocities),
                       (found.awake, held.awake), *zip(found.forces.loads(), held.forces.loads())):
        assert one.tobytes() == other.tobytes()


def disturb(world: World, rng: np.random.Generator) -> None:
    """Kick a body, push it, or put it elsewhere; the floor begins to move, or stops."""
    body, kind = int(rng.integers(1, len(world.mass))), int(rng.integers(4))
    if kind == 0:
        give_speed(world, body, *rng.normal(0, 1.0, 6))
    elif kind == 1:
        push(world, body, *rng.normal(0, 0.3 * GRAVITY * world.mass[body], 3), 0, 0, 0)
    elif kind == 2:
        move(world, body, *rng.normal(0, 0.3, 3))
    else:
        give_speed(world, 0, *rng.normal(0, 0.1, 2), 0, 0, 0, rng.normal(0, 0.1))


def refuse(world: World) -> None:
    """Give poses and wrenches of which the forces refuse one, as late as they can."""
    poses, wrenches = world.poses.copy(), world.outside.copy()
    poses[:, 0] += 5.0
    wrenches[1, 3:] = 1e100
    with pytest.raises(ValueError, match='float64'):
        world.forces.advance(DT, poses, world.velocities, wrenches)


@pytest.mark.parametrize('seed', range(12))
def test_random_histories_have_the_bits_of_all_pairs_held(seed: int) -> None:
    """Heaps fall, rest, and are disturbed for a while, in uneven steps."""
    rng = np.random.default_rng(seed)
    rows, rested = heap(rng, 8), 0
    found, held = World(*rows, find_pairs=True, threads=2), World(*rows)
    weights = held.outside.copy()
    for k in range(800):
        if k % 160 == 140:
            state = rng.bit_generator.state
            for world in (found, held):
                rng.bit_generator.state = state
                disturb(world, rng)
                refuse(world)
        elif k % 160 == 0:
            for world in (found, held):
                world.outside[:] = weights
                give_speed(world, 0, 0, 0, 0, 0, 0, 0)
        dt = rng.choice([1 / 120, DT, 1 / 30]) * rng.uniform(0.5, 1.0)
        assert_same(found.step(dt), held.step(dt))
        rested += len(asleep(found))
    assert rested > 500


def test_what_rests_is_met_as_far_off_as_steps_get_longer() -> None:
    """A thin plate rises below another one, which fell asleep in steps of a tenth."""
    def make(**options: bool) -> World:
        post, plate = (0.2, 0.2, 1.0), (2.0, 0.5, 0.02)
        world = World((post, 0.0, (0, 0, 0.5)), (plate, 5.0, (0, 0, 1.01)),
                      ((0.5, 0.5, 0.02), 0.0, (0.8, 0, 0.85)), **options).run(2.0, 0.01)
        assert asleep(world) == [1]
        give_speed(world, 2, 0, 0, 0.05, 0, 0, 0)
        return world
    found, held = make(find_pairs=True), make()
    assert_same(found.step(0.1), held.step(0.1))
    assert found.awake[1] and found.poses[2, 2] < 0.9


class Yard:
    """Containers on a ground and a lorry, which the caller tells nothing but boxes and poses."""

    def __init__(self) -> None:
        self.sizes = [(100, 100, 1), (13, 2.5, 1.5), CONTAINER, CONTAINER, (12.192, 2.438, 0.4)]
        self.masses = np.array([0, 0, 20e3, 10e3, 5e3])
        self.bodies = [Body.of_box(size, mass) for size, mass in zip(self.sizes, self.masses)]
        self.poses = np.zeros((5, 7))
        self.poses[:, 6] = 1
        self.poses[:, :3] = ((0, 0, -0.5), (0, 0, 0.75), (0, 0, 2.8), (0, 10, 1.2955),
                             (0, 10, 2.8))
        self.velocities, self.lift = np.zeros((5, 6)), 0.0
        self.forces = PatchForces(self.bodies)
        self.forces.set_boxes(self.sizes, find_pairs=True)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / DT)):
            outside = np.zeros((len(self.masses), 6))
            outside[:, 2] = -GRAVITY * self.masses
            outside[3, 2] += self.lift
            self.poses, self.velocities, _, self.awake = self.forces.advance(
                DT, self.poses, self.velocities, outside)

    def loads(self) -> dict[tuple[int, int], int]:
        loads = self.forces.loads()
        return {tuple(pair): round(load / GRAVITY / 100) for pair, load in zip(
            loads.pairs.tolist(), loads.pressing) if load > 1.0}


def test_a_yard_needs_nothing_held() -> None:
    """A box lands on a lorry, which drives off; a spreader grips one, carries it, and lets go."""
    yard = Yard()
    yard.run(3.0)
    assert yard.loads() == {(0, 3): 150, (1, 2): 200, (3, 4): 50}
    assert not yard.awake.any()
    for speed in np.r_[np.linspace(0, 2, 60), np.full(60, 2.0)]:
        yard.velocities[1, 0] = speed
        yard.run(DT)
    yard.velocities[1] = 0
    yard.run(1.5)
    assert yard.poses[2, 0] == pytest.approx(yard.poses[1, 0], abs=0.5)  # it slid
    assert yard.loads() == {(0, 3): 150, (1, 2): 200, (3, 4): 50}
    # Twist locks close: the spreader and its load are one body, number 3.
    joined = Body.of_boxes([CONTAINER, yard.sizes[4]],
                           [yard.poses[3], yard.poses[4]], [10e3, 5e3])
    yard.forces.set_boxes(yard.sizes, body=[0, 1, 2, 3, 3], find_pairs=True, poses=[
        *[(0, 0, 0, 0, 0, 0, 1)] * 3, *joined.poses])
    yard.bodies[3:] = [joined.body]
    yard.forces.set_bodies(yard.bodies)
    assert (joined.turn == (0, 0, 0, 1)).all()
    yard.poses, yard.velocities = yard.poses[:4].copy(), yard.velocities[:4].copy()
    yard.poses[3] = (0, 0, 0, 0, 0, 0, 1)
    yard.masses = np.array([0, 0, 20e3, 15e3])
    yard.run(1.0)
    assert yard.loads() == {(0, 3): 150, (1, 2): 200}
    yard.lift = 1.05 * 15e3 * GRAVITY
    yard.run(2.0)
    assert yard.loads() == {(1, 2): 200}
    assert yard.poses[3, 2] == pytest.approx(0.5 * 0.05 * GRAVITY * 2.0**2, rel=0.02)


def test_a_box_that_is_put_into_what_rests_pushes_it_aside() -> None:
    """Of a fixed body, or of one at rest: no patch of before knows it."""
    for body in (0, 2):
        world = World(FLOOR, ((0.5, 0.5, 0.5), 5.0, (0, 0, 0.25)),
                      ((0.5, 0.5, 0.5), 5.0, (1, 0, 0.25)), find_pairs=True).run(2.0, DT)
        assert asleep(world) == [1, 2]
        place = np.array((0.49, 0, 0.25)) - world.poses[body, :3]
        poses = [*[(0, 0, 0, 0, 0, 0, 1)] * 3, (*place, 0, 0, 0, 1)]
        world.forces.set_boxes([*world.size, (0.5, 0.5, 0.4)], body=[0, 1, 2, body], poses=poses,
                               find_pairs=True)
        world.run(1.0, DT)
        assert np.abs(world.poses[1, :3] - world.poses[body, :3]).max() > 0
        gap = world.poses[body, 0] + place[0] - world.poses[1, 0]
        assert gap == pytest.approx(0.5, abs=1e-3)


def test_boxes_of_one_body_are_no_pair() -> None:
    forces = PatchForces([Body.of_box((1, 1, 1), 5.0), FIXED])
    forces.set_boxes([(1, 1, 1), (1, 1, 1), (9, 9, 1)], body=[0, 0, 1], find_pairs=True,
                     poses=[(0, 0, 0, 0, 0, 0, 1), (0.5, 0, 0, 0, 0, 0, 1), (0, 0, 0, 0, 0, 0, 1)])
    poses = np.array([(0, 0, 5, 0, 0, 0, 1), (0, 0, 0, 0, 0, 0, 1.0)])
    forces.advance(DT, poses, np.zeros((2, 6)))
    assert len(forces.loads().pairs) == 0


def test_what_finds_its_pairs_holds_none_until_it_is_told_otherwise() -> None:
    world = World(FLOOR, ((0.5, 0.5, 0.5), 5.0, (0, 0, 0.25)), find_pairs=True).run(1.0, DT)
    contacts = ContactSolver().batch(world.poses, sizes=world.size, pairs=[(0, 1)])
    for answer in ((), (contacts, world.poses)):
        with pytest.raises(ValueError, match='^hold: the forces find their pairs themselves'):
            world.forces.hold([(0, 1)], *answer)
    twin = deepcopy(world)
    world.forces.set_boxes(world.size)
    world.forces.hold([(0, 1)])
    assert world.run(0.5, DT).poses.tobytes() == twin.run(0.5, DT).poses.tobytes()
    world.forces.set_boxes(world.size, find_pairs=True)
    assert world.step(DT).awake[1]
    assert asleep(world.run(1.0, DT)) == [1]

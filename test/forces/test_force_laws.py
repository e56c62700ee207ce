# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The forces of patches against closed forms, and laws that any such forces keep."""
from __future__ import annotations

import copy
import math
from dataclasses import replace

import numpy as np
import pytest
import worlds
from poses import multiply
from worlds import FIXED, STEP

from box_contact_ros import Body, Contacts, ContactSolver, PatchForces
from box_contact_ros.forces import patch_forces as forces
from box_contact_ros.forces.patch_forces import GRAVITY
from box_contact_ros.solver import contact_solver
from box_contact_ros.solver.pose import rotation_matrix

CUBE, GROUND = (1.0, 1.0, 1.0), (20.0, 20.0, 1.0)
MASS = 100.0
WEIGHT = MASS * GRAVITY
SOLVER = ContactSolver(CUBE, CUBE, model='exact')


def pose(x: float = 0.0, y: float = 0.0, z: float = 0.0, turn=(0.0, 0.0, 0.0, 1.0)) -> np.ndarray:
    return np.array([x, y, z, *turn])


class World(worlds.World):
    """Boxes by contacts that are held; box 0 is the ground, its top at z = 0."""

    def __init__(self, *places: np.ndarray, size=CUBE, mass=MASS, gravity=(0.0, 0.0, -GRAVITY),
                 **options) -> None:
        super().__init__((GROUND, 0.0, (0.0, 0.0, -0.5)), *(
            (size, mass, place[:3], place[3:]) for place in places), pairs=(), **options)
        n = len(self.mass)
        self.pairs = np.array([(a, b) for b in range(n) for a in range(b)])
        self.outside[1:, :3] = mass * np.array(gravity)

    def contacts(self) -> Contacts:
        return SOLVER.batch(self.poses, sizes=self.size, pairs=self.pairs)

    def hold(self, **rows) -> None:
        self.forces.hold(self.pairs, self.contacts(), self.poses, **rows)

    def next_wrenches(self) -> np.ndarray:
        """Return the wrenches of the next step, by a copy that takes it."""
        return copy.copy(self.forces).advance(
            STEP, self.poses, self.velocities, self.outside).wrenches

    def run(self, steps: int, **rows) -> World:
        for _ in range(steps):
            self.hold(**rows)
            self.step()
        return self


def energy(world: World) -> float:
    """Return the kinetic and potential energy of the free bodies [J]."""
    return float(world.energies().sum() + WEIGHT * world.poses[1:, 2].sum())


# --- at rest --------------------------------------------------------------------------------------


def test_a_box_at_rest_is_carried() -> None:
    """The wrench is the weight; the ground takes nothing, as no force moves it."""
    world = World(pose(z=0.5)).run(300)
    wrenches = world.next_wrenches()
    assert wrenches[1] == pytest.approx([0, 0, WEIGHT, 0, 0, 0], abs=1e-6 * WEIGHT)
    assert not wrenches[0].any()
    assert np.abs(world.velocities).max() < 1e-9


def test_the_lowest_of_a_tower_carries_all() -> None:
    world = World(*(pose(z=k + 0.5) for k in range(5))).run(500)
    assert np.abs(world.velocities).max() < 1e-6
    # What the ground gives to the lowest, and the second takes from it, is the weight of it.
    assert world.next_wrenches()[1:, 2] == pytest.approx(np.full(5, WEIGHT), rel=1e-4)


@pytest.mark.parametrize('ratio', [100, 1000])
def test_a_heavy_body_rests_on_a_light_one(ratio: int) -> None:
    """As deep as the spring says, although pushing out has a limit of speed, which 1,000 exceed."""
    depths = []
    for masses in ([MASS], [MASS, ratio * MASS]):
        world = World(*(pose(z=k + 0.5) for k in range(len(masses))))
        world.bodies = [FIXED, *(Body.of_box(CUBE, mass) for mass in masses)]
        world.forces = PatchForces(world.bodies)
        world.outside[1:, 2] = -GRAVITY * np.array(masses)
        for _ in range(900):
            world.hold()
            world.step(1 / 60)
        assert np.abs(world.velocities).max() < 1e-6
        depths.append(0.5 - world.poses[1, 2])
    assert depths[1] == pytest.approx((1 + ratio) * depths[0], rel=0.05)


# --- friction -------------------------------------------------------------------------------------


def on_a_slope(degrees: float) -> World:
    """Return a cube on level ground under a gravity that leans by an angle, after a second."""
    angle = math.radians(degrees)
    lean = (GRAVITY * math.sin(angle), 0.0, -GRAVITY * math.cos(angle))
    return World(pose(z=0.25), size=(1.0, 1.0, 0.5), gravity=lean).run(1000)


@pytest.mark.parametrize('degrees', [0.0, 10.0, 37.0, 45.0])
def test_a_square_patch_has_the_sides_of_its_box(degrees: float) -> None:
    """A plate whose centre is 25 mm outside of a patch of 0.4 x 0.4 m tips in any direction."""
    half = math.radians(degrees) / 2.0
    turn = (0.0, 0.0, math.sin(half), math.cos(half))
    aside = 0.45 * math.cos(2.0 * half), 0.45 * math.sin(2.0 * half)
    world = World(pose(turn=turn), pose(*aside, 0.1, turn), size=(0.85, 0.4, 0.1))
    world.bodies = [FIXED, FIXED, Body.of_box((0.85, 0.4, 0.1), MASS)]
    world.forces = PatchForces(world.bodies)
    world.pairs = np.array([(1, 2)])
    world.outside[1] = 0.0
    world.run(2000)
    assert world.poses[2, 2] < 0.0


def test_coulombs_limit_on_a_slope() -> None:
    """μ = 0.5 holds up to 26.57°; beyond it the acceleration is g·(sin θ − μ·cos θ)."""
    still = on_a_slope(26.5)
    assert np.abs(still.velocities).max() < 1e-6
    assert abs(still.poses[1, 0]) < 1e-4
    for degrees in (26.7, 35.0):
        angle = math.radians(degrees)
        expected = GRAVITY * (math.sin(angle) - 0.5 * math.cos(angle))
        assert on_a_slope(degrees).velocities[1, 0] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize('share', [0.98, 1.02])
def test_the_torsion_limit_of_a_square(share: float) -> None:
    """A square of edge a resists a spin up to μ·m·g·0.3826·a, times the share of real overlaps."""
    world = World(pose(z=0.5)).run(100)
    limit = 0.5 * WEIGHT * 0.3826 * 0.966
    world.outside[1, 5] = share * limit
    world.run(500)
    expected = max(0.0, share - 1.0) * limit * 0.5 / (MASS / 6.0)
    assert world.velocities[1, 5] == pytest.approx(expected, abs=0.003)
    assert (world.velocities[1, 5] > 1e-3) == (share > 1.0)


def test_a_belt_carries() -> None:
    """The ground's surface runs at 0.35 m/s: acceleration μ·g, then the belt's speed exactly."""
    world = World(pose(z=0.25), size=(1.0, 1.0, 0.5)).run(50)
    belt = np.array([[-0.35, 0.0, 0.0]])  # of B, the box, relative to A
    world.run(40, surface_velocity=belt)
    assert world.velocities[1, 0] == pytest.approx(0.5 * GRAVITY * 0.04, rel=1e-6)
    world.run(300, surface_velocity=belt)
    assert world.velocities[1, 0] == pytest.approx(0.35, rel=1e-9)


def test_friction_of_a_pair() -> None:
    world = World(pose(z=0.25), size=(1.0, 1.0, 0.5)).run(50)
    world.velocities[1, 0] = 1.0
    world.run(100, friction=np.array([0.2]))
    assert world.velocities[1, 0] == pytest.approx(1.0 - 0.2 * GRAVITY * 0.1, rel=1e-4)


# --- steps ----------------------------------------------------------------------------------------


def ten_cubes() -> World:
    world = World(*(pose(z=k + 0.5) for k in range(10)))
    world.pairs = np.array([(k, k + 1) for k in range(10)])
    return world


def test_remainders_of_a_frame_do_no_harm() -> None:
    """A frame of 10 ms in steps of 5 ms at most leaves 6.9e-18 s, for 10 s: the tower stands."""
    world, t, shortest = ten_cubes(), 0.0, 1.0
    for frame in range(1, 1001):
        while t < 0.01 * frame:
            dt = min(0.005, 0.01 * frame - t)
            world.hold()
            world.step(dt)
            t += dt
            shortest = min(shortest, dt)
    assert 0.0 < shortest < 1e-17
    assert world.poses[-1, 2] + 0.5 == pytest.approx(9.99938, abs=1e-5)
    assert np.abs(world.velocities).max() < 1e-9


@pytest.mark.parametrize('late, limit', [(0.0, 0.1), (0.02, 1.0)])
def test_the_speed_of_pushing_out_has_a_limit(late: float, limit: float) -> None:
    """Of a cube 0.2 m deep; late answers bear nothing as hard as the lower limit makes a patch."""
    world = World(pose(z=0.3))
    world.hold(age=late)
    world.step(0.005)
    assert 0.5 * limit * 0.005 < world.poses[1, 2] - 0.3 < limit * 0.005


@pytest.mark.parametrize('overlap, fall', [(0.002, 0.0), (0.01, 0.0), (0.0, 0.1), (0.0, 0.5)])
def test_what_is_pushed_out_does_not_jump(overlap: float, fall: float) -> None:
    """Eight cubes put into each other, or dropped as a stack: their top rises by 2 cm at most."""
    world = World(*(pose(z=k + 0.5 + fall - overlap * (k + 1)) for k in range(8)))
    world.pairs = np.array([(k, k + 1) for k in range(8)])
    highest = 0.0
    for step in range(1500):
        world.hold()
        world.step()
        if step * STEP > math.sqrt(2.0 * fall / GRAVITY):  # it has landed
            highest = max(highest, world.poses[-1, 2])
    assert 7.48 < world.poses[-1, 2] and highest < 7.52


@pytest.mark.parametrize('steps', [
    (0.003,) * 5 + (0.1 / 60,), (0.003, 0.002, 1e-18),
    tuple(1 / 240 * np.random.default_rng(5).normal(1.0, 0.05, 240).clip(0.85, 1.15))])
def test_steps_of_other_lengths_leave_a_tower_at_rest(steps: tuple[float, ...]) -> None:
    """A frame of 1/60 s in steps of 3 ms at most, two kinds of shorter ones, measured ones."""
    world = ten_cubes()
    for dt in steps * round(6.0 / sum(steps)):
        world.hold()
        world.step(dt)
    assert np.abs(world.velocities).max() < 1e-9


@pytest.mark.parametrize('at', [1, 5, 100])
@pytest.mark.parametrize('tiny', [(1e-9,), (1e-9, 1e-6, 1e-12), (5e-5,)])
def test_a_tiny_step_among_others_does_no_harm(tiny: tuple[float, ...], at: int) -> None:
    """From then on the tower is faster by a tenth at most, and a tenth of what a step falls."""
    fastest = []
    for steps in ([0.005] * 200, [0.005] * at + [*tiny] + [0.005] * (200 - at)):
        world, speeds = ten_cubes(), []
        for dt in steps:
            world.hold()
            world.step(dt)
            speeds.append(np.abs(world.velocities).max())
        assert speeds[-1] < 1e-4
        fastest.append(max(speeds[at:]))
    assert fastest[1] < 1.1 * fastest[0] + 0.1 * GRAVITY * 0.005


@pytest.mark.parametrize('long', [0.1, 0.5])
def test_a_long_step_among_others_does_no_harm(long: float) -> None:
    """The tower sinks by a centimetre, and is at rest again after a second."""
    world = ten_cubes()
    for dt in [0.005] * 100 + [long] + [0.005] * 300:
        world.hold()
        world.step(dt)
        assert 9.49 < world.poses[-1, 2] < 9.5005
    assert np.abs(world.velocities).max() < 1e-6


@pytest.mark.parametrize('size', [(50.0, 1.0, 1.0), (3.0, 2.0, 1.0)])
@pytest.mark.parametrize('step', [0.001, 0.02])
def test_a_free_body_keeps_its_energy(size: tuple[float, ...], step: float) -> None:
    """A bar about its length, and a brick about its unstable axis, at 10, 30 and 100 rad/s.

    Its angular momentum keeps its length too, where a step turns it little. An explicit step gains
    energy without bound, an implicit one of Euler's loses it.
    """
    world = World(*[pose()] * 3, size=size, gravity=(0, 0, 0))
    about = (1.0, 0.03, 0.01) if size[0] > 3.0 else (0.01, 1.0, 0.03)
    world.velocities[1:, 3:] = np.outer([10.0, 30.0, 100.0], about)

    def kept() -> tuple[np.ndarray, np.ndarray]:
        return world.energies()[1:], np.linalg.norm(world.spins()[1:], axis=1)

    energies, momenta = kept()
    for _ in range(round(10.0 / step)):
        world.step(step)
    after = kept()
    assert after[0] == pytest.approx(energies, rel=0.02)
    if step == STEP:
        assert after[1] == pytest.approx(momenta, rel=0.02)
    assert np.abs(world.next_wrenches()).max() < 1e-9 * energies.max()  # nothing touches


# --- laws -----------------------------------------------------------------------------------------


def two_free(**options: int) -> World:
    """Return two cubes that meet askew in free fall, without the ground."""
    world = World(pose(), pose(0.2, 0.1, 0.98, (0.02, 0.05, 0.3, 1.0)), gravity=(0, 0, 0),
                  **options)
    world.pairs = np.array([(1, 2)])
    world.velocities[2] = 0.3, -0.2, -1.0, 0.5, 0.2, 1.0
    return world


def test_energy_is_not_gained() -> None:
    """A cube dropped on an edge, a corner and a face does not rise again, nor gains energy."""
    for turn in ((0, 0, 0, 1), (0.3, 0, 0, 1), (0.3, 0.2, 0.1, 1)):
        turn = np.array(turn) / np.linalg.norm(turn)
        world = World(pose(turn=turn))
        low = (np.abs(rotation_matrix(turn)[2]) * 0.5).sum()
        world.poses[1, 2] = low + 0.05
        least = energy(world)
        for _ in range(800):
            world.hold()
            world.step()
            # Pushing out lifts a body by a part of its depth.
            assert energy(world) <= least + 0.01 * WEIGHT * 0.05
            least = min(least, energy(world))


def test_wrenches_lead_to_the_poses() -> None:
    """Impulse divided by the step: a foreign integrator gets the same motion."""
    world = two_free(substeps=1)
    world.hold()
    motion = world.forces.advance(STEP, world.poses, world.velocities, world.outside)
    assert np.abs(motion.wrenches).max() > 1.0
    # A cube's inertia is the same about all axes, and there is no gyroscopic torque.
    pushed = world.velocities[1:] + STEP * motion.wrenches[1:] / np.repeat((MASS, MASS / 6.0), 3)
    moved = (motion.poses - world.poses)[1:, :3]
    turned = rotation_matrix(motion.poses[1:, 3:]) @ rotation_matrix(
        world.poses[1:, 3:]).transpose(0, 2, 1)
    turn = 0.5 * (turned - turned.transpose(0, 2, 1))[:, (2, 0, 1), (1, 2, 0)]
    assert moved == pytest.approx(STEP * pushed[:, :3], rel=1e-9)
    assert turn == pytest.approx(STEP * pushed[:, 3:], rel=1e-4)


def test_swapping_a_and_b_changes_nothing() -> None:
    one, two = two_free(), two_free()
    one.hold()
    two.pairs = np.array([(2, 1)])
    two.hold()
    for world in (one, two):
        world.step()
    assert one.velocities == pytest.approx(two.velocities, abs=1e-12)


def test_the_order_of_pairs_changes_no_bit() -> None:
    one = World(*(pose(0.1 * k, z=k + 0.499) for k in range(4)))
    two = World(*(pose(0.1 * k, z=k + 0.499) for k in range(4)))
    two.pairs = one.pairs[::-1].copy()
    for world in (one, two):
        world.run(20)
    assert one.velocities.tobytes() == two.velocities.tobytes()


def move(world: World) -> None:
    """Move the boxes of a world by their velocities."""
    world.poses = world.poses.copy()
    world.poses[:, :3] += STEP * world.velocities[:, :3]
    turns = np.hstack([0.5 * STEP * world.velocities[:, 3:], np.ones((len(world.poses), 1))])
    turned = multiply(turns, world.poses[:, 3:])
    world.poses[:, 3:] = turned / np.linalg.norm(turned, axis=1, keepdims=True)


# --- bodies and answers ---------------------------------------------------------------------------


def pair_of_stacks() -> World:
    return World(pose(z=0.5), pose(z=1.5), pose(x=5.0, z=0.5), pose(x=5.0, z=1.5)).run(300)


def test_one_body_is_forgotten_without_the_others() -> None:
    """The neighbours keep their impulses, so nothing but the body's own patches starts anew."""
    world, same = pair_of_stacks(), pair_of_stacks()
    world.forces.forget([4])
    for each in (world, same):
        each.pairs = each.pairs[(each.pairs != 4).all(axis=1)]
        each.hold()
    for each in (world, same):
        each.step()
    after, expected = world.velocities, same.velocities
    assert after[1:3].tobytes() == expected[1:3].tobytes()
    assert after[4, 2] == pytest.approx(-GRAVITY * STEP, rel=1e-3)


def test_bodies_enter_leave_and_change_mass() -> None:
    world = World(pose(z=0.5), pose(z=1.5)).run(300)
    heavy = Body.of_box(CUBE, 3.0 * MASS)
    world.forces.set_bodies([FIXED, world.bodies[1], heavy])
    world.outside[2, 2] *= 3.0
    world.run(300)
    assert world.next_wrenches()[2, 2] == pytest.approx(3.0 * WEIGHT, rel=1e-6)
    world.forces.set_bodies([FIXED, world.bodies[1]])
    found = world.forces.advance(
        STEP, world.poses[:2], world.velocities[:2], world.outside[:2]).wrenches
    assert found.shape == (2, 6) and found[1, 2] > 0.0


def test_what_is_let_go_gets_no_push() -> None:
    """A crane speeds a load up by its velocity, then gives it mass: no contact, no wrench."""
    forces, at, outside = PatchForces([FIXED]), pose()[None], np.zeros((1, 6))
    for speed in (0.0, 0.1, 0.2):
        forces.wrenches(STEP, at, [[speed, 0, 0, 0, 0, 0]], outside)
    forces.set_bodies([Body.of_box(CUBE, MASS)])
    assert not forces.wrenches(STEP, at, [[0.2, 0, 0, 0, 0, 0]], outside).any()


def test_a_kinematic_body_carries_along() -> None:
    """A lift that rises at 0.5 m/s pushes, and is not pushed."""
    world = World(pose(z=0.5)).run(50)
    for _ in range(300):
        world.velocities[0, 2] = 0.5
        world.run(1)
    assert world.velocities[:, 2] == pytest.approx([0.5, 0.5], abs=1e-6)


@pytest.mark.parametrize('step', [0.001, 1 / 60])
def test_a_turntable_carries_along(step: float) -> None:
    """At half of what friction holds, 3 m from the axis, for 10 s: the cube stays where it is.

    It ends with the table's speed in the middle of the last of four sub-steps.
    """
    world = World(pose(3.0, z=0.5))
    full = math.sqrt(0.25 * GRAVITY / 3.0)
    for _ in range(round(10.0 / step)):
        before = world.velocities[0, 5]
        world.velocities[0, 5] = min(full, before + 1e-3)
        world.hold()
        world.step(step)
    at_end = world.velocities[0, 5] + 0.375 * (world.velocities[0, 5] - before)
    assert world.velocities[1, 5] == pytest.approx(at_end, rel=1e-6)
    assert np.hypot(*world.poses[1, :2]) == pytest.approx(3.0, abs=1e-3)


def test_a_stale_pair_keeps_its_patch() -> None:
    world = World(pose(z=0.5)).run(100)
    stale = replace(world.contacts(), separation=np.array([math.nan]))
    world.forces.hold(world.pairs, stale, world.poses)
    assert world.next_wrenches()[1, 2] == pytest.approx(WEIGHT, rel=1e-3)
    world.forces.hold(world.pairs[:0], stale[:0], world.poses)
    assert np.abs(world.next_wrenches()).max() < 1e-6 * WEIGHT


@pytest.mark.parametrize('steps', [2, 60])
def test_an_overdue_answer_pushes_nothing_out(steps: int) -> None:
    """Of a cube 20 mm deep: with answers at 200 Hz, pushing ends three periods after the last."""
    world = World(pose(z=0.48), gravity=(0, 0, 0))

    def push() -> float:
        world.step()
        way = world.poses[1, 2] - 0.48
        world.poses[1, 2], world.velocities[1] = 0.48, 0.0
        return way

    for _ in range(3):
        world.hold()
        for _ in range(5):
            push()
    for _ in range(steps):
        push()
    assert (push() > 1e-3 * STEP) == (steps == 2)


def test_a_late_answer_does_not_throw() -> None:
    """Answers at 50 Hz, 5 ms late, then none for half a second: the load rests all the time."""
    world = World(pose(z=0.51, turn=(0.005, 0.01, 0.0, 1.0)))
    for tick in range(2500):
        if tick % 20 == 0 and tick < 2000:
            asked = world.contacts(), world.poses.copy()
        if tick % 20 == 5 and tick < 2000:
            world.forces.hold(world.pairs, *asked, age=0.005)
        world.step()
        if tick >= 1500:
            assert np.abs(world.velocities).max() < 1e-4
    assert abs(world.poses[1, 2] - 0.5) < 2e-3


@pytest.mark.parametrize('foreign', [False, True])
def test_late_answers_level_a_load(foreign: bool) -> None:
    """Contacts at 50 Hz, 5 ms late, lay a tilted cube flat in 1.5 s, g·T²/6.25 deep, T = 15 ms."""
    world = World(pose(z=0.55, turn=(0.01, 0.02, 0.0, 1.0)), rest=False)
    for tick in range(1500):
        if tick % 20 == 0:
            asked = world.contacts(), world.poses.copy()
        if tick % 20 == 5:
            world.forces.hold(world.pairs, *asked, age=0.005, period=0.02)
        if not foreign:
            world.step()
            continue
        wrenches = world.outside + world.forces.wrenches(
            STEP, world.poses, world.velocities, world.outside)
        world.velocities = world.velocities + STEP / MASS * wrenches * [1, 1, 1, 6, 6, 6]
        move(world)
    up = rotation_matrix(world.poses[1:, 3:])[0, :, 2]
    assert np.hypot(up[0], up[1]) < 1e-9
    assert 0.5 - world.poses[1, 2] == pytest.approx(GRAVITY * 0.015**2 / 6.25, rel=1e-3)


# --- state ----------------------------------------------------------------------------------------


def test_copies_continue_bit_by_bit() -> None:
    """In the middle of a fall."""
    world = World(pose(z=0.52, turn=(0.1, 0.2, 0.0, 1.0)), pose(0.1, z=1.7)).run(150)
    kept = world.forces
    twins = [copy.copy(kept), copy.deepcopy(kept), kept]
    contacts, found = world.contacts(), []
    for twin in twins:
        velocities = world.velocities
        for _ in range(3):
            twin.hold(world.pairs, contacts, world.poses)
            velocities = twin.advance(STEP, world.poses, velocities, world.outside).velocities
        found.append(velocities.tobytes())
    assert len(set(found)) == 1


def test_reset_forgets_all() -> None:
    world = World(pose(z=0.5)).run(50)
    world.forces.reset()
    assert np.abs(world.next_wrenches()).max() < 1e-9


@pytest.mark.parametrize('layout', [
    np.asfortranarray, lambda pairs: pairs.astype(np.int32), np.ndarray.tolist],
    ids=['as of argwhere', 'int32', 'list'])
def test_of_pairs_in_another_layout_nothing_else_is_converted(layout, monkeypatch) -> None:
    world = World(pose(z=0.5), pose(z=1.5))
    plain, world.pairs = world.contacts(), layout(world.pairs)
    for module in (forces, contact_solver):
        monkeypatch.setattr(module, 'as_floats', None)
    assert np.array_equal(world.contacts().separation, plain.separation)
    world.hold()


# --- other frames and units -----------------------------------------------------------------------


def landed(turn=(0.0, 0.0, 0.0, 1.0), shift=(0.0, 0.0, 0.0), carrier=(0.0, 0.0, 0.0),
           factor: float = 1.0) -> np.ndarray:
    """Return where two tilted boxes are, 0.14 s after they were let go, one upon the other.

    Both have hit what is below them. Later they tumble, which magnifies rounding.

    All is moved and turned, on a carrier at a speed [m/s], and masses are multiplied; the poses
    returned are as if they were not.
    """
    world = World(pose(z=0.52, turn=(0.02, 0.01, 0.0, 1.0)),
                  pose(0.2, 0.1, 1.55, (0.0, 0.03, 0.2, 1.0)), mass=MASS * factor)
    turn = np.array(turn) / np.linalg.norm(turn)
    rotation = rotation_matrix(turn[None])[0]
    world.poses[:, 3:] = multiply(np.tile(turn, (3, 1)), world.poses[:, 3:])
    world.poses[:, :3] = world.poses[:, :3] @ rotation.T + shift
    world.velocities[:, :3] = carrier
    world.outside[:, :3] = world.outside[:, :3] @ rotation.T
    world.run(140)
    found = world.poses.copy()
    found[:, :3] = (found[:, :3] - shift - 0.14 * np.array(carrier)) @ rotation
    back = np.tile(turn * (-1, -1, -1, 1), (3, 1))
    found[:, 3:] = multiply(back, found[:, 3:])
    return found / np.hstack([np.ones((3, 6)), np.sign(found[:, 6:])])


@pytest.mark.parametrize('other', [
    {'turn': (0.3, -0.5, 0.2, 0.7)}, {'carrier': (3.0, 1.0, 0.5)}, {'factor': 1000.0}],
    ids=lambda other: next(iter(other)))
def test_the_same_motion_in_another_frame_and_unit(other) -> None:
    """Turned, on a carrier at 3 m/s, and with masses of 1,000 times as much."""
    assert landed(**other) == pytest.approx(landed(), abs=1e-9)


def test_the_same_motion_100_m_away() -> None:
    """There numbers are rounded to 1e-14 m, which the landing magnifies 100,000 times or more."""
    assert landed(shift=(100.0, -50.0, 20.0)) == pytest.approx(landed(), abs=2e-8)

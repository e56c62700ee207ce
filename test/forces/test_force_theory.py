# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Forces against theory: impacts, carriers, tipping, sliding, spinning, momentum, energy, loads."""
from __future__ import annotations

import math

import numpy as np
import pytest
from worlds import FIXED, FLOOR, STEP, World, turned

from box_contact_ros import Body, PatchForces, contacts_of
from box_contact_ros.forces.patch_forces import FRICTION, GRAVITY
from box_contact_ros.solver.pose import rotation_matrix

CUBE = (1.0, 1.0, 1.0)
FRAME = 1.0 / 60.0  # [s]

# --- impacts --------------------------------------------------------------------------------------


def meeting(heavier: float, speed: float, **options: int) -> World:
    """Return a cube of a mass [kg] that meets one of 1 kg on the floor at a speed [m/s]."""
    world = World(FLOOR, (CUBE, 1.0, (0, 0, 0.5)), (CUBE, heavier, (0, 0, 1.5 + 1e-6)), **options)
    world.velocities[2, 2] = -speed
    return world


@pytest.mark.parametrize('heavier', [1.0, 2.0, 10.0, 100.0, 1000.0, 8000.0])
def test_an_impact_does_not_bounce(heavier: float) -> None:
    """Also on a lighter body, which passes the impact on to the floor: up at 0.05 of the speed."""
    world = meeting(heavier, 0.5)
    assert max(world.step().velocities[2, 2] for _ in range(300)) <= 0.05 * 0.5


def test_a_flush_tower_is_borne_from_its_first_step() -> None:
    """Of ten cubes: what touches for the first time is solved as an impact, at 1/60 s, too."""
    world = World(FLOOR, *((CUBE, 10.0, (0, 0, k + 0.5)) for k in range(10)))
    assert 9.5 - world.step(FRAME).poses[10, 2] < 1e-3  # [m]; 1.3 mm by the iterations alone


@pytest.mark.parametrize('seed', range(4))
def test_the_sway_of_a_tower_dies_away(seed: int) -> None:
    """Six boxes that land tilted by some 0.4°, in steps of 4 ms: slower than 0.3 mm/s after 1 s."""
    rng, rows, top = np.random.default_rng(seed), [], 0.02
    for _ in range(6):
        size, tilt = rng.uniform((0.2, 0.2, 0.15), (0.6, 0.4, 0.3)), rng.normal(size=3)
        place = (*rng.uniform(-0.02, 0.02, 2), 1.02 * (top + 0.5 * size[2]))
        rows.append((size, 200.0 * size.prod(), place, turned(
            tilt / np.linalg.norm(tilt), math.radians(0.4) * np.linalg.norm(tilt))))
        top += size[2]
    world = World(FLOOR, *rows).run(1.0, 0.004)
    assert np.abs(world.velocities).max() < 3e-4


def test_what_is_forgotten_has_not_swayed() -> None:
    """A stack that sways takes more iterations; forgotten, as many as one in a new object."""
    def stack() -> World:
        return World(FLOOR, *(((0.4, 0.4, 0.3), 5.0, (0, 0, 0.152 + 0.3 * k),
                               turned((1.0, 0.0, 0.0), 0.004)) for k in range(8)))

    swaying, new = stack().run(0.9, FRAME), stack()
    assert 1e-4 < np.abs(swaying.velocities).max() < 0.1
    new.poses, new.velocities = swaying.poses, swaying.velocities
    swaying.forces.forget(range(9))
    assert np.array_equal(swaying.step(FRAME).velocities, new.step(FRAME).velocities)


@pytest.mark.parametrize('substeps', [4, 16])
def test_a_weight_that_falls_on_light_cubes_does_not_jump(substeps: int) -> None:
    """Of 8 t, by 15 m on four cubes of 1 kg: at less than 1 % of its speed."""
    cubes = [((0.5, 0.5, 0.5), 1.0, (x, y, 0.25)) for x in (-1, 1) for y in (-1, 1)]
    world = World(FLOOR, *cubes, ((3.0, 3.0, 1.0), 8000.0, (0, 0, 16.0)), substeps=substeps)
    speeds = [world.step().velocities[5, 2] for _ in range(2200)]
    assert min(speeds) < -17.0 and max(speeds) < 0.17


@pytest.mark.parametrize('substeps', [1, 4, 64])
def test_an_impact_gains_no_energy(substeps: int) -> None:
    """Of motion and height, by however many sub-steps."""
    world = meeting(100.0, 0.1, substeps=substeps)

    def energy() -> float:
        return float(world.energies().sum() + GRAVITY * world.mass @ world.poses[:, 2])

    first = energy()
    for _ in range(100):
        world.step()
        assert energy() <= first + 1e-9


@pytest.mark.parametrize('dt', [STEP, 0.004, FRAME])
@pytest.mark.parametrize('degrees', [1.0, 5.0])
def test_a_tall_box_that_comes_down_from_an_edge_stands(degrees: float, dt: float) -> None:
    """It rocks from edge to edge, and each impact takes of its energy: within 1.2 s it is still."""
    size, tilt = (0.15, 0.21, 0.38), math.radians(degrees)
    low = 0.5 * (size[0] * math.sin(tilt) + size[2] * math.cos(tilt))
    world = World(FLOOR, (size, 6.0, (0, 0, low), turned((0, 1, 0), tilt))).run(1.2, dt)
    assert np.abs(world.velocities[1]).max() < 1e-4
    assert rotation_matrix(world.poses[1, 3:])[2, 2] == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize('every, late', [(5, 0), (5, 2), (20, 5)])
@pytest.mark.parametrize('degrees', [1.0, 5.0])
def test_a_tall_box_stands_by_late_answers(degrees: float, every: int, late: int) -> None:
    """Of others, every so many steps of 1 ms and so many late: within 2 s it is still."""
    size, tilt = (0.15, 0.21, 0.38), math.radians(degrees)
    low = 0.5 * (size[0] * math.sin(tilt) + size[2] * math.cos(tilt))
    world = World(FLOOR, (size, 6.0, (0, 0, low), turned((0, 1, 0), tilt)), pairs=[])
    world.forces.set_boxes(world.size)
    for step in range(2000):
        if step % every == 0:
            asked = *contacts_of(world.size, world.poses), world.poses.copy()
        if step % every == late:
            world.forces.hold(*asked, age=late * STEP, period=every * STEP)
        world.step()
    assert np.abs(world.velocities[1]).max() < 1e-4


def test_a_box_that_rocks_loses_what_its_impacts_take() -> None:
    """Each leaves 1 - 3/2 sin² of the angle of its diagonal, if nothing slides (Housner, 1963)."""
    width, height, tilt = 0.15, 0.38, math.radians(2.0)
    low = 0.5 * (width * math.sin(tilt) + height * math.cos(tilt))
    world = World(FLOOR, ((width, 0.21, height), 6.0, (0, 0, low), turned((0, 1, 0), tilt)),
                  friction=1.0)
    turns = np.array([world.step().velocities[1, 4] for _ in range(450)])
    sides = np.split(turns, np.flatnonzero(np.diff(np.sign(turns))) + 1)
    fastest = np.array([np.abs(side).max() for side in sides])[:5]
    assert fastest[1:] / fastest[:-1] == pytest.approx(
        1.0 - 1.5 * width**2 / (width**2 + height**2), rel=0.06)


@pytest.mark.parametrize('seed', range(40))
def test_what_falls_comes_to_rest(seed: int) -> None:
    """Up to six boxes of .1 to .8 m in random poses, on the floor and each other: within 6 s."""
    rng = np.random.default_rng(seed)
    rows = []
    for k in range(rng.integers(2, 7)):
        turn = rng.normal(size=4)
        rows.append((np.exp(rng.uniform(np.log(0.1), np.log(0.8), 3)), np.exp(rng.uniform(0, 3)),
                     (*rng.uniform(-0.3, 0.3, 2), 0.6 + 0.8 * k), turn / np.linalg.norm(turn)))
    world = World(FLOOR, *rows).run(6.0, FRAME)
    assert np.abs(world.velocities[1:]).max() < 1e-3


# --- carriers -------------------------------------------------------------------------------------


def slid_on_a_lorry(braking: float, dt: float) -> float:
    """Return how far a crate slides [m] in 2 s on a lorry that brakes [g] from 20 m/s."""
    world = World(((120.0, 3.0, 1.0), 0.0, (0, 0, -0.5)), ((1.0, 1.0, 0.2), 100.0, (0, 0, 0.1)))
    world.velocities[:, 0] = 20.0
    world.run(0.2, dt)  # the crate has settled
    start = world.poses[1, 0] - world.poses[0, 0]
    for k in range(round(2.0 / dt)):
        world.velocities[0, 0] = 20.0 - braking * GRAVITY * (k + 0.5) * dt
        world.step(dt)
    return float(world.poses[1, 0] - world.poses[0, 0] - start)


@pytest.mark.parametrize('dt, line', [(STEP, 1e-5), (FRAME, 8e-4)])
def test_cargo_stays_on_a_lorry_that_brakes(dt: float, line: float) -> None:
    """By 0.4 g, where friction holds up to 0.5 g."""
    assert abs(slid_on_a_lorry(0.4, dt)) <= line


@pytest.mark.parametrize('dt, line', [(STEP, 0.003), (FRAME, 0.04)])
def test_cargo_slides_on_a_lorry_that_brakes_hard(dt: float, line: float) -> None:
    """By ½·(a − μ·g)·t² at 0.6 g.

    In its first step the lorry has the speed of the step's middle, and the crate may stick to it:
    it is faster by μ·g·dt / 2 at most from then on.
    """
    expected = 0.5 * (0.6 - FRICTION) * GRAVITY * 2.0**2
    assert slid_on_a_lorry(0.6, dt) == pytest.approx(expected, rel=line)


@pytest.mark.parametrize('degrees, slides', [(26.4, False), (26.8, True)])
def test_cargo_on_a_deck_that_rolls(degrees: float, slides: bool) -> None:
    """Ten seconds a period: a plate slides from the angle on whose tangent is μ, 26.57°.

    Deck and plate are thin, so that what turns them accelerates the plate by little.
    """
    rate, most = 2.0 * math.pi * 0.1, math.radians(degrees)
    world = World(((20.0, 20.0, 0.02), 0.0, (0, 0, -0.01)), ((1.0, 1.0, 0.02), 50.0, (0, 0, 0.01)))
    for k in range(4_000):
        world.velocities[0, 3] = most * rate * math.cos(rate * (k + 0.5) * STEP)
        world.step()
    aside = (world.poses[1, :3] - world.poses[0, :3]) @ rotation_matrix(world.poses[0, 3:])
    assert (abs(aside[1]) > 2e-4) == slides
    assert slides or abs(aside[1]) < 1e-5


@pytest.mark.parametrize('dt, line', [(STEP, 1e-5), (FRAME, 8e-4)])
def test_cargo_stays_on_a_wheel_that_speeds_up(dt: float, line: float) -> None:
    """By 0.3 g at 1 m from its axis, to 1 rad/s, where friction holds up to 0.5 g."""
    world = World(((20.0, 20.0, 1.0), 0.0, (0, 0, -0.5)), ((0.2, 0.2, 0.1), 10.0, (1.0, 0, 0.05)))
    world.run(0.2, dt)
    rate = 0.3 * GRAVITY
    for k in range(round(1.0 / rate / dt)):
        world.velocities[0, 5] = rate * (k + 0.5) * dt
        world.step(dt)
    at = rotation_matrix(world.poses[:1, 3:])[0].T @ world.poses[1, :3]
    assert np.abs(at[:2] - [1.0, 0.0]).max() <= line


# --- tipping --------------------------------------------------------------------------------------


def lean(force: float, height: float, friction: float) -> float:
    """Return how far a box of 1 × 1 × 2 m leans [rad] after 2 s; force: of its weight."""
    world = World(FLOOR, ((1.0, 1.0, 2.0), 100.0, (0, 0, 1)), friction=friction)
    push = force * 100.0 * GRAVITY
    world.outside[1, 0], world.outside[1, 4] = push, (height - 1.0) * push
    world.run(2.0)
    return math.acos(min(1.0, rotation_matrix(world.poses[1, 3:])[2, 2]))


@pytest.mark.parametrize('share, tips', [(0.98, False), (1.02, True)])
def test_the_force_that_tips_a_box(share: float, tips: bool) -> None:
    """Pushed at a height h it tips from m·g·w / 2h on, a third of its weight here."""
    assert (lean(share / 3.0, 1.5, FRICTION) > 0.02) == tips


@pytest.mark.parametrize('share, tips', [(0.97, False), (1.03, True)])
def test_the_height_from_which_a_push_tips(share: float, tips: bool) -> None:
    """A push that overcomes friction slides a box below h = w / 2μ, and tips it above."""
    assert (lean(1.005 * 0.4, share / (2.0 * 0.4), 0.4) > 0.02) == tips


@pytest.mark.parametrize('aside, tips', [(-0.01, False), (0.01, True)])
def test_a_cube_beyond_an_edge_tips(aside: float, tips: bool) -> None:
    """From its middle on, to a hundredth of its edge."""
    world = World(((4.0, 4.0, 1.0), 0.0, (0, 0, -0.5)), (CUBE, 50.0, (2.0 + aside, 0, 0.5)))
    world.run(1.5)
    assert (world.poses[1, 2] < 0.48) == tips


# --- sliding and spinning -------------------------------------------------------------------------


@pytest.mark.parametrize('degrees, dt', [(0.0, STEP), (10.0, STEP), (10.0, 0.5 * FRAME),
                                         (10.0, FRAME)])
def test_the_way_of_a_box_that_slides(degrees: float, dt: float) -> None:
    """Down a slope by v² / 2g(μ·cos − sin), from 5 m/s; then it stays."""
    angle = math.radians(degrees)
    turn = turned((0, 1, 0), angle)
    along, _, up = rotation_matrix(turn).T
    world = World(((60.0, 60.0, 1.0), 0.0, -0.5 * up, turn),
                  ((1.0, 1.0, 0.2), 10.0, 0.1 * up, turn))
    world.run(0.1, dt).velocities[1, :3] = 5.0 * along
    start = world.poses[1, :3]
    world.run(2.0, dt)
    expected = 5.0**2 / (2.0 * GRAVITY * (FRICTION * math.cos(angle) - math.sin(angle)))
    assert (world.poses[1, :3] - start) @ along == pytest.approx(expected, rel=0.003)
    assert np.abs(world.velocities[1]).max() < 1e-6


@pytest.mark.parametrize('rate', [10.0, 30.0])
def test_a_free_spin_keeps_its_angular_momentum(rate: float) -> None:
    """A bar that tumbles at 1/60 s for 10 s, to a thousandth, in length and direction."""
    world = World(((2.0, 0.3, 0.2), 10.0, (0, 0, 0)))
    world.outside[:] = 0.0
    world.velocities[0, 3:] = rate * np.array([0.6, 0.7, 0.4])
    before = world.spins()[0]
    world.run(10.0, FRAME)
    assert np.linalg.norm(world.spins()[0] - before) <= 1e-3 * np.linalg.norm(before)


@pytest.mark.parametrize('size', [CUBE, (1.0, 1.0 + 1e-9, 1.0 - 1e-9), (1.0, 1.00001, 1.0)])
@pytest.mark.parametrize('rate', [1e-6, 1e-2, 10.0])
def test_what_is_all_but_a_cube_turns_as_fast_as_it_spins(size: tuple, rate: float) -> None:
    """Its energy says nothing of its attitude, so none is corrected by it."""
    world = World((size, 3.0, (0, 0, 0)))
    world.velocities[0, 3:] = rate * np.array([0.6, 0.0, 0.8])
    for _ in range(100):
        before = world.poses[0, 3:]
        world.step()
        gone = 2.0 * math.asin(min(1.0, 0.5 * np.linalg.norm(world.poses[0, 3:] - before)))
        assert 2.0 * gone == pytest.approx(rate * STEP, rel=1e-4, abs=1e-15)


# --- momentum and energy --------------------------------------------------------------------------


def crowd(rng: np.random.Generator, groups: int, gravity: float, **options: int) -> World:
    """Return groups of three boxes that fly at each other, each group by itself.

    Masses differ by up to 100, and edges by up to 20. With gravity a floor is below them, box 0.
    """
    rows: list[tuple] = [((1e3, 1e3, 1.0), 0.0, (0, 0, -0.5))]
    for k in range(groups):
        size, turn = 10.0 ** rng.uniform(-1.0, 0.3, (3, 3)), rng.normal(size=(3, 4))
        turn /= np.linalg.norm(turn, axis=1, keepdims=True)
        reach = 0.505 * np.linalg.norm(size, axis=1)
        places = -reach[0] - reach[1], 0.0, reach[1] + reach[2]
        rows += [(size[j], 10.0 ** rng.uniform(0.0, 2.0),
                  (20.0 * (k % 40) - 400.0 + places[j], 20.0 * (k // 40) - 400.0, reach.max()),
                  turn[j]) for j in range(3)]
    first = range(1, 3 * groups, 3)
    pairs = [(k + a, k + b) for k in first for a, b in ((0, 1), (1, 2), (0, 2))]
    world = World(*rows, pairs=pairs + [(0, k) for k in range(1, len(rows)) if gravity], **options)
    world.outside[:, 2] = -gravity * world.mass
    world.velocities[1:] = rng.normal(size=(3 * groups, 6))
    world.velocities[1:, 0] += np.tile([3.0, 0.0, -3.0], groups)
    return world


@pytest.mark.parametrize('gravity', [0.0, GRAVITY])
@pytest.mark.parametrize('seed, substeps', [(0, 1), (1, 4), (2, 4), (3, 16), (4, 64)])
def test_energy_is_never_gained(seed: int, substeps: int, gravity: float) -> None:
    """In 100 histories each of three boxes that hit each other, and a floor, by uneven steps.

    Motion and height never have more energy than at first, but for a hundred-thousandth: what is
    pushed out of an overlap turns under its angular momentum, as if by hand.
    """
    rng = np.random.default_rng(seed)
    world = crowd(rng, 100, gravity, substeps=substeps)

    def energies() -> np.ndarray:
        each = world.energies() + gravity * world.mass * world.poses[:, 2]
        return each[1:].reshape(-1, 3).sum(axis=1)

    first, least = energies(), energies()
    for dt in np.exp(rng.uniform(math.log(1e-5), math.log(0.02), 100)):
        world.step(dt)
        now = energies()
        assert (now <= first * (1.0 + 1e-5)).all()
        least = np.minimum(least, now)
    assert (least < 0.9 * first).mean() > 0.2  # boxes met


def test_momentum_is_kept_to_rounding() -> None:
    """Of two cubes that meet askew in free space, the angular one too."""
    world = World((CUBE, 100.0, (0, 0, 0)), (CUBE, 30.0, (0.3, 0.1, 1.4), turned((1, 2, 3), 0.8)))
    world.outside[:] = 0.0
    world.velocities[1] = 0.3, -0.2, -2.0, 0.5, 0.2, 1.0

    def momenta() -> tuple[np.ndarray, np.ndarray]:
        linear = world.mass[:, None] * world.velocities[:, :3]
        return (linear.sum(axis=0),
                (np.cross(world.poses[:, :3], linear) + world.spins()).sum(axis=0))

    first = momenta()
    world.run(0.5)
    assert np.abs(world.velocities[0]).max() > 0.1
    for before, after in zip(first, momenta()):
        assert np.abs(after - before).max() <= 1e-12 * np.linalg.norm(before)


# --- loads ----------------------------------------------------------------------------------------


@pytest.mark.parametrize('dt', [STEP, FRAME])
def test_the_loads_of_three_feet(dt: float) -> None:
    """Those of statics, within 3 %: three moments have one solution."""
    feet, centre = np.array([(-0.3, -0.2), (0.5, -0.2), (0.1, 0.4)]), (0.12, 0.08)
    statics = np.linalg.solve(np.vstack([np.ones(3), feet.T]), [1.0, *centre])
    forces = PatchForces([FIXED, Body(mass=56.0, inertia=(5.0, 7.0, 11.0), centre=(*centre, 0.5))])
    forces.set_boxes([FLOOR[0], *[(0.06, 0.06, 0.5)] * 3], body=[0, 1, 1, 1], poses=[
        (0, 0, 0, 0, 0, 0, 1), *((x, y, 0.25, 0, 0, 0, 1) for x, y in feet)])
    forces.hold([(0, 1), (0, 2), (0, 3)])
    poses = np.array([[*FLOOR[2], 0, 0, 0, 1], [0, 0, 0, 0, 0, 0, 1.0]])
    velocities, outside = np.zeros((2, 2, 6))
    outside[1, 2] = -56.0 * GRAVITY
    for _ in range(round(2.0 / dt)):
        poses, velocities, *_ = forces.advance(dt, poses, velocities, outside)
    assert forces.loads().pressing / (56.0 * GRAVITY) == pytest.approx(statics, rel=0.03)


@pytest.mark.parametrize('dt', [STEP, 1 / 120, FRAME])
def test_two_pads_share_as_rubber_ones(dt: float) -> None:
    """N = W/2 ∓ W·x·c / 2(c² + L²/12): pads of length L at ±c, the centre of mass at x; 1 ‰.

    On a floor, and by the beam's one box on two fixed boxes. Corner loads add up to each load.
    """
    weight, aside, at, long = 70.0 * GRAVITY, 0.3, 0.8, 0.4
    shift = aside * at / (2.0 * (at**2 + long**2 / 12.0))
    pads = [((long, 0.5, 0.2), (side * at, 0, 0.1)) for side in (-1.0, 1.0)]
    beam, inertia = ((2.4, 0.5, 0.1), (0, 0, 0.25)), (5.0, 7.0, 11.0)
    upright = (0.0, 0.0, 0.0, 1.0)
    for body in ((0, 1, 1, 1), (0, 0, 0, 1)):  # whose the floor, the pads and the beam are
        boxes = [(FLOOR[0], FLOOR[2]), *pads, beam]
        forces = PatchForces([FIXED, Body(mass=70.0, inertia=inertia, centre=(aside, 0, 0.25))])
        forces.set_boxes([size for size, _ in boxes], body=body,
                         poses=[(*place, *upright) for _, place in boxes])
        forces.hold([(0, 1), (0, 2)] if body[1] else [(1, 3), (2, 3)])
        poses, velocities, outside = np.zeros((2, 7)), *np.zeros((2, 2, 6))
        poses[:, 6], outside[1, 2] = 1.0, -weight
        for _ in range(round(2.0 / dt)):
            poses, velocities, *_ = forces.advance(dt, poses, velocities, outside)
        loads = forces.loads()
        assert loads.pressing / weight == pytest.approx([0.5 - shift, 0.5 + shift], rel=1e-3)
        assert loads.pressing.sum() == pytest.approx(weight, rel=1e-9)
        assert loads.corner_loads.sum(axis=1) == pytest.approx(loads.pressing, rel=1e-12)
        middle = loads.pressing @ loads.centre / weight
        assert middle[:2] == pytest.approx([aside, 0.0], abs=2e-5)  # it leans by 3e-5 rad


def test_the_force_of_a_belt_on_a_dam() -> None:
    """Ten parcels of 8 kg on a belt: the dam takes μ·m·g of each, 392.4 N.

    Parcels and dam rub only on the belt, so that it bears all their weight.
    """
    parcel = (0.4, 0.3, 0.3)
    world = World(FLOOR, ((0.1, 1.0, 0.5), 0.0, (0.05, 0, 0.25)),
                  *((parcel, 8.0, (-0.4 * (k + 0.5), 0, 0.15)) for k in range(10)))
    pairs = [(0, k) for k in range(2, 12)] + [(k, k + 1) for k in range(1, 11)]
    belt = np.array([(-0.35, 0, 0)] * 10 + [(0, 0, 0)] * 10)  # of B's surface relative to A's
    world.forces.hold(pairs, surface_velocity=belt, friction=[FRICTION] * 10 + [0.0] * 10)
    world.run(1.0)
    loads = world.forces.loads()
    dam = loads.pressing[(loads.pairs == (1, 2)).all(axis=1)]
    assert dam == pytest.approx([10 * FRICTION * 8.0 * GRAVITY], rel=1e-3)
    assert np.abs(world.velocities).max() < 1e-6

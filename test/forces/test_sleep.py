# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Sleep: what is laid down, what wakes it, and that it then goes on as if it had never been."""
from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from itertools import combinations

import numpy as np
import pytest
from helpers.worlds import CONTAINER, FLOOR, World, turned

from box_contact_ros import Body, ContactSolver
from box_contact_ros.forces.patch_forces import GRAVITY

DT = 1 / 240  # [s]
PLATE, ON_PLATE, FOOT, MIDDLE, TOP, FLOATING, SLIDER = range(1, 8)


def cube(mass: float, *place: float) -> tuple:
    return (0.5, 0.5, 0.5), mass, place


def yard(**options) -> World:
    """Return a box on a plate, a tower, one that floats above it, and one on the floor beside."""
    world = World(FLOOR, ((1, 1, 0.2), 0.0, (5, 0, 0.1)), cube(10, 5, 0, 0.45),
                  cube(20, 0, 0, 0.25), cube(10, 0.02, 0, 0.75), cube(5, 0, 0.03, 1.25),
                  cube(3, 0.1, 0, 2.0), cube(4, -0.8, 0, 0.25), **options)
    world.outside[FLOATING] = 0.0
    return world


def asleep(world: World) -> list[int]:
    return np.flatnonzero(~world.awake & (world.mass > 0)).tolist()


@pytest.fixture(scope='module')
def twins() -> tuple[World, World]:
    """Return the yard after 2 s: with rest, and without."""
    resting, awake = yard().run(2.0, DT), yard(rest=False).run(2.0, DT)
    assert asleep(resting) == [ON_PLATE, FOOT, MIDDLE, TOP, SLIDER]
    assert awake.awake[awake.mass > 0].all()
    return resting, awake


def pairs_of(world: World) -> np.ndarray:
    return np.array([(a, b) for a, b in combinations(range(len(world.mass)), 2)
                     if world.mass[a] or world.mass[b]])


def hold(world: World, pairs: np.ndarray | None = None, **columns: tuple[int, int, object]) -> None:
    """Hold pairs, with columns (box, box, value) that others of the pairs have as 0."""
    pairs = pairs_of(world) if pairs is None else pairs
    rows = {}
    for name, (a, b, value) in columns.items():
        rest = np.full(len(pairs), 0.5) if name == 'friction' else np.zeros(len(pairs))
        rows[name] = np.multiply.outer(rest, np.ones(np.shape(value)))
        rows[name][(pairs == (a, b)).all(axis=1)] = value
    world.forces.hold(pairs, **rows)


def move(world: World, body: int, *way: float) -> None:
    world.poses = world.poses.copy()
    world.poses[body, :3] += way


def give_speed(world: World, body: int, *speed: float) -> None:
    world.velocities = world.velocities.copy()
    world.velocities[body] = speed


def push(world: World, body: int, *wrench: float) -> None:
    world.outside[body] += wrench


def tilt(world: World) -> None:
    world.outside[:, 0] = 0.6 * GRAVITY * world.mass


def heavier(world: World) -> None:
    world.bodies[TOP] = Body.of_box(world.size[TOP], 50.0)
    world.forces.set_bodies(world.bodies)
    world.outside[TOP, 2] = -50.0 * GRAVITY


def smaller(world: World) -> None:
    world.size[FOOT, 2] = 0.45
    world.forces.set_boxes(world.size)
    hold(world)


def others(world: World) -> None:
    pairs = pairs_of(world)
    contacts = ContactSolver().batch(world.poses, sizes=world.size, pairs=pairs)
    world.forces.hold(pairs, contacts, world.poses)
    push(world, TOP, 30, 0, 0, 0, 0, 0)


def forgotten(world: World) -> None:
    world.forces.forget([MIDDLE])
    give_speed(world, MIDDLE, 0, 0, 1, 0, 0, 0)


EVENTS: dict[str, tuple[Callable[[World], None], list[int]]] = {
    'support taken': (lambda w: move(w, PLATE, 0, 0, -3), [ON_PLATE]),
    'support lowered': (lambda w: give_speed(w, PLATE, 0, 0, -0.2, 0, 0, 0), [ON_PLATE]),
    'turntable': (lambda w: give_speed(w, PLATE, 0, 0, 0, 0, 0, 1), [ON_PLATE]),
    'pushed': (lambda w: push(w, FOOT, 300, 0, 0, 0, 0, 0), [FOOT, MIDDLE, TOP]),
    'pushed in vain': (lambda w: push(w, FOOT, 30, 0, 0, 0, 0, 0), [FOOT, MIDDLE, TOP]),
    'turned': (lambda w: push(w, TOP, 0, 0, 0, 0, 0, 20), [FOOT, MIDDLE, TOP]),
    'speed given': (lambda w: give_speed(w, TOP, 1, 0, 0, 0, 0, 0), [FOOT, MIDDLE, TOP]),
    'lifted': (lambda w: move(w, TOP, 0, 0, 0.1), [FOOT, MIDDLE, TOP]),
    'put aside': (lambda w: move(w, MIDDLE, 2, 0, 0), [FOOT, MIDDLE, TOP]),
    'a bit': (lambda w: move(w, TOP, 0, 0, 2e-16), [FOOT, MIDDLE, TOP]),
    'foot taken': (lambda w: move(w, FOOT, 0, 3, 0), [FOOT, MIDDLE, TOP]),
    'hit from above': (lambda w: push(w, FLOATING, 0, 0, -30, 0, 0, 0), []),
    'slid into': (lambda w: give_speed(w, SLIDER, 2, 0, 0, 0, 0, 0), [SLIDER]),
    'heavier': (heavier, [FOOT, MIDDLE, TOP]),
    'gravity turned': (tilt, [ON_PLATE, FOOT, MIDDLE, TOP, SLIDER]),
    'weightless': (lambda w: push(w, TOP, 0, 0, 6 * GRAVITY, 0, 0, 0), [FOOT, MIDDLE, TOP]),
    'belt': (lambda w: hold(w, surface_velocity=(0, SLIDER, (1.0, 0, 0))), [SLIDER]),
    'ice': (lambda w: (hold(w, friction=(0, SLIDER, 0.0)),
                       give_speed(w, SLIDER, 1, 0, 0, 0, 0, 0)), [SLIDER]),
    'pair lost': (lambda w: hold(w, pairs_of(w)[1:]), []),
    'box set anew': (smaller, [FOOT, MIDDLE, TOP]),
    'answers of others': (others, [FOOT, MIDDLE, TOP]),
    'forgotten': (forgotten, [FOOT, MIDDLE, TOP]),
    'reset': (lambda w: w.forces.reset(), [ON_PLATE, FOOT, MIDDLE, TOP, SLIDER]),
}


@pytest.mark.parametrize('event', EVENTS)
def test_what_wakes_goes_on_as_if_it_had_not_rested(event: str,
                                                    twins: tuple[World, World]) -> None:
    worlds = deepcopy(twins)
    change, woken = EVENTS[event]
    for world in worlds:
        change(world)
    resting, awake = (world.step(DT) for world in worlds)
    assert set(woken) <= set(np.flatnonzero(resting.awake))
    for _ in range(95):  # falls of 0.4 s, and what they hit
        resting.step(DT)
        awake.step(DT)
        assert resting.poses == pytest.approx(awake.poses, abs=1e-6)


@pytest.mark.parametrize('event', EVENTS)
def test_to_name_what_changed_changes_no_bit(event: str,
                                             twins: tuple[World, World]) -> None:
    told, other = deepcopy(twins[0]), deepcopy(twins[0])
    last = told.poses, told.velocities, told.outside.copy()
    for world in (told, other):
        EVENTS[event][0](world)
    for _ in range(20):
        given = told.poses, told.velocities, told.outside
        differs = [(now != then).any(axis=1) for now, then in zip(given, last)]
        found = told.forces.advance(DT, *given, changed=np.flatnonzero(np.any(differs, axis=0)))
        other.step(DT)
        wanted = other.poses, other.velocities, other.wrenches, other.awake
        for one, another in zip(found, wanted):
            assert one.tobytes() == another.tobytes()
        told.poses, told.velocities, *_ = found
        last = told.poses, told.velocities, told.outside.copy()


def test_what_wakes_with_what_is_named_is_checked(twins: tuple[World, World]) -> None:
    world, twin = deepcopy(twins[0]), deepcopy(twins[0])
    poses = world.poses.copy()
    poses[TOP, 6] = np.nan
    for each in (world, twin):
        push(each, FOOT, 1, 0, 0, 0, 0, 0)
    with pytest.raises(ValueError, match=rf'^poses\[{TOP}\] '):
        world.forces.advance(DT, poses, world.velocities, world.outside, changed=[FOOT])
    found = world.forces.advance(DT, world.poses, world.velocities, world.outside,
                                 changed=[FOOT, FOOT])
    assert found.poses.tobytes() == twin.step(DT).poses.tobytes()
    for wrong, words in (([9], 'there is no body 9'), ([0.5], 'whole numbers'), (3, 'whole')):
        with pytest.raises(ValueError, match=f'^changed.* {words}'):
            world.forces.advance(DT, poses, world.velocities, changed=wrong)


@pytest.mark.parametrize('event', EVENTS)
def test_arrays_that_are_written_have_the_same_bits(event: str,
                                                    twins: tuple[World, World]) -> None:
    """In place, and into others; of awake and wrenches those that are wanted."""
    here, there, other = (deepcopy(twins[0]) for _ in range(3))
    for world in (here, there, other):
        EVENTS[event][0](world)
    for _ in range(20):
        other.step(DT)
        found = here.forces.advance(DT, here.poses, here.velocities, here.outside,
                                    out=(here.poses, here.velocities))
        assert found.poses is here.poses and found.velocities is here.velocities
        assert found.wrenches.shape == (0, 6) and found.awake.shape == (0,)
        rows = [np.full_like(row, 7) for row in (other.poses, other.velocities, other.wrenches,
                                                 other.awake)]
        there.forces.advance(DT, there.poses, there.velocities, there.outside, out=rows)
        there.poses, there.velocities = rows[:2]
        for one, another in zip((*found[:2], *rows), (
                other.poses, other.velocities, other.poses, other.velocities, other.wrenches,
                other.awake)):
            assert one.tobytes() == another.tobytes()


def test_rows_at_rest_are_neither_read_nor_written() -> None:
    """Of two boxes one is pushed, and goes on; the other one sleeps."""
    world = World(FLOOR, *(((0.5, 0.5, 0.5), 5.0, (x, 0, 0.25)) for x in (0, 5)),
                  find_pairs=True).run(1.0, DT)
    world.poses[1], world.velocities[1], world.outside[1] = np.nan, np.nan, np.nan
    push(world, 2, 40.0, 0, 0, 0, 0, 0)
    awake = np.ones(3, bool)
    for changed in ([2], []):
        found = world.forces.advance(DT, world.poses, world.velocities, world.outside,
                                     changed=changed,
                                     out=(world.poses, world.velocities, None, awake))
    assert np.isnan(found.poses[1]).all() and np.isnan(found.velocities[1]).all()
    assert world.poses[2, 0] > 5.0 and world.velocities[2, 0] > 0.0
    assert found.awake is awake and awake.tolist() == [False, False, True]
    assert len(found.wrenches) == 0


@pytest.mark.parametrize('wrong', [
    lambda p, v: (p,), lambda p, v: (p, None), lambda p, v: (p[:1], v),
    lambda p, v: (p.astype(np.float32), v), lambda p, v: (p, v, None, np.zeros(len(p))),
    lambda p, v: (np.broadcast_to(p[0], p.shape), v)])
def test_arrays_that_cannot_be_written_are_refused(wrong: Callable[..., tuple],
                                                   twins: tuple[World, World]) -> None:
    world = deepcopy(twins[0])
    before = world.poses.tobytes()
    with pytest.raises(ValueError, match='^out'):
        world.forces.advance(DT, world.poses, world.velocities, world.outside,
                             out=wrong(world.poses, world.velocities))
    assert world.poses.tobytes() == before


def heap(rng: np.random.Generator, count: int) -> list[tuple]:
    """Rows of a World: boxes of a third to all of a metre, turned, that fall onto each other."""
    rows: list[tuple] = [FLOOR]
    for k in range(count):
        rows.append((rng.uniform(0.3, 1.0, 3), 10 ** rng.uniform(0, 1.5),
                     (*rng.uniform(-0.7, 0.7, 2), 0.7 + 0.8 * k),
                     turned(rng.normal(size=3) * 0.1 + (0, 0, 1), rng.uniform(0, 3))))
        rows[-1][3][:] /= np.linalg.norm(rows[-1][3])
    return rows


def disturb(world: World, rng: np.random.Generator) -> None:
    """One of many small things that happen to a body."""
    body, kind = int(rng.integers(1, len(world.mass))), int(rng.integers(5))
    weight = GRAVITY * world.mass[body]
    if kind == 0:
        push(world, body, *rng.normal(0, 0.3 * weight, 3), 0, 0, 0)
    elif kind == 1:
        give_speed(world, body, *rng.normal(0, 0.3, 6))
    elif kind == 2:
        move(world, body, 0, 0, rng.uniform(0, 0.02))
    elif kind == 3:
        push(world, body, 0, 0, 0, *rng.normal(0, 0.05 * weight, 3))
    else:
        give_speed(world, 0, *rng.normal(0, 0.1, 2), 0, 0, 0, rng.normal(0, 0.1))


def test_random_histories_go_on_as_without_rest() -> None:
    """To 1 µm: a heap after 4 s, and then one of many things, in uneven steps."""
    rested = 0
    for seed in range(24):
        rng = np.random.default_rng(seed)
        rows, dt = heap(rng, 4), rng.choice([1 / 60, 1 / 240])
        worlds = [World(*rows, rest=rest).run(4.0, dt) for rest in (True, False)]
        worlds[1].poses, worlds[1].velocities = worlds[0].poses, worlds[0].velocities
        rested += len(asleep(worlds[0]))
        state = rng.bit_generator.state
        for world in worlds:
            rng.bit_generator.state = state
            disturb(world, rng)
        for step in dt * rng.uniform(0.25, 1.0, 30):
            resting, awake = (world.step(step) for world in worlds)
            assert resting.poses == pytest.approx(awake.poses, abs=1e-6), seed
    assert rested > 80  # of 96


def test_rest_is_the_poses_that_were_given(twins: tuple[World, World]) -> None:
    """To the bit, for steps of any length; loads stay readable."""
    world, rng = deepcopy(twins[0]), np.random.default_rng(1)
    poses, loads = world.poses[:FLOATING], world.forces.loads()
    assert (loads.pairs[:, 0] * 100 + loads.pairs[:, 1]).tolist() == [3, 7, 102, 304, 405]
    for dt in np.exp(rng.uniform(np.log(1e-6), np.log(0.1), 2000)):
        world.step(dt)
        assert world.poses[:FLOATING].tobytes() == poses.tobytes()
        assert not world.velocities[1:FLOATING].any()
        assert not world.awake[:FLOATING].any() and world.awake[FLOATING]
    for before, after in zip(loads, world.forces.loads()):
        assert np.array_equal(before, after)
    expected = GRAVITY * np.array([35.0, 4.0, 10.0, 15.0, 5.0])
    assert loads.pressing == pytest.approx(expected, rel=1e-4)
    assert world.wrenches[1:, :3] == pytest.approx(-world.outside[1:, :3], abs=0.01)


@pytest.mark.parametrize('dt', [0.001, 1 / 60])
def test_loads_at_rest_are_those_awake(dt: float) -> None:
    """Of containers that land tilted, a tower askew and a bridge: to the bit, and 2 s later."""
    for rows in (
            [(CONTAINER, 20e3, (0, 0, CONTAINER[2] * (k + 0.5) + 0.1 * (k + 1)),
              turned((0, 1, 0), 0.01)) for k in range(4)],
            [((1, 1, 0.5), 10, (0.1 * (k % 3), 0.07 * k, 0.25 + 0.5 * k)) for k in range(6)],
            [((0.5, 0.5, 1), 10, (x, 0, 0.5)) for x in (-1, 1)]
            + [((3, 0.5, 0.2), 20, (0.1, 0, 1.1)), cube(20, 0.3, 0, 1.45)]):
        resting, awake = (World(FLOOR, *rows, rest=rest, find_pairs=True) for rest in (True, False))
        while len(asleep(resting.step(dt))) < len(rows):
            awake.step(dt)
        loads, most = resting.forces.loads(), GRAVITY * resting.mass.sum()
        assert np.array_equal(loads.pressing, awake.step(dt).forces.loads().pressing)
        later = awake.run(2.0, dt).forces.loads()
        assert loads.pressing == pytest.approx(later.pressing, abs=1e-6 * most)
        assert loads.corner_loads == pytest.approx(later.corner_loads, abs=1e-5 * most)


@pytest.mark.parametrize(('dt', 'speed'), [(1 / 240, 0.02), (1 / 60, 0.07), (0.1, 0.3)])
def test_what_slides_within_a_step_is_not_laid_down_where_it_was(dt: float, speed: float) -> None:
    """A settled cube is given a speed in the step in which it would be laid down."""
    steps, settled = 0, World(FLOOR, cube(5, 0, 0, 0.25))
    while not asleep(settled.step(dt)):
        steps += 1
    kicked = [World(FLOOR, cube(5, 0, 0, 0.25), rest=rest).run(steps * dt, dt)
              for rest in (True, False)]
    for world in kicked:
        give_speed(world, 1, speed, 0, 0, 0, 0, 0)
        world.step(dt)
        assert world.awake[1]
        world.run(2.0, dt)
    assert asleep(kicked[0]) == [1]
    assert kicked[0].poses == pytest.approx(kicked[1].poses, abs=1e-6)


def test_what_falls_within_a_step_is_laid_down_where_it_landed() -> None:
    """A step may be longer than what is slow must last."""
    for dt in (0.6, 0.9):
        world = World(FLOOR, cube(5, 0, 0, 3.0)).run(8 * dt, dt)
        assert asleep(world) == [1]
        assert world.poses[1, 2] == pytest.approx(0.25, abs=1e-3)


def test_zeros_of_either_sign_wake_nobody(twins: tuple[World, World]) -> None:
    world = deepcopy(twins[0])
    world.velocities = -np.abs(world.velocities)
    assert asleep(world.step(DT)) == [ON_PLATE, FOOT, MIDDLE, TOP, SLIDER]


def test_what_is_not_touched_rests_on(twins: tuple[World, World]) -> None:
    """A push of the tower wakes neither the box on the plate nor the one beside."""
    world = deepcopy(twins[0])
    push(world, TOP, 1, 0, 0, 0, 0, 0)
    assert asleep(world.step(DT)) == [ON_PLATE, SLIDER]
    assert asleep(world.run(1.0, DT)) == [ON_PLATE, FOOT, MIDDLE, TOP, SLIDER]


def test_what_comes_to_touch_wakes(twins: tuple[World, World]) -> None:
    world = deepcopy(twins[0])
    push(world, FLOATING, 0, 0, -30, 0, 0, 0)
    place = world.poses[TOP].tobytes()
    height = world.poses[FLOATING, 2]
    while not world.step(DT).awake[TOP]:
        assert height > 1.75 and world.poses[TOP].tobytes() == place
        height = world.poses[FLOATING, 2]
    assert set(asleep(world)) == {ON_PLATE, SLIDER}
    assert len(asleep(world.run(3.0, DT))) == 6


def test_a_pair_listed_late_is_solved_once() -> None:
    """Two boxes that overlap rest until their pair is listed; a pair apart wakes nobody."""
    world = World(FLOOR, cube(5, 0, 0, 0.25), cube(5, 0.49, 0, 0.25), cube(5, 2, 0, 0.25), pairs=[])
    world.forces.set_boxes(world.size)
    world.forces.hold([(0, 1), (0, 2), (0, 3)])
    assert asleep(world.run(2.0, DT)) == [1, 2, 3]
    world.forces.hold([(0, 1), (0, 2), (0, 3), (1, 3), (2, 3)])
    assert asleep(world.step(DT)) == [1, 2, 3]
    for order in (1, -1):  # what no step has solved stays new
        world.forces.hold([(2, 1), (0, 1), (0, 2), (0, 3), (1, 3), (2, 3)][::order])
    assert asleep(world.step(DT)) == [3]
    world.run(2.0, DT)
    assert world.poses[2, 0] - world.poses[1, 0] == pytest.approx(0.5, abs=1e-4)
    assert asleep(world) == [1, 2, 3]
    world.forces.hold([(2, 1), (0, 1), (0, 2)])
    assert asleep(world.step(DT)) == [1, 2]


def test_a_body_more_or_less_wakes_what_it_touches(twins: tuple[World, World]) -> None:
    """Of the bodies and boxes that are set anew, those that stay rest on, and so do forgotten."""
    world = deepcopy(twins[0])
    forces, loads = world.forces, world.forces.loads()
    forces.forget([FLOATING, ON_PLATE])
    assert not len(forces.loads().pairs)
    assert asleep(world.step(DT)) == [FOOT, MIDDLE, TOP, SLIDER]
    assert np.array_equal(forces.loads().pairs, loads.pairs)
    assert len(asleep(world.run(2.0, DT))) == 5
    forces.set_bodies([*world.bodies, Body.of_box((1, 1, 1), 5.0)])
    forces.set_boxes(np.vstack((world.size, [(1, 1, 1)])))
    pairs = np.vstack((pairs_of(world), [(0, 8), (TOP, 8)]))
    forces.hold(pairs)
    more = [np.vstack((rows, rows[-1:])) for rows in (world.poses, world.velocities, world.outside)]
    more[0][8, :3], more[2][8] = (0, 0, 5), (0, 0, -5 * GRAVITY, 0, 0, 0)
    awake = forces.advance(DT, *more).awake
    assert np.flatnonzero(awake).tolist() == [FLOATING, 8]
    forces.set_boxes(world.size)
    forces.set_bodies([*world.bodies[:PLATE], world.bodies[PLATE], *world.bodies[2:]])
    hold(world)
    assert len(asleep(world.step(DT))) == 5
    forces.set_boxes(world.size[:-1])
    forces.set_bodies(world.bodies[:-1])
    forces.hold(pairs_of(world)[(pairs_of(world) < SLIDER).all(axis=1)])
    awake = forces.advance(DT, world.poses[:-1], world.velocities[:-1], world.outside[:-1]).awake
    assert np.flatnonzero(awake).tolist() == [FLOATING]


def test_belts_ice_and_what_floats_never_rest() -> None:
    """Nor does what nothing holds but a body that moves, though all are slow."""
    floor = FLOOR[0], 0.0, (0.0, 0.0, -0.5)
    names = {
        'belt against a wall': World(floor, ((1, 5, 5), 0.0, (1, 0, 2)), cube(5, 0.25, 0, 0.25)),
        'ice': World(floor, cube(5, 0, 0, 0.25), cube(5, 0, 0, 0.75), friction=0.5),
        'floats': World(cube(5, 0, 0, 0), cube(5, 0.4999999, 0, 0)),
        'lift': World(floor, cube(5, 0, 0, 0.25)),
        'turntable': World(floor, cube(5, 0, 0, 0.25)),
    }
    hold(names['belt against a wall'], surface_velocity=(0, 2, (1.0, 0, 0)))
    hold(names['ice'], friction=(0, 1, 0.0))
    names['floats'].outside[:] = 0
    names['floats'].outside[:, 0] = 1, -1
    give_speed(names['lift'], 0, 0, 0, 5e-5, 0, 0, 0)
    give_speed(names['turntable'], 0, 0, 0, 0, 0, 0, 5e-5)
    for name, world in names.items():
        for _ in range(480):
            if name == 'ice':
                give_speed(world, 1, 5e-5, 0, 0, 0, 0, 0)
            assert not asleep(world.step(DT)), name
    assert names['ice'].poses[2, 0] > 0.9 * 5e-5 * 2.0


def test_what_begins_to_tip_does_not_rest() -> None:
    """A box whose middle is 5 µm beyond the edge below it: slow for more than half a second."""
    edge = ((1.0, 1.0, 1.0), 0.0, (0.0, 0.0, -0.5))
    world = World(edge, ((0.5, 0.5, 1.0), 5.0, (0.500005, 0.0, 0.5)))
    slow = 0
    while np.abs(world.poses[1, 3:6]).max() < 0.1:
        slow += int(np.abs(world.step(DT).velocities[1]).max() < 1e-4)
        assert world.awake[1]
    assert slow * DT > 0.3


def test_waking_gives_no_energy(twins: tuple[World, World]) -> None:
    """Woken and laid down again and again, a tower keeps its height to a hundredth of a micron."""
    world = deepcopy(twins[0])
    heights = world.poses[:, 2].copy()
    for _ in range(20):
        push(world, TOP, 0.1, 0, 0, 0, 0, 0)
        assert world.step(DT).awake[FOOT]
        push(world, TOP, -0.1, 0, 0, 0, 0, 0)
        while world.step(DT).awake[FOOT]:
            assert world.energies().sum() < 1e-6
        assert not world.velocities[FOOT:FLOATING].any()
    assert world.poses[:, 2] == pytest.approx(heights, abs=1e-8)


@pytest.mark.parametrize('torque', [np.nan, 1e100])
def test_a_step_that_is_refused_wakes_nobody(torque: float, twins: tuple[World, World]) -> None:
    """Refused for its numbers, or for where they would lead, with the tower awake already."""
    world, twin = deepcopy(twins[0]), deepcopy(twins[0])
    wild, poses = world.outside.copy(), world.poses.copy()
    wild[FLOATING, 3:] = torque
    wild[TOP, 0] = 1.0
    poses[PLATE, 2] -= 1.0
    for _ in range(3):
        with pytest.raises(ValueError):
            world.forces.advance(DT, poses, world.velocities, wild)
    for before, after in zip(twin.forces.loads(), world.forces.loads()):
        assert np.array_equal(before, after)
    assert asleep(world.step(DT)) == [ON_PLATE, FOOT, MIDDLE, TOP, SLIDER]
    for _ in range(20):
        push(world, TOP, 1, 0, 0, 0, 0, 0)
        push(twin, TOP, 1, 0, 0, 0, 0, 0)
        assert world.step(DT).poses.tobytes() == twin.step(DT).poses.tobytes()


@pytest.mark.parametrize('torque', [np.nan, 1e100])
@pytest.mark.parametrize('change', [hold, others])
def test_a_step_that_is_refused_changes_no_patch(change: Callable[[World], None], torque: float,
                                                 twins: tuple[World, World]) -> None:
    """Where all is awake, with contacts of one's own and with answers."""
    world, twin = deepcopy(twins[1]), deepcopy(twins[1])
    for each in (world, twin):
        change(each)
        push(each, TOP, 20, 0, 0, 0, 0, 2)
        each.run(0.1, DT)
    wild = world.outside.copy()
    wild[FLOATING, 3:] = torque
    for _ in range(3):
        with pytest.raises(ValueError):
            world.forces.advance(3 * DT, world.poses, world.velocities, wild)
    for _ in range(20):
        assert world.step(DT).poses.tobytes() == twin.step(DT).poses.tobytes()


def test_threads_and_order_of_pairs_change_no_bit() -> None:
    found = set()
    for threads, order in ((1, 1), (2, 1), (1, -1)):
        rows = (cube(5, x, 0, 0.25 + 0.5 * z) for x in range(-20, 20) for z in range(2))
        world = World(FLOOR, *rows, threads=threads)
        world.forces.hold(pairs_of(world)[::order])
        push(world.run(1.5, DT), 7, 0, 0, 0, 0, 0, 1)
        assert len(asleep(world.step(DT))) == 78
        found.add(world.run(0.1, DT).poses.tobytes())
    assert len(found) == 1


def test_another_integrator_gets_wrenches_of_what_is_awake(twins: tuple[World, World]) -> None:
    resting, awake = deepcopy(twins)
    given = [world.forces.wrenches(DT, world.poses, world.velocities, world.outside)
             for world in (resting, awake)]
    assert given[0] == pytest.approx(given[1], abs=0.01)


class Told(World):
    """A world whose contacts are answers of others, every so many steps, and late by some."""

    def __init__(self, *rows: tuple, every: int = 1, late: int = 0, **options) -> None:
        super().__init__(*rows, pairs=(), **options)
        self.every, self.late, self.count = every, late, 0
        self.pairs, self.solver = pairs_of(self), ContactSolver()
        self.asked: list[np.ndarray] = []

    def step(self, dt: float = DT) -> World:
        self.asked = [*self.asked, self.poses][-1 - self.late:]
        if self.count % self.every == 0:
            contacts = self.solver.batch(self.asked[0], sizes=self.size, pairs=self.pairs)
            self.forces.hold(self.pairs, contacts, self.asked[0], period=self.every * dt,
                             age=(len(self.asked) - 1) * dt)
        self.count += 1
        return super().step(dt)


def tower(kind: type[World], **options) -> World:
    return kind(FLOOR, ((1, 1, 0.2), 0.0, (0, 0, 0.1)), cube(20, 0, 0, 0.45), cube(10, 0, 0, 0.95),
                cube(5, 2, 0, 0.25), **options)


@pytest.mark.parametrize(('every', 'late'), [(1, 0), (4, 0), (4, 3), (2, 5)])
def test_answers_of_others_lay_down_and_wake(every: int, late: int) -> None:
    """What they say again wakes nobody; what they say otherwise wakes, once it comes."""
    world = tower(Told, every=every, late=late).run(3.0, DT)
    poses = world.poses.tobytes()
    for _ in range(240):
        assert asleep(world.step(DT)) == [2, 3, 4]
    assert world.poses.tobytes() == poses

    def woken(change: Callable[[World], None]) -> list[int]:
        other = deepcopy(world)
        change(other)
        for _ in range(every + late):
            other.step(DT)
        return np.flatnonzero(other.awake & (other.mass > 0)).tolist()

    def shrunk(other: World) -> None:
        other.size[2, 2] -= 1e-3

    def unlisted(other: World) -> None:
        other.pairs = other.pairs[(other.pairs != (0, 4)).any(axis=1)]  # type: ignore[attr-defined]

    assert woken(lambda other: None) == []
    assert woken(lambda other: push(other, 3, 1, 0, 0, 0, 0, 0)) == [2, 3]
    assert woken(lambda other: move(other, 1, 0, 0, -0.01)) == [2, 3]
    assert woken(shrunk) == [2, 3]
    assert woken(unlisted) == [4]


def test_answers_of_others_let_fall_as_without_rest() -> None:
    """The plate below is taken: what falls and lands is where it would be."""
    worlds = [tower(Told, every=4, late=2, rest=rest).run(3.0, DT) for rest in (True, False)]
    assert asleep(worlds[0]) == [2, 3, 4] and not asleep(worlds[1])
    for world in worlds:
        move(world, 1, 0, 0, -0.2)
    for _ in range(40):
        resting, awake = (world.step(DT) for world in worlds)
        assert resting.poses == pytest.approx(awake.poses, abs=1e-6)
    assert resting.poses[3, 2] < 0.9


def test_a_touch_told_after_what_it_touches_was_laid_down() -> None:
    """The question is older than rest: a box that comes down on another one ends on it."""
    def landed(start: float, **options) -> Told:
        world = Told(FLOOR, cube(20, 0, 0, 0.25), cube(5, 0.02, 0, start), late=5, **options)
        world.outside[2] = 0.0
        give_speed(world, 2, 0, 0, -0.5, 0, 0, 0)
        return world

    steps, world = 0, landed(100.0)
    while not asleep(world.step(DT)):
        steps += 1
    start = 0.75 + 0.5 * DT * (steps - 3)  # to touch three steps before the lower is laid down
    resting, awake = landed(start), landed(start, rest=False)
    for _ in range(steps + 60):
        assert resting.step(DT).poses == pytest.approx(awake.step(DT).poses, abs=1e-6)


def test_contacts_of_ones_own_after_answers_wake() -> None:
    """The answers were of larger boxes: without them the box comes down."""
    world = Told(FLOOR, cube(5, 0, 0, 0.26))
    world.forces.set_boxes(world.size)
    boxes = world.size.copy()
    world.size[1] += 0.02
    assert asleep(world.run(2.0, DT)) == [1]
    world.forces.set_boxes(boxes)
    assert asleep(world.run(1.0, DT)) == [1] and world.poses[1, 2] > 0.2599
    world.forces.hold(world.pairs)
    for _ in range(240):
        World.step(world, DT)
    assert world.poses[1, 2] == pytest.approx(0.25, abs=1e-4)


def test_stale_answers_wake_nobody() -> None:
    """A pair whose separation is NaN keeps its patch."""
    world = tower(Told).run(2.0, DT)
    pairs = pairs_of(world)
    contacts = ContactSolver().batch(world.poses, sizes=world.size, pairs=pairs)
    contacts.separation[:] = np.nan
    world.forces.hold(pairs, contacts, world.poses)
    assert asleep(World.step(world, DT)) == [2, 3, 4]

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Forces of contacts that are solved at each step: statics, impacts, bodies of several boxes."""
from __future__ import annotations

import copy
import math
from itertools import product

import numpy as np
import pytest
from worlds import CONTAINER, FIXED, FLOOR, STEP, World, turned

from box_contact_ros import Body, ContactSolver, PatchForces
from box_contact_ros.forces.patch_forces import GRAVITY
from box_contact_ros.solver.pose import rotation_matrix

# --- contacts of one's own ------------------------------------------------------------------------


def askew(count: int = 5, gap: float = 0.002) -> tuple[tuple, ...]:
    return (FLOOR, *(((1.0, 1.0, 1.0), 100.0, (0.05 * (k % 3), 0.03 * k, k + 0.5 + gap),
                      turned((0, 0, 1), 0.1 * k)) for k in range(count)))


def test_own_contacts_have_the_bits_of_answers_at_each_step() -> None:
    """Of boxes that touch: of those that fall, own contacts know more, the gap."""
    own, held = World(*askew(gap=-1e-4)), World(*askew(gap=-1e-4))
    pairs = np.array([(a, b) for a in range(6) for b in range(a + 1, 6)])
    for _ in range(200):
        held.forces.hold(pairs, ContactSolver().batch(held.poses, sizes=held.size, pairs=pairs),
                         held.poses)
        held.step()
        own.step()
    assert own.poses.tobytes() == held.poses.tobytes()


def test_a_late_list_of_pairs_does_no_harm() -> None:
    """A list at 50 Hz, 5 ms late, one of 20 lost, that has all pairs: impulses stay."""
    world, same = World(*askew()), World(*askew())
    pairs = [(k, k + 1) for k in range(5)]
    for tick in range(300):
        if tick % 20 == 5 and tick // 20 != 7:
            world.forces.hold(pairs)
        world.step()
        same.step()
    assert world.poses.tobytes() == same.poses.tobytes()


@pytest.mark.parametrize('height', [0.0, 1e6])
def test_a_tower_with_gaps_is_one_that_is_flush(height: float) -> None:
    """At 1/60 s, ten cubes and gaps of 1 nm, also at 1,000 km, where digits end at 0.1 nm.

    Without patches of gaps the top is 3.3 mm lower after half a second.
    """
    tops = []
    for gap in (0.0, 1e-9):
        world = World((FLOOR[0], 0.0, (height, 0, height - 0.5)),
                      *(((0.5, 0.5, 0.5), 50.0,
                         (height, 0, height + 0.5 * k + 0.25 + gap * (k + 1))) for k in range(10)))
        for _ in range(30):
            world.step(1 / 60)
        tops.append(world.poses[-1, 2] - height)
    assert tops[1] == pytest.approx(tops[0], abs=1e-4)


def test_a_copy_has_boxes_and_pairs() -> None:
    world = World(*askew()).run(0.1)
    twin = World(*askew())
    twin.forces = copy.copy(world.forces)
    twin.poses, twin.velocities = world.poses, world.velocities
    world.run(0.1), twin.run(0.1)
    assert world.poses.tobytes() == twin.poses.tobytes()
    for one, other in zip(world.forces.loads(), twin.forces.loads()):
        assert one.tobytes() == other.tobytes()


@pytest.mark.parametrize('own', [True, False])
def test_a_step_beyond_float64_names_the_body_and_changes_nothing(own: bool) -> None:
    rows = *askew(), ((1.0, 1.0, 1.0), 100.0, (9.0, 0, 0.501))
    world, twin = World(*rows).run(0.1), World(*rows).run(0.1)
    pairs = np.array([(a, b) for a in range(7) for b in range(a + 1, 7)])
    contacts = ContactSolver().batch(world.poses, sizes=world.size, pairs=pairs)
    for each in () if own else (world, twin):
        each.forces.hold(pairs, contacts, each.poses)
    poses, wild = world.poses.copy(), world.outside.copy()
    wild[6, 3:] = 1e100
    with pytest.raises(ValueError, match=r'^bodies\[6\]: in a step of 0.001 s its numbers leave'):
        world.forces.advance(STEP, world.poses, world.velocities, wild)
    assert np.array_equal(world.poses, poses)
    for one, two in zip(world.forces.loads(), twin.forces.loads()):
        assert one.tobytes() == two.tobytes()
    for each in (world, twin):
        each.run(0.02)
    assert world.poses.tobytes() == twin.poses.tobytes()


def test_a_step_that_is_refused_makes_no_island_finer() -> None:
    """Its weights are 30 times those that come later, and what is fine stays so for a second."""
    light = Body(mass=1.0, inertia=[1e-50] * 3)
    cube = (1.0, 1.0, 1.0)
    rows = [FLOOR, *((cube, mass, (x, 0, z))
                     for mass, x, z in ((10.0, 0, 0.5), (3e4, 0, 1.5), (1.0, 9, 50)))]
    world, twin = World(*rows), World(*rows)
    for each in (world, twin):
        each.forces.set_bodies([*each.bodies[:3], light])
    wild = world.outside.copy()
    wild[2], wild[3, 3:] = 30.0 * wild[2], 1e100
    with pytest.raises(ValueError, match=r'^bodies\[3\]'):
        world.forces.advance(1 / 60, world.poses, world.velocities, wild)
    for each in (world, twin):
        for _ in range(3):
            each.step(1 / 60)
    assert world.poses.tobytes() == twin.poses.tobytes()


@pytest.mark.parametrize('threads, seconds', [
    (5, 0.05), *(pytest.param(threads, 0.1, marks=pytest.mark.reports) for threads in (2, 5))])
def test_threads_change_no_bit(threads: int, seconds: float) -> None:
    places = [(k % 20 - 10, k // 20 % 30 - 15, 0.26 + 0.52 * (k // 600)) for k in range(1200)]
    rows = [FLOOR, *(((0.5, 0.5, 0.5), 50.0, place, turned((1, 1, 0), 0.01 * (k % 7)))
                     for k, place in enumerate(places))]
    pairs = [(0, k) for k in range(1, 601)] + [(k, k + 600) for k in range(1, 601)]
    found = []
    for count in (1, threads):
        world = World(*rows, pairs=pairs, threads=count)
        found.append(world.run(seconds).poses.tobytes())
    assert len(set(found)) == 1


# --- loads ----------------------------------------------------------------------------------------


def given(world: World) -> np.ndarray:
    """Return the forces (n, 3) that bodies get by the loads."""
    loads, total = world.forces.loads(), np.zeros((len(world.mass), 3))
    normals = np.cross(loads.corners[:, 0] - loads.corners[:, 1],
                       loads.corners[:, 1] - loads.corners[:, 2])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    upward = np.sign(normals[:, 2:])  # all boxes here lie on the box of the lower number
    force = loads.pressing[:, None] * upward * normals + loads.friction
    np.add.at(total, loads.pairs[:, 1], force)
    np.subtract.at(total, loads.pairs[:, 0], np.array(force))
    return total


def test_loads_change_the_momentum() -> None:
    """Change of linear momentum = dt · (outside + Σ loads), in each step of a landing."""
    world = World(*askew())
    for _ in range(300):
        before = world.velocities
        world.step()
        change = world.mass[1:, None] * (world.velocities - before)[1:, :3]
        expected = STEP * (world.outside[1:, :3] + given(world)[1:])
        assert np.abs(change - expected).max() <= 1e-12 * 100.0
    assert world.poses[-1, 2] == pytest.approx(4.5, abs=1e-3)


def test_wrenches_at_rest_are_the_loads() -> None:
    """To where the solver converges; what is laid down keeps what it carried then."""
    world = World(*askew(), rest=False).run(2.0)
    assert given(world)[1:] == pytest.approx(world.wrenches[1:, :3], abs=1e-9 * 500 * GRAVITY)
    assert given(world)[1:] == pytest.approx(-world.outside[1:, :3], abs=1e-6 * GRAVITY)
    assert given(world)[0] == pytest.approx([0, 0, -500.0 * GRAVITY], abs=1e-6 * GRAVITY)


def test_corner_loads_are_those_of_statics() -> None:
    """Of a container whose centre of mass is at 0.3 of the half length, -0.2 of the half width."""
    half = 0.5 * np.array(CONTAINER)
    centre = 0.3 * half[0], -0.2 * half[1], -0.1
    world = World(FLOOR, (CONTAINER, 20_000.0, (0, 0, half[2]), (0, 0, 0, 1), centre)).run(0.5)
    loads, weight = world.forces.loads(), 20_000.0 * GRAVITY
    assert loads.pairs.tolist() == [[0, 1]]
    assert loads.pressing == pytest.approx([weight], rel=1e-6)
    assert loads.centre[0, :2] == pytest.approx(centre[:2], abs=1e-6 * half[0])
    for corner, load in zip(loads.corners[0], loads.corner_loads[0]):
        assert np.abs(corner[:2]) == pytest.approx(half[:2], rel=1e-6)
        x, y = np.sign(corner[:2])
        assert load == pytest.approx(0.25 * weight * (1 + 0.3 * x) * (1 - 0.2 * y), rel=1e-6)


def test_nothing_presses_before_the_landing() -> None:
    world = World(FLOOR, ((1.0, 1.0, 1.0), 10.0, (0, 0, 0.501))).step()
    assert len(world.forces.loads().pairs) == 0
    world.run(0.02)
    assert (world.forces.loads().corner_loads >= 0.0).all()


# --- bodies of several boxes ----------------------------------------------------------------------


def test_a_body_equals_itself_alone() -> None:
    """Its fields may be arrays, which are not compared."""
    one, other = (Body.of_box((1, 1, 1), 1.0) for _ in range(2))
    assert one == one and one != other and len({one, other}) == 2


def test_two_feet_stand_on_a_floor() -> None:
    """A table of 100 kg. Its feet carry the weight, and its middle is between them."""
    forces = PatchForces([FIXED, Body(mass=100.0, inertia=(30.0, 30.0, 30.0), centre=(0, 0, 0.3))])
    forces.set_boxes([FLOOR[0], (0.2, 1.0, 0.4), (0.2, 1.0, 0.4), (1.4, 1.0, 0.1)],
                     body=[0, 1, 1, 1],
                     poses=[(0, 0, 0, 0, 0, 0, 1), (-0.6, 0, 0.2, 0, 0, 0, 1),
                            (0.6, 0, 0.2, 0, 0, 0, 1), (0, 0, 0.45, 0, 0, 0, 1)])
    forces.hold([(0, 1), (0, 2), (0, 3)])
    poses = np.array([[*FLOOR[2], 0, 0, 0, 1], [0, 0, 0.002, 0, 0, 0, 1]])
    velocities, outside = np.zeros((2, 2, 6))
    outside[1, 2] = -100.0 * GRAVITY
    for _ in range(500):
        poses, velocities, *_ = forces.advance(STEP, poses, velocities, outside)
    assert poses[1] == pytest.approx([0, 0, 0, 0, 0, 0, 1], abs=1e-5)
    assert np.abs(velocities).max() < 1e-9
    loads = forces.loads()
    assert loads.pairs.tolist() == [[0, 1], [0, 2]]
    assert loads.pressing.sum() == pytest.approx(100.0 * GRAVITY, rel=1e-6)
    assert abs(loads.pressing @ loads.centre[:, 0]) < 1e-5 * GRAVITY
    with pytest.raises(ValueError, match=r'pairs\[0\]: both boxes are of body 1'):
        forces.hold([(1, 3)])
    for times in ({'age': 0.1}, {'period': 0.1}, {'poses': poses}):
        with pytest.raises(ValueError, match='^contacts must be those of'):
            forces.hold([(0, 1)], **times)


def test_a_late_answer_may_tell_of_boxes_that_were_joined_since() -> None:
    """Their contact is passed over, and the others are taken."""
    cube, pairs = (1.0, 1.0, 1.0), np.array([(0, 1), (1, 2)])
    upright = [(0, 0, z, 0, 0, 0, 1) for z in (-0.4999, 0.5, 1.4999)]
    contacts = ContactSolver().batch(np.array(upright, float), sizes=np.full((3, 3), 1.0),
                                     pairs=pairs)
    forces = PatchForces([FIXED, Body.of_box((1, 1, 2), 10.0)])
    forces.set_boxes([cube] * 3, body=[0, 1, 1], poses=[upright[0], (0, 0, -0.5, 0, 0, 0, 1),
                                                        (0, 0, 0.5, 0, 0, 0, 1)])
    poses = np.array([[0, 0, 0, 0, 0, 0, 1.0], [0, 0, 1.0, 0, 0, 0, 1]])
    forces.hold(pairs, contacts, poses)
    forces.advance(STEP, poses, np.zeros((2, 6)))
    assert forces.loads().pairs.tolist() == [[0, 1]]
    with pytest.raises(ValueError, match=r'pairs\[0\]: both boxes are of body 1'):
        forces.hold(np.array([(1, 1), (0, 1)]), contacts, poses)


def test_contacts_of_the_reversed_pair_are_refused() -> None:
    """A cube lies on a plate; reversed, the plate would be pushed up into it, without a word."""
    size = np.array([(1.0, 1, 1), (4, 4, 1)])
    poses = np.array([[0, 0, 0.9999, 0, 0, 0, 1.0], [0, 0, 0, 0, 0, 0, 1]])
    contacts = ContactSolver().batch(poses, sizes=size, pairs=[(0, 1)])
    forces = PatchForces([Body.of_box(each, 5.0) for each in size])
    forces.set_boxes(size)
    with pytest.raises(ValueError, match=r'^pairs\[0\] is \(1, 0\), but normal\[0\] \(0, 0, -1\)'):
        forces.hold([(1, 0)], contacts, poses)
    forces.hold([(0, 1)], contacts, poses)


def test_a_body_of_boxes_has_their_moments() -> None:
    """A container of eight octants, one turned by a right angle, is one box of the same density."""
    whole, size = Body.of_box(CONTAINER, 20_000.0), 0.5 * np.array(CONTAINER)
    poses = np.array([[*(0.5 * size * signs), 0, 0, 0, 1] for signs in product((-1, 1), repeat=3)])
    sizes, quarter = np.tile(size, (8, 1)), math.sqrt(0.5)
    sizes[0], poses[0, 3:] = size[[1, 0, 2]], (0, 0, quarter, quarter)
    poses[:, 0] += 0.7
    body, own_poses, turn = Body.of_boxes(sizes, poses, [2500.0] * 8)
    assert np.array_equal(own_poses, poses) and turn.tolist() == [0, 0, 0, 1]
    assert body.mass == whole.mass and body.inertia == pytest.approx(whole.inertia, rel=1e-12)
    assert body.centre == pytest.approx([0.7, 0, 0], abs=1e-12)


def gallows() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return sizes, poses and masses of a base, a post beside its middle, and an arm."""
    return (np.array([(2, 1, 0.2), (0.2, 0.3, 2), (1.2, 0.2, 0.2)]),
            np.array([[0.1, 0, 0.1, 0, 0, 0, 1], [-0.5, 0.2, 1.2, 0, 0, 0, 1],
                      [0.2, 0.2, 2.3, *turned((0, 0, 1), 0.3)]]), np.array([80.0, 30.0, 15.0]))


def test_a_body_that_is_lopsided_gets_principal_axes() -> None:
    """Turned back, its moments are those of small cubes, and its boxes are where they were."""
    sizes, poses, masses = gallows()
    body, own, turn = Body.of_boxes(sizes, poses, masses)
    axes = rotation_matrix(turn)
    steps = (np.arange(24) + 0.5) / 24 - 0.5
    grid, moments = np.array(list(product(steps, repeat=3))), np.zeros((3, 3))
    for size, pose, mass in zip(sizes, poses, masses):
        arms = (grid * size) @ rotation_matrix(pose[3:]).T + pose[:3] - axes @ body.centre
        moments += mass / len(grid) * ((arms**2).sum() * np.eye(3) - arms.T @ arms)
    assert axes @ np.diag(body.inertia) @ axes.T == pytest.approx(moments, abs=2e-3 * moments.max())
    assert own[:, :3] @ axes.T == pytest.approx(poses[:, :3], abs=1e-12)
    for row, pose in zip(own, poses):
        back = axes @ rotation_matrix(row[3:])
        assert back == pytest.approx(rotation_matrix(pose[3:]), abs=1e-12)
    assert 0.9 < turn[3] < 1.0


def test_a_gallows_stands() -> None:
    """For 2 s at 1/60 s; its base carries all, with the centre of pressure below that of mass."""
    sizes, poses, masses = gallows()
    body, own, turn = Body.of_boxes(sizes, poses, masses)
    forces = PatchForces([FIXED, body])
    forces.set_boxes([FLOOR[0], *sizes], body=[0, 1, 1, 1], poses=[(0, 0, 0, 0, 0, 0, 1), *own])
    forces.hold([(0, 1), (0, 2), (0, 3)])
    at = np.array([[*FLOOR[2], 0, 0, 0, 1], [0, 0, 0, *turn]])
    velocities, outside = np.zeros((2, 2, 6))
    outside[1, 2] = -GRAVITY * body.mass
    for _ in range(120):
        at, velocities, *_ = forces.advance(1 / 60, at, velocities, outside)
    loads, middle = forces.loads(), masses @ poses[:, :3] / masses.sum()
    assert np.abs(at[1, :3]).max() < 1e-3 and np.abs(velocities).max() < 1e-4
    assert loads.pressing == pytest.approx([GRAVITY * body.mass], rel=1e-4)
    assert loads.centre[0, :2] == pytest.approx(middle[:2], abs=1e-3)


def test_two_boxes_land_as_one() -> None:
    """A container of two boxes, one upon the other, and one box of the same mass and shape."""
    half = np.array(CONTAINER) * (1, 1, 0.5)
    lower, upper = ((0, 0, z * CONTAINER[2], 0, 0, 0, 1) for z in (-0.25, 0.25))
    found = []
    for boxes in ([(CONTAINER, (0, 0, 0, 0, 0, 0, 1))], [(half, lower), (half, upper)]):
        forces = PatchForces([FIXED, Body.of_box(CONTAINER, 20_000.0)])
        n = len(boxes)
        forces.set_boxes([FLOOR[0], *(size for size, _ in boxes)], body=[0] + [1] * n,
                         poses=[(0, 0, 0, 0, 0, 0, 1), *(pose for _, pose in boxes)])
        forces.hold([(0, k + 1) for k in range(n)])
        poses = np.array([[*FLOOR[2], 0, 0, 0, 1], [0, 0, 1.38, 0.01, 0.005, 0.1, 1]])
        velocities, outside = np.zeros((2, 2, 6))
        outside[1, 2] = -20_000.0 * GRAVITY
        for _ in range(1000):
            poses, velocities, *_ = forces.advance(STEP, poses, velocities, outside)
        found.append(poses[1])
        assert poses[1, 2] == pytest.approx(0.5 * CONTAINER[2], abs=1e-4)
    assert found[0] == pytest.approx(found[1], abs=1e-6)


# --- heavy on light -------------------------------------------------------------------------------


def on_a_kilogram(mass: float, **options) -> World:
    """Return a cube of a mass on a plate of 1 kg on the floor."""
    return World(FLOOR, ((0.5, 0.5, 0.1), 1.0, (0, 0, 0.05)),
                 ((1.0, 1.0, 1.0), mass, (0, 0, 0.6)), **options)


@pytest.mark.parametrize('mass', [70.0, 100.0, 300.0, 3000.0])
def test_a_load_on_a_kilogram_sinks_by_less_than_a_millimetre(mass: float) -> None:
    """At 1/60 s, `most_depth`, of each of both patches; from 61 kg on sub-steps are shorter."""
    world = on_a_kilogram(mass)
    world.run(3.0, 1 / 60)
    assert 0.05 - world.poses[1, 2] < 1e-3
    assert world.poses[1, 2] + 0.55 - world.poses[2, 2] < 1e-3


def test_what_is_relieved_of_a_load_rests_as_if_it_had_never_borne_it() -> None:
    """At 1/60 s, 0.4·g·sub-step² deep: within seconds its sub-steps are no shorter any more.

    It sinks softly meanwhile, by 3 % of that depth in a step: at once, a pile would slide.
    """
    world = on_a_kilogram(100.0, rest=False)
    world.run(2.0, 1 / 60)
    borne = 0.05 - world.poses[1, 2]
    world.poses[2, 0] = 3.0
    world.run(0.5, 1 / 60)
    heights = [world.step(1 / 60).poses[1, 2] for _ in range(330)]
    assert borne > 1e-4
    depth = GRAVITY / (1.57 * 240)**2
    assert 0.05 - heights[-1] == pytest.approx(depth, rel=1e-3)
    assert max(-np.diff(heights)) == pytest.approx(0.03 * depth, rel=0.1)


def test_what_rests_keeps_short_sub_steps() -> None:
    """It is nudged again and again: longer ones would let it sink."""
    world = on_a_kilogram(100.0).run(2.0, 1 / 60)
    world.poses = world.poses.copy()
    world.poses[2, 0] = 3.0
    world.run(1.0, 1 / 60)
    height = world.poses[1, 2]
    for _ in range(4):
        assert not world.awake.any()
        world.outside[1, 2] -= 1e-9
        world.run(1.0, 1 / 60)
    assert world.poses[1, 2] == pytest.approx(height, abs=1e-8)


def test_what_is_forgotten_takes_long_sub_steps_at_once() -> None:
    """A box that bore 100 times its mass: elsewhere, after 0.5 s, it is as deep as one alone."""
    world = on_a_kilogram(100.0, rest=False)
    world.run(2.0, 1 / 60)
    world.poses[1] = (3.0, 0, 0.05, 0, 0, 0, 1)
    world.velocities[1] = 0.0
    world.forces.forget([1])
    world.run(0.5, 1 / 60)
    assert 0.05 - world.poses[1, 2] == pytest.approx(GRAVITY / (1.57 * 240)**2, rel=1e-2)


def test_a_cube_of_8000_times_the_mass_rests_on_four() -> None:
    """Of 20 m, on four of 1 m: less than 2 mm deep."""
    corners = [(x, y, 0.5) for x in (-9.0, 9.0) for y in (-9.0, 9.0)]
    world = World(FLOOR, *(((1.0, 1.0, 1.0), 1000.0, corner) for corner in corners),
                  ((20.0, 20.0, 20.0), 8e6, (0, 0, 11.0)))
    deepest = 0.0
    for _ in range(3000):
        world.step()
        deepest = max(deepest, 11.0 - world.poses[5, 2], *(0.5 - world.poses[1:5, 2]))
    assert deepest < 2e-3
    assert np.abs(world.velocities).max() < 1e-6


def test_containers_rest_on_loose_twist_locks() -> None:
    """25 t on four locks of 5 kg, which lie on another: less than 2 mm deep."""
    lock, height = (0.12, 0.08, 0.03), CONTAINER[2]
    corners = [(x, y) for x in (-5.9, 5.9) for y in (-1.1, 1.1)]
    world = World(FLOOR, (CONTAINER, 25_000.0, (0, 0, 0.5 * height)),
                  *((lock, 5.0, (*corner, height + 0.015)) for corner in corners),
                  (CONTAINER, 25_000.0, (0, 0, 1.5 * height + 0.03)))
    deepest = 0.0
    for _ in range(3000):
        world.step()
        deepest = max(deepest, 1.5 * height + 0.03 - world.poses[-1, 2])
    assert deepest < 2e-3
    assert np.abs(world.velocities).max() < 1e-6


# --- analytic truths ------------------------------------------------------------------------------


def test_a_flush_pallet_stands_still() -> None:
    """Of 48 boxes of 0.2 to 100 kg, at 1/60 s: awake, none moves by 1 µm from 1 to 8 s."""
    rng = np.random.default_rng(1)
    cells = list(product(range(4), range(3), range(4)))
    world = World(((4.0, 4.0, 1.0), 0.0, (0, 0, -0.5)), *(
        ((0.4, 0.3, 0.25), 10.0 ** rng.uniform(-0.7, 2.0),
         ((i - 1) * 0.4, (j - 1.5) * 0.3, 0.125 + 0.25 * layer)) for layer, i, j in cells),
        pairs=[(a, b) for b in range(49) for a in range(b) if a == 0 or np.abs(
            np.subtract(cells[a - 1], cells[b - 1])).max() <= 1], rest=False)
    start = world.run(1.0, 1 / 60).poses
    assert np.abs(world.run(7.0, 1 / 60).poses - start).max() < 1e-6


@pytest.mark.parametrize(('share', 'tips'), [(0.98, False), (1.17, True)])
def test_the_angle_at_which_a_box_tips(share: float, tips: bool) -> None:
    """A box of 1 × 1 × 3 m on a slope tips beyond tan = 1/3, with friction enough.

    It may stay up to 1.15 times that: the rectangle of a wedge reaches so far beyond the rim.
    """
    angle = math.atan(share / 3.0)
    turn = turned((0, 1, 0), angle)
    up = rotation_matrix(turn)[:, 2]
    world = World(((20.0, 20.0, 1.0), 0.0, -0.5 * up, turn),
                  ((1.0, 1.0, 3.0), 100.0, 1.5 * up, turn))
    world.run(3.0)
    leaning = math.acos(min(1.0, rotation_matrix(world.poses[1, 3:])[:, 2] @ up))
    assert (leaning > 0.1) == tips
    assert tips or leaning < 1e-3


def test_the_impact_of_two_equal_boxes() -> None:
    """They go on together at half the speed, in free space."""
    world = World(((1.0, 1.0, 1.0), 10.0, (0, 0, 0)), ((1.0, 1.0, 1.0), 10.0, (1.05, 0, 0)))
    world.outside[:] = 0.0
    world.velocities[0, 0] = 1.0
    world.run(0.3)
    assert world.velocities[:, 0] == pytest.approx([0.5, 0.5], abs=1e-9)
    assert world.poses[1, 0] - world.poses[0, 0] == pytest.approx(1.0, abs=1e-3)

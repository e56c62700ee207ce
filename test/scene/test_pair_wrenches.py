# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Wrenches of pairs: those of one law of all bodies, told apart; velocities from stamped poses."""
from __future__ import annotations

import math

import numpy as np
import pytest
from poses import unit_quaternions

from box_contact_ros import Body, Box, Contact, Pair, PatchLaw, Scene, SceneSolver
from box_contact_ros.core import native
from box_contact_ros.scene.force.pair_wrenches import PairWrenches, velocity_between
from box_contact_ros.scene.pose import quaternion_multiply
from box_contact_ros.scene.stamp_pairing import NEVER, StampedPose

RATE, MASS = 200.0, 20_000.0
PERIOD = round(1e9 / RATE)
SIZE = (12.192, 2.438, 2.591)
FLOOR = Box('floor', (40.0, 40.0, 1.0), (0, 0, -0.5, 0, 0, 0, 1))
WEIGHT = 9.81 * MASS
HELD_WRENCH = 1  # `bc_use` of force.h


def scene_of(*boxes, pairs, **options):
    return Scene({box.name: box for box in boxes},
                 tuple(Pair.between(*pair) for pair in pairs), **options)


def load(name='load', mass=MASS):
    return Box(name, SIZE, pose_topic=f'{name}/pose', mass=mass)


LOAD_ON_FLOOR = scene_of(load(), FLOOR, pairs=[('load', 'floor')])


class Loop:
    """Asks solver and law together, tick by tick."""

    def __init__(self, scene, **options):
        self.solver = SceneSolver(scene, model='exact')
        self.law = PairWrenches(scene, rate_hz=RATE, **options)

    def ask(self, stamp, *poses):
        """Return wrenches by the names of their pairs, and the answer."""
        tick = [None if pose is None else StampedPose(np.array(pose, dtype=float), 'map', stamp)
                for pose in poses]
        answer = self.solver([pose and pose.numbers for pose in tick])
        return {pair.label: wrench for pair, wrench in self.law(answer, tick)}, answer


def level(x=0.0, y=0.0, z=0.5 * SIZE[2] - 1e-3):
    return np.array([x, y, z, 0.0, 0.0, 0.0, 1.0])


@pytest.mark.parametrize('side', ['a', 'b'])
def test_one_load_has_the_wrench_of_its_law(side):
    """Tick by tick that of `PatchLaw` at the same poses, with the velocities between them.

    As box A, or as box B of its pair: on A then acts the reaction, about the middle of A.
    """
    pair = ('load', 'floor') if side == 'a' else ('floor', 'load')
    loop = Loop(scene_of(load(), FLOOR, pairs=[pair]), latency=0.002, friction=0.3)
    law = PatchLaw.for_loop(Body.of_box(SIZE, MASS), rate_hz=RATE, latency=0.002 + 0.5 / RATE,
                            friction=0.3)
    before = None
    for tick in range(6):
        angle = 1e-4 * tick
        pose = level(x=2e-3 * tick, z=0.5 * SIZE[2] - 1e-3 - 2e-4 * tick)
        pose[3:] = math.sin(angle), 0.0, 0.0, math.cos(angle)
        velocity = np.zeros(6) if before is None else RATE * np.array(
            [*(pose - before)[:3], 2e-4, 0.0, 0.0])
        wrenches, answer = loop.ask(tick * PERIOD, pose)
        (_, contact), = answer.touching
        expected = law.wrench(contact, pose, velocity, load=side)
        if side == 'b':
            arm = pose[:3] - np.array(FLOOR.pose[:3])
            expected = -np.append(expected[:3], expected[3:] + np.cross(arm, expected[:3]))
        assert next(iter(wrenches.values())) == pytest.approx(expected, rel=1e-6, abs=1e-3)
        before = pose
    assert abs(expected[0]) > 1e3  # friction is in it


def test_wrenches_add_up_to_those_of_one_law_of_all_bodies():
    """Crates on each other, on a floor and beside a wall that is pushed: 7 pairs of 4 bodies."""
    rng = np.random.default_rng(3)
    crates = [Box(f'c{n}', (1.0, 1.0, 1.0), pose_topic=f'c{n}/pose', mass=100.0 * (n + 1))
              for n in range(4)]
    wall = Box('wall', (1.0, 4.0, 4.0), pose_topic='wall/pose')
    pairs = [('c0', 'floor'), ('floor', 'c1'), ('c2', 'c0'), ('c1', 'c2'), ('c3', 'c2'),
             ('wall', 'c0'), ('c0', 'c1')]
    scene = scene_of(*crates, wall, FLOOR, pairs=pairs)
    loop = Loop(scene)
    bodies = [Body.of_box(scene.boxes[name].size, scene.boxes[name].mass)
              for name in scene.moving]
    whole = native.Law(np.array([b.mass for b in bodies]), np.array([b.inertia for b in bodies]),
                       np.zeros((5, 3)), HELD_WRENCH, RATE, 0.5 / RATE, 1.0 / RATE, 0.5, 9.81)
    where = np.array([level(0, 0, .499), level(.999, 0, .498), level(.5, 0, 1.497),
                      level(.7, .2, 2.495), level(-.998, 0, 1)])
    place = {name: n for n, name in enumerate(scene.moving)}
    before = None
    for tick in range(5):
        poses = where.copy()
        if tick:
            poses[:, :3] += 2e-5 * rng.normal(size=(5, 3))
            poses[:, 3:6] = 1e-5 * rng.normal(size=(5, 3))
        wrenches, answer = loop.ask(tick * PERIOD, *poses)
        assert len(answer.touching) == len(pairs)
        velocities = np.zeros((5, 6)) if before is None else np.array(
            [velocity_between(one, other, 1.0 / RATE) for one, other in zip(before, poses)])
        whole.hold([(pair.id, place.get(pair.a, -1), place.get(pair.b, -1), contact)
                    for pair, contact in answer.touching], poses)
        total = np.zeros((5, 6))
        for pair in scene.pairs:
            force, torque = np.split(wrenches[pair.label], 2)
            middle = poses[place[pair.a], :3] if pair.a in place else np.array(FLOOR.pose[:3])
            for name, sign in ((pair.a, 1.0), (pair.b, -1.0)):
                if name in place:
                    arm = middle - poses[place[name], :3]
                    total[place[name]] += sign * np.append(force, torque + np.cross(arm, force))
        expected = whole.wrenches(poses, velocities)
        assert total == pytest.approx(expected, rel=1e-7, abs=1e-6 * np.abs(expected).max())
        before = poses


def test_apart_is_zero_and_stale_is_nothing():
    """A pair apart acts with nothing; of one that was not evaluated nothing is known."""
    scene = scene_of(load(), load('other', mass=0.0), FLOOR,
                     pairs=[('load', 'floor'), ('load', 'other'), ('other', 'floor')])
    loop = Loop(scene)
    wrenches, _ = loop.ask(0, level(), level(z=9.0))
    assert set(wrenches) == {'load_floor', 'load_other'}  # the other one has no mass
    assert wrenches['load_floor'][2] > 0.0 and not wrenches['load_other'].any()
    wrenches, _ = loop.ask(PERIOD, level(), None)
    assert set(wrenches) == {'load_floor'}
    assert not loop.ask(2 * PERIOD, level(z=9.0), None)[0]['load_floor'].any()


def sliding(loop, ticks, start=0, skip=0, step=1e-4):
    """Slide the load by 0.1 mm a tick; return the friction of the last tick [N]."""
    for tick in range(ticks):
        stamp = start + (tick + (skip if tick == ticks - 1 else 0)) * PERIOD
        wrenches, _ = loop.ask(stamp, level(x=step * tick))
    return abs(wrenches['load_floor'][0])


def test_a_gap_is_a_new_start_and_a_lost_pose_is_none():
    """After more than ten periods, or after `reset`, there is neither velocity nor friction."""
    steady = sliding(Loop(LOAD_ON_FLOOR), 5)
    assert steady > 1e3
    assert sliding(Loop(LOAD_ON_FLOOR), 5, skip=1) > 0.5 * steady
    assert sliding(Loop(LOAD_ON_FLOOR), 5, skip=9) > 0.2 * steady
    assert sliding(Loop(LOAD_ON_FLOOR), 5, skip=10) < 1e-6 * steady
    loop = Loop(LOAD_ON_FLOOR)
    sliding(loop, 5, start=10**12)
    assert loop.ask(0, level())[0] == {}  # a late tick: what acts is newer
    loop.law.reset()
    first, _ = loop.ask(0, level(x=1.0))
    assert abs(first['load_floor'][0]) < 1e-6 * steady
    assert first['load_floor'][2] > 0.1 * WEIGHT


def test_a_box_that_was_away_comes_back_without_velocity():
    loop = Loop(LOAD_ON_FLOOR)
    sliding(loop, 3)
    assert loop.ask(3 * PERIOD, None)[0] == {}
    after, _ = loop.ask(20 * PERIOD, level(x=1.0))
    assert abs(after['load_floor'][0]) < 1e-3


@pytest.mark.parametrize('array', [False, True])
def test_poses_come_alone_or_as_an_array(array):
    """The same wrenches; a row of NaN is a box that is not there."""
    boxes = [Box('load', SIZE, pose_topic='' if array else 'load/pose', mass=MASS),
             Box('other', SIZE, pose_topic='' if array else 'other/pose')]
    scene = scene_of(*boxes, pairs=[('load', 'other')], pose_array=array)
    loop = Loop(scene)
    found = []
    for tick in range(4):
        poses = np.array([level(x=1e-4 * tick, z=SIZE[2] - 2e-3), level(z=0.0)])
        if tick == 3:
            poses[1] = np.nan
        if array:
            stamped = [StampedPose(poses, 'map', tick * PERIOD)]
            answer = loop.solver(poses)
        else:
            stamped = [None if np.isnan(pose[0]) else StampedPose(pose, 'map', tick * PERIOD)
                       for pose in poses]
            answer = loop.solver([pose and pose.numbers for pose in stamped])
        found.append([wrench.tolist() for _, wrench in loop.law(answer, stamped)])
    assert [len(wrenches) for wrenches in found] == [1, 1, 1, 0]
    assert found[2][0][0] < -1e3 and found[2][0][2] > 0.1 * WEIGHT


def test_a_frame_that_never_moves_has_no_velocity():
    """Of static transforms alone: its pose holds at all stamps."""
    scene = scene_of(load(), load('other', mass=0.0), pairs=[('load', 'other')])
    solver, law = SceneSolver(scene, model='exact'), PairWrenches(scene, rate_hz=RATE)
    for tick in range(3):
        poses = [level(x=1e-4 * tick, z=SIZE[2] - 2e-3), level(z=0.0)]
        (_, wrench), = law(solver(poses), [StampedPose(poses[0], 'map', tick * PERIOD),
                                           StampedPose(poses[1], 'map', NEVER)])
    assert wrench[0] < -1e3


@pytest.mark.parametrize('length', [1.0, 1e-3, 30.0, 1e-99, 1e99])
def test_velocities_are_those_between_two_poses(length):
    """Of a constant rotation about any axis, for quaternions of any length and either sign."""
    rng = np.random.default_rng(2)
    for angle in (0.0, 1e-9, 1e-3, 1.0, 3.0):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        one = np.append(rng.normal(size=3), unit_quaternions(rng, 1)[0])
        turn = np.append(math.sin(0.5 * angle) * axis, math.cos(0.5 * angle))
        other = np.append(one[:3] + [0.1, 0.2, 0.3],
                          -length * quaternion_multiply(turn, one[3:]))
        velocity = velocity_between(one, other, 0.01)
        assert velocity[:3] == pytest.approx([10.0, 20.0, 30.0])
        assert velocity[3:] == pytest.approx(100.0 * angle * axis, rel=1e-6, abs=1e-12)


def test_a_scene_without_masses_is_refused():
    with pytest.raises(ValueError, match='no box has a mass'):
        PairWrenches(scene_of(load(mass=0.0), FLOOR, pairs=[('load', 'floor')]), rate_hz=RATE)


def test_a_contact_without_a_patch_is_refused():
    """By the law itself; the node refuses such models at its start."""
    law = PairWrenches(LOAD_ON_FLOOR, rate_hz=RATE)
    solver = SceneSolver(LOAD_ON_FLOOR, model='exact')
    (pair, contact), = solver([level()]).touching
    bare = Contact(*contact[:4], math.nan, np.full((3, 3), math.nan))
    answer = solver([level()])._replace(touching=[(pair, bare)])
    with pytest.raises(ValueError, match='needs volume and covariance'):
        law(answer, [StampedPose(level(), 'map', 0)])
    assert SceneSolver(LOAD_ON_FLOOR, model='mlp').gives_patch


@pytest.mark.parametrize('supports', [1, 4, 15])
@pytest.mark.parametrize('rate, latency', [(50.0, 0.0), (200.0, 0.002), (1000.0, 0.002)])
def test_a_load_comes_to_rest_on_any_number_of_boxes(supports, rate, latency):
    """Each pair's wrench alone is as stiff as the loop bears; 15 of them diverged in a second.

    A load that can only move up and down and roll, dropped by 20 mm and tilted by half a degree.
    """
    places = {1: [(0, 0)], 4: [(x, y) for x in (-5, 5) for y in (-1, 1)],
              15: [(x, y) for x in (-5, -2.5, 0, 2.5, 5) for y in (-1, 0, 1)]}[supports]
    size = (*SIZE[:2], 1.0) if supports == 1 else (1.0, 0.5, 1.0)
    posts = [Box(f'p{n}', size, (x, y, -0.5, 0, 0, 0, 1)) for n, (x, y) in enumerate(places)]
    scene = scene_of(load(), *posts, pairs=[('load', post.name) for post in posts])
    solver = SceneSolver(scene, model='exact')
    law = PairWrenches(scene, rate_hz=rate, latency=latency, friction=0.0)
    inertia = Body.of_box(SIZE, MASS).inertia[0]
    step, steps, late = 1e-3, round(1e3 / rate), round(1e3 * latency)
    height, speed, angle, spin = 0.5 * SIZE[2] + 0.03, 0.0, math.radians(0.5), 0.0
    wrenches, fastest = [np.zeros(6)] * (late + 1), 0.0
    for n in range(round(4.0 / step)):
        if n % steps == 0:
            pose = np.array([0, 0, height, math.sin(angle / 2), 0, 0, math.cos(angle / 2)])
            tick = [StampedPose(pose, 'map', round(1e9 * n * step))]
            newest = sum(wrench for _, wrench in law(solver([pose]), tick))
        wrenches = [*wrenches[1:], newest]
        speed += step * (wrenches[0][2] / MASS - 9.81)
        spin += step * wrenches[0][3] / inertia
        height, angle = height + step * speed, angle + step * spin
        if n * step > 3.0:
            fastest = max(fastest, abs(speed), abs(spin))
    assert fastest < 1e-3 and abs(angle) < 1e-3
    frequency = min(0.45 / (1.0 / rate + latency), 140.0)  # of the law [1/s]
    assert 0.0 < 0.5 * SIZE[2] - height < 2.0 * 9.81 / frequency**2

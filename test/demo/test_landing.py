# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Landings without ROS: held patches bring the load to rest, also late, and with answers lost."""
from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

pytest.importorskip('mujoco')

from box_contact_ros import Body, Contact, ContactSolver
from box_contact_ros.demo.crane import CraneScenario
from box_contact_ros.demo.landing import (
    CORNER_SPEED_LIMIT,
    ClosedLoop,
    Landing,
    LandingRecord,
    LoadForces,
    with_patch,
)
from box_contact_ros.forces.patch_forces import GRAVITY

pytestmark = pytest.mark.reports

HARD = CraneScenario(rope_angle=3.0, rope_heading=100.0, pitch=2.0, roll=-2.0, yaw=1.0,
                     offset=(0.2, 0.4))
"""A landing at the ends of what is asked for."""


def landed(scenario, *, rate_hz=200.0, latency=0.002, lost=0.0, model='exact'):
    """Return what is measured of a landing by a model's contacts, of which a share gets lost."""
    solver = ContactSolver(scenario.size, scenario.stack_size, model=model)
    random, loop = np.random.default_rng(2), ClosedLoop(scenario, rate_hz)
    while not loop.record.ended:
        state = loop.ask()
        if random.random() >= lost:
            contact = solver(state.pose, scenario.stack_pose)
            loop.answer(state, {'pair': contact}, latency=latency)
        loop.step()
    return loop.record.judge()


@pytest.mark.parametrize(('rate_hz', 'latency', 'tilt'), [
    (50.0, 0.005, 0.06), (200.0, 0.002, 0.01)])
def test_the_held_patch_lands_flat_and_still(rate_hz, latency, tilt):
    """A load at 3° of rope and 3° of tilt; at rest it lies flatter the more often contacts come."""
    result = landed(HARD, rate_hz=rate_hz, latency=latency)
    assert result.at_rest, f'\n{result}'
    assert result.corner_speed <= 1e-7 and result.depth <= 3e-3
    assert math.degrees(result.static_tilt) <= tilt


def test_a_load_that_hangs_over_too_far_falls():
    """Its middle is beyond the stack's edge: it tips off until the ropes hold it again."""
    scenario = CraneScenario(rope_angle=0.0, pitch=0.0, roll=0.0, yaw=0.0, offset=(0.0, 1.35))
    result = landed(scenario)
    assert not result.at_rest and 'ropes slack' in result.missed
    assert result.static_tilt > math.radians(5.0)


def test_lost_answers_are_bridged_by_the_patches_that_are_held():
    """With every tenth answer lost at random, all limits are met."""
    result = landed(HARD, latency=0.005, lost=0.1)
    assert result.at_rest and result.corner_speed < 1e-7, f'\n{result}'


def test_one_late_answer_is_forgotten():
    """Half a second after the touch, one is 50 ms late: the load rests flat and not deep."""
    scenario = CraneScenario()
    solver = ContactSolver(scenario.size, scenario.stack_size, model='exact')
    loop, came = ClosedLoop(scenario, 200.0), 0.0
    while not loop.record.ended:
        state = loop.ask()
        came = max(came, state.time + (0.05 if state.tick == 1500 else 0.001))
        loop.answer(state, {'pair': solver(state.pose, scenario.stack_pose)},
                    latency=came - state.time)
        loop.step()
    result = loop.record.judge()
    assert result.at_rest and result.corner_speed < 1e-7, f'\n{result}'
    assert -1e-4 < loop.record.separations()[-1] < 0.0


def test_an_answer_acts_from_its_time_on():
    """It is held with the pose for which it was asked, and the next takes its place."""
    held = []

    class Forces:
        def hold(self, contacts, pose, *, age):
            held.append((len(times), contacts, pose))
            ages.append(age)

        def wrench(self, pose, velocity):
            times.append(loop.crane.time)
            return np.zeros(6)

    times, ages = [], []
    loop = ClosedLoop(HARD, 200.0)
    loop.forces = Forces()
    asked = []
    for latency in (0.002, 0.006, 0.001, 0.0):
        asked.append(loop.ask())
        loop.answer(asked[-1], {}, latency=latency)
        loop.step()
    # Ten physics steps of 0.5 ms per tick: 2 ms are 4 steps, 6 ms reach into the next tick.
    assert [step for step, _, _ in held] == [4, 22, 22, 30]
    assert ages == pytest.approx([0.002, 0.006, 0.001, 0.0], abs=1e-9)
    assert [pose.tolist() for _, _, pose in held] == [state.pose.tolist() for state in asked]


def test_the_patch_of_a_flat_load_is_that_of_the_whole_load():
    """Where the bottom lies flat, the patch that is assumed without one is the exact one."""
    turn = (0.0, 0.0, math.sin(0.2), math.cos(0.2))
    load, stack = (12.0, 2.0, 3.0), (20.0, 20.0, 1.0)
    pose = np.array([1.0, 2.0, 1.98, *turn])
    exact = ContactSolver(load, stack, model='exact')(pose, (0, 0, 0, 0, 0, 0, 1))
    alone = Contact(exact.colliding, exact.separation, exact.normal, exact.point, math.nan,
                    np.full((3, 3), math.nan))
    assumed = with_patch(alone, pose, load)
    assert with_patch(exact, pose, load) is exact
    assert assumed.volume == pytest.approx(exact.volume) == pytest.approx(12.0 * 2.0 * 0.02)
    assert assumed.covariance[:2, :2] == pytest.approx(exact.covariance[:2, :2])
    wrenches = []
    for contact in (exact, assumed):
        law = LoadForces(Body.of_box(load, 20_000.0), rate_hz=200.0, step=0.001)
        law.hold({'load_stack': contact}, pose, age=0.0)
        wrenches.append(law.wrench(pose, np.array([0.1, 0.0, -0.2, 0.01, 0.02, 0.03])))
    assert wrenches[1] == pytest.approx(wrenches[0], rel=1e-9, abs=1e-3)


def record_of(heights, forces):
    """Return the record at 100 Hz of a level load by its height over the stack, and the force."""
    scenario = CraneScenario(offset=(0.0, 0.0))
    record = LandingRecord(scenario, 100.0)
    speeds = np.gradient(heights, 0.01)
    for height, speed, force in zip(heights, speeds, forces):
        record.poses.append(scenario.stack_pose + [0, 0, scenario.size[2] + height, 0, 0, 0, 0])
        record.velocities.append(np.array([0.0, 0.0, speed, 0.0, 0.0, 0.0]))
        record.tensions.append(np.zeros(4))
        record.forces.append(np.array([0.0, 0.0, force]))
    return record


def test_the_judge_measures_what_is_stated():
    """Down at 1 m/s to 5 mm, touch at 1 s, up to 30 mm, still from 2 s on; force off by 1e-3."""
    time = np.arange(0.0, 17.0, 0.01)
    heights = np.interp(time, [0.0, 1.0, 1.005, 1.5, 2.0], [1.0, 0.0, -0.005, 0.03, -0.005])
    weight = CraneScenario().mass * GRAVITY
    result = record_of(heights, np.full(len(time), 1.001 * weight)).judge()
    assert result.touched == pytest.approx(1.0, abs=0.011)
    assert result.settled == pytest.approx(1.0, abs=0.021)
    assert result.gap == pytest.approx(0.03) and result.depth * 2.591 == pytest.approx(0.005)
    assert result.corner_speed == result.rope_tension == result.static_tilt == 0.0
    assert result.force_worst == pytest.approx(1e-3)
    assert result.missed == ['force', 'gap']
    assert dataclasses.replace(result, force_limit=math.inf).missed == ['gap']


def test_what_ends_too_early_is_not_judged():
    nothing = repr(Landing())  # of NaN, which differ from each other
    assert repr(record_of([1.0] * 9, [0.0] * 9).judge()) == nothing
    assert repr(LandingRecord(CraneScenario(), 100.0).judge()) == nothing
    result = record_of([0.1, 0.0, -0.01] + [-0.01] * 200, [0.0] * 203).judge()
    assert result.touched == 0.01 and math.isnan(result.corner_speed)
    assert result.missed == ['corner speed', 'ropes slack', 'force', 'static tilt']
    assert str(result) == '  not judged: the load touched too late, or never'


def test_every_limit_counts():
    """A landing that meets all limits but one is not at rest, and says which."""
    good = {'corner_speed': 1e-4, 'rope_tension': 0.0, 'force_worst': 1e-7, 'static_tilt': 1e-3,
            'depth': 5e-3, 'gap': 0.0, 'settled': 1.0, 'touched': 7.0}
    assert Landing(**good).at_rest
    for field, value, name in (
            ('corner_speed', 1.01 * CORNER_SPEED_LIMIT, 'corner speed'),
            ('rope_tension', 1e-9, 'ropes slack'), ('force_worst', 1.1e-6, 'force'),
            ('static_tilt', math.radians(0.061), 'static tilt'), ('depth', 0.011, 'depth'),
            ('gap', 0.021, 'gap'), ('settled', 3.1, 'settled')):
        bad = Landing(**good | {field: value})
        assert bad.missed == [name]
        assert str(bad).count('not met') == 1
    for limit in (1e-6, math.inf):  # what was not measured is not met
        assert Landing(force_limit=limit).missed == [*Landing().limits]

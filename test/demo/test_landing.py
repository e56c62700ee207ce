# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Landings without ROS: the exact point brings the load to rest, the deepest point does not."""
from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip('mujoco')

from box_contact_ros.scene.force.laws import GRAVITY, Body, PatchLaw

from box_contact_ros import ContactSolver
from box_contact_ros.demo.landing import (
    CORNER_SPEED_LIMIT,
    LandingCase,
    LandingResult,
    cases,
    land,
    landing_scenario,
    scenario_of,
    solvers,
    with_patch,
)
from box_contact_ros.demo.load_laws import held_wrench, predicted_wrench
from box_contact_ros.demo.mujoco_crane import Crane

CASES = list(cases())
HANGING_OVER = 17
"""Tilt of 3°, 0.6 m of overhang: the patch is about to lift off on one side."""

WELL_AIMED = LandingCase(rope_angle=0.5, rope_heading=70.0, tilt=1.0, tilt_heading=30.0,
                         overhang=0.05, overhang_heading=160.0, yaw=0.1)


def landed(number: int, model: str = 'exact', **options) -> LandingResult:
    scenario = scenario_of(CASES[number])
    solver = ContactSolver(scenario.size, scenario.stack_size, model=model)
    return land(scenario, solver, **options).judge()


def test_the_grid_covers_what_is_asked_for():
    """36 landings: ropes and tilt 0.5 to 3°, overhang 0 to 0.6 m, yaw to 1° either way."""
    assert len(CASES) == 36
    for name, low, high in (('rope_angle', 0.5, 3.0), ('tilt', 0.5, 3.0), ('overhang', 0.0, 0.6)):
        values = [getattr(case, name) for case in CASES]
        assert (min(values), max(values)) == (low, high)
    yaws = [case.yaw for case in CASES]
    assert -1.0 <= min(yaws) < -0.8 and 0.8 < max(yaws) <= 1.0


TILT_LIMITS = {50.0: 0.06, 200.0: 0.01, 1000.0: 0.003}
"""By rate [Hz]: what a held patch tilts at most at rest [°]."""


@pytest.mark.parametrize(('number', 'rate_hz', 'latency'), [
    (5, 200.0, 0.002), (HANGING_OVER, 200.0, 0.002), (31, 200.0, 0.002), (31, 200.0, 0.005),
    (HANGING_OVER, 50.0, 0.005), (HANGING_OVER, 1000.0, 0.0), (HANGING_OVER, 1000.0, 0.005)])
def test_the_held_patch_lands_flat_and_still(number, rate_hz, latency):
    """Among the hardest of the grid: the patch all but lifts off on one side."""
    result = landed(number, rate_hz=rate_hz, latency=latency)
    assert result.at_rest, f'\n{result}'
    assert result.overhang == pytest.approx(CASES[number].overhang, abs=0.01)
    assert result.corner_speed <= 1e-7 and result.creep <= 1e-8
    assert math.degrees(result.static_tilt) <= TILT_LIMITS[rate_hz]
    assert result.depth <= 3e-3 and result.energy_gain < 0.01
    assert result.point_step == result.exact_point_step < 1e-7


@pytest.mark.parametrize(('law', 'tilt'), [(held_wrench, 0.06), (predicted_wrench, 0.03)])
def test_a_wrench_that_is_held_lands_less_flat(law, tilt):
    """For clients that can only apply a wrench; a predictor makes up for the latency."""
    flattest = landed(HANGING_OVER, latency=0.002).static_tilt
    result = landed(HANGING_OVER, latency=0.002, law=law)
    assert result.at_rest, f'\n{result}'
    assert flattest < result.static_tilt < math.radians(tilt)


def test_a_model_without_a_patch_is_refused_by_name():
    pytest.importorskip('fcl')
    scenario = scenario_of(CASES[0])
    with pytest.raises(ValueError, match='model soup-8: .* needs volume and covariance'):
        land(scenario, solvers(scenario, 'soup-8'))


def test_the_patch_of_a_flat_load_is_that_of_the_whole_load():
    """Where the bottom lies flat, the patch that is assumed without one is the exact one."""
    turn = (0.0, 0.0, math.sin(0.2), math.cos(0.2))
    load, stack = (12.0, 2.0, 3.0), (20.0, 20.0, 1.0)
    pose = np.array([1.0, 2.0, 1.98, *turn])
    exact = ContactSolver(load, stack, model='exact')(pose, (0, 0, 0, 0, 0, 0, 1))
    alone = exact._replace(volume=math.nan, covariance=np.full((3, 3), math.nan))
    assumed = with_patch(alone, pose, load)
    assert with_patch(exact, pose, load) is exact
    assert assumed.volume == pytest.approx(exact.volume) == pytest.approx(12.0 * 2.0 * 0.02)
    assert assumed.covariance[:2, :2] == pytest.approx(exact.covariance[:2, :2])
    moving = np.array([0.1, 0.0, -0.2, 0.01, 0.02, 0.03])
    body = Body(mass=20_000.0, inertia=(1e4, 2e5, 2e5))
    wrenches = [PatchLaw.for_loop(body, rate_hz=200.0).wrench(patch, pose, moving)
                for patch in (exact, assumed)]
    assert wrenches[1] == pytest.approx(wrenches[0], rel=1e-9, abs=1e-3)


@pytest.mark.parametrize('fields', [
    {'mass_offset': (1.2, 0.0, 0.0)}, {'castings': True, 'size': (12.192, 2.438, 1.5)},
    {'size': (6.058, 2.438, 2.591), 'mass': 12_000.0}, {'stack_size': (6.0, 2.0, 1.0)}],
    ids=['off centre', 'castings', '20 ft', 'pedestal'])
def test_other_loads_and_stacks_land_flat(fields):
    """One law, whose constants know the load's mass and inertia and no size."""
    scenario = scenario_of(WELL_AIMED, **fields)
    result = land(scenario, solvers(scenario, 'exact'), latency=0.002).judge()
    assert result.at_rest, f'\n{result}'


def test_a_load_that_hangs_over_too_far_falls():
    """Its middle is beyond the stack's edge: it tips off until the ropes hold it again."""
    scenario = scenario_of(LandingCase(
        rope_angle=0.5, rope_heading=0.0, tilt=0.5, tilt_heading=0.0, overhang=1.35,
        overhang_heading=90.0, yaw=0.0))
    result = land(scenario, solvers(scenario, 'exact'), latency=0.002).judge()
    assert not result.at_rest
    assert result.drop > 0.1


def test_lost_answers_are_bridged_by_the_patches_that_are_held():
    """Every tenth answer lost at random: all limits are met.

    With no contact on lost ticks instead, the load does not even settle.
    """
    scenario = scenario_of(CASES[4])
    solver = ContactSolver(scenario.size, scenario.stack_size, model='exact')
    far = solver(np.array([0, 0, 1e3, 0, 0, 0, 1.0]), np.array([0, 0, 0, 0, 0, 0, 1.0]))
    results = []
    for on_loss in (None, far):
        random = np.random.default_rng(2)
        results.append(land(scenario, lambda a, b, on_loss=on_loss, random=random: (
            on_loss if random.random() < 0.1 else solver(a, b))).judge())
    assert results[0].at_rest and results[0].corner_speed < 1e-7, f'\n{results[0]}'
    assert not results[1].settled < 3.0


def test_every_limit_counts():
    """A landing that meets all limits but one is not at rest, and says which."""
    good = {'corner_speed': 1e-4, 'rope_tension': 0.0, 'force_worst': 1e-7, 'static_tilt': 1e-3,
            'depth': 5e-3, 'gap': 0.0, 'settled': 1.0, 'touched': 7.0}
    assert LandingResult(**good).at_rest
    for field, value, name in (
            ('corner_speed', 1.01 * CORNER_SPEED_LIMIT, 'corner speed'),
            ('rope_tension', 1e-9, 'ropes slack'), ('force_worst', 1.1e-6, 'force'),
            ('static_tilt', math.radians(0.061), 'static tilt'), ('depth', 0.011, 'depth'),
            ('gap', 0.021, 'gap'), ('settled', 3.1, 'settled')):
        bad = LandingResult(**good | {field: value})
        assert [key for key, (met, _) in bad.limits.items() if not met] == [name]
        assert str(bad).count('not met') == 1
        carried = field in ('corner_speed', 'force_worst', 'static_tilt', 'settled')
        assert bad.carried is carried
        assert ('landing ................ settled' in str(bad)) is carried
    assert not any(met for met, _ in LandingResult().limits.values())
    assert not LandingResult(**good | {'settled': math.nan}).carried


def test_a_wrench_may_change_within_a_tick():
    """Slack ropes, gravity cancelled, f = m a from 2 ms of a 5-ms tick on: v = a · 3 ms after it.

    The wrench is asked for at the start of every physics step of 0.5 ms.
    """
    crane = Crane(landing_scenario(rope_angle=0.0, pitch=0.0, roll=0.0, yaw=0.0), 200.0)
    mass, times = crane.scenario.mass, []

    def wrench(time: float) -> np.ndarray:
        times.append(time)
        side = 2.0 * mass if time > 0.0019 else 0.0
        return np.array([side, 0.0, 1.2 * mass * GRAVITY, 0.0, 0.0, 0.0])

    crane.step(wrench)
    assert times == pytest.approx(np.arange(10) * 5e-4, abs=1e-12)
    assert crane.load_velocity[0] == pytest.approx(2.0 * 0.003, rel=1e-3)

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The landing report: its landings, what is counted, and what ends it."""
from __future__ import annotations

import csv
import dataclasses
import math
import signal
from collections.abc import Iterator

import numpy as np
import pytest

pytest.importorskip('mujoco')
pytest.importorskip('matplotlib')

from benchmarks import landing, landing_ways
from benchmarks.landing_ways import (
    ADDED,
    WAYS,
    HeldLimits,
    Landed,
    LoopTiming,
    PlannedLanding,
    aimed,
    grid,
)
from box_contact_ros.demo import landing as demo_landing
from box_contact_ros.demo.crane import CraneScenario

pytestmark = pytest.mark.reports

RESTS = Landed(settled=1.0, corner_speed=1e-4, rope_tension=0.0, force_worst=1e-9,
               static_tilt=1e-4, depth=1e-3, gap=0.0)
WELL_AIMED = PlannedLanding(name='grid: well aimed', overhang=(0.1, 0.0), scenario=CraneScenario(
    rope_angle=0.5, rope_heading=0.0, pitch=0.5, roll=0.0, yaw=0.0))
HANGING_OVER = 17
"""Tilt of 3°, 0.6 m of overhang: the patch is about to lift off on one side."""
CHOSEN = [ADDED[1], ADDED[9], ADDED[-1]]
"""Mass off the middle, four castings, and a load that falls."""


@pytest.fixture(autouse=True)
def watched_as_in_the_demo(monkeypatch: pytest.MonkeyPatch) -> None:
    """Watch a landing for 8 s after the first touch: half as long as the report does."""
    for name in ('WATCHED', 'WINDOW'):
        monkeypatch.setattr(landing_ways, name, getattr(demo_landing, name))


def test_the_grid_covers_what_is_asked_for():
    """36 landings: ropes and tilt 0.5 to 3°, overhang 0 to 0.6 m, yaw to 1° either way."""
    scenarios = [planned.scenario for planned in grid()]
    assert len(scenarios) == 36
    for values, low, high in (
            ([scenario.rope_angle for scenario in scenarios], 0.5, 3.0),
            ([math.hypot(scenario.pitch, scenario.roll) for scenario in scenarios], 0.5, 3.0),
            ([math.hypot(*planned.overhang) for planned in grid()], 0.0, 0.6)):
        assert (min(values), max(values)) == pytest.approx((low, high))
    yaws = [scenario.yaw for scenario in scenarios]
    assert -1.0 <= min(yaws) < -0.8 and 0.8 < max(yaws) <= 1.0


def test_expectations_are_stated_for_each_landing():
    names = [planned.name for planned in [*grid(), *ADDED]]
    assert len(set(names)) == len(names) == 36 + len(ADDED)
    assert any(planned.falls for planned in ADDED)
    for planned in ADDED:
        assert planned.as_expected(RESTS) is not planned.falls
        assert planned.as_expected(Landed(drop=0.2)) is planned.falls
        assert not planned.as_expected(Landed(drop=0.0))


@pytest.mark.parametrize(('number', 'rate_hz', 'latency'), [
    (31, 200.0, 0.005), (HANGING_OVER, 50.0, 0.005)])
def test_the_hardest_of_the_grid_are_within_the_limits_of_held_patches(number, rate_hz, latency):
    """The patch all but lifts off on one side. The report lands all of the grid."""
    planned = aimed(grid()[number])
    timing = LoopTiming(rate_hz, latency)
    result = landing.run('exact', timing, planned).result
    assert result.at_rest and HeldLimits.at(timing).are_met(result), f'\n{result}'
    assert result.overhang == pytest.approx(math.hypot(*planned.overhang), abs=0.01)
    assert result.point_step < 1e-7


@pytest.mark.parametrize('planned', CHOSEN, ids=[planned.name for planned in CHOSEN])
def test_other_loads_and_stacks_do_what_is_expected(planned):
    """One law, whose constants know the load's mass and inertia and no size.

    The report lands the others, too, at nine rates and latencies.
    """
    outcome = landing.run('exact', LoopTiming(200.0, 0.002), aimed(planned))
    assert outcome.as_expected, f'\n{outcome.result}'


def test_mujocos_own_contact_carries_the_load():
    """The force is the weight, upward, and the load lies flat."""
    scenario = aimed(WELL_AIMED).scenario
    result = WAYS['manifold'].run(scenario, LoopTiming(200.0, 0.0)).judge()
    assert result.at_rest, f'\n{result}'
    assert result.static_tilt < 1e-5


def stays(way: str, timing: LoopTiming, planned: PlannedLanding) -> landing.Outcome:
    """Stand for `landing.run`, which the processes of the report find by its name."""
    return landing.Outcome(way, timing, planned, dataclasses.replace(
        RESTS, corner_speed=0.0, creep=0.0, static_tilt=0.0))


@pytest.fixture
def sigterm_is_handled() -> Iterator[None]:
    """Handle SIGTERM, as rclpy does: the processes of the report must end without it."""
    before = signal.signal(signal.SIGTERM, lambda *_: None)
    yield
    signal.signal(signal.SIGTERM, before)


@pytest.mark.reports
@pytest.mark.usefixtures('sigterm_is_handled')
def test_a_run_writes_table_and_rows(tmp_path, monkeypatch, capsys):
    """One landing of the grid, and one added; the picture is of a real one."""
    monkeypatch.setattr(landing, 'run', stays)
    monkeypatch.setattr(landing, 'grid', lambda: [
        *[None] * (landing.SHOWN % landing.QUICK),
        dataclasses.replace(WELL_AIMED, name=f'grid {landing.SHOWN}')])
    monkeypatch.setattr(landing, 'ADDED', ADDED[9:10])
    monkeypatch.setattr(landing, 'DRAWN', dict([*landing.DRAWN.items()][1::2]))  # for the time
    assert landing.main(['--quick', '--ways', 'exact', 'manifold', '--out', str(tmp_path)]) == 0
    page = (tmp_path / 'landing.md').read_text()
    assert '2 of 2 by `exact` did' in page
    assert '| exact | 200 | 2 | 1/1 | 1/1 |' in page
    with (tmp_path / 'landing.csv').open() as file:
        rows = list(csv.DictReader(file))
    assert [(row['way'], row['as_expected']) for row in rows] == [
        ('exact', '1'), ('exact', '1'), ('manifold', '1'), ('manifold', '1')]
    assert (tmp_path / 'landing.png').stat().st_size > 10_000
    assert '| exact | 200 | 2 | 1/1 | 1/1 |' in capsys.readouterr().out


def test_held_patches_have_limits_of_their_own():
    """By rate, on the grid alone; other ways are at rest within wider ones."""
    still = dataclasses.replace(RESTS, corner_speed=1e-7, creep=1e-8, depth=3e-3)
    of_grid, added = grid()[0], ADDED[0]
    for rate_hz, degrees in ((50.0, 0.06), (200.0, 0.01), (1000.0, 0.003)):
        timing = LoopTiming(rate_hz, 0.005)
        for field, limit in {'static_tilt': math.radians(degrees), 'corner_speed': 1e-7,
                             'creep': 1e-8, 'depth': 3e-3}.items():
            for factor, met in ((1.0, True), (1.001, False)):
                result = dataclasses.replace(
                    still, **{'static_tilt': math.radians(0.003), field: factor * limit})
                for way, planned, expected in (('exact', of_grid, met), ('mlp', of_grid, met),
                                               ('exact', added, result.at_rest),
                                               ('manifold', of_grid, result.at_rest)):
                    outcome = landing.Outcome(way, timing, planned, result)
                    assert outcome.as_expected is expected


def test_a_depth_that_a_corner_sinks_before_the_answer_is_within_the_limit():
    """0.5 m/s, 50 Hz and 5 ms late: 12.5 mm. At 200 Hz that is less than the limit."""
    height = CraneScenario().size[2]
    still = dataclasses.replace(RESTS, corner_speed=1e-7, creep=1e-8, static_tilt=1e-5,
                                touch_speed=0.5)
    for rate_hz, limit in ((50.0, 0.0125 / height), (200.0, 3e-3)):
        for factor, met in ((0.999, True), (1.001, False)):
            outcome = landing.Outcome('exact', LoopTiming(rate_hz, 0.005), grid()[0],
                                      dataclasses.replace(still, depth=factor * limit))
            assert outcome.as_expected is met


def test_the_touch_speed_is_that_of_the_fastest_corner_that_comes_down():
    """A load tilts about its lower left edge, and falls in the last tick."""
    scenario = CraneScenario(pitch=0.0)
    length, _, height = scenario.size
    flat = scenario.stack_size[2] + 0.5 * height
    angles, down = np.array([0.03, 0.01, 0.0, 0.0]), np.array([0.0, 0.0, 2e-9, 0.5])
    poses = np.array([(0.0, 0.0, flat + 0.5 * (length * np.sin(angle) + height * (
        np.cos(angle) - 1.0)) + 1e-9 - way, 0.0, -np.sin(0.5 * angle), 0.0, np.cos(0.5 * angle))
        for angle, way in zip(angles, down)])
    assert landing_ways.touch_speed(poses, scenario, 1.0) == pytest.approx(
        length * np.sin(0.01), rel=1e-6)


def test_figures_worse_than_the_manifolds_are_bold():
    """And what was never reached has no worst."""
    timing, planned = LoopTiming(200.0, 0.002), grid()[0]
    manifold = dataclasses.replace(RESTS, creep=1e-9, gap=0.001)
    ours = dataclasses.replace(manifold, corner_speed=5e-5, static_tilt=2e-4)
    table = landing.grid_table([
        landing.Outcome(way, timing, planned, result)
        for way, result in (('exact', ours), ('manifold', manifold), ('mlp', Landed()))])
    assert table.splitlines()[2:] == [
        '| exact | 200 | 2 | 1/1 | 0/1 | 1 | 0.05 | 1e-06 | 1e-09 | '
        '**0.011** | 0.1 | 1 | – |',
        "| MuJoCo's manifold, in the simulator | – | – | 1/1 | – | 1 | 0.1 | "
        '1e-06 | 1e-09 | 0.0057 | 0.1 | 1 | – |',
        '| mlp | 200 | 2 | 0/1 | 0/1 | never | – | – | – | – | – | – | – |']


def test_each_way_has_its_timings():
    """All of them, and one for MuJoCo within the simulator."""
    timings = [LoopTiming(rate, latency) for rate in (50.0, 200.0) for latency in (0.002, 0.005)]
    assert WAYS['exact'].timings(timings) == timings
    assert WAYS['manifold'].timings(timings) == timings[-1:]


def test_what_a_model_has_no_weights_for_is_left_out_with_a_dash():
    """The paper's network lands containers on containers; `exact` lands all."""
    timing = LoopTiming(200.0, 0.002)
    jobs = list(landing.landings(['exact', 'paper'], [timing], [*grid(), *ADDED]))
    by_paper = [planned for way, _, planned in jobs if way == 'paper']
    assert 0 < len(by_paper) < len(jobs) - len(by_paper) == len(grid()) + len(ADDED)
    for planned in by_paper:
        landing_ways.solvers(planned.scenario, 'paper')  # no refusal
    refused = next(planned for planned in ADDED if planned not in by_paper)
    with pytest.raises(ValueError, match='no weights for boxes'):
        landing_ways.solvers(refused.scenario, 'paper')
    row = landing.added_table([
        landing.Outcome(way, timing, planned, RESTS) for way, _, planned in jobs
        if planned in (refused, by_paper[-1])]).splitlines()[2]
    assert row.endswith(' | – |  |') and '| 1/1 |' in row


def falls(way: str, timing: LoopTiming, planned: PlannedLanding) -> landing.Outcome:
    """Stand for `landing.run`, as `stays` does."""
    return landing.Outcome(way, timing, planned, Landed(drop=0.2))


def test_what_is_not_as_expected_is_named(tmp_path, monkeypatch, capsys):
    """A load that must rest falls: status 1 by the default model's, a line with either."""
    monkeypatch.setattr(landing, 'run', falls)
    monkeypatch.setattr(landing, 'grid', lambda: [
        *[None] * (landing.SHOWN % landing.QUICK),
        dataclasses.replace(WELL_AIMED, name=f'grid {landing.SHOWN}')])
    monkeypatch.setattr(landing, 'ADDED', [])
    monkeypatch.setattr(landing, 'draw', lambda path, scenario: path.touch())
    assert landing.main(['--quick', '--ways', 'exact', 'mlp', '--out', str(tmp_path)]) == 1
    told = capsys.readouterr().err
    for way in ('exact', 'mlp'):
        assert f'{way} at 200 Hz and 2 ms, grid 17: not as expected' in told
    assert '0 of 1 by `exact`, 0 of 1 by `mlp` did' in (tmp_path / 'landing.md').read_text()
    monkeypatch.setattr(landing, 'GATED', 'manifold')
    assert landing.main(['--quick', '--ways', 'exact', '--out', str(tmp_path)]) == 0

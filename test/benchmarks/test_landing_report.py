# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The landing report: a short run, what is counted, and what ends it."""
from __future__ import annotations

import csv
import dataclasses
import math

import numpy as np
import pytest

pytest.importorskip('mujoco')
pytest.importorskip('matplotlib')

from benchmarks import landing_report, landing_ways
from benchmarks.landing_ways import (
    ADDED,
    WAYS,
    LoopTiming,
    MujocoSource,
)
from box_contact_ros.demo.landing import LandingCase, LandingResult, scenario_of
from box_contact_ros.solver.contact_solver import ContactSolver

RESTS = LandingResult(settled=1.0, corner_speed=1e-4, rope_tension=0.0, force_worst=1e-9,
                      static_tilt=1e-4, depth=1e-3, gap=0.0)


def test_expectations_are_stated_for_each_landing():
    names = [planned.name for planned in [*landing_ways.grid(), *ADDED]]
    assert len(set(names)) == len(names) == 36 + len(ADDED)
    assert any(planned.falls for planned in ADDED)
    for planned in ADDED:
        assert planned.as_expected(RESTS) is not planned.falls
        assert planned.as_expected(LandingResult(drop=0.2)) is planned.falls
        assert not planned.as_expected(LandingResult(drop=0.0))


def test_one_point_of_mujocos_contacts():
    """A container on its like, 5 mm deep: mean and deepest point lie on the faces' patch."""
    size = (12.192, 2.438, 2.591)
    below = np.array([0.0, 0, 0, 0, 0, 0, 1])
    above = np.array([0.3, 0.1, size[2] - 0.005, 0, 0, 0, 1])
    exact = ContactSolver(size, size, model='exact')(above, below)
    mean = MujocoSource(size, size, 'mean')(above, below)
    assert mean.point == pytest.approx(exact.point, abs=1e-6)
    assert mean.separation == pytest.approx(exact.separation)
    for choice in ('mean', 'deepest'):
        source = MujocoSource(size, size, choice)
        assert source(above, below).normal == pytest.approx([0, 0, -1])
        assert math.isnan(source(above, below).volume)
        assert not source(above + [0, 0, 1, 0, 0, 0, 0], below).colliding


def test_mujocos_own_contact_carries_the_load():
    """The force is the weight, upward, and the load lies flat."""
    scenario = scenario_of(LandingCase(
        rope_angle=0.5, rope_heading=0.0, tilt=0.5, tilt_heading=0.0, overhang=0.1,
        overhang_heading=0.0, yaw=0.0))
    result = WAYS['manifold'].fly(scenario, LoopTiming(200.0, 0.0)).judge()
    assert result.at_rest, f'\n{result}'
    assert result.static_tilt < 1e-5


@pytest.fixture
def one_case(monkeypatch):
    """One landing of the grid, short, and one added."""
    plans = landing_ways.grid()[4:5], ADDED[9:10]
    monkeypatch.setattr(landing_report, 'grid', lambda seed: plans[0])
    monkeypatch.setattr(landing_report, 'ADDED', plans[1])
    monkeypatch.setattr(landing_report, 'draw', lambda path, scenario: path.touch())


def test_a_run_writes_table_and_rows(tmp_path, one_case, capsys):
    status = landing_report.main(['--quick', '--ways', 'exact', 'manifold', '--rates', '200',
                                  '--latency', '0.002', '--workers', '1', '--out', str(tmp_path)])
    assert status == 0
    page = (tmp_path / 'landing.md').read_text()
    assert '**2 of 2** landings by held patches' in page and 'No goal was missed.' in page
    assert '| 200 | 2 | 1 of 1 |' in page and "| MuJoCo's manifold |  | 1 of 1 |" in page
    with (tmp_path / 'landing.csv').open() as file:
        rows = list(csv.DictReader(file))
    assert [(row['way'], row['as_expected']) for row in rows] == [
        ('exact', '1'), ('exact', '1'), ('manifold', '1'), ('manifold', '1')]
    assert '| held patch | exact | 200 | 2 | 1 of 1 | 1 of 1 |' in capsys.readouterr().out


def test_what_is_not_as_expected_ends_with_status_1(tmp_path, one_case, monkeypatch, capsys):
    monkeypatch.setattr(landing_report, 'run', _diverged)
    monkeypatch.setattr(landing_report, 'Pool', _Here)
    assert landing_report.main(['--quick', '--ways', 'exact', '--rates', '200', '--latency', '0',
                                '--out', str(tmp_path)]) == 1
    assert 'exact at 200 Hz, grid 4: not as expected' in capsys.readouterr().err
    page = (tmp_path / 'landing.md').read_text()
    assert 'never' in page and 'goal missed: `exact` at 200 Hz and 0 ms, in 2 of 2 landings' in page


def test_held_patches_have_limits_of_their_own():
    """By rate, on the grid alone; other ways are at rest within wider ones."""
    still = dataclasses.replace(RESTS, corner_speed=1e-7, creep=1e-8, depth=3e-3)
    of_grid, added = landing_ways.grid()[0], ADDED[0]
    for rate_hz, degrees in ((50.0, 0.06), (200.0, 0.01), (1000.0, 0.003)):
        timing = LoopTiming(rate_hz, 0.005)
        for field, limit in {'static_tilt': math.radians(degrees), 'corner_speed': 1e-7,
                             'creep': 1e-8, 'depth': 3e-3}.items():
            for factor, met in ((1.0, True), (1.001, False)):
                result = dataclasses.replace(
                    still, **{'static_tilt': math.radians(0.003), field: factor * limit})
                for way, planned, expected in (('exact', of_grid, met), ('mlp', of_grid, met),
                                               ('exact', added, result.at_rest),
                                               ('wrench', of_grid, result.at_rest)):
                    landing = landing_report.Landing(way, timing, planned, None)
                    assert landing_report.Landed(landing, result).as_expected is expected


def test_figures_worse_than_the_manifolds_are_bold():
    timing, planned = LoopTiming(200.0, 0.002), landing_ways.grid()[0]
    manifold = dataclasses.replace(RESTS, creep=1e-9, gap=0.001)
    ours = dataclasses.replace(manifold, corner_speed=5e-5, static_tilt=2e-4)
    table = landing_report.against_manifold([
        landing_report.Landed(landing_report.Landing(way, timing, planned, None), result)
        for way, result in (('exact', ours), ('manifold', manifold))])
    assert table.splitlines()[2:] == [
        '| 200 | 2 | 0 of 1 | 0.05 | 1e-06 | **0.011** | 0.1 | 1 | 1e-09 | 1 | 0.01 |',
        "| MuJoCo's manifold |  | 1 of 1 | 0.1 | 1e-06 | 0.0057 | 0.1 | 1 | 1e-09 | 1 |  |"]


def test_each_way_has_its_timings():
    """All of them, one for MuJoCo within the simulator, and the least latency for baselines."""
    timings = [LoopTiming(rate, latency) for rate in (50.0, 200.0) for latency in (0.002, 0.005)]
    assert WAYS['exact'].timings(timings) == WAYS['wrench'].timings(timings) == timings
    assert WAYS['manifold'].timings(timings) == timings[-1:]
    assert WAYS['point'].timings(timings) == timings[::2]


def _diverged(landing):
    return landing_report.Landed(landing, LandingResult())


class _Here:
    """A pool that works in this process."""

    def __init__(self, workers):
        self.imap = map

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rest report: closed forms of its simulator, its figures, and a case or more of each kind."""
from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('mujoco')

from benchmarks import loops, rest
from benchmarks.loops import FLOOR, MUJOCO, Boxes, Scene
from benchmarks.pose_sets import turned
from benchmarks.rest import CASES, WAYS, Log, simulate
from box_contact_ros.scene.laws import GRAVITY

TIMINGS = [timing for timing in WAYS.values() if timing]


@pytest.mark.parametrize('timing', TIMINGS, ids=str)
@pytest.mark.parametrize('case', CASES[1::3], ids=lambda case: case.name)
def test_the_law_meets_its_limits(case: rest.Case, timing: loops.Timing) -> None:
    assert case.measure(simulate(case, timing)) <= case.limit


def test_a_resting_load_is_carried_at_its_static_depth() -> None:
    """The same depth at every step: the wrench is the weight."""
    load = (2.0, 1.0, 1.0), 500.0, (0.0, 0.0, 0.51)
    log = simulate(replace(CASES[0], rows=(FLOOR, load), seconds=2.0), TIMINGS[2])
    depths = 0.5 - log.poses[1500:, 0, 2]
    assert 1e-5 < depths[0] < 1e-3 and np.ptp(depths) < 1e-9


@pytest.mark.parametrize('timing', [None, TIMINGS[2]])
def test_nothing_touches_and_the_load_falls(timing: loops.Timing | None) -> None:
    load = (1.0, 1.0, 1.0), 10.0, (0.0, 0.0, 9.0), turned((1, 2, 3), 0.5)
    log = simulate(replace(CASES[0], rows=(FLOOR, load), seconds=0.5), timing)
    assert log.velocities[-1, 0, 2] == pytest.approx(-GRAVITY * log.times[-1], rel=1e-9)
    assert log.poses[:, 0, 3:] == pytest.approx(np.tile(load[3], (len(log.times), 1)))


@pytest.mark.parametrize('timing', [None, TIMINGS[0]])
def test_a_box_turns_about_its_centre_of_mass(timing: loops.Timing | None) -> None:
    """It falls and spins about its z axis; the corners' speeds are those of its velocity."""
    boxes = Boxes.of([((1.0, 2.0, 1.0), 10.0, (0, 0, 9), (0, 0, 0, 1), (0.3, 0.0, 0.0))])
    boxes.velocity[0] = 0.0, 0.0, 0.0, 0.0, 0.0, 2.0
    for _ in loops.steps(Scene('spin', boxes, seconds=0.5), timing):
        pass
    assert boxes.velocity[0] == pytest.approx([0, 0, -0.5 * GRAVITY, 0, 0, 2.0], abs=1e-3)
    assert boxes.pose[0, :2] == pytest.approx([0.3 - 0.3 * np.cos(1.0), -0.3 * np.sin(1.0)],
                                              abs=1e-3)
    assert loops.corner_speeds(boxes).max() == pytest.approx(
        np.hypot(0.5 * GRAVITY, 2.0 * np.hypot(0.8, 1.0)), rel=1e-3)


def test_figures_of_planted_logs() -> None:
    """A load that comes up again, one that creeps and speeds up; NaN meets no limit."""
    n = 2001
    log = Log(times=1e-3 * np.arange(n), poses=np.zeros((n, 1, 7)), velocities=np.zeros((n, 1, 6)),
              corners=np.zeros(n), size=np.ones((1, 3)))
    log.poses[:, 0, 6] = 1.0
    log.poses[:, 0, 2] = 0.5 + rest.DROP * np.maximum(0.0, np.linspace(-1.0, 0.5, n))
    assert rest.rebound(log) == pytest.approx(50.0)
    log.poses[:, 0, 0] = 0.002 * log.times
    log.poses[:, 0, 2] = 0.5
    assert rest.creep(log, 1.0) == pytest.approx(2.0)
    log.corners[-1] = 0.3
    assert rest.fastest(log, 1.0) == pytest.approx(300.0)
    log.velocities[:, 0, 0] = 3.0 * log.times
    assert rest.acceleration_error(log, 1.0, 4.0) == pytest.approx(25.0)
    assert rest.belt_error(log, 5.0) == pytest.approx(20.0)
    log.poses[:], log.corners[:] = np.nan, np.nan
    for figure in (rest.rebound(log), rest.creep(log, 1.0), rest.fastest(log, 1.0)):
        assert not figure <= np.inf


def test_the_program(monkeypatch: pytest.MonkeyPatch, tmp_path: Path,
                     capsys: pytest.CaptureFixture[str]) -> None:
    """A limit that nothing meets: status 1, the row in bold, a line on stderr for each timing."""
    case = replace(CASES[0], seconds=0.3)
    monkeypatch.setattr(rest, 'CASES', (case, replace(case, name='never', limit=-1.0)))
    assert rest.main(['--out', str(tmp_path)]) == 1
    printed = capsys.readouterr()
    assert printed.err.count('rest: never at ') == len(TIMINGS)
    assert '| -1 | **0** |' in printed.out and printed.out.strip() in (
        tmp_path / 'rest.md').read_text()
    with (tmp_path / 'rest.csv').open() as file:
        rows = list(csv.DictReader(file))
    assert [row['is_met'] for row in rows] == ['1'] * len(WAYS) + ['0'] * len(WAYS)
    assert [row['way'] for row in rows].count(MUJOCO) == 2

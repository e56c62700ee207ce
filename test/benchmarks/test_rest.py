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

from benchmarks import rest
from benchmarks.rest import CASES, FLOOR, Log, Part, simulate
from box_contact_ros.scene.laws import GRAVITY

USUAL = rest.TIMINGS[1]


@pytest.mark.parametrize('timing', rest.TIMINGS, ids=str)
@pytest.mark.parametrize('case', CASES[1::3], ids=lambda case: case.name)
def test_the_law_meets_its_limits(case: rest.Case, timing: rest.Timing) -> None:
    assert case.measure(simulate(case, timing)) <= case.limit


def test_a_resting_load_is_carried_at_its_static_depth() -> None:
    """The same depth at every step: the wrench is the weight."""
    load = Part(name='load', size=(2.0, 1.0, 1.0), mass=500.0, position=(0.0, 0.0, 0.51))
    log = simulate(replace(CASES[0], parts=(FLOOR, load), seconds=2.0), USUAL)
    depths = 0.5 - log.poses[1500:, 0, 2]
    assert 1e-5 < depths[0] < 1e-3 and np.ptp(depths) < 1e-9


@pytest.mark.parametrize('timing', [None, USUAL])
def test_nothing_touches_and_the_load_falls(timing: rest.Timing | None) -> None:
    load = Part(name='load', size=(1.0, 1.0, 1.0), mass=10.0, position=(0.0, 0.0, 9.0),
                quaternion=rest.quaternion((1, 2, 3), 30.0))
    log = simulate(replace(CASES[0], parts=(FLOOR, load), seconds=0.5), timing)
    assert log.velocities[-1, 0, 2] == pytest.approx(-GRAVITY * log.times[-1], rel=1e-9)
    assert log.poses[:, 0, 3:] == pytest.approx(np.tile(load.quaternion, (len(log.times), 1)))


def test_figures_of_planted_logs() -> None:
    """A load that comes up again, one that creeps, turns and speeds up; NaN meets no limit."""
    load = Part(name='load', size=(1.0, 1.0, 1.0), mass=10.0, position=(0.0, 0.0, 0.5))
    log = Log((FLOOR, load), 2.0)
    log.poses[:] = 0.0
    log.poses[:, 0, 6], log.velocities[:] = 1.0, 0.0
    log.poses[:, 0, 2] = 0.5 + np.maximum(0.0, np.linspace(-1.0, 0.5, len(log.times)))
    assert rest.rebound(log, 1.0) == pytest.approx(50.0)
    log.poses[:, 0, 0] = 0.002 * log.times
    log.poses[:, 0, 2] = 0.5
    assert rest.creep(log, 1.0) == pytest.approx(2.0)
    log.velocities[-1, 0] = 0.3, 0.0, 0.0, 0.0, 0.0, 2.0
    assert rest.fastest(log, 1.0) == pytest.approx(1e3 * (0.3 + np.sqrt(3.0)))
    log.velocities[:, 0, 0] = 3.0 * log.times
    assert rest.acceleration_error(log, 1.0, 4.0) == pytest.approx(25.0)
    assert rest.belt_error(log, 5.0) == pytest.approx(20.0)
    log.poses[:], log.velocities[:] = np.nan, np.nan
    for figure in (rest.rebound(log, 1.0), rest.creep(log, 1.0), rest.fastest(log, 1.0)):
        assert not figure <= np.inf


def test_the_program(monkeypatch: pytest.MonkeyPatch, tmp_path: Path,
                     capsys: pytest.CaptureFixture[str]) -> None:
    """A limit that nothing meets: status 1, the row in bold, a line on stderr for each timing."""
    case = replace(CASES[0], seconds=0.3)
    monkeypatch.setattr(rest, 'CASES', (case, replace(case, name='never', limit=-1.0)))
    assert rest.main(['--out', str(tmp_path)]) == 1
    printed = capsys.readouterr()
    assert printed.err.count('rest: never at ') == len(rest.TIMINGS)
    assert '| -1 | **0** |' in printed.out and printed.out.strip() in (
        tmp_path / 'rest.md').read_text()
    with (tmp_path / 'rest.csv').open() as file:
        rows = list(csv.DictReader(file))
    assert [row['is_met'] for row in rows] == ['1'] * 4 + ['0'] * 4
    assert [row['way'] for row in rows].count(rest.MUJOCO) == 2

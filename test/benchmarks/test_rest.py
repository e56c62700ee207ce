# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rest report: its simulator, its oracle, gates of each kind, and a short run."""
from __future__ import annotations

import csv
import math
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip('mujoco')

from benchmarks.rest import rest_report
from benchmarks.rest.columns import stop_times
from benchmarks.rest.rest_cases import (
    CASES,
    FLOOR,
    Gate,
    energies,
    gain,
    over_floor,
    rebound,
    speed,
)
from benchmarks.rest.rest_report import OWN, SOME_TIMINGS, TIMINGS, Run
from benchmarks.rest.simulator import (
    Log,
    Part,
    Setup,
    Timing,
    held_patch,
    own_contact,
)
from box_contact_ros.scene.force.held_wrench import InFlight
from box_contact_ros.scene.force.laws import GRAVITY, HeldPatch
from box_contact_ros.solver.contact_solver import ContactSolver

SLOW, USUAL, JITTER = Timing(50.0, 0.005), Timing(200.0, 0.002), Timing(200.0, 0.005, jitter=0.002)
SAMPLE = [
    ('2 m cube on an edge, 5 mm', USUAL), ('2 m cube on a corner, 50 mm', SLOW),
    ('container on a corner, 500 mm', JITTER), ('ropes leave 2 % of the weight', SLOW),
    ('wind of 1500 N against a neighbour', USUAL), ('2 × 2 × 1 m on 15°', SLOW),
    ('0.1 m cube on 25°', SLOW), ('2 × 2 × 1 m on 40°', USUAL), ('2 × 2 × 1 m by 0.9 μmg', SLOW),
    ('2 × 2 × 1 m by 1.1 μmg', USUAL), ('2 × 2 m at 1 m/s and 2 rad/s', USUAL),
    ('2 m cube, 1.05 of the energy that topples it', USUAL), ('20 ft on four castings', SLOW),
    ('overhanging by 40 % of the length', JITTER), ('5 containers', SLOW), ('30 t on 2 t', SLOW),
]


def test_the_sweep_has_what_was_asked_for():
    assert {timing.rate_hz for timing in TIMINGS} == {50.0, 100.0, 200.0, 1000.0}
    assert {timing.latency for timing in TIMINGS} == {0.0, 0.002, 0.005}
    assert any(timing.jitter for timing in TIMINGS) and set(SOME_TIMINGS) <= set(TIMINGS)
    assert {case.kind for case in CASES.values()} == {
        'drop', 'light', 'slope', 'push', 'spin', 'topple', 'load', 'stack', 'several'}
    # A gate that NaN would pass could hide a load that flew away.
    assert all(not math.nan <= limit for case in CASES.values() for gate in case.gates
               for limit in gate.limits)


def test_limits_by_rate():
    gate = Gate('tilt', (0.06, 0.01, 0.003), speed)
    assert [gate.limit_at(rate) for rate in (0.0, 50.0, 100.0, 200.0, 999.0, 1000.0)] == [
        0.06, 0.06, 0.06, 0.01, 0.01, 0.003]
    assert Gate('speed', 1.0, speed).limit_at(1000.0) == 1.0


@pytest.mark.parametrize('name, timing', SAMPLE)
def test_gates(name, timing):
    """The result that was stated beforehand, for a case or two of each kind."""
    for figure in rest_report.measured(Run(name, 'exact', timing)):
        assert figure.is_met, (figure.gate.name, figure.value, figure.limit)


def test_one_load_by_held_patch_is_the_same():
    """A SceneLaw in the simulator, and a HeldPatch in a loop here: the same wrenches."""
    setup = Setup(parts=(over_floor((2.0, 1.0, 1.0), 500.0, 0.01), FLOOR), seconds=0.3)
    log = held_patch(setup, USUAL, 'exact')
    _, poses, velocities = log.of('load')
    law = HeldPatch.for_loop(setup.parts[0].body, rate_hz=200.0, latency=0.002)
    solver = ContactSolver(setup.parts[0].size, FLOOR.size, model='exact')
    floor = np.array([*FLOOR.position, *FLOOR.quaternion])
    under_way, before = InFlight(), None
    for tick, (pose, velocity) in enumerate(zip(poses[:-1], velocities)):
        time = 0.001 * tick
        if tick % 5 == 0:
            under_way.answer((solver(pose, floor), pose), asked=time, due=time + 0.002)
        if arrived := under_way.arrived(time):
            law.hold(*arrived)
        lift = law.wrench(pose, velocity)[2]
        gained = (velocities[tick + 1, 2] - velocity[2]) / 0.001
        assert lift / 500.0 - GRAVITY == pytest.approx(gained, abs=1e-9)
        before = lift
    assert before == pytest.approx(500.0 * GRAVITY, rel=0.1)


def test_without_a_law_a_load_falls_and_gates_see_it():
    """Free fall by the simulator, and the figures of a load that flies up, or away."""
    setup = Setup(parts=(FLOOR, over_floor((1.0, 1.0, 1.0), 10.0, 5.0)), seconds=0.5)
    log = own_contact(setup, 0.001)
    _, poses, velocities = log.of('load')
    assert velocities[-1, 2] == pytest.approx(-GRAVITY * log.times[-1], rel=1e-9)
    assert np.ptp(energies(log)) < 0.01 * 10.0 * GRAVITY * 5.0
    thrown = Log(setup, 0.001)
    thrown.poses[:], thrown.velocities[:] = log.poses[:1], 0.0
    thrown.poses[:, 0, 2] = 0.5 + np.maximum(0.0, np.linspace(-1.0, 0.5, len(thrown.times)))
    assert rebound(thrown, 1.0) == pytest.approx(50.0)
    thrown.poses[:, 0, 2] = np.linspace(1.5, 2.0, len(thrown.times))
    assert gain(thrown, 1.0) == pytest.approx(50.0)
    thrown.poses[:] = np.nan
    assert math.isnan(rebound(thrown, 1.0)) and math.isnan(speed(thrown, 0.0))


def test_a_box_off_its_centre_of_mass_and_on_a_path():
    """Velocities are those of the centre of mass; a box on a path keeps to it."""
    part = Part(name='load', size=(1.0, 1.0, 1.0), position=(0.0, 0.0, 9.0), mass=3.0,
                centre=(0.2, 0.0, 0.0), velocity=(0.0, 0.0, 0.0, 0.0, 0.0, 2.0))
    lift = Part(name='lift', size=(1.0, 1.0, 1.0), position=(5.0, 0.0, 0.0),
                path=lambda time: (np.array([5.0, 0.0, time]), np.array([0.0, 0.0, 1.0])))
    log = own_contact(Setup(parts=(part, lift), seconds=0.2), 0.001)
    _, poses, velocities = log.of('load')
    assert velocities[:, :2] == pytest.approx(0.0, abs=1e-3)  # the box's centre goes at 0.4 m/s
    # The box goes round its centre of mass, which falls straight.
    assert poses[-1, 0] == pytest.approx(0.2 - 0.2 * math.cos(2.0 * log.times[-1]), abs=1e-4)
    _, poses, velocities = log.of('lift')
    assert poses[:, 2] == pytest.approx(log.times) and velocities[:, 2] == pytest.approx(1.0)


def test_columns_by_closed_forms():
    """A slide stops after v / μg, and a spin alone by the mean distance from the centre."""
    slide, _ = stop_times((2.0, 2.0, 0.2), 1.0, 0.0, 0.5)
    assert slide == pytest.approx(0.99 / (0.5 * GRAVITY), rel=2e-3)
    mean_distance = (math.sqrt(2.0) + math.log(1.0 + math.sqrt(2.0))) / 3.0  # of a square of 2 m
    _, spin = stop_times((2.0, 2.0, 0.2), 0.0, 3.0, 0.5)
    assert spin == pytest.approx(0.99 * 3.0 * (8.0 / 12.0) / (0.5 * GRAVITY * mean_distance),
                                 rel=2e-3)


def test_a_miss_is_counted(monkeypatch, tmp_path, capsys):
    """A limit that nothing meets: status 1, the row in bold, a line on stderr; others stay."""
    name = 'container level, 5 mm'
    case = CASES[name]
    gates = (replace(case.gates[0], limit=-1.0), case.gates[1])
    monkeypatch.setitem(CASES, name, replace(
        case, gates=gates, setup=replace(case.setup, seconds=0.1)))
    monkeypatch.setattr(rest_report, 'TIMINGS_OF', {'exact': (USUAL,), 'mlp': (USUAL,)})
    monkeypatch.setattr(rest_report, 'CASES', {name: CASES[name]})
    assert rest_report.main(['--out', str(tmp_path), '--workers', '1']) == 1
    printed = capsys.readouterr()
    assert printed.err.count('rest: ') - printed.err.count('rest: 0') >= 2
    assert '**0 of 2**' in printed.out and '| 2 of 2 |' in printed.out
    assert '**2 of 4** figures' in (tmp_path / 'rest.md').read_text()
    with (tmp_path / 'rest.csv').open() as file:
        rows = list(csv.DictReader(file))
    assert [row['way'] for row in rows].count(OWN) == 2 and len(rows) == 6
    assert [row['is_met'] for row in rows if row['way'] == 'mlp'] == ['0', '1']

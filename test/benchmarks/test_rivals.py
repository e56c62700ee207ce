# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Engines beside ours: each moves the boxes that it is given, and what is missing is said."""
from __future__ import annotations

import math
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('mujoco')

from benchmarks import output, rivals, rivals_picture, stacks
from benchmarks.engines import DYNAMICS
from benchmarks.loops import FRAME, Boxes
from benchmarks.pose_sets import turned
from benchmarks.rivals import Engine
from benchmarks.stack_scenes import Scene
from box_contact_ros.forces.patch_forces import FRICTION, GRAVITY

pytestmark = pytest.mark.reports

NAMES = (rivals.OURS, rivals.ANY_DEPTH, 'Box3D', 'Jolt', 'Rapier', 'MuJoCo')
needs_compiler = pytest.mark.skipif(shutil.which('g++') is None, reason='no compiler')


@pytest.fixture(scope='module')
def engines(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Engine]:
    return rivals.engines(tmp_path_factory.mktemp('rivals'))[0]


def engine_of(engines: dict[str, Engine], name: str) -> Engine:
    if name not in engines:
        pytest.skip(f'{name} is not here')
    return engines[name]


def said(*stops: str, more: str = '') -> Engine:
    """Return an engine that prints these stops, whatever it is asked for."""
    return Engine([sys.executable, '-c', f'print({chr(10).join(stops)!r}, flush=True)\n{more}'], '')


@needs_compiler
@pytest.mark.parametrize('degrees', [20.0, 35.0])
@pytest.mark.parametrize('name', NAMES)
def test_a_plate_slides_beyond_the_angle_of_friction(
        engines: dict[str, Engine], name: str, degrees: float, tmp_path: Path) -> None:
    """Its way is ½·(sin α − μ·cos α)·g·t², so mass, friction, gravity and poses arrive as meant."""
    angle, time = math.radians(degrees), 1.0
    q = turned((0, 1, 0), angle)
    up = np.array([math.sin(angle), 0.0, math.cos(angle)])
    boxes = Boxes.of([((40.0, 40.0, 1.0), 0.0, -0.5 * up, q),
                      ((1.0, 1.5, 0.1), 5.0, 0.05 * up, q)])
    rivals.write_scene(tmp_path / 'scene', boxes)
    stop, = rivals.run(engine_of(engines, name), tmp_path / 'scene', False, [round(time / FRAME)])
    way = max(0.0, math.sin(angle) - FRICTION * math.cos(angle)) * GRAVITY * time**2 / 2
    moved = stop.pose[1] - boxes.pose[1]
    assert np.hypot(*moved[[0, 2]]) == pytest.approx(way, rel=0.08, abs=0.03)
    assert moved[1] == pytest.approx(0.0, abs=0.02)
    assert abs(stop.pose[1, 3:] @ boxes.pose[1, 3:]) > 1 - 1e-4
    assert stop.awake >= 1 and stop.seconds > 0.0
    assert stop.pose[0] == pytest.approx(boxes.pose[0], abs=1e-6)


@needs_compiler
@pytest.mark.parametrize('name', NAMES)
def test_what_rests_sleeps_where_it_may(engines: dict[str, Engine], name: str, tmp_path: Path,
                                        ) -> None:
    boxes = Boxes.of([((9.0, 9.0, 1.0), 0.0, (0, 0, -0.5)), ((1.0, 1.0, 1.0), 5.0, (0, 0, 0.5))])
    rivals.write_scene(tmp_path / 'scene', boxes)
    engine = engine_of(engines, name)
    for sleep in (False, True):
        begin, end = rivals.run(engine, tmp_path / 'scene', sleep, [1, 300])
        assert begin.awake >= 1
        assert (end.awake == 0) == sleep


@needs_compiler
@pytest.mark.parametrize('name', NAMES)
def test_a_run_ends_at_its_limit(engines: dict[str, Engine], name: str, tmp_path: Path) -> None:
    """A year of steps, of which none begins."""
    rivals.write_scene(tmp_path / 'scene', rivals.containers().boxes)
    stops = [1, 365 * 24 * 3600 * rivals.SECOND]
    engine = engine_of(engines, name)
    assert rivals.run(engine, tmp_path / 'scene', False, stops, limit=0.0) == []


def test_what_a_run_does_not_reach_in_time_is_not_known(tmp_path: Path) -> None:
    """Nor is a time asleep, where something is awake."""
    scene = Scene('one', Boxes.of([((1.0, 1.0, 1.0), 5.0, (0, 0, 9.0))]))
    stops = ['0.06 1\n0 0 8 0 0 0 1', '0.7 1\n0 0 7 0 0 0 1', '0.012 1\n0 0 6 0 0 0 1']
    found = rivals.measure(lambda: scene, {'slow': said(*stops, '0.5 1')}, tmp_path, 1)['slow']
    assert (found.moving, found.awake) == pytest.approx((1000.0, 100.0))
    assert found.sank == pytest.approx(3000.0)
    assert math.isnan(found.asleep) and math.isnan(found.creep)
    done = said(*stops[:2], '0.012 0\n0 0 6 0 0 0 1', '9 1\n3 4 6 0 0 0 1')
    found = rivals.measure(lambda: scene, {'done': done}, tmp_path, 1)['done']
    assert found.creep == pytest.approx(5000.0)
    assert math.isnan(found.asleep)
    with pytest.raises(RuntimeError, match='ended with status 3'):
        rivals.run(said(more='raise SystemExit(3)'), tmp_path / 'scene', True, [1])


def test_a_missing_rival_ends_a_full_run_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                                 capsys: pytest.CaptureFixture[str]) -> None:
    """Unless it is left out on purpose; the page then says so."""
    missing = [f'jolt is not here ({DYNAMICS["jolt"]})']
    monkeypatch.setattr(rivals, 'engines', lambda made: ({}, missing))
    assert stacks.main(['--out', str(tmp_path)]) == 2
    assert 'add --leave-out jolt' in capsys.readouterr().err and not list(tmp_path.iterdir())
    scene = Scene('one', Boxes.of([((1.0, 1.0, 1.0), 5.0, (0, 0, 9.0))]))
    monkeypatch.setattr(rivals, 'SCENES', (lambda: scene,))
    engine = said(*['0.06 0\n0 0 8 0 0 0 1'] * 4)
    parts = rivals.report({rivals.OURS: engine, 'Box3D': engine}, missing, tmp_path, tmp_path,
                          quick=True)
    assert 'Left out: jolt' in parts['missing'] and parts['box3d'] == ''
    assert '| one | 1,000 / 500 / 500 | 1,000 / 500 / 500 |' in parts['times']
    assert len(output.read_csv(tmp_path / 'stacks_rivals.csv')) == 2
    assert (tmp_path / 'stacks_rivals.png').stat().st_size > 10_000


def test_the_map_says_where_ours_is_faster() -> None:
    """Times are relative to ours; another run of ours is no rival."""
    times = {rivals.OURS: ('100', '50', '2'), rivals.ANY_DEPTH: ('10', '10', '1'),
             'Box3D': ('80', '100', ''), 'Jolt': ('200', '40', '1')}
    found = {name: {'engine': name, 'numbers': 'float', **dict(zip(rivals_picture.STATES, each))}
             for name, each in times.items()}
    assert rivals_picture.title({'wall': found}) == (
        'Awake, a step of PatchForces (float) takes 0.50 to 1.2 times as long as one of '
        'Box3D (float).\nGreen: it is faster than the engine of the column; red: slower.')
    assert rivals_picture.cell('', '100')[0] == '–'
    assert rivals_picture.cell('20', '100') == ('20.0\n× 0.20', rivals_picture.RATIOS[0][1])
    assert rivals_picture.cell('2000', '100')[1] == rivals_picture.RATIOS[-1][1]

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The two loops against closed forms; what comes to rest, and which boxes stay in their places."""
from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('mujoco')

from benchmarks import output, rivals, settled, stacks, stacks_picture
from benchmarks.loops import (
    FRAME,
    MUJOCO,
    TIMINGS,
    Boxes,
    Mujoco,
    Scene,
    Timing,
    corner_speeds,
    steps,
)
from benchmarks.stack_scenes import (
    ORDERS,
    card_house,
    landed_pallet,
    mixed,
    off_centre,
    pallet,
    ratio,
    sideways,
    slope,
    tower,
    turntable,
)
from benchmarks.stacks import run, stays
from box_contact_ros.forces.patch_forces import GRAVITY

OWN_FRAMES = Timing.uneven((FRAME,))
"""Steps of 1/60 s with contacts of their own."""


@pytest.mark.parametrize('timing', [MUJOCO[0], TIMINGS[0]])
def test_a_free_box_turns_about_its_centre_of_mass(timing: Timing | Mujoco) -> None:
    """It falls, and a torque turns it about its z axis by ½·α·t² from its corners' rest."""
    boxes = Boxes.of([((1.0, 2.0, 1.0), 12.0, (0, 0, 9), (0, 0, 0, 1), (0.3, 0.0, 0.0))])
    torque = np.array([[0.0, 0, 0, 0, 0, 20.0]])
    for _ in steps(Scene('spin', boxes, seconds=0.5, act=lambda *_: torque), timing):
        pass
    spin = 20.0 / boxes.inertia[0, 2] * 0.5
    assert boxes.velocity[0] == pytest.approx([0, 0, -0.5 * GRAVITY, 0, 0, spin], abs=2e-3)
    angle = 0.25 * spin
    assert boxes.pose[0, :2] == pytest.approx(
        [0.3 - 0.3 * np.cos(angle), -0.3 * np.sin(angle)], abs=2e-3)
    assert corner_speeds(boxes).max() == pytest.approx(
        np.hypot(0.5 * GRAVITY, spin * np.hypot(0.8, 1.0)), rel=1e-3)


@pytest.mark.parametrize('timing', [MUJOCO[0], TIMINGS[0]])
def test_a_turntable_carries_its_tower(timing: Timing | Mujoco) -> None:
    """The plate keeps its rate, and speeds are relative to it: zero at first, and not after."""
    scene = replace(turntable(), seconds=0.5)
    assert corner_speeds(scene.boxes).max() < 1e-15
    for _ in steps(scene, timing):
        pass
    angle = 2.0 * np.arctan2(scene.boxes.pose[0, 5], scene.boxes.pose[0, 6])
    assert angle == pytest.approx(0.1 * np.pi, rel=1e-6)
    speeds = corner_speeds(scene.boxes)
    assert speeds.max() < 0.02
    scene.boxes.velocity[1:] = 0.0
    assert corner_speeds(scene.boxes).min() > 1.0


@pytest.mark.parametrize('order', ORDERS)
def test_a_pallet_of_light_and_heavy_boxes_comes_to_rest_soon_after_it_lands(order: str) -> None:
    """Boxes of 0.2 to 100 kg, by own contacts at uneven steps of up to 8 ms."""
    assert run(partial(landed_pallet, order), TIMINGS[3]).rest < 2.0


@pytest.mark.parametrize('order', [ORDERS[0], ORDERS[3], ORDERS[4]])
def test_goods_that_land_in_steps_of_a_frame_rest_no_deeper_than_wanted(order: str) -> None:
    """With contacts anew in finer sub-steps, which heavy goods on light ones take at once."""
    outcome = run(partial(landed_pallet, order), OWN_FRAMES)
    assert outcome.rest < 2.0 and outcome.deepest < 1.0


def test_a_jittered_tower_hardly_sways_in_steps_of_a_frame() -> None:
    """By over-relaxation: without it, at 25 mm/s after 8 s."""
    assert run(partial(tower, 20, jitter=0.03), OWN_FRAMES).end_speed < 1e-3


@pytest.mark.parametrize('make', [card_house, pallet])
def test_what_sways_comes_to_rest_in_steps_of_a_frame(make: Callable[[], Scene]) -> None:
    """A card house of 5 storeys and a pallet of ten layers, within a second; no box walks away.

    Where all that rolls is an impact, a card walks by a metre.
    """
    outcome = run(lambda: replace(make(), seconds=2.0), TIMINGS[2])
    assert outcome.rest < 1.0 and outcome.moved < 20.0


def test_what_has_swayed_is_still() -> None:
    """Fewer iterations begin again where it rests, and do not make it sway anew."""
    assert run(mixed, TIMINGS[1]).end_speed < 1e-6


@pytest.mark.parametrize('timing', TIMINGS, ids=str)
@pytest.mark.parametrize('make', [partial(slope, 'plate'), partial(slope, 'tall'),
                                  partial(ratio, 10.0), partial(off_centre, 0.45)])
def test_loads_come_to_rest_at_every_timing(make: partial[Scene], timing: Timing) -> None:
    """Also with answers that come late: below the angle of friction, 10 on 1, off the centre."""
    outcome = run(make, timing)
    assert outcome.rest < 3.0 and outcome.moved < 10.0 and outcome.turned < 0.5


@pytest.mark.parametrize('timing, rest', [(TIMINGS[5], 0.3), (TIMINGS[6], 3.0)], ids=str)
def test_heavy_on_light_comes_to_rest_by_late_answers(timing: Timing, rest: float) -> None:
    """100 on 1: what an answer finds closing is slowed over several steps, not at once."""
    assert timing.latency > 0.0
    assert run(partial(ratio, 100.0), timing).rest < rest


@pytest.mark.parametrize('make, seconds', [(partial(landed_pallet, ORDERS[-1]), 4.7),
                                           (card_house, 5.1)])
def test_rubble_comes_to_rest_by_late_answers(make: Callable[[], Scene], seconds: float) -> None:
    """What fell at 50 Hz and 5 ms late: friction does not move from answer to answer."""
    outcome = run(make, TIMINGS[6])
    assert outcome.turned > 45.0 and outcome.rest < seconds


def test_a_tower_on_a_turntable_does_not_sway() -> None:
    """Three cubes 2 m from the axis, in steps of 4 ms."""
    scene = replace(turntable(), seconds=4.0)
    for _ in steps(scene, TIMINGS[1]):
        pass
    assert np.abs(scene.boxes.velocity[1:, 3:5]).max() < 1e-5


@pytest.mark.parametrize('order', ORDERS)
def test_real_pallets_stand(order: str) -> None:
    """Every box of a stable set stays within 5 mm and 0.5°, with answers at each step of 1 ms."""
    assert stays(lambda: sideways(order, 0.0), TIMINGS[0]).all()


def test_mujoco_slips_least_with_what_its_documentation_advises() -> None:
    """A plate on a slope of 25 degrees, by the speed at which it ends [m/s]."""
    plain, elliptic, noslip = (
        run(lambda: replace(slope('plate'), seconds=2.0), way).end_speed for way in MUJOCO)
    assert plain > 1e-3 > 5.0 * elliptic > 1e3 * noslip


def test_a_run_tells_what_its_time_goes_to() -> None:
    """The parts are less than the whole; MuJoCo's step is one call."""
    ours, theirs = (run(lambda: replace(tower(2), seconds=0.02), timing)
                    for timing in (TIMINGS[0], MUJOCO[0]))
    assert 0.0 < ours.hold < ours.contacts + ours.hold < ours.cost
    assert theirs.cost > 0.0 and np.isnan([theirs.contacts, theirs.hold]).all()


def test_a_push_topples_boxes() -> None:
    """Boxes that are pushed by 0.3 of their weight do not all stay."""
    assert not stays(lambda: sideways(ORDERS[0], 0.3), TIMINGS[0]).all()


def test_the_program(monkeypatch: pytest.MonkeyPatch, tmp_path: Path,
                     capsys: pytest.CaptureFixture[str]) -> None:
    """A scene that does not come to rest: status 1, its speed in bold, and a line on stderr."""
    falls = partial(Scene, 'falls', Boxes.of([((1.0, 1.0, 1.0), 1.0, (0, 0, 0))]), 0.2)
    monkeypatch.setattr(stacks, 'SCENES', (falls,))
    monkeypatch.setattr(stacks, 'ORDERS', ())
    monkeypatch.setattr(rivals, 'engines', lambda made: ({}, []))
    monkeypatch.setattr(rivals, 'report', lambda *_, quick: dict.fromkeys(
        ('engines', 'times', 'ways', 'box3d', 'missing'), ''))
    assert stacks.main(['--out', str(tmp_path)]) == 1
    assert 'stacks: falls does not come to rest' in capsys.readouterr().err
    assert '| falls | **' in (tmp_path / 'stacks.md').read_text()
    with (tmp_path / 'stacks.csv').open() as file:
        assert [row['way'] for row in csv.DictReader(file)] == [
            *map(str, TIMINGS), *map(str, MUJOCO)]


def test_pairs_are_recorded(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Those whose bounding boxes overlap, as placed and by each engine; they touch at rest."""
    monkeypatch.setattr(stacks, 'SCENES', (partial(tower, 2),))
    assert stacks.main(['--record', str(tmp_path / 'pairs.npz')]) == 0
    found = settled.read(tmp_path / 'pairs.npz')
    assert set(found.scene) == {'tower of 2'}
    assert set(found.engine) == {settled.PLACED, settled.OURS, 'MuJoCo'}
    sets = settled.by_engine(found)
    for name in (settled.PLACED, f'settled by {settled.OURS}'):
        assert len(sets[name].size) == 2
    assert len(settled.by_scene(found)['tower of 2'].size) == 2


def test_the_map_tells_rest_from_creep_and_fall(tmp_path: Path) -> None:
    """A box that falls with the best answers, too, is no fault; the picture has every run."""
    parts = {'cost': '100', 'contacts': '30', 'hold': '10'}
    still = {'rest': '0.3', 'end_speed': '1e-9', 'turned': '0', **parts}
    moves = {'rest': '', 'end_speed': '0.57', 'turned': '60', **parts}
    assert stacks_picture.cell(still, still)[0] == '0.3 s'
    assert stacks_picture.cell(moves, still)[0] == 'fell'
    text, colour = stacks_picture.cell(moves, moves)
    assert text == '570 mm/s' and colour != stacks_picture.cell({**moves, 'end_speed': '0.002'},
                                                                moves)[1]
    rows = [{'scene': scene, 'way': way, **run} for scene, way, run in (
        ('tower', 'each step', still), ('tower', str(MUJOCO[0]), moves),
        ('heap', 'each step', moves), ('heap', str(MUJOCO[0]), still))]
    output.write_csv(tmp_path / 'stacks.csv', rows)
    for draw in (stacks_picture.draw, stacks_picture.draw_parts):
        picture = tmp_path / f'{draw.__name__}.png'
        draw(picture, tmp_path / 'stacks.csv')
        assert picture.stat().st_size > 10_000

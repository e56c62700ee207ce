# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The table of hard cases: what its program prints, and its figures against theory."""
from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('mujoco')

from benchmarks import force_lines, output, stack_scenes, stacks
from benchmarks.force_lines import MILLISECOND, Line, runs
from benchmarks.loops import FRAME, MUJOCO, TIMINGS, Boxes, Mujoco, Scene, Timing, steps
from box_contact_ros.forces.patch_forces import GRAVITY


def test_uneven_steps_fall_as_even_ones() -> None:
    """½·g·t² of a free box, whatever the steps; their times add up."""
    timing = Timing.uneven((0.001, 0.003, 0.002))
    assert str(timing) == '1, 3, 2 ms, each step, own contacts'
    boxes = Boxes.of([((1.0,) * 3, 1.0, (0, 0, 9))])
    loop = list(steps(Scene('falls', boxes, 0.6), timing))[-1]
    assert loop.time == pytest.approx(0.6, rel=1e-12) and loop.tick == 300
    assert boxes.velocity[0, 2] == pytest.approx(-GRAVITY * 0.6, rel=1e-12)
    assert boxes.pose[0, 2] == pytest.approx(9.0 - 0.5 * GRAVITY * 0.6**2, abs=0.005)


@pytest.mark.parametrize('timing', [MUJOCO[0], TIMINGS[0]])
def test_a_driven_deck_and_a_belt(timing: Timing | Mujoco) -> None:
    """A deck comes to the angle that its rate gives, and a belt carries while it stays."""
    scene = stack_scenes.rolling_deck()
    scene.seconds = 2.5  # a quarter of a period
    for _ in steps(scene, timing):
        pass
    assert 2.0 * math.asin(scene.boxes.pose[0, 3]) == pytest.approx(math.radians(20.0), rel=1e-3)
    assert stacks.moved(scene.boxes, stack_scenes.rolling_deck().boxes.pose)[0].max() < (
        0.5 if isinstance(timing, Timing) else 20.0)  # MuJoCo creeps
    floor = ((60.0, 60.0, 1.0), 0.0, (0.0, 0.0, -0.5))
    scene = Scene('belt', Boxes.of([floor, ((1.0, 1.0, 0.2), 8.0, (0, 0, 0.1))]), 0.5,
                  belt=(0.35, 0.0, 0.0))
    for _ in steps(scene, timing):
        pass
    assert scene.boxes.velocity[1, 0] == pytest.approx(0.35, rel=0.01)
    assert scene.boxes.pose[0].tolist() == [0, 0, -0.5, 0, 0, 0, 1]


@pytest.mark.parametrize('make', [stack_scenes.seesaw, stack_scenes.table,
                                  stack_scenes.reach_stacker, stack_scenes.twin_spreader])
def test_scenes_of_theory_stand(make) -> None:
    """A seesaw within its bar, feet around the mass, and what is below a container that rises."""
    scene = make()
    start = scene.boxes.pose.copy()
    for _ in runs(scene, Timing.uneven((0.004,))):
        pass
    way, _ = stacks.moved(scene.boxes, start)
    assert way[:4].max() < 2.0


def test_a_seesaw_tips_beyond_its_bar() -> None:
    """From 0.66 % on."""
    scene = stack_scenes.seesaw(0.02)
    scene.seconds = 2.5
    for _ in runs(scene, Timing.uneven((0.004,))):
        pass
    assert scene.boxes.pose[4, 2] < 0.24  # from 0.25


def test_what_slides_on_a_lorry_is_seen_from_it() -> None:
    """By 0.6 g a crate slides by ½·(0.6 − μ)·g·t²; `moved` is relative to the lorry."""
    scene = stack_scenes.braking_lorry(0.6)
    start, scene.seconds = scene.boxes.pose.copy(), 1.0
    for _ in runs(scene, MILLISECOND):
        pass
    way, _ = stacks.moved(scene.boxes, start)
    assert way[0] == pytest.approx(1e3 * 0.5 * 0.1 * GRAVITY, rel=0.05)


def test_the_program(monkeypatch: pytest.MonkeyPatch, tmp_path: Path,
                     capsys: pytest.CaptureFixture[str]) -> None:
    """Status 1 and a word if a figure is beyond its line, or none; a row each in the CSV."""
    figures = {'met': 0.5, 'missed': 2.0, 'never': math.nan}

    def planted(*, quick: bool) -> Iterator[Line]:
        for case in figures:
            yield Line(subject='planted', case=case, what='x [mm]', figure=figures[case], line=1.0)

    monkeypatch.setattr(force_lines, 'SUBJECTS', {'gaps': planted})
    assert force_lines.main(['--out', str(tmp_path)]) == 1
    words = capsys.readouterr().out
    assert '| planted | missed | x [mm] | 2 | 1 | **beyond** |' in words
    assert '| planted | met | x [mm] | 0.5 | 1 |  |' in words
    assert '2 of 3 figures beyond' in words
    with (tmp_path / 'force_lines.csv').open() as file:
        assert [row['case'] for row in csv.DictReader(file)] == list(figures)
    figures.update(missed=1.0, never=0.0)
    assert force_lines.main(['--out', str(tmp_path)]) == 0


def test_the_page_lists_all_numbers_of_the_method() -> None:
    """Each constant of the header, with what it means, is on the page that was written last."""
    text = force_lines.TUNING.read_text('utf-8')
    numbers = force_lines.tuned_numbers(text)
    names = [name for number in numbers for name in number.names.split(', ')]
    lines = '\n'.join(re.findall('^constexpr.*', text, re.MULTILINE))
    assert names == re.findall(r'(\w+) = ', lines) and len(names) > 40
    assert all(number.meaning and number.subject for number in numbers)
    page = (output.ROOT / output.RESULTS / 'force_lines.md').read_text('utf-8')
    for number in numbers:
        assert f'| {number.names} | {number.values} | {number.meaning} |' in page


def test_patterns_are_as_long_as_they_say() -> None:
    """Frames have 1/60 s; random steps are within their limits."""
    lengths = {name: np.array(found[0]) for name, found in force_lines.patterns().items()}
    for name in ('3, 3, 3, 7.67 ms', '3, 3, 3, 3, 4.67 ms'):
        assert lengths[name].sum() == pytest.approx(FRAME, rel=1e-12)
    for name, least, most in (('1 to 4 ms at random', 1e-3, 4e-3),
                              ('1 µs to 20 ms at random', 1e-6, 0.02)):
        assert least <= lengths[name].min() < 1.1 * least
        assert 0.9 * most < lengths[name].max() <= most

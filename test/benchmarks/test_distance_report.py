# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report `distance`: the judge finds what is wrong, and every engine answers rightly."""
from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks import apart, distance, native_calls
from box_contact_ros.core import instruction_sets

pytestmark = pytest.mark.reports


@pytest.mark.parametrize('family', ['random', 'yaw, stacked, moved', 'tilts 1e-17 to 1e-12'])
def test_the_judge_finds_what_is_wrong(family: str) -> None:
    """A distance that is larger or smaller by 50 units, a point off its box, or another pair."""
    pairs, proof = distance.drawn_apart(family, 200)
    found = distance.distances(pairs)
    for bound, most in distance.BOUNDS.items():
        assert getattr(proof, bound).max() <= most
    for sign, bound in ((1, 'above'), (-1, 'below')):
        off = replace(found, distance=found.distance + sign * 50 * proof.unit)
        assert getattr(apart.prove(pairs, off), bound).min() > distance.BOUNDS[bound]
    off = replace(found, point_a=found.point_a + 50 * proof.unit[:, None] * found.normal)
    assert (apart.prove(pairs, off).outside > distance.BOUNDS['outside']).mean() > 0.9
    other = found[np.roll(np.arange(len(found)), 1)]
    assert apart.prove(pairs, other).length.max() <= distance.BOUNDS['length']
    assert apart.prove(pairs, other).outside.min() > 1e3


@pytest.mark.parametrize('family', apart.FAMILIES)
def test_families_are_apart_by_their_gaps(family: str) -> None:
    pairs = apart.draw(family, np.random.default_rng(5), 300)
    found = distance.distances(pairs)
    assert (~found.colliding).mean() > (0.2 if family == 'nearly touching' else 0.99)
    low, high = apart.FAMILIES[family].gap
    gap = found.distance / (pairs.size_a.max(axis=1) / 2.0)
    assert np.all((gap < 1.01 * high) & ((gap > 0.99 * low) | found.colliding | (low < 1e-15)))


def test_fuzz(capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch) -> None:
    assert distance.fuzz('needles', 1, 500)[2] == []
    monkeypatch.setitem(distance.BOUNDS, 'above', 0.5)
    assert len(distance.fuzz('needles', 1, 500)[2]) == 3


@pytest.mark.reports
@pytest.mark.skipif(shutil.which('g++') is None, reason='no compiler')
def test_all_answer_as_the_judge(tmp_path: Path) -> None:
    """To what their tolerances leave."""
    pytest.importorskip('mujoco')
    program = native_calls.compiled(tmp_path, 'distance')
    pairs, proof = distance.drawn_apart('swaying containers', 50)
    found = distance.timed(program, pairs, proof, instruction_sets()[-1],
                           native_calls.Effort(1, 50, 1, 50))
    assert {'bc_distance, single', 'bc_distance_rows, batch', distance.UNIT} <= set(found)
    for name, (nanoseconds, errors) in found.items():
        assert nanoseconds.shape == (1, 1) and errors.shape == (50,)
        assert errors.max() < (1e-15 if name.startswith('bc_') else 1e-3), name

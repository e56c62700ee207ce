# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the demonstration says before it starts, and its verdict; `make demo` runs it."""
from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip('mujoco')

from box_contact_ros.demo import demo
from box_contact_ros.demo.crane_node import verdict
from box_contact_ros.demo.landing import LandingResult


def test_a_model_without_a_patch_is_told_before_the_start():
    """A load may not come to rest on its contacts."""
    words = 'Model soup-8 gives points without a patch'
    assert words in demo._announcement(demo._options(['--model', 'soup-8']))
    assert words not in demo._announcement(demo._options(['--model', 'soup-8', '--open-loop']))
    told = demo._announcement(demo._options([]))
    assert 'without a patch' not in told and 'if the load comes to rest' in told


def test_an_unknown_model_ends_the_demo_before_it_starts(capsys):
    with pytest.raises(SystemExit, match='2'):
        demo.main(['--model', 'exakt'])
    assert 'did you mean exact?' in capsys.readouterr().err


AT_REST = {'settled': 1.234, 'corner_speed': 0.0, 'rope_tension': 0.0, 'force_worst': 0.0,
           'static_tilt': 0.0, 'depth': 0.001, 'gap': 0.0}


@pytest.mark.parametrize('faults, landing, words', [
    ([], None, 'PASS: 7 contacts, none lost; median latency 0.50 ms'),
    ([], AT_REST, 'PASS: the load is at rest, settled 1.2 s after the first touch; 7 contacts, '),
    ([], AT_REST | {'static_tilt': 1.0}, 'PASS: the load lies on the stack, not within all limits'),
    (['3 lost answers'], AT_REST, 'FAIL: 3 lost answers'),
    (['no contacts came'], {}, 'FAIL: no contacts came, the load did not come to rest on the st')])
def test_the_verdict_is_one_line_with_its_reasons(faults, landing, words):
    summary = SimpleNamespace(faults=list(faults), latencies=np.full(7, 0.5e-3),
                              result=SimpleNamespace(contacts=7))
    passed, line = verdict(summary, landing if landing is None else LandingResult(**landing))
    assert line.startswith(words) and passed == (not faults)


def test_help_breaks_no_name_at_its_hyphen(capsys):
    with pytest.raises(SystemExit, match='0'):
        demo.main(['--help'])
    assert 'soup-N' in capsys.readouterr().out

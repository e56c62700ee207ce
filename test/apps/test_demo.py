# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the demonstration says before it starts; `make demo` runs it."""
from __future__ import annotations

import pytest

pytest.importorskip('mujoco')

from box_contact_ros.apps import demo


def test_a_model_without_a_patch_is_told_before_the_start():
    """A load may not come to rest on its contacts."""
    words = 'Model fcl gives points without a patch'
    assert words in demo._announcement(demo._options(['--model', 'fcl']))
    assert words not in demo._announcement(demo._options(['--model', 'fcl', '--open-loop']))
    told = demo._announcement(demo._options([]))
    assert 'without a patch' not in told and 'if the load comes to rest' in told


def test_an_unknown_model_ends_the_demo_before_it_starts(capsys):
    with pytest.raises(SystemExit, match='2'):
        demo.main(['--model', 'exakt'])
    assert 'the nearest name is exact' in capsys.readouterr().err

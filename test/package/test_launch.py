# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the launch file of the contact node gives to it, without ROS's launch: it has no wheel."""
from __future__ import annotations

import runpy
import sys
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import pytest

from box_contact_ros.node.parameters import CONTACT_PARAMETERS

LAUNCH = Path(__file__).resolve().parents[2] / 'launch'


@pytest.mark.parametrize('given, kinds', [
    ({}, {}), ({'autostart': 'false', 'scene': 'yard.yaml'}, {'scene': str, 'autostart': bool}),
    ({'pair_topics': 'false', 'margin': '1', 'size_a': '[2, 2, 2]', 'use_sim_time': 'true'},
     {'pair_topics': bool, 'margin': float, 'size_a': None, 'use_sim_time': bool})])
def test_an_argument_that_nobody_gives_leaves_the_file_alone(
        monkeypatch: pytest.MonkeyPatch, given: dict[str, str], kinds: dict[str, type]) -> None:
    """Parameters after the file replace those in it: only what was typed is among them."""
    for name in ('launch', 'launch.actions', 'launch.substitutions', 'launch_ros.actions',
                 'launch_ros.parameter_descriptions', 'launch_ros.substitutions'):
        monkeypatch.setitem(sys.modules, name, Mock())
    sys.modules['launch.substitutions'].LaunchConfiguration = lambda name: SimpleNamespace(
        perform=lambda context: context.get(name, ''))
    sys.modules['launch_ros.parameter_descriptions'].ParameterValue = lambda _, value_type: (
        value_type)
    defaults = {}
    sys.modules['launch.actions'].DeclareLaunchArgument = lambda name, *, default_value, **_: (
        defaults.update({name: default_value}))
    names = runpy.run_path(str(LAUNCH / 'contact_node.launch.py'))
    names['generate_launch_description']()
    assert {'use_sim_time', *CONTACT_PARAMETERS} <= defaults.keys()
    names['contact_node'](defaults | given)
    _, values = names['Node'].call_args.kwargs['parameters']
    assert values == kinds

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What setup.py asks for is enough: nothing that only the tests' environment has is used."""
from __future__ import annotations

import subprocess
import sys

import pytest
from patience import PATIENCE

RUN = """
import re, sys
from importlib.metadata import PackageNotFoundError, packages_distributions, requires

NEEDED, PROGRAM = {needed!r}, {program!r}


def name_of(requirement):
    return re.match(r'[A-Za-z0-9._-]+', requirement)[0].lower().replace('_', '-')


installed, open_ = set(), [name_of(requirement) for requirement in NEEDED]
while open_:
    name = open_.pop()
    if name not in installed:
        installed.add(name)
        try:
            open_ += [name_of(r) for r in requires(name) or () if 'extra ==' not in r]
        except PackageNotFoundError:  # of another platform
            pass
refused = {{module for module, names in packages_distributions().items()
           if not installed & {{name.lower().replace('_', '-') for name in names}}}}
refused -= {{'box_contact_ros', '_ros_wheels_bootstrap'}}


class Refusing:
    def find_spec(self, name, path=None, target=None):
        if name.partition('.')[0] in refused:
            raise ModuleNotFoundError(f'No module named {{name!r}} here', name=name)


sys.meta_path.insert(0, Refusing())
exec(PROGRAM)
"""
SOLVER = """
from box_contact_ros import ContactSolver, make_model
from box_contact_ros.scene.scene_solver import SceneSolver
from box_contact_ros.scene.scene_file import read_scene
for model in ('exact', 'mlp', 'paper'):
    ContactSolver((2, 2, 2), (2, 2, 2), model=make_model(model))([0] * 6 + [1], [0] * 6 + [1])
SceneSolver(read_scene('config/scenes/yard_bay.yaml'))
"""
NODE = """
import rclpy
from rclpy.parameter import Parameter
from box_contact_ros.node.contact_node import ContactNode
context = rclpy.Context()
rclpy.init(context=context)
node = ContactNode(context, parameter_overrides=[
    Parameter('scene', value='config/scenes/yard_bay.yaml')])
node.start()
node.destroy_node()
context.try_shutdown()
"""


@pytest.mark.parametrize('names, beside, program', [
    ((), [], SOLVER), (('ros',), ['box_contact_msgs'], NODE)], ids=['solver', 'node'])
def test_installed_without_extras(names, beside, program, setup_arguments, tmp_path):
    """From another folder than the checkout, too: scenes of the package's own are found.

    beside: the package of messages, which is installed from the checkout with the extra ros.
    """
    needed = [*setup_arguments['install_requires'], *beside, *(
        requirement for name in names for requirement in setup_arguments['extras_require'][name])]
    script = RUN.format(needed=needed, program=program)
    done = subprocess.run([sys.executable, '-c', script], cwd=tmp_path, capture_output=True,
                          text=True, timeout=PATIENCE)
    assert done.returncode == 0, done.stderr

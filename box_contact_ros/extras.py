# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Extras of setup.py: what misses one ends in a line that names it.

A program parses its arguments, calls `require`, and then imports modules of extras. Folders of
programs that run from the checkout call `expect_extras`, and import what they like.
"""
from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.util import find_spec
from types import TracebackType

MODULES = {
    'ros': ('rclpy', 'box_contact_msgs', 'builtin_interfaces', 'composition_interfaces',
            'diagnostic_msgs', 'geometry_msgs', 'lifecycle_msgs', 'rcl_interfaces', 'rosgraph_msgs',
            'sensor_msgs', 'std_msgs', 'std_srvs', 'tf2_ros', 'visualization_msgs'),
    'sim': ('mujoco',), 'view': ('viser',), 'bag': ('rosbags',), 'soup': ('fcl',),
    'plans': ('clarabel', 'scipy'), 'train': ('torch',), 'report': ('matplotlib', 'PIL', 'tqdm'),
    'fuzz': ('gmpy2', 'mpmath'), 'peers': ('coal', 'pybullet'), 'cluster': ('distributed',),
    'test': ('catkin_pkg', 'hypothesis')}
"""The modules of each extra; an extra is missing where its first module is."""
EXTRA_OF = {module: extra for extra, modules in MODULES.items() for module in modules}
APT = ', or apt install ros-jazzy-ros-base and source /opt/ros/jazzy/setup.bash'


class MissingExtra(ModuleNotFoundError):
    """An extra that is not installed. A program ends with its one line instead of a traceback."""


def require(*extras: str) -> None:
    """Raise MissingExtra, with the command that installs what is missing, for absent extras."""
    expect_extras()
    missing = [extra for extra in extras if find_spec(MODULES[extra][0]) is None]
    if missing:
        module = MODULES[missing[0]][0]
        raise MissingExtra(_words(module, missing), name=module)


def expect_extras() -> None:
    """Let a missing module of an extra end this process in one line."""
    sys.excepthook = _end_in_one_line


def _words(module: str, extras: Sequence[str]) -> str:
    return (f'box_contact_ros: the Python module {module!r} is not installed: in the checkout, '
            f"pip install -c constraints.txt -e '.[{','.join(extras)}]'"
            f'{APT if "ros" in extras else ""}')


def _end_in_one_line(kind: type[BaseException], error: BaseException,
                     trace: TracebackType | None) -> None:
    extra = EXTRA_OF.get(getattr(error, 'name', None) or '')
    if isinstance(error, MissingExtra):
        print(error, file=sys.stderr)
    elif isinstance(error, ModuleNotFoundError) and extra:
        print(_words(str(error.name), [extra]), file=sys.stderr)
    else:
        sys.__excepthook__(kind, error, trace)

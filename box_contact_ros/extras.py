# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Extras of setup.py: a folder or module names its own, and a missing one ends in one line."""
from __future__ import annotations

import sys
from importlib.util import find_spec
from types import TracebackType

MODULES = {'ros': 'rclpy', 'sim': 'mujoco', 'view': 'viser', 'soup': 'fcl', 'report': 'matplotlib',
           'plans': 'clarabel'}
"""A module by which each extra is known."""
APT = ', or apt install ros-jazzy-ros-base and source /opt/ros/jazzy/setup.bash'


class MissingExtra(ModuleNotFoundError):
    """An extra that is not installed. A program ends with its one line instead of a traceback."""


def require(*extras: str) -> None:
    """Raise MissingExtra, with the command that installs what is missing, for absent extras."""
    missing = [extra for extra in extras if find_spec(MODULES[extra]) is None]
    if not missing:
        return
    sys.excepthook = _end_in_one_line
    module = MODULES[missing[0]]
    raise MissingExtra(
        f'box_contact_ros: the Python module {module!r} is not installed: in the checkout, '
        f"pip install -c constraints.txt -e '.[{','.join(missing)}]'"
        f'{APT if "ros" in missing else ""}', name=module)


def _end_in_one_line(kind: type[BaseException], error: BaseException,
                     trace: TracebackType | None) -> None:
    if issubclass(kind, MissingExtra):
        print(error, file=sys.stderr)
    else:
        sys.__excepthook__(kind, error, trace)

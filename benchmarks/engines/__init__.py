# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What answers for a pair of boxes: this package's models and the engines that users would take.

Each `*_engines.py` imports one library and lists its `ENGINES`, functions that make them.
"""
from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from importlib import import_module

from ..contestant import Contestant

RIVALS = {'mujoco': "extra 'sim'", 'fcl': "extra 'soup'", 'coal': "extra 'peers'",
          'bullet': "extra 'peers'", 'drake': 'pip install drake'}
"""The engines' modules, each with what brings its library."""
DYNAMICS = {'box3d': 'make rivals', 'jolt': 'make rivals', 'rapier': "extra 'peers'",
            'mujoco': RIVALS['mujoco']}
"""Engines that move bodies, which `stacks` compares with, each with what brings it."""


def add_leave_out(parser: argparse.ArgumentParser) -> None:
    """Add the argument that names rivals which a full run may miss."""
    names = tuple(RIVALS | DYNAMICS)
    parser.add_argument('--leave-out', nargs='+', choices=names, default=[], metavar='RIVAL',
                        help=f'of {", ".join(names)}: rivals that a full run may '
                        'miss; any other that is missing ends it at once')


def may_miss(program: str, missing: Iterable[str], left_out: Iterable[str]) -> bool:
    """Return whether all that is missing was left out on purpose; else say what to do.

    missing: lines or names that begin with a rival's.
    """
    wrong = [line for line in missing if line.split()[0].lower() not in left_out]
    for line in wrong:
        print(f'{program}: {line}: install it, or add --leave-out {line.split()[0].lower()}',
              file=sys.stderr)
    return not wrong


def installed(modules: Iterable[str] = tuple(RIVALS)) -> tuple[list[Contestant], list[str]]:
    """Return the rivals that can be imported, and a line about each that cannot."""
    found, missing = [], []
    for module in modules:
        try:
            makers = import_module(f'.{module}_engines', __name__).ENGINES
            found += [make() for make in makers]
        except ImportError as error:
            missing.append(f'{module} is not installed ({RIVALS[module]}: {error})')
    return found, missing

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What answers for a pair of boxes: this package's models and the engines that users would take.

Each `*_engines.py` imports one library and lists its `ENGINES`, functions that make them.
"""
from __future__ import annotations

from collections.abc import Iterable
from importlib import import_module

from ..contestant import Contestant

RIVALS = {'mujoco': "extra 'sim'", 'fcl': "extra 'soup'", 'coal': "extra 'peers'",
          'bullet': "extra 'peers'", 'drake': 'pip install drake'}
"""The engines' modules, each with what brings its library."""


def installed(modules: Iterable[str] = tuple(RIVALS)) -> tuple[list[Contestant], list[str]]:
    """Return the rivals that can be imported, and a line about each that cannot."""
    found, missing = [], []
    for module in modules:
        try:
            makers = import_module(f'.{module}_engines', __name__).ENGINES
            found += [make() for make in makers]
        except ImportError as error:
            missing.append(f'{error.name or module} is not installed ({RIVALS[module]})')
    return found, missing

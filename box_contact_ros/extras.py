# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Extras of setup.py: what misses one ends in a line that names it, and `--help` needs none.

A folder or module of the package names its extras by `require`. Folders of programs that run from
the checkout call `expect_extras`, and import what they like.
"""
from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType, TracebackType
from typing import Any

MODULES = {
    'ros': ('rclpy', 'box_contact_msgs', 'builtin_interfaces', 'diagnostic_msgs', 'geometry_msgs',
            'rcl_interfaces', 'std_msgs', 'std_srvs', 'visualization_msgs'),
    'sim': ('mujoco',), 'view': ('viser',), 'soup': ('fcl',), 'train': ('torch',),
    'report': ('matplotlib', 'PIL', 'tqdm'), 'fuzz': ('gmpy2', 'mpmath'),
    'plans': ('clarabel', 'scipy')}
"""The modules of each extra; an extra is missing where its first module is."""
EXTRA_OF = {module: extra for extra, modules in MODULES.items() for module in modules}
APT = ', or apt install ros-jazzy-ros-base and source /opt/ros/jazzy/setup.bash'


CHECKOUT = ('benchmarks', 'training', 'figures/make_')
"""How the names of programs begin that run from the checkout."""


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
    """Let a program's `--help` need no extra, and a missing module end in one line."""
    sys.excepthook = _end_in_one_line
    if _asks_for_help() and not any(isinstance(finder, HelpFinder) for finder in sys.meta_path):
        sys.meta_path.append(HelpFinder())


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


# --- help without extras --------------------------------------------------------------------------


def _asks_for_help() -> bool:
    """Return whether this process prints the help of one of our programs, and nothing else."""
    words = sys.orig_argv[1:]  # sys.argv lacks the module's name while it is imported
    if {'-h', '--help'}.isdisjoint(words):
        return False
    # bin/box_contact_NAME by pip, lib/box_contact_ros/NAME by colcon, -m MODULE
    programs = ('/'.join(Path(word).parts[-2:]) for word in words)
    return any('box_contact_' in name or name.startswith(CHECKOUT) for name in programs)


class HelpFinder(MetaPathFinder, Loader):
    """Finds a missing module of an extra as a `Stub`: help is made of defaults and words alone."""

    def find_spec(self, name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        """Return the spec of a stub for an extra's module or a part of one, None for others."""
        root = name.partition('.')[0]
        return ModuleSpec(name, self, is_package=True) if root in EXTRA_OF else None

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """Return an empty module, any name of which is a stub."""
        module = ModuleType(spec.name)
        module.__getattr__ = _stub  # type: ignore[method-assign]
        return module

    def exec_module(self, module: ModuleType) -> None:
        """Do nothing."""


class _StubType(type):
    def __getattr__(cls, name: str) -> Any:
        return _stub(name)


class Stub(Exception, metaclass=_StubType):
    """What a name of a missing module is: a class to call, to derive from, or to catch."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        pass

    def __call__(self, *arguments: Any, **options: Any) -> Stub:
        """Return a stub: a decorator's function, too, becomes one."""
        return self

    def __getattr__(self, name: str) -> Any:
        return _stub(name)


def _stub(name: str) -> Any:
    if name.startswith('__'):
        raise AttributeError(name)
    return _StubType(name, (Stub,), {})

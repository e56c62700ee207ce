# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The house: imports point one way, and nothing installed knows benchmarks or training."""
from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path
from unittest.mock import Mock

import pytest
from conftest import pytest_collection_modifyitems
from patience import PATIENCE

ROOT = Path(__file__).resolve().parents[2]
NAME = 'box_contact_ros'
ORDER = ('extras', 'resources', 'core', 'solver', 'models', 'forces', 'scene', 'stream',
         'arguments', 'processes', 'plans', 'node', 'bench', 'demo', 'view')
"""A folder, or module of the root, imports only itself and those before it."""
OUTSIDE = ('benchmarks', 'training')
HEADER = ('Copyright 2026 The box_contact_ros maintainers', 'SPDX-License-Identifier: Apache-2.0')
"""What the first lines of each source file say, after a shebang."""
SOURCES = {*ROOT.glob('*.py'), *(path for folder in (NAME, *OUTSIDE, 'docs', 'launch', 'test')
                                 for suffix in ('c', 'cpp', 'h', 'hpp', 'py', 'pyi', 'sh')
                                 for path in (ROOT / folder).rglob(f'*.{suffix}'))}
INSTALLED = sorted(path for path in SOURCES if (ROOT / NAME) in path.parents)


@cache
def nodes(file: Path) -> list[ast.AST]:
    """Return the nodes of a file's syntax tree."""
    return list(ast.walk(ast.parse(file.read_text('utf-8'))))


def imported(file: Path) -> Iterator[str]:
    """Yield the dotted path of each module, or name of a module, that a file imports."""
    here = file.relative_to(ROOT).parent.parts
    for node in nodes(file):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = here[:len(here) + 1 - node.level] if node.level else ()
            module = '.'.join(filter(None, (*above, node.module)))
            yield from (f'{module}.{alias.name}' for alias in node.names)


def rank(module: str) -> int:
    """Return the place in ORDER of a dotted path below the package: that of its longest part."""
    part = max((part for part in ORDER if f'{module}.'.startswith(f'{part}.')), key=len)
    return ORDER.index(part)


def test_imports_point_one_way() -> None:
    """But for the package itself, which exports names of all, and __main__, which prints paths."""
    files = {file: '.'.join(file.relative_to(ROOT / NAME).with_suffix('').parts)
             for file in INSTALLED if file.suffix == '.py'}
    inner = {file: module for file, module in files.items() if module not in (
        '__init__', '__main__')}
    assert len(inner) > 50
    assert [(module, name) for file, module in inner.items() for name in imported(file)
            if name.startswith(f'{NAME}.') and rank(name.removeprefix(f'{NAME}.')) > rank(module)
            ] == []


def test_imports_make_no_circle() -> None:
    """Also those within functions. But for the package itself, which exports names of all."""
    modules = {'.'.join(file.relative_to(ROOT).with_suffix('').parts): file
               for file in INSTALLED if file.suffix == '.py' and file.name != '__init__.py'}
    graph = {module: {name if name in modules else name.rpartition('.')[0]
                      for name in imported(file)} & modules.keys() - {module}
             for module, file in modules.items()}
    assert sum(map(len, graph.values())) > 200
    assert [*TopologicalSorter(graph).static_order()]  # raises CycleError


def test_only_the_root_imports_by_name() -> None:
    assert [str(file) for file in INSTALLED if file.suffix == '.py'
            and file != ROOT / NAME / '__init__.py' and 'importlib.import_module' in {
                *imported(file)}] == []


def test_nothing_installed_names_what_is_not() -> None:
    """Nor in a comment: what the package is good for must be clear without."""
    assert len(INSTALLED) > 80
    assert [str(file) for file in INSTALLED
            if any(f'{name}/' in file.read_text('utf-8') for name in OUTSIDE)
            or file.suffix == '.py' and any(
                name.split('.')[0] in OUTSIDE for name in imported(file))] == []


def test_all_nodes_are_guarded() -> None:
    """A class that derives from rclpy's node derives from GuardedNode first."""
    for file in INSTALLED:
        for node in nodes(file) if file.suffix == '.py' else ():
            if isinstance(node, ast.ClassDef) and node.name != 'GuardedNode':
                bases = [base.id for base in node.bases if isinstance(base, ast.Name)]
                assert bases[:1] == ['GuardedNode'] or not {'Node', 'LifecycleNode'} & set(bases), (
                    f'{file}: {node.name}')


def test_a_test_that_hangs_is_ended(tmp_path: Path) -> None:
    """Although it has Python's lock, as it has where Fast DDS hangs; the traceback names it."""
    (tmp_path / 'test_hanging.py').write_text('from ctypes import PyDLL\n'
                                              'def test_it(): PyDLL(None).sleep(1000)\n')
    done = subprocess.run(
        [sys.executable, '-m', 'pytest', '-c', ROOT / 'pyproject.toml', '--rootdir', tmp_path,
         '-o', 'faulthandler_timeout=0.2', tmp_path], capture_output=True, text=True,
        timeout=PATIENCE)
    assert done.returncode == 1 and 'test_hanging.py", line 2 in test_it' in done.stderr


@pytest.mark.parametrize(('asked', 'kept'), [('', 'plain'), ('network', 'plain network')])
def test_the_suite_needs_no_network(asked: str, kept: str) -> None:
    """Neither PyTorch nor an emulator: what has a target of its own is left out, unless -m asks."""
    names = ('plain', 'network', 'training', 'arm')
    items = [Mock(path=ROOT, get_closest_marker={name: name}.get) for name in names]
    pytest_collection_modifyitems(Mock(option=Mock(markexpr=asked)), items)
    assert [name for name in names if any(item.get_closest_marker(name) for item in items)] == (
        kept.split())


def test_every_source_file_has_a_header() -> None:
    assert [str(file) for file in SOURCES if not all(
        line in '\n'.join(file.read_text('utf-8').splitlines()[:3]) for line in HEADER)] == []

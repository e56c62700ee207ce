# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The house of the package: order of imports, the root, length of functions, headers.

DESIGN's list of folders is `FOLDERS`: a folder imports only folders that stand above it.
"""
from __future__ import annotations

import ast
import subprocess
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NAME = 'box_contact_ros'

FOLDERS = ('core', 'solver', 'scene', 'node', 'apps', 'baselines', 'verification', 'training',
           'reports')
EVERYBODYS = ('output', 'resources')
"""Root modules that every folder may import, and that import none of the folders."""
ROOT_MODULES = ('__init__', '__main__', 'cli', *EVERYBODYS)
ROOT_ENTRIES = {*FOLDERS, *(f'{name}.py' for name in ROOT_MODULES), 'py.typed'}
FUNCTION_LINES_MAX = 60
HEADER = ('Copyright 2026 The box_contact_ros maintainers', 'SPDX-License-Identifier: Apache-2.0')
"""What the first lines of each source file say, after a shebang."""
SOURCES = ('.c', '.cmake', '.cpp', '.h', '.hpp', '.mjs', '.py', '.pyi', '.sh')
SOURCES_BY_NAME = ('CMakeLists.txt', 'Makefile', 'run', 'setup')


class House:
    """The files of a package: what git would commit, or what the folder holds."""

    def __init__(self, package: Path):
        self.package = package
        self.files = listed(package)
        self.trees = {file: ast.parse(file.read_text('utf-8')) for file in self.files
                      if file.suffix in ('.py', '.pyi')}

    def name(self, file: Path) -> str:
        """Return a file's path below the package."""
        return file.relative_to(self.package).as_posix()

    def definitions(self, *kinds: type[ast.AST]) -> Iterator[tuple[Path, ast.AST]]:
        """Yield file and node of every definition at any depth, except in stubs of modules."""
        for file, tree in self.trees.items():
            if file.suffix == '.py' or file.with_suffix('.py') not in self.trees:
                for node in ast.walk(tree):
                    if isinstance(node, kinds):
                        yield file, node


def listed(package: Path) -> list[Path]:
    """Return the files of a checkout that git does not ignore, else all but what was built."""
    command = ['git', 'ls-files', '-z', '--cached', '--others', '--exclude-standard']
    try:
        names = subprocess.run(command, cwd=package, capture_output=True, text=True).stdout
    except FileNotFoundError:  # no git
        names = ''
    files = [package / name for name in names.split('\0') if name] or [
        path for path in package.rglob('*')
        if path.suffix != '.so' and '__pycache__' not in path.parts]
    return sorted(path for path in files if path.is_file())


# --- the order of imports -------------------------------------------------------------------------


def imported(house: House, file: Path) -> Iterator[tuple[int, str]]:
    """Yield line and dotted path below the package of all that a file imports from the package."""
    here = (NAME, *file.relative_to(house.package).parent.parts)
    for node in ast.walk(house.trees[file]):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = '.'.join(here[:len(here) + 1 - node.level]) if node.level else ''
            module = '.'.join(filter(None, (above, node.module)))
            names = [f'{module}.{alias.name}' for alias in node.names]
        for name in names:
            first, _, rest = name.partition('.')
            if first == NAME and rest:
                yield node.lineno, rest


def part_of(path: str, exported: dict[str, str]) -> str:
    """Return the folder or root module that an imported path leads to.

    `exported` has the folders of the names that the root itself exports.
    """
    first = path.partition('.')[0]
    return exported.get(first, first)


def import_faults(house: House) -> Iterator[str]:
    """Yield imports against the order of the folders."""
    init = house.package / '__init__.py'
    exported = {}
    if init in house.trees:
        exported = {path.rpartition('.')[2]: path.partition('.')[0]
                    for _, path in imported(house, init)}
    for file in house.trees:
        own = house.name(file).partition('/')[0]
        for line, path in imported(house, file):
            part = part_of(path, exported)
            if not may_import(own, part):
                yield f'{house.name(file)}:{line} imports {path}'


def may_import(own: str, part: str) -> bool:
    """Return whether a folder, or a root module `NAME.py`, may import a folder or root module."""
    if own in FOLDERS:
        return part in EVERYBODYS or part in FOLDERS[:FOLDERS.index(own) + 1]
    if own == '__init__.py':
        return part in EVERYBODYS or part in ('solver', 'scene')
    if own.removesuffix('.py') in EVERYBODYS:
        return part in EVERYBODYS
    return part in ROOT_MODULES


# --- contents ------------------------------------------------------------------------------------


def root_faults(house: House) -> Iterator[str]:
    """Yield what does not belong into the root, and what it lacks."""
    root = {file.relative_to(house.package).parts[0] for file in house.files}
    for verb, names in (('has', root - ROOT_ENTRIES), ('lacks', ROOT_ENTRIES - root)):
        if names:
            yield f'the root {verb} {", ".join(sorted(names))}'


def function_faults(house: House) -> Iterator[str]:
    """Yield functions that are too long."""
    for file, node in house.definitions(ast.FunctionDef, ast.AsyncFunctionDef):
        lines = node.end_lineno - node.lineno + 1
        if lines > FUNCTION_LINES_MAX:
            yield f'{house.name(file)}:{node.lineno} {node.name} has {lines} lines'


RULES = {
    f'A folder imports only folders above it: {", ".join(FOLDERS)}.': import_faults,
    'The root holds these folders and a few modules.': root_faults,
    f'A function has at most {FUNCTION_LINES_MAX} lines.': function_faults,
}


def report(house: House) -> str:
    """Return all faults under the rules that they break; empty without a fault."""
    lines = []
    for rule, faults in RULES.items():
        if found := list(faults(house)):
            lines += ['', f'{rule} Against it: {len(found)}', *(f'  {fault}' for fault in found)]
    return '\n'.join(lines)


def test_the_package_keeps_its_house() -> None:
    """All faults are reported at once."""
    house = House(ROOT / NAME)
    assert len(house.trees) > 50
    if faults := report(house):
        pytest.fail(faults, pytrace=False)


# --- planted faults are found ---------------------------------------------------------------------


@pytest.fixture
def sound(tmp_path: Path) -> dict[str, str]:
    """Return the files of a package without a fault."""
    folders = {f'{folder}/__init__.py': '' for folder in FOLDERS}
    modules = {f'{name}.py': '' for name in ROOT_MODULES}
    return folders | modules | {
        '__init__.py': 'from .solver.ask import ask\n',
        '__main__.py': f'from {NAME} import cli\n',
        'py.typed': '',
        'core/stages.py': 'import numpy\nfrom ..resources import resource_path\n',
        'core/_native.pyi': 'class Pair: ...\n',
        'core/_native.so': 'built',
        'core/__pycache__/stages.pyc': 'built',
        'solver/ask.py': f'from ..core import stages\nfrom {NAME}.output import table\n',
        'solver/ask.pyi': 'class Stub: ...\n',
        'reports/speed.py': f'from {NAME} import ask\nimport {NAME}.apps\n',
    }


def planted(folder: Path, files: dict[str, str]) -> House:
    for name, text in files.items():
        path = folder / NAME / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return House(folder / NAME)


def test_a_sound_package_has_no_fault(tmp_path: Path, sound: dict[str, str]) -> None:
    assert report(planted(tmp_path, sound)) == ''


@pytest.mark.parametrize('git', [False, True])
def test_what_is_ignored_is_not_counted(tmp_path: Path, sound: dict[str, str], git: bool) -> None:
    """Built files count neither in a checkout, new files included, nor elsewhere."""
    if git:
        subprocess.run(['git', 'init', '-q', tmp_path], check=True)
        (tmp_path / '.gitignore').write_text('*.so\n__pycache__/\n')
    built = {'more.so': ''}
    assert report(planted(tmp_path, sound | built)) == ''
    assert 'the root has more.txt' in report(planted(tmp_path, sound | {'more.txt': ''}))


IMPORTS = [
    ('core/stages.py', 'from ..solver.ask import ask', 'solver.ask.ask'),
    ('core/stages.py', 'from ..solver import ask', 'solver.ask'),
    ('core/_native.pyi', f'from {NAME}.apps import demo', 'apps.demo'),
    ('scene/one.py', f'import {NAME}.node', 'node'),
    ('scene/one.py', 'def f():\n    from .. import reports', 'reports'),
    ('scene/deep/one.py', 'from ...node import one', 'node.one'),
    ('core/stages.py', f'from {NAME} import ask', 'ask'),
    ('training/one.py', 'from ..cli import PROGRAMS', 'cli.PROGRAMS'),
    ('__init__.py', 'from .node import one', 'node.one'),
    ('output.py', 'from .solver import ask', 'solver.ask'),
    ('resources.py', 'from .cli import PROGRAMS', 'cli.PROGRAMS'),
    ('cli.py', 'import sys\nif sys:\n    from .core import stages', 'core.stages'),
    ('__main__.py', f'from {NAME}.apps.demo import main', 'apps.demo.main'),
]


@pytest.mark.parametrize('file, text, path', IMPORTS)
def test_an_import_against_the_order_is_found(tmp_path: Path, sound: dict[str, str], file: str,
                                              text: str, path: str) -> None:
    house = planted(tmp_path, sound | {file: f'{sound.get(file, "")}{text}\n'})
    fault, = import_faults(house)
    assert fault.startswith(f'{file}:') and fault.endswith(f' imports {path}')
    assert fault in report(house)


OTHERS = [
    (root_faults, {'tools.py': '', 'more/one.py': ''}, 'the root has more, tools.py'),
    (function_faults, {'scene/a.py': 'def f():' + '\n  1' * 60}, 'scene/a.py:1 f has 61 lines'),
    (function_faults, {'scene/a.py': 'class A:\n  async def f():' + '\n    1' * 60},
     'scene/a.py:2 f has 61 lines'),
]


@pytest.mark.parametrize('rule, files, fault', OTHERS)
def test_another_fault_is_found(tmp_path: Path, sound: dict[str, str], rule: object,
                                files: dict[str, str], fault: str) -> None:
    house = planted(tmp_path, sound | files)
    assert list(rule(house)) == [fault]
    assert fault in report(house)


def test_a_missing_folder_is_found(tmp_path: Path, sound: dict[str, str]) -> None:
    del sound['apps/__init__.py']
    assert list(root_faults(planted(tmp_path, sound))) == ['the root lacks apps']


def test_as_much_as_may_be(tmp_path: Path, sound: dict[str, str]) -> None:
    """The limit itself is no fault."""
    assert report(planted(tmp_path, sound | {'apps/a.py': 'def f():' + '\n  1' * 59})) == ''


# --- the header of each file ----------------------------------------------------------------------


def without_header(files: list[Path]) -> list[Path]:
    """Return the source files that do not name copyright and licence."""
    sources = [file for file in files
               if file.suffix in SOURCES or file.name in SOURCES_BY_NAME]
    return [file for file in sources
            if not all(line in '\n'.join(file.read_text('utf-8').splitlines()[:3])
                       for line in HEADER)]


def test_every_source_file_has_a_header() -> None:
    folders = ('.ci', 'box_contact_msgs', NAME, 'docs', 'launch', 'test')
    files = [ROOT / 'Makefile', ROOT / 'setup.py',
             *chain(*(listed(ROOT / folder) for folder in folders))]
    assert without_header(files) == []


@pytest.mark.parametrize('text, found', [
    ('', True), ('import os\n', True), (f'# {HEADER[0]}\n', True), (f'# {HEADER[1]}\n', True),
    ('\n\n' + ''.join(f'# {line}\n' for line in HEADER), True),
    ('#!/bin/sh\n' + ''.join(f'# {line}\n' for line in HEADER), False)])
@pytest.mark.parametrize('name', ['a.py', 'a.hpp', 'CMakeLists.txt'])
def test_a_file_without_header_is_found(tmp_path: Path, name: str, text: str, found: bool) -> None:
    file = tmp_path / name
    file.write_text(text)
    assert without_header([file, tmp_path / 'a.csv']) == [file] * found

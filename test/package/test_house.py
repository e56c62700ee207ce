# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The house of the package: imports point one way, and the product does without evidence."""
from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
NAME = 'box_contact_ros'
PRODUCT = ('core', 'solver', 'scene', 'node', 'apps')
FOLDERS = (*PRODUCT, 'evidence')
"""A folder imports only itself and folders before it."""
OF_EVIDENCE = ('pose_sets', 'contestants', 'verification', 'timing', 'training',
               'reports', 'bench')
"""Likewise, below evidence/."""
EVERYBODYS = ('output', 'resources')
"""Root modules that every folder may import, and that import none of the folders."""
ROOT_MODULES = ('__init__', '__main__', 'cli', *EVERYBODYS)
HEADER = ('Copyright 2026 The box_contact_ros maintainers', 'SPDX-License-Identifier: Apache-2.0')
"""What the first lines of each source file say, after a shebang."""
SOURCES = ('.c', '.cmake', '.cpp', '.h', '.hpp', '.mjs', '.py', '.pyi', '.sh')
SOURCES_BY_NAME = ('CMakeLists.txt', 'Makefile', 'run', 'setup')


def imported(package: Path, file: Path) -> Iterator[tuple[int, str]]:
    """Yield line and dotted path below the package of all that a file imports from the package."""
    here = (NAME, *file.relative_to(package).parent.parts)
    for node in ast.walk(ast.parse(file.read_text('utf-8'))):
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


def import_faults(package: Path) -> Iterator[str]:
    """Yield imports against the order of the folders."""
    exported = {path.rpartition('.')[2]: path.partition('.')[0]
                for _, path in imported(package, package / '__init__.py')}
    for file in sorted([*package.rglob('*.py'), *package.rglob('*.pyi')]):
        own = file.relative_to(package).with_suffix('').parts
        for line, path in imported(package, file):
            parts = path.split('.')
            parts[0] = exported.get(parts[0], parts[0])
            if not may_import(own, parts):
                yield f'{file.relative_to(package)}:{line} imports {path}'


def may_import(own: tuple[str, ...], parts: list[str]) -> bool:
    """Return whether a module may import a path; both as parts below the package."""
    if own[0] not in FOLDERS:
        return parts[0] in {'__init__': (*EVERYBODYS, 'solver', 'scene'), '__main__': ROOT_MODULES,
                            'cli': ROOT_MODULES}.get(own[0], EVERYBODYS)
    if own[0] == parts[0] == 'evidence' and own[1] in OF_EVIDENCE:
        return parts[1] in OF_EVIDENCE[:OF_EVIDENCE.index(own[1]) + 1]
    return parts[0] in (*EVERYBODYS, *FOLDERS[:FOLDERS.index(own[0]) + 1])


def test_imports_point_one_way() -> None:
    assert list(import_faults(ROOT / NAME)) == []


# --- the product without evidence -----------------------------------------------------------------


def test_the_product_names_no_evidence() -> None:
    """Nor in a comment: what it is good for must be clear without."""
    files = [file for folder in PRODUCT for file in (ROOT / NAME / folder).rglob('*')
             if file.suffix in ('.py', '.pyi', *SOURCES)]
    assert len(files) > 80
    assert [str(file) for file in files if 'evidence' in file.read_text('utf-8')] == []


@pytest.fixture(scope='module')
def product(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a copy of the checkout without evidence/ and its tests."""
    if not (ROOT / '.git').exists():
        pytest.skip('this is no checkout')
    copy = tmp_path_factory.mktemp('product')
    names = subprocess.run(['git', 'ls-files', '--cached', '--others', '--exclude-standard'],
                           cwd=ROOT, capture_output=True, text=True, check=True).stdout.split()
    built = [path.relative_to(ROOT) for path in (ROOT / NAME / 'core').glob('*.so')]
    for path in [*map(Path, names), *built]:
        if 'evidence' not in path.parts[:2] and (ROOT / path).is_file():
            (copy / path).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / path, copy / path)
    return copy


@pytest.mark.slow
def test_the_product_does_without_evidence(product: Path) -> None:
    """Tests of each folder pass. All of them: `pytest test/core test/solver …` in such a copy."""
    files = ('core/test_core', 'solver/test_solver', 'solver/test_models',
             'scene/test_short_forms', 'scene/test_force_laws', 'node/test_parameters',
             'node/test_message_bytes', 'node/test_runtime')
    # The installed package stands behind this copy, with entry points whose modules are gone.
    done = subprocess.run(
        [sys.executable, '-m', 'pytest', '-q', '-x', '-m', 'not slow', '-p', 'no:cacheprovider',
         '-W', 'ignore:model:UserWarning', *(f'test/{file}.py' for file in files)],
        cwd=product, env={**os.environ, 'PYTHONPATH': str(product)}, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


# --- the header of each file ----------------------------------------------------------------------


def test_every_source_file_has_a_header() -> None:
    names = subprocess.run(['git', 'ls-files', '--cached', '--others', '--exclude-standard'],
                           cwd=ROOT, capture_output=True, text=True).stdout.split()
    files = [ROOT / name for name in names if (ROOT / name).is_file()]
    assert [str(file) for file in files
            if (file.suffix in SOURCES or file.name in SOURCES_BY_NAME) and not all(
                line in '\n'.join(file.read_text('utf-8').splitlines()[:3]) for line in HEADER)
            ] == []

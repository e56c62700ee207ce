# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A wheel, a source distribution, and what CMake alone builds from the sources.

The wheel is made from a copy of the tracked files, which is deleted before it is looked at: nothing
may reach back to it. All other tests run in an editable install; `make test-colcon` runs them as
colcon installs them.
"""
from __future__ import annotations

import json
import os
import platform
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import venv
import zipfile
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import pytest
from test_library import EACH_FUNCTION_ONCE, EXAMPLE, EXAMPLE_SAYS, PREFIX, configure, example, tool

from box_contact_ros.core import instruction_sets

ROOT = Path(__file__).resolve().parents[2]
NAME = 'box_contact_ros'
DATA = ('weights', 'msg_schemas', 'launch', 'config')
# Also those that are about to be added.
TRACKED = subprocess.run(['git', 'ls-files', '-z', '--cached', '--others', '--exclude-standard'],
                         cwd=ROOT, capture_output=True, text=True).stdout.split('\0')[:-1]
# PYTHONPATH and the ament index must show the installation alone, not what runs the tests.
CLEAN = {name: value for name, value in os.environ.items()
         if not name.startswith(('PYTHONPATH', 'AMENT', 'COLCON', 'CMAKE_PREFIX'))}

pytestmark = [pytest.mark.builds, pytest.mark.skipif(
    not TRACKED, reason='not a git checkout: what would be copied?')]

ASK = """
import json, sys
import box_contact_ros
from box_contact_ros import ContactSolver, core
from box_contact_ros.resources import resource_path
folders = {name: resource_path(name) for name in sys.argv[1:]}
contact = ContactSolver((2, 2, 2), (2, 2, 2), model='mlp')([0] * 6 + [1], [0, 0, 1.9, 0, 0, 0, 1])
print(json.dumps({
    'sets': core.instruction_sets(), 'separation': contact.separation,
    'places': [box_contact_ros.__file__, core.native.__file__, *map(str, folders.values())],
    'files': sorted(f'{name}/{path.relative_to(folder)}' for name, folder in folders.items()
                    for path in folder.rglob('*') if path.is_file() and path.suffix != '.pyc')}))
"""
FETCHED = f"""
cmake_minimum_required(VERSION 3.18)
project(fetched LANGUAGES CXX)
include(FetchContent)
FetchContent_Declare(box_contact_ros SOURCE_DIR "{ROOT}")
FetchContent_MakeAvailable(box_contact_ros)
add_executable(first_contact "{EXAMPLE}/first_contact.cpp")
target_link_libraries(first_contact PRIVATE box_contact_ros::box_contact)
"""
COMPILER = f"""#!/bin/sh
# Compile each object once, without optimisation: all builds below have the same sources and flags.
# CMake's folder of the target and the name of the source tell objects apart.
for word; do
    if [ "$before" = -o ]; then output=$word; fi
    before=$word
done
kept=$(dirname "$0")/$(echo "${{output##*CMakeFiles/}}" | tr / -)
case $output in
    *.dir/*) [ -e "$kept" ] && exec cp "$kept" "$output" ;;
    *) exec {os.environ.get('CXX', 'g++')} "$@" -O0 ;;
esac
{os.environ.get('CXX', 'g++')} "$@" -O0 -w {EACH_FUNCTION_ONCE} && cp "$output" "$kept"
"""
USER = """
from box_contact_ros import ContactSolver
depth: str = ContactSolver((2, 2, 2), (2, 2, 2))([0] * 6 + [1], [0] * 6 + [1]).separation
"""


def run(*words: str | Path, cwd: Path) -> str:
    """Output of a command in the clean environment; fails unless its status is 0."""
    done = subprocess.run([str(word) for word in words], cwd=cwd, env=CLEAN, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    assert done.returncode == 0, f'{words}: {done.stdout}'
    return done.stdout


def copy_sources(to: Path) -> Path:
    for name in TRACKED:
        if (ROOT / name).is_file():
            (to / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, to / name)
    return to


def defined_symbols(path: Path) -> set[str]:
    """Return the names that an object file gives to the linker."""
    if not shutil.which('nm'):
        return set()
    lines = run('nm', '--defined-only', '-g', path, cwd=path.parent).splitlines()
    return {line.split(maxsplit=2)[2] for line in lines}


@dataclass(frozen=True)
class Installation:
    """One that has been made below `folder`, the names of the files of its wheel, and symbols.

    symbols: those that each instruction set's object defines.
    """

    folder: Path
    wheel_files: list[str]
    symbols: dict[str, set[str]]

    @property
    def bin(self) -> Path:
        """Where its Python and its programs are."""
        return self.folder / 'venv' / 'bin'


@pytest.fixture(scope='module')
def compiler(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the compiler of all builds here."""
    path = tmp_path_factory.mktemp('compiler') / 'c++'
    path.write_text(COMPILER)
    path.chmod(0o755)
    return path


@pytest.fixture(scope='module')
def installed(tmp_path_factory: pytest.TempPathFactory, compiler: Path) -> Installation:
    """Install a wheel into an environment that borrows the dependencies from this one."""
    folder = tmp_path_factory.mktemp('installed')
    sources = copy_sources(folder / 'sources')
    options = ('--no-index', '--no-deps', '--no-build-isolation')
    run('env', f'CXX={compiler}', sys.executable, '-m', 'pip', 'wheel', *options,
        '--wheel-dir', folder, sources, cwd=folder)
    symbols = {re.search(r'/box_contact_(\w+)\.dir/', str(path))[1]: defined_symbols(path)
               for path in sources.glob('build/temp*/**/kernel.cpp.o')}
    shutil.rmtree(sources)
    venv.create(folder / 'venv', symlinks=True)
    python, (wheel,) = folder / 'venv' / 'bin' / 'python', folder.glob('*.whl')
    site_packages = Path(run(python, '-c', 'import sysconfig; print(sysconfig.get_path("purelib"))',
                             cwd=folder).strip())
    # A .pth in a borrowed folder is not read, so an editable install of this package stays out.
    (site_packages / 'borrowed.pth').write_text(sysconfig.get_path('purelib'))
    run(sys.executable, '-m', 'pip', '--python', python, 'install', *options, wheel, cwd=folder)
    return Installation(folder, zipfile.ZipFile(wheel).namelist(), symbols)


def test_a_wheel_answers_with_files_of_its_own(installed: Installation) -> None:
    """Every data file is there, and every instruction set that this machine can run."""
    answer = json.loads(run(installed.bin / 'python', '-c', ASK, *DATA, cwd=installed.folder))
    assert answer['separation'] == pytest.approx(-0.1)
    assert tuple(answer['sets']) == instruction_sets()
    assert answer['files'] == sorted(name for name in TRACKED if Path(name).parts[0] in DATA)
    assert all(Path(place).is_relative_to(installed.folder) for place in answer['places'])
    tops = {name.partition('/')[0] for name in installed.wheel_files}
    assert {top for top in tops if not top.endswith(('.data', '.dist-info'))} == {NAME}


def test_kernels_share_no_symbol(installed: Installation) -> None:
    """The linker keeps one of two equal names, and a machine could run another set's code.

    Without optimisation, functions that are inlined otherwise are symbols.
    """
    if platform.machine() not in ('x86_64', 'AMD64') or not shutil.which('nm'):
        pytest.skip('nm is not installed, or the machine has one instruction set')
    assert set(installed.symbols) == {'baseline', 'avx2', 'avx512'}
    for name, symbols in installed.symbols.items():
        assert any(f'kernel_{name}' in symbol for symbol in symbols)
    for one, other in combinations(installed.symbols.values(), 2):
        # Pointers that exceptions need; no code.
        assert not {name for name in one & other if not name.startswith('DW.ref.')}


def test_cmake_finds_the_library(installed: Installation, tmp_path: Path) -> None:
    """In the active environment, without an option; the example runs."""
    cmake = tool('cmake')
    run('env', f'PATH={installed.bin}:{os.environ["PATH"]}', cmake, '-S',
        EXAMPLE, '-B', tmp_path, cwd=tmp_path)
    found = f'{NAME}_DIR:PATH={installed.bin.parent}/lib/cmake/{NAME}\n'
    assert found in (tmp_path / 'CMakeCache.txt').read_text()
    run(cmake, '--build', tmp_path, cwd=tmp_path)
    assert 'batch: 1 0, volumes 0.030 0.000 m3' in run(tmp_path / 'first_contact', cwd=tmp_path)


def test_from_source(compiler: Path, tmp_path: Path) -> None:
    """By FetchContent, which calls add_subdirectory; without Python."""
    (tmp_path / 'CMakeLists.txt').write_text(FETCHED)
    configure(tmp_path, tmp_path / 'build', f'-DCMAKE_CXX_COMPILER={compiler}')
    assert example(tmp_path / 'build' / 'first_contact') == EXAMPLE_SAYS


@pytest.mark.parametrize('kind', ['ON', 'OFF'])
def test_a_plain_installation(compiler: Path, tmp_path: Path, kind: str) -> None:
    """Shared and static: find_package below a prefix, pkg-config, and the files that pip has."""
    prefix = tmp_path / 'prefix'
    configure(ROOT, tmp_path / 'library', f'-DCMAKE_CXX_COMPILER={compiler}',
              f'-DBUILD_SHARED_LIBS={kind}', '-DCMAKE_INSTALL_LIBDIR=lib')
    run(tool('cmake'), '--install', tmp_path / 'library', '--prefix', prefix, cwd=tmp_path)
    made = {path.relative_to(prefix) for path in prefix.rglob('*') if path.is_file()}
    assert Path('include/box_contact/contact_message.hpp') in made
    assert [path for path in made if path.suffix != '.a' and not (PREFIX / path).is_file()] == []
    configure(EXAMPLE, tmp_path / 'example', f'-DCMAKE_PREFIX_PATH={prefix}')
    assert example(tmp_path / 'example' / 'first_contact') == EXAMPLE_SAYS
    found = run('env', f'PKG_CONFIG_PATH={prefix}/lib/pkgconfig', tool('pkg-config'), '--cflags',
                '--libs', 'box_contact', cwd=tmp_path)
    run('g++', '-std=c++17', EXAMPLE / 'first_contact.cpp', *found.split(), '-o', 'one',
        cwd=tmp_path)
    assert example(tmp_path / 'one') == EXAMPLE_SAYS


def test_the_programs_are_in_bin(installed: Installation, setup_arguments: dict[str, Any],
                                 ) -> None:
    """Under prefixed names, where a shell finds them."""
    programs = setup_arguments['entry_points']['console_scripts']
    assert {path.name for path in installed.bin.glob('box_contact_*')} == {
        f'box_contact_{line.partition(" ")[0]}' for line in programs}
    assert 'usage' in run(installed.bin / 'box_contact_contact_node', '--help',
                          cwd=installed.folder)


def test_a_type_checker_finds_the_types(installed: Installation, tmp_path: Path) -> None:
    """Let mypy say that a separation is a float, also where this checkout is installed with -e."""
    pytest.importorskip('mypy')
    (tmp_path / 'user.py').write_text(USER)
    for python in (Path(sys.executable), installed.bin / 'python'):  # NumPy is read once
        done = subprocess.run(
            [sys.executable, '-m', 'mypy', '--strict', '--python-executable', python, 'user.py'],
            cwd=tmp_path, env=CLEAN, capture_output=True, text=True)
        assert 'Found 1 error in 1 file (checked 1 source file)' in done.stdout, done.stdout
        assert 'expression has type "float", variable has type "str"' in done.stdout


def test_the_source_distribution_is_the_checkout(tmp_path: Path) -> None:
    """It holds all that git tracks, and beside that only what setuptools adds."""
    sources = copy_sources(tmp_path / 'sources')
    run(sys.executable, 'setup.py', '-q', 'sdist', '--dist-dir', tmp_path, cwd=sources)
    archive, = tmp_path.glob('*.tar.gz')
    with tarfile.open(archive) as file:
        names = {member.name.partition('/')[2] for member in file if member.isfile()}
    assert names - {'PKG-INFO'} - {name for name in names if '.egg-info/' in name} == set(TRACKED)

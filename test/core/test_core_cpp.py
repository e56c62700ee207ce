# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The header-only form of the core: its test and a short fuzz, compiled and run without flags.

The test runs for every instruction set of the machine, by g++ and by clang++, and with sanitizers.
All of them have to give the same bits of verdict, separation and normal.
"""
from __future__ import annotations

import os
import platform
import shutil
import subprocess
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

PATIENCE = 900.0
"""For all builds [s]: two minutes of a processor, of which a busy machine gives little."""
pytestmark = [pytest.mark.slow, pytest.mark.timeout(PATIENCE)]

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ROOT / 'test' / 'core'
FLAGS = ['-std=c++17', '-Wall', '-Wextra', '-Werror']
"""None that the header would need."""
SANITIZE = ['-Og', '-g1', '-fsanitize=address,undefined,float-cast-overflow',
            '-fno-sanitize-recover=all', '-fno-sanitize=null,object-size,vptr,alignment']
"""Left out are checks that take half of the compile time: the address sanitizer repeats most."""
FUZZ_ROUNDS = 8000
"""About two seconds with sanitizers, 40,000 pairs."""
LEVELS = {'avx2': (['-O2', '-march=x86-64-v3'], ('avx2', 'fma', 'bmi2', 'movbe')),
          'avx512': (['-O1', '-march=x86-64-v4'],
                     ('avx512f', 'avx512bw', 'avx512cd', 'avx512dq', 'avx512vl'))}
"""Flags of the compiler for an instruction set, and those of /proc/cpuinfo that it needs.

Compilers fuse products from -O2 on. One build tries it here, as it takes twice as long;
test_core.py compares the extensions, which have -O3. Builds by clang and with sanitizers are of the
baseline.
"""


def missing_flags(level: str) -> list[str]:
    """Return the flags of /proc/cpuinfo that an instruction set needs and this machine lacks."""
    needed = LEVELS[level][1]
    if platform.machine() not in ('x86_64', 'AMD64'):
        return list(needed)
    info = Path('/proc/cpuinfo')
    have = set(info.read_text().split()) if info.is_file() else set()
    return [flag for flag in needed if flag not in have]


def compiler(name: str) -> str:
    """Return the path of a compiler, or skip."""
    path = shutil.which(name)
    if not path:
        pytest.skip(f'{name} is not installed')
    return path


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder laid out as an installation: include/box_contact; and the hard poses."""
    folder = tmp_path_factory.mktemp('core')
    core = ROOT / 'box_contact_ros' / 'core'
    shutil.copytree(core / 'include', folder / 'include')
    shutil.copytree(core / 'src', folder / 'include' / 'box_contact' / 'detail')
    write_families(folder / 'families.txt')
    return folder


def write_families(path: Path) -> None:
    """Write the stored families as text: a line a pair, doubles as hexadecimal numbers."""
    stored = ROOT / 'benchmarks' / 'hard_poses.npz'
    lines = []
    with np.load(stored) as arrays:
        for name in sorted({key.split('.')[0] for key in arrays.files}):
            columns = [arrays[f'{name}.{part}'] for part in
                       ('pose_a', 'pose_b', 'size_a', 'size_b', 'gap', 'centroid')]
            for row in np.hstack([part.reshape(len(part), -1) for part in columns]):
                lines.append(' '.join([name, *(float(value).hex() for value in row)]))
    path.write_text('\n'.join(lines) + '\n')


class Builds:
    """Programs that compilers make in the background, as many at a time as there are cores."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.pool = ThreadPoolExecutor(os.cpu_count())
        self.futures: dict[str, Future] = {}

    def start(self, name: str, *command: object, **environment: str) -> None:
        """Run the command that makes the program `name`."""
        self.futures[name] = self.pool.submit(
            subprocess.run, [str(part) for part in command], env={**os.environ, **environment},
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=PATIENCE)

    def compile(self, name: str, program: str, source: Path, *flags: str) -> None:
        """Compile one source file, if the compiler is installed."""
        if shutil.which(program):
            self.start(name, program, *flags, f'-I{self.folder / "include"}', source, '-o',
                       self.folder / name)

    def program(self, name: str) -> Path:
        """Return the program, once it is made."""
        done = self.futures[name].result()
        assert done.returncode == 0, done.stdout[-4000:]
        return self.folder / name


@pytest.fixture(scope='module')
def builds(folder: Path) -> Iterator[Builds]:
    """Return all builds, started; the slowest first."""
    builds = Builds(folder)
    test = SOURCES / 'contact_test.cpp'
    builds.compile('sanitized', 'g++', SOURCES / 'sanitized.cpp', *FLAGS, *SANITIZE)
    for level, (flags, _) in LEVELS.items():
        if not missing_flags(level):
            builds.compile(f'test-{level}', 'g++', test, *FLAGS, *flags)
    builds.compile('test-clang', 'clang++', test, *FLAGS, '-O1')
    yield builds
    builds.pool.shutdown(cancel_futures=True)


def run(program: Path, *arguments: object) -> str:
    """Run a program; return what it printed."""
    done = subprocess.run([str(program), *map(str, arguments)], stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True, timeout=PATIENCE)
    assert done.returncode == 0, done.stdout[-4000:]
    return done.stdout


def run_test(builds: Builds, folder: Path, name: str) -> None:
    """Run a build of contact_test; its answers have to be those of the first build that ran."""
    program = builds.program(name)
    answers = folder / f'{name}.answers'
    assert ' 0 failures' in run(program, folder / 'families.txt', answers)
    first = folder / 'first.answers'
    if not first.exists():
        shutil.copy(answers, first)
    one, other = first.read_text().splitlines(), answers.read_text().splitlines()
    assert len(one) == len(other) > 20_000
    different = [row for row, pair in enumerate(zip(one, other)) if pair[0] != pair[1]]
    assert not different, f'{name}: rows {different[:10]} of {len(different)}'


@pytest.mark.parametrize('level', LEVELS)
def test_by_gcc(builds, folder, level):
    """Hard poses, laws and refusals; the same bits for each instruction set."""
    compiler('g++')
    if missing_flags(level):
        pytest.skip(f'this machine has no {", ".join(missing_flags(level))}')
    run_test(builds, folder, f'test-{level}')


def test_by_clang(builds, folder):
    """The same bits by another compiler."""
    compiler('clang++')
    run_test(builds, folder, 'test-clang')


def test_with_sanitizers(builds, folder):
    """No access out of bounds, no undefined behaviour; the same bits."""
    compiler('g++')
    run_test(builds, folder, 'sanitized')


def test_fuzz_with_sanitizers(builds):
    """Adversarial poses and random networks."""
    compiler('g++')
    assert ' 0 failures' in run(builds.program('sanitized'), FUZZ_ROUNDS)


@pytest.mark.parametrize('flag', [
    '-ffast-math', '-Ofast', '-ffinite-math-only', '-fno-signed-zeros', '-freciprocal-math',
    '-funsafe-math-optimizations'])
def test_fast_math_is_refused(folder, flag):
    """The header does not compile with any part of it, and says why."""
    command = [compiler('g++'), '-std=c++17', '-O1', flag, '-fsyntax-only', '-x', 'c++',
               str(folder / 'include' / 'box_contact' / 'inline.hpp')]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode != 0
    assert 'box_contact needs IEEE arithmetic: compile without -ffast-math' in done.stderr

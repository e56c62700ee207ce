# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The program of this folder, C++ against C++: it is compiled, copied, and asked for answers.

Each library has one file, which answers the query `contact` for the report `native`, the query
`distance` for the report of that name, or both. MuJoCo's wheel has its headers and its library.
Coal, FCL and Bullet are compiled in where pkg-config finds them.
"""
from __future__ import annotations

import importlib.util
import os
import re
import shlex
import shutil
import subprocess
import sys
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np

from box_contact_ros.core import FORCE

from ..engines import may_miss
from ..output import ROOT, percentiles
from ..pose_sets import Pairs
from ..timing import by_round

FOLDER = Path(__file__).parent
LIBRARY = Path(sys.prefix, 'lib', 'libbox_contact.so')  # its headers are in include/
TITLES = {'coal': 'Coal', 'fcl': 'FCL', 'bullet': 'Bullet'}
"""Rivals that may be missing, by file of this folder and by name for pkg-config."""
PACKAGES = {'bullet': 'bullet-float64'}
"""Names for pkg-config that differ: Debian builds Bullet in both precisions."""
BRINGS = {'coal': 'pip install coal cmeel-eigen', 'fcl': 'apt install libfcl-dev',
          'bullet': 'apt install libbullet-dev'}
"""What brings their headers and libraries."""
RIVALS = {'contact': ('coal', 'bullet'), 'distance': ('coal', 'fcl', 'bullet')}
"""Those that answer a query."""


class Effort(NamedTuple):
    """How much is measured."""

    copies: int
    pairs: int  # of a set
    rounds: int
    calls: int  # single ones, of a round


FULL = Effort(7, 20_000, 11, 2_000)

# --- the libraries and the compiler ---------------------------------------------------------------


def package_config(name: str, *options: str) -> str | None:
    """Return what pkg-config answers about a library; None where either is not installed."""
    tool = shutil.which('pkg-config')
    if tool is None:
        return None
    folders = os.environ.get('PKG_CONFIG_PATH', '').split(os.pathsep)
    spec = importlib.util.find_spec(name)
    for above in Path(spec.origin).parents if spec and spec.origin else ():
        if above.name == 'cmeel.prefix':  # what wheels of cmeel install into
            folders += [str(above / 'lib/pkgconfig'), str(above / 'share/pkgconfig')]
    done = subprocess.run([tool, *options, name], capture_output=True, text=True, env={
        **os.environ, 'PKG_CONFIG_PATH': os.pathsep.join(folders)})
    return None if done.returncode else done.stdout.strip()


def package_flags(name: str) -> list[str] | None:
    """Return a library's flags for the compiler and the linker; None where it is not installed.

    The standard is ours: FCL's flags name C++11, which MuJoCo's headers refuse.
    """
    answer = package_config(PACKAGES.get(name, name), '--cflags', '--libs')
    if answer is None:
        return None
    flags = [flag for flag in shlex.split(answer) if not flag.startswith('-std=')]
    return flags + [f'-Wl,-rpath,{flag[2:]}' for flag in flags if flag.startswith('-L')]


def library_flags(instruction_set: str) -> list[str]:
    """Return the flags by which CMakeLists.txt compiles a kernel."""
    text = (ROOT / 'CMakeLists.txt').read_text('utf-8')
    own, shared = (re.search(pattern, text, re.DOTALL) for pattern in (
        rf'set\(FLAGS_{instruction_set} ([^)]*)\)', r'\n    (-ffp-contract=off[^$]*)\$<'))
    assert own and shared
    return [*own[1].split(), *shared[1].split(), '-falign-loops=32', '-falign-jumps=16']


def run_compiler(*arguments: object) -> None:
    """Compile, with the library's headers and no optimisation named.

    Raises `RuntimeError` with what the compiler reports.
    """
    done = subprocess.run([
        os.environ.get('CXX', 'g++'), '-std=c++17', '-Wall', '-Wextra',
        f'-I{Path(sys.prefix, "include")}', *map(str, arguments)], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f'the program does not compile:\n{done.stderr}')


def library_beside(folder: Path) -> tuple[str, ...]:
    """Copy the library into a folder; return the flags that link a program beside it.

    With old tags LD_LIBRARY_PATH does not replace the copy by another library.
    """
    return shutil.copy(LIBRARY, folder), '-Wl,--disable-new-dtags', '-Wl,-rpath,$ORIGIN'


# --- the program ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Program:
    """The program, compiled for one query."""

    path: Path  # libraries of its own lie beside it
    query: str
    missing: tuple[str, ...]  # rivals

    def copied(self, folder: Path) -> Program:
        """Return a copy in a new folder, with libraries of its own."""
        folder.mkdir()
        for library in self.path.parent.glob('lib*.so'):
            shutil.copy(library, folder)
        return replace(self, path=Path(shutil.copy(self.path, folder)))

    def run(self, query: str, pairs: Pairs, instruction_set: str, *arguments: object) -> list[str]:
        """Return the lines that it prints for some pairs, with one instruction set."""
        poses = self.path.with_name('poses')
        poses.write_bytes(np.int64(len(pairs.pose_a)).tobytes()
                          + b''.join(np.ascontiguousarray(part).tobytes() for part in pairs))
        done = subprocess.run([self.path, query, poses, *map(str, arguments)], capture_output=True,
                              text=True, env={**os.environ, FORCE: instruction_set})
        if done.returncode:
            raise RuntimeError(f'the program ended with status {done.returncode}: {done.stderr}')
        return done.stdout.splitlines()

    def answers(self, pairs: Pairs, instruction_set: str, rounds: int, calls: int, *files: Path,
                ) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Return by contestant the times (1, rounds) of a pair [ns], and answers (calls,) [m]."""
        written = self.path.with_name('answers')
        first, names, *lines = self.run(self.query, pairs, instruction_set, rounds, calls, written,
                                        *files)
        if first != instruction_set:
            raise RuntimeError(
                f'{instruction_set} was asked for, and the library answered {first!r}')
        times: dict[str, list[float]] = {name: [] for name in names.split('\t')}
        for line in lines:
            name, nanoseconds = line.split('\t')
            times[name].append(float(nanoseconds))
        answers = np.fromfile(written).reshape(len(times), -1)
        return {name: (np.array([values]), row)
                for (name, values), row in zip(times.items(), answers)}

    def engines(self) -> str:
        """Return the names of all rivals in it, with their versions."""
        return ', '.join([f'MuJoCo {metadata.version("mujoco")}', *(
            f'{TITLES[name]} {package_config(PACKAGES.get(name, name), "--modversion")}'
            for name in RIVALS[self.query] if name not in self.missing)])

    def left_out(self) -> str:
        """Return a paragraph about each rival that it lacks."""
        return ''.join(f'\n\nLeft out: {TITLES[name]} is not installed with its headers '
                       f'(`{BRINGS[name]}`).' for name in self.missing)

    def calls_shown(self) -> str:
        """Return the code of each call, as it was compiled."""
        blocks = []
        for file in sorted(FOLDER.glob('*.cpp')):
            if file.stem in self.missing:
                continue
            for queries, name, code in re.findall(
                    r'// (contact|distance|contact, distance): ([^\n]+)\n(.*?)\s*// end of call',
                    file.read_text('utf-8'), re.DOTALL):
                if self.query in queries.split(', '):
                    blocks.append(f'{name}:\n\n```c++\n{textwrap.dedent(code)}\n```')
        return '\n\n'.join(blocks)


def compiled(folder: Path, query: str, networks: Sequence[str] = ()) -> Program:
    """Compile the program into a folder.

    networks: the instruction sets that the networks of networks.cpp are compiled for.

    Raises `RuntimeError` with what the compiler reports.
    """
    spec = importlib.util.find_spec('mujoco')
    if spec is None or spec.origin is None:
        raise RuntimeError("MuJoCo is not installed: pip install -e '.[sim]'")
    mujoco = Path(spec.origin).parent
    rivals = {name: flags for name in RIVALS[query] if (flags := package_flags(name)) is not None}
    defined = [f'-DWITH_{name.upper()}' for name in (*rivals, *networks)]
    fcl = rivals.pop('fcl', None)
    if fcl is not None:  # see main.cpp
        run_compiler('-O2', '-fPIC', '-shared', FOLDER / 'fcl.cpp',
                     '-o', folder / 'libfcl_calls.so', *fcl)
    objects = {name: folder / f'{name}.o' for name in networks}
    for name, made in objects.items():
        run_compiler(*library_flags(name), '-Wno-psabi', '-c',
                     f'-DADD_NETWORKS=add_networks_{name}', FOLDER / 'networks.cpp', '-o', made)
    sources = ('main', 'contestants', 'each_contact', 'ours', 'mujoco', *rivals)
    run_compiler('-O2', f'-I{mujoco / "include"}', *defined,
                 *(FOLDER / f'{name}.cpp' for name in sources), *objects.values(),
                 '-o', folder / 'native', *library_beside(folder),
                 next(mujoco.glob('libmujoco.so*')), f'-Wl,-rpath,{mujoco}',
                 *(flag for flags in rivals.values() for flag in flags), '-ldl', '-rdynamic')
    return Program(folder / 'native', query, tuple(
        name for name in RIVALS[query] if not (name in rivals or (name == 'fcl' and fcl))))


def compiled_for(report: str, options: Any, folder: Path, query: str,
                 networks: Sequence[str] = ()) -> Program | None:
    """Return the program; None, after a message, where the report cannot be made with it.

    options: of the report, with `quick` and `leave_out`.
    """
    try:
        program = compiled(folder, query, networks)
    except RuntimeError as error:
        print(f'{report}: {error}', file=sys.stderr)
        return None
    if not options.quick and not may_miss(report, program.missing, options.leave_out):
        return None
    for name in program.missing:
        print(f'{report}: {TITLES[name]} is left out: {BRINGS[name]}', file=sys.stderr)
    return program


# --- times of several copies ----------------------------------------------------------------------


class Timed(Protocol):
    """A NamedTuple with times."""

    @property
    def nanoseconds(self) -> np.ndarray:
        """Times of a pair (copies, rounds)."""

    def _replace(self: Any, *, nanoseconds: np.ndarray) -> Any:
        """Return the same with other times."""


One = TypeVar('One', bound=Timed)


def of_copies(runs: Sequence[Mapping[str, One]]) -> dict[str, One]:
    """Return the runs of all copies as one, whose times have a row for each copy."""
    return {name: one._replace(nanoseconds=np.concatenate([run[name].nanoseconds for run in runs]))
            for name, one in runs[0].items()}


class Ratio(NamedTuple):
    """What one contestant's time is relative to another's: the median of the copies, and its range.

    A copy's ratio is the median of its rounds' own. The range of seven copies holds the median of
    all copies with a probability of 1 - 2 / 2**7, 98 %, whatever their distribution.
    """

    median: float
    low: float
    high: float

    @classmethod
    def of(cls, times: Mapping[str, Timed], name: str, unit: str) -> Ratio:
        """Return the ratio of two contestants."""
        by_copy = by_round(times[name].nanoseconds.T, times[unit].nanoseconds.T)
        return cls(*percentiles(by_copy, 50, 0, 100))

    def __str__(self) -> str:
        return f'{self.median:.2f} [{self.low:.2f}, {self.high:.2f}]'

    def columns(self, name: str) -> dict[str, float]:
        """Return the columns of the CSV file, whose names begin alike."""
        return {name: self.median, f'{name}_low': self.low, f'{name}_high': self.high}

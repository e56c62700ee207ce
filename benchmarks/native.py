# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""C against C: libbox_contact and other engines, through their C and C++ interfaces.

`python -m box_contact_ros frontier --native` compiles native_calls/, which calls all in turn in one
process, and writes native.md and native.csv. MuJoCo's wheel has its headers and its library. Coal
and Bullet are compiled in where pkg-config finds them.
"""
from __future__ import annotations

import importlib.util
import os
import shlex
import shutil
import subprocess
import tempfile
import textwrap
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

import numpy as np

import box_contact_ros
from box_contact_ros.core import FORCE, instruction_sets, native

from .output import (
    machine,
    markdown_table,
    number,
    page,
    percentiles,
    write_csv,
)
from .pose_sets import LOADS, SETS, Pairs
from .speed import flush_stacks
from .timing import pinned, usable_cores

PAIRS, ROUNDS, CALLS = 20_000, 24, 2_000
QUICK_PAIRS, QUICK_ROUNDS, QUICK_CALLS = 1_000, 2, 200
MIXED = 'containers, 20 % touching'
UNIT = 'mjc_BoxBox, single'
CALLS_FOLDER = Path(__file__).with_name('native_calls')
OPTIONAL = {'coal': 'pip install coal cmeel-eigen', 'bullet': 'apt install libbullet-dev'}
"""By file of native_calls/ and by name for pkg-config: what brings headers and library."""
CLEAR = 1e-6
"""Least gap or depth, of the size, at which verdicts are compared; Bullet's are single floats."""
MOST_WRONG, MOST_OFF = 0.2, 0.1
"""Share of wrong verdicts, and median depth error [%], above which the call itself must be wrong.
Bullet's query in single precision misses up to a tenth of the shallow contacts of overhang."""


class Times(NamedTuple):
    """One contestant on one set."""

    nanoseconds: np.ndarray  # (rounds,) of a pair
    missed: int
    invented: int
    judged: int  # pairs farther than `CLEAR` from touch
    depth_errors: tuple[float, float, float]  # median, p99, worst against `exact`, of the size [%]


Found = Mapping[str, Times]  # by contestant


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
    """Return a library's flags for the compiler and the linker; None where it is not installed."""
    found = package_config(name, '--cflags', '--libs')
    if found is None:
        return None
    flags = []
    for flag in shlex.split(found):
        if flag.startswith('-I'):  # warnings in headers of others are not ours
            flags += ['-isystem', flag[2:]]
        elif flag.startswith('-L'):
            flags += [flag, f'-Wl,-rpath,{flag[2:]}']
        else:
            flags.append(flag)
    return flags


def compiled(folder: Path) -> tuple[Path, list[str]]:
    """Compile native_calls/ into a folder; return the program, and the rivals that are left out.

    Raises `RuntimeError` with what the compiler reports.
    """
    spec = importlib.util.find_spec('mujoco')
    if spec is None or spec.origin is None:
        raise RuntimeError("MuJoCo is not installed: pip install -e '.[sim]'")
    mujoco = Path(spec.origin).parent
    library, ours = next(mujoco.glob('libmujoco.so*')), Path(box_contact_ros.__file__).parent / 'core'
    names, flags, missing = ['main', 'mujoco', 'ours'], list[str](), list[str]()
    for name in OPTIONAL:
        found = package_flags(name)
        if found is None:
            missing.append(name)
        else:
            names.append(name)
            flags += [f'-DWITH_{name.upper()}', *found]
    done = subprocess.run(
        [os.environ.get('CXX', 'g++'), '-std=c++17', '-O2', '-Wall', '-Wextra', '-Werror',
         f'-I{ours / "include"}', f'-I{mujoco / "include"}',
         *[str(CALLS_FOLDER / f'{name}.cpp') for name in names], '-o', str(folder / 'native'),
         str(ours / 'libbox_contact.so'), str(library), f'-Wl,-rpath,{ours}',
         f'-Wl,-rpath,{mujoco}', *flags], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f'native_calls does not compile:\n{done.stderr}')
    return folder / 'native', missing


def engines(missing: list[str]) -> str:
    """Return the versions of the engines that were compiled in."""
    return ', '.join([f'MuJoCo {metadata.version("mujoco")}', *[
        f'{name.capitalize()} {package_config(name, "--modversion")}'
        for name in OPTIONAL if name not in missing]])


def calls_shown(missing: list[str]) -> str:
    """Return the code of each call, as it was compiled."""
    blocks = []
    for file in sorted(CALLS_FOLDER.glob('*.cpp')):
        if file.stem in missing:
            continue
        _, *parts = file.read_text(encoding='utf-8').split('// call: ')
        for part in parts:
            name, _, rest = part.partition('\n')
            code = textwrap.dedent(rest[:rest.index('// end of call')].rstrip())
            blocks.append(f'{name}:\n\n```c++\n{code}\n```')
    return '\n\n'.join(blocks)


def sets(count: int) -> dict[str, Pairs]:
    """Return `count` pairs at most of each set, and containers, a fifth of them in contact."""
    drawn = {name: make(np.random.default_rng([3, number]), count + count // 20).rows(slice(count))
             for number, (name, make) in enumerate(
                 {**SETS, **LOADS, 'aligned flush stacks': flush_stacks}.items())}
    mixed = drawn['containers']
    apart = np.random.default_rng(3).random(len(mixed.pose_b)) < 0.8
    pose_b = mixed.pose_b.copy()
    pose_b[apart, :3] *= 1.5
    return {**drawn, MIXED: mixed._replace(pose_b=pose_b)}


def timed(program: Path, pairs: Pairs, instruction_set: str, *, rounds: int, calls: int) -> Found:
    """Return times and errors of all contestants on one set, with one instruction set."""
    poses, answers = program.parent / 'poses', program.parent / 'answers'
    poses.write_bytes(np.int64(len(pairs.pose_a)).tobytes()
                      + b''.join(np.ascontiguousarray(part).tobytes() for part in pairs))
    done = subprocess.run([program, poses, str(rounds), str(calls), answers], capture_output=True,
                          text=True, env={**os.environ, FORCE: instruction_set})
    if done.returncode:
        raise RuntimeError(f'the program ended with status {done.returncode}: {done.stderr}')
    first, names, *lines = done.stdout.splitlines()
    if first != instruction_set:
        raise RuntimeError(f'{instruction_set} was asked for, and the library answered {first!r}')
    times: dict[str, list[float]] = {name: [] for name in names.split('\t')}
    for line in lines:
        name, nanoseconds = line.split('\t')
        times[name].append(float(nanoseconds))
    separations = np.fromfile(answers).reshape(len(times), -1)
    return {name: judged(name, np.array(times[name]), separation, pairs)
            for name, separation in zip(times, separations)}


def judged(name: str, nanoseconds: np.ndarray, separation: np.ndarray, pairs: Pairs) -> Times:
    """Compare signed separations (n,) of the first n pairs with those of `exact`.

    Raises `RuntimeError` where so many verdicts are wrong that the call must be.
    """
    first = pairs.rows(slice(len(separation)))
    truth, size = first.contacts().separation, first.size
    clear = np.abs(truth) > CLEAR * size
    missed, invented = ((separation > 0.0) & (truth < 0.0) & clear,
                        (separation <= 0.0) & (truth > 0.0) & clear)
    both = (separation <= 0.0) & (truth < 0.0)
    errors = 100.0 * np.abs(separation - truth)[both] / size[both]
    p50, p99, worst = percentiles(errors, 50, 99, 100)
    if (missed | invented).sum() > MOST_WRONG * len(truth) or p50 > MOST_OFF:
        raise RuntimeError(f'{name} misses {missed.sum()} and invents {invented.sum()} contacts of '
                           f'{len(truth)} pairs; its median depth error is {p50:.3g} % of the size')
    return Times(nanoseconds, int(missed.sum()), int(invented.sum()), int(clear.sum()),
                 (p50, p99, worst))


def ratio(times: Found, one: str, other: str) -> float:
    """Return the median of the rounds' ratios."""
    return float(np.median(times[one].nanoseconds / times[other].nanoseconds))


def contestants_table(times: Found) -> str:
    """Return the times of all contestants, and their ratios to `UNIT`."""
    lines = []
    for name, one in times.items():
        p50, p99 = percentiles(one.nanoseconds, 50, 99)
        lines.append([name, f'{one.nanoseconds.min():.0f}', f'{p50:.0f}', f'{p99:.0f}',
                      f'{ratio(times, name, UNIT):.2f}'])
    return markdown_table(['', 'min [ns]', 'p50 [ns]', 'p99 [ns]', 'relative to `mjc_BoxBox`'],
                          lines)


def answers_table(found: Mapping[str, Found]) -> str:
    """Return how the answers of other engines on all sets differ from those of `exact`."""
    lines = []
    for name in next(iter(found.values())):
        if name.startswith(('exact', 'mlp')):
            continue
        mine = {of_set: times[name] for of_set, times in found.items()}
        worst = max(mine, key=lambda of_set: np.nan_to_num(mine[of_set].depth_errors[2]))
        lines.append([
            name, *[f'{sum(getattr(one, kind) for one in mine.values()):,}'
                    for kind in ('judged', 'missed', 'invented')],
            *['/'.join(map(number, mine[of_set].depth_errors))
              for of_set in ('containers', 'stacks')],
            f'{number(mine[worst].depth_errors[2])}, {worst}'])
    return markdown_table(
        ['', 'judged', 'missed', 'invented', 'depth error on containers, p50/p99/worst [%]',
         'on stacks [%]', 'worst of all sets [%]'], lines)


def sets_table(found: Mapping[str, Found]) -> str:
    """Return what `mlp` costs relative to `exact` on each set."""
    lines = []
    for name, times in found.items():
        cells = [f'{ratio(times, f"mlp {patch}, {kind}", f"exact {patch}, {kind}"):.2f}'
                 for kind in ('batch', 'single') for patch in ('covariance', 'volume')]
        nanoseconds = [f'{np.median(times[f"{model} covariance, {kind}"].nanoseconds):.0f}'
                       for kind in ('batch', 'single') for model in ('exact', 'mlp')]
        lines.append([name, *cells, *nanoseconds])
    return markdown_table(
        ['set', 'batch', 'batch, volume alone', 'single', 'single, volume alone',
         'batch of `exact` [ns]', 'of `mlp`', 'single `exact` [ns]', '`mlp`'], lines)


def mixed_table(found: Mapping[str, Found]) -> str:
    """Return the time of a batch with a fifth in contact, relative to one in contact."""
    mixed, whole = ({name: float(np.median(one.nanoseconds)) for name, one in found[of_set].items()
                     if name.endswith('batch')} for of_set in (MIXED, 'containers'))
    return markdown_table(['', 'a fifth touches [ns]', 'relative to all'], [
        [name, f'{time:.0f}', f'{time / whole[name]:.2f}'] for name, time in mixed.items()])


def write_native(folder: Path, command: str, *, core: int | None, quick: bool) -> int:
    """Compile, measure, print, write; 2 where the program cannot be made."""
    from tqdm import tqdm

    pairs, rounds, calls = ((QUICK_PAIRS, QUICK_ROUNDS, QUICK_CALLS) if quick
                            else (PAIRS, ROUNDS, CALLS))
    drawn, names = sets(pairs), [name for name in instruction_sets() if name != 'baseline']
    found: dict[str, dict[str, Found]] = {}
    with tempfile.TemporaryDirectory() as made:
        try:
            program, missing = compiled(Path(made))
        except RuntimeError as error:
            print(f'frontier: {error}')
            return 2
        with pinned([usable_cores()[-1] if core is None else core]), \
                tqdm(total=len(drawn) * len(names), desc='native', unit='set') as bar:
            # Sets outside, so that instruction sets take turns.
            for name, of_set in drawn.items():
                for instruction_set in names:
                    found.setdefault(instruction_set, {})[name] = timed(
                        program, of_set, instruction_set, rounds=rounds, calls=calls)
                    bar.update()
    tables = '\n\n'.join(
        f'## {name}\n\nContainers:\n\n{contestants_table(times["containers"])}\n\n'
        f'`mlp` relative to `exact`:\n\n{sets_table(times)}\n\n'
        f'Containers, four in five of them apart:\n\n{mixed_table(times)}'
        for name, times in found.items())
    answers = answers_table(found[names[-1]])
    write_csv(folder / 'native.csv', csv_rows(found), about=machine(native))
    (folder / 'native.md').write_text(page(
        'benchmarks/pages/native', command=command, machine=machine(native), rounds=rounds,
        calls=calls, pairs=pairs, tables=tables, answers=answers, code=calls_shown(missing),
        clear=CLEAR, engines=engines(missing), missing=''.join(
            f'\n\nLeft out: {name.capitalize()} is not installed with its headers '
            f'(`{OPTIONAL[name]}`).' for name in missing)), encoding='utf-8')
    print(tables, answers, sep='\n\n')
    return 0


def csv_rows(found: Mapping[str, Mapping[str, Found]]) -> list[dict[str, object]]:
    """Return a row per instruction set, set and contestant."""
    return [
        {'instruction_set': instruction_set, 'set': name, 'contestant': contestant,
         'min_ns': one.nanoseconds.min(), 'p50_ns': float(np.median(one.nanoseconds)),
         'by_unit': ratio(times, contestant, UNIT), 'judged': one.judged, 'missed': one.missed,
         'invented': one.invented,
         **dict(zip(('depth_p50', 'depth_p99', 'depth_worst'), one.depth_errors))}
        for instruction_set, by_set in found.items() for name, times in by_set.items()
        for contestant, one in times.items()]

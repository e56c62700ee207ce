# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""C against C: libbox_contact and MuJoCo's box colliders, through their C interfaces.

`python -m box_contact_ros frontier --native` compiles native.cpp, which calls all in turn in one
process, and writes native.md and native.csv. MuJoCo's wheel has its headers and its library.
"""
from __future__ import annotations

import importlib.util
import os
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from box_contact_ros.core import FORCE, instruction_sets, native
from box_contact_ros.output import PACKAGE, machine, markdown_table, page, percentiles, write_csv

from ...pose_sets import LOADS, SETS, Pairs
from .speed import flush_stacks, pinned, usable_cores

PAIRS, ROUNDS, CALLS = 20_000, 24, 2_000
QUICK_PAIRS, QUICK_ROUNDS, QUICK_CALLS = 1_000, 2, 200
MIXED = 'containers, 20 % touching'
UNIT = 'mjc_BoxBox, single'
SOURCE = Path(__file__).with_name('native.cpp')
MODEL = """<mujoco><worldbody>
<geom type="box" size="1 1 1"/><body pos="0 0 3"><freejoint/><geom type="box" size="1 1 1"/></body>
</worldbody></mujoco>"""

Times = Mapping[str, np.ndarray]
"""By contestant: nanoseconds a pair of each round."""


def compiled(folder: Path) -> Path:
    """Compile native.cpp into a folder; raises `RuntimeError` with what the compiler says."""
    spec = importlib.util.find_spec('mujoco')
    if spec is None or spec.origin is None:
        raise RuntimeError("MuJoCo is not installed: pip install -e '.[sim]'")
    mujoco = Path(spec.origin).parent
    library, ours = next(mujoco.glob('libmujoco.so*')), PACKAGE / 'core'
    done = subprocess.run(
        [os.environ.get('CXX', 'g++'), '-std=c++17', '-O2', '-Wall', '-Wextra', '-Werror',
         f'-I{ours / "include"}', f'-I{mujoco / "include"}', str(SOURCE), '-o',
         str(folder / 'native'), str(ours / 'libbox_contact.so'), str(library),
         f'-Wl,-rpath,{ours}', f'-Wl,-rpath,{mujoco}'], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f'native.cpp does not compile:\n{done.stderr}')
    return folder / 'native'


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


def timed(program: Path, pairs: Pairs, instruction_set: str, *, rounds: int, calls: int) -> Times:
    """Return the times of all contestants on one set, with one instruction set."""
    folder = program.parent
    poses, model = folder / 'poses', folder / 'model.xml'
    poses.write_bytes(np.int64(len(pairs.pose_a)).tobytes()
                      + b''.join(np.ascontiguousarray(part).tobytes() for part in pairs))
    model.write_text(MODEL, encoding='utf-8')
    done = subprocess.run([program, poses, model, str(rounds), str(calls)], capture_output=True,
                          text=True, check=True, env={**os.environ, FORCE: instruction_set})
    first, touching, *lines = done.stdout.splitlines()
    if first != f'set {instruction_set}':
        raise RuntimeError(f'{instruction_set} was asked for, and the library answered {first!r}')
    # The collider has no public declaration: what it answers shows that the call is right.
    depth, number = -pairs.contacts().separation, int(touching.split('\t')[1])
    if not 0.99 * (depth > 1e-6).sum() <= number <= 1.01 * (depth > -1e-6).sum():
        raise RuntimeError(f'mjc_BoxBox finds {number} contacts of {(depth > 0.0).sum()}')
    found: dict[str, list[float]] = {}
    for line in lines:
        name, nanoseconds = line.split('\t')
        found.setdefault(name, []).append(float(nanoseconds))
    return {name: np.array(times) for name, times in found.items()}


def ratio(times: Times, one: str, other: str) -> float:
    """Return the median of the rounds' ratios."""
    return float(np.median(times[one] / times[other]))


def contestants_table(times: Times) -> str:
    """Return the times of all contestants, and their ratios to `UNIT`."""
    lines = []
    for name, nanoseconds in times.items():
        p50, p99 = percentiles(nanoseconds, 50, 99)
        lines.append([name, f'{nanoseconds.min():.0f}', f'{p50:.0f}', f'{p99:.0f}',
                      f'{ratio(times, name, UNIT):.2f}'])
    return markdown_table(['', 'min [ns]', 'p50 [ns]', 'p99 [ns]', 'relative to `mjc_BoxBox`'],
                          lines)


def sets_table(found: Mapping[str, Times]) -> str:
    """Return what `mlp` costs relative to `exact` on each set."""
    lines = []
    for name, times in found.items():
        cells = [f'{ratio(times, f"mlp {patch}, {kind}", f"exact {patch}, {kind}"):.2f}'
                 for kind in ('batch', 'single') for patch in ('covariance', 'volume')]
        nanoseconds = [f'{np.median(times[f"{model} covariance, {kind}"]):.0f}'
                       for kind in ('batch', 'single') for model in ('exact', 'mlp')]
        lines.append([name, *cells, *nanoseconds])
    return markdown_table(
        ['set', 'batch', 'batch, volume alone', 'single', 'single, volume alone',
         'batch of `exact` [ns]', 'of `mlp`', 'single `exact` [ns]', '`mlp`'], lines)


def mixed_table(found: Mapping[str, Times]) -> str:
    """Return the time of a batch with a fifth in contact, relative to one in contact."""
    mixed, whole = found[MIXED], found['containers']
    return markdown_table(['', 'a fifth touches [ns]', 'relative to all'], [
        [name, f'{np.median(times):.0f}', f'{np.median(times) / np.median(whole[name]):.2f}']
        for name, times in mixed.items() if name.endswith('batch')])


def write_native(folder: Path, command: str, *, core: int | None, quick: bool) -> int:
    """Compile, measure, print, write; 2 where the program cannot be made."""
    from tqdm import tqdm

    pairs, rounds, calls = ((QUICK_PAIRS, QUICK_ROUNDS, QUICK_CALLS) if quick
                            else (PAIRS, ROUNDS, CALLS))
    drawn, names = sets(pairs), [name for name in instruction_sets() if name != 'baseline']
    found: dict[str, dict[str, Times]] = {}
    with tempfile.TemporaryDirectory() as made:
        try:
            program = compiled(Path(made))
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
    write_csv(folder / 'native.csv', [
        {'instruction_set': instruction_set, 'set': name, 'contestant': contestant,
         'min_ns': values.min(), 'p50_ns': float(np.median(values)),
         'by_unit': ratio(times, contestant, UNIT)}
        for instruction_set, by_set in found.items() for name, times in by_set.items()
        for contestant, values in times.items()], about=machine(native))
    (folder / 'native.md').write_text(page(
        'evidence/reports/pages/native', command=command, machine=machine(native), rounds=rounds,
        calls=calls, pairs=pairs, tables=tables), encoding='utf-8')
    print(tables)
    return 0

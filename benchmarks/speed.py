# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Program `speed`: calls, batches, threads and the first contact, timed from Python.

`python -m benchmarks.speed` writes speed.md and speed.csv. Each instruction set of the machine is
measured in subprocesses of its own, on one pinned core. The contestants take turns, so a
disturbance hits all of them, and the figures to read are ratios to MuJoCo's signed distance. Two
threads and the start of a new process follow.
"""
from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from box_contact_ros.core import instruction_sets, native
from box_contact_ros.solver.arguments import program_parser

from . import output
from .contestant import CORE_MODELS, in_subprocess, ours
from .engines import installed
from .output import markdown_table, percentiles
from .pose_sets import FLUSH, SETS, Pairs, drawn
from .timing import Timing, nanoseconds, pinned, timed, usable_cores

UNIT = 'MuJoCo mj_geomDistance'  # the contestant whose single call is the unit of all ratios
UNITS = (UNIT, 'python-fcl collide')
PACKAGES = ('numpy', 'mujoco', 'python-fcl')
BATCH_SETS = SETS | FLUSH
SHARED = ('one thread', 'two threads')
"""Kinds of timings of a large batch, which threads share."""
LONGEST_RUN = 3600.0  # of a subprocess with one instruction set [s]
FIRST_CONTACT = """\
from box_contact_ros import ContactSolver
cube = (2, 2, 2)
print(ContactSolver(cube, cube)((0, 0, 0, 0, 0, 0, 1), (0, 0, 1.9, 0, 0, 0, 1)), flush=True)
"""
"""The program whose start is timed, with the default model."""


@dataclass(frozen=True, kw_only=True)
class Effort:
    """How much is timed."""

    calls: int  # single calls of a round
    batch: int  # pairs of a batch
    shared_batch: int
    """Pairs of a batch that threads share: at 20,000, waking a second core takes a tenth."""
    passes: int
    """Processes of every instruction set, in turn: a neighbour may slow the machine for a minute,
    and where a process has its memory counts too."""
    rounds: int  # of a process
    starts: int  # new processes


FULL = Effort(calls=2_000, batch=20_000, shared_batch=100_000, passes=5, rounds=24, starts=20)
QUICK = Effort(calls=200, batch=1_000, shared_batch=1_000, passes=2, rounds=2, starts=2)


def _drawn(name: str, count: int) -> Pairs:
    rng = np.random.default_rng([1, list(BATCH_SETS).index(name)])
    return drawn(BATCH_SETS[name], rng, count)


def single_calls(count: int) -> list[Timing]:
    """Return the contestants for equal cubes, from two poses to a result in Python."""
    def call_all(calls: Sequence[Callable[[], object]]) -> None:
        for call in calls:
            call()

    rivals, missing = installed(('mujoco', 'fcl'))
    for line in missing:
        print(f'speed: left out: {line}', file=sys.stderr)
    # Ours come last: batches follow, and the first one after scalar code is slow for milliseconds.
    engines = [*(one for one in rivals if one.name in UNITS), *map(ours, CORE_MODELS)]
    pairs = _drawn('random cubes', count)
    return [Timing(name=engine.name, kind='single', count=count,
                   run=partial(call_all, engine.prepare(pairs))) for engine in engines]


def batch(model: str, name: str, count: int, kind: str = 'batch', threads: int = 1) -> Timing:
    """Return the contestant for a batch of a model on a set, every row its own sizes."""
    return Timing(name=f'{model}: {name}', kind=kind, count=count,
                  run=ours(model).prepare_batch(_drawn(name, count), threads=threads))


def measure_on(core: int, effort: Effort) -> list[Timing]:
    """Measure single calls and batches on one core, by the instruction set of this process."""
    batches = [batch(model, name, effort.batch) for model in CORE_MODELS for name in BATCH_SETS]
    with pinned({core}):
        return timed([*single_calls(effort.calls), *batches], effort.rounds)


def measure_threads(cores: Sequence[int], effort: Effort) -> list[Timing]:
    """Measure batches with one thread and with two, on these cores.

    Each has its rounds in a row. After a rest the host of a virtual machine may run both virtual
    cores on one of its own. Moving one of them away takes the host a while.
    """
    batches = [batch(model, 'random cubes', effort.shared_batch, kind, threads)
               for model in CORE_MODELS for threads, kind in enumerate(SHARED, start=1)]
    with pinned(cores):
        return [timing for one in batches for timing in timed([one], effort.rounds)]


def measure_in_passes(cores: Sequence[int], effort: Effort) -> list[list[Timing]]:
    """Return the timings of each instruction set, the best first, and of threads on two cores."""
    measures: list[Callable[[], Any]] = [
        partial(in_subprocess, measure_on, cores[-1], effort, patience=LONGEST_RUN,
                instruction_set=name) for name in reversed(instruction_sets())]
    if len(cores) > 1:
        measures.append(partial(measure_threads, cores[-2:], effort))
    passes = [[measure() for measure in measures] for _ in range(effort.passes)]
    return [[replace(parts[0], rounds=[time for part in parts for time in part.rounds])
             for parts in zip(*runs)] for runs in zip(*passes)]


def measure_starts(count: int) -> Timing:
    """Return the times from the start of a process to its first contact, after one warm-up."""
    def first_contact() -> tuple[subprocess.Popen[bytes], bytes]:
        new = subprocess.Popen([sys.executable, '-c', FIRST_CONTACT], stdout=subprocess.PIPE)
        return new, new.stdout.readline()

    timing = Timing(name='first contact', kind='new process')
    for _ in range(1 + count):
        took, (new, answer) = nanoseconds(first_contact)
        new.communicate()
        if not answer or new.returncode:
            raise RuntimeError('a new process gave no contact')
        timing.rounds.append(took)
    return replace(timing, rounds=timing.rounds[1:])


def table(timings: Sequence[Timing]) -> str:
    """Return the times of one instruction set as Markdown; NaN where MuJoCo is not installed."""
    unit = next((one for one in timings if one.name == UNIT),
                Timing(name=UNIT, kind='single', rounds=[math.nan]))
    return markdown_table(
        ['', '', 'min [ns]', 'p50 [ns]', 'p99 [ns]', 'relative to mj_geomDistance'],
        [[one.name, one.kind, *(f'{value:.0f}' for value in percentiles(one.rounds, 0, 50, 99)),
          f'{one.by(unit):.3f}'] for one in timings], words=2)


def threads_table(timings: Sequence[Timing]) -> str:
    """Return the times of batches that threads share, and what the second thread gains.

    Their rounds share no moment, so the gain is the ratio of medians.
    """
    medians = [percentiles(timing.rounds, 50)[0] for timing in timings]
    return markdown_table(['', *(f'{kind} [ns]' for kind in SHARED), 'ratio'], [
        [timing.name, f'{alone:.1f}', f'{shared:.1f}', f'{alone / shared:.2f}']
        for timing, alone, shared in zip(timings[::2], medians[::2], medians[1::2])])


def main(args: Sequence[str] | None = None) -> int:
    """Measure, print, write."""
    parser = program_parser('speed', __doc__, quick='few calls and rounds, to try it out',
                            out='speed.md, speed.csv')
    options = parser.parse_args(args)
    folder = output.results_folder(parser, options)
    effort, machine = QUICK if options.quick else FULL, output.machine(native, PACKAGES)
    runs = measure_in_passes(usable_cores(), effort)
    runs, threads = runs[:len(instruction_sets())], runs[len(instruction_sets()):]
    starts = measure_starts(effort.starts)
    text = output.page(
        'benchmarks/pages/speed', command=output.command_line('benchmarks.speed', args),
        machine=machine, effort=effort, starts=len(starts.rounds),
        start=1e-9 * percentiles(starts.rounds, 50)[0],
        threads=threads_table(*threads) if threads else 'Left out: there is one core.',
        tables='\n\n'.join(f'## {run[0].instruction_set}\n\n{table(run)}' for run in runs))
    print(text)
    (folder / 'speed.md').write_text(text, encoding='utf-8')
    output.write_csv(folder / 'speed.csv', [
        {'name': one.name, 'kind': one.kind, 'instruction_set': one.instruction_set,
         'round': number, 'ns': f'{value:.1f}'}
        for run in (*runs, *threads, [starts]) for one in run
        for number, value in enumerate(one.rounds)], about=machine)
    return 0


if __name__ == '__main__':
    sys.exit(main())

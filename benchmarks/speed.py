# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The speed gates: limits on ratios of times.

`python -m box_contact_ros frontier --speed` writes speed.md and speed.csv. Each instruction set of
the machine is measured in subprocesses of its own, on one pinned core. The contestants take turns,
so a disturbance hits all of them: the claims are ratios. Two threads and the start of a new process
follow. The exit status is 1 if a limit is broken.
"""
from __future__ import annotations

import math
import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from box_contact_ros.core import FORCE, instruction_sets, native
from box_contact_ros.scene.pose import quaternion_multiply
from box_contact_ros.solver.models import models_with_patch

from .contestant import in_subprocess, ours
from .engines import installed
from .output import machine, markdown_table, percentiles, write_csv
from .output import page as filled_page
from .pose_sets import CONTAINER, CUBE, SETS, Pairs, drawn, log_uniform, turns
from .timing import Timing, nanoseconds, pinned, timed, usable_cores

UNIT = 'MuJoCo mj_geomDistance'  # the contestant whose median single call is the unit of all ratios
UNITS = (UNIT, 'python-fcl collide')
PACKAGES = ('numpy', 'mujoco', 'python-fcl')

PATCH_COST = 1.35  # what volume and covariance may add: limits below are for the point alone
SINGLE_LIMITS = {'mlp': 0.36, 'exact': 0.36 * PATCH_COST}
"""Single call with the best instruction set [calls of UNIT]."""
BATCH_LIMITS = {'AVX-512': 0.088 * PATCH_COST, 'AVX2': 0.125 * PATCH_COST}
"""Pair of `exact` in a batch, on every set of poses, by instruction set [calls of UNIT]."""
SPREAD_LIMITS = {'mlp': 1.05, 'exact': 1.20}
"""Slowest set of poses by the median set, for the instruction sets above."""
MLP_BY_EXACT = 0.70
"""Pair of `mlp` in a batch, on every set of poses, for the instruction sets above [of `exact`]. It
was 0.60 of an `exact` that took a third more."""
THREADS_LIMIT = 1.8  # least gain of two threads on two cores, batch of `exact`
LONGEST_RUN = 3600.0  # of a subprocess with one instruction set [s]
START_LIMIT = 0.15  # from the start of a process to its first contact, without ROS [s]

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


def flush_stacks(rng: np.random.Generator, n: int) -> Pairs:
    """Draw aligned flush stacks: equal boxes, the sides of one in the planes of the other's.

    Half are cubes and half containers, 1e-5 to 0.01 of the height deep. B stands right above A, or
    displaced along x. Half of all B have a half turn about z. Half of the pairs are turned as a
    whole, and rounding then makes the angles not quite right.
    """
    size = np.where(rng.random(n)[:, None] < 0.5, CUBE, CONTAINER)
    place = np.zeros((n, 3))
    place[:, 0] = size[:, 0] * rng.uniform(-0.5, 0.5, n) * (rng.random(n) < 0.5)
    place[:, 2] = size[:, 2] * (1.0 - log_uniform(rng, 1e-5, 1e-2, n))
    half_turn = turns((0.0, 0.0, 1.0), np.pi * rng.integers(0, 2, n))
    whole = turns(rng.normal(size=(n, 3)), rng.uniform(0.0, np.pi, n) * (rng.random(n) < 0.5))
    origin = np.concatenate([np.zeros((n, 3)), whole], axis=1)
    vector = np.concatenate([place, np.zeros((n, 1))], axis=1)
    moved = quaternion_multiply(quaternion_multiply(whole, vector), whole * [-1, -1, -1, 1])
    above = np.concatenate([moved[:, :3], quaternion_multiply(whole, half_turn)], axis=1)
    return Pairs(origin, above, size, size.copy())


BATCH_SETS = {**SETS, 'aligned flush stacks': flush_stacks}
"""Sets of poses that batches are timed on."""


SHARED = ('one thread', 'two threads')
"""Kinds of timings of a large batch, which threads share."""


def _drawn(name: str, count: int) -> Pairs:
    rng = np.random.default_rng([1, list(BATCH_SETS).index(name)])
    return drawn(BATCH_SETS[name], rng, count)


def single_calls(count: int) -> list[Timing]:
    """Return the contestants for equal cubes, from two poses to a result in Python."""
    rivals, missing = installed(('mujoco', 'fcl'))
    for line in missing:
        print(f'left out: {line}', file=sys.stderr)
    # Ours come last: batches follow, and the first one after scalar code is slow for milliseconds.
    engines = [*(one for one in rivals if one.name in UNITS), *map(ours, models_with_patch())]
    pairs = _drawn('random cubes', count)
    return [Timing(name=engine.name, kind='single', count=count,
                   run=partial(_call_all, engine.prepare(pairs))) for engine in engines]


def _call_all(calls: Sequence[Callable[[], object]]) -> None:
    for call in calls:
        call()


def batch(model: str, name: str, count: int, kind: str = 'batch', threads: int = 1) -> Timing:
    """Return the contestant for a batch of a model on a set, every row its own sizes."""
    return Timing(name=f'{model}: {name}', kind=kind, count=count,
                  run=ours(model).prepare_batch(_drawn(name, count), threads=threads))


def with_instruction_set(name: str, work: Callable[..., list[Any]], *arguments: Any) -> list[Any]:
    """Return what `work` returns in a subprocess that is made to use an instruction set."""
    before = os.environ.get(FORCE)
    os.environ[FORCE] = name
    try:
        return in_subprocess(work, *arguments, patience=LONGEST_RUN)
    finally:
        if before is None:
            del os.environ[FORCE]
        else:
            os.environ[FORCE] = before


def measure_on(core: int, effort: Effort) -> list[Timing]:
    """Measure single calls and batches on one core."""
    batches = [batch(model, name, effort.batch)
               for model in models_with_patch() for name in BATCH_SETS]
    with pinned({core}):
        return timed([*single_calls(effort.calls), *batches], effort.rounds)


def measure_threads(cores: Sequence[int], effort: Effort) -> list[Timing]:
    """Measure batches with one thread and with two, on these cores.

    Each has its rounds in a row. After a rest the host of a virtual machine may run both virtual
    cores on one of its own. Moving one of them away takes the host a while.
    """
    batches = [batch(model, 'random cubes', effort.shared_batch, kind, threads)
               for model in models_with_patch() for threads, kind in enumerate(SHARED, start=1)]
    with pinned(cores):
        return [timing for one in batches for timing in timed([one], effort.rounds)]


def measure_in_passes(core: int, cores: Sequence[int], effort: Effort) -> list[list[Timing]]:
    """Return the timings of each instruction set, the best first, and of threads on two cores."""
    measures = [partial(with_instruction_set, name, measure_on, core, effort)
                for name in reversed(instruction_sets())]
    if len(cores) > 1:
        measures.append(partial(measure_threads, cores[-2:], effort))
    passes = [[measure() for measure in measures] for _ in range(effort.passes)]
    return [[replace(parts[0], rounds=[time for part in parts for time in part.rounds])
             for parts in zip(*runs)] for runs in zip(*passes)]


def measure_starts(count: int) -> list[float]:
    """Return times from the start of a process to its first contact [s], after one warm-up."""
    times = []
    for _ in range(1 + count):
        took, (new, answer) = nanoseconds(_first_contact)
        new.communicate()
        if not answer or new.returncode:
            raise RuntimeError('a new process gave no contact')
        times.append(1e-9 * took)
    return times[1:]


def _first_contact() -> tuple[subprocess.Popen[bytes], bytes]:
    new = subprocess.Popen([sys.executable, '-c', FIRST_CONTACT], stdout=subprocess.PIPE)
    return new, new.stdout.readline()


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A figure and its limit."""

    text: str
    holds: bool


def unit_of(timings: Sequence[Timing]) -> Timing:
    """Return single calls of UNIT, of NaN where MuJoCo is not installed."""
    return next((one for one in timings if one.name == UNIT), Timing(
        name=UNIT, kind='single', instruction_set='', rounds=[math.nan]))


def claims_of(timings: Sequence[Timing], best: bool) -> list[Claim]:
    """Return the claims about one instruction set; `best`: it is the machine's best."""
    unit, name = unit_of(timings), timings[0].instruction_set
    claims = []
    if best:
        single = {one.name: one for one in timings if one.kind == 'single'}
        claims += [_at_most(f'{name}: a single call of `{model}` takes {{:.3f}} of {UNIT}',
                            single[model].by(unit), limit)
                   for model, limit in SINGLE_LIMITS.items()]
    if name in BATCH_LIMITS:
        batches = {model: {one.name.partition(': ')[2]: one for one in timings
                           if one.kind == 'batch' and one.name.startswith(f'{model}: ')}
                   for model in SPREAD_LIMITS}
        slowest, ratio = _slowest({key: one.by(unit) for key, one in batches['exact'].items()})
        claims.append(_at_most(f'{name}: a pair in a batch of `exact` takes {{:.3f}} of {UNIT} on '
                               f'{slowest}, the slowest set', ratio, BATCH_LIMITS[name]))
        slowest, ratio = _slowest({key: one.by(batches['exact'][key])
                                   for key, one in batches['mlp'].items()})
        claims.append(_at_most(f'{name}: a pair in a batch of `mlp` takes {{:.3f}} of one of '
                               f'`exact` on {slowest}, the slowest set', ratio, MLP_BY_EXACT))
        for model, limit in SPREAD_LIMITS.items():
            medians = {key: percentiles(one.rounds, 50)[0]
                       for key, one in batches[model].items()}
            slowest, ns = _slowest(medians)
            claims.append(_at_most(
                f'{name}: {slowest} take `{model}` {{:.2f}} of the median set',
                ns / float(np.median(list(medians.values()))), limit))
    return claims


def _slowest(times: Mapping[str, float]) -> tuple[str, float]:
    """Return the set of the largest number, and that."""
    return max(times.items(), key=itemgetter(1))


def _at_most(text: str, value: float, limit: float) -> Claim:
    # A comparison with NaN is false: without MuJoCo its claims do not hold.
    return Claim(text=f'{text.format(value)} (limit {limit:g}).', holds=value <= limit)


def thread_claims(timings: Sequence[Timing]) -> list[Claim]:
    """Return the claims about two threads; only that of `exact` has a limit."""
    claims = []
    for model in models_with_patch():
        one, two = (next(t for t in timings if t.kind == kind and t.name.startswith(model))
                    for kind in SHARED)
        limit = THREADS_LIMIT if model == 'exact' else None
        # Their rounds share no moment, so rounds have no ratios of their own.
        gain, by_p10 = (percentiles(one.rounds, q)[0] / percentiles(two.rounds, q)[0]
                        for q in (50, 10))
        claims.append(Claim(
            text=f'Two threads are {gain:.2f} times as fast as one by medians, large batch of '
                 f'`{model}` ({"no limit" if limit is None else f"limit {limit:g}"}). '
                 f'The ratio of their 10th percentiles is {by_p10:.2f}.',
            holds=limit is None or gain >= limit))
    return claims


def start_claim(seconds: Sequence[float]) -> Claim:
    """Return the claim about the start of a process, by its median."""
    return _at_most(f'A new process has its first contact after {{:.3f}} s, median of '
                    f'{len(seconds)} starts without ROS', float(np.median(seconds)), START_LIMIT)


def table(timings: Sequence[Timing]) -> str:
    """Return the times of one instruction set as Markdown."""
    unit = unit_of(timings)
    return markdown_table(
        ['', '', 'min [ns]', 'p50 [ns]', 'p99 [ns]', 'by mj_geomDistance'],
        [[one.name, one.kind, *(f'{value:.0f}' for value in percentiles(one.rounds, 0, 50, 99)),
          f'{one.by(unit):.3f}'] for one in timings], words=2)


def page(runs: Sequence[Sequence[Timing]], claims: Sequence[Claim], command: str,
         effort: Effort) -> str:
    """Return the Markdown page."""
    return filled_page(
        'benchmarks/pages/speed',
        command=command, machine=machine(native, PACKAGES), effort=effort,
        claims='\n'.join(f'- {"" if one.holds else "goal missed: "}{one.text}' for one in claims),
        tables='\n\n'.join(f'## {run[0].instruction_set}\n\n{table(run)}' for run in runs))


def write_timings(path: Path, timings: Sequence[Timing]) -> None:
    """Write a row for each contestant and round [ns]."""
    write_csv(path, [{'name': one.name, 'kind': one.kind, 'instruction_set': one.instruction_set,
                      'round': number, 'ns': f'{value:.1f}'}
                     for one in timings for number, value in enumerate(one.rounds)],
              about=machine(native, PACKAGES))


def write_speed(folder: Path, command: str, *, core: int, quick: bool) -> int:
    """Measure, print, write speed.md and speed.csv; 1 if a limit is broken."""
    effort, cores = QUICK if quick else FULL, usable_cores()
    found = measure_in_passes(core, cores, effort)
    runs, threads = found[:len(instruction_sets())], found[len(instruction_sets()):]
    claims = [claim for number, run in enumerate(runs) for claim in claims_of(run, number == 0)]
    if threads:
        claims += thread_claims(*threads)
    else:
        print('two threads are left out: there is one core', file=sys.stderr)
    starts = measure_starts(effort.starts)
    claims.append(start_claim(starts))
    text = page(runs, claims, command, effort)
    print(text)
    (folder / 'speed.md').write_text(text, encoding='utf-8')
    write_timings(folder / 'speed.csv', [
        *(one for run in found for one in run),
        Timing(name='first contact', kind='new process', instruction_set=native.instruction_set,
               rounds=[1e9 * seconds for seconds in starts])])
    broken = [claim for claim in claims if not claim.holds]
    for claim in broken:
        print(f'frontier: limit broken: {claim.text}', file=sys.stderr)
    return 1 if broken else 0

"""Speed of the models beside what a user would otherwise call: single calls and batches.

`python -m box_contact_ros.report.speed` prints a table and writes docs/speed.md and docs/speed.csv.
All is measured in one run, on one pinned core, each contestant in turn and over again, so that what
disturbs the machine disturbs all alike: the ratios are the claim, not the times.
"""
from __future__ import annotations

import argparse
import csv
import gc
import os
import platform
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..arguments import make_folder
from ..posesets import CUBE, SETS, Pairs
from ..solver import ContactSolver

PAIRS = 2000          # single calls per round
BATCH = 16_000        # pairs of a batch, per set
ROUNDS = 40
QUICK_ROUNDS = 3
LIMITS = {('mlp', 'single'): 0.85, ('exact', 'single'): 1.0, ('mlp', 'batch'): 0.055,
          ('exact', 'batch'): 0.42}
"""By the median time of MuJoCo's distance query with its pose update."""
MLP_BY_FCL = 0.5
CONSTANT_COST = 1.1
"""Slowest set by the median set, batch of `mlp`."""


@dataclass(frozen=True)
class Timing:
    """Times of one contestant [ns per call or pair], over the rounds."""

    name: str
    kind: str
    rounds: list[float]

    def quantile(self, q: float) -> float:
        """A quantile over the rounds."""
        return float(np.quantile(self.rounds, q))


def rounds_of(contestants: dict[str, Callable[[], None]], count: int, rounds: int, kind: str,
              ) -> list[Timing]:
    """Time all contestants in turn, `rounds` times, after a warm-up; garbage collection is off."""
    times: dict[str, list[float]] = {name: [] for name in contestants}
    for run in contestants.values():
        run()
    gc.collect()
    gc.disable()
    try:
        for _ in range(rounds):
            for name, run in contestants.items():
                began = time.perf_counter_ns()
                run()
                times[name].append((time.perf_counter_ns() - began) / count)
    finally:
        gc.enable()
    return [Timing(name, kind, found) for name, found in times.items()]


def single_calls(pairs: Pairs) -> dict[str, Callable[[], None]]:
    """Contestants for single calls on equal cubes, from two poses to a result in Python."""
    poses = [(a.copy(), b.copy()) for a, b in zip(pairs.pose_a, pairs.pose_b)]

    def ours(model: str) -> Callable[[], None]:
        solver = ContactSolver(CUBE, CUBE, model=model)

        def run() -> None:
            for a, b in poses:
                solver(a, b)
        return run

    found = {model: ours(model) for model in ('mlp', 'exact')}
    split = [(a[:3].copy(), b[:3].copy(), np.roll(a[3:], 1), np.roll(b[3:], 1)) for a, b in poses]
    try:
        found['mujoco mj_geomDistance'] = _mujoco(split)
    except ImportError:
        print('mujoco is not installed: left out (extra sim)', file=sys.stderr)
    try:
        found['python-fcl collide'] = _fcl(split)
    except ImportError:
        print('python-fcl is not installed: left out (extra soup)', file=sys.stderr)
    return found


def _mujoco(split: list[tuple[np.ndarray, ...]]) -> Callable[[], None]:
    import mujoco
    half = ' '.join(str(extent / 2) for extent in CUBE)
    body = f'<body><freejoint/><geom type="box" size="{half}"/></body>'
    model = mujoco.MjModel.from_xml_string(f'<mujoco><worldbody>{body}{body}</worldbody></mujoco>')
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    place_a, place_b = data.geom_xpos
    turn_a, turn_b = data.geom_xmat
    ends = np.zeros(6)
    distance, matrix = mujoco.mj_geomDistance, mujoco.mju_quat2Mat

    def run() -> None:
        for a, b, quat_a, quat_b in split:
            place_a[:] = a
            place_b[:] = b
            matrix(turn_a, quat_a)
            matrix(turn_b, quat_b)
            distance(model, data, 0, 1, 1.0, ends)
    return run


def _fcl(split: list[tuple[np.ndarray, ...]]) -> Callable[[], None]:
    import fcl
    one, two = fcl.CollisionObject(fcl.Box(*CUBE)), fcl.CollisionObject(fcl.Box(*CUBE))
    request = fcl.CollisionRequest(num_max_contacts=1, enable_contact=True)

    def run() -> None:
        for a, b, quat_a, quat_b in split:
            one.setTransform(fcl.Transform(quat_a, a))
            two.setTransform(fcl.Transform(quat_b, b))
            fcl.collide(one, two, request, fcl.CollisionResult())
    return run


def batches(sets: dict[str, Pairs]) -> dict[str, Callable[[], None]]:
    """Contestants for batches: each model on each set, every row its own sizes."""
    found = {}
    for model in ('mlp', 'exact'):
        solver = ContactSolver(CUBE, CUBE, model=model)
        for name, (a, b, size_a, size_b) in sets.items():
            found[f'{model}: {name}'] = (
                lambda s=solver, a=a, b=b, p=size_a, q=size_b: s.batch(a, b, size_a=p, size_b=q))
    return found


def cpu_name() -> str:
    """Name of the processor."""
    try:
        lines = Path('/proc/cpuinfo').read_text().splitlines()
        return next(line.split(':')[1].strip() for line in lines if line.startswith('model name'))
    except (OSError, StopIteration):
        return platform.processor() or 'unknown processor'


def table(timings: list[Timing]) -> tuple[str, bool]:
    """The results as Markdown, and whether every limit holds."""
    by_name = {(t.name, t.kind): t for t in timings}
    unit = by_name.get(('mujoco mj_geomDistance', 'single'))
    base = unit.quantile(0.5) if unit else float('nan')
    lines = ['| | | min [ns] | p50 [ns] | p99 [ns] | p50 by mj_geomDistance | limit |',
             '| --- | --- | ---: | ---: | ---: | ---: | ---: |']
    holds = True
    for t in timings:
        limit = LIMITS.get((t.name.split(':')[0], t.kind))
        ratio = t.quantile(0.5) / base
        holds &= limit is None or not ratio > limit
        lines.append(f'| {t.name} | {t.kind} | {t.quantile(0):.0f} | {t.quantile(0.5):.0f} | '
                     f'{t.quantile(0.99):.0f} | {ratio:.3f} | {"" if limit is None else limit} |')
    fcl = by_name.get(('python-fcl collide', 'single'))
    if fcl:
        ratio = by_name['mlp', 'single'].quantile(0.5) / fcl.quantile(0.5)
        holds &= ratio <= MLP_BY_FCL
        lines += ['', f'A single call of `mlp` takes {ratio:.2f} of one of python-fcl (limit '
                      f'{MLP_BY_FCL}).']
    sets = [t.quantile(0.5) for t in timings if t.name.startswith('mlp:')]
    if sets:
        ratio = max(sets) / float(np.median(sets))
        holds &= ratio <= CONSTANT_COST
        lines += ['', f'The slowest set takes {ratio:.2f} of the median set in a batch of '
                      f'`mlp` (limit {CONSTANT_COST}): constant cost.']
    return '\n'.join(lines), holds


def main(args: Sequence[str] | None = None) -> int:
    """Measure, print, write; 1 if a limit is broken."""
    parser = argparse.ArgumentParser(
        prog='python -m box_contact_ros.report.speed', description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--out', type=Path, help='folder for speed.md and speed.csv')
    parser.add_argument('--quick', action='store_true', help='few rounds, to try it out')
    parser.add_argument('--core', type=int, help='core to run on (default: the last one)')
    options = parser.parse_args(args)
    if options.out:
        make_folder(parser, options.out)
    cores = sorted(os.sched_getaffinity(0))
    core = cores[-1] if options.core is None else options.core
    os.sched_setaffinity(0, {core})
    rounds = QUICK_ROUNDS if options.quick else ROUNDS
    size = BATCH // 16 if options.quick else BATCH
    rng = np.random.default_rng(1)
    cubes = SETS['random cubes'](rng, PAIRS)
    timings = rounds_of(single_calls(cubes), len(cubes.pose_a), rounds, 'single')
    sets = {name: Pairs(*(part[:size * 9 // 10] for part in make(rng, size)))
            for name, make in SETS.items()}
    timings += rounds_of(batches(sets), size * 9 // 10, rounds, 'batch')
    text, holds = table(timings)
    page = (
        '# Speed\n\nMade by `python -m box_contact_ros.report.speed --out docs` on one core '
        f'(number {core} of {len(cores)}) of {cpu_name()}, Python {platform.python_version()}. '
        f'{rounds} rounds, the contestants in turn; quantiles are over rounds of {PAIRS} calls or '
        'one batch. Every time is from poses to a result in Python, for MuJoCo and FCL with the '
        f'update of both poses.\n\n{text}\n\n'
        'In single calls the exact model costs less than the MLP. What the network is for is '
        'batches, and a cost that is the same for every pose.\n')
    print(page)
    if options.out:
        (options.out / 'speed.md').write_text(page)
        with (options.out / 'speed.csv').open('w', newline='') as file:
            writer = csv.writer(file)
            writer.writerow(['name', 'kind', 'round', 'ns', 'processor'])
            writer.writerows([t.name, t.kind, number, f'{value:.1f}', cpu_name()]
                             for t in timings for number, value in enumerate(t.rounds))
    return 0 if holds else 1


if __name__ == '__main__':
    sys.exit(main())

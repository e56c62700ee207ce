# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Program `speed`: calls with cold caches, threads, forces in threads and the first contact.

`python -m benchmarks.speed` writes speed.md and speed_cold.csv. The contestants of the cold calls
take turns on one pinned core, so a disturbance hits all of them, and the figures to read are ratios
to MuJoCo's signed distance. Two threads, forces in two threads and the start of a new process
follow. `frontier` has the calls one after another, and the batches, of each instruction set.
"""
from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from box_contact_ros import Body, PatchForces, contacts_of
from box_contact_ros.extras import require
from box_contact_ros.forces.patch_forces import GRAVITY

from . import output
from .contestant import CORE_MODELS, Contestant, ours
from .engines import installed
from .loops import FRAME, Scene
from .output import markdown_table, number
from .pose_sets import SETS, drawn
from .rivals import FRICTION, SUBSTEPS, pile, yard
from .timing import (
    after_warm_up,
    by_round,
    nanoseconds,
    no_garbage_collection,
    pinned,
    usable_cores,
)

UNIT = 'MuJoCo mj_collision'  # the contestant whose single call is the unit of all ratios
PACKAGES = ('numpy', 'mujoco')
ROUNDS, QUICK_ROUNDS = 20, 2  # of batches
BATCH, QUICK_BATCH = 100_000, 1_000
"""Pairs of a batch that threads share: at 20,000, waking a second core takes a tenth."""
STARTS, QUICK_STARTS = 20, 2  # new processes
TOUCHED = (0.0, 0.5, 2.0, 8.0, 48.0)
"""Memory that other work reads and writes between two calls [MB]; 0: the same call right before."""
COLD_SET, COLD_CALLS, QUICK_COLD_CALLS = 'containers', 300, 10
SHARED: Mapping[Callable[[], Scene], Mapping[str, tuple[int, int]]] = {
    pile: {'moving': (60, 240), 'awake': (480, 600)},
    yard: {'moving': (10, 60), 'awake': (60, 180)}}
"""Boxes that threads share, and the steps that are timed. The yard begins almost at rest."""
QUICK_STEPS = 3
FIRST_CONTACT = """\
from box_contact_ros import ContactSolver
cube = (2, 2, 2)
print(ContactSolver(cube, cube)((0, 0, 0, 0, 0, 0, 1), (0, 0, 1.9, 0, 0, 0, 1)), flush=True)
"""
"""The program whose start is timed, with the default model."""


@dataclass(frozen=True, kw_only=True)
class ColdRow:
    """Calls of a contestant with other work in between."""

    name: str
    megabytes: float  # that the work touches
    call_p50: float  # [ns]
    call_by_unit: float  # relative to the unit's call on the same pair; NaN: no MuJoCo


def contestants() -> list[Contestant]:
    """Return the unit, where MuJoCo is installed, and the models in C++."""
    unit = [engine for engine in installed(('mujoco',))[0] if engine.name == UNIT]
    return [*unit, *map(ours, CORE_MODELS)]


def measure_cold(seed: int, count: int) -> list[ColdRow]:
    """Return the calls of each contestant on a set, with other work before every call.

    The contestants take turns at every pair. The work evicts their code and data from the caches.
    """
    pairs = drawn(SETS[COLD_SET], np.random.default_rng(seed), count)
    prepared = {one.name: one.prepare(pairs) for one in contestants()}
    from tqdm import tqdm

    rows = []
    with pinned({usable_cores()[-1]}), no_garbage_collection():
        for megabytes in tqdm(TOUCHED, desc='speed, other work', unit='size'):
            memory = np.zeros(int(1e6 * megabytes) // 8)
            times: dict[str, list[int]] = {name: [] for name in prepared}
            for row in range(count):
                for name, calls in prepared.items():
                    if not len(memory):
                        calls[row]()
                    memory += 1.0
                    times[name].append(nanoseconds(calls[row])[0])
            unit = times.get(UNIT, [math.nan] * count)
            rows += [ColdRow(name=name, megabytes=megabytes, call_p50=float(np.median(took)),
                             call_by_unit=float(by_round(took, unit)))
                     for name, took in times.items()]
    return rows


def measure_threads(model: str, pairs: int, rounds: int) -> tuple[list[float], list[float]]:
    """Return the rounds of a batch with one thread and with two, on two cores, of a pair [ns].

    Each has its rounds in a row. After a rest the host of a virtual machine may run both virtual
    cores on one of its own. Moving one of them away takes the host a while.
    """
    asked = drawn(SETS['random cubes'], np.random.default_rng(1), pairs)
    with pinned(usable_cores()[-2:]), no_garbage_collection():
        alone, shared = ([after_warm_up(run, pairs) for _ in range(rounds)] for run in (
            ours(model).prepare_batch(asked, threads=threads) for threads in (1, 2)))
    return alone, shared


@dataclass(frozen=True, kw_only=True)
class SharedRow:
    """Steps of boxes by one thread and by two."""

    scene: str
    state: str
    one: float  # the median step [ns]
    ratio: float  # the median of two threads by one, step by step


def measure_forces(make: Callable[[], Scene], spans: Mapping[str, tuple[int, int]]
                   ) -> list[SharedRow]:
    """Return the steps of a scene by one thread and by two, which advance it in turn.

    Raises `RuntimeError` where their poses differ by a bit.
    """
    scene = make()
    boxes, weights = scene.boxes, np.zeros((len(scene.boxes.mass), 6))
    weights[:, 2] = -GRAVITY * boxes.mass
    bodies = [Body(mass=m, inertia=i) for m, i in zip(boxes.mass, boxes.inertia)]
    both = []
    for threads in (1, 2):
        forces = PatchForces(bodies, friction=FRICTION, substeps=SUBSTEPS, threads=threads,
                             rest=False)
        forces.set_boxes(boxes.size)
        both.append((forces, boxes.pose.copy(), np.zeros((len(bodies), 6))))
    times = []
    with pinned(usable_cores()[-2:]), no_garbage_collection():
        for _ in range(max(last for _, last in spans.values())):
            pairs, _ = contacts_of(boxes.size, both[0][1], margin=2.0 * GRAVITY * FRAME**2)
            took = []
            for k, (forces, poses, velocities) in enumerate(both):
                def step() -> tuple[np.ndarray, np.ndarray]:
                    forces.hold(pairs)  # noqa: B023
                    return forces.advance(FRAME, poses, velocities, weights)[:2]  # noqa: B023

                time, after = nanoseconds(step)
                both[k] = forces, *after
                took.append(time)
            times.append(took)
            if both[0][1].tobytes() != both[1][1].tobytes():
                raise RuntimeError(f'{scene.name}: poses by two threads differ')
    rows = []
    for state, (first, last) in spans.items():
        one, two = np.array(times[first:last], float).T
        rows.append(SharedRow(scene=scene.name, state=state, one=float(np.median(one)),
                              ratio=float(by_round(two, one))))
    return rows


def measure_starts(count: int) -> list[float]:
    """Return the times from the start of a process to its first contact [ns], after a warm-up."""
    def first_contact() -> tuple[subprocess.Popen[bytes], bytes]:
        new = subprocess.Popen([sys.executable, '-c', FIRST_CONTACT], stdout=subprocess.PIPE)
        return new, new.stdout.readline()

    times = []
    for _ in range(1 + count):
        took, (new, answer) = nanoseconds(first_contact)
        new.communicate()
        if not answer or new.returncode:
            raise RuntimeError('a new process gave no contact')
        times.append(float(took))
    return times[1:]


def threads_table(threads: Mapping[str, tuple[list[float], list[float]]]) -> str:
    """Return the times of batches that threads share, and what the second thread gains.

    Their rounds share no moment, so the gain is the ratio of medians.
    """
    p50 = {model: [float(np.median(times)) for times in both] for model, both in threads.items()}
    return markdown_table(['', 'one thread [ns]', 'two threads [ns]', 'ratio'], [
        [model, number(alone), number(shared), f'{alone / shared:.2f}']
        for model, (alone, shared) in p50.items()])


def shared_table(rows: Sequence[SharedRow]) -> str:
    """Return the steps of boxes by one thread in ms, and what two take of it."""
    return markdown_table(['', 'one thread [ms]', 'two threads / one'], [
        [f'{row.scene}, {row.state}', number(1e-6 * row.one), f'{row.ratio:.2f}'] for row in rows])


def cold_table(rows: Sequence[ColdRow]) -> str:
    """Return the calls with other work in between, in µs and relative to the unit."""
    by = {(row.name, row.megabytes): row for row in rows}
    return markdown_table(['', *(f'{megabytes:g} MB' for megabytes in TOUCHED)], [
        [name, *(f'{number(by[name, m].call_p50 / 1e3)} ({number(by[name, m].call_by_unit)})'
                 for m in TOUCHED)] for name in dict.fromkeys(row.name for row in rows)])


def main(args: Sequence[str] | None = None) -> int:
    """Measure, print, write."""
    parser = output.report_parser(
        'speed', __doc__, quick='few calls and rounds, to try it out', seed=1,
        out='speed.md, speed_cold.csv')
    options = parser.parse_args(args)
    require('report')
    folder, machine = output.results_folder(parser, options), output.machine(PACKAGES)
    calls, rounds, pairs, count = (
        (QUICK_COLD_CALLS, QUICK_ROUNDS, QUICK_BATCH, QUICK_STARTS) if options.quick
        else (COLD_CALLS, ROUNDS, BATCH, STARTS))
    cold = measure_cold(options.seed, calls)
    print('speed: threads and starts', file=sys.stderr)
    threads = {model: measure_threads(model, pairs, rounds) for model in CORE_MODELS}
    shared = [row for make, spans in SHARED.items() for row in measure_forces(make, {
        'moving': (0, QUICK_STEPS)} if options.quick else spans)]
    print(output.write_page(
        folder, 'speed', args, machine=machine, cold=cold_table(cold), cold_set=COLD_SET,
        shared_batch=pairs, threads=threads_table(threads), shared=shared_table(shared),
        starts=count,
        start=1e-9 * float(np.median(measure_starts(count)))))
    output.write_csv(folder / 'speed_cold.csv', map(asdict, cold), about=machine)
    return 0


if __name__ == '__main__':
    sys.exit(main())

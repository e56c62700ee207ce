"""Speed of the models and of the engines that a user would otherwise call.

`python -m box_contact_ros.reports.speed --out docs` prints the tables and writes speed.md and
speed.csv. Every instruction set of the machine is measured in a subprocess of its own, on one
pinned core. The contestants take turns, so a disturbance hits all of them: the claims are ratios.
Two threads and the start of a new process follow. The exit status is 1 if a limit is broken.
"""
from __future__ import annotations

import argparse
import csv
import gc
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from ..core import FORCE, instruction_sets, native
from ..output import processor, versions
from ..scene.pose import quaternion_multiply
from ..scene.pose_sets import CONTAINER, CUBE, SETS, Pairs, log_uniform, turns
from ..solver.arguments import make_folder
from ..solver.contact_solver import ContactSolver

CALLS, BATCH, ROUNDS = 2_000, 20_000, 40
"""Single calls of a round, pairs of a batch, rounds."""
THREAD_BATCH = 100_000
"""Pairs of the batches that threads share: at 20,000, waking a second core takes a tenth."""
QUICK_CALLS, QUICK_BATCH, QUICK_ROUNDS = 200, 1_000, 3
STARTS, QUICK_STARTS = 20, 2
"""New processes that are timed."""
MODELS = ('exact', 'mlp')
UNIT = 'MuJoCo mj_geomDistance'
"""The contestant whose median single call is the unit of all ratios."""
PACKAGES = ('numpy', 'mujoco', 'python-fcl')

SINGLE_LIMIT = 0.36
"""Single call of `exact` with the best instruction set [calls of UNIT]."""
BATCH_LIMITS = {'AVX-512': 0.088, 'AVX2': 0.125}
"""Pair of `exact` in a batch, on every set of poses, by instruction set [calls of UNIT]."""
SPREAD_LIMIT = 1.20
"""Slowest set of poses by the median set, batch of `exact`, for the instruction sets above."""
THREADS_LIMIT = 1.8
"""Least gain of two threads on two cores, batch of `exact`."""
START_LIMIT = 0.15
"""From the start of a process to its first contact, without ROS [s]."""

FIRST_CONTACT = """\
from box_contact_ros import ContactSolver
cube = (2, 2, 2)
print(ContactSolver(cube, cube)((0, 0, 0, 0, 0, 0, 1), (0, 0, 1.9, 0, 0, 0, 1)), flush=True)
"""
"""The program whose start is timed, with the default model."""


@dataclass(frozen=True, kw_only=True)
class Timing:
    """Times of one contestant [ns for each call or pair], over the rounds."""

    name: str
    kind: str
    """'single' or 'batch'; 'two threads' for a batch that two threads share."""
    instruction_set: str
    rounds: list[float]

    def quantile(self, q: float) -> float:
        """Return a quantile over the rounds."""
        return float(np.quantile(self.rounds, q))

    @property
    def median(self) -> float:
        """The median over the rounds."""
        return self.quantile(0.5)


@dataclass(frozen=True, kw_only=True)
class Contestant:
    """What is timed."""

    name: str
    kind: str
    count: int
    """Calls or pairs of a run."""
    run: Callable[[], object]


@dataclass(frozen=True, kw_only=True)
class Claim:
    """A figure and its limit."""

    text: str
    holds: bool


# --- contestants ----------------------------------------------------------------------------------


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


def _drawn(name: str, count: int) -> Pairs:
    """Draw exactly `count` pairs of a set; a few draws miss."""
    rng = np.random.default_rng([1, list(BATCH_SETS).index(name)])
    drawn = BATCH_SETS[name](rng, count + count // 20 + 20)
    return Pairs(*(np.ascontiguousarray(part[:count]) for part in drawn))


def single_calls(pairs: Pairs) -> list[Contestant]:
    """Return the contestants for equal cubes, from two poses to a result in Python."""
    poses = list(zip(pairs.pose_a.copy(), pairs.pose_b.copy()))
    split = [(a[:3].copy(), b[:3].copy(), np.roll(a[3:], 1), np.roll(b[3:], 1)) for a, b in poses]
    found: dict[str, Callable[[], None]] = {model: _ours(model, poses) for model in MODELS}
    for name, make, extra in ((UNIT, _mujoco, 'sim'), ('python-fcl collide', _fcl, 'soup')):
        try:
            found[name] = make(split)
        except ImportError:
            print(f'{name} is not installed: left out (extra {extra!r})', file=sys.stderr)
    return [Contestant(name=name, kind='single', count=len(poses), run=run)
            for name, run in found.items()]


def _ours(model: str, poses: list[tuple[np.ndarray, np.ndarray]]) -> Callable[[], None]:
    solver = ContactSolver(CUBE, CUBE, model=model)

    def run() -> None:
        for a, b in poses:
            solver(a, b)
    return run


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


def batch(model: str, name: str, count: int, threads: int = 1) -> Contestant:
    """Return the contestant for a batch of a model on a set, every row its own sizes."""
    solver = ContactSolver(CUBE, CUBE, model=model)
    a, b, size_a, size_b = _drawn(name, count)
    return Contestant(
        name=f'{model}: {name}', kind='two threads' if threads == 2 else 'batch', count=count,
        run=lambda: solver.batch(a, b, size_a=size_a, size_b=size_b, threads=threads))


# --- measuring ------------------------------------------------------------------------------------


def timed(contestants: Sequence[Contestant], rounds: int) -> list[Timing]:
    """Time all contestants in turn, `rounds` times, after a warm-up; garbage collection is off."""
    times: list[list[float]] = [[] for _ in contestants]
    for one in contestants:
        one.run()
    gc.collect()
    gc.disable()
    try:
        for _ in range(rounds):
            for one, found in zip(contestants, times):
                began = time.perf_counter_ns()
                one.run()
                found.append((time.perf_counter_ns() - began) / one.count)
    finally:
        gc.enable()
    return [Timing(name=one.name, kind=one.kind, instruction_set=native.instruction_set,
                   rounds=found) for one, found in zip(contestants, times)]


def measure_here(core: int, quick: bool) -> list[Timing]:
    """Measure single calls and batches in this process, on one core."""
    os.sched_setaffinity(0, {core})
    calls, pairs = (QUICK_CALLS, QUICK_BATCH) if quick else (CALLS, BATCH)
    contestants = single_calls(_drawn('random cubes', calls))
    contestants += [batch(model, name, pairs) for model in MODELS for name in BATCH_SETS]
    return timed(contestants, QUICK_ROUNDS if quick else ROUNDS)


def print_timings(core: int, quick: bool) -> None:
    """Print what `measure_here` finds as JSON, for `measure_with`."""
    print(json.dumps([asdict(one) for one in measure_here(core, quick)]))


def measure_with(instruction_set: str, core: int, quick: bool) -> list[Timing]:
    """Measure in a subprocess that is made to use an instruction set."""
    assert __spec__ is not None  # its name is this module's, also where __name__ is __main__
    code = f'from {__spec__.name} import print_timings; print_timings({core}, {quick})'
    done = subprocess.run([sys.executable, '-c', code], stdout=subprocess.PIPE, text=True,
                          check=True, env={**os.environ, FORCE: instruction_set})
    return [Timing(**fields) for fields in json.loads(done.stdout)]


def measure_threads(cores: Sequence[int], quick: bool) -> list[Timing]:
    """Measure batches with one thread and with two, on these cores."""
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, set(cores))
    try:
        count = QUICK_BATCH if quick else THREAD_BATCH
        return timed([batch(model, 'random cubes', count, threads) for model in MODELS
                      for threads in (1, 2)], QUICK_ROUNDS if quick else ROUNDS)
    finally:
        os.sched_setaffinity(0, before)


def measure_starts(count: int) -> list[float]:
    """Return times from the start of a process to its first contact [s], after one warm-up."""
    times = []
    for _ in range(1 + count):
        began = time.perf_counter()
        with subprocess.Popen([sys.executable, '-c', FIRST_CONTACT], stdout=subprocess.PIPE) as new:
            assert new.stdout is not None
            answered = bool(new.stdout.readline())
            times.append(time.perf_counter() - began)
            new.stdout.read()
        if not answered or new.returncode:
            raise RuntimeError('a new process gave no contact')
    return times[1:]


# --- the report -----------------------------------------------------------------------------------


def unit_of(timings: Sequence[Timing]) -> float:
    """Return the median single call of UNIT [ns], NaN where MuJoCo is not installed."""
    return next((one.median for one in timings if one.name == UNIT), float('nan'))


def _exact_batches(timings: Sequence[Timing]) -> dict[str, float]:
    """Return the median times of batches of `exact` by set [ns a pair]."""
    return {one.name.partition(': ')[2]: one.median for one in timings
            if one.kind == 'batch' and one.name.startswith('exact: ')}


def claims_of(timings: Sequence[Timing], best: bool) -> list[Claim]:
    """Return the claims about one instruction set; `best`: it is the machine's best."""
    unit, name = unit_of(timings), timings[0].instruction_set
    claims = []
    if best:
        single = next(one.median for one in timings if (one.name, one.kind) == ('exact', 'single'))
        claims.append(_at_most(f'{name}: a single call of `exact` takes {{:.3f}} of {UNIT}',
                               single / unit, SINGLE_LIMIT))
    if name in BATCH_LIMITS:
        batches = _exact_batches(timings)
        slowest = max(batches, key=lambda one: batches[one])
        claims.append(_at_most(
            f'{name}: a pair in a batch of `exact` takes {{:.3f}} of {UNIT} on {slowest}, the '
            'slowest set', batches[slowest] / unit, BATCH_LIMITS[name]))
        claims.append(_at_most(
            f'{name}: {slowest} take {{:.2f}} of the median set',
            batches[slowest] / float(np.median(list(batches.values()))), SPREAD_LIMIT))
    return claims


def _at_most(text: str, value: float, limit: float) -> Claim:
    # A comparison with NaN is false: without MuJoCo its claims do not hold.
    return Claim(text=f'{text.format(value)} (limit {limit:g}).', holds=value <= limit)


def thread_claims(timings: Sequence[Timing]) -> list[Claim]:
    """Return the claims about two threads; only that of `exact` has a limit."""
    claims = []
    for model in MODELS:
        one, two = (next(t.median for t in timings if t.kind == kind and t.name.startswith(model))
                    for kind in ('batch', 'two threads'))
        limit = THREADS_LIMIT if model == 'exact' else None
        claims.append(Claim(
            text=f'Two threads are {one / two:.2f} times as fast as one, large batch of `{model}` '
                 f'({"no limit" if limit is None else f"limit {limit:g}"}).',
            holds=limit is None or one / two >= limit))
    return claims


def start_claim(seconds: Sequence[float]) -> Claim:
    """Return the claim about the start of a process, by its median."""
    return _at_most(f'A new process has its first contact after {{:.3f}} s, median of '
                    f'{len(seconds)} starts without ROS', float(np.median(seconds)), START_LIMIT)


def table(timings: Sequence[Timing]) -> str:
    """Return the times of one instruction set as Markdown."""
    unit = unit_of(timings)
    lines = ['| | | min [ns] | p50 [ns] | p99 [ns] | p50 by mj_geomDistance |',
             '| --- | --- | ---: | ---: | ---: | ---: |']
    lines += [f'| {one.name} | {one.kind} | {one.quantile(0):.0f} | {one.median:.0f} | '
              f'{one.quantile(0.99):.0f} | {one.median / unit:.3f} |' for one in timings]
    return '\n'.join(lines)


def page(runs: Sequence[Sequence[Timing]], claims: Sequence[Claim], command: str,
         quick: bool) -> str:
    """Return the Markdown page."""
    rounds, calls, pairs = ((QUICK_ROUNDS, QUICK_CALLS, QUICK_BATCH) if quick else
                            (ROUNDS, CALLS, BATCH))
    listed = '\n'.join(f'- {"" if claim.holds else "BROKEN: "}{claim.text}' for claim in claims)
    tables = '\n\n'.join(f'## {run[0].instruction_set}\n\n{table(run)}' for run in runs)
    return f"""# Speed

Made by `{command}` on one core of {processor()}; {versions(PACKAGES)}.

Every time is from poses to a result in Python; that of MuJoCo and FCL includes the update of both
poses. Each instruction set has a process of its own. In it the contestants take turns, {rounds}
rounds. Quantiles are over rounds of {calls:,} calls, or of one batch of {pairs:,} pairs.

{listed}

{tables}
"""


def write_csv(path: Path, timings: Sequence[Timing], starts: Sequence[float]) -> None:
    """Write a row for each contestant and round; the times of starts are in ns too."""
    machine = [processor(), versions(PACKAGES)]
    with path.open('w', newline='', encoding='utf-8') as file:
        writer = csv.writer(file, lineterminator='\n')
        writer.writerow(['name', 'kind', 'instruction_set', 'round', 'ns', 'processor', 'versions'])
        writer.writerows([one.name, one.kind, one.instruction_set, number, f'{value:.1f}', *machine]
                         for one in timings for number, value in enumerate(one.rounds))
        writer.writerows(['first contact', 'new process', native.instruction_set, number,
                          f'{1e9 * seconds:.0f}', *machine]
                         for number, seconds in enumerate(starts))


def main(args: Sequence[str] | None = None) -> int:
    """Measure, print, write; 1 if a limit is broken."""
    parser = argparse.ArgumentParser(
        prog='python -m box_contact_ros.reports.speed', description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--out', type=Path, help='folder for speed.md and speed.csv')
    parser.add_argument('--quick', action='store_true', help='few rounds, to try it out')
    parser.add_argument('--core', type=int, help='core to run on (default: the last one)')
    options = parser.parse_args(args)
    if options.out:
        make_folder(parser, options.out)
    cores = sorted(os.sched_getaffinity(0))
    core = cores[-1] if options.core is None else options.core
    if core not in cores:
        parser.error(f'--core {core} is not one of {cores}')
    names = instruction_sets()
    runs = [measure_with(name, core, options.quick) for name in reversed(names)]
    claims = [claim for number, run in enumerate(runs) for claim in claims_of(run, number == 0)]
    threads = []
    if len(cores) > 1:
        threads = measure_threads(cores[-2:], options.quick)
        claims += thread_claims(threads)
    else:
        print('two threads are left out: there is one core', file=sys.stderr)
    starts = measure_starts(QUICK_STARTS if options.quick else STARTS)
    claims.append(start_claim(starts))
    given = sys.argv[1:] if args is None else args
    text = page(runs, claims, ' '.join(['python -m box_contact_ros.reports.speed', *given]),
                options.quick)
    print(text)
    if options.out:
        (options.out / 'speed.md').write_text(text, encoding='utf-8')
        write_csv(options.out / 'speed.csv', [one for run in (*runs, threads) for one in run],
                  starts)
    broken = [claim for claim in claims if not claim.holds]
    for claim in broken:
        print(f'speed: limit broken: {claim.text}', file=sys.stderr)
    return 1 if broken else 0


if __name__ == '__main__':
    sys.exit(main())

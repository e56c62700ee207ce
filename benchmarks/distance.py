# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Program `distance`: distances of boxes apart, beside other engines, and a fuzzer of them.

`python -m benchmarks.distance` compiles native_calls/, which calls all in turn, and writes
distance.md, .csv and .png: times relative to `mj_geomDistance`, and errors against a judge that
proves the distance. `--fuzz N` proves N drawn pairs of all families instead; the status is 1 if one
is beyond the bounds of docs/reference/conventions.md.
"""
from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

import numpy as np

from box_contact_ros.arguments import within
from box_contact_ros.core import instruction_sets
from box_contact_ros.extras import require
from box_contact_ros.solver.contact_solver import ContactSolver
from box_contact_ros.solver.nearest import Nearests
from box_contact_ros.solver.pose import rotation_matrix

from . import distance_picture, output
from .apart import FAMILIES, Proof, draw, prove
from .engines import add_leave_out
from .native_calls import FULL, Effort, Program, Ratio, compiled_for, of_copies
from .output import markdown_table, number
from .pose_sets import Pairs
from .timing import by_round, no_garbage_collection, pinned, usable_cores

QUICK = Effort(2, 400, 1, 100)
UNIT = 'mj_geomDistance, single'
PYTHON_FAMILIES = ('random', 'swaying containers')
PIECE = 20_000  # pairs that are fuzzed at a time
BOUNDS = {'above': 32.0, 'below': 32.0, 'outside': 10.0, 'length': 32.0}
"""Of `Proof`, as conventions.md promises them [2⁻⁵³ of the largest size or coordinate]."""


class Found(NamedTuple):
    """One contestant on the pairs of a family."""

    nanoseconds: np.ndarray  # (copies, rounds), of a pair
    errors: np.ndarray
    """|distance − true distance| (n,) divided by size + distance of the centres."""


OnFamily = Mapping[str, Found]  # by contestant


def distances(pairs: Pairs) -> Nearests:
    """Return our own answers."""
    return ContactSolver().distance_batch(pairs.pose_a, pairs.pose_b, size_a=pairs.size_a,
                                          size_b=pairs.size_b)


def drawn_apart(name: str, count: int) -> tuple[Pairs, Proof]:
    """Return about `count` pairs of a family that are apart, and their true distances."""
    pairs = draw(name, np.random.default_rng([7, *name.encode()]), count)
    found = distances(pairs)
    rows = np.flatnonzero(~found.colliding)
    pairs = pairs.rows(rows)
    return pairs, prove(pairs, found[rows])


def timed(program: Program, pairs: Pairs, proof: Proof, instruction_set: str,
          effort: Effort) -> OnFamily:
    """Return times and errors of all contestants on one family, in one process."""
    answers = program.answers(pairs, instruction_set, effort.rounds, effort.calls)
    scale = pairs.size + np.linalg.norm(pairs.pose_b[:, :3] - pairs.pose_a[:, :3], axis=1)
    return {name: Found(nanoseconds, np.abs(found - proof.true[:len(found)]) / scale[:len(found)])
            for name, (nanoseconds, found) in answers.items()}


def times_table(found: Mapping[str, OnFamily]) -> str:
    """Return a row per family: the time of `UNIT`, and the ratios of all others to it."""
    names = [name for name in next(iter(found.values())) if name != UNIT]
    return markdown_table(['', '`mj_geomDistance` [ns]', *names], [
        [family, f'{np.median(one[UNIT].nanoseconds):.0f}',
         *(str(Ratio.of(one, name, UNIT)) for name in names)]
        for family, one in found.items()])


def errors_table(found: Mapping[str, OnFamily]) -> str:
    """Return a row per family: the largest error of each, of size + distance of the centres."""
    names = list(next(iter(found.values())))
    return markdown_table(['', *names], [
        [family, *(f'{errors.max():.1e}' for _, errors in one.values())]
        for family, one in found.items()])


def proofs_table(proofs: Mapping[str, Proof]) -> str:
    """Return a row per family: what the judge proves of our answers."""
    return markdown_table(['', 'pairs', 'too large', 'too small', 'outside', 'length', 'doubt'], [
        [family, f'{len(proof.true):,}', *(number(float(np.nanmax(getattr(proof, name))))
                                           for name in (*BOUNDS, 'doubt'))]
        for family, proof in proofs.items()])


def in_python(rounds: int, calls: int) -> dict[str, dict[str, np.ndarray]]:
    """Return the times (rounds,) of a pair [ns] from Python, by family and contestant."""
    import mujoco

    boxes = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom type="box" size="1 1 1"/><body pos="0 0 3"><freejoint/>'
        '<geom type="box" size="1 1 1"/></body></worldbody></mujoco>')
    data, from_to = mujoco.MjData(boxes), np.zeros(6)
    mujoco.mj_forward(boxes, data)
    found: dict[str, dict[str, np.ndarray]] = {}
    for family in PYTHON_FAMILIES:
        pairs, _ = drawn_apart(family, calls)
        pairs = pairs._replace(size_a=np.tile(pairs.size_a[0], (len(pairs.size_a), 1)),
                               size_b=np.tile(pairs.size_b[0], (len(pairs.size_b), 1)))
        solver = ContactSolver(pairs.size_a[0], pairs.size_b[0])
        boxes.geom_size[:] = pairs.size_a[0] / 2, pairs.size_b[0] / 2
        listed = list(zip(pairs.pose_a, pairs.pose_b))
        placed = [(np.array([a[:3], b[:3]]), np.array([
            rotation_matrix(pose[None, 3:])[0].ravel() for pose in (a, b)])) for a, b in listed]

        def ours(solver: ContactSolver = solver, listed: list = listed) -> None:
            for a, b in listed:
                solver.distance(a, b)

        def batch(solver: ContactSolver = solver, pairs: Pairs = pairs) -> None:
            solver.distance_batch(pairs.pose_a, pairs.pose_b)

        def theirs(placed: list = placed) -> None:
            position, matrix = data.geom_xpos, data.geom_xmat
            for at, turn in placed:
                position[:], matrix[:] = at, turn
                mujoco.mj_geomDistance(boxes, data, 0, 1, 1e10, from_to)

        runs = {'mj_geomDistance': theirs, 'solver.distance': ours, 'distance_batch': batch}
        found[family] = _rounds(runs, rounds, len(listed))
    return found


def _rounds(runs: Mapping[str, Callable[[], None]], rounds: int, pairs: int,
            ) -> dict[str, np.ndarray]:
    """Return times (rounds,) of a pair [ns]; contestants take turns after a round of warm-up."""
    import time

    times: dict[str, list[float]] = {name: [] for name in runs}
    with no_garbage_collection():
        for number_of_round in range(rounds + 1):
            for name, run in runs.items():
                start = time.perf_counter_ns()
                run()
                if number_of_round:
                    times[name].append((time.perf_counter_ns() - start) / pairs)
    return {name: np.array(values) for name, values in times.items()}


def python_table(found: Mapping[str, Mapping[str, np.ndarray]]) -> str:
    """Return a row per family: times relative to MuJoCo's, round by round."""
    def ratio(times: Mapping[str, np.ndarray], name: str) -> str:
        return f'{np.median(by_round(times[name], times["mj_geomDistance"])):.2f}'

    return markdown_table(['', '`mj_geomDistance` [ns]', '`distance`', '`distance_batch`'], [
        [family, f'{np.median(times["mj_geomDistance"]):.0f}', ratio(times, 'solver.distance'),
         ratio(times, 'distance_batch')] for family, times in found.items()])


def csv_rows(found: Mapping[str, Mapping[str, OnFamily]]) -> Iterator[dict[str, object]]:
    """Yield a row per instruction set, family and contestant."""
    for instruction_set, by_family in found.items():
        for family, one in by_family.items():
            for name, (nanoseconds, errors) in one.items():
                yield {'instruction_set': instruction_set, 'family': family, 'contestant': name,
                       'p50_ns': float(np.median(nanoseconds)),
                       **Ratio.of(one, name, UNIT).columns('by_unit'),
                       'error_p99': float(np.percentile(errors, 99)),
                       'error_worst': float(errors.max())}


def fuzz(name: str, seed: int, count: int) -> tuple[int, dict[str, float], list[str]]:
    """Return how many of `count` pairs are apart, the worst of each bound, and what is beyond."""
    pairs = draw(name, np.random.default_rng([seed, *name.encode()]), count)
    found, faults = distances(pairs), []
    proof = prove(pairs, found)
    sat = pairs.contacts()
    swapped = distances(Pairs(pairs.pose_b, pairs.pose_a, pairs.size_b, pairs.size_a))
    below = ~found.colliding & (found.distance < sat.separation)
    bad = {'below the separation': below, 'verdict': found.colliding != sat.colliding,
           'swap': (found.distance != swapped.distance)
           | (found.point_a != swapped.point_b).any(axis=1)
           | (found.normal != -swapped.normal).any(axis=1)}
    bad |= {bound: ~found.colliding & ~(np.abs(getattr(proof, bound)) <= most)
            for bound, most in BOUNDS.items()}
    for fault, rows in bad.items():
        for row in np.flatnonzero(rows)[:3]:
            faults.append(f'{name}, {fault}: ' + ', '.join(
                repr(part[row].tolist()) for part in pairs))
    worst = {bound: float(np.nanmax(getattr(proof, bound), initial=0.0)) for bound in BOUNDS}
    return int((~found.colliding).sum()), worst, faults


def run_fuzz(count: int, seed: int) -> int:
    """Prove drawn pairs of all families on all cores; print what was found."""
    from tqdm import tqdm

    pieces = max(1, count // (PIECE * len(FAMILIES)))
    size = min(PIECE, max(1, count // len(FAMILIES)))
    jobs = [(name, seed + piece, size) for piece in range(pieces) for name in FAMILIES]
    apart, worst, faults = 0, dict.fromkeys(BOUNDS, 0.0), []
    with ProcessPoolExecutor(len(usable_cores())) as pool:
        for proved, found, bad in tqdm(pool.map(fuzz, *zip(*jobs)), total=len(jobs), unit='piece'):
            apart += proved
            faults += bad
            worst = {bound: max(worst[bound], found[bound]) for bound in BOUNDS}
    print(f'{apart:,} of {size * len(jobs):,} pairs are apart and proved; at worst ' + ', '.join(
        f'{bound} {value:.1f} (at most {BOUNDS[bound]:g})' for bound, value in worst.items()))
    print(*faults[:20], sep='\n', end='')
    return int(bool(faults))


def main(args: Sequence[str] | None = None) -> int:
    """Compile, measure, print, write; 2 where the program cannot be made."""
    from tqdm import tqdm

    parser = output.report_parser('distance', __doc__, quick='few pairs and rounds, to try it out',
                                  seed=1, out='distance.md, .csv and .png')
    parser.add_argument('--fuzz', type=within(1), metavar='N', help='prove N pairs, and no report')
    add_leave_out(parser)
    options = parser.parse_args(args)
    if options.fuzz:
        return run_fuzz(options.fuzz, options.seed)
    folder = output.results_folder(parser, options)
    require('report', 'sim')
    effort = QUICK if options.quick else FULL
    names = [name for name in instruction_sets() if name != 'baseline'] or list(instruction_sets())
    found: dict[str, dict[str, OnFamily]] = {name: {} for name in names}
    proofs: dict[str, Proof] = {}
    with tempfile.TemporaryDirectory() as made:
        program = compiled_for('distance', options, Path(made), 'distance')
        if program is None:
            return 2
        copies = [program.copied(Path(made, f'copy {number}')) for number in range(effort.copies)]
        with pinned({usable_cores()[-1]}):
            for family in tqdm(FAMILIES, unit='family'):
                chosen, proofs[family] = drawn_apart(family, effort.pairs)
                runs = [{name: timed(copy, chosen, proofs[family], name, effort) for name in names}
                        for copy in copies]
                for name in names:
                    found[name][family] = of_copies([run[name] for run in runs])
            from_python = in_python(effort.rounds, effort.calls)
    times = times_table(found[names[-1]])
    output.write_page(
        folder, 'distance', args, machine=output.machine(), **effort._asdict(), best=names[-1],
        times=times, errors=errors_table(found[names[-1]]), proofs=proofs_table(proofs),
        python=python_table(from_python), code=program.calls_shown(), engines=program.engines(),
        missing=program.left_out())
    output.write_csv(folder / 'distance.csv', csv_rows(found), about=output.machine())
    distance_picture.draw(folder / 'distance.png', folder / 'distance.csv', names[-1])
    print(times)
    return 0


if __name__ == '__main__':
    sys.exit(main())

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Program `motion`: times of impact and least distances, judged, and beside other engines.

`python -m benchmarks.motion` compiles motion_calls/, whose judge proves or refutes each answer, and
writes motion.md and motion.csv. The status is 1 if an answer is late, early, too high or in doubt.
"""
from __future__ import annotations

import importlib.util
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

import numpy as np

from box_contact_ros.extras import require

from . import native_calls, output
from .engines import DYNAMICS, add_leave_out, may_miss
from .motions import EVERYDAY, KINDS, TOLERANCE, Motions, draw
from .output import markdown_table, number
from .pose_sets import quaternion_multiply
from .rivals import MADE
from .timing import pinned, usable_cores

MOTIONS, TIMED, RIVALED = 52_632, 2_000, 400  # of a kind: a million in all
QUICK_MOTIONS, QUICK_TIMED, QUICK_RIVALED = 40, 40, 10
CALLS_FOLDER = Path(__file__).with_name('motion_calls')
SOURCES = output.ROOT / 'box_contact_ros/core/src'
STANDING = ('containers that swing', 'plates and bullets', 'bars that turn by')
"""Kinds without a clearance whose box A stands: the only ones that Rapier answers."""
RIVALED_KINDS = (*STANDING, 'both turning')
NEAR = 1e-3  # of the way: times that differ by more are late or early
GOALS = {'time': (3.0, 12.0, 30.0), 'least': (10.0, np.inf, np.inf)}
"""Distances of a motion of all kinds: the mean, 99.9 % and the most."""
COLUMNS = ('time', 'time_distances', 'late', 'early', 'least', 'least_distances', 'too_high',
           'error', 'distance_ns', 'time_ns', 'least_ns', 'sampled', 'sampled_ns')
"""Of `Answer` in motion_calls/main.cpp."""
Answers = dict[str, np.ndarray]  # (n,) by column


def compiled(folder: Path) -> Path:
    """Compile motion_calls/ into a folder; RuntimeError with what the compiler reports."""
    native_calls.run_compiler(
        '-O2', '-ffp-contract=off', '-fno-tree-slp-vectorize', '-Wno-psabi', f'-I{SOURCES}',
        CALLS_FOLDER / 'main.cpp', '-o', folder / 'motion', *native_calls.library_beside(folder))
    return folder / 'motion'


def write_motions(file: Path, found: Motions) -> None:
    """Write motions as motion_calls/rows.hpp has them."""
    np.hstack([part.reshape(len(found.clearance), -1) for part in found]).tofile(file)


def judged(program: Path, found: Motions, timed: int, sampled: int) -> Answers:
    """Return the answers to all motions, and what the judge says of them."""
    count = len(found.clearance)
    given, answers = program.with_name('motions'), program.with_name('answers')
    write_motions(given, found)
    done = subprocess.run([program, given, repr(TOLERANCE), str(timed), str(sampled), answers],
                          capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(done.stderr.strip())
    return dict(zip(COLUMNS, np.fromfile(answers).reshape(count, len(COLUMNS)).T))


class Cost(NamedTuple):
    """How many distances answers take: the mean, the 99.9th percentile and the most."""

    mean: float
    tail: float
    most: float

    @staticmethod
    def of(distances: np.ndarray) -> Cost:
        """Return the cost of answers that took so many distances (n,)."""
        return Cost(float(distances.mean()), float(np.percentile(distances, 99.9)),
                    float(distances.max()))

    def __str__(self) -> str:
        return f'{self.mean:.1f} / {self.tail:.0f} / {self.most:.0f}'


FAULTS = ('late', 'early', 'too_high')


def faults(answers: Answers) -> tuple[int, ...]:
    """Return how many answers are late, early and too high, and how many are in doubt."""
    bad = [int((answers[name] == 1.0).sum()) for name in FAULTS]
    return (*bad, int(sum((answers[name] == 0.5).sum() for name in FAULTS)))


def verdicts_table(found: Mapping[str, Answers]) -> str:
    """Return a row per kind: how many motions meet, and how many answers are wrong."""
    return markdown_table(['', 'motions', 'meet', 'late', 'early', 'too high', 'in doubt'], [
        [kind, f'{len(one["time"]):,}', f'{np.isfinite(one["time"]).sum():,}', *faults(one)]
        for kind, one in found.items()])


def ratio(answers: Answers, name: str) -> float:
    """Return the median time of an answer divided by that of a distance; NaN: none was timed."""
    timed = answers['distance_ns'] > 0.0
    if not timed.any():
        return np.nan
    return float(np.median(answers[f'{name}_ns'][timed])
                 / np.median(answers['distance_ns'][timed]))


def costs_table(found: Mapping[str, Answers]) -> str:
    """Return a row per kind: distances and time of both answers."""
    def row(kind: str, one: Answers, *ratios: str) -> list[object]:
        return [kind, *(cell for name, by in zip(('time', 'least'), ratios) for cell in (
            Cost.of(one[f'{name}_distances']), by))]

    rows = [row(kind, one, *(number(ratio(one, name), 2) for name in ('time', 'least')))
            for kind, one in found.items()]
    every = {name: np.concatenate([one[name] for one in found.values()]) for name in COLUMNS}
    head = '', 'first time: mean / 99.9 % / most', 'time', 'least distance', 'time'
    return markdown_table(head, [*rows, row('**all**', every, '', '')])


Times = tuple[np.ndarray, np.ndarray]
"""Of motions: times (n,), NaN for never, and nanoseconds of a call (n,)."""


class Rival(NamedTuple):
    """Another engine: what answers, what it was made from, and which kinds it can answer."""

    ask: Callable[[Motions], Times]
    source: str
    kinds: Sequence[str] = RIVALED_KINDS


def program_rival(program: Path) -> Rival:
    """Return an engine whose program is made of motion_calls/rival.hpp."""
    def ask(found: Motions) -> Times:
        with tempfile.TemporaryDirectory() as made:
            given, answers = Path(made, 'motions'), Path(made, 'answers')
            write_motions(given, found)
            subprocess.run([program, given, answers], check=True)
            times, nanoseconds = np.fromfile(answers).reshape(-1, 2).T
        return times, nanoseconds

    source = subprocess.run([program], capture_output=True, text=True, check=True).stdout
    return Rival(ask, source.strip())


def compiled_fcl(folder: Path) -> Path | None:
    """Compile FCL's program into a folder; None where FCL is not installed with its headers."""
    flags = native_calls.package_flags('fcl')
    if flags is None:
        return None
    native_calls.run_compiler('-O2', CALLS_FOLDER / 'fcl.cpp', '-o', folder / 'fcl', *flags)
    return folder / 'fcl'


def rapier_rival() -> Rival:
    """Return Rapier's nonlinear shape cast, at a box that stands."""
    import rapier3d as rapier

    def place(pose: np.ndarray) -> rapier.Isometry3:
        return rapier.Isometry3(tuple(pose[:3]), rapier.Rotation3.from_scaled_axis(
            tuple(rotation_vectors(pose[None, 3:])[0])))

    def ask_one(found: Motions, row: int) -> tuple[float, float]:
        stands, start, end = found.start_a[row], found.start_b[row], found.end_b[row]
        world = rapier.PhysicsWorld(gravity=(0.0, 0.0, 0.0))
        world.add_body(rapier.RigidBody.fixed().translation(tuple(stands[:3])).rotation(
            tuple(rotation_vectors(stands[None, 3:])[0])),
            [rapier.Collider.cuboid(*(0.5 * found.size_a[row]))])
        world.update_query_pipeline()
        turn = quaternion_multiply(end[None, 3:], start[None, 3:] * [-1.0, -1.0, -1.0, 1.0])
        motion = rapier.NonlinearRigidMotion(
            place(start), rapier.Point3(0.0, 0.0, 0.0), rapier.Vec3(*(end[:3] - start[:3])),
            rapier.Vec3(*rotation_vectors(turn)[0]))
        shape, options = rapier.SharedShape.cuboid(*(0.5 * found.size_b[row])), \
            rapier.ShapeCastOptions()
        begin = time.perf_counter()
        hit = world.query_pipeline.cast_shape_nonlinear(motion, shape, options, start_time=0.0,
                                                        end_time=1.0)
        seconds = time.perf_counter() - begin
        return (np.nan if hit is None else hit[1].time_of_impact), 1e9 * seconds

    def ask(found: Motions) -> Times:
        times, nanoseconds = np.array([ask_one(found, row) for row in range(len(found[0]))]).T
        return times, nanoseconds

    return Rival(ask, f'rapier3d {metadata.version("rapier3d")}', STANDING)


def rotation_vectors(quaternions: np.ndarray) -> np.ndarray:
    """Return axes times angles (n, 3) of quaternions (n, 4), the shorter way."""
    q = quaternions * np.where(quaternions[:, 3:] < 0.0, -1.0, 1.0)
    sine = np.linalg.norm(q[:, :3], axis=1)
    angle = 2.0 * np.arctan2(sine, q[:, 3])
    return np.asarray((angle / np.maximum(sine, 1e-300))[:, None] * q[:, :3])


def compared(kind: str, name: str, times: np.ndarray, true: np.ndarray, microseconds: float,
             ) -> dict[str, object]:
    """Return a row of how often an engine's times (n,) are wrong, beside the proved ones."""
    both = np.isfinite(times) & np.isfinite(true)
    off = np.where(both, times - true, 0.0)
    return {'kind': kind, 'engine': name, 'motions': len(true),
            'late': int((off > NEAR).sum()), 'early': int((off < -NEAR).sum()),
            'missed': int((np.isnan(times) & np.isfinite(true)).sum()),
            'invented': int((np.isfinite(times) & np.isnan(true)).sum()),
            'us': microseconds}


def engines(folder: Path) -> tuple[dict[str, Rival], list[str]]:
    """Return the engines that are here, by name, and a line about each that is not.

    folder: for programs that are compiled now.
    """
    found, missing = {}, []
    if importlib.util.find_spec('rapier3d'):
        found['Rapier'] = rapier_rival()
    else:
        missing.append(f'rapier is not installed ({DYNAMICS["rapier"]})')
    box3d, fcl = MADE / 'box3d_motions', compiled_fcl(folder)
    if box3d.exists():
        found['Box3D'] = program_rival(box3d)
    else:
        missing.append(f'box3d is not here ({DYNAMICS["box3d"]})')
    if fcl:
        found['FCL'] = program_rival(fcl)
    else:
        missing.append(f'fcl is not installed with its headers ({native_calls.BRINGS["fcl"]})')
    return found, missing


def rivals(answers: Mapping[str, Answers], seed: int, count: int, asked: Mapping[str, Rival],
           ) -> Iterator[dict[str, object]]:
    """Yield a row per kind and engine."""
    for kind in RIVALED_KINDS:
        one = answers[kind]
        some = draw(kind, seed, len(one['time'])).rows(slice(count))
        true = one['time'][:count]
        found = {'box_contact': (true, one['time_ns'][:count]),
                 '1 mm': (one['sampled'][:count], one['sampled_ns'][:count]),
                 **{name: rival.ask(some) for name, rival in asked.items() if kind in rival.kinds}}
        for name, (times, nanoseconds) in found.items():
            yield compared(kind, name, times, true, float(np.median(nanoseconds)) / 1e3)


def rivals_table(rows: Sequence[Mapping[str, object]]) -> str:
    """Return a row per kind and engine."""
    names = ('late', 'early', 'missed', 'invented')
    return markdown_table(['', 'of', 'motions', *names, 'µs'], [
        [row['kind'], row['engine'], row['motions'], *(row[name] for name in names),
         number(float(row['us']), 2)] for row in rows], words=2)  # type: ignore[arg-type]


def csv_rows(found: Mapping[str, Answers], others: Sequence[Mapping[str, object]],
             ) -> Iterator[dict[str, object]]:
    """Yield a row per kind, then one per kind and engine."""
    for kind, one in found.items():
        late, early, high, doubt = faults(one)
        row: dict[str, object] = {
            'kind': kind, 'engine': 'box_contact', 'motions': len(one['time']),
            'meet': int(np.isfinite(one['time']).sum()), 'late': late, 'early': early,
            'too_high': high, 'in_doubt': doubt, 'largest_error': float(one['error'].max()),
            'distance_ns': float(np.median(one['distance_ns'][one['distance_ns'] > 0.0]))}
        for name in ('time', 'least'):
            cost = Cost.of(one[f'{name}_distances'])
            row |= {f'{name}_distances_mean': cost.mean, f'{name}_distances_p99_9': cost.tail,
                    f'{name}_distances_most': cost.most, f'{name}_by_distance': ratio(one, name)}
        yield row
    for other in others:
        if other['engine'] != 'box_contact':
            yield dict(other)


def missed_goals(found: Mapping[str, Answers]) -> list[str]:
    """Return what is beyond the goals, a line each."""
    lines = [f'{kind}: late {late}, early {early}, too high {high}, in doubt {doubt}'
             for kind, (late, early, high, doubt) in (
                 (kind, faults(one)) for kind, one in found.items())
             if late or early or high or doubt]
    for name, goals in GOALS.items():
        cost = Cost.of(np.concatenate([one[f'{name}_distances'] for one in found.values()]))
        if any(value > goal for value, goal in zip(cost, goals)):
            lines.append(f'distances of {name}: {cost}, more than {Cost(*goals)}')
    lines += [f'{kind}: {ratio(found[kind], "time"):.1f} times a distance, more than 10'
              for kind in EVERYDAY if ratio(found[kind], 'time') > 10.0]
    return lines


def main(args: Sequence[str] | None = None) -> int:
    """Compile, draw, judge, print, write; 1: a wrong answer, 2: the program cannot be made."""
    from tqdm import tqdm

    parser = output.report_parser('motion', __doc__, quick='few motions, to try it out', seed=1,
                                  out='motion.md and motion.csv')
    add_leave_out(parser)
    options = parser.parse_args(args)
    folder = output.results_folder(parser, options)
    require('report')
    count, timed, rivaled = ((QUICK_MOTIONS, QUICK_TIMED, QUICK_RIVALED) if options.quick
                             else (MOTIONS, TIMED, RIVALED))
    found: dict[str, Answers] = {}
    with tempfile.TemporaryDirectory() as made, pinned({usable_cores()[-1]}):
        try:
            program = compiled(Path(made))
            asked, missing = engines(Path(made))
        except RuntimeError as error:
            print(f'motion: {error}', file=sys.stderr)
            return 2
        if not (options.quick or may_miss('motion', missing, options.leave_out)):
            return 2
        for kind in tqdm(KINDS, unit='kind'):
            found[kind] = judged(program, draw(kind, options.seed, count), timed,
                                 rivaled if kind in RIVALED_KINDS else 0)
        others = list(rivals(found, options.seed, rivaled, asked))
    every = np.concatenate([one['distance_ns'] for one in found.values()])
    verdicts = verdicts_table(found)
    output.write_page(
        folder, 'motion', args, machine=output.machine(), count=count, kinds=len(KINDS),
        verdicts=verdicts, costs=costs_table(found), unit=float(np.median(every[every > 0.0])),
        sources=', '.join(rival.source for rival in asked.values()),
        rivals=rivals_table(others), missing=''.join(f'\n\nLeft out: {line}.' for line in missing))
    output.write_csv(folder / 'motion.csv', csv_rows(found, others), about=output.machine())
    print(verdicts, costs_table(found), rivals_table(others), sep='\n\n')
    print(*missed_goals(found), sep='\n')
    return int(any(any(faults(one)) for one in found.values()))


if __name__ == '__main__':
    sys.exit(main())

"""Program `frontier`: speed against error of every model and of other engines.

`python -m box_contact_ros frontier` writes frontier.csv, .md and .png. One run, one pinned core,
garbage collection off. Each contestant is warmed up and timed call by call, the contestants in turn
on every set. Times are read as ratios within the run; the machine is named.

Errors are against the exact model. Those of points are in % of the smaller box's longest edge, per
contact class (`accuracy`); those of normals in degrees. Verdicts that differ are contacts missed
and contacts invented. Engines that return several points: see `engines`.

`--speed` writes the speed gates instead, speed.md and speed.csv: see `speed`.
"""
from __future__ import annotations

import math
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from inspect import getdoc
from pathlib import Path
from typing import Any

import numpy as np

from ... import output
from ...baselines.engines.engine import Engine, installed, ours
from ...core import native
from ...output import markdown_table, number, percentiles
from ...resources import resource_path
from ...scene.pose import degrees_between
from ...scene.pose_sets import (
    CONTAINER,
    SETS,
    Generator,
    Pairs,
    any_pose,
    at_depth,
    log_uniform,
    stacked,
)
from ...solver.arguments import program_parser
from ...solver.models import MODELS
from ...solver.weights_file import load_weights
from ..accuracy import CLASSES, classify
from ..paper.paper_tables import PAPER_NETWORK, PAPER_SOUP
from .speed import pinned, take_turns, usable_cores, write_speed


@dataclass(frozen=True, kw_only=True)
class Plan:
    """How much is judged and timed."""

    batch_pairs: int  # pairs on which models with batches are judged and timed
    single_pairs: int
    """Pairs on which the others are judged, and on which all are timed call by call."""
    seconds: float
    """Time that a contestant has to be asked on a set, once for answers and once for timing."""
    rounds: int
    members: int  # models of a family, at most


FULL = Plan(batch_pairs=20_000, single_pairs=1_000, seconds=1.0, rounds=5, members=99)
QUICK = Plan(batch_pairs=1_000, single_pairs=40, seconds=0.05, rounds=2, members=1)
FEW_PAIRS = 16
"""Pairs of sizes in the timing of a set that has others in every row: each needs a solver."""
LEAST_PAIRS = 10  # pairs judged and timed whatever they take
BATCHES = 3  # batches timed in a round
IN_SHORT = ('exact', 'mlp', 'paper', 'fcl', 'soup-8', 'soup-22', 'MuJoCo mj_geomDistance',
            'MuJoCo mj_collision, mean', 'python-fcl collide, deepest', 'Coal collide',
            'PyBullet getClosestPoints, mean')
"""Rows of the table in the README."""
SHOWN_SETS = ('random cubes', 'containers', 'stacks')  # sets in the picture
PAPER_ERROR = 34.0
"""The paper's MAE of 0.5624 rad in % of an edge. Seen from 1.2 m, the mean distance of a touching
cube's surface, the MAE is a point error of 0.67 m, a third of the edge of 2 m."""
VERDICT = 1e-9
"""Least gap or depth, of the size, at which verdicts and normals are judged. At exact touch both
verdicts are right, and a normal may be any that keeps the boxes apart."""
SMALLEST_ERROR = 1e-2
"""Errors below this [%] are drawn here: those of `exact` are zero, being the reference."""


def apart(rng: np.random.Generator, n: int) -> Pairs:
    """Draw boxes 1e-6 to 0.1 m apart: half containers almost stacked, half cubes in any pose."""
    half = n // 2
    size = np.tile((2.0, 2.0, 2.0), (half, 1))
    cubes = any_pose(rng, size, size, np.full(half, 0.01))
    yard = stacked(rng, CONTAINER, log_uniform(rng, 1e-6, 0.05, n - half),
                   rng.uniform(-0.1, 0.1, n - half), np.full(n - half, 0.01))
    parts = []
    for pairs in (cubes, yard):
        parts.append(at_depth(pairs, -log_uniform(rng, 1e-6, 0.1, len(pairs.pose_a))))
    return Pairs(*(np.concatenate(columns) for columns in zip(*parts)))


ALL_SETS: dict[str, Generator] = {**SETS, 'just apart': apart}


@dataclass(frozen=True, kw_only=True)
class EngineErrors:
    """Answers on a set against the exact ones."""

    points: dict[str, tuple[int, float, float, float]]
    """By class, or 'all': contacts, and the point error's median, p99, worst [%]."""
    normal: tuple[float, float]  # p99 and worst of the normal's error [deg]; NaN: none was judged
    missed: int
    invented: int


@dataclass(frozen=True, kw_only=True)
class FrontierRow:
    """One contestant on one set. NaN: not measured."""

    name: str
    set: str
    judged: int
    calls: int
    single: tuple[float, ...]  # p50, p99, max of a call [ns]
    batch: float  # p50 of a pair in a batch [ns]
    errors: EngineErrors


def contestants(members: int = FULL.members) -> tuple[list[Engine], list[str]]:
    """Return all that can be measured here, and a line about each that cannot."""
    others = {}
    for path in sorted(resource_path('weights').glob('mlp-*.safetensors')):
        if not load_weights(path).card['sizes']:  # those of a scene are for its boxes alone
            others[path.stem.replace('-', ' ')] = str(path)
    found = []
    for entry in MODELS.values():
        with suppress(ImportError):  # of an extra whose libraries `missing` names
            entry.load()
            found += map(ours, entry.reported_names[:members])
    found += [ours('mlp', name, path) for name, path in others.items()]
    rivals, missing = installed()
    return [*found, *rivals], missing


class Trial:
    """A contestant on a set: its answers, judged, and its times, gathered in rounds."""

    def __init__(self, engine: Engine, name: str, pairs: Pairs, plan: Plan) -> None:
        """Ask and judge. ValueError: not for boxes of these sizes."""
        self._name, self._set = engine.name, name
        self._seconds = plan.seconds / plan.rounds
        self._pairs = len(pairs.pose_a)
        self._ask_all = None
        if engine.prepare_batch:
            self._ask_all = engine.prepare_batch(pairs)
            found = self._ask_all()
            answers = found.colliding, found.normal, found.point
        else:
            answers = _answers(engine, pairs.rows(slice(plan.single_pairs)), plan.seconds)
        self._judged = len(answers[0])
        self._errors = judge(pairs.rows(slice(self._judged)), *answers)
        one_size = all((sizes == sizes[0]).all() for sizes in (pairs.size_a, pairs.size_b))
        timed = pairs.rows(slice(plan.single_pairs if one_size else FEW_PAIRS))
        self._calls = engine.prepare(timed)
        self._singles: list[int] = []
        self._batches: list[float] = []

    def time(self) -> None:
        """Time one round: single calls for the time there is, then batches."""
        clock, times = time.perf_counter_ns, self._singles
        for call in self._calls[:LEAST_PAIRS]:
            call()
        until = clock() + int(1e9 * self._seconds)
        least = len(times) + LEAST_PAIRS
        while clock() < until:
            for call in self._calls:
                began = clock()
                call()
                ended = clock()
                times.append(ended - began)
                if ended > until and len(times) >= least:
                    break
        for _ in range(BATCHES if self._ask_all else 0):
            began = clock()
            self._ask_all()
            self._batches.append((clock() - began) / self._pairs)

    def row(self) -> FrontierRow:
        """Return what was found."""
        return FrontierRow(
            name=self._name, set=self._set, judged=self._judged, calls=len(self._singles),
            single=percentiles(self._singles, 50, 99, 100),
            batch=percentiles(self._batches, 50)[0], errors=self._errors)


def judge(pairs: Pairs, colliding: np.ndarray, normals: np.ndarray, points: np.ndarray,
          ) -> EngineErrors:
    """Compare answers (n,), (n, 3), (n, 3) with the exact ones."""
    truth = pairs.contacts()
    both = colliding & truth.colliding
    found: dict[str, tuple[int, float, float, float]] = {}
    if both.any():
        touching = pairs.rows(both)
        errors = 100.0 * np.linalg.norm(points[both] - truth.point[both], axis=1) / touching.edge
        classes = classify(touching)[0]
        parts = {'all': errors, **{c: errors[classes == k] for k, c in enumerate(CLASSES)}}
        found = {label: (len(part), *percentiles(part, 50, 99, 100))
                 for label, part in parts.items() if len(part)}
    clear = np.abs(truth.separation) > VERDICT * pairs.size
    angles = degrees_between(normals[both & clear], truth.normal[both & clear])
    return EngineErrors(points=found, normal=percentiles(angles, 99, 100),
                        missed=int((truth.colliding & ~colliding & clear).sum()),
                        invented=int((colliding & ~truth.colliding & clear).sum()))


def _answers(engine: Engine, pairs: Pairs, seconds: float) -> tuple[np.ndarray, ...]:
    """Return answers (n,), (n, 3), (n, 3) of as many pairs as there is time to ask."""
    nothing = np.full(3, math.nan)
    answers = []
    began = time.monotonic()
    for call in engine.prepare(pairs):
        answers.append(engine.read(call()))
        if time.monotonic() - began > seconds and len(answers) >= LEAST_PAIRS:
            break
    touching, normals, points = zip(*answers)
    return np.array(touching), *(np.array([nothing if one is None else one for one in column])
                                 for column in (normals, points))


def measure_all(found: Sequence[Engine], *, seed: int = 3, plan: Plan = FULL) -> list[FrontierRow]:
    """Return all rows, set by set, the contestants in turn."""
    from tqdm import tqdm

    count, rows = plan.batch_pairs, []
    with tqdm(total=len(ALL_SETS) * len(found) * (1 + plan.rounds), desc='frontier',
              unit='step') as bar:
        for place, (name, make) in enumerate(ALL_SETS.items()):
            pairs = make(np.random.default_rng([seed, place]),
                         count + count // 10 + 20).rows(slice(count))
            trials = []
            for engine in found:
                bar.set_postfix_str(f'{name}, {engine.name}')
                try:
                    trials.append(Trial(engine, name, pairs, plan))
                except ValueError:
                    if engine.any_boxes:
                        raise
                    bar.update(plan.rounds)
                bar.update()
            take_turns([trial.time for trial in trials], plan.rounds, bar.update)
            rows += [trial.row() for trial in trials]
    return rows


def _errors(values: Sequence[float]) -> str:
    return '/'.join(map(number, values))


def in_short(rows: Sequence[FrontierRow]) -> str:
    """Return the table for the README: containers and stacks, what a crane has all day."""
    by = {(row.name, row.set): row for row in rows}
    lines = []
    for name in IN_SHORT:
        row, stack = by.get((name, 'containers')), by.get((name, 'stacks'))
        if row is None:
            continue
        mine = [one for one in rows if one.name == name]
        worst = [one.errors.normal[1] for one in mine if not math.isnan(one.errors.normal[1])]
        lines.append([
            f'`{name}`' if ' ' not in name else name,
            f'{number(row.single[0] / 1e3)} / {number(row.single[1] / 1e3)}', number(row.batch),
            *[number(one.errors.points['all'][2]) if one and one.errors.points else '–'
              for one in (row, stack)],
            number(max(worst, default=math.nan)),
            f'{sum(one.errors.missed for one in mine)} of {sum(one.judged for one in mine):,}',
            sum(one.errors.invented for one in mine)])
    return markdown_table(
        ['', 'single call, p50 / p99 [µs]', 'batch [ns a pair]', 'point error p99, containers [%]',
         'stacks [%]', 'normal, worst [°]', 'missed', 'invented'], lines)


def set_table(rows: Sequence[FrontierRow], name: str) -> str:
    """Return all contestants on one set."""
    labels = ('all', *CLASSES)
    return markdown_table(
        ['', 'call p50 [µs]', 'p99', 'max', 'batch [ns]', 'judged',
         *[f'{label}: p50/p99/worst' for label in labels], 'normal p99/worst [°]', 'missed',
         'invented'],
        [[row.name, *[number(value / 1e3) for value in row.single], number(row.batch),
          f'{row.judged:,}',
          *[_errors(row.errors.points[label][1:]) if label in row.errors.points else '–'
            for label in labels],
          _errors(row.errors.normal), row.errors.missed, row.errors.invented]
         for row in rows if row.set == name])


def honesty(rows: Sequence[FrontierRow]) -> str:
    """Return where the network loses and what it is for, with this run's figures."""
    by = {(row.name, row.set): row for row in rows}
    exact, net = (by[name, 'containers'] for name in ('exact', 'mlp'))
    medians = {name: [by[name, s].batch for s in SETS] for name in ('exact', 'mlp')}
    spread = {name: max(values) / min(values) for name, values in medians.items()}
    return output.page(
        'reports/pages/frontier_honesty', single=net.single[0] / exact.single[0],
        containers=net.batch / exact.batch,
        stacks=by['mlp', 'stacks'].batch / by['exact', 'stacks'].batch, spread=spread,
        paper=by['paper', 'random cubes'].errors.points['all'][1]).rstrip()


def page(rows: Sequence[FrontierRow], missing: Sequence[str], command: str) -> str:
    """Return the Markdown page."""
    return output.page(
        'reports/pages/frontier', command=command, machine=output.machine(native),
        skipped=''.join(f'\n\nLeft out: {line}.' for line in missing), in_short=in_short(rows),
        honesty=honesty(rows), verdict=VERDICT, few_pairs=FEW_PAIRS, sets='\n\n'.join(
            f'### {name.capitalize()}\n\n{getdoc(ALL_SETS[name])}\n\n{set_table(rows, name)}'
            for name in ALL_SETS))


def csv_rows(rows: Sequence[FrontierRow]) -> list[dict[str, object]]:
    """Return a row per contestant, set and class; times in ns, errors in %, normals in degrees."""
    here, found = output.machine(native), []
    for row in rows:
        errors = row.errors
        for label, (count, *point) in (errors.points or {'all': (0, *[math.nan] * 3)}).items():
            found.append({
                'contestant': row.name, 'set': row.set, 'class': label, 'contacts': count,
                **dict(zip(('point_p50', 'point_p99', 'point_worst'), point)),
                **dict(zip(('call_p50', 'call_p99', 'call_max'), map(round, row.single))),
                'calls': row.calls, 'batch_p50': row.batch, 'judged': row.judged,
                'normal_p99': errors.normal[0], 'normal_worst': errors.normal[1],
                'missed': errors.missed, 'invented': errors.invented, **asdict(here)})
    return found


STYLES = {'exact': ('C0', 'o'), 'mlp': ('C1', 'o'), 'paper': ('C2', 'X'),
          'paper-continuous': ('C2', 'P'), 'fcl': ('C3', 's'), 'soup': ('C4', 'D'),
          'MuJoCo mj_geomDistance': ('C5', 'v'), 'MuJoCo mj_collision, deepest': ('C5', '^'),
          'MuJoCo mj_collision, mean': ('C5', 'p'), 'python-fcl collide, deepest': ('C6', 'v'),
          'python-fcl collide, mean': ('C6', 'p'), 'Coal collide': ('C7', 'v'),
          'PyBullet getClosestPoints, deepest': ('C8', 'v'),
          'PyBullet getClosestPoints, mean': ('C8', 'p')}
"""Colour and marker; those of a size or a number of divisions share one."""


def _group(name: str) -> str:
    return name if name in STYLES else name.split('-')[0].split(' ')[0]


def draw(path: Path, rows: Sequence[FrontierRow]) -> None:
    """Draw point error (p99) over time: single calls filled, batches hollow; frontiers."""
    figure, axes = output.subplots(1, len(SHOWN_SETS), (15.0, 6.4), sharey=True)
    shown: dict[str, Any] = {}
    for axis, name in zip(axes.flat, SHOWN_SETS):
        # Before anything is plotted: empty axes cannot be made logarithmic any more.
        axis.set(xscale='log', yscale='log', title=name,
                 xlabel='time [µs]; filled: single call from Python, hollow: a pair in a batch')
        axis.grid(color='0.9', linewidth=0.5)
        shown |= _draw_set(axis, [row for row in rows if row.set == name and row.errors.points])
        if name == 'random cubes':
            shown["the paper's network, 2003"], = axis.plot(
                1e3 * PAPER_NETWORK, PAPER_ERROR, '*', color='black', markersize=11,
                linestyle='none')
            times = [1e3 * PAPER_SOUP[n][0] for n in (min(PAPER_SOUP), max(PAPER_SOUP))]
            shown["the paper's soup, N = 8 to 22, no error given"], = axis.plot(
                times, [SMALLEST_ERROR] * 2, '-', color='black', linewidth=3)
    axes[0, 0].set(ylabel="point error, p99 [% of the smaller box's longest edge]",
                   ylim=(SMALLEST_ERROR / 1.5, 150.0))
    figure.legend(shown.values(), [f'{name} (no error: the reference)' if name == 'exact' else name
                                   for name in shown], loc='outside lower center', ncols=4,
                  fontsize=8)
    figure.suptitle('Speed against error; lines: the frontiers of single calls (solid) and of '
                    'batches (dashed)')
    figure.savefig(path)


def _draw_set(axis: Any, rows: Sequence[FrontierRow]) -> dict[str, Any]:
    """Draw the contestants on one set; returns a handle for each group of the legend."""
    shown, singles, batches = {}, [], []
    ends = [f'soup-{n}' for n in (min(PAPER_SOUP), max(PAPER_SOUP))]
    for row in rows:
        error = max(row.errors.points['all'][2], SMALLEST_ERROR)
        colour, marker = STYLES.get(_group(row.name), ('C9', 'h'))
        single, batch = row.single[0] / 1e3, row.batch / 1e3
        singles.append((single, error))
        shown[_group(row.name)], = axis.plot(single, error, marker, color=colour, markersize=6,
                                             linestyle='none')
        # Networks by their size, soups by their divisions at both ends.
        if row.name in ends or row.name.startswith('mlp '):
            axis.annotate(row.name.replace('mlp ', '').replace('soup-', 'N = '), (single, error),
                          xytext=(5, 3), textcoords='offset points', fontsize=7)
        if not math.isnan(batch):
            batches.append((batch, error))
            axis.plot(batch, error, marker, color=colour, markersize=6, fillstyle='none')
            axis.plot([batch, single], [error, error], color=colour, linewidth=0.5)
    for points, style in ((singles, '-'), (batches, '--')):
        if line := [points[place] for place in output.pareto(points)]:
            axis.step(*zip(*line), style, where='post', color='0.4', linewidth=1.0, zorder=0)
    return shown


def main(args: Sequence[str] | None = None) -> int:
    """Measure, print, write; with `--speed`, 1 if a limit is broken."""
    parser = program_parser('frontier', __doc__, quick='few pairs, to try it out', seed=3,
                            out='frontier.md, .csv, .png')
    parser.add_argument('--speed', action='store_true',
                        help='the speed gates instead: speed.md, .csv')
    cores = usable_cores()
    parser.add_argument('--core', type=int, default=cores[-1], choices=cores, metavar='N',
                        help='core to run on (default: the last one)')
    options = parser.parse_args(args)
    folder = output.results_folder(parser, options)
    command = output.command_line('box_contact_ros frontier', args)
    if options.speed:
        return write_speed(folder, command, core=options.core, quick=options.quick)
    plan = QUICK if options.quick else FULL
    with pinned({options.core}):
        found, missing = contestants(plan.members)
        for line in missing:
            print(f'frontier: left out: {line}', file=sys.stderr)
        rows = measure_all(found, seed=options.seed, plan=plan)
    output.write_csv(folder / 'frontier.csv', csv_rows(rows), digits=4)
    (folder / 'frontier.md').write_text(page(rows, missing, command), encoding='utf-8')
    draw(folder / 'frontier.png', rows)
    print(in_short(rows), honesty(rows), sep='\n\n')
    return 0

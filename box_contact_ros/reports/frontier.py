"""Speed against error: every model and the engines beside them, on the same sets of poses.

`python -m box_contact_ros frontier` writes docs/frontier.csv, .md and .png. One run, one pinned
core, garbage collection off, each contestant warmed up and timed call by call, the contestants in
turn on every set. Times are read as ratios within the run; the machine is named.

Errors are against the exact model: the point's in % of the smaller box's longest edge, per contact
class (`accuracy`), the normal's in degrees, and verdicts that differ: contacts missed, contacts
invented. Where an engine gives several points, see `peers`.
"""
from __future__ import annotations

import argparse
import csv
import gc
import math
import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from inspect import getdoc
from pathlib import Path
from typing import Any

import numpy as np

from ..baselines.engines import Contestant, Ours, installed
from ..core import native
from ..output import add_out, processor, results_folder, versions
from ..resources import resource_path
from ..scene.pose_sets import (
    CONTAINER,
    SETS,
    Generator,
    Pairs,
    any_pose,
    log_uniform,
    pressed,
    stacked,
)
from ..solver.arguments import seed_number
from ..solver.contact_solver import ContactSolver
from ..solver.weights_file import load_weights
from .accuracy import CLASSES, classify, markdown
from .paper_soup_tables import PAPER as PAPER_SOUP
from .paper_soup_tables import PAPER_NETWORK

SOUPS = (8, 10, 12, 14, 16, 18, 20, 22)
"""Divisions of an edge: those of the paper's Table 3."""
BATCH_PAIRS, QUICK_BATCH_PAIRS = 20_000, 1_000
"""Pairs on which models with batches are judged and timed."""
SINGLE_PAIRS, QUICK_SINGLE_PAIRS = 1_000, 40
"""Pairs on which the others are judged, and on which all are timed call by call."""
FEW_PAIRS = 16
"""Pairs of sizes in the timing of a set that has others in every row: each needs a solver."""
SECONDS, QUICK_SECONDS = 1.0, 0.05
"""Time that a contestant has to be asked on a set, once for answers and once for timing."""
ROUNDS, QUICK_ROUNDS = 5, 2
"""Rounds in which the contestants are timed in turn, so that a slow moment hits all of them."""
LEAST_PAIRS = 10
"""Pairs judged and timed whatever they take."""
BATCHES = 3
"""Batches timed in a round."""
BATCH_MODELS = ('exact', 'mlp', 'paper', 'paper-continuous')
"""Models whose batch is more than a loop."""
DEGREES = 180.0 / math.pi
IN_SHORT = ('exact', 'mlp', 'paper', 'fcl', 'soup-8', 'soup-22', 'MuJoCo mj_geomDistance',
            'MuJoCo mj_collision, mean', 'python-fcl collide, deepest', 'Coal collide',
            'PyBullet getClosestPoints, mean')
"""Rows of the table in the README."""
SHOWN_SETS = ('random cubes', 'containers', 'stacks')
"""Sets in the picture."""
PAPER_ERROR = 34.0
"""The paper's MAE of 0.5624 rad in % of an edge: seen from 1.2 m, the mean distance of a touching
cube's surface, it is a point error of 0.67 m, a third of the edge of 2 m."""
VERDICT = 1e-9
"""Gap or depth, of the size, from which on verdicts and normals are judged: at exact touch both
verdicts are right, and a normal may be any that keeps the boxes apart."""
SMALLEST_ERROR = 1e-2
"""Errors below this [%] are drawn here: those of `exact` are zero, being the reference."""


def apart(rng: np.random.Generator, n: int) -> Pairs:
    """Boxes 1e-6 to 0.1 m apart: half containers almost stacked, half cubes in any pose."""
    half = n // 2
    size = np.tile((2.0, 2.0, 2.0), (half, 1))
    cubes = any_pose(rng, size, size, np.full(half, 0.01))
    yard = stacked(rng, CONTAINER, log_uniform(rng, 1e-6, 0.05, n - half),
                   rng.uniform(-0.1, 0.1, n - half), np.full(n - half, 0.01))
    parts = []
    for pairs in (cubes, yard):
        parts.append(pressed(pairs, -log_uniform(rng, 1e-6, 0.1, len(pairs.pose_a))))
    return Pairs(*(np.concatenate(columns) for columns in zip(*parts)))


ALL_SETS: dict[str, Generator] = {**SETS, 'just apart': apart}


@dataclass
class Cell:
    """One contestant on one set. Times [ns], errors [%], normals [deg]; NaN: not measured."""

    name: str
    set: str
    judged: int
    calls: int
    single: tuple[float, float, float]
    """p50, p99, max of a call."""
    batch: float
    """p50 of a pair in a batch."""
    points: dict[str, tuple[int, float, float, float]]
    """By class, or 'all': contacts, and the point error's median, p99, worst."""
    normal: tuple[float, float]
    """p99 and worst."""
    missed: int
    invented: int


# --- measuring ------------------------------------------------------------------------------------


def contestants(quick: bool = False) -> tuple[list[Contestant], list[str]]:
    """All that can be measured here, and a line about each that cannot."""
    found: list[Contestant] = [Ours('exact'), Ours('mlp')]
    sizes = {}
    for path in resource_path('weights').glob('mlp-*.safetensors'):
        card = load_weights(path).card
        if not card['sizes']:  # those of a scene are for its boxes alone
            sizes[tuple(card['architecture'][1:-1])] = str(path)
    found += [Ours('mlp', f'mlp {"-".join(map(str, units))}', path)
              for units, path in sorted(sizes.items())]
    found += [Ours('paper'), Ours('paper-continuous')]
    peers, missing = installed()
    try:
        import fcl  # noqa: F401
        found.append(Ours('fcl'))
        found += [Ours(f'soup-{n}') for n in (SOUPS[:1] if quick else SOUPS)]
    except ImportError:
        pass  # `installed` says so
    return [*found, *peers], missing


class Subject:
    """A contestant on a set: its answers, judged, and its times, gathered in rounds."""

    def __init__(self, contestant: Contestant, name: str, pairs: Pairs, quick: bool) -> None:
        """Ask and judge. ValueError: not for boxes of these sizes."""
        self._contestant, self._name = contestant, name
        self._seconds = (QUICK_SECONDS if quick else SECONDS) / (QUICK_ROUNDS if quick else ROUNDS)
        self._pairs = pairs
        few = QUICK_SINGLE_PAIRS if quick else SINGLE_PAIRS
        self._batched = isinstance(contestant, Ours) and contestant.model in BATCH_MODELS
        if self._batched:
            self._solver = contestant.solver(pairs.size_a[0], pairs.size_b[0])
            answers = self._batch()
        else:
            answers = _answers(contestant, _head(pairs, few), QUICK_SECONDS if quick else SECONDS)
        self._judged = len(answers[0])
        self._cell = judge(_head(pairs, self._judged), *answers)
        one_size = all((sizes == sizes[0]).all() for sizes in (pairs.size_a, pairs.size_b))
        self._prepared = contestant.prepare(_head(pairs, few if one_size else FEW_PAIRS))
        self._singles: list[int] = []
        self._batches: list[float] = []

    def _batch(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        a, b, size_a, size_b = self._pairs
        found = self._solver.batch(a, b, size_a=size_a, size_b=size_b)
        return found.colliding, found.normal, found.point

    def time(self) -> None:
        """One round; garbage collection is off."""
        ask, clock, times = self._contestant.ask, time.perf_counter_ns, self._singles
        for arguments in self._prepared[:LEAST_PAIRS]:
            ask(*arguments)
        until = clock() + int(1e9 * self._seconds)
        least = len(times) + LEAST_PAIRS
        while clock() < until:
            for arguments in self._prepared:
                began = clock()
                ask(*arguments)
                ended = clock()
                times.append(ended - began)
                if ended > until and len(times) >= least:
                    break
        for _ in range(BATCHES if self._batched else 0):
            began = clock()
            self._batch()
            self._batches.append((clock() - began) / len(self._pairs.pose_a))

    def cell(self) -> Cell:
        """What was found."""
        p50, p99, most = np.quantile(self._singles, (0.5, 0.99, 1.0))
        batch = float(np.median(self._batches)) if self._batches else math.nan
        return Cell(self._contestant.name, self._name, self._judged, len(self._singles),
                    (float(p50), float(p99), float(most)), batch, *self._cell)


def judge(pairs: Pairs, colliding: np.ndarray, normals: np.ndarray, points: np.ndarray,
          ) -> tuple[dict[str, tuple[int, float, float, float]], tuple[float, float], int, int]:
    """Answers (n,), (n, 3), (n, 3) against the exact ones: the last four fields of a `Cell`."""
    truth = ContactSolver((1, 1, 1), (1, 1, 1), model='exact').batch(
        pairs.pose_a, pairs.pose_b, size_a=pairs.size_a, size_b=pairs.size_b)
    both = colliding & truth.colliding
    found: dict[str, tuple[int, float, float, float]] = {}
    normal = (math.nan, math.nan)
    if both.any():
        touching = Pairs(*(part[both] for part in pairs))
        edge = np.minimum(touching.size_a.max(axis=1), touching.size_b.max(axis=1))
        errors = 100.0 * np.linalg.norm(points[both] - truth.point[both], axis=1) / edge
        classes = classify(touching)[0]
        for label, part in (('all', errors), *((c, errors[classes == k])
                                               for k, c in enumerate(CLASSES))):
            if len(part):
                p50, p99, worst = np.quantile(part, (0.5, 0.99, 1.0))
                found[label] = (len(part), float(p50), float(p99), float(worst))
    size = np.maximum(pairs.size_a.max(axis=1), pairs.size_b.max(axis=1))
    clear = np.abs(truth.separation) > VERDICT * size
    if (both & clear).any():
        one, other = normals[both & clear], truth.normal[both & clear]
        # By the chord: the cosine of a small angle is 1 to the last digit.
        angles = 2.0 * DEGREES * np.arcsin(np.clip(
            0.5 * np.linalg.norm(one - other, axis=1), 0.0, 1.0))
        normal = (float(np.quantile(angles, 0.99)), float(angles.max()))
    return (found, normal, int((truth.colliding & ~colliding & clear).sum()),
            int((colliding & ~truth.colliding & clear).sum()))


def _head(pairs: Pairs, count: int) -> Pairs:
    return Pairs(*(part[:count] for part in pairs))


def _answers(contestant: Contestant, pairs: Pairs, seconds: float) -> tuple[np.ndarray, ...]:
    """Answers (n,), (n, 3), (n, 3) of as many pairs as there is time to ask."""
    colliding, normals, points = [], [], []
    nothing = np.full(3, math.nan)
    prepared = contestant.prepare(pairs)
    began = time.monotonic()
    for arguments in prepared:
        answer = contestant.read(contestant.ask(*arguments))
        colliding.append(answer.touching)
        normals.append(nothing if answer.normal is None else answer.normal)
        points.append(nothing if answer.point is None else answer.point)
        if time.monotonic() - began > seconds and len(points) >= LEAST_PAIRS:
            break
    return np.array(colliding), np.array(normals), np.array(points)


def measure_all(found: Sequence[Contestant], *, seed: int = 3, quick: bool = False) -> list[Cell]:
    """All cells, set by set, the contestants in turn."""
    from tqdm import tqdm

    count, rounds = (QUICK_BATCH_PAIRS, QUICK_ROUNDS) if quick else (BATCH_PAIRS, ROUNDS)
    cells = []
    with tqdm(total=len(ALL_SETS) * len(found) * (1 + rounds), desc='frontier', unit='step') as bar:
        for number, (name, make) in enumerate(ALL_SETS.items()):
            drawn = make(np.random.default_rng([seed, number]), count + count // 10 + 20)
            pairs = Pairs(*(np.ascontiguousarray(part[:count]) for part in drawn))
            subjects = []
            for contestant in found:
                bar.set_postfix_str(f'{name}, {contestant.name}')
                try:
                    subjects.append(Subject(contestant, name, pairs, quick))
                except ValueError:
                    if not (isinstance(contestant, Ours) and contestant.model.startswith('paper')):
                        raise
                    bar.update(rounds)  # two equal boxes of few sizes
                bar.update()
            gc.collect()
            gc.disable()
            try:
                for _ in range(rounds):
                    for subject in subjects:
                        subject.time()
                        bar.update()
            finally:
                gc.enable()
            cells += [subject.cell() for subject in subjects]
    return cells


# --- the report -----------------------------------------------------------------------------------


def _number(value: float, digits: int = 3) -> str:
    """A figure with so many digits, never in powers of ten."""
    if math.isnan(value):
        return '–'
    if value == 0.0:
        return '0'
    if value < 10.0 ** -digits:
        return f'<{10.0 ** -digits:g}'
    return f'{value:.{max(0, digits - 1 - math.floor(math.log10(value)))}f}' if value < 1e3 else (
        f'{value:,.0f}')


def in_short(cells: Sequence[Cell]) -> str:
    """The table for the README: containers and stacks, what a crane has all day."""
    by = {(cell.name, cell.set): cell for cell in cells}
    rows = [['', 'single call, p50 / p99 [µs]', 'batch [ns a pair]',
             'point error p99, containers [%]', 'stacks [%]', 'normal, worst [°]',
             'missed', 'invented']]
    for name in IN_SHORT:
        cell = by.get((name, 'containers'))
        if cell is None:
            continue
        stack, mine = by.get((name, 'stacks')), [c for c in cells if c.name == name]
        worst = [c.normal[1] for c in mine if not math.isnan(c.normal[1])]
        rows.append([
            f'`{name}`' if ' ' not in name else name,
            f'{_number(cell.single[0] / 1e3)} / {_number(cell.single[1] / 1e3)}',
            _number(cell.batch),
            *[_number(c.points['all'][2]) if c and c.points else '–' for c in (cell, stack)],
            _number(max(worst)) if worst else '–',
            f'{sum(c.missed for c in mine)} of {sum(c.judged for c in mine):,}',
            str(sum(c.invented for c in mine))])
    return markdown(rows)


def set_table(cells: Sequence[Cell], name: str) -> str:
    """All contestants on one set."""
    rows = [['', 'call p50 [µs]', 'p99', 'max', 'batch [ns]', 'judged',
             *[f'{label}: p50/p99/worst' for label in ('all', *CLASSES)],
             'normal p99/worst [°]', 'missed', 'invented']]
    for cell in cells:
        if cell.set == name:
            rows.append([
                cell.name, *[_number(value / 1e3) for value in cell.single], _number(cell.batch),
                f'{cell.judged:,}',
                *['/'.join(_number(v) for v in cell.points[label][1:]) if label in cell.points
                  else '–' for label in ('all', *CLASSES)],
                '/'.join(_number(v) for v in cell.normal), str(cell.missed), str(cell.invented)])
    return markdown(rows)


def honesty(cells: Sequence[Cell]) -> str:
    """Where the network loses and what it is for, with this run's figures."""
    by = {(cell.name, cell.set): cell for cell in cells}
    exact, net = (by[name, 'containers'] for name in ('exact', 'mlp'))
    medians = {name: [by[name, s].batch for s in SETS] for name in ('exact', 'mlp')}
    spread = {name: max(values) / min(values) for name, values in medians.items()}
    lines = [
        f'- **In single calls the network loses.** `exact` takes '
        f'{exact.single[0] / net.single[0]:.2f} of the time of `mlp`, and has no error. From '
        'Python most of either is the call itself.',
        f'- **What it is for is batches and a constant cost.** A pair in a batch takes '
        f'{net.batch / exact.batch:.2f} of the time of `exact` on containers, '
        f'{by["mlp", "stacks"].batch / by["exact", "stacks"].batch:.2f} on stacks; from the '
        f'cheapest set to the dearest its cost grows by a factor of {spread["mlp"]:.2f}, '
        f'that of `exact` by {spread["exact"]:.2f}.',
        '- **What neither shares with the engines is the centroid.** The error of an engine is '
        'mostly not a fault: it gives a deepest point or the corners of a patch, which is another '
        'question answered. It is the distance that a user who needs one point for the whole patch '
        'is off by.']
    paper = by.get(('paper', 'random cubes'))
    if paper and paper.points:
        lines.append(
            f"- **The paper's own network is not a contact model.** Its median point error is "
            f'{paper.points["all"][1]:.0f} % of the edge on random cubes, because a smooth network '
            'answers with something between both sides of a jump; its time is as constant as the '
            "mlp's.")
    return '\n'.join(lines)


def page(cells: Sequence[Cell], missing: Sequence[str], command: str) -> str:
    """The Markdown page."""
    skipped = ''.join(f'\n\nLeft out: {line}.' for line in missing)
    return f"""# Speed against error

Made by `{command}` on one core of {processor()}, {native.instruction_set}; {versions()}.
Times are from two poses to a result in Python; a call's includes the two readings of the clock
(about 0.05 µs). Ratios within this run are what to trust.{skipped}

![Point error over time, one panel a set](frontier.png)

## In short

Times are those on containers with sway; normals and verdicts are over all sets.

{in_short(cells)}

{honesty(cells)}

## All sets

Point errors in % of the smaller box's longest edge, as median/p99/worst, per contact class
([accuracy](accuracy.md)). *Missed*: contacts of `exact` that were not reported; *invented*: the
reverse; these and normals only where the gap or depth is more than {VERDICT:g} of the size, as at
exact touch either verdict is right, and many normals. *Judged*: pairs asked; models with batches
are asked for more. Random sizes are timed on {FEW_PAIRS} pairs of sizes. Engines that give several
points are entered twice: their deepest, and the mean. `mlp N` are networks of N hidden units,
trained for 60,000 steps.

""" + '\n\n'.join(f'### {name.capitalize()}\n\n{getdoc(ALL_SETS[name])}\n\n'
                  f'{set_table(cells, name)}' for name in ALL_SETS) + '\n'


def write_csv(path: Path, cells: Sequence[Cell]) -> None:
    """A row per cell and contact class; times in ns, errors in %, normals in degrees."""
    with path.open('w', newline='') as file:
        writer = csv.writer(file, lineterminator='\n')
        writer.writerow(['contestant', 'set', 'class', 'contacts', 'point_p50', 'point_p99',
                         'point_worst', 'call_p50', 'call_p99', 'call_max', 'calls', 'batch_p50',
                         'judged', 'normal_p99', 'normal_worst', 'missed', 'invented',
                         'processor'])
        for cell in cells:
            shared = [*(f'{v:.0f}' for v in cell.single), cell.calls, f'{cell.batch:.1f}',
                      cell.judged, *(f'{v:.4g}' for v in cell.normal), cell.missed, cell.invented,
                      processor()]
            for label, (count, *errors) in (cell.points or {'all': (0, *[math.nan] * 3)}).items():
                writer.writerow([cell.name, cell.set, label, count,
                                 *(f'{v:.4g}' for v in errors), *shared])


def pareto(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Those (time, error) than which none is both faster and better, by time."""
    found: list[tuple[float, float]] = []
    for when, error in sorted(points):
        if not found or error < found[-1][1]:
            found.append((when, error))
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


def draw(path: Path, cells: Sequence[Cell]) -> None:
    """Point error (p99) over time, log-log: single calls filled, batches hollow; frontiers."""
    import matplotlib

    matplotlib.use('Agg')
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(1, len(SHOWN_SETS), figsize=(15.0, 6.4), sharey=True,
                                constrained_layout=True)
    shown: dict[str, Any] = {}
    for axis, name in zip(axes, SHOWN_SETS):
        singles, batches = [], []
        for cell in cells:
            if cell.set != name or not cell.points:
                continue
            error = max(cell.points['all'][2], SMALLEST_ERROR)
            colour, marker = STYLES[_group(cell.name)]
            one = (cell.single[0] / 1e3, error)
            singles.append(one)
            shown[_group(cell.name)], = axis.plot(*one, marker, color=colour, markersize=6,
                                                  linestyle='none')
            _label(axis, cell.name, one)
            if not math.isnan(cell.batch):
                many = (cell.batch / 1e3, error)
                batches.append(many)
                axis.plot(*many, marker, color=colour, markersize=6, fillstyle='none')
                axis.plot([many[0], one[0]], [error, error], color=colour, linewidth=0.5)
        for points, style in ((singles, '-'), (batches, '--')):
            line = pareto(points)
            if line:
                axis.step([x for x, _ in line], [y for _, y in line], style, where='post',
                          color='0.4', linewidth=1.0, zorder=0)
        if name == 'random cubes':
            shown["the paper's network, 2003"], = axis.plot(
                1e3 * PAPER_NETWORK, PAPER_ERROR, '*', color='black', markersize=11,
                linestyle='none')
            times = [1e3 * PAPER_SOUP[n][0] for n in (min(PAPER_SOUP), max(PAPER_SOUP))]
            shown["the paper's soup, N = 8 to 22, no error given"], = axis.plot(
                times, [SMALLEST_ERROR] * 2, '-', color='black', linewidth=3)
        axis.set_xscale('log')
        axis.set_yscale('log')
        axis.set_title(name)
        axis.set_xlabel('time [µs]; filled: single call from Python, hollow: a pair in a batch')
        axis.grid(color='0.9', linewidth=0.5)
    axes[0].set_ylabel("point error, p99 [% of the smaller box's longest edge]")
    axes[0].set_ylim(SMALLEST_ERROR / 1.5, 150.0)
    figure.legend(shown.values(), [f'{name} (no error: the reference)' if name == 'exact' else name
                                   for name in shown], loc='outside lower center', ncols=4,
                  fontsize=8)
    figure.suptitle('Speed against error; lines: the frontiers of single calls (solid) and of '
                    'batches (dashed)')
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _label(axis: Any, text: str, at: tuple[float, float]) -> None:
    """Networks by their size, soups by their divisions at both ends."""
    if text in (f'soup-{SOUPS[0]}', f'soup-{SOUPS[-1]}') or text.startswith('mlp '):
        axis.annotate(text.replace('mlp ', '').replace('soup-', 'N = '), at, xytext=(5, 3),
                      textcoords='offset points', fontsize=7)


def main(args: Sequence[str] | None = None) -> int:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(prog='frontier', description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    add_out(parser, 'frontier.md, .csv, .png')
    parser.add_argument('--quick', action='store_true', help='few pairs, to try it out')
    parser.add_argument('--seed', type=seed_number, default=3,
                        help='of the sets (default: %(default)s)')
    parser.add_argument('--core', type=int, help='core to run on (default: the last one)')
    options = parser.parse_args(args)
    options.out = results_folder(parser, options)
    restore = _pinned(options.core, parser.error)
    try:
        found, missing = contestants(options.quick)
        for line in missing:
            print(f'frontier: left out: {line}', file=sys.stderr)
        cells = measure_all(found, seed=options.seed, quick=options.quick)
    finally:
        restore()
    given = sys.argv[1:] if args is None else args
    write_csv(options.out / 'frontier.csv', cells)
    (options.out / 'frontier.md').write_text(
        page(cells, missing, ' '.join(['python -m box_contact_ros frontier', *given])),
        encoding='utf-8')
    draw(options.out / 'frontier.png', cells)
    print(in_short(cells), honesty(cells), sep='\n\n')
    return 0


def _pinned(core: int | None, error: Callable[[str], Any]) -> Callable[[], None]:
    """Run on one core; returns what undoes it."""
    if not hasattr(os, 'sched_setaffinity'):
        return lambda: None
    before = os.sched_getaffinity(0)
    if core is not None and core not in before:
        error(f'--core {core} is not one of {sorted(before)}')
    os.sched_setaffinity(0, {max(before) if core is None else core})
    return lambda: os.sched_setaffinity(0, before)


if __name__ == '__main__':
    sys.exit(main())

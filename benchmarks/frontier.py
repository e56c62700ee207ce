# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Program `frontier`: speed against error of every model and of other engines, in one run.

`python -m benchmarks.frontier` writes frontier.csv, .md and .png. It runs on one pinned core, with
garbage collection off. Each contestant is warmed up and timed call by call. All of them on all sets
take turns. The models in C++ run once more with each other instruction set of the machine, in a
subprocess. Times are read as ratios within a run; the machine is named.

Errors are against model `exact`. Those of points are in % of the smaller box's longest edge, per
contact class; those of normals in degrees. Verdicts that differ are contacts missed and contacts
invented. An engine that returns several points is entered with the best of the ways to make one of
them.
"""
from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from box_contact_ros.core import instruction_sets, native
from box_contact_ros.extras import require

from . import output, settled
from .accuracy import Summary
from .contestant import (
    CORE_MODELS,
    MODELS,
    Contestant,
    add_models,
    in_subprocess,
    other_networks,
    ours,
    packages_of,
)
from .engines import add_leave_out, installed, may_miss
from .output import markdown_table, number
from .pose_sets import SETS, apart, landings, parcels
from .timing import by_round, pinned, usable_cores
from .trials import (
    FEW_PAIRS,
    FULL,
    LONGEST_RUN,
    QUICK,
    VERDICT,
    FrontierRow,
    Plan,
    measure_all,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TIMED_SETS = {**SETS, 'just apart': apart, 'landings': landings, 'parcels': parcels,
              'settled': settled.at_rest, 'settled cubes': settled.cubes_at_rest,
              'as placed': settled.as_placed}
IN_SHORT = ('exact', 'mlp', 'paper', 'paper-at-rest', 'soup-1', 'soup-8', 'soup-22')
"""Models in the short table; other sizes of `mlp` are in that of `traded`."""
QUICK_MODELS = ('exact', 'mlp', 'paper', 'soup-1', 'soup-8')
ODD_NORMAL = 10.0  # error of an engine's normal that is explained [deg]

SIZES = ('mlp-16-16', 'mlp', 'mlp-32-32')
"""The network of `mlp` by size; `mlp` itself has 24-24."""
CALLS = {'exact': ('exact', 'exact', 0), 'mlp': ('mlp', 'mlp', 12),
         'paper': ('paper', 'paper', 10), 'soup-8': ('polygon soup', 'soup', 0),
         'MuJoCo mj_collision': ('MuJoCo', 'MuJoCo', -13),
         'PyBullet getContactPoints': ('Bullet', 'Bullet', 0),
         'Coal ComputeCollision, contact patch': ('Coal', 'Coal', 9),
         'Drake hydroelastic': ('Drake', 'Drake', 0)}
BATCHES = {'exact': ('exact', 'exact', 0), 'mlp-16-16': ('mlp, 16-16', 'mlp', 2),
           'mlp': ('24-24', 'mlp', -4), 'mlp-32-32': ('32-32', 'mlp', -10),
           'paper': ('paper', 'paper', 0)}
"""Contestant: its name in a picture, whose colour it has, and how far it is raised [pt]."""
PANELS = {'Goods at rest': ('settled', 'settled cubes'),
          'A 12 m container on another, swaying': ('containers',)}
"""Titles, and the sets that are drawn: of each contestant the first that it answers."""


class Picture(NamedTuple):
    """A picture of errors over one time of the CSV."""

    column: str
    title: str
    label: str
    unit: float  # by which times are multiplied
    limits: tuple[float, float]  # names stand on the right of their points
    shown: dict[str, tuple[str, str, int]]


PICTURES = {
    'frontier': Picture('call_p50',
                        'A call from Python: distance from the point of exact, the reference',
                        'time of a call from Python [µs]', 1e-3, (0.1, 1e5), CALLS),
    'frontier_batches': Picture('batch_p50', 'A batch: the network saves time, and errs',
                                'time of a pair in a batch [ns]', 1.0, (40.0, 1e3), BATCHES)}
ERRORS = (1e-1, 3e2)
"""Errors that are drawn to scale [%]; 0 has a band of its own below."""


def measure_core(seed: int, plan: Plan) -> list[FrontierRow]:
    """Measure the models in C++, by the instruction set of this process."""
    return measure_all(list(map(ours, CORE_MODELS)), TIMED_SETS, seed=seed, plan=plan)


def by_exact(row: FrontierRow, rows: Iterable[FrontierRow]) -> list[float]:
    """Return a call and a pair in a batch relative to `exact`: medians of the rounds' ratios."""
    exact = next(each for each in rows if (each.name, each.set, each.instruction_set)
                 == ('exact', row.set, row.instruction_set))
    return by_round(row.rounds, exact.rounds).tolist()


def odd_answers(rows: Sequence[FrontierRow], engines: Iterable[Contestant]) -> Iterator[str]:
    """Yield a line per cause, with what is odd in the answers of other engines."""
    def oddness(row: FrontierRow, what: str) -> float:
        errors = row.errors
        return {'missed': errors.missed, 'invented': errors.invented,
                'normal': 0.0 if math.isnan(errors.normal[1]) else errors.normal[1]}[what]

    by_cause: dict[str, list[str]] = {}
    for engine in engines:
        mine = [row for row in rows if row.name == engine.name]
        for what in ('missed', 'invented', 'normal'):
            worst = max(mine, key=lambda row: oddness(row, what))
            amount = oddness(worst, what)
            if amount > (ODD_NORMAL if what == 'normal' else 0.0):
                by_cause.setdefault(engine.causes.get(what) or 'Cause unknown.', []).append(
                    f'{engine.name}, {worst.set}: {what} {amount:.3g}'
                    f'{"°" if what == "normal" else ""}')
    for cause, found in by_cause.items():
        yield f'{cause} {"; ".join(found)}.'


def in_short(rows: Sequence[FrontierRow], engines: Iterable[Contestant]) -> str:
    """Return the short table: containers and goods at rest, what a crane has all day."""
    rivals, lines = [engine.name for engine in engines], []
    for name in (*IN_SHORT, *rivals):
        for instruction_set in dict.fromkeys(row.instruction_set for row in rows
                                             if row.name == name):
            mine = {row.set: row for row in rows
                    if (row.name, row.instruction_set) == (name, instruction_set)}
            if 'containers' not in mine:
                continue
            shown = mine['containers']
            normals = [row.errors.normal[1] for row in mine.values()
                       if not math.isnan(row.errors.normal[1])]
            lines.append([
                f'`{name}`, {instruction_set}' if name in CORE_MODELS else name,
                f'{number(shown.single[0] / 1e3)}, {number(shown.single[1] / 1e3)}',
                number(shown.batch), shown.best if name in rivals else '–',
                *[_off(mine.get(of_set), shown.best)
                  for of_set in ('containers', 'settled', 'as placed')],
                number(max(normals, default=math.nan)),
                f'{sum(row.errors.missed for row in mine.values())} of '
                f'{sum(row.judged for row in mine.values()):,}',
                sum(row.errors.invented for row in mine.values())])
    return markdown_table(
        ['', 'single call, p50, p99 [µs]', 'batch [ns per pair]', 'best point',
         'point error p99, answered: containers [%]', 'settled [%]', 'as placed [%]',
         'normal, worst [°]', 'missed', 'invented'], lines)


def _off(row: FrontierRow | None, point: str) -> str:
    """Return the p99 error of a point, and the share of pairs that have one, as all should [%]."""
    found = row.choices[point].points.get('all') if row else None
    return f'{number(found.p99)}, {number(100.0 * found.pairs / row.judged)}' if found else '–'


def calls_table(engines: Iterable[Contestant]) -> str:
    """Return what is called of other engines, and what they return."""
    return markdown_table(['', 'call', 'returns', 'one point by'], [
        [engine.name, f'`{engine.call}`',
         engine.returns + ('' if engine.patch == Contestant.patch else f', {engine.patch}'),
         'any' if engine.choices == Contestant.choices else ', '.join(engine.choices)]
        for engine in engines], words=4)


def write_page(folder: Path, args: Sequence[str] | None, rows: Sequence[FrontierRow],
               models: Sequence[Contestant], engines: Sequence[Contestant],
               missing: Sequence[str], plan: Plan) -> None:
    """Write the Markdown page."""
    by = {(row.name, row.set): row for row in rows
          if row.instruction_set == native.instruction_set}
    output.write_page(
        folder, 'frontier', args,
        machine=output.machine(packages_of([*models, *engines])),
        skipped=''.join(f'\n\nLeft out: {line}.' for line in missing),
        in_short=in_short(rows, engines), odd='\n'.join(
            f'{place}. {line}' for place, line in enumerate(odd_answers(rows, engines), start=1)
        ) or 'None.',
        traded=traded(rows),
        paper=by['paper', 'random cubes'].errors.points['all'].p50,
        verdict=VERDICT, few_pairs=FEW_PAIRS, timed_pairs=plan.timed_pairs,
        calls=calls_table(engines))


def csv_rows(rows: Sequence[FrontierRow], contestants: Sequence[Contestant],
             ) -> Iterator[dict[str, object]]:
    """Yield a row per contestant, set, choice and class; times [ns], errors [%], normals [deg]."""
    packages = {engine.name: engine.package for engine in contestants}
    here = {package: asdict(output.machine(['numpy', *filter(None, [package])]))
            for package in {*packages.values()}}
    for row in rows:
        for choice, errors in row.choices.items():
            nothing = {'all': Summary(0, *[math.nan] * 4)}
            for label, point in (errors.points or nothing).items():
                yield {
                    'contestant': row.name, 'set': row.set, 'point': choice, 'class': label,
                    'contacts': point.pairs, 'point_p50': point.p50, 'point_p99': point.p99,
                    'point_worst': point.worst,
                    **dict(zip(('call_p50', 'call_p99', 'call_max'), row.single)),
                    'calls': row.calls, 'batch_p50': row.batch,
                    **dict(zip(('call_by_exact', 'batch_by_exact'), by_exact(row, rows))),
                    'judged': row.judged, 'normal_p99': errors.normal[0],
                    'normal_worst': errors.normal[1], 'missed': errors.missed,
                    'invented': errors.invented, **here[packages[row.name]],
                    'instruction_set': row.instruction_set}


def shown_points(table: Path, of_sets: Sequence[str], picture: Picture,
                 ) -> dict[str, tuple[float, float]]:
    """Return a time of the CSV and the p99 point error [%] by contestant.

    An engine with several ways to make one point has the best of them. Models have the fastest
    instruction set, whose rows come first. What has no contact of a set has no error there.
    """
    points: dict[str, tuple[float, float]] = {}
    for of_set in of_sets:
        here: dict[str, tuple[float, float]] = {}
        for row in output.read_csv(table):
            name, time = row['contestant'], float(row[picture.column] or 'nan')
            if ((row['set'], row['class']) == (of_set, 'all') and name in picture.shown
                    and time > 0.0 and row['point_p99']):
                before = here.get(name, (time, math.inf))
                here[name] = before[0], min(before[1], float(row['point_p99']))
        points = here | points
    return points


def draw(folder: Path, table: Path, models: Sequence[str] = ()) -> None:
    """Draw the pictures from the CSV, and more models that were asked for; tell what is absent."""
    measured = {row['contestant'] for row in output.read_csv(table)}
    for name, picture in PICTURES.items():
        more = {model: (model, 'new', 0) for model in models}
        picture = picture._replace(shown=picture.shown | more)
        absent = sorted(picture.shown.keys() - measured)
        if absent:
            print(f'frontier: not in {name}.png, as not measured: {", ".join(absent)}',
                  file=sys.stderr)
        figure, axes = output.subplots(1, len(PANELS), (10.5, 4.6), sharey=True)
        figure.suptitle(picture.title, fontsize=13)
        for axis, (title, of_sets) in zip(axes[0], PANELS.items()):
            _draw_panel(axis, shown_points(table, of_sets, picture), picture)
            axis.set(xlabel=picture.label, title=title)
        axes[0, 0].set_ylabel("point error, p99\n[% of the smaller box's longest edge]")
        figure.savefig(folder / f'{name}.png', metadata={'Software': None})


def _draw_panel(axis: Axes, found: Mapping[str, tuple[float, float]], picture: Picture) -> None:
    height = output.log_errors(axis, *ERRORS)
    axis.set_xscale('log')
    axis.xaxis.set_major_formatter('{x:,g}')
    axis.xaxis.set_minor_formatter('')
    axis.set_xlim(*picture.limits)
    sizes = [found[name] for name in SIZES if name in found and name in picture.shown]
    axis.plot([picture.unit * time for time, _ in sizes], [height(error) for _, error in sizes],
              color=output.COLOURS['mlp'], linewidth=1)
    for name, (time, error) in found.items():
        shown, whose, rise = picture.shown[name]
        colour = output.COLOURS[whose]
        is_ours = name == 'exact'
        axis.plot(picture.unit * time, height(error), '*' if is_ours else 'o', color=colour,
                  markersize=16 if is_ours else 7)
        axis.annotate(shown, (picture.unit * time, height(error)), xytext=(9, rise), va='center',
                      textcoords='offset points', color=colour, fontsize=11 if is_ours else 10,
                      weight='bold' if is_ours else 'normal')


def traded(rows: Sequence[FrontierRow]) -> str:
    """Return what `mlp` costs and how far it is off, by size: at rest, swaying and deep."""
    shown, lines = ('settled', 'containers', 'deep'), []
    for name in ('exact', *SIZES):
        line: list[object] = [f'`{name}`']
        for of_set in shown:
            row = next(row for row in rows if (row.name, row.set, row.instruction_set)
                       == (name, of_set, native.instruction_set))
            call, batch = by_exact(row, rows)
            point = row.errors.points['all']
            line += [f'{call:.2f}', f'{batch:.2f}', number(point.p50), number(point.p99)]
        lines.append(line)
    return markdown_table(['', *(f'{of_set}: {what}' for of_set in shown
                                 for what in ('call', 'batch', 'p50 [%]', 'p99 [%]'))], lines)


def main(args: Sequence[str] | None = None) -> int:
    """Measure, print, write."""
    parser = output.report_parser(
        'frontier', __doc__, quick='few pairs and models, to try it out', seed=3,
        out='frontier.md, .csv and pictures')
    add_models(parser)
    add_leave_out(parser)
    options = parser.parse_args(args)
    folder = output.results_folder(parser, options, part=bool(options.model))
    require('report', 'soup')
    plan, names = (QUICK, QUICK_MODELS) if options.quick else (FULL, MODELS)
    models = [*map(ours, names), *other_networks(), *map(ours, options.model)]
    engines, missing = installed()
    if not (options.quick or may_miss('frontier', missing, options.leave_out)):
        return 1
    for line in missing:
        print(f'frontier: left out: {line}', file=sys.stderr)
    with pinned({usable_cores()[-1]}):
        rows = measure_all([*models, *engines], TIMED_SETS, seed=options.seed, plan=plan)
        for name in reversed(instruction_sets()):
            if name != native.kernel:
                rows += in_subprocess(measure_core, options.seed, plan, patience=LONGEST_RUN,
                                      instruction_set=name)
    output.write_csv(folder / 'frontier.csv', csv_rows(rows, [*models, *engines]))
    write_page(folder, args, rows, models, engines, missing, plan)
    draw(folder, folder / 'frontier.csv', [model.name for model in map(ours, options.model)])
    print(in_short(rows, engines))
    return 0


if __name__ == '__main__':
    sys.exit(main())

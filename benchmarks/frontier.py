# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Program `frontier`: speed against error of every model and of other engines.

`python -m box_contact_ros frontier` writes frontier.csv, .md and .png. One run, one pinned core,
garbage collection off. Each contestant is warmed up and timed call by call. All of them on all sets
take turns. The models with native batches run once more with each other instruction set of the
machine, in a subprocess. Times are read as ratios within a run; the machine is named.

Errors are against the exact model. Those of points are in % of the smaller box's longest edge, per
contact class; those of normals in degrees. Verdicts that differ are contacts missed
and contacts invented. An engine that returns several points is entered with the best of the ways
to make one of them. Other engines are judged in subprocesses, where an abort is a finding.

`--speed` writes the speed gates instead, speed.md and speed.csv.
"""
from __future__ import annotations

import math
import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from inspect import getdoc

from box_contact_ros.core import FORCE, instruction_sets, native
from box_contact_ros.solver.arguments import program_parser
from box_contact_ros.solver.models import models, models_with_patch

from . import output
from .accuracy import CLASSES
from .contestant import Contestant, ours, packages_of
from .engines import installed
from .frontier_picture import draw
from .native import write_native
from .output import markdown_table, number
from .speed import with_instruction_set, write_speed
from .timing import pinned, usable_cores
from .trials import (
    ALL_SETS,
    FEW_PAIRS,
    FULL,
    QUICK,
    VERDICT,
    FrontierRow,
    Plan,
    measure_all,
)

IN_SHORT = ('exact', 'mlp', 'paper', 'soup-8', 'soup-22')
"""Models in the table of the README that engines answer, too."""
AS_ENGINES = ('fcl',)
"""Models whose library is measured as an engine, by the call that its own documentation shows."""
FAMILIES = {'soup': [f'soup-{n}' for n in (8, 10, 12, 14, 16, 18, 20, 22)]}
"""The members of a family that are measured: those of the paper's Table 3."""
ODD_NORMAL = 10.0  # error of an engine's normal that is explained [deg]


def contestants(members: int = FULL.members) -> tuple[list[Contestant], list[str]]:
    """Return all that can be measured here, and a line about each that cannot."""
    found = []
    for entry in (one for one in models().values() if one.name not in AS_ENGINES):
        with suppress(ImportError):  # of an extra whose libraries `missing` names
            entry.load()
            found += map(ours, FAMILIES.get(entry.name, [entry.full_name])[:members])
    rivals, missing = installed()
    return [*found, *rivals], missing


def measure_native(seed: int, plan: Plan) -> list[FrontierRow]:
    """Measure the models with native batches, by the instruction set of this process."""
    return measure_all([ours(model) for model in models_with_patch()], seed=seed, plan=plan)


def _errors(values: Sequence[float]) -> str:
    return '/'.join(map(number, values))


Odd = tuple[str, str]  # an engine's name, and 'missed', 'invented', 'normal' or 'failure'


def odd_cells(rows: Sequence[FrontierRow], found: Sequence[Contestant]) -> dict[Odd, str]:
    """Return what is odd in the answers of other engines: a line with a pose and the cause."""
    lines: dict[Odd, str] = {}
    for engine in found:
        mine = [row for row in rows if row.name == engine.name and engine.make]
        for kind in ('missed', 'invented', 'normal', 'failure'):
            worst = max(mine, key=lambda row: _oddness(row, kind), default=None)
            if worst is None or _oddness(worst, kind) <= (ODD_NORMAL if kind == 'normal' else 0.0):
                continue
            what = worst.failure or f'{kind} {_oddness(worst, kind):.3g}'
            cause = engine.causes.get(kind) or 'Cause unknown.'
            pose = '; '.join(f'{part} {tuple(values)}' for part, values in zip(
                ('pose A', 'pose B', 'size A', 'size B'), worst.poses.get(kind, ())))
            lines[engine.name, kind] = (
                f'{engine.name}, {worst.set}: {what}{"°" if kind == "normal" else ""}. {cause}'
                + (f' First or worst: `{pose}`.' if pose else ''))
    return lines


def _oddness(row: FrontierRow, kind: str) -> float:
    errors = row.errors
    return {'missed': errors.missed, 'invented': errors.invented,
            'normal': 0.0 if math.isnan(errors.normal[1]) else errors.normal[1],
            'failure': row.exceptions + len(row.failure)}[kind]


def in_short(rows: Sequence[FrontierRow], odd: Mapping[Odd, str]) -> str:
    """Return the short table: containers and stacks, what a crane has all day."""
    by = {(row.name, row.instruction_set, row.set): row for row in rows}
    best, notes, lines = native.instruction_set, list(odd), []
    rivals = [name for name in dict.fromkeys(row.name for row in rows) if ' ' in name]
    for name in (*IN_SHORT, *rivals):
        def marked(kind: str, cell: object, name: str = name) -> str:
            place = notes.index((name, kind)) + 1 if (name, kind) in odd else 0
            return f'{cell} [{place}]' if place else f'{cell}'

        for one in dict.fromkeys(row.instruction_set for row in rows if row.name == name):
            mine = [row for row in rows if (row.name, row.instruction_set) == (name, one)]
            row, stack = by.get((name, one, 'containers')), by.get((name, one, 'stacks'))
            if row is None:
                continue
            worst = [one.errors.normal[1] for one in mine if not math.isnan(one.errors.normal[1])]
            lines.append([
                name if name in rivals else f'`{name}`' + (f', {one}' if one != best or name in
                                                           models_with_patch() else ''),
                f'{number(row.single[0] / 1e3)} / {number(row.single[1] / 1e3)}',
                number(row.batch), row.best if name in rivals else '–',
                *[number(one.errors.points['all'][2]) if one and one.errors.points else '–'
                  for one in (row, stack)],
                marked('normal', number(max(worst, default=math.nan))),
                marked('missed', f'{sum(one.errors.missed for one in mine)} of '
                       f'{sum(one.judged for one in mine):,}'),
                marked('invented', sum(one.errors.invented for one in mine)),
                marked('failure', f'{sum(one.exceptions for one in mine)} / '
                       f'{sum(bool(one.failure) for one in mine)}')])
    return markdown_table(
        ['', 'single call, p50 / p99 [µs]', 'batch [ns a pair]', 'best point',
         'point error p99, containers [%]', 'stacks [%]', 'normal, worst [°]', 'missed', 'invented',
         'exceptions / aborts'], lines)


def calls_table(found: Sequence[Contestant]) -> str:
    """Return what is called of other engines, and what they return."""
    return markdown_table(
        ['', 'call', 'returns', 'volume or area', 'one point by', 'batch'],
        [[engine.name, f'`{engine.call}`', engine.returns, engine.patch, ', '.join(engine.choices),
          'yes' if engine.prepare_batch else '–'] for engine in found if engine.make], words=6)


def set_table(rows: Sequence[FrontierRow], name: str) -> str:
    """Return all contestants on one set."""
    labels = ('all', *CLASSES)
    return markdown_table(
        ['', 'call p50 [µs]', 'p99', 'max', 'batch [ns]', 'judged', 'best point',
         *[f'{label}: p50/p99/worst' for label in labels], 'normal p99/worst [°]', 'missed',
         'invented'],
        [[f'{row.name}, {row.instruction_set}' if row.name in models_with_patch() else row.name,
          *[number(value / 1e3) for value in row.single], number(row.batch),
          f'{row.judged:,}', row.best if len(row.choices) > 1 else '–',
          *[_errors(row.errors.points[label][1:]) if label in row.errors.points else '–'
            for label in labels],
          _errors(row.errors.normal), row.errors.missed, row.errors.invented]
         for row in rows if row.set == name])


def honesty(rows: Sequence[FrontierRow]) -> str:
    """Return where the network loses and what it is for, with this run's figures."""
    by = {(row.name, row.set): row for row in rows
          if row.instruction_set == native.instruction_set}
    net = by['mlp', 'containers']
    return output.page(
        'benchmarks/pages/frontier_honesty',
        single=net.by_exact[0], containers=net.by_exact[1],
        stacks=by['mlp', 'stacks'].by_exact[1],
        paper=by['paper', 'random cubes'].errors.points['all'][1]).rstrip()


def page(rows: Sequence[FrontierRow], found: Sequence[Contestant], missing: Sequence[str],
         command: str, plan: Plan) -> str:
    """Return the Markdown page."""
    odd = odd_cells(rows, found)
    return output.page(
        'benchmarks/pages/frontier', command=command,
        machine=output.machine(native, packages_of(found)),
        skipped=''.join(f'\n\nLeft out: {line}.' for line in missing),
        in_short=in_short(rows, odd), odd='\n'.join(
            f'{place}. {line}' for place, line in enumerate(odd.values(), start=1)) or 'None.',
        honesty=honesty(rows), verdict=VERDICT, few_pairs=FEW_PAIRS,
        timed_pairs=plan.timed_pairs, calls=calls_table(found),
        sets='\n\n'.join(
            f'### {name.capitalize()}\n\n{getdoc(ALL_SETS[name])}\n\n{set_table(rows, name)}'
            for name in ALL_SETS))


def csv_rows(rows: Sequence[FrontierRow], found: Sequence[Contestant]) -> list[dict[str, object]]:
    """Return a row per contestant, set, choice and class; times [ns], errors [%], normals [deg]."""
    packages, lines = {engine.name: engine.package for engine in found}, []
    here = {package: asdict(output.machine(native, ['numpy', *filter(None, [package])]))
            for package in {'', *packages.values()}}
    for row in rows:
        for choice, errors in row.choices.items():
            points = errors.points or {'all': (0, *[math.nan] * 3)}
            for label, (count, *point) in points.items():
                lines.append({
                    'contestant': row.name, 'set': row.set, 'point': choice, 'class': label,
                    'contacts': count,
                    **dict(zip(('point_p50', 'point_p99', 'point_worst'), point)),
                    **dict(zip(('call_p50', 'call_p99', 'call_max'),
                               (round(one) if one == one else one for one in row.single))),
                    'calls': row.calls, 'batch_p50': row.batch,
                    **dict(zip(('call_by_exact', 'batch_by_exact'), row.by_exact)),
                    'judged': row.judged,
                    'normal_p99': errors.normal[0], 'normal_worst': errors.normal[1],
                    'missed': errors.missed, 'invented': errors.invented,
                    'exceptions': row.exceptions, 'failure': row.failure,
                    **here[packages[row.name]], 'instruction_set': row.instruction_set})
    return lines


def main(args: Sequence[str] | None = None) -> int:
    """Measure, print, write; with `--speed`, 1 if a limit is broken."""
    parser = program_parser('frontier', __doc__, quick='few pairs, to try it out', seed=3,
                            out='frontier.md, .csv, .png')
    parser.add_argument('--speed', action='store_true',
                        help='the speed gates instead: speed.md, .csv')
    parser.add_argument('--native', action='store_true',
                        help='C against C instead, with other engines: native.md, .csv')
    cores = usable_cores()
    parser.add_argument('--core', type=int, default=cores[-1], choices=cores, metavar='N',
                        help='core to run on (default: the last one)')
    options = parser.parse_args(args)
    folder = output.results_folder(parser, options)
    command = output.command_line('box_contact_ros frontier', args)
    if options.speed:
        return write_speed(folder, command, core=options.core, quick=options.quick)
    if options.native:
        return write_native(folder, command, core=options.core, quick=options.quick)
    plan = QUICK if options.quick else FULL
    with pinned({options.core}):
        found, missing = contestants(plan.members)
        for line in missing:
            print(f'frontier: left out: {line}', file=sys.stderr)
        rows = measure_all(found, seed=options.seed, plan=plan)
        here = os.environ.get(FORCE, instruction_sets()[-1])
        for name in [one for one in reversed(instruction_sets()) if one != here]:
            rows += with_instruction_set(name, measure_native, options.seed, plan)
    output.write_csv(folder / 'frontier.csv', csv_rows(rows, found))
    (folder / 'frontier.md').write_text(page(rows, found, missing, command, plan),
                                        encoding='utf-8')
    draw(folder / 'frontier.png', folder / 'frontier.csv')
    print(in_short(rows, odd_cells(rows, found)), honesty(rows), sep='\n\n')
    return 0

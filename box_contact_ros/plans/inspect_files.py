# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Is a plan sound? What was read, a line for each fault, and one for the whole plan.

It reads SMDG BAPLIE, and packing plans as CSV or JSON. Of several files it prints a line each. The
exit status is 2 if a file could not be read, else 1 if a plan is not sound, else 3 if not all of
one was judged, else 0.
"""
from __future__ import annotations

import argparse
import csv
import os
import shlex
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..arguments import one_line, program_main, program_parser, within
from ..extras import MissingExtra
from ..solver.checks import printable
from .inspect_plan import FRICTION, inspect_plan
from .inspection import Inspection
from .meetings import overlaps_of
from .plan import Fault, Plan
from .read_plan import ReadPlan, read_any
from .roles import FRAMES, ORIGINS, TURNS, UNITS, UPS, Given
from .ways import SIDES

NOT_READ = 2
STATUSES = {'sound': 0, 'not all judged': 3, 'not sound': 1, 'not read': NOT_READ}
"""Exit statuses, by verdict; of several files the last of these counts."""
PATIENT = 5.0  # time [s] after which several files have a progress bar
COLUMNS = ('file', 'kind', 'boxes', 'text')
STEPS = (5e-4, 1e-3, 2e-3, 5e-3)  # tolerances that places may need that are rounded [m]
ROUNDED = 1.5  # A tolerance must exceed a gap by so much to be a hint [1]


def judged(path: str, options: argparse.Namespace) -> tuple[Inspection, str]:
    """Return what is wrong with the plan of a file, and what was taken of it.

    options: of `add_options`. Raises OSError and ValueError.
    """
    read = read_any(path, given_of(options))
    plan = read.plan
    limits = np.full(len(plan), np.inf) if options.geometry else plan.limits.copy()
    if options.limit is not None:
        free = np.setdiff1d(np.arange(len(plan)), plan.ground)
        limits[free] = np.minimum(limits[free], options.limit)
    ignored = {kind for kind, is_told in (
        ('mass', options.geometry), ('order', options.order),
        ('friction', options.geometry or options.friction is not None)) if is_told}
    loaded_from = options.loaded_from
    if loaded_from and plan.order is None and not options.order:
        if all(fault.kind != 'order' for fault in plan.faults):
            raise ValueError(f'{path}: --from needs an order: `order` of each box, or --order rows')
        loaded_from = None
    plan = replace(
        plan, masses=None if options.geometry else plan.masses, limits=limits,
        order=order_of_rows(plan) if options.order else plan.order,
        faults=tuple(fault for fault in plan.faults if fault.kind not in ignored))
    try:
        found = inspect_plan(
            plan, tolerance=options.tolerance, acceleration=options.acceleration or (0, 0, -9.81),
            bears=options.bears or read.bears, sides=options.sides, loaded_from=loaded_from,
            friction=FRICTION if options.friction is None else options.friction)
    except ValueError as error:
        option = '--' if str(error).startswith('tolerance') else ''
        raise ValueError(f'{path}: {option}{error}') from None
    hints = tuple(_hints(path, options, read, found))
    plan = replace(found.plan, faults=(*found.plan.faults, *hints))
    return replace(found, plan=plan), read.taken


def _hints(path: str, options: argparse.Namespace, read: ReadPlan, found: Inspection,
           ) -> Iterator[Fault]:
    """Yield what the file seems to mean, with the option that says so."""
    if read.taken and options.origin is None and (len(found.overlaps) or found.outside.any()):
        try:
            other = read_any(path, given_of(options)._replace(origin='corner')).plan
        except ValueError:
            other = read.plan  # its columns tell that
        count, fewer = (overlaps_of(plan, found.tolerance) for plan in (read.plan, other))
        if 2 * fewer < count:
            yield Fault('origin', (), f'{count - fewer:,} of {count:,} overlaps are gone if x y z '
                                      'are least corners: --origin corner')
    gaps = np.concatenate((found.height[found.cause == 'hangs'], found.depths))
    small = gaps[gaps <= STEPS[-1] / ROUNDED]
    if options.tolerance is None and len(small):
        enough = next(step for step in STEPS if step >= ROUNDED * small.max())
        if enough <= found.plan.sizes.min() / 2.0:
            yield Fault('tolerance', (), f'{len(small):,} gaps and overlaps are at most '
                        f'{1e3 * small.max():.2g} mm, as where places are rounded: --tolerance '
                        f'{enough:g}')


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add options for what a file does not tell, and for how its plan is judged."""
    parser.add_argument('--origin', choices=ORIGINS, help='what x y z of a table are (default: '
                        'centres, unless its columns say it)')
    parser.add_argument('--unit', choices=UNITS, help='of all lengths of a table')
    parser.add_argument('--container', type=within(0.0), nargs=3, metavar=('L', 'W', 'H'),
                        help='inner size of each container along x y z, in the unit of the file; '
                        'its least corner is at 0 0 0')
    parser.add_argument('--column', type=_column, action='append', default=[], dest='columns',
                        metavar='ROLE=NAME', help='what a column of a table is, as mass=gross')
    parser.add_argument('--ignore', action='append', default=[], metavar='NAME', help='a column, '
                        'or a list of a JSON document, that decides on nothing')
    parser.add_argument('--up', choices=UPS, help='the axis of the file that is up (default: z)')
    parser.add_argument('--turns', choices=TURNS, help='the unit of yaw, roll and pitch')
    parser.add_argument('--frames', choices=FRAMES, help='whether each container has a frame of '
                        'its own (default: if the least corners of all agree)')
    parser.add_argument('--limit', type=within(0.0), metavar='KG', help='the most that may rest on '
                        'any box')
    parser.add_argument('--tolerance', type=within(0.0), metavar='M', help='the gap up to which '
                        'faces touch, and the depth up to which boxes do not overlap (default: '
                        '1e-4, or a quarter of the thinner box)')
    parser.add_argument('--friction', type=within(0.0), metavar='MU', help='of ground, walls and '
                        f'boxes of which the file has none (default: {FRICTION})')
    parser.add_argument('--bears', choices=('faces', 'corners'), help='where boxes stand on each '
                        'other (default: corners for containers of a ship, faces for others)')
    parser.add_argument('--sides', action='store_true', help='boxes beside each other carry by '
                        'friction, and so do the walls of a container')
    parser.add_argument('--acceleration', type=float, nargs=3, metavar=('X', 'Y', 'Z'),
                        help='what the goods feel, gravity included [m/s²] (default: 0 0 -9.81); a '
                        'lorry that brakes along +x by 0.4 g: 3.92 0 -9.81')
    parser.add_argument('--order', choices=('rows',), help='boxes come by the order of their rows; '
                        'else by the column or key `order`, if there is one')
    parser.add_argument('--from', dest='loaded_from', choices=SIDES, help='where boxes come from, '
                        'each by a straight way that must be free (-x as --from=-x)')
    parser.add_argument('--geometry', action='store_true', help='leave masses out: judge overlaps '
                        'and support alone')


def _column(text: str) -> tuple[str, str]:
    role, equals, name = text.partition('=')
    if not equals:
        raise argparse.ArgumentTypeError(f'must be ROLE=NAME, got {text}')
    return role, name


def given_of(options: argparse.Namespace) -> Given:
    """Return what those options tell of a file."""
    return Given(options.origin, options.unit, options.container, dict(options.columns),
                 options.ignore, options.up, options.turns, options.frames)


def typed(options: argparse.Namespace) -> list[str]:
    """Return those options that are not the default, as they are typed."""
    parser = argparse.ArgumentParser(add_help=False)
    add_options(parser)
    words: list[str] = []
    for action in parser._actions:
        value, flag = getattr(options, action.dest), action.option_strings[0]
        if value == action.default:
            continue
        if value is True:
            words.append(flag)
        elif isinstance(value, list) and action.nargs is None:
            words += [f'{flag}={one}' if isinstance(one, str) else f'{flag}={"=".join(one)}'
                      for one in value]
        elif isinstance(value, list):
            words += [flag, *(f'{one:.15g}' for one in value)]
        else:
            shown = value if isinstance(value, str) else f'{value:.15g}'
            words += [f'{flag}={shown}'] if shown.startswith('-') else [flag, shown]
    return words


def order_of_rows(plan: Plan) -> np.ndarray:
    """Return the place of each box among those of its stack (n,); a body comes with its first."""
    first = np.unique(plan.body, return_index=True)[1][plan.body]
    order = np.zeros(len(plan), int)
    for stack in np.unique(plan.stack):
        boxes = np.flatnonzero(plan.stack == stack)
        order[boxes] = np.arange(1, len(boxes) + 1)
    return order[first]


def _parser() -> argparse.ArgumentParser:
    parser = program_parser('inspect', __doc__)
    parser.add_argument('files', nargs='+', metavar='FILE')
    parser.add_argument('--json', action='store_true', help='all that was found, a line of JSON a '
                        'file, as msg_schemas/inspection.json has it')
    parser.add_argument('--csv', action='store_true', help='a row for each fault')
    parser.add_argument('--picture', metavar='OUT.png', help='draw the plan of one file, coloured '
                        'by cause (needs Matplotlib)')
    parser.add_argument('--all', action='store_true', help='print all lines, not 40')
    add_options(parser)
    return parser


@program_main
def main(args: Sequence[str] | None = None) -> int:
    """Judge files; return the exit status of the worst."""
    parser = _parser()
    options = parser.parse_args(args)
    if sys.stdout is None:
        raise OSError('stdout is closed')
    if options.picture and len(options.files) > 1:
        parser.error('--picture takes one file')
    if options.picture and os.path.realpath(options.picture) == os.path.realpath(options.files[0]):
        parser.error(f'--picture would overwrite {printable(options.picture)}')
    if options.json and options.csv:
        parser.error('--json and --csv exclude each other')
    writer = csv.writer(sys.stdout, lineterminator='\n')
    if options.csv:
        writer.writerow(COLUMNS)
    worst, counts, boxes, paths = 'sound', Counter[str](), 0, options.files
    if len(paths) > 1:
        from tqdm import tqdm

        paths = tqdm(paths, unit='file', delay=PATIENT, leave=False, disable=None)
    for path in paths:
        try:
            found, taken = judged(path, options)
            figure = found.plot() if options.picture else None
        except (OSError, ValueError, MissingExtra, MemoryError) as error:
            is_full = isinstance(error, MemoryError)
            print(f'{printable(path)}: it needs more memory than there is' if is_full else
                  one_line(error), file=sys.stderr)
            worst = 'not read'
            counts[worst] += 1
            continue
        if figure:
            try:
                figure.savefig(options.picture, dpi=120)
            except ValueError as error:  # for an ending that is no picture's
                parser.error(f'--picture: {one_line(error)}')
        worst = max(worst, found.verdict, key=list(STATUSES).index)
        counts[found.verdict] += 1
        boxes += len(found.plan) - len(found.plan.ground)
        if options.json:
            print(found.to_json(file=path, read=taken))
        elif options.csv:
            writer.writerows(map(_cell, (path, row.kind, ' '.join(row.names), row.text))
                             for row in found.rows())
        elif len(options.files) > 1:
            print(f'{printable(path)}: {found.summary()}', flush=True)
        else:
            if taken:
                print(printable(taken))
            print(found.text(None) if options.all else found)
            if path.isprintable():
                shown = path if not path.startswith('-') else f'./{path}'
                print('To see it in 3D:', printable(shlex.join(
                    ['box_contact_view', *typed(options), shown])))
    if len(options.files) > 1 and not (options.json or options.csv):
        total = ', '.join(f'{counts[word]:,} {word}' for word in STATUSES if counts[word])
        print(f'{len(options.files):,} files, {boxes:,} boxes: {total}')
    return STATUSES[worst]


def _cell(text: str) -> str:
    """Return a text as a cell that no spreadsheet runs."""
    return ("'" if text.startswith(tuple('=+-@\t\r')) else '') + printable(text)


if __name__ == '__main__':
    sys.exit(main())

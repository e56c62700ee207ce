# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Is a plan sound? A line for each fault, first what was left out, and one for the whole plan.

It reads SMDG BAPLIE, and packing plans as CSV or JSON. Of several files it prints a line each. The
exit status is 2 if a file could not be read, else 1 if a plan is not sound, else 3 if not all of
one was judged, else 0.
"""
from __future__ import annotations

import argparse
import csv
import dataclasses
import json
import math
import os
import shlex
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ..arguments import one_line, program_main, program_parser, within
from ..extras import MissingExtra
from ..solver.checks import printable
from ..solver.contacts_of import TooManyNear
from .crowd import crowded
from .forms import ORIGINS, UNITS, Given
from .inspect_plan import inspect_plan
from .inspection import Inspection
from .plan import Fault, Plan
from .read_plan import read_any
from .ways import SIDES

NOT_READ = 2
STATUSES = {'sound': 0, 'not all judged': 3, 'not sound': 1, 'not read': NOT_READ}
"""Exit statuses, by verdict; of several files the last of these counts."""
PATIENT = 5.0  # time [s] after which several files have a progress bar
COLUMNS = ('file', 'kind', 'boxes', 'text')


def judged(path: str, options: argparse.Namespace) -> tuple[Inspection, str]:
    """Return what is wrong with the plan of a file, and in which form it was read.

    Raises OSError and ValueError.
    """
    given = given_of(options)
    plan, bears, form = read_any(path, given)
    limits = np.full(len(plan), np.inf) if options.geometry else plan.limits.copy()
    if options.limit is not None:
        free = np.setdiff1d(np.arange(len(plan)), plan.ground)
        limits[free] = np.minimum(limits[free], options.limit)
    ignored = {kind for kind, is_told in (
        ('mass', options.geometry), ('order', options.order)) if is_told}
    plan = dataclasses.replace(
        plan, masses=None if options.geometry else plan.masses, limits=limits,
        order=order_of_rows(plan) if options.order else plan.order,
        faults=tuple(fault for fault in plan.faults if fault.kind not in ignored))
    felt = options.acceleration or (0.0, 0.0, -9.81)
    loaded_from = options.loaded_from
    if loaded_from and plan.order is None:
        if all(fault.kind != 'order' for fault in plan.faults):
            raise ValueError(f'{path}: --from needs an order: `order` of each box, or --order rows')
        loaded_from = None
    try:
        found = inspect_plan(plan, tolerance=options.tolerance, acceleration=felt,
                             bears=options.bears or bears, sides=options.sides,
                             loaded_from=loaded_from)
    except TooManyNear as error:
        return crowded(plan, error.pairs, options.tolerance, felt), form
    except ValueError as error:
        option = '--' if str(error).startswith('tolerance') else ''
        raise ValueError(f'{path}: {option}{error}') from None
    if _lies_wrong(found) and options.origin is None and (
            hint := _other_origin(path, given, plan, form)):
        plan = dataclasses.replace(found.plan, faults=(*found.plan.faults, Fault(
            'origin', (), f'all stand and none overlaps if {hint}')))
        found = dataclasses.replace(found, plan=plan)
    return found, form


def _lies_wrong(found: Inspection) -> bool:
    """Return whether boxes overlap, are outside or do not stand."""
    return bool(len(found.overlaps) or found.outside.any() or (found.cause != '').any())


def _other_origin(path: str, given: Given, plan: Plan, form: str) -> str:
    """Return by which other origin geometry alone finds nothing, or ''."""
    try:
        other = read_any(path, given._replace(origin='corner')).plan
        hint = 'x y z are least corners: --origin corner'
        if np.array_equal(other.poses, plan.poses):  # it has corners by its columns
            centres = plan.poses.copy()
            own = np.setdiff1d(np.arange(len(plan)), plan.ground)
            centres[own, :3] -= plan.sizes[own] / 2.0
            other = dataclasses.replace(plan, poses=centres)
            hint = '' if form else 'x_min y_min z_min are centres: call them x y z'
        return '' if _lies_wrong(inspect_plan(dataclasses.replace(other, masses=None))) else hint
    except (ValueError, TooManyNear):
        return ''


def add_given(parser: argparse.ArgumentParser) -> None:
    """Add options for what a packer's file does not tell."""
    parser.add_argument('--origin', choices=ORIGINS, help="what x y z are in a packer's file "
                        '(default: the centre, unless its form has corners)')
    parser.add_argument('--unit', choices=UNITS, help="of lengths in a packer's file (default: "
                        'that of its form)')
    parser.add_argument('--container', type=within(0.0), nargs=3, metavar=('L', 'W', 'H'),
                        help='inner size of a container along x y z, in the unit of the file; its '
                        'least corner is at 0 0 0')


def given_of(options: argparse.Namespace) -> Given:
    """Return what those options tell."""
    return Given(options.origin, options.unit, options.container)


def _words(given: Given) -> list[str]:
    """Return those options as they are typed."""
    words: list[str] = []
    for name, value in given._asdict().items():
        if value is not None:
            words += [f'--{name}', *([value] if isinstance(value, str) else map(str, value))]
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
    add_given(parser)
    parser.add_argument('--limit', type=within(0.0), metavar='KG', help='the most that may rest on '
                        'any box')
    parser.add_argument('--tolerance', type=within(0.0), metavar='M', help='the gap up to which '
                        'faces touch, and the depth up to which boxes do not overlap (default: '
                        '1e-4, or a quarter of the thinner box)')
    parser.add_argument('--all', action='store_true', help='print all lines, not 40')
    parser.add_argument('--bears', choices=('faces', 'corners'), help='where boxes stand on each '
                        'other (default: corners for containers, faces for others)')
    parser.add_argument('--sides', action='store_true', help='boxes beside each other carry by '
                        'friction, and so do the walls of a container')
    parser.add_argument('--acceleration', type=float, nargs=3, metavar=('X', 'Y', 'Z'),
                        help='what the goods feel, gravity included [m/s²] (default: 0 0 '
                        '-9.81); a lorry that brakes along +x by 0.4 g: '
                        '3.92 0 -9.81')
    parser.add_argument('--order', choices=('rows',), help='boxes come by the order of their rows; '
                        'else by the column or key `order`, if there is one')
    parser.add_argument('--from', dest='loaded_from', choices=SIDES, help='where boxes come from, '
                        'each by a straight way that must be free (-x as --from=-x)')
    parser.add_argument('--geometry', action='store_true', help='leave masses out: judge overlaps '
                        'and support alone')
    return parser


@program_main
def main(args: Sequence[str] | None = None) -> int:
    """Judge files; return the exit status of the worst."""
    parser = _parser()
    options = parser.parse_args(args)
    if options.picture and len(options.files) > 1:
        parser.error('--picture takes one file')
    if options.picture and os.path.realpath(options.picture) == os.path.realpath(options.files[0]):
        parser.error(f'--picture would overwrite {printable(options.picture)}')
    if options.json and options.csv:
        parser.error('--json and --csv exclude each other')
    writer = csv.writer(sys.stdout, lineterminator='\n')
    if options.csv:
        writer.writerow(COLUMNS)
    worst, counts, boxes = 'sound', Counter[str](), 0
    for path in _with_progress(options.files):
        try:
            found, form = judged(path, options)
            figure = found.plot() if options.picture else None
        except (OSError, ValueError, MissingExtra) as error:
            print(one_line(error), file=sys.stderr)
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
            print(json.dumps({'file': path, **as_json(found)}))
        elif options.csv:
            writer.writerows(map(_cell, (path, row.kind, ' '.join(row.names), row.text))
                             for row in found.rows())
        elif len(options.files) > 1:
            print(f'{printable(path)}: {found.summary()}', flush=True)
        else:
            if form:
                print(form)
            print(found.text(None) if options.all else found)
            if path.isprintable():
                shown = path if not path.startswith('-') else f'./{path}'
                print('To see it in 3D:', shlex.join(
                    ['box_contact_view', *_words(given_of(options)), shown]))
    if len(options.files) > 1 and not (options.json or options.csv):
        total = ', '.join(f'{counts[word]:,} {word}' for word in STATUSES if counts[word])
        print(f'{len(options.files):,} files, {boxes:,} boxes: {total}')
    return STATUSES[worst]


def _cell(text: str) -> str:
    """Return a text as a cell that no spreadsheet runs."""
    return ("'" if text.startswith(tuple('=+-@\t\r')) else '') + printable(text)


def as_json(found: Inspection) -> dict[str, Any]:
    """Return all that was found, as msg_schemas/inspection.json has it; NaN and infinity are null.

    Boxes are named in the pairs, and in the order of `names` elsewhere.
    """
    plan = found.plan
    fields = {field.name: getattr(found, field.name) for field in dataclasses.fields(found)}
    del fields['plan']
    for pairs in ('overlaps', 'carried_by', 'ways'):
        fields[pairs] = [[plan.names[a], plan.names[b]] for a, b in fields[pairs].tolist()]
    fields['steps'] = [{'step': step, 'name': plan.names[box], 'cause': cause, 'until': until}
                       for step, box, cause, until in found.steps]
    return {'verdict': found.verdict, 'sound': found.sound,
            'names': list(plan.names), 'ground': plan.ground.tolist(),
            'faults': [row._asdict() for row in found.rows()],
            **{name: _plain(value) for name, value in fields.items()}}


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list):
        return [_plain(part) for part in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _with_progress(paths: Sequence[str]) -> Iterable[str]:
    """Return the paths; of several, a bar tells after a while how many are done."""
    if len(paths) == 1:
        return paths
    from tqdm import tqdm

    return tqdm(paths, unit='file', delay=PATIENT, leave=False, disable=None)


if __name__ == '__main__':
    sys.exit(main())

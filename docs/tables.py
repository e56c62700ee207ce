# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fill the README and docs/ with the figures of docs/results/*.csv.

`python docs/tables.py` rewrites each page that has a table between `<!-- table NAME -->` and
`<!-- end of table -->` or, in a sentence, a figure between `<!--figure:NAME-->` and `<!--end-->`,
and the sentence of the C++ header that says how far `mlp` is off.
`--check` only reports pages whose figures are not those of the CSV files.
"""
from __future__ import annotations

import argparse
import functools
import math
import re
import sys
import textwrap
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT))  # where benchmarks/ is, which is not installed

from benchmarks import stacks_picture  # noqa: E402
from benchmarks.output import markdown_table, number, read_csv  # noqa: E402

RESULTS = ROOT / 'docs' / 'results'
PAGES = [ROOT / 'README.md', *sorted((ROOT / 'docs').rglob('*.md'))]
BLOCK = re.compile(r'(<!-- table ([\w-]+) -->\n).*?(<!-- end of table -->)', re.DOTALL)
FIGURE = re.compile(r'(<!--figure:([\w-]+)-->).*?(<!--end-->)', re.DOTALL)
HEADER = ROOT / 'box_contact_ros' / 'core' / 'include' / 'box_contact' / 'box_contact.hpp'
PROMISE = re.compile(r'// In 99 of 100 contacts.*?(?=\n//\n)', re.DOTALL)
"""What the header says of the errors of `mlp`."""

Row = dict[str, str]

class Choice(NamedTuple):
    """A row of the README's table: a name, and what the reports call its measurements."""

    name: str
    contestant: str  # of frontier.csv
    native: tuple[str, ...] = ()  # of native.csv, without `, single`; the second: with the patch
    rest: str = 'settled'  # set of goods at rest in frontier.csv
    resting: str = ''  # the contestant of that set, if it is another


CHOICES = (
    Choice('`exact`', 'exact', ('exact volume', 'exact covariance')),
    Choice('`mlp`', 'mlp', ('mlp volume', 'mlp covariance')),
    Choice("the paper's networks; cubes at rest", 'paper', ('paper',), rest='settled cubes',
           resting='paper-at-rest'),
    Choice('MuJoCo', 'MuJoCo mj_collision', ('mjc_BoxBox',)),
    Choice('PyBullet; in C Bullet', 'PyBullet getContactPoints', ('Bullet btBoxBoxDetector',)),
    Choice('Coal, patch', 'Coal ComputeCollision, contact patch', ('Coal ComputeContactPatch',)),
    Choice('Drake, hydroelastic', 'Drake hydroelastic'),
)
"""This package's models, the network of the source paper, and the engines."""
SHOWN = {'avx512': 'AVX-512', 'avx2': 'AVX2'}
"""Instruction sets as native.csv and frontier.csv call them, the README's first."""
LATE = '1 ms, 50 Hz, 5 ms late'  # way of stacks.csv
AT_REST, SWAY = 'settled by PatchForces', 'containers'  # sets of native.csv
RATIOS = re.compile(r'^quiet: (contact / echo .*)$', re.MULTILINE)
"""What the bench prints first."""
MEDIAN = re.compile(r'^\| *quiet \| *contact(?: \| *[\d.]+){3} \| *([\d.]+)', re.MULTILINE)
"""The median latency of the contact node [ms]."""
RATE = re.compile(r'([\d.]+) pairs per second')
VOID = re.compile(r'^void: .*$', re.MULTILINE)
SETS = {
    'landings': 'containers that land on each other',
    'settled': 'goods at rest',
    'stacks': 'stacks, tilt 1e-6–1e-3 rad',
    'parcels': 'parcels on each other at any yaw',
    'random cubes': 'cubes in any pose, 0.1–10 % deep',
    'random sizes': 'random pairs of sizes, to 1:20',
    'containers': '40 ft containers, 5° sway',
    'deep': 'boxes deep in each other, 10–70 %',
}
"""Sets of accuracy.csv in the table of `mlp`, with their names there."""
UNSEARCHED = 'through each other'
"""End of the names of sets that no search and no promise is about."""


_table = functools.cache(read_csv)


def rows(file: str, **wanted: str) -> list[Row]:
    """Return the rows of a CSV file whose columns have the wanted values."""
    return [row for row in _table(RESULTS / file)
            if all(row[column] == value for column, value in wanted.items())]


def cell(row: Row, column: str, unit: float = 1.0, digits: int = 3) -> str:
    """Return a number of a CSV row in a unit, to so many digits; a dash where it is empty."""
    return number(float(f'{float(row[column] or "nan") / unit:.{digits}g}'), digits)


def fastest(found: list[Row], column: str = 'instruction_set') -> Row | None:
    """Return the row with the README's instruction set; None of none."""
    return next((row for name in (*SHOWN, *SHOWN.values()) for row in found
                 if row[column] == name), found[0] if found else None)


def by_point(contestant: str, of_set: str) -> dict[str, Row]:
    """Return the rows of all contacts of a contestant's ways to make one point, by the way."""
    found: dict[str, list[Row]] = {}
    for row in rows('frontier.csv', contestant=contestant, set=of_set, **{'class': 'all'}):
        if row['point_p99']:
            found.setdefault(row['point'], []).append(row)
    return {point: row for point, each in found.items() if (row := fastest(each))}


def error_rows(choice: Choice) -> list[Row]:
    """Return the rows of a contestant's point at rest and landing: of its ways, the nearest one."""
    if choice.contestant == 'exact':
        return []
    at_rest = by_point(choice.resting or choice.contestant, choice.rest)
    landing = by_point(choice.contestant, 'landings')
    nearest = min(at_rest, key=lambda point: [sum(
        float(of_set[point][column]) for of_set in (at_rest, landing))
        for column in ('point_p99', 'point_p50')])
    return [at_rest[nearest], landing[nearest]]


def from_c(choice: Choice, of_set: str) -> str:
    """Return the median times of a pair from C [ns]: alone, and with the patch's size."""
    found = [fastest(rows('native.csv', set=of_set, contestant=f'{name}, single'))
             for name in choice.native]
    times = [cell(row, 'p50_ns', digits=3) for row in found if row]
    return f'{times[0]} ({times[1]})' if len(times) > 1 else ''.join(times) or '–'


def by_exact(contestant: str, of_set: str, what: str) -> str:
    """Return the time of a call, or of a pair of a batch, divided by that of `exact`."""
    row = fastest(rows('frontier.csv', contestant=contestant, set=of_set, **{'class': 'all'}))
    assert row
    return f'{float(row[f"{what}_by_exact"]):.2f}'


def with_version(name: str, row: Row) -> str:
    """Return the name of an engine with the version of its package; other names as they are."""
    package = row['versions'].split(', ')[2:]  # after those of Python and NumPy
    if not package or not name[0].isupper():
        return name
    engine, *way = re.split('(?=[,;])', name, maxsplit=1)
    return f'{engine} {package[0].split()[1]}{"".join(way)}'


def models() -> str:
    """Return what each way to find the contact point costs, and how far it is off."""
    body = []
    for choice in CHOICES:
        call = fastest(rows('frontier.csv', contestant=choice.resting or choice.contestant,
                            set=choice.rest, **{'class': 'all'}))
        assert call
        errors = [', '.join(f'{float(f"{float(row[column]):.2g}"):g}'
                            for column in ('point_p50', 'point_p99'))
                  for row in error_rows(choice)] or ['reference'] * 2
        body.append([with_version(choice.name, call), cell(call, 'call_p50', 1e3),
                     from_c(choice, AT_REST), from_c(choice, SWAY), *errors])
    table = markdown_table(
        ['one pair, one call', 'Python, at rest [µs]', 'C, at rest [ns]', 'C, moving [ns]',
         'point off, at rest [%]', 'point off, landing [%]'], body)
    where = fastest(rows('native.csv', set=SWAY, contestant='exact volume, single'))
    assert where
    batch = [by_exact('mlp', of_set, 'batch') for of_set in ('settled', 'landings', SWAY)]
    return (f'{table}\n\nMedians on one core, {SHOWN[where["instruction_set"]]}, '
            f'{where["processor"]}. In brackets: with the patch, as in Python. Off: p50, p99 from '
            "`exact`'s point, in % of the smaller box's longest edge. [How each was asked]"
            '(docs/results/native.md).\n\n'
            f'`exact` is the default. Batches of `mlp` take {batch[0]} of its time at rest, '
            f'{batch[1]} landing, {batch[2]} moving. Its slowest contact takes {slowest("mlp")} ns '
            f'from C, that of `exact` {slowest("exact")}.')


def bench() -> str:
    """Return what the node's answers take beside an echo's, by the reports of the bench."""
    text = (RESULTS / 'bench_exact.md').read_text('utf-8')
    if void := VOID.search(text):
        return f'The last [run of the bench](docs/results/bench_exact.md) is {void[0]}.'
    ratios, median, rate = (each.search(text) for each in (RATIOS, MEDIAN, RATE))
    assert ratios and median and rate
    soup = ratios[1].partition('soup / contact ')[2].partition(' ')[0]
    ratio, _, rest = ratios[1].removeprefix('contact / echo ').partition(' ')
    return (f'Over ROS, an answer takes {ratio} times as long as an echo, which computes nothing '
            f'(95 % interval {rest.partition("]")[0]}]). The median takes {median[1]} ms at '
            f'{rate[1]} Hz; polygon soup takes {soup} times as long. See [the '
            'report](docs/results/bench_exact.md).')


def mlp() -> str:
    """Return the batch and the point's p99 of each network by set, and how far `mlp` is off."""
    body = []
    found = {row['set']: row for row in searched() if row['quantity'] == 'point'}
    for name, words in SETS.items():
        errors = {row['quantity']: row
                  for row in rows('accuracy.csv', model='mlp', set=name, part='all')}
        line = [words]
        for model in MLP_SIZES:
            point, = by_point(model, name).values()
            line.append(f'{by_exact(model, name, "batch")}, {float(point["point_p99"]):.2g}')
        worst = cell(found[name], 'worst', digits=2) if name in found else '–'
        body.append([*line, f'{cell(errors["point"], "worst", digits=2)}, {worst}',
                     ', '.join(cell(errors[quantity], 'p99', digits=2)
                               for quantity in ('volume', 'covariance'))])
    return markdown_table(['Set', *(f'`{model}`' for model in MLP_SIZES),
                           'worst', 'volume, covariance'], body)


def mlp_promise() -> str:
    """Return within what errors of `mlp` are in the worst pose set, as comment lines of C++."""
    def most(quantity: str) -> str:
        worst = max(float(row['p99']) for row in rows(
            'accuracy.csv', model='mlp', part='all', quantity=quantity)
            if not row['set'].endswith(UNSEARCHED))
        unit = 10.0 ** (math.floor(math.log10(worst)) - 1)  # of the second digit
        return f'{math.ceil(worst / unit) * unit:.2g} %'

    return textwrap.fill(
        'In 99 of 100 contacts, even of the pose set where it is worst, the error of model `mlp` '
        f"is at most {most('point')} of the smaller box's longest edge for the point, "
        f"{most('volume')} for the volume, and {most('covariance')} of the trace for the "
        'covariance.', 94, initial_indent='// ', subsequent_indent='// ')


def unsettled(way: str) -> int:
    """Return how many scenes of stacks.csv never rest, or fall, by a timing."""
    best = {row['scene']: row for row in rows('stacks.csv', way='1 ms, each step')}
    return sum(not stacks_picture.cell(row, best[row['scene']])[0].endswith(' s')
               for row in rows('stacks.csv', way=way))


def placed() -> str:
    """Return the time of a batch of `mlp` on goods as placed, divided by that of `exact`."""
    ratios = sorted(float(row['by_exact']) for row in rows('native.csv', set='as placed')
                    if row['contestant'] in ('mlp volume, batch', 'mlp covariance, batch'))
    return f'{ratios[0]:.2g} to {ratios[-1]:.2g}'


def slowest(model: str, column: str = 'slowest_ns') -> str:
    """Return the time of the slowest contact of a model from C, of all sets [ns]."""
    found = rows('native.csv', contestant=f'{model} covariance, each contact',
                 instruction_set=next(iter(SHOWN)))
    return f'{max(float(row[column]) for row in found):,.0f}'


MLP_SIZES = ('mlp-16-16', 'mlp', 'mlp-32-32')


def batches() -> str:
    """Return the range of the times of a batch of `mlp`, relative to `exact`."""
    found = sorted(by_exact('mlp', of_set, 'batch') for of_set in SETS)
    return f'{found[0]} to {found[-1]}'


def searched() -> list[Row]:
    """Return the rows of the search for the worst, but for those of steps alone."""
    return [row for row in rows('searched.csv') if row['worst']]


def worst_point(file: str, column: str, **wanted: str) -> str:
    """Return the largest error of the point of `mlp` in a column [%]."""
    worst = max(rows(file, **wanted), key=lambda row: float(row[column] or 0))
    return cell(worst, column, digits=2)


def reading() -> str:
    """Return the time to read a box of the largest scene file [ms]."""
    row = max(rows('scenes.csv', scene=''), key=lambda row: int(row['boxes']))
    return number(1e3 * float(row['reading']) / int(row['boxes']), 1)


TABLES = {'models': models, 'bench': bench, 'mlp': mlp}
FIGURES = {
    'late': lambda: f'{unsettled(LATE)} of {len(rows("stacks.csv", way=LATE))}',
    'late-own': lambda: str(unsettled(f'{LATE}, 5 % lost, own contacts')),
    'mlp-placed': placed,
    'mlp-settled': lambda: worst_point('accuracy.csv', 'worst', model='mlp', set='settled',
                                       part='all', quantity='point'),
    'mlp-batch': batches,
    'mlp-slowest': lambda: slowest('mlp'),
    'exact-slowest': lambda: slowest('exact'),
    'mlp-through': lambda: worst_point('accuracy.csv', 'worst', model='mlp', part='all',
                                       set='plates through each other', quantity='point'),
    'mlp-outside': lambda: cell(rows('accuracy.csv', model='mlp', part='all', quantity='point',
                                     set='plates through each other')[0], 'outside', digits=2),
    'mlp-worst': lambda: worst_point('searched.csv', 'worst', quantity='point'),
    'mlp-step': lambda: worst_point('searched.csv', 'step', quantity='point'),
    'search-minutes': lambda: f'{sum(float(row["seconds"]) for row in searched()) / 60:.0f}',
    'reading': reading,
}


def filled(text: str) -> str:
    """Return a page with its tables and figures made from the CSV files."""
    text = FIGURE.sub(lambda found: f'{found[1]}{FIGURES[found[2]]()}{found[3]}', text)
    return BLOCK.sub(lambda found: f'{found[1]}\n{TABLES[found[2]]()}\n\n{found[3]}', text)


def promised(text: str) -> str:
    """Return the C++ header with the errors of `mlp` from the CSV file; it must name them once."""
    made, count = PROMISE.subn(lambda _: mlp_promise(), text)
    if count != 1:
        raise ValueError(f'{HEADER.name} says {count} times how far `mlp` is off, not once')
    return made


def main() -> int:
    """Rewrite the pages, or with `--check` report which would change; 1 where one would."""
    parser = argparse.ArgumentParser(description='Fill the tables of README.md and docs/ with the '
                                                 'figures of docs/results/*.csv.')
    parser.add_argument('--check', action='store_true',
                        help='change nothing, and name the pages whose tables are out of date')
    options = parser.parse_args()
    changed = False
    for page in (*PAGES, HEADER):
        text = page.read_text('utf-8')
        made = promised(text) if page == HEADER else filled(text)
        if made != text:
            changed = True
            print(f'{page.relative_to(ROOT)}: {"out of date" if options.check else "renewed"}')
            if not options.check:
                page.write_text(made, 'utf-8')
    return int(changed and options.check)


if __name__ == '__main__':
    sys.exit(main())

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fill the tables of the README and of docs/ with the figures of docs/results/*.csv.

`python docs/tables.py` rewrites each page that has a table between `<!-- table NAME -->` and
`<!-- end of table -->`. `--check` only reports pages whose tables are not those of the CSV files.
"""
from __future__ import annotations

import argparse
import functools
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT))  # where benchmarks/ is, which is not installed

from benchmarks.output import markdown_table, number, read_csv  # noqa: E402

RESULTS = ROOT / 'docs' / 'results'
PAGES = [ROOT / 'README.md', *sorted((ROOT / 'docs').rglob('*.md'))]
BLOCK = re.compile(r'(<!-- table ([\w-]+) -->\n).*?(<!-- end of table -->)', re.DOTALL)

Row = dict[str, str]

CHOICES = {
    'exact': '`exact`, the default',
    'mlp': '`mlp`, the network',
    'mujoco': 'MuJoCo, deepest corner',
}
MEASURED_AS = {'mujoco': {'contestant': 'MuJoCo mj_collision', 'point': 'deepest'}}
"""Rows of the frontier for a contestant that is measured by its library's own call."""
SHOWN = ('AVX-512', 'AVX2')  # instruction sets, the README's first
CONTAINER = 12_192.0  # longest edge [mm]
SETS = {
    'landings': 'containers that land on each other',
    'settled': 'goods at rest',
    'stacks': 'stacks, tilt 1e-6–1e-3 rad',
    'parcels': 'parcels on each other at any yaw',
    'random cubes': 'cubes in any pose, 0.1–10 % deep',
    'random sizes': 'random pairs of sizes, to 1:20',
    'containers': '40 ft containers, 5° sway',
}


_table = functools.cache(read_csv)


def rows(file: str, **wanted: str) -> list[Row]:
    """Return the rows of a CSV file whose columns have the wanted values."""
    return [row for row in _table(RESULTS / file)
            if all(row[column] == value for column, value in wanted.items())]


def cell(row: Row, column: str, unit: float = 1.0, digits: int = 3) -> str:
    """Return a number of a CSV row in a unit, to so many digits; a dash where it is empty."""
    return number(float(f'{float(row[column] or "nan") / unit:.{digits}g}'), digits)


def models() -> str:
    """Return how far each model is off on containers, what it costs, and where `mlp` lost."""
    body = []
    for model, name in CHOICES.items():
        measured = rows('frontier.csv', set='containers', **{'class': 'all'},
                        **MEASURED_AS.get(model, {'contestant': model}))
        by_set = {row['instruction_set']: row for row in measured}
        shown = next((by_set[each] for each in SHOWN if each in by_set), measured[0])
        # A number stands in one table: that of 100,000 pairs, where the model has one.
        errors = rows('accuracy.csv', model=model, set='containers', part='all', quantity='point')
        judged, prefix = (errors[0], '') if errors else (shown, 'point_')
        body.append([name, *(cell(judged, f'{prefix}{column}', 100.0 / CONTAINER, digits=2)
                             for column in ('p50', 'p99')),
                     cell(shown, 'call_p50', 1e3), cell(shown, 'batch_p50', 1e3)])
    table = markdown_table(
        ['Model', 'half of the points within [mm]', '99 % within [mm]', 'a call [µs]',
         'a million pairs [s]'], body)
    return (f'{table}\n\nMedian times on one core with {SHOWN[0]}, called from Python: '
            f'{processor()}. {hot_calls()}\n\n{network_by_exact()}')


def hot_calls() -> str:
    """Return what other work between two calls does to them, from the speed report."""
    exact = rows('speed_cold.csv', name='exact')[-1]
    return (f'Calls run one after another: after work that touches {float(exact["megabytes"]):g} '
            f'MB, a call of `exact` takes {cell(exact, "call_p50", 1e3, digits=2)} µs, '
            f'{cell(exact, "call_by_unit", digits=2)} of `mj_geomDistance` '
            '([Speed](docs/results/speed.md)).')


def network_by_exact() -> str:
    """Return the times of `mlp` relative to `exact` on containers, by instruction set."""
    by_set = {row['instruction_set']: row for row in rows(
        'frontier.csv', set='containers', contestant='mlp', **{'class': 'all'})}
    ratios = [(name, by_set[name]) for name in SHOWN if name in by_set]
    lost = all(float(row[column]) > 1.0 for _, row in ratios
               for column in ('call_by_exact', 'batch_by_exact'))
    words = '; '.join(f'{cell(row, "call_by_exact")} per call and {cell(row, "batch_by_exact")} '
                      f'in a batch with {name}' for name, row in ratios)
    return (f'{"On these poses, the network lost. It" if lost else "The network"} has an error. '
            f'Its time divided by that of `exact` is {words}.')


def processor() -> str:
    """Return the processor of the frontier's run, with its generation."""
    return rows('frontier.csv', contestant='exact')[0]['processor']


def mlp_errors() -> str:
    """Return the errors of `mlp` by pose set: point, volume, covariance."""
    body = []
    for name, words in SETS.items():
        errors = {row['quantity']: row
                  for row in rows('accuracy.csv', model='mlp', set=name, part='all')}
        body.append([words, cell(errors['point'], 'p99', digits=2),
                     cell(errors['point'], 'worst', digits=2),
                     cell(errors['volume'], 'p99', digits=2),
                     cell(errors['covariance'], 'p99', digits=2)])
    return markdown_table(['Set', 'point: p99', 'worst', 'volume: p99', 'covariance: p99'], body)


TABLES = {'models': models, 'mlp-errors': mlp_errors}


def filled(text: str) -> str:
    """Return a page with its tables made from the CSV files."""
    return BLOCK.sub(lambda found: f'{found[1]}\n{TABLES[found[2]]()}\n\n{found[3]}', text)


def main() -> int:
    """Rewrite the pages, or with `--check` report which would change; 1 where one would."""
    parser = argparse.ArgumentParser(description='Fill the tables of README.md and docs/ with the '
                                                 'figures of docs/results/*.csv.')
    parser.add_argument('--check', action='store_true',
                        help='change nothing, and name the pages whose tables are out of date')
    options = parser.parse_args()
    changed = False
    for page in PAGES:
        text = page.read_text('utf-8')
        made = filled(text)
        if made != text:
            changed = True
            print(f'{page.relative_to(ROOT)}: {"out of date" if options.check else "renewed"}')
            if not options.check:
                page.write_text(made, 'utf-8')
    return int(changed and options.check)


if __name__ == '__main__':
    sys.exit(main())

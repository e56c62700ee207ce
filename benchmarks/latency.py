# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page of latencies: solver, nodes and transport, from the CSVs of three other reports."""
from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from . import output

RUNS = {'node alone, 1 kHz': '1000-in-turn', 'side by side, 200 Hz': '200-side-by-side',
        'side by side, 1 kHz': '1000-side-by-side'}
"""Folders of the bench by load."""
NODES = {'contact': 'contact node', 'soup': 'soup node', 'echo': 'echo node'}
SOLVERS = ('mlp', 'exact')

Row = list[str]


def solver_rows(rows: list[dict[str, str]]) -> Iterator[Row]:
    """Yield single calls of the models, by instruction set."""
    times = defaultdict(list)
    for row in rows:
        if row['kind'] == 'single' and row['name'] in SOLVERS:
            times[row['instruction_set'], row['name']].append(1e-3 * float(row['ns']))
    for (instruction_set, name), found in times.items():
        yield [f'solver, `{name}`', instruction_set, '', '',
               *(output.number(value) for value in output.percentiles(found, 50, 99))]


def node_rows(load: str, rows: list[dict[str, str]]) -> Iterator[Row]:
    """Yield a row for each node of a run of the bench."""
    for node, name in NODES.items():
        mine = [row for row in rows if row['node'] == node]
        if mine:
            sums = (sum(int(row[count]) for row in mine) for count in ('sent', 'lost'))
            medians = (_median(mine, f'latency_{part} [s]') for part in ('p50', 'p99'))
            yield [name, load, *(f'{count:,}' for count in sums), *map(output.number, medians)]


def _median(rows: list[dict[str, str]], column: str) -> float:
    """Return the median [µs] of a column [s] over streams."""
    found = [1e6 * float(row[column]) for row in rows if row[column]]
    return float(np.median(found)) if found else float('nan')


def page(folder: Path) -> str:
    """Return the page from the CSVs of a folder; runs that it lacks are left out."""
    rows, machine = [], 'no machine'
    if (folder / 'speed.csv').exists():
        rows += solver_rows(output.read_csv(folder / 'speed.csv'))
    for load, name in RUNS.items():
        path = folder / 'bench' / name / 'bench.csv'
        if path.exists():
            run = output.read_csv(path)
            machine = run[0]['machine']
            rows += node_rows(load, run)
    head = ['what', 'load, or instruction set', 'sent', 'lost', 'p50 [µs]', 'p99 [µs]']
    return output.page('benchmarks/pages/latency', machine=machine,
                       table=output.markdown_table(head, rows, words=2))


def write_page(folder: Path) -> None:
    """Write latency.md."""
    (folder / 'latency.md').write_text(page(folder), 'utf-8')

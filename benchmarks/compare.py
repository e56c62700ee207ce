# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ratios of times in two folders of results: whether a second run agrees with the first.

Only ratios within a run are compared: absolute times depend on the machine and on its hour. Each
is the median over the rounds or blocks of a CSV file of their own ratios.
"""
from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from . import output
from .speed import SHARED, UNIT
from .timing import by_round

LIMIT = 0.10  # largest change of a ratio, of the smaller value, between runs that agree
SHOWN = 12  # largest changes in the table


@dataclass(frozen=True, kw_only=True)
class Ratios:
    """Ratios that a page prints: times of all rows by those of one."""

    files: str  # pattern below the folder of results
    rows: Mapping[str, tuple[str, ...]] = field(default_factory=dict)  # values of those that count
    within: tuple[str, ...] = ()  # columns that both rows of a ratio share
    of: tuple[str, ...]  # columns that tell the rows apart
    by: tuple[str, ...]  # their values in the row that divides
    times: tuple[str, ...] = ()  # columns of times
    ratios: tuple[str, ...] = ()  # columns of ratios by that row already


_LATENCIES = ('latency_p50 [s]', 'latency_p99 [s]')
PRINTED = (
    Ratios(files='speed.csv', rows={'kind': ('single', 'batch')}, within=('instruction_set',),
           of=('name', 'kind'), by=(UNIT, 'single'), times=('ns',)),
    Ratios(files='speed.csv', rows={'kind': SHARED}, within=('name',), of=('kind',),
           by=SHARED[:1], times=('ns',)),
    Ratios(files='frontier.csv', within=('set', 'instruction_set'), of=('contestant',),
           by=('exact',), ratios=('call_by_exact', 'batch_by_exact')),
    Ratios(files='soak.csv', of=('node',), by=('echo',), times=_LATENCIES),
    Ratios(files='soak.csv', of=('node',), by=('bare echo',), times=_LATENCIES),
)


def ratios_of(folder: Path) -> dict[str, float]:
    """Return all ratios of a folder of results, by a name that another run's has too."""
    found = {}
    for printed in PRINTED:
        for path in sorted(folder.glob(printed.files)):
            rows = [row for row in output.read_csv(path)
                    if all(row[column] in wanted for column, wanted in printed.rows.items())]
            for column in (*printed.times, *printed.ratios):
                values = defaultdict(list)
                for row in rows:
                    if row[column]:
                        key = tuple(row[name] for name in (*printed.within, *printed.of))
                        values[key].append(float(row[column]))
                for key, mine in values.items():
                    unit = values.get((*key[:len(printed.within)], *printed.by))
                    if unit and key[len(printed.within):] != printed.by:
                        words = ', '.join([str(path.relative_to(folder)), *key, column])
                        found[f'{words}, by {printed.by[0]}'] = float(
                            np.median(mine) if column in printed.ratios else _ratio(mine, unit))
    return found


def _ratio(times: list[float], units: list[float]) -> float:
    """Return the median ratio of times that belong together; of others, that of their medians."""
    if len(times) == len(units):
        return by_round(times, units)
    return np.median(times) / np.median(units)


def compare(first: Path, second: Path) -> int:
    """Print what differs most; return 1 if a ratio differs by over LIMIT, or none is shared."""
    before, after = ratios_of(first), ratios_of(second)
    changes = {name: max(before[name], after[name]) / min(before[name], after[name]) - 1.0
               for name in before.keys() & after.keys()}
    largest = sorted(changes, key=lambda name: (-changes[name], name))[:SHOWN]
    print(output.markdown_table(
        ['ratio', str(first), str(second), 'change [%]'],
        [[name, f'{before[name]:.3g}', f'{after[name]:.3g}', f'{100.0 * changes[name]:.1f}']
         for name in largest], padded=True))
    over = sum(change > LIMIT for change in changes.values())
    alone = len(before.keys() ^ after.keys())
    print(f'\n{len(changes)} ratios, {over} changed by more than {100.0 * LIMIT:g} %; '
          f'{alone} in one folder alone')
    return int(over > 0 or not changes)

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The pictures of the report `stacks`: when each scene comes to rest, and what its time goes to."""
from __future__ import annotations

import math
import re
import textwrap
from pathlib import Path

import numpy as np

from . import output

FALLEN_DEG = 45.0  # a box that turned more fell
REST = ((0.1, '#1a9850'), (0.5, '#66bd63'), (2.0, '#a6d96a'), (math.inf, '#d9ef8b'))
"""Times by which a scene is at rest [s], and their colours."""
PARTS = {'pairs and contacts': '#e6146e', 'hold': '#9aa0a6', 'advance': '#4678aa'}
"""What a step's time goes to, and the colours."""
CREEPS, MOVES, FELL = '#fee08b', '#f46d43', '#a50026'
CREEP = 10.0  # the fastest corner of a scene that creeps [mm/s]


def cell(row: dict[str, str], best: dict[str, str]) -> tuple[str, str]:
    """Return text and colour of a run; best: the same scene with answers at each step of 1 ms."""
    if float(row['turned']) > FALLEN_DEG > float(best['turned']):
        return 'fell', FELL
    if row['rest']:
        rest = float(row['rest'])
        return f'{rest:.2g} s', next(colour for most, colour in REST if rest <= most)
    speed = 1e3 * float(row['end_speed'])
    return f'{output.number(speed, 2)} mm/s', CREEPS if speed <= CREEP else MOVES


def draw(path: Path, table: Path) -> None:
    """Draw the map from the CSV: a row per scene, a column per timing, then MuJoCo's."""
    from matplotlib.patches import Patch

    runs: dict[str, dict[str, dict[str, str]]] = {}
    for row in output.read_csv(table):
        runs.setdefault(row['scene'], {})[row['way']] = row
    ways = list(next(iter(runs.values())))
    cells = [[cell(of_scene[way], of_scene[ways[0]]) for way in ways]
             for of_scene in runs.values()]
    figure, axes = output.subplots(1, 1, (11.6, 1.9 + 0.23 * len(runs)))
    axis = axes[0, 0]
    for place, line in enumerate(cells):
        for column, (text, colour) in enumerate(line):
            axis.barh(place, 1.0, left=column - 0.5, height=1.0, color=colour, edgecolor='white')
            axis.text(column, place, text, ha='center', va='center', fontsize=8,
                      color='white' if colour in (FELL, REST[0][1]) else 'black')
    names = [re.sub(r'(?<=\d) ', '\N{NO-BREAK SPACE}', way) for way in ways]
    axis.set_xticks(range(len(ways)), [textwrap.fill(name, 12) for name in names], fontsize=8)
    axis.xaxis.tick_top()
    axis.set_yticks(range(len(runs)), runs, fontsize=8)
    axis.set(xlim=(-0.5, len(ways) - 0.5), ylim=(len(runs) - 0.5, -0.5))
    axis.tick_params(length=0)
    axis.spines[:].set_visible(False)
    at_rest = {way: sum(bool(of_scene[way]['rest']) for of_scene in runs.values()) for way in ways}
    theirs = [str(count) for way, count in at_rest.items() if way.startswith('MuJoCo')]
    axis.set_title(f'Of {len(runs)} scenes, {at_rest[ways[0]]} come to rest with answers at each '
                   f'step of 1 ms; by MuJoCo {", ".join(theirs)}', fontsize=10)
    bounds = [f'at rest by {most:g} s' for most, _ in REST[:-1]] + ['later']
    figure.legend(
        handles=[Patch(color=colour, label=label) for label, colour in (
            *zip(bounds, (colour for _, colour in REST)), (f'up to {CREEP:g} mm/s', CREEPS),
            ('faster', MOVES), ('fell', FELL))],
        loc='outside lower center', ncols=7, fontsize=8, frameon=False)
    figure.savefig(path, metadata={'Software': None})


def draw_parts(path: Path, table: Path) -> None:
    """Draw what of a step's time goes to each part, from the CSV: a bar per scene, at 1 ms."""
    first, *_ = rows = output.read_csv(table)
    chosen = [row for row in rows if row['way'] == first['way']]
    cost, contacts, hold = (np.array([float(row[column]) for row in chosen])
                            for column in ('cost', 'contacts', 'hold'))
    shares = 100.0 * np.array([contacts, hold, cost - contacts - hold]) / cost
    figure, axes = output.subplots(1, 1, (8.0, 1.4 + 0.2 * len(chosen)))
    axis, before = axes[0, 0], np.zeros(len(chosen))
    for share, (label, colour) in zip(shares, PARTS.items()):
        axis.barh(range(len(chosen)), share, left=before, color=colour, label=label)
        before += share
    for place, time in enumerate(cost):
        axis.text(101.0, place, f'{output.number(time, 3)} µs', va='center', fontsize=8)
    axis.set_yticks(range(len(chosen)), [row['scene'] for row in chosen], fontsize=8)
    axis.set(xlim=(0.0, 100.0), ylim=(len(chosen) - 0.4, -0.6),
             xlabel="of a step's time [%], called from Python; NumPy searches for pairs")
    axis.spines[['top', 'right']].set_visible(False)
    asked, _, advanced = np.median(shares, axis=1)
    axis.set_title(f'Pairs and contacts take {asked:.0f} % of a step in the median scene, and '
                   f'forces {advanced:.0f} %', fontsize=10)
    figure.legend(loc='outside lower center', ncols=len(PARTS), fontsize=8, frameon=False)
    figure.savefig(path, metadata={'Software': None})

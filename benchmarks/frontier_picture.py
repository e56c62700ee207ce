# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The picture of `frontier`: point error over the time of a call, for five contestants.

It is drawn from frontier.csv, which has all of them:
`python -m benchmarks.frontier_picture frontier.csv frontier.png`.
"""
from __future__ import annotations

import csv
import math
import sys
from pathlib import Path

from . import output

SHOWN_SET, EDGE = 'containers', 12.192e3
"""The set of poses that is drawn, and its longest edge [mm], which errors are a share of."""
SHOWN = {'exact': ('exact', 'C0'), 'mlp': ('mlp', 'C0'),
         'paper': ("the paper's network", 'C4'), 'soup-8': ('polygon soup, N = 8', 'C5'),
         'MuJoCo mj_collision': ('MuJoCo, best of its points', 'C1')}
"""Contestant: how the picture calls it, and its colour."""
ERRORS = (0.1, 1e4)
"""Errors that are drawn to scale [mm]; 0 has a band of its own below."""
TIMES = (0.3, 2e4)
"""Times that the picture shows [µs]: names stand on the right of their points."""


def shown_points(table: Path) -> dict[str, tuple[float, float]]:
    """Return the time of a call [µs] and the p99 point error [mm] of each contestant of a CSV.

    An engine with several ways to make one point has the best of them. Models have the fastest
    instruction set, whose rows come first.
    """
    found: dict[str, tuple[float, float]] = {}
    with table.open(newline='', encoding='utf-8') as file:
        for row in csv.DictReader(file):
            if row['set'] == SHOWN_SET and row['class'] == 'all' and row['contestant'] in SHOWN:
                time, error = float(row['call_p50']) / 1e3, float(row['point_p99']) * EDGE / 100.0
                before = found.get(row['contestant'], (time, math.inf))
                found[row['contestant']] = before[0], min(before[1], error)
    return found


def draw(path: Path, table: Path) -> None:
    """Draw what `shown_points` finds in a CSV."""
    figure = output.figure((6.4, 4.2))
    axis = figure.subplots()
    height = output.log_errors(axis, *ERRORS)
    axis.set_xscale('log')
    axis.xaxis.set_major_formatter('{x:g}')
    axis.set(xlim=TIMES, xlabel='time of a call from Python [µs]',
             ylabel='point error, p99 [mm]',
             title='A 12 m container on another: error and time')
    for name, (time, error) in shown_points(table).items():
        label, colour = SHOWN[name]
        axis.plot(time, height(error), 'o', color=colour, markersize=8)
        axis.annotate(label, (time, height(error)), xytext=(9, 0), textcoords='offset points',
                      va='center', color=colour, fontsize=11)
    figure.savefig(path, metadata={'Software': None})


if __name__ == '__main__':
    draw(Path(sys.argv[2]), Path(sys.argv[1]))

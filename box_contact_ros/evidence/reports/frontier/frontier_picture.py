# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The picture of `frontier`: point error over time of single calls, of batches, and the paper's."""
from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from box_contact_ros import output
from box_contact_ros.solver.models import models_with_patch

from ..paper.paper_tables import PAPER_NETWORK, PAPER_SOUP
from .trials import FrontierRow

SHOWN_SET = 'containers'
ERRORS = (0.1, 100.0)
"""Errors that are drawn to scale [%]; 0 has a band of its own below."""
PAPER_ERROR = 34.0
"""The paper's MAE of 0.5624 rad in % of an edge. Seen from 1.2 m, the mean distance of a touching
cube's surface, the MAE is a point error of 0.67 m, a third of the edge of 2 m."""
GROUPS = {'this package': ('C0', 'o', ('exact', 'mlp')),
          'the paper: network': ('C4', 'X', ('paper',)), 'the paper: soup': ('C5', 'D', ('soup',)),
          'FCL, Coal': ('C2', 's', ('fcl', 'python', 'Coal')),
          'MuJoCo': ('C1', '^', ('MuJoCo',)), 'Bullet': ('C3', 'v', ('PyBullet',)),
          'Drake': ('C6', 'P', ('Drake',)), 'DART': ('C8', 'p', ('DART',)),
          'Rapier, Newton': ('C9', '<', ('Rapier', 'Newton')),
          'others': ('0.35', 'h', ('',))}
"""Colour, marker, and how names of the group begin; the first that fits."""
LEFT_OUT = ('paper-continuous', *(f'soup-{n}' for n in list(PAPER_SOUP)[1:-1]))


def group_of(name: str) -> str:
    """Return the group of a contestant."""
    return next(group for group, (*_, starts) in GROUPS.items() if name.startswith(starts))


def draw(path: Path, rows: Sequence[FrontierRow]) -> None:
    """Draw point error (p99) over time on one set: single calls, batches, the paper's figures."""
    figure = output.figure((8.0, 9.6), layout=None)
    single = figure.add_axes((0.13, 0.49, 0.53, 0.47))
    batch = figure.add_axes((0.13, 0.1, 0.29, 0.3))
    shown = [row for row in rows if row.set == SHOWN_SET and row.errors.points
             and row.name not in LEFT_OUT]
    _points(single, [(row.single[0] / 1e3, row) for row in shown])
    _points(batch, [(row.batch / 1e3, row) for row in shown])
    single.set(title=f'A single call from Python, {SHOWN_SET}', xlabel='time [µs]')
    batch.set(title=f'A pair in a batch, one core, {SHOWN_SET}', xlabel='time [µs]')
    for axis in (single, batch):
        axis.set_ylabel('point error, p99 [% of the edge]')
    _the_papers(figure.add_axes((0.76, 0.1, 0.21, 0.3)))
    handles = {group: single.plot([], [], marker, color=colour)[0]
               for group, (colour, marker, _) in GROUPS.items()
               if group in map(group_of, (row.name for row in shown))}
    figure.legend(handles.values(), handles, loc='lower center', ncols=7, fontsize=8,
                  handletextpad=0.1)
    figure.savefig(path)


def _points(axis: Any, found: Sequence[tuple[float, FrontierRow]]) -> None:
    """Draw times and errors with their names in a column next to them, and the frontier."""
    height = output.log_errors(axis, *ERRORS)
    axis.set_xscale('log')
    points = [(time, height(row.errors.points['all'][2]), row) for time, row in found
              if not math.isnan(time)]
    for time, error, row in points:
        colour, marker, _ = GROUPS[group_of(row.name)]
        axis.plot(time, error, marker, color=colour, markersize=6)
    line = [(time, error) for time, error, _ in points]
    axis.step(*zip(*(line[place] for place in output.pareto(line))), where='post', color='0.4',
              linewidth=1.0, zorder=0)
    output.name_points(axis, [(time, error, _label(row), GROUPS[group_of(row.name)][0])
                              for time, error, row in points])


def _label(row: FrontierRow) -> str:
    parts = [row.name.removeprefix('MuJoCo ').removeprefix('PyBullet ')]
    if row.name in models_with_patch():
        parts.append(row.instruction_set)
    if len(row.choices) > 1:
        parts.append(row.best)
    return ', '.join(parts)


def _the_papers(axis: Any) -> None:
    """Draw the paper's own figures, of a computer of 2003."""
    height = output.log_errors(axis, *ERRORS, zero='no error\ngiven')
    axis.plot(PAPER_NETWORK, PAPER_ERROR, '*', color='C4', markersize=12)
    axis.annotate('network', (PAPER_NETWORK, PAPER_ERROR), xytext=(8, -3),
                  textcoords='offset points', fontsize=8)
    times = [PAPER_SOUP[n][0] for n in PAPER_SOUP]
    axis.plot(times, [height(0.0)] * len(times), 'D-', color='C5', markersize=4)
    axis.annotate(f'soup, N = {min(PAPER_SOUP)} to {max(PAPER_SOUP)}', (times[0], height(0.0)),
                  xytext=(0, 10), textcoords='offset points', fontsize=8)
    axis.set(title='The paper, 2003', xlabel='time [ms]', xlim=(0.0, 3.4))

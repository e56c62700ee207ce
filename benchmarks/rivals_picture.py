# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The picture of `rivals`: a map of scenes and engines, and the times of a step beside ours."""
from __future__ import annotations

import math
from pathlib import Path

from . import output

STATES = {'moving': 'moving', 'awake': 'at rest, awake', 'asleep': 'asleep'}
"""Columns of stacks_rivals.csv, and their words."""
RATIOS = ((0.5, '#b2182b'), (0.9, '#f4a582'), (1.1, '#f7f7f7'), (2.0, '#a6d96a'),
          (10.0, '#66bd63'), (math.inf, '#1a9850'))
"""Bounds of a time relative to ours, and their colours: the first where ours is the slowest."""
UNKNOWN = '#dddddd'


def cell(time: str, ours: str) -> tuple[str, str]:
    """Return text and colour of a time of a step [µs] beside ours."""
    if not time or not ours:
        return '–', UNKNOWN
    ratio = float(time) / float(ours)
    return (f'{output.number(float(time))}\n× {output.number(ratio, 2)}',
            next(colour for most, colour in RATIOS if ratio <= most))


def title(by_scene: dict[str, dict[str, dict[str, str]]]) -> str:
    """Return what the map says: how long ours takes awake, beside the first rival."""
    ours, *others = next(iter(by_scene.values())).values()
    rival = next(row for row in others if not row['engine'].startswith(ours['engine']))
    pairs = [(engines[ours['engine']][state], engines[rival['engine']][state])
             for engines in by_scene.values() for state in ('moving', 'awake')]
    ratios = [float(mine) / float(theirs) for mine, theirs in pairs if mine and theirs]
    least, most = (output.number(ratio, 2) for ratio in (min(ratios), max(ratios)))
    mine, theirs = (f'{row["engine"]} ({row["numbers"]})' for row in (ours, rival))
    return (f'Awake, a step of {mine} takes {least} to {most} times as long as one of {theirs}.\n'
            'Green: it is faster than the engine of the column; red: slower.')


def draw(path: Path, table: Path) -> None:
    """Draw the map from the CSV: a row per scene and state, a column per engine, ours first."""
    from matplotlib.patches import Patch

    by_scene: dict[str, dict[str, dict[str, str]]] = {}
    for row in output.read_csv(table):
        by_scene.setdefault(row['scene'], {})[row['engine']] = row
    lines = [(scene, state) for scene in by_scene for state in STATES]
    names = list(next(iter(by_scene.values())))
    figure, axes = output.subplots(1, 1, (9.0, 1.6 + 0.36 * len(lines)))
    axis = axes[0, 0]
    for place, (scene, state) in enumerate(lines):
        engines = by_scene[scene]
        for column, name in enumerate(names):
            text, colour = cell(engines[name][state], engines[names[0]][state])
            axis.barh(place, 1.0, left=column - 0.5, height=1.0, color=colour, edgecolor='white')
            axis.text(column, place, text, ha='center', va='center', fontsize=7.5,
                      color='white' if colour in (RATIOS[0][1], RATIOS[-1][1]) else 'black')
    axis.set_xticks(range(len(names)), [name.replace(', ', ',\n') for name in names], fontsize=8)
    axis.xaxis.tick_top()
    axis.set_yticks(range(len(lines)), [f'{scene}, {STATES[state]}' for scene, state in lines],
                    fontsize=8)
    axis.set(xlim=(-0.5, len(names) - 0.5), ylim=(len(lines) - 0.5, -0.5))
    axis.tick_params(length=0)
    axis.spines[:].set_visible(False)
    axis.set_title(title(by_scene), fontsize=9.5)
    bounds = [f'up to {most:g}' for most, _ in RATIOS[:-1]] + ['more']
    figure.legend(handles=[Patch(facecolor=colour, edgecolor='0.8', label=label)
                           for label, (_, colour) in zip(bounds, RATIOS)],
                  title='Time of a step [µs], and × that of PatchForces', title_fontsize=8,
                  loc='outside lower center', ncols=6, fontsize=8, frameon=False)
    figure.savefig(path, metadata={'Software': None})

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Figure 4 of the source paper as a curve: a soup's box tests against the rotation.

A corner of one cube has sunk into the middle of another's top face. The less the cubes are turned
against each other, the longer is the outline of the part that has sunk in, and the more triangles
meet along it.
"""
from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from box_contact_ros.models import soup
from box_contact_ros.solver.pose import rotation_matrix

from .. import output
from ..pose_sets import CUBE, Pairs, on_cube, quaternion_multiply, turned
from ..timing import cpu_milliseconds, no_garbage_collection, pinned, usable_cores
from .soup_tables import PAPER, Row, pair_count
from .tree import count_tests, tree

DEPTH = 0.01  # of the corner [m]
SPIN = 20.0   # about the vertical [deg]: grids that line up would be a special case
TILTS = (1e-3, 1e-2, 0.03, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0,
         30.0, 40.0, 54.7)
"""Angles between the two faces [deg]; at the last one a diagonal of the cube is upright."""
DIVISIONS = (8, 14, 22)
QUICK_TILTS, QUICK_DIVISIONS = (0.1, 1.0, 10.0), (8,)
REPEATS = 5  # timings, of which the least counts


def tilted_cube(tilt: float) -> Pairs:
    """Return a cube with its lowest corner below the middle of another's top face."""
    turn = quaternion_multiply(turned((0, 0, 1), np.radians(SPIN)),
                               turned((1, -1, 0), np.radians(tilt)))
    signs = 2.0 * np.indices((2, 2, 2)).reshape(3, -1).T - 1.0
    corners = signs @ rotation_matrix(turn).T
    place = (0.0, 0.0, 0.5 * CUBE[2] - DEPTH) - corners[corners[:, 2].argmin()]
    return on_cube(np.concatenate([place, turn])[None])


def measure(*, quick: bool = False) -> list[Row]:
    """Return a row per angle and N: tests, pairs that meet, time of the soup [ms]."""
    rows: list[Row] = []
    with pinned({usable_cores()[-1]}), no_garbage_collection():
        for divisions in QUICK_DIVISIONS if quick else DIVISIONS:
            placer = soup.Soup(divisions)
            for tilt in QUICK_TILTS if quick else TILTS:
                pair = tilted_cube(tilt)
                placed = placer.place(pair.pose_a[0], pair.pose_b[0], CUBE, CUBE)
                steps = [cpu_milliseconds(soup.collide, *placed) for _ in range(REPEATS)]
                rows.append({
                    'divisions': divisions, 'tilt_deg': tilt,
                    'tests': int(count_tests(tree(divisions), pair)[0]),
                    'pairs': pair_count(steps[0][1]), 'step_ms': min(took for took, _ in steps)})
    return rows


def section(rows: Sequence[Row]) -> str:
    """Return the figure's caption, with a table of the ends."""
    chosen = []
    for divisions in dict.fromkeys(row['divisions'] for row in rows):
        mine = [row for row in rows if row['divisions'] == divisions]
        most, least = (end(mine, key=lambda row: row['tests']) for end in (max, min))
        steps = [row['step_ms'] for row in mine]
        chosen.append([divisions, *[f'{one["tests"]:,} at {one["tilt_deg"]:g}°' for one in (
            most, least)], f'{most["tests"] / least["tests"]:.1f}', f'{most["pairs"]:,}',
            f'{max(steps) / min(steps):.1f}', f'{PAPER[divisions][1]:,}'])
    table = output.markdown_table(
        ['N', 'most tests', 'fewest', 'ratio', 'of the most: triangles that meet',
         'longest step / shortest', 'paper, Table 4: most tests'], chosen, words=0)
    return output.page('benchmarks/paper/pages/figure_4',
                       table=table, depth=1e3 * DEPTH, spin=SPIN, low=min(TILTS), high=max(TILTS))


def draw(rows: Sequence[Row], path: Path) -> None:
    """Draw tests and triangles that meet against the angle."""
    picture, ((axes,),) = output.subplots(1, 1, (7.0, 4.6))
    for number, divisions in enumerate(dict.fromkeys(row['divisions'] for row in rows)):
        mine = [row for row in rows if row['divisions'] == divisions]
        for column, style, words in (('tests', '-o', 'box tests'),
                                     ('pairs', ':', 'triangles that meet')):
            axes.plot([row['tilt_deg'] for row in mine], [row[column] for row in mine], style,
                      color=f'C{number}', markersize=3.5, label=f'{words}, N = {divisions}')
    axes.set(xscale='log', yscale='log', xlabel='angle between the faces [°]',
             ylabel='box tests, and triangles that meet',
             title='The less two faces are turned, the more a soup has to test')
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter('{x:g}')
    axes.grid(color='0.9', linewidth=0.6)
    axes.set_axisbelow(True)
    picture.legend(loc='outside lower center', ncols=3, fontsize=9, frameon=False)
    picture.savefig(path)

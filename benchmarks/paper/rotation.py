# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Figure 4 of the source paper as a curve: a soup's tests of triangles against the rotation.

A corner of one cube has sunk into the middle of another's top face. The less the cubes are turned
against each other, the longer is the outline of the part that has sunk in, and the more triangles
meet along it. Only of faces in one plane do the triangles meet all over.

A tree of boxes tests two triangles where the boxes around them overlap. Counted are these pairs of
boxes, each around one triangle, by the separating-axis test. RAPID, which the paper uses, has the
same boxes as leaves, so the count does not depend on how a tree is built.
"""
from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from box_contact_ros.core import stages
from box_contact_ros.scene.pose import quaternion_multiply, rotation_matrix
from box_contact_ros.solver.paper import euler_angles
from box_contact_ros.soup import soup

from .. import output
from ..contestant import ours
from ..pose_sets import CUBE, Pairs, on_cube, turned
from ..timing import cpu_milliseconds, no_garbage_collection, pinned, usable_cores
from .dataset import quaternion_from_euler
from .soup_tables import PAPER, Row, pair_count, time_calls

DEPTH = 0.01  # of the corner [m]
SPIN = 20.0   # about the vertical [deg]: grids that line up would be a special case
TILTS = (1e-3, 1e-2, 0.03, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0,
         30.0, 40.0, 54.7)
"""Angles between the two faces [deg]; at the last one a diagonal of the cube is upright."""
DIVISIONS = (8, 14, 22)
QUICK_TILTS, QUICK_DIVISIONS = (0.1, 1.0, 10.0), (8,)
REPEATS = 5  # timings, of which the least counts
CALLS = 200  # of a network, timed together
THICKNESS = 1e-9  # of a box around a triangle [m]


class Leaves(NamedTuple):
    """The boxes around a cube's triangles, in its frame; a side lies along the longest edge."""

    centre: np.ndarray  # (n, 3) [m]
    quaternion: np.ndarray  # (n, 4) xyzw
    size: np.ndarray  # (n, 3) full extents [m]


def leaves(divisions: int) -> Leaves:
    """Return the boxes of a cube's soup of N divisions."""
    corners = soup.triangles(CUBE, divisions)
    edges = np.roll(corners, -1, axis=1) - corners
    rows = np.arange(len(corners))
    along = edges[rows, np.linalg.norm(edges, axis=2).argmax(axis=1)]
    across = np.cross(edges[:, 0], edges[:, 1])
    axes = np.stack([along, np.cross(across, along), across], axis=2)
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    reach = np.einsum('nkj,nji->nki', corners, axes)
    low, high = reach.min(axis=1), reach.max(axis=1)
    return Leaves(np.einsum('nji,ni->nj', axes, 0.5 * (low + high)),
                  quaternion_from_euler(euler_angles(axes)), high - low + THICKNESS)


def tilted_cube(tilt: float, depth: float = DEPTH) -> Pairs:
    """Return a cube with its lowest corner below the middle of another's top face."""
    turn = quaternion_multiply(turned((0, 0, 1), np.radians(SPIN)),
                               turned((1, -1, 0), np.radians(tilt)))
    signs = 2.0 * np.indices((2, 2, 2)).reshape(3, -1).T - 1.0
    corners = signs @ rotation_matrix(turn).T
    place = (0.0, 0.0, 0.5 * CUBE[2] - depth) - corners[corners[:, 2].argmin()]
    return on_cube(np.concatenate([place, turn])[None])


def count_tests(boxes: Leaves, pair: Pairs) -> int:
    """Return how many pairs of boxes overlap, each around a triangle of either cube."""
    placed = [Leaves(pose[0, :3] + boxes.centre @ rotation_matrix(pose[0, 3:]).T,
                     quaternion_multiply(np.tile(pose[0, 3:], (len(boxes.size), 1)),
                                         boxes.quaternion), boxes.size)
              for pose in (pair.pose_a, pair.pose_b)]
    radius = 0.5 * np.linalg.norm(boxes.size, axis=1)
    # The cubes meet at the upper one's lowest corner: the rest is told apart by its height.
    tops = [placed[0].centre[:, 2] + radius, placed[1].centre[:, 2] - radius]
    near = [np.flatnonzero(tops[0] > tops[1].min()), np.flatnonzero(tops[1] < tops[0].max())]
    count = 0
    for row in near[0]:
        apart = np.linalg.norm(placed[1].centre[near[1]] - placed[0].centre[row], axis=1)
        others = near[1][apart <= radius[row] + radius[near[1]]]
        if len(others):
            one = Leaves(*(np.repeat(part[row][None], len(others), axis=0) for part in placed[0]))
            two = Leaves(*(part[others] for part in placed[1]))
            count += int(stages(np.hstack(one[:2]), np.hstack(two[:2]), one.size, two.size,
                                names=('colliding',)).colliding.sum())
    return count


def measure(*, quick: bool = False) -> list[Row]:
    """Return a row per angle and N: tests, pairs that meet, times of soup and network [ms]."""
    rows: list[Row] = []
    network = ours('paper')
    with pinned({usable_cores()[-1]}), no_garbage_collection():
        for divisions in QUICK_DIVISIONS if quick else DIVISIONS:
            boxes, placer = leaves(divisions), soup.Soup(divisions)
            for tilt in QUICK_TILTS if quick else TILTS:
                pair = tilted_cube(tilt)
                placed = placer.place(pair.pose_a[0], pair.pose_b[0], CUBE, CUBE)
                many = pair.rows(np.zeros(CALLS, dtype=np.int64))
                steps = [cpu_milliseconds(soup.collide, *placed) for _ in range(REPEATS)]
                rows.append({
                    'divisions': divisions, 'tilt_deg': tilt, 'tests': count_tests(boxes, pair),
                    'pairs': pair_count(steps[0][1]), 'step_ms': min(took for took, _ in steps),
                    'network_ms': min(time_calls(network, many) for _ in range(REPEATS))})
    return rows


def section(rows: Sequence[Row]) -> str:
    """Return the figure's caption, with a table of the ends."""
    network = [row['network_ms'] for row in rows]
    chosen = []
    for divisions in dict.fromkeys(row['divisions'] for row in rows):
        mine = [row for row in rows if row['divisions'] == divisions]
        most, least = (end(mine, key=lambda row: row['tests']) for end in (max, min))
        steps = [row['step_ms'] for row in mine]
        flush = count_tests(leaves(divisions), tilted_cube(0.0, 0.0))
        chosen.append([divisions, *[f'{one["tests"]:,} at {one["tilt_deg"]:g}°' for one in (
            most, least)], f'{most["tests"] / least["tests"]:.0f}', f'{most["pairs"]:,}',
            f'{max(steps) / min(steps):.0f}', f'{flush:,}', f'{PAPER[divisions][1]:,}'])
    table = output.markdown_table(
        ['N', 'most tests', 'fewest', 'ratio', 'of the most: pairs that meet',
         'longest step / shortest', 'tests in one plane', 'paper: most tests'], chosen, words=0)
    return output.page('benchmarks/paper/pages/figure_4',
                       table=table, depth=1e3 * DEPTH, spin=SPIN,
                       network=1e3 * np.percentile(network, [0, 100]), low=min(TILTS),
                       high=max(TILTS))


def draw(rows: Sequence[Row], path: Path) -> None:
    """Draw tests and times against the angle."""
    picture, ((upper,), (lower,)) = output.subplots(2, 1, (8.0, 7.6), sharex=True)
    for number, divisions in enumerate(dict.fromkeys(row['divisions'] for row in rows)):
        mine = [row for row in rows if row['divisions'] == divisions]
        tilts = [row['tilt_deg'] for row in mine]
        for axes, column, style, words in ((upper, 'tests', '-o', 'tests'),
                                           (upper, 'pairs', ':', 'pairs that meet'),
                                           (lower, 'step_ms', '-o', 'soup')):
            axes.plot(tilts, [row[column] for row in mine], style, color=f'C{number}',
                      markersize=3.5, label=f'{words}, N = {divisions}')
    mine = rows[:len({row['tilt_deg'] for row in rows})]
    lower.plot([row['tilt_deg'] for row in mine], [row['network_ms'] for row in mine], '-s',
               color='black', markersize=3.5, label='call of model paper')
    upper.set(xscale='log', yscale='log', ylabel='pairs of triangles')
    lower.set(xscale='log', yscale='log', xlabel='angle between the faces [°]', ylabel='time [ms]')
    for axes in (upper, lower):
        axes.legend(fontsize=8.5, loc='upper left', bbox_to_anchor=(1.01, 1.0))
        axes.grid(color='0.9', which='both', linewidth=0.6)
        axes.set_axisbelow(True)
    picture.savefig(path)

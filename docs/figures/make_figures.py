# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Figures of the docs: `python docs/figures/make_figures.py [--out FOLDER]`."""
from __future__ import annotations

import argparse
import contextlib
import math
import runpy
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from box_contact_ros import (
    ContactSolver,
    SceneSolver,
    inspect_plan,
    read_plan,
    read_scene,
)
from box_contact_ros.extras import expect_extras
from box_contact_ros.solver.pose import rotation_matrix

expect_extras()
import matplotlib

matplotlib.use('Agg')  # before pyplot: no display is needed

from matplotlib import pyplot as plt
from matplotlib.colors import to_rgba

sys.path.append(str(Path(__file__).resolve().parents[2]))  # where benchmarks/ is, not installed
from benchmarks.contestant import CHOICES
from benchmarks.engines import mujoco_engines
from benchmarks.output import COLOURS
from benchmarks.paper.dataset import quaternion_from_euler

if TYPE_CHECKING:
    from mpl_toolkits.mplot3d import Axes3D

STACK, LOAD, OVERLAP, POINT, CORNER = '#8c8c8c', '#4477aa', '#ccbb44', '#222222', '#ee6677'
CONTAINER = (12.192, 2.438, 2.591)
DEPTHS = {0.05: '#222222', 0.5e-3: '#777777', 0.03e-3: '#aaaaaa'}
"""Depths of the lowest corner in the graph [m], from a hard landing to rest, and their colours."""
RIVAL_DEPTH = 0.5e-3  # at which MuJoCo's point is drawn [m]
LEAST_TILT = 1e-4  # up to which the axis is linear [°]


def clip(polygon: np.ndarray, direction: tuple[float, float], bound: float) -> np.ndarray:
    """Return the part of a polygon (n, 2) with direction · p ≤ bound."""
    kept = []
    excess = polygon @ np.array(direction) - bound
    for i, (p, e) in enumerate(zip(polygon, excess)):
        q, f = polygon[i - 1], excess[i - 1]
        if (e > 0) != (f > 0):
            kept.append(q + (p - q) * f / (f - e))
        if e <= 0:
            kept.append(p)
    return np.array(kept)


def area_centroid(polygon: np.ndarray) -> np.ndarray:
    """Centroid of the area of a polygon (n, 2)."""
    following = np.roll(polygon, -1, axis=0)
    doubled = polygon[:, 0] * following[:, 1] - following[:, 0] * polygon[:, 1]
    return ((polygon + following) * doubled[:, None]).sum(axis=0) / (3.0 * doubled.sum())


def sketch(axes: plt.Axes, tilt: float) -> None:
    """Return a load of 4 × 1, its lowest corner 0.35 below the stack's top, y = 0; tilt [rad]."""
    stack = np.array([(-2.0, -1.0), (2.0, -1.0), (2.0, 0.0), (-2.0, 0.0)])
    turn = np.array([[math.cos(tilt), -math.sin(tilt)], [math.sin(tilt), math.cos(tilt)]])
    load = np.array([(-1.9, -0.5), (1.9, -0.5), (1.9, 0.5), (-1.9, 0.5)]) @ turn.T
    load -= (0.0, load[:, 1].min() + 0.35)
    overlap = clip(clip(clip(load, (0, 1), 0.0), (1, 0), 2.0), (-1, 0), 2.0)
    centroid, deepest = area_centroid(overlap), load[np.argmin(load[:, 1])]
    axes.fill(*stack.T, facecolor='#e6e6e6', edgecolor=STACK)
    axes.fill(*load.T, facecolor='#4477aa22', edgecolor=LOAD)
    axes.fill(*overlap.T, facecolor=OVERLAP, edgecolor='none')
    axes.plot(*deepest, 'o', color=CORNER, markersize=7)
    axes.plot(*centroid, 'o', color=POINT, markersize=7)
    axes.annotate('', centroid - (0, 0.75), centroid,
                  arrowprops={'arrowstyle': '-|>', 'color': POINT, 'linewidth': 1.5})
    inner, outer = ('left', 'right') if centroid[0] < 0.0 else ('right', 'left')
    side = math.copysign(1.0, centroid[0])
    axes.text(centroid[0] - 0.12 * side, centroid[1] - 0.55, 'normal', ha=inner)
    axes.text(-1.9 * side, -0.9, 'B, the stack', ha=outer)
    beside = load.mean(axis=0) + turn @ (math.copysign(0.6, tilt), 0.0)
    axes.text(*beside, 'A, the load', ha='center', va='center', color=LOAD,
              rotation=math.degrees(tilt))
    axes.set(aspect='equal', xlim=(-2.3, 2.3), ylim=(-1.1, 1.6))
    axes.axis('off')


def mujoco_points(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the means (n, 3) by depth of MuJoCo's points, for containers at poses (n, 7)."""
    mujoco = mujoco_engines.collision('', mujoco_engines.box_geoms, '')
    ask = mujoco.boxes(np.array(CONTAINER), np.array(CONTAINER))
    answers = [mujoco.read(ask(*mujoco.at(*poses))) for poses in zip(a, b)]
    return np.array([CHOICES['mean by depth'](*answer) for answer in answers])


def slide(axes: plt.Axes) -> None:
    """Where a container on another has its contact point, over the tilt, at some depths."""
    length, _, height = CONTAINER
    half = np.concatenate([np.linspace(0.0, LEAST_TILT, 40), np.geomspace(LEAST_TILT, 1.5, 400)])
    degrees = np.concatenate([-half[::-1], half[1:]])
    tilts = np.radians(degrees)
    # Turned about y by t, the lowest corner is h/2 cos t + l/2 |sin t| below the centre.
    low = 0.5 * (height * np.cos(tilts) + length * np.abs(np.sin(tilts)))
    a = np.tile([0.0, 0, 0, 0, 0, 0, 1], (len(tilts), 1))
    for depth, colour in DEPTHS.items():
        b = np.zeros((len(tilts), 7))
        b[:, 2] = 0.5 * height - depth + low
        b[:, 4], b[:, 6] = np.sin(0.5 * tilts), np.cos(0.5 * tilts)
        found = ContactSolver(CONTAINER, CONTAINER).batch(a, b)
        axes.plot(degrees, found.point[:, 0], color=colour, linewidth=2,
                  label=f'centroid, {1e3 * depth:g} mm')
        if depth == RIVAL_DEPTH:
            rival = mujoco_points(a, b)[:, 0]
    axes.plot(degrees, rival, '--', color=COLOURS['MuJoCo'],
              label=f"MuJoCo's mean, {1e3 * RIVAL_DEPTH:g} mm")
    ends = np.sign(tilts) * 0.5 * length * np.cos(tilts) - 0.5 * height * np.sin(tilts)
    ends[tilts == 0.0] = np.nan
    axes.plot(degrees, ends, color=CORNER, linewidth=2)
    axes.text(-1.2e-4, 6.1, 'deepest corner', color=CORNER, fontsize=10, va='center', ha='right')
    axes.legend(title='at a depth of', title_fontsize=9, fontsize=8, handlelength=1.3,
                loc='lower right')
    # With this scale the axis has no kink where it turns from linear to logarithmic.
    axes.set_xscale('symlog', linthresh=LEAST_TILT, linscale=0.9 / math.log(10.0))
    axes.set(title='The deepest corner jumps by 12 m', xlim=(-1.5, 1.5), ylim=(-6.8, 6.8),
             xlabel=f'tilt of a container [°], log scale beyond {LEAST_TILT:.4f}°',
             ylabel='contact point along its length [m]')
    axes.set_xticks([-1, -0.01, -LEAST_TILT, 0, LEAST_TILT, 0.01, 1],
                    ['-1', '-0.01', '', '0', '', '0.01', '1'])
    axes.grid(color='#dddddd')
    axes.spines[['top', 'right']].set_visible(False)


def first_contact(folder: Path) -> None:
    """Draw first_contact.png by the example."""
    example = runpy.run_path(str(Path(__file__).parents[1] / 'examples' / 'draw_contact.py'))
    with contextlib.chdir(folder):
        example['main']()


def lift(folder: Path) -> None:
    """Draw lift.png: the distance of a load on two paths over a bay, and the first touch."""
    scene = read_scene(Path(__file__).parents[2] / 'config' / 'scenes' / 'yard_bay.yaml')
    solver, by_tick = SceneSolver(scene), SceneSolver(scene, margin=30.0)
    figure, axes = plt.subplots(figsize=(6.4, 2.8), dpi=110, layout='constrained')
    for top, colour in ((14.0, CORNER), (15.0, LOAD)):
        way = np.array([(8.514, 9.0685), (8.514, top), (19.866, top), (19.866, 9.3)])
        pose = np.zeros((len(way), 1, 7))
        pose[:, 0, 1:3], pose[:, 0, 6] = way, 1.0
        answer = solver.check_path(pose)
        below = answer.at_start[0, 1]
        times = np.linspace(0.0, 3.0, 601)
        distances = []
        for y, z in zip(*(np.interp(times, range(4), column) for column in way.T)):
            tick = by_tick([(0, y, z, 0, 0, 0, 1)])
            near = tick.near.distance[tick.near_pairs[:, 1] != below]
            touches = tick.pairs[tick.pairs[:, 1] != below].size
            distances.append(0.0 if touches else near.min())
        axes.plot(times, distances, color=colour, label=f'path up to {top:g} m')
        axes.plot(answer.least.time, answer.least.nearest.distance, 'o', color=colour)
        for pair, impact in answer.named()[:1]:
            axes.annotate(f'touches {pair.b}', (impact.time, 0.0), xytext=(12, 26),
                          textcoords='offset points', arrowprops={'arrowstyle': '->'})
    axes.set(xlabel='time of the path', ylabel='distance [m]', xlim=(0.0, 3.0),
             ylim=(0.0, 2.6))
    axes.legend(loc='upper center', ncols=2)
    figure.savefig(folder / 'lift.png', metadata={'Software': None})


def faces(axes: Axes3D, turn: np.ndarray, centre: np.ndarray, sign: float, colour: str) -> None:
    """Draw a cube of edge 2, with its three faces on the side of a sign filled: its trihedron."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # --help runs without matplotlib
    square = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    for axis in range(3):
        for side in (-1.0, 1.0):
            face = np.insert(square, axis, side, axis=1) @ turn.T + centre
            axes.add_collection3d(Poly3DCollection(
                [face], facecolors=to_rgba(colour, 0.35 if side == sign else 0.0),
                edgecolors=to_rgba(colour, 0.9), linewidths=0.9))


def inputs(axes: Axes3D, point: np.ndarray) -> None:
    """Draw the second cube with a vertex of its trihedron at a point of the first one's."""
    turn = rotation_matrix(quaternion_from_euler(np.radians([(20.0, 25.0, 30.0)])))[0]
    offset = point + turn @ np.ones(3)
    faces(axes, np.eye(3), np.zeros(3), 1.0, STACK)
    faces(axes, turn, offset, -1.0, LOAD)
    axes.plot(*point, 'o', color=CORNER, markersize=6, zorder=10)
    axes.quiver(0, 0, 0, *offset, color=POINT, arrow_length_ratio=0.07, linewidth=1.2)
    axes.text(*(0.62 * offset + (0.0, 0.0, 0.25)), 't', fontsize=11)
    axes.text(-1.0, -1.0, -1.95, 'first cube; its trihedron is filled', color='0.4')
    axes.text(*(offset + (0.5, 0.9, 1.3)), 'second cube, turned\nby roll, pitch, yaw', color=LOAD)


def outputs(axes: Axes3D, point: np.ndarray) -> None:
    """Draw the directions of the point and of the normal, and the angles of the first."""
    faces(axes, np.eye(3), np.zeros(3), 1.0, STACK)
    for start, arrow, colour, name in ((np.zeros(3), point, CORNER, 'point'),
                                       (point, np.array((1.0, 0, 0)), POINT, 'normal')):
        axes.quiver(*start, *arrow, color=colour, arrow_length_ratio=0.1, linewidth=1.6)
        axes.text(*(start + arrow + 0.08), name, color=colour)
    shadow = point * (1, 1, 0)
    axes.plot(*np.array([np.zeros(3), shadow, point]).T, ':', color=CORNER)
    axes.plot([0, 1], [0, 0], [0, 0], ':', color='0.4')
    axes.text(0.85, -0.05, -0.22, 'x', color='0.4')
    for radius, ends, name, side in ((0.8, (np.array((1.0, 0, 0)), shadow), 'azimuth', 'top'),
                                     (0.95, (shadow, point), 'elevation', 'center')):
        arc = np.linspace(*ends, 30)
        arc *= radius / np.linalg.norm(arc, axis=1, keepdims=True)
        axes.plot(*arc.T, color=CORNER, linewidth=1.5)
        axes.text(*(1.06 * arc[15]), name, color=CORNER, fontsize=9, va=side,
                  bbox={'facecolor': 'white', 'alpha': 0.7, 'linewidth': 0, 'pad': 0.5})


def trihedron(folder: Path) -> None:
    """Draw trihedron.png: what the paper's network takes, and what it gives."""
    figure = plt.figure(figsize=(9.0, 4.0), dpi=110, layout='constrained')
    for place, (draw, length, title) in enumerate((
            (inputs, 5.0, 'In: t, roll, pitch, yaw'),
            (outputs, 3.0, 'Out: azimuth and elevation, of point and normal')), 1):
        axes = figure.add_subplot(1, 2, place, projection='3d', proj_type='ortho')
        draw(axes, np.array((1.0, 0.7, 0.6)))
        axes.set(xlim=(-1, length - 1), ylim=(-1, length - 1), zlim=(-1.15, length - 1.15))
        axes.set_box_aspect((1, 1, 1), zoom=1.2)
        axes.view_init(22, -56)
        axes.axis('off')
        axes.set_title(title, fontsize=11)
    figure.savefig(folder / 'trihedron.png', metadata={'Software': None})


def plans(folder: Path) -> None:
    """Draw a packer's file and a lorry with its trailer, coloured by cause."""
    files = Path(__file__).parents[1] / 'examples' / 'files'
    packed = read_plan(files / 'solution.csv', unit='mm')
    lorry = read_plan(files / 'semitrailer.csv')
    for name, plan, size in (('pallet', packed, (9.0, 4.5)), ('lorry', lorry, (9.0, 4.0))):
        figure = inspect_plan(plan).plot()
        figure.set_size_inches(*size)
        figure.savefig(folder / f'{name}.png', dpi=80, metadata={'Software': None})


def door(folder: Path) -> None:
    """Draw pallets.png: a pallet of groceries, for the README, a third as wide as its page.

    The README shows it 260 px wide: there its letters are 12 px high.
    """
    plan = read_plan(Path(__file__).parents[1] / 'examples' / 'files' / 'pallet.csv')
    figure = inspect_plan(plan).plot()
    figure.set_size_inches(2.6, 2.6)
    figure.suptitle('')
    figure.legends[0].remove()
    axes, = figure.axes
    axes.set_position((0.02, 0.18, 0.96, 0.64))
    for label, height, start in zip(list(axes.texts), (0.94, 0.06), ((0.9, 0), (0.3, 1)),
                                    strict=True):
        text = label.get_text().replace('\n', ', ').partition(', share')[0]
        axes.annotate(text, label.xy, (0.5, height), textcoords='figure fraction', ha='center',
                      va='center', fontsize=72 * 12 / 100,
                      arrowprops={'arrowstyle': '-', 'color': '0.3', 'relpos': start})
        label.remove()
    figure.savefig(folder / 'pallets.png', dpi=300, metadata={'Software': None})


def main() -> None:
    """Draw all figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--out', type=Path, default=Path(__file__).parent, help='folder')
    folder = parser.parse_args().out
    figure, axes = plt.subplot_mosaic(
        [['one way', 'graph'], ['other way', 'graph']], figsize=(6.4, 3.4), dpi=110,
        width_ratios=(1, 1.25), layout='constrained')
    sketch(axes['one way'], math.radians(7.0))
    sketch(axes['other way'], math.radians(-7.0))
    slide(axes['graph'])
    first_contact(folder)
    lift(folder)
    plans(folder)
    door(folder)
    trihedron(folder)
    # No version and no date in the file: the same figure is the same bytes.
    figure.savefig(folder / 'centroid.png', metadata={'Software': None})


if __name__ == '__main__':
    main()

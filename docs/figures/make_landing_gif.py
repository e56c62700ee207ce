# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Make docs/figures/landing.gif: one landing from the side, with contact point, patch and forces.

Run as `python docs/figures/make_landing_gif.py [--out FILE]`. The crane lands by the exact contact,
offline, as `benchmarks.landing_ways.land` does it. Tilt and gap are drawn larger, and time is
slower where the point moves far, as the picture notes. Below is the path of the point beside that
of the deepest corner, which MuJoCo finds at the same poses.
"""
from __future__ import annotations

import argparse
import io
import math
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from box_contact_ros.extras import expect_extras

expect_extras()
import matplotlib

matplotlib.use('Agg')

import matplotlib.pyplot as plt
from PIL import Image
from tqdm import tqdm

from box_contact_ros import Contact, ContactSolver
from box_contact_ros.demo.crane import CraneScenario
from box_contact_ros.demo.landing import LandingRecord
from box_contact_ros.forces.patch_forces import GRAVITY
from box_contact_ros.solver.pose import rotation_matrix
from box_contact_ros.view.style import BOX_A, BOX_B, CONTACT

sys.path.append(str(Path(__file__).resolve().parents[2]))  # where benchmarks/ is

from benchmarks.engines.mujoco_engines import box_geoms, collision
from benchmarks.landing_ways import land, solvers

RATE = 1000.0
PICTURES = 12  # a second
BEFORE, AFTER, STILL = 0.75, 1.25, 2.5  # s of the landing around the touch, and of its last picture
MOST_MOVE = 0.9
"""How far the point moves from picture to picture [m]: 31 px, for which time is slowed."""
TILT = 6.0
"""Factor by which tilt and gap are drawn larger: 1.2 degrees would hardly be seen."""
WIDTH, HEIGHT, DPI = 7.2, 5.2, 100
COLOURS = {name: tuple(value / 255.0 for value in colour) for name, colour in (
    ('load', BOX_A), ('stack', BOX_B), ('contact', CONTACT), ('rope', (60, 60, 70)))}
GREEN, CORNER = (0.0, 0.45, 0.3), (0.1, 0.1, 0.1)


def side(scenario: CraneScenario, pose: np.ndarray) -> np.ndarray:
    """Return the corners (4, 2) of the load, x and z, once around, its tilt drawn larger."""
    length, _, height = scenario.size
    pitch = TILT * math.asin(float(-rotation_matrix(pose[3:])[2, 0]))
    turn = np.array([[math.cos(pitch), math.sin(pitch)], [-math.sin(pitch), math.cos(pitch)]])
    corners = 0.5 * np.array([[-length, -height], [length, -height], [length, height],
                              [-length, height]])
    top = scenario.stack_size[2]
    # The lowest corner keeps its height over the stack, drawn larger, too.
    low = float((rotation_matrix(pose[3:]) @ (0.5 * _CORNERS * scenario.size).T)[2].min())
    placed = corners @ turn.T
    placed[:, 1] += top + TILT * (pose[2] + low - top) - placed[:, 1].min()
    placed[:, 0] += pose[0]
    return placed


_CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])


class Shot(NamedTuple):
    """What a picture shows."""

    time: float  # from the first touch [s]
    slowed: float  # real time divided by the time of the film, up to here
    tick: int  # of the record, the last before
    pose: np.ndarray
    contact: Contact
    corner: float  # x of the deepest corner [m], NaN without contact


def shots_of(record: LandingRecord, touched: int) -> list[Shot]:
    """Return the pictures: as many per second as PICTURES, and more where the point moves far."""
    scenario = record.scenario
    exact = ContactSolver(scenario.size, scenario.stack_size)
    engine = collision('', box_geoms, '')
    mujoco = engine.boxes(np.array(scenario.size), np.array(scenario.stack_size))

    def shot(time: float, step: float) -> Shot:
        place = touched + time * RATE
        tick = int(place)
        pose = record.poses[tick] + (place - tick) * (record.poses[tick + 1] - record.poses[tick])
        points, _, depths = engine.read(mujoco(*engine.at(pose, scenario.stack_pose)))
        corner = points[np.argmax(depths), 0] if len(depths) else math.nan
        return Shot(time, 1.0 / (PICTURES * step), tick, pose, exact(pose, scenario.stack_pose),
                    corner)

    usual = step = 1.0 / PICTURES
    shots = [shot(-BEFORE, step)]
    while shots[-1].time < AFTER:
        last = shots[-1]
        step = min(usual, 2.0 * step)
        while abs((found := shot(last.time + step, step)).contact.point[0]
                  - last.contact.point[0]) > MOST_MOVE:
            step *= 0.5
        shots.append(found)
    return shots


def draw(axes: Any, record: LandingRecord, shot: Shot) -> None:
    """Draw one picture: load, stack, ropes, contact, forces, and a line of words."""
    scenario, pose, contact = record.scenario, shot.pose, shot.contact
    length, height = scenario.stack_size[0], scenario.stack_size[2]
    axes.set(xlim=(-10.4, 10.4), ylim=(-0.2, 10.4), aspect='equal')
    axes.axis('off')
    axes.axhline(0.0, color='0.75', linewidth=1)
    axes.add_patch(plt.Rectangle((-0.5 * length, 0.0), length, height, facecolor=COLOURS['stack'],
                                 edgecolor='black', alpha=0.75, linewidth=1))
    load = side(scenario, pose)
    slack = not record.tensions[shot.tick].any()
    for corner in (2, 3):
        x, z = load[corner]
        axes.plot([x, 0.85 * x], [z, 12.0], color=COLOURS['rope'], linewidth=1.6,
                  linestyle=(0, (2, 2)) if slack else '-')
    axes.fill(*load.T, facecolor=COLOURS['load'], edgecolor='black', alpha=0.75, linewidth=1)
    left = 0.7 * load.mean(axis=0) + 0.3 * load[[0, 3]].mean(axis=0)
    axes.text(*left, f'{scenario.mass / 1000:g} t', ha='center', va='center', fontsize=13)
    axes.text(0.0, 0.5 * height, 'stack', ha='center', va='center', fontsize=13)
    weight = scenario.mass * GRAVITY
    carried = float(record.forces[shot.tick][2])
    if contact.colliding:
        half = math.sqrt(3.0 * contact.covariance[0, 0])
        x = float(contact.point[0])
        # The patch has its moments' width, as far as the boxes reach.
        reach = max(load[0, 0], -0.5 * length), min(load[1, 0], 0.5 * length)
        axes.plot(np.clip([x - half, x + half], *reach), [height, height], linewidth=9,
                  color='white', solid_capstyle='butt')
        axes.plot(np.clip([x - half, x + half], *reach), [height, height], linewidth=7,
                  color=COLOURS['contact'], solid_capstyle='butt', alpha=0.55)
        axes.plot(x, height, 'o', color=COLOURS['contact'], markersize=11, zorder=5)
        _arrow(axes, x, height, 2.0 * carried / weight, COLOURS['contact'])
    ropes = float(record.tensions[shot.tick].sum())
    _arrow(axes, float(load[:, 0].mean()), float(load[:, 1].max()), 2.0 * ropes / weight, GREEN)
    words = ('the load hangs on its ropes' if not contact.colliding and shot.time < 0.0 else
             'it touches: one contact, its patch grows' if not slack else
             'the patch carries the load, the ropes are slack')
    axes.set_title(words, fontsize=15, pad=2)
    speed = f'{shot.slowed:.0f} times slower' if shot.slowed > 1.5 else 'real time'
    for row, text in enumerate((f'tilt, gap × {TILT:g}', f't = {shot.time:+.3f} s', speed)):
        axes.text(-10.3, 0.25 + 0.65 * row, text, fontsize=11)
    for row, (text, value, colour) in enumerate((
            ('ropes', ropes, GREEN), ('contact', carried, COLOURS['contact']))):
        axes.text(6.35, 1.0 - 0.75 * row, f'{text}: {value / 1e3:.0f} kN', fontsize=11,
                  color=colour)


def draw_paths(axes: Any, shots: list[Shot], shown: int) -> None:
    """Draw where point and deepest corner were in the pictures so far, the first one on top."""
    rows = np.arange(shown + 1)
    touching = [number for number, shot in enumerate(shots) if shot.contact.colliding]
    axes.set(xlim=(-10.4, 10.4), ylim=(len(shots) - 0.5, touching[0] - 1.5))
    axes.axis('off')
    for paths, colour, size in (
            ([shot.corner for shot in shots], CORNER, 3),
            ([shot.contact.point[0] for shot in shots], COLOURS['contact'], 4)):
        axes.plot(paths[:shown + 1], rows, '-o', color=colour, markersize=size, linewidth=1)
    axes.text(-10.3, touching[0], 'paths, downwards:', fontsize=11, va='top')
    axes.text(6.5, touching[0], 'the centroid', fontsize=11, va='top', color=COLOURS['contact'])
    axes.text(6.5, 0.5 * (touching[0] + len(shots)), "MuJoCo's\ndeepest corner", fontsize=11,
              va='top', color=CORNER)


def _arrow(axes: Any, x: float, z: float, length: float, colour: tuple[float, ...]) -> None:
    if length > 0.05:
        axes.annotate('', (x, z + min(length, 5.0)), (x, z), zorder=6, arrowprops={
            'color': colour, 'width': 5, 'headwidth': 15, 'headlength': 12, 'shrink': 0})


def main() -> None:
    """Land, draw, and write the GIF."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--out', type=Path, default=Path(__file__).with_name('landing.gif'))
    parser.add_argument('--picture', type=Path, help='folder for each picture, to look at')
    options = parser.parse_args()
    print('landing.gif: the crane lands ...', flush=True)
    scenario = CraneScenario(pitch=1.2, roll=0.4, offset=(-0.15, 0.1))
    record = land(scenario, solvers(scenario, 'exact'), rate_hz=RATE, latency=0.002)
    shots = shots_of(record, min(record.points))
    pictures = []
    for number, shot in enumerate(tqdm(shots, desc='landing.gif', unit='picture')):
        figure, (above, below) = plt.subplots(2, figsize=(WIDTH, HEIGHT), dpi=DPI,
                                              height_ratios=(3.65, 1.1))
        figure.subplots_adjust(left=0.01, right=0.99, bottom=0.01, top=0.93, hspace=0.02)
        draw(above, record, shot)
        draw_paths(below, shots, number)
        file = io.BytesIO()
        figure.savefig(file, format='png')
        plt.close(figure)
        pictures.append(Image.open(file).convert('RGB').quantize(32))
    last = round(1000 * STILL)
    pictures[0].save(options.out, save_all=True, append_images=pictures[1:], loop=0, optimize=True,
                     duration=[1000 // PICTURES] * (len(pictures) - 1) + [last])
    if options.picture:
        options.picture.mkdir(exist_ok=True)
        for number, picture in enumerate(pictures):
            picture.convert('RGB').save(options.picture / f'{number:03d}.png')
    print(f'{options.out}: {len(pictures)} pictures, {options.out.stat().st_size / 1e3:.0f} kB')


if __name__ == '__main__':
    main()

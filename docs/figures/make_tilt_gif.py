# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Make docs/figures/tilt.gif: a container that a hand tilts on a stack, from the side and above.

Run as `python docs/figures/make_tilt_gif.py [--out FILE]`. The film shows the contact as a function
of the pose, not of time: the lowest corner is always 50 mm deep. Tilts are drawn larger.
"""
from __future__ import annotations

import argparse
import io
import math
from pathlib import Path
from typing import Any

import numpy as np

from box_contact_ros import ContactSolver
from box_contact_ros.extras import expect_extras

expect_extras()
import matplotlib

matplotlib.use('Agg')

import matplotlib.pyplot as plt
from PIL import Image
from tqdm import tqdm

SIZE = (12.192, 2.438, 2.591)  # of both containers [m]
DEPTH, MOST = 0.05, 1.2  # of the lowest corner [m]; tilt [°]
LARGER = 6.0  # factor by which tilts are drawn larger
PICTURES, PER_SECOND = 60, 15  # of one tilt there and back
LOAD, STACK, CONTACT, CORNER = '#ee9632', '#4678aa', '#e6146e', '#222222'
WIDTH, HEIGHT, DPI = 7.2, 6.3, 100
LIMITS = (-7.2, 7.2)  # of the picture along the container [m]


def pose_at(tilt: float) -> np.ndarray:
    """Return the load's pose (7,) at a tilt [rad] about y, its lowest corner DEPTH deep."""
    length, _, height = SIZE
    low = 0.5 * (height * math.cos(tilt) + length * math.sin(abs(tilt)))
    return np.array([0.0, 0.0, 0.5 * height - DEPTH + low,
                     0.0, math.sin(0.5 * tilt), 0.0, math.cos(0.5 * tilt)])


def tilts(solver: ContactSolver) -> np.ndarray:
    """Return the pictures' tilts [rad]: such that the point swings as a pendulum does."""
    fine = np.radians(np.linspace(-MOST, MOST, 2001))
    poses = np.array([pose_at(tilt) for tilt in fine])
    along = solver.batch(poses, np.tile((0.0, 0, 0, 0, 0, 0, 1), (len(fine), 1))).point[:, 0]
    phases = 2.0 * math.pi * np.arange(PICTURES) / PICTURES
    return np.interp(along.max() * np.cos(phases), along, fine)


def draw(axes: Any, tilt: float, solver: ContactSolver) -> None:
    """Draw one picture: side view above, plan of the patch below."""
    length, width, height = SIZE
    contact = solver(pose_at(tilt), (0, 0, 0, 0, 0, 0, 1))
    x, half = contact.point[0], math.sqrt(3.0 * contact.covariance[0, 0])
    # The patch has its moments' length, as far as the boxes reach.
    left, right = np.clip((x - half, x + half), -0.5 * length, 0.5 * length)
    across = math.sqrt(3.0 * contact.covariance[1, 1])
    corner = math.copysign(0.5 * length, tilt) if tilt else math.nan
    side, plan = axes
    turn = LARGER * tilt
    matrix = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
    corners = 0.5 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (length, height) @ matrix.T
    corners[:, 1] += 0.5 * height - DEPTH - corners[:, 1].min()
    side.add_patch(plt.Rectangle((-0.5 * length, -0.5 * height), length, height, facecolor=STACK,
                                 edgecolor='black', alpha=0.6))
    side.fill(*corners.T, facecolor=LOAD, edgecolor='black', alpha=0.6)
    top = 0.5 * height
    side.plot([left, right], [top, top], color=CONTACT, linewidth=7, alpha=0.5,
              solid_capstyle='butt')
    side.plot(corner, top, 's', color=CORNER, markersize=9)
    side.plot(x, top, 'o', color=CONTACT, markersize=11)
    side.set(xlim=LIMITS, ylim=(-1.6, 6.0), aspect='equal',
             title='The contact as a function of the pose')
    side.text(LIMITS[0] + 0.2, 5.4, f'tilt {math.degrees(tilt):+.2f}°, drawn × {LARGER:g}')
    plan.add_patch(plt.Rectangle((-0.5 * length, -0.5 * width), length, width, facecolor=STACK,
                                 edgecolor='black', alpha=0.25))
    plan.add_patch(plt.Rectangle((left, -across), right - left, 2.0 * across,
                                 facecolor=CONTACT, edgecolor=CONTACT, alpha=0.4))
    plan.plot(x, 0.0, 'o', color=CONTACT, markersize=11)
    plan.plot(corner, 0.0, 's', color=CORNER, markersize=9)
    plan.set(xlim=LIMITS, ylim=(-2.6, 1.5), aspect='equal')
    plan.text(-6.0, -2.2, 'centroid and patch, from above', color=CONTACT)
    plan.text(1.6, -2.2, 'one point, the deepest corner', color=CORNER)
    for each in axes:
        each.axis('off')


def main() -> None:
    """Draw all pictures, and write the GIF."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--out', type=Path, default=Path(__file__).with_name('tilt.gif'))
    options = parser.parse_args()
    solver, pictures = ContactSolver(SIZE, SIZE), []
    for tilt in tqdm(tilts(solver), desc='tilt.gif', unit='picture'):
        figure, axes = plt.subplots(2, figsize=(WIDTH, HEIGHT), dpi=DPI, height_ratios=(7.6, 4.1),
                                    layout='constrained')
        draw(axes, float(tilt), solver)
        file = io.BytesIO()
        figure.savefig(file, format='png')
        plt.close(figure)
        pictures.append(Image.open(file).convert('RGB').quantize(128))
    pictures[0].save(options.out, save_all=True, append_images=pictures[1:], loop=0, optimize=True,
                     duration=1000 // PER_SECOND)
    print(f'{options.out}: {len(pictures)} pictures, {options.out.stat().st_size / 1e3:.0f} kB')


if __name__ == '__main__':
    main()

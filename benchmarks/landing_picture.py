# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""One landing by four ways, at a glance: the load from its end, and how fast its corners move.

Above: load and stack at the end, the tilt exaggerated, and where the contact pushes in the last
seconds. Below: the speed of the fastest corner over time.
"""
from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from box_contact_ros.demo.landing import CORNER_SPEED_LIMIT, WATCHED, LandingRecord, solvers
from box_contact_ros.demo.mujoco_crane import CraneScenario
from box_contact_ros.scene.pose import rotation_matrix

from . import output
from .landing_ways import WAYS, LoopTiming, MujocoSource

SHOWN_WAYS = {'exact': 'held patch', 'wrench': 'held wrench', 'mujoco-deepest': 'deepest point',
              'manifold': "MuJoCo's manifold"}
TIMING = LoopTiming(200.0, 0.002)
EXAGGERATION = 15.0
"""Of the tilt: a third of a degree would not be seen."""
LATEST = 1.0
"""So long are contacts shown [s]."""
COLOURS = {'load': '#9aa7b5', 'stack': '#d9dde2', 'contact': '#d1495b', 'speed': '#00798c'}


def draw(path: Path, scenario: CraneScenario) -> None:
    """Draw the landing of a scenario."""
    figure, axes = output.subplots(2, len(SHOWN_WAYS), (8.0, 4.6), sharey='row')
    for (side, speed), (way, title) in zip(axes.T, SHOWN_WAYS.items()):
        record = WAYS[way].fly(scenario, TIMING)
        result = record.judge()
        settled = ('never settles' if math.isnan(result.settled) else
                   f'settles in {result.settled:.1f} s')
        side.set_title(f'{title}\n{settled}\ntilt {math.degrees(result.static_tilt):.2g}°',
                       fontsize=10)
        _from_the_end(side, way, record)
        time = np.arange(len(record.poses)) / record.rate_hz - result.touched
        shown = (time > -1.0) & (time < WATCHED)
        speed.semilogy(time[shown], 1e3 * record.corner_speeds()[shown], linewidth=0.8,
                       color=COLOURS['speed'])
        speed.axhline(1e3 * CORNER_SPEED_LIMIT, color='black', linewidth=0.8, linestyle=':')
        speed.set_xlabel('s after the touch', fontsize=9)
        speed.set_ylim(1e-7, 3e3)
    axes[1, 0].set_ylabel('fastest corner [mm/s]', fontsize=9)
    axes[1, 0].text(WATCHED, 1.4e3 * CORNER_SPEED_LIMIT, 'limit', fontsize=8, ha='right')
    figure.suptitle(f'One landing, one contact each {1e3 / TIMING.rate_hz:g} ms, '
                    f'{1e3 * TIMING.latency:g} ms late (tilt drawn × {EXAGGERATION:g}; '
                    'red: where it pushes)', fontsize=10)
    figure.savefig(path)


def _from_the_end(axis: Any, way: str, record: LandingRecord) -> None:
    """Draw stack and load as seen along the stack's length, and the contacts of the end."""
    scenario, pose = record.scenario, record.poses[-1]
    width, top = scenario.stack_size[1], scenario.stack_size[2]
    middle = np.array([scenario.drop_position[1], top])
    stack = np.array([[-0.5, -1.0], [0.5, -1.0], [0.5, 0.0], [-0.5, 0.0]]) * [width, top]
    roll = -math.asin(float(rotation_matrix(pose[3:])[1, 2])) * EXAGGERATION
    turn = np.array([[math.cos(roll), -math.sin(roll)], [math.sin(roll), math.cos(roll)]])
    load = np.array([[-0.5, 0.0], [0.5, 0.0], [0.5, 1.0], [-0.5, 1.0]]) * scenario.size[1:]
    load = load @ turn.T + [pose[1] - middle[0], 0.0]
    for corners, colour in ((stack, 'stack'), (load, 'load')):
        axis.fill(*corners.T, facecolor=COLOURS[colour], edgecolor='black', linewidth=0.8)
    _contacts(axis, way, record, middle)
    axis.set_xlim(-2.2, 2.2)
    axis.set_ylim(-0.9, 1.6)
    axis.set_aspect('equal')
    axis.set_xticks([])
    axis.set_yticks([])


def _contacts(axis: Any, way: str, record: LandingRecord, middle: np.ndarray) -> None:
    """Draw where the contact pushes: the patch, one point or several."""
    scenario, pose = record.scenario, record.poses[-1]
    colour = COLOURS['contact']
    stack_pose, stack_size = scenario.stack_boxes[0]
    if way == 'manifold':
        points = MujocoSource(scenario.size, stack_size, 'mean').manifold(pose, stack_pose).points
    else:
        first = len(record.poses) - round(LATEST * record.rate_hz)
        points = np.array([point for tick, point in record.points.items() if tick >= first])
    axis.plot(points[:, 1] - middle[0], points[:, 2] - middle[1], 'o', markersize=6, color=colour,
              zorder=3, clip_on=False)
    if way in ('exact', 'wrench'):
        contact = solvers(scenario, 'exact')[0](pose, stack_pose)
        half = math.sqrt(3.0 * contact.covariance[1, 1])
        axis.plot(contact.point[1] - middle[0] + np.array([-half, half]), [0.0, 0.0],
                  linewidth=4, color=colour, solid_capstyle='butt')

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A picture of a plan: what is wrong is coloured and has a label, and what is sound is pale."""
from __future__ import annotations

from collections.abc import Sequence
from graphlib import CycleError, TopologicalSorter
from typing import TYPE_CHECKING, Any

import numpy as np

from ..extras import require
from ..solver.checks import printable
from ..solver.contact_solver import ContactSolver
from ..solver.pose import rotation_matrix
from .plan import Plan
from .room import are_walls
from .verdict import GOES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = {'sound': '#dde5ee', 'not judged': '#cdb4db', 'overlap': '#003049',
           'outside': '#0077b6', 'hangs': '#9d0208',
           'unsupported': '#e63946', 'tips under its load': '#c77dff', 'slides': '#5a189a',
           'goes with what falls': '#f4a261', 'overloaded': '#ffd166', 'step': '#fb8b24',
           'way': '#0a9396', 'ground': '#f2f2f2'}
"""By verdict, in the order of the legend."""
QUIET = ('sound', 'not judged', 'ground', GOES)
"""Verdicts without labels."""
MOST_LABELS = 6
"""More would cover the boxes; the rows have the others."""
MOST_SORTED = 1000
"""More boxes are drawn by the depth of their centres alone."""
SHADES = 1.0, 0.93, 0.86
"""Of the faces along z, y and x of a box [share of its colour]."""
VIEWER = np.array([0.5, -0.75, 0.45])
RIGHT = np.cross((0.0, 0.0, 1.0), VIEWER) / np.hypot(*VIEWER[:2])
UP = np.cross(VIEWER / np.linalg.norm(VIEWER), RIGHT)
"""Directions to the viewer, and to the right and the upper edge of the picture."""
_RING = np.array([[-0.5, -0.5], [-0.5, 0.5], [0.5, 0.5], [0.5, -0.5]])


def picture(plan: Plan, verdicts: np.ndarray, rows: Sequence[Any], title: str) -> Figure:
    """Return a figure of a plan, coloured by verdicts (n,); the worst boxes have their names.

    rows: those of an `Inspection`, the worst first.

    It needs Matplotlib, the extra `report`.
    """
    require('report')
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import to_rgb
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    drawn = _drawn(plan)
    verdicts = verdicts[drawn]
    faces, shades = _faces(plan.sizes[drawn], plan.poses[drawn])
    order = _from_behind(plan.sizes[drawn], plan.poses[drawn], faces)
    colours = np.array([to_rgb(COLOURS[verdict]) for verdict in verdicts]).reshape(-1, 1, 3)

    figure = Figure(figsize=(9, 6), layout='constrained')
    axes = figure.add_subplot()
    axes.set_axis_off()
    axes.set_aspect('equal')
    axes.add_collection(PolyCollection(
        faces[order].reshape(-1, 4, 2), edgecolors='0.35', linewidths=0.4,
        facecolors=(colours * shades[:, :, None])[order].reshape(-1, 3)))
    axes.autoscale_view()
    labels = sorted(_labels(plan, rows, drawn), key=lambda label: -faces[label[0], ..., 1].mean())
    for line, (n, text) in enumerate(labels):  # beside the boxes, the highest at the top
        axes.annotate(text, faces[n].mean(axis=(0, 1)), (1.02, 1.0 - (line + 0.5) / len(labels)),
                      textcoords='axes fraction', fontsize=8, va='center',
                      arrowprops={'arrowstyle': '-', 'color': '0.3', 'relpos': (0.0, 0.5)})
    shown = [verdict for verdict in COLOURS if verdict in verdicts]
    axes.legend(handles=[Patch(facecolor=COLOURS[verdict], edgecolor='0.35', label=verdict)
                         for verdict in shown], fontsize=8, ncols=len(shown), frameon=False,
                loc='upper center', bbox_to_anchor=(0.5, 0.0))
    axes.set_title(title, fontsize=9)
    return figure


def _drawn(plan: Plan) -> np.ndarray:
    """Return the boxes that are drawn, by index.

    Walls of a container, and a ground that is far larger than the rest, are not.
    """
    ground = plan.ground[~are_walls(plan)[plan.ground]]
    free = np.setdiff1d(np.arange(len(plan)), plan.ground)
    if not len(free):
        return ground
    half = np.einsum('nij,nj->ni', np.abs(rotation_matrix(plan.poses[:, 3:])), plan.sizes) / 2.0
    low, high = plan.poses[:, :3] - half, plan.poses[:, :3] + half
    reach = high[free].max(axis=0) - low[free].min(axis=0)
    small = ground[(2.0 * half[ground] <= 2.0 * reach).all(axis=1)]
    return np.sort(np.concatenate((free, small)))


def _faces(sizes: np.ndarray, poses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the three faces that are seen of each box (n, 3, 4, 2), and their shades (n, 3)."""
    axes = rotation_matrix(poses[:, 3:])
    side = np.sign(VIEWER @ axes)
    picture = np.stack((RIGHT, UP))
    faces = np.empty((len(poses), 3, 4, 2))
    for axis in range(3):
        local = np.zeros((len(poses), 4, 3))
        local[:, :, axis] = side[:, None, axis] / 2.0
        local[:, :, [k for k in range(3) if k != axis]] = _RING
        corners = poses[:, None, :3] + np.einsum('nij,npj->npi', axes, local * sizes[:, None])
        faces[:, axis] = corners @ picture.T
    return faces, np.take(SHADES[::-1], np.abs(axes).argmax(axis=1))


def _from_behind(sizes: np.ndarray, poses: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return in which order to draw boxes: what covers another one comes after it."""
    depth = poses[:, :3] @ VIEWER
    if len(poses) > MOST_SORTED:
        return np.argsort(depth, kind='stable')
    low, high = faces.min(axis=(1, 2)), faces.max(axis=(1, 2))
    a, b = np.nonzero(np.triu((low[:, None] < high).all(axis=2) & (low < high[:, None]).all(
        axis=2), 1))
    near = ContactSolver().distance_batch(poses, sizes=sizes, pairs=np.stack((a, b), axis=1))
    before = near.normal @ VIEWER > 0.0  # a plane between both, with b on the viewer's side
    behind: dict[int, list[int]] = {int(n): [] for n in np.argsort(depth, kind='stable')}
    for back, front in zip(np.where(before, a, b).tolist(), np.where(before, b, a).tolist()):
        behind[front].append(back)
    try:
        return np.array(list(TopologicalSorter(behind).static_order()), np.int64)
    except CycleError:
        return np.argsort(depth, kind='stable')


def _labels(plan: Plan, rows: Sequence[Any], drawn: np.ndarray) -> list[tuple[int, str]]:
    """Return the worst boxes, by their place among the drawn ones, with their labels."""
    place = {plan.names[box]: n for n, box in enumerate(drawn.tolist())}
    labels: dict[int, str] = {}
    for row in rows:
        for name in row.names:
            if name in place and row.kind not in QUIET:
                labels.setdefault(place[name], printable(f'{name}: {row.kind}') + '\n'
                                  + printable(row.text))
    return list(labels.items())[:MOST_LABELS]

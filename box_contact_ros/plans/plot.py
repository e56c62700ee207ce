# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A picture of a plan: what is wrong is coloured and has a label, and what is sound is pale.

It is seen from the upper corner that shows most of what is wrong. A line ends on a part of its box
that is seen. Of a box that is hidden the edges are drawn through, dashed.
"""
from __future__ import annotations

import textwrap
from collections import Counter
from collections.abc import Sequence
from graphlib import CycleError, TopologicalSorter
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..extras import require
from ..solver.checks import printable
from ..solver.contact_solver import ContactSolver
from ..solver.pose import rotation_matrix
from .plan import Plan
from .room import are_walls, bounds
from .verdict import GOES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = {'sound': '#dde5ee', 'not judged': '#b8b8c8', 'overlap': '#000000',
           'outside': '#0072b2', 'hangs': '#8b1a1a', 'unsupported': '#d55e00',
           'tips under its load': '#cc79a7', 'slides': '#56b4e9', GOES: '#f7d9a0',
           'overloaded': '#f0e442', 'step': '#009e73', 'way': '#5b2a86', 'ground': '#f4f4f0'}
"""By verdict, in the order of the legend; they differ for who sees no red or no green, too."""
QUIET = ('sound', 'not judged', 'ground', GOES)  # verdicts without labels
MOST_LABELS, MOST_LOOKED_AT = 6, 30
"""More labels would cover the boxes; and the faulty boxes that decide on the view, at most."""
MOST_SORTED = 1000
"""More boxes are drawn by the depth of their centres alone, from the first corner."""
SHADES = 1.0, 0.93, 0.86  # of the faces along z, y and x of a box [share of its colour]
CORNERS = [np.array((x, y, 0.45)) for x, y in product((0.5, -0.5), (-0.75, 0.75))]
"""Directions to the viewer."""
SPOTS = np.array([*product((-0.4, 0.0, 0.4), repeat=2)])
"""Of a face, which are looked at [of its edges]."""
LONGEST, WIDEST = 24, 34  # characters of a name, and of a line of a label
ROUNDING = 1e-6  # of a box's diagonal, by which what touches it may seem to be before it
HIDDEN = 0.5  # share of its spots that are seen, below which a box is drawn through
_RING = np.array([[-0.5, -0.5], [-0.5, 0.5], [0.5, 0.5], [0.5, -0.5]])


class View(NamedTuple):
    """The boxes as they are seen from a corner."""

    viewer: np.ndarray
    faces: np.ndarray  # (n, 3, 4, 2) corners in the picture, of the faces that are seen


def edges_of(viewer: np.ndarray) -> np.ndarray:
    """Return the directions to the right and the upper edge of the picture (2, 3)."""
    right = np.cross((0.0, 0.0, 1.0), viewer) / np.hypot(*viewer[:2])
    return np.stack((right, np.cross(viewer / np.linalg.norm(viewer), right)))


def picture(plan: Plan, verdicts: np.ndarray, rows: Sequence[Any], title: str) -> Figure:
    """Return a figure of a plan, coloured by verdicts (n,); the worst boxes have their names.

    rows: those of an `Inspection`, the worst first. title: where nothing is wrong.

    It needs Matplotlib, the extra `report`.
    """
    require('report')
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.colors import to_rgb
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch

    drawn = _drawn(plan)
    verdicts, sizes, poses = verdicts[drawn], plan.sizes[drawn], plan.poses[drawn]
    labels = _labels(plan, rows, drawn)
    others = np.flatnonzero(~np.isin(verdicts, QUIET)).tolist()
    faulty = [*dict.fromkeys((*labels, *others))][:MOST_LOOKED_AT]
    view, spots, seen = _best_view(sizes, poses, faulty)
    order = _from_behind(sizes, poses, view)
    shades = np.take(SHADES[::-1], np.abs(rotation_matrix(poses[:, 3:])).argmax(axis=1))
    colours = np.array([to_rgb(COLOURS[verdict]) for verdict in verdicts]).reshape(-1, 1, 3)

    figure = Figure(figsize=(10, 6))
    axes = figure.add_axes((0.01, 0.1, 0.68, 0.8))
    axes.set_axis_off()
    axes.set_aspect('equal')
    axes.add_collection(PolyCollection(
        view.faces[order].reshape(-1, 4, 2), edgecolors='0.35', linewidths=0.4,
        facecolors=(colours * shades[:, :, None])[order].reshape(-1, 3)))
    hidden = [n for n, some in zip(faulty, seen) if some.mean() < HIDDEN]
    axes.add_collection(LineCollection(
        [face for n in hidden for face in view.faces[n][:, (0, 1, 2, 3, 0)]], linewidths=1.2,
        colors=[COLOURS[verdicts[n]] for n in hidden for _ in range(3)], linestyles='dashed'))
    axes.autoscale_view()
    ends = {n: (spot[some] if some.any() else spot) for n, spot, some in zip(faulty, spots, seen)}
    at = {n: ends[n][np.linalg.norm(ends[n] - ends[n].mean(axis=0), axis=1).argmin()]
          for n in labels}
    for line, n in enumerate(sorted(labels, key=lambda n: -at[n][1])):  # the highest at the top
        axes.annotate(labels[n], at[n], (0.71, 0.9 - 0.8 * (line + 0.5) / len(labels)),
                      textcoords='figure fraction', fontsize=8, va='center', parse_math=False,
                      arrowprops={'arrowstyle': '-', 'color': '0.3', 'relpos': (0.0, 0.5)})
    shown = [verdict for verdict in COLOURS if verdict in verdicts]
    figure.legend(handles=[Patch(facecolor=COLOURS[verdict], edgecolor='0.35', label=verdict)
                           for verdict in shown], fontsize=8, ncols=min(len(shown), 6),
                  frameon=False, loc='lower center')
    figure.suptitle(_title(verdicts, title), fontsize=9, parse_math=False)
    return figure


def _title(verdicts: np.ndarray, title: str) -> str:
    """Return how many boxes have which fault, or a title."""
    counts = Counter(verdict for verdict in verdicts.tolist() if verdict not in QUIET[:3])
    kinds = ', '.join(f'{kind}: {count:,}' for kind, count in counts.most_common())
    boxes = np.count_nonzero(verdicts != 'ground')
    text = f'{counts.total():,} of {boxes:,} boxes have a fault: {kinds}' if counts else title
    return '\n'.join(textwrap.wrap(printable(text), 110))


def _drawn(plan: Plan) -> np.ndarray:
    """Return the boxes that are drawn, by index.

    Walls of a container, and a ground that is far larger than the rest, are not.
    """
    ground = plan.ground[~are_walls(plan)[plan.ground]]
    free = np.setdiff1d(np.arange(len(plan)), plan.ground)
    if not len(free):
        return ground
    low, high = bounds(plan)
    reach = high[free].max(axis=0) - low[free].min(axis=0)
    small = ground[((high - low)[ground] <= 2.0 * reach).all(axis=1)]
    return np.sort(np.concatenate((free, small)))


def view_from(viewer: np.ndarray, sizes: np.ndarray, poses: np.ndarray) -> View:
    """Return boxes as they are seen from a direction."""
    return View(viewer, _on_faces(viewer, sizes, poses, _RING) @ edges_of(viewer).T)


def _on_faces(viewer: np.ndarray, sizes: np.ndarray, poses: np.ndarray, places: np.ndarray,
              ) -> np.ndarray:
    """Return places (p, 2) on the three faces that are seen of each box (n, 3, p, 3)."""
    axes = rotation_matrix(poses[:, 3:])
    side = np.sign(viewer @ axes)
    points = np.empty((len(poses), 3, len(places), 3))
    for axis in range(3):
        local = np.zeros((len(poses), len(places), 3))
        local[:, :, axis] = side[:, None, axis] / 2.0
        local[:, :, [k for k in range(3) if k != axis]] = places
        points[:, axis] = poses[:, None, :3] + np.einsum('nij,npj->npi', axes,
                                                         local * sizes[:, None])
    return points


def _best_view(sizes: np.ndarray, poses: np.ndarray, faulty: Sequence[int],
               ) -> tuple[View, np.ndarray, np.ndarray]:
    """Return the view from which most of the faulty boxes is seen.

    Also their spots in the picture (f, p, 2), and which of them are seen (f, p).
    """
    best, most = None, -1.0
    for viewer in CORNERS[:1] if len(poses) > MOST_SORTED else CORNERS:
        view = view_from(viewer, sizes, poses)
        spots = _on_faces(viewer, sizes[faulty], poses[faulty], SPOTS).reshape(
            len(faulty), 3 * len(SPOTS), 3)
        seen = np.array([_are_seen(spots[n], box, viewer, sizes, poses)
                         for n, box in enumerate(faulty)], bool).reshape(spots.shape[:2])
        one, other = (view.faces[faulty, :, n + 2] - view.faces[faulty, :, n] for n in (0, 1))
        area = np.abs(one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]) / 2.0
        total = float((seen.reshape(len(faulty), 3, len(SPOTS)).mean(axis=2) * area).sum())
        if total > most:
            best, most = (view, spots @ edges_of(viewer).T, seen), total
    assert best is not None
    return best


def _are_seen(points: np.ndarray, box: int, viewer: np.ndarray, sizes: np.ndarray,
              poses: np.ndarray) -> np.ndarray:
    """Return which points (p, 3) on a box no other box hides."""
    others = np.delete(np.arange(len(poses)), box)
    near, far = spans(sizes[others], poses[others], points, viewer)
    hides = far > np.maximum(near, 0.0) + ROUNDING * np.linalg.norm(sizes[box])
    return np.asarray(~hides.any(axis=1))


def spans(sizes: np.ndarray, poses: np.ndarray, origins: np.ndarray, direction: np.ndarray,
          ) -> tuple[np.ndarray, np.ndarray]:
    """Return where rays from origins (p, 3) enter and leave boxes (p, n) [of the direction].

    A ray that misses a box leaves it before it enters.
    """
    axes = rotation_matrix(poses[:, 3:])
    start = np.einsum('nij,pni->pnj', axes, origins[:, None] - poses[:, :3])
    along = np.einsum('nij,i->nj', axes, direction)
    with np.errstate(divide='ignore', invalid='ignore'):
        ends = np.stack(((-sizes / 2.0 - start) / along, (sizes / 2.0 - start) / along))
    return (np.nanmax(ends.min(axis=0), axis=2, initial=-np.inf),
            np.nanmin(ends.max(axis=0), axis=2, initial=np.inf))


def _from_behind(sizes: np.ndarray, poses: np.ndarray, view: View) -> np.ndarray:
    """Return in which order to draw boxes: what covers another one comes after it."""
    depth = poses[:, :3] @ view.viewer
    if len(poses) > MOST_SORTED:
        return np.argsort(depth, kind='stable')
    low, high = view.faces.min(axis=(1, 2)), view.faces.max(axis=(1, 2))
    a, b = np.nonzero(np.triu((low[:, None] < high).all(axis=2) & (low < high[:, None]).all(
        axis=2), 1))
    near = ContactSolver().distance_batch(poses, sizes=sizes, pairs=np.stack((a, b), axis=1))
    before = near.normal @ view.viewer > 0.0  # a plane between both, with b on the viewer's side
    behind: dict[int, list[int]] = {int(n): [] for n in np.argsort(depth, kind='stable')}
    for back, front in zip(np.where(before, a, b).tolist(), np.where(before, b, a).tolist()):
        behind[front].append(back)
    try:
        return np.array(list(TopologicalSorter(behind).static_order()), np.int64)
    except CycleError:
        return np.argsort(depth, kind='stable')


def _labels(plan: Plan, rows: Sequence[Any], drawn: np.ndarray) -> dict[int, str]:
    """Return the labels of the worst boxes, by their place among the drawn ones."""
    place = {plan.names[box]: n for n, box in enumerate(drawn.tolist())}
    labels: dict[int, str] = {}
    for row in rows:
        for name in row.names:
            if name in place and row.kind not in (*QUIET, 'fixed') and len(labels) < MOST_LABELS:
                lines = f'{shortened(name)}: {row.kind}', row.text
                labels.setdefault(place[name], '\n'.join(
                    part for line in lines for part in textwrap.wrap(printable(line), WIDEST)))
    return labels


def shortened(name: str) -> str:
    """Return a name whose middle is left out if it is long."""
    half = LONGEST // 2
    return name if len(name) <= LONGEST else f'{name[:half]}…{name[1 - half:]}'

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Loads that are kept while more bodies come: what they add is carried down to the ground.

A force against gravity goes straight down where a patch is below it. Elsewhere the patches of the
body share it, with the least change to what they carry. As in statics.py, forces are not negative,
and within the hulls of what carries bodies, pulled in by what these need. Loads that exist show
that nothing falls, whatever the true ones are.
"""
from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from .meetings import Meetings
from .statics import LEVEL, SEEN, Bodies, Work, hull_edges, pulled_in

SURELY = 2.0
"""How far within a hull forces are [of what the body needs]: on a rim the programmes decide."""
BALANCED = 1e-4
"""Part of what is on a body that loads along gravity may lack: else friction holds the body."""
EXACT, SHARINGS = 1e-10, 30
"""Part of a force that may be left of it, and the steps in which it is shared."""
VISITS = 4  # how often bodies are visited, on average: more where two carry each other
VISIT = 2500.0  # work of a visit, in the unit of `Work`
Planes = list[tuple[float, float, float]]
"""Normals (x, y) into a polygon, and how far along them its edges are."""
Force = tuple[float, float, float]
"""Against gravity: an amount [N], and that times x and times y [N m]."""


@dataclass
class _Stand:
    """Where a body may press on what carries it."""

    rows: list[int]  # of the patches
    edges: tuple[np.ndarray, np.ndarray]
    """Of their hull: where they begin, and unit normals into it (e, 2)."""
    need: float  # how far within the hull it presses [m]
    inside: Planes  # of the hull, pulled in
    patches: list[Planes] = field(default_factory=list)
    """The patches as they are, if there are several."""
    points: tuple[np.ndarray, np.ndarray] | None = None
    """Of several patches: places (p, 2), moved into the hull, and which of `rows` each is of."""


class KeptLoads:
    """What patches carry, in the frame of what bodies feel."""

    def __init__(self, meet: Meetings, pairs: np.ndarray, below: Sequence[list[int]],
                 bodies: Bodies, work: Work, *, weighed: bool) -> None:
        """Keep no loads yet; those that are not weighed are looked at by their centres alone.

        pairs: of bodies, of all patches that may bear. below: rows of what carries each body.
        """
        slope = np.minimum(meet.normal @ meet.frame[2], 1.0)
        self._slides = (slope <= 1.0 - LEVEL) & (
            np.sqrt(1.0 - slope**2) > (meet.friction if weighed else np.inf) * slope)
        self._hull = meet.bearings.hull @ meet.frame[:2].T
        self._needs, self._overlaps = meet.needs, meet.overlaps[meet.of_met]
        self._lower, self._below, self._bodies = pairs[:, 0].tolist(), below, bodies
        self._fixed = meet.fixed.tolist()
        self._own = [*zip(*np.vstack((bodies.weight, bodies.weight * bodies.centre[:, :2].T)
                                     ).tolist())]
        self._height = bodies.centre[:, 2].tolist()
        self._only_looks, self._work = not weighed, work
        self._load: list[Force] = [(0.0, 0.0, 0.0)] * len(pairs)
        self._total: list[Force] = [(0.0, 0.0, 0.0)] * len(below)  # weight, and what is on top
        self._is_braced = [False] * len(below)
        self._stands: dict[int, _Stand] = {}

    def hold(self, new: Sequence[int], here: Sequence[bool], stands: Sequence[bool]) -> bool:
        """Return whether loads are found with which new bodies stand, beside those that do.

        Where they are not, all loads of their group have to be given anew, by `take`.
        here: (b,) which bodies have come.
        """
        if self._only_looks:
            return all(_is_inside(self._stand(body, here).inside, self._own[body])
                       for body in new)
        more: dict[int, Force] = {}
        todo: list[tuple[float, int]] = []

        def press(body: int, force: Force) -> None:
            if body not in more:
                heapq.heappush(todo, (-self._height[body], body))
            more[body] = _sum(more.get(body, (0.0, 0.0, 0.0)), force)

        for body in new:
            press(body, self._own[body])
        for _ in range(VISITS * len(here)):
            if not todo:
                return True
            body = heapq.heappop(todo)[1]
            self._work.left -= VISIT
            force = more.pop(body)
            self._total[body] = _sum(self._total[body], force)
            shares = self._shares(body, force, here)
            if not shares or not (stands[body] or body in new):
                return False
            for row, share in shares:
                self._load[row] = _sum(self._load[row], share)
                if not self._fixed[self._lower[row]]:
                    press(self._lower[row], share)
        return False

    def take(self, members: np.ndarray, rows: np.ndarray, load: np.ndarray, centre: np.ndarray,
             ) -> None:
        """Take what patches carry: all that members of a group (g,) are carried by.

        rows: (k,) of the patches. load: (k,) against gravity [N]. centre: (k, 3) of pressure.
        """
        for body in members.tolist():
            self._stands.pop(body, None)
            self._total[body] = self._own[body]
            for row in self._below[body]:
                self._load[row] = (0.0, 0.0, 0.0)
        held = dict.fromkeys(members.tolist(), (0.0, 0.0, 0.0))
        upper = {row: body for body in held for row in self._below[body]}
        for row, *force in zip(rows.tolist(), load.tolist(), *(load * centre[:, :2].T).tolist()):
            self._load[row] = tuple(force)
            held[upper[row]] = _sum(held[upper[row]], self._load[row])
            if self._lower[row] in held:
                self._total[self._lower[row]] = _sum(self._total[self._lower[row]], self._load[row])
        for body, (weight, x, y) in held.items():
            whole, at_x, at_y = self._total[body]
            lacks = max(abs(weight - whole), max(abs(x - at_x), abs(y - at_y))
                        / float(self._bodies.gyration[body]))
            self._is_braced[body] = not lacks <= BALANCED * whole

    def _shares(self, body: int, force: Force, here: Sequence[bool],
                ) -> list[tuple[int, Force]] | None:
        """Return what a force on a body adds to its patches, or None."""
        stand = self._stands.get(body)
        if stand is None:
            stand = self._stands[body] = self._stand(body, here)
        is_single = len(stand.rows) == 1
        if _is_inside(stand.inside, force):
            if is_single:
                return [(stand.rows[0], force)]
            stand.patches = stand.patches or [
                _planes(*hull_edges(self._hull[row]), 0.0) for row in stand.rows]
            for row, patch in zip(stand.rows, stand.patches):
                if _is_inside(patch, force):
                    return [(row, force)]
        goal = force if self._is_braced[body] else self._total[body]
        if not _is_inside(stand.inside, goal):
            return None
        return [(stand.rows[0], force)] if is_single else self._spread(body, stand, goal)

    def _stand(self, body: int, here: Sequence[bool]) -> _Stand:
        """Return where a body may press: on what overlaps it only if there is nothing else."""
        rows = [row for row in self._below[body] if here[self._lower[row]]]
        rows = [row for row in rows if not self._overlaps[row]] or rows
        need = max((float(self._needs[row]) for row in rows), default=0.0)
        need = SURELY * max(need, SEEN * float(self._bodies.gyration[body]))
        rows = [row for row in rows if not self._slides[row]]
        if not rows:
            return _Stand(rows, (np.zeros((0, 2)),) * 2, need, [])
        edges = hull_edges(self._hull[rows].reshape(-1, 2))
        return _Stand(rows, edges, need, _planes(*edges, need))

    def _spread(self, body: int, stand: _Stand, goal: Force) -> list[tuple[int, Force]] | None:
        """Return what patches have to carry more, or less, so that they carry the goal.

        min Σ (f − f₀)²  with G·f = goal, f ≥ 0, by Newton's method on the three multipliers.
        """
        centre, size = self._bodies.centre[body, :2], self._bodies.gyration[body]
        before = np.array([self._load[row] for row in stand.rows]) / goal[0]
        rows = np.flatnonzero((before[:, 0] > 0.0) & (not self._is_braced[body]))
        if stand.points is None:  # as the programmes move them
            points, depth = pulled_in(self._hull[stand.rows].reshape(-1, 2), *stand.edges,
                                      stand.need)
            kept = depth > stand.need / SURELY
            of_point = np.repeat(np.arange(len(stand.rows)), self._hull.shape[1])
            stand.points = points[kept], of_point[kept]
        points, of_point = stand.points
        place = np.vstack((points, before[rows, 1:] / before[rows, :1]))
        patch = np.append(of_point, rows)
        given = np.vstack((np.ones(len(place)), (place - centre).T / size))
        first = np.append(np.zeros(len(points)), before[rows, 0])
        wanted = np.array((1.0, *((np.array(goal[1:]) / goal[0] - centre) / size)))
        multiplier = np.zeros(3)
        for _ in range(SHARINGS):
            force = first + multiplier @ given
            presses = given[:, force >= 0.0]
            force = np.maximum(force, 0.0)
            lacks = wanted - given @ force
            if np.abs(lacks).max() <= EXACT:
                break
            multiplier += np.linalg.solve(presses @ presses.T + EXACT * np.eye(3), lacks)
        else:
            return None
        more = np.zeros((len(stand.rows), 3))
        np.add.at(more, patch, force[:, None] * np.column_stack((np.ones(len(place)), place)))
        np.subtract.at(more, rows, before[rows])
        turns = np.abs(more[:, 1:] - more[:, :1] * centre).max(axis=1) / size
        rows = np.flatnonzero(np.maximum(np.abs(more[:, 0]), turns) > EXACT / 1e2)
        return [(stand.rows[row], tuple((goal[0] * more[row]).tolist())) for row in rows]


def _sum(one: Force, other: Force) -> Force:
    return one[0] + other[0], one[1] + other[1], one[2] + other[2]


def _planes(start: np.ndarray, inward: np.ndarray, need: float) -> Planes:
    """Return a polygon with edges (e, 2), pulled in by need [m]."""
    along = (start * inward).sum(axis=1) + need
    return [*zip(*inward.T.tolist(), along.tolist())]


def _is_inside(planes: Planes, force: Force) -> bool:
    """Return whether a force presses, and within a polygon."""
    weight, x, y = force
    return weight > 0.0 and bool(planes) and all(
        a * x + b * y >= along * weight for a, b, along in planes)

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Statics of rigid bodies on patches: what falls, and what each patch carries.

Each patch is a bed of equal stiffness per area that does not pull. Two quadratic programmes follow
each other:

    what falls: the least missing wrench     min Σ W·|m|²     G·f + m = w,  f ≥ 0
    the loads: the least energy              min Σ f²/k       G·f = w − m,  f ≥ 0

f are forces at points of the patches, k the stiffness of a point, G the wrenches of unit forces, W
the weights of bodies, and w their wrenches. The points are within the hull of what carries a body,
pulled in by what the body needs. m is Gauss's principle: m·g are the accelerations with which the
bodies begin to move, so bodies with an m fall. docs/explanation/statics.md has the rest.

All is in a frame whose z axis is against what the bodies feel as gravity. Wrenches are in units of
a body's weight, and of that times its radius of gyration.
"""
from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..core import native
from .bearings import Bearings
from .standing import hull_margins

FALLS = 1e-5  # missing part of its weight from which a body falls [1]: above what the solver leaves
DOUBTFUL = 1e-2
"""Missing part up to which a body is asked again to hold, with the others falling [1]."""
FELL = 1e-4  # missing part from which a body that was asked again, and lacked some again, falls [1]
LEVEL = 1e-9  # up to 1 − LEVEL, a cosine is that of a normal that is not along gravity: 4e-5 rad
NEGLIGIBLE = 1e-9
"""Share of a patch's stiffness that a point may lack: of triangles with an edge of a micron."""
SOFTNESS = 1e-7
"""Of beds while what falls is found [1]: the energy of loads in that of missing wrenches."""
STIFFNESS = 1e9
"""Of a body's place while loads are found [1], so that they exist in spite of rounding."""
PASSES_MAX = 50  # of friction. What still lacks some of its weight then falls
SETTLED = 1e-5  # change of friction's bounds that ends the passes [of the mean weight]
NOISE = 1e-6  # load below which a patch does not press [of the mean weight]
ROUGH = 0.9
"""Radius at which friction resists a spin, divided by that of gyration of a rectangle [1]."""
SEEN = 2.0 * FALLS
"""How far a hull is pulled in at least [of a radius of gyration], so that what is missing tells."""
MOVES, SLACK = 50, 0.1
"""Steps by which points are moved into a hull, and the part of the need that they may lack."""
SAME_HEIGHT = 1e-3  # step of heights [m]: friction at two of them can turn a body
SURE, ASKED, GRIPPING = 'sure', 'asked', 'gripping'
"""How loads are looked for: at once, as all bodies may be expected to hold; by both programmes; and
by both, with friction at each point up to what presses there, which level patches bound."""
MOST_GRIPPING = 200  # bodies of a group that friction is asked for: a second's work
PRECISION = 1e-8  # of the solver: residuals and gap of duality
BATCH = 300  # patches of groups that are solved at a time
MOST_ENTRIES = 2_000_000  # of a programme's matrix: 300 bytes each
MOST_WORK, STEPS = 3e9, 30  # work of a plan, and steps that a programme is expected to take


@dataclass(frozen=True, eq=False)
class Bodies:
    """n bodies; fixed ones have no weight that matters."""

    weight: np.ndarray  # (n,) above 0 [N]
    centre: np.ndarray  # (n, 3) of mass [m]
    gyration: np.ndarray  # (n,) radius of gyration [m]
    fixed: np.ndarray  # (n,) bool
    need: np.ndarray
    """(n,) how far the centre of pressure must be within the hull of what carries a body [m]."""


@dataclass(frozen=True, eq=False)
class Beds:
    """k patches. Each presses body b, along its normal, away from body a."""

    pairs: np.ndarray  # (k, 2) bodies a and b; where one carries the other, the lower one first
    carries: np.ndarray  # (k,) bool: a carries b; else they are beside each other
    normal: np.ndarray  # (k, 3) from a to b
    centre: np.ndarray  # (k, 3) [m]
    radius: np.ndarray  # (k,) of gyration about the normal [m]
    area: np.ndarray  # (k,) [m²]
    friction: np.ndarray  # (k,) Coulomb's μ
    bearings: Bearings  # (k,) where they press; between the points of the hull is all that they can


@dataclass(frozen=True, eq=False)
class Rest:
    """What the patches carry, and what they cannot carry."""

    load: np.ndarray  # (k,) along the normal [N]
    centre: np.ndarray  # (k, 3) of pressure; of the patch where nothing presses [m]
    missing: np.ndarray
    """(n, 6) force and torque that nothing gives [of the weight]; NaN, as the loads: too much."""
    margin: np.ndarray
    """(n,) how far the centre of pressure is inside the hull of what carries a body [m]; −infinity:
    nothing presses."""

    @property
    def falls(self) -> np.ndarray:
        """(n,) bool."""
        return np.abs(self.missing).max(axis=1, initial=0.0) > FALLS


@dataclass
class Work:
    """What a plan may still take."""

    left: float = field(default_factory=lambda: MOST_WORK)
    """In units of 2 to 6 ns: of a programme's step, the entries of its matrix and factors, to the
    power of 1.25."""


def settle(bodies: Bodies, beds: Beds, work: Work,
           report: Callable[[int], None] = lambda count: None) -> Rest:
    """Return what the patches carry.

    Small groups come first. Those that would take more than what is left of the work are not
    solved.
    report: is called with the number of bodies that were solved since.
    """
    load, centre = np.zeros(len(beds.pairs)), beds.centre.copy()
    own = bodies.centre
    bodies, added = add_up(bodies, beds, load, centre)
    report(len(added))
    missing = np.zeros((len(bodies.weight), 6))
    left = np.flatnonzero(~np.isin(beds.pairs[:, 1], added))
    group, of_patch = groups_of(bodies, beds.pairs[left], added)
    free = np.flatnonzero(group >= 0)
    missing[free, 2] = 1.0  # what nothing carries
    size = np.bincount(group[free], minlength=1)
    patches = np.bincount(of_patch[of_patch >= 0], minlength=len(size))

    def any_of(bodies_or_patches: np.ndarray, of: np.ndarray) -> np.ndarray:
        return np.asarray(np.bincount(of[bodies_or_patches], minlength=len(size)) > 0)

    rests = any_of(bodies.fixed[beds.pairs[left]].any(axis=1), of_patch)
    is_level = ~any_of(np.abs(beds.normal[left, 2]) <= 1.0 - LEVEL, of_patch)
    is_beside = np.zeros(len(group), bool)
    is_beside[beds.pairs[~beds.carries]] = True

    def solve(groups: np.ndarray, way: str) -> None:
        for flat in (True, False):
            for some in _batches(np.flatnonzero(groups & (is_level == flat)), patches,
                                 BATCH if flat and way != GRIPPING else 1):
                rows, members = left[np.isin(of_patch, some)], np.flatnonzero(np.isin(group, some))
                try:
                    part = _Programme(bodies, beds, members, rows, flat and way != GRIPPING,
                                      is_tight | (way == GRIPPING), work)
                    load[rows], centre[rows], missing[members] = part.settle(way)
                except _TooMuch:
                    load[rows] = missing[members] = np.nan

    inside = hull_margins(beds.bearings.hull[left, :, :2], beds.pairs[left, 1],
                          bodies.centre[:, :2])
    is_tight = (group >= 0) & (inside <= bodies.need) & ~is_beside
    asked, todo, reported = any_of(is_tight[free], group[free]), rests.copy(), ~rests
    while todo.any():
        solve(todo & ~asked, SURE)
        solve(todo & asked, ASKED)
        report(int((todo & ~reported)[group[free]].sum()))
        # Of most bodies the centre of pressure is well inside, so that they need no rows.
        margin = pressed_margins(beds, load, centre, len(own))
        is_new = (group >= 0) & (margin <= bodies.need) & ~is_tight & ~is_beside
        falls = np.abs(missing).max(axis=1) > FALLS
        reported, is_tight = reported | todo, is_tight | is_new
        todo &= any_of(is_new[free], group[free]) | ~asked & any_of(falls[free], group[free])
        asked |= todo
    falls = np.abs(missing).max(axis=1) > FALLS
    # Friction can turn a box that has others on it; whether it falls decides on what it carries.
    lower, upper = beds.pairs[left].T
    has_others = np.bincount(lower, minlength=len(group)) > 0
    is_first = np.bincount(upper[falls[lower]], minlength=len(group)) == 0
    may_turn = falls & is_first & (has_others | (inside > bodies.need))
    if beds.friction.any():
        solve(rests & any_of(may_turn[free], group[free]) & is_level & (size <= MOST_GRIPPING)
              & _have_rings(bodies, beds, left, of_patch, size), GRIPPING)
    return Rest(load, centre, missing, pressed_margins(beds, load, centre, len(own)))


def pressed_margins(beds: Beds, load: np.ndarray, centre: np.ndarray, count: int) -> np.ndarray:
    """Return how far the centres of pressure of bodies are inside the hulls of what carries them.

    −infinity (n,) where nothing presses, NaN where loads are not known [m].
    """
    rows = beds.carries & ~(load <= 0.0)
    upper, pressing = beds.pairs[rows, 1], load[rows]
    total = np.bincount(upper, pressing, count)
    at = np.stack([np.bincount(upper, pressing * column, count)
                   for column in centre[rows, :2].T], axis=1)
    presses = total > 0.0
    return np.where(presses, hull_margins(
        beds.bearings.hull[beds.carries][:, :, :2], beds.pairs[beds.carries, 1],
        np.where(presses[:, None], at, 0.0) / np.where(presses, total, 1.0)[:, None]),
        np.where(np.isnan(total), np.nan, -np.inf))


def _have_rings(bodies: Bodies, beds: Beds, left: np.ndarray, of_patch: np.ndarray,
                size: np.ndarray) -> np.ndarray:
    """Return in which groups forces along patches can be in balance with each other.

    They go around a ring of bodies, of which all that are fixed are one.
    """
    ends = np.where(bodies.fixed[beds.pairs[left]], -1, beds.pairs[left])
    height = np.rint(beds.centre[left, 2] / SAME_HEIGHT)
    joints = np.unique(np.column_stack((of_patch, np.sort(ends, axis=1), height)), axis=0)
    return np.bincount(joints[joints[:, 0] >= 0, 0].astype(int), minlength=len(size)) > size


def groups_of(bodies: Bodies, pairs: np.ndarray, done: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the group of each body (n,), −1 of those that are fixed or done, and of each pair.

    Patches join free bodies; fixed ones join nothing.
    """
    label = np.arange(len(bodies.weight))
    a, b = pairs[~bodies.fixed[pairs].any(axis=1)].T
    while (label[a] != label[b]).any():
        least = np.minimum(label[a], label[b])
        np.minimum.at(label, label[a], least)
        np.minimum.at(label, label[b], least)
        label = label[label]
    is_open = ~bodies.fixed
    is_open[done] = False
    group = np.full(len(label), -1)
    group[is_open] = np.unique(label[is_open], return_inverse=True)[1]
    return group, group[pairs].max(axis=1, initial=-1)


def _batches(groups: np.ndarray, size: np.ndarray, most: int) -> Iterator[np.ndarray]:
    """Yield groups, the smallest first, so that their sizes add up to `most` or a little more."""
    if len(groups):
        groups = groups[np.argsort(size[groups], kind='stable')]
        number = np.cumsum(size[groups]) // most
        yield from np.split(groups, np.flatnonzero(np.diff(number)) + 1)


def add_up(bodies: Bodies, beds: Beds, load: np.ndarray, centre: np.ndarray,
           ) -> tuple[Bodies, np.ndarray]:
    """Write the loads of bodies that have one carrier, from above, as far as they hold.

    Returns the bodies, of which those below have the weights and the centres of all that is added
    on top, and which bodies were added (a,). The force of each goes through its centre, so that no
    stiffness matters.
    """
    lower, upper = beds.pairs.T
    count = len(bodies.weight)
    weight, moment = bodies.weight.copy(), bodies.weight[:, None] * bodies.centre
    below, above = np.bincount(upper, minlength=count), np.bincount(lower, minlength=count)
    may_be_added = ~bodies.fixed & (below == 1)
    may_be_added[beds.pairs[~beds.carries].ravel()] = False
    bed = np.full(count, -1)
    bed[upper] = np.arange(len(upper))
    added = []
    box = np.flatnonzero(may_be_added & (above == 0))
    while len(box):
        row = bed[box]
        normal, at = beds.normal[row], moment[box] / weight[box, None]
        at[:, 2] += ((beds.centre[row] - at) * normal).sum(axis=1) / normal[:, 2]
        hull = np.ascontiguousarray(beds.bearings.hull[row, :, :2])
        inside = native.hull_depths(hull.reshape(-1, 2),
                                    np.arange(len(row) + 1) * hull.shape[1],
                                    np.ascontiguousarray(at[:, :2]))
        cosine = np.minimum(normal[:, 2], 1.0)
        slides = (cosine <= 1.0 - LEVEL) & (
            np.sqrt(1.0 - cosine**2) > beds.friction[row] * cosine)
        holds = (inside > bodies.need[box]) & ~slides
        box, row = box[holds], row[holds]
        added.append(box)
        load[row], centre[row] = (weight[box] * cosine[holds]), at[holds]
        np.add.at(weight, lower[row], weight[box])
        np.add.at(moment, lower[row], moment[box])
        np.subtract.at(above, lower[row], 1)
        below_it = np.unique(lower[row])
        box = below_it[may_be_added[below_it] & (above[below_it] == 0)]
    return (replace(bodies, weight=weight, centre=moment / weight[:, None]),
            np.concatenate((*added, np.zeros(0, int))))


class _TooMuch(Exception):
    """Groups take more memory or time than is left."""


class _Programme:
    """The quadratic programmes of some groups.

    flat: all normals are along gravity, so that three equations a body are enough, and no friction.
    is_tight: bodies (n,) that nothing presses outside of their hulls, pulled in by what they need.
    """

    def __init__(self, bodies: Bodies, beds: Beds, members: np.ndarray, rows: np.ndarray,
                 flat: bool, is_tight: np.ndarray, work: Work) -> None:
        self.flat, self.members, self.rows, self.beds = flat, members, rows, beds
        self.work = work
        self.unit = bodies.weight[members].mean()
        self.friction = beds.friction[rows]
        self.weight = bodies.weight[members] / self.unit
        place = np.full(len(bodies.weight), -1)
        place[members] = np.arange(len(members))
        stiffness, area = beds.bearings.stiffness[rows], beds.area[rows]
        self.patch, column = np.nonzero(stiffness > NEGLIGIBLE * area[:, None])
        if 3 * len(self.patch) > MOST_ENTRIES:  # a point presses a body at least
            raise _TooMuch
        self.point = beds.bearings.point[rows[self.patch], column]
        self.spans = np.flatnonzero(column < beds.bearings.hull.shape[1])
        # A patch as large as the mean one has a stiffness of 1.
        self.stiffness = stiffness[self.patch, column] / area.mean()
        self.bodies = place[beds.pairs[rows]]
        self.centre, self.gyration = bodies.centre[members], bodies.gyration[members]
        self._pull_in(np.flatnonzero(is_tight[members]),
                      np.maximum(bodies.need[members], SEEN * self.gyration))
        self.keep = np.array([2, 3, 4]) if flat else np.arange(6)
        self.wanted = np.tile((self.keep == 2).astype(float), len(members))  # against gravity
        self.pressing = self._wrenches(self.patch, self.point, beds.normal[rows][self.patch])

    def _wrenches(self, patch: np.ndarray, point: np.ndarray | None, force: np.ndarray) -> Any:
        """Return the wrenches that unit forces (q, 3) at points, or unit torques, give to bodies.

        A sparse matrix (equations, q).
        """
        from scipy.sparse import csc_matrix

        equations, columns, values = [], [], []
        for side, sign in ((0, -1.0), (1, 1.0)):
            body = self.bodies[patch, side]
            used = np.flatnonzero(body >= 0)
            body = body[used]
            one = sign * force[used]
            if point is None:
                both = np.concatenate((np.zeros_like(one), one), axis=1)
            else:
                both = np.concatenate(
                    (one, np.cross(point[used] - self.centre[body], one)), axis=1)
            both[:, 3:] /= self.gyration[body, None]
            both /= self.weight[body, None]
            width = len(self.keep)
            equations.append((width * body[:, None] + np.arange(width)).ravel())
            columns.append(np.repeat(used, width))
            values.append(both[:, self.keep].ravel())
        return csc_matrix((np.concatenate(values), (np.concatenate(equations),
                                                    np.concatenate(columns))),
                          (len(self.keep) * len(self.members), len(force)))

    def settle(self, way: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return loads (k,), centres of pressure (k, 3), and what is missing (n, 6)."""
        bound = np.zeros(len(self.rows))
        at = self.beds.centre[self.rows]
        for _ in range(1 if self.flat or way == GRIPPING else PASSES_MAX):
            rubs = self._gripping() if way == GRIPPING else self._rubbing(bound, at)
            force, missing = self._solve(rubs, way == SURE)
            load = np.bincount(self.patch, force, minlength=len(self.rows))
            moment = np.stack([np.bincount(self.patch, force * self.point[:, axis],
                                           minlength=len(self.rows)) for axis in range(3)], axis=1)
            presses = load > NOISE
            at = np.where(presses[:, None], moment / np.where(presses, load, 1.0)[:, None],
                          self.beds.centre[self.rows])
            before, bound = bound, self.friction * np.where(presses, load, 0.0)
            if np.abs(bound - before).max(initial=0.0) < SETTLED:
                break
        whole = np.zeros((len(self.members), 6))
        whole[:, self.keep] = missing
        return np.where(presses, load, 0.0) * self.unit, at, whole

    def _solve(self, rubs: _Friction, sure: bool) -> tuple[np.ndarray, np.ndarray]:
        """Return forces (q,) at points and what is missing (n, equations), with friction.

        sure: all bodies may be expected to hold, so that their loads are looked for at once.
        """
        from scipy.sparse import hstack

        cost = 1.0 / self.stiffness
        metric = np.repeat(self.weight, len(self.keep))
        missing = soft = np.zeros(len(self.wanted))
        if not sure:
            # Whether loads exist depends on where patches end alone.
            some = rubs.of(self.spans)
            _, soft = _least(
                hstack((self.pressing[:, self.spans], some.wrenches), format='csc'), self.wanted,
                SOFTNESS * np.append(cost[self.spans], some.cost), metric, some,
                self.work)
            missing = np.where(np.abs(soft) < DOUBTFUL, 0.0, soft)
        given = hstack((self.pressing, rubs.wrenches), format='csc')
        cost = np.append(cost, rubs.cost)
        force, more = _least(given, self.wanted - missing, cost, STIFFNESS * metric, rubs,
                             self.work)
        each = (-1, len(self.keep))
        fell = ((np.abs(more) > FALLS).reshape(each).any(axis=1)
                & (np.abs(soft) > FELL).reshape(each).any(axis=1))
        if fell.any():  # so that the others need not lack what these do
            missing = np.where(np.repeat(fell, each[1]), soft, missing)
            force, more = _least(given, self.wanted - missing, cost, STIFFNESS * metric, rubs,
                                 self.work)
        if sure and not self.flat and np.abs(more).max() > FALLS:
            return self._solve(rubs, sure=False)
        return force[:len(self.patch)], (missing + more).reshape(each)

    def _pull_in(self, tight: np.ndarray, need: np.ndarray) -> None:
        """Move what presses bodies into their hulls, pulled in by what they need (n,) [m].

        Drop what has no place there. A body that is held from beside is left as it is.
        """
        upper, carries = self.bodies[:, 1], self.beds.carries[self.rows]
        of_bed = np.where(carries, upper, -1)
        hull = self.beds.bearings.hull[self.rows][:, :, :2]
        normal = self.beds.normal[self.rows[self.patch]]
        keeps = np.ones(len(self.patch), bool)
        of_point = of_bed[self.patch]
        order = np.argsort(of_point, kind='stable')
        first = np.searchsorted(of_point[order], np.arange(len(self.members) + 1))
        by_bed = np.argsort(of_bed, kind='stable')
        first_bed = np.searchsorted(of_bed[by_bed], np.arange(len(self.members) + 1))
        for body in np.setdiff1d(np.intersect1d(tight, of_point), self.bodies[~carries]):
            points = order[first[body]:first[body + 1]]
            start, inward = hull_edges(
                hull[by_bed[first_bed[body]:first_bed[body + 1]]].reshape(-1, 2))
            moved, depth = pulled_in(self.point[points, :2], start, inward, need[body])
            step = moved - self.point[points, :2]
            self.point[points, 2] -= (step * normal[points, :2]).sum(axis=1) / normal[points, 2]
            self.point[points, :2] = moved
            keeps[points] = depth > (1.0 - SLACK) * need[body]
        self.patch, self.point, self.stiffness = (
            self.patch[keeps], self.point[keeps], self.stiffness[keeps])
        is_span = np.zeros(len(keeps), bool)
        is_span[self.spans] = True
        self.spans = np.flatnonzero(is_span[keeps])

    def _rubbing(self, bound: np.ndarray, at: np.ndarray) -> _Friction:
        """Return friction of patches, up to bounds (k,): forces at points, and torques."""
        from scipy.sparse import csc_matrix, hstack

        rubs = np.flatnonzero(bound > 0.0)
        share = csc_matrix((len(rubs), len(self.point)))
        rows = self.rows[rubs]
        normal, radius = self.beds.normal[rows], ROUGH * self.beds.radius[rows]
        aside = np.where(np.abs(normal[:, :1]) < 0.6, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
        along = np.cross(normal, aside)
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        return _Friction(hstack((
            self._wrenches(rubs, at[rubs], along),
            self._wrenches(rubs, at[rubs], np.cross(normal, along)),
            self._wrenches(rubs, None, radius[:, None] * normal)), format='csc'),
            np.tile(self.beds.area[self.rows].mean() / self.beds.area[rows], 3), bound[rubs], share)

    def _gripping(self) -> _Friction:
        """Return friction at all points of level patches, up to its share of what presses there."""
        from scipy.sparse import diags, hstack

        count = len(self.point)
        return _Friction(hstack([self._wrenches(self.patch, self.point, np.tile(along, (count, 1)))
                                 for along in np.eye(3)[:2]], format='csc'),
                         np.tile(1.0 / self.stiffness, 2), np.zeros(count),
                         diags(self.friction[self.patch], format='csc'))


@dataclass(frozen=True, eq=False)
class _Friction:
    """Friction at r places, each up to a bound: |(t1, t2, …)| ≤ limit + share·f."""

    wrenches: Any  # (equations, w·r) of unit t: first all t1
    cost: np.ndarray  # (w·r,) of t²
    limit: np.ndarray  # (r,)
    share: Any  # (r, q) of what presses

    def of(self, points: np.ndarray) -> _Friction:
        """Return the friction where these points (p,) alone press."""
        share = self.share[:, points]
        if not share.nnz:
            return replace(self, share=share)
        count = len(self.limit)
        chosen = (points + count * np.arange(len(self.cost) // count)[:, None]).ravel()
        return _Friction(self.wrenches[:, chosen], self.cost[chosen], self.limit[points],
                         share[points])


def hull_edges(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return where the edges of the hull of points (h, 2) begin, and unit normals into it (e, 2).

    A hull without an inside has edges on either side, or one without a normal.
    """
    start = native.hull(np.ascontiguousarray(points))
    along = np.roll(start, -1, axis=0) - start
    length = np.linalg.norm(along, axis=1, keepdims=True)
    return start, np.column_stack((-along[:, 1], along[:, 0])) / np.where(length > 0.0, length, 1.0)


def pulled_in(points: np.ndarray, start: np.ndarray, inward: np.ndarray, need: float,
              ) -> tuple[np.ndarray, np.ndarray]:
    """Return points (p, 2) moved into a hull with edges (e, 2) by need, and their depths (p,)."""
    for _ in range(MOVES):
        depth = ((points[:, None] - start) * inward).sum(axis=2)
        edge = depth.argmin(axis=1)
        short = np.maximum(need - depth.min(axis=1), 0.0)
        if not short.any():
            break
        points = points + short[:, None] * inward[edge]
    return points, ((points[:, None] - start) * inward).sum(axis=2).min(axis=1)


def _least(given: Any, wanted: np.ndarray, cost: np.ndarray, metric: np.ndarray, rubs: _Friction,
           work: Work) -> tuple[np.ndarray, np.ndarray]:
    """Return f (m,) and what is missing (e,), with the least cost·f² + metric·missing².

    given·f + missing = wanted. The last f are those of friction. The others are not negative.
    Raises _TooMuch.
    """
    import clarabel
    from scipy.sparse import csc_matrix, diags, hstack, identity, vstack

    equations, forces = given.shape
    count = len(rubs.limit)
    width = (forces - rubs.share.shape[1]) // max(count, 1)
    pressing = forces - width * count
    # Of each cone: the limit, then its forces.
    cone = (width + 1) * np.arange(count)[:, None] + np.arange(width + 1)
    column = pressing + np.arange(count)[:, None] + count * np.arange(width)
    share = rubs.share.tocoo()
    bounded = csc_matrix((
        np.append(-share.data, -np.ones(column.size)),
        (np.append(cone[share.row, 0], cone[:, 1:]), np.append(share.col, column))),
        (cone.size, forces + equations))
    places = np.arange(pressing)
    presses = csc_matrix((-np.ones(pressing), (places, places)), (pressing, forces + equations))
    rows = vstack((hstack((given, identity(equations))), presses, bounded), format='csc')
    right = np.zeros(rows.shape[0])
    right[:equations] = wanted
    right[equations + pressing + cone[:, 0]] = rubs.limit
    if rows.nnz > MOST_ENTRIES:
        raise _TooMuch
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    # On groups of 1,000 boxes the other ones take two to four times as much processor time.
    settings.direct_solve_method = 'qdldl'
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = PRECISION
    solver = clarabel.DefaultSolver(
        diags(np.concatenate((cost, metric)), format='csc'), np.zeros(forces + equations), rows,
        right, [clarabel.ZeroConeT(equations), clarabel.NonnegativeConeT(pressing),
                *[clarabel.SecondOrderConeT(width + 1)] * count], settings)
    factors = solver.get_info().linsolver
    step = (factors.nnzL + factors.nnzA)**1.25
    if STEPS * step > work.left:
        raise _TooMuch
    solution = solver.solve()
    work.left -= (solution.iterations + 1) * step
    force = np.array(solution.x[:forces])
    force[:pressing] = np.maximum(force[:pressing], 0.0)
    # From the forces, so that what the solver leaves undone is missing, too.
    return force, wanted - given @ force

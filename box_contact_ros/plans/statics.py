# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Statics of rigid bodies on patches: what falls, and what each patch carries.

Each patch is a bed of equal stiffness per area that does not pull. Two quadratic programmes follow
each other:

    what falls: the least missing wrench     min Σ W·|m|²     G·f + m = w,  f ≥ 0
    the loads: the least energy              min Σ f²/k       G·f = w − m,  f ≥ 0

f are forces at points of the patches, k the stiffness of a point, G the wrenches of unit forces, W
the weights of bodies, and w their wrenches. m is Gauss's principle: m·g are the accelerations with
which the bodies begin to move, so bodies with an m fall. docs/explanation/statics.md has the rest.

All is in a frame whose z axis is against what the bodies feel as gravity. Wrenches are in units of
a body's weight, and of that times its radius of gyration.
"""
from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from ..core import native
from .bearings import Bearings
from .standing import hull_margins

FALLS = 1e-5
"""Missing part of its weight from which a body falls [1]: above what the solver leaves."""
DOUBTFUL = 1e-2
"""Missing part up to which a body is asked again to hold, with the others falling [1]."""
LEVEL = 1e-9
"""Up to 1 − LEVEL, a cosine is that of a normal that is not along gravity: 4e-5 rad."""
NEGLIGIBLE = 1e-9
"""Share of a patch's stiffness that a point may lack: of triangles with an edge of a micron."""
SOFTNESS = 1e-7
"""Of beds while what falls is found [1]: the energy of loads in that of missing wrenches."""
STIFFNESS = 1e9
"""Of a body's place while loads are found [1], so that they exist in spite of rounding."""
PASSES_MAX = 50
"""Of friction. What still lacks some of its weight then falls."""
SETTLED = 1e-5
"""Change of friction's bounds that ends the passes [of the mean weight]."""
NOISE = 1e-6
"""Load below which a patch does not press [of the mean weight]."""
ROUGH = 0.9
"""Radius at which friction resists a spin, divided by that of gyration of a rectangle [1]."""


PRECISION = 1e-8
"""Of the solver: residuals and gap of duality."""
BATCH = 500
"""Bodies of groups that are solved at a time."""


@dataclass(frozen=True, eq=False)
class Bodies:
    """n bodies; fixed ones have no weight that matters."""

    weight: np.ndarray
    """(n,) above 0 [N]."""
    centre: np.ndarray
    """(n, 3) of mass [m]."""
    gyration: np.ndarray
    """(n,) radius of gyration [m]."""
    fixed: np.ndarray
    """(n,) bool."""


@dataclass(frozen=True, eq=False)
class Beds:
    """k patches. Each presses body b, along its normal, away from body a."""

    pairs: np.ndarray
    """(k, 2) bodies a and b; where one carries the other, the lower one first."""
    carries: np.ndarray
    """(k,) bool: a carries b; else they are beside each other."""
    normal: np.ndarray
    """(k, 3) from a to b."""
    centre: np.ndarray
    """(k, 3) [m]."""
    radius: np.ndarray
    """(k,) of gyration about the normal [m]."""
    area: np.ndarray
    """(k,) [m²]."""
    bearings: Bearings
    """(k,) where they press; between the points of the hull is all that they can."""


@dataclass(frozen=True, eq=False)
class Rest:
    """What the patches carry, and what they cannot carry."""

    load: np.ndarray
    """(k,) along the normal [N]."""
    centre: np.ndarray
    """(k, 3) of pressure; of the patch where nothing presses [m]."""
    missing: np.ndarray
    """(n, 6) force and torque that nothing gives [of the weight]."""

    @property
    def falls(self) -> np.ndarray:
        """(n,) bool."""
        return np.abs(self.missing).max(axis=1, initial=0.0) > FALLS


def settle(bodies: Bodies, beds: Beds, friction: float,
           report: Callable[[int], None] = lambda count: None) -> Rest:
    """Return what the patches carry.

    report: is called with the number of bodies that were solved since.
    """
    load, centre = np.zeros(len(beds.pairs)), beds.centre.copy()
    bodies, added = add_up(bodies, beds, friction, load, centre)
    report(len(added))
    missing = np.zeros((len(bodies.weight), 6))
    left = np.flatnonzero(~np.isin(beds.pairs[:, 1], added))
    group, of_patch = groups_of(bodies, beds.pairs[left], added)
    missing[group >= 0, 2] = 1.0  # what nothing carries
    count = group.max(initial=-1) + 1
    is_grounded = bodies.fixed[beds.pairs[left]].any(axis=1)
    rests = np.bincount(of_patch[is_grounded], minlength=count) > 0
    report(int((~rests[group[group >= 0]]).sum()))
    is_level = np.bincount(of_patch[np.abs(beds.normal[left, 2]) <= 1.0 - LEVEL],
                           minlength=count) == 0
    hull = beds.bearings.hull[left, :, :2]
    inside = hull_margins(hull, beds.pairs[left, 1], bodies.centre[:, :2]) > 0.0
    is_sure = np.bincount(group[(group >= 0) & ~inside], minlength=count) == 0
    size = np.bincount(group[group >= 0], minlength=count)
    for flat, sure in product((True, False), repeat=2):
        for some in _batches(np.flatnonzero(rests & (is_level == flat) & (is_sure == sure)), size):
            rows = left[np.isin(of_patch, some)]
            members = np.flatnonzero(np.isin(group, some))
            part = _Programme(bodies, beds, members, rows, flat)
            load[rows], centre[rows], missing[members] = part.settle(friction, sure)
            report(len(members))
    return Rest(load, centre, missing)


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


def _batches(groups: np.ndarray, size: np.ndarray) -> Iterator[np.ndarray]:
    """Yield groups so that BATCH bodies or few more come together."""
    if len(groups):
        number = np.cumsum(size[groups]) // BATCH
        yield from np.split(groups, np.flatnonzero(np.diff(number)) + 1)


def add_up(bodies: Bodies, beds: Beds, friction: float, load: np.ndarray, centre: np.ndarray,
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
        slides = (cosine <= 1.0 - LEVEL) & (np.sqrt(1.0 - cosine**2) > friction * cosine)
        holds = (inside > 0.0) & ~slides
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


class _Programme:
    """The quadratic programmes of some groups.

    flat: all normals are along gravity, so that three equations a body are enough, and no friction.
    """

    def __init__(self, bodies: Bodies, beds: Beds, members: np.ndarray, rows: np.ndarray,
                 flat: bool) -> None:
        self.flat, self.members, self.rows, self.beds = flat, members, rows, beds
        self.unit = bodies.weight[members].mean()
        self.weight = bodies.weight[members] / self.unit
        place = np.full(len(bodies.weight), -1)
        place[members] = np.arange(len(members))
        stiffness, area = beds.bearings.stiffness[rows], beds.area[rows]
        self.patch, column = np.nonzero(stiffness > NEGLIGIBLE * area[:, None])
        self.point = beds.bearings.point[rows[self.patch], column]
        self.spans = np.flatnonzero(column < beds.bearings.hull.shape[1])
        # A patch as large as the mean one has a stiffness of 1.
        self.stiffness = stiffness[self.patch, column] / area.mean()
        self.bodies = place[beds.pairs[rows]]
        self.centre, self.gyration = bodies.centre[members], bodies.gyration[members]
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

    def settle(self, friction: float, sure: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return loads (k,), centres of pressure (k, 3), and what is missing (n, 6).

        sure: all bodies may be expected to hold, so that their loads are looked for at once.
        """
        bound = np.zeros(len(self.rows))
        at = self.beds.centre[self.rows]
        for _ in range(1 if self.flat else PASSES_MAX):
            force, missing = self._solve(bound, at, sure)
            load = np.bincount(self.patch, force, minlength=len(self.rows))
            moment = np.stack([np.bincount(self.patch, force * self.point[:, axis],
                                           minlength=len(self.rows)) for axis in range(3)], axis=1)
            presses = load > NOISE
            at = np.where(presses[:, None], moment / np.where(presses, load, 1.0)[:, None],
                          self.beds.centre[self.rows])
            before, bound = bound, friction * np.where(presses, load, 0.0)
            if np.abs(bound - before).max(initial=0.0) < SETTLED:
                break
        whole = np.zeros((len(self.members), 6))
        whole[:, self.keep] = missing
        return np.where(presses, load, 0.0) * self.unit, at, whole

    def _solve(self, bound: np.ndarray, at: np.ndarray, sure: bool,
               ) -> tuple[np.ndarray, np.ndarray]:
        """Return forces (q,) at points and what is missing, with friction up to bounds (k,)."""
        from scipy.sparse import hstack

        rubs = np.flatnonzero(bound > 0.0)
        limits, rubbing = bound[rubs], self._rubbing(rubs, at[rubs])
        cost = 1.0 / self.stiffness
        rub_cost = np.tile(self.beds.area[self.rows].mean() / self.beds.area[self.rows[rubs]], 3)
        metric = np.repeat(self.weight, len(self.keep))
        given = hstack((self.pressing, rubbing), format='csc')
        missing = np.zeros(len(self.wanted))
        if not sure:
            # Whether loads exist depends on where patches end alone.
            _, missing = _least(
                hstack((self.pressing[:, self.spans], rubbing), format='csc'), self.wanted,
                SOFTNESS * np.append(cost[self.spans], rub_cost), metric, limits)
            missing[np.abs(missing) < DOUBTFUL] = 0.0
        force, more = _least(given, self.wanted - missing, np.append(cost, rub_cost),
                             STIFFNESS * metric, limits)
        if sure and np.abs(more).max() > FALLS:
            return self._solve(bound, at, sure=False)
        return force[:len(cost)], (missing + more).reshape(-1, len(self.keep))

    def _rubbing(self, rubs: np.ndarray, at: np.ndarray) -> Any:
        """Return the wrenches of friction of patches (r,): unit forces at points, unit torques."""
        from scipy.sparse import csc_matrix, hstack

        if not len(rubs):
            return csc_matrix((len(self.keep) * len(self.members), 0))
        rows = self.rows[rubs]
        normal, radius = self.beds.normal[rows], ROUGH * self.beds.radius[rows]
        aside = np.where(np.abs(normal[:, :1]) < 0.6, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
        first = np.cross(normal, aside)
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        return hstack((self._wrenches(rubs, at, first),
                       self._wrenches(rubs, at, np.cross(normal, first)),
                       self._wrenches(rubs, None, radius[:, None] * normal)), format='csc')


def _least(given: Any, wanted: np.ndarray, cost: np.ndarray, metric: np.ndarray,
           limits: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return f (m,) and what is missing (e,), with the least cost·f² + metric·missing².

    given·f + missing = wanted. The last f are three times as many as `limits`, which bound them:
    |(f1, f2, f3)| ≤ limit. The first f are not negative.
    """
    import clarabel
    from scipy.sparse import csc_matrix, diags, hstack, identity, vstack

    equations, forces = given.shape
    rubs = len(limits)
    pressing = forces - 3 * rubs
    # Of each cone: the limit, then three forces.
    cone = 4 * np.arange(rubs)[:, None] + (1, 2, 3)
    column = pressing + np.arange(rubs)[:, None] + rubs * np.arange(3)
    rows = vstack((
        hstack((given, identity(equations))),
        csc_matrix((-np.ones(pressing), (np.arange(pressing), np.arange(pressing))),
                   (pressing, forces + equations)),
        csc_matrix((-np.ones(3 * rubs), (cone.ravel(), column.ravel())),
                   (4 * rubs, forces + equations))), format='csc')
    right = np.concatenate((wanted, np.zeros(pressing + 4 * rubs)))
    right[equations + pressing::4] = limits
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = PRECISION
    solution = clarabel.DefaultSolver(
        diags(np.concatenate((cost, metric)), format='csc'), np.zeros(forces + equations), rows,
        right, [clarabel.ZeroConeT(equations), clarabel.NonnegativeConeT(pressing),
                *[clarabel.SecondOrderConeT(4)] * rubs], settings).solve()
    force = np.array(solution.x[:forces])
    force[:pressing] = np.maximum(force[:pressing], 0.0)
    # From the forces, so that what the solver leaves undone is missing, too.
    return force, wanted - given @ force

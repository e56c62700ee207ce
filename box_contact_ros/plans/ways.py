# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Is the way of each box free, as the plan is loaded? A straight way from one side to its place.

The way begins just outside of all boxes of its stack. The roof or wall of a container on that side
is open. The box is smaller on each side by tolerance and depth, so what is flush with it, or
touches it, is no obstacle. Along an edge of the box the way is a longer box.
"""
from __future__ import annotations

import numpy as np

from ..core import DEPTH_FLOOR, LENGTH_MIN
from ..solver.contact_solver import ContactSolver
from ..solver.contacts_of import contacts_of
from ..solver.motion import Sweep
from ..solver.pose import rotation_matrix
from .meetings import Meetings, most_near
from .plan import Plan
from .room import ROUNDING
from .statics import LEVEL

SIDES = {'above': (0.0, 0.0, 1.0), '+x': (1.0, 0.0, 0.0), '-x': (-1.0, 0.0, 0.0),
         '+y': (0.0, 1.0, 0.0), '-y': (0.0, -1.0, 0.0)}
"""Where boxes come from, as directions towards it."""
IMPACT = 1e-6
"""Distance at which turned boxes may pass for touching [m]: they are smaller by twice it."""


def blocked_ways(plan: Plan, meet: Meetings, tolerances: np.ndarray, side: str) -> np.ndarray:
    """Return rows (w, 2) of a box and another that blocks its way, by index.

    They come by the steps of the first, and what it meets first comes first. Boxes that overlap
    where they are to be do not block each other. meet: all pairs of the plan. tolerances: (n,) [m].
    Raises TooManyNear for more pairs near each other than are judged.
    """
    towards, fixed = np.array(SIDES[side]), meet.fixed[plan.body]
    movers = np.flatnonzero(~fixed)
    axes = rotation_matrix(plan.poses[:, 3:])
    is_turned = np.abs(towards @ axes).max(axis=1) <= 1.0 - LEVEL
    sizes = np.maximum(plan.sizes - 2.0 * (
        _shrinks(plan, meet, tolerances) + 2.0 * IMPACT * is_turned)[:, None], LENGTH_MIN)
    place = plan.poses[:, :3] @ towards
    top = place + (np.abs(towards @ axes) * plan.sizes).sum(axis=1) / 2.0
    stack = np.unique(plan.stack, return_inverse=True)[1].reshape(-1)
    outside = np.full(len(plan), -np.inf)
    np.maximum.at(outside, stack[movers], top[movers])
    half = (np.abs(towards @ axes) * sizes).sum(axis=1) / 2.0
    travel = np.where(fixed, 0.0, outside[stack] - (place - half))
    long_sizes, long_poses = _longer(plan, sizes, axes, is_turned, towards, travel)
    pairs, _ = contacts_of(long_sizes[movers], long_poses[movers], to=(plan.sizes, plan.poses),
                           most_near=most_near(len(plan)))
    pairs = np.column_stack((movers[pairs[:, 0]], pairs[:, 1]))
    pairs = pairs[_may_block(plan, meet, fixed, pairs)]
    axis = np.abs(towards).argmax()
    end = plan.room[:, 1, axis] if towards[axis] > 0.0 else -plan.room[:, 0, axis]
    near = 2.0 * place - top  # what is beyond the open side of a room is no obstacle
    pairs = pairs[near[pairs[:, 1]] < end[pairs[:, 0]] - ROUNDING]
    turned = np.flatnonzero(is_turned[pairs[:, 0]])
    starts = plan.poses.copy()
    starts[:, :3] += travel[:, None] * towards
    box, other = pairs[turned].T
    meets = ContactSolver().time_of_impact_batch(
        Sweep(starts[box], plan.poses[box]), Sweep(plan.poses[other], plan.poses[other]),
        size_a=sizes[box], size_b=plan.sizes[other], tolerance=IMPACT)
    pairs = np.delete(pairs, turned[np.isnan(meets.time)], axis=0)
    assert plan.order is not None
    return pairs[np.lexsort((-top[pairs[:, 1]], pairs[:, 0], plan.order[pairs[:, 0]]))]


def _shrinks(plan: Plan, meet: Meetings, tolerances: np.ndarray) -> np.ndarray:
    """Return by how much boxes (n,) are smaller on each side: tolerance and depth [m]."""
    slack = tolerances[meet.met].min(axis=1)
    depth = np.clip(-meet.met_separation, 0.0, slack)
    deepest = DEPTH_FLOOR * plan.sizes.max(axis=1)
    for end in range(2):
        np.maximum.at(deepest, meet.met[:, end], depth)
    return tolerances + deepest


def _longer(plan: Plan, sizes: np.ndarray, axes: np.ndarray, is_turned: np.ndarray,
            towards: np.ndarray, travel: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return sizes (n, 3) and poses (n, 7) of boxes that are the ways.

    Of a box that has no edge along its way, it is a box around it.
    """
    longer = sizes + np.rint(np.abs(towards @ axes)) * travel[:, None]
    around = (np.abs(axes) @ sizes[:, :, None])[:, :, 0] + np.abs(towards) * travel[:, None]
    poses = plan.poses.copy()
    poses[:, :3] += travel[:, None] / 2.0 * towards
    poses[is_turned, 3:] = 0.0, 0.0, 0.0, 1.0
    return np.where(is_turned[:, None], around, longer), poses


def _may_block(plan: Plan, meet: Meetings, fixed: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return which of pairs (k, 2) count: the second box is there before the first one comes."""
    assert plan.order is not None
    box, other = pairs.T
    is_there = fixed[other] | (plan.stack[box] == plan.stack[other]) & (
        plan.order[other] < plan.order[box])
    number = (len(plan), 1)
    known = np.sort(np.vstack((meet.met[meet.overlaps], plan.apart)), axis=1) @ number
    return is_there & ~np.isin(np.sort(pairs, axis=1) @ number, known)

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The room of a box: the inner space of its container, what reaches beyond it, and its walls."""
from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..solver.pose import rotation_matrix
from .plan import Plan

SIDES = (('-x', '-y', '-z'), ('+x', '+y', '+z'))
"""Of a room, at its least and at its greatest corner."""
ROUNDING = 1e-6  # by how much a wall may miss its room, or reach into it [m]
THICKNESS = 0.1  # of a container's walls and floor [m]


def beyond(plan: Plan, fixed: np.ndarray, tolerances: np.ndarray) -> np.ndarray:
    """Return how far boxes reach beyond the least and greatest corner of their rooms (n, 2, 3) [m].

    It is 0 of fixed boxes, and up to a box's tolerance. fixed, tolerances: (n,) by box.
    """
    low, high = bounds(plan)
    reach = np.stack((plan.room[:, 0] - low, high - plan.room[:, 1]), axis=1)
    return np.where(~fixed[:, None, None] & (reach > tolerances[:, None, None]), reach, 0.0)


def are_beyond(plan: Plan, pairs: np.ndarray, outside: np.ndarray, tolerances: np.ndarray,
               ) -> np.ndarray:
    """Return of which pairs (m, 2) one box is in what lies beyond its room on the same side (m,).

    outside: of `beyond`. A wall is such a box.
    """
    low, high = bounds(plan)
    rows = np.zeros(len(pairs), bool)
    for box, other in pairs.T, pairs[:, ::-1].T:
        slack = tolerances[other, None]
        past = np.stack((high[other] <= plan.room[box, 0] + slack,
                         low[other] >= plan.room[box, 1] - slack), axis=1)
        rows |= (past & (outside[box] > 0.0)).any(axis=(1, 2))
    return rows


def are_walls(plan: Plan) -> np.ndarray:
    """Return which boxes (n,) are fixed, touch a room and are beside it, so that they hide it."""
    low, high = bounds(plan)
    rows = np.zeros(len(plan), bool)
    for least, greatest in np.unique(plan.room[np.isfinite(plan.room).all(axis=(1, 2))], axis=0):
        least, greatest = least + ROUNDING, greatest - ROUNDING
        beside = ((high <= least) | (low >= greatest))[:, :2].any(axis=1)
        rows |= beside & ((high >= least - 2.0 * ROUNDING) & (low <= greatest + 2.0 * ROUNDING)
                          ).all(axis=1)
    return rows & np.isin(np.arange(len(plan)), plan.ground)


def bounds(plan: Plan) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the greatest corner (n, 3) of the bounding box of each box."""
    reach = np.einsum('nij,nj->ni', np.abs(rotation_matrix(plan.poses[:, 3:])), plan.sizes / 2.0)
    return plan.poses[:, :3] - reach, plan.poses[:, :3] + reach


def walls(least: np.ndarray, greatest: np.ndarray) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """Yield the floor and four walls around a room: name, full extents (3,) and centre (3,).

    A roof carries nothing.
    """
    for side, axis, wider in (0, 2, [0, 1]), (0, 0, [1]), (1, 0, [1]), (0, 1, []), (1, 1, []):
        low, high = least.copy(), greatest.copy()
        low[wider] -= THICKNESS  # so that they meet without a gap or an overlap
        high[wider] += THICKNESS
        edge = (least, greatest)[side][axis]
        low[axis], high[axis] = (edge, edge + THICKNESS) if side else (edge - THICKNESS, edge)
        name = 'floor' if axis == 2 else f'wall {SIDES[side][axis]}'
        yield name, high - low, (low + high) / 2.0

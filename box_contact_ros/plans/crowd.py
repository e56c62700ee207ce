# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plans in which more boxes are in one place than can be judged: that they overlap is the answer.

Boxes that do not overlap have few neighbours, though a slab may carry thousands. 2,000 boxes in one
place are 2 million pairs, and 1.3 GB.
"""
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..solver.contact_solver import ContactSolver
from ..solver.faces import TOLERANCE
from .inspection import Inspection
from .plan import Fault, Plan
from .room import beyond

MOST, MOST_EACH = 200_000, 10
"""Pairs that are judged: in all, and for each box more."""
LOOKED_AT, SHOWN = 1000, 10
"""Pairs that tell whether boxes overlap, and those that are shown."""


def most_near(count: int) -> int:
    """Return how many pairs of so many boxes are judged."""
    return MOST + MOST_EACH * count


def deepest_of(sizes: np.ndarray, poses: np.ndarray, pairs: np.ndarray,
               may_touch: Callable[[int, int], bool], tolerance: float,
               ) -> tuple[np.ndarray, np.ndarray]:
    """Return pairs (k, 2) that overlap and may not, the deepest first, and their depths (k,) [m].

    pairs: (n, 2), of which the first are looked at.
    """
    pairs = pairs[:LOOKED_AT]
    pairs = pairs[[may_touch(a, b) for a, b in pairs.tolist()]].reshape(-1, 2)
    depths = -ContactSolver().batch(poses, sizes=sizes, pairs=pairs).separation
    order = np.argsort(-depths, kind='stable')[:np.count_nonzero(depths > tolerance)][:SHOWN]
    return pairs[order], depths[order]


def crowd(names: Sequence[str], count: int) -> Fault:
    """Return the fault of a plan of so many boxes; names: some that overlap, or none."""
    return Fault('overlap', tuple(names), f'more than {most_near(count):,} pairs of boxes overlap '
                 'or touch: too many, so nothing else is judged',
                 verdict='not sound' if names else 'not all judged')


def crowded(plan: Plan, pairs: np.ndarray, tolerance: float | None, acceleration: Sequence[float],
            ) -> Inspection:
    """Return what is known of a plan with too many pairs, of which `pairs` are some.

    Loads and margins are not known, and no box is said to stand.
    """
    tolerance = TOLERANCE if tolerance is None else tolerance
    apart, count = {*map(tuple, np.sort(plan.apart, axis=1).tolist())}, len(plan)
    fixed = np.isin(plan.body, plan.body[plan.ground])
    overlaps, depths = deepest_of(plan.sizes, plan.poses, pairs, lambda a, b: (
        plan.body[a] != plan.body[b] and not (fixed[a] and fixed[b])
        and (min(a, b), max(a, b)) not in apart), tolerance)
    faults = plan.faults
    if any(fault.kind == 'overlap' for fault in faults):  # the reader knows what may touch
        overlaps, depths = overlaps[:0], depths[:0]
    else:
        faults += (crowd([plan.names[box] for box in overlaps[:1].ravel()], count),)
    plan = replace(plan, faults=faults)
    none, nothing = np.full(count, np.nan), np.zeros(0)
    return Inspection(
        plan=plan, tolerance=tolerance, acceleration=np.asarray(acceleration, float),
        overlaps=overlaps, depths=depths,
        outside=beyond(plan, fixed, np.full(count, tolerance)), stands=fixed,
        cause=np.full(count, ''), goes_with=np.full(count, -1), height=none, share=none,
        margin=none, loaded_margin=none, load=none, pressure=none,
        carried_by=np.zeros((0, 2), int), loads=nothing, corners=np.zeros((0, 4, 3)),
        corner_loads=np.zeros((0, 4)), mass=np.nan, centre_of_mass=np.full(3, np.nan))

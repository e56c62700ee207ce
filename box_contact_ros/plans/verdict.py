# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which bodies of a plan stand, and why others do not."""
from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from .meetings import Meetings
from .plan import Plan
from .standing import hull_margins, standing
from .statics import LEVEL, Bodies, Rest

GOES = 'goes with what falls'
CAUSES = ('hangs', 'unsupported', 'tips under its load', 'slides', GOES, 'overloaded')
"""What may be wrong with a box, the worst first."""


@dataclass(frozen=True, eq=False)
class Verdict:
    """Which of the b bodies stand, and why others do not."""

    stands: np.ndarray  # bool
    unknown: np.ndarray  # bool: it stands if those stand whose loads take too much
    cause: np.ndarray
    goes_with: np.ndarray  # the body with which one falls; −1: none
    hangs: np.ndarray  # bool
    margin: np.ndarray  # [m]
    loaded_margin: np.ndarray  # [m]


def verdict_of(plan: Plan, meet: Meetings, bodies: Bodies, rest: Rest | None) -> Verdict:
    """Return the verdict by what patches carry, or by geometry alone."""
    body, fixed, count = plan.body, meet.fixed, len(meet.fixed)
    lower, upper = body[meet.pairs[meet.carries]].T
    hull = meet.bearings.hull[meet.carries] @ meet.frame[:2].T
    margin = hull_margins(hull, upper, bodies.centre[:, :2])
    hangs = np.bincount(body[meet.met[meet.on_top, 1]], minlength=count) == 0
    slides, unknown = np.zeros((2, count), bool)
    if rest is None:
        loaded = np.full(count, np.nan)
        stands = standing(lower, upper, margin > bodies.need, fixed)
    else:
        loaded, missing = rest.margin, np.abs(rest.missing)
        slides = np.hypot(missing[:, 0], missing[:, 1]) > missing[:, 2:].max(axis=1)
        beside = body[meet.pairs[~meet.carries & ~(rest.load <= 0.0)]]
        carrier, carried = np.vstack((np.stack((lower, upper), axis=1), beside, beside[:, ::-1])).T
        unknown = np.isnan(missing).any(axis=1)
        # Whatever the loads are, a box falls that nothing carries, or that carries nothing and is
        # level, with its centre outside.
        tilted = upper[(meet.normal @ meet.frame[2])[meet.carries] <= 1.0 - LEVEL]
        is_in = partial(np.isin, np.arange(count))
        surely = ~is_in(carried) | (margin <= bodies.need) & ~(is_in(carrier) | is_in(tilted))
        holds = ~rest.falls & ~(unknown & surely)
        stands = standing(carrier, carried, holds, fixed, on_all=False)
        unknown = stands & ~standing(carrier, carried, holds & ~unknown, fixed, on_all=False)
    falling = np.flatnonzero(~stands[lower])
    goes = np.bincount(upper[falling], minlength=count) > 0
    cause = np.select(
        [stands, hangs, margin <= bodies.need, goes, slides],
        ['', 'hangs', 'unsupported', GOES, 'slides'], 'tips under its load')
    if not fixed.any():  # so that nothing is known of what stands
        cause[:] = ''
    goes_with = np.arange(count)
    falling = falling[cause[upper[falling]] == GOES]
    goes_with[upper[falling]] = lower[falling]
    for _ in range(count.bit_length()):
        goes_with = goes_with[goes_with]
    goes_with[(cause != GOES) | (cause[goes_with] == cause)] = -1
    return Verdict(stands & ~unknown, unknown, cause, goes_with, hangs & ~stands,
                   np.where(fixed, np.inf, margin),
                   np.where(fixed & (rest is not None), np.inf, loaded))

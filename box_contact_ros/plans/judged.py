# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What of a plan cannot be judged, and what is told though nothing is wrong with it."""
from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..solver.contacts_of import TooManyNear, contacts_of
from .meetings import most_near
from .plan import Fault, Plan

STEPS = 2.0**-22
"""Tolerance that float32 coordinates need [of the largest]: four times what rounds one."""
SHORT = 2.0**16
"""Numbers of so many steps or fewer may be float32 by chance, such as 0.5 and 12.25."""


def faults_of(plan: Plan, fixed: np.ndarray, tolerances: np.ndarray) -> list[Fault]:
    """Return the faults; fixed: by body, tolerances: (n,) by box [m]."""
    is_fixed = fixed[plan.body]
    faults = [*_fixed_overlaps(plan, np.flatnonzero(is_fixed), tolerances)]
    if not fixed.any():
        faults.append(Fault('support', (), 'not judged: nothing is fixed'))
    elif is_fixed.all():
        faults.append(Fault('support', (), 'not judged: nothing may move'))
    free = np.flatnonzero(~is_fixed)
    if plan.masses is None and np.isfinite(plan.limits[free]).any():
        faults.append(Fault('mass', tuple(plan.names[box] for box in free),
                            'has no mass, so limits are not judged'))
    place = plan.poses[free, :3]
    need = STEPS * np.abs(place).max(initial=0.0)
    shares = np.frexp(place)[0] * SHORT
    if tolerances.max(initial=0.0) < need and (place == place.astype(np.float32)).all() and (
            shares != np.rint(shares)).any():
        faults.append(Fault('rounding', (), f'coordinates are float32: they need a tolerance of '
                            f'{need:.2g} m, and it is {tolerances.max():.2g} m'))
    return faults


def _fixed_overlaps(plan: Plan, fixed: np.ndarray, tolerances: np.ndarray) -> Iterator[Fault]:
    """Yield which fixed boxes overlap the deepest, and which that were only taken as fixed."""
    try:
        pairs, contacts = contacts_of(plan.sizes[fixed], plan.poses[fixed],
                                      most_near=most_near(len(fixed)))
    except TooManyNear:
        return
    pairs = fixed[pairs]
    rows = -contacts.separation > tolerances[pairs].min(axis=1)
    rows &= plan.body[pairs[:, 0]] != plan.body[pairs[:, 1]]
    rows &= ~np.isin(pairs @ (len(plan), 1), np.sort(plan.apart, axis=1) @ (len(plan), 1))
    taken = {name for fault in plan.faults if fault.kind == 'held' for name in fault.names}
    may_move = np.array([name in taken for name in plan.names], bool)[pairs].any(axis=1)
    for some, kind, end in ((rows & may_move, 'overlap', ''),
                            (rows & ~may_move, 'fixed', ', and both are fixed')):
        if some.any():
            depth = -contacts.separation[some]
            more = f'; {len(depth) - 1:,} more pairs overlap less' if len(depth) > 1 else ''
            yield Fault(kind, tuple(plan.names[box] for box in pairs[some][depth.argmax()]),
                        f'{1e3 * depth.max():.1f} mm deep{end}{more}')

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Is this plan sound? Overlaps, support, loads and limits of all boxes, in one call."""
from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import replace
from itertools import compress

import numpy as np
from numpy.typing import ArrayLike

from ..core import native
from ..extras import require
from ..solver.checks import as_floats, as_number, short_repr
from ..solver.contacts_of import TooManyNear, contacts_of
from ..solver.faces import TOLERANCE, corner_shares
from ..solver.pose import rotation_matrix
from .inspection import OVER, Inspection
from .meetings import Meetings, beds_of, bodies_of, mass_centres, meetings_of, most_near
from .plan import Fault, Plan
from .read_plan import read_any
from .room import are_beyond, beyond
from .standing import heights
from .statics import Bodies, Rest, Work, settle
from .steps import falls_of
from .verdict import verdict_of
from .ways import SIDES, blocked_ways

FRICTION = 0.5  # Coulomb's μ where nobody tells one: cartons on wood
MANY = 10_000  # with more boxes progress is shown: they take a second or more
STEPS = 2.0**-22
"""Tolerance that float32 coordinates need [of the largest]: four times what rounds one."""
SHORT = 2.0**16  # numbers of so many steps or fewer may be float32 by chance, such as 0.5 and 12.25


def inspect_plan(plan: Plan | str | os.PathLike[str], *, tolerance: float | None = None,
                 friction: float = FRICTION, acceleration: ArrayLike = (0.0, 0.0, -9.81),
                 bears: str | None = None, sides: bool = False, loaded_from: str | None = None,
                 ) -> Inspection:
    """Return what is wrong with a plan, and what each of its boxes carries.

    plan: or the path of a file, as `read_plan` takes it.
    tolerance: the gap up to which faces touch, and the depth up to which boxes do not overlap [m];
    None: of each pair 1e-4, or a quarter of its thinner box, if that is less.
    friction: Coulomb's μ of ground, walls and boxes of which the plan has none; a pair has the
    lesser one.
    acceleration: (3,) that the boxes feel, gravity included [m/s²]: (3.92, 0, −9.81) on a lorry
    that brakes along +x by 0.4 g.
    bears: 'faces', or 'corners': a box stands on its corners alone, as a container does. They bear
    on the ground, and on corner castings of the box below. None: as the file has it, else 'faces'.
    sides: whether boxes beside each other carry by friction.
    loaded_from: 'above', '+x', '-x', '+y' or '-y': where the boxes of a plan with an order come
    from, each by a straight way; None: ways are not judged.

    A plan with an order is judged at each of its steps, too.

    Loads need the extra `plans`; a plan without masses does not. Boxes whose loads would take
    more than 1 GB or about 15 s are not judged, the largest groups first; nor are steps beyond
    that.
    Raises ValueError, with field and value, for bad input, and for too many boxes in one place.
    """
    if isinstance(plan, str | os.PathLike):
        plan, of_file, _ = read_any(plan)
        bears = bears or of_file
    bears = bears or 'faces'
    if not isinstance(plan, Plan):
        raise ValueError(f'plan must be a Plan, not {short_repr(plan)}')
    if bears not in ('faces', 'corners'):
        raise ValueError(f"bears must be 'faces' or 'corners', not {short_repr(bears)}")
    if not isinstance(sides, (bool, np.bool_)):
        raise ValueError(f'sides must be True or False, not {short_repr(sides)}')
    if loaded_from not in (None, *SIDES):
        raise ValueError(f'loaded_from must be one of {", ".join(SIDES)}, not '
                         f'{short_repr(loaded_from)}')
    if loaded_from is not None and plan.order is None:
        raise ValueError(f'loaded_from is {loaded_from!r}, but the plan has no order')
    tolerances = _tolerances(plan, tolerance)
    friction = as_number(friction, 'friction')
    if not 0.0 <= friction < np.inf:
        raise ValueError(f'friction must be 0 or more, and finite, not {friction:g}')
    felt = as_floats(acceleration, 'acceleration', 'a vector (3,)', (3,))
    if not 0.0 < np.abs(felt).max() < np.inf:
        raise ValueError(f'acceleration must have a length, not {short_repr(acceleration)}')
    may_meet = meetings_of(plan, tolerances, felt, friction, bool(sides), bears == 'corners')
    meet = may_meet.among(plan.body, np.ones_like(may_meet.fixed))
    if faults := _faults_of(plan, meet.fixed, tolerances):
        plan = replace(plan, faults=(*plan.faults, *faults))
    bodies, work = bodies_of(plan, meet), Work()
    found = replace(_judged(plan, meet, bodies, work, tolerances), friction=friction)
    return _as_loaded(found, may_meet, bodies, work, tolerances, loaded_from)


def _as_loaded(found: Inspection, meet: Meetings, bodies: Bodies, work: Work,
               tolerances: np.ndarray, loaded_from: str | None) -> Inspection:
    """Return what was found, with the steps and the ways of a plan that has an order."""
    plan, faults, ways = found.plan, [], found.ways
    steps, unknown = falls_of(plan, meet, bodies, work)
    if names := tuple(plan.names[box] for box in unknown if found.stands[box] or found.cause[box]):
        faults.append(Fault('loads', names, 'not judged at each step: too many boxes bear on each '
                            'other'))
    if loaded_from is not None:
        try:
            ways = blocked_ways(plan, meet, tolerances, loaded_from)
        except TooManyNear:
            faults.append(Fault('way', (), 'not judged: too many boxes are on the ways'))
    if faults:
        plan = replace(plan, faults=(*plan.faults, *faults))
    return replace(found, plan=plan, steps=steps, loaded_from=loaded_from, ways=ways)


def _faults_of(plan: Plan, fixed: np.ndarray, tolerances: np.ndarray) -> list[Fault]:
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


def _tolerances(plan: Plan, value: float | None) -> np.ndarray:
    """Return the tolerance of each box (n,); a pair has the smaller one."""
    thinnest = plan.sizes.min(axis=1)
    if value is None:
        return np.minimum(TOLERANCE, thinnest / 4.0)
    tolerance, most = as_number(value, 'tolerance'), thinnest.min(initial=np.inf) / 2.0
    if not 0.0 <= tolerance <= most:
        name = f' {short_repr(plan.names[thinnest.argmin()])}' if len(plan) else ''
        raise ValueError(f'tolerance must be from 0 to {most:g} m, half of the thinnest box{name}, '
                         f'not {tolerance:g}')
    return np.full(len(plan), tolerance)


def _loads(plan: Plan, meet: Meetings, bodies: Bodies, work: Work,
           ) -> tuple[Rest | None, np.ndarray, np.ndarray]:
    """Return what patches carry, their centres of pressure (k, 3), and the greatest (k,) [Pa].

    Pressures are empty where corners bear.
    """
    if plan.masses is None:
        return None, meet.patches.centre, np.zeros(0)
    require('plans')
    from tqdm import tqdm

    patches, frame = meet.patches, meet.frame
    sides = patches.rectangle[:, (1, 3)] - patches.rectangle[:, :1]
    with tqdm(total=int((~meet.fixed).sum()), unit='box', desc='loads', leave=False,
              disable=len(plan) <= MANY) as bar:
        rest = settle(bodies, beds_of(plan, meet), work, bar.update)
    centre = rest.centre @ frame
    if meet.by_corners:
        return rest, centre, np.zeros(0)
    first = sides[:, 0] / np.linalg.norm(sides[:, 0], axis=1, keepdims=True)
    plane = np.stack((first, np.cross(meet.normal, first)), axis=2)
    unit = native.bed_pressures(
        np.ascontiguousarray((patches.polygon - patches.centre[:, None]) @ plane),
        patches.corner_count, np.einsum('ki,kij->kj', centre - patches.centre, plane))
    presses = rest.load > 0.0
    return rest, centre, np.where(presses, rest.load * unit, 0.0 * rest.load)


def _judged(plan: Plan, meet: Meetings, bodies: Bodies, work: Work, tolerances: np.ndarray,
            ) -> Inspection:
    count, body, up = len(plan), plan.body, meet.frame[2]
    rest, at, pressures = _loads(plan, meet, bodies, work)
    verdict = verdict_of(plan, meet, bodies, rest)
    if verdict.unknown.any():
        plan = replace(plan, faults=(*plan.faults, Fault(
            'loads', tuple(compress(plan.names, verdict.unknown[body])),
            'not judged: too many boxes bear on each other')))
    lower, upper = meet.pairs[meet.carries].T
    area = (meet.patches.area * (meet.normal @ up))[meet.carries]
    turned = np.abs(up @ rotation_matrix(plan.poses[:, 3:]))  # cosines of the faces of each box
    face = np.arange(count), turned.argmax(axis=1)  # most across `up`
    base = plan.sizes.prod(axis=1) / plan.sizes[face] * turned[face]
    share = np.bincount(upper, area, count) / base
    share = np.minimum(share, 1.0)  # what carries a box may overlap
    share[meet.fixed[body]] = 1.0
    pressing = np.full(len(meet.pairs), np.nan) if rest is None else rest.load
    load, pressure = np.full((2, count), np.nan)
    if rest is not None:
        load = np.bincount(lower, pressing[meet.carries], count)
        if not meet.by_corners:
            pressure = np.zeros(count)
            with np.errstate(invalid='ignore'):  # what is not known stays so
                np.maximum.at(pressure, lower, pressures[meet.carries])
    most = np.linalg.norm(meet.felt) * plan.limits
    cause = verdict.cause[body]
    cause[(cause == '') & (load > (1.0 + OVER) * most)] = 'overloaded'
    overlaps = meet.overlaps
    outside = beyond(plan, meet.fixed[body], tolerances)
    if outside.any():  # which tells more than that a box overlaps a wall
        overlaps = overlaps & ~are_beyond(plan, meet.met, outside, tolerances)
    first = np.unique(body, return_index=True)[1]
    mass, centre = np.nan, np.full(3, np.nan)
    if plan.masses is not None:
        mass = float(plan.masses.sum())
        centre = plan.masses @ mass_centres(plan) / mass if mass > 0.0 else centre
    return Inspection(
        plan=plan, tolerance=float(tolerances.max(initial=0.0)), acceleration=meet.felt,
        overlaps=np.sort(meet.met[overlaps], axis=1), depths=-meet.met_separation[overlaps],
        outside=outside, stands=verdict.stands[body], cause=cause,
        goes_with=np.where(verdict.goes_with >= 0, first[verdict.goes_with], -1)[body],
        height=heights(plan.sizes, plan.poses, meet.frame, body, verdict.hangs), share=share,
        margin=verdict.margin[body], loaded_margin=verdict.loaded_margin[body], load=load,
        pressure=pressure, carried_by=meet.pairs, loads=pressing, corners=meet.patches.rectangle,
        corner_loads=pressing[:, None] * corner_shares(meet.patches.rectangle, at), mass=mass,
        centre_of_mass=centre)

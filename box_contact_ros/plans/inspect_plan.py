# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Is this plan sound? Overlaps, support, loads and limits of all boxes, in one call."""
from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import compress

import numpy as np
from numpy.typing import ArrayLike

from ..core import native
from ..extras import require
from ..solver.checks import as_floats, as_number, short_repr
from ..solver.contacts_of import TooManyNear
from ..solver.faces import TOLERANCE, corner_shares
from .inspection import OVER, Inspection
from .judged import faults_of
from .meetings import Meetings, beds_of, bodies_of, mass_centres, meetings_of
from .plan import Fault, Plan
from .room import are_beyond, beyond
from .standing import base_areas, heights
from .statics import Bodies, Rest, settle
from .steps import falls_of
from .verdict import verdict_of
from .ways import SIDES, blocked_ways

MANY = 10_000
"""With more boxes progress is shown: they take a second or more."""


def inspect_plan(plan: Plan, *, tolerance: float | None = None, friction: ArrayLike = 0.5,
                 acceleration: ArrayLike = (0.0, 0.0, -9.81), bears: str = 'faces',
                 sides: bool = False, loaded_from: str | None = None) -> Inspection:
    """Return what is wrong with a plan, and what each of its boxes carries.

    tolerance: the gap up to which faces touch, and the depth up to which boxes do not overlap [m];
    None: of each pair 1e-4, or a quarter of its thinner box, if that is less.
    friction: Coulomb's μ, or that of each box (n,): a pair has the lesser of both.
    acceleration: (3,) that the boxes feel, gravity included [m/s²]: (3.92, 0, −9.81) on a lorry
    that brakes along +x by 0.4 g.
    bears: 'faces', or 'corners': a box stands on its corners alone, as a container does. They bear
    on the ground, and on corner castings of the box below.
    sides: whether boxes beside each other carry by friction.
    loaded_from: 'above', '+x', '-x', '+y' or '-y': where the boxes of a plan with an order come
    from, each by a straight way; None: ways are not judged.

    A plan with an order is judged at each of its steps, too.

    Loads need the extra `plans`; a plan without masses does not. Boxes whose loads would take
    more than 1 GB or about 20 s are not judged, the largest groups first; nor are steps beyond
    another 20 s.
    Raises ValueError, with field and value, for bad input, and for too many boxes in one place.
    """
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
    frictions = _frictions(plan, friction)
    felt = as_floats(acceleration, 'acceleration', 'a vector (3,)', (3,))
    if not 0.0 < np.abs(felt).max() < np.inf:
        raise ValueError(f'acceleration must have a length, not {short_repr(acceleration)}')
    may_meet = meetings_of(plan, tolerances, felt, bool(sides), bears == 'corners')
    meet = may_meet.among(plan.body, np.ones_like(may_meet.fixed))
    if faults := faults_of(plan, meet.fixed, tolerances):
        plan = replace(plan, faults=(*plan.faults, *faults))
    bodies = bodies_of(plan, meet)
    found = _judged(plan, meet, bodies, None if plan.masses is None else
                    _loads(plan, meet, bodies, frictions), tolerances)
    return _as_loaded(found, may_meet, bodies, None if plan.masses is None else frictions,
                      tolerances, loaded_from)


def _as_loaded(found: Inspection, meet: Meetings, bodies: Bodies, friction: np.ndarray | None,
               tolerances: np.ndarray, loaded_from: str | None) -> Inspection:
    """Return what was found, with the steps and the ways of a plan that has an order."""
    plan, faults, ways = found.plan, [], found.ways
    steps, unknown = falls_of(plan, meet, bodies, friction)
    if names := tuple(plan.names[box] for box in unknown if found.stands[box] or found.cause[box]):
        faults.append(Fault('support', names, 'not judged at each step: too many boxes bear on '
                            'each other', lacks='judgement'))
    if loaded_from is not None:
        try:
            ways = blocked_ways(plan, meet, tolerances, loaded_from)
        except TooManyNear:
            faults.append(Fault('way', (), 'not judged: too many boxes are on the ways'))
    if faults:
        plan = replace(plan, faults=(*plan.faults, *faults))
    return replace(found, plan=plan, steps=steps, loaded_from=loaded_from, ways=ways)


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


def _frictions(plan: Plan, value: ArrayLike) -> np.ndarray:
    """Return the friction of each box (n,)."""
    if np.isscalar(value) or isinstance(value, np.ndarray) and not value.shape:
        value = np.full(len(plan), as_number(value, 'friction'))
    friction = as_floats(value, 'friction', 'a number, or one for each box', (len(plan),))
    is_bad = ~((friction >= 0.0) & (friction < np.inf))
    if is_bad.any():
        raise ValueError(f'friction must be 0 or more, and finite, not {friction[is_bad][0]:g}')
    return friction


@dataclass(frozen=True, eq=False)
class _Loads:
    """What the patches carry."""

    rest: Rest
    centre: np.ndarray  # (k, 3) of pressure, common frame [m]
    pressure: np.ndarray  # (k,) the greatest [Pa]; none where corners bear


def _loads(plan: Plan, meet: Meetings, bodies: Bodies, friction: np.ndarray) -> _Loads:
    require('plans')
    from tqdm import tqdm

    patches, frame = meet.patches, meet.frame
    sides = patches.rectangle[:, (1, 3)] - patches.rectangle[:, :1]
    with tqdm(total=int((~meet.fixed).sum()), unit='box', desc='loads', leave=False,
              disable=len(plan) <= MANY) as bar:
        rest = settle(bodies, beds_of(plan, meet, friction), bar.update)
    centre = rest.centre @ frame
    if meet.by_corners:
        return _Loads(rest, centre, np.zeros(0))
    first = sides[:, 0] / np.linalg.norm(sides[:, 0], axis=1, keepdims=True)
    plane = np.stack((first, np.cross(meet.normal, first)), axis=2)
    unit = native.bed_pressures(
        np.ascontiguousarray((patches.polygon - patches.centre[:, None]) @ plane),
        patches.corner_count, np.einsum('ki,kij->kj', centre - patches.centre, plane))
    presses = rest.load > 0.0
    return _Loads(rest, centre, np.where(presses, rest.load * unit, 0.0 * rest.load))


def _judged(plan: Plan, meet: Meetings, bodies: Bodies, loads: _Loads | None,
            tolerances: np.ndarray) -> Inspection:
    count, body, up = len(plan), plan.body, meet.frame[2]
    verdict = verdict_of(plan, meet, bodies, None if loads is None else loads.rest)
    if verdict.unknown.any():
        plan = replace(plan, faults=(*plan.faults, Fault(
            'support', tuple(compress(plan.names, verdict.unknown[body])),
            'not judged: too many boxes bear on each other', lacks='judgement')))
    lower, upper = meet.pairs[meet.carries].T
    area = (meet.patches.area * (meet.normal @ up))[meet.carries]
    share = np.bincount(upper, area, count) / base_areas(plan.sizes, plan.poses, up)
    share = np.minimum(share, 1.0)  # what carries a box may overlap
    share[meet.fixed[body]] = 1.0
    pressing = np.full(len(meet.pairs), np.nan) if loads is None else loads.rest.load
    load, pressure = np.full((2, count), np.nan)
    shares = np.full((len(pressing), 4), np.nan)
    if loads is not None:
        load = np.bincount(lower, pressing[meet.carries], count)
        if not meet.by_corners:
            pressure = np.zeros(count)
            with np.errstate(invalid='ignore'):  # what is not known stays so
                np.maximum.at(pressure, lower, loads.pressure[meet.carries])
        shares = corner_shares(meet.patches.rectangle, loads.centre)
    most = np.linalg.norm(meet.felt) * plan.limits
    cause = verdict.cause[body]
    cause[(cause == '') & (load > (1.0 + OVER) * most)] = 'overloaded'
    depth, overlaps = -meet.met_separation, meet.overlaps
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
        overlaps=np.sort(meet.met[overlaps], axis=1), depths=depth[overlaps], outside=outside,
        stands=verdict.stands[body], cause=cause,
        goes_with=np.where(verdict.goes_with >= 0, first[verdict.goes_with], -1)[body],
        height=heights(plan.sizes, plan.poses, meet.frame, body, verdict.hangs), share=share,
        margin=verdict.margin[body], loaded_margin=verdict.loaded_margin[body], load=load,
        pressure=pressure,
        carried_by=meet.pairs, loads=pressing, corners=meet.patches.rectangle,
        corner_loads=pressing[:, None] * shares, mass=mass, centre_of_mass=centre)

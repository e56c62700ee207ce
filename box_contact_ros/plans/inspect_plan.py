# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Is this plan sound? Overlaps, support, loads and limits of all boxes, in one call."""
from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from itertools import compress

import numpy as np
from numpy.typing import ArrayLike

from ..core import native
from ..extras import require
from ..solver.checks import as_floats, as_number, short_repr
from ..solver.contacts_of import contacts_of
from ..solver.faces import TOLERANCE, FacePatches, corner_shares, face_patches
from ..solver.pose import rotation_matrix
from .bearings import Bearings, on_corners, on_faces
from .crowd import most_near
from .inspection import OVER, Inspection
from .judged import faults_of
from .plan import Fault, Plan
from .room import are_beyond, beyond
from .standing import across_of, base_areas, heights, hull_margins, needs, standing
from .statics import LEVEL, Beds, Bodies, Rest, settle

BESIDE = np.sqrt(0.5)
"""Cosine between gravity and a normal below which two boxes are beside each other: that of 45°."""
WEIGHTLESS = 1e-4
"""Weight of a body without a mass, divided by that of the heaviest: it must be carried too."""
MANY = 10_000
"""With more boxes progress is shown: they take a second or more."""


def inspect_plan(plan: Plan, *, tolerance: float | None = None, friction: float = 0.5,
                 acceleration: ArrayLike = (0.0, 0.0, -9.81), bears: str = 'faces',
                 sides: bool = False) -> Inspection:
    """Return what is wrong with a plan, and what each of its boxes carries.

    tolerance: the gap up to which faces touch, and the depth up to which boxes do not overlap [m];
    None: of each pair 1e-4, or a quarter of its thinner box, if that is less.
    friction: Coulomb's μ of all pairs.
    acceleration: (3,) that the boxes feel, gravity included [m/s²]: (3.92, 0, −9.81) on a lorry
    that brakes along +x by 0.4 g.
    bears: 'faces', or 'corners': a box stands on its corners alone, as a container does. They bear
    on the ground, and on corner castings of the box below.
    sides: whether boxes beside each other carry by friction.

    Loads need the extra `plans`; a plan without masses does not. Boxes whose loads would take
    more than 1 GB or about 20 s are not judged, the largest groups first.
    Raises ValueError, with field and value, for bad input, and for too many boxes in one place.
    """
    if not isinstance(plan, Plan):
        raise ValueError(f'plan must be a Plan, not {short_repr(plan)}')
    if bears not in ('faces', 'corners'):
        raise ValueError(f"bears must be 'faces' or 'corners', not {short_repr(bears)}")
    if not isinstance(sides, (bool, np.bool_)):
        raise ValueError(f'sides must be True or False, not {short_repr(sides)}')
    tolerances = _tolerances(plan, tolerance)
    friction = as_number(friction, 'friction')
    if not 0.0 <= friction < np.inf:
        raise ValueError(f'friction must be 0 or more, and finite, not {friction:g}')
    felt = as_floats(acceleration, 'acceleration', 'a vector (3,)', (3,))
    if not 0.0 < np.abs(felt).max() < np.inf:
        raise ValueError(f'acceleration must have a length, not {short_repr(acceleration)}')
    meet = _meetings(plan, tolerances, felt, bool(sides), bears == 'corners')
    if faults := faults_of(plan, meet.fixed, tolerances):
        plan = replace(plan, faults=(*plan.faults, *faults))
    bodies = _bodies(plan, meet)
    return _judged(plan, meet, bodies, None if plan.masses is None else
                   _loads(plan, meet, bodies, friction), tolerances)


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


@dataclass(frozen=True, eq=False)
class _Meetings:
    """The pairs of boxes that meet, and the k patches of those that bear each other."""

    felt: np.ndarray  # (3,) acceleration [m/s²]
    frame: np.ndarray  # (3, 3) rows: two directions across it, and the one against it
    fixed: np.ndarray  # (b,) bodies on the ground
    met: np.ndarray  # (m, 2) all pairs
    met_separation: np.ndarray  # (m,) [m]
    overlaps: np.ndarray  # (m,) bool
    on_top: np.ndarray  # (m,) bool: the second is on the first
    pairs: np.ndarray  # (k, 2) the lower and the upper box
    carries: np.ndarray  # (k,) bool: the lower one carries the upper one; else they are beside
    need: np.ndarray  # (b,) how far the centre of a body must be inside its hull [m]
    normal: np.ndarray  # (k, 3) from the lower box to the upper one
    patches: FacePatches  # k
    bearings: Bearings  # k
    by_corners: bool


def _meetings(plan: Plan, tolerances: np.ndarray, felt: np.ndarray, sides: bool, by_corners: bool,
              ) -> _Meetings:
    fixed = np.zeros(plan.body.max(initial=-1) + 1, bool)
    fixed[plan.body[plan.ground]] = True
    pairs, contacts = contacts_of(plan.sizes, plan.poses, fixed=fixed[plan.body],
                                  tolerance=tolerances, most_near=most_near(len(plan)))
    rows = plan.body[pairs[:, 0]] != plan.body[pairs[:, 1]]
    if len(plan.apart):
        rows &= ~np.isin(pairs @ (len(plan), 1), np.sort(plan.apart, axis=1) @ (len(plan), 1))
    pairs, contacts = pairs[rows], contacts[rows]
    up = -felt / np.linalg.norm(felt)
    across = across_of(up)[0]
    slope = contacts.normal @ up
    normal = np.where(slope[:, None] > 0.0, contacts.normal, -contacts.normal)
    pairs = np.where(slope[:, None] > 0.0, pairs, pairs[:, ::-1])
    tolerance = tolerances[pairs].min(axis=1)
    patches = _patches(plan, pairs, normal, tolerance)
    on_top = np.abs(slope) >= BESIDE
    # Boxes beside each other may overlap by the tolerance: a strip that wide carries nothing.
    bears = (patches.width > tolerance) & (on_top | sides)
    overlaps = -contacts.separation > tolerance
    carried = np.bincount(plan.body[pairs[bears & on_top & ~overlaps, 1]], minlength=len(fixed)) > 0
    # What overlaps a box carries it only if nothing else does.
    bear = np.flatnonzero(bears & (~overlaps | on_top & ~carried[plan.body[pairs[:, 1]]]))
    patches, carries = patches[bear], on_top[bear]
    held = bear[carries]
    return _Meetings(
        felt, np.stack((across, np.cross(up, across), up)), fixed, pairs, contacts.separation,
        overlaps, on_top, pairs[bear], carries,
        needs(plan.sizes, pairs[held], contacts.separation[held], tolerance[held],
              plan.body[pairs[held, 1]], len(fixed)), normal[bear], patches,
        on_corners(plan.sizes, plan.poses, pairs[bear], normal[bear], patches, tolerance[bear],
                   fixed[plan.body]) if by_corners else on_faces(patches), by_corners)


def _patches(plan: Plan, pairs: np.ndarray, normal: np.ndarray, tolerance: np.ndarray,
             ) -> FacePatches:
    """Return the patches of pairs (m, 2), each with its tolerance (m,)."""
    values = np.unique(tolerance)
    if len(values) < 2:
        return face_patches(plan.sizes, plan.poses, pairs, normal,
                            tolerance=float(values[0]) if len(values) else 0.0)
    rows = [np.flatnonzero(tolerance == value) for value in values]
    parts = [face_patches(plan.sizes, plan.poses, pairs[some], normal[some],
                          tolerance=float(value)) for value, some in zip(values, rows)]
    order = np.argsort(np.concatenate(rows))
    return FacePatches(*(np.concatenate([getattr(part, field) for part in parts])[order]
                         for field in FacePatches.__dataclass_fields__))


def _bodies(plan: Plan, meet: _Meetings) -> Bodies:
    """Return the bodies of the boxes, in the frame of what they feel."""
    count = len(meet.fixed)

    def sums(values: np.ndarray) -> np.ndarray:
        rows = [np.bincount(plan.body, column, count) for column in np.atleast_2d(values.T)]
        return np.array(rows).T.reshape(count, *values.shape[1:])

    masses = np.ones(len(plan)) if plan.masses is None else plan.masses
    given = sums(masses)
    masses = np.where(given[plan.body] > 0.0, masses, 1.0)  # to find a centre
    mass = sums(masses)
    place = _mass_centres(plan)
    centre = sums(masses[:, None] * place) / mass[:, None]
    arm = ((place - centre[plan.body])**2).sum(axis=1)
    gyration = np.sqrt(sums(masses * ((plan.sizes**2).sum(axis=1) / 12.0 + arm)) / mass)
    heaviest = given[~meet.fixed].max(initial=0.0) or 1.0
    weight = np.linalg.norm(meet.felt) * np.where(given > 0.0, given, WEIGHTLESS * heaviest)
    return Bodies(weight, centre @ meet.frame.T, gyration, meet.fixed, meet.need)


def _mass_centres(plan: Plan) -> np.ndarray:
    """Return the centre of mass of each box (n, 3), common frame."""
    return plan.poses[:, :3] + np.einsum('nij,nj->ni', rotation_matrix(plan.poses[:, 3:]),
                                         plan.centres)


@dataclass(frozen=True, eq=False)
class _Loads:
    """What the patches carry."""

    rest: Rest
    centre: np.ndarray  # (k, 3) of pressure, common frame [m]
    pressure: np.ndarray  # (k,) the greatest [Pa]; none where corners bear


def _loads(plan: Plan, meet: _Meetings, bodies: Bodies, friction: float) -> _Loads:
    require('plans')
    from tqdm import tqdm

    patches, frame = meet.patches, meet.frame
    sides = patches.rectangle[:, (1, 3)] - patches.rectangle[:, :1]
    beds = Beds(
        pairs=plan.body[meet.pairs], carries=meet.carries, normal=meet.normal @ frame.T,
        centre=patches.centre @ frame.T, area=patches.area,
        radius=np.sqrt((sides**2).sum(axis=(1, 2)) / 12.0),
        bearings=meet.bearings.in_frame(frame))
    with tqdm(total=int((~meet.fixed).sum()), unit='box', desc='loads', leave=False,
              disable=len(plan) <= MANY) as bar:
        rest = settle(bodies, beds, friction, bar.update)
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


@dataclass(frozen=True, eq=False)
class _Verdict:
    """Which of the b bodies stand, and why others do not."""

    stands: np.ndarray  # bool
    unknown: np.ndarray  # bool: it stands if those stand whose loads take too much
    cause: np.ndarray
    goes_with: np.ndarray  # the body with which one falls; −1: none
    hangs: np.ndarray  # bool
    margin: np.ndarray  # [m]
    loaded_margin: np.ndarray  # [m]


def _verdict(plan: Plan, meet: _Meetings, bodies: Bodies, loads: _Loads | None) -> _Verdict:
    body, fixed, count = plan.body, meet.fixed, len(meet.fixed)
    lower, upper = body[meet.pairs[meet.carries]].T
    hull = meet.bearings.hull[meet.carries] @ meet.frame[:2].T
    margin = hull_margins(hull, upper, bodies.centre[:, :2])
    hangs = np.bincount(body[meet.met[meet.on_top, 1]], minlength=count) == 0
    slides, unknown = np.zeros((2, count), bool)
    if loads is None:
        loaded = np.full(count, np.nan)
        stands = standing(lower, upper, margin > bodies.need, fixed)
    else:
        loaded, missing = loads.rest.margin, np.abs(loads.rest.missing)
        slides = np.hypot(missing[:, 0], missing[:, 1]) > missing[:, 2:].max(axis=1)
        beside = body[meet.pairs[~meet.carries & ~(loads.rest.load <= 0.0)]]
        carried_by = np.vstack((np.stack((lower, upper), axis=1), beside, beside[:, ::-1]))
        unknown = np.isnan(missing).any(axis=1)
        # Whatever the loads are, a box falls that nothing carries, or that carries nothing and is
        # level, with its centre outside.
        tilted = upper[(meet.normal @ meet.frame[2])[meet.carries] <= 1.0 - LEVEL]
        is_in = partial(np.isin, np.arange(count))
        surely = ~is_in(carried_by[:, 1]) | (margin <= bodies.need) & ~(
            is_in(carried_by[:, 0]) | is_in(tilted))
        holds = ~loads.rest.falls & ~(unknown & surely)
        stands = _resting(carried_by, holds, fixed)
        unknown = stands & ~_resting(carried_by, holds & ~unknown, fixed)
    falling = np.flatnonzero(~stands[lower])
    goes = np.bincount(upper[falling], minlength=count) > 0
    cause = np.select(
        [stands, hangs, margin <= bodies.need, goes, slides],
        ['', 'hangs', 'unsupported', 'goes with what falls', 'slides'], 'tips under its load')
    if not fixed.any():  # so that nothing is known of what stands
        cause[:] = ''
    goes_with = np.arange(count)
    falling = falling[cause[upper[falling]] == 'goes with what falls']
    goes_with[upper[falling]] = lower[falling]
    for _ in range(count.bit_length()):
        goes_with = goes_with[goes_with]
    goes_with[(cause != 'goes with what falls') | (cause[goes_with] == cause)] = -1
    return _Verdict(stands & ~unknown, unknown, cause, goes_with, hangs & ~stands,
                    np.where(fixed, np.inf, margin),
                    np.where(fixed & (loads is not None), np.inf, loaded))


def _resting(carried_by: np.ndarray, holds: np.ndarray, fixed: np.ndarray) -> np.ndarray:
    """Return which bodies (b,) hold by themselves and rest on one that stands."""
    stands = fixed
    while True:
        rests = np.zeros(len(fixed), bool)
        rests[carried_by[stands[carried_by[:, 0]], 1]] = True
        higher = fixed | holds & rests
        if np.array_equal(higher, stands):
            return stands
        stands = higher


def _judged(plan: Plan, meet: _Meetings, bodies: Bodies, loads: _Loads | None,
            tolerances: np.ndarray) -> Inspection:
    count, body, up = len(plan), plan.body, meet.frame[2]
    verdict = _verdict(plan, meet, bodies, loads)
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
        centre = plan.masses @ _mass_centres(plan) / mass if mass > 0.0 else centre
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

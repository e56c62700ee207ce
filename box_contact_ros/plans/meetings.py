# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which boxes of a plan meet, which of them bear each other and where, and the bodies they make."""
from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..core import DEPTH_FLOOR
from ..solver.contacts_of import TooManyNear, contacts_of
from ..solver.faces import FacePatches, face_patches
from ..solver.pose import rotation_matrix
from .bearings import Bearings, on_corners, on_faces
from .plan import Plan
from .statics import Beds, Bodies

BESIDE = np.sqrt(0.5)
"""Cosine between gravity and a normal below which two boxes are beside each other: that of 45°."""
WEIGHTLESS = 1e-4
"""Weight of a body without a mass, divided by that of the heaviest: it must be carried too."""


MOST_PAIRS, MOST_EACH = 200_000, 10
"""Pairs that are judged, in all and for each box more: those that do not overlap have few."""


def most_near(count: int) -> int:
    """Return how many pairs of so many boxes are judged: 2,000 in one place take 1.3 GB."""
    return MOST_PAIRS + MOST_EACH * count


@dataclass(frozen=True, eq=False)
class Meetings:
    """The m pairs of boxes that meet, and the k patches of those that bear each other."""

    felt: np.ndarray  # (3,) acceleration [m/s²]
    frame: np.ndarray  # (3, 3) rows: two directions across it, and the one against it
    fixed: np.ndarray  # (b,) bodies on the ground
    met: np.ndarray  # (m, 2) all pairs
    met_separation: np.ndarray  # (m,) [m]
    overlaps: np.ndarray  # (m,) bool
    on_top: np.ndarray  # (m,) bool: the second is on the first
    row: np.ndarray  # (k,) of all patches
    of_met: np.ndarray  # (k,) which of all pairs it is of
    pairs: np.ndarray  # (k, 2) the lower and the upper box
    carries: np.ndarray  # (k,) bool: the lower one carries the upper one; else they are beside
    needs: np.ndarray  # (k,) how far a centre that it carries must be inside the hull [m]
    normal: np.ndarray  # (k, 3) from the lower box to the upper one
    friction: np.ndarray  # (k,) the lesser of both boxes
    patches: FacePatches  # k
    bearings: Bearings  # k
    by_corners: bool

    def need(self, body: np.ndarray) -> np.ndarray:
        """Return how far the centres of bodies (b,) must be inside their hulls [m]."""
        need = np.zeros(len(self.fixed))
        np.maximum.at(need, body[self.pairs[self.carries, 1]], self.needs[self.carries])
        return need

    def among(self, body: np.ndarray, here: np.ndarray) -> Meetings:
        """Return those of the bodies that are here (b,), as if there were no others.

        What overlaps a box carries it only if nothing else does.
        """
        met = here[body[self.met]].all(axis=1)
        rows = met[self.of_met]
        overlaps, upper = self.overlaps[self.of_met], body[self.pairs[:, 1]]
        carried = np.bincount(upper[rows & self.carries & ~overlaps], minlength=len(here)) > 0
        rows &= ~overlaps | self.carries & ~carried[upper]
        return replace(
            self, met=self.met[met], met_separation=self.met_separation[met],
            overlaps=self.overlaps[met], on_top=self.on_top[met],
            of_met=(np.cumsum(met) - 1)[self.of_met[rows]],
            **{name: getattr(self, name)[rows] for name in (
                'row', 'pairs', 'carries', 'needs', 'normal', 'friction', 'patches', 'bearings')})


def meetings_of(plan: Plan, tolerances: np.ndarray, felt: np.ndarray, friction: float, sides: bool,
                by_corners: bool) -> Meetings:
    """Return which boxes meet, and all patches that may bear, whatever else does.

    tolerances: (n,) by box [m]. felt: (3,) acceleration, gravity included [m/s²].
    friction: of boxes that have none.
    Raises ValueError for more pairs than are judged.
    """
    fixed = np.zeros(plan.body.max(initial=-1) + 1, bool)
    fixed[plan.body[plan.ground]] = True
    try:
        pairs, contacts = contacts_of(plan.sizes, plan.poses, fixed=fixed[plan.body],
                                      tolerance=tolerances, most_near=most_near(len(plan)))
    except TooManyNear as error:
        names = ' and '.join(plan.names[box] for box in error.pairs[0])
        raise ValueError(f'more than {most_near(len(plan)):,} pairs of boxes overlap or touch, '
                         f'such as {names}: too many to be judged') from None
    rows = plan.body[pairs[:, 0]] != plan.body[pairs[:, 1]]
    if len(plan.apart):
        rows &= ~np.isin(pairs @ (len(plan), 1), np.sort(plan.apart, axis=1) @ (len(plan), 1))
    pairs, contacts = pairs[rows], contacts[rows]
    up = -felt / np.linalg.norm(felt)
    across = np.linalg.svd(up[None])[2][1]
    slope = contacts.normal @ up
    normal = np.where(slope[:, None] > 0.0, contacts.normal, -contacts.normal)
    pairs = np.where(slope[:, None] > 0.0, pairs, pairs[:, ::-1])
    tolerance = tolerances[pairs].min(axis=1)
    patches = _patches(plan, pairs, normal, tolerance)
    on_top = np.abs(slope) >= BESIDE
    overlaps = -contacts.separation > tolerance
    # Boxes beside each other may overlap by the tolerance: a strip that wide carries nothing.
    bear = np.flatnonzero((patches.width > tolerance) & (on_top | sides & ~overlaps))
    patches, rubs = patches[bear], plan.frictions(friction)[pairs[bear]].min(axis=1)
    # Tolerance and depth; boxes that merely touch count as pressed together by the solver's share
    # of the larger one, those that overlap by the tolerance.
    pressed = DEPTH_FLOOR * plan.sizes.max(axis=1)[pairs[bear]].max(axis=1, initial=0.0)
    depth = np.maximum(np.minimum(-contacts.separation, tolerance)[bear], pressed)
    return Meetings(
        felt, np.stack((across, np.cross(up, across), up)), fixed, pairs, contacts.separation,
        overlaps, on_top, np.arange(len(bear)), bear, pairs[bear], on_top[bear],
        tolerance[bear] + depth, normal[bear], rubs, patches, on_corners(
            plan.sizes, plan.poses, pairs[bear], normal[bear], patches, tolerance[bear],
            fixed[plan.body]) if by_corners else on_faces(patches), by_corners)


def overlaps_of(plan: Plan, tolerance: float) -> int:
    """Return how many pairs of boxes overlap by more than a tolerance [m], up to `most_near`."""
    fixed = np.isin(np.arange(len(plan)), plan.ground)
    try:
        _, contacts = contacts_of(plan.sizes, plan.poses, fixed=fixed,
                                  most_near=most_near(len(plan)))
    except TooManyNear:
        return most_near(len(plan))
    return int(np.count_nonzero(-contacts.separation > tolerance))


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


def bodies_of(plan: Plan, meet: Meetings) -> Bodies:
    """Return the bodies of the boxes, in the frame of what they feel."""
    count = len(meet.fixed)

    def sums(values: np.ndarray) -> np.ndarray:
        rows = [np.bincount(plan.body, column, count) for column in np.atleast_2d(values.T)]
        return np.array(rows).T.reshape(count, *values.shape[1:])

    masses = np.ones(len(plan)) if plan.masses is None else plan.masses
    given = sums(masses)
    masses = np.where(given[plan.body] > 0.0, masses, 1.0)  # to find a centre
    mass = sums(masses)
    place = mass_centres(plan)
    centre = sums(masses[:, None] * place) / mass[:, None]
    arm = ((place - centre[plan.body])**2).sum(axis=1)
    gyration = np.sqrt(sums(masses * ((plan.sizes**2).sum(axis=1) / 12.0 + arm)) / mass)
    heaviest = given[~meet.fixed].max(initial=0.0) or 1.0
    weight = np.linalg.norm(meet.felt) * np.where(given > 0.0, given, WEIGHTLESS * heaviest)
    return Bodies(weight, centre @ meet.frame.T, gyration, meet.fixed,
                  meet.need(plan.body))


def beds_of(plan: Plan, meet: Meetings) -> Beds:
    """Return the patches as beds between bodies, in the frame of what they feel."""
    patches, frame = meet.patches, meet.frame
    sides = patches.rectangle[:, (1, 3)] - patches.rectangle[:, :1]
    return Beds(
        pairs=plan.body[meet.pairs], carries=meet.carries, normal=meet.normal @ frame.T,
        centre=patches.centre @ frame.T, area=patches.area, friction=meet.friction,
        radius=np.sqrt((sides**2).sum(axis=(1, 2)) / 12.0),
        bearings=replace(meet.bearings, point=meet.bearings.point @ frame.T,
                         hull=meet.bearings.hull @ frame.T))


def mass_centres(plan: Plan) -> np.ndarray:
    """Return the centre of mass of each box (n, 3), common frame."""
    return plan.poses[:, :3] + np.einsum('nij,nj->ni', rotation_matrix(plan.poses[:, 3:]),
                                         plan.centres)

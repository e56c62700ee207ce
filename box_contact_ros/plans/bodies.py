# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bodies of boxes and other shapes, as simulators have them, to a plan of the boxes.

What moves and touches a shape that is no box, or has one, is not judged: it is taken as fixed, and
named. So is what touches nothing while some shape is not known, and what feels no gravity. Joints
stay as they are in the file, so what they join is one body.
"""
from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Hashable, Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..solver.checks import pose_fault, size_fault
from ..solver.contacts_of import TooManyNear, contacts_of
from ..solver.faces import TOLERANCE
from ..solver.pose import rotation_matrix
from .crowd import crowd, deepest_of, most_near
from .packing import slab_below
from .plan import Fault, Plan

NEAR = 0.1
"""Up to this separation [m], pairs that may not touch are named in the plan."""
UNMOVED = {'verdict': 'sound', 'lacks': ''}
"""Of the fault that a shape is no box, where nothing moves."""
HERE = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


class Solid(NamedTuple):
    """A shape that collides."""

    name: str
    kind: str  # 'box', 'plane', or what else it is
    size: Sequence[float] | None  # of its bounding box, full extents [m]; None: not known
    pose: np.ndarray  # (7,) in the common frame; the normal of a plane is its z axis
    body: Hashable


class Weight(NamedTuple):
    """Mass [kg] of a body or a part of it, and its centre (3,) in the common frame [m]."""

    mass: float
    centre: np.ndarray


def within(frame: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Return a pose in a frame as one in the frame around it."""
    v, w, position, turn = frame[3:6], frame[6], pose[:3], pose[3:]
    moved = position + 2.0 * np.cross(v, np.cross(v, position) + w * position) / (v @ v + w * w)
    return np.r_[frame[:3] + moved, w * turn[:3] + turn[3] * v + np.cross(v, turn[:3]),
                 w * turn[3] - v @ turn[:3]]


def total(weights: Iterable[Weight]) -> Weight:
    """Return the weight of several parts."""
    parts = list(weights)
    mass = sum(part.mass for part in parts)
    if not mass:
        return Weight(0.0, np.mean([part.centre for part in parts], axis=0))
    return Weight(mass, np.sum([part.mass * part.centre for part in parts], axis=0) / mass)


def plan_of_bodies(solids: Sequence[Solid], fixed: set[Hashable],
                   weights: Mapping[Hashable, Weight],
                   may_touch: Callable[[int, int], bool], faults: list[Fault], *,
                   is_whole: bool = True, afloat: Collection[Hashable] = ()) -> Plan:
    """Return the plan of the boxes and planes among solids.

    fixed: bodies that do not move. weights: of those that do.
    may_touch: whether two solids, by index, may touch at all.
    is_whole: whether all that collides is among the solids. afloat: bodies without gravity.
    Raises ValueError where no box is left, because none can be read.
    """
    solids, places = _readable(solids, faults)
    boxes = [n for n, solid in enumerate(solids) if solid.kind == 'box']
    lost = [fault for fault in faults if fault.kind in ('pose', 'dimension')]
    if not boxes and lost:
        raise ValueError(f'no box can be read; {lost[0].names[0]}: {lost[0].text}')
    solids = [_as_slab(solid, [solids[n] for n in boxes]) if solid.kind == 'plane' else solid
              for solid in solids]
    kept = [n for n, solid in enumerate(solids) if solid.kind in ('box', 'plane')]
    pairs, touches = _near(solids, fixed, lambda a, b: may_touch(places[a], places[b]), faults)
    shapes = [solid for solid in solids if solid.kind not in ('box', 'plane')]
    if shapes:
        counts = Counter(solid.kind for solid in shapes)
        moves = any(solid.body not in fixed for solid in solids)
        faults.append(Fault('shape', tuple(solid.name for solid in shapes), ', '.join(
            f'{count} {kind}' for kind, count in counts.items()) + ': no box, so left out', **(
                {} if moves else UNMOVED)))
    unjudged = _unjudged(solids, pairs[touches], fixed, may_touch, places,
                         is_whole and all(solid.size is not None for solid in shapes))
    for held, why in (({*afloat} - fixed, 'feels no gravity'), *unjudged):
        names = tuple(solids[n].name for n in boxes if solids[n].body in held)
        if names:
            faults.append(Fault('shape', names, f'{why}: taken as fixed, and not judged',
                                lacks='judgement'))
        fixed = fixed | held
    row_of = {n: row for row, n in enumerate(kept)}
    apart = [(row_of[a], row_of[b]) for a, b in pairs.tolist()
             if a in row_of and b in row_of and not may_touch(places[a], places[b])]
    bodies = list(dict.fromkeys(solids[n].body for n in kept))
    number = {body: n for n, body in enumerate(bodies)}
    masses, centres = _shared([solids[n] for n in kept], weights)
    return Plan(
        np.array([solids[n].size for n in kept]).reshape(-1, 3),
        np.array([solids[n].pose for n in kept]).reshape(-1, 7), masses, centres=centres,
        ground=[row for row, n in enumerate(kept) if solids[n].body in fixed],
        names=[solids[n].name for n in kept], body=[number[solids[n].body] for n in kept],
        apart=apart, faults=faults)


def other_gravity(gravity: np.ndarray) -> list[Fault]:
    """Return a fault if gravity (3,) is not along −z, as plans are judged by default."""
    along = np.abs(gravity).max() * 1e-6
    if not np.isfinite(gravity).all() or (np.abs(gravity[:2]) <= along).all() and gravity[2] <= 0:
        return []
    return [Fault('gravity', (), 'it is {:g} {:g} {:g} in the file: judge by it with '
                                 '--acceleration'.format(*gravity))]


def _readable(solids: Sequence[Solid], faults: list[Fault]) -> tuple[list[Solid], list[int]]:
    """Return the solids with a size and a pose, and their places; name the others as faults."""
    kept, places = [], []
    for n, solid in enumerate(solids):
        fault = size_fault(solid.size) if solid.size is not None else ''
        if fault and solid.kind == 'box':
            faults.append(Fault('dimension', (solid.name,), f'size: {fault}: left out'))
        elif pose_fault(solid.pose):
            faults.append(Fault('pose', (solid.name,), f'{pose_fault(solid.pose)}: left out'))
        else:
            kept.append(solid._replace(size=None) if fault else solid)
            places.append(n)
    return kept, places


def _as_slab(plane: Solid, boxes: Sequence[Solid]) -> Solid:
    """Return a slab below a plane that is as large as all boxes need."""
    if not boxes:
        return plane._replace(size=(1.0, 1.0, 1.0))
    axes = rotation_matrix(plane.pose[None, 3:])[0]
    places = np.array([box.pose for box in boxes])
    places[:, :3] = (places[:, :3] - plane.pose[:3]) @ axes
    size, pose = slab_below(np.array([box.size for box in boxes]), places)
    return plane._replace(size=tuple(size), pose=within(plane.pose, pose))


def _near(solids: Sequence[Solid], fixed: set[Hashable], may_touch: Callable[[int, int], bool],
          faults: list[Fault]) -> tuple[np.ndarray, np.ndarray]:
    """Return pairs (k, 2) of solids of two bodies that are near, and which of them touch (k,).

    Of too many, they are those that touch; of still too many, a fault is added, and none returned.
    """
    known = np.array([n for n, solid in enumerate(solids) if solid.size is not None], int)
    if len(known) < 2:
        return np.zeros((0, 2), int), np.zeros(0, bool)
    sizes = np.array([solids[n].size for n in known], float)
    poses = np.array([solids[n].pose for n in known])
    is_fixed = [solids[n].body in fixed for n in known]
    for margin in NEAR, TOLERANCE:
        try:
            rows, contacts = contacts_of(sizes, poses, margin=margin, fixed=is_fixed,
                                         most_near=most_near(len(known)))
            break
        except TooManyNear as error:
            some = error.pairs
    else:
        deep = deepest_of(sizes, poses, some, lambda a, b: (
            solids[known[a]].body != solids[known[b]].body and may_touch(known[a], known[b])),
            TOLERANCE)[0]
        faults.append(crowd([solids[n].name for n in known[deep[:1]].ravel()], len(known)))
        return np.zeros((0, 2), int), np.zeros(0, bool)
    own = np.array([solids[a].body == solids[b].body for a, b in known[rows].tolist()], bool)
    return known[rows[~own]], contacts.separation[~own] <= TOLERANCE


def _unjudged(solids: Sequence[Solid], touching: np.ndarray, fixed: set[Hashable],
              may_touch: Callable[[int, int], bool], places: Sequence[int], is_whole: bool,
              ) -> list[tuple[set[Hashable], str]]:
    """Return the moving bodies that a shape which is no box may carry, and why.

    is_whole: whether the extents of all that collides are known. Otherwise these are also the
    bodies that touch nothing.
    """
    boxed = {solid.body for solid in solids if solid.kind == 'box'} - fixed
    found = {solid.body for solid in solids if solid.kind not in ('box', 'plane')} & boxed
    carried = set()
    for a, b in touching.tolist():
        if may_touch(places[a], places[b]):
            carried |= {solids[a].body, solids[b].body}
            for own, other in (solids[a], solids[b]), (solids[b], solids[a]):
                if other.kind not in ('box', 'plane') and own.body in boxed:
                    found.add(own.body)
    return [(found, 'touches, or is joined to, what is no box'),
            (set() if is_whole else boxed - carried - found,
             'touches nothing, but a mesh or a file that was not read may carry it')]


def _shared(solids: Sequence[Solid], weights: Mapping[Hashable, Weight],
            ) -> tuple[np.ndarray, np.ndarray]:
    """Return masses (n,) and centres (n, 3) of boxes: each has a share of its body by volume.

    All boxes of a body have its centre of mass, in their own frames.
    """
    volumes = np.array([math.prod(solid.size or ()) for solid in solids])
    whole: Counter[Hashable] = Counter()
    for solid, volume in zip(solids, volumes):
        whole[solid.body] += volume
    masses, centres = np.zeros(len(solids)), np.zeros((len(solids), 3))
    axes = rotation_matrix(np.array([solid.pose[3:] for solid in solids]).reshape(-1, 4))
    for n, solid in enumerate(solids):
        if solid.body in weights:
            weight = weights[solid.body]
            masses[n] = weight.mass * volumes[n] / whole[solid.body]
            centres[n] = (weight.centre - solid.pose[:3]) @ axes[n]
    return masses, centres

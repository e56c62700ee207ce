# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A path through a scene: what comes too near on it, when, and how near all else comes.

The time of a path goes from k to k + 1 between pose k and pose k + 1. Bounding boxes find the rides
that matter, as rides.py has them; `time_of_impact` and `least_distance` answer these.
"""
from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ..core import native
from ..solver.checks import absent_poses, as_floats, as_margin, pose_fault
from ..solver.contact_solver import ContactSolver
from ..solver.motion import Approach, Approaches
from ..solver.nearest import Nearests
from ..solver.pose import rotation_matrix
from ..solver.rows import NoTruth
from .rides import Course, Rides, Surroundings, turns_between
from .scene import Pair, Scene

TOLERANCE = 1e-6  # of distances [m]
LEAST_COSINE = 1e-9
"""Of half the turn on a segment: below, it has two ways. That of core/src/motion/turn.hpp."""
PARTING_ANGLE = 0.02
"""Turn [rad] after which boxes that begin within the clearance are looked at once more."""
DEEPER = 1e-4
"""How deep boxes that begin within the clearance may get into each other, or deeper [m]."""
MOST_RIDES = 1000
"""That a search for the least distance takes at first."""
SOLVED = 2048
"""Rides that one step solves: in some milliseconds."""


@dataclass(frozen=True, slots=True, eq=False)
class PathCheck(NoTruth):
    """What a path meets. Boxes are their indices in `scene`; times go from 0 to m − 1."""

    pairs: np.ndarray
    """(k, 2) boxes a and b of the pairs that come within the clearance, in the order of time."""
    impacts: Approaches
    """(k,) their first times: `time`, `closing_speed` [m per unit of time], `nearest`."""
    at_start: np.ndarray
    """(l, 2) pairs within the clearance at the first pose. Until one is apart by it, at a pose or
    after a turn by 0.02 rad on the way there, it is an impact to get into each other, or deeper
    than at first, by 0.1 mm. Deeper than a box is thick, this is not judged."""
    least_pair: np.ndarray | None
    """(2,) the pair that comes nearest, of those never in `at_start`; None: there is none."""
    least: Approach | None
    """When, and how near it comes; where boxes touch, the first of these times."""
    scene: Scene
    revision: int = 0  # of the scene, as of `SceneSolver.set_boxes`

    _instead = '.is_free'

    @classmethod
    def of(cls, found: Found, scene: Scene, revision: int) -> PathCheck:
        """Return what was found in a scene."""
        pair, least = (found.least_pair[0], found.least[0]) if len(found.least) else (None, None)
        return cls(*found[:3], pair, least, scene, revision)

    @property
    def is_free(self) -> bool:
        """Return whether there is no impact."""
        return not len(self.pairs)

    def named(self) -> list[tuple[Pair, Approach]]:
        """Return each pair that comes within the clearance, by name, and its first time."""
        return [(self.scene.pair_of(a, b), impact)
                for (a, b), impact in zip(self.pairs.tolist(), self.impacts)]


class Found(NamedTuple):
    """The arrays of a `PathCheck`."""

    pairs: np.ndarray
    impacts: Approaches
    at_start: np.ndarray
    least_pair: np.ndarray  # (1, 2), or (0, 2)
    least: Approaches  # likewise


def as_path(value: Any, names: Sequence[str], what: str = 'poses') -> np.ndarray:
    """Return poses (m, n, 7) of what moves; ValueError for what is not a path.

    names: of what moves. what: what a refusal calls the path.
    """
    path = as_floats(value, what, f'poses (m, {len(names)}, 7): at each of m times, those of what '
                     f'moves, {", ".join(names) or "which is nothing"}', (None, len(names), 7))
    if len(path) < 2:
        raise ValueError(f'{what} must be those of 2 times or more, not {len(path)}')
    absent = absent_poses(path.reshape(-1, 7)).reshape(path.shape[:2])
    for k, row in np.argwhere(absent != absent[0])[:1]:
        raise ValueError(f'{what}[{k}] of {names[row]}: it is there at some times alone; seven NaN '
                         'at all of them leave it out')
    bad = native.pose_faults(np.ascontiguousarray(path.reshape(-1, 7))) != 0
    for k, row in np.argwhere(bad.reshape(absent.shape) & ~absent)[:1]:
        raise ValueError(f'{what}[{k}] of {names[row]}: {pose_fault(path[k, row])}')
    half_turns = turns_between(path)[1] > math.pi - 2.0 * LEAST_COSINE
    for k, row in np.argwhere(half_turns)[:1]:
        raise ValueError(f'{what}[{k}] to {what}[{k + 1}] of {names[row]}: a turn by 180 degrees '
                         'has two ways: give a pose between')
    return path


def course_of(scene: Scene, standing: np.ndarray, path: np.ndarray, around: Surroundings,
              ) -> Course:
    """Return the course of a scene.

    standing: poses (n, 7) of boxes, of which those of fixed boxes are read.
    path: poses (m, k, 7) of `scene.moving`, checked.
    around: of the fixed boxes.
    """
    is_here = ~absent_poses(path[0])
    rows = np.array([scene.row_of[name] for name in scene.moving], np.int64)[is_here]
    group, allowed = scene.groups
    return Course(scene.sizes, np.where(scene.is_fixed[:, None], standing, np.nan),
                  *moved_boxes(scene, rows, path[:, is_here]), scene.rigid, scene.rows, group,
                  allowed, around, np.flatnonzero(scene.is_fixed))


def moved_boxes(scene: Scene, rows: np.ndarray, path: np.ndarray,
                ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the boxes (l,) that move, their poses (m, l, 7) and centres of turning (l, 3).

    rows: (k,) of boxes and bodies, by `scene.row_of`. path: their poses (m, k, 7).
    """
    count = len(scene.boxes)
    column = np.full(count + len(scene.bodies), -1)
    column[rows] = np.arange(len(rows))
    of_box = np.where(scene.body_of < 0, np.arange(count), count + scene.body_of)
    boxes = np.flatnonzero(column[of_box] >= 0)
    body_rows, local = scene.placement
    of_body = body_rows[boxes] >= 0
    poses, centres = path[:, column[of_box[boxes]]], np.zeros((len(boxes), 3))
    if of_body.any():
        # Boxes of all times behind one another, and then their bodies.
        parts, bases = local[boxes[of_body]], poses[:, of_body].reshape(-1, 7)
        places = np.concatenate((np.empty_like(bases), bases))
        native.place_boxes(places, np.arange(len(bases), 2 * len(bases)),
                           np.tile(parts, (len(path), 1)))
        poses[:, of_body] = places[:len(bases)].reshape(len(path), -1, 7)
        centres[of_body] = -np.einsum('nji,nj->ni', rotation_matrix(parts[:, 3:]), parts[:, :3])
    return boxes, poses, centres


def check_course(course: Course, clearance: float) -> Generator[None, None, Found]:
    """Return what comes within a clearance [m], and how near all else comes.

    A generator, so that a node can answer ticks between its steps.
    """
    rides = Rides(course)
    radius = as_margin(clearance, 'clearance') + TOLERANCE
    near, _ = yield from rides.within(radius)
    pairs = near[near[:, 0] == 0, 1:]
    held = pairs[rides.at_first(pairs).distance <= radius]
    near = near[~rides.are_of(near, held)]
    rides.leave_out(held)
    impacts = yield from _solved(rides, near, clearance)
    touches = impacts
    if clearance and len(near):
        touches = yield from _solved(rides, near, 0.0)
    if (rows := _first_rows(near, touches)[:1]).size:
        least_pair, least = near[rows, 1:], touches[rows]
    else:
        least_pair, least = yield from _least(rides, near, radius)
    parts = [(near, impacts)]
    for pair, depth in zip(held, rides.depths_at_first(held).tolist()):
        parts += _after_parting(rides, pair, clearance), _pressed(rides, pair, depth)
        yield
    near = np.concatenate([part for part, _ in parts])
    impacts = _joined([found for _, found in parts])
    rows = _first_rows(near, impacts)
    return Found(near[rows, 1:], impacts[rows], held, least_pair, least)


def _solved(rides: Rides, near: np.ndarray, clearance: float,
            ) -> Generator[None, None, Approaches]:
    """Return the first times of rides within a clearance [m], in steps."""
    parts = []
    for first in range(0, max(1, len(near)), SOLVED):
        parts.append(rides.solve(near[first:first + SOLVED], clearance))
        yield
    return _joined(parts)


def _first_rows(rides: np.ndarray, found: Approaches) -> np.ndarray:
    """Return the row of the first time of each pair that has one, in the order of time."""
    _, a, b = rides.T
    order = np.lexsort((b, a, found.time))
    order = order[np.isfinite(found.time[order])]
    _, first = np.unique(rides[order, 1:], axis=0, return_index=True)
    return order[np.sort(first)]


def _joined(parts: list[Approaches]) -> Approaches:
    """Return the rows of all parts."""
    def joined(arrays: list[Any], name: str) -> np.ndarray:
        return np.concatenate([getattr(array, name) for array in arrays])

    nearest = [part.nearest for part in parts]
    return Approaches(joined(parts, 'time'), joined(parts, 'closing_speed'), Nearests(*(
        joined(nearest, name) for name in Nearests.__dataclass_fields__)))


def _after_parting(rides: Rides, pair: np.ndarray, clearance: float,
                   ) -> tuple[np.ndarray, Approaches]:
    """Return the ride on which a pair first meets, from where it is first apart, and when.

    Apart is farther than the clearance and two tolerances: what is as near as that may be answered.
    """
    turns = sum(rides.turns_of(int(box)) for box in pair)
    looks = 1 + np.ceil(turns / PARTING_ANGLE).astype(np.int64)  # of each segment
    segments = np.repeat(np.arange(rides.segments), looks)
    shares = (np.arange(len(segments)) - np.repeat(np.cumsum(looks) - looks, looks) + 1) / (
        looks[segments])
    solver = ContactSolver(*rides.course.sizes[pair])
    seen = solver.distance_batch(*(rides.poses_at(int(box), segments, shares) for box in pair))
    apart = np.flatnonzero(seen.distance > clearance + 2.0 * TOLERANCE)[:1]
    begin = int(apart[0]) + 1 if apart.size else len(seen)
    share = float(shares[begin - 1]) % 1.0 if apart.size else 0.0  # 1: the next segment begins
    later = np.arange(segments[begin - 1] + (share == 0.0), rides.segments)[:, None]
    near = np.hstack((later, np.broadcast_to(pair, (len(later), 2))))
    found = rides.solve(near, clearance, first_from=share)
    rows = _first_rows(near, found)
    return near[rows], found[rows]


def _pressed(rides: Rides, pair: np.ndarray, depth: float) -> tuple[np.ndarray, Approaches]:
    """Return the ride on which a pair first gets into each other, and when.

    depth: of the pair at the first pose [m]. Boxes that are smaller by so much, and by DEEPER, are
    apart there. Where one is not as thick as that, it is not known what is deeper.
    """
    near = np.column_stack((np.arange(rides.segments), np.tile(pair, (rides.segments, 1))))
    found = rides.solve(near, 0.0, smaller=depth + DEEPER)
    rows = _first_rows(near, found)
    rows = rows[found.time[rows] > 0.0]
    near, found = near[rows], found[rows]
    places = (rides.poses_at(int(box), near[:, 0], found.time - near[:, 0]) for box in pair)
    return near, replace(found, nearest=ContactSolver(*rides.course.sizes[pair]).distance_batch(
        *places))


def _least(rides: Rides, near: np.ndarray, radius: float,
           ) -> Generator[None, None, tuple[np.ndarray, Approaches]]:
    """Return the pair (1, 2) that comes nearest, and how near, of boxes that do not touch.

    near: the rides whose bounding boxes are within a radius [m]. The radius grows
    until a ride is found, and then to its distance: nothing beyond it is nearer.
    """
    best = near[:0, 1:], rides.solve(near[:0], None)
    bound, most, is_all = np.inf, MOST_RIDES, True
    while True:
        gaps = rides.gaps(near)
        order = np.argsort(gaps, kind='stable')
        first, size = 0, 8
        while first < len(order):
            rows = order[first:first + size]
            asked = near[rows[gaps[rows] < bound - TOLERANCE]]
            if np.isfinite(bound) and len(asked):  # few of them come nearer, and this takes less
                asked = asked[np.isfinite(rides.solve(asked, bound - TOLERANCE).time)]
            if len(asked):
                found = rides.solve(asked, None)
                row = int(np.argmin(found.nearest.distance))
                if found.nearest.distance[row] < bound:
                    bound, best = found.nearest.distance[row], (
                        asked[row:row + 1, 1:], found[row:row + 1])
            first, size = first + size, min(4 * size, SOLVED)
            yield
        if is_all and (bound - TOLERANCE <= radius or radius > rides.farthest):
            return best
        most *= 1 if is_all else 4
        radius = min(bound - TOLERANCE, max(4.0 * radius, rides.step))
        near, is_all = yield from rides.within(radius, most)

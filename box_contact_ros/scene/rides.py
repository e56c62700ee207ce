# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The rides of a path: each pair of boxes on each of its segments, and which of them matter.

Segment k goes from pose k to pose k + 1. A ride is a row (k, a, b) of an array: boxes on segment k.
"""
from __future__ import annotations

import sys
from collections.abc import Generator
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from ..core import native
from ..solver.contact_solver import ContactSolver
from ..solver.motion import Approaches, Sweep
from ..solver.nearest import Nearests
from ..solver.pose import rotation_matrix

ROUNDING = 64 * 2.0**-52
"""Of a bounding box, as a share of the largest coordinate."""
LEAST_PART = 1e-3
"""Of an extent, that is left of a box."""
DENSE_RIDES = 1 << 16
"""Rides of pairs without a broad phase that are looked at together."""


class Surroundings:
    """The fixed boxes of a scene, and a broad phase that finds which of them are near others."""

    def __init__(self, sizes: np.ndarray, poses: np.ndarray) -> None:
        """Take full extents (f, 3) [m] and poses (f, 7)."""
        self._sizes, self._fixed = sizes, poses
        self._poses = poses  # with those of the boxes that were asked about
        self._phase: native.BroadPhase | None = None

    def near(self, middles: np.ndarray, halves: np.ndarray, most: int) -> np.ndarray:
        """Return the pairs (k, 2), a fixed box and one of s upright boxes, that may touch.

        middles, halves: (s, 3) of the upright boxes [m]. The search ends with more than `most`.
        """
        first, count = len(self._fixed), len(middles)
        if self._phase is None or len(self._poses) < first + count:
            room = max(count, 2 * (len(self._poses) - first))
            self._poses = np.concatenate((self._fixed, np.full((room, 7), np.nan)))
            is_asked = np.arange(first + room) >= first
            self._phase = native.BroadPhase(
                np.concatenate((self._sizes, np.ones((room, 3)))), ~is_asked, 0.0,
                np.zeros((0, 2), np.int64), is_asked.astype(np.int32),
                np.array([[0, 1], [0, 0]], np.uint8), np.full(first + room, -1, np.int32))
        rows, asked = np.arange(first, first + count), self._poses[first:]
        asked[:] = np.nan
        asked[:count, :3], asked[:count, 3:] = middles, (0.0, 0.0, 0.0, 1.0)
        self._phase.resize(rows, np.clip(2.0 * halves, native.LENGTH_MIN, native.LENGTH_MAX))
        return self._phase.find(self._poses, most)[0] - [0, first]


class Course(NamedTuple):
    """Boxes of which some move along a path, and which of them are pairs."""

    sizes: np.ndarray  # (n, 3)
    standing: np.ndarray  # (n, 7) poses; NaN: of those that move, or are not there
    movers: np.ndarray  # (l,) boxes that move
    path: np.ndarray  # (m, l, 7) their poses
    centres: np.ndarray  # (l, 3) of turning, in the boxes' frames
    rigid: np.ndarray  # (n,) a number that boxes share which are never a pair
    listed: np.ndarray  # (p, 2) pairs
    group: np.ndarray  # (n,)
    allowed: np.ndarray  # (g, g), as of `Scene.groups`
    around: Surroundings
    fixed: np.ndarray  # (f,) the boxes of `around`


def turns_between(path: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return axes (m − 1, n, 3) and angles (m − 1, n) from each of poses (m, n, 7) to the next.

    Axes of turns by next to nothing are zeros, and other ones unit vectors.
    """
    turns = path[..., 3:] / np.linalg.norm(path[..., 3:], axis=-1, keepdims=True)
    start, end = turns[:-1], turns[1:]
    cosine = np.abs(np.einsum('kij,kij->ki', start, end))
    sines = (start[..., 3:] * end[..., :3] - end[..., 3:] * start[..., :3]
             - np.cross(end[..., :3], start[..., :3]))
    sine = np.linalg.norm(sines, axis=-1)
    return sines / np.maximum(sine, 1e-100)[..., None], 2.0 * np.arctan2(sine, cosine)


def half_extents(poses: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Return the half extents (..., 3) of the bounding boxes of boxes at poses (..., 7)."""
    return np.einsum('...ij,...j->...i', np.abs(rotation_matrix(poses[..., 3:])), 0.5 * sizes)


class Rides:
    """The rides of a course.

    Its arrays of boxes hold those that stand, then the movers of each segment.
    """

    def __init__(self, course: Course) -> None:
        """Bound all boxes, and find which of them are pairs."""
        self.course = course
        self._solver = ContactSolver()
        path, movers = course.path, course.movers
        self.segments, self._count = len(path) - 1, len(course.sizes)
        tiled = np.tile(movers, self.segments)
        self._sizes = np.concatenate((course.sizes, course.sizes[tiled]))
        self._starts, self._ends = (np.concatenate((course.standing, poses.reshape(-1, 7)))
                                    for poses in (path[:-1], path[1:]))
        self._centres = np.zeros((len(self._sizes), 3))
        self._centres[self._count:] = np.tile(course.centres, (self.segments, 1))
        self.column = np.full(self._count, -1)
        self.column[movers] = np.arange(len(movers))
        self._axes, self.angle = turns_between(path)  # (m − 1, l, 3), (m − 1, l)
        self._is_standing = ~np.isnan(course.standing[:, 0])
        self._set_bounds()
        self._find_dense()

    def _set_bounds(self) -> None:
        """Set middles and half extents of the bounding boxes of segments, and what goes with them.

        A corner of a box that turns by an angle is at most reach · angle² / 8 beside the line
        between where it is before and after, at right angles to the axis.
        """
        course, count = self.course, self._count
        extents = half_extents(course.path, course.sizes[course.movers])
        low, high = course.path[..., :3] - extents, course.path[..., :3] + extents
        low, high = np.minimum(low[:-1], low[1:]), np.maximum(high[:-1], high[1:])
        reach = (np.linalg.norm(course.centres, axis=1)
                 + 0.5 * np.linalg.norm(course.sizes[course.movers], axis=1))
        bulge = (reach * self.angle**2 / 8.0)[..., None] * np.sqrt(
            np.maximum(1.0 - self._axes**2, 0.0))
        here = course.standing[self._is_standing, :3]
        largest = max(np.abs(here).max(initial=0.0), np.abs(low).max(initial=0.0),
                      np.abs(high).max(initial=0.0)) + 2.0 * course.sizes.max(initial=0.0)
        self.farthest = 4.0 * float(largest)
        self.step = float(course.sizes[course.movers].max(initial=1.0)) / 8.0
        swept = 0.5 * (high - low) + bulge + ROUNDING * largest
        self._middles = np.concatenate((course.standing[:, :3],
                                        (0.5 * (low + high)).reshape(-1, 3)))
        self._halves = np.concatenate((np.full((count, 3), np.nan), swept.reshape(-1, 3)))

    def _find_dense(self) -> None:
        """Set the pairs that are looked at without a broad phase."""
        course = self.course
        listed = course.listed
        if len(listed):
            known = self._is_standing | (self.column >= 0)
            listed = listed[known[listed].all(axis=1) & (self.column[listed] >= 0).any(axis=1)]
        self._left_out = np.unique(self._keys(course.listed))  # by patterns
        one, other = course.movers[np.array(np.triu_indices(len(course.movers), 1))]
        self._dense = np.concatenate((listed, self._asked(0 * one, one, other)[:, 1:]))

    def _asked(self, segments: np.ndarray, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Return the rides (k, 3) of pairs (n,) that patterns ask for, box a before box b."""
        course = self.course
        if not len(course.allowed):
            return np.zeros((0, 3), np.int64)
        low, high = np.minimum(one, other), np.maximum(one, other)
        order = course.allowed[course.group[low], course.group[high]].copy()
        order[course.rigid[low] == course.rigid[high]] = 0
        if len(self._left_out):
            order[np.isin(low * self._count + high, self._left_out)] = 0
        rides = np.column_stack((segments, np.where(order == 1, low, high),
                                 np.where(order == 1, high, low)))
        return rides[order > 0]

    def _rows(self, rides: np.ndarray) -> np.ndarray:
        """Return the rows (k, 2) of both boxes of rides (k, 3) in arrays of boxes."""
        boxes = rides[:, 1:]
        column = self.column[boxes]
        return np.where(column < 0, boxes, self._count + rides[:, :1] * len(self.course.movers)
                        + column)

    def gaps(self, rides: np.ndarray) -> np.ndarray:
        """Return the distances (k,) of the bounding boxes of rides: at most those of the boxes."""
        a, b = rows = self._rows(rides).T
        new = np.unique(rows[np.isnan(self._halves[rows, 0])])
        self._halves[new] = half_extents(self._starts[new], self._sizes[new])
        apart = np.abs(self._middles[a] - self._middles[b]) - (self._halves[a] + self._halves[b])
        return np.linalg.norm(np.maximum(apart, 0.0), axis=1)

    def within(self, radius: float, most: int = sys.maxsize,
               ) -> Generator[None, None, tuple[np.ndarray, bool]]:
        """Return the rides whose bounding boxes are within a radius [m], and whether these are all.

        Of more than about `most`, some are left out. A generator, with a step for each of many.
        """
        found, is_all = self._near_standing(radius, most)
        parts = [found]
        step = max(1, DENSE_RIDES // max(1, len(self._dense)))
        for first in range(0, self.segments if len(self._dense) else 0, step):
            segments = np.arange(first, min(first + step, self.segments))
            rides = np.column_stack((np.repeat(segments, len(self._dense)),
                                     np.tile(self._dense, (len(segments), 1))))
            parts.append(rides[self.gaps(rides) <= radius])
            yield
        return np.concatenate(parts), is_all

    def _near_standing(self, radius: float, most: int) -> tuple[np.ndarray, bool]:
        """Return the rides of movers and standing boxes that patterns ask for."""
        movers, fixed = self.course.movers, self.course.fixed
        if not (len(movers) and len(fixed) and len(self.course.allowed)):
            return np.zeros((0, 3), np.int64), True
        swept = slice(self._count, None)
        places = self.course.around.near(self._middles[swept], self._halves[swept] + radius, most)
        segments, columns = np.divmod(places[:, 1], len(movers))
        return self._asked(segments, fixed[places[:, 0]], movers[columns]), len(places) <= most

    def leave_out(self, pairs: np.ndarray) -> None:
        """Leave out pairs (l, 2) of what is found from now on."""
        self._dense = self._dense[~np.isin(self._keys(self._dense), self._keys(pairs))]
        self._left_out = np.union1d(self._left_out, self._keys(pairs))

    def are_of(self, rides: np.ndarray, pairs: np.ndarray) -> np.ndarray:
        """Return which rides (k, 3) are those of pairs (l, 2)."""
        return np.isin(self._keys(rides[:, 1:]), self._keys(pairs))

    def _keys(self, pairs: np.ndarray) -> np.ndarray:
        """Return a number for each of pairs (k, 2), the same for (a, b) and (b, a)."""
        return pairs.min(axis=1) * self._count + pairs.max(axis=1)

    def turns_of(self, box: int) -> np.ndarray:
        """Return by which angles a box turns, (segments,) [rad]."""
        column = self.column[box]
        return self.angle[:, column] if column >= 0 else np.zeros(self.segments)

    def poses_at(self, box: int, segments: np.ndarray, shares: np.ndarray) -> np.ndarray:
        """Return the poses (k, 7) of a box after shares (k,) of segments (k,)."""
        column = self.column[box]
        if column < 0:
            return np.broadcast_to(self.course.standing[box], (len(segments), 7)).copy()
        path, centre = self.course.path[:, column], self.course.centres[column]
        turns = path[:, 3:] / np.linalg.norm(path[:, 3:], axis=1)[:, None]
        places = path[:, :3] + rotation_matrix(turns) @ centre
        start, end = turns[segments], turns[segments + 1]
        end = end * np.where(np.einsum('ki,ki->k', start, end) < 0.0, -1.0, 1.0)[:, None]
        half = 0.5 * self.angle[segments, column]
        with np.errstate(invalid='ignore'):  # 0 / 0 without a turn
            before, after = (np.where(half > 1e-6, np.sin(part * half) / np.sin(half), part)
                             for part in (1.0 - shares, shares))
        turn = before[:, None] * start + after[:, None] * end
        place = places[segments] + shares[:, None] * (places[segments + 1] - places[segments])
        return np.hstack((place - rotation_matrix(turn) @ centre, turn))

    def solve(self, rides: np.ndarray, clearance: float | None, *, first_from: float = 0.0,
              smaller: float = 0.0) -> Approaches:
        """Return the first times of rides within a clearance [m]; None: their least distances.

        first_from: the share of its segment at which the first ride begins.
        smaller: by how much all extents of the boxes are [m]; of thinner ones LEAST_PART is left.
        """
        sizes = (np.maximum(self._sizes - smaller, LEAST_PART * self._sizes) if smaller else
                 self._sizes)
        ask = (self._solver.least_distance_batch if clearance is None else
               partial(self._solver.time_of_impact_batch, clearance=clearance))
        rows, starts, shares = self._rows(rides), self._starts, np.zeros(len(rides))
        if first_from:
            shares[0] = first_from
            starts = starts.copy()
            for box, row in zip(rides[0, 1:].tolist(), rows[0]):
                starts[row] = self.poses_at(box, rides[:1, 0], shares[:1])[0]
        found = ask(Sweep(starts, self._ends, self._centres), sizes=sizes, pairs=rows)
        return replace(found, time=rides[:, 0] + shares + (1.0 - shares) * found.time,
                       closing_speed=found.closing_speed / (1.0 - shares))

    def at_first(self, pairs: np.ndarray) -> Nearests:
        """Return the nearest points of pairs (k, 2) at the first pose."""
        return self._solver.distance_batch(self._starts, sizes=self._sizes,
                                           pairs=self._rows_at_first(pairs))

    def depths_at_first(self, pairs: np.ndarray) -> np.ndarray:
        """Return the depths (k,) of pairs (k, 2) at the first pose [m]; 0 of pairs apart."""
        rows = self._rows_at_first(pairs)
        return np.maximum(0.0, -self._solver.batch(
            self._starts, sizes=self._sizes, pairs=rows, patch=False).separation)

    def _rows_at_first(self, pairs: np.ndarray) -> np.ndarray:
        return self._rows(np.column_stack((np.zeros(len(pairs), np.int64), pairs)))

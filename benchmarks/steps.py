# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Steps of a model's answers at vanishing change of pose: searched on smooth paths, bisected.

A path turns and shifts box B, mostly along the contact. Between two of its places the difference of
the model's answer from the exact one may jump. The intervals in which it changes most are bisected
until the poses differ in their last digits.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from box_contact_ros.solver.contact_solver import ContactSolver

from . import probes
from .errors import departures, lengths
from .pose_sets import Pairs, quaternion_multiply, turns

SAMPLES, KEPT, BISECTIONS = 200, 4, 45
NUDGES, NUDGE = 6, 1e-12  # changes of pose at a flip, and how large they are [rad, edge]


@dataclass(frozen=True, kw_only=True)
class Paths:
    """Paths of n pairs: B turns about `axes` (n, 3) by up to `angle` [rad], and shifts [m]."""

    pairs: Pairs
    axes: np.ndarray
    angle: float
    shifts: np.ndarray  # (n, 3)

    def at(self, rows: np.ndarray, times: np.ndarray) -> Pairs:
        """Return the pairs `rows` (m,) at times (m,) from 0 to 1."""
        pairs = self.pairs.rows(rows)
        b = pairs.pose_b.copy()
        b[:, :3] += self.shifts[rows] * times[:, None]
        b[:, 3:] = quaternion_multiply(turns(self.axes[rows], self.angle * times), b[:, 3:])
        return pairs._replace(pose_b=b)


def drawn_paths(rng: np.random.Generator, pairs: Pairs, angle: float, flat: bool) -> Paths:
    """Return paths from pairs in contact; flat: B turns about z."""
    n = len(pairs.pose_a)
    axes, shifts = rng.normal(size=(2, n, 3))
    if flat:
        axes *= (0.01, 0.01, 1.0)
    normal = np.nan_to_num(pairs.contacts().normal)
    shifts *= 0.02 * pairs.edge[:, None]
    shifts -= 0.98 * normal * np.einsum('ni,ni->n', shifts, normal)[:, None]
    return Paths(pairs=pairs, axes=axes, angle=angle, shifts=shifts)


def largest_steps(solver: ContactSolver, paths: Paths,
                  ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the largest steps on each path, (n,) [%]: of point, volume and covariance."""
    n = len(paths.axes)
    rows, times = np.repeat(np.arange(n), SAMPLES), np.tile(np.linspace(0.0, 1.0, SAMPLES), n)
    found = _departures(solver, paths, rows, times)
    steps = []
    for place in range(3):
        change = lengths(found[place][1:] - found[place][:-1])
        change[SAMPLES - 1::SAMPLES] = 0.0  # from one path to the next
        change = np.append(change, 0.0).reshape(n, SAMPLES)
        first = np.argsort(-change, axis=1)[:, :KEPT].ravel()
        steps.append(_bisected(solver, paths, np.repeat(np.arange(n), KEPT), first, place)
                     .reshape(n, KEPT).max(axis=1))
    return steps[0], steps[1], steps[2]


def flip_steps(rng: np.random.Generator, solver: ContactSolver, pairs: Pairs) -> np.ndarray:
    """Return steps where an axis of the patch box flips, (n, 3) [%]: point, volume, covariance.

    pairs: with a mirror or a two-fold turn, which touch: rounding alone decides how their axes are
    mirrored. Each is nudged. Nudges after which other edges make the axes do not count.
    """
    axes, *_ = probes.patch_boxes(pairs)
    rows = np.arange(len(axes))
    steps = np.zeros((len(rows), 3))
    here = _departures(solver, Paths(pairs=pairs, axes=axes[:, 0], angle=0.0,
                                     shifts=np.zeros((len(rows), 3))), rows, np.zeros(len(rows)))
    for _ in range(NUDGES):
        turn, shift = rng.normal(size=(2, len(rows), 3))
        nudges = Paths(pairs=pairs, axes=turn, angle=NUDGE,
                       shifts=NUDGE * pairs.edge[:, None] * shift)
        there = _departures(solver, nudges, rows, np.ones(len(rows)))
        nudged, *_ = probes.patch_boxes(nudges.at(rows, np.ones(len(rows))))
        alike = np.abs(np.einsum('nij,nij->nj', axes, nudged)).min(axis=1) > 1.0 - 1e-6
        found = np.column_stack([lengths(one - other) for one, other in zip(there, here)])
        steps = np.maximum(steps, np.where(alike[:, None], found, 0.0))
    return steps


def _bisected(solver: ContactSolver, paths: Paths, rows: np.ndarray, first: np.ndarray,
              place: int) -> np.ndarray:
    low, high = first / (SAMPLES - 1.0), np.minimum(first + 1, SAMPLES - 1) / (SAMPLES - 1.0)
    at_low, at_high = (_departures(solver, paths, rows, times)[place] for times in (low, high))
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        at_middle = _departures(solver, paths, rows, middle)[place]
        left = lengths(at_middle - at_low) >= lengths(at_high - at_middle)
        high, low = np.where(left, middle, high), np.where(left, low, middle)
        at_high = np.where(left[:, None], at_middle, at_high)
        at_low = np.where(left[:, None], at_low, at_middle)
    return lengths(at_high - at_low)


def _departures(solver: ContactSolver, paths: Paths, rows: np.ndarray, times: np.ndarray,
                ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return how far answers are from the exact ones [%], (m, 3), (m, 1), (m, 9); 0 where apart."""
    pairs = paths.at(rows, times)
    found, truth = pairs.contacts(solver), pairs.contacts()
    with np.errstate(invalid='ignore', divide='ignore'):
        point, volume, covariance = map(np.nan_to_num, departures(found, truth, pairs.edge))
    return point, volume, covariance

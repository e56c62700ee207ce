# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Statics of upright boxes by linear programmes: slow, obvious, and nothing of the package's own.

Loads are forces at the corners of the rectangles that two boxes share. With friction, each is
within a pyramid around the cone of friction, and so a sum of forces along its four edges.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # loads scipy.optimize where it is called
from scipy.sparse import csr_matrix, hstack, identity

SAME = 1e-6  # [m] heights that are one
LEAST = 1e-4  # [m] what two boxes must share at least
HOLDS = 1e-6  # of the weight, what loads may lack: rounding
INSCRIBED = 0.5**0.5  # of a friction, so that the pyramid is within the cone


@dataclass
class Upright:
    """Upright boxes, of which some are fixed."""

    sizes: np.ndarray
    poses: np.ndarray
    masses: np.ndarray
    fixed: np.ndarray
    friction: float | np.ndarray = 0.0
    """Coulomb's μ of all boxes, or (n,); a pair has the lesser one."""
    felt: tuple[float, float] = (0.0, 0.0)
    """What the boxes feel along x and y [of gravity]."""
    sooner: float = 0.0
    """By how much rectangles end within what two boxes share, on each side [m]."""

    def __post_init__(self) -> None:
        low, high = (self.poses[:, :3] + sign * self.sizes / 2 for sign in (-1, 1))
        a, b = np.nonzero(np.abs(high[:, None, 2] - low[None, :, 2]) < SAME)
        rows = ~(self.fixed[a] & self.fixed[b])
        a, b = a[rows], b[rows]
        self.low, self.high = np.maximum(low[a], low[b]), np.minimum(high[a], high[b])
        rows = (self.high - self.low)[:, :2].min(axis=1) > max(LEAST, 2.0 * self.sooner)
        self.low, self.high = self.low[rows] + self.sooner, self.high[rows] - self.sooner
        self.pairs = np.stack((a[rows], b[rows]), axis=1)

    def groups(self) -> list[list[int]]:
        """Return free boxes that are joined by others than fixed ones."""
        joined = {box: {box} for box in np.flatnonzero(~self.fixed).tolist()}
        for a, b in self.pairs.tolist():
            if a in joined and b in joined and joined[a] is not joined[b]:
                joined[a] |= joined[b]
                for box in joined[b]:
                    joined[box] = joined[a]
        return [sorted(group) for group in {id(group): group for group in joined.values()}.values()]

    def equations(self, boxes: list[int], share: float = 0.0,
                  ) -> tuple[csr_matrix, np.ndarray, np.ndarray]:
        """Return A and w of A·f = w, and the pairs' rows (p,).

        A has 3 rows for each box, and 4 columns for each pair; with a share of the friction, 6 and
        16.
        """
        place = np.full(len(self.poses), -1)
        place[boxes] = np.arange(len(boxes))
        pairs = np.flatnonzero((place[self.pairs] >= 0).any(axis=1))
        along = np.array([(x, y, 1.0) for x in (-1.0, 1.0) for y in (-1.0, 1.0)]
                         if share else [(0.0, 0.0, 1.0)])
        rubs = np.broadcast_to(self.friction, len(self.poses))[self.pairs[pairs]].min(axis=1)
        keep = np.arange(6) if share else np.array([2, 3, 4])
        low, high = self.low[pairs], self.high[pairs]
        at = np.stack([np.stack((x[:, 0], y[:, 1], low[:, 2]), axis=1)
                       for x in (low, high) for y in (low, high)], axis=1)
        force = np.tile(along, (len(pairs), 4, 1))
        force[:, :, :2] *= share * rubs[:, None, None]
        column = np.arange(force[:, :, 0].size).reshape(*force.shape[:2], 1)
        parts = []
        for side, sign in ((0, -1), (1, 1)):
            box = place[self.pairs[pairs, side]]
            used = box >= 0
            arm = at[used] - self.poses[self.pairs[pairs[used], side], None, :3]
            torque = np.cross(np.repeat(arm, len(along), axis=1), force[used])
            value = sign * np.concatenate((force[used], torque), axis=2)
            row = len(keep) * box[used, None, None] + np.arange(len(keep))
            parts.append([np.broadcast_to(part, value[..., keep].shape).ravel()
                          for part in (value[..., keep], row, column[used])])
        values, rows, columns = map(np.concatenate, zip(*parts))
        wanted = np.zeros(len(keep) * len(boxes))
        for axis, pull in zip(range(3), (*self.felt, -1.0)):
            if axis in keep:
                wanted[keep.tolist().index(axis)::len(keep)] = -pull * self.masses[boxes]
        return csr_matrix((values, (rows, columns)), (len(wanted), column.size)), wanted, pairs

    def missing(self, groups: list[list[int]], share: float = 0.0) -> np.ndarray:
        """Return the least force and moment that nothing gives groups (n,), by their masses."""
        boxes = [box for group in groups for box in group]
        if not boxes:
            return np.zeros(0)
        matrix, wanted, _ = self.equations(boxes, share)
        eye = identity(len(wanted))
        found = scipy.optimize.linprog(np.repeat((0.0, 1.0), (matrix.shape[1], 2 * len(wanted))),
                        A_eq=hstack((matrix, eye, -eye)), b_eq=wanted, method='highs')
        lack = found.x[matrix.shape[1]:].reshape(2, len(boxes), -1).sum(axis=(0, 2))
        group = np.repeat(np.arange(len(groups)), [len(boxes) for boxes in groups])
        return np.bincount(group, lack) / np.bincount(group, self.masses[boxes])

    def holds(self, groups: list[list[int]], share: float = 0.0) -> np.ndarray:
        """Return for which groups (n,) there are loads that they are at rest with.

        With a share of the friction, those without are asked first, where that is enough.
        """
        if any(self.felt):
            return self.missing(groups, share or 1e-12) < HOLDS
        holds = self.missing(groups) < HOLDS
        others = np.flatnonzero(~holds) if share else np.zeros(0, int)
        holds[others] = self.missing([groups[n] for n in others], share) < HOLDS
        return holds

    def ranges(self, boxes: list[int]) -> dict[tuple[int, int], tuple[float, float]]:
        """Return the least and the greatest load of each pair of a group that can hold [kg]."""
        matrix, wanted, pairs = self.equations(boxes)
        found = {}
        for column, pair in enumerate(pairs):
            cost = np.zeros(matrix.shape[1])
            cost[4 * column:4 * column + 4] = 1.0
            found[tuple(self.pairs[pair].tolist())] = tuple(
                sign * scipy.optimize.linprog(
                    sign * cost, A_eq=matrix, b_eq=wanted, method='highs').fun
                for sign in (1, -1))
        return found

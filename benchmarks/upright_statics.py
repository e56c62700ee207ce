# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Statics of upright boxes by linear programmes: slow, obvious, and nothing of the package's own.

Loads are forces at the corners of the rectangles that two boxes share.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy  # loads scipy.optimize where it is called

SAME = 1e-6  # [m] heights that are one
LEAST = 1e-4  # [m] what two boxes must share at least
HOLDS = 1e-6  # of the weight, what loads may lack: rounding


@dataclass
class Upright:
    """Upright boxes, of which some are fixed."""

    sizes: np.ndarray
    poses: np.ndarray
    masses: np.ndarray
    fixed: np.ndarray
    sooner: float = 0.0
    """By how much rectangles end within what two boxes share, on each side [m]."""

    def __post_init__(self) -> None:
        low, high = (self.poses[:, :3] + sign * self.sizes / 2 for sign in (-1, 1))
        a, b = np.nonzero(np.abs(high[:, None, 2] - low[None, :, 2]) < SAME)
        rows = ~(self.fixed[a] & self.fixed[b])
        a, b = a[rows], b[rows]
        self.low, self.high = np.maximum(low[a], low[b]), np.minimum(high[a], high[b])
        rows = (self.high - self.low)[:, :2].min(axis=1) > LEAST
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

    def equations(self, boxes: list[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return A (3 per box, 4 per pair) and w of A·f = w, and the pairs' rows (p,)."""
        place = {box: row for row, box in enumerate(boxes)}
        pairs = np.flatnonzero(np.isin(self.pairs, boxes).any(axis=1))
        matrix = np.zeros((3 * len(boxes), 4 * len(pairs)))
        for column, pair in enumerate(pairs):
            ends = np.stack((self.low[pair], self.high[pair]))
            for corner, (i, j) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1))):
                for box, sign in zip(self.pairs[pair].tolist(), (-1, 1)):
                    if box in place:
                        x, y = np.array((ends[i, 0], ends[j, 1])) - self.poses[box, :2]
                        matrix[3 * place[box]:3 * place[box] + 3, 4 * column + corner] += (
                            sign, sign * y, -sign * x)
        wanted = np.zeros(3 * len(boxes))
        wanted[::3] = self.masses[boxes]
        return matrix, wanted, pairs

    def missing(self, boxes: list[int]) -> float:
        """Return the least force and moment that nothing gives a group, divided by its mass."""
        matrix, wanted, _ = self.equations(boxes)
        eye = np.eye(len(wanted))
        forces = matrix.shape[1]
        found = scipy.optimize.linprog(
            np.repeat((0.0, 1.0), (forces, 2 * len(eye))),
            A_eq=np.hstack((matrix, eye, -eye)), b_eq=wanted, method='highs')
        return float(found.fun / self.masses[boxes].sum())

    def holds(self, boxes: list[int]) -> bool:
        """Return whether there are loads that a group is at rest with."""
        return self.missing(boxes) < HOLDS

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

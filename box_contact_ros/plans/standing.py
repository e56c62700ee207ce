# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What stands: how far centres are inside the hulls of what carries them, from the ground up."""
from __future__ import annotations

import numpy as np

from ..core import native
from ..solver.pose import rotation_matrix

EDGE = 1e-6
"""What boxes share across gravity at least where one is above the other [m]: rounding is less."""


MOST_LOOKS = 200_000_000  # of boxes that hang at what may be below them: some 5 s


def heights(sizes: np.ndarray, poses: np.ndarray, frame: np.ndarray, body: np.ndarray,
            hangs: np.ndarray) -> np.ndarray:
    """Return how high the boxes (n,) of bodies that hang are above what is below [m].

    frame: (3, 3) rows: two directions across gravity, and the one against it. hangs: by body.
    By bounding boxes along the frame. Infinity: above nothing; NaN: the box does not hang, or more
    boxes are near than are looked at.
    """
    half = np.abs(frame @ rotation_matrix(poses[:, 3:])) @ sizes[:, :, None] / 2.0
    middle, half = poses[:, :3] @ frame.T, half[:, :, 0]
    low, high = middle - half, middle + half
    height = np.full(len(sizes), np.nan)
    order = np.argsort(low[:, 0], kind='stable')
    start, widest, left = low[order, 0], (high - low)[:, 0].max(initial=0.0), MOST_LOOKS
    for box in np.flatnonzero(hangs[body]):
        first, last = np.searchsorted(start, (low[box, 0] - widest, high[box, 0]))
        left -= last - first
        if left < 0:
            break
        others = order[first:last]
        shared = np.minimum(high[others], high[box]) - np.maximum(low[others], low[box])
        below = others[(body[others] != body[box]) & (high[others, 2] <= low[box, 2])
                       & (shared[:, :2] > EDGE).all(axis=1)]
        height[box] = low[box, 2] - high[below, 2].max(initial=-np.inf)
    return height


def hull_margins(points: np.ndarray, upper: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return how far each of n places (n, 2) is inside the hull of what carries it [m].

    points: (k, h, 2) of k patches. upper: (k,) which of the n each patch carries. Outside, it is
    below 0; −infinity: nothing carries it.
    """
    order = np.argsort(upper, kind='stable')
    first = np.searchsorted(upper[order], np.arange(len(at) + 1))
    return native.hull_depths(np.ascontiguousarray(points[order].reshape(-1, 2)),
                              first * points.shape[1], np.ascontiguousarray(at))


def standing(lower: np.ndarray, upper: np.ndarray, holds: np.ndarray, on_ground: np.ndarray, *,
             on_all: bool = True) -> np.ndarray:
    """Return which of n stand: from the ground up, so a ring does not.

    They hold by themselves, and all that carries them stands, or else one that does.
    """
    least = np.bincount(upper, minlength=len(holds)) if on_all else 1
    stands = on_ground
    while True:
        carriers = np.bincount(upper[stands[lower]], minlength=len(holds))
        higher = on_ground | holds & (carriers >= least)
        if np.array_equal(higher, stands):
            return stands
        stands = higher

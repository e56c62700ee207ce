"""Model `exact`: SAT and the centroid of A∩B by clipping, all in float64. The reference."""
from __future__ import annotations

import numpy as np

from .block import (
    LANES,
    SEPARATION,
    TOUCH,
    WORK_SIZE,
)
from .contact import Contacts, sat_normal, write_apart, write_contact
from .jit import kernel
from .overlap import CLIP_SIZE, centroid, press
from .pose import (
    load_block,
)
from .sat import query_block


@kernel
def solve_exact(poses_a, poses_b, sizes_a, sizes_b, work, clip, status,
                colliding, separation, normal, point):
    """Model `exact` for all rows; returns the number of rows refused."""
    bad = 0
    rows = poses_a.shape[0]
    for start in range(0, rows, LANES):
        count = min(LANES, rows - start)
        bad += load_block(poses_a, poses_b, sizes_a, sizes_b, start, count, work, status)
        query_block(count, work)
        for i in range(count):
            if work[SEPARATION + i] <= work[TOUCH + i]:
                press(work, i)
                write_contact(work, i, start + i, sat_normal(work, i), centroid(work, i, clip),
                              colliding, separation, normal, point)
            else:
                write_apart(work, i, start + i, colliding, separation, normal, point)
    return bad


class Exact:
    """SAT + exact centroid, for any sizes."""

    def __init__(self) -> None:
        self._work = np.zeros(WORK_SIZE)
        self._clip = np.zeros(CLIP_SIZE)

    def solve(self, a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
              status: np.ndarray, found: Contacts) -> int:
        """Fill `found` for poses (n, 7), sizes (n or 1, 3); returns how many rows are refused."""
        return int(solve_exact(a, b, size_a, size_b, self._work, self._clip, status, *found))

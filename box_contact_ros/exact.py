"""Model `exact`: SAT and the centroid of A∩B by clipping, all in float64. The reference."""
from __future__ import annotations

import numpy as np

from .block import (
    LANES,
    SEPARATION,
    TOUCH,
    new_work,
)
from .contact import (
    APART,
    REFUSED,
    TOUCHING,
    Contacts,
    sat_normal,
    write_apart,
    write_contact,
    write_faults,
    write_nothing,
    write_one,
)
from .jit import kernel
from .overlap import centroid, press, press_on
from .pose import load_block, load_one, load_sizes
from .sat import query_block


@kernel
def solve_exact(poses_a, poses_b, sizes_a, sizes_b, work, status, colliding, separation, normal,
                point):
    """Model `exact` for all rows; returns the number of rows refused."""
    bad = 0
    rows = poses_a.shape[0]
    for start in range(0, rows, LANES):
        count = min(LANES, rows - start)
        refused = load_block(poses_a, poses_b, sizes_a, sizes_b, start, count, work)
        if refused:
            bad += refused
            write_faults(work, start, count, status)
        query_block(count, work)
        for i in range(count):
            if work[SEPARATION + i] <= work[TOUCH + i]:
                press(work, i)
                press_on(work, i)
                write_contact(work, i, start + i, sat_normal(work, i), centroid(work, i),
                              colliding, separation, normal, point)
            else:
                write_apart(work, i, start + i, colliding, separation, normal, point)
    return bad


@kernel
def one_exact(work, pose_a, pose_b, normal, point):
    """A single pair, poses (7,): writes normal (3,) and point (3,).

    Returns APART, TOUCHING or REFUSED, and the separation.
    """
    if load_one(pose_a, pose_b, work):
        return REFUSED, 0.0
    query_block(1, work)
    if work[SEPARATION] > work[TOUCH]:
        write_nothing(normal, point)
        return APART, work[SEPARATION]
    press(work, 0)
    press_on(work, 0)
    write_one(work, centroid(work, 0), normal, point)
    return TOUCHING, work[SEPARATION]


class Exact:
    """SAT + exact centroid, for any sizes; sizes (2, 3) are those of single calls."""

    one = staticmethod(one_exact)

    def __init__(self, sizes: np.ndarray) -> None:
        self._work = new_work()
        self.one_scratch = (new_work(),)
        load_sizes(sizes, *self.one_scratch)

    def solve(self, a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
              status: np.ndarray, found: Contacts) -> int:
        """Fill `found` for poses (n, 7), sizes (n or 1, 3); returns how many rows are refused."""
        return int(solve_exact(a, b, size_a, size_b, self._work, status, *found))

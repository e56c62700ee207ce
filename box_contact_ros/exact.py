"""Model `exact`: SAT and the centroid of A∩B by clipping, all in float64. The reference."""
from __future__ import annotations

import numpy as np

from .block import (
    BAD_POSE_A,
    FAULT,
    LANES,
    SEPARATION,
    TOUCH,
    new_work,
)
from .contact import Contacts, sat_normal, write_apart, write_contact, write_faults, write_one
from .jit import kernel
from .overlap import centroid, press
from .pose import (
    load_block,
)
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
                write_contact(work, i, start + i, sat_normal(work, i), centroid(work, i),
                              colliding, separation, normal, point)
            else:
                write_apart(work, i, start + i, colliding, separation, normal, point)
    return bad


@kernel
def one_exact(pose_a, pose_b, sizes, work, out):
    """One pair: (FAULT, colliding, separation); sizes (2, 3), out (2, 3): normal and point."""
    if len(pose_a) != 7 or len(pose_b) != 7:
        return BAD_POSE_A, False, 0.0
    refused = load_block(pose_a.reshape(1, -1), pose_b.reshape(1, -1), sizes[:1], sizes[1:], 0, 1,
                         work)
    if refused:
        return int(work[FAULT]), False, 0.0
    query_block(1, work)
    if work[SEPARATION] > work[TOUCH]:
        out[:] = np.nan
        return 0, False, work[SEPARATION]
    press(work, 0)
    write_one(work, centroid(work, 0), out)
    return 0, True, work[SEPARATION]


class Exact:
    """SAT + exact centroid, for any sizes."""

    one = staticmethod(one_exact)

    def __init__(self) -> None:
        self.scratch = (new_work(),)

    def solve(self, a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
              status: np.ndarray, found: Contacts) -> int:
        """Fill `found` for poses (n, 7), sizes (n or 1, 3); returns how many rows are refused."""
        return int(solve_exact(a, b, size_a, size_b, *self.scratch, status, *found))

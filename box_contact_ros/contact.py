"""What a solver says of a pair of boxes, and the kernels that write it down."""
from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .block import (
    AXES_A,
    FAULT,
    LANES,
    NORMAL,
    ORIGIN_A,
    POINT,
    SEPARATION,
    WORLD_NORMAL,
    WORLD_POINT,
)
from .jit import kernel

REFUSED, APART, TOUCHING = -1, 0, 1
"""What a single-pair kernel answers."""


class Contact(NamedTuple):
    """What `ContactSolver` says of one pair of boxes. Frame: that of the poses."""

    colliding: bool
    """True from exact touch on: separation ≤ 8 ulp of the largest coordinate or size."""
    separation: float
    """Signed [m]: negative is the overlap depth, positive the largest gap on a SAT axis."""
    normal: np.ndarray
    """(3,) unit vector from A to B; NaN without contact."""
    point: np.ndarray
    """(3,) centroid of A∩B [m]; NaN without contact."""


class Contacts(NamedTuple):
    """What `ContactSolver.batch` says of n pairs: the fields of `Contact` as arrays."""

    colliding: np.ndarray
    """(n,) bool."""
    separation: np.ndarray
    """(n,) [m]."""
    normal: np.ndarray
    """(n, 3)."""
    point: np.ndarray
    """(n, 3) [m]."""


@kernel
def write_contact(work, i, row, n, p, colliding, separation, normal, point):
    """Write pair `i` of a block to row `row` of the results; n, p are in A's frame."""
    colliding[row] = True
    separation[row] = work[SEPARATION + i]
    for k in range(3):
        a0 = work[AXES_A + 3 * k * LANES + i]
        a1 = work[AXES_A + (3 * k + 1) * LANES + i]
        a2 = work[AXES_A + (3 * k + 2) * LANES + i]
        normal[row, k] = a0 * n[0] + a1 * n[1] + a2 * n[2]
        point[row, k] = work[ORIGIN_A + k * LANES + i] + (a0 * p[0] + a1 * p[1] + a2 * p[2])


@kernel
def to_common_frame(work):
    """NORMAL and POINT of a block to WORLD_NORMAL and WORLD_POINT."""
    for k in range(0, 3 * LANES, LANES):
        for i in range(LANES):
            a0 = work[AXES_A + 3 * k + i]
            a1 = work[AXES_A + 3 * k + LANES + i]
            a2 = work[AXES_A + 3 * k + 2 * LANES + i]
            work[WORLD_NORMAL + k + i] = (a0 * work[NORMAL + i] + a1 * work[NORMAL + LANES + i]
                                          + a2 * work[NORMAL + 2 * LANES + i])
            work[WORLD_POINT + k + i] = work[ORIGIN_A + k + i] + (
                a0 * work[POINT + i] + a1 * work[POINT + LANES + i]
                + a2 * work[POINT + 2 * LANES + i])


@kernel
def write_found(work, i, row, colliding, separation, normal, point):
    """Write pair `i` of a block, brought to the common frame, to row `row` of the results."""
    colliding[row] = True
    separation[row] = work[SEPARATION + i]
    normal[row, 0] = work[WORLD_NORMAL + i]
    normal[row, 1] = work[WORLD_NORMAL + LANES + i]
    normal[row, 2] = work[WORLD_NORMAL + 2 * LANES + i]
    point[row, 0] = work[WORLD_POINT + i]
    point[row, 1] = work[WORLD_POINT + LANES + i]
    point[row, 2] = work[WORLD_POINT + 2 * LANES + i]


@kernel
def sat_normal(work, i):
    """Normal of pair `i` by SAT, in A's frame."""
    return work[NORMAL + i], work[NORMAL + LANES + i], work[NORMAL + 2 * LANES + i]


@kernel
def write_one(work, p, normal, point):
    """Write normal and point, each (3,), of the first pair of a block; p is in A's frame."""
    for k in range(3):
        a0 = work[AXES_A + 3 * k * LANES]
        a1 = work[AXES_A + (3 * k + 1) * LANES]
        a2 = work[AXES_A + (3 * k + 2) * LANES]
        normal[k] = (a0 * work[NORMAL] + a1 * work[NORMAL + LANES]
                     + a2 * work[NORMAL + 2 * LANES])
        point[k] = work[ORIGIN_A + k * LANES] + (a0 * p[0] + a1 * p[1] + a2 * p[2])


@kernel
def write_nothing(normal, point):
    """Write the normal and the point of a single pair that does not touch."""
    for k in range(3):
        normal[k] = math.nan
        point[k] = math.nan


@kernel
def write_faults(work, start, count, status):
    """Copy the faults of a block to their rows of `status`."""
    for i in range(count):
        status[start + i] = np.int8(work[FAULT + i])


@kernel
def write_apart(work, i, row, colliding, separation, normal, point):
    """Write the result of a pair that does not touch."""
    colliding[row] = False
    separation[row] = work[SEPARATION + i]
    for k in range(3):
        normal[row, k] = math.nan
        point[row, k] = math.nan

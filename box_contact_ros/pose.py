"""Poses, and what a pair of boxes becomes before any axis is tested.

Conventions (the one place in the code; docs/conventions.md repeats them for users)
    Units are SI, frames right-handed. A pose is 7 numbers `x y z qx qy qz qw` in a frame common to
    both boxes. A size is three FULL extents in metres; kernels use half extents.
    `normal` is a unit vector from A to B. `separation` is signed: negative = overlap depth along
    `normal`, positive = the largest gap on a separating axis. `point` is the centroid of A∩B.

Rotations are formed from each quaternion and multiplied out as R[i, j] = a_i · b_j, the products
of the boxes' axes, and the offset as B − A before anything else: everything that can cancel does
so in float64, once. The products are also bit for bit the same when the boxes are swapped
(R becomes its transpose, offsets change sign), which the verdict relies on (see `sat`).
"""
from __future__ import annotations

import numpy as np

from .block import (
    A_FIRST,
    AXES_A,
    BAD_POSE_A,
    BAD_SIZE_A,
    BAD_SIZE_B,
    FAULT,
    HALF_A,
    HALF_B,
    LANES,
    OFFSET_A,
    OFFSET_B,
    OK,
    ORIGIN_A,
    ORIGIN_B,
    ROTATION,
    SINGLE,
    SIZE,
    TOUCH,
    TURN_A,
    TURN_B,
)
from .jit import inlined, kernel

CONTACT_ULPS = 8.0
"""Boxes touch up to a separation of 8 ulp of the pair's largest coordinate or size: the rounding
of an exactly touching pose (4 ulp at worst over dyadic touching poses moved rigidly) with a factor
of two to spare; a real gap of 1e-14 m between two 40 ft containers is still a gap."""

# Lengths are raised up to the fifth power (second moments of volumes), so sizes and coordinates
# stay far from the overflow and underflow of float64. Nothing that is simulated is outside.
LENGTH_MIN = 1e-50
"""Least extent [m] accepted."""
LENGTH_MAX = 1e50
"""Largest extent or coordinate [m] accepted."""
QUATERNION_MIN = 1e-100
"""Least quaternion norm accepted: below, it counts as zero (its square would underflow)."""
QUATERNION_MAX = 1e100
"""Largest quaternion norm accepted (its square would overflow)."""

_HALF_ULP_AND_MORE = 0.75 * 2.0**-52


@inlined
def ulp(x):
    """Distance from a positive normal number to the next larger one (without a branch).

    0.75·2⁻⁵²·x lies between 0.75 and 1.5 ulp, so the sum is rounded to the next number.
    """
    return (x + x * _HALF_ULP_AND_MORE) - x


@inlined
def rotation_entries(x, y, z, w):
    """Rotation matrix of a quaternion of any length, row-major, 9 numbers.

    Dividing by the squared norm normalises exactly and needs no square root; q and −q give the
    same bits.
    """
    s = 2.0 / ((x * x + y * y) + (z * z + w * w))
    return (1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y),
            s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x),
            s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y))


@inlined
def squared_norm(x, y, z, w):
    return (x * x + y * y) + (z * z + w * w)


@inlined
def pose_valid(x, y, z, norm2):
    # Written so that NaN fails every comparison. An overflown square is infinite, and fails too.
    return (abs(x) <= LENGTH_MAX and abs(y) <= LENGTH_MAX and abs(z) <= LENGTH_MAX
            and norm2 >= QUATERNION_MIN * QUATERNION_MIN
            and norm2 <= QUATERNION_MAX * QUATERNION_MAX)


@inlined
def _size_valid(x, y, z):
    # Likewise; min and max would lose a NaN in y or z.
    return (x >= LENGTH_MIN and y >= LENGTH_MIN and z >= LENGTH_MIN
            and x <= LENGTH_MAX and y <= LENGTH_MAX and z <= LENGTH_MAX)


@kernel
def _copy_block(poses_a, poses_b, sizes_a, sizes_b, start, count, work):
    shared_a = sizes_a.shape[0] == 1
    shared_b = sizes_b.shape[0] == 1
    for i in range(count):
        row = start + i
        for k in range(3):
            work[ORIGIN_A + k * LANES + i] = poses_a[row, k]
            work[ORIGIN_B + k * LANES + i] = poses_b[row, k]
        for k in range(4):
            work[TURN_A + k * LANES + i] = poses_a[row, 3 + k]
            work[TURN_B + k * LANES + i] = poses_b[row, 3 + k]
        row_a = 0 if shared_a else row
        row_b = 0 if shared_b else row
        for k in range(3):
            work[HALF_A + k * LANES + i] = 0.5 * sizes_a[row_a, k]
            work[HALF_B + k * LANES + i] = 0.5 * sizes_b[row_b, k]


@kernel
def _copy_apart(work, i):
    """Two unit cubes far apart, as if they had been given."""
    for k in range(3):
        work[ORIGIN_A + k * LANES + i] = 0.0
        work[ORIGIN_B + k * LANES + i] = 4.0
        work[TURN_A + k * LANES + i] = 0.0
        work[TURN_B + k * LANES + i] = 0.0
        work[HALF_A + k * LANES + i] = 0.5
        work[HALF_B + k * LANES + i] = 0.5
    work[TURN_A + 3 * LANES + i] = 1.0
    work[TURN_B + 3 * LANES + i] = 1.0


@kernel
def load_block(poses_a, poses_b, sizes_a, sizes_b, start, count, work):
    """Check `count` pairs from row `start` on and write them into `work`.

    poses_a, poses_b are (n, 7); sizes_a, sizes_b, full extents, are (n, 3), or (1, 3) for all.
    A row that fails a check gets its FAULT and the values of two cubes far apart, so that the
    later stages need no test; returns the number of such rows.
    """
    _copy_block(poses_a, poses_b, sizes_a, sizes_b, start, count, work)
    for i in range(count, LANES):
        _copy_apart(work, i)
    bad = LANES - _prepare(LANES, work)
    if bad:
        _replace_bad(work, count)
    return bad


@kernel
def load_sizes(sizes, work):
    """Write the full extents (2, 3) of a single pair; they stay for all its poses."""
    for k in range(3):
        for i in range(SINGLE):
            work[HALF_A + k * LANES + i] = 0.5 * sizes[0, k]
            work[HALF_B + k * LANES + i] = 0.5 * sizes[1, k]


@kernel
def load_one(pose_a, pose_b, work):
    """`load_block` for a single pair, whose sizes `load_sizes` has written: poses (7,).

    Returns 0, or BAD_…, and then `work` holds nothing that can be evaluated.
    """
    if len(pose_a) != 7 or len(pose_b) != 7:
        return BAD_POSE_A
    for k in range(3):
        a, b = pose_a[k], pose_b[k]
        for i in range(SINGLE):
            work[ORIGIN_A + k * LANES + i] = a
            work[ORIGIN_B + k * LANES + i] = b
    for k in range(4):
        a, b = pose_a[3 + k], pose_b[3 + k]
        for i in range(SINGLE):
            work[TURN_A + k * LANES + i] = a
            work[TURN_B + k * LANES + i] = b
    return OK if _prepare(SINGLE, work) == SINGLE else BAD_POSE_A


@kernel
def _replace_bad(work, count):
    for i in range(count):
        if work[FAULT + i] != OK:
            work[FAULT + i] = _fault(work, i)
            _copy_apart(work, i)
    faults = work[FAULT:FAULT + count].copy()
    for i in range(count, LANES):
        _copy_apart(work, i)
    _prepare(LANES, work)
    work[FAULT:FAULT + count] = faults


@inlined
def _prepare(lanes, work):
    """From poses and sizes to what the axes are tested on; returns the number of good pairs."""
    good = concentric = 0
    for i in range(lanes):
        x, y, z, w = (work[TURN_A + i], work[TURN_A + LANES + i], work[TURN_A + 2 * LANES + i],
                      work[TURN_A + 3 * LANES + i])
        norm2_a = squared_norm(x, y, z, w)
        a00, a01, a02, a10, a11, a12, a20, a21, a22 = rotation_entries(x, y, z, w)
        x, y, z, w = (work[TURN_B + i], work[TURN_B + LANES + i], work[TURN_B + 2 * LANES + i],
                      work[TURN_B + 3 * LANES + i])
        norm2_b = squared_norm(x, y, z, w)
        b00, b01, b02, b10, b11, b12, b20, b21, b22 = rotation_entries(x, y, z, w)
        ax, ay, az = (work[ORIGIN_A + i], work[ORIGIN_A + LANES + i],
                      work[ORIGIN_A + 2 * LANES + i])
        bx, by, bz = (work[ORIGIN_B + i], work[ORIGIN_B + LANES + i],
                      work[ORIGIN_B + 2 * LANES + i])
        ha0, ha1, ha2 = work[HALF_A + i], work[HALF_A + LANES + i], work[HALF_A + 2 * LANES + i]
        hb0, hb1, hb2 = work[HALF_B + i], work[HALF_B + LANES + i], work[HALF_B + 2 * LANES + i]
        valid = (pose_valid(ax, ay, az, norm2_a) and pose_valid(bx, by, bz, norm2_b)
                 and _size_valid(2.0 * ha0, 2.0 * ha1, 2.0 * ha2)
                 and _size_valid(2.0 * hb0, 2.0 * hb1, 2.0 * hb2))
        work[FAULT + i] = OK if valid else BAD_POSE_A  # which one, is looked up where it is so
        good += 1 if valid else 0
        tx, ty, tz = bx - ax, by - ay, bz - az
        work[AXES_A + i] = a00
        work[AXES_A + LANES + i] = a01
        work[AXES_A + 2 * LANES + i] = a02
        work[AXES_A + 3 * LANES + i] = a10
        work[AXES_A + 4 * LANES + i] = a11
        work[AXES_A + 5 * LANES + i] = a12
        work[AXES_A + 6 * LANES + i] = a20
        work[AXES_A + 7 * LANES + i] = a21
        work[AXES_A + 8 * LANES + i] = a22
        work[OFFSET_A + i] = (a00 * tx + a10 * ty) + a20 * tz
        work[OFFSET_A + LANES + i] = (a01 * tx + a11 * ty) + a21 * tz
        work[OFFSET_A + 2 * LANES + i] = (a02 * tx + a12 * ty) + a22 * tz
        work[OFFSET_B + i] = (b00 * tx + b10 * ty) + b20 * tz
        work[OFFSET_B + LANES + i] = (b01 * tx + b11 * ty) + b21 * tz
        work[OFFSET_B + 2 * LANES + i] = (b02 * tx + b12 * ty) + b22 * tz
        work[ROTATION + i] = (a00 * b00 + a10 * b10) + a20 * b20
        work[ROTATION + LANES + i] = (a00 * b01 + a10 * b11) + a20 * b21
        work[ROTATION + 2 * LANES + i] = (a00 * b02 + a10 * b12) + a20 * b22
        work[ROTATION + 3 * LANES + i] = (a01 * b00 + a11 * b10) + a21 * b20
        work[ROTATION + 4 * LANES + i] = (a01 * b01 + a11 * b11) + a21 * b21
        work[ROTATION + 5 * LANES + i] = (a01 * b02 + a11 * b12) + a21 * b22
        work[ROTATION + 6 * LANES + i] = (a02 * b00 + a12 * b10) + a22 * b20
        work[ROTATION + 7 * LANES + i] = (a02 * b01 + a12 * b11) + a22 * b21
        work[ROTATION + 8 * LANES + i] = (a02 * b02 + a12 * b12) + a22 * b22
        size = 2.0 * max(max(max(ha0, ha1), ha2), max(max(hb0, hb1), hb2))
        reach = max(max(max(abs(ax), abs(ay)), abs(az)), max(max(abs(bx), abs(by)), abs(bz)))
        work[SIZE + i] = size
        work[TOUCH + i] = CONTACT_ULPS * ulp(max(reach, size))
        # The sign of B − A changes on a swap, so its first component that is not zero says which
        # box comes first.
        later = ty > 0.0 or (ty == 0.0 and tz >= 0.0)
        work[A_FIRST + i] = 1.0 if (tx > 0.0 or (tx == 0.0 and later)) else 0.0
        concentric += 1 if (tx == 0.0 and ty == 0.0 and tz == 0.0) else 0
    if concentric > 0:
        _order_concentric(lanes, work)
    return good


@kernel
def _order_concentric(lanes, work):
    """A_FIRST of boxes with the same middle: by their sizes, or else by their axes."""
    for i in range(lanes):
        if (work[OFFSET_A + i] == 0.0 and work[OFFSET_A + LANES + i] == 0.0
                and work[OFFSET_A + 2 * LANES + i] == 0.0):
            order = 0.0
            for k in range(3):
                if order == 0.0:
                    order = work[HALF_B + k * LANES + i] - work[HALF_A + k * LANES + i]
            a = rotation_entries(work[TURN_A + i], work[TURN_A + LANES + i],
                                 work[TURN_A + 2 * LANES + i], work[TURN_A + 3 * LANES + i])
            b = rotation_entries(work[TURN_B + i], work[TURN_B + LANES + i],
                                 work[TURN_B + 2 * LANES + i], work[TURN_B + 3 * LANES + i])
            for k in range(9):
                if order == 0.0:
                    order = b[k] - a[k]
            work[A_FIRST + i] = 1.0 if order >= 0.0 else 0.0


@kernel
def _fault(work, i):
    for box in range(2):
        origin = ORIGIN_A if box == 0 else ORIGIN_B
        turn = TURN_A if box == 0 else TURN_B
        norm2 = squared_norm(work[turn + i], work[turn + LANES + i], work[turn + 2 * LANES + i],
                             work[turn + 3 * LANES + i])
        if not pose_valid(work[origin + i], work[origin + LANES + i],
                          work[origin + 2 * LANES + i], norm2):
            return BAD_POSE_A + box
    half = HALF_A
    if not _size_valid(2.0 * work[half + i], 2.0 * work[half + LANES + i],
                       2.0 * work[half + 2 * LANES + i]):
        return BAD_SIZE_A
    return BAD_SIZE_B


def rotation_matrix(quaternion: np.ndarray) -> np.ndarray:
    """Rotation matrices (..., 3, 3) of quaternions (..., 4) xyzw of any length but zero."""
    q = np.moveaxis(np.asarray(quaternion, dtype=np.float64), -1, 0)
    entries = rotation_entries.py_func(*q)
    return np.stack(entries, axis=-1).reshape(*q.shape[1:], 3, 3)


def quaternion_multiply(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Hamilton product p ⊗ q of quaternions (..., 4) xyzw: first q, then p."""
    px, py, pz, pw = np.moveaxis(np.asarray(p, dtype=np.float64), -1, 0)
    qx, qy, qz, qw = np.moveaxis(np.asarray(q, dtype=np.float64), -1, 0)
    return np.stack([pw * qx + px * qw + py * qz - pz * qy,
                     pw * qy - px * qz + py * qw + pz * qx,
                     pw * qz + px * qy - py * qx + pz * qw,
                     pw * qw - px * qx - py * qy - pz * qz], axis=-1)


def quaternion_from_matrix(matrix: np.ndarray) -> np.ndarray:
    """Unit quaternions (..., 4) xyzw of rotation matrices (..., 3, 3), largest component positive.

    Of the four classical formulas the best conditioned is taken (Shepperd 1978).
    """
    m = np.asarray(matrix, dtype=np.float64)
    diagonal = np.stack([m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]], axis=-1)
    trace = diagonal.sum(axis=-1, keepdims=True)
    # 4 q qᵀ, whose row of the largest diagonal entry is that component times 4 q.
    outer = np.empty((*m.shape[:-2], 4, 4))
    for i in range(3):
        for j in range(3):
            outer[..., i, j] = m[..., i, j] + m[..., j, i]
        outer[..., i, i] = 1.0 + 2.0 * diagonal[..., i] - trace[..., 0]
        j, k = (i + 1) % 3, (i + 2) % 3
        outer[..., i, 3] = outer[..., 3, i] = m[..., k, j] - m[..., j, k]
    outer[..., 3, 3] = 1.0 + trace[..., 0]
    best = np.argmax(np.diagonal(outer, axis1=-2, axis2=-1), axis=-1)
    row = np.take_along_axis(outer, best[..., None, None], axis=-2)[..., 0, :]
    return row / np.linalg.norm(row, axis=-1, keepdims=True)

"""Quaternions and rotation matrices of poses, for arrays of them.

Conventions (docs/conventions.md has them for users)
    Units are SI, frames right-handed. A pose is 7 numbers `x y z qx qy qz qw` in a frame common to
    both boxes. A size is three FULL extents in metres.
"""
from __future__ import annotations

import numpy as np


def rotation_matrix(quaternion: np.ndarray) -> np.ndarray:
    """Return the matrices (..., 3, 3) of quaternions (..., 4) xyzw of any length but zero.

    Dividing by the squared norm needs no square root; q and −q give the same bits.
    """
    x, y, z, w = np.moveaxis(np.asarray(quaternion, dtype=np.float64), -1, 0)
    s = 2.0 / ((x * x + y * y) + (z * z + w * w))
    entries = (1.0 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y),
               s * (x * y + w * z), 1.0 - s * (x * x + z * z), s * (y * z - w * x),
               s * (x * z - w * y), s * (y * z + w * x), 1.0 - s * (x * x + y * y))
    return np.stack(entries, axis=-1).reshape(*np.shape(x), 3, 3)


def quaternion_multiply(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the Hamilton product p ⊗ q of quaternions (..., 4) xyzw: first q, then p."""
    px, py, pz, pw = np.moveaxis(np.asarray(p, dtype=np.float64), -1, 0)
    qx, qy, qz, qw = np.moveaxis(np.asarray(q, dtype=np.float64), -1, 0)
    return np.stack([pw * qx + px * qw + py * qz - pz * qy,
                     pw * qy - px * qz + py * qw + pz * qx,
                     pw * qz + px * qy - py * qx + pz * qw,
                     pw * qw - px * qx - py * qy - pz * qz], axis=-1)


def quaternion_from_matrix(matrix: np.ndarray) -> np.ndarray:
    """Return unit quaternions (..., 4) xyzw of rotation matrices (..., 3, 3).

    The largest component is positive. Of the four classical formulas the best conditioned is taken
    (Shepperd 1978).
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

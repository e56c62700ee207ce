"""Box symmetries: any touching pose into the networks' domain, and the answer back.

A box is unchanged by flipping the sign of an axis (and a cube also by exchanging axes), and the
scene as a whole may be reflected. So a pair (offset t of the second box, its orientation R, both in
the first box's frame) may be replaced by

    t' = M t,   R' = M R Nᵀ,   with signed permutations M, N and det M · det N = 1,

which is again a pair of such boxes; points and directions of its contact go back by Mᵀ. The maps
here choose M and N from the pose alone.

- `fold_octant`: sign flips only, so it serves boxes of any shape. t' ≥ 0, and R' = Rz(yaw)
  Ry(pitch) Rx(roll) with all three angles in [−π/2, π/2]: the domain of the paper's section 3.
- `fold_features`: for cubes. The features that SAT says meet become the reference features, so that
  the map from pose to contact has no discontinuity: face +x of the first box and corner (−, −, −)
  of the second; or the first box's edge along z at (+, +) and the second's along y at (−, −).
"""
from __future__ import annotations

import math

from .jit import kernel

FOLD_SIZE = 9 + 9 + 3 + 9 + 3
"""Length of the scratch array of the folds: M, N, t', R', and three numbers to work with."""
_M, _N, OFFSET, TURN, _TRY = 0, 9, 18, 21, 30
"""Places in that array; 3 × 3 matrices are row-major."""

VERTEX_FACE, EDGE_EDGE = 0, 1
"""Subsets on which the map from pose to contact is continuous."""


@kernel
def _set_signs(fold, matrix, s0, s1, s2):
    for k in range(9):
        fold[matrix + k] = 0.0
    fold[matrix] = s0
    fold[matrix + 4] = s1
    fold[matrix + 8] = s2


@kernel
def _determinant(fold, m):
    return (fold[m] * (fold[m + 4] * fold[m + 8] - fold[m + 5] * fold[m + 7])
            - fold[m + 1] * (fold[m + 3] * fold[m + 8] - fold[m + 5] * fold[m + 6])
            + fold[m + 2] * (fold[m + 3] * fold[m + 7] - fold[m + 4] * fold[m + 6]))


@kernel
def _apply(fold, t, r):
    """Write t' = M t and R' = M R Nᵀ."""
    for i in range(3):
        fold[OFFSET + i] = (fold[_M + 3 * i] * t[0] + fold[_M + 3 * i + 1] * t[1]
                            + fold[_M + 3 * i + 2] * t[2])
        for j in range(3):
            total = 0.0
            for k in range(3):
                for m in range(3):
                    total += fold[_M + 3 * i + k] * r[3 * k + m] * fold[_N + 3 * j + m]
            fold[TURN + 3 * i + j] = total


@kernel
def unfold(fold, x, y, z):
    """Mᵀ (x, y, z): a folded point or direction back in the first box's frame."""
    return (fold[_M] * x + fold[_M + 3] * y + fold[_M + 6] * z,
            fold[_M + 1] * x + fold[_M + 4] * y + fold[_M + 7] * z,
            fold[_M + 2] * x + fold[_M + 5] * y + fold[_M + 8] * z)


@kernel
def folded(fold, x, y, z):
    """M (x, y, z): a point or direction of the first box's frame, folded."""
    return (fold[_M] * x + fold[_M + 1] * y + fold[_M + 2] * z,
            fold[_M + 3] * x + fold[_M + 4] * y + fold[_M + 5] * z,
            fold[_M + 6] * x + fold[_M + 7] * y + fold[_M + 8] * z)


@kernel
def euler_angles(fold):
    """Roll, pitch, yaw [rad] of R' = Rz(yaw) Ry(pitch) Rx(roll)."""
    return (math.atan2(fold[TURN + 7], fold[TURN + 8]),
            math.asin(min(1.0, max(-1.0, -fold[TURN + 6]))),
            math.atan2(fold[TURN + 3], fold[TURN]))


@kernel
def _sign(x):
    return 1.0 if x >= 0.0 else -1.0


@kernel
def fold_octant(t, r, fold):
    """Sign flips that bring t into the positive octant and the angles into [−π/2, π/2].

    t: offset (3,), r: orientation, row-major (9,), of the second box in the first box's frame.
    """
    m0, m1, m2 = _sign(t[0]), _sign(t[1]), _sign(t[2])
    n0 = _sign(m0 * r[0])  # cos(yaw) cos(pitch) ≥ 0
    n2 = _sign(m2 * r[8])  # cos(pitch) cos(roll) ≥ 0
    _set_signs(fold, _M, m0, m1, m2)
    _set_signs(fold, _N, n0, (m0 * m1 * m2) * (n0 * n2), n2)
    _apply(fold, t, r)


@kernel
def fold_features(t, r, axis, n, fold):
    """Signed permutations that make the features on SAT's winning axis the reference features.

    `axis` as in `pose.AXIS`, a face of the first box (0–2) or an edge pair (6–14), and n the
    normal (3,) from the first to the second box. For cubes only. Returns VERTEX_FACE or EDGE_EDGE.
    """
    for k in range(18):
        fold[k] = 0.0
    if axis < 3:
        # M: the face becomes +x. N: the corner that looks at it becomes (−, −, −), its edges in
        # the order of how steeply they rise from the face.
        a = (axis + 1) % 3
        b = (axis + 2) % 3
        fold[_M + axis] = _sign(n[axis])
        for j in range(3):
            fold[_TRY + j] = _sign(n[axis]) * r[3 * axis + j]
        for j in range(3):
            rank = 0
            for k in range(3):
                steeper = abs(fold[_TRY + k]) > abs(fold[_TRY + j])
                level = abs(fold[_TRY + k]) == abs(fold[_TRY + j])
                if steeper or (level and k < j):
                    rank += 1
            fold[_N + 3 * rank + j] = _sign(fold[_TRY + j])
            if rank == 0:
                first = j
        # Of the face's four turns (times a reflection where the parity asks for one), the one
        # that turns the steepest edge's shadow towards −y, within 45°.
        ya = r[3 * a + first] * _sign(fold[_TRY + first])
        yb = r[3 * b + first] * _sign(fold[_TRY + first])
        if abs(ya) >= abs(yb):
            fold[_M + 3 + a] = -_sign(ya)
            fold[_M + 6 + b] = 1.0
        else:
            fold[_M + 3 + b] = -_sign(yb)
            fold[_M + 6 + a] = 1.0
        if _determinant(fold, _M) * _determinant(fold, _N) < 0.0:
            for k in range(3):
                fold[_M + 6 + k] = -fold[_M + 6 + k]
        _apply(fold, t, r)
        return VERTEX_FACE
    i = (axis - 6) // 3
    j = (axis - 6) % 3
    # M: the edge becomes z, the two faces that share it +x and +y, the steeper first.
    a = (i + 1) % 3
    b = (i + 2) % 3
    if abs(n[a]) < abs(n[b]):
        a, b = b, a
    fold[_M + a] = _sign(n[a])
    fold[_M + 3 + b] = _sign(n[b])
    fold[_M + 6 + i] = 1.0
    # N: likewise y, −x and −z. The direction of its edge: along the first box's y.
    for k in range(3):
        fold[_TRY + k] = r[k] * n[0] + r[3 + k] * n[1] + r[6 + k] * n[2]
    c = (j + 1) % 3
    d = (j + 2) % 3
    if abs(fold[_TRY + c]) < abs(fold[_TRY + d]):
        c, d = d, c
    fold[_N + c] = _sign(fold[_TRY + c])
    fold[_N + 6 + d] = _sign(fold[_TRY + d])
    fold[_N + 3 + j] = _sign(_sign(n[b]) * r[3 * b + j])
    if _determinant(fold, _M) * _determinant(fold, _N) < 0.0:
        fold[_M + 6 + i] = -1.0
    _apply(fold, t, r)
    return EDGE_EDGE

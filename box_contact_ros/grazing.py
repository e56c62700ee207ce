"""Grazing contacts of almost parallel edges, with twice the digits.

Where two edges almost along each other meet, their cross product is what is left of a cancellation:
at an angle of θ its direction is good to 1e-16/θ. That does not matter as long as another axis wins
by more than the gap along it may be wrong. Where not, phantom contacts and depths wrong by up to
1e-8 of the size were found. Those pairs, and no others, are evaluated again here: rotation, offset
and all fifteen gaps from the very doubles of the poses, every number the sum of two doubles
(Dekker 1971; Knuth, TAOCP 2, 4.2.2), 32 digits.
"""
from __future__ import annotations

import math

import numpy as np

from .block import (
    A_FIRST,
    AXIS,
    HALF_A,
    HALF_B,
    LANES,
    NORMAL,
    ORIGIN_A,
    ORIGIN_B,
    SEPARATION,
    SIZE,
    TURN_A,
    TURN_B,
)
from .jit import inlined, kernel

REACH = 8.0
"""By how many times θ · size an axis that is skipped may better the best face axis: edges of both
boxes, at both ends, lean by θ."""
LEAST = 1e-15
"""Length of a cross product from which it is an axis: what shorter ones could better is less than
the rounding of a gap. From here on 17 digits are left of 32."""
TIE = 2.0**-46
"""Gaps closer than this fraction of the size (1.4e-14, some 64 roundings) count as equal: the
rounding error of a gap is below 12 units of 2⁻⁵³ of the size, and twice that must not decide."""
_SPLIT = 134217729.0  # 2²⁷ + 1


@inlined
def grazing(separation, touch, size, hope, skipped):
    """1.0 where the axis that was found may be wrong.

    hope: what the largest gap on an axis of almost parallel edges may be, rounding included [m];
    skipped: squared sine of the widest angle between edges whose axis was skipped.
    """
    reach = REACH * size
    near = skipped > LEAST * LEAST and (
        separation >= 0.0 or separation * separation < reach * reach * skipped)
    return 1.0 if separation <= touch and (hope > separation or near) else 0.0


@kernel
def _sum(a, b):
    """The sum a + b exactly, as a sum of two."""
    s = a + b
    c = s - a
    return s, (a - (s - c)) + (b - c)


@kernel
def _times(a, b):
    """The product a · b exactly."""
    p = a * b
    c = _SPLIT * a
    ah = c - (c - a)
    al = a - ah
    c = _SPLIT * b
    bh = c - (c - b)
    bl = b - bh
    return p, ((ah * bh - p) + ah * bl + al * bh) + al * bl


@kernel
def _add(a, b):
    s, e = _sum(a[0], b[0])
    t, f = _sum(a[1], b[1])
    e += t
    s, e = _quick(s, e)
    return _quick(s, e + f)


@kernel
def _quick(s, e):
    h = s + e
    return h, e - (h - s)


@kernel
def _mul(a, b):
    p, e = _times(a[0], b[0])
    return _quick(p, e + (a[0] * b[1] + a[1] * b[0]))


@kernel
def _neg(a):
    return -a[0], -a[1]


@kernel
def _abs(a):
    return (-a[0], -a[1]) if a[0] < 0.0 else a


@kernel
def _div(a, b):
    q = a[0] / b[0]
    r = _add(a, _neg(_mul(b, (q, 0.0))))
    p = r[0] / b[0]
    r = _add(r, _neg(_mul(b, (p, 0.0))))
    s, e = _quick(q, p)
    return _add((s, e), (r[0] / b[0], 0.0))


@kernel
def _root(a):
    """Square root: one step of Newton's from the rounded one."""
    s = math.sqrt(a[0])
    if not s > 0.0:
        return 0.0, 0.0
    rest = _add(a, _neg(_times(s, s)))
    return _quick(s, rest[0] / (2.0 * s))


@kernel
def _set(m, k, value):
    m[k, 0], m[k, 1] = value


@kernel
def _get(m, k):
    return m[k, 0], m[k, 1]


@kernel
def _rotation(x, y, z, w, m):
    """Rotation matrix of a quaternion of any length, row-major in m (9, 2)."""
    xx, yy, zz, ww = _mul(x, x), _mul(y, y), _mul(z, z), _mul(w, w)
    xy, xz, yz = _mul(x, y), _mul(x, z), _mul(y, z)
    xw, yw, zw = _mul(x, w), _mul(y, w), _mul(z, w)
    n = _add(_add(xx, yy), _add(zz, ww))
    two = (2.0, 0.0)
    _set(m, 0, _div(_add(_add(ww, xx), _neg(_add(yy, zz))), n))
    _set(m, 1, _div(_mul(two, _add(xy, _neg(zw))), n))
    _set(m, 2, _div(_mul(two, _add(xz, yw)), n))
    _set(m, 3, _div(_mul(two, _add(xy, zw)), n))
    _set(m, 4, _div(_add(_add(ww, yy), _neg(_add(xx, zz))), n))
    _set(m, 5, _div(_mul(two, _add(yz, _neg(xw))), n))
    _set(m, 6, _div(_mul(two, _add(xz, _neg(yw))), n))
    _set(m, 7, _div(_mul(two, _add(yz, xw)), n))
    _set(m, 8, _div(_add(_add(ww, zz), _neg(_add(xx, yy))), n))


@kernel
def _component(work, one, other, i, p0, p1, p2, p3):
    """Sum of four products of components of two quaternions: ±1 .. ±16 index both."""
    total = (0.0, 0.0)
    for p in (p0, p1, p2, p3):
        k = (abs(p) - 1) // 4
        j = (abs(p) - 1) % 4
        value = _times(work[one + k * LANES + i], work[other + j * LANES + i])
        total = _add(total, value if p > 0 else _neg(value))
    return total


@kernel
def _to_unit_size(work, turn, i):
    """Scale a quaternion by a power of two to a largest component in [½, 1).

    Its length may be anything, and fourth powers of it must not leave the range of a double.
    """
    largest = 0.0
    for k in range(4):
        largest = max(largest, abs(work[turn + k * LANES + i]))
    exponent = math.frexp(largest)[1]
    for k in range(4):
        work[turn + k * LANES + i] = math.ldexp(work[turn + k * LANES + i], -exponent)


@kernel
def refine(work, i):
    """Evaluate pair `i` anew: SEPARATION, AXIS and NORMAL.

    All gaps are those of the box that comes first and the other, which have the same bits whichever
    of the two is called A; axes are counted, and the normal is given, from A.
    """
    a_first = work[A_FIRST + i] > 0.5
    one, other = (TURN_A, TURN_B) if a_first else (TURN_B, TURN_A)
    here, there = (ORIGIN_A, ORIGIN_B) if a_first else (ORIGIN_B, ORIGIN_A)
    _to_unit_size(work, one, i)
    _to_unit_size(work, other, i)
    r, axes = np.empty((9, 2)), np.empty((9, 2))
    t, t_other = np.empty((3, 2)), np.empty((3, 2))  # the offset, in the frame of either
    # conj(one) ⊗ other. Products are numbered 4 k + j + 1 for component k of one, j of the other.
    _rotation(_component(work, one, other, i, 13, -4, -7, 10),
              _component(work, one, other, i, 14, 3, -8, -9),
              _component(work, one, other, i, 15, -2, 5, -12),
              _component(work, one, other, i, 16, 1, 6, 11), r)
    _rotation((work[one + i], 0.0), (work[one + LANES + i], 0.0),
              (work[one + 2 * LANES + i], 0.0), (work[one + 3 * LANES + i], 0.0), axes)
    for k in range(3):
        total = (0.0, 0.0)
        for j in range(3):
            step = _sum(work[there + j * LANES + i], -work[here + j * LANES + i])
            total = _add(total, _mul(_get(axes, 3 * j + k), step))
        _set(t, k, total)
    for k in range(3):
        total = (0.0, 0.0)
        for j in range(3):
            total = _add(total, _mul(_get(r, 3 * j + k), _get(t, j)))
        _set(t_other, k, total)

    best, largest, axis = -math.inf, -math.inf, 0
    tie = TIE * work[SIZE + i]
    for number in range(15):
        gap = _gap(work, i, a_first, number if a_first else _swapped(number), r, t, t_other)
        largest = max(largest, gap)
        if gap > best + tie:
            best, axis = gap, number
    if not math.isfinite(largest):
        return  # beyond what can be split: what the query found stands
    work[SEPARATION + i] = largest
    work[AXIS + i] = float(axis)
    _normal(work, i, a_first, axis, r, t, t_other)


@kernel
def _swapped(number):
    """The number of an axis if the boxes change names."""
    if number < 6:
        return (number + 3) % 6
    return 6 + 3 * ((number - 6) % 3) + (number - 6) // 3


@kernel
def _gap(work, i, a_first, number, r, t, t_other):
    """Gap on an axis, counted from the first box, rounded once; −∞ where there is none."""
    one, other = (HALF_A, HALF_B) if a_first else (HALF_B, HALF_A)
    total = (0.0, 0.0)
    if number < 6:
        k = number % 3
        own, across = (one, other) if number < 3 else (other, one)
        total = _add(_abs(_get(t if number < 3 else t_other, k)), (-work[own + k * LANES + i], 0.0))
        for j in range(3):
            entry = _get(r, 3 * k + j if number < 3 else 3 * j + k)
            total = _add(total, _mul(_abs(entry), (-work[across + j * LANES + i], 0.0)))
        return total[0]
    k, j = (number - 6) // 3, (number - 6) % 3
    k1, k2, j1, j2 = (k + 1) % 3, (k + 2) % 3, (j + 1) % 3, (j + 2) % 3
    u, v = _get(r, 3 * k1 + j), _get(r, 3 * k2 + j)
    length = _root(_add(_mul(u, u), _mul(v, v)))
    if not length[0] > LEAST:
        return -math.inf
    total = _abs(_add(_mul(_get(t, k2), u), _neg(_mul(_get(t, k1), v))))
    total = _add(total, _mul(_abs(v), (-work[one + k1 * LANES + i], 0.0)))
    total = _add(total, _mul(_abs(u), (-work[one + k2 * LANES + i], 0.0)))
    total = _add(total, _mul(_abs(_get(r, 3 * k + j2)), (-work[other + j1 * LANES + i], 0.0)))
    total = _add(total, _mul(_abs(_get(r, 3 * k + j1)), (-work[other + j2 * LANES + i], 0.0)))
    return _div(total, length)[0]


@kernel
def _normal(work, i, a_first, axis, r, t, t_other):
    """NORMAL: an axis, counted from A, as a unit vector from A to B in A's frame."""
    # Orientation of B and offset to B, in A's frame.
    turn, offset = np.empty((3, 3)), np.empty(3)
    for k in range(3):
        offset[k] = t[k, 0] if a_first else -t_other[k, 0]
        for j in range(3):
            turn[k, j] = r[3 * k + j if a_first else 3 * j + k, 0]
    n = np.zeros(3)
    if axis < 3:
        n[axis] = 1.0
    elif axis < 6:
        for k in range(3):
            n[k] = turn[k, axis - 3]
    else:
        k, j = (axis - 6) // 3, (axis - 6) % 3
        n[(k + 1) % 3] = -turn[(k + 2) % 3, j]
        n[(k + 2) % 3] = turn[(k + 1) % 3, j]
    n /= math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    along = n[0] * offset[0] + n[1] * offset[1] + n[2] * offset[2]
    for k in range(3):
        work[NORMAL + k * LANES + i] = n[k] if along >= 0.0 else -n[k]

"""The outline of A∩B: its bounding box in either box's frame, and a point that lies inside.

Every corner of A∩B lies on an edge of A or of B. So the 24 edges, each cut off where it leaves the
other box, give the exact bounding box of the overlap; and the mean of the pieces, weighted by their
lengths, is a point of A∩B near its centroid. All of it is a fixed sequence of multiplications and
comparisons, the same for every pair: constant cost, and one instruction serves eight pairs.

An edge is cut by three slabs (Kay and Kajiya 1986). Its direction in the other box's frame is a row
or a column of R, so nine reciprocals serve all 24 edges. Four edges along one axis share everything
but the signs of their middles; a block takes them one after the other, a single pair side by side.
Each piece is noted in both frames: in its own box's frame two of its coordinates are constant. A
piece that is not there is NaN, which no comparison lets through.

Of the two bounding boxes A's is chosen, or B's if it is clearly smaller. It follows the overlap's
own direction: a corner pressed into a face, an edge lying across a face, two crossing edges all
fill the better of the two well, whereas in a frame fixed to the touched face an edge that lies
across it is a diagonal sliver (with the same network and data, errors were two to seven times
larger).
"""
from __future__ import annotations

import math

from .block import (
    CENTRE_A,
    CENTRE_B,
    EVEN_ODD,
    HALF,
    HALF_A,
    HALF_B,
    HALVES,
    HIGH_A,
    HIGH_B,
    IN_B,
    INSIDE,
    INVERSE,
    LANES,
    LOW_A,
    LOW_B,
    MIDDLE,
    OFFSET_A,
    OFFSET_B,
    ROTATION,
    SINGLE,
    SIZE,
    SUMS_A,
    SUMS_B,
)
from .jit import inlined, kernel

_PARALLEL = 1e-90
"""Least magnitude that is inverted: an edge exactly along a slab must not give 0 · ∞, and three of
them multiplied must not underflow."""
FLUSH = 2.0**-46
"""Slabs are wider by this fraction of the size (1.4e-14). Where faces of both boxes lie in one
plane, rounding may put either box's edges outside the other: of an aligned stack nothing, or one
side, would be left. The rounding of a corner's place is below 32 units of 2⁻⁵³ of the size, and
four times that keeps them; an edge of the overlap is then found twice, which moves nothing out."""
_NOWHERE = 1e300
"""Start of a minimum."""
_THINNEST = 1e-290
"""Least half extent divided by [m]."""
_ALIKE = 0.2
"""Share by which B's bounding box has to be smaller than A's to be chosen. Boxes that lie on each
other have almost equal ones, and a container at rest must not hop between the frames, and the point
between the network's two errors (12 cm were seen). Limits of 0.05 to 0.4 all prevent that."""


@inlined
def _piece(x, y, z, ix, iy, iz, wx, wy, wz, length):
    """What three slabs leave of a line: from s to t along it; nothing if t < s.

    (x, y, z) is its middle in the other box's frame, i the reciprocals of its direction, w the
    slabs' half widths along it, `length` half its length.
    """
    kx, ky, kz = x * ix, y * iy, z * iz
    s = max(max(-length, -kx - wx), max(-ky - wy, -kz - wz))
    t = min(min(length, wx - kx), min(wy - ky, wz - kz))
    return s, t


@inlined
def _ends(s, t):
    """A piece's ends, or NaN where there is none."""
    return (s if t >= s else math.nan), (t if t >= s else math.nan)


@inlined
def _lower(low, p, q):
    low = p if p < low else low
    return q if q < low else low


@inlined
def _higher(high, p, q):
    high = p if p > high else high
    return q if q > high else high


@inlined
def _grow(work, low_row, high_row, i, p0, q0, p1, q1, p2, q2, p3, q3):
    """Widen a bounding box's side by eight coordinates, those that are not NaN."""
    low = _lower(_lower(work[low_row + i], p0, q0), p1, q1)
    work[low_row + i] = _lower(_lower(low, p2, q2), p3, q3)
    high = _higher(_higher(work[high_row + i], p0, q0), p1, q1)
    work[high_row + i] = _higher(_higher(high, p2, q2), p3, q3)


@inlined
def _four_edges(work, half_x, half_y, centre, along, across, low_x, high_x, low_y, high_y, sums,
                j, a, b):
    """The four edges of a box X along its axis j, cut by the other box Y.

    j, a, b are X's axes as row offsets; rows of X's own frame end in _x, those of Y's in _y.
    Component k of X's axis j in Y's frame is R at k · across + j · along.
    """
    for i in range(LANES):
        ga, gb, length = work[half_x + a + i], work[half_x + b + i], work[half_x + j + i]
        ex = work[ROTATION + j * along + i]
        ey = work[ROTATION + across + j * along + i]
        ez = work[ROTATION + 2 * across + j * along + i]
        ix = work[INVERSE + j * along + i]
        iy = work[INVERSE + across + j * along + i]
        iz = work[INVERSE + 2 * across + j * along + i]
        slack = FLUSH * work[SIZE + i]
        wx = (work[half_y + i] + slack) * abs(ix)
        wy = (work[half_y + LANES + i] + slack) * abs(iy)
        wz = (work[half_y + 2 * LANES + i] + slack) * abs(iz)
        ax = ga * work[ROTATION + a * along + i]
        ay = ga * work[ROTATION + across + a * along + i]
        az = ga * work[ROTATION + 2 * across + a * along + i]
        bx = gb * work[ROTATION + b * along + i]
        by = gb * work[ROTATION + across + b * along + i]
        bz = gb * work[ROTATION + 2 * across + b * along + i]
        cx, cy, cz = work[centre + i], work[centre + LANES + i], work[centre + 2 * LANES + i]
        # Signs (−, −), (+, −), (−, +), (+, +) of a and b.
        x0, y0, z0 = cx - (ax + bx), cy - (ay + by), cz - (az + bz)
        x1, y1, z1 = cx + (ax - bx), cy + (ay - by), cz + (az - bz)
        x2, y2, z2 = cx - (ax - bx), cy - (ay - by), cz - (az - bz)
        x3, y3, z3 = cx + (ax + bx), cy + (ay + by), cz + (az + bz)
        s0, t0 = _piece(x0, y0, z0, ix, iy, iz, wx, wy, wz, length)
        s1, t1 = _piece(x1, y1, z1, ix, iy, iz, wx, wy, wz, length)
        s2, t2 = _piece(x2, y2, z2, ix, iy, iz, wx, wy, wz, length)
        s3, t3 = _piece(x3, y3, z3, ix, iy, iz, wx, wy, wz, length)
        w0, w1, w2, w3 = max(0.0, t0 - s0), max(0.0, t1 - s1), max(0.0, t2 - s2), max(0.0, t3 - s3)
        work[sums + 4 * j + i] = (w0 + w1) + (w2 + w3)
        work[sums + 4 * j + LANES + i] = (w0 * (s0 + t0) + w1 * (s1 + t1)) + (
            w2 * (s2 + t2) + w3 * (s3 + t3))
        work[sums + 4 * j + 2 * LANES + i] = (w1 - w0) + (w3 - w2)
        work[sums + 4 * j + 3 * LANES + i] = (w2 + w3) - (w0 + w1)
        s0, t0 = _ends(s0, t0)
        s1, t1 = _ends(s1, t1)
        s2, t2 = _ends(s2, t2)
        s3, t3 = _ends(s3, t3)
        _grow(work, low_y, high_y, i, x0 + s0 * ex, x0 + t0 * ex, x1 + s1 * ex, x1 + t1 * ex,
              x2 + s2 * ex, x2 + t2 * ex, x3 + s3 * ex, x3 + t3 * ex)
        _grow(work, low_y + LANES, high_y + LANES, i, y0 + s0 * ey, y0 + t0 * ey, y1 + s1 * ey,
              y1 + t1 * ey, y2 + s2 * ey, y2 + t2 * ey, y3 + s3 * ey, y3 + t3 * ey)
        _grow(work, low_y + 2 * LANES, high_y + 2 * LANES, i, z0 + s0 * ez, z0 + t0 * ez,
              z1 + s1 * ez, z1 + t1 * ez, z2 + s2 * ez, z2 + t2 * ez, z3 + s3 * ez, z3 + t3 * ez)
        # In X's own frame: along j the pieces' ends, across it the signs that have a piece.
        low = _lower(_lower(work[low_x + j + i], s0, s1), s2, s3)
        work[low_x + j + i] = low
        work[high_x + j + i] = _higher(_higher(work[high_x + j + i], t0, t1), t2, t3)
        there0, there1, there2, there3 = s0 <= t0, s1 <= t1, s2 <= t2, s3 <= t3
        minus = -ga if there0 or there2 else math.nan
        plus = ga if there1 or there3 else math.nan
        work[low_x + a + i] = _lower(work[low_x + a + i], minus, plus)
        work[high_x + a + i] = _higher(work[high_x + a + i], minus, plus)
        minus = -gb if there0 or there1 else math.nan
        plus = gb if there2 or there3 else math.nan
        work[low_x + b + i] = _lower(work[low_x + b + i], minus, plus)
        work[high_x + b + i] = _higher(work[high_x + b + i], minus, plus)


@inlined
def _side_by_side(work, half_x, half_y, centre, along, across, low_x, high_x, low_y, high_y,
                  sums, j, a, b):
    """`_four_edges` of a single pair: the four signs are four lanes."""
    for i in range(SINGLE):
        length = work[half_x + j + i]
        even_odd, halves = work[EVEN_ODD + i], work[HALVES + i]
        ga, gb = even_odd * work[half_x + a + i], halves * work[half_x + b + i]
        ex = work[ROTATION + j * along + i]
        ey = work[ROTATION + across + j * along + i]
        ez = work[ROTATION + 2 * across + j * along + i]
        ix = work[INVERSE + j * along + i]
        iy = work[INVERSE + across + j * along + i]
        iz = work[INVERSE + 2 * across + j * along + i]
        slack = FLUSH * work[SIZE + i]
        x = work[centre + i] + (ga * work[ROTATION + a * along + i]
                                + gb * work[ROTATION + b * along + i])
        y = work[centre + LANES + i] + (ga * work[ROTATION + across + a * along + i]
                                        + gb * work[ROTATION + across + b * along + i])
        z = work[centre + 2 * LANES + i] + (ga * work[ROTATION + 2 * across + a * along + i]
                                            + gb * work[ROTATION + 2 * across + b * along + i])
        s, t = _piece(x, y, z, ix, iy, iz, (work[half_y + i] + slack) * abs(ix),
                      (work[half_y + LANES + i] + slack) * abs(iy),
                      (work[half_y + 2 * LANES + i] + slack) * abs(iz), length)
        weight = max(0.0, t - s)
        work[sums + 4 * j + i] = weight
        work[sums + 4 * j + LANES + i] = weight * (s + t)
        work[sums + 4 * j + 2 * LANES + i] = even_odd * weight
        work[sums + 4 * j + 3 * LANES + i] = halves * weight
        s, t = _ends(s, t)
        work[low_y + i] = _lower(work[low_y + i], x + s * ex, x + t * ex)
        work[high_y + i] = _higher(work[high_y + i], x + s * ex, x + t * ex)
        work[low_y + LANES + i] = _lower(work[low_y + LANES + i], y + s * ey, y + t * ey)
        work[high_y + LANES + i] = _higher(work[high_y + LANES + i], y + s * ey, y + t * ey)
        work[low_y + 2 * LANES + i] = _lower(work[low_y + 2 * LANES + i], z + s * ez, z + t * ez)
        work[high_y + 2 * LANES + i] = _higher(work[high_y + 2 * LANES + i], z + s * ez, z + t * ez)
        ga = ga if s <= t else math.nan
        gb = gb if s <= t else math.nan
        work[low_x + j + i] = _lower(work[low_x + j + i], s, s)
        work[high_x + j + i] = _higher(work[high_x + j + i], t, t)
        work[low_x + a + i] = _lower(work[low_x + a + i], ga, ga)
        work[high_x + a + i] = _higher(work[high_x + a + i], ga, ga)
        work[low_x + b + i] = _lower(work[low_x + b + i], gb, gb)
        work[high_x + b + i] = _higher(work[high_x + b + i], gb, gb)


@kernel
def outline_block(count, work):
    """Outlines of a block of `count` pairs; of those that do not overlap, without meaning."""
    x, y, z = 0, LANES, 2 * LANES
    if count == 1:
        _begin(SINGLE, work)
        _side_by_side(work, HALF_A, HALF_B, CENTRE_A, 3, LANES, LOW_A, HIGH_A, LOW_B, HIGH_B,
                      SUMS_A, x, y, z)
        _side_by_side(work, HALF_A, HALF_B, CENTRE_A, 3, LANES, LOW_A, HIGH_A, LOW_B, HIGH_B,
                      SUMS_A, y, z, x)
        _side_by_side(work, HALF_A, HALF_B, CENTRE_A, 3, LANES, LOW_A, HIGH_A, LOW_B, HIGH_B,
                      SUMS_A, z, x, y)
        _side_by_side(work, HALF_B, HALF_A, CENTRE_B, 1, 3 * LANES, LOW_B, HIGH_B, LOW_A, HIGH_A,
                      SUMS_B, x, y, z)
        _side_by_side(work, HALF_B, HALF_A, CENTRE_B, 1, 3 * LANES, LOW_B, HIGH_B, LOW_A, HIGH_A,
                      SUMS_B, y, z, x)
        _side_by_side(work, HALF_B, HALF_A, CENTRE_B, 1, 3 * LANES, LOW_B, HIGH_B, LOW_A, HIGH_A,
                      SUMS_B, z, x, y)
        _join(work)
        _finish(1, work)
    else:
        _begin(LANES, work)
        _four_edges(work, HALF_A, HALF_B, CENTRE_A, 3, LANES, LOW_A, HIGH_A, LOW_B, HIGH_B,
                    SUMS_A, x, y, z)
        _four_edges(work, HALF_A, HALF_B, CENTRE_A, 3, LANES, LOW_A, HIGH_A, LOW_B, HIGH_B,
                    SUMS_A, y, z, x)
        _four_edges(work, HALF_A, HALF_B, CENTRE_A, 3, LANES, LOW_A, HIGH_A, LOW_B, HIGH_B,
                    SUMS_A, z, x, y)
        _four_edges(work, HALF_B, HALF_A, CENTRE_B, 1, 3 * LANES, LOW_B, HIGH_B, LOW_A, HIGH_A,
                    SUMS_B, x, y, z)
        _four_edges(work, HALF_B, HALF_A, CENTRE_B, 1, 3 * LANES, LOW_B, HIGH_B, LOW_A, HIGH_A,
                    SUMS_B, y, z, x)
        _four_edges(work, HALF_B, HALF_A, CENTRE_B, 1, 3 * LANES, LOW_B, HIGH_B, LOW_A, HIGH_A,
                    SUMS_B, z, x, y)
        _finish(LANES, work)


@inlined
def _begin(lanes, work):
    for k in range(0, 9 * LANES, 3 * LANES):
        for i in range(lanes):
            # Three reciprocals for one division, which costs as much as ten multiplications.
            r0, r1, r2 = (work[ROTATION + k + i], work[ROTATION + k + LANES + i],
                          work[ROTATION + k + 2 * LANES + i])
            r0 = r0 if abs(r0) > _PARALLEL else _PARALLEL
            r1 = r1 if abs(r1) > _PARALLEL else _PARALLEL
            r2 = r2 if abs(r2) > _PARALLEL else _PARALLEL
            inverse = 1.0 / (r0 * (r1 * r2))
            work[INVERSE + k + i] = inverse * (r1 * r2)
            work[INVERSE + k + LANES + i] = inverse * (r0 * r2)
            work[INVERSE + k + 2 * LANES + i] = inverse * (r0 * r1)
    for k in range(0, 3 * LANES, LANES):
        for i in range(lanes):
            work[CENTRE_A + k + i] = -work[OFFSET_B + k + i]
            work[CENTRE_B + k + i] = work[OFFSET_A + k + i]
            work[LOW_A + k + i] = _NOWHERE
            work[LOW_B + k + i] = _NOWHERE
            work[HIGH_A + k + i] = -_NOWHERE
            work[HIGH_B + k + i] = -_NOWHERE


@inlined
def _join(work):
    """Put what the four lanes of a single pair found into the first."""
    for k in range(0, 3 * LANES, LANES):
        for i in range(1, SINGLE):
            work[LOW_A + k] = min(work[LOW_A + k], work[LOW_A + k + i])
            work[HIGH_A + k] = max(work[HIGH_A + k], work[HIGH_A + k + i])
            work[LOW_B + k] = min(work[LOW_B + k], work[LOW_B + k + i])
            work[HIGH_B + k] = max(work[HIGH_B + k], work[HIGH_B + k + i])
    for k in range(0, 12 * LANES, LANES):
        work[SUMS_A + k] = (work[SUMS_A + k] + work[SUMS_A + k + 1]) + (
            work[SUMS_A + k + 2] + work[SUMS_A + k + 3])
        work[SUMS_B + k] = (work[SUMS_B + k] + work[SUMS_B + k + 1]) + (
            work[SUMS_B + k + 2] + work[SUMS_B + k + 3])


@inlined
def _mean(work, sums, half, j, a, b, i):
    """Component j of a box's mean over its edges' pieces, times their length, in its own frame."""
    return 0.5 * work[sums + 4 * j + LANES + i] + work[half + j + i] * (
        work[sums + 4 * b + 2 * LANES + i] + work[sums + 4 * a + 3 * LANES + i])


@inlined
def _finish(lanes, work):
    for i in range(lanes):
        size_a = ((work[HIGH_A + i] - work[LOW_A + i])
                  * (work[HIGH_A + LANES + i] - work[LOW_A + LANES + i])
                  * (work[HIGH_A + 2 * LANES + i] - work[LOW_A + 2 * LANES + i]))
        size_b = ((work[HIGH_B + i] - work[LOW_B + i])
                  * (work[HIGH_B + LANES + i] - work[LOW_B + LANES + i])
                  * (work[HIGH_B + 2 * LANES + i] - work[LOW_B + 2 * LANES + i]))
        in_b = size_b < (1.0 - _ALIKE) * size_a
        work[IN_B + i] = 1.0 if in_b else 0.0
        # The point inside, in A's frame and in B's: means over A's edges and over B's, each in its
        # own box's frame, are brought to the other frame and added.
        ax, ay, az = (_mean(work, SUMS_A, HALF_A, 0, LANES, 2 * LANES, i),
                      _mean(work, SUMS_A, HALF_A, LANES, 2 * LANES, 0, i),
                      _mean(work, SUMS_A, HALF_A, 2 * LANES, 0, LANES, i))
        bx, by, bz = (_mean(work, SUMS_B, HALF_B, 0, LANES, 2 * LANES, i),
                      _mean(work, SUMS_B, HALF_B, LANES, 2 * LANES, 0, i),
                      _mean(work, SUMS_B, HALF_B, 2 * LANES, 0, LANES, i))
        length_a = (work[SUMS_A + i] + work[SUMS_A + 4 * LANES + i]) + work[SUMS_A + 8 * LANES + i]
        length_b = (work[SUMS_B + i] + work[SUMS_B + 4 * LANES + i]) + work[SUMS_B + 8 * LANES + i]
        scale = 1.0 / (length_a + length_b)
        _choose(work, 0, i, in_b, scale,
                ax + (_turned(work, ROTATION, LANES, i, bx, by, bz)
                      + length_b * work[CENTRE_B + i]),
                bx + (_turned(work, ROTATION, 3 * LANES, i, ax, ay, az)
                      + length_a * work[CENTRE_A + i]))
        _choose(work, LANES, i, in_b, scale,
                ay + (_turned(work, ROTATION + 3 * LANES, LANES, i, bx, by, bz)
                      + length_b * work[CENTRE_B + LANES + i]),
                by + (_turned(work, ROTATION + LANES, 3 * LANES, i, ax, ay, az)
                      + length_a * work[CENTRE_A + LANES + i]))
        _choose(work, 2 * LANES, i, in_b, scale,
                az + (_turned(work, ROTATION + 6 * LANES, LANES, i, bx, by, bz)
                      + length_b * work[CENTRE_B + 2 * LANES + i]),
                bz + (_turned(work, ROTATION + 2 * LANES, 3 * LANES, i, ax, ay, az)
                      + length_a * work[CENTRE_A + 2 * LANES + i]))


@inlined
def _turned(work, first, step, i, x, y, z):
    """A row (step LANES) or a column (step 3 · LANES) of R times a vector."""
    return (work[first + i] * x + work[first + step + i] * y) + work[first + 2 * step + i] * z


@inlined
def _choose(work, k, i, in_b, scale, inside_a, inside_b):
    low = work[LOW_B + k + i] if in_b else work[LOW_A + k + i]
    high = work[HIGH_B + k + i] if in_b else work[HIGH_A + k + i]
    inside = scale * (inside_b if in_b else inside_a)
    work[MIDDLE + k + i] = 0.5 * (low + high)
    work[HALF + k + i] = max(0.5 * (high - low), _THINNEST)
    work[INSIDE + k + i] = min(high, max(low, inside))

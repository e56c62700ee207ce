"""The outline of A∩B: its bounding box in either box's frame, and a point that lies inside.

Every corner of A∩B lies on an edge of A or of B. So the 24 edges, each cut off where it leaves the
other box, give the exact bounding box of the overlap; and the mean of the pieces, weighted by their
lengths, is a point of A∩B near its centroid. All of it is a fixed sequence of multiplications and
comparisons, the same for every pair: constant cost, and one instruction serves eight pairs.

An edge is cut by three slabs (Kay and Kajiya 1986). Its direction in the other box's frame is a row
or a column of R, so nine reciprocals serve all 24 edges. Each piece is noted in both frames: in its
own box's frame two of its coordinates are constant.

Of the two bounding boxes the smaller one is chosen. It follows the overlap's own direction: a
corner pressed into a face, an edge lying across a face, two crossing edges all fill the better of
the two well, whereas in a frame fixed to the touched face an edge that lies across it is a diagonal
sliver (with the same network and data, errors were two to seven times larger).
"""
from __future__ import annotations

from .block import (
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
    LENGTH,
    LOW_A,
    LOW_B,
    MIDDLE,
    MINUS,
    OFFSET_A,
    OFFSET_B,
    PLUS,
    ROTATION,
    SINGLE,
    SIZE,
    SUM,
)
from .jit import inlined, kernel

_PARALLEL = 1e-300
"""Least magnitude that is inverted: an edge exactly along a slab must not give 0 · ∞."""
_FLUSH = 2.0**-46
"""Slabs are wider by this fraction of the size (1.4e-14). Where faces of both boxes lie in one
plane, rounding may put either box's edges outside the other: of an aligned stack nothing, or one
side, would be left. The rounding of a corner's place is below 32 units of 2⁻⁵³ of the size, and
four times that keeps them; an edge of the overlap is then found twice, which moves nothing out."""
_NOWHERE = 1e300
"""Start of a minimum."""
_THINNEST = 1e-290
"""Least half extent divided by [m]."""
_ALIKE = 1e-6
"""Relative difference up to which the two boxes' volumes are equal, and A's is taken: two edges
that cross have equal ones, and rounding must not choose between the frames."""


@inlined
def _cut(start, end, middle, inverse, half):
    """Cut the piece [start, end] of a line to |middle + t·direction| ≤ half."""
    low = (-half - middle) * inverse
    high = (half - middle) * inverse
    return max(start, min(low, high)), min(end, max(low, high))


@inlined
def _note(work, row_low, row_high, i, p, q, there):
    low, high = min(p, q), max(p, q)
    work[row_low + i] = min(work[row_low + i], low) if there else work[row_low + i]
    work[row_high + i] = max(work[row_high + i], high) if there else work[row_high + i]


@inlined
def _edges_of_b(lanes, work, j, a, b, signs_a, signs_b):
    """B's edge along its axis j, at the signs given of its axes a and b; row offsets, not axes."""
    for i in range(lanes):
        own_a = work[signs_a + i] * work[HALF_B + a + i]
        own_b = work[signs_b + i] * work[HALF_B + b + i]
        length = work[HALF_B + j + i]
        x = work[OFFSET_A + i] + (own_a * work[ROTATION + a + i] + own_b * work[ROTATION + b + i])
        y = work[OFFSET_A + LANES + i] + (own_a * work[ROTATION + 3 * LANES + a + i]
                                          + own_b * work[ROTATION + 3 * LANES + b + i])
        z = work[OFFSET_A + 2 * LANES + i] + (own_a * work[ROTATION + 6 * LANES + a + i]
                                              + own_b * work[ROTATION + 6 * LANES + b + i])
        slack = _FLUSH * work[SIZE + i]
        half_x = work[HALF_A + i] + slack
        half_y = work[HALF_A + LANES + i] + slack
        half_z = work[HALF_A + 2 * LANES + i] + slack
        s, t = _cut(-length, length, x, work[INVERSE + j + i], half_x)
        s, t = _cut(s, t, y, work[INVERSE + 3 * LANES + j + i], half_y)
        s, t = _cut(s, t, z, work[INVERSE + 6 * LANES + j + i], half_z)
        there = t >= s
        ex = work[ROTATION + j + i]
        ey = work[ROTATION + 3 * LANES + j + i]
        ez = work[ROTATION + 6 * LANES + j + i]
        _note(work, LOW_A, HIGH_A, i, x + s * ex, x + t * ex, there)
        _note(work, LOW_A + LANES, HIGH_A + LANES, i, y + s * ey, y + t * ey, there)
        _note(work, LOW_A + 2 * LANES, HIGH_A + 2 * LANES, i, z + s * ez, z + t * ez, there)
        _note(work, LOW_B + j, HIGH_B + j, i, s, t, there)
        _note(work, LOW_B + a, HIGH_B + a, i, own_a, own_a, there)
        _note(work, LOW_B + b, HIGH_B + b, i, own_b, own_b, there)
        weight = t - s if there else 0.0
        both = s + t
        work[SUM + i] += weight * (2.0 * x + both * ex)
        work[SUM + LANES + i] += weight * (2.0 * y + both * ey)
        work[SUM + 2 * LANES + i] += weight * (2.0 * z + both * ez)
        work[LENGTH + i] += weight


@inlined
def _edges_of_a(lanes, work, j, a, b, signs_a, signs_b):
    """A's edge, likewise; in B's frame its direction is row j of R."""
    for i in range(lanes):
        own_a = work[signs_a + i] * work[HALF_A + a + i]
        own_b = work[signs_b + i] * work[HALF_A + b + i]
        length = work[HALF_A + j + i]
        x = (own_a * work[ROTATION + 3 * a + i] + own_b * work[ROTATION + 3 * b + i]
             ) - work[OFFSET_B + i]
        y = (own_a * work[ROTATION + 3 * a + LANES + i] + own_b * work[ROTATION + 3 * b + LANES + i]
             ) - work[OFFSET_B + LANES + i]
        z = (own_a * work[ROTATION + 3 * a + 2 * LANES + i]
             + own_b * work[ROTATION + 3 * b + 2 * LANES + i]) - work[OFFSET_B + 2 * LANES + i]
        slack = _FLUSH * work[SIZE + i]
        half_x = work[HALF_B + i] + slack
        half_y = work[HALF_B + LANES + i] + slack
        half_z = work[HALF_B + 2 * LANES + i] + slack
        s, t = _cut(-length, length, x, work[INVERSE + 3 * j + i], half_x)
        s, t = _cut(s, t, y, work[INVERSE + 3 * j + LANES + i], half_y)
        s, t = _cut(s, t, z, work[INVERSE + 3 * j + 2 * LANES + i], half_z)
        there = t >= s
        ex = work[ROTATION + 3 * j + i]
        ey = work[ROTATION + 3 * j + LANES + i]
        ez = work[ROTATION + 3 * j + 2 * LANES + i]
        _note(work, LOW_B, HIGH_B, i, x + s * ex, x + t * ex, there)
        _note(work, LOW_B + LANES, HIGH_B + LANES, i, y + s * ey, y + t * ey, there)
        _note(work, LOW_B + 2 * LANES, HIGH_B + 2 * LANES, i, z + s * ez, z + t * ez, there)
        _note(work, LOW_A + j, HIGH_A + j, i, s, t, there)
        _note(work, LOW_A + a, HIGH_A + a, i, own_a, own_a, there)
        _note(work, LOW_A + b, HIGH_A + b, i, own_b, own_b, there)
        weight = t - s if there else 0.0
        work[SUM + j + i] += weight * (s + t)
        work[SUM + a + i] += weight * (2.0 * own_a)
        work[SUM + b + i] += weight * (2.0 * own_b)
        work[LENGTH + i] += weight


@inlined
def _edges(lanes, work, signs_a, signs_b):
    """One edge of each box along each of its axes."""
    x, y, z = 0, LANES, 2 * LANES
    _edges_of_a(lanes, work, x, y, z, signs_a, signs_b)
    _edges_of_a(lanes, work, y, z, x, signs_a, signs_b)
    _edges_of_a(lanes, work, z, x, y, signs_a, signs_b)
    _edges_of_b(lanes, work, x, y, z, signs_a, signs_b)
    _edges_of_b(lanes, work, y, z, x, signs_a, signs_b)
    _edges_of_b(lanes, work, z, x, y, signs_a, signs_b)


@kernel
def outline_block(count, work):
    """Outlines of a block of `count` pairs; of those that do not overlap, without meaning."""
    if count == 1:
        # The four edges along an axis side by side, as if they were edges of four pairs.
        _begin(SINGLE, work)
        _edges(SINGLE, work, EVEN_ODD, HALVES)
        _join(work)
        _finish(1, work)
    else:
        # Summed up as a single pair's are, so that a row has the same bits alone and in a batch: the
        # sign of a rounding error chooses the network's mirror image, so it must be the same one.
        _begin(LANES, work)
        _edges(LANES, work, MINUS, MINUS)
        _put_aside(work)
        _edges(LANES, work, PLUS, MINUS)
        _put_aside(work)
        _edges(LANES, work, MINUS, PLUS)
        _put_aside(work)
        _edges(LANES, work, PLUS, PLUS)
        _add_aside(work)
        _finish(LANES, work)


@inlined
def _begin(lanes, work):
    for k in range(9):
        for i in range(lanes):
            r = work[ROTATION + k * LANES + i]
            work[INVERSE + k * LANES + i] = 1.0 / (r if abs(r) > _PARALLEL else _PARALLEL)
    for k in range(3):
        for i in range(lanes):
            work[LOW_A + k * LANES + i] = _NOWHERE
            work[LOW_B + k * LANES + i] = _NOWHERE
            work[HIGH_A + k * LANES + i] = -_NOWHERE
            work[HIGH_B + k * LANES + i] = -_NOWHERE
            work[SUM + k * LANES + i] = 0.0
            work[MIDDLE + k * LANES + i] = 0.0
    for i in range(lanes):
        work[LENGTH + i] = 0.0
        work[IN_B + i] = 0.0


@inlined
def _put_aside(work):
    """Sums so far, of a fourth of the edges each: four rows that `_finish` is first to need."""
    for i in range(LANES):
        work[IN_B + i] += work[LENGTH + i]
        work[LENGTH + i] = 0.0
    for k in range(0, 3 * LANES, LANES):
        for i in range(LANES):
            work[MIDDLE + k + i] += work[SUM + k + i]
            work[SUM + k + i] = 0.0


@inlined
def _add_aside(work):
    for i in range(LANES):
        work[LENGTH + i] = work[IN_B + i] + work[LENGTH + i]
    for k in range(0, 3 * LANES, LANES):
        for i in range(LANES):
            work[SUM + k + i] = work[MIDDLE + k + i] + work[SUM + k + i]


@inlined
def _join(work):
    """Put what SINGLE lanes found of one pair together in the first."""
    for k in range(0, 3 * LANES, LANES):
        for i in range(1, SINGLE):
            work[LOW_A + k] = min(work[LOW_A + k], work[LOW_A + k + i])
            work[HIGH_A + k] = max(work[HIGH_A + k], work[HIGH_A + k + i])
            work[LOW_B + k] = min(work[LOW_B + k], work[LOW_B + k + i])
            work[HIGH_B + k] = max(work[HIGH_B + k], work[HIGH_B + k + i])
            work[SUM + k] += work[SUM + k + i]
    for i in range(1, SINGLE):
        work[LENGTH] += work[LENGTH + i]


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
        # The point inside, first in A's frame, then in B's: Rᵀ (p − t).
        scale = 0.5 / work[LENGTH + i]
        x = work[SUM + i] * scale
        y = work[SUM + LANES + i] * scale
        z = work[SUM + 2 * LANES + i] * scale
        bx = (work[ROTATION + i] * x + work[ROTATION + 3 * LANES + i] * y
              + work[ROTATION + 6 * LANES + i] * z) - work[OFFSET_B + i]
        by = (work[ROTATION + LANES + i] * x + work[ROTATION + 4 * LANES + i] * y
              + work[ROTATION + 7 * LANES + i] * z) - work[OFFSET_B + LANES + i]
        bz = (work[ROTATION + 2 * LANES + i] * x + work[ROTATION + 5 * LANES + i] * y
              + work[ROTATION + 8 * LANES + i] * z) - work[OFFSET_B + 2 * LANES + i]
        _choose(work, 0, i, in_b, x, bx)
        _choose(work, LANES, i, in_b, y, by)
        _choose(work, 2 * LANES, i, in_b, z, bz)


@inlined
def _choose(work, k, i, in_b, inside_a, inside_b):
    low = work[LOW_B + k + i] if in_b else work[LOW_A + k + i]
    high = work[HIGH_B + k + i] if in_b else work[HIGH_A + k + i]
    middle = 0.5 * (low + high)
    half = max(0.5 * (high - low), _THINNEST)
    inside = ((inside_b if in_b else inside_a) - middle) / half
    work[MIDDLE + k + i] = middle
    work[HALF + k + i] = half
    work[INSIDE + k + i] = min(1.0, max(-1.0, inside))

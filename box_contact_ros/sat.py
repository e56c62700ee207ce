"""Which axis separates two boxes, or is the shallowest: the 15-axis separating-axis test.

Two boxes are disjoint exactly if one of 15 axes separates their projections (Gottschalk, Lin and
Manocha 1996): the three face normals of each box and the nine cross products of their edges. The
gap on a unit axis n is |t·n| − r_A(n) − r_B(n) with t = B − A and r the half widths. The largest
of the 15 gaps is the `separation`; for boxes that overlap, its negative is the least translation
that separates them.

1. Face axes. Gaps need the entries of R alone. The best face axis is remembered: it carries the
   frame in which the contact point is built, whatever axis wins.
2. Edge axes, normalised. Each gap is evaluated as the exact gap along the axis AS ROUNDED: the
   half widths are those of that very vector, not the textbook's |R| entries. For edges almost
   parallel the axis is noise of relative size 1e-16 / length, but noise can then only make the
   overlap deeper than the true one, never invent a gap. (With the textbook's entries, a container
   yawed by 1e-7 rad on its stack had a depth wrong by 1e-9 of its length.)
3. Ties. An axis replaces an earlier one only if it is better by more than TIE of the size, in the
   order faces of A, faces of B, edges: aligned boxes, for which up to four axes agree to the last
   bits, get the face normal.

The separation is the largest gap itself, tie or not, and it has the same bits when the boxes are
swapped: face gaps because their formulas are symmetric, edge gaps (and all gaps of `grazing` pairs)
because they are evaluated in the frame of the box that comes first in an order of the data, not of
the call.
"""
from __future__ import annotations

import math

from .block import (
    A_FIRST,
    AXIS,
    FACE,
    GRAZING,
    HALF_A,
    HALF_B,
    LANES,
    NORMAL,
    OFFSET_A,
    OFFSET_B,
    ROTATION,
    SEPARATION,
    SIZE,
    TOUCH,
)
from .grazing import TIE, grazing, refine
from .jit import inlined, kernel

PARALLEL = 1e-8
"""Edge axes shorter than this (sine of the angle between the edges) are skipped. Boxes that share
an edge direction are separated by a face axis if at all, and of an overlap what is lost below is
at most 1e-8 of the size (of a gap up to 30 %, which leaves a lower bound of the distance); the
common alternatives are worse: a constant added to |R| reports contacts across real
gaps, no guard at all misses 17–23 % of stacked containers at a tilt of 1e-16 rad."""

ALMOST_PARALLEL = 1e-3
"""Sine below which rounding costs an edge axis digits that may matter."""

DOUBT = 2.0**-47
"""Error of a gap times the sine [of the size]: entries of R are good to 2⁻⁵¹, so at an angle θ the
axis's direction is good to 2⁻⁵¹/θ, and levers are up to the size on both sides."""


@inlined
def _edge_gap(t1, t2, h1, h2, u1, u2, v1, v2, hv, w1, w2, hw, doubt):
    """Gap on the axis e × u in the frame of a box with the edge direction e, and what it may be.

    1 and 2 count the two components across e: offset t, half extents h of that box, edge u of the
    other box, and the other box's two further edges v and w with half extents hv and hw. In this
    frame the axis is (0, −u2, u1).
    """
    length2 = u1 * u1 + u2 * u2
    width = ((h1 * abs(u2) + h2 * abs(u1))
             + (hv * abs(v2 * u1 - v1 * u2) + hw * abs(w2 * u1 - w1 * u2)))
    overlap = abs(t2 * u1 - t1 * u2) - width
    inverse = 1.0 / math.sqrt(length2)
    longer = length2 >= PARALLEL * PARALLEL
    shorter = length2 < ALMOST_PARALLEL * ALMOST_PARALLEL
    return (overlap * inverse if longer else -math.inf,
            (overlap + doubt) * inverse if longer and shorter else -math.inf)


@inlined
def _better(best, axis, gap, candidate, tie):
    """The better of two axes, the earlier one where they tie."""
    wins = gap > best + tie
    return (gap if wins else best), (candidate if wins else axis)


@kernel
def query_block(count, work):
    """SAT of a block of `count` pairs: writes SEPARATION, AXIS, FACE and NORMAL."""
    if count == 1:
        _query(1, work)
        _normals(1, work)
    else:
        _query(LANES, work)
        _normals(LANES, work)
    for i in range(count):
        if work[GRAZING + i] > 0.5:
            refine(work, i)


@inlined
def _query(lanes, work):
    for i in range(lanes):
        r00 = work[ROTATION + i]
        r01 = work[ROTATION + LANES + i]
        r02 = work[ROTATION + 2 * LANES + i]
        r10 = work[ROTATION + 3 * LANES + i]
        r11 = work[ROTATION + 4 * LANES + i]
        r12 = work[ROTATION + 5 * LANES + i]
        r20 = work[ROTATION + 6 * LANES + i]
        r21 = work[ROTATION + 7 * LANES + i]
        r22 = work[ROTATION + 8 * LANES + i]
        ha0 = work[HALF_A + i]
        ha1 = work[HALF_A + LANES + i]
        ha2 = work[HALF_A + 2 * LANES + i]
        hb0 = work[HALF_B + i]
        hb1 = work[HALF_B + LANES + i]
        hb2 = work[HALF_B + 2 * LANES + i]
        ta0 = work[OFFSET_A + i]
        ta1 = work[OFFSET_A + LANES + i]
        ta2 = work[OFFSET_A + 2 * LANES + i]
        tb0 = work[OFFSET_B + i]
        tb1 = work[OFFSET_B + LANES + i]
        tb2 = work[OFFSET_B + 2 * LANES + i]
        tie = TIE * work[SIZE + i]
        doubt = DOUBT * work[SIZE + i]

        # 1. Face axes.
        g0 = abs(ta0) - (ha0 + ((hb0 * abs(r00) + hb1 * abs(r01)) + hb2 * abs(r02)))
        g1 = abs(ta1) - (ha1 + ((hb0 * abs(r10) + hb1 * abs(r11)) + hb2 * abs(r12)))
        g2 = abs(ta2) - (ha2 + ((hb0 * abs(r20) + hb1 * abs(r21)) + hb2 * abs(r22)))
        g3 = abs(tb0) - (hb0 + ((ha0 * abs(r00) + ha1 * abs(r10)) + ha2 * abs(r20)))
        g4 = abs(tb1) - (hb1 + ((ha0 * abs(r01) + ha1 * abs(r11)) + ha2 * abs(r21)))
        g5 = abs(tb2) - (hb2 + ((ha0 * abs(r02) + ha1 * abs(r12)) + ha2 * abs(r22)))
        best, axis = _better(g0, 0.0, g1, 1.0, tie)
        best, axis = _better(best, axis, g2, 2.0, tie)
        best, axis = _better(best, axis, g3, 3.0, tie)
        best, axis = _better(best, axis, g4, 4.0, tie)
        best, face = _better(best, axis, g5, 5.0, tie)
        work[FACE + i] = face
        top = max(max(max(g0, g1), max(g2, g3)), max(g4, g5))

        # 2. Edge axes, in the frame of the box that comes first: t offset, h its half extents,
        #    o the other box's, r the other box's orientation.
        first = work[A_FIRST + i] > 0.5
        t0, h0, o0 = (ta0 if first else tb0), (ha0 if first else hb0), (hb0 if first else ha0)
        t1, h1, o1 = (ta1 if first else tb1), (ha1 if first else hb1), (hb1 if first else ha1)
        t2, h2, o2 = (ta2 if first else tb2), (ha2 if first else hb2), (hb2 if first else ha2)
        r01, r10 = (r01 if first else r10), (r10 if first else r01)
        r02, r20 = (r02 if first else r20), (r20 if first else r02)
        r12, r21 = (r12 if first else r21), (r21 if first else r12)
        g0, e0 = _edge_gap(t1, t2, h1, h2, r10, r20, r11, r21, o1, r12, r22, o2, doubt)
        g1, e1 = _edge_gap(t1, t2, h1, h2, r11, r21, r12, r22, o2, r10, r20, o0, doubt)
        g2, e2 = _edge_gap(t1, t2, h1, h2, r12, r22, r10, r20, o0, r11, r21, o1, doubt)
        g3, e3 = _edge_gap(t2, t0, h2, h0, r20, r00, r21, r01, o1, r22, r02, o2, doubt)
        g4, e4 = _edge_gap(t2, t0, h2, h0, r21, r01, r22, r02, o2, r20, r00, o0, doubt)
        g5, e5 = _edge_gap(t2, t0, h2, h0, r22, r02, r20, r00, o0, r21, r01, o1, doubt)
        g6, e6 = _edge_gap(t0, t1, h0, h1, r00, r10, r01, r11, o1, r02, r12, o2, doubt)
        g7, e7 = _edge_gap(t0, t1, h0, h1, r01, r11, r02, r12, o2, r00, r10, o0, doubt)
        g8, e8 = _edge_gap(t0, t1, h0, h1, r02, r12, r00, r10, o0, r01, r11, o1, doubt)
        best, axis = _better(best, face, g0, 6.0, tie)
        best, axis = _better(best, axis, g1, 7.0 if first else 9.0, tie)
        best, axis = _better(best, axis, g2, 8.0 if first else 12.0, tie)
        best, axis = _better(best, axis, g3, 9.0 if first else 7.0, tie)
        best, axis = _better(best, axis, g4, 10.0, tie)
        best, axis = _better(best, axis, g5, 11.0 if first else 13.0, tie)
        best, axis = _better(best, axis, g6, 12.0 if first else 8.0, tie)
        best, axis = _better(best, axis, g7, 13.0 if first else 11.0, tie)
        best, axis = _better(best, axis, g8, 14.0, tie)
        work[AXIS + i] = axis
        top = max(top, max(max(max(g0, g1), max(g2, g3)), max(max(g4, g5), max(g6, max(g7, g8)))))
        work[SEPARATION + i] = top
        hope = max(max(max(e0, e1), max(e2, e3)), max(max(e4, e5), max(e6, max(e7, e8))))
        skipped = max(max(
            max(_skipped(r10, r20), _skipped(r11, r21)), max(_skipped(r12, r22), _skipped(r20, r00))
        ), max(max(_skipped(r21, r01), _skipped(r22, r02)),
               max(_skipped(r00, r10), max(_skipped(r01, r11), _skipped(r02, r12)))))
        work[GRAZING + i] = grazing(top, work[TOUCH + i], work[SIZE + i], hope, skipped)


@inlined
def _skipped(u1, u2):
    """Squared length of a cross product that is skipped."""
    length2 = u1 * u1 + u2 * u2
    return length2 if length2 < PARALLEL * PARALLEL else 0.0


@inlined
def _one_of(k, x0, x1, x2):
    return x0 if k == 0.0 else (x1 if k == 1.0 else x2)


@inlined
def _normals(lanes, work):
    """The winning axes as unit vectors from A to B, in A's frame."""
    for i in range(lanes):
        r00 = work[ROTATION + i]
        r01 = work[ROTATION + LANES + i]
        r02 = work[ROTATION + 2 * LANES + i]
        r10 = work[ROTATION + 3 * LANES + i]
        r11 = work[ROTATION + 4 * LANES + i]
        r12 = work[ROTATION + 5 * LANES + i]
        r20 = work[ROTATION + 6 * LANES + i]
        r21 = work[ROTATION + 7 * LANES + i]
        r22 = work[ROTATION + 8 * LANES + i]
        ta0, ta1, ta2 = (work[OFFSET_A + i], work[OFFSET_A + LANES + i],
                         work[OFFSET_A + 2 * LANES + i])
        tb0, tb1, tb2 = (work[OFFSET_B + i], work[OFFSET_B + LANES + i],
                         work[OFFSET_B + 2 * LANES + i])
        axis = work[AXIS + i]
        # A face of A or of B: a unit vector, or a column of R.
        of_a = axis < 3.0
        k = axis if of_a else axis - 3.0
        x = (1.0 if k == 0.0 else 0.0) if of_a else _one_of(k, r00, r01, r02)
        y = (1.0 if k == 1.0 else 0.0) if of_a else _one_of(k, r10, r11, r12)
        z = (1.0 if k == 2.0 else 0.0) if of_a else _one_of(k, r20, r21, r22)
        along = _one_of(k, ta0, ta1, ta2) if of_a else _one_of(k, tb0, tb1, tb2)
        # A pair of edges, in the very frame in which the query evaluated it: the first box's edge e
        # crossed with u, the other box's, which is a column of R or of its transpose.
        first = work[A_FIRST + i] > 0.5
        number = axis - 6.0
        row = 0.0 if number < 3.0 else (1.0 if number < 6.0 else 2.0)
        column = number - 3.0 * row
        e = row if first else column
        j = column if first else row
        u0 = _one_of(j, r00, r01 if first else r10, r02 if first else r20)
        u1 = _one_of(j, r10 if first else r01, r11, r12 if first else r21)
        u2 = _one_of(j, r20 if first else r02, r21 if first else r12, r22)
        n0 = _one_of(e, 0.0, u2, -u1)
        n1 = _one_of(e, -u2, 0.0, u0)
        n2 = _one_of(e, u1, -u0, 0.0)
        t0, t1, t2 = (ta0 if first else tb0), (ta1 if first else tb1), (ta2 if first else tb2)
        length2 = (n0 * n0 + n1 * n1) + n2 * n2
        edges = axis >= 6.0
        along = (t0 * n0 + t1 * n1) + t2 * n2 if edges else along
        s = 1.0 if along >= 0.0 else -1.0
        f = s / math.sqrt(length2 if length2 > 0.0 else 1.0)
        n0, n1, n2 = f * n0, f * n1, f * n2
        m0 = n0 if first else (r00 * n0 + r01 * n1) + r02 * n2
        m1 = n1 if first else (r10 * n0 + r11 * n1) + r12 * n2
        m2 = n2 if first else (r20 * n0 + r21 * n1) + r22 * n2
        work[NORMAL + i] = m0 if edges else s * x
        work[NORMAL + LANES + i] = m1 if edges else s * y
        work[NORMAL + 2 * LANES + i] = m2 if edges else s * z

"""The exact contact point: the centroid of the overlap region A∩B, by clipping.

The frame is that of the box with the best face axis (the reference box): its contact face is the
plane w = 0, the box lies below it, and (u, v) run along the face. Of the other (incident) box, the
column over (u, v) reaches from w_bottom to w_top; the part inside the reference box is
clamp(w_top) − clamp(w_bottom), clamped to [−thickness, 0]. So the volume of A∩B and its first
moments are sums, over the incident box's six faces, of integrals of the clamped height over the
face's projection, cut off at the reference rectangle:

1. Corners of the incident box in (u, v, w); a face wholly above w = 0 contributes nothing.
2. Each other face is clipped by the rectangle's four sides and by w ≤ 0 (Sutherland–Hodgman).
3. A part that comes out below the reference box counts with the constant height −thickness; what
   is in both parts of a face must not be, so this one is cut triangle by triangle.
4. Signed integrals of w, u w, v w and w²/2 over the polygon, triangle by triangle.

No face of the reference box is ever clipped, and every integrand is continuous and vanishes on the
plane w = 0. That is why coplanar faces need no case: they contribute nothing, in exact arithmetic
and in rounded. (Clipping both boxes' faces and adding them up counts a shared face twice or not at
all, at the mercy of the last bit.)

Accuracy: heights carry an error of a few roundings of the size, so the centroid's error is about
1e-16·size/depth of the size. A∩B contains a ball of radius depth/(2√3) (shrink both boxes by more
and an axis separates them), so the volume stays well above that error down to DEPTH_FLOOR.
"""
from __future__ import annotations

import numpy as np

from .block import (
    CORNERS,
    FACE,
    HALF_A,
    HALF_B,
    LANES,
    NORMAL,
    OFFSET_A,
    OFFSET_B,
    POLYGONS,
    ROTATION,
    SEPARATION,
    SINGLE,
    SIZE,
    TRIANGLE,
)
from .jit import inlined, kernel
from .sat import PARALLEL

DEPTH_FLOOR = 1e-9
"""Depth, as a fraction of the size, to which B is pressed in before the centroid is taken. At exact
touch A∩B has no volume; at 1e-9 of the size its heights still have seven good digits."""

CANCELLED = 1e-3
"""Part of the volume's integrals that has to be left in their sum. At the least depth their heights
have seven digits; of scenes' boxes always more than a tenth is left, of thin plates not always."""
PRESSES = 8
"""Most moves of `press_on`: three axes at a corner, and some more because they are not at right
angles."""

_FACES = np.array([[0, 4, 6, 2], [1, 3, 7, 5],     # x = −, +; corner c has signs (c&1, c&2, c&4)
                   [0, 1, 5, 4], [2, 6, 7, 3],     # y = −, +
                   [0, 2, 3, 1], [4, 5, 7, 6]])    # z = −, +; all counter-clockwise from outside
_CORNERS = np.array([[1.0 if corner >> k & 1 else -1.0 for k in range(3)] for corner in range(8)])


@kernel
def _clip(work, source, count, target, axis, sign, bound):
    """Keep the part of a polygon with sign·p[axis] ≤ bound; returns its number of vertices."""
    kept = 0
    before = source + 3 * (count - 1)
    excess_before = sign * work[before + axis] - bound
    for vertex in range(count):
        here = source + 3 * vertex
        excess = sign * work[here + axis] - bound
        if (excess > 0.0) != (excess_before > 0.0):
            f = excess_before / (excess_before - excess)
            for k in range(3):
                work[target + 3 * kept + k] = (
                    work[before + k] + f * (work[here + k] - work[before + k]))
            work[target + 3 * kept + axis] = sign * bound
            kept += 1
        if not excess > 0.0:
            for k in range(3):
                work[target + 3 * kept + k] = work[here + k]
            kept += 1
        before = here
        excess_before = excess
    return kept


@kernel
def _moments(work, polygon, count):
    """Signed ∫ (w, u w, v w, w²/2) over the projection of a polygon on (u, v), by triangles."""
    m0, mu, mv, mw = 0.0, 0.0, 0.0, 0.0
    u0, v0, w0 = work[polygon], work[polygon + 1], work[polygon + 2]
    for vertex in range(1, count - 1):
        p = polygon + 3 * vertex
        u1, v1, w1 = work[p], work[p + 1], work[p + 2]
        u2, v2, w2 = work[p + 3], work[p + 4], work[p + 5]
        double = (u1 - u0) * (v2 - v0) - (u2 - u0) * (v1 - v0)
        w = w0 + w1 + w2
        m0 += double * w * (1.0 / 6.0)
        mu += double * ((u0 + u1 + u2) * w + (u0 * w0 + u1 * w1 + u2 * w2)) * (1.0 / 24.0)
        mv += double * ((v0 + v1 + v2) * w + (v0 * w0 + v1 * w1 + v2 * w2)) * (1.0 / 24.0)
        mw += double * (w * w + (w0 * w0 + w1 * w1 + w2 * w2)) * (1.0 / 48.0)
    return m0, mu, mv, mw


@kernel
def _lifted_moments(work, polygon, count, target, floor):
    """`_moments` of a polygon, whatever of it lies below w = `floor` lifted to there.

    It is cut in two, triangle by triangle: the corners of a face are not in one plane to the last
    bit, and where one lies in the far face of the reference box, flush, they may be below and above
    it by turns. Of such a saddle both parts have the middle, which counted twice: a centroid off by
    8 % of the size, between boxes at one and the same pose.
    """
    m0, mu, mv, mw = 0.0, 0.0, 0.0, 0.0
    for vertex in range(1, count - 1):
        for k in range(3):
            work[TRIANGLE + k] = work[polygon + k]
            work[TRIANGLE + 3 + k] = work[polygon + 3 * vertex + k]
            work[TRIANGLE + 6 + k] = work[polygon + 3 * vertex + 3 + k]
        w0, w1, w2 = work[TRIANGLE + 2], work[TRIANGLE + 5], work[TRIANGLE + 8]
        lowest, highest = min(min(w0, w1), w2), max(max(w0, w1), w2)
        # One that lies in the plane, to the last bit, is a part below it and none above.
        if highest > floor:
            above = _clip(work, TRIANGLE, 3, target, 2, -1.0, -floor)
            d0, du, dv, dw = _moments(work, target, above)
            m0, mu, mv, mw = m0 + d0, mu + du, mv + dv, mw + dw
        if lowest < floor or not highest > floor:
            below = _clip(work, TRIANGLE, 3, target, 2, 1.0, floor)
            for corner in range(below):
                work[target + 3 * corner + 2] = floor
            d0, du, dv, dw = _moments(work, target, below)
            m0, mu, mv, mw = m0 + d0, mu + du, mv + dv, mw + dw
    return m0, mu, mv, mw


@kernel
def press(work, i):
    """Move B of pair `i` against the normal until it is DEPTH_FLOOR deep, if it is not yet.

    The separation stays what it was.
    """
    move = DEPTH_FLOOR * work[SIZE + i] + work[SEPARATION + i]
    if move > 0.0:
        _move(work, i, move, work[NORMAL + i], work[NORMAL + LANES + i],
              work[NORMAL + 2 * LANES + i])


@inlined
def _move(work, i, move, n0, n1, n2):
    """Move B against a direction (n0, n1, n2), given in A's frame."""
    for k in range(3):
        work[OFFSET_A + k * LANES + i] -= move * (n0 if k == 0 else (n1 if k == 1 else n2))
        work[OFFSET_B + k * LANES + i] -= move * (
            work[ROTATION + k * LANES + i] * n0 + work[ROTATION + (3 + k) * LANES + i] * n1
            + work[ROTATION + (6 + k) * LANES + i] * n2)


@kernel
def press_on(work, i):
    """Go on where `press` had to move pair `i` and left it with less than half of DEPTH_FLOOR.

    Where a corner touches a corner or an edge, several axes have gap zero, and moving B along one
    of them leaves the boxes touching along the others. B is moved along each in turn.
    """
    floor = DEPTH_FLOOR * work[SIZE + i]
    if work[SEPARATION + i] <= -floor:
        return
    for _ in range(PRESSES):
        gap, n0, n1, n2 = _largest_gap(work, i)
        if gap <= -0.5 * floor:
            break
        _move(work, i, floor + gap, n0, n1, n2)


@kernel
def _largest_gap(work, i):
    """Largest gap over the fifteen axes as pair `i` stands now, and its axis, from A to B."""
    best = -np.inf
    b0, b1, b2 = 0.0, 0.0, 0.0
    for number in range(15):
        if number < 3:
            n0, n1, n2 = (1.0 if number == 0 else 0.0, 1.0 if number == 1 else 0.0,
                          1.0 if number == 2 else 0.0)
        else:
            j = (number - 3) % 3
            r0, r1, r2 = (work[ROTATION + j * LANES + i], work[ROTATION + (3 + j) * LANES + i],
                          work[ROTATION + (6 + j) * LANES + i])
            if number < 6:
                n0, n1, n2 = r0, r1, r2
            else:
                k = (number - 6) // 3
                n0 = 0.0 if k == 0 else (r2 if k == 1 else -r1)
                n1 = -r2 if k == 0 else (0.0 if k == 1 else r0)
                n2 = r1 if k == 0 else (-r0 if k == 1 else 0.0)
                length = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
                if length < PARALLEL:
                    continue
                n0, n1, n2 = n0 / length, n1 / length, n2 / length
        width = (abs(n0) * work[HALF_A + i] + abs(n1) * work[HALF_A + LANES + i]
                 + abs(n2) * work[HALF_A + 2 * LANES + i])
        for j in range(3):
            width += work[HALF_B + j * LANES + i] * abs(
                n0 * work[ROTATION + j * LANES + i] + n1 * work[ROTATION + (3 + j) * LANES + i]
                + n2 * work[ROTATION + (6 + j) * LANES + i])
        along = (n0 * work[OFFSET_A + i] + n1 * work[OFFSET_A + LANES + i]
                 + n2 * work[OFFSET_A + 2 * LANES + i])
        if abs(along) - width > best:
            best = abs(along) - width
            side = 1.0 if along >= 0.0 else -1.0
            b0, b1, b2 = side * n0, side * n1, side * n2
    return best, b0, b1, b2


@kernel
def repeat_pressed(work):
    """Press the other lanes of a single pair like the first."""
    for k in range(0, 3 * LANES, LANES):
        for i in range(1, SINGLE):
            work[OFFSET_A + k + i] = work[OFFSET_A + k]
            work[OFFSET_B + k + i] = work[OFFSET_B + k]


@kernel
def centroid(work, i):
    """Centroid of A∩B of pair `i`, which has been pressed in, in A's frame.

    The face axis with the largest gap nearly always serves best as the reference. Where integrals
    cancel with it (a thin box that crosses another one's edge, and goes through its plane nearby),
    the others are tried, and the one with which they cancel least is taken.
    """
    best = int(work[FACE + i])
    x, y, z, kept = _centroid_from(work, i, best)
    if kept < CANCELLED:
        for face in range(6):
            if face != best:
                x1, y1, z1, kept1 = _centroid_from(work, i, face)
                if kept1 > kept:
                    x, y, z, kept = x1, y1, z1, kept1
    return x, y, z


@kernel
def _centroid_from(work, i, face):
    """The centroid with a face axis (0–5) as the reference, and what part of the volume is left.

    That is the part of the integrals' volume which is left of them in the sum.
    """
    of_a = face < 3
    k = face if of_a else face - 3
    a = (k + 1) % 3
    b = (k + 2) % 3

    # The incident box in the reference box's frame, (u, v, w) = (a, b, k): centre c, axes e.
    ku, kv, kw = a * LANES, b * LANES, k * LANES
    if of_a:
        cu, cv, cw = work[OFFSET_A + ku + i], work[OFFSET_A + kv + i], work[OFFSET_A + kw + i]
        hu, hv, hw = work[HALF_A + ku + i], work[HALF_A + kv + i], work[HALF_A + kw + i]
        g0, g1, g2 = work[HALF_B + i], work[HALF_B + LANES + i], work[HALF_B + 2 * LANES + i]
        row, column = 3 * LANES, LANES
    else:
        cu, cv, cw = -work[OFFSET_B + ku + i], -work[OFFSET_B + kv + i], -work[OFFSET_B + kw + i]
        hu, hv, hw = work[HALF_B + ku + i], work[HALF_B + kv + i], work[HALF_B + kw + i]
        g0, g1, g2 = work[HALF_A + i], work[HALF_A + LANES + i], work[HALF_A + 2 * LANES + i]
        row, column = LANES, 3 * LANES
    side = 1.0 if cw >= 0.0 else -1.0
    eu0 = g0 * work[ROTATION + a * row + i]
    eu1 = g1 * work[ROTATION + a * row + column + i]
    eu2 = g2 * work[ROTATION + a * row + 2 * column + i]
    ev0 = g0 * work[ROTATION + b * row + i]
    ev1 = g1 * work[ROTATION + b * row + column + i]
    ev2 = g2 * work[ROTATION + b * row + 2 * column + i]
    ew0 = side * g0 * work[ROTATION + k * row + i]
    ew1 = side * g1 * work[ROTATION + k * row + column + i]
    ew2 = side * g2 * work[ROTATION + k * row + 2 * column + i]

    # Moments are taken about the middle of the rectangle that bounds both boxes' projections, so
    # that a small box on a large one keeps its own digits.
    reach = abs(eu0) + abs(eu1) + abs(eu2)
    u_low, u_high = max(-hu, cu - reach), min(hu, cu + reach)
    middle_u = 0.5 * (u_low + u_high)
    reach = abs(ev0) + abs(ev1) + abs(ev2)
    v_low, v_high = max(-hv, cv - reach), min(hv, cv + reach)
    middle_v = 0.5 * (v_low + v_high)

    # 1. Corners, w measured from the contact face.
    top = side * cw - hw
    lowest = 0.0
    for corner in range(8):
        s0, s1, s2 = _CORNERS[corner, 0], _CORNERS[corner, 1], _CORNERS[corner, 2]
        w = top + (s0 * ew0 + s1 * ew1 + s2 * ew2)
        work[CORNERS + 3 * corner] = (cu - middle_u) + (s0 * eu0 + s1 * eu1 + s2 * eu2)
        work[CORNERS + 3 * corner + 1] = (cv - middle_v) + (s0 * ev0 + s1 * ev1 + s2 * ev2)
        work[CORNERS + 3 * corner + 2] = w
        lowest = min(lowest, w)
    through = lowest < -2.0 * hw

    volume, mu, mv, mw, gross = 0.0, 0.0, 0.0, 0.0, 0.0
    one, two = POLYGONS
    for side_face in range(6):
        above = True
        for vertex in range(4):
            corner = CORNERS + 3 * _FACES[side_face, vertex]
            work[one + 3 * vertex] = work[corner]
            work[one + 3 * vertex + 1] = work[corner + 1]
            work[one + 3 * vertex + 2] = work[corner + 2]
            above = above and work[corner + 2] >= 0.0
        if above:
            continue
        # 2. Clip by w ≤ 0 and by the sides of the reference rectangle.
        count = _clip(work, one, 4, two, 2, 1.0, 0.0)
        count = _clip(work, two, count, one, 0, 1.0, hu - middle_u)
        count = _clip(work, one, count, two, 0, -1.0, hu + middle_u)
        count = _clip(work, two, count, one, 1, 1.0, hv - middle_v)
        count = _clip(work, one, count, two, 1, -1.0, hv + middle_v)
        # 3. and 4. Integrate.
        if through:
            d0, du, dv, dw = _lifted_moments(work, two, count, one, -2.0 * hw)
        else:
            d0, du, dv, dw = _moments(work, two, count)
        volume += d0
        gross += abs(d0)
        mu += du
        mv += dv
        mw += dw

    # The sign of the volume is that of the frame's handedness (`side`), and cancels in the ratio.
    if volume != 0.0:
        pu = middle_u + min(max(mu / volume, u_low - middle_u), u_high - middle_u)
        pv = middle_v + min(max(mv / volume, v_low - middle_v), v_high - middle_v)
        pw = min(max(mw / volume, max(lowest, -2.0 * hw)), 0.0)
    else:  # boxes thinner than the rounding of their sizes
        pu, pv, pw = middle_u, middle_v, 0.5 * max(lowest, -2.0 * hw)
    pw = side * (pw + hw)

    # From (u, v, w) to x, y, z of the reference box, and on to A.
    x = pu if a == 0 else (pv if b == 0 else pw)
    y = pu if a == 1 else (pv if b == 1 else pw)
    z = pu if a == 2 else (pv if b == 2 else pw)
    kept = abs(volume) / gross if gross > 0.0 else 0.0
    if of_a:
        return x, y, z, kept
    return (work[OFFSET_A + i]
            + (work[ROTATION + i] * x + work[ROTATION + LANES + i] * y
               + work[ROTATION + 2 * LANES + i] * z),
            work[OFFSET_A + LANES + i]
            + (work[ROTATION + 3 * LANES + i] * x + work[ROTATION + 4 * LANES + i] * y
               + work[ROTATION + 5 * LANES + i] * z),
            work[OFFSET_A + 2 * LANES + i]
            + (work[ROTATION + 6 * LANES + i] * x + work[ROTATION + 7 * LANES + i] * y
               + work[ROTATION + 8 * LANES + i] * z),
            kept)

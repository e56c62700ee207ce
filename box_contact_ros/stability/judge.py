"""A judge of contacts that shares no code with the solver: corners projected on 15 axes.

`judge` does it in float64, by its own quaternions, corners and axes. Whatever is within its own
rounding of a threshold, and whatever looks wrong, is settled by `exact_gap`, which does the same in
60 digits. So a gate that is reported broken is broken.

Any direction gives a valid bound, whatever rounding did to it: the gap between the projections of
the sixteen corners on it. Boxes are apart if it is positive in one of them, and the depth is the
least overlap over all directions; the separating-axis theorem says that the fifteen suffice. What
rounding may cost `judge` is the best direction, where edges are almost parallel.
"""
from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np

TOLERANCE = 1e-12
"""What separations and depths have to keep, of the size."""
COORDINATE_ULPS = 8.0
"""And far from the origin, of the coordinates' last place: poses are known no better."""
DOUBT = 1e-14
"""Gap, of the size, up to which its sign is not known in float64."""
PRESSED = 3e-9
"""Contacts shallower than a third of this, of the size, have the point of boxes pressed in: by so
much at corners, along three axes."""
INSIDE = 2.0**-43
"""How far outside a box a point may be, of the size and the coordinates: roundings."""
TINY = 1e-140
"""Least length of a cross product that is made a unit vector; its square must not underflow."""

MISSED, PHANTOM, TOO_DEEP, TOO_SHALLOW, WRONG_AXIS, NOT_UNIT, OUTSIDE, NOT_FINITE = (
    1 << k for k in range(8))
GATES = {MISSED: 'missed contact', PHANTOM: 'phantom contact', TOO_DEEP: 'too deep',
         TOO_SHALLOW: 'too shallow', WRONG_AXIS: 'wrong axis', NOT_UNIT: 'normal not unit',
         OUTSIDE: 'point outside', NOT_FINITE: 'NaN'}
"""Faults by bit; `judge` returns sums of them."""


class Verdict(NamedTuple):
    """What `judge` found for n pairs."""

    faults: np.ndarray
    """(n,) sums of GATES' keys; of doubtful pairs only once they are settled."""
    doubtful: np.ndarray
    """(n,) whether float64 is not enough."""
    depth_error: np.ndarray
    """(n,) |depth − true depth| by its tolerance, NaN where the solver says apart."""
    tolerance: np.ndarray
    """(n,) of depths [m]."""
    along: np.ndarray
    """(n,) gap along the solver's normal [m], NaN where it says apart."""

    def settle(self, row: int, gap: float, found: tuple[np.ndarray, ...], touch: float) -> None:
        """Judge a doubtful pair by its exact gap; gaps to `touch` [m] count as contact.

        Between twice that and zero, rounding decides, and either verdict is right.
        """
        said, separation = found[0][row], found[1][row]
        faults = self.faults[row] & ~(MISSED | PHANTOM | TOO_DEEP | TOO_SHALLOW | WRONG_AXIS)
        if said and gap > 2.0 * touch:
            faults |= PHANTOM
        if not said and gap < -2.0 * touch:
            faults |= MISSED
        if said:
            tolerance = self.tolerance[row]
            self.depth_error[row] = abs(separation - gap) / tolerance
            faults |= TOO_DEEP if separation < gap - tolerance else 0
            faults |= TOO_SHALLOW if separation > gap + tolerance else 0
            faults |= WRONG_AXIS if self.along[row] < gap - tolerance else 0
        self.faults[row] = faults


@numba.njit(cache=True)
def _matrix(q, m):
    x, y, z, w = q
    n = 2.0 / (x * x + y * y + z * z + w * w)
    m[0, 0] = 1.0 - n * (y * y + z * z)
    m[0, 1] = n * (x * y - z * w)
    m[0, 2] = n * (x * z + y * w)
    m[1, 0] = n * (x * y + z * w)
    m[1, 1] = 1.0 - n * (x * x + z * z)
    m[1, 2] = n * (y * z - x * w)
    m[2, 0] = n * (x * z - y * w)
    m[2, 1] = n * (y * z + x * w)
    m[2, 2] = 1.0 - n * (x * x + y * y)


@numba.njit(cache=True)
def _corners(m, size, shift, corners):
    for k in range(8):
        for r in range(3):
            total = shift[r]
            for c in range(3):
                total += m[r, c] * (0.5 * size[c] if k >> c & 1 else -0.5 * size[c])
            corners[k, r] = total


@numba.njit(cache=True)
def _gap(axis, corners_a, corners_b):
    """Gap between the projections on ± a unit axis, whichever is larger."""
    low_a = low_b = np.inf
    high_a = high_b = -np.inf
    for k in range(8):
        a = axis[0] * corners_a[k, 0] + axis[1] * corners_a[k, 1] + axis[2] * corners_a[k, 2]
        b = axis[0] * corners_b[k, 0] + axis[1] * corners_b[k, 1] + axis[2] * corners_b[k, 2]
        low_a, high_a = min(low_a, a), max(high_a, a)
        low_b, high_b = min(low_b, b), max(high_b, b)
    return max(low_b - high_a, low_a - high_b)


@numba.njit(cache=True)
def _along(axis, corners_a, corners_b):
    """Gap from A to B along a direction: how far B's least is beyond A's most."""
    low_b, high_a = np.inf, -np.inf
    for k in range(8):
        a = axis[0] * corners_a[k, 0] + axis[1] * corners_a[k, 1] + axis[2] * corners_a[k, 2]
        b = axis[0] * corners_b[k, 0] + axis[1] * corners_b[k, 1] + axis[2] * corners_b[k, 2]
        low_b, high_a = min(low_b, b), max(high_a, a)
    return low_b - high_a


@numba.njit(cache=True)
def _greatest_gap(ma, mb, corners_a, corners_b, axis):
    best = -np.inf
    for number in range(15):
        if number < 3:
            axis[:] = ma[:, number]
        elif number < 6:
            axis[:] = mb[:, number - 3]
        else:
            i, j = (number - 6) // 3, (number - 6) % 3
            axis[0] = ma[1, i] * mb[2, j] - ma[2, i] * mb[1, j]
            axis[1] = ma[2, i] * mb[0, j] - ma[0, i] * mb[2, j]
            axis[2] = ma[0, i] * mb[1, j] - ma[1, i] * mb[0, j]
        length = np.sqrt(axis[0]**2 + axis[1]**2 + axis[2]**2)
        if length > TINY:
            axis /= length
            best = max(best, _gap(axis, corners_a, corners_b))
    return best


@numba.njit(cache=True)
def _beyond(m, size, place, point):
    """By how much a point is outside a box."""
    most = -np.inf
    for c in range(3):
        along = 0.0
        for r in range(3):
            along += m[r, c] * (point[r] - place[r])
        most = max(most, abs(along) - 0.5 * size[c])
    return most


@numba.njit(cache=True)
def _judge(pose_a, pose_b, size_a, size_b, colliding, separation, normal, point, faults, doubtful,
           depth_error, tolerances, gaps_along):
    ma, mb = np.empty((3, 3)), np.empty((3, 3))
    corners_a, corners_b, axis = np.empty((8, 3)), np.empty((8, 3)), np.empty(3)
    offset = np.empty(3)
    origin = np.zeros(3)
    for row in range(len(pose_a)):
        a, b = pose_a[row], pose_b[row]
        size = max(size_a[row].max(), size_b[row].max())
        reach = 0.0
        for r in range(3):
            offset[r] = b[r] - a[r]
            reach = max(reach, abs(a[r]), abs(b[r]))
        _matrix(a[3:], ma)
        _matrix(b[3:], mb)
        _corners(ma, size_a[row], origin, corners_a)
        _corners(mb, size_b[row], offset, corners_b)
        tolerance = TOLERANCE * size + COORDINATE_ULPS * 2.2204460492503131e-16 * reach
        true = _greatest_gap(ma, mb, corners_a, corners_b, axis)
        found = 0
        said = colliding[row]
        tolerances[row] = tolerance
        # The offset is rounded once, corners and projections some ten times.
        unsure = abs(true) <= DOUBT * size
        if said and true > 0.0:
            found |= PHANTOM
        elif not said and true < 0.0:
            found |= MISSED
        if said:
            s, n, p = separation[row], normal[row], point[row]
            if not (np.isfinite(s) and np.isfinite(n).all() and np.isfinite(p).all()):
                found |= NOT_FINITE
            else:
                depth_error[row] = abs(s - true) / tolerance
                if s < true - tolerance:
                    found |= TOO_DEEP
                if s > true + tolerance:
                    found |= TOO_SHALLOW
                gaps_along[row] = _along(n, corners_a, corners_b)
                if gaps_along[row] < true - tolerance:
                    found |= WRONG_AXIS
                if abs(n[0]**2 + n[1]**2 + n[2]**2 - 1.0) > 1e-12:
                    found |= NOT_UNIT
                # The point of a shallow contact is that of boxes pressed in.
                slack = INSIDE * (size + reach)
                if s > -0.34 * PRESSED * size:
                    slack += PRESSED * size
                if (_beyond(ma, size_a[row], a, p) > slack
                        or _beyond(mb, size_b[row], b, p) > slack):
                    found |= OUTSIDE
        elif not separation[row] > 0.0:
            found |= NOT_FINITE
        faults[row] = found
        doubtful[row] = unsure or found & (MISSED | PHANTOM | TOO_DEEP | TOO_SHALLOW | WRONG_AXIS)


def judge(pose_a: np.ndarray, pose_b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
          found: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]) -> Verdict:
    """Judge answers for poses (n, 7) and full extents (n, 3).

    found: colliding (n,), separation (n,) [m], normal (n, 3), point (n, 3), as a solver's batch.
    """
    n = len(pose_a)
    verdict = Verdict(np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.bool_),
                      np.full(n, np.nan), np.empty(n), np.full(n, np.nan))
    arrays = [np.ascontiguousarray(part) for part in (pose_a, pose_b, size_a, size_b, *found)]
    _judge(*arrays, *verdict)
    return verdict


def exact_gap(pose_a: np.ndarray, pose_b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
              ) -> float:
    """The largest gap over the fifteen axes, in 60 digits, rounded once; one pair."""
    from mpmath import mp, mpf

    with mp.workdps(60):
        boxes = []
        for pose, size in ((pose_a, size_a), (pose_b, size_b)):
            x, y, z, w = (mpf(float(v)) for v in pose[3:])
            n = 2 / (x * x + y * y + z * z + w * w)
            axes = [(1 - n * (y * y + z * z), n * (x * y + z * w), n * (x * z - y * w)),
                    (n * (x * y - z * w), 1 - n * (x * x + z * z), n * (y * z + x * w)),
                    (n * (x * z + y * w), n * (y * z - x * w), 1 - n * (x * x + y * y))]
            half = [mpf(float(v)) / 2 for v in size]
            centre = [mpf(float(v)) for v in pose[:3]]
            boxes.append((axes, [tuple(
                centre[r] + sum((1 if k >> c & 1 else -1) * half[c] * axes[c][r]
                                for c in range(3)) for r in range(3)) for k in range(8)]))
        (axes_a, corners_a), (axes_b, corners_b) = boxes
        crosses = [(u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                    u[0] * v[1] - u[1] * v[0]) for u in axes_a for v in axes_b]
        best = None
        for axis in (*axes_a, *axes_b, *crosses):
            length = mp.sqrt(sum(v * v for v in axis))
            if length < mpf(10)**-40:
                continue
            low_a, high_a, low_b, high_b = (
                choose(sum(p * q for p, q in zip(axis, corner)) for corner in corners) / length
                for corners in (corners_a, corners_b) for choose in (min, max))
            gap = max(low_b - high_a, low_a - high_b)
            best = gap if best is None or gap > best else best
        return float(best)

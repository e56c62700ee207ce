# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A judge of contacts that shares no code with the core: corners projected on 15 axes.

`judge` does it in float64, by its own quaternions, corners and axes. Whatever is within its own
rounding of a threshold, and whatever looks wrong, is settled by `exact_gap`, which does the same in
60 digits. So a gate that is reported broken is broken.

Any direction gives a valid bound, whatever rounding did to it: the gap between the projections of
the sixteen corners on it. Boxes are apart if the gap is positive in one direction. The depth is the
least overlap over all directions. The separating-axis theorem proves that the fifteen suffice. What
rounding may cost `judge` is the best direction, where edges are almost parallel.
"""
from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from box_contact_ros.solver.contact import Contacts

TOLERANCE = 1e-12  # what separations and depths have to keep, of the size
COORDINATE_ULPS = 8.0
"""And far from the origin, of the coordinates' last place: poses are known no better."""
TOUCH_ULPS = 8.0
"""Largest gap that is a touch, in units in the last place of the largest coordinate or size. The
judge has to know this convention of the package."""
DOUBT = 1e-14  # gap, of the size, up to which its sign is not known in float64
PRESSED = 3e-9
"""How far a corner moves, of the size, when boxes are pressed in along three axes. Contacts
shallower than a third of this have the point of boxes pressed in."""
INSIDE = 2.0**-43
"""How far outside a box a point may be, of the size and the coordinates: roundings."""
AXES = 15  # normals of A's faces, of B's, and cross products of their edges
TINY = 1e-140
"""Least length of a cross product that is made a unit vector; its square must not underflow."""
FAR_BEHIND, MOSTLY_ROUNDING = 1e-9, 1e-6
"""An axis is not taken in 60 digits if its gap in float64 is less than the greatest by this share
of the size. Its edges must cross at a larger sine than the second, or its direction is noise."""

(MISSED, PHANTOM, TOO_DEEP, TOO_SHALLOW, WRONG_AXIS, NOT_UNIT, OUTSIDE, NOT_FINITE, NEGATIVE,
 OUT_OF_BOUNDS) = (1 << k for k in range(10))
GATES = {MISSED: 'missed contact', PHANTOM: 'phantom contact', TOO_DEEP: 'too deep',
         TOO_SHALLOW: 'too shallow', WRONG_AXIS: 'wrong axis', NOT_UNIT: 'normal not unit',
         OUTSIDE: 'point outside', NOT_FINITE: 'NaN', NEGATIVE: 'negative eigenvalue',
         OUT_OF_BOUNDS: 'outside the bounds of the overlap'}
"""Faults by bit. `judge` returns sums of them; the last two are those of `fuzz`."""
BY_GAP = MISSED | PHANTOM | TOO_DEEP | TOO_SHALLOW | WRONG_AXIS  # what the true gap decides
PIECE = 2048  # pairs that are judged at a time: their corners fit a processor's caches
_SIGNS = np.array([[0.5 if k >> c & 1 else -0.5 for c in range(3)] for k in range(8)])
"""(8, 3) corners of a box of edge 1."""


class Verdict(NamedTuple):
    """What `judge` found for n pairs."""

    faults: np.ndarray  # (n,) sums of GATES' keys; of doubtful pairs only once they are settled
    doubtful: np.ndarray  # (n,) whether float64 is not enough
    depth_error: np.ndarray
    """(n,) |depth − true depth| by its tolerance, NaN where the solver says apart."""
    tolerance: np.ndarray  # (n,) of depths [m]
    unsure: np.ndarray  # (n,) gap or depth up to which either verdict is right [m]
    along: np.ndarray  # (n,) gap along the solver's normal [m], NaN where it says apart

    def settle(self, found: Contacts, gap_of: Callable[[int], float]) -> None:
        """Judge the doubtful pairs by their exact gaps; gap_of: returns the one of a row [m]."""
        rows = np.flatnonzero(self.doubtful)
        gap = np.array([gap_of(row) for row in rows], dtype=np.float64)
        colliding, separation = found.colliding[rows], found.separation[rows]
        tolerance = self.tolerance[rows]
        self.depth_error[rows] = np.where(colliding, np.abs(separation - gap) / tolerance, np.nan)
        self.faults[rows] = self.faults[rows] & ~BY_GAP | _faults_by_gap(
            colliding, separation, self.along[rows], gap, tolerance, self.unsure[rows])


def rounding(pose_a: np.ndarray, pose_b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
             ) -> np.ndarray:
    """Return what separations and depths may be off (n,) [m]; poses (n, 7), extents (n, 3)."""
    reach = np.abs(np.hstack([pose_a[:, :3], pose_b[:, :3]])).max(axis=1)
    size = np.maximum(size_a, size_b).max(axis=1)
    return TOLERANCE * size + COORDINATE_ULPS * 2.0**-52 * reach


def two_touches(pose_a: np.ndarray, pose_b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
                ) -> np.ndarray:
    """Return the gap or depth (n,) [m] up to which rounding decides, and either verdict is right.

    Poses (n, 7), extents (n, 3).
    """
    lengths = np.abs(np.hstack([pose_a[:, :3], pose_b[:, :3], size_a, size_b]))
    return 2.0 * TOUCH_ULPS * np.spacing(lengths.max(axis=1))


def judge(pose_a: np.ndarray, pose_b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
          found: Contacts, *, inside: float = INSIDE) -> Verdict:
    """Judge answers for poses (n, 7) and full extents (n, 3).

    inside: how far outside a box a point may be, of the size and the coordinates.
    """
    arrays = [np.asarray(part) for part in (
        pose_a, pose_b, size_a, size_b, found.colliding, found.separation, found.normal,
        found.point)]
    pieces = [_judge(*(part[start:start + PIECE] for part in arrays), inside)
              for start in range(0, max(1, len(pose_a)), PIECE)]
    return Verdict(*(np.concatenate(parts) for parts in zip(*pieces)))


def _judge(pose_a: np.ndarray, pose_b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
           colliding: np.ndarray, separation: np.ndarray, normal: np.ndarray, point: np.ndarray,
           inside: float) -> Verdict:
    """Judge one piece."""
    size = np.maximum(size_a, size_b).max(axis=1)
    reach = np.abs(np.hstack([pose_a[:, :3], pose_b[:, :3]])).max(axis=1)
    tolerance = rounding(pose_a, pose_b, size_a, size_b)
    # From here on vectors are (3, n): loops are over components.
    axes, corners = _axes_and_corners(pose_a.T, pose_b.T, size_a.T, size_b.T)
    true = np.max([_gap_both_ways(_axis(*axes, number), *corners)[0]
                   for number in range(AXES)], axis=0)
    with np.errstate(invalid='ignore'):  # NaN is what some of the answers are
        along = _gap_along(normal.T, *corners)
        # The point of a shallow contact is that of boxes pressed in.
        slack = (inside * (size + reach)
                 + np.where(separation > -0.34 * PRESSED * size, PRESSED * size, 0.0))
        beyond = np.maximum(_beyond(axes[0], size_a.T, (point - pose_a[:, :3]).T),
                            _beyond(axes[1], size_b.T, (point - pose_b[:, :3]).T))
        finite = (np.isfinite(separation) & np.isfinite(normal).all(axis=1)
                  & np.isfinite(point).all(axis=1))
        sound = colliding & finite
        separation_known, along = (np.where(sound, part, np.nan) for part in (separation, along))
        by_gap = _faults_by_gap(colliding, separation_known, along, true, tolerance, 0.0)
        faults = by_gap + sum(np.where(rows, bit, 0) for bit, rows in (
            (NOT_FINITE, np.where(colliding, ~finite, ~(separation > 0.0))),
            (NOT_UNIT, sound & (np.abs((normal**2).sum(axis=1) - 1.0) > 1e-12)),
            (OUTSIDE, sound & (beyond > slack))))
        depth_error = np.abs(separation_known - true) / tolerance
    # The offset is rounded once, corners and projections some ten times.
    doubtful = (np.abs(true) <= DOUBT * size) | (by_gap > 0)
    return Verdict(faults, doubtful, depth_error, tolerance,
                   two_touches(pose_a, pose_b, size_a, size_b), along)


def _faults_by_gap(colliding: np.ndarray, separation: np.ndarray, along: np.ndarray,
                   gap: np.ndarray, tolerance: np.ndarray, unsure: np.ndarray | float,
                   ) -> np.ndarray:
    """Return sums (n,) of the faults that the true gaps decide; NaN breaks none of them."""
    return np.asarray(sum(np.where(rows, bit, 0) for bit, rows in (
        (PHANTOM, colliding & (gap > unsure)),
        (MISSED, ~colliding & (gap < -unsure)),
        (TOO_DEEP, colliding & (separation < gap - tolerance)),
        (TOO_SHALLOW, colliding & (separation > gap + tolerance)),
        (WRONG_AXIS, colliding & (along < gap - tolerance)))))


def _axes(quaternions: np.ndarray) -> np.ndarray:
    """Return a box's axes (axis 3, component 3, n) for quaternions xyzw (4, n) of any length."""
    x, y, z, w = quaternions
    n = 2.0 / (x * x + y * y + z * z + w * w)
    return np.array([[1.0 - n * (y * y + z * z), n * (x * y + z * w), n * (x * z - y * w)],
                     [n * (x * y - z * w), 1.0 - n * (x * x + z * z), n * (y * z + x * w)],
                     [n * (x * z + y * w), n * (y * z - x * w), 1.0 - n * (x * x + y * y)]])


def _corners(axes: np.ndarray, size: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """Return the corners (component 3, corner 8, n) of a box of extents (3, n)."""
    steps = axes * size[:, None]
    corners = np.repeat(centre[:, None], 8, axis=1)
    for c in range(3):
        corners += steps[c][:, None] * _SIGNS[:, c, None]
    return corners


def _gap_along(axis: np.ndarray, corners_a: np.ndarray, corners_b: np.ndarray) -> np.ndarray:
    """Return gaps (n,) from A to B along axes (3, n): B's least projection minus A's greatest."""
    return _dot(axis, corners_b).min(axis=0) - _dot(axis, corners_a).max(axis=0)


def _axis(axes_a: np.ndarray, axes_b: np.ndarray, number: int) -> np.ndarray:
    """Return one of the fifteen axes (3, n); a cross product is as long as the sine."""
    if number < 6:
        return np.asarray((axes_a, axes_b)[number // 3][number % 3])
    u, v = axes_a[(number - 6) // 3], axes_b[number % 3]
    return np.array([u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                     u[0] * v[1] - u[1] * v[0]])


def _gap_both_ways(axis: np.ndarray, corners_a: np.ndarray, corners_b: np.ndarray,
                   ) -> tuple[np.ndarray, np.ndarray]:
    """Return the gaps (n,) along axes (3, n), the greater of both directions, and their lengths.

    The gap of an axis that is too short is −inf.
    """
    length = np.sqrt((axis**2).sum(axis=0))
    usable = length > TINY
    unit = axis / np.where(usable, length, 1.0)
    a, b = _dot(unit, corners_a), _dot(unit, corners_b)
    gap = np.maximum(b.min(axis=0) - a.max(axis=0), a.min(axis=0) - b.max(axis=0))
    return np.where(usable, gap, -np.inf), length


def _beyond(axes: np.ndarray, size: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Return by how much (n,) points are outside a box; offset (3, n) is from its centre."""
    along = [np.abs(_dot(axis, offset)) for axis in axes]
    return np.max(np.array(along) - 0.5 * size, axis=0)


def _dot(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the scalar products of vectors whose components stand first."""
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]


def exact_gap(pose_a: np.ndarray, pose_b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
              ) -> float:
    """Return the largest gap of a pair over the fifteen axes, in 60 digits, rounded once."""
    from mpmath import mp, mpf

    pair = [np.asarray(part, dtype=np.float64)[:, None]
            for part in (pose_a, pose_b, size_a, size_b)]
    axes, corners = _axes_and_corners(*pair)
    rough = [_gap_both_ways(_axis(*axes, number), *corners) for number in range(AXES)]
    reach, size = max(np.abs(part[:3]).max() for part in pair), max(pair[2].max(), pair[3].max())
    least = max(gap[0] for gap, _ in rough) - FAR_BEHIND * size - 16.0 * np.spacing(reach)
    needed = [number for number, (gap, length) in enumerate(rough)
              if gap[0] >= least or length[0] < MOSTLY_ROUNDING]
    with mp.workdps(60):
        in_digits = np.frompyfunc(lambda value: mpf(float(value)), 1, 1)
        axes, corners = _axes_and_corners(*map(in_digits, pair))
        return float(max(_gap_both_ways(_axis(*axes, number), *corners)[0][0]
                         for number in needed))


Both = tuple[np.ndarray, np.ndarray]


def _axes_and_corners(pose_a: np.ndarray, pose_b: np.ndarray, size_a: np.ndarray,
                      size_b: np.ndarray) -> tuple[Both, Both]:
    """Return axes and corners of A and of B, for poses (7, n) and extents (3, n).

    The origin of the corners is A's centre.
    """
    axes, offset = (_axes(pose_a[3:]), _axes(pose_b[3:])), pose_b[:3] - pose_a[:3]
    return axes, (_corners(axes[0], size_a, 0 * offset), _corners(axes[1], size_b, offset))

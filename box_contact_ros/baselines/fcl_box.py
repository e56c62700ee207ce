"""Model `fcl`: FCL's own box-box primitive, and of its contacts the deepest, as engines give it.

Where two faces meet, FCL returns up to four corners of the patch with a depth each. The deepest
changes with the smallest tilt, so the point jumps across the patch.

FCL gives point, normal and depth of boxes in contact; everything else is SAT's. Within the rounding
of an exact touch FCL may find no contact, and the exact answer stands. FCL's normal of (o1, o2)
points from o1 to o2, from A to B; a test checks that in both orders.
"""
from __future__ import annotations

import functools

import fcl
import numpy as np

from ..solver.contact import Contacts
from ..solver.models import Exact

MOST_CONTACTS = 16
"""FCL's box-box makes at most eight contacts (two rectangles cut each other in an octagon)."""


class FclBox:
    """FCL's box-box collide, deepest contact; any sizes."""

    def __init__(self) -> None:
        self._exact = Exact()
        self._request = fcl.CollisionRequest(num_max_contacts=MOST_CONTACTS, enable_contact=True)

    def solve(self, a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
              threads: int = 1) -> tuple[Contacts, int]:
        """Return contacts for poses (n, 7), sizes (n or 1, 3), and the first refused row or −1."""
        found, refused = self._exact.solve(a, b, size_a, size_b, threads)
        for row in np.flatnonzero(found.colliding) if refused < 0 else ():
            # B − A is formed in float64 here, so that FCL adds no rounding far from the origin.
            first = _place(size_a[row % len(size_a)], np.zeros(3), a[row, 3:])
            second = _place(size_b[row % len(size_b)], b[row, :3] - a[row, :3], b[row, 3:])
            result = fcl.CollisionResult()
            fcl.collide(first, second, self._request, result)
            if not result.contacts:
                continue
            deepest = max(result.contacts, key=lambda contact: contact.penetration_depth)
            found.separation[row] = -deepest.penetration_depth
            found.normal[row] = deepest.normal
            found.point[row] = a[row, :3] + deepest.pos
        return found, refused


def _place(size: np.ndarray, position: np.ndarray, quaternion: np.ndarray) -> fcl.CollisionObject:
    """A box of full extents (3,) [m] at a position (3,) [m], quaternion (4,) xyzw of any length."""
    x, y, z, w = quaternion / np.linalg.norm(quaternion)
    return fcl.CollisionObject(_box(*size), fcl.Transform(np.array([w, x, y, z]), position))


@functools.lru_cache(maxsize=64)  # a scene has few sizes
def _box(length: float, width: float, height: float) -> fcl.Box:
    return fcl.Box(length, width, height)

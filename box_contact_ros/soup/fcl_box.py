# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Model `fcl`: FCL's own box-box primitive, and of its contacts the deepest, as engines give it.

Where two faces meet, FCL returns up to four corners of the patch with a depth each. The deepest
changes with the smallest tilt, so the point jumps across the patch.

FCL gives point, normal and depth of boxes in contact; everything else is SAT's. Within the rounding
of an exact touch FCL may find no contact, and the exact answer stands. FCL's normal of (o1, o2)
points from o1 to o2, from A to B; a test checks that in both orders.
"""
from __future__ import annotations

import functools
from collections.abc import Callable

import fcl
import numpy as np

from box_contact_ros.solver.contact import Contacts, without_patch
from box_contact_ros.solver.models import Exact

Size = tuple[float, ...]  # three full extents [m], as a key of what is kept

KEPT_SIZES = 64  # of which a solver keeps what it has made; a scene has few
MOST_CONTACTS = 16
"""FCL's box-box makes at most eight contacts (two rectangles cut each other in an octagon)."""


class FclModel:
    """A model that asks FCL about the pairs in contact; `exact` answers where FCL does not.

    make: returns FCL's object of a box of a size.
    """

    def __init__(self, make: Callable[[Size], fcl.CollisionObject]) -> None:
        self._exact = Exact()
        # Each solver keeps objects of its own, one for A and one for B: placing moves them.
        self._object = functools.lru_cache(maxsize=KEPT_SIZES)(lambda size, box: make(size))

    def place(self, a: np.ndarray, b: np.ndarray, size_a: Size, size_b: Size,
              ) -> tuple[fcl.CollisionObject, fcl.CollisionObject]:
        """Return objects of these sizes at poses (7,), about A's centre; until the next call.

        Directions are the common frame's. B − A is formed in float64 here, so that FCL adds no
        rounding far from the origin.
        """
        first, second = self._object(size_a, 0), self._object(size_b, 1)
        for placed, position, quaternion in ((first, np.zeros(3), a[3:]),
                                             (second, b[:3] - a[:3], b[3:])):
            x, y, z, w = quaternion / np.linalg.norm(quaternion)
            placed.setTransform(fcl.Transform(np.array([w, x, y, z]), position))
        return first, second

    def solve(self, a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
              threads: int = 1) -> tuple[Contacts, int]:
        """Return contacts for poses (n, 7), sizes (n or 1, 3), and the first refused row or −1."""
        exact, refused = self._exact.solve(a, b, size_a, size_b, threads)
        found = without_patch(*exact[:4])
        for row in np.flatnonzero(found.colliding) if refused < 0 else ():
            sizes = tuple(size_a[row % len(size_a)]), tuple(size_b[row % len(size_b)])
            answer = self.ask(*self.place(a[row], b[row], *sizes), *sizes)
            if answer is not None:
                point, found.normal[row], depth = answer
                found.point[row] = a[row, :3] + point
                if depth is not None:
                    found.separation[row] = -depth
        return found, refused

    def ask(self, first: fcl.CollisionObject, second: fcl.CollisionObject, size_a: Size,
            size_b: Size) -> tuple[np.ndarray, np.ndarray, float | None] | None:
        """Return point (3,) from A's centre, normal (3,), and the depth or None for SAT's.

        None: FCL has no answer.
        """
        raise NotImplementedError


class FclBox(FclModel):
    """FCL's box-box collide, deepest contact; any sizes."""

    def __init__(self) -> None:
        super().__init__(lambda size: fcl.CollisionObject(fcl.Box(*size)))
        self._request = fcl.CollisionRequest(num_max_contacts=MOST_CONTACTS, enable_contact=True)

    def ask(self, first: fcl.CollisionObject, second: fcl.CollisionObject, size_a: Size,
            size_b: Size) -> tuple[np.ndarray, np.ndarray, float | None] | None:
        """Return the deepest of FCL's contacts, with its depth."""
        result = fcl.CollisionResult()
        fcl.collide(first, second, self._request, result)
        if not result.contacts:
            return None
        deepest = max(result.contacts, key=lambda contact: contact.penetration_depth)
        return deepest.pos, deepest.normal, deepest.penetration_depth

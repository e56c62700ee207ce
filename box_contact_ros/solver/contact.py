# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a solver returns: one contact, or the contacts of many pairs as arrays."""
from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from ..core import native


class Contact(NamedTuple):
    """The contact of one pair of boxes; frame: that of the poses."""

    colliding: bool
    """True from exact touch on: separation ≤ 8 ulp of the largest coordinate or size."""
    separation: float
    """Signed [m]: negative is the overlap depth, positive the largest gap on a SAT axis."""
    normal: np.ndarray
    """(3,) unit vector from A to B; NaN where the separation exceeds the solver's margin."""
    point: np.ndarray
    """(3,) centroid of A∩B [m]; NaN without contact."""
    volume: float
    """Volume of A∩B [m³]; 0 without contact; NaN from models that give the point alone."""
    covariance: np.ndarray
    """(3, 3) second central moments of A∩B divided by its volume [m²]; NaN where volume is
    NaN, and without contact.

    Volume and covariance are those of the overlap whose centroid is `point`, pressed in or not.
    """
    axis: int = -1
    """The winning axis, also of pairs apart; −1 from models that do not tell it.

    0 to 2 faces of A, 3 to 5 faces of B, 6 + 3·i + j the edges i of A and j of B.
    """


def patch_area(contact: Contact) -> float:
    """Return the area of a contact's patch [m²]: 12·√(e₁·e₂), NaN where there is no covariance.

    e₁ and e₂ are the eigenvalues of the covariance across the normal. Their product is
    n·adj(C)·n. The area is exact where the overlap is a cuboid along the normal.
    """
    xx, xy, xz, _, yy, yz, _, _, zz = contact.covariance.ravel().tolist()
    x, y, z = contact.normal.tolist()
    product = (x * x * (yy * zz - yz * yz) + y * y * (xx * zz - xz * xz)
               + z * z * (xx * yy - xy * xy) + 2.0 * (
                   x * y * (xz * yz - xy * zz) + x * z * (xy * yz - xz * yy)
                   + y * z * (xy * xz - xx * yz)))
    return 12.0 * math.sqrt(max(product, 0.0))  # rounding may leave a line's product below zero


class Contacts(NamedTuple):
    """The contacts of n pairs: the fields of `Contact` as arrays."""

    colliding: np.ndarray
    """(n,) bool."""
    separation: np.ndarray
    """(n,) [m]."""
    normal: np.ndarray
    """(n, 3)."""
    point: np.ndarray
    """(n, 3) [m]."""
    volume: np.ndarray
    """(n,) [m³]."""
    covariance: np.ndarray
    """(n, 3, 3) [m²]."""
    axis: np.ndarray
    """(n,) int32."""

    @classmethod
    def of(cls, contacts: Iterable[Contact]) -> Contacts:
        """Return the rows of single contacts."""
        columns = list(zip(*contacts)) or [()] * len(cls._fields)
        shapes = ((), (), (3,), (3,), (), (3, 3), ())
        return cls(*(np.array(column).reshape(-1, *shape)
                     for column, shape in zip(columns, shapes)))

    def row(self, number: int) -> Contact:
        """Return the contact of one pair."""
        return Contact(bool(self.colliding[number]), float(self.separation[number]),
                       self.normal[number], self.point[number], float(self.volume[number]),
                       self.covariance[number], int(self.axis[number]))


def without_patch(colliding: np.ndarray, separation: np.ndarray, normal: np.ndarray,
                  point: np.ndarray) -> Contacts:
    """Return contacts of a model that gives the point alone: arrays with a row a pair.

    Volume and covariance of those in contact are NaN, as of the core with `patch=False`.
    """
    return Contacts(colliding, separation, normal, point, np.where(colliding, np.nan, 0.0),
                    np.full((len(colliding), 3, 3), np.nan),
                    np.full(len(colliding), -1, dtype=np.int32))


native.use_contact_types(Contact, Contacts)

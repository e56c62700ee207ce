# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a solver returns: one contact, or the contacts of many pairs as arrays."""
from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..core import native
from .checks import short_repr

Contact = native.Contact


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
    def of(cls, contacts: Sequence[Contact]) -> Contacts:
        """Return single contacts as arrays."""
        for number, contact in enumerate(contacts):
            if not isinstance(contact, Contact):
                raise ValueError(f'contacts[{number}] must be a Contact, not {short_repr(contact)}')

        def column(name: str, kind: type, *shape: int) -> np.ndarray:
            values = [getattr(contact, name) for contact in contacts]
            return np.array(values, kind).reshape(len(values), *shape)

        return cls(column('colliding', bool), column('separation', float),
                   column('normal', float, 3), column('point', float, 3),
                   column('volume', float), column('covariance', float, 3, 3),
                   column('axis', np.int32))

    def row(self, number: int) -> Contact:
        """Return the contact of one pair."""
        return Contact(bool(self.colliding[number]), float(self.separation[number]),
                       self.normal[number], self.point[number], float(self.volume[number]),
                       self.covariance[number], int(self.axis[number]))


def patch_areas(contacts: Contacts) -> np.ndarray:
    """Return the areas (n,) of contacts' patches [m²]: 12·√(e₁·e₂), NaN without a covariance.

    e₁ and e₂ are the eigenvalues of the covariance across the normal. The area is exact where the
    overlap is a cuboid along the normal.
    """
    return native.patch_areas(contacts.normal, contacts.covariance)


def patch_area(contact: Contact) -> float:
    """Return the area of one contact's patch [m²], as `patch_areas` does."""
    areas = native.patch_areas(contact.normal[None], contact.covariance[None])
    return float(areas[0])


def without_patch(colliding: np.ndarray, separation: np.ndarray, normal: np.ndarray,
                  point: np.ndarray) -> Contacts:
    """Return contacts of a model that gives the point alone: arrays with a row a pair.

    Volume and covariance of those in contact are NaN, as of the core with `patch=False`.
    """
    return Contacts(colliding, separation, normal, point, np.where(colliding, np.nan, 0.0),
                    np.full((len(colliding), 3, 3), np.nan),
                    np.full(len(colliding), -1, dtype=np.int32))


native.use_contacts(Contacts)

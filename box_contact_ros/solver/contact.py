# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a solver returns: one contact, or the contacts of many pairs as arrays."""
from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace

import numpy as np

from ..core import native
from .checks import short_repr
from .rows import Rows

Contact = native.Contact


@dataclass(frozen=True, slots=True, eq=False)
class Contacts(Rows[Contact]):
    """The contacts of n pairs: a sequence of `Contact`, and the fields of all as arrays.

    `contacts[3]` is a Contact. A slice, a mask (n,) or numbers of rows give Contacts.
    """

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

    @property
    def depth(self) -> np.ndarray:
        """(n,) how deep the boxes overlap along the normal [m]; 0 of boxes apart."""
        return np.maximum(0.0, -self.separation)

    _instead = '.colliding, .colliding.any() or len()'

    @classmethod
    def of(cls, contacts: Iterable[Contact]) -> Contacts:
        """Return single contacts as arrays."""
        rows = list(contacts)
        for number, contact in enumerate(rows):
            if not isinstance(contact, Contact):
                raise ValueError(f'contacts[{number}] must be a Contact, not {short_repr(contact)}')

        def column(name: str, kind: type, *shape: int) -> np.ndarray:
            values = [getattr(contact, name) for contact in rows]
            return np.array(values, kind).reshape(len(rows), *shape)

        return cls(column('colliding', bool), column('separation', float),
                   column('normal', float, 3), column('point', float, 3),
                   column('volume', float), column('covariance', float, 3, 3),
                   column('axis', np.int32))

    def _one(self, colliding: np.bool_, separation: np.float64, normal: np.ndarray,
             point: np.ndarray, volume: np.float64, covariance: np.ndarray, axis: np.int32,
             ) -> Contact:
        return Contact(bool(colliding), float(separation), normal, point, float(volume),
                       covariance, int(axis))


FIELDS = tuple(field.name for field in fields(Contacts))
"""Names of the fields of Contact and Contacts, in the order of their arguments."""


def without_patch(contacts: Contacts) -> Contacts:
    """Return contacts of which the point alone is known.

    Volume and covariance of those in contact are NaN, as of the core with `patch=False`.
    """
    return replace(contacts, volume=np.where(contacts.colliding, np.nan, 0.0),
                   covariance=np.full((len(contacts), 3, 3), np.nan))


native.use_contacts(Contacts)

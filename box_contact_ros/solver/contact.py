"""What a solver returns: one contact, or the contacts of many pairs as arrays."""
from __future__ import annotations

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
    """(3,) unit vector from A to B; NaN without contact."""
    point: np.ndarray
    """(3,) centroid of A∩B [m]; NaN without contact."""


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


native.use_contact_type(Contact)

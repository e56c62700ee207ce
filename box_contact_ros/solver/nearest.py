# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a solver returns of distances: the nearest points of one pair, or of many as arrays."""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..core import native
from .rows import Rows

Nearest = native.Nearest


@dataclass(frozen=True, slots=True, eq=False)
class Nearests(Rows[Nearest]):
    """The nearest points of n pairs: a sequence of `Nearest`, and the fields of all as arrays.

    `nearests[3]` is a Nearest. A slice, a mask (n,) or numbers of rows give Nearests.
    """

    colliding: np.ndarray
    """(n,) bool."""
    distance: np.ndarray
    """(n,) [m]."""
    normal: np.ndarray
    """(n, 3)."""
    point_a: np.ndarray
    """(n, 3) [m]."""
    point_b: np.ndarray
    """(n, 3) [m]."""

    _instead = '.colliding, .colliding.any() or len()'

    def _one(self, colliding: np.bool_, distance: np.float64, normal: np.ndarray,
             point_a: np.ndarray, point_b: np.ndarray) -> Nearest:
        return Nearest(bool(colliding), float(distance), normal, point_a, point_b)


native.use_nearests(Nearests)

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Box symmetries, which bring touching pairs into the domain of the paper's networks.

symmetry.hpp has the formulas and the ways into a domain: NO_FOLD, OCTANT, FEATURES.
"""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from . import _networks
from ._networks import EDGE_EDGE, FEATURES, NO_FOLD, OCTANT, VERTEX_FACE

__all__ = ['EDGE_EDGE', 'FEATURES', 'Folds', 'NO_FOLD', 'OCTANT', 'VERTEX_FACE', 'fold']


class Folds(NamedTuple):
    """n folded pairs: t' = M t, R' = M R Nᵀ."""

    map_first: np.ndarray  # (n, 3, 3) M, a signed permutation of the first box's axes
    map_second: np.ndarray  # (n, 3, 3) N, a signed permutation of the second box's axes
    offset: np.ndarray  # (n, 3) t' of the second box [m]
    rotation: np.ndarray  # (n, 3, 3) R', the second box's axes as columns
    angles: np.ndarray  # (n, 3) roll, pitch, yaw [rad] of R' = Rz(yaw) Ry(pitch) Rx(roll)
    subset: np.ndarray  # (n,) VERTEX_FACE or EDGE_EDGE after FEATURES, else −1

    def folded(self, vectors: np.ndarray) -> np.ndarray:
        """Return points or directions (n, 3) of the first box's frame, folded."""
        return np.einsum('nij,nj->ni', self.map_first, vectors)

    def unfolded(self, vectors: np.ndarray) -> np.ndarray:
        """Return folded points or directions (n, 3) in the first box's frame."""
        return np.einsum('nji,nj->ni', self.map_first, vectors)


def fold(to: int, offset: np.ndarray, rotation: np.ndarray, *, axis: np.ndarray,
         normal: np.ndarray) -> Folds:
    """Fold n pairs to NO_FOLD, OCTANT or FEATURES.

    offset (n, 3) [m] and rotation (n, 3, 3) of the second box, axis (n,) and normal (n, 3) of the
    separating-axis test: see `core.Stages`; frame: the first box's. FEATURES needs cubes, and
    raises ValueError where a face of the second box wins.
    """
    return Folds(*_networks.fold(to, offset, rotation, np.asarray(axis, dtype=np.int64), normal))

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of volumes and covariances, for the fuzz.

The point of model `mlp` is within the bounds of the overlap, and its volume is at most theirs.
These bounds are the patch box (core/src/mlp/patch_box.hpp).
"""
from __future__ import annotations

import numpy as np

from box_contact_ros.core import DEPTH_FLOOR, native
from box_contact_ros.solver.contact import Contacts

from .judge import NEGATIVE, NOT_FINITE, OUT_OF_BOUNDS
from .pose_sets import Pairs

SMOOTH = 2.0**-46
"""How far below zero an eigenvalue of `mlp` may be [of the trace]: roundings."""
EXACT = 1e-9
"""The same of `exact`, whose sums cancel; or SLIVER times size by depth, if that is more."""
SLIVER = 1e-15
OUTSIDE = 2.0**-43
"""How far a point may be outside the bounds, of the size and the coordinates: roundings."""


def patch_faults(pairs: Pairs, found: Contacts) -> np.ndarray:
    """Return sums (n,) of the faults of any model's patches; none where it gives no patch."""
    faults = np.zeros(len(found.colliding), dtype=np.int64)
    rows = np.flatnonzero(found.colliding)
    if not np.isfinite(found.volume[rows]).any():
        return faults
    finite = (np.isfinite(found.volume[rows])
              & np.isfinite(found.covariance[rows]).all(axis=(1, 2)))
    faults[rows[~finite]] = NOT_FINITE
    rows = rows[finite]
    slack = np.maximum(EXACT, SLIVER * _size_by_depth(pairs, found, rows))
    faults[rows[(_least(found, rows) < -slack) | (found.volume[rows] <= 0.0)]] = NEGATIVE
    return faults


def mlp_faults(pairs: Pairs, found: Contacts) -> np.ndarray:
    """Return sums (n,) of the faults of the patches of `mlp`."""
    rows = np.flatnonzero(found.colliding)
    axes, middle, half, *_ = native.mlp_inputs(*pairs.rows(rows))
    off = np.abs(np.einsum('nji,nj->ni', axes, found.point[rows] - middle))
    reach = pairs.size[rows] + np.abs(found.point[rows]).max(axis=1)
    within = np.all(off <= half + OUTSIDE * reach[:, None], axis=1)
    within &= found.volume[rows] <= (1.0 + OUTSIDE) * np.prod(2.0 * half, axis=1)
    faults = np.zeros(len(found.colliding), dtype=np.int64)
    faults[rows] = (np.where(within, 0, OUT_OF_BOUNDS)
                    | np.where(_least(found, rows) >= -SMOOTH, 0, NEGATIVE))
    return faults


def _size_by_depth(pairs: Pairs, found: Contacts, rows: np.ndarray) -> np.ndarray:
    return 1.0 / np.maximum(DEPTH_FLOOR, -found.separation[rows] / pairs.size[rows])


def _least(found: Contacts, rows: np.ndarray) -> np.ndarray:
    """Return the least eigenvalue of covariances [of their trace]."""
    covariance = found.covariance[rows]
    return np.linalg.eigvalsh(covariance)[:, 0] / np.trace(covariance, axis1=1, axis2=2)

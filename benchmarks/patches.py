# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Faults of volumes and covariances, for the fuzz.

Model `mlp` takes off the columns what upper faces cut off them, and knows that volume within
brackets (core/src/mlp/mlp_model.hpp). Its volume and the exact one have to be between them, and the
brackets close together. Pairs that it has left to `exact` have the volume of `exact`, to the bit.
"""
from __future__ import annotations

import numpy as np

from box_contact_ros.core import BRACKET_LIMIT, DEPTH_FLOOR, stages
from box_contact_ros.solver.contact import Contacts

from .judge import NEGATIVE, NOT_FINITE, OUT_OF_BRACKETS
from .pose_sets import Pairs

SMOOTH = 2.0**-46
"""How far below zero an eigenvalue of `mlp` may be [of the trace]: roundings."""
EXACT = 1e-9
"""The same of `exact`, whose sums cancel; or SLIVER times size by depth, if that is more."""
SLIVER = 1e-15
SINGLE, DOUBLE = 5e-4, 2.0**-39
"""How far beyond a bracket a volume may be [of itself]. The first is what float32 may cost: of 7.6
million contacts one was off by 3.6e-4, and no other by more than 2e-4. The second, times size by
depth, is what rounded poses cost slivers."""


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
    """Return sums (n,) of the faults of those patches that `mlp` has found itself."""
    truth = pairs.contacts()
    rows = np.flatnonzero(found.colliding & truth.colliding & (found.volume != truth.volume))
    of = stages(*pairs.rows(rows), names=(
        'true_volume', 'columns_volume', 'upper_volume', 'upper_least', 'upper_most'))
    least, most = (of.columns_volume - (of.upper_volume.astype(np.float64) * share).sum(axis=1)
                   for share in (of.upper_most, of.upper_least))
    volume = of.true_volume * (found.volume[rows] / truth.volume[rows])
    slack = (SINGLE + DOUBLE * _size_by_depth(pairs, found, rows)) * of.true_volume
    within = (np.minimum(volume, of.true_volume) >= least - slack) & (
        np.maximum(volume, of.true_volume) <= most + slack)
    close = most - least <= BRACKET_LIMIT * volume + slack
    faults = np.zeros(len(found.colliding), dtype=np.int64)
    faults[rows] = (np.where(within & close, 0, OUT_OF_BRACKETS)
                    | np.where(_least(found, rows) >= -SMOOTH, 0, NEGATIVE))
    return faults


def _size_by_depth(pairs: Pairs, found: Contacts, rows: np.ndarray) -> np.ndarray:
    return 1.0 / np.maximum(DEPTH_FLOOR, -found.separation[rows] / pairs.size[rows])


def _least(found: Contacts, rows: np.ndarray) -> np.ndarray:
    """Return the least eigenvalue of covariances [of their trace]."""
    covariance = found.covariance[rows]
    return np.linalg.eigvalsh(covariance)[:, 0] / np.trace(covariance, axis1=1, axis2=2)

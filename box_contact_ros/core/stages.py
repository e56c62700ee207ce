# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What every stage of a pair computes, as named arrays: for training, reports and tests."""
from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from . import native


class Stages(NamedTuple):
    """The stages of n pairs; arrays that were not asked for are empty.

    Lengths are in metres. The frame is A's, from A's centre, unless said otherwise. "Pressed" pairs
    have the minimum depth (`DEPTH_FLOOR`).

    Arrays from `unit` on are in the coordinates t_k of the columns (core/src/columns/): along the
    edges of the incident box, from the contact frame's origin, in `unit`. Volumes are in unit²
    times the origin's depth.
    """

    colliding: np.ndarray  # (n,) bool
    separation: np.ndarray  # (n,) largest gap of the separating-axis test
    axis: np.ndarray
    """(n,) int64 winning axis: 0–2 faces of A, 3–5 of B, 6 + 3 i + j for edges a_i × b_j."""
    face: np.ndarray  # (n,) int64 best face axis, 0–5, whatever wins
    normal: np.ndarray  # (n, 3) unit vector along the winning axis, from A to B
    touch: np.ndarray  # (n,) separation up to which the boxes touch
    size: np.ndarray  # (n,) largest full extent of both boxes
    axes_a: np.ndarray  # (n, 3, 3) A's axes as columns, common frame
    rotation: np.ndarray  # (n, 3, 3) B's axes as columns
    offset_a: np.ndarray  # (n, 3) B − A
    offset_b: np.ndarray  # (n, 3) B − A in B's frame
    pressed_offset_a: np.ndarray  # (n, 3) B − A of the pressed pair
    pressed_offset_b: np.ndarray  # (n, 3) the same in B's frame
    centroid: np.ndarray  # (n, 3) exact centroid of the overlap of the pressed pair
    clipped_centroid: np.ndarray  # (n, 3) the same by clipping, as for pairs that are not certain
    volume: np.ndarray  # (n,) exact volume of that overlap [m³]
    clipped_volume: np.ndarray  # (n,) the same by clipping
    covariance: np.ndarray  # (n, 3, 3) its second central moments by its volume [m²], common frame
    clipped_covariance: np.ndarray  # (n, 3, 3) the same by clipping
    certain: np.ndarray  # (n,) bool: the exact moments are by planes; else by clipping
    accurate: np.ndarray  # (n,) bool: float32 is enough for the columns
    unit: np.ndarray  # (n,) unit of length [m]
    true_volume: np.ndarray  # (n,) exact volume of the overlap
    true_mean: np.ndarray  # (n, 3) its exact centroid
    true_covariance: np.ndarray  # (n, 3, 3) its exact covariance
    columns_volume: np.ndarray  # (n,) float32 volume of the columns
    columns_mean: np.ndarray  # (n, 3) float32 their centroid
    columns_covariance: np.ndarray  # (n, 3, 3) float32 their covariance
    upper_volume: np.ndarray
    """(n, 3) float32 what each upper face cuts off the columns, without P's side faces."""
    upper_least: np.ndarray  # (n, 3) float32 least share of it that P's side faces leave
    upper_most: np.ndarray  # (n, 3) float32 largest share of it
    upper_features: np.ndarray  # (n, 3, 6) float32 what the network is told of it
    upper_points: np.ndarray  # (n, 3, 2, 3) float32 two points that carry it
    upper_carries: np.ndarray  # (n, 3, 2) float32 their shares


def stages(poses_a: ArrayLike, poses_b: ArrayLike, size_a: ArrayLike, size_b: ArrayLike, *,
           names: Sequence[str]) -> Stages:
    """Compute what the stages of n pairs give, one pair after the other.

    poses_a, poses_b: (n, 7) `x y z qx qy qz qw` in a common frame [m].
    size_a, size_b: (n, 3), or (1, 3) for all pairs, full extents [m].
    names: fields of `Stages` that are wanted.

    Raises ValueError for unknown names, and for rows that are no poses or sizes.
    """
    unknown = [name for name in names if name not in Stages._fields]
    if unknown:
        raise ValueError(f'names {unknown} are not fields of Stages')
    a, b, one, other = (np.asarray(values, dtype=np.float64)
                        for values in (poses_a, poses_b, size_a, size_b))
    arrays, refused = native.stages(a, b, one, other, tuple(names))
    if refused >= 0:
        raise ValueError(f'row {refused} is refused: its poses or sizes are not valid')
    return Stages(*(arrays.get(name, np.empty(0)) for name in Stages._fields))

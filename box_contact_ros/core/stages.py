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

    Arrays from `patch_axes` on are of pairs that touch. `body_…` are in the coordinates of the
    patch box, −1 to 1, mirrored so that no mean is below 0 (core/src/mlp/).
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
    patch_axes: np.ndarray  # (n, 3, 3) axes of the patch box of `mlp` as columns, common frame
    patch_middle: np.ndarray  # (n, 3) its middle, common frame
    patch_half: np.ndarray  # (n, 3) its half extents
    features: np.ndarray  # (n, FEATURES) float32 what the network of `mlp` reads
    body_volume: np.ndarray  # (n,) float32 what the chords sum to, relative to the patch box
    body_mean: np.ndarray  # (n, 3) float32
    body_variance: np.ndarray  # (n, 3) float32 variances of x, y and z
    body_beside: np.ndarray  # (n, 3) float32 covariances of yz, xz and xy
    flip: np.ndarray  # (n, 3) float32 −1 for the coordinates that were mirrored


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

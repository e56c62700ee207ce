# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What every stage of a pair computes, as named arrays: for training, reports and tests."""
from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from . import native

BOUNDS = ('slab', 'edges')  # methods of the overlap's bounds


class Stages(NamedTuple):
    """The stages of n pairs; arrays that were not asked for are empty. Answers need a network.

    Lengths are in metres. The frame is A's, from A's centre, unless said otherwise. "Pressed" pairs
    have the minimum depth (`DEPTH_FLOOR`). The bounds' frame is that of B where `frame_b`, else of
    A, from that box's centre; the other box is the one whose faces cut the bounding box.
    """

    colliding: np.ndarray  # (n,) bool
    separation: np.ndarray  # (n,) largest gap of the separating-axis test
    axis: np.ndarray
    """(n,) int64 winning axis: 0–2 faces of A, 3–5 of B, 6 + 3 i + j for edges a_i × b_j."""
    face: np.ndarray  # (n,) int64 best face axis, 0–5, whatever wins
    normal: np.ndarray  # (n, 3) unit vector along the winning axis, from A to B
    touch: np.ndarray  # (n,) separation up to which the boxes touch
    size: np.ndarray  # (n,) largest full extent of both boxes
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
    certain: np.ndarray  # (n,) bool: the exact moments are by face sums; else by clipping
    frame_b: np.ndarray  # (n,) bool: the bounds are in B's frame
    in_range: np.ndarray  # (n,) bool: the MLP may be asked; else the exact answer is given
    bounds_middle: np.ndarray  # (n, 3) middle of the overlap's bounds, their frame
    bounds_half: np.ndarray  # (n, 3) its half extents
    other_axes: np.ndarray  # (n, 3, 3) the other box's axes as rows, bounds' frame
    other_offset: np.ndarray
    """(n, 3) from the other box's centre to `bounds_middle`, along the other box's axes."""
    other_half: np.ndarray  # (n, 3) half extents of the other box
    features: np.ndarray
    """(n, 9, 12) float32 features of the sites f · 3 + q: four of the site, of its faces, axis."""
    vectors: np.ndarray  # (n, 9, 3) float32 factors of the sites' outputs for the point
    slant: np.ndarray
    """(n, 3, 3) float32 normals of the other box's pairs of faces as rows, in the cut cube."""
    cut: np.ndarray  # (n, 3) float32 how far both faces of each pair cut into the cube
    answer: np.ndarray  # (n, 3) the network's centroid, from `bounds_middle` [half extents]
    answer_volume: np.ndarray  # (n,) its volume by that of the bounds
    answer_covariance: np.ndarray  # (n, 3, 3) its covariance, bounds' frame [half extents]


def stages(poses_a: ArrayLike, poses_b: ArrayLike, size_a: ArrayLike, size_b: ArrayLike, *,
           names: Sequence[str], network: np.ndarray | None = None,
           bounds: str = 'slab') -> Stages:
    """Compute what the stages of n pairs give, one pair after the other.

    poses_a, poses_b: (n, 7) `x y z qx qy qz qw` in a common frame [m].
    size_a, size_b: (n, 3), or (1, 3) for all pairs, full extents [m].
    names: fields of `Stages` that are wanted.
    network: numbers of an MLP (`mlp.core_numbers`), for `answer`.
    bounds: the method of the overlap's bounds, 'slab' or 'edges'; see overlap/bounds.hpp.

    Raises ValueError for unknown names, and for rows that are no poses or sizes.
    """
    unknown = [name for name in names if name not in Stages._fields]
    if unknown:
        raise ValueError(f'names {unknown} are not fields of Stages')
    if bounds not in BOUNDS:
        raise ValueError(f'bounds {bounds!r} is not one of: {", ".join(BOUNDS)}')
    if network is None and (unanswered := [name for name in names if name.startswith('answer')]):
        raise ValueError(f'{unanswered[0]!r} needs a network')
    a, b, one, other = (np.asarray(values, dtype=np.float64)
                        for values in (poses_a, poses_b, size_a, size_b))
    arrays, refused = native.stages(a, b, one, other, network, tuple(names), bounds == 'edges')
    if refused >= 0:
        raise ValueError(f'row {refused} is refused: its poses or sizes are not valid')
    return Stages(*(arrays.get(name, np.empty(0)) for name in Stages._fields))

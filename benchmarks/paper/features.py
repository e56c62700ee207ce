# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fold touching boxes by their symmetries, into the octant or so that reference features meet.

`to_octant` is for boxes of any shape, as model `paper` folds them. `to_features` is for cubes, and
folds the features that meet onto reference features. On each of the two subsets the map from pose
to contact has no discontinuity. A cube also stays the same when two of its axes change places, so M
and N (see `solver.paper`) may permute axes.

- VERTEX_FACE: face +x of the first cube, vertex (−, −, −) of the second.
- EDGE_EDGE: the first cube's edge along z at (+, +), the second's along y at (−, −).
"""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from box_contact_ros.solver.paper import (
    TouchingPairs,
    network_inputs,
    octant_signs,
    sign,
    turned,
)

VERTEX_FACE, EDGE_EDGE = 0, 1


class Folds(NamedTuple):
    """n pairs in a network's domain: t' = M t, R' = M R Nᵀ."""

    map_first: np.ndarray  # (n, 3, 3) M, a signed permutation of the first box's axes
    offset: np.ndarray  # (n, 3) t' of the second box
    rotation: np.ndarray  # (n, 3, 3) R'

    @property
    def inputs(self) -> np.ndarray:
        """Return a network's inputs (n, 6): t', and roll, pitch and yaw of R'."""
        return network_inputs(self.offset, self.rotation)

    def folded(self, vectors: np.ndarray) -> np.ndarray:
        """Return points or directions (n, 3) of the first box's frame, folded."""
        return turned(self.map_first, vectors)

    def unfolded(self, vectors: np.ndarray) -> np.ndarray:
        """Return folded points or directions (n, 3) in the first box's frame."""
        return turned(self.map_first.swapaxes(1, 2), vectors)


def fold_by(map_first: np.ndarray, map_second: np.ndarray, offset: np.ndarray,
            rotation: np.ndarray) -> Folds:
    """Return pairs folded by M and N (n, 3, 3)."""
    turn = map_first @ rotation @ map_second.swapaxes(1, 2)
    return Folds(map_first, turned(map_first, offset), turn)


def to_octant(offset: np.ndarray, rotation: np.ndarray) -> Folds:
    """Fold n boxes of any shape to t' ≥ 0, and roll, pitch and yaw in [−π/2, π/2]."""
    m, n = octant_signs(offset, rotation)
    return fold_by(np.eye(3) * m[:, None], np.eye(3) * n[:, None], offset, rotation)


def to_features(pairs: TouchingPairs) -> tuple[Folds, np.ndarray]:
    """Return folded pairs of cubes, and the subset (n,) of each.

    Raises ValueError where the winning axis is a face of the second cube.
    """
    if np.any((pairs.axis >= 3) & (pairs.axis < 6)):
        raise ValueError('an axis is no face of the first cube and no pair of edges')
    subset = np.where(pairs.axis < 3, VERTEX_FACE, EDGE_EDGE)
    maps = np.empty((2, len(subset), 3, 3))
    for number, maps_of in ((VERTEX_FACE, _vertex_face), (EDGE_EDGE, _edge_edge)):
        rows = subset == number
        maps[:, rows] = maps_of(pairs.axis[rows], pairs.normal[rows], pairs.rotation[rows])
    m, n = maps
    # Reflect along the folded z axis if det M · det N = −1: the sign of M's third row is free.
    m[:, 2] *= sign(np.linalg.det(m) * np.linalg.det(n))[:, None]
    return fold_by(m, n, pairs.offset, pairs.rotation), subset


def _vertex_face(axis: np.ndarray, normal: np.ndarray, rotation: np.ndarray,
                 ) -> tuple[np.ndarray, np.ndarray]:
    """Return M and N of n pairs whose face `axis` (0–2) of the first cube wins."""
    rows = np.arange(len(axis))
    m, n = np.zeros((2, len(axis), 3, 3))
    # M takes the face to +x. N takes the vertex to (−, −, −). N also orders the vertex's edges by
    # how steeply they rise from the face, the steepest first. Equally steep edges keep their order.
    side = sign(normal[rows, axis])
    m[rows, 0, axis] = side
    rise = side[:, None] * rotation[rows, axis]
    order = np.argsort(-np.abs(rise), axis=1, kind='stable')
    for rank in range(3):
        edge = order[:, rank]
        n[rows, rank, edge] = sign(rise[rows, edge])
    # Of the four turns of the face, M takes the one that brings the projection of the steepest edge
    # onto the face within 45° of −y.
    steepest = order[:, 0]
    projection = sign(rise[rows, steepest])[:, None] * rotation[rows, :, steepest]
    a, b = _larger_first(projection, (axis + 1) % 3, (axis + 2) % 3)
    m[rows, 1, a] = -sign(projection[rows, a])
    m[rows, 2, b] = 1.0
    return m, n


def _edge_edge(axis: np.ndarray, normal: np.ndarray, rotation: np.ndarray,
               ) -> tuple[np.ndarray, np.ndarray]:
    """Return M and N of n pairs in which the edges i and j of axis 6 + 3 i + j meet."""
    rows = np.arange(len(axis))
    m, n = np.zeros((2, len(axis), 3, 3))
    i, j = (axis - 6) // 3, (axis - 6) % 3
    # M takes the edge to z, and its two faces to +x and +y. The face nearer to the normal is +x.
    a, b = _larger_first(normal, (i + 1) % 3, (i + 2) % 3)
    m[rows, 0, a] = sign(normal[rows, a])
    m[rows, 1, b] = sign(normal[rows, b])
    m[rows, 2, i] = 1.0
    # N takes the second cube's edge to y, pointing along the first's y, and its two faces to −x
    # and −z. The face nearer to the normal is −x.
    in_second = turned(rotation.swapaxes(1, 2), normal)
    c, d = _larger_first(in_second, (j + 1) % 3, (j + 2) % 3)
    n[rows, 0, c] = sign(in_second[rows, c])
    n[rows, 1, j] = sign(sign(normal[rows, b]) * rotation[rows, b, j])
    n[rows, 2, d] = sign(in_second[rows, d])
    return m, n


def _larger_first(vectors: np.ndarray, a: np.ndarray, b: np.ndarray,
                  ) -> tuple[np.ndarray, np.ndarray]:
    """Return two axes (n,), those along which vectors (n, 3) are larger first."""
    rows = np.arange(len(a))
    swapped = np.abs(vectors[rows, a]) < np.abs(vectors[rows, b])
    return np.where(swapped, b, a), np.where(swapped, a, b)

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Manifold: the overlap of two boxes as a mesh, by a boolean of solids."""
from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from manifold3d import Manifold as Solid

from ..contestant import APART, Contestant, Manifold, manifold, matrices


def boolean() -> Contestant:
    """Return the intersection of two solids, and the centroid of its volume. It has no normal."""
    def boxes(p: np.ndarray, q: np.ndarray) -> Callable[..., Any]:
        one, two = Solid.cube(tuple(p), True), Solid.cube(tuple(q), True)

        def ask(at_a: np.ndarray, at_b: np.ndarray) -> Any:
            return (one.transform(at_a) ^ two.transform(at_b)).to_mesh64()
        return ask

    def at(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, ...]:
        place_a, place_b, matrix_a, matrix_b = matrices(a, b)
        return np.column_stack([matrix_a, place_a]), np.column_stack([matrix_b, place_b])

    def read(mesh: Any) -> Manifold:
        corners = np.array(mesh.vert_properties)[:, :3]
        if not len(mesh.tri_verts):
            return APART
        start = corners[0]
        x = (corners - start)[np.array(mesh.tri_verts)]  # (triangles, 3 corners, 3)
        volumes = np.linalg.det(x) / 6.0  # of tetrahedra with the first corner
        if not volumes.sum() > 0.0:
            return APART
        centroid = start + volumes @ x.sum(axis=1) / (4.0 * volumes.sum())
        return manifold([(centroid, np.full(3, np.nan), float('nan'))])

    return Contestant(name='Manifold boolean', call='(a.transform(pose_a) ^ b.transform(pose_b))'
                      '.to_mesh64()', returns='mesh of the overlap', patch='volume',
                      package='manifold3d', choices=('its point',), boxes=boxes, at=at, read=read)


ENGINES = [boolean]

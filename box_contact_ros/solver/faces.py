# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The patch of two faces: where the faces by which two boxes meet are within a tolerance.

Of each box it is the face most parallel to the normal. Both are projected along the normal and
intersected; what is left is cut where the gap of their planes exceeds the tolerance. Where edges
meet, at more than 0.1 rad from both faces, there is no patch. The overlap of boxes at rest is a
wedge of a micron, whose moments tell little of it.
"""
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..core import native
from .checks import as_floats, as_margin, as_number, as_places
from .poses import as_boxes

TOLERANCE = 1e-4
"""Gap up to which faces touch [m]: that of a simulation at rest."""


def as_tolerance(value: Any, sizes: np.ndarray) -> float:
    """Return a tolerance [m], from 0 to half of the thinnest box; ValueError for others."""
    tolerance = as_number(value, 'tolerance')
    most = sizes.min(initial=np.inf) / 2.0
    if not 0.0 <= tolerance <= most:
        raise ValueError(f'tolerance must be from 0 to {most:g} m, half of the thinnest box, not '
                         f'{tolerance:g}')
    return tolerance


def as_tolerances(value: Any, sizes: np.ndarray) -> np.ndarray:
    """Return the tolerances of boxes (n,), of a number or an array; ValueError for others."""
    if not isinstance(value, np.ndarray) or not value.ndim:
        return np.full(len(sizes), as_tolerance(value, sizes))
    array = as_floats(value, 'tolerance', f'a number, or numbers ({len(sizes)},)', (len(sizes),))
    for row in range(len(array)):
        as_tolerance(float(array[row]), sizes[row])
    return array


@dataclass(frozen=True, eq=False)
class FacePatches:
    """The patches of k pairs of boxes, in the common frame, midway between both faces."""

    polygon: np.ndarray
    """(k, 9, 3) corners, counter-clockwise about the normal; then the first one again [m]."""
    corner_count: np.ndarray
    """(k,) how many corners there are: 3 to 9; 0: there is no patch, and places are NaN."""
    area: np.ndarray
    """(k,) [m²] across the normal."""
    centre: np.ndarray
    """(k, 3) centroid [m]."""
    rectangle: np.ndarray
    """(k, 4, 3) corners of the bounding rectangle along the edges of the smaller face, in turn."""

    @property
    def width(self) -> np.ndarray:
        """(k,) the shorter side of the rectangle [m]."""
        sides = np.linalg.norm(self.rectangle[:, (1, 3)] - self.rectangle[:, :1], axis=2)
        return sides.min(axis=1)

    def __getitem__(self, rows: np.ndarray) -> FacePatches:
        return FacePatches(self.polygon[rows], self.corner_count[rows], self.area[rows],
                           self.centre[rows], self.rectangle[rows])


def face_patches(sizes: ArrayLike, poses: ArrayLike, pairs: ArrayLike, normal: ArrayLike, *,
                 tolerance: float = TOLERANCE) -> FacePatches:
    """Return the patches of the faces by which pairs of boxes meet.

    sizes: full extents (n, 3), or (3,) of all boxes [m]. poses: (n, 7) in a common frame.
    pairs: (k, 2), boxes A and B by index.
    normal: (k, 3) unit vectors from A to B, as `normal` of the pairs' contacts.
    tolerance: the largest gap of two faces within their patch [m].

    Raises ValueError, with the field and the value, for bad input.
    """
    sizes, poses = as_boxes(sizes, poses)
    rows = as_places(pairs, 'pairs', len(poses))
    count = len(rows)
    normals = as_floats(normal, 'normal', f'unit vectors ({count}, 3)', (count, 3))
    return FacePatches(*native.face_patches(sizes, poses, rows, normals,
                                            as_margin(tolerance, 'tolerance')))


def corner_shares(rectangle: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return the parts (k, 4) of loads at the corners (k, 4, 3), by their centres (k, 3).

    They are bilinear, so none is below 0. Four corners on a rigid base are indeterminate: springs
    would share linearly.
    """
    origin = rectangle[:, 2]

    def along(corner: int) -> np.ndarray:
        edge = rectangle[:, corner] - origin
        squared = (edge**2).sum(axis=1)
        share = ((at - origin) * edge).sum(axis=1) / np.where(squared > 0.0, squared, 1.0)
        return np.where(squared > 0.0, np.clip(share, 0.0, 1.0), 0.5)

    x, y = along(1), along(3)
    return np.stack((x * y, x * (1.0 - y), (1.0 - x) * (1.0 - y), (1.0 - x) * y), axis=1)

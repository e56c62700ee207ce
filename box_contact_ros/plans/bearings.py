# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where patches bear: all over, or at the corners of a box, as containers do."""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..solver.faces import FacePatches
from ..solver.pose import rotation_matrix

CASTING = 0.178  # length of a corner casting [m] (ISO 1161): as far apart two of them still meet
FORTY_FEET = 12.192  # length [m] at which longer containers have castings, too


@dataclass(frozen=True, eq=False)
class Bearings:
    """Points at which k patches bear, m each."""

    point: np.ndarray  # (k, m, 3) [m]
    stiffness: np.ndarray
    """(k, m) 0 where no point is: an area [m²] of a face, a share of the patch's of a corner."""
    hull: np.ndarray  # (k, h, 3) the first points, which span the others; some may come twice [m]

    def __getitem__(self, rows: np.ndarray) -> Bearings:
        return Bearings(self.point[rows], self.stiffness[rows], self.hull[rows])


def on_faces(patches: FacePatches) -> Bearings:
    """Return the points of a bed of equal stiffness per area.

    Each triangle of the centroid, a corner and the next has a twelfth of its area at each corner,
    and the rest at its middle. Its second moments are then exact, and points reach the rim.
    """
    corner, centre = patches.polygon, patches.centre[:, None]
    after = np.roll(corner, -1, axis=1)
    area = np.linalg.norm(np.cross(corner - centre, after - centre), axis=2) / 2.0
    return Bearings(
        np.concatenate((corner, (corner + after + centre) / 3.0, centre), axis=1),
        np.concatenate(((area + np.roll(area, 1, axis=1)) / 12.0, 0.75 * area,
                        area.sum(axis=1, keepdims=True) / 12.0), axis=1), corner)


def on_corners(sizes: np.ndarray, poses: np.ndarray, carried_by: np.ndarray, normal: np.ndarray,
               patches: FacePatches, slack: np.ndarray, fixed: np.ndarray) -> Bearings:
    """Return the corners of the upper boxes that are within patches, up to `slack` (k,) [m].

    Only where the lower box has a casting, but that `fixed` ones (n,) bear everywhere. Where there
    are none, they are those of the lower box, and else those of the rectangle.
    """
    point = patches.rectangle.copy()
    within = np.ones(point.shape[:2], bool)
    lower, upper = carried_by.T
    for box, has_castings_below in ((lower, False), (upper, True)):
        corner = _face_corners(sizes[box], poses[box], patches.centre, normal)
        inside = _inside(corner, patches, normal, slack)
        if has_castings_below:
            inside &= fixed[lower, None] | _on_castings(corner, sizes[lower], poses[lower], normal)
        rows = inside.any(axis=1)
        point[rows], within[rows] = corner[rows], inside[rows]
    stiffness = within * (patches.area / within.sum(axis=1))[:, None]
    first = np.take_along_axis(point, within.argmax(axis=1)[:, None, None], axis=1)
    return Bearings(point, stiffness, np.where(within[:, :, None], point, first))


def _face_corners(sizes: np.ndarray, poses: np.ndarray, towards: np.ndarray, normal: np.ndarray,
                  ) -> np.ndarray:
    """Return the corners (k, 4, 3) of the faces most along normals, on the sides of points."""
    axes = rotation_matrix(poses[:, 3:])
    along = np.einsum('ki,kij->kj', normal, axes)
    face = np.abs(along).argmax(axis=1)
    rows = np.arange(len(poses))
    side = np.sign(np.einsum('ki,ki->k', towards - poses[:, :3], axes[rows, :, face]))
    half = np.empty((len(poses), 4, 3))
    half[rows, :, face] = side[:, None]
    half[rows, :, (face + 1) % 3] = (1, -1, -1, 1)
    half[rows, :, (face + 2) % 3] = (1, 1, -1, -1)
    return poses[:, None, :3] + np.einsum('kij,kpj->kpi', axes, half * sizes[:, None] / 2.0)


def _on_castings(points: np.ndarray, sizes: np.ndarray, poses: np.ndarray, normal: np.ndarray,
                 ) -> np.ndarray:
    """Return which points (k, p, 3) are above castings of boxes (k, p)."""
    axes = rotation_matrix(poses[:, 3:])
    across = np.abs(np.einsum('kij,kpi->kpj', axes, points - poses[:, None, :3]))
    half = sizes[:, None] / 2.0
    ends = np.abs(across - half) <= CASTING
    ends |= (half > FORTY_FEET / 2.0) & (np.abs(across - FORTY_FEET / 2.0) <= CASTING)
    along = np.abs(np.einsum('ki,kij->kj', normal, axes))
    ends[np.arange(len(poses)), :, along.argmax(axis=1)] = True
    return ends.all(axis=2)


def _inside(points: np.ndarray, patches: FacePatches, normal: np.ndarray, slack: np.ndarray,
            ) -> np.ndarray:
    """Return which points (k, p, 3) are within polygons, along their normals (k, p)."""
    corner = patches.polygon[:, None]
    edge = np.roll(corner, -1, axis=2) - corner
    inward = np.cross(normal[:, None, None], edge)
    length = np.linalg.norm(inward, axis=3)
    depth = ((points[:, :, None] - corner) * inward).sum(axis=3)
    return (depth >= -slack[:, None, None] * length).all(axis=2)

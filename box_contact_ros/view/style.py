# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How boxes and contacts look, in RViz and in the browser alike."""
from __future__ import annotations

import math

import numpy as np

Colour = tuple[int, int, int]  # red, green, blue, 0 to 255

BOX_A: Colour = (238, 150, 50)
BOX_B: Colour = (70, 120, 170)
CONTACT: Colour = (230, 20, 110)
NEAR: Colour = (20, 150, 90)
BOX_OPACITY = 0.4  # the contact is inside the boxes, so they are translucent
POINT_RADIUS, NORMAL_LENGTH = 0.015, 0.15
"""Lengths of what has no size of its own, as shares of the box's longest edge."""
HALF_SIDES = math.sqrt(3.0)
"""Half sides of a patch's rectangle in standard deviations: those of l × w are l/√12 and w/√12."""
DASHES = 12  # of the line between two nearest points
_CORNERS = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0], [1.0, 1.0]])


def patch_axes(normals: np.ndarray, covariances: np.ndarray) -> np.ndarray:
    """Return the half sides (k, 2, 3) [m] of the rectangles of patches, the longer one first.

    They lie in the contact planes, in the common frame. NaN where the model gives the point alone.
    """
    known = np.isfinite(covariances).all(axis=(1, 2))
    tangents = np.eye(3) - normals[:, :, None] * normals[:, None, :]
    flat = tangents @ np.where(known[:, None, None], covariances, 0.0) @ tangents
    variances, axes = np.linalg.eigh(flat)  # ascending; the first axis is the normal
    deviations = np.sqrt(np.maximum(variances[:, :0:-1], 0.0))  # below zero by rounding
    half_sides = HALF_SIDES * deviations[:, :, None] * np.swapaxes(axes[:, :, :0:-1], 1, 2)
    return np.where(known[:, None, None], half_sides, math.nan)


def patch_sides(points: np.ndarray, normals: np.ndarray, covariances: np.ndarray) -> np.ndarray:
    """Return the ends (n, 2, 3) [m] of the sides of the rectangles of patches.

    points, normals: (k, 3) of the contacts; those without a patch are left out.
    """
    axes = patch_axes(normals, covariances)
    outlines = points[:, None] + _CORNERS @ axes
    outlines = outlines[~np.isnan(outlines[:, 0, 0])]
    return np.stack([outlines[:, :-1], outlines[:, 1:]], axis=2).reshape(-1, 2, 3)


def dashes(starts: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Return the ends (m, 2, 3) [m] of the dashes of lines between points (k, 3) [m]."""
    share = np.linspace(0.0, 1.0, 2 * DASHES)[:, None]
    points = starts[:, None] + share * (ends - starts)[:, None]
    return points.reshape(-1, 2, 3)


def unit_poses(poses: np.ndarray) -> np.ndarray:
    """Return poses (n, 7) whose quaternions have unit length, which drawing needs."""
    lengths = np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    return np.concatenate([poses[:, :3], poses[:, 3:] / lengths], axis=1)

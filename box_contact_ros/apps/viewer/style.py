"""How boxes and contacts look, in RViz and in the browser alike."""
from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...scene.force.patch_law import Patch

Colour = tuple[int, int, int]  # red, green, blue, 0 to 255

BOX_A: Colour = (238, 150, 50)
BOX_B: Colour = (70, 120, 170)
CONTACT: Colour = (230, 20, 110)
EXACT: Colour = (0, 130, 110)
BOX_OPACITY = 0.4  # the contact is inside the boxes, so they are translucent
STALE = 500_000_000
"""Poses newer than the last answer by more than this [ns]: nobody answers, no contact is drawn."""


class Proportions(NamedTuple):
    """Lengths [m] of what has no size of its own."""

    point_radius: float
    normal_length: float
    text_height: float


def proportions(size_a: Sequence[float], size_b: Sequence[float]) -> Proportions:
    """Return those of a contact between boxes of these full extents [m]: seen on the smaller."""
    edge = min(max(size_a), max(size_b))
    return Proportions(point_radius=0.015 * edge, normal_length=0.15 * edge,
                       text_height=0.04 * edge)


ELLIPSE_SIGMAS = math.sqrt(3.0)
"""Semi-axes of a patch's ellipse in standard deviations. A uniform rectangle l × w has l/√12 and
w/√12, so its ellipse has l/2 and w/2 and touches its edges. Two would reach out of the boxes."""
_CIRCLE = np.linspace(0.0, 2.0 * math.pi, 49)


class Ellipse(NamedTuple):
    """How far a patch reaches in the contact plane, by its covariance."""

    semi_axes: np.ndarray
    """(2, 3) [m], perpendicular, the longer one first, in the common frame."""

    @property
    def area(self) -> float:
        """Area of the patch [m²]: of the rectangle around the ellipse, exact for a rectangle."""
        return float(4.0 * np.prod(np.linalg.norm(self.semi_axes, axis=1)))

    @property
    def outline(self) -> np.ndarray:
        """Points (49, 3) [m] once around, from the patch's point; the last is the first."""
        return np.stack([np.cos(_CIRCLE), np.sin(_CIRCLE)], axis=1) @ self.semi_axes


def patch_ellipse(patch: Patch) -> Ellipse | None:
    """Return the ellipse of a patch; None where the model gives the point alone."""
    if not np.isfinite(patch.covariance).all():
        return None
    tangent = np.eye(3) - np.outer(patch.normal, patch.normal)
    variances, axes = np.linalg.eigh(tangent @ patch.covariance @ tangent)  # ascending
    deviations = np.sqrt(np.maximum(variances[:0:-1], 0.0))  # below zero by rounding
    return Ellipse(ELLIPSE_SIGMAS * deviations[:, None] * axes[:, :0:-1].T)


def unit_pose(pose: np.ndarray) -> np.ndarray:
    """Return a pose (7,) whose quaternion has unit length, which drawing needs."""
    return np.concatenate([pose[:3], pose[3:] / np.linalg.norm(pose[3:])])

"""How boxes and contacts look, in RViz and in the browser alike."""
from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

Colour = tuple[int, int, int]
"""Red, green, blue, 0 to 255."""

BOX_A: Colour = (238, 150, 50)
BOX_B: Colour = (70, 120, 170)
CONTACT: Colour = (230, 20, 110)
EXACT: Colour = (0, 130, 110)
BOX_OPACITY = 0.4
"""The contact is inside the boxes, so they are translucent."""
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


def unit_pose(pose: np.ndarray) -> np.ndarray:
    """Return a pose (7,) whose quaternion has unit length, which drawing needs."""
    return np.concatenate([pose[:3], pose[3:] / np.linalg.norm(pose[3:])])

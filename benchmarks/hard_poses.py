# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The hard poses as stored, by family: parallel, touching, deep, tied, thin, far.

Tests and reports read them from `hard_poses.npz` and do not draw them anew. At 1e-12 the rounding
of a recipe is part of the case, and another machine's sine may round differently. Each family has a
recipe with a docstring in `test/helpers/hard_pose_recipes.py`. `make_hard_poses.py` next to it
stores what the recipes draw, with the true gap, centroid, volume and covariance in 60 digits.
"""
from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from .pose_sets import Pairs

FILE = Path(__file__).with_name('hard_poses.npz')


class Cases(NamedTuple):
    """A family as stored: n pairs with their truth."""

    pairs: Pairs
    gap: np.ndarray  # (n,) largest gap over the fifteen axes, in 60 digits, rounded once [m]
    centroid: np.ndarray
    """(n, 3) of the overlap as it is, in 60 digits, from A's position [m]; NaN if it has no
    volume or is shallower than what boxes are pressed in by."""
    volume: np.ndarray
    """(n,) of the same overlap, in 60 digits, rounded once [m³]; NaN where `centroid` is."""
    covariance: np.ndarray
    """(n, 3, 3) of the same overlap, in 60 digits, rounded once [m²]; NaN where `centroid` is."""


def load(path: Path = FILE) -> dict[str, Cases]:
    """Return the families by name."""
    with np.load(path) as file:
        names = dict.fromkeys(key.partition('.')[0] for key in file)
        return {name: Cases(Pairs(*(file[f'{name}.{part}'] for part in Pairs._fields)),
                            *(file[f'{name}.{part}'] for part in Cases._fields[1:]))
                for name in names}

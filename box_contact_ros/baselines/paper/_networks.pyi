# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

# What the extension offers; see networks.cpp. Stubs of functions have no bodies but docstrings.
from typing import Final

import numpy as np

INPUTS: Final[int]
"""Inputs of a network: t_x t_y t_z [m or half edges], roll pitch yaw [rad]."""
OUTPUTS: Final[int]
"""Outputs of a network: azimuth and elevation of the impact point, then of the normal [rad]."""

NO_FOLD: Final[int]
"""Leave pairs as they are."""
OCTANT: Final[int]
"""Fold boxes of any shape to offsets ≥ 0 and angles in [−π/2, π/2]."""
FEATURES: Final[int]
"""Fold cubes so that the features that meet become the reference features."""

VERTEX_FACE: Final[int]
"""Subset of pairs in which a vertex meets a face."""
EDGE_EDGE: Final[int]
"""Subset of pairs in which two edges meet."""

def solve(poses_a: np.ndarray, poses_b: np.ndarray, sizes_a: np.ndarray, sizes_b: np.ndarray,
          networks: np.ndarray, widths: np.ndarray, cubes: bool, fold_to: int, /,
          ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, int]:
    """Return colliding, separation, normal, point, and the first refused row or −1.

    poses (n, 7), sizes (n, 3) or (1, 3) full extents [m]; frame: that of the poses.
    networks: (networks, parameters) float32, one a subset for FEATURES, else one.
    widths: (layers + 1,) int64 units of the layers.
    cubes: the networks were trained on cubes of edge 2.
    """

def fold(fold_to: int, offset: np.ndarray, rotation: np.ndarray, axis: np.ndarray,
         normal: np.ndarray, /,
         ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return M (n, 3, 3), N (n, 3, 3), t' (n, 3), R' (n, 3, 3), angles (n, 3) and subset (n,).

    offset (n, 3) and rotation (n, 3, 3) of the second box in the first box's frame.
    axis (n,) int64 and normal (n, 3) of the separating-axis test; FEATURES alone reads them.
    """

def forward(network: np.ndarray, widths: np.ndarray, inputs: np.ndarray, /) -> np.ndarray:
    """Return the outputs (n, outputs) float32 of a network for inputs (n, inputs) float32."""

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

# What the extension offers; see networks.cpp. Stubs of functions have no bodies but docstrings.
from typing import Final

import numpy as np

INPUTS: Final[int]
"""Inputs of a network: t_x t_y t_z [m or half edges], roll pitch yaw [rad]."""
OUTPUTS: Final[int]
"""Outputs of a network: azimuth and elevation of the impact point, then of the normal [rad]."""

MOST_UNITS: Final[int]
"""Most units of a layer."""
SAME_SIZE: Final[float]
"""Relative difference of extents up to which two sizes are one."""
KERNEL: Final[object]
"""What `PairSolver` takes as its model: networks as `paper_models` packs them."""

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

def fold(fold_to: int, offset: np.ndarray, rotation: np.ndarray, axis: np.ndarray,
         normal: np.ndarray, /,
         ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return M (n, 3, 3), N (n, 3, 3), t' (n, 3), R' (n, 3, 3), angles (n, 3) and subset (n,).

    offset (n, 3) and rotation (n, 3, 3) of the second box in the first box's frame.
    axis (n,) int64 and normal (n, 3) of the separating-axis test; FEATURES alone reads them.
    """

def forward(network: np.ndarray, widths: np.ndarray, inputs: np.ndarray, /) -> np.ndarray:
    """Return the outputs (n, outputs) float32 of a network for inputs (n, inputs) float32."""

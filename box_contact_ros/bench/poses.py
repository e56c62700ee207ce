# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The pose stream of the bench: seeded, and made before it is sent. No ROS."""
from __future__ import annotations

import numpy as np

from ..scene.boxes import CONTAINER
from ..solver.pose import rotation_matrix

DEPTHS = (0.005, 0.02)
"""Least and largest depth of B's lowest corner below A's top face [m]. Where that corner overhangs
A's edge, the overlap is up to 4 mm less deep."""


def swaying_containers(count: int, *, rate: float, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Return poses (count, 7) of a container A at rest, and of a container B that sways on top.

    All pairs touch, each at a random depth. An answer that mixes two ticks has a wrong depth.

    rate: pairs per second [Hz], by which the motion is sampled.
    """
    rng = np.random.default_rng(seed)
    periods = np.array([6.3, 5.1, 3.7, 4.3, 7.9])  # of surge, sway, roll, pitch and yaw [s]
    swings = np.array([0.2, 0.1, 0.01, 0.005, 0.03])  # their amplitudes [m] and [rad]
    time = np.arange(count)[:, None] / rate
    motion = swings * np.sin(2.0 * np.pi * (time / periods + rng.random(5)))
    turns = np.column_stack([0.5 * motion[:, 2:], np.ones(count)])
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    reach = 0.5 * np.abs(rotation_matrix(turns)[:, 2]) @ CONTAINER  # of B below its centre [m]
    heights = 0.5 * CONTAINER[2] + reach - rng.uniform(*DEPTHS, count)
    return (np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (count, 1)),
            np.column_stack([motion[:, :2], heights, turns]))

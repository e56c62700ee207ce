# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A box that slides and spins on a plane, by the sum over columns: slow, and plain to read.

Each column of the face carries the same share of the weight, and Coulomb friction acts on it
against its own slip. It shares nothing with the force law.
"""
from __future__ import annotations

import numpy as np

from box_contact_ros.scene.force.laws import GRAVITY

COLUMNS = 40  # along each edge
STEP = 2e-4  # [s]
STOPPED = 0.01
"""A motion has stopped where so much of it is left, as a share of the start."""


def stop_times(size: tuple[float, float, float], slide: float, spin: float, friction: float,
               ) -> tuple[float, float]:
    """Return when the slide [m/s] along x and the spin [rad/s] of a box have stopped [s].

    Its mass does not matter. NaN for a motion that it did not have.
    """
    x, y = (edge * ((np.arange(COLUMNS) + 0.5) / COLUMNS - 0.5) for edge in size[:2])
    x, y = (grid.ravel() for grid in np.meshgrid(x, y))
    gyration = (size[0]**2 + size[1]**2) / 12.0  # moment of inertia by the mass [m²]
    velocity, angle, rate, time = np.array([slide, 0.0]), 0.0, spin, 0.0
    stopped = [np.nan, np.nan]
    is_open = [slide != 0.0, spin != 0.0]
    while any(is_open):
        arm_x = np.cos(angle) * x - np.sin(angle) * y
        arm_y = np.sin(angle) * x + np.cos(angle) * y
        slip_x, slip_y = velocity[0] - rate * arm_y, velocity[1] + rate * arm_x
        # The speed of 1 µm/s spares a division by zero.
        speed = np.hypot(slip_x, slip_y) + 1e-6
        push_x, push_y = -slip_x / speed, -slip_y / speed
        velocity = velocity + STEP * friction * GRAVITY * np.array([push_x.mean(), push_y.mean()])
        rate += STEP * friction * GRAVITY * (arm_x * push_y - arm_y * push_x).mean() / gyration
        angle += STEP * rate
        time += STEP
        left = np.hypot(*velocity) / (slide or 1.0), abs(rate) / (spin or 1.0)
        for motion in (0, 1):
            if is_open[motion] and left[motion] < STOPPED:
                stopped[motion], is_open[motion] = time, False
    return stopped[0], stopped[1]

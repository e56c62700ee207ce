# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Forces of answers that come late: what a client can do about a landing."""
from __future__ import annotations

from itertools import product

import numpy as np
import poses
import pytest

from box_contact_ros import Body, ContactSolver, PatchForces

SIZE, MASS = np.array(poses.CONTAINER), 20e3
STEP, PERIOD, LATENCY = 1e-3, 20, 5  # step [s]; steps from question to question, and to the answer
FAST = 0.05  # speed of a corner from which on a client asks ahead [m/s]
CORNERS = 0.5 * np.array(list(product((-1, 1), repeat=3))) * SIZE


def ahead(pose: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Return the pose (7,) after a period and the latency, if a corner is fast."""
    turned = poses.rotate(np.tile(pose[3:], (8, 1)), CORNERS)
    speeds = np.linalg.norm(velocity[:3] + np.cross(velocity[3:], turned), axis=1)
    if speeds.max() <= FAST:
        return pose
    seconds = (PERIOD + LATENCY) * STEP
    turn = np.append(0.5 * seconds * velocity[3:], 1.0)  # of small angles, of any length
    return np.append(pose[:3] + seconds * velocity[:3],
                     poses.multiply(turn[None], pose[None, 3:]))


def deepest(tilt: float, phase: int, *, asks_ahead: bool) -> float:
    """Return how deep [mm] a container goes that lands at 1 m/s, tilted about its width [°]."""
    solver = ContactSolver(SIZE, SIZE)
    forces = PatchForces([Body.of_box(SIZE, MASS), Body.fixed()])
    turn = poses.small_rotations(np.array([[0.0, 1.0, 0.0]]), np.radians([tilt]))
    low = poses.rotate(np.tile(turn, (8, 1)), CORNERS)[:, 2].min()
    place = np.array([np.append([0, 0, 0.5 * SIZE[2] - low + 0.03 + 1e-3 * phase], turn),
                      poses.IDENTITY])
    velocities, weights = np.zeros((2, 6)), np.zeros((2, 6))
    velocities[0, 2], weights[0, 2] = -1.0, -9.81 * MASS
    depth = 0.0
    for step in range(400):
        if step % PERIOD == 0:
            asked = place.copy()
            if asks_ahead:
                asked[0] = ahead(place[0], velocities[0])
            contacts = solver.batch(asked[:1], asked[1:])
        if step % PERIOD == LATENCY:
            forces.hold([(0, 1)], contacts, asked, age=LATENCY * STEP, period=PERIOD * STEP)
        place, velocities, *_ = forces.advance(STEP, place, velocities, weights)
        depth = max(depth, -solver(*place).separation)
    return 1e3 * depth


@pytest.mark.parametrize('tilt, late, soon', [(0.0, 7.0, 0.5), (3.0, 45.0, 12.0)])
def test_asking_ahead_lands_a_load(tilt: float, late: float, soon: float) -> None:
    """At 50 Hz and 5 ms late, whenever the load meets the stack between two questions."""
    for phase in (0, 10):
        assert deepest(tilt, phase, asks_ahead=False) > late
        assert deepest(tilt, phase, asks_ahead=True) < soon

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where a load will be when a wrench that is asked for now begins to act.

For clients that can only apply a wrench. The state is integrated over the latency, under the
wrenches that are in flight and under an acceleration that nothing known explains: gravity, ropes,
wind. That one is observed from tick to tick. Gravity alone in its place does not bring a load to
rest. What the latency may err by goes to `PatchLaw.for_loop`.
"""
from __future__ import annotations

import math

import numpy as np

from ..pose import cross, quaternion_multiply, rotation_matrix
from .held_wrench import TIME_ROUNDING, HeldWrench
from .laws import Body

LONGEST_STEP = 5e-4  # of the integration [s]
OBSERVED_SHARE = 0.5
"""Share of the newest tick in the observed acceleration [1]."""


class Predictor:
    """The state of one load ahead; it keeps the wrenches that are in flight."""

    def __init__(self, load: Body, *, latency: float) -> None:
        """Predict `latency` [s] ahead. ValueError: a `centre` that is not zero, a mass that is."""
        if np.any(load.centre):
            raise ValueError(f'centre must be zero for a Predictor, not {tuple(load.centre)}')
        if not load.mass > 0.0:
            raise ValueError(f'mass must be positive for a Predictor, not {load.mass:g}')
        self._mass, self._inertia = load.mass, np.array(load.inertia, dtype=float)
        self._latency = latency
        self._held = HeldWrench()
        self._unexplained = np.zeros(3)  # acceleration [m/s²]
        self._last: tuple[float, np.ndarray] | None = None  # time and velocity of the last tick

    def state(self, time: float, pose: np.ndarray, velocity: np.ndarray,
              ) -> tuple[np.ndarray, np.ndarray]:
        """Return pose (7,) and velocity (6,) at `time` + latency from those at `time` [s].

        A time that is not later than the last one, as of a clock that pauses, teaches nothing.
        """
        if self._last is not None and time > self._last[0]:
            before, was = self._last
            period = time - before
            known = self._impulse(before, time) / self._mass
            self._unexplained += OBSERVED_SHARE * (
                (velocity[:3] - was[:3] - known) / period - self._unexplained)
        self._last = time, velocity.copy()
        steps = math.ceil(self._latency / LONGEST_STEP)
        for k in range(steps):
            step = self._latency / steps
            pose, velocity = self._step(pose, velocity, self._acting(time + k * step), step)
        return pose, velocity

    def sent(self, wrench: np.ndarray, time: float) -> None:
        """Note the wrench (6,) of the contacts that were asked for at `time` [s]."""
        self._held.answer(wrench, asked=time, due=time + self._latency)

    def _acting(self, time: float) -> np.ndarray:
        """Return the wrench that will act at a time that is still to come."""
        acting = self._held.current
        for due, wrench in self._held.under_way():
            if due <= time + TIME_ROUNDING:
                acting = wrench
        return acting

    def _impulse(self, start: float, end: float) -> np.ndarray:
        """Return the impulse (3,) [N s] of the wrenches that acted from `start` to `end` [s]."""
        total, time = np.zeros(3), start
        for due in [*(due for due, _ in self._held.under_way() if start < due < end), end]:
            total += (due - time) * self._held.at(time)[:3]
            time = due
        self._held.at(end)
        return total

    def _step(self, pose: np.ndarray, velocity: np.ndarray, wrench: np.ndarray, step: float,
              ) -> tuple[np.ndarray, np.ndarray]:
        """Return pose and velocity one step on, by symplectic Euler."""
        axes = rotation_matrix(pose[3:])
        linear = velocity[:3] + step * (wrench[:3] / self._mass + self._unexplained)
        own = axes.T @ velocity[3:]
        own = own + step * (axes.T @ wrench[3:] - cross(own, self._inertia * own)) / self._inertia
        angular = axes @ own
        half = 0.5 * step * angular
        turn = np.append(half, math.sqrt(max(0.0, 1.0 - float(half @ half))))
        return (np.concatenate([pose[:3] + step * linear, quaternion_multiply(turn, pose[3:])]),
                np.concatenate([linear, angular]))

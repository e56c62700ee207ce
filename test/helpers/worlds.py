# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bodies that a simulator of a few lines moves by `PatchForces`, for tests of forces."""
from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations

import numpy as np

from box_contact_ros import Body, PatchForces
from box_contact_ros.forces.patch_forces import GRAVITY
from box_contact_ros.solver.pose import rotation_matrix

STEP = 0.001  # [s]
FIXED = Body.fixed()
FLOOR = (60.0, 60.0, 1.0), 0.0, (0.0, 0.0, -0.5)
"""A row of `World`, its top at z = 0."""
CONTAINER = (12.192, 2.438, 2.591)


def turned(axis: Sequence[float], angle: float) -> np.ndarray:
    return np.append(math.sin(0.5 * angle) * np.array(axis, float), math.cos(0.5 * angle))


class World:
    """Bodies of one box each, under gravity, by contacts of their own at each step.

    A row is a size, a mass (0: fixed), a position and perhaps a quaternion and a centre of mass.
    pairs: of boxes that may touch; None: all of which one is free; none: contacts are held.
    find_pairs: the forces find them instead.
    """

    def __init__(self, *rows: tuple, pairs: Sequence[tuple[int, int]] | None = None,
                 find_pairs: bool = False, **options) -> None:
        self.size = np.array([row[0] for row in rows], float)
        self.mass = np.array([row[1] for row in rows], float)
        self.poses = np.array([[*row[2], *(row[3] if len(row) > 3 else (0, 0, 0, 1))]
                               for row in rows], float)
        self.velocities = np.zeros((len(rows), 6))
        self.outside = np.zeros((len(rows), 6))
        self.outside[:, 2] = -GRAVITY * self.mass
        self.bodies = [
            Body(mass=mass, inertia=Body.of_box(size, mass).inertia,
                 centre=row[4] if len(row) > 4 else (0, 0, 0)) if mass else FIXED
            for row, size, mass in zip(rows, self.size, self.mass)]
        self.forces = PatchForces(self.bodies, **options)
        if pairs is None:
            pairs = [(a, b) for a, b in combinations(range(len(rows)), 2)
                     if self.mass[a] or self.mass[b]]
        if find_pairs or pairs:
            self.forces.set_boxes(self.size, find_pairs=find_pairs)
        if pairs and not find_pairs:
            self.forces.hold(pairs)

    def step(self, dt: float = STEP) -> World:
        self.poses, self.velocities, self.wrenches, self.awake = self.forces.advance(
            dt, self.poses, self.velocities, self.outside)
        return self

    def run(self, seconds: float, dt: float = STEP) -> World:
        for _ in range(round(seconds / dt)):
            self.step(dt)
        return self

    def energies(self) -> np.ndarray:
        """Return the energy of motion (n,) [J]."""
        inertia = np.array([body.inertia for body in self.bodies])
        own = np.einsum('nji,nj->ni', rotation_matrix(self.poses[:, 3:]), self.velocities[:, 3:])
        return 0.5 * (self.mass * (self.velocities[:, :3]**2).sum(axis=1)
                      + (inertia * own**2).sum(axis=1))

    def spins(self) -> np.ndarray:
        """Return angular momenta (n, 3) about the own centres, in the common frame [N m s]."""
        inertia = np.array([body.inertia for body in self.bodies])
        axes = rotation_matrix(self.poses[:, 3:])
        own = inertia * np.einsum('nji,nj->ni', axes, self.velocities[:, 3:])
        return np.einsum('nij,nj->ni', axes, own)

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rapier with its defaults, by one thread; `num_solver_iterations` are its sub-steps."""
from __future__ import annotations

import math
import os

import rapier3d as rapier

from . import Asked, run

os.environ['RAYON_NUM_THREADS'] = '1'  # a pool of its own would hand each step to another thread


class World:
    """Boxes by Rapier's wheel."""

    def __init__(self, asked: Asked) -> None:
        """Make the boxes."""
        self.world = rapier.PhysicsWorld(gravity=(0.0, 0.0, -asked.gravity))
        self.world.integration_parameters.dt = asked.step
        self.world.integration_parameters.num_solver_iterations = asked.substeps
        self.step = self.world.step
        self.handles = []
        for size, mass, (x, y, z, *q) in zip(asked.size.tolist(), asked.mass, asked.pose.tolist()):
            body = (rapier.RigidBody.dynamic().can_sleep(asked.sleep) if mass else
                    rapier.RigidBody.fixed())
            axis = 2.0 * math.atan2(math.hypot(*q[:3]), q[3]) / (math.hypot(*q[:3]) or 1.0)
            shape = rapier.Collider.cuboid(*(0.5 * extent for extent in size)).friction(
                asked.friction)
            self.handles.append(self.world.add_body(
                body.translation((x, y, z)).rotation(tuple(axis * part for part in q[:3])),
                [shape.mass(float(mass)) if mass else shape]))

    def awake(self) -> int:
        """Return how many bodies are awake."""
        return len(self.world.active_bodies())

    def poses(self) -> list[tuple[float, ...]]:
        """Return a pose for each box."""
        found = []
        for handle in self.handles:
            body = self.world.rigid_bodies[handle]
            place, turn = body.translation, body.rotation
            found.append((place.x, place.y, place.z, turn.i, turn.j, turn.k, turn.w))
        return found


if __name__ == '__main__':
    run(World)

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rapier, whose colliders are Parry's, in float32."""
from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import rapier3d as rapier

from box_contact_ros.scene.pose import rotation_matrix

from ..contestant import Contestant, Manifold, manifold


def collision() -> Contestant:
    """Return Rapier's contacts after a step of detection: up to four points."""
    def boxes(p: np.ndarray, q: np.ndarray) -> Callable[..., Any]:
        bodies, colliders = rapier.RigidBodySet(), rapier.ColliderSet()
        narrow, detection = rapier.NarrowPhase(), rapier.CollisionPipeline()
        parts = (rapier.IslandManager(), rapier.BroadPhaseBvh(), narrow, bodies, colliders)
        handles, shapes = [], []
        for size in (p, q):
            builder = rapier.RigidBodyBuilder(rapier.RigidBodyType.DYNAMIC)
            handles.append(bodies.insert(builder))
            shapes.append(colliders.insert_with_parent(
                rapier.Collider.cuboid(*(0.5 * size).tolist()), handles[-1], bodies))

        def ask(at_a: Any, at_b: Any, poses: np.ndarray) -> tuple[Any, np.ndarray]:
            for handle, at in zip(handles, (at_a, at_b)):
                bodies[handle].position = at
            detection.step(0.0, *parts)
            return narrow.contact_pair(*shapes), poses
        return ask

    def place(pose: np.ndarray) -> Any:
        x, y, z, w = (pose[3:] / np.linalg.norm(pose[3:])).tolist()
        return rapier.Isometry3(tuple(pose[:3].tolist()), rapier.Rotation3(w, x, y, z))

    def read(found: tuple[Any, np.ndarray]) -> Manifold:
        pair, poses = found
        turns = rotation_matrix(poses[:, 3:])
        contacts = []
        for group in pair.manifolds if pair else ():
            normal = turns[0] @ [group.local_n1.x, group.local_n1.y, group.local_n1.z]
            for point in group.points:
                if point.dist <= 0.0:
                    ends = [pose[:3] + turn @ [local.x, local.y, local.z] for pose, turn, local in
                            zip(poses, turns, (point.local_p1, point.local_p2))]
                    contacts.append((0.5 * (ends[0] + ends[1]), normal, -point.dist))
        return manifold(contacts)

    return Contestant(name='Rapier contact_pair', package='rapier3d',
                      call='CollisionPipeline.step, NarrowPhase.contact_pair',
                      returns='up to 4 points with depths, normals; float32',
                      boxes=boxes, read=read,
                      at=lambda a, b: (place(a), place(b), np.array([a, b])))


ENGINES = [collision]

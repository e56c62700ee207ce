"""Rapier, whose colliders are Parry's, in float32."""
from __future__ import annotations

from typing import Any

import numpy as np
import rapier3d as rapier

from ....scene.pose import rotation_matrix
from ..engine import Engine, Manifold, manifold


class _RapierWorld:
    """Two boxes, and what updates the contacts between them."""

    def __init__(self, p: np.ndarray, q: np.ndarray) -> None:
        self._bodies, self._colliders = rapier.RigidBodySet(), rapier.ColliderSet()
        self._narrow = rapier.NarrowPhase()
        self._parts = (rapier.IslandManager(), rapier.BroadPhaseBvh(), self._narrow, self._bodies,
                       self._colliders)
        self._detect = rapier.CollisionPipeline()
        self._handles, shapes = [], []
        for size in (p, q):
            builder = rapier.RigidBodyBuilder(rapier.RigidBodyType.DYNAMIC)
            self._handles.append(self._bodies.insert(builder))
            shapes.append(self._colliders.insert_with_parent(
                rapier.Collider.cuboid(*(0.5 * size).tolist()), self._handles[-1],
                self._bodies))
        self._shapes = tuple(shapes)

    def __call__(self, at_a: Any, at_b: Any, poses: np.ndarray) -> tuple[Any, np.ndarray]:
        for handle, at in zip(self._handles, (at_a, at_b)):
            self._bodies[handle].position = at
        self._detect.step(0.0, *self._parts)
        return self._narrow.contact_pair(*self._shapes), poses


def collision() -> Engine:
    """Return Rapier's contacts after a step of detection: up to four points."""

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

    return Engine(name='Rapier contact_pair', package='rapier3d',
                  call='CollisionPipeline.step, NarrowPhase.contact_pair',
                  returns='up to 4 points with depths, normals; float32',
                  boxes=_RapierWorld, read=read,
                  at=lambda a, b: (place(a), place(b), np.array([a, b])))


ENGINES = [collision]

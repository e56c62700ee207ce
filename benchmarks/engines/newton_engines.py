# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Newton's collision pipeline, on the processor, in float32."""
from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import newton
import numpy as np
import warp

from box_contact_ros.scene.pose import rotation_matrix

from ..contestant import Contestant, Manifold
from ..pose_sets import Pairs

warp.config.quiet = True


class _NewtonModel:
    """Pairs of boxes, each of a collision group of its own."""

    def __init__(self, size_a: np.ndarray, size_b: np.ndarray) -> None:
        builder = newton.ModelBuilder()
        for group, sizes in enumerate(zip(size_a, size_b), start=1):
            for size in sizes:
                builder.add_shape_box(
                    body=builder.add_body(), hx=0.5 * size[0], hy=0.5 * size[1], hz=0.5 * size[2],
                    cfg=newton.ModelBuilder.ShapeConfig(collision_group=group, gap=0.0))
        model = builder.finalize(device='cpu')
        self._state = model.state()
        self._pipeline = newton.CollisionPipeline(model, broad_phase='explicit')
        self.contacts = self._pipeline.contacts()

    def __call__(self, poses: np.ndarray) -> tuple[Any, np.ndarray]:
        self._state.body_q.assign(poses)
        self._pipeline.collide(self._state, self.contacts)
        return self.contacts, poses


def collision() -> Contestant:
    """Return Newton's `CollisionPipeline.collide`: up to four points or so."""
    def prepare_batch(pairs: Pairs, threads: int = 1) -> Callable[[], Any]:
        poses = np.stack([pairs.pose_a, pairs.pose_b], axis=1).reshape(-1, 7)
        return partial(_NewtonModel(pairs.size_a, pairs.size_b), poses.astype(np.float32))

    def read(found: tuple[Any, np.ndarray]) -> Manifold:
        contacts, poses = found
        count = int(contacts.rigid_contact_count.numpy()[0])
        turns = rotation_matrix(poses[:, 3:].astype(np.float64))
        first = contacts.rigid_contact_shape0.numpy()[:count]
        normals = contacts.rigid_contact_normal.numpy()[:count].astype(np.float64)
        ends = []
        for shapes, points in ((first, contacts.rigid_contact_point0), (
                contacts.rigid_contact_shape1.numpy()[:count], contacts.rigid_contact_point1)):
            ends.append(poses[shapes, :3] + np.einsum(
                'nij,nj->ni', turns[shapes], points.numpy()[:count]))
        depths = np.einsum('ni,ni->n', ends[0] - ends[1], normals)
        normals *= np.where(first == 0, 1.0, -1.0)[:, None]
        deep = depths >= 0.0
        return Manifold(0.5 * (ends[0] + ends[1])[deep], normals[deep], depths[deep])

    return Contestant(name='Newton collide', call='CollisionPipeline.collide',
                      returns='up to 5 points with normals; float32', package='newton',
                      boxes=lambda p, q: _NewtonModel(p[None], q[None]),
                      at=lambda a, b: (np.array([a, b], dtype=np.float32),), read=read,
                      prepare_batch=prepare_batch)


ENGINES = [collision]

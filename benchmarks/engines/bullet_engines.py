# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bullet (PyBullet): closest points of a query, and the persistent manifold of its world."""
from __future__ import annotations

import weakref
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pybullet as bullet

from ..contestant import Contestant, Manifold, manifold

FILLING = 4
"""Detections of the same pose before the manifold is read: it takes up to four points."""
FAR = (1e6, 0.0, 0.0)


def closest() -> Contestant:
    """Return `getClosestPoints` at distance 0, of shapes and poses: no body is placed."""
    def boxes(p: np.ndarray, q: np.ndarray) -> Callable[..., Any]:
        client, (one, two) = _shapes(p, q)
        near = partial(bullet.getClosestPoints, bodyA=-1, bodyB=-1, distance=0.0,
                       collisionShapeA=one, collisionShapeB=two, physicsClientId=client)

        def ask(a: Any, b: Any, quat_a: Any, quat_b: Any) -> Any:
            return near(collisionShapePositionA=a, collisionShapePositionB=b,
                        collisionShapeOrientationA=quat_a, collisionShapeOrientationB=quat_b)

        weakref.finalize(ask, bullet.disconnect, client).atexit = False
        return ask

    return Contestant(
        name='PyBullet getClosestPoints', package='pybullet', boxes=boxes, at=_at, read=_read,
        call='getClosestPoints(bodyA=-1, bodyB=-1, distance=0.0), shapes and poses',
        returns='one point on each box, depth, normal', choices=('its point',), causes={
            'missed': 'The query rounds edges and corners by a margin of 1 mm: a corner recedes by '
            'up to 0.7 mm. The same boxes 1,000 times as large miss none.'})


def persistent() -> Contestant:
    """Return `getContactPoints` of the filled manifold."""
    def boxes(p: np.ndarray, q: np.ndarray) -> Callable[..., Any]:
        client, shapes = _shapes(p, q)
        place = partial(bullet.resetBasePositionAndOrientation, physicsClientId=client)
        detect = partial(bullet.performCollisionDetection, physicsClientId=client)
        one, two = (bullet.createMultiBody(1.0, shape, physicsClientId=client) for shape in shapes)

        def ask(a: Any, b: Any, quat_a: Any, quat_b: Any) -> Any:
            place(one, a, quat_a)
            place(two, FAR, quat_b)  # the manifold would keep points of the pair before
            detect()
            place(two, b, quat_b)
            for _ in range(FILLING):
                detect()
            return bullet.getContactPoints(one, two, physicsClientId=client)

        weakref.finalize(ask, bullet.disconnect, client).atexit = False
        return ask

    return Contestant(
        name='PyBullet getContactPoints', package='pybullet', boxes=boxes, at=_at, read=_read,
        call=f'{FILLING + 1} × performCollisionDetection, getContactPoints',
        returns='up to 4 points with depths, normals',
        causes={'invented': 'The axis test adds 1e-5 to every entry of the rotation, so gaps of '
                'some 1e-5 of the size count as contact.'})


def _shapes(p: np.ndarray, q: np.ndarray) -> tuple[int, list[int]]:
    """Return a client, as other boxes in its world would slow it down, and two shapes in it."""
    client = bullet.connect(bullet.DIRECT)
    return client, [bullet.createCollisionShape(
        bullet.GEOM_BOX, halfExtents=list(0.5 * size), physicsClientId=client) for size in (p, q)]


def _at(a: np.ndarray, b: np.ndarray) -> tuple[Any, ...]:
    return tuple(map(tuple, (a[:3], b[:3], a[3:], b[3:])))


def _read(contacts: Any) -> Manifold:
    # 5, 6: the points on A and B; 7: the normal on B, towards A; 8: the distance.
    # The manifold keeps points that are up to its margin apart.
    return manifold((0.5 * (np.array(c[5]) + np.array(c[6])), -np.array(c[7]), -c[8])
                    for c in contacts if c[8] <= 0.0)


ENGINES = [closest, persistent]

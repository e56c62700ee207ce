# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""DART, by its own detector."""
from __future__ import annotations

from collections.abc import Callable
from typing import Any

import dartpy as dart
import numpy as np

from ..contestant import MOST_CONTACTS, Contestant, Manifold, manifold, matrices


def collision() -> Contestant:
    """Return DART's `CollisionGroup.collide`: up to eight contacts."""
    detector = dart.collision.DARTCollisionDetector()
    option, result = dart.collision.CollisionOption(), dart.collision.CollisionResult()
    option.enableContact, option.maxNumContacts = True, MOST_CONTACTS

    def boxes(p: np.ndarray, q: np.ndarray) -> Callable[..., Any]:
        frames, groups = [], []
        for size in (p, q):
            frame = dart.dynamics.SimpleFrame()
            frame.setShape(dart.dynamics.BoxShape(size))
            group = detector.createCollisionGroup()
            group.addShapeFrame(frame)
            frames.append(frame)
            groups.append(group)
        one, two = frames

        def ask(a: np.ndarray, b: np.ndarray, matrix_a: np.ndarray, matrix_b: np.ndarray) -> None:
            one.setTranslation(a)
            one.setRotation(matrix_a)
            two.setTranslation(b)
            two.setRotation(matrix_b)
            result.clear()
            groups[0].collide(groups[1], option, result)
        return ask

    def read(_: Any) -> Manifold:
        # DART's normals point from the second object to the first.
        return manifold((c.point, -np.array(c.normal), c.penetrationDepth)
                        for c in map(result.getContact, range(result.getNumContacts())))

    return Contestant(name='DART collide', call='CollisionGroup.collide', package='dartpy',
                      returns='up to 8 points with depths, normals',
                      boxes=boxes, at=matrices, read=read)


ENGINES = [collision]

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""FCL through python-fcl."""
from __future__ import annotations

from collections.abc import Callable
from typing import Any

import fcl
import numpy as np

from ..contestant import MOST_CONTACTS, Contestant, Manifold, manifold, wxyz


def collision() -> Contestant:
    """Return python-fcl's raw call, `collide` of two boxes."""
    request = fcl.CollisionRequest(num_max_contacts=MOST_CONTACTS, enable_contact=True)

    def boxes(p: np.ndarray, q: np.ndarray) -> Callable[..., Any]:
        one, two = (fcl.CollisionObject(fcl.Box(*size)) for size in (p, q))

        def ask(a: np.ndarray, b: np.ndarray, quat_a: np.ndarray, quat_b: np.ndarray) -> Any:
            one.setTranslation(a)
            one.setQuatRotation(quat_a)
            two.setTranslation(b)
            two.setQuatRotation(quat_b)
            result = fcl.CollisionResult()
            fcl.collide(one, two, request, result)
            return result
        return ask

    def read(result: Any) -> Manifold:
        return manifold((c.pos, c.normal, c.penetration_depth) for c in result.contacts)

    return Contestant(name='python-fcl collide', package='python-fcl',
                      call='setTranslation, setQuatRotation, fcl.collide, enable_contact',
                      returns='up to 8 points with depths, normals', boxes=boxes, at=wxyz,
                      read=read)


ENGINES = [collision]

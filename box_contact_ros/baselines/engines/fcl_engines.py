"""FCL through python-fcl."""
from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import fcl
import numpy as np

from ...scene.pose_sets import Pairs
from .engine import APART, MOST_CONTACTS, Engine, Manifold, per_sizes, rows, wxyz


def collision() -> Engine:
    """Return python-fcl's `collide` of two boxes."""
    request = fcl.CollisionRequest(num_max_contacts=MOST_CONTACTS, enable_contact=True)

    def ask(one: Any, two: Any, a: np.ndarray, b: np.ndarray, quat_a: np.ndarray,
            quat_b: np.ndarray) -> Any:
        one.setTransform(fcl.Transform(quat_a, a))
        two.setTransform(fcl.Transform(quat_b, b))
        result = fcl.CollisionResult()
        fcl.collide(one, two, request, result)
        return result

    def prepare(pairs: Pairs) -> list[Callable[[], Any]]:
        boxes = per_sizes(lambda p, q: (fcl.CollisionObject(fcl.Box(*p)),
                                        fcl.CollisionObject(fcl.Box(*q))))
        return [partial(ask, *boxes(p, q), *wxyz(a, b)) for a, b, p, q in rows(pairs)]

    def read(result: Any) -> Manifold:
        contacts = result.contacts
        if not contacts:
            return APART
        return Manifold(np.array([c.pos for c in contacts]),
                        np.array([c.normal for c in contacts]),
                        np.array([c.penetration_depth for c in contacts]))

    return Engine(name='python-fcl collide', call='fcl.collide, enable_contact',
                  returns='up to 8 points with depths, normals', package='python-fcl',
                  choices=('deepest', 'mean', 'patch centroid'), prepare=prepare, read=read)


ENGINES = [collision]

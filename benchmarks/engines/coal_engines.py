# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Coal, which grew out of FCL: its deepest point, and its contact patches."""
from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import coal
import numpy as np

from ..contestant import APART, MOST_CONTACTS, Contestant, Manifold, manifold, matrices


def collision(patches: bool) -> Contestant:
    """Return Coal's collision: the deepest point; or the polygon of its contact patch after it."""
    request, result = coal.CollisionRequest(), coal.CollisionResult()
    request.enable_contact = True
    request.num_max_contacts = MOST_CONTACTS
    patch_request, patch_result = coal.ContactPatchRequest(), coal.ContactPatchResult()

    def boxes(p: np.ndarray, q: np.ndarray) -> Callable[..., Any]:
        one, two = coal.Box(*p), coal.Box(*q)
        collide, cut = coal.ComputeCollision(one, two), coal.ComputeContactPatch(one, two)
        at_one, at_two = coal.Transform3s(), coal.Transform3s()

        def ask(a: np.ndarray, b: np.ndarray, matrix_a: np.ndarray, matrix_b: np.ndarray,
                kept: Any = (one, two)) -> None:  # Coal's queries do not keep the shapes alive
            at_one.setTranslation(a)
            at_one.setRotation(matrix_a)
            at_two.setTranslation(b)
            at_two.setRotation(matrix_b)
            result.clear()
            collide(at_one, at_two, request, result)
            if patches:
                patch_result.clear()
                cut(at_one, at_two, result, patch_request, patch_result)
        return ask

    def read(_: Any) -> Manifold:
        if not result.numContacts():
            return APART
        contact = result.getContact(0)
        normal, depth = np.array(contact.normal), -contact.penetration_depth
        if not patches or not patch_result.numContactPatches():
            return manifold([(contact.pos, normal, depth)])
        patch = patch_result.getContactPatch(0)
        return manifold((patch.getPoint(k), normal, depth) for k in range(patch.size()))

    if patches:
        return Contestant(name='Coal ComputeCollision, contact patch',
                          call='coal.ComputeCollision, coal.ComputeContactPatch',
                          returns='polygon, normal', patch='area', package='coal',
                          choices=('mean', 'patch centroid'), boxes=boxes, at=matrices, read=read)
    return Contestant(name='Coal ComputeCollision', call='coal.ComputeCollision, enable_contact',
                      returns='deepest point, depth, normal', choices=('its point',),
                      package='coal', boxes=boxes, at=matrices, read=read)


ENGINES = [partial(collision, False), partial(collision, True)]

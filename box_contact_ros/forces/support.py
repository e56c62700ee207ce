# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Support: which boxes carry a box, on how much of its base, and whether it stands.

The patches are those of the boxes' faces. Weights, friction and what boxes carry play no part: see
`inspect_plan`.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..core import DEPTH_FLOOR, native
from ..solver.checks import as_boxes, as_floats, as_places, as_whole, short_repr
from ..solver.contact import Contacts
from ..solver.faces import TOLERANCE, as_tolerance, face_patches
from ..solver.pose import rotation_matrix

UPRIGHT = 0.9
"""Least cosine between `up` and the normal of a contact that carries: 26°, which friction 0.5
holds."""


@dataclass(frozen=True)
class Support:
    """What carries each of n boxes. The ground has share 1, margin infinity, and stands."""

    carried_by: np.ndarray
    """(m, 2) the lower and the upper box of each contact that carries, by index."""
    share: np.ndarray
    """(n,) area of the contacts that carry a box, divided by the area of its base."""
    margin: np.ndarray
    """(n,) how far the centre is inside the hull of these contacts [m]; below 0: outside it."""
    stands: np.ndarray
    """(n,) bool: the margin exceeds the tolerance and the depth of the deepest contact that carries
    the box, and all boxes that carry it stand."""


def support(sizes: ArrayLike, poses: ArrayLike, pairs: ArrayLike, contacts: Contacts, *,
            ground: ArrayLike = (), up: ArrayLike = (0.0, 0.0, 1.0),
            tolerance: float = TOLERANCE) -> Support:
    """Return what carries each of n boxes, by the contacts of their pairs.

    sizes: full extents (n, 3), or (3,) of all boxes [m]. poses: (n, 7) in a common frame.
    pairs, contacts: (k, 2) and k, as `contacts_of` and `SceneSolver` return them.
    ground: what stands by itself, by index: a box or boxes.
    up: the direction against gravity, of any length.
    tolerance: the gap up to which faces touch [m]. `contacts_of` finds what is so near by the same
    one.

    Raises ValueError, with the field and the value, for bad input, as a pair that is given twice.
    """
    sizes, poses = as_boxes(sizes, poses)
    tolerance = as_tolerance(tolerance, sizes)
    count = len(poses)
    rows = as_places(pairs, 'pairs', count)
    if not isinstance(contacts, Contacts) or len(contacts) != len(rows):
        raise ValueError(f'contacts must be Contacts of {len(rows)} pairs, not '
                         f'{short_repr(contacts)}')
    direction = as_floats(up, 'up', 'a direction (3,)', (3,))
    largest = np.abs(direction).max()
    if not 0.0 < largest < np.inf:
        raise ValueError(f'up must have a length, not {short_repr(up)}')
    on_ground = np.zeros(count, bool)
    for box in ground if np.iterable(ground) else [ground]:
        on_ground[as_whole(box, 'ground', 0, count - 1)] = True
    direction = direction / largest
    direction = direction / np.linalg.norm(direction)
    keys = np.sort(rows.min(axis=1) * count + rows.max(axis=1))
    if (twice := keys[:-1][keys[1:] == keys[:-1]]).size:
        raise ValueError(f'pairs has boxes {divmod(int(twice[0]), count)} twice')

    slope = contacts.normal @ direction
    carries = contacts.colliding & (np.abs(slope) >= UPRIGHT)
    contacts, slope, rows = contacts[carries], slope[carries], rows[carries]
    patches = face_patches(sizes, poses, rows, contacts.normal, tolerance)
    carried_by = np.where(slope[:, None] > 0.0, rows, rows[:, ::-1])
    lower, upper = carried_by.T

    base = base_areas(sizes, poses, direction)
    share = np.bincount(upper, patches.area * np.abs(slope), minlength=count) / base
    across = across_of(direction)
    wide = patches.width > tolerance  # boxes beside each other may overlap by it
    margin = hull_margins(patches.polygon[wide] @ across.T, upper[wide], poses[:, :3] @ across.T)
    share[on_ground], margin[on_ground] = 1.0, np.inf
    # The patch below an edge is a strip. Its width is the tolerance and the depth, at most.
    inside = margin > tolerance + deepest(sizes, carried_by, contacts.separation, upper, count)
    return Support(carried_by, share, margin, standing(lower, upper, inside, on_ground))


def base_areas(sizes: np.ndarray, poses: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Return the areas (n,) of the faces most across `up`, as seen along it [m²]."""
    turned = np.abs(up @ rotation_matrix(poses[:, 3:]))
    face = turned.argmax(axis=1)
    rows = np.arange(len(sizes))
    return sizes.prod(axis=1) / sizes[rows, face] * turned[rows, face]


def across_of(direction: np.ndarray) -> np.ndarray:
    """Return two unit vectors (2, 3) across a direction, and across each other."""
    return np.linalg.svd(direction[None])[2][1:]


def deepest(sizes: np.ndarray, pairs: np.ndarray, separation: np.ndarray, upper: np.ndarray,
            count: int) -> np.ndarray:
    """Return the depth (n,) of the deepest contact that carries each of so many [m].

    upper: what each pair (k, 2) carries. Boxes that merely touch count as pressed together by the
    solver's share of the larger one.
    """
    depth = np.zeros(count)
    longest = sizes.max(axis=1)[pairs].max(axis=1)
    np.maximum.at(depth, upper, np.maximum(-separation, DEPTH_FLOOR * longest))
    return depth


def hull_margins(points: np.ndarray, upper: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return how far each of n places (n, 2) is inside the hull of what carries it [m].

    points: (k, h, 2) of k patches. upper: (k,) which of the n each patch carries. Outside, it is
    below 0; −infinity: nothing carries it.
    """
    order = np.argsort(upper, kind='stable')
    first = np.searchsorted(upper[order], np.arange(len(at) + 1))
    return native.hull_depths(np.ascontiguousarray(points[order].reshape(-1, 2)),
                              first * points.shape[1], np.ascontiguousarray(at))


def standing(lower: np.ndarray, upper: np.ndarray, inside: np.ndarray, on_ground: np.ndarray,
             ) -> np.ndarray:
    """Return which of n stand: from the ground up, so a ring does not."""
    stands = on_ground
    while True:
        leans = ~inside
        leans[upper[~stands[lower]]] = True
        higher = on_ground | ~leans
        if np.array_equal(higher, stands):
            return stands
        stands = higher

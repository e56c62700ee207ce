# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Support: which boxes carry a box, on how much of its base, and whether it stands.

A patch is taken as the rectangle that has its centroid and its moments across `up`. This is exact
for boxes with parallel edges. Weights, friction and what boxes carry play no part: see PatchForces.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..core import DEPTH_FLOOR, SQUARE_SLACK
from ..solver.checks import as_boxes, as_floats, as_places, as_whole, short_repr
from ..solver.contact import Contacts, patch_areas
from ..solver.pose import rotation_matrix

UPRIGHT = 0.9
"""Least cosine between `up` and the normal of a contact that carries: 26°, which friction 0.5
holds."""
_CORNERS = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]])


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
    """(n,) bool: the centre is inside, and all boxes that carry the box stand."""


def support(sizes: ArrayLike, poses: ArrayLike, pairs: ArrayLike, contacts: Contacts, *,
            ground: ArrayLike = (), up: ArrayLike = (0.0, 0.0, 1.0)) -> Support:
    """Return what carries each of n boxes, by the contacts of their pairs.

    sizes: full extents (n, 3), or (3,) of all boxes [m]. poses: (n, 7) in a common frame.
    pairs, contacts: (k, 2) and k, as `contacts_of` and `SceneSolver` return them.
    ground: what stands by itself, by index: a box or boxes.
    up: the direction against gravity, of any length.

    Raises ValueError, with the field and the value, for bad input, as a pair that is given twice.
    """
    sizes, poses = as_boxes(sizes, poses)
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
    contacts, slope = contacts[carries], slope[carries]
    if not np.isfinite(contacts.covariance).all():
        raise ValueError('contacts must have covariances: solve them with patch=True')
    carried_by = np.where(slope[:, None] > 0.0, rows[carries], rows[carries, ::-1])
    lower, upper = carried_by.T

    turned = np.abs(direction @ rotation_matrix(poses[:, 3:]))
    base = sizes.prod(axis=1) / sizes[np.arange(count), turned.argmax(axis=1)]
    share = np.bincount(upper, patch_areas(contacts), minlength=count) / base
    margin = np.full(count, -np.inf)
    smaller = np.where(base[lower] < base[upper], lower, upper)
    corners = _corners(contacts, poses[upper, :3], poses[smaller, 3:], direction)
    order = np.argsort(upper, kind='stable')
    boxes, first = np.unique(upper[order], return_index=True)
    for box, own in zip(boxes, np.split(corners[order], first[1:])):
        margin[box] = _depth_inside(own.reshape(-1, 2))
    share[on_ground], margin[on_ground] = 1.0, np.inf
    # Of boxes that merely touch, the solver's depth is a share of the larger one. An edge below the
    # centre is then a patch so wide: it carries nothing.
    longest = sizes.max(axis=1)
    scale = longest.copy()
    np.maximum.at(scale, upper, longest[lower])
    inside = margin > DEPTH_FLOOR * scale
    return Support(carried_by, share, margin, _standing(carried_by, inside, on_ground))


def _standing(carried_by: np.ndarray, inside: np.ndarray, on_ground: np.ndarray) -> np.ndarray:
    """Return which boxes (n,) stand: from the ground up, so a ring of boxes does not."""
    lower, upper = carried_by.T
    stands = on_ground
    while True:
        leans = ~inside
        leans[upper[~stands[lower]]] = True
        higher = on_ground | ~leans
        if np.array_equal(higher, stands):
            return stands
        stands = higher


def _corners(contacts: Contacts, centre: np.ndarray, turn: np.ndarray,
             up: np.ndarray) -> np.ndarray:
    """Return the corners (k, 4, 2) of patches across `up`, from centres (k, 3).

    Squares have the sides of the boxes with quaternions `turn` (k, 4).
    """
    across = np.linalg.svd(up[None])[2][1:]  # two unit vectors
    moments = across @ contacts.covariance @ across.T
    mean = np.trace(moments, axis1=1, axis2=2) / 2.0
    off, mixed = (moments[:, 0, 0] - moments[:, 1, 1]) / 2.0, moments[:, 0, 1]
    edges = rotation_matrix(turn)
    level = np.abs(up @ edges).argmin(axis=1)
    edge = edges[np.arange(len(edges)), :, level] @ across.T
    is_square = np.hypot(off, mixed) < SQUARE_SLACK * mean
    angle = np.where(is_square, np.arctan2(edge[:, 1], edge[:, 0]), np.arctan2(mixed, off) / 2.0)
    sine, cosine = np.sin(angle), np.cos(angle)
    axes = np.moveaxis(np.array([[cosine, -sine], [sine, cosine]]), 2, 0)
    variances = np.einsum('kji,kjl,kli->ki', axes, moments, axes)
    half = axes * np.sqrt(3.0 * np.maximum(variances, 0.0))[:, None]  # a rectangle's half edges
    middle: np.ndarray = (contacts.point - centre) @ across.T
    return middle[:, None] + _CORNERS @ half.transpose(0, 2, 1)


def _depth_inside(points: np.ndarray) -> float:
    """Return how far (0, 0) is inside the convex hull of points (m, 2); outside: minus how far."""
    hull = _hull(points)
    edge = np.roll(hull, -1, axis=0) - hull
    length = np.maximum(np.hypot(*edge.T), np.finfo(float).tiny)  # of one point
    offset = (edge[:, 1] * hull[:, 0] - edge[:, 0] * hull[:, 1]) / length
    offset[length < DEPTH_FLOOR * length.max()] = np.inf  # between corners that rounding parts
    if len(hull) > 2 and offset.min() >= 0.0:
        return float(offset.min())
    along = np.clip(-(hull * edge).sum(axis=1) / length**2, 0.0, 1.0)
    return -float(np.hypot(*(hull + along[:, None] * edge).T).min())


def _hull(points: np.ndarray) -> np.ndarray:
    """Return the corners (h, 2) of the convex hull, counter-clockwise: the monotone chain."""
    def chain(ordered: list[tuple[float, float]]) -> list[tuple[float, float]]:
        corners: list[tuple[float, float]] = []
        for x, y in ordered:
            while len(corners) > 1:
                (ax, ay), (bx, by) = corners[-2:]
                if (bx - ax) * (y - ay) > (by - ay) * (x - ax):
                    break
                corners.pop()
            corners.append((x, y))
        return corners[:-1]

    ordered = sorted(set(map(tuple, points.tolist())))
    return np.array((chain(ordered) + chain(ordered[::-1])) or ordered)

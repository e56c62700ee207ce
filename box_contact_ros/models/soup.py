# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Model `soup-N`: polygon soup, the method that the source paper compares itself with (section 5).

Each face is split in N × N rectangles of two triangles: 12 N² triangles per box, the paper's column
"triangles/face". FCL stands for the paper's RAPID and finds all pairs of triangles that meet, with
a bounding volume tree per box. The rest replaces the paper's "additional algorithm":

- Contacts. FCL gives the one or two deepest corners of two triangles that meet, and a normal. The
  normal is the outward one of A's triangle, or the reverse of B's, of the less deeply crossed.
- Point: the mean of the contacts' positions. A weight is the smaller area of the two triangles
  [m²], the most in which they can meet.
- Normal: the mean of the contacts' normals with the same weights, made unit.
- Separation and verdict: SAT's. FCL's depths are those of the triangles' far corners and are off
  by a triangle's size: `docs/results/paper_tables.md` has figures.

Some contacts have no pair of triangles: a box inside another, and some exact touches. Others have
more than MOST_CONTACTS. There, and where the normals cancel, SAT's normal and the exact point are
the answer. `Soup.fallbacks` counts them.
"""
from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import fcl
import numpy as np

from ..core import native
from ..solver.contact import Contacts, without_patch

Size = tuple[float, ...]  # three full extents [m], as a key of what is kept

KEPT_SIZES = 64  # of which a solver keeps what it has made; a scene has few
MOST_CONTACTS = 1 << 15
"""Contacts that are asked for, in a third of a second. Two cubes exactly on top of each other have
more from N = 12 on, and took 23 s with N = 64."""

CANCELLED = 1e-9
"""Length of a mean normal up to which it has cancelled: a mean of 1e6 unit vectors is rounded by
1e-10 at worst."""


class Mesh(NamedTuple):
    """A box as polygon soup."""

    model: fcl.BVHModel  # triangles and tree, in the box's own frame
    areas: np.ndarray  # (12 N²,) of the triangles, in FCL's numbering [m²]


def triangles(size: Sequence[float] | np.ndarray, divisions: int) -> np.ndarray:
    """Return corners (12 N², 3, 3) [m] of a box's triangles, counter-clockwise from outside.

    They are in the box's own frame. size: three full extents [m].
    """
    half = 0.5 * np.asarray(size, dtype=np.float64)
    faces = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        # The same numbers on all faces, so that faces share their edges to the last bit.
        along_u = np.linspace(-half[u], half[u], divisions + 1)
        along_v = np.linspace(-half[v], half[v], divisions + 1)
        grid = np.empty((divisions + 1, divisions + 1, 3))
        grid[..., u] = along_u[:, None]
        grid[..., v] = along_v[None, :]
        for side in (1.0, -1.0):
            grid[..., axis] = side * half[axis]
            a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
            # u, v and the axis are right-handed: from u to v is counter-clockwise from outside.
            pairs = ((a, b, c), (a, c, d)) if side > 0.0 else ((a, c, b), (a, d, c))
            faces += [np.stack(corners, axis=2).reshape(-1, 3, 3) for corners in pairs]
    return np.concatenate(faces)


@functools.lru_cache(maxsize=KEPT_SIZES)
def mesh(size: Size, divisions: int) -> Mesh:
    """Return the soup of a box; kept, as a scene has few sizes."""
    corners = triangles(size, divisions)
    model = fcl.BVHModel()
    model.beginModel(len(corners), 3 * len(corners))
    model.addSubModel(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    model.endModel()
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return Mesh(model, 0.5 * np.linalg.norm(across, axis=1))


def collide(first: fcl.CollisionObject, second: fcl.CollisionObject) -> list[fcl.Contact]:
    """Return the contacts of two soups; of MOST_CONTACTS, there are more.

    `b1`, `b2` number the triangles, `pos` [m] is in the frame in which the soups were placed,
    `normal` points from the first to the second.
    """
    result = fcl.CollisionResult()
    fcl.collide(first, second, fcl.CollisionRequest(
        num_max_contacts=MOST_CONTACTS, enable_contact=True), result)
    return result.contacts


def point_and_normal(contacts: Sequence[fcl.Contact], areas_a: np.ndarray, areas_b: np.ndarray,
                     ) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the area-weighted mean point (3,) [m] and normal (3,) of contacts, in their frame.

    None where there are no contacts or the normals cancel.
    """
    if not contacts:
        return None
    weights = np.minimum(areas_a[[contact.b1 for contact in contacts]],
                         areas_b[[contact.b2 for contact in contacts]])
    weights /= weights.sum()
    vectors = np.concatenate([[contact.pos, contact.normal] for contact in contacts], axis=1)
    point, normal = (vectors.reshape(2, -1, 3) * weights[:, None]).sum(axis=1)
    length = float(np.linalg.norm(normal))
    return None if length <= CANCELLED else (point, normal / length)


class Soup:
    """Polygon soup of N divisions per edge, for any sizes.

    fallbacks: pairs in contact so far that the soup could not answer, and `exact` did.
    """

    def __init__(self, divisions: int) -> None:
        self.divisions, self.fallbacks = divisions, 0
        self._exact = native.Exact()

        # Each solver keeps objects of its own, one for A and one for B: placing moves them. Their
        # meshes are kept with them, as other solvers' may displace them in `mesh`.
        @functools.lru_cache(maxsize=KEPT_SIZES)
        def made(size: Size, box: int) -> tuple[Mesh, fcl.CollisionObject]:
            soup = mesh(size, divisions)
            return soup, fcl.CollisionObject(soup.model)
        self._made = made

    def __reduce__(self) -> tuple[type[Soup], tuple[int]]:
        """Pickle the divisions."""
        return Soup, (self.divisions,)

    def place(self, a: np.ndarray, b: np.ndarray, size_a: Size, size_b: Size,
              ) -> tuple[fcl.CollisionObject, fcl.CollisionObject]:
        """Return objects of these sizes at poses (7,), about A's centre; until the next call.

        Directions are the common frame's. B − A is formed in float64 here, so that FCL adds no
        rounding far from the origin.
        """
        first, second = self._made(size_a, 0)[1], self._made(size_b, 1)[1]
        for placed, position, quaternion in ((first, np.zeros(3), a[3:]),
                                             (second, b[:3] - a[:3], b[3:])):
            x, y, z, w = quaternion / np.linalg.norm(quaternion)
            placed.setTransform(fcl.Transform(np.array([w, x, y, z]), position))
        return first, second

    def solve(self, a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
              threads: int = 1) -> tuple[Contacts, int]:
        """Return contacts for poses (n, 7), sizes (n or 1, 3), and the first refused row or −1."""
        exact, refused = self._exact.solve(a, b, size_a, size_b, threads)
        merged = replace(without_patch(exact), axis=np.full(len(exact), -1, np.int32))
        for row in np.flatnonzero(merged.colliding) if refused < 0 else ():
            sizes = tuple(size_a[row % len(size_a)]), tuple(size_b[row % len(size_b)])
            contacts = collide(*self.place(a[row], b[row], *sizes))
            answer = None if len(contacts) >= MOST_CONTACTS else point_and_normal(
                contacts, self._made(sizes[0], 0)[0].areas, self._made(sizes[1], 1)[0].areas)
            if answer is None:
                self.fallbacks += 1
            else:
                merged.point[row], merged.normal[row] = a[row, :3] + answer[0], answer[1]
        return merged, refused

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A model of your own, measured like ours: `accuracy --model own_model:Middle`.

The class is called with the full extents (1, 3) [m] of both boxes, and needs one method, `solve`.
This one answers with the middle of the overlap of both bounding boxes.
"""
import numpy as np

from box_contact_ros import Contacts, ContactSolver


class Middle:
    """Verdict, depth and normal of `exact`; the point is the middle of the bounding boxes."""

    def __init__(self, size_a: np.ndarray, size_b: np.ndarray) -> None:
        self.exact = ContactSolver(size_a[0], size_b[0], model='exact')

    def solve(self, a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
              threads: int = 1) -> tuple[Contacts, int]:
        """Return the contacts of poses (n, 7) and sizes (n or 1, 3), and −1: no row is refused."""
        sizes_a, sizes_b = (np.broadcast_to(size, (len(a), 3)) for size in (size_a, size_b))
        found = self.exact.batch(a, b, size_a=sizes_a, size_b=sizes_b, threads=threads)
        reach_a, reach_b = reach(a, sizes_a), reach(b, sizes_b)
        lowest = np.maximum(a[:, :3] - reach_a, b[:, :3] - reach_b)
        highest = np.minimum(a[:, :3] + reach_a, b[:, :3] + reach_b)
        touching = found.colliding[:, None]
        return found._replace(point=np.where(touching, (lowest + highest) / 2.0, np.nan),
                              volume=np.where(found.colliding, np.nan, 0.0),
                              covariance=np.full((len(a), 3, 3), np.nan)), -1


def reach(poses: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Return the half extents (n, 3) of the boxes' bounding boxes along the common axes."""
    x, y, z, w = (poses[:, 3:] / np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)).T
    rotation = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                         [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                         [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
    return np.einsum('ijn,nj->ni', np.abs(rotation), sizes / 2.0)

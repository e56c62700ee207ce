# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A model of your own: an object with `solve`, which `ContactSolver` asks like its own models.

Run it with `python own_model.py`. It prints:

    exact   [0.65 0.12 0.96]
    between [0.25 0.12 0.98]

This model takes verdict, depth and normal from `exact`. Its point is the middle of the centres.
"""
from dataclasses import replace

import numpy as np

from box_contact_ros import Contacts, ContactSolver, make_model


class Between:
    """The point is the middle between the centres of both boxes."""

    def __init__(self) -> None:
        self.exact = make_model('exact')

    def solve(self, a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
              threads: int = 1) -> tuple[Contacts, int]:
        """Return the contacts of poses (n, 7) and sizes (n or 1, 3), and the first refused row."""
        found, refused = self.exact.solve(a, b, size_a, size_b, threads)
        middle = (a[:, :3] + b[:, :3]) / 2.0
        point = np.where(found.colliding[:, None], middle, np.nan)
        # It knows nothing of the patch: NaN, and no volume where the boxes are apart.
        return replace(found, point=point, volume=np.where(found.colliding, np.nan, 0.0),
                       covariance=np.full_like(found.covariance, np.nan)), refused


if __name__ == '__main__':
    size, below, tilted = (2.0, 2.0, 2.0), [0, 0, 0, 0, 0, 0, 1], [0.5, 0.25, 1.95, 0, 0.05, 0, 1]
    for name, model in (('exact  ', 'exact'), ('between', Between())):
        print(name, ContactSolver(size, size, model=model)(below, tilted).point.round(2))

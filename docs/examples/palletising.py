# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Does a carton stand? Point, volume and covariance tell: `python docs/examples/palletising.py`.

Each carton is lowered by a millimetre into what it stands on. The overlap's covariance gives the
patch: a rectangle has half lengths of √3 standard deviations. The carton stands if its middle is
above the hull of its patches. The volumes share its weight among them.

It prints:

    left: stands, 300 mm to spare, on pallet 100%
    right: stands, 200 mm to spare, on pallet 100%
    bridge: stands, 200 mm to spare, on left 44%, right 56%
    overhanging: tips, -100 mm to spare, on left 100%
"""
from typing import NamedTuple

import numpy as np

from box_contact_ros import Contacts, ContactSolver

PRESSED = 1e-3  # depth of the overlaps [m]
MARGIN = 0.02  # a carton must stand this far from tipping [m]


class Carton(NamedTuple):
    """A carton: name, full extents [m], place of its middle [m], mass [kg]."""

    name: str
    size: tuple[float, float, float]
    middle: tuple[float, float, float]
    mass: float


PALLET = Carton('pallet', (1.2, 0.8, 0.144), (0.0, 0.0, 0.072), 25.0)
CARTONS = [
    Carton('left', (0.6, 0.8, 0.3), (-0.3, 0.0, 0.294), 20.0),
    Carton('right', (0.6, 0.4, 0.3), (0.3, 0.2, 0.294), 12.0),
    Carton('bridge', (0.9, 0.4, 0.3), (0.05, 0.2, 0.594), 15.0),
    Carton('overhanging', (0.9, 0.4, 0.3), (0.1, -0.2, 0.594), 15.0),
]


def contacts_below(carton: Carton, others: list[Carton]) -> Contacts:
    """Return the contacts of a pressed carton with others, in one batch; A is the carton."""
    solver = ContactSolver(carton.size, carton.size, model='exact')
    x, y, z = carton.middle
    pose = np.array([x, y, z - PRESSED, 0.0, 0.0, 0.0, 1.0])
    return solver.batch(np.tile(pose, (len(others), 1)),
                        [(*other.middle, 0.0, 0.0, 0.0, 1.0) for other in others],
                        size_b=np.array([other.size for other in others]))


def corners(point: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Return the corners (4, 2) of the rectangle with a patch's centroid and covariance."""
    variances, axes = np.linalg.eigh(covariance[:2, :2])
    half = axes * np.sqrt(3.0 * variances)
    return point[:2] + np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]) @ half.T


def reserve(middle: np.ndarray, points: np.ndarray) -> float:
    """Return how far [m] a place (2,) is inside the hull of points (n, 2); negative: outside."""
    angles = np.radians(np.arange(0.0, 360.0, 0.5))
    directions = np.stack([np.cos(angles), np.sin(angles)])
    return float(((points - middle) @ directions).max(axis=0).min())


def main() -> None:
    """Judge carton by carton."""
    placed = [PALLET]
    for carton in CARTONS:
        found = contacts_below(carton, placed)
        held = found.colliding & (found.normal[:, 2] < -0.9)  # what it stands on
        patches = [corners(point, covariance) for point, covariance in
                   zip(found.point[held], found.covariance[held])]
        left = reserve(np.array(carton.middle[:2]), np.concatenate(patches)) if patches else -1.0
        shares = found.volume[held] / found.volume[held].sum()
        names = [other.name for other, holds in zip(placed, held) if holds]
        on = ', '.join(f'{name} {share:.0%}' for name, share in zip(names, shares))
        print(f'{carton.name}: {"stands" if left > MARGIN else "tips"}, {1e3 * left:.0f} mm '
              f'to spare, on {on}')
        placed.append(carton)


if __name__ == '__main__':
    main()

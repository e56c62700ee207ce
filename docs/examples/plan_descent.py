# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plan a descent by the gradient of the distance: `python docs/examples/plan_descent.py [PICTURE]`.

A container goes down between two stacks that stand askew. At each height it is moved aside and
turned about z until it keeps a clearance of 0.12 m to every container beside it.

It prints:

    straight down: 0.053 m from the stacks
    pushed off:    0.121 m from the stacks, 0.054 m aside, turned by up to 0.13 degrees
"""
import sys

import numpy as np

from box_contact_ros import ContactSolver

SIZE = np.array([12.192, 2.438, 2.591])
CLEARANCE = 0.12  # [m]
HEIGHTS = np.linspace(9.5, 1.3, 83)  # of the load's centre [m]


def pose(x: float, y: float, z: float, yaw: float) -> np.ndarray:
    """Return `x y z qx qy qz qw` of a container that is turned about z [rad]."""
    return np.array([x, y, z, 0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)])


def stacks() -> np.ndarray:
    """Return two stacks of three containers (6, 7), each some centimetres off its place."""
    rng = np.random.default_rng(4)
    return np.array([pose(0.0, side * 2.65 + rng.uniform(-0.12, 0.12), (tier + 0.5) * SIZE[2],
                          np.radians(rng.uniform(-0.5, 0.5)))
                     for side in (-1, 1) for tier in range(3)])


def descend(beside: np.ndarray, clearance: float) -> np.ndarray:
    """Return rows of y [m], yaw [rad] and least distance [m], a row for each height."""
    solver, y, yaw, path = ContactSolver(SIZE, SIZE), 0.0, 0.0, []
    for z in HEIGHTS:
        for _ in range(100):
            load = pose(0.0, y, z, yaw)
            near = solver.distance_batch(beside, np.tile(load, (len(beside), 1)))
            closest = near[int(np.argmin(near.distance))]
            lack = clearance - closest.distance
            if lack <= 1e-6:
                break
            # How the distance changes by y, and by a turn about the load's centre.
            lever = np.cross(closest.point_b - load[:3], closest.normal)
            gradient = np.array([closest.normal[1], lever[2] / SIZE[0]])
            step = lack * gradient / (gradient @ gradient)
            y, yaw = y + step[0], yaw + step[1] / SIZE[0]
        path.append((y, yaw, closest.distance))
    return np.array(path)


def draw(paths: dict[str, np.ndarray], beside: np.ndarray, picture: str) -> None:
    """Draw the stacks and the way down from their end, and the distances."""
    import matplotlib.pyplot as plt

    figure, (view, chart) = plt.subplots(1, 2, figsize=(9, 4.5), layout='constrained')
    load = pose(0.0, paths['pushed off'][-1, 0], HEIGHTS[-1], 0.0)
    for row, colour in [*((row, '#4678aa') for row in beside), (load, '#ee9632')]:
        view.add_patch(plt.Rectangle(row[1:3] - SIZE[1:] / 2, *SIZE[1:], color=colour, alpha=0.5))
    for (name, path), colour in zip(paths.items(), ('#999999', '#ee9632')):
        view.plot(path[:, 0], HEIGHTS, color=colour)
        chart.plot(path[:, 2], HEIGHTS, color=colour, label=name)
    chart.axvline(CLEARANCE, color='#e6146e', linestyle='--', label='clearance')
    aside = np.abs(paths['pushed off'][:, 0]).max()
    figure.suptitle(f'{100 * aside:.0f} cm aside, the load keeps its clearance')
    view.set(xlabel='y [m]', ylabel='height of the centre [m]', xlim=(-4.2, 4.2), ylim=(0, 10))
    chart.set(xlabel='least distance [m]', ylim=(0, 10), xlim=(0, None))
    chart.legend(loc='center right')
    figure.savefig(picture, dpi=110)


if __name__ == '__main__':
    neighbours = stacks()
    ways = {'straight down': descend(neighbours, 0.0), 'pushed off': descend(neighbours, CLEARANCE)}
    straight, pushed = ways.values()
    print(f'straight down: {straight[:, 2].min():.3f} m from the stacks')
    print(f'pushed off:    {pushed[:, 2].min():.3f} m from the stacks, '
          f'{np.abs(pushed[:, 0]).max():.3f} m aside, turned by up to '
          f'{np.degrees(np.abs(pushed[:, 1])).max():.2f} degrees')
    if len(sys.argv) > 1:
        draw(ways, neighbours, sys.argv[1])

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which boxes of a real pallet are not supported? `python docs/examples/palletising.py [PICTURE]`.

Five packing plans of real orders are read from pallets/packing_plans.json. A `SceneSolver` finds
all contacts as arrays. A box is supported if its centre is above the hull of the patches below it:
what it stands on. The overlap's covariance gives each patch: a rectangle has half lengths of √3
standard deviations.

For each order it names the boxes that are not supported, by number. It tells how far inside its
patches the centre of the worst box is. It prints:

    00100408: 26 contacts, worst -87.5 mm, not supported: 25
    00100001: 56 contacts, worst -95.0 mm, not supported: 5 7 9 12 20 27 28 29 36 42
    00100002: 46 contacts, worst -65.0 mm, not supported: 4 10 11 17 34
    00100003: 34 contacts, worst -117.7 mm, not supported: 17 27 28 29
    00100004: 94 contacts, worst -191.4 mm, not supported: 22 24 30 31 39 42 50 51 53 56

With PICTURE, such as pallets.png, it draws them: the less support, the redder. That needs
Matplotlib.
"""
import json
import sys
from pathlib import Path

import numpy as np

from box_contact_ros import Box, Contacts, Scene, SceneSolver

PLANS = Path(__file__).with_name('pallets') / 'packing_plans.json'
FLOOR = Box((4.0, 4.0, 1.0), (0.0, 0.0, -0.5, 0.0, 0.0, 0.0, 1.0))


def read_plan(plan: list[dict]) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Return names, full extents (n, 3) [m] and poses (n, 7) of the items of a plan."""
    names = [f'{entry["item"]["sequence"]} {entry["item"]["product_group"]}' for entry in plan]
    size = np.array([[entry['item'][f'{side}/mm'] for side in ('length', 'width', 'height')]
                     for entry in plan]) / 1000.0
    turned = np.array([entry['orientation'] == 1 for entry in plan])
    size[turned] = size[turned][:, [1, 0, 2]]
    corner = np.array([entry['flb_coordinates'] for entry in plan]) / 1000.0
    return names, size, np.hstack((corner + size / 2.0, np.tile([0.0, 0, 0, 1], (len(plan), 1))))


def corners(contacts: Contacts) -> np.ndarray:
    """Return the corners (k, 4, 2) of rectangles with the patches' centroids and covariances."""
    variances, axes = np.linalg.eigh(contacts.covariance[:, :2, :2])
    half = axes * np.sqrt(3.0 * variances)[:, None, :]
    signs = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]])
    return contacts.point[:, None, :2] + np.einsum('cj,kij->kci', signs, half)


def support(pose: np.ndarray, pairs: np.ndarray, contacts: Contacts) -> np.ndarray:
    """Return how far (n,) [m] each centre is inside the hull of its patches; negative: outside."""
    upright = contacts.normal[:, 2]
    upper = np.where(upright > 0.9, pairs[:, 1], pairs[:, 0])  # normals point from a to b
    standing = np.abs(upright) > 0.9
    angles = np.radians(np.arange(0.0, 360.0, 0.5))
    directions = np.stack([np.cos(angles), np.sin(angles)])
    offsets = corners(contacts)[standing] - pose[upper[standing], None, :2]
    reach = np.full((len(pose) + 1, len(angles)), -np.inf)  # the floor is the last box
    np.maximum.at(reach, upper[standing], (offsets @ directions).max(axis=1))
    return reach[:-1].min(axis=1)


def draw(path: str, plans: list[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> None:
    """Draw sizes, poses and support of each plan; red is not supported, blue 10 cm and more."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 5))
    axis = figure.add_axes((-0.42, -0.6, 1.84, 2.2), projection='3d')  # it leaves wide margins
    for number, (size, pose, left) in enumerate(plans):
        shade = np.clip(left / 0.1, 0.0, 1.0)[:, None]
        colours = (1.0 - shade) * [0.8, 0.1, 0.1] + shade * [0.45, 0.62, 0.8]
        low = pose[:, :3] - size / 2.0 + [1.7 * number, 0.0, 0.0]
        axis.bar3d(*low.T, *size.T, color=colours, edgecolor='0.25', linewidth=0.3)
    axis.set_aspect('equal')
    axis.view_init(elev=12, azim=-72)
    axis.set_axis_off()
    figure.savefig(path, dpi=90)


def main() -> None:
    """Judge order by order."""
    plans = []
    for order, plan in json.loads(PLANS.read_text('utf-8')).items():
        names, size, pose = read_plan(plan)
        boxes = {name: Box(tuple(extents)) for name, extents in zip(names, size.tolist())}
        scene = Scene({**boxes, 'floor': FLOOR}, patterns=(('*', '*'),), pose_array=True)
        answer = SceneSolver(scene, model='exact')(pose)
        left = support(pose, answer.pairs, answer.contacts)
        numbers = ' '.join(names[row].split()[0] for row in np.flatnonzero(left < 0.0))
        print(f'{order}: {answer.touching} contacts, worst {1e3 * left.min():.1f} mm, '
              f'not supported: {numbers}')
        plans.append((size, pose, left))
    if len(sys.argv) > 1:
        draw(sys.argv[1], plans)


if __name__ == '__main__':
    main()

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which boxes of a pallet lack support? `python docs/examples/palletising.py [PLANS [PICTURE]]`.

PLANS is a file like pallets/packing_plans.json, which has the plans of five real orders.
`contacts_of` finds what touches. `support` tells how far inside the hull of what carries it the
centre of each box is.

For each order it names the boxes whose centre is outside, by number. It prints:

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

from box_contact_ros import contacts_of, support

PLANS = Path(__file__).with_name('pallets') / 'packing_plans.json'
FLOOR = (4.0, 4.0, 1.0), (0.0, 0.0, -0.5, 0.0, 0.0, 0.0, 1.0)  # full extents and pose


def read_plan(plan: list[dict]) -> tuple[list[int], np.ndarray, np.ndarray]:
    """Return numbers, full extents (n, 3) [m] and poses (n, 7) of the items of a plan."""
    numbers = [entry['item']['sequence'] for entry in plan]
    size = np.array([[entry['item'][f'{side}/mm'] for side in ('length', 'width', 'height')]
                     for entry in plan]) / 1000.0
    turned = np.array([entry['orientation'] == 1 for entry in plan])
    size[turned] = size[turned][:, [1, 0, 2]]
    corner = np.array([entry['flb_coordinates'] for entry in plan]) / 1000.0
    return numbers, size, np.hstack((corner + size / 2.0, np.tile([0.0, 0, 0, 1], (len(plan), 1))))


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
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else PLANS
    try:
        read = {order: read_plan(plan) for order, plan in json.loads(path.read_bytes()).items()}
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        sys.exit(f'{path}: cannot be read as packing plans: {error!r}')
    plans = []
    for order, (numbers, size, pose) in read.items():
        with_floor = np.vstack((size, FLOOR[0])), np.vstack((pose, FLOOR[1]))
        pairs, contacts = contacts_of(*with_floor)
        left = support(*with_floor, pairs, contacts, ground=len(size)).margin[:-1]
        outside = ' '.join(str(numbers[row]) for row in np.flatnonzero(left < 0.0))
        print(f'{order}: {len(pairs)} contacts, worst {1e3 * left.min():.1f} mm, '
              f'not supported: {outside}')
        plans.append((size, pose, left))
    if len(sys.argv) > 2:
        draw(sys.argv[2], plans)


if __name__ == '__main__':
    main()

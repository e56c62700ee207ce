# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Draw two boxes from above, with the patch that both cover and the contact point in its middle.

It needs Matplotlib, and writes first_contact.png. It prints:

    point [1.     0.     1.2905]
"""
from __future__ import annotations

from box_contact_ros.extras import require

require('report')  # what is missing is named in one line
import numpy as np
from matplotlib import pyplot as plt

from box_contact_ros import ContactSolver

CONTAINER = (12.192, 2.438, 2.591)  # [m]
LOAD, STACK = (2, 0, 2.581, 0, 0, 0, 1), (0, 0, 0, 0, 0, 0, 1)


def main() -> None:
    """Ask for the contact, and draw the rectangles."""
    contact = ContactSolver(CONTAINER, CONTAINER)(LOAD, STACK)
    patch = 2 * np.sqrt(3 * np.diag(contact.covariance))  # a cuboid's edges, by their deviations
    figure, axes = plt.subplots(figsize=(6.4, 2.4), layout='constrained')
    for middle, size, name, colour in ((STACK, CONTAINER, 'stack', '#4678aa'),
                                       (LOAD, CONTAINER, 'load', '#ee9632'),
                                       (contact.point, patch, 'patch', '#e6146e')):
        corner = (middle[0] - size[0] / 2, middle[1] - size[1] / 2)
        filled = name == 'patch'
        axes.add_patch(plt.Rectangle(corner, *size[:2], fill=filled, alpha=0.3 if filled else 1.0,
                                     color=colour, linewidth=2, label=name))
    axes.plot(*contact.point[:2], 'o', color='#e6146e', label='point')
    axes.set(aspect='equal', xlabel='x [m]', ylabel='y [m]',
             title='The point is the middle of the patch')
    axes.legend(ncols=4, loc='lower center', bbox_to_anchor=(0.5, -0.75), frameon=False)
    figure.savefig('first_contact.png')
    print('point', contact.point.round(4) + 0)


if __name__ == '__main__':
    main()

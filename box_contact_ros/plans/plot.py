# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A picture of a plan, coloured by what is wrong with each box."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..extras import require
from ..solver.pose import rotation_matrix
from .plan import Plan
from .room import are_walls

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = {'sound': '#8fa8bf', 'not judged': '#cdb4db', 'overlap': '#003049',
           'outside': '#0077b6', 'hangs': '#9d0208',
           'unsupported': '#e63946', 'tips under its load': '#c77dff', 'slides': '#5a189a',
           'goes with what falls': '#f4a261', 'overloaded': '#ffd166', 'ground': '#d9d9d9'}
"""By verdict, in the order of the legend."""
MOST_LABELS = 80
"""More boxes get no figures: nobody could read them."""
_FACES = np.array([[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4],
                   [1, 3, 7, 5]])
_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


def plot(plan: Plan, verdicts: np.ndarray, load: np.ndarray, title: str) -> Figure:
    """Return a figure of the plan, coloured by verdict (n,), with the load (n,) [N] in kN.

    It needs Matplotlib, the extra `report`.
    """
    require('report')
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    corners = plan.poses[:, None, :3] + np.einsum(
        'nij,npj->npi', rotation_matrix(plan.poses[:, 3:]), _CORNERS * plan.sizes[:, None])
    drawn = ~np.isin(np.arange(len(plan)), plan.ground)
    drawn = drawn if drawn.any() else ~drawn
    low, high = (end(corners[drawn].reshape(-1, 3), axis=0, initial=start) for end, start in (
        (np.min, np.inf), (np.max, -np.inf)))
    # The ground is often a floor of many metres.
    drawn |= (np.ptp(corners, axis=1) <= 2.0 * (high - low)).all(axis=1)
    drawn &= ~are_walls(plan)

    figure = Figure(figsize=(9, 6), layout='constrained')
    axes = figure.add_subplot(projection='3d')
    axes.add_collection3d(Poly3DCollection(
        corners[drawn][:, _FACES].reshape(-1, 4, 3), edgecolors='0.25', linewidths=0.3,
        facecolors=np.repeat([COLOURS[verdict] for verdict in verdicts[drawn]], len(_FACES))))
    loaded = np.flatnonzero(drawn & (load > 0.0)) if len(plan) <= MOST_LABELS else ()
    for box in loaded:
        axes.text(*corners[box].mean(axis=0), f'{load[box] / 1e3:.3g}', fontsize=7,
                  ha='center', zorder=len(plan))
    if drawn.any():
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]),
                 xlabel='x [m]', ylabel='y [m]', zlabel='z [m]')
        axes.xaxis.labelpad = 12.0
        axes.set_aspect('equal')
        axes.set_box_aspect(high - low, zoom=1.2)
        for axis, length in zip('xyz', high - low):  # labels of a short axis would overlap
            axes.locator_params(axis, nbins=max(1, round(4 * length / (high - low).max())))
    shown = [verdict for verdict in COLOURS if verdict in verdicts[drawn]]
    axes.legend(handles=[Patch(color=COLOURS[verdict], label=verdict) for verdict in shown],
                loc='upper left', fontsize=8)
    numbers = '\nnumbers: load on top [kN]' if len(loaded) else ''
    axes.set_title(title + numbers, fontsize=9)
    return figure

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is wrong with a plan, and what each of its boxes carries: the answer of `inspect_plan`."""
from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .plan import Plan

if TYPE_CHECKING:
    from matplotlib.figure import Figure

UNSOUND_FAULTS = ('gap', 'twice', 'cut')
"""Faults of a file with which a plan is not sound. The others are told."""
CAUSES = ('hangs', 'unsupported', 'tips under its load', 'slides', 'goes with what falls',
          'overloaded')
"""What may be wrong with a box, the worst first."""


@dataclass(frozen=True, eq=False)
class Inspection:
    """What is wrong with a plan of n boxes, and what each of them carries.

    Of boxes without masses, loads, pressures and loaded margins are NaN. Of those on the ground,
    shares are 1 and margins infinity.
    """

    plan: Plan
    tolerance: float
    """[m]."""
    acceleration: np.ndarray
    """(3,) that the boxes feel, gravity included [m/s²]."""
    overlaps: np.ndarray
    """(o, 2) pairs of boxes that overlap by more than the tolerance, by index."""
    depths: np.ndarray
    """(o,) how deep [m]."""
    stands: np.ndarray
    """(n,) bool."""
    cause: np.ndarray
    """(n,) why a box does not stand, or is overloaded; '' for the others."""
    share: np.ndarray
    """(n,) area by which a box is carried, divided by that of its base."""
    margin: np.ndarray
    """(n,) how far the centre of mass is inside the hull of what carries the box [m]; below 0:
    outside it. That of its body, if the box is a part of one."""
    loaded_margin: np.ndarray
    """(n,) the same of the centre of pressure below the box, with what is on top [m]."""
    load: np.ndarray
    """(n,) on top of each box [N]."""
    pressure: np.ndarray
    """(n,) the greatest on top of each box [Pa]; NaN where corners bear."""
    carried_by: np.ndarray
    """(k, 2) the lower and the upper box of each patch."""
    loads: np.ndarray
    """(k,) on each patch, along its normal [N]."""
    corners: np.ndarray
    """(k, 4, 3) of the rectangle around each patch, in turn [m]."""
    corner_loads: np.ndarray
    """(k, 4) the parts of `loads` at the corners: bilinear, never below 0 [N]."""
    mass: float
    """Of all boxes [kg]."""
    centre_of_mass: np.ndarray
    """(3,) [m]."""

    @property
    def sound(self) -> bool:
        """Whether all boxes stand, none overlaps or is overloaded, and the file is whole."""
        return not (len(self.overlaps) or (self.cause != '').any()
                    or any(fault.kind in UNSOUND_FAULTS for fault in self.plan.faults))

    def __str__(self) -> str:
        """Return a line for each fault, the worst first, and one for the whole plan."""
        from .report import rows_of, summary_of
        return '\n'.join((*map(str, rows_of(self)), summary_of(self)))

    def plot(self) -> Figure:
        """Return a figure of the plan, coloured by cause, with the load on each box in kN.

        It needs Matplotlib, the extra `report`.
        """
        from .plot import plot
        return plot(self)

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What every law from contacts to forces shares: gravity, friction, and a held wrench.

A wrench belongs to the time at which its contact was asked for. `HeldWrench` holds it between
ticks, and over ticks whose answer was lost.

SI units; a wrench (6,) is a force [N], then a torque [N m].
"""
from __future__ import annotations

from collections import deque

import numpy as np

GRAVITY = 9.81
"""Gravitational acceleration [m/s²]: what the static penetration is reckoned with."""

FRICTION = 0.5
"""Coulomb's μ [1], steel on steel, dry."""

SLIP_SPEED = 0.1
"""v_s [m/s]: friction grows in proportion to the slip up to here, or its sign would switch at rest.
The price: a load at rest on a slope s creeps at v_s·s/μ."""

TIME_ROUNDING = 1e-9
"""Times [s] that differ by less are the same: sums of ticks and latencies are rounded, and a
nanosecond is far below every physics step."""


class HeldWrench:
    """The wrench that acts: that of the newest answer that is due, until the next one is.

    Zeros before the first. A tick without an answer changes nothing.
    """

    def __init__(self) -> None:
        self.current = np.zeros(6)
        self._asked = -np.inf
        self._due: deque[tuple[float, np.ndarray]] = deque()

    def answer(self, wrench: np.ndarray, *, asked: float, due: float) -> None:
        """Note the wrench (6,) of a contact asked for at `asked` [s], to act from `due` [s] on.

        Answers that were overtaken by that to a later question are dropped.
        """
        if asked < self._asked:
            return
        self._asked = asked
        while self._due and self._due[-1][0] > due:
            self._due.pop()
        self._due.append((due, wrench))

    def at(self, time: float) -> np.ndarray:
        """Return the wrench (6,) that acts at `time` [s]; times must not decrease."""
        while self._due and self._due[0][0] <= time + TIME_ROUNDING:
            self.current = self._due.popleft()[1]
        return self.current

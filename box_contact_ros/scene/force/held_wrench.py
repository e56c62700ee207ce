# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What acts between questions, where answers come late: the newest answer that is due.

`InFlight` has answers of any kind. `HeldWrench` has wrenches, for clients that apply one until the
next. A tick whose answer was lost changes nothing.
"""
from __future__ import annotations

from collections import deque
from typing import Generic, TypeVar

import numpy as np

from ...solver.checks import as_floats

TIME_ROUNDING = 1e-9
"""Times [s] that differ by less are the same: sums of ticks and latencies are rounded, and a
nanosecond is far below every physics step."""

Kind = TypeVar('Kind')


class InFlight(Generic[Kind]):
    """Answers that are under way, each with the time from which on it acts."""

    def __init__(self) -> None:
        self._asked = -np.inf
        self._due: deque[tuple[float, Kind]] = deque()

    def answer(self, kind: Kind, *, asked: float, due: float) -> None:
        """Note the answer to a question of `asked` [s], to act from `due` [s] on.

        Answers that were overtaken by that to a later question are dropped.
        """
        if asked < self._asked:
            return
        self._asked = asked
        while self._due and self._due[-1][0] > due:
            self._due.pop()
        self._due.append((due, kind))

    def arrived(self, time: float) -> Kind | None:
        """Return the newest answer that has become due since the last call, by `time` [s]."""
        newest = None
        while self._due and self._due[0][0] <= time + TIME_ROUNDING:
            newest = self._due.popleft()[1]
        return newest

    def under_way(self) -> list[tuple[float, Kind]]:
        """Return what is not due yet, the earliest first."""
        return list(self._due)


class HeldWrench(InFlight[np.ndarray]):
    """The wrench (6,) that acts: that of the newest answer that is due; zeros before the first."""

    def __init__(self) -> None:
        super().__init__()
        self.current = np.zeros(6)

    def answer(self, kind: np.ndarray, *, asked: float, due: float) -> None:
        """Note a copy of the wrench (6,), as `InFlight.answer`; ValueError for another shape."""
        super().answer(as_floats(kind, 'wrench', 'a wrench (6,)', (6,)).copy(),
                       asked=asked, due=due)

    def at(self, time: float) -> np.ndarray:
        """Return the wrench (6,) that acts at `time` [s]; times must not decrease."""
        newest = self.arrived(time)
        if newest is not None:
            self.current = newest
        return self.current.copy()

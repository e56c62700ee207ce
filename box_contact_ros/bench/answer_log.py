# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What was sent to one node in one stream, and what came back. No ROS.

Messages belong to poses by their stamp. Stamps and times of receipt are nanoseconds of one clock.

- A pair that touches is answered once point, normal and contacts have come. Its latency runs from
  the stamp to the later of point and normal.
- A pair that is apart is answered by contacts alone, and has no latency.
- A pair that was sent and not answered is lost.
- An answer is wrong if verdict or depth differ from the exact ones, if its messages contradict each
  other, or if one of them came twice.

The echo node answers every pair with point and normal, and is never wrong.
"""
from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..solver.contact import Contacts

WIDTHS = {'point': 3, 'normal': 3, 'contacts': 7}
"""Numbers of each message; contacts hold point, normal and depth of the pair."""
ECHOED = ('point', 'normal')  # what the echo node answers with
DEPTH_TOLERANCE = 1e-9
"""How far a right depth may lie from the exact one [m]; all models take it from the same separating
axis test. The depths of two ticks differ by a thousand times more."""


class AnswerLog:
    """One node and one stream; rows are pairs of poses."""

    def __init__(self, node: str, stream: str, truth: Contacts) -> None:
        """Make room for answers to the pairs whose exact contacts are `truth`."""
        self.node, self.stream, self.truth = node, stream, truth
        self.echoes = node == 'echo'
        rows = len(truth.colliding)
        self.stamps = np.zeros(rows, np.int64)  # [ns], 0: not sent
        self.lateness = np.full(rows, np.nan)
        """How far the bench itself fell behind its schedule [s]."""
        self.received = {kind: np.zeros(rows, np.int64) for kind in WIDTHS}  # [ns], 0: not yet
        self.values = {kind: np.full((rows, width), np.nan) for kind, width in WIDTHS.items()}
        self.twice = np.zeros(rows, bool)
        self.cpu = self.growth = np.nan
        """Share of one core while poses were sent, and growth of the resident memory [bytes]."""
        self._row_of: dict[int, int] = {}

    def sent(self, row: int, stamp: int, lateness: float) -> None:
        """Note that a pair went out under `stamp` [ns], `lateness` [s] too late."""
        self.stamps[row], self.lateness[row] = stamp, lateness
        self._row_of[stamp] = row

    def answer(self, kind: str, stamp: int, received: int, values: Sequence[float] = ()) -> None:
        """Note a message received at `received` [ns]; values: see WIDTHS, none for no contact.

        Answers to stamps that are not of this stream are ignored: the bench asks before it counts.
        """
        row = self._row_of.get(stamp)
        if row is None:
            return
        if self.received[kind][row]:
            self.twice[row] = True
            return
        self.received[kind][row] = received
        if len(values):
            self.values[kind][row] = values

    def note_usage(self, usage: np.ndarray, rate: float) -> None:
        """Note processor time [s] and memory [bytes], (blocks + 1, 2): before and after each block.

        rate: pairs per second [Hz]. The memory counts from the middle on, when all is warm.
        """
        spent = usage[-1, 0] - usage[0, 0]
        self.cpu = float(spent * rate / max(1, np.count_nonzero(self.stamps)))
        self.growth = float(usage[-1, 1] - usage[len(usage) // 2, 1])

    @property
    def touching(self) -> np.ndarray:
        """Which pairs touch, as the node says (rows,); all of an echo."""
        return self.echoes | ~np.isnan(self.values['contacts'][:, 0])

    @property
    def answered(self) -> np.ndarray:
        """Which pairs have all messages that they can have (rows,)."""
        echoed = np.all([self.received[kind] > 0 for kind in ECHOED], axis=0)
        heard = self.echoes | (self.received['contacts'] > 0)
        return heard & (echoed | ~self.touching)

    @property
    def lost(self) -> np.ndarray:
        """Which pairs were sent and not answered (rows,)."""
        return (self.stamps > 0) & ~self.answered

    @property
    def latencies(self) -> np.ndarray:
        """Return the latencies (rows,) [s], NaN without a contact and where the answer is lost."""
        last = np.max([self.received[kind] for kind in ECHOED], axis=0)
        return np.where(self.answered & self.touching, 1e-9 * (last - self.stamps), np.nan)

    @property
    def wrong(self) -> np.ndarray:
        """Which answers are wrong (rows,)."""
        if self.echoes:
            return self.twice
        alone = np.concatenate([self.values[kind] for kind in ECHOED], axis=1)
        together, touching = self.values['contacts'], self.touching
        verdict = touching != self.truth.colliding
        depth = np.abs(together[:, 6] + self.truth.separation) > DEPTH_TOLERANCE
        contradiction = np.where(touching, np.any(alone != together[:, :6], axis=1),
                                 np.any(~np.isnan(alone), axis=1))
        return self.twice | self.answered & (verdict | depth | contradiction)

    @property
    def point_errors(self) -> np.ndarray:
        """Return the distances (rows,) [m] from the exact points, NaN where one has no contact."""
        return np.linalg.norm(self.values['contacts'][:, :3] - self.truth.point, axis=1)

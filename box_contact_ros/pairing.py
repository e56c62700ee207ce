"""Which poses belong together: two streams of stamped poses, paired by stamp or by arrival."""
from __future__ import annotations

from collections import OrderedDict
from typing import Generic, TypeVar

Pose = TypeVar('Pose')

WAITING_POSES = 128
"""Poses kept per box while their partner is out: 128 ms at 1 kHz, far more than the executor or
the transport ever lets the two streams drift apart, and a bound on memory."""


class StampPairing(Generic[Pose]):
    """Pairs poses of equal stamp, whichever comes first; each stamp is answered once.

    A pose that finds no partner is dropped when WAITING_POSES newer ones of its box wait, and
    counted in `dropped`.
    """

    def __init__(self) -> None:
        self._waiting: tuple[OrderedDict[int, Pose], OrderedDict[int, Pose]] = (
            OrderedDict(), OrderedDict())
        self.dropped = 0

    def add(self, box: int, stamp: int, pose: Pose) -> tuple[Pose, Pose] | None:
        """Take a pose of box 0 or 1 with its stamp [ns]; the pair (box 0, box 1) if complete."""
        partner = self._waiting[1 - box].pop(stamp, None)
        if partner is not None:
            return (pose, partner) if box == 0 else (partner, pose)
        waiting = self._waiting[box]
        waiting[stamp] = pose
        if len(waiting) > WAITING_POSES:
            waiting.popitem(last=False)
            self.dropped += 1
        return None


class LatestPairing(Generic[Pose]):
    """Pairs every pose that arrives with the last one of the other box."""

    def __init__(self) -> None:
        self._last: list[Pose | None] = [None, None]
        self.dropped = 0

    def add(self, box: int, stamp: int, pose: Pose) -> tuple[Pose, Pose] | None:
        """Take a pose of box 0 or 1; the pair (box 0, box 1) once both have been seen."""
        self._last[box] = pose
        first, second = self._last
        return None if first is None or second is None else (first, second)


PAIRINGS = {'stamp': StampPairing, 'latest': LatestPairing}
"""Values of the node parameter `pairing`."""

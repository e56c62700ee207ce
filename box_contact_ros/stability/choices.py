"""What model `mlp` chose on its way to a point: where its answer may step.

Two things are chosen by a comparison: in which of the two boxes' frames the network sees the
overlap (`outline`), and whether it is asked at all, or the exact answer given (`mlp`). Where
the two sides of a comparison are equal, the answers before and after are two values within the
network's error. Everywhere else the point is a continuous function of the poses.
`solve_with_choices` tells the two apart: it solves, and reads from a block's memory what was
chosen.
"""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..block import IN_B, IN_RANGE, LANES, new_work
from ..mlp import solve_mlp
from ..contact import Contacts
from ..network import Network
from ..posesets import Pairs
from ..sites import site_numbers


class Choices(NamedTuple):
    """Of n pairs; rows without contact have no meaning."""

    network: np.ndarray
    """(n,) whether the network was asked; where not, the answer is the exact one."""
    frame_b: np.ndarray
    """(n,) whether the bounding box is that in B's frame."""

    def equal(self, other: Choices) -> np.ndarray:
        """(n,) whether the network was asked, and in the same frame."""
        return self.network & other.network & (self.frame_b == other.frame_b)


def solve_with_choices(network: Network, pairs: Pairs) -> tuple[Contacts, Choices]:
    """Contacts of n pairs of boxes, and what was chosen on the way."""
    n = len(pairs.pose_a)
    found = Contacts(np.zeros(n, dtype=np.bool_), np.full(n, np.nan), np.full((n, 3), np.nan),
                     np.full((n, 3), np.nan))
    choices = Choices(*np.zeros((2, n), dtype=np.bool_))
    numbers, work = site_numbers(network), new_work()
    for start in range(0, n, LANES):
        rows = slice(start, min(n, start + LANES))
        refused, _ = solve_mlp(*(part[rows] for part in pairs), work, numbers,
                                     np.zeros(LANES, dtype=np.int8),
                                     *(part[rows] for part in found))
        if refused:
            raise ValueError(f'{refused} of the pairs from row {start} on cannot be evaluated')
        for chosen, place in zip(choices, (IN_RANGE, IN_B)):
            chosen[rows] = work[place:place + rows.stop - start] > 0.5
    return found, choices

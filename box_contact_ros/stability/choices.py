"""What model `committee` chose on its way to a point: where its answer may step.

The network sees an overlap in a normal form (`committee`): in one of the two boxes' frames,
mirrored, with axes and faces in an order. Each of these is chosen by a comparison, and where the
two sides of a comparison are equal, the answers before and after are two values within the
network's error. Everywhere else the point is a continuous function of the poses.
`solve_with_choices` tells the two apart: it solves,
and reads from a block's memory what was chosen.
"""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..block import (
    HALF,
    IN_B,
    IN_RANGE,
    LANES,
    LESS,
    MIRRORED,
    MORE,
    NORMALS,
    RANKS,
    new_work,
)
from ..committee import TIE, solve_committee
from ..contact import Contacts
from ..network import Network, block_numbers
from ..posesets import Pairs


class Choices(NamedTuple):
    """Of n pairs; rows without contact have no meaning."""

    network: np.ndarray
    """(n,) whether the network was asked; where not, the answer is the exact one."""
    frame_b: np.ndarray
    """(n,) whether the bounding box is that in B's frame."""
    mirrored: np.ndarray
    """(n, 3) −1 where an axis is mirrored, 1 where not."""
    ranks: np.ndarray
    """(n, 3) place of each axis in the network's order."""
    sides: np.ndarray
    """(n, 3) which of the two faces across an axis cuts more, −1 or 1; 0 where none does."""
    faces: np.ndarray
    """(n, 3) which of two axes' faces, (0, 1), (0, 2), (1, 2), come first, −1 or 1; 0 where neither
    cuts."""

    def equal(self, other: Choices) -> np.ndarray:
        """(n,) whether the network was asked, and in the same way.

        A face that cuts nothing is seen as zero, wherever it stands.
        """
        same = self.network & other.network & (self.frame_b == other.frame_b)
        same &= ((self.mirrored == other.mirrored) & (self.ranks == other.ranks)).all(axis=1)
        for mine, others in ((self.sides, other.sides), (self.faces, other.faces)):
            same &= (mine * others >= 0).all(axis=1)
        return same


def solve_with_choices(network: Network, pairs: Pairs) -> tuple[Contacts, Choices]:
    """Contacts of n pairs of boxes, and what was chosen on the way."""
    n = len(pairs.pose_a)
    found = Contacts(np.zeros(n, dtype=np.bool_), np.full(n, np.nan), np.full((n, 3), np.nan),
                     np.full((n, 3), np.nan))
    choices = Choices(np.zeros(n, dtype=np.bool_), np.zeros(n, dtype=np.bool_),
                      *np.zeros((4, n, 3), dtype=np.int8))
    numbers, work = block_numbers(network), new_work()
    for start in range(0, n, LANES):
        rows = slice(start, min(n, start + LANES))
        refused, _ = solve_committee(*(part[rows] for part in pairs), work, numbers,
                                     np.zeros(LANES, dtype=np.int8),
                                     *(part[rows] for part in found))
        if refused:
            raise ValueError(f'{refused} of the pairs from row {start} on cannot be evaluated')
        for whole, part in zip(choices, _read(work)):
            whole[rows] = part[:rows.stop - start]
    return found, choices


def _read(work: np.ndarray) -> Choices:
    """The choices of all lanes of a block that has been solved."""
    def row(first: int, count: int = 1) -> np.ndarray:
        return work[first:first + count * LANES].reshape(count, LANES)

    more, less = row(MORE, 3), row(LESS, 3)
    width = np.abs(row(NORMALS, 9).reshape(3, 3, LANES) * row(HALF, 3)).sum(axis=1)
    cuts = (np.abs(more) + np.abs(less)) * width
    first, second = cuts[[0, 0, 1]], cuts[[1, 2, 2]]
    faces = np.where(first < (1.0 - TIE) * second, -1, 1) * (np.maximum(first, second) > 0.0)
    return Choices(row(IN_RANGE)[0] > 0.5, row(IN_B)[0] > 0.5, np.sign(row(MIRRORED, 3)).T,
                   row(RANKS, 3).T, np.sign(more).T, faces.T)

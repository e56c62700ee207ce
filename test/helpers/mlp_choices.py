# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What model `mlp` chose on its way to a point: where its answer may step.

Comparisons choose two things. One chooses the frame, of A or of B, in which the network sees the
overlap (core/src/overlap/bounds.hpp). The other chooses between network and exact method
(core/src/mlp/mlp_model.hpp). Where a comparison changes its result, the point steps by up to the
network's error. Everywhere else the point is a continuous function of the poses.
"""
from __future__ import annotations

from typing import NamedTuple

import numpy as np

from box_contact_ros.core import native, stages
from box_contact_ros.scene.pose_sets import Pairs
from box_contact_ros.solver.contact import Contacts
from box_contact_ros.solver.mlp import core_numbers
from box_contact_ros.solver.weights_file import Network

_UNIT = (1.0, 1.0, 1.0)


class Choices(NamedTuple):
    """The choices for n pairs; rows without contact have no meaning."""

    network: np.ndarray
    """(n,) whether the network answered; where not, the answer is the exact one."""
    frame_b: np.ndarray
    """(n,) whether the bounding box is that in B's frame."""

    def equal(self, other: Choices) -> np.ndarray:
        """Return whether (n,) the network answered both, in the same frame."""
        return self.network & other.network & (self.frame_b == other.frame_b)


def solve_with_choices(network: Network, pairs: Pairs) -> tuple[Contacts, Choices]:
    """Return the contacts of n pairs by this network, and the choices.

    Raises ValueError for a row that is refused.
    """
    numbers = core_numbers(network)
    found = stages(*pairs, names=('in_range', 'frame_b'))
    solver = native.PairSolver('mlp', _UNIT, _UNIT, numbers)
    contacts, _ = solver.solve(*map(np.ascontiguousarray, pairs), 1)
    return Contacts(*contacts), Choices(found.in_range, found.frame_b)

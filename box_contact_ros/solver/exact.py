# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Model `exact` as an object, for models in Python that leave pairs to it."""
from __future__ import annotations

import numpy as np

from ..core import native
from .contact import Contacts


class Exact:
    """The answers of `exact`."""

    def __init__(self) -> None:
        self._pairs = native.PairSolver('exact', (1.0, 1.0, 1.0), (1.0, 1.0, 1.0))

    def solve(self, a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
              threads: int = 1) -> tuple[Contacts, int]:
        """Return contacts for poses (n, 7), sizes (n or 1, 3), and the first refused row or −1."""
        columns, refused = self._pairs.solve(a, b, size_a, size_b, threads)
        return Contacts(*columns), refused

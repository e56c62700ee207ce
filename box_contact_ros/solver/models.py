"""Model `exact`: SAT and the exact centroid of the overlap, in float64. The reference."""
from __future__ import annotations

import numpy as np

from ..core import native
from .contact import Contacts


class Exact:
    """The exact model, for any sizes; see core/contact.hpp."""

    single = 'exact', None
    """The native model of single calls, and its network."""

    def __init__(self) -> None:
        self._pairs = native.PairSolver('exact', (1.0, 1.0, 1.0), (1.0, 1.0, 1.0))

    @property
    def clipped(self) -> int:
        """Contacts of batches so far that were clipped, because the certificate did not hold."""
        return self._pairs.clipped

    def solve(self, a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
              threads: int = 1) -> tuple[Contacts, int]:
        """Return contacts for poses (n, 7), sizes (n or 1, 3), and the first refused row or −1."""
        *found, refused = self._pairs.solve(a, b, size_a, size_b, threads)
        return Contacts(*found), refused

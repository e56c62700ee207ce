# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Models: objects that answer for pairs of boxes. Those of the library have a name here."""
from __future__ import annotations

from typing import Protocol

import numpy as np

from ..core import native
from .checks import nearest_name, short_repr
from .contact import Contacts

NATIVE = {'exact': native.Exact, 'mlp': native.Mlp}
"""Models in C++, by name. They alone give volume and covariance."""
NATIVE_TYPES = (native.Exact, native.Mlp)


class Model(Protocol):
    """What answers behind `ContactSolver`; sizes come with each call.

    It may also have two methods of the full extents (3,) [m] of both boxes. `size_fault(size_a,
    size_b)` returns in words why it refuses them, or None. `native_for(size_a, size_b)` returns a
    model in C++ that answers as it does for boxes of these sizes, or None.
    """

    def solve(self, a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
              threads: int = 1) -> tuple[Contacts, int]:
        """Return the contacts of poses (n, 7) and full extents (n or 1, 3) [m].

        With them comes the number of the first row that is refused, or −1. Contacts of a batch with
        a refused row have no meaning.
        """


def as_model(model: str | Model) -> Model:
    """Return the object of a name in NATIVE, or the object that is given.

    Raises ValueError for anything else.
    """
    if isinstance(model, str):
        if model in NATIVE:
            return NATIVE[model]()
        raise ValueError(f'model {short_repr(model)} is not one of: {", ".join(NATIVE)}'
                         f'{nearest_name(model, NATIVE)}; box_contact_ros.make_model makes others')
    if isinstance(model, type) or not hasattr(model, 'solve'):
        raise ValueError(f'model {short_repr(model)} is not one of: {", ".join(NATIVE)}, and no '
                         'object with the method solve')
    return model

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Models: the names that users ask for, and the objects that answer under them.

`exact` and `mlp` are answered in C++. Every other model is an object with `solve`. Those that the
package ships are imported when their name is asked for. A user passes an object of their own.
"""
from __future__ import annotations

import re
from importlib import import_module
from typing import Protocol

import numpy as np

from .checks import nearest_name, short_repr
from .contact import Contacts

NATIVE = ('exact', 'mlp')
"""Models in C++. They alone give volume and covariance."""
MODELS = (*NATIVE, 'paper', 'soup-N')
"""Names as help texts show them: N is 1 to `MOST_SOUP_DIVISIONS`."""

SOUP_DIVISIONS, MOST_SOUP_DIVISIONS = 8, 64
"""Divisions of an edge in `soup-N`: where nobody asks for a number, and the most (49,152 triangles
per box)."""


class Model(Protocol):
    """A model in Python behind `ContactSolver`.

    It may also have `fallbacks`, the number of contacts that it handed to `exact` so far, and
    `size_fault(size_a, size_b)`. That returns in words why it refuses boxes of two full extents
    (3,) [m], or None.
    """

    def solve(self, a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
              threads: int = 1) -> tuple[Contacts, int]:
        """Return the contacts of poses (n, 7) and full extents (n or 1, 3) [m].

        With them comes the number of the first row that is refused, or −1. Contacts of a batch with
        a refused row have no meaning.
        """


def check_model(where: str, name: object) -> None:
    """Raise ValueError, which begins with `where`, for a name that is not in `MODELS`."""
    if isinstance(name, str) and (name in MODELS[:-1] or soup_divisions(name)):
        return
    if isinstance(name, str) and name.startswith('soup-'):
        raise ValueError(f'{where} {short_repr(name)}: N of soup-N must be a whole number from 1 '
                         f'to {MOST_SOUP_DIVISIONS}')
    raise ValueError(f'{where} {short_repr(name)} is not one of: {", ".join(MODELS)}'
                     f'{nearest_name(name, MODELS)}')


def soup_divisions(name: str) -> int:
    """Return N of the model soup-N, 0 for any other name."""
    number = re.fullmatch('soup-([0-9]{1,2})', name)
    divisions = int(number[1]) if number else 0
    return divisions if divisions <= MOST_SOUP_DIVISIONS else 0


def most_near(name: str) -> int:
    """Return how many pairs near each other a node answers in one tick, in about a second.

    A soup takes a third of a second per pair at worst. Messages of 32,768 pairs have 30 MB.
    """
    return 64 if soup_divisions(name) else 2**15


def make_model(name: str, size: np.ndarray, weights: str | None) -> Model:
    """Return the object that answers as `paper` or `soup-N`, for full extents (3,) [m] of A.

    Raises ValueError for sizes or weights that do not fit, and ModuleNotFoundError, which says what
    to install, where a library is missing.
    """
    if name == 'paper':
        return import_module('box_contact_ros.networks.paper').paper(size, weights)
    return import_module('box_contact_ros.soup.soup').Soup(soup_divisions(name))

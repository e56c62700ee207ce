# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""All models that the package has: their names, and the one call that makes any of them."""
from __future__ import annotations

import os
import re

from ..extras import require
from ..solver.checks import nearest_name, short_repr
from ..solver.model import NATIVE, Model, as_model

MODELS = (*NATIVE, 'paper', 'soup-N')
"""Names as help texts show them: N is 1 to `MOST_SOUP_DIVISIONS`."""

SOUP_DIVISIONS, MOST_SOUP_DIVISIONS = 8, 64
"""Divisions of an edge in `soup-N`: where nobody asks for a number, and the most (49,152 triangles
per box)."""


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


def make_model(name: str, *, weights: str | os.PathLike[str] | None = None) -> Model:
    """Return the object that answers as 'exact', 'mlp', 'paper' or 'soup-N'.

    weights: a file to use instead of the shipped weights, for `mlp` and `paper`.
    Raises ValueError for a name or weights that are refused, and ModuleNotFoundError, which says
    what to install, where a library is missing.
    """
    check_model('model', name)
    if weights is not None and not isinstance(weights, (str, os.PathLike)):
        raise ValueError(f'weights must be the path of a file, not {short_repr(weights)}')
    if weights is not None and name not in ('mlp', 'paper'):
        raise ValueError(f'weights have no effect on model {short_repr(name)}: leave them out')
    if name == 'mlp' and weights is not None:
        from .networks import read_mlp
        return read_mlp(weights)
    if name == 'paper':
        from .networks import read_paper
        return read_paper(weights)
    if name in NATIVE:
        return as_model(name)
    require('soup')
    from .soup import Soup
    return Soup(soup_divisions(name))

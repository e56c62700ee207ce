# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The registry of models: what each is called, what it is for, and how it is built.

The core's own models are here. A package adds one by an entry point of the group
`box_contact_ros.models`, which leads to a `ModelEntry`. Solver, node and programs read `models()`.
"""
from __future__ import annotations

import os
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any, Protocol

import numpy as np

from ..core import native
from .checks import nearest_name, shown
from .contact import Contacts
from .weights_file import Weights


class Model(Protocol):
    """A model in Python behind `ContactSolver`.

    It may have `exact_answers`, the contacts that it handed to `exact`.
    """

    def solve(self, a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
              threads: int = 1) -> tuple[Contacts, int]:
        """Return the contacts of poses (n, 7) and full extents (n or 1, 3).

        The number of the first row that is refused comes with them, or −1.
        """


@dataclass(frozen=True, kw_only=True)
class NativeModel:
    """A model in C++: what `PairSolver` takes besides the sizes."""

    name: str | None = None  # as the core has it; None: a kernel or a model in Python answers
    weights: Weights | None = None
    network: np.ndarray | None = None
    kernel: object = None  # of another extension: see core/src/library/kernel.hpp
    size_fault: Callable[[np.ndarray, np.ndarray], str | None] | None = None
    """Return why the kernel refuses boxes of two full extents (3,) [m], or None."""


def exact() -> NativeModel:
    """Return model `exact`: the moments of the overlap in float64; see core/src/contact.hpp."""
    return NativeModel(name='exact')


class Exact:
    """The answers of `exact`, for models in Python."""

    def __init__(self) -> None:
        self._pairs = native.PairSolver('exact', (1.0, 1.0, 1.0), (1.0, 1.0, 1.0))

    def solve(self, a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
              threads: int = 1) -> tuple[Contacts, int]:
        """Return contacts for poses (n, 7), sizes (n or 1, 3), and the first refused row or −1."""
        found, refused = self._pairs.solve(a, b, size_a, size_b, threads)
        return Contacts(*found), refused


@dataclass(frozen=True, kw_only=True)
class Family:
    """Models of one entry that differ in a whole number N: `name` has the default, or `name-N`."""

    argument: str  # the builder's name for N
    default: int
    most: int  # N is 1 to this


@dataclass(frozen=True, kw_only=True)
class ModelEntry:
    """One model, or one family of them."""

    name: str
    line: str  # how it finds the point, in a line
    builder: str
    """'module:function' that returns the `Model` or `NativeModel`; imported when one is built."""
    takes: tuple[str, ...] = ()
    """The builder's keyword arguments: of size_a, size_b (1, 3), weights, and the family's."""
    boxes: str = 'any'  # the boxes that it answers
    extra: str = ''  # extra of setup.py that brings its library
    native_batch: bool = False  # whether the rows of a batch are answered in C++
    patch: bool = False  # whether it gives volume and covariance
    family: Family | None = None
    most_near: int = 2**15
    """Pairs near each other that a node answers in one tick, in about a second; messages of so many
    have 30 MB."""

    @property
    def any_boxes(self) -> bool:
        """Whether the model answers for boxes of any sizes."""
        return self.boxes == 'any'

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names under which users ask for it."""
        return (self.name, f'{self.name}-N') if self.family else (self.name,)

    @property
    def full_name(self) -> str:
        """Return the name that says all: with the default N, for a family."""
        return f'{self.name}-{self.family.default}' if self.family else self.name

    def load(self) -> Callable[..., Model | NativeModel]:
        """Return the builder; ModuleNotFoundError, which names the extra, where it is missing."""
        module, _, function = self.builder.partition(':')
        try:
            return getattr(import_module(module), function)
        except ModuleNotFoundError as error:
            if not self.extra:
                raise
            raise ModuleNotFoundError(
                f'{error}: model {self.name!r} needs the extra {self.extra!r} of box_contact_ros: '
                f"in the checkout, pip install -c constraints.txt -e '.[{self.extra}]'",
                name=error.name) from None

    def options(self, name: str) -> dict[str, int] | None:
        """Return what a name says to the builder, or None for the name of another model.

        Raises ValueError for a bad number of a family.
        """
        family = self.family
        if name == self.name:
            return {family.argument: family.default} if family else {}
        number = name.removeprefix(f'{self.name}-')
        if family is None or number == name:
            return None
        if not re.fullmatch('[0-9]{1,9}', number) or not 1 <= int(number) <= family.most:
            raise ValueError(f'model {shown(name)}: the {family.argument} N of {self.name}-N must '
                             f'be a whole number from 1 to {family.most}')
        return {family.argument: int(number)}


GROUP = 'box_contact_ros.models'
"""The group of entry points by which packages add models."""
OWN = {entry.name: entry for entry in (
    ModelEntry(
        name='mlp', line='SAT, columns, a network between proven brackets; the default',
        builder='box_contact_ros.solver.mlp:mlp', takes=('weights',),
        native_batch=True, patch=True),
    ModelEntry(
        name='exact', line='SAT and the exact centroid of the overlap; the reference',
        builder='box_contact_ros.solver.models:exact',
        native_batch=True, patch=True),
)}
"""The core's models by name."""


@cache
def models() -> dict[str, ModelEntry]:
    """Return all models by name: the core's, then those of installed packages, in their order.

    Warns of an entry point that gives no entry, and leaves it out: the others are not its concern.
    """
    found = dict(OWN)
    for point in sorted(entry_points(group=GROUP)):
        try:
            entry = point.load()
            if not isinstance(entry, ModelEntry) or entry.name != point.name:
                raise TypeError(f'it is not the ModelEntry of a model {point.name!r}')
            if point.name in OWN:
                raise ValueError('this name is one of the core')
        except Exception as error:  # of any kind: the code is a stranger's
            warnings.warn(f'model {point.name!r} of {point.value} is left out: '
                          f'{type(error).__name__}: {error}', stacklevel=2)
        else:
            found[entry.name] = entry
    return found


def model_names() -> str:
    """Return the names of all models for help texts, separated by commas."""
    return ', '.join(name for entry in models().values() for name in entry.names)


def models_with_patch() -> list[str]:
    """Return the full names of the models that give volume and covariance."""
    return [entry.full_name for entry in models().values() if entry.patch]


def find_model(where: str, name: object) -> tuple[ModelEntry, dict[str, int]]:
    """Return the entry of a model's name, and what the name says to the builder.

    Raises ValueError, which begins with `where`, for a name that no entry has.
    """
    if isinstance(name, str) and name in OWN:  # spares the search for other packages' models
        return OWN[name], {}
    for entry in models().values() if isinstance(name, str) else ():
        options = entry.options(str(name))
        if options is not None:
            return entry, options
    raise ValueError(f'{where} {shown(name)} is not one of: {model_names()}'
                     f'{nearest_name(name, models())}')


def build_model(name: str, size_a: np.ndarray, size_b: np.ndarray, weights: str | None,
                ) -> Model | NativeModel:
    """Return the model of that name for boxes of full extents (1, 3) [m].

    weights: the path of a file, or None for the shipped one.
    Raises ValueError for a name, sizes or weights that do not fit.
    """
    entry, options = find_model('model', name)
    if weights is not None and not isinstance(weights, (str, os.PathLike)):
        raise ValueError(f'weights must be the path of a file, not {shown(weights)}')
    given: dict[str, Any] = {'size_a': size_a, 'size_b': size_b, 'weights': weights, **options}
    return entry.load()(**{argument: given[argument] for argument in entry.takes})

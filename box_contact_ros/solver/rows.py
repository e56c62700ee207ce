# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Answers for many pairs: a sequence of single answers, and the fields of all as arrays."""
from __future__ import annotations

import operator
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import fields
from typing import Any, ClassVar, Never, Self, TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike

One = TypeVar('One')


class NoTruth:
    """An answer without a truth value, as NumPy's arrays are: `if answer:` says what to ask."""

    __slots__ = ()
    _instead: ClassVar[str]

    def __bool__(self) -> Never:
        raise TypeError(f'{type(self).__name__} has no truth value: ask {self._instead}')


class Rows(NoTruth, Sequence[One]):
    """A dataclass of arrays that all have n rows. A number gives one row, a mask gives Rows."""

    __slots__ = ()

    @abstractmethod
    def _one(self, *values: Any) -> One:
        """Return the answer for one row, by the values of its fields."""

    def __len__(self) -> int:
        return len(getattr(self, fields(self)[0].name))  # type: ignore[arg-type]

    @overload
    def __getitem__(self, rows: int | np.integer) -> One: ...
    @overload
    def __getitem__(self, rows: slice | ArrayLike) -> Self: ...

    def __getitem__(self, rows: int | np.integer | slice | ArrayLike) -> One | Self:
        try:
            row = operator.index(rows)  # type: ignore[arg-type]
        except TypeError:
            return type(self)(*(getattr(self, field.name)[rows]
                                for field in fields(self)))  # type: ignore[arg-type]
        return self._one(*(getattr(self, field.name)[row]
                           for field in fields(self)))  # type: ignore[arg-type]

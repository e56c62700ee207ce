# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Patterns of names: which boxes they match, and which pairs they ask for."""
from __future__ import annotations

import fnmatch
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from .boxes import Box

Pattern = tuple[str, str]
"""Names of the boxes or bodies a and b of some pairs, with `*`, `?` and `[..]`."""


@dataclass(frozen=True, eq=False)
class Patterns:
    """Which boxes match which sides of patterns: a, b of the first one, a, b of the next one, ...

    Boxes of a group match the same sides.
    """

    patterns: Sequence[Pattern]
    kinds: np.ndarray  # (g, 2 p) the sides that each group matches
    group: np.ndarray  # (n,) of each box

    @classmethod
    def of(cls, patterns: Sequence[Pattern], boxes: Mapping[str, Box],
           bodies: Mapping[str, object]) -> Patterns:
        """Match the names of boxes, and of bodies, which stand for all their boxes."""
        sides = _sides_of(patterns, boxes, bodies)
        if not patterns:
            return cls(patterns, sides[:1], np.zeros(len(boxes), np.int32))
        kinds, group = np.unique(sides, axis=0, return_inverse=True)
        return cls(patterns, kinds, group.ravel().astype(np.int32))

    def changed(self, new: Mapping[str, Box], source: np.ndarray, boxes: Mapping[str, Box],
                bodies: Mapping[str, object]) -> Patterns:
        """Return what matches after a change: rows are those of these boxes, and of new ones."""
        number_of = {row.tobytes(): number for number, row in enumerate(self.kinds)}
        numbers = [number_of.setdefault(row.tobytes(), len(number_of))
                   for row in _sides_of(self.patterns, new, bodies)]
        if not self.patterns or len(number_of) > len(boxes):  # kinds of no box any more go
            return Patterns.of(self.patterns, boxes, bodies)
        group = np.concatenate((self.group, np.array(numbers, np.int32)))[source]
        kinds = np.frombuffer(b''.join(number_of), bool).reshape(-1, self.kinds.shape[1])
        return Patterns(self.patterns, kinds, group)

    @property
    def sides(self) -> np.ndarray:
        """Return which sides each box matches (n, 2 p)."""
        sides: np.ndarray = self.kinds[self.group]
        return sides

    @cached_property
    def allowed(self) -> np.ndarray:
        """Return by two groups which of them may be box a (g, g): bit 0: the first, 1: the other.

        The first pattern counts that asks for their pairs. Without patterns it has no rows.
        """
        count = len(self.kinds) if self.patterns else 0
        allowed = np.zeros((count, count), np.uint8)
        for a, b in zip(self.kinds.T[::2], self.kinds.T[1::2]):
            asked = (a[:, None] & b).astype(np.uint8)
            allowed = np.where(allowed, allowed, asked | asked.T << 1)
        return allowed


def _sides_of(patterns: Sequence[Pattern], boxes: Mapping[str, Box], bodies: Mapping[str, object],
              ) -> np.ndarray:
    sides = [_matching(side, boxes, bodies) for pattern in patterns for side in pattern]
    return np.array(sides, bool).reshape(len(sides), len(boxes)).T


def _matching(pattern: str, boxes: Mapping[str, Box], bodies: Mapping[str, object]) -> list[bool]:
    is_alike = _matcher_of(pattern)
    matched = {name for name in bodies if is_alike(name)}
    return [is_alike(name) is not None or box.body in matched for name, box in boxes.items()]


@lru_cache
def _matcher_of(pattern: str) -> Callable[[str], object]:
    """Return what tells whether a name matches a pattern."""
    return re.compile(fnmatch.translate(pattern)).match

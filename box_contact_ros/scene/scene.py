# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A scene: boxes, fixed or moving, and the pairs of them that matter.

Pairs are listed by name, or asked for by patterns of names. In arrays, a box is its index in the
scene.
"""
from __future__ import annotations

import fnmatch
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..solver.checks import as_floats, name_fault, pose_fault, short_repr, size_fault

POSE_ARRAY = 'poses'
"""Topic of the poses of all moving boxes, where they come as one message."""
ALL_BOXES = 'all boxes'
"""Source of these poses: no box of a scene file can have this name."""
EVERY_PAIR = (('*', '*'),)
"""Patterns of a scene in which each two boxes are a pair, if one of them moves."""
MOVES = (': leave `pose` out of a box that moves, and give its pose in the call; or, in Python, '
         'ask contacts_of(sizes, poses)')
"""What to do about boxes that are all fixed."""
ALONE = -1
"""Instead of box b, in rows of boxes: all pairs of box a that patterns ask for."""

CONTAINER = (12.192, 2.438, 2.591)
"""Full extents of an ISO 40 ft container [m]."""


KeyPath = tuple[str | int, ...]  # ('boxes', 'load', 'size') or ('pairs', 3, 'a')


class SceneError(ValueError):
    """What is wrong with a scene, and where: the path of a key, and of the file if there is one."""

    def __init__(self, path: KeyPath, reason: str, file: str = '') -> None:
        self.path, self.reason, self.file = path, reason, file
        dotted = ''.join(f'[{part}]' if isinstance(part, int) else f'.{part}' for part in path)
        super().__init__(': '.join(filter(None, (file, dotted.removeprefix('.'), reason))))

    def __reduce__(self) -> tuple[type[SceneError], tuple[KeyPath, str, str]]:
        """Pickle the arguments."""
        return SceneError, (self.path, self.reason, self.file)

    def within(self, *path: str | int) -> SceneError:
        """Return the same error of what stands at a path of a larger whole."""
        return SceneError((*path, *self.path), self.reason, self.file)


@dataclass(frozen=True)
class Box:
    """A box of the scene: fixed if it has a pose, else moving. Raises SceneError."""

    size: Sequence[float] | np.ndarray  # three full extents [m]
    pose: Sequence[float] | np.ndarray | None = None
    """`x y z qx qy qz qw` in the common frame, of a fixed box."""
    pose_topic: str = ''  # where a moving box's poses come from

    def __post_init__(self) -> None:
        def keep(key: str, given: ArrayLike, shape: str, count: int,
                 fault_of: Callable[[np.ndarray], str | None]) -> None:
            try:
                numbers = as_floats(given, key, shape, (count,))
            except ValueError as error:
                raise SceneError((key,), str(error).removeprefix(f'{key} ')) from error
            if fault := fault_of(numbers):
                raise SceneError((key,), fault)
            object.__setattr__(self, key, tuple(numbers.tolist()))

        if not isinstance(self.pose_topic, str):
            raise SceneError(('pose_topic',), f'must be text, not {short_repr(self.pose_topic)}')
        keep('size', self.size, 'full extents (3,)', 3, size_fault)
        if self.pose is not None:
            keep('pose', self.pose, 'a pose (x y z qx qy qz qw)', 7, pose_fault)
            if self.pose_topic:
                raise SceneError(('pose_topic',), f'{short_repr(self.pose_topic)}: a box with a '
                                                  'pose never moves')


class Pair(NamedTuple):
    """Two boxes whose contact is asked for; the normal points from a to b."""

    name: str  # prefix of its topics; empty for a scene of two boxes without a file
    a: str
    b: str

    @property
    def label(self) -> str:
        """Return what messages call the pair: its name, or `a_b` where it has none."""
        return self.name or f'{self.a}_{self.b}'

    @classmethod
    def between(cls, a: str, b: str) -> Pair:
        """Return the pair of two boxes, with the name that a scene file gives it."""
        return cls(f'{a}_{b}', a, b)


Pattern = tuple[str, str]
"""Names of the boxes a and b of some pairs, with `*`, `?` and `[..]`."""


@dataclass(frozen=True)
class Scene:
    """Boxes by name, and which pairs matter. Raises SceneError for what cannot be computed.

    A pattern asks for all pairs of two boxes that it matches and of which one moves. If both sides
    match both boxes, a is the one that comes first in the scene.
    """

    boxes: Mapping[str, Box]
    pairs: tuple[Pair, ...] = ()
    """The pairs that are listed by the names of their boxes."""
    frame_id: str = ''
    """The common frame that all poses must be in; empty: any, as long as it is the same."""
    pose_array: bool = False
    """Whether one message has the poses of all moving boxes; else each box has a topic."""
    patterns: tuple[Pattern, ...] = ()

    def __post_init__(self) -> None:
        _check_kinds(self)
        _check_pairs(self.boxes, self.pairs)
        for number, (a, b) in enumerate(self.patterns):
            _check_pattern(self, number, self.matching(a), self.matching(b))
        if not self.pairs and not self.patterns:
            raise SceneError(('pairs',), 'a scene needs at least one pair')

    def matching(self, pattern: str) -> np.ndarray:
        """Return which boxes (n,) have names that a pattern matches."""
        is_alike = re.compile(fnmatch.translate(pattern)).match
        return np.array([is_alike(name) is not None for name in self.boxes])

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the boxes by index."""
        return tuple(self.boxes)

    @cached_property
    def index_of(self) -> Mapping[str, int]:
        """Return the indices of the boxes by name."""
        return {name: index for index, name in enumerate(self.boxes)}

    @cached_property
    def is_fixed(self) -> np.ndarray:
        """Return which boxes (n,) never move."""
        return np.array([box.pose is not None for box in self.boxes.values()])

    @cached_property
    def rows(self) -> np.ndarray:
        """Return the listed pairs (m, 2) as indices of their boxes."""
        index = self.index_of
        return np.array([(index[pair.a], index[pair.b]) for pair in self.pairs],
                        dtype=np.int64).reshape(-1, 2)

    @cached_property
    def groups(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the group of each box (n,), and which groups meet by patterns (g, g): 0, 1 or 2.

        The rows of the latter are the group of the box that comes first in the scene. 1: it is
        box a. 2: it is box b. Boxes of a group match the same sides of the same patterns.
        """
        if not self.patterns:
            return np.zeros(len(self.boxes), np.int32), np.zeros((0, 0), np.uint8)
        sides = np.array([self.matching(side) for pattern in self.patterns for side in pattern])
        kinds, group = np.unique(sides, axis=1, return_inverse=True)
        allowed = np.zeros((kinds.shape[1], kinds.shape[1]), np.uint8)
        for a, b in zip(kinds[::2], kinds[1::2]):
            asked = a[:, None] & b
            allowed = np.where(allowed, allowed, np.where(asked, 1, 2 * asked.T))
        return group.ravel().astype(np.int32), allowed.astype(np.uint8)

    @cached_property
    def _listed(self) -> Mapping[tuple[int, int], Pair]:
        return {(a, b): pair for (a, b), pair in zip(self.rows.tolist(), self.pairs)}

    def pair_of(self, a: int, b: int) -> Pair:
        """Return the pair of two boxes by index; b ALONE: box a with itself, under its own name."""
        pair = self._listed.get((a, b))
        if pair is not None:
            return pair
        name = self.names[a]
        return Pair(name, name, name) if b == ALONE else Pair.between(name, self.names[b])

    def has_pair(self, a: int, b: int) -> bool:
        """Return whether boxes a and b, by index, are a pair in this order."""
        group, allowed = self.groups
        return (a, b) in self._listed or bool(self.patterns and a != b and (
            allowed[group[min(a, b)], group[max(a, b)]] == (1 if a < b else 2)))

    @cached_property
    def _is_asked(self) -> np.ndarray:
        """Which boxes (n,) patterns pair with others."""
        group, allowed = self.groups
        return allowed.max(axis=1)[group] > 0 if self.patterns else np.zeros(len(group), bool)

    @cached_property
    def watched(self) -> tuple[Pair, ...]:
        """Return what may be stale: listed pairs, then each moving box that patterns ask for."""
        boxes = np.flatnonzero(self._is_asked & ~self.is_fixed).tolist()
        return (*self.pairs, *(self.pair_of(box, ALONE) for box in boxes))

    def _partners(self, index: int) -> np.ndarray:
        """Return which boxes (n,) patterns pair a box with, without those of listed pairs."""
        group, allowed = self.groups
        if not self.patterns:
            return np.zeros(len(self.boxes), bool)
        met: np.ndarray = np.greater(allowed[group[index]][group], 0)
        met[index] = False
        if self.is_fixed[index]:
            met[self.is_fixed] = False
        met[self.rows[(self.rows == index).any(axis=1)]] = False
        return met

    def _later_partners(self, index: int) -> np.ndarray:
        """Return the boxes (n,) behind a box that patterns pair it with."""
        return index + 1 + np.flatnonzero(self._partners(index)[index + 1:])

    def every_pair(self) -> Iterator[Pair]:
        """Yield the listed pairs, then those that patterns ask for, by index."""
        yield from self.pairs
        for index in range(len(self.boxes) if self.patterns else 0):
            for other in self._later_partners(index).tolist():
                boxes = (index, other) if self.has_pair(index, other) else (other, index)
                yield self.pair_of(*boxes)

    @cached_property
    def pair_count(self) -> int:
        """How many pairs the scene has."""
        indices = range(len(self.boxes) if self.patterns else 0)
        return len(self.pairs) + sum(len(self._later_partners(index)) for index in indices)

    def partners(self, name: str) -> set[str]:
        """Return the moving boxes that a moving box has a pair with; itself if one is fixed."""
        index = self.index_of[name]
        met = self._partners(index)
        met[self.rows[(self.rows == index).any(axis=1)]] = True
        met[index] = False
        if met[self.is_fixed].any():
            return {name}
        return {self.names[other] for other in np.flatnonzero(met)}

    @cached_property
    def moving(self) -> tuple[str, ...]:
        """Names of the moving boxes in their order; without an array, only of those in a pair."""
        asked = self._is_asked.copy()
        asked[self.rows.ravel()] = True
        return tuple(name for name, is_asked, is_fixed in zip(self.boxes, asked, self.is_fixed)
                     if not is_fixed and (self.pose_array or is_asked))

    @cached_property
    def streams(self) -> tuple[str, ...]:
        """Names of the streams of poses: each box of `moving`, or ALL_BOXES in their place."""
        return (ALL_BOXES,) if self.pose_array else self.moving

    @cached_property
    def sources(self) -> Mapping[str, str]:
        """Topics of poses, by stream."""
        if self.pose_array:
            return {ALL_BOXES: POSE_ARRAY}
        return {name: self.boxes[name].pose_topic or f'{name}/pose' for name in self.moving}


def two_boxes(size_a: Sequence[float], size_b: Sequence[float]) -> Scene:
    """Return the scene of one pair of moving boxes, box_a and box_b, of full extents (3,) [m]."""
    boxes = {name: Box(size, pose_topic=f'{name}/pose')
             for name, size in (('box_a', size_a), ('box_b', size_b))}
    return Scene(boxes, (Pair('', 'box_a', 'box_b'),))


def _check_kinds(scene: Scene) -> None:
    """Raise SceneError for the first field of a scene that is of another kind."""
    def check(is_kind: bool, path: KeyPath, kind: str, value: object) -> None:
        if not is_kind:
            raise SceneError(path, f'must be {kind}, not {short_repr(value)}')

    check(isinstance(scene.boxes, Mapping), ('boxes',), 'boxes by name', scene.boxes)
    for name, box in scene.boxes.items():
        check(isinstance(name, str), ('boxes',), 'boxes by name', scene.boxes)
        check(isinstance(box, Box), ('boxes', name), 'a Box', box)
    for part in ('pairs', 'patterns'):
        rows = getattr(scene, part)
        check(isinstance(rows, tuple | list), (part,), f'a tuple of {part}', rows)
        for number, row in enumerate(rows):
            check(isinstance(row, Pair) if part == 'pairs' else len(row) == 2, (part, number),
                  'a Pair' if part == 'pairs' else 'the names a and b', row)
            for value in row:
                check(isinstance(value, str), (part, number), 'of text', row)
    check(isinstance(scene.frame_id, str), ('frame_id',), 'text', scene.frame_id)
    check(isinstance(scene.pose_array, bool), ('pose_array',), 'True or False', scene.pose_array)
    for path, names in ((('frame_id',), (scene.frame_id,)), (('boxes',), scene.boxes)):
        for name in names:
            if fault := name_fault(name):
                raise SceneError(path, fault)


def _check_pairs(boxes: Mapping[str, Box], pairs: Sequence[Pair]) -> None:
    """Raise SceneError for the first thing that is wrong with listed pairs."""
    for number, pair in enumerate(pairs):
        path = ('pairs', number)
        fault = name_fault(pair.name)
        if fault and pair.name != f'{pair.a}_{pair.b}':
            raise SceneError((*path, 'name'), fault)
        for side, name in (('a', pair.a), ('b', pair.b)):
            if name not in boxes:
                raise SceneError((*path, side), f'{short_repr(name)} is none of the boxes')
        if pair.a == pair.b:
            raise SceneError((*path, 'b'), f'{short_repr(pair.b)} is the same box as a')
        if boxes[pair.a].pose and boxes[pair.b].pose:
            raise SceneError(path, f'{short_repr(pair.a)} and {short_repr(pair.b)} are both fixed'
                                   f'{MOVES}')
    for what, field, values in (
            ('name', ('name',), [pair.label for pair in pairs]),
            ('pair of boxes', (), [tuple(sorted((pair.a, pair.b))) for pair in pairs])):
        first_of: dict[object, int] = {}
        for number, value in enumerate(values):
            first = first_of.setdefault(value, number)
            if first != number:
                a, b = pairs[first].a, pairs[first].b
                raise SceneError(
                    ('pairs', number, *field),
                    f'the same {what} as that of {short_repr(a)} and {short_repr(b)}')


def _check_pattern(scene: Scene, number: int, is_a: np.ndarray, is_b: np.ndarray) -> None:
    """Raise SceneError for a pattern without a pair.

    is_a, is_b: the boxes (n,) that its sides match.
    """
    for side, is_matched, pattern in zip('ab', (is_a, is_b), scene.patterns[number]):
        if not is_matched.any():
            raise SceneError(('patterns', number, side),
                             f'{short_repr(pattern)} is the name of no box')
    # Ordered pairs of different boxes, less those of two fixed ones.
    every, fixed = (int(a.sum() * b.sum() - (a & b).sum()) for a, b in (
        (is_a, is_b), (is_a & scene.is_fixed, is_b & scene.is_fixed)))
    if every == fixed:
        raise SceneError(('patterns', number), 'no two boxes of this pattern are a pair of which '
                                               f'one moves{MOVES}')

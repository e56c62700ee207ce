# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A scene: boxes, fixed or moving, the pairs of them that matter, and what one tick computes.

Pairs are listed by name, or asked for by patterns of names. A broad phase in the core finds those
whose bounding boxes meet. These go through the solver as one batch. An answer is arrays, in which a
box is its index in the scene. Names are made where somebody asks for them.
"""
from __future__ import annotations

import fnmatch
import re
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import NamedTuple, NoReturn

import numpy as np

from ..core import LENGTH_MAX, native
from ..solver.checks import (
    as_floats,
    as_number,
    as_whole,
    is_row,
    name_fault,
    pose_fault,
    short_repr,
    size_fault,
)
from ..solver.contact import Contact, Contacts
from ..solver.contact_solver import ContactSolver
from ..solver.models import Model

POSE_ARRAY = 'poses'
"""Topic of the poses of all moving boxes, where they come as one message."""
ALL_BOXES = 'all boxes'
"""Source of these poses: no box of a scene file can have this name."""
NOWHERE = np.full(7, np.nan)
"""Instead of the pose of a box that is not there."""
EVERY_PAIR = (('*', '*'),)
"""Patterns of a scene in which each two boxes are a pair, if one of them moves."""
ALONE = -1
"""Instead of box b, in rows of boxes: all pairs of box a that patterns ask for."""

CONTAINER = (12.192, 2.438, 2.591)
"""Full extents of an ISO 40 ft container [m]."""


@dataclass(frozen=True)
class Box:
    """A box of the scene: fixed if it has a pose, else moving."""

    name: str
    size: tuple[float, ...]  # three full extents [m]
    pose: tuple[float, ...] | None = None  # `x y z qx qy qz qw` in the common frame, of a fixed box
    pose_topic: str = ''  # where a moving box's poses come from

    def __post_init__(self) -> None:
        def refuse(field: str, reason: str) -> NoReturn:
            raise Fault(('boxes', str(self.name), field), reason)

        if not isinstance(self.name, str):
            refuse('name', f'must be text, not {short_repr(self.name)}')
        for field, given, count in (('size', self.size, 3), ('pose', self.pose, 7)):
            if not is_row(given, count) and not (given is None and field == 'pose'):
                refuse(field, f'must be a tuple of {count} numbers, not {short_repr(given)}')
        if fault := size_fault(self.size):
            refuse('size', fault)
        if not isinstance(self.pose_topic, str):
            refuse('pose_topic', f'must be text, not {short_repr(self.pose_topic)}')
        if self.pose and self.pose_topic:
            refuse('pose_topic', f'{short_repr(self.pose_topic)}: a box with a pose never moves')
        if self.pose and (fault := pose_fault(self.pose)):
            refuse('pose', fault)


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
    """Boxes by name, and which pairs matter. Raises Fault for anything that cannot be computed.

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
            raise Fault(('pairs',), 'a scene needs at least one pair')

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
    boxes = {name: Box(name, tuple(map(float, size)), pose_topic=f'{name}/pose')
             for name, size in (('box_a', size_a), ('box_b', size_b))}
    return Scene(boxes, (Pair('', 'box_a', 'box_b'),))


KeyPath = tuple[str | int, ...]  # ('boxes', 'load', 'size') or ('pairs', 3, 'a')


def dotted(path: KeyPath) -> str:
    """Return a path in words: `boxes.load.size` or `pairs[3].a`."""
    text = ''.join(f'[{part}]' if isinstance(part, int) else f'.{part}' for part in path)
    return text.removeprefix('.')


class Fault(ValueError):
    """What is wrong with a scene, and where."""

    def __init__(self, path: KeyPath, reason: str) -> None:
        super().__init__(f'{dotted(path)}: {reason}')
        self.path, self.reason = path, reason


def _check_kinds(scene: Scene) -> None:
    """Raise Fault for the first field of a scene that is of another kind."""
    def check(is_kind: bool, path: KeyPath, kind: str, value: object) -> None:
        if not is_kind:
            raise Fault(path, f'must be {kind}, not {short_repr(value)}')

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
                raise Fault(path, fault)


def _check_pairs(boxes: Mapping[str, Box], pairs: Sequence[Pair]) -> None:
    """Raise Fault for the first thing that is wrong with listed pairs."""
    for number, pair in enumerate(pairs):
        path = ('pairs', number)
        fault = name_fault(pair.name)
        if fault and pair.name != f'{pair.a}_{pair.b}':
            raise Fault((*path, 'name'), fault)
        for side, name in (('a', pair.a), ('b', pair.b)):
            if name not in boxes:
                raise Fault((*path, side), f'{short_repr(name)} is none of the boxes')
        if pair.a == pair.b:
            raise Fault((*path, 'b'), f'{short_repr(pair.b)} is the same box as a')
        if boxes[pair.a].pose and boxes[pair.b].pose:
            raise Fault(path, f'{short_repr(pair.a)} and {short_repr(pair.b)} are both fixed')
    for what, field, values in (
            ('name', ('name',), [pair.label for pair in pairs]),
            ('pair of boxes', (), [tuple(sorted((pair.a, pair.b))) for pair in pairs])):
        first_of: dict[object, int] = {}
        for number, value in enumerate(values):
            first = first_of.setdefault(value, number)
            if first != number:
                a, b = pairs[first].a, pairs[first].b
                raise Fault(('pairs', number, *field),
                            f'the same {what} as that of {short_repr(a)} and {short_repr(b)}')


def _check_pattern(scene: Scene, number: int, is_a: np.ndarray, is_b: np.ndarray) -> None:
    """Raise Fault for a pattern without a pair; is_a, is_b: the boxes (n,) that its sides match."""
    for side, is_matched, pattern in zip('ab', (is_a, is_b), scene.patterns[number]):
        if not is_matched.any():
            raise Fault(('patterns', number, side),
                        f'{short_repr(pattern)} is the name of no box')
    # Ordered pairs of different boxes, less those of two fixed ones.
    every, fixed = (int(a.sum() * b.sum() - (a & b).sum()) for a, b in (
        (is_a, is_b), (is_a & scene.is_fixed, is_b & scene.is_fixed)))
    if every == fixed:
        raise Fault(('patterns', number), 'no two boxes of this pattern are a pair of which one '
                                          'moves')


class TooManyNear(ValueError):
    """A tick with more pairs near each other than the solver was to answer."""

    reason = 'too many pairs near'


class Answer(NamedTuple):
    """What one tick found, as arrays. Boxes are their indices in `scene`."""

    pairs: np.ndarray
    """(k, 2) boxes a and b of the pairs in contact: those listed, then the others by index. Behind
    them, in the same order, the pairs apart whose separation is at most the solver's margin."""
    contacts: Contacts
    """(k,) their contacts; those of pairs apart are not colliding."""
    near: int  # how many pairs the broad phase left to the solver
    stale: np.ndarray
    """(m, 2) boxes of the listed pairs that could not be evaluated, because one has no pose that is
    recent enough. (box, ALONE): all pairs of a box that patterns ask for."""
    scene: Scene

    @property
    def touching(self) -> int:
        """Return how many pairs are in contact: the first rows."""
        return self.contacts.colliding.tobytes().count(True)  # numpy takes three times as long

    def named(self) -> list[tuple[Pair, Contact]]:
        """Return each pair with its contact, by name."""
        return [(self.scene.pair_of(a, b), contact)
                for (a, b), contact in zip(self.pairs.tolist(), self.contacts)]

    def named_stale(self) -> list[Pair]:
        """Return the stale pairs by name; a box whose pairs all are is paired with itself."""
        return [self.scene.pair_of(a, b) for a, b in self.stale.tolist()]


class SceneSolver:
    """Contacts of all pairs of a scene, one tick at a time.

    Raises ValueError for a model that does not go with the sizes. Keeps the last order of the
    boxes: use one per thread.
    """

    def __init__(self, scene: Scene, *, model: str | Model = 'exact',
                 margin: float = 0.0, most_near: int = sys.maxsize) -> None:
        """Begin without poses.

        margin: up to which separation pairs apart are listed [m].
        most_near: pairs that a tick may leave to the model; of more, it raises TooManyNear.
        """
        if not isinstance(scene, Scene):
            raise ValueError(f'scene must be a Scene, not {short_repr(scene)}')
        margin = as_number(margin, 'margin')
        if not 0.0 <= margin <= LENGTH_MAX:
            raise ValueError(f'margin must lie within 0 and {LENGTH_MAX:g} m, not {margin:g}')
        most_near = as_whole(most_near, 'most_near', 0, sys.maxsize)
        self.scene = scene
        self.model = model
        self.margin = margin
        self._most_near = most_near
        boxes = list(scene.boxes.values())
        self._size = np.array([box.size for box in boxes], dtype=float)
        self._poses = np.array([box.pose or [np.nan] * 7 for box in boxes], dtype=float)
        self._moving = np.array([scene.index_of[name] for name in scene.moving])
        self._broad_phase = native.BroadPhase(self._size, scene.is_fixed, margin, scene.rows,
                                              *scene.groups)
        self._solver = ContactSolver(model=model, margin=margin)
        self._again = partial(SceneSolver, model=model, margin=margin, most_near=most_near)
        self._warm_up()

    def __reduce__(self) -> tuple[Callable[..., SceneSolver], tuple[Scene]]:
        """Pickle the arguments."""
        return self._again, (self.scene,)

    def _warm_up(self) -> None:
        """Let the model refuse sizes that it has no answer for.

        Only a corner overlaps: where faces coincide, a soup takes seconds.
        """
        kinds = np.unique(self._size, axis=0)
        listed = np.unique(self._size[self.scene.rows].reshape(-1, 6), axis=0)
        both = [listed]
        if self.scene.patterns:
            first = np.broadcast_to(kinds[0], kinds.shape)
            both += [np.hstack((first, kinds)), np.hstack((kinds, first))]
        size_a, size_b = np.split(np.concatenate(both), 2, axis=1)
        a, b = np.zeros((2, len(size_a), 7))
        a[:, 6] = b[:, 6] = 1.0
        b[:, :3] = 0.5 * (size_a + size_b) - 0.02 * np.minimum(size_a, size_b)
        self._solver.batch(a, b, size_a=np.ascontiguousarray(size_a),
                           size_b=np.ascontiguousarray(size_b))
        self([None] * len(self.scene.moving))

    def __call__(self, poses: Sequence[np.ndarray | None] | np.ndarray) -> Answer:
        """Return the answer to one tick: a pose (7,) or None for each box of `scene.moving`.

        Or an array (n, 7) with a row for each, all NaN for None.
        Raises ValueError for numbers that are no pose, and for more or fewer poses than that.
        """
        self._set_poses(poses)
        pairs, stale, refused = self._broad_phase.find(self._poses, self._most_near)
        if refused >= 0:
            raise ValueError(f'pose of {self.scene.names[refused]}: '
                             f'{pose_fault(self._poses[refused])}')
        near = len(pairs)
        if near > self._most_near:
            raise TooManyNear(f'more than {self._most_near} pairs are near each other, and so many '
                              'are not answered')
        contacts = self._solver.batch(self._poses, sizes=self._size, pairs=pairs)
        if self.margin or False in contacts.colliding.tobytes():
            listed = contacts.separation <= self.margin if self.margin else contacts.colliding
            rows = np.flatnonzero(listed)
            if self.margin:
                rows = rows[np.argsort(~contacts.colliding[rows], kind='stable')]
            pairs, contacts = pairs[rows], contacts[rows]
        return Answer(pairs, contacts, near, stale, self.scene)

    def _set_poses(self, poses: Sequence[np.ndarray | None] | np.ndarray) -> None:
        """Take the poses of the moving boxes."""
        if native.write_poses(self._poses, self._moving, poses):  # those of every node
            return
        is_array = isinstance(poses, np.ndarray) and poses.ndim > 0
        if not is_array and (not isinstance(poses, Sequence) or isinstance(poses, str)):
            raise ValueError('poses must be a list of a pose or None for each box that moves, not '
                             f'{short_repr(poses)}')
        if len(poses) != len(self._moving):
            raise ValueError(f'{len(poses)} poses, but {len(self._moving)} boxes move: '
                             f'{short_repr(list(self.scene.moving))}; give a list of a pose or '
                             'None for each')
        if isinstance(poses, np.ndarray):
            self._poses[self._moving] = as_floats(poses, 'poses', 'rows (n, 7)', (None, 7))
            return
        for name, index, pose in zip(self.scene.moving, self._moving, poses):
            self._poses[index] = NOWHERE if pose is None else as_floats(
                pose, f'pose of {name}', 'a pose (x y z qx qy qz qw)', (7,))

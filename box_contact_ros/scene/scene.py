# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A scene: boxes, fixed or moving, and the pairs of them that matter.

Pairs are listed by name, or asked for by patterns of names. In arrays, a box is its index in the
scene. A body is several boxes that are fixed to each other: it has one pose, and its boxes have
theirs in its frame.
"""
from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import count
from typing import Any, NamedTuple

import numpy as np

from ..core import native
from ..solver.checks import name_fault, nearest_name, pose_fault, short_repr
from .boxes import AT_FRAME, Box, Boxes, Frame, KeyPath, SceneError, poses_of
from .patterns import Pattern, Patterns

EVERY_PAIR = (('*', '*'),)
"""Patterns of a scene in which each two boxes are a pair, if one of them moves."""
MOVES = (': leave `pose` out of a box that moves, and give its pose in the call; or, in Python, '
         'ask contacts_of(sizes, poses)')
"""What to do about boxes that are all fixed."""
POSES = ('topics', 'named')
"""How the poses of what moves come: on a topic each; in one message, by names. The boxes that move
change in scenes of the latter kind alone."""
ALONE = -1
"""Instead of box b, in rows of boxes: all pairs of box a that patterns ask for."""


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


@dataclass(frozen=True)
class Scene:
    """Boxes by name, and which pairs matter. Raises SceneError for what cannot be computed.

    A pattern asks for all pairs of two boxes that it matches and that move against each other. The
    name of a body stands for all its boxes. If both sides match both boxes, a is the one whose name
    comes first, by the bytes of UTF-8.
    """

    boxes: Mapping[str, Box]
    pairs: tuple[Pair, ...] = ()
    """The pairs that are listed by the names of their boxes."""
    frame_id: str = ''
    """The common frame that all poses must be in; empty: any, as long as it is the same."""
    poses: str = 'topics'
    """How the poses of what moves come: one of POSES."""
    patterns: tuple[Pattern, ...] = ()
    """Pairs of patterns of names of boxes or bodies, such as (('load', '*'), ('crane*', 'c?'))."""
    bodies: Mapping[str, Frame] = field(default_factory=dict)
    """Bodies by name; each box names the one that it is a part of."""
    _arrays: Boxes = field(init=False, repr=False, compare=False)
    _matched: Patterns = field(init=False, repr=False, compare=False)
    moving: tuple[str, ...] = field(init=False, repr=False, compare=False)
    """Names of boxes, then of bodies that move; with topics, only of those in a pair."""

    def __post_init__(self) -> None:
        self._make()
        for number in range(len(self.patterns)):
            _check_pattern(self, number)
        if not self.pairs and not self.patterns:
            raise SceneError(('pairs',), 'a scene needs at least one pair')

    def _make(self) -> None:
        """Check all but what patterns match, and make the arrays."""
        _check_kinds(self)
        _check_bodies(self)
        self._set(_arrays=Boxes.of(self.boxes, self.bodies),
                  _matched=Patterns.of(self.patterns, self.boxes, self.bodies))
        _check_pairs(self)
        self._set(moving=self._movers())

    def _set(self, **fields: Any) -> None:
        for name, value in fields.items():
            object.__setattr__(self, name, value)

    @property
    def in_one_message(self) -> bool:
        """Whether one message has the poses of all that moves; else each has a topic."""
        return self.poses != 'topics'

    def __getstate__(self) -> dict[str, Any]:
        """Pickle all but the core's filter, which is made again."""
        return {key: value for key, value in vars(self).items() if key != 'filter'}

    def changed(self, changes: Mapping[str, Box | None], frames: Mapping[str, Frame | None],
                ) -> tuple[Scene, np.ndarray]:
        """Return the scene in which boxes are new, or replaced where they are, or gone (None).

        frames: the same of bodies.
        New boxes come last. Patterns may match no box then. Returns also the index (n,) of each box
        in this scene, -1 where pose or size differ.
        Raises SceneError for a listed pair whose boxes no longer move against each other. The time
        goes into copies: only what changes is looked at.
        """
        given = {name: box for name, box in changes.items() if box is not None}
        boxes = {**self.boxes, **given}
        for name in changes.keys() - given.keys():
            del boxes[name]
        bodies: dict[str, Frame] = {name: frame for name, frame in {**self.bodies, **frames}.items()
                                    if frame is not None}
        arrays, source = self._arrays.changed(changes, self.bodies, bodies)
        scene = object.__new__(Scene)
        scene._set(boxes=boxes, bodies=bodies, pairs=self.pairs, frame_id=self.frame_id,
                   poses=self.poses, patterns=self.patterns, _arrays=arrays,
                   _matched=self._matched.changed(given, source, boxes, bodies))
        # Topics stay.
        scene._set(moving=scene._movers() if self.in_one_message else self.moving)
        if self.pairs and (frames or not self.listed_names.isdisjoint(changes)):
            _check_pairs(scene)
        is_same = [self.bodies.get(name) is frame for name, frame in bodies.items()]
        stays = (source < len(self.boxes)) & np.array([*is_same, True])[arrays.body_of]
        return scene, np.where(stays, source, -1)

    @classmethod
    def as_changed(cls, **fields: Any) -> Scene:
        """Return a scene of all these fields as changes may leave it: patterns may match no box.

        Raises SceneError.
        """
        scene = object.__new__(cls)
        scene._set(**fields)
        scene._make()
        return scene

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the boxes by index."""
        return self._arrays.names

    @property
    def index_of(self) -> Mapping[str, int]:
        """Return the indices of the boxes by name."""
        return self._arrays.index_of

    @property
    def sizes(self) -> np.ndarray:
        """Return full extents (n, 3) [m]."""
        return self._arrays.sizes

    @property
    def body_of(self) -> np.ndarray:
        """Return the index of the body (n,) that each box is a part of, or -1."""
        return self._arrays.body_of

    @property
    def box_poses(self) -> np.ndarray:
        """Return the poses (n, 7) that boxes have in the scene, or in their bodies; NaN: none."""
        return self._arrays.poses

    @property
    def sides(self) -> np.ndarray:
        """Return which sides of patterns each box matches: a, b of the first, and so on."""
        return self._matched.sides

    @property
    def is_fixed(self) -> np.ndarray:
        """Return which boxes (n,) never move."""
        return self._arrays.is_fixed

    @cached_property
    def _parts(self) -> Mapping[str, Box | Frame]:
        """Boxes and, behind them, bodies by name."""
        return {**self.boxes, **self.bodies}

    @cached_property
    def row_of(self) -> Mapping[str, int]:
        """Return by name the rows of poses (n + m, 7): those of boxes, then those of bodies."""
        bodies = dict(zip(self.bodies, count(len(self.boxes))))
        return {**self.index_of, **bodies} if bodies else self.index_of

    @cached_property
    def listed_names(self) -> frozenset[str]:
        """Return the names of the boxes of listed pairs."""
        return frozenset(name for pair in self.pairs for name in (pair.a, pair.b))

    def mover(self, box: str) -> str:
        """Return whose pose moves a box: the name of its body, else its own."""
        return self.boxes[box].body or box

    @cached_property
    def rigid(self) -> np.ndarray:
        """Return a number (n,) that boxes share which do not move against each other.

        Those of one body do not, and those that are fixed: they are never a pair.
        """
        alone = 1 + len(self.bodies) + np.arange(len(self.boxes))
        return np.where(self.is_fixed, 0, np.where(self.body_of < 0, alone, 1 + self.body_of))

    @cached_property
    def placement(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the row of each box's body (n,) or -1, and its pose (n, 7) in the body's frame."""
        of_body = self.body_of >= 0
        local = np.where(of_body[:, None], self._arrays.poses, AT_FRAME)
        return np.where(of_body, len(self.boxes) + self.body_of, -1).astype(np.int64), local

    def fixed_poses(self) -> np.ndarray:
        """Return new poses (n + m, 7) of boxes and bodies, by `row_of`: NaN for what moves."""
        poses = np.concatenate((self._arrays.poses, poses_of(self.bodies)))
        if self.bodies:
            self.place_boxes(poses)
        return poses

    def place_boxes(self, poses: np.ndarray) -> None:
        """Write the poses of the boxes of bodies, by those of bodies, into poses (n + m, 7).

        Raises ValueError for a body whose numbers are no pose. One with seven NaN is not there, nor
        are its boxes.
        """
        row = native.place_boxes(poses, *self.placement)
        if row >= 0:
            raise ValueError(f'pose of {list(self._parts)[row]}: {pose_fault(poses[row])}')

    @cached_property
    def rows(self) -> np.ndarray:
        """Return the listed pairs (m, 2) as indices of their boxes."""
        index = self.index_of
        return np.array([(index[pair.a], index[pair.b]) for pair in self.pairs],
                        dtype=np.int64).reshape(-1, 2)

    @cached_property
    def filter(self) -> native.Filter:
        """Return which pairs the scene has, and which box is a; it takes no box for fixed."""
        order = np.empty(len(self.boxes), np.int32)
        order[np.argsort(np.array(self.names, object), kind='stable')] = np.arange(len(order))
        return native.Filter(self.rows, self._matched.group, self._matched.allowed, self.body_of,
                             order)

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
        return (a, b) in self._listed or bool(
            self.rigid[a] != self.rigid[b] and self.filter.sides(np.array([(a, b)]))[0] == 1)

    @property
    def is_matched(self) -> np.ndarray:
        """Return which boxes (n,) some side of a pattern matches."""
        return np.asarray(self._matched.sides.any(axis=1))

    @cached_property
    def is_paired(self) -> np.ndarray:
        """Return which boxes (n,) are in a pair."""
        paired = np.zeros(len(self.boxes), bool)
        paired[self.rows.ravel()] = True
        if not self.patterns:
            return paired
        group, allowed = self._matched.group, self._matched.allowed
        meet = (allowed > 0).astype(np.int64)
        partners = (np.bincount(group, minlength=len(meet)) @ meet)[group]
        # Fixed boxes do not meet, nor do boxes of one body, nor a box and itself.
        own = meet[group, group]
        held = self.is_fixed | (self.body_of >= 0)
        sets = np.where(self.is_fixed, 0, 1 + self.body_of)[held]
        shape = 1 + len(self.bodies), len(meet)
        counts = np.bincount(sets * len(meet) + group[held], minlength=shape[0] * shape[1])
        own[held] = (counts.reshape(shape) @ meet)[sets, group[held]]
        return paired | (partners > own)

    @cached_property
    def is_asked(self) -> np.ndarray:
        """Return which boxes (n,) patterns pair with others."""
        group, allowed = self._matched.group, self._matched.allowed
        return (allowed.max(axis=1) > 0)[group] if self.patterns else np.zeros(len(group), bool)

    def partners(self, index: int) -> np.ndarray:
        """Return which boxes (n,) patterns pair a box with, without those of listed pairs."""
        group, allowed = self._matched.group, self._matched.allowed
        if not self.patterns:
            return np.zeros(len(self.boxes), bool)
        met: np.ndarray = np.greater(allowed[group[index]][group], 0)
        met[self.rigid == self.rigid[index]] = False
        met[self.rows[(self.rows == index).any(axis=1)]] = False
        return met

    def _later_partners(self, index: int) -> np.ndarray:
        """Return the boxes (n,) behind a box that patterns pair it with."""
        return index + 1 + np.flatnonzero(self.partners(index)[index + 1:])

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
        if not self.patterns:
            return len(self.pairs)
        group, allowed = self._matched.group, self._matched.allowed
        meet = (allowed > 0).astype(np.int64)

        def pairs_among(boxes: np.ndarray) -> int:
            """Return how many pairs are within sets, by their numbers (..., g) of boxes a group."""
            return int(((boxes @ meet) * boxes - boxes * meet.diagonal()).sum() // 2)

        shape = self.rigid.max() + 1, len(meet)
        rigid = np.bincount(self.rigid * len(meet) + group, minlength=shape[0] * shape[1])
        listed = meet[tuple(group[self.rows].T)].sum()
        return len(self.pairs) + pairs_among(np.bincount(group, minlength=len(meet))) - (
            pairs_among(rigid.reshape(shape))) - int(listed)

    def _movers(self) -> tuple[str, ...]:
        """Return `moving`."""
        moves = ~self.is_fixed
        if not self.in_one_message:
            asked = self.is_asked.copy()
            asked[self.rows.ravel()] = True
            moves &= asked
        movers = [self.names[box] for box in np.flatnonzero(moves).tolist()]
        bodies = {self.mover(name) for name in movers} if self.bodies else set()
        return (*(name for name in movers if not self.boxes[name].body),
                *(name for name in self.bodies if name in bodies))


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
    check(isinstance(scene.bodies, Mapping), ('bodies',), 'Frames by name', scene.bodies)
    for name, frame in scene.bodies.items():
        check(isinstance(name, str), ('bodies',), 'Frames by name', scene.bodies)
        check(isinstance(frame, Frame), ('bodies', name), 'a Frame', frame)
    for part in ('pairs', 'patterns'):
        rows = getattr(scene, part)
        check(isinstance(rows, tuple | list), (part,), f'a tuple of {part}', rows)
        for number, row in enumerate(rows):
            check(isinstance(row, Pair) if part == 'pairs' else
                  isinstance(row, tuple | list) and len(row) == 2, (part, number),
                  'a Pair' if part == 'pairs' else 'a tuple of the names a and b', row)
            for value in row:
                check(isinstance(value, str), (part, number), 'of text', row)
    check(isinstance(scene.frame_id, str), ('frame_id',), 'text', scene.frame_id)
    check(scene.poses in POSES, ('poses',), f'one of {", ".join(POSES)}', scene.poses)
    for path, names in ((('frame_id',), (scene.frame_id,)), (('boxes',), scene.boxes),
                        (('bodies',), scene.bodies)):
        for name in names:
            if fault := name_fault(name):
                raise SceneError(path, f'{short_repr(name)} {fault}')


def _check_bodies(scene: Scene) -> None:
    """Raise SceneError for the first body that is not that of some boxes."""
    for name, box in scene.boxes.items():
        if box.body and box.body not in scene.bodies:
            raise SceneError(
                ('boxes', name, 'body'), f'{short_repr(box.body)} is none of the bodies'
                                         f'{nearest_name(box.body, scene.bodies)}')
    used = {box.body for box in scene.boxes.values()}
    for name in scene.bodies:
        if name in scene.boxes:
            raise SceneError(('bodies', name), f'{short_repr(name)} is the name of a box, too')
        if name not in used:
            raise SceneError(('bodies', name), f'no box is a part of {short_repr(name)}')


def _check_pairs(scene: Scene) -> None:
    """Raise SceneError for the first thing that is wrong with listed pairs."""
    boxes, pairs = scene.boxes, scene.pairs
    for number, pair in enumerate(pairs):
        path = ('pairs', number)
        fault = name_fault(pair.name)
        if fault and pair.name != f'{pair.a}_{pair.b}':
            raise SceneError((*path, 'name'), f'{short_repr(pair.name)} {fault}')
        for side, name in (('a', pair.a), ('b', pair.b)):
            if name not in boxes:
                raise SceneError((*path, side), f'{short_repr(name)} is ' + (
                    'a body: name it in patterns' if name in scene.bodies else
                    'none of the boxes'))
        if pair.a == pair.b:
            raise SceneError((*path, 'b'), f'{short_repr(pair.b)} is the same box as a')
        index, other = scene.index_of[pair.a], scene.index_of[pair.b]
        if scene.rigid[index] == scene.rigid[other]:
            raise SceneError(path, f'{short_repr(pair.a)} and {short_repr(pair.b)} are ' + (
                f'both fixed{MOVES}' if scene.is_fixed[index] else 'parts of one body'))
    for what, key, values in (
            ('name', ('name',), [pair.label for pair in pairs]),
            ('pair of boxes', (), [tuple(sorted((pair.a, pair.b))) for pair in pairs])):
        first_of: dict[object, int] = {}
        for number, value in enumerate(values):
            first = first_of.setdefault(value, number)
            if first != number:
                a, b = pairs[first].a, pairs[first].b
                raise SceneError(
                    ('pairs', number, *key),
                    f'the same {what} as that of {short_repr(a)} and {short_repr(b)}')


def _check_pattern(scene: Scene, number: int) -> None:
    """Raise SceneError for a pattern without a pair."""
    is_a, is_b = scene._matched.sides.T[2 * number:2 * number + 2]
    for side, is_matched, pattern in zip('ab', (is_a, is_b), scene.patterns[number]):
        if not is_matched.any():
            raise SceneError(('patterns', number, side),
                             f'{short_repr(pattern)} is the name of no box')
    # Of all ordered pairs, those within no rigid group.
    in_a, in_b = (np.bincount(scene.rigid[side], minlength=scene.rigid.max() + 1)
                  for side in (is_a, is_b))
    if in_a.sum() * in_b.sum() == in_a @ in_b:
        raise SceneError(('patterns', number), 'no two boxes of this pattern move against each '
                                               f'other{MOVES}')

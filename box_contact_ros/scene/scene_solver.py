# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A scene: boxes, fixed or moving, the pairs of them that matter, and what one tick computes.

Nothing outside the listed pairs is answered. A broad phase leaves the pairs whose axis-aligned
bounding boxes come near each other. These go through the solver as one batch.
"""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from ..core import LENGTH_MAX, native
from ..solver.checks import absent_poses, as_floats, pose_fault, short_repr, size_fault
from ..solver.contact import Contact
from ..solver.contact_solver import ContactSolver

POSE_ARRAY = 'poses'
"""Topic of the poses of all moving boxes, where they come as one message."""
ALL_BOXES = 'all boxes'
"""Source of these poses: no box of a scene file can have this name."""

SWEPT_FROM = 64
"""Pairs a box: above this the broad phase sweeps the boxes, below it tests each pair. Measured: the
two take as long there."""
SWEPT_MOST = 2**22
"""Comparisons of a sweep. Of more, as where thousands of boxes are in one place, testing each
listed pair is faster, and needs no room for the others."""

_new_tuple = tuple.__new__  # a named tuple's own constructor is Python code


CONTAINER = (12.192, 2.438, 2.591)
"""Full extents of an ISO 40 ft container [m]."""


@dataclass(frozen=True)
class Box:
    """A box of the scene: fixed if it has a pose, else moving."""

    name: str
    size: tuple[float, ...]  # three full extents [m]
    pose: tuple[float, ...] | None = None  # `x y z qx qy qz qw` in the common frame, of a fixed box
    pose_topic: str = ''  # where a moving box's poses come from


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
    """Boxes by name, and the pairs. Raises Fault for anything that cannot be computed."""

    boxes: Mapping[str, Box]
    pairs: tuple[Pair, ...]
    frame_id: str = ''
    """The common frame that all poses must be in; empty: any, as long as it is the same."""
    pose_array: bool = False
    """Whether one message has the poses of all moving boxes; else each box has a topic."""

    def __post_init__(self) -> None:
        _check(self.boxes, self.pairs)

    @cached_property
    def moving(self) -> tuple[str, ...]:
        """Names of the moving boxes in their order; without an array, only of those in a pair."""
        listed = {name for pair in self.pairs for name in (pair.a, pair.b)}
        return tuple(name for name, box in self.boxes.items()
                     if box.pose is None and (self.pose_array or name in listed))

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


def _check(boxes: Mapping[str, Box], pairs: Sequence[Pair]) -> None:
    """Raise Fault for the first thing that is wrong with a scene."""
    for name, box in boxes.items():
        for key, given, count in (('size', box.size, 3), ('pose', box.pose, 7)):
            if given is not None and (not isinstance(given, tuple | list) or len(given) != count):
                raise Fault(('boxes', name, key),
                            f'must be a tuple of {count} numbers, not {short_repr(given)}')
        fault = size_fault(box.size)
        if fault:
            raise Fault(('boxes', name, 'size'), fault)
        if box.pose and box.pose_topic:
            raise Fault(('boxes', name, 'pose_topic'), 'a box with a pose never moves')
        fault = pose_fault(box.pose) if box.pose else None
        if fault:
            raise Fault(('boxes', name, 'pose'), fault)
    if not pairs:
        raise Fault(('pairs',), 'a scene needs at least one pair')
    for number, pair in enumerate(pairs):
        path = ('pairs', number)
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


class TooManyNear(ValueError):
    """A tick with more pairs near each other than the solver was to answer."""

    reason = 'too many pairs near'


class Answer(NamedTuple):
    """What one tick found."""

    touching: list[tuple[Pair, Contact]]  # the pairs in contact
    stale: list[Pair]
    """The pairs that could not be evaluated, because a box has no pose that is recent enough."""
    near: int  # how many pairs the broad phase left to the solver
    close: Sequence[tuple[Pair, Contact]] = ()
    """The pairs apart whose separation is at most `margin`; their contacts are not colliding."""


class SceneSolver:
    """Contacts of all pairs of a scene, one tick at a time.

    Raises ValueError for a model that does not go with one of the pairs' sizes. Keeps the last
    poses: use one per thread.
    """

    def __init__(self, scene: Scene, *, model: str = 'exact', weights: str | None = None,
                 margin: float = 0.0, most_near: int | None = None) -> None:
        """Begin without poses.

        margin: up to which separation pairs apart are listed [m].
        most_near: pairs that a tick may leave to the model; of more, it raises TooManyNear.
        """
        if not 0.0 <= margin <= LENGTH_MAX:
            raise ValueError(f'margin must lie within 0 and {LENGTH_MAX:g} m, not {margin:g}')
        self.scene = scene
        self.model = model
        self.margin = margin
        self._most_near = len(scene.pairs) if most_near is None else most_near
        numbers = {name: number for number, name in enumerate(scene.boxes)}
        boxes = list(scene.boxes.values())
        self._size = np.array([box.size for box in boxes], dtype=float)
        self._bounded = np.minimum(self._size + margin, LENGTH_MAX)
        """Extents that bounding boxes are made of: those of two close boxes meet."""
        self._first = np.array([numbers[pair.a] for pair in scene.pairs])
        self._second = np.array([numbers[pair.b] for pair in scene.pairs])
        self._moving = np.array([numbers[name] for name in scene.moving])
        self._poses = np.array([box.pose or (0, 0, 0, 0, 0, 0, 1) for box in boxes], dtype=float)
        self._known = np.array([box.pose is not None for box in boxes])
        self._low, self._high = np.empty((2, len(boxes), 3))
        self._near, self._unknown = np.empty((2, len(scene.pairs)), dtype=np.int64)
        self._moves = ~self._known
        # Fixed boxes are bounded here, once and for all.
        self._near_pairs(np.flatnonzero(self._known))
        self._is_swept = len(scene.pairs) > SWEPT_FROM * len(boxes)
        if self._is_swept:
            keys = self._key(self._first, self._second)
            self._by_key = np.argsort(keys)
            self._keys = keys[self._by_key]
        pair = scene.pairs[0]
        self._solver = ContactSolver(scene.boxes[pair.a].size, scene.boxes[pair.b].size,
                                     model=model, weights=weights, margin=margin)
        # A single pair needs no test and no batch. Its sides are among the poses, then fixed ones.
        self._only = pair if len(scene.pairs) == 1 else None
        self._in_order = scene.moving == (pair.a, pair.b)
        names = [*scene.moving, pair.a, pair.b]
        self._sides = itemgetter(names.index(pair.a), names.index(pair.b))
        self._fixed = [self._poses[numbers[name]] for name in (pair.a, pair.b)]
        self._warm_up()

    @property
    def fallbacks(self) -> int:
        """Contacts so far that the model handed to `exact`: see `mlp`."""
        return self._solver.fallbacks - self._warm_up_answers

    def _near_pairs(self, moved: np.ndarray, *, listed: bool = True) -> tuple[int, int]:
        """Bound the boxes `moved` anew, then, if `listed`, write to `_near` which pairs may touch.

        Pairs without poses go to `_unknown`. Returns how many there are of each; or −1, and the
        number of a box whose pose is not valid.
        """
        pairs = slice(None) if listed else slice(0)
        return native.near_pairs(
            self._poses, self._bounded, moved, self._low, self._high, self._known,
            self._first[pairs], self._second[pairs], self._near, self._unknown)

    def _key(self, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """Return a number for every two boxes, the same for both orders."""
        return np.minimum(first, second) * len(self._known) + np.maximum(first, second)

    def _broad_phase(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the pairs that may touch and those without poses; ValueError for a bad pose."""
        count, left_out = self._near_pairs(self._moving, listed=not self._is_swept)
        if count < 0:
            box = list(self.scene.boxes)[left_out]
            raise ValueError(f'pose of {box}: {pose_fault(self._poses[left_out])}')
        swept = native.near_boxes(self._low, self._high, self._known, self._moves,
                                  SWEPT_MOST) if self._is_swept else None
        if self._is_swept and swept is None:
            count, left_out = self._near_pairs(self._moving[:0])
        if swept is None:
            return self._near[:count], self._unknown[:left_out]
        # Sorted keys are looked up several times faster.
        keys = np.sort(self._key(*swept.T))
        at = np.searchsorted(self._keys, keys)
        is_pair = self._keys[np.minimum(at, len(self._keys) - 1)] == keys
        unknown = self._unknown[:0] if self._known.all() else np.flatnonzero(
            ~(self._known[self._first] & self._known[self._second]))
        return np.sort(self._by_key[at[is_pair]]), unknown

    def _warm_up(self) -> None:
        """Let the model refuse sizes that it has no answer for.

        Only a corner overlaps: where faces coincide, a soup takes seconds.
        """
        sizes = {name: tuple(box.size) for name, box in self.scene.boxes.items()}
        kinds = dict.fromkeys((sizes[pair.a], sizes[pair.b]) for pair in self.scene.pairs)
        size_a, size_b = np.array(list(kinds), dtype=float).transpose(1, 0, 2)
        a, b = np.zeros((2, len(kinds), 7))
        a[:, 6] = b[:, 6] = 1.0
        b[:, :3] = 0.5 * (size_a + size_b) - 0.02 * np.minimum(size_a, size_b)
        self._solver.batch(a, b, size_a=size_a, size_b=size_b)
        self([None] * len(self.scene.moving))
        self._warm_up_answers = self._solver.fallbacks

    def __call__(self, poses: Sequence[np.ndarray | None] | np.ndarray) -> Answer:
        """Return the answer to one tick: a pose (7,) or None for each box of `scene.moving`.

        Or an array (n, 7) with a row for each, all NaN for None.
        Raises ValueError for numbers that are no pose, and for more or fewer poses than that.
        """
        if len(poses) != len(self.scene.moving):
            raise ValueError(f'{len(poses)} poses, but {len(self.scene.moving)} boxes move: '
                             f'{short_repr(list(self.scene.moving))}; give a list of a pose or '
                             'None for each')
        if isinstance(poses, np.ndarray):
            rows = as_floats(poses, 'poses', 'poses (n, 7)', (None, 7))
            absent = absent_poses(rows)
            if self._only is None:
                self._poses[self._moving], self._known[self._moving] = rows, ~absent
                return self._tick()
            poses = [None if gone else pose for pose, gone in zip(rows, absent)]
        if self._only is not None:
            a, b = poses if self._in_order else self._sides((*poses, *self._fixed))
            if a is None or b is None:
                return Answer([], [self._only], 0)
            contact = self._solver(a, b)
            entries = [(self._only, contact)]
            if contact.colliding:
                return _new_tuple(Answer, (entries, [], 1, ()))
            return _new_tuple(
                Answer, ([], [], 1, entries if contact.separation <= self.margin else ()))
        for number, pose in zip(self._moving, poses, strict=True):
            self._known[number] = pose is not None
            if pose is not None:
                if type(pose) is not np.ndarray or pose.dtype != np.float64 or pose.shape != (7,):
                    box = list(self.scene.boxes)[number]
                    pose = as_floats(pose, f'pose of {box}', 'a pose (x y z qx qy qz qw)', (7,))
                self._poses[number] = pose
        return self._tick()

    def _tick(self) -> Answer:
        """Return the answer to the poses that are set."""
        near, unknown = self._broad_phase()
        pairs = self.scene.pairs
        if len(near) > self._most_near:
            raise TooManyNear(f'{len(near)} pairs are near each other: more than '
                              f'{self._most_near} are not answered')
        stale = [pairs[i] for i in unknown]
        touching: list[tuple[Pair, Contact]] = []
        close: list[tuple[Pair, Contact]] = []
        if len(near):
            first, second = self._first[near], self._second[near]
            contacts = self._solver.batch(self._poses[first], self._poses[second],
                                          size_a=self._size[first], size_b=self._size[second])
            for row in np.flatnonzero(contacts.separation <= self.margin if self.margin
                                      else contacts.colliding):
                contact = contacts.row(int(row))
                (touching if contact.colliding else close).append((pairs[near[row]], contact))
        return Answer(touching, stale, len(near), close)

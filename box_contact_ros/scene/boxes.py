# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Boxes, and bodies of several of them that are fixed to each other."""
from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import count
from typing import Any

import numpy as np

from ..solver.checks import as_floats, pose_fault, short_repr, size_fault
from ..solver.poses import as_pose

MOST_BOXES = 100_000
"""Of a scene that changes."""
NOWHERE = (np.nan,) * 7
"""Instead of the pose of a box that is not there."""
AT_FRAME = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
"""Pose of a frame in itself."""
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


def _as_numbers(value: Any, key: str, shape: str, count: int) -> tuple[float, ...]:
    """Return so many numbers; raise ValueError for others."""
    # What files and most programs have, for which NumPy takes three times as long.
    if (type(value) in (tuple, list) and len(value) == count
            and {float, int}.issuperset(map(type, value))):
        with suppress(OverflowError):
            return tuple(map(float, value))
    array = as_pose(value, key) if key == 'pose' else as_floats(value, key, shape, (count,))
    return tuple(array.tolist())


def _keep(part: object, key: str, shape: str, count: int,
          fault_of: Callable[[Sequence[float]], str | None]) -> None:
    """Turn a field of a box or body into a tuple of numbers; raise SceneError for others."""
    try:
        numbers = _as_numbers(getattr(part, key), key, shape, count)
    except ValueError as error:
        raise SceneError((key,), str(error).removeprefix(f'{key} ')) from error
    if fault := fault_of(numbers):
        raise SceneError((key,), fault)
    object.__setattr__(part, key, numbers)


def _keep_pose(part: Box | Frame) -> None:
    """Check the fields that boxes and bodies share."""
    if not isinstance(part.pose_topic, str):
        raise SceneError(('pose_topic',), f'must be text, not {short_repr(part.pose_topic)}')
    if part.pose is not None:
        _keep(part, 'pose', 'a pose (x y z qx qy qz qw)', 7, pose_fault)


@dataclass(frozen=True)
class Box:
    """A box of the scene: a part of a body, else fixed if it has a pose, else moving.

    Raises SceneError.
    """

    size: Sequence[float] | np.ndarray  # three full extents [m]
    pose: Sequence[float] | np.ndarray | None = None
    """`x y z qx qy qz qw` in the common frame, of a fixed box; in the body's, of a part of one."""
    pose_topic: str = ''  # where a moving box's poses come from
    body: str = ''  # the body that the box is a part of

    def __post_init__(self) -> None:
        if not isinstance(self.body, str):
            raise SceneError(('body',), f'must be text, not {short_repr(self.body)}')
        _keep(self, 'size', 'full extents (3,)', 3, size_fault)
        _keep_pose(self)
        if self.body and self.pose is None:
            object.__setattr__(self, 'pose', AT_FRAME)
        if self.pose_topic and self.pose is not None:
            raise SceneError(('pose_topic',), f'{short_repr(self.pose_topic)}: ' + (
                f'the box moves with {short_repr(self.body)}' if self.body else
                'a box with a pose never moves'))


@dataclass(frozen=True)
class Frame:
    """The frame of a body, which its boxes name: fixed if it has a pose, else moving.

    Raises SceneError.
    """

    pose: Sequence[float] | np.ndarray | None = None
    """`x y z qx qy qz qw` in the common frame, of a fixed body."""
    pose_topic: str = ''  # where a moving body's poses come from

    def __post_init__(self) -> None:
        _keep_pose(self)
        if self.pose_topic and self.pose is not None:
            raise SceneError(('pose_topic',), f'{short_repr(self.pose_topic)}: a body with a pose '
                                              'never moves')


@dataclass(frozen=True, eq=False)
class Boxes:
    """Boxes as arrays, by their index; a change makes the next ones."""

    names: tuple[str, ...]
    index_of: Mapping[str, int]  # by name
    sizes: np.ndarray  # (n, 3) full extents [m]
    poses: np.ndarray  # (n, 7) that boxes have in the scene, or in their bodies; NaN: none
    body_of: np.ndarray  # (n,) the index of the body that each box is a part of, or -1
    is_fixed: np.ndarray  # (n,) which boxes never move

    @classmethod
    def of(cls, boxes: Mapping[str, Box], bodies: Mapping[str, Frame]) -> Boxes:
        """Return the arrays of boxes and bodies by name."""
        body = {name: number for number, name in enumerate(bodies)}
        sizes = np.array([box.size for box in boxes.values()]).reshape(-1, 3)
        body_of = np.array([body.get(box.body, -1) for box in boxes.values()], np.int32)
        poses = poses_of(boxes)
        return cls(tuple(boxes), {name: index for index, name in enumerate(boxes)}, sizes, poses,
                   body_of, _are_fixed(poses, body_of, bodies))

    def changed(self, changes: Mapping[str, Box | None], before: Mapping[str, Frame],
                bodies: Mapping[str, Frame]) -> tuple[Boxes, np.ndarray]:
        """Return the arrays where boxes are new, or replaced where they are, or gone (None).

        before, bodies: those of these arrays, and of the next ones. New boxes come last. Returns
        also where each row comes from (m,): this one, or behind them all, that of what is new.
        """
        part = Boxes.of({name: box for name, box in changes.items() if box}, bodies)
        first, index_of = len(self.names), self.index_of
        gone = [index_of[name] for name, box in changes.items() if box is None]
        is_new = np.array([name not in index_of for name in part.names], bool)
        source = np.arange(first)
        source[[index_of[name] for name in part.names if name in index_of]] = (
            first + np.flatnonzero(~is_new))
        source = np.concatenate((np.delete(source, gone), first + np.flatnonzero(is_new)))
        added = tuple(name for name in part.names if name not in index_of)
        names = self.names
        if gone:
            names = tuple(name for name in names if changes.get(name, name) is not None)
            index_of = {name: index for index, name in enumerate(names)}
        index = {name: number for number, name in enumerate(bodies)}
        renumbered = np.array([index.get(name, -1) for name in before] + [-1], np.int32)
        sizes, poses, body_of = (np.concatenate(both)[source] for both in (
            (self.sizes, part.sizes), (self.poses, part.poses),
            (renumbered[self.body_of], part.body_of)))
        return Boxes(names + added, {**index_of, **dict(zip(added, count(len(names))))}, sizes,
                     poses, body_of, _are_fixed(poses, body_of, bodies)), source


def poses_of(parts: Mapping[str, Box] | Mapping[str, Frame]) -> np.ndarray:
    """Return the poses (n, 7) of boxes or bodies, NaN for those that have none."""
    return np.array([NOWHERE if part.pose is None else part.pose
                     for part in parts.values()]).reshape(-1, 7)


def _are_fixed(poses: np.ndarray, body_of: np.ndarray, bodies: Mapping[str, Frame]) -> np.ndarray:
    """Return which boxes (n,) have a pose, or a body that has one."""
    frames = [frame.pose is not None for frame in bodies.values()]
    fixed: np.ndarray = np.where(body_of < 0, ~np.isnan(poses[:, 0]),
                                 np.array([*frames, False])[body_of])
    return fixed

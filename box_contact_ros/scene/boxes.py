# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Boxes, and bodies of several of them that are fixed to each other."""
from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
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

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a pose may be: seven numbers, or the pose of another library, which becomes seven numbers.

Nothing of other libraries is imported: a Rotation has `as_quat`, a message its fields.
"""
from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..core import LENGTH_MAX, LENGTH_MIN
from .checks import (
    absent_poses,
    are_poses,
    as_floats,
    as_size,
    pose_fault,
    short_repr,
    size_fault,
)

ROW = 'x y z qx qy qz qw'
FORMS = ('; other forms of a pose are a 4×4 matrix, (position, quaternion xyzw), (position, '
         'Rotation) and a Pose message')
"""At the end of the refusal of what has none."""
PoseLike = Any
"""A pose in one of these forms, or rows or a list of them."""
ORDER = f'; a pose is {ROW}, not wxyz'
"""At the end of the refusal of numbers that are no pose."""
ORTHONORMAL = 1e-5
"""How far RᵀR of a rotation matrix R may be from 1: a hundred roundings of single precision."""


def as_pose(value: PoseLike, name: str) -> np.ndarray:
    """Return a pose of any form as numbers (7,); ValueError for anything else."""
    return _shaped(value, name, f'a pose ({ROW})', (7,))


def as_poses(value: PoseLike, name: str) -> np.ndarray:
    """Return poses of any form as rows (n, 7); ValueError for anything else."""
    return _shaped(value, name, f'poses (n, 7) of rows {ROW}', (None, 7))


def as_many(**poses: PoseLike) -> list[np.ndarray]:
    """Return poses of several names as rows (n, 7) each; one pose stands for n equal ones.

    Raises ValueError for anything else, for one pose of each name, and for unequal numbers of rows.
    """
    found = [_shaped(value, name, f'poses (n, 7) of rows {ROW}', (None, 7), (7,))
             for name, value in poses.items()]
    counts = [len(rows) for rows in found if rows.ndim == 2]
    if not counts:
        raise ValueError(f'{" and ".join(poses)} are single poses: a batch has rows (n, 7) of one '
                         'or more of them')
    if len({*counts}) > 1:
        raise ValueError(f'{" and ".join(poses)} must be equally many, or one pose, not '
                         f'{" and ".join(map(str, counts))}')
    return [rows if rows.ndim == 2 else np.tile(rows, (counts[0], 1)) for rows in found]


def as_boxes(sizes: ArrayLike, poses: ArrayLike, names: tuple[str, str] = ('sizes', 'poses'),
             ) -> tuple[np.ndarray, np.ndarray]:
    """Return full extents and poses of n boxes as arrays (n, 3) and (n, 7), checked.

    Extents (3,) are those of all boxes. A row of seven NaN is no bad pose: the box is not there.
    names: of both, in a refusal.
    """
    of_sizes, of_poses = names
    poses = as_poses(poses, of_poses)
    count = len(poses)
    sizes = as_floats(sizes, of_sizes, f'full extents (3,) or ({count}, 3)', (3,), (None, 3))
    if sizes.ndim == 2 and len(sizes) != count:
        raise ValueError(f'{of_sizes}: {len(sizes):,} size{"s"[:len(sizes) != 1]}, but {count:,} '
                         f'pose{"s"[:count != 1]}')
    if sizes.ndim == 1:
        sizes = np.tile(as_size(sizes, of_sizes), (count, 1))
    for row in np.flatnonzero(~((sizes >= LENGTH_MIN) & (sizes <= LENGTH_MAX)).all(axis=1))[:1]:
        raise ValueError(f'{of_sizes}[{row}] {size_fault(sizes[row])}')
    for row in np.flatnonzero(~(are_poses(poses) | absent_poses(poses)))[:1]:
        raise ValueError(f'{of_poses}[{row}] {pose_fault(poses[row])}{ORDER}')
    return sizes, poses


def _shaped(value: PoseLike, name: str, shapes: str, *accepted: tuple[int | None, ...],
            ) -> np.ndarray:
    numbers = _numbers(value, name)
    try:
        return as_floats(numbers, name, shapes, *accepted)
    except ValueError as error:
        raise ValueError(f'{error}{FORMS}') from None


def _numbers(value: Any, name: str) -> Any:
    """Return poses of other forms as numbers (7,) or (n, 7), and everything else as it is."""
    if type(value) is np.ndarray and value.shape[-2:] != (4, 4):
        return value
    if parts := _parts(value):
        return _joined(*parts, name)
    array = _array(value)
    if array is None:
        has_parts = isinstance(value, list | tuple) and len(value) and _parts(value[0])
        return [as_pose(one, f'{name}[{row}]') for row, one in enumerate(value)
                ] if has_parts else value
    if array.shape[-2:] != (4, 4) or array.ndim > 3:
        return array
    if not (array[..., 3, :] == (0.0, 0.0, 0.0, 1.0)).all():
        raise ValueError(f'{name} must be matrices whose last row is 0 0 0 1, not '
                         f'{short_repr(value)}')
    return _joined(array[..., :3, 3], array[..., :3, :3], name)


def _array(value: Any) -> np.ndarray | None:
    """Return numbers as an array of any shape; None: they are none, or hide what a mask says."""
    if isinstance(value, np.ma.MaskedArray):
        return None
    try:
        array = np.asarray(value)
    except (TypeError, ValueError, OverflowError):  # of unequal lengths
        return None
    return array if array.dtype.kind in 'fiu' else None


def _shape(value: Any) -> tuple[int, ...]:
    array = _array(value)
    return () if array is None else array.shape


def _parts(value: Any) -> tuple[Any, Any] | None:
    """Return position and rotation of a pose that has two parts, or None."""
    if isinstance(value, list | tuple):
        is_pair = len(value) == 2 and _shape(value[0])[-1:] == (3,) and (
            hasattr(value[1], 'as_quat') or _shape(value[1])[-1:] == (4,)
            or _shape(value[1])[-2:] == (3, 3))
        return (value[0], value[1]) if is_pair else None
    if hasattr(value, '__array__'):
        return None
    for field in ('pose', 'pose', 'transform'):  # of what is stamped, or has a covariance
        value = getattr(value, field, value)
    for names in (('position', 'orientation'), ('translation', 'rotation')):
        if all(hasattr(value, name) for name in names):
            return getattr(value, names[0]), getattr(value, names[1])
    return None


def _joined(position: Any, rotation: Any, name: str) -> np.ndarray:
    """Return poses (7,) or (n, 7) of positions (…, 3), and of (…, 4), (…, 3, 3) or Rotations."""
    if hasattr(position, 'x'):
        position = position.x, position.y, position.z
    if hasattr(rotation, 'as_quat'):
        rotation = rotation.as_quat()
    elif hasattr(rotation, 'w'):
        rotation = rotation.x, rotation.y, rotation.z, rotation.w
    elif _shape(rotation)[-2:] == (3, 3):
        rotation = _quaternions(as_floats(rotation, name, 'matrices', _shape(rotation)), name)
    place = as_floats(position, f'position of {name}', 'x y z (3,) or (n, 3)', (3,), (None, 3))
    turn = as_floats(rotation, f'quaternion of {name}', 'x y z w (4,) or (n, 4)', (4,), (None, 4))
    if place.ndim == turn.ndim == 2 and len(place) != len(turn):
        raise ValueError(f'{name} has {len(place)} positions, but {len(turn)} rotations')
    rows = np.broadcast_shapes(place.shape[:-1], turn.shape[:-1])
    return np.concatenate((np.broadcast_to(place, (*rows, 3)), np.broadcast_to(turn, (*rows, 4))),
                          axis=-1)


def _quaternions(matrices: np.ndarray, name: str) -> np.ndarray:
    """Return unit quaternions (…, 4) xyzw of rotation matrices (…, 3, 3); ValueError for others."""
    off = np.abs(matrices.swapaxes(-1, -2) @ matrices - np.eye(3)).max(initial=0.0)
    if not off <= ORTHONORMAL or (np.linalg.det(matrices) < 0.0).any():
        raise ValueError(f'{name} must have a rotation matrix: RᵀR is off 1 by {off:.2g}, or it '
                         'mirrors')
    m = np.moveaxis(matrices, (-2, -1), (0, 1))
    x, y, z = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    xy, xz, yz = m[0, 1] + m[1, 0], m[0, 2] + m[2, 0], m[1, 2] + m[2, 1]
    products = np.array((  # 4 q qᵀ: each row is the quaternion, times one of its numbers
        (1.0 + m[0, 0] - m[1, 1] - m[2, 2], xy, xz, x),
        (xy, 1.0 - m[0, 0] + m[1, 1] - m[2, 2], yz, y),
        (xz, yz, 1.0 - m[0, 0] - m[1, 1] + m[2, 2], z),
        (x, y, z, 1.0 + m[0, 0] + m[1, 1] + m[2, 2])))
    largest = np.einsum('ii...->i...', products).argmax(axis=0)  # it divides by no small number
    rows = np.take_along_axis(np.moveaxis(products, (0, 1), (-2, -1)),
                              largest[..., None, None], axis=-2)[..., 0, :]
    return rows / np.linalg.norm(rows, axis=-1, keepdims=True)

"""What is accepted as a pose and as a size, and the words in which the rest is refused.

The same limits as in the kernels (`pose.load_block`), for the places where a person or a message
can bring in anything: every refusal names the field and the value.
"""
from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from .pose import LENGTH_MAX, LENGTH_MIN, QUATERNION_MAX, QUATERNION_MIN


def pose_fault(pose: Sequence[float] | np.ndarray) -> str | None:
    """Why 7 numbers `x y z qx qy qz qw` are not a pose, or None.

    A quaternion off unit length is none of the reasons: it is normalised.
    """
    x, y, z, qx, qy, qz, qw = (float(value) for value in pose)
    if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(z)):
        return f'position ({x:g}, {y:g}, {z:g}) is not finite'
    if max(abs(x), abs(y), abs(z)) > LENGTH_MAX:
        return f'position ({x:g}, {y:g}, {z:g}) exceeds {LENGTH_MAX:g} m'
    text = f'quaternion (x={qx:g}, y={qy:g}, z={qz:g}, w={qw:g})'
    if not all(math.isfinite(value) for value in (qx, qy, qz, qw)):
        return f'{text} is not finite'
    norm = math.hypot(qx, qy, qz, qw)
    if norm < QUATERNION_MIN:
        return f'{text} has zero length'
    if norm > QUATERNION_MAX:
        return f'{text} is longer than {QUATERNION_MAX:g}'
    return None


def size_fault(size: Sequence[float] | np.ndarray) -> str | None:
    """Why three full extents [m] are not a size, or None."""
    extents = [float(value) for value in size]
    text = '(' + ', '.join(f'{value:g}' for value in extents) + ')'
    if not all(math.isfinite(value) for value in extents):
        return f'{text} is not finite'
    if min(extents) <= 0.0:
        return f'{text} is not positive'
    if min(extents) < LENGTH_MIN or max(extents) > LENGTH_MAX:
        return f'{text} is outside {LENGTH_MIN:g} to {LENGTH_MAX:g} m'
    return None


def as_floats(value: ArrayLike, name: str, shapes: str, *accepted: tuple[int | None, ...],
              ) -> np.ndarray:
    """`value` as a contiguous float64 array of one of the `accepted` shapes (None: any length).

    `shapes` is how the accepted shapes are called in the error.
    """
    try:
        array = np.ascontiguousarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f'{name} must be {shapes} of numbers, not {value!r}') from error
    # ascontiguousarray makes a scalar one-dimensional, which no accepted shape mistakes.
    for shape in accepted:
        if len(shape) == array.ndim and all(
                want is None or want == have for want, have in zip(shape, array.shape)):
            return array
    raise ValueError(f'{name} must be {shapes}, not an array of shape {np.shape(value)}')


def as_size(size: ArrayLike, name: str) -> np.ndarray:
    """Three full extents (3,) [m], checked, as (1, 3)."""
    array = as_floats(size, name, 'three full extents', (3,))
    fault = size_fault(array)
    if fault:
        raise ValueError(f'{name} {fault}')
    return array.reshape(1, 3)

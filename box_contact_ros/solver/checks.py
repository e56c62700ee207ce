# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is accepted as a pose and as a size, and the words in which the rest is refused.

The limits are those of the core (core/src/poses.hpp), which judges poses. Every refusal names the
field and the value.
"""
from __future__ import annotations

import math
import numbers
import re
import reprlib
from collections.abc import Iterable, Sequence
from contextlib import suppress
from difflib import get_close_matches
from itertools import islice
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import ArrayLike

from ..core import LENGTH_MAX, LENGTH_MIN, QUATERNION_MAX, native

MOST_LOOKED_AT = 5000
"""Names, for the one that was meant: in some milliseconds."""
SHOWN = 200  # characters of a refused value that an error shows
MOST_NAME_BYTES = 255
"""Of the name of a box or pair, and of a frame_id, in UTF-8; ROS's own names have no more. A
response may repeat a name thousands of times."""
NAME = re.compile('[A-Za-z0-9_-]+')
"""Of a box or body, as containers have them: MSKU-123. A topic takes no `-`, and no digit first."""
_REPR = reprlib.Repr()
_REPR.maxlist = _REPR.maxtuple = 8  # a pose, and whether there is more
_REPR.maxlevel = 3
_REPR.maxstring = _REPR.maxother = SHOWN


class TooMuch(ValueError):
    """A question is right, and asks for more than is answered at once."""


def printable(text: str) -> str:
    """Return a text in which what no terminal shows is a question mark."""
    return ''.join(mark if mark.isprintable() else '?' for mark in text)


def short_repr(value: Any) -> str:
    """Return `repr`, cut short for an error that a person reads."""
    try:
        text = _REPR.repr(value).replace('\n', ' ')
    except ValueError:  # integers of more than 4,300 digits have no repr
        return f'a {type(value).__name__}'
    return text if len(text) <= SHOWN else f'{text[:SHOWN]}...'


def nearest_name(name: object, known: Iterable[str]) -> str:
    """Return the end of a refusal that asks for the nearest of the known names; '' if none is near.

    Capitals make no difference. Of many names, the first MOST_LOOKED_AT are looked at.
    """
    spelled = {name.lower(): name for name in islice(known, MOST_LOOKED_AT)}
    nearest = ''.join(get_close_matches(str(name)[:SHOWN].lower(), spelled, n=1))
    return nearest and f' (did you mean {spelled[nearest]}?)'


def name_fault(name: str, *, of_box: bool = False) -> str | None:
    """Return what follows a text that is no name or frame_id, as to why; or None.

    of_box: names are letters, digits, _ and -, as in msg_schemas/scene.json.
    """
    if of_box and not NAME.fullmatch(name):
        return 'is no name of letters, digits, _ and -'
    size = len(name.encode(errors='surrogatepass'))
    return f'has {size} bytes, more than {MOST_NAME_BYTES}' if size > MOST_NAME_BYTES else None


_POSITION, _QUATERNION = ('position ({0:g}, {1:g}, {2:g})',
                          'quaternion (x={3:g}, y={4:g}, z={5:g}, w={6:g})')
_POSE_FAULTS = ('', f'{_POSITION} is not finite', f'{_POSITION} exceeds {LENGTH_MAX:g} m',
                f'{_QUATERNION} is not finite', f'{_QUATERNION} has zero length',
                f'{_QUATERNION} is longer than {QUATERNION_MAX:g}')
"""By the codes of core/binding/pose_faults.hpp, which decides what a pose is."""


def pose_fault(pose: Sequence[float] | np.ndarray) -> str | None:
    """Return why 7 numbers `x y z qx qy qz qw` are not a pose, or None.

    A quaternion may have any length within the limits.
    """
    fault = native.pose_fault(pose)
    return _POSE_FAULTS[fault].format(*map(float, pose)) if fault else None


def absent_poses(poses: np.ndarray) -> np.ndarray:
    """Return which rows of poses (n, 7) are all NaN, as that of a box that is not there."""
    return np.isnan(poses).all(axis=1)


def are_poses(poses: np.ndarray) -> np.ndarray:
    """Return which rows (n, 7) are poses: those in which `pose_fault` finds nothing."""
    return native.pose_faults(poses) == 0


def size_fault(size: Sequence[float] | np.ndarray) -> str | None:
    """Return why three full extents [m] are not a size, or None."""
    if all(LENGTH_MIN <= extent <= LENGTH_MAX for extent in size):
        return None
    extents = [float(value) for value in size]
    text = '(' + ', '.join(f'{value:g}' for value in extents) + ')'
    if not all(math.isfinite(value) for value in extents):
        return f'{text} is not finite'
    if min(extents) <= 0.0:
        return f'{text} is not positive'
    return f'{text} is outside {LENGTH_MIN:g} to {LENGTH_MAX:g} m'


def as_number(value: Any, name: str) -> float:
    """Return a number as a float; ValueError for anything else, a boolean as well."""
    if type(value) is float:
        return value
    if isinstance(value, np.ndarray) and not value.shape:
        value = value[()]
    if isinstance(value, numbers.Real) and not isinstance(value, bool):
        with suppress(OverflowError):
            return float(value)
    raise ValueError(f'{name} must be a number, not {short_repr(value)}')


def as_margin(value: Any, name: str = 'margin') -> float:
    """Return the separation up to which pairs apart count [m]; ValueError for no length."""
    margin = as_number(value, name)
    if not 0.0 <= margin <= LENGTH_MAX:
        raise ValueError(f'{name} must lie within 0 and {LENGTH_MAX:g} m, not {margin:g}')
    return margin


def as_whole(value: Any, name: str, low: int, high: int) -> int:
    """Return a whole number from `low` to `high`; ValueError for anything else."""
    if isinstance(value, int | np.integer) and not isinstance(value, bool) and low <= value <= high:
        return int(value)
    raise ValueError(f'{name} must be a whole number from {low} to {high}, not {short_repr(value)}')


def as_floats(value: ArrayLike, name: str, shapes: str, *accepted: tuple[int | None, ...],
              ) -> np.ndarray:
    """Return `value` as a contiguous float64 array of an `accepted` shape (None: any length).

    shapes: what the error calls the accepted shapes. An empty list has no rows of any shape.
    """
    try:
        array = value if _is_plain(value, np.float64) else _converted(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise ValueError(f'{name} must be {shapes} of numbers, not {short_repr(value)}') from error
    for shape in accepted:
        if len(shape) == array.ndim and all(
                want is None or want == have for want, have in zip(shape, array.shape)):
            return array
        if array.shape == (0,) and shape and not shape[0]:
            return array.reshape(0, *filter(None, shape))
    raise ValueError(f'{name} must be {shapes}, not an array of shape {array.shape}')


def as_wholes(value: ArrayLike, name: str, *columns: int) -> np.ndarray:
    """Return whole numbers, rows of so many columns (n, *columns), as a contiguous int64 array."""
    if _is_plain(value, np.int64) and value.ndim and value.shape[1:] == columns:
        return value
    try:
        array = _as_array(value)
    except (TypeError, ValueError, OverflowError):
        array = np.empty((), dtype=object)
    if array.shape == (0,):  # an empty list
        array = array.reshape(0, *columns)
    whole = array.dtype.kind in 'iu' or array.size == 0
    if not whole or array.ndim != 1 + len(columns) or array.shape[1:] != columns:
        shape = f'({", ".join(("n", *map(str, columns)))}{"" if columns else ","})'
        raise ValueError(f'{name} must be whole numbers {shape}, not {short_repr(value)}')
    return np.require(array, np.int64, ('C', 'A'))  # of 2^63 and more, it makes negative numbers


def as_pairs(value: ArrayLike, name: str) -> np.ndarray:
    """Return pairs of whole numbers (n, 2) as a contiguous int64 array."""
    return as_wholes(value, name, 2)


def as_places(value: ArrayLike, name: str, count: int) -> np.ndarray:
    """Return pairs of places (n, 2) among `count` rows as a contiguous int64 array."""
    array = as_pairs(value, name)
    outside = ((array < 0) | (array >= count)).any(axis=1)
    if outside.any():
        row = int(np.argmax(outside))
        raise ValueError(f'{name}[{row}] is {tuple(array[row].tolist())}, but there are {count} '
                         'poses')
    return array


def _is_plain(value: ArrayLike, kind: type) -> TypeGuard[np.ndarray]:
    """Return whether C++ reads a value as it is; NumPy takes longer to convert nothing."""
    return (type(value) is np.ndarray and value.dtype == kind and value.flags.c_contiguous
            and value.flags.aligned)


def _converted(value: ArrayLike) -> np.ndarray:
    """Return numbers as a contiguous float64 array; TypeError: they are none."""
    array = _as_array(value)
    if not _holds_numbers(array):
        raise TypeError(f'{array.dtype} is no kind of number')
    with np.errstate(over='ignore', invalid='ignore'):  # infinity and NaN are refused later
        return np.require(array, np.float64, ('C', 'A'))


def _as_array(value: ArrayLike) -> np.ndarray:
    """Return an array of anything but a masked one, whose mask NumPy would drop: TypeError."""
    if isinstance(value, np.ma.MaskedArray):
        raise TypeError('a mask would be ignored')
    return np.asarray(value)


def _holds_numbers(array: np.ndarray) -> bool:
    """Whether an array holds real numbers only.

    NumPy would also take '1' for 1, None for NaN, a date for a number, and drop imaginary parts.
    """
    if array.dtype.kind == 'O':  # also what integers beyond 64 bits come as
        return all(isinstance(v, numbers.Real) and not isinstance(v, bool) for v in array.flat)
    return array.dtype.kind in 'fiu'


def as_size(size: ArrayLike, name: str) -> np.ndarray:
    """Return three full extents (3,) [m], checked, as (1, 3)."""
    array = as_floats(size, name, 'three full extents', (3,))
    fault = size_fault(array)
    if fault:
        raise ValueError(f'{name} {fault}')
    return array.reshape(1, 3)

"""The native core: contacts of pairs of boxes in C++, by the best instruction set of the machine.

The headers of this folder hold the algorithms; `binding/` makes them a Python extension, compiled
once for each instruction set. Verdicts, separations and normals have the same bits in all of them.
The environment variable BOX_CONTACT_INSTRUCTION_SET forces one: baseline, avx2 or avx512.
"""
from __future__ import annotations

import os
from importlib import import_module
from typing import TYPE_CHECKING

FORCE = 'BOX_CONTACT_INSTRUCTION_SET'
"""Environment variable that names an instruction set."""

try:
    from . import _baseline
except ImportError as error:
    raise ImportError(
        f'{os.path.dirname(__file__)} has no built native core: run `pip install -e .` in the '
        'checkout, which needs a C++17 compiler (Debian, Ubuntu: apt install g++ python3-dev), or '
        'leave the checkout if box_contact_ros is installed elsewhere') from error


def instruction_sets() -> tuple[str, ...]:
    """Return the instruction sets that this machine can run and that were built, best last."""
    folder = os.path.dirname(__file__)
    built = {name.split('.')[0] for name in os.listdir(folder)}
    return tuple(name for name in _baseline.supported() if f'_{name}' in built)


if TYPE_CHECKING:
    native = _baseline
else:
    _forced = os.environ.get(FORCE)
    if _forced and _forced not in instruction_sets():
        raise ImportError(f'{FORCE} is {_forced!r}, which is not one of: '
                          + ', '.join(instruction_sets()))
    native = import_module(f'._{_forced or instruction_sets()[-1]}', __name__)

from .stages import Stages as Stages  # noqa: E402, F401  (needs `native`)
from .stages import stages as stages  # noqa: E402, F401

LENGTH_MIN, LENGTH_MAX = native.LENGTH_MIN, native.LENGTH_MAX
"""Least extent, and largest extent or coordinate, that are accepted [m]."""
QUATERNION_MIN, QUATERNION_MAX = native.QUATERNION_MIN, native.QUATERNION_MAX
"""Least and largest norm of a quaternion that are accepted."""
DEPTH_FLOOR = native.DEPTH_FLOOR
"""Least depth to which B is pressed in before the overlap is taken [of the size]."""
ASPECT_MAX, SIZE_RATIO_MAX, DEPTH_MAX = (
    native.ASPECT_MAX, native.SIZE_RATIO_MAX, native.DEPTH_MAX)
"""The range of the MLP: edge ratio of a box, size ratio of both, depth by the shortest edge."""
CENTROID_REACH = native.CENTROID_REACH
"""Farthest that a centroid is from the middle of its bounding box [half extents]."""
SITES, FEATURES, OUTPUTS, POINT_OUTPUTS = 9, 12, 7, 3
"""Sites at which the MLP is asked, features and outputs of each, those for the point: mlp.hpp."""

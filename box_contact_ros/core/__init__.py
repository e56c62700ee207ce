# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The native core: contacts of pairs of boxes in C++, by the best instruction set of the machine.

`include/` has the public headers of libbox_contact, and `src/` compiles into the library, once for
each instruction set. `binding/` makes the library a Python extension. Verdicts, separations and
normals have the same bits in all instruction sets. The environment variable
BOX_CONTACT_INSTRUCTION_SET forces one: baseline, avx2 or avx512.
"""
from __future__ import annotations

import os

FORCE = 'BOX_CONTACT_INSTRUCTION_SET'
"""Environment variable that names an instruction set."""

try:
    from . import _native as native
except ImportError as error:
    raise ImportError(
        f'{os.path.dirname(__file__)} has no built native core: run `pip install -e .` in the '
        'checkout, which needs a C++17 compiler (Debian, Ubuntu: apt install g++ python3-dev), or '
        'leave the checkout if box_contact_ros is installed elsewhere') from error


def instruction_sets() -> tuple[str, ...]:
    """Return the instruction sets that were built and that this machine can run, best last."""
    return native.instruction_sets()


if not native.kernel:
    raise ImportError(f'{FORCE} is {os.environ.get(FORCE)!r}, which is not one of: '
                      + ', '.join(instruction_sets()))

LENGTH_MIN, LENGTH_MAX = native.LENGTH_MIN, native.LENGTH_MAX
"""Least extent, and largest extent or coordinate, that are accepted [m]."""
QUATERNION_MIN, QUATERNION_MAX = native.QUATERNION_MIN, native.QUATERNION_MAX
"""Least and largest norm of a quaternion that are accepted."""
MASS_MIN, MASS_MAX = native.MASS_MIN, native.MASS_MAX
"""Least and largest mass [kg] and moment of inertia [kg m²] that are accepted."""
INERTIA_SLACK = native.INERTIA_SLACK
"""By how much of it a moment of inertia may exceed the sum of the two others."""
SQUARE_SLACK = native.SQUARE_SLACK
"""A patch is a square where its variances differ from their mean by a smaller share: all directions
have its covariance."""
THREADS_MAX = native.THREADS_MAX
"""Most threads that a batch is accepted with."""
SUBSTEPS_MAX = native.SUBSTEPS_MAX
"""Most sub-steps of a step of forces."""
DEPTH_FLOOR = native.DEPTH_FLOOR
"""Least depth to which boxes are pressed together before the overlap is taken [of the size]."""
NETWORK_FORMAT = native.NETWORK_FORMAT
"""Format of the network's file that the core reads: what its numbers mean."""
FEATURES, OUTPUTS, UNITS_MAX = native.FEATURES, native.OUTPUTS, native.UNITS_MAX
"""What the network of `mlp` reads and gives, and the most units of a hidden layer."""

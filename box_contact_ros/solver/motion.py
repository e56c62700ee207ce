# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Boxes on their ways: what a solver is asked, how near two of them come, and when."""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..core import native
from .checks import as_floats, as_number, short_repr
from .nearest import Nearest, Nearests
from .rows import NoTruth, Rows


@dataclass(frozen=True, slots=True, eq=False)
class Sweep:
    """The way of a box from one pose to another while s goes from 0 to 1, or the ways of n boxes.

    The centre goes on a line and the axes turn the shortest way, both at constant rate.
    """

    start: ArrayLike
    """The pose at s = 0 (7,), or rows (n, 7)."""
    end: ArrayLike
    """The pose at s = 1 (7,), or a row for each start."""
    centre: ArrayLike | None = None
    """The point in the box's own frame that goes on a line instead of its centre (3,) or (n, 3)
    [m]; for a box of a body, the origin of the body's frame."""


@dataclass(frozen=True, slots=True, eq=False)
class Approach(NoTruth):
    """How near two boxes come on their ways, and when."""

    time: float
    """s from 0, the start, to 1, the end; NaN: never, and all other numbers are NaN."""
    closing_speed: float
    """Minus the rate of the distance at that time [m per unit of s]."""
    nearest: Nearest
    """The nearest points at that time."""

    _instead = 'whether .time is NaN, or .nearest.colliding'


@dataclass(frozen=True, slots=True, eq=False)
class Approaches(Rows[Approach]):
    """How near n pairs come, and when: a sequence of `Approach`, and the fields of all as arrays.

    `approaches[3]` is an Approach. A slice, a mask (n,) or numbers of rows give Approaches.
    """

    time: np.ndarray
    """(n,) from 0 to 1, or NaN."""
    closing_speed: np.ndarray
    """(n,) [m per unit of s]."""
    nearest: Nearests
    """(n,)."""

    _instead = '.time, .nearest.colliding or len()'

    def _one(self, time: np.float64, closing_speed: np.float64, nearest: Nearest) -> Approach:
        return Approach(float(time), float(closing_speed), nearest)


def as_sweeps(given: tuple[object, ...], *, by_place: bool = False) -> tuple[Sweep, Sweep]:
    """Return the sweeps of A and B; by_place: one sweep, of whose rows pairs are made.

    Raises ValueError for anything else, and shows the form.
    """
    a, b, *more = given
    if isinstance(a, Sweep) and not more:
        if isinstance(b, Sweep) and not by_place:
            return a, b
        if b is None and by_place:
            return a, a
    form = ('one Sweep(starts, ends) comes with pairs' if by_place else
            'motions are two sweeps, Sweep(start_a, end_a), Sweep(start_b, end_b)')
    raise ValueError(f'{form}; not {", ".join(map(short_repr, given))}')


def find_approaches(starts: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
                    ends: tuple[ArrayLike, ArrayLike],
                    centres: tuple[ArrayLike | None, ArrayLike | None], names: tuple[str, ...],
                    clearance: float | None, tolerance: float, threads: int = 1,
                    pairs: np.ndarray | None = None) -> Approaches:
    """Return the approaches of rows; clearance None: those of their least distances.

    starts: poses and sizes of A and B, checked. ends, centres: of A and B, of any kind of numbers.
    names: of both, in a refusal. Raises ValueError, with field and value, for what is refused.
    """
    count = len(starts[0])
    end_a, end_b = (as_floats(poses, name, f'poses ({count}, 7), one for each start', (count, 7))
                    for poses, name in zip(ends, names[:2]))
    centre_a, centre_b = (centre if centre is None else np.broadcast_to(
        as_floats(centre, name, f'centres (3,) or ({count}, 3)', (3,), (count, 3)), (count, 3))
        for centre, name in zip(centres, names[2:]))
    time, closing_speed, *nearest = native.approaches(
        *starts, end_a, end_b, centre_a, centre_b,
        None if clearance is None else as_number(clearance, 'clearance'),
        as_number(tolerance, 'tolerance'), threads, pairs)
    return Approaches(time, closing_speed, Nearests(*nearest))

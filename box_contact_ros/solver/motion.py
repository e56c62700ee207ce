# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Boxes on their ways: what a solver is asked, how near two of them come, and when."""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from typing import ParamSpec, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from ..core import native
from .checks import as_floats, as_number, short_repr
from .nearest import Nearest, Nearests
from .poses import PoseLike
from .rows import NoTruth, Rows

P = ParamSpec('P')
R = TypeVar('R')
TWO_SWEEPS = 'motions are two sweeps, Sweep(start_a, end_a), Sweep(start_b, end_b)'
"""In the refusal of anything else."""


@dataclass(frozen=True, slots=True, eq=False)
class Sweep:
    """The way of a box from one pose to another while s goes from 0 to 1, or the ways of n boxes.

    The centre goes on a line and the axes turn the shortest way, both at constant rate.
    """

    start: PoseLike
    """The pose at s = 0, or those of n boxes."""
    end: PoseLike
    """The pose at s = 1, likewise; one pose stands for n equal ones."""
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


def takes_sweeps(method: Callable[P, R]) -> Callable[P, R]:
    """Decorate a method of two sweeps: four poses, also by name, are refused with the form."""
    @wraps(method)
    def ask(*arguments: P.args, **options: P.kwargs) -> R:
        if len(arguments) > 3 or 'start_a' in options or 'starts_a' in options:
            raise ValueError(f'{TWO_SWEEPS}; not four poses')
        return method(*arguments, **options)
    return ask


def as_sweeps(a: object, b: object, *, by_place: bool = False) -> tuple[Sweep, Sweep]:
    """Return the sweeps of A and B; by_place: one sweep, of whose rows pairs are made.

    Raises ValueError for anything else, and shows the form.
    """
    if isinstance(a, Sweep):
        if isinstance(b, Sweep) and not by_place:
            return a, b
        if b is None and by_place:
            return a, a
    form = 'one Sweep(starts, ends) comes with pairs' if by_place else TWO_SWEEPS
    raise ValueError(f'{form}; not {short_repr(a)}, {short_repr(b)}')


def find_approaches(starts: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
                    ends: tuple[np.ndarray, np.ndarray],
                    centres: tuple[ArrayLike | None, ArrayLike | None], names: tuple[str, str],
                    clearance: float | None, tolerance: float, threads: int = 1,
                    pairs: np.ndarray | None = None) -> Approaches:
    """Return the approaches of rows; clearance None: those of their least distances.

    starts: poses and sizes of A and B. ends: as many poses. centres: of any kind of numbers.
    names: of both, in a refusal. Raises ValueError, with field and value, for what is refused.
    """
    count = len(starts[0])
    centre_a, centre_b = (centre if centre is None else np.broadcast_to(
        as_floats(centre, name, f'centres (3,) or ({count}, 3)', (3,), (count, 3)), (count, 3))
        for centre, name in zip(centres, names))
    time, closing_speed, *nearest = native.approaches(
        *starts, *ends, centre_a, centre_b,
        None if clearance is None else as_number(clearance, 'clearance'),
        as_number(tolerance, 'tolerance'), threads, pairs)
    return Approaches(time, closing_speed, Nearests(*nearest))

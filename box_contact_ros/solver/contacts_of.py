# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which of many boxes touch: bounding boxes in the core, then the solver.

`contacts_of` asks once, about any boxes. A `SceneSolver` asks at each tick, about the same ones.
"""
from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..core import native
from .checks import TooMuch, as_margin, as_places, pose_fault, short_repr
from .contact import Contacts
from .contact_solver import ContactSolver
from .faces import as_tolerances
from .nearest import Nearests
from .poses import as_boxes


class Found(NamedTuple):
    """Pairs of boxes by their indices: what touches, and what is near."""

    pairs: np.ndarray  # (k, 2)
    contacts: Contacts  # (k,)
    near_pairs: np.ndarray  # (m, 2)
    near: Nearests  # (m,)


class TooManyNear(TooMuch):
    """More pairs near each other than were to be answered; `pairs` (k, 2) are the first ones."""

    reason = 'too many pairs near'

    def __init__(self, most: int, pairs: np.ndarray) -> None:
        super().__init__(f'more than {most} pairs are near each other, and so many are not '
                         'answered')
        self.pairs = pairs


def contacts_of(sizes: ArrayLike, poses: ArrayLike, pairs: ArrayLike | None = None, *,
                to: tuple[ArrayLike, ArrayLike] | None = None, fixed: ArrayLike | None = None,
                margin: float = 0.0, tolerance: float | np.ndarray = 0.0,
                threads: int = 1, most_near: int = sys.maxsize,
                ) -> tuple[np.ndarray, Contacts]:
    """Return which boxes touch, as rows (k, 2) of their indices a and b, and the k contacts.

    sizes: full extents (n, 3), or (3,) of all boxes [m].
    poses: (n, 7) in a common frame; seven NaN leave a box out.
    pairs: (m, 2), the pairs that are asked for, in their order; None: each two boxes, a < b.
    to: sizes and poses of a second set of boxes. Pairs are then (i, j), box i of the first set and
    box j of the second one; no two boxes of one set are a pair. Without `pairs` and `fixed`.
    fixed: (n,) bool, boxes that never move. Without `pairs`, two of them are no pair.
    margin: pairs apart are listed too, behind those in contact, up to this separation [m].
    tolerance: the gap up to which boxes touch [m]; an array (n,) has that of each box, and a pair
    the smaller one. Above 0, contacts are those of boxes that are
    larger by it, with the separation and the volume of the boxes as they are.
    most_near: raise TooManyNear, a ValueError, for more pairs whose bounding boxes are this near.

    Raises ValueError, with the field and the value, for what is not a size, a pose, a pair, a
    margin or a tolerance.
    """
    sizes, poses = as_boxes(sizes, poses)
    margin = as_margin(margin)
    first = len(poses)
    if to is not None:
        if pairs is not None or fixed is not None:
            raise ValueError('to is a second set of boxes: there is neither pairs nor fixed')
        others = as_boxes(*_two(to), names=('to[0]', 'to[1]'))
        sizes, poses = (np.concatenate(both) for both in zip((sizes, poses), others))
    count = len(poses)
    listed = as_places([] if pairs is None else pairs, 'pairs', count)
    if (alone := np.flatnonzero(listed[:, 0] == listed[:, 1])).size:
        raise ValueError(f'pairs[{alone[0]}] is box {listed[alone[0], 0]} with itself')
    tolerances = as_tolerances(tolerance, sizes)
    sets = 0 if pairs is not None else 1 + (to is not None)
    # By the sets of two boxes: of one set, the first is A; of two, that of the first set.
    sides = np.array([[0, 1], [2, 0]] if to is not None else [[3]], np.uint8)
    of_set = (np.arange(count) >= first).astype(np.int32)
    wanted = native.Filter(listed, of_set, sides[:sets, :sets].copy(), np.full(count, -1, np.int32),
                           np.arange(count, dtype=np.int32))
    grown = sizes + tolerances[:, None] + margin
    flags = _as_flags(fixed, 'fixed', count)
    index = native.Index(grown, np.where(flags[:, None], poses, np.nan)) if flags.any() else None
    near, contacts = _contacts_of_near(native.Movers(grown, 0.0, wanted, index), sizes, poses,
                                       margin, tolerances, most_near, threads)
    return near - [0, 0 if to is None else first], contacts


def _contacts_of_near(movers: native.Movers, sizes: np.ndarray, poses: np.ndarray,
                      margin: float, tolerances: np.ndarray, most_near: int, threads: int,
                      ) -> tuple[np.ndarray, Contacts]:
    """Return the pairs (k, 2) that touch, up to their tolerance, or are within the margin."""
    grown = sizes + tolerances[:, None]
    solver = ContactSolver(margin=margin)
    near, contacts, _ = find_contacts(movers, solver, grown, poses, 'poses[{}]'.format,
                                      most_near=most_near, threads=threads)
    near, contacts = in_contact(near, contacts, margin)
    if not tolerances.any():
        return near, contacts
    # Turned boxes grow by more along some axes.
    as_they_are = solver.batch(poses, sizes=sizes, pairs=near, threads=threads)
    touches = as_they_are.separation <= tolerances[near].min(axis=1)
    return in_contact(near, replace(
        as_they_are, colliding=touches, axis=np.where(touches, contacts.axis, as_they_are.axis),
        normal=np.where(touches[:, None], contacts.normal, as_they_are.normal),
        point=np.where(touches[:, None], contacts.point, as_they_are.point),
        covariance=np.where(touches[:, None, None], contacts.covariance,
                            as_they_are.covariance)), margin)


def _two(to: object) -> tuple[ArrayLike, ArrayLike]:
    """Return sizes and poses of the second set; ValueError: `to` is no two things."""
    if isinstance(to, tuple | list) and len(to) == 2:
        return to[0], to[1]
    raise ValueError(f'to must be (sizes, poses), not {short_repr(to)}')


def _as_flags(value: ArrayLike | None, name: str, count: int) -> np.ndarray:
    """Return an array (count,) of True and False; None: all False."""
    if value is None:
        return np.zeros(count, bool)
    with suppress(ValueError):  # of rows of unequal lengths
        flags = np.asarray(value)
        if flags.dtype == bool and flags.shape == (count,):
            return flags
    raise ValueError(f'{name} must be True or False for each of {count} boxes, not '
                     f'{short_repr(value)}')


def find_contacts(movers: native.Movers, solver: ContactSolver, sizes: np.ndarray,
                  poses: np.ndarray, name_of: Callable[[int], str], *,
                  most_near: int = sys.maxsize, threads: int = 1,
                  ) -> tuple[np.ndarray, Contacts, np.ndarray]:
    """Return the pairs (k, 2) that are near, their contacts, and the stale rows (m, 2).

    name_of: what a refusal calls the pose of a box.
    Raises TooManyNear for more than `most_near` pairs, and ValueError for a bad pose.
    """
    pairs, stale, refused = movers.find(poses, most_near)
    if refused >= 0:
        raise ValueError(f'{name_of(refused)} {pose_fault(poses[refused])}')
    if len(pairs) > most_near:
        raise TooManyNear(most_near, pairs)
    return pairs, solver.batch(poses, sizes=sizes, pairs=pairs, threads=threads), stale


def in_contact(pairs: np.ndarray, contacts: Contacts, margin: float = 0.0,
               ) -> tuple[np.ndarray, Contacts]:
    """Return the pairs in contact, then those apart by `margin` [m] at most, and their contacts."""
    if not margin and False not in contacts.colliding.tobytes():
        return pairs, contacts
    rows = np.flatnonzero(contacts.separation <= margin if margin else contacts.colliding)
    if margin:
        rows = rows[np.argsort(~contacts.colliding[rows], kind='stable')]
    return pairs[rows], contacts[rows]


def joined(parts: list[Found]) -> Found:
    """Return the rows of all parts, which are not none."""
    def rows(values: list[Any]) -> Any:
        if isinstance(values[0], np.ndarray):
            return np.concatenate(values)
        return type(values[0])(**{name: rows([getattr(value, name) for value in values])
                                  for name in values[0].__dataclass_fields__})

    return parts[0] if len(parts) == 1 else Found(*map(rows, map(list, zip(*parts))))


def touching_and_near(pairs: np.ndarray, contacts: Contacts, solver: ContactSolver,
                      sizes: np.ndarray, poses: np.ndarray, margin: float) -> Found:
    """Return the pairs in contact, and those whose distance is `margin` [m] at most.

    contacts: of all pairs by `solver`. The separation is at most the distance, so few are asked.
    """
    touching = in_contact(pairs, contacts)
    if not margin:
        return Found(*touching, _NO_PAIRS, _NO_NEARESTS)
    pairs = pairs[~contacts.colliding & (contacts.separation <= margin)]
    near = solver.distance_batch(poses, sizes=sizes, pairs=pairs)
    rows = near.distance <= margin
    return Found(*touching, pairs[rows], near[rows])


_NO_PAIRS = np.zeros((0, 2), np.int64)
_NO_NEARESTS = ContactSolver((1, 1, 1), (1, 1, 1)).distance_batch(*np.zeros((2, 0, 7)))

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A plan: boxes, where they are to be, and what is known of their weights."""
from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..core import LENGTH_MAX, MASS_MAX
from ..solver.checks import (
    absent_poses,
    as_floats,
    as_number,
    as_places,
    as_whole,
    as_wholes,
    pose_fault,
    short_repr,
)
from ..solver.poses import PoseLike, as_boxes

MOST_BYTES = 2**28  # of a file: 256 MiB, some hundred times the largest ship's plan
VERDICTS = ('not sound', 'not all judged', 'sound')  # on a plan, from the worst to the best
FAULT_KINDS = {
    'origin': ('sound', ''), 'tolerance': ('sound', ''), 'unit': ('not all judged', 'unit'),
    'row': ('not all judged', 'place'), 'pose': ('not all judged', 'place'),
    'dimension': ('not all judged', 'place'), 'slot': ('not all judged', 'place'),
    'size type': ('not all judged', 'place'), 'slot taken': ('not sound', 'place'),
    'cut': ('not all judged', 'part'), 'part': ('not all judged', 'part'),
    'shape': ('not all judged', 'shape'), 'goods': ('not all judged', 'shape'),
    'gap': ('not sound', ''), 'twice': ('not sound', ''), 'overlap': ('not sound', ''),
    'payload': ('not sound', ''), 'mass': ('not all judged', 'weight'),
    'weight': ('not all judged', 'sure weight'), 'limit': ('not all judged', 'limit'),
    'friction': ('not all judged', 'friction'), 'order': ('not all judged', 'order'),
    'support': ('not all judged', 'support'), 'held': ('not all judged', 'judgement'),
    'loads': ('not all judged', 'judgement'), 'way': ('not all judged', 'judgement'),
    'frames': ('not all judged', 'frames'), 'column': ('not all judged', 'column'),
    'ignored': ('sound', 'column'),
    'base': ('sound', ''), 'fixed': ('sound', ''), 'rounding': ('sound', '')}
"""What may be wrong with a row of a file: the best verdict with it, and what it lacks."""
NO_ROOM = ((-np.inf,) * 3, (np.inf,) * 3)
UNTURNED = (0.0, 0.0, 0.0, 1.0)  # the quaternion x y z w of a box that is not turned
GROUND, GROUND_THICKNESS, GROUND_MARGIN = 'ground', 1.0, 1.0
"""The name of the ground as a box; its thickness, and how far it reaches beyond the others [m]."""
LACKS = {
    '': ('', ''), 'place': ('1 box was not placed', '{:,} boxes were not placed'),
    'weight': ('1 has no weight', '{:,} have no weight'),
    'sure weight': ('1 has a doubtful weight', '{:,} have a doubtful weight'),
    'limit': ('1 has no known limit', '{:,} have no known limit'),
    'order': ('1 has no place in the order', '{:,} have no place in the order'),
    'support': ('support not judged',) * 2,
    'judgement': ('1 was not judged', '{:,} were not judged'),
    'unit': ('the unit is doubtful: add --unit',) * 2,
    'shape': ('1 shape is not known', '{:,} shapes are not known'),
    'friction': ('1 has no known friction', '{:,} have no known friction'),
    'frames': ('containers touch: add --frames',) * 2,
    'part': ('1 part of the file was not read', '{:,} parts of the file were not read'),
    'column': ('1 column was not read', '{:,} columns were not read')}
"""What boxes or rows may lack, as the last line says it of one and of more."""


@dataclass(frozen=True)
class Fault:
    """What a file says wrongly, or what could not be taken from it.

    Raises ValueError for a kind that is not one of FAULT_KINDS.
    """

    kind: str
    """One of FAULT_KINDS."""
    names: tuple[str, ...]
    """The boxes or rows that are concerned, as the file names them."""
    text: str
    """What is wrong, for people."""

    def __post_init__(self) -> None:
        if self.kind not in FAULT_KINDS:
            raise ValueError(f'kind must be one of {", ".join(FAULT_KINDS)}, not '
                             f'{short_repr(self.kind)}')

    @property
    def verdict(self) -> str:
        """Return the best of VERDICTS that a plan with this fault can have."""
        return FAULT_KINDS[self.kind][0]

    @property
    def lacks(self) -> str:
        """Return what each of the boxes or rows lacks, one of LACKS."""
        return FAULT_KINDS[self.kind][1]


@dataclass(frozen=True, eq=False, init=False)
class Plan:
    """n boxes, where they are to be, and what is known of their weights.

    Conventions: SI units; a pose is `x y z qx qy qz qw` in a frame common to all boxes.
    """

    sizes: np.ndarray
    """(n, 3) full extents [m]."""
    poses: np.ndarray
    """(n, 7) of the boxes' centres."""
    masses: np.ndarray | None
    """(n,) [kg]; None: unknown, so that geometry alone is judged."""
    ground: np.ndarray
    """(g,) the boxes that are fixed, by index."""
    names: tuple[str, ...]
    """(n,) by which people know the boxes."""
    centres: np.ndarray
    """(n, 3) of mass, in the frame of each box [m]."""
    limits: np.ndarray
    """(n,) the most that may rest on each box [kg]; infinity: no limit is known."""
    friction: np.ndarray
    """(n,) Coulomb's μ of each box, and a pair has the lesser; NaN: as `inspect_plan` is told."""
    body: np.ndarray
    """(n,) the number of the body of each box. The boxes of a body hold together."""
    order: np.ndarray | None
    """(n,) whole numbers by which boxes come, the least first; None: not known. Boxes of a number
    come together, and fixed ones are there from the start."""
    stack: np.ndarray
    """(n,) the number of the stack of each box. Stacks are loaded each by itself, among all fixed
    boxes."""
    stacks: tuple[str, ...]
    """The names of stacks 0, 1 and so on, such as containers; () where they have none."""
    apart: np.ndarray
    """(a, 2) pairs of boxes, by index, that neither touch nor overlap wherever they are."""
    faults: tuple[Fault, ...]
    """What is wrong with the file that the plan is from."""
    room: np.ndarray
    """(n, 2, 3) the least and the greatest corner of the inner space that each box must be in [m];
    infinite where there is none."""

    def __init__(self, sizes: ArrayLike, poses: PoseLike | None = None,
                 masses: ArrayLike | None = None, *, ground: ArrayLike = (),
                 names: Sequence[str] | None = None,
                 centres: ArrayLike | None = None, limits: ArrayLike | None = None,
                 friction: ArrayLike | None = None, body: ArrayLike | None = None,
                 order: ArrayLike | None = None, stack: ArrayLike | None = None,
                 stacks: Sequence[str] = (), apart: ArrayLike = (), faults: Iterable[Fault] = (),
                 room: ArrayLike | None = None) -> None:
        """Take what is known; None is what the fields say of what is not.

        sizes: full extents (n, 3), or (3,) of all boxes. masses: (n,), or a number for all boxes.
        ground: a box or boxes. names: None are '0', '1', and so on. centres: (n, 3); None are the
        boxes' own centres. friction: (n,), or a number for all boxes; None is NaN. body: (n,); None
        is a body for each box. order: (n,), one for a body. stack: (n,); None is one stack. room:
        (n, 2, 3), or (2, 3) of all boxes; None is no room.

        Raises ValueError, with field, row and value, for bad input.
        """
        if poses is None:
            raise ValueError('poses is missing: boxes are Plan(sizes, poses) or Plan.from_corners('
                             'least, sizes), and those of a file read_plan(path)')
        sizes, poses = as_boxes(sizes, poses)
        count = len(poses)
        for row in np.flatnonzero(absent_poses(poses))[:1]:
            raise ValueError(f'poses[{row}] {pose_fault(poses[row])}')
        self._set(
            sizes=sizes, poses=poses,
            masses=None if masses is None else _amounts(masses, 'masses', count, MASS_MAX, 'kg'),
            ground=np.unique([as_whole(box, 'ground', 0, count - 1) for box in (
                ground if np.iterable(ground) else [ground])]).astype(np.int64),
            names=_names(names, count), centres=_centres(centres, count),
            limits=(np.full(count, np.inf) if limits is None else
                    _amounts(limits, 'limits', count, np.inf, 'kg')),
            friction=(np.full(count, np.nan) if friction is None else
                      _frictions(friction, count)), body=_bodies(body, count),
            order=None if order is None else _numbers(order, 'order', count),
            stack=_numbers(np.zeros(count, int) if stack is None else stack, 'stack', count),
            stacks=tuple(map(str, stacks)), apart=as_places(apart, 'apart', count),
            faults=tuple(faults), room=_rooms(room, count))
        for name in 'order', 'stack':
            self._check_bodies(name)
        for row, fault in enumerate(self.faults):
            if not isinstance(fault, Fault):
                raise ValueError(f'faults[{row}] must be a Fault, not {short_repr(fault)}')

    @classmethod
    def from_corners(cls, least: ArrayLike, sizes: ArrayLike, masses: ArrayLike | None = None, *,
                     floor: float | None = None, **known: Any) -> Plan:
        """Return the plan of boxes that are not turned, by the least corner of each (n, 3) [m].

        floor: z of a floor under all [m], which is one more box, 'ground'; None: there is none.
        The rest is as `Plan` takes it. Raises ValueError, with field, row and value, for bad input.
        """
        least = as_floats(least, 'least', 'corners (n, 3) of rows x y z', (None, 3))
        turns = np.tile(UNTURNED, (len(least), 1))
        sizes, _ = as_boxes(sizes, np.hstack((least, turns)), names=('sizes', 'least'))
        plan = cls(sizes, np.hstack((least + sizes / 2.0, turns)), masses, **known)
        if floor is None or not len(plan):
            return plan
        size, pose = slab_below(plan.sizes, plan.poses, as_number(floor, 'floor'))
        return plan.with_fixed([GROUND], [size], [pose])

    def with_fixed(self, names: Sequence[str], sizes: ArrayLike, poses: ArrayLike) -> Plan:
        """Return the plan with more fixed boxes behind the others: names, (k, 3) [m], (k, 7)."""
        count, more = len(self), len(names)

        def longer(values: np.ndarray, value: object) -> np.ndarray:
            return np.concatenate((values, np.full((more, *values.shape[1:]), value)))

        return replace(
            self, sizes=np.concatenate((self.sizes, sizes)),
            poses=np.concatenate((self.poses, poses)), names=(*self.names, *names),
            ground=np.concatenate((self.ground, np.arange(count, count + more))),
            masses=None if self.masses is None else longer(self.masses, 0.0),
            centres=longer(self.centres, 0.0), limits=longer(self.limits, np.inf),
            friction=longer(self.friction, np.nan),
            body=np.concatenate((self.body, self.body.max(initial=-1) + 1 + np.arange(more))),
            order=None if self.order is None else longer(self.order, 0),
            stack=longer(self.stack, 0), room=longer(self.room, NO_ROOM))

    def _set(self, **fields: object) -> None:
        for name, value in fields.items():
            object.__setattr__(self, name, value)

    def _check_bodies(self, name: str) -> None:
        """Raise ValueError if boxes of a body that moves differ in their order, or their stack."""
        numbers = getattr(self, name)
        if numbers is None or not len(self):
            return
        first = np.unique(self.body, return_index=True)[1][self.body]
        differs = (numbers != numbers[first]) & ~np.isin(self.body, self.body[self.ground])
        for row in np.flatnonzero(differs)[:1]:
            raise ValueError(f'{name}[{row}] is {numbers[row]}, and {numbers[first[row]]} of '
                             f'{name}[{first[row]}], a box of the same body')

    def frictions(self, other: float) -> np.ndarray:
        """Return the friction of each box (n,); other: that of boxes of which it is not known."""
        return np.where(np.isnan(self.friction), other, self.friction)

    def __len__(self) -> int:
        """Return how many boxes there are."""
        return len(self.poses)


def slab_below(sizes: np.ndarray, poses: np.ndarray, z: float = 0.0,
               ) -> tuple[np.ndarray, np.ndarray]:
    """Return full extents (3,) and pose (7,) of a slab under all boxes, its top at z [m]."""
    reach = np.linalg.norm(sizes, axis=1, keepdims=True) / 2.0 + GROUND_MARGIN
    low, high = (poses[:, :2] - reach).min(axis=0), (poses[:, :2] + reach).max(axis=0)
    return (np.array([*np.minimum(high - low, LENGTH_MAX), GROUND_THICKNESS]),
            np.array([*(low + high) / 2.0, z - GROUND_THICKNESS / 2.0, *UNTURNED]))


def _amounts(value: ArrayLike, name: str, count: int, most: float, unit: str) -> np.ndarray:
    """Return numbers (n,) from 0 to `most`; one stands for all."""
    array = as_floats(value, name, f'a number, or numbers ({count},)', (count,), ())
    array = np.broadcast_to(array, count)
    for row in np.flatnonzero(~((array >= 0.0) & (array <= most)))[:1]:
        raise ValueError(f'{name}[{row}] is {array[row]:g} {unit}, not from 0 to {most:g} {unit}')
    return array


def _frictions(value: ArrayLike, count: int) -> np.ndarray:
    """Return frictions (n,) from 0 on, or NaN; one stands for all."""
    array = as_floats(value, 'friction', f'a number, or numbers ({count},)', (count,), ())
    array = np.broadcast_to(array, count)
    for row in np.flatnonzero((array < 0.0) | np.isinf(array))[:1]:
        raise ValueError(f'friction[{row}] is {array[row]:g}, not 0 or more, and finite')
    return array


def _centres(value: ArrayLike | None, count: int) -> np.ndarray:
    if value is None:
        return np.zeros((count, 3))
    array = as_floats(value, 'centres', f'coordinates ({count}, 3)', (count, 3))
    for row in np.flatnonzero(~(np.abs(array) <= LENGTH_MAX).all(axis=1))[:1]:
        raise ValueError(f'centres[{row}] ({", ".join(f"{x:g}" for x in array[row])}) is not '
                         f'finite, or exceeds {LENGTH_MAX:g} m')
    return array


def _rooms(value: ArrayLike | None, count: int) -> np.ndarray:
    """Return the least and the greatest corner of the room of each box (n, 2, 3)."""
    if value is None:
        value = NO_ROOM
    array = as_floats(value, 'room', f'corners (2, 3) or ({count}, 2, 3)', (2, 3), (count, 2, 3))
    array = np.ascontiguousarray(np.broadcast_to(array, (count, 2, 3)))
    for row in np.flatnonzero(~(array[:, 0] < array[:, 1]).all(axis=1))[:1]:
        raise ValueError(f'room[{row}] must be a least and a greatest corner, not '
                         f'{short_repr(array[row].tolist())}')
    return array


def _names(value: Sequence[str] | None, count: int) -> tuple[str, ...]:
    if value is None:
        return tuple(map(str, range(count)))
    if isinstance(value, str) or len(value) != count:
        raise ValueError(f'names must be {count} names, not {short_repr(value)}')
    for row, name in enumerate(value):
        if not isinstance(name, str):
            raise ValueError(f'names[{row}] must be a string, not {short_repr(name)}')
    return tuple(value)


def _bodies(value: ArrayLike | None, count: int) -> np.ndarray:
    """Return a body's number for each box (n,), counted from 0 by their order."""
    if value is None:
        return np.arange(count)
    return np.unique(_numbers(value, 'body', count), return_inverse=True)[1].reshape(count)


def _numbers(value: ArrayLike, name: str, count: int) -> np.ndarray:
    numbers = as_wholes(value, name)
    if len(numbers) != count:
        raise ValueError(f'{name} must be {count} whole numbers, not {short_repr(value)}')
    return numbers

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables of boxes as plans: each row is a box, with the roles that its columns have.

Containers stand side by side where each has a frame of its own. Where no row of a container is
fixed, and it has no floor, z = 0 is the ground.
"""
from __future__ import annotations

import math
import shlex
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..core import MASS_MAX
from ..solver.checks import pose_fault, short_repr, size_fault
from ..solver.contacts_of import contacts_of
from ..solver.pose import rotation_matrix
from .forms import Form, form_of
from .meetings import most_near
from .plan import GROUND, NO_ROOM, UNTURNED, Fault, Plan, slab_below
from .roles import (
    ANGLES,
    MASS_UNITS,
    PLACE,
    TURNS,
    UNITS,
    Finder,
    Given,
    Taken,
    is_harmless,
    is_named,
    word_of,
    words_of,
)
from .room import walls
from .table import Record, Table

FIXED = {'true': True, '1': True, 'yes': True, 'false': False, '0': False, 'no': False, '': False}
"""What `fixed` may be."""
ROOM = 1.0  # between the containers of one file, which are placed side by side [m]
LONG, LONG_ROOM, FULL = 20.0, 30.0, 5.0
"""A container is longer, or shorter than a box by more, only where their units differ [m, m, 1]."""
MOST_FRICTION = 10.0  # more is no friction [1]
SAME = 1e-4  # by which least corners of containers may differ that have frames of their own [m]
STRAIGHT = np.array(UNTURNED)
SQUARE = 1e-6  # by which a turn by quarters may miss them [1]
SLACK = 0.05
"""Part of its thinnest side by which a box may hang or overlap while an axis is chosen [1]."""
MOST_STEPS = 2**53  # a float64 has all whole numbers up to it
AXES = {'x': [1, 2, 0], 'y': [0, 2, 1], 'z': [0, 1, 2]}
"""Which axes of the file are x, y and z of the plan, by the one that is up."""


@dataclass
class Box:
    """A row that can be placed."""

    name: str
    row: int
    stack: int
    size: np.ndarray
    pose: np.ndarray
    half: np.ndarray  # half of the extents of its bounding box (3,) [m]
    mass: float | None
    limit: float
    friction: float
    fixed: bool
    order: float | None


class _LeftOut(Exception):
    """A row cannot be placed: the kind of the fault, and why."""


def read_packing(tables: Sequence[Table], given: Given) -> tuple[Plan, str]:
    """Return the plan of the one table that has places and sizes, and how it was read.

    Raises ValueError where no table has them or several, and for what is open.
    """
    names = [name for table in tables for name in (table.path, *table.columns)]
    for name in given.ignore:
        if not any(is_named(other, (name,)) for other in names):
            raise ValueError(f'neither a column nor a list is called {short_repr(name)}')
    every, tables = tables, [table for table in tables if not is_named(table.path, given.ignore)]
    if forms := [(table, form) for table in tables if (form := form_of(table))]:
        table, form = forms[0]
        return _read(every, table, _formed(form, given), given, form)
    finders = []
    for table in tables:
        try:
            finders.append(Finder(table, given))
        except ValueError:
            if len(tables) == 1:
                raise
    if not finders:
        raise ValueError('none of its lists has all columns that are named')
    able = [finder for finder in finders if finder.taken.place and (
        finder.taken.size or len(finder.taken.place) > 3)]
    if len(able) > 1:
        paths = [finder.table.path for finder in able]
        raise ValueError(f'which list are the boxes, {" or ".join(paths)}?; if it is so, add '
                         f'{_ignore(paths[1:])}')
    finder = able[0] if able else max(finders, key=lambda finder: (
        len(finder.taken.columns), len(finder.table.records)))
    if finder in able and not given.up:
        _ask_up(finder)
    finder.check()
    return _read(every, finder.table, finder.taken, given, None)


def _ask_up(finder: Finder) -> None:
    """Ask which axis is up where words tell y, or where boxes stand in piles only if it is not z.

    Words tell y if the height is listed between the other sizes, as y is between x and z. The
    origin is asked, too, if boxes stand by least corners alone.
    """
    taken, table = finder.taken, finder.table
    in_file = sorted(taken.size, key=table.columns.index)
    says_y = not taken.is_along_file and in_file[1] == taken.size[2]
    try:
        boxes = _Rows(table, taken, finder.given, None).boxes()
    except ValueError:  # which is told when the table is read
        boxes = []
    if not boxes:
        return
    half = np.array([box.half for box in boxes])
    place = np.array([box.pose[:3] for box in boxes]) - taken.is_corner * half

    def fallen(up: str, is_corner: bool) -> tuple[int, bool, bool]:
        axes = AXES[up]
        reach = half[:, axes] if taken.is_along_file else half
        count, has_piles = _fallen(boxes, place[:, axes] + is_corner * reach, reach)
        return count, is_corner, has_piles

    if not says_y and fallen('z', taken.is_corner)[0] == 0:
        return
    is_asked = '--origin' in finder.options
    is_open = is_asked or not finder.given.origin and [*PLACE] == [
        word_of(name).key for name in taken.place]
    corners = sorted({taken.is_corner, taken.is_corner or is_open})
    readings = {up: min(fallen(up, is_corner) for is_corner in corners) for up in 'yzx'}
    up = min(readings, key=lambda up: readings[up][0])
    count, is_corner, has_piles = readings[up]
    is_sure = has_piles and (count == 0 or 2 * count < readings['z'][0] > len(boxes) // 2)
    if not says_y and (up == 'z' or not is_sure):
        return
    if is_corner and not (taken.is_corner or is_asked):
        finder.ask_origin(taken.place)
    finder.ask(f'which axis is up, {up} or {"z" if up != "z" else "y"}?', '--up', up)


def _fallen(boxes: Sequence[Box], centre: np.ndarray, half: np.ndarray) -> tuple[int, bool]:
    """Return how many boxes hang or overlap others, by bounding boxes, and if one is on another.

    centre, half: (n, 3) by a reading. What is at z = 0 stands, too; containers are apart.
    """
    stack = np.array([box.stack for box in boxes])
    low, slack = centre[:, 2] - half[:, 2], SLACK * 2.0 * half.min(axis=1)
    poses = np.hstack((centre, np.tile(UNTURNED, (len(boxes), 1))))
    poses[:, 0] += 3.0 * (np.abs(centre[:, 0]) + half[:, 0]).max() * stack
    try:
        pairs, contacts = contacts_of(2.0 * half, poses, tolerance=slack,
                                      most_near=most_near(len(boxes)))
    except ValueError:  # too many near each other, or containers that reach too far
        return len(boxes), False
    rise = contacts.normal[:, 2]
    upper = np.where(rise > 0.0, pairs[:, 1], pairs[:, 0])[np.abs(rise) > 0.5]
    stands = np.abs(low) <= slack
    stands[upper] = True
    stands[pairs[-contacts.separation > slack[pairs].min(axis=1)].ravel()] = False
    stands[low < -slack] = False
    stands |= [box.fixed for box in boxes]
    return len(boxes) - int(np.count_nonzero(stands)), len(upper) > 0


def _formed(form: Form, given: Given) -> Taken:
    """Return how a form is read. Raises ValueError for what is open, or contradicts the form."""
    if given.origin == 'centre' or given.columns or given.up or given.turns:
        raise ValueError(f'it is {form.title}: least corners, and up and turns are known')
    if not (given.unit or form.unit):
        raise ValueError(f'it is {form.title}, which has no unit: add --unit mm, or cm, m, in, ft')
    return replace(form.taken, unit=given.unit or form.unit or '')


def _read(tables: Sequence[Table], table: Table, taken: Taken, given: Given, form: Form | None,
          ) -> tuple[Plan, str]:
    rows = _Rows(table, taken, given, form)
    boxes = rows.boxes()
    faults = [*table.faults, *rows.faults, *_unread(tables, table, taken, given)]
    if not boxes:
        raise ValueError(f'no box can be placed: {rows.faults[0].text}' if rows.faults else
                         'it has no box')
    scale, labels = UNITS[taken.unit], rows.labels
    rooms = {stack: size for stack in range(len(labels))
             if (size := rows.room(stack)) is not None}
    if form and form.in_line and rooms:  # so that each container begins at x = 0
        for box in boxes:
            box.pose[0] -= (table.number(labels[box.stack]) - 1.0) * rooms[box.stack][0]
    frames = given.frames or ('own' if rooms else form.frames if form else _frames(boxes))
    starts = _side_by_side(boxes, rooms) if frames == 'own' else dict.fromkeys(range(len(labels)),
                                                                               0.0)
    for box in boxes:
        box.pose[0] += starts[box.stack]
    if frames == 'one' and not (given.frames or form) and _touch(boxes):
        faults.append(Fault('frames', (), 'containers touch in one frame: say --frames one if they '
                                          'do, or own'))
    _name(boxes, labels)
    weighed = any(box.mass is not None for box in boxes)
    lacking = tuple(box.name for box in boxes if weighed and box.mass is None and not box.fixed)
    faults += [Fault('mass', (name,), 'has no mass: taken as 0') for name in lacking]
    if any(not math.isnan(box.friction) for box in boxes):
        faults += [Fault('friction', (box.name,), 'has no friction: --friction is taken')
                   for box in boxes if math.isnan(box.friction) and not box.fixed]
    faults += [*_odd_rooms(boxes, rooms, scale), *rows.payloads(boxes)]
    plan = _on_ground(boxes, labels, weighed, faults, {
        stack: np.array([(starts[stack], 0.0, 0.0), size + (starts[stack], 0.0, 0.0)])
        for stack, size in rooms.items()}, frames)
    text = taken.text(f' as {form.title}' if form else '')
    if len(labels) > 1:
        text += f'; {len(labels)} containers, ' + (
            'each with a frame of its own' if frames == 'own' else 'in one frame')
    return plan, text


def _unread(tables: Sequence[Table], table: Table, taken: Taken, given: Given) -> list[Fault]:
    """Return faults that name the columns and lists that are not read."""
    told: list[str] = []
    quiet: list[str] = []
    for name in table.columns:
        if name in taken.columns or name in taken.quiet:
            continue
        values = table.values(name)
        kinds = {str(value).strip() for value in values}
        if kinds <= {'', 'None', '0', '0.0', 'False'}:
            continue
        is_loud = len(kinds) > 1 or any(
            isinstance(value, int | float) and not isinstance(value, bool)
            or isinstance(value, str) and value.strip().lstrip('-+.,')[:1].isdigit()
            for value in values)
        is_above = name in table.above
        key = _beside(name, table.path) if is_above else name
        is_quiet = (not is_loud or is_harmless(key, is_above=is_above)
                    or is_named(name, given.ignore))
        (quiet if is_quiet else told).append(name)
    above = {path for rows in table.lists for path, _ in rows.above}
    others = [other.path for other in tables if other is not table and other.path not in above
              and not is_named(other.path, given.ignore)]
    return [Fault(kind, tuple(names), text) for kind, names, text in (
        ('column', told, f'not read: if it decides on nothing, add {_ignore(told)}; else --column'),
        ('part', others, f'not read, and may have boxes: if not, add {_ignore(others)}'),
        ('ignored', quiet, 'not read')) if names]


def _ignore(names: Sequence[str]) -> str:
    """Return options that ignore some names, as they are typed."""
    return shlex.join(words_of('--ignore', names))


def _beside(name: str, path: str) -> str:
    """Return a name with dots without what it has in common with a list's path."""
    words, others = name.split('.'), path.split('.')
    same = next((n for n, (a, b) in enumerate(zip(words[:-1], others)) if a != b),
                min(len(words) - 1, len(others)))
    return '.'.join(words[same:])


class _Rows:
    """The rows of a table, as boxes in metres and in the plan's axes."""

    def __init__(self, table: Table, taken: Taken, given: Given, form: Form | None) -> None:
        self.table, self.taken, self.given, self.form = table, taken, given, form
        self.faults: list[Fault] = []
        self.labels: list[str] = []
        self._stacks: dict[tuple[int, str], int] = {}
        self._names: Counter[str] = Counter()
        self._holders: dict[int, Record] = {}
        self._rooms: dict[int, list[Any]] = {}
        self._axes = AXES[taken.up]
        self._scale = UNITS[taken.unit]
        if taken.up != 'z' and {'roll', 'pitch'} & {*taken.single}:
            raise ValueError('roll and pitch are read where z is up')

    def boxes(self) -> list[Box]:
        """Return the rows that can be placed; the others are faults."""
        found = []
        for record in self.table.records:
            kind = str(self._cell(record, self.form.kinds) if self.form and self.form.kinds else
                       'ITEM').upper()
            stack = self._stack(record)
            if kind == 'BIN':
                if stack in self._rooms:
                    raise ValueError(f'the bin {self.labels[stack]} comes twice')
                self._rooms[stack] = [self._cell(record, name) for name in self.taken.size]
            elif kind == 'ITEM':
                box = self._box(record, stack)
                found += [box] if box else []
            elif kind != 'STACK':  # which is the box around items
                self.faults.append(Fault('shape', (f'row {record.number}',), f'{kind}: not read'))
        return found

    def room(self, stack: int) -> np.ndarray | None:
        """Return the inner size of a container (3,) [m], or None if there is none."""
        value: Any = self.given.container or self._rooms.get(stack)
        if value is None and self.taken.room:
            holder = self._holders[stack]
            value = [self._cell(holder, name) for name in self.taken.room]
            if all(part is None for part in value):
                return None
        if value is None:
            return None
        numbers = [self._scale * self.table.number(part) for part in value]
        if len(numbers) != 3 or not all(part > 0.0 for part in numbers) or size_fault(numbers):
            raise ValueError(f'container must be three inner sizes above 0, not '
                             f'{short_repr(value)}')
        along_file = self.given.container or stack in self._rooms or self.taken.is_room_along_file
        return np.array(numbers)[self._axes] if along_file else np.array(numbers)

    def payloads(self, boxes: Sequence[Box]) -> list[Fault]:
        """Return a fault for each container that has more in it than it may have."""
        faults = []
        for column in self.form.above.get('most', ()) if self.form else ():
            for stack, holder in self._holders.items():
                value = self._cell(holder, column)
                limit = self.table.number(value)
                inside = [box.mass for box in boxes if box.stack == stack]
                mass, name = sum(filter(None, inside)), (self.labels[stack] or 'container',)
                if mass > limit:
                    faults.append(Fault('payload', name, f'{mass:g} kg are in it, and it may have '
                                                         f'{limit:g} kg'))
                elif math.isnan(limit) or None in inside:
                    faults.append(Fault('limit', name, 'whether it has more than '
                                                       f'{short_repr(value)} kg is not judged'))
        return faults

    def _cell(self, record: Record, column: str) -> Any:
        return self.table.cell(record, column) if column else None

    def _single(self, record: Record, role: str) -> Any:
        return self._cell(record, self.taken.single.get(role, ''))

    def _stack(self, record: Record) -> int:
        """Return the number of the container of a row."""
        value = self._single(record, 'container')
        label = '' if value is None else str(value)
        key = id(record.rows), label
        if key not in self._stacks:
            name = '/'.join(filter(None, (record.rows.label, label)))
            self._names[name] += 1
            count = self._names[name]
            self._stacks[key] = len(self.labels)
            self._holders[len(self.labels)] = record
            self.labels.append(f'{name} ({count})' if count > 1 else name)
        return self._stacks[key]

    def _box(self, record: Record, stack: int) -> Box | None:
        """Return what a row says, or None; add what is wrong with it to the faults."""
        row = f'row {record.number}'
        given_name = self._single(record, 'name')
        name = row if given_name in (None, '') else str(given_name)
        place = '' if name == row else f'{row}: '
        odd = self.table.odd.get(record.number)
        count = self._single(record, 'count')
        if count not in (None, '') and self.table.number(count) != 1.0:
            column = self.taken.single['count']
            raise ValueError(f'{column} of {name} is {short_repr(count)}: a row is one box, with a '
                             'place of its own')
        try:
            size = self._size(record)
            pose, half = self._pose(record, size)
            fixed = FIXED.get(str(self._single(record, 'fixed') or '').lower())
            if fixed is None:
                raise _LeftOut('pose', f'fixed is {short_repr(self._single(record, "fixed"))}, '
                                       'neither true nor false')
            holder = self.taken.single.get('container', '')
            if holder and not fixed and self._cell(record, holder) in (None, ''):
                raise _LeftOut('row', f'{holder} is missing')
        except _LeftOut as error:
            kind, text = ('row', odd) if odd else (error.args[0], f'{place}{error.args[1]}')
            self.faults.append(Fault(kind, (name,), f'{text}: left out'))
            return None
        if odd:
            self.faults.append(Fault('cut', (name,), odd))
        order = self._single(record, 'order')
        return Box(name, record.number, stack, size, pose, half,
                   self._amount(record, name, place, 'mass', MASS_MAX, 0.0),
                   self._amount(record, name, place, 'limit', math.inf, math.inf) or 0.0,
                   self._amount(record, name, place, 'friction', MOST_FRICTION, math.nan) or 0.0,
                   fixed, None if order is None else self.table.number(order))

    def _numbers(self, record: Record, kind: str, columns: Sequence[str]) -> np.ndarray:
        values = [self._cell(record, name) for name in columns]
        numbers = [self.table.number(value) for value in values]
        for name, value, number in zip(columns, values, numbers):
            if math.isnan(number):
                is_text = isinstance(value, str) and ',' in value
                hint = '; the decimal mark is a point' if is_text else ''
                raise _LeftOut(kind, f'{name} is missing' if value is None else
                               f'{name} is {short_repr(value)}{hint}')
        return np.array(numbers)

    def _size(self, record: Record) -> np.ndarray:
        taken = self.taken
        if taken.size:
            size = self._scale * self._numbers(record, 'dimension', taken.size)
            if self.form and self.form.turned[0]:
                value = self._cell(record, self.form.turned[0])
                number = self.table.number(value)
                way = self.form.turned[1].get(int(number) if number.is_integer() else -1)
                if way is None:
                    raise _LeftOut('dimension', f'{self.form.turned[0]} is {short_repr(value)}')
                size = size[[*way]]
        else:
            low, high = np.split(self._scale * self._numbers(record, 'pose', taken.place), 2)
            size = high - low
        size = size[self._axes] if taken.is_along_file else size
        if fault := size_fault(size.tolist()):
            raise _LeftOut('dimension', fault)
        return size

    def _pose(self, record: Record, size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return a pose (7,), and half of the extents of the bounding box (3,) [m]."""
        place = (self._scale * self._numbers(record, 'pose', self.taken.place))[:3][self._axes]
        turn = self._turn(record)
        pose, half = np.concatenate((place, turn)), size / 2.0
        if fault := pose_fault(pose):
            raise _LeftOut('pose', fault)
        if turn is not STRAIGHT:
            axes = np.abs(rotation_matrix(turn[None])[0])
            half = axes @ half
            if self.taken.is_corner and np.abs(axes - np.rint(axes)).max() > SQUARE:
                raise _LeftOut('pose', 'a turned box is told by its centre')
        if self.taken.is_corner:
            pose[:3] += half
        return pose, half

    def _turn(self, record: Record) -> np.ndarray:
        """Return the quaternion x y z w of a row, in the plan's axes."""
        taken = self.taken
        if taken.turn:
            quaternion = self._numbers(record, 'pose', taken.turn)
        else:
            columns = [taken.single.get(role, '') for role in ANGLES]
            angles = [self._numbers(record, 'pose', [name])[0] if self._cell(record, name)
                      not in (None, '') else 0.0 for name in columns]
            if not any(angles):
                return STRAIGHT
            roll, pitch, yaw = TURNS[taken.turns] * np.array(angles)
            quaternion = STRAIGHT
            for axis, angle in ((0, roll), (1, pitch), (self._axes[2], yaw)):  # about fixed axes
                half = np.zeros(4)
                half[axis], half[3] = math.sin(angle / 2.0), math.cos(angle / 2.0)
                quaternion = _product(half, quaternion)
        sign = -1.0 if taken.up == 'y' else 1.0  # two axes change places: a mirror
        return np.append(sign * quaternion[:3][self._axes], quaternion[3])

    def _amount(self, record: Record, name: str, place: str, role: str, most: float,
                unknown: float) -> float | None:
        """Return a mass, a limit or a friction; what is no such number is a fault."""
        value = self._single(record, role)
        if value in (None, ''):
            return None if role == 'mass' else unknown
        unit = 1.0 if role == 'friction' else MASS_UNITS[self.taken.mass_unit]
        amount = unit * self.table.number(value)
        if not 0.0 <= amount <= most:
            self.faults.append(Fault(role, (name,), f'{place}{role} is {short_repr(value)}: taken '
                                     f'as {"0" if role == "mass" else "unknown"}'))
            return unknown
        return amount


def _product(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the product of two quaternions x y z w: turn b, then turn a."""
    vector = a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3])
    return np.append(vector, a[3] * b[3] - a[:3] @ b[:3])


def _frames(boxes: Sequence[Box]) -> str:
    """Return 'own' if the least corners of all containers agree, else 'one'."""
    least: dict[int, np.ndarray] = {}
    for box in boxes:
        low = box.pose[:3] - box.half
        least[box.stack] = np.minimum(low, least.get(box.stack, low))
    corners = np.array([*least.values()])
    return 'own' if np.ptp(corners, axis=0).max() <= SAME else 'one'


def _touch(boxes: Sequence[Box]) -> bool:
    """Return whether boxes of two containers touch, so that one may carry the other."""
    pairs, _ = contacts_of(np.array([box.size for box in boxes]),
                           np.array([box.pose for box in boxes]), tolerance=SAME,
                           most_near=most_near(len(boxes)))
    stacks = np.array([box.stack for box in boxes])[pairs]
    return bool((stacks[:, 0] != stacks[:, 1]).any())


def _name(boxes: Sequence[Box], labels: Sequence[str]) -> None:
    """Put containers before the names of boxes, and rows behind those that come twice."""
    for box in boxes:
        if len(labels) > 1:
            box.name = f'{labels[box.stack]}/{box.name}'
    counts = Counter(box.name for box in boxes)
    for box in boxes:
        if counts[box.name] > 1:
            box.name += f'/{box.row}'


def _on_ground(boxes: Sequence[Box], labels: Sequence[str], weighed: bool, faults: list[Fault],
               rooms: Mapping[int, np.ndarray], frames: str) -> Plan:
    """Return the plan of boxes and of what carries them: rooms (2, 3) by stack, or the ground."""
    sizes, poses = (np.array([getattr(box, name) for box in boxes]) for name in ('size', 'pose'))
    held = {box.stack for box in boxes if box.fixed}
    held = {*range(len(labels))} if held and frames == 'one' else held
    bare = [n for n, box in enumerate(boxes) if box.stack not in {*rooms, *held}]
    slabs = [(f'{labels[stack] or "container"} {name}', size, [*centre, *UNTURNED])
             for stack, room in rooms.items() for name, size, centre in walls(*room)]
    if bare:
        size, pose = slab_below(sizes[bare], poses[bare])
        slabs.append((GROUND, size, pose.tolist()))
    plan = Plan(
        sizes, poses, [box.mass or 0.0 for box in boxes] if weighed else None,
        ground=[n for n, box in enumerate(boxes) if box.fixed], names=[box.name for box in boxes],
        limits=[box.limit for box in boxes], friction=[box.friction for box in boxes],
        order=_loading(boxes, faults), stack=[box.stack for box in boxes],
        stacks=labels if len(labels) > 1 else (), faults=faults,
        room=np.array([rooms.get(box.stack, NO_ROOM) for box in boxes]))
    return plan.with_fixed(*zip(*slabs)) if slabs else plan


def _odd_rooms(boxes: Sequence[Box], rooms: Mapping[int, np.ndarray], scale: float) -> list[Fault]:
    """Return a fault if a container seems to have another unit than its boxes."""
    for stack, room in rooms.items():
        longest = max((max(box.size) for box in boxes if box.stack == stack), default=0.0)
        if room.max() > LONG_ROOM and 0.0 < longest < LONG or longest > FULL * room.max():
            return [Fault('unit', (), f'the container is {room.max():g} m long, and a box '
                                      f'{longest:g} m: its size is in the unit of the file')]
    return []


def _side_by_side(boxes: Sequence[Box], rooms: Mapping[int, np.ndarray]) -> dict[int, float]:
    """Return how far along x each container goes, so that they are beside each other [m]."""
    ends: dict[int, tuple[float, float]] = {}
    for box in boxes:
        low, high = ends.get(box.stack, (0.0, 0.0))
        reach = box.half[0]
        ends[box.stack] = min(low, box.pose[0] - reach), max(high, box.pose[0] + reach)
    starts, start = {}, 0.0
    for stack in sorted({*ends, *rooms}):
        low, high = ends.get(stack, (0.0, 0.0))
        starts[stack] = start - (low if start else 0.0)
        start = starts[stack] + max(high, rooms[stack][0] if stack in rooms else 0.0) + ROOM
    return starts


def _loading(boxes: Sequence[Box], faults: list[Fault]) -> list[int] | None:
    """Return the number by which each box comes, or None; name those that have none."""
    free = [box for box in boxes if not box.fixed]
    if all(box.order is None for box in free):
        return None
    lack = tuple(box.name for box in free if box.order is None or not (
        box.order.is_integer() and abs(box.order) <= MOST_STEPS))
    if lack:
        faults.append(Fault('order', lack, 'has no whole number: steps are not judged'))
        return None
    return [0 if box.fixed else int(box.order or 0) for box in boxes]

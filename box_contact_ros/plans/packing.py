# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Packing plans: CSV and JSON of our own, and the forms of known packers.

A row is a box: its name, full extents, centre or least corner, and, where it has them, its
quaternion, mass and limit [kg], whether it is fixed, and a whole number by which it comes. Lengths
are in metres unless the form or the caller has another unit. Where no row is fixed and no container
has a floor, z = 0 is the ground. msg_schemas/plan.json is the format in JSON; the columns of a CSV
file have the same names.
"""
from __future__ import annotations

import csv
import io
import math
import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ..core import LENGTH_MAX, MASS_MAX
from ..solver.checks import nearest_name, pose_fault, short_repr, size_fault
from .forms import (
    EXTENTS,
    GREATEST,
    LEAST,
    NOTHING,
    OWN,
    PLACE,
    PLACES,
    SIZES,
    TURN,
    UNITS,
    Form,
    Given,
    Item,
    Packing,
    document_packing,
    means_amount,
    table_form,
    table_packing,
)
from .plan import NO_ROOM, UNTURNED, Fault, Plan
from .room import walls

KEYS = ('name', *(key for way in (*SIZES, *PLACES) for key in way), *TURN, 'mass', 'limit', 'fixed',
        'order')
COLUMNS = ('name', *EXTENTS, *PLACE, *TURN, 'mass', 'limit', 'fixed', 'order')
"""What a refusal names; the others are other ways to tell sizes and places."""
DELIMITERS = ',;\t'
WORDS = {'true': True, '1': True, 'yes': True, 'false': False, '0': False, 'no': False, '': False}
"""What `fixed` may be in a CSV file."""
COMMA = re.compile(r'[-+]?\d+,\d+')
"""A number with a decimal comma, or with one between thousands."""
DECIMALS = '; are commas decimal marks? Then separate the columns by ;'
GROUND, GROUND_THICKNESS, GROUND_MARGIN = 'ground', 1.0, 1.0
"""Name, thickness, and how far it reaches beyond the boxes [m]."""
ROOM = 1.0  # between the stacks of one file, which are placed side by side [m]
LONG = 20.0
"""Half of the boxes are longer only where their unit is not the metre [m]."""
LONG_ROOM, FULL = 30.0, 5.0
"""A container is longer, or shorter than a box by more, only where their units differ [m, 1]."""
MOST_STEPS = 2**53  # a float64 has all whole numbers up to it
Row = Mapping[str, Any]


class Read(NamedTuple):
    """A plan, and how its file was read: '' for a form of our own."""

    plan: Plan
    form: str


def read_csv(text: str, given: Given = NOTHING) -> Read:
    """Return the plan of a CSV file, or of a packer's table; its faults are rows.

    Raises ValueError for other files.
    """
    lines = list(io.StringIO(text.removeprefix('\ufeff'), newline=''))
    start = next((n for n, line in enumerate(lines) if is_first(line)), None)
    if start is None:
        raise ValueError('it is empty')
    delimiter = _delimiter(lines[start])
    if not delimiter:  # columns, and a rule below the header
        lines[start:] = [','.join(line.split()) for line in lines[start:] if line.strip(' -\r\n')]
    reader = csv.reader(lines[start:], delimiter=delimiter or ',', strict=True)
    try:
        header, *rows = reader
    except csv.Error as error:  # such as a quote that is not closed
        raise ValueError(f'line {start + reader.line_num}: it is not CSV: {error}') from None
    form = table_form(_stripped(header))
    try:
        keys, needed = (form.keys, tuple(filter(None, form.keys))) if form else _own_keys(header)
    except ValueError as error:
        raise ValueError(f'line {start + 1}: {error}') from None
    faults: list[Fault] = []
    rows = [row for row in rows if any(value.strip() for value in row)]
    is_cut = not text.endswith(('\n', '\r'))
    cells = [(number, _cells(row, keys, delimiter)) for number, row in enumerate(rows, 1)
             if _is_whole(row, number, keys, needed, delimiter, faults,
                          is_cut and number == len(rows))]
    packing = table_packing(form, cells) if form else Packing(
        OWN, [Item(number, '', row) for number, row in cells])
    return plan_of(replace(packing, faults=[*faults, *packing.faults]), given)


def is_first(line: str) -> bool:
    """Return whether a line is the first one that counts: neither blank nor a comment."""
    return line.strip()[:1] not in ('', '#')


def is_header(line: str) -> bool:
    """Return whether a line is a header that is read, whatever its file is called."""
    cells = [cell.strip().lower() for cell in re.split(_delimiter(line) or ' +', line.strip())]
    return table_form(cells) is not None or 'name' in cells and len({*cells} & {*KEYS}) > 3


def _delimiter(line: str) -> str:
    """Return what separates the columns of a header, or '' for blanks."""
    delimiter = max(DELIMITERS, key=line.count)
    return delimiter if delimiter in line else ''


def _own_keys(header: list[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the key of each column of our own, and those that are needed.

    Raises ValueError for columns that are missing, or come twice.
    """
    names = _stripped(header)
    columns = [name.lower() for name in names]
    for key, count in Counter(filter(None, columns)).items():
        if count > 1:
            raise ValueError(f'the column {key} comes twice')
    sizes, place = _ways(columns)
    needed = ('name', *sizes, *place)
    for key in needed:
        if key not in columns:
            raise ValueError(f'the column {key} is missing{nearest_name(key, columns)}; the columns'
                             f' are {", ".join(COLUMNS)}, and x_min y_min z_min if you have the '
                             'least corner')
    return tuple(column if column in KEYS else name or f'column {n}'
                 for n, (column, name) in enumerate(zip(columns, names), 1)), needed


def _ways(keys: Collection[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return by which keys a file tells sizes and places, or by which it has the most.

    Raises ValueError if it tells one in two ways.
    """
    found = []
    for ways, what in (SIZES, 'a size'), (PLACES, 'a place'):
        whole = [way for way in ways if {*way} <= {*keys}]
        if len(whole) > 1:
            raise ValueError(f'{" ".join(whole[0])} and {" ".join(whole[1])} both tell {what}: '
                             'leave one out')
        found += whole or [max(ways, key=lambda way: len({*way} & {*keys}))]
    sizes, place = found
    return sizes, LEAST if sizes == GREATEST else place


def _stripped(cells: Iterable[str]) -> list[str]:
    """Return cells without blanks around them, and without blank ones at the end."""
    stripped = [cell.strip() for cell in cells]
    while stripped and not stripped[-1]:
        stripped.pop()
    return stripped


def _cells(row: list[str], keys: Sequence[str], delimiter: str) -> dict[str, str]:
    """Return what a row says, by key."""
    cells = {key: value.strip() for key, value in zip(keys, row) if key and value.strip()}
    if delimiter == ';':  # where a comma is the decimal mark
        cells = {key: value if key == 'name' else value.replace(',', '.')
                 for key, value in cells.items()}
    return cells


def _is_whole(row: list[str], number: int, keys: Sequence[str], needed: Sequence[str],
              delimiter: str, faults: list[Fault], is_cut: bool) -> bool:
    """Return whether a row can be read; add what seems to be missing.

    needed: keys without which it cannot. is_cut: whether the file ends within the row, so that its
    last cell may be a part of one.
    """
    name = _cells(row, keys, delimiter).get('name', f'row {number}')
    count = min(len(row), max(len(keys), len(_stripped(row))))
    hidden = sum(delimiter in line for cell in row for line in cell.strip().splitlines()[1:])
    if hidden:
        faults.append(Fault('cut', (name,), f'row {number}: a quote goes on over {hidden} lines '
                                            'that may be rows'))
    if count == len(keys):
        return True
    left_out = is_cut or count > len(keys) or not {*needed} <= {*keys[:count]}
    commas = count > len(keys) and delimiter == ','
    faults.append(Fault('cut', (name,), f'row {number} has {count} cells, and the header '
                        f'{len(keys)}{DECIMALS if commas else ""}'
                        f'{": left out" if left_out else ""}', lacks='place' if left_out else None))
    return not left_out


def read_packing(document: Any, given: Given = NOTHING) -> Read | None:
    """Return the plan of a JSON document, or None if it has another form."""
    packing = document_packing(document)
    own = document.get('boxes') if isinstance(document, Mapping) else None
    if packing is None and isinstance(own, list):
        packing = Packing(OWN, [Item(n, '', row) for n, row in enumerate(own, 1)])
        if 'container' in document:
            packing.rooms[''] = document['container']
        packing.faults += unread({key: value for key, value in document.items()
                                  if key not in ('boxes', 'container')})
    return plan_of(packing, given) if packing else None


def unread(values: Mapping[str, Any]) -> list[Fault]:
    """Return faults that name columns or keys that are not read; values: one of each."""
    amounts = tuple(key for key in values if means_amount(key))
    parts = tuple(key for key, value in values.items() if key not in amounts and (
        isinstance(value, Mapping) or (isinstance(value, list) and any(
            isinstance(part, Mapping) for part in value))))
    others = tuple(key for key in values if key not in amounts + parts)
    return [Fault('column', names, text, verdict=verdict, lacks=lacks) for names, text, verdict,
            lacks in ((amounts, 'not read, and may mean masses or limits, which are in mass and '
                       'limit [kg]', 'not all judged', 'part'),
                      (parts, 'not read, and may have boxes', 'not all judged', 'part'),
                      (others, 'not read', 'sound', '')) if names]


def plan_of(packing: Packing, given: Given) -> Read:
    """Return the plan of a packing; rows that cannot be placed are left out, and named.

    Raises ValueError where no row can be placed, or what is given contradicts the file.
    """
    form, items, faults = packing.form, list(packing.items), list(packing.faults)
    rows = [item.row if isinstance(item.row, Mapping) else {} for item in items]
    others: dict[str, Any] = {}
    for row in rows:
        others |= {key: value for key, value in row.items() if key not in KEYS}
    way = _Way.of({key for row in rows for key in row}, form, given)
    boxes = [box for item, row in zip(items, rows)
             if (box := _box(item, row, way, faults))]
    faults += unread(others)
    if not boxes:
        raise ValueError(f'no box can be placed: {faults[0].text}' if faults else 'it has no box')
    names = [box.name for box in boxes]
    for name, count in Counter(names).items():
        if count > 1:
            faults.append(Fault('twice', (name,), f'{count} boxes have this name'))
    weighed = any(box.mass is not None for box in boxes)
    for box in boxes:
        if weighed and box.mass is None and not box.fixed:
            faults.append(Fault('mass', (box.name,), 'has no mass: taken as 0'))
    way, doubts = way.doubts(boxes)
    stacks = [*dict.fromkeys(box.stack for box in boxes)]
    rooms = {stack: size for stack in stacks
             if (size := _inner(given.container or packing.rooms.get(stack), way)) is not None}
    faults += [*doubts, *_odd_rooms(boxes, rooms), *_too_heavy(boxes, packing.most)]
    if form.in_line and rooms:  # so that each container begins at x = 0
        for box in boxes:
            box.pose[0] -= (_number(box.stack) - 1.0) * rooms[box.stack][0]
    starts = (_side_by_side(boxes, stacks, rooms) if rooms or not form.in_line else
              dict.fromkeys(stacks, 0.0))
    poses = np.array([box.pose for box in boxes])
    poses[:, 0] += [starts[box.stack] for box in boxes]
    return Read(_on_ground(boxes, poses, weighed, faults, {
        stack: np.array([(starts[stack], 0.0, 0.0), size + (starts[stack], 0.0, 0.0)])
        for stack, size in rooms.items()}), way.text)


def _on_ground(boxes: Sequence[_Box], poses: np.ndarray, weighed: bool, faults: list[Fault],
               rooms: Mapping[str, np.ndarray]) -> Plan:
    """Return the plan of boxes and of what carries them: rooms (2, 3) by stack, or the ground."""
    sizes = np.array([box.size for box in boxes])
    bare = [n for n, box in enumerate(boxes) if box.stack not in rooms]
    slabs = [(f'{stack or "container"} {name}', size, [*centre, *UNTURNED])
             for stack, room in rooms.items() for name, size, centre in walls(*room)]
    if bare and not any(box.fixed for box in boxes):
        size, pose = slab_below(sizes[bare], poses[bare])
        slabs.append((GROUND, size, pose.tolist()))
    if slabs:
        sizes = np.vstack((sizes, [size for _, size, _ in slabs]))
        poses = np.vstack((poses, [pose for *_, pose in slabs]))
    count = len(boxes)
    stacks = {label: number for number, label in enumerate(dict.fromkeys(
        box.stack for box in boxes))}
    order = _loading(boxes, faults)
    return Plan(
        sizes, poses, [box.mass or 0.0 for box in boxes] + [0.0] * len(slabs) if weighed else None,
        ground=[*(n for n, box in enumerate(boxes) if box.fixed), *range(count, len(sizes))],
        names=[box.name for box in boxes] + [name for name, *_ in slabs],
        limits=[box.limit for box in boxes] + [math.inf] * len(slabs),
        order=order and [*order, *[0] * len(slabs)],
        stack=[*(stacks[box.stack] for box in boxes), *[0] * len(slabs)], faults=faults,
        room=np.array([*(rooms.get(box.stack, NO_ROOM) for box in boxes), *[NO_ROOM] * len(slabs)]))


def _inner(value: Any, way: _Way) -> np.ndarray | None:
    """Return the inner size of a container (3,) [m], or None if there is none."""
    if value is None:
        return None
    numbers = [way.scale * _number(one) for one in value] if isinstance(value, Sequence) else []
    if len(numbers) != 3 or not all(number > 0.0 for number in numbers) or size_fault(numbers):
        raise ValueError(f'container must be three inner sizes above 0, not {short_repr(value)}')
    return np.array(numbers)


def _odd_rooms(boxes: Sequence[_Box], rooms: Mapping[str, np.ndarray]) -> list[Fault]:
    """Return a fault if a container seems to have another unit than its boxes."""
    for stack, room in rooms.items():
        longest = max(max(box.size) for box in boxes if box.stack == stack)
        if room.max() > LONG_ROOM and longest < LONG or longest > FULL * room.max():
            return [Fault('unit', (), f'the container is {room.max():g} m long, and a box '
                                      f'{longest:g} m: its size is in the unit of the file')]
    return []


def _too_heavy(boxes: Sequence[_Box], most: Mapping[str, Any]) -> list[Fault]:
    """Return a fault for each container that has more in it than it may have."""
    faults = []
    for stack, value in most.items():
        limit, inside = _number(value), [box.mass for box in boxes if box.stack == stack]
        mass, name = sum(filter(None, inside)), stack or 'container'
        if mass > limit:
            faults.append(Fault('mass', (name,), f'{mass:g} kg are in it, and it may have '
                                                 f'{limit:g} kg', verdict='not sound', lacks=''))
        elif math.isnan(limit) or None in inside:
            faults.append(Fault('mass', (name,), f'whether it has more than {short_repr(value)} kg '
                                                 'is not judged', lacks='limit'))
    return faults


def _side_by_side(boxes: Sequence[_Box], stacks: Sequence[str], rooms: Mapping[str, np.ndarray],
                  ) -> dict[str, float]:
    """Return how far along x each stack goes, so that they are beside each other [m]."""
    ends = dict.fromkeys(stacks, 0.0)
    for box in boxes:
        ends[box.stack] = max(ends[box.stack], box.pose[0] + box.size[0] / 2.0)
    starts, start = {}, 0.0
    for stack in stacks:
        starts[stack] = start
        start += max(ends[stack], rooms[stack][0] if stack in rooms else 0.0) + ROOM
    return starts


@dataclass(frozen=True)
class _Way:
    """How the numbers of a file tell where its boxes are."""

    form: Form
    place: tuple[str, ...]
    sizes: tuple[str, ...]
    of_corner: bool
    """Whether a place is a least corner."""
    unit: str | None
    is_given: bool
    """Whether the caller has told the unit."""

    @classmethod
    def of(cls, keys: Collection[str], form: Form, given: Given) -> _Way:
        """Return how a file with these keys is read. Raises ValueError for a contradiction."""
        sizes, place = _ways(keys)
        if place == LEAST and given.origin == 'centre':
            raise ValueError(f"origin must not be 'centre': {' '.join(LEAST)} are a corner, and "
                             f"{' '.join(PLACE)} centres" if
                             form is OWN else
                             f"origin must not be 'centre': {form.title} has least corners")
        return cls(form, place, sizes, place == LEAST or given.origin == 'corner',
                   given.unit or form.unit, given.unit is not None)

    @property
    def scale(self) -> float:
        """Return the length of the unit [m]."""
        return UNITS[self.unit or 'mm']

    @property
    def text(self) -> str:
        """Return a line on how the file of a known packer is read; '' for our own form."""
        if self.form is OWN:
            return ''
        where = ('two corners' if self.sizes == GREATEST else 'least corners, sizes along x y z' if
                 self.of_corner else 'centres, sizes along x y z')
        return f'read as {self.form.title}: {where}{self.form.note}, {self.unit or "no unit"}'

    def doubts(self, boxes: Sequence[_Box]) -> tuple[_Way, list[Fault]]:
        """Return how the file is read, and a fault if its unit is not known, or seems another.

        Boxes that are far too long for metres are taken as millimetres.
        """
        if self.unit is None:
            return self, [Fault('unit', (), 'the file has none: read as mm; add --unit m, cm or '
                                            'mm')]
        longest = sorted(max(box.size) for box in boxes if not box.fixed)
        middle = longest[len(longest) // 2] if longest else 0.0
        if self.is_given or self.form is not OWN or middle <= LONG:
            return self, []
        for box in boxes:
            box.size[:] = [UNITS['mm'] * value for value in box.size]
            box.pose[:3] = [UNITS['mm'] * value for value in box.pose[:3]]
        return replace(self, unit='mm'), [Fault(
            'unit', (), f'half of the boxes would be {middle:g} m long or more: read as mm; add '
                        '--unit mm or cm, or m if they are')]


def _loading(boxes: Sequence[_Box], faults: list[Fault]) -> list[int] | None:
    """Return the number by which each box comes, or None; name those that have none."""
    free = [box for box in boxes if not box.fixed]
    if all(box.order is None for box in free):
        return None
    lack = tuple(box.name for box in free if not _is_whole_number(box.order))
    if lack:
        faults.append(Fault('order', lack, 'has no whole number: steps are not judged'))
        return None
    return [0 if box.fixed else int(box.order or 0) for box in boxes]


def _is_whole_number(value: float | None) -> bool:
    return value is not None and value.is_integer() and abs(value) <= MOST_STEPS


def slab_below(sizes: np.ndarray, poses: np.ndarray, height: float = 0.0,
               ) -> tuple[np.ndarray, np.ndarray]:
    """Return full extents (3,) and pose (7,) of a slab under all boxes, its top at a height [m]."""
    reach = np.linalg.norm(sizes, axis=1, keepdims=True) / 2.0 + GROUND_MARGIN
    low, high = (poses[:, :2] - reach).min(axis=0), (poses[:, :2] + reach).max(axis=0)
    return (np.array([*np.minimum(high - low, LENGTH_MAX), GROUND_THICKNESS]),
            np.array([*(low + high) / 2.0, height - GROUND_THICKNESS / 2.0, *UNTURNED]))


@dataclass(frozen=True)
class _Box:
    """A row that can be placed."""

    name: str
    stack: str
    size: list[float]
    pose: list[float]
    mass: float | None
    limit: float
    fixed: bool
    order: float | None


def _box(item: Item, row: Row, way: _Way, faults: list[Fault]) -> _Box | None:
    """Return what a row says, or None; add what is wrong with it to the faults."""
    name = str(row.get('name', f'row {item.number}'))
    place = '' if name == f'row {item.number}' else f'row {item.number}: '
    turn = TURN if any(key in row for key in TURN) else ()
    size: list[float] = []
    pose: list[float] = []
    for kind, keys in ('dimension', way.sizes), ('pose', way.place + turn):
        values = [_number(row.get(key)) for key in keys]
        text = next((_not_read(row, key) for key, value in zip(keys, values) if math.isnan(value)),
                    '')
        if kind == 'dimension':
            if way.sizes == GREATEST:
                values = [high - _number(row.get(key)) for high, key in zip(values, LEAST)]
            size = [way.scale * value for value in values]
            text = text or size_fault(size) or ''
        else:
            pose = [way.scale * value for value in values[:3]] + (values[3:] or [*UNTURNED])
            if way.of_corner:
                pose[:3] = [low + side / 2.0 for low, side in zip(pose, size)]
            text = text or pose_fault(pose) or ''
            if way.of_corner and pose[3:] != [*UNTURNED]:
                text = text or 'a turned box is told by its centre, x y z'
        if text:
            faults.append(Fault(kind, (name,), f'{place}{text}: left out'))
            return None
    amounts: list[float | None] = []
    for key, most in ('mass', MASS_MAX), ('limit', math.inf):
        value = _number(row[key]) if row.get(key) is not None else None
        if value is not None and not 0.0 <= value <= most:
            faults.append(Fault('mass', (name,), f'{place}{key} is {short_repr(row[key])}: taken '
                                                 f'as {"0" if key == "mass" else "unknown"}',
                                lacks='weight' if key == 'mass' else 'limit'))
            value = 0.0 if key == 'mass' else None
        amounts.append(value)
    fixed = WORDS.get(str(row.get('fixed', '')).lower())
    if fixed is None:
        faults.append(Fault('pose', (name,), f'{place}fixed is {short_repr(row["fixed"])}, neither '
                                             'true nor false: left out'))
        return None
    return _Box(name, item.stack, size, pose, amounts[0],
                math.inf if amounts[1] is None else amounts[1], fixed,
                None if row.get('order') is None else _number(row['order']))


def _not_read(row: Row, key: str) -> str:
    """Return what is wrong with a key that has no number."""
    if key not in row:
        return f'{key} is missing'
    is_comma = isinstance(row[key], str) and COMMA.fullmatch(row[key])
    return f'{key} is {short_repr(row[key])}{"; the decimal mark is a point" if is_comma else ""}'


def _number(value: Any) -> float:
    """Return a number, or one that a text has; NaN for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float | str) or '_' in str(value):
        return math.nan
    try:
        return float(value)
    except (ValueError, OverflowError):
        return math.nan

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Packing plans: CSV and JSON of our own, and the JSON of two projects.

A row is a box: its name, full extents and centre [m], and, where it has them, its quaternion, mass
and limit [kg], whether it is fixed, and a whole number by which it comes. Where no row is fixed,
z = 0 is the ground.
msg_schemas/plan.json is the format in JSON; the columns of a CSV file have the same names.
"""
from __future__ import annotations

import csv
import io
import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..core import LENGTH_MAX, MASS_MAX
from ..solver.checks import nearest_name, pose_fault, short_repr, size_fault
from .plan import Fault, Plan

EXTENTS, PLACE, TURN = ('length', 'width', 'height'), ('x', 'y', 'z'), ('qx', 'qy', 'qz', 'qw')
NEEDED = ('name', *EXTENTS, *PLACE)
KEYS = (*NEEDED, *TURN, 'mass', 'limit', 'fixed', 'order')
DELIMITERS = ',;\t'
WORDS = {'true': True, '1': True, 'yes': True, 'false': False, '0': False, 'no': False, '': False}
"""What `fixed` may be in a CSV file."""
AMOUNT = re.compile(
    '.*(mass|weight|gewicht|poids|peso|limit|capacity|strength|payload|traglast|auflast).*|'
    'kgs?|kilos?|kilograms?|lbs?|kn|tons?|tonnes?|gross|net|tare|brutto|'
    'netto|vgm|max|maximum|stackable|maxload')
"""Words in the names of columns that may mean a mass or a limit."""
UNTURNED = (0.0, 0.0, 0.0, 1.0)
GROUND, GROUND_THICKNESS, GROUND_MARGIN = 'ground', 1.0, 1.0
"""Name, thickness, and how far it reaches beyond the boxes [m]."""
ROOM = 1.0  # between the stacks of one file, which are placed side by side [m]
MILLIMETRE = 1e-3
MOST_STEPS = 2**53  # a float64 has all whole numbers up to it
Row = Mapping[str, Any]


def read_csv(text: str) -> Plan:
    """Return the plan of a CSV file; its faults are rows. Raises ValueError for other files."""
    lines = list(io.StringIO(text.removeprefix('\ufeff'), newline=''))
    start = next((n for n, line in enumerate(lines) if line.strip()), None)
    if start is None:
        raise ValueError('it is empty')
    delimiter = max(DELIMITERS, key=lines[start].count)
    reader = csv.reader(lines[start:], delimiter=delimiter, strict=True)
    try:
        header, *rows = reader
    except csv.Error as error:  # such as a quote that is not closed
        raise ValueError(f'line {start + reader.line_num}: it is not CSV: {error}') from None
    names = _stripped(header)
    columns = [name.lower() for name in names]
    for key, count in Counter(filter(None, columns)).items():
        if count > 1:
            raise ValueError(f'line {start + 1}: the column {key} comes twice')
    for key in NEEDED:
        if key not in columns:
            raise ValueError(f'line {start + 1}: the column {key} is missing'
                             f'{nearest_name(key, columns)}; the columns are {", ".join(KEYS)}')
    faults: list[Fault] = []
    rows = [row for row in rows if any(value.strip() for value in row)]
    is_cut = not text.endswith(('\n', '\r'))
    keys = [column if column in KEYS else name or f'column {n}'
            for n, (column, name) in enumerate(zip(columns, names), 1)]
    return plan_of([(number, _cells(row, number, keys, delimiter)) for number, row in enumerate(
        rows, 1) if _is_whole(row, number, keys, delimiter, faults,
                              is_cut and number == len(rows))], faults)


def _stripped(cells: Iterable[str]) -> list[str]:
    """Return cells without blanks around them, and without blank ones at the end."""
    stripped = [cell.strip() for cell in cells]
    while stripped and not stripped[-1]:
        stripped.pop()
    return stripped


def _cells(row: list[str], number: int, keys: list[str], delimiter: str) -> dict[str, str]:
    """Return what a row says, by key."""
    cells = {key: value.strip() for key, value in zip(keys, row) if value.strip()}
    if delimiter == ';':  # where a comma is the decimal mark
        cells = {key: value if key == 'name' else value.replace(',', '.')
                 for key, value in cells.items()}
    return cells


def _is_whole(row: list[str], number: int, keys: list[str], delimiter: str, faults: list[Fault],
              is_cut: bool) -> bool:
    """Return whether a row can be read; add what seems to be missing.

    is_cut: whether the file ends within the row, so that its last cell may be a part of one.
    """
    name = _cells(row, number, keys, delimiter).get('name', f'row {number}')
    count = min(len(row), max(len(keys), len(_stripped(row))))
    hidden = sum(delimiter in line for cell in row for line in cell.strip().splitlines()[1:])
    if hidden:
        faults.append(Fault('cut', (name,), f'row {number}: a quote goes on over {hidden} lines '
                                            'that may be rows'))
    if count == len(keys):
        return True
    left_out = is_cut or count > len(keys) or not set(NEEDED) <= {*keys[:count]}
    faults.append(Fault('cut', (name,), f'row {number} has {count} cells, and the header '
                                        f'{len(keys)}{": left out" if left_out else ""}',
                        lacks='place' if left_out else None))
    return not left_out


def read_packing(document: Any) -> Plan | None:
    """Return the plan of a JSON document, or None if it has another form."""
    if isinstance(document, Mapping):
        if isinstance(document.get('boxes'), list):
            return plan_of(enumerate(document['boxes'], 1), unread(
                {key: value for key, value in document.items() if key != 'boxes'}))
        if isinstance(document.get('containers'), list):
            return _side_by_side(map(_placements, document['containers']))
        if document and all(isinstance(order, list) and order and all(
                isinstance(entry, Mapping) and 'flb_coordinates' in entry for entry in order)
                for order in document.values()):
            return _side_by_side(_order(name, order) for name, order in document.items())
    return None


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


def means_amount(key: str) -> bool:
    """Return whether a name may mean a mass or a limit, such as gross_weight, kg or maxLoad."""
    words = re.findall('[a-zäöüß]+', re.sub('([a-z])([A-Z])', r'\1 \2', key).lower())
    return any(map(AMOUNT.fullmatch, words)) or words[-1:] == ['load']


def _placements(container: Any) -> Iterator[dict[str, Any]]:
    """Yield the rows of a container of 3d-bin-container-packing's viewer, in millimetres."""
    try:
        for n, entry in enumerate(container['stack']['placements']):
            goods = entry['stackable']
            name = f'{container.get("name")}/{goods.get("name") or n + 1}/{n + 1}'
            yield {**_from_corner(name, [goods[key] for key in ('dx', 'dy', 'dz')],
                                  [entry[key] for key in ('x', 'y', 'z')]), **_amounts(goods)}
    except (LookupError, TypeError, AttributeError) as error:
        raise ValueError(f'a container lacks {error}') from None


def _order(name: str, entries: Sequence[Row]) -> Iterator[dict[str, Any]]:
    """Yield the rows of an order of BED-BPP, in millimetres."""
    for n, entry in enumerate(entries):
        try:
            item, corner = entry['item'], entry['flb_coordinates']
            extents = [item[f'{side}/mm'] for side in EXTENTS]
            if entry['orientation'] == 1:
                extents[:2] = extents[1::-1]
            yield {**_from_corner(f'{name}/{item["sequence"]}', extents, corner),
                   'mass': item['weight/kg'], **_amounts(item)}
        except (LookupError, TypeError) as error:
            raise ValueError(f'order {name}, entry {n}: it lacks {error}') from None


def _amounts(goods: Row) -> Row:
    """Return what may mean a mass or a limit and is not read."""
    return {key: value for key, value in goods.items() if key != 'weight/kg' and means_amount(key)}


def _from_corner(name: str, extents: Sequence[Any], corner: Sequence[Any]) -> dict[str, Any]:
    """Return a row of extents and of the least corner, both in millimetres."""
    sides, low = ([_number(value) * MILLIMETRE for value in values] for values in (extents, corner))
    return {'name': name, **dict(zip(EXTENTS, sides)),
            **{key: value + side / 2.0 for key, value, side in zip(PLACE, low, sides)}}


def _side_by_side(stacks: Iterable[Iterable[dict[str, Any]]]) -> Plan:
    """Return the plan of stacks that each begin at x = 0, one after another along x."""
    start, placed, stack_of = 0.0, [], []
    for number, stack in enumerate(stacks):
        rows = list(stack)
        ends = [row['x'] + row['length'] / 2.0 for row in rows]
        placed += [{**row, 'x': row['x'] + start} for row in rows]
        stack_of += [number] * len(rows)
        start += max((end for end in ends if math.isfinite(end)), default=0.0) + ROOM
    return plan_of(enumerate(placed, 1), stack_of=stack_of)


def plan_of(rows: Iterable[tuple[int, Any]], faults: Iterable[Fault] = (),
            stack_of: Sequence[int] = ()) -> Plan:
    """Return the plan of rows by number; those that cannot be placed are left out, and named.

    faults: what is already known to be wrong. stack_of: the stack of each row; () is one stack.
    Raises ValueError where no row can be placed.
    """
    faults, boxes, stack = list(faults), [], []
    others: dict[str, Any] = {}
    for number, row in rows:
        row = row if isinstance(row, Mapping) else {}
        others |= {key: value for key, value in row.items() if key not in KEYS}
        if box := _box(row, number, faults):
            boxes.append(box)
            stack.append(stack_of[number - 1] if stack_of else 0)
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
    order = _loading(boxes, faults)
    sizes, poses = np.array([box.size for box in boxes]), np.array([box.pose for box in boxes])
    masses = [box.mass or 0.0 for box in boxes]
    limits = [box.limit for box in boxes]
    ground = [n for n, box in enumerate(boxes) if box.fixed]
    if not ground:
        size, pose = slab_below(sizes, poses)
        sizes, poses = np.vstack((sizes, size)), np.vstack((poses, pose))
        names, masses, limits = [*names, GROUND], [*masses, 0.0], [*limits, math.inf]
        stack, order = [*stack, 0], order and [*order, 0]
        ground = [len(boxes)]
    return Plan(sizes, poses, masses if weighed else None, ground=ground, names=names,
                limits=limits, order=order, stack=stack, faults=faults)


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
    size: list[float]
    pose: list[float]
    mass: float | None
    limit: float
    fixed: bool
    order: float | None


def _box(row: Row, number: int, faults: list[Fault]) -> _Box | None:
    """Return what a row says, or None; add what is wrong with it to the faults."""
    name = str(row.get('name', f'row {number}'))
    place = '' if name == f'row {number}' else f'row {number}: '
    turn = TURN if any(key in row for key in TURN) else ()
    for kind, keys in ('dimension', EXTENTS), ('pose', PLACE + turn):
        values = [_number(row.get(key)) for key in keys]
        text = next((f'{key} is {short_repr(row[key]) if key in row else "missing"}'
                     for key, value in zip(keys, values) if math.isnan(value)), '')
        if kind == 'dimension':
            size, text = values, text or size_fault(values) or ''
        else:
            pose = values if turn else [*values, *UNTURNED]
            text = text or pose_fault(pose) or ''
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
    return _Box(name, size, pose, amounts[0], math.inf if amounts[1] is None else amounts[1], fixed,
                None if row.get('order') is None else _number(row['order']))


def _number(value: Any) -> float:
    """Return a number, or one that a text has; NaN for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float | str) or '_' in str(value):
        return math.nan
    try:
        return float(value)
    except (ValueError, OverflowError):
        return math.nan

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The forms in which packers write a plan: the columns or keys of each, its unit and its origin.

A form is known by its whole header, or by the keys of its JSON.
"""
from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from ..solver.checks import short_repr
from .plan import Fault

EXTENTS, PLACE, TURN = ('length', 'width', 'height'), ('x', 'y', 'z'), ('qx', 'qy', 'qz', 'qw')
LEAST, GREATEST = ('x_min', 'y_min', 'z_min'), ('x_max', 'y_max', 'z_max')
SIZES = (EXTENTS, ('lx', 'ly', 'lz'), ('dx', 'dy', 'dz'), GREATEST)
"""What the columns of a box's size may be called; with the last, two corners tell it."""
PLACES = (PLACE, LEAST)
"""What the columns of a box's place may be called: its centre, its least corner."""
ORIGINS = ('centre', 'corner')
UNITS = {'m': 1.0, 'cm': 1e-2, 'mm': 1e-3}


class Given(NamedTuple):
    """What the caller tells of a packing plan, where the file does not."""

    origin: str | None = None
    """One of ORIGINS: what `x y z` are."""
    unit: str | None = None
    """One of UNITS."""
    container: Sequence[float] | None = None
    """(3,) inner size, in the unit of the file."""


NOTHING = Given()


@dataclass(frozen=True)
class Form:
    """A form of a packer.

    Raises ValueError for a header and keys that are not as many.
    """

    title: str
    unit: str | None
    """One of UNITS; None: the form has none."""
    header: tuple[str, ...] = ()
    """Of a table, in lower case."""
    keys: tuple[str, ...] = ()
    """What each column is called by us; '': it is not read."""
    repeats: bool = True
    """Whether a name is that of a kind of box, so that the row's number tells boxes apart."""
    in_line: bool = False
    """Whether a container begins where the one before it ends, along x."""
    note: str = ''
    """What a reader may take otherwise."""


def _table(title: str, unit: str | None, header: str, keys: str, **more: Any) -> Form:
    return Form(title, unit, tuple(header.lower().split(',')), tuple(keys.split(',')), **more)


CORNERS = 'x_min,y_min,z_min,x_max,y_max,z_max'
ENDS = 'X origin,Y origin,Z origin,X extremity,Y extremity,Z extremity'
TABLES = (
    _table('a solution of packingsolver', None,
           'TYPE,ID,COPIES,BIN,X,Y,Z,LX,LY,LZ,ROTATION',
           'type,name,,stack,x_min,y_min,z_min,lx,ly,lz,'),
    _table('a solution of packingsolver', None,
           'TYPE,ID,COPIES,BIN,STACK,X,Y,Z,LX,LY,LZ,GROUP_ID',
           'type,name,,stack,,x_min,y_min,z_min,lx,ly,lz,'),
    _table('items of the ROADEF challenge 2022', 'mm',
           f'Item ident,Id truck,Id stack,Item code,{ENDS}', f',stack,,name,{CORNERS}',
           repeats=False),
    _table('stacks of the ROADEF challenge 2022', 'mm',
           f'Id truck,Id stack,Stack code,{ENDS}', f'stack,,name,{CORNERS}', repeats=False),
    _table("a solution of D-Wave's 3d-bin-packing", None,
           "case_id,bin_location,orientation,x,y,z,x',y',z'",
           'name,stack,,x_min,y_min,z_min,lx,ly,lz', in_line=True))
"""Of CSV files and tables of text, each by its whole header."""
OWN = Form('', 'm')
BED_BPP = Form('orders of BED-BPP', 'mm')
VIEWER = Form('containers of 3d-bin-container-packing', 'mm')
BENCHMARK = Form('a pallet of palletizing-benchmark', 'm')
PY3DBP = Form('what py3dbp packed', None, note=', and z, the depth, is up')
ROTATIONS = dict(enumerate(((0, 1, 2), (1, 0, 2), (1, 2, 0), (2, 1, 0), (2, 0, 1), (0, 2, 1))))
"""Which of width, height and depth are along x, y and z, by py3dbp's `rotation_type`."""
AMOUNT = re.compile(
    '.*(mass|weight|gewicht|poids|peso|limit|capacity|strength|payload|traglast|auflast).*|'
    'kgs?|kilos?|kilograms?|lbs?|kn|tons?|tonnes?|gross|net|tare|brutto|'
    'netto|vgm|max|maximum|stackable|maxload')
"""Words in the names of columns that may mean a mass or a limit."""
Row = Mapping[str, Any]


class Item(NamedTuple):
    """A row of a file: its number from 1, the container or order it is in, and what it says."""

    number: int
    stack: str
    row: Any


@dataclass
class Packing:
    """What a file says, by our keys and in its own unit."""

    form: Form
    items: Iterable[Item]
    rooms: dict[str, Sequence[Any]] = field(default_factory=dict)
    """The inner size of each container (3,)."""
    most: dict[str, Any] = field(default_factory=dict)
    """The most that may be in each container [kg]."""
    faults: list[Fault] = field(default_factory=list)


def table_form(header: Sequence[str]) -> Form | None:
    """Return the form that has this header, or None."""
    columns = tuple(' '.join(name.split()).lower() for name in header)
    return next((form for form in TABLES if form.header == columns), None)


def table_packing(form: Form, rows: Iterable[tuple[int, Row]]) -> Packing:
    """Return what a table of a form says; rows: numbered, by the form's keys."""
    packing = Packing(form, [])
    items = []
    for number, row in rows:
        values = dict(row)
        stack, kind = str(values.pop('stack', '')), str(values.pop('type', 'ITEM')).upper()
        if kind == 'BIN':
            packing.rooms[stack] = [values.get(key) for key in ('lx', 'ly', 'lz')]
        elif kind == 'ITEM':
            label = (stack, values.get('name'), number if form.repeats else None)
            items.append(Item(number, stack, {**values, 'name': '/'.join(
                str(part) for part in label if part is not None)}))
        elif kind != 'STACK':  # which is the box around items
            packing.faults.append(Fault('shape', (f'row {number}',), f'{kind}: not read'))
    packing.items = items
    return packing


def document_packing(document: Any) -> Packing | None:
    """Return what a JSON document of a known packer says, or None if it has another form."""
    readers: tuple[Callable[[Any], Packing | None], ...] = (
        _benchmark, _viewer, _bed_bpp, _py3dbp, _py3dbp_answer)
    return next(filter(None, (read(document) for read in readers)), None)


def _lists(document: Any, key: str, *within: str) -> bool:
    """Return whether a key has a list of objects, each with some keys."""
    return isinstance(document, Mapping) and isinstance(document.get(key), list) and all(
        isinstance(entry, Mapping) and entry.keys() >= {*within} for entry in document[key])


def _items(stack: str, entries: Iterable[Any], read: Callable[[Any], Row], *,
           numbered: bool = False) -> Iterator[Item]:
    """Yield what is read of entries. Raises ValueError for one that lacks a key.

    numbered: whether names are those of kinds of boxes, so that a number tells boxes apart.
    """
    for n, entry in enumerate(entries, 1):
        try:
            row = read(entry)
        except (LookupError, TypeError, AttributeError) as error:
            raise ValueError(f'{stack or "boxes"}, entry {n}: it lacks {error}') from None
        parts = [*([stack] if stack else []), row['name'] or n, *([n] if numbered else [])]
        yield Item(n, stack, {**row, 'name': '/'.join(map(str, parts))})


def _amounts(goods: Row, *read: str) -> Row:
    """Return what may mean a mass or a limit and is not read."""
    return {key: value for key, value in goods.items() if key not in read and means_amount(key)}


def _benchmark(document: Any) -> Packing | None:
    if not (_lists(document, 'boxes', 'position', 'dimensions') and 'kind' in document):
        return None
    if document['kind'] != 'placed':
        raise ValueError(f'its kind is {short_repr(document["kind"])}: the boxes have no place')

    def read(entry: Any) -> Row:
        return {'name': f'{entry["sku_id"]}/{entry["id"]}', 'mass': entry['weight'],
                **dict(zip(EXTENTS, map(entry['dimensions'].__getitem__, sides))),
                **dict(zip(PLACE, map(entry['position'].__getitem__, PLACE))),
                **_amounts(entry, 'weight'), **_amounts(container)}
    sides = ('width', 'depth', 'height')
    container = document.get('container')
    container = container if isinstance(container, Mapping) else {}
    packing = Packing(BENCHMARK, list(_items('', document['boxes'], read)))
    if container:
        packing.rooms[''] = [container.get(side) for side in sides]
    return packing


def _viewer(document: Any) -> Packing | None:
    if not _lists(document, 'containers'):
        return None

    def read(entry: Any) -> Row:
        goods = entry['stackable']
        return {'name': goods.get('name'), **{key: goods[key] for key in ('dx', 'dy', 'dz')},
                **dict(zip(LEAST, map(entry.__getitem__, PLACE))), **_amounts(goods),
                **_amounts(container)}
    items: list[Item] = []
    packing = Packing(VIEWER, items)
    for container in document['containers']:
        stack = str(container.get('name'))
        if not _lists(container.get('stack'), 'placements'):
            raise ValueError(f'container {stack}: it lacks a stack with placements')
        items += _items(stack, container['stack']['placements'], read, numbered=True)
        if 'loadDx' in container:
            packing.rooms[stack] = [container.get(key) for key in ('loadDx', 'loadDy', 'loadDz')]
    return packing


def _bed_bpp(document: Any) -> Packing | None:
    if not (isinstance(document, Mapping) and document and all(
            _lists(document, name, 'flb_coordinates') and document[name] for name in document)):
        return None

    def read(entry: Any) -> Row:
        item = entry['item']
        extents = [item[f'{side}/mm'] for side in EXTENTS]
        if entry['orientation'] == 1:
            extents[:2] = extents[1::-1]
        return {'name': item['sequence'], 'mass': item['weight/kg'], **dict(zip(EXTENTS, extents)),
                **dict(zip(LEAST, entry['flb_coordinates'])), **_amounts(item, 'weight/kg')}
    return Packing(BED_BPP, [item for name, order in document.items()
                             for item in _items(name, order, read)])


def _py3dbp(document: Any) -> Packing | None:
    """Read the attributes of its bins and their items."""
    bins = document.get('bins', [document]) if isinstance(document, Mapping) else document
    sides = ('width', 'height', 'depth')
    if not _lists({'bins': bins}, 'bins', 'items', *sides) or not all(
            _lists(one, 'items', 'position', 'rotation_type') for one in bins):
        return None

    def read(entry: Any) -> Row:
        extents = [entry[side] for side in sides]
        return {'name': entry.get('partno') or entry['name'], 'mass': entry['weight'],
                **dict(zip(LEAST, entry['position'])), **dict(zip(EXTENTS, map(
                    extents.__getitem__, ROTATIONS[entry['rotation_type']]))),
                **_amounts(entry, 'weight'), **_amounts(one, 'max_weight')}
    items: list[Item] = []
    packing = Packing(PY3DBP, items)
    for one in bins:
        stack = str(one.get('partno') or one.get('name'))
        items += _items(stack, one['items'], read, numbered=True)
        packing.rooms[stack] = [one[side] for side in sides]
        if 'max_weight' in one:
            packing.most[stack] = one['max_weight']
        packing.faults += _unfitted(one.get('unfitted_items'))
    return packing


def _py3dbp_answer(document: Any) -> Packing | None:
    """Read the answer of its web service, where a place is a corner and half of a size, floored."""
    answer: Any = document.get('data', document) if isinstance(document, Mapping) else None
    if not (_lists(answer, 'box', 'WHD') and _lists(answer, 'fitItem', 'WHD', 'position')):
        return None

    def read(entry: Any) -> Row:
        return {'name': entry['partNumber'], 'mass': entry['weight'],
                **dict(zip(EXTENTS, entry['WHD'])), **dict(zip(LEAST, (
                    place - side // 2 for place, side in zip(entry['position'], entry['WHD'])))),
                **_amounts(entry, 'weight')}
    packing = Packing(PY3DBP, list(_items('', answer['fitItem'], read)),
                      faults=list(_unfitted(answer.get('unfitItem'))))
    for box in answer['box'][:1]:
        packing.rooms[''] = box['WHD']
        if 'weight' in box:
            packing.most[''] = box['weight']
    return packing


def _unfitted(entries: Any) -> Iterator[Fault]:
    names = tuple(str(entry.get('partno') or entry.get('partNumber') or entry.get('name'))
                  for entry in (entries if isinstance(entries, list) else ())
                  if isinstance(entry, Mapping))
    if names:
        yield Fault('slot', names, 'not packed, as the file has it')


def means_amount(key: str) -> bool:
    """Return whether a name may mean a mass or a limit, such as gross_weight, kg or maxLoad."""
    words = re.findall('[a-zäöüß]+', re.sub('([a-z])([A-Z])', r'\1 \2', key).lower())
    return any(map(AMOUNT.fullmatch, words)) or words[-1:] == ['load']

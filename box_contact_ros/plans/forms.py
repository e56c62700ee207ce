# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The forms of packers whose axes or turns differ from those of other tables, as data.

A table is known by its whole header, one of JSON by columns that no other has.
"""
from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

from .roles import Taken
from .table import Table


@dataclass(frozen=True)
class Form:
    """A form of a packer."""

    title: str
    header: tuple[str, ...]  # all columns of a CSV file in lower case, or some of a JSON document
    taken: Taken
    unit: str | None = None  # one of UNITS; None: the form has none
    turned: tuple[str, Mapping[int, tuple[int, ...]]] = ('', {})
    """A column, and which of the sizes are along x y z by its number."""
    above: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Keys of what is just above: `room`, and `most`, the greatest mass in it [kg]."""
    kinds: str = ''  # the column that tells items from bins and stacks
    frames: str = 'own'
    in_line: bool = False  # whether a container begins where the one before it ends, along x


def _csv(title: str, header: str, unit: str | None, taken: Taken, **more: object) -> Form:
    return Form(title, tuple(header.lower().split(',')), replace(taken, is_corner=True), unit,
                **more)  # type: ignore[arg-type]


XYZ, LENGTHS = ('x', 'y', 'z'), ('lx', 'ly', 'lz')
ENDS = tuple(f'{axis} {end}' for end in ('origin', 'extremity') for axis in XYZ)
SOLVER = Taken(LENGTHS, True, XYZ, single={'name': 'id', 'container': 'bin', 'count': 'copies'},
               quiet=frozenset(('type', 'rotation', 'stack', 'group_id')))
TRUCKS = Taken((), True, ENDS, quiet=frozenset(('item ident', 'id stack')))
FORMS = (
    _csv('a solution of packingsolver', 'TYPE,ID,COPIES,BIN,X,Y,Z,LX,LY,LZ,ROTATION', None, SOLVER,
         kinds='type'),
    _csv('a solution of packingsolver', 'TYPE,ID,COPIES,BIN,STACK,X,Y,Z,LX,LY,LZ,GROUP_ID', None,
         SOLVER, kinds='type'),
    _csv('items of the ROADEF challenge 2022',
         f'Item ident,Id truck,Id stack,Item code,{",".join(ENDS)}', 'mm',
         replace(TRUCKS, single={'name': 'item code', 'container': 'id truck'})),
    _csv('stacks of the ROADEF challenge 2022', f'Id truck,Id stack,Stack code,{",".join(ENDS)}',
         'mm', replace(TRUCKS, single={'name': 'stack code', 'container': 'id truck'})),
    _csv("a solution of D-Wave's 3d-bin-packing",
         "case_id,bin_location,orientation,x,y,z,x',y',z'", None,
         Taken(("x'", "y'", "z'"), True, XYZ, quiet=frozenset(('orientation',)),
               single={'name': 'case_id', 'container': 'bin_location'}), frames='one',
         in_line=True),
    Form('orders of BED-BPP', ('flb_coordinates.2', 'orientation', 'item.length/mm'), Taken(
        ('item.length/mm', 'item.width/mm', 'item.height/mm'), True,
        ('flb_coordinates.0', 'flb_coordinates.1', 'flb_coordinates.2'), True,
        single={'name': 'item.sequence', 'mass': 'item.weight/kg'},
        quiet=frozenset(('item.product_group', 'item.article', 'item.id'))), 'mm',
         ('orientation', {0: (0, 1, 2), 1: (1, 0, 2)})),
    Form('what py3dbp packed, whose depth is up',
         ('position.2', 'rotation_type', 'width', 'height', 'depth'), Taken(
             ('width', 'height', 'depth'), True, ('position.0', 'position.1', 'position.2'), True,
             single={'name': 'name', 'mass': 'weight'}), None,
         ('rotation_type', dict(enumerate(((0, 1, 2), (1, 0, 2), (1, 2, 0), (2, 1, 0), (2, 0, 1),
                                           (0, 2, 1))))),
         {'room': ('width', 'height', 'depth'), 'most': ('max_weight',)}))


def form_of(table: Table) -> Form | None:
    """Return the form of a table, with the names as the table has them, or None."""
    columns = [' '.join(name.split()).lower() for name in table.columns]
    for form in FORMS:
        if form.header == tuple(columns):
            return _renamed(form, dict(zip(columns, table.columns)), table)
        if {*form.header} <= {*table.columns} and not {*form.header} & {*table.above}:
            names = {name: name for name in table.columns}
            if 'partno' in names:
                names['name'] = 'partno'
            return _renamed(form, names, table)
    return None


def is_header(cells: list[str]) -> bool:
    """Return whether these cells are the header of a form."""
    return tuple(' '.join(cell.split()).lower() for cell in cells) in {
        form.header for form in FORMS}


def _renamed(form: Form, names: Mapping[str, str], table: Table) -> Form:
    """Return a form with columns as a table has them, and without those that it has not."""
    near = {key: name for name, (path, key) in table.above.items()
            if path == table.records[0].rows.above[-1][0]} if table.above else {}
    above = {what: tuple(near[key] for key in keys) for what, keys in form.above.items()
             if all(key in near for key in keys)}
    taken = form.taken
    single = {role: names[name] for role, name in taken.single.items() if name in names}
    return replace(
        form, above=above, kinds=names.get(form.kinds, ''), turned=(
            names.get(form.turned[0], ''), form.turned[1]), taken=replace(
            taken, size=tuple(map(names.__getitem__, taken.size)),
            place=tuple(map(names.__getitem__, taken.place)), single=single,
            room=above.get('room', ()), quiet=frozenset(
                (*(names[name] for name in taken.quiet if name in names), *above.get('most', ()),
                 names.get(form.turned[0], '')))))

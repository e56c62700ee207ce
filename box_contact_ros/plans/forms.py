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
    header: tuple[str, ...]  # all columns of a CSV file, or some of a JSON document
    taken: Taken
    unit: str | None = None  # one of UNITS; None: the form has none
    turned: tuple[str, Mapping[int, tuple[int, ...]]] = ('', {})
    """A column, and which of the sizes are along x y z by its number."""
    above: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Keys of what is just above: `room`, and `most`, the greatest mass in it [kg]."""
    kinds: str = ''  # the column that tells items from bins and stacks
    frames: str = 'own'
    in_line: bool = False  # whether a container begins where the one before it ends, along x


XYZ = ('x', 'y', 'z')
ENDS = tuple(f'{axis} {end}' for end in ('origin', 'extremity') for axis in 'XYZ')
SOLVER = Taken(('LX', 'LY', 'LZ'), True, ('X', 'Y', 'Z'), True,
               single={'name': 'ID', 'container': 'BIN', 'count': 'COPIES'},
               quiet=frozenset(('TYPE', 'ROTATION', 'STACK', 'GROUP_ID')))
TRUCKS = Taken((), True, ENDS, True, quiet=frozenset(('Item ident', 'Id stack')))
FORMS = (
    Form('a solution of packingsolver',
         tuple('TYPE,ID,COPIES,BIN,X,Y,Z,LX,LY,LZ,ROTATION'.split(',')), SOLVER, kinds='TYPE'),
    Form('a solution of packingsolver',
         tuple('TYPE,ID,COPIES,BIN,STACK,X,Y,Z,LX,LY,LZ,GROUP_ID'.split(',')), SOLVER,
         kinds='TYPE'),
    Form('items of the ROADEF challenge 2022',
         ('Item ident', 'Id truck', 'Id stack', 'Item code', *ENDS),
         replace(TRUCKS, single={'name': 'Item code', 'container': 'Id truck'}), 'mm'),
    Form('stacks of the ROADEF challenge 2022', ('Id truck', 'Id stack', 'Stack code', *ENDS),
         replace(TRUCKS, single={'name': 'Stack code', 'container': 'Id truck'}), 'mm'),
    Form("a solution of D-Wave's 3d-bin-packing",
         tuple("case_id,bin_location,orientation,x,y,z,x',y',z'".split(',')),
         Taken(("x'", "y'", "z'"), True, XYZ, True, quiet=frozenset(('orientation',)),
               single={'name': 'case_id', 'container': 'bin_location'}), frames='one',
         in_line=True),
    Form('orders of BED-BPP', ('flb_coordinates.2', 'orientation', 'item.length/mm'), Taken(
        ('item.length/mm', 'item.width/mm', 'item.height/mm'), True,
        ('flb_coordinates.0', 'flb_coordinates.1', 'flb_coordinates.2'), True,
        single={'name': 'item.sequence', 'mass': 'item.weight/kg'}, quiet=frozenset(
            ('item.product_group', 'item.article', 'item.id', 'orientation'))), 'mm',
         ('orientation', {0: (0, 1, 2), 1: (1, 0, 2)})),
    Form('what py3dbp packed, whose depth is up',
         ('position.2', 'rotation_type', 'width', 'height', 'depth'), Taken(
             ('width', 'height', 'depth'), True, ('position.0', 'position.1', 'position.2'), True,
             single={'name': 'name', 'mass': 'weight'}, quiet=frozenset(('rotation_type',))), None,
         ('rotation_type', dict(enumerate(((0, 1, 2), (1, 0, 2), (1, 2, 0), (2, 1, 0), (2, 0, 1),
                                           (0, 2, 1))))),
         {'room': ('width', 'height', 'depth'), 'most': ('max_weight',)}))


def form_of(table: Table) -> Form | None:
    """Return the form of a table, of JSON with what is there and above it, or None."""
    form = next((form for form in FORMS if form.header == table.columns or (
        {*form.header} <= {*table.columns} and not {*form.header} & {*table.above})), None)
    if form is None or form.header == table.columns:
        return form
    single = {role: name for role, name in form.taken.single.items() if name in table.columns}
    if 'partno' in table.columns:
        single['name'] = 'partno'
    near = {key: name for name, (path, key) in table.above.items()
            if path == table.records[0].rows.above[-1][0]}
    above = {what: tuple(near[key] for key in keys) for what, keys in form.above.items()
             if all(key in near for key in keys)}
    return replace(form, above=above, taken=replace(
        form.taken, single=single, room=above.get('room', ()),
        quiet=form.taken.quiet | {*above.get('most', ())}))

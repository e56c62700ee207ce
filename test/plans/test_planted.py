# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Columns planted in tables: never "sound" where who knows what they mean sees more.

Each plan is sound without the planted column. What it means is judged as a Plan of its own, which
has been through no file. BOX_CONTACT_PLANTED=10000 makes so many files.
"""
from __future__ import annotations

import json
import math
import os
import random
from collections import Counter
from pathlib import Path

import pytest

from box_contact_ros import Plan, inspect_plan
from box_contact_ros.plans import inspect_files

pytest.importorskip('clarabel')

COUNT = int(os.environ.get('BOX_CONTACT_PLANTED', '150'))
FOREIGN = ('foo', 'rotation', 'theta', 'heading', 'rz', 'Tragkraft', 'crush', 'ECT', 'Reibung',
           'Reihenfolge', 'placed at', 'Palette', 'destination', 'Stück', 'n', 'a.b', 'tall',
           'item.value', 'load', 'x2', 'dz2', 'ρ', 'class', 'status')
"""Names outside of the table."""
KNOWN = {'turn': ('yaw', 'Yaw (deg)', 'yaw_rad', 'rotation.yaw', 'yaw°'),
         'limit': ('limit', 'max_load', 'maxLoadOnTop', 'stack-limit_kg', 'limit_lb'),
         'order': ('order', 'sequence', 'seq', 'loading order', 'step'),
         'container': ('pallet', 'bin', 'container_id', 'Truck'),
         'count': ('quantity', 'qty', 'pcs', 'copies'),
         'friction': ('friction', 'mu', 'friction coefficient'),
         'height': ('height 2',), 'mass': ('mass', 'weight_kg', 'gross (lb)')}
UNITS = {'lb': 0.45359237, 'rad': 180 / math.pi}


def base(draw):
    """Return columns of one or two boxes on others, in millimetres, all alike and sound."""
    size = (600, 400, 300)
    columns, rows = draw.choice((1, 2)), draw.choice((1, 2))
    layers = draw.choice((2, 3))
    return [(size, (x * 600 + 300, y * 400 + 200, z * 300 + 150)) for z in range(layers)
            for x in range(columns) for y in range(rows)]


def planted(draw, role, count):
    """Return what each box has of a role: alike in all rows, or not, or mostly nothing."""
    values = {'turn': (90, 45, 180, 30, -90, 1, 0), 'limit': (1, 5, 12, 40, 1e6),
              'count': (1, 2, 4),
              'order': (1, 2, 3, 4, 5, 6, 7), 'container': (1, 2, 'A'), 'mass': (1, 10, 30, 500),
              'friction': (0.1, 0.25, 0.6), 'height': (300, 310, 600)}[role]
    kind = draw.choice(('alike', 'some', 'each', 'empty'))
    if kind == 'alike':
        return [draw.choice(values)] * count
    if kind == 'empty':
        return [None] * count
    some = [draw.choice(values) for _ in range(count)]
    if role in ('turn', 'limit') and kind == 'some':
        some[draw.randrange(count)] = None
    return some


def truth(boxes, role, values):
    """Return the verdict of who knows what the values mean."""
    known = {}
    sizes, places, masses = [], [], []
    for (size, place), value in zip(boxes, values):
        size = (*size[:2], value if role == 'height' and value else size[2])
        sizes.append([side / 1e3 for side in size])
        half = math.radians(value) / 2 if role == 'turn' and value else 0.0
        shift = 20.0 * (value == 2 or value == 'A') if role == 'container' else 0.0
        places.append((place[0] / 1e3 + shift, place[1] / 1e3, place[2] / 1e3
                       + (size[2] - 300) / 2e3, 0, 0, math.sin(half), math.cos(half)))
        masses.append(value if role == 'mass' and value else 10.0)
    if role == 'count' and any(value not in (None, 1) for value in values):
        return 'not sound'
    sizes.append([60, 60, 1])
    places.append((0, 0, -.5, 0, 0, 0, 1))
    if role == 'order' and all(values):
        known['order'] = [*values, 0]
    if role == 'container':  # the second one is where nothing carries it
        known['stack'] = [0] * (len(boxes) + 1)
    if role in ('limit', 'mass'):
        of = values if role == 'limit' else [25] * len(boxes)
        known['limits'] = [math.inf if value is None else value for value in of] + [math.inf]
    if role == 'friction':
        known['friction'] = [math.nan if value is None else value for value in values] + [math.nan]
    plan = Plan(sizes, places, [*masses, 0], ground=len(boxes), **known)
    return inspect_plan(plan, acceleration=(2.0, 0, -9.81) if role == 'friction' else
                        (0, 0, -9.81)).verdict


def told(value, name, role):
    """Return a value in the unit of a column's name."""
    if value is None or isinstance(value, str):
        return value
    unit = next((unit for unit in UNITS if unit in name), '')
    return value / UNITS[unit] if unit and role in ('turn', 'limit', 'mass') else value


def document(draw, boxes, role, name, values):
    """Return the name and the text of a file with a planted column."""
    mirror = draw.choice((1, 1, -1))
    rows = []
    for n, ((size, place), value) in enumerate(zip(boxes, values)):
        row = {'id': n, **dict(zip(('l_mm', 'w_mm', 'h_mm'), size)),
               **dict(zip(('x_mm', 'y_mm', 'z_mm'), (mirror * place[0], *place[1:])))}
        row |= {'mass': 10} if role != 'mass' else {'limit': 25}
        cell = told(value, name, role)
        rows.append(row | {name: -cell if mirror < 0 and role == 'turn' and cell else cell})
    kind = draw.choice((',', ';', 'json', 'nested'))
    if kind == 'json':
        return 'p.json', json.dumps({'plan': {'id': 1, 'goods': rows}})
    if kind == 'nested':
        return 'p.json', json.dumps([{'at': {}, **row} for row in rows])
    text = '\n'.join(kind.join('' if cell is None else str(cell).replace(
        '.', ',' if kind == ';' else '.') for cell in line)
        for line in ([*rows[0]], *(row.values() for row in rows)))
    return 'p.csv', text + '\n'


@pytest.mark.parametrize('role', KNOWN)
def test_planted(role: str, tmp_path: Path, capsys) -> None:
    """By a name of the table the verdict is the true one; by another one it is never "sound"."""
    draw = random.Random(role)
    seen: Counter[tuple[bool, str, int]] = Counter()
    for n in range(COUNT // len(KNOWN)):
        boxes = base(draw)
        values = planted(draw, role, len(boxes))
        is_known = draw.random() < 0.5 and role != 'height'
        name = draw.choice(KNOWN[role] if is_known else FOREIGN)
        if name in ('yaw', 'rotation.yaw') and not any(abs(value or 0) > 7 for value in values):
            name = 'yaw_deg'
        verdict = truth(boxes, role, values)
        path = tmp_path / (file := document(draw, boxes, role, name, values))[0]
        path.write_text(file[1], 'utf-8')
        options = ['--acceleration', '2', '0', '-9.81'] if role == 'friction' else []
        status = inspect_files.main([str(path), *options])
        printed = ''.join(capsys.readouterr())
        seen[is_known, verdict, status] += 1
        assert status in (0, 1, 2, 3) and 'Traceback' not in printed
        assert status != 0 or verdict == 'sound', (n, role, name, values, file[1], printed)
        if is_known and role not in ('count', 'container') and None not in values and (
                'lb' not in name):  # beside a mass without a unit it is refused
            assert status == {'sound': 0, 'not sound': 1}[verdict], (n, name, values, file, printed)
    assert any(verdict == 'not sound' for _, verdict, _ in seen)

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Packers' own forms, read as they are: places, overlaps and shares equal those of integers."""
from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_read_plan import document, sheet, written

from box_contact_ros.plans import inspect_files
from box_contact_ros.plans.inspect_plan import inspect_plan
from box_contact_ros.plans.packing import read_packing
from box_contact_ros.plans.read_plan import read_any, read_plan
from box_contact_ros.plans.roles import Given
from box_contact_ros.plans.table import read_tables

BOXES = [(0, 0, 0, 60, 40, 30), (60, 0, 0, 60, 40, 30), (30, 0, 30, 60, 40, 20),
         (0, 35, 0, 60, 40, 30), (95, 0, 30, 40, 40, 20), (40, 10, 50, 30, 30, 25)]
"""Least corners and sizes: the first and the fourth overlap, the fifth is beyond the container."""
CONTAINER = (130, 80, 100)


def packingsolver(stacks: bool) -> str:
    """Return a solution, as it writes boxes or stacks of boxes."""
    label, end = (',{n}', '0') if stacks else ('', 'XYZ')
    lines = [f'TYPE,ID,COPIES,BIN{",STACK" * stacks},X,Y,Z,LX,LY,LZ,'
             f'{"GROUP_ID" if stacks else "ROTATION"}',
             f'BIN,0,1,0{",-1" * stacks},0,0,0,{CONTAINER[0]},{CONTAINER[1]},{CONTAINER[2]},']
    lines += ['STACK,0,1,0,0,0,0,0,60,40,30,'] * stacks
    return '\n'.join([*lines, *(f'ITEM,{n % 2},1,0{label.format(n=n)},'
                                f'{",".join(map(str, box))},{end}'
                                for n, box in enumerate(BOXES)), ''])


def roadef() -> str:
    """Return items of the ROADEF challenge 2022, as its checker has the header."""
    rows = [';'.join(map(str, ('0090_01', 'P18', f'P18_{n}', f'A{n}', x, y, f'{z} ', x + length,
                               y + width, z + height)))
            for n, (x, y, z, length, width, height) in enumerate(BOXES)]
    return '\n'.join(['Item ident;Id truck;Id stack;Item code;X origin;Y origin; Z origin; '
                      'X extremity; Y extremity; Z extremity', *rows, ''])


def dwave(bins: int = 1) -> str:
    """Return a table of D-Wave's example; each bin begins where the one before it ends."""
    rows = [f'{n % 3:>9}{bin_ + 1:>16}{1:>15}{x + bin_ * CONTAINER[0]:>5}' + ''.join(
        f'{value:>6}' for value in rest) for bin_ in range(bins)
        for n, (x, *rest) in enumerate(BOXES)]
    return '\n'.join([
        f'# Number of bins used: {bins}', '# Objective value: 10.4', '',
        "  case_id    bin_location    orientation    x    y    z    x'    y'    z'",
        '---------  --------------  -------------  ---  ---  ---  ----  ----  ----', *rows])


def py3dbp() -> str:
    """Return the attributes of a bin, with numbers as text, as decimals are often written."""
    items = [{'name': f'{n}', 'width': f'{height}', 'height': f'{length}', 'depth': f'{width}',
              'weight': '2.5', 'rotation_type': 2, 'position': [f'{x}', f'{y}', f'{z}.000']}
             for n, (x, y, z, length, width, height) in enumerate(BOXES)]
    sides = dict(zip(('width', 'height', 'depth'), CONTAINER))
    return json.dumps({'bins': [{'name': 'bin', **sides, 'items': items,
                                 'unfitted_items': [{'name': 'left'}]}]})


def benchmark(kind: str = 'placed') -> str:
    """Return a pallet of palletizing-benchmark."""
    sides = ('width', 'depth', 'height')
    return json.dumps({'order_id': '1', 'kind': kind, 'stats': {}, 'container': dict(zip(
        sides, CONTAINER)), 'boxes': [
            {'id': n, 'sku_id': 's', 'rotation': 0, 'weight': 2.5, 'position': dict(zip('xyz', (
                low + side / 2 for low, side in zip(box, box[3:])))),
             'dimensions': dict(zip(sides, box[3:]))} for n, box in enumerate(BOXES)]})


def viewer() -> str:
    """Return a container of the viewer of 3d-bin-container-packing."""
    keys = ('x', 'y', 'z', 'dx', 'dy', 'dz')
    placements = [{**dict(zip(keys[:3], box)), 'stackable': {
        'name': 'g', **dict(zip(keys[3:], box[3:])), 'type': 'box'}} for box in BOXES]
    return json.dumps({'containers': [{'name': '1', 'stack': {'placements': placements}, **dict(zip(
        ('loadDx', 'loadDy', 'loadDz'), CONTAINER))}]})


FORMS = {
    'packingsolver': ('a.csv', packingsolver(False), 'a solution of packingsolver', {}),
    'stacks of packingsolver': ('a.csv', packingsolver(True), 'a solution of packingsolver', {}),
    'ROADEF': ('a.csv', roadef(), 'items of the ROADEF challenge 2022', {}),
    'D-Wave': ('a.txt', dwave(), "a solution of D-Wave's 3d-bin-packing", {}),
    'py3dbp': ('a.json', py3dbp(), 'what py3dbp packed, whose depth is up', {}),
    'benchmark': ('a.json', benchmark(), '', {'origin': 'centre'}),
    'viewer': ('a.json', viewer(), '', {'origin': 'corner'}),
    'least corners': ('a.csv', '\n'.join(['name,x_min,y_min,z_min,lx,ly,lz', *(
        f'{n},{",".join(map(str, box))}' for n, box in enumerate(BOXES)), '']), '', {}),
    'two corners': ('a.csv', '\n'.join(['name;x_min;y_min;z_min;x_max;y_max;z_max', *(
        f'{n};' + ';'.join(f'{value:.1f}'.replace('.', ',') for value in (
            *box[:3], *(low + side for low, side in zip(box, box[3:]))))
        for n, box in enumerate(BOXES)), '']), '', {}),
}


def meets(axis: int, a: tuple[int, ...], b: tuple[int, ...]) -> int:
    """Return by how much two boxes overlap along an axis."""
    return min(a[axis] + a[axis + 3], b[axis] + b[axis + 3]) - max(a[axis], b[axis])


OVERLAPS = [[a, b] for a in range(6) for b in range(a + 1, 6)
            if min(meets(axis, BOXES[a], BOXES[b]) for axis in range(3)) > 0]
SHARES = [1.0 if box[2] == 0 else min(1.0, sum(  # two that overlap may carry one place
    max(0, meets(0, box, low)) * max(0, meets(1, box, low)) for low in BOXES
    if low[2] + low[5] == box[2]) / (box[3] * box[4])) for box in BOXES]


@pytest.mark.parametrize('unit', ['m', 'cm', 'mm'])
@pytest.mark.parametrize('form', FORMS)
def test_a_form_is_read_as_it_is(form: str, unit: str, tmp_path: Path) -> None:
    """And its overlaps, shares and what is outside are those of integers."""
    name, text, title, more = FORMS[form]
    given = Given(unit=unit, container=CONTAINER, **more)
    plan, bears, taken = read_any(written(tmp_path, name, text), given)
    assert taken.startswith(f'read as {title}: ' if title else 'read: ') and f'[{unit}]' in taken
    assert bears == 'faces'
    assert {fault.kind for fault in plan.faults if fault.verdict != 'sound'} <= {'part', 'column'}
    scale = {'m': 1.0, 'cm': 1e-2, 'mm': 1e-3}[unit]
    least = plan.poses[:6, :3] - plan.sizes[:6] / 2.0
    assert np.abs(np.hstack((least, plan.sizes[:6])) / scale - BOXES).max() < 1e-9
    found = inspect_plan(replace(plan, masses=None))
    assert OVERLAPS == [[0, 3]] and found.overlaps.tolist() == OVERLAPS
    assert found.depths == pytest.approx([5 * scale])
    assert found.share[:6] == pytest.approx(SHARES) and SHARES[4] == 0.625
    assert np.argwhere(found.outside).tolist() == [[4, 1, 0]]
    assert found.outside[4, 1, 0] == pytest.approx(5 * scale)
    assert plan.names[6:] == tuple(f'{plan.names[6].rpartition(" ")[0]} {end}' for end in (
        'floor', 'wall -x', 'wall +x', 'wall -y', 'wall +y'))


@pytest.mark.parametrize('form', FORMS)
def test_without_a_unit_it_is_asked(form: str, tmp_path: Path, capsys) -> None:
    """By one line, with options that can be typed; with them the plan is judged."""
    pytest.importorskip('clarabel')
    name, text, _, more = FORMS[form]
    path = str(written(tmp_path, name, text))
    if form == 'ROADEF':
        assert inspect_files.main([path]) == 1
        return
    given = [word for key, value in more.items() for word in (f'--{key}', value)]
    assert inspect_files.main([path, *given]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert '--unit ' in line
    assert inspect_files.main([path, *given, '--unit', 'cm']) == 1


def test_bins_in_a_line(tmp_path: Path) -> None:
    """D-Wave's x goes on from bin to bin; with a container each has its own."""
    path = written(tmp_path, 'a.txt', dwave(2))
    plan = read_plan(path, unit='mm')
    assert plan.poses[6:12, 0] - plan.poses[:6, 0] == pytest.approx(0.13)
    plan = read_plan(path, unit='mm', container=CONTAINER)
    assert plan.poses[6:12, 0] - plan.poses[:6, 0] == pytest.approx(1.135)
    found = inspect_plan(plan)
    assert np.argwhere(found.outside).tolist() == [[4, 1, 0], [10, 1, 0]]
    assert found.overlaps.tolist() == [[0, 3], [6, 9]] and plan.names[12] == '1 floor'


REFUSED = {
    'two ways': ('a.csv', sheet(more=',x_min,y_min,z_min'), {}, 'which is the place, x y z or x_min'
                 ' y_min z_min.*--ignore x_min --ignore y_min --ignore z_min'),
    'two sizes': ('a.csv', sheet(more=',lx,ly,lz'), {}, 'which is the size'),
    'a corner is missing': ('a.csv', 'name,x_min,z_min,lx,ly,lz\n', {}, 'which columns are the '
                            'least'),
    'a greatest corner alone': ('a.csv', 'name,x,y,z,x_max,y_max,z_max\n', {}, 'are the size'),
    'centres': ('a.csv', packingsolver(False), {'origin': 'centre'}, 'solver: least corners'),
    'centres of our own': (*FORMS['least corners'][:2], {'origin': 'centre'}, 'are corners'),
    'origin': ('a.csv', sheet(), {'origin': 'middle'}, 'origin must be one of centre, corner, not'),
    'unit': ('a.csv', sheet(), {'unit': 'inch'}, 'unit must be one of m, cm, mm, in, ft, not '),
    'container': ('a.csv', sheet('a,1,1,1,0,0,.5'), {'container': (1, 2)}, 'container must be'),
    'container in a file': ('a.json', '{"container": [1, 2, 0], ' + document()[1:], {},
                            r'three inner sizes above 0, not \[1, 2, 0\]'),
    'a bin twice': ('a.csv', packingsolver(False).replace('ITEM,', 'BIN,0,1,0,0,0,0,9,9,9,\nITEM,',
                                                            1),
                    {'unit': 'mm'}, 'the bin 0 comes twice'),
    'copies': ('a.csv', packingsolver(False).replace('ITEM,0,1', 'ITEM,0,2'), {'unit': 'mm'},
               "COPIES of 0 is '2': a row is one box"),
    'of a ship': ('a.edi', '', {'unit': 'mm'}, 'unit must not be given'),
    'decimal commas': ('a.csv', sheet('a,1,2,1,0,1,0,0,0,0,0,0,5'), {}, 'are commas decimal marks'),
}


@pytest.mark.parametrize('case', REFUSED)
def test_what_is_refused(case: str, tmp_path: Path) -> None:
    name, text, given, words = REFUSED[case]
    with pytest.raises(ValueError, match=words) as caught:
        read_plan(written(tmp_path, name, text), **given)
    assert '\n' not in str(caught.value)


ODD = [None, True, [], {}, 'x', '', -1, 0, 1e400, np.nan, [1, 2], {'a': 1}, '1,2', 10**400]


def test_odd_values_are_faults_or_refused() -> None:
    """Wherever they are in a document."""
    rng = np.random.default_rng(4)
    texts = [text for name, text, *_ in FORMS.values() if name == 'a.json']
    counts = [0, 0]
    for _ in range(3000):
        part = whole = [json.loads(texts[rng.integers(len(texts))])]
        while isinstance(part, list | dict) and part:
            holder, key = part, list(part if isinstance(part, dict) else range(len(part)))[
                rng.integers(len(part))]
            part = part[key]
            if rng.random() < 0.3:
                break
        holder[key] = ODD[rng.integers(len(ODD))]
        try:
            counts[0] += read_packing(read_tables(whole[0]), Given(unit='m')) is not None
        except ValueError:
            counts[1] += 1
    assert min(counts) > 100


def test_a_decimal_comma_in_a_number(tmp_path: Path) -> None:
    text = sheet('a,1,1,1,0,0,.5', 'b,"1,2",1,1,0,0,1.5')
    (fault,) = read_plan(written(tmp_path, 'a.csv', text)).faults
    assert fault.text == "row 2: length is '1,2'; the decimal mark is a point: left out"


def test_a_turned_box_has_no_least_corner(tmp_path: Path) -> None:
    turn = ','.join(map(str, (0, 0, math.sin(math.pi / 8), math.cos(math.pi / 8))))
    text = sheet('a,1,2,1,0,0,0,0,0,.5,.5', f'b,1,1,1,0,0,1,{turn}', more=',qx,qy,qz,qw')
    plan = read_plan(written(tmp_path, 'a.csv', text), origin='corner')
    assert [(fault.kind, *fault.names) for fault in plan.faults] == [('pose', 'b')]
    assert plan.poses[0, :3].tolist() == [1.0, .5, .5]  # a quarter of a turn has one


CORNER_HEADER = 'name,length,width,height,x_min,y_min,z_min'


def wall_of(*rows: str) -> str:
    """Return bricks, by their least corners."""
    return sheet('a,60,40,30,0,0,0', 'b,60,40,30,60,0,0', 'c,60,40,30,30,0,30', *rows)


@pytest.mark.parametrize(('text', 'options', 'status', 'words'), [
    (wall_of(), [], 2, ['--unit cm']),
    (wall_of(), ['--unit', 'cm'], 1, ['origin  ', '--origin corner']),
    (wall_of(), ['--origin', 'corner', '--unit', 'cm'], 0, []),
    (wall_of('d,60,40,30,30,0,31'), ['--unit', 'cm'], 1, ['origin  ']),  # most overlaps go
    (sheet('a,.6,.4,.3,.3,.2,.15', 'b,.6,.4,.3,.3,.2,.25'), [], 1, []),
    (sheet('a,.6,.4,.3,.3,.2,.15', 'b,.6,.4,.3,.3,.2,.45'), [], 0, []),
    (wall_of(), ['--origin', 'corner', '--unit', 'cm', '--container', '120', '40', '60'], 0, []),
    (wall_of(), ['--unit', 'cm', '--container', '120', '40', '60'], 1, ['origin  ', 'outside  ']),
    (wall_of(), ['--origin', 'corner', '--unit', 'cm', '--container', '119', '40', '58'], 1,
     ['outside               b  10.0 mm beyond +x', 'outside               c  20.0 mm beyond +z']),
    # A file in mm is not judged in metres: 0.05 mm is no gap.
    ('\n'.join((CORNER_HEADER, 'a,600,400,300,0,0,0', 'b,600,400,300,0,0,300.05', '')), [], 2,
     ['--unit mm']),
    ('\n'.join((CORNER_HEADER, 'a,600,400,300,0,0,0', 'b,600,400,300,0,0,300.5', '')),
     ['--unit', 'mm'], 1, ['tolerance  ', '--tolerance 0.001']),
    (sheet('a,.6,.4,.3,.3,.2,.15'), ['--container', '1200', '800', '1000'], 3, ['unit  ']),
    (sheet('a,600,400,300,300,200,150'), ['--unit', 'mm', '--container', '1.2', '.8', '1'], 1,
     ['unit  ', 'outside  ', 'origin  '])])
def test_what_seems_to_be_meant(text, options, status, words, tmp_path, capsys) -> None:
    """One line tells that places are corners, or sizes not in metres; what is told is believed."""
    pytest.importorskip('clarabel')
    assert inspect_files.main([str(written(tmp_path, 'a.csv', text)), *options]) == status
    lines = ''.join(capsys.readouterr())
    for word in ('origin  ', 'unit  ', 'outside  ', 'tolerance  ', *words):
        assert (word in lines) == any(word in one for one in words), lines


@pytest.mark.parametrize(('most', 'status', 'line'), [
    (10, 1, '24 kg are in it, and it may have 10 kg'), (24, 0, ''),
    ('much', 3, "whether it has more than 'much' kg is not judged")])
def test_what_a_bin_may_carry(most, status, line, tmp_path, capsys) -> None:
    """By py3dbp: a bin that is too heavy was sound."""
    pytest.importorskip('clarabel')
    goods = {'width': 60, 'height': 30, 'depth': 40, 'weight': 12, 'rotation_type': 0}
    document: dict[str, Any] = {'bins': [{
        'name': 'bin', 'width': 120, 'height': 80, 'depth': 90, 'max_weight': most, 'items': [
            {**goods, 'name': 'a', 'position': [0, 0, 0]},
            {**goods, 'name': 'b', 'position': [60, 0, 0]}]}]}
    path = written(tmp_path, 'a.json', json.dumps(document))
    assert inspect_files.main([str(path), '--unit', 'cm']) == status
    assert line in capsys.readouterr().out


def test_a_limit_without_masses_is_not_judged(tmp_path, capsys) -> None:
    pytest.importorskip('clarabel')
    item = {'name': 'a', 'width': 60, 'height': 30, 'depth': 40, 'weight': None,
            'rotation_type': 0, 'position': [0, 0, 0]}
    document = {'name': 'bin', 'width': 120, 'height': 80, 'depth': 90, 'max_weight': 10,
                'items': [item]}
    path = written(tmp_path, 'a.json', json.dumps(document))
    assert inspect_files.main([str(path), '--unit', 'cm']) == 3
    assert 'whether it has more than 10 kg is not judged' in capsys.readouterr().out


@pytest.mark.parametrize('document', [
    {'kind': 'placed', 'container': {'width': 1, 'depth': 1, 'height': 1, 'max_load': 5}, 'boxes': [
        {'id': 1, 'sku_id': 'a', 'weight': 9, 'dimensions': dict.fromkeys(
            ('width', 'depth', 'height'), .5), 'position': dict.fromkeys('xyz', .25)}]},
    {'containers': [{'name': 'c', 'maxLoadWeight': 5, 'stack': {'placements': [
        {'x': 0, 'y': 0, 'z': 0, 'stackable': {'name': 'a', 'dx': 9, 'dy': 9, 'dz': 9}}]}}]}])
def test_what_a_container_says_of_masses_is_named(document, tmp_path) -> None:
    """It was not read, without a word."""
    plan = read_plan(written(tmp_path, 'a.json', json.dumps(document)), unit='m', origin='corner')
    assert [fault.verdict for fault in plan.faults if fault.kind == 'column'] == ['not all judged']


# --- containers -----------------------------------------------------------------------------------


def test_a_load_leans_on_a_wall(tmp_path: Path) -> None:
    """A wall carries with sides and friction, and an overlap with it is told as outside alone."""
    pytest.importorskip('clarabel')
    low = {'name': 'low', 'lx': .3, 'ly': 1, 'lz': 1, 'x_min': 0, 'y_min': 0, 'z_min': 0,
           'mass': 50}
    high = {**low, 'name': 'high', 'lx': 1, 'z_min': 1, 'mass': 10}
    boxes = {'boxes': [low, high], 'container': [1, 1, 3]}
    plan = read_plan(written(tmp_path, 'a.json', json.dumps(boxes)))
    assert inspect_plan(plan).cause.tolist()[:2] == ['', 'unsupported']
    assert inspect_plan(plan, sides=True, friction=1.0).sound
    high['x_min'] = .012
    plan = read_plan(written(tmp_path, 'a.json', json.dumps(boxes)))
    found = inspect_plan(plan, sides=True)
    assert [str(row) for row in found.rows()][:1] == [
        'outside               high  12.0 mm beyond +x']
    assert not len(found.overlaps) and found.verdict == 'not sound'


@pytest.mark.parametrize(('changed', 'status', 'words'), [
    ({'orientation': '1'}, 1, 'overlap'), ({'orientation': 2}, 3, 'orientation is 2: left out'),
    ({'orientation': 0}, 0, 'sound'), ({'orientation': None}, 3, 'orientation is None: left out'),
    ({'orientation': 0, 'flb_coordinates': [150, 0, 0, 7]}, 3, 'flb_coordinates.3')])
def test_an_order_of_bed_bpp_that_is_odd(changed, status, words, tmp_path, capsys) -> None:
    """An orientation that was a text was not a turn, and a fourth coordinate was passed over."""
    pytest.importorskip('clarabel')
    goods = {'sequence': 1, 'weight/kg': 1, 'length/mm': 100, 'width/mm': 300, 'height/mm': 100}
    first = {'flb_coordinates': [0, 0, 0], 'orientation': 0, 'item': goods}
    second = {**first, 'flb_coordinates': [150, 0, 0], 'item': {**goods, 'sequence': 2}, **changed}
    third = {**first, 'flb_coordinates': [300, 0, 0], 'item': {**goods, 'sequence': 3}}
    path = written(tmp_path, 'a.json', json.dumps({'o': [first, second, third]}))
    assert inspect_files.main([str(path)]) == status
    assert words in capsys.readouterr().out

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Readers of plans: small files with a fault each, and what files of one plan have in common."""
from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from box_contact_ros.plans.inspect_plan import inspect_plan
from box_contact_ros.plans.plan import Plan
from box_contact_ros.plans.read_plan import read_any, read_plan
from box_contact_ros.solver.contacts_of import contacts_of

ROOT = Path(__file__).resolve().parents[2]
FILES = ROOT / 'docs' / 'examples' / 'files'


def baplie(*boxes: str, end: str = '', message: str = 'BAPLIE:D:95B:UN:SMDG22') -> str:
    """Return a plan; a box is a slot, a size type, and segments in between: '0010082 22G1 ...'."""
    lines = [f'UNH+1+{message}', 'BGM++1+9']
    for n, box in enumerate(boxes):
        slot, kind, *more = box.split()
        lines += [f'LOC+147+{slot}::5'] if slot != '-' else []
        lines += more or ['MEA+WT++KGM:20000']
        lines += [f'EQD+CN+TEST{n:07}+{kind}+++5'] if kind != '-' else []
    lines += [end or f'UNT+{len(lines) + 1}+1']
    return "'\n".join(['UNB+UNOA:2+A+B+261126:0900+1', *lines, 'UNZ+1+1']) + "'\n"


HEADER = 'name,length,width,height,x,y,z'
FLAT = 'a,1,1,1,0,0,0.5'


def sheet(*rows: str, more: str = '') -> str:
    """Return a CSV file, with more columns than those that are needed."""
    return '\n'.join([HEADER + more, *rows]) + '\n'


def document(**changed: object) -> str:
    """Return a JSON file of two boxes, of which the second has other values."""
    box = {'name': 'a', 'length': 1, 'width': 1, 'height': 1, 'x': 0, 'y': 0, 'z': 0.5}
    return json.dumps({'boxes': [box, {**box, 'name': 'b', 'z': 1.5, **changed}]})


PLACED = '0010082 22G1'
FAULTS = {
    # BAPLIE
    'gap': ('p.edi', baplie(PLACED, '0010086 22G1'),
            'gap', '0010086', 'no container below it down to tier 82'),
    'gap in the hold': ('p.edi', baplie('0010002 22G1', '0010008 22G1'), 'gap', '0010008',
                        'down to tier 02'),
    'gap to the deck': ('p.edi', baplie('0010086 22G1'), 'gap', '0010086', 'down to the deck'),
    'slot twice': ('p.edi', baplie(PLACED, PLACED), 'slot taken', '0010082',
                   'TEST0000001 has the slot'),
    'number twice': ('p.edi', baplie(PLACED, '0010084 22G1').replace('TEST0000001', 'TEST0000000'),
                     'twice', '0010084', 'TEST0000000 is at 0010082, too'),
    'slot of 6': ('p.edi', baplie(PLACED, '010082 22G1'), 'slot', '010082', 'of 6 characters'),
    'not stowed': ('p.edi', baplie(PLACED, '9999999 22G1'), 'slot', 'TEST0000001', 'not stowed'),
    'light': ('p.edi', baplie(PLACED, '0010084 22G1 MEA+WT++KGM:24.500'), 'weight', '0010084',
              '24.500 KGM, less than any container'),
    'on breakbulk': ('p.edi', baplie(PLACED, '0010084 22G1', '0010088 22G1').replace(
        'EQD+CN+TEST0000001', 'EQD+BB+TEST0000001'), 'held', '0010088', 'stands on what is left'),
    'slot of 8': ('p.edi', baplie(PLACED, '00010082 22G1'), 'slot', '00010082', 'of 8 characters'),
    'slot of signs': ('p.edi', baplie(PLACED, '00100$$ 22G1'), 'slot', '00100$$', '7 digits'),
    'no slot': ('p.edi', baplie(PLACED, '- 22G1'), 'slot', 'TEST0000001', 'without a slot'),
    'size type': ('p.edi', baplie(PLACED, '0010084 5EGB'), 'size type', '0010084', 'type 5EGB'),
    'height': ('p.edi', baplie(PLACED, '0010084 2ZG1'), 'size type', '0010084', 'type 2ZG1'),
    'no type': ('p.edi', baplie(PLACED, '0010084 -'), 'size type', '0010084', 'without a size'),
    'no weight': ('p.edi', baplie(PLACED, '0010084 22G1 RFF+BM:1'), 'mass', '0010084', 'no weight'),
    'negative weight': ('p.edi', baplie(PLACED, '0010084 22G1 MEA+WT++KGM:-5'), 'mass', '0010084',
                        'its weight is -5'),
    'unit': ('p.edi', baplie(PLACED, '0010084 22G1 MEA+WT++XYZ:5'), 'mass', '0010084', 'unit XYZ'),
    'too heavy': ('p.edi', baplie(PLACED, '0010084 22G1 MEA+WT++KGM:99999999'), 'weight', '0010084',
                  'more than any container'),
    'heavy': ('p.edi', baplie(PLACED, '0010084 22G1 MEA+VGM++KGM:215000'), 'weight', '0010084',
              '215000 KGM, more than any container'),
    'weight of 0': ('p.edi', baplie(PLACED, '0010084 22G1 MEA+VGM++KGM:0'), 'mass', '0010084',
                    'its weight is 0'),
    'over-height with an empty element': (
        'p.edi', baplie('0010082 22U1 MEA+WT++KGM:9000 DIM+9++CMT:::45'), 'goods', '0010082',
        '45 cm in height'),
    'over-height': ('p.edi', baplie('0010082 22U1 MEA+WT++KGM:9000 DIM+9+CMT:::79'), 'goods',
                    '0010082', '79 cm in height'),
    'over-width': ('p.edi', baplie('0010082 22P1 MEA+WT++KGM:9000 DIM+7+CMT::30'), 'goods',
                   '0010082', '30 cm on the right'),
    'end missing': ('p.edi', baplie(PLACED, end='RFF+BM:1'), 'cut', '', 'no UNT'),
    'cut': ('p.edi', baplie(PLACED, end='UNT+99+1'), 'cut', '', 'counts 99 segments, and there '
                                                                'are 6'),
    'cut in a message': ('p.edi', baplie(PLACED) + baplie('0010084 22G1').replace(
                             'UNT', 'TNU').replace('TEST0', 'TEST1'),
                         'cut', '', 'no UNT'),
    # CSV
    'size': ('p.csv', sheet(FLAT, 'b,1,-1,1,0,0,1.5'), 'dimension', 'b', '(1, -1, 1) is not '
                                                                         'positive'),
    'size in words': ('p.csv', sheet(FLAT, 'b,1,one,1,0,0,1.5'), 'dimension', 'b', "width is 'one"),
    'short row': ('p.csv', sheet(FLAT, 'b,1,1,1,0,0'), 'row', 'b', 'row 2 has 6 cells, and the '
                                                                   'header 7: left out'),
    'row without its end': ('p.csv', sheet(f'{FLAT},', 'b,1,1,1,0,0,1.5', more=',fixed'), 'cut',
                            'b', 'row 2 has 7 cells, and the header 8'),
    'long row': ('p.csv', sheet(FLAT, 'b,1,1,1,1,0,0,1.5,,'), 'row', 'row 2', 'has 8 cells'),
    'end of the file': ('p.csv', sheet(f'{FLAT},2', 'b,1,1,1,0,0,1', more=',mass').strip(), 'row',
                        'row 2', 'left out'),
    'quote': ('p.csv', sheet('"a', 'b,1,1,1,0,0,9', '",1,1,1,0,0,.5'), 'cut',
              'row 1', 'goes on over 1 lines'),
    'colour': ('p.csv', sheet(f'{FLAT},red', more=',Colour'), 'ignored', 'Colour', 'not read'),
    'a number': ('p.csv', sheet(f'{FLAT},3', more=',crush'), 'column', 'crush', '--ignore crush'),
    'all one': ('p.csv', sheet(f'{FLAT},1', more=',Tragkraft'), 'column', 'Tragkraft', 'not read'),
    'a number in words': ('p.csv', sheet(f'{FLAT},90°', more=',turn'), 'column', 'turn',
                          'not read'),
    'words that differ': ('p.csv', sheet(f'{FLAT},up', 'b,1,1,1,0,0,1.5,', more=',way'), 'column',
                          'way', 'not read'),
    'words alike': ('p.csv', sheet(f'{FLAT},up', 'b,1,1,1,0,0,1.5,up', more=',way'), 'ignored',
                    'way', 'not read'),
    'no name of a column': ('p.csv', sheet(f'{FLAT},3,', more=',,fixed'), 'column', 'column 8',
                            'not read'),
    'place': ('p.csv', sheet(FLAT, 'b,1,1,1,nan,0,1.5'), 'pose', 'b', "x is 'nan'"),
    'far away': ('p.csv', sheet(FLAT, 'b,1,1,1,1e300,0,1.5'), 'pose', 'b', 'exceeds'),
    'no turn': ('p.csv', sheet('a,1,1,1,0,0,.5,0,0,0,1', 'b,1,1,1,0,0,1.5,0,0,0,0',
                               more=',qx,qy,qz,qw'), 'pose', 'b', 'zero length'),
    'half a turn': ('p.csv', sheet('a,1,1,1,0,0,.5,0,0,0,1', 'b,1,1,1,0,0,1.5,0,0,1,',
                                   more=',qx,qy,qz,qw'), 'pose', 'b', 'qw is missing'),
    'mass': ('p.csv', sheet(f'{FLAT},2', 'b,1,1,1,0,0,1.5,-2', more=',mass'), 'mass', 'b',
             "mass is '-2'"),
    'mass missing': ('p.csv', sheet(f'{FLAT},2', 'b,1,1,1,0,0,1.5,', more=',mass'), 'mass', 'b',
                     'no mass'),
    'limit': ('p.csv', sheet(f'{FLAT},x', more=',limit'), 'limit', 'a', "limit is 'x'"),
    'fixed': ('p.csv', sheet(f'{FLAT},', 'b,1,1,1,0,0,1.5,perhaps', more=',fixed'), 'pose', 'b',
              "fixed is 'perhaps'"),
    'no name': ('p.csv', sheet(FLAT, ',1,1,0,0,0,1.5'), 'dimension', 'row 2', '(1, 1, 0)'),
    'digits with _': ('p.csv', sheet(FLAT, 'b,1_0,1,1,0,0,1.5'), 'dimension', 'b', "'1_0'"),
    # JSON
    'text': ('p.json', document(width='wide'), 'dimension', 'b', "width is 'wide'"),
    'true': ('p.json', document(width=True), 'dimension', 'b', 'width is True'),
    'null': ('p.json', document(x=None), 'pose', 'b', 'x is missing'),
    'NaN': ('p.json', document(x=float('nan')), 'pose', 'b', 'x is nan'),
    'huge': ('p.json', document(length=10**400), 'dimension', 'b', 'length is 1000'),
    'key': ('p.json', document(colour='red'), 'ignored', 'colour', 'not read'),
    'a number by another key': ('p.json', document(strength=3), 'column', 'strength', '--column'),
    'boxes in a key': ('p.json', document(parts=[{'name': 'c'}]), 'part', 'boxes.parts',
                       'may have boxes'),
    'key beside boxes': ('p.json', '{"by": "me", ' + document()[1:], 'ignored', 'by', 'not read'),
    'a number beside boxes': ('p.json', '{"most": 7, ' + document()[1:], 'column', 'most',
                              'not read'),
    'order with a limit': ('p.json', json.dumps({'1': [{'item': {
        'length/mm': 1, 'width/mm': 1, 'height/mm': 1, 'sequence': 1, 'weight/kg': 1,
        'max_load/kg': 1}, 'flb_coordinates': [0, 0, 0], 'orientation': 0}]}), 'column',
        'item.max_load/kg', 'not read'),
    'no row': ('p.json', '{"boxes": [7, ' + document()[11:], 'dimension', 'row 1', 'missing'),
}


def written(folder: Path, name: str, text: str) -> Path:
    """Return the path of a file with a text."""
    path = folder / name
    path.write_text(text, 'utf-8')
    return path


@pytest.mark.parametrize('case', FAULTS)
def test_a_fault_is_a_row(case: str, tmp_path: Path) -> None:
    """And the only one of its kind; the rest is read."""
    name, text, kind, names, words = FAULTS[case]
    plan = read_plan(written(tmp_path, name, text))
    rows = [fault for fault in plan.faults if words in fault.text]
    assert [(fault.kind, '  '.join(fault.names)) for fault in rows] == [(kind, names)], plan.faults
    assert {fault.kind for fault in plan.faults} - {'slot'} == {kind} - {'slot'}


REFUSED = {
    'nothing': ('p.edi', baplie(), 'it has no container'),
    'other message': ('p.edi', baplie(PLACED, message='COPRAR:D:95B'), 'its message is COPRAR; a '
                      'stowage plan is BAPLIE or MOVINS'),
    'no slot is known': ('p.edi', baplie('00010082 22G1'), 'no container can be placed; slot 0001'
                         '0082'),
    'no size is known': ('p.edi', baplie('0010082 5EGB'), 'size type 0010082: of the type 5EGB'),
    'empty': ('p.csv', '\n', 'it is empty'),
    'column': ('p.csv', sheet(FLAT).replace('height', 'hight'), 'which columns are the size'),
    'no rows': ('p.csv', sheet(), 'it has no box'),
    'no good row': ('p.csv', sheet('a,1,1,0,0,0,0'), r'no box can be placed: row 1: \(1, 1, 0\)'),
    'open quote': ('p.csv', sheet(f'{FLAT},"19 inch', 'b,1,1,1,0,0,9,', more=',note'),
                   'line 3: it is not CSV: unexpected end of data'),
    'quote within a cell': ('p.csv', sheet(f'{FLAT},"a', 'b,1,1,1,0,0,9,"b"', more=',note'),
                            'line 3: it is not CSV'),
    'column twice': ('p.csv', sheet(f'{FLAT},7', more=',Z'), 'line 1: the column z comes twice'),
    'key twice': ('p.json', document().replace('"z": 1.5', '"z": 7, "z": 1.5'),
                  "the key 'z' comes twice"),
    'other columns': ('p.csv', 'a,b\n', 'which columns are the size .*; which columns are the '
                      'least corner'),
    'prose': ('p.txt', 'Dear all,\n', "line 1: 'dear all,' begins no format"),
    'JSON': ('p.json', '{"boxes": [\n{]', 'line 2: it is not JSON'),
    'other JSON': ('p.json', '{"a": 1}', 'it is JSON, but has no list of boxes'),
    'a world': ('p.sdf', '<sdf version="1.9"/>', 'a world or a model of a simulator'),
    'a model': ('p.xml', '<mujoco/>', 'a world or a model of a simulator'),
    'a scene': ('p.yaml', 'boxes: 7\n', "'boxes: 7' begins no format"),
    'deep JSON': ('p.json', '[' * 10**5, 'nested too deeply'),
    'order': ('p.json', '{"1": [{"item": {}, "flb_coordinates": [0, 0, 0]}]}', 'the size'),
}


@pytest.mark.parametrize('case', REFUSED)
def test_a_file_that_is_no_plan_is_refused(case: str, tmp_path: Path) -> None:
    """By one line, which names the file."""
    name, text, words = REFUSED[case]
    path = written(tmp_path, name, text)
    with pytest.raises(ValueError, match=words) as caught:
        read_plan(path)
    assert str(caught.value).startswith(f'{path}: ') and '\n' not in str(caught.value)


def same(a: Plan, b: Plan) -> bool:
    """Whether two plans are equal."""
    return (a.names == b.names and a.faults == b.faults and all(np.array_equal(x, y) for x, y in (
        (a.sizes, b.sizes), (a.poses, b.poses), (a.masses, b.masses), (a.ground, b.ground))))


SHIP = (FILES / 'ship.edi').read_text('utf-8')


def equipment_first(text: str) -> str:
    """Return a plan as BAPLIE 3 has it."""
    out: list[str] = []
    for line in text.split('\n'):
        if line.startswith('EQD'):
            place = max(n for n, other in enumerate(out) if other.startswith('LOC+147'))
            out.insert(place, line)
        else:
            out.append(line)
    return '\n'.join(out).replace('MEA+WT++', 'MEA+AAE+VGM+')


@pytest.mark.parametrize('changed', [
    SHIP.replace('\n', ''), SHIP.replace('\n', '\r\n'), SHIP.replace('+', '+\n'),
    SHIP.replace('00', '0\n0'), '\ufeff' + SHIP, f"UNA:+.? '{SHIP}",
    'UNA|*,! ~' + SHIP.replace(':', '|').replace('+', '*').replace("'", '~'),
    SHIP.replace('BGM++1', "BGM+?'LOC?+147+1"), equipment_first(SHIP),
    SHIP.replace('KGM:24000', 'TNE:24'), SHIP.replace('KGM:24000', 'KG:24000'),
    SHIP.replace('KGM:24000', 'T:24'), SHIP.replace('WT++KGM:24000', 'VGM++KGM:24000'),
    SHIP.replace('UNT+30', 'UNT+000030'), SHIP.replace('22G1+', '22G1:102:5+')])
def test_the_same_ship(changed: str, tmp_path: Path) -> None:
    """However its lines are wrapped, and its segments separated and ordered."""
    assert changed != SHIP
    assert same(read_plan(written(tmp_path, 'a', changed)), read_plan(FILES / 'ship.edi'))


def test_the_weighed_mass_counts(tmp_path: Path) -> None:
    text = baplie('0010082 22G1 MEA+WT++KGM:1 MEA+VGM++KGM:2', '0010084 22G1 MEA+WT++LBR:1')
    assert read_plan(written(tmp_path, 'a', text)).masses[:2].tolist() == [2.0, 0.45359237]


@pytest.mark.parametrize(('weights', 'mass'), [
    ('MEA+VGM++KGM MEA+WT++KGM:20000', 2e4), ('MEA+WT++KGM:20000 MEA+VGM++KGM', 2e4),
    ('MEA+VGM++KGM:0 MEA+WT++KGM:20000', 2e4), ('MEA+WT++KGM:20000 MEA+VGM++KGM:0.0', 2e4),
    ('MEA+VGM++KGM: MEA+VGM++KGM:9000', 9e3), ('MEA+WT++KGM:20000 MEA+VGM++KGM:9000', 9e3),
    ('MEA+VGM++KGM:9000 MEA+WT++KGM:20000', 9e3), ('MEA+VGM++KGM', 0), ('MEA+WT++KGM:x', 0)])
def test_an_empty_weight_hides_no_other(weights: str, mass: float, tmp_path: Path) -> None:
    """A ship lost 1,382 of 12,449 t by VGM without a number; the text KGM was a mass."""
    plan = read_plan(written(tmp_path, 'a', baplie(f'0010082 22G1 {weights}')))
    assert plan.masses[0] == mass
    assert [fault.kind for fault in plan.faults] == (['mass'] if not mass else [])


def test_stowage_instructions_have_the_same_segments(tmp_path: Path) -> None:
    text = baplie(PLACED, message='MOVINS:D:95B:UN:SMDG20')
    plan = read_plan(written(tmp_path, 'b', baplie(PLACED)))
    assert same(read_plan(written(tmp_path, 'a', text)), plan)


@pytest.mark.parametrize(('kind', 'size'), [
    ('22G1', (6.058, 2.438, 2.591)), ('45R1', (12.192, 2.438, 2.896)),
    ('44G1', (12.192, 2.438, 2.743)), ('4432', (12.192, 2.438, 2.896)),
    ('9500', (13.716, 2.438, 2.896)), ('L5G1', (13.716, 2.438, 2.896)),
    ('4EG1', (12.192, 2.5, 2.896)), ('2232', (6.058, 2.438, 2.591)),
    ('4351', (12.192, 2.438, 2.591))])
def test_size_types(kind: str, size: tuple[float, ...], tmp_path: Path) -> None:
    """Four digits are a type of 1984: then 4 was all above 8 ft 6 in."""
    plan = read_plan(written(tmp_path, 'a', baplie(f'0020082 {kind}')))
    assert tuple(plan.sizes[0]) == size and not plan.faults


def test_a_40_ft_over_the_20_ft_of_its_tier_overlaps(tmp_path: Path) -> None:
    plan = read_plan(written(tmp_path, 'a', baplie('0020082 42G1', '0010082 22G1')))
    pairs, contacts = contacts_of(plan.sizes[:2], plan.poses[:2])
    assert len(pairs) == 1 and contacts.separation[0] == pytest.approx(-2.438)


def test_bays_by_majority(tmp_path: Path) -> None:
    """40 ft bays 4k stand on the 20 ft bays beside them, as those of 4k + 2 do."""
    for first in (1, 3):
        bays = [f'{first + 4 * k:03}' for k in range(3)]
        boxes = [box for bay in bays for box in (
            f'{bay}0082 22G1', f'{int(bay) + 2:03}0082 22G1', f'{int(bay) + 1:03}0084 42G1')]
        plan = read_plan(written(tmp_path, 'a', baplie(*boxes)))
        pairs, contacts = contacts_of(plan.sizes[:9], plan.poses[:9], tolerance=1e-4)
        assert len(pairs) == 6 and np.abs(contacts.separation).max() < 1e-9


def test_the_deck_is_above_the_hold(tmp_path: Path) -> None:
    boxes = [f'00100{tier:02} 25G1' for tier in range(2, 26, 2)] + ['0010082 22G1']
    plan = read_plan(written(tmp_path, 'a', baplie(*boxes)))
    assert contacts_of(plan.sizes, plan.poses)[1].separation.min() > -1e-9
    assert plan.poses[12, 2] > 12 * 2.896 + 1.0


def test_a_stack_on_deck_may_begin_a_tier_higher_than_another(tmp_path: Path) -> None:
    """Ships have steps there; it is told."""
    boxes = ['0010182 22G1', '0010384 22G1', '0010586 22G1']
    faults = read_plan(written(tmp_path, 'a', baplie(*boxes))).faults
    assert [(fault.kind, *fault.names) for fault in faults] == [('base', '0010384'),
                                                                ('base', '0010586')]
    assert not read_plan(written(tmp_path, 'a', baplie('0010184 22G1', '0010384 22G1'))).faults


def test_containers_bear_at_their_corners() -> None:
    assert [read_any(FILES / name).bears for name in ('ship.edi', 'pallet.csv')] == [
        'corners', 'faces']


def test_rows_with_semicolons(tmp_path: Path) -> None:
    """As spreadsheets write them where a comma is the decimal mark."""
    text = sheet(f'{FLAT},2.5', more=',mass').replace(',', ';').replace('.', ',')
    plan = read_plan(written(tmp_path, 'a.csv', text))
    assert plan.masses.tolist() == [2.5, 0.0] and plan.poses[0, 2] == 0.5


def test_the_ground_of_rows(tmp_path: Path) -> None:
    """It is z = 0, unless a row is fixed."""
    plan = read_plan(written(tmp_path, 'a.csv', sheet(FLAT)))
    assert plan.names == ('a', 'ground') and plan.ground.tolist() == [1]
    assert plan.poses[1, 2] + plan.sizes[1, 2] / 2.0 == 0.0 and plan.masses is None
    plan = read_plan(written(tmp_path, 'a.csv', sheet(f'{FLAT},yes', more=',fixed')))
    assert plan.names == ('a',) and plan.ground.tolist() == [0]


def test_pallets() -> None:
    """Five orders beside each other; an order of its own is as long as its goods."""
    plan = read_plan(ROOT / 'docs/examples/pallets/packing_plans.json')
    assert len(plan) == 190 and plan.names[0] == '00100408/1' and not plan.faults
    pairs, contacts = contacts_of(plan.sizes[:-1], plan.poses[:-1])
    orders = [name.split('/')[0] for name in plan.names]
    assert all(orders[a] == orders[b] for a, b in pairs) and contacts.separation.min() > -1e-9
    assert plan.masses[:3] == pytest.approx([6.296, 6.78, 6.78])


def test_loads_of_a_container(tmp_path: Path) -> None:
    """As the viewer of 3d-bin-container-packing has them, in millimetres."""
    goods = [{'x': 100, 'y': 0, 'z': z, 'stackable': {'name': 'g', 'dx': 500, 'dy': 200, 'dz': 100}}
             for z in (0, 100)]
    text = json.dumps({'containers': [{'name': '1', 'stack': {'placements': goods}}]})
    plan = read_plan(written(tmp_path, 'a.json', text), unit='mm', origin='corner')
    assert plan.poses[:2, :3] == pytest.approx(np.array([[.35, .1, .05], [.35, .1, .15]]))
    assert plan.names[:2] == ('g/1', 'g/2')


def test_an_order_is_that_of_all_boxes_or_not_read(tmp_path: Path) -> None:
    """Fixed boxes need none. Orders of BED-BPP are stacks of their own, and have no numbers."""
    rows = ('a,1,1,1,0,0,0.5,2,', 'b,1,1,1,0,0,1.5,1,', 'g,9,9,1,0,0,-0.5,,yes')
    plan = read_plan(written(tmp_path, 'a.csv', sheet(*rows, more=',order,fixed')))
    assert plan.order.tolist() == [2, 1, 0] and not plan.faults
    for value in '', 'x', '1.5', '1e300':
        text = sheet(rows[0], f'b,1,1,1,0,0,1.5,{value},', more=',order,fixed')
        plan = read_plan(written(tmp_path, 'a.csv', text))
        assert plan.order is None and [fault.names for fault in plan.faults] == [('b',)]
        assert inspect_plan(plan).summary().endswith('but 1 has no place in the order')
    plan = read_plan(ROOT / 'docs/examples/pallets/packing_plans.json')
    stack = [name.split('/')[0] for name in plan.names[:-1]]
    assert plan.order is None and len({*zip(stack, plan.stack.tolist())}) == len({*stack}) == 5


def test_the_schema(tmp_path: Path) -> None:
    """What the schema takes is read without a fault, and what it refuses has one."""
    jsonschema = pytest.importorskip('jsonschema')
    schema = json.loads((ROOT / 'msg_schemas/plan.json').read_text('utf-8'))
    jsonschema.Draft202012Validator.check_schema(schema)
    box = json.loads(document())['boxes'][0]
    for way, good in (({'x_min': -.5, 'y_min': -.5, 'z_min': 0}, False), ({'lx': 1}, True),
                      ({'lx': 1, 'ly': 1, 'lz': 1}, False)):
        text = json.dumps({'boxes': [{**box, **way}], 'container': [1, 1, 1]})
        assert jsonschema.Draft202012Validator(schema).is_valid(json.loads(text)) == good
        if not good:
            with pytest.raises(ValueError, match='which is the '):
                read_plan(written(tmp_path, 'a.json', text))
    for changed, good in (({}, True), ({'mass': 3.5, 'limit': 0, 'fixed': True}, True),
                          ({'qx': 0, 'qy': 0, 'qz': 1, 'qw': 0}, True), ({'length': 0}, False),
                          ({'z': '1'}, False), ({'qx': 1}, False), ({'mass': -1}, False),
                          ({'order': 1.5}, False)):
        text = document(**changed)
        faults = read_plan(written(tmp_path, 'a.json', text)).faults
        assert jsonschema.Draft202012Validator(schema).is_valid(json.loads(text)) == good
        assert good or faults or changed == {'z': '1'}


def test_slots_of_six_digits(tmp_path: Path) -> None:
    """BBRRTT, where all have six; blanks around a slot are none of it."""
    six = baplie('010082 22G1', '010084 22G1', '030082 22G1')
    seven = baplie('0010082 22G1', '0010084 22G1', '0030082 22G1')
    assert same(read_plan(written(tmp_path, 'a', six)), read_plan(written(tmp_path, 'b', seven)))
    blank = seven.replace('+0010084:', '+ 0010084 :')
    assert same(read_plan(written(tmp_path, 'a', blank)), read_plan(written(tmp_path, 'b', seven)))


def test_there_is_no_bay_0(tmp_path: Path) -> None:
    plan = read_plan(written(tmp_path, 'a', baplie('0000082 22G1', '0010082 22G1')))
    assert [(fault.kind, fault.names) for fault in plan.faults] == [('slot', ('0000082',))]


@pytest.mark.parametrize(('boxes', 'left_out', 'names'), [
    (['0010082 22G1', '0010084 22G1'], [0], ['0010084']),
    (['0010082 22G1', '0030082 22G1', '0020084 42G1'], [0], ['0020084']),
    (['0010082 22G1', '0010084 22G1', '0010086 22G1'], [1], ['0010086']),
    (['0010182 22G1', '0010082 22G1', '0010084 22G1'], [0], []),
    (['0010082 22G1', '0030082 22G1', '0010084 22G1'], [1], [])])
def test_what_stands_on_what_is_left_out_is_not_judged(boxes, left_out, names, tmp_path) -> None:
    """Be it breakbulk, or of a size that is not known."""
    for text in (
            re.sub('|'.join(f'EQD.CN.TEST000000{n}' for n in left_out), 'EQD+BB+X', baplie(*boxes)),
            baplie(*(f'{box.split()[0]} ZZZZ' if n in left_out else box
                     for n, box in enumerate(boxes)))):
        plan, bears, _ = read_any(written(tmp_path, 'a.edi', text))
        assert [fault.names for fault in plan.faults if 'stands on' in fault.text] == (
            [tuple(names)] if names else [])
        assert inspect_plan(plan, bears=bears).verdict == 'not all judged'

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The roles of columns: forms as users write them, turns, units, what is asked, containers."""
from __future__ import annotations

import json
import math
import shlex

import numpy as np
import pytest
from test_read_plan import sheet, written

from box_contact_ros import inspect_plan, read_plan
from box_contact_ros.plans import inspect_files
from box_contact_ros.plans.roles import HARMLESS, LINES, NEUTRAL, RIVALS, ROLE_OF, word_of
from box_contact_ros.plans.table import read_csv

BOXES = [(0, 0, 0, 600, 400, 300), (600, 0, 0, 600, 400, 300), (300, 0, 300, 600, 400, 200)]
"""Least corners and sizes of three boxes, of which the last is on both others [mm]."""


def rows(*names, make=lambda n, box: (n, *box), delimiter=','):
    """Return a CSV file of the boxes, with these columns."""
    return '\n'.join(delimiter.join(map(str, row)) for row in (
        names, *(make(n, box) for n, box in enumerate(BOXES)))) + '\n'


def in_bin(bins):
    """Return what is around the boxes."""
    return json.dumps({'solution': {'bins': bins}})


def item(n, box):
    return {'id': n, **dict(zip('xyz', box)), **dict(zip(('width', 'depth', 'height'), box[3:]))}


def centred(n, box):
    return n, *(low + side / 2 for low, side in zip(box, box[3:])), *box[3:]


def aside(n, box, axes, unit=1):
    """Return the centre of a box that is 70 mm further along y, with its axes in this order."""
    centre = dict(zip('xyz', np.array(centred(n, box)[1:4]) + (0, 70, 0)))
    return [float(centre[axis]) / unit for axis in axes]


def corners(n, box):
    return *box[:3], *(low + side for low, side in zip(box, box[3:])), n


def records(make):
    return json.dumps({'plan': {'id': 7, 'goods': [make(n, box) for n, box in enumerate(BOXES)]}})


FORMS = {
    'id and l w h': (rows('id', 'x', 'y', 'z', 'l', 'w', 'h', make=centred), '--unit mm'),
    'sku and width depth height': (
        rows('SKU', 'x_mm', 'y_mm', 'z_mm', 'Width', 'Depth', 'Height', make=centred), ''),
    'no name': (rows('x (mm)', 'y (mm)', 'z (mm)', 'length (mm)', 'width (mm)', 'height (mm)',
                     make=lambda n, box: centred(n, box)[1:]), ''),
    'pos': (rows('id', 'pos_x', 'pos_y', 'pos_z', 'length_mm', 'width_mm', 'height_mm'),
            '--origin corner'),
    'posX': (rows('id', 'posX', 'posY', 'posZ', 'lengthMm', 'widthMm', 'heightMm'),
             '--origin corner'),
    'two corners': (rows('x1', 'y1', 'z1', 'x2', 'y2', 'z2', 'label', make=corners), '--unit mm'),
    'semicolons': (rows('id', 'x1', 'y1', 'z1', 'x2', 'y2', 'z2', make=lambda n, box: (
        n, *(f'{value / 10:.1f}'.replace('.', ',') for value in corners(n, box)[:6])),
        delimiter=';'), '--unit cm'),
    'a list': (json.dumps([{'sku': 'a', **dict(zip(('x_min', 'y_min', 'z_min', 'lx', 'ly', 'lz'),
                                                   box))} for box in BOXES]), '--unit mm'),
    'keys': (records(lambda n, box: {'ref': n, 'pos': dict(zip('xyz', box)), 'dim': dict(zip(
        ('l', 'w', 'h'), box[3:]))}), '--unit mm --origin corner'),
    'places': (records(lambda n, box: {'position': box[:3], 'size': box[3:]}),
               '--unit mm --origin corner'),
    'other keys': (records(lambda n, box: {'at': dict(zip(('a', 'b', 'c'), box)), 'size': box[3:]}),
                   '--column x_min=at.a --column y_min=at.b --column z_min=at.c --unit mm'),
    'item': (records(lambda n, box: {'item': {'id': n, 'length/mm': box[3], 'width/mm': box[4],
                                              'height/mm': box[5]}, 'corner': box[:3]}), ''),
    'pounds': (rows('name', 'x_min', 'y_min', 'z_min', 'lx_in', 'ly_in', 'lz_in', 'weight_lb',
                    make=lambda n, box: (n, *(value / 25.4 for value in box), 10)), ''),
    'sides': (rows('carton_id', 'left_cm', 'front_cm', 'bottom_cm', 'length_cm', 'width_cm',
                   'height_cm', make=lambda n, box: (n, *(value / 10 for value in box))),
              '--column x_min=left_cm --column y_min=front_cm --column z_min=bottom_cm'),
    'a bin': (in_bin([{'bin_id': 3, 'width': 1200, 'depth': 800, 'height': 1000, 'items': [
        item(n, box) for n, box in enumerate(BOXES)]}]), '--unit mm --origin corner'),
    'a unit': (json.dumps({'units': 'mm', 'boxes': [{'sku': 'x', 'corner': box[:3],
                                                     'extent': box[3:]} for box in BOXES]}), ''),
    'in German': (rows('Artikel', 'X', 'Y', 'Z', 'Länge', 'Breite', 'Höhe'),
                  '--unit mm --origin corner'),
    'y is up': (rows('id', 'x', 'y', 'z', 'l', 'w', 'h', make=lambda n, box: (
        n, *aside(n, box, 'xzy'), *box[3:])), '--unit mm --up y'),
    'y is up in metres': (rows('name', 'x', 'y', 'z', 'length', 'width', 'height', make=(
        lambda n, box: (n, *aside(n, box, 'xzy', 1e3), *np.array(box[3:]) / 1e3))), '--up y'),
    'y is up of least corners': (rows('name', 'x', 'y', 'z', 'length', 'width', 'height', make=(
        lambda n, box: (n, *np.array(box)[[0, 2, 1, 3, 4, 5]] / 1e3))), '--origin corner --up y'),
    'width height depth': (rows('id', 'x', 'y', 'z', 'w', 'h', 'd', make=lambda n, box: (
        n, *aside(n, box, 'xzy'), *np.array(box)[[3, 5, 4]])), '--unit mm --up y'),
    'sizes of the file, y is up': (records(lambda n, box: {
        'id': n, 'centre': aside(n, box, 'xzy'), 'size': [box[3], box[5], box[4]]}),
        '--unit mm --up y'),
    'x is up': (rows('id', 'cx', 'cy', 'cz', 'dx', 'dy', 'dz', make=lambda n, box: (
        n, *aside(n, box, 'zxy'), box[5], box[3], box[4])), '--unit mm --up x'),
    'ends': (rows('id', 'start_x', 'start_y', 'start_z', 'end_x', 'end_y', 'end_z',
                  make=lambda n, box: (n, *corners(n, box)[:6])), '--unit mm'),
}


@pytest.mark.parametrize('name', FORMS)
def test_a_form_is_read_with_what_the_message_prints(name, tmp_path, capsys):
    """At most once."""
    text, wanted = FORMS[name]
    path = str(written(tmp_path, 'a.json' if text[0] in '{[' else 'a.csv', text))
    options = []
    if wanted:
        assert inspect_files.main([path]) == 2
        message = capsys.readouterr().err
        options = shlex.split(message.partition('if it is so, add ')[2])
        assert {*options} == {*shlex.split(wanted)}
    assert inspect_files.main([path, *options]) == 0, capsys.readouterr().out
    given = dict(zip(options[::2], options[1::2]))
    plan = read_plan(path, origin=given.get('--origin'), unit=given.get('--unit'),
                     up=given.get('--up'), columns=dict(
                         word.split('=', 1) for word in options if '=' in word))
    least = 1e3 * (plan.poses[:3, :3] - plan.sizes[:3] / 2)
    least[:, 1] -= least[0, 1]
    assert np.abs(np.hstack((least, 1e3 * plan.sizes[:3])) - BOXES).max() < 1e-6
    assert name != 'pounds' or plan.masses[:3] == pytest.approx(4.5359237)


LAYER = ('a,1,1,1,.5,.5,.5', 'b,1,1,1,1.5,.5,.5', 'c,1,1,1,.5,1.5,.5', 'd,1,1,1,1.5,1.5,.5')


@pytest.mark.parametrize(('cells', 'options', 'status'), [
    (LAYER, [], 0),  # by y it would be a wall
    ((*LAYER[:3], 'd,1,1,1,1.5,1.5,2'), [], 1), (('a,1,1,1,.5,.5,3',), [], 1),
    (('a,1,1,1,3,.5,.7', 'b,1,1,1,3,1.5,.7'), ['--up', 'z'], 1),
    (('a,1,1,1,3,.5,.7', 'b,1,1,1,3,1.5,.7'), ['--up', 'y'], 0),
    (('a,1,1,1,3,.5,.7', 'b,1,1,1,3,1.5,.7'), [], 2),
    (('a,1,1,1,3,.5,3', 'b,1,1,1,4,.5,4'), [], 1)])
def test_the_axis_that_is_up_is_asked_only_where_most_stand_by_another(
        cells, options, status, tmp_path, capsys):
    """A layer on the floor, one box that hangs among others or alone, a row and a pile along y."""
    assert inspect_files.main([str(written(tmp_path, 'a.csv', sheet(*cells))), *options]) == status
    assert ('add --up y' in capsys.readouterr().err) == (status == 2)


def pile(rng):
    """Return least corners and sizes (n, 6) of boxes in columns, without a gap or with some."""
    boxes, x = [], rng.choice((0, 0.4))
    for width in rng.uniform(0.3, 0.9, rng.integers(1, 5)):
        y = rng.choice((0, 0.3))
        for depth in rng.uniform(0.3, 0.9, rng.integers(1, 4)):
            heights = rng.uniform(0.1, 0.6, rng.integers(1, 5))
            boxes += [(x, y, top - height, width, depth, height)
                      for top, height in zip(heights.cumsum(), heights)]
            y += depth
        x += width
    return np.array(boxes)


@pytest.mark.parametrize('is_corner', [False, True])
def test_piles_with_y_up_are_asked_and_others_are_read(is_corner, tmp_path):
    """All that are sound with z up are read; of those with y up some are sound by both readings."""
    place, answers = 'x_min,y_min,z_min' if is_corner else 'x,y,z', []
    for seed in range(100):
        boxes = pile(np.random.default_rng(seed))
        boxes[:, :3] += 0 if is_corner else boxes[:, 3:] / 2
        for order in ([0, 1, 2], [0, 2, 1]):
            rows = np.hstack((boxes[:, order], boxes[:, 3:][:, order])).round(6).tolist()
            path = written(tmp_path, 'a.csv', '\n'.join((f'name,{place},lx,ly,lz', *(
                ','.join(map(str, (n, *row))) for n, row in enumerate(rows)), '')))
            try:
                answers.append(inspect_plan(read_plan(path)).verdict)
            except ValueError as error:
                answers.append(str(error).rpartition('add ')[2])
    assert answers[::2] == ['sound'] * 100
    by_y = [answer for answer in answers[1::2] if answer != 'sound']
    assert by_y.count('--up y') > max(50, 0.9 * len(by_y))


def test_a_height_between_the_other_sizes_tells_no_axis(tmp_path):
    """As y is between x and z; boxes that stand by both readings would be sound by a guess."""
    path = written(tmp_path, 'a.csv', 'name,x,y,z,width,height,depth\na,.5,.5,.5,1,1,1\n')
    for up in 'yz':
        assert len(read_plan(path, unit='m', up=up)) == 2
    with pytest.raises(ValueError, match='which axis is up, y or z.; if it is so, add --up y'):
        read_plan(path, unit='m')
    path = written(tmp_path, 'a.csv', 'name,x,y,z,width,height,depth\na,.5,.5,.6,1,1.2,1\n')
    with pytest.raises(ValueError, match='which axis is up, z or y.; if it is so, add --up z'):
        read_plan(path, unit='m')


def test_piles_along_y_in_two_containers_on_a_fixed_floor(tmp_path):
    """Each is judged by itself, and what is fixed may be anywhere."""
    text = sheet(*(f'{name},1,1,1,.5,{y},.7,{fixed},{pallet}' for pallet in '12' for name, y, fixed
                   in (('floor', 3.5, 1), ('a', 4.5, 0), ('b', 5.5, 0), ('c', 6.5, 0))),
                 more=',fixed,pallet')
    path = written(tmp_path, 'a.csv', text)
    with pytest.raises(ValueError, match='which axis is up, y or z.; if it is so, add --up y'):
        read_plan(path)
    assert inspect_plan(read_plan(path, up='y')).sound


ASKED = {
    'two masses': (sheet('a,1,1,1,0,0,.5,9,7', more=',gross_kg,net_kg'), 'which is the mass, gross'
                   '_kg or net_kg?; if it is so, add --ignore net_kg'),
    'net alone': (sheet('a,1,1,1,0,0,.5,9', more=',net'), 'is net the mass?; if it is so, add '
                  '--column mass=net'),
    'radians or degrees': (sheet('a,1,1,1,0,0,.5,1.5', more=',yaw'), 'is yaw in degrees or radi'),
    'two turns': (sheet('a,1,1,1,0,0,.5,0,0,0,1,90', more=',qx,qy,qz,qw,yaw'), 'which is the turn, '
                  'qx qy qz qw or yaw?; if it is so, add --ignore yaw'),
    'two containers': (sheet('a,1,1,1,0,0,.5,1,2', more=',pallet,truck'), 'which is the container, '
                       'pallet or truck'),
    'mixed units': ('name,x_mm,y_mm,z_mm,l_cm,w_cm,h_cm\na,0,0,5,1,1,1\n', 'do not have one unit'),
    'a name with =': ('l,w,h,a=b $x,a=b $y,a=b $z\n9,9,9,0,0,0\n', "--column 'x_min=a=b $x'"),
    'mass in lb, limit in': (sheet('a,1,1,1,0,0,.5,9,7', more=',mass_lb,limit'), 'one unit'),
    'two lists': (json.dumps({kind: [{'x': 0, 'y': 0, 'z': 1, 'l': 1, 'w': 1, 'h': 2, kind: 1}]
                              for kind in 'ab'}), 'which list are the boxes, a or b'),
    'bare lists': (json.dumps([[*box, 7] for box in BOXES]), '(numbers are in 0, 1, 2, 3, 4'),
    'nine': (sheet('a,1,1,1,0,0,.5,9', more=',quantity'), "quantity of a is '9': a row is one box"),
}


@pytest.mark.parametrize('case', ASKED)
def test_what_is_open_is_asked(case, tmp_path, capsys):
    text, words = ASKED[case]
    path = written(tmp_path, 'a.json' if text[0] in '{[' else 'a.csv', text)
    assert inspect_files.main([str(path)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line


def test_options_answer_what_is_asked(tmp_path):
    text = sheet('a,1,1,1,0,0,.5,9,7', more=',gross,net')
    path = written(tmp_path, 'a.csv', text)
    assert read_plan(path, ignore=['net']).masses[0] == 9
    plan = read_plan(path, columns={'mass': 'net'})
    assert plan.masses[0] == 7 and [fault.names for fault in plan.faults] == [('gross',)]
    assert not [fault for fault in read_plan(path, columns={'mass': 'net'}, ignore=['gross']).faults
                if fault.kind == 'column']
    for options, words in (({'columns': {'mas': 'net'}}, "columns: 'mas' is none of name, mass"),
                           ({'columns': {'mass': 'nt'}}, "no column is called 'nt'"),
                           ({'ignore': ['nt']}, "neither a column nor a list is called 'nt'"),
                           ({'up': 'w'}, 'up must be one of x, y, z'),
                           ({'frames': 'two'}, 'frames must be one of own, one')):
        with pytest.raises(ValueError, match=words):
            read_plan(path, **options)


@pytest.mark.parametrize(('more', 'turn', 'quaternion'), [
    (',yaw', '90', (0, 0, .5**.5, .5**.5)), (',yaw_deg', '1', (0, 0, math.sin(math.pi / 360), 1)),
    (',yaw (rad)', '1', (0, 0, math.sin(.5), math.cos(.5))), (',yaw', '0', (0, 0, 0, 1)),
    (',roll_deg,pitch_deg,yaw_deg', '90,0,90', (.5, .5, .5, .5)),
    (',rotation.yaw °', '-90', (0, 0, -.5**.5, .5**.5)),
    (',orientation.x,orientation.y,orientation.z,orientation.w', '0,0,1,0', (0, 0, 1, 0))])
def test_turns(more, turn, quaternion, tmp_path):
    """About fixed axes: a roll, then a yaw."""
    plan = read_plan(written(tmp_path, 'a.csv', sheet(f'a,1,1,1,0,0,.5,{turn}', more=more)))
    assert plan.poses[0, 3:] == pytest.approx(quaternion, abs=1e-4) and not plan.faults


@pytest.mark.parametrize('more', [',rotation', ',orientation', ',rx', ',theta', ',heading',
                                  ',rotation.x', ',Drehung', ',rotation_deg'])
def test_a_turn_by_another_name_is_not_judged(more, tmp_path, capsys):
    """The sizes may be turned already."""
    path = written(tmp_path, 'a.csv', sheet('a,1,1,1,0,0,.5,90', more=more))
    assert inspect_files.main([str(path)]) == 3
    assert inspect_files.main([str(path), '--ignore', more[1:]]) == 0
    assert '1 column was not read' in capsys.readouterr().out


@pytest.mark.parametrize('degrees', [0, 90, 180, 270, -90, 360])
@pytest.mark.parametrize('up', ['x', 'y', 'z'])
def test_a_turn_about_the_axis_that_is_up(degrees, up, tmp_path):
    """A quaternion of the file and its yaw are the same turn; a least corner is that of both."""
    half, axis = math.radians(degrees) / 2, 'xyz'.index(up)
    turn = [0.0, 0.0, 0.0, math.cos(half)]
    turn[axis] = math.sin(half)
    head = 'name,lx,ly,lz,x_min,y_min,z_min'
    plans = [read_plan(written(tmp_path, 'a.csv', f'{head}{more}\na,1,2,3,4,5,6,{cells}\n'), up=up)
             for more, cells in ((',yaw_deg', degrees),
                                 (',qx,qy,qz,qw', ','.join(map(str, turn))))]
    a, b = (plan.poses[0] for plan in plans)
    assert a[:3] == pytest.approx(b[:3]) and abs(a[3:] @ b[3:]) == pytest.approx(1.0)
    low = dict(zip('xyz', (4, 5, 6)))
    order = {'x': 'yzx', 'y': 'xzy', 'z': 'xyz'}[up]
    reach = np.array([dict(zip('xyz', (1, 2, 3)))[name] for name in order], float)
    if degrees % 180:
        reach[:2] = reach[1::-1]
    assert a[:3] - reach / 2 == pytest.approx([low[name] for name in order])


FRAMES = 'name,length,width,height,x,y,z,pallet'


@pytest.mark.parametrize(('cells', 'frames', 'lines'), [
    (('a,1,1,1,.5,.5,.5,1', 'b,1,1,1,.5,.5,.5,2'), None, 'each with a frame of its own'),
    (('a,1,1,1,.5,.5,.5,1', 'b,1,1,1,2.5,.5,.5,2'), None, 'in one frame'),
    (('a,1,1,1,.5,.5,.5,1', 'b,1,1,1,2.5,.5,.5,2'), 'own', 'each with a frame of its own'),
    (('a,1,1,1,.5,.5,.5,1', 'b,1,1,1,.5,.5,.5,2'), 'one', 'in one frame')])
def test_frames(cells, frames, lines, tmp_path, capsys):
    """By least corners that agree, or as it is told; in one frame both are in one place."""
    path = str(written(tmp_path, 'a.csv', '\n'.join((FRAMES, *cells)) + '\n'))
    status = inspect_files.main([path, *(['--frames', frames] if frames else [])])
    printed = capsys.readouterr().out
    assert lines in printed.splitlines()[0] and status == (frames == 'one')
    assert '1: 1 box: ' in printed and '2: 1 box: ' in printed


@pytest.mark.parametrize(('cells', 'options', 'status', 'words'), [
    (('.3', ''), [], 3, '1 has no known friction'), (('.3', ''), ['--friction', '.6'], 0, '0.3 to'),
    (('.3', '-1'), [], 3, "friction is '-1'"), (('.3', '.6'), [], 0, 'friction 0.3 to 0.6: sound'),
    (('.3', '.6'), ['--acceleration', '3.92', '0', '-9.81'], 1, 'slides                a')])
def test_a_column_of_friction(cells, options, status, words, tmp_path, capsys):
    text = sheet(*(f'{name},1,1,1,{x},0,.5,9,{cell}' for name, x, cell in zip('ab', (0, 3), cells)),
                 more=',mass,mu')
    assert inspect_files.main([str(written(tmp_path, 'a.csv', text)), *options]) == status
    assert words in capsys.readouterr().out


def test_six_containers_have_six_verdicts(tmp_path):
    """In a table, and as lists of a JSON document; one hangs, one overlaps, one is overloaded."""
    goods = {n: [(.5, .5, .5, 1, 9), (.5, .5, 1.5, 1, 9)] for n in range(6)}
    goods[1][1], goods[3][1], goods[4][1] = (
        (.5, .5, 1.7, 1, 9), (.5, .5, 1.4, 1, 9), (.5, .5, 1.5, 10, 9))
    wanted = ['sound', 'not sound', 'sound', 'not sound', 'not sound', 'sound']
    keys = ('x', 'y', 'z', 'mass', 'limit')
    table = sheet(*(f'g,1,1,1,{",".join(map(str, box))},{n}' for n, some in goods.items()
                    for box in some), more=',mass,limit,container')
    document = json.dumps({'trucks': [{'id': 'T', 'goods': [
        {'name': 'g', 'length': 1, 'width': 1, 'height': 1, **dict(zip(keys, box))}
        for box in some]} for some in goods.values()]})
    for name, text in (('a.csv', table), ('a.json', document)):
        found = inspect_plan(written(tmp_path, name, text))
        assert found.verdicts_of_stacks == wanted and len({*found.plan.stacks}) == 6
        assert len({*found.plan.names}) == len(found.plan)


def test_lists_beside_the_boxes(tmp_path):
    """One that may have boxes is told; --ignore chooses one of two that have."""
    boxes = [{'id': n, **dict(zip(('x_min', 'y_min', 'z_min', 'l', 'w', 'h'), box))}
             for n, box in enumerate(BOXES)]
    path = written(tmp_path, 'a.json', json.dumps({'goods': boxes, 'left': [{'id': 9}]}))
    (fault,) = read_plan(path, unit='mm').faults
    assert (fault.kind, fault.names, fault.verdict) == ('part', ('left',), 'not all judged')
    assert not read_plan(path, unit='mm', ignore=['left']).faults
    path = written(tmp_path, 'a.json', json.dumps({'old': [{**box, 'n': 1} for box in boxes],
                                                   'new': boxes[:1]}))
    with pytest.raises(ValueError, match='are the boxes, old or new.*add --ignore new'):
        read_plan(path, unit='mm')
    plan = read_plan(path, unit='mm', ignore=['old'])
    assert plan.names == ('0', 'ground') and not plan.faults


def test_bare_lists_are_columns_by_number(tmp_path):
    path = written(tmp_path, 'a.json', json.dumps({'boxes': BOXES}))
    names = ('x_min', 'y_min', 'z_min', 'length', 'width', 'height')
    plan = read_plan(path, unit='mm', columns=dict(zip(names, '012345')))
    assert len(plan) == 4 and inspect_plan(plan).sound


def test_a_row_without_a_container_is_left_out(tmp_path):
    text = sheet('a,1,1,1,0,0,.5,1', 'b,1,1,1,3,0,.5,', more=',pallet')
    (fault,) = read_plan(written(tmp_path, 'a.csv', text)).faults
    assert fault.text == 'row 2: pallet is missing: left out' and fault.names == ('b',)


def test_a_container_with_an_inner_size(tmp_path):
    """Of a JSON document, by its words; a box beyond it is told."""
    box = {'id': 'a', 'x_min': 0.5, 'y_min': 0, 'z_min': 0, 'l': 1, 'w': 1, 'h': 1}
    for inner in ({'length': 1.2, 'width': 1, 'height': 2}, [1.2, 1, 2]):
        path = written(tmp_path, 'a.json', json.dumps({'container': inner, 'boxes': [box]}))
        found = inspect_plan(read_plan(path, unit='m'))
        assert [row.kind for row in found.rows()] == ['outside']


@pytest.mark.parametrize(('cells', 'number'), [
    ('0,5 1.900', math.nan), ('0.5 1.900', 1.9), ('0,5 1,900', 1.9), ('1.200 1.900', math.nan),
    ('0,5 0.5', math.nan), ('12,5 3', 3.0), ('1.5 2.500', 2.5)])
def test_decimal_marks_are_judged_by_the_whole_file(cells, number):
    table = read_csv(f'a;b\n{cells.replace(" ", ";")}\n')
    assert table.numbers('b') == pytest.approx([number], nan_ok=True)


def test_no_word_has_two_roles():
    """Nor is a word harmless that has one, but for names."""
    words = [word for line in (*LINES['size'], *LINES['place'], *LINES['turn'])
             for word in line.words]
    assert not {*words} & {*ROLE_OF} and not {*words} & HARMLESS
    assert {ROLE_OF[word] for word in HARMLESS & {*ROLE_OF}} == {'name'}
    rivals = {word for some in RIVALS.values() for word in some.split()}
    assert not rivals & {*ROLE_OF, *HARMLESS}
    assert not NEUTRAL & {word for word in words if len(word) > 1}


@pytest.mark.parametrize(('name', 'parts'), [
    ('item.posX (mm)', ('item', 'posx', 'mm')), ('Länge_cm', ('', 'länge', 'cm')),
    ('weight/kg', ('', 'weight', 'kg')), ('m', ('', 'm', None)), ('', ('', '', None)),
    ('yaw°', ('', 'yaw', 'degrees')), ('x_1', ('', 'x1', None)), ('box', ('', 'box', None))])
def test_words_of_a_column(name, parts):
    assert tuple(word_of(name)) == parts

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Small files with a trap each, and what the program must answer."""
from __future__ import annotations

import os
from pathlib import Path

import pytest

from box_contact_ros.plans import inspect_files

pytest.importorskip('clarabel')

TRAPS = Path(__file__).with_name('traps')
NESTED = ['--column', 'x_min=at.left', '--column', 'y_min=at.front', '--column', 'z_min=at.bottom']
ANSWERS = [
    ('tips.csv', [], 0, ': sound'), ('paper.csv', [], 0, ': sound'),
    ('kg_unit.edi', ['--limit', '5000'], 1, '0010102  10000 kg on top'),
    ('weight_thousands.edi', [], 3, '24.500 KGM, less than any container'),
    ('six_digits_all.edi', [], 0, '2 boxes, 20 t'),
    ('quote_note.csv', [], 2, 'line 4: it is not CSV'),
    ('cut.csv', [], 3, '1 box was not placed'), ('whole.csv', [], 1, 'low  18 kg on top'),
    ('dup2.json', [], 2, "the key 'z' comes twice"),
    ('heavy_unread.csv', [], 3, "row 2: mass is '1800 kg'"),
    ('leftout_same.csv', [], 3, '5 boxes were not placed'),
    ('yaw.csv', [], 1, 'overlap               a  d  150.0 mm deep'),
    ('quantity.csv', [], 2, "quantity of b is '4'"),
    ('sequence.csv', [], 1, 'step 1: high hangs until low comes'),
    ('two_pallets.csv', [], 1, '1: 2 boxes: sound\n2: 2 boxes: not sound\n'),
    ('two_pallets.csv', [], 1, 'hangs                 2/d  300.0 mm above what is below'),
    ('packer_head.csv', [], 2, 'in which unit are lengths (m, cm, mm, in, ft)?; are x y z centres '
     'or least corners?; if it is so, add --unit mm --origin corner'),
    ('packer_head.csv', ['--unit', 'mm'], 1, 'origin                17 of 17 overlaps are gone if x'
                                             ' y z are least corners: --origin corner'),
    ('packer_head.csv', ['--unit', 'mm', '--origin', 'corner'], 1, 'hangs: 4, '),
    ('nested.json', [], 2, f'if it is so, add {" ".join(NESTED)} --unit mm'),
    ('nested.json', [*NESTED, '--unit', 'mm'], 1, 'hangs                 B  200.0 mm above'),
    ('rnd.csv', ['--unit', 'cm'], 1, 'at most 0.5 mm, as where places are rounded: --tolerance'),
    ('rnd.csv', ['--unit', 'cm', '--tolerance', '1e-3'], 0, ': sound'),
    ('axle.csv', [], 1, 'kingpin carries 334 kg of 11,000 kg\nbogie carries 12,666 kg of 10,000'),
    ('bed_false.json', [], 1, 'overlap               1  2  100.0 mm deep'),  # 150 along x
    ('py_dup2.json', [], 2, 'add --unit mm'),
    ('py_dup2.json', ['--unit', 'mm'], 1, 'truck: 1 box: not sound\ntruck (2): 1 box: sound\n'),
    ('fixed_all.csv', [], 3, 'not judged: nothing may move'),
    ('semi_false.csv', [], 3, "row 2: mass is '1.900'"),
    ('w_Tragkraft.csv', [], 3, 'Tragkraft  not read'), ('xss.csv', [], 1, 'hangs: 4'),
    ('friction.csv', ['--acceleration', '3.92', '0', '-9.81'], 1, 'slides                crate'),
    ('vgm_empty.edi', [], 0, '1 box, 20 t'), ('friction.csv', [], 0, 'friction 0.2 to 0.5: sound'),
    *((name, [], 2, 'a world or a model of a simulator') for name in (
        'hang_mesh.sdf', 'static_overlap.sdf', 'model_one_box.sdf', 'model_two_boxes.sdf',
        'hide.sdf', 'incl.sdf', 'hf.xml', 'nkey.xml'))]


@pytest.mark.parametrize(('name', 'options', 'status', 'words'), ANSWERS)
def test_the_answer(name, options, status, words, monkeypatch, capsys):
    monkeypatch.chdir(TRAPS)
    assert inspect_files.main([name, *options]) == status
    printed = capsys.readouterr()
    assert words in printed.out + printed.err
    assert status != 2 or printed.err.count('\n') == 1 and not printed.out


def test_every_file_has_an_answer():
    assert {name for name, *_ in ANSWERS} == {*os.listdir(TRAPS)}

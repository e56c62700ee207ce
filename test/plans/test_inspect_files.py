# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The program `inspect`: its lines, its exit statuses, its JSON and CSV, on small files."""
from __future__ import annotations

import argparse
import csv
import io
import json
from pathlib import Path

import pytest

from box_contact_ros import Plan
from box_contact_ros.plans import inspect_files
from box_contact_ros.plans.inspect_files import STATUSES

pytest.importorskip('clarabel')

from test_read_plan import baplie, sheet, written

ROOT = Path(__file__).resolve().parents[2]
FILES = ROOT / 'docs' / 'examples' / 'files'
ON_BOX = 'b,1,1,1,{x},0,1.5'
PAIR = ('a,1,1,1,0,0,0.5,100', 'b,1,1,1,0,0,1.5,200')


@pytest.fixture
def judge(tmp_path, capsys):
    """Return a function that writes a file and judges it: exit status and lines, or stderr's."""
    def run(name: str, text: str, *options: str) -> tuple[int, list[str]]:
        status = inspect_files.main([str(written(tmp_path, name, text)), *options])
        printed = capsys.readouterr()
        return status, (printed.err if status == 2 else printed.out).splitlines()
    return run


@pytest.mark.parametrize(('text', 'status', 'line'), [
    (sheet('a,1,1,1,0,0,0.5', ON_BOX.format(x=0.4)), 0, '2 boxes: sound'),
    (sheet('a,1,1,1,0,0,0.5', ON_BOX.format(x=0.6)), 1,
     'unsupported           b  share 0.40, centre 100 mm outside'),
    (sheet('a,1,1,1,0,0,0.5', 'b,1,1,1,0,0,1.4'), 1, 'overlap               a  b  100.0 mm deep'),
    (sheet('a,1,1,1,0,0,0.5', 'b,1,1,1,0,0,2.5'), 1,
     'hangs                 b  1000.0 mm above what is below'),
    (sheet('a,1,1,1,0,0,0.4'), 1, 'overlap               a  ground  100.0 mm deep'),
    (sheet(f'{PAIR[0]},150', f'{PAIR[1]},', more=',mass,limit'), 1,
     'overloaded            a  200 kg on top'),
    (sheet(*PAIR, more=',mass'), 0, '2 boxes, 300.0 kg, centre of mass 0.000 0.000 1.167 m, '
                                 'friction 0.5: sound'),
    (sheet('a,1,1,1,0,0,0.5', 'b,1,0,1,0,0,1.5'), 3, '1 box: not all judged; what was read is '
                                                     'sound, but 1 box was not placed'),
    (sheet('a,1,1,1,0,0,0.5', 'b,1,0,1,0,0,1.5', 'c,1,1,1,0,0,0.7'), 1, '2 boxes: not sound; 1 box '
                                                                        'was not placed')])
def test_rows(judge, text, status, line):
    """What is wrong with a file decides the exit status."""
    found, lines = judge('p.csv', text)
    assert found == status and line in lines, lines


@pytest.mark.parametrize(('boxes', 'status', 'kind'), [
    (['0010082 22G1', '0010084 22G1'], 0, None), (['0010082 22G1', '0010086 22G1'], 1, 'gap'),
    (['0010082 22G1', '0010082 22G1'], 1, 'slot taken'),
    (['0010082 22G1', '0020082 42G1'], 1, 'overlap'),
    (['0020082 42G1', '0010084 22G1', '0030084 22G1'], 1, 'unsupported'),  # no castings midway
    (['0020082 42G1', '0020084 L5G1', '0020086 42G1'], 0, ''),  # 45 ft has castings as 40 ft
    (['0010086 22G1'], 1, 'gap'), (['0010082 22G1', '0010084 5EGB'], 3, 'size type'),
    (['0010082 22G1', '010084 22G1'], 3, 'slot'), (['0010082 22G1 RFF+BM:1'], 3, 'mass'),
    (['0010082 22U1 DIM+9+CMT:::79'], 3, 'goods')])
def test_what_makes_a_ship_unsound(judge, boxes, status, kind):
    """Gaps, slots taken twice and overlaps do; with the others not all is judged."""
    found, lines = judge('p.edi', baplie(*boxes))
    assert found == status
    assert kind is None or any(line.startswith(kind) for line in lines), lines


def test_of_a_cut_file_not_all_is_judged(judge):
    text = baplie('0010082 22G1', '0010084 22G1')
    assert judge('p.edi', text)[0] == 0
    status, lines = judge('p.edi', text[:text.index('UNT')])
    assert status == 3 and lines[0].startswith('cut ')
    assert judge('p.edi', text.replace('MEA+WT++KGM:20000', 'RFF+BM:1', 1).replace(
        "RFF+BM:1'\n", '', 1))[0] == 3


def test_one_line_for_what_is_not_read(judge):
    for name, text, words in (('p.txt', 'Dear all', 'begins no format'), ('p.csv', '', 'empty'),
                              ('p.sdf', '<sdf/>', 'mujoco_plan.py'),
                              ('p.xml', '<mujoco/>', 'a model of a simulator')):
        status, lines = judge(name, text)
        assert status == 2 and len(lines) == 1 and name in lines[0] and words in lines[0]


def test_options(judge):
    text = sheet(*PAIR, more=',mass')
    assert judge('p.csv', text, '--limit', '199')[0] == 1
    assert judge('p.csv', text, '--limit', '201')[0] == 0
    assert judge('p.csv', text, '--limit', '199', '--geometry')[0] == 3
    assert judge('p.csv', text, '--geometry')[0] == 0
    assert judge('p.csv', text, '--acceleration', '9.9', '0', '-9.81')[0] == 1
    gap = sheet('a,1,1,1,0,0,0.501')
    assert judge('p.csv', gap)[0] == 1 and judge('p.csv', gap, '--tolerance', '0.002')[0] == 0
    status, lines = judge('p.csv', gap, '--tolerance', '0.9')
    assert status == 2 and '--tolerance must be from 0 to 0.5 m, half of' in lines[0]
    assert "box 'a', not 0.9" in lines[0]
    assert judge('p.csv', gap, '--acceleration', '0', '0', '0')[0] == 2


@pytest.mark.parametrize(('name', 'text', 'status', 'words'), [
    ('a.csv', sheet(f'{PAIR[0][:-4]},,150', f'{PAIR[1][:-4]},,', more=',mass,limit'), 3,
     'has no mass, so limits are not judged'),
    # An interleave sheet, and a tolerance that nobody gave.
    ('a.csv', sheet('carton_1,0.4,0.3,0.25,0,0,0.125,6', 'paper,0.8,0.6,0.00015,0,0,0.250075,0.02',
                    'carton_2,0.4,0.3,0.25,0,0,0.37515,6', more=',mass'), 0, 'sound')])
def test_what_is_not_judged_is_not_sound(judge, name, text, status, words):
    """And what is judged and told is."""
    found, lines = judge(name, text)
    assert found == status and words in '\n'.join(lines), lines


def test_a_limit_without_weights_is_not_judged(judge):
    text = sheet('a,1,1,1,0,0,0.5', 'b,1,1,1,0,0,1.5')
    assert judge('p.csv', text)[0] == 0
    status, lines = judge('p.csv', text, '--limit', '10')
    assert status == 3 and lines[-2].endswith('what was read is sound, but 2 have no weight')


def test_forty_lines_and_what_goes_with_them(judge):
    text = sheet('a,1,1,1,0,0,2', *(f'b{n},1,1,1,0,0,{n + 3}' for n in range(60)),
                 'c,1,1,1,5,0,2')
    status, lines = judge('p.csv', text)
    assert status == 1 and len(lines) == 45 and lines[-3] == 'and 22 that go with these'
    assert lines[1] == 'hangs: 2, goes with what falls: 60'
    assert lines[2].startswith('hangs                 a  1500.0 mm')
    assert lines[3] == 'goes with what falls  b0  with a'
    assert [line for line in lines if line.startswith('hangs                 c  ')]
    assert len(judge('p.csv', text, '--all')[1]) == 66


def test_several_files_have_a_line_each(tmp_path, capsys):
    """And the worst exit status."""
    good = str(written(tmp_path, 'a.csv', sheet('a,1,1,1,0,0,0.5')))
    bad = str(written(tmp_path, 'b.csv', sheet('a,1,1,1,0,0,0.7')))
    assert inspect_files.main([good, bad]) == 1
    assert capsys.readouterr().out.splitlines() == [f'{good}: 1 box: sound',
                                                    f'{bad}: 1 box: not sound',
                                                    '2 files, 2 boxes: 1 sound, 1 not sound']
    assert inspect_files.main([bad, str(tmp_path / 'none.csv'), good]) == 2
    printed = capsys.readouterr()
    assert printed.err == f'{tmp_path / "none.csv"}: No such file or directory\n'
    assert printed.out.splitlines()[2:] == ['3 files, 2 boxes: 1 sound, 1 not sound, 1 not read']


def test_of_several_files_the_worst_counts(tmp_path, capsys):
    texts = {0: sheet('a,1,1,1,0,0,0.5'), 3: sheet('a,1,1,1,0,0,0.5', 'b,1,0,1,0,0,1.5'),
             1: sheet('a,1,1,1,0,0,0.7'), 2: 'name'}
    paths = {status: str(written(tmp_path, f'{status}.csv', text))
             for status, text in texts.items()}
    worst = list(paths)
    for n, status in enumerate(worst):
        for order in worst[:n + 1], worst[n::-1]:
            assert inspect_files.main([paths[other] for other in order]) == status
    assert ': not all judged; ' in capsys.readouterr().out


def test_json_is_as_its_schema_has_it(judge):
    jsonschema = pytest.importorskip('jsonschema')
    schema = json.loads((ROOT / 'msg_schemas/inspection.json').read_text('utf-8'))
    jsonschema.Draft202012Validator.check_schema(schema)
    for name, text in (('ship.edi', (FILES / 'ship.edi').read_text('utf-8')),
                       ('c.csv', sheet('a,1,1,1,0,0,0.5', 'b,1,0,1,0,0,1')),
                       ('b.csv', sheet(*PAIR, more=',mass'))):
        status, (line,) = judge(name, text, '--json')
        document = json.loads(line)
        jsonschema.validate(document, schema, jsonschema.Draft202012Validator)
        assert document['sound'] == (status == 0)
        assert STATUSES[document['verdict']] == status
        assert len(document['names']) == len(document['stands']) == len(document['load'])


def test_steps_of_a_file(judge):
    """By a column, by rows, or not at all; in text, CSV and JSON."""
    jsonschema = pytest.importorskip('jsonschema')
    rows = ['a,1,1,1,0,0,0.5,3', 'b,1,1,1,0,0,1.5,2']
    text, told = sheet(*rows, more=',order'), 'step 2: b hangs until a comes'
    assert judge('p.csv', text)[1][1:3] == [f'step                  b  {told}',
                                            '2 boxes: not sound']
    assert judge('p.csv', text, '--csv')[1][1].endswith(f'p.csv,step,b,{told}')
    status, (line,) = judge('p.csv', text, '--json')
    document = json.loads(line)
    assert document['steps'] == [{'step': 2, 'name': 'b', 'cause': 'hangs', 'until': 3}]
    jsonschema.validate(document, json.loads((ROOT / 'msg_schemas/inspection.json').read_text()))
    assert status == 1 and judge('p.csv', text, '--order', 'rows')[0] == 0
    assert judge('p.csv', sheet(*rows[::-1], more=',order'), '--order', 'rows')[1][1].endswith(
        'step 1: b hangs until a comes')
    part = sheet(rows[0], rows[1][:-1], more=',order')
    assert judge('p.csv', part)[0] == 3 and judge('p.csv', part, '--order', 'rows')[0] == 0


def test_rows_of_stacks_and_bodies_are_steps():
    """Each stack begins anew; a body comes with the first of its boxes."""
    at = [(0, 0, 0, 0, 0, 0, 1)] * 5
    plan = Plan((1, 1, 1), at, body=[0, 1, 0, 2, 3], stack=[5, 5, 5, 2, 2])
    assert inspect_files.order_of_rows(plan).tolist() == [1, 2, 1, 1, 2]


def test_csv_has_a_row_for_each_fault(judge):
    status, lines = judge('ship.edi', (FILES / 'ship.edi').read_text('utf-8'), '--csv')
    rows = list(csv.DictReader(io.StringIO('\n'.join(lines))))
    assert status == 1
    assert [(row['kind'], row['boxes']) for row in rows] == [
        ('unsupported', '0100304'), ('goes with what falls', '0100306')]


def test_the_worst_comes_first(judge):
    rows = ['a,1,1,1,0,0,.5', 'b,1,1,1,0,0,1.4', 'c,1,1,1,5,0,.3', 'd,1,1,1,9,0,.5',
            'e,1,1,1,9.6,0,1.5', 'f,1,1,1,13,0,.5', 'g,1,1,1,13.9,0,1.5']
    lines = judge('p.csv', sheet(*rows))[1]
    assert [line[22:23] for line in lines[2:6]] == ['c', 'a', 'g', 'e']


def test_a_line_has_three_names_and_shows_no_control_characters(judge):
    rows = [f'{name},1,1,1,0,0,{z}' for z, name in enumerate(('a', 'b\x1b[31m', 'c', 'd'))]
    lines = judge('p.edi', baplie('0010082 22G1', *(f'00100{n} ZZZZ' for n in range(84, 92, 2))))[1]
    assert lines[0].startswith('size type             0010084  0010086  0010088 and 1 more  of the')
    assert '\x1b' not in ''.join(judge('p.csv', sheet(*rows))[1])


def test_a_picture(tmp_path):
    pytest.importorskip('matplotlib')
    out = tmp_path / 'ship.png'
    assert inspect_files.main([str(FILES / 'ship.edi'), '--picture', str(out)]) == 1
    assert out.read_bytes().startswith(b'\x89PNG')


def test_a_picture_overwrites_no_input(tmp_path, capsys):
    path = written(tmp_path, 'a.csv', sheet('a,1,1,1,0,0,0.5'))
    (tmp_path / 'link.png').symlink_to(path)
    for out in path, tmp_path / 'link.png':
        with pytest.raises(SystemExit) as ended:
            inspect_files.main([str(path), '--picture', str(out)])
        assert ended.value.code == 2 and 'would overwrite' in capsys.readouterr().err
    assert path.read_text('utf-8').startswith('name')


def test_a_picture_that_cannot_be_written(tmp_path, capsys):
    """It is not a plan that could not be read."""
    pytest.importorskip('matplotlib')
    path = str(written(tmp_path, 'a.csv', sheet('a,1,1,1,0,0,0.5')))
    assert inspect_files.main([path, '--picture', str(tmp_path / 'none' / 'a.png')]) == 74
    with pytest.raises(SystemExit):
        inspect_files.main([path, '--picture', str(tmp_path / 'a.odd')])
    assert 'Traceback' not in capsys.readouterr().err


def test_refusals_and_cells_have_no_control_characters(tmp_path, capsys):
    path = written(tmp_path, 'a\x1b[31m.csv', 'a\x1b[31m,b')
    assert inspect_files.main([str(path)]) == 2
    assert '\x1b' not in capsys.readouterr().err
    path = written(tmp_path, 'b\x1b.csv', sheet('"=1+1\x1b",1,1,1,0,0,7', '@a,1,1,1,5,0,7'))
    assert inspect_files.main([str(path), '--csv']) == 1
    printed = capsys.readouterr().out
    assert '\x1b' not in printed
    assert [row['boxes'] for row in csv.DictReader(io.StringIO(printed))] == ["'=1+1?", "'@a"]
    for paths in [str(path)], [str(path)] * 2:
        inspect_files.main(paths)
        assert '\x1b' not in capsys.readouterr().out


def test_the_hint_can_be_typed(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name, shown in (('a b;c.csv', "'a b;c.csv'"), ('-a.csv', './-a.csv')):
        written(tmp_path, name, sheet('a,1,1,1,0,0,0.5'))
        assert inspect_files.main(['--', name]) == 0
        assert capsys.readouterr().out.endswith(f'box_contact_view {shown}\n')
    inspect_files.main(['a b;c.csv', '--unit', 'cm', '--container', '1', '2.5', '3'])
    assert capsys.readouterr().out.endswith(
        "box_contact_view --unit cm --container 1 2.5 3 'a b;c.csv'\n")
    inspect_files.main(['a b;c.csv', '--limit', '5', '--from=-x', '--order', 'rows', '--geometry',
                        '--acceleration', '1', '0', '-9.81', '--column', 'name=name'])
    assert capsys.readouterr().out.endswith(
        "box_contact_view --column=name=name --limit 5 --acceleration 1 0 -9.81 --order rows "
        "--from=-x --geometry 'a b;c.csv'\n")


@pytest.mark.parametrize('words', [
    [], ['--limit', '5'], ['--from=-x', '--order', 'rows'], ['--acceleration', '1', '0', '-9.81'],
    ['--unit', 'mm', '--origin', 'corner', '--container', '1', '2.5', '3', '--up', 'y'],
    ['--column', 'mass=a=b c', '--column', 'name=$x', '--ignore', '-n', '--turns', 'degrees'],
    ['--friction', '0.25', '--tolerance', '0.0002', '--sides', '--geometry', '--bears', 'corners'],
    ['--frames', 'own']])
def test_the_hint_repeats_all_options(words):
    """So that the page judges as the program did: it said sound where --limit 5 did not."""
    parser = argparse.ArgumentParser()
    inspect_files.add_options(parser)
    joined = ['--ignore=-n' if word == '--ignore' else word for word in words if word != '-n']
    options = parser.parse_args(joined)
    assert parser.parse_args(inspect_files.typed(options)) == options


def test_the_page_says_what_the_program_says(tmp_path):
    """With a limit, the plan of the page is not sound."""
    parser = argparse.ArgumentParser()
    inspect_files.add_options(parser)
    path = str(written(tmp_path, 'a.csv', sheet(*PAIR, more=',mass')))
    for limit, verdict in (('199', 'not sound'), ('201', 'sound')):
        found, taken = inspect_files.judged(path, parser.parse_args(['--limit', limit]))
        assert found.verdict == verdict and taken.startswith('read: x y z [m], centres')

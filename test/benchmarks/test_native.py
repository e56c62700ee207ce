# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report `native`: the program compiles, and every engine in it answers rightly."""
from __future__ import annotations

import csv
import re
import runpy
import shutil
from pathlib import Path

import numpy as np
import pytest
from test_library import EACH_FUNCTION_ONCE

from benchmarks import native, native_calls, output, settled
from benchmarks.contestant import MLP_SIZES
from benchmarks.native_calls import Effort, Program
from benchmarks.pose_sets import FLUSH, LOADS, SETS, Pairs
from box_contact_ros.core import instruction_sets

pytestmark = pytest.mark.reports

needs_compiler = pytest.mark.skipif(shutil.which('g++') is None, reason='no compiler')


@pytest.fixture(scope='module')
def containers() -> Pairs:
    return SETS['containers'](np.random.default_rng(4), 100)


@pytest.fixture(scope='module')
def program(tmp_path_factory: pytest.TempPathFactory) -> Program:
    """Return the program; its networks are compiled for answers, not for speed."""
    pytest.importorskip('mujoco')
    sets = [name for name in instruction_sets() if name != 'baseline']
    flags_of = native_calls.library_flags
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(native_calls, 'library_flags', lambda name: [
            *flags_of(name), '-O0', EACH_FUNCTION_ONCE])
        return native_calls.compiled(tmp_path_factory.mktemp('native'), 'contact', sets)


@pytest.mark.reports
@needs_compiler
def test_all_answer_as_exact(program: Program, containers: Pairs) -> None:
    """No verdict differs, and depths agree to what single precision and iterations leave."""
    n = len(containers.pose_a)
    pose_b = containers.pose_b.copy()
    pose_b[::2, :3] *= 1.5  # these are apart
    found = native.timed(program, containers._replace(pose_b=pose_b), instruction_sets()[-1],
                         Effort(1, n, 1, n))
    expected = {'mjc_BoxBox, single', 'mj_geomDistance, single', 'exact covariance, batch',
                *(f'{name} volume, batch' for name in MLP_SIZES), 'paper, single'}
    expected |= {'Coal ComputeCollision, single'} if 'coal' not in program.missing else set()
    expected |= {'Bullet btBoxBoxDetector, single'} if 'bullet' not in program.missing else set()
    assert expected <= set(found)
    for name, one in found.items():
        assert (one.judged, one.missed, one.invented) == (n, 0, 0), name
        assert one.depth_errors[2] < 0.01, name
        assert one.nanoseconds.shape == (1, 1) and one.nanoseconds.min() > 0.0
    assert max(found['exact covariance, batch'].depth_errors) == 0.0


@pytest.mark.reports
@needs_compiler
def test_a_copy_has_a_library_of_its_own(program: Program, containers: Pairs,
                                         tmp_path: Path) -> None:
    """Whatever LD_LIBRARY_PATH names: a broken one beside the program ends the run."""
    copy, best = program.copied(tmp_path / 'copy'), instruction_sets()[-1]
    effort = Effort(1, 1, 1, 1)
    assert native.UNIT in native.timed(copy, containers, best, effort)
    copy.path.with_name(native_calls.LIBRARY.name).write_bytes(b'')
    with pytest.raises(RuntimeError, match=native_calls.LIBRARY.name):
        native.timed(copy, containers, best, effort)


def planted(*rounds: list[float]) -> native.Times:
    """Return the times of one copy for each list, with no errors."""
    return native.Times(np.array(rounds), 0, 0, 1, (0.0, 0.0, 0.0))


def test_a_ratio_has_the_range_of_the_copies() -> None:
    """A copy counts by the median of its rounds' ratios, so one disturbed round moves nothing."""
    unit = planted([100.0, 300.0, 100.0])
    found = native_calls.of_copies([{native.UNIT: unit, 'exact volume, single': planted(rounds)}
                              for rounds in ([140.0, 420.0, 9e9], [120.0, 360.0, 120.0],
                                             [150.0, 450.0, 150.0])])
    assert found['exact volume, single'].nanoseconds.shape == (3, 3)
    ratio = native_calls.Ratio.of(found, 'exact volume, single', native.UNIT)
    assert str(ratio) == '1.40 [1.20, 1.50]'
    assert native_calls.Ratio.of(found, native.UNIT, native.UNIT) == (1.0, 1.0, 1.0)
    table = native.sets_table({'stacks': found, 'parcels': {
        **found, 'Bullet contactPairTest, single': unit, 'exact volume, batch': unit,
        'mlp volume, single': unit}}, 'single')
    assert table.splitlines()[0] == (
        '|  | `mjc_BoxBox` [ns] | exact volume | mlp volume | Bullet contactPairTest |')
    assert table.splitlines()[2] == '| stacks | 100 | 1.40 [1.20, 1.50] | – | – |'


@pytest.mark.reports
@needs_compiler
def test_each_contact_has_its_time(program: Program, containers: Pairs) -> None:
    """Contacts alone, equally many of each set; the table compares with the median of all."""
    pose_b = containers.pose_b.copy()
    pose_b[::2, :3] *= 1.5  # these are apart
    by_set = {'half apart': containers._replace(pose_b=pose_b), 'containers': containers}
    found = native.each_contact(program, by_set, instruction_sets()[-1], 60, passes=2)
    assert [(name, times.shape) for name, times in found.items()] == [
        ('half apart', (2, 30)), ('containers', (2, 30))]
    assert all((times > 0.0).all() for times in found.values())
    planted = {'fast': np.full((2, 3), 100.0), 'slow': np.array([[100.0], [250.0]])}
    *_, fast, slow, of_all = native.slowest_table(planted).splitlines()
    assert fast == '| fast | 3 | 100 | 100 | 100 | 1.00 | 100 | 100 | 100 | 1.00 |'
    assert slow == '| slow | 1 | 100 | 100 | 100 | 1.00 | 250 | 250 | 250 | 2.50 |'
    assert of_all.startswith('| all | 4 | 100 | ')
    assert native.goals(planted) == ('slowest 2.50 (at most 1.5: goal missed), '
                                     'p99.9 2.50 (at most 1.3: goal missed)')
    assert native.goals({'fast': planted['fast']}).count(': met)') == 2


@pytest.mark.parametrize('planted', ['sign', 'size'])
def test_a_wrong_call_ends_the_run(containers: Pairs, planted: str) -> None:
    truth = containers.contacts().separation
    wrong = {'sign': -truth, 'size': truth - 0.1}[planted]
    native.judged('planted', np.ones((1, 1)), truth, containers)
    with pytest.raises(RuntimeError, match='planted misses'):
        native.judged('planted', np.ones((1, 1)), wrong, containers)


def test_a_wrong_verdict_is_counted(containers: Pairs) -> None:
    separation = containers.contacts().separation.copy()
    separation[3] = np.inf
    found = native.judged('planted', np.ones((1, 1)), separation, containers)
    assert (found.missed, found.invented) == (1, 0)


@pytest.mark.reports
@needs_compiler
def test_quick_run(tmp_path: Path, program: Program,
                   monkeypatch: pytest.MonkeyPatch) -> None:
    """Every set, scene and instruction set; the page shows the code of each call."""
    monkeypatch.setattr(native_calls, 'compiled', lambda folder, query, networks: program)
    monkeypatch.setattr(native, 'QUICK', Effort(2, 200, 1, 20))
    monkeypatch.setattr(native, 'QUICK_CONTACTS', 500)
    assert native.main(['--quick', '--out', str(tmp_path)]) == 0
    with (tmp_path / 'native.csv').open(encoding='utf-8') as file:
        rows = list(csv.DictReader(file))
    recorded = settled.read()
    assert {row['set'] for row in rows} == {
        *SETS, *LOADS, *FLUSH, native.MIXED, *settled.by_engine(recorded), *recorded.scene}
    assert {row[f'by_unit{end}'] for row in rows if row['contestant'] == native.UNIT
            for end in ('', '_low', '_high')} == {'1'}
    assert all(float(row['by_exact_low']) <= float(row['by_exact']) <= float(row['by_exact_high'])
               for row in rows if row['contestant'] == 'mlp covariance, batch')
    assert (tmp_path / 'native.png').stat().st_size > 20_000
    text = (tmp_path / 'native.md').read_text('utf-8')
    for call in ('bc_collide(', 'bc_collide_rows(', 'mj_geomDistance(', 'box_box('):
        assert call in text
    tables = runpy.run_path(str(output.ROOT / 'docs' / 'tables.py'))
    monkeypatch.setitem(tables['rows'].__globals__, 'RESULTS', tmp_path)
    mujoco, = (choice for choice in tables['CHOICES'] if native.UNIT[:-8] in choice.native)
    shown = tables['from_c'](mujoco, tables['SWAY'])
    assert re.fullmatch(r'\d+', shown) and f'| {tables["SWAY"]} | {shown} |' in text


@pytest.mark.skipif(shutil.which('pkg-config') is None, reason='no pkg-config')
def test_flags_of_a_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The library is found when the program starts; its standard is not taken over."""
    monkeypatch.setenv('PKG_CONFIG_PATH', str(tmp_path))
    assert native_calls.package_flags('planted') is None
    (tmp_path / 'planted.pc').write_text(
        'Name: planted\nDescription: none\nVersion: 7.1\n'
        'Cflags: -std=c++11 -I/p/include\nLibs: -L/p/lib -lplanted\n')
    assert native_calls.package_flags('planted') == [
        '-I/p/include', '-L/p/lib', '-lplanted', '-Wl,-rpath,/p/lib']
    monkeypatch.setenv('PATH', str(tmp_path))
    assert native_calls.package_flags('planted') is None

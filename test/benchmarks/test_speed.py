# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report `speed`: a quick run has a row of every contestant with every instruction set."""
from __future__ import annotations

import csv
from pathlib import Path

import pytest

from benchmarks import speed
from benchmarks.contestant import CORE_MODELS
from benchmarks.output import processor, versions
from benchmarks.timing import Timing
from box_contact_ros.core import instruction_sets


def test_ratios_are_those_of_rounds() -> None:
    """The second round is slow for both; a third contestant has no unit."""
    found = [Timing(name=speed.UNIT, kind='single', rounds=[1000.0, 9000.0, 1000.0]),
             Timing(name='exact', kind='single', rounds=[250.0, 2250.0, 300.0])]
    assert speed.table(found).endswith('| exact | single | 250 | 300 | 2211 | 0.250 |')
    assert speed.table(found[1:]).endswith('| nan |')
    gains = speed.threads_table([Timing(name='exact', kind=kind, rounds=rounds) for kind, rounds in
                                 zip(speed.SHARED, ([9.0, 10.0, 90.0], [5.0, 5.0, 5.0]))])
    assert gains.endswith('| exact | 10.0 | 5.0 | 2.00 |')


def test_quick_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip('mujoco')
    assert speed.main(['--quick', '--out', str(tmp_path)]) == 0
    with (tmp_path / 'speed.csv').open(encoding='utf-8') as file:
        rows = list(csv.DictReader(file))
    by_set = {row['instruction_set'] for row in rows if row['kind'] == 'single'}
    assert len(by_set) == len(instruction_sets())
    for label in by_set:
        names = {row['name'] for row in rows if row['instruction_set'] == label}
        assert names >= {f'{model}: {name}' for model in CORE_MODELS for name in speed.BATCH_SETS}
    assert all(float(row['ns']) > 0.0 for row in rows)
    assert {row['processor'] for row in rows} == {processor()}
    assert {'new process', *speed.SHARED} >= {row['kind'] for row in rows} - {'single', 'batch'}
    text = (tmp_path / 'speed.md').read_text('utf-8')
    assert versions(speed.PACKAGES) in text and 'nan' not in text
    assert text in capsys.readouterr().out

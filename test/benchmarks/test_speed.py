# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report `speed`: a quick run has a row of every contestant with every instruction set."""
from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from benchmarks import speed
from benchmarks.contestant import CORE_MODELS
from benchmarks.output import processor, versions
from benchmarks.pose_sets import FLUSH, SETS
from benchmarks.trials import FrontierRow
from box_contact_ros.core import instruction_sets


def test_ratios_are_those_of_rounds() -> None:
    """The second round is slow for both; without the unit there is no ratio."""
    unit, exact = (FrontierRow(
        name=name, set='cubes', instruction_set='AVX2', judged=0, calls=0, single=(0.0, 0.0, 0.0),
        batch=0.0, rounds=np.array(rounds), choices={}) for name, rounds in (
            (speed.UNIT, [(1000.0, np.nan), (9000.0, np.nan), (1000.0, np.nan)]),
            ('exact', [(250.0, 100.0), (2250.0, 900.0), (300.0, 500.0)])))
    assert speed.relative(exact, [unit, exact]) == [0.25, 0.1]
    assert np.isnan(speed.relative(exact, [exact])).all()
    gains = speed.threads_table({'exact': ([9.0, 10.0, 90.0], [5.0, 5.0, 5.0])})
    assert gains.endswith('| exact | 10.0 | 5.00 | 2.00 |')


def test_quick_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip('mujoco')
    assert speed.main(['--quick', '--out', str(tmp_path)]) == 0
    with (tmp_path / 'speed.csv').open(encoding='utf-8') as file:
        rows = list(csv.DictReader(file))
    core = [row for row in rows if row['name'] in CORE_MODELS]
    assert len({(row['instruction_set'], row['name'], row['set']) for row in core}) == len(
        core) == len(instruction_sets()) * len(CORE_MODELS) * len(SETS | FLUSH)
    assert all(float(row[column]) > 0.0 for row in core for column in ('call_p50', 'batch_p50'))
    assert {row['processor'] for row in rows} == {processor()}
    with (tmp_path / 'speed_cold.csv').open(encoding='utf-8') as file:
        cold = list(csv.DictReader(file))
    assert {(row['name'], float(row['megabytes'])) for row in cold} == {
        (name, megabytes) for name in (speed.UNIT, *CORE_MODELS) for megabytes in speed.TOUCHED}
    p50 = {(row['name'], float(row['megabytes'])): float(row['call_p50']) for row in cold}
    for name in CORE_MODELS:  # caches that are cold cost more than they are hot
        assert p50[name, max(speed.TOUCHED)] > 1.5 * p50[name, 0.0] > 0.0
    text = (tmp_path / 'speed.md').read_text('utf-8')
    assert versions(speed.PACKAGES) in text and 'nan' not in text
    assert text in capsys.readouterr().out

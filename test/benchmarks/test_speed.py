# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report `speed`: what a quick run writes, and the gain of threads."""
from __future__ import annotations

import csv
from pathlib import Path

import pytest

from benchmarks import speed
from benchmarks.contestant import CORE_MODELS
from benchmarks.output import processor, versions

pytestmark = pytest.mark.reports


def test_the_gain_of_threads_is_the_ratio_of_medians() -> None:
    gains = speed.threads_table({'exact': ([9.0, 10.0, 90.0], [5.0, 5.0, 5.0])})
    assert gains.endswith('| exact | 10.0 | 5.00 | 2.00 |')


def test_forces_by_two_threads_have_the_poses_of_one() -> None:
    rows = speed.measure_forces(lambda: speed.pile(40), {'moving': (0, 2), 'later': (2, 5)})
    assert [row.state for row in rows] == ['moving', 'later']
    assert all(row.one > 0.0 and row.ratio > 0.0 for row in rows)
    assert speed.shared_table(rows).startswith('|  | one thread [ms] | two threads / one |')


@pytest.mark.reports
def test_quick_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip('mujoco')
    assert speed.main(['--quick', '--out', str(tmp_path)]) == 0
    with (tmp_path / 'speed_cold.csv').open(encoding='utf-8') as file:
        cold = list(csv.DictReader(file))
    assert {row['processor'] for row in cold} == {processor()}
    assert {(row['name'], float(row['megabytes'])) for row in cold} == {
        (name, megabytes) for name in (speed.UNIT, *CORE_MODELS) for megabytes in speed.TOUCHED}
    p50 = {(row['name'], float(row['megabytes'])): float(row['call_p50']) for row in cold}
    for name in CORE_MODELS:  # caches that are cold cost more than they are hot
        assert p50[name, max(speed.TOUCHED)] > 1.5 * p50[name, 0.0] > 0.0
    text = (tmp_path / 'speed.md').read_text('utf-8')
    assert versions(speed.PACKAGES) in text and 'nan' not in text
    assert text in capsys.readouterr().out

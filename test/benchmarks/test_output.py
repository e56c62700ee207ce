# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The output module: tables, CSV files, percentiles, and the machine's description."""
from __future__ import annotations

import argparse
import csv
import math
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from benchmarks import output
from box_contact_ros.core import native

pytestmark = pytest.mark.reports


def test_folders_are_made_before_the_work(tmp_path: Path,
                                          capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing is left in them; a file in the place of one is refused, and kept."""
    parser = argparse.ArgumentParser()
    assert not list(output.make_folder(parser, tmp_path / 'a' / 'b').iterdir())
    (tmp_path / 'file').write_text('mine')
    with pytest.raises(SystemExit, match='2'):
        output.make_folder(parser, tmp_path / 'file')
    assert f'cannot write to {tmp_path}/file (File exists)' in capsys.readouterr().err
    assert (tmp_path / 'file').read_text() == 'mine'


def test_a_table_has_its_words_to_the_left() -> None:
    rows = [['a', 1], ['bcd', 22.5]]
    assert output.markdown_table(['', 'x'], rows) == (
        '|  | x |\n| --- | ---: |\n| a | 1 |\n| bcd | 22.5 |')
    assert output.markdown_table(['', 'x', 'y'], [], words=2).endswith('| --- | --- | ---: |')


def test_a_csv_file_has_the_columns_of_all_rows(tmp_path: Path) -> None:
    output.write_csv(tmp_path / 'x.csv', [
        {'name': 'a, b', 'value': 1 / 3, 'count': 7}, {'name': 'c', 'value': math.nan, 'no': None},
        {'name': 'd', 'value': np.float64(1e-9), 'count': '0.10'}], digits=4)
    with (tmp_path / 'x.csv').open(encoding='utf-8') as file:
        head, *rows = csv.reader(file)
    assert head == ['name', 'value', 'count', 'no']
    assert rows == [['a, b', '0.3333', '7', ''], ['c', '', '', ''], ['d', '1e-09', '0.10', '']]


def test_percentiles() -> None:
    assert output.percentiles(np.arange(101.0), 0, 50, 99, 100) == (0.0, 50.0, 99.0, 100.0)
    assert output.percentiles([3.0], 50) == (3.0,)
    assert all(map(math.isnan, output.percentiles(np.array([]), 50, 99)))


def test_a_machine_names_all_that_a_time_depends_on() -> None:
    found = output.machine(('numpy', 'no-such-package'))
    assert found.instruction_set == native.instruction_set
    assert native.compiler in found.compiler and f'numpy {np.__version__}' in found.versions
    assert all(value and value in str(found) for value in asdict(found).values())
    assert str(output.machine()) == (
        f'{output.processor()}, {found.instruction_set}, {found.compiler}, {output.versions()}')


def test_rows_name_the_machine(tmp_path: Path) -> None:
    """At their end, all its columns."""
    about = output.machine(('numpy',))
    output.write_csv(tmp_path / 'a.csv', [{'x': 1}, {'x': 2}], about=about)
    with (tmp_path / 'a.csv').open() as file:
        rows = list(csv.DictReader(file))
    assert rows == [{'x': x, **asdict(about)} for x in ('1', '2')]

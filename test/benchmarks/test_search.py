# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The search: successive halving, and the program."""
from __future__ import annotations

import csv
from pathlib import Path

import pytest

from benchmarks.paper import search
from benchmarks.paper.search import Candidate

pytestmark = pytest.mark.training
QUICK = ['--quick', '--candidates', '48', '--seed', '2']


def test_the_better_part_goes_on() -> None:
    """Rate 0.3 is number 6, which diverges; 5 and 7 are next; 19, in use, is kept though worst."""
    candidates = [Candidate(k, (4, 4 + k % 3), 0.05 * k, 0.9, 1.0, shipped=k == 19)
                  for k in range(20)]
    scores = {one.number: {'error': float('nan') if one.number == 6 else abs(one.rate - 0.3)}
              for one in candidates}
    kept = search.survivors(candidates, scores, 8)
    assert {one.number for one in kept} == {2, 3, 4, 5, 7, 8, 9, 19}
    assert {one.number for one in search.survivors(kept, scores, 3)} == {5, 7, 19}
    assert search.ranking(candidates, scores)[-1].number == 6


def test_the_program(tmp_path: Path) -> None:
    """The page, table and plot; the same twice."""
    tables = []
    for name in ('once', 'twice'):
        assert search.main([*QUICK, '--out', str(tmp_path / name)]) == 0
        tables.append((tmp_path / name / 'search_paper.csv').read_text('utf-8'))
    assert tables[0] == tables[1]
    rows = list(csv.DictReader(tables[0].splitlines()))
    assert len(rows) == 48
    assert {row['shipped'] for row in rows} == {'True', 'False'}
    assert {int(row['rungs']) for row in rows} == {1, 2}
    assert sorted(path.name for path in (tmp_path / 'once').iterdir()) == [
        'search_paper.csv', 'search_paper.md', 'search_paper.png']
    page = (tmp_path / 'once' / 'search_paper.md').read_text('utf-8')
    assert 'in use' in page and 'nan' not in page


@pytest.mark.parametrize(('arguments', 'message'), [
    (['mlp'], 'unrecognized arguments: mlp'),
    (['--candidates', '3'], '--candidates: must be at least 16, got 3'),
    (['--seed', '-1'], 'must be at least 0, got -1'),
])
def test_refused_arguments(arguments: list[str], message: str,
                           capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        search.main(arguments)
    assert ended.value.code == 2
    assert message in capsys.readouterr().err

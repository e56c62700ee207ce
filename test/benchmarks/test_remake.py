# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""All reports at once: what runs, what failed, and the page of latencies."""
from __future__ import annotations

import csv
from importlib import import_module
from pathlib import Path

import pytest

pytest.importorskip('tqdm')

from benchmarks import compare, latency, output, remake
from benchmarks.output import RESULTS
from benchmarks.remake import REPORTS, Report
from box_contact_ros.cli import PROGRAMS

ROOT = Path(__file__).resolve().parents[2]


def test_every_report_is_a_program() -> None:
    assert {report.arguments[0] for report in REPORTS} <= PROGRAMS.keys()
    assert len({report.name for report in REPORTS}) == len(REPORTS)


@pytest.mark.parametrize('report', REPORTS, ids=lambda report: report.name)
def test_a_program_takes_the_options_of_its_report(report: Report) -> None:
    """Those of a quick run too; `--help` comes last, so each of them is checked before."""
    program = import_module(PROGRAMS[report.arguments[0]].module)
    with pytest.raises(SystemExit) as end:
        program.main([*report.arguments[1:], *report.quick, '--help'])
    assert end.value.code == 0


def test_every_result_has_a_report(tmp_path: Path) -> None:
    """No page of docs/results is written by a hand or by a program that `reports` forgets."""
    programs = {report.arguments[0] for report in REPORTS}
    for page in sorted((ROOT / RESULTS).rglob('*.md')):
        text = page.read_text('utf-8')
        made_by = [name for name in PROGRAMS if f'python -m box_contact_ros {name}' in text]
        assert page.name in ('README.md', 'bench.md') or set(made_by) & {*programs, 'reports'}, page


def test_the_minutes_keep_the_promise() -> None:
    """All reports together take at most 45 minutes on two cores."""
    side_by_side = sum(report.minutes for report in REPORTS if not report.alone) / 2.0
    assert side_by_side + sum(report.minutes for report in REPORTS if report.alone) <= 45.0


def test_a_report_that_fails_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
                                      capsys: pytest.CaptureFixture[str]) -> None:
    """The others run all the same; the status is 1, and the log has the reason."""
    reports = (Report(name='good', minutes=1.0, arguments=('paper', '--help'), quick=()),
               Report(name='bad', minutes=1.0, arguments=('paper', '--table', '9'), quick=(),
                      alone=False))
    monkeypatch.setattr(remake, 'REPORTS', reports)
    assert remake.main(['--out', str(tmp_path)]) == 1
    words = capsys.readouterr().err
    assert 'bad ended with status 2' in words and 'good ended' not in words
    log = Path(words.partition('its output: ')[2].split()[0])
    assert 'invalid choice' in log.read_text()
    assert 'usage: paper' in (log.parent / 'good.log').read_text()
    assert remake.main(['--out', str(tmp_path), '--only', 'good']) == 0


def test_the_committed_page_of_latencies_is_that_of_the_tables() -> None:
    assert (ROOT / RESULTS / 'latency.md').read_text('utf-8') == latency.page(ROOT / RESULTS)


def test_latencies_are_medians_over_streams(tmp_path: Path) -> None:
    """Of 100, 300 and 200 µs the median is 200."""
    folder = tmp_path / 'bench' / '1000-in-turn'
    folder.mkdir(parents=True)
    with (folder / 'bench.csv').open('w', newline='') as file:
        write = csv.writer(file)
        write.writerow(['node', 'sent', 'lost', 'latency_p50 [s]', 'latency_p99 [s]', 'machine'])
        for p50 in (1e-4, 3e-4, 2e-4):
            write.writerow(['contact', 1000, 0, p50, 1e-3, 'here'])
        write.writerow(['echo', 1000, 1, 1e-4, 4e-4, 'here'])
    page = latency.page(tmp_path)
    assert '| contact node | node alone, 1 kHz | 3,000 | 0 | 200 | 1,000 |' in page
    assert '| echo node | node alone, 1 kHz | 1,000 | 1 | 100 | 400 |' in page
    assert 'ran on: here' in page


def _second_run(folder: Path, exact: float, rival: float) -> Path:
    """Write the CSV of a made-up run: times of two contestants and of the unit [ns]."""
    folder.mkdir()
    times = {'exact': exact, 'rival': rival, compare.UNIT: 3000.0}
    output.write_csv(folder / 'speed.csv', [
        {'name': name, 'kind': 'single', 'instruction_set': 'AVX2', 'round': number,
         'ns': value * disturbed}
        for name, value in times.items() for number, disturbed in enumerate((1.0, 0.99, 7.0))])
    return folder


@pytest.mark.parametrize(('faster', 'rival', 'status'), [
    (1.0, 6000.0, 0), (1.0, 6500.0, 0), (1.0, 6700.0, 1), (1.0, 5400.0, 1), (2.0, 6000.0, 1)])
def test_a_second_run_changes_no_ratio_by_more_than_a_tenth(
        tmp_path: Path, capsys: pytest.CaptureFixture[str], faster: float, rival: float,
        status: int) -> None:
    """Of three rounds one was disturbed: the median is compared, by that of the unit."""
    first = _second_run(tmp_path / 'first', 1300.0, 6000.0)
    second = _second_run(tmp_path / 'second', 1300.0 / faster, rival)
    assert remake.main(['--compare', str(first), '--out', str(second)]) == status
    words = capsys.readouterr().out
    largest = words.splitlines()[2]
    assert ('exact' if faster > 1.0 else 'rival' if rival != 6000.0 else '0.0') in largest
    assert f'2 ratios, {status} changed by more than 10 %; 0 in one folder alone' in words


def test_runs_without_a_ratio_in_common_do_not_agree(tmp_path: Path) -> None:
    assert compare.compare(tmp_path, _second_run(tmp_path / 'one', 1300.0, 6000.0)) == 1


def test_every_committed_csv_of_times_is_compared() -> None:
    """A file or column that is renamed would drop out unseen."""
    found = compare.ratios_of(ROOT / RESULTS)
    for printed in compare.PRINTED:
        assert any(name.startswith(printed.files.partition('*')[0])
                   and name.endswith(f'{(*printed.times, *printed.ratios)[-1]}, by {printed.by[0]}')
                   for name in found), printed

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Program `reports`: remake every table and picture of docs/results.

Each report is a program of its own, and runs as a subprocess. Programs that measure time run alone;
the others share the cores. The exit status is 1 if a program failed or a limit was broken.

`--compare DIR` runs nothing, and compares the ratios of times in DIR with those in the folder of
results. The exit status is 1 if a ratio changed by more than 10 %.
"""
from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from box_contact_ros.solver.arguments import program_parser

from . import latency
from .compare import compare
from .output import results_folder

OUT = '{out}'  # stands for the folder of the results


@dataclass(frozen=True, kw_only=True)
class Report:
    """One run of a program."""

    name: str
    arguments: tuple[str, ...]  # the program, and what it is given
    minutes: float  # on two cores, for the progress bar
    alone: bool = True  # whether it measures time or takes all cores
    quick: tuple[str, ...] = ('--quick',)  # what a quick run adds


def _bench(rate: int, seconds: int, *words: str) -> Report:
    kind = 'side-by-side' if words else 'in-turn'
    return Report(name=f'bench-{rate}-{kind}', minutes=1.3 * seconds / 60.0, arguments=(
        'bench', '--rate', str(rate), '--duration', str(seconds), *words,
        '--out', f'{OUT}/bench/{rate}-{kind}'))


REPORTS = (
    Report(name='search-paper', minutes=6.0, alone=False,
           arguments=('search', 'paper', '--out', OUT)),
    Report(name='accuracy', minutes=0.5, alone=False, arguments=('accuracy', '--out', OUT)),
    Report(name='stability', minutes=0.6, alone=False, arguments=('stability', '--out', OUT),
           quick=('--families', 'a1_tilted_faces')),
    Report(name='named', minutes=0.4, alone=False, arguments=('stability', '--named'), quick=(
        '--out', OUT)),
    Report(name='fuzz', minutes=2.5, arguments=(
        'fuzz', '--pairs', '5000000', '--out', f'{OUT}/fuzz.csv')),
    Report(name='landing', minutes=10.0, arguments=('landing', '--out', OUT)),
    Report(name='rest', minutes=4.5, arguments=('rest', '--out', OUT)),
    Report(name='frontier', minutes=7.0, arguments=('frontier', '--out', OUT)),
    Report(name='native', minutes=1.3, arguments=('frontier', '--native', '--out', OUT)),
    Report(name='speed', minutes=2.5, arguments=('frontier', '--speed', '--out', OUT)),
    Report(name='paper', minutes=5.0, arguments=('paper', '--out', f'{OUT}/paper_tables.md')),
    _bench(200, 30, '--side-by-side'), _bench(1000, 30, '--side-by-side'), _bench(1000, 90),
    Report(name='soak', minutes=2.0, arguments=(
        'bench', '--soak', '--duration', '60', '--out', OUT)),
)
"""In the order in which they run; the page of latencies follows the last."""


def run(report: Report, folder: Path, log: Path, *, quick: bool) -> tuple[Report, int]:
    """Run a report, its output in a log file; return it with its exit status."""
    words = [word.replace(OUT, str(folder))
             for word in (*report.arguments, *(report.quick if quick else ()))]
    with log.open('w') as output:
        done = subprocess.run([sys.executable, '-m', 'box_contact_ros', *words], stdout=output,
                              stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, check=False)
    return report, done.returncode


def run_all(reports: Sequence[Report], folder: Path, *, quick: bool) -> list[Report]:
    """Run reports with a progress bar; return those that failed."""
    from tqdm import tqdm

    logs = Path(tempfile.mkdtemp(prefix='reports-'))
    log_of = {report: logs / f'{report.name}.log' for report in reports}
    failed = []
    with tqdm(total=round(sum(report.minutes for report in reports), 1), unit='min',
              bar_format='{l_bar}{bar}| {n:.0f} of {total:.0f} min [{elapsed}]') as bar:
        for alone in (False, True):
            workers = 1 if alone else os.cpu_count()
            chosen = [report for report in reports if report.alone == alone]
            with ThreadPoolExecutor(workers) as pool:
                runs = [pool.submit(run, report, folder, log_of[report], quick=quick)
                        for report in chosen]
                for done in as_completed(runs):
                    report, status = done.result()
                    bar.set_description(report.name)
                    bar.update(report.minutes)
                    if status:
                        failed.append(report)
                        bar.write(f'reports: {report.name} ended with status {status}; its output: '
                                  f'{log_of[report]}', file=sys.stderr)
    return failed


def main(args: Sequence[str] | None = None) -> int:
    """Remake the reports that are asked for."""
    names = [report.name for report in REPORTS]
    parser = program_parser('reports', __doc__, quick='a few poses for each report, to try it out',
                            out='all pages, tables and pictures')
    parser.add_argument('--only', nargs='+', choices=names, metavar='REPORT', default=names,
                        help=f'of: {", ".join(names)} (default: all)')
    parser.add_argument('--compare', type=Path, metavar='DIR',
                        help='compare the ratios of another run, and run nothing')
    options = parser.parse_args(args)
    folder = results_folder(parser, options)
    if options.compare:
        return compare(options.compare, folder)
    failed = run_all([report for report in REPORTS if report.name in options.only], folder,
                     quick=options.quick)
    latency.write_page(folder)
    return 1 if failed else 0

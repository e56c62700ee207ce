# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Drops, light contacts, slopes, pushes, spins and stacks, by held patches and by MuJoCo's contact.

The result of every case is stated beforehand. A case runs at rates of 50 to 1,000 Hz and latencies
of 0 to 5 ms, in a small simulator on MuJoCo. The same boxes also run with MuJoCo's own contact. The
program writes rest.csv (a row per run and figure) and rest.md (a table). The exit status is 1 if
`exact` or `mlp` misses a limit.
"""
from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Sequence
from dataclasses import asdict
from multiprocessing import Pool
from typing import NamedTuple

from box_contact_ros.core import native
from box_contact_ros.node.processes import left_when_asked
from box_contact_ros.solver.arguments import program_parser

from .. import output
from .rest_cases import CASES, Gate, RestCase
from .simulator import Timing, held_patch, own_contact

TIMINGS = (*(Timing(rate, latency) for rate in (50.0, 100.0, 200.0, 1000.0)
             for latency in (0.0, 0.002, 0.005)),
           Timing(200.0, 0.005, jitter=0.002), Timing(1000.0, 0.002, jitter=0.002),
           Timing(1000.0, 0.0, step=0.0005))
SOME_TIMINGS = (Timing(50.0, 0.005), Timing(200.0, 0.002), Timing(200.0, 0.005, jitter=0.002),
                Timing(1000.0, 0.0))
TIMINGS_OF = {'exact': TIMINGS, 'mlp': SOME_TIMINGS}
"""By model: at which timings it runs."""
OWN = 'MuJoCo'
OWN_STEP = Timing(0.0, 0.0)
QUICK = 6
"""`--quick` runs every so-many-th case, at `SOME_TIMINGS`."""
PACKAGES = ('numpy', 'mujoco')  # whose versions are named


class Run(NamedTuple):
    """A case, and by what it is run: a model, or MuJoCo's own contact."""

    case: str
    way: str
    timing: Timing


class Figure(NamedTuple):
    """What a gate measured in a run."""

    run: Run
    gate: Gate
    value: float

    @property
    def limit(self) -> float:
        """Return the most that it may be."""
        return self.gate.limit_at(self.run.timing.rate_hz)

    @property
    def is_met(self) -> bool:
        """Whether it is within its limit."""
        return self.value <= self.limit

    @property
    def excess(self) -> float:
        """Return the figure divided by its limit; infinite for NaN."""
        return math.inf if math.isnan(self.value) else self.value / self.limit


def measured(run: Run) -> list[Figure]:
    """Run a case and measure all of its gates."""
    case = CASES[run.case]
    log = (own_contact(case.setup, run.timing.step) if run.way == OWN else
           held_patch(case.setup, run.timing, run.way))
    return [Figure(run, gate, gate.measure(log)) for gate in case.gates]


def runs_of(cases: Sequence[RestCase], *, quick: bool = False) -> list[Run]:
    """Return all runs of a sweep."""
    return [run for case in cases for run in (
        Run(case.name, OWN, OWN_STEP),
        *(Run(case.name, model, timing) for model, timings in TIMINGS_OF.items()
          for timing in (SOME_TIMINGS if quick else timings)))]


def csv_row(figure: Figure) -> dict[str, object]:
    """Return a figure with all that it was measured in; SI units but for the figure's own."""
    timing, case = figure.run.timing, CASES[figure.run.case]
    loop = asdict(timing) if figure.run.way != OWN else {'step': timing.step}
    return {'way': figure.run.way, 'kind': case.kind, 'case': case.name, **loop,
            'figure': figure.gate.name, 'value': figure.value, 'limit': figure.limit,
            'is_met': int(figure.is_met)}


def shown(value: float) -> str:
    """Return a figure for the table."""
    return '–' if math.isnan(value) else f'{value:.2g}'


def table(figures: Sequence[Figure]) -> str:
    """Return a row per case and gate: how many runs met it, the worst of each way."""
    rows = []
    for case in dict.fromkeys(figure.run.case for figure in figures):
        for gate in CASES[case].gates:
            ours = [one for one in figures if one.run.case == case and one.gate.name == gate.name]
            worst = {way: max((one for one in ours if one.run.way == way),
                              key=lambda one: one.excess) for way in (*TIMINGS_OF, OWN)}
            gated = [one for one in ours if one.run.way != OWN]
            met = sum(one.is_met for one in gated)
            head = [case, CASES[case].expected] if gate is CASES[case].gates[0] else ['', '']
            rows.append([*head, gate.name, ' / '.join(f'{limit:g}' for limit in gate.limits),
                         f'{met} of {len(gated)}' if met == len(gated) else
                         f'**{met} of {len(gated)}**',
                         *(f'{shown(one.value)}' for one in worst.values()),
                         str(worst['exact'].run.timing)])
    return output.markdown_table(
        ['case', 'expected', 'figure', 'limit', 'met', '`exact`, worst', '`mlp`, worst',
         "MuJoCo's contact", 'worst of `exact` at'], rows, words=3)


def broken(figures: Sequence[Figure]) -> list[Figure]:
    """Return the figures by held patches that are beyond their limits."""
    return [one for one in figures if one.run.way != OWN and not one.is_met]


def page(figures: Sequence[Figure], command: str) -> str:
    """Return the Markdown page."""
    gated = [one for one in figures if one.run.way != OWN]
    own = [one for one in figures if one.run.way == OWN]
    return output.page(
        'benchmarks/pages/rest', command=command, machine=output.machine(native, PACKAGES),
        met=len(gated) - len(broken(figures)), all=len(gated),
        own_met=sum(one.is_met for one in own), own_all=len(own),
        timings=output.markdown_table(['model', 'runs at'], [
            [f'`{model}`', '; '.join(map(str, timings))] for model, timings in TIMINGS_OF.items()],
            words=2), table=table(figures))


def main(args: Sequence[str] | None = None) -> int:
    """Run the sweep and write its files; 1 if a limit is missed."""
    parser = program_parser('rest', __doc__, out='the page and its table',
                            quick=f'every {QUICK}th case, at {len(SOME_TIMINGS)} timings',
                            )
    kinds = list(dict.fromkeys(case.kind for case in CASES.values()))
    parser.add_argument('--kinds', nargs='+', choices=kinds, metavar='KIND', default=kinds,
                        help=f'cases to run, of {", ".join(kinds)} (default: all)')
    parser.add_argument('--workers', type=int, default=os.cpu_count(), help='processes at once')
    options: argparse.Namespace = parser.parse_args(args)
    folder = output.results_folder(parser, options)
    cases = [case for case in CASES.values() if case.kind in options.kinds]
    runs = runs_of(cases[::QUICK] if options.quick else cases, quick=options.quick)
    from tqdm import tqdm

    with left_when_asked(), Pool(options.workers) as pool:
        figures = [figure for found in tqdm(pool.imap(measured, runs), total=len(runs),
                                            desc='rest', unit='') for figure in found]
    output.write_csv(folder / 'rest.csv', map(csv_row, figures), digits=3,
                     about=output.machine(native, PACKAGES))
    (folder / 'rest.md').write_text(
        page(figures, output.command_line('box_contact_ros rest', args)), encoding='utf-8')
    print(table(figures))
    for one in broken(figures):
        print(f'rest: {one.run.way} at {one.run.timing}, {one.run.case}: {one.gate.name} is '
              f'{one.value:.2g}, not {one.limit:g}', file=sys.stderr)
    return 1 if broken(figures) else 0

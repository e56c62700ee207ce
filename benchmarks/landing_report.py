# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Landings by the way of contact and force: whether the container comes to rest, and how flat.

It runs a grid of 36 landings by every way (some by a sample), rate and latency. It also lands other
loads and stacks, with an outcome that is stated beforehand (`landing_ways`). It writes landing.csv
(a row per landing), landing.md (tables) and landing.png (one landing, four ways). The exit status
is 1 if held patches of `exact` or `mlp` do not do all that is expected.
"""
from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from itertools import groupby
from multiprocessing import Pool
from pathlib import Path
from typing import NamedTuple

from box_contact_ros.core import native
from box_contact_ros.demo.landing import LandingRecord, LandingResult, scenario_of
from box_contact_ros.demo.mujoco_crane import CraneScenario
from box_contact_ros.node.processes import left_when_asked
from box_contact_ros.solver.arguments import program_parser

from . import output
from .landing_picture import draw
from .landing_ways import ADDED, WAYS, HeldLimits, LoopTiming, PlannedLanding, grid

QUICK = 10
"""`--quick` runs every tenth landing of the grid, and every third of the added ones."""
SHOWN = 17
"""The landing that is drawn: sway of 1.25°, tilt of 3°, 0.6 m of overhang."""
PACKAGES = ('numpy', 'mujoco')  # whose versions are named
GATED = ('exact', 'mlp')
"""Ways that have to do all that is expected."""


class Landing(NamedTuple):
    """One landing to run."""

    way: str
    timing: LoopTiming
    planned: PlannedLanding
    scenario: CraneScenario


class Landed(NamedTuple):
    """One landing that was run."""

    landing: Landing
    result: LandingResult

    @property
    def as_expected(self) -> bool:
        """Whether the load did what it was expected to do; by held patches, within their limits."""
        held = self.landing.way in GATED and self.of_grid
        return self.landing.planned.as_expected(self.result) and (
            not held or HeldLimits.at(self.landing.timing.rate_hz).are_met(self.result))

    @property
    def of_grid(self) -> bool:
        """Whether it is a landing of the grid."""
        return self.landing.planned.name.startswith('grid')


def aimed(planned: PlannedLanding) -> CraneScenario:
    """Return the scenario of a landing."""
    return scenario_of(planned.case, **planned.fields)


def run(landing: Landing) -> Landed:
    """Run and judge one landing."""
    return judged(landing, WAYS[landing.way].fly(landing.scenario, landing.timing))


def judged(landing: Landing, record: LandingRecord) -> Landed:
    """Judge one landing by its own limit of the tilt."""
    return Landed(landing, record.judge(tilt_limit=landing.planned.tilt_limit))


def landings_of(ways: Sequence[str], timings: Sequence[LoopTiming],
                of_grid: Sequence[PlannedLanding], added: Sequence[PlannedLanding],
                scenarios: dict[str, CraneScenario], *, step: int = 1) -> Iterator[Landing]:
    """Yield the landings of a sweep; `of_grid` has one of `step` of the grid."""
    for name in ways:
        way = WAYS[name]
        for timing in way.timings(timings):
            for planned in [*of_grid[::max(1, way.every // step)], *(added if way.added else ())]:
                yield Landing(name, timing, planned, scenarios[planned.name])


def csv_row(landed: Landed) -> dict[str, object]:
    """Return what was run, whether it did what was expected, and every figure.

    SI units; angles of cases in degrees, their columns begin with case_.
    """
    (way, timing, planned, _), result = landed
    return {'way': way, 'law': WAYS[way].law, 'contacts': WAYS[way].contacts,
            **timing._asdict(), 'landing': planned.name,
            **{f'case_{name}': value for name, value in asdict(planned.case).items()},
            'at_rest': int(result.at_rest), 'as_expected': int(landed.as_expected),
            **asdict(result)}


SHOWN_WORST = {
    'settled [s]': ('settled', 1.0), 'corner [mm/s]': ('corner_speed', 1e3),
    'creep [mm/s]': ('creep', 1e3), 'force [of weight]': ('force_worst', 1.0),
    'static tilt [°]': ('static_tilt', 180.0 / math.pi), 'depth [%]': ('depth', 100.0),
    'gap [mm]': ('gap', 1e3), 'point step [mm]': ('point_step', 1e3)}
"""By column: a figure of `LandingResult`, whose worst value the table shows, and its factor."""


def worst(results: Sequence[LandingResult], name: str, factor: float) -> str:
    """Return the worst value of a figure for the table."""
    values = [getattr(result, name) for result in results]
    if any(map(math.isnan, values)):
        # What was never reached has no worst; the word is clearer than a NaN.
        return 'never' if name == 'settled' else '–'
    return f'{factor * max(values):.2g}'


def grid_table(results: Sequence[Landed]) -> str:
    """Return a row per way, rate and latency: how many rest, and the worst of each figure."""
    rows = []
    of_grid = [one for one in results if one.of_grid]
    for (name, timing), group in groupby(of_grid, key=lambda one: one.landing[:2]):
        way, found = WAYS[name], [one.result for one in group]
        settle = sum(not math.isnan(result.settled) for result in found)
        rows.append([way.law, way.contacts,
                     *((f'{timing.rate_hz:g}', f'{1e3 * timing.latency:g}') if way.timed
                       else ('–', '–')), f'{settle} of {len(found)}',
                     f'{sum(result.at_rest for result in found)} of {len(found)}',
                     *(worst(found, *shown) for shown in SHOWN_WORST.values())])
    return output.markdown_table(['law', 'contacts', 'rate [Hz]', 'latency [ms]', 'settle',
                                  'at rest', *SHOWN_WORST], rows, words=2)


def added_table(results: Sequence[Landed]) -> str:
    """Return a row per added landing: what was expected, and what each way did."""
    ways = [name for name in WAYS if WAYS[name].added
            and any(one.landing.way == name for one in results)]
    shown = {'corner_speed': 1e3, 'static_tilt': 180.0 / math.pi, 'depth': 100.0}
    added = {one.landing.planned.name: one.landing.planned for one in results
             if not one.of_grid}
    rows = []
    for name, planned in added.items():
        row = [name, 'falls' if planned.falls else
               f'rests, tilt ≤ {math.degrees(planned.tilt_limit):.2g}°']
        for way in ways:
            found = [one for one in results
                     if (one.landing.way, one.landing.planned.name) == (way, name)]
            row.append(f'{sum(one.as_expected for one in found)} of {len(found)}')
            row.append('' if planned.falls else ' / '.join(
                worst([one.result for one in found], *figure) for figure in shown.items()))
        rows.append(row)
    head = [cell for name in ways for cell in (WAYS[name].contacts, 'corner / tilt / depth')]
    return output.markdown_table(['landing', 'expected', *head], rows, words=2)


COMPARED = {'corner [mm/s]': ('corner_speed', 1e3), 'creep [mm/s]': ('creep', 1e3),
            'static tilt [°]': ('static_tilt', 180.0 / math.pi), 'depth [%]': ('depth', 100.0),
            'settled [s]': ('settled', 1.0), 'force off the weight': ('force_worst', 1.0),
            'gap [mm]': ('gap', 1e3)}
"""By column, as SHOWN_WORST: where held patches are compared with MuJoCo's manifold."""


def against_manifold(results: Sequence[Landed]) -> str:
    """Return a row per rate and latency of held patches, and MuJoCo's manifold below.

    Figures that are worse than the manifold's are bold.
    """
    of_grid = [one for one in results if one.of_grid]
    manifold = [one.result for one in of_grid if one.landing.way == 'manifold']
    rows = []
    for (way, timing), group in groupby(of_grid, key=lambda one: one.landing[:2]):
        if way not in (GATED[0], 'manifold'):
            continue
        found = list(group)
        cells = [worst([one.result for one in found], *shown) for shown in COMPARED.values()]
        names = ("MuJoCo's manifold", '') if way == 'manifold' else (
            f'{timing.rate_hz:g}', f'{1e3 * timing.latency:g}')
        for place, (name, _) in enumerate(COMPARED.values()):
            if manifold and max(getattr(one.result, name) for one in found) > max(
                    getattr(result, name) for result in manifold):
                cells[place] = f'**{cells[place]}**'
        limit = math.degrees(HeldLimits.at(timing.rate_hz).static_tilt)
        rows.append([*names, f'{sum(one.as_expected for one in found)} of {len(found)}', *cells,
                     '' if way == 'manifold' else f'{limit:g}'])
    return output.markdown_table(['rate [Hz]', 'latency [ms]', 'within limits', *COMPARED,
                                  'limit of the tilt [°]'], rows)


def missed(gated: Sequence[Landed]) -> str:
    """Return a line per model, rate and latency that missed a goal: how often."""
    lines = [f'- goal missed: `{way}` at {timing.rate_hz:g} Hz and {1e3 * timing.latency:g} ms, in '
             f'{count} of {len(found)} landings'
             for (way, timing), found in ((key, list(group)) for key, group in groupby(
                 gated, key=lambda one: one.landing[:2]))
             if (count := sum(not one.as_expected for one in found))]
    return '\n'.join(lines) or 'No goal was missed.'


def page(results: Sequence[Landed], command: str) -> str:
    """Return the Markdown page."""
    gated = [one for one in results if one.landing.way in GATED]
    values = {'command': command, 'machine': output.machine(native, PACKAGES), 'all': len(gated),
              'good': sum(one.as_expected for one in gated), 'grid': grid_table(results),
              'added': added_table(results), 'missed': missed(gated)}
    return output.page('benchmarks/pages/landing',
                       against=against_manifold(results), **values)


def main(args: Sequence[str] | None = None) -> int:
    """Run the sweep and write its files; 1 if a gated way fails an expectation."""
    options, folder = _options(args)
    from tqdm import tqdm

    step = QUICK if options.quick else 1
    of_grid, added = grid(options.seed)[::step], ADDED[::3] if step > 1 else ADDED
    timings = [LoopTiming(rate, latency) for rate in options.rates for latency in options.latency]
    everything = [*of_grid, *added]
    with left_when_asked(), Pool(options.workers) as pool:
        scenarios = dict(zip([one.name for one in everything], tqdm(
            pool.imap(aimed, everything), total=len(everything), desc='aiming', unit='')))
        landings = list(landings_of(options.ways, timings, of_grid, added, scenarios, step=step))
        results = list(tqdm(pool.imap(run, landings), total=len(landings), desc='landings',
                            unit=''))
    draw(folder / 'landing.png', scenarios[of_grid[-1].name] if options.quick else
         scenarios[f'grid {SHOWN}'])
    output.write_csv(folder / 'landing.csv', map(csv_row, results),
                     about=output.machine(native, PACKAGES))
    command = output.command_line('box_contact_ros landing', args)
    (folder / 'landing.md').write_text(page(results, command), encoding='utf-8')
    print(f'{grid_table(results)}\n\n{added_table(results)}')
    broken = [one for one in results if one.landing.way in GATED and not one.as_expected]
    for one in broken:
        print(f'landing: {one.landing.way} at {one.landing.timing.rate_hz:g} Hz, '
              f'{one.landing.planned.name}: not as expected', file=sys.stderr)
    return 1 if broken else 0


def _options(args: Sequence[str] | None) -> tuple[argparse.Namespace, Path]:
    parser = program_parser(
        'landing', __doc__, seed=1, out='pages, tables and the picture',
        quick=f'every {QUICK}th landing of the grid, every third of the others')
    parser.add_argument('--ways', nargs='+', choices=list(WAYS), default=list(WAYS),
                        metavar='WAY', help=f'ways to land, of {", ".join(WAYS)} (default: all)')
    parser.add_argument('--rates', nargs='+', type=float, default=[50.0, 200.0, 1000.0],
                        metavar='HZ', help='ticks per second, default: %(default)s')
    parser.add_argument('--latency', nargs='+', type=float, default=[0.0, 0.002, 0.005],
                        metavar='S', help='times from asking to acting [s], default: %(default)s')
    parser.add_argument('--workers', type=int, default=os.cpu_count(), help='processes at once')
    options = parser.parse_args(args)
    return options, output.results_folder(parser, options)

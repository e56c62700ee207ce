# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Landings by the way of contact: whether the container comes to rest, and how flat.

It runs a grid of 36 landings by every way (some by a sample), rate and latency. It also lands other
loads and stacks, with an expected outcome (`landing_ways`). It writes landing.csv (a row per
landing), landing.md (tables) and landing.png (one landing, several ways). The exit status is 1
if patches of `exact`, the default, do not do all that is expected. Misses of other models are
printed and counted on the page.
"""
from __future__ import annotations

import math
import sys
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from itertools import groupby, product
from pathlib import Path
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from box_contact_ros.demo.crane import CraneScenario
from box_contact_ros.demo.landing import CORNER_SPEED_LIMIT

from . import output
from .landing_ways import (
    ADDED,
    WAYS,
    HeldLimits,
    Landed,
    LoopTiming,
    PlannedLanding,
    aimed,
    grid,
)

TIMINGS = [LoopTiming(*timing) for timing in product((50.0, 200.0, 1000.0), (0.0, 0.002, 0.005))]
QUICK = 10
"""`--quick` runs every tenth landing of the grid, and every third of the added ones."""
SHOWN = 17
"""The landing that is drawn: sway of 1.25°, tilt of 3°, 0.6 m of overhang."""
PACKAGES = ('numpy', 'mujoco')  # whose versions are named
PATCHES = tuple(name for name, way in WAYS.items() if way.model)
"""Ways that have the limits of patches on the grid."""
GATED = 'exact'
"""The way that has to do all that is expected: the default model."""


class Outcome(NamedTuple):
    """One landing that was run."""

    way: str
    timing: LoopTiming
    planned: PlannedLanding
    result: Landed

    @property
    def as_expected(self) -> bool:
        """Return whether the load did what it was expected to do; patches have own limits."""
        held = self.way in PATCHES and self.planned.of_grid
        sinking = self.result.touch_speed / self.planned.scenario.size[2]
        return self.planned.as_expected(self.result) and (
            not held or HeldLimits.at(self.timing, sinking).are_met(self.result))


def run(way: str, timing: LoopTiming, planned: PlannedLanding) -> Outcome:
    """Run and judge one landing, by its own limit of the tilt."""
    record = WAYS[way].run(planned.scenario, timing)
    return Outcome(way, timing, planned, Landed.of(record, planned.tilt_limit))


def landings(ways: Sequence[str], timings: Sequence[LoopTiming], planned: Sequence[PlannedLanding],
             *, step: int = 1) -> Iterator[tuple[str, LoopTiming, PlannedLanding]]:
    """Yield the landings of a sweep; `planned` has one of `step` of the grid."""
    of_grid = [landing for landing in planned if landing.of_grid]
    added = [landing for landing in planned if not landing.of_grid]
    for name in ways:
        way = WAYS[name]
        for timing in way.timings(timings):
            for landing in [*of_grid[::max(1, way.every // step)], *added]:
                if way.lands(landing.scenario):
                    yield name, timing, landing


def csv_row(outcome: Outcome) -> dict[str, object]:
    """Return what was run, whether it did what was expected, and every figure.

    SI units; angles of scenarios in degrees, their columns begin with case_.
    """
    way, timing, planned, result = outcome
    return {'way': way, 'contacts': WAYS[way].contacts, **timing._asdict(),
            'landing': planned.name,
            **{f'case_{name}': value for name, value in asdict(planned.scenario).items()},
            'at_rest': int(result.at_rest), 'as_expected': int(outcome.as_expected),
            **asdict(result)}


# --- tables ---------------------------------------------------------------------------------------

SHOWN_WORST = {
    'settled [s]': ('settled', 1.0), 'corner [mm/s]': ('corner_speed', 1e3),
    'creep [mm/s]': ('creep', 1e3), 'force [of weight]': ('force_worst', 1.0),
    'static tilt [°]': ('static_tilt', 180.0 / math.pi), 'depth [%]': ('depth', 100.0),
    'gap [mm]': ('gap', 1e3), 'point step [mm]': ('point_step', 1e3)}
"""By column: a figure of `Landed`, whose worst value the table shows, and its factor."""


def worst(results: Sequence[Landed], name: str, factor: float) -> str:
    """Return the worst value of a figure for the table."""
    values = [getattr(result, name) for result in results]
    if any(map(math.isnan, values)):
        # What was never reached has no worst; the word is clearer than a NaN.
        return 'never' if name == 'settled' else '–'
    return f'{factor * max(values):.2g}'


def share(verdicts: Iterable[bool]) -> str:
    """Return how many landings did something, and how many there are."""
    listed = list(verdicts)
    return f'{sum(listed)}/{len(listed)}'


def grid_table(outcomes: Sequence[Outcome]) -> str:
    """Return a row per way, rate and latency: how many rest, and the worst of each figure.

    Of patches, figures that are worse than those of MuJoCo's manifold are bold.
    """
    of_grid = [outcome for outcome in outcomes if outcome.planned.of_grid]
    manifold = [outcome.result for outcome in of_grid if outcome.way == 'manifold']
    rows = []
    for (name, timing), group in groupby(of_grid, key=lambda outcome: outcome[:2]):
        way, landed = WAYS[name], list(group)
        results = [outcome.result for outcome in landed]
        figures = []
        for figure, factor in SHOWN_WORST.values():
            text = worst(results, figure, factor)
            is_worse = name in PATCHES and manifold and max(
                getattr(result, figure) for result in results) > max(
                getattr(result, figure) for result in manifold)
            figures.append(f'**{text}**' if is_worse else text)
        rows.append([way.contacts,
                     *((f'{timing.rate_hz:g}', f'{1e3 * timing.latency:g}') if way.model
                       else ('–', '–')),
                     share(result.at_rest for result in results),
                     share(outcome.as_expected for outcome in landed)
                     if name in PATCHES else '–', *figures])
    return output.markdown_table(['contacts', 'rate [Hz]', 'latency [ms]', 'at rest',
                                  'within limits', *SHOWN_WORST], rows)


def added_table(outcomes: Sequence[Outcome]) -> str:
    """Return a row per added landing: what was expected, and what each way did; a dash: not run."""
    ways = [name for name in WAYS if any(outcome.way == name for outcome in outcomes)]
    shown = {'corner_speed': 1e3, 'static_tilt': 180.0 / math.pi, 'depth': 100.0}
    added = {outcome.planned.name: outcome.planned for outcome in outcomes
             if not outcome.planned.of_grid}
    rows = []
    for name, planned in added.items():
        row = [name, 'falls' if planned.falls else
               f'rests, tilt ≤ {math.degrees(planned.tilt_limit):.2g}°']
        for way in ways:
            landed = [outcome for outcome in outcomes
                      if (outcome.way, outcome.planned.name) == (way, name)]
            row.append(share(outcome.as_expected for outcome in landed) if landed else '–')
            row.append('' if planned.falls or not landed else ', '.join(
                worst([outcome.result for outcome in landed], *figure)
                for figure in shown.items()))
        rows.append(row)
    head = [cell for name in ways for cell in (WAYS[name].contacts, 'corner, tilt, depth')]
    return output.markdown_table(['landing', 'expected', *head], rows, words=2)


# --- picture --------------------------------------------------------------------------------------

DRAWN = {
    ('exact', 50.0): ('one patch, at 50 Hz', '#9ecae1', '-'),
    ('exact', 200.0): ('one patch, at 200 Hz', '#4292c6', '-'),
    ('exact', 1000.0): ('one patch, at 1000 Hz', '#084594', '-'),
    ('manifold', 1000.0): ("MuJoCo's manifold, at each step", output.COLOURS['MuJoCo'], '--')}
"""Ways and rates [Hz] of the picture: names, colours and styles of their curves."""
QUICK_TIMING = LoopTiming(200.0, 0.002)
LATENCY = 0.002  # of the answers in the picture [s]
TIMES, SPEEDS = (-1.0, 6.0), (1e-7, 3e3)
"""Times after the touch [s] and speeds [mm/s] that are drawn; slower ones are at the edge."""


def draw(path: Path, scenario: CraneScenario) -> None:
    """Draw the speed of the load's fastest corner in one landing, by ways and rates."""
    figure, axes = output.subplots(1, 1, (6.4, 3.6))
    axis, limit = axes[0, 0], 1e3 * CORNER_SPEED_LIMIT
    axis.axhspan(SPEEDS[0], limit, color='0.93', zorder=0)
    axis.text(TIMES[1] - 0.1, 0.6 * limit, f'at rest: below {limit:g} mm/s', ha='right', va='top',
              fontsize=9, color='0.35')
    settled = []
    for (way, rate_hz), (name, colour, style) in DRAWN.items():
        record = WAYS[way].run(scenario, LoopTiming(rate_hz, LATENCY))
        result = record.judge()
        time = np.arange(len(record.poses)) / record.rate_hz - result.touched
        shown = (time > TIMES[0]) & (time < TIMES[1])
        axis.semilogy(time[shown], np.maximum(1e3 * record.corner_speeds()[shown], SPEEDS[0]),
                      style, color=colour, linewidth=1.2, label=name)
        settled.append(result.settled)
    slowest = max(settled, key=lambda time: math.inf if math.isnan(time) else time)
    axis.set(xlim=TIMES, ylim=SPEEDS, xlabel='time after the first touch [s]',
             ylabel='fastest corner of the load [mm/s]', title='A container lands: ' + (
                 'not every way settles' if math.isnan(slowest) else
                 f'all ways settle within {slowest:.1f} s'))
    axis.grid(color='0.9', linewidth=0.5)
    axis.set_axisbelow(True)
    axis.legend(fontsize=9, loc='upper right')
    figure.savefig(path, metadata={'Software': None})


# --- program --------------------------------------------------------------------------------------

def main(args: Sequence[str] | None = None) -> int:
    """Run the sweep and write its files; 1 if `GATED` fails an expectation."""
    parser = output.report_parser(
        'landing', __doc__, out='page, table and picture',
        quick=f'every {QUICK}th landing of the grid, every third of the others, at 200 Hz and 2 ms')
    parser.add_argument('--ways', nargs='+', choices=list(WAYS), default=list(WAYS),
                        metavar='WAY', help=f'ways to land, of {", ".join(WAYS)} (default: all)')
    options = parser.parse_args(args)
    folder = output.results_folder(parser, options)
    step, timings = (QUICK, [QUICK_TIMING]) if options.quick else (1, TIMINGS)
    planned = [*grid()[SHOWN % step::step], *(ADDED[::3] if options.quick else ADDED)]
    with ProcessPoolExecutor() as pool:
        planned = list(tqdm(pool.map(aimed, planned), 'aiming', len(planned), unit=''))
        jobs = list(landings(options.ways, timings, planned, step=step))
        results = [pool.submit(run, *job) for job in jobs]
        outcomes = [result.result() for result in tqdm(results, 'landings', unit='')]
    shown, = (landing.scenario for landing in planned if landing.name == f'grid {SHOWN}')
    draw(folder / 'landing.png', shown)
    output.write_csv(folder / 'landing.csv', map(csv_row, outcomes),
                     about=output.machine(PACKAGES))
    patches = [outcome for outcome in outcomes if outcome.way in PATCHES]
    good = ', '.join(f'{sum(outcome.as_expected for outcome in patches if outcome.way == way)} of '
                     f'{sum(outcome.way == way for outcome in patches)} by `{way}`'
                     for way in dict.fromkeys(outcome.way for outcome in patches))
    output.write_page(
        folder, 'landing', args, machine=output.machine(PACKAGES), good=good,
        grid=grid_table(outcomes), added=added_table(outcomes))
    print(f'{grid_table(outcomes)}\n\n{added_table(outcomes)}')
    missed = [outcome for outcome in patches if not outcome.as_expected]
    for way, timing, landing, _ in missed:
        print(f'landing: {way} at {timing.rate_hz:g} Hz and {1e3 * timing.latency:g} ms, '
              f'{landing.name}: not as expected', file=sys.stderr)
    return int(any(outcome.way == GATED for outcome in missed))


if __name__ == '__main__':
    sys.exit(main())

"""Landings by model: whether the container comes to rest on one contact point per tick.

`python -m box_contact_ros.reports.landing_report` runs a grid of landings for every model, rate and
latency: rope angle, tilt, overhang; yaw and headings are drawn. The constants of the contact law
are the same for all models. Written are landing.csv (a row per landing), landing.md (a row per
model, rate and latency) and landing.png (one landing for each model). With --dds the
contacts come from a contact node in another process, in lockstep, and landing_dds.csv and .md are
written.
"""
from __future__ import annotations

import math
import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from itertools import groupby
from pathlib import Path

import numpy as np
from tqdm import tqdm

from .. import output
from ..apps.crane.landing import (
    SETTLING,
    WINDOW,
    LandingCase,
    LandingRecord,
    LandingResult,
    cases,
    land,
    scenario_of,
)
from ..core import native
from ..scene.contact_law import GRAVITY
from ..solver.arguments import add_models, program_parser
from ..solver.contact_solver import ContactSolver

QUICK = 7  # `--quick` runs every seventh case: prime to the grid's sides, so all values are met
SHOWN = 17  # the case that is drawn: sway of 1.25°, tilt of 3°, 0.6 m of overhang


@dataclass(frozen=True)
class LandingRun:
    """One landing to run: the number of the case, with what."""

    model: str
    rate_hz: float
    latency: float
    number: int
    case: LandingCase


Landed = tuple[LandingRun, LandingResult]


def run(landing: LandingRun) -> Landed:
    """Run and judge one landing."""
    return landing, fly(landing).judge()


def fly(landing: LandingRun) -> LandingRecord:
    """Run one landing."""
    scenario = scenario_of(landing.case)
    solver = ContactSolver(scenario.size, scenario.stack_size, model=landing.model)
    return land(scenario, solver, rate_hz=landing.rate_hz, latency=landing.latency)


def landings_of(models: Sequence[str], rates: Sequence[float], latencies: Sequence[float], *,
                seed: int = 1, step: int = 1) -> list[LandingRun]:
    """Return the landings of a sweep: every `step`-th case."""
    return [LandingRun(model, rate, latency, number, case)
            for model in models for rate in rates for latency in latencies
            for number, case in list(enumerate(cases(seed=seed)))[::step]]


def csv_row(landing: LandingRun, result: LandingResult) -> dict[str, object]:
    """Return what was run, whether it rests, and every figure.

    SI units; angles of cases in degrees, their columns begin with case_.
    """
    return {'model': landing.model, 'rate_hz': landing.rate_hz, 'latency': landing.latency,
            'case': landing.number,
            **{f'case_{name}': value for name, value in asdict(landing.case).items()},
            'at_rest': int(result.at_rest), **asdict(result)}


SHOWN_WORST = {
    'settled [s]': ('settled', 1.0), 'corner [mm/s]': ('corner_speed', 1e3),
    'force [%]': ('force_worst', 100.0), 'tilt [°]': ('tilt', 180.0 / math.pi),
    'depth [%]': ('depth', 100.0), 'gap [mm]': ('gap', 1e3),
    'point step, window [mm]': ('point_step', 1e3),
    'point step, ever [mm]': ('point_step_ever', 1e3)}
"""By column: a figure of `LandingResult`, whose worst value the table shows, and its factor."""


def table(results: Sequence[Landed]) -> str:
    """Return a row per model, rate and latency: how many rest, and the worst of each figure."""
    def worst(group: Sequence[LandingResult], name: str, factor: float) -> str:
        values = [getattr(result, name) for result in group]
        # What was never reached has no worst; the word is clearer than a NaN.
        return 'never' if any(map(math.isnan, values)) else f'{factor * max(values):.2g}'

    groups: dict[tuple[str, float, float], list[LandingResult]] = {}
    for landing, result in results:
        key = (landing.model, landing.rate_hz, landing.latency)
        groups.setdefault(key, []).append(result)
    head, rows = ['model', 'rate [Hz]', 'latency [ms]', 'at rest'], []
    for title, (name, _) in SHOWN_WORST.items():
        head += [title, 'exact'] if name.startswith('point') else [title]
    for (model, rate, latency), group in groups.items():
        row = [model, f'{rate:g}', f'{1e3 * latency:g}',
               f'{sum(result.at_rest for result in group)} of {len(group)}']
        for name, factor in SHOWN_WORST.values():
            row.append(worst(group, name, factor))
            if name.startswith('point'):
                row.append(worst(group, f'exact_{name}', factor))
        rows.append(row)
    return output.markdown_table(head, rows)


def over_dds(landings: Sequence[LandingRun]) -> Iterator[Landed]:
    """Run landings one by one, their contacts from a contact node; in lockstep."""
    from ..apps.crane.landing_flights import answering_node, fly_over_dds  # only here: needs ROS

    for model, group in groupby(landings, key=lambda one: one.model):
        with answering_node(model, scenario_of(landings[0].case)) as domain:
            for one in group:
                yield one, fly_over_dds(domain, scenario_of(one.case), rate_hz=one.rate_hz,
                                        latency=one.latency)


OFFLINE_END = """
![One landing, the models side by side](landing.png)

The same with the contacts from a contact node over DDS: [landing_dds.md](landing_dds.md).
"""
DDS_START = """
The contacts of these landings come from a contact node in another process, over DDS. They act that
much later than their poses were published. The simulation waits for every answer (lockstep), so
that a busy machine changes nothing. No answer was lost. The same without ROS:
[landing.md](landing.md).
"""


def page(results: Sequence[Landed], command: str, *, dds: bool = False) -> str:
    """Return the Markdown page."""
    count = len({landing.number for landing, _ in results})
    return f"""# A container lands on one contact point per tick{', over DDS' if dds else ''}

Made by `{command}` on {output.machine(native)}.
{DDS_START if dds else ''}
{count} landings a row: ropes 0.5 to 3° off the plumb line, box tilted by 0.5 to 3°, centres 0 to
0.6 m apart at the first touch, yaw to 1°, every direction drawn. 20 t, 40 ft, no damping but that
of contact and ropes; the same law and constants for every model (`contact_law`), one point,
normal and depth per tick.

At rest means, from {SETTLING:g} s after the first touch on, for {WINDOW:g} s: no corner faster than
10 mm/s (20 at 200 Hz), ropes slack, contact force within 1 % of the weight at every tick, tilt
below 0.5°; and always depth below 1 % of the height, gap after the first touch below 20 mm.

Figures are the worst of the row's landings. A point step is |Δpoint| between neighbouring ticks, in
the window or over the whole contact. The column on its right has the exact point's step on the same
poses. Every landing is a row of {'landing_dds' if dds else 'landing'}.csv.

{table(results)}
{'' if dds else OFFLINE_END}"""


def draw(path: Path, models: Sequence[str], landing: LandingRun) -> None:
    """Draw one landing, a column per model: corner speed, force, tilt, and the point's path."""
    figure, axes = output.subplots(4, len(models), (4.6 * len(models), 10.5), sharey='row')
    for column, model in zip(axes.T, models):
        record = fly(replace(landing, model=model))
        result = record.judge()
        points = record.point_path() - np.array([0.0, 0.0, record.scenario.stack_size[2]])
        time = np.arange(len(record.poses)) / record.rate_hz - result.touched
        shown = time > -1.0
        speed, force, tilt, path_axes = column
        speed.set_title(f'{model}: {"at rest" if result.at_rest else "never at rest"}')
        speed.semilogy(time[shown], 1e3 * record.corner_speeds()[shown], linewidth=0.7)
        speed.axhline(1e3 * result.corner_speed_limit, color='black', linewidth=0.7, linestyle=':')
        weight = record.scenario.mass * GRAVITY
        force.plot(time[shown], record.vertical_forces()[shown] / weight, linewidth=0.7)
        tilt.plot(time[shown], np.degrees(record.tilts())[shown], linewidth=0.7)
        for axis in (speed, force, tilt):
            axis.axvspan(SETTLING, SETTLING + WINDOW, color='0.9')
            axis.set_xlabel('time after the first touch [s]')
        path_axes.plot(points[:, 0], points[:, 1], '-', linewidth=0.4, color='0.6')
        path_axes.scatter(points[:, 0], points[:, 1], s=2, c=time, cmap='viridis', zorder=2)
        length, width, _ = np.array(record.scenario.stack_size) / 2.0
        path_axes.plot([-length, length, length, -length, -length],
                       [-width, -width, width, width, -width], color='black', linewidth=0.7)
        path_axes.set_xlabel('contact point x [m], colour: time')
    for axis, label in zip(axes[:, 0], ('fastest corner [mm/s]', 'contact force / weight',
                                        'tilt [°]', 'contact point y [m]')):
        axis.set_ylabel(label)
    figure.suptitle(f'One landing at {landing.rate_hz:g} Hz, the same constants; grey: judged')
    figure.savefig(path)


def main(args: Sequence[str] | None = None) -> int:
    """Run the sweep and write its three files; 0 whatever the models do."""
    parser = program_parser(
        'python -m box_contact_ros.reports.landing_report', __doc__, seed=1,
        quick=f'every {QUICK}th landing only', out='landing.csv, landing.md, landing.png')
    add_models(parser, '--models', ['exact', 'fcl'])
    parser.add_argument('--rates', nargs='+', type=float, default=[200.0, 1000.0], metavar='HZ',
                        help='ticks a second, default: %(default)s')
    parser.add_argument('--latency', nargs='+', type=float, default=[0.0, 0.002], metavar='S',
                        help='from asking to acting [s], default: %(default)s')
    parser.add_argument('--dds', action='store_true', help='contacts from a contact node, over '
                        'DDS in lockstep; one landing at a time')
    parser.add_argument('--workers', type=int, default=os.cpu_count(), help='processes')
    options = parser.parse_args(args)
    folder = output.results_folder(parser, options)
    landings = landings_of(options.models, options.rates, options.latency, seed=options.seed,
                           step=QUICK if options.quick else 1)
    progress = {'total': len(landings), 'desc': 'landings', 'unit': ''}
    if options.dds:
        results = list(tqdm(over_dds(landings), **progress))
    else:
        with ProcessPoolExecutor(options.workers) as pool:
            results = list(tqdm(pool.map(run, landings), **progress))
        shown = list(cases(seed=options.seed))[SHOWN]
        draw(folder / 'landing.png', options.models,
             LandingRun(options.models[0], options.rates[0], options.latency[0], SHOWN, shown))
    name = 'landing_dds' if options.dds else 'landing'
    output.write_csv(folder / f'{name}.csv', [csv_row(*one) for one in results])
    command = output.command_line('box_contact_ros.reports.landing_report', args)
    (folder / f'{name}.md').write_text(page(results, command, dds=options.dds), encoding='utf-8')
    print(table(results))
    return 0


if __name__ == '__main__':
    raise SystemExit(main())

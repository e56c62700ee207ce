"""Landings by model: whether the container comes to rest on one contact point per tick.

`python -m box_contact_ros.reports.landing_report` runs a grid of landings (rope angle, tilt,
overhang; yaw and headings drawn) for every model, rate and latency, the constants of the contact
law being the same for all models, and writes landing.csv (a row per landing), landing.md
(a row per model, rate and latency) and landing.png (one landing, the models side by
side). With --dds the contacts come from a contact node in another process,
in lockstep, and landing_dds.csv and .md are written.
"""
from __future__ import annotations

import argparse
import csv
import dataclasses
import math
import os
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import matplotlib
import numpy as np
from tqdm import tqdm

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
from ..output import add_out, results_folder
from ..scene.contact_law import GRAVITY
from ..solver.arguments import seed_number
from ..solver.contact_solver import ContactSolver
from ..solver.models import MODELS

matplotlib.use('Agg')
from matplotlib import pyplot as plt  # noqa: E402

QUICK = 7
"""`--quick` runs every seventh case: prime to the grid's sides, so all values are met."""
SHOWN = 17
"""The case that is drawn: sway of 1.25°, tilt of 3°, 0.6 m of overhang."""


@dataclass(frozen=True)
class Job:
    """One landing to run: which of the cases, with what."""

    model: str
    rate_hz: float
    latency: float
    number: int
    case: LandingCase


def run(job: Job) -> tuple[Job, LandingResult]:
    """Run and judge one landing."""
    return job, fly(job).judge()


def fly(job: Job) -> LandingRecord:
    """Run one landing."""
    scenario = scenario_of(job.case)
    solver = ContactSolver(scenario.size, scenario.stack_size, model=job.model)
    return land(scenario, solver, rate_hz=job.rate_hz, latency=job.latency)


def jobs_of(models: Sequence[str], rates: Sequence[float], latencies: Sequence[float], *,
            seed: int = 1, step: int = 1) -> list[Job]:
    """All landings of a sweep; `step` takes every so-manieth case."""
    return [Job(model, rate, latency, number, case)
            for model in models for rate in rates for latency in latencies
            for number, case in list(enumerate(cases(seed=seed)))[::step]]


def write_csv(path: Path, results: Sequence[tuple[Job, LandingResult]]) -> None:
    """A row per landing: what was run, whether it rests, every figure.

    SI units; angles of cases in degrees, their columns begin with case_.
    """
    with path.open('w', newline='') as file:
        writer = csv.writer(file, lineterminator='\n')
        case_fields = [f'case_{field.name}' for field in dataclasses.fields(LandingCase)]
        figures = [field.name for field in dataclasses.fields(LandingResult)]
        writer.writerow(['model', 'rate_hz', 'latency', 'case', *case_fields, 'at_rest', *figures])
        for job, result in results:
            case = dataclasses.astuple(job.case)
            writer.writerow([
                job.model, f'{job.rate_hz:g}', f'{job.latency:g}', job.number,
                *[f'{value:.6g}' for value in case], int(result.at_rest),
                *[f'{value:.6g}' for value in dataclasses.astuple(result)]])


def table(results: Sequence[tuple[Job, LandingResult]]) -> str:
    """A Markdown row per model, rate and latency: how many rest, and the worst of each figure."""
    groups: dict[tuple[str, float, float], list[LandingResult]] = {}
    for job, result in results:
        groups.setdefault((job.model, job.rate_hz, job.latency), []).append(result)
    head = ['model', 'rate [Hz]', 'latency [ms]', 'at rest', 'settled [s]',
            'corner [mm/s]', 'force [%]', 'tilt [°]', 'depth [%]', 'gap [mm]',
            'point step, window [mm]', 'exact', 'point step, ever [mm]', 'exact']
    lines = [head, ['---'] + ['---:'] * (len(head) - 1)]
    for (model, rate, latency), group in groups.items():
        def worst(name: str, factor: float = 1.0, group: list[LandingResult] = group) -> str:
            values = [getattr(result, name) for result in group]
            # What was never reached has no worst; the word is clearer than a NaN.
            return 'never' if any(map(math.isnan, values)) else f'{factor * max(values):.2g}'
        lines.append([
            model, f'{rate:g}', f'{1e3 * latency:g}',
            f'{sum(result.at_rest for result in group)} of {len(group)}', worst('settled'),
            worst('corner_speed', 1e3), worst('force_worst', 100.0),
            worst('tilt', 180.0 / math.pi), worst('depth', 100.0), worst('gap', 1e3),
            worst('point_step', 1e3), worst('exact_point_step', 1e3),
            worst('point_step_ever', 1e3), worst('exact_point_step_ever', 1e3)])
    return '\n'.join('| ' + ' | '.join(line) + ' |' for line in lines)


def over_dds(jobs: Sequence[Job]) -> Iterator[tuple[Job, LandingResult]]:
    """Run the landings one by one, their contacts from a contact node; in lockstep."""
    from ..apps.crane.landing_flights import answering_node, fly_over_dds  # only here: needs ROS

    for model, group in groupby(jobs, key=lambda job: job.model):
        with answering_node(model, scenario_of(jobs[0].case)) as domain:
            for job in group:
                yield job, fly_over_dds(domain, scenario_of(job.case), rate_hz=job.rate_hz,
                                        latency=job.latency)


OFFLINE_END = """
![One landing, the models side by side](landing.png)

The same with the contacts from a contact node over DDS: [landing_dds.md](landing_dds.md).
"""
DDS_START = """
The contacts of these landings come from a contact node in another process, over DDS, and act so
much later than their poses were published; the simulation waits for every answer (lockstep), so
that a busy machine changes nothing. None was lost. What is measured, and the same without ROS:
[landing.md](landing.md).
"""


def _stem(dds: bool) -> str:
    """Name of the files, without its ending."""
    return 'landing_dds' if dds else 'landing'


def page(results: Sequence[tuple[Job, LandingResult]], command: str, *, dds: bool = False) -> str:
    """The Markdown page."""
    count = len({job.number for job, _ in results})
    return f"""# A container lands on one contact point per tick{', over DDS' if dds else ''}

Made by `{command}`.
{DDS_START if dds else ''}
{count} landings a row: ropes 0.5 to 3° off the plumb line, box tilted by 0.5 to 3°, centres 0 to
0.6 m apart at the first touch, yaw to 1°, every direction drawn. 20 t, 40 ft, no damping but that
of contact and ropes; the same law and constants for every model (`contact_law`), one point,
normal and depth per tick. At rest means, from {SETTLING:g} s after the first touch on, for
{WINDOW:g} s: no corner faster than 10 mm/s (20 at 200 Hz), ropes slack, contact force within 1 % of
the weight at every tick, tilt < 0.5°; and always depth < 1 % of the height, gap after the first
touch < 20 mm. Figures are the worst of the row's landings. A point step is |Δpoint| between
neighbouring ticks, in the window or over the whole contact; beside it, the exact point's on the
same poses. Every landing is a row of {_stem(dds)}.csv.

{table(results)}
{'' if dds else OFFLINE_END}"""


def draw(path: Path, models: Sequence[str], job: Job) -> None:
    """One landing, a column per model: corner speed, force, tilt, and the point's path."""
    figure, axes = plt.subplots(4, len(models), figsize=(4.6 * len(models), 10.5), sharey='row',
                                squeeze=False, constrained_layout=True)
    for column, model in zip(axes.T, models):
        record = fly(dataclasses.replace(job, model=model))
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
    figure.suptitle(f'One landing at {job.rate_hz:g} Hz, the same constants; grey: judged')
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main(args: Sequence[str] | None = None) -> int:
    """Run the sweep and write its three files; 0 whatever the models do."""
    parser = argparse.ArgumentParser(prog='python -m box_contact_ros.reports.landing_report',
                                     description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--models', nargs='+', default=['exact', 'fcl'], choices=list(MODELS),
                        help='default: %(default)s')
    parser.add_argument('--rates', nargs='+', type=float, default=[200.0, 1000.0], metavar='HZ',
                        help='ticks a second, default: %(default)s')
    parser.add_argument('--latency', nargs='+', type=float, default=[0.0, 0.002], metavar='S',
                        help='from asking to acting [s], default: %(default)s')
    parser.add_argument('--dds', action='store_true', help='contacts from a contact node, over '
                        'DDS in lockstep; one landing at a time')
    parser.add_argument('--seed', type=seed_number, default=1, help='of yaws and headings')
    parser.add_argument('--quick', action='store_true', help=f'every {QUICK}th landing only')
    parser.add_argument('--workers', type=int, default=os.cpu_count(), help='processes')
    add_out(parser, 'landing.csv, landing.md, landing.png')
    options = parser.parse_args(args)
    options.out = results_folder(parser, options)
    jobs = jobs_of(options.models, options.rates, options.latency, seed=options.seed,
                   step=QUICK if options.quick else 1)
    if options.dds:
        results = list(tqdm(over_dds(jobs), total=len(jobs), desc='landings', unit=''))
    else:
        with ProcessPoolExecutor(options.workers) as pool:
            results = list(tqdm(pool.map(run, jobs), total=len(jobs), desc='landings', unit=''))
    name = _stem(options.dds)
    write_csv(options.out / f'{name}.csv', results)
    given = sys.argv[1:] if args is None else args
    command = ' '.join(['python -m box_contact_ros.reports.landing_report', *given])
    (options.out / f'{name}.md').write_text(page(results, command, dds=options.dds))
    if not options.dds:
        shown = list(cases(seed=options.seed))[SHOWN]
        draw(options.out / 'landing.png', options.models,
             Job(options.models[0], options.rates[0], options.latency[0], SHOWN, shown))
    print(table(results))
    return 0


if __name__ == '__main__':
    sys.exit(main())

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whether loads rest, slide, ride and stack as they should, by the law of force and by MuJoCo.

`python -m benchmarks.rest` runs every case by `PatchForces` and by MuJoCo's own contact
(`loops`), and compares one figure with a limit. The program prints one
table, and writes rest.md and rest.csv. The exit status is 1 if the law misses a limit.

Lengths in m, masses in kg, times in s.
"""
from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from box_contact_ros.core import native
from box_contact_ros.scene.laws import FRICTION, GRAVITY
from box_contact_ros.solver.pose import rotation_matrix

from . import output
from .arguments import report_parser
from .loops import CORNERS, FLOOR, MUJOCO, TIMINGS, Boxes, Scene, Timing, corner_speeds, steps
from .pose_sets import CONTAINER, CUBE, turned

BLOCK = (2.0, 2.0, 1.0)
MASS = 20_000.0  # of a container
DROP = 0.05
PUSH_FROM = 1.0  # when a push begins
WAYS = {**{str(timing): timing for timing in TIMINGS if timing.step == 0.001}, MUJOCO: None}
QUICK = 4  # `--quick` runs every so-many-th case


@dataclass
class Log:
    """What the free boxes did, a row for each step, the first and the last included."""

    times: np.ndarray  # (steps,)
    poses: np.ndarray  # (steps, n, 7)
    velocities: np.ndarray  # (steps, n, 6)
    corners: np.ndarray  # (steps,) speed of the fastest corner
    size: np.ndarray  # (n, 3)


@dataclass(frozen=True, kw_only=True)
class Case:
    """What is simulated, and what is expected of it.

    rows    of `Boxes.of`; speed: of the first box along x, a belt
    figure  what `measure` returns of a log, with its unit
    limit   the most that the figure may be; NaN is beyond every limit
    push    constant force on the last box along x, from `PUSH_FROM` on [N]
    """

    name: str
    expected: str
    rows: Sequence[tuple]
    seconds: float
    figure: str
    limit: float
    measure: Callable[[Log], float]
    speed: float = 0.0
    push: float = 0.0

    def scene(self) -> Scene:
        """Return the boxes, and the push."""
        boxes = Boxes.of(self.rows)
        boxes.velocity[0, 0] = self.speed
        push = np.zeros((len(self.rows), 6))
        push[-1, 0] = self.push
        return Scene(self.name, boxes, self.seconds, friction=FRICTION,
                     act=lambda time, *_: push * (time >= PUSH_FROM))


def simulate(case: Case, timing: Timing | None) -> Log:
    """Simulate a case by the law at a timing, or by MuJoCo's own contact."""
    scene = case.scene()
    boxes, rows = scene.boxes, []
    free = boxes.mass > 0
    for loop in steps(scene, timing):
        rows.append((loop.tick * loop.step_size, boxes.pose[free], boxes.velocity[free],
                     corner_speeds(boxes).max()))
    return Log(*map(np.array, zip(*rows)), size=boxes.size[free])


# --- figures --------------------------------------------------------------------------------------


def rebound(log: Log) -> float:
    """Return how high the lowest corner comes after its first touch [% of the drop]."""
    up = rotation_matrix(log.poses[:, 0, 3:])[:, 2]
    low = log.poses[:, 0, 2] + np.einsum('nj,kj->nk', up, CORNERS * log.size[0]).min(axis=1)
    return 100.0 * float(np.maximum(0.0, low[int(np.argmax(low <= 0.0)):].max())) / DROP


def fastest(log: Log, start: float) -> float:
    """Return the fastest corner's speed of all free boxes from a time on [mm/s]."""
    return 1e3 * float(np.max(log.corners[log.times >= start]))


def creep(log: Log, start: float) -> float:
    """Return the mean speed at which the free box is carried away from a time on [mm/s]."""
    way = log.poses[-1, 0, :3] - log.poses[log.times >= start, 0, :3][0]
    return 1e3 * float(np.linalg.norm(way)) / (log.times[-1] - start)


def acceleration_error(log: Log, start: float, expected: float) -> float:
    """Return the error of the free box's mean acceleration from a time on [%]."""
    speeds = np.linalg.norm(log.velocities[log.times >= start, 0, :3], axis=1)
    found = (speeds[-1] - speeds[0]) / (log.times[-1] - start)
    return 100.0 * abs(float(found) / expected - 1.0)


def belt_error(log: Log, speed: float) -> float:
    """Return the error of the free box's speed along x at the end [%]."""
    return 100.0 * abs(float(log.velocities[-1, 0, 0]) / speed - 1.0)


# --- the cases ------------------------------------------------------------------------------------


def drops() -> list[Case]:
    """Return drops of 50 mm: level, on an edge, on a corner."""
    cases = []
    for name, size, mass, how, axis, degrees in (
            ('2 m cube', CUBE, 8000.0, 'level', (0, 0, 1), 0.0),
            ('2 m cube', CUBE, 8000.0, 'on an edge', (0, 1, 0), 44.0),
            ('2 m cube', CUBE, 8000.0, 'on a corner', (1, -1, 0), 54.0),
            ('container', CONTAINER, MASS, 'on a corner', (1, 2, 0), 5.0)):
        q = turned(axis, math.radians(degrees))
        low = (CORNERS * size @ rotation_matrix(q).T)[:, 2].min()
        cases.append(Case(name=f'drop: {name} {how}, {1e3 * DROP:g} mm', expected='stays down',
                          rows=(FLOOR, (size, mass, (0.0, 0.0, DROP - low), q)), seconds=4.0,
                          figure='rebound [%]', limit=5.0, measure=rebound))
    return cases


def slopes() -> list[Case]:
    """Return slopes below and beyond friction, whose angle is 26.6°."""
    cases = []
    for name, size, mass, degrees in (
            ('container', CONTAINER, MASS, 15.0), ('container', CONTAINER, MASS, 25.0),
            ('0.1 m cube', (0.1, 0.1, 0.1), 1.0, 25.0), ('2 × 2 × 1 m', BLOCK, 1000.0, 40.0)):
        angle = math.radians(degrees)
        q = turned((0, 1, 0), angle)
        up = rotation_matrix(q)[:, 2]
        expected = GRAVITY * (math.sin(angle) - FRICTION * math.cos(angle))
        end = {'expected': 'slides by g (sin θ − μ cos θ)', 'seconds': 4.0,
               'figure': 'acceleration, error [%]', 'limit': 1.0,
               'measure': partial(acceleration_error, start=1.0, expected=expected)} if (
            expected > 0.0) else {'expected': 'stays', 'seconds': 12.0, 'limit': 1e-6,
                                  'figure': 'creep [mm/s]', 'measure': partial(creep, start=10.0)}
        cases.append(Case(name=f'slope: {name} on {degrees:g}°', **end, rows=(
            ((200.0, 40.0, 1.0), 0.0, -0.5 * up, q), (size, mass, 0.5 * size[2] * up, q))))
    return cases


def pushes() -> list[Case]:
    """Return a block that is pushed with a share of friction."""
    rows = (FLOOR, (BLOCK, 1000.0, (0.0, 0.0, 0.5)))
    most = FRICTION * 1000.0 * GRAVITY
    return [
        Case(name='push: 2 × 2 × 1 m by 0.9 of friction', expected='stays', rows=rows,
             seconds=12.0, push=0.9 * most, figure='creep [mm/s]', limit=1e-5,
             measure=partial(creep, start=10.0)),
        Case(name='push: 2 × 2 × 1 m by 1.1 of friction', expected='slides by 0.1 μ g', rows=rows,
             seconds=6.0, push=1.1 * most, figure='acceleration, error [%]', limit=1.0,
             measure=partial(acceleration_error, start=2.0, expected=0.1 * FRICTION * GRAVITY))]


def belts() -> list[Case]:
    """Return a block that is put on a belt which runs."""
    speed = 0.35
    return [Case(name=f'belt: 2 × 2 × 1 m on a belt of {speed:g} m/s', expected='is carried along',
                 rows=(((20.0, 3.0, 1.0), 0.0, (0.0, 0.0, -0.5)),
                       (BLOCK, 1000.0, (0.0, 0.0, 0.5))), speed=speed, seconds=5.0,
                 figure='speed, error [%]', limit=1.0, measure=partial(belt_error, speed=speed))]


def stacks() -> list[Case]:
    """Return containers that fall onto each other by 10 mm, tilted by 0.1° and 0.1 m aside."""
    rng, tilt = np.random.default_rng(1), math.radians(0.1)
    low = 0.5 * CONTAINER[0] * tilt
    cases = []
    for name, masses in (('stack: 2 containers', [MASS] * 2), ('stack: 5 containers', [MASS] * 5),
                         ('mass ratio: 30 t on 10 t', [10_000.0, 30_000.0]),
                         ('mass ratio: 30 t on 2 t', [2000.0, 30_000.0]),
                         ('mass ratio: 2 t on 30 t', [30_000.0, 2000.0])):
        rows = [FLOOR]
        for number, mass in enumerate(masses):
            heading = rng.uniform(0.0, 2.0 * math.pi)
            height = CONTAINER[2] * (number + 0.5) + (number + 1) * (0.01 + low)
            rows.append((CONTAINER, mass, (*rng.uniform(-0.1, 0.1, 2), height),
                         turned((math.cos(heading), math.sin(heading), 0.0), tilt)))
        cases.append(Case(name=name, expected='is still after 6 s', rows=rows, seconds=8.0,
                          figure='corner [mm/s]', limit=1.0, measure=partial(fastest, start=6.0)))
    return cases


CASES = (*drops(), *slopes(), *pushes(), *belts(), *stacks())


def main(args: Sequence[str] | None = None) -> int:
    """Run all cases, print and write; 1 if the law misses a limit."""
    from tqdm import tqdm

    parser = report_parser('rest', __doc__, out='rest.md and rest.csv',
                           quick=f'every {QUICK}th case')
    options = parser.parse_args(args)
    folder = output.results_folder(parser, options)
    cases = CASES[::QUICK] if options.quick else CASES
    found = {case.name: {way: case.measure(simulate(case, timing)) for way, timing in WAYS.items()}
             for case in tqdm(cases, desc='rest', unit='case')}
    table = output.markdown_table(
        ['case', 'expected', 'figure', 'limit', *WAYS],
        [[case.name, case.expected, case.figure, f'{case.limit:g}', *(
            f'{value:.2g}' if value <= case.limit else f'**{value:.2g}**'
            for value in found[case.name].values())] for case in cases], words=3)
    about = output.machine(native, ('numpy', 'mujoco'))
    output.write_csv(folder / 'rest.csv', (
        {'case': case.name, 'expected': case.expected, 'figure': case.figure, 'limit': case.limit,
         'way': way, 'value': value, 'is_met': int(value <= case.limit)}
        for case in cases for way, value in found[case.name].items()), digits=3, about=about)
    missed = [f'{case.name} at {way}: {case.figure} is {value:.2g}, not {case.limit:g}'
              for case in cases for way, value in found[case.name].items()
              if way != MUJOCO and not value <= case.limit]
    (folder / 'rest.md').write_text(output.page(
        'benchmarks/pages/rest', command=output.command_line('benchmarks.rest', args),
        machine=about, table=table), encoding='utf-8')
    print(table)
    for line in missed:
        print(f'rest: {line}', file=sys.stderr)
    return int(bool(missed))


if __name__ == '__main__':
    sys.exit(main())

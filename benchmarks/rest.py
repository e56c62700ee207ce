# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Whether loads rest, slide, ride and stack as they should, by the law of force and by MuJoCo.

`python -m benchmarks.rest` runs every case in a small simulator: MuJoCo integrates with its contact
switched off, contacts are asked for at a rate, answers arrive late, and the law is asked at every
step. The same boxes also run with MuJoCo's own contact. The program prints one table, and writes
rest.md and rest.csv. The exit status is 1 if the law misses a limit that was stated beforehand.

Lengths in m, masses in kg, times in s.
"""
from __future__ import annotations

import logging
import math
import sys
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from typing import NamedTuple

import mujoco
import numpy as np

from box_contact_ros.core import native
from box_contact_ros.scene.laws import FRICTION, GRAVITY, Body, PatchForces
from box_contact_ros.solver.arguments import add_model
from box_contact_ros.solver.contact_solver import ContactSolver
from box_contact_ros.solver.pose import rotation_matrix

from . import output
from .arguments import report_parser
from .pose_sets import CONTAINER

# MuJoCo would write warnings to a file MUJOCO_LOG.TXT in the working directory.
mujoco.set_mju_user_warning(logging.getLogger(__name__).warning)

STEP = 0.001  # of physics [s]
TIME_ROUNDING = 1e-9  # [s]; times are sums of steps and latencies
MUJOCO_FRICTION = (0.005, 0.0001)  # about and across the normal: MuJoCo's defaults
HEAVIER = 1e3
"""How many times as heavy as the heaviest load a belt is, which is put back at every step. With 1e9
the solver of MuJoCo no longer converges, and its load never reaches the speed of the belt."""
CORNERS = 0.5 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
MASS = 20_000.0  # of a container
CUBE, BLOCK = (2.0, 2.0, 2.0), (2.0, 2.0, 1.0)
QUICK = 4  # `--quick` runs every so-many-th case


@dataclass(frozen=True, kw_only=True)
class Part:
    """A box of a simulation: free where it has a mass, else fixed, or a belt where it has a speed.

    position    of its centre at the start (3,)
    quaternion  x y z w
    speed       of a belt, along x [m/s]
    """

    name: str
    size: tuple[float, float, float]  # full extents
    position: Sequence[float] | np.ndarray
    quaternion: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0, 1.0)
    mass: float = 0.0
    speed: float = 0.0


class Timing(NamedTuple):
    """The loop of a client: how often it asks, and how late answers are."""

    rate_hz: float
    latency: float

    def __str__(self) -> str:
        return f'{self.rate_hz:g} Hz, {1e3 * self.latency:g} ms'


TIMINGS = (Timing(50.0, 0.005), Timing(200.0, 0.002), Timing(1000.0, 0.0))
MUJOCO = 'MuJoCo'


class Log:
    """Times (steps,), and poses (steps, n, 7) and velocities (steps, n, 6) of what moves."""

    def __init__(self, parts: Sequence[Part], seconds: float) -> None:
        """Begin a log; what is never reached stays NaN."""
        self.moving = [part for part in parts if part.mass or part.speed]
        self.times = STEP * np.arange(round(seconds / STEP) + 1)
        self.poses = np.full((len(self.times), len(self.moving), 7), np.nan)
        self.velocities = np.full((len(self.times), len(self.moving), 6), np.nan)

    @property
    def free(self) -> list[int]:
        """Places of the boxes with a mass."""
        return [place for place, part in enumerate(self.moving) if part.mass]

    def since(self, time: float) -> slice:
        """Return the steps from a time on."""
        return slice(round(time / STEP), None)


@dataclass(frozen=True, kw_only=True)
class Case:
    """What is simulated, and what is expected of it.

    figure  what `measure` returns of a log, with its unit
    limit   the most that the figure may be; NaN is beyond every limit
    push    constant force on the first free box, from 1 s on [N]
    """

    name: str
    expected: str
    parts: tuple[Part, ...]
    seconds: float
    figure: str
    limit: float
    measure: Callable[[Log], float]
    push: float = 0.0


# --- the simulator --------------------------------------------------------------------------------


def simulate(case: Case, timing: Timing | None, model: str = 'exact') -> Log:
    """Simulate a case by the law at a timing, or by MuJoCo's own contact."""
    log = Log(case.parts, case.seconds)
    physics = _physics(case.parts, own_contact=timing is None)
    data = mujoco.MjData(physics)
    count = len(log.moving)
    rows = slice(1, count + 1)  # body 0 is the world
    client = Client(case.parts, timing, model) if timing else None
    for tick, time in enumerate(log.times):
        for place, part in enumerate(log.moving):
            if part.speed:
                way = part.speed * time, 0.0, 0.0
                data.qpos[7 * place:7 * place + 3] = np.add(part.position, way)
                data.qvel[6 * place:6 * place + 6] = part.speed, 0.0, 0.0, 0.0, 0.0, 0.0
        mujoco.mj_step1(physics, data)
        log.poses[tick] = np.hstack([data.xpos[rows], np.roll(data.xquat[rows], -1, axis=1)])
        log.velocities[tick] = np.roll(data.cvel[rows], 3, axis=1)
        if not np.abs(log.velocities[tick]).max() < 1e3:
            break  # diverged
        push = np.zeros((count, 6))
        push[log.free[0], 0] = case.push if time >= 1.0 else 0.0
        data.xfrc_applied[rows] = push
        if client:
            data.xfrc_applied[rows] += client.wrenches(time, log.poses[tick],
                                                       log.velocities[tick], push)
        mujoco.mj_step2(physics, data)
    return log


class Client:
    """Asks for contacts at a rate, and for the forces at every step."""

    def __init__(self, parts: Sequence[Part], timing: Timing, model: str) -> None:
        """Make solver and forces for all pairs with a free box; what moves comes first."""
        parts = sorted(parts, key=lambda part: not (part.mass or part.speed))
        bodies = [Body.of_box(part.size, part.mass) for part in parts]
        self._moving = sum(1 for part in parts if part.mass or part.speed)
        self._sizes = np.array([part.size for part in parts])
        self._pairs = np.array([(a, b) for a, b in combinations(range(len(parts)), 2)
                                if parts[a].mass or parts[b].mass])
        self._poses = np.array([(*part.position, *part.quaternion) for part in parts], dtype=float)
        self._velocities = np.zeros((len(parts), 6))
        self._weights = np.zeros((len(parts), 6))
        self._weights[:, 2] = [-GRAVITY * body.mass for body in bodies]
        self._solver = ContactSolver(parts[0].size, parts[0].size, model=model)
        self._forces = PatchForces(bodies, friction=FRICTION)
        self._period, self._latency, self._next = 1.0 / timing.rate_hz, timing.latency, 0.0
        self._answers: deque = deque()  # when each arrives, contacts, and poses of the question

    def wrenches(self, time: float, poses: np.ndarray, velocities: np.ndarray,
                 push: np.ndarray) -> np.ndarray:
        """Return the wrenches (n, 6) of contacts on what moves; `push` is beside the weight."""
        self._poses[:self._moving], self._velocities[:self._moving] = poses, velocities
        outside = self._weights.copy()
        outside[:self._moving] += push
        if time >= self._next - TIME_ROUNDING:
            self._next += self._period
            contacts = self._solver.batch(self._poses, sizes=self._sizes, pairs=self._pairs)
            self._answers.append((time + self._latency, contacts, self._poses.copy()))
        while self._answers and self._answers[0][0] <= time + TIME_ROUNDING:
            self._forces.hold(self._pairs, *self._answers.popleft()[1:], age=self._latency)
        return self._forces.wrenches(STEP, self._poses, self._velocities,
                                     outside)[:self._moving]


def _physics(parts: Sequence[Part], *, own_contact: bool) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    spec.option.gravity = 0.0, 0.0, -GRAVITY
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.timestep = STEP
    heaviest = max(part.mass for part in parts)
    for part in sorted(parts, key=lambda part: not (part.mass or part.speed)):
        x, y, z, w = part.quaternion
        body = spec.worldbody.add_body(name=part.name, pos=part.position, quat=[w, x, y, z])
        if part.mass or part.speed:
            body.add_freejoint()
            body.explicitinertial = True
            body.mass = part.mass or HEAVIER * heaviest
            body.inertia = Body.of_box(part.size, body.mass).inertia
            body.ipos = 0.0, 0.0, 0.0  # unset, MuJoCo would turn the inertia with the box
            body.gravcomp = float(not part.mass)
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=0.5 * np.array(part.size),
                      contype=int(own_contact), conaffinity=int(own_contact),
                      friction=(FRICTION, *MUJOCO_FRICTION))
    return spec.compile()


# --- figures --------------------------------------------------------------------------------------


def rebound(log: Log, height: float) -> float:
    """Return how high the lowest corner comes after its first touch [% of the drop]."""
    place, = log.free
    poses = log.poses[:, place]
    up = rotation_matrix(poses[:, 3:])[:, 2]
    low = poses[:, 2] + np.einsum('nj,kj->nk', up, CORNERS * log.moving[place].size).min(axis=1)
    return 100.0 * float(np.maximum(0.0, low[int(np.argmax(low <= 0.0)):].max())) / height


def fastest(log: Log, start: float) -> float:
    """Return a bound of the fastest corner's speed of all free boxes from a time on [mm/s]."""
    speeds = [np.linalg.norm(moves[:, :3], axis=1) + 0.5 * np.linalg.norm(log.moving[place].size)
              * np.linalg.norm(moves[:, 3:], axis=1)
              for place in log.free for moves in [log.velocities[log.since(start), place]]]
    return 1e3 * float(np.max(speeds))


def creep(log: Log, start: float) -> float:
    """Return the mean speed at which the free box is carried away from a time on [mm/s]."""
    place, = log.free
    way = log.poses[-1, place, :3] - log.poses[log.since(start), place, :3][0]
    return 1e3 * float(np.linalg.norm(way)) / (log.times[-1] - start)


def acceleration_error(log: Log, start: float, expected: float) -> float:
    """Return the error of the free box's mean acceleration from a time on [%]."""
    place, = log.free
    speeds = np.linalg.norm(log.velocities[log.since(start), place, :3], axis=1)
    found = (speeds[-1] - speeds[0]) / (log.times[-1] - start)
    return 100.0 * abs(float(found) / expected - 1.0)


def belt_error(log: Log, speed: float) -> float:
    """Return the error of the free box's speed along x at the end [%]."""
    place, = log.free
    return 100.0 * abs(float(log.velocities[-1, place, 0]) / speed - 1.0)


# --- the cases ------------------------------------------------------------------------------------


def quaternion(axis: Sequence[float], degrees: float) -> np.ndarray:
    """Return x y z w (4,) of a turn about an axis (3,)."""
    half = 0.5 * math.radians(degrees)
    return np.append(math.sin(half) * np.array(axis) / np.linalg.norm(axis), math.cos(half))


FLOOR = Part(name='floor', size=(60.0, 60.0, 1.0), position=(0.0, 0.0, -0.5))


def drops() -> list[Case]:
    """Return drops of 50 mm: level, on an edge, on a corner."""
    cases = []
    for name, size, mass, how, turned in (
            ('2 m cube', CUBE, 8000.0, 'level', quaternion((0, 0, 1), 0.0)),
            ('2 m cube', CUBE, 8000.0, 'on an edge', quaternion((0, 1, 0), 44.0)),
            ('2 m cube', CUBE, 8000.0, 'on a corner', quaternion((1, -1, 0), 54.0)),
            ('container', CONTAINER, MASS, 'on a corner', quaternion((1, 2, 0), 5.0))):
        low = (CORNERS * size @ rotation_matrix(turned).T)[:, 2].min()
        load = Part(name='load', size=size, mass=mass, quaternion=turned,
                    position=(0.0, 0.0, 0.05 - low))
        cases.append(Case(name=f'drop: {name} {how}, 50 mm', expected='stays down',
                          parts=(FLOOR, load), seconds=4.0, figure='rebound [%]', limit=5.0,
                          measure=partial(rebound, height=0.05)))
    return cases


def slopes() -> list[Case]:
    """Return slopes below and beyond friction, whose angle is 26.6°."""
    cases = []
    for name, size, mass, degrees in (
            ('container', CONTAINER, MASS, 15.0), ('container', CONTAINER, MASS, 25.0),
            ('0.1 m cube', (0.1, 0.1, 0.1), 1.0, 25.0), ('2 × 2 × 1 m', BLOCK, 1000.0, 40.0)):
        turned, angle = quaternion((0, 1, 0), degrees), math.radians(degrees)
        up = rotation_matrix(turned)[:, 2]
        slope = Part(name='slope', size=(200.0, 40.0, 1.0), position=-0.5 * up, quaternion=turned)
        load = Part(name='load', size=size, mass=mass, position=0.5 * size[2] * up,
                    quaternion=turned)
        expected = GRAVITY * (math.sin(angle) - FRICTION * math.cos(angle))
        end = {'expected': 'slides by g (sin θ − μ cos θ)', 'seconds': 4.0,
               'figure': 'acceleration, error [%]', 'limit': 1.0,
               'measure': partial(acceleration_error, start=1.0, expected=expected)} if (
            expected > 0.0) else {'expected': 'stays', 'seconds': 12.0, 'limit': 1e-6,
                                  'figure': 'creep [mm/s]', 'measure': partial(creep, start=10.0)}
        cases.append(Case(name=f'slope: {name} on {degrees:g}°', parts=(slope, load), **end))
    return cases


def pushes() -> list[Case]:
    """Return a block that is pushed with a share of friction."""
    block = Part(name='load', size=BLOCK, mass=1000.0, position=(0.0, 0.0, 0.5))
    most = FRICTION * block.mass * GRAVITY
    return [
        Case(name='push: 2 × 2 × 1 m by 0.9 of friction', expected='stays', parts=(FLOOR, block),
             seconds=12.0, push=0.9 * most, figure='creep [mm/s]', limit=1e-5,
             measure=partial(creep, start=10.0)),
        Case(name='push: 2 × 2 × 1 m by 1.1 of friction', expected='slides by 0.1 μ g',
             parts=(FLOOR, block), seconds=6.0, push=1.1 * most, figure='acceleration, error [%]',
             limit=1.0, measure=partial(acceleration_error, start=2.0,
                                        expected=0.1 * FRICTION * GRAVITY))]


def belts() -> list[Case]:
    """Return a block that is put on a belt which runs."""
    speed = 0.35
    belt = Part(name='belt', size=(20.0, 3.0, 1.0), position=(0.0, 0.0, -0.5), speed=speed)
    block = Part(name='load', size=BLOCK, mass=1000.0, position=(0.0, 0.0, 0.5))
    return [Case(name=f'belt: 2 × 2 × 1 m on a belt of {speed:g} m/s', expected='is carried along',
                 parts=(belt, block), seconds=5.0, figure='speed, error [%]', limit=1.0,
                 measure=partial(belt_error, speed=speed))]


def stacks() -> list[Case]:
    """Return containers that fall onto each other by 10 mm, tilted by 0.1° and 0.1 m aside."""
    rng, tilt = np.random.default_rng(1), 0.1
    low = 0.5 * CONTAINER[0] * math.radians(tilt)
    cases = []
    for name, masses in (('stack: 2 containers', [MASS] * 2), ('stack: 5 containers', [MASS] * 5),
                         ('mass ratio: 30 t on 10 t', [10_000.0, 30_000.0]),
                         ('mass ratio: 30 t on 2 t', [2000.0, 30_000.0]),
                         ('mass ratio: 2 t on 30 t', [30_000.0, 2000.0])):
        parts = [FLOOR]
        for number, mass in enumerate(masses):
            heading = rng.uniform(0.0, 2.0 * math.pi)
            parts.append(Part(
                name=f'{number}', size=CONTAINER, mass=mass,
                quaternion=quaternion((math.cos(heading), math.sin(heading), 0.0), tilt),
                position=(*rng.uniform(-0.1, 0.1, 2),
                          CONTAINER[2] * (number + 0.5) + (number + 1) * (0.01 + low))))
        cases.append(Case(name=name, expected='is still after 6 s', parts=tuple(parts),
                          seconds=8.0, figure='corner [mm/s]', limit=1.0,
                          measure=partial(fastest, start=6.0)))
    return cases


CASES = (*drops(), *slopes(), *pushes(), *belts(), *stacks())


# --- the report -----------------------------------------------------------------------------------


def main(args: Sequence[str] | None = None) -> int:
    """Run all cases, print and write; 1 if the law misses a limit."""
    parser = report_parser('rest', __doc__, out='rest.md and rest.csv',
                           quick=f'every {QUICK}th case')
    add_model(parser, 'exact')
    options = parser.parse_args(args)
    folder = output.results_folder(parser, options)
    cases = CASES[::QUICK] if options.quick else CASES
    from tqdm import tqdm

    ways = {**{str(timing): timing for timing in TIMINGS}, MUJOCO: None}
    found = {case.name: {way: case.measure(simulate(case, timing, options.model))
                         for way, timing in ways.items()}
             for case in tqdm(cases, desc='rest', unit='case')}
    table = output.markdown_table(
        ['case', 'expected', 'figure', 'limit', *ways],
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
        machine=about, table=table, model=options.model), encoding='utf-8')
    print(table)
    for line in missed:
        print(f'rest: {line}', file=sys.stderr)
    return int(bool(missed))


if __name__ == '__main__':
    sys.exit(main())

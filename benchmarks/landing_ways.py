# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which landings are run, what is measured of each, and by which ways of contact and force.

This package's models give patches, whose forces are those of `PatchForces`. `paper` and `soup-8`
give a point alone, and the whole load stands for its patch, as in the demo. MuJoCo's own manifold
is the reference to reach: forces of several points, implicit, within the simulator, at every
physics step.

`ADDED` are landings outside the grid, each with what it is expected to do.
"""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any, NamedTuple, Self

import mujoco
import numpy as np

from box_contact_ros.demo.crane import Crane, CraneScenario
from box_contact_ros.demo.landing import (
    DURATION,
    TILT_LIMIT,
    ClosedLoop,
    Landing,
    LandingRecord,
    with_patch,
)
from box_contact_ros.forces.patch_forces import FRICTION
from box_contact_ros.models.make_model import make_model
from box_contact_ros.scene.boxes import CONTAINER
from box_contact_ros.solver.contact_solver import ContactSolver
from box_contact_ros.solver.pose import rotation_matrix

WATCHED, WINDOW = 15.0, 5.0
"""Time that is judged after the first touch, and its last part [s]: longer than in the demo."""

# --- one landing ----------------------------------------------------------------------------------

def solvers(scenario: CraneScenario, model: str) -> list[ContactSolver]:
    """Return a solver of that model for each box of the stack."""
    return [ContactSolver(scenario.size, size, model=make_model(model))
            for _, size in scenario.stack_boxes.values()]


def land(scenario: CraneScenario, solvers: Sequence[ContactSolver], *, rate_hz: float = 200.0,
         latency: float = 0.0) -> LandingRecord:
    """Run one landing with contacts that act `latency` [s] after they were asked for.

    solvers: for each box of the stack.
    """
    loop = ClosedLoop(scenario, rate_hz, watched=WATCHED, window=WINDOW)
    while not loop.record.ended:
        state = loop.ask()
        loop.answer(state, {
            name: with_patch(solver(state.pose, pose), state.pose, scenario.size)
            for (name, (pose, _)), solver in zip(scenario.stack_boxes.items(), solvers)},
            latency=latency)
        loop.step()
    return loop.record


# --- cases ----------------------------------------------------------------------------------------

CASTING = (0.178, 0.162, 0.118)  # full extents of a corner casting, ISO 1161 [m]
AIMING_RATE = 100.0  # ticks a second while the trolley is placed; the load moves 5 mm at most


@dataclass(frozen=True, kw_only=True)
class OnCastings(CraneScenario):
    """The load meets four corner castings, flush with the stack's top, and not the rest."""

    @property
    def stack_boxes(self) -> dict[str, tuple[np.ndarray, tuple[float, float, float]]]:
        """Return pose (7,) and full extents [m] of each casting, by name."""
        inset = 0.5 * (np.array(self.stack_size) - CASTING)[:2]
        boxes = {}
        for x, y in product((1, -1), repeat=2):
            pose = self.stack_pose
            pose[:3] = x * inset[0], y * inset[1], self.stack_size[2] - 0.5 * CASTING[2]
            boxes[f'casting {x:+} {y:+}'] = (pose, CASTING)
        return boxes


def aimed(planned: PlannedLanding) -> PlannedLanding:
    """Return the landing with its trolley where the swaying load first touches at its overhang.

    Moving the trolley moves the whole motion before the touch, so the trolley is shifted by what
    was missed. It is shifted twice: the first shift may change which corner touches.
    """
    scenario = replace(planned.scenario, offset=planned.overhang)
    exact = solvers(scenario, 'exact')
    boxes = [pose for pose, _ in scenario.stack_boxes.values()]
    for _ in range(2):
        crane = Crane(scenario, AIMING_RATE)
        while not any(solver(crane.load_pose, pose).colliding
                      for solver, pose in zip(exact, boxes)):
            if crane.time > DURATION:
                raise ValueError(f'the load never touches: {scenario}')
            crane.step()
        missed = planned.overhang - crane.load_pose[:2]
        scenario = replace(scenario, offset=tuple(scenario.offset + missed))
    return replace(planned, scenario=scenario)


# --- what is measured -----------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Landed(Landing):
    """Further figures of one landing. SI units; NaN where nothing was measured."""

    tilt_limit: float = TILT_LIMIT
    """Limit of the static tilt [rad]; higher in a scenario in which the load cannot lie flatter."""
    overhang: float = math.nan  # lateral distance of the two centres at the first touch [m]
    drop: float = math.nan  # how far the load's centre ends below its place on the stack [m]
    creep: float = math.nan  # mean lateral speed of the load's centre over the window [m/s]
    point_step: float = math.nan  # largest |Δpoint| between neighbouring ticks in the window [m]
    touch_speed: float = math.nan  # of the fastest lower corner at the stack's height [m/s]

    @property
    def limits(self) -> dict[str, tuple[bool, str]]:
        """Return the limits of `Landing`, with the tilt limit of this landing."""
        return super().limits | {'static tilt': (
            self.static_tilt <= self.tilt_limit,
            f'{math.degrees(self.static_tilt):.2g} deg '
            f'(limit {math.degrees(self.tilt_limit):g})')}

    @classmethod
    def of(cls, record: LandingRecord, tilt_limit: float = TILT_LIMIT) -> Self:
        """Measure a landing; tilt_limit: of the static tilt [rad]."""
        landing, scenario = record.judge(), record.scenario
        if math.isnan(landing.touched):
            return cls()
        first = round(landing.touched * record.rate_hz)
        window = record.window_after(first)
        poses = np.array(record.poses)[:window.stop]
        figures = {'overhang': float(np.hypot(*poses[first, :2])),
                   'drop': scenario.stack_size[2] + 0.5 * scenario.size[2] - float(poses[-1, 2]),
                   'touch_speed': touch_speed(poses, scenario, record.rate_hz)}
        if len(poses) == window.stop:
            way = poses[-1, :2] - poses[window.start, :2]
            nowhere = np.full(3, math.nan)
            path = [record.points.get(tick, nowhere) for tick in range(window.start - 1,
                                                                       window.stop)]
            steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
            figures['creep'] = float(np.hypot(*way)) / WINDOW
            if np.isfinite(steps).any():
                figures['point_step'] = float(np.nanmax(steps))
        return cls(**asdict(landing), **figures, tilt_limit=tilt_limit)


def touch_speed(poses: np.ndarray, scenario: CraneScenario, rate_hz: float) -> float:
    """Return the largest speed of a lower corner as it comes down to the stack's height [m/s].

    poses: of the load (n, 7), a tick each.
    """
    corners = 0.5 * np.array(scenario.size) * [(x, y, -1) for x, y in product((-1, 1), repeat=2)]
    up = rotation_matrix(poses[:, 3:])[:, 2]
    heights = poses[:, 2, None] + up @ corners.T - scenario.stack_size[2]
    before, after = heights[:-1], heights[1:]
    way = np.max(before - after, where=(before > 0.0) & (after <= 0.0), initial=0.0)
    return float(way * rate_hz)


class HeldLimits(NamedTuple):
    """What a landing of the grid by patches must not exceed, from its tenth second on."""

    corner_speed: float = 1e-7  # of the fastest corner [m/s]
    creep: float = 1e-8  # mean lateral speed of the centre [m/s]
    depth: float = 3e-3  # ever, as a share of the load's height
    static_tilt: float = TILT_LIMIT  # [rad]

    @classmethod
    def at(cls, timing: LoopTiming, sinking: float = 0.0) -> Self:
        """Return the limits at a timing: a load lies flatter on contacts that come more often.

        A corner that touches just after a question sinks on until the next answer acts.
        sinking: its speed, by the load's height [1/s].
        """
        rate_hz, latency = timing
        degrees = 0.003 if rate_hz >= 1000.0 else 0.01 if rate_hz >= 200.0 else 0.06
        sunk = sinking * (1.0 / rate_hz + latency)
        return cls(static_tilt=math.radians(degrees), depth=max(cls().depth, sunk))

    def are_met(self, result: Landed) -> bool:
        """Return whether a landing is within all limits."""
        return all(getattr(result, name) <= limit for name, limit in self._asdict().items())


# --- landings -------------------------------------------------------------------------------------

LEAST_DROP = 0.05
"""A load has fallen if its centre ends so far below its place on the stack [m]. The ropes, paid
out by 0.8 m, catch it then."""


@dataclass(frozen=True, kw_only=True)
class PlannedLanding:
    """One landing and what is expected of it."""

    name: str
    scenario: CraneScenario
    overhang: tuple[float, float]
    """x, y [m] of the load's centre from the stack's at the first touch; see `aimed`."""
    falls: bool = False
    """Whether the load must fall; else it must come to rest within all limits."""
    tilt_limit: float = TILT_LIMIT

    @property
    def of_grid(self) -> bool:
        """Return whether it is a landing of the grid."""
        return self.name.startswith('grid')

    def as_expected(self, result: Landed) -> bool:
        """Return whether a landing did what it was expected to do."""
        if self.falls:
            return not result.at_rest and result.drop > LEAST_DROP
        return result.at_rest


def _tilted(tilt: float, heading: float) -> dict[str, float]:
    """Return pitch and roll [deg] of a tilt whose heading is 0° for pitch and 90° for roll."""
    return {'pitch': tilt * math.cos(math.radians(heading)),
            'roll': tilt * math.sin(math.radians(heading))}


def _along(overhang: float, heading: float) -> tuple[float, float]:
    """Return x, y [m] of an overhang in a direction [deg]."""
    return (overhang * math.cos(math.radians(heading)), overhang * math.sin(math.radians(heading)))


def grid(seed: int = 1) -> list[PlannedLanding]:
    """Return 36 landings: each combination of rope angle, tilt and overhang.

    Headings and the yaw, up to 1°, are drawn.
    """
    random = np.random.default_rng(seed)
    planned = []
    for rope_angle, tilt, overhang in product((0.5, 1.25, 2.0, 3.0), (0.5, 1.5, 3.0),
                                              (0.0, 0.3, 0.6)):
        rope, tilted, hanging = random.uniform(-180.0, 180.0, 3)
        planned.append(PlannedLanding(
            name=f'grid {len(planned)}', overhang=_along(overhang, hanging), scenario=CraneScenario(
                rope_angle=rope_angle, rope_heading=rope, yaw=random.uniform(-1.0, 1.0),
                **_tilted(tilt, tilted))))
    return planned


def _added(name: str, overhang: float = 0.05, heading: float = 160.0, *, tilt: float = 1.0,
           rope_angle: float = 0.5, yaw: float = 0.1, falls: bool = False,
           tilt_limit: float = TILT_LIMIT, kind: type[CraneScenario] = CraneScenario,
           **fields: Any) -> PlannedLanding:
    return PlannedLanding(
        name=name, overhang=_along(overhang, heading), falls=falls, tilt_limit=tilt_limit,
        scenario=kind(rope_angle=rope_angle, rope_heading=70.0, yaw=yaw, **_tilted(tilt, 30.0),
                      **fields))


_LENGTH, _WIDTH, _ = CONTAINER
_SMALL = {'size': (6.058, 2.438, 2.591), 'mass': 12_000.0}
_SPREADER = {'size': (_LENGTH, _WIDTH, 1.5), 'mass': 15_000.0, 'kind': OnCastings}
ADDED = [
    _added('mass 10 % of the length off the middle', mass_offset=(0.1 * _LENGTH, 0.0, 0.0)),
    _added('mass 10 % of length and width off', tilt=2.0, yaw=-0.8,
           mass_offset=(-0.1 * _LENGTH, 0.1 * _WIDTH, 0.0)),
    _added('on a pedestal, 6 × 2 m', tilt=2.0, stack_size=(6.0, 2.0, 1.0)),
    _added('on a platform, 14 × 4 m', 0.3, rope_angle=2.0, stack_size=(14.0, 4.0, 1.0)),
    _added('20 ft on 40 ft', 0.3, 0.0, tilt=2.0, **_SMALL),
    _added('20 ft at the end of 40 ft', 3.0, 0.0, **_SMALL),
    _added('a cube of 0.5 m, 300 kg', 0.02, size=(0.5, 0.5, 0.5), mass=300.0),
    _added('overhanging by 40 % of the length', 0.4 * _LENGTH, 0.0),
    _added('overhanging by 30 % of the width', 0.3 * _WIDTH, 90.0, tilt_limit=math.radians(0.1)),
    _added('spreader on four corner castings', **_SPREADER),
    _added('the same, tilted by 2°', tilt=2.0, yaw=-0.3, **_SPREADER),
    _added('overhanging by 55 % of the width', 0.55 * _WIDTH, 90.0, falls=True),
    _added('overhanging by 55 % of the length', 0.55 * _LENGTH, 180.0, falls=True),
]
"""Landings outside the grid. Where the load's middle is a fifth of the width within the edge, its
weight rests on a strip of three fifths. The other end is bare, so it cannot lie as flat."""

# --- ways -----------------------------------------------------------------------------------------

class LoopTiming(NamedTuple):
    """Ticks a second, and the time [s] from asking for contacts to their force."""

    rate_hz: float
    latency: float


class Way(NamedTuple):
    """What gives the contacts."""

    contacts: str
    model: str | None  # None: MuJoCo, in the simulator
    every: int = 1
    """One of so many landings of the grid is run. Prime to three: every third landing has the same
    overhang."""
    size: tuple[float, float, float] | None = None
    """Full extents [m] of the only boxes that the model has weights for; None: it takes any."""

    def lands(self, scenario: CraneScenario) -> bool:
        """Return whether the model takes load and stack."""
        sizes = {scenario.size, *(size for _, size in scenario.stack_boxes.values())}
        return self.size is None or sizes == {self.size}

    def timings(self, timings: Sequence[LoopTiming]) -> list[LoopTiming]:
        """Return those at which it is run: all of a model, one of MuJoCo."""
        return list(timings if self.model else timings[-1:])

    def run(self, scenario: CraneScenario, timing: LoopTiming) -> LandingRecord:
        """Run one landing."""
        if self.model is None:
            return own_contact(scenario, timing.rate_hz)
        return land(scenario, solvers(scenario, self.model), **timing._asdict())


def own_contact(scenario: CraneScenario, rate_hz: float) -> LandingRecord:
    """Run one landing on MuJoCo's own contacts; it ends when all that is judged was seen."""
    crane = Crane(scenario, rate_hz)
    for kind in ('geom', 'body'):  # MuJoCo keeps for each body what its geoms have
        for bits in ('contype', 'conaffinity'):
            getattr(crane.model, f'{kind}_{bits}')[:] = 1
    crane.model.geom_friction[:, 0] = FRICTION
    record = LandingRecord(scenario, rate_hz, WATCHED, WINDOW)
    while not record.ended:
        record.poses.append(crane.load_pose)
        record.velocities.append(crane.load_velocity)
        crane.step()
        record.tensions.append(crane.rope_tensions)
        record.forces.append(own_force(crane))
        if record.forces[-1].any():
            record.points[len(record.forces) - 1] = np.full(3, math.nan)
    return record


def own_force(crane: Crane) -> np.ndarray:
    """Return the force (3,) [N] of MuJoCo's own contacts on the load in the last physics step."""
    total, force = np.zeros(3), np.zeros(6)
    for number in range(crane.data.ncon):
        mujoco.mj_contactForce(crane.model, crane.data, number, force)
        # Rows of a frame are axes; its normal points to the load, the body of higher number.
        total += crane.data.contact[number].frame.reshape(3, 3).T @ force[:3]
    return total


WAYS = {'exact': Way('exact', 'exact'), 'mlp': Way('mlp', 'mlp', every=5),
        'paper': Way('paper', 'paper', every=5, size=CONTAINER),
        'soup-8': Way('soup-8', 'soup-8', every=5),
        'manifold': Way("MuJoCo's manifold, in the simulator", None)}
"""By name: the ways that the table has."""

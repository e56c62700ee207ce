# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A container set down by its contacts, one per box of the stack and tick. No ROS.

A `ClosedLoop` steps a crane under a law of force, wherever the contacts come from, and records what
happened; `land` closes it with any function of the two poses. `LandingRecord.judge` measures the
record. The load settles if, from some time on, no corner moves faster than `SETTLED_SPEED`, until
`WATCHED` s after the first touch. It is at rest if it meets every limit of `LandingResult.limits`.
The window is the last `WINDOW` s of the time that is watched.

Depth, gap and first touch are those of the exact solver on the recorded poses, whatever model gave
the contacts. Conventions: those of `laws` and `mujoco_crane`.
"""
from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np

from ..output import percentiles
from ..scene.force.laws import GRAVITY
from ..scene.pose import rotation_matrix
from ..solver.contact import Contact
from ..solver.contact_solver import ContactSolver
from .crane_log import table
from .load_laws import LoopState, MakeLaw, NamedContacts, held_patch
from .mujoco_crane import LANDING_OVERLAP, Crane, CraneScenario

SETTLING, WINDOW = 10.0, 5.0
"""The load has to be at rest from `SETTLING` s after the first touch on, for `WINDOW` s."""
WATCHED = SETTLING + WINDOW
AHEAD = 0.05
"""A predictor's first contact may come so much before the first touch [s]."""
SETTLED_SPEED = 0.010  # speed of the load's fastest corner [m/s] below which it has settled
SETTLED_LIMIT = 3.0  # time from the first touch until then [s]
CORNER_SPEED_LIMIT = 0.3e-3  # speed of the fastest corner in the window [m/s]
FORCE_LIMIT = 1e-6
"""Deviation of the contact force's vertical part from the weight, as a share of the weight."""
TILT_LIMIT = math.radians(0.06)
"""Mean angle between the load's and the world's vertical in the window [rad]."""
DEPTH_LIMIT = 0.01  # depth as a share of the load's height, always
GAP_LIMIT = 0.020  # gap after the first touch [m]: how high it may bounce

LANDING_DURATION = 25.0
"""Length of a landing [s]. The first touch comes after 5 to 8 s, and 15 s more are looked at."""

ContactSource = Callable[[np.ndarray, np.ndarray], Contact | None]
"""From pose_a and pose_b (7,) to their contact; None stands for an answer that was lost."""


def with_patch(touch: Contact, pose: np.ndarray, size: Sequence[float]) -> Contact:
    """Return a contact with a patch: that of the whole load where its model gives the point alone.

    pose, size: of the load, (7,) and full extents [m]. Volume = depth · V / h with the load's
    volume V and its extent h along the normal; covariance = that of the load. For the law, this is
    a spring at the point, with the dampers of the whole bottom.
    """
    if math.isfinite(touch.volume):
        return touch
    axes = rotation_matrix(pose[3:])
    along = float(np.abs(touch.normal @ axes) @ size)
    depth = max(0.0, -touch.separation)  # at exact touch the separation may be above zero
    return touch._replace(volume=depth * float(np.prod(size)) / along,
                          covariance=(axes * np.square(size) / 12.0) @ axes.T)


def landing_scenario(seed: int = 0, **fields: Any) -> CraneScenario:
    """Return a scenario that sets the load down: `CraneScenario.drawn` with further fields."""
    landing = {'land': True, 'overlap': LANDING_OVERLAP, 'duration': LANDING_DURATION}
    return CraneScenario.drawn(seed, **landing | fields)


@dataclass(frozen=True, kw_only=True)
class LandingCase:
    """What is varied from landing to landing. Angles in degrees, lengths in m."""

    rope_angle: float  # of the ropes at the start, from the plumb line
    rope_heading: float
    tilt: float  # of the load at the start
    tilt_heading: float  # the share of pitch (its cosine) and roll (its sine)
    overhang: float  # lateral distance of the two centres at the first touch
    overhang_heading: float
    yaw: float  # of the load at the start


def cases(*, rope_angles: Sequence[float] = (0.5, 1.25, 2.0, 3.0),
          tilts: Sequence[float] = (0.5, 1.5, 3.0), overhangs: Sequence[float] = (0.0, 0.3, 0.6),
          seed: int = 1) -> Iterator[LandingCase]:
    """Yield each combination of rope angle, tilt and overhang; draw headings and yaw (to 1°)."""
    random = np.random.default_rng(seed)
    for rope_angle, tilt, overhang in product(rope_angles, tilts, overhangs):
        rope, tilted, hanging = random.uniform(-180.0, 180.0, 3)
        yield LandingCase(
            rope_angle=rope_angle, rope_heading=rope, tilt=tilt, tilt_heading=tilted,
            overhang=overhang, overhang_heading=hanging, yaw=random.uniform(-1.0, 1.0))


AIMING_RATE = 100.0
"""Ticks a second while the trolley is placed; the load moves 5 mm a tick at most."""


def scenario_of(case: LandingCase, **fields: Any) -> CraneScenario:
    """Return the scenario of a case: the trolley stands where the load sways to its overhang.

    fields: further ones of CraneScenario.

    Moving the trolley moves the whole motion before the touch, so the trolley is shifted by what
    was missed. It is shifted twice: the first shift may change which corner touches.
    """
    tilt, heading = case.tilt, math.radians(case.tilt_heading)
    hanging = math.radians(case.overhang_heading)
    wanted = case.overhang * np.array([math.cos(hanging), math.sin(hanging)])
    scenario = landing_scenario(
        offset=tuple(wanted), rope_angle=case.rope_angle, rope_heading=case.rope_heading,
        pitch=tilt * math.cos(heading), roll=tilt * math.sin(heading), yaw=case.yaw, **fields)
    exact = solvers(scenario, 'exact')
    boxes = [pose for pose, _ in scenario.stack_boxes]
    for _ in range(2):
        crane = Crane(scenario, AIMING_RATE)
        while not any(solver(crane.load_pose, pose).colliding
                      for solver, pose in zip(exact, boxes)):
            if crane.time > scenario.duration:
                raise ValueError(f'the load never touches: {case}')
            crane.step()
        missed = wanted - (crane.load_pose - crane.stack_pose)[:2]
        scenario = dataclasses.replace(scenario, offset=tuple(scenario.offset + missed))
    return scenario


@dataclass(frozen=True, kw_only=True)
class LandingResult:
    """Figures of one landing. SI units, angles in rad; NaN where nothing was measured."""

    touched: float = math.nan  # time of the first touch [s], NaN for never
    overhang: float = math.nan  # lateral distance of the two centres then [m]
    settled: float = math.nan
    """Time from the first touch until corners stay below `SETTLED_SPEED` [s], NaN for never."""
    corner_speed: float = math.nan  # of the fastest corner in the window [m/s]
    rope_tension: float = math.nan  # of the tautest rope in the window [N]
    force_error: float = math.nan  # |mean contact force − weight| / weight over the window
    force_worst: float = math.nan  # the same of the window's worst tick
    tilt: float = math.nan  # largest in the window [rad]
    static_tilt: float = math.nan  # mean over the window [rad]
    tilt_limit: float = TILT_LIMIT  # what the scenario's static tilt is held to [rad]
    creep: float = math.nan  # mean lateral speed of the load's centre over the window [m/s]
    energy_gain: float = math.nan
    """Largest gain of kinetic and potential energy over the window's start [J]."""
    depth: float = math.nan  # largest ever, as a share of the load's height
    gap: float = math.nan  # largest after the first touch [m]
    drop: float = math.nan  # how far the load's centre ends below its place on the stack [m]
    point_step: float = math.nan  # largest |Δpoint| between neighbouring ticks in the window [m]
    exact_point_step: float = math.nan  # the same of the exact point on the same poses
    point_step_ever: float = math.nan  # largest |Δpoint| over the whole contact [m]
    exact_point_step_ever: float = math.nan

    @property
    def limits(self) -> dict[str, tuple[bool, str]]:
        """Whether each limit is met, by name, and figure and limit in words.

        What was not measured is not met.
        """
        return {
            'settled': (self.settled <= SETTLED_LIMIT,
                        f'{self.settled:.2f} s after the first touch (limit {SETTLED_LIMIT:g})'),
            'corner speed': (self.corner_speed <= CORNER_SPEED_LIMIT,
                             f'{1e3 * self.corner_speed:.3g} mm/s at most '
                             f'(limit {1e3 * CORNER_SPEED_LIMIT:g})'),
            'ropes slack': (self.rope_tension == 0.0, f'{self.rope_tension:.3g} N at most'),
            'force': (self.force_worst <= FORCE_LIMIT,
                      f'{self.force_worst:.1g} of the weight off it (limit {FORCE_LIMIT:g})'),
            'static tilt': (self.static_tilt <= self.tilt_limit,
                            f'{math.degrees(self.static_tilt):.2g} deg '
                            f'(limit {math.degrees(self.tilt_limit):g})'),
            'depth': (self.depth < DEPTH_LIMIT, f'{100 * self.depth:.2g} % of the height '
                                                f'(limit {100 * DEPTH_LIMIT:g})'),
            'gap': (self.gap < GAP_LIMIT, f'{1e3 * self.gap:.2g} mm after the first touch '
                                          f'(limit {1e3 * GAP_LIMIT:g})'),
        }

    @property
    def at_rest(self) -> bool:
        """Whether all limits are met."""
        return all(met for met, _ in self.limits.values())

    @property
    def carried(self) -> bool:
        """Whether the stack carries the load, still for good, though perhaps not flat.

        A load that overhangs a lot cannot lie flat on an elastic stack.
        """
        return not math.isnan(self.settled) and all(
            self.limits[name][0] for name in ('ropes slack', 'depth', 'gap'))

    def __str__(self) -> str:
        """Return a few lines for people: every figure with its limit."""
        if math.isnan(self.corner_speed):
            return f'  landing ................ not judged: it takes a touch and {WATCHED:g} s more'
        state = ('at rest' if self.at_rest else 'settled, not within all limits' if self.carried
                 else 'NOT AT REST')
        rows = [('landing', f'{state} (first touch at {self.touched:.2f} s)')]
        rows += [(name, figure + ('' if met else '  <-- not met'))
                 for name, (met, figure) in self.limits.items()]
        rows += [('creep', f'{1e3 * self.creep:.2g} mm/s'),
                 ('point steps', f'{1e3 * self.point_step:.2g} mm at most between ticks (exact: '
                                 f'{1e3 * self.exact_point_step:.2g}), while settling '
                                 f'{1e3 * self.point_step_ever:,.0f} mm (exact: '
                                 f'{1e3 * self.exact_point_step_ever:,.0f})')]
        return table(rows)


@dataclass
class LandingRecord:
    """A landing tick by tick: the state before each tick, rope tensions and force at its end."""

    scenario: CraneScenario
    rate_hz: float
    poses: list[np.ndarray] = field(default_factory=list)
    velocities: list[np.ndarray] = field(default_factory=list)
    tensions: list[np.ndarray] = field(default_factory=list)
    forces: list[np.ndarray] = field(default_factory=list)
    points: dict[int, np.ndarray] = field(default_factory=dict)
    """Contact points (3,) by the tick they were asked for; none where there was no contact."""

    @property
    def ended(self) -> bool:
        """Whether all that is judged has been recorded, or the scenario's time is over."""
        ticks, first = len(self.forces), next(iter(self.points), len(self.poses))
        return (ticks - first > (WATCHED + AHEAD) * self.rate_hz
                or ticks >= round(self.scenario.duration * self.rate_hz))

    def corner_speeds(self, first: int = 0) -> np.ndarray:
        """Return the speed [m/s] of the fastest of the load's eight corners, per tick (n,).

        first: the tick to begin with; a negative one counts from the end.
        """
        signs = np.array(list(product((-0.5, 0.5), repeat=3)))
        poses, velocities = np.array(self.poses[first:]), np.array(self.velocities[first:])
        arms = np.einsum('nij,kj->nki', rotation_matrix(poses[:, 3:]),
                         signs * self.scenario.size - self.scenario.mass_offset)
        speeds = velocities[:, None, :3] + np.cross(velocities[:, None, 3:], arms)
        return np.linalg.norm(speeds, axis=2).max(axis=1)

    def tilts(self) -> np.ndarray:
        """Return the angle [rad] between the load's vertical and the world's, per tick (n,)."""
        up = rotation_matrix(np.array(self.poses)[:, 3:])[:, :, 2]
        return np.arctan2(np.hypot(up[:, 0], up[:, 1]), up[:, 2])

    def energies(self) -> np.ndarray:
        """Return kinetic and potential energy [J] per tick (n,)."""
        scenario = self.scenario
        poses, velocities = np.array(self.poses), np.array(self.velocities)
        axes = rotation_matrix(poses[:, 3:])
        spins = np.einsum('nij,ni->nj', axes, velocities[:, 3:])
        height = poses[:, 2] + axes[:, 2] @ scenario.mass_offset
        energies: np.ndarray = 0.5 * (
            scenario.mass * np.square(velocities[:, :3]).sum(axis=1)
            + np.square(spins) @ scenario.inertia) + scenario.mass * GRAVITY * height
        return energies

    def point_path(self) -> np.ndarray:
        """Return contact points (n, 3) [m], NaN where there was no contact or no answer."""
        path = np.full((len(self.poses), 3), math.nan)
        for tick, point in self.points.items():
            path[tick] = point
        return path

    def judge(self, *, tilt_limit: float = TILT_LIMIT) -> LandingResult:
        """Measure the landing; what would have to be measured later than its end is NaN.

        tilt_limit: of the static tilt [rad], for a scenario in which the load cannot lie flatter.
        """
        scenario, ticks = self.scenario, len(self.forces)
        if not ticks:
            return LandingResult()
        poses = np.array(self.poses)[:ticks]
        colliding, separation, exact_points = _exact(scenario, poses)
        if not colliding.any():
            return LandingResult()
        first = int(np.argmax(colliding))
        window = slice(first + round(SETTLING * self.rate_hz),
                       first + round(WATCHED * self.rate_hz))
        seen, ticks = ticks, min(ticks, window.stop)  # what comes later is not looked at
        separation, poses = separation[:ticks], poses[:ticks]
        speeds = self.corner_speeds()[:ticks]
        fast = np.flatnonzero(speeds[first:] >= SETTLED_SPEED)
        still = fast[-1] + 1 if len(fast) else 0
        steps, exact_steps = (_steps(points[:ticks])
                              for points in (self.point_path(), exact_points))
        place = scenario.stack_size[2] + 0.5 * scenario.size[2]
        figures = {
            'touched': first / self.rate_hz,
            'overhang': float(np.hypot(*(poses[first, :2] - scenario.drop_position))),
            'settled': still / self.rate_hz if first + still < ticks else math.nan,
            'tilt_limit': tilt_limit,
            'depth': float(np.max(-separation)) / scenario.size[2],
            'gap': float(max(0.0, np.max(separation[first:]))),
            'drop': place - float(poses[-1, 2]),
            'point_step_ever': _largest(steps[first:]),
            'exact_point_step_ever': _largest(exact_steps[first:]),
        }
        if window.stop <= seen:
            figures |= self._in(window) | {'point_step': _largest(steps[window]),
                                           'exact_point_step': _largest(exact_steps[window])}
        return LandingResult(**figures)

    def _in(self, window: slice) -> dict[str, float]:
        """Return the figures of a window of ticks."""
        weight = self.scenario.mass * GRAVITY
        forces, energies = np.array(self.forces)[window, 2], self.energies()[window]
        tilts, places = self.tilts()[window], np.array(self.poses)[window, :2]
        return {
            'corner_speed': float(self.corner_speeds()[window].max()),
            'rope_tension': float(np.array(self.tensions)[window].max()),
            'force_error': abs(float(forces.mean()) / weight - 1.0),
            'force_worst': float(np.abs(forces / weight - 1.0).max()),
            'tilt': float(tilts.max()), 'static_tilt': float(tilts.mean()),
            'creep': float(np.hypot(*(places[-1] - places[0]))) / WINDOW,
            'energy_gain': float(energies.max() - energies[0]),
        }


def _exact(scenario: CraneScenario, poses: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return of the load's poses (n, 7): touching (n,), separation (n,), exact points (n, 3).

    The least separation of the stack's boxes, and the point on the first of them.
    """
    found = [ContactSolver(scenario.size, size, model='exact').batch(
        poses, np.broadcast_to(pose, poses.shape)) for pose, size in scenario.stack_boxes]
    return (np.any([one.colliding for one in found], axis=0),
            np.min([one.separation for one in found], axis=0), found[0].point)


class ClosedLoop:
    """A crane under the wrench of a law, recorded tick by tick, wherever contacts come from."""

    def __init__(self, scenario: CraneScenario, rate_hz: float, *, latency: float = 0.0,
                 law: MakeLaw = held_patch) -> None:
        """Make the crane, and the law for its load, this rate and latency [s]."""
        self.crane, self.record = Crane(scenario, rate_hz), LandingRecord(scenario, rate_hz)
        self._law = law(scenario.load, rate_hz=rate_hz, latency=latency,
                        step=self.crane.physics_step)
        self._wrench = np.zeros(6)

    def ask(self) -> LoopState:
        """Begin a tick; return the state whose contacts are asked for."""
        crane = self.crane
        state = LoopState(len(self.record.poses), crane.time, crane.load_pose, crane.load_velocity)
        self.record.poses.append(state.pose)
        self.record.velocities.append(state.velocity)
        return self._law.asked_for(state)

    def answer(self, state: LoopState, contacts: NamedContacts, *, latency: float) -> None:
        """Take the contacts of a state; they act `latency` [s] after they were asked for."""
        touches = [contact for contact in contacts.values() if contact.colliding]
        if touches:
            self.record.points[state.tick] = np.array(touches[0].point)
        self._law.answer(contacts, state, due=state.time + latency)

    def step(self) -> None:
        """End the tick: advance the crane under what is due.

        ValueError: the law needs what a contact's model does not give.
        """
        self.crane.step(self._at)
        self.record.tensions.append(self.crane.rope_tensions)
        self.record.forces.append(self._wrench[:3].copy())

    def _at(self, time: float) -> np.ndarray:
        """Return the wrench (6,) of the physics step that starts at `time` [s]."""
        self._wrench = self._law.wrench(time, self.crane.load_pose, self.crane.load_velocity)
        return self._wrench


class Progress:
    """The landing's stages as they come: a line a change, for people who watch."""

    STAGES = ('hanging', 'first touch', 'settling', 'at rest')

    def __init__(self, record: LandingRecord) -> None:
        """Follow a record while it grows."""
        self._record, self._seen = record, -1

    def lines(self) -> Iterator[str]:
        """Yield a line for each stage that was reached since the last call."""
        record = self._record
        if not record.forces:
            return
        tick, speed = len(record.forces), float(record.corner_speeds(-1)[-1])
        slack = not record.tensions[-1].any()
        reached = (0 if not record.points else 1 if not slack else
                   2 if speed > CORNER_SPEED_LIMIT else 3)
        for stage in range(self._seen + 1, reached + 1):
            yield (f'{tick / record.rate_hz:7.2f} s  {self.STAGES[stage]:<12} '
                   f'fastest corner {1e3 * speed:8.3g} mm/s, '
                   f'contact force {record.forces[-1][2] / 1e3:5.1f} kN')
        self._seen = max(self._seen, reached)


def solvers(scenario: CraneScenario, model: str) -> list[ContactSolver]:
    """Return a solver of that model for each box of the stack."""
    return [ContactSolver(scenario.size, size, model=model) for _, size in scenario.stack_boxes]


def land(scenario: CraneScenario, sources: ContactSource | Sequence[ContactSource], *,
         rate_hz: float = 200.0, latency: float = 0.0, law: MakeLaw = held_patch) -> LandingRecord:
    """Run one landing with contacts that act `latency` s after they were asked for.

    sources: for each box of the stack, such as `solvers`; where one gives None, the answer is lost.
    ValueError: a contact lacks what the law needs; its source's model is named.
    """
    each = [sources] if callable(sources) else list(sources)
    loop = ClosedLoop(scenario, rate_hz, latency=latency, law=law)
    pairs = [(name, source, pose) for (name, (pose, _)), source in zip(
        scenario.pairs.items(), each)]
    while not loop.record.ended:
        state = loop.ask()
        contacts = {name: found for name, source, pose in pairs
                    if (found := source(state.pose, pose)) is not None}
        try:
            if len(contacts) == len(pairs):
                loop.answer(state, contacts, latency=latency)
            loop.step()
        except ValueError as error:
            raise ValueError(f'model {getattr(each[0], "model", "unknown")}: {error}') from None
    return loop.record


def _steps(points: np.ndarray) -> np.ndarray:
    """Return |Δpoint| [m] to the row before (n,), NaN where one of the two is missing."""
    return np.linalg.norm(np.diff(points, axis=0, prepend=math.nan), axis=1)


def _largest(values: np.ndarray) -> float:
    return percentiles(values[~np.isnan(values)], 100)[0]

"""A container set down by one contact point per tick, and whether it came to rest. No ROS.

A `ClosedLoop` steps a crane under a `ForceLaw`, wherever the contacts come from, and records what
happened; `land` closes it with any function of the two poses. `LandingRecord.judge` measures the
record against these criteria, from `SETTLING` s after the first touch on, for `WINDOW` s:

- No corner of the load moves faster than `corner_speed_limit`. All ropes are slack.
- The contact force is within `FORCE_LIMIT` of the weight at every tick.
- The load is tilted by less than `TILT_LIMIT`.
- Always: the depth is less than `DEPTH_LIMIT` of the load's height.
- After the first touch, no gap opens wider than `GAP_LIMIT`.

Depth, gap and first touch are those of the exact solver on the recorded poses, whatever model gave
the contacts. Conventions: those of `pose`, `contact_law` and `mujoco_crane`.
"""
from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any, NamedTuple, Protocol

import numpy as np

from ...output import percentiles
from ...scene.contact_law import GRAVITY, ContactLaw, HeldWrench, Touch
from ...scene.patch_law import Patch
from ...scene.pose import rotation_matrix
from ...solver.contact import Contact
from ...solver.contact_solver import ContactSolver
from .crane_log import table
from .mujoco_crane import LANDING_OVERLAP, Crane, CraneScenario

SETTLING, WINDOW = 10.0, 5.0
"""The load has to be at rest from `SETTLING` s after the first touch on, for `WINDOW` s."""
CORNER_SPEED_LIMIT = 0.010  # speed of the load's fastest corner at rest [m/s]
SLOW_CORNER_SPEED_LIMIT, SLOW_RATE = 0.020, 200.0
"""The same [m/s] at rates [1/s] up to `SLOW_RATE`, where the law is scaled down."""
FORCE_LIMIT = 0.01
"""Deviation of the contact force's vertical part from the weight, as a share of the weight."""
TILT_LIMIT = math.radians(0.5)  # angle between the load's and the world's vertical [rad]
DEPTH_LIMIT = 0.01  # depth as a share of the load's height
GAP_LIMIT = 0.020  # gap after the first touch [m]: how high it may bounce

LANDING_DURATION = 25.0
"""Length of a landing [s]. The first touch comes after 5 to 8 s, and 15 s more are looked at."""

ContactSource = Callable[[np.ndarray, np.ndarray], Contact | None]
"""From pose_a and pose_b (7,) to their contact; None stands for an answer that was lost."""


def touch_of(contact: Contact) -> Patch | None:
    """Return the part of a contact that a law needs; None where the boxes are apart."""
    if not contact.colliding:
        return None
    depth = max(0.0, -contact.separation)
    return Patch(contact.point, contact.normal, depth, contact.volume, contact.covariance)


def landing_scenario(**fields: Any) -> CraneScenario:
    """Return a scenario that sets the load down; `fields` are those of CraneScenario."""
    fields = {'land': True, 'overlap': LANDING_OVERLAP, 'duration': LANDING_DURATION} | fields
    return CraneScenario(**fields)


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


def scenario_of(case: LandingCase) -> CraneScenario:
    """Return the scenario of a case: the trolley stands where the load sways to its overhang.

    Moving the trolley moves the whole motion before the touch, so the trolley is shifted by what
    was missed. It is shifted twice: the first shift may change which corner touches.
    """
    tilt, heading = case.tilt, math.radians(case.tilt_heading)
    hanging = math.radians(case.overhang_heading)
    wanted = case.overhang * np.array([math.cos(hanging), math.sin(hanging)])
    scenario = landing_scenario(
        offset=tuple(wanted), rope_angle=case.rope_angle, rope_heading=case.rope_heading,
        pitch=tilt * math.cos(heading), roll=tilt * math.sin(heading), yaw=case.yaw)
    solver = ContactSolver(scenario.size, scenario.stack_size, model='exact')
    for _ in range(2):
        crane = Crane(scenario, AIMING_RATE)
        while not solver(crane.load_pose, crane.stack_pose).colliding:
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
    """Time from the first touch until corners stay within the limit [s], NaN for never."""
    corner_speed: float = math.nan  # of the fastest corner in the window [m/s]
    corner_speed_limit: float = CORNER_SPEED_LIMIT
    rope_tension: float = math.nan  # of the tautest rope in the window [N]
    force_error: float = math.nan  # |mean contact force − weight| / weight over the window
    force_worst: float = math.nan  # the same of the window's worst tick
    tilt: float = math.nan  # largest in the window [rad]
    depth: float = math.nan  # largest ever, as a share of the load's height
    gap: float = math.nan  # largest after the first touch [m]
    point_step: float = math.nan  # largest |Δpoint| between neighbouring ticks in the window [m]
    exact_point_step: float = math.nan  # the same of the exact point on the same poses
    point_step_ever: float = math.nan  # largest |Δpoint| over the whole contact [m]
    exact_point_step_ever: float = math.nan

    @property
    def verdicts(self) -> dict[str, bool]:
        """Whether each criterion is met, by name; what was not measured is not met."""
        return {
            'corner speed': self.corner_speed < self.corner_speed_limit,
            'ropes slack': self.rope_tension == 0.0,
            'force': self.force_worst < FORCE_LIMIT,
            'tilt': self.tilt < TILT_LIMIT,
            'depth': self.depth < DEPTH_LIMIT,
            'gap': self.gap < GAP_LIMIT,
        }

    @property
    def at_rest(self) -> bool:
        """Whether all criteria are met."""
        return all(self.verdicts.values())

    def __str__(self) -> str:
        """Return a few lines for people: every figure with its limit."""
        if math.isnan(self.corner_speed):
            return ('  landing ................ not judged: it takes a touch and '
                    f'{SETTLING + WINDOW:g} s after it')
        figures = {
            'corner speed': f'{1e3 * self.corner_speed:.3g} mm/s at most '
                            f'(limit {1e3 * self.corner_speed_limit:g})',
            'ropes slack': f'{self.rope_tension:.3g} N at most',
            'force': f'{100 * self.force_worst:.2g} % off the weight at worst, '
                     f'{100 * self.force_error:.2g} % on average (limit {100 * FORCE_LIMIT:g})',
            'tilt': f'{math.degrees(self.tilt):.2g} deg (limit {math.degrees(TILT_LIMIT):g})',
            'depth': f'{100 * self.depth:.2g} % of the height (limit {100 * DEPTH_LIMIT:g})',
            'gap': f'{1e3 * self.gap:.2g} mm after the first touch (limit {1e3 * GAP_LIMIT:g})',
        }
        still = 'never' if math.isnan(self.settled) else f'{self.settled:.2g} s after it'
        rows = [('landing', f'{"at rest" if self.at_rest else "NOT AT REST"} (first touch at '
                            f'{self.touched:.2f} s; corners below their limit: {still})')]
        rows += [(name, figures[name] + ('' if met else '  <-- not met'))
                 for name, met in self.verdicts.items()]
        rows.append(('point steps', f'{1e3 * self.point_step:.2g} mm at most between ticks (exact: '
                                    f'{1e3 * self.exact_point_step:.2g}), while settling '
                                    f'{1e3 * self.point_step_ever:.2g} mm (exact: '
                                    f'{1e3 * self.exact_point_step_ever:.2g})'))
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

    def corner_speeds(self) -> np.ndarray:
        """Return the speed [m/s] of the fastest of the load's eight corners, per tick (n,)."""
        signs = np.array(list(product((-0.5, 0.5), repeat=3)))
        poses, velocities = np.array(self.poses), np.array(self.velocities)
        arms = np.einsum('nij,kj->nki', rotation_matrix(poses[:, 3:]),
                         signs * self.scenario.size)
        speeds = velocities[:, None, :3] + np.cross(velocities[:, None, 3:], arms)
        return np.linalg.norm(speeds, axis=2).max(axis=1)

    def tilts(self) -> np.ndarray:
        """Return the angle [rad] between the load's vertical and the world's, per tick (n,)."""
        up = rotation_matrix(np.array(self.poses)[:, 3:])[:, :, 2]
        return np.arctan2(np.hypot(up[:, 0], up[:, 1]), up[:, 2])

    def vertical_forces(self) -> np.ndarray:
        """Return the vertical part [N] of the contact force, per tick (n,)."""
        return np.array(self.forces)[:, 2]

    def point_path(self) -> np.ndarray:
        """Return contact points (n, 3) [m], NaN where there was no contact or no answer."""
        path = np.full((len(self.poses), 3), math.nan)
        for tick, point in self.points.items():
            path[tick] = point
        return path

    def judge(self) -> LandingResult:
        """Measure the landing; what would have to be measured later than its end is NaN."""
        scenario, ticks = self.scenario, len(self.forces)
        limit = SLOW_CORNER_SPEED_LIMIT if self.rate_hz <= SLOW_RATE else CORNER_SPEED_LIMIT
        if not ticks:
            return LandingResult(corner_speed_limit=limit)
        poses = np.array(self.poses)[:ticks]
        stack = np.broadcast_to(Crane(scenario, self.rate_hz).stack_pose, (ticks, 7))
        exact = ContactSolver(scenario.size, scenario.stack_size, model='exact').batch(poses, stack)
        if not exact.colliding.any():
            return LandingResult(corner_speed_limit=limit)
        first = int(np.argmax(exact.colliding))
        speeds = self.corner_speeds()[:ticks]
        fast = np.flatnonzero(speeds[first:] >= limit)
        still = fast[-1] + 1 if len(fast) else 0
        steps, exact_steps = _steps(self.point_path()[:ticks]), _steps(exact.point)
        figures = {
            'touched': first / self.rate_hz,
            'overhang': float(np.hypot(*(poses - stack)[first, :2])),
            'settled': still / self.rate_hz if first + still < ticks else math.nan,
            'corner_speed_limit': limit,
            'depth': float(np.max(-exact.separation)) / scenario.size[2],
            'gap': float(max(0.0, np.max(exact.separation[first:]))),
            'point_step_ever': _largest(steps[first:]),
            'exact_point_step_ever': _largest(exact_steps[first:]),
        }
        window = slice(first + round(SETTLING * self.rate_hz),
                       first + round((SETTLING + WINDOW) * self.rate_hz))
        if window.stop <= ticks:
            weight = scenario.mass * GRAVITY
            forces = self.vertical_forces()[window]
            figures |= {
                'corner_speed': float(speeds[window].max()),
                'rope_tension': float(np.array(self.tensions)[window].max()),
                'force_error': abs(float(forces.mean()) / weight - 1.0),
                'force_worst': float(np.abs(forces / weight - 1.0).max()),
                'tilt': float(self.tilts()[:ticks][window].max()),
                'point_step': _largest(steps[window]),
                'exact_point_step': _largest(exact_steps[window]),
            }
        return LandingResult(**figures)


class ForceLaw(Protocol):
    """From one contact to the force and the torque on the load."""

    def wrench(self, touch: Any, pose: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return the force and torque (6,) on the load at `pose` (7,) with `velocity` (6,).

        touch: what the law needs of a contact, a `Touch` or a `Patch`; None without contact.
        """


class LoopState(NamedTuple):
    """The load's state when its contact is asked for."""

    tick: int
    time: float
    pose: np.ndarray
    velocity: np.ndarray


class ClosedLoop:
    """A crane under the wrench of a law, recorded tick by tick, wherever contacts come from."""

    def __init__(self, scenario: CraneScenario, rate_hz: float,
                 law: ForceLaw | None = None) -> None:
        """Take the standard law for this load and rate where `law` is None."""
        self.record = LandingRecord(scenario, rate_hz)
        self._law = law or ContactLaw.for_load(scenario.mass, scenario.size, rate_hz)
        self._held = HeldWrench()

    def ask(self, crane: Crane) -> LoopState:
        """Begin a tick; return the state whose contact is asked for."""
        state = LoopState(len(self.record.poses), crane.time, crane.load_pose, crane.load_velocity)
        self.record.poses.append(state.pose)
        self.record.velocities.append(state.velocity)
        return state

    def answer(self, state: LoopState, touch: Touch | None, *, latency: float) -> None:
        """Take the contact of a state; it acts `latency` [s] after it was asked for."""
        if touch is not None:
            self.record.points[state.tick] = np.array(touch.point)
        self._held.answer(self._law.wrench(touch, state.pose, state.velocity), asked=state.time,
                          due=state.time + latency)

    def step(self, crane: Crane) -> None:
        """End the tick: advance the crane under the wrench that is due."""
        crane.step(self._held.at)
        self.record.tensions.append(crane.rope_tensions)
        self.record.forces.append(self._held.current[:3].copy())


def land(scenario: CraneScenario, source: ContactSource, *, rate_hz: float = 200.0,
         latency: float = 0.0, law: ForceLaw | None = None) -> LandingRecord:
    """Run one landing with contacts from `source`, which act `latency` s after they were asked for.

    The source may be a ContactSolver; where it gives None, the last wrench is held.
    """
    crane, loop = Crane(scenario, rate_hz), ClosedLoop(scenario, rate_hz, law)
    for _ in range(round(scenario.duration * rate_hz)):
        state = loop.ask(crane)
        contact = source(state.pose, crane.stack_pose)
        if contact is not None:
            loop.answer(state, touch_of(contact), latency=latency)
        loop.step(crane)
    return loop.record


def _steps(points: np.ndarray) -> np.ndarray:
    """Return |Δpoint| [m] to the row before (n,), NaN where one of the two is missing."""
    steps = np.full(len(points), math.nan)
    steps[1:] = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return steps


def _largest(values: np.ndarray) -> float:
    return percentiles(values[~np.isnan(values)], 100)[0]

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A container set down by its contacts, one per tick, and the judgement whether it rests. No ROS.

A `ClosedLoop` steps a crane under a law of force, wherever the contacts come from, and records what
happened. `LandingRecord.judge` measures the record. The load settles if, from some time on, no
corner moves faster than `SETTLED_SPEED`. It is at rest if it meets every limit of `Landing.limits`.
The window is the last part of the time that is watched after the first touch.

Depth, gap and first touch are those of the exact solver on the recorded poses, whatever model gave
the contacts. Conventions: those of `laws` and `crane`.
"""
from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import NamedTuple

import numpy as np

from ..forces.patch_forces import FRICTION, GRAVITY, Body, PatchForces
from ..solver.contact import Contact, Contacts
from ..solver.contact_solver import ContactSolver
from ..solver.pose import rotation_matrix
from .crane import Crane, CraneScenario

DURATION = 25.0  # longest landing [s]; the first touch comes after 5 to 8 s
WATCHED, WINDOW = 8.0, 2.0  # time that is judged after the first touch, and its last part [s]
TIME_ROUNDING = 1e-9  # times that differ by less are the same: sums of ticks are rounded [s]
SETTLED_SPEED = 0.010  # speed of the load's fastest corner below which it has settled [m/s]
SETTLED_LIMIT = 3.0  # time from the first touch until then [s]
CORNER_SPEED_LIMIT = 0.3e-3  # speed of the fastest corner in the window [m/s]
FORCE_LIMIT = 1e-6  # vertical contact force off the weight, as a share of the weight
TILT_LIMIT = math.radians(0.06)  # mean angle between the load's and the world's vertical [rad]
DEPTH_LIMIT = 0.01  # depth as a share of the load's height, always
GAP_LIMIT = 0.020  # gap after the first touch [m]: how high it may bounce

NamedContacts = Mapping[str, Contact]
"""The contacts of one question, by the names of their pairs; the load is box A."""
NO_TURN = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)  # a pose


class LoopState(NamedTuple):
    """The state of the load at which contacts are asked for."""

    tick: int
    time: float  # [s]
    pose: np.ndarray  # of the load's box (7,)


LATE_STEPS = 3
"""Physics steps by which answers of a real node vary: the load is held no stiffer."""
REMEMBERED, FADING = 1.0, 1.0
"""How long a late answer counts in full, and then the time constant in which it fades [s]."""


class LoadForces:
    """`PatchForces` of one load on boxes that are fixed."""

    def __init__(self, load: Body, *, rate_hz: float, step: float) -> None:
        """Begin without contacts; rate_hz: questions per second; step: of physics [s]."""
        self._load, self._step, self._period = load, step, 1.0 / rate_hz
        self._places: dict[str, int] = {}  # of the fixed boxes, by the names of their pairs
        self._forces = PatchForces([load], friction=FRICTION)
        self._ages = deque([0.0], maxlen=max(1, round(REMEMBERED * rate_hz)))  # of the answers [s]
        self._late = 0.0  # how late answers are taken to be [s]

    def _rows(self, row: np.ndarray, others: Sequence[float] | np.ndarray) -> np.ndarray:
        """Return rows of all bodies: that of the load, and `others` for each fixed box."""
        return np.array([row, *[others] * len(self._places)])

    def hold(self, contacts: NamedContacts, pose: np.ndarray, *, age: float) -> None:
        """Take the contacts that were asked for `age` [s] ago with the load at `pose` (7,)."""
        for name in contacts:
            self._places.setdefault(name, len(self._places) + 1)
        self._ages.append(age)
        latest = max(LATE_STEPS * self._step, *self._ages)
        # As stiff as late answers allow. A stiffness that changes shakes the load, so what is
        # within twice the latest stays, and what is beyond fades.
        if self._late > 2.0 * latest:
            self._late *= 1.0 - min(1.0, self._period / FADING)
        self._late = max(self._late, latest)
        fixed = Body.fixed()
        self._forces.set_bodies([self._load, *[fixed] * len(self._places)])
        pairs = np.array([(0, self._places[name]) for name in contacts]).reshape(-1, 2)
        self._forces.hold(pairs, Contacts.of(contacts.values()), self._rows(pose, NO_TURN),
                          age=self._late, period=self._period)

    def corner_loads(self) -> str:
        """Return a line for each patch: what its corners carried in the last step."""
        loads = self._forces.loads()
        return '\n'.join(
            f'  corner loads  {" ".join(f"{1e-3 * load:.1f}" for load in row)} kN'
            for row in loads.corner_loads if row.any())

    def wrench(self, pose: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return force and torque (6,) at `pose` (7,) and `velocity` (6,), a physics step each."""
        still, weight = np.zeros(6), np.array([0, 0, -GRAVITY * self._load.mass, 0, 0, 0])
        return self._forces.wrenches(self._step, self._rows(pose, NO_TURN),
                                     self._rows(velocity, still), self._rows(weight, still))[0]


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
    return Contact(touch.colliding, touch.separation, touch.normal, touch.point,
                   depth * float(np.prod(size)) / along,
                   (axes * np.square(size) / 12.0) @ axes.T, touch.axis)


@dataclass(frozen=True, kw_only=True)
class Landing:
    """Figures of one landing. SI units, angles in rad; NaN where nothing was measured."""

    touched: float = math.nan  # time of the first touch [s], NaN for never
    settled: float = math.nan
    """Time from the first touch until corners stay below `SETTLED_SPEED` [s], NaN for never."""
    corner_speed: float = math.nan  # of the fastest corner in the window [m/s]
    rope_tension: float = math.nan  # of the tautest rope in the window [N]
    force_worst: float = math.nan  # |vertical contact force − weight| / weight, worst in the window
    static_tilt: float = math.nan  # mean over the window [rad]
    depth: float = math.nan  # largest ever, as a share of the load's height
    gap: float = math.nan  # largest after the first touch [m]
    force_limit: float = FORCE_LIMIT
    """Limit of `force_worst`; infinite for models whose force need not equal the weight."""

    @property
    def limits(self) -> dict[str, tuple[bool, str]]:
        """Return by name whether each limit is met, and figure and limit in words.

        What was not measured is not met.
        """
        settled = 'never' if math.isnan(self.settled) else f'{self.settled:.2f} s'
        return {
            'settled': (self.settled <= SETTLED_LIMIT,
                        f'{settled} after the first touch (limit {SETTLED_LIMIT:g} s)'),
            'corner speed': (self.corner_speed <= CORNER_SPEED_LIMIT,
                             f'{1e3 * self.corner_speed:.3g} mm/s at most '
                             f'(limit {1e3 * CORNER_SPEED_LIMIT:g})'),
            'ropes slack': (self.rope_tension == 0.0, f'{self.rope_tension:.3g} N at most'),
            'force': (self.force_worst <= self.force_limit,
                      f'{self.force_worst:.1g} of the weight off it '
                      + (f'(limit {self.force_limit:g})' if math.isfinite(self.force_limit)
                         else '(not judged)')),
            'static tilt': (self.static_tilt <= TILT_LIMIT,
                            f'{math.degrees(self.static_tilt):.2g} deg '
                            f'(limit {math.degrees(TILT_LIMIT):g})'),
            'depth': (self.depth < DEPTH_LIMIT, f'{100 * self.depth:.2g} % of the height '
                                                f'(limit {100 * DEPTH_LIMIT:g})'),
            'gap': (self.gap < GAP_LIMIT, f'{1e3 * self.gap:.2g} mm after the first touch '
                                          f'(limit {1e3 * GAP_LIMIT:g})'),
        }

    @property
    def missed(self) -> list[str]:
        """Return the names of the limits that are not met."""
        return [name for name, (met, _) in self.limits.items() if not met]

    @property
    def at_rest(self) -> bool:
        """Return whether all limits are met."""
        return not self.missed

    def __str__(self) -> str:
        """Return a line for each figure, with its limit."""
        if math.isnan(self.corner_speed):
            return '  not judged: the load touched too late, or never'
        return '\n'.join(f'  {name:<13} {figure}{"" if met else "  <-- not met"}'
                         for name, (met, figure) in self.limits.items())


@dataclass
class LandingRecord:
    """A landing tick by tick: the state before each tick, rope tensions and force at its end."""

    scenario: CraneScenario
    rate_hz: float
    watched: float = WATCHED  # time that is judged after the first touch [s]
    window: float = WINDOW  # its last part [s]
    poses: list[np.ndarray] = field(default_factory=list)
    velocities: list[np.ndarray] = field(default_factory=list)
    tensions: list[np.ndarray] = field(default_factory=list)
    forces: list[np.ndarray] = field(default_factory=list)
    points: dict[int, np.ndarray] = field(default_factory=dict)
    """Contact points (3,) by the tick they were asked for; none where there was no contact."""

    @property
    def ended(self) -> bool:
        """Return whether all that is judged has been recorded, or the time is over."""
        ticks, first = len(self.forces), next(iter(self.points), len(self.poses))
        return ticks - first > self.watched * self.rate_hz + 1 or ticks >= DURATION * self.rate_hz

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

    def separations(self) -> np.ndarray:
        """Return the exact separation [m] of load and stack, per tick (n,)."""
        poses = np.reshape(self.poses, (-1, 7))
        return np.min([
            ContactSolver(self.scenario.size, size, model='exact').batch(
                poses, np.broadcast_to(pose, poses.shape)).separation
            for pose, size in self.scenario.stack_boxes.values()], axis=0)

    def window_after(self, touched: int) -> slice:
        """Return the ticks of the window, where the first touch came in the tick `touched`."""
        return slice(touched + round((self.watched - self.window) * self.rate_hz),
                     touched + round(self.watched * self.rate_hz))

    def judge(self) -> Landing:
        """Measure the landing; what would have to be measured later than its end is NaN."""
        separations = self.separations()
        touching = np.flatnonzero(separations <= 0.0)
        if not len(touching):
            return Landing()
        first = int(touching[0])
        window = self.window_after(first)
        ticks = min(len(self.forces), window.stop)  # what comes later is not judged
        separations = separations[:ticks]
        fast = np.flatnonzero(self.corner_speeds(first)[:ticks - first] >= SETTLED_SPEED)
        still = int(fast[-1]) + 1 if len(fast) else 0
        seen = Landing(
            touched=first / self.rate_hz,
            settled=still / self.rate_hz if first + still < ticks else math.nan,
            depth=float(np.max(-separations)) / self.scenario.size[2],
            gap=float(max(0.0, np.max(separations[first:]))))
        if ticks < window.stop:
            return seen
        forces = np.array(self.forces)[window, 2] / (self.scenario.mass * GRAVITY)
        return replace(
            seen, corner_speed=float(self.corner_speeds()[window].max()),
            rope_tension=float(np.array(self.tensions)[window].max()),
            force_worst=float(np.abs(forces - 1.0).max()),
            static_tilt=float(self.tilts()[window].mean()))


class ClosedLoop:
    """A crane under the forces of contacts, recorded tick by tick, wherever these come from."""

    def __init__(self, scenario: CraneScenario, rate_hz: float, *, watched: float = WATCHED,
                 window: float = WINDOW) -> None:
        """Make the crane, and the forces on its load; watched, window: those of the record [s]."""
        self.crane = Crane(scenario, rate_hz)
        self.record = LandingRecord(scenario, rate_hz, watched, window)
        self.forces = LoadForces(scenario.load, rate_hz=rate_hz, step=self.crane.physics_step)
        self._under_way: deque[tuple[float, NamedContacts, LoopState]] = deque()
        """Answers that do not act yet: when they will [s], and the state that they are for."""
        self._wrench = np.zeros(6)

    def ask(self) -> LoopState:
        """Begin a tick; return the state whose contacts are asked for."""
        crane = self.crane
        state = LoopState(len(self.record.poses), crane.time, crane.load_pose)
        self.record.poses.append(state.pose)
        self.record.velocities.append(crane.load_velocity)
        return state

    def answer(self, state: LoopState, contacts: NamedContacts, *, latency: float) -> None:
        """Take the contacts of a state; they act `latency` [s] after they were asked for.

        An answer must neither come nor act before those to earlier questions.
        """
        touches = [contact for contact in contacts.values() if contact.colliding]
        if touches:
            self.record.points[state.tick] = np.array(touches[0].point)
        self._under_way.append((state.time + latency, contacts, state))

    def step(self) -> None:
        """End the tick: advance the crane under what is due.

        ValueError: the law needs what a contact's model does not give.
        """
        self.crane.step(self._at)
        self.record.tensions.append(self.crane.rope_tensions)
        self.record.forces.append(self._wrench[:3].copy())

    def _at(self, time: float) -> np.ndarray:
        """Return the wrench (6,) of the physics step that starts at `time` [s]."""
        while self._under_way and self._under_way[0][0] <= time + TIME_ROUNDING:
            _, contacts, state = self._under_way.popleft()
            self.forces.hold(contacts, state.pose, age=max(0.0, time - state.time))
        self._wrench = self.forces.wrench(self.crane.load_pose, self.crane.load_velocity)
        return self._wrench

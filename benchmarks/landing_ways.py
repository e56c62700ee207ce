# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which landings are run, and by which ways of contact and force.

A `Way` is a law and what gives its contacts. Held patches and held wrenches ask this package's
models. Engines give a point, so theirs go to the point law, which knows the load's footprint.
MuJoCo's own manifold is the bar to reach: forces of several points, implicit, within the simulator,
at every physics step.

`ADDED` are landings outside the grid of `landing.cases`, each with what it is expected to do.
"""
from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple, Self

import numpy as np
from box_contact_ros.scene.force.laws import Body

from box_contact_ros.demo.landing import (
    TILT_LIMIT,
    ContactSource,
    LandingCase,
    LandingRecord,
    LandingResult,
    cases,
    land,
    solvers,
)
from box_contact_ros.demo.load_laws import (
    MakeLaw,
    WrenchesHeld,
    held_patch,
    held_wrench,
    predicted_wrench,
)
from box_contact_ros.demo.mujoco_crane import Crane, CraneScenario
from box_contact_ros.solver.contact import Contact

from .contestant import Manifold, chosen
from .engines.mujoco_engines import box_geoms, collision
from .point_law import PointLaw
from .pose_sets import CONTAINER

# --- cases ----------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class PlannedLanding:
    """One landing and what is expected of it beforehand."""

    name: str
    case: LandingCase
    fields: dict[str, Any] = field(default_factory=dict)
    """Further fields of CraneScenario."""
    falls: bool = False
    """Whether the load must fall; else it must come to rest within all limits."""
    tilt_limit: float = TILT_LIMIT

    def as_expected(self, result: LandingResult) -> bool:
        """Return whether a landing did what it was expected to do."""
        if self.falls:
            return not result.at_rest and result.drop > LEAST_DROP
        return result.at_rest


class HeldLimits(NamedTuple):
    """What a landing of the grid by held patches must not exceed, from its tenth second on."""

    corner_speed: float = 1e-7  # of the fastest corner [m/s]
    creep: float = 1e-8  # mean lateral speed of the centre [m/s]
    depth: float = 3e-3  # ever, as a share of the load's height
    static_tilt: float = TILT_LIMIT  # [rad]

    @classmethod
    def at(cls, rate_hz: float) -> Self:
        """Return the limits at a rate: a load lies flatter on contacts that come more often."""
        degrees = 0.003 if rate_hz >= 1000.0 else 0.01 if rate_hz >= 200.0 else 0.06
        return cls(static_tilt=math.radians(degrees))

    def are_met(self, result: LandingResult) -> bool:
        """Return whether a landing is within all limits."""
        return all(getattr(result, name) <= limit for name, limit in self._asdict().items())


LEAST_DROP = 0.05
"""A load has fallen if its centre ends so far below its place on the stack [m]. The ropes, paid
out by 0.8 m, catch it then."""


def _aimed(overhang: float = 0.05, heading: float = 160.0, **fields: float) -> LandingCase:
    values: dict[str, float] = {'rope_angle': 0.5, 'rope_heading': 70.0, 'tilt': 1.0,
                                'tilt_heading': 30.0, 'yaw': 0.1}
    return LandingCase(**values | fields, overhang=overhang, overhang_heading=heading)


_LENGTH, _WIDTH, _ = CONTAINER
_SMALL = (6.058, 2.438, 2.591)
_SPREADER = {'size': (_LENGTH, _WIDTH, 1.5), 'mass': 15_000.0, 'castings': True}
ADDED = [
    PlannedLanding(name='mass 10 % of the length off the middle', case=_aimed(),
                   fields={'mass_offset': (0.1 * _LENGTH, 0.0, 0.0)}),
    PlannedLanding(name='mass 10 % of length and width off', case=_aimed(tilt=2.0, yaw=-0.8),
                   fields={'mass_offset': (-0.1 * _LENGTH, 0.1 * _WIDTH, 0.0)}),
    PlannedLanding(name='on a pedestal, 6 × 2 m', case=_aimed(tilt=2.0),
                   fields={'stack_size': (6.0, 2.0, 1.0)}),
    PlannedLanding(name='on a platform, 14 × 4 m', case=_aimed(overhang=0.3, rope_angle=2.0),
                   fields={'stack_size': (14.0, 4.0, 1.0)}),
    PlannedLanding(name='20 ft on 40 ft', case=_aimed(overhang=0.3, heading=0.0, tilt=2.0),
                   fields={'size': _SMALL, 'mass': 12_000.0}),
    PlannedLanding(name='20 ft at the end of 40 ft', case=_aimed(overhang=3.0, heading=0.0),
                   fields={'size': _SMALL, 'mass': 12_000.0}),
    PlannedLanding(name='a cube of 0.5 m, 300 kg', case=_aimed(overhang=0.02),
                   fields={'size': (0.5, 0.5, 0.5), 'mass': 300.0}),
    PlannedLanding(name='overhanging by 40 % of the length',
                   case=_aimed(overhang=0.4 * _LENGTH, heading=0.0)),
    PlannedLanding(name='overhanging by 30 % of the width',
                   case=_aimed(overhang=0.3 * _WIDTH, heading=90.0), tilt_limit=math.radians(0.1)),
    PlannedLanding(name='spreader on four corner castings', case=_aimed(), fields=_SPREADER),
    PlannedLanding(name='the same, tilted by 2°', case=_aimed(tilt=2.0, yaw=-0.3),
                   fields=_SPREADER),
    PlannedLanding(name='overhanging by 55 % of the width',
                   case=_aimed(overhang=0.55 * _WIDTH, heading=90.0), falls=True),
    PlannedLanding(name='overhanging by 55 % of the length',
                   case=_aimed(overhang=0.55 * _LENGTH, heading=180.0), falls=True),
]
"""Landings outside the grid. Where the load's middle is a fifth of the width within the edge, its
weight rests on a strip of three fifths. The other end is bare, so it cannot lie as flat."""


def grid(seed: int = 1) -> list[PlannedLanding]:
    """Return the 36 landings of the grid."""
    return [PlannedLanding(name=f'grid {number}', case=case)
            for number, case in enumerate(cases(seed=seed))]


# --- ways -----------------------------------------------------------------------------------------


SAMPLE = 5
"""Ways that are not compared at length run one of so many landings. Prime to three: every third
landing of the grid has the same overhang."""


class LoopTiming(NamedTuple):
    """Ticks a second, and the time [s] from asking for contacts to their force."""

    rate_hz: float
    latency: float


@dataclass(frozen=True, kw_only=True)
class Way:
    """A law and what gives its contacts."""

    law: str
    contacts: str
    sources: Callable[[CraneScenario], Sequence[ContactSource]] | None = None
    """What gives the contacts, for each box of the stack; None for MuJoCo, in the simulator."""
    make_law: Callable[[CraneScenario], MakeLaw] = lambda _: held_patch
    every: int = 1
    """One of so many landings of the grid is run."""
    added: bool = False
    """Whether the added landings are run too."""
    late: bool = True
    """Whether it is run with each latency, or with the least alone."""

    @property
    def timed(self) -> bool:
        """Whether rate and latency matter."""
        return self.sources is not None

    def timings(self, timings: Sequence[LoopTiming]) -> list[LoopTiming]:
        """Return those at which it is run."""
        least = min(timing.latency for timing in timings)
        return (list(timings[-1:]) if not self.timed else
                [timing for timing in timings if self.late or timing.latency == least])

    def fly(self, scenario: CraneScenario, timing: LoopTiming) -> LandingRecord:
        """Run one landing."""
        if self.sources is None:
            return own_contact(scenario, timing)
        return land(scenario, self.sources(scenario), law=self.make_law(scenario),
                    **timing._asdict())


def point_law(scenario: CraneScenario) -> MakeLaw:
    """Return what makes the point law, which knows the footprint of a scenario's load."""
    def made(load: Body, *, rate_hz: float, latency: float, step: float) -> WrenchesHeld:
        return WrenchesHeld(PointLaw.for_load(load.mass, scenario.size, rate_hz))

    return made


class MujocoSource:
    """One point of the contacts of two boxes that `mj_collision` finds."""

    def __init__(self, size_a: Sequence[float], size_b: Sequence[float], choice: str) -> None:
        """Make the two boxes; `choice` is one of the engines' `CHOICES`."""
        self._engine = collision('', box_geoms, '')
        self._ask = self._engine.boxes(np.array(size_a), np.array(size_b))
        self._choice = choice

    def __call__(self, pose_a: np.ndarray, pose_b: np.ndarray) -> Contact:
        """Return the contact, without a patch; its depth is the deepest one's."""
        found = self.manifold(pose_a, pose_b)
        touching, normal, point = chosen(found, self._choice)
        return Contact(touching, -float(found.depths.max()) if touching else math.nan, normal,
                       point, math.nan if touching else 0.0, np.full((3, 3), math.nan))

    def manifold(self, pose_a: np.ndarray, pose_b: np.ndarray) -> Manifold:
        """Return all of MuJoCo's contacts."""
        return self._engine.read(self._ask(*self._engine.at(pose_a, pose_b)))


def mujoco_sources(scenario: CraneScenario, choice: str) -> list[MujocoSource]:
    """Return what makes one point of MuJoCo's contacts, for each box of the stack."""
    return [MujocoSource(scenario.size, size, choice) for _, size in scenario.stack_boxes]


def own_contact(scenario: CraneScenario, timing: LoopTiming) -> LandingRecord:
    """Run one landing on MuJoCo's own contacts; it ends when all that is judged was seen."""
    crane = Crane(scenario, timing.rate_hz, own_contact=True)
    record = LandingRecord(scenario, timing.rate_hz)
    while not record.ended:
        record.poses.append(crane.load_pose)
        record.velocities.append(crane.load_velocity)
        crane.step()
        record.tensions.append(crane.rope_tensions)
        record.forces.append(crane.own_contact_force)
        if record.forces[-1].any():
            record.points[len(record.forces) - 1] = np.full(3, math.nan)
    return record


def _point(contacts: str, sources: Callable[[CraneScenario], Sequence[ContactSource]],
           every: int = SAMPLE) -> Way:
    """Return the way of a baseline, which is run without latency."""
    return Way(law='point', contacts=contacts, sources=sources, every=every, make_law=point_law,
               late=False)


_exact = partial(solvers, model='exact')
WAYS = {
    'exact': Way(law='held patch', contacts='exact', sources=_exact, added=True),
    'mlp': Way(law='held patch', contacts='mlp', sources=partial(solvers, model='mlp'), added=True,
               every=SAMPLE),
    'manifold': Way(law='MuJoCo', contacts='its manifold, in the simulator', added=True),
    'wrench': Way(law='held wrench', contacts='exact', sources=_exact, every=SAMPLE,
                  make_law=lambda _: held_wrench),
    'predicted': Way(law='predicted wrench', contacts='exact', sources=_exact, every=2 * SAMPLE,
                     make_law=lambda _: predicted_wrench),
    'point': _point('exact', _exact),
    'mujoco-mean': _point('MuJoCo, mean point', partial(mujoco_sources, choice='mean')),
    'mujoco-deepest': _point('MuJoCo, deepest point', partial(mujoco_sources, choice='deepest')),
    'soup': _point('soup-8', partial(solvers, model='soup-8'), every=13),
}
"""By name: the ways that the table has."""

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A simulator of boxes on MuJoCo, its own contact switched off: held patches push instead.

It is the loop of a client. Contacts are asked for at a rate, and answers arrive late. The law is
asked at every physics step. `own_contact` runs the same boxes with MuJoCo's contact.
"""
from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import mujoco
import numpy as np

from box_contact_ros.scene.force.held_wrench import InFlight
from box_contact_ros.scene.force.laws import FRICTION, GRAVITY, Body, SceneLaw
from box_contact_ros.scene.pose import rotation_matrix
from box_contact_ros.scene.scene_solver import Answer, Box, Pair, Scene, SceneSolver

# MuJoCo would write warnings to a file MUJOCO_LOG.TXT in the working directory.
mujoco.set_mju_user_warning(logging.getLogger(__name__).warning)

MUJOCO_FRICTION = (0.005, 0.0001)
"""MuJoCo's friction about and across the normal: its own defaults."""
CORNERS = 0.5 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])

Path = Callable[[float], tuple[np.ndarray, np.ndarray]]
"""From the time [s] to position (3,) [m] and velocity (3,) [m/s]."""


@dataclass(frozen=True, kw_only=True)
class Part:
    """A box of a simulation: fixed, moved on a path, or free where it has a mass."""

    name: str
    size: tuple[float, float, float]  # full extents [m]
    position: Sequence[float] | np.ndarray  # of the box's centre at the start [m]
    quaternion: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0, 1.0)  # x y z w
    velocity: Sequence[float] | np.ndarray = (0.0,) * 6  # of the centre of mass [m/s], and [rad/s]
    mass: float = 0.0  # [kg]
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of mass, in the box's frame [m]
    path: Path | None = None

    @property
    def body(self) -> Body:
        """Return the body of a free box of one density, but for where its centre of mass is."""
        return replace(Body.of_box(self.size, self.mass), centre=self.centre)

    @property
    def moves(self) -> bool:
        """Whether it is not fixed."""
        return self.mass > 0.0 or self.path is not None


@dataclass(frozen=True, kw_only=True)
class Push:
    """A constant force on a box for some time."""

    name: str  # of the box
    force: tuple[float, float, float]  # [N]
    at: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where it acts, from the centre of mass, common axes [m]."""
    start: float = 0.0
    end: float = np.inf  # [s]


@dataclass(frozen=True, kw_only=True)
class Setup:
    """What is simulated, and how long."""

    parts: tuple[Part, ...]
    seconds: float
    pushes: tuple[Push, ...] = ()
    friction: float = FRICTION

    @cached_property
    def moving(self) -> list[Part]:
        """Return the boxes that are not fixed, in their order."""
        return [part for part in self.parts if part.moves]

    def scene(self) -> Scene:
        """Return the boxes, and all pairs with a free box."""
        boxes = {part.name: Box(part.name, part.size, None if part.moves else (
            *map(float, part.position), *map(float, part.quaternion))) for part in self.parts}
        return Scene(boxes, tuple(Pair.between(one.name, other.name)
                                  for one, other in combinations(self.parts, 2)
                                  if one.mass or other.mass))


@dataclass(frozen=True)
class Timing:
    """The loop of a client."""

    rate_hz: float  # of questions
    latency: float  # from a question to the use of its answer [s]
    jitter: float = 0.0  # the latency is up to so much shorter or longer [s]
    step: float = 0.001  # physics step [s]

    def __str__(self) -> str:
        jitter = f' ± {1e3 * self.jitter:g}' if self.jitter else ''
        step = f', steps of {1e3 * self.step:g} ms' if self.step != Timing.step else ''
        return f'{self.rate_hz:g} Hz, {1e3 * self.latency:g}{jitter} ms{step}'


class Log:
    """Where the moving boxes were at every physics step, and how fast."""

    def __init__(self, setup: Setup, step: float) -> None:
        """Make room for all steps."""
        self.setup, self.step = setup, step
        count, boxes = round(setup.seconds / step), len(setup.moving)
        self.times = step * np.arange(count)
        self.poses = np.full((count, boxes, 7), np.nan)
        self.velocities = np.full((count, boxes, 6), np.nan)

    def of(self, name: str, start: float = 0.0, end: float = np.inf,
           ) -> tuple[Part, np.ndarray, np.ndarray]:
        """Return a box with its poses (n, 7) and velocities (n, 6) from `start` to `end` [s]."""
        place = [part.name for part in self.setup.moving].index(name)
        when = (self.times >= start) & (self.times < end)
        return self.setup.moving[place], self.poses[when, place], self.velocities[when, place]

    @property
    def free(self) -> list[str]:
        """Names of the boxes with a mass."""
        return [part.name for part in self.setup.moving if part.mass]


class World:
    """MuJoCo's state of a setup."""

    def __init__(self, setup: Setup, step: float, *, own_contact: bool) -> None:
        """Build the model and put every box at its start."""
        self._setup = setup
        self.model = _model(setup, own_contact)
        self.model.opt.timestep = step
        self.data = mujoco.MjData(self.model)
        boxes = len(setup.moving)
        self._rows = slice(1, boxes + 1)  # body 0 is the world
        self.poses, self.velocities = np.empty((boxes, 7)), np.empty((boxes, 6))
        self._paths = [(place, part.path) for place, part in enumerate(setup.moving) if part.path]
        self._pushes = [(1 + setup.moving.index(part), push) for push in setup.pushes
                        for part in setup.moving if part.name == push.name]
        for place, part in enumerate(setup.moving):
            self._put(place, part)

    def observe(self, time: float) -> None:
        """Bring `poses` (n, 7) and `velocities` (n, 6) up to a time [s]."""
        for place, path in self._paths:
            position, velocity = path(time)
            self.data.qpos[7 * place:7 * place + 3] = position
            self.data.qvel[6 * place:6 * place + 6] = 0.0
            self.data.qvel[6 * place:6 * place + 3] = velocity
        mujoco.mj_step1(self.model, self.data)
        self.poses[:, :3] = self.data.xpos[self._rows]
        self.poses[:, 3:6] = self.data.xquat[self._rows, 1:]
        self.poses[:, 6] = self.data.xquat[self._rows, 0]
        # MuJoCo has both at the centre of mass of a tree of bodies, which each box is.
        self.velocities[:, :3] = self.data.cvel[self._rows, 3:]
        self.velocities[:, 3:] = self.data.cvel[self._rows, :3]

    def advance(self, time: float, wrenches: np.ndarray | float) -> None:
        """Go one step on, under these wrenches (n, 6) and the pushes of a time [s]."""
        applied = self.data.xfrc_applied
        applied[self._rows] = wrenches
        for row, push in self._pushes:
            if push.start <= time < push.end:
                applied[row, :3] += push.force
                applied[row, 3:] += np.cross(push.at, push.force)
        mujoco.mj_step2(self.model, self.data)

    def _put(self, place: int, part: Part) -> None:
        position, velocity = slice(7 * place, 7 * place + 7), slice(6 * place, 6 * place + 6)
        x, y, z, w = part.quaternion
        self.data.qpos[position] = [*part.position, w, x, y, z]
        axes = rotation_matrix(np.array(part.quaternion, dtype=float))
        linear, angular = np.split(np.array(part.velocity, dtype=float), 2)
        # MuJoCo's are the box's own: at its centre, and about its axes.
        self.data.qvel[velocity] = [*(linear - np.cross(angular, axes @ part.centre)),
                                    *(axes.T @ angular)]


def held_patch(setup: Setup, timing: Timing, model: str, seed: int = 1) -> Log:
    """Simulate by held patches, their contacts asked of a model."""
    scene = setup.scene()
    solver = SceneSolver(scene, model=model)
    law = SceneLaw.for_loop(
        scene, {part.name: part.body for part in setup.moving if part.mass},
        rate_hz=timing.rate_hz, latency=timing.latency, step=timing.step, friction=setup.friction)
    world, log = World(setup, timing.step, own_contact=False), Log(setup, timing.step)
    under_way = InFlight[tuple[Answer, np.ndarray]]()
    every = round(1.0 / (timing.rate_hz * timing.step))
    rng = np.random.default_rng(seed)
    for tick, time in enumerate(log.times):
        world.observe(time)
        log.poses[tick], log.velocities[tick] = world.poses, world.velocities
        if tick % every == 0:
            late = timing.latency + timing.jitter * rng.uniform(-1.0, 1.0)
            under_way.answer((solver(world.poses), world.poses.copy()), asked=time,
                             due=time + max(0.0, late))
        if arrived := under_way.arrived(time):
            law.hold(*arrived)
        world.advance(time, law.wrenches(world.poses, world.velocities))
        if not np.abs(world.velocities).max() < 1e3:
            break  # diverged: what follows stays NaN
    return log


def own_contact(setup: Setup, step: float) -> Log:
    """Simulate by MuJoCo's own contact."""
    world, log = World(setup, step, own_contact=True), Log(setup, step)
    for tick, time in enumerate(log.times):
        world.observe(time)
        log.poses[tick], log.velocities[tick] = world.poses, world.velocities
        world.advance(time, 0.0)
    return log


def _model(setup: Setup, own_contact: bool) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    spec.option.gravity = 0.0, 0.0, -GRAVITY
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    heaviest = max(part.mass for part in setup.parts)
    for part in sorted(setup.parts, key=lambda part: not part.moves):
        x, y, z, w = part.quaternion
        body = spec.worldbody.add_body(name=part.name, pos=part.position, quat=[w, x, y, z])
        if part.moves:
            body.add_freejoint()
            body.explicitinertial = True
            # A box on a path is so heavy that contacts leave its velocity alone within a step.
            body.mass = part.mass or 1e9 * heaviest
            body.inertia = part.body.inertia if part.mass else np.full(3, body.mass)
            body.ipos = part.centre
            body.gravcomp = float(part.path is not None)
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=0.5 * np.array(part.size),
                      contype=int(own_contact), conaffinity=int(own_contact),
                      friction=(setup.friction, *MUJOCO_FRICTION))
    return spec.compile()

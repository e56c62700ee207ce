# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Boxes that rest and fall, a step at a time: by `PatchForces`, and by MuJoCo's own contact.

`Ours` asks for contacts at a rate, gets the answers late, and asks for the forces at every step.
`Theirs` runs the same boxes by MuJoCo. Both get the same outside forces.

Lengths in m, masses in kg, times in s.
"""
from __future__ import annotations

import logging
import math
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

import mujoco
import numpy as np

from box_contact_ros import Body, ContactSolver, PatchForces
from box_contact_ros.forces.patch_forces import FRICTION, GRAVITY
from box_contact_ros.solver.pose import rotation_matrix

from .pose_sets import quaternion_multiply

# MuJoCo would write warnings to a file MUJOCO_LOG.TXT in the working directory.
mujoco.set_mju_user_warning(logging.getLogger(__name__).warning)

STEP = 0.001  # of MuJoCo's physics
HEAVY = 1e9  # mass [kg] and inertia [kg m²] of what MuJoCo is to carry without slowing down
SEARCHED = 10  # steps from one search of neighbours to the next
CORNERS = 0.5 * np.array(list(product((-1, 1), repeat=3)))
FLOOR = ((60.0, 60.0, 1.0), 0.0, (0.0, 0.0, -0.5))
"""A row of `Boxes.of`, whose top is at z = 0."""

Wrenches = Callable[[float, 'Boxes', np.ndarray, np.ndarray], np.ndarray]
Drive = Callable[[float], Sequence[float]]


class Parts(NamedTuple):
    """Boxes (m,): the body of each, its full extents and its pose."""

    body: np.ndarray  # (m,)
    size: np.ndarray  # (m, 3) [m]
    pose: np.ndarray  # (m, 7)


@dataclass
class Boxes:
    """Bodies of a scene, a row each: one box, its full extents, and the mass (0: fixed).

    A body may have further boxes, its `parts`, whose poses are in the frame of its box.
    """

    size: np.ndarray  # (n, 3) [m]
    mass: np.ndarray  # (n,) [kg]
    pose: np.ndarray  # (n, 7) of the boxes' centres
    centre: np.ndarray  # (n, 3) of mass, in the box's own frame [m]
    velocity: np.ndarray  # (n, 6) of the centre of mass
    parts: Parts | None = None

    @classmethod
    def of(cls, rows: Sequence[tuple]) -> Boxes:
        """Return boxes of rows (size, mass, position[, quaternion[, centre]])."""
        n = len(rows)
        pose = np.tile([0.0, 0, 0, 0, 0, 0, 1], (n, 1))
        centre = np.zeros((n, 3))
        for k, (_, _, position, *more) in enumerate(rows):
            pose[k, :3] = position
            if more:
                pose[k, 3:] = more[0]
            if len(more) > 1:
                centre[k] = more[1]
        return cls(np.array([row[0] for row in rows], dtype=float),
                   np.array([row[1] for row in rows], dtype=float), pose, centre, np.zeros((n, 6)))

    def every_box(self) -> Parts:
        """Return all boxes with their poses in the common frame: those of the rows, then parts."""
        body, size, pose = np.arange(len(self.mass)), self.size, self.pose
        if self.parts is None:
            return Parts(body, size, pose)
        on = pose[self.parts.body]
        place = on[:, :3] + np.einsum('nij,nj->ni', rotation_matrix(on[:, 3:]),
                                      self.parts.pose[:, :3])
        turn = quaternion_multiply(on[:, 3:], self.parts.pose[:, 3:])
        return Parts(np.append(body, self.parts.body), np.vstack([size, self.parts.size]),
                     np.vstack([pose, np.hstack([place, turn])]))

    @property
    def carrier(self) -> int | None:
        """Return the fixed box that moves by its velocity alone, if there is one."""
        return next(iter(np.flatnonzero((self.mass == 0.0) & self.velocity.any(axis=1))), None)

    @property
    def inertia(self) -> np.ndarray:
        """Return principal moments (n, 3) of boxes of one density."""
        squares = self.size**2
        return self.mass[:, None] / 12.0 * (squares.sum(axis=1, keepdims=True) - squares)


@dataclass
class Scene:
    """Boxes, and the wrenches (n, 6) that act on them beside weight and contacts.

    drive: velocity (6,) of box 0, which is fixed, at a time. belt: velocity (3,) of its surface,
    while the box itself stays.
    """

    name: str
    boxes: Boxes
    seconds: float = 5.0
    act: Wrenches | None = None
    drive: Drive | None = None
    belt: Sequence[float] | None = None


class Timing(NamedTuple):
    """The loop of a client: step of physics [s], rate of questions, latency [s], share lost.

    own: answers are lists of pairs, and `PatchForces` solves the pairs at each step.
    lengths: of the steps [s], in turn, where steps are uneven; `step` is their mean.
    """

    step: float
    rate_hz: float
    latency: float
    lost: float = 0.0
    own: bool = False
    lengths: tuple[float, ...] = ()

    @classmethod
    def uneven(cls, lengths: Sequence[float]) -> Timing:
        """Return the loop of steps of some lengths [s] in turn, with its own contacts at each."""
        mean = sum(lengths) / len(lengths)
        return cls(mean, 1.0 / mean, 0.0, own=True, lengths=tuple(lengths))

    def __str__(self) -> str:
        return (self._steps + ', '
                + ('each step' if math.isclose(self.rate_hz * self.step, 1.0) else
                   f'{self.rate_hz:g} Hz')
                + (f', {1e3 * self.latency:g} ms late' if self.latency else '')
                + (f', {100 * self.lost:g} % lost' if self.lost else '')
                + (', own contacts' if self.own else ''))

    @property
    def _steps(self) -> str:
        """Return the length of the steps in words."""
        if len(self.lengths) > LISTED:
            return f'{1e3 * min(self.lengths):.3g} to {1e3 * max(self.lengths):.3g} ms at random'
        return ', '.join(f'{1e3 * step:.3g}' for step in self.lengths or (self.step,)) + ' ms'


FRAME = 1.0 / 60.0  # [s]
LISTED = 8  # lengths of steps that the name of a timing lists; more are drawn at random
TIMINGS = (Timing(0.001, 1000.0, 0.0), Timing(0.004, 250.0, 0.0), Timing(FRAME, 60.0, 0.0),
           Timing.uneven((0.003, 0.003, 0.003, FRAME - 0.009)), Timing(0.001, 200.0, 0.0),
           Timing(0.001, 200.0, 0.002), Timing(0.001, 50.0, 0.005),
           Timing(0.001, 50.0, 0.005, lost=0.05, own=True))


class Mujoco(NamedTuple):
    """How MuJoCo moves a scene, with contacts of its own at each step of `STEP`."""

    elliptic: bool = False
    noslip: int = 0  # iterations of its second solver, of friction alone

    def __str__(self) -> str:
        cones = f', elliptic cones, impratio {IMPRATIO:g}' if self.elliptic else ''
        return 'MuJoCo, 1 ms' + cones + (', noslip' if self.noslip else '')


IMPRATIO = 10.0  # of friction's stiffness to that of the normal, with elliptic cones
MUJOCO = (Mujoco(), Mujoco(elliptic=True), Mujoco(elliptic=True, noslip=10))
"""Its defaults, and what its documentation advises against slip, in part and whole."""


def near_pairs(boxes: Boxes, margin: float) -> np.ndarray:
    """Return the pairs (k, 2) of `every_box` whose bounding boxes come within a margin.

    They are of two bodies, of which one moves.
    """
    body, size, pose = boxes.every_box()
    half = 0.5 * np.einsum('nij,nj->ni', np.abs(rotation_matrix(pose[:, 3:])), size)
    low, high = pose[:, :3] - half - margin, pose[:, :3] + half
    near = np.triu((low[:, None] <= high).all(axis=2) & (low <= high[:, None]).all(axis=2), 1)
    moves = boxes.mass[body] > 0
    return np.argwhere(near & (moves[:, None] | moves) & (body[:, None] != body))


def corner_speeds(boxes: Boxes) -> np.ndarray:
    """Return the speeds (n, 8) of the corners of the free boxes, relative to a carrier [m/s]."""
    rotation = rotation_matrix(boxes.pose[:, 3:])
    arm = np.einsum('nij,nkj->nki', rotation, CORNERS * boxes.size[:, None])
    centre = np.einsum('nij,nj->ni', rotation, boxes.centre)
    motion = boxes.velocity[:, None]
    speed = motion[:, :, :3] + np.cross(motion[:, :, 3:], arm - centre[:, None])
    if (k := boxes.carrier) is not None:
        speed -= boxes.velocity[k, :3] + np.cross(
            boxes.velocity[k, 3:], boxes.pose[:, None, :3] + arm - boxes.pose[k, :3])
    return np.linalg.norm(speed, axis=2)[boxes.mass > 0]


class Ours:
    """Contacts by the solver, forces by `PatchForces`."""

    def __init__(self, scene: Scene, timing: Timing, **options: int) -> None:
        """Make solver and forces; options: those of `PatchForces`."""
        boxes = self.boxes = scene.boxes
        self.scene, self.timing, self.step_size = scene, timing, timing.step
        self.lengths, self.time = timing.lengths or (timing.step,), 0.0
        self.rng = np.random.default_rng(9)  # of lost answers
        self.every = max(1, round(1.0 / (timing.rate_hz * timing.step)))
        self.late = round(timing.latency / timing.step)
        self.solver = ContactSolver()
        self.forces = PatchForces(
            [Body(mass=m, inertia=i, centre=c)
             for m, i, c in zip(boxes.mass, boxes.inertia, boxes.centre)], **options)
        self.tick, self.searched = 0, -SEARCHED
        self.spent = np.zeros(3)
        """Time spent on pairs and their contacts, on `hold`, and on `advance` [s]."""
        self.answers: deque = deque()
        if boxes.parts is None:
            self.forces.set_boxes(boxes.size)
        else:
            body, size, _ = boxes.every_box()
            at_body = np.tile([0.0, 0, 0, 0, 0, 0, 1], (len(boxes.mass), 1))
            self.forces.set_boxes(size, body=body, poses=np.vstack([at_body, boxes.parts.pose]))
        self.pairs = np.empty((0, 2), dtype=np.int64)
        self.weight = np.zeros((len(boxes.mass), 6))
        self.weight[:, 2] = -GRAVITY * boxes.mass

    def way(self, seconds: float) -> float:
        """Return how much nearer two boxes may come in a time [m], by their speeds and gravity."""
        boxes = self.boxes
        fast = np.abs(boxes.velocity[:, :3]).max() + 0.5 * np.linalg.norm(
            boxes.size, axis=1)[boxes.mass > 0].max() * np.abs(boxes.velocity[:, 3:]).max()
        return seconds * (2.0 * fast + GRAVITY * seconds)

    def answer(self) -> tuple:
        """Return the arguments of `hold`: pairs, and their contacts and poses if not its own."""
        boxes, h = self.boxes, max(self.lengths)
        if self.timing.own:  # the next answer may be lost
            return (near_pairs(boxes, self.way(2.0 * self.every * h + self.timing.latency)),)
        if self.tick - self.searched >= SEARCHED:
            self.searched = self.tick
            self.pairs = near_pairs(boxes, self.way(2.0 * SEARCHED * h))
        _, size, pose = boxes.every_box()
        contacts = self.solver.batch(pose, sizes=size, pairs=self.pairs)
        return self.pairs, contacts, boxes.pose.copy()

    def hold(self, pairs: np.ndarray, *contacts_and_poses: Any) -> None:
        """Hand an answer to the forces."""
        options: dict[str, Any] = {} if self.timing.own else {
            'age': self.timing.latency, 'period': self.every * self.step_size}
        if self.scene.belt is not None:  # of B's surface relative to A's, box 0
            options['surface_velocity'] = np.outer(pairs[:, 0] == 0, self.scene.belt) * -1.0
        self.forces.hold(pairs, *contacts_and_poses, **options)

    def step(self) -> None:
        """Advance all boxes by a step."""
        boxes, h = self.boxes, self.lengths[self.tick % len(self.lengths)]
        outside = self.weight
        if self.scene.act:
            ahead = self.forces.ahead(h, boxes.pose, boxes.velocity)
            outside = outside + self.scene.act(self.time, boxes, ahead, boxes.velocity)
        if self.scene.drive:
            boxes.velocity[0] = self.scene.drive(self.time + 0.5 * h)
        times = [time.perf_counter()]
        if self.tick % self.every == 0 and self.rng.random() >= self.timing.lost:
            self.answers.append((self.tick + self.late, *self.answer()))
        times.append(time.perf_counter())
        while self.answers and self.answers[0][0] <= self.tick:
            self.hold(*self.answers.popleft()[1:])
        times.append(time.perf_counter())
        boxes.pose, boxes.velocity, *_ = self.forces.advance(h, boxes.pose, boxes.velocity, outside)
        times.append(time.perf_counter())
        self.spent += np.diff(times)
        self.time += h
        self.tick += 1


class Theirs:
    """The same scene by MuJoCo with contacts of its own."""

    def __init__(self, scene: Scene, step: float, way: Mujoco = MUJOCO[0]) -> None:
        boxes = self.boxes = scene.boxes
        self.scene, self.step_size = scene, step
        spec = mujoco.MjSpec()
        spec.option.gravity = 0.0, 0.0, -GRAVITY
        spec.option.timestep = step
        spec.option.noslip_iterations = way.noslip
        if way.elliptic:
            spec.option.cone, spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, IMPRATIO
        spec.memory = 2**28
        self.free = boxes.mass > 0
        self.carrier = 0 if scene.drive or scene.belt is not None else boxes.carrier
        for k, free in enumerate(self.free):
            x, y, z, qx, qy, qz, qw = boxes.pose[k]
            body = spec.worldbody.add_body(pos=(x, y, z), quat=(qw, qx, qy, qz))
            if free:
                body.add_freejoint()
                body.explicitinertial = True
                body.mass, body.inertia = boxes.mass[k], boxes.inertia[k]
                body.ipos = boxes.centre[k]
            elif k == self.carrier:
                body.add_freejoint()
                body.gravcomp, body.explicitinertial = 1.0, True
                body.mass, body.inertia = HEAVY, (HEAVY,) * 3
            body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=0.5 * boxes.size[k],
                          friction=(FRICTION, 0.005, 0.0001))
            for on, size, (x, y, z, qx, qy, qz, qw) in zip(*boxes.parts) if boxes.parts else ():
                if on == k:
                    body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=0.5 * size, pos=(x, y, z),
                                  quat=(qw, qx, qy, qz), friction=(FRICTION, 0.005, 0.0001))
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        self.tick, self.time, self.spent = 0, 0.0, np.zeros(1)
        self.bodies = 1 + np.flatnonzero(self.free)
        joints = self.model.body_jntadr[self.bodies]
        self.places = self.model.jnt_qposadr[joints][:, None] + np.arange(7)
        self.rates = self.model.jnt_dofadr[joints][:, None] + np.arange(6)
        self.data.qpos[self.places] = boxes.pose[self.free][:, [0, 1, 2, 6, 3, 4, 5]]
        rotation = rotation_matrix(boxes.pose[self.free, 3:])
        v = boxes.velocity[self.free]
        arm = np.einsum('nij,nj->ni', rotation, boxes.centre[self.free])
        spin = np.einsum('nji,nj->ni', rotation, v[:, 3:])
        self.data.qvel[self.rates] = np.hstack([v[:, :3] - np.cross(v[:, 3:], arm), spin])
        if self.carrier is not None:
            joint = self.model.body_jntadr[1 + self.carrier]
            self.carried = self.model.jnt_qposadr[joint] + np.array([0, 1, 2, 4, 5, 6, 3])
            self.driven = self.model.jnt_dofadr[joint] + np.arange(6)

    def drive(self) -> None:
        """Give the carrier its velocity; what is free cannot change that by much."""
        boxes, scene = self.boxes, self.scene
        if scene.drive:
            boxes.velocity[0] = scene.drive(self.time + 0.5 * self.step_size)
        velocity = boxes.velocity[self.carrier] if scene.belt is None else [*scene.belt, 0, 0, 0]
        self.data.qvel[self.driven] = velocity

    def step(self) -> None:
        """Advance all boxes by a step."""
        boxes, free = self.boxes, self.free
        if self.scene.act:
            push = self.scene.act(self.time, boxes, boxes.pose, boxes.velocity)
            self.data.xfrc_applied[self.bodies] = push[free]
        if self.carrier is not None:
            self.drive()
        start = time.perf_counter()
        mujoco.mj_step(self.model, self.data)
        self.spent += time.perf_counter() - start
        boxes.pose[free] = self.data.qpos[self.places][:, [0, 1, 2, 4, 5, 6, 3]]
        if self.carrier is not None and self.scene.belt is None:
            boxes.pose[self.carrier] = self.data.qpos[self.carried]
        v = self.data.qvel[self.rates]
        rotation = rotation_matrix(boxes.pose[free, 3:])
        spin = np.einsum('nij,nj->ni', rotation, v[:, 3:])
        arm = np.einsum('nij,nj->ni', rotation, boxes.centre[free])
        boxes.velocity[free] = np.hstack([v[:, :3] + np.cross(spin, arm), spin])
        self.time += self.step_size
        self.tick += 1


def steps(scene: Scene, way: Timing | Mujoco, **options: int) -> Iterator[Ours | Theirs]:
    """Run a scene by ours at a timing, or by MuJoCo; yield the loop before each step and last.

    The scene's boxes are those of the loop. options: those of `PatchForces`.
    """
    loop = (Ours(scene, way, **options) if isinstance(way, Timing) else
            Theirs(scene, STEP, way))
    for _ in range(round(scene.seconds / loop.step_size)):
        yield loop
        loop.step()
    yield loop

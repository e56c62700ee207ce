# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A crane that sets a container down on a stack, in MuJoCo and without ROS.

A trolley stands still high above the stack. Four ropes run from it to the four top corners of the
load. Ropes pull and never push: each is a spatial tendon, and the hoist moves its upper length
limit. Nothing else holds or damps the load, so it sways. The ropes converge towards the trolley,
so the load pitches and rolls as it sways. The stack is static and stands on the ground.

The hoist lowers the load until the ropes are slack, and then stands still. MuJoCo's own contact is
off, so the load comes to rest on the stack only under the wrench of a contact from outside.

Conventions: SI units; world frame with z up, the ground at z = 0, the stack's centre above the
origin. A pose is `x y z qx qy qz qw` of the body's centre. Angles of a `CraneScenario` are degrees.
"""
from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..extras import require

require('sim')  # a missing MuJoCo ends in one line
import mujoco

from ..forces.patch_forces import GRAVITY, Body
from ..scene.boxes import CONTAINER
from ..solver.pose import cross, rotation_matrix

PHYSICS_STEP = 5e-4
"""Longest physics step [s]. A tick of publication is cut into equal steps no longer than this."""

ROPE_STIFFNESS, ROPE_DAMPING, ROPE_IMPEDANCE = 1600.0, 3.0, 0.75
"""A rope's stretch as MuJoCo's limit spring, per unit of mass [1/s²], [1/s], [1].

Heave on the ropes rings at some 40 rad/s, far above sway, and dies out within a second; the load
stretches them by about 2 mm. The damping is small, because the solver damps the hoist's own speed
too. A hoist faster than (1 − impedance) · g / damping = 0.8 m/s would jerk the rope with several
times the weight.
"""

HANG_TIME, LOWERING_TIME = 1.25, 11.25  # how long the load hangs first, and is then lowered [s]

_CORNERS = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]], dtype=float)


@dataclass(frozen=True, kw_only=True)
class CraneScenario:
    """What hangs where, and how it is lowered. Lengths in m, angles in degrees, world frame."""

    size: tuple[float, float, float] = CONTAINER  # full extents of the load
    stack_size: tuple[float, float, float] = CONTAINER  # it is not rotated
    mass: float = 20_000.0  # of the load [kg], with the moments of a full box
    mass_offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """The centre of mass from the load's centre, in the load's axes."""
    offset: tuple[float, float] = (0.25, -0.15)
    """x, y of the trolley from the stack's centre: the lateral error of the drop."""
    rope_length: float = 15.0  # height of the trolley over the load's top once the load is down
    rope_spread: float = 0.8  # spacing of the ropes at the trolley / at the load; 0: one point
    rope_angle: float = 1.5  # the load is released at rest, its ropes this far from the plumb line
    rope_heading: float = 35.0  # direction it is pulled aside to, counter-clockwise from x
    pitch: float = 0.25  # tilt about y at the start, held by unequal ropes
    roll: float = -0.4  # the same about x
    yaw: float = 0.6  # rotation about the plumb line at the start
    lowering_speed: float = 0.3  # top speed of the hoist [m/s]
    overlap: float = 0.8
    """How far the ropes are paid out beyond a level load at rest on the stack.

    Half of the default already leaves all four ropes slack, with a load tilted by 3° (0.4 m
    unevenly in its ropes) and a trolley a metre aside.
    """

    @property
    def load(self) -> Body:
        """Return what a law of force knows of the load."""
        body = Body.of_box(self.size, self.mass)
        return Body(mass=self.mass, inertia=body.inertia, centre=self.mass_offset)

    @property
    def stack_pose(self) -> np.ndarray:
        """Return the pose of the stack's centre (7,)."""
        return np.array([0.0, 0.0, 0.5 * self.stack_size[2], 0.0, 0.0, 0.0, 1.0])

    @property
    def stack_boxes(self) -> dict[str, tuple[np.ndarray, tuple[float, float, float]]]:
        """Return the boxes that the load may meet, by name: pose (7,) and full extents [m]."""
        return {'stack': (self.stack_pose, self.stack_size)}

    @property
    def lowering_distance(self) -> float:
        """How far the hoist lowers the load [m]; its mean speed is half the top speed."""
        return 0.5 * self.lowering_speed * LOWERING_TIME

    def hoist_height(self, time: float) -> float:
        """Return the height [m] of the load, level and at rest, over its lowest place."""
        share = min(max((time - HANG_TIME) / LOWERING_TIME, 0.0), 1.0)
        # No speed and no jerk at either end.
        risen = share - math.sin(2.0 * math.pi * share) / (2.0 * math.pi)
        return self.lowering_distance * (1.0 - risen)


class Crane:
    """The running simulation: load, stack and ropes, advanced by ticks of 1 / rate_hz seconds."""

    def __init__(self, scenario: CraneScenario, rate_hz: float = 200.0) -> None:
        """Build the model and put the load at its start; `rate_hz` is ticks per second."""
        self.scenario = scenario
        self._substeps = math.ceil(1.0 / (rate_hz * PHYSICS_STEP))
        self._rate_hz = float(rate_hz)
        self._ticks = 0
        self.model = _build(scenario)
        self.model.opt.timestep = 1.0 / (rate_hz * self._substeps)
        self.data = mujoco.MjData(self.model)
        self._load = self.model.body('load').id
        self._start()

    @property
    def time(self) -> float:
        """Return the simulated time since the start [s]: whole ticks, so it does not drift."""
        return self._ticks / self._rate_hz

    @property
    def physics_step(self) -> float:
        """Return the time between two evaluations of a wrench [s]."""
        return float(self.model.opt.timestep)

    @property
    def load_pose(self) -> np.ndarray:
        """Return the pose (7,) of the load's centre in the world frame."""
        return self.data.qpos[[0, 1, 2, 4, 5, 6, 3]]  # MuJoCo's quaternions are w x y z

    @property
    def load_velocity(self) -> np.ndarray:
        """Return the velocity (6,) of the load: its centre of mass [m/s], angular [rad/s]."""
        angular = np.empty(3)
        # MuJoCo keeps a free joint's angular velocity in the body's own frame.
        mujoco.mju_rotVecQuat(angular, self.data.qvel[3:], self.data.qpos[3:])
        linear = self.data.qvel[:3]
        if any(self.scenario.mass_offset):
            linear = linear + cross(angular, rotation_matrix(self.load_pose[3:])
                                    @ self.scenario.mass_offset)
        return np.concatenate([linear, angular])

    @property
    def rope_tensions(self) -> np.ndarray:
        """Return the pull (4,) of the ropes during the last physics step [N], 0 where slack.

        Order: the corners (+x +y), (+x -y), (-x +y), (-x -y) of the load.
        """
        tensions = np.zeros(len(_CORNERS))
        rows = self.data.efc_type == mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON
        tensions[self.data.efc_id[rows]] = self.data.efc_force[rows]
        return tensions

    @property
    def ropes(self) -> np.ndarray:
        """Return the ends (4, 2, 3) of the ropes, at the trolley and at the load [m], as above."""
        ends = [self.data.site(f'{end}_{rope}').xpos for rope in range(len(_CORNERS))
                for end in ('hold', 'corner')]
        return np.reshape(ends, (-1, 2, 3))

    def step(self, wrench: Callable[[float], np.ndarray] | None = None) -> None:
        """Advance one tick, under a wrench that may change from one physics step to the next.

        wrench: from the simulated time [s] at which a physics step starts to force [N] and torque
        [N m] over it (6,). World frame, at the load's centre of mass. None for no wrench.
        """
        for substep in range(1, self._substeps + 1):
            start = (self._ticks + (substep - 1) / self._substeps) / self._rate_hz
            self.data.xfrc_applied[self._load] = wrench(start) if wrench else 0.0
            end = (self._ticks + substep / self._substeps) / self._rate_hz
            self._set_ropes(self.scenario.hoist_height(end))
            mujoco.mj_step(self.model, self.data)
        self._ticks += 1

    def _start(self) -> None:
        """Put the load at its start, and note each rope's extra length (4,) that holds its tilt.

        Ropes whose spacing is `rope_spread` at the trolley turn the load by (1 - rope_spread) of
        the angle they sway by. That rule is exact for spreads 0 and 1 and of first order between;
        the height is then set so that the tightest rope is just taut.
        """
        scenario, trolley = self.scenario, np.array(self.model.body('trolley').pos)
        drop = scenario.rope_length - scenario.lowering_distance
        half_height = np.array([0.0, 0.0, 0.5 * scenario.size[2]])
        angle, heading, pitch, roll, yaw = np.radians([
            scenario.rope_angle, scenario.rope_heading, scenario.pitch, scenario.roll,
            scenario.yaw])
        tilt = _rotation('z', yaw) @ _rotation('y', pitch) @ _rotation('x', roll)

        level = trolley - [0.0, 0.0, drop] - half_height
        self._put(level, tilt)
        lengths = self.data.ten_length.copy()
        self._put(level, _rotation('z', yaw))
        self._trims = lengths - self.data.ten_length

        # In the frame where x is the heading, the sway is a rotation about -y.
        sway = _rotation('z', heading) @ _rotation('y', -(1.0 - scenario.rope_spread) * angle)
        sway = sway @ _rotation('z', -heading)
        aside = drop * np.array([math.sin(angle) * math.cos(heading),
                                 math.sin(angle) * math.sin(heading), -math.cos(angle)])
        centre = trolley + aside - sway @ half_height
        self._set_ropes(scenario.lowering_distance)
        for _ in range(4):  # Newton on a nearly linear function: the rope's slope in z is near 1
            self._put(centre, sway @ tilt)
            centre[2] += np.max(self.data.ten_length - self.model.tendon_range[:, 1])
        self._put(centre, sway @ tilt)

    def _put(self, centre: np.ndarray, rotation: np.ndarray) -> None:
        """Place the load at rest, its centre in the world frame, and update all derived values."""
        self.data.qpos[:3] = centre
        mujoco.mju_mat2Quat(self.data.qpos[3:], np.ascontiguousarray(rotation).ravel())
        self.data.qvel[:] = 0.0
        mujoco.mj_forward(self.model, self.data)

    def _set_ropes(self, height: float) -> None:
        """Set the ropes' length limits for a level load `height` over its lowest place [m]."""
        scenario = self.scenario
        drop = scenario.rope_length - height
        inward = 0.5 * (1.0 - scenario.rope_spread) * math.hypot(*scenario.size[:2])
        self.model.tendon_range[:, 1] = math.hypot(inward, drop) + self._trims


def _rotation(axis: str, angle: float) -> np.ndarray:
    """Return the rotation matrix (3, 3) about a coordinate axis by `angle` [rad]."""
    first, second = {'x': (1, 2), 'y': (2, 0), 'z': (0, 1)}[axis]
    rotation = np.eye(3)
    rotation[first, first] = rotation[second, second] = math.cos(angle)
    rotation[second, first], rotation[first, second] = math.sin(angle), -math.sin(angle)
    return rotation


def _build(scenario: CraneScenario) -> mujoco.MjModel:
    """Return the scenario as a MuJoCo model: static trolley and stack, free load, four ropes."""
    half = np.array(scenario.size) / 2.0
    box = {'contype': 0, 'conaffinity': 0, 'type': mujoco.mjtGeom.mjGEOM_BOX}
    lowest_top = scenario.stack_size[2] - scenario.overlap + scenario.size[2]

    spec = mujoco.MjSpec()
    spec.option.gravity = 0.0, 0.0, -GRAVITY
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    trolley, stack, load = (spec.worldbody.add_body(name=name, pos=place) for name, place in (
        ('trolley', [*scenario.offset, lowest_top + scenario.rope_length]), ('stack', [0, 0, 0]),
        ('load', [*scenario.offset, lowest_top])))
    load.add_freejoint()
    load.mass, load.inertia, load.ipos = scenario.mass, scenario.load.inertia, scenario.mass_offset
    load.explicitinertial = True
    load.add_geom(size=half, **box)
    for pose, size in scenario.stack_boxes.values():
        stack.add_geom(size=np.array(size) / 2.0, pos=pose[:3], **box)
    for i, corner in enumerate(_CORNERS * half[:2]):
        trolley.add_site(name=f'hold_{i}', pos=[*(scenario.rope_spread * corner), 0.0])
        load.add_site(name=f'corner_{i}', pos=[*corner, half[2]])
        # The hoist sets the range's upper end before every physics step.
        rope = spec.add_tendon(
            name=f'rope_{i}', limited=mujoco.mjtLimited.mjLIMITED_TRUE,
            range=[0.0, scenario.rope_length],
            solref_limit=[-ROPE_STIFFNESS, -ROPE_DAMPING],
            solimp_limit=[ROPE_IMPEDANCE, ROPE_IMPEDANCE, 1.0, 0.5, 2.0])
        rope.wrap_site(f'hold_{i}')
        rope.wrap_site(f'corner_{i}')
    return spec.compile()

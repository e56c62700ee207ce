# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A crane that sets a container onto a stack: the simulator side, MuJoCo only, no ROS.

A trolley stands still high above the stack. Four ropes run from it to the four top corners of the
load. Ropes pull and never push: each is a spatial tendon, and the hoist moves its upper length
limit. Nothing else holds or damps the load, so it sways. The ropes converge towards the trolley,
so the load pitches and rolls as it sways. The stack is static. MuJoCo's own contact is switched
off. Without a wrench from outside, the load sinks a few centimetres into the stack.

For comparison, MuJoCo's own contact can be switched on instead (`own_contact`).

The hoist's programme is given as shares of the scenario's duration (`HOIST_SHARES`). A short run
therefore meets the same contacts as a long one; the load comes from another height. With `land` it
lowers until the ropes are slack, and stays so (`LANDING_SHARES`). That needs the wrench of a
contact, without which the load hangs in the stack in the end.

Conventions: SI units; world frame with z up and the ground at z = 0. A pose is the seven numbers
`x y z qx qy qz qw` of the body's centre. Angles given to `CraneScenario` are degrees.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from ..scene.force.laws import FRICTION, GRAVITY, Body
from ..scene.pose import cross, rotation_matrix
from ..scene.scene_solver import CONTAINER

# MuJoCo would write warnings to a file MUJOCO_LOG.TXT in the working directory.
mujoco.set_mju_user_warning(logging.getLogger(__name__).warning)

PHYSICS_STEP = 5e-4
"""Longest physics step, s. A tick of publication is cut into equal steps no longer than this."""

ROPE_STIFFNESS, ROPE_DAMPING, ROPE_IMPEDANCE = 1600.0, 3.0, 0.75
"""A rope's stretch as MuJoCo's limit spring, per unit of mass: 1/s^2, 1/s, 1.

Heave on the ropes rings at some 40 rad/s, far above sway, and dies out within a second; the load
stretches them by about 2 mm. The damping is small, because the solver damps the hoist's own speed
too. A hoist faster than `MAX_HOIST_SPEED` would jerk the rope with several times the weight.
"""

MAX_HOIST_SPEED = (1.0 - ROPE_IMPEDANCE) * GRAVITY / ROPE_DAMPING
"""Fastest lowering at which gravity's share in the limit outweighs its damping, m/s."""

HOIST_SHARES = {'hang': 0.05, 'lower': 0.30, 'stay': 0.45, 'lift': 0.15}
"""Phases of the hoist as shares of the duration, in order; the rest of the time the load hangs."""

TRIM_SHARES = (0.40, 0.70)
"""Shares of the duration between which the start tilt is trimmed out rope by rope, as a spreader
does. It begins after the first touch: the load touches with a corner or an edge, and ends on a
face."""

LANDING_SHARES = HOIST_SHARES | {'lower': 0.45, 'stay': math.inf}
"""The same of a landing, which never lifts."""

LANDING_OVERLAP = 0.8
"""Overlap for a landing, m: how far the ropes are paid out beyond a load at rest on the stack. Half
of it already leaves all four ropes slack, with a load tilted by 3 degrees (0.4 m unevenly in its
ropes) and a trolley a metre aside."""

LIMITS = {'mass': (1.0, 1e6), 'rope_length': (1.0, 200.0), 'rope_spread': (0.0, 1.0),
          'rope_angle': (0.0, 20.0), 'rope_heading': (-360.0, 360.0), 'pitch': (-10.0, 10.0),
          'roll': (-10.0, 10.0), 'yaw': (-20.0, 20.0), 'lowering_speed': (0.0, MAX_HOIST_SPEED),
          'overlap': (-1e3, 1.0), 'duration': (0.1, 86_400.0)}
"""Least and largest value of the numbers of a `CraneScenario`."""

CASTING = (0.178, 0.162, 0.118)
"""Full extents of a corner casting (ISO 1161), m."""
FRICTION_OF_OWN_CONTACT = (FRICTION, 0.005, 0.0001)
"""MuJoCo's friction along, about and across the normal: the law's, then MuJoCo's own defaults."""

_CORNERS = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]], dtype=float)


@dataclass(frozen=True, kw_only=True)
class CraneScenario:
    """What hangs where, and how it is lowered. Lengths in m, angles in degrees, world frame."""

    size: tuple[float, float, float] = CONTAINER  # full extents of the load
    stack_size: tuple[float, float, float] = CONTAINER  # it stands on the ground, not rotated
    mass: float = 20_000.0  # of the load, kg, with the moments of a full box
    mass_offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """The centre of mass from the load's centre, in the load's axes."""
    castings: bool = False
    """The load meets four corner castings, flush with the stack's top, and not the rest."""
    drop_position: tuple[float, float] = (0.0, 0.0)  # x, y of the stack's centre
    offset: tuple[float, float] = (0.25, -0.15)
    """x, y of the trolley from the stack's centre: the lateral error of the drop."""
    rope_length: float = 15.0  # height of the trolley over the load's top once the load is down
    rope_spread: float = 0.8  # ropes: spacing at the trolley by that at the load; 0: one point
    rope_angle: float = 1.5  # the load is released at rest, its ropes this far from the plumb line
    rope_heading: float = 35.0  # direction it is pulled aside to, counter-clockwise from x
    pitch: float = 0.25  # tilt about y at the start, held by unequal ropes
    roll: float = -0.4  # the same about x
    yaw: float = 0.6  # rotation about the plumb line at the start
    lowering_speed: float = 0.3  # top speed of the hoist, m/s; lifting uses it as well
    overlap: float = 0.025  # depth to which the load, at rest and level, is lowered into the stack
    duration: float = 18.0  # of the whole programme, s
    land: bool = False  # lower until the ropes are slack (give an `overlap` for it), never lift

    def __post_init__(self) -> None:
        """Raise ValueError naming field and value if the scenario makes no sense."""
        for field, length in (('size', 3), ('stack_size', 3), ('drop_position', 2), ('offset', 2),
                              ('mass_offset', 3)):
            values = tuple(float(value) for value in getattr(self, field))
            if len(values) != length or not all(map(math.isfinite, values)):
                raise ValueError(f'{field} must be {length} finite numbers, got {values}')
            if field.endswith('size') and min(values) <= 0.0:
                raise ValueError(f'{field} must be positive, got {values}')
            object.__setattr__(self, field, values)
        for field, (low, high) in LIMITS.items():
            value = float(getattr(self, field))
            if not low <= value <= high:
                raise ValueError(f'{field} must lie in [{low}, {high}], got {value}')
            object.__setattr__(self, field, value)
        if self.lowering_distance > 0.8 * self.rope_length:
            # The trolley would be in the load's way before the ropes are paid out.
            raise ValueError(
                f'duration of {self.duration} s at lowering_speed {self.lowering_speed} m/s starts '
                f'{self.lowering_distance:.2f} m up, too close to a trolley {self.rope_length} m up'
            )

    @classmethod
    def drawn(cls, seed: int, **fixed: Any) -> CraneScenario:
        """Draw offset, angles and heading at random from `seed`; 0 gives the defaults.

        Keywords in `fixed` are fields that are not drawn.
        """
        if seed == 0:
            return cls(**fixed)
        random = np.random.default_rng(seed)
        drawn: dict[str, Any] = {
            'offset': tuple(random.uniform(-0.5, 0.5, 2)),
            'rope_angle': random.uniform(1.0, 2.0),
            'rope_heading': random.uniform(-180.0, 180.0),
            'pitch': random.uniform(-0.3, 0.3),
            'roll': random.uniform(-0.5, 0.5),
            'yaw': random.uniform(-1.0, 1.0),
        }
        return cls(**(drawn | fixed))

    @property
    def inertia(self) -> np.ndarray:
        """Principal moments (3,) of the load about its own axes through its centre of mass."""
        return np.asarray(Body.of_box(self.size, self.mass).inertia)

    @property
    def stack_pose(self) -> np.ndarray:
        """Return the pose of the stack's centre (7,)."""
        return np.array([*self.drop_position, 0.5 * self.stack_size[2], 0.0, 0.0, 0.0, 1.0])

    @property
    def stack_boxes(self) -> list[tuple[np.ndarray, tuple[float, float, float]]]:
        """Return the boxes that the load may meet: pose (7,) and full extents [m] of each."""
        if not self.castings:
            return [(self.stack_pose, self.stack_size)]
        inset = 0.5 * (np.array(self.stack_size) - CASTING)[:2]
        boxes = []
        for corner in _CORNERS:
            pose = self.stack_pose
            pose[:2] += corner * inset
            pose[2] = self.stack_size[2] - 0.5 * CASTING[2]
            boxes.append((pose, CASTING))
        return boxes

    @property
    def pairs(self) -> dict[str, tuple[np.ndarray, tuple[float, float, float]]]:
        """Return the boxes of `stack_boxes` by the names of their pairs with the load."""
        return {f'load_stack_{number}': box for number, box in enumerate(self.stack_boxes)}

    @property
    def load(self) -> Body:
        """Return what laws of force know of the load."""
        return Body(mass=self.mass, inertia=self.inertia, centre=self.mass_offset)

    @property
    def _hoist_shares(self) -> dict[str, float]:
        return LANDING_SHARES if self.land else HOIST_SHARES

    def _travel(self, phase: str) -> float:
        """Return how far the hoist goes in a phase, m; its mean speed is half the top speed."""
        return 0.5 * self.lowering_speed * self._hoist_shares[phase] * self.duration

    @property
    def lowering_distance(self) -> float:
        """How far the hoist lowers the load, m."""
        return self._travel('lower')

    def hoist_height(self, time: float) -> float:
        """Return the height [m] of the load, level and at rest, over its lowest place."""
        hang, lower, stay, lift = (share * self.duration for share in self._hoist_shares.values())
        down = _ramp((time - hang) / lower)
        up = _ramp((time - hang - lower - stay) / lift)
        return self._travel('lower') * (1.0 - down) + self._travel('lift') * up

    def trim(self, time: float) -> float:
        """Return the share of the start tilt that the ropes still hold, 1 down to 0."""
        if self.land:
            return 1.0  # trimmed out by the landing itself, once the ropes are slack
        start, end = (share * self.duration for share in TRIM_SHARES)
        return 1.0 - _ramp((time - start) / (end - start))


class Crane:
    """The running simulation: load, stack and ropes, advanced by ticks of 1 / rate_hz seconds."""

    def __init__(self, scenario: CraneScenario, rate_hz: float = 200.0, *,
                 own_contact: bool = False) -> None:
        """Build the model and put the load at its start; `rate_hz` is ticks per second.

        own_contact: MuJoCo computes contacts and their forces itself, at every physics step.
        """
        if not (math.isfinite(rate_hz) and rate_hz > 0.0):
            raise ValueError(f'rate_hz must be positive, got {rate_hz}')
        self.scenario = scenario
        self._substeps = math.ceil(1.0 / (rate_hz * PHYSICS_STEP))
        self._rate_hz = float(rate_hz)
        self._ticks = 0
        self._model = _build(scenario, own_contact)
        self._model.opt.timestep = 1.0 / (rate_hz * self._substeps)
        self._data = mujoco.MjData(self._model)
        self._load = self._model.body('load').id
        self._is_off_centre, self._is_down = any(scenario.mass_offset), False
        self._start()

    @property
    def time(self) -> float:
        """Return the simulated time since the start, s: whole ticks, so it does not drift."""
        return self._ticks / self._rate_hz

    @property
    def physics_step(self) -> float:
        """Return the time between two evaluations of a wrench [s]."""
        return float(self._model.opt.timestep)

    @property
    def load_pose(self) -> np.ndarray:
        """Pose of the load's centre in the world frame, float64 (7,): x y z qx qy qz qw."""
        return self._data.qpos[[0, 1, 2, 4, 5, 6, 3]]  # MuJoCo's quaternions are w x y z

    @property
    def stack_pose(self) -> np.ndarray:
        """Pose of the stack's centre in the world frame, float64 (7,): x y z qx qy qz qw."""
        return self.scenario.stack_pose

    @property
    def load_velocity(self) -> np.ndarray:
        """Velocity of the load's centre of mass, angular velocity, world frame: (6,) m/s, rad/s."""
        angular = np.empty(3)
        # MuJoCo keeps a free joint's angular velocity in the body's own frame.
        mujoco.mju_rotVecQuat(angular, self._data.qvel[3:], self._data.qpos[3:])
        linear = self._data.qvel[:3]
        if self._is_off_centre:
            linear = linear + cross(angular, rotation_matrix(self.load_pose[3:])
                                    @ self.scenario.mass_offset)
        return np.concatenate([linear, angular])

    @property
    def own_contact_force(self) -> np.ndarray:
        """Force (3,) [N] of MuJoCo's own contacts on the load in the last physics step."""
        total, force = np.zeros(3), np.zeros(6)
        for number in range(self._data.ncon):
            mujoco.mj_contactForce(self._model, self._data, number, force)
            # Rows of a frame are axes; its normal points to the load, the body of higher number.
            total += self._data.contact[number].frame.reshape(3, 3).T @ force[:3]
        return total

    @property
    def rope_tensions(self) -> np.ndarray:
        """Pull of the four ropes during the last physics step, N, 0 where slack: (4,).

        Order: the corners (+x +y), (+x -y), (-x +y), (-x -y) of the load.
        """
        tensions = np.zeros(len(_CORNERS))
        rows = self._data.efc_type == mujoco.mjtConstraint.mjCNSTR_LIMIT_TENDON
        tensions[self._data.efc_id[rows]] = self._data.efc_force[rows]
        return tensions

    @property
    def ropes(self) -> np.ndarray:
        """Upper and lower end of the four ropes, world frame, (4, 2, 3); order as tensions."""
        corners = np.column_stack([_CORNERS, np.ones(len(_CORNERS))]) * self.scenario.size / 2.0
        pose = self.load_pose
        holds = [self._data.site(f'hold_{i}').xpos for i in range(len(_CORNERS))]
        lower = pose[:3] + corners @ rotation_matrix(pose[3:]).T
        return np.stack([np.array(holds), lower], axis=1)

    def step(self, wrench: Callable[[float], np.ndarray] | None = None) -> None:
        """Advance one tick, under a wrench that may change from one physics step to the next.

        wrench: from the simulated time [s] at which a physics step starts to force [N] and torque
        [N m] over it (6,), world frame, at the load's centre of mass. None for no wrench.
        """
        for substep in range(1, self._substeps + 1):
            start = (self._ticks + (substep - 1) / self._substeps) / self._rate_hz
            self._data.xfrc_applied[self._load] = wrench(start) if wrench else 0.0
            self._move_hoist((self._ticks + substep / self._substeps) / self._rate_hz)
            mujoco.mj_step(self._model, self._data)
        self._ticks += 1

    def _start(self) -> None:
        """Put the load at its start, and note each rope's extra length (4,) that holds its tilt.

        Ropes whose spacing is `rope_spread` at the trolley turn the load by (1 - rope_spread) of
        the angle they sway by. That rule is exact for spreads 0 and 1 and of first order between;
        the height is then set so that the tightest rope is just taut.
        """
        scenario, trolley = self.scenario, np.array(self._model.body('trolley').pos)
        drop = scenario.rope_length - scenario.lowering_distance
        half_height = np.array([0.0, 0.0, 0.5 * scenario.size[2]])
        angle, heading, pitch, roll, yaw = np.radians([
            scenario.rope_angle, scenario.rope_heading, scenario.pitch, scenario.roll,
            scenario.yaw])
        tilt = _rotation('z', yaw) @ _rotation('y', pitch) @ _rotation('x', roll)

        level = trolley - [0.0, 0.0, drop] - half_height
        self._put(level, tilt)
        lengths = self._data.ten_length.copy()
        self._put(level, _rotation('z', yaw))
        self._trims = lengths - self._data.ten_length

        # In the frame where x is the heading, the sway is a rotation about -y.
        sway = _rotation('z', heading) @ _rotation('y', -(1.0 - scenario.rope_spread) * angle)
        sway = sway @ _rotation('z', -heading)
        aside = drop * np.array([math.sin(angle) * math.cos(heading),
                                 math.sin(angle) * math.sin(heading), -math.cos(angle)])
        centre = trolley + aside - sway @ half_height
        self._set_ropes(scenario.lowering_distance, 1.0)
        for _ in range(4):  # Newton on a nearly linear function: the rope's slope in z is near 1
            self._put(centre, sway @ tilt)
            centre[2] += np.max(self._data.ten_length - self._model.tendon_range[:, 1])
        self._put(centre, sway @ tilt)

    def _put(self, centre: np.ndarray, rotation: np.ndarray) -> None:
        """Place the load at rest, its centre in the world frame, and update all derived values."""
        self._data.qpos[:3] = centre
        mujoco.mju_mat2Quat(self._data.qpos[3:], np.ascontiguousarray(rotation).ravel())
        self._data.qvel[:] = 0.0
        mujoco.mj_forward(self._model, self._data)

    def _move_hoist(self, time: float) -> None:
        """Set the ropes for a time [s]; those of a landing stay as they are once they are down."""
        if not (self.scenario.land and self._is_down):
            height = self.scenario.hoist_height(time)
            self._set_ropes(height, self.scenario.trim(time))
            self._is_down = height == 0.0

    def _set_ropes(self, height: float, trim: float) -> None:
        """Set the ropes' length limits for a level load `height` over its lowest place, m."""
        scenario = self.scenario
        drop = scenario.rope_length - height
        inward = 0.5 * (1.0 - scenario.rope_spread) * math.hypot(*scenario.size[:2])
        self._model.tendon_range[:, 1] = math.hypot(inward, drop) + trim * self._trims


def _ramp(share: float) -> float:
    """Rise from 0 to 1 over share 0 to 1, with no speed and no jerk at either end."""
    share = min(max(share, 0.0), 1.0)
    return share - math.sin(2.0 * math.pi * share) / (2.0 * math.pi)


def _rotation(axis: str, angle: float) -> np.ndarray:
    """Return the rotation matrix (3, 3) about a coordinate axis by `angle` in rad."""
    first, second = {'x': (1, 2), 'y': (2, 0), 'z': (0, 1)}[axis]
    rotation = np.eye(3)
    rotation[first, first] = rotation[second, second] = math.cos(angle)
    rotation[second, first], rotation[first, second] = math.sin(angle), -math.sin(angle)
    return rotation


def _build(scenario: CraneScenario, own_contact: bool) -> mujoco.MjModel:
    """Return the scenario as a MuJoCo model: static trolley and stack, free load, four ropes."""
    half, stack_half = np.array(scenario.size) / 2.0, np.array(scenario.stack_size) / 2.0
    contact = {'contype': int(own_contact), 'conaffinity': int(own_contact),
               'friction': FRICTION_OF_OWN_CONTACT, 'type': mujoco.mjtGeom.mjGEOM_BOX}
    stack_centre = scenario.stack_pose[:3]
    lowest_top = 2.0 * stack_half[2] - scenario.overlap + 2.0 * half[2]
    above = stack_centre[:2] + scenario.offset

    spec = mujoco.MjSpec()
    spec.option.gravity = 0.0, 0.0, -GRAVITY
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    trolley, stack, load = (spec.worldbody.add_body(name=name, pos=place) for name, place in (
        ('trolley', [*above, lowest_top + scenario.rope_length]), ('stack', stack_centre),
        ('load', [*above, lowest_top])))
    load.add_freejoint()
    load.mass, load.inertia, load.ipos = scenario.mass, scenario.inertia, scenario.mass_offset
    load.explicitinertial = True
    load.add_geom(size=half, **contact)
    for pose, size in scenario.stack_boxes:
        stack.add_geom(size=np.array(size) / 2.0, pos=pose[:3] - stack_centre, **contact)
    for i, corner in enumerate(_CORNERS * half[:2]):
        trolley.add_site(name=f'hold_{i}', pos=[*(scenario.rope_spread * corner), 0.0])
        load.add_site(name=f'corner_{i}', pos=[*corner, half[2]])
        # The range's upper end is set by the hoist before every physics step.
        rope = spec.add_tendon(
            name=f'rope_{i}', limited=mujoco.mjtLimited.mjLIMITED_TRUE,
            range=[0.0, scenario.rope_length],
            solref_limit=[-ROPE_STIFFNESS, -ROPE_DAMPING],
            solimp_limit=[ROPE_IMPEDANCE, ROPE_IMPEDANCE, 1.0, 0.5, 2.0])
        rope.wrap_site(f'hold_{i}')
        rope.wrap_site(f'corner_{i}')
    return spec.compile()

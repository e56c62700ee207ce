# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The crane without ROS, held against closed forms of mechanics."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip('mujoco')

from box_contact_ros.demo.crane import Crane, CraneScenario
from box_contact_ros.demo.landing import DURATION
from box_contact_ros.forces.patch_forces import GRAVITY
from box_contact_ros.scene.boxes import CONTAINER
from box_contact_ros.solver.pose import rotation_matrix

pytestmark = pytest.mark.reports

LENGTH, WIDTH, HEIGHT = CONTAINER

# Hangs still and level over the stack: what a test varies stands out.
STILL = {
    'offset': (0.0, 0.0), 'rope_angle': 0.0, 'pitch': 0.0, 'roll': 0.0, 'yaw': 0.0,
    'lowering_speed': 0.0, 'overlap': -0.5,
}


def run(crane: Crane, seconds: float = DURATION) -> np.ndarray:
    """Return poses (n, 7) of the load over so long."""
    poses = []
    while crane.time < seconds:
        poses.append(crane.load_pose)
        crane.step()
    return np.array(poses)


def period(signal: np.ndarray, rate_hz: float) -> float:
    """Period of an oscillation about 0, s, from its first to its last upward crossing."""
    before = np.flatnonzero((signal[:-1] < 0) & (signal[1:] >= 0))
    crossings = before + signal[before] / (signal[before] - signal[before + 1])
    assert len(crossings) >= 3
    return (crossings[-1] - crossings[0]) / (len(crossings) - 1) / rate_hz


@pytest.mark.parametrize('heading', [0.0, 90.0])
def test_parallel_ropes_make_a_point_pendulum(heading):
    """Parallel ropes keep the load level: T = 2 pi sqrt(l / g) (1 + angle^2 / 16)."""
    scenario = CraneScenario(
        **STILL | {'rope_angle': 3.0, 'rope_spread': 1.0, 'rope_heading': heading})
    poses = run(Crane(scenario), 40.0)
    swing = poses[:, 0] if heading == 0.0 else poses[:, 1]
    theory = 2 * math.pi * math.sqrt(scenario.rope_length / GRAVITY)
    theory *= 1 + math.radians(3.0) ** 2 / 16
    assert period(swing, 200.0) == pytest.approx(theory, rel=1e-3)
    tilts = np.hypot(poses[:, 3], poses[:, 4])
    assert 2 * tilts.max() < math.radians(0.05)


@pytest.mark.parametrize('spread', [1.0, 0.8, 0.3])
def test_ropes_carry_the_weight(spread):
    """At rest the vertical parts of the four tensions add up to m g, in equal shares."""
    crane = Crane(CraneScenario(**STILL | {'rope_spread': spread}))
    for _ in range(2000):
        crane.step()
    drop = crane.scenario.rope_length
    slope = math.hypot((1 - spread) * math.hypot(LENGTH, WIDTH) / 2, drop) / drop
    share = crane.scenario.mass * GRAVITY / 4 * slope
    assert crane.rope_tensions == pytest.approx(np.full(4, share), rel=1e-3)
    lengths = np.linalg.norm(np.diff(crane.ropes, axis=1), axis=2)[:, 0]
    assert lengths == pytest.approx(crane.data.ten_length, abs=1e-9)
    assert (crane.ropes[:, 0, 2] > crane.ropes[:, 1, 2]).all()
    assert np.abs(crane.load_velocity).max() < 1e-6
    # The ropes stretch, but by millimetres only.
    level = HEIGHT + 0.5 + HEIGHT / 2
    assert level - 0.005 < crane.load_pose[2] < level


def test_ropes_are_slack_while_the_load_is_held_up():
    """A force a little over the weight takes the load off its ropes: all tensions are 0."""
    crane = Crane(CraneScenario(**STILL))
    force = np.array([0.0, 0.0, 1.001 * crane.scenario.mass * GRAVITY])
    for _ in range(400):
        crane.step(lambda _: np.array([*force, 0.0, 0.0, 0.0]))
    assert not crane.rope_tensions.any()
    height = crane.load_pose[2]
    crane.step()  # no wrench: it was held over one tick only, so the load falls into its ropes
    for _ in range(400):
        crane.step()
    assert crane.rope_tensions.all()
    assert crane.load_pose[2] < height


@pytest.mark.parametrize('rate_hz', [200.0, 1000.0, 300.0])
def test_a_wrench_acts_at_the_centre_of_mass_in_the_world_frame(rate_hz):
    """With slack ropes and force (f, 0, 2 m g), torque (0, 0, M): z = g t^2 / 2, x = f t^2 / 2 m.

    The load turns by M t^2 / 2 I, I = m (length^2 + width^2) / 12, and stays level, although it
    starts turned by 20 degrees.
    """
    crane = Crane(CraneScenario(**STILL | {'yaw': 20.0}), rate_hz)
    mass, start, time = crane.scenario.mass, crane.load_pose, 0.2
    inertia = mass * (LENGTH ** 2 + WIDTH ** 2) / 12
    force, torque = np.array([2e4, 0.0, 2 * mass * GRAVITY]), np.array([0.0, 0.0, 3e5])
    for _ in range(round(time * rate_hz)):
        crane.step(lambda _: np.array([*force, *torque]))
    assert crane.time == pytest.approx(time, abs=1e-12)
    moved = crane.load_pose - start
    # Each physics step adds its whole gain in speed at once: a lead of one step in the time.
    lead = {'rel': 1e-2}
    assert moved[2] == pytest.approx(GRAVITY * time ** 2 / 2, **lead)
    assert moved[0] == pytest.approx(2e4 / mass * time ** 2 / 2, **lead)
    assert moved[1] == pytest.approx(0.0, abs=1e-9)
    turned = rotation_matrix(crane.load_pose[3:]) @ rotation_matrix(start[3:]).T
    assert math.atan2(turned[1, 0], turned[0, 0]) == pytest.approx(
        3e5 / inertia * time ** 2 / 2, **lead)
    assert crane.load_velocity[5] == pytest.approx(3e5 / inertia * time, rel=1e-3)


def test_velocity_is_the_derivative_of_the_pose():
    """Here v = dx/dt; the world-frame rate w follows from R(t + dt) R(t)^T = 1 + [w] dt."""
    crane = Crane(CraneScenario(yaw=15.0, roll=5.0, pitch=-4.0, rope_spread=0.4), rate_hz=2000.0)
    for _ in range(3000):
        crane.step()
    before, velocity = crane.load_pose, crane.load_velocity
    crane.step()
    after = crane.load_pose
    linear = (after[:3] - before[:3]) * 2000.0
    spin = (rotation_matrix(after[3:]) @ rotation_matrix(before[3:]).T - np.eye(3)) * 2000.0
    angular = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
    mean = (velocity + crane.load_velocity) / 2
    assert np.abs(angular).max() > 1e-2
    assert linear == pytest.approx(mean[:3], abs=1e-3)
    assert angular == pytest.approx(mean[3:], abs=1e-3)


def test_poses_are_position_then_x_y_z_w():
    """A level load turned by 20 degrees about z has the quaternion (0, 0, sin 10, cos 10)."""
    crane = Crane(CraneScenario(**STILL | {'yaw': 20.0, 'offset': (5.0, 40.0)}))
    expected = [0.0, 0.0, math.sin(math.radians(10.0)), math.cos(math.radians(10.0))]
    assert crane.load_pose[3:] == pytest.approx(expected, abs=1e-12)
    assert crane.load_pose[:2] == pytest.approx([5.0, 40.0], abs=1e-9)
    assert crane.scenario.stack_pose.tolist() == [0.0, 0.0, HEIGHT / 2, 0.0, 0.0, 0.0, 1.0]


@pytest.mark.parametrize('pitch', [-0.3, 0.0, 0.25])
def test_without_a_wrench_the_load_sinks_into_the_stack(pitch):
    """No contact force of MuJoCo is applied: the ropes still carry the weight, to some percent."""
    crane = Crane(CraneScenario(pitch=pitch, overlap=0.025))
    heights = run(crane)[:, 2] - 1.5 * HEIGHT
    assert heights[0] > 0.5 and -0.10 < heights.min() < -0.02
    weight = crane.scenario.mass * GRAVITY
    assert crane.rope_tensions.sum() == pytest.approx(weight, rel=0.02)


@pytest.mark.parametrize('speed', [0.3, 0.8])
def test_lowering_keeps_the_ropes_taut(speed):
    """Up to the fastest speed of the hoist all four ropes pull, without jerks beyond the weight."""
    crane = Crane(CraneScenario(lowering_speed=speed, overlap=0.025))
    weight = crane.scenario.mass * GRAVITY
    while crane.time < DURATION:
        crane.step()
        if crane.time > 1.0:  # released with slightly unequal ropes, the load settles first
            assert crane.rope_tensions.min() > 0.1 * weight / 4
            assert crane.rope_tensions.sum() < 1.3 * weight


def test_the_same_scenario_gives_the_same_bits():
    """Nothing is drawn at run time, so two runs agree exactly."""
    scenario = CraneScenario()
    assert np.array_equal(run(Crane(scenario), 3.0), run(Crane(scenario), 3.0))


def test_a_wrench_may_change_within_a_tick():
    """Slack ropes, gravity cancelled, f = m a from 2 ms of a 5-ms tick on: v = a · 3 ms after it.

    The wrench is asked for at the start of every physics step of 0.5 ms.
    """
    crane = Crane(CraneScenario(rope_angle=0.0, pitch=0.0, roll=0.0, yaw=0.0), 200.0)
    mass, times = crane.scenario.mass, []

    def wrench(time: float) -> np.ndarray:
        times.append(time)
        side = 2.0 * mass if time > 0.0019 else 0.0
        return np.array([side, 0.0, 1.2 * mass * GRAVITY, 0.0, 0.0, 0.0])

    crane.step(wrench)
    assert times == pytest.approx(np.arange(10) * 5e-4, abs=1e-12)
    assert crane.load_velocity[0] == pytest.approx(2.0 * 0.003, rel=1e-3)

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The crane without ROS, held against closed forms of mechanics."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest

pytest.importorskip('mujoco')

from benchmarks.pose_sets import CONTAINER
from box_contact_ros.demo.mujoco_crane import MAX_HOIST_SPEED, Crane, CraneScenario
from box_contact_ros.scene.force.laws import GRAVITY

LENGTH, WIDTH, HEIGHT = CONTAINER

# Hangs still and level over the stack: what a test varies stands out.
STILL = {
    'offset': (0.0, 0.0), 'rope_angle': 0.0, 'pitch': 0.0, 'roll': 0.0, 'yaw': 0.0,
    'lowering_speed': 0.0, 'overlap': -0.5,
}


def rotation(pose: np.ndarray) -> np.ndarray:
    """Rotation matrix (3, 3), body to world, of a pose x y z qx qy qz qw."""
    x, y, z, w = pose[3:]
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])


def bottom_corners(pose: np.ndarray) -> np.ndarray:
    """World positions (4, 3) of the load's bottom corners, m."""
    signs = np.array(list(product((1, -1), (1, -1), (-1,))))
    return pose[:3] + (signs * np.array(CONTAINER) / 2) @ rotation(pose).T


def run(crane: Crane) -> np.ndarray:
    """Poses (n, 7) of the load over the scenario's whole duration."""
    poses = []
    while crane.time < crane.scenario.duration:
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
        **STILL | {'rope_angle': 3.0, 'rope_spread': 1.0, 'rope_heading': heading, 'duration': 40.0}
    )
    poses = run(Crane(scenario))
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
    turned = rotation(crane.load_pose) @ rotation(start).T
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
    spin = (rotation(after) @ rotation(before).T - np.eye(3)) * 2000.0
    angular = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
    mean = (velocity + crane.load_velocity) / 2
    assert np.abs(angular).max() > 1e-2
    assert linear == pytest.approx(mean[:3], abs=1e-3)
    assert angular == pytest.approx(mean[3:], abs=1e-3)


def test_poses_are_position_then_x_y_z_w():
    """A level load turned by 20 degrees about z has the quaternion (0, 0, sin 10, cos 10)."""
    crane = Crane(CraneScenario(**STILL | {'yaw': 20.0, 'drop_position': (5e5, 4e6)}))
    expected = [0.0, 0.0, math.sin(math.radians(10.0)), math.cos(math.radians(10.0))]
    assert crane.load_pose[3:] == pytest.approx(expected, abs=1e-12)
    assert crane.load_pose[:2] == pytest.approx([5e5, 4e6], abs=1e-9)
    assert crane.stack_pose.tolist() == [5e5, 4e6, HEIGHT / 2, 0.0, 0.0, 0.0, 1.0]
    assert crane.load_pose.dtype == crane.stack_pose.dtype == np.float64


@pytest.mark.parametrize('seed', range(6))
@pytest.mark.parametrize('duration', [4.0, 18.0])
def test_the_load_comes_down_on_the_stack_and_leaves_it(seed, duration):
    """One corner touches first, the load sinks in by some centimetres, and is clear at the end."""
    crane = Crane(CraneScenario.drawn(seed, duration=duration))
    stack_top, stack = HEIGHT, crane.stack_pose
    corners = np.array([bottom_corners(pose) for pose in run(crane)])
    heights = corners[:, :, 2] - stack_top
    lowest = heights.min(axis=1)
    assert lowest[0] > 0.05
    assert lowest[-1] > 0.02
    assert -0.10 < lowest.min() < -0.03
    assert 0.3 < np.mean(lowest < 0.0) < 0.7
    first = heights[np.flatnonzero(lowest < 0.0)[0]]
    assert np.count_nonzero(first < 0.0) <= 2, 'a corner or an edge touches before the face'
    assert (heights < 0.0).all(axis=1).any(), 'later the whole face is in'
    assert np.array_equal(crane.stack_pose, stack)


def test_mujoco_applies_no_contact_force():
    """While the load is in the stack its ropes still carry the whole weight, to some percent."""
    crane = Crane(CraneScenario())
    while crane.time < 0.6 * crane.scenario.duration:
        crane.step()
    assert bottom_corners(crane.load_pose)[:, 2].min() < HEIGHT - 0.02
    weight = crane.scenario.mass * GRAVITY
    assert crane.rope_tensions.sum() == pytest.approx(weight, rel=0.02)


@pytest.mark.parametrize('speed', [0.3, MAX_HOIST_SPEED])
def test_lowering_keeps_the_ropes_taut(speed):
    """At every allowed speed of the hoist all four ropes pull, without jerks beyond the weight."""
    crane = Crane(CraneScenario(lowering_speed=speed))
    weight = crane.scenario.mass * GRAVITY
    while crane.time < crane.scenario.duration:
        crane.step()
        if crane.time > 1.0:  # released with slightly unequal ropes, the load settles first
            assert crane.rope_tensions.min() > 0.1 * weight / 4
            assert crane.rope_tensions.sum() < 1.3 * weight


def test_the_same_scenario_gives_the_same_bits():
    """Nothing is drawn at run time, so two runs agree exactly."""
    scenario = CraneScenario(duration=5.0)
    assert np.array_equal(run(Crane(scenario)), run(Crane(scenario)))


def test_seeds_draw_scenarios():
    """Seed 0 is the standard scenario, every other one of its own; fixed fields stay."""
    assert CraneScenario.drawn(0) == CraneScenario()
    assert CraneScenario.drawn(1) == CraneScenario.drawn(1) != CraneScenario.drawn(2)
    assert CraneScenario.drawn(1, yaw=2.5).yaw == 2.5


@pytest.mark.parametrize('field, value', [
    ('size', (1.0, 0.0, 1.0)),
    ('size', (1.0, 1.0)),
    ('stack_size', (1.0, math.nan, 1.0)),
    ('mass', 0.0),
    ('drop_position', (math.inf, 0.0)),
    ('offset', (1.0, 2.0, 3.0)),
    ('rope_length', -1.0),
    ('rope_spread', 1.5),
    ('rope_angle', math.nan),
    ('pitch', 45.0),
    ('lowering_speed', 2.0),
    ('duration', 0.0),
    ('duration', 1000.0),
])
def test_a_senseless_scenario_is_refused_by_field_and_value(field, value):
    """The error names the field and shows the value; 1000 s would start above the trolley."""
    shown = value if not isinstance(value, tuple) else value[0]
    with pytest.raises(ValueError, match=field) as caught:
        CraneScenario(**{field: value})
    assert str(shown) in str(caught.value)


@pytest.mark.parametrize('rate_hz', [0.0, -5.0, math.nan, math.inf])
def test_a_senseless_rate_is_refused(rate_hz):
    """Ticks need a positive, finite rate."""
    with pytest.raises(ValueError, match='rate_hz'):
        Crane(CraneScenario(), rate_hz)

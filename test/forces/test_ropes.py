# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ropes and springs of the user's own, whose wrenches are those of the poses `ahead`."""
from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from worlds import CONTAINER, FLOOR, STEP, World

from box_contact_ros import ContactSolver
from box_contact_ros.forces.patch_forces import GRAVITY

FRAME = 1.0 / 60.0  # [s]
MASS, ROPE, STIFFNESS = 18e3, 20.0, 3e6  # of a load [kg], and its rope [m], [N/m]
TEN_MINUTES = 600.0  # [s]
Wrench = Callable[[np.ndarray, np.ndarray, float], np.ndarray]


def run(world: World, wrench: Wrench, seconds: float, dt: float) -> np.ndarray:
    """Return pose and velocity of the last body after each step; wrench: of both, on it."""
    rows, weights = [], world.outside.copy()
    for k in range(round(seconds / dt)):
        ahead = world.forces.ahead(dt, world.poses, world.velocities)
        world.outside = weights.copy()
        world.outside[-1] += wrench(ahead[-1], world.velocities[-1], k * dt)
        world.step(dt)
        rows.append(np.append(world.poses[-1], world.velocities[-1]))
    return np.array(rows)


def pull(top: np.ndarray, end: np.ndarray, speed: np.ndarray, length: float, stiffness: float,
         damping: float = 0.0) -> np.ndarray:
    """Return the force of a rope on its end (3,), which it can only pull [N]."""
    way = end - top
    far = np.linalg.norm(way)
    return -max(0.0, stiffness * (far - length) + damping * (speed @ way) / far) * way / far


@pytest.mark.parametrize(('dt', 'seconds'), [
    (STEP, 30.0), (0.004, 120.0), (FRAME, TEN_MINUTES), (1 / 30, TEN_MINUTES)])
def test_a_load_on_a_rope_swings_on(dt: float, seconds: float) -> None:
    """By 5° on 20 m: angle and frequency change by less than 1 % in ten minutes.

    By the poses as they are, in two minutes at 1/60 s by a fifth.
    """
    start = math.radians(5.0)
    world = World(((6.0, 2.4, 2.6), MASS, (ROPE * math.sin(start), 0, -ROPE * math.cos(start))),
                  pairs=())
    stretched = ROPE - MASS * GRAVITY / STIFFNESS
    damping = 0.6 * math.sqrt(STIFFNESS * MASS)

    def rope(pose: np.ndarray, velocity: np.ndarray, time: float) -> np.ndarray:
        return np.append(pull(np.zeros(3), pose[:3], velocity[:3], stretched, STIFFNESS, damping),
                         np.zeros(3))

    x = run(world, rope, seconds, dt)[:, 0]
    period = 2.0 * math.pi * math.sqrt(ROPE / GRAVITY) * (1.0 + start**2 / 16.0)
    widest = np.abs(x[-round(period / dt):]).max()
    assert math.asin(widest / ROPE) == pytest.approx(start, rel=0.01 * seconds / TEN_MINUTES)
    before = np.flatnonzero((x[:-1] > 0.0) & (x[1:] <= 0.0))
    crossings = dt * (before + x[before] / (x[before] - x[before + 1]))
    assert np.diff(crossings).mean() == pytest.approx(period, rel=1e-3)


@pytest.mark.parametrize('along', [2, 5])
@pytest.mark.parametrize('dt', [STEP, 1 / 120, FRAME, 1 / 30])
def test_a_spring_keeps_its_amplitude(dt: float, along: int) -> None:
    """Of 10 rad/s, for 20 s, also one that turns; by the poses as they are × 23 at 1/60 s."""
    world = World(((1.0, 2.0, 3.0), 60.0, (0, 0, 0)), pairs=())
    world.outside[:] = 0.0
    world.velocities[0, along] = 0.5
    inertia = world.bodies[0].inertia[2]

    def spring(pose: np.ndarray, velocity: np.ndarray, time: float) -> np.ndarray:
        return -100.0 * np.array([*(60.0 * pose[:3]), 0, 0,
                                  inertia * 2.0 * math.atan2(pose[5], pose[6])])

    speed = np.abs(run(world, spring, 20.0, dt)[:, 7 + along])
    first, last = np.split(speed, 2)
    assert last.max() == pytest.approx(first.max(), rel=2e-3)
    assert first.max() == pytest.approx(0.5, rel=0.02)


@pytest.mark.parametrize('steps', [(STEP,), (FRAME,), (0.25,), (0.1, STEP, STEP), (FRAME, 0.05)])
@pytest.mark.parametrize('kind', ['free', 'heavy on light', 'late'])
def test_poses_ahead_go_on_by_semi_implicit_euler(steps: tuple[float, ...], kind: str) -> None:
    """ahead(x', v') = ahead(x, v) + v'·dt, whatever number of sub-steps a body takes."""
    mass = 3e4 if kind == 'heavy on light' else 10.0
    rows = FLOOR, ((1.0,) * 3, 10.0, (0, 0, 0.5)), ((1.0,) * 3, mass, (0, 0, 1.5))
    world = World(*rows[2:] if kind == 'free' else rows, pairs=() if kind == 'free' else None,
                  friction=0.0)
    if kind == 'late':
        world.forces.reset()
        pairs = np.array([(0, 1), (1, 2)])
        world.forces.hold(pairs, ContactSolver().batch(world.poses, sizes=world.size, pairs=pairs),
                          world.poses, age=0.05, period=0.1)
    for dt in steps * 3:
        world.step(dt)
    world.outside[-1, 0] = 100.0 * mass
    before = world.forces.ahead(dt, world.poses, world.velocities)
    world.step(dt)
    after = world.forces.ahead(dt, world.poses, world.velocities)
    way = (after - before)[-1, 0]
    assert way == pytest.approx(world.velocities[-1, 0] * dt, rel=1e-6)
    assert world.velocities[-1, 0] == pytest.approx(100.0 * dt, rel=1e-4)


def test_ahead_changes_nothing_and_leaves_what_rests() -> None:
    """What is still is where it was, to the bit: else a rope on it would wake it."""
    rows = FLOOR, ((1.0,) * 3, 10.0, (0, 0, 0.5), (0.1, 0.2, 0.3, 0.9)), (
        (1.0,) * 3, 1.0, (3, 0, 9))
    world, twin = World(*rows), World(*rows)
    for _ in range(50):
        world.forces.ahead(FRAME, world.poses, world.velocities)
        world.forces.ahead(0.5, world.poses, world.velocities)
        world.step(FRAME)
        twin.step(FRAME)
    assert world.poses.tobytes() == twin.poses.tobytes()
    ahead = world.forces.ahead(FRAME, world.poses, np.zeros((3, 6)))
    assert ahead.tobytes() == world.poses.tobytes()


@pytest.mark.parametrize(('field', 'value', 'words'), [
    ('dt', 1.0, 'dt must be at least 1e-50 s and below 1 s, not 1'),
    ('poses', [(0, 0, 0, 0, 0, 0, 0)], r'poses\[0\]'),
    ('velocities', [(math.nan,) + (0,) * 5], r'velocities\[0\] has nan'),
    ('poses', [(0, 0, 0, 0, 0, 0, 1)] * 2, 'poses must')])
def test_ahead_refuses(field: str, value: object, words: str) -> None:
    world = World(((1.0,) * 3, 1.0, (0, 0, 0)), pairs=())
    given = {'dt': STEP, 'poses': world.poses, 'velocities': world.velocities, field: value}
    with pytest.raises(ValueError, match=words):
        world.forces.ahead(**given)


@pytest.mark.parametrize('dt', [0.004, FRAME, 1 / 30])
def test_a_container_on_four_ropes_lands_and_is_lifted(dt: float) -> None:
    """Ropes without damping go slack, and pull again: nothing is faster than the hoist makes it.

    The hoist lowers at 0.2 m/s for 5 s, the ropes slack by 0.5 m, and lifts as long. A load that
    is lifted at a speed bounces by as much: by twice that, once the hoist stops.
    """
    hoist, high = 0.2, 0.5
    world = World(FLOOR, (CONTAINER, MASS, (0, 0, 0.5 * CONTAINER[2] + high)))
    corners = 0.5 * np.array(CONTAINER) * [(x, y, 1) for x in (-1, 1) for y in (-1, 1)]
    top, stiffness = corners + [0, 0, 10.0], 0.25 * STIFFNESS
    length = 10.0 - 0.25 * MASS * GRAVITY / stiffness

    def ropes(pose: np.ndarray, velocity: np.ndarray, time: float) -> np.ndarray:
        lowered = hoist * (min(time, 5.0) - min(max(time - 7.0, 0.0), 5.0))
        total = np.zeros(6)
        spin = 2.0 * pose[3:6] * pose[6]  # the load hardly turns
        for at, hook in zip(corners, top):
            arm = at + np.cross(spin, at)
            force = pull(hook + [0, 0, 0.5 * CONTAINER[2] + high], pose[:3] + arm, velocity[:3],
                         length + lowered, stiffness)
            total += np.append(force, np.cross(arm, force))
        return total

    rows = run(world, ropes, 22.0, dt)
    time = dt * np.arange(1, len(rows) + 1)
    landed, lifted = rows[(time > 6.0) & (time < 7.0)], rows[time > 12.0]
    assert np.abs(landed[:, 7:]).max() < 1e-3
    assert landed[:, 2] == pytest.approx(0.5 * CONTAINER[2], abs=2e-3)
    assert np.abs(lifted[:, 9]).max() < 2.1 * hoist
    assert lifted[:, 2].mean() == pytest.approx(0.5 * CONTAINER[2] + high, abs=0.01)
    assert np.abs(lifted[:, 10:]).max() < 1e-3

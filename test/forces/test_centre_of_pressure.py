# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Friction acts at the centre of pressure: where the load is off centre, and where a box landed."""
from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from worlds import FIXED, STEP, World, turned

from box_contact_ros import Body, PatchForces
from box_contact_ros.forces.patch_forces import FRICTION, GRAVITY

FRAME = 1.0 / 60.0  # [s]
LONG = (200.0, 50.0, 1.0), 0.0, (0.0, 0.0, -0.5)
"""A carrier, as a row of `World`."""
PLATE = (2.0, 2.0, 0.4)
Speed = Callable[[float], float]


def off_centre(aside: float) -> World:
    """Return a plate of 1 t on a carrier, whose mass is low, and aside along y [m]."""
    return World(LONG, (PLATE, 1000.0, (0, 0, 0.2), (0, 0, 0, 1), (0, aside, -0.19)))


def yaw(world: World, body: int = 1) -> float:
    """Return by how much a body is turned about z [°]."""
    return math.degrees(2.0 * math.atan2(*world.poses[body, 5:]))


def slip(world: World, share: float, dt: float, settled: float = 0.5) -> tuple[float, float]:
    """Return how far a box slides [mm], and how far it turns [°], on a carrier that brakes.

    The carrier brakes for 1.5 s by a share of what friction holds, after a time at rest [s].
    """
    start, first = np.zeros(2), 0.0
    for k in range(round((1.5 + settled) / dt)):
        time = (k + 1) * dt - settled
        way = 0.0 if time < 0.0 else time**2 if time < 0.5 else time - 0.25
        world.velocities[0, 0] = -share * FRICTION * GRAVITY * way
        world.step(dt)
        if time <= 0.0:
            start, first = (world.poses[1] - world.poses[0])[:2], yaw(world)
    way = (world.poses[1] - world.poses[0])[:2] - start
    return 1e3 * float(np.hypot(*way)), yaw(world) - first


@pytest.mark.parametrize('dt', [STEP, FRAME])
@pytest.mark.parametrize('aside', [0.0, 0.2, 0.4, 0.6, 0.8])
def test_a_box_off_centre_slides_straight(aside: float, dt: float) -> None:
    """From 3 m/s it goes v² / 2μg. About the overlap's centroid it turned by 9 to 34°."""
    world = off_centre(aside)
    world.velocities[1, 0] = 3.0
    world.run(1.5, dt)
    angle = math.radians(yaw(world))
    mass = world.poses[1, :2] + aside * np.array([-math.sin(angle), math.cos(angle)])
    way = 3.0**2 / (2.0 * FRICTION * GRAVITY)
    assert mass == pytest.approx([way, aside], abs=0.01 * way)
    assert abs(yaw(world)) < 1.0


@pytest.mark.parametrize('dt', [STEP, FRAME])
@pytest.mark.parametrize('aside', [0.0, 0.2, 0.4, 0.6, 0.8])
def test_a_box_off_centre_holds_to_coulombs_limit(aside: float, dt: float) -> None:
    """About the overlap's centroid it slid at 0.96, 0.88, 0.78 and 0.68 of μ·g."""
    way, angle = slip(off_centre(aside), 0.99, dt)
    assert way < 2.0 and abs(angle) < 0.01
    assert slip(off_centre(aside), 1.01, dt)[0] > 20.0


@pytest.mark.parametrize('dt', [STEP, FRAME])
@pytest.mark.parametrize(('size', 'fall', 'degrees'), [
    (PLATE, 0.0, 0.0), (PLATE, 0.002, 0.02), (PLATE, 0.002, 0.1), (PLATE, 0.0, 0.1),
    ((1.2, 0.8, 0.144), 0.002, 0.1), ((6.058, 2.438, 2.591), 0.002, 0.1)])
def test_what_has_landed_holds_to_coulombs_limit(size: tuple[float, ...], fall: float,
                                                 degrees: float, dt: float) -> None:
    """It lies in a wedge of microns, whose centroid is 0.6 m aside: it slid at 0.80 to 0.96."""
    tilt = math.radians(degrees)
    height = 0.5 * size[2] + fall + 0.5 * size[1] * math.sin(tilt)
    world = World(LONG, (size, 1000.0, (0, 0, height), turned((1, 0, 0), tilt)))
    way, angle = slip(world, 0.99, dt, settled=1.0)
    assert way < 2.0 and abs(angle) < 0.01


def on_forks(share: float, dt: float) -> float:
    """Return how far a pallet of 40 cartons slides on the forks of a truck in a curve [mm].

    The curve takes a share of what friction on the forks holds.
    """
    rubs, radius, fork, deck, carton = 0.2, 6.0, 1.15, (1.2, 0.8, 0.144), (0.3, 0.4, 0.2)
    places = [(0.3 * i - 0.45, 0.4 * j - 0.2, 0.144 + 0.2 * k + 0.1)
              for k in range(5) for j in range(2) for i in range(4)]
    bodies = [FIXED, Body.of_box(deck, 25.0), *[Body.of_box(carton, 12.0)] * 40]
    forces = PatchForces(bodies)
    forces.set_boxes([(fork, 0.12, 0.05)] * 2 + [deck] + [carton] * 40,
                     body=[0, 0, 1, *range(2, 42)],
                     poses=[(0, y, -0.025, 0, 0, 0, 1) for y in (-0.25, 0.25)]
                     + [(0, 0, 0, 0, 0, 0, 1)] * 41)
    layers = [(2 + k, 2 + k + 8) for k in range(1, 33)]
    beside = [(2 + m, 2 + n) for m in range(1, 41) for n in range(m + 1, min(m + 5, 41))
              if np.abs(np.subtract(places[m - 1], places[n - 1])).sum() < 0.41
              and places[m - 1][2] == places[n - 1][2]]
    pairs = [(0, 2), (1, 2), *((2, 3 + k) for k in range(8)), *layers, *beside]
    forces.hold(pairs, friction=[rubs] * 2 + [FRICTION] * (len(pairs) - 2))
    poses = np.zeros((42, 7))
    poses[:, 6], poses[1, 2], poses[2:, :3] = 1.0, 0.072, places
    velocities, outside = np.zeros((2, 42, 6))
    outside[1:, 2] = -GRAVITY * np.array([25.0] + [12.0] * 40)
    fastest, ramp = math.sqrt(share * rubs * GRAVITY * radius), 6.0
    start = None
    for k in range(round((ramp + 2.0) / dt)):
        time = min(max((k + 0.5) * dt - 0.5, 0.0), ramp)
        speed = fastest * math.sin(0.5 * math.pi * time / ramp)**2
        heading = 2.0 * math.atan2(*poses[0, 5:]) + 0.5 * dt * speed / radius
        velocities[0] = 0, 0, 0, 0, 0, speed / radius
        velocities[0, :2] = speed * math.cos(heading), speed * math.sin(heading)
        poses, velocities, *_ = forces.advance(dt, poses, velocities, outside)
        ahead = 2.0 * math.atan2(*poses[0, 5:])
        c, s = math.cos(ahead), math.sin(ahead)
        way = np.array([[c, s], [-s, c]]) @ (poses[1] - poses[0])[:2]
        start = way if start is None else start
    return 1e3 * float(np.hypot(*(way - start)))


@pytest.mark.parametrize('dt', [pytest.param(0.004, marks=pytest.mark.reports), FRAME])
def test_a_pallet_on_forks_holds_in_a_curve(dt: float) -> None:
    assert on_forks(0.98, dt) < 4.0
    assert on_forks(1.02, dt) > 20.0


@pytest.mark.parametrize('dt', [STEP, FRAME])
@pytest.mark.parametrize('fall', [0.0, 0.002])
def test_a_box_that_slides_and_spins(fall: float, dt: float) -> None:
    """Way and turn are within 6 % of Coulomb's law at each point: an ellipse bounds both."""
    world = World(LONG, (PLATE, 1000.0, (0, 0, 0.2 + fall)))
    world.run(0.5, dt)
    world.velocities[1, 0], world.velocities[1, 5] = 3.0, 3.0
    start, turns, last = world.poses[1, 0], 0.0, yaw(world)
    for _ in range(round(1.5 / dt)):
        world.step(dt)
        turns += (yaw(world) - last + 180.0) % 360.0 - 180.0
        last = yaw(world)
    at = (np.arange(20) + 0.5) / 10.0 - 1.0
    x, y = np.meshgrid(at, at)
    speed, spin, way, angle, h = 3.0, 3.0, 0.0, 0.0, 1e-3
    inertia = Body.of_box(PLATE, 1.0).inertia[2]
    while speed > 1e-3 or spin > 1e-3:
        u, v = speed - spin * y, spin * x
        pull = FRICTION * GRAVITY / np.maximum(np.hypot(u, v), 1e-9)
        speed = max(0.0, speed - h * (pull * u).mean())
        spin = max(0.0, spin - h * (pull * (x * v - y * u)).mean() / inertia)
        way, angle = way + h * speed, angle + h * spin
    assert world.poses[1, 0] - start == pytest.approx(way, rel=0.06)
    assert turns == pytest.approx(math.degrees(angle), rel=0.06)

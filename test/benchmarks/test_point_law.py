# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The point law against closed forms."""
from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.point_law import (
    STATIC_PENETRATION,
    PointLaw,
    effective_mass,
)
from box_contact_ros.scene.laws import GRAVITY, Body
from box_contact_ros.solver.contact import Contact

CONTAINER = (12.192, 2.438, 2.591)
MASS = 20_000.0
WEIGHT = MASS * GRAVITY
DOWN = np.array([0.0, 0.0, -1.0])
LEVEL = np.array([1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0])
UNDER = LEVEL[:3] + [0.0, 0.0, -CONTAINER[2] / 2]
STILL = np.zeros(6)


def law_of(mass, size, rate_hz):
    return PointLaw.at_rate(Body.of_box(size, mass), size=size, rate_hz=rate_hz, latency=0.0)


FAST = law_of(MASS, CONTAINER, 1000.0)


def moving(*, linear=(0, 0, 0), angular=(0, 0, 0)):
    return np.array([*linear, *angular], dtype=float)


def wrench_of(law, contacts, pose, velocity):
    law.hold(contacts, pose)
    return law.wrench(pose, velocity)


def touch(point, normal, depth):
    """Return the contact of a model that gives the point alone."""
    return Contact(True, -depth, normal, point, math.nan, np.full((3, 3), math.nan))


def test_static_penetration_carries_the_weight():
    """Depth at rest is F_n/k = m g/k, 5 mm where the rate allows it; no torque under the centre."""
    depth = WEIGHT / FAST.stiffness
    assert depth == pytest.approx(STATIC_PENETRATION, rel=1e-12)
    wrench = wrench_of(FAST, {'': touch(UNDER, DOWN, depth)}, LEVEL, STILL)
    assert wrench == pytest.approx([0, 0, WEIGHT, 0, 0, 0], rel=1e-12, abs=1e-6)


@pytest.mark.parametrize('speed', [-0.1, 0.05, 0.3])
def test_damping_acts_on_the_speed_along_the_normal(speed):
    """Parting at v_n: F_n = max(0, k·depth − c·v_n); never a pull."""
    wrench = wrench_of(FAST, {'': touch(UNDER, DOWN, 1e-3)}, LEVEL, moving(linear=(0, 0, speed)))
    expected = max(0.0, FAST.stiffness * 1e-3 - FAST.damping * speed)
    assert wrench[2] == pytest.approx(expected)
    assert (expected == 0.0) == (speed > 0.04)


def test_a_bounce_never_gains_energy():
    """A heaving load dropped onto the spring and damper comes to rest at m g / k.

    Stepped as finely as to be continuous, its energy m v²/2 + k depth²/2 + m g z never grows.
    """
    step, height, speed = 2e-5, 0.002, -0.3

    def energy() -> float:
        return (MASS * speed**2 + FAST.stiffness * max(0.0, -height)**2) / 2 + WEIGHT * height

    last = first = energy()
    for _ in range(30_000):
        touches = {'': touch(UNDER, DOWN, -height)} if height <= 0.0 else {}
        force = wrench_of(FAST, touches, LEVEL, moving(linear=(0, 0, speed)))[2]
        speed += step * (force / MASS - GRAVITY)
        height += step * speed
        # A symplectic step keeps an oscillator's energy to ω·step: 44 rad/s · 2e-5 s.
        assert energy() < last + 1e-3 * first
        last = energy()
    assert height == pytest.approx(-WEIGHT / FAST.stiffness, rel=1e-3)
    assert abs(speed) < 1e-5


@pytest.mark.parametrize('rate', [100.0, 200.0, 500.0, 1000.0, 2000.0])
@pytest.mark.parametrize('mass, size', [(MASS, CONTAINER), (500.0, (2.0, 2.0, 2.0)),
                                        (4000.0, (6.0, 2.4, 0.5))])
def test_the_rate_limits_the_constants(rate, mass, size):
    """At most nominal, k < 0.25 m_eff/Δt² and c ≤ 0.35 m_eff/Δt, rocking by its own inertia."""
    law, corner = law_of(mass, size, rate), effective_mass(mass, size)
    nominal = mass * GRAVITY / STATIC_PENETRATION
    assert law.stiffness < 0.25 * corner * rate**2
    assert law.damping <= 0.35 * corner * rate * (1 + 1e-12)
    assert law.stiffness <= nominal
    assert law.damping <= (nominal * mass)**0.5 * (1 + 1e-12)
    length, width, height = size
    for damper, extent in zip(law.rocking, (width, length)):
        assert damper <= 0.35 * mass * (extent**2 + height**2) / 12 * rate * (1 + 1e-12)


def test_a_wrench_acts_until_the_next_answer():
    """Wherever the load goes; an answer without contacts ends it."""
    first = wrench_of(FAST, {'': touch(UNDER, DOWN, 1e-3)}, LEVEL, STILL)
    moved, fast = LEVEL + [0, 0, 1, 0, 0, 0, 0], moving(linear=(1, 0, 0))
    assert first[2] > 0.0 and FAST.wrench(moved, fast).tolist() == first.tolist()
    assert not wrench_of(FAST, {}, moved, fast).any()

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The point law against closed forms."""
from __future__ import annotations

import math

import numpy as np
import pytest

from box_contact_ros.evidence.contestants.point_law import (
    STATIC_PENETRATION,
    PointLaw,
    effective_mass,
)
from box_contact_ros.scene.force.laws import GRAVITY
from box_contact_ros.scene.pose import rotation_matrix
from box_contact_ros.solver.contact import Contact

CONTAINER = (12.192, 2.438, 2.591)
MASS = 20_000.0
WEIGHT = MASS * GRAVITY
DOWN = np.array([0.0, 0.0, -1.0])
LEVEL = np.array([1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0])
UNDER = LEVEL[:3] + [0.0, 0.0, -CONTAINER[2] / 2]
STILL = np.zeros(6)
FAST = PointLaw.for_load(MASS, CONTAINER, 1000.0)


def moving(*, linear=(0, 0, 0), angular=(0, 0, 0)):
    return np.array([*linear, *angular], dtype=float)


def touch(point, normal, depth):
    """Return the contact of a model that gives the point alone."""
    return Contact(True, -depth, normal, point, math.nan, np.full((3, 3), math.nan))


def test_no_contact_is_no_wrench():
    assert not FAST.wrench({}, LEVEL, moving(linear=(1, 2, 3), angular=(1, 2, 3))).any()


def test_static_penetration_carries_the_weight():
    """Depth at rest is F_n/k = m g/k, 5 mm where the rate allows it; no torque under the centre."""
    depth = WEIGHT / FAST.stiffness
    assert depth == pytest.approx(STATIC_PENETRATION, rel=1e-12)
    wrench = FAST.wrench({'': touch(UNDER, DOWN, depth)}, LEVEL, STILL)
    assert wrench == pytest.approx([0, 0, WEIGHT, 0, 0, 0], rel=1e-12, abs=1e-6)


def test_the_push_is_against_the_normal_and_turns_about_the_centre():
    """Depth d, normal n from load to stack, at rest: force −n·k·d, torque arm × force."""
    normal = np.array([0.6, 0.0, -0.8])
    point = UNDER + [4.0, -1.0, 0.0]
    wrench = FAST.wrench({'': touch(point, normal, 0.002)}, LEVEL, STILL)
    force = -normal * FAST.stiffness * 0.002
    assert wrench[:3] == pytest.approx(force)
    assert wrench[3:] == pytest.approx(np.cross(point - LEVEL[:3], force))


@pytest.mark.parametrize('speed', [-0.1, 0.05, 0.3])
def test_damping_acts_on_the_speed_along_the_normal(speed):
    """Parting at v_n: F_n = max(0, k·depth − c·v_n); never a pull."""
    wrench = FAST.wrench({'': touch(UNDER, DOWN, 1e-3)}, LEVEL, moving(linear=(0, 0, speed)))
    expected = max(0.0, FAST.stiffness * 1e-3 - FAST.damping * speed)
    assert wrench[2] == pytest.approx(expected)
    assert (expected == 0.0) == (speed > 0.04)


@pytest.mark.parametrize('speed', [0.01, 0.1, 2.0])
@pytest.mark.parametrize('heading', [0.0, 130.0])
def test_friction_opposes_the_slip(speed, heading):
    """Coulomb's μ·F_n above v_s, in proportion to the slip below, against it in either case."""
    along = np.array([math.cos(math.radians(heading)), math.sin(math.radians(heading)), 0.0])
    depth = WEIGHT / FAST.stiffness
    wrench = FAST.wrench({'': touch(UNDER, DOWN, depth)}, LEVEL, moving(linear=speed * along))
    size = 0.5 * WEIGHT * min(1.0, speed / 0.1)
    assert wrench[:3] == pytest.approx(-size * along + [0, 0, WEIGHT], rel=1e-9, abs=1e-6)


def test_the_slip_is_that_of_the_material_point():
    """Rolling at ω with the centre moving along: the point under it stands still, no friction."""
    rate = 0.02
    velocity = moving(linear=(rate * CONTAINER[2] / 2, 0, 0), angular=(0, rate, 0))
    wrench = FAST.wrench({'': touch(UNDER, DOWN, 1e-3)}, LEVEL, velocity)
    assert wrench[0] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize('spin', [0.01, -0.5])
def test_torsion_opposes_the_spin(spin):
    """μ·F_n·r about the normal beyond v_s / r, and r = 3.6 m for a 40-ft container."""
    assert FAST.torsion_radius == pytest.approx(3.6, abs=0.02)
    depth, full = WEIGHT / FAST.stiffness, 0.5 * WEIGHT * FAST.torsion_radius
    wrench = FAST.wrench({'': touch(UNDER, DOWN, depth)}, LEVEL, moving(angular=(0, 0, spin)))
    share = min(1.0, abs(spin) * FAST.torsion_radius / 0.1)
    assert wrench[5] == pytest.approx(-math.copysign(full * share, spin))


def test_rocking_damper_works_in_the_loads_own_axes():
    """Torque −2c(W²/12)ω_roll, −2c(L²/12)ω_pitch, with a load turned by 90° about the vertical.

    The point lies so that nothing else turns it.
    """
    turned = np.array([1.0, 2.0, 3.0, 0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)])
    assert rotation_matrix(turned[3:])[:, 0] == pytest.approx([0, 1, 0])
    at_centre = touch(turned[:3], DOWN, 1e-9)
    wrench = FAST.wrench({'': at_centre}, turned, moving(angular=(0.1, 0.2, 0.0)))
    damping, (length, width, _) = FAST.damping, CONTAINER
    assert wrench[3] == pytest.approx(-2 * damping * length**2 / 12 * 0.1)  # the load's pitch
    assert wrench[4] == pytest.approx(-2 * damping * width**2 / 12 * 0.2)


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
        force = FAST.wrench(touches, LEVEL, moving(linear=(0, 0, speed)))[2]
        speed += step * (force / MASS - GRAVITY)
        height += step * speed
        # A symplectic step keeps an oscillator's energy to ω·step: 44 rad/s · 2e-5 s.
        assert energy() < last + 1e-3 * first
        last = energy()
    assert height == pytest.approx(-WEIGHT / FAST.stiffness, rel=1e-3)
    assert abs(speed) < 1e-5


def test_a_corner_is_the_lightest_place():
    """A push P at a bottom corner accelerates it by P (1/m + x²/I_pitch + y²/I_roll)."""
    assert effective_mass(MASS, CONTAINER) == pytest.approx(0.19 * MASS, rel=5e-3)
    assert effective_mass(8.0, (2.0, 2.0, 2.0)) == pytest.approx(2.0)


@pytest.mark.parametrize('rate', [100.0, 200.0, 500.0, 1000.0, 2000.0])
@pytest.mark.parametrize('mass, size', [(MASS, CONTAINER), (500.0, (2.0, 2.0, 2.0)),
                                        (4000.0, (6.0, 2.4, 0.5))])
def test_the_rate_limits_the_constants(rate, mass, size):
    """At most nominal, k < 0.25 m_eff/Δt² and c ≤ 0.35 m_eff/Δt, rocking by its own inertia."""
    law, corner = PointLaw.for_load(mass, size, rate), effective_mass(mass, size)
    nominal = mass * GRAVITY / STATIC_PENETRATION
    assert law.stiffness < 0.25 * corner * rate**2
    assert law.damping <= 0.35 * corner * rate * (1 + 1e-12)
    assert law.stiffness <= nominal
    assert law.damping <= (nominal * mass)**0.5 * (1 + 1e-12)
    length, width, height = size
    for damper, extent in zip(law.rocking, (width, length)):
        assert damper <= 0.35 * mass * (extent**2 + height**2) / 12 * rate * (1 + 1e-12)


def test_the_constants_for_20_t():
    """The known law: 3.9e7 N/m and 8.9e5 N s/m at 1 kHz, scaled down at 200 Hz.

    It is in proportion to the mass at every rate.
    """
    assert FAST.stiffness == pytest.approx(3.9e7, rel=0.01)
    assert FAST.damping == pytest.approx(8.9e5, rel=0.01)
    slow = PointLaw.for_load(MASS, CONTAINER, 200.0)
    assert slow.stiffness < FAST.stiffness and slow.damping < FAST.damping
    for rate, law in ((200.0, slow), (1000.0, FAST)):
        half = PointLaw.for_load(MASS / 2, CONTAINER, rate)
        assert half.stiffness == pytest.approx(law.stiffness / 2)
        assert half.damping == pytest.approx(law.damping / 2)

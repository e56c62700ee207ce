"""The patch law against closed forms and quadrature."""
from __future__ import annotations

import math

import numpy as np
import pytest

from box_contact_ros.scene import patch_law
from box_contact_ros.scene.contact_law import GRAVITY
from box_contact_ros.scene.patch_law import Patch, PatchLaw

MASS = 20_000.0
WEIGHT = MASS * GRAVITY
DOWN = np.array([0.0, 0.0, -1.0])
LEVEL = np.array([1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0])
STILL = np.zeros(6)
LAW = PatchLaw.for_loop(MASS, 1000.0)


def moving(*, linear=(0, 0, 0), angular=(0, 0, 0)):
    return np.array([*linear, *angular], dtype=float)


def slab(length=12.0, width=2.4, depth=1e-3, centre=(1.0, 2.0, 1.7), normal=DOWN):
    """Return a rectangular patch under the load, of one thickness."""
    covariance = np.diag([length**2, width**2, depth**2]) / 12.0
    return Patch(np.array(centre), np.array(normal), depth, length * width * depth, covariance)


def wedge_columns(length=6.0, width=2.0, low=1e-4, high=5e-3, count=200):
    """Columns (n, 3), areas (n,) and thicknesses (n,) of an overlap that is thicker at one end."""
    x = (np.arange(count) + 0.5) / count - 0.5
    across, along = np.meshgrid(x * width, x * length)
    thickness = low + (high - low) * (along / length + 0.5)
    places = np.stack([along + 2.0, across + 1.0, np.zeros_like(along)], axis=-1).reshape(-1, 3)
    return places, np.full(count**2, length * width / count**2), thickness.ravel()


def patch_of_columns(places, areas, thickness):
    weights = areas * thickness
    centroid = weights @ places / weights.sum()
    arms = places - centroid
    covariance = np.einsum('n,ni,nj->ij', weights, arms, arms) / weights.sum()
    return Patch(centroid, DOWN, float(thickness.max()), float(weights.sum()), covariance)


def test_no_contact_is_no_wrench():
    assert not LAW.wrench(None, LEVEL, moving(linear=(1, 2, 3), angular=(1, 2, 3))).any()


@pytest.mark.parametrize(('length', 'width'), [(12.0, 2.4), (2.0, 2.0), (3.0, 0.8)])
def test_the_static_penetration_does_not_depend_on_the_area(length, width):
    """A level load rests at the depth m g / k, whatever the area of its face."""
    depth = WEIGHT / LAW.stiffness
    wrench = LAW.wrench(slab(length, width, depth), LEVEL, STILL)
    assert wrench == pytest.approx([0, 0, WEIGHT, 0, 0, 0], rel=1e-12, abs=1e-6)


def test_a_small_patch_is_softer():
    """Below the least area the modulus stays: a tenth of that area has a tenth of the force."""
    side = math.sqrt(0.1 * patch_law.LEAST_AREA)
    depth = WEIGHT / LAW.stiffness
    wrench = LAW.wrench(slab(side, side, depth), LEVEL, STILL)
    assert wrench[2] == pytest.approx(0.1 * WEIGHT)


def test_the_push_is_against_the_normal_and_turns_about_the_centre():
    normal = np.array([0.6, 0.0, -0.8])
    frame = np.array([[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], -normal]).T
    patch = slab(centre=(5.0, 1.0, 1.7))
    patch = Patch(patch.point, normal, patch.depth, patch.volume,
                  frame @ patch.covariance @ frame.T)
    wrench = LAW.wrench(patch, LEVEL, STILL)
    force = -normal * LAW.stiffness * 1e-3
    assert wrench[:3] == pytest.approx(force)
    assert wrench[3:] == pytest.approx(np.cross(patch.point - LEVEL[:3], force))


@pytest.mark.parametrize('angular', [(0, 0, 0), (0.002, 0, 0), (0.001, 0.0015, 0)])
def test_the_wrench_is_the_sum_over_the_columns(angular):
    """Volume, centroid and covariance give what the pressures of 40,000 columns sum to."""
    columns = wedge_columns()
    patch, velocity = patch_of_columns(*columns), moving(linear=(0, 0, -0.01), angular=angular)
    places, areas, thickness = columns
    modulus = LAW.stiffness / (12.0 * math.sqrt(patch.covariance[0, 0] * patch.covariance[1, 1]))
    arms = places - LEVEL[:3]
    speeds = (velocity[:3] + np.cross(velocity[3:], arms)) @ DOWN
    pressures = modulus * thickness * (1.0 + LAW.damping * speeds)
    assert np.all(pressures > 0.0)
    forces = -(pressures * areas)[:, None] * DOWN
    frictionless = PatchLaw(stiffness=LAW.stiffness, damping=LAW.damping, friction=0.0)
    wrench = frictionless.wrench(patch, LEVEL, velocity)
    assert wrench[:3] == pytest.approx(forces.sum(axis=0), rel=1e-9, abs=1e-6)
    assert wrench[3:] == pytest.approx(np.cross(arms, forces).sum(axis=0), rel=1e-9, abs=1e-3)


@pytest.mark.parametrize('speed', [-0.1, 0.05, 5.0])
def test_the_foundation_never_pulls(speed):
    """Parting at a speed beyond 1/λ there is no force, and no moment of the damping either."""
    velocity = moving(linear=(0, 0, speed), angular=(0.3, 0.2, 0))
    wrench = LAW.wrench(slab(), LEVEL, velocity)
    expected = max(0.0, LAW.stiffness * 1e-3 * (1.0 - LAW.damping * speed))
    assert wrench[2] == pytest.approx(expected)
    if expected == 0.0:
        assert not wrench.any()


def test_fast_rocking_gives_no_more_moment_than_pressures_can():
    """The centre of pressure stays within the patch, however fast the load rocks."""
    wrench = LAW.wrench(slab(), LEVEL, moving(angular=(0, 3.0, 0)))
    assert abs(wrench[4]) <= 0.5 * 12.0 * wrench[2]


@pytest.mark.parametrize('speed', [0.01, 0.1, 2.0])
@pytest.mark.parametrize('heading', [0.0, 130.0])
def test_friction_opposes_the_slip(speed, heading):
    """Coulomb's μ·P above v_s, in proportion to the slip below, against the slip in either case."""
    along = np.array([math.cos(math.radians(heading)), math.sin(math.radians(heading)), 0.0])
    patch = slab(depth=WEIGHT / LAW.stiffness)
    wrench = LAW.wrench(patch, LEVEL, moving(linear=speed * along))
    size = 0.5 * WEIGHT * min(1.0, speed / 0.1)
    assert wrench[:3] == pytest.approx(-size * along + [0, 0, WEIGHT], rel=1e-9, abs=1e-6)


@pytest.mark.parametrize('spin', [0.01, -0.5])
def test_torsion_opposes_the_spin(spin):
    """μ·P·r about the normal beyond v_s / r, with r the patch's radius of gyration."""
    radius = math.sqrt((12.0**2 + 2.4**2) / 12.0)
    patch = slab(depth=WEIGHT / LAW.stiffness)
    wrench = LAW.wrench(patch, LEVEL, moving(angular=(0, 0, spin)))
    share = min(1.0, abs(spin) * radius / 0.1)
    assert wrench[5] == pytest.approx(-math.copysign(0.5 * WEIGHT * radius * share, spin))


def test_a_bounce_never_gains_energy():
    """A load dropped onto the foundation comes to rest at m g / k.

    Stepped as finely as to be continuous, its energy m v²/2 + k depth²/2 + m g z never grows.
    """
    step, height, speed = 1e-5, 0.002, -0.3

    def energy() -> float:
        return (MASS * speed**2 + LAW.stiffness * max(0.0, -height)**2) / 2 + WEIGHT * height

    last = first = energy()
    for _ in range(60_000):
        patch = slab(depth=-height) if height < 0.0 else None
        force = LAW.wrench(patch, LEVEL, moving(linear=(0, 0, speed)))[2]
        speed += step * (force / MASS - GRAVITY)
        height += step * speed
        # A symplectic step keeps an oscillator's energy to ω·step: 99 rad/s · 1e-5 s.
        assert energy() < last + 1e-3 * first
        last = energy()
    assert height == pytest.approx(-WEIGHT / LAW.stiffness, rel=1e-3)
    assert abs(speed) < 1e-5


@pytest.mark.parametrize('mass', [500.0, MASS])
@pytest.mark.parametrize('rate', [100.0, 200.0, 1000.0])
@pytest.mark.parametrize('latency', [0.0, 0.002, 0.005])
def test_the_constants_follow_mass_rate_and_latency(mass, rate, latency):
    """Stiffness is m g over the least penetration, or what the delay bears; λ m g is critical."""
    law = PatchLaw.for_loop(mass, rate, latency)
    bears = mass * (patch_law.DELAY_LIMIT / (0.5 / rate + latency))**2
    assert law.stiffness == pytest.approx(min(mass * GRAVITY / 1e-3, bears))
    assert law.damping * mass * GRAVITY == pytest.approx(2.0 * math.sqrt(law.stiffness * mass))

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The patch law against closed forms and quadrature."""
from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from box_contact_ros import ContactSolver
from box_contact_ros.scene.force import patch_law
from box_contact_ros.scene.force.held_wrench import GRAVITY
from box_contact_ros.scene.force.patch_law import PatchLaw
from box_contact_ros.scene.pose import rotation_matrix
from box_contact_ros.solver.contact import Contact

MASS = 20_000.0
WEIGHT = MASS * GRAVITY
DOWN = np.array([0.0, 0.0, -1.0])
LEVEL = np.array([1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0])
STILL = np.zeros(6)
SIZE = np.array([12.192, 2.438, 2.591])
INERTIA = MASS / 12.0 * (np.square(SIZE).sum() - np.square(SIZE))
LAW = PatchLaw.for_loop(MASS, INERTIA, 1000.0)
SUNK = GRAVITY / LAW.frequency**2
"""Depth of a load that rests on a whole face [m]."""


def fresh():
    """Return a law that has seen no contact yet."""
    return dataclasses.replace(LAW)


def moving(*, linear=(0, 0, 0), angular=(0, 0, 0)):
    return np.array([*linear, *angular], dtype=float)


def slab(length=12.0, width=2.4, depth=1e-3, centre=(1.0, 2.0, 1.7), normal=DOWN):
    """Return a rectangular patch under the load, of one thickness."""
    covariance = np.diag([length**2, width**2, depth**2]) / 12.0
    return Contact(True, -depth, np.array(normal), np.array(centre), length * width * depth,
                   covariance)


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
    return Contact(True, -float(thickness.max()), DOWN, centroid, float(weights.sum()), covariance)


def test_no_contact_is_no_wrench():
    velocity = moving(linear=(1, 2, 3), angular=(1, 2, 3))
    assert not fresh().wrench([], LEVEL, velocity).any()
    apart = ContactSolver(SIZE, SIZE, model='exact')(LEVEL, LEVEL + [0, 0, 9.0, 0, 0, 0, 0])
    assert not fresh().wrench([apart], LEVEL, velocity).any()


def test_a_contact_of_a_solver_is_taken_as_it_is():
    """A container on its like, `SUNK` deep: its weight, and no torque."""
    solver = ContactSolver(SIZE, SIZE, model='exact')
    contact = solver(LEVEL, LEVEL - [0, 0, SIZE[2] - SUNK, 0, 0, 0, 0])
    wrench = fresh().wrench([contact], LEVEL, STILL)
    assert wrench == pytest.approx([0, 0, WEIGHT, 0, 0, 0], rel=1e-9, abs=1e-3)


@pytest.mark.parametrize('volume, covariance', [(math.nan, math.nan), (1e-3, math.nan),
                                                (math.inf, 1.0)])
def test_a_point_alone_is_refused(volume, covariance):
    """A model that gives no patch must not end in a force of NaN."""
    bare = Contact(True, -1e-3, DOWN, LEVEL[:3], volume, np.full((3, 3), covariance))
    with pytest.raises(ValueError, match='needs volume and covariance'):
        fresh().wrench([slab(), bare], LEVEL, STILL)


@pytest.mark.parametrize(('length', 'width'), [(12.0, 2.4), (2.0, 2.0), (3.0, 0.8), (0.1, 0.1)])
def test_the_static_penetration_does_not_depend_on_the_area(length, width):
    """A level load rests at the depth g / Ω², whatever the area of its face."""
    wrench = fresh().wrench([slab(length, width, SUNK)], LEVEL, STILL)
    assert wrench == pytest.approx([0, 0, WEIGHT, 0, 0, 0], rel=1e-12, abs=1e-6)


def test_a_corner_that_lands_alone_is_softer():
    """It has the mass that a push at the corner feels, 1 / m_eff = 1 / m + x² / I_y + y² / I_x."""
    x, y = 6.0, 1.2
    patch = slab(1e-3, 1e-3, SUNK, centre=(1.0 + x, 2.0 + y, 1.7))
    felt = 1.0 / (1.0 / MASS + x**2 / INERTIA[1] + y**2 / INERTIA[0])
    assert felt < 0.2 * MASS
    assert fresh().wrench([patch], LEVEL, STILL)[2] == pytest.approx(felt * GRAVITY, rel=1e-6)


@pytest.mark.parametrize('turn', [0.0, 0.7])
def test_several_contacts_share_one_modulus(turn):
    """Four feet: the fastest oscillation, here rolling, has the frequency Ω."""
    x, y, side = 6.0, 1.2, 1e-3
    pose = LEVEL.copy()
    pose[5:] = math.sin(turn / 2), math.cos(turn / 2)
    axes = rotation_matrix(pose[3:])
    feet = [slab(side, side, SUNK, centre=pose[:3] + axes @ [sx * x, sy * y, -1.3])
            for sx in (1, -1) for sy in (1, -1)]
    fastest = max(1.0 / MASS, y**2 / INERTIA[0], x**2 / INERTIA[1])
    assert fastest > 2.0 / MASS
    expected = GRAVITY / fastest
    wrench = fresh().wrench(feet, pose, STILL)
    assert wrench == pytest.approx([0, 0, expected, 0, 0, 0], rel=1e-5, abs=1e-3)


@pytest.mark.parametrize('depth', [0.0, 1e-12])
def test_an_edge_that_only_just_touches_gives_a_finite_force(depth):
    """Rounding spoils the area of a patch 12 m long and a nanometre wide."""
    turn = rotation_matrix(np.array([0, 0, math.sin(0.2), math.cos(0.2)]))
    covariance = turn @ np.diag([144.0, 1e-18, 1e-20]) @ turn.T
    needle = Contact(True, -depth, DOWN, np.array([1.0, 2.0, 1.7]), 12e-9 * depth, covariance)
    force = fresh().wrench([needle], LEVEL, STILL)[2]
    assert 0.0 <= force <= WEIGHT * depth / SUNK


def test_the_push_is_against_the_normal_and_turns_about_the_centre():
    normal = np.array([0.6, 0.0, -0.8])
    frame = np.array([[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], -normal]).T
    patch = slab(1e-3, 1e-3, centre=(5.0, 1.0, 1.7))
    patch = patch._replace(normal=normal, covariance=frame @ patch.covariance @ frame.T)
    wrench = fresh().wrench([patch], LEVEL, STILL)
    lever = np.cross(patch.point - LEVEL[:3], normal)
    felt = 1.0 / (1.0 / MASS + (np.square(lever) / INERTIA).sum())
    force = -normal * LAW.frequency**2 * felt * 1e-3
    assert wrench[:3] == pytest.approx(force, rel=1e-5)
    assert wrench[3:] == pytest.approx(np.cross(patch.point - LEVEL[:3], force), rel=1e-5)


@pytest.mark.parametrize('angular', [(0, 0, 0), (0.002, 0, 0), (0.001, 0.0015, 0)])
def test_the_wrench_is_the_sum_over_the_columns(angular):
    """Volume, centroid and covariance give what the pressures of 40,000 columns sum to."""
    columns = wedge_columns()
    patch, velocity = patch_of_columns(*columns), moving(linear=(0, 0, -0.01), angular=angular)
    places, areas, thickness = columns
    flat = patch.covariance * [[1, 1, 0], [1, 1, 0], [0, 0, 0]]
    area = 12.0 * math.sqrt(patch.covariance[0, 0] * patch.covariance[1, 1])
    fastest = LAW.fastest([patch], [flat], [area], LEVEL)
    modulus, damping = LAW.frequency**2 / fastest, LAW.damping * area / (MASS * fastest)
    damping *= min(1.0, WEIGHT / (modulus * patch.volume))
    arms = places - LEVEL[:3]
    speeds = (velocity[:3] + np.cross(velocity[3:], arms)) @ DOWN
    pressures = modulus * thickness * (1.0 + damping * speeds)
    assert np.all(pressures > 0.0)
    forces = -(pressures * areas)[:, None] * DOWN
    frictionless = dataclasses.replace(LAW, friction=0.0)
    wrench = frictionless.wrench([patch], LEVEL, velocity)
    assert wrench[:3] == pytest.approx(forces.sum(axis=0), rel=1e-9, abs=1e-6)
    assert wrench[3:] == pytest.approx(np.cross(arms, forces).sum(axis=0), rel=1e-9, abs=1e-3)


@pytest.mark.parametrize('speed', [-0.1, 0.05, 5.0])
def test_the_foundation_never_pulls(speed):
    """Parting at a speed beyond 1/λ there is no force, and no moment of the damping either."""
    velocity = moving(linear=(0, 0, speed), angular=(0.3, 0.2, 0))
    wrench = fresh().wrench([slab()], LEVEL, velocity)
    damping = LAW.damping * min(1.0, SUNK / 1e-3)
    expected = max(0.0, WEIGHT * 1e-3 / SUNK * (1.0 - damping * speed))
    assert wrench[2] == pytest.approx(expected)
    if expected == 0.0:
        assert not wrench.any()


@pytest.mark.parametrize('times', [1.0, 2.0, 10.0])
def test_beyond_the_weight_the_damper_is_the_one_at_rest(times):
    """A load that is pressed in by more than its weight meets 2·ζ·Ω·m, which the loop bears."""
    patch, speed = slab(depth=times * SUNK), 0.2
    still, closing = (fresh().wrench([patch], LEVEL, velocity)[2]
                      for velocity in (STILL, moving(linear=(0, 0, -speed))))
    damper = 2.0 * patch_law.DAMPING_RATIO * LAW.frequency * MASS
    assert closing - still == pytest.approx(damper * speed, rel=1e-6)


def test_fast_rocking_gives_no_more_moment_than_pressures_can():
    """The centre of pressure stays within the patch, however fast the load rocks."""
    wrench = fresh().wrench([slab()], LEVEL, moving(angular=(0, 3.0, 0)))
    assert abs(wrench[4]) <= 0.5 * 12.0 * wrench[2]


@pytest.mark.parametrize('speed', [0.01, 0.1, 2.0])
@pytest.mark.parametrize('heading', [0.0, 130.0])
def test_friction_opposes_the_slip(speed, heading):
    """Coulomb's μ·P above v_s, in proportion to the slip below, against the slip in either case."""
    along = np.array([math.cos(math.radians(heading)), math.sin(math.radians(heading)), 0.0])
    patch = slab(depth=SUNK)
    wrench = fresh().wrench([patch], LEVEL, moving(linear=speed * along))
    size = 0.5 * WEIGHT * min(1.0, speed / 0.1)
    assert wrench[:3] == pytest.approx(-size * along + [0, 0, WEIGHT], rel=1e-9, abs=1e-6)


@pytest.mark.parametrize('spin', [0.01, -0.5])
def test_torsion_opposes_the_spin(spin):
    """μ·P·r about the normal beyond v_s / r, with r the patch's radius of gyration."""
    radius = math.sqrt((12.0**2 + 2.4**2) / 12.0)
    patch = slab(depth=SUNK)
    wrench = fresh().wrench([patch], LEVEL, moving(angular=(0, 0, spin)))
    share = min(1.0, abs(spin) * radius / 0.1)
    assert wrench[5] == pytest.approx(-math.copysign(0.5 * WEIGHT * radius * share, spin))


def test_a_bounce_never_gains_energy():
    """A load dropped onto the foundation comes to rest at g / Ω².

    Stepped as finely as to be continuous, its energy m (v² + Ω² depth²) / 2 + m g z never grows.
    """
    step, height, speed = 2e-5, 0.002, -0.3

    def energy() -> float:
        return MASS * (speed**2 + (LAW.frequency * max(0.0, -height))**2) / 2 + WEIGHT * height

    last = first = energy()
    for _ in range(20_000):
        patches = [slab(depth=-height)] if height < 0.0 else []
        force = fresh().wrench(patches, LEVEL, moving(linear=(0, 0, speed)))[2]
        speed += step * (force / MASS - GRAVITY)
        height += step * speed
        # A symplectic step keeps an oscillator's energy to ω·step: 140 rad/s · 2e-5 s.
        assert energy() < last + 1e-3 * first
        last = energy()
    assert height == pytest.approx(-SUNK, rel=1e-3)
    assert abs(speed) < 1e-5


@pytest.mark.parametrize('rate', [100.0, 200.0, 1000.0])
@pytest.mark.parametrize('latency', [0.0, 0.002, 0.005])
def test_the_constants_follow_rate_and_latency(rate, latency):
    """Ω is √(g / least penetration), or what the delay bears; λ is critical damping by a share."""
    law = PatchLaw.for_loop(MASS, INERTIA, rate, latency)
    bears = patch_law.DELAY_LIMIT / (0.5 / rate + latency)
    assert law.frequency == pytest.approx(min(math.sqrt(GRAVITY / 5e-4), bears))
    assert law.damping * GRAVITY == pytest.approx(2.0 * patch_law.DAMPING_RATIO * law.frequency)


def test_the_modulus_falls_at_once_and_rises_slowly():
    """A patch that halves keeps κ at first; κ doubles with the time constant, nearly to the end.

    Without contact κ is forgotten.
    """
    law = PatchLaw.for_loop(MASS, INERTIA, 200.0)

    def modulus(patch):
        return law.wrench([patch], LEVEL, STILL)[2] / patch.volume

    whole, half = slab(4.0, 2.0), slab(2.0, 2.0)
    small = modulus(whole)
    assert modulus(half) == pytest.approx(small, rel=0.01)
    for _ in range(200):
        at_1_s = modulus(half)
    assert at_1_s / small == pytest.approx(2.0 * 0.98 - 0.96 * math.exp(-1.0), rel=0.01)
    for _ in range(3000):
        modulus(half)
    assert modulus(half) / small == pytest.approx(2.0 * 0.98, rel=1e-6)
    assert modulus(whole) == pytest.approx(small)
    law.wrench([], LEVEL, STILL)
    assert modulus(half) == pytest.approx(2.0 * small)


@pytest.mark.parametrize('scale', [1e-3, 0.1, 10.0])
def test_no_constant_knows_the_size(scale):
    """A load and a patch `scale` times as long, of the same density, at the same depth.

    Forces grow as the mass, torques as the mass times the length.
    """
    columns = wedge_columns()
    patch = patch_of_columns(*columns)
    larger = PatchLaw.for_loop(scale**3 * MASS, scale**5 * INERTIA, 1000.0)
    pose = np.concatenate([scale * LEVEL[:3], LEVEL[3:]])
    grown = patch._replace(point=scale * patch.point, volume=scale**2 * patch.volume,
                           covariance=patch.covariance * scale**2)
    small, large = fresh().wrench([patch], LEVEL, STILL), larger.wrench([grown], pose, STILL)
    assert large[:3] == pytest.approx(scale**3 * small[:3], rel=1e-9)
    assert large[3:] == pytest.approx(scale**4 * small[3:], rel=1e-9, abs=1e-9)

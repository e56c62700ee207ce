# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The laws of force against closed forms, sums over columns, and laws that any such law keeps."""
from __future__ import annotations

import copy
import math
import re
from pathlib import Path

import numpy as np
import pytest

from box_contact_ros import (
    Body,
    ContactSolver,
    HeldPatch,
    SceneLaw,
    SceneSolver,
)
from box_contact_ros.scene.laws import GRAVITY
from box_contact_ros.scene.pose import quaternion_multiply, rotation_matrix
from box_contact_ros.scene.scene_solver import Box, Pair, Scene
from box_contact_ros.solver.contact import Contact

PAGE = Path(__file__).resolve().parents[2] / 'docs' / 'explanation' / 'force.md'
MASS = 20_000.0
WEIGHT = MASS * GRAVITY
DOWN = np.array([0.0, 0.0, -1.0])
LEVEL = np.array([1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0])
STILL = np.zeros(6)
SIZE = np.array([12.192, 2.438, 2.591])
LOAD = Body.of_box(SIZE, MASS)
INERTIA = np.array(LOAD.inertia)
RATE, STEP = 200.0, 0.001
OMEGA = HeldPatch.at_rate(LOAD, rate_hz=RATE).frequency
SUNK = GRAVITY / OMEGA**2
"""Depth of a load that rests on a whole face [m]."""
WHOLE_DAMPER = 0.02 * SUNK


def fresh(*, friction=0.5, **loop) -> HeldPatch:
    return HeldPatch.at_rate(LOAD, rate_hz=RATE, friction=friction, **loop)


def wrench_of(contacts, pose=LEVEL, velocity=STILL, *, law=None, friction=0.5):
    """Return what a law that has seen nothing before makes of contacts."""
    law = law or fresh(friction=friction)
    law.hold(contacts, pose)
    return law.wrench(pose, velocity)


def moving(*, linear=(0, 0, 0), angular=(0, 0, 0)):
    return np.array([*linear, *angular], dtype=float)


def moved(pose, way=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0)):
    """Return a pose after a way [m] and a turn [rad] about its own centre."""
    angle = np.linalg.norm(turn)
    half = (np.sin(angle / 2) / angle if angle else 0.5) * np.array(turn)
    turned = quaternion_multiply([*half, np.cos(angle / 2)], pose[3:])
    return np.concatenate([pose[:3] + way, turned])


def slab(length=12.0, width=2.4, depth=SUNK, centre=(1.0, 2.0, 1.7), normal=DOWN):
    """Return a rectangular patch under the load, of one thickness."""
    covariance = np.diag([length**2, width**2, depth**2]) / 12.0
    return Contact(True, -depth, np.array(normal), np.array(centre), length * width * depth,
                   covariance)


def columns_of(length=6.0, width=2.0, low=2e-6, high=6e-5, count=200):
    """Columns (n, 3), areas (n,) and thicknesses (n,) of an overlap that is thicker at one end."""
    x = (np.arange(count) + 0.5) / count - 0.5
    across, along = np.meshgrid(x * width, x * length)
    thickness = low + (high - low) * (along / length + 0.5)
    places = np.stack([along + 2.0, across + 1.0, np.full_like(along, 1.7)], axis=-1)
    return places.reshape(-1, 3), np.full(count**2, length * width / count**2), thickness.ravel()


def patch_of_columns(places, areas, thickness):
    weights = areas * thickness
    centroid = weights @ places / weights.sum()
    arms = places - centroid
    covariance = np.einsum('n,ni,nj->ij', weights, arms, arms) / weights.sum()
    return Contact(True, -float(thickness.max()), DOWN, centroid, float(weights.sum()), covariance)


# --- The foundation -------------------------------------------------------------------------------


def test_no_contact_is_no_wrench():
    velocity = moving(linear=(1, 2, 3), angular=(1, 2, 3))
    assert not fresh().wrench(LEVEL, velocity).any()
    assert not wrench_of({}, velocity=velocity).any()
    apart = ContactSolver(SIZE, SIZE, model='exact')(LEVEL, LEVEL + [0, 0, -9.0, 0, 0, 0, 0])
    assert not wrench_of(apart, velocity=velocity).any()


@pytest.mark.parametrize(('model', 'lever'), [('exact', 1e-9), ('mlp', 1e-6)])
def test_a_contact_of_a_solver_is_taken_as_it_is(model, lever):
    """A container on its like, `SUNK` deep: its weight, and no torque but for the lever [m]."""
    solver = ContactSolver(SIZE, SIZE, model=model)
    contact = solver(LEVEL, LEVEL - [0, 0, SIZE[2] - SUNK, 0, 0, 0, 0])
    assert wrench_of(contact) == pytest.approx([0, 0, WEIGHT, 0, 0, 0], rel=1e-6,
                                               abs=lever * WEIGHT)


@pytest.mark.parametrize(('length', 'width'), [(12.0, 2.4), (2.0, 2.0), (3.0, 0.8), (0.1, 0.1)])
def test_the_static_depth_does_not_depend_on_the_area(length, width):
    """A level load rests at the depth g / Ω², whatever the area of its face."""
    assert wrench_of(slab(length, width)) == pytest.approx([0, 0, WEIGHT, 0, 0, 0], rel=1e-9,
                                                           abs=1e-6)


def test_a_corner_that_lands_alone_is_softer():
    """It has the mass that a push at the corner feels, 1 / m_eff = 1 / m + x² / I_y + y² / I_x."""
    x, y = 6.0, 1.2
    patch = slab(1e-3, 1e-3, centre=(1.0 + x, 2.0 + y, 1.7))
    felt = 1.0 / (1.0 / MASS + x**2 / INERTIA[1] + y**2 / INERTIA[0])
    assert felt < 0.2 * MASS
    assert wrench_of(patch)[2] == pytest.approx(felt * GRAVITY, rel=1e-6)


@pytest.mark.parametrize('turn', [0.0, 0.7])
def test_several_contacts_share_one_modulus(turn):
    """Four feet: the fastest oscillation, here rolling, has the frequency Ω."""
    x, y, side = 6.0, 1.2, 1e-3
    pose = moved(LEVEL, turn=(0, 0, turn))
    axes = rotation_matrix(pose[3:])
    feet = {f'{sx} {sy}': slab(side, side, centre=pose[:3] + axes @ [sx * x, sy * y, -1.3])
            for sx in (1, -1) for sy in (1, -1)}
    fastest = max(1.0 / MASS, y**2 / INERTIA[0], x**2 / INERTIA[1])
    assert fastest > 2.0 / MASS
    expected = [0, 0, GRAVITY / fastest, 0, 0, 0]
    assert wrench_of(feet, pose) == pytest.approx(expected, rel=1e-5, abs=1e-3)


@pytest.mark.parametrize('depth', [1e-12, 1e-300])
def test_an_edge_that_only_just_touches_gives_a_finite_force(depth):
    """Rounding spoils the area of a patch 12 m long and a nanometre wide."""
    turn = rotation_matrix(np.array([0, 0, math.sin(0.2), math.cos(0.2)]))
    covariance = turn @ np.diag([144.0, 1e-18, 1e-20]) @ turn.T
    needle = Contact(True, -depth, DOWN, np.array([1.0, 2.0, 1.7]), 12e-9 * depth, covariance)
    assert 0.0 <= wrench_of(needle)[2] <= WEIGHT * depth / SUNK


@pytest.mark.parametrize('angular', [(0, 0, 0), (2e-5, 0, 0), (2e-6, 3e-6, 0)])
def test_the_wrench_is_the_sum_over_the_columns(angular):
    """Volume, centroid and covariance give what the pressures of 40,000 columns sum to."""
    places, areas, thickness = columns_of()
    patch = patch_of_columns(places, areas, thickness)
    velocity = moving(linear=(0, 0, -1e-4), angular=angular)
    arms = places - LEVEL[:3]
    speeds = (velocity[:3] + np.cross(velocity[3:], arms)) @ DOWN
    still = wrench_of(patch, friction=0.0)
    modulus = still[2] / patch.volume
    area = 12.0 * math.sqrt(patch.covariance[0, 0] * patch.covariance[1, 1])
    damping = 2.0 * 1.2 / (OMEGA * patch.volume / area)
    pressures = modulus * thickness * (1.0 + damping * speeds)
    assert np.all(pressures > 0.0)
    forces = -(pressures * areas)[:, None] * DOWN
    wrench = wrench_of(patch, velocity=velocity, friction=0.0)
    assert wrench[:3] == pytest.approx(forces.sum(axis=0), rel=1e-9, abs=1e-6)
    assert wrench[3:] == pytest.approx(np.cross(arms, forces).sum(axis=0), rel=1e-9, abs=1e-3)


@pytest.mark.parametrize('depth', [0.5 * WHOLE_DAMPER, 2.0 * WHOLE_DAMPER, SUNK, 5.0 * SUNK])
def test_the_damper_is_whole_from_a_shallow_depth_on(depth):
    """B = 2·ζ·Ω·m, whatever the load that the contact carries; below that depth in proportion."""
    speed = 1e-6
    still, closing = (wrench_of(slab(depth=depth), velocity=velocity)[2]
                      for velocity in (STILL, moving(linear=(0, 0, -speed))))
    damper = 2.0 * 1.2 * OMEGA * MASS * min(1.0, depth / WHOLE_DAMPER)
    assert closing - still == pytest.approx(damper * speed, rel=1e-4)


@pytest.mark.parametrize('speed', [-1e-3, 5e-4, 5.0])
def test_the_foundation_never_pulls(speed):
    """Parting fast there is no force, and no moment of the damping either."""
    velocity = moving(linear=(0, 0, speed), angular=(0.3, 0.2, 0))
    wrench = wrench_of(slab(), velocity=velocity)
    expected = max(0.0, WEIGHT * (1.0 - 2.4 * speed / (OMEGA * SUNK)))
    assert wrench[2] == pytest.approx(expected, rel=1e-9)
    if expected == 0.0:
        assert not wrench.any()


@pytest.mark.parametrize('speed', [0.3, 3.0])
def test_the_impulse_is_no_more_than_stops_the_load(speed):
    """A force that acts for a step takes the speed away, and gives back 0.7·√(2·g·depth)."""
    depth = 0.5 * SUNK
    force = wrench_of(slab(depth=depth), velocity=moving(linear=(0, 0, -speed)))[2]
    back = 0.7 * math.sqrt(2.0 * GRAVITY * depth)
    assert force == pytest.approx(MASS * ((speed + back) / STEP + GRAVITY), rel=1e-9)


def test_fast_rocking_gives_no_more_moment_than_pressures_can():
    """The centre of pressure stays within the patch, however fast the load rocks or tilts."""
    fast = wrench_of(slab(), velocity=moving(angular=(0, 3.0, 0)))
    assert abs(fast[4]) <= 0.5 * 12.0 * fast[2]
    law = fresh()
    law.hold(slab(), LEVEL)
    tilted = law.wrench(moved(LEVEL, turn=(0, 0.01, 0)), STILL)
    assert abs(tilted[4]) <= 0.5 * 12.0 * tilted[2]


def test_a_bounce_never_gains_energy():
    """A load that is dropped onto the foundation comes to rest at g / Ω².

    Stepped as finely as to be continuous, its energy m (v² + Ω² depth²) / 2 + m g z never grows.
    """
    step, height, speed = 2e-6, 2e-4, -0.03

    def energy() -> float:
        return MASS * (speed**2 + (OMEGA * max(0.0, -height))**2) / 2 + WEIGHT * height

    last = first = energy()
    law = fresh(step=STEP)
    for _ in range(20_000):
        law.hold(slab(depth=-height) if height < 0.0 else {}, LEVEL)
        force = law.wrench(LEVEL, moving(linear=(0, 0, speed)))[2]
        speed += step * (force / MASS - GRAVITY)
        height += step * speed
        # A symplectic step keeps an oscillator's energy to Ω·step.
        assert energy() < last + 1e-3 * first
        last = energy()
    assert height == pytest.approx(-SUNK, rel=1e-3)
    assert abs(speed) < 1e-5


# --- The patch that is held -----------------------------------------------------------------------


@pytest.mark.parametrize(('way', 'turn'), [
    ((0, 0, -2e-5), (0, 0, 0)), ((0, 0, 1e-5), (0, 0, 0)), ((1e-4, -2e-4, 0), (0, 0, 0)),
    ((0, 0, 0), (3e-6, 0, 0)), ((0, 0, 0), (0, 1e-6, 0)), ((1e-5, 0, -1e-5), (1e-6, -1e-6, 1e-6))])
def test_a_held_patch_is_the_contact_of_the_new_pose(way, turn):
    """The load moves by some micrometres: the old patch gives the wrench of a new question.

    Wrenches are divided by κ, which a new question finds anew. What resists the turn of late has
    been forgotten after a second.
    """
    solver = ContactSolver(SIZE, SIZE, model='exact')
    stack = LEVEL - [0, 0, SIZE[2] - SUNK, 0, 0, 0, 0]
    pose = moved(LEVEL, way, turn)
    held, asked = fresh(friction=0.0), fresh(friction=0.0)
    old, new = solver(LEVEL, stack), solver(pose, stack)
    modulus = wrench_of(old, law=held)[2] / old.volume
    for _ in range(1000):
        one = held.wrench(pose, STILL) / modulus
    other = wrench_of(new, pose, law=asked)
    other /= other[2] / new.volume
    assert one[2] == pytest.approx(other[2], rel=1e-3)
    assert one[3:] == pytest.approx(other[3:], rel=2e-2, abs=1e-3 * old.volume)


def test_a_patch_goes_with_what_carries_it():
    """A kinematic box, and a load on it, move on together: the wrench is what it was."""
    scene = Scene({'load': Box('load', tuple(SIZE), pose_topic='load'),
                   'truck': Box('truck', tuple(SIZE), pose_topic='truck')},
                  (Pair('p', 'load', 'truck'),))
    law = SceneLaw.at_rate(scene, {'load': MASS}, rate_hz=RATE)
    poses = np.array([LEVEL, LEVEL - [0.5, 0, SIZE[2] - SUNK, 0, 0, 0, 0]])
    velocity = moving(linear=(7.0, 1.0, 0.0))
    law.hold(SceneSolver(scene, model='exact')(poses), poses)
    first = law.wrenches(poses, [velocity, velocity])
    assert first[0][2] > 0.9 * WEIGHT
    for k in range(1, 4):
        later = poses + k * STEP * np.append(velocity[:3], np.zeros(4))
        # Coordinates of 3 m are rounded to 4e-16 m, and springs have 4e9 N/m.
        assert law.wrenches(later, [velocity, velocity]) == pytest.approx(first, rel=1e-9, abs=1e-2)


def test_the_turn_of_late_is_resisted_and_forgotten():
    """A small turn meets 1 + ρ of the elastic moment, ρ = (0.8 / (Ω·step))² − 1 and at most 10.

    It decays with 50 ms to the elastic moment alone.
    """
    law, turn = fresh(friction=0.0), (0, 1e-8, 0)
    law.hold(slab(), LEVEL)
    law.wrench(LEVEL, STILL)
    moments = [law.wrench(moved(LEVEL, turn=turn), STILL)[4] for _ in range(1000)]
    rho = min(10.0, (0.8 / (OMEGA * STEP))**2 - 1.0)
    assert rho > 1.0
    assert moments[0] / moments[-1] == pytest.approx(1.0 + rho, rel=1e-3)
    assert moments[50] / moments[-1] == pytest.approx(1.0 + rho * (1.0 - STEP / 0.05)**50, rel=1e-3)


@pytest.mark.parametrize('latency', [0.0, 0.005, 0.02])
def test_dampers_are_as_large_as_the_step_allows(latency):
    """B = 2·ζ·Ω·m with ζ = 1.2·min(4, 0.45 / (Ω·step)): slow modes of stacks decay by ζ·ω²/Ω."""
    law = fresh(latency=latency)
    sunk = GRAVITY / law.frequency**2
    speed = 1e-7
    law.hold(slab(depth=sunk), LEVEL)
    still, closing = (law.wrench(LEVEL, velocity)[2]
                      for velocity in (STILL, moving(linear=(0, 0, -speed))))
    larger = min(4.0, 0.45 / (law.frequency * STEP))
    assert (closing - still) / speed == pytest.approx(2.0 * 1.2 * larger * law.frequency * MASS,
                                                      rel=1e-4)


def test_the_modulus_falls_at_once_and_rises_slowly():
    """A patch that halves keeps κ at first; κ doubles with the time constant, nearly to the end.

    Without contact κ is forgotten.
    """
    law = fresh()

    def modulus(patch):
        return wrench_of(patch, law=law)[2] / patch.volume

    whole, half = slab(4.0, 2.0), slab(2.0, 2.0)
    small = modulus(whole)
    assert modulus(half) == pytest.approx(small, rel=0.01)
    for _ in range(200):
        at_1_s = modulus(half)
    assert at_1_s / small == pytest.approx(2.0 * 0.98 - 0.96 * math.exp(-2.0), rel=0.01)
    for _ in range(3000):
        modulus(half)
    assert modulus(half) / small == pytest.approx(2.0 * 0.98, rel=1e-6)
    assert modulus(whole) == pytest.approx(small)
    law.hold({}, LEVEL)
    assert modulus(half) == pytest.approx(2.0 * small)


@pytest.mark.parametrize('scale', [1e-3, 0.1, 10.0])
def test_no_constant_knows_the_size(scale):
    """A load and a patch `scale` times as long, of the same density, at the same depth.

    Forces grow as the mass, torques as the mass times the length.
    """
    patch = patch_of_columns(*columns_of())
    body = Body(mass=scale**3 * MASS, inertia=scale**5 * INERTIA)
    grown = patch._replace(point=scale * patch.point, volume=scale**2 * patch.volume,
                           covariance=scale**2 * patch.covariance)
    pose = np.concatenate([scale * LEVEL[:3], LEVEL[3:]])
    small = wrench_of(patch)
    large = wrench_of(grown, pose, law=HeldPatch.at_rate(body, rate_hz=RATE))
    assert large[:3] == pytest.approx(scale**3 * small[:3], rel=1e-9)
    assert large[3:] == pytest.approx(scale**4 * small[3:], rel=1e-9, abs=1e-9)


# --- Friction -------------------------------------------------------------------------------------


def spring() -> float:
    """Return k_t [N/m] of the whole face: slides at √(share)·Ω where nothing turns it."""
    law = fresh()
    law.hold(slab(centre=LEVEL[:3] + [0, 0, -1e-9]), LEVEL)
    law.wrench(LEVEL, STILL)
    return -law.wrench(moved(LEVEL, (1e-9, 0, 0)), STILL)[0] / 1e-9


def test_friction_holds_by_a_spring_and_gives_way_at_its_limit():
    """The way is remembered: pushed out, held there, and back to nothing."""
    law, stiffness = fresh(), spring()
    patch = slab(centre=LEVEL[:3] + [0, 0, -1e-9])
    law.hold(patch, LEVEL)
    law.wrench(LEVEL, STILL)
    limit = 0.5 * WEIGHT
    ways = np.array([0.3, 0.9, 1.5, 1.5, 1.0, -0.4]) * limit / stiffness
    anchor, expected = 0.0, []
    for before, way in zip([0.0, *ways[:-1]], ways):
        anchor = float(np.clip(anchor + way - before, -limit / stiffness, limit / stiffness))
        expected.append(-stiffness * anchor)
    found = [law.wrench(moved(LEVEL, (way, 0, 0)), STILL)[0] for way in ways]
    assert found == pytest.approx(expected, rel=1e-6)
    assert min(found) == pytest.approx(-limit)


@pytest.mark.parametrize('heading', [0.0, 130.0])
def test_sliding_meets_coulombs_force(heading):
    along = np.array([math.cos(math.radians(heading)), math.sin(math.radians(heading)), 0.0])
    wrench = wrench_of(slab(), velocity=moving(linear=2.0 * along))
    assert wrench[:3] == pytest.approx(-0.5 * WEIGHT * along + [0, 0, WEIGHT], rel=1e-9, abs=1e-6)


@pytest.mark.parametrize(('length', 'width'), [(12.0, 2.4), (2.0, 2.0), (4.0, 2.0), (9.0, 0.01)])
def test_torsion_is_coulombs_sum_over_the_face(length, width):
    """μ·P times the mean distance from the centre, to 1 %."""
    wrench = wrench_of(slab(length, width), velocity=moving(angular=(0, 0, 1.0)))
    x, y = np.meshgrid(*((np.arange(400) + 0.5) / 400 - 0.5,) * 2)
    mean = np.hypot(x * length, y * width).mean()
    assert wrench[5] == pytest.approx(-0.5 * WEIGHT * mean, rel=0.01)


@pytest.mark.parametrize('seed', range(5))
def test_slip_and_spin_share_one_limit(seed):
    """f² + (m/r)² + a·f²·(m/r)² = 1, by μ·P, for any fast slip with any spin."""
    random = np.random.default_rng(seed)
    velocity = moving(linear=[*random.uniform(-1, 1, 2), 0], angular=[0, 0, random.uniform(-1, 1)])
    patch = slab(centre=(1.0, 2.0, 1.7))
    wrench = wrench_of(patch, velocity=velocity)
    radius = -wrench_of(patch, velocity=moving(angular=(0, 0, 1.0)))[5] / (0.5 * WEIGHT)
    force, torsion = (np.square([math.hypot(*wrench[:2]), wrench[5] / radius])
                      / (0.5 * WEIGHT)**2)
    squareness = 2.0 * 12.0 * 2.4 / (12.0**2 + 2.4**2)
    dent = 0.45 * squareness**2
    assert force + torsion + dent * force * torsion == pytest.approx(1.0, rel=1e-9)
    assert wrench[:2] @ velocity[:2] < 0.0 and wrench[5] * velocity[5] < 0.0


def test_friction_knows_a_pair_by_its_name():
    """Contacts in another order, one more or one less: the others hold on to their anchors."""
    left, right = slab(1.0, 1.0, centre=(0.0, 2.0, 1.7)), slab(1.0, 1.0, centre=(2.0, 2.0, 1.7))
    law, other = fresh(), fresh()
    for each in (law, other):
        each.hold({'left': left, 'right': right}, LEVEL)
        each.wrench(LEVEL, STILL)
    pose = moved(LEVEL, (1e-7, 0, 0), (0, 0, 3e-8))
    for each in (law, other):
        expected = each.wrench(pose, STILL)
    assert expected[0] < 0.0 and expected[1] != 0.0
    for contacts in ({'right': right, 'left': left}, {'left': left, 'right': right}):
        other.hold(contacts, LEVEL)
        assert np.array_equal(other.wrench(pose, STILL), expected)
    law.hold({'right': right}, LEVEL)
    alone = law.wrench(pose, STILL)
    assert alone[0] == pytest.approx(0.5 * expected[0], rel=0.1)
    law.hold({'left': left, 'right': right}, LEVEL)  # left begins anew
    assert law.wrench(pose, STILL)[0] == pytest.approx(0.5 * expected[0], rel=0.1)


def test_a_stiffer_spring_gains_no_energy():
    """Where κ rises, the anchor shortens in proportion: the force stays, at most."""
    law = fresh()
    pose = moved(LEVEL, (1e-7, 0, 0))
    wrench_of(slab(4.0, 2.0), law=law)
    law.hold(slab(2.0, 2.0), pose)
    before = law.wrench(pose, STILL)[0]
    for _ in range(50):
        law.hold(slab(2.0, 2.0), pose)
        after = law.wrench(pose, STILL)[0]
        assert before < 0.0 and abs(after) <= abs(before) * (1.0 + 1e-12)


# --- Two bodies -----------------------------------------------------------------------------------


def two_free(mass_b=10_000.0):
    """Return the scene of a load on a free box, the law, and poses with the load `SUNK` deep."""
    scene = Scene({'a': Box('a', tuple(SIZE), pose_topic='a'),
                   'b': Box('b', (8.0, 2.0, 2.0), pose_topic='b')}, (Pair('ab', 'a', 'b'),))
    law = SceneLaw.at_rate(scene, {'a': MASS, 'b': mass_b}, rate_hz=RATE)
    b = moved(LEVEL - [0.3, 0.1, 0.5 * SIZE[2] + 1.0 - SUNK, 0, 0, 0, 0], turn=(1e-6, 2e-6, 0.3))
    return scene, law, np.array([LEVEL, b])


def test_what_acts_on_one_acts_back_on_the_other():
    """Forces, and torques about the origin, sum to nothing at any poses and motions."""
    scene, law, poses = two_free()
    law.hold(SceneSolver(scene, model='exact')(poses), poses)
    random = np.random.default_rng(3)
    for _ in range(5):
        velocities = 1e-3 * random.standard_normal((2, 6))
        now = np.array([moved(pose, 1e-6 * random.standard_normal(3),
                              1e-7 * random.standard_normal(3)) for pose in poses])
        on_a, on_b = law.wrenches(now, velocities)
        assert on_a[2] > 0.1 * WEIGHT
        assert on_a[:3] == pytest.approx(-on_b[:3], rel=1e-12)
        about = [wrench[3:] + np.cross(pose[:3], wrench[:3])
                 for wrench, pose in zip((on_a, on_b), now)]
        assert about[0] == pytest.approx(-about[1], rel=1e-9, abs=1e-6)


def test_two_free_bodies_take_half_the_modulus_of_the_lighter():
    """κ = Ω² / w by the softer sum, and each patch counts twice: no mode is faster than Ω."""
    scene = Scene({name: Box(name, (2.0, 2.0, 2.0), pose_topic=name) for name in 'ab'},
                  (Pair('ab', 'a', 'b'),))
    law = SceneLaw.at_rate(scene, {'a': MASS, 'b': 0.1 * MASS}, rate_hz=RATE)
    poses = np.array([LEVEL, LEVEL - [0, 0, 2.0 - SUNK, 0, 0, 0, 0]])
    law.hold(SceneSolver(scene, model='exact')(poses), poses)
    force = law.wrenches(poses, np.zeros((2, 6)))[0][2]
    assert force == pytest.approx(0.5 * 0.1 * MASS * OMEGA**2 * SUNK, rel=1e-6)
    reduced = 1.0 / (1.0 / MASS + 10.0 / MASS)
    assert force / SUNK / reduced < OMEGA**2


def test_either_box_may_be_the_load():
    """The pair the other way round, and load='b': the same wrench, bit for bit, over some steps."""
    solver = ContactSolver(SIZE, SIZE, model='exact')
    stack = LEVEL - [0.2, 0.1, SIZE[2] - SUNK, 0, 0, 0, 0]
    as_a, as_b = fresh(), fresh()
    random = np.random.default_rng(1)
    pose = LEVEL
    for _ in range(10):
        contact = solver(pose, stack)
        as_a.hold(contact, pose)
        as_b.hold(contact._replace(normal=-contact.normal), pose, load='b')
        pose = moved(pose, 1e-7 * random.standard_normal(3), 1e-8 * random.standard_normal(3))
        velocity = 1e-4 * random.standard_normal(6)
        assert np.array_equal(as_a.wrench(pose, velocity), as_b.wrench(pose, velocity))


# --- Forms ----------------------------------------------------------------------------------------


def test_a_copy_goes_its_own_way_and_reset_forgets():
    law = fresh()
    law.hold(slab(), LEVEL)
    law.wrench(LEVEL, STILL)
    other, pose = law.copy(), moved(LEVEL, (1e-6, 0, 0))
    assert np.array_equal(law.wrench(pose, STILL), other.wrench(pose, STILL))
    law.wrench(LEVEL, STILL)
    assert other.wrench(pose, STILL)[0] < 0.0
    law.reset()
    assert not law.wrench(pose, STILL).any()
    assert other.wrench(pose, STILL).any()
    assert np.array_equal(wrench_of(slab(), law=law), wrench_of(slab()))


@pytest.mark.parametrize('copied', [copy.copy, copy.deepcopy])
def test_every_copy_goes_its_own_way(copied):
    law = fresh()
    law.hold(slab(), LEVEL)
    copied(law).reset()
    assert law.wrench(LEVEL, STILL).any()


@pytest.mark.parametrize('load', ['A', None, 0])
def test_a_load_that_is_neither_box_is_refused(load):
    with pytest.raises(ValueError, match="load must be 'a' or 'b', not"):
        fresh().hold(slab(), LEVEL, load=load)


def test_an_answer_of_another_scene_is_refused():
    """A box that the law does not know counted as fixed, and held the others up."""
    known = {'ground': Box('ground', (9, 9, 1), (0, 0, -0.5, 0, 0, 0, 1)), 'b': Box('b', (1, 1, 1))}
    law = SceneLaw.at_rate(Scene(known, (Pair.between('b', 'ground'),)), {'b': 1.0}, rate_hz=100.0)
    more = Scene(known | {'new': Box('new', (1, 1, 1))}, (Pair.between('new', 'b'),))
    where = np.array([[0, 0, 0.5, 0, 0, 0, 1], [0, 0, 1.499, 0, 0, 0, 1.0]])
    with pytest.raises(ValueError, match="Pair.*'new_b'.* is no pair of the scene of this law"):
        law.hold(SceneSolver(more, model='exact')(where), where[:1])


def test_a_stale_pair_keeps_its_patch():
    """One pose in twenty missed: a box on a slope slid 9.6 mm in 3 s."""
    ground = Box('ground', (9, 9, 1), (0, 0, -0.5, 0, 0, 0, 1))
    pair = Pair.between('load', 'ground')
    scene = Scene({'ground': ground, 'load': Box('load', (1, 1, 1))}, (pair,))
    law = SceneLaw.at_rate(scene, {'load': 1.0}, rate_hz=200.0)
    where = np.array([[0, 0, 0.4999, 0, 0, 0, 1]])
    law.hold(SceneSolver(scene, model='exact')(where), where)
    law.wrenches(where, np.zeros((1, 6)))
    shifted = where + [1e-6, 0, 0, 0, 0, 0, 0]
    expected = law.copy().wrenches(shifted, np.zeros((1, 6)))
    assert expected[0, 0] < 0.0 < expected[0, 2]
    solver = SceneSolver(scene, model='exact')
    law.hold(solver([None]), where)
    assert np.array_equal(law.wrenches(shifted, np.zeros((1, 6))), expected)
    law.hold(solver(where + [0, 0, 1, 0, 0, 0, 0]), where)
    assert not law.wrenches(shifted, np.zeros((1, 6))).any()


@pytest.mark.parametrize('absent', [None, np.full(7, np.nan)])
def test_a_box_without_a_pose_is_named(absent):
    """A scene's solver takes such a box; a law cannot."""
    boxes = {name: Box(name, (1.0, 1.0, 1.0)) for name in ('left', 'right')}
    scene = Scene(boxes, (Pair.between('left', 'right'),))
    law = SceneLaw.at_rate(scene, {'left': 1.0}, rate_hz=100.0)
    where = [np.array(LEVEL, dtype=float), absent]
    with pytest.raises(ValueError, match="^'right' has no pose, and a law needs one for each of"):
        law.wrenches(where, np.zeros((2, 6)))
    with pytest.raises(ValueError, match="^'right' has no pose"):
        law.hold(SceneSolver(scene, model='exact')(where), where)


@pytest.mark.parametrize('rate', [50.0, 200.0, 1000.0])
@pytest.mark.parametrize('latency', [0.0, 0.002, 0.005])
def test_the_constants_follow_the_loop(rate, latency):
    """Ω is the least of what the delay and the step allow."""
    late = 0.5 / rate + latency
    loop = {'rate_hz': rate, 'latency': latency}
    assert HeldPatch.at_rate(LOAD, **loop, step=0.0005).frequency == pytest.approx(
        min(2.0 / late, 0.45 / 0.0005))


def test_the_page_says_what_the_code_does():
    """The table of rates, latencies and depths in docs/explanation/force.md."""
    rows = re.findall(r'^\| (\d+) \| (\d) \| (\d+) \| ([\d.]+) \|$', PAGE.read_text(),
                      re.MULTILINE)
    assert len(rows) >= 6
    for rate, latency, omega, depth in rows:
        law = HeldPatch.at_rate(LOAD, rate_hz=float(rate), latency=1e-3 * float(latency),
                                step=0.0005)
        digits = len(depth.partition('.')[2])
        assert f'{law.frequency:.0f}' == omega
        assert f'{1e3 * GRAVITY / law.frequency**2:.{digits}f}' == depth


# --- Refusals -------------------------------------------------------------------------------------


@pytest.mark.parametrize('volume, covariance', [(math.nan, math.nan), (1e-3, math.nan),
                                                (math.inf, 1.0), (-1.0, 1.0)])
def test_a_point_alone_is_refused(volume, covariance):
    """A model that gives no patch must not end in a force of NaN; what was held stays."""
    bare = slab()._replace(volume=volume, covariance=np.full((3, 3), covariance))
    law = fresh()
    law.hold({'one': slab()}, LEVEL)
    with pytest.raises(ValueError, match='needs volume and covariance'):
        law.hold({'one': slab(), 'two': bare}, LEVEL)
    assert law.wrench(LEVEL, STILL)[2] == pytest.approx(WEIGHT)


def test_a_normal_that_cannot_be_meant_is_refused():
    """The stack given as box A would pull the load down with its own weight."""
    solver = ContactSolver(SIZE, SIZE, model='exact')
    stack = LEVEL - [0, 0, SIZE[2] - SUNK, 0, 0, 0, 0]
    with pytest.raises(ValueError, match="points into body 0, which is box A: .* .load='b' "):
        fresh().hold(solver(stack, LEVEL), LEVEL)
    with pytest.raises(ValueError, match="points out of body 0, which is box B: .* .load='a' "):
        fresh().hold(solver(LEVEL, stack), LEVEL, load='b')
    law = fresh()
    law.hold(solver(stack, LEVEL), LEVEL, load='b')
    assert law.wrench(LEVEL, STILL)[2] == pytest.approx(WEIGHT)


@pytest.mark.parametrize('depth', [1e-9, 1e-3, 0.1, 0.9])
@pytest.mark.parametrize('seed', range(4))
def test_a_right_order_is_never_refused(depth, seed):
    """Any contact of two boxes, as deep as to a part of the smaller one's half width."""
    random = np.random.default_rng(seed)
    solver = ContactSolver(SIZE, (2.0, 2.0, 2.0), model='exact')
    seen = 0
    while seen < 20:
        quaternions = random.standard_normal((2, 4))
        direction = random.standard_normal(3)
        a = np.concatenate([LEVEL[:3], quaternions[0]])
        b = np.concatenate([LEVEL[:3] + 12.0 * direction / np.linalg.norm(direction),
                            quaternions[1]])
        low, high = 0.0, 1.0  # B on its way to A
        for _ in range(60):
            middle = 0.5 * (low + high)
            at = np.concatenate([a[:3] + middle * (b[:3] - a[:3]), b[3:]])
            deep = solver(a, at).separation < -depth
            low, high = (middle, high) if deep else (low, middle)
        contact = solver(a, np.concatenate([a[:3] + low * (b[:3] - a[:3]), b[3:]]))
        if not contact.colliding:
            continue
        fresh().hold(contact, a)
        seen += 1


@pytest.mark.parametrize(('change', 'words'), [
    ({'rate_hz': 0.0}, 'rate must be positive, not 0'),
    ({'latency': -1.0}, 'latency must be 0 or more, not -1'),
    ({'latency': math.nan}, 'latency must be 0 or more, not nan'),
    ({'step': 0.0}, 'step must be positive, not 0'), ({'friction': -0.1}, 'friction must be 0'),
    ({'gravity': math.inf}, 'gravity must be 0 or more, not inf')])
def test_a_loop_that_is_none_is_refused(change, words):
    with pytest.raises(ValueError, match=words):
        HeldPatch.at_rate(LOAD, **{'rate_hz': 200.0} | change)


@pytest.mark.parametrize(('change', 'words'), [
    ({'mass': -1.0}, 'mass of body 0 must be positive, or 0, not -1'),
    ({'inertia': (1.0, 0.0, 1.0)}, 'inertia of body 0 must be positive, not 0'),
    ({'centre': (math.nan, 0.0, 0.0)}, 'centre of body 0 is not finite')])
def test_a_body_that_is_none_is_refused(change, words):
    body = Body(**{'mass': MASS, 'inertia': INERTIA} | change)
    with pytest.raises(ValueError, match=words):
        HeldPatch.at_rate(body, rate_hz=RATE)


def test_wrong_calls_are_refused():
    law = fresh()
    with pytest.raises(ValueError, match='by the names of their pairs, not a list'):
        law.hold([slab()], LEVEL)
    with pytest.raises(ValueError, match='quaternion'):
        law.hold(slab(), np.zeros(7))
    with pytest.raises(ValueError, match='poses must have 1 x 7 numbers, not 6'):
        law.hold(slab(), LEVEL[:6])
    with pytest.raises(ValueError, match='velocity of body 0 is not finite'):
        law.wrench(LEVEL, np.full(6, math.nan))
    masked = np.ma.masked_array(LEVEL, mask=[0, 0, 1, 0, 0, 0, 0])
    with pytest.raises(ValueError, match='pose must be numbers without a mask'):
        law.wrench(masked, STILL)
    with pytest.raises(ValueError, match='poses must be numbers without a mask'):
        law.hold(slab(), masked)
    scene, _, _ = two_free()
    with pytest.raises(ValueError, match="bodies: 'c' is none of the boxes that move"):
        SceneLaw.at_rate(scene, {'c': 1.0}, rate_hz=RATE)

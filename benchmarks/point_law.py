# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""From a contact's point and depth to a wrench: a spring and a damper at the point, a baseline.

It is what a simulator does with an engine that gives one point. The load's footprint has to be
known, for the dampers that stand for the patch. `PatchForces` needs none of that.

Box A is the load. Box B is the stack, which does not move. The normal n points from A to B, so the
stack pushes the load along −n. With the velocity v of the load's material point at the contact
point and v_n = −v·n, positive while the boxes part:

    1. Normal force   F_n = max(0, k·depth − c·v_n)              −n·F_n at the point
    2. Friction       μ·F_n against the slip v + v_n·n           proportional to it below v_s
    3. Torsion        μ·F_n·r about n against the spin ω·n       proportional to it below v_s / r
    4. Rocking        −2c·(W²/12)·ω_roll, −2c·(L²/12)·ω_pitch    in the load's own axes

Lines 1 and 2 act at the ONE point, so the point has to be the middle of the contact region. The
others are what a patch does and a point cannot, and act only while the boxes touch. Rocking is the
damping c spread evenly over an upright load's bottom, twice: c·∫x²dA / A = c·L²/12.
For the measurements behind each constant, see docs/contributing/decisions/patch-law.md.

Conventions: those of `pose`; SI units. A wrench (6,) is a force [N], then a torque about the load's
centre of mass [N m]. A velocity (6,) is linear [m/s], then angular [rad/s]. Both are in the common
frame.
"""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Self

import numpy as np

from box_contact_ros.scene.laws import FRICTION, GRAVITY, Body
from box_contact_ros.solver.contact import Contact
from box_contact_ros.solver.pose import cross, rotation_matrix

STATIC_PENETRATION = 5e-3
"""Depth at which k carries the weight [m]: k = m·g / 5 mm, 3.9e7 N/m for 20 t; 0.2 % of a
container's height. Touching down at 0.3 m/s adds as much again."""

SLIP_SPEED = 0.1
"""v_s [m/s]: friction grows in proportion to the slip up to here, or its sign would switch at rest.
The price: a load at rest on a slope s creeps at v_s·s/μ."""

DAMPING_RATIO = 0.5
"""c = 2·0.5·√(k·m), 8.9e5 N s/m for 20 t: half of critical for the heaving load."""

STIFFNESS_LIMIT = 0.125
"""k ≤ 0.125·m_eff/Δt² [1]. A wrench that is held over Δt acts Δt/2 late on average. That feeds the
energy k·Δt/2·v² a second into every oscillation, and latency feeds more; c has to take it out.
The price is a static penetration of 10 mm at 200 Hz."""

DAMPING_LIMIT = 0.35
"""Every damper ≤ 0.35·inertia/Δt [1]: c by m_eff, the rocking dampers by I_roll and I_pitch. A held
damper takes this share of the speed away per tick; the rest of the 1 is for latency."""


def effective_mass(mass: float, size: Sequence[float]) -> float:
    """Mass [kg] that a vertical push at a bottom corner of a box of full extents `size` [m] feels.

    1 / m_eff = 1 / m + (L/2)² / I_pitch + (W/2)² / I_roll, I = m (extent² + H²) / 12: 0.19 m for a
    40-ft container, m / 4 for a cube. What is stable at the corner, the lightest place, is stable
    everywhere.
    """
    length, width, height = size
    pitch = 3.0 * length**2 / (length**2 + height**2)
    roll = 3.0 * width**2 / (width**2 + height**2)
    return mass / (1.0 + pitch + roll)


class PointLaw:
    """The law of one load, whose mass is in its middle; made by `at_rate`.

    It is asked as `LoadForces` is, but the wrench of an answer acts until the next answer.
    """

    def __init__(self, *, stiffness: float, damping: float, torsion_radius: float,
                 rocking: tuple[float, float]) -> None:
        """Take k [N/m], c [N s/m], r [m], and the dampers on roll and on pitch [N m s]."""
        self.stiffness, self.damping = stiffness, damping
        self.torsion_radius, self.rocking = torsion_radius, rocking
        self._answer: Mapping[str, Contact] | None = None  # whose wrench is not computed yet
        self._wrench = np.zeros(6)

    @classmethod
    def at_rate(cls, load: Body, *, size: Sequence[float], rate_hz: float, **_: float) -> Self:
        """Return the law of a load of full extents `size` [m] that asks `rate_hz` times a second.

        The constants grow with the mass and shrink where the rate demands it. For 40 ft, 20 t,
        200 Hz they are k = 1.9e7 N/m, c = 2.7e5 N s/m. The torsion radius is the footprint's radius
        of gyration, 3.6 m for a 40 ft container.
        """
        (length, width, height), mass = size, load.mass
        corner = effective_mass(mass, size)
        stiffness = mass * GRAVITY / STATIC_PENETRATION
        damping = 2.0 * DAMPING_RATIO * (stiffness * mass)**0.5
        # (damper's spread², inertia's radius²) about the load's x and y; see the module's 4.
        axes = ((width**2, width**2 + height**2), (length**2, length**2 + height**2))
        roll, pitch = (min(2.0 * damping * spread / 12.0,
                           DAMPING_LIMIT * mass * radius / 12.0 * rate_hz)
                       for spread, radius in axes)
        return cls(stiffness=min(stiffness, STIFFNESS_LIMIT * corner * rate_hz**2),
                   damping=min(damping, DAMPING_LIMIT * corner * rate_hz),
                   torsion_radius=((length**2 + width**2) / 12.0)**0.5, rocking=(roll, pitch))

    def hold(self, contacts: Mapping[str, Contact], pose: np.ndarray, *, age: float = 0.0) -> None:
        """Take the contacts of an answer."""
        self._answer = contacts

    def wrench(self, pose: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return force and torque (6,), of the pose (7,) and velocity (6,) at the last answer.

        The law is made for one contact; the wrenches of several add up.
        """
        if self._answer is not None:
            touches = [contact for contact in self._answer.values() if contact.colliding]
            self._wrench = np.sum([np.zeros(6), *(self._of(touch, pose, velocity)
                                                  for touch in touches)], axis=0)
            self._answer = None
        return self._wrench

    def _of(self, touch: Contact, pose: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return the wrench (6,) of one contact."""
        normal, linear, angular = touch.normal, velocity[:3], velocity[3:]
        arm = touch.point - pose[:3]
        at_point = linear + cross(angular, arm)
        closing = float(at_point @ normal)  # −v_n
        depth = max(0.0, -touch.separation)
        push = max(0.0, self.stiffness * depth + self.damping * closing)

        slip = at_point - closing * normal
        grip = FRICTION * push
        force = -push * normal - grip / max(float(slip @ slip)**0.5, SLIP_SPEED) * slip

        spin = float(angular @ normal)
        rim = self.torsion_radius * spin  # speed at the radius that stands for the patch
        torsion = -grip * self.torsion_radius * rim / max(abs(rim), SLIP_SPEED)

        axes = rotation_matrix(pose[3:])
        rocking = (self.rocking[0] * float(axes[:, 0] @ angular) * axes[:, 0]
                   + self.rocking[1] * float(axes[:, 1] @ angular) * axes[:, 1])
        return np.concatenate([force, cross(arm, force) + torsion * normal - rocking])

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""From contacts to a wrench: an elastic foundation over the whole patch.

A contact query says where two boxes touch, in which direction they push, and how they overlap.
Forces are the simulator's business. Box A is the load. Box B is the stack, which does not move. The
normal n points from A to B, so the stack pushes the load along −n.

The foundation has the pressure p = κ·d·(1 + λ·v) at each place of the patch. d is the thickness of
the overlap along n, and v the closing speed there. Volume V, centroid c and covariance C of the
overlap give the resultant exactly, without a loop over the patch:

    1. Pressure   P = κ·V·(1 + λ·v_c)                 −n·P at c
    2. Rocking    L = −κ·V·λ·(C_t u) × n, u = n × ω   damping by the speed's slope over the patch
    3. Friction   μ·P against the slip at c           proportional to the slip below v_s
    4. Torsion    μ·P·r about n against the spin ω·n  proportional to the slip r·ω·n below v_s

v_c is the closing speed at c, ω the load's angular velocity, C_t the covariance in the tangent
plane, and r = √tr C_t. The foundation never pulls: P ≥ 0, and L is at most what pressures p ≥ 0 can
give. The damping is that of Hunt and Crossley (1975): it vanishes with the overlap.

The modulus κ follows the patch: κ = Ω² / w, w the largest eigenvalue of M⁻¹K. K is the stiffness of
a foundation of modulus 1 on the patch's area A = 12·√(e₁·e₂), by the eigenvalues of C_t. M is the
load's inertia. So no oscillation of the load on the patch is faster than Ω, and a held wrench is
stable. A whole face rests at the depth g / Ω², whatever its area. A corner that lands alone is
softer, as the load resists less there, and λ is less in the same measure, A / (m·w). Several
contacts share one modulus. Within a contact κ falls at once and rises slowly (`RISE_TIME`): a law
keeps its last κ, so it serves one load, tick by tick.

No constant knows the size of the load. A wrench is computed from contacts and from the state of the
load at the time they were asked for, and is then held (`held_wrench.HeldWrench`).
docs/explanation/force.md derives all of this.

Conventions: those of `pose`; SI units. A wrench is (6,): force [N], then torque about the load's
centre of mass [N m], both in the common frame. So is a velocity (6,): linear [m/s], then angular
[rad/s].
"""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ...solver.contact import Contact
from ..pose import cross, rotation_matrix
from .held_wrench import FRICTION, GRAVITY, SLIP_SPEED

LEAST_PENETRATION = 5e-4
"""Least depth at which the foundation carries the weight [m]: Ω² ≤ g / 0.5 mm. A stiffer one stops
a load of 0.3 m/s within a tick or two, and the damping, proportional to the force, overshoots."""

DELAY_LIMIT = 0.45
"""Ω·T ≤ 0.45 [1], with T the latency and half the period: a held wrench is that late on average.
Lateness feeds energy into each oscillation, and the damping takes out more up to a limit, which
docs/decisions/patch-law.md measures."""

DAMPING_RATIO = 1.2
"""λ = 2·1.2·Ω / g: of the critical damping of the heaving load at its static penetration. A load
that overhangs until its patch lifts off on one side rocks with a small part of that."""

RISE_TIME = 1.0
"""κ falls at once to what the loop bears, which takes energy away, and rises with this time
constant [s]. A κ that rose at once with the patch would feed energy into rocking."""
STEADY_SHARE = 0.98
"""Share of what the loop bears up to which κ rises [1]: at rest it is a constant. The price is a
static penetration 2 % deeper."""

LEAST_ASPECT = 1e-7
"""Width of a patch by its length, at least [1]: e₁·e₂ is a difference of products, which rounding
spoils by 1e-16 of e₁². So much area keeps κ finite where an edge only just touches."""


@dataclass(kw_only=True)
class PatchLaw:
    """The law's constants; make them with `for_loop`.

    mass        m of the load [kg]
    inertia     its principal moments (3,) about the axes of its own frame [kg m²]
    frequency   Ω [1/s]
    damping     λ [s/m]
    friction    μ [1]
    slip_speed  v_s [m/s]
    rise        share of what κ lacks that it gains per answer [1]
    """

    mass: float
    inertia: np.ndarray
    frequency: float
    damping: float
    friction: float = FRICTION
    slip_speed: float = SLIP_SPEED
    rise: float = 1.0
    _modulus: float = field(default=math.inf, init=False, repr=False, compare=False)

    @classmethod
    def for_loop(cls, mass: float, inertia: Sequence[float] | np.ndarray, rate_hz: float,
                 latency: float = 0.0) -> PatchLaw:
        """Return constants for a load in a loop of that rate [1/s] and latency [s].

        Ω = min(√(g / LEAST_PENETRATION), DELAY_LIMIT / T) with T = 1 / (2·rate) + latency, and
        λ = 2·DAMPING_RATIO·Ω / g.
        """
        delay = 0.5 / rate_hz + latency
        frequency = min(math.sqrt(GRAVITY / LEAST_PENETRATION), DELAY_LIMIT / delay)
        return cls(mass=mass, inertia=np.array(inertia, dtype=float), frequency=frequency,
                   damping=2.0 * DAMPING_RATIO * frequency / GRAVITY,
                   rise=min(1.0, 1.0 / (RISE_TIME * rate_hz)))

    def wrench(self, overlaps: Sequence[Contact], pose: np.ndarray, velocity: np.ndarray,
               ) -> np.ndarray:
        """Return force and torque (6,) on the load of contacts that act at the same time.

        pose, velocity: of the load's centre of mass, (7,) and (6,). Contacts without volume do
        nothing. ValueError: a contact whose model gives the point alone.
        """
        touching = [overlap for overlap in overlaps if _has_volume(overlap)]
        if not touching:
            self._modulus = math.inf
            return np.zeros(6)
        covariances = [_tangential(overlap) for overlap in touching]
        areas = [_area(covariance) for covariance in covariances]
        softness = 1.0 / self.fastest(touching, covariances, areas, pose)
        borne = self.frequency**2 * softness
        lacking = max(0.0, STEADY_SHARE * borne - self._modulus)
        modulus = self._modulus = min(self._modulus + self.rise * lacking, borne)
        damping = self.damping * sum(areas) * softness / self.mass
        # Beyond the weight the damper stays the one at rest: a stiffer one throws the load back.
        elastic = modulus * sum(overlap.volume for overlap in touching)
        damping *= min(1.0, self.mass * GRAVITY / elastic)
        return np.sum([self._of(overlap, covariance, modulus * overlap.volume, damping, pose,
                                velocity)
                       for overlap, covariance in zip(touching, covariances)], axis=0)

    def fastest(self, overlaps: Sequence[Contact], covariances: Sequence[np.ndarray],
                areas: Sequence[float], pose: np.ndarray) -> float:
        """Return the largest eigenvalue of M⁻¹K: ω² of the fastest oscillation, on a modulus of 1.

        covariances, areas: C_t (3, 3) and A of each contact. Motions are scaled so that M is 1: per
        √m along the load's axes, and per √I about them.
        """
        axes = rotation_matrix(pose[3:])
        linear, angular = 1.0 / math.sqrt(self.mass), axes.T / np.sqrt(self.inertia)[:, None]
        stiffness = np.zeros((6, 6))  # of the scaled load on a foundation of modulus 1
        for overlap, covariance, area in zip(overlaps, covariances, areas):
            normal = overlap.normal
            push = np.concatenate([linear * normal,
                                   angular @ cross(overlap.point - pose[:3], normal)])
            x, y, z = normal.tolist()
            turn = angular @ [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
            stiffness += area * (push[:, None] * push)
            stiffness[3:, 3:] += area * (turn @ covariance @ turn.T)
        return float(np.linalg.eigvalsh(stiffness)[-1])

    def _of(self, overlap: Contact, covariance: np.ndarray, elastic: float, damping: float,
            pose: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return the wrench (6,) of one contact with the force `elastic` = κ·V at rest."""
        normal, linear, angular = overlap.normal, velocity[:3], velocity[3:]
        arm = overlap.point - pose[:3]
        at_centroid = linear + cross(angular, arm)
        closing = float(at_centroid @ normal)
        share = 1.0 + damping * closing  # of the elastic pressure at the centroid
        if share <= 0.0:
            return np.zeros(6)
        push = elastic * share
        slip = at_centroid - closing * normal
        grip = self.friction * push
        force = -push * normal - grip / max(math.sqrt(slip @ slip), self.slip_speed) * slip

        radius = math.sqrt(max(0.0, float(np.trace(covariance))))
        rim = radius * float(angular @ normal)  # slip at the radius of gyration
        torsion = -grip * radius * rim / max(abs(rim), self.slip_speed) * normal
        rocking = elastic * _rocking(damping * cross(normal, angular), normal, covariance, share)
        return np.concatenate([force, cross(arm, force) + torsion + rocking])


def _rocking(slope: np.ndarray, normal: np.ndarray, covariance: np.ndarray,
             share: float) -> np.ndarray:
    """Return the damping's moment (3,) about the centroid [m], by the elastic force κ·V.

    λ·v changes over the patch by `slope`·x, x from the centroid. Where that would exceed `share` at
    the patch's rim, √3 standard deviations away, pressures would be negative: it is cut to that.
    """
    spread = covariance @ slope
    at_rim = math.sqrt(3.0 * max(0.0, float(slope @ spread)))
    return -cross(spread, normal) * min(1.0, share / at_rim if at_rim > 0.0 else 1.0)


def _has_volume(overlap: Contact) -> bool:
    """Return whether there is a contact; ValueError for one that has no patch."""
    # Without contact a solver's covariance is NaN and its volume 0.
    if overlap.volume == 0.0:
        return False
    if not (math.isfinite(overlap.volume) and np.isfinite(overlap.covariance).all()):
        raise ValueError(f'the contact has no patch (volume {overlap.volume}): its model gives the '
                         'point alone, and the law needs volume and covariance')
    return True


def _tangential(overlap: Contact) -> np.ndarray:
    """Return the covariance (3, 3) within the tangent plane."""
    tangent = np.eye(3) - overlap.normal[:, None] * overlap.normal
    covariance: np.ndarray = tangent @ overlap.covariance @ tangent
    return covariance


def _area(covariance: np.ndarray) -> float:
    """Return 12·√(e₁·e₂) [m²] of a covariance (3, 3) that is flat in one direction.

    e₁·e₂ is the sum of its three principal minors of two rows. See `LEAST_ASPECT`.
    """
    c = covariance
    product = (c[0, 0] * c[1, 1] - c[0, 1] * c[1, 0] + c[1, 1] * c[2, 2] - c[1, 2] * c[2, 1]
               + c[2, 2] * c[0, 0] - c[2, 0] * c[0, 2])
    return 12.0 * max(math.sqrt(max(0.0, float(product))), LEAST_ASPECT * float(np.trace(c)))

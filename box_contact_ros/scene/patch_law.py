"""From one contact to a wrench: an elastic foundation over the whole patch.

A contact query says where two boxes touch, in which direction they push, and how they overlap.
Forces are the simulator's business. Box A is the load. Box B is the stack, which does not move. The
normal n points from A to B, so the stack pushes the load along −n.

The foundation has the pressure p = κ·d·(1 + λ·v) at each place of the patch. d is the thickness of
the overlap along n, and v the closing speed there. Volume V, centroid c and covariance C of the
overlap give the resultant exactly, without a loop over the patch:

    1. Pressure   P = κ·V·(1 + λ·v_c)                 −n·P at c
    2. Rocking    M = −κ·V·λ·(C_t g) × n, g = n × ω   damping by the speed's slope over the patch
    3. Friction   μ·P against the slip at c           proportional to the slip below v_s
    4. Torsion    μ·P·r about n against the spin ω·n  proportional to the slip r·ω·n below v_s

v_c is the closing speed at c, ω the load's angular velocity, C_t the covariance in the tangent
plane, and r = √tr C_t. The foundation never pulls: P ≥ 0, and M is at most what pressures p ≥ 0 can
give. The damping is that of Hunt and Crossley (1975): it vanishes with the overlap.

The modulus κ = k / A follows the patch's own area A = 12·√(λ₁λ₂), by the eigenvalues of C_t. A is
exact for a rectangle. So V / A is the mean depth, k a total stiffness, and an edge that lands first
does not sink deeper than a whole face. Below `LEAST_AREA` the modulus stays as it is.

No constant knows the size of the load. A wrench is computed from a contact and from the state of
the load at the time the contact was asked for, and is then held (`contact_law.HeldWrench`).

Conventions: those of `pose`; SI units. A wrench is (6,): force [N], then torque about the load's
centre of mass [N m], both in the common frame. So is a velocity (6,): linear [m/s], then angular
[rad/s].
"""
from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from .contact_law import FRICTION, GRAVITY, SLIP_SPEED, Touch
from .pose import cross

__all__ = ['Patch', 'PatchLaw']

LEAST_PENETRATION = 1e-3
"""Least depth at which the foundation carries the weight [m]: k ≤ m·g / 1 mm."""

DELAY_LIMIT = 0.35
"""√(k/m)·T ≤ 0.35 [1], with T the latency and half the period: a held wrench is that late on
average. Lateness feeds energy into each oscillation, and the damping takes out more up to a limit.
Of 12 landings each at 200 Hz with 2 and 5 ms and at 1 kHz with 5 ms, all settle with 0.40. With
0.45, two to seven diverge. 0.35 leaves a fifth."""

DAMPING_RATIO = 1.0
"""λ·m·g = 2·1·√(k·m): the critical damping of the heaving load at its static penetration."""

LEAST_AREA = 2.0
"""Area [m²] below which the modulus grows no further. A corner that lands alone would otherwise
have the whole stiffness k at the load's end, where a fifth of the mass resists."""


@dataclass(frozen=True)
class Patch(Touch):
    """One contact with its patch: volume [m³] and covariance (3, 3) [m²] of the overlap.

    The point is the centroid, in the common frame.
    """

    volume: float
    covariance: np.ndarray


@dataclass(frozen=True, kw_only=True)
class PatchLaw:
    """The law's constants; make them with `for_loop`.

    stiffness   k [N/m] of the whole patch
    damping     λ [s/m]
    friction    μ [1]
    slip_speed  v_s [m/s]
    """

    stiffness: float
    damping: float
    friction: float = FRICTION
    slip_speed: float = SLIP_SPEED

    @classmethod
    def for_loop(cls, mass: float, rate_hz: float, latency: float = 0.0) -> PatchLaw:
        """Return constants for a load of `mass` [kg] in a loop of that rate [1/s] and latency [s].

        k = m·min(g / LEAST_PENETRATION, (DELAY_LIMIT / T)²) with T = 1 / (2·rate) + latency, and
        λ = 2·DAMPING_RATIO·√(k·m) / (m·g).
        """
        delay = 0.5 / rate_hz + latency
        stiffness = mass * min(GRAVITY / LEAST_PENETRATION, (DELAY_LIMIT / delay)**2)
        damping = 2.0 * DAMPING_RATIO * math.sqrt(stiffness * mass) / (mass * GRAVITY)
        return cls(stiffness=stiffness, damping=damping)

    def wrench(self, patch: Patch | None, pose: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return the force and torque (6,) on the load at `pose` (7,) with `velocity` (6,).

        Without a patch it is zero.
        """
        result = np.zeros(6)
        if patch is None or patch.volume <= 0.0:
            return result
        normal, linear, angular = patch.normal, velocity[:3], velocity[3:]
        arm = patch.point - pose[:3]
        at_centroid = linear + cross(angular, arm)
        closing = float(at_centroid @ normal)
        tangent = np.eye(3) - np.outer(normal, normal)
        covariance = tangent @ patch.covariance @ tangent
        modulus = self.stiffness / max(_area(covariance), LEAST_AREA)

        share = 1.0 + self.damping * closing  # of the elastic pressure at the centroid
        push = max(0.0, modulus * patch.volume * share)
        slip = at_centroid - closing * normal
        grip = self.friction * push
        force = -push * normal - grip / max(_length(slip), self.slip_speed) * slip

        radius = math.sqrt(max(0.0, float(np.trace(covariance))))
        rim = radius * float(angular @ normal)  # slip at the radius of gyration
        torsion = -grip * radius * rim / max(abs(rim), self.slip_speed) * normal
        result[:3] = force
        result[3:] = cross(arm, force) + torsion
        if push > 0.0:
            result[3:] += self._rocking(normal, angular, covariance, share) * modulus * patch.volume
        return result

    def _rocking(self, normal: np.ndarray, angular: np.ndarray, covariance: np.ndarray,
                 share: float) -> np.ndarray:
        """Return the damping's moment (3,) about the centroid [m], by the elastic force κ·V.

        λ·v changes over the patch by λ·g·x, x from the centroid. Where that would exceed `share`
        at the patch's rim, √3 standard deviations away, pressures would be negative: the slope is
        cut to it.
        """
        slope = self.damping * cross(normal, angular)
        spread = covariance @ slope
        at_rim = math.sqrt(3.0 * max(0.0, float(slope @ spread)))
        return -cross(spread, normal) * min(1.0, share / at_rim if at_rim > 0.0 else 1.0)


def _area(covariance: np.ndarray) -> float:
    """Return 12·√(λ₁λ₂) [m²] of a covariance (3, 3) that is flat in one direction.

    λ₁λ₂ is the sum of its three principal minors of two rows.
    """
    c = covariance
    product = (c[0, 0] * c[1, 1] - c[0, 1] * c[1, 0] + c[1, 1] * c[2, 2] - c[1, 2] * c[2, 1]
               + c[2, 2] * c[0, 0] - c[2, 0] * c[0, 2])
    return 12.0 * math.sqrt(max(0.0, float(product)))


def _length(a: np.ndarray) -> float:
    return math.sqrt(float(a @ a))

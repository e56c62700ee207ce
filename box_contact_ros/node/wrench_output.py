# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The output `wrench`: its parameters, and the law that they ask for.

A client that can only apply a wrench gets one for each pair with a body, a moving box with a mass.
A client that can evaluate a law at each physics step holds patches instead: its loads lie stiller.
"""
from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..scene.force.laws import FRICTION
from ..scene.force.pair_wrenches import PairWrenches
from ..scene.scene_solver import MASS_MAX, SceneSolver
from .parameters import Setting, flag, number

FASTEST = 1e5  # Hz
FRICTION_MAX = 10.0
LATENCY_MAX = 1.0  # s

WRENCH_PARAMETERS = {
    'wrench': Setting(False, 'whether each pair with a box that has a mass has a topic wrench: '
                             'force and torque on its box A, to apply until the next; needs rate',
                      flag),
    'rate': Setting(0.0, 'with wrench: how often poses come; 0: not given [Hz]',
                    number(0.0, FASTEST)),
    'mass_a': Setting(0.0, 'with wrench: mass of box A, of one density; 0: no force moves the box '
                           '[kg]', number(0.0, MASS_MAX)),
    'mass_b': Setting(0.0, 'with wrench: mass of box B, of one density; 0: no force moves the box '
                           '[kg]', number(0.0, MASS_MAX)),
    'friction': Setting(FRICTION, "with wrench: Coulomb's friction coefficient [1]",
                        number(0.0, FRICTION_MAX)),
    'latency': Setting(0.0, 'with wrench: from the stamp of the poses to the use of their wrench '
                            '[s]', number(0.0, LATENCY_MAX)),
}


def make_wrenches(settings: Mapping[str, Any], solver: SceneSolver) -> PairWrenches | None:
    """Return the law that checked parameters ask for, or None; ValueError names the remedy."""
    if not settings.get('wrench'):  # the soup node does not have it
        return None
    if not settings['rate']:
        raise ValueError('wrench needs rate, how often poses come in a second: set rate:=200.0, or '
                         'what your simulator sends')
    if settings['pairing'] != 'stamp':
        raise ValueError(f'wrench needs the velocities between stamps, which pairing '
                         f'{settings["pairing"]!r} mixes: set pairing:=stamp')
    if not solver.gives_patch:
        raise ValueError(f'wrench needs volume and covariance of the overlap, and model '
                         f'{solver.model!r} gives the point alone: set model:=mlp or model:=exact')
    if not any(box.mass for box in solver.scene.boxes.values()):
        remedy = ('give a box that moves a mass, such as `mass: 20000.0`' if settings['scene']
                  else 'set mass_a or mass_b')
        raise ValueError(f'wrench: no box has a mass, so no force moves one: {remedy}')
    return PairWrenches(solver.scene, rate_hz=settings['rate'], latency=settings['latency'],
                        friction=settings['friction'])

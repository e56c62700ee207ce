# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The crane client's parameters, and the scenario they describe."""
from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..node.parameters import Check, Setting, flag, number, numbers, size, text, whole_number
from .landing import LANDING_DURATION, landing_scenario
from .mujoco_crane import LANDING_OVERLAP, LIMITS, CraneScenario

STANDARD = CraneScenario()


def _of_scenario(field: str, description: str, check: Check | None = None) -> Setting:
    """Return the setting of a field of CraneScenario; without a check, within its limits."""
    return Setting(getattr(STANDARD, field), description, check or number(*LIMITS[field]))


PARAMETERS = {
    'rate': Setting(200.0, 'pairs of poses published per second [Hz]', number(1, 2000)),
    'duration': _of_scenario('duration', f'length of the motion [s]; left at its default, a '
                             f'closed loop takes {LANDING_DURATION:g}, or less: it ends when all '
                             'that is judged was seen'),
    'wait': Setting(10.0, 'patience for a contact node to answer [s]', number(0, 600)),
    'frame_id': Setting('world', 'frame of the published poses', text),
    'report': Setting(False, 'closed loop: print a line when the load hangs, touches, '
                      'settles, and is at rest', flag),
    'closed_loop': Setting(False, 'apply the contacts as a force: the load is set down, the ropes '
                           'go slack, and the exit status says whether it came to rest', flag),
    'lockstep': Setting(False, 'closed loop: no real time, every tick waits for its answer', flag),
    'latency': Setting(0.0, 'closed loop: a contact acts no earlier than this after its poses were '
                       'published [s]', number(0, 1)),
    'seed': Setting(0, '0: the standard scenario; n > 0: offset and angles drawn at random',
                    whole_number(0, 2**31)),
    'size_a': _of_scenario('size', 'full extents of the load [m]', size),
    'size_b': _of_scenario('stack_size', 'full extents of the stack [m]', size),
    'mass': _of_scenario('mass', 'mass of the load [kg]'),
    'mass_offset': _of_scenario('mass_offset', "centre of mass from the load's centre, in its own "
                                'axes [m]', numbers(3)),
    'offset': _of_scenario('offset', 'x, y of the trolley from the centre of the stack [m]',
                           numbers(2)),
    'rope_angle': _of_scenario('rope_angle', 'ropes from the plumb line at the start [deg]'),
    'rope_heading': _of_scenario('rope_heading', 'whereto, counter-clockwise from x [deg]'),
    'pitch': _of_scenario('pitch', 'tilt of the load about y at the start [deg]'),
    'roll': _of_scenario('roll', 'tilt of the load about x at the start [deg]'),
    'yaw': _of_scenario('yaw', 'turn of the load about the plumb line at the start [deg]'),
    'lowering_speed': _of_scenario('lowering_speed', 'top speed of the hoist [m/s]',
                                   number(0, 0.8)),
    'overlap': _of_scenario('overlap', 'depth to which the load is lowered into the stack [m]; '
                            f'left at its default, a closed loop pays the ropes out by '
                            f'{LANDING_OVERLAP:g} beyond the load at rest'),
}
SCENARIO = {name: {'size_a': 'size', 'size_b': 'stack_size'}.get(name, name) for name in (
    'duration', 'size_a', 'size_b', 'mass', 'mass_offset', 'offset', 'rope_angle', 'rope_heading',
    'pitch', 'roll', 'yaw', 'lowering_speed', 'overlap')}
"""Parameter: the field of CraneScenario that it sets."""


def scenario_from(values: Mapping[str, Any]) -> CraneScenario:
    """Return the scenario of checked parameters.

    What is left at its default may be drawn by the seed, or be what a landing needs.
    """
    given = {field: values[name] for name, field in SCENARIO.items()
             if values[name] != PARAMETERS[name].default}
    make = landing_scenario if values['closed_loop'] else CraneScenario.drawn
    return make(values['seed'], **given)

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The crane in MuJoCo, its node, and the demo."""
from ..node.parameters import Setting, flag, number

CRANE_WRENCH, CRANE_ROPES = 'crane/wrench', 'crane/ropes'
"""Topics of the force of the contacts on the crane's load, and of its ropes, as a marker of lines.
The view shows both, without MuJoCo."""
CRANE_PARAMETERS = {
    'rate': Setting(200.0, 'pairs of poses published per second [Hz]', number(1, 2000)),
    'wait': Setting(30.0, 'patience for a contact node to answer [s]', number(0, 600)),
    'lockstep': Setting(False, 'no real time: every tick waits for its answer', flag),
    'paced': Setting(False, 'in lockstep, never faster than real time', flag),
    'judge_force': Setting(False, 'the force must equal the weight, as by model exact', flag),
}

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The crane: publishes the poses of a load and a stack, and lands the load on their contacts.

`box_a` is the load on the ropes, `box_b` the stack. Each tick publishes both poses under one stamp.
The node then waits for the answer to them on `contacts`, at most for most of the tick, and
simulates the tick under the patch of the newest answer. A contact acts from the time at which it
really came. In lockstep simulated time waits for each answer instead, so every landing is the same.

The landing ends 8 s after the first touch. The exit status is 0 only if the load came to rest and
no answer was lost. At rest means: settled within 3 s, slack ropes, and corner speed, tilt, depth
and gap within the printed limits. With `judge_force`, the force must equal the weight, too, as it
does by model `exact`.
"""
from __future__ import annotations

import sys
from collections.abc import Sequence

from ..arguments import parse_command_line, program_main
from ..extras import require
from . import CRANE_PARAMETERS


@program_main
def main(args: Sequence[str] | None = None) -> int:
    """Land once; 0 only if the load came to rest and no answer was lost."""
    parse_command_line('crane', __doc__, CRANE_PARAMETERS, args)
    require('ros', 'sim')
    from .crane_node import run
    return run(args)


if __name__ == '__main__':
    sys.exit(main())

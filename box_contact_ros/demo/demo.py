# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The demonstration: a contact node and a crane, two processes that talk over DDS.

A crane sets one container down on another. Only the contacts that the node publishes hold the load
up, one per tick. The last lines tell whether the load came to rest, after what time, and how late
the contacts came. The exit status is the crane's: 0 only if the load came to rest and no answer was
lost. At rest means: settled within 3 s, slack ropes, and corner speed, tilt, depth and gap within
the printed limits. With model exact, the force must equal the weight, too.

Simulated time waits for each answer, and is never faster than real time. So a busy machine lands
the load as an idle one does, but later. With --real-time, simulated time does not wait, and late
answers act late.

With --view, a page in the browser shows the landing, again and again until Ctrl-C.

Only this host hears the processes, in the ROS domain ROS_DOMAIN_ID, or in one drawn at random.
"""
from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack

from ..arguments import model_name, program_main, program_parser
from ..extras import require
from ..processes import asked_to_end, keep_to_this_host, program, running

PAUSE = 1.5  # time [s] between the end of a landing and the next, to see how it ended
LOOK_PERIOD = 0.05  # time [s] between looks at the processes

NEXT = """
Next: `make view` shows this in the browser, and README.md how to use the node."""


@program_main
def main(args: Sequence[str] | None = None) -> int:
    """Run the demonstration and return the crane's exit status."""
    parser = program_parser('demo', __doc__)
    parser.add_argument('--model', type=model_name, default='exact', metavar='NAME',
                        help='model of the contact node (default: %(default)s)')
    parser.add_argument('--view', action='store_true', help='show landing after landing')
    parser.add_argument('--real-time', action='store_true', help='do not wait for late answers')
    options = parser.parse_args(args)
    require('sim', *(['view'] if options.view else []))
    domain = keep_to_this_host()
    print('A crane sets one container down on another. A contact node answers its poses with\n'
          f'model {options.model}; only these contacts hold the load up. Both are in ROS domain '
          f'{domain}, on this host alone.', flush=True)
    with asked_to_end() as signals, ExitStack() as ending:
        others = {'contact_node': ending.enter_context(running(
            program('node.run_contact_node', model=options.model)))}
        if options.view:
            others['view'] = ending.enter_context(running(program('view.view')))
        wait = not options.real_time
        crane = program('demo.run_crane', lockstep=wait, paced=wait,
                        judge_force=options.model == 'exact')
        try:
            status = _land(crane, others, signals)
            while options.view and not signals:
                time.sleep(PAUSE)
                status = _land(crane, others, signals)
        except RuntimeError as error:
            print(f'demo: {error}', file=sys.stderr)
            return 1
    if options.view:
        return 128 + signals[0]
    if status == 0:
        print(NEXT)
    return status


def _land(arguments: Sequence[str], others: Mapping[str, subprocess.Popen[bytes]],
          signals: Sequence[int]) -> int:
    """Run the crane; return its exit status, or that of a signal to this process.

    arguments: Python's. Raises RuntimeError if one of the others ends.
    """
    with running(arguments) as crane:
        while (status := crane.poll()) is None:
            for name, process in others.items():
                if process.poll() is not None:
                    raise RuntimeError(f'{name} ended early, status {process.returncode}')
            if signals:
                return 128 + signals[0]
            time.sleep(LOOK_PERIOD)
    return status if status >= 0 else 128 - status


if __name__ == '__main__':
    sys.exit(main())

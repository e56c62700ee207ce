# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The demonstration: a contact node and a crane, two processes that talk over DDS.

`python -m box_contact_ros.demo.demo` starts both, shows the crane's live contacts and its summary,
and ends both again, within a minute. The contacts push the load, one per tick. The crane
reports whether the load came to rest on the stack. With `--open-loop` contacts are only recorded.

Both run in a ROS domain of their own on this host, so that nothing else hears them. The environment
variable `BOX_CONTACT_DEMO_DOMAIN` chooses another one. The exit status is the crane's: 0 only
if contacts came through, nothing was lost, and, closed loop, the load came to rest.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from ..node import processes
from ..node.processes import (
    DOMAINS,
    END_PATIENCE,
    Stop,
    asked_to_end,
    on_this_host,
    printed,
    program,
)
from ..solver.arguments import WholeNames, model_name, within
from ..solver.models import MODELS, NATIVE
from .landing import LANDING_DURATION
from .mujoco_crane import CraneScenario

DOMAIN_VARIABLE = 'BOX_CONTACT_DEMO_DOMAIN'

TIME_LIMIT = 60.0 - END_PATIENCE  # s: a demo ends within a minute, whatever happens
OVERHEAD = 8.0  # s of it for starting, for the last answers and for the summary
LANDING_LEAST = 22.0  # s: a shorter landing ends before it can be judged

NEXT = """
Next:
  {python} -m box_contact_ros
      lists all programs
  {python} -m box_contact_ros contact_node --ros-args \\
          -p size_a:=[12.192,2.438,2.591] -p size_b:=[12.192,2.438,2.591]
      starts the node for your own box_a/pose, box_b/pose
  docs/README.md
      tutorials, topics, parameters, figures"""


def _python() -> str:
    """Return this Python as it is called from here: `make demo` uses its own."""
    with contextlib.suppress(ValueError):
        return str(Path(sys.executable).relative_to(Path.cwd()))
    return sys.executable


def main(args: Sequence[str] | None = None) -> int:
    """Run the demonstration and return the crane's exit status."""
    options = _options(args)
    os.environ |= on_this_host(options.domain)
    # Both take a container for each box, unless they are told otherwise.
    node = program('contact_node', model=options.model)
    crane = program('crane', duration=options.duration, rate=options.rate, report=True,
                    wait=TIME_LIMIT - OVERHEAD - options.duration, closed_loop=options.closed_loop)
    print(_announcement(options), flush=True)
    deadline = time.monotonic() + TIME_LIMIT
    started: list[subprocess.Popen[bytes]] = []
    with tempfile.TemporaryFile() as node_output, asked_to_end() as stop:
        try:
            for command, output in ((node, node_output), (crane, None)):
                started.append(processes.start(command, output))
            status = _watch(started[0], started[1], deadline, stop)
        finally:
            processes.end(started)
        if stop.is_set():
            return stop.status
        if status:
            print(f'demo: failed with status {status}; what contact_node printed:\n'
                  f'{printed(node_output) or "(nothing)"}', file=sys.stderr)
            return status
    print(NEXT.format(python=_python()))
    return 0


def _announcement(options: argparse.Namespace) -> str:
    """Return what will run, what will be judged, and what the model cannot do."""
    what = ('sets one container down on another' if options.closed_loop
            else 'lowers one container onto another and lifts it')
    how = 'its contacts hold the load up' if options.closed_loop else 'nothing is done with it'
    lines = [f'A crane {what}, {options.duration:g} s in real time at most; it publishes both '
             f'poses at {options.rate:g} Hz.',
             f'A contact node answers; {how}. Both are ROS 2 processes of their own, in domain '
             f'{options.domain} on this host.',
             'It passes if contacts come and none is lost'
             f'{", and if the load comes to rest" if options.closed_loop else ""}.']
    if options.closed_loop and options.model not in NATIVE:
        lines.append(f'Model {options.model} gives points without a patch. The law of force then '
                     'takes the whole bottom of the load as the patch. The load may not come to '
                     'rest, and the demo then ends with FAIL. With --open-loop, contacts are only '
                     'recorded.')
    return '\n'.join(lines)


def _options(args: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog='python -m box_contact_ros.demo.demo', formatter_class=WholeNames,
        description='Run a contact node and a crane simulator in this terminal, for less than '
                    'a minute.',
        epilog=f'{DOMAIN_VARIABLE}=N in the environment chooses the ROS domain, '
               f'0 to {DOMAINS[-1]}; without it one is drawn at random.',
    )
    parser.add_argument('--closed-loop', action='store_true', default=True,
                        help='apply the contacts to the load as a force, and judge whether it '
                             'comes to rest')
    parser.add_argument('--open-loop', dest='closed_loop', action='store_false',
                        help='only record the contacts')
    parser.add_argument('--model', type=model_name, default='mlp', metavar='MODEL',
                        help=f'one of {", ".join(MODELS)}; the closed loop needs volume and '
                             'covariance: mlp or exact (default: %(default)s)')
    parser.add_argument('--rate', type=within(1.0, 2000.0), default=200.0, metavar='HZ',
                        help='pairs of poses per second (default: %(default)g)')
    open_loop = CraneScenario().duration
    parser.add_argument('--duration', type=float, metavar='S',
                        help=f'longest motion, closed loop {LANDING_LEAST:g} to 40 s '
                             f'(default: {LANDING_DURATION:g}), open loop 1 to 40 s (default: '
                             f'{open_loop:g})')
    options = parser.parse_args(args)
    if options.duration is None:
        options.duration = LANDING_DURATION if options.closed_loop else open_loop
    least = LANDING_LEAST if options.closed_loop else 1.0
    if not least <= options.duration <= 40.0:
        parser.error(f'--duration must lie in {least:g} to 40 s, got {options.duration:g}')
    domain = os.environ.get(DOMAIN_VARIABLE, str(random.choice(DOMAINS)))
    if not domain.isdecimal() or int(domain) > DOMAINS[-1]:
        parser.error(f'{DOMAIN_VARIABLE} must be a number from 0 to {DOMAINS[-1]}, got {domain!r}')
    options.domain = int(domain)
    return options


def _watch(node: subprocess.Popen[bytes], crane: subprocess.Popen[bytes],
           deadline: float, stop: Stop) -> int:
    """Wait for the crane's exit status.

    An early end of the node, the time limit, or a signal to this process is a 1.
    """
    while (status := crane.poll()) is None:
        if node.poll() is not None:
            print(f'demo: contact_node ended early, status {node.returncode}', file=sys.stderr)
            return 1
        if time.monotonic() > deadline:
            print(f'demo: not done within {TIME_LIMIT:g} s', file=sys.stderr)
            return 1
        if stop.wait(0.05):
            return 1
    return status if status >= 0 else 128 - status


if __name__ == '__main__':
    sys.exit(main())

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The demonstration: a contact node and a crane, two processes that talk over DDS.

It starts both, and ends both within a minute, whatever happens. A crane sets one container down on
another. Only the contacts that the node publishes hold the load up, one per tick. The last lines
say whether the load came to rest, after what time, and how late the contacts came. The exit status
is the crane's: 0 only if the load came to rest and no answer was lost.

Both run in a ROS domain of their own on this host, so nothing else hears them.
"""
from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence

from ..node.processes import (
    END_PATIENCE,
    Stop,
    add_domain,
    asked_to_end,
    end,
    on_this_host,
    printed,
    program,
    start,
)
from ..solver.arguments import add_model, program_parser, within

TIME_LIMIT = 60.0 - END_PATIENCE  # a demo ends within a minute [s]
WAIT = 26.0  # patience of the crane for the node [s]; the rest is for landing and judging
LOOK_PERIOD = 0.05  # between looks at the two processes [s]

NEXT = """
Next, after `source .venv/bin/activate`:
  box_contact_contact_node --ros-args -p size_a:=[6.058,2.438,2.591]
      starts the node for your own box_a/pose, box_b/pose
  docs/README.md
      tutorials, topics, parameters, figures"""


def main(args: Sequence[str] | None = None) -> int:
    """Run the demonstration and return the crane's exit status."""
    options = _options(args)
    os.environ |= on_this_host(options.domain)
    node = program('node.contact_node', model=options.model)
    crane = program('demo.crane_node', rate=options.rate, wait=WAIT)
    print(f'A crane sets one container down on another. It publishes both poses at '
          f'{options.rate:g} Hz.\nA contact node answers with model {options.model}; its contacts '
          f'hold the load up.\nThe two processes are in ROS domain {options.domain}, on this host '
          'alone.', flush=True)
    started: list[subprocess.Popen[bytes]] = []
    with tempfile.TemporaryFile() as node_output, asked_to_end() as stop:
        try:
            for command, output in ((node, node_output), (crane, None)):
                started.append(start(command, output))
            status = _watch(started[0], started[1], stop)
        finally:
            end(started)
        if stop.is_set():
            return stop.status
        if status:
            print(f'demo: failed with status {status}; what contact_node printed:\n'
                  f'{printed(node_output) or "(nothing)"}', file=sys.stderr)
        else:
            print(NEXT)
        return status


def _options(args: Sequence[str] | None) -> argparse.Namespace:
    parser = program_parser('demo', __doc__)
    add_model(parser, 'exact')
    parser.add_argument('--rate', type=within(1.0, 2000.0), default=200.0, metavar='HZ',
                        help='pairs of poses per second (default: %(default)g)')
    add_domain(parser)
    return parser.parse_args(args)


def _watch(node: subprocess.Popen[bytes], crane: subprocess.Popen[bytes], stop: Stop) -> int:
    """Wait for the crane's exit status.

    An early end of the node, the time limit, or a signal to this process is a 1.
    """
    deadline = time.monotonic() + TIME_LIMIT
    while (status := crane.poll()) is None:
        if node.poll() is not None:
            print(f'demo: contact_node ended early, status {node.returncode}', file=sys.stderr)
            return 1
        if time.monotonic() > deadline:
            print(f'demo: not done within {TIME_LIMIT:g} s', file=sys.stderr)
            return 1
        if stop.wait(LOOK_PERIOD):
            return 1
    return status if status >= 0 else 128 - status


if __name__ == '__main__':
    sys.exit(main())

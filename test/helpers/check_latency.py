# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compare the latency of ~/check with that of a service that computes nothing.

    python test/helpers/check_latency.py [--boxes N] [--calls N]

A contact node and an echo, each a process of its own in a ROS domain of its own, get the same
requests in turn, in a random order. The echo answers with a stored response, which is that of the
contact node. The program prints the median latencies and their ratio.
"""
from __future__ import annotations

import argparse
import random
import sys
import time
from collections.abc import Sequence
from contextlib import closing

import numpy as np
from rclpy.context import Context
from ros_client import PATIENCE, Client
from typed_messages import a_box

from box_contact_msgs.srv import Check
from box_contact_ros.node.check import Checker
from box_contact_ros.node.processes import keep_to_this_host, program, running
from box_contact_ros.node.runtime import GuardedNode, run_node
from box_contact_ros.scene.scene_solver import SceneSolver, two_boxes

WARM_UP = 100  # calls


def question(boxes: int) -> Check.Request:
    """Return a request about a stack of boxes, each 50 mm deep in the one below."""
    return Check.Request(boxes=[a_box(f'box_{number}', (0, 0, 1.95 * number, 0, 0, 0, 1), (2, 2, 2))
                                for number in range(boxes)])


class Echo(GuardedNode):
    """Answers every request with the response to a `question`."""

    def __init__(self, context: Context, boxes: int) -> None:
        super().__init__('echo_service', context=context)
        solver = SceneSolver(two_boxes((1, 1, 1), (1, 1, 1)))
        response = Checker(solver).answer(question(boxes), Check.Response())
        self.create_service(Check, '~/check', lambda *_: response)


def main(args: Sequence[str] | None = None) -> int:
    """Ask both, and print how long they take."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--boxes', type=int, default=2, help='default: %(default)s')
    parser.add_argument('--calls', type=int, default=2000, help='default: %(default)s')
    parser.add_argument('--echo', action='store_true', help='be the echo')
    options = parser.parse_args(args)
    if options.echo:
        return run_node(lambda context: Echo(context, options.boxes), [])
    keep_to_this_host()
    times: dict[str, list[float]] = {'echo_service': [], 'contact_node': []}
    with (running([__file__, '--echo', '--boxes', str(options.boxes)]),
          running(program('node.contact_node')), closing(Client()) as client):
        request = question(options.boxes)
        for name in times:
            assert client.call(Check, f'{name}/check', request).contacts.contacts
        for _ in range(WARM_UP + options.calls):
            for name in random.sample(list(times), 2):
                began = time.perf_counter()
                future = client._services[f'{name}/check'].call_async(request)
                client.executor.spin_until_future_complete(future, PATIENCE)
                times[name].append(time.perf_counter() - began)
                assert future.result().success or name == 'echo_service'
    echo, check = (1e6 * float(np.median(kept[WARM_UP:])) for kept in times.values())
    print(f'{options.boxes} boxes: echo p50 {echo:.0f} us, check p50 {check:.0f} us, '
          f'check / echo {check / echo:.2f}')
    return 0


if __name__ == '__main__':
    sys.exit(main())

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Program `yard_growth`: how long ticks wait while a yard gets 20,000 boxes.

`python -m benchmarks.yard_growth` starts a contact node and a sender of 100 poses a second. Beside
them it adds boxes, 1,000 in a request, and asks ~/check and ~/get_boxes after each.

The wait of a tick is the processor time of the node's thread from the arrival of the pose to its
answer, at most. The exit status is 0 only if no tick waits longer than 25 ms.
"""
from __future__ import annotations

import contextlib
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
import yaml
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException
from rclpy.experimental.events_executor import EventsExecutor

from box_contact_msgs.srv import Check, GetBoxes, SetBoxes
from box_contact_ros.arguments import program_parser
from box_contact_ros.node.contact_node import ContactNode
from box_contact_ros.node.messages import make_header
from box_contact_ros.node.paced_service import REQUESTS
from box_contact_ros.node.runtime import GuardedNode, running_node, spin_once
from box_contact_ros.node.set_boxes import MOST_REQUESTED
from box_contact_ros.processes import keep_to_this_host, running

from .yard_clients import FRAME, ROOT, YARD, a_box

MOST_WAIT = 25.0  # ms
RATE = 100.0  # 1/s
A_ROW, SPACING = 150, 3.0  # boxes, m
SETTLING = 2.0  # until poses are answered [s]
PATIENCE = 120.0  # s


def serve(scene: str, found: str) -> int:
    """Run a contact node until its process is ended; write the wait of each tick [ms] to a file."""
    rclpy.init(args=['--ros-args', '-p', f'scene:={scene}', '-p', 'pair_topics:=false',
                     '--log-level', 'error'])
    node = ContactNode()
    node.has_process = True
    node.start()
    ticks: list[tuple[int, int]] = []  # arrival by the wall clock, answer by the thread's [ns]
    events: list[tuple[int, int]] = []  # the end of each, by both clocks [ns]
    note = node._monitor.evaluated

    def noted(took: int, age: int, stale: list[Any]) -> None:
        ticks.append((time.time_ns() - age, time.thread_time_ns()))
        note(took, age, stale)
    node._monitor.evaluated = noted  # type: ignore[method-assign]
    spinner = EventsExecutor()
    spinner.add_node(node)
    with contextlib.suppress(ExternalShutdownException):
        while rclpy.ok():
            spinner.spin_once(timeout_sec=0.5)
            events.append((time.time_ns(), time.thread_time_ns()))
    np.save(found, waits_of(np.array(ticks), np.array(events)))
    return 0


def waits_of(ticks: np.ndarray, events: np.ndarray) -> np.ndarray:
    """Return how long ticks (n, 2) waited [ms], by the ends of events (m, 2), at most.

    A thread gets no more processor time than the wall clock passes.
    """
    after = np.searchsorted(events[:, 0], ticks[:, 0]).clip(1, len(events) - 1)
    spent = events[after, 1] - (events[after, 0] - ticks[:, 0])
    return 1e-6 * (ticks[:, 1] - np.maximum(events[after - 1, 1], spent))


class Grower(GuardedNode):
    """Adds boxes, and asks about them."""

    def __init__(self, context: Context) -> None:
        super().__init__('grower', context=context)

    def call(self, executor: Any, service: tuple[type, str], request: Any) -> Any:
        """Return the answer to a request; raise TimeoutError without one, ValueError for a no."""
        client = self.create_client(*service, qos_profile=REQUESTS)
        if not client.wait_for_service(PATIENCE):
            raise TimeoutError(f'no service {service[1]}')
        future, deadline = client.call_async(request), time.monotonic() + PATIENCE
        while not future.done() and time.monotonic() < deadline:
            spin_once(self, executor, 0.1)
        if not future.done():
            raise TimeoutError(f'{service[1]} has no answer')
        self.destroy_client(client)
        if not future.result().success:
            raise ValueError(future.result().message)
        return future.result()

    def grow(self, executor: Any, count: int) -> None:
        """Add boxes up to a count; check one and list some after each request."""
        header, size = make_header(0, FRAME), MOST_REQUESTED
        for first in range(0, count, size):
            boxes = [a_box(f'c{n}', (SPACING * (n % A_ROW), SPACING * (n // A_ROW), 9, 0, 0, 0, 1))
                     for n in range(first, min(first + size, count))]
            self.call(executor, (SetBoxes, 'contact_node/set_boxes'),
                      SetBoxes.Request(header=header, fixed=boxes))
            self.call(executor, (Check, 'contact_node/check'), Check.Request(
                header=header, boxes=[a_box('guest', (0, 0, 10, 0, 0, 0, 1))]))
            self.call(executor, (GetBoxes, 'contact_node/get_boxes'), GetBoxes.Request(first=first))


def grow(count: int) -> bool:
    """Let a yard grow; print how long ticks waited, and return whether that is short enough."""
    start = (f'import sys; sys.path.append({str(ROOT)!r}); from benchmarks.{{}} import main; '
             'sys.exit(main(sys.argv[1:]))')
    with tempfile.TemporaryDirectory() as folder:
        scene, found = Path(folder) / 'yard.yaml', Path(folder) / 'waits.npy'
        scene.write_text(yaml.safe_dump(YARD), 'utf-8')
        with running(['-c', start.format('yard_growth'), '--serve', str(scene), str(found)]), \
                running(['-c', start.format('yard_clients'), '--sender', str(RATE)]), \
                running_node(Grower) as (grower, spin):
            time.sleep(SETTLING)
            began = time.monotonic()
            grower.grow(spin, count)
            took = time.monotonic() - began
        waits = np.load(found)
    p50, p99, worst = np.percentile(waits, (50, 99, 100))
    print(f'{count} boxes in {took:.1f} s, {len(waits)} ticks; a tick waits for {p50:.2f} ms of '
          f'the processor (p50), {p99:.1f} ms (p99), {worst:.1f} ms at most')
    return bool(worst <= MOST_WAIT)


def main(args: Sequence[str] | None = None) -> int:
    """Print the figures; 0 only if no tick waited too long."""
    words = list(sys.argv[1:] if args is None else args)
    if words[:1] == ['--serve']:
        return serve(*words[1:])
    parser = program_parser('yard_growth', __doc__)
    parser.add_argument('--boxes', type=int, default=20_000)
    given = parser.parse_args(words)
    keep_to_this_host()
    return int(not grow(given.boxes))


if __name__ == '__main__':
    sys.exit(main())

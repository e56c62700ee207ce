# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A contact node with thousands of boxes in one message, beside a node that only echoes.

Both nodes get the same arrays of poses (`poses: array`) at the same rate, one after the other. The
echo node answers each with a message as long as the contact node's, and computes nothing. What an
array costs in transport alone is its share of a core.
"""
from __future__ import annotations

import contextlib
import os
import sys
import tempfile
import time
from collections.abc import Callable, Collection, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from geometry_msgs.msg import Point, Pose, PoseArray, Quaternion
from rclpy.context import Context
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message, serialize_message

from box_contact_msgs.msg import Contacts
from box_contact_ros.bench.drive import raw_stamp, with_stamp
from box_contact_ros.node.messages import make_header
from box_contact_ros.node.processes import keep_to_this_host, program, running
from box_contact_ros.node.runtime import GuardedNode, run_node, running_node, spin_for
from box_contact_ros.node.topics import contact_qos, pose_qos
from box_contact_ros.scene.scene_solver import ALL_BOXES, POSE_ARRAY

from . import output
from .output import markdown_table, number
from .scenes import PLACES, bricks

BOXES, RATE, SECONDS = 2_000, 50.0, 20.0
QUICK_SECONDS = 2.0
PATIENCE = 60.0  # for a node to start, and for its last answers [s]
OFFER = 0.5  # time [s] from an array that offers work to the next, until one is answered
SLICE = 0.002  # time [s] from a look at the schedule to the next, at most
DEEP = QoSProfile(depth=1000)
ECHO_PREFIX = 'echo/'


class EchoNode(GuardedNode):
    """Answers each array with one message of so many bytes, under its stamp."""

    def __init__(self, context: Context, length: int, **options: Any) -> None:
        super().__init__('scene_echo', context=context, **options)
        message = serialize_message(Contacts(stale=['x' * length]))
        publish = self.create_publisher(Contacts, f'{ECHO_PREFIX}contacts', contact_qos()).publish

        def echo(data: bytes) -> None:
            publish(with_stamp(message, raw_stamp(data)))
        self.create_subscription(PoseArray, POSE_ARRAY, echo, pose_qos(ALL_BOXES), raw=True)


class Client(GuardedNode):
    """Sends arrays that were serialised before; keeps what comes back, by stamp."""

    def __init__(self, context: Context) -> None:
        super().__init__('scene_client', context=context)
        self.send = self.create_publisher(PoseArray, POSE_ARRAY, DEEP).publish
        self.arrived: dict[str, dict[int, int]] = {'': {}, ECHO_PREFIX: {}}
        """When [ns] each stamp was answered, by what precedes a node's topics."""
        self.last = b''  # answer of the contact node
        for prefix, arrived in self.arrived.items():
            self.create_subscription(Contacts, f'{prefix}contacts', partial(self._keep, arrived),
                                     DEEP, raw=True)

    def _keep(self, arrived: dict[int, int], data: bytes) -> None:
        arrived[raw_stamp(data)] = time.time_ns()
        if arrived is self.arrived['']:
            self.last = data


class Streamed(NamedTuple):
    """What became of a stream of arrays."""

    node: str
    boxes: int
    sent: int
    lost: int
    bytes: int  # of an answer
    touching: int  # pairs in contact, of the last answer
    core: float  # share of a core [%]
    p50: float  # latency from the stamp to the answer [ms]
    p99: float


def streams(boxes: int, rate: float, seconds: float, *, ahead: float = np.inf) -> list[Streamed]:
    """Stream to the contact node, then to the echo node; call it in a ROS domain of its own.

    ahead: arrays that may be unanswered; the schedule waits for others.
    """
    with contextlib.ExitStack() as ended:
        path = Path(ended.enter_context(tempfile.TemporaryDirectory()), 'scene.yaml')
        path.write_text('poses: array\nboxes:\n' + ''.join(
            f'  b{row}: {{size: [1, 1, 1]}}\n' for row in range(boxes)) + 'pairs: all\n')
        client, executor = ended.enter_context(running_node(Client, []))
        messages = pose_arrays(boxes)
        contact = program('node.contact_node', scene=str(path), model='exact', pair_topics=False)
        rows = [stream(client, executor, '', contact, messages, rate, seconds, ahead)]
        echo = ['-m', __spec__.name, '--echo', str(rows[0].bytes)]
        rows.append(stream(client, executor, ECHO_PREFIX, echo, messages, rate, seconds, ahead))
        return [row._replace(boxes=boxes) for row in rows]


def pose_arrays(boxes: int) -> list[bytes]:
    """Return serialised messages of boxes that move a little, under stamps of 0."""
    rng = np.random.default_rng(1)
    return [serialize_message(PoseArray(header=make_header(0, 'map'), poses=[
        Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=i, y=j, z=k, w=w))
        for x, y, z, i, j, k, w in bricks(boxes).shaken(rng).tolist()])) for _ in range(PLACES)]


def stream(client: Client, executor: Any, prefix: str, arguments: Sequence[str],
           messages: Sequence[bytes], rate: float, seconds: float, ahead: float) -> Streamed:
    """Start a node, send arrays at a rate [Hz], and return what it answered."""
    arrived, stamps = client.arrived[prefix], list[int]()
    spin = partial(spin_for, client, executor)

    def send() -> None:
        stamps.append(time.time_ns())
        client.send(with_stamp(messages[len(stamps) % len(messages)], stamps[-1]))

    def wait(done: Callable[[], object], period: float = SLICE) -> None:
        deadline = time.monotonic() + PATIENCE
        while not done():
            if process.poll() is not None or time.monotonic() > deadline:
                raise RuntimeError(f'{" ".join(arguments)} ended, or does not answer')
            spin(period)

    with running(arguments) as process:
        wait(lambda: send() or arrived, OFFER)  # any may be lost
        stamps.clear()
        began, spent = time.monotonic(), cpu_seconds(process.pid)
        for tick in range(round(rate * seconds)):
            due = began + tick / rate
            wait(lambda due=due: time.monotonic() >= due and is_near(stamps, arrived, ahead))
            send()
        with contextlib.suppress(RuntimeError):  # what does not come is lost
            wait(lambda: stamps[-1] in arrived)
        spin(0.5)
        core = (cpu_seconds(process.pid) - spent) / (time.monotonic() - began)
    latencies = [1e-6 * (arrived[stamp] - stamp) for stamp in stamps if stamp in arrived]
    answer = deserialize_message(client.last, Contacts)
    return Streamed('echo' if prefix else 'contact', 0, len(stamps), len(stamps) - len(latencies),
                    len(client.last), len(answer.contacts), 100.0 * core,
                    *output.percentiles(latencies, 50, 99))


def is_near(stamps: Sequence[int], arrived: Collection[int], ahead: float) -> bool:
    """Return whether fewer than `ahead` of the last 50 stamps are unanswered."""
    return sum(stamp not in arrived for stamp in stamps[-50:]) < ahead


def cpu_seconds(pid: int) -> float:
    """Return the processor time of a process so far [s] (Linux)."""
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def main(args: Sequence[str] | None = None) -> int:
    """Stream, print, write."""
    parser = output.report_parser(
        'scene_node', __doc__, quick='two seconds, to try it out',
        out='scene_node.md, scene_node.csv')
    parser.add_argument('--echo', type=int, metavar='BYTES', help='run the echo node')
    options = parser.parse_args(args)
    if options.echo is not None:
        return run_node(partial(EchoNode, length=options.echo), [])
    folder = output.results_folder(parser, options)
    keep_to_this_host()
    rows = streams(BOXES, RATE, QUICK_SECONDS if options.quick else SECONDS)
    text = output.page(
        'benchmarks/pages/scene_node',
        machine=f'{output.processor()}, {output.versions(("rclpy",))}',
        command=output.command_line('benchmarks.scene_node', args), boxes=BOXES, rate=RATE,
        rows=markdown_table(
            ['node', 'arrays', 'lost', 'pairs in contact', 'answer [kB]', 'core [%]',
             'latency p50 [ms]', 'p99 [ms]'],
            [[row.node, row.sent, row.lost, f'{row.touching:,}', number(1e-3 * row.bytes),
              number(row.core), number(row.p50), number(row.p99)] for row in rows]))
    print(text)
    (folder / 'scene_node.md').write_text(text, encoding='utf-8')
    output.write_csv(folder / 'scene_node.csv', [row._asdict() for row in rows])
    return int(any(row.lost for row in rows))


if __name__ == '__main__':
    sys.exit(main())

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Floods of strangers: what an hour of them does to a locked contact node, sent in two minutes.

Poses that are not finite, names of a megabyte, requests that nobody can read or that a locked
node refuses: `PER_HOUR` of each kind, or as many as can be sent. A second process sends them to the
contact node, then to the echo node, which computes nothing: what both show is the middleware's.
Meanwhile both are measured at 1 kHz, as in the soak.

`python -m benchmarks.flood [--seconds S]`; the exit status is 0 only if the
contact node's memory grew by less than 50 MB, and both nodes answered requests after the floods.
Latencies decide nothing: they depend on what else the machine does.
"""
from __future__ import annotations

import argparse
import contextlib
import dataclasses
import math
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from itertools import count
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from lifecycle_msgs.srv import ChangeState
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters, SetParametersAtomically
from rclpy.client import Client
from rclpy.context import Context
from rclpy.serialization import serialize_message
from rclpy.task import Future

from box_contact_ros.bench.bench_drive import (
    SLICE,
    Bench,
    MeasuredNode,
    echo_node,
    open_bench,
    solver_node,
)
from box_contact_ros.bench.pose_streams import make_stream
from box_contact_ros.demo.ros_client import DEEP_RELIABLE, pose_message
from box_contact_ros.node.messages import make_header
from box_contact_ros.node.parameters import outside_ros_args
from box_contact_ros.node.processes import add_domain, end, printed, start
from box_contact_ros.node.runtime import GuardedNode, joined, refusals_end, spin_for, spin_once
from box_contact_ros.output import markdown_table, percentiles
from box_contact_ros.solver.arguments import program_parser, within

from .soak import resident

PER_HOUR = {'garbage': 3_600_000, 'long name': 3_600, 'bad pose': 360_000,
            'unreadable parameter': 36_000, 'refused parameter': 36_000, 'large text': 3_600,
            'transition': 36_000}
"""Floods of an hour: a kilohertz of garbage, ten requests a second, a megabyte a second."""
OF_POSES = ('garbage', 'long name', 'bad pose')  # which nobody answers
GROWTH_LIMIT = 50.0  # of the contact node's memory [MB]
OUTSTANDING = 4  # requests of a kind that may wait: two kinds share a queue of ten
PATIENCE = 1.0  # s after which a request is taken for lost
PART = 20  # messages of a kind at most before answers are read
END_SECONDS = 30.0  # for the last answers of a flood
SETTLE_SECONDS = 2.5  # in which a contact node gives memory back, once a second
MEGABYTE = 'n' * 2**20
UNKNOWN_TYPE = 77
ANSWERED = 'requests are answered'
RATE = 1000.0  # Hz


class Stranger(GuardedNode):
    """Sends one flood after the other in small parts, so that all last to the end."""

    def __init__(self, context: Context, target: str, poses: str) -> None:
        super().__init__('stranger', context=context)
        self.sent = dict.fromkeys(PER_HOUR, 0)
        self._kind = ''  # of flood that is being sent
        self._waiting: list[tuple[float, str, Future]] = []  # when it was asked, and its kind
        self._publishers = [self.create_publisher(PoseStamped, f'{poses}{box}/pose', DEEP_RELIABLE)
                            for box in ('box_a', 'box_b')]
        self._clients_of: dict[type, Client] = {
            kind: self.create_client(kind, f'/{target}/{name}') for kind, name in (
                (SetParameters, 'set_parameters'), (GetParameters, 'get_parameters'),
                (SetParametersAtomically, 'set_parameters_atomically'),
                (ChangeState, 'change_state'))}
        stamp = make_header(5, 'map')
        good = serialize_message(pose_message(stamp, np.array([0, 0, 0, 0, 0, 0, 1.0])))
        bad = serialize_message(pose_message(stamp, np.full(7, np.nan)))
        long = serialize_message(pose_message(make_header(5, MEGABYTE), np.zeros(7)))
        number = count()
        self._floods: dict[str, Callable[[], None]] = {
            'garbage': lambda: self._publish(good[:next(number) % len(good)]),
            'long name': partial(self._publish, long),
            'bad pose': partial(self._publish, bad),
            'unreadable parameter': partial(self._set, SetParameters, 'scene', type=UNKNOWN_TYPE),
            'refused parameter': partial(self._set, SetParametersAtomically, 'model', type=(
                ParameterType.PARAMETER_STRING), string_value='exact'),
            'large text': partial(self._set, SetParameters, 'scene', type=(
                ParameterType.PARAMETER_STRING), string_value=MEGABYTE),
            'transition': self._change_state}

    def _publish(self, data: bytes) -> None:
        for publisher in self._publishers:
            publisher.publish(data)

    def _set(self, kind: Any, name: str, **value: Any) -> None:
        self._ask(kind, kind.Request(parameters=[
            Parameter(name=name, value=ParameterValue(**value))]))

    def _change_state(self) -> None:
        request = ChangeState.Request()
        request.transition.id = UNKNOWN_TYPE
        self._ask(ChangeState, request)

    def _ask(self, kind: type, request: Any) -> None:
        service = self._clients_of[kind]
        if service.service_is_ready():
            self._waiting.append((time.monotonic(), self._kind, service.call_async(request)))

    def flood(self, seconds: float, serve: Callable[[float], None]) -> None:
        """Send PER_HOUR within so many seconds, or as much of it as can be sent."""
        began = time.monotonic()
        while (share := (time.monotonic() - began) / seconds) < 1.0:
            late = False
            for name, wanted in PER_HOUR.items():
                for _ in range(min(round(share * wanted) - self.sent[name], PART)):
                    if name in OF_POSES or sum(
                            kind == name for _, kind, _ in self._waiting) < OUTSTANDING:
                        self._kind = name
                        self._floods[name]()
                        self.sent[name] += 1
                        late = True
            serve(0.0 if late else 0.001)
            for _ in self._waiting:
                serve(0.0)
            since = time.monotonic() - PATIENCE
            self._waiting = [one for one in self._waiting if one[0] > since and not one[2].done()]

    def answers(self, serve: Callable[[float], None]) -> bool:
        """Return whether a request is answered within ten seconds, after all that."""
        until = time.monotonic() + 10.0
        while time.monotonic() < until:
            future = self._clients_of[GetParameters].call_async(GetParameters.Request(
                names=['use_sim_time']))
            patient = time.monotonic() + PATIENCE
            while time.monotonic() < patient:
                serve(0.01)
                if future.done():
                    return True
        return False


@refusals_end
def main(args: Sequence[str] | None = None) -> int:
    """Measure both nodes without and with floods; 0 only if memory and answers were right."""
    args = list(args or ())
    options = _options(outside_ros_args(args))
    if options.send:
        return _send(options, args)
    nodes = [solver_node('contact', 'mlp', poses='for_contact/', model='mlp', locked=True),
             echo_node('echo', poses='for_echo/', prefix='echo/')]
    growth, told = {}, {}
    with open_bench(nodes, args, rate=RATE, domain=options.domain) as bench:
        quiet, flooded = (dataclasses.replace(make_stream('containers', round(RATE * seconds)),
                                              name=name)
                          for name, seconds in (('quiet', min(10.0, options.seconds)),
                                                ('flooded', options.seconds)))
        truths = {stream.name: stream.contacts('mlp') for stream in (quiet, flooded)}

        def play(_: Any) -> None:
            for node, in bench.turns():
                truth = truths if node.name == 'contact' else dict.fromkeys(truths)
                bench.play(quiet, truth['quiet'], [node])
                before = _memory(node)
                with _flooded(bench, node, options) as told[node.name]:
                    bench.play(flooded, truth['flooded'], [node])
                spin_for(bench.client, bench.executor, SETTLE_SECONDS)
                growth[node.name] = _memory(node) - before
        bench.run([[quiet]], play)
    if bench.notes:  # a node did not start, or ended
        print(*bench.notes, sep='\n')
    return bench.stop.status or int(bool(bench.notes)) or _report(nodes, growth, told)


@contextlib.contextmanager
def _flooded(bench: Bench, node: MeasuredNode, options: argparse.Namespace) -> Iterator[list[str]]:
    """Flood a node by a process of its own; gives a list, which has what it printed afterwards."""
    lines: list[str] = []
    with tempfile.TemporaryFile() as output:
        process = start(['-m', __spec__.name, '--send', f'{node.name}_node', '--poses', node.poses,
                         '--seconds', str(options.seconds)], output)
        try:
            yield lines
            until = time.monotonic() + END_SECONDS
            while process.poll() is None and time.monotonic() < until:
                spin_for(bench.client, bench.executor, SLICE)
        finally:
            end([process])
            lines += printed(output).splitlines()


def _send(options: argparse.Namespace, args: Sequence[str]) -> int:
    """Flood the node that the options name; 0 if it answers a request afterwards."""
    with joined(partial(Stranger, target=options.send, poses=options.poses), args) as (
            node, executor):
        serve = partial(spin_once, node, executor)
        node.flood(options.seconds, serve)
        answered = node.answers(serve)
    print(', '.join(f'{name} {number} of {PER_HOUR[name]}'
                    for name, number in node.sent.items()))
    print(ANSWERED if answered else 'NO REQUEST IS ANSWERED')
    return 0 if answered else 1


def _memory(node: MeasuredNode) -> float:
    return resident(node.process.pid) if node.process else math.nan


def _report(nodes: Sequence[MeasuredNode], growth: Mapping[str, float],
            told: Mapping[str, Sequence[str]]) -> int:
    """Print what was found; return the exit status."""
    rows, late = [], {}
    for node in nodes:
        quiet, flooded = (percentiles(result.latencies, 50, 99) for result in node.log.results())
        late[node.name] = flooded[1]
        rows.append([node.name, *(f'{1e3 * value:.3f}' for value in (*quiet, *flooded)),
                     *(str(result.lost) for result in node.log.results()),
                     f'{growth[node.name]:.1f}'])
    print(markdown_table(['node', 'p50 [ms]', 'p99 [ms]', 'p50 in floods [ms]',
                          'p99 in floods [ms]', 'lost', 'lost in floods', 'memory grown [MB]'],
                         rows, padded=True))
    for name, lines in told.items():
        print(f'{name}: {"; ".join(lines[-2:])}')
    print(f'p99 in floods: {late["contact"] / late["echo"]:.1f} times that of the echo node')
    return 0 if passed(growth, told) else 1


def passed(growth: Mapping[str, float], told: Mapping[str, Sequence[str]]) -> bool:
    """Print and return whether memory stayed within its limit, and requests were answered."""
    bounded = growth['contact'] < GROWTH_LIMIT
    print(f'the contact node has grown by {growth["contact"]:.1f} MB: '
          f'{"within" if bounded else "BEYOND"} the limit of {GROWTH_LIMIT:g}')
    return bounded and all(lines[-1:] == [ANSWERED] for lines in told.values())


def _options(args: Sequence[str]) -> argparse.Namespace:
    parser = program_parser('flood', __doc__)
    parser.add_argument('--seconds', type=within(1.0, 3600.0), default=120.0, metavar='S',
                        help='seconds in which an hour of floods is sent (default: %(default)g)')
    parser.add_argument('--send', metavar='NODE', help='only flood this node, in this domain')
    parser.add_argument('--poses', default='', metavar='PREFIX',
                        help='prefix of its topics, with --send')
    add_domain(parser)
    return parser.parse_args(list(args))


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))

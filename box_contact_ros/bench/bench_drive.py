# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What drives the nodes: sends the streams, receives the answers, keeps the logs.

Poses go out in blocks of half a second. A block goes to one node after the other, in an order that
is drawn anew each time, or to all nodes at once. One thread sends poses that were serialised
before, on an absolute schedule. The executor receives in the main thread, and keeps the bytes with
the time. Messages are read after the block.
"""
from __future__ import annotations

import contextlib
import gc
import os
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import PointStamped, PoseStamped, Vector3Stamped
from rclpy.context import Context
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message, serialize_message

from box_contact_msgs.msg import Contacts as ContactsMessage

from ..node.messages import make_header
from ..node.processes import Stop, asked_to_end, on_this_host
from ..node.runtime import GuardedNode, joined, spin_for
from ..solver.contact import Contacts
from ..solver.contact_solver import ContactSolver
from .answer_log import ECHOED, AnswerLog
from .echo_node import FRAME, raw_stamp, with_stamp
from .measured_node import PREFIXES, MeasuredNode
from .pose_streams import Stream

BLOCK_SECONDS = 0.5
SLICE = 0.05  # time [s] between looks at whether the bench was called off
# Bounds on everything that waits, so that a bench always ends.
START_LIMIT = 60.0  # time [s] until all nodes answer
OFFER_SECONDS = 0.2  # time [s] to answer a pair that asks whether anyone answers
DRAIN_SECONDS = 1.0  # time [s] without an answer, after which what is still out is lost
DRAIN_LIMIT = 15.0  # time [s] for the last answers of a node that has fallen behind

DEEP = QoSProfile(depth=1000)
"""Reliable: what comes in while Python is busy must not push out the rest."""
ANSWERS = {'point': (PointStamped, 'contact/point'), 'normal': (Vector3Stamped, 'contact/normal'),
           'contacts': (ContactsMessage, 'contacts')}
"""Type and topic of each kind of answer."""
_EPOCH = time.time_ns() - time.perf_counter_ns()


def now() -> int:
    """Return the system's time [ns] by a clock that is never set back."""
    return _EPOCH + time.perf_counter_ns()


class BenchNode(GuardedNode):
    """Publishes poses that were serialised before, keeps the bytes of what comes back."""

    def __init__(self, context: Context, inputs: dict[str, str]) -> None:
        """Take the nodes' names with the prefixes of their pose topics."""
        super().__init__('bench', context=context)
        self.arrivals: list[tuple[int, str, str, bytes]] = []
        """(received [ns], node, kind, message)."""
        self.senders = {
            prefix: [self.create_publisher(PoseStamped, f'{prefix}box_{box}/pose', DEEP).publish
                     for box in 'ab']
            for prefix in set(inputs.values())}
        """What sends a serialised pose of box A and of box B, by the topics' prefix."""
        for name in inputs:
            for kind in ECHOED if name == 'echo' else ANSWERS:
                message, topic = ANSWERS[kind]
                self.create_subscription(message, PREFIXES[name] + topic,
                                         partial(self._keep, name, kind), DEEP, raw=True)

    def _keep(self, node: str, kind: str, data: bytes) -> None:
        self.arrivals.append((now(), node, kind, data))


class Bench:
    """Plays streams to nodes, and keeps the logs of what they answered."""

    def __init__(self, inputs: dict[str, str], client: BenchNode, executor: Any, *, model: str,
                 rate: float, cores: set[int], stop: Stop, seed: int) -> None:
        """Take the nodes' names with the prefixes of their pose topics.

        rate: pairs per second [Hz]; model: of the contact node; cores: of the nodes.
        stop: set to call all off; seed: of the order of the nodes.
        """
        self.inputs, self.client, self.executor = inputs, client, executor
        self.model, self.rate, self.cores, self.stop = model, rate, cores, stop
        self.block = max(1, round(rate * BLOCK_SECONDS))  # pairs
        self.faults: list[str] = []  # of nodes that ended early
        self._rng = np.random.default_rng(seed)
        self._log_of: dict[str, AnswerLog] = {}  # by node
        self._last = 0  # stamp [ns]

    def run(self, stream: Stream) -> list[AnswerLog]:
        """Start all nodes, play a stream to them, and end them; return a log for each.

        The logs hold what was done when `stop` was set. Raises ValueError where a node does not
        answer.
        """
        truth = ContactSolver(stream.size, stream.size, model='exact').batch(
            stream.poses_a, stream.poses_b)
        count = len(stream.poses_a)
        blocks = [range(first, min(first + self.block, count))
                  for first in range(0, count, self.block)]
        with contextlib.ExitStack() as ended:
            nodes = [ended.enter_context(contextlib.closing(MeasuredNode(
                name, stream, inputs=inputs, model=self.model, cores=self.cores)))
                for name, inputs in self.inputs.items()]
            self._await_answers(stream, truth, nodes)
            self._open_logs(stream, truth)  # thrown away: the nodes warm up
            self._play_in_turn(stream, blocks[0])
            logs = self._open_logs(stream, truth)
            usages = [[node.usage() for node in nodes]]
            for number, rows in enumerate(blocks):
                if self.stop.is_set():
                    break
                _show(f'{stream.name}: block {number + 1} of {len(blocks)}')
                self._play_in_turn(stream, rows)
                usages.append([node.usage() for node in nodes])
            _show('')
            for log, usage in zip(logs, np.swapaxes(usages, 0, 1)):
                log.note_usage(usage, self.rate)
            self.faults += [node.fault for node in nodes if node.fault]
        return logs

    def _open_logs(self, stream: Stream, truth: Contacts) -> list[AnswerLog]:
        """Return a new log for each node; what is received belongs to them from now on."""
        self._log_of = {name: AnswerLog(name, stream.name, truth) for name in self.inputs}
        return list(self._log_of.values())

    def _await_answers(self, stream: Stream, truth: Contacts,
                       nodes: Sequence[MeasuredNode]) -> None:
        """Send the first pair until every node has answered one, or raise ValueError."""
        deadline = time.monotonic() + START_LIMIT
        waiting = set(self.inputs)
        while waiting and not self.stop.is_set():
            _show(f'{stream.name}: waiting for {", ".join(sorted(waiting))}')
            for node in nodes:
                if node.fault:
                    raise ValueError(node.fault)
            if time.monotonic() > deadline:
                raise ValueError(f'no answer within {START_LIMIT:g} s from {", ".join(waiting)}')
            logs = self._open_logs(stream, truth)
            self._play_in_turn(stream, range(1), patience=OFFER_SECONDS)
            waiting -= {log.node for log in logs if log.answered[0]}

    def _play_in_turn(self, stream: Stream, rows: range, patience: float = DRAIN_SECONDS) -> None:
        """Send some pairs to all nodes; nodes with the same inputs get them together."""
        for inputs in self._rng.permutation(sorted(set(self.inputs.values()))):
            self._play(stream, rows, inputs, patience)

    def _play(self, stream: Stream, rows: range, inputs: str, patience: float) -> None:
        """Send some pairs to the nodes with these inputs, and log their answers.

        patience: time [s] without an answer, after which what is still out is lost.
        """
        logs = [log for name, log in self._log_of.items() if self.inputs[name] == inputs]
        pairs = [(_pose_bytes(stream.poses_a[row]), _pose_bytes(stream.poses_b[row]))
                 for row in rows]
        sent: list[tuple[int, float]] = []
        sender = threading.Thread(target=self._send, args=(inputs, pairs, sent))
        gc.collect()  # now, and not while answers come in: it takes milliseconds
        sender.start()
        while sender.is_alive():
            spin_for(self.client, self.executor, SLICE)
        for row, (stamp, lateness) in zip(rows, sent):
            for log in logs:
                log.sent(row, stamp, lateness)
        deadline = time.monotonic() + DRAIN_LIMIT
        quiet = time.monotonic() + patience
        while any(log.lost[rows].any() for log in logs) and time.monotonic() < min(quiet, deadline):
            spin_for(self.client, self.executor, SLICE)
            if self._read():
                quiet = time.monotonic() + patience
        spin_for(self.client, self.executor, SLICE)  # whatever is on its way behind the last answer
        self._read()

    def _send(self, inputs: str, pairs: Sequence[Sequence[bytes]],
              sent: list[tuple[int, float]]) -> None:
        """Send pairs at the rate; note stamp [ns] and lateness [s] of each.

        The schedule is absolute, so that a pair that is late does not delay the next.
        """
        publishers = self.client.senders[inputs]
        start = time.perf_counter() + SLICE
        for number, messages in enumerate(pairs):
            due = start + number / self.rate
            time.sleep(max(0.0, due - time.perf_counter()))
            if self.stop.is_set():
                return
            lateness = time.perf_counter() - due
            self._last = stamp = max(now(), self._last + 1)  # stamps are names here
            for publish, message in zip(publishers, messages):
                publish(with_stamp(message, stamp))
            sent.append((stamp, lateness))

    def _read(self) -> int:
        """Hand what has arrived to the logs; return how many messages it was."""
        arrivals, self.client.arrivals[:] = self.client.arrivals[:], []
        for received, node, kind, data in arrivals:
            numbers = numbers_of(kind, deserialize_message(data, ANSWERS[kind][0]))
            if numbers is not None:
                self._log_of[node].answer(kind, raw_stamp(data), received, numbers)
        return len(arrivals)


def _pose_bytes(pose: np.ndarray) -> bytes:
    """Return the serialised message of a pose (7,), under a stamp of 0."""
    message = PoseStamped(header=make_header(0, FRAME))
    p, q = message.pose.position, message.pose.orientation
    p.x, p.y, p.z, q.x, q.y, q.z, q.w = map(float, pose)
    return serialize_message(message)


def numbers_of(kind: str, message: Any) -> Sequence[float] | None:
    """Return the numbers of an answer for an `AnswerLog`: none of boxes apart.

    None for contacts that could not be evaluated: the pair is lost.
    """
    if kind == 'contacts':
        if message.stale:
            return None
        return [number for contact in message.contacts
                for number in (*_xyz(contact.point), *_xyz(contact.normal), contact.depth)]
    return _xyz(message.point if kind == 'point' else message.vector)


def _xyz(vector: Any) -> tuple[float, float, float]:
    return vector.x, vector.y, vector.z


@contextlib.contextmanager
def open_bench(inputs: dict[str, str], args: Sequence[str], *, domain: int, **options: Any,
               ) -> Iterator[Bench]:
    """Give a bench of its own ROS domain, on a core of its own; the nodes have the others.

    args: what follows the program's name, for rclpy; options: see `Bench`. SIGINT, SIGTERM and
    SIGHUP set `bench.stop`, so that the nodes are ended and the results kept.
    """
    # Nodes inherit it; nothing else on this network hears what is measured.
    os.environ |= on_this_host(domain)
    cores = os.sched_getaffinity(0)
    own = {max(cores)} if len(cores) > 1 else cores
    os.sched_setaffinity(0, own)  # before rclpy starts its threads, which inherit it
    gc.disable()
    try:
        with asked_to_end() as stop, joined(
                partial(BenchNode, inputs=inputs), args) as (client, executor):
            yield Bench(inputs, client, executor, cores=cores - own or cores, stop=stop, **options)
    finally:
        gc.enable()
        os.sched_setaffinity(0, cores)


def _show(line: str) -> None:
    """Show what goes on in the terminal's last line."""
    if sys.stderr.isatty():
        print(f'\r{line}\033[K', end='', file=sys.stderr, flush=True)

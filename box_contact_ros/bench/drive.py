# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What drives the nodes: sends the poses, receives the answers, keeps the logs.

Poses go out in blocks of half a second. A block goes to one node after the other, in an order that
is drawn anew each time. One thread sends poses that were serialised before, on an absolute
schedule. The executor receives in the main thread, and keeps the bytes with the time. Messages are
read after the block.
"""
from __future__ import annotations

import gc
import subprocess
import threading
import time
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import PointStamped, PoseStamped, Vector3Stamped
from rclpy.context import Context
from rclpy.serialization import deserialize_message, serialize_message

from box_contact_msgs.msg import Contacts as ContactsMessage

from ..node.messages import make_header, pose_message
from ..node.runtime import GuardedNode, spin_for
from ..node.topics import DEEP_RELIABLE
from ..scene.boxes import CONTAINER
from ..solver.contact_solver import ContactSolver
from ..stream.read_contacts import read_contacts
from .echo_node import FRAME, raw_stamp, with_stamp
from .report import NODES, AnswerLog

BLOCK_SECONDS = 0.5
SLICE = 0.05  # time [s] between looks at whether the bench was called off
START_LIMIT = 60.0  # time [s] until a node answers
DRAIN_SECONDS = 1.0  # time [s] without an answer, after which what is still out is lost

ANSWERS = {'point': (PointStamped, 'contact/point'), 'normal': (Vector3Stamped, 'contact/normal'),
           'contacts': (ContactsMessage, 'contacts')}
"""Type and topic of each kind of answer."""


class BenchNode(GuardedNode):
    """Plays the stream of poses to all nodes, and keeps the logs of what they answered."""

    def __init__(self, context: Context, *, nodes: Mapping[str, subprocess.Popen[bytes]],
                 poses: tuple[np.ndarray, np.ndarray], rate: float, signals: Sequence[int],
                 ) -> None:
        """Take the nodes, by name, and the stream: poses (n, 7) of A and of B.

        rate: pairs per second [Hz]; signals: not empty once all is called off.
        """
        super().__init__('bench', context=context)
        self.nodes, self.rate, self.signals = nodes, rate, signals
        self.block = max(1, round(rate * BLOCK_SECONDS))  # pairs
        self._truth = ContactSolver(CONTAINER, CONTAINER, model='exact').batch(*poses)
        header = make_header(0, FRAME)
        self._pairs = [[serialize_message(pose_message(header, pose)) for pose in pair]
                       for pair in zip(*poses)]
        self._arrivals: list[tuple[int, str, bytes]] = []
        """(received [ns], kind, message); stamps tell the nodes apart."""
        self._senders = {
            name: [self.create_publisher(
                PoseStamped, f'bench/{name}/box_{box}/pose', DEEP_RELIABLE).publish
                for box in 'ab'] for name in nodes}
        """What sends a serialised pose of box A and of box B to a node."""
        for name in nodes:
            for kind, (message, topic) in ANSWERS.items():  # the echo node sends no contacts
                self.create_subscription(message, f'bench/{name}/{NODES[name][1]}{topic}',
                                         partial(self._keep, kind), DEEP_RELIABLE, raw=True)

    def _keep(self, kind: str, data: bytes) -> None:
        self._arrivals.append((time.time_ns(), kind, data))

    def run(self, executor: Any) -> list[AnswerLog]:
        """Play the stream to all nodes; return a log for each, of what was sent before a signal.

        Raises ValueError where a node does not answer.
        """
        self._executor = executor
        logs = {name: AnswerLog(name, self._truth) for name in self.nodes}
        rows = range(len(self._pairs))
        blocks = [rows[first:first + self.block] for first in rows[::self.block]]
        for name in self.nodes:
            self._warm_up(name, blocks[0])
        order = np.random.default_rng(1)
        for block in blocks:
            for name in order.permutation(list(logs)):
                if not self.signals:
                    self._play(logs[name], block)
        return list(logs.values())

    def _warm_up(self, name: str, block: range) -> None:
        """Send a node the first pair until it has answered, then a block that nobody looks at."""
        deadline = time.monotonic() + START_LIMIT
        log = AnswerLog(name, self._truth)
        while not (self.signals or log.answered[0]):
            if self.nodes[name].poll() is not None or time.monotonic() > deadline:
                raise ValueError(f'the {name} node has not answered within {START_LIMIT:g} s, '
                                 'or has ended')
            self._play(log, range(1))
        self._play(log, block)

    def _play(self, log: AnswerLog, block: range) -> None:
        """Send a block of pairs to a node, and log its answers."""
        sender = threading.Thread(target=self._send, args=(log, block))
        gc.collect()  # now, and not while answers come in: it takes milliseconds
        sender.start()
        while sender.is_alive():
            spin_for(self, self._executor, SLICE)
        deadline = time.monotonic() + DRAIN_SECONDS
        while log.lost[block].any() and time.monotonic() < deadline:
            spin_for(self, self._executor, SLICE)
            if self._read(log, block):
                deadline = time.monotonic() + DRAIN_SECONDS

    def _send(self, log: AnswerLog, block: range) -> None:
        """Send pairs at the rate; log stamp [ns] and lateness [s] of each.

        The schedule is absolute, so that a pair that is late does not delay the next.
        """
        begin = time.perf_counter() + SLICE
        for number, row in enumerate(block):
            due = begin + number / self.rate
            time.sleep(max(0.0, due - time.perf_counter()))
            if self.signals:
                return
            log.lateness[row] = time.perf_counter() - due
            stamp = time.time_ns()  # it names the pair: no two are the same
            for publish, message in zip(self._senders[log.node], self._pairs[row]):
                publish(with_stamp(message, stamp))
            log.stamps[row] = stamp

    def _read(self, log: AnswerLog, block: range) -> bool:
        """Log what has arrived by the rows of its stamps; return whether anything has.

        What answers an earlier block came too late. Stale poses were not evaluated.
        """
        row_of = dict(zip(log.stamps[block].tolist(), block))
        arrivals, self._arrivals = self._arrivals, []
        known = [(row_of[stamp], kind, received, data) for received, kind, data in arrivals
                 if (stamp := raw_stamp(data)) in row_of]
        for row, kind, received, data in known:
            read = read_contacts(data) if kind == 'contacts' else None
            if read is None or not read.stale:
                log.received[kind][row] = received
            if read is not None and read.names:
                log.depths[row] = -read.contacts.separation[0]
            if kind == 'point' and log.computes:
                point = deserialize_message(data, PointStamped).point
                log.points[row] = point.x, point.y, point.z
        return bool(known)

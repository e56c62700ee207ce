# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A client for tests: publishes poses of boxes, keeps every message that comes back, by stamp."""
from __future__ import annotations

import gc
import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from queue import SimpleQueue
from threading import Event, Thread, current_thread
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped, PoseStamped, Vector3Stamped
from patience import PATIENCE
from rclpy.context import Context
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from typed_messages import contacts_by_pair, pose_stamped

from box_contact_msgs.msg import Contacts
from box_contact_ros.solver.contact import Contact
from box_contact_ros.stream.cdr import NANOSECONDS

CUBES = {'size_a': [2.0, 2.0, 2.0], 'size_b': [2.0, 2.0, 2.0]}
"""Parameters of a node of two cubes."""
TWO_BOXES = {'box_a': 'box_a/pose', 'box_b': 'box_b/pose'}
DEEP = QoSProfile(depth=10_000)
DISCOVERY = 20.0
"""Time [s] after which a client is made again. Discovery takes a fraction of a second; on a busy
machine, in a process that has had hundreds of participants, fifteen were seen."""
AHEAD = 20
"""Ticks of a stream that may be unanswered. Of more, a machine that stands still for a moment loses
poses, which are best effort, and all but the last ten answers."""


def stamp_of(message: Any) -> int:
    """Return the stamp [ns] of a message's header."""
    stamp = message.header.stamp
    return int(stamp.sec * NANOSECONDS + stamp.nanosec)


class Client:
    """Talks to a contact node under `namespace` (like '' or '/yard').

    topics: the pose topics by box. pairs: those of a scene file whose points are kept.
    A node that answers has matched the readers of points and normals too: readers become known in
    the order in which they are made, and that of contacts comes last.
    """

    def __init__(self, namespace: str = '', *, topics: Mapping[str, str] = TWO_BOXES,
                 pairs: Sequence[str] = ()) -> None:
        self.context = Context()
        rclpy.init(context=self.context)
        self.node = Node('client', context=self.context, namespace=namespace or '/')
        self.executor = EventsExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.points: dict[int, PointStamped] = {}
        self.normals: dict[int, Vector3Stamped] = {}
        self.contacts: dict[int, Contacts] = {}  # one message for each evaluation
        self.points_of: dict[str, dict[int, PointStamped]] = {pair: {} for pair in pairs}
        self.order: list[tuple[str, int]] = []  # topic and stamp of each answer, as they came
        self.diagnostics: list[DiagnosticArray] = []
        self.publishers = [self.node.create_publisher(PoseStamped, topic, DEEP)
                           for topic in topics.values()]
        for pair, kept in self.points_of.items():
            self.keep(PointStamped, f'{pair}/contact/point', kept)
        self.keep(PointStamped, 'contact/point', self.points)
        self.keep(Vector3Stamped, 'contact/normal', self.normals)
        self.keep(Contacts, 'contacts', self.contacts)
        self.node.create_subscription(DiagnosticArray, '/diagnostics',
                                      self.diagnostics.append, 10)
        self._services: dict[str, Any] = {}
        self._stamp = 0

    def keep(self, message_type: type, topic: str, kept: dict[int, Any]) -> None:
        """Keep the messages of a topic by stamp."""
        def callback(message: Any) -> None:
            kept[stamp_of(message)] = message
            self.order.append((topic, stamp_of(message)))
        self.node.create_subscription(message_type, topic, callback, DEEP)

    def next_stamp(self) -> int:
        """Return a stamp [ns] later than any before."""
        self._stamp = max(self._stamp + 1, time.time_ns())
        return self._stamp

    def send(self, *poses: Any, frames: Sequence[str] = (), stamps: Sequence[int] = ()) -> int:
        """Publish a pose of each box (none for None); return their newest stamp [ns]."""
        stamps = stamps or (self.next_stamp(),) * len(poses)
        frames = frames or ('map',) * len(poses)
        for publisher, pose, frame, stamp in zip(self.publishers, poses, frames, stamps):
            if pose is not None:
                publisher.publish(pose_stamped(pose, frame, stamp))
        return max(stamps)

    def spin(self, done: Callable[[], Any], timeout: float = PATIENCE) -> bool:
        """Serve until `done()` or the time is over; return done()."""
        deadline = time.monotonic() + timeout
        while not done() and time.monotonic() < deadline:
            self.executor.spin_once(timeout_sec=0.01)
        return bool(done())

    def is_answered(self, stamp: int, timeout: float = PATIENCE) -> bool:
        """Wait for the answer to a stamp; return whether it came."""
        return self.spin(lambda: stamp in self.contacts, timeout)

    def are_answered(self, stamps: Sequence[int]) -> bool:
        """Wait for the answers to all stamps; return whether they came."""
        return self.spin(lambda: all(stamp in self.contacts for stamp in stamps))

    def keep_up(self, stamps: Sequence[int]) -> None:
        """Wait until of a stream no more than `AHEAD` are unanswered."""
        if len(stamps) > AHEAD:
            assert self.is_answered(stamps[-AHEAD - 1]), 'no answer in mid-stream'

    def offer_until_answered(self, *poses: Any) -> float:
        """Send poses every 50 ms until some are answered: both sides have matched. Seconds taken.

        An answer that lacks a stale pair is none.
        """
        started = time.monotonic()
        offered: list[int] = []
        while not any(stamp in self.contacts and not self.contacts[stamp].stale
                      for stamp in offered):
            assert time.monotonic() - started < PATIENCE, 'no answer'
            offered.append(self.send(*poses))
            self.is_answered(offered[-1], 0.05)
        # Late answers to offers must not be mistaken for answers to what comes.
        self.spin(lambda: False, 0.2)
        return time.monotonic() - started

    def ask(self, *poses: Any, **options: Any) -> int:
        """Send poses and wait for their answer; return the stamp."""
        stamp = self.send(*poses, **options)
        assert self.is_answered(stamp), 'no answer'
        return stamp

    def answer(self, *poses: Any, **options: Any) -> dict[str, Contact]:
        """Send poses; return what is answered to them, by pair."""
        return contacts_by_pair(self.contacts[self.ask(*poses, **options)])

    def diagnostic(self, key: str) -> str:
        """Return the value of a key in a diagnostic that was sent after this call."""
        seen = len(self.diagnostics)
        assert self.spin(lambda: len(self.diagnostics) > seen + 1), 'no diagnostics'
        return self.newest_diagnostic(key)

    def newest_diagnostic(self, key: str) -> str:
        """Return the value of a key in the last diagnostic, or '' before the first."""
        entries = self.diagnostics[-1].status[0].values if self.diagnostics else ()
        return {entry.key: entry.value for entry in entries}.get(key, '')

    def poll(self) -> None:
        """Serve what is there, without waiting."""
        for _ in range(16):
            self.executor.spin_once(timeout_sec=0.0)

    def call(self, service_type: Any, name: str, request: Any) -> Any:
        """Return the response of a service."""
        if name not in self._services:
            self._services[name] = self._client_of(service_type, name)
        future = self._services[name].call_async(request)
        assert self.spin(future.done), f'{name} does not answer'
        return future.result()

    def _client_of(self, service_type: Any, name: str) -> Any:
        """Return a client that has found its server.

        Once in some hundred times Fast DDS finds none until the client is made again.
        """
        for _ in range(round(PATIENCE / DISCOVERY)):
            service = self.node.create_client(service_type, name)
            if self.spin(service.service_is_ready, DISCOVERY):
                # It may be ready before the way back is: an answer is lost then.
                self.spin(lambda: False, 0.2)
                return service
            self.node.destroy_client(service)
        raise AssertionError(f'no service {name}')

    def close(self) -> None:
        """Leave the network."""
        self.executor.shutdown()
        self.node.destroy_node()
        self.context.try_shutdown()


def overrides(**parameters: Any) -> list[Parameter]:
    """Return parameters as a node takes them."""
    return [Parameter(name, value=value) for name, value in parameters.items()]


def arguments(**parameters: Any) -> list[str]:
    """Return parameters as a program takes them."""
    texts = [f'{name}:={value if isinstance(value, str) else json.dumps(value)}'
             for name, value in parameters.items()]
    return ['--ros-args', *(word for text in texts for word in ('-p', text))]


@contextmanager
def serving(make_node: Callable[..., Node],
            executor_type: Callable[..., Any] = EventsExecutor, **parameters: Any) -> Iterator[Any]:
    """Serve a node of the package in this process by a thread, with a context of its own.

    make_node: its type, or what makes it with a context. A contact node is started, unless its
    parameter autostart is false. That thread sets parameters and makes transitions too, as it does
    for services.
    """
    context = Context()
    rclpy.init(context=context)
    options = {'parameter_overrides': overrides(**parameters)} if parameters else {}
    node: Any = make_node(context, **options)
    executor = executor_type(context=context)
    executor.add_node(node)
    stop = Event()
    asked: SimpleQueue[Callable[[], None]] = SimpleQueue()

    def serve() -> None:
        while not stop.is_set():
            while not asked.empty():
                asked.get()()
            executor.spin_once(timeout_sec=0.01)

    def by_thread(function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any) -> Any:
            if current_thread() is thread:
                return function(*arguments)
            future: Future[Any] = Future()

            def answer() -> None:
                try:
                    future.set_result(function(*arguments))
                except Exception as error:
                    future.set_exception(error)

            asked.put(answer)
            return future.result(PATIENCE)
        return call

    for name in dir(node):
        if name == 'set_parameters' or name.startswith('trigger_'):
            setattr(node, name, by_thread(getattr(node, name)))
    thread = Thread(target=serve)
    thread.start()
    try:
        if getattr(node, 'autostart', False):
            node.start()
        yield node
    finally:
        stop.set()
        thread.join(PATIENCE)
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()
        gc.collect()  # it would stay on the network, where Fast DDS finds 32 of one process

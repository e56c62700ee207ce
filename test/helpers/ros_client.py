# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A client for tests: publishes pose pairs, keeps every message that comes back, by stamp."""
from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from queue import SimpleQueue
from threading import Event, Thread, current_thread
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped, PoseStamped, Vector3Stamped
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile

from box_contact_ros.demo.ros_client import ANSWERS
from box_contact_ros.node.messages import NANOSECONDS, make_header, read_contacts
from box_contact_ros.node.rclpy_workarounds import ends_within
from box_contact_ros.node.runtime import make_executor
from box_contact_ros.solver.contact import Contact

PATIENCE = 60.0
"""Time [s] for what has to come: a limit against hanging, no more. Discovery takes a fraction of a
second; on a busy machine, in a process that has had hundreds of participants, fifteen were seen."""

AHEAD = 20
"""Pairs of a stream that may be unanswered. Of more, a machine that stands still for a moment loses
poses, which are best effort, and all but the last ten answers."""


def stamp_of(message: Any) -> int:
    return message.header.stamp.sec * NANOSECONDS + message.header.stamp.nanosec


def row_of(contact: Contact) -> tuple[float, ...]:
    """Return the row of pair 0 that says all of a contact; the first three are float32."""
    return (*contact.point.astype('<f4'), 0, *contact.point, *contact.normal, -contact.separation,
            contact.volume, *contact.covariance[np.triu_indices(3)])


class Client:
    """Talks to a contact node under `namespace` (like '' or '/yard').

    A node that answers with a cloud has matched the points and normals too, those of `pairs`
    included: readers are made known in the order in which they are made, and contacts come last.
    """

    pairs: tuple[str, ...] = ()
    ids: Mapping[str, int] = {'box_a_box_b': 0}  # of the pairs of the scene, by name

    def __init__(self, namespace: str = '') -> None:
        self.context = Context()
        rclpy.init(context=self.context)
        self.node = Node('client', context=self.context, namespace=namespace or '/')
        self.executor = make_executor(self.context)
        self.executor.add_node(self.node)
        self.points: dict[int, PointStamped] = {}
        self.normals: dict[int, Vector3Stamped] = {}
        self.clouds: dict[int, Any] = {}  # contacts of all pairs, one message for each evaluation
        self.of_pair: dict[str, dict[int, PointStamped]] = {pair: {} for pair in self.pairs}
        self.order: list[tuple[str, int]] = []
        self.diagnostics: list[DiagnosticArray] = []
        deep = QoSProfile(depth=10_000)
        self.publishers = [
            self.node.create_publisher(PoseStamped, f'box_{box}/pose', deep) for box in 'ab']
        of_pairs = ((PointStamped, f'{pair}/contact/point', kept)
                    for pair, kept in self.of_pair.items())
        for kind, topic, kept in (*of_pairs, (PointStamped, 'contact/point', self.points),
                                  (Vector3Stamped, 'contact/normal', self.normals),
                                  (*ANSWERS['cloud'], self.clouds)):
            self.node.create_subscription(kind, topic, self._keep(topic, kept), deep)
        self.node.create_subscription(DiagnosticArray, '/diagnostics',
                                      self.diagnostics.append, 10)
        self._stamp = 0

    def _keep(self, topic: str, kept: dict[int, Any]) -> Callable[[Any], None]:
        def callback(message: Any) -> None:
            kept[stamp_of(message)] = message
            self.order.append((topic, stamp_of(message)))
        return callback

    def rows(self, stamp: int) -> np.ndarray:
        """Return the contacts of an evaluation, as rows of CLOUD_ROW."""
        return read_contacts(self.clouds[stamp], self.ids)

    def next_stamp(self) -> int:
        """Return a stamp [ns] later than any before."""
        self._stamp = max(self._stamp + 1, time.time_ns())
        return self._stamp

    def send(self, pose_a: Any, pose_b: Any, *, frames: tuple[str, str] = ('map', 'map'),
             stamps: tuple[int, int] | None = None) -> int:
        """Publish a pair (or, for None, one box only); returns the stamp [ns]."""
        stamp = self.next_stamp()
        for publisher, pose, frame, own in zip(self.publishers, (pose_a, pose_b), frames,
                                               stamps or (stamp, stamp)):
            if pose is None:
                continue
            message = PoseStamped(header=make_header(own, frame))
            p, q = message.pose.position, message.pose.orientation
            p.x, p.y, p.z, q.x, q.y, q.z, q.w = (float(value) for value in pose)
            publisher.publish(message)
        return max(stamps) if stamps else stamp

    def spin(self, done: Callable[[], bool], timeout: float = PATIENCE) -> bool:
        """Serve until `done()` or the time is over; returns done()."""
        deadline = time.monotonic() + timeout
        while not done() and time.monotonic() < deadline:
            self.executor.spin_once(timeout_sec=0.01)
        return done()

    def keep_up(self, stamps: Sequence[int]) -> None:
        """Wait until of a stream no more than `AHEAD` are unanswered."""
        if len(stamps) > AHEAD:
            assert self.spin(lambda: stamps[-AHEAD - 1] in self.clouds), 'no answer in mid-stream'

    def offer_until_answered(self, pose_a: Any, pose_b: Any,
                             timeout: float = PATIENCE) -> float:
        """Send a pair every 50 ms until one is answered: both sides have matched. Seconds taken."""
        started = time.monotonic()
        offered: list[int] = []
        while not any(stamp in self.clouds for stamp in offered):
            assert time.monotonic() - started < timeout, 'no answer'
            offered.append(self.send(pose_a, pose_b))
            self.spin(lambda: offered[-1] in self.clouds, 0.05)
        # Late answers to offers must not be mistaken for answers to what comes.
        self.spin(lambda: False, 0.2)
        return time.monotonic() - started

    def ask(self, pose_a: Any, pose_b: Any, **options: Any) -> int:
        """Send a pair and wait for its cloud; returns the stamp."""
        stamp = self.send(pose_a, pose_b, **options)
        assert self.spin(lambda: stamp in self.clouds), 'no answer'
        return stamp

    def diagnostic(self, key: str) -> str:
        """Value of a key in a diagnostic that was sent after this call."""
        seen = len(self.diagnostics)
        assert self.spin(lambda: len(self.diagnostics) > seen + 1), 'no diagnostics'
        values = {entry.key: entry.value for entry in self.diagnostics[-1].status[0].values}
        return values.get(key, '')

    def counts(self) -> dict[str, int]:
        """All whole numbers of a diagnostic that was sent after this call."""
        self.diagnostic('')
        return {entry.key: int(entry.value) for entry in self.diagnostics[-1].status[0].values
                if entry.value.isdecimal()}

    def poll(self) -> None:
        """Serve what is there, without waiting."""
        for _ in range(16):
            self.executor.spin_once(timeout_sec=0.0)

    def client_of(self, kind: Any, name: str) -> Any:
        """Return a client of a service that has found its server.

        Once, in the middle of the suite, one never did, while another of the same node answered:
        the client is made again then.
        """
        for _ in range(3):
            service = self.node.create_client(kind, name)
            if self.spin(service.service_is_ready, PATIENCE / 3):
                return service
            self.node.destroy_client(service)
        raise AssertionError(f'no service {name}')

    def service(self, kind: Any, name: str) -> Any:
        """Return a client of a service that has answered once.

        It may be ready before the way back is: an answer is lost then, and the request is made
        again.
        """
        service = self.client_of(kind, name)
        for _ in range(10):
            future = service.call_async(kind.Request())
            if self.spin(future.done, 2.0):
                return service
        raise AssertionError(f'{name} does not answer')

    def close(self) -> None:
        with ends_within(PATIENCE):
            self.executor.shutdown()
            self.node.destroy_node()
            self.context.try_shutdown()


@contextmanager
def serving(make_node: Callable[[Context], Node]) -> Iterator[Node]:
    """Serve a node of the package in this process by a thread, with a context of its own.

    That thread sets parameters and makes transitions too, as it does for services.
    """
    context = Context()
    rclpy.init(context=context)
    node = make_node(context)
    executor = make_executor(context)
    executor.add_node(node)
    stop = Event()
    asked: SimpleQueue[Callable[[], None]] = SimpleQueue()

    def serve() -> None:
        while not stop.is_set():
            while not asked.empty():
                asked.get()()
            try:
                executor.spin_once(timeout_sec=0.01)
            except Exception as error:  # as `runtime.spin`: a client that is gone before its reply
                node.get_logger().error(f'a request failed: {type(error).__name__}: {error}')

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
        yield node
    finally:
        stop.set()
        thread.join(10)
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()
        # A contact node keeps what is there from being collected, itself included: it would stay on
        # the network, and of one process Fast DDS finds no more than 32 on a host.
        gc.unfreeze()
        gc.collect()

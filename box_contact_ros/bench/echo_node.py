# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The echo node: answers every pair of poses with its stamp, and computes nothing.

It is the floor of the bench: what transport and executor alone cost. It subscribes box_a/pose and
box_b/pose as the contact node does. It answers on echo (std_msgs/Header) once poses of equal stamp
are in. Messages stay the bytes they come as; no faster answer can be given from Python.

It is served as the contact node is, or, with --bare, as any node on this executor: without
`runtime.let_callbacks_finish`.

`python -m box_contact_ros.bench.echo_node [--bare]`; for the bench, not a program of
its own.
"""
from __future__ import annotations

import gc
import struct
import sys
from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import PoseStamped
from rclpy.context import Context
from rclpy.serialization import serialize_message
from std_msgs.msg import Header

from box_contact_ros.node.message_bytes import ENCAPSULATION
from box_contact_ros.node.messages import NANOSECONDS
from box_contact_ros.node.runtime import CONTACT_QOS, POSE_QOS, GuardedNode, run_node
from box_contact_ros.scene.stamp_pairing import WAITING_TICKS

STAMP = struct.Struct('=iI')  # behind the encapsulation; sender and receiver are one machine


def raw_stamp(data: bytes) -> int:
    """Return the stamp [ns] of a serialised message that begins with a header."""
    sec, nanosec = STAMP.unpack_from(data, ENCAPSULATION)
    return sec * NANOSECONDS + nanosec


def with_stamp(data: bytes, stamp: int) -> bytes:
    """Return a serialised message that begins with a header, under another stamp [ns]."""
    packed = STAMP.pack(*divmod(stamp, NANOSECONDS))
    return data[:ENCAPSULATION] + packed + data[ENCAPSULATION + STAMP.size:]


class EchoNode(GuardedNode):
    """Answers each pair of stamps once."""

    def __init__(self, context: Context, **options: Any) -> None:
        super().__init__('echo_node', context=context, **options)
        self._waiting: dict[int, int] = {}  # box by stamp, oldest first
        self._echo = self.create_publisher(Header, 'echo', CONTACT_QOS)
        gc.collect()
        gc.freeze()
        for box, topic in enumerate(('box_a/pose', 'box_b/pose')):
            self.create_subscription(PoseStamped, topic, self._pose_callback(box), POSE_QOS,
                                     raw=True)
        self.get_logger().info('ready')

    def _pose_callback(self, box: int) -> Callable[[bytes], None]:
        waiting, echo = self._waiting, serialize_message(Header())

        def callback(data: bytes) -> None:
            stamp = raw_stamp(data)
            if waiting.pop(stamp, box) != box:
                self._echo.publish(with_stamp(echo, stamp))
                return
            waiting[stamp] = box
            if len(waiting) > WAITING_TICKS:
                del waiting[next(iter(waiting))]
        return callback


if __name__ == '__main__':
    bare = sys.argv[1:2] == ['--bare']
    sys.exit(run_node(EchoNode, sys.argv[1 + bare:], undisturbed=not bare))

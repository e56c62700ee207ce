# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The echo node: answers every pair of poses with a fixed point and normal, and computes nothing.

Its latency is that of transport and executor alone. With the parameter `contacts` it sends a third
message, as the contact node does: the floor, below which no node of these topics can be.

It subscribes box_a/pose and box_b/pose as the contact node does. Once poses of equal stamp are in,
it publishes echo/contact/point and echo/contact/normal under that stamp. Messages stay the bytes
they come as.

`python -m box_contact_ros.bench.echo_node`; for the bench, not a program of its own.
"""
from __future__ import annotations

import gc
import struct
import sys
from collections.abc import Sequence
from typing import Any

from geometry_msgs.msg import PointStamped, PoseStamped, Vector3Stamped
from rclpy.context import Context
from rclpy.serialization import serialize_message

from box_contact_msgs.msg import Contact, Contacts

from ..arguments import program_main
from ..node.messages import make_header
from ..node.parameters import Setting, declare, flag
from ..node.runtime import GuardedNode, run_node
from ..node.topics import contact_qos, pose_qos
from ..stream.cdr import ENCAPSULATION, NANOSECONDS

FRAME = 'world'  # of all poses of the bench
PARAMETERS = {'contacts': Setting(False, 'whether `contacts` are answered, too', flag)}
_STAMP = struct.Struct('=iI')  # behind the encapsulation; sender and receiver are one machine


def raw_stamp(data: bytes) -> int:
    """Return the stamp [ns] of a serialised message that begins with a header."""
    sec, nanosec = _STAMP.unpack_from(data, ENCAPSULATION)
    return sec * NANOSECONDS + nanosec


def with_stamp(data: bytes, stamp: int) -> bytes:
    """Return a serialised message that begins with a header, under another stamp [ns]."""
    packed = _STAMP.pack(*divmod(stamp, NANOSECONDS))
    return data[:ENCAPSULATION] + packed + data[ENCAPSULATION + _STAMP.size:]


class EchoNode(GuardedNode):
    """Answers each pair of poses of equal stamp."""

    def __init__(self, context: Context, **options: Any) -> None:
        super().__init__('echo_node', context=context, **options)
        self._waiting: set[int] = set()  # stamps whose second pose may still come
        header = make_header(0, FRAME)
        answers = [('contact/point', PointStamped(header=header)),
                   ('contact/normal', Vector3Stamped(header=header))]
        if declare(self, PARAMETERS)['contacts']:
            contact = Contact(pair='box_a_box_b', box_a='box_a', box_b='box_b')
            answers.append(('contacts', Contacts(header=header, contacts=[contact])))
        self._answers = [
            (self.create_publisher(type(message), f'echo/{topic}', contact_qos()),
             serialize_message(message)) for topic, message in answers]
        gc.collect()
        gc.freeze()
        for topic in ('box_a/pose', 'box_b/pose'):
            self.create_subscription(PoseStamped, topic, self._on_pose, pose_qos(topic), raw=True)

    def _on_pose(self, data: bytes) -> None:
        stamp = raw_stamp(data)
        if stamp not in self._waiting:
            self._waiting.add(stamp)
            return
        self._waiting.remove(stamp)
        for publisher, message in self._answers:
            publisher.publish(with_stamp(message, stamp))


@program_main
def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM."""
    return run_node(EchoNode, args)


if __name__ == '__main__':
    sys.exit(main())

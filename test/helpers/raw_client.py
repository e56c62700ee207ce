# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A client that sends CDR byte by byte: nothing on this side repairs it. And a pair of cubes."""
from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
import poses
from patience import PATIENCE
from ros_client import Client
from typed_messages import contacts_by_pair

from box_contact_ros.stream.cdr import NANOSECONDS

ORIGIN = poses.IDENTITY
TOUCHING = np.array([0.5, 0.25, 1.875, 0, 0, 0, 1])  # 0.125 m deep
APART = np.array([0.5, 0.25, 2.5, 0, 0, 0, 1])
LITTLE_ENDIAN = b'\0\1\0\0'


def cdr(pose: Sequence[float] | np.ndarray, stamp: tuple[int, int],
        frame: bytes = b'map\0') -> bytes:
    """Serialise a PoseStamped; `stamp` is (sec, nanosec), `frame` the string with its zero."""
    head = struct.pack('<iII', *stamp, len(frame)) + frame
    return LITTLE_ENDIAN + head + b'\0' * (-len(head) % 8) + struct.pack('<7d', *pose)


GOOD = cdr(TOUCHING, (5, 7))


class RawClient(Client):
    """Sends bytes to a node of two cubes of edge 2."""

    def send_raw(self, *payloads: bytes) -> None:
        """Publish each payload on both topics."""
        for payload in payloads:
            for publisher in self.publishers:
                publisher.publish(payload)

    def send_pair(self, pose_a: Any, pose_b: Any, frame: bytes = b'map\0') -> int:
        """Publish a pair as bytes; return its stamp [ns]."""
        stamp = self.next_stamp()
        for publisher, pose in zip(self.publishers, (pose_a, pose_b)):
            publisher.publish(cdr(pose, divmod(stamp, NANOSECONDS), frame))
        return stamp

    def assert_answered(self) -> None:
        """Check that the node lives, and answers a good pair, and rightly.

        Best effort may lose a pair on a busy machine: others follow until one is answered.
        """
        sent: list[int] = []
        while not any(stamp in self.contacts for stamp in sent):
            assert len(sent) < 60, 'no answer'
            sent.append(self.send(ORIGIN, TOUCHING))
            self.is_answered(sent[-1], PATIENCE / 60)
        stamp = next(stamp for stamp in sent if stamp in self.contacts)
        contact, = contacts_by_pair(self.contacts[stamp]).values()
        assert contact.separation == -0.125 and contact.normal.tolist() == [0, 0, 1]
        # Bounds are wider by 2^-46.
        assert np.abs(contact.point - (0.25, 0.125, 0.9375)).max() < 2.0**-43

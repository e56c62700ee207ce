# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A client that sends CDR byte by byte: nothing on this side repairs it. And a pair of cubes."""
from __future__ import annotations

import struct

import numpy as np
import poses
from geometry_msgs.msg import PoseStamped
from rclpy.qos import QoSProfile
from ros_client import PATIENCE, Client

ORIGIN = poses.IDENTITY
TOUCHING = np.array([0.5, 0.25, 1.875, 0, 0, 0, 1])  # 0.125 m deep
APART = np.array([0.5, 0.25, 2.5, 0, 0, 0, 1])
LITTLE_ENDIAN = b'\0\1\0\0'


def cdr(pose, stamp, frame=b'map\0'):
    """Serialise a PoseStamped; `stamp` is (sec, nanosec), `frame` the string with its zero."""
    head = struct.pack('<iII', *stamp, len(frame)) + frame
    return LITTLE_ENDIAN + head + b'\0' * (-len(head) % 8) + struct.pack('<7d', *pose)


GOOD = cdr(TOUCHING, (5, 7))


class RawClient(Client):
    """Sends bytes, and hears what arrives on the wire."""

    def __init__(self):
        super().__init__()
        self.wire = []
        self.raw_subscriptions = [
            self.node.create_subscription(PoseStamped, f'box_{box}/pose', self.wire.append,
                                          QoSProfile(depth=10_000), raw=True) for box in 'ab']

    def send_raw(self, *payloads):
        """Publish each payload on both topics."""
        for payload in payloads:
            for publisher in self.publishers:
                publisher.publish(payload)

    def heard(self, count):
        """Wait for so many messages on the wire; whether they came, and no more."""
        return self.spin(lambda: len(self.wire) >= count) and len(self.wire) == count

    def answered(self, stamp):
        """Wait for the answer to a stamp [ns]; whether it came."""
        return self.spin(lambda: stamp in self.clouds)

    def send_pair(self, pose_a, pose_b, frame=b'map\0'):
        """Publish a pair as bytes; returns its stamp [ns]."""
        stamp = self.next_stamp()
        for publisher, pose in zip(self.publishers, (pose_a, pose_b)):
            publisher.publish(cdr(pose, divmod(stamp, 10**9), frame))
        return stamp

    def assert_answered(self):
        """Check that the node lives, and answers a good pair, and rightly.

        Best effort may lose a pair on a busy machine: others follow until one is answered.
        """
        sent = []
        while not any(stamp in self.clouds for stamp in sent):
            assert len(sent) < 6, 'no answer'
            sent.append(self.send(ORIGIN, TOUCHING))
            self.spin(lambda: sent[-1] in self.clouds, PATIENCE / 6)
        row, = self.rows(next(stamp for stamp in sent if stamp in self.clouds))
        assert row['depth'] == 0.125
        assert (row['normal_x'], row['normal_y'], row['normal_z']) == (0, 0, 1)
        point = np.array([row['x'], row['y'], row['z']])
        assert np.abs(point - (0.25, 0.125, 0.9375)).max() < 2.0**-43  # bounds are wider by 2^-46

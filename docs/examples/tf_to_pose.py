# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Send a frame of /tf as the pose of a box: `python docs/examples/tf_to_pose.py crane_hook map`.

The origin of the frame must be the centre of the box, and its axes must be along the edges. The
pose goes to the topic `pose`; remap it to the box's topic: `--ros-args -r pose:=/box_a/pose`.

Not tested with tf2_ros from apt. PyPI has no wheel of it.
"""
import sys

from box_contact_ros.extras import require

require('ros')  # what is missing is named in one line
import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rclpy.time import Time
from tf2_ros import Buffer, TransformException, TransformListener

RATE = 200.0  # lookups per second [Hz]


class FrameSender(Node):
    """Sends each new transform between two frames as a pose."""

    def __init__(self, frame: str, parent: str) -> None:
        super().__init__('tf_to_pose')
        self._frame, self._parent, self._last = frame, parent, None
        self._buffer = Buffer()
        self._listener = TransformListener(self._buffer, self)
        self._sender = self.create_publisher(PoseStamped, 'pose', 10)
        self.create_timer(1.0 / RATE, self._send)

    def _send(self) -> None:
        try:
            found = self._buffer.lookup_transform(self._parent, self._frame, Time())
        except TransformException as error:
            self.get_logger().warning(str(error), throttle_duration_sec=5.0)
            return
        if found.header.stamp != self._last:  # each stamp is answered once
            self._last = found.header.stamp
            pose, way = PoseStamped(header=found.header), found.transform.translation
            pose.pose.position.x, pose.pose.position.y, pose.pose.position.z = way.x, way.y, way.z
            pose.pose.orientation = found.transform.rotation
            self._sender.publish(pose)


if __name__ == '__main__':
    rclpy.init()
    rclpy.spin(FrameSender(*rclpy.utilities.remove_ros_args(sys.argv)[1:3]))

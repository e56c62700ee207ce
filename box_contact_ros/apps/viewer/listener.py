"""A node that hears what markers and view show: the poses of two boxes, and their contacts."""
from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from ...node.messages import OTHER_SCENE, Refused, TypedMessages, is_of_two_boxes, read_cloud
from ...node.runtime import LOG_SECONDS, POSE_QOS
from ...scene.stamp_pairing import StampedPose


class Listener(Node):
    """Hands on poses and clouds; what the contact node refuses or another scene sends, it drops."""

    def __init__(self, name: str, context: Context, contacts_qos: QoSProfile,
                 **options: Any) -> None:
        super().__init__(name, context=context, **options)
        for box, topic in enumerate(('box_a/pose', 'box_b/pose')):
            self.create_subscription(PoseStamped, topic, self._pose_callback(box), POSE_QOS)
        self.create_subscription(PointCloud2, 'contacts', self._on_cloud, contacts_qos)

    def on_pose(self, box: int, pose: StampedPose) -> None:
        """Take a pose of box 0 (A) or 1 (B)."""
        raise NotImplementedError

    def on_cloud(self, header: Header, rows: np.ndarray) -> None:
        """Take the rows (messages.CLOUD_ROW) of a `contacts` cloud."""
        raise NotImplementedError

    def _pose_callback(self, box: int) -> Callable[[PoseStamped], None]:
        read = TypedMessages().read_pose

        def callback(message: PoseStamped) -> None:
            with contextlib.suppress(Refused):  # the contact node counts and reports it
                self.on_pose(box, read(message))
        return callback

    def _on_cloud(self, message: PointCloud2) -> None:
        rows = read_cloud(message)
        if is_of_two_boxes(rows):
            self.on_cloud(message.header, rows)
        else:
            self.get_logger().warning(OTHER_SCENE, throttle_duration_sec=LOG_SECONDS)

"""Nodes that hear what markers and view show: the poses of two boxes, and their contacts.

`ViewNode` has a hand on the contact node, too: the parameter `model`.
"""
from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import QoSProfile
from rclpy.task import Future
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from ...node.messages import OTHER_SCENE, Refused, TypedMessages, is_of_two_boxes, read_cloud
from ...node.runtime import LOG_SECONDS, POSE_QOS
from ...scene.stamp_pairing import StampedPose
from ..ros_client import stamp_of
from .view_log import ViewLog

ASK_PERIOD = 0.5
"""Time [s] between looks at the contact node's parameters: somebody else may change them too."""
ANSWER_PATIENCE = 3.0
"""Without an answer for so long [s], the contact node is not there, or is busy."""
ASKED = ('size_a', 'size_b', 'pairing', 'model')


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


class ViewNode(Listener):
    """Writes what it hears to `log`, which there is once the contact node has named its sizes."""

    def __init__(self, context: Context, target: str, **options: Any) -> None:
        """`target` is the name of the contact node."""
        self.log: ViewLog | None = None
        self.settings: Mapping[str, Any] = {}  # the contact node's parameters, those of ASKED
        self.wish = ''  # the model that was asked for last, until it is granted
        self.refusal = ''  # why the last model that was asked for was refused
        self._answered = 0.0
        self._question: Future | None = None
        # Contacts best effort: the view must never hold up the contact node.
        super().__init__('view', context, POSE_QOS, **options)
        self._target = AsyncParameterClient(self, target)
        self.create_timer(ASK_PERIOD, self._ask)

    @property
    def connected(self) -> bool:
        """Whether the contact node answers questions."""
        return time.monotonic() - self._answered < ANSWER_PATIENCE

    def set_model(self, name: str) -> None:
        """Ask the contact node for another model; `wish`, then `settings` or `refusal`, tell."""
        self.wish, self.refusal = name, ''
        future = self._target.set_parameters([Parameter('model', value=name)])

        def done(future: Future) -> None:
            result, = future.result().results
            if self.wish == name:
                self.wish, self.refusal = '', '' if result.successful else result.reason
            if result.successful:
                self.settings = {**self.settings, 'model': name}
        future.add_done_callback(done)

    def _ask(self) -> None:
        if self._question is not None and not self.connected:
            self._question = None  # lost with a node that has ended
            self.wish = '' if self._answered else self.wish
        if self._question is None and self._target.services_are_ready():
            self._question = self._target.get_parameters(list(ASKED))
            self._question.add_done_callback(self._on_parameters)

    def _on_parameters(self, future: Future) -> None:
        self._question, self._answered = None, time.monotonic()
        settings = dict(zip(ASKED, map(parameter_value_to_python, future.result().values)))
        old, self.settings = self.settings, settings
        if self.log is None or any(list(settings[name]) != list(old[name])
                                   for name in ('size_a', 'size_b', 'pairing')):
            self.log = ViewLog(settings['size_a'], settings['size_b'], settings['pairing'])

    def on_pose(self, box: int, pose: StampedPose) -> None:
        """Write a pose to the log."""
        if self.log is not None:
            self.log.pose(box, pose.stamp, pose.numbers)

    def on_cloud(self, header: Header, rows: np.ndarray) -> None:
        """Write a cloud to the log, with the time."""
        if self.log is not None:
            self.log.cloud(stamp_of(header), rows, self.get_clock().now().nanoseconds)

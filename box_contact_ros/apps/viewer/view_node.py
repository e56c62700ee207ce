"""The view's ears, and its hand on the contact node: subscriptions, and the parameter `model`."""
from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from rclpy.context import Context
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.task import Future
from std_msgs.msg import Header

from ...node.runtime import POSE_QOS
from ...scene.stamp_pairing import StampedPose
from ..ros_client import stamp_of
from .listener import Listener
from .view_log import ViewLog

ASK_PERIOD = 0.5
"""Time [s] between looks at the contact node's parameters: somebody else may change them too."""
ANSWER_PATIENCE = 3.0
"""Without an answer for so long [s], the contact node is not there, or is busy."""
ASKED = ('size_a', 'size_b', 'pairing', 'model')


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

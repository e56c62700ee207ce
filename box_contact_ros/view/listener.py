# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nodes that hear what is drawn: poses of all boxes of a scene, and contacts.

`ViewNode` learns from the contact node what it is set to, and sets its model. A path that the node
names is one of the node's machine: it is not opened here. The node tells the scene as text.
"""
from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import WrenchStamped
from rclpy.context import Context
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from rclpy.task import Future
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from ..node.messages import Refused, read_contacts
from ..node.ros_client import (
    CRANE_MARKERS,
    CRANE_WRENCH,
    PoseTopic,
    lines_of,
    pose_topics,
    stamp_of,
    subscribe_contacts,
)
from ..node.runtime import LATCHED_QOS, POSE_QOS, GuardedNode
from ..node.topics.scene_topics import LARGEST_SCENE_TEXT
from ..node.topics.tf_poses import TfPoses, has_tf2
from ..scene.files.limits import FOREIGN
from ..scene.files.scene_file import SceneError, parse_scene
from ..scene.scene_solver import Scene, two_boxes
from ..scene.stamp_pairing import NEVER, StampedPose
from .view_log import ViewLog

ASK_PERIOD = 0.5
"""Time [s] between looks at the contact node's parameters: somebody else may change them too."""
ANSWER_PATIENCE = 3.0
"""Without an answer for so long [s], the contact node is not there, or is busy."""
ASKED = ('size_a', 'size_b', 'scene', 'pairing', 'tolerance', 'model')
MOST_FORCE = 1e12  # N: a chart of more shows nothing else
OF_SCENE = ASKED[:-1]
"""With another value of one of these, what came before is forgotten."""


class Listener(GuardedNode):
    """Writes what it hears to `log`; what the contact node refuses or another scene sends, drops.

    log: of the scene that is listened to; None before the first.
    """

    def __init__(self, name: str, context: Context, contacts_qos: QoSProfile,
                 **options: Any) -> None:
        super().__init__(name, context=context, **options)
        self.log: ViewLog | None = None
        self._poses_of: list[Subscription] = []
        self._tf = TfPoses(self, Counter())
        subscribe_contacts(self, self._on_contacts, contacts_qos)

    def listen_to(self, scene: Scene, **options: Any) -> None:
        """Replace the scene; options go to `ViewLog`."""
        for subscription in self._poses_of:
            self.destroy_subscription(subscription)
        self.log = log = ViewLog(scene, **options)
        self._poses_of = [
            self.create_subscription(topic.kind, topic.name, self._pose_callback(log, topic),
                                     topic.qos, raw=True)
            for topic in pose_topics(scene)]
        self._tf.close()
        if scene.frames and has_tf2():
            self._tf.listen(scene.frame_id, scene.frames, partial(self._frame_callback, log))
        elif scene.frames:
            self.get_logger().warning(f'not drawn, as tf2_ros is not installed here: '
                                      f'{", ".join(scene.frames)}')

    def heard(self) -> None:
        """Do what is to be done when something was written to `log`."""

    def _pose_callback(self, log: ViewLog, topic: PoseTopic) -> Callable[[bytes], None]:
        def callback(data: bytes) -> None:
            poses = topic.read(data)
            log.poses(topic.boxes, poses.stamp, poses.numbers, poses.frame_id)
            self.heard()
        return callback

    def _frame_callback(self, log: ViewLog, box: str, _: str) -> Callable[[StampedPose], None]:
        def callback(pose: StampedPose) -> None:
            if pose.stamp == NEVER:
                log.fix(box, pose.numbers)
            else:
                log.pose(box, pose.stamp, pose.numbers, pose.frame_id)
            self.heard()
        return callback

    def _on_contacts(self, message: Any) -> None:
        if self.log is None:
            return
        header = message.header
        self.log.contacts(stamp_of(header), read_contacts(message, self.log.scene.scene.ids),
                          self.get_clock().now().nanoseconds, header.frame_id)
        self.heard()


class ViewNode(Listener):
    """Listens to the scene that the contact node is set to, or to a given one."""

    def __init__(self, context: Context, target: str, scene: Scene | None = None,
                 **options: Any) -> None:
        """`target` is the name of the contact node; `scene` replaces the one that it tells."""
        self.settings: Mapping[str, Any] = {}  # the contact node's parameters, those of ASKED
        self.wish = ''  # the model that was asked for last, until it is granted
        self.refusal = ''  # why the last wish was refused, or the scene cannot be read
        self.lines = np.zeros((0, 2, 3))  # ends of the crane's lines, where a crane runs
        self.force = math.nan  # upward part of the force on the crane's load [N]
        self._scene, self._told = scene, ''
        self._answered = 0.0
        self._question: Future | None = None
        # Contacts best effort: the view must never hold up the contact node.
        super().__init__('view', context, POSE_QOS, **options)
        self._target = AsyncParameterClient(self, target)
        self.create_timer(ASK_PERIOD, self._ask)
        self.create_subscription(MarkerArray, CRANE_MARKERS, self._on_crane, POSE_QOS)
        self.create_subscription(WrenchStamped, CRANE_WRENCH, self._on_force, POSE_QOS)
        self.create_subscription(String, f'{target}/scene', self._on_scene, LATCHED_QOS)

    @property
    def connected(self) -> bool:
        """Whether the contact node answers questions."""
        return time.monotonic() - self._answered < ANSWER_PATIENCE

    @property
    def model(self) -> str:
        """Return the contact node's model; empty before it is known."""
        return str(self.settings.get('model', ''))

    def now(self) -> int:
        """Return the clock's time [ns]."""
        return int(self.get_clock().now().nanoseconds)

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
        future.add_done_callback(self.guarded(done, f'model {name}'))

    def _on_crane(self, message: MarkerArray) -> None:
        self.lines = lines_of(message)

    def _on_force(self, message: WrenchStamped) -> None:
        force = message.wrench.force.z
        if not abs(force) <= MOST_FORCE:
            raise Refused('bad force', f'a force of {force:g} N')
        self.force = force

    def _ask(self) -> None:
        if self._question is not None and not self.connected:
            self._question = None  # lost with a node that has ended
            self.wish = '' if self._answered else self.wish
        if self._question is None and self._target.services_are_ready():
            self._question = self._target.get_parameters(list(ASKED))
            self._question.add_done_callback(
                self.guarded(self._on_parameters, 'parameters of the contact node'))

    def _on_parameters(self, future: Future) -> None:
        self._question, self._answered = None, time.monotonic()
        settings = dict(zip(ASKED, map(parameter_value_to_python, future.result().values)))
        old, self.settings = self.settings, settings
        if any(str(settings[name]) != str(old.get(name)) for name in OF_SCENE):
            self._draw_anew()

    def _on_scene(self, message: String) -> None:
        if len(message.data) > LARGEST_SCENE_TEXT:
            raise Refused('bad scene', f'a text of {len(message.data)} characters; at most '
                                       f'{LARGEST_SCENE_TEXT}')
        if message.data != self._told:
            self._told = message.data
            if self.settings.get('scene'):
                self._draw_anew()

    def _draw_anew(self) -> None:
        """Listen to what the contact node is set to; a scene that is not told yet comes later."""
        settings = self.settings
        try:
            if self._scene is not None:
                scene = self._scene
            elif not settings['scene']:
                scene = two_boxes(settings['size_a'], settings['size_b'])
            elif self._told:
                scene = parse_scene(self._told, 'scene of the contact node', limits=FOREIGN)
            else:
                return
            self.listen_to(scene, pairing=settings['pairing'],
                           tolerance=float(settings['tolerance']))
            self.refusal = ''
        except SceneError as error:
            self.refusal = f'{error} (--scene names the scene)'

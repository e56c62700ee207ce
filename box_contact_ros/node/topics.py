# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Topics of a scene: subscriptions of the poses that move, contact publishers of its pairs."""
from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

from geometry_msgs.msg import PointStamped, PoseStamped, Vector3Stamped
from rcl_interfaces.msg import SetParametersResult
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import (
    DurabilityPolicy,
    QoSCompatibility,
    QoSProfile,
    ReliabilityPolicy,
    qos_check_compatible,
)
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription
from sensor_msgs.msg import MultiDOFJointState

from box_contact_msgs.msg import Boxes, Contacts

from ..scene.scene import Pair, Scene
from ..solver.checks import short_repr
from ..stream.streams import ALL_BOXES, topics_of
from .rclpy_workarounds import RCLError, qos_refusals, with_info

MOST_PAIRS_WITH_TOPICS = 1000
"""Two publishers a pair take milliseconds and memory, here and in every process that listens."""
DEEP_RELIABLE = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
"""Of a client: what the DDS layer delivers while Python is busy must not push out the rest."""
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Of ~/boxes: who subscribes later hears of the last change."""
CONTACT_DEPTH = 10
POSE_DEPTH = 100
"""Poses that wait: 100 ms at 1 kHz, longer than any collection of garbage."""
NAMED_DEPTH = 5
"""Messages of all poses that wait: a slow node is late by a few ticks, never by seconds."""

PoseCallback = Callable[[bytes, Mapping[str, Any]], None]
"""Takes the bytes of poses, and what the middleware knows of them."""


def pose_qos(source: str) -> QoSProfile:
    """Return the quality of service of a source of poses: a box, a body, or ALL_BOXES.

    Best effort matches every publisher.
    """
    return QoSProfile(depth=NAMED_DEPTH if source == ALL_BOXES else POSE_DEPTH,
                      reliability=ReliabilityPolicy.BEST_EFFORT)


def pose_type(scene: Scene) -> type:
    """Return the type of the messages that have the poses of a scene."""
    return MultiDOFJointState if scene.in_one_message else PoseStamped


def contact_qos() -> QoSProfile:
    """Return the quality of service of contacts."""
    return QoSProfile(depth=CONTACT_DEPTH, reliability=ReliabilityPolicy.RELIABLE)


def _check_depth(qos: QoSProfile) -> SetParametersResult:
    """Raise RuntimeError, as rclpy does for other policies, for a depth that keeps no message."""
    if qos.depth < 1:
        raise RuntimeError(f'depth must be at least 1, not {qos.depth}')
    return SetParametersResult(successful=True)


QOS_OVERRIDES = QoSOverridingOptions.with_default_policies(callback=_check_depth)
"""Of poses and of `contacts`."""


class SceneTopics:
    """The topics of a node from configure to cleanup.

    contacts: the publisher of all contacts. boxes: that of changes of the scene. of_pair: those of
    point and normal, by the names of the boxes of a pair. Empty without topics of their own.
    """

    def __init__(self, node: Node, prefix: str, scene: Scene, *, pair_topics: bool) -> None:
        """Create the publishers; `prefix` stands before the names of contact topics.

        Raises ValueError for a scene whose names can be no topics here.
        """
        self._node, self._prefix = node, prefix
        if pair_topics and scene.pair_count > MOST_PAIRS_WITH_TOPICS:
            raise ValueError(f'scene: {scene.pair_count} pairs are too many for topics of their '
                             f'own (at most {MOST_PAIRS_WITH_TOPICS}): set pair_topics to false')
        pairs = tuple(scene.every_pair()) if pair_topics else ()
        labels = Counter(pair.label for pair in pairs)
        if len(labels) < len(pairs):
            raise ValueError(f'scene: {labels.most_common(1)[0][0]} is the name of two pairs: list '
                             'one of them with a name of its own')
        remedies = {
            f'{prefix}contacts': '',
            **{topic: ': set pair_topics to false' for pair in pairs
               for topic in self._topics_of(pair)},
            **dict.fromkeys(topics_of(scene).values(), ': write poses: named in the scene file')}
        for topic, remedy in remedies.items():
            try:
                node.resolve_topic_name(topic)
            except RCLError as error:
                reason = str(error).partition(', at ')[0]  # of rcl's sources
                raise ValueError(f'topic {short_repr(topic)}: {reason}{remedy}') from error
        self._subscriptions: dict[str, Subscription] = {}
        self.of_pair: dict[tuple[str, str], tuple[Publisher, Publisher]] = {}
        self.contacts = self._publisher(Contacts, f'{prefix}contacts',
                                        qos_overriding_options=QOS_OVERRIDES)
        self.boxes = self._publisher(Boxes, '~/boxes', LATCHED)
        for pair in pairs:
            point, normal = self._topics_of(pair)
            self.of_pair[pair.a, pair.b] = (self._publisher(PointStamped, point),
                                            self._publisher(Vector3Stamped, normal))

    def subscribe(self, scene: Scene, callback_of: Callable[[str, str], PoseCallback]) -> None:
        """Subscribe to all poses, with the callback for the bytes of a name and its topic."""
        for box, topic in topics_of(scene).items():
            with qos_refusals(self._node, topic):
                self._subscriptions[box] = self._node.create_subscription(
                    pose_type(scene), topic,
                    with_info(callback_of(box, topic)), pose_qos(box), raw=True,
                    event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
                    qos_overriding_options=QOS_OVERRIDES)

    def close(self) -> None:
        """Destroy all topics."""
        for subscription in self._subscriptions.values():
            self._node.destroy_subscription(subscription)
        of_pairs = (each for two in self.of_pair.values() for each in two)
        for publisher in (self.contacts, self.boxes, *of_pairs):
            self._node.destroy_publisher(publisher)
        self._subscriptions.clear()
        self.of_pair.clear()

    def pose_topics(self) -> list[str]:
        """Return the full names of the topics that are subscribed to."""
        return list(map(self.pose_topic, self._subscriptions))

    def pose_topic(self, box: str) -> str:
        """Return the full name of the topic of a box's poses."""
        return self._subscriptions[box].topic_name

    def publisher_count(self, box: str) -> int:
        """Return how many publish poses of a box."""
        return int(self._subscriptions[box].get_publisher_count())

    def rivals(self) -> list[str]:
        """Return the full names of others that publish on the topic of all contacts."""
        topic = self.contacts.topic_name
        if self._node.count_publishers(topic) < 2:  # a tenth of the time
            return []
        names = [f'{offer.node_namespace.rstrip("/")}/{offer.node_name}'
                 for offer in self._node.get_publishers_info_by_topic(topic)]
        own = self._node.get_fully_qualified_name()
        if own in names:
            names.remove(own)  # once: another node may have the same name
        return names

    def why_silent(self, box: str) -> str:
        """Return who publishes on the topic of a box that gives no pose."""
        subscription = self._subscriptions[box]
        topic, message = subscription.topic_name, subscription.msg_type
        name = message.__name__  # type: ignore[attr-defined]
        wanted = f'{message.__module__.partition(".")[0]}/msg/{name}'
        offers = self._node.get_publishers_info_by_topic(topic)
        if not offers:
            elsewhere = self._elsewhere(topic)
            return f'nobody publishes {topic}' + (
                f', but {elsewhere} is published: remap the one to the other' if elsewhere else '')
        for offer in offers:
            if offer.topic_type != wanted:
                return (f'{topic} is published as {short_repr(offer.topic_type)}, not as '
                        f'{wanted}')
            fits, reason = qos_check_compatible(offer.qos_profile, subscription.qos_profile)
            if fits == QoSCompatibility.ERROR:
                return f'{topic} is published with another quality of service: {reason}'
        return f'{topic} has {len(offers)} of {name}, silent so far'

    def _elsewhere(self, topic: str) -> str:
        """Return a published topic with more or fewer namespaces before it, or ''."""
        for name, _ in sorted(self._node.get_topic_names_and_types()):
            if name != topic and (name.endswith(topic) or topic.endswith(name)) and (
                    self._node.count_publishers(name)):
                return str(name)
        return ''

    def _topics_of(self, pair: Pair) -> tuple[str, str]:
        topic = f'{self._prefix}{pair.name}{"/" if pair.name else ""}contact'
        return f'{topic}/point', f'{topic}/normal'

    def _publisher(self, message: type, topic: str, qos: QoSProfile | None = None, **options: Any,
                   ) -> Publisher:
        # Without events: an event that waits in EventsExecutor outlives a publisher that is
        # destroyed, and ends the process.
        with qos_refusals(self._node, topic):
            return self._node.create_publisher(
                message, topic, qos or contact_qos(),
                event_callbacks=PublisherEventCallbacks(use_default_callbacks=False), **options)

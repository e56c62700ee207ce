# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Topics of a scene: pose subscriptions of its moving boxes, contact publishers of its pairs.

All contacts of a tick go to `contacts` as box_contact_msgs/Contacts, if that package is installed.
They go to `contacts_cloud` as a PointCloud2, if a parameter asks for it. Boxes that are frames
take their poses from /tf, by `TfPoses`. `~/scene` is latched and
has the scene as YAML, so that a reader far away, or of a recording, knows boxes and pairs.
"""
from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Mapping
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple

from geometry_msgs.msg import (
    PointStamped,
    PoseArray,
    PoseStamped,
    Vector3Stamped,
    WrenchStamped,
)
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks, UnsupportedEventTypeError
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSCompatibility, QoSPolicyKind, QoSProfile, qos_check_compatible
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import String

from ...scene.files.scene_file import scene_text
from ...scene.scene_solver import ALL_BOXES, Pair, Scene
from ...solver.checks import shown
from ..messages import ContactsMessage
from ..parameters import QOS_OVERRIDES, one_of, unknown_name, whole_number
from ..rclpy_workarounds import RCLError, parameter_overrides, silence
from ..runtime import ARRAY_QOS, CONTACT_QOS, LATCHED_QOS, POSE_QOS
from .qos_events import QosEvents
from .tf_poses import TF, TF_STATIC, TfPoses

TOPICS_OF_EVERY_NODE = ('/diagnostics', '/parameter_events', '/rosout', '/clock', TF, TF_STATIC)
"""Topics of other types than poses."""
MOST_PAIRS_WITH_TOPICS = 1000
"""Two publishers a pair take milliseconds and memory, here and in every process that listens."""
MOST_IDS = 2**19
"""Ids that a node gives away while it runs, of all its scenes: as many as one scene may have."""
LARGEST_SCENE_TEXT = 2**20
"""Bytes that `~/scene` has at most: some 10,000 pairs. Whoever joins later is sent all of them."""
DEEPEST = 100_000  # messages of a queue
POLICIES = {
    'depth': whole_number(1, DEEPEST),
    'durability': one_of(('volatile', 'transient_local', 'system_default', 'best_available')),
    'history': one_of(('keep_last', 'keep_all', 'system_default')),
    'reliability': one_of(('best_effort', 'reliable', 'system_default', 'best_available')),
}
"""What may be overridden of a topic's quality of service, and by which values."""


def pose_input(source: str) -> tuple[type, QoSProfile]:
    """Return the type and quality of service of a scene's source of poses: a box, or ALL_BOXES."""
    return (PoseArray, ARRAY_QOS) if source == ALL_BOXES else (PoseStamped, POSE_QOS)


class PoseSource(NamedTuple):
    """How the poses of a box, or of all boxes, are subscribed to."""

    box: str
    topic: str
    raw: bool  # whether the callback gets the bytes of messages
    deadline: float  # longest time [s] between poses that publishers must offer; 0: none


class Wanted(NamedTuple):
    """Which topics a scene has, next to those of all contacts."""

    sources: Collection[PoseSource] = ()
    pairs: Collection[Pair] = ()
    wrenches: Collection[Pair] = ()
    cloud: bool = False
    frame_id: str = ''
    frames: Mapping[str, str] = MappingProxyType({})  # in /tf, by box


class SceneTopics:
    """Creates and destroys a node's topics, so that they are those of the current scene.

    contacts, cloud: publishers of all contacts, from the first `set_scene` to `close`; None where
    that message is not published. publishers, wrenches: of point and normal, and of the wrench, by
    the pairs that have them.
    """

    def __init__(self, node: Node, prefix: str, counts: Counter[str]) -> None:
        """Begin without topics; `prefix` stands before the names of contact topics.

        Raise ValueError for a quality of service that no topic here can be given.
        """
        self._node, self._prefix = node, prefix
        self._qos_overrides = {name: value for name, value in parameter_overrides(node).items()
                               if name.startswith(QOS_OVERRIDES)}
        for name, value in self._qos_overrides.items():
            policy = name.rpartition('.')[2]
            if policy not in POLICIES:
                raise ValueError(f'{name}: {unknown_name("policy", policy, POLICIES)}')
            POLICIES[policy](name, value)
        self.events = QosEvents(node, counts)
        self.tf = TfPoses(node, counts)
        self.publishers: dict[Pair, tuple[Publisher, Publisher]] = {}
        self.wrenches: dict[Pair, Publisher] = {}
        self._subscriptions: dict[PoseSource, Subscription] = {}
        self._callback_of: Callable[[str, str], Callable[[Any], None]] | None = None
        self.contacts: Publisher | None = None
        self.cloud: Publisher | None = None
        self._scene: Publisher | None = None
        self._wanted = Wanted()
        self._pair_of_id: dict[int, Pair] = {}
        self._left: set[str] = set()

    def check(self, scene: Scene, *, pair_topics: bool, wrenches: Collection[Pair] = ()) -> None:
        """Raise ValueError for a scene that reuses an id, or whose names can be no topics here.

        A pose topic may not be one of the node's own topics, which have other types.
        """
        for pair in scene.pairs:
            before = self._pair_of_id.get(pair.id, pair)
            if pair.name and pair != before:
                raise ValueError(f'scene: id {pair.id} of pair {pair.name} was given to '
                                 f'{before.name} ({before.a}, {before.b}) before: ids are never '
                                 f'used again while a node runs (start it anew)')
        ids = self._pair_of_id.keys() | {pair.id for pair in scene.pairs if pair.name}
        if len(ids) > MOST_IDS:
            raise ValueError(f'scene: with its pairs the node would have given away '
                             f'{len(ids)} ids, of at most {MOST_IDS}, and none is used again: '
                             'start it anew')
        if pair_topics and len(scene.pairs) > MOST_PAIRS_WITH_TOPICS:
            raise ValueError(f'scene: {len(scene.pairs)} pairs are too many for topics of their '
                             f'own (at most {MOST_PAIRS_WITH_TOPICS}): set pair_topics to false')
        if len(wrenches) > MOST_PAIRS_WITH_TOPICS:
            raise ValueError(f'wrench: {len(wrenches)} pairs have a box with a mass, and at most '
                             f'{MOST_PAIRS_WITH_TOPICS} can have a topic: list fewer pairs')
        own = [f'{self._prefix}contacts', f'{self._prefix}contacts_cloud', '~/scene',
               '~/transition_event', *TOPICS_OF_EVERY_NODE]
        if pair_topics:
            own += [f'{self._topic_of(pair)}/{kind}' for pair in scene.pairs
                    for kind in ('point', 'normal')]
        own += [self._wrench_topic(pair) for pair in wrenches]
        taken = {self._resolved(topic) for topic in own}
        for box, topic in scene.sources.items():
            if self._resolved(topic) in taken:
                raise ValueError(f'scene: pose_topic {shown(topic)} of box {box} is a topic of '
                                 'this node that carries no poses')

    def set_scene(self, scene: Scene, *, pair_topics: bool, cloud: bool, raw: bool,
                  deadline: float, wrenches: Collection[Pair] = ()) -> None:
        """Replace the topics by those of a scene; on RCLError bring the old ones back."""
        old, was_open = self._wanted, self._scene is not None
        sources = [PoseSource(*source, raw, deadline) for source in scene.sources.items()]
        try:
            self._change(Wanted(sources, scene.pairs if pair_topics else (), wrenches, cloud,
                                scene.frame_id, scene.frames))
        except RCLError:
            if was_open:
                self._change(old)
            else:
                self.close()
            raise
        self._pair_of_id |= {pair.id: pair for pair in scene.pairs if pair.name}
        assert self._scene is not None
        text = scene_text(scene)
        self._scene.publish(String(data=text if len(text.encode()) <= LARGEST_SCENE_TEXT else (
            f'# {len(scene.pairs)} pairs: more than {LARGEST_SCENE_TEXT} bytes\n')))

    def activate(self, callback_of: Callable[[str, str], Callable[[Any], None]]) -> None:
        """Subscribe to all poses, with the callback for a box and its topic; or raise RCLError."""
        self._callback_of = callback_of
        try:
            self._change(self._wanted)
        except RCLError:
            self.deactivate()
            raise

    def deactivate(self) -> None:
        """Subscribe to no poses."""
        self._callback_of = None
        self._unsubscribe(list(self._subscriptions))
        self.tf.close()

    def close(self) -> None:
        """Destroy all publishers."""
        self._unpublish(list(self.publishers), list(self.wrenches))
        for publisher in (self.contacts, self.cloud, self._scene):
            self._end(publisher)
        self.contacts = self.cloud = self._scene = None
        self._wanted = Wanted()

    def serve_events(self) -> bool:
        """Serve QoS events; return whether publishers of all boxes have just gone.

        Others may be there: a simulator is started anew at once, but one that was killed stays on
        the network for some time.
        """
        self.events.serve()
        # The two boxes of a simulator that ends may be seen by two calls.
        left, self._left, self.events.left = self.events.left | self._left, self.events.left, set()
        return bool(self._left) and all(
            source.box in left or not subscription.get_publisher_count()
            for source, subscription in self._subscriptions.items())

    def warn_of_unused_qos(self) -> None:
        """Warn of qualities of service for topics that there are not, unless the node is idle."""
        for name in self._qos_overrides if self._subscriptions else ():
            if not self._node.has_parameter(name):
                self._node.get_logger().warning(
                    f'{name}: the node has no such topic now; the form is {QOS_OVERRIDES}/TOPIC.'
                    f'publisher.POLICY, or .subscription., with POLICY {", ".join(POLICIES)}')

    def pose_topics(self) -> list[str]:
        """Return the full names of the topics that are subscribed to."""
        return [*(subscription.topic_name for subscription in self._subscriptions.values()),
                *self.tf.topics()]

    def is_heard(self, box: str) -> bool:
        """Return whether somebody publishes poses of a box; True for a frame in /tf."""
        return box in self._wanted.frames or any(
            source.box == box and subscription.get_publisher_count()
            for source, subscription in self._subscriptions.items())

    def why_silent(self, box: str) -> str:
        """Return who publishes on the topic of a box that gives no pose."""
        if box in self._wanted.frames:
            return self.tf.why_silent(box)
        source = next(source for source in self._subscriptions if source.box == box)
        subscription = self._subscriptions[source]
        topic, (wanted, _) = subscription.topic_name, pose_input(source.box)
        offers = self._node.get_publishers_info_by_topic(topic)
        if not offers:
            return f'nobody publishes {topic}'
        for offer in offers:
            if offer.topic_type != f'geometry_msgs/msg/{wanted.__name__}':
                return (f'{topic} is published as {shown(offer.topic_type)}, not as '
                        f'geometry_msgs/msg/{wanted.__name__}')
            fits, reason = qos_check_compatible(offer.qos_profile, subscription.qos_profile)
            if fits == QoSCompatibility.ERROR:
                return f'{topic} is published with another quality of service: {reason}'
        return f'{topic} has {len(offers)} of {wanted.__name__}, silent so far'

    def _topic_of(self, pair: Pair) -> str:
        return f'{self._prefix}{pair.name}{"/" if pair.name else ""}contact'

    def _wrench_topic(self, pair: Pair) -> str:
        return f'{self._prefix}{pair.name or "contact"}/wrench'

    def _resolved(self, topic: str) -> str:
        """Return a topic's full name, or raise ValueError if it can have none."""
        try:
            return self._node.resolve_topic_name(topic)
        except RCLError as error:
            reason = str(error).partition(', at ')[0]
            raise ValueError(f'scene: {shown(topic)}: {reason}') from error

    def _overriding(self, topic: str, kind: str) -> QoSOverridingOptions:
        """Return what rclpy applies to a topic: parameters are declared only if one was given."""
        begin = f'{QOS_OVERRIDES}{self._resolved(topic)}.{kind}.'
        given = any(name.startswith(begin) for name in self._qos_overrides)
        return QoSOverridingOptions(
            [QoSPolicyKind[policy.upper()] for policy in POLICIES] if given else [])

    def _publisher(self, kind: type, topic: str, qos: QoSProfile = CONTACT_QOS,
                   **options: Any) -> Publisher:
        # rclpy writes overrides into the profile that it gets.
        profile = QoSProfile(depth=qos.depth, reliability=qos.reliability,
                             durability=qos.durability)
        return self._node.create_publisher(
            kind, topic, profile, qos_overriding_options=self._overriding(topic, 'publisher'),
            **options)

    def _change(self, wanted: Wanted) -> None:
        """Keep the topics that stay, destroy the others, create what is new."""
        self._wanted = wanted
        self._unsubscribe(self._subscriptions.keys() - set(wanted.sources))
        if self._scene is None:
            self._scene = self._create(String, '~/scene', LATCHED_QOS)
        if self.contacts is None and ContactsMessage is not None:
            self.contacts = self._create(ContactsMessage, f'{self._prefix}contacts')
        if self.cloud is None and wanted.cloud:
            self.cloud = self._create(PointCloud2, f'{self._prefix}contacts_cloud')
        elif not wanted.cloud:
            self._end(self.cloud)
            self.cloud = None
        self._unpublish(self.publishers.keys() - set(wanted.pairs),
                        self.wrenches.keys() - set(wanted.wrenches))
        for pair in wanted.pairs:
            if pair not in self.publishers:
                topic = self._topic_of(pair)
                self.publishers[pair] = (self._publish(PointStamped, f'{topic}/point'),
                                         self._publish(Vector3Stamped, f'{topic}/normal'))
        for pair in wanted.wrenches:
            if pair not in self.wrenches:
                self.wrenches[pair] = self._publish(WrenchStamped, self._wrench_topic(pair))
        for source in wanted.sources:
            if self._callback_of is not None and source not in self._subscriptions:
                callback = self._callback_of(source.box, source.topic)
                subscription = self._subscriptions[source] = self._subscribe(source, callback)
                self.events.watch(subscription)
        if self._callback_of is not None:
            self.tf.listen(wanted.frame_id, wanted.frames, self._callback_of)

    def _create(self, kind: type, topic: str, qos: QoSProfile = CONTACT_QOS) -> Publisher:
        """Return a new publisher whose events are served."""
        publisher = self._publisher(kind, topic, qos)
        self.events.watch(publisher)
        return publisher

    def _end(self, publisher: Publisher | None) -> None:
        if publisher is not None:
            self.events.unwatch(publisher)
            self._node.destroy_publisher(publisher)

    def _publish(self, kind: type, topic: str) -> Publisher:
        """Return a new publisher of a pair."""
        # No events: too many to serve. A subscriber of another QoS is told by its own node.
        return self._publisher(
            kind, topic, event_callbacks=PublisherEventCallbacks(use_default_callbacks=False))

    def _unpublish(self, pairs: Collection[Pair], wrenches: Collection[Pair]) -> None:
        for pair in pairs:
            for publisher in self.publishers.pop(pair):
                self._node.destroy_publisher(publisher)
        for pair in wrenches:
            self._node.destroy_publisher(self.wrenches.pop(pair))

    def _subscribe(self, source: PoseSource, callback: Callable[[Any], None]) -> Subscription:
        kind, usual = pose_input(source.box)
        qos = QoSProfile(depth=usual.depth, reliability=usual.reliability)
        if source.deadline:
            qos.deadline = Duration(seconds=source.deadline)
        create = partial(self._node.create_subscription, kind, source.topic, callback, qos,
                         raw=source.raw, qos_overriding_options=self._overriding(
                             source.topic, 'subscription'))
        try:
            return create(event_callbacks=self.events.callbacks(
                source.box, deadline=bool(source.deadline)))
        except UnsupportedEventTypeError:  # depends on the middleware
            return create()

    def _unsubscribe(self, sources: Collection[PoseSource]) -> None:
        for source in sources:
            subscription = self._subscriptions.pop(source)
            silence(subscription)
            self.events.unwatch(subscription)
            self._node.destroy_subscription(subscription)

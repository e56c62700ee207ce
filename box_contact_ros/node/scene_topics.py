"""Topics of a scene: pose subscriptions of its moving boxes, contact publishers of its pairs."""
from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection
from functools import partial
from typing import Any, NamedTuple

from geometry_msgs.msg import PointStamped, PoseArray, PoseStamped, Vector3Stamped
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks, UnsupportedEventTypeError
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSPolicyKind, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription
from sensor_msgs.msg import PointCloud2

from ..scene.scene_solver import ALL_BOXES, Pair, Scene
from ..solver.checks import shown
from .parameters import QOS_OVERRIDES, one_of, unknown_name, whole_number
from .qos_events import QosEvents
from .rclpy_workarounds import RCLError, parameter_overrides, silence
from .runtime import ARRAY_QOS, CONTACT_QOS, POSE_QOS

TOPICS_OF_EVERY_NODE = ('/diagnostics', '/parameter_events', '/rosout', '/clock')
"""Topics of other types than poses."""
MOST_PAIRS_WITH_TOPICS = 1000
"""Two publishers a pair take milliseconds and memory, here and in every process that listens."""
DEEPEST = 100_000  # messages of a queue
POLICIES = {
    'depth': whole_number(1, DEEPEST),
    'durability': one_of(('volatile', 'transient_local', 'system_default', 'best_available')),
    'history': one_of(('keep_last', 'keep_all', 'system_default')),
    'reliability': one_of(('best_effort', 'reliable', 'system_default', 'best_available')),
}
"""What may be overridden of a topic's quality of service, and by which values."""


class PoseSource(NamedTuple):
    """How the poses of a box, or of all boxes, are subscribed to."""

    box: str
    topic: str
    raw: bool  # whether the callback gets the bytes of messages
    deadline: float  # longest time [s] between poses that publishers must offer; 0: none


class SceneTopics:
    """Creates and destroys a node's topics, so that they are those of the current scene."""

    contacts: Publisher  # the cloud of all pairs, there from the first `set_scene` to `close`

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
        self.publishers: dict[Pair, tuple[Publisher, Publisher]] = {}  # of point and normal
        self._subscriptions: dict[PoseSource, Subscription] = {}
        self._callback_of: Callable[[str, str], Callable[[Any], None]] | None = None
        self._is_open = False
        self._wanted: tuple[Collection[PoseSource], Collection[Pair]] = (), ()
        self._pair_of_id: dict[int, Pair] = {}

    def check(self, scene: Scene, *, pair_topics: bool) -> None:
        """Raise ValueError for a scene that reuses an id, or whose names can be no topics here.

        A pose topic may not be one of the node's own topics, which have other types.
        """
        for pair in scene.pairs:
            before = self._pair_of_id.get(pair.id, pair)
            if pair.name and pair != before:
                raise ValueError(f'scene: id {pair.id} of pair {pair.name} was given to '
                                 f'{before.name} ({before.a}, {before.b}) before: ids are never '
                                 f'used again while a node runs (start it anew)')
        if pair_topics and len(scene.pairs) > MOST_PAIRS_WITH_TOPICS:
            raise ValueError(f'scene: {len(scene.pairs)} pairs are too many for topics of their '
                             f'own (at most {MOST_PAIRS_WITH_TOPICS}): set pair_topics to false')
        own = [f'{self._prefix}contacts', '~/transition_event', *TOPICS_OF_EVERY_NODE]
        if pair_topics:
            own += [f'{self._topic_of(pair)}/{kind}' for pair in scene.pairs
                    for kind in ('point', 'normal')]
        taken = {self._resolved(topic) for topic in own}
        for box, topic in scene.sources.items():
            if self._resolved(topic) in taken:
                raise ValueError(f'scene: pose_topic {shown(topic)} of box {box} is a topic of '
                                 'this node that carries no poses')

    def set_scene(self, scene: Scene, *, pair_topics: bool, raw: bool, deadline: float) -> None:
        """Replace the topics by those of a scene; on RCLError bring the old ones back."""
        old, was_open = self._wanted, self._is_open
        sources = [PoseSource(*source, raw, deadline) for source in scene.sources.items()]
        try:
            self._change(sources, scene.pairs if pair_topics else ())
        except RCLError:
            if was_open:
                self._change(*old)
            else:
                self.close()
            raise
        self._pair_of_id |= {pair.id: pair for pair in scene.pairs if pair.name}

    def activate(self, callback_of: Callable[[str, str], Callable[[Any], None]]) -> None:
        """Subscribe to all poses, with the callback for a box and its topic; or raise RCLError."""
        self._callback_of = callback_of
        try:
            self._change(*self._wanted)
        except RCLError:
            self.deactivate()
            raise

    def deactivate(self) -> None:
        """Subscribe to no poses."""
        self._callback_of = None
        self._unsubscribe(list(self._subscriptions))

    def close(self) -> None:
        """Destroy all publishers."""
        self._unpublish(list(self.publishers))
        if self._is_open:
            self.events.unwatch(self.contacts)
            self._node.destroy_publisher(self.contacts)
        self._is_open, self._wanted = False, ((), ())

    def warn_of_unused_qos(self) -> None:
        """Warn of qualities of service for topics that there are not, unless the node is idle."""
        for name in self._qos_overrides if self._subscriptions else ():
            if not self._node.has_parameter(name):
                self._node.get_logger().warning(
                    f'{name}: the node has no such topic now; the form is {QOS_OVERRIDES}/TOPIC.'
                    f'publisher.POLICY, or .subscription., with POLICY {", ".join(POLICIES)}')

    def pose_topics(self) -> list[str]:
        """Return the full names of the topics that are subscribed to."""
        return [subscription.topic_name for subscription in self._subscriptions.values()]

    def _topic_of(self, pair: Pair) -> str:
        return f'{self._prefix}{pair.name}{"/" if pair.name else ""}contact'

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

    def _publisher(self, kind: type, topic: str, **options: Any) -> Publisher:
        # rclpy writes overrides into the profile that it gets.
        qos = QoSProfile(depth=CONTACT_QOS.depth, reliability=CONTACT_QOS.reliability)
        return self._node.create_publisher(
            kind, topic, qos, qos_overriding_options=self._overriding(topic, 'publisher'),
            **options)

    def _change(self, sources: Collection[PoseSource], pairs: Collection[Pair]) -> None:
        """Keep the topics that stay, destroy the others, create what is new."""
        self._wanted = sources, pairs
        self._unsubscribe(self._subscriptions.keys() - set(sources))
        if not self._is_open:
            self.contacts = self._publisher(PointCloud2, f'{self._prefix}contacts')
            self.events.watch(self.contacts)
            self._is_open = True
        self._unpublish(self.publishers.keys() - set(pairs))
        for pair in pairs:
            if pair not in self.publishers:
                self.publishers[pair] = self._publish(pair)
        for source in sources:
            if self._callback_of is not None and source not in self._subscriptions:
                callback = self._callback_of(source.box, source.topic)
                subscription = self._subscriptions[source] = self._subscribe(source, callback)
                self.events.watch(subscription)

    def _publish(self, pair: Pair) -> tuple[Publisher, Publisher]:
        def publisher(kind: type, topic: str) -> Publisher:
            # No events: too many to serve. A subscriber of another QoS is told by its own node.
            return self._publisher(
                kind, f'{self._topic_of(pair)}/{topic}',
                event_callbacks=PublisherEventCallbacks(use_default_callbacks=False))
        return publisher(PointStamped, 'point'), publisher(Vector3Stamped, 'normal')

    def _unpublish(self, pairs: Collection[Pair]) -> None:
        for pair in pairs:
            for publisher in self.publishers.pop(pair):
                self._node.destroy_publisher(publisher)

    def _subscribe(self, source: PoseSource, callback: Callable[[Any], None]) -> Subscription:
        kind, usual = ((PoseArray, ARRAY_QOS) if source.box == ALL_BOXES
                       else (PoseStamped, POSE_QOS))
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

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""QoS events of the node's topics: counted, and logged where a user should know."""
from __future__ import annotations

from collections import Counter
from functools import partial
from typing import Any

from rclpy.event_handler import EventHandler, SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription

from ..rclpy_workarounds import serve_event, withhold_events
from ..runtime import LOG_SECONDS


class QosEvents:
    """Withholds events from the executor, and serves them when the node asks, once a second."""

    def __init__(self, node: Node, counts: Counter[str]) -> None:
        self._node, self._counts = node, counts
        self._handlers_of: dict[Publisher | Subscription, list[EventHandler]] = {}
        self.left: set[str] = set()
        """Boxes that have lost a publisher. A read clears the list."""

    def callbacks(self, box: str, *, deadline: bool) -> SubscriptionEventCallbacks:
        """Return the callbacks for events of the poses of a box."""
        return SubscriptionEventCallbacks(
            matched=partial(self.on_matched, box), liveliness=partial(self._on_liveliness, box),
            message_lost=self._on_lost,
            deadline=partial(self._on_deadline, box) if deadline else None)

    def watch(self, entity: Publisher | Subscription) -> None:
        """Serve the events of a publisher or subscription from now on."""
        self._handlers_of[entity] = withhold_events(self._node, entity)

    def unwatch(self, entity: Publisher | Subscription) -> None:
        """Serve what is left, before a publisher or subscription is destroyed."""
        for handler in self._handlers_of.pop(entity, ()):
            serve_event(handler)
            handler.destroy()

    def serve(self) -> None:
        """Serve all events that are new."""
        for handlers in list(self._handlers_of.values()):
            for handler in handlers:
                serve_event(handler)

    def close(self) -> None:
        """Let go of all events; they would keep their topics on the network."""
        for handlers in self._handlers_of.values():
            for handler in handlers:
                handler.destroy()
        self._handlers_of.clear()

    def on_matched(self, box: str, event: Any) -> None:
        """Count publishers of a box's poses that have gone."""
        # A publisher that came and went since the last event is in no current count.
        gone = event.total_count_change - event.current_count_change
        self._counts['publishers gone'] += gone
        if gone:
            self._node.get_logger().info(f'{box}: a publisher of its poses is gone, '
                                         f'{event.current_count} left')
            self.left.add(box)

    def _on_deadline(self, box: str, event: Any) -> None:
        self._counts['deadlines missed'] += event.total_count_change
        self._node.get_logger().warning(f'{box}: no pose within the deadline',
                                        throttle_duration_sec=LOG_SECONDS)

    def _on_liveliness(self, box: str, event: Any) -> None:
        lost = max(0, event.not_alive_count_change)
        self._counts['liveliness lost'] += lost
        if lost:
            self._node.get_logger().warning(f'{box}: a publisher of its poses shows no life')

    def _on_lost(self, event: Any) -> None:
        self._counts['lost in transport'] += event.total_count_change

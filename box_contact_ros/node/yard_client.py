# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A client that has the yard of a contact node as it is now, by messages alone."""
from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.task import Future

from box_contact_msgs.msg import Boxes, Code
from box_contact_msgs.srv import GetBoxes

from ..scene.boxes import Box, Frame
from ..scene.changes import checked_changes
from ..scene.scene import Pair, Scene
from ..scene.scene_solver import finished
from .messages import pose_of, size_of
from .paced_service import REQUESTS
from .parameters import reason_of
from .set_boxes import changes_of
from .topics import LATCHED

LOOK = 0.25  # time [s] after which the client looks whether it has to ask
ASK_AGAIN = 1.0
"""Time [s] after which a page is asked for again: a request is lost if its node ends meanwhile."""
MOST_CHANGES = 1000  # that wait for the end of a listing


class Yard(NamedTuple):
    """The scene of a contact node at one revision; margin [m] and model as it was listed."""

    scene: Scene
    epoch: int
    revision: int
    margin: float
    model: str


class YardClient:
    """Lists the yard of a contact node, and follows its changes. It may start at any time.

    yard: None before the first listing is complete.
    """

    def __init__(self, node: Node, name: str = 'contact_node', *,
                 on_yard: Callable[[Yard], None] | None = None) -> None:
        """Ask the contact node of a name by another node; hand each new yard to `on_yard`."""
        self.yard: Yard | None = None
        self._logger, self._on_yard = node.get_logger(), on_yard
        self._told: tuple[int, int] | None = None  # epoch and revision by the last of ~/boxes
        self._pages: list[GetBoxes.Response] = []
        self._changes: deque[Boxes] = deque(maxlen=MOST_CHANGES)  # that came beside the pages
        self._page: Future | None = None  # that is asked for
        self._asked = -math.inf  # when, by the steady clock [s]
        self._get_boxes = node.create_client(GetBoxes, f'{name}/get_boxes', qos_profile=REQUESTS)
        node.create_subscription(Boxes, f'{name}/boxes', self._guarded(self._on_boxes), LATCHED)
        node.create_timer(LOOK, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    @property
    def is_current(self) -> bool:
        """Whether the yard is the last one that the node told of."""
        return self.yard is not None and self._told in (
            None, (self.yard.epoch, self.yard.revision))

    def _look(self) -> None:
        """Ask for the next page where the yard is another one, and no answer may come."""
        if not self.is_current and time.monotonic() - self._asked >= ASK_AGAIN:
            self._ask()

    def _ask(self) -> None:
        """Ask for the boxes behind those of the pages, if the node is there."""
        if not self._get_boxes.service_is_ready():
            return
        request = GetBoxes.Request(first=sum(len(page.boxes) for page in self._pages))
        if self._pages:
            request.epoch, request.revision = self._pages[0].epoch, self._pages[0].revision
        if self._page is not None:
            self._get_boxes.remove_pending_request(self._page)
        self._asked, self._page = time.monotonic(), self._get_boxes.call_async(request)
        self._page.add_done_callback(self._guarded(self._on_page))

    def _begin(self) -> None:
        """List the newest scene."""
        self._pages, self._page = [], None
        self._ask()

    def _on_page(self, future: Future) -> None:
        if future is not self._page:
            return
        page, self._page = future.result(), None
        if not page.success:
            if page.code.value == Code.OUTDATED:
                self._begin()
            return  # of a busy node, `_look` asks again
        self._pages.append(page)
        if page.boxes and sum(len(page.boxes) for page in self._pages) < page.count:
            self._ask()
            return
        pages, self._pages = self._pages, []
        changes, first, self._told = list(self._changes), pages[0], (page.epoch, page.revision)
        self._changes.clear()
        self._take(Yard(_scene_of(pages), *self._told, first.margin, first.model))
        for boxes in changes:
            if boxes.epoch != page.epoch or boxes.revision > page.revision:
                self._on_boxes(boxes)

    def _on_boxes(self, boxes: Boxes) -> None:
        """Follow a change of the yard, or list the newest one where some were missed."""
        self._told, yard = (boxes.epoch, boxes.revision), self.yard
        if self._page is not None or self._pages:
            self._changes.append(boxes)
        elif yard is not None and self._told == (yard.epoch, yard.revision + 1):
            _, changes = finished(changes_of(yard.scene, boxes))
            changed = checked_changes(yard.scene, **changes)
            self._take(yard._replace(scene=yard.scene.changed(*changed)[0],
                                     revision=boxes.revision))
        elif not self.is_current:
            self._begin()

    def _take(self, yard: Yard) -> None:
        self.yard = yard
        if self._on_yard is not None:
            self._on_yard(yard)

    def _guarded(self, callback: Callable[[Any], None]) -> Callable[[Any], None]:
        """Return a callback that raises nothing, and begins anew where messages make no scene.

        Where the callback of a future raises, EventsExecutor ends the process.
        """
        def guarded(message: Any) -> None:
            try:
                callback(message)
            except Exception as error:
                self._logger.warning(f'the yard is listed anew: {reason_of(error)}')
                self.yard, self._pages, self._page = None, [], None  # `_look` begins
        return guarded


def _scene_of(pages: Sequence[GetBoxes.Response]) -> Scene:
    """Return the scene that all pages of a listing tell; raise SceneError."""
    first = pages[0]
    boxes = {state.box.name: Box(
        size_of(state.box), pose_of(state.box) if state.fixed or state.body else None,
        body=state.body) for page in pages for state in page.boxes}
    bodies = {body.name: Frame(pose_of(body) if body.fixed else None)
              for page in pages for body in page.bodies}
    fields: dict[str, Any] = {
        'boxes': boxes, 'bodies': bodies, 'frame_id': first.header.frame_id, 'poses': first.poses,
        'pairs': tuple(Pair(name, pair.box_a, pair.box_b)
                       for name, pair in zip(first.pair_names, first.pairs)),
        'patterns': tuple((pair.box_a, pair.box_b) for pair in first.patterns)}
    scene = Scene.as_changed(**fields)
    for name, topic in zip(scene.moving, () if scene.in_one_message else first.pose_topics):
        parts: dict[str, Any] = boxes if name in boxes else bodies
        if topic != f'{name}/pose':
            parts[name] = replace(parts[name], pose_topic=topic)
    return Scene.as_changed(**fields)

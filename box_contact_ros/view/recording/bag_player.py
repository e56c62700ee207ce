# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A recording that is played into a `ViewLog`, again and again: no ROS graph, no contact node."""
from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
from rclpy.serialization import deserialize_message
from visualization_msgs.msg import MarkerArray

from ...node.messages import read_contacts
from ...node.ros_client import (
    CONTACT_TYPES,
    CRANE_MARKERS,
    PoseTopic,
    lines_of,
    pose_topics,
    stamp_of,
)
from ...solver.checks import shown
from ..view_log import ViewLog
from .bag_file import NANOSECONDS, RecordingError, read_recording

PAUSE = 1.5  # time [s] between the end of a recording and its next beginning
STEP_SECONDS = 0.05  # a step takes, however much is due: the page and signals wait for it


class BagPlayer:
    """To the page what a `ViewNode` is, with the same `log`, `lines`, `model`, `wish`, …."""

    wish = refusal = ''
    connected = True
    force = math.nan  # of no recording

    def __init__(self, path: Path) -> None:
        """Read a recording that says its scene, or both sizes. Raises RecordingError."""
        recording = read_recording(path)
        self.model = recording.about.get('model', 'the recording')
        self.log, self._ids = ViewLog(recording.scene), recording.scene.ids
        self.lines = np.zeros((0, 2, 3))
        self._take: dict[str, Callable[[int, bytes], None]] = {
            CRANE_MARKERS: self._on_crane}
        for topic in ('contacts_cloud', 'contacts'):  # one of them; the latter has names
            kind = recording.kinds.get(topic)
            if kind in CONTACT_TYPES:
                self._take.pop('contacts_cloud', None)
                self._take[topic] = partial(self._on_contacts, CONTACT_TYPES[kind])
            elif kind is not None:
                raise RecordingError(f'{path}: {topic} is {shown(kind)}, which is none of '
                                     'contacts, or whose package is not installed')
        self._take |= {topic.name.lstrip('/'): partial(self._on_poses, topic)
                       for topic in pose_topics(recording.scene)}
        self._messages = [message for message in recording.messages if message[1] in self._take]
        if not self._messages:
            raise RecordingError(f'{path} has none of the topics of its scene')
        self._played = self._play()

    def now(self) -> int:
        """Return the recording's time [ns]."""
        return self._now

    def step(self) -> bool:
        """Play what is due; return whether the recording began anew."""
        return next(self._played)

    def close(self) -> None:
        """End: nothing was started."""

    def _play(self) -> Iterator[bool]:
        while True:
            self.log.start_anew()
            first, start = self._messages[0][0], time.monotonic()
            self._now, began, until = first, True, start + STEP_SECONDS
            for at, topic, data in self._messages:
                while self._now < at or time.monotonic() > until:
                    yield began
                    began = False
                    until = time.monotonic() + STEP_SECONDS
                    self._now = first + round(NANOSECONDS * (time.monotonic() - start))
                with contextlib.suppress(Exception):  # what a node would ignore, too
                    self._take[topic](at, data)
            end = time.monotonic() + PAUSE
            while time.monotonic() < end:
                yield False

    def _on_poses(self, topic: PoseTopic, _: int, data: bytes) -> None:
        poses = topic.read(data)
        self.log.poses(topic.boxes, poses.stamp, poses.numbers, poses.frame_id)

    def _on_contacts(self, kind: type, at: int, data: bytes) -> None:
        message = deserialize_message(data, kind)
        self.log.contacts(stamp_of(message.header), read_contacts(message, self._ids), at,
                          message.header.frame_id)

    def _on_crane(self, _: int, data: bytes) -> None:
        self.lines = lines_of(deserialize_message(data, MarkerArray))

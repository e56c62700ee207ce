"""Recordings: rosbag2 bags with MCAP storage, written and read without a ROS installation.

A recording is a folder RUN with metadata.yaml and RUN.mcap. `ros2 bag` takes the folder, Foxglove
the .mcap file: the definitions of all message types are in it. Messages are kept as the bytes (CDR)
that they came as; the time of a message is that of its receipt. No message carries the scene, or
the sizes of two boxes: they are in the bag's custom data, where they were known.
"""
from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from rosbags.rosbag2 import (
    CompressionFormat,
    CompressionMode,
    Reader,
    StoragePlugin,
    Writer,
    WriterError,
)
from rosbags.typesys import Stores, get_typestore

from ...scene.files.scene_file import parse_scene
from ...scene.scene_solver import Scene, two_boxes
from ...solver.checks import as_size, shown
from ..bench.pose_streams import Replay, Size

BAG_VERSION: Final = 9  # of rosbag2's metadata: what Jazzy writes and reads
NANOSECONDS = 1_000_000_000
POSE = 'geometry_msgs/msg/PoseStamped'
POSE_ARRAY_TYPE = 'geometry_msgs/msg/PoseArray'
TYPES = {
    'pose': POSE,
    'poses': POSE_ARRAY_TYPE,
    'contact/point': 'geometry_msgs/msg/PointStamped',
    'contact/normal': 'geometry_msgs/msg/Vector3Stamped',
    'contacts': 'sensor_msgs/msg/PointCloud2',
    'markers': 'visualization_msgs/msg/MarkerArray',
}
"""Type of a topic by the end of its name."""
TOPICS = ('box_a/pose', 'box_b/pose', 'contact/point', 'contact/normal', 'contacts')
"""What the contact node hears and says of two boxes."""
DRAWN = ('markers', 'crane/markers')
"""What Foxglove draws: see `markers`, and the crane."""


class RecordingError(ValueError):
    """A recording that cannot be written, read, or replayed; the text says which and why."""


def type_of(topic: str) -> str:
    """Return the message type of a topic, from its name; RecordingError if it tells nothing."""
    for end, kind in TYPES.items():
        if topic == end or topic.endswith(f'/{end}'):
            return kind
    raise RecordingError(f'topic {shown(topic)}: its type is known only if it ends in '
                         f'{", ".join(TYPES)}')


class Recorder:
    """Writes a recording, message by message; a recording that is not closed has no index."""

    def __init__(self, folder: Path, topics: Sequence[str], about: Mapping[str, Any],
                 kinds: Mapping[str, str] = MappingProxyType({})) -> None:
        """Begin a recording in a folder that does not exist yet.

        topics: absolute names; `kinds` are the types of those whose names do not tell. about: what
        is kept with the messages, as JSON: `size_a`, `size_b` (full extents [m]), or `scene` (its
        text), and `model`. Raises RecordingError.
        """
        types = get_typestore(Stores.ROS2_JAZZY)
        self.kinds = {topic: kinds.get(topic) or type_of(topic) for topic in topics}
        self.counts = Counter(dict.fromkeys(topics, 0))
        self.span: tuple[int, int] | None = None  # times of the first and the last message [ns]
        try:
            self._writer = Writer(folder, version=BAG_VERSION, storage_plugin=StoragePlugin.MCAP)
            self._writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
            for name, value in about.items():
                self._writer.set_custom_data(name, json.dumps(value))
            self._writer.open()
            self._connections = {
                topic: self._writer.add_connection(topic, kind, typestore=types)
                for topic, kind in self.kinds.items()}
        except (WriterError, OSError) as error:
            raise RecordingError(f'cannot record to {folder}: {error}') from error

    def write(self, topic: str, time: int, data: bytes) -> None:
        """Keep a serialised message that came at `time` [ns]."""
        self._writer.write(self._connections[topic], time, data)
        self.counts[topic] += 1
        self.span = (self.span[0] if self.span else time, time)

    def close(self) -> None:
        """Write what is still in memory, index and metadata."""
        self._writer.close()


@dataclass(frozen=True)
class Recording:
    """A recording, whole."""

    scene: Scene
    about: Mapping[str, Any]  # what was kept with the messages
    messages: Sequence[tuple[int, str, bytes]]
    """Time of receipt [ns], topic without its leading slash, bytes; in order of time."""


def read_recording(path: Path) -> Recording:
    """Return a bag that says its scene, or the sizes of its two boxes. Raises RecordingError."""
    try:
        with Reader(path) as reader:
            known = {}
            for name, value in (reader.storage.metadata.custom or {}).items():
                with suppress(ValueError):  # another program's entry need not be JSON
                    known[name] = json.loads(value)
            messages = [(at, connection.topic.lstrip('/'), data)
                        for connection, at, data in reader.messages()]
    except Exception as error:  # rosbags lets through whatever reading garbage ends in
        raise RecordingError(f'{path} cannot be read as a bag: {error}') from error
    try:
        scene = (parse_scene(known['scene'], str(path)) if 'scene' in known else
                 two_boxes(known['size_a'], known['size_b']))
    except KeyError:
        raise RecordingError(f'{path} says neither its scene nor the sizes of two boxes: record '
                             'with --scene, or with --size-a and --size-b') from None
    return Recording(scene, known, messages)


def read_replay(path: Path, topic_a: str = TOPICS[0], topic_b: str = TOPICS[1], *,
                size_a: Size | None = None, size_b: Size | None = None) -> Replay:
    """Return the pairs of poses in a bag: a folder, or an .mcap file alone.

    Sizes that are not given are those that the recording says. Raises RecordingError for what is no
    bag, lacks a topic, has no pairs, or says no sizes where none are given.
    """
    try:
        with Reader(path) as reader:
            one, other = (_poses(reader, path, topic) for topic in (topic_a, topic_b))
            known = reader.storage.metadata.custom or {}
    except RecordingError:
        raise
    except Exception as error:  # rosbags lets through whatever reading garbage ends in
        raise RecordingError(f'{path} cannot be read as a bag: {error}') from error
    stamps = sorted(one.keys() & other.keys())
    if not stamps:
        raise RecordingError(f'{path} has no two poses of equal stamp: {len(one)} stamps on '
                             f'{topic_a}, {len(other)} on {topic_b}')
    sizes = []
    for name, given in (('size_a', size_a), ('size_b', size_b)):
        if given is None and name not in known:
            option = name.replace('_', '-')
            raise RecordingError(f'{path} does not say the size of box_{name[-1]}: give --{option}')
        size = json.loads(known[name]) if given is None else given
        x, y, z = map(float, as_size(size, name).ravel())
        sizes.append((x, y, z))
    pose_a, pose_b = (np.array([poses[stamp] for stamp in stamps]) for poses in (one, other))
    return Replay(path.stem, sizes[0], sizes[1], pose_a, pose_b, np.array(stamps))


def _poses(reader: Reader, path: Path, topic: str) -> dict[int, tuple[float, ...]]:
    """Return poses `x y z qx qy qz qw` on a topic by stamp [ns]."""
    found = [c for c in reader.connections if c.topic.lstrip('/') == topic.lstrip('/')]
    if not found:
        raise RecordingError(f'{path} has no topic {shown(topic)}; it has: '
                             f'{", ".join(sorted(c.topic for c in reader.connections)) or "none"}')
    if any(c.msgtype != POSE for c in found):
        raise RecordingError(f'{path}: {topic} is {found[0].msgtype}, not {POSE}')
    types = get_typestore(Stores.ROS2_JAZZY)
    poses: dict[int, tuple[float, ...]] = {}
    for _, _, data in reader.messages(found):
        message: Any = types.deserialize_cdr(data, POSE)
        stamp, p, q = message.header.stamp, message.pose.position, message.pose.orientation
        poses[stamp.sec * NANOSECONDS + stamp.nanosec] = (p.x, p.y, p.z, q.x, q.y, q.z, q.w)
    return poses

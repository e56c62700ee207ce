# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings: rosbag2 bags with MCAP storage, written and read without a ROS installation.

A recording is a folder RUN with metadata.yaml and RUN.mcap. `ros2 bag` takes the folder, Foxglove
the .mcap file: the definitions of all message types are in it. Messages are kept as the bytes (CDR)
that they came as; the time of a message is that of its receipt. No message carries the scene, or
the sizes of two boxes: they are in the bag's custom data, where they were known.
"""
from __future__ import annotations

import json
import os
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from rosbags.interfaces import (
    Connection,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import (
    CompressionFormat,
    CompressionMode,
    Reader,
    StoragePlugin,
    Writer,
    WriterError,
)
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from ...scene.files.scene_file import SceneError, parse_scene
from ...scene.scene_solver import POSE_ARRAY, Scene, two_boxes
from ...solver.checks import as_size, pose_fault, shown
from .stream import Replay, Size

BAG_VERSION: Final = 9  # of rosbag2's metadata: what Jazzy writes and reads
NANOSECONDS = 1_000_000_000
POSE = 'geometry_msgs/msg/PoseStamped'
POSES = 'geometry_msgs/msg/PoseArray'
CONTACTS = 'box_contact_msgs/msg/Contacts'
TRANSFORMS = 'tf2_msgs/msg/TFMessage'
ALL_CONTACTS = ('contacts', 'contacts_cloud')
"""Topics of all contacts: the contact node publishes one of them, or both."""
TYPES = {
    'pose': POSE,
    'poses': POSES,
    'contact/point': 'geometry_msgs/msg/PointStamped',
    'contact/normal': 'geometry_msgs/msg/Vector3Stamped',
    'contacts': CONTACTS,
    'contacts_cloud': 'sensor_msgs/msg/PointCloud2',
    'markers': 'visualization_msgs/msg/MarkerArray',
}
"""Type of a topic by the end of its name."""
TOPICS = ('box_a/pose', 'box_b/pose', 'contact/point', 'contact/normal', *ALL_CONTACTS)
"""What the contact node hears and says of two boxes."""
DRAWN = ('markers', 'crane/markers')
"""What Foxglove draws: see `markers`, and the crane."""
FOR_EVER = QosTime(9223372036, 854775807)
LATCHED = Qos(QosHistory.KEEP_LAST, 100, QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL,
              FOR_EVER, FOR_EVER, QosLiveliness.AUTOMATIC, FOR_EVER, False)
"""Of /tf_static: `ros2 bag play` offers what the bag says, and listeners ask for this."""


class RecordingError(ValueError):
    """A recording that cannot be written, read, or replayed; the text says which and why."""


def type_of(topic: str) -> str:
    """Return the message type of a topic, from its name; RecordingError if it tells nothing."""
    for end, kind in TYPES.items():
        if topic == end or topic.endswith(f'/{end}'):
            return kind
    raise RecordingError(f'topic {shown(topic)}: its type is known only if it ends in '
                         f'{", ".join(TYPES)}')


def _types() -> Typestore:
    """Return the types that are recorded; those of contacts where their package is installed."""
    types = get_typestore(Stores.ROS2_JAZZY)
    for prefix in (*os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep), sys.prefix):
        folder = Path(prefix or '.', 'share', 'box_contact_msgs', 'msg')
        if prefix and folder.is_dir():
            for file in sorted(folder.glob('*.msg')):
                types.register(get_types_from_msg(
                    file.read_text('utf-8'), f'box_contact_msgs/msg/{file.stem}'))
            break
    return types


class Recorder:
    """Writes a recording, message by message; a recording that is not closed has no index."""

    def __init__(self, folder: Path, topics: Sequence[str], about: Mapping[str, Any],
                 kinds: Mapping[str, str] = MappingProxyType({})) -> None:
        """Begin a recording in a folder that does not exist yet.

        topics: absolute names; `kinds` are the types of those whose names do not tell. about: what
        is kept with the messages, as JSON: `size_a`, `size_b` (full extents [m]), or `scene` (its
        text), and `model`. Raises RecordingError.
        """
        types = _types()
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
                topic: self._writer.add_connection(
                    topic, kind, typestore=types,
                    offered_qos_profiles=[LATCHED] if topic.endswith('/tf_static') else [])
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
    kinds: Mapping[str, str]  # type of each topic
    messages: Sequence[tuple[int, str, bytes]]
    """Time of receipt [ns], topic, bytes; in order of time.

    Topics have the names that the scene gives them, without a leading slash.
    """


def read_recording(path: Path) -> Recording:
    """Return a bag that says its scene, or the sizes of its two boxes. Raises RecordingError."""
    with _opened(path) as reader:
        about = _about(reader, path)
        kinds = {_name_of(connection, about): connection.msgtype
                 for connection in reader.connections}
        messages = [(at, _name_of(connection, about), data)
                    for connection, at, data in reader.messages()]
    try:
        scene = (parse_scene(about['scene'], str(path)) if 'scene' in about else
                 two_boxes(about['size_a'], about['size_b']))
    except KeyError:
        raise RecordingError(f'{path} says neither its scene nor the sizes of two boxes: record '
                             'with --scene, or with --size-a and --size-b') from None
    return Recording(scene, about, kinds, messages)


@contextmanager
def _opened(path: Path) -> Iterator[Reader]:
    """Give the reader of a bag: a folder, or an .mcap file alone; or raise RecordingError."""
    for file in (path, *(path.iterdir() if path.is_dir() else ())):
        if file.exists() and not file.is_file() and not file.is_dir():
            # Opening a FIFO would wait for its writer, and /dev/zero has no end.
            raise RecordingError(f'{file} cannot be read as a bag: it is no regular file')
    try:
        with Reader(path) as reader:
            yield reader
    except (RecordingError, SceneError):
        raise
    except Exception as error:  # rosbags lets through whatever reading garbage ends in
        raise RecordingError(f'{path} cannot be read as a bag: {error}') from error


def _about(reader: Reader, path: Path) -> dict[str, Any]:
    """Return what was kept with the messages, or raise RecordingError for what cannot be that."""
    about = {}
    for name, value in (reader.storage.metadata.custom or {}).items():
        with suppress(ValueError, TypeError, RecursionError):  # another program's need not be JSON
            about[name] = json.loads(value)
    for name, kind in (('scene', str), ('model', str), ('topics', dict)):
        if name in about and not isinstance(about[name], kind):
            raise RecordingError(f'{path}: its {name} is {shown(about[name])}, no {kind.__name__}')
    for name in ('size_a', 'size_b'):
        if name in about:
            try:
                as_size(about[name], name)
            except ValueError as error:
                raise RecordingError(f'{path}: its {error}') from None
    return about


def _name_of(connection: Connection, about: Mapping[str, Any]) -> str:
    """Return what a topic is called before remapping and namespaces, without a leading slash."""
    return str(about.get('topics', {}).get(connection.topic, connection.topic)).lstrip('/')


@dataclass(frozen=True)
class _Side:
    """Where the poses of one box of a replay are."""

    name: str  # of the box
    topic: str
    size: Sequence[float] | None  # full extents [m], where they are known
    pose: tuple[float, ...] | None = None  # of a fixed box
    array: tuple[str, ...] = ()  # the boxes of each message, where it is a PoseArray


def read_replay(path: Path, topic_a: str = '', topic_b: str = '', *, pair: str = '',
                size_a: Size | None = None, size_b: Size | None = None) -> Replay:
    """Return the pairs of poses in a bag: a folder, or an .mcap file alone.

    They are those of a pair of the recorded scene (default: the first), or those on two topics
    (default: box_a/pose, box_b/pose). Sizes that are not given are those that the recording says.
    Raises RecordingError for what is not a bag, lacks a topic or the pair, or has no two poses of
    equal stamp. Sizes that are neither given nor in the bag raise it, too.
    """
    with _opened(path) as reader:
        about = _about(reader, path)
        if pair or ('scene' in about and not topic_a and not topic_b):
            sides = _of_pair(path, about, pair)
        else:
            sides = [_Side(f'box_{box}', topic or f'box_{box}/pose', about.get(f'size_{box}'))
                     for box, topic in (('a', topic_a), ('b', topic_b))]
        found = [{} if side.pose else _poses(reader, path, about, side) for side in sides]
    for side, other, poses in zip(sides, found[::-1], found):
        poses |= dict.fromkeys(other, side.pose) if side.pose else {}
    stamps = sorted(found[0].keys() & found[1].keys())
    if not stamps:
        raise RecordingError(f'{path} has no two poses of equal stamp: ' + ', '.join(
            f'{len(poses)} stamps on {side.topic}' for side, poses in zip(sides, found)))
    sizes = []
    for box, side, given in (('a', sides[0], size_a), ('b', sides[1], size_b)):
        size = side.size if given is None else given
        if size is None:
            raise RecordingError(f'{path} does not say the size of box_{box}: give --size-{box}')
        x, y, z = map(float, as_size(size, f'size_{box}').ravel())
        sizes.append((x, y, z))
    pose_a, pose_b = (np.array([poses[stamp] for stamp in stamps]) for poses in found)
    return Replay(path.stem, sizes[0], sizes[1], pose_a, pose_b, np.array(stamps))


def _of_pair(path: Path, about: Mapping[str, Any], name: str) -> list[_Side]:
    """Return the boxes of a pair of the recorded scene; the first pair, where `name` is empty."""
    if 'scene' not in about:
        raise RecordingError(f'{path} does not say its scene, and so no pair {shown(name)}: record '
                             'with --scene, or give --topic-a and --topic-b')
    scene = parse_scene(about['scene'], str(path))
    pairs = {pair.name: pair for pair in scene.pairs}
    if name and name not in pairs:
        near = ' or '.join(get_close_matches(name, pairs))
        raise RecordingError(f'the scene of {path} has no pair {shown(name)}'
                             + (f' (did you mean {near}?)' if near else ''))
    pair = pairs[name] if name else scene.pairs[0]
    for box in (pair.a, pair.b):
        if box in scene.frames:
            raise RecordingError(f'{path}: {box} is frame {shown(scene.frames[box])} in /tf: pairs '
                                 'are replayed from pose topics alone')
    return [_Side(box, scene.sources.get(box, POSE_ARRAY), scene.boxes[box].size,
                  scene.boxes[box].pose, scene.moving if scene.pose_array else ())
            for box in (pair.a, pair.b)]


def _poses(reader: Reader, path: Path, about: Mapping[str, Any], side: _Side,
           ) -> dict[int, tuple[float, ...]]:
    """Return poses `x y z qx qy qz qw` of a box by stamp [ns], the valid ones alone."""
    found = [c for c in reader.connections
             if side.topic.lstrip('/') in (c.topic.lstrip('/'), _name_of(c, about))]
    if not found:
        raise RecordingError(f'{path} has no topic {shown(side.topic)}; it has: '
                             f'{", ".join(sorted(c.topic for c in reader.connections)) or "none"}')
    kind = POSES if side.array else POSE
    if any(c.msgtype != kind for c in found):
        raise RecordingError(f'{path}: {side.topic} is {found[0].msgtype}, not {kind}')
    types = get_typestore(Stores.ROS2_JAZZY)
    poses: dict[int, tuple[float, ...]] = {}
    for _, _, data in reader.messages(found):
        message: Any = types.deserialize_cdr(data, kind)
        if side.array and len(message.poses) != len(side.array):
            continue  # the contact node refuses it
        pose = message.poses[side.array.index(side.name)] if side.array else message.pose
        stamp, p, q = message.header.stamp, pose.position, pose.orientation
        numbers = (p.x, p.y, p.z, q.x, q.y, q.z, q.w)
        if pose_fault(numbers) is None:
            poses[stamp.sec * NANOSECONDS + stamp.nanosec] = numbers
    return poses

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What clients of the contact node need of rclpy: topics of a scene, messages as numbers."""
from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from geometry_msgs.msg import Point, PointStamped, PoseArray, PoseStamped, Vector3Stamped
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from ..core import LENGTH_MAX
from ..resources import find_file
from ..scene.files.scene_file import read_scene
from ..scene.scene_solver import ALL_BOXES, Scene
from ..scene.stamp_pairing import StampedPose
from ..solver.checks import are_poses
from .message_bytes import RawMessages
from .messages import NANOSECONDS, ContactsMessage, Refused, read_contacts
from .topics.scene_topics import pose_input

ANSWERS: dict[str, tuple[type, str]] = {
    'point': (PointStamped, 'contact/point'),
    'normal': (Vector3Stamped, 'contact/normal'),
    'cloud': ((PointCloud2, 'contacts_cloud') if ContactsMessage is None else
              (ContactsMessage, 'contacts')),
}
"""Type and topic of what a contact node answers with, by the kinds of an `AnswerLog`."""
CONTACT_TYPES: dict[str, type] = {'sensor_msgs/msg/PointCloud2': PointCloud2} | (
    {} if ContactsMessage is None else {'box_contact_msgs/msg/Contacts': ContactsMessage})
"""Messages of all contacts that can be read here, by the names of their types."""
CRANE_MARKERS = 'crane/markers'
CRANE_WRENCH = 'crane/wrench'
"""Where the crane publishes its ropes and its spreader, as lines."""
MOST_ENDS = 10_000  # of lines that are drawn of a crane
DEEP_RELIABLE = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
"""What the DDS layer delivers while Python is busy must not push out the rest."""


class PoseTopic(NamedTuple):
    """A topic that a scene's poses come on."""

    name: str
    kind: type  # of its messages
    qos: QoSProfile
    boxes: Sequence[str]
    read: Callable[[bytes], StampedPose]
    """Return the poses (n, 7) of these boxes, NaN for one that is not there; or raise Refused."""


def pose_topics(scene: Scene) -> list[PoseTopic]:
    """Return how the poses of all moving boxes come, in the scene's order."""
    found = []
    for source, topic in scene.sources.items():
        is_array = source == ALL_BOXES
        boxes, read = (scene.moving, _read_array) if is_array else ((source,), _read_one)
        # Each topic has a reader of its own, which knows the topic's frame.
        found.append(PoseTopic(topic, *pose_input(source), boxes,
                               partial(read, RawMessages(), len(boxes))))
    return found


def _read_one(messages: RawMessages, _: int, data: bytes) -> StampedPose:
    pose = messages.read_pose(data)
    return pose._replace(numbers=pose.numbers[None])


def _read_array(messages: RawMessages, count: int, data: bytes) -> StampedPose:
    """Return the poses of so many boxes. A bad pose becomes NaN: the contact node reports it."""
    poses = messages.read_poses(data)
    if len(poses.numbers) != count:
        raise Refused('wrong number of poses',
                      f'{len(poses.numbers)} poses, but {count} boxes of the scene move')
    poses.numbers[~are_poses(poses.numbers)] = np.nan
    return poses


def subscribe_contacts(node: Node, callback: Callable[[Any], None], qos: QoSProfile) -> None:
    """Subscribe to all contacts, `Contacts` or the point cloud: whichever the contact node sends.

    Where it sends both, `callback` gets `Contacts` alone.
    """
    named = False

    def on_contacts(message: Any) -> None:
        nonlocal named
        named = True
        callback(message)

    def on_cloud(message: PointCloud2) -> None:
        if not named:
            callback(message)

    if ContactsMessage is not None:
        node.create_subscription(ContactsMessage, 'contacts', on_contacts, qos)
    node.create_subscription(PointCloud2, 'contacts_cloud', on_cloud, qos)


def first_row(rows: np.ndarray) -> np.ndarray:
    """Return the numbers of the first row (messages.CLOUD_ROW); none without rows.

    Point and normal are columns 0 to 5, the depth 6, the volume 7, the covariance 8 to 13.
    """
    names = rows.dtype.names or ()
    of_float64 = names[names.index('pair') + 1:]
    return np.array([rows[0][name] for name in of_float64] if len(rows) else [])


def answer_values(kind: str, message: Any) -> Sequence[float] | np.ndarray:
    """Return the numbers of an answer of two boxes; of contacts those of their `first_row`."""
    if kind == 'cloud':
        return first_row(read_contacts(message))
    vector = message.point if kind == 'point' else message.vector
    return vector.x, vector.y, vector.z


def read_scene_text(source: str) -> tuple[str, Scene]:
    """Return the text of a scene that is a file, or a text itself, and the scene; SceneError."""
    scene = read_scene(source)
    path = find_file(source)
    return path.read_text('utf-8') if path.is_file() else source, scene


def make_marker(header: Header, name: str, kind: int, colour: tuple[int, int, int],
                opacity: float = 1.0, *, number: int = 0) -> Marker:
    """Return a marker of a kind (`Marker.CUBE`, ...) without pose and scale; colour: 0 to 255."""
    red, green, blue = (value / 255.0 for value in colour)
    return Marker(header=header, ns=name, id=number, type=kind, action=Marker.ADD,
                  color=ColorRGBA(r=red, g=green, b=blue, a=opacity))


def line_marker(header: Header, name: str, lines: np.ndarray, *, width: float,
                colour: tuple[int, int, int]) -> Marker:
    """Return the marker of straight lines with ends (n, 2, 3) [m]; colour: 0 to 255."""
    marker = make_marker(header, name, Marker.LINE_LIST, colour)
    marker.scale.x = float(width)
    marker.points = [Point(x=x, y=y, z=z) for x, y, z in lines.reshape(-1, 3).tolist()]
    return marker


def lines_of(message: MarkerArray) -> np.ndarray:
    """Return the ends (n, 2, 3) [m] of all lines of a `line_marker`, or raise Refused."""
    lines = [marker.points for marker in message.markers if marker.type == Marker.LINE_LIST]
    count = sum(map(len, lines))
    if count > MOST_ENDS:
        raise Refused('bad lines', f'{count} ends of lines; at most {MOST_ENDS}')
    ends = np.array([(point.x, point.y, point.z) for points in lines for point in points])
    if count % 2 or not (np.abs(ends) <= LENGTH_MAX).all():
        raise Refused('bad lines', 'a line has one end, or ends nowhere')
    return ends.reshape(-1, 2, 3)


def stamp_of(header: Header) -> int:
    """Return a header's stamp [ns]."""
    return int(header.stamp.sec) * NANOSECONDS + int(header.stamp.nanosec)


def pose_message(header: Header, pose: np.ndarray) -> PoseStamped:
    """Return the message of a pose `x y z qx qy qz qw`."""
    message = PoseStamped(header=header)
    set_pose(message.pose, pose)
    return message


def array_message(header: Header, poses: Sequence[np.ndarray]) -> PoseArray:
    """Return the message of many poses `x y z qx qy qz qw`."""
    return PoseArray(header=header, poses=[pose_message(header, pose).pose for pose in poses])


def set_pose(pose: Any, numbers: np.ndarray) -> None:
    """Write a pose `x y z qx qy qz qw` into a geometry_msgs/Pose."""
    p, q = pose.position, pose.orientation
    p.x, p.y, p.z, q.x, q.y, q.z, q.w = map(float, numbers)

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What clients of the contact node need of rclpy: topics of a scene, messages as numbers."""
from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from geometry_msgs.msg import PoseArray, PoseStamped
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Header

from ..scene.pairing import StampedPose
from ..scene.scene import ALL_BOXES, Scene
from ..solver.checks import are_poses
from .message_bytes import PoseReader
from .messages import NANOSECONDS, MessageError
from .topics import pose_qos

CRANE_WRENCH = 'crane/wrench'  # where the crane publishes the force of the contacts on its load
DEEP_RELIABLE = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
"""What the DDS layer delivers while Python is busy must not push out the rest."""


class PoseTopic(NamedTuple):
    """A topic that a scene's poses come on."""

    name: str
    kind: type  # of its messages
    qos: QoSProfile
    names: Sequence[str]  # of boxes or bodies
    read: Callable[[bytes], StampedPose]
    """Return the poses (n, 7) of these names, NaN for one that is not there.

    Raises MessageError.
    """


def pose_topics(scene: Scene) -> list[PoseTopic]:
    """Return how the poses of all that moves come, in the scene's order."""
    topics = []
    for source, topic in scene.sources.items():
        is_array = source == ALL_BOXES
        names, read = (scene.moving, _read_array) if is_array else ((source,), _read_one)
        # Each topic has a reader of its own, which knows the topic's frame.
        topics.append(PoseTopic(topic, PoseArray if is_array else PoseStamped, pose_qos(source),
                                names, partial(read, PoseReader(), len(names))))
    return topics


def _read_one(reader: PoseReader, _: int, data: bytes) -> StampedPose:
    pose = reader.read_pose(data)
    return pose._replace(numbers=np.array([pose.numbers]))


def _read_array(reader: PoseReader, count: int, data: bytes) -> StampedPose:
    """Return so many poses. A bad pose becomes NaN: the contact node reports it."""
    poses = reader.read_poses(data)
    if len(poses.numbers) != count:
        raise MessageError('wrong number of poses',
                           f'{len(poses.numbers)} poses, but {count} boxes and bodies of the scene '
                           'move')
    poses.numbers[~are_poses(poses.numbers)] = np.nan
    return poses


def stamp_of(header: Header) -> int:
    """Return a header's stamp [ns]."""
    return int(header.stamp.sec) * NANOSECONDS + int(header.stamp.nanosec)


def pose_message(header: Header, pose: np.ndarray) -> PoseStamped:
    """Return the message of a pose `x y z qx qy qz qw`."""
    message = PoseStamped(header=header)
    set_pose(message.pose, pose)
    return message


def set_pose(pose: Any, numbers: np.ndarray) -> None:
    """Write a pose `x y z qx qy qz qw` into a geometry_msgs/Pose."""
    p, q = pose.position, pose.orientation
    p.x, p.y, p.z, q.x, q.y, q.z, q.w = map(float, numbers)

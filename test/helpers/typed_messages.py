# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The oracle of messages: what the node reads and writes as bytes, by rclpy's message objects."""
from __future__ import annotations

import struct
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import chain, repeat
from typing import Any

import numpy as np
from geometry_msgs.msg import (
    Point,
    PointStamped,
    Pose,
    PoseStamped,
    Quaternion,
    Transform,
    Vector3,
    Vector3Stamped,
)
from rclpy.serialization import serialize_message
from sensor_msgs.msg import MultiDOFJointState
from std_msgs.msg import Header

from box_contact_msgs.msg import Box, BoxPair, Code, Contacts
from box_contact_msgs.msg import Contact as ContactMessage
from box_contact_msgs.msg import Near as NearMessage
from box_contact_ros.node.messages import make_header
from box_contact_ros.node.paced_service import refuse
from box_contact_ros.scene.scene import Pair
from box_contact_ros.solver.checks import pose_fault
from box_contact_ros.solver.contact import FIELDS, Contact
from box_contact_ros.solver.nearest import Nearest
from box_contact_ros.stream.cdr import NANOSECONDS, MessageError
from box_contact_ros.stream.pairing import StampedPose
from box_contact_ros.stream.read_contacts import UPPER, ReadContacts, read_contacts

NUMBERS = {'double': 'd', 'int32': 'i', 'uint32': 'I', 'uint64': 'Q'}
"""Formats of `struct` by the kinds of fields."""
TOLD = FIELDS[:-1]
"""What a message says of a contact: all but its axis."""


def answered(request: Any, response: Any, answer: Callable[[Any, Any], Iterable[None] | None],
             ) -> Any:
    """Return a response as the node sends it; `answer` fills it in, in steps or at once."""
    try:
        deque(answer(request, response) or (), maxlen=0)
    except ValueError as error:
        refuse(response, error)
    else:
        response.success, response.code.value = True, Code.OK
    return response


def pose_stamped(numbers: Iterable[float], frame_id: str, stamp: int) -> PoseStamped:
    """Return the message of a pose `x y z qx qy qz qw`; stamp [ns]."""
    return PoseStamped(header=make_header(stamp, frame_id), pose=_pose(numbers))


def joint_state(poses: Mapping[str, Iterable[float]], frame_id: str, stamp: int,
                ) -> MultiDOFJointState:
    """Return the message of poses by name; stamp [ns]."""
    moved = [_pose(row) for row in poses.values()]
    return MultiDOFJointState(
        header=make_header(stamp, frame_id), joint_names=list(poses),
        transforms=[Transform(translation=Vector3(x=p.position.x, y=p.position.y, z=p.position.z),
                              rotation=p.orientation) for p in moved])


def a_box(name: str, pose: Iterable[float], size: Iterable[float] = (0.0, 0.0, 0.0)) -> Box:
    """Return a box of a request; without a size it is the scene's."""
    return Box(name=name, size=_vector(np.array(tuple(size))), pose=_pose(pose))


def a_pair(box_a: str, box_b: str) -> BoxPair:
    """Return a pair of a request."""
    return BoxPair(box_a=box_a, box_b=box_b)


def unset(message: Any, name: str = 'message') -> list[str]:
    """Return the fields of a message, and of its parts, that are 0 or empty as a new one's are."""
    if isinstance(message, Sequence) and not isinstance(message, str):
        return [f for row, part in enumerate(message) for f in unset(part, f'{name}[{row}]')] or (
            [] if len(message) else [name])
    if hasattr(message, 'get_fields_and_field_types'):
        return [found for field in message.get_fields_and_field_types()
                for found in unset(getattr(message, field), f'{name}.{field}')]
    if isinstance(message, np.ndarray):
        return [] if message.all() else [name]
    return [] if message else [name]


def _pose(numbers: Iterable[float]) -> Pose:
    x, y, z, qx, qy, qz, qw = map(float, numbers)
    return Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw))


def read_pose(message: PoseStamped) -> StampedPose:
    """Return the pose of a message, or raise MessageError."""
    numbers = _numbers(message.pose.position, message.pose.orientation)
    pose = _stamped(np.array(numbers), message.header)
    fault = pose_fault(numbers)
    if fault:
        raise MessageError('bad pose', fault)
    return pose


def read_named(moving: Sequence[str], message: MultiDOFJointState) -> StampedPose:
    """Return the poses (n, 7) of what moves, NaN for the rest, or raise MessageError."""
    names, transforms = message.joint_names, message.transforms
    if len(names) != len(transforms):
        raise MessageError('not a MultiDOFJointState', 'names and transforms differ in number')
    numbers = np.full((len(moving), 7), np.nan)
    stamped = _stamped(numbers, message.header)
    for row, name in enumerate(moving):
        if names.count(name) > 1:
            raise MessageError('doubled name', name)
        if name in names:
            transform = transforms[names.index(name)]
            numbers[row] = _numbers(transform.translation, transform.rotation)
    return stamped


def _numbers(p: Point | Vector3, q: Quaternion) -> Sequence[float]:
    return p.x, p.y, p.z, q.x, q.y, q.z, q.w


def _stamped(numbers: np.ndarray, header: Header) -> StampedPose:
    if header.stamp.nanosec >= NANOSECONDS:
        raise MessageError('bad header', 'a second or more of nanoseconds')
    if '\N{REPLACEMENT CHARACTER}' in header.frame_id:  # what rclpy makes of other bytes
        raise MessageError('bad header', 'frame_id is not UTF-8')
    if len(header.frame_id.encode()) > 255:
        raise MessageError('bad header', 'frame_id is too long')
    return StampedPose(numbers, header.frame_id,
                       header.stamp.sec * NANOSECONDS + header.stamp.nanosec)


def as_bytes(message: Any) -> bytes:
    """Return a message as it is sent, padding zero: rclpy leaves there what was in memory."""
    body = bytearray()
    _append(body, message, '')
    body += b'\0' * (-len(body) % 4)
    sent = serialize_message(message)
    assert len(sent) + -len(sent) % 4 == 4 + len(body)
    return b'\0\1\0\0' + bytes(body)


def _append(body: bytearray, value: Any, kind: str) -> None:
    """Append a value of a kind to the body of a message, as CDR lays it out."""
    if kind in NUMBERS:
        data = struct.pack(f'<{NUMBERS[kind]}', value)
        body += b'\0' * (-len(body) % len(data)) + data
    elif kind == 'string':
        data = value.encode() + b'\0'
        _append(body, len(data), 'uint32')
        body += data
    elif kind.endswith(('>', ']')):
        if kind.endswith('>'):
            _append(body, len(value), 'uint32')
        for part in value:
            _append(body, part, kind.removeprefix('sequence<').rstrip('>]6['))
    else:
        for name, of_part in value.get_fields_and_field_types().items():
            _append(body, getattr(value, name), of_part)


def make_point(header: Header, contact: Contact) -> PointStamped:
    """Return `contact/point`."""
    return PointStamped(header=header, point=_point(contact.point))


def make_normal(header: Header, contact: Contact) -> Vector3Stamped:
    """Return `contact/normal`."""
    return Vector3Stamped(header=header, vector=_vector(contact.normal))


def make_contacts(header: Header, listed: Iterable[tuple[Pair, Contact]],
                  stale: Iterable[str] = (), near: Iterable[tuple[Pair, Nearest]] = (),
                  areas: Iterable[float] = ()) -> Contacts:
    """Return `contacts`: the pairs in contact, those near, and the names of the stale.

    areas: of the patches in contact; 0 where there are none.
    """
    return Contacts(header=header, stale=list(stale), contacts=_entries(listed, areas),
                    near=[NearMessage(pair=pair.label, box_a=pair.a, box_b=pair.b,
                                      distance=float(n.distance), normal=_vector(n.normal),
                                      point_a=_point(n.point_a), point_b=_point(n.point_b))
                          for pair, n in near])


def read(message: Contacts) -> ReadContacts:
    """Return what a message says, as a client reads its bytes."""
    return read_contacts(serialize_message(message))


def contacts_by_pair(message: Contacts) -> dict[str, Contact]:
    """Return what touches by a message, by the names of the pairs."""
    answer = read(message)
    return {name: contact for (name, _, _), contact in zip(
        answer.names, answer.contacts)}


def _entries(listed: Iterable[tuple[Pair, Contact]], areas: Iterable[float],
             ) -> list[ContactMessage]:
    return [ContactMessage(
        pair=pair.label, box_a=pair.a, box_b=pair.b, point=_point(c.point),
        normal=_vector(c.normal), depth=-float(c.separation), volume=float(c.volume),
        area=area, covariance=c.covariance[UPPER])
        for (pair, c), area in zip(listed, chain(areas, repeat(0.0)))]


def contacts_at(stamp: int, touching: Mapping[Pair, Contact], stale: Sequence[str] = (),
                near: Mapping[Pair, Nearest] | None = None) -> Contacts:
    """Return `contacts` of what touches and what is near at a stamp [ns], in the frame `yard`."""
    return make_contacts(make_header(stamp, 'yard'), touching.items(), stale, (near or {}).items())


def changed(contact: Contact, **numbers: Any) -> Contact:
    """Return a contact with some other numbers."""
    return Contact(**{name: getattr(contact, name) for name in FIELDS} | numbers)


def _point(numbers: np.ndarray) -> Point:
    x, y, z = map(float, numbers)
    return Point(x=x, y=y, z=z)


def _vector(numbers: np.ndarray) -> Vector3:
    x, y, z = map(float, numbers)
    return Vector3(x=x, y=y, z=z)

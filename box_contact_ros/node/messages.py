# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""box_contact_msgs as the contacts and answers that Python has, and back.

What the node sends on topics the core writes as bytes: `stream.write_contacts`. An answer of a
service is filled in here: to read it from such bytes takes nine times as long.
"""
from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped
from std_msgs.msg import Header

from box_contact_msgs.msg import Box
from box_contact_msgs.msg import Contact as ContactMessage
from box_contact_msgs.msg import Near as NearMessage

from ..core import native
from ..scene.scene import Scene
from ..scene.scene_check import Row
from ..solver.checks import name_fault, short_repr
from ..solver.contact import Contacts
from ..solver.nearest import Nearests
from ..stream.cdr import CONTACT, NANOSECONDS
from ..stream.pairing import frames_differ


def make_header(stamp: int, frame_id: str) -> Header:
    """Return the header of a stamp [ns]."""
    return Header(stamp=Time(sec=stamp // NANOSECONDS, nanosec=stamp % NANOSECONDS),
                  frame_id=frame_id)


def stamp_of(header: Header) -> int:
    """Return a header's stamp [ns]."""
    return int(header.stamp.sec) * NANOSECONDS + int(header.stamp.nanosec)


def pose_message(header: Header, pose: np.ndarray) -> PoseStamped:
    """Return the message of a pose `x y z qx qy qz qw`."""
    message = PoseStamped(header=header)
    set_pose(message.pose, pose)
    return message


def pose_of(box: Box) -> Row:
    """Return `x y z qx qy qz qw` of a box."""
    p, q = box.pose.position, box.pose.orientation
    return p.x, p.y, p.z, q.x, q.y, q.z, q.w


def size_of(box: Box) -> Row:
    """Return the full extents of a box [m]; zeros: those of the scene's box of its name."""
    return box.size.x, box.size.y, box.size.z


def check_frame(frame_id: str, scene: Scene) -> None:
    """Raise ValueError for the frame of a request that is not that of the scene."""
    if fault := name_fault(frame_id):
        raise ValueError(f'header.frame_id: {short_repr(frame_id)} {fault}')
    if scene.frame_id not in ('', frame_id):
        raise ValueError('header.frame_id: ' + frames_differ(
            'the scene', scene.frame_id, 'the request', frame_id))


def set_pose(pose: Any, numbers: Sequence[float] | np.ndarray) -> None:
    """Write a pose `x y z qx qy qz qw` into a geometry_msgs/Pose."""
    p, q = pose.position, pose.orientation
    p.x, p.y, p.z, q.x, q.y, q.z, q.w = map(float, numbers)


def near_messages(names: Sequence[tuple[str, str, str]], near: Nearests) -> list[NearMessage]:
    """Return the messages of pairs that are near, by the names of the pair and its boxes."""
    messages = []
    rows = np.column_stack((near.distance, near.normal, near.point_a, near.point_b))
    for name, row in zip(names, rows.tolist()):
        message = NearMessage()
        message.pair, message.box_a, message.box_b = name
        n, p, q = message.normal, message.point_a, message.point_b
        message.distance, n.x, n.y, n.z, p.x, p.y, p.z, q.x, q.y, q.z = row
        messages.append(message)
    return messages


class KeptMessages:
    """Messages of contacts, which are kept and filled anew: to make them takes most of the time."""

    def __init__(self, most: int) -> None:
        """Begin without a message; `most` may be filled at once."""
        self._messages: list[ContactMessage] = []
        self._covariance = np.zeros((most, 6))  # a row for each message, which refers to it

    def fill(self, names: Sequence[tuple[str, str, str]], contacts: Contacts, areas: np.ndarray,
             ) -> list[ContactMessage]:
        """Return the messages of contacts, by the names of their pair and its boxes.

        areas: (k,) by which their faces meet [m²]. The next call overwrites the messages.
        """
        while len(self._messages) < len(names):
            row = self._covariance[len(self._messages)]
            self._messages.append(ContactMessage(covariance=row))
        numbers = native.message_numbers(contacts.point, contacts.normal, contacts.separation,
                                         contacts.volume, contacts.covariance, areas)
        covariance = CONTACT['covariance']
        self._covariance[:len(names)] = numbers[:, -covariance:]
        for message, name, row in zip(self._messages, names, numbers[:, :-covariance].tolist()):
            message.pair, message.box_a, message.box_b = name
            p, n = message.point, message.normal
            p.x, p.y, p.z, n.x, n.y, n.z, message.depth, message.volume, message.area = row
        return self._messages[:len(names)]

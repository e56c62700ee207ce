# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What clients read: box_contact_msgs/Contacts as the contacts and answers that Python has.

The node itself reads and writes bytes: `message_bytes`.
"""
from __future__ import annotations

from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from std_msgs.msg import Header

from ..scene.scene_solver import ALONE, Answer, Scene
from ..solver.checks import short_repr
from ..solver.contact import Contact, Contacts

NANOSECONDS = 1_000_000_000
UPPER = np.triu_indices(3)
"""Places of the six numbers of a message's covariance: xx xy xz yy yz zz."""


class Refused(ValueError):
    """A message that is not taken; `reason` is what it is counted as."""

    def __init__(self, reason: str, text: str) -> None:
        super().__init__(text)
        self.reason = reason


def make_header(stamp: int, frame_id: str) -> Header:
    """Return the header of a stamp [ns]."""
    return Header(stamp=Time(sec=stamp // NANOSECONDS, nanosec=stamp % NANOSECONDS),
                  frame_id=frame_id)


def contacts_by_pair(message: Any) -> dict[str, Contact]:
    """Return the contacts of a `Contacts` message by the names of their pairs.

    Numbers are those that the node computed, to the bit. Pairs that are close do not collide.
    """
    return {entry.pair: _contact(entry) for entry in message.contacts}


def read_answer(message: Any, scene: Scene) -> Answer:
    """Return the answer that a `Contacts` message tells, as `SceneLaw` holds it.

    scene: that of the node. Raises Refused for a pair that the scene lacks.
    """
    index, rows = scene.index_of, {pair.label: row for pair, row in zip(scene.pairs, scene.rows)}
    if scene.patterns:
        rows = {name: (number, ALONE) for name, number in index.items()} | rows
    pairs = [(index.get(entry.box_a, ALONE), index.get(entry.box_b, ALONE))
             for entry in message.contacts]
    for name, is_known in (*((entry.pair, min(pair) >= 0 and scene.has_pair(*pair))
                             for entry, pair in zip(message.contacts, pairs)),
                           *((name, name in rows) for name in message.stale)):
        if not is_known:
            raise Refused('unknown pair', f'{short_repr(name)} is no pair of the scene: read the '
                                          'scene file that the node has')
    boxes, stale = (np.array(part, np.int64).reshape(-1, 2)
                    for part in (pairs, [rows[name] for name in message.stale]))
    contacts = [_contact(entry) for entry in message.contacts]
    return Answer(boxes, Contacts.of(contacts), len(boxes), stale, scene)


def _contact(entry: Any) -> Contact:
    """Return the contact of a `Contact` message."""
    covariance = np.empty((3, 3))
    covariance[UPPER] = covariance.T[UPPER] = entry.covariance
    point, normal = (np.array([vector.x, vector.y, vector.z])
                     for vector in (entry.point, entry.normal))
    return Contact(not np.isnan(point[0]), -entry.depth, normal, point, entry.volume, covariance)

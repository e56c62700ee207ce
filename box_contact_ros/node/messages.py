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

from ..scene.scene_solver import Answer, Scene
from ..solver.checks import short_repr
from ..solver.contact import Contact

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
    pair_of = {pair.label: pair for pair in scene.pairs}
    for name in (*(entry.pair for entry in message.contacts), *message.stale):
        if name not in pair_of:
            raise Refused('unknown pair', f'{short_repr(name)} is no pair of the scene: read the '
                                          'scene file that the node has')
    listed = [(pair_of[name], contact) for name, contact in contacts_by_pair(message).items()]
    return Answer([entry for entry in listed if entry[1].colliding],
                  [pair_of[name] for name in message.stale], len(listed),
                  [entry for entry in listed if not entry[1].colliding])


def _contact(entry: Any) -> Contact:
    """Return the contact of a `Contact` message."""
    covariance = np.empty((3, 3))
    covariance[UPPER] = covariance.T[UPPER] = entry.covariance
    point, normal = (np.array([vector.x, vector.y, vector.z])
                     for vector in (entry.point, entry.normal))
    return Contact(not np.isnan(point[0]), -entry.depth, normal, point, entry.volume, covariance)

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Contacts as the bytes of messages: a point, a normal, and `Contacts` of all pairs."""
from __future__ import annotations

from functools import lru_cache

import numpy as np

from ..core import native
from ..scene.scene import Pair, Scene
from ..scene.scene_solver import Answer
from ..solver.nearest import Nearests
from .cdr import (
    CONTACT_BYTES,
    COUNT,
    ENCAPSULATION,
    HEAD,
    LITTLE,
    MOST_NAMES,
    NANOSECONDS,
    NEAR_BYTES,
    REVISION,
)

VECTOR_BYTES = 8 * 3


class ContactWriter:
    """Makes the messages of one scene; the bytes of its names are made once."""

    def __init__(self, scene: Scene) -> None:
        self._names_of = lru_cache(MOST_NAMES)(
            lambda a, b, at: _names(scene.pair_of(a, b), at))

    def contacts(self, header: bytes, answer: Answer) -> bytes:
        """Return the `Contacts` of an answer."""
        contacts = answer.contacts
        numbers = native.message_numbers(contacts.point, contacts.normal, contacts.separation,
                                         contacts.volume, contacts.covariance).tobytes()
        parts, at = [aligned(header), REVISION.pack(answer.revision)], 0
        for pairs, body, size in (
                (answer.pairs, numbers, CONTACT_BYTES),
                (answer.near_pairs, near_numbers(answer.near).tobytes(), NEAR_BYTES)):
            parts.append(COUNT.pack(len(pairs)))
            at, end = (at + COUNT.size) % 8, 0
            for a, b in pairs.tolist():
                begin, end = end, end + size
                parts += self._names_of(a, b, at), body[begin:end]
                at = 0  # doubles end each entry, so the next one begins at a multiple of 8
        stale = answer.named_stale()
        parts.append(COUNT.pack(len(stale)))
        parts.append(b''.join([_string(pair.label) for pair in stale]))
        return b''.join(parts)


def near_numbers(near: Nearests) -> np.ndarray:
    """Return rows (n, 10) as `Near` has them: distance, normal, point_a, point_b."""
    return np.column_stack((near.distance, near.normal, near.point_a, near.point_b))


def header_bytes(stamp: int, frame_id: str) -> bytes:
    """Return the encapsulation and the header of a stamp [ns]."""
    return HEAD.pack(LITTLE, *divmod(stamp, NANOSECONDS)) + _string(frame_id)


def aligned(data: bytes) -> bytes:
    """Return the start of a message, padded so that doubles may follow.

    Behind a header, three make a PointStamped or a Vector3Stamped. So does a revision follow.
    """
    return data + b'\0' * ((ENCAPSULATION - len(data)) % 8)


@lru_cache  # of the frame, in each tick
def _string(text: str) -> bytes:
    """Return a string with its length before it, and padded to a multiple of 4 behind it."""
    data = text.encode() + b'\0'
    return COUNT.pack(len(data)) + data + b'\0' * (-len(data) % 4)


def _names(pair: Pair, at: int) -> bytes:
    """Return the names that an entry begins with, padded so that doubles may follow.

    at: where they begin, by the distance from a multiple of 8: 0 or 4.
    """
    names = b''.join(map(_string, (pair.label, pair.a, pair.b)))
    return names + b'\0' * (-(at + len(names)) % 8)

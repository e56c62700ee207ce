# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A `Contacts` message as arrays, from the bytes of a subscription with `raw=True`.

rclpy makes an object of each point and normal, which takes some ten times as long.
"""
from __future__ import annotations

import struct
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from ..solver.contact import Contacts
from .cdr import (
    CONTACT_BYTES,
    ENCAPSULATION,
    FRAME_AT,
    MOST_NAMES,
    NANOSECONDS,
    PADDING,
    MessageError,
    parse_frame,
    parse_head,
)

UPPER = np.triu_indices(3)
"""Places of the six numbers of a message's covariance: xx xy xz yy yz zz."""
NAMES = 3  # that a contact begins with: those of the pair and of its boxes


class ReadContacts(NamedTuple):
    """What a `Contacts` message says; numbers are those that the node computed, to the bit."""

    stamp: int  # of the header [ns]
    frame_id: str
    names: list[tuple[str, str, str]]
    """(k,) of each pair: its name, and those of its boxes A and B."""
    contacts: Contacts
    """(k,) those of pairs in contact, then those of pairs that are near; `axis` is -1."""
    touching: int  # how many are in contact: the first rows
    stale: list[str]  # names of the pairs, or boxes, that could not be answered
    revision: int  # of the node's scene


def read_contacts(data: bytes) -> ReadContacts:
    """Return what a serialised `Contacts` message says; raises ValueError for other bytes."""
    data = bytes(data)
    order, sec, nanosec, length = parse_head(data, 'Contacts')
    frame_id = parse_frame(data, length, 'Contacts')
    count_at = struct.Struct(f'{order}I').unpack_from
    names: list[Any] = []  # of three each
    starts, touching = [], 0
    at = FRAME_AT + length
    at += (ENCAPSULATION - at) % 8
    try:
        (revision,), at = struct.unpack_from(f'{order}Q', data, at), at + 8
        for number_of_list in range(2):  # `contacts` and `near`
            at += -at % 4
            (count,), at = count_at(data, at), at + 4
            for _ in range(count):
                begin = at
                for _ in range(NAMES):
                    at += 4 + count_at(data, at)[0]
                    at += -at % 4
                names.append(_texts(data[begin:at], order, NAMES))
                at += (ENCAPSULATION - at) % 8  # doubles are aligned behind the encapsulation
                starts.append(at)
                at += CONTACT_BYTES
            touching = touching if number_of_list else count
        (count,), at = count_at(data, at), at + 4
        stale: list[str] = []
        for _ in range(count):
            begin = at
            at += 4 + count_at(data, at)[0]
            at += -at % 4
            stale += _texts(data[begin:at], order, 1)
    except (struct.error, UnicodeDecodeError) as error:
        raise MessageError('not a Contacts', f'{len(data)} bytes: {error}') from None
    if not -PADDING <= len(data) - at <= PADDING:
        raise MessageError('not a Contacts', f'{len(data)} bytes, where {at} are told')
    body = np.frombuffer(data, f'{order}f8', (len(data) - ENCAPSULATION) // 8, ENCAPSULATION)
    places = (np.array(starts, np.int64)[:, None] - ENCAPSULATION) // 8
    rows = body[places + np.arange(CONTACT_BYTES // 8)].astype(np.float64)
    covariance = np.empty((len(rows), 3, 3))
    for column, (i, j) in enumerate(zip(*UPPER)):
        covariance[:, i, j] = covariance[:, j, i] = rows[:, 9 + column]
    point, normal = rows[:, :3].copy(), rows[:, 3:6].copy()
    contacts = Contacts(~np.isnan(point[:, 0]), -rows[:, 6], normal, point, rows[:, 7].copy(),
                        covariance, np.full(len(rows), -1, np.int32))
    return ReadContacts(sec * NANOSECONDS + nanosec, frame_id, names, contacts, touching, stale,
                        revision)


@lru_cache(MOST_NAMES)  # the same in each message
def _texts(data: bytes, order: str, count: int) -> tuple[str, ...]:
    """Return strings that stand one behind the other."""
    texts, at = [], 0
    for _ in range(count):
        length, = struct.unpack_from(f'{order}I', data, at)
        texts.append(data[at + 4:at + 4 + length].rstrip(b'\0').decode())
        at += 4 + length
        at += -at % 4
    return tuple(texts)

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A `Contacts` message as arrays, from the bytes of a subscription with `raw=True`.

rclpy makes an object of each point and normal, which takes some ten times as long.
"""
from __future__ import annotations

import struct
from collections.abc import Mapping
from functools import lru_cache
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np

from ..solver.contact import Contacts
from ..solver.nearest import Nearests
from .cdr import (
    CONTACT,
    CONTACT_BYTES,
    ENCAPSULATION,
    FRAME_AT,
    MOST_NAMES,
    NANOSECONDS,
    NEAR,
    NEAR_BYTES,
    PADDING,
    MessageError,
    parse_frame,
    parse_head,
)

UPPER = np.triu_indices(3)
"""Places of the six numbers of a message's covariance: xx xy xz yy yz zz."""
NAMES = 3  # that an entry begins with: those of the pair and of its boxes


class ReadContacts(NamedTuple):
    """What a `Contacts` message says; numbers are those that the node computed, to the bit."""

    stamp: int  # of the header [ns]
    frame_id: str
    names: list[tuple[str, str, str]]
    """(k,) of each pair in contact: its name, and those of its boxes A and B."""
    contacts: Contacts
    """(k,) their contacts; `axis` is -1."""
    near_names: list[tuple[str, str, str]]
    """(m,) of each pair apart by no more than the node's margin."""
    near: Nearests
    """(m,) their nearest points."""
    stale: list[str]  # names of the pairs, or boxes, that could not be answered
    revision: int  # of the node's scene
    epoch: int  # of the node's configuration


def read_contacts(data: bytes) -> ReadContacts:
    """Return what a serialised `Contacts` message says; raises ValueError for other bytes."""
    data = bytes(data)
    order, sec, nanosec, length = parse_head(data, 'Contacts')
    frame_id = parse_frame(data, length, 'Contacts')
    count_at = struct.Struct(f'{order}I').unpack_from
    names: tuple[list[Any], list[Any]] = [], []  # of three each
    starts: tuple[list[int], list[int]] = [], []
    at = FRAME_AT + length
    at += -at % 4
    try:
        (epoch,), at = count_at(data, at), at + 4
        at += (ENCAPSULATION - at) % 8
        (revision,), at = struct.unpack_from(f'{order}Q', data, at), at + 8
        for listed, places, size in zip(names, starts, (CONTACT_BYTES, NEAR_BYTES)):
            at += -at % 4
            (count,), at = count_at(data, at), at + 4
            for _ in range(count):
                begin = at
                for _ in range(NAMES):
                    at += 4 + count_at(data, at)[0]
                    at += -at % 4
                listed.append(_texts(data[begin:at], order, NAMES))
                at += (ENCAPSULATION - at) % 8  # doubles are aligned behind the encapsulation
                places.append(at)
                at += size
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
    touching, near = (
        body[(np.array(places, np.int64)[:, None] - ENCAPSULATION) // 8 + np.arange(size // 8)
             ].astype(np.float64) for places, size in zip(starts, (CONTACT_BYTES, NEAR_BYTES)))
    return ReadContacts(sec * NANOSECONDS + nanosec, frame_id, names[0], _contacts(touching),
                        names[1], _nearests(near), stale, revision, epoch)


def _contacts(rows: np.ndarray) -> Contacts:
    """Return contacts by their rows (n, 15)."""
    point, normal, depth, volume, _, upper = _parts(rows, CONTACT)
    covariance = np.empty((len(rows), 3, 3))
    for column, (i, j) in enumerate(zip(*UPPER)):
        covariance[:, i, j] = covariance[:, j, i] = upper[:, column]
    return Contacts(np.ones(len(rows), bool), -depth, normal, point, volume, covariance,
                    np.full(len(rows), -1, np.int32))


def _nearests(rows: np.ndarray) -> Nearests:
    """Return nearest points by their rows (n, 10)."""
    return Nearests(np.zeros(len(rows), bool), *_parts(rows, NEAR))


def _parts(rows: np.ndarray, counts: Mapping[str, int]) -> list[np.ndarray]:
    """Return the columns of each kind (n, count), or (n,) of a kind with one number."""
    starts = accumulate(counts.values(), initial=0)
    return [(rows[:, start] if count == 1 else rows[:, start:start + count]).copy()
            for start, count in zip(starts, counts.values())]


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

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages as the bytes that are sent (CDR), without message objects: what all of them share.

Messages are read by what CDR promises, whichever middleware wrote them. All other bytes are
refused. Bytes take less time than objects: docs/contributing/node.md.
"""
from __future__ import annotations

import struct

from ..solver.checks import MOST_NAME_BYTES

NANOSECONDS = 1_000_000_000
ENCAPSULATION = 4
"""Bytes before the body: two name its kind, two are options, which say nothing about a pose."""
LITTLE = b'\0\1'
_ORDERS = {b'\0\0': '>', LITTLE: '<'}
"""Byte order by kind: CDR_BE and CDR_LE, which every ROS middleware writes. Others are laid out in
another way: docs/contributing/node.md."""
PADDING = 3
"""Most bytes after the body, of any value: RTPS pads a message to a multiple of four."""
FRAME_AT = 16
"""Where frame_id's characters are: behind stamp and length."""
CONTACT = {'point': 3, 'normal': 3, 'depth': 1, 'volume': 1, 'area': 1, 'covariance': 6}
"""How many numbers of each kind a contact has behind its names, in this order."""
NEAR = {'distance': 1, 'normal': 3, 'point_a': 3, 'point_b': 3}
"""The same of a pair that is near."""
CONTACT_BYTES, NEAR_BYTES = 8 * sum(CONTACT.values()), 8 * sum(NEAR.values())
MOST_NAMES = 2**16
"""Pairs whose names are kept as bytes, some 10 MB."""


class MessageError(ValueError):
    """A message that is not taken; `reason` is what it is counted as."""

    def __init__(self, reason: str, text: str) -> None:
        super().__init__(text)
        self.reason = reason


def parse_head(data: bytes, message: str) -> tuple[str, int, int, int]:
    """Return the order of bytes, seconds, nanoseconds, and the length of frame_id.

    message: the type that a refusal names.
    """
    if len(data) < FRAME_AT:
        raise MessageError(f'not a {message}',
                           f'{len(data)} bytes, where a header needs {FRAME_AT}')
    order = _ORDERS.get(data[:2])
    if order is None:
        raise MessageError(f'not a {message}',
                           f'encapsulation 0x{data[:2].hex()} is neither CDR_BE (0x0000) nor '
                           'CDR_LE (0x0001): let its sender use XCDR1')
    return (order, *struct.unpack_from(f'{order}iII', data, ENCAPSULATION))


def parse_frame(data: bytes, length: int, message: str) -> str:
    """Return the frame_id of so many bytes, its zero included."""
    frame = data[FRAME_AT:FRAME_AT + length]
    if length and frame.find(b'\0') != length - 1:
        raise MessageError(f'not a {message}', 'frame_id does not end with its first zero')
    if length > MOST_NAME_BYTES + 1:  # with its zero
        raise MessageError('bad header',
                           f'frame_id has {length - 1} bytes, more than {MOST_NAME_BYTES}')
    try:
        return frame[:-1].decode('utf-8')
    except UnicodeDecodeError:
        raise MessageError('bad header', f'frame_id {frame[:-1][:100]!r} is not UTF-8') from None

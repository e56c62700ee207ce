# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages as the bytes that are sent (CDR), without message objects: poses in, contacts out.

Poses are read by what CDR promises, whichever middleware wrote them. All other bytes are refused.
What a pose is, the core decides.
Bytes halve the latency: docs/contributing/decisions/contact-node.md.
"""
from __future__ import annotations

import struct
from functools import lru_cache

import numpy as np

from ..core import native
from ..scene.scene import Pair, Scene
from ..scene.scene_solver import Answer
from ..solver.checks import MOST_NAME_BYTES, pose_fault
from .pairing import StampedPose

NANOSECONDS = 1_000_000_000
ENCAPSULATION = 4
"""Bytes before the body: two name its kind, two are options, which say nothing about a pose."""
LITTLE = b'\0\1'
_ORDERS = {b'\0\0': '>', LITTLE: '<'}
"""Byte order by kind: CDR_BE and CDR_LE, which every ROS middleware writes. Others are laid out in
another way: docs/contributing/decisions/contact-node.md."""
PADDING = 3
"""Most bytes after the body, of any value: RTPS pads a message to a multiple of four."""
_HEAD = struct.Struct('<2s2xiI')  # encapsulation and stamp
_POSE = struct.Struct('<7d')
VECTOR_BYTES = 8 * 3
_LAYOUT = '<2s2xiI{}s{}x7d'
"""Of a whole little-endian pose, by the sizes of frame_id, its length included, and of what aligns
the numbers."""
_COUNT = struct.Struct('<I')
CONTACT_BYTES = 8 * 15
"""Of a contact behind its names: point, normal, depth, volume, area and covariance."""
MOST_NAMES = 2**16
"""Pairs whose names are kept as bytes, some 10 MB."""
FRAME_AT = _HEAD.size + 4
"""Where frame_id's characters are: behind stamp and length."""
_new_tuple = tuple.__new__  # a named tuple's own constructor is Python code


class MessageError(ValueError):
    """A message that is not taken; `reason` is what it is counted as."""

    def __init__(self, reason: str, text: str) -> None:
        super().__init__(text)
        self.reason = reason


def numbers_at(length: int) -> int:
    """Return where the seven numbers are, behind a frame_id of so many bytes; aligned to 8."""
    return ENCAPSULATION + -(-(FRAME_AT - ENCAPSULATION + length) // 8) * 8


def parse_pose(data: bytes) -> tuple[tuple[float, ...], str, int, int]:
    """Return numbers, frame_id, seconds and nanoseconds of a PoseStamped, or raise MessageError."""
    order, sec, nanosec, length = parse_head(data, 'PoseStamped')
    at = numbers_at(length)
    if not 0 <= len(data) - (at + _POSE.size) <= PADDING:
        raise MessageError('not a PoseStamped',
                           f'{len(data)} bytes, where a frame_id of {length} needs '
                           f'{at + _POSE.size}')
    frame_id = parse_frame(data, length, 'PoseStamped')
    return struct.unpack_from(f'{order}7d', data, at), frame_id, sec, nanosec


def parse_poses(data: bytes) -> tuple[np.ndarray, str, int, int]:
    """Return the same of a PoseArray, numbers (n, 7), or raise MessageError."""
    order, sec, nanosec, length = parse_head(data, 'PoseArray')
    count_at = -(-(FRAME_AT + length) // 4) * 4
    count = struct.unpack_from(f'{order}I', data, count_at)[0] if count_at + 4 <= len(data) else 0
    at = ENCAPSULATION + -(-count_at // 8) * 8 if count else count_at + 4
    if not 0 <= len(data) - (at + count * _POSE.size) <= PADDING:
        raise MessageError('not a PoseArray', f'{len(data)} bytes, where {count} poses with a '
                                              f'frame_id of {length} need '
                                              f'{at + count * _POSE.size}')
    numbers = np.frombuffer(data, f'{order}f8', 7 * count, at).reshape(count, 7).astype(np.float64)
    return numbers, parse_frame(data, length, 'PoseArray'), sec, nanosec


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


def _stamp(sec: int, nanosec: int) -> int:
    """Return a stamp [ns], or raise MessageError."""
    if nanosec >= NANOSECONDS:
        raise MessageError('bad header', f'stamp has {nanosec} nanoseconds, a second or more')
    return sec * NANOSECONDS + nanosec


class PoseReader:
    """Reads the poses of all boxes. A shortcut knows the frame of the last pose."""

    def __init__(self) -> None:
        self._frame: bytes | None = None
        self._frame_id = ''
        self._unpack = struct.Struct(_LAYOUT.format(0, 0)).unpack

    def read_pose(self, data: bytes) -> StampedPose:
        """Return the pose of a serialised PoseStamped, or raise MessageError."""
        try:
            order, sec, nanosec, frame, *numbers = self._unpack(data)
        except struct.error:  # another length
            return self._read_slowly(data)
        if (frame == self._frame and order == LITTLE and nanosec < NANOSECONDS
                and not native.pose_fault(numbers)):
            return _new_tuple(StampedPose, (numbers, self._frame_id, sec * NANOSECONDS + nanosec))
        return self._read_slowly(data)

    def _read_slowly(self, data: bytes) -> StampedPose:
        data = bytes(data)
        numbers, frame_id, sec, nanosec = parse_pose(data)
        stamp = _stamp(sec, nanosec)
        fault = pose_fault(numbers)
        if fault:
            raise MessageError('bad pose', fault)
        if data[:2] == LITTLE:
            length = int.from_bytes(data[FRAME_AT - 4:FRAME_AT], 'little')  # 0 or 1 of an empty one
            start, end = FRAME_AT - 4, FRAME_AT + length
            self._frame, self._frame_id = data[start:end], frame_id
            self._unpack = struct.Struct(
                _LAYOUT.format(end - start, numbers_at(length) - end)).unpack
        return StampedPose(numbers, frame_id, stamp)

    def read_poses(self, data: bytes) -> StampedPose:
        """Return all poses of a serialised PoseArray, numbers (n, 7), or raise MessageError.

        A row may be no pose: the box of that row has none.
        """
        numbers, frame_id, sec, nanosec = parse_poses(bytes(data))
        return StampedPose(numbers, frame_id, _stamp(sec, nanosec))


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
        pairs, touching = answer.pairs.tolist(), answer.touching
        parts, at, end = [header], (len(header) - ENCAPSULATION) % 8, 0
        for listed in (pairs[:touching], pairs[touching:]):  # `contacts` and `near`
            parts.append(_COUNT.pack(len(listed)))
            at = (at + _COUNT.size) % 8
            for a, b in listed:
                begin, end = end, end + CONTACT_BYTES
                parts += self._names_of(a, b, at), numbers[begin:end]
                at = 0  # doubles end each contact, so the next one begins at a multiple of 8
        stale = answer.named_stale()
        parts.append(_COUNT.pack(len(stale)))
        parts.append(b''.join([_string(pair.label) for pair in stale]))
        return b''.join(parts)


def header_bytes(stamp: int, frame_id: str) -> bytes:
    """Return the encapsulation and the header of a stamp [ns]."""
    return _HEAD.pack(LITTLE, *divmod(stamp, NANOSECONDS)) + _string(frame_id)


def aligned(data: bytes) -> bytes:
    """Return the start of a message, padded so that doubles may follow.

    Behind a header, three make a PointStamped or a Vector3Stamped.
    """
    return data + b'\0' * ((ENCAPSULATION - len(data)) % 8)


@lru_cache  # of the frame, in each tick
def _string(text: str) -> bytes:
    """Return a string with its length before it, and padded to a multiple of 4 behind it."""
    data = text.encode() + b'\0'
    return _COUNT.pack(len(data)) + data + b'\0' * (-len(data) % 4)


def _names(pair: Pair, at: int) -> bytes:
    """Return the names that a contact begins with, padded so that doubles may follow.

    at: where they begin, by the distance from a multiple of 8: 0 or 4.
    """
    names = b''.join(map(_string, (pair.label, pair.a, pair.b)))
    return names + b'\0' * (-(at + len(names)) % 8)

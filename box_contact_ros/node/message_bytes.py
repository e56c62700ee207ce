# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages as the bytes that are sent (CDR), without message objects: `RawMessages`.

Poses are read by what CDR promises, whichever middleware wrote them. All other bytes are refused.
Answers are put together from what rclpy serialises once for each frame_id: nothing here knows the
layout of a cloud's constant parts.
Bytes are kept because they halve the latency: docs/contributing/decisions/contact-node.md.
"""
from __future__ import annotations

import struct
from math import hypot
from typing import NamedTuple

import numpy as np
from rclpy.serialization import serialize_message

from ..core import LENGTH_MAX, QUATERNION_MAX, QUATERNION_MIN
from ..scene.scene_solver import Answer, Pair
from ..scene.stamp_pairing import StampedPose
from ..solver.contact import Contact, patch_area
from .messages import (
    CLOUD_ROW,
    FRAME_LIMIT,
    NANOSECONDS,
    Refused,
    TypedMessages,
    checked_pose,
    headed,
)

ENCAPSULATION = 4
"""Bytes before the body: two name its kind, two are options, which say nothing about a pose."""
LITTLE = b'\0\1'
_ORDERS = {b'\0\0': '>', LITTLE: '<'}
"""Byte order by kind: CDR_BE and CDR_LE, which every ROS middleware writes. Others are laid out in
another way: docs/contributing/decisions/contact-node.md."""
_PADDING = 3
"""Most bytes after the body, of any value: RTPS pads a message to a multiple of four."""
_STAMP = struct.Struct('<iI')
_POSE = struct.Struct('<7d')
_LAYOUT = '<2s2xiI{}s{}x7d'
"""Of a whole little-endian pose, by the sizes of frame_id, its length included, and of what aligns
the numbers."""
_COUNT = struct.Struct('<I')
_DEPTH_VOLUME = struct.Struct('<2d')
_DEPTH_VOLUME_AREA = struct.Struct('<3d')
_SIZES = struct.Struct('<II')
FRAME_AT = ENCAPSULATION + _STAMP.size + 4
"""Where frame_id's characters are: behind stamp and length."""
KEPT_FRAMES = 64
"""Frames whose layouts are kept; whoever sends more than these costs time, not memory."""
_LEAST, _MOST = 2.0 * QUATERNION_MIN, 0.5 * QUATERNION_MAX
"""Norms of quaternions that are certainly good, whatever the rounding."""
_NAN_3, _NAN_14 = np.full(3, np.nan, '<f4').tobytes(), np.full(14, np.nan).tobytes()
_array = np.array
_new_tuple = tuple.__new__  # a named tuple's own constructor is Python code
_NOTHING = Contact(False, 0.0, np.zeros(3), np.zeros(3), 0.0, np.zeros((3, 3)))


class _FrameBytes(NamedTuple):
    """What all messages of a frame have in common, between the bytes that change."""

    head: bytes
    point: bytes
    normal: bytes
    wrench: bytes
    contacts_header: bytes
    contacts_at: int  # where the first contact begins, by its distance from a multiple of 8
    cloud_header: bytes
    cloud_fields: bytes


def numbers_at(length: int) -> int:
    """Return where the seven numbers are, behind a frame_id of so many bytes; aligned to 8."""
    return ENCAPSULATION + -(-(FRAME_AT - ENCAPSULATION + length) // 8) * 8


def parse_pose(data: bytes) -> tuple[tuple[float, ...], str, int, int]:
    """Return numbers, frame_id, seconds and nanoseconds of a PoseStamped, or raise Refused."""
    order, sec, nanosec, length = _parse_head(data, 'PoseStamped')
    at = numbers_at(length)
    if not 0 <= len(data) - (at + _POSE.size) <= _PADDING:
        raise Refused('not a PoseStamped',
                      f'{len(data)} bytes, where a frame_id of {length} needs {at + _POSE.size}')
    frame_id = _parse_frame(data, length, 'PoseStamped')
    return struct.unpack_from(f'{order}7d', data, at), frame_id, sec, nanosec


def parse_poses(data: bytes) -> tuple[np.ndarray, str, int, int]:
    """Return numbers (n, 7), frame_id, seconds and nanoseconds of a PoseArray, or raise Refused."""
    order, sec, nanosec, length = _parse_head(data, 'PoseArray')
    count_at = -(-(FRAME_AT + length) // 4) * 4
    count = struct.unpack_from(f'{order}I', data, count_at)[0] if count_at + 4 <= len(data) else 0
    at = ENCAPSULATION + -(-count_at // 8) * 8 if count else count_at + 4
    if not 0 <= len(data) - (at + count * _POSE.size) <= _PADDING:
        raise Refused('not a PoseArray', f'{len(data)} bytes, where {count} poses with a frame_id '
                                         f'of {length} need {at + count * _POSE.size}')
    numbers = np.frombuffer(data, f'{order}f8', 7 * count, at).reshape(count, 7).astype(np.float64)
    return numbers, _parse_frame(data, length, 'PoseArray'), sec, nanosec


def _parse_head(data: bytes, kind: str) -> tuple[str, int, int, int]:
    """Return the order of bytes, seconds, nanoseconds, and the length of frame_id."""
    if len(data) < FRAME_AT:
        raise Refused(f'not a {kind}', f'{len(data)} bytes, where a header needs {FRAME_AT}')
    order = _ORDERS.get(data[:2])
    if order is None:
        raise Refused(f'not a {kind}', f'encapsulation 0x{data[:2].hex()} is neither CDR_BE '
                                       '(0x0000) nor CDR_LE (0x0001): let its sender use XCDR1')
    return (order, *struct.unpack_from(f'{order}iII', data, ENCAPSULATION))


def _parse_frame(data: bytes, length: int, kind: str) -> str:
    if length > FRAME_LIMIT + 1:
        raise Refused('bad header', f'frame_id has more than {FRAME_LIMIT} bytes')
    frame = data[FRAME_AT:FRAME_AT + length]
    if length and frame.find(b'\0') != length - 1:
        raise Refused(f'not a {kind}', 'frame_id does not end with its first zero')
    try:
        return frame[:-1].decode('utf-8')
    except UnicodeDecodeError:
        raise Refused('bad header', f'frame_id {frame[:-1][:100]!r} is not UTF-8') from None


class RawMessages:
    """Reads poses of all boxes, and makes answers. A shortcut knows the frame of the last pose."""

    raw = True  # whether subscriptions hand over bytes

    def __init__(self) -> None:
        self._frame: bytes | None = None
        self._frame_id = ''
        self._unpack = struct.Struct(_LAYOUT.format(0, 0)).unpack
        self._bytes_of: dict[str, _FrameBytes] = {}
        self._names_of: dict[tuple[Pair, int], bytes] = {}

    def read_pose(self, data: bytes) -> StampedPose:
        """Return the pose of a serialised message, or raise Refused."""
        try:
            order, sec, nanosec, frame, x, y, z, qx, qy, qz, qw = self._unpack(data)
        except struct.error:  # another length
            return self._read_slowly(data)
        # What is certainly good passes here (NaN fails every comparison); the rest is looked at.
        if (frame == self._frame and order == LITTLE and nanosec < NANOSECONDS
                and hypot(x, y, z) < LENGTH_MAX
                and _LEAST < hypot(qx, qy, qz, qw) < _MOST):
            return _new_tuple(StampedPose, (_array((x, y, z, qx, qy, qz, qw)), self._frame_id,
                                            sec * NANOSECONDS + nanosec))
        return self._read_slowly(data)

    def _read_slowly(self, data: bytes) -> StampedPose:
        data = bytes(data)
        numbers, frame_id, sec, nanosec = parse_pose(data)
        pose = checked_pose(numbers, frame_id, sec, nanosec)
        if data[:2] == LITTLE:
            length = int.from_bytes(data[FRAME_AT - 4:FRAME_AT], 'little')  # 0 or 1 of an empty one
            start, end = FRAME_AT - 4, FRAME_AT + length
            self._frame, self._frame_id = data[start:end], frame_id
            self._unpack = struct.Struct(
                _LAYOUT.format(end - start, numbers_at(length) - end)).unpack
        return pose

    def read_poses(self, data: bytes) -> StampedPose:
        """Return all poses of a serialised message, numbers (n, 7), or raise Refused."""
        return headed(*parse_poses(bytes(data)))

    def begin(self, stamp: int, frame_id: str) -> None:
        """Set stamp [ns] and frame of the messages that follow."""
        frame = self._bytes_of.get(frame_id)
        if frame is None:
            if len(self._bytes_of) >= KEPT_FRAMES:
                self._bytes_of.clear()
            frame = self._bytes_of[frame_id] = _in_frame(frame_id)
        self._in_frame = frame
        self._stamp = frame.head + _STAMP.pack(*divmod(stamp, NANOSECONDS))

    def point(self, contact: Contact) -> bytes:
        """Make `contact/point`."""
        return self._stamp + self._in_frame.point + contact.point.tobytes()

    def normal(self, contact: Contact) -> bytes:
        """Make `contact/normal`."""
        return self._stamp + self._in_frame.normal + contact.normal.tobytes()

    def wrench(self, wrench: np.ndarray) -> bytes:
        """Make `wrench` of force and torque (6,)."""
        return self._stamp + self._in_frame.wrench + wrench.tobytes()

    def contacts(self, answer: Answer) -> bytes:
        """Make `contacts`."""
        frame, names_of = self._in_frame, self._names_of
        at, listed = frame.contacts_at, answer.listed
        parts = [self._stamp, frame.contacts_header, _COUNT.pack(len(listed))]
        for pair, c in listed:
            names = names_of.get((pair, at)) or names_of.setdefault((pair, at), _names(pair, at))
            parts.append(
                names + c.point.tobytes() + c.normal.tobytes()
                + _DEPTH_VOLUME_AREA.pack(-c.separation, c.volume, patch_area(c))
                + _upper(c.covariance.tobytes()))
            at = 0  # doubles end each contact, so the next one begins at a multiple of 8
        parts.append(_COUNT.pack(len(answer.stale)))
        parts.append(b''.join([_string(pair.label) for pair in answer.stale]))
        return b''.join(parts)

    def cloud(self, answer: Answer) -> bytes:
        """Make `contacts_cloud`."""
        with np.errstate(over='ignore'):  # what float32 cannot hold is infinite there
            rows = b''.join([
                c.point.astype('<f4').tobytes() + _COUNT.pack(p.id) + c.point.tobytes()
                + c.normal.tobytes() + _DEPTH_VOLUME.pack(-c.separation, c.volume)
                + _upper(c.covariance.tobytes()) for p, c in answer.listed])
        if answer.stale:
            rows += b''.join([_NAN_3 + _COUNT.pack(p.id) + _NAN_14 for p in answer.stale])
        frame = self._in_frame
        size = len(rows)
        return b''.join((self._stamp, frame.cloud_header,
                         _COUNT.pack(size // CLOUD_ROW.itemsize), frame.cloud_fields,
                         _SIZES.pack(size, size), rows,
                         b'\0' if answer.stale or answer.close else b'\1'))


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


def _upper(square: bytes) -> bytes:
    """Return the upper triangle, row by row, of a (3, 3) array of float64."""
    return square[:24] + square[32:48] + square[64:]


def _in_frame(frame_id: str) -> _FrameBytes:
    messages = TypedMessages()
    messages.begin(0, frame_id)
    point, normal, wrench, cloud = (bytes(serialize_message(message)) for message in (
        messages.point(_NOTHING), messages.normal(_NOTHING), messages.wrench(np.zeros(6)),
        messages.cloud(Answer([], [], 0))))
    if point[:2] != LITTLE:
        raise RuntimeError('rclpy does not serialise little-endian here: use serialization:=typed')
    body = FRAME_AT - 4  # behind the stamp
    frame_end = FRAME_AT + len(frame_id.encode()) + 1
    aligned = -(-frame_end // 4) * 4  # as the encapsulation is, too
    # A cloud has height and width behind its frame; without rows it ends with row_step, the number
    # of bytes of data, and is_dense. Contacts have their number there.
    return _FrameBytes(point[:ENCAPSULATION], point[body:-24], normal[body:-24],
                       wrench[body:-48], cloud[body:aligned], (aligned + 4 - ENCAPSULATION) % 8,
                       cloud[body:aligned + 4], cloud[aligned + 8:-9])

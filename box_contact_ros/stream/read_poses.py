# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Poses from the bytes of messages.

What a pose is, the core decides.
"""
from __future__ import annotations

import struct

import numpy as np

from ..core import native
from ..solver.checks import pose_fault
from .cdr import (
    ENCAPSULATION,
    FRAME_AT,
    LITTLE,
    NANOSECONDS,
    PADDING,
    MessageError,
    parse_frame,
    parse_head,
)
from .pairing import StampedPose

_POSE = struct.Struct('<7d')
_LAYOUT = '<2s2xiI{}s{}x7d'
"""Of a whole little-endian pose, by the sizes of frame_id, its length included, and of what aligns
the numbers."""
_new_tuple = tuple.__new__  # a named tuple's own constructor is Python code


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

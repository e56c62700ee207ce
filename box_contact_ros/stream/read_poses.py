# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Poses from the bytes of messages.

The core reads the usual ones, and decides what a pose is. The rest is read here, or refused in
words.
"""
from __future__ import annotations

import struct

import numpy as np

from ..core import native
from ..solver.checks import pose_fault
from .cdr import (
    ENCAPSULATION,
    FRAME_AT,
    NANOSECONDS,
    PADDING,
    MessageError,
    parse_frame,
    parse_head,
)
from .pairing import StampedPose

POSE_BYTES = 8 * 7
_new_tuple = tuple.__new__  # a named tuple's own constructor is Python code


def read_pose(data: bytes) -> StampedPose:
    """Return the pose of a serialised PoseStamped, or raise MessageError."""
    found = native.read_pose(data)
    return _read_in_python(bytes(data)) if found is None else _new_tuple(StampedPose, found)


def _read_in_python(data: bytes) -> StampedPose:
    order, sec, nanosec, length = parse_head(data, 'PoseStamped')
    at = ENCAPSULATION + -(-(FRAME_AT - ENCAPSULATION + length) // 8) * 8
    if not 0 <= len(data) - (at + POSE_BYTES) <= PADDING:
        raise MessageError('not a PoseStamped',
                           f'{len(data)} bytes, where a frame_id of {length} needs '
                           f'{at + POSE_BYTES}')
    frame_id = parse_frame(data, length, 'PoseStamped')
    pose = StampedPose(struct.unpack_from(f'{order}7d', data, at), frame_id, _stamp(sec, nanosec))
    if fault := pose_fault(pose.numbers):
        raise MessageError('bad pose', fault)
    return pose


def read_poses(data: bytes) -> StampedPose:
    """Return all poses of a serialised PoseArray, numbers (n, 7), or raise MessageError.

    A row may be no pose: the box of that row has none.
    """
    data = bytes(data)
    order, sec, nanosec, length = parse_head(data, 'PoseArray')
    count_at = -(-(FRAME_AT + length) // 4) * 4
    count = struct.unpack_from(f'{order}I', data, count_at)[0] if count_at + 4 <= len(data) else 0
    at = ENCAPSULATION + -(-count_at // 8) * 8 if count else count_at + 4
    if not 0 <= len(data) - (at + count * POSE_BYTES) <= PADDING:
        raise MessageError('not a PoseArray', f'{len(data)} bytes, where {count} poses with a '
                                              f'frame_id of {length} need '
                                              f'{at + count * POSE_BYTES}')
    numbers = np.frombuffer(data, f'{order}f8', 7 * count, at).reshape(count, 7).astype(np.float64)
    return StampedPose(numbers, parse_frame(data, length, 'PoseArray'), _stamp(sec, nanosec))


def _stamp(sec: int, nanosec: int) -> int:
    """Return a stamp [ns], or raise MessageError."""
    if nanosec >= NANOSECONDS:
        raise MessageError('bad header', f'stamp has {nanosec} nanoseconds, a second or more')
    return sec * NANOSECONDS + nanosec

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
from ..scene.boxes import MOST_BOXES
from ..solver.checks import pose_fault, short_repr
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
TWIST_BYTES = 8 * 6  # and those of a wrench
NAMED = 'MultiDOFJointState'
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


class NamedPoses:
    """Reads the poses of what moves from MultiDOFJointState messages.

    unknown: the names of the last message that move nothing.
    """

    def __init__(self, names: tuple[str, ...]) -> None:
        """Take the names of all that moves, in the order of the rows of an answer."""
        self._most = len(names) + MOST_BOXES  # names of a message, also of what does not move
        self._row_of = {name: row for row, name in enumerate(names)}
        self._native = native.NamedPoses(names, self._most)
        self.unknown: tuple[str, ...] = ()

    def __call__(self, data: bytes) -> StampedPose:
        """Return poses (n, 7), NaN for what the message does not name, or raise MessageError.

        A row may be no pose: the box of that row has none.
        """
        found = self._native.read(data)
        if found is None:
            return self._read_in_python(bytes(data))
        numbers, frame_id, stamp, self.unknown = found
        return StampedPose(numbers, frame_id, stamp)

    def _read_in_python(self, data: bytes) -> StampedPose:
        order, sec, nanosec, length = parse_head(data, NAMED)
        try:
            given, poses = _parse_named(data, order, FRAME_AT + length, self._most)
        except struct.error as error:
            raise MessageError(f'not a {NAMED}', f'{len(data)} bytes: {error}') from None
        frame_id, stamp = parse_frame(data, length, NAMED), _stamp(sec, nanosec)
        first_of: dict[str, int] = {}
        for number, name in enumerate(given):
            first = first_of.setdefault(name, number)
            if first != number and name in self._row_of:
                raise MessageError('doubled name', f'joint_names[{number}]: {short_repr(name)} is '
                                                   f'joint_names[{first}], too')
        numbers = np.full((len(self._row_of), 7), np.nan)
        named = first_of.keys() & self._row_of
        numbers[[self._row_of[name] for name in named]] = poses[[first_of[name] for name in named]]
        self.unknown = tuple(name for name in given if name not in self._row_of)
        return StampedPose(numbers, frame_id, stamp)


def _parse_named(data: bytes, order: str, at: int, most: int) -> tuple[list[str], np.ndarray]:
    """Return up to `most` names, and poses (n, 7), from a place on; struct.error: it ends there."""
    def count_at(at: int) -> tuple[int, int]:
        at += -at % 4
        return struct.unpack_from(f'{order}I', data, at)[0], at + 4

    count, at = count_at(at)
    if at + count * (4 + POSE_BYTES) > len(data):  # a length and a pose each, before any is read
        raise struct.error(f'{count} joint_names and transforms need more')
    if count > most:
        raise MessageError('too many names', f'{count} joint_names, more than {most}')
    names: list[str] = []
    for _ in range(count):
        length, at = count_at(at)
        if length and data.find(b'\0', at, at + length) != at + length - 1:
            raise struct.error(f'joint_names[{len(names)}] does not end with its first zero')
        names.append(data[at:at + length].removesuffix(b'\0').decode(errors='backslashreplace'))
        at += length
    for part, size in (('transforms', POSE_BYTES), ('twist', TWIST_BYTES), ('wrench', TWIST_BYTES)):
        rows, at = count_at(at)
        at += (ENCAPSULATION - at) % 8 if rows else 0
        if part == 'transforms':
            if rows != count:
                raise MessageError(f'not a {NAMED}', f'{count} joint_names, but {rows} transforms')
            poses_at = at
        at += rows * size
    if not 0 <= len(data) - at <= PADDING:
        raise struct.error(f'{at} are told')
    return names, np.frombuffer(data, f'{order}f8', 7 * count, poses_at).reshape(-1, 7)


def _stamp(sec: int, nanosec: int) -> int:
    """Return a stamp [ns], or raise MessageError."""
    if nanosec >= NANOSECONDS:
        raise MessageError('bad header', f'stamp has {nanosec} nanoseconds, a second or more')
    return sec * NANOSECONDS + nanosec

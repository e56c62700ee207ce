# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compare the node's parser of bytes with rclpy on mutated poses.

    python test/helpers/message_fuzz.py [--messages N] [--seed N]

A message is written in one of the ways that CDR leaves open, then damaged up to three times.
`stream/read_poses.py` and rclpy must give the same numbers to the bit, the same frame and stamp, or
the same refusal. What rclpy cannot deserialise must be refused as `not a …`. For the rest, the
reason must be that of `typed_messages`. `STRICTER` lists all exceptions.

The program prints how often each outcome came; rclpy adds a line for each count that is too large.
The exit status is 1 if an answer differs.
"""
from __future__ import annotations

import argparse
import random
import resource
import struct
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Literal, NamedTuple

import numpy as np
from geometry_msgs.msg import PoseStamped
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import MultiDOFJointState
from typed_messages import read_named, read_pose

from box_contact_ros.stream import read_poses as readers
from box_contact_ros.stream.cdr import MessageError
from box_contact_ros.stream.pairing import StampedPose

MESSAGES = 100_000
SHOWN = 5  # differences of a type that are printed
MEMORY = 4 << 30  # bytes: a reader that believes a length field ends with MemoryError
TYPES = (PoseStamped, MultiDOFJointState)
MOVING = ('hook', 'c1', 'c22', 'lorry')
"""What moves, in the scene of the named poses."""

SPECIAL = (0.0, -0.0, 5e-324, -2e-310, 1e-160, 1e50, 1e51, 1e200, float('inf'), float('-inf'),
           float('nan'))
FRAMES = ('map', 'a/b', 'yard_7', 'Hafen Köln', '港', '🙂')
"""Without U+FFFD, which rclpy puts in place of bytes that are not UTF-8."""
NOT_UTF8 = (b'\xff', b'\xc0\x80', b'\xed\xa0\x80', b'\xf0\x9f', b'a\xe6')
WORDS = (0, 1, 2, 3, 4, 5, 7, 8, 9, 255, 999_999_999, 1_000_000_000, 2**31 - 1, 2**31, 2**32 - 2,
         2**32 - 1)  # for lengths, counts and nanoseconds

Outcome = tuple[object, ...]


class Written(NamedTuple):
    """A message as a middleware might write it."""

    kind: bytes = b'\0\1'
    options: bytes = b'\0\0'
    frame: bytes = b'map\0'
    sec: int = 5
    nanosec: int = 7
    rows: tuple[tuple[float, ...], ...] = ((1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0),)
    names: tuple[bytes, ...] = ()  # of named poses
    extra: int = 0  # twists, and wrenches, of these
    padding: int = 0
    tail: bytes = b''

    def bytes_of(self, message_type: type) -> bytes:
        """Return the serialised message."""
        order = '<' if self.kind[1] % 2 else '>'
        body = struct.pack(f'{order}iII', self.sec, self.nanosec, len(self.frame)) + self.frame
        def count(number: int) -> bytes:
            return self._aligned(body, 4) + struct.pack(f'{order}I', number)

        if message_type is MultiDOFJointState:
            body = count(len(self.names))
            for name in self.names:
                body = count(len(name)) + name
            body = count(len(self.rows))
        for row in self.rows:
            body = self._aligned(body, 8) + struct.pack(f'{order}7d', *row)
        for _ in range(2 if message_type is MultiDOFJointState else 0):
            body = count(self.extra)
            if self.extra:
                body = self._aligned(body, 8) + bytes(48 * self.extra)
        return self.kind + self.options + body + self.tail

    def _aligned(self, body: bytes, size: int) -> bytes:
        return body + bytes([self.padding]) * (-len(body) % size)


def written(rng: random.Random, message_type: type) -> Written:
    """Draw a message. Most are well-formed; any part may be bad."""
    names = () if message_type is PoseStamped else _names(rng)
    rows = 1 if message_type is PoseStamped else len(names) + (rng.random() < 0.07)
    kind = bytes([0, rng.randrange(14)]) if rng.random() < 0.1 else bytes([0, rng.random() < 0.7])
    return Written(
        kind=kind, options=rng.choice((b'\0\0', b'\0\1', b'\0\2', b'\0\3', rng.randbytes(2))),
        frame=_frame(rng), sec=rng.choice((0, 5, -1, 2**31 - 1, -2**31)),
        nanosec=rng.choice((0, 7, 999_999_999, 999_999_999, 1_000_000_000)),
        rows=tuple(_row(rng) for _ in range(rows)), names=names,
        extra=rng.choice((0, 0, 0, 1, 2)), padding=rng.choice((0, 0, 255, 1)),
        tail=rng.randbytes(rng.choice((0,) * 12 + (1, 2, 3, 4, 7, 100))))


def _frame(rng: random.Random) -> bytes:
    """Draw the bytes of a frame_id, of any length modulo 8. Most end with their NUL."""
    way = rng.random()
    text = (rng.choice(FRAMES).encode() if way < 0.3 else
            rng.choice(NOT_UTF8) if way < 0.35 else b'f' * rng.randrange(20))
    ending = rng.random()
    if ending < 0.04:
        return rng.choice((text, b''))  # no NUL, or a length of 0
    if ending < 0.08:
        place = rng.randrange(len(text) + 1)
        return text[:place] + b'\0' + text[place:] + b'\0'
    return text + b'\0'


def _names(rng: random.Random) -> tuple[bytes, ...]:
    """Draw names of named poses. Most move, and most are there once."""
    names = [name.encode() + b'\0' for name in (*MOVING, 'c333', 'ö', '')]
    drawn = rng.sample(names, rng.randrange(len(names) + 1))
    if rng.random() < 0.3:
        drawn += rng.choices(names, k=2)
    if rng.random() < 0.05:
        drawn.append(rng.choice((b'c1', b'c1\0x\0', b'\xff\0', b'')))
    return tuple(drawn)


def _row(rng: random.Random) -> tuple[float, ...]:
    numbers = [rng.uniform(-10.0, 10.0) for _ in range(7)]
    if rng.random() < 0.2:
        numbers[rng.randrange(7)] = rng.choice(SPECIAL)
    if rng.random() < 0.05:
        numbers[3:] = [rng.choice((0.0, 5e-324, 1e-160, 1e160))] * 4
    return tuple(numbers)


def damaged(rng: random.Random, data: bytes) -> bytes:
    """Return a message with some bytes changed, cut off or appended."""
    if not data:
        return data
    changed = bytearray(data)
    place = rng.randrange(min(len(changed), 100))  # headers and counts are in front
    match rng.randrange(6):
        case 0:
            changed[place] ^= 1 << rng.randrange(8)
        case 1:
            changed[place] = rng.choice((0, 1, 127, 128, 255))
        case 2:
            del changed[rng.randrange(len(changed)):]
        case 3:
            changed += rng.randbytes(rng.randrange(1, 9))
        case 4:
            word = rng.choice((*WORDS, len(data)))
            changed[place // 4 * 4:place // 4 * 4 + 4] = word.to_bytes(4, rng.choice(
                ('little', 'little', 'big')))
        case 5:
            changed[1:2] = bytes([rng.randrange(14)])  # the other byte order, another kind
    return bytes(changed)


def _is_other_kind(data: bytes, _: type) -> bool:
    """Whether the encapsulation is neither CDR_BE nor CDR_LE. rclpy reads others as if they were.

    No ROS middleware writes others. rclpy reads well-formed ones wrongly. It takes the headers of
    PL_CDR's parameters for numbers, and does not know the size before a sequence in XCDR2.
    """
    return data[:2] not in (b'\0\0', b'\0\1')


def _strings(data: bytes, message_type: type) -> Iterator[bytes]:
    """Yield the bytes of frame_id, and those of names, of a message that rclpy reads."""
    order: Literal['little', 'big'] = 'little' if data[1] else 'big'
    at, count = 12, 1
    while count:
        length = int.from_bytes(data[at:at + 4], order)
        yield data[at + 4:at + 4 + length]
        at += 4 + length + -length % 4
        count -= 1
        if message_type is MultiDOFJointState:
            count, message_type = int.from_bytes(data[at:at + 4], order), PoseStamped
            at += 4


def _is_no_string(data: bytes, message_type: type) -> bool:
    """Whether a string lacks its NUL, or has one inside. rclpy ends the text at the first NUL.

    A string in CDR ends with a NUL, and has none inside. Two frame_ids that differ must not be
    taken for the same frame, nor two names for the same box.
    """
    return any(text and text.find(b'\0') != len(text) - 1
               for text in _strings(data, message_type))


def _is_longer(data: bytes, message_type: type) -> bool:
    """Whether rclpy reads the message without its last four bytes too: it ignores what follows.

    Padding is at most three bytes. A longer message is of another type that begins alike.
    """
    try:
        deserialize_message(data[:-4], message_type)
    except rclpy_implementation.RMWError:
        return False
    return True


STRICTER: dict[str, Callable[[bytes, type], bool]] = {
    'encapsulation': _is_other_kind, 'no string': _is_no_string, 'too long': _is_longer}
"""What rclpy reads and the node refuses, on purpose, as `not a …`."""


def wanted(data: bytes, message_type: type) -> tuple[str, Outcome]:
    """Return a word for the tally, and what a reader of bytes has to answer."""
    refusal = (f'not a {message_type.__name__}',)
    try:
        message = deserialize_message(data, message_type)
    except rclpy_implementation.RMWError:
        return 'not deserialised', refusal
    for word, applies in STRICTER.items():
        if applies(data, message_type):
            return f'stricter: {word}', refusal
    outcome = outcome_of(
        read_pose if message_type is PoseStamped else partial(read_named, MOVING), message)
    return str(outcome[0]) if len(outcome) == 1 else 'read', outcome


def reader_of(message_type: type) -> Callable[[bytes], StampedPose]:
    """Return the reader of the bytes of a type."""
    return readers.read_pose if message_type is PoseStamped else readers.NamedPoses(MOVING)


def outcome_of(read: Callable[[Any], StampedPose], message: Any) -> Outcome:
    """Return numbers, shape, frame and stamp, or the reason of a refusal."""
    try:
        pose = read(message)
    except MessageError as refused:
        return (refused.reason,)
    numbers = np.array(pose.numbers)
    return numbers.tobytes(), numbers.shape, pose.frame_id, pose.stamp


def fuzz(message_type: type, messages: int, *, seed: int) -> tuple[Counter[str], list[str]]:
    """Return how often each outcome came, and the messages that the readers differ in, as text."""
    tally: Counter[str] = Counter()
    differences = []
    read = reader_of(message_type)
    for number in range(messages):
        rng = random.Random(f'{seed} {message_type.__name__} {number}')
        data = written(rng, message_type).bytes_of(message_type)
        for _ in range(rng.choice((0, 0, 1, 1, 2, 3))):
            data = damaged(rng, data)
        word, outcome = wanted(data, message_type)
        tally[word] += 1
        if outcome_of(read, data) != outcome:
            differences.append(f'{message_type.__name__} {number} of seed {seed}, {data!r}:\n'
                               f'  {outcome_of(read, data)}, not {outcome} ({word})')
    return tally, differences


def main() -> int:
    """Fuzz both types, and print the outcomes; 1 if the readers differ."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--messages', type=int, default=MESSAGES,
                        help='of each type (default: %(default)s)')
    parser.add_argument('--seed', type=int, default=1)
    options = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    total = 0
    for message_type in TYPES:
        tally, differences = fuzz(message_type, options.messages, seed=options.seed)
        total += len(differences)
        counts = [f'{count:>9,} {word}' for word, count in tally.most_common()]
        print(message_type.__name__, *counts, *differences[:SHOWN], sep='\n', flush=True)
    print(f'{total} differences')
    return 1 if total else 0


if __name__ == '__main__':
    sys.exit(main())

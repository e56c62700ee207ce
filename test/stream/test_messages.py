# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages as bytes: read and written as rclpy's own objects are, and nothing else is taken."""
from __future__ import annotations

import struct
from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PointStamped, PoseStamped, Vector3Stamped
from hypothesis import given
from hypothesis import strategies as st
from message_fuzz import STRICTER, TYPES, fuzz, outcome_of
from poses import assert_same_bits
from rclpy.serialization import deserialize_message, serialize_message
from typed_messages import (
    TOLD,
    make_contacts,
    make_normal,
    make_point,
    pose_array,
    pose_stamped,
    read_pose,
    read_poses,
    unset,
)

from box_contact_msgs.msg import Contacts as ContactsMessage
from box_contact_ros import ContactSolver
from box_contact_ros.node.messages import KeptMessages, make_header
from box_contact_ros.scene.scene import Pair, two_boxes
from box_contact_ros.scene.scene_solver import Answer
from box_contact_ros.solver.contact import Contact, Contacts
from box_contact_ros.solver.nearest import Nearests
from box_contact_ros.stream.cdr import MessageError
from box_contact_ros.stream.read_contacts import read_contacts
from box_contact_ros.stream.read_poses import PoseReader
from box_contact_ros.stream.write_contacts import ContactWriter, aligned, header_bytes
from box_contact_ros.view.live.listener import read_answer

STAMPS = st.integers(-2**31 * 10**9, 2**31 * 10**9 - 1)
# U+FFFD is what rclpy puts in place of bytes that are not UTF-8.
FRAMES = st.text(st.characters(exclude_characters='\0\N{REPLACEMENT CHARACTER}',
                               exclude_categories=['Cs']), max_size=30)
NAMES = st.text(st.characters(exclude_characters='\0', exclude_categories=['Cs']), max_size=12)
FLOATS = st.floats(width=64)
BOUNDED = st.floats(-1e50, 1e50)
NUMBERS = st.one_of(st.tuples(*[FLOATS] * 7), st.tuples(*[BOUNDED] * 7))
POSE = (1, 2, 3, 0, 0, 0, 1)
STAMP = 5_000_000_007
GOOD = bytes(serialize_message(pose_stamped(POSE, 'map', STAMP)))
ARRAY = bytes(serialize_message(pose_array([POSE] * 2, 'map', STAMP)))
NEAR = Nearests(np.zeros(1, bool), np.array([0.5]), np.array([[0.0, 0.6, 0.8]]),
                np.array([[1.0, 2.0, 3.0]]), np.array([[1.0, 2.3, 3.4]]))
NO_NEAR, NONE = NEAR[:0], np.empty((0, 2), np.int64)


# --- poses in -------------------------------------------------------------------------------------


@given(st.lists(st.tuples(NUMBERS, FRAMES, STAMPS), min_size=1, max_size=5))
def test_poses_are_read_alike(poses):
    """Bytes and objects give the same pose to the bit, or the same reason.

    Any numbers, frames and stamps, one after another: the reader keeps what it knows of the frame
    before.
    """
    reader = PoseReader()
    for pose in [*poses, *poses]:
        message = pose_stamped(*pose)
        assert outcome_of(reader.read_pose, bytes(serialize_message(message))) == outcome_of(
            read_pose, message)


@given(st.lists(st.tuples(*[FLOATS] * 7), max_size=4), FRAMES, STAMPS)
def test_pose_arrays_are_read_alike(rows, frame_id, stamp):
    """Numbers to the bit, of any count and any frame, whose length moves all that follows."""
    message = pose_array(rows, frame_id, stamp)
    outcome = outcome_of(PoseReader().read_poses, bytes(serialize_message(message)))
    assert outcome == outcome_of(read_poses, message)
    assert outcome == (np.array(rows, dtype=float).tobytes(), (len(rows), 7), frame_id, stamp)


@pytest.mark.parametrize('order', ['<', '>'])
def test_what_cdr_leaves_open_makes_no_difference(order):
    """Byte order, options, padding of any value, and an empty frame_id with its NUL or without."""
    reader = PoseReader()
    for options, frame, padding, tail in product(
            (b'\0\0', b'\0\3', b'\xff\xff'), (b'ma\0', b'map\0', b'\0', b''), (b'\0', b'\xff'),
            (b'', b'\xff', b'\0' * 3)):
        start = (b'\0\1' if order == '<' else b'\0\0') + options
        head = struct.pack(f'{order}iII', 5, 7, len(frame)) + frame
        pose = struct.pack(f'{order}7d', *POSE) + tail
        data = start + head + padding * (-len(head) % 8) + pose
        counted = head + padding * (-len(head) % 4) + struct.pack(f'{order}I', 1)
        array = start + counted + padding * (-len(counted) % 8) + pose
        for _ in range(2):  # the second time the reader knows the frame
            for stamped in (reader.read_pose(data), reader.read_poses(array)):
                numbers = np.array(stamped.numbers)
                assert numbers.ravel().tolist() == list(POSE) and numbers.dtype == np.float64
                assert (stamped.frame_id, stamped.stamp) == (frame[:-1].decode(), STAMP)


@pytest.mark.parametrize('frame_id, is_read', [
    ('f' * 255, True), ('f' * 256, False), ('ö' * 127, True), ('ö' * 128, False),
    ('f' * 4_000_000, False)],
    ids=['255', '256', '254 of two bytes', '256 of two bytes', '4 MB'])
def test_a_long_frame_is_refused(frame_id, is_read):
    """It would be kept. Bytes count, not characters."""
    wanted = outcome_of(read_pose, pose_stamped(POSE, frame_id, STAMP))
    assert (len(wanted) > 1) == is_read
    for read, message in ((PoseReader().read_pose, pose_stamped(POSE, frame_id, STAMP)),
                          (PoseReader().read_poses, pose_array([POSE], frame_id, STAMP))):
        outcome = outcome_of(read, bytes(serialize_message(message)))
        assert outcome[-2:] == (wanted[-2:] if is_read else ('bad header',))


@pytest.mark.parametrize('message_type', TYPES)
def test_mutated_messages_are_read_as_rclpy_reads_them(message_type):
    """3,000 of each type, and each outcome occurs. The long run is `message_fuzz.py` itself."""
    tally, differences = fuzz(message_type, 3000, seed=20260)
    assert not differences, differences[0][:1000]
    words = {'read', 'not deserialised', 'bad header', *(f'stricter: {name}' for name in STRICTER)}
    assert set(tally) == words | ({'bad pose'} if message_type is PoseStamped else set())
    assert min(tally.values()) > 50


@pytest.mark.parametrize('kind', [b'\0\3', b'\0\7', b'\0\x09', b'\0\x0b', b'\1\1'])
def test_another_encapsulation_is_refused_by_its_name(kind):
    """A list of parameters, three forms of XCDR2, and one that nobody has defined."""
    for read, good in ((PoseReader().read_pose, GOOD), (PoseReader().read_poses, ARRAY)):
        with pytest.raises(MessageError,
                           match=f'encapsulation 0x{kind.hex()} is neither .* use XCDR1'):
            read(kind + good[2:])


@pytest.mark.parametrize('warm', [False, True])
@given(st.one_of(st.binary(max_size=200), st.binary(max_size=100).map(lambda b: GOOD[:4] + b),
                 st.integers(0, len(GOOD) - 1).map(lambda n: GOOD[:n]),
                 st.binary(min_size=4, max_size=9).map(lambda b: GOOD + b)))
def test_other_bytes_are_refused(warm, data):
    """Garbage, cut short, too long: MessageError alone, whatever was read before."""
    reader = PoseReader()
    if warm:
        reader.read_pose(GOOD)
    with pytest.raises(MessageError):
        reader.read_pose(data)


@pytest.mark.parametrize('numbers, reason', [
    ((np.nan, 0, 0, 0, 0, 0, 1), 'is not finite'), ((0, 0, np.inf, 0, 0, 0, 1), 'is not finite'),
    ((0, 0, 0, 0, np.nan, 0, 1), 'is not finite'), ((0, 0, 2e50, 0, 0, 0, 1), 'exceeds'),
    ((1e308, 0, 0, 0, 0, 0, 1), 'exceeds'), ((0,) * 7, 'has zero length')])
def test_a_pose_that_is_none_is_refused_with_its_reason(numbers, reason):
    reader = PoseReader()
    reader.read_pose(GOOD)
    with pytest.raises(MessageError, match=reason) as refused:
        reader.read_pose(bytes(serialize_message(pose_stamped(numbers, 'map', STAMP))))
    assert refused.value.reason == 'bad pose'


@pytest.mark.parametrize('change, reason', [
    (lambda data: data[:8] + struct.pack('<I', 10**9) + data[12:], 'bad header'),
    (lambda data: data.replace(b'map\0', b'm\xffp\0'), 'bad header'),
    (lambda data: data.replace(b'map\0', b'maps'), 'not a'),
    (lambda data: data.replace(b'map\0', b'm\0p\0'), 'not a'),
    (lambda data: data[:12] + b'\xff' * 4 + data[16:], 'not a')])
def test_headers_are_checked(change, reason):
    """A second of nanoseconds, a frame that is not UTF-8 or no string, a length beyond the end."""
    for read, good in ((PoseReader().read_pose, GOOD), (PoseReader().read_poses, ARRAY)):
        with pytest.raises(MessageError) as refused:
            read(change(good))
        assert refused.value.reason.startswith(reason)


COUNT_AT = ARRAY.index(b'\2\0\0\0')


@pytest.mark.parametrize('data', [
    b'', ARRAY[:4], ARRAY[:COUNT_AT], ARRAY[:-1], ARRAY + b'\0' * 4,
    ARRAY[:COUNT_AT] + b'\3\0\0\0' + ARRAY[COUNT_AT + 4:],
    ARRAY[:COUNT_AT] + b'\xff' * 4 + ARRAY[COUNT_AT + 4:], GOOD], ids=range(8))
def test_bytes_that_are_no_pose_array_are_refused(data):
    with pytest.raises(MessageError) as refused:
        PoseReader().read_poses(data)
    assert refused.value.reason == 'not a PoseArray'


# --- contacts out ---------------------------------------------------------------------------------


def some_near(draw, count):
    numbers = np.array(draw(st.lists(st.tuples(*[FLOATS] * 10), min_size=count, max_size=count)))
    distance, *vectors = np.split(numbers.reshape(count, 10), [1, 4, 7], axis=1)
    return Nearests(np.zeros(count, bool), distance[:, 0], *vectors)


def a_contact(draw):
    three = st.tuples(*[BOUNDED] * 3)
    return Contact(True, draw(BOUNDED), np.array(draw(three)), np.array(draw(three)),
                   draw(FLOATS), np.array(draw(st.tuples(three, three, three))))


@given(st.data(), STAMPS, FRAMES, st.integers(0, 4), st.integers(0, 2), st.integers(0, 3))
def test_answers_are_written_alike(data, stamp, frame_id, touching, close, stale):
    """Decoded, the bytes are the objects.

    Any number of contacts, any frame and names (their lengths move all that follows), pairs that
    are close, pairs that are stale.
    """
    pairs = [Pair(*data.draw(st.tuples(*[NAMES] * 3))) for _ in range(touching + close + stale)]
    names: Any = SimpleNamespace(pair_of=lambda row, _: pairs[row])
    contacts, near = [a_contact(data.draw) for _ in range(touching)], some_near(data.draw, close)
    rows = np.array([(row, 0) for row in range(len(pairs))], np.int64).reshape(-1, 2)
    listed, near_rows, stale_rows = np.split(rows, [touching, touching + close])
    answer = Answer(listed, Contacts.of(contacts), near_rows, near, 0, stale_rows, names,
                    stamp % 2**64)
    writer, header, typed_header = (
        ContactWriter(names), header_bytes(stamp, frame_id), make_header(stamp, frame_id))
    wanted = make_contacts(typed_header, zip(pairs, contacts),
                           [pair.label for pair in pairs[touching + close:]],
                           zip(pairs[touching:], near))
    wanted.revision = answer.revision
    for _ in range(2):  # the second time the writer knows the names
        written = deserialize_message(writer.contacts(header, answer), ContactsMessage)
        assert str(written) == str(wanted)  # as text, where NaN is NaN
    said = writer.contacts(header, answer)
    for length in range(0, len(said) - 4, 13):
        with pytest.raises(MessageError):
            read_contacts(said[:length])
    read = read_contacts(said)
    assert read[:2] == (stamp, frame_id)
    assert read.names + read.near_names == [
        (pair.label, pair.a, pair.b) for pair in pairs[:touching + close]]
    assert len(read.names) == touching
    assert read.stale == [pair.label for pair in pairs[touching + close:]]
    for field in ('distance', 'normal', 'point_a', 'point_b'):
        assert np.array_equal(getattr(read.near, field), getattr(near, field), equal_nan=True)
    assert_same_bits(read.contacts, answer.contacts, 'separation', 'volume', 'point', 'normal',
                     'colliding')
    for c in contacts:
        point, normal = (aligned(header) + vector.tobytes() for vector in (c.point, c.normal))
        assert deserialize_message(point, PointStamped) == make_point(typed_header, c)
        assert deserialize_message(normal, Vector3Stamped) == make_normal(typed_header, c)


def test_what_a_client_reads_is_the_contact_again():
    """Every number to the bit, the covariance symmetric again; the answer of the scene, too."""
    scene = two_boxes((2, 3, 1), (1, 2, 2))
    rows = np.array([[0, 1]])
    overlap = ContactSolver((2, 3, 1), (1, 2, 2), model='exact')(
        (0, 0, 0, 0, 0, 0, 1), (0.3, 0.4, 1.2, 0.1, 0.2, 0.3, 0.9))
    for answer in (Answer(rows, Contacts.of([overlap]), NONE, NO_NEAR, 1, NONE, scene),
                   Answer(NONE, Contacts.of([]), rows, NEAR, 1, NONE, scene),
                   Answer(NONE, Contacts.of([]), NONE, NO_NEAR, 0, rows, scene)):
        read = read_answer(
            read_contacts(ContactWriter(scene).contacts(header_bytes(0, 'map'), answer)), scene)
        assert np.array_equal(read.stale, answer.stale)
        assert np.array_equal(read.pairs, answer.pairs)
        assert np.array_equal(read.near_pairs, answer.near_pairs)
        assert np.array_equal(read.near.point_b, answer.near.point_b)
        assert_same_bits(read.contacts, answer.contacts, *TOLD)
    message = make_contacts(make_header(0, 'map'), [(Pair('p', 'a', 'b'), overlap)])
    with pytest.raises(MessageError, match="'p' is no pair of the scene"):
        read_answer(read_contacts(serialize_message(message)), scene)


def test_no_field_of_a_contact_is_left_out():
    """By the bytes of `contacts`, by the objects of ~/check, and read again.

    A new field of Contact.msg fails here until each way sets it.
    """
    overlap = ContactSolver((2, 3, 1), (1, 2, 2), model='exact')(
        (0, 0, 0, 0.2, 0.1, 0.4, 1), (0.3, 0.4, 1.2, 0.1, 0.2, 0.3, 0.9))
    scene, contacts = two_boxes((2, 3, 1), (1, 2, 2)), Contacts.of([overlap])
    answer = Answer(np.array([[0, 1]]), contacts, NONE, NO_NEAR, 1, NONE, scene)
    written = deserialize_message(
        ContactWriter(scene).contacts(header_bytes(STAMP, 'map'), answer), ContactsMessage)
    kept, = KeptMessages(1).fill([('p', 'a', 'b')], contacts)
    assert unset(type(kept)()) and unset(written.contacts[0]) == unset(kept) == []
    read = read_contacts(serialize_message(written)).contacts
    for name in TOLD:
        assert np.all(getattr(read, name)), name


def test_contacts_in_the_other_order_of_bytes_are_read():
    """As a big-endian middleware sends them; what is no message of contacts is refused."""
    message = make_contacts(make_header(5 * 10**9 + 7, 'map'), [], ['stale'],
                            [(Pair('p', 'a', 'bcd'), NEAR[0])])
    message.revision = 258
    little = serialize_message(message)
    big = bytearray(little)
    big[1] = 0
    for size, at in ((4, 4), (4, 8), (4, 12), (8, 20), (4, 28), (4, 32), (4, 36), (4, 44), (4, 52)):
        big[at:at + size] = little[at:at + size][::-1]
    at = 60
    assert little[at:at + 8] == np.array([0.5]).tobytes()
    for start in range(at, at + 80, 8):
        big[start:start + 8] = little[start:start + 8][::-1]
    for start in (at + 80, at + 84):
        big[start:start + 4] = little[start:start + 4][::-1]
    for one, other in zip(read_contacts(bytes(big)), read_contacts(little)):
        assert str(one) == str(other)
    assert read_contacts(bytes(big)).revision == 258
    for bad in (little[:-8], little + b'\0' * 8, GOOD, b'', little[:28] + b'\xff' * 4 + little[32:],
                little.replace(b'bcd', b'\xff\xff\xff')):
        with pytest.raises(MessageError):
            read_contacts(bad)

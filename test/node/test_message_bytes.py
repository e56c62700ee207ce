# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages as bytes: read and written as rclpy's own objects are, and nothing else is taken."""
from __future__ import annotations

import struct
from itertools import product

import numpy as np
import pytest
from geometry_msgs.msg import PointStamped, PoseArray, PoseStamped, Vector3Stamped, WrenchStamped
from hypothesis import given
from hypothesis import strategies as st
from message_fuzz import READERS, STRICTER, fuzz
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import PointCloud2, PointField

from box_contact_ros import ContactSolver
from box_contact_ros.bench.answer_log import first_row, touch_in
from box_contact_ros.node.message_bytes import KEPT_FRAMES, RawMessages
from box_contact_ros.node.messages import (
    CLOUD_ROW,
    FRAME_LIMIT,
    MOST_ROWS,
    PATCH_FIELDS,
    ContactsMessage,
    Refused,
    TypedMessages,
    make_header,
    read_cloud,
    read_contacts,
)
from box_contact_ros.scene.scene_solver import Answer, Pair
from box_contact_ros.solver.contact import Contact

STAMPS = st.integers(-2**31 * 10**9, 2**31 * 10**9 - 1)
FRAMES = st.text(st.characters(exclude_characters='\0\N{REPLACEMENT CHARACTER}',
                               exclude_categories=['Cs']), max_size=30)
NAMES = st.text(st.characters(exclude_characters='\0', exclude_categories=['Cs']), max_size=12)
FLOATS = st.floats(width=64)
BOUNDED = st.floats(-1e50, 1e50)


def message(numbers, frame_id='map', stamp=5_000_000_007):
    result = PoseStamped(header=make_header(stamp, frame_id))
    p, q = result.pose.position, result.pose.orientation
    p.x, p.y, p.z, q.x, q.y, q.z, q.w = map(float, numbers)
    return result


def outcome(read, *arguments):
    """Return what a reader says: a pose to the bit, or why not."""
    try:
        pose = read(*arguments)
    except Refused as refused:
        return refused.reason, str(refused)
    return pose.numbers.tobytes(), pose.frame_id, pose.stamp


@given(st.lists(st.tuples(st.one_of(st.tuples(*[FLOATS] * 7), st.tuples(*[BOUNDED] * 7)), FRAMES,
                          STAMPS), min_size=1, max_size=5))
def test_poses_are_read_alike(poses):
    """Bytes and objects give the same pose to the bit, or the same refusal.

    Any numbers, frames and stamps, one after another: the raw reader keeps what it knows of the
    frame before.
    """
    raw, typed = RawMessages(), TypedMessages()
    for numbers, frame_id, stamp in [*poses, *poses]:
        one = message(numbers, frame_id, stamp)
        assert outcome(raw.read_pose, bytes(serialize_message(one))) == outcome(
            typed.read_pose, one)


APART = Contact(False, 0.5, np.full(3, np.nan), np.full(3, np.nan), 0.0, np.full((3, 3), np.nan))


def contact(draw):
    three = st.tuples(*[BOUNDED] * 3)
    return Contact(True, draw(BOUNDED), np.array(draw(three)), np.array(draw(three)),
                   draw(FLOATS), np.array(draw(st.tuples(three, three, three))))


@given(st.data(), STAMPS, FRAMES, st.integers(0, 4), st.integers(0, 2), st.integers(0, 3))
def test_answers_are_written_alike(data, stamp, frame_id, touching, close, stale):
    """Decoded, the bytes are the objects.

    Any number of rows, any frame and names (their lengths move all that follows), pairs that are
    close, pairs that are stale.
    """
    pairs = [Pair(n * 10**9 % 2**32, *data.draw(st.tuples(*[NAMES] * 3)))
             for n in range(touching + close + stale)]
    close_pairs = pairs[touching:touching + close]
    answer = Answer([(pair, contact(data.draw)) for pair in pairs[:touching]],
                    pairs[touching + close:], 0, [(pair, APART) for pair in close_pairs])
    raw, typed = RawMessages(), TypedMessages()
    for messages in (raw, typed):
        messages.begin(stamp, frame_id)
    if ContactsMessage is not None:
        found = deserialize_message(raw.contacts(answer), ContactsMessage)
        assert str(found) == str(typed.contacts(answer))  # as text, where NaN is NaN
    cloud = deserialize_message(raw.cloud(answer), PointCloud2)
    wanted = typed.cloud(answer)
    assert bytes(cloud.data) == bytes(wanted.data)
    cloud.data = wanted.data = []  # NaN differs from itself
    assert cloud == wanted
    for _, found in answer.touching:
        assert deserialize_message(raw.point(found), PointStamped) == typed.point(found)
        assert deserialize_message(raw.normal(found), Vector3Stamped) == typed.normal(found)
    wrench = np.array(data.draw(st.tuples(*[BOUNDED] * 6)))
    assert deserialize_message(raw.wrench(wrench), WrenchStamped) == typed.wrench(wrench)


GOOD = bytes(serialize_message(message((1, 2, 3, 0, 0, 0, 1))))


@pytest.mark.parametrize('options', [b'\0\0', b'\0\3', b'\xff\xff'])
@pytest.mark.parametrize('order', ['<', '>'])
def test_what_cdr_leaves_open_makes_no_difference(order, options):
    """Byte order, options, padding of any value, and an empty frame_id with its NUL or without."""
    reader = RawMessages()
    for frame, padding, tail in product(
            (b'ma\0', b'map\0', b'\0', b''), (b'\0', b'\xff'), (b'', b'\xff', b'\0' * 3)):
        head = struct.pack(f'{order}iII', 5, 7, len(frame)) + frame
        data = (b'\0\1' if order == '<' else b'\0\0') + options + head + padding * (
            -len(head) % 8) + struct.pack(f'{order}7d', 1, 2, 3, 0, 0, 0, 1) + tail
        for _ in range(2):  # the second time the reader knows the frame
            pose = reader.read_pose(data)
            assert pose.numbers.tolist() == [1, 2, 3, 0, 0, 0, 1]
            assert (pose.frame_id, pose.stamp) == (frame[:-1].decode(), 5_000_000_007)


@pytest.mark.parametrize('kind', [b'\0\3', b'\0\7', b'\0\x09', b'\0\x0b', b'\1\1'])
def test_another_encapsulation_is_refused_by_its_name(kind):
    """A list of parameters, three forms of XCDR2, and one that nobody has defined."""
    for read, good in ((RawMessages().read_pose, GOOD), (RawMessages().read_poses, ARRAY)):
        with pytest.raises(Refused, match=f'encapsulation 0x{kind.hex()} is neither .* use XCDR1'):
            read(kind + good[2:])


@pytest.mark.parametrize('message_type', READERS)
def test_mutated_messages_are_read_as_rclpy_reads_them(message_type):
    """3,000 of each type, and each outcome occurs. The long run is `message_fuzz.py` itself."""
    tally, differences = fuzz(message_type, 3000, seed=20260)
    assert not differences, differences[0]
    words = {'read', 'not deserialised', 'bad header', *(f'stricter: {name}' for name in STRICTER)}
    assert set(tally) == words | ({'bad pose'} if message_type is PoseStamped else set())
    assert min(tally.values()) > 50


@pytest.mark.parametrize('warm', [False, True])
@given(st.one_of(st.binary(max_size=200), st.binary(max_size=100).map(lambda b: GOOD[:4] + b),
                 st.integers(0, len(GOOD) - 1).map(lambda n: GOOD[:n]),
                 st.binary(min_size=4, max_size=9).map(lambda b: GOOD + b)))
def test_other_bytes_are_refused(warm, data):
    """Garbage, cut short, too long: Refused and no other exception, whatever was read before."""
    reader = RawMessages()
    if warm:
        reader.read_pose(GOOD)
    with pytest.raises(Refused):
        reader.read_pose(data)


@given(st.lists(st.tuples(st.integers(0, len(GOOD) - 1), st.integers(0, 255)), max_size=8))
def test_changed_bytes_are_a_pose_or_refused(changes):
    """What is taken has a finite position and a quaternion that has a length."""
    data = bytearray(GOOD)
    for place, value in changes:
        data[place] = value
    for reader in (RawMessages(), RawMessages()):
        reader.read_pose(GOOD)
        try:
            pose = reader.read_pose(bytes(data))
        except Refused:
            continue
        assert np.isfinite(pose.numbers).all() and np.any(pose.numbers[3:])


def test_memory_for_frames_is_bounded():
    messages = RawMessages()
    for number in range(10 * KEPT_FRAMES):
        messages.begin(number, f'frame {number}')
    assert len(messages._bytes_of) <= KEPT_FRAMES


def as_message(rows, *, only=None, **changes):
    """Return a cloud with the fields of an array, or `only` some; its own words may be changed."""
    datatypes = {'u4': PointField.UINT32, 'f4': PointField.FLOAT32, 'f8': PointField.FLOAT64}
    fields = [PointField(name=name, offset=offset, datatype=datatypes[kind.str[1:]], count=1)
              for name, (kind, offset) in rows.dtype.fields.items() if name in (only or name)]
    given = {'height': 1, 'width': len(rows), 'fields': fields, 'point_step': rows.dtype.itemsize,
             'is_bigendian': rows.dtype['x'].str[0] == '>', 'data': rows.tobytes()}
    return PointCloud2(**given | changes)


FLOAT64S = [name for name in CLOUD_ROW.names if CLOUD_ROW[name] == np.float64]


def some_rows(layout=CLOUD_ROW):
    """Two rows, each float64 another one; float32 would lose point_x."""
    rows = np.zeros(2, dtype=layout)
    for place, name in enumerate(FLOAT64S):
        rows[name] = 4_000_000.123456789 + place, place
    for name in 'xyz':
        rows[name] = rows[f'point_{name}']
    rows['pair'] = 7, 2**32 - 1
    return rows


@pytest.mark.parametrize('order', ['<', '>'])
def test_a_cloud_is_read_by_its_field_names(order):
    """Fields may come in any order, with padding and others between, in either byte order."""
    names = [*reversed(CLOUD_ROW.names), 'colour']
    layout = np.dtype({
        'names': names, 'offsets': [4 + 12 * place for place in range(len(names))], 'itemsize': 224,
        'formats': [f'{order}u4' if name == 'colour' else CLOUD_ROW[name].newbyteorder(order)
                    for name in names]})
    assert np.array_equal(read_cloud(as_message(some_rows(layout))), some_rows())


@pytest.mark.parametrize('patch', [(), PATCH_FIELDS])
def test_an_older_cloud_is_read(patch):
    """Recordings have the point as x y z in float64, some neither volume nor covariance."""
    names = ('x', 'y', 'z', 'normal_x', 'normal_y', 'normal_z', 'depth', 'pair', *patch)
    old = np.dtype([(name, '<u4' if name == 'pair' else '<f8') for name in names])
    rows = np.zeros(2, old)
    rows['x'], rows['depth'], rows['pair'] = 4_000_000.123456789, (0.1, 0.2), (3, 5)
    read = read_cloud(as_message(rows))
    assert read['depth'].tolist() == [0.1, 0.2] and read['pair'].tolist() == [3, 5]
    assert read['point_x'].tolist() == [4_000_000.123456789] * 2
    assert all(np.isnan(read[name]).all() != bool(patch) for name in PATCH_FIELDS)
    assert np.isnan(touch_in(first_row(read)).covariance).all() != bool(patch)


@pytest.mark.parametrize('name', ['pair', *FLOAT64S])
def test_a_wrong_field_is_refused_by_its_name(name):
    """Missing; of another type; more than one number; outside its row."""
    rows = some_rows()
    others = [other for other in rows.dtype.names if other != name]
    with pytest.raises(Refused, match=f"field '{name}' is missing"):
        read_cloud(as_message(rows, only=others))
    for change, words in (({'datatype': PointField.FLOAT32}, 'datatype 7'), ({'count': 2}, '2 of'),
                          ({'offset': 125}, 'outside its row')):
        cloud = as_message(rows)
        field, = (field for field in cloud.fields if field.name == name)
        for attribute, value in change.items():
            setattr(field, attribute, value)
        with pytest.raises(Refused, match=f"field '{name}' .*{words}"):
            read_cloud(cloud)


def test_a_cloud_that_is_cut_short_is_refused():
    with pytest.raises(Refused, match='2 rows of 128 bytes are more than the 255 bytes'):
        read_cloud(as_message(some_rows(), data=some_rows().tobytes()[:-1]))


@pytest.mark.parametrize('long', ['n' * (FRAME_LIMIT + 1), '港' * 100, 'n' * 5_000_000])
def test_names_that_a_stranger_made_long_are_refused(long):
    """Of frames, fields and pairs, unless the scene has a pair of that name."""
    answer = Answer([(Pair(1, long, 'a', 'b'), Contact(
        True, -0.1, np.ones(3), np.ones(3), 1.0, np.eye(3)))], [], 1)
    stale = Answer([], [Pair(1, long, 'a', 'b')], 0)
    messages = TypedMessages()
    for kind in ('cloud', 'contacts'):
        messages.begin(0, long)
        with pytest.raises(Refused, match=f'frame_id has more than {FRAME_LIMIT} bytes'):
            read_contacts(getattr(messages, kind)(Answer([], [], 0)))
    messages.begin(0, 'map')
    for named in (answer, stale):
        with pytest.raises(Refused, match='pair has more than'):
            read_contacts(messages.contacts(named))
        assert read_contacts(messages.contacts(named), {long: 7})['pair'] == [7]
    cloud = messages.cloud(answer)
    cloud.fields = [*cloud.fields, PointField(name=long, count=1)]
    with pytest.raises(Refused, match='field has more than'):
        read_contacts(cloud)


def test_as_many_contacts_as_the_scene_has_pairs():
    """A stranger may send any number, which took its readers seconds a message."""
    stale = Answer([], [Pair(n, f'p{n}', 'a', 'b') for n in range(MOST_ROWS + 1)], 0)
    ids = {pair.name: pair.id for pair in stale.stale}
    messages = TypedMessages()
    messages.begin(0, 'map')
    for message in (messages.contacts(stale), messages.cloud(stale)):
        with pytest.raises(Refused, match=f'{MOST_ROWS + 1} contacts in a message are more than'):
            read_contacts(message)
        assert len(read_contacts(message, ids)) == MOST_ROWS + 1


def test_an_empty_cloud_has_no_rows():
    """Width 0 says: evaluated, no contact."""
    assert len(read_cloud(as_message(some_rows()[:0]))) == 0


def test_a_row_is_the_contact_again():
    """First row to `Contact`: every number to the bit, the covariance symmetric again."""
    wanted = ContactSolver((2, 3, 1), (1, 2, 2), model='exact')(
        (0, 0, 0, 0, 0, 0, 1), (0.3, 0.4, 1.2, 0.1, 0.2, 0.3, 0.9))
    answer = Answer([(Pair(0, 'p', 'a', 'b'), wanted)], [], 1)
    kinds = {'cloud': PointCloud2} | ({'contacts': ContactsMessage} if ContactsMessage else {})
    for messages, name in product((RawMessages(), TypedMessages()), kinds):
        messages.begin(0, 'map')
        message = getattr(messages, name)(answer)
        if messages.raw:
            message = deserialize_message(message, kinds[name])
        found = touch_in(first_row(read_contacts(message)))
        assert (found.separation, found.volume) == (wanted.separation, wanted.volume)
        for name in ('point', 'normal', 'covariance'):
            assert np.array_equal(getattr(found, name), getattr(wanted, name))


# --- pose arrays ----------------------------------------------------------------------------------


def array_message(rows, frame_id='map', stamp=5_000_000_007):
    result = PoseArray(header=make_header(stamp, frame_id))
    result.poses = [message(row).pose for row in rows]
    return result


@given(st.lists(st.tuples(*[FLOATS] * 7), max_size=4), FRAMES, STAMPS)
def test_pose_arrays_are_read_alike(rows, frame_id, stamp):
    """Numbers to the bit, of any count and any frame, whose length moves all that follows."""
    one = array_message(rows, frame_id, stamp)
    found = outcome(RawMessages().read_poses, bytes(serialize_message(one)))
    assert found == outcome(TypedMessages().read_poses, one)
    assert found == (np.array(rows, dtype=float).tobytes(), frame_id, stamp)


ARRAY = bytes(serialize_message(array_message([(1, 2, 3, 0, 0, 0, 1)] * 2)))
COUNT_AT = ARRAY.index(b'\2\0\0\0')


@pytest.mark.parametrize('data', [
    b'', ARRAY[:4], ARRAY[:COUNT_AT], ARRAY[:-1], ARRAY + b'\0' * 4, b'\1' + ARRAY[1:],
    ARRAY[:COUNT_AT] + b'\3\0\0\0' + ARRAY[COUNT_AT + 4:],
    ARRAY[:COUNT_AT] + b'\xff' * 4 + ARRAY[COUNT_AT + 4:],
    ARRAY[:12] + b'\xff' * 4 + ARRAY[16:], GOOD], ids=range(10))
def test_bytes_that_are_no_pose_array_are_refused(data):
    with pytest.raises(Refused) as refused:
        RawMessages().read_poses(data)
    assert refused.value.reason == 'not a PoseArray'


def test_headers_of_pose_arrays_are_checked():
    late = ARRAY[:8] + struct.pack('<I', 10**9) + ARRAY[12:]
    for data in (late, ARRAY.replace(b'map\0', b'm\xffp\0')):
        with pytest.raises(Refused) as refused:
            RawMessages().read_poses(data)
        assert refused.value.reason == 'bad header'


def test_a_big_endian_pose_array():
    head = struct.pack('>iII', 5, 7, 4) + b'map\0' + struct.pack('>I', 1)
    data = b'\0\0\0\0' + head + b'\0' * (-len(head) % 8) + struct.pack('>7d', *range(7))
    poses = RawMessages().read_poses(data)
    assert poses.numbers.tolist() == [[0, 1, 2, 3, 4, 5, 6]] and poses.frame_id == 'map'
    assert poses.numbers.dtype == np.float64 and poses.stamp == 5 * 10**9 + 7

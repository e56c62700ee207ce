"""Messages as bytes: read and written as rclpy's own objects are, and nothing else is taken."""
from __future__ import annotations

import math
import struct
from types import SimpleNamespace

import numpy as np
import pytest
from geometry_msgs.msg import PointStamped, PoseStamped, Vector3Stamped
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import PointCloud2

from box_contact_ros.node.message_bytes import KEPT_FRAMES, RawMessages
from box_contact_ros.node.messages import Refused, TypedMessages, make_header, read_cloud
from box_contact_ros.scene.scene_solver import Answer, Pair
from box_contact_ros.solver.contact import Contact

STAMPS = st.integers(-2**31 * 10**9, 2**31 * 10**9 - 1)
FRAMES = st.text(st.characters(exclude_characters='\0\N{REPLACEMENT CHARACTER}',
                               exclude_categories=['Cs']), max_size=30)
FLOATS = st.floats(width=64)
BOUNDED = st.floats(-1e50, 1e50)


def message(numbers, frame_id='map', stamp=5_000_000_007):
    result = PoseStamped(header=make_header(stamp, frame_id))
    p, q = result.pose.position, result.pose.orientation
    p.x, p.y, p.z, q.x, q.y, q.z, q.w = map(float, numbers)
    return result


def outcome(read, *arguments):
    """What a reader says: a pose to the bit, or why not."""
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


def contact(draw):
    return Contact(True, draw(BOUNDED), np.array(draw(st.tuples(*[BOUNDED] * 3))),
                   np.array(draw(st.tuples(*[BOUNDED] * 3))), 0.0, np.zeros((3, 3)))


@given(st.data(), STAMPS, FRAMES, st.integers(0, 4), st.integers(0, 3))
def test_answers_are_written_alike(data, stamp, frame_id, touching, stale):
    """Decoded, the bytes are the objects.

    Any number of rows, any frame (its length moves all that follows), rows of NaN for stale pairs.
    """
    pairs = [Pair(n * 10**9 % 2**32, 'p', 'a', 'b') for n in range(touching + stale)]
    answer = Answer([(pair, contact(data.draw)) for pair in pairs[:touching]], pairs[touching:], 0)
    raw, typed = RawMessages(), TypedMessages()
    for messages in (raw, typed):
        messages.begin(stamp, frame_id)
    cloud = deserialize_message(raw.cloud(answer), PointCloud2)
    wanted = typed.cloud(answer)
    assert bytes(cloud.data) == bytes(wanted.data)
    cloud.data = wanted.data = []  # NaN differs from itself
    assert cloud == wanted
    for _, found in answer.touching:
        assert deserialize_message(raw.point(found), PointStamped) == typed.point(found)
        assert deserialize_message(raw.normal(found), Vector3Stamped) == typed.normal(found)


GOOD = bytes(serialize_message(message((1, 2, 3, 0, 0, 0, 1))))


def big_endian(frame=b'map\0'):
    head = struct.pack('>iII', 5, 7, len(frame)) + frame
    return b'\0\0\0\0' + head + b'\0' * (-len(head) % 8) + struct.pack('>7d', 1, 2, 3, 0, 0, 0, 1)


def test_big_endian_is_a_message_too():
    pose = RawMessages().read_pose(big_endian())
    assert pose.numbers.tolist() == [1, 2, 3, 0, 0, 0, 1]
    assert (pose.frame_id, pose.stamp) == ('map', 5_000_000_007)


@pytest.mark.parametrize('warm', [False, True])
@given(st.one_of(st.binary(max_size=200), st.binary(max_size=100).map(lambda b: GOOD[:4] + b),
                 st.integers(0, len(GOOD) - 1).map(lambda n: GOOD[:n]),
                 st.binary(min_size=1, max_size=9).map(lambda b: GOOD + b)))
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


@pytest.mark.parametrize('order', ['<', '>'])
def test_a_cloud_is_read_by_its_field_names(order):
    """Fields may come in any order, with padding, in either byte order; float64 stays exact."""
    layout = np.dtype({
        'names': ['pair', 'depth', 'x'], 'formats': [order + 'u4', order + 'f8', order + 'f8'],
        'offsets': [0, 8, 24], 'itemsize': 40,
    })
    rows = np.zeros(2, dtype=layout)
    rows['pair'], rows['depth'], rows['x'] = [7, 9], [0.01, math.nan], [4_000_000.123456789, 1.0]
    cloud = SimpleNamespace(
        is_bigendian=order == '>', point_step=40, width=2, height=1, data=rows.tobytes(),
        fields=[SimpleNamespace(name='pair', offset=0, datatype=6),
                SimpleNamespace(name='depth', offset=8, datatype=8),
                SimpleNamespace(name='x', offset=24, datatype=8)],
    )
    read = read_cloud(cloud)
    assert read['pair'].tolist() == [7, 9]
    assert read['depth'][0] == 0.01 and math.isnan(read['depth'][1])
    assert read['x'][0] == 4_000_000.123456789


def test_an_empty_cloud_has_no_rows():
    """Width 0 says: evaluated, no contact."""
    cloud = SimpleNamespace(
        is_bigendian=False, point_step=60, width=0, height=1, data=b'',
        fields=[SimpleNamespace(name='depth', offset=48, datatype=8)],
    )
    assert read_cloud(cloud)['depth'].size == 0

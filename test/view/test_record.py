# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings: what is written can be read by others, and drives the nodes again."""
from __future__ import annotations

import errno
import math
import signal
import time
from itertools import count
from pathlib import Path

import numpy as np
import pytest
import rclpy
from ros_client import PATIENCE, Client, stamp_of

pytest.importorskip('rosbags')

from box_contact_ros.scene.files.scene_file import read_scene
from geometry_msgs.msg import PoseStamped
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rclpy.context import Context
from rclpy.serialization import serialize_message
from test_bench import bench, rows_of
from visualization_msgs.msg import MarkerArray

from benchmarks.accuracy import limit_of
from box_contact_ros import ContactSolver
from box_contact_ros.node.messages import make_cloud, make_header, read_cloud
from box_contact_ros.node.ros_client import (
    ANSWERS,
    array_message,
    first_row,
    line_marker,
    pose_message,
)
from box_contact_ros.resources import resource_path
from box_contact_ros.scene.scene_solver import SceneSolver
from box_contact_ros.view.recording import bag_player
from box_contact_ros.view.recording.bag_file import (
    TOPICS,
    Recorder,
    RecordingError,
    read_recording,
    read_replay,
    type_of,
)
from box_contact_ros.view.recording.record import RecordNode

ROOT = Path(__file__).resolve().parents[2]
SHIPPED = resource_path('recordings', 'crane_landing')
CONTAINER = (12.192, 2.438, 2.591)
STACK = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
HEARD = (*TOPICS[:4], ANSWERS['cloud'][1])  # what is heard of a contact node here
COUNTS = {'/box_a/pose': 800, '/box_b/pose': 800, '/contact/point': 700, '/contact/normal': 700,
          '/contacts_cloud': 800}


def decoded(folder: Path) -> dict[str, dict[int, object]]:
    """Messages by topic and stamp, as Foxglove's own reader decodes them.

    It does so from the definitions in the file. Two under one stamp fail.
    """
    found: dict[str, dict[int, object]] = {}
    with (folder / f'{folder.name}.mcap').open('rb') as file:
        for _, channel, _, message in make_reader(
                file, validate_crcs=True,
                decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            by_stamp = found.setdefault(channel.topic, {})
            assert stamp_of(message) not in by_stamp
            by_stamp[stamp_of(message)] = message
    return found


def numbers(message) -> list[float]:
    """Return a pose as `x y z qx qy qz qw`."""
    p, q = message.pose.position, message.pose.orientation
    return [p.x, p.y, p.z, q.x, q.y, q.z, q.w]


def vector(message) -> list[float]:
    """Return the numbers of a point or a normal."""
    v = message.point if hasattr(message, 'point') else message.vector
    return [v.x, v.y, v.z]


# --- the shipped recording ------------------------------------------------------------------------


def test_others_can_read_it():
    """Foxglove's reader finds the five topics, their types with definitions, and their counts.

    The chunks are compressed, and all is less than a megabyte.
    """
    with (SHIPPED / 'crane_landing.mcap').open('rb') as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == 'ros2'
        summary = reader.get_summary()
    topics = {channel.topic: summary.schemas[channel.schema_id]
              for channel in summary.channels.values()}
    assert {name: schema.name for name, schema in topics.items()} == {
        name: type_of(name) for name in COUNTS}
    assert all(schema.encoding == 'ros2msg' and schema.data for schema in topics.values())
    assert {channel.topic: summary.statistics.channel_message_counts[number]
            for number, channel in summary.channels.items()} == COUNTS
    assert {chunk.compression for chunk in summary.chunk_indexes} == {'zstd'}
    assert sum(path.stat().st_size for path in SHIPPED.iterdir()) < 1e6


def test_recorded_contacts_agree_with_the_exact_solver():
    """Of every pair of recorded poses: verdict, depth and normal to rounding.

    The point is within the model's stated error; the point and the normal of the messages are those
    of the cloud.
    """
    found = decoded(SHIPPED)
    exact = ContactSolver(CONTAINER, CONTAINER, model='exact')
    errors = []
    for stamp, a in found['/box_a/pose'].items():
        contact = exact(numbers(a), numbers(found['/box_b/pose'][stamp]))
        rows = read_cloud(found['/contacts_cloud'][stamp])
        assert len(rows) == contact.colliding
        for topic in ('/contact/point', '/contact/normal'):
            assert (stamp in found[topic]) == contact.colliding
        if contact.colliding:
            assert rows['depth'] == pytest.approx(-contact.separation, abs=1e-12)
            normal, point = (vector(found[f'/contact/{name}'][stamp])
                             for name in ('normal', 'point'))
            assert normal == pytest.approx(contact.normal, abs=1e-12)
            assert [*point, *normal] == first_row(rows)[:6].tolist()
            errors.append(np.linalg.norm(point - contact.point))
    assert len(errors) == COUNTS['/contact/point']
    assert 100.0 * max(errors) / CONTAINER[0] < limit_of('point', 'containers')


# --- recording ------------------------------------------------------------------------------------


def recording(program, out: Path, *arguments: str):
    """Start `record`, and wait until it listens."""
    running = program('record', '--out', str(out), *arguments)
    running.wait_for_output('recording to', 60)
    return running


def test_a_live_recording(program, tmp_path):
    """All that a client sent and got is in the bag, once, under its stamp; Ctrl-C completes it."""
    out = tmp_path / 'run'
    program('contact_node', '--ros-args', '-p', 'model:=exact').wait_for_output('ready', 120)
    size = list(map(str, CONTAINER))
    running = recording(program, out, '--size-a', *size, '--size-b', *size, '--model', 'exact')
    client = Client()
    try:
        deadline = time.monotonic() + PATIENCE
        while not all(f'receiving /{topic}\n' in running.output for topic in HEARD):
            assert time.monotonic() < deadline, running.output
            client.send(STACK, (0.0, 0.0, 2.5, *STACK[3:]))
            client.spin(lambda: False, 0.1)
        asked = {client.ask(STACK, (0.01 * k, 0.0, 2.6 - 0.001 * k, *STACK[3:])): k
                 for k in range(50)}
        client.spin(lambda: False, 0.5)
    finally:
        client.close()
    running.signal(signal.SIGINT)
    assert running.wait() == 0, running.output
    assert 'Traceback' not in running.output and f'  /{HEARD[-1]} ' in running.output
    found = decoded(out)
    for topic in ('/box_a/pose', '/box_b/pose', f'/{HEARD[-1]}'):
        assert asked.keys() <= found[topic].keys(), topic
    touching = {stamp for stamp, k in asked.items() if k >= 9}  # 2.591 m and below
    for topic, kept in (('/contact/point', client.points), ('/contact/normal', client.normals)):
        assert {stamp for stamp in found[topic] if stamp in asked} == touching
        assert all(vector(found[topic][s]) == vector(kept[s]) for s in touching)
    for stamp, k in asked.items():
        assert numbers(found['/box_b/pose'][stamp])[:3] == [0.01 * k, 0.0, 2.6 - 0.001 * k]
    replay = read_replay(out)
    assert set(asked) <= set(replay.stamps)
    assert replay.sizes == (CONTAINER, CONTAINER)


def publish_poses(running, namespace, topic, frame_id):
    """Publish poses of ticks 0, 1, ... until they are heard, and four more; return all ticks."""
    client = Client(namespace)
    publisher = client.node.create_publisher(PoseStamped, topic, 10)

    sent = count()

    def publish():
        publisher.publish(PoseStamped(header=make_header(next(sent), frame_id)))

    def heard():
        return f'receiving {topic}\n' in running.output

    deadline = time.monotonic() + PATIENCE
    try:
        while not heard():
            assert time.monotonic() < deadline, running.output
            publish()
            client.spin(heard, 0.1)
        for _ in range(4):
            publish()
        client.spin(lambda: False, 0.5)
    finally:
        client.close()
    return list(range(next(sent)))


def test_remapped_topics_and_sigterm(program, tmp_path):
    """One topic under another name; SIGTERM completes the bag too."""
    out = tmp_path / 'run'
    size = list(map(str, CONTAINER))
    running = recording(program, out, '--topics', 'box_a/pose', '--size-a', *size, '--size-b',
                        *size, '--ros-args', '-r', 'box_a/pose:=/yard/load/pose')
    sent = publish_poses(running, '/yard', '/yard/load/pose', 'yard')
    running.signal(signal.SIGTERM)
    assert running.wait() == 0, running.output
    found = decoded(out)
    assert list(found) == ['/yard/load/pose']
    heard = list(found['/yard/load/pose'])
    assert len(heard) >= 5 and heard == sent[-len(heard):]
    assert f'  /yard/load/pose {len(heard)}\n' in running.output
    # A replay knows it by the name that it had before.
    assert {topic for _, topic, _ in read_recording(out).messages} == {'box_a/pose'}


def test_a_scene_is_recorded_with_itself(program, tmp_path):
    """The poses of all boxes that move, contacts and markers; the scene's text is in the bag."""
    out = tmp_path / 'run'
    running = recording(program, out, '--scene', 'yard_bay', '--model', 'exact')
    sent = publish_poses(running, '', '/crane/load/pose', 'map')
    running.signal(signal.SIGINT)
    assert running.wait() == 0, running.output
    found = read_recording(out)
    assert found.scene == read_scene('config/scenes/yard_bay.yaml')
    assert found.about['model'] == 'exact'
    topics = [topic for _, topic, _ in found.messages]
    assert 5 <= len(topics) <= len(sent) and set(topics) == {'crane/load/pose'}
    for topic in ('/contacts 0', '/markers 0', '/crane/markers 0'):
        assert f'  {topic}\n' in running.output


def test_nothing_is_overwritten(program, tmp_path):
    """A folder that exists is refused in one line, and left as it was."""
    (tmp_path / 'kept').touch()
    running = program('record', '--out', str(tmp_path))
    assert running.wait(60) == 1
    assert 'error: cannot record to' in running.output and 'exists' in running.output
    assert 'Traceback' not in running.output
    assert not (tmp_path / 'metadata.yaml').exists()


@pytest.mark.parametrize('arguments, status, words', [
    ('', 2, '--out'),
    ('--out {} --topics box_a/pose scan', 2, "'scan': its type is known only if it ends in"),
    ('--out {} --size-a 1 0 1', 2, '--size-a'),
    ('--out {} --size-a 1 1 1 --scene yard_bay', 2, '--scene says all sizes'),
    ('--out {} --scene no_such_scene', 1, 'error: scene'),
    ('--out {} --ros-args -r nonsense', 1, 'error: '),
])
def test_bad_options(program, tmp_path, arguments, status, words):
    """Said in words; no folder is left behind."""
    out = tmp_path / 'run'
    running = program('record', *arguments.format(out).split())
    assert running.wait(60) == status
    assert words in running.output and 'Traceback' not in running.output
    assert not out.exists()


def test_a_full_disk_ends_the_recording(tmp_path, monkeypatch):
    """Not one message later, with the reason, and an error at the end."""
    def full(*_):
        raise OSError(errno.ENOSPC, 'No space left on device')

    context = Context()
    rclpy.init(context=context)
    node = RecordNode(context, tmp_path / 'run', [HEARD[-1]], {})
    monkeypatch.setattr(node.recorder, 'write', full)
    node._keep(f'/{HEARD[-1]}', b'')
    assert not context.ok()
    with pytest.raises(RecordingError, match='run is not complete: .*No space left'):
        node.destroy_node()
    node.recorder.close()


# --- playing a recording --------------------------------------------------------------------------


class Clock:
    """Time that a test sets."""

    def __init__(self):
        self.seconds = 0.0

    def monotonic(self):
        return self.seconds


def test_a_recording_is_played_into_a_log(monkeypatch):
    """At its own pace, contacts and errors as recorded, and again from the beginning."""
    clock = Clock()
    monkeypatch.setattr(bag_player, 'time', clock)
    player = bag_player.BagPlayer(SHIPPED)
    assert player.model == 'mlp'
    assert player.step()
    assert player.log.snapshot() is not None
    for seconds, touching in ((0.3, 0), (2.0, 1), (3.9, 1)):
        clock.seconds = seconds
        assert not player.step()
        seen = player.log.snapshot()
        assert len(seen.answer.pairs) == touching
        assert len(seen.answer.point_errors) == touching
        assert player.log.figures(player.now()).answered == pytest.approx(200 * seconds, abs=2)
    assert player.log.figures(player.now()).lost == 0
    clock.seconds += 1.0
    assert not player.step()
    assert player.log.figures(player.now()).answered == 800
    clock.seconds += bag_player.PAUSE
    assert player.step()
    assert player.log.figures(player.now()).answered <= 1


def test_a_recording_of_a_scene_is_played(tmp_path, monkeypatch):
    """Every box and pair of it, and the lines of a crane."""
    clock = Clock()
    monkeypatch.setattr(bag_player, 'time', clock)
    text = Path('config/scenes/spreader_container_stack.yaml').read_text('utf-8')
    scene = read_scene(text)
    solver = SceneSolver(scene, model='exact')
    poses = [np.array([0.0, 0, 10.65, 0, 0, 0, 1]), np.array([0.0, 0, 9.06, 0, 0, 0, 1])]
    topics = ['/crane/spreader/pose', '/crane/load/pose', '/contacts_cloud', '/crane/markers']
    header, lines = make_header(1000, 'map'), np.arange(6.0).reshape(1, 2, 3)
    recorder = Recorder(tmp_path / 'run', topics, {'scene': text})
    for topic, message in zip(topics, [
            *(pose_message(header, pose) for pose in poses), make_cloud(header, solver(poses)),
            MarkerArray(markers=[line_marker(header, 'ropes', lines, width=1, colour=(0, 0, 0))])]):
        recorder.write(topic, 2000, serialize_message(message))
    recorder.close()
    player = bag_player.BagPlayer(tmp_path / 'run')
    player.step()
    clock.seconds = 0.1
    player.step()
    seen = player.log.snapshot()
    assert not np.isnan(seen.poses).any()
    assert {scene.pairs[row].name for row in seen.answer.pairs} == {'load_stack', 'spreader_load'}
    assert np.array_equal(player.lines, lines)


def test_a_recording_without_its_scene_is_not_played(tmp_path):
    """Neither scene nor sizes: said, with the options that would have kept them."""
    with pytest.raises(RecordingError, match='says neither .* record with --scene'):
        bag_player.BagPlayer(written(tmp_path / 'bag', [1], [1]))
    with pytest.raises(RecordingError, match='none of the topics'):
        bag_player.BagPlayer(written(tmp_path / 'other', [1], [1], ('/c/pose', '/d/pose'),
                                     size_a=CONTAINER, size_b=CONTAINER))


# --- replay ---------------------------------------------------------------------------------------


def written(folder: Path, stamps_a, stamps_b, topics=('/box_a/pose', '/box_b/pose'),
            **about) -> Path:
    """Return a bag of poses whose x is their stamp [ns]."""
    recorder = Recorder(folder, topics, about)
    for topic, stamps in zip(topics, (stamps_a, stamps_b)):
        for stamp in stamps:
            message = PoseStamped(header=make_header(stamp, 'world'))
            message.pose.position.x, message.pose.orientation.w = float(stamp), 1.0
            recorder.write(topic, stamp, serialize_message(message))
    recorder.close()
    return folder


def test_replay_pairs_by_stamp(tmp_path):
    """Whatever the order in which poses came; what has no partner is left out."""
    folder = written(tmp_path / 'bag', [5, 1, 2, 9], [2, 3, 9, 5], size_a=CONTAINER,
                     size_b=(1, 2, 3))
    replay = read_replay(folder)
    assert replay.stamps.tolist() == [2, 5, 9] and len(replay) == 3
    assert replay.pose_a[:, 0].tolist() == replay.pose_b[:, 0].tolist() == [2.0, 5.0, 9.0]
    assert replay.pose_a[:, 6].tolist() == [1.0] * 3
    assert replay.sizes == (CONTAINER, (1.0, 2.0, 3.0)) and replay.name == 'bag'
    assert read_replay(folder, size_a=(4, 5, 6)).size_a == (4.0, 5.0, 6.0)
    assert replay.thinned(2).stamps.tolist() == [2, 9] and replay.thinned(None) is replay
    assert replay.described == '3 pairs of poses, recorded in 0.00 s'


def test_an_mcap_file_alone(tmp_path):
    """It has the poses but not the sizes, which have to be given; other topics can be named."""
    folder = written(tmp_path / 'bag', [1, 2], [1, 2], ('/yard/load/pose', '/yard/s1/pose'),
                     size_a=CONTAINER, size_b=CONTAINER)
    file, topics = folder / 'bag.mcap', ('/yard/load/pose', 'yard/s1/pose')
    with pytest.raises(RecordingError, match='does not say the size of box_a: give --size-a'):
        read_replay(file, *topics)
    with pytest.raises(RecordingError, match='box_b: give --size-b'):
        read_replay(file, *topics, size_a=CONTAINER)
    assert len(read_replay(file, *topics, size_a=CONTAINER, size_b=CONTAINER)) == 2


def spoiled(tmp_path: Path, kind: str) -> Path:
    """Something that is no recording, or none any more."""
    path = tmp_path / 'spoiled'
    if kind == 'folder':
        path.mkdir()
    elif kind != 'nothing':
        path = path.with_suffix('.mcap')
        data = (SHIPPED / 'crane_landing.mcap').read_bytes()
        half = len(data) // 2
        path.write_bytes({'empty': b'', 'text': b'no bag at all', 'cut off': data[:half],
                          'a hole': data[:half] + bytes(1000) + data[half + 1000:]}[kind])
    return path


@pytest.mark.parametrize('kind', ['nothing', 'folder', 'empty', 'text', 'cut off', 'a hole'])
def test_what_is_no_bag(tmp_path, kind):
    with pytest.raises(RecordingError, match='spoiled.* cannot be read as a bag'):
        read_replay(spoiled(tmp_path, kind), size_a=CONTAINER, size_b=CONTAINER)


def test_what_cannot_be_replayed(tmp_path):
    """No such topic, no poses on it, no pairs, sizes that are none."""
    with pytest.raises(RecordingError, match="no topic 'box_c/pose'; it has: /box_a/pose, "):
        read_replay(SHIPPED, 'box_c/pose')
    with pytest.raises(RecordingError, match='contacts_cloud is sensor_msgs/msg/PointCloud2, not '):
        read_replay(SHIPPED, topic_b='contacts_cloud')
    with pytest.raises(RecordingError, match='no two poses of equal stamp: 2 stamps on box_a/pose'):
        read_replay(written(tmp_path / 'apart', [1, 2], [3]))
    with pytest.raises(ValueError, match='size_b'):
        read_replay(SHIPPED, size_b=(1, -1, 1))


def test_bench_replays_it(program, tmp_path):
    """Contact and echo node answer all that is sent of it, with the recorded verdicts."""
    running = bench(program, tmp_path, '--quick --rate 400 --nodes contact echo --replay '
                                       f'{SHIPPED}')
    assert running.wait(240) == 0, running.output
    assert 'replay: ' in running.output and '100 pairs of poses, recorded in 4.0' in running.output
    rows = rows_of(tmp_path)
    assert list(rows) == [('crane_landing', 'contact'), ('crane_landing', 'echo')]
    for row in rows.values():
        assert (row['sent'], row['answered'], row['lost']) == ('100', '100', '0')
    row = rows['crane_landing', 'contact']
    assert row['wrong_verdicts'] == '0' and 80 < int(row['contacts']) < 95


def test_a_replay_leaves_out_ticks_without_a_box(tmp_path):
    """In an array: rows of NaN, and arrays for another number of boxes. A fixed box is anywhere."""
    text = ('{poses: array, boxes: {a: {size: [1, 1, 1]}, b: {size: [1, 1, 2]}, floor: {size: '
            '[9, 9, 1], pose: [0, 0, -0.5, 0, 0, 0, 1]}}, pairs: [{a: a, b: b}, {a: b, b: floor}]}')
    recorder = Recorder(tmp_path / 'run', ['/poses'], {'scene': text})
    here, absent = np.array(STACK), np.full(7, math.nan)
    for stamp, poses in enumerate([[here, here], [absent, here], [here], [here, absent], []], 1):
        recorder.write('/poses', stamp, serialize_message(
            array_message(make_header(stamp, 'world'), poses)))
    recorder.close()
    first, floor = read_replay(tmp_path / 'run'), read_replay(tmp_path / 'run', pair='b_floor')
    assert first.stamps.tolist() == [1] and first.sizes == ((1, 1, 1), (1, 1, 2))
    assert floor.stamps.tolist() == [1, 2] and floor.pose_b[:, 2].tolist() == [-0.5, -0.5]
    with pytest.raises(RecordingError, match=r"no pair 'b_flor' \(did you mean b_floor\?\)"):
        read_replay(tmp_path / 'run', pair='b_flor')
    with pytest.raises(RecordingError, match='does not say its scene'):
        read_replay(SHIPPED, pair='a_b')

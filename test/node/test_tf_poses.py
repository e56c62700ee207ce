# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Boxes that are frames in /tf: the same contacts as from pose topics, refusals, time, changes.

Everything runs against a stand-in for tf2_ros, whose messages are handed over directly. Where the
real one can be imported, the same runs against it, over DDS.
"""
from __future__ import annotations

import gc
import importlib
import itertools
import re
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import tf2_stand_in
from geometry_msgs.msg import (
    PoseArray,
    PoseStamped,
    Quaternion,
    Transform,
    TransformStamped,
    Vector3,
)
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_client import Client, stamp_of
from visualization_msgs.msg import MarkerArray

from box_contact_ros import ContactSolver
from box_contact_ros.demo.ros_client import ANSWERS, pose_message
from box_contact_ros.node.contact_node import ContactNode
from box_contact_ros.node.messages import CLOUD_ROW, make_header, read_contacts
from box_contact_ros.node.topics import tf_poses
from box_contact_ros.scene.files.scene_file import SceneError, read_scene
from box_contact_ros.scene.pose import quaternion_multiply, rotation_matrix
from box_contact_ros.view.markers import MarkersNode
from box_contact_ros.view.scene_driver import SceneDriver

SECOND, MS = 10**9, 10**6
START = 1_000 * SECOND
SCENE = """\
frame_id: map
boxes:
  load: {size: [2, 2, 2], frame: hook}
  lorry: {size: [2, 2, 2], pose_topic: lorry/pose}
  post: {size: [1, 1, 4], frame: post}
  floor: {size: [20, 20, 1], pose: [0, 0, -0.5, 0, 0, 0, 1]}
pairs:
  - {a: load, b: floor}
  - {a: load, b: lorry}
  - {a: load, b: post}
  - {a: lorry, b: post}
"""
IN_TOPICS = SCENE.replace(', frame: hook', '').replace(', frame: post', '')
LORRY = np.array([0.5, 0, 1.0, 0, 0, 0, 1])
POST = np.array([1.2, 0, 2.0, 0, 0, 0, 1])
LOAD = np.array([0.1, 0.2, 0.9, 0, 0, 0, 1])
CUBE = (2.0, 2.0, 2.0)
HAVE_TF2 = tf_poses.has_tf2()


def transform(parent, child, pose, stamp=0):
    x, y, z, qx, qy, qz, qw = map(float, pose)
    return TransformStamped(header=make_header(stamp, parent), child_frame_id=child,
                            transform=Transform(translation=Vector3(x=x, y=y, z=z),
                                                rotation=Quaternion(x=qx, y=qy, z=qz, w=qw)))


class TfClient(Client):
    """Two contact nodes, of which /yard hears /tf; all in one thread, on one executor."""

    def __init__(self, real):
        super().__init__('/yard')
        self.real, self.nodes = real, []
        self.of_topics = {}
        deep = QoSProfile(depth=1000)
        kind, topic = ANSWERS['cloud']
        self.node.create_subscription(
            kind, f'/plain/{topic}',
            lambda message: self.of_topics.update({stamp_of(message): message}), deep)
        self.poses = {topic: self.node.create_publisher(PoseStamped, topic, deep) for topic in (
            '/yard/lorry/pose', '/yard/truck/pose', '/plain/lorry/pose', '/plain/load/pose',
            '/plain/post/pose')}
        if real:
            kind = tf_poses.tf_message()
            latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
            self.tf = {static: self.node.create_publisher(kind, topic, qos) for static, topic, qos
                       in ((True, '/tf_static', latched), (False, '/tf', deep))}

    def start(self, scene=SCENE, namespace='yard', kind=ContactNode, **parameters):
        """Start a node; return it."""
        given = {'scene': scene} | ({'model': 'exact'} if kind is ContactNode else {}) | parameters
        node = kind(self.context, namespace=namespace, parameter_overrides=[
            Parameter(name, value=value) for name, value in given.items()])
        self.executor.add_node(node)
        self.nodes.append(node)
        publishers = [*self.poses.values(), *(self.tf.values() if self.real else ())]
        heard = [publisher for publisher in publishers
                 if publisher.topic_name in {
                     subscription.topic_name for subscription in node.subscriptions}]
        assert self.spin(lambda: all(one.get_subscription_count() for one in heard))
        return node

    def move(self, *transforms, static=False):
        """Bring transforms to the first node, as one message."""
        listeners = [self.nodes[0]._topics.tf, *(
            node._tf for node in self.nodes if isinstance(node, MarkersNode))]
        if self.real:
            heard = []
            for tf in listeners:
                tf.look_up = lambda usual=tf.look_up: heard.append(usual())
            self.tf[static].publish(tf_poses.tf_message()(transforms=transforms))
            assert self.spin(lambda: len(heard) == len(listeners))
            for tf in listeners:
                del tf.look_up
            return
        for tf in listeners:
            (tf._on_static if static else tf._on_moving)(SimpleNamespace(transforms=transforms))

    def pose(self, topic, pose, stamp, frame='map'):
        self.poses[topic].publish(pose_message(make_header(stamp, frame), pose))

    def answer(self, stamp):
        """Return the contacts of a stamp by pair; a pair that is stale is None."""
        assert self.spin(lambda: stamp in self.clouds, 10.0), 'no answer'
        return by_pair(self.clouds[stamp])

    def close(self):
        for node in self.nodes:
            self.executor.remove_node(node)
            node.destroy_node()
        super().close()
        gc.unfreeze()  # else the node stays on the network
        gc.collect()


def by_pair(message):
    ids = read_scene(SCENE).ids
    names = {number: name for name, number in ids.items()}
    return {names[row['pair']]: None if np.isnan(row['depth']) else row
            for row in read_contacts(message, ids)}


@pytest.fixture(params=[False, pytest.param(True, marks=pytest.mark.skipif(
    not HAVE_TF2, reason='tf2_ros is not installed'))], ids=['stand-in', 'tf2_ros'])
def client(request, monkeypatch):
    if not request.param:
        usual = importlib.import_module
        # A subscription needs a type that there is; nobody publishes on it.
        modules = {'tf2_ros': tf2_stand_in.MODULE, 'tf2_msgs.msg': SimpleNamespace(
            TFMessage=PoseArray)}
        monkeypatch.setattr(tf_poses, 'import_module',
                            lambda name: modules.get(name) or usual(name))
    client = TfClient(request.param)
    yield client
    client.close()


@pytest.mark.parametrize('pairing', ['stamp', 'latest'])
def test_the_same_contacts_as_from_topics(client, pairing):
    """LAW: a chain of two moving frames, a static frame and a topic give what three topics give."""
    node = client.start(pairing=pairing)
    client.start(IN_TOPICS, 'plain', pairing='stamp')
    client.move(transform('map', 'post', POST), static=True)
    rng = np.random.default_rng(3)
    touched = 0
    for tick in range(40):
        stamp = START + tick * MS
        crane, hook = (np.concatenate([rng.uniform(-0.4, 0.4, 3) + [0.2, 0.0, height],
                                       turn / np.linalg.norm(turn)])
                       for height, turn in zip((0.0, 0.9), rng.normal(size=(2, 4))))
        load = np.concatenate([crane[:3] + rotation_matrix(crane[3:]) @ hook[:3],
                               quaternion_multiply(crane[3:], hook[3:])])
        lorry = LORRY + [*rng.uniform(-0.3, 0.3, 3), 0, 0, 0, 0]
        for topic, pose in (('/plain/load/pose', load), ('/plain/lorry/pose', lorry),
                            ('/plain/post/pose', POST)):
            client.pose(topic, pose, stamp)
        client.pose('/yard/lorry/pose', lorry, stamp)
        assert client.spin(lambda at=stamp: at in client.of_topics)
        # Both links in two messages, as of two broadcasters: a pose comes with the second.
        client.move(transform('map', 'crane', crane, stamp))
        client.move(transform('crane', 'hook', hook, stamp))
        # Of two evaluations with `latest`, the second has both.
        assert client.spin(lambda came=(ANSWERS['cloud'][1], stamp):
                           client.order.count(came) == 1 + (pairing == 'latest'))
        found, wanted = by_pair(client.clouds[stamp]), by_pair(client.of_topics[stamp])
        assert found.keys() == wanted.keys()
        for pair, row in found.items():
            for name in CLOUD_ROW.names:
                assert row[name] == pytest.approx(wanted[pair][name], rel=1e-6, abs=1e-9), name
        touched += len(found)
    assert touched > 80
    assert node.counts['poses'] == 2 * 40 + 1  # none is handed on twice


def test_a_static_frame_is_always_current(client):
    """No tick waits for it, it is never stale, and a new value of it is used from then on."""
    node = client.start()
    client.move(transform('map', 'post', POST), transform('map', 'hook', LOAD), static=True)
    for stamp in (START, START + 5 * SECOND, START + 5 * SECOND + 1):
        client.pose('/yard/lorry/pose', LORRY, stamp)
        found = client.answer(stamp)
        assert set(found) == {'load_floor', 'load_lorry', 'load_post', 'lorry_post'}
        assert None not in found.values()
    client.move(transform('map', 'hook', LOAD + [0, 0, 50, 0, 0, 0, 0]), static=True)
    client.pose('/yard/lorry/pose', LORRY, START + 6 * SECOND)
    assert set(client.answer(START + 6 * SECOND)) == {'lorry_post'}
    assert not node.counts['stale pairs']
    # The same frame moves from now on: ticks wait for it, and it can be stale.
    now = START + 7 * SECOND
    client.pose('/yard/lorry/pose', LORRY, now)
    client.answer(now)
    client.move(transform('map', 'hook', LOAD, now + 1))
    assert now + 1 not in client.clouds
    client.pose('/yard/lorry/pose', LORRY, now + 1)
    assert set(client.answer(now + 1)) == {'load_floor', 'load_lorry', 'load_post', 'lorry_post'}


def test_static_frames_alone_are_answered_when_they_come(client):
    scene = '{frame_id: map, boxes: {a: {size: [2, 2, 2], frame: a}, ' \
            'b: {size: [2, 2, 2], frame: b}}, pairs: [{a: a, b: b, name: load_lorry}]}'
    node = client.start(scene)
    client.move(transform('map', 'a', LOAD), static=True)
    client.spin(lambda: False, 0.1)
    assert not client.clouds
    client.move(transform('map', 'b', LORRY), static=True)
    assert client.spin(lambda: 0 in client.clouds) and len(
        getattr(client.clouds[0], 'contacts', [1])) == 1
    assert node.counts['evaluations'] == 1


def test_frames_that_are_not_there_are_named_with_the_remedy(client, capfd):
    """LAW: what the log says is what is wrong, and after the remedy contacts come."""
    node = client.start('{frame_id: map, boxes: {load: {size: [2, 2, 2], frame: hook}, '
                        'lorry: {size: [2, 2, 2], pose_topic: lorry/pose}}, '
                        'pairs: [{a: load, b: lorry}]}', max_age=0.0)
    why = node._topics.why_silent
    assert 'nobody publishes /tf' in why('load') or client.real
    stamps = itertools.count(START, MS)

    def logged(words):
        deadline, told = time.monotonic() + 15.0, ''
        while words not in (told := told + capfd.readouterr().err):
            assert time.monotonic() < deadline, told
            client.spin(lambda: False, 0.05)
            client.pose('/yard/lorry/pose', LORRY, next(stamps))
        assert words.rpartition('load: ')[2] in why('load')

    client.move(transform('map', 'crane', LOAD, START))
    logged("no pose ever came: load: frame 'hook' is in no transform")
    assert node.counts[tf_poses.LOOKUPS] > 0
    assert client.spin(lambda: any(
        'no pose ever came: load' in message.status[0].message and tf_poses.LOOKUPS in {
            entry.key for entry in message.status[0].values} for message in client.diagnostics))
    node._diagnostics._logged.clear()  # else the next line of the kind comes after ten seconds
    client.move(transform('elsewhere', 'hook', LOAD, START))
    logged("frame 'hook' is not connected to 'map'")
    client.move(transform('crane', 'elsewhere', LOAD, START + SECOND))
    at = next(stamps)
    client.move(*(transform(parent, child, LOAD, at) for parent, child in (
        ('map', 'crane'), ('crane', 'elsewhere'), ('elsewhere', 'hook'))))
    client.pose('/yard/lorry/pose', LORRY, at)
    assert list(client.answer(at)) == ['load_lorry']


def test_transforms_that_are_none(client):
    """Stamp 0 on /tf, NaN, a quaternion of zeros: counted or left to tf2, and never answered."""
    node = client.start(max_age=0.0)
    client.move(transform('map', 'hook', LOAD, 0))
    assert client.spin(lambda: node.counts[tf_poses.UNSTAMPED] == 1)
    assert 'have stamp 0: set header.stamp, or use /tf_static' in node._topics.why_silent('load')
    client.move(transform('map', 'post', POST), static=True)
    for number, pose in enumerate((np.full(7, np.nan), [0.0] * 7), 1):
        client.move(transform('map', 'hook', pose, START + number))
        client.pose('/yard/lorry/pose', LORRY, START + number)
    stamp = START + 9
    client.move(transform('map', 'hook', LOAD, stamp))
    client.pose('/yard/lorry/pose', LORRY, stamp)
    assert set(client.answer(stamp)) == {'load_floor', 'load_lorry', 'load_post', 'lorry_post'}
    assert all(answer and 'load_floor' not in answer for at, answer in (
        (at, by_pair(message)) for at, message in client.clouds.items()) if at < stamp)


@pytest.mark.parametrize('static', [True, False])
def test_names_and_numbers_of_strangers_frames_are_bounded(client, monkeypatch, static):
    """tf2 forgets no frame. Those that are known go on, and are answered."""
    monkeypatch.setattr(tf_poses, 'MOST_FRAMES', 20)
    node = client.start(max_age=0.0)
    client.move(transform('map', 'post', POST), static=True)
    client.move(transform('map', 'hook', LOAD, START))
    client.move(*(transform(parent, child, LOAD, START) for parent, child in (
        ('map', 'x' * 256), ('x' * 256, 'y'))), static=static)
    assert client.spin(lambda: node.counts[tf_poses.BAD] == 2)
    client.move(*(transform('map', f'f{n}', LOAD, START) for n in range(100)), static=static)
    assert client.spin(lambda: node.counts[tf_poses.BAD] == 2 + 100 - 20 + 3)
    client.move(transform('map', 'hook', LOAD, START + 1))
    client.pose('/yard/lorry/pose', LORRY, START + 1)
    assert 'load_lorry' in client.answer(START + 1)


def test_time_goes_back(client):
    """A recording begins anew: it is answered from its second tick, as tf2 would not."""
    node = client.start()
    client.move(transform('map', 'post', POST), static=True)
    for stamp in (START, START + 60 * SECOND, START + MS, START + 2 * MS):
        client.move(transform('map', 'hook', LOAD, stamp))
        client.pose('/yard/lorry/pose', LORRY, stamp)
        assert client.answer(stamp)['load_floor'] is not None
    assert node.counts['time went back'] >= 1


def test_scene_and_state_change(client):
    """A box changes frame, then to a topic and back; the node is deactivated and activated."""
    node = client.start()
    client.move(transform('map', 'post', POST), transform('map', 'higher', POST + [
        0, 0, 50, 0, 0, 0, 0]), static=True)

    def tick(stamp):
        client.move(transform('map', 'hook', LOAD, stamp))
        client.pose('/yard/lorry/pose', LORRY, stamp)
        return client.answer(stamp)

    assert tick(START)['lorry_post'] is not None
    for number, (scene, pair) in enumerate((
            (SCENE.replace('frame: post', 'frame: higher'), 'apart'), (SCENE, 'touching'),
            (SCENE.replace('frame: post', 'frame: unknown'), 'stale'), (SCENE, 'touching')), 1):
        result, = node.set_parameters([Parameter('scene', value=scene)])
        assert result.successful, result.reason
        found = tick(START + number * MS)
        assert {'apart': 'lorry_post' not in found, 'stale': found.get('lorry_post', '') is None,
                'touching': found.get('lorry_post') is not None}[pair]
        assert found['load_floor'] is not None
    node.set_parameters([Parameter('scene', value=IN_TOPICS)])
    assert not node._topics.tf.topics()
    node.set_parameters([Parameter('scene', value=SCENE)])
    assert sorted(node._topics.tf.topics()) == ['/tf', '/tf_static']
    client.move(transform('map', 'post', POST), static=True)
    node.trigger_deactivate()
    assert not node._topics.tf.topics()
    node.trigger_activate()
    if client.real:
        assert client.spin(lambda: client.tf[False].get_subscription_count() == 1)
        assert client.spin(lambda: 'post' in node._topics.tf._newest)  # latched
    else:
        # The first tick waits for all boxes: what was static before is forgotten.
        answered = len(client.clouds)
        for at in range(START + 10 * MS, START + 500 * MS, MS):
            heard = node.counts['poses']
            client.move(transform('map', 'hook', LOAD, at))
            client.pose('/yard/lorry/pose', LORRY, at)
            if client.spin(lambda heard=heard: node.counts['poses'] == heard + 2, 0.1):
                break  # the lorry's publisher has been found again
        assert not client.spin(lambda: len(client.clouds) > answered, 0.3)
    client.move(transform('map', 'post', POST), static=True)
    assert None not in tick(START + SECOND).values()


def test_without_tf2_the_scene_is_refused_with_its_line(client, monkeypatch):
    """By the node, before and while it runs; nothing else needs tf2."""
    def missing(name):
        raise ModuleNotFoundError(name)
    monkeypatch.setattr(tf_poses, 'import_module', missing)
    scene = read_scene(SCENE)
    assert scene.frames == {'load': 'hook', 'post': 'post'}
    with pytest.raises(SceneError, match=(
            r'^scene:3: boxes\.load\.frame: tf2_ros is not installed here: '
            r'apt install ros-jazzy-tf2-ros-py, or give the box a pose_topic$')):
        client.start()
    node = client.start(IN_TOPICS, 'plain')
    result, = node.set_parameters([Parameter('scene', value=SCENE)])
    assert not result.successful and 'boxes.load.frame' in result.reason
    client.pose('/plain/lorry/pose', LORRY, START)
    client.pose('/plain/load/pose', LOAD, START)
    client.pose('/plain/post/pose', POST, START)
    assert client.spin(lambda: START in client.of_topics)


def drawn(message):
    """Return the boxes of a message of markers, and how many contacts."""
    names = list(read_scene(SCENE).boxes)
    return ({names[marker.id]: marker.pose.position.z for marker in message.markers
             if marker.ns == 'boxes' and not marker.action},
            sum(marker.ns == 'normals' and not marker.action for marker in message.markers))


def test_markers_draw_frames(client):
    """Moving and static ones with their contacts; after a change, where they are then."""
    client.start()
    client.start(kind=MarkersNode, rate=100.0)
    arrays = []
    client.node.create_subscription(MarkerArray, 'markers', arrays.append, 10)
    client.move(transform('map', 'post', POST), static=True)
    for number, height in enumerate((0.9, 0.95)):
        stamp = START + number * MS
        load = [*LOAD[:2], height, *LOAD[3:]]
        client.move(transform('map', 'hook', load, stamp))
        client.pose('/yard/lorry/pose', LORRY, stamp)
        assert client.spin(lambda z=height: arrays and drawn(arrays[-1]) == (
            {'load': z, 'lorry': 1.0, 'post': 2.0, 'floor': -0.5}, 4), 10.0)


def test_clients_without_tf2_draw_and_record_what_they_can(client, monkeypatch, tmp_path, capsys):
    def missing(name):
        raise ModuleNotFoundError(name)
    client.start()
    client.move(transform('map', 'post', POST), transform('map', 'hook', LOAD), static=True)
    monkeypatch.setattr(tf_poses, 'import_module', missing)
    markers = client.start(kind=MarkersNode, rate=100.0)
    arrays = []
    client.node.create_subscription(MarkerArray, 'markers', arrays.append, 10)
    assert not any('/tf' in entity.topic_name for entity in markers.subscriptions)
    for stamp in range(START, START + 200 * MS, MS):
        client.pose('/yard/lorry/pose', LORRY, stamp)
        if client.spin(lambda: arrays and drawn(arrays[-1]) == (
                {'lorry': 1.0, 'floor': -0.5}, 4), 0.05):
            break
    else:
        pytest.fail(f'drawn: {arrays[-1:]}')
    record = pytest.importorskip('box_contact_ros.view.recording.record')
    (tmp_path / 'scene.yaml').write_text(SCENE)
    recorder = record.node_of(['--out', str(tmp_path / 'run'), '--scene',
                               str(tmp_path / 'scene.yaml')])(client.context)
    assert '/tf' not in recorder.recorder.kinds and '/lorry/pose' in recorder.recorder.kinds
    recorder.destroy_node()
    assert 'not recorded, as tf2_msgs is not installed here: /tf, /tf_static' in (
        capsys.readouterr().err)


def test_a_recording_keeps_the_transforms(client, tmp_path):
    """As they came; /tf_static as what `ros2 bag play` is to latch."""
    if not client.real:
        pytest.skip('needs tf2_msgs')
    record = pytest.importorskip('box_contact_ros.view.recording.record')
    from rosbags.rosbag2 import Reader

    from box_contact_ros.view.recording.bag_file import LATCHED, RecordingError, read_replay
    client.start()
    (tmp_path / 'scene.yaml').write_text(SCENE)
    recorder = record.node_of(['--out', str(tmp_path / 'run'), '--scene',
                               str(tmp_path / 'scene.yaml')])(client.context)
    client.executor.add_node(recorder)
    assert client.spin(lambda: client.tf[False].get_subscription_count() == 2)
    client.move(transform('map', 'post', POST), static=True)
    client.move(transform('map', 'hook', LOAD, START))
    counts = recorder.recorder.counts
    assert client.spin(lambda: counts['/tf'] and counts['/tf_static'])
    client.executor.remove_node(recorder)
    recorder.destroy_node()
    with Reader(tmp_path / 'run') as reader:
        offered = {c.topic: c.ext.offered_qos_profiles for c in reader.connections}
    assert offered['/tf_static'] == [LATCHED] and not offered['/tf']
    with pytest.raises(RecordingError, match="load is frame 'hook' in /tf: pairs are replayed"):
        read_replay(tmp_path / 'run')


def test_the_scene_on_the_page(client):
    """It is answered as the page says."""
    page = (Path(__file__).resolve().parents[2] / 'docs/reference/scenes.md').read_text('utf-8')
    text, = (block for block in re.findall(r'```yaml\n(.*?)```', page, re.DOTALL)
             if 'frame:' in block)
    client.start(text)
    client.pose('/yard/truck/pose', LORRY, START)
    client.move(transform('map', 'crane_hook', LOAD, START))
    assert client.spin(lambda: START in client.clouds)
    row, = read_contacts(client.clouds[START], read_scene(text).ids)
    wanted = ContactSolver(CUBE, CUBE, model='exact')(LOAD, LORRY)
    assert row['depth'] == pytest.approx(-wanted.separation)


def test_frames_cannot_be_driven(client):
    with pytest.raises(ValueError, match='boxes with a frame cannot be driven: load, post'):
        SceneDriver(client.context, read_scene(SCENE), 10.0)

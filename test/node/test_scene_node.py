# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A contact node with a scene over DDS: many boxes, changes while it runs, stale boxes, time."""
from __future__ import annotations

import gc
import math
import re
import time
from types import SimpleNamespace

import numpy as np
import poses
import pytest
import rclpy
from geometry_msgs.msg import Point, Pose, PoseArray, PoseStamped, Quaternion
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from ros_client import PATIENCE, Client, serving
from std_msgs.msg import String

from box_contact_ros import ContactSolver
from box_contact_ros.demo.ros_client import ANSWERS
from box_contact_ros.node.contact_node import ContactNode
from box_contact_ros.node.messages import PATCH_FIELDS, make_header, read_contacts
from box_contact_ros.node.rclpy_workarounds import RCLError
from box_contact_ros.node.runtime import LATCHED_QOS
from box_contact_ros.node.topics import scene_topics
from box_contact_ros.scene.files.scene_file import parse_scene

MS = 1_000_000  # ns
SCENE = """\
boxes:
  load: {size: [2, 2, 2]}
  lorry: {size: [2, 2, 2], pose_topic: /traffic/lorry}
  floor: {size: [20, 20, 1], pose: [0, 0, -0.5, 0, 0, 0, 1]}
pairs:
  - {id: 3, name: load_floor, a: floor, b: load}
  - {id: 5, name: load_lorry, a: lorry, b: load}
"""
WITH_CRATE = SCENE.replace('pairs:\n', '  crate: {size: [2, 2, 2]}\npairs:\n') + (
    '  - {id: 8, name: load_crate, a: crate, b: load}\n')
ON_FLOOR = (0, 0, 0.9, 0, 0, 0, 1)    # 0.1 m deep
ON_LORRY = (0, 0, 2.8, 0, 0, 0, 1)    # 0.2 m deep in a lorry on the floor
LORRY = (0.5, 0, 1.0, 0, 0, 0, 1)     # touches nothing that is asked for but the load
CONTACTS = f'/{ANSWERS["cloud"][1]}'
IDS = {'load_floor': 3, 'load_lorry': 5, 'load_crate': 8}  # of all pairs of these scenes


class SceneClient(Client):
    """Publishes poses of boxes by name."""

    pairs, ids = tuple(IDS), IDS

    def __init__(self):
        super().__init__()
        deep = QoSProfile(depth=10_000)
        topics = {'load': 'load/pose', 'lorry': '/traffic/lorry', 'crate': 'crate/pose'}
        self.boxes = {box: self.node.create_publisher(PoseStamped, topic, deep)
                      for box, topic in topics.items()}

    def tick(self, stamp=None, frame='map', **boxes):
        """Publish poses of one stamp; returns it [ns]."""
        stamp = self.next_stamp() if stamp is None else stamp
        for box, pose in boxes.items():
            message = PoseStamped(header=make_header(stamp, frame))
            p, q = message.pose.position, message.pose.orientation
            p.x, p.y, p.z, q.x, q.y, q.z, q.w = map(float, pose)
            self.boxes[box].publish(message)
        return stamp

    def answered(self, stamp, timeout=PATIENCE):
        return self.spin(lambda: stamp in self.clouds, timeout)

    def offer(self, **boxes):
        """Tick until one is answered from all these boxes: no pair is stale."""
        deadline = time.monotonic() + PATIENCE
        while not self.answered(stamp := self.tick(**boxes), 0.1) or any(
                math.isnan(row['depth']) for row in self.rows(stamp).values()):
            assert time.monotonic() < deadline, 'no answer'
        self.spin(lambda: False, 0.2)

    def rows(self, stamp):
        assert self.answered(stamp), 'no answer'
        return {int(row['pair']): row for row in read_contacts(self.clouds[stamp], self.ids)}


@pytest.fixture
def client():
    client = SceneClient()
    yield client
    client.close()


def scene_node(**parameters):
    given = {'scene': SCENE, 'model': 'exact'} | parameters
    return serving(lambda context: ContactNode(context, parameter_overrides=[
        Parameter(name, value=value) for name, value in given.items()]))


@pytest.fixture
def node(client):
    with scene_node() as node:
        client.offer(load=ON_FLOOR, lorry=LORRY)
        yield node


def set_scene(node, text):
    result, = node.set_parameters([Parameter('scene', value=text)])
    return result


def test_ids_that_are_given_away_have_a_limit(client, monkeypatch):
    """A node remembers each, and a stranger's scenes may have new ones for ever."""
    monkeypatch.setattr(scene_topics, 'MOST_IDS', 6)
    text = '{{boxes: {{a: {{size: [1, 1, 1]}}, b: {{size: [1, 1, 1]}}}}, pairs: [{}]}}'
    with scene_node() as node:
        first = len({pair.id for pair in node._evaluator.solver.scene.pairs})
        for number in range(6 - first):
            assert set_scene(node, text.format(f'{{a: a, b: b, id: {100 + number}}}')).successful
        result = set_scene(node, text.format('{a: a, b: b, id: 200}'))
        assert not result.successful and '7 ids, of at most 6' in result.reason
        assert set_scene(node, text.format('{a: a, b: b, id: 100}')).successful


@pytest.mark.parametrize('serialization', ['raw', 'typed'])
def test_all_pairs_in_one_message(client, serialization):
    """Every tick is one message with a row per contact; each pair has topics of its own.

    Only what the pairs need is subscribed to.
    """
    with scene_node(serialization=serialization) as node:
        client.offer(load=ON_FLOOR, lorry=LORRY)
        assert {entity.topic_name for entity in node.subscriptions} >= {'/load/pose',
                                                                        '/traffic/lorry'}
        assert not any('floor' in entity.topic_name for entity in node.subscriptions)
        high = client.tick(load=(9, 9, 9, 0, 0, 0, 1), lorry=LORRY)
        assert client.rows(high) == {}
        both = client.tick(load=(0.5, 0, 0.9, 0, 0, 0, 1), lorry=LORRY)
        rows = client.rows(both)
        assert set(rows) == {3, 5}
        cubes = ContactSolver(poses.CUBE, poses.CUBE, model='exact')
        wanted = cubes(np.array(LORRY), np.array([0.5, 0, 0.9, 0, 0, 0, 1]))
        assert rows[5]['depth'] == -wanted.separation
        assert [rows[5][f'point_{name}'] for name in 'xyz'] == pytest.approx(wanted.point)
        assert [rows[5][name] for name in PATCH_FIELDS] == [
            wanted.volume, *wanted.covariance[np.triu_indices(3)]]
        assert rows[3]['depth'] == pytest.approx(0.1) and rows[3]['normal_z'] == 1
        assert client.spin(lambda: all(both in client.of_pair[pair]
                                       for pair in ('load_floor', 'load_lorry')))
        assert client.of_pair['load_lorry'][both].point.x == rows[5]['x']
        assert high not in client.of_pair['load_floor']


def test_without_pair_topics(client):
    with scene_node(pair_topics=False) as node:
        client.offer(load=ON_FLOOR, lorry=LORRY)
        assert set(client.rows(client.tick(load=ON_FLOOR, lorry=LORRY))) >= {3}
        assert not any('contact/' in entity.topic_name for entity in node.publishers)


def test_boxes_come_and_go_and_no_tick_of_the_others_is_lost(node, client):
    """The scene is set again and again in a stream of 200 Hz: each tick is answered once.

    Those with a crate have its pair.
    """
    stamps, started, scenes = [], time.monotonic(), 0
    while (now := time.monotonic() - started) < 3.0:
        stamps.append(client.tick(load=ON_FLOOR, lorry=LORRY, crate=LORRY))
        client.keep_up(stamps)
        if now > 0.3 * (scenes + 1):
            scenes += 1
            # As a service: the node's own thread serves it.
            assert set_scene(node, WITH_CRATE if scenes % 2 else SCENE).successful
        client.spin(lambda: False, max(0.0, 0.005 * len(stamps) - (time.monotonic() - started)))
    assert scenes >= 6
    assert client.spin(lambda: all(stamp in client.clouds for stamp in stamps)), sum(
        stamp not in client.clouds for stamp in stamps)
    assert all(3 in client.rows(stamp) for stamp in stamps)
    crates = [8 in client.rows(stamp) for stamp in stamps]
    assert any(crates) and not all(crates)


def test_a_bad_scene_changes_nothing(client, tmp_path, monkeypatch):
    """Garbage, a file that is gone or was overwritten with garbage: refused, a text with its line.

    The old scene goes on. Why a file is refused stands in the log: test_strangers.py.
    """
    path = tmp_path / 'scene.yaml'
    path.write_text(WITH_CRATE)
    with scene_node(files_from=str(tmp_path)) as node:
        assert set_scene(node, str(path)).successful
        client.offer(load=ON_FLOOR, lorry=LORRY, crate=LORRY)
        path.write_bytes(b'\x00\xff boxes')
        for source, words in ((str(path), 'refused'), (SCENE + 'boxes', ':9: '),
                              (SCENE.replace('[2, 2, 2]', '[2, 2]'), ':2: boxes.load.size'),
                              (str(tmp_path / 'gone'), 'refused'), ('{' * 10_000, 'scene')):
            result = set_scene(node, source)
            assert not result.successful and words in result.reason, result
            assert set(client.rows(client.tick(load=ON_FLOOR, lorry=LORRY, crate=LORRY))) >= {3}


def test_ids_are_never_used_again(node, client):
    """Neither for other boxes nor under another name; the pair itself may come back."""
    assert set_scene(node, WITH_CRATE).successful
    assert set_scene(node, SCENE).successful
    for changed in (WITH_CRATE.replace('name: load_crate', 'name: other'),
                    WITH_CRATE.replace('a: crate, b: load}', 'a: crate, b: lorry}')):
        result = set_scene(node, changed)
        assert not result.successful and 'id 8' in result.reason
    assert set_scene(node, WITH_CRATE).successful


def test_a_stale_box_is_nan_and_never_an_old_contact(client):
    """The lorry falls silent while the load lies on it: its pair becomes a row of NaN.

    The load and the floor go on; when the lorry is back, all is as before.
    """
    with scene_node(max_age=0.2):
        client.offer(load=ON_LORRY, lorry=LORRY)
        assert 5 in client.rows(client.tick(load=ON_LORRY, lorry=LORRY))
        started, stamps = time.monotonic(), []
        while time.monotonic() - started < 1.0:
            stamps.append(client.tick(load=ON_FLOOR))
            client.spin(lambda: False, 0.02)
        assert client.spin(lambda: all(stamp in client.clouds for stamp in stamps))
        for stamp in stamps:
            rows = client.rows(stamp)
            assert set(rows) == {3, 5} and rows[3]['depth'] == pytest.approx(0.1)
            assert all(math.isnan(rows[5][name])
                       for name in ('point_x', 'normal_x', 'depth', 'cov_zz'))
            assert stamp not in client.of_pair['load_lorry']
        client.tick(load=ON_FLOOR)
        assert client.diagnostic('stale boxes') == 'lorry'
        assert client.diagnostics[-1].status[0].level == b'\x01' or client.diagnostics[
            -1].status[0].message == 'no poses'
        client.tick(lorry=LORRY)
        rows = client.rows(client.tick(load=ON_LORRY, lorry=LORRY))
        assert rows[5]['depth'] == pytest.approx(0.2)


@pytest.mark.parametrize('serialization', ['raw', 'typed'])
def test_close_pairs_are_listed_within_the_margin(client, serialization):
    """Before the touch, without a point and without topics of their own; set while it runs."""
    lorry = (7.0, 0, 1.0, 0, 0, 0, 1)
    with scene_node(serialization=serialization) as node:
        client.offer(load=ON_FLOOR, lorry=lorry)
        above = (0, 0, 1.25, 0, 0, 0, 1)  # 0.25 m above the floor
        assert client.rows(client.tick(load=above, lorry=lorry)) == {}
        result, = node.set_parameters([Parameter('margin', value=0.3)])
        assert result.successful
        stamp = client.tick(load=above, lorry=lorry)
        rows = client.rows(stamp)
        assert set(rows) == {3} and rows[3]['depth'] == -0.25 and rows[3]['volume'] == 0.0
        assert math.isnan(rows[3]['point_x']) and math.isnan(rows[3]['x'])
        rows = client.rows(client.tick(load=(0, 0, 0.9, 0, 0, 0, 1), lorry=lorry))
        assert rows[3]['depth'] == pytest.approx(0.1) and not math.isnan(rows[3]['point_x'])
        assert stamp not in client.of_pair['load_floor']
        result, = node.set_parameters([Parameter('margin', value=-1.0)])
        assert not result.successful


def test_the_scene_is_latched(client):
    """Whoever subscribes later reads all boxes and pairs, and a change is sent."""
    found = []
    with scene_node() as node:
        client.node.create_subscription(
            String, 'contact_node/scene', lambda text: found.append(parse_scene(text.data)),
            LATCHED_QOS)
        assert client.spin(lambda: found)
        assert found[0] == parse_scene(SCENE)
        assert set_scene(node, WITH_CRATE).successful
        assert client.spin(lambda: len(found) > 1) and found[1] == parse_scene(WITH_CRATE)
        sizes = [Parameter('scene', value=''), Parameter('size_b', value=[1.0, 2.0, 3.0])]
        assert node.set_parameters_atomically(sizes).successful
        assert client.spin(lambda: len(found) > 2)
        assert found[2].boxes['box_b'].size == (1.0, 2.0, 3.0)
        assert found[2].ids == {'box_a_box_b': 0}


ARRAY = SCENE.replace('boxes:', 'poses: array\nboxes:').replace(', pose_topic: /traffic/lorry', '')
GONE = (math.nan,) * 7


class ArrayClient(Client):
    """Publishes poses of all boxes as one message."""

    ids = IDS

    def __init__(self):
        super().__init__()
        self.poses = self.node.create_publisher(PoseArray, 'poses', QoSProfile(depth=1000))

    def tick(self, *rows, stamp=None, frame='map'):
        stamp = self.next_stamp() if stamp is None else stamp
        message = PoseArray(header=make_header(stamp, frame))
        for row in rows:
            x, y, z, *turn = map(float, row)
            message.poses.append(Pose(position=Point(x=x, y=y, z=z), orientation=Quaternion(
                **dict(zip('xyzw', turn)))))
        self.poses.publish(message)
        return stamp

    def rows(self, *rows, **options):
        """Return what is answered to a tick, by the pair's id."""
        stamp = self.tick(*rows, **options)
        assert self.spin(lambda: stamp in self.clouds), 'no answer'
        return {int(row['pair']): row for row in read_contacts(self.clouds[stamp], self.ids)}

    def is_answered(self, stamp, timeout=PATIENCE):
        return self.spin(lambda: stamp in self.clouds, timeout)


@pytest.fixture
def array_client():
    client = ArrayClient()
    yield client
    client.close()


@pytest.fixture(params=[('raw', 'stamp'), ('typed', 'latest')], ids='-'.join)
def array_node(array_client, request):
    serialization, pairing = request.param
    with scene_node(scene='frame_id: map\n' + ARRAY, serialization=serialization,
                    pairing=pairing) as node:
        while not array_client.is_answered(array_client.tick(ON_FLOOR, LORRY), 0.1):
            pass
        yield node


def test_one_message_has_all_poses(array_node, array_client):
    """In the order of the boxes; a tick a message; the same answers as by a topic a box."""
    assert {entity.topic_name for entity in array_node.subscriptions
            if 'pose' in entity.topic_name} == {'/poses'}
    rows = array_client.rows(ON_LORRY, LORRY)
    assert set(rows) == {5} and rows[5]['depth'] == pytest.approx(0.2)
    rows = array_client.rows(LORRY, ON_LORRY)
    assert set(rows) == {3, 5} and rows[5]['normal_z'] == -1  # the lorry is on the load
    assert array_client.rows((9, 9, 9, 0, 0, 0, 1), LORRY) == {}


def test_a_box_that_is_not_there_is_nan(array_node, array_client):
    """In this tick alone, whatever the pairing; diagnostics name it."""
    rows = array_client.rows(ON_FLOOR, GONE)
    assert set(rows) == {3, 5} and rows[3]['depth'] == pytest.approx(0.1)
    assert all(math.isnan(rows[5][name]) for name in ('point_x', 'normal_x', 'depth', 'volume'))
    assert array_client.diagnostic('stale boxes') == 'lorry'
    assert not math.isnan(array_client.rows(ON_LORRY, LORRY)[5]['depth'])
    assert set(array_client.rows(GONE, GONE)) == {3, 5}


@pytest.mark.parametrize('bad', [
    (math.nan, 0, 0, 0, 0, 0, 1), (0, 0, 1e60, 0, 0, 0, 1), (0, 0, 0, 0, 0, 0, 0)], ids=str)
def test_a_bad_pose_is_counted_and_its_box_not_there(array_node, array_client, bad):
    rows = array_client.rows(ON_FLOOR, bad)
    assert rows[3]['depth'] == pytest.approx(0.1) and math.isnan(rows[5]['depth'])
    assert array_node.counts['refused: bad pose'] == 1


def test_an_array_of_another_length_or_frame_is_refused(array_node, array_client):
    refused = [array_client.tick(*rows) for rows in ((), (ON_FLOOR,), (ON_FLOOR, LORRY, LORRY))]
    refused.append(array_client.tick(ON_FLOOR, LORRY, frame='odom'))
    assert set(array_client.rows(ON_FLOOR, LORRY)) == {3, 5}  # on the same topic, after those
    assert not any(stamp in array_client.clouds for stamp in refused)
    counts = array_node.counts
    assert counts['refused: wrong number of poses'] == 3
    assert counts['refused: frame_id differs'] == 1


def test_arrays_are_answered_by_their_stamps(array_node, array_client):
    """A late one once with `stamp`, never with `latest`; a repeated one the other way round."""
    late = array_client.next_stamp()
    stamp = array_client.tick(ON_FLOOR, LORRY, stamp=late + 10 * MS)
    assert array_client.is_answered(stamp)
    by_stamp = array_node.get_parameter('pairing').value == 'stamp'
    array_client.tick(ON_FLOOR, LORRY, stamp=late)
    assert array_client.is_answered(late, PATIENCE if by_stamp else 0.2) == by_stamp
    counts = array_node.counts
    evaluations = counts['evaluations']
    array_client.tick(ON_FLOOR, LORRY, stamp=stamp)
    assert array_client.spin(lambda: counts['evaluations'] + counts['refused: repeated stamp']
                             > evaluations)
    assert counts['evaluations'] - evaluations == (not by_stamp)
    assert counts['refused: repeated stamp'] == by_stamp


def test_a_scene_of_topics_becomes_one_of_an_array(array_node, array_client):
    """And back, while the node runs: a stamp of before is no repeated one."""
    assert set_scene(array_node, 'frame_id: map\n' + SCENE).successful
    assert not any(entity.topic_name == '/poses' for entity in array_node.subscriptions)
    assert set_scene(array_node, ARRAY).successful
    while not array_client.is_answered(array_client.tick(ON_FLOOR, LORRY, frame='odom'), 0.1):
        pass
    assert set(array_client.rows(ON_FLOOR, LORRY)) == {3, 5}


def test_latest_pairs_boxes_of_different_rates(client):
    """A lorry at 5 Hz and a load at 100 Hz: every pose is answered with the other's last."""
    with scene_node(pairing='latest', max_age=1.0):
        client.offer(load=ON_LORRY, lorry=LORRY)
        for i in range(100):
            if i % 20 == 0:
                client.tick(lorry=LORRY)
            rows = client.rows(client.tick(load=ON_LORRY))
            assert rows[5]['depth'] == pytest.approx(0.2)
        stamp = client.tick(stamp=client.next_stamp() + 1500 * MS, load=ON_LORRY)
        assert math.isnan(client.rows(stamp)[5]['depth'])


def test_time_that_goes_back_begins_anew(node, client):
    """A simulation that starts again at 0: answered at once, and not with poses of before."""
    early = client.tick(stamp=5 * MS, load=ON_LORRY)
    assert not client.answered(early, 0.5)
    client.tick(stamp=5 * MS, lorry=LORRY)
    assert client.rows(early)[5]['depth'] == pytest.approx(0.2)
    assert client.counts()['time went back'] == 1


def test_frame_of_the_scene(client):
    with scene_node(scene='frame_id: yard\n' + SCENE):
        client.offer(load=ON_FLOOR, lorry=LORRY, frame='yard')
        stamp = client.tick(load=ON_FLOOR, lorry=LORRY, frame='map')
        client.rows(client.tick(load=ON_FLOOR, lorry=LORRY, frame='yard'))
        assert stamp not in client.clouds
        assert client.counts()['refused: frame_id differs'] == 1


def test_deadlines_and_lost_publishers_are_reported(client):
    """A publisher that offers a deadline and misses it; one that goes."""
    with scene_node(deadline=0.1) as node:
        qos = QoSProfile(depth=10, deadline=Duration(seconds=0.1))
        client.boxes = {'load': client.node.create_publisher(PoseStamped, 'load/pose', qos),
                        'lorry': client.node.create_publisher(PoseStamped, '/traffic/lorry', qos)}
        client.offer(load=ON_FLOOR, lorry=LORRY)
        assert client.spin(lambda: node.counts['deadlines missed'] >= 4)
        client.node.destroy_publisher(client.boxes['lorry'])
        client.spin(lambda: node.counts['publishers gone'] >= 1)
        assert node.counts['publishers gone'] == 1


def test_publishers_that_come_and_go_between_two_looks_are_counted(node):
    """Events are looked at once a second: what went is what came less what is more than before."""
    for came, more, gone in ((1, 1, 0), (1, 0, 1), (0, -1, 1), (3, -2, 5)):
        before = node.counts['publishers gone']
        node._topics.events.on_matched('lorry', SimpleNamespace(
            total_count_change=came, current_count_change=more, current_count=1))
        assert node.counts['publishers gone'] == before + gone


def test_no_executor_serves_events_of_topics_that_may_go(node):
    """An event in an executor's queue ends the process if its topic goes; it need not be hit."""
    going = [entity for entity in (*node.publishers, *node.subscriptions)
             if entity.topic_name in (CONTACTS, '/load/pose', '/traffic/lorry')
             or '/contact/' in entity.topic_name]
    assert len(going) == 1 + 2 + 2 * 2
    assert not any(entity.event_handlers for entity in going)


def test_a_refused_tick_keeps_back_no_other(client):
    """The lorry falls silent; of the ticks that waited for it, one is in another frame."""
    with scene_node(scene='frame_id: yard\n' + SCENE, max_age=0.05):
        client.offer(load=ON_FLOOR, lorry=LORRY, frame='yard')
        first = client.next_stamp() + 100 * MS
        stamps = [first + 10 * MS * n for n in range(8)]
        for n, stamp in enumerate(stamps):
            client.tick(stamp=stamp, load=ON_FLOOR, frame='map' if n == 2 else 'yard')
        assert client.answered(stamps[-1])
        assert [client.answered(stamp, 1.0) for stamp in stamps] == [n != 2 for n in range(8)]
        assert client.counts()['refused: frame_id differs'] == 1


@pytest.mark.parametrize('topic', [
    'contacts', 'contacts_cloud', '/contact_node/scene', '/load_floor/contact/point', '/rosout',
    '/contact_node/transition_event'])
def test_a_topic_of_the_node_is_no_pose_topic(node, client, topic):
    """Of another type, it cannot be subscribed to: the scene went half, and the node was deaf."""
    refused = set_scene(node, SCENE.replace('/traffic/lorry', topic))
    assert not refused.successful
    assert refused.reason.startswith(f"scene: pose_topic '{topic}' of box lorry")
    assert client.rows(client.tick(load=ON_LORRY, lorry=LORRY))[5]['depth'] == pytest.approx(0.2)


def refuse(name, node, monkeypatch):
    """Return a topic that the middleware does not let a node subscribe to."""
    create = node.create_subscription

    def create_subscription(kind, topic, *arguments, **options):
        if topic == name:
            raise RCLError('not today')
        return create(kind, topic, *arguments, **options)

    monkeypatch.setattr(node, 'create_subscription', create_subscription)


def test_a_scene_that_fails_half_way_is_taken_back(node, client, monkeypatch):
    refuse('crate/pose', node, monkeypatch)
    refused = set_scene(node, WITH_CRATE.replace('/traffic/lorry', '/traffic/van'))
    assert not refused.successful and refused.reason == 'RCLError: not today'
    client.offer(load=ON_LORRY, lorry=LORRY)
    assert client.rows(client.tick(load=ON_LORRY, lorry=LORRY))[5]['depth'] == pytest.approx(0.2)
    topics = {entity.topic_name for entity in (*node.subscriptions, *node.publishers)}
    assert not any('crate' in topic or 'van' in topic for topic in topics)


def test_a_node_that_cannot_activate_says_why(client, monkeypatch, capfd):
    """It stays inactive, deaf, and can be activated when what was in the way is gone."""
    with scene_node(autostart=False) as node:
        assert node.trigger_configure() == TransitionCallbackReturn.SUCCESS
        refuse('/traffic/lorry', node, monkeypatch)
        assert node.trigger_activate() == TransitionCallbackReturn.FAILURE
        assert 'RCLError: not today' in capfd.readouterr().err
        assert not any('pose' in entity.topic_name for entity in node.subscriptions)
        monkeypatch.undo()
        assert node.trigger_activate() == TransitionCallbackReturn.SUCCESS
        client.offer(load=ON_FLOOR, lorry=LORRY)


def test_a_destroyed_node_leaves_the_network(client):
    """As one of several in a process, which goes on."""
    context = Context()
    rclpy.init(context=context)
    node = ContactNode(context, parameter_overrides=[Parameter('scene', value=SCENE)])
    counted = client.node.count_publishers, client.node.count_subscribers
    try:
        assert client.spin(lambda: counted[0](CONTACTS) == 1)
        assert client.spin(lambda: counted[1]('/traffic/lorry') == 1)
    finally:
        node.destroy_node()
    assert client.spin(lambda: counted[0](CONTACTS) == 0)
    assert client.spin(lambda: counted[1]('/traffic/lorry') == 0)
    context.try_shutdown()
    gc.unfreeze()


@pytest.mark.parametrize('long', ['pose_topic: /' + 'x' * 250, 'name: ' + 'x' * 101])
def test_a_name_that_is_too_long_changes_nothing(node, client, long):
    """It took the node's subscriptions with it, and the old scene did not bring them back."""
    kind, _, name = long.partition(': ')
    text = (SCENE.replace('/traffic/lorry', name) if kind == 'pose_topic'
            else SCENE.replace('load_lorry', name))
    result = set_scene(node, text)
    assert not result.successful
    assert 'length should not exceed' in result.reason or 'is too long' in result.reason
    assert client.rows(client.tick(load=ON_FLOOR, lorry=LORRY)).keys() == {3, 5}
    assert set_scene(node, SCENE).successful
    assert client.rows(client.tick(load=ON_FLOOR, lorry=LORRY)).keys() == {3, 5}


def test_counts_outlive_cleanup(node, client, capfd):
    """Deactivated, cleaned up, configured again: first by a bad file, which is said."""
    client.rows(client.tick(stamp=(stamp := client.next_stamp()), load=ON_FLOOR, lorry=LORRY))
    client.tick(stamp=stamp, load=ON_FLOOR, lorry=LORRY)
    assert client.counts()['refused: repeated stamp'] == 2
    node.trigger_deactivate()
    node.trigger_cleanup()
    node.set_parameters([Parameter('scene', value='nowhere.yaml')])
    assert node.trigger_configure() != TransitionCallbackReturn.SUCCESS
    assert 'nowhere.yaml' in capfd.readouterr().err
    node.set_parameters([Parameter('scene', value=SCENE)])
    node.trigger_configure()
    node.trigger_activate()
    client.offer(load=ON_FLOOR, lorry=LORRY)
    assert client.counts()['refused: repeated stamp'] == 2


def test_lifecycle(client, capfd):
    """Without autostart: configure checks, activate answers, deactivate stops, all by service.

    The log has a line for each state.
    """
    with scene_node(autostart=False, scene=SCENE.replace('[20, 20, 1]', '[20, 20]')) as node:
        change = client.client_of(ChangeState, '/contact_node/change_state')
        state = client.service(GetState, '/contact_node/get_state')

        def now():
            for _ in range(5):
                future = state.call_async(GetState.Request())
                if client.spin(future.done, 5.0):
                    return future.result().current_state.label
            raise AssertionError('no state')

        def transition(label):
            """Whether it succeeded.

            A reply may be lost as long as the way back is not matched: then the state tells.
            """
            before = now()
            request = ChangeState.Request()
            request.transition.label = label
            future = change.call_async(request)
            if client.spin(future.done, 20.0):
                return future.result().success
            return now() != before

        assert now() == 'unconfigured'
        assert not transition('configure') and now() == 'unconfigured'  # the scene is bad
        assert set_scene(node, SCENE).successful
        assert transition('configure') and now() == 'inactive'
        client.tick(load=ON_FLOOR, lorry=LORRY)
        client.spin(lambda: False, 0.5)
        assert not client.clouds
        assert transition('activate') and now() == 'active'
        client.offer(load=ON_FLOOR, lorry=LORRY)
        assert transition('deactivate')
        stamp = client.tick(load=ON_FLOOR, lorry=LORRY)
        assert not client.answered(stamp, 0.5)
        assert transition('activate')
        client.offer(load=ON_FLOOR, lorry=LORRY)
        assert transition('deactivate') and transition('cleanup') and now() == 'unconfigured'
        assert transition('configure') and transition('activate')
        client.offer(load=ON_FLOOR, lorry=LORRY)
    told = re.findall(r'(configured|ready|inactive|unconfigured): (?:model|no pose)',
                      capfd.readouterr().err)
    assert told == ['unconfigured', 'configured', 'ready', 'inactive', 'ready', 'inactive',
                    'unconfigured', 'configured', 'ready']

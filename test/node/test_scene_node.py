# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A contact node with a scene over DDS: many boxes, named poses, stale boxes, time, lifecycle."""
from __future__ import annotations

import json
import math
import re
import time
from contextlib import closing

import numpy as np
import poses
import pytest
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from patience import PATIENCE
from rclpy.lifecycle import TransitionCallbackReturn
from ros_client import DEEP, Client, serving, stamp_of
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import MultiDOFJointState
from std_srvs.srv import Trigger
from typed_messages import contacts_by_pair, joint_state, read

from box_contact_ros import ContactSolver
from box_contact_ros.node.contact_node import ContactNode
from box_contact_ros.node.messages import make_header
from box_contact_ros.node.topics import MOST_PAIRS_WITH_TOPICS, NAMED_DEPTH
from box_contact_ros.scene.scene import ALONE
from box_contact_ros.view.live.listener import read_answer

MS = 1_000_000  # ns
SCENE = """\
boxes:
  load: {size: [2, 2, 2]}
  lorry: {size: [2, 2, 2], pose_topic: /traffic/lorry}
  floor: {size: [20, 20, 1], pose: [0, 0, -0.5, 0, 0, 0, 1]}
pairs:
  - {a: floor, b: load}
  - {name: load_lorry, a: lorry, b: load}
"""
NAMED = SCENE.replace('boxes:', 'poses: named\nboxes:').replace(', pose_topic: /traffic/lorry', '')
FLOOR, BESIDE = 'floor_load', 'load_lorry'  # the pairs
ON_FLOOR = (0, 0, 0.9, 0, 0, 0, 1)    # 0.1 m deep
ON_LORRY = (0, 0, 2.8, 0, 0, 0, 1)    # 0.2 m deep in a lorry on the floor
LORRY = (0.5, 0, 1.0, 0, 0, 0, 1)     # touches nothing that is asked for but the load
FAR = (9, 9, 9, 0, 0, 0, 1)
GONE = (math.nan,) * 7


class NamedClient(Client):
    """Publishes the poses of all boxes as one message; None: a box is not named."""

    names = ('load', 'lorry')

    def __init__(self):
        super().__init__()
        self.poses = self.node.create_publisher(MultiDOFJointState, 'poses', DEEP)

    def send(self, *rows, stamp=None, frame='map'):
        stamp = stamp or self.next_stamp()
        named = {name: row for name, row in zip(self.names, rows, strict=True) if row is not None}
        self.poses.publish(joint_state(named, frame, stamp))
        return stamp


@pytest.fixture
def client():
    topics = {'load': 'load/pose', 'lorry': '/traffic/lorry'}
    with closing(Client(topics=topics, pairs=(FLOOR, BESIDE))) as client:
        yield client


@pytest.fixture
def named_client():
    with closing(NamedClient()) as client:
        yield client


@pytest.fixture
def scene_node(tmp_path):
    """Serve a node with a scene of a text."""
    def start(scene=SCENE, **parameters):
        path = tmp_path / 'scene.yaml'
        path.write_text(scene)
        return serving(ContactNode, scene=str(path), **parameters)
    return start


@pytest.fixture
def node(client, scene_node):
    with scene_node() as node:
        client.offer_until_answered(ON_FLOOR, LORRY)
        yield node


def test_all_pairs_in_one_message(node, client):
    """Every tick is one message with an entry per contact; each pair has topics of its own.

    Only what the pairs need is subscribed to.
    """
    assert {entity.topic_name for entity in node.subscriptions} >= {'/load/pose', '/traffic/lorry'}
    assert not any('floor' in entity.topic_name for entity in node.subscriptions)
    far = client.ask(FAR, LORRY)
    assert not client.contacts[far].contacts
    load = (0.5, 0, 0.9, 0, 0, 0, 1)
    both = client.ask(load, LORRY)
    contacts = contacts_by_pair(client.contacts[both])
    wanted = ContactSolver(poses.CUBE, poses.CUBE, model='exact')(np.array(LORRY), np.array(load))
    assert list(contacts) == [FLOOR, BESIDE]
    assert contacts[BESIDE].volume == wanted.volume
    assert contacts[FLOOR].separation == pytest.approx(-0.1) and contacts[FLOOR].normal[2] == 1
    assert client.points_of[BESIDE][both].point.x == wanted.point[0]
    assert both in client.points_of[FLOOR] and far not in client.points_of[FLOOR]


def test_without_pair_topics(client, scene_node):
    with scene_node(pair_topics=False) as node:
        client.offer_until_answered(ON_FLOOR, LORRY)
        assert FLOOR in client.answer(ON_FLOOR, LORRY)
        assert not any('contact/' in entity.topic_name for entity in node.publishers)


def test_many_pairs_have_no_topics_of_their_own(scene_node):
    boxes = {f'b{n}': {'size': [1, 1, 1]} for n in range(46)}  # 1,035 pairs
    scene = json.dumps({'poses': 'named', 'boxes': boxes, 'pairs': 'all'})
    with pytest.raises(ValueError, match=f'at most {MOST_PAIRS_WITH_TOPICS}.: set pair_topics to '
                                         'false'), scene_node(scene):
        pass
    with scene_node(scene, pair_topics=False) as node:
        assert node._tick.solver.scene.pair_count == 1035


def test_a_stale_pair_is_named_and_never_an_old_contact(client, scene_node):
    """The lorry falls silent while the load lies on it; the load and the floor go on.

    When the lorry is back, all is as before.
    """
    with scene_node(max_age=0.2):
        client.offer_until_answered(ON_LORRY, LORRY)
        assert BESIDE in client.answer(ON_LORRY, LORRY)
        stamps = []
        for _ in range(50):
            stamps.append(client.send(ON_FLOOR))
            client.spin(lambda: False, 0.02)
        # Of the last ticks, some still wait for a lorry that is a little late.
        answered = stamps[:-10]
        assert client.are_answered(answered)
        for stamp in answered:
            contacts = contacts_by_pair(client.contacts[stamp])
            assert list(contacts) == [FLOOR]
            assert client.contacts[stamp].stale == [BESIDE]
            assert stamp not in client.points_of[BESIDE]
        assert client.diagnostic('stale boxes') == 'lorry'
        assert client.diagnostics[-1].status[0].level == b'\x01'
        client.offer_until_answered(ON_LORRY, LORRY)
        assert client.answer(ON_LORRY, LORRY)[BESIDE].separation == pytest.approx(-0.2)


def test_near_pairs_are_listed_within_the_margin(client, scene_node):
    """Before the touch, with their nearest points and without topics of their own."""
    lorry = (7.0, 0, 1.0, 0, 0, 0, 1)
    with scene_node(margin=0.3):
        client.offer_until_answered(ON_FLOOR, lorry)
        assert client.answer((0, 0, 1.35, 0, 0, 0, 1), lorry) == {}
        stamp = client.ask((0, 0, 1.25, 0, 0, 0, 1), lorry)
        assert not client.contacts[stamp].contacts
        near, = client.contacts[stamp].near
        assert (near.pair, near.distance, near.normal.z) == (FLOOR, 0.25, 1.0)
        assert near.point_b.z - near.point_a.z == 0.25
        assert client.answer(ON_FLOOR, lorry)[FLOOR].colliding
        assert stamp not in client.points_of[FLOOR]


def test_frame_of_the_scene_and_a_refused_tick(client, scene_node):
    """A tick in another frame is refused, and keeps back no other that waited with it."""
    with scene_node('frame_id: yard\n' + SCENE):
        while not client.is_answered(client.send(ON_FLOOR, LORRY, frames=('yard', 'yard')), 0.1):
            pass
        first = client.next_stamp() + 100 * MS
        stamps = [first + 10 * MS * n for n in range(20)]
        for n, stamp in enumerate(stamps):
            client.send(ON_FLOOR, stamps=(stamp,), frames=('map' if n == 2 else 'yard',))
        assert client.is_answered(stamps[7])
        assert [client.is_answered(stamp, 0.5) for stamp in stamps[:8]] == [
            n != 2 for n in range(8)]
        assert client.diagnostic('refused: frame_id differs') == '1'


# --- named poses ----------------------------------------------------------------------------------


@pytest.fixture(params=['stamp', 'latest'])
def named_node(named_client, scene_node, request):
    with scene_node('frame_id: map\n' + NAMED, pairing=request.param) as node:
        named_client.offer_until_answered(ON_FLOOR, LORRY)
        yield node


def test_one_message_has_all_poses(named_node, named_client):
    """By their names, in any order; a message is a tick; the same answers as from a topic a box.

    A box that is not named, or has seven NaN, is stale in this tick alone, whatever the pairing.
    """
    assert {entity.topic_name for entity in named_node.subscriptions
            if 'pose' in entity.topic_name} == {'/poses'}
    contacts = named_client.answer(ON_LORRY, LORRY)
    assert list(contacts) == [BESIDE] and contacts[BESIDE].separation == pytest.approx(-0.2)
    contacts = named_client.answer(LORRY, ON_LORRY)
    assert list(contacts) == [FLOOR, BESIDE]
    assert contacts[BESIDE].normal[2] == -1  # the lorry is on the load
    named_client.names = ('lorry', 'load')
    assert list(named_client.answer(ON_LORRY, LORRY)) == list(contacts)
    named_client.names = NamedClient.names
    for gone in (GONE, None):
        stamp = named_client.ask(ON_FLOOR, gone)
        assert list(contacts_by_pair(named_client.contacts[stamp])) == [FLOOR]
        assert named_client.contacts[stamp].stale == [BESIDE]
        assert named_client.diagnostic('stale boxes') == 'lorry'
    assert BESIDE in named_client.answer(ON_LORRY, LORRY)
    assert named_client.contacts[named_client.ask(None, None)].stale == [FLOOR, BESIDE]


def test_a_slow_node_says_so_and_is_late_by_few_ticks(named_node, named_client, monkeypatch):
    """Of ticks at 100 Hz it answers a third, and those that are new. Services come in between."""
    tick, client = named_node._tick, named_client

    def slow(poses, writer=tick._writer):
        time.sleep(0.03)
        return writer(poses)

    slow.solver = tick.solver
    reset = client._client_of(Trigger, 'contact_node/reset')
    monkeypatch.setattr(tick, '_writer', slow)
    sent, behind = [], []

    def stream(done):
        """Send until done, and note how many were sent after each one that is answered."""
        deadline = time.monotonic() + PATIENCE
        while not done():
            assert time.monotonic() < deadline
            sent.append(client.send(ON_FLOOR, LORRY))
            seen = len(client.contacts)
            client.spin(lambda: False, 0.01)
            behind.extend(len(sent) - sent.index(stamp)
                          for stamp in list(client.contacts)[seen:] if stamp in sent)

    stream(lambda: client.diagnostics and client.diagnostics[-1].status[0].message.startswith(
        'answers are late: '))
    status, = client.diagnostics[-1].status
    values = {entry.key: entry.value for entry in status.values}
    assert status.level == b'\x01'
    assert sum(int(values[f'{how} since the last report']) for how in ('lost', 'dropped')) > 3
    assert 0 < int(values['rate [1/s]']) <= 34 and float(values['age p50 [ms]']) > 30.0
    assert max(behind) < 6 * NAMED_DEPTH  # three ticks pass while one is in work
    answered = len(client.contacts)
    future = reset.call_async(Trigger.Request())
    stream(future.done)
    assert future.result().success and len(client.contacts) - answered < 4 * NAMED_DEPTH


def test_pairs_that_no_list_has(named_client, scene_node):
    """With `pairs: all` as with a list. A box that is not there stands for all of its pairs."""
    with scene_node(NAMED.partition('pairs:')[0] + 'pairs: all\n') as node:
        named_client.offer_until_answered(ON_FLOOR, LORRY)
        contacts = named_client.answer(ON_LORRY, LORRY)
        assert list(contacts) == ['load_lorry', 'floor_lorry']
        assert contacts['load_lorry'].normal[2] == pytest.approx(-1.0)
        stamp = named_client.ask(ON_FLOOR, LORRY)
        assert 'floor_load' in contacts_by_pair(named_client.contacts[stamp])
        stamp = named_client.ask(ON_FLOOR, None)
        answer = read_answer(read(named_client.contacts[stamp]), node._tick.solver.scene)
        assert named_client.contacts[stamp].stale == ['lorry']
        assert [pair.label for pair, _ in answer.named()] == ['floor_load']
        assert answer.stale.tolist() == [[1, ALONE]]


def test_two_thousand_boxes(named_client, scene_node):
    """A hundred towers of twenty cubes: every message is answered, with every contact."""
    rows = [(2.0 * tower, 0, 0.999 * cube, 0, 0, 0, 1) for tower in range(100)
            for cube in range(20)]
    named_client.names = [f'b{row}' for row in range(len(rows))]
    boxes = ''.join(f'  {name}: {{size: [1, 1, 1]}}\n' for name in named_client.names)
    with scene_node(f'poses: named\nboxes:\n{boxes}pairs: all\n', pair_topics=False):
        named_client.offer_until_answered(*rows)
        for _ in range(20):
            stamp = named_client.ask(*rows)
            assert len(named_client.contacts[stamp].contacts) == 100 * 19


def test_bad_named_poses_are_refused_and_counted(named_node, named_client):
    """Of a bad pose, the box is not there; another frame refuses the whole message."""
    bad = [(math.nan, 0, 0, 0, 0, 0, 1), (0, 0, 1e60, 0, 0, 0, 1), (0, 0, 0, 0, 0, 0, 0)]
    for pose in bad:
        stamp = named_client.ask(ON_FLOOR, pose)
        assert list(contacts_by_pair(named_client.contacts[stamp])) == [FLOOR]
        assert named_client.contacts[stamp].stale == [BESIDE]
    refused = named_client.send(ON_FLOOR, LORRY, frame='odom')
    named_client.ask(ON_FLOOR, LORRY)  # on the same topic, after it
    assert refused not in named_client.contacts
    counts = named_node.counts
    assert counts['refused: bad pose'] == len(bad)
    assert counts['refused: frame_id differs'] == 1


def test_named_poses_are_answered_by_their_stamps(named_node, named_client):
    """A late one once with `stamp`, never with `latest`; a repeated one the other way round."""
    by_stamp = named_node.get_parameter('pairing').value == 'stamp'
    late = named_client.next_stamp()
    stamp = named_client.ask(ON_FLOOR, LORRY, stamp=late + 10 * MS)
    named_client.send(ON_FLOOR, LORRY, stamp=late)
    assert named_client.is_answered(late, PATIENCE if by_stamp else 0.2) == by_stamp
    counts = named_node.counts
    evaluations = counts['evaluations']
    named_client.send(ON_FLOOR, LORRY, stamp=stamp)
    assert named_client.spin(lambda: counts['evaluations'] + counts['refused: repeated stamp']
                             > evaluations)
    assert counts['evaluations'] - evaluations == (not by_stamp)


# --- bodies ---------------------------------------------------------------------------------------


BODIES = """\
boxes:
  floor: {size: [20, 20, 1], pose: [0, 0, -0.5, 0, 0, 0, 1]}
  crate: {size: [1, 1, 1]}
bodies:
  load:
    boxes:
      hull: {size: [4, 2, 2]}
      foot: {size: [1, 1, 0.5], pose: [1.5, 0, -1.25, 0, 0, 0, 1]}
pairs:
  - {a: floor, b: load}
  - {a: crate, b: load}
"""
TURNED = (0, 0, 1.4, 0, 0, 1, 0)  # half about z: the foot is at x = -1.5 m, 0.1 m deep in the floor
CRATE = (-1.5, 0, 2.8, 0, 0, 0, 1)  # 0.1 m deep in the hull


FOOT, HULL = 'floor_load_foot', 'crate_load_hull'


@pytest.fixture
def body_client():
    topics = {'crate': 'crate/pose', 'load': 'load/pose'}
    with closing(Client(topics=topics, pairs=(FOOT, HULL))) as client:
        yield client


def test_a_body_has_one_pose(body_client, scene_node):
    """On one topic. Its boxes are in pairs, and stale together; diagnostics name the body."""
    with scene_node(BODIES, max_age=0.2) as node:
        assert {entity.topic_name for entity in node.subscriptions
                if entity.topic_name.endswith('pose')} == {'/crate/pose', '/load/pose'}
        body_client.offer_until_answered(CRATE, TURNED)
        contacts = body_client.answer(CRATE, TURNED)
        assert {pair: contact.separation for pair, contact in contacts.items()} == pytest.approx(
            {FOOT: -0.1, HULL: -0.1})
        assert contacts[FOOT].point == pytest.approx([-1.5, 0, -0.05])
        stamps = [body_client.send(None, TURNED) for _ in range(30)]
        assert body_client.is_answered(stamps[0])
        assert body_client.contacts[stamps[0]].stale == ['crate']
        for _ in range(10):
            body_client.send(CRATE)
            body_client.spin(lambda: False, 0.03)
        assert body_client.diagnostic('stale boxes') == 'load'


def test_the_stamp_of_a_body_is_that_of_its_boxes(body_client, scene_node):
    """With `latest`: a later crate does not make the body's contact with the floor newer."""
    with scene_node(BODIES, pairing='latest'):
        body_client.offer_until_answered(CRATE, TURNED)
        load = body_client.ask(None, TURNED)
        crate = body_client.ask(CRATE)
        assert list(contacts_by_pair(body_client.contacts[crate])) == [FOOT, HULL]
        assert crate in body_client.points_of[HULL] and load in body_client.points_of[FOOT]
        assert crate not in body_client.points_of[FOOT]


def test_bodies_are_named_as_boxes_are(named_client, scene_node):
    """A body that is not there is stale by its boxes."""
    named_client.names = ('crate', 'load')
    with scene_node('poses: named\n' + BODIES):
        named_client.offer_until_answered(CRATE, TURNED)
        assert list(named_client.answer(CRATE, TURNED)) == ['floor_load_foot', 'crate_load_hull']
        stamp = named_client.ask(CRATE, None)
        assert named_client.contacts[stamp].stale == ['load_hull', 'load_foot']
        assert named_client.diagnostic('stale boxes') == 'load'


# --- time -----------------------------------------------------------------------------------------


def test_latest_pairs_boxes_of_different_rates(client, scene_node):
    """A lorry at 5 Hz and a load at 100 Hz: every pose is answered with the other's last.

    The topics of a pair carry the newer stamp of its own two poses: the load's contact with the
    floor does not get the stamp of the lorry.
    """
    with scene_node(pairing='latest', max_age=1.0):
        client.offer_until_answered(ON_LORRY, LORRY)
        for number in range(100):
            if number % 20 == 0:
                client.ask(None, LORRY)
            assert client.answer(ON_LORRY)[BESIDE].separation == pytest.approx(-0.2)
        load = client.ask((0.5, 0, 0.9, 0, 0, 0, 1))
        lorry = client.ask(None, LORRY)
        contacts = contacts_by_pair(client.contacts[lorry])
        assert list(contacts) == [FLOOR, BESIDE]
        assert lorry in client.points_of[BESIDE] and lorry not in client.points_of[FLOOR]
        assert load in client.points_of[FLOOR]
        stamp = client.ask(ON_LORRY, stamps=(client.next_stamp() + 1500 * MS,))
        assert client.contacts[stamp].stale == [BESIDE]


def test_time_that_goes_back_begins_anew(node, client):
    """A simulation that starts again at 0: answered at once, and not with poses of before."""
    client.send(ON_LORRY, stamps=(5 * MS,))
    assert not client.is_answered(5 * MS, 0.5)
    assert BESIDE in client.answer(None, LORRY, stamps=(0, 5 * MS))
    assert client.diagnostic('time went back') == '1'


def test_the_service_reset_begins_a_new_time(node, client):
    """A simulation that is reset may send the stamps that it had, however few they are."""
    stamp = client.ask(ON_LORRY, LORRY)
    client.send(ON_LORRY, LORRY, stamps=(stamp,) * 2)
    assert client.spin(lambda: node.counts['refused: repeated stamp'] == 2)
    assert client.call(Trigger, '/contact_node/reset', Trigger.Request()).success
    client.contacts.clear()
    assert BESIDE in client.answer(ON_LORRY, LORRY, stamps=(stamp,) * 2)
    node.trigger_deactivate()
    node.trigger_cleanup()
    assert not client.call(Trigger, '/contact_node/reset', Trigger.Request()).success


def test_a_clock_that_is_set_back(client, scene_node, capfd):
    """Simulated time goes back by half a second, less than the stamps alone would tell.

    What was known of the old time is dropped, and the new time is answered from its first tick.
    """
    clock = client.node.create_publisher(Clock, '/clock', 10)

    def set_clock(stamp):
        """Say the time until the node's diagnostics carry it."""
        message = Clock(clock=make_header(stamp, '').stamp)
        deadline = time.monotonic() + PATIENCE
        while not client.diagnostics or stamp_of(client.diagnostics[-1]) != stamp:
            assert time.monotonic() < deadline, 'the node does not take the time'
            clock.publish(message)
            client.spin(lambda: False, 0.1)

    with scene_node(use_sim_time=True) as node:
        client.offer_until_answered(ON_FLOOR, LORRY)
        start_of_time = client.next_stamp() + 10**12
        set_clock(start_of_time + 500 * MS)
        stamps = [start_of_time + 5 * MS * number for number in range(100)]
        resets = node.counts['time went back']
        for _ in range(2):
            for number, stamp in enumerate(stamps):
                client.send(ON_FLOOR, LORRY, stamps=(stamp,) * 2)
                client.keep_up(stamps[:number + 1])
            assert client.are_answered(stamps)
            if node.counts['time went back'] == resets:
                client.contacts.clear()
                set_clock(start_of_time)
        assert node.counts['time went back'] == resets + 1
        assert 'refused: repeated stamp' not in node.counts
    assert 'time went back: /clock was set back' in capfd.readouterr().err


# --- lifecycle ------------------------------------------------------------------------------------


def test_lifecycle_reads_the_scene_file_again(client, scene_node, tmp_path, capfd):
    """By service: configure checks, activate answers, deactivate stops; counts go on.

    A file that is bad leaves the node unconfigured, and the log says why.
    """
    path = tmp_path / 'scene.yaml'

    def state():
        return client.call(GetState, '/contact_node/get_state', GetState.Request()
                           ).current_state.label

    def change(*labels):
        return [client.call(ChangeState, '/contact_node/change_state', ChangeState.Request(
            transition=Transition(label=label))).success for label in labels]

    with scene_node(SCENE.replace('[20, 20, 1]', '[20, 20]'), autostart=False) as node:
        assert state() == 'unconfigured'
        assert change('configure') == [False] and state() == 'unconfigured'
        assert 'boxes.floor.size' in capfd.readouterr().err
        path.write_text(SCENE)
        assert change('configure') == [True] and state() == 'inactive'
        assert not client.is_answered(client.send(ON_FLOOR, LORRY), 0.5)
        assert change('activate') == [True] and state() == 'active'
        client.offer_until_answered(ON_FLOOR, LORRY)
        client.send(ON_FLOOR, LORRY, stamps=(client.ask(ON_FLOOR, LORRY),) * 2)
        assert client.diagnostic('refused: repeated stamp') == '2'
        assert change('activate') == [False] and state() == 'active'
        path.write_text(SCENE.replace('[20, 20, 1]', '[20, 20, 1.4]'))  # its top 0.2 m higher
        assert change('deactivate', 'cleanup') == [True] * 2 and state() == 'unconfigured'
        topics = {entity.topic_name for entity in (*node.subscriptions, *node.publishers)}
        assert not any('pose' in topic or 'contact/' in topic for topic in topics)
        assert '/contacts' not in topics
        assert change('configure', 'activate') == [True] * 2
        client.offer_until_answered(ON_FLOOR, LORRY)
        assert client.answer(ON_FLOOR, LORRY)[FLOOR].separation == pytest.approx(-0.3)
        assert client.diagnostic('refused: repeated stamp') == '2'
        assert change('deactivate') == [True]
        assert not client.is_answered(client.send(ON_FLOOR, LORRY), 0.5)
        assert node.trigger_shutdown() == TransitionCallbackReturn.SUCCESS
    told = re.findall(r'(ready|inactive|unconfigured): (?:model|no pose)', capfd.readouterr().err)
    assert told == ['ready', 'inactive', 'unconfigured', 'ready', 'inactive']

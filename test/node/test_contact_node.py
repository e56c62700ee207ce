# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The contact node over DDS: in this process and as a process of its own."""
from __future__ import annotations

import json
import math
import signal
import subprocess
import sys
import time
import traceback
from contextlib import closing

import numpy as np
import poses
import pytest
from geometry_msgs.msg import PoseStamped
from patience import PATIENCE
from raw_client import APART, ORIGIN, TOUCHING
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from ros_client import CUBES, DEEP, TWO_BOXES, Client, arguments, serving
from typed_messages import TOLD, contacts_by_pair

from box_contact_msgs.msg import Contacts
from box_contact_ros import ContactSolver
from box_contact_ros.node.contact_node import LIVE, ContactNode
from box_contact_ros.node.parameters import CONTACT_PARAMETERS

PAIR = 'box_a_box_b'
SIZE = list(CONTACT_PARAMETERS['size_a'].default)


@pytest.fixture
def client():
    with closing(Client()) as client:
        yield client


@pytest.fixture
def node(client):
    with serving(ContactNode, **CUBES) as node:
        client.offer_until_answered(ORIGIN, APART)
        yield node


# --- answers --------------------------------------------------------------------------------------


def test_answers_with_point_normal_and_contacts(node, client):
    """All three messages carry the poses' stamp and frame, and the solver's numbers to the bit."""
    turned = np.array([0.5, 0.25, 1.875, 0.1, 0.2, 0, 1])
    stamp = client.ask(ORIGIN, turned, frames=('yard', 'yard'))
    wanted = ContactSolver(poses.CUBE, poses.CUBE, model='exact')(ORIGIN, turned)
    point, normal, contacts = client.points[stamp], client.normals[stamp], client.contacts[stamp]
    assert point.header == normal.header == contacts.header
    assert point.header.frame_id == 'yard'
    assert (point.point.x, point.point.y, point.point.z) == tuple(wanted.point)
    assert (normal.vector.x, normal.vector.y, normal.vector.z) == tuple(wanted.normal)
    entry, = contacts.contacts
    assert (entry.pair, entry.box_a, entry.box_b) == (PAIR, 'box_a', 'box_b')
    poses.assert_same_bits(contacts_by_pair(contacts)[PAIR], wanted, *TOLD)
    # They come in this order, so a reader of contacts knows that point and normal are out.
    assert [topic for topic, at in client.order if at == stamp] == [
        'contact/point', 'contact/normal', 'contacts']


def test_poses_pair_by_stamp_in_any_order(node, client):
    """B far ahead of A: each stamp is answered once, with its own poses."""
    stamps = [client.next_stamp() for _ in range(50)]
    heights = {stamp: 1.5 + 0.008 * i for i, stamp in enumerate(stamps)}
    for stamp in stamps:
        client.send(None, (0, 0, heights[stamp], 0, 0, 0, 1), stamps=(0, stamp))
    for stamp in reversed(stamps):
        client.send(ORIGIN, stamps=(stamp,))
    assert client.are_answered(stamps)
    for stamp in stamps:
        contact = contacts_by_pair(client.contacts[stamp])[PAIR]
        assert -contact.separation == pytest.approx(2 - heights[stamp], abs=1e-14)


def test_reports_come_behind_a_tick(node, client, monkeypatch):
    """So no tick waits for one; without ticks they come, too."""
    behind = []

    def report(*args, report=node._diagnostics.report):
        files = [frame.filename for frame in traceback.extract_stack()]
        behind.append(any(file.endswith('tick.py') for file in files))
        report(*args)

    monkeypatch.setattr(node._diagnostics, 'report', report)
    assert client.spin(lambda: len(behind) > 2)
    assert not any(behind)
    behind.clear()
    assert client.spin(lambda: len(behind) > 3 or client.ask(ORIGIN, APART) and False)
    assert all(behind[1:])


def test_two_nodes_on_the_same_topics(node, client, capfd):
    """Both are told, also where they have the same name; one that is alone is not."""
    def are_told():
        client.diagnostics.clear()
        assert client.spin(lambda: len(client.diagnostics) > 4)
        return {'others publish /contacts: /contact_node' in message.status[0].message
                for message in client.diagnostics[2:]}

    assert are_told() == {False}
    with serving(ContactNode, size_a=[3.0, 2.0, 2.0]):
        assert are_told() == {True}
    assert are_told() == {False}
    told = capfd.readouterr().err
    assert 'either one answers /contact_node/check; stop all but one, or give each a names' in told


def test_two_publishers_of_a_box(node, client):
    """The poses of both are answered, and diagnostics name the box until one of them is gone."""
    def status():
        assert client.spin(lambda: client.diagnostics)
        return client.diagnostics[-1].status[0]

    def answer_in_turns():
        client.publishers[0], other[0] = other[0], client.publishers[0]
        client.ask(ORIGIN, TOUCHING)
        return 'several publishers' in status().message

    other = [client.node.create_publisher(PoseStamped, TWO_BOXES['box_a'], DEEP)]
    assert client.spin(other[0].get_subscription_count)
    deadline = time.monotonic() + PATIENCE
    while not answer_in_turns():
        assert time.monotonic() < deadline
    assert (status().level, status().message) == (b'\1', 'several publishers: box_a')
    assert client.newest_diagnostic('lost since the last report') == 'unknown'
    assert not client.newest_diagnostic('dropped: newer poses wait')
    client.node.destroy_publisher(other[0])
    assert client.spin(lambda: 'several publishers' not in status().message)


def test_an_error_inside_does_not_end_the_node(node, client, monkeypatch):
    """An exception while answering is counted; the next pair is answered."""
    def broken(*_):
        raise RuntimeError('planted')

    with monkeypatch.context() as patch:
        patch.setattr(node._tick, '_writer', broken)
        stamp = client.send(ORIGIN, TOUCHING)
        assert client.spin(lambda: node.counts['refused: internal error'] > 0)
    client.ask(ORIGIN, TOUCHING)
    assert node.counts['refused: internal error'] == 1
    assert stamp not in client.contacts


# --- parameters -----------------------------------------------------------------------------------


def set_to(node, **values):
    result, = node.set_parameters([Parameter(name, value=value) for name, value in values.items()])
    return result


def test_parameters_are_read_only_but_three(node, client):
    """A bad value is refused with its reason and changes nothing; a good one takes effect."""
    for name in CONTACT_PARAMETERS:
        descriptor = node.describe_parameter(name)
        assert descriptor.description and descriptor.read_only == (name not in LIVE)
    for name, value in (('size_a', [1.0, 1.0, 1.0]), ('scene', 'config/scenes/two_boxes.yaml'),
                        ('pairing', 'latest'), ('autostart', False)):
        before, result = node.get_parameter(name).value, set_to(node, **{name: value})
        assert not result.successful and 'read-only' in result.reason
        assert node.get_parameter(name).value == before
    for name, value, words in (('model', 'exakt', "model 'exakt' is not one of"),
                               ('model', 'paper', "model 'paper' needs a new start: a running"),
                               ('model', 'soup-64', 'a running node takes exact or mlp'),
                               ('model', 7, 'model must be a string'),
                               ('max_age', -1.0, 'max_age out of range Min: 0.0, Max: 1000000.0'),
                               ('max_age', -1, 'max_age must lie within 0 and 1e+06, not -1'),
                               ('tolerance', 'much', "tolerance must be a number, not 'much'")):
        result = set_to(node, **{name: value})
        assert not result.successful and words in result.reason
    assert set_to(node, max_age=2).successful
    turned = np.array([0.5, 0.25, 1.875, 0.1, 0.2, 0, 1])
    for model in ('mlp', 'exact'):
        assert set_to(node, model=model).successful
        wanted = ContactSolver(poses.CUBE, poses.CUBE, model=model)(ORIGIN, turned)
        assert client.answer(ORIGIN, turned)[PAIR].volume == wanted.volume


def test_of_several_parameters_all_are_set_or_none(node, client):
    before = node.get_parameter('max_age').value
    for bad in ({'tolerance': -1.0}, {'size_a': [1.0, 1.0, 1.0]}):
        result = node.set_parameters_atomically([
            Parameter(name, value=value) for name, value in {'max_age': 5.0, **bad}.items()])
        assert not result.successful and node.get_parameter('max_age').value == before
    assert node._tick.pairing.max_age == before * 1e9


def test_integers_are_as_good_as_doubles():
    with serving(ContactNode, max_age=2, size_a=[2, 2, 2]) as node:
        assert node.get_parameter('max_age').type_.name == 'DOUBLE'
        assert node.get_parameter('size_a').type_.name == 'DOUBLE_ARRAY'
        assert set_to(node, max_age=3).successful
        assert node._tick.pairing.max_age == 3 * 10**9


def test_quality_of_service_can_be_overridden(client):
    """Of the topics named; all others keep theirs, and the node answers."""
    given = {'qos_overrides./box_a/pose.subscription.reliability': 'reliable',
             'qos_overrides./contacts.publisher.reliability': 'best_effort'}
    with serving(ContactNode, **CUBES | given) as node:
        answers = []
        client.node.create_subscription(Contacts, 'contacts', answers.append, QoSProfile(
            depth=10, reliability=ReliabilityPolicy.BEST_EFFORT))
        assert client.spin(lambda: answers or not client.send(ORIGIN, TOUCHING))
        (a, b), (contacts, point) = (
            [info.qos_profile.reliability.name for topic in topics for info in listed(topic)
             if info.node_name == 'contact_node'] for listed, topics in (
                (node.get_subscriptions_info_by_topic, ('/box_a/pose', '/box_b/pose')),
                (node.get_publishers_info_by_topic, ('/contacts', '/contact/point'))))
        assert (a, b) == ('RELIABLE', 'BEST_EFFORT')
        assert (contacts, point) == ('BEST_EFFORT', 'RELIABLE')


# --- processes ------------------------------------------------------------------------------------


def names_of_containers(folder):
    """Return a scene file of names that no topic can have."""
    path = folder / 'containers.yaml'
    path.write_text('boxes: {MSKU-123: {size: [1, 1, 1]}, 20ft_1: {size: [1, 1, 1]}}\npairs: all')
    return path


def long_topics(folder):
    """Return the path of a scene of two boxes, whose names make topics too long for ROS."""
    path = folder / 'scene.yaml'
    boxes = {letter * 200: {'size': [1, 1, 1]} for letter in 'ab'}
    path.write_text(json.dumps({'boxes': boxes, 'pairs': 'all'}))
    return path


STARTS = """
import json, sys
from box_contact_ros.node.run_contact_node import main
for arguments in json.loads(sys.argv[1]):
    try:
        print('status', main(arguments), flush=True)
    except SystemExit as error:
        print('status', error.code, flush=True)
"""


def test_a_bad_start_is_one_clear_line(tmp_path):
    """And status 1."""
    values, words = zip(
        ({'size_a': '[0.0, 2.0, 2.0]'}, 'size_a (0, 2, 2) is not positive'),
        ({'model': 'nothing'}, "model 'nothing' is not one of"),
        ({'model': 'paper', 'size_a': '[1.0, 2.0, 3.0]', 'size_b': '[1.0, 2.0, 3.0]'},
         "use model 'exact'"),
        ({'scene': 'config/scenes/two_boxes.yaml'}, 'size_a (2.0, 2.0, 2.0) has no effect while'),
        ({'scene': str(long_topics(tmp_path)), 'size_a': SIZE, 'size_b': SIZE},
         "/contact/point': failed to resolve name: topic length should not exceed"),
        ({'scene': str(names_of_containers(tmp_path)), 'size_a': SIZE, 'size_b': SIZE},
         "topic '20ft_1_MSKU-123/contact/point': failed to resolve name: topic name token must not "
         "start with a number: set pair_topics to false\n"),
        ({'scene': str(names_of_containers(tmp_path)), 'size_a': SIZE, 'size_b': SIZE,
          'pair_topics': False},
         "topic 'MSKU-123/pose': failed to resolve name: topic name must not contain characters "
         "other than alphanumerics, '_', '~', '{', or '}': write poses: named in the scene file\n"),
        ({'qos_overrides./box_a/pose.subscription.depth': 'deep'}, "'deep' of type 'STRING'"),
        ({'qos_overrides./box_a/pose.subscription.reliability': 'relyable'},
         'qos_overrides of /box_a/pose: Unexpected QoS override for policy `reliability`'),
        ({'qos_overrides./contacts.publisher.reliability': 'relyable'},
         'qos_overrides of /contacts: Unexpected QoS override'),
        ({'qos_overrides./box_a/pose.subscription.depth': 0},
         'qos_overrides of /box_a/pose: depth must be at least 1, not 0'),
        ({'qos_overrides./contacts.publisher.depth': -1},
         'qos_overrides of /contacts: depth must be at least 1, not -1'),
        ({'size_a': '{2.0'}, "Couldn't parse"))
    starts = [arguments(**CUBES | given) for given in values]
    done = subprocess.run(
        [sys.executable, '-c', STARTS, json.dumps(starts)],
        text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=PATIENCE)
    assert 'Traceback' not in done.stdout and done.returncode == 0, done.stdout
    *outputs, end = done.stdout.split('status 1\n')
    assert not end and len(outputs) == len(words), done.stdout
    for output, expected in zip(outputs, words):
        assert output.splitlines()[-1].startswith('error: ') and expected in output


def test_a_node_that_does_not_start_is_destroyed_before_its_context():
    """In time: Python destroyed it as it ended, where Fast DDS may hang and nothing ends that."""
    done = subprocess.run([sys.executable, '-c', """
from box_contact_ros.node.contact_node import ContactNode, run
class Node(ContactNode):
    def destroy_node(self):
        print('destroyed', self.context.ok(), flush=True)
        super().destroy_node()
print(run(Node, ['--ros-args', '-p', 'size_a:=[0.0, 1.0, 1.0]']))
"""], capture_output=True, text=True)
    assert done.stdout.split('\n') == ['destroyed True', '1', ''], done.stderr


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_it_is_configured(number):
    """That is no fault of the configuration: nothing is logged, and the status is 0."""
    done = subprocess.run([sys.executable, '-c', f"""
import os, time
from box_contact_ros.node.contact_node import ContactNode, run
class Node(ContactNode):
    def _make_solver(self, values, scene):
        os.kill(os.getpid(), {int(number)})
        while self.context.ok():
            time.sleep(0.01)
        return super()._make_solver(values, scene)
print(run(Node, {arguments(**CUBES)}))
"""], capture_output=True, text=True, timeout=PATIENCE)
    assert (done.stdout, done.stderr) == ('0\n', '')


@pytest.mark.parametrize(('number', 'pauses'), [
    (signal.SIGINT, ()), (signal.SIGTERM, ()), (signal.SIGINT, (0.0,)), (signal.SIGTERM, (0.02,)),
    (signal.SIGINT, (0.12,)), (signal.SIGHUP, ()), (signal.SIGHUP, (0.02,))], ids=str)
def test_ends_cleanly(program, number, pauses):
    """Also under a second signal, at once or while the node leaves the network."""
    running = program('contact_node', *arguments(**CUBES))
    running.wait_for_output('ready')
    running.signal(number)
    for pause in pauses:
        time.sleep(pause)
        running.signal(number)
    assert running.wait() == 0, running.output
    assert 'Traceback' not in running.output


def test_without_autostart_it_says_what_it_waits_for(program):
    """In one line, as it would stay silent for ever."""
    running = program('contact_node', *arguments(**CUBES, autostart='false'))
    assert '`ros2 lifecycle set /contact_node configure`' in running.wait_for_output('autostart')


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_signalled_until_it_has_ended(program, number):
    """A KeyboardInterrupt in EventsExecutor aborts a process, and late SIGTERMs kill it.

    Without a pause, as the moment in which they do may last a microsecond.
    """
    running = program('contact_node', *arguments(**CUBES))
    running.wait_for_output('ready')
    while running.process.poll() is None:
        running.signal(number)
    assert running.wait() == 0, running.output


def stream(client, seconds, rate=200.0):
    """Send pairs at `rate`; return their stamps."""
    stamps = []
    started = time.monotonic()
    while (now := time.monotonic() - started) < seconds:
        height = 2.0 + 0.1 * math.sin(6.0 * now)
        stamps.append(client.send(ORIGIN, (0, 0, height, 0, 0, 0, 1)))
        client.keep_up(stamps)
        client.spin(lambda: False, max(0.0, len(stamps) / rate - (time.monotonic() - started)))
    return stamps


def test_node_killed_and_restarted(program):
    """After kill -9 of the node in mid-stream a new one is matched.

    Every pair sent while matched is answered.
    """
    def start():
        running = program('contact_node', *arguments(**CUBES))
        running.wait_for_output('ready')
        return running

    def answers_until_it_is_killed(running):
        client.offer_until_answered(ORIGIN, APART)
        assert client.are_answered(stream(client, 1.0))
        stream(client, 0.2)
        running.signal(signal.SIGKILL)
        running.wait()

    running = start()
    # Of a client that is made just before its node, Fast DDS matches the two 3 s later.
    with closing(Client()) as client:
        answers_until_it_is_killed(running)
        answers_until_it_is_killed(start())

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The contact node over DDS: in this process and as a process of its own."""
from __future__ import annotations

import gc
import math
import signal
import time

import numpy as np
import poses
import pytest
import rclpy
from rclpy.context import Context
from rclpy.parameter import Parameter
from ros_client import PATIENCE, Client, row_of, serving

from box_contact_ros import ContactSolver
from box_contact_ros.demo.ros_client import ANSWERS
from box_contact_ros.node.contact_node import PARAMETERS, ContactNode

ORIGIN = poses.IDENTITY
TOUCHING = np.array([0.5, 0.25, 1.875, 0, 0, 0, 1])
APART = np.array([0.5, 0.25, 2.5, 0, 0, 0, 1])
CUBES = {'size_a': [2.0, 2.0, 2.0], 'size_b': [2.0, 2.0, 2.0], 'model': 'exact'}


def overrides(**values):
    return [Parameter(name, value=value) for name, value in (CUBES | values).items()]


def arguments(**values):
    texts = [f'{name}:={value}' for name, value in (CUBES | values).items()]
    return ['--ros-args', *(word for text in texts for word in ('-p', text))]


@pytest.fixture
def client():
    client = Client()
    yield client
    client.close()


@pytest.fixture
def node():
    with serving(lambda context: ContactNode(context, parameter_overrides=overrides())) as node:
        yield node


def test_answers_with_point_normal_and_cloud(node, client):
    """All three messages carry the poses' stamp and frame, and the solver's numbers."""
    client.offer_until_answered(ORIGIN, APART)
    stamp = client.ask(ORIGIN, TOUCHING, frames=('yard', 'yard'))
    wanted = ContactSolver(poses.CUBE, poses.CUBE, model='exact')(ORIGIN, TOUCHING)
    point, normal, cloud = client.points[stamp], client.normals[stamp], client.clouds[stamp]
    assert point.header == normal.header == cloud.header
    assert point.header.frame_id == 'yard'
    assert (point.point.x, point.point.y, point.point.z) == tuple(wanted.point)
    assert (normal.vector.x, normal.vector.y, normal.vector.z) == tuple(wanted.normal)
    row, = client.rows(stamp)
    assert tuple(row) == row_of(wanted)
    # The cloud comes last, so a reader of it knows that point and normal are out.
    assert [topic for topic, at in client.order if at == stamp] == [
        'contact/point', 'contact/normal', ANSWERS['cloud'][1]]


def test_no_contact_is_an_empty_cloud(node, client):
    client.offer_until_answered(ORIGIN, APART)
    stamp = client.ask(ORIGIN, APART)
    assert len(client.rows(stamp)) == 0
    assert stamp not in client.points and stamp not in client.normals


def test_poses_pair_by_stamp_in_any_order(node, client):
    """B far ahead of A: each stamp is answered once, with its own poses."""
    client.offer_until_answered(ORIGIN, APART)
    stamps = [client.next_stamp() for _ in range(50)]
    heights = {stamp: 1.5 + 0.008 * i for i, stamp in enumerate(stamps)}
    for stamp in stamps:
        client.send(None, (0, 0, heights[stamp], 0, 0, 0, 1), stamps=(0, stamp))
    for stamp in reversed(stamps):
        client.send(ORIGIN, None, stamps=(stamp, 0))
    assert client.spin(lambda: all(stamp in client.clouds for stamp in stamps))
    for stamp in stamps:
        row, = client.rows(stamp)
        assert row['depth'] == pytest.approx(2 - heights[stamp], abs=1e-14)


def test_bad_poses_are_refused_counted_and_never_answered(node, client):
    """NaN, infinite, zero and huge poses: no answer, a count by reason; then all is well again."""
    client.offer_until_answered(ORIGIN, APART)
    bad = [(math.nan, 0, 0, 0, 0, 0, 1), (0, 0, math.inf, 0, 0, 0, 1), (0, 0, 0, 0, 0, 0, 0),
           (0, 0, 0, 0, math.nan, 0, 1), (1e300, 0, 0, 0, 0, 0, 1)]
    refused = [client.send(pose, TOUCHING) for pose in bad]
    refused += [client.send(ORIGIN, pose) for pose in bad]
    answered = client.ask(ORIGIN, TOUCHING)
    assert not any(stamp in client.clouds or stamp in client.points for stamp in refused)
    assert answered in client.points
    assert client.diagnostic('refused: bad pose') == '10'


def test_frames_must_agree(node, client):
    client.offer_until_answered(ORIGIN, APART)
    stamp = client.send(ORIGIN, TOUCHING, frames=('map', 'odom'))
    client.ask(ORIGIN, TOUCHING)
    assert stamp not in client.clouds
    assert client.diagnostic('refused: frame_id differs') == '1'


def test_an_error_inside_does_not_end_the_node(node, client, monkeypatch):
    """An exception while answering is counted and said; the next pair is answered."""
    client.offer_until_answered(ORIGIN, APART)

    def broken(*_):
        raise RuntimeError('planted')

    solver = node._evaluator.solver
    node._evaluator.solver = broken
    stamp = client.send(ORIGIN, TOUCHING)
    assert client.spin(lambda: node.counts['refused: internal error'] > 0)
    node._evaluator.solver = solver
    client.ask(ORIGIN, TOUCHING)
    assert node.counts['refused: internal error'] == 1
    assert stamp not in client.clouds


def test_latest_pairing_answers_every_pose(client):
    with serving(lambda context: ContactNode(
            context, parameter_overrides=overrides(pairing='latest'))):
        client.offer_until_answered(ORIGIN, APART)
        first, second = client.next_stamp(), client.next_stamp()
        client.send(ORIGIN, None, stamps=(first, 0))
        assert client.spin(lambda: first in client.clouds)
        client.send(None, TOUCHING, stamps=(0, second))
        assert client.spin(lambda: second in client.points)


def test_unmatched_poses_are_warned_of(node, client):
    """Stamps that never agree: a warning in the diagnostics after a second."""
    client.offer_until_answered(ORIGIN, APART)
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        stamp = client.next_stamp()
        client.send(ORIGIN, TOUCHING, stamps=(stamp, stamp - 1_000_000_000))
        client.spin(lambda: False, 0.1)
        if client.diagnostics[-1:] and client.diagnostics[-1].status[0].message.startswith(
                'poses without a partner'):
            break
    else:
        pytest.fail('no warning')
    assert client.diagnostics[-1].status[0].level == b'\x01'


def test_parameters_are_checked_before_they_are_applied(node, client):
    """A bad value is refused with the reason and changes nothing; a good one takes effect."""
    for name, value, words in (('size_a', [0.0, 2.0, 2.0], 'size_a (0, 2, 2) is not positive'),
                               ('size_b', [1.0, 2.0], 'size_b must be 3 finite numbers'),
                               ('size_a', 'big', 'size_a must be 3 finite numbers'),
                               ('model', 'exakt', "model 'exakt' is not one of"),
                               ('model', 7, 'model must be a string'),
                               ('weights', 'nowhere.safetensors', None),
                               ('pairing', 'first', "pairing 'first' is not one of")):
        result, = node.set_parameters([Parameter(name, value=value)])
        if words is None:  # model 'exact' reads no weights
            assert result.successful
        else:
            assert not result.successful and words in result.reason
    client.offer_until_answered(ORIGIN, APART)
    result, = node.set_parameters([Parameter('size_a', value=[2, 2, 3])])
    assert result.successful
    row, = client.rows(client.ask(ORIGIN, APART))
    assert row['depth'] == 0.0
    assert list(node.get_parameter('size_b').value) == [2.0, 2.0, 2.0]


def test_parameters_have_descriptions(node):
    for name in PARAMETERS:
        assert node.describe_parameter(name).description


@pytest.mark.parametrize('parameters, words', [
    ({'size_a': '[0.0, 2.0, 2.0]'}, 'size_a (0, 2, 2) is not positive'),
    ({'model': 'nothing'}, "model 'nothing' is not one of"),
    ({'model': 'paper', 'size_a': '[1.0, 2.0, 3.0]', 'size_b': '[1.0, 2.0, 3.0]'},
     "use model 'exact'"),
    ({'model': 'paper', 'weights': '/nowhere.safetensors'}, 'does not exist'),
    ({'size_a': '[2.0,'}, 'is half a list'), ({'size_a': '{2.0'}, "Couldn't parse")])
def test_a_bad_start_is_one_clear_line(program, parameters, words):
    running = program('contact_node', *arguments(**parameters))
    assert running.wait(120) == (2 if 'half' in words else 1)
    assert words in running.output
    assert 'Traceback' not in running.output


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_ends_cleanly(program, number):
    running = program('contact_node', *arguments())
    running.wait_for_output('ready', 120)
    running.signal(number)
    assert running.wait() == 0, running.output
    assert 'Traceback' not in running.output


@pytest.mark.parametrize('pause', [0.0, 0.005, 0.02, 0.06, 0.12])
def test_interrupted_twice(program, pause):
    """Ctrl-C once more, at once or while the node leaves the network: its status was -2 or 130."""
    running = program('contact_node', *arguments())
    running.wait_for_output('ready', 120)
    running.signal(signal.SIGINT)
    time.sleep(pause)
    running.signal(signal.SIGINT)
    assert running.wait(60) == 0, running.output
    assert 'Traceback' not in running.output


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_signalled_until_it_has_ended(program, number):
    """It aborted where KeyboardInterrupt fell in EventsExecutor; late SIGTERMs killed it."""
    running = program('contact_node', *arguments())
    running.wait_for_output('ready', 120)
    while running.process.poll() is None:
        running.signal(number)
        time.sleep(0.0002)
    assert running.wait() == 0, running.output


def test_weights_that_nobody_reads_are_said(capfd):
    """Otherwise a file does nothing, quietly."""
    given = overrides(weights='mlp-yard.safetensors')
    with serving(lambda context: ContactNode(context, parameter_overrides=given)) as node:
        assert "'exact' uses no weights: 'mlp-yard.safetensors'" in capfd.readouterr().err
        result, = node.set_parameters([Parameter('weights', value='')])
        assert result.successful
        said = capfd.readouterr().err
        assert "changed weights: model 'exact'" in said and 'uses no weights' not in said


def test_parameters_explain_themselves():
    """Integers come back as doubles, and sizes that a scene replaces are refused."""
    def set_to(node, **values):
        return node.set_parameters_atomically(
            [Parameter(name, value=value) for name, value in values.items()])

    with serving(lambda context: ContactNode(context, parameter_overrides=overrides(
            max_age=2, size_a=[2, 2, 2]))) as node:
        for value in (2, 3):
            assert set_to(node, max_age=value, size_b=[2, value, 2]).successful
            for name, wanted in (('max_age', value), ('size_b', [2, value, 2]),
                                 ('size_a', [2, 2, 2])):
                found = node.get_parameter(name)
                assert found.type_.name.startswith('DOUBLE')
                assert np.array_equal(found.value, wanted)
        assert node.describe_parameter('max_age').type == Parameter.Type.DOUBLE.value
        assert node.describe_parameter('max_age').floating_point_range[0].to_value == 1e6
        assert 'stamp, latest' in node.describe_parameter('pairing').additional_constraints
        assert 'mlp' in node.describe_parameter('model').additional_constraints
        for value in (-1, -1.0):
            assert not set_to(node, max_age=value).successful
        # A scene may replace sizes that were given; then they cannot be set.
        assert set_to(node, scene='two_boxes', size_a=[2.0, 2.0, 2.0]).successful
        refusal = set_to(node, size_a=[1.0, 1.0, 1.0])
        assert not refusal.successful
        assert 'size_a (1.0, 1.0, 1.0) has no effect while scene is set' in refusal.reason
        assert node.get_parameter('size_a').value == [2.0, 2.0, 2.0]
        assert set_to(node, scene='', size_a=[1.0, 1.0, 1.0]).successful


def test_a_size_beside_a_scene_does_not_start():
    with pytest.raises(ValueError, match='size_a .* has no effect while scene is set'), serving(
            lambda context: ContactNode(context, parameter_overrides=overrides(scene='two_boxes'))):
        pass


@pytest.mark.parametrize('serialization', ['raw', 'typed'])
def test_quality_of_service_can_be_overridden(client, serialization):
    """Of the topics named; all others keep theirs, and the node answers."""
    given = overrides(serialization=serialization, **{
        'qos_overrides./box_a/pose.subscription.reliability': 'reliable',
        'qos_overrides./contacts.publisher.durability': 'transient_local',
        'qos_overrides./contacts.publisher.depth': 3})
    with serving(lambda context: ContactNode(context, parameter_overrides=given)) as node:
        client.offer_until_answered(ORIGIN, TOUCHING)
        (a, b), (cloud, point) = (
            [info.qos_profile for topic in topics for info in listed(topic)
             if info.node_name == 'contact_node'] for listed, topics in (
                (node.get_subscriptions_info_by_topic, ('/box_a/pose', '/box_b/pose')),
                (node.get_publishers_info_by_topic, ('/contacts', '/contact/point'))))
        assert (a.reliability.name, b.reliability.name) == ('RELIABLE', 'BEST_EFFORT')
        assert (cloud.durability.name, point.durability.name) == ('TRANSIENT_LOCAL', 'VOLATILE')
        assert node.get_parameter('qos_overrides./contacts.publisher.depth').value == 3


@pytest.mark.parametrize('name, value, words', [
    ('/contacts.publisher.depth', 0, 'must be a whole number from 1 to 100000, not 0'),
    ('/contacts.publisher.reliability', 'maybe', "'maybe' is not one of: best_effort, reliable"),
    ('/contacts.publisher.dept', 5, r"unknown policy 'dept' \(did you mean depth\?\)")])
def test_a_quality_of_service_that_there_is_not(name, value, words):
    with pytest.raises(ValueError, match=words), serving(lambda context: ContactNode(
            context, parameter_overrides=overrides(**{f'qos_overrides.{name}': value}))):
        pass


def stream(client, seconds, rate=200.0):
    """Send pairs at `rate`; returns their stamps."""
    stamps = []
    started = time.monotonic()
    while (now := time.monotonic() - started) < seconds:
        height = 2.0 + 0.1 * math.sin(6.0 * now)
        stamps.append(client.send(ORIGIN, (0, 0, height, 0, 0, 0, 1)))
        client.keep_up(stamps)
        client.spin(lambda: False, max(0.0, len(stamps) / rate - (time.monotonic() - started)))
    return stamps


def answered(client, stamps):
    client.spin(lambda: all(stamp in client.clouds for stamp in stamps))
    return sum(stamp in client.clouds for stamp in stamps)


def test_node_killed_and_restarted(program, client):
    """After kill -9 of the node in mid-stream a new one is matched within 5 s of being ready.

    Every pair sent while matched is answered.
    """
    for _ in range(2):
        running = program('contact_node', *arguments())
        running.wait_for_output('ready', 120)
        assert client.offer_until_answered(ORIGIN, APART) < 5.0
        stamps = stream(client, 2.0)
        assert answered(client, stamps) == len(stamps)
        stream(client, 0.2)
        running.signal(signal.SIGKILL)
        running.wait()


def test_client_killed_and_restarted(program):
    """After kill -9 of the crane in mid-stream a new one is matched within 5 s.

    Of the pairs it sends none is lost (else its exit status is not 0).
    """
    parameters = ['--ros-args', '-p', 'size_a:=[2.0, 2.0, 2.0]', '-p', 'size_b:=[2.0, 2.0, 2.0]']
    node = program('contact_node', *arguments())
    node.wait_for_output('ready', 120)
    first = program('crane', *parameters, '-p', 'duration:=12', '-p', 'report:=true')
    first.wait_for_output('contact', 60)
    time.sleep(1.0)
    first.signal(signal.SIGKILL)
    first.wait()
    second = program('crane', *parameters, '-p', 'duration:=5', '-p', 'wait:=5')
    assert second.wait(120) == 0, second.output
    assert node.process.poll() is None


def test_two_contexts_do_not_share_state():
    """Nodes of two contexts in one process, one shut down: the other lives."""
    one, two = Context(), Context()
    for context in (one, two):
        rclpy.init(context=context)
    first = ContactNode(one, parameter_overrides=overrides())
    second = ContactNode(two, parameter_overrides=overrides())
    first.destroy_node()
    one.try_shutdown()
    assert two.ok()
    second.destroy_node()
    two.try_shutdown()
    gc.unfreeze()

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bad input at the contact node's doors: raw bytes and poses on topics, requests to services.

The policy: docs/reference/conventions.md, "Bad input". The node runs as a process of its own,
as it does for users; what is sent is CDR, byte by byte, so that nothing on this side repairs it.
"""
from __future__ import annotations

import math
import time

import numpy as np
import poses
import pytest
from raw_client import APART, ORIGIN, TOUCHING, RawClient, cdr
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from ros_client import PATIENCE, row_of

from box_contact_ros import ContactSolver
from box_contact_ros.node.messages import CLOUD_ROW

FLOAT64S = [name for name in CLOUD_ROW.names if CLOUD_ROW[name] == np.float64]


@pytest.fixture
def client():
    client = RawClient()
    yield client
    client.close()


@pytest.fixture
def node(program, client):
    """Return a contact node for two cubes of edge 2, matched with the client."""
    running = program('contact_node', '--ros-args', '-p', 'size_a:=[2.0, 2.0, 2.0]',
                      '-p', 'size_b:=[2.0, 2.0, 2.0]', '-p', 'model:=exact')
    running.wait_for_output('ready', 120)
    client.offer_until_answered(ORIGIN, APART)
    return running


def test_frames(node, client):
    """Any UTF-8 of at most 255 bytes is a frame.

    Bytes that are no UTF-8, and strings that do not end with their first NUL, are refused and
    counted.
    """
    for raw, frame in ((b'\0', ''), (b'', ''), (b'yard\0', 'yard'),
                       ('Köln 港\0'.encode(), 'Köln 港'), (b'y' * 255 + b'\0', 'y' * 255)):
        stamp = client.send_pair(ORIGIN, TOUCHING, raw)
        assert client.answered(stamp), raw
        assert client.clouds[stamp].header.frame_id == frame
        assert client.points[stamp].header.frame_id == frame
    refused = [client.send_pair(ORIGIN, TOUCHING, raw) for raw in (
        b'\xff\xfe\0', b'map\xc3\0', b'\xed\xa0\x80\0', b'y' * 256 + b'\0')]
    client.assert_answered()
    assert not any(stamp in client.clouds for stamp in refused)
    assert client.diagnostic('refused: bad header') == '8'
    assert 'is not UTF-8; refused' in node.output or 'more than 255 bytes; refused' in node.output
    refused = [client.send_pair(ORIGIN, TOUCHING, raw) for raw in (b'yard', b'yard\0east\0')]
    client.assert_answered()
    assert not any(stamp in client.clouds for stamp in refused)
    assert client.diagnostic('refused: not a PoseStamped') == '4'


def test_stamps(node, client):
    """Any second of int32 is a stamp; a nanosecond part of a second or more is refused.

    The sum may not fit, and was published as another stamp, 136 years off.
    """
    for sec, nanosec in ((0, 1), (-1, 5), (-2**31, 0), (2**31 - 1, 10**9 - 1)):
        client.send_raw(cdr(ORIGIN, (sec, nanosec)))
        stamp = sec * 10**9 + nanosec
        assert client.answered(stamp)
    before = set(client.clouds)
    for sec, nanosec in ((0, 10**9), (0, 2**32 - 1), (2**31 - 1, 10**9), (-2**31, 2**32 - 1)):
        client.send_raw(cdr(ORIGIN, (sec, nanosec)))
    client.assert_answered()
    assert len(set(client.clouds) - before) == 1
    assert client.diagnostic('refused: bad header') == '8'


def test_stamps_are_blamed_only_for_their_own_faults(node, client):
    """Poses that come, and no answer: the reason is in the log, and no other one."""
    for pose, apart, blamed in ((np.full(7, np.nan), 0, False), (TOUCHING, 1, True)):
        end = time.monotonic() + (PATIENCE if blamed else 2.5)
        while time.monotonic() < end and 'none could be answered' not in node.output:
            stamp = client.next_stamp()
            for box, publisher in enumerate(client.publishers):
                publisher.publish(cdr(pose, divmod(stamp + box * apart, 10**9)))
            client.spin(lambda: False, 0.05)
        assert ('none could be answered' in node.output) == blamed


def test_good_poses_among_bad_ones(node, client):
    """Shuffled: the good are answered as the solver does, the bad are counted and never answered.

    All zero bytes are what a sender of another language may publish by default.
    """
    good = [TOUCHING, APART, [0, 0, 1.5, 5e-324, 0, 0, 1], [1e-310, 0, 1.5, 0, 0, 0, -1e-8],
            [0, 0, 2, 0, 0, 1e8, 1e8], [1e50, -1e50, 0, 0, 0, 0, 1], [-0.0, -0.0, 1, -0.0, 0, 0, 1]]
    bad = [[0] * 7, [math.nan] * 7, [0, 0, 0, 5e-324, 0, 0, 1e-310], [0, 0, 0, 0, 0, 0, 1e308],
           [0, math.nan, 0, 0, 0, 0, 1], [0, 0, -math.inf, 0, 0, 0, 1],
           [0, 0, 0, 0, 0, math.inf, 1], [1e308, 0, 0, 0, 0, 0, 1],
           [0, -1e308, 0, 0, 0, 0, 1], [0, 0, 2e50, 0, 0, 0, 1]]
    queue = [(pose, swap, is_good) for group, is_good in ((good, True), (bad, False))
             for pose in group for swap in (False, True)]
    sent = []
    for index in np.random.default_rng(3).permutation(len(queue)):
        pose, swap, is_good = queue[index]
        pair = (pose, ORIGIN) if swap else (ORIGIN, pose)
        sent.append((client.send_pair(*pair), pair, is_good))
    client.assert_answered()
    solver = ContactSolver(poses.CUBE, poses.CUBE, model='exact')
    for stamp, pair, is_good in sent:
        assert (stamp in client.clouds) is is_good
        if is_good:
            wanted = solver(*pair)
            rows = client.rows(stamp)
            assert len(rows) == wanted.colliding == (stamp in client.points)
            for row in rows:
                assert tuple(row) == row_of(wanted)
    assert client.diagnostic('refused: bad pose') == str(2 * len(bad))
    assert 'internal error' not in node.output


# --- parameters -----------------------------------------------------------------------------------


def call(client, kind, name, parameters, timeout=PATIENCE):
    """Return the reply of a parameter service of the node, or None."""
    service = client.client_of(kind, f'/contact_node/{name}')
    future = service.call_async(kind.Request(parameters=[
        Parameter(name=key, value=value) for key, value in parameters]))
    client.spin(future.done, timeout)
    reply = future.result() if future.done() else None
    client.node.destroy_client(service)
    return reply


def value(kind, **field):
    return ParameterValue(type=getattr(ParameterType, f'PARAMETER_{kind}'), **field)


def doubles(*numbers):
    return value('DOUBLE_ARRAY', double_array_value=list(map(float, numbers)))


def string(text):
    return value('STRING', string_value=text)


NO_SIZES = [
    (doubles(2, 2, math.nan), 'must be 3 finite numbers'),
    (doubles(2, math.inf, 2), 'must be 3 finite numbers'),
    (doubles(2, -2, 2), '(2, -2, 2) is not positive'), (doubles(2, 0, 2), 'is not positive'),
    (doubles(-0.0, 2, 2), 'is not positive'), (doubles(2, 5e-324, 2), 'is outside'),
    (doubles(2, 2, 1e200), 'is outside'), (doubles(2, 2), 'must be 3 finite numbers'),
    (doubles(), 'must be 3 finite numbers'), (doubles(*range(1, 5)), 'must be 3 finite numbers'),
    (value('DOUBLE', double_value=2.0), 'must be 3 finite numbers'),
    (value('NOT_SET'), 'must be 3 finite numbers, not None'),
    (string('[2, 2, 2]'), 'must be 3 finite numbers'),
    # float('2'), float(True) and float(b'2') are numbers to Python.
    (value('STRING_ARRAY', string_array_value=['2', '2', '2']), 'must be 3 finite numbers'),
    (value('BOOL_ARRAY', bool_array_value=[True] * 3), 'must be 3 finite numbers'),
    (value('BYTE_ARRAY', byte_array_value=[b'2'] * 3), 'must be 3 finite numbers'),
    (value('INTEGER_ARRAY', integer_array_value=[2, 2, -2**63]), 'is not positive')]
NO_NAMES = [
    ('model', string(''), "model '' is not one of"), ('model', string('soup-0'), 'model '),
    ('model', string('soup-' + '9' * 5000), "model 'soup-999"),
    ('model', string('x' * 100_000), "model 'xxx"), ('model', value('NOT_SET'), 'not None'),
    ('model', doubles(1), 'model must be a string'), ('pairing', string('first'), "'first' is not"),
    ('pairing', value('BOOL', bool_value=True), 'pairing must be a string, not True'),
    ('weights', value('INTEGER', integer_value=1), 'weights must be a string, not 1')]


def test_parameters_while_it_runs(node, client):
    """Each bad value is refused with the field and the reason, and the old one goes on."""
    cases = [(name, bad, f'{name} {words}' if words.startswith('must') else words)
             for name in ('size_a', 'size_b') for bad, words in NO_SIZES] + NO_NAMES
    for name, bad, words in cases:
        reply = call(client, SetParameters, 'set_parameters', [(name, bad)])
        result, = reply.results
        assert not result.successful and words in result.reason and len(result.reason) < 1000
        client.assert_answered()
    # Of several at once, atomically, none is taken over if one is bad.
    reply = call(client, SetParametersAtomically, 'set_parameters_atomically',
                 [('size_a', doubles(4, 4, 4)), ('size_b', doubles(4, 4, -4))])
    assert not reply.result.successful and 'size_b (4, 4, -4)' in reply.result.reason
    client.assert_answered()


def test_parameters_from_a_file(program, tmp_path):
    """Unknown ones are logged with the nearest name, and so is the QoS of a topic that is not."""
    file = tmp_path / 'shared.yaml'
    file.write_text("/**: {ros__parameters: {sizea: 1.0, use_sim_time: false, "
                    "'qos_overrides./contacts.publisher.depth': 5, "
                    "'qos_overrides./contact.publisher.depth': 5}}")
    running = program('contact_node', '--ros-args', '--params-file', str(file))
    printed = running.wait_for_output('ready', 120)
    assert "unknown parameter 'sizea' (did you mean size_a?)" in printed
    assert printed.count('unknown parameter') == 1
    assert 'qos_overrides./contact.publisher.depth: the node has no such topic' in printed
    assert printed.count('no such topic') == 1
    assert 'poses from /box_a/pose, /box_b/pose' in running.output


def test_weights_while_it_runs(node, client, tmp_path):
    """A model that reads weights, and files that are none."""
    garbage = tmp_path / 'garbage.safetensors'
    garbage.write_bytes(np.random.default_rng(4).bytes(1000))
    for path in (tmp_path, tmp_path / 'nothing', garbage, 'x' * 5000):
        reply = call(client, SetParametersAtomically, 'set_parameters_atomically', [
            ('model', string('mlp')), ('weights', string(str(path)))])
        assert not reply.result.successful and reply.result.reason.startswith('weights ')
        client.assert_answered()


def test_a_request_that_rclpy_cannot_read(node, client):
    """A parameter of a type that there is none of.

    rclpy's own service raises ValueError. The client is answered, without a word of success, and
    the node says so and goes on.
    """
    for kind, name, ok in ((SetParameters, 'set_parameters', lambda reply: reply.results),
                           (SetParametersAtomically, 'set_parameters_atomically',
                            lambda reply: reply.result.successful)):
        reply = call(client, kind, name, [('size_a', ParameterValue(type=77))])
        assert not ok(reply)
        client.assert_answered()
    assert '77 is not a valid Parameter.Type' in node.output
    reply = call(client, SetParameters, 'set_parameters', [('size_a', doubles(2, 2, 3))])
    assert reply.results[0].successful


def test_it_ends_after_all_that(node, client):
    """The guard does not keep a signal from ending the node, at once and with status 0."""
    call(client, SetParameters, 'set_parameters', [('model', ParameterValue(type=77))], timeout=0.5)
    started = time.monotonic()
    node.end()
    assert node.process.returncode == 0 and time.monotonic() - started < 5.0

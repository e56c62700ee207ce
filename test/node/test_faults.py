# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What breaks around a contact node, and that nothing is lost, wrong or leaked by it.

The node runs as a process of its own, and most poses are sent as bytes, so that nothing on this
side repairs them. The policy: docs/reference/conventions.md, "Bad input". Elsewhere: nodes that are
killed (test_contact_node.py), bad named poses and clocks (test_scene_node.py).
"""
from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path
from threading import Event, Thread

import numpy as np
import poses
import pytest
from geometry_msgs.msg import PointStamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from patience import PATIENCE
from raw_client import APART, GOOD, LITTLE_ENDIAN, ORIGIN, TOUCHING, RawClient, cdr
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_client import CUBES, arguments
from typed_messages import contacts_by_pair

from box_contact_msgs.msg import Contacts
from box_contact_ros import ContactSolver

HELPERS = Path(__file__).resolve().parents[1] / 'helpers'
LEAK = 8.0
"""Growth [MB] of a node's memory that is taken for none, as the allocator's arenas come in steps: a
leak of 400 bytes a message in the storm below."""
UNKNOWN_TYPE = 77  # of a parameter


@pytest.fixture
def node(program):
    """Return a contact node for two cubes."""
    running = program('contact_node', *arguments(**CUBES))
    running.wait_for_output('ready')
    return running


@pytest.fixture
def client(node):
    """Return a client that the node answers.

    Where it is made just before the node, Fast DDS matches the two 3 s later.
    """
    with closing(RawClient()) as client:
        client.offer_until_answered(ORIGIN, APART)
        yield client


def environment():
    """Return this process's environment, with the helpers on Python's path."""
    return {**os.environ, 'PYTHONPATH': os.pathsep.join(
        filter(None, (str(HELPERS), os.environ.get('PYTHONPATH'))))}


def memory(running):
    """Resident memory of a program [MB]."""
    with open(f'/proc/{running.process.pid}/status') as file:
        line, = (line for line in file if line.startswith('VmRSS:'))
    return int(line.split()[1]) / 1024


needs_proc = pytest.mark.skipif(not os.path.isdir('/proc/self'), reason='no /proc: not Linux')


def rate_limited(count, rate):
    """Numbers at a rate [Hz]."""
    started = time.monotonic()
    for number in range(count):
        time.sleep(max(0.0, started + number / rate - time.monotonic()))
        yield number


# --- malformed messages ---------------------------------------------------------------------------


@needs_proc
def test_messages_that_are_none(node, client):
    """Random bytes, messages cut short and messages with changed bytes at some 10 kHz.

    Those that arrive are counted, none ends the node, memory does not grow, and the next pair is
    answered. Best effort may lose some of a storm: it lasts until the node has heard enough.
    """
    rng = np.random.default_rng(1)

    def payload(number):
        if number % 4 == 0:
            return rng.bytes(rng.integers(200))
        if number % 4 == 1:
            return LITTLE_ENDIAN + rng.bytes(rng.integers(200))
        if number % 4 == 2:
            return GOOD[:rng.integers(len(GOOD))]
        changed = bytearray(GOOD)
        changed[rng.integers(4, 16)] = rng.integers(256)  # stamp and length
        changed[rng.integers(len(GOOD) - 56, len(GOOD))] = rng.integers(256)
        return bytes(changed)

    def storm(heard):
        deadline = time.monotonic() + PATIENCE
        for number in rate_limited(10**9, 10_000):
            # Each kind by both: one may lose more than the other.
            client.publishers[number % 2].publish(payload(number // 2))
            if number % 100 == 0:
                client.poll()
                if (told := int(client.newest_diagnostic('poses') or 0)) >= heard:
                    return
                assert time.monotonic() < deadline, f'{told} of {heard} messages heard'

    storm(3_000)
    client.assert_answered()
    before = memory(node)
    storm(20_000)
    client.assert_answered()
    assert memory(node) - before < LEAK
    assert node.process.poll() is None and 'Traceback' not in node.output
    # Three of four kinds are almost never a PoseStamped, the fourth varies.
    heard = int(client.diagnostic('poses'))
    assert int(client.diagnostic('refused: not a PoseStamped')) > 0.7 * heard
    assert not client.diagnostic('refused: internal error')
    for message in client.contacts.values():
        for contact in contacts_by_pair(message).values():
            assert np.isfinite([*contact.point, *contact.normal, contact.separation]).all()


def test_headers(node, client):
    """Any UTF-8 is a frame, and any second of int32 a stamp; the rest is refused and counted."""
    for raw, frame in ((b'\0', ''), (b'', ''), ('Köln 港\0'.encode(), 'Köln 港'),
                       (b'y' * 255 + b'\0', 'y' * 255)):
        stamp = client.send_pair(ORIGIN, TOUCHING, raw)
        assert client.is_answered(stamp), raw
        assert client.contacts[stamp].header.frame_id == frame
        assert client.points[stamp].header.frame_id == frame
    answered = set(client.contacts)
    for raw in (b'\xff\xfe\0', b'map\xc3\0', b'\xed\xa0\x80\0', b'yard', b'yard\0east\0'):
        client.send_pair(ORIGIN, TOUCHING, raw)
    for stamp in ((0, 10**9), (0, 2**32 - 1), (2**31 - 1, 10**9), (-2**31, 2**32 - 1)):
        client.send_raw(cdr(ORIGIN, stamp))
    client.assert_answered()
    assert len(set(client.contacts) - answered) == 1
    assert client.diagnostic('refused: bad header') == '14'
    assert client.diagnostic('refused: not a PoseStamped') == '4'
    assert 'is not UTF-8; refused' in node.output
    for stamp in ((0, 1), (-1, 5), (-2**31, 0), (2**31 - 1, 10**9 - 1)):
        client.send_raw(cdr(ORIGIN, stamp))
        assert client.is_answered(stamp[0] * 10**9 + stamp[1])


def test_half_of_the_poses_are_none(node, client):
    """NaN, zero quaternions, infinities and denormals in every second pair, at 500 Hz.

    Each good pair is answered as the solver does, each bad pose counted, nothing bad is answered.
    All zero bytes are what a sender of another language may publish by default.
    """
    bad = [[0] * 7, [math.nan] * 7, [0, 0, 0, 5e-324, 0, 0, 1e-310], [0, 0, 0, 0, 0, 0, 1e308],
           [0, math.nan, 0, 0, 0, 0, 1], [0, 0, -math.inf, 0, 0, 0, 1],
           [0, 0, 0, 0, 0, math.inf, 1], [0, -1e308, 0, 0, 0, 0, 1], [0, 0, 2e50, 0, 0, 0, 1]]
    odd = [[0, 0, 1.5, 5e-324, 0, 0, 1], [1e-310, 0, 1.5, 0, 0, 0, -1e-8],
           [0, 0, 2, 0, 0, 1e8, 1e8], [1e50, -1e50, 0, 0, 0, 0, 1], [-0.0, -0.0, 1, -0.0, 0, 0, 1]]
    good, refused = {}, []
    for number in rate_limited(1000, 500):
        if number % 2:
            pose = odd[number // 2 % 5] if number % 20 == 1 else [
                0, 0, 1.9 + 0.0001 * number, 0, 0, 0, 1]
            pair = (ORIGIN, pose) if number % 4 == 1 else (pose, ORIGIN)
            good[client.send_pair(*pair)] = pair
            client.keep_up(list(good))
        else:
            pair = (ORIGIN, bad[number // 2 % len(bad)])
            refused.append(client.send_pair(*(pair if number % 4 else pair[::-1])))
        client.poll()
    assert client.are_answered(list(good))
    solver = ContactSolver(poses.CUBE, poses.CUBE, model='exact')
    for stamp, pair in good.items():
        contacts, wanted = contacts_by_pair(client.contacts[stamp]), solver(*pair)
        assert len(contacts) == wanted.colliding == (stamp in client.points)
        for contact in contacts.values():
            assert contact.separation == wanted.separation
            assert np.array_equal(contact.point, wanted.point)
    assert not any(stamp in client.contacts for stamp in refused)
    assert client.diagnostic('refused: bad pose') == str(len(refused))
    assert 'internal error' not in node.output


def test_a_request_that_rclpy_cannot_read(node, client):
    """A parameter has a type that does not exist, and rclpy's own service raises.

    The response says nothing of success. The node logs the request and goes on.
    """
    bad = [Parameter(name='model', value=ParameterValue(type=UNKNOWN_TYPE))]
    assert not client.call(SetParameters, '/contact_node/set_parameters',
                           SetParameters.Request(parameters=bad)).results
    assert not client.call(SetParametersAtomically, '/contact_node/set_parameters_atomically',
                           SetParametersAtomically.Request(parameters=bad)).result.successful
    assert f'{UNKNOWN_TYPE} is not a valid Parameter.Type' in node.output
    client.assert_answered()
    node.end()
    assert node.process.returncode == 0


# --- streams --------------------------------------------------------------------------------------


@needs_proc
@pytest.mark.parametrize('count', [5000, pytest.param(10_000, marks=pytest.mark.reports)])
def test_nothing_is_lost_at_1_kHz_and_memory_does_not_grow(node, client, count):
    """1,000 ticks of two boxes. Then a third are lone poses, and a third have their own frame."""
    stamps = []
    for _ in rate_limited(1000, 1000):
        stamps.append(client.send_pair(ORIGIN, TOUCHING))
        client.keep_up(stamps)
        client.poll()
    assert client.are_answered(stamps)
    assert client.spin(lambda: all(stamp in client.points for stamp in stamps))
    assert client.spin(lambda: all(stamp in client.normals for stamp in stamps))

    def play(count):
        for number in rate_limited(count, 5000):
            if number % 3 == 0:
                client.publishers[0].publish(cdr(ORIGIN, divmod(client.next_stamp(), 10**9)))
            else:
                frame = b'map\0' if number % 3 == 1 else b'frame %d\0' % number
                client.send_pair(ORIGIN, TOUCHING, frame)
            if number % 20 == 0:
                client.poll()

    play(count // 5)
    client.assert_answered()
    before = memory(node)
    play(count)
    client.assert_answered()
    assert memory(node) - before < LEAK


STREAM = """
from raw_client import ORIGIN, TOUCHING
from ros_client import Client
client = Client()
client.offer_until_answered(ORIGIN, TOUCHING)
print('answered', flush=True)
while True:
    client.ask(ORIGIN, TOUCHING)
"""


GREEDY = """
from raw_client import ORIGIN
from ros_client import Client
from typed_messages import a_box
from box_contact_msgs.srv import Check
client = Client()
service = client._client_of(Check, 'contact_node/check')
request = Check.Request(boxes=[a_box(f'{n}', ORIGIN, (1, 1, 1)) for n in range(91)])
asked = [service.call_async(request) for _ in range(8)]
while True:
    client.poll()
    for place, future in enumerate(asked):
        if future.done():
            print('answered' if future.result().success else 'refused', flush=True)
            asked[place] = service.call_async(request)
"""


def test_ticks_beside_a_greedy_client(node, client):
    """It always has eight costly requests under way. They wait, and ticks come between."""
    with subprocess.Popen([sys.executable, '-c', GREEDY], stdout=subprocess.PIPE, text=True,
                          env=environment()) as greedy:
        try:
            assert greedy.stdout.readline() == 'answered\n'
            for _ in range(200):
                client.ask(ORIGIN, TOUCHING)
            assert greedy.stdout.readline() == 'answered\n'
        finally:
            greedy.kill()
        outcomes = greedy.stdout.read().split()
    assert 'refused' not in outcomes


def test_publishers_killed_and_started_again(node, client):
    """Each dies in mid-stream by kill -9: the next one is answered, and so are all others."""
    for _ in range(2):
        with subprocess.Popen([sys.executable, '-c', STREAM], stdout=subprocess.PIPE, text=True,
                              env=environment()) as publisher:
            try:
                assert publisher.stdout.readline() == 'answered\n'
                client.spin(lambda: False, 0.5)
            finally:
                publisher.send_signal(signal.SIGKILL)
        client.assert_answered()
    assert node.process.poll() is None


def test_configured_again_and_again_under_a_stream(node, client):
    """Topics go and come while messages arrive, and subscribers ask for what they do not offer.

    An event that waits in EventsExecutor for a topic that goes would end the process.
    """
    stop = Event()
    others = Node('others', context=client.context)

    def publish():
        for _ in rate_limited(10**9, 1000):
            if stop.is_set():
                return
            client.send_pair(ORIGIN, TOUCHING)

    def come_and_go():
        late = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        while not stop.is_set():
            subscriptions = [others.create_subscription(message_type, topic, print, late)
                             for message_type, topic in ((Contacts, 'contacts'),
                                                         (PointStamped, 'contact/point'))]
            time.sleep(0.02)
            for subscription in subscriptions:
                others.destroy_subscription(subscription)

    threads = [Thread(target=publish), Thread(target=come_and_go)]
    for thread in threads:
        thread.start()
    try:
        for _ in range(20):
            for label in ('deactivate', 'cleanup', 'configure', 'activate'):
                assert client.call(ChangeState, '/contact_node/change_state', ChangeState.Request(
                    transition=Transition(label=label))).success, node.output
            client.contacts.clear()
            assert client.spin(lambda: len(client.contacts) > 10), node.output
    finally:
        stop.set()
        for thread in threads:
            thread.join()
        others.destroy_node()
    client.assert_answered()
    assert node.process.poll() is None and 'Traceback' not in node.output

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What breaks around a contact node, and that nothing is lost, wrong or leaked by it.

The node runs as a process of its own.
Elsewhere: killed and restarted nodes and clients (test_contact_node.py), weights and requests that
cannot be read (test_hygiene_ros.py), scenes replaced by garbage (test_scene_node.py).
"""
from __future__ import annotations

import math
import os
import shutil
import signal
import subprocess
import sys
import time
from threading import Event, Thread

import numpy as np
import pytest
from box_contact_ros.scene.stamp_pairing import AGAIN
from geometry_msgs.msg import PointStamped, PoseStamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from raw_client import APART, GOOD, LITTLE_ENDIAN, ORIGIN, TOUCHING, RawClient, cdr
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_client import PATIENCE, stamp_of
from rosgraph_msgs.msg import Clock

from box_contact_ros.demo.ros_client import ANSWERS
from box_contact_ros.node.messages import make_header

CUBES = ('--ros-args', '-p', 'size_a:=[2.0, 2.0, 2.0]', '-p', 'size_b:=[2.0, 2.0, 2.0]')
LEAK = 8.0
"""Growth [MB] of a node's memory that is taken for none, as the allocator's arenas come in steps: a
leak of 100 bytes a message in the storms below."""
STORM_SECONDS = 180.0
"""Time for a storm to be heard, some ten times what it takes: against hanging only."""


@pytest.fixture
def client():
    client = RawClient()
    yield client
    client.close()


@pytest.fixture
def start(program, client):
    """Start a contact node for two cubes, matched with the client."""
    def start(*parameters, **options):
        words = [word for parameter in parameters for word in ('-p', parameter)]
        running = program('contact_node', *CUBES, *words, **options)
        running.wait_for_output('ready', 120)
        client.offer_until_answered(ORIGIN, APART)
        return running
    return start


def memory(running):
    """Resident memory of a program [MB]."""
    with open(f'/proc/{running.process.pid}/status') as file:
        line, = (line for line in file if line.startswith('VmRSS:'))
    return int(line.split()[1]) / 1024


def rate_limited(count, rate):
    """Numbers at a rate [Hz]."""
    started = time.monotonic()
    for number in range(count):
        time.sleep(max(0.0, started + number / rate - time.monotonic()))
        yield number


def test_100_000_messages_that_are_none(start, client):
    """Random bytes, messages cut short and messages with changed bytes at some 10 kHz.

    Those that arrive are counted, none ends the node, memory does not grow, and the next pair is
    answered. Best effort may lose some of a storm: it lasts until the node has heard 100,000.
    """
    node = start()
    rng = np.random.default_rng(1)
    publish = [publisher.publish for publisher in client.publishers]
    client.node.destroy_subscription(client.raw_subscriptions[0])
    client.node.destroy_subscription(client.raw_subscriptions[1])

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
        deadline = time.monotonic() + STORM_SECONDS
        while (missing := heard - client.counts().get('poses', 0)) > 0:
            assert time.monotonic() < deadline, f'{missing} of {heard} messages not heard'
            for number in rate_limited(missing, 10_000):
                publish[number % 2](payload(number))
                if number % 100 == 0:
                    client.poll()

    storm(20_000)
    client.assert_answered()
    before = memory(node)
    storm(100_000)
    client.assert_answered()
    counts = client.counts()
    assert memory(node) - before < LEAK
    assert node.process.poll() is None and 'Traceback' not in node.output
    # Three of four kinds are almost never a PoseStamped, the fourth varies.
    assert counts['refused: not a PoseStamped'] > 0.7 * counts['poses']
    assert 'refused: internal error' not in counts
    for stamp in client.clouds:
        for row in client.rows(stamp):
            assert math.isnan(row['depth']) or np.isfinite(list(row)[:8]).all()  # but the patch


@pytest.mark.parametrize('serialization', ['raw', 'typed'])
def test_half_of_the_poses_are_none(start, client, serialization):
    """NaN, zero quaternions, infinities and denormals in every second pair, at 500 Hz.

    Each good pair is answered rightly, each bad pose counted, nothing bad is answered.
    """
    start(f'serialization:={serialization}')
    bad = [[math.nan] * 7, [0] * 7, [0, 0, math.inf, 0, 0, 0, 1], [0, 0, 1.9, 0, 0, 0, 5e-324],
           [0, 0, 1e308, 0, 0, 0, 1], [0, 0, 0, math.nan, 0, 0, 1]]
    good, refused = {}, []
    for number in rate_limited(2000, 500):
        if number % 2:
            height = 1.9 + 0.0001 * (number % 1900)
            good[client.send_pair(ORIGIN, (0, 0, height, 0, 0, 0, 1))] = height
            client.keep_up(list(good))
        else:
            pair = (ORIGIN, bad[number // 2 % len(bad)])
            refused.append(client.send_pair(*(pair if number % 4 else pair[::-1])))
        client.poll()
    assert client.spin(lambda: all(stamp in client.clouds for stamp in good)), sum(
        stamp not in client.clouds for stamp in good)
    for stamp, height in good.items():
        rows = client.rows(stamp)
        assert len(rows) == (height <= 2.0)
        assert all(row['depth'] == pytest.approx(2.0 - height, abs=1e-14) for row in rows)
    assert not any(stamp in client.clouds for stamp in refused)
    assert client.counts()['refused: bad pose'] == len(refused)


def test_memory_does_not_grow(start, client):
    """10,000 pairs of which a third lacks its partner and a third is in a frame of its own."""
    node = start()

    def play(count):
        for number in rate_limited(count, 2000):
            if number % 3 == 0:
                client.publishers[0].publish(cdr(ORIGIN, divmod(client.next_stamp(), 10**9)))
            else:
                frame = b'map\0' if number % 3 == 1 else b'frame %d\0' % number
                client.send_pair(ORIGIN, TOUCHING, frame)
            if number % 20 == 0:
                client.poll()

    play(4000)
    client.assert_answered()
    before = memory(node)
    play(10_000)
    client.assert_answered()
    assert memory(node) - before < LEAK


def test_a_clock_that_jumps_back(start, client):
    """Simulated time is set back by half a second, less than the stamps alone would tell.

    What was known of the old time is dropped, and the new time is answered from its first tick.
    """
    running = start('use_sim_time:=true')
    clock = client.node.create_publisher(Clock, '/clock', 10)

    def set_clock(stamp):
        """Say the time until the node's diagnostics carry it."""
        message = Clock(clock=make_header(stamp, '').stamp)
        deadline = time.monotonic() + PATIENCE
        while not client.diagnostics or stamp_of(client.diagnostics[-1]) != stamp:
            assert time.monotonic() < deadline, 'the node does not take the time'
            clock.publish(message)
            client.spin(lambda: False, 0.1)

    def tick(stamp):
        for publisher, pose in zip(client.publishers, (ORIGIN, TOUCHING)):
            publisher.publish(cdr(pose, divmod(stamp, 10**9)))

    start_of_time = client.next_stamp() + 10**12
    set_clock(start_of_time + 5 * 10**8)
    stamps = [start_of_time + 10**6 * number for number in range(500)]
    for number, stamp in enumerate(stamps):
        tick(stamp)
        client.keep_up(stamps[:number + 1])
    assert client.spin(lambda: all(stamp in client.clouds for stamp in stamps))
    client.clouds.clear()
    set_clock(start_of_time)
    few = stamps[:AGAIN - 1]  # of more, the stamps would tell
    for stamp in few:
        tick(stamp)
    assert client.spin(lambda: all(stamp in client.clouds for stamp in few)), len(client.clouds)
    assert client.counts()['time went back'] >= 1
    assert 'time went back: /clock was set back' in running.output


def test_a_storm_of_parameters(start, client):
    """Changes, good and bad, as fast as they are served, in a stream of 200 Hz.

    No tick is lost, each is answered with one of the sizes that were set, and the last one stands.
    """
    start()
    service = client.service(SetParameters, '/contact_node/set_parameters')
    futures, stamps = [], []

    def change(number):
        values = ([2.0, 2.0, 2.0], [2.0, 2.0, 2.2], [2.0, -2.0, 2.0], [math.nan] * 3)[number % 4]
        kind = ParameterType.PARAMETER_DOUBLE_ARRAY
        futures.append(service.call_async(SetParameters.Request(parameters=[Parameter(
            name='size_b', value=ParameterValue(type=kind, double_array_value=values))])))

    for _ in rate_limited(600, 200):
        stamps.append(client.send_pair(ORIGIN, (0, 0, 2.05, 0, 0, 0, 1)))
        client.keep_up(stamps)
        # One after the other: a service that is asked more than it answers drops requests.
        if all(future.done() for future in futures[-1:]):
            change(len(futures))
        client.poll()
    assert client.spin(lambda: all(future.done() for future in futures))
    assert client.spin(lambda: all(stamp in client.clouds for stamp in stamps)), sum(
        stamp not in client.clouds for stamp in stamps)
    assert len(futures) > 100
    success = [future.result().results[0].successful for future in futures]
    assert success == [number % 4 < 2 for number in range(len(futures))]
    depths = {round(float(row['depth']), 9) for stamp in stamps
              for row in client.rows(stamp)}
    assert depths == {0.05}
    change(0)  # the first of the four
    assert client.spin(futures[-1].done)
    assert not len(client.rows(client.ask(ORIGIN, (0, 0, 2.05, 0, 0, 0, 1))))


READER = """
import rclpy
from box_contact_ros.demo.ros_client import ANSWERS
rclpy.init()
node = rclpy.create_node('reader')
node.create_subscription(*ANSWERS['cloud'], lambda _: print('heard', flush=True), 10)
rclpy.spin(node)
"""


def test_a_subscriber_that_stops_reading(start, client):
    """A program is stopped in its tracks (SIGSTOP) after it has heard a contact.

    Everybody else is answered as before, and the node's memory does not grow.
    """
    node, deadline = start(), time.monotonic() + PATIENCE
    with subprocess.Popen([sys.executable, '-c', READER], stdout=subprocess.PIPE) as reader:
        try:
            os.set_blocking(reader.stdout.fileno(), False)
            while not reader.stdout.read():  # before discovery it would be no subscriber
                assert reader.poll() is None and time.monotonic() < deadline
                client.ask(ORIGIN, TOUCHING)
            reader.send_signal(signal.SIGSTOP)
            before = memory(node)
            stamps = []
            for _ in rate_limited(6000, 1500):  # the middleware keeps 5,000 where all is to be kept
                stamps.append(client.send_pair(ORIGIN, TOUCHING))
                client.keep_up(stamps)
                client.poll()
            assert client.spin(lambda: all(stamp in client.points for stamp in stamps))
            assert memory(node) - before < LEAK
            client.assert_answered()
        finally:
            reader.kill()


def set_scene(client, service, text):
    """Ask a node for a scene, and wait until it has it."""
    future = service.call_async(SetParameters.Request(parameters=[Parameter(
        name='scene', value=ParameterValue(type=ParameterType.PARAMETER_STRING,
                                           string_value=text))]))
    assert client.spin(future.done), 'no reply'
    assert future.result().results[0].successful


def test_scenes_change_while_deadlines_are_missed(program, client):
    """Topics come and go with events of their publishers under way: the node lives and answers.

    Served as events of EventsExecutor these ended the process, most often at the first change.
    """
    node = program('contact_node', *CUBES, '-p', 'deadline:=0.002')
    node.wait_for_output('ready', 120)
    sparse = [client.node.create_publisher(PoseStamped, f'box_{box}/pose', QoSProfile(
        depth=10, deadline=Duration(seconds=0.001))) for box in 'ab']
    scenes = ('{boxes: {box_c: {size: [2, 2, 2]}, box_d: {size: [2, 2, 2]}}, '
              'pairs: [{id: 3, name: c_d, a: box_c, b: box_d}]}', '')
    service = client.service(SetParameters, '/contact_node/set_parameters')
    for number in range(20):
        set_scene(client, service, scenes[number % 2])
        for publisher in sparse:
            publisher.publish(GOOD)
        client.spin(lambda: False, 0.1)
    assert client.counts()['deadlines missed'] > 0
    assert node.process.poll() is None


def test_topics_go_while_others_ask_for_what_they_do_not_offer(start, client):
    """Subscribers of another quality of service come and go as pairs do, and the node's contacts.

    Served as events of EventsExecutor these ended the process at one of the first changes.
    """
    node = start()
    boxes = ', '.join(f'b{k}: {{size: [2, 2, 2]}}' for k in range(12))
    scenes = [f'{{boxes: {{{boxes}}}, pairs: [' + ', '.join(
        f'{{id: {100 * n + k}, name: p{n}_{k}, a: b{k}, b: b{k + 1}}}' for k in range(11)) + ']}'
        for n in (1, 2)]
    kind, contacts = ANSWERS['cloud']
    topics = [contacts] + [f'p{n}_{k}/contact/point' for n in (1, 2) for k in range(11)]
    late = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    others = Node('others', context=client.context)
    stop = Event()

    def come_and_go():
        while not stop.is_set():
            subscriptions = [others.create_subscription(
                kind if topic == contacts else PointStamped, topic, print, late)
                for topic in topics]
            time.sleep(0.02)
            for subscription in subscriptions:
                others.destroy_subscription(subscription)

    thread = Thread(target=come_and_go)
    thread.start()
    try:
        service = client.service(SetParameters, '/contact_node/set_parameters')
        for number in range(20):
            set_scene(client, service, scenes[number % 2])
        change = client.client_of(ChangeState, '/contact_node/change_state')
        state = client.service(GetState, '/contact_node/get_state')

        def now():
            future = state.call_async(GetState.Request())
            assert client.spin(future.done), node.output
            return future.result().current_state.label

        for _ in range(5):
            for label, goal in (('deactivate', 'inactive'), ('cleanup', 'unconfigured'),
                                ('configure', 'inactive'), ('activate', 'active')):
                # A reply may be lost as long as the way back is not matched: the state tells.
                change.call_async(ChangeState.Request(transition=Transition(label=label)))
                deadline = time.monotonic() + PATIENCE
                while now() != goal:
                    assert time.monotonic() < deadline, label
    finally:
        stop.set()
        thread.join()
        others.destroy_node()
    set_scene(client, service, '')
    client.offer_until_answered(ORIGIN, APART)
    client.assert_answered()


FILL = ('mount -t tmpfs -o size=8m none /dev/shm && head -c {} /dev/zero > /dev/shm/full; '
        'exec "$@"')


def with_full_memory(filled):
    """Command prefix: a mount namespace with 8 MB of shared memory, of which so many are taken."""
    within = ['unshare', '--mount', 'sh', '-c', FILL.format(filled), 'sh']
    if not shutil.which('unshare') or subprocess.run([*within, 'true'],
                                                     capture_output=True).returncode:
        pytest.skip('mount namespaces are not permitted here')
    return within


def test_shared_memory_is_almost_full(program):
    """Less room in /dev/shm than Fast DDS takes, which would be killed by SIGBUS.

    Node and crane talk without it, say so, and no message is lost (else the crane's status is not
    0).
    """
    within = with_full_memory(8 * 2**20 - 200_000)
    node = program('contact_node', *CUBES, within=within)
    assert 'going without shared memory' in node.wait_for_output('ready', 120)
    crane = program('crane', *CUBES, '-p', 'duration:=5', '-p', 'wait:=10', within=within)
    assert crane.wait(120) == 0, crane.output
    node.signal(signal.SIGINT)
    assert node.wait() == 0 and 'Traceback' not in node.output


def test_shared_memory_is_full(program):
    """No page left: ROS 2's libraries would be killed as they are loaded; a clear line instead."""
    node = program('contact_node', *CUBES, within=with_full_memory(8 * 2**20))
    assert node.wait(60) == 1
    assert node.output.splitlines()[-1].startswith('error: /dev/shm is full')


def test_no_shared_memory_is_left_behind(start, client):
    """A node that ends by itself leaves no segment of its own in /dev/shm.

    Ports are shared with others. One that is killed does leave segments, which
    docs/how-to/troubleshooting.md tells how to clear.
    """
    before = set(os.listdir('/dev/shm')) if os.path.isdir('/dev/shm') else set()
    node = start()
    with open(f'/proc/{node.process.pid}/maps') as file:
        mapped = {line.split()[-1] for line in file if '/dev/shm/fastrtps_' in line}
    segments = {path for path in mapped
                if 'port' not in path and os.path.basename(path) not in before}
    if not segments:
        pytest.skip('Fast DDS uses no shared memory here')
    node.signal(signal.SIGTERM)
    assert node.wait() == 0
    assert not any(os.path.exists(path) for path in segments)

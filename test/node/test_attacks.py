# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Attacks from the network on every node that reads parameters, files, poses and requests."""
from __future__ import annotations

import math
import os
import signal
import time

import pytest
from box_contact_ros.node.named_files import LARGEST_TEXT
from geometry_msgs.msg import Pose, PoseArray, PoseStamped, Quaternion
from lifecycle_msgs.msg import Transition
from raw_client import ORIGIN, TOUCHING, cdr
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from ros_client import stamp_of
from rosgraph_msgs.msg import Clock
from stranger import ANSWER_SECONDS, Stranger

from box_contact_ros.demo.ros_client import ANSWERS
from box_contact_ros.node.messages import make_header

NODES = ('contact_node', 'soup_node', 'markers')
LIFECYCLE_NODES = NODES[:2]
SECRET = 'hunter2'
CUBES = ('-p', 'size_a:=[2.0, 2.0, 2.0]', '-p', 'size_b:=[2.0, 2.0, 2.0]')
UNKNOWN_TYPE = 77
FLOOD = 200  # requests, in a few seconds


@pytest.fixture
def attacked(program, tmp_path, monkeypatch):
    """Start a node in a folder of its own; return it and a stranger."""
    strangers = []

    def start(name, *parameters, scene=''):
        home = tmp_path / 'home'
        home.mkdir()
        monkeypatch.chdir(home)
        boxes = CUBES
        if scene:
            (home / 'scene.yaml').write_text(scene)
            boxes = ('-p', 'scene:=scene.yaml')
        words = [word for parameter in parameters for word in ('-p', parameter)]
        running = program(name, '--ros-args', *boxes, *words)
        running.home = home
        running.wait_for_output('ready', 120)
        strangers.append(Stranger(name))
        return running, strangers[-1]
    yield start
    for stranger in strangers:
        stranger.close()


def ends_at_once(running, number=signal.SIGINT):
    """Whether a signal ends a program within two seconds, with status 0."""
    started = time.monotonic()
    running.signal(number)
    return running.wait() == 0 and time.monotonic() - started < 2.0


@pytest.mark.parametrize('name', NODES)
def test_files(attacked, tmp_path, name):
    """A refusal tells neither what a file holds nor whether there is one; its size does not hang.

    `markers` gave the text of any file that it could read.
    """
    running, stranger = attacked(name)
    outside = tmp_path / 'outside'
    outside.mkdir()
    paths = []
    for folder in (running.home, outside):
        (folder / 'line').write_text(f'{SECRET}\n')
        (folder / 'key').write_text(f'{SECRET}: 1\nboxes: {{}}\npairs: []\n')
        (folder / 'json').write_text('{"boxes": [' + '1,' * 8_000_000 + '1]}')
        (folder / 'large').write_text('{"boxes": [' + '1,' * 1_190_000 + '1]}')
        (folder / 'floats').write_text('{"boxes": {' + ','.join(
            f'"k{n}": {{}}' for n in range(390_000)) + '}, "pairs": []}')
        os.mkfifo(folder / 'fifo')
        paths += [str(folder / file) for file in (
            'line', 'key', 'json', 'large', 'floats', 'fifo', 'none')]
    for path in (*paths, '/etc/passwd', '/dev/zero', '/proc/self/environ', '../outside/line'):
        result = stranger.set(scene=path)
        assert not result.successful
        assert result.reason == (
            f'scene {path!r} refused: the log on the machine of the node says why')
    assert SECRET in running.output  # the local log quotes
    assert not any(SECRET in line for line in stranger.heard_logs)
    assert stranger.slowest < ANSWER_SECONDS
    assert ends_at_once(running)


@pytest.mark.parametrize('name', NODES)
def test_texts(attacked, name):
    """Scenes as text that ask for more than their reader can bear are refused within a second."""
    running, stranger = attacked(name)
    fleet = '{{boxes: {{a: {{size: [1, 1, 1], count: {}}}}}, {}pairs: [{}]}}'
    each_with_each = "{a: 'a*', b: 'a*'}"
    for text, words in (
            (fleet.format(99_999, '', "{a: 'a*', b: a01}"), '99999 boxes are more than 10000'),
            (fleet.format(9_999, '', "{a: 'a*', b: a01}"), 'set poses: array'),
            (fleet.format(1000, 'poses: array, ', each_with_each), 'pairs'),
            ('{' + ' ' * LARGEST_TEXT, f'at most {LARGEST_TEXT}'),
            ('{boxes: ' + '[' * 1000, 'nested too deeply'),
            ('{boxes: {a: {size: [010, 1:30, 1]}}, pairs: []}', "'1:30'"),
            ('{boxes: {a: {size: [' + '9' * 100_000 + ', 1, 1]}}, pairs: []}', 'size')):
        result = stranger.set(scene=text)
        assert not result.successful and words in result.reason and len(result.reason) <= 1000
    assert stranger.slowest < ANSWER_SECONDS
    assert ends_at_once(running)


@pytest.mark.parametrize('name', NODES)
def test_requests_that_rclpy_cannot_read(attacked, name):
    """Each is answered, without success, and logged once a second; the client waited for ever."""
    running, stranger = attacked(name)
    bad = [Parameter(name='size_a', value=ParameterValue(type=UNKNOWN_TYPE))]
    for _ in range(FLOOD):
        assert not stranger.call(SetParameters, 'set_parameters', parameters=bad).results
        assert not stranger.call(SetParametersAtomically, 'set_parameters_atomically',
                                 parameters=bad).result.successful
    assert stranger.slowest < ANSWER_SECONDS
    assert running.output.count('is not a valid Parameter.Type') < FLOOD / 4
    assert 'Traceback' not in running.output
    assert ends_at_once(running)


@pytest.mark.parametrize('name', LIFECYCLE_NODES)
def test_transitions_that_the_state_does_not_have(attacked, name):
    """By id, rclpy raises: the client waited for ever, with a traceback for each request."""
    running, stranger = attacked(name)
    for _ in range(FLOOD // 4):
        for transition in (Transition.TRANSITION_ACTIVATE, Transition.TRANSITION_CLEANUP,
                           Transition.TRANSITION_CREATE, 99, 255):
            assert not stranger.ask_for(transition)
    assert stranger.slowest < ANSWER_SECONDS
    assert stranger.state() == 'active'
    assert running.output.count('change_state') < FLOOD / 4 and 'Traceback' not in running.output
    assert ends_at_once(running)


@pytest.mark.parametrize('name', NODES)
def test_a_locked_node_and_its_descriptors(attacked, name):
    """No parameter of a locked node changes."""
    running, stranger = attacked(name, 'locked:=true')
    for values in ({'scene': 'two_boxes'}, {'use_sim_time': True}, {'locked': False},
                   {'files_from': '/'}):
        assert not stranger.set(**values).successful, values
    assert ends_at_once(running, signal.SIGTERM)


@pytest.mark.parametrize('name', NODES)
def test_logs(attacked, name):
    """Changes of parameters and a clock that goes wild are logged once a second."""
    running, stranger = attacked(name, 'use_sim_time:=true')
    clock = stranger.node.create_publisher(Clock, '/clock', 10)
    assert stranger.spin(clock.get_subscription_count)
    lines = running.output.count('\n')
    started = time.monotonic()
    for number in range(FLOOD):
        stranger.set(scene='two_boxes' if number % 2 else '')
        message = Clock()
        message.clock.sec = -5 if number % 2 else 1000 - number
        clock.publish(message)
    stranger.spin(lambda: False, 0.5)
    seconds = time.monotonic() - started
    assert running.output.count('\n') - lines <= 8 * (seconds + 2)
    assert ends_at_once(running)


THREE = """\
boxes: {box_a: {size: [2, 2, 2]}, box_b: {size: [2, 2, 2]}, box_c: {size: [2, 2, 2]}}
pairs: [{a: box_a, b: box_b}, {a: box_b, b: box_c}]
"""
SECOND = 10**9
FAR = (50, 0, 0, 0, 0, 0, 1)


def answers_of(stranger, name):
    """Return contacts by stamp, as they come from a node."""
    if name == 'soup_node':
        kind, topic = ANSWERS['cloud']
        stranger.node.create_subscription(
            kind, f'soup/{topic}',
            lambda message: stranger.clouds.setdefault(stamp_of(message), message), 1000)
    return stranger.clouds


@pytest.mark.parametrize('name', LIFECYCLE_NODES)
def test_a_stamp_an_hour_ahead(attacked, name):
    """One pose of a silent box delays no contact of the others; it is counted, and named.

    All their contacts were late by max_age, and diagnostics said "answering".
    """
    coarse = ['divisions:=1'] if name == 'soup_node' else []
    running, stranger = attacked(name, *coarse, scene=THREE)
    answers = answers_of(stranger, name)
    third = stranger.node.create_publisher(PoseStamped, 'box_c/pose', 10)
    assert stranger.spin(third.get_subscription_count)

    def tick(third_ahead=None, patience=0.9):  # less than max_age: longer would be a pause
        stamp = stranger.next_stamp()
        if third_ahead is not None:
            third.publish(cdr(FAR, divmod(stamp + third_ahead, SECOND)))
        for publisher, pose in zip(stranger.publishers, (ORIGIN, TOUCHING)):
            publisher.publish(cdr(pose, divmod(stamp, SECOND)))
        started = time.monotonic()
        stranger.spin(lambda: stamp in answers, patience)
        return stamp in answers, time.monotonic() - started

    assert stranger.spin(lambda: tick(0)[0])
    # Box c falls silent. It is waited for until it is stale.
    assert stranger.spin(lambda: all(tick(patience=0.1)[0] for _ in range(5)))
    tick(3600 * SECOND)
    answered, seconds = zip(*(tick() for _ in range(20)))
    assert sum(answered) >= 18 and sorted(seconds)[10] < 0.5
    assert stranger.diagnostic('refused: stamp ahead of the other boxes') == '1'
    assert stranger.diagnostic('boxes ahead') == 'box_c'
    assert 'box_c: stamp' in running.output and 'ahead of the other boxes' in running.output
    assert ends_at_once(running)


@pytest.mark.parametrize('name, pairs', [('contact_node', 200), ('soup_node', 12)])
def test_a_crowd_in_one_place(attacked, name, pairs):
    """Boxes, each paired with each, are in one place: the tick is refused, counted and logged."""
    scene = (f'{{boxes: {{a: {{size: [2, 2, 2], count: {2 * pairs}}}}}, poses: array, '
             "pairs: [{a: 'a*', b: 'a*'}]}")
    running, stranger = attacked(name, 'pair_topics:=false', scene=scene)
    publisher = stranger.node.create_publisher(PoseArray, 'poses', 10)
    assert stranger.spin(publisher.get_subscription_count)
    poses = [Pose(orientation=Quaternion(w=1.0))] * (2 * pairs)
    while not stranger.diagnostic('refused: too many pairs near'):
        publisher.publish(PoseArray(header=make_header(stranger.next_stamp(), 'map'), poses=poses))
    assert 'pairs are near each other: more than' in running.output
    assert ends_at_once(running)


MEGABYTE = 'n' * 2**20
GROWTH = 50.0  # MB


def memory(running):
    """Resident memory of a program [MB]."""
    with open(f'/proc/{running.process.pid}/status') as file:
        line, = (line for line in file if line.startswith('VmRSS:'))
    return int(line.split()[1]) / 1024


@pytest.mark.skipif(not os.path.isdir('/proc/self'), reason='no /proc: not Linux')
@pytest.mark.parametrize('name', NODES)
def test_floods_on_a_locked_node(attacked, name):
    """Poses that are none, names and texts of a megabyte: it answers on, and keeps none of them."""
    running, stranger = attacked(name, 'locked:=true')
    assert stranger.spin(lambda: all(
        publisher.get_subscription_count() for publisher in stranger.publishers))
    for subscription in stranger.raw_subscriptions:
        stranger.node.destroy_subscription(subscription)
    good = cdr(ORIGIN, (5, 7))
    before = memory(running)
    for number in range(FLOOD):
        stranger.send_raw(good[:number % len(good)], b'\xff' * 60_000,
                          cdr(ORIGIN, (5, number), b'n' * 60_000 + b'\0'),
                          cdr(ORIGIN, (5, number), f'{number:0250d}'.encode() + b'\0'),
                          cdr([math.nan] * 7, (5, number)))
        if number % 20 == 0:
            assert not stranger.set(scene=MEGABYTE + str(number)).successful
            assert not stranger.set(**{f'n{number}{MEGABYTE}': True}).successful
    stranger.slowest = 0.0
    assert not stranger.set(scene='').successful and stranger.slowest < ANSWER_SECONDS
    assert memory(running) - before < GROWTH
    assert 'Traceback' not in running.output and 'internal error' not in running.output
    assert ends_at_once(running)

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a node says of everything that a first run gets wrong, over DDS by plain rclpy.

All nodes run at once in one process, each in a namespace of its own, with one fault each. Then
those remedies are followed that need no new start.
"""
from __future__ import annotations

import math
import re
import time
from collections import defaultdict

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped, Pose, PoseStamped
from patience import PATIENCE
from rcl_interfaces.msg import Log
from rclpy.context import Context
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.task import Future
from ros_client import CUBES, overrides, stamp_of
from typed_messages import pose_stamped

from box_contact_ros.node.contact_node import ContactNode

SECOND = 10**9
RATE = 20  # Hz
WATCHED = 9.0  # s: five for an error, and the reports around it
HEIGHTS = {'box_a': 0.0, 'box_b': 1.9}
THREE = """\
boxes: {a: {size: [2, 2, 2]}, b: {size: [2, 2, 2]}, c: {size: [2, 2, 2]}}
pairs: [{a: a, b: b}, {a: b, b: c}]
"""
PARAMETERS = {case: CUBES | values for case, values in {
    'zero_latest': {'pairing': 'latest'}, 'latest_clocks': {'pairing': 'latest'},
    'latest_bad': {'pairing': 'latest'}, 'clocks': {'max_age': 0.0},
    'unreliable': {'qos_overrides./unreliable/box_a/pose.subscription.reliability': 'reliable'},
    'unconfigured': {'autostart': False}, 'inactive': {'autostart': False}}.items()}


def pose_of(box, stamp, frame='map', w=1.0, z=None):
    """Make a PoseStamped of a box that touches the other one."""
    height = HEIGHTS.get(box, 0.0) if z is None else z
    return pose_stamped((0, 0, height, 0, 0, 0, w), frame, stamp)


def poses(case, number, now):
    """Return the messages by box that a case publishes at one tick; `now` [ns]."""
    both = {box: pose_of(box, now) for box in HEIGHTS}
    return {
        'good': lambda: both,
        'zero': lambda: {box: pose_of(box, 0) for box in HEIGHTS},
        'zero_latest': lambda: {box: pose_of(box, 0) for box in HEIGHTS},
        'apart': lambda: {'box_a': both['box_a'], 'box_b': pose_of('box_b', now - SECOND // 64)},
        'clocks': lambda: {'box_a': both['box_a'], 'box_b': pose_of('box_b', now - 9**10)},
        'latest_clocks': lambda: {'box_a': both['box_a'],
                                  'box_b': pose_of('box_b', now - 5 * SECOND)},
        'alone': lambda: {'box_a': both['box_a']},
        'mistyped': lambda: {'box_a': both['box_a'], 'box_b': Pose()},
        'unreliable': lambda: both,
        'slash': lambda: {'box_a': both['box_a'], 'box_b': pose_of('box_b', now, '/map')},
        'latest_bad': lambda: {'box_a': both['box_a'], 'box_b': pose_of('box_b', now, w=0.0)},
        'bad': lambda: {'box_a': pose_of('box_a', now, w=0.0),
                        'box_b': pose_of('box_b', now, z=math.nan)},
        'loop': lambda: {box: pose_of(box, number % 10 * SECOND // RATE) for box in HEIGHTS},
        'stopped': lambda: both if number < 2 * RATE else {},
        'stale': lambda: both if number < 2 * RATE else {'box_a': both['box_a']},
        'three': lambda: {box: pose_of(box, now) for box in 'ab'},
    }.get(case, dict)()


CASES = ('good', 'zero', 'zero_latest', 'apart', 'clocks', 'latest_clocks', 'alone', 'mistyped',
         'unreliable', 'slash', 'bad', 'latest_bad', 'loop', 'stopped', 'stale', 'three', 'silent',
         'unconfigured', 'inactive')


class FirstRuns:
    """All cases: their nodes, and who publishes to them and listens."""

    def __init__(self, three):
        # Of one participant, a topic has one type.
        self.contexts = Context(), Context()
        for context in self.contexts:
            rclpy.init(context=context)
        given = PARAMETERS | {'three': {'scene': three, 'model': 'exact'}}
        self.nodes = {case: ContactNode(
            self.contexts[0], namespace=case, parameter_overrides=overrides(
                **given.get(case, CUBES))) for case in CASES}
        for node in self.nodes.values():
            if node.autostart:
                node.start()
        self.nodes['inactive'].trigger_configure()
        self.client = Node('client', context=self.contexts[1])
        self.executors = [EventsExecutor(context=context) for context in self.contexts]
        for node in (*self.nodes.values(), self.client):
            self.executors[node is self.client].add_node(node)
        self.lines = defaultdict(list)
        self.diagnostics = defaultdict(list)
        self.points = defaultdict(set)
        deep = QoSProfile(depth=1000)
        unreliable = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
        self.publishers = {(case, box): self.client.create_publisher(
            type(message), f'/{case}/{box}/pose', unreliable if case == 'unreliable' else deep)
            for case in CASES for box, message in poses(case, 0, 0).items()}
        self.client.create_subscription(Log, '/rosout', self._hear, QoSProfile(
            depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL))  # what was said before, too
        self.client.create_subscription(DiagnosticArray, '/diagnostics', self._look, deep)
        for case in CASES:
            self.client.create_subscription(
                PointStamped, f'/{case}/contact/point',
                lambda message, case=case: self.points[case].add(stamp_of(message)), deep)

    def _hear(self, log):
        case, _, name = log.name.partition('.')
        if name == 'contact_node' and log.level >= 30:  # a warning
            self.lines[case].append(log.msg)

    def _look(self, message):
        status = message.status[0]
        values = {entry.key: entry.value for entry in status.values}
        self.diagnostics[status.name.split('/')[1]].append(
            (status.level[0], status.message, values))

    def spin(self):
        for executor in self.executors:
            executor.spin_until_future_complete(Future(), 0.005)

    def match(self):
        """Wait until all nodes hear their poses, and are heard."""
        deadline = time.monotonic() + PATIENCE
        while not (self.diagnostics.keys() >= set(CASES) and all(
                publisher.get_subscription_count() for publisher in self.publishers.values()
                if publisher.msg_type is PoseStamped and 'unreliable' not in publisher.topic)):
            assert time.monotonic() < deadline
            self.spin()

    def play(self, cases, seconds):
        """Publish the poses of cases at RATE, with stamps that no load of the machine moves."""
        began, first = time.monotonic(), time.time_ns()
        for number in range(int(seconds * RATE)):
            for case in cases:
                for box, message in poses(case, number, first + number * SECOND // RATE).items():
                    self.publishers[case, box].publish(message)
            while time.monotonic() < began + (number + 1) / RATE:
                self.spin()

    def play_until(self, case, done):
        deadline = time.monotonic() + PATIENCE
        while not done():
            assert time.monotonic() < deadline, (self.lines[case][-3:], self.diagnostics[case][-1:])
            self.play([case], 0.5)

    def follow(self, case, **parameters):
        """Set parameters of the node of a case, as its log says; wait for contacts, and no word."""
        self.points[case].clear()
        result, = self.nodes[case].set_parameters([
            Parameter(name, value=value) for name, value in parameters.items()])
        assert result.successful
        self.play_until(case, lambda: len(self.points[case]) > RATE
                        and self.diagnostics[case][-1][:2] == (0, 'answering'))

    def close(self):
        for executor in self.executors:
            executor.shutdown()
        for node in (*self.nodes.values(), self.client):
            node.destroy_node()
        for context in self.contexts:
            context.try_shutdown()


@pytest.fixture(scope='module')
def runs(tmp_path_factory):
    path = tmp_path_factory.mktemp('scenes') / 'three.yaml'
    path.write_text(THREE)
    runs = FirstRuns(str(path))
    runs.match()
    runs.play(CASES, WATCHED)
    runs.last = {case: seen[-1] for case, seen in runs.diagnostics.items()}
    yield runs
    runs.close()


def told(runs, case, pattern):
    """Return what the log of a case says, once a second at most."""
    matches = [match for line in runs.lines[case] if (match := re.search(pattern, line))]
    assert matches, runs.lines[case]
    assert len(matches) <= WATCHED + 1
    return matches[0]


def test_a_good_run_is_told_nothing(runs):
    assert not runs.lines['good']
    assert runs.last['good'][:2] == (0, 'answering')
    assert all(level == 0 for level, *_ in runs.diagnostics['good'])


def test_stamps_of_zero(runs):
    """`ros2 topic pub` without a stamp, twice: the first pair is answered, and no other.

    A node that was started as its line says is told nothing.
    """
    told(runs, 'zero', r'stamp 0 s does not advance; refused: set header\.stamp .*, or start with '
                       'pairing:=latest')
    assert runs.last['zero'][:2] == (
        2, 'unanswered for 5 s: box_a_box_b; poses refused: repeated stamp')
    assert runs.points['zero'] == {0}
    assert not runs.lines['zero_latest']
    assert runs.last['zero_latest'][:2] == (0, 'answering')


def test_stamps_that_never_agree(runs):
    """Two publishers that know nothing of each other: the log says a tolerance that does."""
    line = told(runs, 'apart', r'stamps of box_a and box_b differ by ([\d.]+) s: none could be '
                               r'answered; set tolerance:=([\d.]+), or start with pairing:=latest')
    assert float(line[1]) == pytest.approx(1 / 64, abs=2e-3)
    level, message, _ = runs.last['apart']
    assert level == 2 and 'poses without a partner: stamps of box_a and box_b' in message
    assert not runs.points['apart']
    runs.follow('apart', tolerance=float(line[2]))


def test_two_clocks(runs):
    """Where boxes are never stale (max_age 0), and where they are."""
    told(runs, 'clocks', r'differ by \d.* s: .*stamp both by one clock \(use_sim_time')
    told(runs, 'latest_clocks', r'stale boxes: box_b: .* is 5(\.\d+)? s behind, max_age is 1 s')
    assert runs.last['latest_clocks'][:2] == (
        2, 'unanswered for 5 s: box_a_box_b; stale boxes: box_b')


def test_a_box_that_never_came(runs):
    """By name and topic, also if its poses have another type or QoS; it is not called stale."""
    told(runs, 'alone', r'no pose ever came: box_b: nobody publishes /alone/box_b/pose')
    told(runs, 'mistyped', r"no pose ever came: box_b: /mistyped/box_b/pose is published as "
                           r"'geometry_msgs/msg/Pose', not as geometry_msgs/msg/PoseStamped")
    told(runs, 'unreliable', 'no pose ever came: box_a: /unreliable/box_a/pose is published with '
                             'another quality of service: .*[Bb]est effort')
    for case in ('alone', 'mistyped'):
        level, message, values = runs.last[case]
        assert (level, message) == (
            2, 'unanswered for 5 s: box_a_box_b; no pose ever came: box_b')
        assert values['boxes that never came'] == 'box_b' and values['stale boxes'] == ''
        assert values['unanswered pairs'] == '1'
    # One pair of three boxes is answered, the other is not.
    level, message, _ = runs.last['three']
    assert (level, message) == (2, 'unanswered for 5 s: b_c; no pose ever came: c')


def test_frames_that_differ(runs):
    told(runs, 'slash', r"box_a is in frame 'map', box_b in '/map': the leading slash is the "
                        r'difference; refused')
    assert runs.last['slash'][1].endswith('poses refused: frame_id differs')
    assert not runs.points['slash']


def test_one_kind_of_refusal_hides_no_other(runs):
    """A quaternion of zeros and NaN at the same rate: both are logged, with their remedies."""
    told(runs, 'bad', r'w=0\) has zero length; refused: set orientation\.w to 1\.0')
    told(runs, 'bad', r'position \(0, 0, nan\) is not finite; refused: send finite numbers')
    level, message, values = runs.last['bad']
    assert level == 2 and message.endswith('poses refused: bad pose')
    assert values['boxes that never came'] == ''


def test_a_box_of_which_each_pose_is_refused_is_not_called_stale(runs):
    told(runs, 'latest_bad', r'w=0\) has zero length; refused')
    assert runs.last['latest_bad'][2]['stale boxes'] == ''
    assert not any('behind' in line for line in runs.lines['latest_bad'])


def test_a_bag_in_a_loop(runs):
    """Half a second, again and again: its stamps are answered once, then refused and logged."""
    told(runs, 'loop', r'stamp [\d.]+ s (has come before|does not advance); refused: ')
    level, message, values = runs.last['loop']
    assert level == 2 and message.endswith('poses refused: repeated stamp')
    assert values['evaluations'] == '10'


def test_poses_that_stop(runs):
    """Publishers that have gone: by the steady clock, whatever the stamps."""
    level, message, _ = runs.last['stopped']
    assert level == 1 and re.fullmatch(r'poses have stopped: none for [5-7] s', message)


def test_a_box_that_falls_silent(runs):
    levels = [message for _, message, _ in runs.diagnostics['stale']]
    assert 'stale boxes: box_b' in levels
    told(runs, 'stale', r'stale boxes: box_b: the newest stamp of box_b is \S+ s behind')
    assert not any('without a partner' in message for message in levels)
    runs.client.destroy_publisher(runs.publishers.pop(('stale', 'box_b')))
    deadline = time.monotonic() + PATIENCE
    while not any('nobody publishes /stale/box_b/pose' in line for line in runs.lines['stale']):
        assert time.monotonic() < deadline
        stamp = pose_of('box_a', time.time_ns())
        runs.publishers['stale', 'box_a'].publish(stamp)
        runs.play([], 0.1)


def test_nobody_publishes(runs):
    """Five seconds after the start."""
    assert runs.last['silent'][:2] == (1, 'no pose ever came: box_a, box_b')
    told(runs, 'silent', 'nobody publishes /silent/box_a/pose; nobody publishes /silent/box_b/pose')


def test_the_state_is_told(runs):
    for state in ('unconfigured', 'inactive'):
        assert {(level, message, values['lifecycle state'])
                for level, message, values in runs.diagnostics[state]} == {
            (1, f'{state}: no pose is answered', state)}
    assert runs.last['good'][2]['lifecycle state'] == 'active'
    node = runs.nodes['inactive']
    node.trigger_activate()
    heard = len(runs.diagnostics['inactive'])
    runs.play_until('inactive', lambda: len(runs.diagnostics['inactive']) > heard + 1)
    level, message, values = runs.diagnostics['inactive'][-1]
    assert (level, message, values['lifecycle state']) == (0, 'no poses', 'active')

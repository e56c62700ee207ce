# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a report says of a node that is busy, without DDS. Over DDS: test_first_run.py."""
from __future__ import annotations

import time
from collections import Counter
from types import SimpleNamespace
from unittest.mock import Mock

import pytest
from geometry_msgs.msg import PoseStamped

from box_contact_ros import SceneSolver
from box_contact_ros.node import diagnostics
from box_contact_ros.node.diagnostics import ACTIVE, MOST_TOLD, Diagnostics, TickMonitor
from box_contact_ros.node.tick import PoseQueue
from box_contact_ros.node.topics import SceneTopics
from box_contact_ros.scene.scene import two_boxes
from box_contact_ros.stream.pairing import OVERTAKEN, StampedPose, StampPairing
from box_contact_ros.stream.streams import watched_of

MAX_AGE = 10**9  # ns
SOLVER = SceneSolver(two_boxes((1, 1, 1), (1, 1, 1)))


@pytest.fixture
def node(monkeypatch):
    """Return counts, and a function for the message of a report after so many seconds."""
    counts, clock = Counter(), [0.0]
    monkeypatch.setattr(diagnostics, 'time', SimpleNamespace(monotonic=lambda: clock[0]))
    node = Mock()
    node.get_clock().now().nanoseconds = 0
    node.get_fully_qualified_name.return_value = '/node'
    monitor = TickMonitor()
    reporter = Diagnostics(node, counts, monitor)
    pairing = StampPairing(SOLVER.scene, max_age=MAX_AGE, counts=counts)
    topics = Mock(why_silent=lambda box: f'nobody publishes {box}', rivals=list,
                  publisher_count=lambda box: 1)

    def report(seconds, *checks, age=None, lost=0):
        """Report after so long, with times of requests [s]; age: of an answer [ns]."""
        if age is not None:
            monitor.evaluated(10_000, age, [])
        clock[0] += seconds
        reporter.report(ACTIVE, SOLVER.scene, 'exact', pairing, topics, lost, checks)
        status = node.create_publisher().publish.call_args.args[0].status[0]
        report.level, report.lines = status.level, node.get_logger().warning.call_args_list
        report.values = {entry.key: entry.value for entry in status.values}
        return status.message
    report.pairing, report.answer = pairing, lambda: monitor.evaluated(10_000, 0, [])
    report.monitor = monitor
    return counts, report


def test_poses_stop_for_a_node_that_listens(node):
    counts, report = node
    counts['poses'] += 2
    assert report(1.0) == 'no answers'
    assert report(1.0).startswith('poses have stopped: none for 1 s')


def test_a_busy_node_does_not_say_that_poses_stop(node):
    """It could take none, or dropped those that it took."""
    counts, report = node
    counts['poses'] += 2
    report(1.0)
    assert 'stopped' not in report(3.0)
    counts.update({'poses': 200, OVERTAKEN: 200})
    assert report(3.0) == 'answers are late: none for 3.0 s; 200 poses lost'
    assert 'list fewer pairs' in report.lines[-1].args[0]
    assert report(1.0).startswith('poses have stopped: none for 1 s')


def test_a_node_that_nobody_asks_is_told_once(node):
    """Not every ten seconds: it may only serve requests, and wait for the first one."""
    _, report = node
    for _ in range(40):
        message = report(1.0)
    assert (report.level, message) == (b'\1', 'no pose ever came: box_a, box_b')
    line, = report.lines
    assert line.args[0].endswith('nobody publishes box_a; nobody publishes box_b')


def test_a_node_that_only_serves_requests_is_well(node):
    """Also between them."""
    counts, report = node
    counts['checks answered'] += 200
    assert report(10.0, *[0.001] * 199, 0.1) == 'answering requests'
    assert (report.level, report.values['check p99 [ms]']) == (b'\0', '1.0')
    assert report(10.0) == 'no poses' and report.level == b'\0'
    assert 'check p99 [ms]' not in report.values and not report.lines
    counts['checks refused'] += 1
    assert report(1.0, 0.001) == 'answering requests'
    counts['poses'] += 1
    assert report(1.0, 0.001) == 'no answers'


def test_a_burst_that_is_lost_is_not_a_node_that_is_late(node):
    """Its answers are new: the node need not be faster."""
    counts, report = node
    counts.update({'poses': 200, OVERTAKEN: 100})
    assert report(1.0, age=10**5) == 'a burst of poses was lost: 100'
    assert 'raise the depth' in report.lines[-1].args[0]
    counts.update({'poses': 200, OVERTAKEN: 100})
    assert report(1.0, age=10**9).startswith('answers are late: 1000 ms, 100 ticks; 100 poses lost')


def test_poses_that_never_came_are_told(node):
    """Where the process stood still, the queue has pushed them out before the node took any."""
    counts, report = node
    counts['poses'] += 20
    assert report(5.0, age=10**5, lost=1000) == 'a burst of poses was lost: 1000'
    assert 'stood still' in report.lines[-1].args[0]
    assert report.values['lost since the last report'] == '1000'
    counts['poses'] += 200
    assert report(1.0, age=10**5) == 'answering'
    counts['poses'] += 200
    assert report(1.0, age=10**5, lost=None) == 'answering'
    assert report.values['lost since the last report'] == 'unknown'
    counts.update({'poses': 200, OVERTAKEN: 100})
    assert report(1.0, age=10**5, lost=None) == 'a burst of poses was lost: at least 100'


def test_a_name_that_moves_nothing_is_logged_once(node):
    """With the nearest one, one in a report, whatever comes between; of endless names, few."""
    _, report = node
    for unknown in (('box_c', 'hook'), (), ('hook', 'box_c')) * 20:
        report.monitor.unknown = unknown
        message = report(1.0)
        assert ('names that move nothing: ' in message) == bool(unknown)

    def lines():
        told = [call.args[0] for call in report.lines]
        return [line for line in told if 'moves nothing' in line]

    end = ': the scene has no such box or body, or it does not move; ask ~/get_boxes'
    assert lines() == [f"poses: 'box_c' moves nothing (did you mean box_b?){end}",
                       f"poses: 'hook' moves nothing{end}"]
    for number in range(2 * MOST_TOLD):
        report.monitor.unknown = (f'n{number}',)
        report(1.0)
    assert len(lines()) == MOST_TOLD


def test_poses_that_an_inactive_node_leaves_are_not_lost():
    """Their numbers are missing, as those of lost poses are."""
    for restarts, lost in ((False, 498), (True, 0)):
        queue = PoseQueue(lambda: 1)
        queue.is_overtaken(1, 0)
        if restarts:
            queue.restart()
        queue.is_overtaken(500, 10**9)
        assert queue.take_lost() == lost


def test_numbers_of_several_publishers_are_not_compared():
    """The poses of both are used, and a loss shows again once one of them is gone."""
    publishers = [1]
    queue = PoseQueue(lambda: publishers[0])
    assert not any(queue.is_overtaken(number, 0) for number in range(1, 6000))
    publishers[0] = 2
    numbers = [number for turn in range(50) for number in (turn + 1, turn + 6000)]
    assert not any(queue.is_overtaken(number, 0) for number in numbers)
    assert queue.take_lost() is None and queue.is_shared
    publishers[0] = 1
    assert queue.take_lost() == 0 and not queue.is_shared
    assert not queue.is_overtaken(6050, 0) and queue.is_overtaken(6060, 0)
    assert queue.take_lost() == 9


def test_a_wall_clock_that_is_set_back_drops_no_pose():
    """After a loss, poses that waited are old by the clock, but none is that comes later."""
    queue, now = PoseQueue(lambda: 1), time.time_ns()
    assert [queue.is_overtaken(number, now - age) for number, age in (
        (1, 30_000), (9, 20_000), (10, 10_000))] == [False, True, True]
    set_back = now - 30 * 10**9
    assert not any(queue.is_overtaken(number, set_back + number) for number in range(11, 99))


def test_a_publisher_that_is_started_anew_is_not_two():
    """The network knows of the one that was killed for some more seconds."""
    queue = PoseQueue(lambda: 2)
    for number in (500, 501, 1, 2, 3):
        assert not queue.is_overtaken(number, 0)
    assert queue.take_lost() is None and not queue.is_shared
    assert not queue.is_overtaken(4, 0) and queue.take_lost() == 0


@pytest.mark.parametrize('every, off, told', [(1, 300_000, True), (10, 300_000, True),
                                              (10, 0, False)])
def test_few_answers_are_told_although_there_are_some(node, every, off, told):
    """Box a at 100 Hz, box b at 1/every of it; each 50th stamp of b fits, and the others are off.

    A slower box whose poses are all answered is told nothing.
    """
    counts, report = node
    for number in range(400):
        stamp = number * 10_000_000
        events = [('box_a', stamp)]
        if number % every == 0:
            events.append(('box_b', stamp + (off if number % 50 else 0)))
        for box, when in events:
            counts['poses'] += 1
            for _ in report.pairing.add(box, StampedPose((0, 0, 0, 0, 0, 0, 1), '', when)):
                report.answer()
        if number % 100 == 99:
            message = report(1.0)
    assert report.level == (b'\1' if told else b'\0')
    assert message == ('poses without a partner: stamps of box_a and box_b differ by 0.0003 s'
                       if told else 'answering')
    if told:
        line, = report.lines
        assert line.args[0].endswith('few could be answered; set tolerance:=0.006, or start with '
                                     'pairing:=latest')


@pytest.mark.parametrize('stamps, words', [
    ((0, 0), 'stamp 0 s does not advance; refused: set header.stamp'),
    ((1, 2, 2), 'stamp 2e-09 s has come before; refused: its tick is answered once; wait'),
    ((1, 2, 1), 'stamp 1e-09 s has come before')])
def test_who_sends_a_stamp_again_is_told_why(stamps, words):
    """A publisher that does not stamp may use `latest`; a client in lockstep may not."""
    pairing = StampPairing(SOLVER.scene, max_age=MAX_AGE)
    for stamp in stamps:
        pairing.add('box_a', StampedPose((0, 0, 0, 0, 0, 0, 1), '', stamp))
    (reason, rejection), = pairing.rejections.items()
    line = rejection.line(reason)
    assert words in line and ('latest' in line) == (len(stamps) == 2)
    shared = rejection.line(reason, publishers=2)
    assert (line == shared) == (len(stamps) == 2) and 'wait longer' not in shared


def test_a_scene_that_changes_has_no_pairs_without_an_answer(node):
    """A tick was answered before each change: pairs that are new count from the next report on."""
    counts, report = node
    pairs = watched_of(SOLVER.scene)
    report.monitor.restart(pairs)
    for _ in range(8):
        counts['poses'] += 10
        report.answer()
        report.monitor.watch(pairs)
        assert report(1.0) == 'answering'
    counts['poses'] += 10
    report(1.0)
    counts['poses'] += 10
    assert report(1.0) != 'answering'  # no tick since


def test_the_same_topic_in_another_namespace_is_named():
    """Of a box that nobody sends poses of, where the one is published and the other heard."""
    topics = object.__new__(SceneTopics)
    topics._node = Mock(get_publishers_info_by_topic=lambda topic: [], count_publishers=lambda _: 1)
    topics._node.get_topic_names_and_types.return_value = [
        ('/box_a/pose', []), ('/box_b/pose', []), ('/crane_1/box_a/pose', [])]
    topics._subscriptions = {box: Mock(topic_name=f'/{box}/pose', msg_type=PoseStamped)
                             for box in ('box_a', 'box_c')}
    assert topics.why_silent('box_c') == 'nobody publishes /box_c/pose'
    assert topics.why_silent('box_a') == (
        'nobody publishes /box_a/pose, but /crane_1/box_a/pose is published: remap the one to the '
        'other')

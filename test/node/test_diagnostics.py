# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a report says of a node that is busy, without DDS. Over DDS: test_first_run.py."""
from __future__ import annotations

from collections import Counter
from types import SimpleNamespace
from unittest.mock import Mock

import pytest

from box_contact_ros import SceneSolver
from box_contact_ros.node import diagnostics
from box_contact_ros.node.diagnostics import ACTIVE, Diagnostics, TickMonitor
from box_contact_ros.scene.pairing import OVERTAKEN, StampPairing
from box_contact_ros.scene.scene import two_boxes

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
    reporter = Diagnostics(node, counts, TickMonitor())
    pairing = StampPairing(SOLVER.scene, max_age=MAX_AGE)
    topics = Mock(why_silent=lambda box: f'nobody publishes {box}')

    def report(seconds, *checks):
        clock[0] += seconds
        reporter.report(ACTIVE, SOLVER.scene, 'exact', pairing, topics, 0, checks)
        status = node.create_publisher().publish.call_args.args[0].status[0]
        report.level, report.lines = status.level, node.get_logger().warning.call_args_list
        report.values = {entry.key: entry.value for entry in status.values}
        return status.message
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

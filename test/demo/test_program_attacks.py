# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Attacks on the clients of the contact node: requests and messages of strangers.

The page of `view` has attacks of its own: test_page_attacks.py.
"""
from __future__ import annotations

import math
import threading

import numpy as np
import pytest
from geometry_msgs.msg import PointStamped
from raw_client import LITTLE_ENDIAN, ORIGIN, cdr
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters, SetParametersAtomically
from ros_client import serving
from sensor_msgs.msg import PointCloud2
from stranger import ANSWER_SECONDS, Stranger

pytest.importorskip('mujoco')
pytest.importorskip('rosbags')

from box_contact_ros.scene.files.scene_file import parse_scene

from box_contact_ros.bench.bench_drive import BenchNode
from box_contact_ros.demo.crane_feedback import CraneFeedback
from box_contact_ros.demo.crane_node import CraneNode
from box_contact_ros.demo.crane_parameters import PARAMETERS, scenario_from
from box_contact_ros.node.messages import (
    MOST_ROWS,
    TypedMessages,
    make_cloud,
    make_header,
    read_cloud,
)
from box_contact_ros.node.ros_client import ANSWERS
from box_contact_ros.node.runtime import CONTACT_QOS
from box_contact_ros.scene.scene_solver import Answer, Pair, SceneSolver
from box_contact_ros.solver.contact import Contact
from box_contact_ros.view.listener import ViewNode
from box_contact_ros.view.markers import MarkersNode
from box_contact_ros.view.recording.record import RecordNode
from box_contact_ros.view.view_log import ViewLog

CLIENTS = {
    'markers': lambda context, folder: MarkersNode(context),
    'view': lambda context, folder: ViewNode(context, 'contact_node'),
    'record': lambda context, folder: RecordNode(
        context, folder / 'run', ['box_a/pose', 'box_b/pose', 'contact/point'], {}),
    'crane': lambda context, folder: CraneNode(context),
    'bench': lambda context, folder: BenchNode(context, {'echo': 'for_echo/'}),
}
FLOOD = 50
UNKNOWN_TYPE = 77
LONG = 'n' * 1_000_000


@pytest.fixture(params=CLIENTS)
def attacked(request, tmp_path):
    """Return a stranger and the node of a program, which is served in this process."""
    with serving(lambda context: CLIENTS[request.param](context, tmp_path)) as node:
        stranger = Stranger(node.get_name())
        yield stranger
        stranger.close()


def assert_answers(stranger):
    stranger.slowest = 0.0
    for _ in range(3):
        stranger.call(GetParameters, 'get_parameters', names=['use_sim_time'])
    assert stranger.slowest < ANSWER_SECONDS


def test_requests_that_rclpy_cannot_read(attacked):
    """Each is answered, without success; the client waited for ever."""
    bad = [Parameter(name='use_sim_time', value=ParameterValue(type=UNKNOWN_TYPE))]
    for _ in range(FLOOD):
        assert not attacked.call(SetParameters, 'set_parameters', parameters=bad).results
        assert not attacked.call(SetParametersAtomically, 'set_parameters_atomically',
                                 parameters=bad).result.successful
    assert_answers(attacked)


def answers():
    """Yield messages of contacts and points that no contact node sends."""
    contact = Contact(True, -0.1, np.full(3, math.inf), np.array([math.inf, 1e300, math.nan]),
                      math.inf, np.full((3, 3), -math.inf))
    messages = TypedMessages()
    for frame, pair in (('map', 'box_a_box_b'), (LONG, 'p'), ('map', LONG), ('', '')):
        messages.begin(5, frame)
        for answer in (Answer([(Pair(0, pair, 'a', 'b'), contact)], [], 1),
                       Answer([], [Pair(0, pair, 'a', 'b')], 0)):
            yield messages.contacts(answer)
            yield messages.cloud(answer)
        yield messages.point(contact)
    stale = Answer([], [Pair(n, f'p{n}', 'a', 'b') for n in range(MOST_ROWS + 1)], 0)
    yield messages.cloud(stale)
    yield messages.contacts(stale)
    yield PointCloud2(width=2**32 - 1, height=2**32 - 1, point_step=0)


def test_messages_of_strangers(attacked):
    """Poses and contacts that are none, with names of a megabyte and rows without end."""
    publishers = {kind: attacked.node.create_publisher(kind, topic, CONTACT_QOS)
                  for kind, topic in (ANSWERS['cloud'], (PointCloud2, 'contacts_cloud'),
                                      (PointStamped, 'contact/point'))}
    attacked.spin(lambda: False, 1.0)
    for _ in range(3):
        for message in answers():
            publishers[type(message)].publish(message)
            attacked.poll()
    for payload in (b'', LITTLE_ENDIAN, b'\xff' * 10_000, cdr([math.nan] * 7, (5, 7)),
                    cdr(ORIGIN, (5, 7), LONG.encode() + b'\0'), cdr(ORIGIN, (-5, 2**32 - 1))):
        for _ in range(FLOOD):
            attacked.send_raw(payload)
            attacked.poll()
    assert_answers(attacked)


def test_answers_to_nobody_are_not_kept():
    """The crane waits for answers to its own stamps; a stranger's queue would grow without end."""
    scenario = scenario_from({name: setting.default for name, setting in PARAMETERS.items()})
    feedback = CraneFeedback(scenario, 100.0, latency=0.0, lockstep=True, stop=threading.Event())
    feedback.ask(5)
    for stamp in range(1000):
        feedback.answer(stamp, np.zeros(14), stamp)
    assert feedback._arrived.qsize() == 1


@pytest.mark.parametrize('begins', [0, 1, 50])
@pytest.mark.parametrize('poses', [1, 200])
def test_a_pose_ahead_hides_nothing(begins, poses):
    """What markers and view draw is of the time of the other boxes; they drew nothing any more."""
    scene = parse_scene('{boxes: {a: {size: [2, 2, 2]}, b: {size: [2, 2, 2]}, '
                        'c: {size: [2, 2, 2]}}, pairs: [{a: a, b: b}, {a: b, b: c}]}')
    log, solver = ViewLog(scene), SceneSolver(scene, model='exact')
    touching = np.array([0.5, 0.25, 1.875, 0, 0, 0, 1])
    cloud = make_cloud(make_header(0, ''), solver([ORIGIN, touching, None]))
    for number in range(300):
        stamp = 10**18 + number * 10**7
        if begins <= number < begins + poses:
            log.pose('c', stamp + 3600 * 10**9, np.array(ORIGIN))
        log.pose('a', stamp, np.array(ORIGIN))
        log.pose('b', stamp, touching)
        log.contacts(stamp, read_cloud(cloud), stamp)
        snapshot = log.snapshot()
        if number:
            assert snapshot.stamp == stamp and snapshot.answer.stamp == stamp


def test_after_a_pause_all_is_drawn():
    """Of each box in turn the first pose is far ahead of all others."""
    scene = parse_scene('{boxes: {a: {size: [2, 2, 2]}, b: {size: [2, 2, 2]}, '
                        'c: {size: [2, 2, 2]}}, pairs: [{a: a, b: b}, {a: b, b: c}]}')
    log = ViewLog(scene)
    for stamp in (10**18, 2 * 10**18, 2 * 10**18 + 10**7):
        for box in 'abc':
            log.pose(box, stamp, np.array(ORIGIN))
    assert log.snapshot().stamp == 2 * 10**18 + 10**7
    for number in range(200):  # one goes on alone
        log.pose('a', 3 * 10**18 + number * 10**7, np.array(ORIGIN))
    assert log.snapshot().stamp == 3 * 10**18 + 199 * 10**7

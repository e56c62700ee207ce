# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The crane over DDS: it lands on the answers of a contact node in another process."""
from __future__ import annotations

import re
import signal
import time

import numpy as np
import pytest

pytest.importorskip('mujoco')

import rclpy
from rclpy.context import Context
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.serialization import serialize_message
from ros_client import arguments, overrides
from test_landing import HARD, landed

from box_contact_msgs.msg import Contact, Contacts
from box_contact_ros.demo import crane_node, landing
from box_contact_ros.demo.crane import CraneScenario
from box_contact_ros.demo.landing import Landing
from box_contact_ros.forces.patch_forces import GRAVITY
from box_contact_ros.node.messages import make_header

pytestmark = pytest.mark.reports


@pytest.fixture
def contact_node(program):
    running = program('contact_node', '--ros-args', '-p', 'model:=exact')
    running.wait_for_output('ready')
    return running


def test_it_lands(program, contact_node):
    """In lockstep: with the figures of a landing without ROS, and every stage was told."""
    crane = program('crane', *arguments(lockstep=True, rate=100, judge_force=True))
    assert crane.wait() == 0, crane.output
    assert 'PASS: the load is at rest, settled ' in crane.output
    assert str(landed(CraneScenario(), rate_hz=100.0, latency=0.0)) in crane.output
    assert ' contacts, none lost; latency p50 ' in crane.output
    assert 'not met' not in crane.output
    corners = re.search('corner loads  (.*) kN', crane.output)[1].split()
    assert sum(map(float, corners)) == pytest.approx(1e-3 * GRAVITY * CraneScenario().mass, abs=0.3)
    stages = [line.split(' s  ')[1][:12].strip() for line in crane.output.splitlines()
              if 'fastest corner' in line]
    assert stages == ['hanging', 'first touch', 'settling', 'at rest']


def test_a_load_that_falls_ends_with_status_1(program):
    """The contact node takes the stack for a cube of 1 m: the load tips off it."""
    program('contact_node', *arguments(size_b=[1.0, 1.0, 2.591])).wait_for_output('ready')
    crane = program('crane', *arguments(lockstep=True, rate=50))
    assert crane.wait() == 1, crane.output
    assert 'FAIL: the load did not come to rest on the stack' in crane.output


def test_a_load_that_sways_ends_with_status_1(program):
    """The paper's network lets the load sway on two corners; the force has no limit."""
    program('contact_node', *arguments(model='paper')).wait_for_output('ready')
    crane = program('crane', *arguments(lockstep=True))
    assert crane.wait() == 1, crane.output
    assert 'rest on the stack (not met: corner speed, static tilt)' in crane.output
    assert ' of the weight off it (not judged)\n' in crane.output


def test_without_a_contact_node_it_says_so(program):
    crane = program('crane', *arguments(wait=0.5))
    assert crane.wait() == 1
    assert 'error: no answer within 0.5 s on /contacts; is a contact_node running?' in crane.output


@pytest.mark.parametrize(('values', 'status', 'words'), [
    ({'rate': 'fast'}, 1, "error: rate must be a number, not 'fast'"),
    ({'lock_step': True, 'wait': 0.1}, 1, "unknown parameter 'lock_step' (did you mean lockstep")])
def test_bad_parameters_are_refused_by_name_and_value(program, values, status, words):
    """Unknown ones are named and ignored: a file may be meant for several nodes."""
    crane = program('crane', *arguments(**values))
    assert crane.wait() == status
    assert words in crane.output and 'Traceback' not in crane.output


# --- signals --------------------------------------------------------------------------------------


@pytest.mark.parametrize('number, state, lockstep', [
    (signal.SIGINT, 'alone', False), (signal.SIGTERM, 'answered', False),
    (signal.SIGINT, 'deserted', True)])
def test_a_signal_ends_it(program, number, state, lockstep):
    """While it waits for a node, moves, or waits for the answers of a node that stands still."""
    node = program('contact_node', '--ros-args', '-p', 'model:=exact') if state != 'alone' else None
    running = program('crane', *arguments(lockstep=lockstep, wait=60.0))
    if node is None:
        time.sleep(3.0)
    else:
        running.wait_for_output('hanging')
        if state == 'deserted':
            node.signal(signal.SIGSTOP)
            time.sleep(0.5)
    try:
        assert running.process.poll() is None, running.output
        running.process.send_signal(number)
        assert running.wait() == 128 + number
        assert 'Traceback' not in running.output, running.output
    finally:
        if node is not None:
            node.signal(signal.SIGCONT)


# --- answers --------------------------------------------------------------------------------------


@pytest.fixture
def crane(request):
    """Return a crane node in this process, in lockstep, with its executor; param: more values."""
    values = {'lockstep': True} | getattr(request, 'param', {})
    context = Context()
    rclpy.init(context=context)
    node = crane_node.CraneNode(context, HARD, parameter_overrides=overrides(**values))
    executor = EventsExecutor(context=context)
    executor.add_node(node)
    yield node, executor
    executor.shutdown()
    node.destroy_node()
    context.try_shutdown()


def answer_to(stamp, *, volume=0.03, stale=()):
    """Return the bytes of an answer, 1 mm deep on the whole bottom; NaN: a model without patch."""
    contact = Contact(pair='box_a_box_b', box_a='box_a', box_b='box_b', depth=1e-3, volume=volume,
                      covariance=[12.0, 0.0, 0.0, 0.5, 0.0, 1e-7])
    contact.point.z, contact.normal.z = 2.6, -1.0
    if np.isnan(volume):
        contact.covariance = [volume] * 6
    return serialize_message(Contacts(
        header=make_header(stamp, 'world'), stale=stale,
        contacts=[] if stale or volume == 0.0 else [contact]))


def test_answers_that_say_nothing_are_held_over(crane, capfd):
    """Stale pairs are no answer: the patch is still held. An answer without contacts is one.

    For contacts without a patch, the whole load stands, and the node warns of this once.
    """
    node, _ = crane
    pushes, lost = [], []
    for message in ({}, {'stale': ['box_a_box_b']}, {'volume': 0.0}, {'volume': np.nan}):
        stamp = node._publish(node.loop.ask())
        node._on_contacts(answer_to(stamp, **message))
        node._on_contacts(answer_to(stamp))  # came twice: nobody asked for it any more
        node.loop.step()
        pushes.append(node.loop.record.forces[-1][2])
        lost.append(node.lost)
    assert [push > 0.0 for push in pushes] == [True, True, False, True]
    for _ in range(2):
        node._on_contacts(answer_to(node._publish(node.loop.ask()), volume=np.nan))
    assert capfd.readouterr().err.count('without a patch: the whole load stands for it') == 1


def test_answers_to_nobody_are_not_kept(crane):
    """The crane takes answers to its own stamps; what is kept for a stranger would only grow."""
    node, _ = crane
    stamp = node._publish(node.loop.ask())
    for number in range(1000):
        node._on_contacts(answer_to(stamp + 1 + number))
    assert node.lost == 1 and not node.latencies and not node.loop._under_way


@pytest.mark.parametrize('crane', [{'paced': True}], indirect=True)
def test_paced_lockstep_is_never_faster_than_real_time(crane, monkeypatch):
    """Nor does it make up for the time of a late answer."""
    node, executor = crane
    monkeypatch.setattr(landing, 'DURATION', 0.5)
    publish, began, late, period = node._publish, [], 40, 1.0 / 200.0

    def publish_and_answer(state):
        began.append(time.perf_counter())
        stamp = publish(state)
        time.sleep(20 * period if state.tick == late else 0.0)
        node._on_contacts(answer_to(stamp, volume=0.0))
        return stamp

    monkeypatch.setattr(node, '_publish', publish_and_answer)
    node.lower(executor)
    assert len(began) == 100
    for ticks in (began[:late + 1], began[late + 1:]):
        assert ticks[-1] - ticks[0] >= (len(ticks) - 2) * period
    assert began[late + 1] - began[late] >= 20 * period


@pytest.mark.parametrize('crane', [{'wait': 0.01}], indirect=True)
def test_lockstep_ends_when_nobody_answers(crane):
    node, executor = crane
    with pytest.raises(TimeoutError, match='no answer within 0.01 s'):
        node.lower(executor)
    assert node.lost == 1


# --- the verdict ----------------------------------------------------------------------------------

AT_REST = {'settled': 1.234, 'corner_speed': 0.0, 'rope_tension': 0.0, 'force_worst': 0.0,
           'static_tilt': 0.0, 'depth': 0.001, 'gap': 0.0}


@pytest.mark.parametrize(('contacts', 'lost', 'figures', 'words'), [
    (7, 0, AT_REST, 'PASS: the load is at rest, settled 1.2 s after the first touch; 7 contacts, '
                    'none lost; latency p50 0.50 ms, p99 0.50 ms'),
    (7, 0, AT_REST | {'static_tilt': 1.0, 'force_worst': 1.0},
     'FAIL: the load did not come to rest on the stack (not met: force, static tilt)'),
    (7, 0, AT_REST | {'force_worst': 1.0, 'force_limit': np.inf}, 'PASS: the load is at rest'),
    (7, 3, AT_REST, 'FAIL: 3 lost answers'),
    (0, 0, {}, 'FAIL: no contacts came, the load did not come to rest on the stack')])
def test_the_verdict_is_one_line_with_its_reasons(contacts, lost, figures, words):
    passed, line = crane_node.verdict(Landing(**figures), [0.5e-3] * contacts, lost)
    assert line.startswith(words) and passed == line.startswith('PASS')

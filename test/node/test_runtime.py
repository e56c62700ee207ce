# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How a node is served and ends, and what its callbacks may raise: without DDS where possible."""
from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from functools import partial
from types import SimpleNamespace

import pytest
from geometry_msgs.msg import PoseStamped
from patience import PATIENCE
from raw_client import APART, ORIGIN, TOUCHING
from rcl_interfaces.srv import ListParameters
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from ros_client import Client, serving
from std_srvs.srv import Trigger

from box_contact_ros.node import contact_node, run_contact_node, runtime
from box_contact_ros.node.contact_node import ContactNode
from box_contact_ros.node.rclpy_workarounds import RCLError, shut_down, with_info
from box_contact_ros.stream.pairing import RESETS


@pytest.fixture(autouse=True)
def patient(monkeypatch):
    """Let no slow end of a node in this process end the tests with it."""
    monkeypatch.setattr(runtime, 'END_SECONDS', PATIENCE)


@pytest.fixture
def run(monkeypatch):
    """`run_node` with the test's own signal handlers, and its threads as they are."""
    monkeypatch.setattr(runtime, 'SignalHandlerOptions',
                        SimpleNamespace(ALL=SignalHandlerOptions.NO, NO=SignalHandlerOptions.NO))
    return lambda make_node: runtime.run_node(make_node, [], undisturbed=False)


class Short(Node):
    """Does something at once, then ends its context."""

    def __init__(self, context, action):
        super().__init__('short', context=context)
        self.action = action
        self.create_timer(0.01, self.at_once)

    def at_once(self):
        action, self.action = self.action, self.context.try_shutdown
        action()


def test_an_error_in_a_callback_ends_nothing(run, capfd):
    """It is logged; the node goes on until its context ends, with status 0."""
    def fail():
        raise KeyError('a request')

    assert run(lambda context: Short(context, fail)) == 0
    assert "a request failed: KeyError: 'a request'" in capfd.readouterr().err


def test_an_interrupt_is_a_clean_end(run, capfd):
    def interrupt():
        raise KeyboardInterrupt

    assert run(lambda context: Short(context, interrupt)) == 0
    assert run(lambda context: interrupt()) == 0
    assert 'Traceback' not in capfd.readouterr().err


HANGING = """
import ctypes
from rclpy.node import Node
from box_contact_ros.node import runtime

class Hanging(Node):
    def destroy_node(self):
        ctypes.PyDLL(None).sleep(60)  # with Python's lock

runtime.END_SECONDS = 0.2
with runtime.running_node(lambda context: Hanging('hanging', context=context)):
    pass
"""


def test_an_end_that_hangs_is_ended():
    """Although it has Python's lock; the traceback says where it hangs."""
    done = subprocess.run([sys.executable, '-c', HANGING], capture_output=True, text=True,
                          timeout=PATIENCE)
    assert done.returncode == 1 and 'destroy_node' in done.stderr


def test_a_home_that_cannot_be_written_to(tmp_path):
    """One line names the variable."""
    (tmp_path / 'file').touch()
    done = subprocess.run([sys.executable, '-m', 'box_contact_ros.node.run_contact_node'],
                          capture_output=True, text=True, timeout=PATIENCE,
                          env={**os.environ, 'ROS_LOG_DIR': str(tmp_path / 'file' / 'log')})
    assert done.returncode == 1 and 'Traceback' not in done.stderr
    assert 'set ROS_LOG_DIR to a folder that can be written to' in done.stderr


def test_a_node_that_cannot_start_says_why(run, capsys):
    """One line and status 1; nothing where a signal has ended the context."""
    def refuse(context, *, gone=False):
        if gone:
            context.try_shutdown()
        raise ValueError('size_a: -1 is not positive')

    assert run(refuse) == 1
    assert capsys.readouterr().err == 'error: size_a: -1 is not positive\n'
    assert run(lambda context: refuse(context, gone=True)) == 0
    assert not capsys.readouterr().err


EVENTS = """
import os
from pathlib import Path
from rclpy.node import Node
from box_contact_ros.node import runtime

with runtime.running_node(lambda context: Node('events', context=context)):
    runtime.keep_events_from_interrupting()
    for task in Path('/proc/self/task').iterdir():
        print((task / 'comm').read_text().strip(), os.sched_getscheduler(int(task.name)))
"""


def test_threads_for_events_alone_become_batch_threads():
    """Of a batch thread that receives poses, each pose waits beside whatever uses its core."""
    done = subprocess.run([sys.executable, '-c', EVENTS], capture_output=True, text=True,
                          timeout=PATIENCE)
    policies = [line.rsplit(' ', 1) for line in done.stdout.splitlines()]
    assert {int(policy) for name, policy in policies if name.startswith('dds.ev')} == {
        os.SCHED_BATCH}, done.stderr
    assert {int(policy) for name, policy in policies if not name.startswith('dds.ev')} == {
        os.SCHED_OTHER}
    assert {name[:7] for name, _ in policies} >= {'dds.udp', 'dds.shm'}


def test_where_threads_may_not_be_changed_they_stay(monkeypatch):
    """And nothing is raised."""
    def forbidden(path):
        raise PermissionError(path)

    monkeypatch.setattr(runtime.Path, 'iterdir', forbidden)
    runtime.keep_events_from_interrupting()


SIGNALLED = """
import signal, sys
from geometry_msgs.msg import PoseStamped
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from box_contact_ros.node import runtime

number, when = int(sys.argv[1]), sys.argv[2]
begin = runtime.rclpy.init

def begin_late(**options):
    signal.raise_signal(number)
    begin(**options)

if when == 'before':  # rclpy has its handlers
    runtime.rclpy.init = begin_late
try:
    with runtime.running_node(lambda context: Node('signalled', context=context), [],
                        signals=SignalHandlerOptions.ALL) as (node, executor):
        signal.raise_signal(number)
        signal.raise_signal(number)
        print('not here')
        runtime.spin(node, executor)
        node.create_publisher(PoseStamped, 'late', 1)
except (KeyboardInterrupt, ExternalShutdownException) as end:
    print(type(end).__name__)
signal.raise_signal(number)
"""


@pytest.mark.parametrize('number, when, words', [
    (signal.SIGINT, 'within', 'not here\nKeyboardInterrupt\n'),
    (signal.SIGTERM, 'within', 'not here\nExternalShutdownException\n'),
    (signal.SIGHUP, 'within', 'not here\nExternalShutdownException\n'),
    (signal.SIGINT, 'before', 'KeyboardInterrupt\n'),
    (signal.SIGTERM, 'before', 'ExternalShutdownException\n')])
def test_a_signal_falls_nowhere(number, when, words):
    """It shuts the context down, and what fails at that tells which signal it was."""
    done = subprocess.run([sys.executable, '-c', SIGNALLED, str(int(number)), when],
                          capture_output=True, text=True, timeout=PATIENCE)
    assert (done.returncode, done.stdout) == (0, words), done.stderr


def test_an_end_that_fails_goes_on(monkeypatch):
    """What an executor cannot let go of leaves neither the node nor the context behind."""
    def fail():
        raise RuntimeError('not now')

    kept = []
    monkeypatch.setattr(runtime, 'EventsExecutor', lambda context: SimpleNamespace(
        add_node=lambda _: None, shutdown=fail))
    monkeypatch.setattr(runtime, 'keep_for_ever', kept.append)
    with pytest.raises(RuntimeError, match='not now'), runtime.running_node(
            lambda context: Node('left', context=context), []) as (node, executor):
        context = node.context
    assert kept == [executor] and not context.ok()
    with pytest.raises(rclpy_implementation.InvalidHandle):
        node.get_name()


def test_two_threads_shut_a_context_down():
    """Whatever fails otherwise is raised."""
    def fail():
        raise RCLError('rcl_shutdown already called')

    shut_down(SimpleNamespace(try_shutdown=fail, ok=lambda: False))
    with pytest.raises(RCLError):
        shut_down(SimpleNamespace(try_shutdown=fail, ok=lambda: True))


# On a machine with one core, it would have one thread, and warn.
EXECUTORS = (SingleThreadedExecutor, partial(MultiThreadedExecutor, num_threads=2), EventsExecutor)


@pytest.mark.parametrize('executor_type', EXECUTORS)
def test_a_message_comes_with_its_time_and_number(executor_type):
    """By the wall clock; and the number that its publisher gave it."""
    client, came = Client(), []
    publisher = client.node.create_publisher(PoseStamped, 'pose', 10)

    def listen(context):
        node = Node('listener', context=context)
        node.create_subscription(
            PoseStamped, 'pose', with_info(lambda message, info: came.append((message, info))), 10)
        return node

    before = time.time_ns()
    with serving(listen, executor_type):
        assert client.spin(lambda: len(came) > 1 or publisher.publish(PoseStamped()))
    (message, first), (_, second) = came[:2]
    assert isinstance(message, PoseStamped)
    assert before < first['received_timestamp'] <= second['received_timestamp'] <= time.time_ns()
    assert second['publication_sequence_number'] == first['publication_sequence_number'] + 1
    client.close()


@pytest.mark.parametrize('executor_type', EXECUTORS)
def test_the_node_answers_in_every_executor(executor_type):
    """Topics and services alike."""
    client = Client()
    with serving(ContactNode, executor_type) as node:
        client.offer_until_answered(ORIGIN, APART)
        for _ in range(20):
            assert client.answer(ORIGIN, TOUCHING)
        assert client.call(Trigger, 'contact_node/reset', Trigger.Request()).success
        assert not any(name.startswith('refused') for name in node.counts)
    client.close()


def test_main_serves_its_node(monkeypatch):
    """With the arguments that it was given."""
    calls = []
    monkeypatch.setattr(contact_node, 'run_node', lambda *call: calls.append(call) or 0)
    assert run_contact_node.main(['--ros-args']) == 0
    (_, args), = calls
    assert args == ['--ros-args']


# --- GuardedNode ----------------------------------------------------------------------------------


class Failing(runtime.GuardedNode):
    """Raises in every callback."""

    def __init__(self, context):
        super().__init__('failing', context=context)
        self.failures = 0
        self.create_subscription(PoseStamped, 'pose', self.fail, 10)
        self.create_timer(0.01, self.fail)

    def fail(self, *_):
        self.failures += 1
        raise (ValueError if self.failures % 2 else KeyError)('planted')


def test_what_a_callback_raises_is_logged_and_the_node_goes_on(capfd):
    """Under the topic or the callback's name, each kind once a second; a service answers empty."""
    client = Client()
    publisher = client.node.create_publisher(PoseStamped, 'pose', 10)
    try:
        with serving(Failing) as node:
            assert client.spin(publisher.get_subscription_count)
            list_parameters = node.answered(lambda *_: node.fail(), 'list_parameters')
            assert not list_parameters(None, ListParameters.Response()).result.names
            for _ in range(10):
                publisher.publish(PoseStamped())
            assert client.spin(lambda: node.failures > 40)
    finally:
        client.close()
    lines = [line for line in capfd.readouterr().err.splitlines() if '; ignored' in line]
    assert 2 <= len(lines) < 20
    assert any('[WARN]' in line and line.endswith(': planted; ignored') for line in lines)
    assert any('[ERROR]' in line and line.endswith(": KeyError: 'planted'; ignored")
               for line in lines)
    assert all(re.search(r'\[failing\]: (list_parameters|pose|fail): ', line) for line in lines)


def test_a_clock_that_is_changed_begins_a_new_time(capfd):
    """`use_sim_time` set while the node runs; then the node is shut down."""
    client = Client()
    with serving(ContactNode) as node:
        node.set_parameters([Parameter('use_sim_time', value=True)])
        assert client.spin(lambda: node.counts[RESETS] == 1)
        assert 'use_sim_time was changed' in capfd.readouterr().err
        node.trigger_shutdown()
        assert client.spin(lambda: any(
            message.status[0].message == 'finalized: no pose is answered'
            for message in client.diagnostics))
    client.close()

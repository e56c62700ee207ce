# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How a node starts, is served and ends; its QoS events and its options: all in this process."""
from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections import Counter
from pathlib import Path
from threading import Event, Thread, get_native_id
from types import SimpleNamespace

import poses
import pytest
from rclpy.event_handler import UnsupportedEventTypeError
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from ros_client import Client, serving

from box_contact_ros.node import contact_node, contact_program, runtime
from box_contact_ros.node.contact_node import ContactNode
from box_contact_ros.node.parameters import answer_help
from box_contact_ros.node.rclpy_workarounds import RCLError, shut_down
from box_contact_ros.node.topics import scene_topics
from box_contact_ros.node.topics.qos_events import QosEvents
from box_contact_ros.scene.stamp_pairing import RESETS

CUBES = {'size_a': [2.0, 2.0, 2.0], 'size_b': [2.0, 2.0, 2.0], 'model': 'exact'}
TOUCHING = (0.5, 0.25, 1.875, 0, 0, 0, 1)


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
with runtime.joined(lambda context: Hanging('hanging', context=context)):
    pass
"""


def test_an_end_that_hangs_is_ended():
    """Although it has Python's lock; the traceback says where it hangs."""
    done = subprocess.run([sys.executable, '-c', HANGING], capture_output=True, text=True,
                          timeout=50)
    assert done.returncode == 1 and 'destroy_node' in done.stderr


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


def test_other_threads_become_batch_threads(monkeypatch):
    """All of the process but the caller's; where that is not permitted, none."""
    changed, done = {}, Event()
    monkeypatch.setattr(os, 'sched_setscheduler', lambda number, policy, _: changed.update(
        {number: policy}))
    other = Thread(target=done.wait)
    other.start()
    runtime.let_callbacks_finish()
    done.set()
    other.join()
    assert changed[other.native_id] == os.SCHED_BATCH and get_native_id() not in changed

    def forbidden(path):
        raise PermissionError(path)

    monkeypatch.setattr(os, 'listdir', forbidden)
    runtime.let_callbacks_finish()


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
    with runtime.joined(lambda context: Node('signalled', context=context), [],
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
    (signal.SIGINT, 'before', 'KeyboardInterrupt\n')])
def test_a_signal_falls_nowhere(number, when, words):
    """It shuts the context down, and what fails at that tells which signal it was."""
    done = subprocess.run([sys.executable, '-c', SIGNALLED, str(int(number)), when],
                          capture_output=True, text=True, timeout=50)
    assert (done.returncode, done.stdout) == (0, words), done.stderr


def test_an_interrupt_is_noted(monkeypatch):
    """What was there before comes back, if none was heard."""
    monkeypatch.setattr(runtime.atexit, 'register', lambda *_: None)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with runtime.interrupts_noted() as interrupted:
            assert not interrupted()
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
        with runtime.interrupts_noted() as interrupted:
            signal.raise_signal(signal.SIGINT)
            assert interrupted()
        signal.raise_signal(signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)


def test_an_end_that_fails_goes_on(monkeypatch):
    """What an executor cannot let go of leaves neither the node nor the context behind."""
    def fail():
        raise RuntimeError('not now')

    kept = []
    monkeypatch.setattr(runtime, 'make_executor', lambda _: SimpleNamespace(
        add_node=lambda _: None, shutdown=fail))
    monkeypatch.setattr(runtime, 'keep_for_ever', kept.append)
    with pytest.raises(RuntimeError, match='not now'), runtime.joined(
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


def test_handlers_of_other_threads_and_callers_stay():
    """Another thread may not set handlers; a handler of the caller's own is not replaced."""
    def own(*_):
        pass

    seen, before = [], signal.getsignal(signal.SIGINT)

    def look():
        with runtime.interrupts_noted():
            seen.append(signal.getsignal(signal.SIGINT))

    thread = Thread(target=look)
    thread.start()
    thread.join()
    try:
        signal.signal(signal.SIGINT, own)
        look()
    finally:
        signal.signal(signal.SIGINT, before)
    assert seen == [before, own]


def test_rclpy_without_events_executor(monkeypatch):
    """Older Jazzy has the default executor only; a node is answered from it all the same."""
    monkeypatch.setattr(runtime, 'EventsExecutor', None)
    client = Client()
    assert isinstance(client.executor, SingleThreadedExecutor)
    client.close()


def test_options_outside_ros_args_are_refused(capsys):
    """With status 2 and a hint; help lists all parameters with their defaults, with status 0."""
    for arguments, status in ((['--help'], 0), (['-p', 'rate:=1'], 2),
                              (['--ros-args', '-p', 'model:=exact', '--', '--fast'], 2)):
        with pytest.raises(SystemExit) as ended:
            contact_program.main(arguments)
        assert ended.value.code == status
    printed = capsys.readouterr()
    assert '--ros-args -p ' in printed.err
    assert 'unrecognized arguments: --fast' in printed.err
    for name in contact_program.PARAMETERS:
        assert f'\n  {name} ' in printed.out
    assert '[12.192,2.438,2.591]' in printed.out and 'default: none' in printed.out
    answer_help('contact_node', '', contact_program.PARAMETERS,
                ['--ros-args', '-p', 'pairing:=stamp'])


def test_a_word_that_ros_does_not_know_ends_the_program(capsys):
    """With one line and status 1: -p is easily forgotten."""
    assert contact_program.main(['--ros-args', 'model:=exact']) == 1
    assert capsys.readouterr().err == (
        "error: after --ros-args, ROS does not know ['model:=exact']: a parameter is "
        '-p NAME:=VALUE, a name is remapped by -r FROM:=TO\n')


@pytest.mark.parametrize('choice', ['', *runtime.USERS_CHOICES])
def test_settings_of_fast_dds_are_the_users_where_there_are_any(monkeypatch, tmp_path, choice):
    """A file of ours, to free messages that are read, would replace them."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(os, 'environ', {choice: 'of a user'} if choice else {})
    runtime.free_read_messages()
    if choice:
        assert os.environ == {choice: 'of a user'}
        return
    assert Path(os.environ.pop(runtime.PROFILES_FILE)).is_file()
    assert os.environ.pop(runtime.QOS_FROM_FILE) == '1' and not os.environ
    (tmp_path / runtime.USERS_FILE).touch()
    runtime.free_read_messages()
    assert not os.environ


QUEUED = """
import sys
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from box_contact_ros.node.runtime import POSE_QOS, give_back_memory, joined, spin_once

def resident():  # memory [MB]
    return int(open('/proc/self/statm').read().split()[1]) * 4096 / 2**20

with joined(lambda context: Node('queued', context=context), []) as (node, executor):
    read = []
    node.create_subscription(PoseStamped, 'pose', lambda data: read.append(len(data)), POSE_QOS,
                             raw=True)
    publisher = node.create_publisher(PoseStamped, 'pose', POSE_QOS)
    message = bytes(2**20)
    before = resident()
    for _ in range(60):
        publisher.publish(message)
    queued = resident() - before
    while executor and len(read) < 60:
        spin_once(node, executor, 1.0)
    give_back_memory()
    print(len(read), queued, resident() - before)
"""


@pytest.mark.skipif(not os.path.isdir('/proc/self'), reason='no /proc: not Linux')
@pytest.mark.parametrize('choice, kept', [({}, False), ({runtime.QOS_FROM_FILE: '0'}, True)])
def test_messages_that_are_read_are_freed(monkeypatch, choice, kept):
    """By default Fast DDS keeps the size of the largest message for each place in a queue."""
    for name in runtime.USERS_CHOICES:
        monkeypatch.delenv(name, raising=False)
    done = subprocess.run([sys.executable, '-c', QUEUED], env={**os.environ, **choice},
                          capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    read, queued, left = map(float, done.stdout.split())
    assert read == 60 and queued > 50.0 and (left > 50.0) is kept


def test_main_serves_its_node(monkeypatch):
    """With the arguments that it was given."""
    seen = []
    monkeypatch.setattr(runtime, 'run_node', lambda *call: seen.append(call) or 0)
    assert contact_program.main(['--ros-args']) == 0
    (kind, args), = seen
    assert issubclass(kind, ContactNode) and args == ['--ros-args']


# --- QoS events -----------------------------------------------------------------------------------


def test_events_are_counted_and_told():
    """Liveliness counts what is lost, not what is back; deadlines and losses count each."""
    told: list[str] = []
    logger = SimpleNamespace(warning=lambda text, **_: told.append(text), info=told.append)
    counts: Counter[str] = Counter()
    callbacks = QosEvents(SimpleNamespace(get_logger=lambda: logger), counts).callbacks(
        'load', deadline=True)
    for lost in (1, -1, 0):
        callbacks.liveliness(SimpleNamespace(not_alive_count_change=lost))
    callbacks.deadline(SimpleNamespace(total_count_change=2))
    callbacks.message_lost(SimpleNamespace(total_count_change=3))
    assert counts == {'liveliness lost': 1, 'deadlines missed': 2, 'lost in transport': 3}
    assert told == ['load: a publisher of its poses shows no life',
                    'load: no pose within the deadline']
    assert QosEvents(SimpleNamespace(), counts).callbacks('load', deadline=False).deadline is None


@pytest.fixture
def client():
    client = Client()
    yield client
    client.close()


class WithoutEvents(ContactNode):
    """On a middleware that has no such events."""

    def create_subscription(self, *arguments, event_callbacks=None, **options):
        if event_callbacks is not None:
            raise UnsupportedEventTypeError('no events here')
        return super().create_subscription(*arguments, **options)


def test_a_middleware_without_events_is_answered(client):
    """A node without them subscribes without them."""
    with serving(lambda context: WithoutEvents(context, parameter_overrides=[
            Parameter(name, value=value) for name, value in CUBES.items()])):
        client.offer_until_answered(poses.IDENTITY, TOUCHING)


def test_a_node_without_the_messages_of_contacts(monkeypatch, capfd):
    """The log tells where contacts are instead, as `ros2 topic echo /contacts` would wait."""
    for module in (contact_node, scene_topics):
        monkeypatch.setattr(module, 'ContactsMessage', None)
    with serving(lambda context: ContactNode(context, parameter_overrides=[
            Parameter(name, value=value) for name, value in CUBES.items()])) as node:
        assert 'contacts are published as contacts_cloud alone' in capfd.readouterr().err
        topics = {publisher.topic_name for publisher in node.publishers}
        assert '/contacts_cloud' in topics and '/contacts' not in topics


def test_a_node_is_told_of_its_clock_and_of_names_that_are_none(client, capfd):
    """A misspelt parameter is named at the start, a clock that changes is counted; then it ends."""
    given = CUBES | {'modle': 'mlp', 'autostart': True}
    with serving(lambda context: ContactNode(context, parameter_overrides=[
            Parameter(name, value=value) for name, value in given.items()])) as node:
        assert "unknown parameter 'modle'" in (told := capfd.readouterr().err)
        assert 'did you mean model?' in told
        result, = node.set_parameters([Parameter('pair_topics', value='yes')])
        assert result.reason == "pair_topics must be true or false, not 'yes'"
        node.set_parameters([Parameter('use_sim_time', value=True)])
        assert client.spin(lambda: node.counts[RESETS] == 1)
        assert 'use_sim_time was changed' in capfd.readouterr().err
        node.trigger_shutdown()
        assert not any('pose' in entity.topic_name for entity in node.subscriptions)

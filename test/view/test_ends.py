# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""SIGINT and SIGTERM end view and record soon, whatever they are doing."""
from __future__ import annotations

import os
import signal
import socket
import threading
import time
from pathlib import Path

import pytest

pytest.importorskip('viser')
pytest.importorskip('mujoco')
pytest.importorskip('rosbags')

from children import children

from box_contact_ros.view import view
from box_contact_ros.view.recording import bag_player

pytestmark = pytest.mark.usefixtures('signal_handlers')

END_SECONDS = 2.0
BOTH = pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])


def ends_soon(running, number):
    """Ask a program to end, and return how long that took [s]."""
    start = time.monotonic()
    running.process.send_signal(number)
    running.wait(60)
    took = time.monotonic() - start
    assert 'Traceback' not in running.output, running.output
    return took


@BOTH
def test_view_while_it_reads_a_recording(monkeypatch, number):
    """The main thread reads: a flag alone would be looked at after the last message."""
    class Slow:
        def __init__(self, path):
            threading.Timer(0.2, os.kill, (os.getpid(), number)).start()
            time.sleep(60.0)

    monkeypatch.setattr(bag_player, 'BagPlayer', Slow)
    start = time.monotonic()
    status = view.main(['--replay', 'run'])
    assert time.monotonic() - start < END_SECONDS
    assert status == (0 if number == signal.SIGINT else 143)


@BOTH
def test_view_whose_node_and_clients_stand_still(program, number):
    running = program('view', '--no-browser', '--port', '8600', '--domain',
                      os.environ['ROS_DOMAIN_ID'], '--model', 'exact')
    url = running.wait_for_output('Ctrl-C').partition('http://')[2].partition(' ')[0]
    deadline = time.monotonic() + 60.0
    while len(started := children(running.process.pid)) < 2:
        assert time.monotonic() < deadline
        time.sleep(0.1)
    host, port = url.rsplit(':', 1)
    with socket.create_connection((host, int(port))):
        for pid in started:
            os.kill(pid, signal.SIGSTOP)
        assert ends_soon(running, number) < END_SECONDS
    assert not [pid for pid in started if Path(f'/proc/{pid}').exists()]


@BOTH
def test_view_asked_again_and_again(program, number):
    """The last of many signals fell on the interpreter's end, and gave a status of its own."""
    running = program('view', '--no-browser', '--port', '8601', '--domain',
                      os.environ['ROS_DOMAIN_ID'], '--model', 'exact')
    running.wait_for_output('Ctrl-C')
    while running.process.poll() is None:
        running.process.send_signal(number)
        time.sleep(0.0005)
    assert running.wait() == (0 if number == signal.SIGINT else 143), running.output


@BOTH
@pytest.mark.parametrize('heard', [False, True])
def test_record(program, tmp_path, number, heard):
    """While nothing comes, and while everything does."""
    running = program('record', '--out', str(tmp_path / 'run'))
    running.wait_for_output('recording to')
    if heard:
        program('contact_node', '--ros-args', '-p', 'model:=exact')
        program('crane', '--ros-args', '-p', 'rate:=1000.0', '-p', 'wait:=60.0')
        running.wait_for_output('receiving /contact')
    assert ends_soon(running, number) < END_SECONDS
    assert f'recorded {tmp_path / "run"}' in running.output

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Being asked to end: a flag, whenever the signal comes; and children that do not listen."""
from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from box_contact_ros.node import processes

pytestmark = pytest.mark.usefixtures('signal_handlers')

STORM = """
import os, signal, threading, time
from box_contact_ros.node.processes import asked_to_end

end = time.monotonic() + 2.0


def storm():
    while time.monotonic() < end:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(1e-4)


came = 0
with asked_to_end() as stop:
    threading.Thread(target=storm, daemon=True).start()
    while time.monotonic() < end + 0.5:
        came += stop.wait(0.0005)
        stop.signals.clear()
print(came)
"""


def test_signals_at_any_moment_do_not_hang():
    """A flag with a lock waits for itself here, within seconds."""
    done = subprocess.run([sys.executable, '-c', STORM], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 100


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_the_wait_and_says_the_status(number):
    with processes.asked_to_end() as stop:
        assert not stop.is_set() and stop.status == 0 and not stop.wait(0.0)
        threading.Timer(0.1, os.kill, (os.getpid(), number)).start()
        began = time.monotonic()
        assert stop.wait(20.0) and stop.is_set()
        assert time.monotonic() - began < 10.0
        assert stop.status == 128 + number
    os.kill(os.getpid(), number)  # once more, while the process ends
    assert len(stop.signals) == 2


def test_without_a_signal_the_handlers_come_back():
    before = signal.getsignal(signal.SIGINT)
    with processes.asked_to_end():
        assert signal.getsignal(signal.SIGINT) != before
    assert signal.getsignal(signal.SIGINT) == before


def test_a_child_that_does_not_listen_is_killed(monkeypatch):
    monkeypatch.setattr(processes, 'END_PATIENCE', 0.2)
    child = subprocess.Popen(
        [sys.executable, '-c', 'import signal, time\n'
                               'signal.signal(signal.SIGTERM, signal.SIG_IGN)\n'
                               'print("here", flush=True)\n'
                               'time.sleep(100)'],
        stdout=subprocess.PIPE, start_new_session=True)
    assert child.stdout.readline() == b'here\n'
    processes.end([child])
    assert child.returncode == -signal.SIGKILL
    child.stdout.close()

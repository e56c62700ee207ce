# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Being asked to end, children that do not listen, and the ROS domain of what is started."""
from __future__ import annotations

import os
import signal
import socket
import time
from pathlib import Path

import pytest
from conftest import claim

from box_contact_ros import processes

pytestmark = pytest.mark.usefixtures('signal_handlers')


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signals_are_noted_and_raise_nothing(number):
    with processes.asked_to_end() as signals:
        assert signals == []
        signal.raise_signal(number)
        assert signals == [number]
    signal.raise_signal(number)  # once more, while the process ends
    assert signals == [number, number]


def test_without_a_signal_the_handlers_come_back():
    before = signal.getsignal(signal.SIGINT)
    with processes.asked_to_end():
        assert signal.getsignal(signal.SIGINT) != before
    assert signal.getsignal(signal.SIGINT) == before


def test_a_child_that_does_not_listen_is_killed(monkeypatch, tmp_path):
    monkeypatch.setattr(processes, 'END_PATIENCE', 0.2)
    here = tmp_path / 'here'
    with processes.running(['-c', 'import pathlib, signal, time\n'
                                  'signal.signal(signal.SIGTERM, signal.SIG_IGN)\n'
                                  f'pathlib.Path({str(here)!r}).touch()\n'
                                  'time.sleep(100)']) as child:
        while not here.exists():
            time.sleep(0.01)
    assert child.returncode == -signal.SIGKILL


@pytest.mark.parametrize('given', [None, '7'])
def test_a_domain_of_its_own(given, monkeypatch):
    """Drawn at random, unless the user says which."""
    monkeypatch.setattr(os, 'environ', {} if given is None else {'ROS_DOMAIN_ID': given})
    domain = processes.keep_to_this_host()
    assert domain == given or given is None and int(domain) in processes.DOMAINS
    assert os.environ == {'ROS_DOMAIN_ID': domain, 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}


@pytest.mark.skipif(not Path('/dev/shm').exists(), reason='Linux alone has it')
@pytest.mark.parametrize('alive', [False, True])
def test_a_domain_of_tests_has_nothing_of_the_dead(alive):
    """A participant that was killed leaves files, in which a later one may wait for it."""
    domain, number = 231, 65349  # of no other test
    left = Path(f'/dev/shm/fastrtps_port{number}')
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as port:
        port.bind(('', number if alive else 0))
        left.touch()
        try:
            assert claim(domain) is not alive
            assert left.exists() is alive
        finally:
            left.unlink(missing_ok=True)

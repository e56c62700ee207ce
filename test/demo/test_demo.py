# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The demonstration: what it refuses, and that it ends both of its processes; see `make demo`."""
from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip('mujoco')

from children import children

from box_contact_ros.demo import demo


def test_an_unknown_model_ends_the_demo_before_it_starts(capsys):
    with pytest.raises(SystemExit, match='2'):
        demo.main(['--model', 'exakt'])
    assert 'did you mean exact?' in capsys.readouterr().err


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_demo_and_both_processes(number):
    """In the middle of the motion; the status is what a shell reports."""
    command = [sys.executable, '-m', 'box_contact_ros.demo.demo', '--model', 'exact',
               '--domain', os.environ['ROS_DOMAIN_ID']]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                          start_new_session=True) as running:
        try:
            told = ''
            for line in running.stdout:
                told += line
                if 'hanging' in line:
                    break
            started = children(running.pid)
            assert len(started) == 2, told
            running.send_signal(number)
            told += running.communicate(timeout=60)[0]
        finally:
            if running.poll() is None:
                running.kill()
    assert running.returncode == 128 + number and 'Traceback' not in told, told
    assert not [pid for pid in started if Path(f'/proc/{pid}').exists()]


@pytest.mark.parametrize(('status', 'words'), [(0, 'Next, after'), (3, 'failed with status 3')])
def test_its_status_is_that_of_the_crane(status, words, monkeypatch, capfd):
    """And a failure shows what the contact node printed."""
    programs = {'node.contact_node': 'print("node", flush=True); import time; time.sleep(100)',
                'demo.crane_node': f'import sys, time; time.sleep(2.0); sys.exit({status})'}
    monkeypatch.setattr(demo, 'program', lambda name, **_: ['-c', programs[name]])
    assert demo.main(['--domain', os.environ['ROS_DOMAIN_ID']]) == status
    shown = capfd.readouterr()
    assert words in shown.out + shown.err
    assert ('contact_node printed:\nnode' in shown.err) is bool(status)


def test_an_early_end_of_the_node_ends_the_demo(monkeypatch, capfd):
    programs = {'node.contact_node': 'import sys; sys.exit("no room")',
                'demo.crane_node': 'import time; time.sleep(100)'}
    monkeypatch.setattr(demo, 'program', lambda name, **_: ['-c', programs[name]])
    assert demo.main(['--domain', os.environ['ROS_DOMAIN_ID']]) == 1
    error = capfd.readouterr().err
    assert 'contact_node ended early, status 1' in error and 'no room' in error

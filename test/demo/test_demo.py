# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The demonstration: what it refuses, and that it ends its processes; see `make demo`."""
from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest
from patience import PATIENCE

pytest.importorskip('mujoco')

from children import children

from box_contact_ros.demo import demo

pytestmark = pytest.mark.reports


def test_an_unknown_model_ends_the_demo_before_it_starts(capsys):
    with pytest.raises(SystemExit, match='2'):
        demo.main(['--model', 'exakt'])
    assert 'did you mean exact?' in capsys.readouterr().err


@pytest.mark.parametrize('number, stopped', [(signal.SIGINT, False), (signal.SIGTERM, True)])
def test_a_signal_ends_the_demo_and_all_processes(number, stopped):
    """Also where they stand still, and whoever asks asks again and again."""
    with started_demo() as (running, output):
        started = children(running.pid)
        assert len(started) == 2, output
        for pid in started if stopped else ():
            os.kill(pid, signal.SIGSTOP)
        while running.poll() is None:
            running.send_signal(number)
            time.sleep(0.001)
        output += running.stdout.read()
    assert running.returncode == 128 + number and 'Traceback' not in output, output
    assert not [pid for pid in started if Path(f'/proc/{pid}').exists()]


@pytest.mark.skipif(not os.path.exists('/proc'), reason='Linux alone ends them with their parent')
def test_no_process_outlives_a_demo_that_is_killed():
    with started_demo() as (running, _):
        started = children(running.pid)
        running.kill()
        deadline = time.monotonic() + PATIENCE
        while alive := [pid for pid in started if is_running(pid)]:
            assert time.monotonic() < deadline, alive
            time.sleep(0.1)


@contextmanager
def started_demo():
    """Run a demo until the load moves; yield its process and what it printed."""
    with subprocess.Popen([sys.executable, '-m', 'box_contact_ros.demo.demo'],
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                          start_new_session=True) as running:
        try:
            output = ''
            while 'hanging' not in output and (line := running.stdout.readline()):
                output += line
            yield running, output
        finally:
            running.kill()


def is_running(pid):
    """Return whether a process is there, and no zombie that nobody waits for."""
    try:
        return Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()[0] != 'Z'
    except (FileNotFoundError, ProcessLookupError):
        return False


@pytest.fixture
def programs(monkeypatch, signal_handlers):
    """Return what stands for the programs: Python code by module, with `values` for parameters."""
    codes = {'node.run_contact_node': 'import time; time.sleep(1000)'}
    monkeypatch.setattr(
        demo, 'program', lambda name, **values: ['-c', f'values = {values}\n{codes[name]}'])
    return codes


@pytest.mark.parametrize('status', [0, 3])
def test_its_status_is_that_of_the_crane(status, programs, capfd):
    programs['demo.run_crane'] = f'import sys, time; time.sleep(1.0); sys.exit({status})'
    assert demo.main([]) == status
    assert ('Next: ' in capfd.readouterr().out) is (status == 0)


@pytest.mark.parametrize(('arguments', 'waits', 'judges'), [
    ([], True, True), (['--real-time'], False, True), (['--model', 'mlp'], True, False)])
def test_the_crane_waits_and_judges_as_it_is_told(arguments, waits, judges, programs, capfd):
    """Time waits unless it is real; the force must equal the weight by model exact alone."""
    programs['demo.run_crane'] = 'print(values)'
    assert demo.main(arguments) == 0
    assert str({'lockstep': waits, 'paced': waits, 'judge_force': judges}) in capfd.readouterr().out


def test_a_view_that_is_ended_as_a_landing_ends_names_nothing_next(programs, monkeypatch, capfd):
    """Its status is that of the signal, as in the middle of a landing."""
    monkeypatch.setattr(demo, 'LOOK_PERIOD', 1.0)
    programs |= {'view.view': 'import time; time.sleep(1000)', 'demo.run_crane': (
        'import os, signal; print("PASS"); os.kill(os.getppid(), signal.SIGINT)')}
    assert demo.main(['--view']) == 130
    output = capfd.readouterr().out
    assert 'PASS' in output and 'Next: ' not in output


def test_an_early_end_of_the_node_ends_the_demo(programs, capfd):
    """In the node's own words."""
    programs |= {'node.run_contact_node': 'import sys; sys.exit("no room")',
                 'demo.run_crane': 'import time; time.sleep(1000)'}
    assert demo.main([]) == 1
    error = capfd.readouterr().err
    assert 'no room' in error and 'demo: contact_node ended early, status 1' in error


def test_with_a_view_it_lands_until_something_ends(programs, monkeypatch, capfd):
    monkeypatch.setattr(demo, 'PAUSE', 0.0)
    programs |= {'view.view': 'import time; time.sleep(5.0)', 'demo.run_crane': 'print("PASS")'}
    assert demo.main(['--view']) == 1
    shown = capfd.readouterr()
    assert shown.out.count('PASS') > 1 and 'view ended early, status 0' in shown.err

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the pages type with ROS's own `ros2`, in a workspace: skipped where it is not installed."""
from __future__ import annotations

import importlib.util
import os
import re
import shlex
import shutil
import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from conftest import RunningProgram
from patience import PATIENCE

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = 'box_contact_ros'
LAUNCH_FILES = ('contact_node.launch.py', 'crane.launch.py')
Start = Callable[..., RunningProgram]


def run(*words: str) -> subprocess.CompletedProcess[str]:
    """Run `ros2` to its end."""
    return subprocess.run(['ros2', *words], text=True, timeout=PATIENCE, stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT)


@pytest.fixture(scope='module', autouse=True)
def in_a_workspace() -> Iterator[None]:
    if not shutil.which('ros2'):
        pytest.skip('ros2 is not installed')
    if run('pkg', 'prefix', PACKAGE).returncode:
        pytest.skip('the package is in no workspace')
    yield
    run('daemon', 'stop')  # of this module's domain


@pytest.fixture
def ros2(tmp_path: Path) -> Iterator[Start]:
    """Start `ros2`, which is ended with the test."""
    started: list[RunningProgram] = []

    def start(*words: str) -> RunningProgram:
        log = tmp_path / f'ros2_{len(started)}.log'
        with log.open('wb') as out:
            started.append(RunningProgram(subprocess.Popen(
                ['ros2', *words], stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT,
                start_new_session=True, env={**os.environ, 'PYTHONUNBUFFERED': '1'}), log))
        return started[-1]

    yield start
    for running in reversed(started):
        running.end()


def typed(page: str, verb: str) -> Iterator[list[str]]:
    """Yield the words after `ros2` of a page's lines that begin with `ros2 VERB`."""
    for line in re.findall(rf'^ros2 ({verb} .*)$', (ROOT / page).read_text('utf-8'), re.M):
        yield shlex.split(line)


def test_the_lines_of_the_pages(ros2: Start) -> None:
    """The terminals of install.md, a parameter, and the lifecycle."""
    ros2('run', PACKAGE, 'contact_node', '--ros-args', '-p', 'pairing:=latest').wait_for_output(
        'ready')
    *_, echo = [ros2(*words) for words in typed('docs/install.md', 'topic')]
    assert 'depth: 0.0100' in echo.wait_for_output('covariance')
    assert 'success=True' in run('service', 'call', '/contact_node/reset',
                                 'std_srvs/srv/Trigger').stdout
    setting, = typed('docs/reference/parameters.md', 'param')
    assert 'Set parameter successful' in run(*setting).stdout
    assert 'not one of' in run(*setting[:-1], 'none').stdout
    for transition in ('deactivate', 'cleanup', 'configure', 'activate'):
        done = run('lifecycle', 'set', '/contact_node', transition)
        assert 'Transitioning successful' in done.stdout


def test_the_questions_about_the_yard(ros2: Start) -> None:
    ros2('run', PACKAGE, 'contact_node', '--ros-args', '-p',
         f'scene:={ROOT}/config/scenes/yard_bay.yaml').wait_for_output('ready')
    questions = list(typed('docs/tutorials/yard.md', 'service'))
    assert len(questions) == 2
    for question in questions:
        assert "success=True, message='', contacts=" in run(*question).stdout


@pytest.mark.parametrize('file', LAUNCH_FILES)
def test_launch_files_show_their_arguments(file: str) -> None:
    done = run('launch', PACKAGE, file, '--show-args')
    assert done.returncode == 0 and "'params_file'" in done.stdout, done.stdout


def test_launch_of_a_contact_node(ros2: Start) -> None:
    """It takes the arguments, and ends cleanly with Ctrl-C."""
    launched = ros2('launch', PACKAGE, LAUNCH_FILES[0], 'namespace:=/yard', 'model:=mlp',
                    'use_respawn:=True', f'scene:={ROOT}/config/scenes/yard_bay.yaml')
    assert "ready: model 'mlp'" in launched.wait_for_output('/yard/crane/load/pose')
    launched.signal(signal.SIGINT)
    assert launched.wait() == 0 and 'process has finished cleanly' in launched.output


def test_launch_of_a_crane(ros2: Start) -> None:
    """It lands, and ends the node with it; without MuJoCo, one line names what is missing."""
    launched = ros2('launch', PACKAGE, LAUNCH_FILES[1], 'lockstep:=true', 'rate:=100')
    status = launched.wait()
    if importlib.util.find_spec('mujoco'):
        assert status == 0 and 'at rest' in launched.output
    else:
        assert status == 1 and "module 'mujoco' is not installed" in launched.output
        assert 'process started' not in launched.output and 'Traceback' not in launched.output

"""What all tests share: a ROS domain of their own, and programs as processes.

The environment is set while this file is imported: before any test module imports rclpy, which
reads it once, and so that every process that a test starts inherits it.
"""

from __future__ import annotations

import os
import runpy
import signal
import subprocess
import sys
import time
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest


def _domain_id(module: str = '') -> int:
    # Two runs at once must not hear each other, nor two workers of a run. 1 to 101: 0 is where
    # everybody's real nodes are, and above 101 ports collide with the ephemeral ones of Linux.
    run = os.environ.get('PYTEST_XDIST_TESTRUNUID', str(os.getpid()))
    worker = int(os.environ.get('PYTEST_XDIST_WORKER', 'gw0').removeprefix('gw'))
    return 1 + (zlib.crc32(run.encode()) + worker + zlib.crc32(module.encode())) % 101


os.environ['ROS_DOMAIN_ID'] = str(_domain_id())
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
# Without it rclpy publishes np.float32 or an int in a float field as garbage, silently.
os.environ['ROS_PYTHON_CHECK_FIELDS'] = '1'


LONGEST_FIRST = (
    'test_core_cpp.py', 'test_faults.py', 'test_contact_node.py', 'test_scene_node.py',
    'test_bench.py', 'test_landing_ros.py', 'test_msg_schemas.py', 'test_install.py',
    'test_two_hosts.py', 'test_core.py', 'test_series.py', 'test_exact.py', 'test_hygiene_ros.py',
    'test_training_mlp.py', 'test_search.py', 'test_record.py', 'test_view.py', 'test_landing.py',
    'test_crane.py', 'test_soup_node.py', 'test_readme.py', 'test_frontier.py', 'test_soak.py',
    'test_markers.py', 'test_training.py', 'test_ament.py')
"""Files that take more than ten seconds. Begun late, one would leave the other workers idle."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the longest files first."""
    rank = {name: number for number, name in enumerate(LONGEST_FIRST)}
    items.sort(key=lambda item: rank.get(item.path.name, len(rank)))


@pytest.fixture(scope='module', autouse=True)
def own_domain(request: pytest.FixtureRequest) -> None:
    """A ROS domain for each module.

    Processes that were killed leave shared memory of theirs behind, in which later ones may wait
    for the dead.
    """
    os.environ['ROS_DOMAIN_ID'] = str(_domain_id(request.module.__name__))


@pytest.fixture
def setup_arguments(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What setup.py hands to setuptools."""
    given: dict[str, Any] = {}
    with monkeypatch.context() as patch:
        patch.setattr('setuptools.setup', given.update)
        patch.chdir(Path(__file__).resolve().parents[1])
        runpy.run_path('setup.py')
    return given


@dataclass
class RunningProgram:
    """A program of this package, started as a process group of its own."""

    process: subprocess.Popen[bytes]
    log: Path

    @property
    def output(self) -> str:
        """Everything the program wrote so far, stdout and stderr together."""
        return self.log.read_text(errors='replace')

    def wait(self, timeout: float = 60.0) -> int:
        """Wait for the program to end by itself and return its exit status."""
        try:
            return self.process.wait(timeout)
        except subprocess.TimeoutExpired:
            pytest.fail(f'{self} did not end within {timeout} s; it wrote:\n{self.output}')

    def wait_for_output(self, text: str, timeout: float = 60.0) -> str:
        """Wait until `text` has been written; return the output."""
        deadline = time.monotonic() + timeout
        while time.monotonic() < deadline:
            ended = self.process.poll() is not None  # before reading: nothing comes after it
            if text in (output := self.output):
                return output
            if ended:
                break
            time.sleep(0.02)
        pytest.fail(f'{self} did not write {text!r}; it wrote:\n{self.output}')

    def signal(self, number: int) -> None:
        """Send a signal to the whole process group, if any of it is left."""
        try:
            os.killpg(self.process.pid, number)
        except ProcessLookupError:
            pass

    def end(self) -> None:
        """End the program and everything it started: politely, then for certain."""
        for number, seconds in ((signal.SIGINT, 5.0), (signal.SIGTERM, 2.0)):
            if self.process.poll() is None:
                self.signal(number)
                try:
                    self.process.wait(seconds)
                except subprocess.TimeoutExpired:
                    continue
        # Also after the leader is gone: a child it left behind is still in its group.
        self.signal(signal.SIGKILL)
        self.process.wait()

    def __str__(self) -> str:
        return ' '.join(map(str, self.process.args))


@pytest.fixture
def program(tmp_path: Path) -> Iterator[Callable[..., RunningProgram]]:
    """Start `python -m box_contact_ros PROGRAM ...`; it is ended with the test, however that ends.

    `program('crane', '--ros-args', '-p', 'rate:=200.0', env={...})`: `env` is added to this
    process's environment, `within` stands before the command, such as `ip netns exec NAME`.
    """
    started: list[RunningProgram] = []

    def start(*args: str, env: dict[str, str] | None = None,
              within: Sequence[str] = ()) -> RunningProgram:
        log = tmp_path / f'program_{len(started)}.log'
        with log.open('wb') as out:
            process = subprocess.Popen(
                [*within, sys.executable, '-u', '-m', 'box_contact_ros', *args],
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                env={**os.environ, **(env or {})},
            )
        started.append(RunningProgram(process, log))
        return started[-1]

    yield start
    for running in reversed(started):
        running.end()

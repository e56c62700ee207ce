# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What all tests share: the installed package, a ROS domain of their own, programs as processes.

This file sets the environment while it is imported: rclpy reads the environment once, when the
first test module imports it. Every process that a test starts inherits it.
"""

from __future__ import annotations

import ast
import importlib.util
import os
import re
import runpy
import signal
import socket
import subprocess
import sys
import time
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from patience import PATIENCE

try:
    from hypothesis import HealthCheck, settings
except ModuleNotFoundError:  # an extra; tests that need it are skipped
    pass
else:  # a busy machine is no failure
    settings.register_profile('patient', deadline=None,
                              suppress_health_check=[HealthCheck.too_slow])
    settings.load_profile('patient')
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:  # as in `nohup make test &`
    signal.signal(signal.SIGINT, signal.default_int_handler)

APART = {'arm', 'builds', 'network', 'reports', 'training'}
"""Markers of tests that have a make target of their own."""

_modules = count()
_claims: list[int] = []
"""The open socket whose name claims this module's domain, as other runs on this host can see."""


def _domain_id() -> int:
    # Two runs at once must not hear each other, nor two workers of a run, nor two modules.
    # From 1, as everybody's real nodes are in 0; to 101, as ports of more are Linux's ephemeral.
    run = os.environ.get('PYTEST_XDIST_TESTRUNUID', str(os.getpid()))
    worker = int(os.environ.get('PYTEST_XDIST_WORKER', 'gw0').removeprefix('gw'))
    workers = int(os.environ.get('PYTEST_XDIST_WORKER_COUNT', '1'))
    each = max(1, 101 // workers)
    while _claims:
        os.close(_claims.pop())
    for _ in range(each):
        number = (zlib.crc32(run.encode()) + next(_modules)) % each
        domain = 1 + (number * workers + worker) % 101
        if claim(domain):
            break
    return domain


def _left_in(domain: int) -> dict[Path, int]:
    """Return the files in shared memory of a domain's participants, with the port of each.

    Those that were killed leave theirs behind, in which later ones may wait for the dead.
    """
    numbers = {path: int(re.sub(r'.*port(\d+).*', r'\1', path.name))
               for path in Path('/dev/shm').glob('*fastrtps_port[0-9]*')}
    return {path: number for path, number in numbers.items()
            if 0 <= number - 7400 - 250 * domain < 250}


def claim(domain: int) -> bool:
    """Claim a domain and clear it; False if another run has claimed it, or somebody is in it."""
    name = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        name.bind(f'\0box_contact_ros domain {domain}')
        left = _left_in(domain)
        # The first participant of a domain on this host takes the first of these ports.
        for number in {7410 + 250 * domain, *left.values()}:
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as port:
                port.bind(('', number))
        for path in left:
            path.unlink(missing_ok=True)
    except OSError:  # also of files that are another user's
        name.close()
        return False
    _claims.append(name.detach())
    return True


os.environ['ROS_DOMAIN_ID'] = str(_domain_id())
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
# Without it rclpy publishes np.float32 or an int in a float field as garbage, silently.
os.environ['ROS_PYTHON_CHECK_FIELDS'] = '1'
# PyTorch's and BLAS's threads wait for each other in busy loops. One is what `train` takes, too.
os.environ['OMP_NUM_THREADS'] = '1'
# `python -m pytest` puts the checkout first, where it hides the package that colcon installed. This
# process and all that tests start import the installed one; in make's .venv that is the checkout.
if not sys.flags.safe_path and os.getcwd() in sys.path:
    sys.path.remove(os.getcwd())
os.environ['PYTHONSAFEPATH'] = '1'
# What is run from the checkout alone: benchmarks and training. Last, so that it hides nothing.
sys.path.append(str(Path(__file__).resolve().parents[1]))
# Options that colcon gives to this run, such as the file of results, are not for runs that tests
# start.
os.environ.pop('PYTEST_ADDOPTS', None)

from box_contact_ros.extras import MODULES  # noqa: E402  from where tests import it

PROGRAMS: dict[str, str] = ast.literal_eval(re.search(
    r'^PROGRAMS = (\{.*?\})', (Path(__file__).resolve().parents[1] / 'setup.py').read_text(),
    re.MULTILINE | re.DOTALL)[1])
"""The module of each program, as setup.py has them."""


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out what has a make target of its own, unless -m asks."""
    for marker in APART - set(config.option.markexpr.split()):
        apart = [item for item in items if item.get_closest_marker(marker)]
        config.hook.pytest_deselected(items=apart)
        items[:] = [item for item in items if item not in apart]


class TestFile(pytest.Module):
    """A file of tests, skipped where it imports a module of an extra that is not installed."""

    def collect(self) -> Iterable[pytest.Item | pytest.Collector]:
        try:
            return super().collect()
        except self.CollectError as error:
            if isinstance(error.__cause__, ModuleNotFoundError):
                skip_without_extra(error.__cause__.name)
            raise


def pytest_pycollect_makemodule(module_path: Path, parent: pytest.Collector) -> TestFile:
    """Read each file of tests as a TestFile."""
    return TestFile.from_parent(parent, path=module_path)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Iterator[None]:
    """Skip a test that comes to a module of an extra that is not installed."""
    try:
        return (yield)
    except ModuleNotFoundError as error:
        skip_without_extra(error.name)
        raise


def skip_without_extra(missing: str | None) -> None:
    """Skip what cannot import a module, if that is one of an extra."""
    for extra, modules in MODULES.items():
        if missing in modules:
            pytest.skip(f'{missing} is not installed: pip install .[{extra}]'
                        + (', or make test-training' if extra == 'train' else ''),
                        allow_module_level=True)


@pytest.fixture(scope='module', autouse=True)
def own_domain() -> None:
    """Give each module a ROS domain."""
    os.environ['ROS_DOMAIN_ID'] = str(_domain_id())


@pytest.fixture(scope='session', autouse=True)
def programs_end_with_their_terminal() -> None:
    """Let `nohup` keep these tests alone: a program would inherit that SIGHUP is ignored."""
    if signal.getsignal(signal.SIGHUP) == signal.SIG_IGN:
        signal.signal(signal.SIGHUP, lambda number, frame: None)


@pytest.fixture(autouse=True)
def same_arguments_and_path(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take back what programs that run in this process do to sys.argv and sys.path."""
    monkeypatch.setattr(sys, 'argv', [*sys.argv])
    monkeypatch.setattr(sys, 'path', [*sys.path])


@pytest.fixture
def setup_arguments(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Return what setup.py hands to setuptools."""
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

    def wait(self, timeout: float = PATIENCE) -> int:
        """Wait for the program to end by itself and return its exit status."""
        try:
            return self.process.wait(timeout)
        except subprocess.TimeoutExpired:
            pytest.fail(f'{self} did not end within {timeout} s; it wrote:\n{self.output}')

    def wait_for_output(self, text: str, timeout: float = PATIENCE) -> str:
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
def signal_handlers() -> Iterator[None]:
    """Give back the handlers of signals: a program that was asked to end keeps its own.

    A node's also passes SIGHUP on as SIGTERM, as the number arrives at its wakeup descriptor.
    """
    before = {number: signal.getsignal(number)
              for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    wakeup = signal.set_wakeup_fd(-1)
    yield
    signal.set_wakeup_fd(wakeup)
    for number, handler in before.items():
        if handler is not None:
            signal.signal(number, handler)


@pytest.fixture
def program(tmp_path: Path) -> Iterator[Callable[..., RunningProgram]]:
    """Start a program of setup.py, or a module; it is ended with the test, however that ends.

    `program('crane', '--ros-args', '-p', 'rate:=200.0')`. The test is skipped where an extra of the
    program is not installed.
    """
    started: list[RunningProgram] = []

    def start(*args: str) -> RunningProgram:
        for extra in {'crane': ('sim',), 'soup_node': ('soup',), 'view': ('view',)}.get(
                args[0], ()):
            if importlib.util.find_spec(MODULES[extra][0]) is None:
                skip_without_extra(MODULES[extra][0])
        module = PROGRAMS.get(args[0], args[0])
        log = tmp_path / f'program_{len(started)}.log'
        with log.open('wb') as out:
            process = subprocess.Popen(
                [sys.executable, '-u', '-m', f'box_contact_ros.{module}', *args[1:]],
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        started.append(RunningProgram(process, log))
        return started[-1]

    yield start
    for running in reversed(started):
        running.end()

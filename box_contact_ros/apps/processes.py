"""Programs of this package as child processes, in a ROS domain of their own on this host.

Knows nothing of rclpy: the demonstration starts and ends both its processes from outside.
"""
from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from typing import IO, Any

DOMAINS = range(1, 102)
"""To draw from: 0 is everybody's; beyond 101, ports run into those that Linux hands out."""
END_PATIENCE = 3.0
"""Time [s] between asking a process group to end and killing it."""
LOOK_PERIOD = 0.05
"""Time [s] after which a signal is noticed, at most."""


def on_this_host(domain: int) -> dict[str, str]:
    """Environment of processes that only processes of this host hear, and only in this domain."""
    return {'ROS_DOMAIN_ID': str(domain), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}


def start(program: str, parameters: Sequence[str], env: dict[str, str],
          output: IO[bytes] | int | None) -> subprocess.Popen[bytes]:
    """Start a program of this package in a process group of its own; `output` None passes it on."""
    command = [sys.executable, '-m', 'box_contact_ros', program, '--ros-args']
    for parameter in parameters:
        command += ['-p', parameter]
    return subprocess.Popen(command, env=env, stdin=subprocess.DEVNULL, stdout=output,
                            stderr=subprocess.STDOUT if output else None, start_new_session=True)


def end(processes: Sequence[subprocess.Popen[bytes]]) -> None:
    """End whole process groups: ask first, then kill what is left of them."""
    for process in processes:
        _signal_group(process, signal.SIGTERM)
    deadline = time.monotonic() + END_PATIENCE
    for process in processes:
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(max(0.0, deadline - time.monotonic()))
        # Also where the first process is gone: children of its own may be left in the group.
        _signal_group(process, signal.SIGKILL)
        process.wait()


def _signal_group(process: subprocess.Popen[bytes], number: signal.Signals) -> None:
    with contextlib.suppress(ProcessLookupError):  # nobody is left in it
        os.killpg(process.pid, number)


class Stop:
    """Set when this process was asked to end, by `signals`; the first of them says how.

    No `threading.Event`: a signal's handler runs in the main thread, perhaps while that holds the
    event's lock, and would wait for itself.
    """

    def __init__(self) -> None:
        self.signals: list[int] = []

    def is_set(self) -> bool:
        """Whether a signal came."""
        return bool(self.signals)

    def wait(self, seconds: float) -> bool:
        """Sleep so long, or until a signal came; whether one did."""
        end = time.monotonic() + seconds
        while not self.signals and (left := end - time.monotonic()) > 0.0:
            time.sleep(min(left, LOOK_PERIOD))  # which goes on after a handler has run
        return self.is_set()

    @property
    def status(self) -> int:
        """Exit status as shells report it: 128 + number of the signal, 0 if there was none."""
        return 128 + self.signals[0] if self.signals else 0


@contextlib.contextmanager
def asked_to_end() -> Iterator[Stop]:
    """Turn SIGINT, SIGTERM and SIGHUP into a flag.

    An exception might fall between a child's start and its being written down, and leave it alone.
    """
    stop = Stop()

    def take(number: int, _frame: Any) -> None:
        stop.signals.append(number)

    before = {number: signal.signal(number, take)
              for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)

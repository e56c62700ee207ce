# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Programs of this package as subprocesses, in a ROS domain of their own on this host.

Imports no rclpy: the demonstration starts and ends both its processes from outside.
"""
from __future__ import annotations

import argparse
import atexit
import contextlib
import ctypes
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from typing import IO, Any

from ..solver.arguments import within

DOMAINS = range(1, 102)
"""Domains to draw from: 0 is everybody's; beyond 101, ports run into those that Linux assigns."""
END_PATIENCE = 1.0  # time [s] between asking a process group to end and killing it
PR_SET_PDEATHSIG = 1  # of <linux/prctl.h>
LOOK_PERIOD = 0.05  # time [s] after which a signal is noticed, at most


def add_domain(parser: argparse.ArgumentParser, note: str = '') -> None:
    """Add `--domain`, drawn at random where it is not given; the help text ends with `note`."""
    parser.add_argument('--domain', type=within(0, DOMAINS[-1]), default=random.choice(DOMAINS),
                        metavar='ID',
                        help=f'ROS domain, 0 to {DOMAINS[-1]} (default: drawn at random{note})')


def on_this_host(domain: int) -> dict[str, str]:
    """Return the environment of processes that only this host hears, and only in this domain."""
    return {'ROS_DOMAIN_ID': str(domain), 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}


def parameters(**values: object) -> list[str]:
    """Return the words `-p NAME:=VALUE` that set ROS parameters; YAML reads JSON."""
    return [word for name, value in values.items()
            for word in ('-p', f'{name}:={json.dumps(value, ensure_ascii=False)}')]


def program(name: str, **values: object) -> list[str]:
    """Return Python's arguments for a program with ROS parameters, by its module's name here.

    name: such as `node.contact_node`.
    """
    return ['-m', f'box_contact_ros.{name}', '--ros-args', *parameters(**values)]


def start(arguments: Sequence[str], output: IO[bytes] | int | None = subprocess.DEVNULL,
          ) -> subprocess.Popen[bytes]:
    """Start Python in a process group of its own; `output` None passes its output on.

    On Linux it ends with the thread that starts it, also where that one is killed.
    """
    return subprocess.Popen([sys.executable, *arguments], stdin=subprocess.DEVNULL, stdout=output,
                            stderr=subprocess.STDOUT if output else None, start_new_session=True,
                            preexec_fn=_end_with_parent if sys.platform == 'linux' else None)


_LIBC = ctypes.CDLL(None)  # loaded before a fork, after which little is safe


def _end_with_parent() -> None:
    _LIBC.prctl(PR_SET_PDEATHSIG, signal.SIGTERM)


def printed(output: IO[bytes]) -> str:
    """Return what a process wrote to its file."""
    output.seek(0)
    return output.read().decode(errors='replace').rstrip()


def end(processes: Sequence[subprocess.Popen[bytes]]) -> None:
    """End whole process groups: ask first, then kill what is left of them."""
    for process in processes:
        _signal_group(process, signal.SIGTERM)
    deadline = time.monotonic() + END_PATIENCE
    for process in processes:
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(max(0.0, deadline - time.monotonic()))
        # Also where the first process is gone: its own subprocesses may be left in the group.
        _signal_group(process, signal.SIGKILL)
        process.wait()


def _signal_group(process: subprocess.Popen[bytes], number: signal.Signals) -> None:
    with contextlib.suppress(ProcessLookupError):  # nobody is left in it
        os.killpg(process.pid, number)


class Stop:
    """Set when this process was asked to end, by `signals`; the first of them is the reason.

    A `threading.Event` would deadlock: the handler may run while the main thread holds its lock.
    """

    def __init__(self) -> None:
        self.signals: list[int] = []

    def take(self, number: int, _frame: Any) -> None:
        """Note a signal."""
        self.signals.append(number)

    def is_set(self) -> bool:
        """Return whether a signal came."""
        return bool(self.signals)

    def wait(self, seconds: float) -> bool:
        """Sleep this long, or until a signal came; return whether one did."""
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

    An exception could fall between a subprocess's start and its entry in a list, and orphan it.
    After the first signal the process is about to end, and further ones stay without effect.
    """
    stop = Stop()
    before = {number: signal.signal(number, stop.take)
              for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        yield stop
    finally:
        for number, earlier in before.items():
            if stop.is_set():
                atexit.register(signal.signal, number, signal.SIG_IGN)
            else:
                signal.signal(number, earlier)

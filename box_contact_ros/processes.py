# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Programs of this package as subprocesses, in a ROS domain of their own on this host.

Imports no rclpy: the demonstration starts and ends all its processes from outside.
"""
from __future__ import annotations

import atexit
import contextlib
import ctypes
import json
import os
import random
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence

DOMAINS = range(1, 102)
"""Domains to draw from: 0 is everybody's; beyond 101, ports run into those that Linux assigns."""
END_PATIENCE = 1.0  # time [s] between asking a process group to end and killing it
PR_SET_PDEATHSIG = 1  # of <linux/prctl.h>


def keep_to_this_host() -> str:
    """Let only this host hear this process and those that it starts; return their ROS domain.

    The domain is ROS_DOMAIN_ID where that is set, or drawn at random.
    """
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    return os.environ.setdefault('ROS_DOMAIN_ID', str(random.choice(DOMAINS)))


def program(name: str, **values: object) -> list[str]:
    """Return Python's arguments for a program with ROS parameters, by its module's name here.

    name: such as `node.run_contact_node`. The program logs warnings and errors alone.
    """
    parameters = [word for parameter, value in values.items()  # YAML reads JSON
                  for word in ('-p', f'{parameter}:={json.dumps(value, ensure_ascii=False)}')]
    return ['-m', f'box_contact_ros.{name}', '--ros-args', '--log-level', 'warn', *parameters]


@contextlib.contextmanager
def running(arguments: Sequence[str]) -> Iterator[subprocess.Popen[bytes]]:
    """Run Python in a process group of its own; end the whole group afterwards.

    On Linux it ends with the thread that starts it, also where that one is killed.
    """
    process = subprocess.Popen(
        [sys.executable, *arguments], stdin=subprocess.DEVNULL, start_new_session=True,
        preexec_fn=end_with_parent)
    try:
        yield process
    finally:
        _signal_group(process, signal.SIGTERM)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(END_PATIENCE)
        # Also where the first process is gone: its own subprocesses may be left in the group.
        _signal_group(process, signal.SIGKILL)
        process.wait()


_LIBC = ctypes.CDLL(None)  # loaded before a fork, after which little is safe


def end_with_parent() -> None:
    """End this process, just forked, with the thread that forked it; on Linux alone."""
    if sys.platform == 'linux':
        _LIBC.prctl(PR_SET_PDEATHSIG, signal.SIGTERM)


def _signal_group(process: subprocess.Popen[bytes], number: signal.Signals) -> None:
    with contextlib.suppress(ProcessLookupError):  # nobody is left in it
        os.killpg(process.pid, number)


@contextlib.contextmanager
def asked_to_end() -> Iterator[list[int]]:
    """Note SIGINT, SIGTERM and SIGHUP instead of raising; yield the list of those that came.

    A raised exception could fall anywhere in rclpy. After the first signal the process is about to
    end, and further ones stay without effect.
    """
    signals: list[int] = []
    before = {number: signal.signal(number, lambda number, _: signals.append(number))
              for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    try:
        yield signals
    finally:
        for number, earlier in before.items():
            if signals:
                atexit.register(signal.signal, number, signal.SIG_IGN)
            else:
                signal.signal(number, earlier)

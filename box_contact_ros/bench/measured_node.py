# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A node that the bench measures, as a process of its own, and what it takes of the machine."""
from __future__ import annotations

import contextlib
import math
import os
import tempfile

from ..node.processes import end, parameters, printed, start
from .pose_streams import Stream

MODULES = {'echo': 'bench.echo_node', 'contact': 'node.contact_node', 'soup': 'soup.soup_node'}
PREFIXES = {'echo': 'echo/', 'contact': '', 'soup': 'soup/'}
"""Nodes by name, with what stands before the topics that they answer on. Each is compared with the
one before it."""


class MeasuredNode:
    """The process of a node (Linux)."""

    def __init__(self, name: str, stream: Stream, *, inputs: str, model: str,
                 cores: set[int]) -> None:
        """Start the node for the boxes of a stream, on some cores.

        inputs: prefix of the pose topics; model: of the contact node.
        """
        values: dict[str, object] = {}
        if name != 'echo':
            values = {'size_a': stream.size, 'size_b': stream.size}
        if name == 'contact':
            values['model'] = model
        remaps = [word for box in 'ab' if inputs
                  for word in ('-r', f'box_{box}/pose:={inputs}box_{box}/pose')]
        self.name = name
        self._output = tempfile.TemporaryFile()
        self.process = start(['-m', f'box_contact_ros.{MODULES[name]}', '--ros-args',
                              *parameters(**values), *remaps], self._output)
        # It has inherited this process's core. Before it has threads, it gets its own.
        with contextlib.suppress(ProcessLookupError):
            os.sched_setaffinity(self.process.pid, cores)

    @property
    def fault(self) -> str:
        """Return why the process does not run any more, '' while it runs."""
        status = self.process.poll()
        if status is None:
            return ''
        *_, last = ['', *printed(self._output).splitlines()]
        return f'the {self.name} node ended with status {status}: {last}'

    def usage(self) -> tuple[float, float]:
        """Return processor time [s] and resident memory [bytes]; NaN once the process ended."""
        try:
            with open(f'/proc/{self.process.pid}/stat') as file:
                fields = file.read().rpartition(')')[2].split()
        except OSError:
            return math.nan, math.nan
        ticks = int(fields[11]) + int(fields[12])
        return ticks / os.sysconf('SC_CLK_TCK'), float(int(fields[21]) * os.sysconf('SC_PAGE_SIZE'))

    def close(self) -> None:
        """End the process."""
        end([self.process])
        self._output.close()

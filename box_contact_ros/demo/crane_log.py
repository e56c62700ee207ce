# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the crane sent, what came back, and how good it was, for people to read. No ROS."""
from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn
from rich.table import Table
from rich.text import Text

from ..output import percentiles
from ..solver.contact_solver import ContactSolver
from .answer_log import AnswerLog, StreamResult


def table(rows: list[tuple[str, str]]) -> str:
    """Return lines of names and values, dots between them."""
    return '\n'.join(f'  {name + " ":.<24} {value}' for name, value in rows)


class Screen:
    """Lines and tables for people: in colour, with a progress line, on a terminal; plain elsewhere.

    Used as a context: it shows the progress line until its end.
    """

    def __init__(self, what: str, seconds: float) -> None:
        """Say what takes how long [s]."""
        self._bar: Progress | None = None
        if sys.stdout.isatty():
            self._bar = Progress(TextColumn(what), BarColumn(), TextColumn(
                '{task.completed:.0f} of {task.total:.0f} s'), transient=True, console=Console())
            self._bar.add_task(what, total=seconds)

    def __enter__(self) -> Screen:
        if self._bar:
            self._bar.start()
        return self

    def __exit__(self, *error: object) -> None:
        if self._bar:
            self._bar.stop()

    def progress(self, seconds: float) -> None:
        """Show how much is done [s]."""
        if self._bar:
            self._bar.update(self._bar.task_ids[0], completed=seconds)

    def verdict(self, passed: bool, text: str) -> None:
        """Print the line that says how it went, before all figures."""
        if self._bar:
            self._bar.console.print(text, style='bold green' if passed else 'bold red',
                                    highlight=False, markup=False)
        else:
            print(text, flush=True)

    def line(self, text: str) -> None:
        """Print a line; a reader of a pipe wants it live as well."""
        if self._bar:
            self._bar.console.print(text, highlight=False, markup=False)
        else:
            print(text, flush=True)

    def tables(self, title: str, *tables: object) -> None:
        """Print texts that `table` made, below a title."""
        if not self._bar:
            print(title, *tables, sep='\n', flush=True)
            return
        shown = Table(title=title, title_justify='left', show_header=False)
        for line in '\n'.join(map(str, tables)).splitlines():
            name, _, value = line.strip().partition(' .')
            colour = 'red' if 'not met' in value or 'NOT' in value else 'default'
            shown.add_row(name, Text(value.lstrip('. '), colour))
        self._bar.console.print(shown)


class CraneLog(AnswerLog):
    """The answers to one run of the crane, and the poses that it sent."""

    def __init__(self, ticks: int) -> None:
        """Make room for so many pairs."""
        super().__init__('crane', '')
        self._stream = self.open('crane', ticks)
        self._poses: list[tuple[np.ndarray, np.ndarray]] = []

    def sent_poses(self, stamp: int, pose_a: np.ndarray, pose_b: np.ndarray) -> None:
        """Note poses (7,) under their stamp [ns] BEFORE they are published: answers may be fast."""
        self._poses.append((np.array(pose_a), np.array(pose_b)))
        self.sent(stamp)

    @property
    def sent_pairs(self) -> int:
        """Pairs of poses sent so far."""
        return len(self._poses)

    def summary(self, solver: ContactSolver, edge: float) -> CraneSummary | None:
        """Compare the answers with a reference; None if nothing was sent.

        edge: longest edge of the smaller box [m], what the point error is a share of.
        """
        if self._poses:
            self._stream.truth = solver.batch(*map(np.array, zip(*self._poses)))
        latencies = self._stream.latencies[self._stream.contacts]
        return next((CraneSummary(result, latencies, edge) for result in self.results()), None)


@dataclass(frozen=True)
class CraneSummary:
    """The figures of one run, and whether it passed."""

    result: StreamResult
    latencies: np.ndarray  # from the poses' stamp to a contact [s]
    edge: float  # what point errors are a share of [m]

    @property
    def lost(self) -> int:
        """Messages that should have come and did not."""
        return self.result.lost_evaluations + self.result.lost_contacts

    @property
    def wrong_verdicts(self) -> int:
        """Answers whose verdict is wrong, or whose messages disagree on it."""
        return self.result.wrong_verdicts + self.result.contradictions

    @property
    def faults(self) -> list[str]:
        """Return what went wrong, in words: nothing if contacts came, none lost and none wrong."""
        counted = ((self.result.lost, 'lost answers'), (self.wrong_verdicts, 'wrong verdicts'),
                   (self.result.strangers, 'answers to no pose'))
        return ['no contacts came'] * (not self.result.contacts) + [
            f'{count} {what}' for count, what in counted if count]

    @property
    def passed(self) -> bool:
        """Whether contacts really came through, nothing was lost and no verdict was wrong."""
        return not self.faults

    def __str__(self) -> str:
        """Return several lines for people, every figure with its unit."""
        def share(error: float) -> str:
            return f'{1e3 * error:.3g} mm = {100.0 * error / self.edge:.2g} %'

        r = self.result
        rows = [
            ('poses sent', f'{r.sent} pairs'),
            ('evaluations received', f'{r.sent - r.lost_evaluations - r.not_evaluated} answers'),
            ('contacts received', f'{r.contacts} points with normals'),
            ('messages lost', f'{self.lost} ({r.lost_evaluations} evaluations, '
                              f'{r.lost_contacts} contacts)'),
            ('wrong verdicts', f'{self.wrong_verdicts}'),
        ]
        if r.contacts:
            p50, p99 = (f'{1e3 * value:.3f} ms' for value in percentiles(self.latencies, 50, 99))
            point, normal = r.point_error, r.normal_error
            rows += [
                ('latency', f'p50 {p50}, p99 {p99} (pose stamp to contact received)'),
                ('point error', f'median {share(point["median"])}, p99 {share(point["p99"])} '
                                f'(of the longest edge, {self.edge:g} m)'),
                ('normal error', f'median {normal["median"]:.3g} deg, '
                                 f'p99 {normal["p99"]:.3g} deg')]
        if r.not_evaluated:
            rows.append(('pairs not evaluated', f'{r.not_evaluated}'))
        if r.strangers:
            rows.append(('answers to no pose', f'{r.strangers}'))
        return table(rows)

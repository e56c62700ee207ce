# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a contact node reports once a second, on /diagnostics and in its log.

A finding is one cause. Its message goes to /diagnostics, and with its remedy to the log.
docs/reference/diagnostics.md lists all of them.
"""
from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping, Sequence
from math import ceil, floor, log10
from typing import Any, NamedTuple

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from ..scene.scene_solver import Pair
from ..scene.stamp_pairing import AGAIN, AHEAD, OLD, REPEATED, RESETS, TOO_LATE, Note
from .messages import make_header

DIAGNOSTICS_SECONDS = 1.0
LOOK_JITTER = 0.1  # looks may be this much less than DIAGNOSTICS_SECONDS apart [s]
UNMATCHED_SECONDS = 1.0  # a pair unanswered for this long is worth a warning
UNANSWERED_SECONDS = 5.0
"""A pair unanswered for this long is an error; so long nobody has to publish after a start."""
REMINDER_SECONDS = 10.0  # a finding that stays is logged again after this long
KEPT_TIMES = 4096
"""Evaluations whose computing times are kept for a report: more a second than any node makes."""
NAMED = 3  # boxes or pairs that a message names
OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
ACTIVE = 'active'


REMEDIES = {
    'has zero length': 'set orientation.w to 1.0',
    'is not finite': 'send finite numbers',
    'exceeds': 'send metres',
}
"""What a sender can do, by words of a refusal. Each is a kind of its own in the log."""


def kind_and_remedy(reason: str, text: str) -> tuple[str, str]:
    """Return the kind of a refusal in the log, and what stands behind it there."""
    words = next((words for words in REMEDIES if words in text), '')
    return reason + words, f': {REMEDIES[words]}' if words else ''


def note_line(kind: str, note: Note) -> str:
    """Return the log line, with its remedy, of what the pairing did to a pose."""
    stamp, newest = (f'{1e-9 * value:.12g} s' for value in (note.stamp, note.newest))
    if kind == RESETS:
        return (f'time went back: {note.box} has stamp {stamp} after {newest}; a new time begins '
                '(a loop, a restart, or a second publisher)')
    if kind == TOO_LATE:
        return (f'{note.box}: the tick of stamp {stamp} was answered without this pose; dropped: '
                'set a longer max_age')
    if kind == OLD:
        return (f'{note.box}: stamp {stamp} is older than {newest}; refused: publish in the order '
                'of the stamps, from one publisher')
    if kind == AHEAD:
        return (f'{note.box}: stamp {stamp} is {1e-9 * (note.stamp - note.newest):.3g} s ahead of '
                'the other boxes, max_age is less; refused: stamp all by the same clock')
    assert kind == REPEATED
    if note.stamp == note.newest:
        return (f'{note.box}: stamp {stamp} does not advance; refused: set header.stamp (`ros2 '
                'topic pub` does for `stamp: now`), or pairing:=latest')
    return (f'{note.box}: stamp {stamp} has come before; refused: send each stamp once (a loop of '
            f'more than {AGAIN} ticks begins anew), or pairing:=latest')


def listed(names: Sequence[str]) -> str:
    """Return the first names, and how many there are besides."""
    more = len(names) - NAMED
    return ', '.join(names[:NAMED]) + (f' and {more} more' if more > 0 else '')


def rounded_up(value: float) -> float:
    """Return a positive number rounded up to two digits."""
    unit = 10.0 ** (floor(log10(value)) - 1)
    return ceil(value / unit) * unit


class Finding(NamedTuple):
    """One cause of what is wrong."""

    kind: str
    message: str
    remedy: str = ''  # empty: the log has it elsewhere
    level: bytes = WARN


class Look(NamedTuple):
    """What happened since the last look, a second ago."""

    refused: list[str]  # reasons of refusals
    unmatched: list[Pair]
    """Pairs unanswered for UNMATCHED_SECONDS, or max_age if that is longer, while poses come."""
    unanswered: list[Pair]  # pairs unanswered for UNANSWERED_SECONDS, or max_age
    quiet: float  # time [s] since the last pose, or since the start
    has_heard: bool  # whether any pose came since the start


class Watch:
    """Which pairs are answered and when poses came, by the steady clock [s]."""

    def __init__(self) -> None:
        self._pairs: Sequence[Pair] = ()
        self._open: list[Pair] | None = None  # not answered since the last look; None: no tick
        self._since: dict[Pair, float] = {}  # when a look first found a pair unanswered
        self._heard: float | None = None  # when poses last came
        self.restart()

    def restart(self) -> None:
        """Begin anew, as a node does when it is activated."""
        self._began, self._heard = time.monotonic(), None
        self._since.clear()

    def set_pairs(self, pairs: Sequence[Pair]) -> None:
        """Replace the pairs that are asked for."""
        self._pairs, self._open = pairs, None

    def evaluated(self, stale: list[Pair]) -> None:
        """Note a tick that answered all pairs but those."""
        if self._open is None:
            self._open = stale
        elif self._open and self._open != stale:
            still = set(stale)
            self._open = [pair for pair in self._open if pair in still]

    def look(self, refused: list[str], *, came: bool, max_age: float) -> Look:
        """Return what happened since the last look; `came`: whether any pose did."""
        now = time.monotonic()
        if came:
            self._heard = now
        has_heard = self._heard is not None
        quiet = now - (self._began if self._heard is None else self._heard)
        # Without poses nothing is asked. A simulation may pause.
        asked = has_heard and quiet <= max(max_age, UNMATCHED_SECONDS)
        missed = self._pairs if self._open is None else self._open
        self._since = {pair: self._since.get(pair, now) for pair in missed} if asked else {}
        self._open = None
        unmatched, unanswered = (
            [pair for pair, since in self._since.items()
             if now - since + LOOK_JITTER >= max(seconds, max_age)]
            for seconds in (UNMATCHED_SECONDS, UNANSWERED_SECONDS))
        return Look(refused, unmatched if came else [], unanswered, quiet, has_heard)


class Diagnostics:
    """Computing times and counts of the last second, and the message."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._times = np.zeros(KEPT_TIMES)  # [us], a ring
        self._evaluations = 0
        self._reported: Counter[str] = Counter()
        self._logged: dict[str, float] = {}  # when a kind of finding was logged [s]
        self.watch = Watch()

    def computed(self, nanoseconds: int, stale: list[Pair]) -> None:
        """Note a tick, its time in the solver, and the pairs that could not be evaluated."""
        self._times[self._evaluations % KEPT_TIMES] = 1e-3 * nanoseconds
        self._evaluations += 1
        self.watch.evaluated(stale)

    def look(self, counts: Counter[str], max_age: float) -> Look:
        """Return what happened since the last look."""
        new = Counter(counts)
        new.subtract(self._reported)
        self._reported = Counter(counts)
        refused = [name.partition(': ')[2] for name in new
                   if new[name] > 0 and name.startswith('refused')]
        return self.watch.look(refused, came=new['poses'] > 0, max_age=max_age)

    def log(self, findings: Sequence[Finding]) -> None:
        """Log each kind of finding when it comes up, and again while it stays."""
        now = time.monotonic()
        stay = {finding.kind for finding in findings}
        self._logged = {kind: at for kind, at in self._logged.items()
                        if kind in stay and now < at + REMINDER_SECONDS}
        for finding in findings:
            if finding.remedy and finding.kind not in self._logged:
                self._logged[finding.kind] = now
                self._node.get_logger().warning(f'{finding.message}: {finding.remedy}')

    def publish(self, counts: Mapping[str, int], findings: Sequence[Finding] = (), *,
                state: str, **values: Any) -> None:
        """Publish counts, findings and further `values`; `state` is that of the lifecycle."""
        ticks, self._evaluations = self._evaluations, 0
        pairs: dict[str, Any] = {**counts, 'lifecycle state': state}
        pairs |= {name.replace('_', ' '): value for name, value in values.items()}
        pairs['rate [1/s]'] = ticks
        if ticks:
            pairs |= {f'compute {name} [us]': f'{value:.1f}' for name, value in zip(
                ('p50', 'p99', 'max'),
                np.percentile(self._times[:min(ticks, KEPT_TIMES)], (50, 99, 100)))}
        if state != ACTIVE:
            findings = [Finding('state', f'{state}: no pose is answered')]
        level = max((finding.level for finding in findings), default=OK)
        message = '; '.join(finding.message for finding in findings) or (
            'answering' if ticks else 'no poses')
        status = DiagnosticStatus(
            level=level, name=f'{self._node.get_fully_qualified_name()}: contacts',
            message=message, hardware_id='none',
            values=[KeyValue(key=key, value=str(value)) for key, value in pairs.items()])
        header = make_header(self._node.get_clock().now().nanoseconds, '')
        self._publisher.publish(DiagnosticArray(header=header, status=[status]))

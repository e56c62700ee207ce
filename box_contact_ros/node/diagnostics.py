# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a contact node reports once a second, on /diagnostics and in its log.

A finding is one cause. Its message goes to /diagnostics, and with its remedy to the log.
`TickMonitor` notes what happens; `Diagnostics` reads it, and the state of pairing and topics.
docs/reference/diagnostics.md lists all findings.
"""
from __future__ import annotations

import math
import time
from collections import Counter, deque
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import Any, NamedTuple

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from ..scene.scene import Pair, Scene
from ..solver.checks import nearest_name, short_repr
from ..stream.pairing import NO_PARTNER, OVERTAKEN, Pairing
from ..stream.streams import streams_of, watched_of
from .messages import make_header
from .topics import SceneTopics

DIAGNOSTICS_SECONDS = 1.0
REPORT_JITTER = 0.1  # reports may be this much less than DIAGNOSTICS_SECONDS apart [s]
BUSY_SECONDS = 1.5 * DIAGNOSTICS_SECONDS
"""A report that comes so long after the last one tells that the node was busy, and poses wait."""
UNMATCHED_SECONDS = 1.0  # a pair unanswered for this long is worth a warning
UNANSWERED_SECONDS = 5.0
"""A pair unanswered for this long is an error; so long nobody has to publish after a start."""
LATE_TICKS = 3.0
"""Answers that are older than so many periods of the poses are late: poses wait in the queue."""
NEWEST_ANSWERS = 10
"""How many tell whether answers are late: all of a report would tell it a report later."""
REMINDER_SECONDS = 10.0  # a finding that stays is logged again after this long
KEPT_TIMES = 4096
"""Evaluations whose times are kept for a report: more a second than any node makes."""
NAMED = 3  # boxes or pairs that a message names
MOST_TOLD = 100  # names that move nothing and are logged, one in a report
NEAREST_OF = 200  # names among which the nearest is looked for, in some 5 ms without a tick
COMPARED = 16  # pairs at most whose stamps are compared for a report
MARGIN = 1.2
"""A tolerance that is proposed is so much larger than half the period, as periods vary."""
RECENT = 8  # stamps of the slower box of a pair that are compared with the other's
FEWEST_STAMPS = 5  # of a box, before its period is known, even if there is a gap among them
OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
ACTIVE = 'active'
SILENCE = 'silence'
"""Cause of a node that nobody sends poses. It is logged once: the node may only serve requests."""
CHECK_TIME = 'check p99 [ms]'  # a key
REMEDIES = {
    'has zero length': 'set orientation.w to 1.0',
    'is not finite': 'send finite numbers',
    'exceeds': 'send metres',
}
"""What a sender can do, by words of a refusal. Each is a line of its own in the log."""


class Finding(NamedTuple):
    """One cause of what is wrong."""

    cause: str
    message: str
    remedy: str = ''  # empty: the log has it elsewhere
    level: bytes = WARN


class TickMonitor:
    """What happened since the last report, by the steady clock [s]."""

    def __init__(self) -> None:
        self.absent: list[str] = []  # what moves and the last message had no pose of
        self.unknown: Sequence[str] = ()  # the names of the last message that move nothing
        self.shared: list[str] = []  # the boxes whose publishers take turns
        self._times: deque[tuple[int, int]] = deque(maxlen=KEPT_TIMES)
        """Time to answer and age of the answer [ns] of the last evaluations."""
        self._evaluations = 0
        self._taken = time.monotonic()  # when `take_load` was called last
        self._refusals: dict[str, str] = {}  # log lines of the next report, by reason
        self.refused_boxes: set[str] = set()  # boxes of which a message was refused
        self._pairs: Sequence[Pair] = ()
        self._open: list[Pair] | None = None
        """Pairs not answered since the last report; None: no tick was."""
        self._since: dict[Pair, float] = {}  # when a report first found a pair unanswered
        self.restart(())

    def restart(self, pairs: Sequence[Pair]) -> None:
        """Begin anew with the pairs that are asked for, as a node does when it is activated."""
        self._began = time.monotonic()
        self._heard: float | None = None  # when poses last came
        self._pairs, self._open = pairs, None
        self._since.clear()

    def watch(self, pairs: Sequence[Pair]) -> None:
        """Ask for other pairs; those that are new count as answered until the next report."""
        self._pairs = pairs
        if self._open:
            known = set(pairs)
            self._open = [pair for pair in self._open if pair in known]

    def evaluated(self, took: int, age: int, stale: list[Pair]) -> None:
        """Note a tick: the time to answer it and the age of its answer [ns], the pairs left out.

        The age runs from the arrival of the pose that completes the tick, by the wall clock.
        """
        self._times.append((took, age))
        self._evaluations += 1
        if self._open is None:
            self._open = stale
        elif self._open and self._open != stale:
            still = set(stale)
            self._open = [pair for pair in self._open if pair in still]

    def refused(self, reason: str, text: str, box: str) -> None:
        """Note a refusal; the first of its kind is logged with the next report."""
        words = next((words for words in REMEDIES if words in text), '')
        remedy = f': {REMEDIES[words]}' if words else ''
        self._refusals.setdefault(reason + words, f'{text}; refused{remedy}')
        if box:
            self.refused_boxes.add(box)

    def take_refusals(self) -> list[str]:
        """Return the log lines of what was refused since the last call."""
        lines, self._refusals = list(self._refusals.values()), {}
        return lines

    def take_load(self, lost: int | None) -> Load:
        """Return what happened since the last call; the caller knows how many poses were lost."""
        now = time.monotonic()
        times = np.array(self._times).reshape(-1, 2)
        load = Load(now - self._taken, self._evaluations, lost, 1e-3 * times[:, 0],
                    1e-6 * times[:, 1])
        self._taken, self._evaluations = now, 0
        self._times.clear()
        return load

    def summary(self, *, came: bool, was_busy: bool, max_age: float) -> Summary:
        """Return which pairs are not answered.

        came: whether any pose did. was_busy: whether poses may wait that the node could not take.
        """
        now = time.monotonic()
        if came or (was_busy and self._heard is not None):
            self._heard = now
        quiet = now - (self._began if self._heard is None else self._heard)
        # Without poses nothing is asked. A simulation may pause.
        asked = self._heard is not None and quiet <= max(max_age, UNMATCHED_SECONDS)
        missed = self._pairs if self._open is None else self._open
        self._since = {pair: self._since.get(pair, now) for pair in missed} if asked else {}
        self._open = None
        unmatched, unanswered = (
            [pair for pair, since in self._since.items()
             if now - since + REPORT_JITTER >= max(seconds, max_age)]
            for seconds in (UNMATCHED_SECONDS, UNANSWERED_SECONDS))
        return Summary(unmatched if came else [], unanswered, quiet, self._heard is not None)


class Load(NamedTuple):
    """How busy the node was since the last report."""

    seconds: float
    evaluations: int
    lost: int | None  # poses that never came: the queue was full, or the network; None: unknown
    computing: np.ndarray  # (n,) time to answer the last ticks [us]
    ages: np.ndarray  # (n,) time from arrival to answer of the last ticks [ms]


class Summary(NamedTuple):
    """What happened since the last report, a second ago."""

    unmatched: list[Pair]
    """Pairs unanswered for UNMATCHED_SECONDS, or max_age if that is longer, while poses come."""
    unanswered: list[Pair]  # pairs unanswered for UNANSWERED_SECONDS, or max_age
    quiet: float  # time [s] since the last pose, or since the start
    has_heard: bool  # whether any pose came since the start


class Diagnostics:
    """Publishes and logs what is wrong, and what to do."""

    def __init__(self, node: Node, counts: Counter[str], monitor: TickMonitor) -> None:
        self._node, self._counts, self._monitor = node, counts, monitor
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._reported: Counter[str] = Counter()
        self._logged: dict[str, float] = {}  # when a cause was logged [s]
        self._told: set[str] = set()  # names that move nothing and were logged

    def report(self, state: str, scene: Scene, model: str, pairing: Pairing, topics: SceneTopics,
               lost: int | None, checks: Sequence[float]) -> None:
        """Report on a node that is configured.

        state: that of the lifecycle. Since the last report: lost: poses that never came, or None
        where nobody knows; checks: times of requests [s].
        """
        logger = self._node.get_logger()
        rejections, pairing.rejections = pairing.rejections, {}
        for line in (*self._monitor.take_refusals(),
                     *(rejection.line(reason, topics.publisher_count(rejection.box))
                       for reason, rejection in rejections.items())):
            logger.warning(line)
        new = self._counts - self._reported
        self._reported = Counter(self._counts)
        load = self._monitor.take_load(lost)
        summary = self._monitor.summary(
            came=new['poses'] > 0, was_busy=load.seconds > BUSY_SECONDS,
            max_age=1e-9 * pairing.max_age)
        only_serves = not summary.has_heard and self._counts['checks answered'] > 0
        unseen = [] if only_serves else [
            box for box in pairing.unseen() if box not in self._monitor.refused_boxes]
        stale = self._monitor.absent if scene.in_one_message else pairing.stale()
        findings = [] if state != ACTIVE else list(_findings(
            summary, [name.partition(': ')[2] for name in new if name.startswith('refused')],
            unseen, stale, scene, pairing, topics, mostly_alone=new[NO_PARTNER] > new['poses'] / 2))
        sent = (new['poses'] + (lost or 0)) / len(streams_of(scene))
        if state == ACTIVE:
            findings += _lateness(load, sent, new[OVERTAKEN])
            if self._monitor.unknown:
                findings.append(Finding(
                    'unknown', f'names that move nothing: {some_names(self._monitor.unknown)}'))
                self._log_unknown(scene)
            findings += _rivals(self._monitor.shared, topics,
                                self._node.get_fully_qualified_name())
        self._log(findings)
        times = {CHECK_TIME: f'{1e3 * np.percentile(checks, 99):.1f}'} if len(checks) else {}
        self.publish(findings, state=state, load=load, came=new['poses'] > 0, values=times | {
            'model': model, 'pairs': scene.pair_count, 'stale boxes': ' '.join(stale),
            'boxes that never came': ' '.join(unseen),
            'unanswered pairs': len(summary.unanswered), 'waiting ticks': pairing.waiting_ticks,
            'lost since the last report': 'unknown' if lost is None else lost,
            'dropped since the last report': sum(
                count for name, count in new.items() if name.startswith('dropped'))})

    def publish(self, findings: Sequence[Finding] = (), *, state: str, load: Load | None = None,
                came: bool = False, values: Mapping[str, Any] | None = None) -> None:
        """Publish counts, findings and further values.

        state: that of the lifecycle. came: whether any pose did since the last report.
        """
        entries: dict[str, Any] = {**self._counts, 'lifecycle state': state, **(values or {})}
        if load:
            entries['rate [1/s]'] = round(load.evaluations / load.seconds)
        if load and load.evaluations:
            entries |= {f'{what} {name} [{unit}]': f'{value:.1f}' for what, unit, times in (
                ('compute', 'us', load.computing), ('age', 'ms', load.ages)) for name, value in zip(
                ('p50', 'p99', 'max'), np.percentile(times, (50, 99, 100)))}
        if state != ACTIVE:
            findings = [Finding('state', f'{state}: no pose is answered')]
        level = max((finding.level for finding in findings), default=OK)
        message = '; '.join(finding.message for finding in findings) or (
            'answering' if load and load.evaluations else 'no answers' if came else
            'answering requests' if values and CHECK_TIME in values else 'no poses')
        status = DiagnosticStatus(
            level=level, name=f'{self._node.get_fully_qualified_name()}: contacts',
            message=message, hardware_id='none',
            values=[KeyValue(key=key, value=str(value)) for key, value in entries.items()])
        header = make_header(self._node.get_clock().now().nanoseconds, '')
        self._publisher.publish(DiagnosticArray(header=header, status=[status]))

    def _log_unknown(self, scene: Scene) -> None:
        """Log the first name that moves nothing and has not been logged, with the nearest one."""
        name = next((name for name in self._monitor.unknown if name not in self._told), None)
        if name is None or len(self._told) == MOST_TOLD:
            return
        self._told.add(name)
        nearest = nearest_name(name, islice(scene.moving, NEAREST_OF))
        self._node.get_logger().warning(
            f'poses: {short_repr(name)} moves nothing{nearest}: the scene has no such box or body, '
            'or it does not move; ask ~/get_boxes')

    def _log(self, findings: Sequence[Finding]) -> None:
        """Log each cause when it comes up, and again while it stays."""
        now = time.monotonic()
        stay = {finding.cause for finding in findings}
        self._logged = {cause: at for cause, at in self._logged.items()
                        if cause in stay and (now < at + REMINDER_SECONDS or cause == SILENCE)}
        for finding in findings:
            if finding.remedy and finding.cause not in self._logged:
                self._logged[finding.cause] = now
                self._node.get_logger().warning(f'{finding.message}: {finding.remedy}')


def _lateness(load: Load, sent: float, overtaken: int) -> Iterator[Finding]:
    """Yield that answers are late, or that a burst of poses was lost; sent: poses per box."""
    lost = (load.lost or 0) + overtaken
    told = f'at least {lost}' if load.lost is None else lost
    age = float(np.median(load.ages[-NEWEST_ANSWERS:])) if load.evaluations else 0.0
    ticks = 1e-3 * age * sent / load.seconds
    if ticks > LATE_TICKS or (overtaken and not load.evaluations):
        late = (f'{age:.0f} ms, {ticks:.0f} ticks' if load.evaluations else
                f'none for {load.seconds:.1f} s')
        yield Finding('late', f'answers are late: {late}; {told} poses lost',
                      'the node is too slow for these poses; give it a core of its own, list fewer '
                      'pairs, set pair_topics to false, or send poses less often')
    elif lost:
        yield Finding('burst', f'a burst of poses was lost: {told}',
                      'more came at once than the queue holds, or the node stood still; send them '
                      'evenly, or raise the depth by qos_overrides')


def _rivals(shared: Sequence[str], topics: SceneTopics, name: str) -> Iterator[Finding]:
    """Yield what is published twice.

    shared: boxes whose publishers take turns. name: the node's own.
    """
    if shared:
        yield Finding('shared', f'several publishers: {some_names(shared)}',
                      f'the poses of all are used; leave one that publishes '
                      f'{topics.pose_topic(shared[0])}')
    if rivals := topics.rivals():
        same_name, each = '', 'a topic of its own by -r contacts:=NAME'
        if name in rivals:  # services are named after the node
            same_name = f', and either one answers {name}/check'
            each = 'a namespace of its own by -r __ns:=/NAME'
        yield Finding('rivals',
                      f'others publish {topics.contacts.topic_name}: {some_names(rivals)}',
                      f'their answers are mixed with those of this node{same_name}; stop all but '
                      f'one, or give each {each}')


def _findings(summary: Summary, refused: Sequence[str], unseen: Sequence[str],
              stale: Sequence[str], scene: Scene, pairing: Pairing, topics: SceneTopics, *,
              mostly_alone: bool) -> Iterator[Finding]:
    """Yield why pairs are not answered, as far as it can be told.

    mostly_alone: whether most poses were dropped for want of a partner.
    """
    max_age = 1e-9 * pairing.max_age
    if summary.unanswered:
        pairs = [pair.label for pair in summary.unanswered]
        yield Finding('unanswered', f'unanswered for {UNANSWERED_SECONDS:g} s: {some_names(pairs)}',
                      level=ERROR)
    if refused:
        yield Finding('refused', f'poses refused: {", ".join(refused)}')
    if unseen and (summary.unmatched or (
            not summary.has_heard and summary.quiet >= UNANSWERED_SECONDS)):
        yield Finding('unseen' if summary.has_heard else SILENCE,
                      f'no pose ever came: {some_names(unseen)}',
                      '; '.join(map(topics.why_silent, unseen[:NAMED])))
    if stale:
        yield Finding('stale', f'stale boxes: {some_names(stale)}', '' if (
            scene.in_one_message or not summary.unmatched) else
                      _why_stale(stale[0], pairing, topics))
    if summary.has_heard and 0 < max_age <= summary.quiet:
        yield Finding('stopped', f'poses have stopped: none for {summary.quiet:.0f} s')
    elif (summary.unmatched or mostly_alone) and not (refused or unseen or stale):
        yield from _without_partner(summary.unmatched, watched_of(scene), pairing)


def _why_stale(box: str, pairing: Pairing, topics: SceneTopics) -> str:
    if not topics.publisher_count(box):
        return topics.why_silent(box)
    return (f'the newest stamp of {box} is {1e-9 * pairing.behind()[box]:.3g} s behind, max_age is '
            f'{1e-9 * pairing.max_age:g} s; does its publisher live, and stamp by the same clock?')


def _without_partner(unmatched: Sequence[Pair], watched: Sequence[Pair], pairing: Pairing,
                     ) -> Iterator[Finding]:
    """Yield by how much the stamps of a pair differ, and the tolerance that would do.

    Where each pair was answered, yield it only if most poses of the slower box have no partner: a
    faster box has poses to spare.
    """
    message = 'poses without a partner'
    answered = f'{"none" if unmatched else "few"} could be answered'
    for pair in (unmatched or watched)[:COMPARED]:
        fast, slow = sorted((np.sort(pairing.stamps(box)) for box in (pair.a, pair.b)), key=_period)
        if len(fast) < FEWEST_STAMPS or not len(slow):
            continue
        slow = slow[min(np.searchsorted(slow, fast[0]), len(slow) - 1):][-RECENT:]
        after = np.searchsorted(fast, slow)  # the first of fast not before each of slow
        difference = 1e-9 * float(np.median(np.minimum(*(
            abs(slow - fast.take(near, mode='clip')) for near in (after - 1, after)))))
        if difference <= 1e-9 * pairing.tolerance:
            continue
        message += f': stamps of {pair.a} and {pair.b} differ by {difference:.3g} s'
        # Half a period of the faster box joins each pose of the slower one, wherever it falls.
        tolerance = 0.5e-9 * MARGIN * _period(fast)
        if difference > tolerance:
            yield Finding('clocks', message, f'{answered}; stamp both by one clock (use_sim_time '
                                             'for all, or for none)')
        else:
            yield Finding('apart', message, f'{answered}; set tolerance:={tolerance:.2g}, or start '
                                            'with pairing:=latest')
        return
    if unmatched:
        yield Finding('alone', message, f'{answered}, as no tick had all its boxes')


def _period(stamps: np.ndarray) -> float:
    """Return the period of sorted stamps [ns], inf for fewer than two."""
    return float(np.median(np.diff(stamps))) if len(stamps) > 1 else math.inf


def some_names(names: Sequence[str], most: int = NAMED) -> str:
    """Return the first names, and how many there are besides."""
    more = len(names) - most
    return ', '.join(names[:most]) + (f' and {more} more' if more > 0 else '')

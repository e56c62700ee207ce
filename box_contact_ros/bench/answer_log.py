# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a client sent to one node, what the node answered, and how good it was. No ROS.

An `AnswerLog` matches messages to poses by their stamp. Its results compare them with the exact
contacts. Stamps and times of receipt are nanoseconds of one clock; positions are metres in the
poses' common frame.

A pair is answered when the cloud came. If it reports a contact, point and normal must come too.
Every other pair is lost, for one of three reasons:

- Lost evaluation: no cloud came.
- Lost contact: point or normal did not come.
- Not evaluated: the cloud says that the node could not evaluate the pair.

The latency runs from the stamp, taken just before the poses are published, to the last message of
the answer.

The echo node answers with one message; it has latencies, but no verdicts and no errors.
"""
from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..output import percentiles
from ..scene.pose import degrees_between
from ..solver.contact import Contact, Contacts

CONTACT_MESSAGES = ('cloud', 'point', 'normal')  # kinds of message that a contact node answers with
ECHO_MESSAGES = ('echo',)
WIDTHS = {'cloud': 7, 'point': 3, 'normal': 3, 'echo': 0}
"""Numbers kept of each, the first ones: see `first_row` for the cloud's."""
_COVARIANCE = [[8, 9, 10], [9, 11, 12], [10, 12, 13]]
"""Columns of the symmetric (3, 3)."""


def first_row(rows: np.ndarray) -> np.ndarray:
    """Return the numbers of the first row (messages.CLOUD_ROW); none without rows.

    Point and normal are columns 0 to 5, the depth 6, the volume 7, the covariance 8 to 13.
    """
    names = rows.dtype.names or ()
    of_float64 = names[names.index('pair') + 1:]
    return np.array([rows[0][name] for name in of_float64] if len(rows) else [])


def is_stale(values: Sequence[float] | np.ndarray) -> bool:
    """Whether a `first_row` says that its pair could not be evaluated."""
    return len(values) > 0 and bool(np.isnan(values[6]))


def touch_in(values: np.ndarray) -> Contact | None:
    """Return the contact of a `first_row`; None without one, apart, or if it was not evaluated.

    Volume and covariance are NaN from models that give the point alone.
    """
    if not len(values) or np.isnan(values[0]):
        return None
    return Contact(True, -float(values[6]), values[3:6], values[:3], float(values[7]),
                   values[_COVARIANCE])


class StreamLog:
    """One stream as it was sent to one node, and what came back to each row of it."""

    def __init__(self, name: str, rows: int, kinds: Sequence[str], truth: Contacts | None) -> None:
        """Make room for `rows` pairs, each answered by a message of each of `kinds`."""
        self.name, self.truth = name, truth
        """The exact contacts of the rows; what it takes for results, but for an echo."""
        self.stamps: list[int] = []
        self.lateness: list[float] = []
        """How late each pair was sent, compared with the schedule [s]."""
        self.received = {kind: np.zeros(rows, dtype=np.int64) for kind in kinds}
        """Time of the first message [ns], 0 for none."""
        self.values = {kind: np.full((rows, WIDTHS[kind]), math.nan) for kind in kinds}
        self.touching = np.zeros(rows, dtype=bool)
        self.refused = np.zeros(rows, dtype=bool)
        self.duplicates = self.strangers = 0

    @property
    def times(self) -> np.ndarray:
        """Return the times of the first messages [ns], 0 for none, (kinds, sent)."""
        return np.array([times[:len(self.stamps)] for times in self.received.values()])

    @property
    def evaluated(self) -> np.ndarray:
        """Which pairs have their first message (cloud or echo), (sent,)."""
        return self.times[0] > 0

    @property
    def answered(self) -> np.ndarray:
        """Which pairs have all that they can have, (sent,)."""
        rows, came = slice(0, len(self.stamps)), self.times > 0
        return came[0] & ~self.refused[rows] & (~self.touching[rows] | came.all(axis=0))

    @property
    def contacts(self) -> np.ndarray:
        """Which of the answers report a contact, (answered,)."""
        return self.touching[:len(self.stamps)][self.answered]

    @property
    def latencies(self) -> np.ndarray:
        """From the stamp to the end of each answer [s], (answered,)."""
        first, *others = self.times
        last = np.max(others, axis=0) if others else first
        finished = np.where(self.touching[:len(self.stamps)], last, first)
        return (finished - np.array(self.stamps, dtype=np.int64))[self.answered] * 1e-9


class AnswerLog:
    """Everything that was sent to one node and came from it. Two threads may use it.

    One thread calls `open` and `sent`, another one `answer`.
    """

    def __init__(self, node: str, model: str, kinds: Sequence[str] = CONTACT_MESSAGES) -> None:
        self.node, self.model, self.kinds = node, model, kinds
        self.streams: list[StreamLog] = []
        self.offers: set[int] = set()
        """Stamps [ns] of pairs that find out whether anyone answers; they count in no figure."""
        self.offers_answered: set[int] = set()
        self.first_answer = math.nan  # when the first of them was received [ns]
        self.messages = self.matched = self.offer_messages = 0
        self._rows: dict[int, tuple[StreamLog, int]] = {}

    def open(self, name: str, rows: int, truth: Contacts | None = None) -> StreamLog:
        """Begin a stream; `sent` fills it row by row."""
        self.streams.append(StreamLog(name, rows, self.kinds, truth))
        return self.streams[-1]

    def sent(self, stamp: int, lateness: float = 0.0) -> None:
        """Note that the stream's next row goes out under `stamp` [ns], `lateness` [s] too late."""
        log = self.streams[-1]
        if stamp in self._rows or stamp in self.offers:
            raise ValueError(f'stamp {stamp} was sent twice')
        self._rows[stamp] = log, len(log.stamps)
        log.stamps.append(stamp)
        log.lateness.append(lateness)

    def answer(self, kind: str, stamp: int, received: int,
               values: Sequence[float] | np.ndarray = ()) -> None:
        """Note a message received at `received` [ns]; values: see WIDTHS, none for no contact.

        An answer may come late, when another stream is under way: the stamp says where it belongs.
        """
        self.messages += 1
        if stamp in self.offers:
            self.offer_messages += 1
            if not self.offers_answered:
                self.first_answer = received
            self.offers_answered.add(stamp)
            return
        found = self._rows.get(stamp)
        if found is None:
            if self.streams:
                self.streams[-1].strangers += 1
            return
        log, row = found
        if log.received[kind][row]:
            log.duplicates += 1
            return
        self.matched += 1
        if len(values):
            log.values[kind][row] = values[:WIDTHS[kind]]
        if kind == 'cloud':
            log.refused[row] = is_stale(values)
            log.touching[row] = len(values) > 0 and not np.isnan(values[0])
        log.received[kind][row] = received

    @property
    def outstanding(self) -> int:
        """Pairs of the stream under way that may still be answered."""
        log = self.streams[-1]
        rows = slice(0, len(log.stamps))
        return int(np.count_nonzero(~(log.answered | log.refused[rows])))

    @property
    def adds_up(self) -> bool:
        """Whether each message is a first answer, a duplicate, a stranger or an offer's."""
        others = sum(log.duplicates + log.strangers for log in self.streams)
        return self.messages == self.matched + others + self.offer_messages

    def results(self) -> list[StreamResult]:
        """Return the figures of each stream that was begun to be sent, in order."""
        return [_result(self, log) for log in self.streams if log.stamps]


@dataclass(frozen=True, kw_only=True)
class StreamResult:
    """Figures of one node and one stream."""

    node: str
    stream: str
    model: str
    sent: int
    answered: int
    lost: int
    lost_evaluations: int
    lost_contacts: int
    not_evaluated: int
    duplicates: int
    strangers: int
    wrong_verdicts: int
    contradictions: int  # answers whose cloud, point and normal disagree with each other
    contacts: int
    rate: float  # pairs a second as they were really sent [Hz]
    latencies: np.ndarray = field(repr=False)  # (answered,) [s]
    point_errors: np.ndarray = field(repr=False)
    """(n,) [m], where node and exact solver both report a contact."""
    normal_errors: np.ndarray = field(repr=False)  # (n,) [deg], of the same
    lateness: np.ndarray = field(repr=False)
    """How far the client itself fell behind its schedule (sent,) [s]."""

    @property
    def adds_up(self) -> bool:
        """Whether what was sent is what was answered and what was lost, reason by reason."""
        reasons = self.lost_evaluations + self.lost_contacts + self.not_evaluated
        return self.sent == self.answered + self.lost and self.lost == reasons

    @property
    def faults(self) -> list[str]:
        """Return what went wrong, in words; slow or inaccurate is not wrong."""
        counted = {'lost': self.lost, 'duplicates': self.duplicates,
                   'answers to no pose': self.strangers, 'wrong verdicts': self.wrong_verdicts,
                   'contradictions': self.contradictions}
        faults = [f'{count} {name}' for name, count in counted.items() if count]
        return faults if self.adds_up else [*faults, 'the counts do not add up']

    @property
    def latency(self) -> dict[str, float]:
        """Figures of the latencies [s] in the words of `ros2 topic delay`; NaN without any."""
        values = self.latencies
        mean, std = (values.mean(), values.std()) if values.size else (math.nan, math.nan)
        least, most, p50, p99, p999 = percentiles(values, 0, 100, 50, 99, 99.9)
        return {'mean': float(mean), 'min': least, 'max': most, 'std': float(std), 'p50': p50,
                'p99': p99, 'p999': p999}

    @property
    def point_error(self) -> dict[str, float]:
        """Median, p99 and largest of the point errors [m]; NaN without any."""
        return _error(self.point_errors)

    @property
    def normal_error(self) -> dict[str, float]:
        """Return the same of the normal errors [deg]."""
        return _error(self.normal_errors)


def _error(values: np.ndarray) -> dict[str, float]:
    return dict(zip(('median', 'p99', 'max'), percentiles(values, 50, 99, 100)))


def _result(node: AnswerLog, log: StreamLog) -> StreamResult:
    sent = len(log.stamps)
    evaluated, answered = log.evaluated, log.answered
    touching, refused = log.touching[:sent], log.refused[:sent]
    wrong = contradictory = measured = np.zeros(sent, dtype=bool)
    point_errors = normal_errors = np.zeros(0)
    if log.truth is not None and node.kinds != ECHO_MESSAGES:
        cloud, point, normal = (log.values[kind][:sent] for kind in CONTACT_MESSAGES)
        real = log.truth.colliding[:sent]
        wrong = evaluated & ~refused & (touching != real)
        either = (log.times[1:] > 0).any(axis=0)
        apart = np.any(np.concatenate([point, normal], axis=1) != cloud[:, :6], axis=1)
        contradictory = evaluated & ~touching & either | answered & touching & apart
        measured = answered & touching & real
        point_errors = np.linalg.norm(point[measured] - log.truth.point[:sent][measured], axis=1)
        normal_errors = degrees_between(normal[measured], log.truth.normal[:sent][measured])
    lost = {'lost': ~answered, 'lost_evaluations': ~evaluated, 'not_evaluated': refused,
            'lost_contacts': evaluated & ~refused & ~answered}
    counts = lost | {'answered': answered, 'contacts': answered & touching,
                     'wrong_verdicts': wrong, 'contradictions': contradictory}
    span = (log.stamps[-1] - log.stamps[0]) * 1e-9
    return StreamResult(
        node=node.node, stream=log.name, model=node.model, sent=sent, duplicates=log.duplicates,
        strangers=log.strangers, rate=(sent - 1) / span if span else math.nan,
        latencies=log.latencies, point_errors=point_errors, normal_errors=normal_errors,
        lateness=np.array(log.lateness),
        **{name: int(np.count_nonzero(rows)) for name, rows in counts.items()})

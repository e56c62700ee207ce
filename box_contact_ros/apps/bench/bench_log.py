"""What the bench sent, what each node answered, and how good it was: plain Python, no ROS.

A `NodeLog` pairs one node's messages with what was sent to it, by stamp; `NodeLog.results` holds
them against the exact contacts. Stamps and times of receipt are nanoseconds of one clock; positions
are metres in the poses' common frame. What counts:

- answered: the cloud came, and, if it reports a contact, point and normal came too. Every pair that
  was sent is either answered or lost, for one of three reasons that are found independently:
  no cloud (lost evaluation), a cloud without its point or normal (lost contact), a cloud that says
  that the pair could not be evaluated.
- latency: from the stamp, taken just before the poses are published, to the receipt of the later of
  point and normal, or of the cloud where that says that there is no contact.
- the echo node answers with one message; it has latencies, but no verdicts and no errors.
"""
from __future__ import annotations

import csv
import dataclasses
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatter

from ...solver.contact import Contacts
from ..percentiles import angles, percentile

CONTACT_MESSAGES = ('cloud', 'point', 'normal')
"""Kinds of message that a contact node answers with."""
ECHO_MESSAGES = ('echo',)
WIDTHS = {'cloud': 7, 'point': 3, 'normal': 3, 'echo': 0}
"""Numbers kept of each: a cloud's row is x y z, normal x y z, depth."""
PERCENTILES = {'latency_p50': 50.0, 'latency_p99': 99.0, 'latency_p999': 99.9}
LEAST_DRAWN = 1e-9
"""Point errors [mm] are drawn as no less: a logarithmic axis has no zero."""
COLORS = {'contact': 'tab:blue', 'soup': 'tab:red', 'echo': 'tab:gray'}


class StreamLog:
    """One stream as it was sent to one node, and what came back to each row of it."""

    def __init__(self, name: str, truth: Contacts, kinds: Sequence[str]) -> None:
        """truth: the exact contacts of the stream's rows; kinds: the messages of one answer."""
        rows = len(truth.colliding)
        self.name, self.truth = name, truth
        self.stamps: list[int] = []
        self.lateness: list[float] = []
        """How late each pair was sent, against the schedule [s]."""
        self.received = {kind: np.zeros(rows, dtype=np.int64) for kind in kinds}
        """Time of the first message [ns], 0 for none."""
        self.values = {kind: np.full((rows, WIDTHS[kind]), math.nan) for kind in kinds}
        self.touching = np.zeros(rows, dtype=bool)
        self.refused = np.zeros(rows, dtype=bool)
        self.duplicates = self.strangers = 0


class NodeLog:
    """Everything that was sent to one node and came from it."""

    def __init__(self, node: str, model: str, kinds: Sequence[str] = CONTACT_MESSAGES) -> None:
        self.node, self.model, self.kinds = node, model, kinds
        self.streams: list[StreamLog] = []
        self.offers: set[int] = set()
        """Stamps [ns] of pairs that find out whether anyone answers; they count in no figure."""
        self.offers_answered: set[int] = set()
        self.messages = self.matched = self.offer_messages = 0
        self._rows: dict[int, tuple[StreamLog, int]] = {}

    def open(self, name: str, truth: Contacts) -> StreamLog:
        """Begin a stream; `sent` fills it row by row."""
        self.streams.append(StreamLog(name, truth, self.kinds))
        return self.streams[-1]

    def sent(self, stamp: int, lateness: float = 0.0) -> None:
        """The next row of the stream was sent under `stamp` [ns], `lateness` [s] behind time."""
        log = self.streams[-1]
        if stamp in self._rows or stamp in self.offers:
            raise ValueError(f'stamp {stamp} was sent twice')
        self._rows[stamp] = log, len(log.stamps)
        log.stamps.append(stamp)
        log.lateness.append(lateness)

    def answer(self, kind: str, stamp: int, received: int, values: Sequence[float] = ()) -> None:
        """A message came at `received` [ns]; values: see WIDTHS, none for a cloud without rows.

        An answer may come late, when another stream is under way: the stamp says where it belongs.
        """
        self.messages += 1
        if stamp in self.offers:
            self.offer_messages += 1
            self.offers_answered.add(stamp)
            return
        log, row = self._rows.get(stamp, (None, 0))
        if log is None:
            if self.streams:
                self.streams[-1].strangers += 1
            return
        if log.received[kind][row]:
            log.duplicates += 1
            return
        self.matched += 1
        log.received[kind][row] = received
        if len(values):
            log.values[kind][row] = values
        if kind == 'cloud':
            log.refused[row] = bool(np.isnan(values).any())
            log.touching[row] = len(values) > 0 and not log.refused[row]

    @property
    def outstanding(self) -> int:
        """Pairs of the stream under way whose last message (cloud or echo) has not come."""
        log = self.streams[-1]
        return len(log.stamps) - int(np.count_nonzero(log.received[self.kinds[0]]))

    @property
    def adds_up(self) -> bool:
        """Whether each message is a first answer, a duplicate, a stranger or an offer's."""
        others = sum(log.duplicates + log.strangers for log in self.streams)
        return self.messages == self.matched + others + self.offer_messages

    def results(self) -> list[StreamResult]:
        """The figures of each stream of which anything was sent, in order."""
        return [_result(self, log) for log in self.streams if log.stamps]


@dataclass(frozen=True, kw_only=True)
class StreamResult:
    """Figures of one node and one stream; NaN where there are none.

    Times [s], point errors [m], normal errors [deg].
    """

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
    contradictions: int
    """Answers whose cloud, point and normal disagree with each other."""
    contacts: int
    latency_mean: float
    latency_min: float
    latency_max: float
    latency_std: float
    latency_p50: float
    latency_p99: float
    latency_p999: float
    point_error_median: float
    point_error_p99: float
    point_error_max: float
    normal_error_median: float
    normal_error_p99: float
    normal_error_max: float
    rate: float
    """Pairs a second as they were really sent [Hz]."""
    lateness_p99: float
    lateness_max: float
    """How far the bench itself fell behind its schedule [s]."""
    latencies: np.ndarray = field(repr=False, compare=False)
    """(answered,) [s]."""

    @property
    def adds_up(self) -> bool:
        """Whether what was sent is what was answered and what was lost, reason by reason."""
        reasons = self.lost_evaluations + self.lost_contacts + self.not_evaluated
        return self.sent == self.answered + self.lost and self.lost == reasons

    @property
    def faults(self) -> list[str]:
        """What went wrong, in words; slow or inaccurate is not wrong."""
        counted = {'lost': self.lost, 'duplicates': self.duplicates,
                   'answers to no pose': self.strangers, 'wrong verdicts': self.wrong_verdicts,
                   'contradictions': self.contradictions}
        faults = [f'{count} {name}' for name, count in counted.items() if count]
        return faults if self.adds_up else [*faults, 'the counts do not add up']


COLUMNS = [entry.name for entry in dataclasses.fields(StreamResult) if entry.name != 'latencies']
UNITS = {'latency': 's', 'lateness': 's', 'point_error': 'm', 'normal_error': 'deg', 'rate': 'Hz'}


def _result(node: NodeLog, log: StreamLog) -> StreamResult:
    sent = len(log.stamps)
    rows = slice(0, sent)
    stamps = np.array(log.stamps, dtype=np.int64)
    arrived = {kind: times[rows] for kind, times in log.received.items()}
    last = arrived[node.kinds[0]]
    if node.kinds == ECHO_MESSAGES:
        complete, finished = last > 0, last
        no_cloud = ~complete
        contact = refused = half = np.zeros(sent, dtype=bool)
        wrong = contradictory = 0
        point_errors = normal_errors = np.zeros(0)
    else:
        evaluated = last > 0
        refused, touching = log.refused[rows], log.touching[rows]
        both = (arrived['point'] > 0) & (arrived['normal'] > 0)
        either = (arrived['point'] > 0) | (arrived['normal'] > 0)
        complete = evaluated & ~refused & (~touching | both)
        no_cloud, half = ~evaluated, evaluated & ~refused & touching & ~both
        contact = complete & touching
        finished = np.where(touching, np.maximum(arrived['point'], arrived['normal']), last)
        real = log.truth.colliding[rows]
        wrong = int(np.count_nonzero(evaluated & ~refused & (touching != real)))
        apart = np.concatenate([log.values['point'][rows], log.values['normal'][rows]],
                               axis=1) != log.values['cloud'][rows, :6]
        contradictory = int(np.count_nonzero(
            (evaluated & ~touching & either) | (contact & apart.any(axis=1))))
        measured = np.flatnonzero(contact & real)
        point_errors = np.linalg.norm(
            log.values['point'][measured] - log.truth.point[measured], axis=1)
        normal_errors = angles(log.values['normal'][measured], log.truth.normal[measured])
    latencies = (finished - stamps)[complete] * 1e-9
    lateness = np.array(log.lateness)
    span = (stamps[-1] - stamps[0]) * 1e-9
    return StreamResult(
        node=node.node, stream=log.name, model=node.model, sent=sent,
        answered=int(np.count_nonzero(complete)), lost=int(np.count_nonzero(~complete)),
        lost_evaluations=int(np.count_nonzero(no_cloud)),
        lost_contacts=int(np.count_nonzero(half)),
        not_evaluated=int(np.count_nonzero(refused)), duplicates=log.duplicates,
        strangers=log.strangers, wrong_verdicts=wrong, contradictions=contradictory,
        contacts=int(np.count_nonzero(contact)), latency_mean=_of(np.mean, latencies),
        latency_min=_of(np.min, latencies), latency_max=_of(np.max, latencies),
        latency_std=_of(np.std, latencies),
        **{name: percentile(latencies, percent) for name, percent in PERCENTILES.items()},
        point_error_median=percentile(point_errors, 50.0),
        point_error_p99=percentile(point_errors, 99.0),
        point_error_max=_of(np.max, point_errors),
        normal_error_median=percentile(normal_errors, 50.0),
        normal_error_p99=percentile(normal_errors, 99.0),
        normal_error_max=_of(np.max, normal_errors),
        rate=(sent - 1) / span if span else math.nan,
        lateness_p99=percentile(lateness, 99.0), lateness_max=_of(np.max, lateness),
        latencies=latencies)


def _of(figure, values: np.ndarray) -> float:
    return float(figure(values)) if values.size else math.nan


def write_csv(path: Path, results: Iterable[StreamResult], about: dict[str, str]) -> None:
    """A row per node and stream, units in the column names; `about` (machine, …) in every row."""
    def head(name: str) -> str:
        unit = next((unit for stem, unit in UNITS.items() if name.startswith(stem)), '')
        return f'{name} [{unit}]' if unit else name

    with path.open('w', newline='') as file:
        writer = csv.writer(file, lineterminator='\n')
        writer.writerow([*map(head, COLUMNS), *about])
        for result in results:
            values = [getattr(result, name) for name in COLUMNS]
            writer.writerow([*(_cell(value) for value in values), *about.values()])


def _cell(value: object) -> str:
    if isinstance(value, float):
        return '' if math.isnan(value) else f'{value:.9g}'
    return str(value)


def latency_table(results: Sequence[StreamResult]) -> str:
    """Counts and latencies, Markdown; in the words of `ros2 topic delay`, times in ms."""
    floor = {result.stream: result.latency_p50 for result in results if result.node == 'echo'}
    lines = [['stream', 'node', 'sent', 'answered', 'lost', 'dupl.', 'wrong', 'mean', 'min', 'max',
              'std dev', 'window', 'p50', 'p99', 'p99.9', 'p50 / echo']]
    for r in results:
        ratio = r.latency_p50 / floor.get(r.stream, math.nan)
        wrong = '' if r.node == 'echo' else str(r.wrong_verdicts)
        times = (r.latency_mean, r.latency_min, r.latency_max, r.latency_std)
        tail = (r.latency_p50, r.latency_p99, r.latency_p999)
        lines.append([r.stream, r.node, *map(str, (r.sent, r.answered, r.lost, r.duplicates)),
                      wrong, *map(_ms, times), str(len(r.latencies)), *map(_ms, tail),
                      '' if math.isnan(ratio) else f'{ratio:.2f}'])
    return markdown(lines, left=2)


def error_table(results: Sequence[StreamResult]) -> str:
    """Errors against the exact contact, Markdown; points in mm, normals in degrees."""
    lines = [['stream', 'node', 'model', 'contacts', 'point median', 'p99', 'max', 'normal median',
              'p99', 'max']]
    for r in results:
        if r.node == 'echo' or not r.contacts:
            continue
        points = (r.point_error_median, r.point_error_p99, r.point_error_max)
        normals = (r.normal_error_median, r.normal_error_p99, r.normal_error_max)
        lines.append([r.stream, r.node, r.model, str(r.contacts),
                      *(_figure(1e3 * value) for value in points),
                      *(_figure(value) for value in normals)])
    return markdown(lines, left=3)


def _ms(seconds: float) -> str:
    return '' if math.isnan(seconds) else f'{1e3 * seconds:.3f}'


def _figure(value: float) -> str:
    return '' if math.isnan(value) else f'{value:.3g}'


def markdown(lines: Sequence[Sequence[str]], left: int) -> str:
    """Cells as a Markdown table that is also readable as it is; `left` columns are words."""
    widths = [max(3, *(len(line[column]) for line in lines)) for column in range(len(lines[0]))]
    rule = ['-' * width if column < left else '-' * (width - 1) + ':'
            for column, width in enumerate(widths)]
    return '\n'.join(
        '| ' + ' | '.join(cell.ljust(width) if column < left else cell.rjust(width)
                          for column, (cell, width) in enumerate(zip(line, widths))) + ' |'
        for line in (lines[0], rule, *lines[1:]))


def draw(path: Path, results: Sequence[StreamResult], title: str) -> None:
    """Latency distributions of each node, latencies by stream, and error beside latency."""
    figure = Figure(figsize=(16.0, 5.6), layout='constrained')
    tails, streams, errors = figure.subplots(1, 3)
    # Before anything is plotted: empty axes cannot be made logarithmic any more.
    tails.set(xscale='log', yscale='log')
    streams.set(xscale='log')
    errors.set(xscale='log', yscale='log')
    nodes = list(dict.fromkeys(result.node for result in results))
    names = list(dict.fromkeys(result.stream for result in results))
    colors = {node: COLORS.get(node, f'C{i}') for i, node in enumerate(nodes)}

    for node in nodes:
        latencies = 1e3 * np.sort(np.concatenate(
            [result.latencies for result in results if result.node == node]))
        if latencies.size:
            # Share of the answers that took longer than the i-th, itself counted: never zero.
            share = np.arange(latencies.size, 0, -1) / latencies.size
            tails.step(latencies, share, where='post', color=colors[node], label=node)
    tails.set(xlabel='latency [ms]',
              ylabel='share of answers that take at least as long', title='all streams')
    tails.grid(alpha=0.3)

    for result in results:
        if not result.answered:
            continue
        height = -names.index(result.stream) + 0.2 * (len(nodes) / 2 - nodes.index(result.node))
        p50, p99, p999 = (1e3 * getattr(result, name) for name in PERCENTILES)
        streams.plot([1e3 * result.latency_min, p999], [height] * 2, color=colors[result.node])
        streams.plot([p50, p99], [height] * 2, 'o', markersize=4, color=colors[result.node])
    streams.set(xlabel='latency [ms]', yticks=[-row for row in range(len(names))],
                yticklabels=names, title='min to p99.9; dots: p50, p99')
    streams.grid(alpha=0.3, axis='x')

    markers = dict(zip(names, 'osD^vP*X<>hpd8', strict=False))
    for result in results:
        if result.node == 'echo' or math.isnan(result.point_error_median):
            continue
        low, high = (max(1e3 * value, LEAST_DRAWN)
                     for value in (result.point_error_median, result.point_error_p99))
        errors.plot([1e3 * result.latency_p50] * 2, [low, high], color=colors[result.node],
                    alpha=0.4)
        errors.plot(1e3 * result.latency_p50, low, markers.get(result.stream, 'o'),
                    color=colors[result.node])
    for name in names:  # shapes say the stream, whatever the node
        errors.plot([], [], markers.get(name, 'o'), color='black', label=name)
    floor = np.concatenate([r.latencies for r in results if r.node == 'echo'] or [np.zeros(0)])
    if floor.size:
        errors.axvline(1e3 * np.median(floor), color=colors['echo'], linestyle='--')
    errors.set(xlabel='latency, p50 [ms]',
               ylabel='point error, median to p99 [mm]',
               title=f'error beside latency (≤ {LEAST_DRAWN:g} mm is drawn there)')
    errors.xaxis.set_minor_formatter(LogFormatter(minor_thresholds=(1.0, 0.4)))
    errors.grid(alpha=0.3)
    if tails.lines:
        tails.legend()
    errors.legend(fontsize='small')
    figure.suptitle(title)
    figure.savefig(path, dpi=110)

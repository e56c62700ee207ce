"""What the crane sent, what came back, and how good it was: plain Python, no ROS.

The crane notes every pair of poses under its stamp, and every answer with the time it arrived.
`CraneLog.summary` then matches them and holds the answers against a reference solver. Stamps and
arrival times are nanoseconds of one clock; positions are metres in the poses' common frame.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field

import numpy as np

from ..percentiles import angles, percentile

__all__ = ['CraneLog', 'CraneSummary', 'LIVE_HEADER', 'LiveReport', 'live_line']

LIVE_PERIOD = 0.2  # s between live lines

LIVE_HEADER = (
    '   time   separation              point (x, y, z)                 normal (x, y, z)\n'
    '      s           mm                            m                                -'
)


def live_line(time: float, separation: float, point, normal) -> str:
    """One line under `LIVE_HEADER`; time in s, separation in m, point in m, normal a unit vector.

    A negative separation is the depth of the overlap.
    """
    # Adding 0.0 turns a rounded -0.0, which says nothing, into 0.0.
    place = ' '.join(f'{round(float(value), 4) + 0.0:9.4f}' for value in point)
    direction = ' '.join(f'{round(float(value), 5) + 0.0:9.5f}' for value in normal)
    return f'{time:7.2f} {1e3 * separation:+12.3f}   {place}    {direction}'


@dataclass
class _Exchange:
    """One pair of poses and what was answered to it; None is "not received"."""

    pose_a: np.ndarray
    pose_b: np.ndarray
    in_contact: bool | None = None  # the cloud's word
    refused: bool = False  # the cloud says that the pair could not be evaluated
    separation: float = math.nan
    point: np.ndarray | None = None
    normal: np.ndarray | None = None
    point_ns: int = 0
    normal_ns: int = 0

    @property
    def complete(self) -> bool:
        """Whether nothing more can be expected: cloud in, and point and normal if in contact."""
        if self.in_contact is None:
            return self.refused
        return not self.in_contact or (self.point is not None and self.normal is not None)

    @property
    def touched(self) -> bool:
        """Whether point and normal are both in."""
        return self.point is not None and self.normal is not None


@dataclass(frozen=True, kw_only=True)
class CraneSummary:
    """Figures of one run. Lengths in m, latencies in s, angles in degrees; NaN where none exist."""

    sent: int
    evaluated: int
    contacts: int
    lost_evaluations: int
    lost_contacts: int
    not_evaluated: int
    strangers: int
    wrong_verdicts: int
    latency_p50: float
    latency_p99: float
    point_error_median: float
    point_error_p99: float
    normal_error_median: float
    normal_error_p99: float
    edge: float

    @property
    def lost(self) -> int:
        """Messages that should have come and did not."""
        return self.lost_evaluations + self.lost_contacts

    @property
    def passed(self) -> bool:
        """Whether contacts really came through, nothing was lost and no verdict was wrong."""
        faults = self.lost + self.not_evaluated + self.strangers + self.wrong_verdicts
        return self.contacts > 0 and faults == 0

    def __str__(self) -> str:
        """Several lines for people, every figure with its unit."""

        def share(error: float) -> str:
            return f'{1e3 * error:.3g} mm = {100.0 * error / self.edge:.2g} %'

        rows = [
            ('poses sent', f'{self.sent} pairs'),
            ('evaluations received', f'{self.evaluated} clouds'),
            ('contacts received', f'{self.contacts} points with normals'),
            ('messages lost', f'{self.lost} ({self.lost_evaluations} evaluations, '
                              f'{self.lost_contacts} contacts)'),
            ('wrong verdicts', f'{self.wrong_verdicts}'),
        ]
        figures = [
            ('latency', f'p50 {1e3 * self.latency_p50:.3f} ms, p99 {1e3 * self.latency_p99:.3f} ms '
                        '(pose stamp to contact received)'),
            ('point error', f'median {share(self.point_error_median)}, '
                            f'p99 {share(self.point_error_p99)} '
                            f'(of the longest edge, {self.edge:g} m)'),
            ('normal error', f'median {self.normal_error_median:.3g} deg, '
                             f'p99 {self.normal_error_p99:.3g} deg'),
        ]
        rows += figures if self.contacts else []
        if self.not_evaluated:
            rows.append(('pairs not evaluated', f'{self.not_evaluated}'))
        if self.strangers:
            rows.append(('answers to no pose', f'{self.strangers}'))
        return '\n'.join(f'  {name + " ":.<24} {value}' for name, value in rows)


@dataclass
class CraneLog:
    """Everything sent and received, by stamp (ns). One thread may send while another receives."""

    exchanges: dict[int, _Exchange] = field(default_factory=dict)
    offers: set[int] = field(default_factory=set)
    """Stamps (ns) of poses sent before the run, to find out whether anyone answers."""
    offer_answered: bool = False
    strangers: int = 0
    start: int = 0
    """Stamp (ns) of the first pair."""
    latest: int = 0
    """Stamp (ns) of the newest contact of which cloud, point and normal are in; 0 for none."""

    def offered(self, stamp_ns: int) -> None:
        """Note a pair of poses that only asks for an answer and counts in no figure."""
        self.offers.add(stamp_ns)

    def sent(self, stamp_ns: int, pose_a: np.ndarray, pose_b: np.ndarray) -> None:
        """Note a pair of poses (7,) BEFORE it is published, so that no answer can come first."""
        self.start = self.start or stamp_ns
        self.exchanges[stamp_ns] = _Exchange(np.array(pose_a), np.array(pose_b))

    def cloud(self, stamp_ns: int, depths) -> None:
        """Note a cloud by its rows' depths in m: none for no contact, NaN for "not evaluated"."""
        exchange = self._find(stamp_ns)
        if exchange is None:
            self.offer_answered |= stamp_ns in self.offers
            return
        depths = np.asarray(depths, dtype=float)
        if np.isnan(depths).any():
            exchange.refused = True
            return
        exchange.in_contact = depths.size > 0
        if exchange.in_contact:
            exchange.separation = -float(depths[0])
        self._renew(stamp_ns, exchange)

    def point(self, stamp_ns: int, point, received_ns: int) -> None:
        """Note the point of a contact, (3,) in m, and when it arrived."""
        if (exchange := self._find(stamp_ns)) is not None:
            exchange.point, exchange.point_ns = np.array(point, dtype=float), received_ns
            self._renew(stamp_ns, exchange)

    def normal(self, stamp_ns: int, normal, received_ns: int) -> None:
        """Note the normal of a contact, a unit vector (3,) from A to B, and when it arrived."""
        if (exchange := self._find(stamp_ns)) is not None:
            exchange.normal, exchange.normal_ns = np.array(normal, dtype=float), received_ns
            self._renew(stamp_ns, exchange)

    def complete(self) -> bool:
        """Whether every pair sent so far is answered in full."""
        return all(exchange.complete for exchange in list(self.exchanges.values()))

    def summary(self, solver, edge: float) -> CraneSummary:
        """Match answers to poses and measure them.

        solver -- reference with `batch(poses_a, poses_b)` -> colliding, separation, normal, point
        edge   -- longest edge of the smaller box, m: what the point error is a share of
        """
        exchanges = list(self.exchanges.items())
        answered = [exchange for _, exchange in exchanges if exchange.in_contact is not None]
        touching = [(stamp, exchange) for stamp, exchange in exchanges if exchange.touched]
        latencies = np.array(
            [max(e.point_ns, e.normal_ns) - stamp for stamp, e in touching], dtype=float) * 1e-9

        refused = sum(exchange.refused for _, exchange in exchanges)
        verdicts = np.array([e.in_contact for e in answered], dtype=bool)
        wrong = np.count_nonzero(_reference(solver, answered)[0] != verdicts)
        both = [exchange for _, exchange in touching]
        real, points, normals = _reference(solver, both)
        # A point where the reference has no contact has no error to measure. It is a wrong verdict,
        # counted above already if the cloud says contact too.
        wrong += np.count_nonzero(~real & ~np.array([bool(e.in_contact) for e in both], dtype=bool))
        received_points = np.array([e.point for e in both]).reshape(-1, 3)[real]
        received_normals = np.array([e.normal for e in both]).reshape(-1, 3)[real]
        point_errors = np.linalg.norm(received_points - points[real], axis=1)
        normal_errors = angles(received_normals, normals[real])
        return CraneSummary(
            sent=len(exchanges),
            evaluated=len(answered),
            contacts=len(touching),
            lost_evaluations=len(exchanges) - len(answered) - refused,
            lost_contacts=sum(bool(e.in_contact) and not e.touched for e in answered),
            not_evaluated=refused,
            strangers=self.strangers,
            wrong_verdicts=int(wrong),
            latency_p50=percentile(latencies, 50.0),
            latency_p99=percentile(latencies, 99.0),
            point_error_median=percentile(point_errors, 50.0),
            point_error_p99=percentile(point_errors, 99.0),
            normal_error_median=percentile(normal_errors, 50.0),
            normal_error_p99=percentile(normal_errors, 99.0),
            edge=edge,
        )

    def _find(self, stamp_ns: int) -> _Exchange | None:
        exchange = self.exchanges.get(stamp_ns)
        if exchange is None and stamp_ns not in self.offers:
            self.strangers += 1
        return exchange

    def _renew(self, stamp_ns: int, exchange: _Exchange) -> None:
        if exchange.in_contact and exchange.touched:
            self.latest = max(self.latest, stamp_ns)


class LiveReport:
    """Prints the newest contact, at most every `LIVE_PERIOD` seconds and only if it is new."""

    def __init__(self, log: CraneLog) -> None:
        """Report from `log`."""
        self._log, self._shown, self._next = log, 0, 0.0

    def update(self) -> None:
        """Print a line if one is due, and the header before the first."""
        stamp = self._log.latest
        if stamp <= self._shown or time.monotonic() < self._next:
            return
        if not self._shown:
            print(LIVE_HEADER)
        self._shown, self._next = stamp, time.monotonic() + LIVE_PERIOD
        contact = self._log.exchanges[stamp]
        # Flushed, because a reader of a pipe wants it live as well.
        time_s = (stamp - self._log.start) * 1e-9
        print(live_line(time_s, contact.separation, contact.point, contact.normal), flush=True)


def _reference(solver, exchanges: list[_Exchange]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Verdicts (n,), points (n, 3) and normals (n, 3) of the reference solver; n may be 0."""
    if not exchanges:
        return np.zeros(0, dtype=bool), np.zeros((0, 3)), np.zeros((0, 3))
    truth = solver.batch(
        np.array([e.pose_a for e in exchanges]), np.array([e.pose_b for e in exchanges])
    )
    return np.asarray(truth.colliding), np.asarray(truth.point), np.asarray(truth.normal)

"""What the view hears, and the figures it shows of it; works without a ROS graph.

Poses are paired as the contact node pairs them; a cloud belongs to the pair with its stamp. The
view listens in from outside, so both may come in any order, and a pose that only the view has
missed must not count as a loss. Stamps are nanoseconds; lengths metres, latencies seconds.
"""
from __future__ import annotations

import math
import threading
from collections import OrderedDict, deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...node.messages import NANOSECONDS
from ...scene.pairing import PAIRINGS, StampedPose
from ...scene.scene_solver import two_boxes
from ...solver.contact import Contact
from ...solver.contact_solver import ContactSolver
from ..percentiles import percentile
from .style import STALE

WINDOW = 2.0
"""Figures are those of the answers to the poses of the last so many seconds."""
LOST_AFTER = NANOSECONDS
"""A pair without an answer is lost once a pair that is so much newer [ns] has come."""
KEPT = 20_000
"""Answers kept at most, whatever their stamps: `WINDOW` at 10 kHz."""

Poses = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Answer:
    """A pair of poses (7,) and the contact that the node answered with."""

    stamp: int
    received: int
    poses: Poses
    point: np.ndarray | None
    """(3,); None for no contact, and so are normal and depth."""
    normal: np.ndarray | None
    depth: float | None

    @property
    def latency(self) -> float:
        """From the poses' stamp to the cloud."""
        return (self.received - self.stamp) * 1e-9


class Scene(NamedTuple):
    """What is drawn: poses (7,), the answer to them, the exact contact beside it."""

    poses: Poses
    answer: Answer | None
    """None if nobody answers."""
    exact: Contact


@dataclass(frozen=True, kw_only=True)
class Figures:
    """Of the answers to the poses of the last `WINDOW`; NaN where there is nothing to measure."""

    latency_median: float
    latency_p99: float
    point_error_median: float
    point_error_p99: float
    edge: float
    """Longest edge of the smaller box, what point errors are a share of."""
    rate: float
    """Answers that came within the last second."""
    answered: int
    """Since the start of the run, and so are the lost."""
    lost: int


class ViewLog:
    """Takes what comes in one thread; `figures` may be asked for in another."""

    def __init__(self, size_a: Sequence[float], size_b: Sequence[float], pairing: str) -> None:
        """For boxes of these full extents [m], and a contact node of this `pairing`."""
        self._exact = ContactSolver(size_a, size_b, model='exact')
        self._edge = min(max(size_a), max(size_b))
        self._scene = two_boxes(size_a, size_b)
        self._new_pairing = PAIRINGS[pairing]
        self._lock = threading.Lock()
        self.start_anew()

    def start_anew(self) -> None:
        """Forget everything: another run begins."""
        with self._lock:
            self._pairing = self._new_pairing(self._scene)
            self._pairs: OrderedDict[int, Poses] = OrderedDict()  # not answered yet
            self._clouds: OrderedDict[int, tuple[np.ndarray, int]] = OrderedDict()  # no pair yet
            self._answers: deque[Answer] = deque(maxlen=KEPT)
            self._newest: tuple[int, Poses] | None = None
            self._answered = self._lost = 0

    def pose(self, box: int, stamp: int, numbers: np.ndarray) -> None:
        """A pose of box 0 (A) or 1 (B), as numbers (7,)."""
        with self._lock:
            for tick in self._pairing.add(self._scene.moving[box],
                                          StampedPose(numbers, '', stamp)):
                if all(pose is not None for pose in tick):
                    self._take(max(pose.stamp for pose in tick),
                               tuple(pose.numbers for pose in tick))

    def _take(self, stamp: int, poses: Poses) -> None:
        if self._newest is None or stamp >= self._newest[0]:
            self._newest = stamp, poses
        early = self._clouds.pop(stamp, None)
        if early is not None:
            self._answer(stamp, poses, *early)
        else:
            self._pairs[stamp] = poses
        self._give_up(stamp)

    def cloud(self, stamp: int, rows: np.ndarray, received: int) -> None:
        """The rows (messages.CLOUD_ROW) of a `contacts` cloud, received at this time [ns].

        A row of NaN says that the pair could not be evaluated, which is an answer without contact.
        """
        with self._lock:
            poses = self._pairs.pop(stamp, None)
            if poses is None:
                self._clouds[stamp] = rows, received
            else:
                self._answer(stamp, poses, rows, received)

    def _answer(self, stamp: int, poses: Poses, rows: np.ndarray, received: int) -> None:
        contact: tuple = (None, None, None)
        if len(rows) and math.isfinite(rows[0]['depth']):
            x, y, z, nx, ny, nz, depth = (float(rows[0][name]) for name in (
                'x', 'y', 'z', 'normal_x', 'normal_y', 'normal_z', 'depth'))
            contact = np.array([x, y, z]), np.array([nx, ny, nz]), depth
        if not self._answered:
            self._first = stamp
        self._answers.append(Answer(stamp, received, poses, *contact))
        self._answered += 1

    def _give_up(self, now: int) -> None:
        """Drop what is too old by the poses' clock [ns]."""
        while self._pairs and now - next(iter(self._pairs)) > LOST_AFTER:
            stamp, _ = self._pairs.popitem(last=False)
            # Before the first answer nobody need have been there.
            self._lost += bool(self._answered and stamp > self._first)
        while self._clouds and now - next(iter(self._clouds)) > LOST_AFTER:
            self._clouds.popitem(last=False)
        while self._answers and now - self._answers[0].stamp > WINDOW * NANOSECONDS:
            self._answers.popleft()

    def scene(self) -> Scene | None:
        """The last answer with its poses; the last poses if nobody answers; None before them."""
        with self._lock:
            if self._newest is None:
                return None
            stamp, poses = self._newest
            answer = self._answers[-1] if self._answers else None
        if answer is not None and stamp - answer.stamp > STALE:
            answer = None
        if answer is not None:
            poses = answer.poses
        return Scene(poses, answer, self._exact(*poses))

    def figures(self, now: int) -> Figures:
        """As things stand at this time [ns], of the clock of `cloud`."""
        with self._lock:
            answers, answered, lost = list(self._answers), self._answered, self._lost
        latencies = np.array([answer.latency for answer in answers])
        errors = self._point_errors(answers)
        return Figures(
            latency_median=percentile(latencies, 50.0), latency_p99=percentile(latencies, 99.0),
            point_error_median=percentile(errors, 50.0),
            point_error_p99=percentile(errors, 99.0), edge=self._edge,
            rate=sum(now - answer.received < NANOSECONDS for answer in answers),
            answered=answered, lost=lost)

    def _point_errors(self, answers: Sequence[Answer]) -> np.ndarray:
        """Distances (n,) of the points from the exact ones, where both say contact."""
        touching = [answer for answer in answers if answer.point is not None]
        if not touching:
            return np.zeros(0)
        exact = self._exact.batch(*(np.array([answer.poses[box] for answer in touching])
                                    for box in (0, 1)))
        errors = np.linalg.norm(np.array([a.point for a in touching]) - exact.point, axis=1)
        return errors[exact.colliding]

"""What the view hears, and the figures it shows of it; works without a ROS graph.

Poses are paired as the contact node pairs them; a cloud belongs to the pair with its stamp. The
view listens in from outside, so both may come in any order. A pose that only the view has missed
must not count as a loss. Stamps are nanoseconds; lengths metres, latencies seconds.
"""
from __future__ import annotations

import threading
from collections import OrderedDict, deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...node.messages import NANOSECONDS
from ...output import percentiles
from ...scene.force.patch_law import Patch
from ...scene.scene_solver import two_boxes
from ...scene.stamp_pairing import PAIRINGS, StampedPose
from ...solver.contact import Contact
from ...solver.contact_solver import ContactSolver
from ..bench.answer_log import first_row, touch_in
from .style import STALE

WINDOW = 2.0  # figures are those of the answers to the poses of the last so many seconds
LOST_AFTER = NANOSECONDS
"""A pair without an answer is lost once a pair that is so much newer [ns] has come."""
KEPT = 20_000  # answers kept at most, whatever their stamps: `WINDOW` at 10 kHz

Poses = tuple[np.ndarray, np.ndarray]


@dataclass(frozen=True)
class AnsweredPair:
    """A pair of poses (7,) and the contact that the node answered with."""

    stamp: int
    received: int
    poses: Poses
    touch: Patch | None  # None for no contact

    @property
    def latency(self) -> float:
        """Time from the poses' stamp to the cloud."""
        return (self.received - self.stamp) * 1e-9


class Snapshot(NamedTuple):
    """What is drawn: poses (7,), the answer to them, and their exact contact."""

    poses: Poses
    answer: AnsweredPair | None  # none if nobody answers
    exact: Contact


@dataclass(frozen=True, kw_only=True)
class ViewFigures:
    """Figures of the answers to the poses of the last `WINDOW`; NaN where there are none."""

    latency_median: float
    latency_p99: float
    point_error_median: float
    point_error_p99: float
    edge: float  # longest edge of the smaller box, what point errors are a share of
    rate: float  # answers that came within the last second
    answered: int  # since the start of the run, and so are the lost
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
            self._answers: deque[AnsweredPair] = deque(maxlen=KEPT)
            self._newest: tuple[int, Poses] | None = None
            self._answered = self._lost = 0

    def pose(self, box: int, stamp: int, numbers: np.ndarray) -> None:
        """Take a pose of box 0 (A) or 1 (B), as numbers (7,)."""
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
        """Take the rows (messages.CLOUD_ROW) of a `contacts` cloud, received at this time [ns].

        A row of NaN says that the pair could not be evaluated, which is an answer without contact.
        """
        with self._lock:
            poses = self._pairs.pop(stamp, None)
            if poses is None:
                self._clouds[stamp] = rows, received
            else:
                self._answer(stamp, poses, rows, received)

    def _answer(self, stamp: int, poses: Poses, rows: np.ndarray, received: int) -> None:
        if not self._answered:
            self._first = stamp
        self._answers.append(AnsweredPair(stamp, received, poses, touch_in(first_row(rows))))
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

    def snapshot(self) -> Snapshot | None:
        """Return the last answer with its poses, or the last poses if nobody answers."""
        with self._lock:
            if self._newest is None:
                return None
            stamp, poses = self._newest
            answer = self._answers[-1] if self._answers else None
        if answer is not None and stamp - answer.stamp > STALE:
            answer = None
        if answer is not None:
            poses = answer.poses
        return Snapshot(poses, answer, self._exact(*poses))

    def figures(self, now: int) -> ViewFigures:
        """Return the figures as things stand at this time [ns], of the clock of `cloud`."""
        with self._lock:
            answers, answered, lost = list(self._answers), self._answered, self._lost
        latencies = np.array([answer.latency for answer in answers])
        errors = self._point_errors(answers)
        median, p99 = percentiles(latencies, 50, 99)
        error_median, error_p99 = percentiles(errors, 50, 99)
        return ViewFigures(
            latency_median=median, latency_p99=p99, point_error_median=error_median,
            point_error_p99=error_p99, edge=self._edge,
            rate=sum(now - answer.received < NANOSECONDS for answer in answers),
            answered=answered, lost=lost)

    def _point_errors(self, answers: Sequence[AnsweredPair]) -> np.ndarray:
        """Return distances (n,) of points from the exact ones, where both report a contact."""
        touching = [(*answer.poses, answer.touch.point) for answer in answers if answer.touch]
        if not touching:
            return np.zeros(0)
        poses_a, poses_b, points = map(np.array, zip(*touching))
        exact = self._exact.batch(poses_a, poses_b)
        return np.linalg.norm(points - exact.point, axis=1)[exact.colliding]

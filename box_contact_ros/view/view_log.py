# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is drawn of a scene, and the figures shown of it, whether ROS or a recording fills it.

A `ViewLog` takes poses by box and the contacts of each tick. Its `snapshot` is the one model of
what is drawn. Page and markers read it. A tick's poses are the last of each box up to its stamp.

The view listens in from outside. Messages may come in any order, and only the view may have missed
one: that must not count as a loss. Stamps are nanoseconds; lengths metres, latencies seconds.
"""
from __future__ import annotations

import math
import threading
from collections import OrderedDict, deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..core import LENGTH_MAX
from ..node.messages import CLOUD_ROW, NANOSECONDS, PATCH_FIELDS, Refused
from ..output import percentiles
from ..scene.scene_solver import Scene
from ..scene.stamp_pairing import RESET
from ..solver.contact import Contacts
from ..solver.contact_solver import ContactSolver
from .style import STALE, patch_axes

WINDOW = 2.0  # figures are those of the answers to the poses of the last so many seconds
LOST_AFTER = NANOSECONDS
"""A tick without an answer is lost once a tick that is so much newer [ns] has come."""
ANSWERED = -math.inf  # in place of the number of a tick's poses: however many come, none is lost
KEPT = 20_000  # answers, and poses of a box, kept at most, whatever their stamps: 10 kHz
KEPT_POSES = 200_000  # of all boxes together, some 50 MB
KEPT_ROWS = 500_000  # of all answers together: contacts, and the poses that they answer
LARGEST = {'normal': 1.0 + 1e-6, 'cov': LENGTH_MAX**2, 'volume': LENGTH_MAX**3}
"""Of numbers of a contact, by the beginnings of their names; LENGTH_MAX for lengths."""


class SceneArrays:
    """A scene as arrays: a row a box, a row a pair, each in the scene's order."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.names = list(scene.boxes)
        numbers = {name: number for number, name in enumerate(self.names)}
        self.sizes = np.array([box.size for box in scene.boxes.values()], dtype=float)
        self.fixed = np.array([box.pose or [np.nan] * 7 for box in scene.boxes.values()])
        """Poses (n, 7), NaN for boxes that move and are not fixed by `ViewLog.fix`."""
        self.moves = np.isnan(self.fixed[:, 0])
        self.moving = {name: numbers[name] for name in scene.moving}
        self.first = np.array([numbers[pair.a] for pair in scene.pairs])
        self.second = np.array([numbers[pair.b] for pair in scene.pairs])
        self.labels = [pair.name or f'{pair.a}, {pair.b}' for pair in scene.pairs]
        self.row_of_id = {pair.id: row for row, pair in enumerate(scene.pairs)}
        self.is_a = np.isin(np.arange(len(self.names)), self.first)
        """Which boxes (n,) are box a of a pair: normals point away from them."""
        longest = self.sizes.max(axis=1)
        self.edges = np.minimum(longest[self.first], longest[self.second])
        """Longest edge of each pair's smaller box, what errors are a share of."""
        self._exact = ContactSolver(self.sizes[0], self.sizes[0], model='exact')

    def with_poses(self, poses: np.ndarray, pairs: np.ndarray) -> np.ndarray:
        """Return where in `pairs`, rows of pairs, are those whose boxes have poses (n, 7)."""
        known = ~np.isnan(poses[:, 0])
        return np.flatnonzero(known[self.first[pairs]] & known[self.second[pairs]])

    def exact(self, poses: np.ndarray, pairs: np.ndarray) -> Contacts:
        """Return the exact contacts of some pairs, by their rows, under poses (n, 7)."""
        first, second = self.first[pairs], self.second[pairs]
        return self._exact.batch(poses[first], poses[second], size_a=self.sizes[first],
                                 size_b=self.sizes[second])


@dataclass(frozen=True, eq=False)
class AnsweredTick:
    """The contacts of a tick, and the poses that they answer."""

    scene: SceneArrays
    stamp: int
    received: int
    frame_id: str
    contacts: np.ndarray  # rows (messages.CLOUD_ROW) of the pairs in contact
    pairs: np.ndarray  # which pair each contact is of: its row in the scene
    stale: np.ndarray  # rows of the pairs that could not be evaluated
    poses: np.ndarray  # (n, 7), NaN for a box that has none
    stamps: np.ndarray  # (n,) of the poses; that of the tick for fixed boxes
    tolerance: int  # poses further from the tick [ns] may not be those that were answered

    @property
    def rows(self) -> int:
        """Return how much memory it takes."""
        return len(self.contacts) + len(self.stale) + len(self.poses)

    @property
    def latency(self) -> float:
        """Time from the poses' stamp to the contacts."""
        return (self.received - self.stamp) * 1e-9

    @property
    def points(self) -> np.ndarray:
        """Return where the contacts are, (k, 3)."""
        return _columns(self.contacts, 'point_x', 'point_y', 'point_z')

    @property
    def normals(self) -> np.ndarray:
        """Return unit vectors (k, 3) from a to b."""
        return _columns(self.contacts, 'normal_x', 'normal_y', 'normal_z')

    @property
    def covariances(self) -> np.ndarray:
        """Second moments (k, 3, 3) of the patches; NaN from models that give the point alone."""
        columns = _columns(self.contacts, 'cov_xx', 'cov_xy', 'cov_xz', 'cov_yy', 'cov_yz',
                           'cov_zz')
        return columns[:, [[0, 1, 2], [1, 3, 4], [2, 4, 5]]]

    @cached_property
    def semi_axes(self) -> np.ndarray:
        """Semi-axes (k, 2, 3) of the patches' ellipses: see `style.patch_axes`."""
        return patch_axes(self.normals, self.covariances)

    @property
    def deepest(self) -> np.ndarray:
        """Rows of `contacts`, the deepest first."""
        return np.argsort(-self.contacts['depth'], kind='stable')

    @cached_property
    def exact_points(self) -> np.ndarray:
        """Exact contact points (k, 3), NaN where the boxes do not touch or have no pose."""
        points = np.full((len(self.pairs), 3), np.nan)
        rows = self.scene.with_poses(self.poses, self.pairs)
        points[rows] = self.scene.exact(self.poses, self.pairs[rows]).point
        return points

    @cached_property
    def point_errors(self) -> np.ndarray:
        """Distances of points from the exact ones, of those pairs whose poses are the tick's."""
        late = np.abs(self.stamps - self.stamp) > self.tolerance
        rows = ~(late[self.scene.first[self.pairs]] | late[self.scene.second[self.pairs]])
        errors: np.ndarray = np.linalg.norm(self.points - self.exact_points, axis=1)
        return errors[rows & ~np.isnan(errors)]


def _columns(rows: np.ndarray, *names: str) -> np.ndarray:
    return np.stack([rows[name] for name in names], axis=-1)


@dataclass(frozen=True, eq=False)
class Snapshot:
    """What is drawn: every box with its pose, and the last answer."""

    scene: SceneArrays
    stamp: int
    frame_id: str
    poses: np.ndarray  # (n, 7), NaN for a box that has none
    answer: AnsweredTick | None  # None if nobody answers

    @cached_property
    def stale_boxes(self) -> np.ndarray:
        """Which boxes (n,) keep a pair from being evaluated: of its two the one not heard of."""
        stale = np.zeros(len(self.poses), dtype=bool)
        if self.answer is not None:
            rows = self.answer.stale
            ends = np.stack([self.scene.first[rows], self.scene.second[rows]])
            stamps = self.answer.stamps[ends]
            stale[ends[stamps == stamps.min(axis=0)]] = True
        return stale & self.scene.moves

    @cached_property
    def separation(self) -> float:
        """Return the least exact separation of all pairs that have poses; NaN without any."""
        pairs = self.scene.with_poses(self.poses, np.arange(len(self.scene.labels)))
        if not len(pairs):
            return np.nan
        return float(self.scene.exact(self.poses, pairs).separation.min())


@dataclass(frozen=True, kw_only=True)
class ViewFigures:
    """Figures of the answers to the poses of the last `WINDOW`; NaN where there are none."""

    latency_median: float
    latency_p99: float
    point_error_median: float
    point_error_p99: float
    edge: float  # median of `SceneArrays.edges`, what point errors are a share of
    rate: float  # answers that came within the last second
    answered: int  # since the start of the run, and so are the lost and the refused
    lost: int
    refused: int


def _fault(rows: np.ndarray, pairs: int) -> str:
    """Return what is wrong with the contacts of a scene of so many pairs, or ''."""
    if len(rows) > pairs:
        return f'{len(rows)} contacts, but the scene has {pairs} pairs'
    rows = rows[~np.isnan(rows['depth'])]
    for name in CLOUD_ROW.names or ():
        if CLOUD_ROW[name].kind == 'f' and name not in 'xyz':
            largest = LARGEST.get(name.partition('_')[0], LENGTH_MAX)
            good = np.abs(rows[name]) <= largest
            if name in PATCH_FIELDS:  # models that give the point alone
                good |= np.isnan(rows[name])
            if not good.all():
                return f'{name} is {rows[name][~good][0]:g}'
    return ''


class OtherSceneError(ValueError):
    """Contacts of a pair that the scene does not have."""


class ViewLog:
    """Takes what comes in one thread; `snapshot` and `figures` may be asked for in another."""

    def __init__(self, scene: Scene, *, pairing: str = 'stamp', tolerance: float = 0.0) -> None:
        """Begin for a scene, and for a contact node of this `pairing` and `tolerance` [s]."""
        self.scene = SceneArrays(scene)
        self._tolerance = (round(tolerance * NANOSECONDS) if pairing == 'stamp'
                           else WINDOW * NANOSECONDS)
        self._lock = threading.RLock()
        self.start_anew()

    def start_anew(self) -> None:
        """Forget everything: another run begins."""
        with self._lock:
            self._tracks: dict[str, deque[tuple[int, np.ndarray]]] = {
                name: self._track() for name, number in self.scene.moving.items()
                if np.isnan(self.scene.fixed[number, 0])}
            self._newest = self._frame_id = None
            self._ahead: tuple[str, int] | None = None  # a box far ahead alone, and since when
            self._counts: OrderedDict[int, float] = OrderedDict()  # poses by stamp, or ANSWERED
            self._answers: deque[AnsweredTick] = deque()
            self._answered = self._lost = self._refused = self._rows = 0

    def _track(self) -> deque[tuple[int, np.ndarray]]:
        return deque(maxlen=min(KEPT, 1 + KEPT_POSES // len(self.scene.moving)))

    def pose(self, box: str, stamp: int, numbers: np.ndarray, frame_id: str = '') -> None:
        """Take where a moving box is: numbers (7,)."""
        self.poses((box,), stamp, numbers[None], frame_id)

    def fix(self, box: str, numbers: np.ndarray) -> None:
        """Take where a moving box is at all stamps: numbers (7,)."""
        with self._lock:
            self._tracks.pop(box, None)
            self.scene.fixed[self.scene.moving[box]] = numbers

    def poses(self, boxes: Sequence[str], stamp: int, numbers: np.ndarray, frame_id: str = '',
              ) -> None:
        """Take where moving boxes are: numbers (n, 7), NaN for a box that is not there."""
        with self._lock:
            for box in boxes:
                if box not in self._tracks:  # fixed so far
                    self._tracks[box] = self._track()
                    self.scene.fixed[self.scene.moving[box]] = np.nan
            if len(boxes) == 1 and self._is_ahead(boxes[0], stamp):
                self._refused += 1
                return
            if any(track and stamp < track[-1][0] - RESET
                   for track in map(self._tracks.__getitem__, boxes)):
                self.start_anew()
            for box, row, absent in zip(boxes, numbers, np.isnan(numbers[:, 0]).tolist()):
                if not absent:
                    track = self._tracks[box]
                    track.append((stamp, row))
                    while stamp - track[0][0] > WINDOW * NANOSECONDS:
                        track.popleft()
            if (self._newest is None or stamp > self._newest
                    or stamp < self._newest - RESET and self._boxes_near(stamp) > max(
                        1, self._boxes_near(self._newest))):  # that one was ahead
                self._newest, self._frame_id = stamp, frame_id
            self._counts[stamp] = self._counts.get(stamp, 0) + len(boxes)
            self._give_up(self._newest)

    def _is_ahead(self, box: str, stamp: int) -> bool:
        """Return whether a box is far ahead of the others, and they still give poses."""
        far = self._newest is not None and stamp > self._newest + RESET
        if not far or len(self._tracks) < 3:
            self._ahead = None
            return False
        other, since = self._ahead or (box, stamp)
        self._ahead = box, since if other == box else stamp
        # Another box is as far: all have paused. Or it goes on alone.
        return (abs(stamp - since) <= RESET) == (other == box)

    def _boxes_near(self, stamp: int) -> int:
        """Return how many boxes gave a last pose within a second of a stamp."""
        return sum(bool(track) and abs(track[-1][0] - stamp) <= RESET
                   for track in self._tracks.values())

    def contacts(self, stamp: int, rows: np.ndarray, received: int, frame_id: str = '') -> None:
        """Take what a tick found: rows of messages.CLOUD_ROW, received at this time [ns].

        A row of NaN says that its pair could not be evaluated. Pairs that are close, without a
        point, are left out. Raises OtherSceneError, and Refused for what no contact can be.
        """
        rows = rows[~np.isnan(rows['point_x']) | np.isnan(rows['depth'])]
        fault = _fault(rows, len(self.scene.labels))
        if fault:
            with self._lock:
                self._refused += 1
            raise Refused('bad contacts', fault)
        try:
            pairs = np.array([self.scene.row_of_id[number] for number in rows['pair'].tolist()],
                             dtype=int)
        except KeyError as error:
            raise OtherSceneError(f'the contacts have pair {error}, which the scene that is drawn '
                                  'has not: not drawn') from error
        stale = np.isnan(rows['depth'])
        with self._lock:
            self._refreshed_answer()
            if self._newest is None or stamp <= self._newest + LOST_AFTER:  # of the poses' clock
                self._counts[stamp] = ANSWERED
            if not self._answered:
                self._first = stamp
            self._answered += 1
            self._answers.append(AnsweredTick(
                self.scene, stamp, received, frame_id, rows[~stale], pairs[~stale], pairs[stale],
                *self._poses_at(stamp), self._tolerance))
            self._rows += self._answers[-1].rows
            self._give_up(self._newest or stamp)

    def _refreshed_answer(self) -> AnsweredTick | None:
        """Give the last answer its poses as they are known now: some may come after it."""
        if not self._answers:
            return None
        answer = self._answers.pop()
        poses, stamps = self._poses_at(answer.stamp)
        self._answers.append(replace(answer, poses=poses, stamps=stamps))
        return self._answers[-1]

    def _poses_at(self, stamp: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the last pose (n, 7) of each box up to a stamp, and their stamps (n,)."""
        poses = self.scene.fixed.copy()
        stamps = np.full(len(poses), stamp)
        for name, track in self._tracks.items():
            number = self.scene.moving[name]
            stamps[number] = 0
            for at, numbers in reversed(track):
                stamps[number], poses[number] = at, numbers
                if at <= stamp:
                    break
        return poses, stamps

    def _give_up(self, now: int) -> None:
        """Drop what is too old by the poses' clock [ns]."""
        while self._counts and (now - next(iter(self._counts)) > LOST_AFTER
                                or len(self._counts) > KEPT):
            stamp, count = self._counts.popitem(last=False)
            # Before the first answer nobody need have been there.
            self._lost += bool(count >= len(self._tracks) and self._answered
                               and stamp > self._first)
        while self._answers and (now - self._answers[0].stamp > WINDOW * NANOSECONDS
                                 or len(self._answers) > KEPT or self._rows > KEPT_ROWS):
            self._rows -= self._answers.popleft().rows

    def snapshot(self) -> Snapshot | None:
        """Return the last answer with its poses, or the last poses if nobody answers."""
        with self._lock:
            if self._newest is None:
                return None
            newest, frame_id = self._newest, self._frame_id
            answer = self._refreshed_answer()
            if answer is not None and newest - answer.stamp <= STALE:
                return Snapshot(self.scene, answer.stamp, answer.frame_id, answer.poses, answer)
            return Snapshot(self.scene, newest, frame_id, self._poses_at(newest)[0], None)

    def figures(self, now: int) -> ViewFigures:
        """Return the figures as things stand at this time [ns], of the clock of `contacts`."""
        with self._lock:
            self._refreshed_answer()
            answers, refused = list(self._answers), self._refused
            answered, lost = self._answered, self._lost
        median, p99 = percentiles(np.array([answer.latency for answer in answers]), 50, 99)
        errors = np.concatenate([np.zeros(0), *(answer.point_errors for answer in answers)])
        error_median, error_p99 = percentiles(errors, 50, 99)
        return ViewFigures(
            latency_median=median, latency_p99=p99, point_error_median=error_median,
            point_error_p99=error_p99, edge=float(np.median(self.scene.edges)),
            rate=sum(now - answer.received < NANOSECONDS for answer in answers),
            answered=answered, lost=lost, refused=refused)

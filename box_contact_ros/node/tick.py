# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""One way for every tick: bytes → pose → tick of all boxes → contacts → messages.

`read_pose` reads and judges a pose, and `Pairing` joins poses to ticks. `TickWriter` answers a tick
with the bytes of messages, in one call of the core.
"""
from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping
from functools import partial
from itertools import compress
from random import randrange
from typing import Any

import numpy as np

from ..scene.boxes import NOWHERE
from ..scene.scene_check import Pose, Row
from ..scene.scene_solver import SceneSolver
from ..solver.checks import absent_poses, are_poses, pose_fault
from ..stream.cdr import NANOSECONDS, MessageError
from ..stream.pairing import OVERTAKEN, PAIRINGS, Pairing, StampedPose, TickPoses
from ..stream.read_poses import NamedPoses, read_pose
from ..stream.streams import ALL_BOXES
from ..stream.write_contacts import TickWriter
from .diagnostics import TickMonitor
from .parameters import reason_of
from .topics import PoseCallback, SceneTopics


class PoseQueue:
    """What is lost of a stream of poses, and which of those that come are old.

    A full queue pushes its oldest pose out. EventsExecutor still has an event for it, and timers
    and services come behind all events. In a node that is too slow, they would wait ever longer.
    So poses that wait when a loss shows are dropped. That takes no time, and empties both queues.
    Each publisher numbers its own poses. While there are several, losses are unknown.
    """

    def __init__(self, publisher_count: Callable[[], int]) -> None:
        """Begin before the first pose; publisher_count: how many publish the stream now."""
        self._publisher_count = publisher_count
        self._sequence: int | None = None  # number that the publisher gave the last pose
        self._arrived = self._new_from = 0  # by the wall clock [ns]
        self._lost: int | None = 0  # None: numbers of several publishers did not follow
        self._has_several = False  # publishers, from a number that does not follow to a report
        self._turns = 0  # how often numbers went back meanwhile

    def is_overtaken(self, sequence: int | None, arrived: int) -> bool:
        """Return whether newer poses wait, by a pose's number and its time of arrival [ns].

        A middleware without numbers gives None.
        """
        if sequence is None:
            return False
        if self._sequence is not None and sequence != self._sequence + 1:
            self._jumped(sequence - self._sequence, arrived)
        if arrived < self._arrived:  # the wall clock was set back
            self._new_from = 0
        self._sequence, self._arrived = sequence, arrived
        return arrived < self._new_from

    def _jumped(self, periods: int, arrived: int) -> None:
        """Note a number that does not follow the last: of another publisher, or after a loss."""
        self._has_several = self._has_several or self._publisher_count() > 1
        if self._has_several:
            self._turns += periods <= 0
            self._lost = None
        elif periods > 0:
            self._lost = None if self._lost is None else self._lost + periods - 1
            now = time.time_ns()
            if (now - arrived) * periods > 2 * (arrived - self._arrived):  # not lost on the way
                self._new_from = now

    def restart(self) -> None:
        """Begin before the next pose: those that come while nobody asks for any are not lost."""
        self._sequence = None

    def take_lost(self) -> int | None:
        """Return how many poses never came since the last call; None: nobody knows."""
        if self._has_several and self._publisher_count() < 2:
            self._has_several, self._turns = False, 0
            self.restart()
        lost, self._lost = self._lost, 0
        return lost

    @property
    def is_shared(self) -> bool:
        """Return whether publishers take turns; numbers go back once where one is started anew."""
        return self._turns > 1


class LastPoses:
    """The last pose of each box and body that moves, in messages of one or of all of them."""

    def __init__(self) -> None:
        self._single: dict[str, tuple[int, Row]] = {}  # stamp [ns] and pose, by name
        self._names: tuple[str, ...] = ()
        self._stamps, self._rows = np.zeros(0, np.int64), np.zeros((0, 7))  # of these names
        self._newest = 0  # stamp of the last message

    def forget(self) -> None:
        """Forget all poses."""
        self._single.clear()
        self._names, self._stamps, self._rows = (), np.zeros(0, np.int64), np.zeros((0, 7))

    def take(self, name: str, pose: StampedPose) -> None:
        """Note the pose of one name."""
        self._single[name] = pose.stamp, pose.numbers
        self._newest = pose.stamp

    def take_all(self, names: tuple[str, ...], poses: StampedPose, missing: np.ndarray) -> None:
        """Note the poses (n, 7) of n names but for the rows that are missing (k,)."""
        rows, stamps = poses.numbers, np.full(len(names), poses.stamp)
        if len(missing):
            known = {name: row for row, name in enumerate(self._names)}
            former = np.array([known.get(names[row], -1) for row in missing.tolist()], np.int64)
            rows = rows.copy()
            rows[missing] = np.vstack((self._rows, NOWHERE))[former]
            stamps[missing] = np.append(self._stamps, 0)[former]
        self._names, self._stamps, self._rows, self._newest = names, stamps, rows, poses.stamp

    def within(self, max_age: int) -> dict[str, Pose]:
        """Return the poses by name whose stamps are within max_age [ns] of the newest; 0: all."""
        most = max_age or np.iinfo(np.int64).max
        is_known = ~np.isnan(self._rows[:, 0]) & (np.abs(self._newest - self._stamps) <= most)
        known = dict(zip(compress(self._names, is_known), self._rows[is_known]))
        return {**known, **{name: pose for name, (stamp, pose) in self._single.items()
                            if abs(self._newest - stamp) <= most}}


class TickAnswerer:
    """Answers ticks of poses; every pose that is refused is counted and noted, never answered.

    active: poses that arrive while the node is not active are dropped.
    after: is called when a tick was answered, and the next one is still far.
    """

    def __init__(self, solver: SceneSolver, topics: SceneTopics, settings: Mapping[str, Any],
                 counts: Counter[str], monitor: TickMonitor) -> None:
        """Begin without poses; `settings` are the checked parameters."""
        self._topics, self._monitor, self._counts = topics, monitor, counts
        self.epoch = randrange(1, 2**32)
        """Of this configuration of the node: its revisions begin at 0."""
        self.pairing: Pairing = PAIRINGS[settings['pairing']](solver.scene, counts=counts)
        self.set_solver(solver)
        self.set_times(settings)
        self._queues: dict[str, PoseQueue] = {}  # by box
        self._last = LastPoses()
        self.active = False
        self.after: Callable[[], None] | None = None

    @property
    def solver(self) -> SceneSolver:
        """Return the solver of the scene."""
        return self._writer.solver

    def set_solver(self, solver: SceneSolver) -> None:
        """Answer by another solver, whose scene may have other boxes."""
        self.set_writer(self.writer_of(solver))

    def writer_of(self, solver: SceneSolver) -> TickWriter:
        """Return what `set_writer` takes."""
        return TickWriter(solver, self._topics.of_pair, self.epoch)

    def set_writer(self, writer: TickWriter) -> None:
        """Answer by another writer from the next tick on."""
        self._writer, scene = writer, writer.solver.scene
        self._named = NamedPoses(scene.moving)
        self.pairing.set_partners(scene)

    def reset(self) -> None:
        """Forget all poses and stamps."""
        self.pairing.reset()
        self._last.forget()

    def last_poses(self) -> dict[str, Pose]:
        """Return by name the last poses of what moves, not older than `max_age`."""
        return self._last.within(self.pairing.max_age)

    def set_times(self, settings: Mapping[str, Any]) -> None:
        """Take `tolerance` and `max_age` of checked parameters [s]."""
        self.pairing.tolerance, self.pairing.max_age = (
            round(NANOSECONDS * settings[name]) for name in ('tolerance', 'max_age'))

    def callback_of(self, box: str, topic: str) -> PoseCallback:
        """Return the callback for the bytes of a box, or of all; it raises nothing at all."""
        queue = self._queues[box] = PoseQueue(partial(self._topics.publisher_count, box))
        read = self._read_all if box == ALL_BOXES else partial(self._read_one, box)

        def callback(data: bytes, info: Mapping[str, Any]) -> None:
            if not self.active:
                queue.restart()
                return
            self._counts['poses'] += 1
            arrived = info['received_timestamp']
            if queue.is_overtaken(info['publication_sequence_number'], arrived):
                self._counts[OVERTAKEN] += 1
                return
            try:
                ticks = self.pairing.add(box, read(data))
            except Exception as error:
                self._refuse(error, topic, box)
                return
            for tick in ticks:
                try:
                    self._answer(tick, arrived)
                except Exception as error:  # one tick that is refused keeps back no other
                    self._refuse(error, topic)
            if ticks and self.after:
                self.after()
        return callback

    def take_lost(self) -> int | None:
        """Return how many poses never came, None: nobody knows; note which boxes are shared."""
        lost = [queue.take_lost() for queue in self._queues.values()]
        self._monitor.shared = [box for box, queue in self._queues.items() if queue.is_shared]
        return None if None in lost else sum(filter(None, lost))

    def _read_one(self, box: str, data: bytes) -> StampedPose:
        """Return the pose of a box or body."""
        pose = read_pose(data)
        self._last.take(box, pose)
        return pose

    def _read_all(self, data: bytes) -> StampedPose:
        """Return the poses of all that moves; a bad one is counted, and its name absent."""
        moving, poses = self.solver.moving, self._named(data)
        self._monitor.unknown = self._named.unknown
        if self._named.unknown:
            self._counts['unknown names'] += len(self._named.unknown)
        missing = np.flatnonzero(~are_poses(poses.numbers))
        for row in missing[~absent_poses(poses.numbers[missing])]:
            self._refuse(MessageError('bad pose', f'{pose_fault(poses.numbers[row])}'), moving[row])
        poses.numbers[missing] = np.nan
        self._monitor.absent = [moving[row] for row in missing]
        self._last.take_all(moving, poses, missing)
        return poses

    def _answer(self, tick: TickPoses, arrived: int) -> None:
        """Publish the contacts of a tick: those of each pair, then all of them.

        arrived: when the pose came that completes the tick, by the wall clock [ns]; 0: unknown.
        """
        started = time.perf_counter_ns()
        contacts, of_pairs, touching, stale = self._writer(tick)
        took = time.perf_counter_ns() - started
        for (points, normals), point, normal in of_pairs:
            points.publish(point)
            normals.publish(normal)
        self._topics.contacts.publish(contacts)
        # What nobody waits for comes last. A box that the message leaves out is not there: nobody
        # asks for its pairs.
        age, scene = time.time_ns() - arrived if arrived else 0, self._writer.solver.scene
        open_pairs = [] if scene.in_one_message else [scene.pair_of(*boxes) for boxes in stale]
        self._monitor.evaluated(took, age, open_pairs)
        counts = self._counts
        counts['contacts'] += touching
        counts['evaluations'] += 1
        counts['stale pairs'] += len(stale)

    def _refuse(self, error: Exception, topic: str, box: str = '') -> None:
        """Count what was refused, and hand it to the next report."""
        reason = getattr(error, 'reason', 'internal error')
        self._counts[f'refused: {reason}'] += 1
        self._monitor.refused(reason, f'{topic}: {reason_of(error)}', box)

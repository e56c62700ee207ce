# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is drawn of a scene: the poses of its boxes and the contacts of one evaluation, over ROS.

A `Listener` subscribes to the poses and the contacts of a scene and keeps the last of each. Its
`tick` puts together what belongs together: the last contacts, and the poses that they answer.
"""
from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from rclpy.context import Context
from rclpy.qos import QoSProfile

from box_contact_msgs.msg import Contacts as ContactsMessage

from ...node.contact_node import scene_of
from ...node.diagnostics import REMINDER_SECONDS
from ...node.parameters import Setting, declare, warn_of_unknown
from ...node.runtime import GuardedNode
from ...node.topics import pose_qos, pose_type
from ...node.yard_client import Yard, YardClient
from ...scene.scene import ALONE, Scene
from ...scene.scene_solver import Answer
from ...solver.checks import are_poses, short_repr
from ...stream.cdr import MessageError
from ...stream.pairing import StampedPose
from ...stream.read_contacts import ReadContacts, read_contacts
from ...stream.read_poses import NamedPoses, read_pose
from ...stream.streams import ALL_BOXES, topics_of

KEPT = 1000  # poses kept per topic: a second at 1 kHz
LOOK_PERIOD = 1.0  # time [s] between looks whether the drawn yard is that of the node
UNANSWERED = 0.5
"""Time [s] that poses may come without contacts; then nobody answers, and none are drawn."""
QUIET = 1.0  # time [s] without a pose, after which nobody moves the boxes any more


class SceneRows:
    """A scene as arrays: one row per box, in the scene's order."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.sizes = np.array([box.size for box in scene.boxes.values()], dtype=float)
        self.poses = scene.fixed_poses()
        """Poses (n + m, 7) of boxes and, behind them, of bodies: NaN for what moves."""
        self.is_a = scene.sides[:, ::2].any(axis=1) | np.isin(
            np.arange(len(self.sizes)), scene.rows[:, 0])
        """Which boxes (n,) may be box a of a pair: normals point away from them."""


@dataclass(frozen=True, eq=False)
class DrawnTick:
    """The poses of all boxes at one stamp, and the contacts that answer them."""

    rows: SceneRows
    stamp: int  # [ns]
    frame_id: str
    poses: np.ndarray  # (n, 7), NaN for a box that has none
    answer: Answer | None  # the deepest and the nearest first; None if nobody answers
    latency: float  # time [s] from the stamp to the contacts, NaN if nobody answers


def read_sorted(read: ReadContacts, scene: Scene) -> Answer:
    """Return the answer that a message tells, the deepest contacts and the nearest pairs first.

    Raises MessageError for a pair that is not in the scene.
    """
    answer = read_answer(read, scene)
    rows = np.argsort(answer.contacts.separation, kind='stable')
    near = np.argsort(answer.near.distance, kind='stable')
    return answer._replace(pairs=answer.pairs[rows], contacts=answer.contacts[rows],
                           near_pairs=answer.near_pairs[near], near=answer.near[near])


def read_answer(read: ReadContacts, scene: Scene) -> Answer:
    """Return the answer that a message tells, as a `SceneSolver` gives it.

    scene: that of the node. Raises MessageError for a pair that the scene lacks.
    """
    index, rows = scene.index_of, {pair.label: row for pair, row in zip(scene.pairs, scene.rows)}
    if scene.patterns:
        rows = {name: (number, ALONE) for name, number in index.items()} | rows
    listed = [*read.names, *read.near_names]
    pairs = [(index.get(a, ALONE), index.get(b, ALONE)) for _, a, b in listed]
    # A box that came back has a place that is known to the node alone.
    for name, is_known in (*((names[0], min(pair) >= 0 and (scene.has_pair(*pair)
                                                            or scene.has_pair(*pair[::-1])))
                             for names, pair in zip(listed, pairs)),
                           *((name, name in rows) for name in read.stale)):
        if not is_known:
            raise MessageError('unknown pair', f'{short_repr(name)} is no pair of the scene: read '
                                               'the scene file that the node has')
    boxes, stale = (np.array(part, np.int64).reshape(-1, 2)
                    for part in (pairs, [rows[name] for name in read.stale]))
    touching, near = np.split(boxes, [len(read.names)])
    return Answer(touching, read.contacts, near, read.near, len(boxes), stale, scene)


class PoseTopic(NamedTuple):
    """A topic that a scene's poses come on."""

    name: str
    kind: type  # of its messages
    qos: QoSProfile
    source: str  # a box or body, or ALL_BOXES

    def names(self, scene: Scene) -> Sequence[str]:
        """Return the boxes or bodies whose poses come here."""
        return scene.moving if self.source == ALL_BOXES else (self.source,)

    def reader(self, scene: Scene) -> Callable[[bytes], StampedPose]:
        """Return what reads the poses (n, 7) of these names, NaN for one that is not there.

        It raises MessageError.
        """
        if self.source != ALL_BOXES:
            return _read_one
        return partial(_read_all, NamedPoses(scene.moving))


def pose_topics(scene: Scene) -> list[PoseTopic]:
    """Return how the poses of all that moves come, in the scene's order."""
    return [PoseTopic(topic, pose_type(scene), pose_qos(source), source)
            for source, topic in topics_of(scene).items()]


def _read_one(data: bytes) -> StampedPose:
    pose = read_pose(data)
    return pose._replace(numbers=np.array([pose.numbers]))


def _read_all(read: Callable[[bytes], StampedPose], data: bytes) -> StampedPose:
    """Return all poses. A bad pose becomes NaN: the contact node reports it."""
    poses = read(data)
    poses.numbers[~are_poses(poses.numbers)] = np.nan
    return poses


class Track:
    """The last poses of one topic, by stamp."""

    def __init__(self) -> None:
        self.names: Sequence[str] = ()  # whose poses they are
        self.rows: list[int] = []  # those of SceneRows.poses
        self.kept: deque[tuple[int, np.ndarray]] = deque(maxlen=KEPT)

    def follow(self, names: Sequence[str], rows: Mapping[str, int]) -> None:
        """Take poses of other names from now on; of those before, keep the last ones."""
        if tuple(names) != tuple(self.names) and self.kept:
            stamp, last = self.kept[-1]
            known = dict(zip(self.names, last))
            nowhere = np.full(7, np.nan)
            self.kept.clear()
            self.kept.append((stamp, np.array([known.get(name, nowhere) for name in names])
                              .reshape(-1, 7)))
        self.names, self.rows = names, [rows[name] for name in names]

    def append(self, stamp: int, poses: np.ndarray) -> None:
        """Take poses (m, 7); what has none, NaN, stays where it was."""
        if self.kept:
            poses = np.where(np.isnan(poses[:, :1]), self.kept[-1][1], poses)
        self.kept.append((stamp, poses))

    def at(self, stamp: int) -> np.ndarray:
        """Return the last poses (m, 7) up to a stamp, the first ones where all are newer."""
        kept = tuple(self.kept)  # in one go: another thread goes on appending
        return next((poses for at, poses in reversed(kept) if at <= stamp), kept[0][1])


class Listener(GuardedNode):
    """Keeps the last poses and contacts that it hears of a scene.

    It draws the scene of its parameters until it has the yard of the contact node.

    values: its parameters; rows: the scene.
    """

    def __init__(self, name: str, context: Context, settings: Mapping[str, Setting],
                 contacts_qos: QoSProfile, **options: Any) -> None:
        """Subscribe to the topics of the scene that the parameters tell."""
        super().__init__(name, context=context, **options)
        self.values = values = declare(self, settings)
        warn_of_unknown(self, settings)
        scene = scene_of(values)
        self._frame_id = ''
        self._answer: tuple[int, Answer, float] | None = None  # stamp, what touches, latency
        self._heard = -math.inf  # when a pose last came, by the steady clock [s]
        self._unanswered = math.inf  # since when poses come without contacts [s]
        self.topics = pose_topics(scene)
        self._tracks = [Track() for _ in self.topics]
        self._readers: list[Callable[[bytes], StampedPose]] = []
        self._take(scene, 0, 0)
        self._yard = YardClient(self, on_yard=self._on_yard)
        self._strange = 0  # looks that found another yard than that of the node
        self.create_timer(LOOK_PERIOD, self._look)
        for number, topic in enumerate(self.topics):
            self.create_subscription(topic.kind, topic.name, partial(self._on_poses, number),
                                     topic.qos, raw=True)
        self.create_subscription(ContactsMessage, 'contacts', self._on_contacts, contacts_qos,
                                 raw=True)

    @property
    def quiet(self) -> bool:
        """Whether no pose has come for QUIET seconds."""
        return time.monotonic() - self._heard > QUIET

    def _take(self, scene: Scene, epoch: int, revision: int) -> None:
        """Draw a scene from now on."""
        self.rows, self._epoch, self._revision = SceneRows(scene), epoch, revision
        self._answer = None
        for topic, track in zip(self.topics, self._tracks):
            track.follow(topic.names(scene), scene.row_of)
        self._readers = [topic.reader(scene) for topic in self.topics]

    def _on_yard(self, yard: Yard) -> None:
        """Draw the yard of the node from now on, if its poses come as those that are heard."""
        if yard.scene.poses == self.rows.scene.poses:
            self._take(yard.scene, yard.epoch, yard.revision)

    def _look(self) -> None:
        """Log while what is drawn is not what the node has."""
        yard = self._yard.yard
        is_drawn = (self._yard.is_current and yard is not None
                    and (yard.epoch, yard.revision) == (self._epoch, self._revision))
        self._strange = 0 if is_drawn else self._strange + 1
        if self._strange > 1:
            self.get_logger().warning(
                'what is drawn is not what the contact node has: ' + (
                    'it has not told its boxes yet' if yard is None else
                    'start this program with the scene file of the node'),
                throttle_duration_sec=REMINDER_SECONDS)

    def _on_poses(self, number: int, data: bytes) -> None:
        poses = self._readers[number](data)
        self._tracks[number].append(poses.stamp, poses.numbers)
        self._frame_id, self._heard = poses.frame_id, time.monotonic()
        self._unanswered = min(self._unanswered, self._heard)

    def _on_contacts(self, data: bytes) -> None:
        read = read_contacts(data)
        if (read.epoch, read.revision) != (self._epoch, self._revision):  # a change is on its way
            return
        latency = 1e-9 * (self.get_clock().now().nanoseconds - read.stamp)
        self._answer = read.stamp, read_sorted(read, self.rows.scene), latency
        self._unanswered = math.inf

    def tick(self) -> DrawnTick | None:
        """Return the last contacts with their poses, or the last poses if nobody answers.

        Return None before the first pose.
        """
        tracks = [track for track in self._tracks if track.kept]
        if not tracks:
            return None
        stamp, answer, latency = max(track.kept[-1][0] for track in tracks), None, math.nan
        if self._answer is not None and time.monotonic() - self._unanswered <= UNANSWERED:
            stamp, answer, latency = self._answer
        poses = self.rows.poses.copy()
        for track in tracks:
            poses[track.rows] = track.at(stamp)
        self.rows.scene.place_boxes(poses)
        return DrawnTick(self.rows, stamp, self._frame_id, poses[:len(self.rows.sizes)], answer,
                         latency)

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The wrench of each pair of a scene, for clients that apply it until the next answer.

`PatchLaw` is for one load; `PairWrenches` is the same law for all pairs with a body: a moving box
with a mass, of one density. Velocities come from the poses of two ticks. Conventions: those of
`laws`.
"""
from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ..pose import quaternion_multiply
from ..scene_solver import Answer, Pair, Scene
from ..stamp_pairing import NEVER, Tick
from .laws import FRICTION, GRAVITY, Body, Use, hold, native_law

SECOND = 1_000_000_000  # [ns]
STILL = np.zeros(6)
CONJUGATE = np.array([-1.0, -1.0, -1.0, 1.0])
LATE = 0.5
"""Age of a velocity in periods, as it is the mean since the pose before."""
LONGEST_GAP = 10.0
"""Periods between two poses of a box above which its motion is unknown. A lost pose is no gap."""
ANYWHERE = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])  # of a box that was never seen


class _Motion:
    """A box: its pose now, and the one before."""

    def __init__(self, pose: tuple[float, ...] | None) -> None:
        """Begin with the pose of a fixed box, or without one."""
        self.pose = np.array(pose, dtype=float)
        self._stamp = NEVER
        self._before: tuple[np.ndarray, float] | None = None  # pose, and how long ago [s]

    def add(self, pose: np.ndarray, stamp: int, longest: int) -> None:
        """Take the pose of a tick; after more than `longest` [ns] the motion is unknown."""
        passed = stamp - self._stamp
        self._before = (self.pose, passed / SECOND) if 0 < passed <= longest else None
        self.pose, self._stamp = pose, stamp

    def velocity(self) -> np.ndarray | None:
        """Return the mean motion (6,) since the pose before; None if it is unknown."""
        if self._stamp == NEVER:
            return STILL  # fixed, in the scene or in /tf
        return self._before and velocity_between(self._before[0], self.pose, self._before[1])


def velocity_between(before: np.ndarray, now: np.ndarray, seconds: float) -> np.ndarray:
    """Return the velocity (6,) that leads from a pose (7,) to another: linear, then angular.

    Of the two turns between the orientations the shorter one is meant.
    """
    one, other = (pose[3:] / np.abs(pose[3:]).max() for pose in (before, now))  # of any length
    turn = quaternion_multiply(other, one * CONJUGATE)
    if turn[3] < 0.0:
        turn = -turn
    sine = math.sqrt(turn[:3] @ turn[:3])
    half = math.atan2(sine, turn[3])
    angular = turn[:3] * (2.0 * half / sine) if sine > 0.0 else np.zeros(3)
    return np.concatenate([now[:3] - before[:3], angular]) / seconds


class PairWrenches:
    """The wrenches of all pairs with a body, once per tick."""

    def __init__(self, scene: Scene, *, rate_hz: float, latency: float = 0.0,
                 friction: float = FRICTION) -> None:
        """Begin without poses, for ticks that come `rate_hz` times a second.

        latency: from the stamp of a tick to the use of its wrenches [s]. ValueError: names the
        field and its value, also where no box has a mass.
        """
        self.pairs = [pair for pair in scene.pairs
                      if scene.boxes[pair.a].mass or scene.boxes[pair.b].mass]
        """The pairs with a body."""
        if not self.pairs:
            raise ValueError('no box has a mass')
        self._covered = frozenset(self.pairs)
        self._scene = scene
        self._longest = round(LONGEST_GAP * SECOND / rate_hz)
        names = dict.fromkeys(name for pair in self.pairs for name in (pair.a, pair.b))
        self._place = {name: place for place, name in enumerate(names)}
        self._law = native_law(
            [Body.of_box(scene.boxes[name].size, scene.boxes[name].mass) for name in names],
            Use.HELD_WRENCH, rate_hz=rate_hz, latency=latency + LATE / rate_hz, step=1.0 / rate_hz,
            friction=friction, gravity=GRAVITY)
        self._moving = [(place, name) for place, name in enumerate(scene.moving) if name in names]
        self.reset()

    def reset(self) -> None:
        """Forget all poses and all friction: time was set back, or boxes were put elsewhere."""
        self._newest = NEVER
        self._motions = {name: _Motion(self._scene.boxes[name].pose) for name in self._place}
        self._law.reset()

    def __call__(self, answer: Answer, tick: Tick) -> list[tuple[Pair, np.ndarray]]:
        """Return the wrench (6,) on box A of each pair that was evaluated; zeros if it is apart.

        The torque is about A's centre of mass. A tick that comes behind a newer one has none: what
        acts by now is newer.
        """
        newest = max((pose.stamp for pose in tick if pose is not None), default=NEVER)
        if newest < self._newest:
            return []
        self._newest = newest
        for name, pose, stamp in self._poses(tick):
            self._motions[name].add(pose, stamp, self._longest)
        place = self._place
        poses, velocities = self._state()
        hold(self._law, [(pair.label, pair.id, place[pair.a], place[pair.b], contact)
                         for pair, contact in answer.touching
                         if pair in self._covered], poses)
        self._law.wrenches(poses, velocities)
        stale = set(answer.stale)
        return [(pair, self._law.pair_wrench(pair.id)) for pair in self.pairs if pair not in stale]

    def _poses(self, tick: Tick) -> Iterator[tuple[str, np.ndarray, int]]:
        """Yield name, pose and stamp of the moving boxes that are there."""
        for place, name in self._moving:
            stamped = tick[0 if self._scene.pose_array else place]
            if stamped is not None:
                pose = stamped.numbers[place] if self._scene.pose_array else stamped.numbers
                if not np.isnan(pose[0]):
                    yield name, pose, stamped.stamp

    def _state(self) -> tuple[np.ndarray, np.ndarray]:
        """Return poses (n, 7) and velocities (n, 6); friction is forgotten where one is unknown."""
        count = len(self._place)
        poses, velocities = np.tile(ANYWHERE, (count, 1)), np.zeros((count, 6))
        for place, motion in enumerate(self._motions.values()):
            if motion.pose.ndim:  # else the box was never seen, and touches nothing
                poses[place] = motion.pose
                velocity = motion.velocity()
                if velocity is None:
                    self._law.reset()  # friction follows the way since the last tick
                else:
                    velocities[place] = velocity
        return poses, velocities

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The wrench of each pair of a scene, for clients that apply it until the next answer.

`PatchLaw` is for one load; `PairWrenches` is the same law for all pairs with a body: a moving box
with a mass, of one density. Each pair has a law of its own, so that its wrench can be told from
those of other pairs. Velocities come from the poses of two ticks. Conventions: those of `laws`.
"""
from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from ...core import native
from ...solver.contact import Contact
from ..pose import quaternion_multiply
from ..scene_solver import Answer, Box, Pair, Scene
from ..stamp_pairing import NEVER, Tick
from .laws import _FIXED, _WRENCH, FRICTION, GRAVITY, Body, _native_law

SECOND = 1_000_000_000  # [ns]
STILL = np.zeros(6)
CONJUGATE = np.array([-1.0, -1.0, -1.0, 1.0])
LATE = 0.5
"""Age of a velocity in periods, as it is the mean since the pose before."""
LONGEST_GAP = 10.0
"""Periods between two poses of a box above which its motion is unknown. A lost pose is no gap."""
WEIGHTLESS = 1e-30
"""Share of its volume with which a contact of another pair is held. The contact then counts for the
stiffness that a body feels, and its force is below the rounding of all others."""


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
        """Return the mean velocity (6,) since the pose before; None if it is unknown."""
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
    """The wrenches of all pairs with a body, once per tick.

    The contacts of a body share the stiffness at which the loop stays stable, as in `SceneLaw`: the
    sum of its wrenches is that of one law of all bodies.
    """

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
        self._scene = scene
        self._free = {name for name, box in scene.boxes.items() if box.mass}
        self._longest = round(LONGEST_GAP * SECOND / rate_hz)
        self._laws = {pair: _native_law(
            [_body(scene.boxes[name]) for name in (pair.a, pair.b)], _WRENCH, rate_hz=rate_hz,
            latency=latency + LATE / rate_hz, step=1.0 / rate_hz, friction=friction,
            gravity=GRAVITY) for pair in self.pairs}
        self._boxes = {name for pair in self.pairs for name in (pair.a, pair.b)}
        self._places = [(place, name) for place, name in enumerate(scene.moving)
                        if name in self._boxes]
        self.reset()

    def reset(self) -> None:
        """Forget all poses and all friction: time was set back, or boxes were put elsewhere."""
        self._newest = NEVER
        self._motions = {name: _Motion(self._scene.boxes[name].pose) for name in self._boxes}
        for law in self._laws.values():
            law.reset()

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
        contacts = {pair: contact for pair, contact in answer.touching if pair in self._laws}
        others = self._others(contacts)
        stale = set(answer.stale)
        found = []
        for pair, law in self._laws.items():
            contact = contacts.get(pair)
            if contact is None:
                law.reset()
                if pair not in stale:
                    found.append((pair, np.zeros(6)))
            else:
                found.append((pair, self._wrench(pair, law, contact, others)))
        return found

    def _poses(self, tick: Tick) -> Iterator[tuple[str, np.ndarray, int]]:
        """Yield name, pose and stamp of the moving boxes that are there."""
        for place, name in self._places:
            stamped = tick[0 if self._scene.pose_array else place]
            if stamped is not None:
                pose = stamped.numbers[place] if self._scene.pose_array else stamped.numbers
                if not np.isnan(pose[0]):
                    yield name, pose, stamped.stamp

    def _wrench(self, pair: Pair, law: native.Law, contact: Contact,
                others: dict[str, list[tuple[Pair, Contact]]]) -> np.ndarray:
        """Return the wrench (6,) on A of a pair in contact."""
        poses, velocities = np.empty((2, 7)), np.zeros((2, 6))
        touches = [(0, 0, 1, contact)]
        for place, name in enumerate((pair.a, pair.b)):
            motion = self._motions[name]
            velocity = motion.velocity()
            poses[place] = motion.pose
            if velocity is None:
                law.reset()  # friction follows the way since the last tick, which is unknown
            else:
                velocities[place] = velocity
            for other, weightless in others.get(name, ()):
                if other == pair:
                    continue
                sides = (place, _FIXED) if other.a == name else (_FIXED, place)
                # A patch between two bodies counts twice: once for the motion of each.
                for _ in range(2 if {other.a, other.b} <= self._free else 1):
                    touches.append((len(touches), *sides, weightless))
        law.hold(touches, poses)
        wrench: np.ndarray = law.wrenches(poses, velocities)[0]
        return wrench

    def _others(self, contacts: dict[Pair, Contact]) -> dict[str, list[tuple[Pair, Contact]]]:
        """Return the contacts of each body, weightless."""
        others: dict[str, list[tuple[Pair, Contact]]] = defaultdict(list)
        for pair, contact in contacts.items():
            weightless = contact._replace(volume=WEIGHTLESS * contact.volume)
            for name in {pair.a, pair.b} & self._free:
                others[name].append((pair, weightless))
        return others


def _body(box: Box) -> Body:
    """Return the body of a box; no force moves one without a mass."""
    return Body.of_box(box.size, box.mass)

"""Pairing: joins the streams of stamped poses of several boxes to ticks.

Time is what the stamps say. No clock is asked. A recording, a paused simulation and a simulation at
ten times real time are treated alike.

A tick of policy `stamp` holds the poses of one stamp. Each stamp is answered once.
```
tick     event                                     next      effect
-------  ----------------------------------------  --------  ---------------------------------
none     first pose of a stamp                     waiting
none     pose of a stamp answered without its box  none      TOO_LATE
waiting  pose of the last awaited box              answered  a tick
waiting  pose nearer than the one of its box       waiting   NO_PARTNER for the earlier one
waiting  no awaited box is left, or                answered  a tick, None for a missing box
         WAITING_TICKS newer ticks have begun      dropped   NO_PARTNER, if no pair is whole
waiting  one of its boxes leaves the scene         waiting   its pose is dropped, not counted
waiting  time is set back                          dropped   NO_PARTNER for each pose
```
A tick awaits the boxes that are current or missing. Before the first answer it awaits all boxes.
```
box      event                                     next      effect
-------  ----------------------------------------  --------  ---------------------------------
unseen   pose                                      current
current  a tick begins after its newest stamp      missing
missing  max_age passes after that tick            stale     waiting ticks are looked over
missing  all boxes pause longer than max_age       current
missing  pose of a new stamp                       current
stale    pose of a new stamp                       current
any      pose of a stamp that was taken            same      REPEATED
any      stamp older than all remembered ones      same      OLD
any      stamp RESET before its newest             unseen    RESETS, for all boxes
```
Policy `latest` makes a tick of every pose that is not OLD. A box is stale by its newest stamp.
Why no library does this: docs/decisions/contact-node.md.
"""
from __future__ import annotations

from collections import Counter, OrderedDict, deque
from typing import NamedTuple

import numpy as np

from .scene_solver import Scene

WAITING_TICKS = 128
"""So many of the newest ticks wait for poses: 128 ms at 1 kHz, far more than the executor or the
transport ever lets two streams drift apart, and a bound on memory."""
REMEMBERED_STAMPS = 1024
"""Stamps per box that are known to have been taken, so that none is answered twice."""
RESET = 1_000_000_000
"""A pose whose stamp lies this far [ns] before an earlier one of its box has not been late: time
has been set back, as by a simulation that starts again."""
NO_PARTNER = 'dropped: no partner'
TOO_LATE = 'dropped: tick answered before'
NEVER = -2**63
"""Before any stamp [ns]."""
REPEATED = 'refused: repeated stamp'
OLD = 'refused: older than the last'
RESETS = 'time went back'


class StampedPose(NamedTuple):
    """A pose as it came."""

    numbers: np.ndarray
    """(7,) `x y z qx qy qz qw`."""
    frame_id: str
    stamp: int
    """[ns]"""


Tick = list['StampedPose | None']
"""A pose of each of `scene.moving`, None for a box that has none recent enough."""


class _Poses(dict[str, StampedPose]):
    """What a tick has so far, by box."""

    __slots__ = ('number',)

    number: int
    """How many ticks began before."""


class _Pairing:
    """What both policies share: the newest stamp of each box, staleness, and time going back."""

    def __init__(self, scene: Scene, *, tolerance: int = 0, max_age: int = 0) -> None:
        """Begin without poses.

        tolerance: stamps this far apart [ns] still belong together (policy `stamp`);
        max_age: a pose further than this [ns] from the tick is not used, 0: any is.
        """
        self.tolerance, self.max_age = tolerance, max_age
        self.counts: Counter[str] = Counter()
        self._newest: dict[str, int] = {}  # stamp, by box
        self._now = NEVER                  # of all boxes
        self.set_scene(scene)

    def set_scene(self, scene: Scene) -> None:
        """Go over to another scene; what is known of boxes that stay, stays."""
        self.boxes = scene.moving
        moving = set(scene.moving)
        self._partners = [tuple({pair.a, pair.b} & moving) for pair in scene.pairs]
        self._newest = {box: stamp for box, stamp in self._newest.items() if box in moving}

    def reset(self) -> None:
        """Forget all poses and stamps, as when time is set back."""
        self._newest.clear()
        self._now = NEVER

    def stale(self) -> list[str]:
        """Boxes without a pose that is recent enough, by the newest stamp of all."""
        if self._now == NEVER:
            return []
        return [box for box in self.boxes if self._is_stale(box, self._now)]

    def _is_stale(self, box: str, now: int) -> bool:
        raise NotImplementedError

    def _look_back(self, box: str, stamp: int) -> None:
        if stamp < self._newest.get(box, NEVER) - RESET:
            self.counts[RESETS] += 1
            self.reset()

    def _evaluable(self, poses: dict[str, StampedPose]) -> bool:
        return any(all(box in poses for box in partners) for partners in self._partners)


class StampPairing(_Pairing):
    """A tick is complete when every box has given a pose of its stamp, in whatever order they come.

    Each stamp is answered once: a pose that comes when its tick was answered without it is dropped.

    The pairing does not wait for a box that is stale, nor, once a tick has been answered, for one
    that was never seen. A tick that stays incomplete is given up when WAITING_TICKS newer ones
    have begun, or when what it lacks is stale: if it has a pair of which all poses are there, it is
    answered late and without the others, else dropped.
    """

    def __init__(self, scene: Scene, *, tolerance: int = 0, max_age: int = 0) -> None:
        self._waiting: OrderedDict[int, _Poses] = OrderedDict()
        self._begun = 0  # ticks so far
        self._taken: dict[str, deque[int]] = {}
        self._missing_since: dict[str, int] = {}  # stamp of the first tick that a box lacks
        self._went_without: dict[str, deque[int]] = {}  # ticks answered without a box, by stamp
        self._newest_answered = NEVER
        self._joined: dict[str, int] = {}  # newest tick that was answered before a box was there
        self._newest_closed = NEVER        # of all of these
        self._answered = False
        self._were_stale: set[str] = set()
        self._changed = False  # a tick may wait for nothing any more: time to look all of them over
        super().__init__(scene, tolerance=tolerance, max_age=max_age)

    def set_scene(self, scene: Scene) -> None:
        """Go over to another scene; poses of boxes that stay go on waiting."""
        super().set_scene(scene)
        for key, poses in list(self._waiting.items()):
            for gone in poses.keys() - set(self.boxes):
                del poses[gone]
            if not poses:
                del self._waiting[key]
        self._missing_since = {box: stamp for box, stamp in self._missing_since.items()
                               if box in self.boxes}
        self._taken, self._went_without = (
            {box: kept.get(box, deque(maxlen=REMEMBERED_STAMPS)) for box in self.boxes}
            for kept in (self._taken, self._went_without))
        self._joined = {box: self._joined.get(box, self._newest_answered) for box in self.boxes}
        self._newest_closed = max(self._newest_closed, *self._joined.values())
        self._changed = True

    def reset(self) -> None:
        """Forget all poses and stamps."""
        super().reset()
        self.counts[NO_PARTNER] += sum(map(len, self._waiting.values()))
        self._waiting.clear()
        self._missing_since.clear()
        self._answered = False
        self._newest_answered = self._newest_closed = NEVER
        self._joined = dict.fromkeys(self.boxes, NEVER)
        for stamps in (*self._taken.values(), *self._went_without.values()):
            stamps.clear()

    def add(self, box: str, pose: StampedPose) -> list[Tick]:
        """Take a pose; the tick that it completes, after those that are not waited for any more."""
        stamp, taken = pose.stamp, self._taken[box]
        newest = self._newest
        if stamp <= newest.get(box, NEVER) and self._refuses(box, stamp):
            return []
        if stamp > newest.get(box, NEVER):
            newest[box] = stamp
        taken.append(stamp)
        self._missing_since.pop(box, None)
        if stamp > self._now:
            self._advance(stamp)
        waiting = self._waiting
        key = self._slot(box, stamp) if self.tolerance else stamp
        poses = waiting.get(key)
        if poses is None:
            if self._is_too_late(box, stamp):
                self.counts[TOO_LATE] += 1
                return []
            poses = waiting[key] = _Poses()
            poses.number = self._begun
            self._begun += 1
            self._note_missing(stamp)
        if box in poses:  # with a tolerance: an earlier pose that was near the stamp of this one
            self.counts[NO_PARTNER] += 1
        poses[box] = pose
        ticks = self._give_up(key) if len(waiting) > 1 else []
        if len(poses) == len(self.boxes) or not self._is_awaiting(poses):
            ticks.append(self._answer(key))
            if not self._answered:
                self._answered = self._changed = True
        return ticks

    def _answer(self, key: int) -> Tick:
        """A waiting tick, which waits no more."""
        poses = self._waiting.pop(key)
        if key > self._newest_answered:
            self._newest_answered = key
        if len(poses) < len(self.boxes):
            self._newest_closed = max(self._newest_closed, key)
            for box in self.boxes:
                if box not in poses:
                    self._went_without[box].append(key)
        return [poses.get(box) for box in self.boxes]

    def _is_too_late(self, box: str, stamp: int) -> bool:
        """Whether the tick of a pose was answered without its box, or before that had joined."""
        if stamp > self._newest_closed + self.tolerance:
            return False
        return stamp <= self._joined[box] + self.tolerance or any(
            abs(key - stamp) <= self.tolerance for key in self._went_without[box])

    def _refuses(self, box: str, stamp: int) -> bool:
        """Whether a stamp has been taken before, or is too old to tell.

        It is not later than the last of its box.
        """
        self._look_back(box, stamp)
        taken = self._taken[box]
        if len(taken) == REMEMBERED_STAMPS and stamp < taken[0]:
            self.counts[OLD] += 1
            return True
        if stamp in taken:
            self.counts[REPEATED] += 1
            return True
        return False

    def _slot(self, box: str, stamp: int) -> int:
        """Stamp of the tick that a pose belongs to: its own, or the nearest within tolerance."""
        if stamp in self._waiting:
            return stamp
        near = [key for key, poses in self._waiting.items()
                if box not in poses and abs(key - stamp) <= self.tolerance]
        return min(near, key=lambda key: abs(key - stamp), default=stamp)

    def _advance(self, stamp: int) -> None:
        if 0 < self.max_age < stamp - self._now:
            # Time has leapt, as after a pause of all boxes. This one is the first, and the others
            # are not stale for that.
            self._missing_since.clear()
        self._now = stamp
        stale = {box for box in self._missing_since if self._is_stale(box, stamp)}
        self._changed |= not stale <= self._were_stale
        self._were_stale = stale

    def _note_missing(self, stamp: int) -> None:
        """A tick has begun: boxes that have given no pose as late as this lack one.

        Once a tick is enough. A box that gives an older pose in the middle of one, and then no
        more, is missing from the next one on.
        """
        newest, missing = self._newest, self._missing_since
        for box in self.boxes:
            if stamp > newest.get(box, NEVER) and box not in missing:
                missing[box] = stamp

    def _is_stale(self, box: str, now: int) -> bool:
        return 0 < self.max_age < now - self._missing_since.get(box, now)

    def _is_awaiting(self, poses: dict[str, StampedPose]) -> bool:
        """Whether a tick with these poses waits for another box."""
        for box in self.boxes:
            if (box not in poses and (box in self._newest or not self._answered)
                    and not self._is_stale(box, self._now)):
                return True
        return False

    def _give_up(self, key: int) -> list[Tick]:
        """The ticks other than that of `key` that have waited enough.

        Those of which no pair can be evaluated are dropped.
        """
        waiting, over = self._waiting, []
        for stamp, poses in waiting.items():  # as they began
            if poses.number + WAITING_TICKS < self._begun or (
                    self._changed and not self._is_awaiting(poses)):
                over.append(stamp)
            elif not self._changed:
                break
        self._changed = False
        ticks = []
        for stamp in over:
            if stamp == key:
                continue
            if self._evaluable(waiting[stamp]):
                ticks.append(self._answer(stamp))
            else:
                self.counts[NO_PARTNER] += len(waiting.pop(stamp))
        return ticks


class LatestPairing(_Pairing):
    """Every pose that arrives makes a tick, with the last pose of each other box.

    A pose older than the last one of its box is refused; one of the same stamp is not, as there are
    publishers that do not stamp.
    """

    def __init__(self, scene: Scene, *, tolerance: int = 0, max_age: int = 0) -> None:
        self._last: dict[str, StampedPose] = {}
        super().__init__(scene, tolerance=tolerance, max_age=max_age)

    def set_scene(self, scene: Scene) -> None:
        """Go over to another scene; the last poses of boxes that stay are kept."""
        super().set_scene(scene)
        self._last = {box: pose for box, pose in self._last.items() if box in self.boxes}

    def reset(self) -> None:
        """Forget all poses."""
        super().reset()
        self._last.clear()

    def add(self, box: str, pose: StampedPose) -> list[Tick]:
        """Take a pose; the tick that it makes, once both boxes of a pair have been seen."""
        self._look_back(box, pose.stamp)
        if pose.stamp < self._newest.get(box, pose.stamp):
            self.counts[OLD] += 1
            return []
        self._newest[box] = pose.stamp
        self._now = max(self._now, pose.stamp)
        self._last[box] = pose
        if not self._evaluable(self._last):
            return []
        return [[None if self._is_stale(other, pose.stamp) else self._last.get(other)
                 for other in self.boxes]]

    def _is_stale(self, box: str, now: int) -> bool:
        newest = self._newest.get(box)
        return newest is None or 0 < self.max_age < abs(now - newest)


PAIRINGS = {'stamp': StampPairing, 'latest': LatestPairing}
"""Values of the node parameter `pairing`."""

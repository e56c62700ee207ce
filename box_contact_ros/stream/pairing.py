# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pairing: joins the streams of stamped poses of several boxes to ticks.

A body is one box here: it has one pose.

Time is what the stamps say. No clock is asked. A recording, a paused simulation and a simulation at
ten times real time are treated alike.

A tick of policy `stamp` holds the poses of one stamp. Each stamp is answered once. A tick is whole
once some pair has the poses of both of its boxes.
```
tick     event                                     next      effect
-------  ----------------------------------------  --------  ---------------------------------
none     first pose of a stamp                     waiting
none     pose of a stamp that its box missed       none      TOO_LATE
waiting  pose of a box                             waiting
waiting  pose nearer than the one of its box       waiting   NO_PARTNER for the earlier one
waiting  whole, and no box is awaited              answered  a tick, None for a missing box
waiting  PATIENCE later ticks are whole            answered  a tick, None for a missing box
waiting  WAITING_TICKS newer ticks have begun      dropped   NO_PARTNER for each pose
waiting  time is set back                          dropped   NO_PARTNER for each pose
```
Older whole ticks are answered before it. A box misses a tick that is answered without its pose. No
box misses a tick that is RESET ahead of most boxes, which has the stamp of a wrong clock. A tick
awaits each box that has no pose in it and may still give one:
```
box                                                               awaited
----------------------------------------------------------------  -------
its newest stamp is the tick's or later                           no
its last pose was late by PATIENCE answers or more                no
it is slower than the others, and no pose of it is due yet        no
its pose is overdue by PATIENCE ticks                             no
it never gave a pose, and the node has answered                   no
any other                                                         yes
```
So one box that is late, silent, or stamped by another clock holds up nobody for long.
```
pose of a box                                      effect
-------------------------------------------------  ------------------------------------------
its newest stamp, or one of those remembered       REPEATED: refused
older than all that are remembered                 OLD: refused
RESET before its newest                            the box alone begins anew
the same, and another box that began anew behind   RESETS: time went back; all but that other box
the others is near, or there are no others         begin anew
```
A box that has begun anew behind the others may be the first one after a restart. So its ticks await
the others, although their newest stamps are later. So does a tick with a pose that is older than
the newest of its box: time may have been set back by less than RESET.
Policy `latest` makes a tick of every pose that is not OLD, with the last pose of each other box. A
box is stale there if its newest stamp is more than max_age away from that of the pose.
Why no library does this: docs/contributing/node.md.
"""
from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import islice
from statistics import median
from typing import Any, NamedTuple

import numpy as np

from ..scene.scene import Scene
from ..solver.checks import short_repr
from .cdr import MessageError
from .streams import partners_of, streams_of

PATIENCE = 5
"""How many whole ticks a tick waits: a few periods, whatever the rate. Executor and transport let
the streams of one publisher drift apart by one or two."""
WAITING_TICKS = 128
"""Ticks that may wait: memory stays bounded."""
REMEMBERED_STAMPS = 1024
"""Stamps per box that are known to have been taken, so that none is answered twice."""
RESET = 1_000_000_000
"""Time has been set back if a stamp lies this far [ns] before an earlier one of its box."""
NEVER = -2**63  # before any stamp [ns]
NO_PARTNER = 'dropped: no partner'
TOO_LATE = 'dropped: tick answered before'
REPEATED = 'refused: repeated stamp'
OLD = 'refused: older than the last'
RESETS = 'time went back'
OVERTAKEN = 'dropped: newer poses wait'


class StampedPose(NamedTuple):
    """A pose as it came."""

    numbers: Any  # seven floats `x y z qx qy qz qw`; of a message of all poses an array (n, 7)
    frame_id: str
    stamp: int  # [ns]


class RejectedPose(NamedTuple):
    """The last pose that was refused, dropped or begins a new time, for the log."""

    box: str
    stamp: int   # [ns]
    newest: int  # newest stamp of the box so far [ns]
    stamps: int = 0  # how many stamps of the box are remembered

    def line(self, reason: str, publishers: int = 1) -> str:
        """Return the log line of what was done to the pose, with its remedy.

        publishers: how many publish poses of the box.
        """
        box = self.box
        stamp, newest = (f'{1e-9 * value:.12g} s' for value in (self.stamp, self.newest))
        if reason == RESETS:
            return (f'time went back: {box} has stamp {stamp} after {newest}; a new time begins (a '
                    'loop, a restart, or a second publisher)')
        if reason == TOO_LATE:
            return (f'{box}: the tick of stamp {stamp} was answered without this pose; dropped: '
                    'publish the poses of a tick together')
        if reason == OLD:
            return (f'{box}: stamp {stamp} is older than {newest}; refused: publish in the order '
                    'of the stamps, from one publisher, and call ~/reset before an episode begins '
                    'anew')
        assert reason == REPEATED
        if self.stamps == 1:
            return (f'{box}: stamp {stamp} does not advance; refused: set header.stamp (`ros2 '
                    'topic pub` does for `stamp: now`), or start with pairing:=latest')
        return (f'{box}: stamp {stamp} has come before; refused: its tick is answered once; ' + (
            f'{publishers} publish poses of {box}, leave one' if publishers > 1 else
            'wait longer for the answer, call ~/reset before an episode begins anew, or ask '
            '~/check'))


TickPoses = list[StampedPose | None]
"""Poses that belong together: one of each stream, None for a box that has none recent enough."""


def check_frames(scene: Scene, streams: Sequence[str], poses: TickPoses) -> None:
    """Raise MessageError for a tick whose poses, one of each stream, are in several frames."""
    known = [(box, pose.frame_id) for box, pose in zip(streams, poses) if pose is not None]
    first, frame = ('the scene', scene.frame_id) if scene.frame_id else known[0]
    for box, other in known:
        if other != frame:
            raise MessageError('frame_id differs', frames_differ(first, frame, box, other))


def frames_differ(first: str, frame: str, other: str, other_frame: str) -> str:
    """Return the refusal of what is in another frame than the first, and what to do."""
    advice = ('the leading slash is the difference' if frame.lstrip('/') == other_frame.lstrip('/')
              else 'send all poses in one frame')
    return (f'{first} is in frame {short_repr(frame)}, {other} in {short_repr(other_frame)}: '
            f'{advice}')


def _remembered() -> deque[int]:
    return deque(maxlen=REMEMBERED_STAMPS)


@dataclass(slots=True)
class BoxState:
    """What is known of one box or body that moves; all stamps in ns."""

    newest: int = NEVER  # its latest stamp
    taken: deque[int] = field(default_factory=_remembered)  # stamps of its poses that were taken
    missed: deque[int] = field(default_factory=_remembered)  # ticks answered without the box
    is_late: bool = False  # whether its last pose was late by PATIENCE answers or more
    heard_at: int = 0  # number of the tick of its last pose
    gaps: deque[int] = field(default_factory=partial(deque, maxlen=2))
    """How many ticks its last poses are apart."""
    last: StampedPose | None = None  # its last pose, for policy `latest`
    came: bool = False  # whether it ever gave a pose, also before time was set back


@dataclass(slots=True)
class WaitingTick:
    """Poses of one stamp, by box, that wait for those of other boxes."""

    poses: dict[str, StampedPose] = field(default_factory=dict)
    number: int = 0  # how many ticks were whole with it; 0: not whole
    passed: int = 0  # later ticks that are whole
    settled: int = 0  # how many boxes of the scene, from the first on, are not awaited
    went_back: bool = False  # whether a pose in it is older than the newest of its box


class Pairing(ABC):
    """What both policies share: the state of each box, and time that is set back."""

    def __init__(self, scene: Scene, *, tolerance: int = 0, max_age: int = 0,
                 counts: Counter[str] | None = None) -> None:
        """Begin without poses.

        tolerance: Stamps this far apart [ns] still belong together (policy `stamp`).
        max_age: A pose further than this [ns] from the tick is not used; 0: any is.
        counts: Refused and dropped poses are counted here; a new Counter by default.
        """
        self.tolerance, self.max_age = tolerance, max_age
        self.counts: Counter[str] = Counter() if counts is None else counts
        self.rejections: dict[str, RejectedPose] = {}
        """The last pose of each kind that is counted. Whoever logs them clears them."""
        self.scene, self._streams = scene, streams_of(scene)
        self._boxes = {box: BoxState() for box in self._streams}
        self.set_partners(scene)
        self._behind: set[str] = set()  # boxes that have begun anew behind the others

    def set_partners(self, scene: Scene) -> None:
        """Take the pairs of the scene, or of one with other boxes and the same streams."""
        self._partners = {stream: partners_of(scene, stream) for stream in self._boxes}

    @abstractmethod
    def add(self, box: str, pose: StampedPose) -> list[TickPoses]:
        """Take a pose; return the ticks that can be answered now, in their order."""

    def reset(self, kept: Collection[str] = ()) -> None:
        """Forget all poses and stamps, as when time is set back, but those of kept boxes."""
        for box, state in self._boxes.items():
            if box in kept:
                state.missed.clear()
            else:
                self._boxes[box] = BoxState(came=state.came, heard_at=state.heard_at)
        self._behind.clear()

    def stale(self) -> list[str]:
        """Return the boxes whose newest stamp is more than max_age behind that of another box."""
        return [box for box, behind in self.behind().items() if 0 < self.max_age < behind]

    def unseen(self) -> list[str]:
        """Return the boxes that have never given a pose."""
        return [box for box, state in self._boxes.items() if not state.came]

    def behind(self) -> dict[str, int]:
        """Return how far [ns] the newest stamp of each box that came is behind that of all."""
        now = max(state.newest for state in self._boxes.values())
        return {box: now - state.newest for box, state in self._boxes.items()
                if state.newest != NEVER}

    @property
    def waiting_ticks(self) -> int:
        """Return how many ticks wait for poses."""
        return 0

    def stamps(self, box: str) -> np.ndarray:
        """Return an array (n,) of the stamps [ns] of a box or its body, as far as remembered."""
        state = self._boxes.get(self.scene.mover(box))
        return np.array(state.taken if state else (), dtype=np.int64)

    def _state_at(self, box: str, stamp: int) -> BoxState:
        """Return the state of a box, after a reset if its stamp shows that time was set back."""
        newest = self._boxes[box].newest
        if stamp < newest - RESET:
            self._go_back(box, stamp)
        elif self._behind and stamp > newest + RESET:
            self._behind.discard(box)
        state = self._boxes[box]
        state.came = True
        return state

    def _go_back(self, box: str, stamp: int) -> None:
        """Let a box begin anew, or all boxes if it follows one that has gone back to this time."""
        others = {name: state.newest for name, state in self._boxes.items()
                  if name != box and state.newest != NEVER}
        first = [name for name in self._behind & others.keys()
                 if abs(others[name] - stamp) <= RESET]
        if first or not others:
            self._count(RESETS, box, stamp)
            self.reset(kept=first)
            return
        self._boxes[box] = BoxState(missed=self._boxes[box].missed)
        if median(others.values()) - stamp > RESET:  # else its clock was wrong, and is right now
            self._behind.add(box)

    def _count(self, reason: str, box: str, stamp: int) -> None:
        """Count a pose, and note it for the log."""
        self.counts[reason] += 1
        state = self._boxes[box]
        self.rejections[reason] = RejectedPose(box, stamp, state.newest, len(state.taken))

    def _has_partner(self, box: str, present: Mapping[str, Any]) -> bool:
        """Return whether the other box of some pair of a box is present, or fixed."""
        return not present.keys().isdisjoint(self._partners[box])


class StampPairing(Pairing):
    """Policy `stamp`: the poses of one stamp are answered together, once, in any order.

    The module's docstring has the table of states and events.
    """

    def __init__(self, scene: Scene, *, tolerance: int = 0, max_age: int = 0,
                 counts: Counter[str] | None = None) -> None:
        """Begin without poses, as Pairing does."""
        super().__init__(scene, tolerance=tolerance, max_age=max_age, counts=counts)
        self._waiting: dict[int, WaitingTick] = {}  # by stamp, as they began
        self._whole: dict[int, WaitingTick] = {}  # those of them that could be answered
        self._whole_so_far = 0
        self._has_answered = False
        self._newest_missed = NEVER  # tick that was answered without a box

    def reset(self, kept: Collection[str] = ()) -> None:
        """Forget as Pairing does; poses that wait and are not kept are dropped and counted."""
        super().reset(kept)
        waiting, self._waiting = self._waiting, {}
        for key, tick in waiting.items():
            if all(pose.stamp in self._boxes[box].taken for box, pose in tick.poses.items()):
                self._waiting[key] = tick
                tick.settled = 0
            else:
                self.counts[NO_PARTNER] += len(tick.poses)
                self._whole.pop(key, None)
        self._newest_missed = NEVER

    def add(self, box: str, pose: StampedPose) -> list[TickPoses]:
        """Take a pose; return the ticks that await nothing any more, in their order."""
        stamp = pose.stamp
        state = self._state_at(box, stamp)
        went_back = stamp < state.newest
        if stamp > state.newest:
            state.newest = stamp
        else:
            if len(state.taken) == REMEMBERED_STAMPS and stamp < state.taken[0]:
                self._count(OLD, box, stamp)
                return []
            if stamp in state.taken:
                self._count(REPEATED, box, stamp)
                return []
        state.is_late = bool(state.missed) and PATIENCE == sum(
            missed > stamp for missed in islice(reversed(state.missed), PATIENCE))
        key = self._tick_of(box, stamp) if self.tolerance else stamp
        tick = self._waiting.get(key)
        is_too_late = tick is None and self._is_too_late(state, stamp)
        number = (tick and tick.number) or self._whole_so_far + (not is_too_late)
        if state.taken:
            state.gaps.append(number - state.heard_at)
        state.heard_at = number
        state.taken.append(stamp)
        if is_too_late:
            self._count(TOO_LATE, box, stamp)
            return []
        if tick is None:
            tick = self._begin(key)
        if box in tick.poses:  # with a tolerance: an earlier pose near the stamp of this one
            self.counts[NO_PARTNER] += 1
        tick.poses[box] = pose
        if went_back and not tick.went_back:
            tick.went_back, tick.settled = True, 0
        if len(tick.poses) == len(self._boxes) and not self._whole:  # as almost always
            self._whole_so_far += 1
            return [self._answer(key)]
        if key not in self._whole and self._has_partner(box, tick.poses):
            self._whole_so_far += 1
            tick.number = self._whole_so_far
            for earlier, waiting in self._whole.items():
                waiting.passed += earlier < key
            self._whole[key] = tick
        newest = NEVER  # tick that can be answered
        for key, tick in self._whole.items():
            if key > newest and (tick.passed >= PATIENCE or not self._is_awaiting(key, tick)):
                newest = key
        if newest == NEVER:
            return []
        return [self._answer(key) for key in sorted(self._whole) if key <= newest]

    @property
    def waiting_ticks(self) -> int:
        """Return how many ticks wait for poses."""
        return len(self._waiting)

    def _begin(self, key: int) -> WaitingTick:
        """Return a new tick; drop the oldest where too many wait."""
        if len(self._waiting) >= WAITING_TICKS:
            oldest = next(iter(self._waiting))
            self.counts[NO_PARTNER] += len(self._waiting.pop(oldest).poses)
            self._whole.pop(oldest, None)
        tick = self._waiting[key] = WaitingTick()
        return tick

    def _tick_of(self, box: str, stamp: int) -> int:
        """Return the stamp of the waiting tick that a pose belongs to: its own, else the nearest.

        A tick further than the tolerance, or that has a pose of the box, is not meant.
        """
        if stamp in self._waiting:
            return stamp
        near = [key for key, tick in self._waiting.items()
                if box not in tick.poses and abs(key - stamp) <= self.tolerance]
        return min(near, key=lambda key: abs(key - stamp), default=stamp)

    def _is_too_late(self, state: BoxState, stamp: int) -> bool:
        """Return whether the tick of a stamp was answered without the box."""
        return stamp <= self._newest_missed + self.tolerance and any(
            abs(key - stamp) <= self.tolerance for key in state.missed)

    def _is_awaiting(self, key: int, tick: WaitingTick) -> bool:
        """Return whether a box that is missing from a tick may still give its pose."""
        while tick.settled < len(self._streams):
            box = self._streams[tick.settled]
            if box not in tick.poses and self._may_come(self._boxes[box], key, tick):
                return True
            tick.settled += 1
        return False

    def _may_come(self, state: BoxState, key: int, tick: WaitingTick) -> bool:
        if not state.came:
            return not self._has_answered
        is_past = state.newest >= key and not tick.went_back
        if state.is_late or (is_past and self._behind.isdisjoint(tick.poses)):
            return False
        gap = min(state.gaps, default=1)
        return gap - 1 <= tick.number - state.heard_at < gap + PATIENCE

    def _answer(self, key: int) -> TickPoses:
        """Remove a tick from those that wait, and return its poses."""
        poses = self._waiting.pop(key).poses
        self._whole.pop(key, None)
        self._has_answered = True
        if len(poses) < len(self._boxes) and key - RESET <= median(
                state.newest for state in self._boxes.values() if state.newest != NEVER):
            self._newest_missed = max(self._newest_missed, key)
            for box, state in self._boxes.items():
                if box not in poses:
                    state.missed.append(key)
        return list(map(poses.get, self._boxes))


class LatestPairing(Pairing):
    """Policy `latest`: every pose that arrives makes a tick, with the last pose of each other box.

    A pose older than the last one of its box is refused. One of the same stamp is used: there are
    publishers that do not stamp.
    """

    _can_answer = False  # whether some pair has the poses of both of its boxes

    def reset(self, kept: Collection[str] = ()) -> None:
        """Forget as Pairing does."""
        super().reset(kept)
        self._can_answer = False

    def add(self, box: str, pose: StampedPose) -> list[TickPoses]:
        """Take a pose; return the tick that it makes, once both boxes of a pair have been seen."""
        stamp = pose.stamp
        state = self._state_at(box, stamp)
        if stamp < state.newest:
            self._count(OLD, box, stamp)
            return []
        state.newest, state.last = stamp, pose
        if not self._can_answer:
            given = {name: other for name, other in self._boxes.items() if other.last}
            self._can_answer = any(self._has_partner(name, given) for name in given)
        recent = dict(self._recent(stamp))
        return [list(map(recent.get, self._boxes))] if self._can_answer else []

    def _recent(self, now: int) -> Iterator[tuple[str, StampedPose]]:
        """Yield the last pose of each box that is not stale at a stamp [ns]."""
        for box, state in self._boxes.items():
            if state.last and not 0 < self.max_age < abs(now - state.newest):
                yield box, state.last


PAIRINGS: dict[str, type[Pairing]] = {'stamp': StampPairing, 'latest': LatestPairing}
"""Values of the node parameter `pairing`."""

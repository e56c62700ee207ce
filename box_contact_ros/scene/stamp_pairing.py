# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

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
A tick awaits the boxes that are current or missing, but none whose newest stamp is more than
max_age ahead of it. Before the first answer it awaits all boxes.
```
box      event                                     next      effect
-------  ----------------------------------------  --------  ---------------------------------
unseen   pose                                      current
current  a tick begins after its newest stamp      missing
missing  max_age passes after that tick            stale     waiting ticks are looked over
missing  all boxes pause longer than max_age       current
missing  pose of a new stamp                       current
stale    pose of a new stamp                       current
any      pose of its newest stamp                  same      REPEATED
any      older stamp that was taken                same      held back, else REPEATED
any      stamp older than all remembered ones      same      held back, else OLD
any      stamp RESET before its newest             unseen    RESETS, for all boxes
any      AGAIN stamps are held back                unseen    RESETS, for all boxes
any      newest or older stamp, deserted           unseen    RESETS, for all boxes
```
Deserted: publishers of all boxes have gone, and no box has had a newer stamp since.

A recording that is played in a loop repeats its stamps. Poses whose stamps were taken before are
held back, as long as they advance and no box has a newer stamp. The last of AGAIN of one box begins
a new time, with all poses that were held back. Else they are refused. A stream that sends each
stamp once never begins anew this way, in whatever order it arrives.

A stamp is ahead if two other boxes agree on a time, to max_age, and it is more than max_age later.
Its pose is AHEAD: set aside, and refused unless the others come as far, another box is as far
ahead, or its box alone gives poses for max_age. So one wrong clock holds up nobody else's contacts.

Policy `latest` makes a tick of every pose that is neither OLD nor AHEAD. A box is stale by its
newest stamp.
Why no library does this: docs/contributing/decisions/contact-node.md.
"""
from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, field
from operator import itemgetter
from typing import NamedTuple

import numpy as np

from .scene_solver import Scene

WAITING_TICKS = 128
"""Ticks that may wait: 128 ms at 1 kHz. Executor and transport never let two streams drift apart as
far, and memory stays bounded."""
REMEMBERED_STAMPS = 1024
"""Stamps per box that are known to have been taken, so that none is answered twice."""
RESET = 1_000_000_000
"""Time has been set back if a stamp lies this far [ns] before an earlier one of its box."""
AGAIN = 5
"""Time has been set back if a box goes through so many of its stamps again, in their order."""
MARGIN = 1.2
"""A tolerance that is proposed is so much larger than half the period, as periods vary."""
FEWEST_STAMPS = 5  # of a box, before its period is known, even if there is a gap among them
NO_PARTNER = 'dropped: no partner'
TOO_LATE = 'dropped: tick answered before'
NEVER, ALWAYS = -2**63, 2**63  # before and after any stamp [ns]
REPEATED = 'refused: repeated stamp'
OLD = 'refused: older than the last'
AHEAD = 'refused: stamp ahead of the other boxes'
RESETS = 'time went back'


class StampedPose(NamedTuple):
    """A pose as it came."""

    numbers: np.ndarray  # (7,) `x y z qx qy qz qw`
    frame_id: str
    stamp: int  # [ns]


class Note(NamedTuple):
    """The last pose that was refused, dropped or begins a new time, for the log."""

    box: str
    stamp: int   # [ns]
    newest: int  # newest stamp of the box so far [ns]


class Mismatch(NamedTuple):
    """Two boxes whose stamps do not agree."""

    one: str
    other: str
    difference: int  # between a stamp of one and the nearest of the other [ns], the median
    tolerance: int   # that would join them [ns]; 0: none would, their clocks differ


Tick = list['StampedPose | None']
"""A pose of each of `scene.moving`, None for a box that has none recent enough."""


def _remembered() -> deque[int]:
    return deque(maxlen=REMEMBERED_STAMPS)


@dataclass(slots=True)
class BoxState:
    """What is known of one moving box; all stamps in ns."""

    newest: int = NEVER  # its latest stamp; NEVER: unseen
    missing_since: int | None = None
    """Stamp of the first tick that lacks a pose of this box; None: current."""
    joined: int = NEVER  # newest tick that was answered before the box was in the scene
    taken: deque[int] = field(default_factory=_remembered)  # stamps of its poses that were taken
    missed: deque[int] = field(default_factory=_remembered)
    """Ticks that were answered without the box."""
    last: StampedPose | None = None  # its last pose, for policy `latest`
    came: bool = False  # whether it gave a pose before time was set back


@dataclass(slots=True)
class WaitingTick:
    """Poses of one stamp, by box, that wait for those of other boxes."""

    number: int  # how many ticks began before
    poses: dict[str, StampedPose] = field(default_factory=dict)


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
        self.notes: dict[str, Note] = {}
        """The last pose of each kind that is counted. Whoever logs them clears them."""
        self._now = NEVER  # newest stamp of all boxes
        self._deserted = False
        self._held: dict[str, list[tuple[str, StampedPose]]] = {}
        """Poses by box whose stamps were taken before, and what they are counted as so far."""
        self._aside: dict[str, deque[StampedPose]] = {}  # poses ahead, the last ones, by box
        self._horizon = NEVER  # up to this stamp none is ahead
        self._speaker = ''  # who gave the last pose
        self._since: int | None = None
        """Its first stamp that is ahead since others gave a pose; NEVER once it may go on alone."""
        self._boxes: dict[str, BoxState] = {}
        self._fixed: dict[str, StampedPose] = {}  # of boxes that no tick waits for
        self._scene = scene
        self.set_scene(scene)

    def set_scene(self, scene: Scene) -> None:
        """Replace the scene; boxes that stay keep their state and their poses."""
        self._fixed = {box: pose for box, pose in self._fixed.items()
                       if scene.frame_id == self._scene.frame_id
                       and scene.frames.get(box) == self._scene.frames.get(box)}
        self._scene = scene
        self._boxes = {box: self._boxes.get(box) or BoxState() for box in scene.streams
                       if box not in self._fixed}
        self._held.clear()
        self._aside = {box: poses for box, poses in self._aside.items() if box in self._boxes}
        self._horizon = NEVER
        self._partners = {tuple({pair.a, pair.b} & self._boxes.keys()) for pair in scene.pairs}

    def fix(self, box: str, pose: StampedPose) -> list[Tick]:
        """Take a pose that holds at all stamps, until `add` brings another one of its box.

        It is part of each tick. Returns a tick where all boxes are fixed: nothing else makes one.
        """
        is_new = box not in self._fixed
        self._fixed[box] = pose
        if is_new:
            self.set_scene(self._scene)
        return [] if self._boxes else [self._tick({})]

    def release(self) -> None:
        """Forget the poses that hold at all stamps."""
        self._fixed.clear()
        self.set_scene(self._scene)

    def reset(self) -> None:
        """Forget all poses and stamps but of fixed boxes, as when time is set back."""
        self._boxes = {box: BoxState(came=state.came or state.newest != NEVER)
                       for box, state in self._boxes.items()}
        self._now = self._horizon = NEVER
        self._deserted = False
        self._held.clear()
        self._aside.clear()

    def desert(self) -> None:
        """Note that publishers of all boxes have gone: others may begin a new time."""
        self._deserted = True

    def add(self, box: str, pose: StampedPose) -> list[Tick]:
        """Take a pose; return the ticks that can be answered now, in their order."""
        stamp = pose.stamp
        if box != self._speaker:
            self._speaker, self._since = box, None
        if stamp > self._horizon and stamp > self._limit(box):
            return self._set_aside(box, pose)
        if not self._aside:
            return self._take(box, pose)
        ticks = self._take_aside({box: stamp}) + self._take(box, pose)
        return ticks + self._take_aside({other: self._limit(other) for other in self._aside})

    @abstractmethod
    def _take(self, box: str, pose: StampedPose) -> list[Tick]:
        """Take a pose that is not ahead, as `add`."""

    def ahead(self) -> list[str]:
        """Return the boxes whose last poses were ahead."""
        return list(self._aside)

    def _limit(self, box: str) -> int:
        """Return the stamp up to which poses of a box are not ahead."""
        if not self.max_age or len(self._boxes) < 3:
            self._horizon = ALWAYS
        elif (agreed := self._agreed(box)) != NEVER:
            self._horizon = agreed + self.max_age
        else:
            return ALWAYS
        return self._horizon

    def _agreed(self, without: str = '') -> int:
        """Return the latest newest stamp that another box's is near, to max_age; NEVER: none."""
        newest = sorted((state.newest for box, state in self._boxes.items()
                         if box != without and state.newest != NEVER), reverse=True)
        return next((one for one, other in zip(newest, newest[1:])
                     if one - other <= self.max_age), NEVER)

    def _set_aside(self, box: str, pose: StampedPose) -> list[Tick]:
        """Set a pose aside that is ahead; take what is aside if time has moved on."""
        stamp = pose.stamp
        self._aside.setdefault(box, deque(maxlen=WAITING_TICKS)).append(pose)
        self.counts[AHEAD] += 1
        self.notes[AHEAD] = Note(box, stamp, self._horizon - self.max_age)
        as_far = [other for other, poses in self._aside.items()
                  if other != box and abs(poses[-1].stamp - stamp) <= self.max_age]
        if self._since is None:
            self._since = stamp
        if stamp - self._since > self.max_age:
            self._since = NEVER
        elif not as_far:
            return []
        return self._take_aside(dict.fromkeys([box, *as_far], ALWAYS))

    def _take_aside(self, limits: Mapping[str, int]) -> list[Tick]:
        """Take the poses of boxes that are aside, up to stamps by box, in the order of stamps."""
        poses = []
        for box, limit in limits.items():
            aside = self._aside.pop(box, ())
            poses += [(pose.stamp, box, pose) for pose in aside if pose.stamp <= limit]
            if ahead := [pose for pose in aside if pose.stamp > limit]:
                self._aside[box] = deque(ahead, maxlen=WAITING_TICKS)
        self.counts[AHEAD] -= len(poses)
        if not self._aside:
            self.notes.pop(AHEAD, None)
        poses.sort(key=itemgetter(0))
        return [tick for _, box, pose in poses for tick in self._take(box, pose)]

    def _come_back(self, stamp: int) -> None:
        """Set the time back to what two boxes agree on, if a stamp is far behind it."""
        if 0 < self.max_age < self._now - stamp and stamp <= (agreed := self._agreed()) < self._now:
            self._now = agreed

    def stale(self) -> list[str]:
        """Return the boxes without a recent pose, by the newest stamp of all."""
        return [] if self._now == NEVER else [
            box for box, state in self._boxes.items() if self._is_stale(state, self._now)]

    def unseen(self) -> list[str]:
        """Return the boxes that have never given a pose."""
        return [box for box, state in self._boxes.items()
                if state.newest == NEVER and not state.came]

    def held(self) -> Counter[str]:
        """Return how many of the refused poses are held back, and may yet be answered."""
        return Counter(kind for held in self._held.values() for kind, _ in held)

    def behind(self, box: str) -> int | None:
        """Return how far [ns] the newest stamp of a box is behind that of all; None: none came."""
        newest = self._boxes[box].newest
        return None if newest == NEVER else self._now - newest

    def mismatch(self, pairs: Iterable[tuple[str, str]]) -> Mismatch | None:
        """Return the first of the pairs of boxes whose stamps keep them apart, if there is one."""
        return None

    @abstractmethod
    def _is_stale(self, state: BoxState, now: int) -> bool:
        """Return whether a box has no pose that is recent enough."""

    def _state_at(self, box: str, stamp: int) -> BoxState:
        """Return the state of a box, after a reset if its stamp shows that time was set back."""
        if box in self._fixed:
            del self._fixed[box]
            self.set_scene(self._scene)
        state = self._boxes[box]
        if stamp < state.newest - (0 if self._deserted else RESET):
            self._set_back(box, stamp)
            return self._boxes[box]
        if stamp > state.newest != NEVER:
            self._deserted = False
        return state

    def _set_back(self, box: str, stamp: int) -> None:
        """Begin a new time, and count it."""
        self._count(RESETS, box, stamp)
        self.reset()

    def _count(self, kind: str, box: str, stamp: int) -> None:
        """Count a pose, and note it for the log."""
        self.counts[kind] += 1
        self._note(kind, box, stamp)

    def _note(self, kind: str, box: str, stamp: int) -> None:
        self.notes[kind] = Note(box, stamp, self._boxes[box].newest)

    def _hold(self, kind: str, box: str, pose: StampedPose) -> list[Tick]:
        """Hold back a pose whose stamp was taken before; answer those held if a loop is sure."""
        held = self._held.setdefault(box, [])
        if held and pose.stamp <= held[-1][1].stamp:
            self._refuse_held()
            held = self._held.setdefault(box, [])
        held.append((kind, pose))
        self.counts[kind] += 1
        if len(held) < AGAIN:
            return []
        poses = sorted(((pose.stamp, box, pose) for box, held in self._held.items()
                        for _, pose in held), key=itemgetter(0))
        self.counts.subtract(self.held())
        self._set_back(box, poses[0][0])
        return [tick for _, box, pose in poses for tick in self._take(box, pose)]

    def _refuse_held(self) -> None:
        """Note the poses that are held back as refused: time goes on."""
        for box, held in self._held.items():
            for kind, pose in held:
                self._note(kind, box, pose.stamp)
        self._held.clear()

    def _tick(self, poses: Mapping[str, StampedPose | None]) -> Tick:
        """Return the tick of poses by box, and of those that are fixed."""
        return [poses.get(box) or self._fixed.get(box) for box in self._scene.streams]

    def _is_evaluable(self, present: Container[str]) -> bool:
        """Return whether some pair has a pose of each of its moving boxes."""
        return any(all(box in present for box in boxes) for boxes in self._partners)


class StampPairing(Pairing):
    """Policy `stamp`: a tick is complete when every box has given a pose of its stamp.

    Poses may come in any order. The module's docstring has the table of states and events.
    """

    def __init__(self, scene: Scene, *, tolerance: int = 0, max_age: int = 0,
                 counts: Counter[str] | None = None) -> None:
        """Begin without poses, as Pairing does."""
        self._waiting: dict[int, WaitingTick] = {}  # by stamp, as they began
        self._begun = 0                 # ticks so far
        self._newest_answered = NEVER   # tick
        self._newest_closed = NEVER     # tick that was answered without a box of the scene
        self._has_answered = False
        self._were_stale: set[str] = set()
        self._awaits_less = False       # time to look all waiting ticks over
        super().__init__(scene, tolerance=tolerance, max_age=max_age, counts=counts)

    def set_scene(self, scene: Scene) -> None:
        """Replace the scene; poses of boxes that stay go on waiting."""
        before = self._boxes.keys()
        super().set_scene(scene)
        for box in self._boxes.keys() - before:
            self._boxes[box].joined = self._newest_closed = min(self._newest_answered, self._now)
        for key, tick in list(self._waiting.items()):
            tick.poses = {box: pose for box, pose in tick.poses.items() if box in self._boxes}
            if not tick.poses:
                del self._waiting[key]
        self._awaits_less = True

    def reset(self) -> None:
        """Forget as Pairing does; poses that wait are dropped and counted."""
        super().reset()
        self.counts[NO_PARTNER] += sum(len(tick.poses) for tick in self._waiting.values())
        self._waiting.clear()
        self._has_answered = False
        self._newest_answered = self._newest_closed = NEVER

    def _take(self, box: str, pose: StampedPose) -> list[Tick]:
        """Take a pose; return its tick if complete, after those that need wait no longer."""
        stamp = pose.stamp
        state = self._state_at(box, stamp)
        if stamp > state.newest:
            state.newest = stamp
            if self._held:
                self._refuse_held()
        elif stamp == state.newest:
            if self._deserted:
                self._set_back(box, stamp)
                return self._take(box, pose)
            self._count(REPEATED, box, stamp)
            return []
        elif kind := self._fault(state, stamp):
            return self._hold(kind, box, pose)
        state.taken.append(stamp)
        state.missing_since = None
        if stamp > self._now:
            self._advance(stamp)
        else:
            self._come_back(stamp)
        waiting = self._waiting
        key = self._nearest_tick(box, stamp) if self.tolerance else stamp
        tick = waiting.get(key)
        if tick is None:
            if self._is_too_late(state, stamp):
                self._count(TOO_LATE, box, stamp)
                return []
            tick = waiting[key] = WaitingTick(self._begun)
            self._begun += 1
            self._note_missing(stamp)
        if box in tick.poses:  # with a tolerance: an earlier pose near the stamp of this one
            self.counts[NO_PARTNER] += 1
        tick.poses[box] = pose
        ticks = self._give_up(key) if len(waiting) > 1 else []
        if len(tick.poses) == len(self._boxes) or not self._is_awaiting(key, tick):
            ticks.append(self._answer(key))
            if not self._has_answered:
                self._has_answered = self._awaits_less = True
        return ticks

    def mismatch(self, pairs: Iterable[tuple[str, str]]) -> Mismatch | None:
        """Return the first of the pairs of boxes whose stamps keep them apart, if there is one."""
        for pair in pairs:
            one, other = (self._boxes.get(box, BoxState()).taken for box in pair)
            if one and other:
                difference, tolerance = _compare(np.array(one), np.array(other))
                if difference > self.tolerance:
                    return Mismatch(*pair, difference, tolerance)
        return None

    def _fault(self, state: BoxState, stamp: int) -> str | None:
        """Return why a stamp is refused: it was taken before, or is too old to tell."""
        taken = state.taken
        if len(taken) == REMEMBERED_STAMPS and stamp < taken[0]:
            return OLD
        if stamp in taken:
            return REPEATED
        return None

    def _advance(self, stamp: int) -> None:
        """Take a stamp that is newer than all before as the time, and look who is stale."""
        if 0 < self.max_age < stamp - self._now:
            # All boxes have paused: this pose is the first, and the others are not stale for that.
            for state in self._boxes.values():
                state.missing_since = None
        self._now = stamp
        stale = {box for box, state in self._boxes.items() if self._is_stale(state, stamp)}
        self._awaits_less |= not stale <= self._were_stale
        self._were_stale = stale

    def _nearest_tick(self, box: str, stamp: int) -> int:
        """Return the stamp of the waiting tick that a pose belongs to: its own, else the nearest.

        A tick further than the tolerance, or that has a pose of the box, is not meant.
        """
        if stamp in self._waiting:
            return stamp
        near = [key for key, tick in self._waiting.items()
                if box not in tick.poses and abs(key - stamp) <= self.tolerance]
        return min(near, key=lambda key: abs(key - stamp), default=stamp)

    def _is_too_late(self, state: BoxState, stamp: int) -> bool:
        """Return whether a tick was answered without the box, or before the box had joined."""
        if stamp > self._newest_closed + self.tolerance:
            return False
        return stamp <= state.joined + self.tolerance or any(
            abs(key - stamp) <= self.tolerance for key in state.missed)

    def _note_missing(self, stamp: int) -> None:
        """Note which boxes have given no pose as late as a tick that begins.

        A box that is older in the middle of a tick, and then silent, is missing from the next one.
        """
        for state in self._boxes.values():
            if stamp > state.newest and state.missing_since is None:
                state.missing_since = stamp

    def _is_stale(self, state: BoxState, now: int) -> bool:
        since = state.missing_since
        return since is not None and 0 < self.max_age < now - since

    def _is_awaiting(self, stamp: int, tick: WaitingTick) -> bool:
        """Return whether a tick waits for a box that is neither stale nor unseen, nor far ahead."""
        now, max_age = self._now, self.max_age
        if 0 < 2 * max_age < now - stamp:  # time as it is near the tick: another's may be far off
            now = max((state.newest for state in self._boxes.values()
                       if state.newest <= stamp + 2 * max_age), default=stamp)
        for box, state in self._boxes.items():
            if (box not in tick.poses and (state.newest != NEVER or not self._has_answered)
                    and not 0 < max_age < state.newest - stamp
                    and not self._is_stale(state, now)):
                return True
        return False

    def _give_up(self, newest: int) -> list[Tick]:
        """Return the ticks but `newest` that await nothing; drop those without a whole pair."""
        over = []
        for key, tick in self._waiting.items():  # as they began
            if tick.number + WAITING_TICKS < self._begun or (
                    self._awaits_less and not self._is_awaiting(key, tick)):
                over.append(key)
            elif not self._awaits_less:
                break
        self._awaits_less = False
        ticks = []
        for key in over:
            if key == newest:
                continue
            if self._is_evaluable(self._waiting[key].poses):
                ticks.append(self._answer(key))
            else:
                self.counts[NO_PARTNER] += len(self._waiting.pop(key).poses)
        return ticks

    def _answer(self, key: int) -> Tick:
        """Remove a tick from those that wait, and return its poses."""
        poses = self._waiting.pop(key).poses
        self._newest_answered = max(self._newest_answered, key)
        if len(poses) < len(self._boxes):
            self._newest_closed = max(self._newest_closed, key)
            for box, state in self._boxes.items():
                if box not in poses:
                    state.missed.append(key)
        return self._tick(poses)


def _compare(one: np.ndarray, other: np.ndarray) -> tuple[int, int]:
    """Return the difference of the stamps [ns] of two boxes, and the tolerance that joins them.

    Half a period of the faster box joins each pose of the slower one, wherever it falls. The
    tolerance is 0 where none would do. Both are 0 while there are too few stamps to tell.
    """
    slow, fast = sorted((np.sort(one), np.sort(other)), key=_period, reverse=True)
    if len(fast) < FEWEST_STAMPS:
        return 0, 0
    period = _period(fast)
    met = slow[(slow > fast[0] - period) & (slow < fast[-1] + period)]
    if not len(met):
        return int(_to_nearest(slow, fast).min()), 0
    return int(np.median(_to_nearest(met, fast))), int(0.5 * MARGIN * period)


def _period(stamps: np.ndarray) -> float:
    """Return the median time between stamps [ns], given in their order."""
    return float(np.median(np.diff(stamps))) if len(stamps) > 1 else np.inf


def _to_nearest(stamps: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return how far each stamp is from the nearest of others, in their order."""
    after = np.searchsorted(others, stamps)
    before, after = np.maximum(after - 1, 0), np.minimum(after, len(others) - 1)
    nearest: np.ndarray = np.minimum(abs(stamps - others[before]), abs(stamps - others[after]))
    return nearest


class LatestPairing(Pairing):
    """Policy `latest`: every pose that arrives makes a tick, with the last pose of each other box.

    A pose older than the last one of its box is refused. One of the same stamp is used: there are
    publishers that do not stamp.
    """

    def _take(self, box: str, pose: StampedPose) -> list[Tick]:
        """Take a pose; return the tick that it makes, once both boxes of a pair have been seen."""
        stamp = pose.stamp
        state = self._state_at(box, stamp)
        if stamp < state.newest:
            if stamp in state.taken:
                return self._hold(OLD, box, pose)
            self._count(OLD, box, stamp)
            return []
        if stamp > state.newest:
            state.taken.append(stamp)
            if self._held:
                self._refuse_held()
        state.newest, state.last = stamp, pose
        self._now = max(self._now, stamp)
        self._come_back(stamp)
        if not self._is_evaluable({box for box, state in self._boxes.items() if state.last}):
            return []
        return [self._tick({box: None if self._is_stale(other, stamp) else other.last
                            for box, other in self._boxes.items()})]

    def _is_stale(self, state: BoxState, now: int) -> bool:
        return state.last is None or 0 < self.max_age < abs(now - state.newest)


PAIRINGS: dict[str, type[Pairing]] = {'stamp': StampPairing, 'latest': LatestPairing}
"""Values of the node parameter `pairing`."""

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Evaluation of ticks: poses are read, paired, handed to the solver; contacts are published."""
from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from itertools import islice
from typing import Any

import numpy as np

from ..scene.force.pair_wrenches import PairWrenches
from ..scene.scene_solver import ALL_BOXES, Answer, SceneSolver, TooManyNear
from ..scene.stamp_pairing import NEVER, PAIRINGS, RESETS, Pairing, StampedPose, Tick
from ..solver.checks import absent_poses, are_poses, pose_fault, shown
from .diagnostics import (
    ACTIVE,
    ERROR,
    NAMED,
    UNANSWERED_SECONDS,
    Diagnostics,
    Finding,
    Look,
    kind_and_remedy,
    listed,
    note_line,
    rounded_up,
)
from .message_bytes import RawMessages
from .messages import NANOSECONDS, Refused, TypedMessages
from .topics.scene_topics import SceneTopics

SERIALIZATIONS: dict[str, type[RawMessages] | type[TypedMessages]] = {
    'raw': RawMessages, 'typed': TypedMessages}
"""Values of the node parameter `serialization`."""
LEFT_TO_EXACT = 'left to exact'
COMPARED = 16  # pairs at most whose stamps are compared for a report


class Evaluator:
    """Answers ticks of poses; every pose that is refused is counted and logged, never answered."""

    _pairing: Pairing
    _messages: RawMessages | TypedMessages

    def __init__(self, solver: SceneSolver, wrenches: PairWrenches | None,
                 settings: Mapping[str, Any], *, topics: SceneTopics, counts: Counter[str],
                 diagnostics: Diagnostics, logger: Any) -> None:
        """Begin without poses; `settings` are the checked parameters."""
        self._topics, self._diagnostics, self._logger = topics, diagnostics, logger
        self.counts = counts
        self._settings: Mapping[str, Any] = {}
        self._refusals: dict[str, str] = {}  # log lines of the next report, by their kind
        self._refused_boxes: set[str] = set()  # boxes of which a message was refused
        self.set_solver(solver, wrenches, settings)

    def set_solver(self, solver: SceneSolver, wrenches: PairWrenches | None,
                   settings: Mapping[str, Any]) -> None:
        """Replace the solver and its scene; poses that wait stay unless the pairing changes.

        wrenches: the law of the output `wrench`; None where that is off.
        """
        old = self._settings
        if old:
            self.close()
        tolerance, max_age = (round(NANOSECONDS * settings[name])
                              for name in ('tolerance', 'max_age'))
        if settings['pairing'] == old.get('pairing'):
            self._pairing.set_scene(solver.scene)
            self._pairing.tolerance, self._pairing.max_age = tolerance, max_age
        else:
            self._pairing = PAIRINGS[settings['pairing']](
                solver.scene, tolerance=tolerance, max_age=max_age, counts=self.counts)
        self._messages = SERIALIZATIONS[settings['serialization']]()  # it knows names of pairs
        self.solver, self._wrenches, self._settings = solver, wrenches, settings
        self._times = self.counts[RESETS]  # how often time had gone back at the last tick
        self._absent = np.zeros(0, dtype=bool)  # which boxes the last array had no pose of
        self._diagnostics.watch.set_pairs(solver.scene.pairs)

    def close(self) -> None:
        """Keep the count of a solver that goes."""
        self.counts[LEFT_TO_EXACT] += self.solver.exact_answers

    def reset(self, *, time_only: bool = False) -> None:
        """Forget all poses; with `time_only` all but those that hold at all stamps."""
        self._pairing.reset()
        if not time_only:
            self._pairing.release()
        if self._wrenches is not None:
            self._wrenches.reset()

    def desert(self) -> None:
        """Note that publishers of all boxes have gone: others may begin a new time."""
        self._pairing.desert()

    def pose_callback(self, box: str, topic: str) -> Callable[[Any], None]:
        """Return the callback for the poses of a box, or of all; it raises nothing at all.

        It takes messages, or a StampedPose that is known already.
        """
        def callback(message: Any) -> None:
            self.counts['poses'] += 1
            try:
                pose = (self._read_all(message) if box == ALL_BOXES
                        else _checked(message) if type(message) is StampedPose
                        else self._messages.read_pose(message))
                ticks = (self._pairing.add(box, pose) if pose.stamp != NEVER
                         else self._pairing.fix(box, pose))
            except Exception as error:
                self._refused_boxes.add(box)
                self._refuse(error, topic)
                return
            for tick in ticks:
                try:
                    self._answer(tick)
                except Exception as error:  # one tick that is refused keeps back no other
                    self._refuse(error, topic)
        return callback

    def _read_all(self, message: Any) -> StampedPose:
        """Return the poses of all moving boxes; a bad one is counted, and its box absent."""
        poses, moving = self._messages.read_poses(message), self.solver.scene.moving
        if len(poses.numbers) != len(moving):
            raise Refused('wrong number of poses',
                          f'{len(poses.numbers)} poses, but {len(moving)} boxes move')
        bad = ~are_poses(poses.numbers) & ~absent_poses(poses.numbers)
        if bad.any():
            first = int(bad.argmax())
            self.counts['refused: bad pose'] += int(bad.sum()) - 1
            self._refuse(Refused('bad pose', f'{pose_fault(poses.numbers[first])}'), moving[first])
            poses.numbers[bad] = np.nan
        self._absent = absent_poses(poses.numbers)
        return poses

    def report(self, state: str) -> None:
        """Log what was refused and why pairs are not answered; publish the diagnostics."""
        refusals, self._refusals = self._refusals, {}
        notes, self._pairing.notes = self._pairing.notes, {}
        for line in (*refusals.values(), *(note_line(*note) for note in notes.items())):
            self._logger.warning(line)
        counts = self.counts - self._pairing.held()
        counts[LEFT_TO_EXACT] += self.solver.exact_answers
        scene = self.solver.scene
        look = self._diagnostics.look(counts, self._settings['max_age'])
        never = self._pairing.unseen()
        unseen = [box for box in never if box not in self._refused_boxes]
        stale = ([box for box, absent in zip(scene.moving, self._absent) if absent]
                 if scene.pose_array
                 else [box for box in self._pairing.stale() if box not in never])
        findings = list(self._findings(look, unseen, stale)) if state == ACTIVE else []
        self._diagnostics.log(findings)
        self._diagnostics.publish(
            counts, findings, state=state, pairs=len(scene.pairs), stale_boxes=' '.join(stale),
            boxes_that_never_came=' '.join(unseen),
            boxes_ahead=' '.join(self._pairing.ahead()), unanswered_pairs=len(look.unanswered))

    def _findings(self, look: Look, unseen: list[str], stale: list[str]) -> Iterator[Finding]:
        """Yield why pairs are not answered, as far as it can be told."""
        max_age = self._settings['max_age']
        if look.unanswered:
            pairs = [pair.label for pair in look.unanswered]
            yield Finding('unanswered', f'unanswered for {UNANSWERED_SECONDS:g} s: {listed(pairs)}',
                          level=ERROR)
        if look.refused:
            yield Finding('refused', f'poses refused: {", ".join(look.refused)}')
        if unseen and (look.unmatched or (
                not look.has_heard and look.quiet >= UNANSWERED_SECONDS)):
            yield Finding('unseen', f'no pose ever came: {listed(unseen)}',
                          '; '.join(map(self._topics.why_silent, unseen[:NAMED])))
        if stale:
            yield Finding('stale', f'stale boxes: {listed(stale)}', '' if (
                self.solver.scene.pose_array or not look.unmatched) else self._why_stale(stale[0]))
        if look.has_heard and 0 < max_age <= look.quiet:
            yield Finding('stopped', f'poses have stopped: none for {look.quiet:.0f} s')
        elif look.unmatched and not (look.refused or unseen or stale):
            yield self._without_partner(look)

    def _why_stale(self, box: str) -> str:
        behind, max_age = self._pairing.behind(box), self._settings['max_age']
        if behind is None or not self._topics.is_heard(box):
            return self._topics.why_silent(box)
        return (f'the newest stamp of {box} is {1e-9 * behind:.3g} s behind, max_age is '
                f'{max_age:g} s; does its publisher live, and stamp by the same clock?')

    def _without_partner(self, look: Look) -> Finding:
        """Return by how much the stamps of a pair differ, and the tolerance that would do."""
        message = 'poses without a partner'
        found = self._pairing.mismatch((pair.a, pair.b) for pair in islice(
            look.unmatched, COMPARED))
        if found is None:
            return Finding('alone', message, 'none could be answered, as no tick had all its boxes')
        message += (f': stamps of {found.one} and {found.other} differ by '
                    f'{1e-9 * found.difference:.3g} s')
        if not found.tolerance:
            return Finding('clocks', message, 'none could be answered; stamp both by one clock '
                                              '(use_sim_time for all, or for none)')
        return Finding('apart', message, 'none could be answered; set tolerance:='
                       f'{rounded_up(1e-9 * found.tolerance):g}, or pairing:=latest')

    def _answer(self, tick: Tick) -> None:
        stamp, frame_id = self._header_of(tick)
        started = time.perf_counter_ns()
        answer = self.solver(tick[0].numbers if tick[0] and self.solver.scene.pose_array
                             else [pose and pose.numbers for pose in tick])
        took = time.perf_counter_ns() - started
        messages = self._messages
        messages.begin(stamp, frame_id)
        for pair, contact in answer.touching:
            publishers = self._topics.publishers.get(pair)
            if publishers is not None:
                point, normal = publishers
                point.publish(messages.point(contact))
                normal.publish(messages.normal(contact))
        if self._wrenches is not None:
            self._publish_wrenches(self._wrenches, answer, tick)
        if self._topics.contacts is not None:
            self._topics.contacts.publish(messages.contacts(answer))
        if self._topics.cloud is not None:
            self._topics.cloud.publish(messages.cloud(answer))
        # What nobody waits for comes last.
        stale = len(answer.stale)
        # A box that an array leaves out is not there: nobody asks for its pairs.
        self._diagnostics.computed(took, [] if self.solver.scene.pose_array else answer.stale)
        counts = self.counts
        counts['contacts'] += len(answer.touching)
        counts['evaluations'] += 1
        counts['stale pairs'] += stale

    def _publish_wrenches(self, wrenches: PairWrenches, answer: Answer, tick: Tick) -> None:
        """Publish the wrenches of a tick; where a new time has begun, from a new start."""
        if self._times != self.counts[RESETS]:
            self._times = self.counts[RESETS]
            wrenches.reset()
        for pair, wrench in wrenches(answer, tick):
            self._topics.wrenches[pair].publish(self._messages.wrench(wrench))

    def _header_of(self, tick: Tick) -> tuple[int, str]:
        """Return the newest stamp [ns] of a tick and its frame; raise Refused if frames differ."""
        stamp, frame_id = NEVER, self.solver.scene.frame_id or None
        for pose in tick:
            if pose is not None:
                if frame_id is None:
                    frame_id = pose.frame_id
                elif pose.frame_id != frame_id:
                    raise Refused('frame_id differs', self._frames(tick, pose))
                if pose.stamp > stamp:
                    stamp = pose.stamp
        # Where all boxes are fixed there is no stamp.
        return 0 if stamp == NEVER else stamp, frame_id or ''

    def _frames(self, tick: Tick, odd: StampedPose) -> str:
        """Describe the frame of a tick, by the scene or the first box, and that of a pose."""
        scene = self.solver.scene
        known = [(box, pose) for box, pose in zip(scene.streams, tick) if pose is not None]
        one, frame = ('the scene', scene.frame_id) if scene.frame_id else (
            known[0][0], known[0][1].frame_id)
        box = next(box for box, pose in known if pose is odd)
        advice = ('the leading slash is the difference'
                  if frame.lstrip('/') == odd.frame_id.lstrip('/')
                  else 'set header.frame_id' if not (frame and odd.frame_id)
                  else 'publish both in one frame, or give the box a frame in the scene file')
        return f'{one} is in frame {shown(frame)}, {box} in {shown(odd.frame_id)}: {advice}'

    def _refuse(self, error: Exception, topic: str) -> None:
        """Count what was refused; keep the first line of its kind for the next report."""
        if isinstance(error, (Refused, TooManyNear)):
            reason, text = error.reason, f'{topic}: {error}'
        else:
            reason, text = 'internal error', f'{type(error).__name__}: {error}'
        self.counts[f'refused: {reason}'] += 1
        kind, remedy = kind_and_remedy(reason, text)
        if kind not in self._refusals:
            self._refusals[kind] = f'{text}; refused{remedy}'


def _checked(pose: StampedPose) -> StampedPose:
    """Return a pose that can be answered, or raise Refused."""
    fault = pose_fault(pose.numbers)
    if fault:
        raise Refused('bad pose', fault)
    return pose

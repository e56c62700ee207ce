"""Evaluation of ticks: poses are read, paired, handed to the solver; contacts are published."""
from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ..scene.scene_solver import ALL_BOXES, SceneSolver
from ..scene.stamp_pairing import NEVER, PAIRINGS, Pairing, StampedPose, Tick
from ..solver.checks import absent_poses, are_poses, pose_fault, shown
from .diagnostics import UNMATCHED_SECONDS, Diagnostics
from .message_bytes import RawMessages
from .messages import NANOSECONDS, Refused, TypedMessages
from .runtime import LOG_SECONDS
from .scene_topics import SceneTopics

SERIALIZATIONS: dict[str, type[RawMessages] | type[TypedMessages]] = {
    'raw': RawMessages, 'typed': TypedMessages}
"""Values of the node parameter `serialization`."""
OUTSIDE = 'outside the trained range'


class Evaluator:
    """Answers ticks of poses; every pose that is refused is counted and logged, never answered."""

    _pairing: Pairing
    _messages: RawMessages | TypedMessages

    def __init__(self, solver: SceneSolver, settings: Mapping[str, Any], *, topics: SceneTopics,
                 counts: Counter[str], diagnostics: Diagnostics, logger: Any) -> None:
        """Begin without poses; `settings` are the checked parameters."""
        self._topics, self._diagnostics, self._logger = topics, diagnostics, logger
        self.counts = counts
        self._settings: Mapping[str, Any] = {}
        self.set_solver(solver, settings)

    def set_solver(self, solver: SceneSolver, settings: Mapping[str, Any]) -> None:
        """Replace the solver and its scene; poses that wait stay unless the pairing changes."""
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
        self.solver, self._settings = solver, settings
        self._absent = np.zeros(0, dtype=bool)  # which boxes the last array had no pose of
        self._silent_until = 0.0  # by the monotonic clock: when a refusal is logged again [s]

    def close(self) -> None:
        """Keep the count of a solver that goes."""
        self.counts[OUTSIDE] += self.solver.exact_answers

    def reset(self) -> None:
        """Forget all poses."""
        self._pairing.reset()

    def pose_callback(self, box: str, topic: str) -> Callable[[Any], None]:
        """Return the callback for the poses of a box, or of all; it raises nothing at all."""
        def callback(message: Any) -> None:
            self.counts['poses'] += 1
            try:
                pose = (self._read_all(message) if box == ALL_BOXES
                        else self._messages.read_pose(message))
                ticks = self._pairing.add(box, pose)
            except Exception as error:
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

    def report(self) -> None:
        """Publish the diagnostics; warn of poses that come and cannot be answered."""
        counts = +self.counts
        counts[OUTSIDE] += self.solver.exact_answers
        scene = self.solver.scene
        stale = self._pairing.stale()
        if scene.pose_array:
            stale = [box for box, absent in zip(scene.moving, self._absent) if absent]
        unanswered = self._diagnostics.publish(counts, len(scene.pairs), stale)
        if unanswered > UNMATCHED_SECONDS:
            self._logger.warning(
                f'poses arrive, but none could be answered for {UNMATCHED_SECONDS:g} s (pairing '
                f'{self._settings["pairing"]!r}: do the stamps of all boxes agree?)',
                throttle_duration_sec=LOG_SECONDS)

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
        if self._topics.contacts is not None:
            self._topics.contacts.publish(messages.contacts(answer))
        if self._topics.cloud is not None:
            self._topics.cloud.publish(messages.cloud(answer))
        # What nobody waits for comes last.
        stale = len(answer.stale)
        self._diagnostics.computed(took, evaluated=stale < len(self.solver.scene.pairs))
        counts = self.counts
        counts['contacts'] += len(answer.touching)
        counts['evaluations'] += 1
        counts['stale pairs'] += stale

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
        return stamp, frame_id or ''

    def _frames(self, tick: Tick, odd: StampedPose) -> str:
        """Describe the frame of a tick, by the scene or the first box, and that of a pose."""
        scene = self.solver.scene
        known = [(box, pose) for box, pose in zip(scene.sources, tick) if pose is not None]
        one, frame = ('the scene', scene.frame_id) if scene.frame_id else (
            known[0][0], known[0][1].frame_id)
        box = next(box for box, pose in known if pose is odd)
        return f'{one} is in frame {shown(frame)}, {box} in {shown(odd.frame_id)}'

    def _refuse(self, error: Exception, topic: str) -> None:
        """Count what was refused; log it, unless there was another a moment ago."""
        if isinstance(error, Refused):
            reason, text = error.reason, f'{topic}: {error}'
        else:
            reason, text = 'internal error', f'{type(error).__name__}: {error}'
        self.counts[f'refused: {reason}'] += 1
        now = time.monotonic()
        if now >= self._silent_until:  # rclpy's own throttle takes 0.2 ms for what it leaves out
            self._silent_until = now + LOG_SECONDS
            self._logger.warning(f'{text}; refused')

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The crane as a node: publishes poses, and simulates under the contacts that answer them."""
from __future__ import annotations

import gc
import math
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, PoseStamped, Vector3, WrenchStamped
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from box_contact_msgs.msg import Contacts

from ..node.messages import make_header, pose_message
from ..node.parameters import declare, warn_of_unknown
from ..node.runtime import REFUSALS, GuardedNode, running_node, spin_once
from ..node.topics import DEEP_RELIABLE, contact_qos
from ..stream.read_contacts import read_contacts
from . import CRANE_PARAMETERS, CRANE_ROPES, CRANE_WRENCH
from .crane import CraneScenario
from .landing import CORNER_SPEED_LIMIT, ClosedLoop, Landing, LandingRecord, LoopState, with_patch

FRAME = 'world'  # of the published poses
OFFER_PERIOD = 0.1  # time between the pairs that only ask whether anyone answers [s]
ANSWER_SHARE = 0.8  # share of a tick that waits for its answer; the rest is for simulating it
DRAIN = 1.0  # patience for the last answers [s]
LOOK_PERIOD = 0.05  # time after which a signal is noticed, at most [s]
LOOK_RATE = 30.0  # forces published, and looks at the landing's stage, at most [Hz]
ROPE_WIDTH = 0.04  # as drawn [m]
STAGES = ('hanging', 'first touch', 'settling', 'at rest')
POINTS_ALONE = ("the contact node's model gives contacts without a patch: the whole load stands "
                'for it, and may not come to rest')


class CraneNode(GuardedNode):
    """Publishes the poses of a crane, and lands it on the answers."""

    def __init__(self, context: Context, scenario: CraneScenario | None = None,
                 **options: Any) -> None:
        """Read the parameters and make the crane; `options` go to Node."""
        super().__init__('crane', context=context, **options)
        values = declare(self, CRANE_PARAMETERS)
        warn_of_unknown(self, CRANE_PARAMETERS)
        self._rate, self._wait, self._lockstep, self._paced, self._judge_force = (
            values[name] for name in ('rate', 'wait', 'lockstep', 'paced', 'judge_force'))
        self._look_every = math.ceil(self._rate / LOOK_RATE)
        self.loop = ClosedLoop(scenario or CraneScenario(), self._rate)
        self._asked: dict[int, LoopState | None] = {}
        """What was published and not answered yet, by stamp [ns]; None for an offer."""
        self._matched = False  # whether an offer was answered
        self.latencies: list[float] = []  # from the poses' stamp to each contact [s]
        self._poses = [self.create_publisher(PoseStamped, f'{box}/pose', DEEP_RELIABLE)
                       for box in ('box_a', 'box_b')]
        self._contacts = self.create_subscription(
            Contacts, 'contacts', self._on_contacts, DEEP_RELIABLE, raw=True)
        self._force = self.create_publisher(WrenchStamped, CRANE_WRENCH, contact_qos())
        self._ropes = self.create_publisher(Marker, CRANE_ROPES, contact_qos())

    @property
    def lost(self) -> int:
        """Return how many published pairs have no answer yet."""
        return len(self._asked)

    def await_node(self, executor: Any) -> None:
        """Offer the start poses until one pair is answered; raise TimeoutError after `wait` s.

        Matched endpoints alone do not say that the other side has matched too, or spins already.
        """
        deadline = time.monotonic() + self._wait
        while not self._matched:
            if time.monotonic() > deadline:
                raise TimeoutError(f'no answer within {self._wait:g} s on '
                                   f'{self._contacts.topic_name}; is a contact_node running?')
            self._publish(None)
            self._serve(executor, OFFER_PERIOD, lambda: self._matched)
        self._asked.clear()  # late answers to offers are nobody's

    def lower(self, executor: Any) -> None:
        """Run the landing in real time or in lockstep, then wait a moment for the last answers.

        Raises TimeoutError in lockstep when an answer does not come within `wait` s.
        """
        gc.collect()
        gc.freeze()  # a full collection would hold up the poses for milliseconds
        patience = self._wait if self._lockstep else ANSWER_SHARE / self._rate
        due = time.perf_counter()
        stages = Stages(self.loop.record)
        for tick in count():
            if self._paced or not self._lockstep:
                self._serve(executor, due - time.perf_counter())
            stamp = self._publish(self.loop.ask())
            if tick % self._look_every == 0:
                self._publish_forces(stamp)
                for line in stages.lines():
                    print(line, flush=True)
            self._serve(executor, patience, lambda: stamp not in self._asked)  # noqa: B023
            if self._lockstep and stamp in self._asked:
                raise TimeoutError(f'no answer within {self._wait:g} s')
            self.loop.step()
            if self.loop.record.ended:
                break
            due += 1.0 / self._rate
            if self._lockstep:  # the time of a late answer is not made up for
                due = max(due, time.perf_counter())
        self._serve(executor, DRAIN, lambda: not self._asked)

    def judge(self) -> Landing:
        """Return the figures of the landing; its force has a limit if `judge_force` is set."""
        landing = self.loop.record.judge()
        return landing if self._judge_force else replace(landing, force_limit=math.inf)

    def _serve(self, executor: Any, seconds: float, done: Callable[[], bool] = lambda: False,
               ) -> None:
        """Serve callbacks for so long, or until `done`; raise what ends the program on a signal."""
        deadline = time.perf_counter() + seconds
        while not done() and (left := deadline - time.perf_counter()) > 0.0:
            spin_once(self, executor, min(left, LOOK_PERIOD))
        if not self.context.ok():
            raise ExternalShutdownException

    def _publish(self, state: LoopState | None) -> int:
        """Publish both poses under one stamp [ns], the node's clock now; None: as an offer."""
        stamp = self._now()
        self._asked[stamp] = state  # before they are published: answers may be fast
        header, crane = make_header(stamp, FRAME), self.loop.crane
        for publisher, pose in zip(self._poses, (crane.load_pose, crane.scenario.stack_pose)):
            publisher.publish(pose_message(header, pose))
        return stamp

    def _on_contacts(self, data: bytes) -> None:
        """Take the answer to a pair that was asked for; a stale pair is no answer."""
        received, answer = self._now(), read_contacts(data)
        if answer.stamp not in self._asked or answer.stale:
            return
        state = self._asked.pop(answer.stamp)
        if state is None:
            self._matched = True
            return
        latency = (received - answer.stamp) * 1e-9
        touches = {name: contact for (name, _, _), contact in zip(
            answer.names, answer.contacts)}
        if touches:
            self.latencies.append(latency)
        if not all(math.isfinite(contact.volume) for contact in touches.values()):
            self.get_logger().warning(POINTS_ALONE, once=True)
        scenario = self.loop.crane.scenario
        self.loop.answer(state, {name: with_patch(contact, state.pose, scenario.size)
                                 for name, contact in touches.items()},
                         latency=0.0 if self._lockstep else latency)

    def _publish_forces(self, stamp: int) -> None:
        """Publish the force on the load of the last physics step, and the ropes."""
        record, header = self.loop.record, make_header(stamp, FRAME)
        if not record.forces:
            return
        message = WrenchStamped(header=header)
        x, y, z = map(float, record.forces[-1])
        message.wrench.force = Vector3(x=x, y=y, z=z)
        self._force.publish(message)
        ropes = Marker(header=header, ns='ropes', type=Marker.LINE_LIST, color=ColorRGBA(a=1.0))
        ropes.scale.x = ROPE_WIDTH
        ropes.points = [Point(x=x, y=y, z=z)
                        for x, y, z in self.loop.crane.ropes.reshape(-1, 3).tolist()]
        self._ropes.publish(ropes)

    def _now(self) -> int:
        return int(self.get_clock().now().nanoseconds)


class Stages:
    """The landing's stages as they come, a line each, for people who watch."""

    def __init__(self, record: LandingRecord) -> None:
        """Follow a record while it grows."""
        self._record, self._reached = record, -1

    def lines(self) -> list[str]:
        """Return a line for each stage that was reached since the last call."""
        record = self._record
        if not record.forces:
            return []
        tick, speed = len(record.forces), float(record.corner_speeds(-1)[-1])
        reached = (0 if not record.points else 1 if record.tensions[-1].any() else
                   2 if speed > CORNER_SPEED_LIMIT else 3)
        lines = [f'{tick / record.rate_hz:7.2f} s  {stage:<12} fastest corner '
                 f'{1e3 * speed:8.3g} mm/s, contact force {record.forces[-1][2] / 1e3:5.1f} kN'
                 for stage in STAGES[self._reached + 1:reached + 1]]
        self._reached = max(self._reached, reached)
        return lines


def verdict(landing: Landing, latencies: Sequence[float], lost: int) -> tuple[bool, str]:
    """Return whether a landing passed, and that in one line with the reasons.

    latencies: of each contact [s]; lost: how many answers did not come.
    """
    faults = ([] if latencies else ['no contacts came']) + (
        [f'{lost} lost answers'] if lost else []) + (
        [f'the load did not come to rest on the stack (not met: {", ".join(landing.missed)})']
        if landing.missed else [])
    if faults:
        return False, f'FAIL: {", ".join(faults)}'
    p50, p99 = 1e3 * np.percentile(latencies, (50, 99))
    return True, (f'PASS: the load is at rest, settled {landing.settled:.1f} s after the first '
                  f'touch; {len(latencies)} contacts, none lost; latency p50 {p50:.2f} ms, '
                  f'p99 {p99:.2f} ms')


def run(args: Sequence[str] | None) -> int:
    """Land once; 0 only if the load came to rest and no answer was lost."""
    try:
        with running_node(CraneNode, args, signals=SignalHandlerOptions.ALL) as (node, executor):
            node.await_node(executor)
            node.lower(executor)
            landing = node.judge()
            passed, words = verdict(landing, node.latencies, node.lost)
            corners = node.loop.forces.corner_loads()
    except KeyboardInterrupt:
        return 130  # 128 + SIGINT, as shells report it
    except ExternalShutdownException:
        return 143  # 128 + SIGTERM, which shuts the context down under whatever runs
    except (*REFUSALS, TimeoutError) as error:
        print(f'error: {error}', file=sys.stderr)
        return 1
    print('\n'.join(filter(None, (words, str(landing), corners))), flush=True)
    return 0 if passed else 1

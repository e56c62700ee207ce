# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The crane client: publishes both poses in real time and measures the contacts that come back.

`box_a` is the load on the ropes, `box_b` the stack. Open loop, contacts are recorded, not fed back;
closed loop, they push the load, which is set down and comes to rest. One thread simulates and
publishes on an absolute schedule; the executor receives in the main thread. The exit status is 0
only if contacts came through, nothing was lost, and, closed loop, the stack carries the load.
"""

from __future__ import annotations

import gc
import math
import sys
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, Vector3, WrenchStamped
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException
from rclpy.signals import SignalHandlerOptions
from visualization_msgs.msg import MarkerArray

from ..node.declared_parameters import declare
from ..node.messages import make_header
from ..node.parameters import answer_help
from ..node.ros_client import (
    ANSWERS,
    CRANE_MARKERS,
    CRANE_WRENCH,
    DEEP_RELIABLE,
    answer_values,
    line_marker,
    pose_message,
    stamp_of,
)
from ..node.runtime import CONTACT_QOS, REFUSALS, GuardedNode, joined, spin_once
from ..output import percentiles
from ..solver.contact_solver import ContactSolver
from ..view.style import ROPE
from .crane_feedback import CraneFeedback
from .crane_log import CraneLog, CraneSummary, Screen
from .crane_parameters import PARAMETERS, scenario_from
from .landing import LandingResult, Progress
from .mujoco_crane import Crane

OFFER_PERIOD = 0.1  # s between the pairs that only ask whether anyone answers
POINTS_ALONE = ("the contact node's model gives contacts without a patch: the whole load stands "
                'for it, and may not come to rest')
DRAW_RATE = 30.0  # Hz at most
DRAIN = 1.0  # s of patience for the last answers


class CraneNode(GuardedNode):
    """Publishes the crane's poses and gathers the answers in a `CraneLog`."""

    def __init__(self, context: Context, **options: Any) -> None:
        """Read the parameters, make the reference; `options` go to Node."""
        super().__init__('crane', context=context, **options)
        values = declare(self, PARAMETERS, fixed=True)
        self.rate, self.wait = values['rate'], values['wait']
        self.report, self.frame_id = values['report'], values['frame_id']
        self.scenario = scenario_from(values)
        self._draw_every = math.ceil(self.rate / DRAW_RATE)
        self.ticks = round(self.scenario.duration * self.rate)
        self.log = CraneLog(self.ticks)
        self.stop = threading.Event()
        self.in_real_time = not (values['closed_loop'] and values['lockstep'])
        self.feedback = CraneFeedback(
            self.scenario, self.rate, latency=values['latency'], lockstep=values['lockstep'],
            stop=self.stop) if values['closed_loop'] else None
        self.crane = (self.feedback.loop.crane if self.feedback else
                      Crane(self.scenario, self.rate))
        self.solver = ContactSolver(self.scenario.size, self.scenario.stack_size, model='exact')

        self._crane_markers = self.create_publisher(MarkerArray, CRANE_MARKERS, CONTACT_QOS)
        self._crane_wrench = self.create_publisher(WrenchStamped, CRANE_WRENCH, CONTACT_QOS)
        self._publishers_ab = [self.create_publisher(PoseStamped, f'{box}/pose', DEEP_RELIABLE)
                               for box in ('box_a', 'box_b')]
        self._answers = [
            self.create_subscription(message, topic, partial(self._on_answer, kind), DEEP_RELIABLE)
            for kind, (message, topic) in ANSWERS.items()]

    def unmatched(self) -> list[str]:
        """Return the topics that have no counterpart yet."""
        return [p.topic_name for p in self._publishers_ab if not p.get_subscription_count()] + [
            s.topic_name for s in self._answers if not s.get_publisher_count()]

    def await_answers(self) -> None:
        """Offer the start poses until one pair is answered; raise TimeoutError after `wait` s.

        Matched endpoints alone do not say that the other side has matched too, or spins already.
        """
        deadline = time.monotonic() + self.wait
        while not self.log.offers_answered and not self.stop.is_set():
            if time.monotonic() > deadline:
                unmatched = ', '.join(self.unmatched())
                what = f'nobody at the other end of {unmatched}' if unmatched else 'no answer'
                raise TimeoutError(f'{what} within {self.wait:g} s; is a contact_node running?')
            if not self.unmatched():
                self._publish(offer=True)
            self.stop.wait(OFFER_PERIOD)

    def lower(self) -> None:
        """Run the motion, then wait a moment for the last answers.

        A landing ends when all that is judged was seen.
        """
        gc.collect()
        gc.freeze()  # a full collection would hold up the poses for milliseconds
        start = time.perf_counter()
        for tick in range(self.ticks):
            # The schedule is absolute: lateness of one tick is not handed on to the next.
            early = start + tick / self.rate - time.perf_counter() if self.in_real_time else 0.0
            if self.stop.wait(max(0.0, early)):
                return
            stamp = self._publish()
            if tick % self._draw_every == 0:
                self._draw(stamp)
                self._tell_force(stamp)
            if self.feedback is None:
                self.crane.step()
            else:
                self.feedback.step(stamp)
                if self.feedback.points_alone:
                    self.get_logger().warning(POINTS_ALONE, once=True)
                if self.feedback.loop.record.ended:
                    break
        deadline = time.monotonic() + DRAIN
        while self.log.outstanding and time.monotonic() < deadline:
            if self.stop.wait(0.02):
                return

    def summary(self) -> CraneSummary | None:
        """Return how good the answers were, None if nothing was sent."""
        return self.log.summary(self.solver, min(max(self.scenario.size),
                                                 max(self.scenario.stack_size)))

    def landing(self) -> LandingResult | None:
        """Return how the landing went, None in an open loop."""
        return self.feedback.loop.record.judge() if self.feedback else None

    def _publish(self, *, offer: bool = False) -> int:
        """Publish both poses under one stamp [ns], the node's clock now; note them beforehand."""
        stamp = self._now()
        poses = self.crane.load_pose, self.crane.stack_pose
        if offer:
            self.log.offers.add(stamp)
        else:
            self.log.sent_poses(stamp, *poses)
            if self.feedback:
                self.feedback.ask(stamp)
        header = make_header(stamp, self.frame_id)
        for publisher, pose in zip(self._publishers_ab, poses):
            publisher.publish(pose_message(header, pose))
        return stamp

    def _draw(self, stamp: int) -> None:
        """Publish ropes, and the spreader's frame between their lower ends, if anyone looks."""
        if not self._crane_markers.get_subscription_count():
            return
        header, ropes = make_header(stamp, self.frame_id), self.crane.ropes
        corners = ropes[[0, 1, 3, 2], 1]  # once around
        spreader = np.stack([corners, np.roll(corners, 1, axis=0)], axis=1)
        self._crane_markers.publish(MarkerArray(markers=[
            line_marker(header, name, lines, width=width, colour=ROPE)
            for name, lines, width in (('ropes', ropes, 0.04), ('spreader', spreader, 0.15))]))

    def _tell_force(self, stamp: int) -> None:
        """Publish the contacts' force on the load, of the last physics step before a tick."""
        if self.feedback and self.feedback.loop.record.forces:
            message = WrenchStamped(header=make_header(stamp, self.frame_id))
            x, y, z = map(float, self.feedback.loop.record.forces[-1])
            message.wrench.force = Vector3(x=x, y=y, z=z)
            self._crane_wrench.publish(message)

    def _now(self) -> int:
        return int(self.get_clock().now().nanoseconds)

    def _on_answer(self, kind: str, message: Any) -> None:
        received, stamp = self._now(), stamp_of(message.header)
        values = answer_values(kind, message)
        if kind == 'cloud' and self.feedback:  # before the log: here somebody waits
            self.feedback.answer(stamp, np.asarray(values), received)
        self.log.answer(kind, stamp, received, values)


def receive_while(node: CraneNode, executor: Any, work: Callable[[], None],
                  screen: Screen | None = None) -> None:
    """Receive while `work` runs in a thread of its own; raise what it raises."""
    progress = Progress(node.feedback.loop.record) if node.report and node.feedback else None
    with ThreadPoolExecutor(max_workers=1) as pool:
        future = pool.submit(work)
        try:
            while not future.done():
                spin_once(node, executor, 0.05)
                if not node.context.ok():  # SIGTERM; the executor may return without a word
                    raise ExternalShutdownException
                if screen:
                    screen.progress(node.log.sent_pairs / node.rate)
                    for line in progress.lines() if progress else ():
                        screen.line(line)
        except BaseException:
            node.stop.set()
            raise
    future.result()


def main(args: Sequence[str] | None = None) -> int:
    """Run the crane once; 0 only if contacts came through, none was lost, and the stack carries."""
    answer_help('crane', __doc__, PARAMETERS, args)
    node, signalled = None, 0
    try:
        with joined(CraneNode, args, signals=SignalHandlerOptions.ALL) as (node, executor):
            screen = Screen('the crane moves', node.scenario.duration)
            receive_while(node, executor, node.await_answers)
            with screen:
                receive_while(node, executor, node.lower, screen)
    except KeyboardInterrupt:
        signalled = 130  # 128 + SIGINT, as shells report it
    except ExternalShutdownException:
        signalled = 143  # 128 + SIGTERM, which shuts the context down under whatever runs
    except (*REFUSALS, TimeoutError) as error:
        print(f'error: {error}', file=sys.stderr)
        return 1
    summary, landing = (node.summary(), node.landing()) if node else (None, None)
    if node is None or summary is None:
        return signalled
    passed, words = verdict(summary, landing)
    if not signalled:
        screen.verdict(passed, words)
    screen.tables(
        f'crane: {"interrupted" if signalled else "done"} after '
        f'{summary.result.sent / node.rate:g} s of motion at {node.rate:g} Hz',
        *filter(None, (summary, landing)))
    return signalled or (0 if passed else 1)


def verdict(summary: CraneSummary, landing: LandingResult | None) -> tuple[bool, str]:
    """Return whether a run passed, and that in one line with the reasons.

    landing: None for an open loop.
    """
    faults = summary.faults
    if landing is not None and not landing.carried:
        faults.append('the load did not come to rest on the stack')
    if faults:
        return False, f'FAIL: {", ".join(faults)}'
    figures = [f'{summary.result.contacts} contacts, none lost',
               f'median latency {1e3 * percentiles(summary.latencies, 50)[0]:.2f} ms']
    if landing is not None:
        state = 'is at rest' if landing.at_rest else 'lies on the stack, not within all limits'
        figures.insert(0, f'the load {state}, settled {landing.settled:.1f} s after the first '
                          'touch')
    return True, f'PASS: {"; ".join(figures)}'

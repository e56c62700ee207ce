# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The closed loop of the crane client: contacts that come back push the load.

Plain Python, no ROS. One thread asks and simulates (`ask`, `step`), another hands the answers in
(`answer`). The loop itself is `landing.ClosedLoop`.

In real time a tick is simulated at its end. First its poses are published, then the answer is
awaited for most of the tick. The contact acts from the time at which it really came. Simulated
at its beginning, a tick would delay every contact by a tick, and the load would rest less flat.
In lockstep the simulation waits for every answer. The contact acts exactly `latency` after its
poses were published.
"""
from __future__ import annotations

import threading
import time
from queue import Empty, SimpleQueue

import numpy as np

from ..solver.contact import Contact
from .answer_log import is_stale, touch_in
from .landing import ClosedLoop, with_patch
from .load_laws import LoopState
from .mujoco_crane import CraneScenario

ANSWER_SHARE = 0.8
"""Share of a tick that waits for its answer in real time; the rest is for simulating it."""
LOCKSTEP_PATIENCE = 1.0
"""Time [s] after which lockstep takes an answer for lost, and goes on with the patch it holds."""
LOCKSTEP_LOST_MOST = 5
"""So many lost answers in a row end a run in lockstep: then nobody is there any more."""
POLL = 0.1  # s between looks at whether the run was called off


class CraneFeedback:
    """Steps a crane under the contacts that come back, and records the landing."""

    def __init__(self, scenario: CraneScenario, rate_hz: float, *, latency: float,
                 lockstep: bool, stop: threading.Event) -> None:
        """No contact acts before `latency` [s] after asking; `stop` ends every waiting.

        In real time answers are lost, so the law's constants are made for a period's latency.
        """
        self.loop = ClosedLoop(scenario, rate_hz, latency=latency if lockstep else
                               max(latency, 1.0 / rate_hz))
        self._rate_hz, self._latency, self._lockstep = rate_hz, latency, lockstep
        self._size, self._stop = scenario.size, stop
        self._pair, = scenario.pairs
        self.points_alone = 0  # contacts whose model gave no patch
        self._asked: dict[int, LoopState] = {}
        self._arrived: SimpleQueue[tuple[int, Contact | None, int]] = SimpleQueue()
        self._lost_in_a_row = 0

    def ask(self, stamp: int) -> None:
        """Note the state whose poses are about to be published under `stamp` [ns]."""
        self._asked[stamp] = self.loop.ask()

    def answer(self, stamp: int, values: np.ndarray, received: int) -> None:
        """Take the first row of a `contacts` cloud, received at `received` [ns] of the same clock.

        No row is no contact; a row of NaN could not be evaluated, which is no answer. Nor is what
        nobody asked for.
        """
        if stamp in self._asked and not is_stale(values):  # else a stranger's
            self._arrived.put((stamp, touch_in(values), received))

    def step(self, stamp: int) -> None:
        """Advance the tick whose poses went out under `stamp`, waiting for its answer first.

        Raises TimeoutError in lockstep when answers stay away altogether.
        """
        patience = LOCKSTEP_PATIENCE if self._lockstep else ANSWER_SHARE / self._rate_hz
        deadline = time.monotonic() + patience
        while stamp in self._asked and not self._stop.is_set():
            left = deadline - time.monotonic()
            try:
                self._apply(*self._arrived.get(timeout=max(0.0, min(left, POLL))))
            except Empty:
                if left <= 0.0:
                    break
        self._lost_in_a_row = self._lost_in_a_row + 1 if stamp in self._asked else 0
        if self._lockstep and self._lost_in_a_row >= LOCKSTEP_LOST_MOST:
            raise TimeoutError(f'no answer to {LOCKSTEP_LOST_MOST} pairs in a row, each awaited '
                               f'for {LOCKSTEP_PATIENCE:g} s')
        self.loop.step()

    def _apply(self, stamp: int, touch: Contact | None, received: int) -> None:
        """Hand an answer to the loop."""
        state = self._asked.pop(stamp, None)
        if state is None:  # an offer's answer, or one that came twice
            return
        # Answers take as long in simulated time as they really took, unless time waits.
        took = 0.0 if self._lockstep else (received - stamp) * 1e-9
        contacts = {} if touch is None else {
            self._pair: with_patch(touch, state.pose, self._size)}
        self.points_alone += bool(touch and contacts[self._pair] is not touch)
        self.loop.answer(state, contacts, latency=max(self._latency, took))

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A service whose costly requests wait for the ticks, and are answered in steps between them."""
from __future__ import annotations

import time
from bisect import insort
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.qos import QoSProfile
from rclpy.service import Service

from box_contact_msgs.msg import Code

from ..solver.checks import TooMuch
from .rclpy_workarounds import Send, answer_later
from .runtime import LONG, GuardedNode

COSTLY = 5e-3
"""Processor time [s] beyond which a request is costly: half a tick at 100 Hz."""
PAUSE = 5.0
"""Pause after costly steps, divided by their time: ticks have five sixths of the node's time."""
SLICE = 2e-3
"""Processor time [s] after which the next step waits for ticks."""
GAP = 1e-3
"""Least time [s] for the ticks that wait: a timer that is due again at once comes before them."""
REST = 3.0
"""Time for ticks after some steps, divided by that of these: three quarters of the node's."""
HEAD_START = 0.01
"""Time [s] by which a request overtakes a waiting one that is larger by 1."""
MOST_WAITING = 16
"""Costly requests that wait for the end of a pause."""
KEPT_TIMES = 4096  # of requests, for a report
KEPT_KINDS = 256
REQUESTS = QoSProfile(depth=128)
"""Of requests, here and at clients: DDS drops what comes while more wait, and its client waits for
ever."""
Kind = tuple[Any, ...]
"""Of requests: what decides how much each part of one costs."""


class NotActive(ValueError):
    """The node has no scene: it is not configured."""

    def __init__(self) -> None:
        super().__init__('the node is not configured')


class Outdated(ValueError):
    """A request is about a scene that the node does not have, or no longer."""


CODES: dict[type[ValueError], int] = {
    NotActive: Code.NOT_ACTIVE, Outdated: Code.OUTDATED, TooMuch: Code.TOO_MUCH,
    ValueError: Code.INVALID}
"""Of refusals, the first class that fits."""


def refuse(response: Any, error: ValueError) -> None:
    """Write why a request is not answered."""
    response.message = str(error)
    response.code.value = next(code for kind, code in CODES.items() if isinstance(error, kind))


class PacedService:
    """Serves requests, and keeps clients that ask costly ones without pause from stopping ticks.

    After the last turn of a costly request, which took T, others wait for PAUSE · T. A client
    that waits asks nothing: a refusal would bring its request again, and ROS takes a
    millisecond to read it. Whether a request is costly is judged by its kind, and by its size.
    Costly ones are answered in turns of a SLICE each, small ones first, so that these never
    wait for the end of a long one.
    """

    def __init__(self, node: GuardedNode, counts: Counter[str], what: str, service: tuple[Any, str],
                 answer: Callable[[Any, Any], Iterable[None]],
                 kind_and_size: Callable[[Any], tuple[Kind, int]], *, in_turn: bool = False,
                 is_timed: bool = False, pause: float = PAUSE) -> None:
        """Serve a service, by its type and name, of a node; `answer` fills in a response in steps.

        It raises ValueError for what it refuses: success, code and message are written here.
        what: what `counts` calls the requests. in_turn: whether none overtakes another. is_timed:
        whether `take_times` is called again and again. pause: that after costly steps, divided by
        their time.
        """
        self._counts, self._what, self._pause = counts, what, pause
        self._answer, self._kind_and_size, self._in_turn = answer, kind_and_size, in_turn
        self._until = 0.0  # end of the pause, by the steady clock [s]
        self._due = 0.0  # when to go on, by the same clock [s]
        self._gap = GAP  # after the last steps [s]
        self._cheap: dict[Kind, int] = {}
        """Size up to which requests are not costly, of the kinds that came last."""
        self._asked: list[Asked] = []
        """Requests that wait for their turn, the next one first."""
        self._now: Asked | None = None  # whose turn it is
        # From taking to answering [s].
        self._times: deque[float] = deque(maxlen=KEPT_TIMES if is_timed else 0)
        self._next_step = node.answered(self._step, service[1])
        self._timer = node.create_timer(LONG, self._go_on, clock=Clock(
            clock_type=ClockType.STEADY_TIME))
        self._timer.cancel()
        self.service: Service = node.create_service(*service, answer, qos_profile=REQUESTS)
        answer_later(self.service, self._take)

    def take_times(self) -> list[float]:
        """Return the times [s] from taking to answering of the requests since the last call."""
        times = list(self._times)
        self._times.clear()
        return times

    def _take(self, request: Any, response: Any, send: Send) -> None:
        """Answer a request now or, if it is costly in a pause, later."""
        kind, size = self._kind_and_size(request)
        asked = Asked(time.monotonic(), request, response, send)
        asked.turn = asked.came + HEAD_START * size
        is_costly = size > self._cheap.get(kind, 0) or (self._in_turn and self._asked)
        waiting = len(self._asked)
        if not is_costly or not (waiting or asked.came < self._until):
            self._run(asked)
        elif len(self._asked) < MOST_WAITING:
            self._queue(asked)
        else:
            self._counts[f'{self._what} refused'] += 1
            response.code.value = Code.BUSY
            response.message = (f'busy: {MOST_WAITING} costly requests wait, as ticks come first; '
                                'ask again later')
            send(response)
        if len(self._asked) > waiting:
            self._wait()

    def _go_on(self) -> None:
        """Do the next steps, or begin with the first request that waits, as its pause is over.

        EventsExecutor may serve a timer too early, and multiplies its events if it is set then.
        """
        if time.monotonic() < self._due:
            return
        self._timer.cancel()
        if self._asked:
            self._run(self._asked.pop(0))
        self._wait()

    def _queue(self, asked: Asked) -> None:
        """Let a request wait for its turn; with `in_turn`, before none but itself."""
        if self._in_turn:
            self._asked.insert(0 if asked.steps else len(self._asked), asked)
        else:
            insort(self._asked, asked, key=attrgetter('turn'))

    def _wait(self) -> None:
        """Let the timer end after ticks that wait now; or with the pause."""
        if not self._asked:
            return
        now = time.monotonic()
        is_begun = self._asked[0].steps is not None
        self._due = now + self._gap if is_begun else max(now + self._gap, self._until)
        self._timer.timer_period_ns = round(1e9 * (self._due - now))
        self._timer.reset()

    def _run(self, asked: Asked) -> None:
        """Do steps of an answer for a SLICE; send it after the last one, else it waits again."""
        began, used = time.monotonic(), time.thread_time()
        self._now = asked
        response = self._next_step(asked.request, asked.response)
        while response is None and time.thread_time() < used + SLICE:
            response = self._next_step(asked.request, asked.response)
        self._now = None
        if response is not None:
            asked.send(response)
        ended = time.monotonic()
        self._gap = max(GAP, REST * (ended - began))
        asked.cost += time.thread_time() - used
        if response is None:
            asked.turn = ended
            self._queue(asked)
            return
        self._counts[f'{self._what} {"answered" if response.success else "refused"}'] += 1
        self._times.append(ended - asked.came)
        kind, size = self._kind_and_size(asked.request)
        cheap = max(self._cheap.pop(kind, 0), size)
        if asked.cost > COSTLY:
            self._until = ended + self._pause * (ended - began)  # after earlier steps, it rested
            cheap = int(size * COSTLY / asked.cost)
        self._cheap[kind] = cheap  # the newest comes last
        if len(self._cheap) > KEPT_KINDS:
            del self._cheap[next(iter(self._cheap))]

    def _step(self, request: Any, response: Any) -> Any:
        """Return the response after the last step, else None."""
        asked = self._now
        assert asked is not None
        try:
            if asked.steps is None:
                asked.steps = iter(self._answer(request, response))
            if next(asked.steps, response) is None:
                return None
        except ValueError as error:
            refuse(response, error)
        else:
            response.success, response.code.value = True, Code.OK
        return response


@dataclass(slots=True)
class Asked:
    """A request, from its coming to its answer."""

    came: float  # [s]
    request: Any
    response: Any
    send: Send
    turn: float = 0.0  # requests come by this time [s]
    steps: Iterator[None] | None = None  # those that are left
    cost: float = 0.0  # processor time of those so far [s]

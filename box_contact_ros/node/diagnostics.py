"""What a contact node reports once a second on /diagnostics."""
from __future__ import annotations

import time
from collections import Counter
from collections.abc import Sequence

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node

from .messages import make_header

DIAGNOSTICS_SECONDS = 1.0
UNMATCHED_SECONDS = 1.0  # poses without an answer for this long are worth a warning
KEPT_TIMES = 4096
"""Evaluations whose computing times are kept for a report: more a second than any node makes."""


class Diagnostics:
    """Computing times of the last second, and the message."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._times = np.zeros(KEPT_TIMES)  # [us], a ring
        self._evaluations = 0
        self._answered_at = time.monotonic()
        self._reported: Counter[str] = Counter()

    def computed(self, nanoseconds: int, *, evaluated: bool) -> None:
        """Note a tick, its time in the solver, and whether any pair of it could be evaluated."""
        self._times[self._evaluations % KEPT_TIMES] = 1e-3 * nanoseconds
        self._evaluations += 1
        if evaluated:
            self._answered_at = time.monotonic()

    def publish(self, counts: Counter[str], pairs: int, stale: Sequence[str]) -> float:
        """Publish `counts` and what happened since the last time.

        Return for how long [s] poses have come without an answer. If some were refused since the
        last time, return 0: their reason has been logged.
        """
        new = Counter(counts)
        new.subtract(self._reported)
        self._reported = Counter(counts)
        ticks, self._evaluations = self._evaluations, 0
        values: dict[str, object] = dict(counts)
        values['pairs'] = pairs
        values['stale boxes'] = ' '.join(stale)
        values['rate [1/s]'] = ticks
        if ticks:
            values |= {f'compute {name} [us]': f'{value:.1f}' for name, value in zip(
                ('p50', 'p99', 'max'),
                np.percentile(self._times[:min(ticks, KEPT_TIMES)], (50, 99, 100)))}
        refused = any(new[name] > 0 for name in new if name.startswith('refused'))
        unanswered = time.monotonic() - self._answered_at if new['poses'] and not refused else 0.0
        level, message = DiagnosticStatus.WARN, 'poses refused'
        if not refused:
            if unanswered > UNMATCHED_SECONDS:
                message = 'poses without a partner'
            elif stale:
                message = 'stale boxes'
            else:
                level, message = DiagnosticStatus.OK, 'answering' if ticks else 'no poses'
        status = DiagnosticStatus(
            level=level, name=f'{self._node.get_fully_qualified_name()}: contacts',
            message=message, hardware_id='none',
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()])
        header = make_header(self._node.get_clock().now().nanoseconds, '')
        self._publisher.publish(DiagnosticArray(header=header, status=[status]))
        return unanswered

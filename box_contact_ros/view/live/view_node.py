# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The live page as a node: draws what a listener has heard, contacts and the force of a crane."""
from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from rclpy.context import Context
from rclpy.qos import QoSProfile, ReliabilityPolicy
from visualization_msgs.msg import Marker

from ...demo import CRANE_ROPES, CRANE_WRENCH
from ...node.messages import stamp_of
from .. import VIEW_PARAMETERS
from .listener import Listener

FRAME_PERIOD = 1 / 30
FIGURES_PERIOD = 0.1  # time [s] between new figures: faster, nobody can read them
FORCE_AGE = 100_000_000  # [ns] between a force and a tick: the crane publishes every 33 ms


class ViewNode(Listener):
    """Draws on a page what it has heard when a timer triggers."""

    def __init__(self, context: Context, **options: Any) -> None:
        from .page import Page  # only here: viser is an extra

        # Best effort: the view must never hold up the contact node.
        qos = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
        super().__init__('view', context, VIEW_PARAMETERS, qos, **options)
        self.model = ''  # of the contact node, as /diagnostics tells it
        self._force = (0, math.nan)  # stamp [ns], upward part [N]
        self._ropes = np.zeros((0, 2, 3))  # ends [m]
        self._figures_at = 0.0  # monotonic time [s]
        self.create_subscription(DiagnosticArray, '/diagnostics', self._on_diagnostics, 10)
        self.create_subscription(WrenchStamped, CRANE_WRENCH, self._on_force, qos)
        self.create_subscription(Marker, CRANE_ROPES, self._on_ropes, qos)
        host = self.values['host']
        try:
            self._page = Page(host, self.values['port'], self.rows)
        except OSError as error:
            raise ValueError(f'host {host}: {error.strerror}') from error
        print(f'view: open {self._page.url}', flush=True)
        self.create_timer(FRAME_PERIOD, self._draw)

    def destroy_node(self) -> None:
        """End the page, too."""
        self._page.close()
        super().destroy_node()

    def force(self, stamp: int) -> float:
        """Return the upward force [N] of the contacts on a crane's load at a stamp [ns], or NaN."""
        at, force = self._force
        return force if abs(stamp - at) <= FORCE_AGE else math.nan

    def _draw(self) -> None:
        tick = None if self.quiet else self.tick()
        if tick is not None:
            self._page.draw(tick, self._ropes)
        if time.monotonic() >= self._figures_at:
            self._figures_at = time.monotonic() + FIGURES_PERIOD
            self._page.show(tick, self.force(tick.stamp) if tick else math.nan, model=self.model,
                            lands_again=len(self._ropes) > 0)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        name = f'{self.get_namespace().rstrip("/")}/contact_node: contacts'
        for status in message.status:
            if status.name == name:
                self.model = next((value.value for value in status.values if value.key == 'model'),
                                  '')

    def _on_ropes(self, message: Marker) -> None:
        if message.type == Marker.LINE_LIST and len(message.points) % 2 == 0:
            ends = [(end.x, end.y, end.z) for end in message.points]
            self._ropes = np.reshape(ends, (-1, 2, 3)) if np.isfinite(ends).all() else self._ropes

    def _on_force(self, message: WrenchStamped) -> None:
        self._force = stamp_of(message.header), message.wrench.force.z

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page: drawing, read-outs and controls, served by viser. No ROS."""
from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import viser

from ...solver.models import NATIVE, SOUP_DIVISIONS
from ..style import CONTACT
from ..view_log import Snapshot, ViewFigures
from .read_outs import Html, deepest_contacts, highlight, legend, line, read_out, report
from .server import PageServer
from .stage import Stage

SHALLOW, DEEP = -10.0, 5.0
"""Of the depth [mm]: the chart begins at the first, around the touch, and shows at least the
second, so that it does not magnify noise."""
CHOICES = (*NATIVE, 'paper', f'soup-{SOUP_DIVISIONS}')
"""Models among which the page switches."""
READ_OUT_PERIOD = 0.2  # time [s] between new figures: faster, nobody can read them
ROOM = 1.1  # how much higher than its largest value a chart is
HISTORY = 12.0  # length [s] of the chart
PANEL_WIDTH = 410  # pixels at most, of a wide window
PANEL_SHARE = 3  # the panel takes one part in so many of the window's width


@dataclass(frozen=True)
class CraneRun:
    """What the crane is asked for."""

    seed: int
    rate: float
    closed_loop: bool


class Page:
    """Wishes of whoever looks at it go to `on_model` and `on_land`, in threads of viser's."""

    def __init__(self, host: str, port: int, *, run: CraneRun | None = None,
                 on_model: Callable[[str], None] | None = None,
                 on_land: Callable[[CraneRun], None] | None = None) -> None:
        """Serve at a port, or the next that is free; None: no crane, no node to be asked."""
        self._server = server = PageServer(host, port)
        self.url = f'http://{host}:{server.get_port()}'
        server.gui.configure_theme(show_logo=False, show_share_button=False, brand_color=CONTACT,
                                   control_width='large')
        server.gui.main_panel.dock_right()
        server.on_client_connect(_narrow)
        self._stage = Stage(server)
        self._figures: ViewFigures | None = None
        self._running = ''  # the model that answers
        self._read_out = server.gui.add_html('')
        self._add_charts()
        _put(server.gui.add_html(''), legend())
        self._deepest = server.gui.add_html('')
        self._next_read_out = 0.0
        self._highlight = server.gui.add_html('')  # styles what comes next
        if on_model is not None:
            self._model = server.gui.add_button_group('model', CHOICES)
            self._model.on_click(lambda event: on_model(event.target.value))
        self._status = server.gui.add_html('')
        if run is not None and on_land is not None:
            self._add_crane(run, on_land)

    def _add_charts(self) -> None:
        self._history: deque[tuple[float, float, float]] = deque()  # time, depth, force
        self._depth_chart = self._add_chart('depth [mm]')
        self._force_chart = self._add_chart('force [kN]')
        self._force_chart.visible = False

    def _add_chart(self, label: str) -> Any:
        return self._server.gui.add_uplot(
            (np.zeros(1), np.zeros(1)),
            ({'label': 's'}, {'label': label, 'stroke': f'rgb{CONTACT}', 'width': 2}),
            axes=({'label': 'time [s]', 'size': 30, 'labelSize': 18},
                  {'label': label, 'size': 56, 'labelSize': 18}),
            scales=_scales(0.0, 1.0), legend={'show': False}, height=135)

    def _add_crane(self, run: CraneRun, on_land: Callable[[CraneRun], None]) -> None:
        gui = self._server.gui
        with gui.add_folder('crane'):
            seed = gui.add_number('seed', run.seed, min=0, max=2**31, step=1,
                                  hint='0: the standard scenario; others are drawn at random')
            rate = gui.add_slider('rate [Hz]', 20, 1000, 10, run.rate)
            closed_loop = gui.add_checkbox('closed loop', run.closed_loop,
                                           hint='the contact carries the load')
            gui.add_button('land again').on_click(lambda _: on_land(
                CraneRun(int(seed.value), float(rate.value), closed_loop.value)))
            self._seed = seed
            self._verdict = gui.add_html('')
            self._report = gui.add_folder('its report', expand_by_default=False, visible=False)
            with self._report:
                self._last_run = gui.add_html('')

    def draw(self, snapshot: Snapshot | None, lines: np.ndarray, force: float = math.nan) -> None:
        """Show boxes, contacts, and the lines (n, 2, 3) of a crane, and the figures of that tick.

        force: upward part of the force on the crane's load [N], NaN where none is known.
        """
        if snapshot is None:
            return
        with self._server.atomic():
            self._stage.draw(snapshot, lines)
            self._read(snapshot)
        now = time.monotonic()
        self._history.append((now, -1e3 * snapshot.separation, 1e-3 * force))
        while now - self._history[0][0] > HISTORY:
            self._history.popleft()

    def _read(self, snapshot: Snapshot | None) -> None:
        _put(self._read_out, read_out(snapshot, self._figures, self._running))
        _put(self._deepest, deepest_contacts(snapshot))

    @property
    def due(self) -> bool:
        """Whether it is time for new figures."""
        return time.monotonic() >= self._next_read_out

    def show(self, snapshot: Snapshot | None, figures: ViewFigures | None, *, model: str, wish: str,
             refusal: str, connected: bool) -> None:
        """Show figures of the last seconds, and which model runs, next to those of a tick."""
        self._next_read_out = time.monotonic() + READ_OUT_PERIOD
        self._figures, self._running = figures, model
        self._read(snapshot)
        self._draw_charts()
        _put(self._highlight, highlight(CHOICES.index(model) if model in CHOICES else None))
        text, bad = f'running: {model}', False
        if not model:
            text = 'waiting for the contact node …'
        elif not connected:
            text, bad = 'the contact node does not answer', True
        elif wish:
            text = f'switching to {wish} …'
        elif refusal:
            text, bad = f'refused: {refusal}', True
        _put(self._status, line('model-status', text, bad=bad))

    def _draw_charts(self) -> None:
        if not self._history:
            return
        times, depths, forces = np.array(self._history).T
        _plot(self._depth_chart, times - times[-1], depths, SHALLOW, DEEP)
        known = ~np.isnan(forces)
        self._force_chart.visible = bool(known.any())
        if known.any():
            _plot(self._force_chart, times[known] - times[-1], forces[known], 0.0, 1.0)

    def show_run(self, run: CraneRun) -> None:
        """Show which run is under way."""
        self._seed.value = run.seed

    def show_last_run(self, passed: bool, text: str) -> None:
        """Show whether the crane's last run passed, and its report."""
        _put(self._verdict, line('last-run', f'last run: {"passed" if passed else "FAILED"}',
                                 bad=not passed))
        self._report.visible = True
        _put(self._last_run, report(text))

    def close(self) -> None:
        """End the server."""
        self._server.stop()


def _plot(chart: Any, times: np.ndarray, values: np.ndarray, low: float, least_high: float,
          ) -> None:
    """Show values from `low` to their largest, or to `least_high`."""
    chart.data = times, values
    scales = _scales(low, max(least_high, ROOM * values.max()))
    if chart.scales != scales:  # new axes make the browser build the chart anew
        chart.scales = scales


def _scales(low: float, high: float) -> dict[str, Any]:
    """Return the axes of a chart of the last seconds, whose values run from `low` to `high`.

    uPlot's own range of times goes astray where values and axes change at once.
    """
    bounds = ({'hard': end, 'soft': end, 'mode': 1} for end in (low, float(high)))
    return {'x': {'time': False, 'range': (-HISTORY, 0.0)},
            'y': {'range': dict(zip(('min', 'max'), bounds))}}


def _narrow(client: viser.ClientHandle) -> None:
    """Give the panel its share of a browser's window, which is all that there is at first."""
    client.gui.main_panel.set_width(min(PANEL_WIDTH, client.camera.image_width // PANEL_SHARE))


def _put(place: viser.GuiHtmlHandle, content: Html) -> None:
    """Show HTML, and nothing else, at a place of the panel."""
    if place.content != content:
        place.content = str(content)  # viser takes no other kind of text

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page: drawing, read-outs and controls, served by viser. No ROS."""
from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import viser

from ....solver.models import models
from ..style import CONTACT
from ..view_log import Snapshot, ViewFigures
from .read_outs import Html, deepest_contacts, legend, line, read_out, report
from .server import PageServer
from .stage import Stage

CHART_LEAST, CHART_MOST = ({'pad': 0.1, 'soft': value, 'mode': 1} for value in (-20.0, 20.0))
"""Of the separation [mm]: the chart shows at least this, so that it does not magnify noise."""
READ_OUT_PERIOD = 0.2  # time [s] between new figures: faster, nobody can read them
HISTORY = 12.0  # length [s] of the chart
PANEL_WIDTH = 410  # pixels


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
        server.gui.main_panel.set_width(PANEL_WIDTH)
        self._stage = Stage(server)
        self._read_out = server.gui.add_html('')
        self._deepest = server.gui.add_html('')
        _put(server.gui.add_html(''), legend())
        self._add_chart()
        self._next_read_out = 0.0
        if on_model is not None:
            self._model = server.gui.add_button_group('model', tuple(models()))
            self._model.on_click(lambda event: on_model(event.target.value))
        self._status = server.gui.add_html('')
        if run is not None and on_land is not None:
            self._add_crane(run, on_land)

    def _add_chart(self) -> None:
        self._history: deque[tuple[float, float]] = deque()
        self._chart = self._server.gui.add_uplot(
            (np.zeros(1), np.zeros(1)),
            ({'label': 's'}, {'label': 'separation', 'stroke': f'rgb{CONTACT}', 'width': 2}),
            axes=({'label': 'time [s]', 'size': 30, 'labelSize': 18},
                  {'label': 'separation [mm]', 'size': 56, 'labelSize': 18}),
            scales={'x': {'time': False}, 'y': {'range': {'min': CHART_LEAST, 'max': CHART_MOST}}},
            legend={'show': False}, height=160)

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

    def draw(self, snapshot: Snapshot | None, lines: np.ndarray) -> None:
        """Show boxes, contacts, and the lines (n, 2, 3) of a crane."""
        if snapshot is not None:
            self._stage.draw(snapshot, lines)

    @property
    def due(self) -> bool:
        """Whether it is time for new figures."""
        return time.monotonic() >= self._next_read_out

    def show(self, snapshot: Snapshot | None, figures: ViewFigures | None, *, model: str, wish: str,
             refusal: str, connected: bool) -> None:
        """Show the figures."""
        now = time.monotonic()
        self._next_read_out = now + READ_OUT_PERIOD
        _put(self._read_out, read_out(snapshot, figures, model))
        _put(self._deepest, deepest_contacts(snapshot))
        if snapshot is not None:
            self._history.append((now, 1e3 * snapshot.separation))
            while now - self._history[0][0] > HISTORY:
                self._history.popleft()
            times, separations = np.array(self._history).T
            self._chart.data = times - now, separations
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


def _put(place: viser.GuiHtmlHandle, content: Html) -> None:
    """Show HTML, and nothing else, at a place of the panel."""
    place.content = str(content)  # viser takes no other kind of text

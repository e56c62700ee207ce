# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A page in the browser that shows the plan of a file, and what is wrong with it.

Boxes have the colour of their verdict. A click on a box shows its row, its mass and what is on it.
A click on the name of a fault goes to its box. A switch hides what is sound.
"""
from __future__ import annotations

import contextlib
import html
import io
import math
import signal
import sys
import threading
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..arguments import one_line, program_main, program_parser, within
from ..extras import MissingExtra, require
from ..plans.inspect_files import NOT_READ, add_options, judged
from ..plans.inspection import Inspection
from ..plans.plot import COLOURS, spans
from ..plans.room import are_walls
from ..solver.checks import printable
from ..solver.pose import rotation_matrix
from .style import unit_poses

OPACITY = 0.9
PANEL_WIDTH, MOST_ROWS = 420, 200
"""Width of the panel [pixels], and rows that it shows."""
CLICK_HINT = 'Click on a box to see its row.'
MOST_NAMES = 40
"""Boxes with a button to go there: the worst."""
AWAY = 3.0
"""How far the camera goes from a box [of half its diagonal], with what is around it in view."""


class PlanPage:
    """A page of one plan, which stays as it is."""

    def __init__(self, host: str, port: int, title: str, found: Inspection, taken: str = '',
                 ) -> None:
        """Serve a plan at a port, or the next that is free. Raises OSError.

        taken: what was taken of the file.
        """
        from .server import Server

        self.found = found
        self._server = Server(host, port)
        self.url = f'http://{host}:{self._server.get_port()}'
        gui = self._server.gui
        gui.configure_theme(show_logo=False, show_share_button=False, control_width='large')
        gui.main_panel.dock_right()
        gui.main_panel.set_width(PANEL_WIDTH)
        self._clicked = gui.add_html(_section('clicked', CLICK_HINT), order=0.0)
        gui.add_html(table(title, found, taken), order=1.0)
        self._middle = np.zeros(3)  # of what is drawn [m]
        self._drawn = ~are_walls(found.plan)
        self._shown = self._drawn
        self._draw()

    def close(self) -> None:
        """End the server."""
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()

    def select(self, box: int) -> None:
        """Show what is known of a box, by index."""
        self._clicked.content = _section('clicked', '<br>'.join(
            html.escape(line) for line in lines_of(self.found, box)))

    def _draw(self) -> None:
        """Draw all boxes around the origin: browsers compute in float32."""
        from .drawing import NARROW, add_cubes, add_light, camera_position

        plan, scene = self.found.plan, self._server.scene
        add_light(scene)
        if not len(plan):
            return
        shown = np.flatnonzero(self._drawn)
        sizes, poses = plan.sizes[shown], unit_poses(plan.poses[shown])
        colours = np.array([list(bytes.fromhex(COLOURS[verdict][1:]))
                            for verdict in self.found.verdicts[shown]])
        half = 0.5 * np.einsum('nij,nj->ni', np.abs(rotation_matrix(poses[:, 3:])), sizes)
        # A floor that is far larger than what is on it must not be what is in view.
        free = ~np.isin(shown, plan.ground)
        seen = free if free.any() else ~free
        low = (poses[seen, :3] - half[seen]).min(axis=0)
        high = (poses[seen, :3] + half[seen]).max(axis=0)
        self._middle, radius = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
        sound = self.found.verdicts[shown] == 'sound'
        quiet: list[Any] = []
        for name, boxes in (('/sound', np.flatnonzero(sound)), ('/faults', np.flatnonzero(~sound))):
            if not len(boxes):
                continue
            meshes = add_cubes(scene, colours[boxes], OPACITY, name)
            for mesh in meshes:
                mesh.batched_positions = poses[boxes, :3] - self._middle
                mesh.batched_wxyzs = np.roll(poses[boxes, 3:], 1, axis=1)
                mesh.batched_scales = sizes[boxes]
            quiet += meshes if name == '/sound' else ()
            meshes[0].on_click(self._hit)
        self._add_controls(quiet)
        camera = self._server.initial_camera
        camera.position = camera_position(radius, camera.fov, NARROW)
        camera.look_at = np.zeros(3)

    def _hit(self, event: Any) -> None:
        """Select the box that a click hits."""
        plan, shown = self.found.plan, np.flatnonzero(self._shown)
        hit = hit_by(plan.sizes[shown], unit_poses(plan.poses[shown]),
                     np.array(event.ray_origin) + self._middle, np.array(event.ray_direction))
        if hit is not None:
            self.select(int(shown[hit]))

    def _add_controls(self, quiet: list[Any]) -> None:
        """Add a switch that hides what is sound, and a button for each of the worst boxes."""
        gui = self._server.gui
        if worst := worst_boxes(self.found):
            buttons = gui.add_button_group('go to', list(worst), order=0.5)

            @buttons.on_click
            def _(event: Any) -> None:
                self.go_to(worst[buttons.value], event.client)
        if quiet:
            switch = gui.add_checkbox('hide what is sound', False, order=0.6)

            @switch.on_update
            def _(_: Any) -> None:
                self._shown = self._drawn & (
                    (self.found.verdicts != 'sound') | (not switch.value))
                for mesh in quiet:
                    mesh.visible = not switch.value

    def go_to(self, box: int, client: Any) -> None:
        """Select a box, by index, and move a client's camera there."""
        from .drawing import NARROW, camera_position

        self.select(box)
        plan, camera = self.found.plan, client.camera
        place = plan.poses[box, :3] - self._middle
        radius = AWAY * 0.5 * float(np.linalg.norm(plan.sizes[box]))
        with client.atomic():
            camera.position = place + camera_position(radius, camera.fov, NARROW)
            camera.look_at = place


def worst_boxes(found: Inspection) -> dict[str, int]:
    """Return the boxes with a fault, the worst first, at most MOST_NAMES: names to indices."""
    index = {name: box for box, name in enumerate(found.plan.names)}
    names = dict.fromkeys(name for row in found.rows() for name in row.names if name in index)
    return {printable(name): index[name] for name in list(names)[:MOST_NAMES]}


def hit_by(sizes: np.ndarray, poses: np.ndarray, origin: np.ndarray, direction: np.ndarray,
           ) -> int | None:
    """Return the first box that a ray hits, by index, or None."""
    near, far = (row[0] for row in spans(sizes, poses, origin[None], direction))
    near[(near > far) | (far < 0.0)] = np.inf
    return int(near.argmin()) if np.isfinite(near).any() else None


def lines_of(found: Inspection, box: int) -> list[str]:
    """Return what is known of a box: its rows, or that nothing is wrong, mass, and load on top."""
    plan = found.plan
    name = plan.names[box]
    word = 'not judged' if found.verdicts[box] == 'not judged' else 'sound'
    lines = [str(row) for row in found.rows() if name in row.names] or [f'{name}: {word}']
    if plan.masses is not None:
        lines.append(f'{plan.masses[box]:,.0f} kg')
    on_top = found.load[box] / np.linalg.norm(found.acceleration)
    if math.isfinite(on_top):
        lines.append(f'{on_top:,.0f} kg on top')
    lines.append('{:.3f} × {:.3f} × {:.3f} m'.format(*plan.sizes[box]))
    return lines


def table(title: str, found: Inspection, taken: str = '') -> str:
    """Return what was taken, the summary, a legend of the colours, and the rows, as HTML."""
    verdicts = found.verdicts
    legend = ' &ensp;'.join(
        f'<span style="white-space:nowrap"><span style="color:{colour}">■</span> {verdict} '
        f'({np.count_nonzero(verdicts == verdict):,})</span>'
        for verdict, colour in COLOURS.items() if verdict in verdicts)
    rows = found.rows()
    shown = ''.join(f'<div>{html.escape(str(row))}</div>' for row in rows[:MOST_ROWS])
    more = f'<div>and {len(rows) - MOST_ROWS:,} more</div>' if len(rows) > MOST_ROWS else ''
    return ''.join((
        _section('file', html.escape(title)),
        _section('taken', html.escape(printable(taken))) if taken else '',
        _section('verdict', html.escape(found.summary()), 'font-weight:600'),
        _section('legend', legend),
        _section('rows', shown + more, 'font-family:monospace;white-space:pre-wrap')))


def _section(name: str, content: str, style: str = '') -> str:
    content = content.encode('utf-8', 'replace').decode()  # names of files are of any bytes
    return (f'<div id="{name}" style="padding:0.3em 0.7em;font-size:0.85em;{style}">{content}'
            '</div>')


@program_main
def main(args: Sequence[str] | None = None) -> int:
    """Serve the plan of a file until SIGINT or SIGTERM; return 2 for what is no plan."""
    parser = program_parser('view', __doc__)
    parser.add_argument('file', metavar='FILE')
    parser.add_argument('--host', default='127.0.0.1', help='address to serve at; everybody who '
                        'reaches it sees the page')
    parser.add_argument('--port', type=within(1, 65535), default=8080, help='port to serve at, or '
                        'the next that is free')
    add_options(parser)
    options = parser.parse_args(args)
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    try:
        require('view')
        found, taken = judged(options.file, options)
        page = PlanPage(options.host, options.port, options.file, found, taken)
    except (OSError, ValueError, MissingExtra) as error:
        print(one_line(error), file=sys.stderr)
        return NOT_READ
    print(f'view: open {page.url}', flush=True)
    ended.wait()
    page.close()
    return 0

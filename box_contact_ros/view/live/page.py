# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page in the browser: a drawing, figures and charts, served by viser. No ROS.

Nothing on the page can be set. The origin of the drawing is where boxes were first seen: browsers
draw in float32, which is half a metre coarse in map coordinates.
"""
from __future__ import annotations

import contextlib
import html
import io
import math
from collections import deque
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...scene.scene_solver import Answer
from ...solver.pose import rotation_matrix
from ...stream.cdr import NANOSECONDS
from .. import style
from ..drawing import NARROW, add_cubes, add_light, camera_position
from ..server import Server
from .listener import DrawnTick, SceneRows

HISTORY = 12.0  # length [s] of the charts
ROOM = 0.1  # above the values of a chart, as a share of them
LEAST_DEPTH, LEAST_FORCE = 1.0, 1.0
"""[mm], [kN]: what charts show at least, not to magnify noise."""
NAMES_SHOWN = 3  # of boxes of one colour, in the legend
PANEL_WIDTH, CHART_HEIGHT, TIMES_HEIGHT = 300, 110, 45  # pixels; the last is that of the axis
GROUND, LINES, SECTIONS, ROPE = (236, 238, 241), (206, 211, 217), (176, 183, 191), (70, 70, 80)
NO_LINES = np.zeros((0, 2, 3))
GROUND_SIZE = 60.0  # length [m] of the ground at least


class Page:
    """`draw` moves what is drawn to a tick; `show` brings figures and charts to the same tick."""

    def __init__(self, host: str, port: int, rows: SceneRows) -> None:
        """Serve a scene at a port, or the next that is free. Raises OSError."""
        self._server = Server(host, port)
        self.url = f'http://{host}:{self._server.get_port()}'
        gui = self._server.gui
        gui.configure_theme(show_logo=False, show_share_button=False, control_width='large')
        gui.main_panel.dock_right()
        gui.main_panel.set_width(PANEL_WIDTH)
        self._figures = gui.add_html('', order=0.0)
        self._history: deque[tuple[float, float, float]] = deque()  # time [s], depth, force
        self._charts: dict[str, Any] = {}
        self._legend = gui.add_html('', order=1.0)
        self._has_near = False
        self._seen = 0  # boxes; each that joins brings all of them into view
        self._origin = np.zeros(3)
        self._add_drawing(rows)

    def close(self) -> None:
        """End the server."""
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()

    # --- the drawing ------------------------------------------------------------------------------

    def draw(self, tick: DrawnTick, ropes: np.ndarray = NO_LINES) -> None:
        """Show boxes and contacts, and ropes by their ends (n, 2, 3) [m]."""
        with self._server.atomic():
            known = ~np.isnan(tick.poses[:, 0])
            if tick.rows is not self._rows:  # boxes have come or gone
                self._faces.remove()
                self._edges.remove()
                self._add_boxes(tick.rows)
            if known.sum() > self._seen:
                self._look_at(tick, known)
            self._draw_boxes(tick, known)
            self._draw_contacts(tick.answer)
            self._ropes.visible = len(ropes) > 0
            if len(ropes):
                self._ropes.points = ropes - self._origin

    def _add_drawing(self, rows: SceneRows) -> None:
        """Add all that is drawn."""
        scene, place = self._server.scene, np.zeros((1, 2, 3))
        edge = float(np.median(rows.sizes.max(axis=1)))
        radius, self._normal_length = style.POINT_RADIUS * edge, style.NORMAL_LENGTH * edge
        add_light(scene)
        self._ground = scene.add_grid('/ground', GROUND_SIZE, GROUND_SIZE, cell_size=1.0,
                                      section_size=5.0, cell_color=LINES, section_color=SECTIONS,
                                      plane_color=GROUND, plane_opacity=1.0, shadow_opacity=0.0,
                                      visible=False)
        self._points = scene.add_point_cloud('/contact/points', place[:, 0], style.CONTACT,
                                             point_shape='circle', point_size=2.0 * radius,
                                             precision='float32', visible=False)
        self._normals = scene.add_arrows('/contact/normals', place, style.CONTACT,
                                         shaft_radius=0.45 * radius, head_radius=1.1 * radius,
                                         head_length=2.6 * radius, visible=False)
        self._patches = scene.add_line_segments('/contact/patches', place, style.CONTACT,
                                                thickness=3.0, thickness_units='screen',
                                                visible=False)
        self._near = scene.add_line_segments('/near', place, style.NEAR, thickness=2.0,
                                             thickness_units='screen', visible=False)
        self._distance = scene.add_label('/near/distance', '', visible=False)
        self._ropes = scene.add_line_segments('/ropes', place, ROPE, thickness=2.0,
                                              thickness_units='screen', visible=False)
        self._add_boxes(rows)

    def _add_boxes(self, rows: SceneRows) -> None:
        """Add the boxes, instances of one cube: a tick moves them together."""
        self._rows = rows
        colours = np.where(rows.is_a[:, None], style.BOX_A, style.BOX_B)
        self._faces, self._edges = add_cubes(self._server.scene, colours, style.BOX_OPACITY)
        self._legend.content = legend(rows, near=self._has_near)

    def _draw_boxes(self, tick: DrawnTick, known: np.ndarray) -> None:
        """Move the boxes; those without a pose shrink to nothing."""
        poses = style.unit_poses(np.where(known[:, None], tick.poses, [0, 0, 0, 0, 0, 0, 1]))
        for mesh in (self._faces, self._edges):
            mesh.batched_positions = poses[:, :3] - self._origin
            mesh.batched_wxyzs = np.roll(poses[:, 3:], 1, axis=1)
            mesh.batched_scales = np.where(known[:, None], tick.rows.sizes, 0.0)

    def _draw_contacts(self, answer: Answer | None) -> None:
        points = sides = np.zeros((0, 3))
        if answer is not None:
            contacts = answer.contacts
            points = contacts.point - self._origin
            tips = points + self._normal_length * contacts.normal
            sides = style.patch_sides(points, contacts.normal, contacts.covariance)
        self._points.visible = self._normals.visible = len(points) > 0
        self._patches.visible = len(sides) > 0
        if len(points):
            self._points.points = points.astype(np.float32)
            self._normals.points = np.stack([points, tips], axis=1)
        if len(sides):
            self._patches.points = sides
        self._draw_near(answer)

    def _draw_near(self, answer: Answer | None) -> None:
        """Draw dashed lines between nearest points; the distance of the nearest is written."""
        is_near = answer is not None and len(answer.near) > 0
        self._near.visible = self._distance.visible = is_near
        if is_near and not self._has_near:
            self._has_near = True
            self._legend.content = legend(self._rows, near=True)
        if answer is not None and is_near:
            a, b = answer.near.point_a - self._origin, answer.near.point_b - self._origin
            self._near.points = style.dashes(a, b)
            self._distance.text = f'{answer.near.distance[0]:.3f} m'
            self._distance.position = 0.5 * (a[0] + b[0])

    # --- the camera -------------------------------------------------------------------------------

    def _look_at(self, tick: DrawnTick, known: np.ndarray) -> None:
        """Put origin, ground and the first camera where the boxes `known` (n,) are."""
        self._seen = known.sum()
        poses, sizes = tick.poses[known], tick.rows.sizes[known]
        # Half the extents along the frame's axes.
        half = 0.5 * np.einsum('nij,nj->ni', np.abs(rotation_matrix(poses[:, 3:])), sizes)
        low, high = (poses[:, :3] - half).min(axis=0), (poses[:, :3] + half).max(axis=0)
        self._origin, radius = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
        self._ground.position = (0.0, 0.0, 0.5 * float((low - high)[2]))
        for name in ('width', 'height', 'fade_distance'):
            setattr(self._ground, name, max(GROUND_SIZE, 6.0 * radius))
        self._ground.visible = True
        camera = self._server.initial_camera  # viser moves open pages the first time alone
        camera.position = camera_position(radius, camera.fov, NARROW)
        camera.look_at = np.zeros(3)

    # --- figures and charts -----------------------------------------------------------------------

    def show(self, tick: DrawnTick | None, force: float, *, model: str,
             lands_again: bool = False) -> None:
        """Show figures and charts of a tick; without a tick, what the page waits for.

        The charts then stay as they are until the next tick begins them anew.

        force: upward part of the force on the crane's load [N], NaN where none is known.
        lands_again: whether the next poses will be those of a crane's next landing.
        """
        if tick is None:
            self._history.clear()
        else:
            time, depth = tick.stamp / NANOSECONDS, _depth(tick.answer)
            if self._history and time < self._history[-1][0]:
                self._history.clear()
            self._history.append((time, 1e3 * depth, 1e-3 * force))
            while time - self._history[0][0] > HISTORY:
                self._history.popleft()
        # As the chart does: a force that is late for this tick is not unknown.
        force = next((1e3 * known for _, _, known in reversed(self._history)
                      if not math.isnan(known)), force)
        with self._server.atomic():
            self._figures.content = figures(tick, force, model=model, lands_again=lands_again)
            if self._history:
                times, depths, forces = np.array(self._history).T
                times -= times[-1]
                known = ~np.isnan(forces)
                if known.sum() > 1:  # fewer make no axis of times, which both charts share
                    times, depths, forces = times[known], depths[known], forces[known]
                    self._plot('force [kN]', LEAST_FORCE, times, forces, above=True)
                if len(times) > 1:
                    self._plot('depth [mm]', LEAST_DEPTH, times, depths)

    def _plot(self, label: str, least: float, times: np.ndarray, values: np.ndarray, *,
              above: bool = False) -> None:
        """Show values over times [s], from zero to `least`, or as far as the values go.

        above: over the chart whose axis of times it shares.
        """
        # Axes are those of the data, which have a line at zero. Axes that are set lose their labels
        # where the browser gives the chart its width later, or builds it anew.
        data = times, values, np.zeros(len(times))
        if label in self._charts:
            self._charts[label].data = data
            return
        high = {'pad': ROOM, 'soft': least, 'mode': 1}
        self._charts[label] = self._server.gui.add_uplot(
            data, ({'label': 's'}, {'label': label, 'stroke': f'rgb{style.CONTACT}', 'width': 2},
                   {'label': 'zero', 'stroke': f'rgb{SECTIONS}'}),
            scales={'x': {'time': False},
                    'y': {'range': {'min': {'pad': 0.0, 'soft': 0.0, 'mode': 1}, 'max': high}}},
            axes=({'show': False} if above else {'label': 'time [s]', 'size': 30, 'labelSize': 18},
                  {'label': label, 'size': 56, 'labelSize': 18}),
            legend={'show': False}, padding=(10, 24, 8 if above else 0, 0),
            height=CHART_HEIGHT + (0 if above else TIMES_HEIGHT), order=3.0 - above)


def legend(rows: SceneRows, *, near: bool = False) -> str:
    """Return which colour stands for what, as HTML: boxes by their first names.

    near: whether lines between nearest points were drawn.
    """
    names = np.array(list(rows.scene.boxes), dtype=object)
    parts = [(style.BOX_A, names[rows.is_a]), (style.BOX_B, names[~rows.is_a]),
             (style.CONTACT, ['contact: point, normal, patch']),
             (style.NEAR, ['near: distance'] if near else [])]
    spans = ''.join(f'<span style="color:rgb{colour}">■</span>&nbsp;'  # no square ends a line
                    f'{html.escape(_first(words))} &ensp;' for colour, words in parts if len(words))
    return f'<div id="legend" style="padding:0 0.7em 0.6em;font-size:0.78em">{spans}</div>'


def _first(names: Sequence[str]) -> str:
    """Return the first names, and how many more there are."""
    more = len(names) - NAMES_SHOWN
    return ', '.join(names[:NAMES_SHOWN]) + (f' and {more} more' if more > 0 else '')


def figures(tick: DrawnTick | None, force: float, *, model: str, lands_again: bool = False) -> str:
    """Return a line in plain words and a table, as HTML; each value has its name as id."""
    words = 'next landing' if lands_again else 'waiting for poses'
    rows = [('model', 'model', model or '–')]
    if tick is not None:
        answer, pair_count = tick.answer, tick.rows.scene.pair_count
        words = in_words(answer)
        if answer is not None and pair_count > 1:
            rows.append(('pairs', 'pairs in contact', f'{len(answer.pairs)} of {pair_count}'))
            rows.append(('stale', 'pairs not evaluated', f'{len(answer.stale)}'))
        volume = answer.contacts.volume.sum() if answer is not None else math.nan
        rows += [('volume', 'volume of the overlap', _text(1e3 * volume, '.3g', 'L')
                  if volume < 0.9995 else  # what three digits show as 1,000 L is 1 m³
                  _text(volume, '.3g' if volume < 999.5 else ',.0f', 'm³')),
                 ('force', 'force on the load', _text(1e-3 * force, '.1f', 'kN')),
                 ('latency', 'latency', _text(1e3 * tick.latency, '.2f', 'ms'))]
    lines = ''.join(f'<tr><td style="opacity:0.7">{label}</td><td style="text-align:right"><b '
                    f'id="{name}">{html.escape(text)}</b></td></tr>' for name, label, text in rows)
    return (f'<div id="verdict" style="padding:0.5em 0.6em 0;font-size:1.15em;font-weight:600">'
            f'{words}</div><table style="width:100%;padding:0.6em;font-size:0.9em;'
            f'font-variant-numeric:tabular-nums">{lines}</table>')


def in_words(answer: Answer | None) -> str:
    """Return in words whether there is contact, and how deep or how far.

    Of several contacts the deepest counts, of several pairs that are near the nearest.
    """
    if answer is None:
        return 'poses come, but no contacts'
    if len(answer.pairs):
        return f'contact, {1e3 * _depth(answer):.2f} mm deep'
    if len(answer.near):
        return f'no contact, {answer.near.distance[0]:.3f} m apart'
    return 'not evaluated' if len(answer.stale) else 'no contact'


def _depth(answer: Answer | None) -> float:
    """Return the depth [m] of the deepest contact, 0 without one."""
    touching = answer is not None and len(answer.pairs)
    return -float(answer.contacts.separation[0]) if touching else 0.0


def _text(value: float, form: str, unit: str) -> str:
    return '–' if math.isnan(value) else f'{value:{form}} {unit}'

"""The page: scene, read-outs and controls, served by viser. No ROS.

The origin of the drawing is the place where box B was first seen. Browsers draw in float32, which
is half a metre coarse in map coordinates.
"""
from __future__ import annotations

import contextlib
import html
import io
import logging
import math
import socket
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import viser

from ....scene.pose import rotation_matrix
from ....solver.models import MODELS
from ..style import (
    BOX_A,
    BOX_B,
    BOX_OPACITY,
    CONTACT,
    EXACT,
    patch_ellipse,
    proportions,
    unit_pose,
)
from ..view_log import Snapshot, ViewFigures

CHART_LEAST, CHART_MOST = ({'pad': 0.1, 'soft': value, 'mode': 1} for value in (-20.0, 20.0))
"""Of the separation [mm]: the chart shows at least this, so that it does not magnify noise."""
READ_OUT_PERIOD = 0.2  # time [s] between new figures: faster, nobody can read them
HISTORY = 12.0  # length [s] of the chart
PANEL_WIDTH = 410  # pixels
GROUND, LINES = (236, 238, 241), (206, 211, 217)


@dataclass(frozen=True)
class CraneRun:
    """What the crane is asked for."""

    seed: int
    rate: float
    closed_loop: bool


class Page:
    """Wishes of whoever looks at it go to `on_model` and `on_land`, in threads of viser's."""

    def __init__(self, host: str, port: int, *, run: CraneRun | None,
                 on_model: Callable[[str], None], on_land: Callable[[CraneRun], None]) -> None:
        """Serve at a port, or the next that is free; `run` None: no crane to be asked."""
        # viser would wait for ever for a server that cannot start.
        with socket.create_server((host, 0), family=socket.getaddrinfo(host, 0)[0][0]):
            pass
        # Browsers open connections on suspicion, and close them unused; that is no error.
        logging.getLogger('websockets').setLevel(logging.CRITICAL)
        with contextlib.redirect_stdout(io.StringIO()):  # viser greets
            self._server = server = viser.ViserServer(host=host, port=port, verbose=False,
                                                      label='box_contact_ros')
        self.url = f'http://{host}:{server.get_port()}'
        server.gui.configure_theme(show_logo=False, show_share_button=False, brand_color=CONTACT,
                                   control_width='large')
        server.gui.main_panel.dock_right()
        server.gui.main_panel.set_width(PANEL_WIDTH)
        self._sizes: tuple[Sequence[float], ...] = ()
        self._origin: np.ndarray | None = None
        server.on_client_connect(self._aim)
        self._set_stage()
        self._read_out = server.gui.add_html('')
        self._history: deque[tuple[float, float]] = deque()
        self._chart = server.gui.add_uplot(
            (np.zeros(1), np.zeros(1)),
            ({'label': 's'}, {'label': 'separation', 'stroke': f'rgb{CONTACT}', 'width': 2}),
            axes=({'label': 'time [s]', 'size': 30, 'labelSize': 18},
                  {'label': 'separation [mm]', 'size': 56, 'labelSize': 18}),
            scales={'x': {'time': False}, 'y': {'range': {'min': CHART_LEAST, 'max': CHART_MOST}}},
            legend={'show': False}, height=160)
        self._next_read_out = 0.0
        self._model = server.gui.add_button_group('model', tuple(MODELS))
        self._model.on_click(lambda event: on_model(event.target.value))
        self._status = server.gui.add_html('')
        if run is not None:
            self._add_crane(run, on_land)

    def _set_stage(self) -> None:
        scene = self._server.scene
        scene.configure_environment_map(None)
        scene.configure_default_lights(False)
        scene.add_light_hemisphere('/light/sky', sky_color=(255, 255, 255),
                                   ground_color=(190, 190, 195), intensity=2.2)
        scene.add_light_directional('/light/sun', color=(255, 250, 240), intensity=2.2,
                                    position=(-6.0, -9.0, 14.0))
        self._ground = scene.add_grid('/ground', 60.0, 60.0, cell_size=1.0, section_size=5.0,
                                      cell_color=LINES, section_color=(176, 183, 191),
                                      plane_color=GROUND, plane_opacity=1.0, shadow_opacity=0.0,
                                      fade_distance=60.0, visible=False)
        self._boxes, self._edges = [], []
        for name, colour in (('load', BOX_A), ('stack', BOX_B)):
            self._boxes.append(scene.add_box(f'/{name}', colour, opacity=BOX_OPACITY,
                                             visible=False))
            dark = np.array(colour) // 2
            self._edges.append(scene.add_line_segments(
                f'/{name}/edges', np.zeros((12, 2, 3)), dark, thickness=2.0,
                thickness_units='screen'))
        self._point = scene.add_icosphere('/contact/point', 1.0, CONTACT, visible=False)
        # A cross, so that it is seen through the sphere, which is often at the same place.
        self._exact = scene.add_line_segments('/contact/exact', np.zeros((3, 2, 3)), EXACT,
                                              thickness=3.0, thickness_units='screen',
                                              visible=False)
        self._normal = scene.add_arrows('/contact/normal', np.array([[[0, 0, 0], [0, 0, 1.0]]]),
                                        CONTACT, visible=False)
        self._patch = scene.add_line_segments('/contact/patch', np.zeros((1, 2, 3)), CONTACT,
                                              thickness=3.0, thickness_units='screen',
                                              visible=False)

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

    def set_sizes(self, size_a: Sequence[float], size_b: Sequence[float]) -> None:
        """Take the boxes' full extents [m]; the origin of the drawing is found anew."""
        if (tuple(size_a), tuple(size_b)) == self._sizes:
            return
        self._sizes, self._origin = (tuple(size_a), tuple(size_b)), None
        look = proportions(size_a, size_b)
        for box, edges, size in zip(self._boxes, self._edges, self._sizes):
            box.dimensions = size[0], size[1], size[2]
            edges.points = _edges(size)
        self._point.radius = look.point_radius
        cross = 2.5 * look.point_radius * np.stack([-np.eye(3), np.eye(3)], axis=1)
        self._exact.points = cross.astype(np.float32)
        self._normal.points = np.array([[[0.0, 0.0, 0.0], [0.0, 0.0, look.normal_length]]])
        self._normal.shaft_radius = 0.45 * look.point_radius
        self._normal.head_radius = 1.1 * look.point_radius
        self._normal.head_length = 2.6 * look.point_radius

    def draw(self, snapshot: Snapshot | None) -> None:
        """Show poses and contact."""
        if snapshot is None or not self._sizes:
            return
        if self._origin is None:
            self._origin = snapshot.poses[1][:3].copy()
            self._look_at(snapshot.poses[1])
        with self._server.atomic():
            for box, pose in zip(self._boxes, map(unit_pose, snapshot.poses)):
                box.position = pose[:3] - self._origin
                box.wxyz = np.roll(pose[3:], 1)
                box.visible = True
            touch, exact = snapshot.answer and snapshot.answer.touch, snapshot.exact
            ellipse = None
            if touch:
                for drawn in (self._point, self._normal, self._patch):
                    drawn.position = touch.point - self._origin
                self._normal.wxyz = _quaternion_from_z(touch.normal)
                ellipse = patch_ellipse(touch)
            if ellipse is not None:
                line = ellipse.outline.astype(np.float32)
                self._patch.points = np.stack([line[:-1], line[1:]], axis=1)
            self._point.visible = self._normal.visible = touch is not None
            self._patch.visible = ellipse is not None
            if exact.colliding:
                self._exact.position = exact.point - self._origin
            self._exact.visible = touch is not None and exact.colliding

    def _look_at(self, pose_b: np.ndarray) -> None:
        """Put the ground and the camera where the boxes are."""
        size_b = np.array(self._sizes[1])
        down = 0.5 * float(np.abs(rotation_matrix(pose_b[3:])[2]) @ size_b)
        self._ground.position = (0.0, 0.0, -down)
        self._ground.visible = True
        reach = float(np.linalg.norm(self._sizes, axis=1).max())
        top = np.array([0.0, 0.0, 0.8 * down])
        initial = self._server.initial_camera  # what the button "reset view" goes back to
        initial.position = top + reach * np.array([-0.44, -0.66, 0.38])
        initial.look_at = top
        for client in self._server.get_clients().values():
            self._aim(client)

    def _aim(self, client: viser.ClientHandle) -> None:
        """Bring a browser's camera to where it is to start."""
        if self._origin is None:
            return
        # In this order: setting the position moves the other along.
        client.camera.position = self._server.initial_camera.position
        client.camera.look_at = self._server.initial_camera.look_at

    def show(self, snapshot: Snapshot | None, figures: ViewFigures | None, *, model: str, wish: str,
             refusal: str, connected: bool) -> None:
        """Show the figures, if it is time for new ones."""
        now = time.monotonic()
        if now < self._next_read_out:
            return
        self._next_read_out = now + READ_OUT_PERIOD
        self._read_out.content = read_out(snapshot, figures, model)
        if snapshot is not None:
            self._history.append((now, 1e3 * snapshot.exact.separation))
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
        self._status.content = _line('model-status', text, bad=bad)

    def show_run(self, run: CraneRun) -> None:
        """Show which run is under way."""
        self._seed.value = run.seed

    def show_last_run(self, passed: bool, text: str) -> None:
        """Show whether the crane's last run passed, and its report."""
        self._verdict.content = _line('last-run', f'last run: {"passed" if passed else "FAILED"}',
                                      bad=not passed)
        self._report.visible = True
        self._last_run.content = (
            f'<pre style="margin:0;padding:0.4em 0.6em;font-size:0.68em;line-height:1.35;'
            f'white-space:pre-wrap">{html.escape(text)}</pre>')

    def close(self) -> None:
        """End the server."""
        with contextlib.redirect_stdout(io.StringIO()):
            self._server.stop()


def read_out(snapshot: Snapshot | None, figures: ViewFigures | None, model: str) -> str:
    """Return the figures as an HTML table; each value has its name as id."""
    if snapshot is None or figures is None:
        rows = [('verdict', 'verdict', 'waiting for poses')]
    else:
        answer, exact, edge = snapshot.answer, snapshot.exact, figures.edge
        verdict = 'no answer' if answer is None else 'no contact'
        error = volume = area = math.nan
        if answer is not None and answer.touch is not None:
            verdict, volume = 'contact', answer.touch.volume
            error = float(np.linalg.norm(answer.touch.point - exact.point))  # NaN without an exact
            ellipse = patch_ellipse(answer.touch)
            area = ellipse.area if ellipse else math.nan
        rows = [
            ('verdict', 'verdict', verdict),
            ('separation', 'separation', f'{_text(1e3 * exact.separation, "+.2f")} mm'),
            ('volume', 'volume', f'{_text(volume, ".3g")} m³'),
            ('area', 'area of the patch', f'{_text(area, ".3g")} m²'),
            ('error', f'point error of {model}', _share(error, edge)),
            ('error-p99', '&emsp;p99', _share(figures.point_error_p99, edge)),
            ('latency', 'latency, median', f'{_text(1e3 * figures.latency_median, ".2f")} ms'),
            ('latency-p99', '&emsp;p99', f'{_text(1e3 * figures.latency_p99, ".2f")} ms'),
            ('rate', 'answers', f'{figures.rate:g} /s'),
            ('lost', 'lost', f'{figures.lost} of {figures.answered + figures.lost}'),
        ]
    cells = ''.join(
        f'<tr><td style="opacity:0.7">{label}</td><td id="{name}" style="text-align:right;'
        f'font-variant-numeric:tabular-nums"><b>{text}</b></td></tr>' for name, label, text in rows)
    return ('<table id="read-out" style="width:100%;padding:0.6em;font-size:0.9em;'
            f'line-height:1.5">{cells}</table>')


def _line(name: str, text: str, *, bad: bool) -> str:
    return (f'<div id="{name}" style="padding:0 0.7em 0.7em;font-size:0.85em;'
            f'{"color:#c00020" if bad else "opacity:0.7"}">{html.escape(text)}</div>')


def _text(value: float, form: str) -> str:
    return '–' if math.isnan(value) else format(value, form)


def _share(length: float, edge: float) -> str:
    """Return a length [m] in mm and as a share of an edge."""
    if math.isnan(length):
        return '–'
    return f'{1e3 * length:.1f} mm = {100.0 * length / edge:.2f} %'


def _quaternion_from_z(direction: np.ndarray) -> np.ndarray:
    """Return the smallest rotation that brings z to a unit vector, as w x y z."""
    x, y, z = direction
    quaternion = np.array([1.0 + z, -y, x, 0.0])
    length = np.linalg.norm(quaternion)  # 0 for -z: then about x
    return quaternion / length if length > 0.0 else np.array([0.0, 1.0, 0.0, 0.0])


def _edges(size: Sequence[float]) -> np.ndarray:
    """Return the 12 edges of a box about the origin: (12, 2, 3)."""
    corners = 0.5 * np.array(size) * np.array(
        [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    return np.array([[corners[i], corners[i | bit]]
                     for i in range(8) for bit in (1, 2, 4) if not i & bit])

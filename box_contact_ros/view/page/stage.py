# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The drawing on the page: boxes, contacts, ropes, as objects of viser. No ROS.

Boxes are instances of one cube's faces and edges: a tick moves all of them together. The origin of
the drawing is where boxes were first seen. Browsers draw in float32, which is half a metre coarse
in map coordinates.
"""
from __future__ import annotations

import math
from typing import Any

import numpy as np
import viser

from ...scene.pose import rotation_matrix
from .. import style
from ..view_log import AnsweredTick, SceneArrays, Snapshot

GROUND, LINES, SECTIONS = (236, 238, 241), (206, 211, 217), (176, 183, 191)
VIEWPOINT = np.array([-0.55, -0.78, 0.42])
"""Direction from the boxes to the camera at first."""
MARGIN = 1.05  # how much wider the view is than the boxes, so that none touches its edge
WIDE = 16.0 / 9.0  # width divided by height of the view that "reset view" goes back to
SAME_ASPECT = 0.01
"""Views whose ratios of width to height differ by less need no other camera."""
CUBE = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
CUBE_FACES = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
                       [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]])
_ENDS = np.array([(i, i | bit) for i in range(8) for bit in (1, 2, 4) if not i & bit])
CUBE_EDGES = np.concatenate([CUBE[_ENDS], 1.0001 * CUBE[_ENDS[:, :1]]], axis=1)
"""Corners (12, 3, 3) of a triangle an edge, so thin that its wireframe is the edge."""
GAMMA = 2.2  # of the colours of screens
LINE = {'thickness': 2.0, 'thickness_units': 'screen'}


class BoxGroup:
    """Boxes that are drawn together: all that move, or all that do not."""

    def __init__(self, server: viser.ViserServer, name: str, scene: SceneArrays,
                 rows: np.ndarray) -> None:
        self._rows, self._sizes = rows, scene.sizes[rows]
        self._colours = np.where(scene.is_a[rows, None], style.BOX_A, style.BOX_B).astype(np.uint8)
        no_turn, nothing = np.tile([1.0, 0.0, 0.0, 0.0], (len(rows), 1)), np.zeros((len(rows), 3))

        def add(path: str, corners: np.ndarray, triangles: np.ndarray, **look: Any) -> Any:
            return server.scene.add_batched_meshes_simple(
                f'/{path}/{name}', corners, triangles, no_turn, nothing, batched_scales=nothing,
                lod='off', cast_shadow=False, receive_shadow=False, **look)

        # Flat faces look the same as toons, and cost a browser without a GPU some 10 % less.
        self._faces = add('boxes', CUBE, CUBE_FACES, opacity=style.BOX_OPACITY, flat_shading=True,
                          material='toon5')
        self._edges = add('edges', CUBE_EDGES.reshape(-1, 3), np.arange(36).reshape(12, 3),
                          wireframe=True)

    def draw(self, snapshot: Snapshot, origin: np.ndarray) -> None:
        """Move the boxes; those without a pose shrink to nothing, those that are stale turn grey.

        What has not changed is not sent.
        """
        poses = snapshot.poses[self._rows]
        known = ~np.isnan(poses[:, :1])
        poses = style.unit_poses(np.where(known, poses, [0, 0, 0, 0, 0, 0, 1]))
        poses[:, :3] -= np.where(known, origin, 0.0)
        sizes = np.where(known, self._sizes, 0.0)
        stale = snapshot.stale_boxes[self._rows, None]
        colours = np.where(stale, style.STALE_BOX, self._colours).astype(np.uint8)
        for mesh, shades in ((self._faces, colours), (self._edges, colours // 2)):
            mesh.batched_positions = poses[:, :3]
            mesh.batched_wxyzs = np.roll(poses[:, 3:], 1, axis=1)
            mesh.batched_scales = sizes
            mesh.batched_colors = _linear(shades)

    def remove(self) -> None:
        """Take the boxes away."""
        self._faces.remove()
        self._edges.remove()


class Stage:
    """All that is drawn; `draw` brings it up to a snapshot."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._scene: SceneArrays | None = None
        self._origin: np.ndarray | None = None
        self._corners = np.zeros((8, 3))  # of what is looked at, about the origin
        self._seen = 0  # boxes; each that joins brings all of them into view
        self._groups: list[BoxGroup] = []
        server.on_client_connect(self._follow)
        self._light()
        scene = server.scene
        self._ground = scene.add_grid('/ground', 60.0, 60.0, cell_size=1.0, section_size=5.0,
                                      cell_color=LINES, section_color=SECTIONS,
                                      plane_color=GROUND, plane_opacity=1.0, shadow_opacity=0.0,
                                      fade_distance=60.0, visible=False)
        one = np.zeros((1, 2, 3))
        self._points = scene.add_point_cloud('/contact/points', one[:, 0], style.CONTACT,
                                             point_shape='circle', precision='float32',
                                             visible=False)
        self._normals = scene.add_arrows('/contact/normals', one, style.CONTACT, visible=False)
        self._patches = scene.add_mesh_simple(
            '/contact/patches', np.zeros((3, 3)), np.array([[0, 1, 2]]), color=style.CONTACT,
            opacity=style.PATCH_OPACITY, side='double', flat_shading=True, cast_shadow=False,
            receive_shadow=False, visible=False)
        self._outlines = scene.add_line_segments('/contact/outlines', one, style.CONTACT,
                                                 visible=False, **LINE)
        # Crosses, so that they are seen through the points, which are often at the same place.
        self._exact = scene.add_line_segments('/contact/exact', one, style.EXACT, thickness=3.0,
                                              thickness_units='screen', visible=False)
        self._crane = scene.add_line_segments('/crane', one, style.ROPE, visible=False, **LINE)
        self._depths = [scene.add_label(f'/contact/depth_{number}', '', visible=False,
                                        anchor='bottom-left') for number in range(style.LISTED)]

    def _light(self) -> None:
        scene = self._server.scene
        scene.configure_environment_map(None)
        scene.configure_default_lights(False)
        scene.add_light_hemisphere('/light/sky', sky_color=(255, 255, 255),
                                   ground_color=(190, 190, 195), intensity=2.2)
        scene.add_light_directional('/light/sun', color=(255, 250, 240), intensity=2.2,
                                    position=(-6.0, -9.0, 14.0))

    def draw(self, snapshot: Snapshot, lines: np.ndarray) -> None:
        """Show boxes, contacts, and the lines (n, 2, 3) of a crane."""
        with self._server.atomic():
            if snapshot.scene is not self._scene:
                self._set_scene(snapshot.scene)
            known = ~np.isnan(snapshot.poses[:, 0])
            if known.sum() > self._seen:
                self._look_at(snapshot, known)
            for group in self._groups:
                group.draw(snapshot, self._origin)
            self._draw_contacts(snapshot.answer)
            _show(self._crane, points=lines - self._origin)

    def _set_scene(self, scene: SceneArrays) -> None:
        """Replace the boxes; the origin of the drawing is found anew."""
        for group in self._groups:
            group.remove()
        self._scene, self._origin, self._seen = scene, None, 0
        rows = {'moving': np.array(list(scene.moving.values())),
                'fixed': np.flatnonzero(~scene.moves)}
        self._groups = [BoxGroup(self._server, name, scene, found)
                        for name, found in rows.items() if len(found)]
        edge = float(np.median(scene.edges))
        radius = style.POINT_RADIUS * edge
        self._points.point_size = 2.0 * radius
        self._normals.shaft_radius = 0.45 * radius
        self._normals.head_radius = 1.1 * radius
        self._normals.head_length = 2.6 * radius
        self._normal_length = style.NORMAL_LENGTH * edge
        self._cross = 2.5 * radius * np.stack([-np.eye(3), np.eye(3)], axis=1)

    def _draw_contacts(self, answer: AnsweredTick | None) -> None:
        for label in self._depths[len(answer.pairs) if answer else 0:]:
            label.visible = False
        if answer is None:
            for node in (self._points, self._normals, self._patches, self._outlines, self._exact):
                node.visible = False
            return
        points, arrows = answer.points - self._origin, self._normal_length * answer.normals
        outlines = style.patch_outlines(points, answer.semi_axes)
        exact = answer.exact_points - self._origin
        exact = exact[~np.isnan(exact[:, 0])]
        _show(self._points, points=points)
        _show(self._normals, points=np.stack([points, points + arrows], axis=1))
        _show(self._patches, vertices=outlines.reshape(-1, 3), faces=_fans(*outlines.shape[:2]))
        _show(self._outlines, points=style.sides(outlines))
        _show(self._exact, points=(exact[:, None, None] + self._cross).reshape(-1, 2, 3))
        for label, row in zip(self._depths, answer.deepest):
            label.text = f'{1e3 * answer.contacts["depth"][row]:.1f} mm'
            label.position = points[row] - 0.6 * arrows[row]
            label.visible = True

    def _look_at(self, snapshot: Snapshot, known: np.ndarray) -> None:
        """Put origin, ground and camera where the boxes `known` (n,) are."""
        self._seen = known.sum()
        poses, sizes = snapshot.poses[known], snapshot.scene.sizes[known]
        # Half the extents along the frame's axes.
        half = 0.5 * np.einsum('nij,nj->ni', np.abs(rotation_matrix(poses[:, 3:])), sizes)
        low, high = (poses[:, :3] - half).min(axis=0), (poses[:, :3] + half).max(axis=0)
        self._origin = middle = 0.5 * (low + high)
        self._ground.position = (0.0, 0.0, float(low[2] - middle[2]))
        extent = float(np.linalg.norm(high - low))
        for name in ('width', 'height', 'fade_distance'):
            setattr(self._ground, name, max(60.0, 3.0 * extent))
        self._ground.visible = True
        initial = self._server.initial_camera  # what the button "reset view" goes back to
        self._corners = CUBE * (high - low)
        initial.position = camera_position(self._corners, initial.fov, WIDE)
        initial.look_at = np.zeros(3)
        for client in self._server.get_clients().values():
            self._aim(client)

    def _follow(self, client: viser.ClientHandle) -> None:
        """Bring all boxes into a browser's view, and again whenever its shape changes."""
        aspect = client.camera.aspect
        self._aim(client)

        def updated(camera: viser.CameraHandle) -> None:
            nonlocal aspect
            if abs(camera.aspect / aspect - 1.0) > SAME_ASPECT:
                aspect = camera.aspect
                self._aim(client)
        client.camera.on_update(updated)

    def _aim(self, client: viser.ClientHandle) -> None:
        """Bring a browser's camera to where all boxes are in its view."""
        if self._origin is None:
            return
        camera = client.camera
        # In this order: setting the position moves the other along.
        camera.position = camera_position(self._corners, camera.fov, camera.aspect)
        camera.look_at = np.zeros(3)


def camera_position(corners: np.ndarray, fov: float, aspect: float) -> np.ndarray:
    """Return where a camera (3,) towards the origin has corners (n, 3) in view, from VIEWPOINT.

    fov: vertical angle of view [rad]; aspect: width of the view divided by its height.
    """
    back = VIEWPOINT / np.linalg.norm(VIEWPOINT)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    tangent = math.tan(0.5 * fov)
    aside = np.maximum(np.abs(corners @ right) / (tangent * aspect),
                       np.abs(corners @ np.cross(back, right)) / tangent)
    position: np.ndarray = (MARGIN * aside + corners @ back).max() * back
    return position


def _linear(colours: np.ndarray) -> np.ndarray:
    """Return colours (n, 3) as light: viser takes those of single instances for that."""
    return (255.0 * (colours / 255.0) ** GAMMA).astype(np.uint8)


def _show(node: Any, **arrays: np.ndarray) -> None:
    """Give a node what is drawn, by attribute, or hide it where that is empty."""
    node.visible = all(map(len, arrays.values()))
    for name, values in arrays.items() if node.visible else ():
        setattr(node, name, values)


def _fans(count: int, corners: int) -> np.ndarray:
    """Return the triangles (n, 3) of so many polygons: a fan each."""
    corner = np.arange(1, corners - 1)
    fan = np.stack([np.zeros_like(corner), corner, corner + 1], axis=1)
    return (fan + corners * np.arange(count)[:, None, None]).reshape(-1, 3)

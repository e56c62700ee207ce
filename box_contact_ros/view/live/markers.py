# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Markers for RViz and Foxglove: what a listener has heard, as visualization messages."""
from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import Point
from rclpy.context import Context
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from ...node.messages import make_header, set_pose
from ...node.parameters import SCENE_PARAMETERS
from ...node.topics import contact_qos
from ...solver.contact import Contacts
from ...solver.nearest import Nearests
from .. import style
from .listener import DrawnTick, Listener, SceneRows

PERIOD = 1 / 30  # time [s] between marker arrays
FIXED_PERIOD = 1.0  # time [s] between those that have the fixed boxes, for viewers that start later
DELETED = 5.0
"""Time [s] for which arrays delete what is gone: a viewer that is behind loses some of them."""
LABELLED = 10
"""Contacts whose depth is written beside them, the deepest; and pairs near, the nearest."""
TEXT_HEIGHT = 0.04  # of the longest edge
WHITE: style.Colour = (255, 255, 255)


def make_marker(header: Header, name: str, kind: int, colour: style.Colour,
                opacity: float = 1.0, *, number: int = 0) -> Marker:
    """Return a marker of a kind (`Marker.CUBE`, ...) without pose and scale; colour: 0 to 255."""
    red, green, blue = (value / 255.0 for value in colour)
    return Marker(header=header, ns=name, id=number, type=kind, action=Marker.ADD,
                  color=ColorRGBA(r=red, g=green, b=blue, a=opacity))


def line_marker(header: Header, name: str, lines: np.ndarray, *, width: float,
                colour: style.Colour) -> Marker:
    """Return the marker of straight lines with ends (n, 2, 3) [m]; colour: 0 to 255."""
    marker = make_marker(header, name, Marker.LINE_LIST, colour)
    marker.scale.x = float(width)
    marker.points = [Point(x=x, y=y, z=z) for x, y, z in lines.reshape(-1, 3).tolist()]
    return marker


def scene_markers(tick: DrawnTick, *, fixed: bool = True) -> list[Marker]:
    """Return what draws a tick: boxes by their row as id, contacts the deepest first.

    fixed: whether the fixed boxes, too.
    """
    header = make_header(tick.stamp, tick.frame_id)
    markers = list(_boxes(header, tick, fixed))
    answer, sizes = tick.answer, tick.rows.sizes
    if answer is not None and len(answer.pairs):
        markers += _contacts(header, answer.contacts, _edges(sizes, answer.pairs))
    if answer is not None and len(answer.near):
        markers += _near(header, answer.near, _edges(sizes, answer.near_pairs))
    return markers


def _edges(sizes: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """Return the longest edge (k,) of each pair's smaller box [m]."""
    return np.asarray(sizes[pairs].max(axis=2).min(axis=1))


def _boxes(header: Header, tick: DrawnTick, fixed: bool) -> Iterator[Marker]:
    """Yield a translucent cube for each box that has a pose; fixed: whether for fixed ones, too."""
    poses = style.unit_poses(tick.poses)
    for row in np.flatnonzero(~np.isnan(poses[:, 0]) & (fixed | ~tick.rows.scene.is_fixed)):
        colour = style.BOX_A if tick.rows.is_a[row] else style.BOX_B
        marker = make_marker(header, 'boxes', Marker.CUBE, colour, style.BOX_OPACITY,
                             number=int(row))
        set_pose(marker.pose, poses[row])
        _set(marker.scale, tick.rows.sizes[row])
        yield marker


def _contacts(header: Header, contacts: Contacts, edges: np.ndarray) -> Iterator[Marker]:
    """Yield points and patches of all contacts, a normal for each, depths of the deepest.

    edges: (k,) longest edge of each pair's smaller box [m].
    """
    radii = style.POINT_RADIUS * edges
    arrows = style.NORMAL_LENGTH * edges[:, None] * contacts.normal
    spheres = make_marker(header, 'points', Marker.SPHERE_LIST, style.CONTACT)
    spheres.points = [_set(Point(), point) for point in contacts.point]
    _set(spheres.scale, [2.0 * radii[0]] * 3)
    yield spheres
    for row, (point, arrow) in enumerate(zip(contacts.point, arrows)):
        normal = make_marker(header, 'normals', Marker.ARROW, style.CONTACT, number=row)
        normal.points = [_set(Point(), end) for end in (point, point + arrow)]
        # Of an arrow with two points: diameter of the shaft, diameter and length of the head.
        _set(normal.scale, np.array([0.8, 1.8, 3.0]) * radii[row])
        yield normal
        if row < LABELLED:
            depth = make_marker(header, 'depths', Marker.TEXT_VIEW_FACING, WHITE, number=row)
            # At the arrow's tail, where neither point nor arrow is.
            _set(depth.pose.position, point - 0.5 * arrow)
            depth.scale.z = TEXT_HEIGHT * float(edges[row])
            depth.text = f'depth {-1e3 * contacts.separation[row]:.2f} mm'
            yield depth
    sides = style.patch_sides(contacts.point, contacts.normal, contacts.covariance)
    if len(sides):
        yield line_marker(header, 'patches', sides, width=0.5 * radii[0], colour=style.CONTACT)


def _near(header: Header, near: Nearests, edges: np.ndarray) -> Iterator[Marker]:
    """Yield the dashed lines between nearest points, and the distances of the nearest pairs."""
    yield line_marker(header, 'near', style.dashes(near.point_a, near.point_b),
                      width=0.5 * style.POINT_RADIUS * edges[0], colour=style.NEAR)
    for row, middle in enumerate(0.5 * (near.point_a + near.point_b)[:LABELLED]):
        distance = make_marker(header, 'distances', Marker.TEXT_VIEW_FACING, WHITE, number=row)
        _set(distance.pose.position, middle)
        distance.scale.z = TEXT_HEIGHT * float(edges[row])
        distance.text = f'{near.distance[row]:.3f} m'
        yield distance


def _set(xyz: Any, values: Sequence[float] | np.ndarray) -> Any:
    """Write three numbers to a message's x, y, z; return the message."""
    xyz.x, xyz.y, xyz.z = (float(value) for value in values)
    return xyz


class MarkersNode(Listener):
    """Draws what it has heard when a timer triggers; takes away what is drawn no more."""

    def __init__(self, context: Context, **options: Any) -> None:
        super().__init__('markers', context, SCENE_PARAMETERS, contact_qos(), **options)
        self._drawn: set[tuple[str, int]] = set()
        self._fixed: set[tuple[str, int]] = set()  # those of fixed boxes
        self._fixed_rows: SceneRows | None = None  # whose boxes these are
        self._fixed_at = 0.0  # when they were sent last, by the steady clock [s]
        self._gone: dict[tuple[str, int], float] = {}  # since when, by the steady clock [s]
        self._markers = self.create_publisher(MarkerArray, 'markers', contact_qos())
        self.create_timer(PERIOD, self._publish)
        self.get_logger().info('ready')

    def _publish(self) -> None:
        tick = None if self.quiet else self.tick()
        if tick is None:
            return
        now = time.monotonic()
        is_due = tick.rows is not self._fixed_rows or now - self._fixed_at >= FIXED_PERIOD
        markers = scene_markers(tick, fixed=is_due)
        if is_due:
            self._fixed_rows, self._fixed_at = tick.rows, now
            self._fixed = {('boxes', row)
                           for row in np.flatnonzero(tick.rows.scene.is_fixed).tolist()}
        drawn = self._fixed.union((marker.ns, marker.id) for marker in markers)
        self._gone = {key: since for key, since in self._gone.items()
                      if key not in drawn and now - since <= DELETED}
        self._gone |= dict.fromkeys(self._drawn - drawn, now)
        self._drawn = drawn
        header = make_header(tick.stamp, tick.frame_id)
        gone = [Marker(header=header, ns=name, id=number, action=Marker.DELETE)
                for name, number in sorted(self._gone)]
        self._markers.publish(MarkerArray(markers=markers + gone))

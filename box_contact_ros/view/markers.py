# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Markers for RViz and Foxglove: all boxes of a scene; point, normal, patch, depth of contacts.

Subscribes the poses of all moving boxes, and the contact node's contacts. Publishes markers
(visualization_msgs/MarkerArray), at most `rate` times a second and only what is new. RViz with
config/contact.rviz shows them, Foxglove with config/contact.foxglove.json. A patch is an ellipse
that touches the edges of a rectangle. Boxes without a recent pose are grey.
"""
from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import Point
from rclpy.context import Context
from std_msgs.msg import Header
from visualization_msgs.msg import Marker, MarkerArray

from ..node.contact_program import PARAMETERS as CONTACT_PARAMETERS
from ..node.declared_parameters import CheckedParameters
from ..node.messages import NANOSECONDS, make_header
from ..node.named_files import FIXED_PARAMETERS, NamedFiles, named_scene
from ..node.parameters import Setting, answer_help, number
from ..node.ros_client import line_marker, make_marker, set_pose
from ..node.runtime import CONTACT_QOS, run_node
from . import style
from .listener import Listener
from .view_log import AnsweredTick, Snapshot

OF_SCENE = ('size_a', 'size_b', 'scene')
PARAMETERS = {name: CONTACT_PARAMETERS[name] for name in OF_SCENE} | {
    'rate': Setting(30.0, 'most marker arrays published per second [Hz]', number(0.1, 1000)),
    **FIXED_PARAMETERS,
}
NAMESPACES = ('boxes', 'points', 'normals', 'patches', 'depths')
"""RViz shows a tick box for each. Of boxes, normals and depths every marker has its own id."""
WHITE: style.Colour = (255, 255, 255)


def scene_markers(snapshot: Snapshot) -> list[Marker]:
    """Return what draws a snapshot: boxes by their row as id, contacts the deepest first."""
    header = make_header(snapshot.stamp, snapshot.frame_id)
    markers = list(_boxes(header, snapshot))
    if snapshot.answer is not None and len(snapshot.answer.pairs):
        markers += _contacts(header, snapshot.answer)
    return markers


def _boxes(header: Header, snapshot: Snapshot) -> Iterator[Marker]:
    """Yield a translucent cube for each box that has a pose."""
    scene = snapshot.scene
    for row in np.flatnonzero(~np.isnan(snapshot.poses[:, 0])):
        colour = (style.STALE_BOX if snapshot.stale_boxes[row] else
                  style.BOX_A if scene.is_a[row] else style.BOX_B)
        marker = make_marker(header, 'boxes', Marker.CUBE, colour, style.BOX_OPACITY,
                             number=int(row))
        set_pose(marker.pose, style.unit_poses(snapshot.poses[row, None])[0])
        _set(marker.scale, scene.sizes[row])
        yield marker


def _contacts(header: Header, answer: AnsweredTick) -> Iterator[Marker]:
    """Yield points and patches of all contacts, a normal for each, depths of the deepest."""
    spheres = make_marker(header, 'points', Marker.SPHERE_LIST, style.CONTACT)
    spheres.points = [_set(Point(), point) for point in answer.points]
    edges = answer.scene.edges[answer.pairs]
    radii, arrows = style.POINT_RADIUS * edges, style.NORMAL_LENGTH * edges * answer.normals.T
    _set(spheres.scale, [2.0 * radii[0]] * 3)
    yield spheres
    for rank, row in enumerate(answer.deepest):
        point, arrow = answer.points[row], arrows[:, row]
        normal = make_marker(header, 'normals', Marker.ARROW, style.CONTACT, number=rank)
        normal.points = [_set(Point(), end) for end in (point, point + arrow)]
        # Of an arrow with two points: diameter of the shaft, diameter and length of the head.
        _set(normal.scale, np.array([0.8, 1.8, 3.0]) * radii[row])
        yield normal
        if rank < style.LISTED:
            depth = make_marker(header, 'depths', Marker.TEXT_VIEW_FACING, WHITE, number=rank)
            # At the arrow's tail, where neither point nor arrow is.
            _set(depth.pose.position, point - 0.5 * arrow)
            depth.scale.z = style.TEXT_HEIGHT * float(edges[row])
            depth.text = f'depth {1e3 * answer.contacts["depth"][row]:.2f} mm'
            yield depth
    outlines = style.patch_outlines(answer.points, answer.semi_axes)
    if len(outlines):
        yield line_marker(header, 'patches', style.sides(outlines), width=0.5 * radii[0],
                          colour=style.CONTACT)


def _set(xyz: Any, values: Sequence[float] | np.ndarray) -> Any:
    """Write three numbers to a message's x, y, z; return the message."""
    xyz.x, xyz.y, xyz.z = (float(value) for value in values)
    return xyz


class MarkersNode(Listener):
    """Draws what its log has when a timer triggers; takes away what is drawn no more."""

    def __init__(self, context: Context, **options: Any) -> None:
        self._drawn: set[tuple[str, int]] = set()
        self._changed = False
        super().__init__('markers', context, CONTACT_QOS, **options)
        self._settings = CheckedParameters(self, PARAMETERS, self._apply)
        self._files = NamedFiles(self, self._settings.values)
        self._markers = self.create_publisher(MarkerArray, 'markers', CONTACT_QOS)
        self._timer = self.create_timer(1.0, self._publish)
        self._apply(self._settings.values, PARAMETERS, starts=True)
        self.get_logger().info(f'ready: at most {self._settings.values["rate"]:g} Hz')

    def _apply(self, settings: dict[str, Any], names: Collection[str], *,
               starts: bool = False) -> None:
        if not set(OF_SCENE).isdisjoint(names):
            with self._files.resolved(settings, starts=starts) as resolved:
                self.listen_to(named_scene(resolved, limits=self._files.limits(settings)))
        self._timer.timer_period_ns = round(NANOSECONDS / settings['rate'])
        self._changed = True

    def heard(self) -> None:
        """Draw the next time."""
        self._changed = True

    def _publish(self) -> None:
        snapshot = self.log.snapshot() if self.log and self._changed else None
        self._changed = False
        if snapshot is None:
            return
        markers = scene_markers(snapshot)
        drawn = {(marker.ns, marker.id) for marker in markers}
        header = make_header(snapshot.stamp, snapshot.frame_id)
        gone = [Marker(header=header, ns=name, id=key, action=Marker.DELETE)
                for name, key in sorted(self._drawn - drawn)]
        self._drawn = drawn
        self._markers.publish(MarkerArray(markers=markers + gone))


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM."""
    answer_help('markers', __doc__, PARAMETERS, args)
    return run_node(MarkersNode, args)

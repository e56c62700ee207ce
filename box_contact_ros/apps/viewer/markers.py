"""Markers for RViz: both boxes, and while they touch the point, normal, depth and patch.

Subscribes box_a/pose, box_b/pose and the contact node's contacts. Publishes markers
(visualization_msgs/MarkerArray), at most `rate` times a second and only what is new. RViz with
config/contact.rviz shows them. The patch is an ellipse that touches the edges of a rectangle.
"""
from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import Point
from rclpy.context import Context
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from ...node.messages import NANOSECONDS, make_header
from ...node.parameters import CheckedParameters, Setting, answer_help, number, size
from ...node.runtime import CONTACT_QOS, run_node
from ...scene.force.patch_law import Patch
from ...scene.pose_sets import CONTAINER
from ...scene.stamp_pairing import StampedPose
from ..bench.answer_log import first_row, touch_in
from ..ros_client import set_pose, stamp_of
from .listener import Listener
from .style import (
    BOX_A,
    BOX_B,
    BOX_OPACITY,
    CONTACT,
    STALE,
    Colour,
    patch_ellipse,
    proportions,
    unit_pose,
)

PARAMETERS = {
    'size_a': Setting(CONTAINER, 'full extents of box A, three numbers > 0 [m]', size),
    'size_b': Setting(CONTAINER, 'full extents of box B, three numbers > 0 [m]', size),
    'rate': Setting(30.0, 'most marker arrays published per second [Hz]', number(0.1, 1000)),
}
BOXES = (('box_a', BOX_A), ('box_b', BOX_B))


def box_marker(box: int, pose: StampedPose, extents: Sequence[float]) -> Marker:
    """Return a cube for box 0 (A) or 1 (B) with full extents [m], translucent."""
    name, colour = BOXES[box]
    marker = _marker(make_header(pose.stamp, pose.frame_id), name, Marker.CUBE)
    set_pose(marker.pose, unit_pose(pose.numbers))
    _set(marker.scale, extents)
    marker.color = _colour(colour, BOX_OPACITY)
    return marker


def contact_markers(header: Header, touch: Patch | None, size_a: Sequence[float],
                    size_b: Sequence[float]) -> list[Marker]:
    """Return point, normal (from A to B), depth in words and patch of a contact; None deletes them.

    The patch is deleted, too, where the model gives none.
    """
    point, normal, depth, patch = markers = [_marker(header, name, kind) for name, kind in (
        ('point', Marker.SPHERE), ('normal', Marker.ARROW), ('depth', Marker.TEXT_VIEW_FACING),
        ('patch', Marker.LINE_STRIP))]
    if touch is None:
        for marker in markers:
            marker.action = Marker.DELETE
        return markers
    look = proportions(size_a, size_b)
    arrow = look.normal_length * touch.normal
    _set(point.pose.position, touch.point)
    _set(point.scale, [2.0 * look.point_radius] * 3)
    normal.points = [_set(Point(), end) for end in (touch.point, touch.point + arrow)]
    # Of an arrow with two points: diameter of the shaft, diameter and length of the head.
    _set(normal.scale, np.array([0.8, 1.8, 3.0]) * look.point_radius)
    # At the arrow's tail, where neither point nor arrow is.
    _set(depth.pose.position, touch.point - 0.5 * arrow)
    depth.scale.z = look.text_height
    depth.text = f'depth {1e3 * touch.depth:.2f} mm'
    for marker in markers:
        marker.color = _colour(CONTACT, 1.0)
    depth.color = _colour((255, 255, 255), 1.0)
    ellipse = patch_ellipse(touch)
    if ellipse is None:
        patch.action = Marker.DELETE
        return markers
    _set(patch.pose.position, touch.point)
    patch.scale.x = 0.5 * look.point_radius  # the line's width
    patch.points = [_set(Point(), place) for place in ellipse.outline]
    return markers


def _marker(header: Header, name: str, kind: int) -> Marker:
    """Return a marker with a namespace of its own: RViz shows a tick box for each."""
    return Marker(header=header, ns=name, id=0, type=kind, action=Marker.ADD)


def _set(xyz: Any, values: Sequence[float] | np.ndarray) -> Any:
    """Write three numbers to a message's x, y, z; return the message."""
    xyz.x, xyz.y, xyz.z = (float(value) for value in values)
    return xyz


def _colour(colour: Colour, opacity: float) -> ColorRGBA:
    red, green, blue = (value / 255.0 for value in colour)
    return ColorRGBA(r=red, g=green, b=blue, a=opacity)


class MarkersNode(Listener):
    """Keeps what came last, and draws it when a timer triggers."""

    def __init__(self, context: Context, **options: Any) -> None:
        self._poses: dict[int, StampedPose] = {}
        self._answer: tuple[Header, Patch | None] | None = None
        self._changed = False
        super().__init__('markers', context, CONTACT_QOS, **options)
        self._settings = CheckedParameters(self, PARAMETERS, self._apply)
        self._markers = self.create_publisher(MarkerArray, 'markers', CONTACT_QOS)
        rate = self._settings.values['rate']
        self._timer = self.create_timer(1.0 / rate, self._publish)
        self.get_logger().info(f'ready: at most {rate:g} Hz')

    def _apply(self, settings: dict[str, Any], _: Collection[str]) -> None:
        self._timer.timer_period_ns = round(NANOSECONDS / settings['rate'])
        self._changed = True

    def on_pose(self, box: int, pose: StampedPose) -> None:
        """Draw the box there next time."""
        self._poses[box], self._changed = pose, True

    def on_cloud(self, header: Header, rows: np.ndarray) -> None:
        """Draw the contact next time."""
        self._answer, self._changed = (header, touch_in(first_row(rows))), True

    def _publish(self) -> None:
        if self._changed:
            self._changed = False
            self._markers.publish(MarkerArray(markers=self._drawn()))

    def _drawn(self) -> list[Marker]:
        sizes = [self._settings.values[name] for name in ('size_a', 'size_b')]
        markers = [box_marker(box, self._poses[box], sizes[box]) for box in sorted(self._poses)]
        if self._answer is not None:
            header, touch = self._answer
            if any(pose.stamp - stamp_of(header) > STALE for pose in self._poses.values()):
                touch = None
            markers += contact_markers(header, touch, *sizes)
        return markers


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM."""
    answer_help('markers', __doc__, PARAMETERS, args)
    return run_node(MarkersNode, args)

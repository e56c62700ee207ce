"""Markers for RViz: both boxes, and while they touch the contact point, the normal, the depth.

Subscribes box_a/pose, box_b/pose and contacts, which a contact node answers with; publishes markers
(visualization_msgs/MarkerArray), at most `rate` times a second and only what is new. RViz with
config/contact.rviz shows them.
"""
from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import Point, PoseStamped
from rcl_interfaces.msg import SetParametersResult
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from ...node.contact_node import CONTAINER
from ...node.messages import (
    NANOSECONDS,
    OTHER_SCENE,
    Refused,
    TypedMessages,
    is_of_two_boxes,
    make_header,
    read_cloud,
)
from ...node.parameters import Setting, answer_help, checked, declare, number, size
from ...node.runtime import CONTACT_QOS, LOG_SECONDS, POSE_QOS, run_node
from ...scene.pairing import StampedPose
from .style import BOX_A, BOX_B, BOX_OPACITY, CONTACT, STALE, Colour, proportions

PARAMETERS = {
    'size_a': Setting(CONTAINER, 'full extents of box A, three numbers > 0 [m]', size),
    'size_b': Setting(CONTAINER, 'full extents of box B, three numbers > 0 [m]', size),
    'rate': Setting(30.0, 'most marker arrays published per second [Hz]', number(0.1, 1000)),
}
BOXES = (('box_a', BOX_A), ('box_b', BOX_B))


def box_marker(box: int, pose: StampedPose, extents: Sequence[float]) -> Marker:
    """A cube for box 0 (A) or 1 (B) with full extents [m], translucent."""
    name, colour = BOXES[box]
    marker = _marker(make_header(pose.stamp, pose.frame_id), name, Marker.CUBE)
    turn = pose.numbers[3:] / np.linalg.norm(pose.numbers[3:])  # RViz wants unit length
    _set(marker.pose.position, pose.numbers[:3])
    q = marker.pose.orientation
    q.x, q.y, q.z, q.w = (float(value) for value in turn)
    _set(marker.scale, extents)
    marker.color = _colour(colour, BOX_OPACITY)
    return marker


def contact_markers(header: Header, row: np.void | None, size_a: Sequence[float],
                    size_b: Sequence[float]) -> list[Marker]:
    """Point, normal (from A to B) and depth in words of a row of `contacts`; None deletes them."""
    point, normal, depth = (_marker(header, name, kind) for name, kind in (
        ('point', Marker.SPHERE), ('normal', Marker.ARROW), ('depth', Marker.TEXT_VIEW_FACING)))
    markers = [point, normal, depth]
    if row is None:
        for marker in markers:
            marker.action = Marker.DELETE
        return markers
    look = proportions(size_a, size_b)
    at = np.array([row['x'], row['y'], row['z']])
    direction = np.array([row['normal_x'], row['normal_y'], row['normal_z']])
    _set(point.pose.position, at)
    _set(point.scale, [2.0 * look.point_radius] * 3)
    normal.points = [_set(Point(), end) for end in (at, at + look.normal_length * direction)]
    # Of an arrow with two points: diameter of the shaft, diameter and length of the head.
    _set(normal.scale, np.array([0.8, 1.8, 3.0]) * look.point_radius)
    # Beside the arrow's tail, where neither point nor arrow is.
    _set(depth.pose.position, at - 0.5 * look.normal_length * direction)
    depth.scale.z = look.text_height
    depth.text = f'depth {1e3 * row["depth"]:.2f} mm'
    for marker in markers:
        marker.color = _colour(CONTACT, 1.0)
    depth.color = _colour((255, 255, 255), 1.0)
    return markers


def _marker(header: Header, name: str, kind: int) -> Marker:
    """Namespaces name the markers: RViz shows them with a tick box each."""
    return Marker(header=header, ns=name, id=0, type=kind, action=Marker.ADD)


def _set(xyz: Any, values: Sequence[float]) -> Any:
    """Write three numbers to a message's x, y, z; returns the message."""
    xyz.x, xyz.y, xyz.z = (float(value) for value in values)
    return xyz


def _colour(colour: Colour, opacity: float) -> ColorRGBA:
    red, green, blue = (value / 255.0 for value in colour)
    return ColorRGBA(r=red, g=green, b=blue, a=opacity)


class MarkersNode(Node):
    """Keeps what came last, and draws it when a timer says so."""

    def __init__(self, context: Context, **options: Any) -> None:
        super().__init__('markers', context=context, **options)
        self._settings = declare(self, PARAMETERS)
        self.add_on_set_parameters_callback(self._set_parameters)
        self._poses: list[StampedPose | None] = [None, None]
        self._answer: tuple[Header, int, np.void | None] | None = None
        self._news = False
        self._markers = self.create_publisher(MarkerArray, 'markers', CONTACT_QOS)
        for box, topic in enumerate(('box_a/pose', 'box_b/pose')):
            self.create_subscription(PoseStamped, topic, self._pose_callback(box), POSE_QOS)
        self.create_subscription(PointCloud2, 'contacts', self._on_cloud, CONTACT_QOS)
        self._timer = self.create_timer(1.0 / self._settings['rate'], self._publish)
        self.get_logger().info(f'ready: at most {self._settings["rate"]:g} Hz')

    def _set_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        changes = {p.name: p.value for p in parameters if p.name in PARAMETERS}
        try:
            self._settings = checked(PARAMETERS, {**self._settings, **changes})
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        self._timer.timer_period_ns = round(NANOSECONDS / self._settings['rate'])
        self._news = True
        return SetParametersResult(successful=True)

    def _pose_callback(self, box: int) -> Callable[[PoseStamped], None]:
        read = TypedMessages().read_pose

        def callback(message: PoseStamped) -> None:
            # The contact node counts and reports what is refused; here it is only not drawn.
            with contextlib.suppress(Refused):
                self._poses[box], self._news = read(message), True
        return callback

    def _on_cloud(self, message: PointCloud2) -> None:
        stamp = message.header.stamp.sec * NANOSECONDS + message.header.stamp.nanosec
        rows = read_cloud(message)
        if not is_of_two_boxes(rows):
            self.get_logger().warning(OTHER_SCENE, throttle_duration_sec=LOG_SECONDS)
            return
        # A row of NaN says that the pair could not be evaluated.
        row = next((row for row in rows if math.isfinite(row['depth'])), None)
        self._answer, self._news = (message.header, stamp, row), True

    def _publish(self) -> None:
        if not self._news:
            return
        self._news = False
        self._markers.publish(MarkerArray(markers=self._scene()))

    def _scene(self) -> list[Marker]:
        sizes = self._settings['size_a'], self._settings['size_b']
        poses = [(box, pose) for box, pose in enumerate(self._poses) if pose is not None]
        markers = [box_marker(box, pose, sizes[box]) for box, pose in poses]
        if self._answer is not None:
            header, stamp, row = self._answer
            if any(pose.stamp - stamp > STALE for _, pose in poses):
                row = None
            markers += contact_markers(header, row, *sizes)
        return markers


def main(args: Sequence[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM."""
    answer_help('markers', __doc__, PARAMETERS, args)
    return run_node(MarkersNode, args)

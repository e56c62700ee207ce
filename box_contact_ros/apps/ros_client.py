"""What clients of the contact node need of rclpy: a node that is served, messages as numbers."""
from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

import numpy as np
import rclpy
from geometry_msgs.msg import Point, PoseStamped
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from ..node.messages import NANOSECONDS
from ..node.runtime import make_executor, uninterrupted
from ..resources import find_file
from ..scene.files.scene_file import read_scene
from ..scene.scene_solver import Scene

CRANE_MARKERS = 'crane/markers'
"""Where the crane publishes its ropes and its spreader, as lines."""
NodeKind = TypeVar('NodeKind', bound=Node)

DEEP_RELIABLE = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
"""What the DDS layer delivers while Python is busy must not push out the rest."""


@contextmanager
def joined(make_node: Callable[[Context], NodeKind], args: Sequence[str] | None = None, *,
           domain: int | None = None, signals: SignalHandlerOptions = SignalHandlerOptions.NO,
           ) -> Iterator[tuple[NodeKind, Any]]:
    """Give a node and its executor in a context of their own; end all three afterwards.

    signals: which handlers of rclpy's are installed; none where the caller has its own. After a
    signal, whatever was under way fails; that is raised as ExternalShutdownException.
    """
    context = Context()
    rclpy.init(args=None if args is None else list(args), context=context, domain_id=domain,
               signal_handler_options=signals)
    node = executor = None
    try:
        node = make_node(context)
        executor = make_executor(context)
        executor.add_node(node)
        yield node, executor
    except Exception as error:
        if context.ok():
            raise
        raise ExternalShutdownException from error
    finally:
        with uninterrupted():
            if executor is not None:
                executor.shutdown()
            if node is not None:
                node.destroy_node()
            context.try_shutdown()


def read_scene_text(source: str) -> tuple[str, Scene]:
    """Return the text of a scene that is a file, or a text itself, and the scene; SceneError."""
    scene = read_scene(source)
    path = find_file(source)
    return path.read_text('utf-8') if path.is_file() else source, scene


def line_marker(header: Header, name: str, lines: np.ndarray, *, width: float,
                colour: tuple[int, int, int]) -> Marker:
    """Return the marker of straight lines with ends (n, 2, 3) [m]; colour: 0 to 255."""
    red, green, blue = (value / 255.0 for value in colour)
    marker = Marker(header=header, ns=name, type=Marker.LINE_LIST, action=Marker.ADD,
                    color=ColorRGBA(r=red, g=green, b=blue, a=1.0))
    marker.scale.x = float(width)
    marker.points = [Point(x=x, y=y, z=z) for x, y, z in lines.reshape(-1, 3).tolist()]
    return marker


def lines_of(message: MarkerArray) -> np.ndarray:
    """Return the ends (n, 2, 3) of all lines of a `line_marker`."""
    ends = [(point.x, point.y, point.z) for marker in message.markers
            if marker.type == Marker.LINE_LIST for point in marker.points]
    return np.array(ends).reshape(-1, 2, 3)


def stamp_of(header: Header) -> int:
    """Return a header's stamp [ns]."""
    return int(header.stamp.sec) * NANOSECONDS + int(header.stamp.nanosec)


def pose_message(header: Header, pose: np.ndarray) -> PoseStamped:
    """Return the message of a pose `x y z qx qy qz qw`."""
    message = PoseStamped(header=header)
    set_pose(message.pose, pose)
    return message


def set_pose(pose: Any, numbers: np.ndarray) -> None:
    """Write a pose `x y z qx qy qz qw` into a geometry_msgs/Pose."""
    p, q = pose.position, pose.orientation
    p.x, p.y, p.z, q.x, q.y, q.z, q.w = map(float, numbers)

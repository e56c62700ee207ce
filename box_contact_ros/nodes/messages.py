"""Between messages and numbers: poses in; point, normal and the contacts cloud out."""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PointStamped, PoseStamped, Vector3Stamped
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header

from ..checks import shown
from ..contact import Contact

NANOSECONDS = 1_000_000_000

CLOUD_ROW = np.dtype([(name, '<f8') for name in (
    'x', 'y', 'z', 'normal_x', 'normal_y', 'normal_z', 'depth')] + [('pair', '<u4')])
"""One row of the `contacts` cloud: a pair in contact. float64, because float32 loses half a metre
in UTM coordinates; depth = −separation [m]."""
_FIELDS = [
    PointField(name=name, offset=CLOUD_ROW.fields[name][1], count=1,
               datatype=PointField.UINT32 if name == 'pair' else PointField.FLOAT64)
    for name in CLOUD_ROW.names]


@dataclass(frozen=True)
class StampedPose:
    """A pose as it came: 7 numbers `x y z qx qy qz qw`, frame and stamp [ns]."""

    numbers: np.ndarray
    frame_id: str
    stamp: int


def header_fault(header: Header) -> str | None:
    """Why an answer cannot carry this stamp and frame as they came, or None."""
    if header.stamp.nanosec >= NANOSECONDS:
        return f'stamp has {header.stamp.nanosec} nanoseconds, a second or more'
    if '\N{REPLACEMENT CHARACTER}' in header.frame_id:  # rclpy's word for bytes it cannot decode
        return f'frame_id {shown(header.frame_id)} is not UTF-8'
    return None


def read_pose(message: PoseStamped) -> StampedPose:
    """The numbers of a message, unchecked."""
    p, q = message.pose.position, message.pose.orientation
    stamp = message.header.stamp
    return StampedPose(np.array((p.x, p.y, p.z, q.x, q.y, q.z, q.w)), message.header.frame_id,
                       stamp.sec * NANOSECONDS + stamp.nanosec)


def make_header(stamp: int, frame_id: str) -> Header:
    """Header of a stamp [ns]."""
    return Header(stamp=Time(sec=stamp // NANOSECONDS, nanosec=stamp % NANOSECONDS),
                  frame_id=frame_id)


def make_point(header: Header, contact: Contact) -> PointStamped:
    """`contact/point`; values are made float: messages do not check them."""
    message = PointStamped(header=header)
    point = message.point
    point.x, point.y, point.z = (float(value) for value in contact.point)
    return message


def make_normal(header: Header, contact: Contact) -> Vector3Stamped:
    """`contact/normal`."""
    message = Vector3Stamped(header=header)
    vector = message.vector
    vector.x, vector.y, vector.z = (float(value) for value in contact.normal)
    return message


def make_cloud(header: Header, rows: Sequence[tuple[int, Contact]]) -> PointCloud2:
    """`contacts`: a row for each (pair id, contact) that collides; none says 'no contact'."""
    touching = [(*c.point, *c.normal, -c.separation, pair) for pair, c in rows if c.colliding]
    data = np.array(touching, dtype=CLOUD_ROW)
    return PointCloud2(header=header, height=1, width=len(touching), fields=_FIELDS,
                       is_bigendian=False, point_step=CLOUD_ROW.itemsize,
                       row_step=CLOUD_ROW.itemsize * len(touching), data=data.tobytes(),
                       is_dense=True)


def read_cloud(message: PointCloud2) -> np.ndarray:
    """Rows of a `contacts` cloud as a structured array of CLOUD_ROW."""
    return np.frombuffer(bytes(message.data), dtype=CLOUD_ROW)

"""Between messages and numbers: poses in; point, normal and the contacts cloud out.

`TypedMessages` uses rclpy's message objects. `message_bytes.RawMessages` does the same with bytes,
faster. Tests compare the two.
"""
from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, PointStamped, PoseStamped, Vector3, Vector3Stamped
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header

from ..scene.pairing import StampedPose
from ..scene.scene_solver import Answer
from ..solver.checks import pose_fault, shown
from ..solver.contact import Contact

NANOSECONDS = 1_000_000_000

_ROW = [*((name, '<f8') for name in (
    'x', 'y', 'z', 'normal_x', 'normal_y', 'normal_z', 'depth')), ('pair', '<u4')]
CLOUD_ROW = np.dtype(_ROW)
"""One row of the `contacts` cloud: a pair in contact. Of a pair that could not be evaluated all is
NaN but its id. float64, because float32 loses half a metre in UTM coordinates. Depth [m] is
−separation."""
_FIELDS = [
    PointField(name=name, offset=8 * place, count=1,
               datatype=PointField.UINT32 if name == 'pair' else PointField.FLOAT64)
    for place, (name, _) in enumerate(_ROW)]
_NUMBERS = {PointField.UINT32: 'u4', PointField.FLOAT32: 'f4', PointField.FLOAT64: 'f8'}
_NAN = (float('nan'),) * 7


class Refused(ValueError):
    """A message that is not taken; `reason` is what it is counted as."""

    def __init__(self, reason: str, text: str) -> None:
        super().__init__(text)
        self.reason = reason


def checked_pose(numbers: Sequence[float], frame_id: str, sec: int, nanosec: int) -> StampedPose:
    """Return a pose that can be answered, or raise Refused."""
    if nanosec >= NANOSECONDS:
        raise Refused('bad header', f'stamp has {nanosec} nanoseconds, a second or more')
    if '\N{REPLACEMENT CHARACTER}' in frame_id:  # rclpy's word for bytes it cannot decode
        raise Refused('bad header', f'frame_id {shown(frame_id)} is not UTF-8')
    fault = pose_fault(numbers)
    if fault:
        raise Refused('bad pose', fault)
    return StampedPose(np.array(numbers), frame_id, sec * NANOSECONDS + nanosec)


def make_header(stamp: int, frame_id: str) -> Header:
    """Make the header of a stamp [ns]."""
    return Header(stamp=Time(sec=stamp // NANOSECONDS, nanosec=stamp % NANOSECONDS),
                  frame_id=frame_id)


def make_point(header: Header, contact: Contact) -> PointStamped:
    """Make `contact/point`; values are made float, as messages do not check them."""
    x, y, z = map(float, contact.point)
    return PointStamped(header=header, point=Point(x=x, y=y, z=z))


def make_normal(header: Header, contact: Contact) -> Vector3Stamped:
    """Make `contact/normal`."""
    x, y, z = map(float, contact.normal)
    return Vector3Stamped(header=header, vector=Vector3(x=x, y=y, z=z))


def make_cloud(header: Header, answer: Answer) -> PointCloud2:
    """Make `contacts`: a row for each pair in contact, a row of NaN for each stale pair."""
    rows = [(*c.point, *c.normal, -c.separation, pair.id) for pair, c in answer.touching]
    rows += [(*_NAN, pair.id) for pair in answer.stale]
    return PointCloud2(header=header, height=1, width=len(rows), fields=_FIELDS,
                       is_bigendian=False, point_step=CLOUD_ROW.itemsize,
                       row_step=CLOUD_ROW.itemsize * len(rows),
                       data=np.array(rows, dtype=CLOUD_ROW).tobytes(),
                       is_dense=not answer.stale)


def read_cloud(message: PointCloud2) -> np.ndarray:
    """Rows of a `contacts` cloud as a structured array with the fields of CLOUD_ROW.

    Whatever their order, padding and the order of their bytes: as the message says.
    """
    order = '>' if message.is_bigendian else '<'
    layout = np.dtype({
        'names': [field.name for field in message.fields],
        'formats': [order + _NUMBERS[field.datatype] for field in message.fields],
        'offsets': [field.offset for field in message.fields],
        'itemsize': message.point_step})
    return np.frombuffer(bytes(message.data), layout, count=message.width * message.height)


OTHER_SCENE = ('the contacts are those of a scene with other pairs than the default one: not '
               'drawn, only two boxes are')


def is_of_two_boxes(rows: np.ndarray) -> bool:
    """Whether rows of a cloud may be those of the default scene, which has pair 0 alone."""
    return len(rows) <= 1 and not rows['pair'].any()


class TypedMessages:
    """The reference: messages as rclpy's objects."""

    raw = False
    """Whether subscriptions hand over bytes."""

    def read_pose(self, message: PoseStamped) -> StampedPose:
        """Return the pose of a message, or raise Refused."""
        p, q, header = message.pose.position, message.pose.orientation, message.header
        return checked_pose((p.x, p.y, p.z, q.x, q.y, q.z, q.w), header.frame_id,
                            header.stamp.sec, header.stamp.nanosec)

    def begin(self, stamp: int, frame_id: str) -> None:
        """Set stamp [ns] and frame of the messages that follow."""
        self._header = make_header(stamp, frame_id)

    def point(self, contact: Contact) -> PointStamped:
        """Make `contact/point`."""
        return make_point(self._header, contact)

    def normal(self, contact: Contact) -> Vector3Stamped:
        """Make `contact/normal`."""
        return make_normal(self._header, contact)

    def cloud(self, answer: Answer) -> PointCloud2:
        """Make `contacts`."""
        return make_cloud(self._header, answer)

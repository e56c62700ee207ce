# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Between messages and numbers: poses in; point, normal and contacts out.

`TypedMessages` uses rclpy's message objects. `message_bytes.RawMessages` does the same with bytes,
faster. Tests compare the two.

All contacts of a tick are one message: `Contacts` where box_contact_msgs is installed, and a
PointCloud2 for tools that know no other. Both are read as rows of CLOUD_ROW.
"""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from importlib import import_module
from types import MappingProxyType
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import (
    Point,
    PointStamped,
    PoseArray,
    PoseStamped,
    Vector3,
    Vector3Stamped,
    Wrench,
    WrenchStamped,
)
from sensor_msgs.msg import PointCloud2, PointField
from std_msgs.msg import Header

from ..scene.scene_solver import Answer, Scene, id_of
from ..scene.stamp_pairing import StampedPose
from ..solver.checks import pose_fault, shown
from ..solver.contact import Contact, patch_area

_contact_messages: Any = None
with suppress(ImportError):  # a package of its own, which need not be here
    _contact_messages = import_module('box_contact_msgs.msg')
# In a checkout a folder of this name is found, which has no messages.
ContactMessage: Any = getattr(_contact_messages, 'Contact', None)
ContactsMessage: Any = getattr(_contact_messages, 'Contacts', None)
"""Type of `contacts`; None where box_contact_msgs is not installed."""

NANOSECONDS = 1_000_000_000

PATCH_FIELDS = ('volume', 'cov_xx', 'cov_xy', 'cov_xz', 'cov_yy', 'cov_yz', 'cov_zz')
"""Volume [m³] and covariance [m²] of the overlap; NaN from models that give the point alone."""
_ROUNDED = ('x', 'y', 'z')
_POINT = ('point_x', 'point_y', 'point_z')
_NORMAL = ('normal_x', 'normal_y', 'normal_z')
CLOUD_ROW = np.dtype([
    *((name, '<f4') for name in _ROUNDED), ('pair', '<u4'),
    *((name, '<f8') for name in (*_POINT, *_NORMAL, 'depth', *PATCH_FIELDS))])
"""One row of the `contacts_cloud`: a pair in contact, or one that is closer than `margin`. All of a
pair that could not be evaluated is NaN but its id. Depth [m] is −separation. Tools that draw clouds
take x y z as float32. Float32 loses half a metre in UTM coordinates, so the point follows in
float64. New fields come last, so that older ones keep their places."""
_READ = tuple(name for name in CLOUD_ROW.names or () if name not in _ROUNDED)
_OLD_NAMES = dict(zip(_POINT, _ROUNDED))
"""Recordings of before have the point under these names alone, in float64."""
_DATATYPES = {'<f4': PointField.FLOAT32, '<f8': PointField.FLOAT64, '<u4': PointField.UINT32}
_FIELDS = [PointField(name=name, offset=entry[1], datatype=_DATATYPES[entry[0].str], count=1)
           for name, entry in (CLOUD_ROW.fields or {}).items()]
_UPPER = np.triu_indices(3)  # in the order of the fields cov_xx to cov_zz
_BLANK = np.zeros(1, CLOUD_ROW)  # the row of a pair that could not be evaluated
for _name in {*(CLOUD_ROW.names or ())} - {'pair'}:
    _BLANK[_name] = np.nan


FRAME_LIMIT = 255
"""Bytes of a name that the network brings, of a frame or a pair: it could have megabytes."""
MOST_ROWS = 2**15
"""Contacts of a message that are read, unless the scene has more pairs."""

TWO_BOXES = MappingProxyType({'box_a_box_b': 0})
"""Id of the only pair, by its name, where there is no scene file."""


class Refused(ValueError):
    """A message that is not taken; `reason` is what it is counted as."""

    def __init__(self, reason: str, text: str) -> None:
        super().__init__(text)
        self.reason = reason


def check_name(what: str, name: str) -> None:
    """Raise Refused for a name that is longer than FRAME_LIMIT."""
    # A character has at least a byte: what is certainly too long is not encoded.
    if len(name) > FRAME_LIMIT or len(name.encode(errors='replace')) > FRAME_LIMIT:
        raise Refused('bad header' if what == 'frame_id' else 'bad name',
                      f'{what} has more than {FRAME_LIMIT} bytes')


def checked_pose(numbers: Sequence[float], frame_id: str, sec: int, nanosec: int) -> StampedPose:
    """Return a pose that can be answered, or raise Refused."""
    pose = headed(np.array(numbers), frame_id, sec, nanosec)
    fault = pose_fault(numbers)
    if fault:
        raise Refused('bad pose', fault)
    return pose


def headed(numbers: np.ndarray, frame_id: str, sec: int, nanosec: int) -> StampedPose:
    """Return numbers with the stamp and frame of their message, or raise Refused for these."""
    if nanosec >= NANOSECONDS:
        raise Refused('bad header', f'stamp has {nanosec} nanoseconds, a second or more')
    check_name('frame_id', frame_id)
    if '\N{REPLACEMENT CHARACTER}' in frame_id:  # rclpy's word for bytes it cannot decode
        raise Refused('bad header', f'frame_id {shown(frame_id)} is not UTF-8')
    return StampedPose(numbers, frame_id, sec * NANOSECONDS + nanosec)


def make_header(stamp: int, frame_id: str) -> Header:
    """Make the header of a stamp [ns]."""
    return Header(stamp=Time(sec=stamp // NANOSECONDS, nanosec=stamp % NANOSECONDS),
                  frame_id=frame_id)


def make_cloud(header: Header, answer: Answer) -> PointCloud2:
    """Make `contacts_cloud`: a row for each pair in contact or close, NaN for each stale pair."""
    rows = np.repeat(_BLANK, len(answer.listed) + len(answer.stale))
    for row, (pair, c) in zip(rows, answer.listed):
        _fill(row, pair.id, c.point, c.normal, -c.separation, c.volume, c.covariance[_UPPER])
    rows['pair'][len(answer.listed):] = [pair.id for pair in answer.stale]
    _round(rows)
    return PointCloud2(header=header, height=1, width=len(rows), fields=_FIELDS,
                       is_bigendian=False, point_step=CLOUD_ROW.itemsize,
                       row_step=CLOUD_ROW.itemsize * len(rows), data=rows.tobytes(),
                       is_dense=not answer.stale and not answer.close)


def make_contacts(header: Header, answer: Answer) -> Any:
    """Make `contacts` (box_contact_msgs/Contacts): pairs in contact, then close ones, by name."""
    contacts = []
    for pair, c in answer.listed:
        x, y, z = map(float, c.point)
        nx, ny, nz = map(float, c.normal)
        contacts.append(ContactMessage(
            pair=pair.label, box_a=pair.a, box_b=pair.b, point=Point(x=x, y=y, z=z),
            normal=Vector3(x=nx, y=ny, z=nz), depth=-float(c.separation), volume=float(c.volume),
            area=patch_area(c), covariance=c.covariance[_UPPER]))
    return ContactsMessage(header=header, contacts=contacts,
                           stale=[pair.label for pair in answer.stale])


def _fill(row: Any, pair: int, point: Any, normal: Any, depth: float, volume: float,
          upper: Any) -> None:
    """Write the numbers of one contact to a row of CLOUD_ROW, but for `_round`."""
    row['pair'], row['depth'], row['volume'] = pair, depth, volume
    for names, values in ((_POINT, point), (_NORMAL, normal), (PATCH_FIELDS[1:], upper)):
        for name, value in zip(names, values):
            row[name] = value


def _round(rows: np.ndarray) -> None:
    """Write the points of rows as float32, too; what that cannot hold is infinite there."""
    with np.errstate(over='ignore'):
        for rounded, name in zip(_ROUNDED, _POINT):
            rows[rounded] = rows[name]


def read_contacts(message: Any, ids: Mapping[str, int] | None = None) -> np.ndarray:
    """Return a message of contacts as rows (n,) of CLOUD_ROW: `Contacts`, or a PointCloud2.

    ids: id of each pair by its name, `Scene.ids`; that of a pair that is not among them is
    `id_of` its name. Stale pairs are rows of NaN. Raises Refused, as `read_cloud`.
    """
    if isinstance(message, PointCloud2):
        return read_cloud(message, most=len(ids or ()))
    known = ids or {}
    check_name('frame_id', message.header.frame_id)
    _check_rows(len(message.contacts) + len(message.stale), len(known))
    for name in (*(contact.pair for contact in message.contacts), *message.stale):
        if name not in known:
            check_name('pair', name)
    rows = np.repeat(_BLANK, len(message.contacts) + len(message.stale))
    for row, c in zip(rows, message.contacts):
        point, normal = c.point, c.normal
        _fill(row, known.get(c.pair, id_of(c.pair)), (point.x, point.y, point.z),
              (normal.x, normal.y, normal.z), c.depth, c.volume, c.covariance)
    rows['pair'][len(message.contacts):] = [
        known.get(name, id_of(name)) for name in message.stale]
    _round(rows)
    return rows


def _check_rows(count: int, most: int) -> None:
    """Raise Refused for more contacts than a node with `most` pairs may list, or MOST_ROWS."""
    if count > max(most, MOST_ROWS):
        raise Refused('too many contacts', f'{count} contacts in a message are more than '
                                           f'{max(most, MOST_ROWS)}')


def contacts_by_pair(message: Any, ids: Mapping[str, int] = TWO_BOXES) -> dict[str, Contact]:
    """Return the contacts that a message lists, by the names of their pairs, as laws of force hold.

    Numbers are those that the node computed, to the bit. Pairs that are close do not collide; stale
    pairs are left out. ids: as `read_contacts`; a PointCloud2 has no names, so it needs those of
    all its pairs. Raises Refused.
    """
    rows = read_contacts(message, ids)
    if isinstance(message, PointCloud2):
        rows = rows[~np.isnan(rows['depth'])]
        name_of = {number: name for name, number in ids.items()}
        unknown = [number for number in rows['pair'].tolist() if number not in name_of]
        if unknown:
            raise Refused('unknown pair', f'ids have no pair {unknown[0]}: hand over `Scene.ids`')
        names = [name_of[number] for number in rows['pair'].tolist()]
    else:
        names = [contact.pair for contact in message.contacts]
    return {name: _contact(row) for name, row in zip(names, rows)}


def read_answer(message: Any, scene: Scene) -> Answer:
    """Return the answer that a message of contacts tells, as `SceneLaw` holds it.

    scene: that of the node. Stale pairs are left out. Raises Refused, also for a pair that is not
    in the scene.
    """
    pair_of = {pair.label: pair for pair in scene.pairs}
    contacts = contacts_by_pair(message, scene.ids)
    for name in contacts:
        if name not in pair_of:
            raise Refused('unknown pair', f'{shown(name)} is no pair of the scene: read the scene '
                                          'that the node has, as ~/scene tells it')
    listed = [(pair_of[name], contact) for name, contact in contacts.items()]
    return Answer([one for one in listed if one[1].colliding], [], len(listed),
                  [one for one in listed if not one[1].colliding])


def _contact(row: Any) -> Contact:
    """Return the contact of a row of CLOUD_ROW."""
    covariance = np.empty((3, 3))
    covariance[_UPPER] = covariance.T[_UPPER] = [row[name] for name in PATCH_FIELDS[1:]]
    point, normal = (np.array([row[name] for name in names]) for names in (_POINT, _NORMAL))
    return Contact(not np.isnan(point[0]), -float(row['depth']), normal, point,
                   float(row['volume']), covariance)


def read_cloud(message: PointCloud2, *, most: int = 0) -> np.ndarray:
    """Return the rows of a `contacts_cloud` as an array (n,) of CLOUD_ROW.

    most: pairs of the scene, where it is known; a cloud of more rows, and of MOST_ROWS, is refused.

    Fields are found by name, whatever their order, padding and byte order; others are ignored. A
    cloud without any of PATCH_FIELDS, from an older recording, has NaN there. Raises Refused, with
    the field's name, for a field that is missing or of another type.
    """
    check_name('frame_id', message.header.frame_id)
    _check_rows(message.width * message.height, most)
    for field in message.fields:
        check_name('field', field.name)
    layout = _cloud_layout(
        tuple([(field.name, field.offset, field.datatype, field.count)
               for field in message.fields]), message.point_step, message.is_bigendian)
    count = message.width * message.height
    data = bytes(message.data)
    if len(data) < count * message.point_step:
        raise Refused('bad cloud', f'{count} rows of {message.point_step} bytes are more than the '
                                   f'{len(data)} bytes of data')
    read = np.frombuffer(data, layout, count=count)
    rows = np.empty(count, dtype=CLOUD_ROW)
    for name in _READ:
        rows[name] = read[name] if name in (layout.names or ()) else np.nan
    _round(rows)
    return rows


@lru_cache(maxsize=16)
def _cloud_layout(fields: tuple[tuple[str, int, int, int], ...], step: int, big: bool) -> np.dtype:
    """Return where those of CLOUD_ROW's fields are that a cloud has, or raise Refused."""
    found = {name: rest for name, *rest in fields}
    if found.keys().isdisjoint(_POINT):
        found |= {name: found.pop(old) for name, old in _OLD_NAMES.items() if old in found}
    names = [name for name in _READ
             if name not in PATCH_FIELDS or not found.keys().isdisjoint(PATCH_FIELDS)]
    for name in names:
        kind = CLOUD_ROW[name]
        offset, datatype, count = found.get(name, (0, 0, 0))
        if name not in found:
            raise Refused('bad cloud', f'field {name!r} is missing')
        if (datatype, count) != (_DATATYPES[kind.str], 1):
            raise Refused('bad cloud', f'field {name!r} is {count} of datatype {datatype}, not 1 '
                                       f'of {_DATATYPES[kind.str]}')
        if offset + kind.itemsize > step:
            raise Refused('bad cloud', f'field {name!r} ends outside its row of {step} bytes')
    return np.dtype({
        'names': names, 'offsets': [found[name][0] for name in names], 'itemsize': step,
        'formats': [CLOUD_ROW[name].newbyteorder('>' if big else '<') for name in names]})


class TypedMessages:
    """The reference: messages as rclpy's objects."""

    raw = False  # whether subscriptions hand over bytes

    def read_pose(self, message: PoseStamped) -> StampedPose:
        """Return the pose of a message, or raise Refused."""
        p, q, header = message.pose.position, message.pose.orientation, message.header
        return checked_pose((p.x, p.y, p.z, q.x, q.y, q.z, q.w), header.frame_id,
                            header.stamp.sec, header.stamp.nanosec)

    def read_poses(self, message: PoseArray) -> StampedPose:
        """Return all poses of a message, numbers (n, 7) as they are, or raise Refused."""
        numbers = [(p.position.x, p.position.y, p.position.z, p.orientation.x, p.orientation.y,
                    p.orientation.z, p.orientation.w) for p in message.poses]
        header = message.header
        return headed(np.array(numbers, dtype=float).reshape(-1, 7), header.frame_id,
                      header.stamp.sec, header.stamp.nanosec)

    def begin(self, stamp: int, frame_id: str) -> None:
        """Set stamp [ns] and frame of the messages that follow."""
        self._header = make_header(stamp, frame_id)

    def point(self, contact: Contact) -> PointStamped:
        """Make `contact/point`; values are made float, as messages do not check them."""
        x, y, z = map(float, contact.point)
        return PointStamped(header=self._header, point=Point(x=x, y=y, z=z))

    def normal(self, contact: Contact) -> Vector3Stamped:
        """Make `contact/normal`."""
        x, y, z = map(float, contact.normal)
        return Vector3Stamped(header=self._header, vector=Vector3(x=x, y=y, z=z))

    def wrench(self, wrench: np.ndarray) -> WrenchStamped:
        """Make `wrench` of force and torque (6,)."""
        fx, fy, fz, tx, ty, tz = wrench.tolist()
        return WrenchStamped(header=self._header, wrench=Wrench(
            force=Vector3(x=fx, y=fy, z=fz), torque=Vector3(x=tx, y=ty, z=tz)))

    def contacts(self, answer: Answer) -> Any:
        """Make `contacts`."""
        return make_contacts(self._header, answer)

    def cloud(self, answer: Answer) -> PointCloud2:
        """Make `contacts_cloud`."""
        return make_cloud(self._header, answer)

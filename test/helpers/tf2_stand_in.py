# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The part of tf2_ros that the contact node uses, slow and obvious: no interpolation, no limits."""
from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from rclpy.time import Time

from box_contact_ros.scene.pose import quaternion_multiply, rotation_matrix


class TransformException(Exception):
    """The base of all."""


class LookupException(TransformException):
    """A frame that was never heard of."""


class ExtrapolationException(TransformException):
    """A transform that is not known at the time that is asked for."""


class BufferCore:
    """Transforms by child frame; a static one is known at all times."""

    def __init__(self) -> None:
        self.parent_of: dict[str, str] = {}
        self.moving: dict[str, dict[int, np.ndarray]] = {}  # poses in the parent by stamp [ns]
        self.static: dict[str, np.ndarray] = {}

    def set_transform(self, transform: Any, _: str) -> None:
        child, numbers, stamp = self._taken(transform)
        if numbers @ numbers > 0.0:  # as tf2, which logs NaN and zeros
            self.static.pop(child, None)
            self.moving.setdefault(child, {}).setdefault(stamp, numbers)

    def set_transform_static(self, transform: Any, _: str) -> None:
        child, numbers, _stamp = self._taken(transform)
        self.moving.pop(child, None)
        self.static[child] = numbers

    def _taken(self, transform: Any) -> tuple[str, np.ndarray, int]:
        header, child = transform.header, transform.child_frame_id
        t, q = transform.transform.translation, transform.transform.rotation
        self.parent_of[child] = header.frame_id
        return (child, np.array([t.x, t.y, t.z, q.x, q.y, q.z, q.w]),
                header.stamp.sec * 10**9 + header.stamp.nanosec)

    def clear(self) -> None:
        self.moving.clear()

    def _chain(self, target: str, source: str) -> list[str]:
        """Return the frames from the source up to below the target, which is above it here."""
        for name in (target, source):
            if name not in self.parent_of and name not in self.parent_of.values():
                raise LookupException(name)
        chain = []
        while source != target:
            if source not in self.static and not self.moving.get(source):
                raise TransformException('not connected')
            chain.append(source)
            source = self.parent_of[source]
        return chain

    def get_latest_common_time(self, target: str, source: str) -> Time:
        times = [max(self.moving[frame]) for frame in self._chain(target, source)
                 if frame in self.moving]
        return Time(nanoseconds=min(times, default=0))

    def lookup_transform_core(self, target: str, source: str, time: Time) -> TransformStamped:
        pose = np.array([0.0, 0, 0, 0, 0, 0, 1])
        for frame in self._chain(target, source):
            known = self.moving.get(frame)
            if known is not None and time.nanoseconds not in known:
                raise ExtrapolationException(frame)
            link = self.static[frame] if known is None else known[time.nanoseconds]
            pose = np.concatenate([link[:3] + rotation_matrix(link[3:]) @ pose[:3],
                                   quaternion_multiply(link[3:], pose[3:])])
        x, y, z, qx, qy, qz, qw = map(float, pose)
        return TransformStamped(transform=Transform(
            translation=Vector3(x=x, y=y, z=z), rotation=Quaternion(x=qx, y=qy, z=qz, w=qw)))


MODULE = SimpleNamespace(
    BufferCore=BufferCore, TransformException=TransformException, LookupException=LookupException,
    ExtrapolationException=ExtrapolationException)
"""In place of the module tf2_ros."""

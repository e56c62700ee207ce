# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Poses of boxes that are frames in /tf and /tf_static.

The only module that knows tf2. It is imported when a scene has such a box, and may be missing.
"""
from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any

import numpy as np
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from ...scene.scene_solver import Fault, Scene
from ...scene.stamp_pairing import NEVER, RESET, StampedPose
from ...solver.checks import shown
from ..messages import NANOSECONDS, check_name
from ..rclpy_workarounds import silence
from ..runtime import LOG_SECONDS, POSE_QOS

TF, TF_STATIC = '/tf', '/tf_static'
STATIC_QOS = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE,
                        durability=DurabilityPolicy.TRANSIENT_LOCAL)
LOOKUPS = 'lookups in /tf failed'
UNSTAMPED = 'refused: transform without a stamp'
BAD = 'refused: bad transform'
MOST_FRAMES = 10_000
"""Frames of /tf that are kept; tf2 never forgets one, and each may be a stranger's."""
REMEDY = 'apt install ros-jazzy-tf2-ros-py, or give the box a pose_topic'


def tf_message() -> Any:
    """Return the type of the messages on /tf; None where tf2_msgs is not installed."""
    try:
        return import_module('tf2_msgs.msg').TFMessage
    except ImportError:
        return None


def has_tf2() -> bool:
    """Return whether all is installed that a frame needs."""
    try:
        import_module('tf2_ros')
    except ImportError:
        return False
    return tf_message() is not None


def check_frames(scene: Scene) -> None:
    """Raise Fault for a scene that needs tf2 where it is not installed."""
    if scene.frames and not has_tf2():
        raise Fault(('boxes', next(iter(scene.frames)), 'frame'),
                    f'tf2_ros is not installed here: {REMEDY}')


class TfPoses:
    """Listens to /tf while a scene needs it, and hands on the poses of the scene's frames.

    A box is looked up at the newest time that all transforms of its chain have. Its pose is handed
    on once for each such time, after each message. A chain of static transforms alone gives a pose
    of all times: its stamp is NEVER.
    """

    def __init__(self, node: Node, counts: Counter[str]) -> None:
        """Begin without frames."""
        self._node, self._counts = node, counts
        self._subscriptions: list[Subscription] = []
        self._frame_id, self._frames = '', dict[str, str]()
        self._callbacks: Mapping[str, Callable[[StampedPose], None]] = {}
        self._forget()

    def _forget(self) -> None:
        self._tf2: Any = None  # the module
        self._buffer: Any = None
        self._newest: dict[str, int] = {}  # stamps of all frames, NEVER for one that has none [ns]
        self._unstamped: set[str] = set()  # frames that came without a stamp
        self._given: dict[str, int] = {}  # stamps of the last poses that were handed on, by box
        self._faults: dict[str, Exception] = {}  # why the last lookup failed, by box

    def listen(self, frame_id: str, frames: Mapping[str, str],
               callback_of: Callable[[str, str], Callable[[StampedPose], None]]) -> None:
        """Listen for frames by box, from now on; `look_up` hands on what is known of them already.

        callback_of: what takes the poses of a box, by its name and by how log lines call it.
        """
        if not frames:
            self.close()
            return
        self._given = {box: stamp for box, stamp in self._given.items()
                       if stamp != NEVER and frame_id == self._frame_id
                       and frames.get(box) == self._frames.get(box)}
        self._faults.clear()
        self._frame_id, self._frames = frame_id, dict(frames)
        self._callbacks = {box: callback_of(box, f'frame {shown(frame)}')
                           for box, frame in frames.items()}
        if not self._subscriptions:
            self._tf2 = import_module('tf2_ros')
            self._buffer = self._tf2.BufferCore()
            for topic, callback, qos in ((TF_STATIC, self._on_static, STATIC_QOS),
                                         (TF, self._on_moving, POSE_QOS)):
                self._subscriptions.append(self._node.create_subscription(
                    tf_message(), topic, callback, qos, event_callbacks=SubscriptionEventCallbacks(
                        use_default_callbacks=False)))

    def close(self) -> None:
        """Listen no more, and forget all transforms."""
        for subscription in self._subscriptions:
            silence(subscription)
            self._node.destroy_subscription(subscription)
        self._subscriptions.clear()
        self._frames, self._callbacks = {}, {}
        self._forget()

    def topics(self) -> list[str]:
        """Return the full names of the topics that are subscribed to."""
        return [subscription.topic_name for subscription in self._subscriptions]

    def why_silent(self, box: str) -> str:
        """Return why a box has given no pose, and what to do."""
        frame = self._frames[box]
        if not self._newest:
            there = sum(map(self._node.count_publishers, (TF, TF_STATIC)))
            return (f'{TF} and {TF_STATIC} have {there} publishers, silent so far' if there else
                    f'nobody publishes {TF} or {TF_STATIC}')
        for name in (frame, self._frame_id):
            if name not in self._newest and name not in self._unstamped:
                return (f'frame {shown(name)} is in no transform: is the name right, and does its '
                        'broadcaster run?')
        for name in self._unstamped - self._newest.keys():
            return (f'transforms of {shown(name)} on {TF} have stamp 0: set header.stamp, or use '
                    f'{TF_STATIC}')
        fault = self._faults.get(box)
        if isinstance(fault, self._tf2.ExtrapolationException):
            return (f'the transforms between frame {shown(frame)} and {shown(self._frame_id)} have '
                    'no time in common: do their broadcasters stamp by the same clock?')
        if not isinstance(fault, self._tf2.TransformException):
            return f'the lookup of frame {shown(frame)} failed: {fault!r}'
        return (f'frame {shown(frame)} is not connected to {shown(self._frame_id)}: publish the '
                'transforms between them')

    def look_up(self) -> None:
        """Hand on the poses that are new."""
        for box, frame in list(self._frames.items()):
            try:
                time = self._buffer.get_latest_common_time(self._frame_id, frame)
                stamp = time.nanoseconds or NEVER
                if stamp == self._given.get(box):
                    continue
                found = self._buffer.lookup_transform_core(self._frame_id, frame, time).transform
            except Exception as error:  # of tf2, as a rule; no callback may let one out
                self._faults[box] = error
                self._counts[LOOKUPS] += 1
                continue
            self._given[box] = stamp
            self._faults.pop(box, None)
            p, q = found.translation, found.rotation
            self._callbacks[box](StampedPose(np.array((p.x, p.y, p.z, q.x, q.y, q.z, q.w)),
                                             self._frame_id, stamp))

    def _on_static(self, message: Any) -> None:
        for transform in filter(self._is_taken, message.transforms):
            self._set(self._buffer.set_transform_static, transform, NEVER)
        # What was static may have another value now.
        self._given = {box: stamp for box, stamp in self._given.items() if stamp != NEVER}
        self.look_up()

    def _on_moving(self, message: Any) -> None:
        for transform in filter(self._is_taken, message.transforms):
            stamp, name = transform.header.stamp, _name(transform.child_frame_id)
            at = stamp.sec * NANOSECONDS + stamp.nanosec
            if not at:  # its common time would say that the chain is static
                self._unstamped.add(name)
                self._newest.setdefault(_name(transform.header.frame_id), NEVER)
                self._counts[UNSTAMPED] += 1
                continue
            if at < self._newest.get(name, NEVER) - RESET:
                # Time was set back: tf2 would wait until it has caught up.
                self._buffer.clear()
                self._newest = dict.fromkeys(self._newest, NEVER)
                self._given = {box: at for box, at in self._given.items() if at == NEVER}
            self._set(self._buffer.set_transform, transform, at)
        self.look_up()

    def _is_taken(self, transform: Any) -> bool:
        """Return whether a transform's names may be kept; else it is counted and logged."""
        names = transform.header.frame_id, transform.child_frame_id
        try:
            for name in names:
                check_name('frame_id', name)
            new = {*map(_name, names)} - self._newest.keys() - self._unstamped
            if new and len(self._newest) + len(self._unstamped) + len(new) > MOST_FRAMES:
                raise ValueError(f'{MOST_FRAMES} frames are known, and no more are taken')
        except ValueError as error:
            self._refuse(error)
            return False
        return True

    def _refuse(self, error: Exception) -> None:
        self._counts[BAD] += 1
        self._node.get_logger().warning(f'{TF}: {error}; ignored',
                                        throttle_duration_sec=LOG_SECONDS)

    def _set(self, setter: Callable[[Any, str], None], transform: Any, stamp: int) -> None:
        """Give a transform to tf2; what it refuses is counted and logged."""
        try:
            setter(transform, 'box_contact_ros')
        except Exception as error:
            self._refuse(error)
            return
        self._newest.setdefault(_name(transform.header.frame_id), NEVER)
        name = _name(transform.child_frame_id)
        self._newest[name] = max(stamp, self._newest.get(name, NEVER))


def _name(frame: str) -> str:
    """Return the name that tf2 keeps."""
    return frame.removeprefix('/')

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Records poses and contacts of running nodes, as a rosbag2 bag with MCAP storage.

`--out RUN` is a new folder with metadata.yaml and RUN.mcap: `view --replay RUN` and `ros2 bag play
RUN` play it, Foxglove opens RUN/RUN.mcap, `bench --replay RUN` drives the nodes with it. Ctrl-C or
SIGTERM ends the recording, and completes the bag. Messages are kept as the bytes that they came as.
"""
from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

from geometry_msgs.msg import PointStamped, PoseArray, PoseStamped, Vector3Stamped
from rclpy.context import Context
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import MarkerArray

from ...node.messages import ContactsMessage
from ...node.parameters import outside_ros_args
from ...node.ros_client import DEEP_RELIABLE, pose_topics, read_scene_text
from ...node.runtime import ARRAY_QOS, POSE_QOS, GuardedNode, refusals_end, run_node
from ...node.topics.tf_poses import STATIC_QOS, TF, TF_STATIC, tf_message
from ...solver.arguments import program_parser
from ...solver.checks import as_size
from .bag_file import (
    ALL_CONTACTS,
    CONTACTS,
    DRAWN,
    NANOSECONDS,
    TOPICS,
    TRANSFORMS,
    TYPES,
    Recorder,
    RecordingError,
    type_of,
)

MESSAGES = dict(zip(TYPES.values(), (PoseStamped, PoseArray, PointStamped, Vector3Stamped,
                                     ContactsMessage, PointCloud2, MarkerArray)))
TYPE_OF = {message: kind for kind, message in MESSAGES.items()}
QOS = {PoseStamped: POSE_QOS, PoseArray: ARRAY_QOS}
"""Poses as the contact node takes them, from whatever publisher; all others without loss."""
OF_FRAMES = {TF: POSE_QOS, TF_STATIC: STATIC_QOS}
"""What is recorded of a scene that has boxes with frames."""
PROGRESS_SECONDS = 1.0


class RecordNode(GuardedNode):
    """Hands every message of its topics to a `Recorder`; ends where that cannot write any more."""

    def __init__(self, context: Context, folder: Path, topics: Sequence[str],
                 about: Mapping[str, Any],
                 kinds: Mapping[str, str] = MappingProxyType({})) -> None:
        super().__init__('record', context=context)
        resolved = {self.resolve_topic_name(topic): topic for topic in topics}
        kinds = {name: kinds[topic] for name, topic in resolved.items() if topic in kinds}
        self.folder, self.recorder = folder, Recorder(
            folder, list(resolved), {**about, 'topics': resolved}, kinds)
        self._fault: Exception | None = None
        for name, topic in resolved.items():
            kind = self.recorder.kinds[name]
            message = tf_message() if kind == TRANSFORMS else MESSAGES[kind]
            self.create_subscription(
                message, topic, partial(self._keep, name),
                OF_FRAMES.get(topic) or QOS.get(message, DEEP_RELIABLE), raw=True)
        if sys.stderr.isatty():
            self.create_timer(PROGRESS_SECONDS, self._show_progress)
        print(f'recording to {folder}: {", ".join(resolved)}', flush=True)

    def _keep(self, topic: str, data: bytes) -> None:
        if not self.recorder.counts[topic]:
            print(f'receiving {topic}', flush=True)
        try:
            self.recorder.write(topic, self.get_clock().now().nanoseconds, data)
        except Exception as error:  # a full disk: what follows cannot be kept either
            self._fault = error
            self.context.try_shutdown()

    def _show_progress(self) -> None:
        print(f'\r{self.recorder.counts.total()} messages in {self._seconds():.0f} s ', end='',
              file=sys.stderr, flush=True)

    def _seconds(self) -> float:
        first, last = self.recorder.span or (0, 0)
        return (last - first) / NANOSECONDS

    def destroy_node(self) -> None:
        """Complete the bag, and print what is in it; RecordingError if it cannot be completed."""
        super().destroy_node()
        try:
            if self._fault is not None:
                raise self._fault
            self.recorder.close()
        except Exception as error:
            raise RecordingError(f'the recording {self.folder} is not complete: {error}') from error
        print(f'\nrecorded {self.folder}: {self.recorder.counts.total()} messages in '
              f'{self._seconds():.2f} s')
        for topic, count in self.recorder.counts.items():
            print(f'  {topic} {count}', flush=True)


@refusals_end
def main(args: Sequence[str] | None = None) -> int:
    """Record until SIGINT or SIGTERM."""
    args = list(args or ())
    return run_node(node_of(outside_ros_args(args)), args)


def node_of(args: Sequence[str]) -> Callable[[Context], RecordNode]:
    """Return what makes the node that the program's arguments ask for."""
    options = _options(args)
    about = {name: value for name in ('size_a', 'size_b', 'model')
             if (value := getattr(options, name)) is not None}
    topics, kinds = options.topics, {}
    if options.scene is not None:
        about['scene'], scene = read_scene_text(options.scene)
        kinds = {topic.name: TYPE_OF[topic.kind] for topic in pose_topics(scene)}
        if scene.frames and tf_message() is not None:
            kinds |= dict.fromkeys(OF_FRAMES, TRANSFORMS)
        elif scene.frames:
            print(f'not recorded, as tf2_msgs is not installed here: {", ".join(OF_FRAMES)}',
                  file=sys.stderr)
        topics = topics or [*kinds, *ALL_CONTACTS, *DRAWN]
    topics = topics or [*TOPICS, *DRAWN]
    if ContactsMessage is None:
        if 'contacts' in options.topics:
            raise RecordingError(f'contacts is {CONTACTS}, whose package is not installed here: '
                                 'record contacts_cloud')
        topics = [topic for topic in topics if topic != 'contacts']
    return partial(RecordNode, folder=options.out, about=about, kinds=kinds, topics=topics)


def _options(args: Sequence[str]) -> argparse.Namespace:
    parser = program_parser(
        'record', __doc__,
        epilog='Topics are remapped as those of any node: --ros-args -r box_a/pose:=/crane/pose')
    parser.add_argument('--out', type=Path, required=True, metavar='RUN',
                        help='folder of the bag; never overwritten')
    parser.add_argument('--topics', nargs='+', default=[], metavar='NAME',
                        help='what is recorded; a name says the type by its end: '
                             f'{", ".join(TYPES)} (default: {" ".join((*TOPICS, *DRAWN))}; of a '
                             'scene the poses of all moving boxes, contacts, and markers)')
    parser.add_argument('--scene', metavar='NAME',
                        help='the scene that is recorded, kept in the bag: a file, or the bare '
                             'name of one in config/scenes/')
    for name in 'ab':
        parser.add_argument(f'--size-{name}', type=float, nargs=3, metavar=('X', 'Y', 'Z'),
                            help=f'full extents of box {name.upper()} [m], kept in the bag for '
                                 'bench --replay: no message carries them')
    parser.add_argument('--model', help='the model that gives the contacts, kept in the bag')
    options = parser.parse_args(list(args))
    if options.scene is not None and (options.size_a or options.size_b):
        parser.error('--size-a and --size-b are of two boxes, and --scene says all sizes')
    try:
        for topic in options.topics if options.scene is None else ():
            type_of(topic)
        for name in ('size_a', 'size_b'):
            if getattr(options, name) is not None:
                as_size(getattr(options, name), f'--{name.replace("_", "-")}')
    except ValueError as error:
        parser.error(str(error))
    return options

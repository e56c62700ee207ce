# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Moves all boxes of a scene, so that there is something to see: no physics, no contacts.

`python -m box_contact_ros.view.scene_driver --scene yard_bay` publishes their poses. A box
with fixed partners is set down on one after the other. A box with moving partners rides on one of
them, and is lifted off now and then. All others stand on the ground.
"""
from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence

import numpy as np
from rclpy.context import Context

from ..node.messages import make_header
from ..node.parameters import outside_ros_args
from ..node.ros_client import array_message, pose_message, pose_topics
from ..node.runtime import CONTACT_QOS, GuardedNode, refusals_end, run_node
from ..scene.files.scene_file import read_scene
from ..scene.pose import quaternion_multiply, rotation_matrix
from ..scene.scene_solver import Box, Scene
from ..solver.arguments import program_parser, within
from ..solver.contact_solver import ContactSolver

VISIT = 8.0  # time [s] from one partner to the next
DOWN, UP = (0.30, 0.45), (0.75, 0.90)
"""Shares of a visit between which a box is lowered, and lifted."""
CLEARANCE = 1.2  # height [m] above the highest partner, on the way
DEPTH = 0.012  # depth to which a box is set down [m]
LIFT = 0.3  # height to which a rider is lifted off [m]
TIERS = 5  # boxes that ride on each other, at most
TILT = math.radians(0.3)
GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0  # phases of boxes are its multiples: no two are the same

Motion = Callable[[float], np.ndarray]  # from the time [s] to a pose (7,)


def motions(scene: Scene) -> dict[str, Motion]:
    """Return the motion of each moving box."""
    found: dict[str, Motion] = {}
    tier_of: dict[str, int] = {}  # of boxes that can carry one more
    pitch = 1.2 * max(max(box.size[:2]) for box in scene.boxes.values())
    columns = math.ceil(math.sqrt(len(scene.moving)))
    partners: dict[str, list[str]] = {name: [] for name in scene.boxes}
    for pair in scene.pairs:
        partners[pair.a].append(pair.b)
        partners[pair.b].append(pair.a)
    # What a box rides on has to move before it: boxes b come after boxes a in most scenes.
    for number, name in enumerate(reversed(scene.moving)):
        size, phase = scene.boxes[name].size, GOLDEN * number
        fixed = [scene.boxes[other] for other in partners[name] if scene.boxes[other].pose]
        free = [other for other in partners[name] if other in tier_of]
        if free:
            below = free[-1]
            tier = tier_of.pop(below) + 1  # it carries no second box
            if tier < TIERS - 1:
                tier_of[name] = tier
            height = 0.5 * (size[2] + scene.boxes[below].size[2])
            found[name] = _riding(found[below], height, phase)
        elif fixed:
            tier_of[name] = 0
            found[name] = _visiting(_free_places(fixed, size), phase, 0.1 * size[1])
        else:
            tier_of[name] = 0
            row, column = divmod(number, columns)
            found[name] = _standing(pitch * column, pitch * row, 0.5 * size[2])
    return found


def _free_places(fixed: Sequence[Box], size: Sequence[float]) -> np.ndarray:
    """Return the centres (n, 3) of a box on fixed ones, but for those that others cover."""
    count = len(fixed)
    below, sizes = np.array([box.pose for box in fixed]), np.array([box.size for box in fixed])
    heights = np.sum(np.abs(rotation_matrix(below[:, 3:])[:, 2]) * sizes, axis=1)
    places = below[:, :3].copy()
    places[:, 2] += 0.5 * (heights + size[2])
    level = np.hstack([places, np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))])
    found = ContactSolver(size, size, model='exact').batch(
        np.repeat(level, count, axis=0), np.tile(below, (count, 1)),
        size_b=np.tile(sizes, (count, 1)))
    free = (found.separation > -DEPTH).reshape(count, count).all(axis=1)
    return places[free] if free.any() else places


def _standing(x: float, y: float, z: float) -> Motion:
    pose = np.array([x, y, z, 0.0, 0.0, 0.0, 1.0])
    return lambda _: pose


def _riding(below: Motion, height: float, phase: float) -> Motion:
    def motion(time: float) -> np.ndarray:
        pose = below(time).copy()
        gap = LIFT * max(0.0, math.sin(2.0 * math.pi * (time / VISIT + phase))) - DEPTH
        pose[:3] += rotation_matrix(pose[3:]) @ [0.0, 0.0, height + gap]
        return pose
    return motion


def _visiting(places: np.ndarray, phase: float, sway: float) -> Motion:
    """Return a motion over places (n, 3), from one to the next, with a little sway and tilt."""
    high = float(places[:, 2].max()) + CLEARANCE

    def motion(time: float) -> np.ndarray:
        visit, share = divmod(time / VISIT + phase, 1.0)
        here, last = (places[(int(visit) - back) % len(places)] for back in (0, 1))
        at = last + _ramp(share / DOWN[0]) * (here - last)
        lowered = (_ramp((share - DOWN[0]) / (DOWN[1] - DOWN[0]))
                   - _ramp((share - UP[0]) / (UP[1] - UP[0])))
        angle = 2.0 * math.pi * (2.0 * time / VISIT + phase)
        at[:2] += sway * math.sin(0.5 * angle), sway * math.cos(0.5 * angle)
        at[2] = high + lowered * (here[2] - DEPTH - high)
        roll, pitch = TILT * math.sin(angle), 0.3 * TILT * math.cos(angle)
        turn = quaternion_multiply(np.array([0.5 * roll, 0.0, 0.0, 1.0]),
                                   np.array([0.0, 0.5 * pitch, 0.0, 1.0]))
        return np.concatenate([at, turn / np.linalg.norm(turn)])
    return motion


def _ramp(share: float) -> float:
    share = min(max(share, 0.0), 1.0)
    return share * share * (3.0 - 2.0 * share)


class SceneDriver(GuardedNode):
    """Publishes a pose of every moving box at a rate: under one stamp, or as one message."""

    def __init__(self, context: Context, scene: Scene, rate: float) -> None:
        super().__init__('scene_driver', context=context)
        if scene.frames:
            raise ValueError(f'boxes with a frame cannot be driven: {", ".join(scene.frames)}')
        self._scene, self._motions = scene, motions(scene)
        self._publishers = [self.create_publisher(topic.kind, topic.name, CONTACT_QOS)
                            for topic in pose_topics(scene)]
        self._start = self.get_clock().now().nanoseconds
        self.create_timer(1.0 / rate, self._publish)
        self.get_logger().info(f'ready: {len(scene.moving)} boxes at {rate:g} Hz')

    def _publish(self) -> None:
        stamp = self.get_clock().now().nanoseconds
        header = make_header(stamp, self._scene.frame_id or 'world')
        time = 1e-9 * (stamp - self._start)
        poses = [self._motions[name](time) for name in self._scene.moving]
        messages = ([array_message(header, poses)] if self._scene.pose_array else
                    [pose_message(header, pose) for pose in poses])
        for publisher, message in zip(self._publishers, messages, strict=True):
            publisher.publish(message)


@refusals_end
def main(args: Sequence[str] | None = None) -> int:
    """Publish until SIGINT or SIGTERM."""
    args = list(sys.argv[1:] if args is None else args)
    parser = program_parser('scene_driver', __doc__)
    parser.add_argument('--scene', required=True, metavar='NAME', help='bare name, or a path')
    parser.add_argument('--rate', type=within(0.1, 1000.0), default=50.0, metavar='HZ',
                        help='ticks a second (default: %(default)g)')
    options = parser.parse_args(outside_ros_args(args))
    scene = read_scene(options.scene)
    return run_node(lambda context: SceneDriver(context, scene, options.rate), args)


if __name__ == '__main__':
    sys.exit(main())

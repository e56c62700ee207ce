# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A load over a yard, answered by several nodes, each with its share of the pairs.

`python shared_scene.py SCENE NODES TICKS`: plays the load's poses at 200 Hz, and holds the rows of
all nodes together against what the whole scene gives here. Exit status 0 if all are there, and
the same. For test_two_hosts.py, where it runs on one of the hosts.
"""
from __future__ import annotations

import sys
import time
from collections import defaultdict
from typing import Any

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from rclpy.qos import QoSProfile

from box_contact_ros.demo.answer_log import first_row
from box_contact_ros.demo.ros_client import ANSWERS
from box_contact_ros.node.messages import make_header, read_contacts
from box_contact_ros.node.runtime import make_executor
from box_contact_ros.scene.files.scene_file import read_scene
from box_contact_ros.scene.scene_solver import SceneSolver

PERIOD = 0.005
PATIENCE = 60.0
SAME = 1e-9
"""Of a coordinate [m], as another node may have it."""


def main(path: str, nodes: int, ticks: int) -> int:
    """Play, listen, compare."""
    scene = read_scene(path)
    solver = SceneSolver(scene)
    context = rclpy.Context()
    rclpy.init(context=context)
    node = Node('listener', context=context)
    executor = make_executor(context)
    executor.add_node(node)
    clouds: dict[int, list[np.ndarray]] = defaultdict(list)

    def keep(message: Any) -> None:
        stamp = message.header.stamp
        clouds[stamp.sec * 10**9 + stamp.nanosec].append(read_contacts(message, scene.ids))

    node.create_subscription(*ANSWERS['cloud'], keep, QoSProfile(depth=1000))
    publisher = node.create_publisher(PoseStamped, 'load/pose', QoSProfile(depth=1000))

    def send(pose: np.ndarray) -> int:
        stamp = time.time_ns()
        message = PoseStamped(header=make_header(stamp, 'map'))
        p, q = message.pose.position, message.pose.orientation
        p.x, p.y, p.z, q.x, q.y, q.z, q.w = map(float, pose)
        publisher.publish(message)
        until = time.monotonic() + PERIOD
        while (left := until - time.monotonic()) > 0.0:
            executor.spin_once(timeout_sec=left)
        return stamp

    # 10 mm into the tops of the stacks, along and across them: on up to four at a time.
    way = np.linspace(0.0, 1.0, ticks)
    load = np.tile([0.0, 0, 4.5 * 2.591 + 0.5 * 2.591 - 0.01, 0, 0, 0, 1], (ticks, 1))
    load[:, 0], load[:, 1] = 20.0 + 60.0 * way, 5.0 + 40.0 * way
    deadline = time.monotonic() + PATIENCE
    while len(clouds[send(load[0])]) < nodes and time.monotonic() < deadline:
        pass
    sent = [(send(pose), pose) for pose in load]
    end = time.monotonic() + 5.0
    while any(len(clouds[stamp]) < nodes for stamp, _ in sent) and time.monotonic() < end:
        executor.spin_once(timeout_sec=0.05)
    executor.shutdown()
    node.destroy_node()
    context.try_shutdown()

    lost = sum(len(clouds[stamp]) < nodes for stamp, _ in sent)
    wrong = contacts = most = 0
    for stamp, pose in sent:
        found = {int(rows[n]['pair']): first_row(rows[n:])
                 for rows in clouds[stamp] for n in range(len(rows))}
        wanted = {pair.id: contact for pair, contact in solver([pose]).touching}
        contacts, most = contacts + len(wanted), max(most, len(wanted))
        wrong += found.keys() != wanted.keys() or any(
            not np.allclose(found[key][:7], [*c.point, *c.normal, -c.separation], rtol=0,
                            atol=SAME) for key, c in wanted.items())
    print(f'{ticks} ticks, {lost} lost, {wrong} wrong, {contacts} contacts, up to {most} at a time')
    return 0 if not lost and not wrong and most >= 4 else 1


if __name__ == '__main__':
    sys.exit(main(sys.argv[1], *map(int, sys.argv[2:4])))

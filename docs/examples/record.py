# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Record the poses and contacts of two boxes as MCAP: `python docs/examples/record.py FOLDER`.

It records until Ctrl-C. `ros2 bag play FOLDER` plays the folder, Foxglove opens the .mcap file in
it. Needs the extras `ros` and `bag`.

It prints:

    5 of /box_a/pose
    5 of /box_b/pose
    5 of /contacts
"""
import argparse
from functools import partial
from pathlib import Path

from box_contact_ros.extras import require

require('ros', 'bag')  # what is missing is named in one line
import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.executors import ExternalShutdownException
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from box_contact_msgs.msg import Contacts

TOPICS = {'/box_a/pose': (PoseStamped, 'geometry_msgs/msg/PoseStamped'),
          '/box_b/pose': (PoseStamped, 'geometry_msgs/msg/PoseStamped'),
          '/contacts': (Contacts, 'box_contact_msgs/msg/Contacts')}
MESSAGES = Path(__file__).parents[2] / 'box_contact_msgs' / 'msg'
QOS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)


def main(folder: str) -> None:
    """Write messages as the bytes that they came as, until Ctrl-C."""
    types = get_typestore(Stores.ROS2_JAZZY)
    for file in MESSAGES.glob('*.msg'):
        types.register(get_types_from_msg(file.read_text(), f'box_contact_msgs/msg/{file.stem}'))
    rclpy.init()
    node = rclpy.create_node('record')
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        def write(connection, data):
            if not writer.counts[connection.id]:
                node.get_logger().info(f'hears {connection.topic}')
            writer.write(connection, node.get_clock().now().nanoseconds, data)

        for topic, (message, name) in TOPICS.items():
            connection = writer.add_connection(topic, name, typestore=types)
            node.create_subscription(message, topic, partial(write, connection), QOS, raw=True)
        node.get_logger().info('recording')
        try:
            rclpy.spin(node)
        except (KeyboardInterrupt, ExternalShutdownException):
            pass
    for connection in writer.connections:
        print(f'{writer.counts[connection.id]} of {connection.topic}')


if __name__ == '__main__':
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('folder', metavar='FOLDER', help='a new folder')
    main(parser.parse_args().folder)

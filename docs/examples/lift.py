# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Lift a container from the yard to a lorry: `python docs/examples/lift.py`.

Start a node first, whose scene gets its poses as one message:

    box_contact_contact_node --ros-args -p scene:=config/scenes/lift.yaml -p pair_topics:=false

It prints:

    scene 0: spreader_c1
    scene 1: spreader_c1
    scene 1: spreader_c1, c1_lorry
    scene 2: spreader_c1
"""
import rclpy
from geometry_msgs.msg import Point, Pose, PoseArray

from box_contact_msgs.msg import Box, Contacts
from box_contact_msgs.srv import SetBoxes

rclpy.init()
node = rclpy.create_node('lift')
change = node.create_client(SetBoxes, 'contact_node/set_boxes')
poses = node.create_publisher(PoseArray, 'poses', 10)
answers: list[Contacts] = []
node.create_subscription(Contacts, 'contacts', answers.append, 10)


def set_boxes(**boxes: list[Box]) -> int:
    """Change boxes of the scene; return the number of the new scene."""
    future = change.call_async(SetBoxes.Request(**boxes))
    rclpy.spin_until_future_complete(node, future)
    return int(future.result().revision)


def show(revision: int, *places: tuple[float, float]) -> None:
    """Send y and z of all that moves until a scene has answered; print what touches."""
    array, sent = PoseArray(poses=[Pose(position=Point(y=y, z=z)) for y, z in places]), []
    while not (answers and answers[-1].header.stamp in sent and answers[-1].revision == revision):
        array.header.stamp = node.get_clock().now().to_msg()
        sent.append(array.header.stamp)
        poses.publish(array)
        rclpy.spin_once(node, timeout_sec=0.1)
    print(f'scene {revision}:', ', '.join(contact.pair for contact in answers[-1].contacts))


change.wait_for_service()
show(0, (0.0, 2.79))  # the spreader is on the container
lifted = set_boxes(moving=[Box(name='c1')])  # of its size, and after the spreader in the array
show(lifted, (3.0, 6.79), (3.0, 5.2955))
show(lifted, (6.0, 4.29), (6.0, 2.7955))  # on the lorry
landed = set_boxes(fixed=[Box(name='c1', pose=Pose(position=Point(y=6.0, z=2.7955)))])
show(landed, (6.0, 4.29), (0.0, 0.0))  # its place in the array stays, and is not read
rclpy.shutdown()

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Lift a container from the yard to a lorry: `python docs/examples/lift.py`.

Start a node first, whose scene gets its poses by name:

    box_contact_contact_node --ros-args -p scene:=config/scenes/lift.yaml -p pair_topics:=false

It prints:

    on the ground: spreader_frame_c1
    lifted: nothing
    on the lorry: c1_lorry
    detached: spreader_frame_c1
"""
from box_contact_ros.extras import require

require('ros')  # what is missing is named in one line
import rclpy
from geometry_msgs.msg import Point, Pose, Transform, Vector3
from rclpy.qos import QoSProfile
from sensor_msgs.msg import MultiDOFJointState

from box_contact_msgs.msg import Body, Box, Contacts
from box_contact_msgs.srv import SetBoxes

rclpy.init()
node = rclpy.create_node('lift')
change = node.create_client(SetBoxes, 'contact_node/set_boxes', qos_profile=QoSProfile(depth=128))
poses = node.create_publisher(MultiDOFJointState, 'poses', 10)
answers: list[Contacts] = []
node.create_subscription(Contacts, 'contacts', answers.append, 10)


def set_boxes(**changes: list[Box] | list[Body]) -> SetBoxes.Response:
    """Change boxes of the scene; return the answer, which has the number of the new scene."""
    future = change.call_async(SetBoxes.Request(**changes))
    rclpy.spin_until_future_complete(node, future)
    if not future.result().success:
        raise SystemExit(future.result().message)
    return future.result()


def show(when: str, scene: SetBoxes.Response, y: float, z: float) -> None:
    """Send the place of the spreader until the scene has answered; print what touches."""
    state, sent = MultiDOFJointState(joint_names=['spreader']), []
    state.transforms = [Transform(translation=Vector3(y=y, z=z))]
    while not (answers and answers[-1].header.stamp in sent and (
            answers[-1].epoch, answers[-1].revision) == (scene.epoch, scene.revision)):
        state.header.stamp = node.get_clock().now().to_msg()
        sent.append(state.header.stamp)
        poses.publish(state)
        rclpy.spin_once(node, timeout_sec=0.1)
    touching = [contact.pair for contact in answers[-1].contacts]
    print(f'{when}:', ', '.join(touching) or 'nothing')


change.wait_for_service()
ground, lorry = Pose(position=Point(z=1.2955)), Pose(position=Point(y=6.0, z=2.7955))
below = Pose(position=Point(z=-1.4945))  # where c1 hangs, in the frame of the spreader
show('on the ground', set_boxes(fixed=[Box(name='c1', pose=ground)]), 0.0, 2.79)
attached = set_boxes(bodies=[Body(name='spreader', boxes=[Box(name='c1', pose=below)])])
show('lifted', attached, 3.0, 6.79)
show('on the lorry', attached, 6.0, 4.29)
show('detached', set_boxes(fixed=[Box(name='c1', pose=lorry)]), 6.0, 4.29)
rclpy.shutdown()

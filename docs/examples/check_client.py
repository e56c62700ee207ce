# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ask a contact node a question: `python docs/examples/check_client.py`.

Start `box_contact_contact_node` first. A planner, a test or a simulator in lockstep calls the
service `~/check` and waits for its answer. A question has no stamp, so nothing has to be reset.

It prints:

    load_stack: 10.0 mm deep, 0.297 m³
"""
from box_contact_ros.extras import require

require('ros')  # what is missing is named in one line
import rclpy
from geometry_msgs.msg import Point, Pose, Vector3
from rclpy.qos import QoSProfile

from box_contact_msgs.msg import Box
from box_contact_msgs.srv import Check

rclpy.init()
node = rclpy.create_node('check_client')
check = node.create_client(Check, 'contact_node/check', qos_profile=QoSProfile(depth=128))
check.wait_for_service()
container = Vector3(x=12.192, y=2.438, z=2.591)
boxes = [Box(name='load', size=container, pose=Pose(position=Point(z=2.581))),
         Box(name='stack', size=container)]  # a new pose is upright, at the origin
future = check.call_async(Check.Request(boxes=boxes))
rclpy.spin_until_future_complete(node, future)
answer = future.result()
if not answer.success:
    raise SystemExit(answer.message)
for contact in answer.contacts.contacts:
    print(f'{contact.pair}: {1e3 * contact.depth:.1f} mm deep, {contact.volume:.3f} m³')
rclpy.shutdown()

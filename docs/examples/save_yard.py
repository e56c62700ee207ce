# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Save the yard of a contact node as a scene file: `python docs/examples/save_yard.py OLD NEW`.

OLD is the scene file of the node, which has its pairs. Started with the file NEW, a node has the
boxes and bodies of the yard as it is now. Here they are those of lift.py.

It prints:

    4 boxes in /tmp/yard.yaml
"""
import sys
from pathlib import Path

import rclpy
import yaml
from rclpy.qos import QoSProfile

from box_contact_msgs.srv import GetBoxes
from box_contact_ros.node.messages import pose_of, size_of

rclpy.init()
node = rclpy.create_node('save_yard')
get_boxes = node.create_client(GetBoxes, 'contact_node/get_boxes',
                               qos_profile=QoSProfile(depth=128))
get_boxes.wait_for_service()
scene = yaml.safe_load(Path(sys.argv[1]).read_text()) | {'boxes': {}, 'bodies': {}}
revision, count = None, 1
while len(scene['boxes']) < count:
    future = get_boxes.call_async(GetBoxes.Request(first=len(scene['boxes'])))
    rclpy.spin_until_future_complete(node, future)
    page = future.result()
    if revision not in (None, page.revision):
        raise SystemExit('the yard changes: try again')
    revision, count = page.revision, page.count
    for state in page.boxes:
        box = scene['boxes'][state.box.name] = {'size': list(size_of(state.box))}
        if state.fixed or state.body:
            box['pose'] = list(pose_of(state.box))
        if state.body:
            box['body'] = state.body
    for body in page.bodies:
        scene['bodies'][body.name] = {'pose': list(pose_of(body))} if body.fixed else {}
Path(sys.argv[2]).write_text(yaml.safe_dump({key: part for key, part in scene.items() if part},
                                            sort_keys=False))
print(f'{count} boxes in {sys.argv[2]}')
rclpy.shutdown()

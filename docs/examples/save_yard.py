# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Save the yard of a contact node as a scene file: `python docs/examples/save_yard.py NEW`.

Started with the file NEW, a node has the boxes, bodies and pairs of the yard as it is now. Here
they are those of lift.py.

It prints:

    4 boxes in /tmp/yard.yaml
"""
import argparse
import sys
from pathlib import Path
from typing import Any

from box_contact_ros.extras import require

require('ros')  # what is missing is named in one line
import rclpy
import yaml

from box_contact_ros import Box, Frame, Pair, YardClient


def entry_of(part: Box | Frame) -> dict[str, Any]:
    """Return how a file has a box or body: the fields that are set."""
    fields = {name: getattr(part, name, None) for name in ('size', 'pose', 'pose_topic', 'body')}
    return {name: list(value) if isinstance(value, tuple) else value
            for name, value in fields.items() if value}


def pair_of(pair: Pair | tuple[str, str]) -> dict[str, str]:
    """Return how a file has a listed pair, or one by patterns."""
    named = {'name': pair.name} if isinstance(pair, Pair) and pair.name else {}
    return dict(zip('ab', pair[-2:])) | named


parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
parser.add_argument('file', metavar='NEW', type=Path, help='the scene file to write')
file = parser.parse_args().file
rclpy.init()
node = rclpy.create_node('save_yard')
client = YardClient(node)
print('waiting for contact_node', file=sys.stderr)
while client.yard is None:
    rclpy.spin_once(node)
scene = client.yard.scene
parts = {'frame_id': scene.frame_id, 'poses': scene.poses,
         'boxes': {name: entry_of(box) for name, box in scene.boxes.items()},
         'bodies': {name: entry_of(body) for name, body in scene.bodies.items()},
         'pairs': [pair_of(pair) for pair in (*scene.pairs, *scene.patterns)]}
file.write_text(yaml.safe_dump({key: part for key, part in parts.items() if part},
                               sort_keys=False))
print(f'{len(scene.boxes)} boxes in {file}')
rclpy.shutdown()

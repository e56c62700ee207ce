# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What touches in a world of boxes? `python docs/examples/from_sdf.py [WORLD]`.

The world is an SDF file, as Gazebo reads it. Each model is a body, whose boxes are no pairs. Those
that are static never move. What is included, nested or no box is named, and not read. A pose in
degrees, or relative to another frame, is refused. It prints:

    truck/chassis/bed and load/container/box: 1.0 mm deep
    load/container/box and spreader/frame/beam: 1.0 mm deep
    load/container/box and spreader/frame/front: 1.0 mm deep
    load/container/box and spreader/frame/rear: 1.0 mm deep
"""
import sys
from math import cos, sin
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from box_contact_ros import Box, Frame, Scene, SceneSolver

WORLD = Path(__file__).with_name('files') / 'yard.sdf'


def pose_of(part: ElementTree.Element) -> np.ndarray:
    """Return a part's <pose> as x y z qx qy qz qw; the file has x y z roll pitch yaw."""
    pose = part.find('pose')
    if pose is not None and any(pose.attrib.values()):
        raise ValueError(f'the pose of {part.get("name")} has {pose.attrib}, which is not read')
    numbers = (part.findtext('pose') or '0 0 0 0 0 0').split()
    if len(numbers) != 6:
        raise ValueError(f'the pose of {part.get("name")} has {len(numbers)} numbers, not 6')
    x, y, z, *turn = map(float, numbers)
    (sr, sp, sy), (cr, cp, cy) = ([f(angle / 2) for angle in turn] for f in (sin, cos))
    return np.array([x, y, z, sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy,
                     cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy])


def within(frame: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Return a pose in a frame as one in the frame around it."""
    v, w, position, turn = frame[3:6], frame[6], pose[:3], pose[3:]
    moved = position + 2.0 * np.cross(v, np.cross(v, position) + w * position)
    return np.r_[frame[:3] + moved, w * turn[:3] + turn[3] * v + np.cross(v, turn[:3]),
                 w * turn[3] - v @ turn[:3]]


def boxes_of(model: ElementTree.Element) -> dict[str, Box]:
    """Return the boxes of a model by model/link/collision."""
    boxes, body = {}, model.get('name', '')
    for link in model.iterfind('link'):
        for part in link.iterfind('collision'):
            name = f'{body}/{link.get("name")}/{part.get("name")}'
            size = part.findtext('geometry/box/size')
            if name in boxes:
                raise ValueError(f'two collisions have the name {name}')
            if size is None:
                print(f'not read: {name} is no box', file=sys.stderr)
                continue
            boxes[name] = Box(np.array(size.split(), float),
                              within(pose_of(link), pose_of(part)), body=body)
    return boxes


def read_world(path: str | Path) -> tuple[Scene, np.ndarray]:
    """Return the scene of a world, and the poses (n, 7) of the models that move."""
    world = ElementTree.parse(path).find('world')
    if world is None:
        raise ValueError('there is no <world>')
    for part in [*world.iter('include'), *world.iterfind('model//model')]:
        print(f'not read: {part.tag} {part.findtext("uri", part.get("name"))}', file=sys.stderr)
    boxes: dict[str, Box] = {}
    bodies: dict[str, Frame] = {}
    moving = []
    for model in world.iterfind('model'):
        own, name, pose = boxes_of(model), model.get('name', ''), pose_of(model)
        if not own:
            continue
        if not name:
            raise ValueError('a model has no name')
        if frame := model.get('placement_frame'):
            raise ValueError(f'model {name} has the placement_frame {frame}, which is not read')
        if name in bodies:
            raise ValueError(f'two models have the name {name}')
        boxes |= own
        is_static = model.findtext('static', '').strip() in ('true', '1')
        bodies[name] = Frame(pose) if is_static else Frame()
        moving += [] if is_static else [pose]
    scene = Scene(boxes, bodies=bodies, patterns=(('*', '*'),), pose_array=True)
    return scene, np.array(moving).reshape(-1, 7)


def main() -> None:
    """Read a world, and tell what touches in it."""
    path = sys.argv[1] if len(sys.argv) > 1 else WORLD
    try:
        scene, moving = read_world(path)
    except (OSError, ValueError, ElementTree.ParseError) as error:
        sys.exit(f'{path}: {error}')
    for pair, contact in SceneSolver(scene)(moving).named():
        print(f'{pair.a} and {pair.b}: {max(0.0, -1e3 * contact.separation):.1f} mm deep')


if __name__ == '__main__':
    main()

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""`contact_node --check FILE`: tells what a scene file means, or where it is wrong, without ROS.

Prints a line for each box and for each pair, then sizes, topics and counts. The exit status is 1
for a file that is refused.
"""
from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator, Sequence

from ...solver.arguments import program_parser
from ..scene_solver import POSE_ARRAY, Scene
from .scene_file import SceneError, read_scene


def main(args: Sequence[str] | None = None) -> int:
    """Check the scene file that follows `--check`."""
    parser = program_parser('contact_node', __doc__)
    parser.add_argument('--check', metavar='FILE', required=True,
                        help='a scene file, its text, or the bare name of one in config/scenes/')
    try:
        scene = read_scene(parser.parse_args(args).check)
    except SceneError as error:
        print(f'error: {error}', file=sys.stderr)
        return 1
    for line in meaning(scene):
        print(line)
    return 0


def meaning(scene: Scene) -> Iterator[str]:
    """Yield what a scene means, line by line."""
    source_of = dict(scene.sources) | {
        name: f'frame {frame} in /tf' for name, frame in scene.frames.items()}
    if scene.pose_array:
        source_of = {name: f'{POSE_ARRAY}[{number}]' for number, name in enumerate(scene.moving)}
    for name, box in scene.boxes.items():
        where = (f'moves: {source_of[name]}' if name in source_of else
                 'fixed at ' + ' '.join(f'{number:g}' for number in box.pose) if box.pose else
                 'moves, but is in no pair: not listened to')
        mass = f', {box.mass:g} kg' if box.mass else ''
        yield f'box {name}: {_size(box.size)}{mass}, {where}'
    for pair in scene.pairs:
        yield f'pair {pair.name}: id {pair.id}, from {pair.a} to {pair.b}'
    for size, count in Counter(box.size for box in scene.boxes.values()).items():
        yield f'size {_size(size)}: {count}'
    topics = list(scene.sources.values())
    yield f'frame: {scene.frame_id or "any, the same for all poses"}'
    named = f' ({", ".join(topics[:3])}{", ..." if len(topics) > 3 else ""})' if topics else ''
    yield f'topics in: {len(topics)}{named}'
    if scene.frames:
        yield f'frames in /tf: {len(scene.frames)}, which need tf2_ros'
    yield f'topics out: contacts, and <pair>/contact/point and /normal of {len(scene.pairs)} pairs'
    moving = sum(box.pose is None for box in scene.boxes.values())
    yield f'{len(scene.boxes)} boxes, {moving} of them moving; {len(scene.pairs)} pairs'


def _size(size: Sequence[float]) -> str:
    return ' x '.join(f'{extent:g}' for extent in size) + ' m'

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The streams of poses that a scene needs, and what their poses decide."""
from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..scene.boxes import Box, Frame
from ..scene.scene import ALONE, Pair, Scene

POSES_TOPIC = 'poses'
"""Topic of the poses of all boxes and bodies that move, where they come as one message."""
ALL_BOXES = 'all boxes'
"""Stream of these poses: no box of a scene file can have this name."""


def streams_of(scene: Scene) -> tuple[str, ...]:
    """Return the names of the streams: each of `scene.moving`, or ALL_BOXES instead of them."""
    return (ALL_BOXES,) if scene.in_one_message else scene.moving


def topics_of(scene: Scene) -> Mapping[str, str]:
    """Return the topics of poses, by stream."""
    if scene.in_one_message:
        return {ALL_BOXES: POSES_TOPIC}
    parts: dict[str, Box | Frame] = {**scene.boxes, **scene.bodies}
    return {name: parts[name].pose_topic or f'{name}/pose' for name in scene.moving}


def partners_of(scene: Scene, stream: str) -> set[str]:
    """Return the streams that a stream has a pair with; itself if a partner is fixed."""
    if stream == ALL_BOXES:
        return {ALL_BOXES}
    met = np.zeros(len(scene.boxes), bool)
    boxes = [scene.row_of[stream]]
    if stream in scene.bodies:
        boxes = np.flatnonzero(scene.body_of == boxes[0] - len(scene.boxes)).tolist()
    for index in boxes:
        met |= scene.partners(index)
        met[scene.rows[(scene.rows == index).any(axis=1)]] = True
    met[boxes] = False
    if met[scene.is_fixed].any():
        return {stream}
    return {scene.mover(scene.names[other]) for other in np.flatnonzero(met)}


def watched_of(scene: Scene) -> tuple[Pair, ...]:
    """Return what may be stale: listed pairs, then each moving box that patterns ask for."""
    boxes = np.flatnonzero(scene.is_asked & ~scene.is_fixed).tolist()
    return (*scene.pairs, *(scene.pair_of(box, ALONE) for box in boxes))

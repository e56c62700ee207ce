# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Our scene file as a plan: what has a pose in it is fixed, and what moves has none."""
from __future__ import annotations

from pathlib import Path

import numpy as np

from ..scene.scene_file import read_scene
from .plan import Fault, Plan


def read_scene_plan(path: Path) -> Plan:
    """Return the plan of a scene file. Raises ValueError for other files."""
    scene = read_scene(path)
    poses = scene.fixed_poses()
    scene.place_boxes(poses)
    here = ~np.isnan(poses[:len(scene.boxes), 0])
    missing = [name for name, known in zip(scene.names, here) if not known]
    faults = [Fault('pose', tuple(missing), 'moves, and has no pose in the file: left out')
              ] if missing else []
    sizes = np.array([box.size for box in scene.boxes.values()])
    return Plan(sizes[here], poses[:len(here)][here], ground=range(int(here.sum())),
                names=[name for name, known in zip(scene.names, here) if known], faults=faults)

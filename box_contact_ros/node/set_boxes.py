# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The service ~/set_boxes: boxes that come, go, land or are lifted while the node runs."""
from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from box_contact_msgs.srv import SetBoxes

from ..scene.changes import MOST_BOXES
from ..scene.scene import Box, Scene, SceneError
from ..scene.scene_solver import SceneSolver
from ..solver.checks import name_fault, nearest_name, short_repr
from .messages import check_frame, pose_of, size_of
from .paced_service import Kind


def changed(solver: SceneSolver, request: SetBoxes.Request) -> SceneSolver:
    """Return the solver of the scene that a request makes, or raise ValueError."""
    check_frame(request.header.frame_id, solver.scene)
    fixed = _boxes(solver.scene, request.fixed, 'fixed')
    moving = _boxes(solver.scene, request.moving, 'moving')
    try:
        return solver.changed(fixed=fixed, moving=moving, absent=request.absent)
    except SceneError as error:
        names = {'fixed': fixed, 'moving': moving}.get(str(error.path[0]))
        if names is None or len(error.path) < 2:
            raise
        field, name, *rest = error.path
        raise SceneError((field, list(names).index(str(name)), *rest),
                         f'{short_repr(name)} {error.reason}') from None


def _boxes(scene: Scene, boxes: Sequence[Any], field: str) -> dict[str, Box]:
    """Return boxes of a request by name, or raise SceneError."""
    if len(boxes) > MOST_BOXES:
        raise SceneError((field,), f'a request has at most {MOST_BOXES} boxes, not {len(boxes)}')
    found: dict[str, Box] = {}
    for number, box in enumerate(boxes):
        name, size, known = box.name, size_of(box), scene.boxes.get(box.name)
        try:
            if name in found:
                raise SceneError((), f'is the name of {field}[{list(found).index(name)}], too')
            if not known and (fault := name_fault(name, token=True)):
                raise SceneError((), fault)
            if not known and not any(size):
                raise SceneError((), 'has no size, and is no box of the scene'
                                     f'{nearest_name(name, scene.boxes)}')
            found[name] = Box(size if any(size) or not known else known.size,
                              pose_of(box) if field == 'fixed' else None)
        except SceneError as error:
            raise SceneError((field, number, *error.path),
                             f'{short_repr(name)} {error.reason}') from None
    return found


def kind_and_size(request: SetBoxes.Request) -> tuple[Kind, int]:
    """Return the number of boxes; all requests are of one kind."""
    return (), 1 + len(request.fixed) + len(request.moving) + len(request.absent)

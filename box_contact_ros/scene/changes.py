# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What may become of the boxes of a scene while it is solved: they come, go, land or are lifted."""
from __future__ import annotations

from collections.abc import Collection, Mapping

from ..solver.checks import name_fault, nearest_name, short_repr
from .scene import Box, Scene, SceneError

MOST_BOXES = 100_000
"""Of a scene that changes."""


def checked_changes(scene: Scene, fixed: Mapping[str, Box], moving: Mapping[str, Box],
                    absent: Collection[str]) -> dict[str, Box | None]:
    """Return what becomes of boxes by name, None for one that goes; raise SceneError."""
    changes: dict[str, Box | None] = {}
    for field, boxes in (('fixed', fixed), ('moving', moving)):
        if not isinstance(boxes, Mapping):
            raise SceneError((field,), f'must be boxes by name, not {short_repr(boxes)}')
        for name, box in boxes.items():
            if fault := _fault_of(scene, name) or _box_fault(field, box):
                raise SceneError((field, name), fault)
            if field == 'moving' and not scene.pose_array:
                raise SceneError((field, name), 'has no topic: boxes come and go as moving ones '
                                                'in a scene with poses: array alone')
            if name in changes:
                raise SceneError((field, name), 'is in fixed, too')
            changes[name] = box
    if isinstance(absent, str) or not isinstance(absent, Collection):
        raise SceneError(('absent',), f'must be names, not {short_repr(absent)}')
    for number, name in enumerate(absent):
        fault = _fault_of(scene, name)
        if not fault and name not in scene.boxes:
            fault = f'is none of the boxes{nearest_name(name, scene.boxes)}'
        elif not fault and name in scene.listed_names:
            fault = 'is a box of a listed pair, which stays'
        elif not fault and name in changes:
            fault = 'is changed by the same request'
        if fault:
            raise SceneError(('absent', number), f'{short_repr(name)} {fault}')
        changes[name] = None
    gone = sum(box is None for box in changes.values())
    count = len(scene.boxes) - gone + sum(name not in scene.boxes for name in changes)
    if count < 1:
        raise SceneError(('absent',), 'a scene needs at least one box')
    if count > MOST_BOXES:
        raise SceneError(('fixed',), f'{count} boxes are more than {MOST_BOXES}')
    return changes


def _fault_of(scene: Scene, name: object) -> str | None:
    """Return why the box of a name may not be changed, or None."""
    if not isinstance(name, str):
        return f'must be a name, not {short_repr(name)}'
    if not name:
        return 'is an empty name'
    known = scene.boxes.get(name)
    if name in scene.bodies or (known and known.body):
        return 'is of a body, and bodies stay as they are'
    if known and known.pose is None and not scene.pose_array:
        return 'moves by a topic of its own, and stays as it is'
    return name_fault(name)


def _box_fault(field: str, box: object) -> str | None:
    """Return why an object is no box that `set_boxes` takes, or None."""
    if not isinstance(box, Box):
        return f'must be a Box, not {short_repr(box)}'
    if box.body or box.pose_topic:
        return 'a box that comes has neither a body nor a pose_topic'
    if (box.pose is None) == (field == 'fixed'):
        return 'a fixed box needs a pose' if field == 'fixed' else 'a box that moves has no pose'
    return None

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What may become of boxes and bodies while a scene is solved: they come, go, join and come off."""
from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from typing import NamedTuple

import numpy as np

from ..solver.checks import name_fault, nearest_name, short_repr
from .boxes import MOST_BOXES, Box, Frame, SceneError
from .scene import Scene

NAMED_ALONE = 'what moves comes and goes in scenes with poses: named alone'


class Changes(NamedTuple):
    """What becomes of boxes and bodies by name; None for one that goes."""

    boxes: dict[str, Box | None]
    frames: dict[str, Frame | None]


def checked_changes(scene: Scene, fixed: Mapping[str, Box], moving: Mapping[str, Box],
                    parts: Mapping[str, Box], bodies: Mapping[str, Frame],
                    absent: Collection[str]) -> Changes:
    """Return what becomes of boxes and bodies; raise SceneError."""
    for field, mapping, kind in (('fixed', fixed, 'boxes'), ('moving', moving, 'boxes'),
                                 ('parts', parts, 'boxes'), ('bodies', bodies, 'Frames')):
        if not isinstance(mapping, Mapping):
            raise SceneError((field,), f'must be {kind} by name, not {short_repr(mapping)}')
    if isinstance(absent, str) or not isinstance(absent, Collection):
        raise SceneError(('absent',), f'must be names, not {short_repr(absent)}')
    changes = Changes({}, {})
    for name, frame in bodies.items():
        if fault := _name_fault(name) or _frame_fault(scene, name, frame):
            raise SceneError(('bodies', name), fault)
        known = scene.bodies.get(name)
        stays = known is not None and known.pose is None and frame.pose is None
        changes.frames[name] = known if stays else frame  # with its topic
    for field, boxes in (('fixed', fixed), ('moving', moving), ('parts', parts)):
        for name, box in boxes.items():
            if fault := (_name_fault(name) or _box_fault(field, box)
                         or _change_fault(scene, name, box, bodies)):
                raise SceneError((field, name), fault)
            if name in changes.boxes:
                first = next(other for other, others in (
                    ('fixed', fixed), ('moving', moving)) if name in others)
                raise SceneError((field, name), f'is in {first}, too')
            changes.boxes[name] = box
    for number, name in enumerate(absent):
        if fault := _name_fault(name) or _absent_fault(scene, name, changes):
            raise SceneError(('absent', number), f'{short_repr(name)} {fault}')
        changes.boxes.update((part, None) for part in boxes_of(scene, name))
        if name in scene.bodies:
            changes.frames[name] = None
    _check_emptied(scene, changes)
    _check_count(scene, changes)
    return changes


def boxes_of(scene: Scene, name: str) -> Iterator[str]:
    """Yield the name of a box, or the names of the boxes of a body."""
    if name not in scene.bodies:
        yield name
        return
    body = list(scene.bodies).index(name)
    for index in np.flatnonzero(scene.body_of == body).tolist():
        yield scene.names[index]


def _name_fault(name: object) -> str | None:
    if not isinstance(name, str):
        return f'must be a name, not {short_repr(name)}'
    return name_fault(name) if name else 'is an empty name'


def _frame_fault(scene: Scene, name: str, frame: object) -> str | None:
    """Return why a body may not come or become as it is given, or None."""
    if not isinstance(frame, Frame):
        return f'must be a Frame, not {short_repr(frame)}'
    if frame.pose_topic:
        return 'a body that comes has no pose_topic'
    if name in scene.boxes:
        return 'is the name of a box, too'
    known = scene.bodies.get(name)
    was_fixed = known is None or known.pose is not None
    if scene.poses != 'named' and was_fixed != (frame.pose is not None):
        return f'would {"move" if was_fixed else "stop"}: {NAMED_ALONE}'
    return None


def _box_fault(field: str, box: object) -> str | None:
    """Return why an object is no box that `set_boxes` takes, or None."""
    if not isinstance(box, Box):
        return f'must be a Box, not {short_repr(box)}'
    if field == 'parts':
        return None if box.body else 'a part needs a body'
    if box.body or box.pose_topic:
        return 'a box that comes has neither a body nor a pose_topic'
    if (box.pose is None) == (field == 'fixed'):
        return 'a fixed box needs a pose' if field == 'fixed' else 'a box that moves has no pose'
    return None


def _change_fault(scene: Scene, name: str, box: Box, bodies: Mapping[str, Frame]) -> str | None:
    """Return why the box of a name may not become another one, or None."""
    if name in scene.bodies or name in bodies:
        return 'is the name of a body, too'
    if box.body and box.body not in bodies and box.body not in scene.bodies:
        return (f'{short_repr(box.body)} is none of the bodies'
                f'{nearest_name(box.body, scene.bodies)}')
    if box.pose is None and scene.poses != 'named':
        return f'would move: {NAMED_ALONE}'
    return _stays(scene, name)


def _stays(scene: Scene, name: str) -> str | None:
    """Return why a box that moves stays as it is, or None."""
    known = scene.boxes.get(name)
    if scene.poses == 'named' or not known or known.body or known.pose is not None:
        return None
    return f'moves, and stays as it is: {NAMED_ALONE}'


def _absent_fault(scene: Scene, name: str, changes: Changes) -> str | None:
    """Return why a box or body may not go, or None."""
    if name not in scene.boxes and name not in scene.bodies:
        return f'is none of the boxes{nearest_name(name, scene.row_of)}'
    if name in changes.frames or any(part in changes.boxes for part in boxes_of(scene, name)):
        return 'is changed by the same request'
    if any(part in scene.listed_names for part in boxes_of(scene, name)):
        return 'is a box of a listed pair, which stays'
    return _stays(scene, name)


def _check_emptied(scene: Scene, changes: Changes) -> None:
    """Let bodies go whose last box does; raise SceneError for one that may not."""
    more: Counter[str] = Counter(dict.fromkeys(changes.frames, 0))
    for name, box in changes.boxes.items():
        known = scene.boxes.get(name)
        if known and known.body:
            more[known.body] -= 1
        if box and box.body:
            more[box.body] += 1
    index = {name: number for number, name in enumerate(scene.bodies)}
    for body, change in more.items():
        before = np.count_nonzero(scene.body_of == index[body]) if body in index else 0
        if before + change > 0:
            continue
        if body not in scene.bodies:
            raise SceneError(('bodies', body), f'no box is a part of {short_repr(body)}')
        if scene.poses != 'named' and scene.bodies[body].pose is None:
            raise SceneError(('bodies', body), f'its last box goes, but {NAMED_ALONE}')
        changes.frames[body] = None


def _check_count(scene: Scene, changes: Changes) -> None:
    """Raise SceneError for a scene that would have no box, or too many."""
    gone = sum(box is None for box in changes.boxes.values())
    count = len(scene.boxes) - gone + sum(name not in scene.boxes for name in changes.boxes)
    if count < 1:
        raise SceneError(('absent',), 'a scene needs at least one box')
    if count > MOST_BOXES:
        raise SceneError(('fixed',), f'{count} boxes are more than {MOST_BOXES}')

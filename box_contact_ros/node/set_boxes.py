# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The service ~/set_boxes: boxes and bodies that come, go and are joined while the node runs."""
from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from typing import Any

from box_contact_msgs.msg import Box as BoxMessage
from box_contact_msgs.msg import Boxes
from box_contact_msgs.srv import SetBoxes

from ..scene.boxes import Box, Frame, KeyPath, SceneError
from ..scene.changes import boxes_of
from ..scene.scene import Scene
from ..scene.scene_solver import SceneSolver
from ..solver.checks import TooMuch, name_fault, nearest_name, short_repr
from .diagnostics import some_names
from .messages import check_frame, pose_of, size_of
from .paced_service import Kind, Outdated

MOST_REQUESTED = 1000
"""Boxes and names of a request. rclpy reads one of 1,000 boxes in 16 ms, which cannot be sliced."""
MOST_NAMED = 64  # boxes that a warning names
STEP = 100  # boxes that are read in one step, in about 2 ms


def changing(solver: SceneSolver, request: SetBoxes.Request,
             ) -> Generator[None, None, tuple[SceneSolver, list[str]]]:
    """Return, in steps, the solver of the scene that a request makes, and warnings.

    Raises ValueError.
    """
    count = size_of_request(request)
    if count > MOST_REQUESTED:
        raise TooMuch(f'a request has at most {MOST_REQUESTED} boxes and names, not {count}: '
                      'send several')
    yield
    check_frame(request.header.frame_id, solver.scene)
    places, changes = yield from changes_of(solver.scene, request)
    try:
        changed = yield from solver.changing(**changes)
    except SceneError as error:
        raise _at_its_place(error, places, changes['absent']) from None
    yield
    return changed, [*_absent_warnings(solver.scene, request.absent),
                     *_detached_warnings(solver.scene, request),
                     *_gone_warnings(solver.scene, changed.scene, request.absent),
                     *_pair_warnings(changed.scene, places)]


def check_expected(request: SetBoxes.Request, epoch: int, revision: int) -> None:
    """Raise Outdated for a request that was made for another scene."""
    if request.expected_epoch not in (0, epoch):
        raise Outdated(f'expected_epoch: {request.expected_epoch}, but the node was configured '
                       f'anew: its epoch is {epoch}')
    if request.expected_revision not in (-1, revision):
        raise Outdated(f'expected_revision: {request.expected_revision}, but the yard has '
                       f'changed: its revision is {revision}')


def size_of_request(request: SetBoxes.Request) -> int:
    """Return how many boxes and names a request has."""
    return (len(request.fixed) + len(request.moving) + len(request.absent) + len(request.bodies)
            + sum(len(body.boxes) for body in request.bodies))


def changes_of(scene: Scene, request: SetBoxes.Request | Boxes,
               ) -> Generator[None, None, tuple[dict[str, KeyPath], dict[str, Any]]]:
    """Return, in steps, the place of each name in a request, and arguments of `changing`.

    Raises SceneError.
    """
    places: dict[str, KeyPath] = {}
    changes: dict[str, Any] = {'fixed': {}, 'moving': {}, 'parts': {}, 'bodies': {}}

    def take(path: KeyPath, name: str) -> None:
        if name in places:
            raise SceneError(path, f'{short_repr(name)} is the name of '
                                   f'{_dotted(places[name])}, too')
        if name not in scene.row_of and (fault := name_fault(name, of_box=True)):
            raise SceneError(path, f'{short_repr(name)} {fault}')
        places[name] = path

    for number, body in enumerate(request.bodies):
        take(('bodies', number), body.name)
        try:
            changes['bodies'][body.name] = Frame(pose_of(body) if body.fixed else None)
        except SceneError as error:
            raise SceneError(('bodies', number, *error.path),
                             f'{short_repr(body.name)} {error.reason}') from None
    for number, (path, box, body) in enumerate(_listed(request)):
        take(path, box.name)
        known = scene.boxes.get(box.name)
        if body and known and known.body != body and any(size_of(box)):
            raise SceneError(path, f'{short_repr(box.name)} is a box of the scene: leave its size '
                                   'as a new message has it to attach it, or name the part '
                                   f'otherwise, such as {body}_{box.name}')
        field = 'parts' if body else str(path[0])
        try:
            changes[field][box.name] = _box(scene, box, body, has_pose=field != 'moving')
        except SceneError as error:
            raise SceneError((*path, *error.path),
                             f'{short_repr(box.name)} {error.reason}') from None
        if number % STEP == STEP - 1:
            yield
    for number, name in enumerate(request.absent):
        if name in scene.row_of:
            take(('absent', number), name)
    changes['absent'] = [name for name in request.absent if name in scene.row_of]
    return places, changes


def _listed(request: SetBoxes.Request | Boxes) -> Iterator[tuple[KeyPath, BoxMessage, str]]:
    """Yield where each box of a request is, the box, and the name of its body or ''."""
    for field in ('fixed', 'moving'):
        for number, box in enumerate(getattr(request, field)):
            yield (field, number), box, ''
    for number, body in enumerate(request.bodies):
        for part, box in enumerate(body.boxes):
            yield ('bodies', number, 'boxes', part), box, body.name


def _box(scene: Scene, box: BoxMessage, body: str, *, has_pose: bool) -> Box:
    size, known = size_of(box), scene.boxes.get(box.name)
    if not known and not any(size):
        raise SceneError((), f'has no size, and is no box of the scene'
                             f'{nearest_name(box.name, scene.boxes)}')
    return Box(size if any(size) or not known else known.size,
               pose_of(box) if has_pose else None, body=body)


def _at_its_place(error: SceneError, places: dict[str, KeyPath], absent: Sequence[str],
                  ) -> SceneError:
    """Return a refusal that names a box with the place of the box in the request."""
    field, *rest = error.path or ('',)
    if field == 'absent' and rest:
        return SceneError(places[absent[int(rest[0])]], error.reason)
    if not rest or rest[0] not in places:
        return error
    name = str(rest[0])
    return SceneError((*places[name], *rest[1:]), f'{short_repr(name)} {error.reason}')


def _dotted(path: KeyPath) -> str:
    return str(SceneError(path, '')).removesuffix(': ')


def _absent_warnings(scene: Scene, absent: Sequence[str]) -> Iterator[str]:
    for number, name in enumerate(absent):
        if name not in scene.row_of:
            yield f'absent[{number}]: {short_repr(name)} is not there'


def _detached_warnings(scene: Scene, request: SetBoxes.Request) -> Iterator[str]:
    """Yield which parts of bodies are named with a size, as new boxes are."""
    for path, box, body in _listed(request):
        known = scene.boxes.get(box.name)
        if not body and known and known.body and any(size_of(box)):
            yield (f'{_dotted(path)}: {short_repr(box.name)} was a part of '
                   f'{short_repr(known.body)}, and came off it')


def _gone_warnings(before: Scene, after: Scene, absent: Sequence[str]) -> Iterator[str]:
    """Yield what goes beside the names that a request calls absent: parts, and emptied bodies."""
    for name in absent:
        if name in before.bodies:
            parts = list(boxes_of(before, name))
            yield f'{some_names(parts, MOST_NAMED)} went with {short_repr(name)}'
    for name in before.bodies.keys() - after.bodies.keys() - set(absent):
        yield f'the body {short_repr(name)} went with its last box'


def _pair_warnings(scene: Scene, places: dict[str, KeyPath]) -> Iterator[str]:
    """Yield which boxes of a request are in no pair, and why."""
    for name, path in places.items():
        if path[0] == 'absent' or name in scene.bodies or scene.is_paired[scene.index_of[name]]:
            continue
        reason = ('the scene has no box that its patterns pair it with and that moves against it'
                  if scene.is_matched[scene.index_of[name]] else 'no pattern of pairs matches it')
        yield f'{_dotted(path)}: {short_repr(name)} is in no pair: {reason}'


def is_same(request: SetBoxes.Request, last: SetBoxes.Request) -> bool:
    """Return whether two requests ask for the same, whatever their stamps."""
    return (request.header.frame_id == last.header.frame_id and all(
        getattr(request, field) == getattr(last, field)
        for field in request.get_fields_and_field_types() if field != 'header'))


def boxes_message(epoch: int, solver: SceneSolver, request: SetBoxes.Request | None) -> Boxes:
    """Return what ~/boxes says of a scene, and of the request that made it."""
    message = Boxes(epoch=epoch, revision=solver.revision, moving_names=solver.moving)
    if request is not None:
        for field in ('fixed', 'moving', 'bodies', 'absent'):
            setattr(message, field, getattr(request, field))
    return message


def kind_and_size(request: SetBoxes.Request) -> tuple[Kind, int]:
    """Return the number of boxes; all requests are of one kind."""
    return (), 1 + size_of_request(request)

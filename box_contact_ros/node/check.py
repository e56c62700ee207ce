# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The service ~/check: the contacts of the boxes of one request, without stamps and topics."""
from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from box_contact_msgs.srv import Check

from ..models import most_near
from ..scene.pairing import frames_differ
from ..scene.scene_solver import SceneSolver
from ..solver.checks import name_fault, nearest_name, pose_fault, short_repr, size_fault
from ..solver.contact_solver import ContactSolver
from .messages import contact_message

MOST_BOXES = 256
MOST_PAIRS = 4096
"""All pairs of 91 boxes. A request with as many contacts keeps the node from its ticks for about a
tenth of a second. The objects of the response take most of that."""
COSTLY = 5e-3
"""Processor time [s] beyond which a request is costly: half a tick at 100 Hz."""
PAUSE = 4.0
"""Pause after a costly request, divided by its time: ticks have four fifths of the node's time."""


Row = tuple[float, ...]  # of numbers of one box
NO_POSE: Row = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
"""Pose of a new message: only the name of the box is given."""


class Throttle:
    """Keeps clients that ask costly requests without pause from stopping all ticks.

    After a costly request that took T, costly requests are refused for PAUSE · T. Whether a request
    is costly is judged by the time per pair of the last costly one.
    """

    def __init__(self) -> None:
        """Begin without a pause."""
        self._until = 0.0  # end of the pause [s]
        self._cheap = 0  # number of pairs that are not costly

    def refusal(self, pairs: int, now: float) -> str | None:
        """Return why a request of so many pairs is refused now [s], or None."""
        if now >= self._until or pairs <= self._cheap:
            return None
        return (f'busy: ticks come first after a costly request; ask again in '
                f'{self._until - now:.2g} s, or for at most {self._cheap} pairs')

    def answered(self, pairs: int, cost: float, took: float, now: float) -> None:
        """Note a request: its processor time, the time that it took, and when it ended [s]."""
        if cost > COSTLY:
            self._until, self._cheap = now + PAUSE * took, int(pairs * COSTLY / cost)


def pair_count(request: Check.Request) -> int:
    """Return how many pairs a request asks for."""
    boxes = len(request.boxes)
    return len(request.pairs) or boxes * (boxes - 1) // 2


class Checker:
    """Answers requests with a model. It keeps nothing of a request."""

    def __init__(self, solver: SceneSolver, model: str = 'exact') -> None:
        """Take the scene and the model, by its name too.

        Requests may name the scene's boxes without sizes.
        """
        self.solver, self._scene, self._model = solver, solver.scene, model
        self._fixed = {name: tuple(box.pose) for name, box in self._scene.boxes.items() if box.pose}
        self._labels = {(pair.a, pair.b): pair.label for pair in self._scene.pairs}
        self._most_pairs = min(MOST_PAIRS, most_near(model))
        self._solver_for = functools.cache(
            lambda margin: ContactSolver(model=solver.model, margin=margin))

    def answer(self, request: Check.Request, response: Check.Response) -> Check.Response:
        """Fill in the response: contacts, or why there are none."""
        try:
            self._answer(request, response)
        except ValueError as error:
            response.message = str(error)
        else:
            response.success = True
        return response

    def _answer(self, request: Check.Request, response: Check.Response) -> None:
        """Fill in contacts; raise ValueError, with field and value, for what is refused."""
        names, places = self._names_and_places(request)
        if fault := name_fault(request.header.frame_id):
            raise ValueError(f'header.frame_id: {fault}')
        if self._scene.frame_id not in ('', request.header.frame_id):
            raise ValueError('header.frame_id: ' + frames_differ(
                'the scene', self._scene.frame_id, 'the request', request.header.frame_id))
        if not request.margin >= 0.0:
            raise ValueError(f'margin must be 0 or more, not {request.margin:g}')
        # Normals of pairs apart are computed only where one may be listed.
        solver = self._solver_for(math.inf if request.margin else 0.0)
        poses, sizes = self._poses(request.boxes), self._sizes(request.boxes)
        try:
            contacts = solver.batch(np.array(poses), sizes=np.array(sizes), pairs=places)
        except ValueError:
            _refuse_by_name(request.boxes, poses, sizes)
            raise  # the model's own refusal
        listed = response.contacts
        listed.header = request.header
        for row in np.flatnonzero(contacts.separation <= request.margin if request.margin
                                  else contacts.colliding).tolist():
            contact = contacts[row]
            a, b = names[places[row, 0]], names[places[row, 1]]
            (listed.contacts if contact.colliding else listed.near).append(
                contact_message(self._labels.get((a, b), f'{a}_{b}'), a, b, contact))

    def _names_and_places(self, request: Check.Request) -> tuple[list[str], np.ndarray]:
        """Return the names of the boxes, and places (n, 2) of the pairs among them."""
        count = len(request.boxes)
        if not 2 <= count <= MOST_BOXES:
            raise ValueError(f'boxes: a request has 2 to {MOST_BOXES} boxes, not {count}')
        pairs = pair_count(request)
        if pairs > self._most_pairs:
            raise ValueError(f'pairs: {pairs} are asked for, and model {self._model!r} answers at '
                             f'most {self._most_pairs} per request: name the pairs that matter')
        place_of: dict[str, int] = {}
        for number, box in enumerate(request.boxes):
            if fault := name_fault(box.name):
                raise ValueError(f'boxes[{number}].name: {fault}')
            if place_of.setdefault(box.name, number) != number:
                raise ValueError(f'boxes[{number}]: {short_repr(box.name)} is the name of '
                                 f'boxes[{place_of[box.name]}], too')
        if request.pairs:
            places = np.array([_places_of(number, pair, place_of)
                               for number, pair in enumerate(request.pairs)])
        else:
            places = np.stack(np.triu_indices(count, 1), axis=1)
        return list(place_of), places

    def _poses(self, boxes: Sequence[Any]) -> list[Row]:
        """Return the pose of each box: its own, or the scene's of a box that is fixed there."""
        poses = [_pose(box) for box in boxes]
        for number, box in enumerate(boxes if self._fixed else ()):
            fixed = self._fixed.get(box.name)
            if fixed is not None:
                if poses[number] not in (NO_POSE, fixed):
                    raise ValueError(f'boxes[{number}] {short_repr(box.name)} is fixed in the scene'
                                     f' at {short_repr(fixed)}, not at {short_repr(poses[number])}:'
                                     ' leave its pose as a new message has it')
                poses[number] = fixed
        return poses

    def _sizes(self, boxes: Sequence[Any]) -> list[Row]:
        """Return full extents (3,) [m] of each box: its own, or those of the scene's box."""
        sizes: list[Row] = [(box.size.x, box.size.y, box.size.z) for box in boxes]
        for number, (box, size) in enumerate(zip(boxes, sizes)):
            if not any(size):
                known = self._scene.boxes.get(box.name)
                if known is None:
                    raise ValueError(f'boxes[{number}] {short_repr(box.name)} has no size, and is '
                                     'no box of the scene'
                                     f'{nearest_name(box.name, self._scene.boxes)}')
                sizes[number] = tuple(known.size)
        return sizes


def _pose(box: Any) -> Row:
    """Return `x y z qx qy qz qw` of a box."""
    p, q = box.pose.position, box.pose.orientation
    return p.x, p.y, p.z, q.x, q.y, q.z, q.w


def _refuse_by_name(boxes: Sequence[Any], poses: Sequence[Row], sizes: Sequence[Row]) -> None:
    """Raise ValueError for the first box whose numbers are no pose or no size."""
    for number, (box, pose, size) in enumerate(zip(boxes, poses, sizes)):
        if fault := pose_fault(pose) or size_fault(size):
            raise ValueError(f'boxes[{number}] {short_repr(box.name)}: {fault}')


def _places_of(number: int, pair: Any, place_of: Mapping[str, int]) -> tuple[int, int]:
    """Return the places of the boxes of pairs[number]."""
    for side, name in (('box_a', pair.box_a), ('box_b', pair.box_b)):
        if name not in place_of:
            raise ValueError(f'pairs[{number}].{side}: {short_repr(name)} is none of the boxes of '
                             f'the request{nearest_name(name, place_of)}')
    if pair.box_a == pair.box_b:
        raise ValueError(f'pairs[{number}]: {short_repr(pair.box_a)} is both box_a and box_b')
    return place_of[pair.box_a], place_of[pair.box_b]

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The service ~/check: what the boxes of one request touch, without stamps and topics."""
from __future__ import annotations

from typing import Any

from box_contact_msgs.srv import Check

from ..models import most_near
from ..scene.pairing import frames_differ
from ..scene.scene_check import Row, SceneCheck
from ..scene.scene_solver import SceneSolver
from ..solver.checks import name_fault
from .messages import KeptMessages

MOST_CONTACTS = 4096
"""Of a response: all pairs of 91 boxes, 0.8 MB."""
COSTLY = 5e-3
"""Processor time [s] beyond which a request is costly: half a tick at 100 Hz."""
PAUSE = 4.0
"""Pause after a costly request, divided by its time: ticks have four fifths of the node's time."""


class Throttle:
    """Keeps clients that ask costly requests without pause from stopping all ticks.

    After a costly request that took T, costly requests are refused for PAUSE · T. Whether a request
    is costly is judged by the time per box and pair of the last costly one.
    """

    def __init__(self) -> None:
        """Begin without a pause."""
        self._until = 0.0  # end of the pause [s]
        self._cheap = 0  # number of boxes and pairs that are not costly

    def refusal(self, size: int, now: float) -> str | None:
        """Return why a request of so many boxes and pairs is refused now [s], or None."""
        if now >= self._until or size <= self._cheap:
            return None
        return (f'busy: ticks come first after a costly request; ask again in '
                f'{self._until - now:.2g} s, or for at most {self._cheap} boxes and pairs')

    def answered(self, size: int, cost: float, took: float, now: float) -> None:
        """Note a request: its processor time, the time that it took, and when it ended [s]."""
        if cost > COSTLY:
            self._until, self._cheap = now + PAUSE * took, int(size * COSTLY / cost)


def size_of(request: Check.Request) -> int:
    """Return how many boxes and pairs a request has."""
    return len(request.boxes) + len(request.pairs)


class Checker:
    """Answers requests with the scene and the model of a node. It keeps nothing of a request."""

    def __init__(self, solver: SceneSolver, model: str = 'exact') -> None:
        """Take the scene and the model, by its name too."""
        self.solver = solver
        self._check = SceneCheck(solver, most_near=most_near(model))
        self._kept = KeptMessages(MOST_CONTACTS)

    def answer(self, request: Check.Request, response: Check.Response) -> Check.Response:
        """Fill in the response: contacts, or why there are none.

        Its contacts are overwritten by the next answer.
        """
        try:
            self._answer(request, response)
        except ValueError as error:
            response.message = str(error)
        else:
            response.success = True
        return response

    def _answer(self, request: Check.Request, response: Check.Response) -> None:
        """Fill in contacts; raise ValueError, with field and value, for what is refused."""
        frame_id, scene = request.header.frame_id, self.solver.scene
        if fault := name_fault(frame_id):
            raise ValueError(f'header.frame_id: {fault}')
        if scene.frame_id not in ('', frame_id):
            raise ValueError('header.frame_id: ' + frames_differ(
                'the scene', scene.frame_id, 'the request', frame_id))
        boxes = request.boxes
        pairs, contacts = self._check(
            [box.name for box in boxes], [_pose(box) for box in boxes],
            [(box.size.x, box.size.y, box.size.z) for box in boxes],
            [(pair.box_a, pair.box_b) for pair in request.pairs], request.margin)
        if len(pairs) > MOST_CONTACTS:
            raise ValueError(f'contacts: {len(pairs)} pairs touch or are near, and a response has '
                             f'at most {MOST_CONTACTS}: ask for fewer boxes, or name pairs')
        messages = self._kept.fill([self._check.names_of(a, b) for a, b in pairs.tolist()],
                                   contacts)
        touching = int(contacts.colliding.sum())
        listed = response.contacts
        listed.header = request.header
        listed.contacts, listed.near = messages[:touching], messages[touching:]


def _pose(box: Any) -> Row:
    """Return `x y z qx qy qz qw` of a box."""
    p, q = box.pose.position, box.pose.orientation
    return p.x, p.y, p.z, q.x, q.y, q.z, q.w

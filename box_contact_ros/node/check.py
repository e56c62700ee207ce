# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The service ~/check: what the boxes of one request touch, without stamps and topics."""
from __future__ import annotations

from collections.abc import Iterator, Mapping

from box_contact_msgs.srv import Check

from ..models.make_model import most_near
from ..scene.scene_check import Pose, SceneCheck
from ..scene.scene_solver import SceneSolver
from ..solver.checks import TooMuch
from .messages import KeptMessages, check_frame, near_messages, pose_of, size_of
from .paced_service import Kind

MOST_CONTACTS = 4096
"""Of a response: all pairs of 91 boxes, 0.8 MB."""


class CheckAnswerer:
    """Answers requests with the scene and the model of a node. It keeps nothing of a request."""

    def __init__(self, solver: SceneSolver, model: str = 'exact', epoch: int = 0) -> None:
        """Take the scene and the model, by its name too, and the node's epoch."""
        self.solver, self._epoch = solver, epoch
        self.check = SceneCheck(solver, most_near=most_near(model))
        self._kept = KeptMessages(MOST_CONTACTS)

    def answer(self, request: Check.Request, response: Check.Response,
               last: Mapping[str, Pose] | None = None) -> Iterator[None]:
        """Fill in contacts, in steps; they are overwritten by the next answer.

        last: poses of what moves, for a request that asks for them. Raises ValueError, with field
        and value, for what is refused.
        """
        check_frame(request.header.frame_id, self.solver.scene)
        boxes, last = request.boxes, last or {}
        names = [box.name for box in boxes]
        found, areas = yield from self.check(
            names, [pose_of(box) for box in boxes], [size_of(box) for box in boxes],
            [(pair.box_a, pair.box_b) for pair in request.pairs], request.margin, last)
        count = len(found.pairs) + len(found.near_pairs)
        if count > MOST_CONTACTS:
            raise TooMuch(f'contacts: {count} pairs touch or are near, and a response has '
                          f'at most {MOST_CONTACTS}: ask for fewer boxes, or name pairs')
        listed, guests = response.contacts, self.check.guests(names)
        touching, near = ([self.check.names_of(a, b, guests) for a, b in pairs.tolist()]
                          for pairs in (found.pairs, found.near_pairs))
        listed.header, listed.epoch = request.header, self._epoch
        listed.revision = self.solver.revision
        listed.contacts = self._kept.fill(touching, found.contacts, areas)
        listed.near = near_messages(near, found.near)
        response.left_out, response.left_out_names = self.check.left_out(names, last)


def kind_and_size(request: Check.Request) -> tuple[Kind, int]:
    """Return what decides how many pairs a box has, and the number of boxes and pairs."""
    pairs = len(request.pairs)
    return (pairs > 0, request.margin, request.last_poses), len(request.boxes) + pairs

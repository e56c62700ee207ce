# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The service ~/get_boxes: all boxes of a scene, some hundred at a time, though it changes."""
from __future__ import annotations

import time
from collections.abc import Iterator

from std_msgs.msg import Header

from box_contact_msgs.msg import Body, BoxPair, BoxState
from box_contact_msgs.srv import GetBoxes

from ..scene.boxes import Frame
from ..scene.scene import Scene
from ..scene.scene_solver import SceneSolver
from ..stream.streams import topics_of
from .messages import set_pose
from .paced_service import Kind, Outdated

PAGE = 500
"""Boxes of an answer: rclpy makes its message in some 10 ms."""
STEP = 100  # boxes that are told in one step
KEPT_SCENES = 4
KEPT_SECONDS = 10.0
"""How long [s] a scene is kept after its last answer."""


class Lister:
    """Tells the scenes of one configuration, the newest and those that are being listed."""

    def __init__(self, epoch: int) -> None:
        """Begin without scenes; epoch: the number of the configuration."""
        self._epoch = epoch
        self._kept: dict[int, tuple[float, Scene]] = {}
        """By revision, the one asked for last behind: when that was [s], and the scene."""

    def answer(self, solver: SceneSolver, model: str, request: GetBoxes.Request,
               response: GetBoxes.Response) -> Iterator[None]:
        """Fill in, in steps, the boxes from the one that is asked for on.

        solver, model: of the newest scene. Raises Outdated for a scene that is not kept.
        """
        scene, revision = self._asked(solver, request)
        response.header = Header(frame_id=scene.frame_id)
        response.epoch, response.revision, response.count = self._epoch, revision, len(scene.boxes)
        if request.first == 0:
            yield from _tell_pairs(scene, response)
            response.margin, response.model = solver.margin, model
        bodies: dict[str, Frame] = {}
        for index in range(request.first, min(request.first + PAGE, len(scene.boxes))):
            response.boxes.append(_state_of(scene, index))
            if body := response.boxes[-1].body:
                bodies[body] = scene.bodies[body]
            if index % STEP == STEP - 1:
                yield
        for name, frame in bodies.items():
            message = Body(name=name, fixed=frame.pose is not None)
            if frame.pose is not None:
                set_pose(message.pose, frame.pose)
            response.bodies.append(message)

    def _asked(self, solver: SceneSolver, request: GetBoxes.Request) -> tuple[Scene, int]:
        """Return the scene that a request is about, and its revision; keep it for the next one."""
        now, newest = time.monotonic(), solver.revision
        self._kept = {revision: kept for revision, kept in self._kept.items()
                      if now - kept[0] <= KEPT_SECONDS}
        revision = newest if request.revision < 0 else request.revision
        is_known = revision == newest or revision in self._kept
        if request.epoch not in (0, self._epoch) or not is_known:
            raise Outdated(f'revision {request.revision} of epoch {request.epoch} is not kept: the '
                           f'newest is {newest} of {self._epoch}; begin anew')
        scene = self._kept.pop(revision)[1] if revision in self._kept else solver.scene
        self._kept[revision] = now, scene
        if len(self._kept) > KEPT_SCENES:
            del self._kept[next(iter(self._kept))]
        return scene, revision


def _state_of(scene: Scene, index: int) -> BoxState:
    """Return the message of a box."""
    name = scene.names[index]
    box = scene.boxes[name]
    state = BoxState(body=box.body, fixed=bool(scene.is_fixed[index]),
                     paired=bool(scene.is_paired[index]))
    state.box.name = name
    size = state.box.size
    size.x, size.y, size.z = box.size
    if box.pose is not None:
        set_pose(state.box.pose, box.pose)
    return state


def _tell_pairs(scene: Scene, response: GetBoxes.Response) -> Iterator[None]:
    """Fill in, in steps, what a scene has beside boxes and bodies."""
    response.poses, response.pose_topics = scene.poses, list(topics_of(scene).values())
    for number, pair in enumerate(scene.pairs, 1):
        response.pairs.append(BoxPair(box_a=pair.a, box_b=pair.b))
        response.pair_names.append(pair.name)
        if number % STEP == 0:
            yield
    response.patterns = [BoxPair(box_a=a, box_b=b) for a, b in scene.patterns]


def kind_and_size(request: GetBoxes.Request) -> tuple[Kind, int]:
    """Return that all requests are alike."""
    return (), 1

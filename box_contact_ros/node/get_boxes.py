# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The service ~/get_boxes: all boxes of a node, some hundred at a time."""
from __future__ import annotations

from collections.abc import Sequence

from std_msgs.msg import Header

from box_contact_msgs.msg import Body, BoxState
from box_contact_msgs.srv import GetBoxes

from ..scene.scene import Box, Frame, Scene
from ..scene.scene_solver import SceneSolver
from .messages import pose_of, set_pose, size_of
from .paced_service import Kind

PAGE = 500
"""Boxes of an answer: rclpy makes its message in some 10 ms."""


def answer(solver: SceneSolver, epoch: int, request: GetBoxes.Request,
           response: GetBoxes.Response) -> None:
    """Fill in the boxes from the one that is asked for on."""
    scene = solver.scene
    response.header = Header(frame_id=scene.frame_id)
    response.epoch, response.revision, response.count = epoch, solver.revision, len(scene.boxes)
    bodies: dict[str, Frame] = {}
    for index in range(request.first, min(request.first + PAGE, len(scene.boxes))):
        name = scene.names[index]
        box = scene.boxes[name]
        state = BoxState(body=box.body, fixed=bool(scene.is_fixed[index]),
                         paired=bool(scene.is_paired[index]))
        state.box.name = name
        size = state.box.size
        size.x, size.y, size.z = box.size
        if box.pose is not None:
            set_pose(state.box.pose, box.pose)
        if box.body:
            bodies[box.body] = scene.bodies[box.body]
        response.boxes.append(state)
    for name, frame in bodies.items():
        body = Body(name=name, fixed=frame.pose is not None)
        if frame.pose is not None:
            set_pose(body.pose, frame.pose)
        response.bodies.append(body)
    response.success = True


def scene_of_answers(scene: Scene, answers: Sequence[GetBoxes.Response]) -> Scene:
    """Return the scene with the boxes of all answers instead of its own; raise SceneError."""
    boxes = {state.box.name: Box(
        size_of(state.box), pose_of(state.box) if state.fixed or state.body else None,
        body=state.body) for answer in answers for state in answer.boxes}
    bodies = {body.name: Frame(pose_of(body) if body.fixed else None)
              for answer in answers for body in answer.bodies}
    return scene.with_boxes(boxes, bodies)


def kind_and_size(request: GetBoxes.Request) -> tuple[Kind, int]:
    """Return that all requests are alike."""
    return (), 1

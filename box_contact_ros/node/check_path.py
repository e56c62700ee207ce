# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The service ~/check_path: what the boxes of one request meet on a path."""
from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from box_contact_msgs.msg import Approach as ApproachMessage
from box_contact_msgs.msg import BoxPair
from box_contact_msgs.srv import CheckPath

from ..scene.scene_check import NO_POSE, Pose, SceneCheck
from ..solver.checks import TooMuch, short_repr
from ..solver.motion import Approaches
from .messages import check_frame, near_messages, size_of
from .paced_service import Kind

MOST_WAYPOINTS, MOST_POSES = 1000, 4096
MESSAGES = 256
"""That one step makes."""


def answer(check: SceneCheck, epoch: int, request: CheckPath.Request,
           response: CheckPath.Response, last: Mapping[str, Pose] | None = None) -> Iterator[None]:
    """Fill in, in steps, what the path meets.

    last: poses of what moves, for a request that asks for them. Raises ValueError, with field and
    value, for what is refused.
    """
    last = last or {}
    response.header, response.epoch = request.header, epoch
    response.revision = check.solver.revision
    check_frame(request.header.frame_id, check.solver.scene)
    names = [box.name for box in request.boxes]
    found = yield from check.path(
        names, _path(request, names), [size_of(box) for box in request.boxes],
        [(pair.box_a, pair.box_b) for pair in request.pairs], request.clearance, last)
    guests = check.guests(names)

    def messages(pairs: np.ndarray, approaches: Approaches) -> list[ApproachMessage]:
        near = near_messages([check.names_of(a, b, guests) for a, b in pairs.tolist()],
                             approaches.nearest)
        return [ApproachMessage(time=float(time), closing_speed=float(speed), near=one)
                for time, speed, one in zip(approaches.time, approaches.closing_speed, near)]

    for first in range(0, len(found.pairs), MESSAGES):
        yield
        part = slice(first, first + MESSAGES)
        response.impacts += messages(found.pairs[part], found.impacts[part])
    for a, b in found.at_start.tolist():
        _, box_a, box_b = check.names_of(a, b, guests)
        response.at_start.append(BoxPair(box_a=box_a, box_b=box_b))
    if len(found.least):
        response.least, = messages(found.least_pair, found.least)
    response.left_out, response.left_out_names = check.left_out(names, last)


def _path(request: CheckPath.Request, names: Sequence[str]) -> np.ndarray:
    """Return poses (m, n, 7) of the waypoints by names; ValueError for what is not a path."""
    count = len(request.waypoints)
    if not 2 <= count <= MOST_WAYPOINTS:
        raise (ValueError if count < 2 else TooMuch)(
            f'waypoints: a request has 2 to {MOST_WAYPOINTS}, not {count}')
    if count * len(names) > MOST_POSES:
        raise TooMuch(f'waypoints: a request has at most {MOST_POSES} transforms, not '
                      f'{count * len(names)}')
    path = np.full((count, len(names), 7), NO_POSE)
    for k, waypoint in enumerate(request.waypoints):
        if sorted(waypoint.joint_names) != sorted(names):
            missing = sorted(set(names).symmetric_difference(waypoint.joint_names))
            raise ValueError(f'waypoints[{k}].joint_names must be the names of boxes, each once: '
                             f'{short_repr(missing or list(waypoint.joint_names))} differ')
        if len(waypoint.transforms) != len(names):
            raise ValueError(f'waypoints[{k}].transforms: {len(waypoint.transforms)}, but '
                             f'{len(names)} names')
        at = {name: row for row, name in enumerate(waypoint.joint_names)}
        for row, name in enumerate(names):
            place = waypoint.transforms[at[name]]
            p, q = place.translation, place.rotation
            path[k, row] = p.x, p.y, p.z, q.x, q.y, q.z, q.w
    return path


def kind_and_size(request: CheckPath.Request) -> tuple[Kind, int]:
    """Return what decides how much a box and a waypoint cost, and how many there are."""
    pairs = len(request.pairs)
    return ((pairs > 0, request.clearance, request.last_poses),
            (len(request.boxes) + pairs) * len(request.waypoints))

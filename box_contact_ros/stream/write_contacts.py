# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Ticks of poses → the bytes of messages: points, normals, and `Contacts` of all pairs."""
from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..core import native
from ..scene.scene_solver import SceneSolver
from .pairing import TickPoses, check_frames
from .streams import ALL_BOXES

Written = tuple[bytes, list[tuple[Any, bytes, bytes]], int, list[tuple[int, int]]]
"""The message of all contacts; the topics of pairs in contact, with their point and normal; how
many pairs are in contact; the boxes of stale pairs, as `Answer.stale` has them."""


class TickWriter:
    """Answers the ticks of one scene, each in one call of the core (write_contacts.hpp)."""

    def __init__(self, solver: SceneSolver, topics: Mapping[tuple[str, str], Any],
                 epoch: int = 0) -> None:
        """Take what solves the scene, and whatever stands for the topics of pairs of boxes.

        epoch: of the configuration of a node.
        """
        self.solver, scene = solver, solver.scene
        self._streams = (ALL_BOXES,) if scene.in_one_message else solver.moving
        place, index = {name: number for number, name in enumerate(self._streams)}, scene.index_of
        known = {pair: topic for pair, topic in topics.items() if scene.boxes.keys() >= set(pair)}
        watched = [(*map(index.__getitem__, pair),
                    *(place.get(scene.mover(box), -1) for box in pair)) for pair in known]
        self._write = native.TickWriter(
            *solver._parts(), scene.names, scene.rows, tuple(pair.label for pair in scene.pairs),
            np.array(watched, np.int64).reshape(-1, 4), tuple(known.values()), scene.frame_id,
            epoch, solver.revision)

    def __call__(self, poses: TickPoses) -> Written:
        """Return what is published of a tick; ValueError: it is refused.

        Points and normals have the newer stamp of their pair, all contacts that of the tick.
        """
        written: Written | None = self._write(poses)
        if written is None:
            check_frames(self.solver.scene, self._streams, poses)
            numbers: list[Any] = [pose and pose.numbers for pose in poses]
            self.solver(numbers[0] if self.solver.scene.in_one_message else numbers)
        assert written is not None
        return written

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A question about a few boxes, with their poses, among the fixed boxes of a scene.

A guest is a box of a question that the scene does not know. It is box A of its pairs with boxes of
the scene, and of those with later guests. Moving boxes of the scene that a question does not name
are absent.
"""
from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from ..core import LENGTH_MAX, LENGTH_MIN, native
from ..solver.checks import are_poses, name_fault, nearest_name, pose_fault, short_repr, size_fault
from ..solver.contact import Contacts
from ..solver.contact_solver import ContactSolver
from .scene_solver import SceneSolver

MOST_BOXES = 256
MOST_PAIRS = 4096
"""Pairs that a question may list."""
KEPT_MARGINS = 4  # of the last questions, each with a broad phase
Row = tuple[float, ...]  # numbers of one box
NO_POSE: Row = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
"""Pose of a new message: of a fixed box, only the name is given."""


class SceneCheck:
    """Answers questions on the model of a `SceneSolver`, and keeps nothing of them.

    In its arrays, the first MOST_BOXES rows are guests, and the boxes of the scene follow.
    """

    def __init__(self, solver: SceneSolver, *, most_near: int) -> None:
        """Take scene and model; most_near: pairs that one question may leave to the model."""
        self.solver, self._scene = solver, solver.scene
        self.most_near = most_near
        scene = self._scene
        self._names = ['' for _ in range(MOST_BOXES)] + list(scene.names)
        self._size_of = [tuple(box.size) for box in scene.boxes.values()]
        self._sizes = np.concatenate((np.ones((MOST_BOXES, 3)), self._size_of))
        fixed_poses = scene.fixed_poses()[:len(scene.boxes)]
        self._fixed = {name: tuple(pose) for name, is_fixed, pose in zip(
            scene.names, scene.is_fixed, fixed_poses.tolist()) if is_fixed}
        self._poses = np.concatenate((np.full((MOST_BOXES, 7), np.nan), fixed_poses))
        self._is_fixed = np.concatenate((np.zeros(MOST_BOXES, bool), scene.is_fixed))
        self._made_for = lru_cache(KEPT_MARGINS)(self._make)

    def _make(self, margin: float) -> tuple[native.BroadPhase, ContactSolver]:
        """Return what finds the pairs up to a separation [m], and what solves them."""
        group, allowed = self._scene.groups
        count = max(1, len(allowed))
        meets = np.zeros((count + 1, count + 1), np.uint8)
        meets[0] = 1  # guests come first, and meet everything
        meets[1:1 + len(allowed), 1:1 + len(allowed)] = allowed
        groups = np.concatenate((np.zeros(MOST_BOXES, np.int32), group + 1)).astype(np.int32)
        bodies = np.concatenate((np.full(MOST_BOXES, -1, np.int32), self._scene.body_of))
        return (native.BroadPhase(self._sizes, self._is_fixed, margin,
                                  self._scene.rows + MOST_BOXES, groups, meets, bodies),
                ContactSolver(model=self.solver.model, margin=margin))

    def __call__(self, names: Sequence[str], poses: Sequence[Row], sizes: Sequence[Row],
                 pairs: Sequence[tuple[str, str]] = (), margin: float = 0.0,
                 ) -> tuple[np.ndarray, Contacts]:
        """Return boxes a and b (k, 2) of the pairs in contact, or apart by margin [m] at most.

        names, poses (n, 7), sizes (n, 3): of the boxes of a question. A size of zeros is that of
        the scene's box. A box that is fixed in the scene has NO_POSE, or the scene's.
        pairs: those that are asked for. Without, the scene's pairs of these boxes are. Guests meet
        all boxes of the question and all fixed ones. `names_of` tells the names of the answer.
        Raises ValueError, with field and value, for what is refused.
        """
        if not 0.0 <= margin <= LENGTH_MAX:
            raise ValueError(f'margin must lie within 0 and {LENGTH_MAX:g} m, not {margin:g}')
        broad_phase, solver = self._made_for(margin)
        rows = self._rows(names, poses, sizes)
        moving = rows[~self._is_fixed[rows]]
        try:
            if pairs:
                places = self._places(names, rows, pairs)
            else:
                broad_phase.resize(moving, self._sizes[moving])
                places = broad_phase.find(self._poses, self.most_near)[0]
            if len(places) > self.most_near:
                raise ValueError(f'pairs: more than {self.most_near} are asked for and near, and '
                                 "the node's model answers no more per request: name those that "
                                 'matter')
            contacts = solver.batch(self._poses, sizes=self._sizes, pairs=places)
        finally:
            self._poses[moving] = np.nan
        listed = contacts.separation <= margin if margin else contacts.colliding
        found = np.flatnonzero(listed)
        found = found[np.argsort(~contacts.colliding[found], kind='stable')]
        return places[found], contacts[found]

    def names_of(self, a: int, b: int) -> tuple[str, str, str]:
        """Return the name of a pair of the last answer, and those of its boxes."""
        name_a, name_b = self._names[a], self._names[b]
        if min(a, b) < MOST_BOXES:
            return f'{name_a}_{name_b}', name_a, name_b
        return self._scene.pair_of(a - MOST_BOXES, b - MOST_BOXES).label, name_a, name_b

    def _rows(self, names: Sequence[str], poses: Sequence[Row], sizes: Sequence[Row]) -> np.ndarray:
        """Take the boxes of a question; return their rows."""
        if not 1 <= len(names) <= MOST_BOXES:
            raise ValueError(f'boxes: a request has 1 to {MOST_BOXES} boxes, not {len(names)}')
        first: dict[str, int] = {}
        rows, all_poses, all_sizes = [], list(poses), list(sizes)
        for number, name in enumerate(names):
            where = f'boxes[{number}]'
            if fault := name_fault(name):
                raise ValueError(f'{where}.name: {fault}')
            if first.setdefault(name, number) != number:
                raise ValueError(f'{where}: {short_repr(name)} is the name of '
                                 f'boxes[{first[name]}], too')
            index = self._scene.index_of.get(name)
            if index is None:
                self._names[number] = name
                rows.append(number)
                if not any(all_sizes[number]):
                    raise ValueError(f'{where} {short_repr(name)} has no size, and is no box of '
                                     f'the scene{nearest_name(name, self._scene.boxes)}')
                continue
            rows.append(MOST_BOXES + index)
            known, fixed = self._size_of[index], self._fixed.get(name)
            if not any(all_sizes[number]):
                all_sizes[number] = known
            if fixed is not None:
                for what, value, unset, own in (
                        ('pose', poses[number], NO_POSE, fixed),
                        ('size', sizes[number], (0.0, 0.0, 0.0), known)):
                    if value not in (unset, own):
                        raise ValueError(f'{where} {short_repr(name)} is fixed in the scene with '
                                         f'{what} {short_repr(own)}, not {short_repr(value)}: '
                                         f'leave its {what} as a new message has it')
                all_poses[number] = fixed
        pose_rows, size_rows = np.array(all_poses), np.array(all_sizes)
        if not (are_poses(pose_rows).all() and np.all(
                (size_rows >= LENGTH_MIN) & (size_rows <= LENGTH_MAX))):
            for number, (pose, size) in enumerate(zip(pose_rows, size_rows)):
                if fault := pose_fault(pose) or size_fault(size):
                    raise ValueError(f'boxes[{number}] {short_repr(names[number])}: {fault}')
        taken = np.array(rows)
        self._poses[taken], self._sizes[taken] = pose_rows, size_rows
        return taken

    def _places(self, names: Sequence[str], rows: np.ndarray, pairs: Sequence[tuple[str, str]],
                ) -> np.ndarray:
        """Return the rows (n, 2) of pairs that are listed by names."""
        if len(pairs) > MOST_PAIRS:
            raise ValueError(f'pairs: a request has at most {MOST_PAIRS}, not {len(pairs)}')
        row_of = dict(zip(names, rows.tolist()))
        for number, (a, b) in enumerate(pairs):
            for side, name in (('box_a', a), ('box_b', b)):
                if name in row_of:
                    continue
                row = MOST_BOXES + self._scene.index_of.get(name, -1)
                if row < MOST_BOXES or not self._is_fixed[row]:
                    raise ValueError(f'pairs[{number}].{side}: {short_repr(name)} is neither a box '
                                     'of the request nor a fixed box of the scene'
                                     f'{nearest_name(name, {*row_of, *self._scene.boxes})}')
                row_of[name] = row
            if a == b:
                raise ValueError(f'pairs[{number}]: {short_repr(a)} is both box_a and box_b')
        return np.array([(row_of[a], row_of[b]) for a, b in pairs])

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A question about a few boxes and bodies, with their poses, among the fixed boxes of a scene.

A guest is a box of a question that the scene does not know. It is box A of its pairs with boxes of
the scene, and of those with later guests. Moving boxes and bodies that a question does not name are
absent, or stand where they were last.
"""
from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from functools import cached_property, lru_cache
from itertools import islice, product

import numpy as np

from ..core import native
from ..solver.checks import (
    TooMuch,
    as_margin,
    name_fault,
    nearest_name,
    pose_fault,
    short_repr,
    size_fault,
)
from ..solver.contact_solver import ContactSolver
from ..solver.contacts_of import Found, touching_and_near
from .path import Found as PathFound
from .path import as_path, check_course, moved_boxes
from .rides import Course, Surroundings
from .scene_solver import SceneSolver

MOST_BOXES = 256
MOST_PAIRS = 4096
"""Pairs that a question may list."""
MOST_LEFT_OUT = 64  # names that an answer tells
KEPT_MARGINS = 4  # of the last questions, each with a broad phase
Row = tuple[float, ...]  # numbers of one box
NO_POSE: Row = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
NO_SIZE: Row = (0.0, 0.0, 0.0)
"""Pose and size of a new message: of a fixed box, only the name is given."""
A_BODY = A_GUEST = (1.0, 1.0, 1.0)  # instead of the size of a body, or of a guest that is absent


class SceneCheck:
    """Answers questions on the model of a `SceneSolver`, and keeps nothing of them.

    In its arrays, the first MOST_BOXES rows are guests. The boxes of the scene follow, and in that
    of the poses its bodies.
    """

    def __init__(self, solver: SceneSolver, *, most_near: int) -> None:
        """Take scene and model; most_near: pairs that one question may leave to the model."""
        self.solver, self._scene, self.most_near = solver, solver.scene, most_near
        scene = self._scene
        self._guests = ['' for _ in range(MOST_BOXES)]  # their names
        self._sizes = np.concatenate((np.broadcast_to(A_GUEST, (MOST_BOXES, 3)), scene.sizes))
        self._asked_sizes: dict[int, Row] = {}
        """Sizes by row, where a question had others than the scene."""
        self._rows = np.concatenate((np.full((MOST_BOXES, 7), np.nan), scene.fixed_poses()))
        self._poses = self._rows[:len(self._sizes)]
        self._body_of = np.concatenate((np.full(MOST_BOXES, -1), scene.body_of)).astype(np.int32)
        self._is_fixed = np.concatenate((np.zeros(MOST_BOXES, bool), scene.is_fixed))
        self._by_margin: dict[float, tuple[native.BroadPhase, ContactSolver]] = {}
        self._label_of = lru_cache(MOST_PAIRS)(lambda a, b: scene.pair_of(a, b).label)

    def _made_for(self, margin: float) -> tuple[native.BroadPhase, ContactSolver]:
        """Return what finds the pairs up to a separation [m], and what solves them."""
        if margin in self._by_margin:
            return self._by_margin[margin]
        if len(self._by_margin) == KEPT_MARGINS:
            self._by_margin.pop(next(iter(self._by_margin)))
        made = self._by_margin[margin] = (
            native.BroadPhase(self._sizes, self._is_fixed, margin, self._scene.rows + MOST_BOXES,
                              *self._groups, self._body_of),
            ContactSolver(model=self.solver.model, margin=margin))
        return made

    @cached_property
    def _groups(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the group of each row, and which groups meet, as `Scene.groups`."""
        group, allowed = self._scene.groups
        count = max(1, len(allowed))
        meets = np.zeros((count + 1, count + 1), np.uint8)
        meets[0] = 1  # guests come first, and meet everything
        meets[1:1 + len(allowed), 1:1 + len(allowed)] = allowed
        return np.concatenate((np.zeros(MOST_BOXES), group + 1)).astype(np.int32), meets

    def __call__(self, names: Sequence[str], poses: Sequence[Row], sizes: Sequence[Row],
                 pairs: Sequence[tuple[str, str]] = (), margin: float = 0.0,
                 last: Mapping[str, Row] | None = None) -> tuple[Found, np.ndarray]:
        """Return which boxes touch, and which are apart by the distance `margin` [m] at most.

        names, poses (n, 7), sizes (n, 3): of the boxes and bodies of a question. A size of zeros is
        that of the scene's box; bodies have no other. What is fixed in the scene has NO_POSE, or
        the scene's.
        pairs: those that are asked for. Without, the scene's pairs of these boxes are. Guests meet
        all boxes of the question and all fixed ones. `names_of` tells the names of the answer.
        last: poses of what else moves, by name; it takes part like what is fixed.
        With it come the areas (k,) by which the faces of what touches meet [m²].
        Raises ValueError, with field and value, for what is refused.
        """
        margin = as_margin(margin)
        broad_phase, solver = self._made_for(margin)
        rows, moving = self._take(names, poses, sizes, last or {})
        try:
            self._place_bodies()
            if pairs:
                places = self._places(rows, pairs)
            else:
                places = broad_phase.find(self._poses, self.most_near)[0]
                if last:
                    stands = self._stands(names)
                    places = places[~stands[places].all(axis=1)]
            if len(places) > self.most_near:
                raise TooMuch(f'pairs: more than {self.most_near} are asked for and near, and '
                              "the node's model answers no more per request: name those that "
                              'matter')
            contacts = solver.batch(self._poses, sizes=self._sizes, pairs=places)
            found = touching_and_near(places, contacts, solver, self._sizes, self._poses, margin)
            areas = native.face_areas(self._sizes, self._poses, found.pairs)
        finally:
            native.write_poses(self._rows, moving, [None] * len(moving))
            self._place_bodies()
        return found, areas

    def path(self, names: Sequence[str], path: np.ndarray, sizes: Sequence[Row],
             pairs: Sequence[tuple[str, str]] = (), clearance: float = 0.0,
             last: Mapping[str, Row] | None = None) -> Generator[None, None, PathFound]:
        """Return, in steps, what the boxes, bodies and guests of a question meet on a path.

        No other question comes between. path: poses (m, n, 7) by names. sizes, pairs, last: as of
        a question without a path. What is fixed cannot be named.
        Raises ValueError, with field and value, for what is refused.
        """
        scene = self._scene
        path = as_path(path, names, 'waypoints')
        for number, name in enumerate(names):
            if self._fixed_pose(name) is not None:
                raise ValueError(f'boxes[{number}] {short_repr(name)} is fixed in the scene')
        rows, moving = self._take(names, path[0].tolist(), sizes, last or {})
        try:
            self._place_bodies()
            listed = self._places(rows, pairs) if pairs else scene.rows + MOST_BOXES
            stands, around = self._is_fixed, self.solver.around
            if last:
                stands = self._stands(names) & ~np.isnan(self._poses[:, 0])
                around = Surroundings(self._sizes[stands], self._poses[stands])
            standing = np.where(stands[:, None], self._poses, np.nan)
        finally:
            native.write_poses(self._rows, moving, [None] * len(moving))
            self._place_bodies()
        known = np.array([name in scene.row_of for name in names])
        placed = np.array([rows[name] for name in names])
        boxes, poses, centres = moved_boxes(scene, placed[known] - MOST_BOXES, path[:, known])
        group, meets = self._groups
        guests = placed[~known]
        return (yield from check_course(Course(
            self._sizes, standing, np.concatenate((guests, MOST_BOXES + boxes)),
            np.concatenate((path[:, ~known], poses), axis=1),
            np.concatenate((np.zeros((len(guests), 3)), centres)),
            np.where(stands, 0, np.concatenate((-1 - np.arange(MOST_BOXES), scene.rigid))),
            listed, group, meets[:0, :0] if pairs else meets, around,
            np.flatnonzero(stands)), clearance))

    def left_out(self, names: Sequence[str], last: Mapping[str, Row]) -> tuple[int, list[str]]:
        """Return how many boxes and bodies that move a question leaves out, and the first names."""
        given = self._movers.intersection([*names, *last])
        others = (name for name in self._scene.moving if name not in given)
        return len(self._movers) - len(given), list(islice(others, MOST_LEFT_OUT))

    @cached_property
    def _movers(self) -> frozenset[str]:
        """Names of the boxes and bodies that move."""
        return frozenset(self._scene.moving)

    def _stands(self, names: Sequence[str]) -> np.ndarray:
        """Return which rows (n,) of boxes are not those that a question names."""
        scene = self._scene
        stands = np.arange(len(self._sizes)) >= MOST_BOXES
        named = [scene.row_of[name] for name in names if name in scene.row_of]
        boxes = np.isin(np.where(scene.body_of < 0, np.arange(len(scene.boxes)),
                                 len(scene.boxes) + scene.body_of), named)
        stands[MOST_BOXES:] = scene.is_fixed | ~boxes
        return stands

    def names_of(self, a: int, b: int) -> tuple[str, str, str]:
        """Return the name of a pair of the last answer, and those of its boxes."""
        name_a, name_b = (self._guests[row] if row < MOST_BOXES else
                          self._scene.names[row - MOST_BOXES] for row in (a, b))
        if min(a, b) < MOST_BOXES:
            return f'{name_a}_{name_b}', name_a, name_b
        return self._label_of(a - MOST_BOXES, b - MOST_BOXES), name_a, name_b

    def _place_bodies(self) -> None:
        """Write the poses of boxes by those of their bodies."""
        if self._scene.bodies:
            self._scene.place_boxes(self._rows[MOST_BOXES:])

    def _take(self, names: Sequence[str], poses: Sequence[Row], sizes: Sequence[Row],
              last: Mapping[str, Row]) -> tuple[dict[str, int], np.ndarray]:
        """Take the poses and sizes of a question, and the last poses of what else moves.

        Returns the row of each name, and the rows (k,) of what moves.
        """
        if not 1 <= len(names) <= MOST_BOXES:
            raise (ValueError if not names else TooMuch)(
                f'boxes: a request has 1 to {MOST_BOXES} boxes, not {len(names)}')
        rows: dict[str, int] = {}
        moved: dict[int, Row] = {}  # poses by row
        resized: dict[int, Row] = {}  # sizes by row, where they differ from those before
        for number, (name, pose, size) in enumerate(zip(names, poses, sizes)):
            if fault := name_fault(name):
                raise ValueError(f'boxes[{number}].name: {short_repr(name)} {fault}')
            if name in rows:
                raise ValueError(f'boxes[{number}]: {short_repr(name)} is the name of '
                                 f'boxes[{names.index(name)}], too')
            try:
                pose, size = self._of_scene(name, pose, size)
            except ValueError as error:
                raise ValueError(f'boxes[{number}] {short_repr(name)} {error}') from None
            if fault := pose_fault(pose) or size_fault(size):
                raise ValueError(f'boxes[{number}] {short_repr(name)}: {fault}')
            known = self._scene.row_of.get(name)
            row = rows[name] = number if known is None else MOST_BOXES + known
            if known is None:
                self._guests[number] = name
            if self._fixed_pose(name) is None:
                moved[row] = pose
                if row < len(self._sizes) and size != self._size_at(row):
                    resized[row] = size
        for name in self._movers.intersection(last).difference(rows):
            row = rows[name] = MOST_BOXES + self._scene.row_of[name]
            moved[row] = last[name]
        if resized:
            self._resize(resized)
        moving = np.array(list(moved), np.int64)
        native.write_poses(self._rows, moving, list(moved.values()))
        return rows, moving

    def _size_at(self, row: int) -> Row:
        """Return the size of the box of a row, as the last question had it."""
        known = A_GUEST if row < MOST_BOXES else self._size_of(self._scene.names[row - MOST_BOXES])
        return self._asked_sizes.get(row, known or A_BODY)

    def _size_of(self, name: str) -> Row | None:
        """Return the size of a box of the scene, None for another name."""
        box = self._scene.boxes.get(name)
        return tuple(box.size) if box else None

    def _fixed_pose(self, name: str) -> Row | None:
        """Return the pose of a box or body that is fixed in the scene, None for another name."""
        scene = self._scene
        row = scene.row_of.get(name)
        if row is None or not (scene.bodies[name].pose is not None if name in scene.bodies else
                               scene.is_fixed[row]):
            return None
        return tuple(self._rows[MOST_BOXES + row].tolist())

    def _resize(self, sizes: dict[int, Row]) -> None:
        """Give boxes other sizes, by their rows."""
        for row, size in sizes.items():
            self._sizes[row] = self._asked_sizes[row] = size
        places, numbers = np.array(list(sizes), np.int64), np.array(list(sizes.values()))
        for broad_phase, _ in self._by_margin.values():
            broad_phase.resize(places, numbers)

    def _of_scene(self, name: str, pose: Row, size: Row) -> tuple[Row, Row]:
        """Return pose and size of a box or body: its own, or those that the scene has.

        Raises ValueError for what contradicts the scene.
        """
        known, fixed = self._size_of(name), self._fixed_pose(name)
        if name in self._scene.bodies:
            if any(size):
                raise ValueError('is a body of the scene, whose boxes have their sizes there')
            known = A_BODY
        elif known is None and not name:
            raise ValueError('is an empty name: a guest needs one')
        elif known is None and not any(size):
            raise ValueError('has no size, and is no box of the scene'
                             f'{nearest_name(name, self._scene.row_of)}')
        elif known is not None and fixed is None and self._scene.boxes[name].body:
            raise ValueError(f'moves with {short_repr(self._scene.boxes[name].body)}: give the '
                             'pose of this body')
        if fixed is not None:
            for what, value, unset, own in (('pose', pose, NO_POSE, fixed),
                                            ('size', size, NO_SIZE, known)):
                if value not in (unset, own):
                    raise ValueError(f'is fixed in the scene with {what} {short_repr(own)}, not '
                                     f'{short_repr(value)}: leave its {what} as a new message has '
                                     'it')
            pose = fixed
        return pose, size if known is None or any(size) else known

    def _places(self, rows: dict[str, int], pairs: Sequence[tuple[str, str]]) -> np.ndarray:
        """Return the rows (n, 2) of pairs that are listed by the names of boxes or bodies."""
        if len(pairs) > MOST_PAIRS:
            raise TooMuch(f'pairs: a request has at most {MOST_PAIRS}, not {len(pairs)}')
        scene = self._scene

        def boxes_of(name: str, field: str) -> list[int]:
            if name in rows and name not in scene.bodies:
                return [rows[name]]
            mover = scene.mover(name) if name in scene.boxes else name
            if not (mover in rows or self._fixed_pose(mover)):
                if name in scene.row_of:
                    raise ValueError(f'{field}: {short_repr(name)} moves, and its pose is not in '
                                     f'the request: add {short_repr(mover)} to boxes')
                raise ValueError(f'{field}: {short_repr(name)} is neither a box of the request nor '
                                 f'of the scene{nearest_name(name, {*rows, *scene.row_of})}')
            if name in scene.bodies:
                body = list(scene.bodies).index(name)
                return [int(row) for row in MOST_BOXES + np.flatnonzero(scene.body_of == body)]
            return [MOST_BOXES + scene.index_of[name]]

        places: list[tuple[int, int]] = []
        for number, (a, b) in enumerate(pairs):
            if a == b:
                raise ValueError(f'pairs[{number}]: {short_repr(a)} is both box_a and box_b')
            boxes_a, boxes_b = (boxes_of(name, f'pairs[{number}].{side}')
                                for name, side in ((a, 'box_a'), (b, 'box_b')))
            if -1 != self._body_of[boxes_a[0]] == self._body_of[boxes_b[0]]:
                raise ValueError(f'pairs[{number}]: {short_repr(a)} and {short_repr(b)} are of '
                                 'one body, whose boxes are never a pair')
            places += product(boxes_a, boxes_b)
        return np.array(places)

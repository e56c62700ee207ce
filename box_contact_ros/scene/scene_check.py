# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A question about a few boxes and bodies, with their poses, among the fixed boxes of a scene.

A guest is a box of a question that the scene does not know. It is box A of its pairs with boxes of
the scene; of two guests, the one whose name comes first is. Moving boxes and bodies that a question
does not name are absent, or stand where they were last.
"""
from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from functools import cache, cached_property, lru_cache
from itertools import chain, count, islice, product
from typing import NamedTuple

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
from ..solver.contacts_of import Found, joined, touching_and_near
from .path import Found as PathFound
from .path import as_path, moved_boxes, start
from .scene_solver import SceneSolver

MOST_BOXES = 256
MOST_PAIRS = 4096
"""Pairs that a question may list."""
MOST_ON_PATH = 1 << 15
"""Boxes, also those of bodies, at all poses of a path."""
MOST_LOOKS = 1 << 20
"""At pairs that are near each other on a path: some seconds of work."""
MOST_LEFT_OUT = 64  # names that an answer tells
KEPT_SOLVERS = 8  # by margins
LISTED = 4  # is added to the side of a listed pair
MOST_FOUND = 1 << 17
"""Boxes whose bounds are near those of a question: some milliseconds, and megabytes."""
SOLVED = 2048
"""Pairs that one step solves: in a millisecond."""
Row = tuple[float, ...]  # numbers of one box
Pose = Sequence[float] | np.ndarray  # (7,)
NO_POSE: Row = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
NO_SIZE: Row = (0.0, 0.0, 0.0)
"""Pose and size of a new message: of a fixed box, only the name is given."""


class Question(NamedTuple):
    """The boxes of a question that move, those of bodies among them.

    A number is an index in the scene; guests have those behind all boxes.
    """

    movers: dict[str, int]  # names of boxes, bodies and guests that move, and their rows
    guests: dict[str, int]  # their numbers
    poses: np.ndarray  # (k, 7) of the movers
    numbers: np.ndarray  # (n,) of the boxes
    sizes: np.ndarray  # (n, 3)
    of: np.ndarray  # (n,) which mover moves each box


class SceneCheck:
    """Answers questions on the model of a `SceneSolver`, and keeps nothing of them."""

    def __init__(self, solver: SceneSolver, *, most_near: int) -> None:
        """Take scene and model; most_near: pairs that one question may leave to the model."""
        self.solver, self._scene, self.most_near = solver, solver.scene, most_near
        self._fixed = self._scene.fixed_poses()
        self._solver_of = lru_cache(KEPT_SOLVERS)(
            lambda margin: ContactSolver(model=solver.model, margin=margin))
        self._label_of = lru_cache(MOST_PAIRS)(lambda a, b: self._scene.pair_of(a, b).label)

    def __call__(self, names: Sequence[str], poses: Sequence[Row], sizes: Sequence[Row],
                 pairs: Sequence[tuple[str, str]] = (), margin: float = 0.0,
                 last: Mapping[str, Pose] | None = None,
                 ) -> Generator[None, None, tuple[Found, np.ndarray]]:
        """Return, in steps, which boxes touch, and which are apart by the margin [m] at most.

        names, poses (n, 7), sizes (n, 3): of the boxes and bodies of a question. A size of zeros is
        that of the scene's box; bodies have no other. What is fixed in the scene has NO_POSE, or
        the scene's.
        pairs: those that are asked for. Without, the scene's pairs of these boxes are. Guests meet
        all boxes of the question and all fixed ones. `names_of` tells the names of the answer.
        last: poses of what else moves, by name; it takes part like what is fixed.
        With it come the areas (k,) by which the faces of what touches meet [m²].
        Raises ValueError, with field and value, for what is refused.
        """
        margin, scene = as_margin(margin), self._scene
        asked = self._take(names, poses, sizes)
        standing, beside = self._standing(asked, last or {})
        box_poses = moved_boxes(scene, asked.numbers, asked.of, asked.poses[None])[0][0]
        if pairs:
            rows, others = self._rows_of(asked, self._places(asked, pairs, last or {}))
        else:
            rows, others = self._near(asked, box_poses, beside, margin)
        if len(rows) > self.most_near:
            raise TooMuch(f'pairs: more than {self.most_near} are asked for and near, and '
                          "the node's model answers no more per request: name those that "
                          'matter')
        found, areas = yield from self._solved(
            np.concatenate((asked.sizes, scene.sizes[others])),
            np.concatenate((box_poses, standing[others])), rows, margin)
        number = np.concatenate((asked.numbers, others))
        return found._replace(pairs=number[found.pairs],
                              near_pairs=number[found.near_pairs]), areas

    def _near(self, asked: Question, poses: np.ndarray, beside: native.Index | None,
              margin: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the scene's pairs (l, 2) that may be within a margin, and other boxes (m,).

        A pair has rows: those of the question's boxes, and behind them of the others.
        """
        scene, numbers = self._scene, asked.numbers
        own = native.Index(asked.sizes, poses).near(asked.sizes, poses, margin, MOST_FOUND)
        parts, others = [own[own[:, 0] < own[:, 1]]], [numbers]
        for index in filter(None, (self.solver.index, beside)):
            found = index.near(asked.sizes, poses, margin, MOST_FOUND)
            others.append(found[:, 1].copy())
            first = sum(map(len, others[:-1]))
            found[:, 1] = np.arange(first, first + len(found))
            parts.append(found)
        if len(own) > MOST_FOUND or max(map(len, parts)) > MOST_FOUND:
            raise TooMuch(f'margin: more than {MOST_FOUND} boxes are within {margin:g} m of those '
                          'of the request: ask for fewer boxes, or a smaller margin')
        rows, number = np.concatenate(parts), np.concatenate(others)
        sides = scene.filter.sides(number[rows])
        rows, sides = rows[sides > 0], sides[sides > 0]
        rows = np.where((sides & 2 > 0)[:, None], rows[:, ::-1], rows)
        # Listed ones first, then guests in their order, then by the lower and the higher number.
        rank = number.copy()
        if asked.guests:
            rank[rank >= len(scene.boxes)] = np.arange(-len(asked.guests), 0)
        rank_a, rank_b = rank[rows].T
        order = np.lexsort((np.maximum(rank_a, rank_b), np.minimum(rank_a, rank_b), sides < LISTED))
        return rows[order], number[len(numbers):]

    def _rows_of(self, asked: Question, pairs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the rows (l, 2) of pairs of numbers (l, 2), as `_near` has them, and others."""
        own = len(asked.numbers)
        row = np.full(len(self._scene.boxes) + len(asked.guests), -1)
        row[asked.numbers] = np.arange(own)
        others = np.unique(pairs[row[pairs] < 0])
        row[others] = own + np.arange(len(others))
        return row[pairs], others

    def _solved(self, sizes: np.ndarray, poses: np.ndarray, rows: np.ndarray, margin: float,
                ) -> Generator[None, None, tuple[Found, np.ndarray]]:
        """Return what pairs (l, 2) of boxes find, and the areas of what touches, in steps."""
        solver, parts = self._solver_of(margin), []
        for first in range(0, max(1, len(rows)), SOLVED):
            some = rows[first:first + SOLVED]
            contacts = solver.batch(poses, sizes=sizes, pairs=some)
            found = touching_and_near(some, contacts, solver, sizes, poses, margin)
            parts.append((found, native.face_areas(sizes, poses, found.pairs)))
            if first + SOLVED < len(rows):
                yield
        return joined([found for found, _ in parts]), np.concatenate([areas for _, areas in parts])

    def path(self, names: Sequence[str], path: np.ndarray, sizes: Sequence[Row],
             pairs: Sequence[tuple[str, str]] = (), clearance: float = 0.0,
             last: Mapping[str, Pose] | None = None) -> Generator[None, None, PathFound]:
        """Return, in steps, what the boxes, bodies and guests of a question meet on a path.

        path: poses (m, n, 7) by names. sizes, pairs, last: as of a question without a path. What is
        fixed cannot be named.
        Raises ValueError, with field and value, for what is refused.
        """
        scene = self._scene
        path = as_path(path, names, 'waypoints')
        for number, name in enumerate(names):
            if self._fixed_pose(name) is not None:
                raise ValueError(f'boxes[{number}] {short_repr(name)} is fixed in the scene')
        asked = self._take(names, path[0].tolist(), sizes)
        if len(asked.numbers) * len(path) > MOST_ON_PATH:
            raise TooMuch(f'waypoints: {len(asked.numbers)} boxes at {len(path)} waypoints are '
                          f'more than {MOST_ON_PATH} in all: ask for fewer')
        _, beside = self._standing(asked, last or {})
        wanted = scene.filter
        if pairs:
            places = self._places(asked, pairs, last or {})
            alone = np.full(len(scene.boxes) + len(asked.guests), -1, np.int32)
            wanted = native.Filter(places, alone, np.zeros((0, 0), np.uint8), alone, alone)
        poses, centres = moved_boxes(scene, asked.numbers, asked.of, path)
        return (yield from start(asked.sizes, poses, centres, asked.numbers, self.solver.index,
                                 beside, wanted, clearance, most_pairs=MOST_PAIRS,
                                 most_looks=MOST_LOOKS))

    def left_out(self, names: Sequence[str], last: Mapping[str, Pose]) -> tuple[int, list[str]]:
        """Return how many boxes and bodies that move a question leaves out, and the first names."""
        given = self._movers.intersection([*names, *last])
        others = (name for name in self._scene.moving if name not in given)
        return len(self._movers) - len(given), list(islice(others, MOST_LEFT_OUT))

    @cached_property
    def _movers(self) -> frozenset[str]:
        """Names of the boxes and bodies that move."""
        return frozenset(self._scene.moving)

    def guests(self, names: Sequence[str]) -> list[str]:
        """Return the names of the guests of a question, as they are numbered."""
        return sorted(name for name in names if name not in self._scene.row_of)

    def names_of(self, a: int, b: int, guests: Sequence[str]) -> tuple[str, str, str]:
        """Return the name of a pair of an answer, and those of its boxes."""
        scene, known = self._scene, len(self._scene.boxes)
        name_a, name_b = (guests[box - known] if box >= known else scene.names[box]
                          for box in (a, b))
        is_known = max(a, b) < known
        return self._label_of(a, b) if is_known else f'{name_a}_{name_b}', name_a, name_b

    def _take(self, names: Sequence[str], poses: Sequence[Row], sizes: Sequence[Row]) -> Question:
        """Take the poses and sizes of a question."""
        if not 1 <= len(names) <= MOST_BOXES:
            raise (ValueError if not names else TooMuch)(
                f'boxes: a request has 1 to {MOST_BOXES} boxes, not {len(names)}')
        scene = self._scene
        guests = {name: 0 for name in names if name not in scene.row_of}
        guests.update(zip(sorted(guests), count(len(scene.boxes))))
        seen, movers = set(), dict[str, int]()
        moved: list[Row] = []
        numbers: list[int] = []
        extents: list[Sequence[float]] = []
        of: list[int] = []
        for number, (name, pose, size) in enumerate(zip(names, poses, sizes)):
            if fault := name_fault(name):
                raise ValueError(f'boxes[{number}].name: {short_repr(name)} {fault}')
            if name in seen:
                raise ValueError(f'boxes[{number}]: {short_repr(name)} is the name of '
                                 f'boxes[{names.index(name)}], too')
            seen.add(name)
            try:
                pose, size = self._of_scene(name, pose, size)
            except ValueError as error:
                raise ValueError(f'boxes[{number}] {short_repr(name)} {error}') from None
            is_body = name in scene.bodies
            if fault := pose_fault(pose) or (None if is_body else size_fault(size)):
                raise ValueError(f'boxes[{number}] {short_repr(name)}: {fault}')
            if self._fixed_pose(name) is not None:
                continue
            mover = movers[name] = len(movers)
            moved.append(pose)
            boxes = [guests[name]] if name in guests else self._boxes_of(name)
            numbers += boxes
            extents += scene.sizes[boxes].tolist() if is_body else [size]
            of += [mover] * len(boxes)
        return Question(movers, guests, np.array(moved).reshape(-1, 7),
                        np.array(numbers, np.int64), np.array(extents).reshape(-1, 3),
                        np.array(of, np.int64))

    def _boxes_of(self, name: str) -> list[int]:
        """Return the indices of the boxes of a box or body of the scene."""
        scene = self._scene
        if name not in scene.bodies:
            return [scene.index_of[name]]
        body = scene.row_of[name] - len(scene.boxes)
        boxes: list[int] = np.flatnonzero(scene.body_of == body).tolist()
        return boxes

    def _standing(self, asked: Question, last: Mapping[str, Pose],
                  ) -> tuple[np.ndarray, native.Index | None]:
        """Return the poses (n, 7) of what stands, and an index of what stands where it was last."""
        scene = self._scene
        names = [name for name in self._movers.intersection(last) if name not in asked.movers]
        if not names:
            return self._fixed[:len(scene.boxes)], None
        rows = self._fixed.copy()
        rows[[scene.row_of[name] for name in names]] = [last[name] for name in names]
        scene.place_boxes(rows)
        standing = rows[:len(scene.boxes)]
        beside = np.where(scene.is_fixed[:, None], np.nan, standing)
        return standing, native.Index(scene.sizes, beside)

    def _fixed_pose(self, name: str) -> Row | None:
        """Return the pose of a box or body that is fixed in the scene, None for another name."""
        scene = self._scene
        row = scene.row_of.get(name)
        if row is None or not (scene.bodies[name].pose is not None if name in scene.bodies else
                               scene.is_fixed[row]):
            return None
        return tuple(self._fixed[row].tolist())

    def _of_scene(self, name: str, pose: Row, size: Row) -> tuple[Row, Row]:
        """Return pose and size of a box or body: its own, or those that the scene has.

        Raises ValueError for what contradicts the scene.
        """
        box, fixed = self._scene.boxes.get(name), self._fixed_pose(name)
        known = tuple(box.size) if box else None
        if name in self._scene.bodies:
            if any(size):
                raise ValueError('is a body of the scene, whose boxes have their sizes there')
            known = NO_SIZE
        elif known is None and not name:
            raise ValueError('is an empty name: a guest needs one')
        elif known is None and not any(size):
            raise ValueError('has no size, and is no box of the scene'
                             f'{nearest_name(name, self._scene.row_of)}')
        elif box and fixed is None and box.body:
            raise ValueError(f'moves with {short_repr(box.body)}: give the pose of this body')
        if fixed is not None:
            for what, value, unset, own in (('pose', pose, NO_POSE, fixed),
                                            ('size', size, NO_SIZE, known)):
                if value not in (unset, own):
                    raise ValueError(f'is fixed in the scene with {what} {short_repr(own)}, not '
                                     f'{short_repr(value)}: leave its {what} as a new message has '
                                     'it')
            pose = fixed
        return pose, size if known is None or any(size) else known

    def _places(self, asked: Question, pairs: Sequence[tuple[str, str]],
                last: Mapping[str, Pose]) -> np.ndarray:
        """Return the numbers (n, 2) of pairs that are listed by the names of boxes or bodies."""
        if len(pairs) > MOST_PAIRS:
            raise TooMuch(f'pairs: a request has at most {MOST_PAIRS}, not {len(pairs)}')
        scene, of_scene = self._scene, cache(self._boxes_of)

        def boxes_of(name: str, field: str) -> list[int]:
            if name in asked.guests:
                return [asked.guests[name]]
            mover = scene.mover(name) if name in scene.boxes else name
            if not (mover in asked.movers or mover in last or self._fixed_pose(mover)):
                if name in scene.row_of:
                    raise ValueError(f'{field}: {short_repr(name)} moves, and its pose is not in '
                                     f'the request: add {short_repr(mover)} to boxes')
                raise ValueError(
                    f'{field}: {short_repr(name)} is neither a box of the request nor of the scene'
                    f'{nearest_name(name, chain(asked.movers, scene.row_of))}')
            return of_scene(name)

        places: list[tuple[int, int]] = []
        for number, (a, b) in enumerate(pairs):
            if a == b:
                raise ValueError(f'pairs[{number}]: {short_repr(a)} is both box_a and box_b')
            boxes_a, boxes_b = (boxes_of(name, f'pairs[{number}].{side}')
                                for name, side in ((a, 'box_a'), (b, 'box_b')))
            bodies = {int(scene.body_of[boxes[0]]) if boxes[0] < len(scene.boxes) else -1
                      for boxes in (boxes_a, boxes_b)}
            if len(bodies) == 1 and bodies != {-1}:
                raise ValueError(f'pairs[{number}]: {short_repr(a)} and {short_repr(b)} are of '
                                 'one body, whose boxes are never a pair')
            if len(places) + len(boxes_a) * len(boxes_b) > self.most_near:
                raise TooMuch(f'pairs[{number}]: the boxes of these bodies are more than '
                              f'{self.most_near} pairs: name those that matter')
            places += product(boxes_a, boxes_b)
        return np.array(places, np.int64).reshape(-1, 2)

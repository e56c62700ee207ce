# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What one tick of a scene computes.

`Movers` of the core find the pairs whose bounding boxes meet. These go through the solver as one
batch. An answer is arrays, in which a box is its index in the scene. Names are made where
somebody asks for them.
"""
from __future__ import annotations

import sys
from collections.abc import Callable, Collection, Generator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..core import native
from ..solver.checks import absent_poses, as_floats, as_margin, as_whole, short_repr
from ..solver.contact import Contact, Contacts
from ..solver.contact_solver import ContactSolver
from ..solver.contacts_of import find_contacts, touching_and_near
from ..solver.model import Model
from ..solver.nearest import Nearests
from ..solver.poses import as_pose
from .boxes import NOWHERE, Box, Frame
from .changes import checked_changes
from .path import PathCheck, as_path, boxes_of, moved_boxes, start
from .scene import Pair, Scene

NO_BODIES = np.zeros(0, np.int64)
"""The bodies of boxes, where a scene has none."""


class Answer(NamedTuple):
    """What one tick found, as arrays. Boxes are their indices in `scene`."""

    pairs: np.ndarray
    """(k, 2) boxes a and b of the pairs in contact: those listed, then the others by index."""
    contacts: Contacts  # (k,)
    near_pairs: np.ndarray
    """(l, 2) pairs apart whose distance is at most the solver's margin, in the same order."""
    near: Nearests  # (l,) their nearest points
    candidates: int  # how many pairs bounding boxes left to the solver
    stale: np.ndarray
    """(m, 2) boxes of the listed pairs that could not be evaluated, because one has no pose that is
    recent enough. (box, ALONE): all pairs of a box that patterns ask for."""
    scene: Scene
    revision: int = 0  # of the scene, as of `SceneSolver.set_boxes`

    @property
    def touching(self) -> int:
        """Return how many pairs are in contact."""
        return len(self.pairs)

    def named(self) -> list[tuple[Pair, Contact]]:
        """Return each pair with its contact, by name."""
        return [(self.scene.pair_of(a, b), contact)
                for (a, b), contact in zip(self.pairs.tolist(), self.contacts)]


class _Revision(NamedTuple):
    """A revision of a scene, and what finds its pairs."""

    scene: Scene
    number: int
    rows: np.ndarray  # (m, 7) poses of boxes and of bodies
    moving_rows: np.ndarray  # (l,) of what moves
    fixed: native.Index
    movers: native.Movers

    @classmethod
    def of(cls, scene: Scene, number: int, margin: float, *, former: native.Index | None = None,
           kept: np.ndarray | None = None) -> _Revision:
        """Begin without poses; kept (n,): indices of boxes in the index of the former revision."""
        rows = scene.fixed_poses()
        index = native.Index(scene.sizes, rows[:len(scene.boxes)], former, kept)
        moving_rows = np.array([scene.row_of[name] for name in scene.moving], np.int64)
        return cls(scene, number, rows, moving_rows, index,
                   native.Movers(scene.sizes, margin, scene.filter, index))

    @property
    def poses(self) -> np.ndarray:
        """(n, 7) of the boxes."""
        return self.rows[:len(self.scene.boxes)]


class SceneSolver:
    """Contacts of all pairs of a scene, one tick at a time.

    Raises ValueError for a model that does not go with the sizes. Remembers which boxes are near
    each other: use one per thread.
    """

    def __init__(self, scene: Scene, *, model: str | Model = 'exact',
                 margin: float = 0.0, most_near: int = sys.maxsize) -> None:
        """Begin without poses.

        margin: up to which distance pairs apart are listed as near [m].
        most_near: pairs that a tick may leave to the model; of more, it raises TooManyNear.
        """
        if not isinstance(scene, Scene):
            raise ValueError(f'scene must be a Scene, not {short_repr(scene)}')
        self.margin = as_margin(margin)
        self._most_near = as_whole(most_near, 'most_near', 0, sys.maxsize)
        self.model = model
        self._solver = ContactSolver(model=model, margin=self.margin)
        self._at = _Revision.of(scene, 0, self.margin)
        self._refuse_sizes(*(np.unique(sizes, axis=0)
                             for sizes in (scene.sizes, scene.sizes[scene.rows].reshape(-1, 6))))
        self([None] * len(self.moving))

    @property
    def scene(self) -> Scene:
        """Return the scene as it is now."""
        return self._at.scene

    @property
    def revision(self) -> int:
        """How often the scene has been changed."""
        return self._at.number

    @property
    def moving(self) -> tuple[str, ...]:
        """Whose poses a call takes, in their order."""
        return self.scene.moving

    def __reduce__(self) -> tuple[Callable[..., SceneSolver], tuple[Any, ...]]:
        """Pickle what makes the solver."""
        return _made_again, (self.scene, self.model, self.margin, self._most_near, self.revision)

    def changing(self, *, fixed: Mapping[str, Box] | None = None,
                 moving: Mapping[str, Box] | None = None, parts: Mapping[str, Box] | None = None,
                 bodies: Mapping[str, Frame] | None = None, absent: Collection[str] = (),
                 ) -> Generator[None, None, SceneSolver]:
        """Return, in steps, the solver of the scene that `set_boxes` makes; this one stays."""
        changes = checked_changes(self.scene, fixed or {}, moving or {}, parts or {}, bodies or {},
                                  absent)
        yield
        scene, kept = self.scene.changed(*changes)
        yield
        later = _Revision.of(scene, self.revision + 1, self.margin, former=self._at.fixed,
                             kept=kept)
        yield
        solver = object.__new__(SceneSolver)
        solver.model, solver.margin, solver._at = self.model, self.margin, later
        solver._most_near, solver._solver = self._most_near, self._solver
        sizes = np.array([box.size for box in changes.boxes.values() if box is not None])
        listed = ([] if scene.listed_names.isdisjoint(changes.boxes) else
                  scene.sizes[scene.rows])
        solver._refuse_sizes(sizes.reshape(-1, 3), np.reshape(listed, (-1, 6)))
        return solver

    def with_model(self, model: str | Model, most_near: int = sys.maxsize) -> SceneSolver:
        """Return a solver of the same scene by another model."""
        return _made_again(self.scene, model, self.margin, most_near, self.revision)

    def set_boxes(self, *, fixed: Mapping[str, Box] | None = None,
                  moving: Mapping[str, Box] | None = None, parts: Mapping[str, Box] | None = None,
                  bodies: Mapping[str, Frame] | None = None, absent: Collection[str] = ()) -> int:
        """Change boxes of the scene, all or none; return the new `revision`.

        fixed: boxes with poses, by name: new ones, or ones that replace those of the scene.
        moving: boxes without poses, which move from now on.
        parts: boxes with a `body` of the scene or of `bodies`, which they become parts of.
        bodies: new ones by name, or ones that start or stop to move.
        absent: names of boxes that are there no more, or of bodies with all their boxes.

        What moves changes with `poses` of the scene 'named' alone. Listed pairs and patterns stay;
        new boxes are in the pairs whose patterns match. A body whose last box goes is gone.
        Raises SceneError, a ValueError with field and value.
        """
        self._at = finished(self.changing(fixed=fixed, moving=moving, parts=parts, bodies=bodies,
                                          absent=absent))._at
        return self.revision

    def _refuse_sizes(self, sizes: np.ndarray, listed: np.ndarray) -> None:
        """Let the model refuse sizes (n, 3), and those of pairs (m, 6), that it cannot answer.

        Only a corner overlaps: where faces coincide, a soup takes seconds.
        """
        if isinstance(self.model, str):  # it is in C++, and answers all sizes
            return
        both = [listed]
        if self.scene.patterns:
            first = np.broadcast_to(self.scene.sizes[0], sizes.shape)
            both += [np.hstack((first, sizes)), np.hstack((sizes, first))]
        size_a, size_b = np.split(np.concatenate(both), 2, axis=1)
        a, b = np.zeros((2, len(size_a), 7))
        a[:, 6] = b[:, 6] = 1.0
        b[:, :3] = 0.5 * (size_a + size_b) - 0.02 * np.minimum(size_a, size_b)
        self._solver.batch(a, b, size_a=np.ascontiguousarray(size_a),
                           size_b=np.ascontiguousarray(size_b))

    def __call__(self, poses: Sequence[np.ndarray | None] | ArrayLike) -> Answer:
        """Return the answer to one tick: a pose (7,) or None for each of `moving`.

        Or an array (n, 7) with a row for each, all NaN for None.
        Raises ValueError for numbers that are no pose, and for more or fewer poses than that.
        """
        self._set_poses(poses)
        if self.scene.bodies:
            self.scene.place_boxes(self._at.rows)
        pairs, contacts, stale = find_contacts(
            self._at.movers, self._solver, self.scene.sizes, self._at.poses,
            lambda box: f'pose of {self.scene.names[box]}:', most_near=self._most_near)
        found = touching_and_near(pairs, contacts, self._solver, self.scene.sizes, self._at.poses,
                                  self.margin)
        return Answer(*found, len(pairs), stale, self.scene, self.revision)

    def check_path(self, poses: ArrayLike, *, clearance: float = 0.0) -> PathCheck:
        """Return what the boxes and bodies that move meet on a path, and how near all else comes.

        poses: (m, n, 7), at each of m times those of `moving`; seven NaN at all times leave one
        out. Between two of them centres, of a body its origin, go on a line, and axes turn the
        shortest way at constant rate.
        clearance: the distance from which on a pair counts [m].

        Times are never late: before them the distance is above the clearance, by proof; at them it
        is at most 1e-6 m more. The pairs are those of a tick. Nothing of a tick changes.
        Raises ValueError for what is not a path, and for a turn by 180 degrees, which has two ways.
        """
        at, scene = self._at, self.scene
        path = as_path(poses, self.moving)
        is_here = ~absent_poses(path[0])
        boxes, of = boxes_of(scene, at.moving_rows[is_here])
        box_poses, centres = moved_boxes(scene, boxes, of, path[:, is_here])
        steps = start(scene.sizes[boxes], box_poses, centres, boxes, at.fixed, None, scene.filter,
                      clearance)
        return PathCheck.of(finished(steps), scene, at.number)

    @property
    def index(self) -> native.Index:
        """Return the index of the fixed boxes."""
        return self._at.fixed

    def _parts(self) -> tuple[native.Movers, ContactSolver, float, int, np.ndarray, np.ndarray,
                              np.ndarray, np.ndarray, np.ndarray]:
        """Return what native.TickWriter answers ticks of the scene by: its first nine arguments."""
        at, scene, solver, sizes = self._at, self.scene, self._solver, self.scene.sizes
        if (sizes[1:] == sizes[:-1]).all():  # model `paper` is in C++ for boxes of one size
            solver = ContactSolver(sizes[0], sizes[0], model=self.model, margin=self.margin)
        bodies = scene.placement if scene.bodies else (NO_BODIES, at.rows[:0])
        return (at.movers, solver, self.margin, self._most_near, sizes, at.rows,
                at.moving_rows, *bodies)

    def _set_poses(self, poses: Sequence[np.ndarray | None] | ArrayLike) -> None:
        """Take the poses of the boxes and bodies that move."""
        rows, moving_rows = self._at.rows, self._at.moving_rows
        if native.write_poses(rows, moving_rows, poses):  # those of every node
            return
        if not isinstance(poses, Sequence) or isinstance(poses, str):
            poses = as_floats(poses, 'poses', 'a list of a pose or None for each box and body that '
                              'moves, or an array (n, 7)', (None, 7))
        if len(poses) != len(moving_rows):
            raise ValueError(f'{len(poses)} poses, but {len(moving_rows)} boxes and bodies move: '
                             f'{short_repr(list(self.moving))}; give a list of a pose or '
                             'None for each')
        if isinstance(poses, np.ndarray):
            rows[moving_rows] = poses
            return
        for name, index, pose in zip(self.moving, moving_rows, poses):
            rows[index] = NOWHERE if pose is None else as_pose(pose, f'pose of {name}')


def finished(steps: Generator[None, None, Any]) -> Any:
    """Return what steps make, after all of them."""
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value


def _made_again(scene: Scene, model: str | Model, margin: float, most_near: int, revision: int,
                ) -> SceneSolver:
    """Return a solver that was pickled."""
    solver = SceneSolver(scene, model=model, margin=margin, most_near=most_near)
    solver._at = _Revision.of(scene, revision, solver.margin)
    return solver

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What one tick of a scene computes.

A broad phase in the core finds the pairs whose bounding boxes meet. These go through the solver as
one batch. An answer is arrays, in which a box is its index in the scene. Names are made where
somebody asks for them.
"""
from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..core import native
from ..solver.checks import as_floats, as_margin, as_whole, short_repr
from ..solver.contact import Contact, Contacts
from ..solver.contact_solver import ContactSolver
from ..solver.contacts_of import find_contacts, in_contact
from ..solver.model import Model
from .scene import NOWHERE, Pair, Scene


class Answer(NamedTuple):
    """What one tick found, as arrays. Boxes are their indices in `scene`."""

    pairs: np.ndarray
    """(k, 2) boxes a and b of the pairs in contact: those listed, then the others by index. Behind
    them, in the same order, the pairs apart whose separation is at most the solver's margin."""
    contacts: Contacts
    """(k,) their contacts; those of pairs apart are not colliding."""
    near: int  # how many pairs the broad phase left to the solver
    stale: np.ndarray
    """(m, 2) boxes of the listed pairs that could not be evaluated, because one has no pose that is
    recent enough. (box, ALONE): all pairs of a box that patterns ask for."""
    scene: Scene

    @property
    def touching(self) -> int:
        """Return how many pairs are in contact: the first rows."""
        return self.contacts.colliding.tobytes().count(True)  # numpy takes three times as long

    def named(self) -> list[tuple[Pair, Contact]]:
        """Return each pair with its contact, by name."""
        return [(self.scene.pair_of(a, b), contact)
                for (a, b), contact in zip(self.pairs.tolist(), self.contacts)]

    def named_stale(self) -> list[Pair]:
        """Return the stale pairs by name; a box whose pairs all are is paired with itself."""
        return [self.scene.pair_of(a, b) for a, b in self.stale.tolist()]


class SceneSolver:
    """Contacts of all pairs of a scene, one tick at a time.

    Raises ValueError for a model that does not go with the sizes. Remembers which boxes are near
    each other: use one per thread.
    """

    def __init__(self, scene: Scene, *, model: str | Model = 'exact',
                 margin: float = 0.0, most_near: int = sys.maxsize) -> None:
        """Begin without poses.

        margin: up to which separation pairs apart are listed [m].
        most_near: pairs that a tick may leave to the model; of more, it raises TooManyNear.
        """
        if not isinstance(scene, Scene):
            raise ValueError(f'scene must be a Scene, not {short_repr(scene)}')
        margin = as_margin(margin)
        most_near = as_whole(most_near, 'most_near', 0, sys.maxsize)
        self.scene = scene
        self.model = model
        self.margin = margin
        self._most_near = most_near
        boxes = list(scene.boxes.values())
        self._size = np.array([box.size for box in boxes], dtype=float)
        self._rows = scene.fixed_poses()
        """Poses of boxes and, behind them, of bodies."""
        self._poses = self._rows[:len(boxes)]
        self._moving = np.array([scene.row_of[name] for name in scene.moving])
        self._broad_phase = native.BroadPhase(self._size, scene.is_fixed, margin, scene.rows,
                                              *scene.groups, scene.body_of)
        self._solver = ContactSolver(model=model, margin=margin)
        self._again = partial(SceneSolver, model=model, margin=margin, most_near=most_near)
        self._warm_up()

    def __reduce__(self) -> tuple[Callable[..., SceneSolver], tuple[Scene]]:
        """Pickle the arguments."""
        return self._again, (self.scene,)

    def _warm_up(self) -> None:
        """Let the model refuse sizes that it has no answer for.

        Only a corner overlaps: where faces coincide, a soup takes seconds.
        """
        kinds = np.unique(self._size, axis=0)
        listed = np.unique(self._size[self.scene.rows].reshape(-1, 6), axis=0)
        both = [listed]
        if self.scene.patterns:
            first = np.broadcast_to(kinds[0], kinds.shape)
            both += [np.hstack((first, kinds)), np.hstack((kinds, first))]
        size_a, size_b = np.split(np.concatenate(both), 2, axis=1)
        a, b = np.zeros((2, len(size_a), 7))
        a[:, 6] = b[:, 6] = 1.0
        b[:, :3] = 0.5 * (size_a + size_b) - 0.02 * np.minimum(size_a, size_b)
        self._solver.batch(a, b, size_a=np.ascontiguousarray(size_a),
                           size_b=np.ascontiguousarray(size_b))
        self([None] * len(self.scene.moving))

    def __call__(self, poses: Sequence[np.ndarray | None] | ArrayLike) -> Answer:
        """Return the answer to one tick: a pose (7,) or None for each of `scene.moving`.

        Or an array (n, 7) with a row for each, all NaN for None.
        Raises ValueError for numbers that are no pose, and for more or fewer poses than that.
        """
        self._set_poses(poses)
        if self.scene.bodies:
            self.scene.place_boxes(self._rows)
        near, contacts, stale = find_contacts(
            self._broad_phase, self._solver, self._size, self._poses,
            lambda box: f'pose of {self.scene.names[box]}:', most_near=self._most_near)
        pairs, contacts = in_contact(near, contacts, self.margin)
        return Answer(pairs, contacts, len(near), stale, self.scene)

    def _set_poses(self, poses: Sequence[np.ndarray | None] | ArrayLike) -> None:
        """Take the poses of the boxes and bodies that move."""
        if native.write_poses(self._rows, self._moving, poses):  # those of every node
            return
        if not isinstance(poses, Sequence) or isinstance(poses, str):
            poses = as_floats(poses, 'poses', 'a list of a pose or None for each box and body that '
                              'moves, or an array (n, 7)', (None, 7))
        if len(poses) != len(self._moving):
            raise ValueError(f'{len(poses)} poses, but {len(self._moving)} boxes and bodies move: '
                             f'{short_repr(list(self.scene.moving))}; give a list of a pose or '
                             'None for each')
        if isinstance(poses, np.ndarray):
            self._rows[self._moving] = poses
            return
        for name, index, pose in zip(self.scene.moving, self._moving, poses):
            self._rows[index] = NOWHERE if pose is None else as_floats(
                pose, f'pose of {name}', 'a pose (x y z qx qy qz qw)', (7,))

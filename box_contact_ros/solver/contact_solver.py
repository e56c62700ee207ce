# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""ContactSolver: SAT first, then the contact point by the chosen model."""
from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..core import THREADS_MAX, native
from .checks import (
    as_floats,
    as_number,
    as_pairs,
    as_places,
    as_size,
    as_whole,
    pose_fault,
    short_repr,
    size_fault,
)
from .contact import Contact, Contacts, without_patch
from .model import NATIVE_TYPES, Model, as_model
from .motion import Approach, Approaches, Sweep, as_sweeps, find_approaches, takes_sweeps
from .nearest import Nearest, Nearests
from .poses import ORDER, PoseLike, as_many, as_pose, as_poses

Names = tuple[str, str, str, str]  # of poses and sizes of A and B, in a refusal
_SINGLE: Names = ('pose_a', 'pose_b', 'size_a', 'size_b')
_MANY: Names = ('poses_a', 'poses_b', 'size_a', 'size_b')
_BY_PLACE: Names = ('poses', 'poses', 'sizes', 'sizes')
_CENTRES = ('centre_a', 'centre_b')


class _Rows(NamedTuple):
    """What a batch takes besides its poses, of any kind of numbers."""

    size_a: ArrayLike | None
    size_b: ArrayLike | None
    sizes: ArrayLike | None
    pairs: ArrayLike | None
    threads: int


class _Asked(NamedTuple):
    """Rows of pairs as the core takes them, and the names of the arguments in a refusal."""

    a: np.ndarray
    b: np.ndarray
    size_a: np.ndarray
    size_b: np.ndarray
    names: Names
    threads: int = 1
    places: np.ndarray | None = None


class ContactSolver(native.PairSolver):
    """Whether two boxes touch, where, and which way they push.

    ```python
    solver = ContactSolver(size_a=(12.192, 2.438, 2.591), size_b=(12.192, 2.438, 2.591))
    contact = solver(pose_a, pose_b)
    contacts = solver.batch(poses_a, poses_b)
    nearest = solver.distance(pose_a, pose_b)
    first = solver.time_of_impact(Sweep(start_a, end_a), Sweep(start_b, end_b))
    ```

    Sizes are three full extents [m]. Without them, each batch brings its own. Poses are
    `x y z qx qy qz qw` in a common frame, 4×4 matrices, (position, rotation) or messages. Raises
    `ValueError`, with the field and the value, for anything that is not a size or a pose. A solver
    may be called from several threads.

    model: 'exact', 'mlp', or an object with `solve` as `models.Model` describes it.
    margin: separation up to which pairs apart have a normal too [m]; infinity: all.
    """

    def __init__(self, size_a: ArrayLike | None = None, size_b: ArrayLike | None = None, *,
                 model: str | Model = 'exact', margin: float = 0.0) -> None:
        margin = as_number(margin, 'margin')
        if not margin >= 0.0:
            raise ValueError(f'margin must be 0 or more, not {margin:g}')
        self.model, self._model, self._margin = model, as_model(model), margin
        self._native = self._model if isinstance(self._model, NATIVE_TYPES) else None
        if margin and self._native is None:
            raise ValueError(f'margin {margin:g} has no effect on model {short_repr(model)}: leave '
                             'it at 0')
        self._size_fault = getattr(self._model, 'size_fault', lambda a, b: None)
        self._size_a = None if size_a is None else as_size(size_a, 'size_a')
        self._size_b = None if size_b is None else as_size(size_b, 'size_b')
        answers = self._native
        if self._size_a is not None and self._size_b is not None:
            if fault := self._size_fault(self._size_a[0], self._size_b[0]):
                raise ValueError(fault)
            if hasattr(self._model, 'native_for'):
                answers = self._model.native_for(self._size_a[0], self._size_b[0])
        # Calls are answered in C++, which calls `_call_general` and `_batch_general` for the rest.
        a, b = (None if size is None else tuple(size[0]) for size in (self._size_a, self._size_b))
        super().__init__(answers, a, b, margin)

    if TYPE_CHECKING:  # the core, which does it, knows no type of ours
        def __call__(self, pose_a: PoseLike, pose_b: PoseLike) -> Contact: ...  # noqa: D102

        def batch(self, poses_a: PoseLike, poses_b: PoseLike | None = None, *,  # noqa: D102
                  size_a: ArrayLike | None = None, size_b: ArrayLike | None = None,
                  sizes: ArrayLike | None = None, pairs: ArrayLike | None = None,
                  threads: int = 1, patch: bool = True) -> Contacts: ...

        def distance(self, pose_a: PoseLike, pose_b: PoseLike) -> Nearest: ...  # noqa: D102

        def distance_batch(  # noqa: D102
                self, poses_a: PoseLike, poses_b: PoseLike | None = None, *,
                size_a: ArrayLike | None = None, size_b: ArrayLike | None = None,
                sizes: ArrayLike | None = None, pairs: ArrayLike | None = None,
                threads: int = 1) -> Nearests: ...
    else:
        batch = native.PairSolver.batch
        distance = native.PairSolver.distance
        distance_batch = native.PairSolver.distance_batch

    @takes_sweeps
    def time_of_impact(self, sweep_a: Sweep, sweep_b: Sweep, *, clearance: float = 0.0,
                       tolerance: float = 1e-6) -> Approach:
        """Return when two boxes first come as near as the clearance [m], and where.

        Before `time` the distance is above the clearance, by proof. At `time` it is at most
        clearance + tolerance. NaN: they never come so near. Boxes that are so near at the start
        have time 0.

        Raises ValueError, with field and value, for a turn by 180 degrees, which has two ways, and
        for a tolerance that rounding does not allow.
        """
        return self._approach(sweep_a, sweep_b, clearance, tolerance)

    @takes_sweeps
    def least_distance(self, sweep_a: Sweep, sweep_b: Sweep, *, tolerance: float = 1e-6,
                       ) -> Approach:
        """Return the least distance on the way, to the tolerance [m], when it is, and where.

        Boxes that touch on the way have the first time, as `time_of_impact` without a clearance:
        the distance is then at most the tolerance. Errors are those of `time_of_impact`.
        """
        return self._approach(sweep_a, sweep_b, None, tolerance)

    @takes_sweeps
    def time_of_impact_batch(
            self, sweeps_a: Sweep, sweeps_b: Sweep | None = None, *,
            size_a: ArrayLike | None = None, size_b: ArrayLike | None = None,
            sizes: ArrayLike | None = None, pairs: ArrayLike | None = None, clearance: float = 0.0,
            tolerance: float = 1e-6, threads: int = 1) -> Approaches:
        """Return the Approaches of n pairs: row i is what `time_of_impact` gives for row i.

        Sweeps of rows take the place of poses. Sizes, pairs and threads are those of `batch`.
        """
        return self._approaches(sweeps_a, sweeps_b, clearance, tolerance,
                                _Rows(size_a, size_b, sizes, pairs, threads))

    @takes_sweeps
    def least_distance_batch(
            self, sweeps_a: Sweep, sweeps_b: Sweep | None = None, *,
            size_a: ArrayLike | None = None, size_b: ArrayLike | None = None,
            sizes: ArrayLike | None = None, pairs: ArrayLike | None = None,
            tolerance: float = 1e-6, threads: int = 1) -> Approaches:
        """Return the Approaches of n pairs: row i is what `least_distance` gives for row i.

        All arguments are those of `time_of_impact_batch`.
        """
        return self._approaches(sweeps_a, sweeps_b, None, tolerance,
                                _Rows(size_a, size_b, sizes, pairs, threads))

    def __repr__(self) -> str:
        """Return the call that makes the same solver."""
        sizes = [f'size_{side}={tuple(size[0].tolist())}' for side, size in (
            ('a', self._size_a), ('b', self._size_b)) if size is not None]
        margin = [f'margin={self._margin:g}'] if self._margin else []
        return f'ContactSolver({", ".join((*sizes, f"model={self.model!r}", *margin))})'

    def __reduce__(self) -> tuple[Callable[..., ContactSolver], tuple[Any, ...]]:
        """Pickle the arguments."""
        return (partial(ContactSolver, model=self.model, margin=self._margin),
                tuple(None if size is None else size[0] for size in (self._size_a, self._size_b)))

    def _call_general(self, pose_a: PoseLike, pose_b: PoseLike) -> Contact:
        """Return the contact of one pair whose poses (7,) are of any kind of numbers.

        Raises ValueError, with field and value, for poses that are refused.
        """
        return self._solve(self._pair(pose_a, pose_b))[0]

    def _batch_general(self, poses_a: PoseLike, poses_b: PoseLike | None = None, *,
                       size_a: ArrayLike | None = None, size_b: ArrayLike | None = None,
                       sizes: ArrayLike | None = None, pairs: ArrayLike | None = None,
                       threads: int = 1, patch: bool = True) -> Contacts:
        """Return what `batch` does, for arguments of any kind of numbers.

        Raises ValueError, with field and value, for what is refused.
        """
        if not isinstance(patch, (bool, np.bool_)):
            raise ValueError(f'patch must be True or False, not {short_repr(patch)}')
        plain = _as_plain(pairs, poses_b, size_a, size_b)
        if plain is not pairs:
            return self.batch(poses_a, sizes=sizes, pairs=plain, threads=threads, patch=patch)
        return self._solve(self._rows(poses_a, poses_b, size_a, size_b, sizes, pairs, threads),
                           bool(patch))

    def _distance_general(self, pose_a: PoseLike, pose_b: PoseLike) -> Nearest:
        """Return what `distance` does, for poses of any kind; ValueError as of a call."""
        return self._find_distances(self._pair(pose_a, pose_b))[0]

    def _distance_batch_general(self, poses_a: PoseLike, poses_b: PoseLike | None = None, *,
                                size_a: ArrayLike | None = None, size_b: ArrayLike | None = None,
                                sizes: ArrayLike | None = None, pairs: ArrayLike | None = None,
                                threads: int = 1) -> Nearests:
        """Return what `distance_batch` does, for arguments of any kind; ValueError likewise."""
        plain = _as_plain(pairs, poses_b, size_a, size_b)
        if plain is not pairs:
            return self.distance_batch(poses_a, sizes=sizes, pairs=plain, threads=threads)
        return self._find_distances(
            self._rows(poses_a, poses_b, size_a, size_b, sizes, pairs, threads))

    def _approach(self, sweep_a: Sweep, sweep_b: Sweep, clearance: float | None, tolerance: float,
                  ) -> Approach:
        a, b = as_sweeps(sweep_a, sweep_b)
        found = native.approach(a.start, a.end, b.start, b.end, self._size_a, self._size_b,
                                a.centre, b.centre, clearance, tolerance)
        if found:
            return Approach(*found)
        asked = _Asked(_pose(a.start, 'start_a'), _pose(b.start, 'start_b'),
                       _known(self._size_a, 'size_a'), _known(self._size_b, 'size_b'), _SINGLE)
        ends = _pose(a.end, 'end_a'), _pose(b.end, 'end_b')
        try:
            return find_approaches(asked[:4], ends, (a.centre, b.centre), _CENTRES, clearance,
                                   tolerance)[0]
        except ValueError as error:
            raise ValueError(str(error).removeprefix('row 0: ')) from None

    def _approaches(self, sweeps_a: Sweep, sweeps_b: Sweep | None, clearance: float | None,
                    tolerance: float, rows: _Rows) -> Approaches:
        by_place = rows.pairs is not None
        a, b = as_sweeps(sweeps_a, sweeps_b, by_place=by_place)
        names = _CENTRES
        if by_place:
            start_a, end_a = as_many(starts=a.start, ends=a.end)
            start_b, end_b, names = None, end_a, ('centres', 'centres')
        else:
            start_a, end_a, start_b, end_b = as_many(
                starts_a=a.start, ends_a=a.end, starts_b=b.start, ends_b=b.end)
        asked = self._rows(start_a, start_b, *rows)
        return find_approaches(asked[:4], (end_a, end_b), (a.centre, b.centre), names, clearance,
                               tolerance, asked.threads, asked.places)

    def _pair(self, pose_a: PoseLike, pose_b: PoseLike) -> _Asked:
        """Return one pair of poses of any kind of numbers."""
        return _Asked(_pose(pose_a, 'pose_a'), _pose(pose_b, 'pose_b'),
                      _known(self._size_a, 'size_a'), _known(self._size_b, 'size_b'), _SINGLE)

    def _rows(self, poses_a: PoseLike, poses_b: PoseLike | None, size_a: ArrayLike | None,
              size_b: ArrayLike | None, sizes: ArrayLike | None, pairs: ArrayLike | None,
              threads: int) -> _Asked:
        """Return the rows of a batch whose arguments are of any kind of numbers."""
        threads = as_whole(threads, 'threads', 1, THREADS_MAX)
        if pairs is not None:
            if poses_b is not None or size_a is not None or size_b is not None:
                raise ValueError('pairs are places in poses and sizes: batch(poses, sizes=…, '
                                 'pairs=…) has neither poses_b nor size_a nor size_b')
            poses = as_poses(poses_a, 'poses')
            rows_a = self._sizes(sizes, 'sizes', self._size_a, len(poses))
            rows_b = self._sizes(sizes, 'sizes', self._size_b, len(poses))
            return _Asked(poses, poses, rows_a, rows_b, _BY_PLACE, threads,
                          as_places(pairs, 'pairs', len(poses)))
        if sizes is not None or poses_b is None:
            raise ValueError('batch takes (poses_a, poses_b), or (poses, sizes=…, pairs=…)')
        a, b = as_many(poses_a=poses_a, poses_b=poses_b)
        return _Asked(a, b, self._sizes(size_a, 'size_a', self._size_a, len(a)),
                      self._sizes(size_b, 'size_b', self._size_b, len(a)), _MANY, threads)

    @staticmethod
    def _sizes(size: ArrayLike | None, name: str, default: np.ndarray | None, count: int,
               ) -> np.ndarray:
        """Return sizes (1, 3) or (count, 3)."""
        if size is None:
            return _known(default, name)
        array = as_floats(size, name, f'full extents (3,) or ({count}, 3)', (3,), (count, 3))
        return as_size(array, name) if array.ndim == 1 else array

    def _solve(self, asked: _Asked, patch: bool = True) -> Contacts:
        a, b, size_a, size_b, _, threads, places = asked
        if self._native is not None:
            contacts, refused = self._native.solve(a, b, size_a, size_b, threads, patch, places,
                                                   self._margin)
        else:
            if places is not None:
                first, second = places.T
                size_a = size_a if len(size_a) == 1 else size_a[first]
                size_b = size_b if len(size_b) == 1 else size_b[second]
                a, b = a[first], b[second]
            contacts, refused = _checked(self._model.solve(a, b, size_a, size_b, threads),
                                         short_repr(self.model), len(a))
            contacts = contacts if patch else without_patch(contacts)
        if refused >= 0:
            raise ValueError(self._refusal(asked, refused))
        return contacts

    def _find_distances(self, asked: _Asked) -> Nearests:
        a, b, size_a, size_b, _, threads, places = asked
        nearests, refused = native.distances(a, b, size_a, size_b, threads, places)
        if refused >= 0:
            raise ValueError(self._refusal(asked, refused))
        return nearests

    def _refusal(self, asked: _Asked, row: int) -> str:
        """Return why a row is refused, by anyone or by the model."""
        of_a, of_b = (row, row) if asked.places is None else asked.places[row]
        for values, name, fault_of, place in ((asked.a, asked.names[0], pose_fault, of_a),
                                              (asked.b, asked.names[1], pose_fault, of_b),
                                              (asked.size_a, asked.names[2], size_fault, of_a),
                                              (asked.size_b, asked.names[3], size_fault, of_b)):
            if fault := fault_of(values[place % len(values)]):
                numbered = name.startswith('poses') or len(asked.a) > 1
                order = ORDER if fault_of is pose_fault else ''
                return f'{name}[{place}] {fault}{order}' if numbered else f'{name} {fault}{order}'
        fault = self._size_fault(asked.size_a[of_a % len(asked.size_a)],
                                 asked.size_b[of_b % len(asked.size_b)])
        return fault or f'model {short_repr(self.model)} refuses row {of_a}'


def _as_plain(pairs: ArrayLike | None, *others: ArrayLike | None) -> ArrayLike | None:
    """Return pairs as C++ reads them, which often are all that it could not read.

    others: what goes with no pairs; where one is given, a refusal follows.
    """
    if pairs is None or any(other is not None for other in others):
        return pairs
    return as_pairs(pairs, 'pairs')


def _checked(answer: object, model: str, count: int) -> tuple[Contacts, int]:
    """Return the answer of a model for `count` pairs. ValueError: it is no such answer."""
    if not (isinstance(answer, tuple) and len(answer) == 2 and isinstance(answer[0], Contacts)):
        raise ValueError(f'model {model}: solve must return Contacts and the first refused row or '
                         f'-1, not {short_repr(answer)}')
    contacts, refused = answer
    if len(contacts) != count:
        raise ValueError(f'model {model}: solve must return {count} contacts, a row a pair, not '
                         f'{len(contacts)}')
    return contacts, int(refused)


def _pose(pose: PoseLike, name: str) -> np.ndarray:
    """Return a pose of any form as (1, 7)."""
    return as_pose(pose, name).reshape(1, 7)


def _known(size: np.ndarray | None, name: str) -> np.ndarray:
    """Return the size (1, 3) of a solver; ValueError: it has none."""
    if size is None:
        raise ValueError(f'{name} is missing: give it to ContactSolver or to batch')
    return size

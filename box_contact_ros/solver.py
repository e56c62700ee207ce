"""ContactSolver: SAT first, then the contact point by the chosen model. Conventions: `pose`."""
from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from .block import BAD_POSE_A, BAD_POSE_B, BAD_SIZE_A
from .checks import as_floats, as_size, pose_fault, shown, size_fault
from .mlp import Mlp
from .contact import TOUCHING, Contact, Contacts
from .exact import Exact
from .paper import Paper, PaperContinuous

MODELS = {
    'mlp': 'SAT, and a network for the point; any sizes; constant cost; the default',
    'exact': 'SAT and the exact centroid of the overlap; any sizes; the reference',
    'paper': "the paper's network 6-20-18-4; two equal cubes, or the crane's containers",
    'paper-continuous': "the paper's networks 6-20-17-4 on subsets without jumps; two equal cubes",
    'fcl': "FCL's box-box, its deepest contact; any sizes; needs python-fcl; a baseline",
    'soup': 'polygon soup on FCL, 8 divisions an edge, or N: soup-N; needs python-fcl; a baseline',
}
"""Models by name, with a line about each."""
MODEL_NAMES = ', '.join([*MODELS, 'soup-N'])
"""For those who choose."""
NETWORKS = ('mlp', 'paper', 'paper-continuous')
"""Models that read weights."""

SOUP_DIVISIONS, MOST_SOUP_DIVISIONS = 8, 64
"""Divisions of an edge in model `soup`, and the most that are accepted (49,152 triangles a box)."""


# Looked up once: a single call takes little more than a microsecond.
_empty, _new_tuple = np.empty, tuple.__new__


class Model(Protocol):
    """What a model behind `ContactSolver` is."""

    def solve(self, a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
              status: np.ndarray, found: Contacts) -> int:
        """Fill `found` for poses (n, 7) and full extents (n or 1, 3).

        Returns the number of rows that are refused, with their reasons (`block.BAD_…`) in `status`.
        """


@runtime_checkable
class SingleModel(Model, Protocol):
    """A model that has a kernel of its own for single pairs."""

    one_scratch: tuple[np.ndarray, ...]
    """Arrays that are handed to `one` on every call; they know the sizes."""

    @staticmethod
    def one(*scratch_poses_normal_point: np.ndarray) -> tuple[int, float]:
        """(contact.APART, TOUCHING or REFUSED, separation) of a single pair.

        Arguments: `one_scratch`, then two poses (7,), and normal (3,) and point (3,) to write.
        """


def soup_divisions(name: str) -> int | None:
    """N of a model name `soup` or `soup-N`, None for any other; ValueError for a bad N."""
    if name == 'soup':
        return SOUP_DIVISIONS
    if not name.startswith('soup-'):
        return None
    text = name.removeprefix('soup-')
    # Not any length: int() refuses thousands of digits in words of its own.
    if (text.isascii() and text.isdecimal() and len(text) < 10
            and 1 <= int(text) <= MOST_SOUP_DIVISIONS):
        return int(text)
    raise ValueError(f'model {shown(name)}: the divisions N of soup-N must be a whole number from '
                     f'1 to {MOST_SOUP_DIVISIONS}')


def check_model(where: str, name: object) -> str:
    """The name of a model; ValueError, which begins with `where`, for what is none."""
    if isinstance(name, str) and (name in MODELS or soup_divisions(name)):
        return name
    raise ValueError(f'{where} {shown(name)} is not one of: {MODEL_NAMES}')


def make_model(name: str, size_a: np.ndarray, size_b: np.ndarray, weights: str | None) -> Model:
    """The model of that name for boxes of full extents (1, 3); `weights` names a file or is None.

    Raises ValueError for a name, sizes or weights that do not fit.
    """
    check_model('model', name)
    if weights is not None and not isinstance(weights, (str, os.PathLike)):
        raise ValueError(f'weights must be the path of a file, not {shown(weights)}')
    if name == 'mlp':
        return Mlp(np.concatenate([size_a, size_b]), weights)
    if name == 'exact':
        return Exact(np.concatenate([size_a, size_b]))
    if name == 'paper':
        return Paper(size_a, size_b, weights)
    if name == 'paper-continuous':
        return PaperContinuous(size_a, size_b, weights)
    if name == 'fcl':
        from .fcl_box import FclBox  # only here: python-fcl is an extra

        return FclBox()
    divisions = soup_divisions(name)
    if divisions:
        from .soup import Soup  # likewise

        return Soup(divisions)
    raise NotImplementedError(name)


class ContactSolver:
    """Whether two boxes touch, where, and which way they push.

    ```python
    solver = ContactSolver(size_a=(12.192, 2.438, 2.591), size_b=(12.192, 2.438, 2.591))
    contact = solver(pose_a, pose_b)
    contacts = solver.batch(poses_a, poses_b)
    ```

    Sizes are three full extents [m]; poses are `x y z qx qy qz qw` in a common frame. Raises
    `ValueError`, with the field and the value, for anything that is not a size or a pose.
    A solver keeps scratch memory: use one per thread.

    model: one of `MODELS`, or soup-N; weights: a file to use in place of the shipped weights.
    """

    def __init__(self, size_a: ArrayLike, size_b: ArrayLike, *, model: str = 'mlp',
                 weights: str | None = None) -> None:
        self._size_a = as_size(size_a, 'size_a')
        self._size_b = as_size(size_b, 'size_b')
        self.model = model
        self._solver = make_model(model, self._size_a, self._size_b, weights)
        self._one: Callable[..., tuple[int, float]] | None = None
        if isinstance(self._solver, SingleModel):
            one: Any = self._solver.one  # a kernel
            self._one = partial(one, *self._solver.one_scratch)
            # After one call for float64 arrays no other kind is compiled: what is not one raises
            # TypeError, and is made one.
            self._one(np.zeros(7), np.zeros(7), np.empty(3), np.empty(3))
            one.disable_compile()

    def __call__(self, pose_a: ArrayLike, pose_b: ArrayLike) -> Contact:
        """Contact of one pair; poses are (7,)."""
        if self._one is None:
            return self._converted(pose_a, pose_b)
        normal, point = _empty(3), _empty(3)
        try:
            verdict, separation = self._one(pose_a, pose_b, normal, point)
        except (TypeError, ValueError):  # the latter, without the field, for an empty list
            return self._converted(pose_a, pose_b)
        if verdict < 0:
            return self._converted(pose_a, pose_b)  # which knows the words
        return _new_tuple(Contact, (verdict == TOUCHING, separation, normal, point))

    @property
    def exact_answers(self) -> int:
        """Contacts so far that the model handed to `exact`: see `mlp`."""
        return int(getattr(self._solver, 'exact_answers', 0))

    def _converted(self, pose_a: ArrayLike, pose_b: ArrayLike) -> Contact:
        """A single call for poses of any kind, or the reason why they are refused."""
        a = as_floats(pose_a, 'pose_a', 'a pose (7,)', (7,)).reshape(1, 7)
        b = as_floats(pose_b, 'pose_b', 'a pose (7,)', (7,)).reshape(1, 7)
        found = self._solve(a, b, self._size_a, self._size_b, ('pose_a', 'pose_b'))
        return Contact(bool(found.colliding[0]), float(found.separation[0]), found.normal[0],
                       found.point[0])

    def batch(self, poses_a: ArrayLike, poses_b: ArrayLike, *, size_a: ArrayLike | None = None,
              size_b: ArrayLike | None = None) -> Contacts:
        """Contacts of n pairs: row i is what a single call gives for row i.

        poses_a, poses_b are (n, 7); size_a, size_b replace the solver's sizes, (3,) for all rows
        or (n, 3) for every row its own.
        """
        a = as_floats(poses_a, 'poses_a', 'poses (n, 7)', (None, 7))
        b = as_floats(poses_b, 'poses_b', 'poses (n, 7)', (None, 7))
        if len(a) != len(b):
            raise ValueError(f'poses_a and poses_b must be equally many, not {len(a)} and {len(b)}')
        sizes = []
        for size, name, default in ((size_a, 'size_a', self._size_a),
                                    (size_b, 'size_b', self._size_b)):
            if size is None:
                sizes.append(default)
                continue
            array = as_floats(size, name, f'full extents (3,) or ({len(a)}, 3)', (3,), (len(a), 3))
            sizes.append(as_size(array, name) if array.ndim == 1 else array)
        return self._solve(a, b, sizes[0], sizes[1], ('poses_a', 'poses_b'))

    def _solve(self, a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
               names: tuple[str, str]) -> Contacts:
        rows = len(a)
        found = Contacts(np.empty(rows, dtype=np.bool_), np.empty(rows), np.empty((rows, 3)),
                         np.empty((rows, 3)))
        status = np.zeros(rows, dtype=np.int8)
        if self._solver.solve(a, b, size_a, size_b, status, found):
            _refuse(a, b, size_a, size_b, status, names)
        return found


def _refuse(a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
            status: np.ndarray, names: tuple[str, str]) -> None:
    """Raise for the first row that the kernel refused."""
    row = int(np.flatnonzero(status)[0])
    code = status[row]
    if code in (BAD_POSE_A, BAD_POSE_B):
        poses, name = (a, names[0]) if code == BAD_POSE_A else (b, names[1])
        fault = pose_fault(poses[row])
    else:
        sizes, name = (size_a, 'size_a') if code == BAD_SIZE_A else (size_b, 'size_b')
        fault = size_fault(sizes[0 if len(sizes) == 1 else row])
    where = f'{name}[{row}]' if name.startswith('poses') or len(status) > 1 else name
    raise ValueError(f'{where} {fault}')

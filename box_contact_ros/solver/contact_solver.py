"""ContactSolver: SAT first, then the contact point by the chosen model."""
from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..core import native
from .checks import as_floats, as_size, pose_fault, shown, size_fault
from .contact import Contact, Contacts
from .models import build_model


class ContactSolver(native.PairSolver):
    """Whether two boxes touch, where, and which way they push.

    ```python
    solver = ContactSolver(size_a=(12.192, 2.438, 2.591), size_b=(12.192, 2.438, 2.591))
    contact = solver(pose_a, pose_b)
    contacts = solver.batch(poses_a, poses_b)
    ```

    Sizes are three full extents [m]; poses are `x y z qx qy qz qw` in a common frame. Raises
    `ValueError`, with the field and the value, for anything that is not a size or a pose. A solver
    may be called from several threads.

    model: a name of the registry, `models.MODELS`.
    weights: a file to use instead of the shipped weights.
    """

    def __init__(self, size_a: ArrayLike, size_b: ArrayLike, *, model: str = 'mlp',
                 weights: str | None = None) -> None:
        self._size_a = as_size(size_a, 'size_a')
        self._size_b = as_size(size_b, 'size_b')
        self.model = model
        self._weights = weights
        self._solver = build_model(model, self._size_a, self._size_b, weights)
        single, network = getattr(self._solver, 'single', (None, None))
        # Single calls are made by the base class, in C++; it calls `converted` for the rest.
        super().__init__(single, tuple(self._size_a[0]), tuple(self._size_b[0]), network)

    if TYPE_CHECKING:  # the core, which does it, knows no type of ours
        def __call__(self, pose_a: ArrayLike, pose_b: ArrayLike) -> Contact: ...  # noqa: D102

    def __reduce__(self) -> tuple[Callable[..., ContactSolver], tuple[Any, ...]]:
        """Pickle the arguments."""
        return (partial(ContactSolver, model=self.model, weights=self._weights),
                (self._size_a[0], self._size_b[0]))

    @property
    def exact_answers(self) -> int:
        """Contacts so far that the model handed to `exact`: see `mlp`."""
        return self.answered_exactly + int(getattr(self._solver, 'exact_answers', 0))

    @property
    def clipped(self) -> int:
        """Contacts so far that model `exact` clipped, because its certificate did not hold."""
        return super().clipped + int(getattr(self._solver, 'clipped', 0))

    def converted(self, pose_a: ArrayLike, pose_b: ArrayLike) -> Contact:
        """Return the contact of one pair whose poses (7,) are of any kind of numbers.

        Raises ValueError, with field and value, for poses that are refused.
        """
        a = as_floats(pose_a, 'pose_a', 'a pose (7,)', (7,)).reshape(1, 7)
        b = as_floats(pose_b, 'pose_b', 'a pose (7,)', (7,)).reshape(1, 7)
        found = self._solve(a, b, self._size_a, self._size_b, ('pose_a', 'pose_b'))
        return Contact(bool(found.colliding[0]), float(found.separation[0]), found.normal[0],
                       found.point[0], float(found.volume[0]), found.covariance[0])

    def batch(self, poses_a: ArrayLike, poses_b: ArrayLike, *, size_a: ArrayLike | None = None,
              size_b: ArrayLike | None = None, threads: int = 1) -> Contacts:
        """Return the contacts of n pairs: row i is what a single call gives for row i.

        poses_a, poses_b are (n, 7); size_a, size_b replace the solver's sizes, (3,) for all rows
        or (n, 3) for every row its own. `threads` share the rows; no bit depends on their number.
        """
        a = as_floats(poses_a, 'poses_a', 'poses (n, 7)', (None, 7))
        b = as_floats(poses_b, 'poses_b', 'poses (n, 7)', (None, 7))
        if len(a) != len(b):
            raise ValueError(f'poses_a and poses_b must be equally many, not {len(a)} and {len(b)}')
        if isinstance(threads, bool) or not isinstance(threads, (int, np.integer)) or threads < 1:
            raise ValueError(f'threads must be a whole number from 1 on, not {shown(threads)}')
        sizes = []
        for size, name, default in ((size_a, 'size_a', self._size_a),
                                    (size_b, 'size_b', self._size_b)):
            if size is None:
                sizes.append(default)
                continue
            array = as_floats(size, name, f'full extents (3,) or ({len(a)}, 3)', (3,), (len(a), 3))
            sizes.append(as_size(array, name) if array.ndim == 1 else array)
        return self._solve(a, b, sizes[0], sizes[1], ('poses_a', 'poses_b'),
                           min(int(threads), 1 + len(a)))

    def _solve(self, a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
               names: tuple[str, str], threads: int = 1) -> Contacts:
        found, refused = self._solver.solve(a, b, size_a, size_b, threads)
        if refused >= 0:
            raise ValueError(_refusal(a, b, size_a, size_b, refused, names))
        return found


def _refusal(a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray, row: int,
             names: tuple[str, str]) -> str:
    """Return why a row is refused: the first of its poses and sizes that has a fault."""
    for values, name, fault_of in ((a, names[0], pose_fault), (b, names[1], pose_fault),
                                   (size_a, 'size_a', size_fault), (size_b, 'size_b', size_fault)):
        fault = fault_of(values[0 if len(values) == 1 else row])
        if fault:
            numbered = name.startswith('poses') or len(a) > 1
            return f'{name}[{row}] {fault}' if numbered else f'{name} {fault}'
    raise AssertionError(f'row {row} was refused without a fault')

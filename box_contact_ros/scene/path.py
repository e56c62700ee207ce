# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A path through a scene: what comes too near on it, when, and how near all else comes.

The time of a path goes from k to k + 1 between pose k and pose k + 1. It is found in the core, step
by step; see core/src/motion/path.hpp.
"""
from __future__ import annotations

import sys
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..core import native
from ..solver.checks import TooMuch, absent_poses, as_floats, as_margin, pose_fault
from ..solver.motion import Approach, Approaches
from ..solver.pose import rotation_matrix
from ..solver.rows import NoTruth
from .scene import Pair, Scene

TOLERANCE = 1e-6  # of distances [m]
LEAST_COSINE = 1e-9
"""Of half the turn on a segment: below, it has two ways. That of core/src/motion/turn.hpp."""
WORK = 256
"""Looks of a step: a millisecond."""


@dataclass(frozen=True, slots=True, eq=False)
class PathCheck(NoTruth):
    """What a path meets. Boxes are their indices in `scene`; times go from 0 to m − 1."""

    pairs: np.ndarray
    """(k, 2) boxes a and b of the pairs that come within the clearance, in the order of time."""
    impacts: Approaches
    """(k,) their first times: `time`, `closing_speed` [m per unit of time], `nearest`."""
    at_start: np.ndarray
    """(l, 2) pairs within the clearance at the first pose. Until one is apart by it, at a pose or
    after a turn by 0.02 rad on the way there, it is an impact to get into each other, or deeper
    than at first, by 0.1 mm. Deeper than a box is thick, this is not judged."""
    least_pair: np.ndarray | None
    """(2,) the pair that comes nearest, of those never in `at_start`; None: there is none."""
    least: Approach | None
    """When, and how near it comes; where boxes touch, the first of these times."""
    scene: Scene
    revision: int = 0  # of the scene, as of `SceneSolver.set_boxes`

    _instead = '.is_free'

    @classmethod
    def of(cls, found: Found, scene: Scene, revision: int) -> PathCheck:
        """Return what was found in a scene."""
        pair, least = (found.least_pair[0], found.least[0]) if len(found.least) else (None, None)
        return cls(*found[:3], pair, least, scene, revision)

    @property
    def is_free(self) -> bool:
        """Return whether there is no impact."""
        return not len(self.pairs)

    def named(self) -> list[tuple[Pair, Approach]]:
        """Return each pair that comes within the clearance, by name, and its first time."""
        return [(self.scene.pair_of(a, b), impact)
                for (a, b), impact in zip(self.pairs.tolist(), self.impacts)]


class Found(NamedTuple):
    """The arrays of a `PathCheck`."""

    pairs: np.ndarray
    impacts: Approaches
    at_start: np.ndarray
    least_pair: np.ndarray  # (1, 2), or (0, 2)
    least: Approaches  # likewise


def as_path(value: Any, names: Sequence[str], what: str = 'poses') -> np.ndarray:
    """Return poses (m, n, 7) of what moves; ValueError for what is not a path.

    names: of what moves. what: what a refusal calls the path.
    """
    path = as_floats(value, what, f'poses (m, {len(names)}, 7): at each of m times, those of what '
                     f'moves, {", ".join(names) or "which is nothing"}', (None, len(names), 7))
    if len(path) < 2:
        raise ValueError(f'{what} must be those of 2 times or more, not {len(path)}')
    absent = absent_poses(path.reshape(-1, 7)).reshape(path.shape[:2])
    for k, row in np.argwhere(absent != absent[0])[:1]:
        raise ValueError(f'{what}[{k}] of {names[row]}: it is there at some times alone; seven NaN '
                         'at all of them leave it out')
    bad = native.pose_faults(np.ascontiguousarray(path.reshape(-1, 7))) != 0
    for k, row in np.argwhere(bad.reshape(absent.shape) & ~absent)[:1]:
        raise ValueError(f'{what}[{k}] of {names[row]}: {pose_fault(path[k, row])}')
    turns = path[..., 3:] / np.linalg.norm(path[..., 3:], axis=-1, keepdims=True)
    cosines = np.abs(np.einsum('kij,kij->ki', turns[:-1], turns[1:]))
    for k, row in np.argwhere(cosines < LEAST_COSINE)[:1]:
        raise ValueError(f'{what}[{k}] to {what}[{k + 1}] of {names[row]}: a turn by 180 degrees '
                         'has two ways: give a pose between')
    return path


def boxes_of(scene: Scene, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the boxes (n,) that boxes and bodies (k,), by `scene.row_of`, move, and by which."""
    count = len(scene.boxes)
    mover = np.full(count + len(scene.bodies), -1)
    mover[rows] = np.arange(len(rows))
    of = mover[np.where(scene.body_of < 0, np.arange(count), count + scene.body_of)]
    boxes = np.flatnonzero(of >= 0)
    return boxes, of[boxes]


def moved_boxes(scene: Scene, numbers: np.ndarray, of: np.ndarray, path: np.ndarray,
                ) -> tuple[np.ndarray, np.ndarray]:
    """Return the poses (m, n, 7) of boxes, and their centres (n, 3) of turning, in their frames.

    numbers (n,): indices in the scene, or guests behind. of (n,): which of the poses (m, k, 7)
    moves each.
    """
    poses, centres = path[:, of], np.zeros((len(numbers), 3))
    is_part = numbers < len(scene.boxes)
    is_part[is_part] = scene.body_of[numbers[is_part]] >= 0
    if is_part.any():
        # Boxes of all times behind one another, and then their bodies.
        local = scene.box_poses[numbers[is_part]]
        bodies = poses[:, is_part].reshape(-1, 7)
        rows = np.concatenate((np.empty_like(bodies), bodies))
        native.place_boxes(rows, np.arange(len(bodies), 2 * len(bodies)),
                           np.tile(local, (len(path), 1)))
        poses[:, is_part] = rows[:len(bodies)].reshape(len(path), -1, 7)
        centres[is_part] = -np.einsum('nji,nj->ni', rotation_matrix(local[:, 3:]), local[:, :3])
    return poses, centres


def start(sizes: np.ndarray, path: np.ndarray, centres: np.ndarray, numbers: np.ndarray,
          around: native.Index, beside: native.Index | None, wanted: native.Filter,
          clearance: float, *, most_pairs: int = sys.maxsize, most_looks: int = sys.maxsize,
          ) -> Generator[None, None, Found]:
    """Return, in steps, what boxes meet that move among those of `around` and `beside`.

    sizes (n, 3), path (m, n, 7), centres (n, 3) of turning in the boxes' frames. numbers (n,): by
    which `wanted` knows the boxes. clearance: the distance from which on a pair counts [m].
    Raises TooMuch, before the work is done, for more pairs within the clearance than `most_pairs`,
    or more looks at pairs than `most_looks`.
    """
    made = native.Path(sizes, path, centres if centres.any() else None, numbers, around, beside,
                       wanted, as_margin(clearance, 'clearance'), TOLERANCE, most_pairs, most_looks)
    try:
        while not made.advance(WORK):
            yield
    except OverflowError as error:
        raise TooMuch(f'clearance: {error}') from None
    (pairs, *impacts), at_start, (least_pair, *least) = made.found()
    return Found(pairs, Approaches(*impacts), at_start, least_pair, Approaches(*least))

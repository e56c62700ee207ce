# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Searches over poses and sizes: hill climbing to the worst case of any score."""
from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .pose_sets import Pairs, log_uniform, quaternion_multiply, turns

DEPTHS = (1e-4, 0.1)
"""Depths that are searched [shortest edge of both boxes]."""
RATIO_MAX = 20.0  # longest edge of either box by the other's; the default of aspect_max
FINEST_TURN, FINEST_STEP = 1e-6, 1e-5  # [rad], [longest edge of the smaller box]
RESTART = 40  # generations after which the best third replaces the others

Score = Callable[[Pairs], np.ndarray]
"""Returns what is to be made large, (n,); −1 where a pair does not count."""


def climb(rng: np.random.Generator, pairs: Pairs, score: Score, *, generations: int,
          free_sizes: bool = False, aspect_max: float = RATIO_MAX,
          depths: tuple[float, float] = DEPTHS) -> tuple[Pairs, np.ndarray]:
    """Return pairs after `generations` random steps uphill, and their scores, best first.

    free_sizes: whether sizes change too, within aspect_max and RATIO_MAX. aspect_max: longest edge
    of a box by its shortest. depths: as DEPTHS.
    """
    scores = score(pairs)
    for generation in range(generations):
        moved = _moved(rng, pairs, free_sizes, aspect_max, depths)
        found = score(moved)
        better = found > scores
        pairs = Pairs(*(np.where(better[:, None], new, old) for new, old in zip(moved, pairs)))
        scores = np.where(better, found, scores)
        if generation % RESTART == RESTART - 1:
            best = np.tile(np.argsort(-scores)[:max(1, len(scores) // 3)], 3)[:len(scores)]
            best = np.resize(best, len(scores))
            pairs, scores = pairs.rows(best), scores[best]
    order = np.argsort(-scores)
    return pairs.rows(order), scores[order]


def worst_start(pairs: Pairs, score: Score, count: int) -> Pairs:
    """Return the `count` pairs that score highest, from which to climb."""
    return pairs.rows(np.argsort(-score(pairs))[:count])


def _moved(rng: np.random.Generator, pairs: Pairs, free_sizes: bool, aspect_max: float,
           depths: tuple[float, float]) -> Pairs:
    n = len(pairs.pose_a)
    thinnest = 0.1 / aspect_max
    b, size_a, size_b = pairs.pose_b.copy(), pairs.size_a, pairs.size_b
    angle = log_uniform(rng, min(FINEST_TURN, thinnest), 0.5, n) * (rng.random(n) < 0.8)
    b[:, 3:] = quaternion_multiply(turns(rng.normal(size=(n, 3)), angle), b[:, 3:])
    step = log_uniform(rng, min(FINEST_STEP, thinnest), 0.3, n) * (rng.random(n) < 0.8)
    b[:, :3] += rng.normal(size=(n, 3)) * (step * pairs.edge)[:, None]
    if free_sizes:
        spread = (log_uniform(rng, 1e-3, 0.3, n) * (rng.random(n) < 0.6))[:, None]
        new_a, new_b = (size * np.exp(spread * rng.normal(size=(n, 3)))
                        for size in (size_a, size_b))
        legal = _legal(new_a, new_b, aspect_max)[:, None]
        size_a, size_b = np.where(legal, new_a, size_a), np.where(legal, new_b, size_b)
    return _at_legal_depth(rng, Pairs(pairs.pose_a, b, size_a, size_b), depths)


def _legal(a: np.ndarray, b: np.ndarray, aspect_max: float) -> np.ndarray:
    longest_a, longest_b = a.max(axis=1), b.max(axis=1)
    return ((longest_a < aspect_max * a.min(axis=1)) & (longest_b < aspect_max * b.min(axis=1))
            & (longest_a < RATIO_MAX * longest_b) & (longest_b < RATIO_MAX * longest_a))


def _at_legal_depth(rng: np.random.Generator, pairs: Pairs, depths: tuple[float, float],
                    ) -> Pairs:
    """Return the pairs with B moved along the normal to a depth of the range, often its own."""
    found = pairs.contacts()
    n = len(found.separation)
    shortest = np.minimum(pairs.size_a.min(axis=1), pairs.size_b.min(axis=1))
    change = np.where(rng.random(n) < 0.5, np.exp(0.3 * rng.normal(size=n)), 1.0)
    depth = np.clip(-found.separation / shortest * change, *depths) * shortest
    way = np.where(found.colliding, -found.separation - depth, 0.0)
    b = pairs.pose_b.copy()
    b[:, :3] += way[:, None] * np.nan_to_num(found.normal)
    return pairs._replace(pose_b=b)

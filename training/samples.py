# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Training samples of model `mlp`: what its network reads of a contact, and the exact answers."""
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from tqdm import tqdm

from benchmarks.pose_sets import (
    CONTAINER,
    CUBE,
    Generator,
    Pairs,
    any_pose,
    laid,
    log_uniform,
    random_sizes,
    stacked,
)
from box_contact_ros.core import native

PIECE = 100_000
"""Pairs that are made at a time."""


@dataclass(frozen=True, kw_only=True)
class MlpSamples:
    """What the chords say of n contacts, and the exact answers, as arrays or as tensors.

    Coordinates are those of the patch box, −1 to 1, mirrored as `features` are. Volumes are
    relative to that of the patch box.
    """

    features: Any  # (n, FEATURES)
    volume: Any  # (n,) of the body that the chords sum to
    mean: Any  # (n, 3)
    covariance: Any  # (n, 3, 3)
    half: Any  # (n, 3) half extents of the patch box [the smaller box's longest edge]
    true_volume: Any  # (n,)
    true_mean: Any  # (n, 3)
    true_covariance: Any  # (n, 3, 3)

    def __len__(self) -> int:
        """Return n."""
        return len(self.volume)

    def each(self, change: Callable[[Any], Any]) -> MlpSamples:
        """Return the samples with a function applied to each array."""
        return MlpSamples(**{name: change(array) for name, array in vars(self).items()})

    def part(self, rows: Any) -> MlpSamples:
        """Return some of the samples."""
        return self.each(lambda array: array[rows])

    @staticmethod
    def joined(parts: Sequence[MlpSamples]) -> MlpSamples:
        """Return the samples of all parts, one part after the other."""
        return MlpSamples(**{name: np.concatenate([vars(part)[name] for part in parts])
                             for name in vars(parts[0])})


def describe(pairs: Pairs) -> tuple[MlpSamples, np.ndarray]:
    """Return the samples of the pairs that touch, and which these are (n,)."""
    exact = pairs.contacts()
    rows = exact.colliding & (exact.volume > 0.0)
    axes, middle, half, features, volume, mean, covariance = native.mlp_inputs(*pairs.rows(rows))
    to_box = axes.swapaxes(1, 2)
    true_covariance = to_box @ exact.covariance[rows] @ axes
    return MlpSamples(
        features=features, volume=volume, mean=mean, covariance=covariance,
        half=half / pairs.edge[rows, None],
        true_volume=exact.volume[rows] / (8.0 * half.prod(axis=1)),
        true_mean=np.einsum('nij,nj->ni', to_box, exact.point[rows] - middle) / half,
        true_covariance=true_covariance / (half[:, :, None] * half[:, None, :])), rows


def draw_samples(make: Generator, seed: Sequence[int], n: int, progress: bool = False,
                 ) -> MlpSamples:
    """Return the samples among about n pairs of `make(rng, n)`.

    Each piece of PIECE pairs has its own seed.
    """
    starts = tqdm(range(0, n, PIECE), desc='data', unit='piece', disable=not progress)
    return MlpSamples.joined([
        describe(make(np.random.default_rng([*seed, start]), min(PIECE, n - start)))[0]
        for start in starts])


def mixture(rng: np.random.Generator, n: int) -> Pairs:
    """Draw about n pairs of the kinds that scenes have.

    Equal cubes and boxes of random sizes have any pose. Cubes, containers and flat boxes are
    stacked, tilted by 1e-6 to 0.3 rad. Boxes of random sizes are laid on each other.
    """
    share = n // 16
    cubes, (size_a, size_b), laid_sizes = (np.ones((2 * share, 3)), random_sizes(rng, 3 * share),
                                           random_sizes(rng, 3 * share))
    parts = [any_pose(rng, cubes, cubes, depths(rng, cubes, cubes)),
             any_pose(rng, size_a, size_b, depths(rng, size_a, size_b)),
             laid(rng, *laid_sizes, log_uniform(rng, 1e-5, 0.1, 3 * share),
                  depths(rng, *laid_sizes))]
    for size, yaw in ((CUBE, np.pi), (CONTAINER, 0.2), (CONTAINER, np.pi),
                      ((1.0, 0.5, 0.3), np.pi)):
        parts.append(stacked(rng, size, log_uniform(rng, 1e-6, 0.3, 2 * share),
                             rng.uniform(-yaw, yaw, 2 * share),
                             min(size) * log_uniform(rng, 1e-5, 0.1, 2 * share)))
    return Pairs(*(np.concatenate(columns) for columns in zip(*parts)))


def depths(rng: np.random.Generator, size_a: np.ndarray, size_b: np.ndarray) -> np.ndarray:
    """Draw a depth [m] for each of n pairs, 1e-5 to 0.1 of its shortest edge."""
    shortest = np.minimum(size_a.min(axis=1), size_b.min(axis=1))
    return shortest * log_uniform(rng, 1e-5, 0.1, len(shortest))

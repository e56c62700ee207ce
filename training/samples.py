# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Training samples of model `mlp`: contacts whose brackets are open."""
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from tqdm import tqdm

from benchmarks.pose_sets import (
    CONTAINER,
    Generator,
    Pairs,
    any_pose,
    laid,
    log_uniform,
    onto,
    random_sizes,
    stacked,
    turns,
)
from box_contact_ros.core import BRACKET_LIMIT, SPREAD_LIMIT, UPPER_LIMIT, stages
from box_contact_ros.scene.pose import quaternion_multiply, rotation_matrix

PIECE = 100_000
"""Pairs that are made at a time."""
OPEN = 1e-5
"""Least distance of the brackets from which a contact is learned from [of the volume]."""
BEYOND = 1.5
"""Limits of the model by which contacts are still learned from, times this."""


@dataclass(frozen=True, kw_only=True)
class MlpSamples:
    """Upper faces k and exact answers of n contacts, as arrays or as tensors.

    Coordinates are those of the columns, from the centroid of the columns. Volumes are relative to
    that of the columns, lengths to the root of the exact covariance's trace.
    """

    features: Any  # (n, 3, FEATURES)
    cut: Any  # (n, 3) volume that an upper face cuts off, without side faces
    least: Any  # (n, 3) brackets of the share that side faces leave of it
    most: Any  # (n, 3)
    points: Any  # (n, 3, 2, 3) points that carry it
    carries: Any  # (n, 3, 2) their shares
    columns_covariance: Any  # (n, 3, 3)
    volume: Any  # (n,) exact
    mean: Any  # (n, 3) exact centroid
    covariance: Any  # (n, 3, 3) exact
    whitening: Any  # (n, 3, 3) W with W · covariance · Wᵀ = 1

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
    """Return the samples of those pairs that the network decides about, and which they are (n,)."""
    found = stages(*pairs, names=(
        'accurate', 'true_volume', 'true_mean', 'true_covariance', 'columns_volume',
        'columns_mean', 'columns_covariance', 'upper_volume', 'upper_least', 'upper_most',
        'upper_features', 'upper_points', 'upper_carries'))
    with np.errstate(divide='ignore', invalid='ignore'):
        cut = found.upper_volume / found.columns_volume[:, None]
        open_share = (cut * (found.upper_most - found.upper_least)).sum(axis=1)
        from_middle = found.upper_points - found.columns_mean[:, None, None]
        spread = np.einsum('nk,nkp,nkpi->n', cut * (found.upper_most - found.upper_least),
                           found.upper_carries, from_middle**2)
        trace = np.trace(found.columns_covariance, axis1=1, axis2=2)
        rows = (found.accurate & (found.true_volume > 0.0) & (open_share > OPEN)
                & (open_share < BEYOND * BRACKET_LIMIT) & (cut.sum(axis=1) < BEYOND * UPPER_LIMIT)
                & (spread < BEYOND * SPREAD_LIMIT * trace))
    chosen = [array[rows].astype(np.float64) if len(array) else array for array in found]
    found = found._replace(**dict(zip(found._fields, chosen)))
    trace = np.trace(found.true_covariance, axis1=1, axis2=2)
    radius, origin = np.sqrt(trace)[:, None], found.columns_mean
    covariance = found.true_covariance / trace[:, None, None]
    return MlpSamples(
        features=found.upper_features, cut=cut[rows], least=found.upper_least,
        most=found.upper_most, carries=found.upper_carries,
        points=(found.upper_points - origin[:, None, None]) / radius[:, None, None],
        columns_covariance=found.columns_covariance / trace[:, None, None],
        volume=found.true_volume / found.columns_volume,
        mean=(found.true_mean - origin) / radius, covariance=covariance,
        whitening=np.linalg.inv(np.linalg.cholesky(covariance))), rows


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

    - Equal cubes and boxes of random sizes have any pose. Some have edges that are almost parallel.
    - Stacks of boxes are tilted by 1e-6 to 0.3 rad. So are stacks of containers.
    - Containers and cubes are stacked squarely, almost in line and flat.
    - Boxes of random sizes lie flat on each other.
    """
    share = n // 34
    parts = []
    sizes = np.ones((4 * share, 3))
    parts.append(any_pose(rng, sizes, sizes, depths(rng, sizes, sizes)))
    size_a, size_b = random_sizes(rng, 5 * share)
    parts.append(any_pose(rng, size_a, size_b, depths(rng, size_a, size_b)))
    for size, count, yaw in (((1.0, 1.0, 1.0), 3 * share, np.pi), (CONTAINER, 3 * share, 0.2),
                             (CONTAINER, share, np.pi), ((1.0, 0.5, 0.3), 2 * share, np.pi)):
        parts.append(stacked(rng, size, log_uniform(rng, 1e-6, 0.3, count),
                             rng.uniform(-yaw, yaw, count),
                             min(size) * log_uniform(rng, 1e-5, 0.1, count)))
    cubes = np.ones((2 * share, 3))
    for one, other in ((cubes, cubes), random_sizes(rng, 2 * share)):
        parts.append(along_edges(rng, one, other, log_uniform(rng, 1e-4, 0.3, len(one))))
    # A container that lies on its stack with a long edge or a face, as it does in every landing.
    tilt = log_uniform(rng, 1e-4, 0.02, 2 * share)
    parts.append(stacked(rng, CONTAINER, tilt, rng.uniform(-0.03, 0.03, 2 * share),
                         2.438 * tilt * log_uniform(rng, 0.1, 3.0, 2 * share), spread=0.3,
                         about=log_uniform(rng, 1e-4, 0.3, 2 * share)))
    for size in (CONTAINER, (1.0, 1.0, 1.0)):
        parts.append(stacked(rng, size, log_uniform(rng, 1e-7, 0.02, share),
                             rng.uniform(-0.03, 0.03, share),
                             min(size) * log_uniform(rng, 1e-4, 0.02, share), spread=0.1))
    size_a, size_b = random_sizes(rng, 6 * share)
    parts.append(laid(rng, size_a, size_b, log_uniform(rng, 1e-4, 0.1, 6 * share),
                      depths(rng, size_a, size_b)))
    return Pairs(*(np.concatenate(columns) for columns in zip(*parts)))


def depths(rng: np.random.Generator, size_a: np.ndarray, size_b: np.ndarray) -> np.ndarray:
    """Draw a depth [m] for each of n pairs, 1e-5 to 0.1 of its shortest edge."""
    shortest = np.minimum(size_a.min(axis=1), size_b.min(axis=1))
    return shortest * log_uniform(rng, 1e-5, 0.1, len(shortest))


def along_edges(rng: np.random.Generator, size_a: np.ndarray, size_b: np.ndarray,
                tilt: np.ndarray) -> Pairs:
    """Draw n pairs with an edge direction of B within about `tilt` (n,) [rad] of one of A's.

    B has any angle about this edge: the edges lie along each other, or on a face. Of boxes in any
    pose one in ten thousand is of this kind, and the errors were largest there.
    """
    n = len(tilt)
    axis = np.eye(3)[rng.integers(0, 3, n)]
    level = rng.normal(size=(n, 3))
    turn = quaternion_multiply(turns(level, tilt), turns(axis, rng.uniform(-np.pi, np.pi, n)))
    # Which of B's axes is along A's does not matter for cubes; sizes are drawn for all alike.
    at_b = rng.uniform(-0.5, 0.5, (n, 3)) * size_b
    place = (rng.uniform(-0.5, 0.5, (n, 3)) * size_a
             - np.einsum('nij,nj->ni', rotation_matrix(turn), at_b))
    return onto(place, turn, size_a, size_b, depths(rng, size_a, size_b))

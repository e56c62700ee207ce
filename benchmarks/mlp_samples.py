# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Samples of model `mlp`: what its network reads of a contact, and the exact answers."""
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import probes, settled
from .pose_sets import (
    CONTAINER,
    CUBE,
    Generator,
    Pairs,
    Z,
    any_pose,
    deep,
    joined,
    laid,
    log_uniform,
    onto,
    quaternion_multiply,
    random_sizes,
    stacked,
    symmetric,
    turns,
)

PIECE = 100_000  # pairs that are made at a time
NEAR_FLIP, MIRRORED = 0.02, 5
"""How near to 0 a feature that mirrors an axis is near a flip; one of so many gets an image."""


@dataclass(frozen=True, kw_only=True)
class MlpSamples:
    """What the network reads of n contacts, and the exact answers, as arrays or as tensors.

    Coordinates are those of the patch box, −1 to 1, mirrored as `features` are. Volumes are
    relative to that of the patch box.
    """

    features: Any  # (n, FEATURES)
    half: Any  # (n, 3) half extents of the patch box [the smaller box's longest edge]
    volume: Any  # (n,)
    mean: Any  # (n, 3)
    covariance: Any  # (n, 3, 3)

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
    axes, middle, half, features = probes.patch_boxes(pairs.rows(rows))
    to_box = axes.swapaxes(1, 2)
    covariance = to_box @ exact.covariance[rows] @ axes
    return MlpSamples(
        features=features, half=half / pairs.edge[rows, None],
        volume=exact.volume[rows] / (8.0 * half.prod(axis=1)),
        mean=np.einsum('nij,nj->ni', to_box, exact.point[rows] - middle) / half,
        covariance=covariance / (half[:, :, None] * half[:, None, :])), rows


def with_mirror_images(samples: MlpSamples) -> MlpSamples:
    """Return the samples, and the mirror images of some of those near a flip of an axis.

    Features 0 to 2 mirror the axes by their signs (core/src/mlp/features.hpp). Where one of them
    passes 0, the network is asked about the mirror image next, and should answer with the image.
    """
    corner = np.arange(8)  # +++ ++− … −−−: x, y, z by the bits 4, 2, 1
    parts = [samples]
    for axis in range(3):
        near = samples.part(np.flatnonzero(
            np.abs(samples.features[:, axis]) < NEAR_FLIP)[::MIRRORED])
        sign = np.where(np.arange(3) == axis, -1.0, 1.0)
        features = near.features.copy()
        features[:, :3] *= sign
        features[:, 8:11] *= [sign[0] * sign[1], sign[0] * sign[2], sign[1] * sign[2]]
        features[:, 11:] = features[:, 11 + (corner ^ (4 >> axis))]
        parts.append(MlpSamples(
            features=features, half=near.half, volume=near.volume, mean=sign * near.mean,
            covariance=np.outer(sign, sign) * near.covariance))
    return MlpSamples.joined(parts)


def draw_samples(make: Generator, seed: Sequence[int], n: int, progress: bool = False,
                 ) -> MlpSamples:
    """Return the samples among about n pairs of `make(rng, n)`.

    Each piece of PIECE pairs has its own seed.
    """
    from tqdm import tqdm

    starts = tqdm(range(0, n, PIECE), desc='data', unit='piece', disable=not progress)
    return MlpSamples.joined([
        describe(make(np.random.default_rng([*seed, start]), min(PIECE, n - start)))[0]
        for start in starts])


def nearly_settled(rng: np.random.Generator, n: int, chosen: Pairs | None = None) -> Pairs:
    """Draw recorded pairs of goods at rest, each turned and moved by up to a thousandth."""
    pairs = chosen or settled.touching(learnt=True)
    pairs = pairs.rows(rng.integers(0, len(pairs.edge), n))
    little = log_uniform(rng, 1e-8, 1e-3, (2, n)) * (rng.random((2, n)) < 0.5)
    b = pairs.pose_b.copy()
    b[:, 3:] = quaternion_multiply(turns(rng.normal(size=(n, 3)), little[0]), b[:, 3:])
    b[:, :3] += rng.normal(size=(n, 3)) * (little[1] * pairs.edge)[:, None]
    return pairs._replace(pose_b=b)


def mixture(rng: np.random.Generator, n: int) -> Pairs:
    """Draw about n pairs of the kinds that scenes have.

    Equal cubes and boxes of random sizes have any pose. Cubes, containers and flat boxes are
    stacked, tilted by 1e-6 to 0.3 rad. Boxes of random sizes and bars are laid on each other. Goods
    at rest are taken from recorded scenes. A fifth are deep in each other, and a ninth have
    a mirror.
    """
    share = n // 27
    cubes, (size_a, size_b), laid_sizes = (np.ones((2 * share, 3)), random_sizes(rng, 3 * share),
                                           random_sizes(rng, 3 * share))
    bars = np.column_stack([np.ones(share), *log_uniform(rng, 0.03, 0.3, (2, share))])
    parts = [any_pose(rng, cubes, cubes, depths(rng, cubes, cubes)),
             any_pose(rng, size_a, size_b, depths(rng, size_a, size_b)),
             laid(rng, *laid_sizes, log_uniform(rng, 1e-5, 0.1, 3 * share),
                  depths(rng, *laid_sizes)),
             onto(np.column_stack([rng.uniform(-0.3, 0.3, (share, 2)), 0.98 * bars[:, 2]]),
                  quaternion_multiply(turns((1.0, 0.0, 0.0), log_uniform(rng, 1e-5, 0.1, share)),
                                      turns(Z, rng.uniform(-np.pi, np.pi, share))),
                  bars, bars, depths(rng, bars, bars)),
             nearly_settled(rng, 2 * share), deep(rng, 5 * share),
             symmetric(rng, 3 * share)]
    for size, yaw in ((CUBE, np.pi), (CONTAINER, 0.2), (CONTAINER, np.pi),
                      ((1.0, 0.5, 0.3), np.pi)):
        parts.append(stacked(rng, size, log_uniform(rng, 1e-6, 0.3, 2 * share),
                             rng.uniform(-yaw, yaw, 2 * share),
                             min(size) * log_uniform(rng, 1e-5, 0.1, 2 * share)))
    return joined(parts)


def depths(rng: np.random.Generator, size_a: np.ndarray, size_b: np.ndarray) -> np.ndarray:
    """Draw a depth [m] for each of n pairs, 1e-5 to 0.1 of its shortest edge."""
    shortest = np.minimum(size_a.min(axis=1), size_b.min(axis=1))
    return shortest * log_uniform(rng, 1e-5, 0.1, len(shortest))

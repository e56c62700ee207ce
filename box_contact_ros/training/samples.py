# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Training samples of model `mlp`: contacts of all kinds, as the network is asked about them."""
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from ..core import stages
from ..scene.files.scene_file import read_scene
from ..scene.pose import quaternion_multiply, rotation_matrix
from ..scene.pose_sets import (
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

SizePair = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Full extents of two boxes [m]."""
ROW, COLUMN = [0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]
"""Places of the six numbers of a symmetric matrix: xx, yy, zz, yz, xz, xy."""
PIECE = 100_000
"""Pairs that are made at a time."""


@dataclass(frozen=True, kw_only=True)
class MlpSamples:
    """Features and exact answers of n contacts, each at SITES sites, counted f · 3 + q.

    Arrays of float32, or tensors. The contacts are last, so that all operations run along them.
    """

    features: Any  # (SITES, FEATURES, n)
    vectors: Any
    """(SITES, 3, n): the factors of the outputs for the point. The answer along q is the sum of
    the products over these outputs and f."""
    slant: Any  # (3, 3, n) normals of the other box's pairs of faces f, by q
    cut: Any  # (3, n) how far both faces f cut into the bounds
    offsets: Any  # (3, n) exact centroid from the middle of the bounds [half extents]
    scale: Any  # (3, n) half extents [longest edge of the smaller box]
    volume: Any  # (n,) exact volume by that of the bounds
    covariance: Any
    """(6, n) exact covariance xx, yy, zz, yz, xz, xy, frame of the bounds [half extents]."""
    spread: Any  # (3, n) half extents [root of the covariance's trace]

    def __len__(self) -> int:
        """Return n."""
        return self.offsets.shape[-1]

    def each(self, change: Callable[[Any], Any]) -> MlpSamples:
        """Return the samples with a function applied to each array."""
        return MlpSamples(**{name: change(array) for name, array in vars(self).items()})

    def part(self, rows: np.ndarray | slice) -> MlpSamples:
        """Return some of the samples."""
        return self.each(lambda array: array[..., rows])

    @staticmethod
    def joined(parts: Sequence[MlpSamples]) -> MlpSamples:
        """Return the samples of all parts, one part after the other."""
        return MlpSamples(**{name: np.concatenate([vars(part)[name] for part in parts], axis=-1)
                             for name in vars(parts[0])})


def describe(pairs: Pairs) -> MlpSamples:
    """Return the samples of pairs that overlap."""
    found = stages(*pairs, names=(
        'features', 'vectors', 'slant', 'cut', 'centroid', 'volume', 'covariance', 'frame_b',
        'rotation', 'pressed_offset_a', 'bounds_middle', 'bounds_half'))
    turn, half = found.rotation, found.bounds_half
    from_b = np.einsum('nji,nj->ni', turn, found.centroid - found.pressed_offset_a)
    centroid = np.where(found.frame_b[:, None], from_b, found.centroid)
    axes = rotation_matrix(np.where(
        found.frame_b[:, None], pairs.pose_b[:, 3:], pairs.pose_a[:, 3:]))
    covariance = np.swapaxes(axes, 1, 2) @ found.covariance @ axes
    trace = np.trace(covariance, axis1=1, axis2=2)[:, None]
    samples = MlpSamples(
        features=found.features, vectors=found.vectors, slant=found.slant, cut=found.cut,
        offsets=(centroid - found.bounds_middle) / half, scale=half / pairs.edge[:, None],
        volume=found.volume / (8.0 * half.prod(axis=1)),
        covariance=covariance[:, ROW, COLUMN] / (half[:, ROW] * half[:, COLUMN]),
        spread=half / np.sqrt(trace))
    return samples.each(lambda array: np.moveaxis(array.astype(np.float32), 0, -1).copy())


def draw_samples(make: Generator, seed: Sequence[int], n: int, progress: bool = False,
                 ) -> MlpSamples:
    """Return the samples of about n pairs of `make(rng, n)`.

    Each piece of PIECE pairs has its own seed.
    """
    starts = tqdm(range(0, n, PIECE), desc='data', unit='piece', disable=not progress)
    return MlpSamples.joined([
        describe(make(np.random.default_rng([*seed, start]), min(PIECE, n - start)))
        for start in starts])


def mixture(rng: np.random.Generator, n: int) -> Pairs:
    """Draw about n pairs of the kinds that scenes have.

    Equal cubes and random sizes in any pose, and with an edge of one almost along an edge of the
    other; stacks of boxes with a tilt of 1e-6 to 0.3 rad, and containers; containers and cubes
    stacked squarely, almost in line and flat.
    """
    share = n // 28
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


def scene_sizes(path: Path) -> list[SizePair]:
    """Return the distinct pairs of sizes in a scene file's list of pairs.

    A swapped pair counts once. So do boxes that differ in which axis is called x, y or z: extents
    are sorted, longest first. Raises SceneError for a file that is no scene.
    """
    scene = read_scene(path)
    sizes = {name: tuple(sorted(box.size, reverse=True)) for name, box in scene.boxes.items()}
    return list(dict.fromkeys(
        tuple(sorted((sizes[pair.a], sizes[pair.b]), reverse=True)) for pair in scene.pairs))


def scene_mixture(rng: np.random.Generator, n: int, sizes: Sequence[SizePair]) -> Pairs:
    """Draw about n pairs of the sizes listed, each in turn as A.

    Half are in any pose, half one on the other, any of their axes up, with a tilt of 1e-6 to
    0.3 rad.
    """
    share = max(1, n // (4 * len(sizes)))
    parts = []
    for pair in sizes:
        for one, other in (pair, pair[::-1]):
            size_a, size_b = (np.tile(size, (share, 1)) for size in (one, other))
            any_depth, laid_depth = (depths(rng, size_a, size_b) for _ in range(2))
            parts.append(any_pose(rng, size_a, size_b, any_depth))
            parts.append(laid(rng, size_a, size_b, log_uniform(rng, 1e-6, 0.3, share), laid_depth))
    return Pairs(*(np.concatenate(columns) for columns in zip(*parts)))

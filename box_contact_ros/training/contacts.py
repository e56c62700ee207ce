"""Training data of model `mlp`: contacts of all kinds, as the network sees them."""
from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ..block import (
    HALF,
    IN_B,
    LANES,
    MIDDLE,
    OFFSET_A,
    ROTATION,
    new_work,
)
from ..jit import kernel
from ..outline import (
    outline_block,
)
from ..overlap import centroid, press
from ..pose import load_block, quaternion_multiply, rotation_matrix
from ..posesets import (
    CONTAINER,
    Pairs,
    any_pose,
    laid,
    log_uniform,
    pressed,
    random_sizes,
    stacked,
    turns,
)
from ..sat import query_block
from ..sites import (
    INPUTS,
    INPUTS_OF,
    OUTPUTS,
    ROWS,
    SITES,
    describe_block,
    site_vectors,
)

SizePair = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Full extents of two boxes [m]."""
PIECE = 100_000
"""Pairs that are made at a time."""


class Contacts(NamedTuple):
    """n contacts as the network sees them: at SITES sites each, f · 3 + q."""

    inputs: np.ndarray
    """(n, SITES, INPUTS) float32."""
    vectors: np.ndarray
    """(n, SITES, OUTPUTS) float32: what outputs are multiplied with; their sum over outputs and f
    is the answer along q."""
    offsets: np.ndarray
    """(n, 3) float32: exact centroid from the bounding box's middle, in half extents."""
    scale: np.ndarray
    """(n, 3) float32: half extents, by the smaller box's longest edge."""


@kernel
def _describe(poses_a, poses_b, sizes_a, sizes_b, work, numbers, inputs, vectors, offsets, halves):
    rows = poses_a.shape[0]
    for start in range(0, rows, LANES):
        count = min(LANES, rows - start)
        load_block(poses_a, poses_b, sizes_a, sizes_b, start, count, work)
        query_block(count, work)
        for i in range(count):
            press(work, i)
        # Always a whole block: the short way of a single pair needs a pair prepared for it.
        outline_block(LANES, work)
        describe_block(work, numbers)
        for i in range(count):
            row = start + i
            for site in range(SITES):
                f, q = site // 3, site % 3
                for k in range(INPUTS):
                    inputs[row, site, k] = numbers[INPUTS_OF[site, k] * LANES + i]
                multiplied = site_vectors(numbers, f, q, i)
                for k in range(OUTPUTS):
                    vectors[row, site, k] = multiplied[k]
            x, y, z = centroid(work, i)
            in_b = work[IN_B + i] > 0.5
            for q in range(3):
                truth = x if q == 0 else (y if q == 1 else z)
                if in_b:
                    truth = (work[ROTATION + q * LANES + i] * (x - work[OFFSET_A + i])
                             + work[ROTATION + (3 + q) * LANES + i]
                             * (y - work[OFFSET_A + LANES + i])
                             + work[ROTATION + (6 + q) * LANES + i]
                             * (z - work[OFFSET_A + 2 * LANES + i]))
                half = work[HALF + q * LANES + i]
                offsets[row, q] = (truth - work[MIDDLE + q * LANES + i]) / half
                halves[row, q] = half


def describe(pairs: Pairs) -> Contacts:
    """The contacts of pairs that overlap."""
    n = len(pairs.pose_a)
    found = Contacts(*(np.empty((n, *shape), dtype=np.float32) for shape in (
        (SITES, INPUTS), (SITES, OUTPUTS), (3,), (3,))))
    _describe(*(np.ascontiguousarray(part) for part in pairs), new_work(),
              np.zeros(ROWS * LANES, dtype=np.float32), *found)
    edge = np.minimum(pairs.size_a.max(axis=1), pairs.size_b.max(axis=1))
    return found._replace(scale=(found.scale / edge[:, None]).astype(np.float32))


def contacts(make: Callable[..., Pairs], seed: Sequence[int], n: int, progress: bool = False,
             *rest: object) -> Contacts:
    """Contacts of about n pairs of `make(rng, n, *rest)`, in pieces, each with its own seed."""
    from tqdm import tqdm

    parts = []
    with tqdm(total=n, desc='data', unit='pair', unit_scale=True, mininterval=1.0,
              disable=not progress) as bar:
        for start in range(0, n, PIECE):
            count = min(PIECE, n - start)
            parts.append(describe(make(np.random.default_rng([*seed, start]), count, *rest)))
            bar.update(count)
    return Contacts(*(np.concatenate(columns) for columns in zip(*parts)))


def mixture(rng: np.random.Generator, n: int) -> Pairs:
    """About n pairs of the kinds that scenes have.

    Equal cubes and random sizes in any pose, and with an edge of one almost along an edge of the
    other; stacks of boxes with a tilt of 1e-6 to 0.3 rad, and containers; containers and cubes
    stacked squarely, almost in line and flat.
    """
    share = n // 28
    parts = []
    sizes = np.ones((4 * share, 3))
    parts.append(any_pose(rng, sizes, sizes, log_uniform(rng, 1e-5, 0.1, len(sizes))))
    size_a, size_b = random_sizes(rng, 5 * share)
    shortest = np.minimum(size_a.min(axis=1), size_b.min(axis=1))
    parts.append(any_pose(rng, size_a, size_b,
                          shortest * log_uniform(rng, 1e-5, 0.1, len(size_a))))
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


def along_edges(rng: np.random.Generator, size_a: np.ndarray, size_b: np.ndarray,
                tilt: np.ndarray) -> Pairs:
    """An edge direction of B within about `tilt` (n,) [rad] of one of A's, at any angle about it.

    These are edges that lie along each other, or on a face.

    Of boxes in any pose one in ten thousand is of this kind, and the errors were largest there.
    """
    n = len(tilt)
    axis = np.eye(3)[rng.integers(0, 3, n)]
    level = rng.normal(size=(n, 3))
    turn = quaternion_multiply(turns(level, tilt), turns(axis, rng.uniform(-np.pi, np.pi, n)))
    # Which of B's axes is along A's does not matter for cubes; sizes are drawn for all alike.
    at_b = rng.uniform(-0.5, 0.5, (n, 3)) * size_b
    place = (rng.uniform(-0.5, 0.5, (n, 3)) * size_a
             - np.einsum('nij,nj->ni', rotation_matrix(turn), at_b))
    a = np.tile([0.0, 0, 0, 0, 0, 0, 1], (n, 1))
    shortest = np.minimum(size_a.min(axis=1), size_b.min(axis=1))
    return pressed(Pairs(a, np.concatenate([place, turn], axis=1), size_a, size_b),
                   shortest * log_uniform(rng, 1e-5, 0.1, n))


def scene_mixture(rng: np.random.Generator, n: int, sizes: Sequence[SizePair]) -> Pairs:
    """About n pairs of the sizes listed, each in turn as A.

    Half are in any pose, half one on the other, any of their axes up, with a tilt of 1e-6 to
    0.3 rad.
    """
    share = max(1, n // (4 * len(sizes)))
    parts = []
    for pair in sizes:
        for one, other in (pair, pair[::-1]):
            size_a, size_b = (np.tile(size, (share, 1)) for size in (one, other))
            shortest = min(*one, *other)
            depth = shortest * log_uniform(rng, 1e-5, 0.1, (2, share))
            parts.append(any_pose(rng, size_a, size_b, depth[0]))
            parts.append(laid(rng, size_a, size_b, log_uniform(rng, 1e-6, 0.3, share), depth[1]))
    return Pairs(*(np.concatenate(columns) for columns in zip(*parts)))

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The paper's network in NumPy and float64: what the data of training and the committee need.

core/src/mlp/paper_model.hpp does the same, and its tests compare it with this. Only the network
runs in float32 here, too.
"""
from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from box_contact_ros.core import native
from box_contact_ros.models.networks import in_words, is_cube
from box_contact_ros.models.weights_file import Network, Weights
from box_contact_ros.solver.contact import Contacts
from box_contact_ros.solver.pose import rotation_matrix

INPUTS, OUTPUTS = 6, 4
"""Of a network: see `box_contact_ros.models.networks.KINDS`."""


class TouchingPairs(NamedTuple):
    """n pairs in the frames of their first boxes, moved apart until they touch."""

    first_is_b: np.ndarray  # (n,) bool
    normal: np.ndarray  # (n, 3) from the first to the second box
    offset: np.ndarray  # (n, 3) t of the second box [m], or in half edges for weights of cubes
    rotation: np.ndarray  # (n, 3, 3) R, the second box's axes as columns


def turned(matrices: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Return the products (n, 3) of matrices (n, 3, 3) and vectors (n, 3)."""
    return (matrices @ vectors[:, :, None])[:, :, 0]


def sign(values: np.ndarray) -> np.ndarray:
    """Return 1 where values are 0 or more, else −1."""
    return np.where(values >= 0.0, 1.0, -1.0)


def octant_signs(offset: np.ndarray, rotation: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the diagonals (n, 3) of M and N that fold n boxes of any shape.

    Then t' ≥ 0, and roll, pitch and yaw are in [−π/2, π/2].
    """
    m = sign(offset)
    n = np.empty_like(m)
    n[:, 0] = sign(m[:, 0] * rotation[:, 0, 0])  # cos(yaw) cos(pitch) ≥ 0
    n[:, 2] = sign(m[:, 2] * rotation[:, 2, 2])  # cos(pitch) cos(roll) ≥ 0
    n[:, 1] = m.prod(axis=1) * n[:, 0] * n[:, 2]
    return m, n


def network_inputs(offset: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Return a network's inputs (n, 6): t' (n, 3), and roll, pitch and yaw of R' (n, 3, 3)."""
    return np.concatenate([offset, euler_angles(rotation + 0.0)], axis=1)  # atan2 knows −0


def euler_angles(rotation: np.ndarray) -> np.ndarray:
    """Return roll, pitch, yaw (n, 3) [rad] of rotations (n, 3, 3) = Rz(yaw) Ry(pitch) Rx(roll)."""
    return np.stack([np.arctan2(rotation[:, 2, 1], rotation[:, 2, 2]),
                     np.arcsin(np.clip(-rotation[:, 2, 0], -1.0, 1.0)),
                     np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0])], axis=1)


def forward(network: Network, inputs: np.ndarray) -> np.ndarray:
    """Return the outputs (n, outputs) float32 of a network, hidden units tanh.

    A row is a product of its own, so its bits do not depend on the other rows.
    """
    values = inputs.astype(np.float32)
    for weight, bias in network.layers[:-1]:
        values = np.tanh((values[:, None] @ weight.T)[:, 0] + bias)
    weight, bias = network.layers[-1]
    return (values[:, None] @ weight.T)[:, 0] + bias


def directions(angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return unit vectors (n, 3) to the point and along the normal, of a network's outputs (n, 4).

    An azimuth runs from x towards y, an elevation towards z [rad].
    """
    angles = angles.astype(np.float64)
    azimuth, elevation = angles[:, 0::2], angles[:, 1::2]
    level = np.cos(elevation)
    vectors = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)],
                       axis=2)
    return vectors[:, 0], vectors[:, 1]


class NumpyPaper:
    """The paper's network 6-20-18-4 behind `ContactSolver`."""

    name = 'paper-numpy'
    networks: Mapping[str, int] = {'contact': OUTPUTS}
    """Outputs of each network in the weights file."""

    def __init__(self, weights: Weights, size: np.ndarray | None = None) -> None:
        """Size: full extents (3,) [m] of both boxes that the weights are for; None: cubes."""
        self._networks = {name: weights.network(name, INPUTS, outputs, self.name)
                          for name, outputs in self.networks.items()}
        self._cubes = size is None or is_cube(size)
        self._exact = native.Exact()

    def size_fault(self, size_a: np.ndarray, size_b: np.ndarray) -> str | None:
        """Return why the weights are not for two full extents (3,) [m], or None."""
        fits = np.array_equal(size_a, size_b) and is_cube(size_a) == self._cubes
        kind = 'cubes' if self._cubes else 'boxes'
        return None if fits else (f'{self.name} is for two {kind} of one size, not for '
                                  f'{in_words(size_a)} and {in_words(size_b)}')

    def answer(self, pairs: TouchingPairs) -> tuple[np.ndarray, np.ndarray]:
        """Return directions (n, 3) to the impact point and of the normal, first box's frame.

        Models with other networks replace this.
        """
        m, n = octant_signs(pairs.offset, pairs.rotation)
        inputs = network_inputs(m * pairs.offset, m[:, :, None] * pairs.rotation * n[:, None])
        point, normal = directions(forward(self._networks['contact'], inputs))
        return m * point, m * normal

    def solve(self, a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
              threads: int = 1) -> tuple[Contacts, int]:
        """Return contacts for poses (n, 7), sizes (n or 1, 3), and the first refused row or −1."""
        exact, refused = self._exact.solve(a, b, size_a, size_b, threads, False)
        touching = exact.colliding
        if refused < 0 and touching.any():
            half = np.broadcast_to(0.5 * size_a, (len(a), 3))[touching]
            exact.point[touching], exact.normal[touching] = self._contacts(
                a[touching], b[touching], half, exact[touching])
        return exact, refused

    def _contacts(self, a: np.ndarray, b: np.ndarray, half: np.ndarray, exact: Contacts,
                  ) -> tuple[np.ndarray, np.ndarray]:
        """Return points and normals (n, 3) in the common frame of n pairs that collide.

        a, b: poses (n, 7) [m]; half: half extents (n, 3) of either box [m].
        """
        first, pairs = touching_pairs(a, b, exact)
        if self._cubes:
            pairs = pairs._replace(offset=pairs.offset / half[:, :1])
        way, normal = self.answer(pairs)
        # The ray leaves the first box at the impact point. Its surface lies half the depth beyond
        # the middle of the overlap.
        point = way / np.max(np.abs(way) / half, axis=1, keepdims=True)
        point += 0.5 * exact.separation[:, None] * pairs.normal
        axes = rotation_matrix(first[:, 3:])
        from_a = np.where(pairs.first_is_b[:, None], -normal, normal)
        return first[:, :3] + turned(axes, point), turned(axes, from_a)


def touching_pairs(a: np.ndarray, b: np.ndarray, exact: Contacts,
                   ) -> tuple[np.ndarray, TouchingPairs]:
    """Return the poses (n, 7) of the first boxes of n pairs that collide, and the pairs from there.

    The first box is the one whose face wins; of edges it is A.
    a, b: poses (n, 7); exact: their contacts by `exact`.
    """
    first_is_b = (3 <= exact.axis) & (exact.axis < 6)
    swap = first_is_b[:, None]
    first, second = np.where(swap, b, a), np.where(swap, a, b)
    to_first = rotation_matrix(first[:, 3:]).swapaxes(1, 2)
    normal = turned(to_first, np.where(swap, -exact.normal, exact.normal))
    apart = second[:, :3] - first[:, :3]
    return first, TouchingPairs(
        first_is_b, normal,
        turned(to_first, apart) - exact.separation[:, None] * normal,
        to_first @ rotation_matrix(second[:, 3:]))

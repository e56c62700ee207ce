# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Model `paper`: contact point and normal of two equal boxes from the source paper's network.

The separating-axis test decides whether the boxes collide and gives the separation. Then:

1. `touching_pairs`: the box whose face wins is the first box (on an edge axis, A). The boxes
   are moved apart along the normal until they touch: the network knows touching boxes only.
2. `octant_signs`: symmetries bring the pair into the network's domain, t ≥ 0 and roll, pitch and
   yaw in [−π/2, π/2]. A box stays the same when an axis changes its sign, and the whole pair may be
   reflected. Let t be the second box's offset and R its orientation, in the first box's frame:
   t' = M t, R' = M R Nᵀ, det M · det N = 1, with M and N signed permutations chosen from the pose
   alone. Points and directions of the contact go back by Mᵀ.
3. `forward`: offset, roll, pitch and yaw → azimuth and elevation of the impact point, seen from the
   first box's centre, and of the normal. Only this runs in float32.
4. The impact point is where that direction leaves the first box. It goes back to the common frame,
   to the middle of the overlap's depth.

Weights are for cubes of any edge, or for the very size that they were trained for.
"""
from __future__ import annotations

import os
from typing import NamedTuple, Self

import numpy as np

from ..core import native
from ..resources import resource_path
from ..solver.checks import as_size, short_repr
from ..solver.contact import Contact, Contacts
from ..solver.pose import rotation_matrix
from .weights_file import Network, Weights, WeightsError, load_weights

INPUTS, OUTPUTS, PLACE = 6, 4, 3
"""Of a network: t_x t_y t_z roll pitch yaw → azimuth, elevation of the point, of the normal. Or →
x y z of the point, from the first box's centre [half of the longest edge]; the normal is then
SAT's."""
SHIPPED = ('paper', 'paper-12.192x2.438x2.591')
"""Weights files, for cubes of any edge and for 40 ft containers."""
SAME_SIZE = 1e-6
"""Relative difference of extents up to which two sizes are one, and a size that of the weights."""


class TouchingPairs(NamedTuple):
    """n pairs in the frames of their first boxes, moved apart until they touch."""

    first_is_b: np.ndarray  # (n,) bool
    axis: np.ndarray  # (n,) winning axis: 0–2 face of the first box, 6–14 edges
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


class Paper:
    """The paper's network 6-20-18-4 behind `ContactSolver`."""

    name = 'paper'
    networks = {'contact': OUTPUTS}
    """Outputs of each network in the weights file."""

    def __init__(self, weights: Weights) -> None:
        contact = weights.networks.get('contact')
        self._places = contact is not None and contact.widths[-1] == PLACE
        self._networks = {
            name: weights.network(name, INPUTS, PLACE if self._places else outputs, self.name)
            for name, outputs in self.networks.items()}
        self._file = weights.path.name
        try:
            self._size = as_size(weights.card['sizes'][0], 'size')[0]
        except (LookupError, TypeError, ValueError) as error:
            raise WeightsError(f'weights file {short_repr(str(weights.path))}: the sizes in its '
                               'card are no list of three extents') from error
        self._cubes = is_cube(self._size)
        self._exact = native.Exact()

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Self:
        """Return the model with the weights of a file; raises `WeightsError`."""
        return cls(load_weights(path))

    def answer(self, pairs: TouchingPairs) -> tuple[np.ndarray, np.ndarray]:
        """Return directions (n, 3) to the impact point and of the normal, first box's frame.

        Where the network gives x y z, the first is the point itself, in half of the longest edge.
        Models with other networks replace this.
        """
        m, n = octant_signs(pairs.offset, pairs.rotation)
        inputs = network_inputs(m * pairs.offset, m[:, :, None] * pairs.rotation * n[:, None])
        outputs = forward(self._networks['contact'], inputs)
        if self._places:
            return m * outputs.astype(np.float64), pairs.normal
        point, normal = directions(outputs)
        return m * point, m * normal

    def solve(self, a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
              threads: int = 1) -> tuple[Contacts, int]:
        """Return contacts for poses (n, 7), sizes (n or 1, 3), and the first refused row or −1."""
        exact, refused = self._exact.solve(a, b, size_a, size_b, threads, False)
        sizes_a, sizes_b = (np.broadcast_to(size, (len(a), 3)) for size in (size_a, size_b))
        misfits = np.flatnonzero(~self.fits(sizes_a, sizes_b))
        if len(misfits) and (refused < 0 or misfits[0] < refused):
            refused = int(misfits[0])
        touching = exact.colliding
        if refused < 0 and touching.any():
            exact.point[touching], exact.normal[touching] = self._contacts(
                a[touching], b[touching], 0.5 * sizes_a[touching], exact[touching])
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
        if self._places:
            point = way * half.max(axis=1, keepdims=True)
        else:
            point = way / np.max(np.abs(way) / half, axis=1, keepdims=True)
        point += 0.5 * exact.separation[:, None] * pairs.normal
        axes = rotation_matrix(first[:, 3:])
        from_a = np.where(pairs.first_is_b[:, None], -normal, normal)
        return first[:, :3] + turned(axes, point), turned(axes, from_a)

    def fits(self, size_a: np.ndarray, size_b: np.ndarray) -> np.ndarray:
        """Return which rows of full extents (n, 3) the weights are for, (n,)."""
        wanted = size_a[:, :1] if self._cubes else self._size
        return np.all((np.abs(size_a - size_b) <= SAME_SIZE * size_a)
                      & (np.abs(size_a - wanted) <= SAME_SIZE * wanted), axis=1)

    def size_fault(self, size_a: np.ndarray, size_b: np.ndarray) -> str | None:
        """Return why the weights are not for two full extents (3,) [m], or None."""
        if self.fits(size_a[None], size_b[None])[0]:
            return None
        known = 'cubes of one size' if self._cubes else f'boxes of {in_words(self._size)}'
        return (f'the weights {short_repr(self._file)} of model {self.name!r} are for two {known}, '
                f'not for {in_words(size_a)} and {in_words(size_b)}; any sizes work with model '
                "'exact'")


class ShippedPaper:
    """Model `paper` with the shipped weights: those for the sizes of each pair."""

    def __init__(self) -> None:
        self._papers = [Paper.read(resource_path('weights', f'{name}.safetensors'))
                        for name in SHIPPED]

    def solve(self, a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
              threads: int = 1) -> tuple[Contacts, int]:
        """Return contacts for poses (n, 7), sizes (n or 1, 3), and the first refused row or −1."""
        size_a, size_b = (np.broadcast_to(size, (len(a), 3)) for size in (size_a, size_b))
        fits = np.array([paper.fits(size_a, size_b) for paper in self._papers])
        which = fits.argmax(axis=0)  # 0, which refuses it, of a row that no weights are for
        if not which.any():
            return self._papers[0].solve(a, b, size_a, size_b, threads)
        order = np.argsort(which, kind='stable')
        found: list[Contact] = []
        refusals = []
        for number, paper in enumerate(self._papers):
            rows = np.flatnonzero(which == number)
            part, refused = paper.solve(a[rows], b[rows], size_a[rows], size_b[rows], threads)
            found += part
            refusals += [int(rows[refused])] if refused >= 0 else []
        return Contacts.of(found)[np.argsort(order)], min(refusals, default=-1)

    def size_fault(self, size_a: np.ndarray, size_b: np.ndarray) -> str | None:
        """Return why no weights are for two full extents (3,) [m], or None."""
        if any(paper.size_fault(size_a, size_b) is None for paper in self._papers):
            return None
        return (f"model 'paper' has no weights for boxes of {in_words(size_a)} and "
                f'{in_words(size_b)}: train them and give make_model their file, or use model '
                "'exact', which needs none")


def touching_pairs(a: np.ndarray, b: np.ndarray, exact: Contacts,
                   ) -> tuple[np.ndarray, TouchingPairs]:
    """Return the poses (n, 7) of the first boxes of n pairs that collide, and the pairs from there.

    a, b: poses (n, 7); exact: their contacts by `exact`.
    """
    first_is_b = (3 <= exact.axis) & (exact.axis < 6)
    swap = first_is_b[:, None]
    first, second = np.where(swap, b, a), np.where(swap, a, b)
    to_first = rotation_matrix(first[:, 3:]).swapaxes(1, 2)
    normal = turned(to_first, np.where(swap, -exact.normal, exact.normal))
    apart = second[:, :3] - first[:, :3]
    return first, TouchingPairs(
        first_is_b, np.where(first_is_b, exact.axis - 3, exact.axis), normal,
        turned(to_first, apart) - exact.separation[:, None] * normal,
        to_first @ rotation_matrix(second[:, 3:]))


def is_cube(size: np.ndarray) -> bool:
    """Return whether full extents (3,) are those of a cube."""
    return bool(np.ptp(size) <= SAME_SIZE * size.max())


def in_words(size: np.ndarray) -> str:
    """Return full extents (3,) [m] for a refusal."""
    return ' × '.join(f'{extent:g}' for extent in size) + ' m'


def in_file_name(size: np.ndarray) -> str:
    """Return full extents (3,) as the names of weights files have them: nothing for cubes."""
    return '' if is_cube(size) else '-' + 'x'.join(f'{extent:g}' for extent in size)

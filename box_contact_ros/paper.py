"""Models `paper` and `paper-continuous`: the contact point and normal from the source's networks.

SAT decides whether the boxes collide and gives the separation. Then, for each pair:

1. Roles: the box whose face wins is the first box (on an edge axis, A).
2. The boxes are moved apart along SAT's normal until they touch, which is what the networks know.
3. Symmetries bring the pose into the networks' domain (`symmetry`).
4. Network: offset and roll, pitch, yaw → azimuth and elevation of the impact point, seen from the
   first box's centre, and of the normal.
5. The impact point is where that direction leaves the first box; point and normal go back through
   the symmetries, and the point to the middle of the overlap depth.

One network for all poses is `paper`; `paper-continuous` has one per subset without discontinuities,
chosen by the features that SAT says meet. Both are for two equal boxes: cubes of any edge, or the
very size that the weights were trained for (`paper` only).
"""
from __future__ import annotations

import math

import numpy as np

from .block import (
    AXIS,
    HALF_A,
    LANES,
    OFFSET_A,
    OFFSET_B,
    ROTATION,
    SEPARATION,
    TOUCH,
    new_work,
)
from .checks import as_size
from .contact import Contacts, sat_normal, write_apart, write_contact, write_faults
from .jit import kernel
from .network import Network, Weights, WeightsError, forward, load_weights
from .pose import (
    load_block,
)
from .resources import resource_path
from .sat import query_block
from .symmetry import FOLD_SIZE, OFFSET, euler_angles, fold_features, fold_octant, unfold

INPUTS, OUTPUTS = 6, 4
SAME_SIZE = 1e-9
"""Relative difference of extents up to which a size is the one that the weights were made for."""


@kernel
def direction_from_angles(azimuth, elevation):
    """Unit vector (x, y, z) of azimuth (from x towards y) and elevation (towards z) [rad]."""
    level = math.cos(elevation)
    return level * math.cos(azimuth), level * math.sin(azimuth), math.sin(elevation)


@kernel
def leave_box(x, y, z, h0, h1, h2):
    """Where a ray from the centre in direction (x, y, z) leaves a box of half extents h."""
    reach = max(max(abs(x) / h0, abs(y) / h1), abs(z) / h2)
    return x / reach, y / reach, z / reach


@kernel
def _learned_contact(work, i, cubes, continuous, packed, widths, activation, fold, pair):
    """Point and normal (each 3, in A's frame) of pair `i`, by the networks.

    packed: (networks, parameters); pair: scratch of 15 numbers.
    """
    n = sat_normal(work, i)
    depth = -work[SEPARATION + i]
    axis = int(work[AXIS + i])
    swapped = 3 <= axis < 6
    t, r, normal = pair[:3], pair[3:12], pair[12:15]
    # 1. and 2. The second box in the first box's frame, moved apart by the depth.
    for k in range(3):
        if swapped:
            normal[k] = -(work[ROTATION + k * LANES + i] * n[0]
                          + work[ROTATION + (3 + k) * LANES + i] * n[1]
                          + work[ROTATION + (6 + k) * LANES + i] * n[2])
            t[k] = -work[OFFSET_B + k * LANES + i] + depth * normal[k]
        else:
            normal[k] = n[k]
            t[k] = work[OFFSET_A + k * LANES + i] + depth * n[k]
        for j in range(3):
            r[3 * k + j] = work[ROTATION + ((3 * j + k) if swapped else (3 * k + j)) * LANES + i]
    # 3. Both boxes have one size. Networks for cubes know cubes of edge 2.
    h0, h1, h2 = (work[HALF_A + i], work[HALF_A + LANES + i], work[HALF_A + 2 * LANES + i])
    if cubes:
        for k in range(3):
            t[k] /= h0
    if continuous:
        expert = fold_features(t, r, axis - 3 if swapped else axis, normal, fold)
    else:
        expert = 0
        fold_octant(t, r, fold)
    roll, pitch, yaw = euler_angles(fold)
    # 4.
    for k in range(3):
        activation[0, k] = fold[OFFSET + k]
    activation[0, 3] = roll
    activation[0, 4] = pitch
    activation[0, 5] = yaw
    out = activation[forward(packed[expert], widths, activation)]
    # 5. Signed permutations map an octant of directions to an octant, so the ray may be cut off
    #    after it has been folded back. Only the network runs in float32.
    d = direction_from_angles(np.float64(out[0]), np.float64(out[1]))
    d = unfold(fold, d[0], d[1], d[2])
    p = leave_box(d[0], d[1], d[2], h0, h1, h2)
    m = direction_from_angles(np.float64(out[2]), np.float64(out[3]))
    m = unfold(fold, m[0], m[1], m[2])
    half = 0.5 * depth
    if not swapped:
        return ((p[0] - half * n[0], p[1] - half * n[1], p[2] - half * n[2]), m)
    # From B's frame, B moved away by the depth, to A's; the normal turns from B → A to A → B.
    return ((work[OFFSET_A + i] + half * n[0]
             + (r[0] * p[0] + r[3] * p[1] + r[6] * p[2]),
             work[OFFSET_A + LANES + i] + half * n[1]
             + (r[1] * p[0] + r[4] * p[1] + r[7] * p[2]),
             work[OFFSET_A + 2 * LANES + i] + half * n[2]
             + (r[2] * p[0] + r[5] * p[1] + r[8] * p[2])),
            (-(r[0] * m[0] + r[3] * m[1] + r[6] * m[2]),
             -(r[1] * m[0] + r[4] * m[1] + r[7] * m[2]),
             -(r[2] * m[0] + r[5] * m[1] + r[8] * m[2])))


@kernel
def solve_paper(poses_a, poses_b, sizes_a, sizes_b, work, cubes, continuous, packed, widths,
                activation, fold, pair, status, colliding, separation, normal, point):
    """Models `paper` and `paper-continuous` for all rows; returns the number of rows refused."""
    bad = 0
    rows = poses_a.shape[0]
    for start in range(0, rows, LANES):
        count = min(LANES, rows - start)
        refused = load_block(poses_a, poses_b, sizes_a, sizes_b, start, count, work)
        if refused:
            bad += refused
            write_faults(work, start, count, status)
        query_block(count, work)
        for i in range(count):
            if work[SEPARATION + i] <= work[TOUCH + i]:
                p, n = _learned_contact(work, i, cubes, continuous, packed, widths, activation,
                                        fold, pair)
                write_contact(work, i, start + i, n, p, colliding, separation, normal, point)
            else:
                write_apart(work, i, start + i, colliding, separation, normal, point)
    return bad


def weights_name(model: str, size: np.ndarray) -> str:
    """Name of the shipped weights of a paper model for two boxes of `size` (3,) [m]."""
    if _is_cube(size):
        return model
    return f'{model}-' + 'x'.join(f'{extent:g}' for extent in size)


def _is_cube(size: np.ndarray) -> bool:
    return bool(np.ptp(size) <= SAME_SIZE * size.max())


class Paper:
    """The source's networks behind the solver's interface.

    size_a, size_b: (1, 3) full extents [m]; weights: a file, or None for the shipped one.
    Raises ValueError for sizes that no weights are for.
    """

    continuous = False
    model = 'paper'
    experts: tuple[str, ...] = ('contact',)

    def __init__(self, size_a: np.ndarray, size_b: np.ndarray, weights: str | None) -> None:
        size = size_a[0]
        self._check_equal(size_a, size_b)
        self.weights = self._load(size, weights)
        networks = [self._network(name) for name in self.experts]
        try:
            self._size = as_size(self.weights.card['sizes'][0], 'size')[0]
        except (LookupError, TypeError, ValueError) as error:
            raise WeightsError(f'weights file {self.weights.path}: the sizes in its card are no '
                               f'list of three extents') from error
        self._cubes = _is_cube(self._size)
        self._check_sizes(size_a, size_b)
        self._packed = np.stack([network.packed for network in networks])
        self._widths = np.array(networks[0].widths, dtype=np.int64)
        self._activation = np.zeros((2, max(networks[0].widths)), dtype=np.float32)
        self._work = new_work()
        self._fold = np.zeros(FOLD_SIZE)
        self._pair = np.zeros(15)

    def _load(self, size: np.ndarray, weights: str | None) -> Weights:
        if weights:
            return load_weights(weights)
        name = f'{weights_name(self.model, size)}.safetensors'
        try:
            return load_weights(resource_path('weights', name))
        except FileNotFoundError as error:
            raise WeightsError(
                f'model {self.model!r} has no weights for boxes of size {_text(size)}: train them, '
                f"name a file with `weights`, or use model 'exact', which needs none") from error

    def _network(self, name: str) -> Network:
        network = self.weights.networks.get(name)
        if network is None or (network.widths[0], network.widths[-1]) != (INPUTS, OUTPUTS):
            raise WeightsError(
                f'weights file {self.weights.path} has no network {name!r} with {INPUTS} inputs '
                f'and {OUTPUTS} outputs, which model {self.model!r} needs')
        return network

    def _check_equal(self, size_a: np.ndarray, size_b: np.ndarray) -> None:
        differs = np.any(np.abs(size_a - size_b) > SAME_SIZE * size_a, axis=1)
        if differs.any():
            row = int(np.argmax(differs))
            raise ValueError(
                f'model {self.model!r} is for two boxes of one size, not '
                f'{_text(size_a[row % len(size_a)])} and '
                f"{_text(size_b[row % len(size_b)])}; any sizes work with model 'exact'")

    def _check_sizes(self, size_a: np.ndarray, size_b: np.ndarray) -> None:
        self._check_equal(size_a, size_b)
        for size in size_a:
            fits = (_is_cube(size) if self._cubes
                    else np.allclose(size, self._size, rtol=SAME_SIZE, atol=0.0))
            if not fits:
                known = 'cubes' if self._cubes else _text(self._size)
                raise ValueError(
                    f'the weights {self.weights.path.name} of model {self.model!r} are for {known},'
                    f" not for size {_text(size)}; any size works with model 'exact'")

    def solve(self, a: np.ndarray, b: np.ndarray, size_a: np.ndarray, size_b: np.ndarray,
              status: np.ndarray, found: Contacts) -> int:
        """Fill `found` for poses (n, 7); returns how many rows `status` refuses."""
        self._check_sizes(size_a, size_b)
        return int(solve_paper(a, b, size_a, size_b, self._work, self._cubes, self.continuous,
                               self._packed, self._widths, self._activation, self._fold,
                               self._pair, status, *found))


class PaperContinuous(Paper):
    """One network per subset on which the map is continuous; cubes only."""

    continuous = True
    model = 'paper-continuous'
    experts = ('vertex_face', 'edge_edge')  # in the order of symmetry.VERTEX_FACE, EDGE_EDGE

    def _check_sizes(self, size_a: np.ndarray, size_b: np.ndarray) -> None:
        if not self._cubes:
            raise WeightsError(f'model {self.model!r} needs weights for cubes')
        super()._check_sizes(size_a, size_b)


def _text(size: np.ndarray) -> str:
    return ' × '.join(f'{extent:g}' for extent in size) + ' m'

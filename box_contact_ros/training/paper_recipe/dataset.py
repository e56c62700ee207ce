# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The data of the paper's section 3: pairs of boxes that just touch, and where they do.

1. Placements. The first box stays at the origin. Its trihedron is its faces +x, +y, +z. The second
   box's trihedron is its faces −x, −y, −z, with the corner (−, −, −) and 7 vertices. Roll, pitch
   and yaw of the second box are drawn uniformly in [−π/2, π/2].
   - vertex-face: a point is drawn uniformly by area on the first trihedron. One of the 7 vertices
     is placed on the point. The normal is the face's.
   - edge-edge: a point is drawn uniformly by length on the 9 edges of each trihedron. The second
     point is placed on the first. The normal is the cross product of the edges, from the first box
     to the second.
   Placements in which the boxes interpenetrate are thrown away. In all others, one plane through
   the point separates the boxes. So the label depends on the pose alone.
2. Patterns. Inputs are the second box's offset t [m], and its roll, pitch and yaw [rad], in the
   first box's frame: R = Rz(yaw) Ry(pitch) Rx(roll). Outputs are azimuth and elevation [rad] of the
   impact point's direction from the first box's centre, then of the normal.
   - `paper`: folded into the network's domain, or left as drawn. The fold is `symmetry.OCTANT`:
     t ≥ 0, angles in [−π/2, π/2].
   - `continuous`: for cubes. The features that meet, by SAT, choose the subset. The fold
     `symmetry.FEATURES` brings them to the reference features. The same pose always falls in the
     same subset, however it was drawn.

Everything is drawn from one seed, every set from a stream of its own. So any set can be made
without the others.
"""
from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...baselines.paper.symmetry import EDGE_EDGE, FEATURES, NO_FOLD, OCTANT, VERTEX_FACE
from ...baselines.paper.symmetry import fold as fold_pairs
from ...core import Stages, stages
from ...scene.pose import quaternion_multiply, rotation_matrix
from ...scene.pose_sets import CUBE, turns

SETS = ('training', 'cross-validation', 'external')
PAPER_COUNTS = (8000, 5000, 75000)  # patterns per set, with discontinuities
CONTINUOUS_COUNTS = (10000, 6000, 50000)  # patterns per set and subset, without discontinuities
SUBSETS = {'vertex_face': VERTEX_FACE, 'edge_edge': EDGE_EDGE}

INPUTS = ('t_x', 't_y', 't_z', 'roll', 'pitch', 'yaw')
OUTPUTS = ('point azimuth', 'point elevation', 'normal azimuth', 'normal elevation')

INTERPENETRATION = 1e-12
"""Depth, as a fraction of the largest extent, from which on boxes interpenetrate. Rounding gives a
placement made to touch a depth of some 1e-16. Of the random placements that overlap, one in 1e11
would be let through."""

POLE = 1e-12
"""Sine of the angle to the z axis below which a direction is the pole and its azimuth is 0. It is
far above the rounding of a unit vector, and far below anything that is drawn."""

CHUNK = 1 << 15  # candidates drawn at a time


@dataclass(frozen=True)
class Placements:
    """n pairs of boxes of the same size that just touch, in the first box's frame."""

    size: tuple[float, float, float]  # full extents of either box [m]
    pose: np.ndarray  # (n, 7) pose of the second box, x y z qx qy qz qw
    point: np.ndarray  # (n, 3) impact point [m]
    normal: np.ndarray  # (n, 3) unit normal, out of the first box

    def __len__(self) -> int:
        return len(self.pose)

    def __getitem__(self, rows: np.ndarray | slice) -> Placements:
        return Placements(self.size, self.pose[rows], self.point[rows], self.normal[rows])


@dataclass(frozen=True)
class Patterns:
    """n patterns for a network: see the module's docstring, 2."""

    inputs: np.ndarray  # (n, 6) t [m]; roll, pitch, yaw [rad]
    outputs: np.ndarray
    """(n, 4) azimuth and elevation [rad] of the impact point, then of the normal."""

    def __len__(self) -> int:
        return len(self.inputs)


def _joined(parts: Sequence[Placements]) -> Placements:
    return Placements(parts[0].size, *(np.concatenate([getattr(part, name) for part in parts])
                                       for name in ('pose', 'point', 'normal')))


def quaternion_from_euler(angles: np.ndarray) -> np.ndarray:
    """Quaternions (n, 4) xyzw of Rz(yaw) Ry(pitch) Rx(roll); angles (n, 3) roll, pitch, yaw."""
    roll, pitch, yaw = (turns(axis, angle) for axis, angle in zip(np.eye(3), angles.T))
    return quaternion_multiply(yaw, quaternion_multiply(pitch, roll))


def as_poses(inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return poses (n, 7) of A and B of inputs (n, 6): offset [m] and roll, pitch, yaw [rad]."""
    pose_a = np.tile([0.0, 0, 0, 0, 0, 0, 1], (len(inputs), 1))
    return pose_a, np.concatenate([inputs[:, :3], quaternion_from_euler(inputs[:, 3:])], axis=1)


def vertex_face_candidates(rng: np.random.Generator, count: int, half: np.ndarray) -> Placements:
    """Put a vertex of the second trihedron on a random point of the first; most interpenetrate."""
    area = np.prod(half) / half
    face = rng.choice(3, count, p=area / area.sum())
    point = rng.uniform(-half, half, (count, 3))
    rows = np.arange(count)
    point[rows, face] = half[face]
    # The bits of 0 … 6 are the seven vertices; 7 would be (+, +, +), which is on none of its faces.
    bits = rng.integers(0, 7, count)[:, None] >> np.arange(3) & 1
    vertex = np.where(bits == 1, half, -half)
    pose = _placed(rng, point, vertex)
    return Placements(tuple((2.0 * half).tolist()), pose, point, np.eye(3)[face])


def edge_edge_candidates(rng: np.random.Generator, count: int, half: np.ndarray) -> Placements:
    """Put a random point of the second trihedron's edges on one of the first's."""
    point, along_a = _edge_points(rng, count, half)
    on_b, along_b = _edge_points(rng, count, half)
    pose = _placed(rng, point, -on_b)
    direction_b = rotation_matrix(pose[:, 3:])[np.arange(count), :, along_b]
    normal = np.cross(np.eye(3)[along_a], direction_b)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    normal *= np.where(np.sum(normal * pose[:, :3], axis=1) < 0.0, -1.0, 1.0)[:, None]
    return Placements(tuple((2.0 * half).tolist()), pose, point, normal)


def _edge_points(rng: np.random.Generator, count: int, half: np.ndarray,
                 ) -> tuple[np.ndarray, np.ndarray]:
    """Points (count, 3) on the 9 edges of the faces +x, +y, +z, and their edges' axes (count,)."""
    axis = rng.choice(3, count, p=half / half.sum())
    # Three of the four edges along an axis belong to the trihedron: not the one at (−, −).
    at = rng.integers(1, 4, count)
    rows = np.arange(count)
    point = np.empty((count, 3))
    point[rows, axis] = rng.uniform(-1.0, 1.0, count)
    point[rows, (axis + 1) % 3] = np.where(at & 1, 1.0, -1.0)
    point[rows, (axis + 2) % 3] = np.where(at & 2, 1.0, -1.0)
    return point * half, axis


def _placed(rng: np.random.Generator, point: np.ndarray, on_b: np.ndarray) -> np.ndarray:
    """Return poses (n, 7) of a second box, turned at random, with its `on_b` (n, 3) on `point`."""
    angles = rng.uniform(-0.5 * np.pi, 0.5 * np.pi, (len(point), 3))
    quaternion = quaternion_from_euler(angles)
    offset = point - np.einsum('nij,nj->ni', rotation_matrix(quaternion), on_b)
    return np.concatenate([offset, quaternion], axis=1)


GENERATORS = (vertex_face_candidates, edge_edge_candidates)


def touching(rng: np.random.Generator, count: int, size: Sequence[float],
             candidates: Callable[[np.random.Generator, int, np.ndarray], Placements],
             ) -> Placements:
    """`count` placements of one of the two kinds that do not interpenetrate."""
    half = 0.5 * np.asarray(size, dtype=np.float64)
    kept: list[Placements] = []
    while sum(map(len, kept)) < count:
        drawn = candidates(rng, CHUNK, half)
        separation = query(drawn).separation
        kept.append(drawn[separation >= -INTERPENETRATION * max(size)])
    return _joined(kept)[:count]


def mixed(rng: np.random.Generator, count: int, size: Sequence[float], edge_share: float,
          ) -> Placements:
    """`count` placements of both kinds in random order, `edge_share` of them edge-edge."""
    edges = round(edge_share * count)
    parts = [touching(rng, wanted, size, candidates)
             for wanted, candidates in zip((count - edges, edges), GENERATORS) if wanted]
    return _joined(parts)[rng.permutation(count)]


def query(placements: Placements) -> Stages:
    """Return separation, axis, normal, offset_a and rotation of every placement, by SAT."""
    first = np.tile([0.0, 0, 0, 0, 0, 0, 1], (len(placements), 1))
    size = [placements.size]
    return stages(first, placements.pose, size, size,
                  names=('separation', 'axis', 'normal', 'offset_a', 'rotation'))


@dataclass(frozen=True)
class Folded:
    """n placements in a network's domain."""

    inputs: np.ndarray  # (n, 6) t [m]; roll, pitch, yaw [rad]
    point: np.ndarray  # (n, 3) impact point [m]
    normal: np.ndarray  # (n, 3)
    subset: np.ndarray  # (n,) VERTEX_FACE or EDGE_EDGE after FEATURES, else −1

    def patterns(self, rows: np.ndarray | slice = slice(None)) -> Patterns:
        """Return the inputs and outputs of some rows."""
        return Patterns(self.inputs[rows], np.concatenate(
            [spherical(self.point[rows]), spherical(self.normal[rows])], axis=1))


def fold(placements: Placements, how: int) -> Folded:
    """Bring placements into a network's domain by NO_FOLD, OCTANT or FEATURES."""
    if how == FEATURES and len(set(placements.size)) != 1:
        raise ValueError(f'features are folded for cubes, not for {placements.size}')
    sat = query(placements)
    folds = fold_pairs(how, sat.offset_a, sat.rotation, axis=sat.axis, normal=sat.normal)
    point, normal = placements.point, placements.normal
    # Without a fold, zeros keep the signs that tell the azimuths π and −π apart.
    if how != NO_FOLD:
        point, normal = folds.folded(point), folds.folded(normal)
    return Folded(np.concatenate([folds.offset, folds.angles], axis=1), point, normal,
                  folds.subset)


def spherical(direction: np.ndarray) -> np.ndarray:
    """Azimuth in [−π, π] and elevation in [−π/2, π/2] [rad] (n, 2) of directions (n, 3).

    The polar axis is z; the azimuth of the poles is 0.
    """
    x, y, z = direction.T
    across = np.hypot(x, y)
    pole = across <= POLE * np.abs(z)
    return np.column_stack([np.where(pole, 0.0, np.arctan2(y, x)), np.arctan2(z, across)])


def _streams(seed: int, counts: Sequence[int], sets: Sequence[str],
             ) -> Iterator[tuple[str, int, np.random.Generator]]:
    """Yield name, number of patterns and random stream of the sets asked for."""
    for number, name in enumerate(SETS):
        if name in sets:
            yield name, counts[number], np.random.default_rng([seed, number])


def paper(seed: int, *, size: Sequence[float] = CUBE, counts: Sequence[int] = PAPER_COUNTS,
          folded_in: bool = True, edge_share: float = 0.5, sets: Sequence[str] = SETS,
          ) -> dict[str, Patterns]:
    """Return the sets with discontinuities, for two boxes of full extents `size` [m].

    `folded_in`: in the domain of `symmetry.OCTANT`, as at inference; otherwise as drawn.
    `edge_share` of the patterns are edge-edge.
    """
    how = OCTANT if folded_in else NO_FOLD
    return {name: fold(mixed(rng, count, size, edge_share), how).patterns()
            for name, count, rng in _streams(seed, counts, sets)}


def continuous(seed: int, *, counts: Sequence[int] = CONTINUOUS_COUNTS, edge_share: float = 0.5,
               sets: Sequence[str] = SETS) -> dict[str, dict[str, Patterns]]:
    """Return the sets of each subset without discontinuities, for two cubes of edge 2."""
    result: dict[str, dict[str, Patterns]] = {subset: {} for subset in SUBSETS}
    for name, count, rng in _streams(seed, counts, sets):
        found: dict[str, list[Patterns]] = {subset: [] for subset in SUBSETS}
        # Only SAT tells a placement's subset. Placements are drawn until the smaller subset is
        # full; the larger one is cut to the same number.
        while min(sum(map(len, parts)) for parts in found.values()) < count:
            some = fold(mixed(rng, 2 * count, CUBE, edge_share), FEATURES)
            for subset, number in SUBSETS.items():
                found[subset].append(some.patterns(some.subset == number))
        for subset, parts in found.items():
            result[subset][name] = Patterns(np.concatenate([p.inputs for p in parts])[:count],
                                            np.concatenate([p.outputs for p in parts])[:count])
    return result


def of_card(card: Mapping[str, Any], sets: Sequence[str] = SETS,
            ) -> dict[str, dict[str, Patterns]]:
    """Return the sets a model card speaks of, made again: per network, per set."""
    data = card['data']
    counts = [data['counts'][name] for name in SETS]
    options = {'counts': counts, 'edge_share': data['edge_share'], 'sets': sets}
    if card['model'] == 'paper-continuous':
        return continuous(card['seed'], **options)
    return {'contact': paper(card['seed'], size=card['sizes'][0],
                             folded_in=data['folded_in'], **options)}

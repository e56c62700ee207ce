# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The data of the paper's section 3: pairs of cubes that just touch, and where they do.

1. Placements. The first box stays at the origin. Its trihedron is its faces +x, +y, +z. The second
   box's trihedron is its faces −x, −y, −z, with the corner (−, −, −) and 7 vertices. Roll, pitch
   and yaw of the second box are drawn uniformly in [−π/2, π/2].
   - vertex-face: a point is drawn uniformly by area on the first trihedron. One of the 7 vertices
     is placed on the point. The normal is the face's.
   - edge-edge: a point is drawn uniformly by length on the 9 edges of each trihedron. The second
     point is placed on the first. The normal is the cross product of the edges, from the first box
     to the second.
   The paper does not say whether placements in which the boxes interpenetrate are dropped. `kept`
   is the share of a set that is placed as the paper writes, where they are not. In all others, one
   plane through the point separates the boxes, so the label depends on the pose alone.
2. Patterns. Inputs are the second box's offset t [m], and its roll, pitch and yaw [rad], in the
   first box's frame: R = Rz(yaw) Ry(pitch) Rx(roll). Outputs are azimuth and elevation [rad] of the
   impact point's direction from the first box's centre, then of the normal.
   - `paper`: folded into the network's domain, or left as drawn. The fold is `models.to_octant`:
     t ≥ 0, angles in [−π/2, π/2].
   - `by_signs`: left as drawn. The signs of the three angles choose the subset.
   - `committee`: folded like `paper`. Each expert has placements of one kind. The third kind is
     face-face: see `face_face_candidates`. The classifier has all three kinds, and an output for
     each: 1 for the kind of the placement, 0 for the others.

Everything is drawn from one seed, every set from a stream of its own.
"""
from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from box_contact_ros.solver.contact import Contacts
from box_contact_ros.solver.contact_solver import ContactSolver
from box_contact_ros.solver.pose import rotation_matrix

from ..pose_sets import CUBE, quaternion_multiply, turns
from .models import EXPERTS, to_octant
from .numpy_model import euler_angles

SETS = ('training', 'cross-validation', 'external')
PAPER_COUNTS = (8000, 5000, 75000)  # patterns per set, with discontinuities
CONTINUOUS_COUNTS = (10000, 6000, 50000)  # patterns per set and subset, without discontinuities
Kept = float | Sequence[float]  # share of placements as written, of all sets or of each

INPUTS = ('t_x', 't_y', 't_z', 'roll', 'pitch', 'yaw')
OUTPUTS = ('point azimuth', 'point elevation', 'normal azimuth', 'normal elevation')

INTERPENETRATION = 1e-12
"""Depth, as a fraction of the edge, from which on cubes interpenetrate. Rounding gives a
placement made to touch a depth of some 1e-16. Of the random placements that overlap, one in 1e11
would be let through."""

POLE = 1e-12
"""Sine of the angle to the z axis below which a direction is the pole and its azimuth is 0. It is
far above the rounding of a unit vector, and far below anything that is drawn."""

TILT = 0.02
"""Largest angle between two faces that lie on each other [rad]."""
AXES_IN_TURN = 0.5 * np.array([[0.0, 0, 0, 2], [1, 1, 1, 1], [-1, -1, -1, 1]])
"""Quaternions xyzw that leave the axes of a cube, or bring each to the next or to the last."""
PRESSED = 1e-3  # depth [m] at which the middle of two faces' overlap is measured

CHUNK = 1 << 15  # candidates drawn at a time
_THIRDS = np.full(3, 1.0 / 3.0)


@dataclass(frozen=True)
class Placements:
    """n pairs of cubes of edge 2 that just touch, in the first one's frame."""

    inputs: np.ndarray  # (n, 6) of the second box: t [m]; roll, pitch, yaw [rad]
    point: np.ndarray  # (n, 3) impact point [m]
    normal: np.ndarray  # (n, 3) unit normal, out of the first box

    @property
    def pose(self) -> np.ndarray:
        """Return the poses (n, 7) of the second box, x y z qx qy qz qw."""
        return as_poses(self.inputs)[1]

    @property
    def rotation(self) -> np.ndarray:
        """Return the axes (n, 3, 3) of the second box as columns."""
        return rotation_matrix(self.pose[:, 3:])

    def __len__(self) -> int:
        return len(self.inputs)

    def __getitem__(self, rows: np.ndarray | slice) -> Placements:
        return Placements(self.inputs[rows], self.point[rows], self.normal[rows])


@dataclass(frozen=True)
class Patterns:
    """n patterns for a network: see the module's docstring, 2."""

    inputs: np.ndarray  # (n, 6) t [m]; roll, pitch, yaw [rad]
    outputs: np.ndarray
    """(n, 4) azimuth and elevation [rad] of the impact point, then of the normal."""

    def __len__(self) -> int:
        return len(self.inputs)


def _joined(parts: Sequence[Placements]) -> Placements:
    return Placements(*(np.concatenate([getattr(part, name) for part in parts])
                        for name in ('inputs', 'point', 'normal')))


def quaternion_from_euler(angles: np.ndarray) -> np.ndarray:
    """Quaternions (n, 4) xyzw of Rz(yaw) Ry(pitch) Rx(roll); angles (n, 3) roll, pitch, yaw."""
    roll, pitch, yaw = (turns(axis, angle) for axis, angle in zip(np.eye(3), angles.T))
    return quaternion_multiply(yaw, quaternion_multiply(pitch, roll))


def as_poses(inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return poses (n, 7) of A and B of inputs (n, 6): offset [m] and roll, pitch, yaw [rad]."""
    pose_a = np.tile([0.0, 0, 0, 0, 0, 0, 1], (len(inputs), 1))
    return pose_a, np.concatenate([inputs[:, :3], quaternion_from_euler(inputs[:, 3:])], axis=1)


def _angles(rng: np.random.Generator, count: int) -> np.ndarray:
    """Return roll, pitch, yaw (count, 3) [rad]."""
    return rng.uniform(-0.5 * np.pi, 0.5 * np.pi, (count, 3))


def vertex_face_candidates(rng: np.random.Generator, count: int) -> Placements:
    """Put a vertex of the second trihedron on a random point of the first; most interpenetrate."""
    face = rng.choice(3, count, p=_THIRDS)
    point = rng.uniform(-1.0, 1.0, (count, 3))
    point[np.arange(count), face] = 1.0
    # The bits of 0 … 6 are the seven vertices; 7 would be (+, +, +), which is on none of its faces.
    bits = rng.integers(0, 7, count)[:, None] >> np.arange(3) & 1
    inputs, _ = _placed(point, 2.0 * bits - 1.0, _angles(rng, count))
    return Placements(inputs, point, np.eye(3)[face])


def edge_edge_candidates(rng: np.random.Generator, count: int) -> Placements:
    """Put a random point of the second trihedron's edges on one of the first's."""
    point, along_a = _edge_points(rng, count)
    on_b, along_b = _edge_points(rng, count)
    inputs, rotation = _placed(point, -on_b, _angles(rng, count))
    normal = np.cross(np.eye(3)[along_a], rotation[np.arange(count), :, along_b])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    normal *= np.where(np.sum(normal * inputs[:, :3], axis=1) < 0.0, -1.0, 1.0)[:, None]
    return Placements(inputs, point, normal)


def _edge_points(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (count, 3) on the 9 edges of the faces +x, +y, +z, and their edges' axes (count,)."""
    axis = rng.choice(3, count, p=_THIRDS)
    # Three of the four edges along an axis belong to the trihedron: not the one at (−, −).
    at = rng.integers(1, 4, count)
    rows = np.arange(count)
    point = np.empty((count, 3))
    point[rows, axis] = rng.uniform(-1.0, 1.0, count)
    point[rows, (axis + 1) % 3] = np.where(at & 1, 1.0, -1.0)
    point[rows, (axis + 2) % 3] = np.where(at & 2, 1.0, -1.0)
    return point, axis


def _placed(point: np.ndarray, on_b: np.ndarray, angles: np.ndarray,
            ) -> tuple[np.ndarray, np.ndarray]:
    """Return inputs (n, 6) and rotations (n, 3, 3) of a second box with its `on_b` on `point`."""
    rotation = rotation_matrix(quaternion_from_euler(angles))
    offset = point - np.einsum('nij,nj->ni', rotation, on_b)
    return np.concatenate([offset, angles], axis=1), rotation


def face_face_candidates(rng: np.random.Generator, count: int) -> Placements:
    """Lay a face of the second trihedron on one of the first's, tilted by up to TILT.

    Spin and place are uniform, of faces that overlap. The impact point is the middle of the faces'
    overlap without the tilt. Where they do not meet, the normal is NaN.
    """
    rows, axis = np.arange(count), rng.integers(0, 3, count)
    normal = np.eye(3)[axis]
    flat = quaternion_multiply(turns(normal, rng.uniform(-np.pi, np.pi, count)),
                               AXES_IN_TURN[rng.integers(0, 3, count)])
    # B's axis that lies along A's is any: its face −j on A's face +i.
    offset = rng.uniform(-2.5, 2.5, (count, 3))
    offset[rows, axis] = 2.0 - PRESSED
    met = ContactSolver(CUBE, CUBE, model='exact').batch(
        np.tile([0.0, 0, 0, 0, 0, 0, 1], (count, 1)), np.concatenate([offset, flat], axis=1))
    point = np.where(normal == 1.0, 1.0, met.point)
    across = np.cross(normal, rng.normal(size=(count, 3)))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    tilted = quaternion_multiply(turns(across, rng.uniform(-TILT, TILT, count)), flat)
    inputs = np.concatenate([offset, euler_angles(rotation_matrix(tilted))], axis=1)
    found = query(Placements(inputs, point, normal))
    inputs[:, :3] -= found.separation[:, None] * found.normal
    # Adjacent faces do not meet, nor those that the tilt has parted or made an edge meet.
    after = query(Placements(inputs, point, normal))
    meet = (met.colliding & (after.separation <= INTERPENETRATION * CUBE[0])
            & (np.sum(after.normal * normal, axis=1) > math.cos(2.0 * TILT)))
    return Placements(inputs, point, np.where(meet[:, None], normal, np.nan))


GENERATORS = (vertex_face_candidates, edge_edge_candidates)


def touching(rng: np.random.Generator, count: int,
             candidates: Callable[[np.random.Generator, int], Placements], *,
             as_written: bool = False) -> Placements:
    """Return `count` placements of a kind; `as_written`: also those that interpenetrate."""
    found: list[Placements] = []
    while sum(map(len, found)) < count:
        drawn = candidates(rng, CHUNK)
        wanted = np.isfinite(drawn.normal).all(axis=1)
        if not as_written:
            wanted &= query(drawn).separation >= -INTERPENETRATION * CUBE[0]
        found.append(drawn[wanted])
    return _joined(found)[:count]


def mixed(rng: np.random.Generator, count: int, kept: float = 0.0) -> Placements:
    """Return `count` placements in random order, half of them of each kind.

    kept: share that is placed as written. In the rest, boxes that interpenetrate are dropped.
    """
    edges = round(count / 2)
    parts = []
    for wanted, candidates in zip((count - edges, edges), GENERATORS):
        written = round(kept * wanted)
        parts += [touching(rng, some, candidates, as_written=as_written) for some, as_written
                  in ((written, True), (wanted - written, False)) if some]
    return _joined(parts)[rng.permutation(count)]


def query(placements: Placements) -> Contacts:
    """Return the contacts of every placement, with a normal of those apart too."""
    solver = ContactSolver(CUBE, CUBE, margin=math.inf)
    return solver.batch(*as_poses(placements.inputs), patch=False)


def as_drawn(placements: Placements) -> Patterns:
    """Return placements as patterns."""
    return Patterns(placements.inputs, np.concatenate(
        [spherical(placements.point), spherical(placements.normal)], axis=1))


def folded(placements: Placements) -> Patterns:
    """Return placements, folded to the octant, as patterns."""
    folds = to_octant(placements.inputs[:, :3], placements.rotation)
    return as_drawn(Placements(folds.inputs, folds.folded(placements.point),
                               folds.folded(placements.normal)))


def spherical(direction: np.ndarray) -> np.ndarray:
    """Azimuth in [−π, π] and elevation in [−π/2, π/2] [rad] (n, 2) of directions (n, 3).

    The polar axis is z; the azimuth of the poles is 0.
    """
    x, y, z = direction.T
    across = np.hypot(x, y)
    pole = across <= POLE * np.abs(z)
    return np.column_stack([np.where(pole, 0.0, np.arctan2(y, x)), np.arctan2(z, across)])


def _streams(seed: int, counts: Sequence[int], kept: Kept = 0.0,
             ) -> Iterator[tuple[str, int, float, np.random.Generator]]:
    """Yield name, number of patterns, share kept and random stream of the sets."""
    shares = np.broadcast_to(kept, len(SETS)).tolist()
    for number, name in enumerate(SETS):
        yield name, counts[number], shares[number], np.random.default_rng([seed, number])


def paper(seed: int, *, counts: Sequence[int] = PAPER_COUNTS, folded_in: bool = True,
          kept: Kept = 0.0) -> dict[str, Patterns]:
    """Return the sets with discontinuities.

    `folded_in`: in the domain of `to_octant`, as at inference; otherwise as drawn.
    """
    patterns = folded if folded_in else as_drawn
    return {name: patterns(mixed(rng, count, share))
            for name, count, share, rng in _streams(seed, counts, kept)}


def by_signs(seed: int, *, counts: Sequence[int] = CONTINUOUS_COUNTS, kept: Kept = 0.0,
             ) -> dict[str, dict[str, Patterns]]:
    """Return the sets of each subset by the signs of roll, pitch and yaw, such as '++-'.

    A change of such a sign is the paper's example of a discontinuity.
    """
    subsets = list(map(''.join, product('+-', repeat=3)))
    result: dict[str, dict[str, Patterns]] = {subset: {} for subset in subsets}
    for name, count, share, rng in _streams(seed, counts, kept):
        found: dict[str, list[Placements]] = {subset: [] for subset in subsets}
        # Placements are drawn until the smallest subset is full; the larger ones are cut.
        while min(sum(map(len, parts)) for parts in found.values()) < count:
            some = mixed(rng, len(subsets) * count, share)
            signs = (some.inputs[:, 3:] < 0.0) @ (4, 2, 1)
            for number, subset in enumerate(subsets):
                found[subset].append(some[signs == number])
        for subset, parts in found.items():
            result[subset][name] = as_drawn(_joined(parts)[:count])
    return result


def committee(seed: int, *, counts: Sequence[int] = CONTINUOUS_COUNTS,
              ) -> dict[str, dict[str, Patterns]]:
    """Return the sets of the classifier and of each expert.

    The classifier's patterns are a third of each kind, and none of an expert's.
    """
    kinds = dict(zip(EXPERTS, (*GENERATORS, face_face_candidates)))
    result: dict[str, dict[str, Patterns]] = {'classifier': {}, **{kind: {} for kind in kinds}}
    for name, count, _, rng in _streams(seed, counts):
        share, inputs = -(-count // len(kinds)), []
        for kind, candidates in kinds.items():
            some = touching(rng, count + share, candidates)
            result[kind][name] = folded(some[:count])
            inputs.append(folded(some[count:]).inputs)
        order = rng.permutation(len(kinds) * share)[:count]
        result['classifier'][name] = Patterns(
            np.concatenate(inputs)[order], np.repeat(np.eye(len(kinds)), share, axis=0)[order])
    return result


def of_card(card: Mapping[str, Any]) -> dict[str, dict[str, Patterns]]:
    """Return the sets a model card speaks of, made again: per network, per set."""
    data = card['data']
    counts = [data['counts'][name] for name in SETS]
    kept = data.get('kept', 0.0)
    if card['model'] == 'paper-committee':
        return committee(card['seed'], counts=counts)
    if card['model'] == 'paper-continuous':
        return by_signs(card['seed'], counts=counts, kept=kept)
    seeds = {f'seed_{seed}': seed for seed in data.get('seeds', ())} or {'contact': card['seed']}
    return {network: paper(seed, counts=counts, folded_in=data['folded_in'], kept=kept)
            for network, seed in seeds.items()}

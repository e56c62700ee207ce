# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pairs of boxes as a simulator asks for them all day: goods at rest, recorded.

settled.npz has 12,978 pairs whose bounding boxes overlap, of 20 scenes: stacks, walls, piles,
grids, and five real orders of BED-BPP (Kagerer et al., 2023, MIT). Each scene was recorded as it
was placed, and after it had settled with steps of 1 ms by `PatchForces`, MuJoCo 4.0.0 and Bullet
(pybullet 3.2.7).
`python -m benchmarks.stacks --record FILE` records the scenes of `stacks` anew.
"""
from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from .pose_sets import Pairs

FILE = Path(__file__).with_suffix('.npz')
PLACED, OURS = 'as placed', 'PatchForces'
SHALLOW = 1e-9
"""Depth up to which goods hardly overlap, of the size."""
LEARNT = ('tower20_jitter', 'pyramid55', 'containers5_wind', 'pile200',
          'pallets4_on_each_other_full', 'jenga54', 'b2_card_house_5', 'bars_heap',
          'rapier_keva_5_floors', 'integer-grid pallet')
"""Scenes that the network of `mlp` is trained on. The others measure it."""


class Recorded(NamedTuple):
    """n pairs, and for each the names (n,) of its scene and of what settled it."""

    pairs: Pairs
    scene: np.ndarray
    engine: np.ndarray

    def rows(self, chosen: np.ndarray) -> Recorded:
        """Return some of the pairs."""
        return Recorded(self.pairs.rows(chosen), self.scene[chosen], self.engine[chosen])


def read(file: Path = FILE) -> Recorded:
    """Read recorded pairs."""
    with np.load(file) as arrays:
        return Recorded(Pairs(*(arrays[name] for name in Pairs._fields)),
                        arrays['scene_names'][arrays['scene']],
                        arrays['engine_names'][arrays['engine']])


@cache
def touching(*, learnt: bool) -> Pairs:
    """Return the pairs that touch of the scenes in `LEARNT`, or of all others."""
    recorded = read()
    pairs = recorded.pairs.rows(np.isin(recorded.scene, LEARNT) == learnt)
    return pairs.rows(pairs.contacts().colliding)


@cache
def measured() -> tuple[Pairs, Pairs]:
    """Return the pairs that touch of scenes that train no network: goods at rest, and the rest.

    Goods at rest are as a simulator settled them, and deeper than `SHALLOW`. The rest is as placed
    or shallower: `exact` puts its point by a convention there, and other engines by theirs.
    """
    recorded = read().rows(~np.isin(read().scene, LEARNT))
    found = recorded.pairs.contacts()
    rests = (recorded.engine != PLACED) & (-found.separation > SHALLOW * recorded.pairs.size)
    return (recorded.pairs.rows(found.colliding & rests),
            recorded.pairs.rows(found.colliding & ~rests))


def at_rest(rng: np.random.Generator, n: int) -> Pairs:
    """Goods at rest as simulators settled them, at most n pairs."""
    pairs, _ = measured()
    return pairs.rows(rng.permutation(len(pairs.size))[:n])


def as_placed(rng: np.random.Generator, n: int) -> Pairs:
    """Goods as they were placed, or that hardly overlap, at most n pairs."""
    _, pairs = measured()
    return pairs.rows(rng.permutation(len(pairs.size))[:n])


def cubes_at_rest(rng: np.random.Generator, n: int) -> Pairs:
    """Return the cubes among goods at rest, for which the paper's network can be trained."""
    pairs = at_rest(rng, len(measured()[0].size))
    return pairs.rows(cubes(pairs)).rows(slice(n))


def cubes(pairs: Pairs) -> np.ndarray:
    """Return which pairs (n,) are cubes of the edge 1 m."""
    return (np.hstack([pairs.size_a, pairs.size_b]) == 1.0).all(axis=1)


def write(file: Path, recorded: Recorded) -> None:
    """Write recorded pairs."""
    (scene_names, scene), (engine_names, engine) = (
        np.unique(names, return_inverse=True) for names in (recorded.scene, recorded.engine))
    np.savez_compressed(file, **recorded.pairs._asdict(), scene_names=scene_names,
                        scene=scene.astype(np.uint8), engine_names=engine_names,
                        engine=engine.astype(np.uint8))


def by_engine(recorded: Recorded) -> dict[str, Pairs]:
    """Return the pairs that touch by what settled them, ours first; last, all pairs apart."""
    touch = recorded.pairs.contacts().colliding
    engines = sorted(set(recorded.engine), key=lambda name: (name != OURS, name == PLACED, name))
    sets = {PLACED if name == PLACED else f'settled by {name}':
            recorded.pairs.rows(touch & (recorded.engine == name)) for name in engines}
    return {**sets, 'recorded, apart': recorded.pairs.rows(~touch)}


def by_scene(recorded: Recorded) -> dict[str, Pairs]:
    """Return the pairs of each scene that touch after `PatchForces`, else as they were placed."""
    touching = recorded.rows(recorded.pairs.contacts().colliding)
    found = {}
    for name in sorted(set(recorded.scene)):
        here = touching.rows(touching.scene == name)
        ours = here.rows(here.engine == OURS)
        found[str(name)] = (ours if len(ours.scene) else here).pairs
    return found

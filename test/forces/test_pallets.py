# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Real pallets: 5,103 boxes as planned, where faces touch exactly, and shaken; one lands tilted."""
from __future__ import annotations

import math

import numpy as np
import poses
import pytest
import worlds

from box_contact_ros import ContactSolver, SceneSolver, face_patches
from box_contact_ros.solver.pose import rotation_matrix

scenes = pytest.importorskip('benchmarks.scenes')
COPIES = 27


@pytest.fixture(scope='module')
def pallets():
    return scenes.pallets(COPIES)


@pytest.fixture(scope='module')
def solver(pallets):
    return SceneSolver(scenes.scene_of(pallets), model='exact')


def pairs_nearby(boxes):
    """Return all pairs (m, 2) of boxes of one pallet, and of each box with the floor, the last."""
    floor = len(boxes.size) - 1
    pallet = np.floor(boxes.pose[:floor, :2] / 2.0).astype(int) @ [1, COPIES]
    found = []
    for place in np.unique(pallet):
        rows = np.append(np.flatnonzero(pallet == place), floor)
        found.append(rows[np.stack(np.triu_indices(len(rows), 1), axis=1)])
    pairs = np.concatenate(found)
    return pairs[np.lexsort(pairs.T[::-1])]


def test_planned_contacts_are_those_in_whole_millimetres(pallets, solver):
    """Plans have whole millimetres, so an oracle in integers is exact: 6,912 faces that touch."""
    pairs = pairs_nearby(pallets)
    middle, extent = (np.rint(2000.0 * value).astype(int)  # in half millimetres
                      for value in (pallets.pose[:, :3], 0.5 * pallets.size))
    a, b = pairs.T
    shared = (np.minimum(middle[a] + extent[a], middle[b] + extent[b])
              - np.maximum(middle[a] - extent[a], middle[b] - extent[b]))
    touch = (shared >= 0).all(axis=1)
    answer = solver(pallets.pose[~pallets.fixed])
    assert np.array_equal(answer.pairs, pairs[touch]) and len(answer.pairs) == 6912
    assert np.abs(answer.contacts.separation).max() < 3e-14  # 2 ulp of 112 m, the floor's length
    shared = np.sort(shared[touch], axis=1)
    assert (shared[:, 0] == 0).all()
    patches = face_patches(pallets.size, pallets.pose, answer.pairs, answer.contacts.normal)
    assert patches.area == pytest.approx(2.5e-7 * shared[:, 1] * shared[:, 2], rel=1e-9)


def test_contacts_of_shaken_pallets_are_those_of_every_pair(pallets, solver):
    """To the bit, tick by tick: some two thirds of the faces still touch."""
    pairs = pairs_nearby(pallets)
    rng = np.random.default_rng(1)
    for _ in range(3):
        pose = pallets.shaken(rng)
        answer = solver(pose[~pallets.fixed])
        wanted = ContactSolver().batch(
            pose, sizes=pallets.size, pairs=pairs)
        hit = np.flatnonzero(wanted.colliding)
        assert np.array_equal(answer.pairs, pairs[hit]) and 4000 < len(hit) < 5000
        poses.assert_same_bits(answer.contacts, wanted[hit])


@pytest.mark.parametrize('seed', range(4))
def test_a_pallet_that_lands_tilted_ends_its_sway(seed):
    """A real order of 19 boxes, by 0.4°, at 1/60 s: by threefold iterations it sways for ever."""
    stack_scenes = pytest.importorskip('benchmarks.stack_scenes')
    boxes = stack_scenes.real_pallet('00100003').boxes
    angle = np.random.default_rng(seed).uniform(0.0, 2.0 * math.pi)
    turn = worlds.turned((math.cos(angle), math.sin(angle), 0.0), math.radians(0.4))
    axes = rotation_matrix(turn)
    at = boxes.pose[1:, :3] @ axes.T
    at[:, 2] -= (at[:, 2] - 0.5 * boxes.size[1:] @ np.abs(axes[2])).min()
    world = worlds.World(worlds.FLOOR, *(
        (size, mass, place, turn)
        for size, mass, place in zip(boxes.size[1:], boxes.mass[1:], at))).run(7.0, 1.0 / 60.0)
    assert np.abs(world.velocities).max() < 5e-4

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""contacts_of: what a test of every two boxes finds, bit for bit."""
from __future__ import annotations

import numpy as np
import poses
import pytest

from box_contact_ros import Box, ContactSolver, Scene, SceneSolver, contacts_of


def heap(rng, n):
    """Return sizes and poses of boxes of which some touch."""
    place = np.hstack((rng.uniform(-2, 2, (n, 3)), poses.unit_quaternions(rng, n)))
    return np.exp(rng.uniform(-1, 0.5, (n, 3))), place


@pytest.mark.parametrize('n', [0, 1, 2, 20, 90])
def test_contacts_are_those_of_every_pair(n):
    """Each two boxes but two fixed ones and those left out, by index; few boxes and many."""
    rng = np.random.default_rng(n)
    size, pose = heap(rng, n)
    fixed, known = rng.random(n) < 0.3, rng.random(n) < 0.9
    every = np.argwhere(np.triu(known & known[:, None] & ~(fixed & fixed[:, None]), 1))
    wanted = ContactSolver().batch(pose, sizes=size, pairs=every)
    pairs, contacts = contacts_of(size, np.where(known[:, None], pose, np.nan), fixed=fixed,
                                  threads=2)
    hit = np.flatnonzero(wanted.colliding)
    assert np.array_equal(pairs, every[hit]) and (len(hit) > n or n < 20)
    poses.assert_same_bits(contacts, wanted[hit])


def test_listed_pairs_keep_their_order_and_sides():
    """A pair of two fixed boxes too; and one size may stand for all boxes."""
    rng = np.random.default_rng(1)
    _, pose = heap(rng, 30)
    listed = rng.permutation(np.argwhere(~np.eye(30, dtype=bool)))[:300]
    wanted = ContactSolver(poses.CUBE, poses.CUBE).batch(pose, pairs=listed)
    pairs, contacts = contacts_of(poses.CUBE, pose.tolist(), listed, fixed=[True] * 30)
    hit = np.flatnonzero(wanted.colliding)
    assert np.array_equal(pairs, listed[hit]) and 30 < len(hit) < 300
    poses.assert_same_bits(contacts, wanted[hit])
    assert len(contacts_of(poses.CUBE, pose, [])[0]) == 0


def test_a_scene_finds_the_same():
    rng = np.random.default_rng(2)
    size, pose = heap(rng, 50)
    scene = Scene({f'b{n}': Box(extents) for n, extents in enumerate(size)},
                  patterns=(('*', '*'),), poses='array')
    answer = SceneSolver(scene)(pose)
    pairs, contacts = contacts_of(size, pose)
    assert np.array_equal(answer.pairs, pairs) and len(pairs) > 50
    poses.assert_same_bits(answer.contacts, contacts)


def test_a_margin_lists_pairs_apart_behind_those_in_contact():
    """What `hold` of forces wants: each pair within a way, without a scene."""
    rng = np.random.default_rng(3)
    size, pose = heap(rng, 40)
    every = np.argwhere(np.triu(np.ones((40, 40), bool), 1))
    wanted = ContactSolver(margin=0.3).batch(pose, sizes=size, pairs=every)
    hit, near = np.flatnonzero(wanted.colliding), np.flatnonzero(
        ~wanted.colliding & (wanted.separation <= 0.3))
    pairs, contacts = contacts_of(size, pose, margin=0.3)
    assert np.array_equal(pairs, every[[*hit, *near]]) and len(near) > 20
    poses.assert_same_bits(contacts, wanted[[*hit, *near]])


def test_a_tolerance_bridges_gaps_and_nothing_wider():
    """Contacts are those of larger boxes, with separation and volume of the boxes as they are."""
    rng = np.random.default_rng(5)
    size, pose = heap(rng, 120)
    tolerance = 0.02
    every = np.argwhere(np.triu(np.ones((120, 120), bool), 1))
    true = ContactSolver().batch(pose, sizes=size, pairs=every)
    larger = ContactSolver().batch(pose, sizes=size + tolerance, pairs=every)
    hit = np.flatnonzero(true.separation <= tolerance)
    pairs, contacts = contacts_of(size, pose, tolerance=tolerance)
    assert np.array_equal(pairs, every[hit]) and contacts.colliding.all()
    assert 10 < (contacts.separation > 0).sum() < (larger.colliding & ~true.colliding).sum()
    for name in ('separation', 'volume'):
        assert np.array_equal(getattr(contacts, name), getattr(true, name)[hit])
    for name in ('normal', 'point', 'covariance', 'axis'):
        assert np.array_equal(getattr(contacts, name), getattr(larger, name)[hit])
    both, near = contacts_of(size, pose, margin=0.1, tolerance=tolerance)
    assert np.array_equal(both[:len(hit)], pairs) and near.colliding.sum() == len(hit)
    apart = near.separation[len(hit):]
    assert len(apart) > 10 and apart.min() > tolerance and apart.max() <= 0.1
    assert len(both) == (ContactSolver(margin=0.1).batch(
        pose, sizes=size, pairs=every).separation <= 0.1).sum()


@pytest.mark.parametrize('tolerance', [-1e-9, 0.6, np.nan, np.inf, None, '1', True])
def test_a_tolerance_is_at_most_half_of_the_thinnest_box(tolerance):
    with pytest.raises(ValueError, match='^tolerance must be '):
        contacts_of([(9, 9, 9), (1, 2, 3)], [(0,) * 6 + (1,)] * 2, tolerance=tolerance)

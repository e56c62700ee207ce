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
    """Where the order of names is that of the boxes."""
    rng = np.random.default_rng(2)
    size, pose = heap(rng, 50)
    scene = Scene({f'b{n:02}': Box(extents) for n, extents in enumerate(size)},
                  patterns=(('*', '*'),), poses='named')
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


# --- two sets -------------------------------------------------------------------------------------


@pytest.mark.parametrize('n, m', [(40, 60), (1, 30), (30, 1), (1, 1), (0, 5), (5, 0), (0, 0)])
def test_two_sets_meet_across_alone(n, m):
    rng = np.random.default_rng(n)
    one, other = heap(rng, n), heap(rng, m)
    every = np.argwhere(np.ones((n, m), bool))
    wanted = ContactSolver(margin=0.2).batch(
        one[1][every[:, 0]], other[1][every[:, 1]], size_a=one[0][every[:, 0]],
        size_b=other[0][every[:, 1]])
    for margin in (0.0, 0.2):
        pairs, contacts = contacts_of(*one, to=other, margin=margin, threads=2)
        hit = np.flatnonzero(wanted.colliding)
        near = np.flatnonzero(~wanted.colliding & (wanted.separation <= margin))
        rows = [*hit, *(near if margin else ())]
        assert np.array_equal(pairs, every[rows]) and (len(hit) > 100 or n * m < 1000)
        poses.assert_same_bits(contacts, wanted[rows], *(
            ('colliding', 'separation', 'point', 'volume') if not margin else ()))


def test_two_sets_touch_up_to_a_tolerance():
    """As the same boxes of one set do."""
    rng = np.random.default_rng(4)
    one, other = heap(rng, 40), heap(rng, 50)
    joined = [np.concatenate(both) for both in zip(one, other)]
    every = np.argwhere(np.ones((40, 50), bool)) + [0, 40]
    wanted_pairs, wanted = contacts_of(*joined, every, tolerance=0.05)
    pairs, contacts = contacts_of(*one, to=other, tolerance=0.05)
    assert np.array_equal(pairs, wanted_pairs - [0, 40])
    poses.assert_same_bits(contacts, wanted)


@pytest.mark.parametrize('to, words', [
    ('boxes', 'to must be .sizes, poses., not'), (((1, 1, 1),), 'to must be'),
    (((1, 1), np.zeros((0, 7))), r'to\[0\] must be full extents'),
    (((1, 1, -1), np.zeros((1, 7))), r'to\[0\] .1, 1, -1. is not positive'),
    (((1, 1, 1), np.zeros((1, 7))), r'to\[1\]\[0\] quaternion')])
def test_a_second_set_that_is_refused(to, words):
    with pytest.raises(ValueError, match=words):
        contacts_of((1, 1, 1), [poses.IDENTITY], to=to)


@pytest.mark.parametrize('more', [{'pairs': [(0, 1)]}, {'fixed': [True]}])
def test_two_sets_go_without_pairs(more):
    with pytest.raises(ValueError, match='to is a second set'):
        contacts_of((1, 1, 1), [poses.IDENTITY], to=((1, 1, 1), [poses.IDENTITY]), **more)


def iou_of(sizes, one, sizes_b, other):
    """Return IoUs (n, m) as docs/how-to/iou.md does."""
    pairs, contacts = contacts_of(sizes, one, to=(sizes_b, other))
    both = np.prod(sizes[pairs[:, 0]], axis=1) + np.prod(sizes_b[pairs[:, 1]], axis=1)
    iou = np.zeros((len(one), len(other)))
    depth = 1e-9 * max(sizes.max(), sizes_b.max())
    iou[tuple(pairs.T)] = np.where(contacts.separation < -depth,
                                   contacts.volume / (both - contacts.volume), 0.0)
    return iou


@pytest.mark.parametrize('kind', ['upright', 'turned', 'by 45 degrees', 'equal', 'shifted'])
def test_iou_is_that_of_an_oracle(kind):
    """In 60 digits, to 1e-14: also for equal boxes and at 45 degrees, where others fail."""
    oracle = pytest.importorskip('oracle')
    rng = np.random.default_rng(5)
    n = 12
    sizes, one = rng.uniform(0.5, 2.0, (n, 3)), np.zeros((n, 7))
    one[:, :3] = rng.uniform(-1.0, 1.0, (n, 3))
    angle = np.full(n, np.pi / 4) if '45' in kind else rng.uniform(0.0, 6.0, n)
    one[:, 5], one[:, 6] = np.sin(angle / 2), np.cos(angle / 2)
    if kind == 'turned':
        one[:, 3:] = poses.unit_quaternions(rng, n)
    sizes_b, other = sizes.copy(), one.copy()
    if kind == 'shifted':
        other[:, :3] += 1e-3 * rng.normal(size=(n, 3))
    elif kind != 'equal':
        other[:, :3] = rng.uniform(-1.0, 1.0, (n, 3))
        other[:, 3:] = one[::-1, 3:] if kind != 'by 45 degrees' else poses.IDENTITY[3:]
    found = iou_of(sizes, one, sizes_b, other)
    assert (found > 0.0).sum() > n
    for i, j in np.ndindex(n, n):
        a, b = oracle.make_box(one[i], sizes[i]), oracle.make_box(other[j], sizes_b[j])
        volume = oracle.moments(a, b)[0]
        union = 8 * (a.half[0] * a.half[1] * a.half[2] + b.half[0] * b.half[1] * b.half[2]) - volume
        assert abs(found[i, j] - float(volume / union)) <= 1e-14

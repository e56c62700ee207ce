# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Index and movers: they find what a test of every two boxes finds, and take little memory."""
from __future__ import annotations

import fnmatch
import itertools
import subprocess
import sys

import numpy as np
import poses
import pytest
from answers import stale_pairs

from box_contact_ros import ContactSolver
from box_contact_ros.core import native
from box_contact_ros.scene.boxes import Box
from box_contact_ros.scene.scene import ALONE, EVERY_PAIR, Pair, Scene
from box_contact_ros.scene.scene_solver import SceneSolver
from box_contact_ros.solver.contacts_of import TooManyNear
from box_contact_ros.stream.streams import partners_of

ALL = np.full((1, 1), 3, np.uint8)
NONE = np.zeros((0, 2), np.int64)
PLENTY = 10**9
ROUNDING = 1e-13
"""Share of the largest coordinate or extent by which bounding boxes may seem to overlap."""


def scattered(rng, n):
    return np.exp(rng.uniform(-1, 1, (n, 3))), rng.uniform(-4, 4, (n, 3))


def clusters(rng, n):
    return (np.exp(rng.uniform(-1, 1, (n, 3))),
            2e4 * rng.integers(0, 3, (n, 3)) + rng.uniform(-1, 1, (n, 3)))


def one_place(rng, n):
    return np.exp(rng.uniform(-1, 1, (n, 3))), np.full((n, 3), 7.0)


def huge_beside_small(rng, n):
    return 10.0**rng.uniform(-3, 2, (n, 1)) * np.ones(3), rng.uniform(-9, 9, (n, 3))


def grid(rng, n):
    """Cubes that touch exactly, in a row or a block; no axis tells more than the others."""
    return np.ones((n, 3)), rng.permutation(np.argwhere(np.ones((6, 6, 6))))[:n].astype(float)


def far_away(rng, n):
    """At 5e6 m, where a rounding is half a nanometre."""
    size, place = np.ones((n, 3)), 5e6 + rng.integers(0, 4, (n, 3)).astype(float)
    return size, place + rng.uniform(-0.02, 0.02, (n, 3)) * rng.integers(0, 2, (n, 1))


def extreme(rng, n):
    """Sizes and coordinates at both ends of what is accepted."""
    return (10.0**rng.uniform(-50, 50, (n, 3)), rng.choice([-1, 0, 1], (n, 3))
            * 10.0**rng.uniform(-50, 50, (n, 3)))


KINDS = (scattered, clusters, one_place, huge_beside_small, grid, far_away, extreme)


def made(rng, kind, n, upright=False):
    """Return sizes and poses."""
    size, place = kind(rng, n)
    turn = np.tile([0.0, 0, 0, 1], (n, 1)) if upright else poses.unit_quaternions(rng, n)
    return size, np.hstack((place, turn))


def movers(size, index=None, *, margin=0.0, listed=NONE, groups=None, allowed=ALL, bodies=None):
    n = len(size)
    wanted = native.Filter(listed, np.zeros(n, np.int32) if groups is None else groups, allowed,
                           np.full(n, -1, np.int32) if bodies is None else bodies,
                           np.arange(n, dtype=np.int32))
    return native.Movers(size, margin, wanted, index)


def index_of(size, pose, fixed, *former):
    return native.Index(size, np.where(fixed[:, None], pose, np.nan), *former)


def gaps(size, pose):
    """Return how far bounding boxes are apart (n, n), and the scale [m] of each two boxes."""
    x, y, z, w = pose[:, 3:].T / np.linalg.norm(pose[:, 3:], axis=1)
    turn = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
    reach = np.einsum('ijn,nj->ni', np.abs(turn), 0.5 * size)
    scale = np.abs(pose[:, :3]).max(axis=1) + size.max(axis=1)
    apart = np.abs(pose[:, None, :3] - pose[:, :3]) - reach[:, None] - reach
    return apart.max(axis=2), np.maximum(scale[:, None], scale)


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('upright', [True, False])
def test_boxes_that_are_near(kind, upright):
    """Those whose bounding boxes overlap or touch, each once, by index, and no others.

    Few boxes are compared each with each, more are swept: both sides of the limit are here.
    """
    rng = np.random.default_rng(3)
    count = 0
    for n in (1, 2, 31, 34, 90, 200):
        size, pose = made(rng, kind, n, upright)
        known, fixed = rng.random(n) < 0.9, rng.random(n) < 0.4
        known |= fixed
        rows = np.where(known[:, None], pose, np.nan)
        index = index_of(size, pose, fixed)
        pairs, stale, refused = movers(size, index).find(rows, PLENTY)
        gap, scale = gaps(size, pose)
        asked = np.triu(known & known[:, None] & ~(fixed & fixed[:, None]), 1)
        found = np.zeros((n, n), bool)
        found[tuple(pairs.T)] = True
        assert refused == -1 and np.array_equal(np.argwhere(found), pairs)
        assert not (found & ~asked).any() and not (found & (gap > ROUNDING * scale)).any()
        assert found[asked & (gap <= 0.0)].all()
        assert stale.tolist() == [[box, ALONE] for box in np.flatnonzero(~known)]
        count += len(pairs)
        beside = np.zeros((n, n), bool)  # of any box and those of the index
        beside[tuple(index.near(size, rows, 0.0, PLENTY).T)] = True
        asked = known[:, None] & fixed
        assert not (beside & ~asked).any() and not (beside & (gap > ROUNDING * scale)).any()
        assert beside[asked & (gap <= 0.0)].all()
    assert count > 30


@pytest.mark.parametrize('kind', KINDS)
def test_what_is_found_depends_on_the_poses_alone(kind):
    """Not on the ticks before: boxes moved a little, far, left, and came back."""
    rng = np.random.default_rng(5)
    size, pose = made(rng, kind, 120)
    used = movers(size)
    for tick in range(8):
        if tick == 4:
            pose[:, :3] = rng.permutation(pose[:, :3])
        pose[:, :3] += rng.uniform(-0.1, 0.1, (120, 3))
        rows = np.where(rng.random((120, 1)) < 0.1, np.nan, pose) if tick % 2 else pose
        for one, other in zip(used.find(rows, PLENTY), movers(size).find(rows, PLENTY)):
            assert np.array_equal(one, other)


@pytest.mark.parametrize('kind', KINDS)
@pytest.mark.parametrize('share', [0.03, 0.4])
def test_few_boxes_move_at_a_time(kind, share):
    """Any distance, among others at rest and fixed ones; some leave and come back."""
    rng = np.random.default_rng(11)
    n = 150
    size, pose = made(rng, kind, n)
    fixed, gone = rng.random(n) < 0.3, np.zeros(n, bool)
    bodies = rng.integers(-1, 40, n).astype(np.int32)
    of_other = (bodies != bodies[:, None]) | (bodies < 0)
    asked = {'index': index_of(size, pose, fixed), 'bodies': bodies,
             'groups': rng.integers(0, 3, n).astype(np.int32),
             'allowed': rng.integers(0, 4, (3, 3)).astype(np.uint8),
             'listed': np.argwhere(np.triu((rng.random((n, n)) < 0.01) & of_other, 1))}
    used = movers(size, **asked)
    for _ in range(40):
        moved = ~fixed & (rng.random(n) < share)
        step = size.min(axis=1) * 10.0**rng.uniform(-3, 2, n)
        pose[moved, :3] += (step[:, None] * rng.normal(size=(n, 3)))[moved]
        gone ^= ~fixed & (rng.random(n) < 0.02)
        rows = np.where(gone[:, None], np.nan, pose)
        fresh = movers(size, **asked)
        for one, other in zip(used.find(rows, PLENTY), fresh.find(rows, PLENTY)):
            assert np.array_equal(one, other)


def test_a_search_that_ended_early_or_was_refused_leaves_nothing_out():
    rng = np.random.default_rng(12)
    size, pose = made(rng, scattered, 90)
    bad = np.where((np.arange(90) == 70)[:, None], np.inf, pose)
    moved = np.where((np.arange(90) % 9 == 2)[:, None], pose + 1.0, pose)
    moved[:, 3:] = pose[:, 3:]
    moved_bad = np.where((np.arange(90) == 70)[:, None], np.inf, moved)
    index = index_of(size, pose, np.arange(90) < 20)
    used = movers(size, index)
    for rows, most in ((bad, PLENTY), (pose, 7), (bad, PLENTY), (pose, PLENTY),
                       (pose - 1e-3, PLENTY), (pose - 1e-3, PLENTY), (moved_bad, PLENTY),
                       (moved, PLENTY), (moved, PLENTY)):
        pairs, stale, refused = used.find(rows, most)
        if rows is bad or rows is moved_bad:
            assert refused == 70 and not len(pairs)
            continue
        every, gone, _ = movers(size, index).find(rows, PLENTY)
        assert refused == -1 and np.array_equal(stale, gone) and len(every) > 50
        if most == PLENTY:
            assert np.array_equal(pairs, every)
        else:
            assert len(pairs) == 8 and set(map(tuple, pairs)) <= set(map(tuple, every))


@pytest.mark.parametrize('kind', [scattered, one_place, grid])
def test_boxes_of_one_body_are_never_a_pair(kind):
    """What is found without bodies, less the pairs within a body; below 0, a box is alone."""
    rng = np.random.default_rng(8)
    for n in (31, 90, 200):
        size, pose = made(rng, kind, n)
        bodies = rng.integers(-1, 5, n).astype(np.int32)
        every, *_ = movers(size).find(pose, PLENTY)
        kept = (bodies[every[:, 0]] != bodies[every[:, 1]]) | (bodies[every[:, 0]] < 0)
        assert 0 < kept.sum() < len(every)
        pairs, *_ = movers(size, bodies=bodies).find(pose, PLENTY)
        assert np.array_equal(pairs, every[kept])
    size, pose = made(rng, one_place, 41)
    pairs, *_ = movers(size, bodies=np.zeros(41, np.int32)).find(pose, PLENTY)
    assert pairs.shape == (0, 2)
    with pytest.raises(ValueError, match=r'listed.0. is \(2, 1\), boxes of one body'):
        movers(size, listed=np.array([[2, 1]]), bodies=np.zeros(41, np.int32))


def test_who_is_box_a():
    """Guests, whose numbers are behind those of the boxes; listed pairs; groups; the order."""
    none, three = np.full(3, -1, np.int32), np.zeros(3, np.int32)
    order = np.array([2, 0, 1], np.int32)
    asked = np.array([(3, 0), (0, 3), (3, 4), (4, 3), (0, 1), (1, 0), (1, 2), (2, 1), (0, 2)])
    for allowed, sides in ((0, [1, 2, 1, 2, 6, 5, 0, 0, 0]), (3, [1, 2, 1, 2, 6, 5, 1, 2, 2])):
        wanted = native.Filter(np.array([(1, 0)]), three, np.full((1, 1), allowed, np.uint8), none,
                               order)
        assert wanted.sides(asked).tolist() == sides
    one_body = native.Filter(NONE, three, ALL, np.array([0, 0, -1], np.int32), order)
    assert one_body.sides(asked[-5:]).tolist() == [0, 0, 1, 2, 2]
    one_way = native.Filter(NONE, np.array([0, 1, 1], np.int32),
                            np.array([[0, 1], [2, 0]], np.uint8), none, order)
    assert one_way.sides(asked[-5:]).tolist() == [1, 2, 0, 0, 1]


def exact_touch(rng, n):
    """Return sizes and poses (2, n, …) of faces that touch exactly, moved rigidly, near and far."""
    size = np.exp(rng.uniform(-3, 3, (2, n, 3)))
    pair = np.zeros((2, n, 7))
    pair[..., 6] = 1.0
    pair[1, :, :2] = rng.uniform(-0.4, 0.4, (n, 2)) * size.sum(axis=0)[:, :2]
    pair[1, :, 2] = 0.5 * (size[0, :, 2] + size[1, :, 2])
    turn = poses.unit_quaternions(rng, n)
    shift = rng.uniform(-1, 1, (n, 3)) * 10.0**rng.uniform(-2, 6, (n, 1))
    rows = [poses.moved(pair[:, k], shift[k], turn[k:k + 1]) for k in range(n)]
    return size, np.array(rows).transpose(1, 0, 2)


def test_no_touching_pair_is_left_out():
    """All stored hard poses, and faces that touch exactly at any place: what touches is near."""
    hard_poses = pytest.importorskip('benchmarks.hard_poses')
    cases = [(np.array([case.size_a, case.size_b]), np.array([case.pose_a, case.pose_b]))
             for case in (entry.pairs for entry in hard_poses.load().values())]
    cases.append(exact_touch(np.random.default_rng(7), 2000))
    touching = barely = 0
    for size, pose in cases:
        n = size.shape[1]
        found = ContactSolver().batch(
            *np.ascontiguousarray(pose), size_a=size[0].copy(), size_b=size[1].copy())
        listed = np.stack((np.arange(n), np.arange(n, 2 * n)), axis=1)
        pairs, _, refused = movers(
            size.reshape(-1, 3), listed=listed, allowed=np.zeros((0, 0), np.uint8)).find(
            pose.reshape(-1, 7), PLENTY)
        assert refused == -1 and set(np.flatnonzero(found.colliding)) <= set(pairs[:, 0])
        touching += found.colliding.sum()
        barely += (found.colliding & (found.separation > 0.0)).sum()
    assert touching > 1500 and barely > 300


@pytest.mark.parametrize('share', [0.02, 0.3])
def test_fixed_boxes_that_stay_are_taken_over(share):
    """Where a share of the boxes comes, goes, moves or lands, an index is as if made anew."""
    rng, found = np.random.default_rng(15), 0
    size, pose = made(rng, scattered, 150)
    fixed, group = rng.random(150) < 0.8, rng.integers(0, 3, 150).astype(np.int32)
    former = ()
    for change in range(90):
        index = index_of(size, pose, fixed, *former)
        asked = {'groups': group, 'allowed': np.triu(rng.integers(0, 4, (3, 3))).astype(np.uint8)}
        poses = np.where(fixed[:, None], pose, made(rng, scattered, len(size))[1])
        if change % 3 == 0 or share > 0.1:
            pairs = movers(size, index, **asked).find(poses, PLENTY)[0]
            fresh = movers(size, index_of(size, pose, fixed), **asked)
            assert np.array_equal(pairs, fresh.find(poses, PLENTY)[0])
            found += len(pairs)
        count = len(size)
        kept = np.arange(count)
        kept[rng.random(count) < share] = -1
        kept = np.append(kept[rng.random(count) >= 0.5 * share],
                         np.full(rng.integers(max(2, int(share * count))), -1))
        new_size, new_pose = made(rng, scattered, len(kept))
        is_new = kept < 0
        size, pose = (np.where(is_new[:, None], new, old[kept])
                      for new, old in ((new_size, size), (new_pose, pose)))
        fixed = np.where(is_new, rng.random(len(kept)) < 0.8, fixed[kept])
        group = np.where(is_new, rng.integers(0, 3, len(kept)), group[kept]).astype(np.int32)
        former = index, kept
    assert found > 1000
    with pytest.raises(ValueError, match=r'kept\[0\] is 150, but there were'):
        index_of(size, pose, fixed, index, np.full(len(size), 150))


def test_a_margin_loses_no_pair_within_it():
    """Of movers, and of an index."""
    rng = np.random.default_rng(6)
    count = 0
    for margin in (0.1, 0.5, 1.0):
        size, pose = made(rng, scattered, 60)
        every = np.argwhere(np.triu(np.ones((60, 60)), 1))
        apart = ContactSolver().distance_batch(pose, sizes=size, pairs=every).distance
        wanted = set(map(tuple, every[apart <= margin].tolist()))
        index = index_of(size, pose, np.arange(60) < 60)
        for pairs in (movers(size, margin=margin).find(pose, PLENTY)[0],
                      index.near(size, pose, margin, PLENTY)):
            assert wanted <= set(map(tuple, pairs.tolist()))
        count += len(wanted)
    assert count > 100


# --- scenes ---------------------------------------------------------------------------------------


def wanted_pairs(boxes, pairs, patterns):
    """Return the pairs that are asked for, by the rule as the page has it."""
    asked = {frozenset((pair.a, pair.b)): pair for pair in pairs}
    for pattern_a, pattern_b in patterns:
        for first, second in itertools.combinations(boxes, 2):
            for a, b in (sorted((first, second)), sorted((first, second))[::-1]):
                if (fnmatch.fnmatchcase(a, pattern_a) and fnmatch.fnmatchcase(b, pattern_b)
                        and not (boxes[a].pose and boxes[b].pose)):
                    asked.setdefault(frozenset((a, b)), Pair.between(a, b))
                    break
    return list(asked.values())


@pytest.mark.parametrize('patterns', [
    (), EVERY_PAIR, (('b*', 'a*'),), (('?1*', '*'), ('*2', 'b*'), ('a[0-4]*', '*')),
    tuple((f'*{digit}', f'*{9 - digit}') for digit in range(10))], ids=len)
@pytest.mark.parametrize('listed', [0, 20])
def test_the_pairs_of_a_scene(patterns, listed):
    """Listed ones and those of patterns: contacts, sides and stale pairs, in one order."""
    if not patterns and not listed:
        return
    rng = np.random.default_rng(4)
    n = 70
    size, pose = made(rng, scattered, n)
    pose[:, :3] *= 0.4
    names = [f'{"ab"[number % 2]}{number}' for number in range(n)]
    boxes = {name: Box(tuple(size[i]), tuple(pose[i]) if i % 4 == 0 else None)
             for i, name in enumerate(names)}
    pairs = tuple(Pair(f'p{i}', names[2 * i + 1], names[2 * i]) for i in rng.permutation(listed))
    scene = Scene(boxes, pairs, patterns=patterns, poses='named')
    wanted = wanted_pairs(boxes, pairs, patterns)
    assert list(scene.every_pair()) == wanted[:listed] + sorted(
        wanted[listed:], key=lambda pair: sorted(map(names.index, (pair.a, pair.b))))
    assert scene.pair_count == len(wanted)
    index = scene.index_of
    assert all(scene.has_pair(index[pair.a], index[pair.b]) for pair in wanted)
    gone = scene.moving[7]
    rows = pose[[index[name] for name in scene.moving]]
    rows[7] = np.nan
    answer = SceneSolver(scene, model='exact')(rows)
    single = ContactSolver()
    present = [pair for pair in scene.every_pair() if gone not in pair]
    places = np.array([(index[pair.a], index[pair.b]) for pair in present])
    contacts = single.batch(pose, sizes=size, pairs=places)
    hit = np.flatnonzero(contacts.colliding)
    assert np.array_equal(answer.pairs, places[hit]) and len(hit) > 3
    poses.assert_same_bits(answer.contacts, contacts[hit])
    assert [pair for pair, _ in answer.named()] == [present[row] for row in hit]
    asks = any(gone in pair for pair in wanted[listed:])
    assert stale_pairs(answer) == [pair for pair in pairs if gone in pair] + [
        Pair(gone, gone, gone)] * asks
    for name in scene.moving:
        others = {pair.a if pair.b == name else pair.b for pair in wanted if name in pair[1:]}
        met = partners_of(scene, name)
        assert met == ({name} if any(boxes[other].pose for other in others) else others)


def test_bad_poses_are_refused_among_many():
    names = [f'm{number}' for number in range(90)]
    scene = Scene({name: Box((1.0, 1.0, 1.0)) for name in names}, patterns=EVERY_PAIR,
                  poses='named')
    rows = np.tile(poses.IDENTITY, (90, 1))
    rows[4, 0] = np.inf
    solver = SceneSolver(scene, model='exact')
    with pytest.raises(ValueError, match='pose of m4: position'):
        solver(rows)
    rows[4, 0] = 3.0
    assert solver(rows).candidates == 89 * 88 // 2


CROWD = """
import resource
import numpy as np
from box_contact_ros.core import native
from box_contact_ros.solver.contacts_of import TooManyNear
from box_contact_ros.scene.boxes import Box
from box_contact_ros.scene.scene import EVERY_PAIR, Scene
from box_contact_ros.scene.scene_solver import SceneSolver

def memory():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024

n = 1500
place = np.tile([0.0, 0, 0, 0, 0, 0, 1], (8000, 1))
rows = place[:n] + np.arange(n)[:, None] * [5.0, 0, 0, 0, 0, 0, 0]
movers = native.Movers(np.ones((n, 3)), 0.0, None, None)
before = memory()
for row in rows:
    row[0] = 0.0
    movers.find(rows, 1000)
print(memory() - before, end=' ')
boxes = {f'b{n}': Box((1.0, 1.0, 1.0)) for n in range(8000)}
before = memory()
solver = SceneSolver(Scene(boxes, patterns=EVERY_PAIR, poses='named'), model='exact',
                     most_near=1000)
try:
    solver(place)
except TooManyNear as error:
    print(memory() - before, error)
"""


def test_a_crowd_in_one_place_costs_no_memory():
    """Of 8,000 boxes in one place, 32 million pairs are near; the search ends early.

    No more pairs are kept where boxes come one by one.
    """
    ended = subprocess.run([sys.executable, '-c', CROWD], capture_output=True, text=True)
    one_by_one, at_once, words = ended.stdout.strip().split(' ', 2)
    assert words == 'more than 1000 pairs are near each other, and so many are not answered', ended
    assert int(one_by_one) < 3 and int(at_once) < 50


def test_more_pairs_than_are_to_be_answered():
    """Listed ones as those of patterns."""
    boxes = {name: Box((1.0, 1.0, 1.0)) for name in 'abc'}
    place = np.tile([0.0, 0, 0, 0, 0, 0, 1], (3, 1))
    for scene in (Scene(boxes, (Pair.between('a', 'b'), Pair.between('b', 'c')), poses='named'),
                  Scene(boxes, patterns=(('b', '*'),), poses='named')):
        assert SceneSolver(scene, model='exact', most_near=2)(place).touching == 2
        with pytest.raises(TooManyNear, match='more than 1 pairs are near each other'):
            SceneSolver(scene, model='exact', most_near=1)(place)

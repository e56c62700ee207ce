# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Distances and nearest points: closed forms, an oracle in 60 digits, and laws."""
from __future__ import annotations

import itertools
import math
import pickle

import numpy as np
import poses
import pytest

from box_contact_ros import ContactSolver, Nearest, Nearests, make_model
from box_contact_ros.core import LENGTH_MAX, LENGTH_MIN
from box_contact_ros.solver.checks import are_poses
from box_contact_ros.solver.pose import rotation_matrix

apart = pytest.importorskip('benchmarks.apart')
oracle = pytest.importorskip('oracle')

FIELDS = ('colliding', 'distance', 'normal', 'point_a', 'point_b')
UNIT = (1.0, 1.0, 1.0)
UNITS = 32
"""Largest error of a distance [2⁻⁵³ of the largest size or coordinate]."""
ON_BOX = 10
"""How far outside their boxes points may be, in the same units."""
every_family = pytest.mark.parametrize('family', apart.FAMILIES)


def drawn(family, n, seed=0):
    return poses.Pairs(*apart.draw(family, np.random.default_rng([seed, *family.encode()]), n))


def distances(pairs, **options):
    return ContactSolver().distance_batch(pairs.pose_a, pairs.pose_b, size_a=pairs.size_a,
                                          size_b=pairs.size_b, **options)


def contacts(pairs, **options):
    return ContactSolver(**options).batch(pairs.pose_a, pairs.pose_b, size_a=pairs.size_a,
                                          size_b=pairs.size_b)


def assert_same(one, other, signs_of_zeros=True):
    for name in FIELDS:
        a, b = np.asarray(getattr(one, name)), np.asarray(getattr(other, name))
        if a.dtype == bool:
            assert np.array_equal(a, b), name
        else:
            a, b = (a, b) if signs_of_zeros else (a + 0.0, b + 0.0)
            assert a.tobytes() == b.tobytes(), name


def turned(axis, angle):
    return np.array([*(np.sin(angle / 2) * np.array(axis, float)), np.cos(angle / 2)])


# --- closed forms ---------------------------------------------------------------------------------

X, Y, Z = np.eye(3)
C = math.pi / 4
SQUARE = math.sqrt(0.5)
NO_TURN = (0, 0, 0, 1)


def case(place, distance, point_a, point_b, turn_b=NO_TURN, turn_a=NO_TURN, size_a=UNIT,
         size_b=UNIT):
    """Return poses, sizes and the answer; NaN in a point is not compared."""
    return (np.array([0, 0, 0, *turn_a]), np.array([*place, *turn_b]), size_a, size_b, distance,
            point_a, point_b)


ANY = math.nan
CASES = {
    'corner to corner': case((2, 2, 2), math.sqrt(3), (.5, .5, .5), (1.5, 1.5, 1.5)),
    'edge to edge': case((2, 2, .25), math.sqrt(2), (.5, .5, .125), (1.5, 1.5, .125)),
    'face to face': case((.5, .25, 2), 1, (.25, .125, .5), (.25, .125, 1.5)),
    'face to face, yawed': case((.9, 0, 2), 1, (.39763107, 0, .5), (.39763107, 0, 1.5),
                                turned(Z, C)),
    'no vertex is nearest': case((2, 0, .5), 1.5 - SQUARE, (.5, 0, 0), (2 - SQUARE, 0, 0),
                                 turned(Z, C), size_a=(1, 1, .2), size_b=(1, 1, 4)),
    'edge above a face': case((.3, .2, 1.5), 1 - math.sqrt(.02), (0, .02679492, .5),
                              (0, .02679492, 1.5 - math.sqrt(.02)),
                              poses.multiply(turned(Z, math.pi / 6)[None],
                                             turned(X, C)[None])[0], size_b=(3, .2, .2)),
    'edges that cross': case((0, 0, 2), 2 - math.sqrt(2), (0, 0, SQUARE), (0, 0, 2 - SQUARE),
                             turned(Y, C), turned(X, C)),
    'edges nearly parallel': case((0, 0, math.sqrt(.02) + 1e-10), 1e-10, (0, 0, ANY), (0, 0, ANY),
                                  poses.multiply(turned(Z, 1e-9)[None], turned(X, C)[None])[0],
                                  turned(X, C), (2, .1, .1), (2, .1, .1))}


def aligned_case(offset):
    """Return the closed form of two parallel cubes, by axes."""
    offset = np.array(offset)
    gap = np.maximum(np.abs(offset) - 1.0, 0.0)
    low, high = np.maximum(-0.5, offset - 0.5), np.minimum(0.5, offset + 0.5)
    middle, side = 0.5 * (low + high), np.sign(offset)
    point_a = np.where(gap > 0, 0.5 * side, middle)
    return case(offset, math.sqrt((gap * gap).sum()), point_a, point_a + gap * side)


CASES |= {f'aligned {offset}': aligned_case(offset) for offset in itertools.product(
    (-1.75, .25, 1.5), (-1.25, 0, 2.0), (-3.0, -.5, .125, 1.0625)) if max(map(abs, offset)) > 1}
"""Corners, edges and faces of parallel cubes."""
CASES |= {f'corner of a cube over a face, {angle:.2f}': case(
    (.1, .05, 2), 1.5 - math.sqrt(3) / 2, (.1, .05, .5), (.1, .05, 2 - math.sqrt(3) / 2),
    poses.multiply(turned(Z, angle)[None],
                   turned(np.array([1, -1, 0]) / math.sqrt(2), math.acos(1 / math.sqrt(3)))[None],
                   )[0]) for angle in np.linspace(0, 6, 10)}
CASES |= {f'a tower beside a cube, {shift}': case(
    (2, 0, shift), 1, (.5, 0, .5 * max(-.5, shift - 2) + .5 * min(.5, shift + 2)),
    (1.5, 0, .5 * max(-.5, shift - 2) + .5 * min(.5, shift + 2)), size_b=(1, 1, 4))
    for shift in (-2.25, -1.0, 0.0, 1.5, 2.375)}


@pytest.mark.parametrize('given', CASES.values(), ids=CASES)
def test_closed_forms(given):
    """As they are written, and moved rigidly; A and B in either order."""
    pose_a, pose_b, size_a, size_b, distance, point_a, point_b = given
    rng, wanted = np.random.default_rng(2), np.array([point_a, point_b], float)
    turns = np.vstack([NO_TURN, poses.unit_quaternions(rng, 4)])
    shifts = np.vstack([np.zeros(3), rng.uniform(-9, 9, (4, 3))])
    for turn, shift in zip(turns[:, None], shifts[:, None]):
        a, b = (poses.moved(pose[None], shift, turn)[0] for pose in (pose_a, pose_b))
        for swapped in (False, True):
            solver = ContactSolver(*((size_b, size_a) if swapped else (size_a, size_b)))
            found = solver.distance(*((b, a) if swapped else (a, b)))
            points = [found.point_a, found.point_b][::-1 if swapped else 1]
            local = (np.array(points) - shift) @ rotation_matrix(turn)[0]
            assert not found.colliding
            assert found.distance == pytest.approx(distance, rel=1e-13, abs=2e-14)
            off = np.abs(local - wanted)
            # Edges that cross at 1e-9 rad say where only to a share of 1e-7.
            assert np.nanmax(off) < (2e-8 if distance > 1e-9 else 1e-5)
            assert np.linalg.norm(found.normal) == pytest.approx(1.0, abs=1e-14)


def test_there_are_fifty_closed_forms():
    assert len(CASES) >= 50


# --- the oracle -----------------------------------------------------------------------------------


@every_family
def test_distances_are_those_of_the_oracle(family):
    """Its own proof closes. The distance is never below the separation."""
    pairs = drawn(family, 30)
    found, sat = distances(pairs), contacts(pairs)
    for row, (pose_a, pose_b, size_a, size_b) in enumerate(zip(*pairs)):
        unit = 2.0**-53 * max(np.abs(pose_a[:3]).max(), np.abs(pose_b[:3]).max(), *size_a, *size_b)
        if found.colliding[row]:
            continue
        true, _, _, doubt = oracle.nearest(oracle.make_box(pose_a, size_a),
                                           oracle.make_box(pose_b, size_b))
        assert abs(doubt) < 1e-3 * unit
        assert abs(found.distance[row] - float(true)) <= UNITS * unit
        assert found.distance[row] >= sat.separation[row]
    assert np.array_equal(found.colliding, sat.colliding)
    assert (~found.colliding).sum() > 5


@every_family
def test_distances_are_proved(family):
    """By points on the boxes from above, and by a gap from below."""
    pairs = drawn(family, 2000)
    found = distances(pairs)
    proof = apart.prove(apart.Pairs(*pairs), found)
    rows = ~found.colliding
    assert rows.sum() > 300
    assert np.abs(proof.above[rows]).max() <= UNITS
    assert proof.below[rows].max() <= UNITS
    assert proof.outside[rows].max() <= ON_BOX
    assert proof.length[rows].max() <= UNITS


# --- laws -----------------------------------------------------------------------------------------


def every_pair(n=300):
    """Return pairs of all families, and pairs in contact."""
    return poses.joined(*(drawn(family, n) for family in apart.FAMILIES),
                        poses.of_all_kinds(n, 3), poses.hard_pairs())


def test_rows_are_their_single_calls():
    """Bit for bit: in one thread and in three, row by row and by place, alone and side by side."""
    pairs = every_pair()
    found = distances(pairs)
    assert 0.2 < found.colliding.mean() < 0.8
    assert_same(distances(pairs, threads=3), found)
    n = len(pairs.pose_a)
    places = np.random.default_rng(8).permutation(np.column_stack([np.arange(n), n + np.arange(n)]))
    by_place = ContactSolver().distance_batch(np.concatenate(pairs[:2]), pairs=places,
                                              sizes=np.concatenate(pairs[2:]))
    assert_same(by_place, found[places[:, 0]])
    for row in range(0, n, 3):
        one = ContactSolver(pairs.size_a[row], pairs.size_b[row]).distance(pairs.pose_a[row],
                                                                           pairs.pose_b[row])
        assert_same(one, found[row])
        few = slice(row, row + 1 + row % 5)
        assert_same(distances(poses.Pairs(*(part[few] for part in pairs))), found[few])


def test_swap():
    """No bit changes but the sign of the normal, and which point is whose."""
    pairs = every_pair()
    one, two = distances(pairs), distances(poses.Pairs(*(pairs[k] for k in (1, 0, 3, 2))))
    same = (pairs.pose_a == pairs.pose_b).all(axis=1) & (pairs.size_a == pairs.size_b).all(axis=1)
    back = Nearests(two.colliding, two.distance, np.where(same, 1, -1)[:, None] * two.normal,
                    two.point_b, two.point_a)
    assert_same(one, back, signs_of_zeros=False)


def test_boxes_in_contact():
    """Both questions agree on the verdict; both points are the contact's, and so is the normal."""
    pairs = every_pair()
    found, wanted = distances(pairs), contacts(pairs)
    assert np.array_equal(found.colliding, wanted.colliding)
    rows = wanted.colliding
    assert rows.sum() > 500 and not found.distance[rows].any()
    for point in (found.point_a, found.point_b):
        assert np.array_equal(point[rows], wanted.point[rows])
    assert np.array_equal(found.normal[rows], wanted.normal[rows])
    assert (found.distance[~rows] >= wanted.separation[~rows]).all()


@pytest.mark.parametrize('model', ['mlp', 'paper'])
def test_distances_are_the_same_of_all_models(model):
    """In contact the point is that of `exact`, whoever answers for contacts."""
    solver = ContactSolver(poses.CUBE, poses.CUBE, model=make_model(model))
    exact = ContactSolver(poses.CUBE, poses.CUBE)
    for height in (1.9, 2.5):
        assert_same(solver.distance(poses.IDENTITY, [.1, .2, height, 0, 0, 0, 1]),
                    exact.distance(poses.IDENTITY, [.1, .2, height, 0, 0, 0, 1]))


@pytest.mark.parametrize('power', [-20, 20])
def test_scale_by_powers_of_two_is_exact(power):
    pairs = every_pair(100)
    scaling = 2.0**power * np.array([1.0] * 3 + [2.0**-power] * 4)
    one, two = distances(pairs), distances(poses.Pairs(
        pairs.pose_a * scaling, pairs.pose_b * scaling, pairs.size_a * 2.0**power,
        pairs.size_b * 2.0**power))
    for name in ('distance', 'point_a', 'point_b'):
        assert np.array_equal(getattr(one, name) * 2.0**power, getattr(two, name)), name
    assert np.array_equal(one.normal, two.normal)


def test_extreme_sizes_have_finite_answers():
    """From 1e-50 to 1e50 m."""
    rng = np.random.default_rng(4)
    pairs = poses.extreme_pairs(rng, 4000)
    good = are_poses(pairs.pose_a) & are_poses(pairs.pose_b)
    sizes = np.hstack(pairs[2:])
    good &= ((sizes >= LENGTH_MIN) & (sizes <= LENGTH_MAX)).all(axis=1)
    pairs = poses.Pairs(*(part[good] for part in pairs))
    found = distances(pairs)
    assert len(found) > 500 and (~found.colliding).sum() > 100
    for name in FIELDS[1:]:
        assert np.isfinite(getattr(found, name)).all(), name


@pytest.mark.parametrize('family', ['random', 'needles', 'yaw, side by side', 'aligned, moved'])
def test_the_gradient_is_the_normal(family):
    """By shifts of B the normal; by turns of either box about its centre a lever × the normal.

    Central differences, on pairs whose distance is smooth: those without parallel features by turns
    too.
    """
    pairs, step = drawn(family, 200), 1e-6
    found = distances(pairs)
    clear = found.distance > 1e-3
    smooth = family in ('random', 'needles')
    for k, axis in enumerate(np.eye(3)):
        shifted = [pairs._replace(pose_b=pairs.pose_b + sign * step * np.r_[axis, np.zeros(4)])
                   for sign in (1, -1)]
        slope = (distances(shifted[0]).distance - distances(shifted[1]).distance) / (2 * step)
        if smooth:
            assert np.abs(slope - found.normal[:, k])[clear].max() < 1e-6
        else:  # moving along a face changes nothing, up to its edge
            assert np.median(np.abs(slope - found.normal[:, k])[clear]) < 1e-6
        if not smooth:
            continue
        for side, points, sign in ((1, found.point_b, 1), (0, found.point_a, -1)):
            lever = points - pairs[side][:, :3]
            wanted = sign * np.cross(lever, found.normal)[:, k]
            turned_both_ways = []
            for angle in (step, -step):
                turn = np.tile(turned(axis, angle), (len(lever), 1))
                pose = np.hstack([pairs[side][:, :3], poses.multiply(turn, pairs[side][:, 3:])])
                turned_both_ways.append(distances(pairs._replace(
                    **{('pose_a', 'pose_b')[side]: pose})).distance)
            slope = (turned_both_ways[0] - turned_both_ways[1]) / (2 * step)
            assert np.abs(slope - wanted)[clear].max() < 1e-5


ALMOST_PARALLEL = {
    6e-7: ((5.20733876894605, 2.069278159741244, 5.510804389477162, -0.4177544467314386,
            0.7956642548503797, 0.14525961340350255, 0.41388314836843104),
           (0.4060011366551828, -3.14420208237689, -0.598282773114929, -0.32307430688793914,
            0.808501554351711, -0.022520743978119442, 0.4913665077418457),
           (8.058787972934853, 0.45799409903427174, 2.0959715657854634),
           (10.110315456258082, 1.3183022562170756, 2.292494382031198)),
    5e-6: ((2.4794393813372686, 2.3266676512659727, -0.3611602350923536, -0.7464455310622984,
            0.17000655129184855, -0.1492745091252181, -0.6258066495335445),
           (-3.278776594147902, 3.504214690730179, -0.4840373813040718, 0.5776547287472026,
            0.15966442433894687, 0.1602884237974992, -0.7843021784701493),
           (3.497169724441383, 2.3405447947159623, 1.1739512963577101),
           (7.105095614906032, 1.972656434746702, 1.4786493060700696))}
"""Boxes some micrometres apart whose edges are parallel to so many radians. A vertex of either box
is nearest, but for rounding, and the way from one of them is not across both edges."""


@pytest.mark.parametrize('angle', ALMOST_PARALLEL)
def test_the_normal_is_across_edges_that_are_almost_parallel(angle):
    """The boxes are apart along it by the distance."""
    given = [np.array([part]) for part in ALMOST_PARALLEL[angle]]
    for pair in (poses.Pairs(*given), poses.Pairs(*(given[k] for k in (1, 0, 3, 2)))):
        found = distances(pair)
        gap = found.normal[0] @ (pair.pose_b - pair.pose_a)[0, :3] - sum(
            np.abs(found.normal[0] @ rotation_matrix(pose[:, 3:])[0]) @ size[0] / 2
            for pose, size in zip(pair[:2], pair[2:]))
        assert gap == pytest.approx(found.distance[0], abs=1e-14)


@pytest.mark.parametrize('family', ['random', 'aligned', 'aligned, moved', 'yaw, side by side',
                                    'yaw, stacked', 'yaw, stacked, moved'])
def test_points_tend_to_the_contact_point(family):
    """Once B is pushed on to a depth of 1e-8, the contact point is between the nearest points."""
    pairs, depth = drawn(family, 300), 1e-8
    found = distances(pairs)
    push = (found.distance + depth)[:, None] * found.normal
    touching = contacts(pairs._replace(pose_b=pairs.pose_b - np.pad(push, ((0, 0), (0, 4)))))
    assert touching.colliding.all()
    off = np.linalg.norm(touching.point - 0.5 * (found.point_a + found.point_b - push), axis=1)
    assert np.median(off) < 2 * depth and np.quantile(off, 0.9) < 100 * depth


def test_a_nearest_never_changes_and_is_pickled():
    solver, corner = ContactSolver(UNIT, UNIT), [2, 2, 2, 0, 0, 0, 1]
    one = solver.distance(poses.IDENTITY, corner)
    assert_same(pickle.loads(pickle.dumps(one)), one)
    assert_same(Nearest(*(getattr(one, name) for name in FIELDS)), one)
    assert type(one.colliding) is bool and type(one.distance) is float
    for name in FIELDS:
        with pytest.raises(AttributeError):
            setattr(one, name, getattr(one, name))
    many = solver.distance_batch([poses.IDENTITY] * 3, [corner] * 3)
    assert len(many) == 3 and isinstance(many[0], Nearest) and isinstance(many[1:], Nearests)
    assert_same(many[-1], one)
    assert 'distance=1.73' in repr(one)

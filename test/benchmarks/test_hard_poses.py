# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Gates at zero on the stored families of hard poses, for `exact` and `mlp`."""
from __future__ import annotations

from functools import partial

import hard_pose_recipes as recipes
import numpy as np
import oracle
import poses
import pytest
from gmpy2 import mpfr

from benchmarks import hard_poses, judge, probes, stability
from benchmarks.pose_sets import Pairs
from box_contact_ros import ContactSolver

CASES = hard_poses.load()
MODELS = ('exact', 'mlp')
EPS = np.finfo(float).eps
STATED, STATED_NEEDLES = 14.0, 42.0
"""Errors of the MLP's point [% of the smaller box's longest edge] that no pair here exceeds. Many
boxes here are deep in each other; the network learns from a tenth of the shortest edge at most."""


def solve(model, pairs):
    return pairs.contacts(ContactSolver(model=model))


# --- the file -------------------------------------------------------------------------------------


def test_the_file_holds_what_the_generators_draw():
    """Up to another machine's sines. More cases, and the file was not written anew."""
    assert list(CASES) == list(recipes.FAMILIES)
    for name, cases in CASES.items():
        for stored, drawn in zip(cases.pairs, recipes.generate(name)):
            np.testing.assert_allclose(stored, drawn, rtol=1e-12, atol=1e-12, err_msg=name)


@pytest.mark.parametrize('name', CASES)
def test_truth_is_the_oracles(name):
    """Of every 40th case, from the stored doubles."""
    cases = CASES[name]
    for row in range(0, len(cases.gap), 40):
        a, b, size_a, size_b = (part[row] for part in cases.pairs)
        box_a, box_b = oracle.make_box(a, size_a), oracle.make_box(b, size_b)
        assert float(oracle.separation(box_a, box_b)) == cases.gap[row]
        if np.isfinite(cases.centroid[row]).all():
            volume, centroid, covariance = oracle.moments(box_a, box_b)
            point = oracle.add(centroid, box_a.centre, -1)
            np.testing.assert_allclose(oracle.as_array(point), cases.centroid[row], rtol=1e-15)
            assert float(volume) == cases.volume[row]
            for line, found in zip(covariance, cases.covariance[row]):
                np.testing.assert_allclose(found, oracle.as_array(line), rtol=1e-15)


def test_families_reach_what_they_are_for():
    """A sweep proves that it reached its branch: gaps and contacts, axes of all kinds, ties."""
    for name in ('a2_tilted_gaps', 'b6_spin', 'b7_corner_gaps'):
        assert (CASES[name].gap > 0.0).all()
    for name in ('a1_tilted_faces', 'a4_ridges', 'c1_depths', 'd5_edge_against_face'):
        assert (CASES[name].gap[::2] < 0.0).all() or name == 'a1_tilted_faces'
    touching = CASES['b1_exact_touch']
    assert (np.abs(touching.gap) < 1e-9 * touching.pairs.size).all()
    winners = set()
    for a, b, size_a, size_b in zip(*CASES['b4_one_axis'].pairs):
        gaps = oracle.axis_gaps(oracle.make_box(a, size_a), oracle.make_box(b, size_b))
        winners.add(max(gaps, key=lambda gap: gap[2])[0])
    assert winners == set(range(15))
    ties = CASES['d1_two_axes']
    gaps = sorted(gap for _, _, gap in oracle.axis_gaps(*(
        oracle.make_box(pose, size) for pose, size in (
            (ties.pairs.pose_a[0], ties.pairs.size_a[0]),
            (ties.pairs.pose_b[0], ties.pairs.size_b[0])))))
    assert gaps[-1] - gaps[-2] < 1e-12


# --- gates ----------------------------------------------------------------------------------------


@pytest.mark.parametrize('model', MODELS)
@pytest.mark.parametrize('name', CASES)
def test_gates(name, model):
    """No wrong verdict, no wrong normal, every point in both boxes, nothing that is not finite.

    Depth to 1e-12 of the size (or the coordinates' rounding), points to the stated error. Points of
    `mlp` are within bounds of the overlap, and of needles not always in both boxes.
    """
    row = stability.examine(model, name, CASES[name], partial(solve, model))
    assert (row.verdicts, row.normals, row.not_finite) == (0, 0, 0)
    needles = (model, name, 'outside') == stability.KNOWN
    assert row.outside == 0 or needles
    assert row.point_worst <= (STATED_NEEDLES if needles else STATED)
    pairs = CASES[name].pairs
    found = solve(model, pairs)
    off = np.abs(found.separation - CASES[name].gap)
    assert (off <= judge.rounding(*pairs))[found.colliding].all()
    assert np.isfinite(found.separation).all()
    assert np.isnan(found.point[~found.colliding]).all()
    assert np.isnan(found.normal[~found.colliding]).all()


@pytest.mark.parametrize('name', CASES)
def test_exact_point(name):
    """To max(1e-9, 1e-14·size/depth) of the size, and the coordinates' rounding."""
    cases = CASES[name]
    found, size = solve('exact', cases.pairs), cases.pairs.size
    known = found.colliding & np.isfinite(cases.centroid).all(axis=1)
    off = np.linalg.norm(found.point - cases.pairs.pose_a[:, :3] - cases.centroid, axis=1)
    reach = np.abs(cases.pairs.pose_a[:, :3]).max(axis=1)
    bound = np.maximum(1e-9, 1e-14 * size / np.maximum(-cases.gap, 1e-300)) * size + 8 * EPS * reach
    assert (off <= bound)[known].all()


@pytest.mark.parametrize('name', CASES)
def test_exact_volume_and_covariance(name):
    """To max(1e-9, 1e-14·size/depth) of itself, and max(1e-8, 1e-14·size/depth) of its trace.

    Of boxes up to 100,000 times as long as thick; beyond, no eigenvalue is negative.
    """
    cases = CASES[name]
    found, size = solve('exact', cases.pairs), cases.pairs.size
    aspect = np.max([part.max(axis=1) / part.min(axis=1) for part in cases.pairs[2:]], axis=0)
    known = found.colliding & np.isfinite(cases.volume) & (aspect <= 1e5)
    rounding = 1e-14 * size / np.maximum(-cases.gap, 1e-300)
    off = np.abs(found.volume - cases.volume)
    assert (off <= np.maximum(1e-9, rounding) * cases.volume)[known].all()
    off = np.linalg.norm(found.covariance - cases.covariance, axis=(1, 2))
    trace = np.trace(cases.covariance, axis1=1, axis2=2)
    assert (off <= np.maximum(1e-8, rounding) * trace)[known].all()
    beyond = found.covariance[found.colliding & (aspect > 1e5)]
    least = np.linalg.eigvalsh(beyond)[:, 0]
    assert (least > -1e-9 * np.trace(beyond, axis1=1, axis2=2)).all()
    assert (found.volume[found.colliding] > 0.0).all()
    assert np.isfinite(found.covariance[found.colliding]).all()
    assert (found.volume[~found.colliding] == 0.0).all()
    assert np.isnan(found.covariance[~found.colliding]).all()


# --- laws, on all families ------------------------------------------------------------------------


@pytest.fixture(scope='module')
def everything():
    return Pairs(*poses.hard_pairs())


def test_reflection(everything):
    """The mirror image of a scene has the mirror image of its answer: verdict and separation."""
    def mirrored(pose):
        return pose * np.array([-1, 1, 1, 1, -1, -1, 1])

    one = solve('exact', everything)
    two = solve('exact', everything._replace(pose_a=mirrored(everything.pose_a),
                                             pose_b=mirrored(everything.pose_b)))
    np.testing.assert_array_equal(one.colliding, two.colliding)
    allowed = judge.rounding(*everything)
    assert (np.abs(one.separation - two.separation) <= allowed).all()


@pytest.mark.parametrize('model', MODELS)
def test_free_after_moving_by_the_depth(everything, model):
    """Moved by depth + m along the normal B is free, by depth − m it is not.

    In between the depth falls by what it was moved. m = max(1e-9 · depth, 8 ulp of the
    coordinates).
    """
    one = solve(model, everything)
    rows = one.colliding & (one.separation < -1e-7 * everything.size)
    depth = -one.separation[:, None]
    reach = np.abs(np.hstack([everything.pose_a[:, :3], everything.pose_b[:, :3]])).max(axis=1)
    m = np.maximum(1e-9 * depth[:, 0], 8 * np.spacing(np.maximum(reach, everything.size)))
    m = (m + 2 * judge.rounding(*everything))[:, None]

    def moved(by):
        pose_b = everything.pose_b.copy()
        pose_b[:, :3] += by * one.normal
        pose_b[~rows] = everything.pose_b[~rows]
        return solve(model, everything._replace(pose_b=pose_b))

    assert not moved(depth + m).colliding[rows].any()
    assert moved(depth - m).colliding[rows].all()
    half = moved(0.5 * depth)
    assert (np.abs(half.separation + 0.5 * depth[:, 0]) <= 2 * m[:, 0])[rows].all()


def test_depth_is_lipschitz(everything):
    """The separation changes by no more than the poses do, ties or not."""
    rng = np.random.default_rng(8)
    size, n = everything.size, len(everything.pose_a)
    one = solve('exact', everything)
    for scale in (1e-9, 1e-4, 1e-2):
        step = rng.normal(size=(n, 3))
        step *= (scale * size / np.linalg.norm(step, axis=1))[:, None]
        pose_b = everything.pose_b.copy()
        pose_b[:, :3] += step
        two = solve('exact', everything._replace(pose_b=pose_b))
        allowed = scale * size + 2 * judge.rounding(*everything)
        assert (np.abs(two.separation - one.separation) <= allowed).all()


@pytest.mark.parametrize('model', MODELS)
def test_boxes_that_grow_are_no_less_deep(everything, model):
    """Growing a box never lowers the depth."""
    one = solve(model, everything)
    two = solve(model, everything._replace(size_b=1.01 * everything.size_b))
    assert (two.separation <= one.separation + 2 * judge.rounding(*everything)).all()
    assert two.colliding[one.colliding].all()


def test_float32_poses_have_float32_errors(everything):
    """Poses that have been through float32 move the answer by what they move the boxes, no more."""
    near = Pairs(*(part[np.abs(everything.pose_a[:, :3]).max(axis=1) < 100] for part in everything))
    rounded = near._replace(pose_a=near.pose_a.astype(np.float32).astype(float),
                            pose_b=near.pose_b.astype(np.float32).astype(float))
    one, two = solve('mlp', near), solve('mlp', rounded)
    reach = np.maximum(np.abs(near.pose_a[:, :3]), np.abs(near.pose_b[:, :3])).max(axis=1)
    moved = 8 * np.finfo(np.float32).eps * (near.size + reach)
    assert (np.abs(one.separation - two.separation) <= moved).all()


# --- known failures of others, by name ------------------------------------------------------------


def test_edges_along_each_other_that_miss_are_no_contact():
    """Turned by 1e-9 rad, their cross product skipped, a gap of 1e-9 of the size was a contact."""
    a = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    b = (1.8675180668730165, 0.36288113673398403, 0.3285437535754884, -0.5000000000000665,
         -0.500000000000317, -0.500000000000147, -0.4999999999994721)
    size_a = (2.636034007520441, 0.04718327345567861, 1.1853955253154986)
    size_b = (0.6785790000111154, 1.842483032467027, 1.099002126224811)
    gap = oracle.separation(oracle.make_box(a, size_a), oracle.make_box(b, size_b))
    assert gap > mpfr(10)**-14
    assert not ContactSolver(size_a, size_b, model='exact')(a, b).colliding


@pytest.mark.parametrize('pose_a, pose_b, size_a, size_b', [
    ((0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0000001),
     (0.016242526279822186, 0.11268845114167436, 0.018648612997025544, 0.7094920019801736,
      0.07982715801453757, 0.6628618829105046, -0.22992139559820785),
     (0.10089222351760399, 0.0807920781417519, 0.0006930457368158236),
     (0.0005206279955234363, 0.16408506284372681, 2.0994434529696533)),
    ((3.26643545754439, -1.9067456174165587, 9.814509893057261, -0.8700148924731702,
      -0.27780720329361014, -0.4093071453427183, 0.01912865506185331),
     (4.2054494507483, -1.7725916985982675, 9.884613516646413, -0.47311498149398723,
      -0.8438069390258776, 0.1367012202066525, -0.21322532760379437),
     (0.07430151163544794, 0.6218365826466341, 0.0006733588647520777),
     (0.14742832431245748, 1.751368824666705, 0.000533502463306672))])
def test_thin_plates_that_cross_have_a_point_in_both(pose_a, pose_b, size_a, size_b):
    """The integrals of the volume cancelled, and the point was up to 4 % of the size outside."""
    pairs = Pairs(*(np.array([part]) for part in (pose_a, pose_b, size_a, size_b)))
    for model in MODELS:
        found = solve(model, pairs)
        assert found.colliding.all()
        assert not (judge.judge(*pairs, found).faults & judge.OUTSIDE).any()
    # Planes are certain of these overlaps. Clipping has to agree with them.
    by_planes, (clipped, _, _) = pairs.contacts().point, probes.clipped(pairs)
    assert not probes.is_clipped(pairs).any()
    assert np.linalg.norm(by_planes - clipped) < 1e-4 * pairs.size

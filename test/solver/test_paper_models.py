# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Models `paper`, `paper-continuous` and `paper-committee` on whole boxes, in any pose."""
from __future__ import annotations

import numpy as np
import poses
import pytest

from box_contact_ros import ContactSolver
from box_contact_ros.core import native
from box_contact_ros.paper._networks import KERNEL
from box_contact_ros.paper.symmetry import (
    FEATURES,
    OCTANT,
    fold,
)
from box_contact_ros.resources import resource_path
from box_contact_ros.scene.pose import rotation_matrix
from box_contact_ros.solver.models import build_model
from box_contact_ros.solver.weights_file import WeightsError, load_weights, save_weights

EDGE = 2.0
MODELS = {'paper': (poses.CUBE, 0.6, 12.0), 'paper-continuous': (poses.CUBE, 0.008, 0.15),
          'paper-committee': (poses.CUBE, 0.55, 10.0), 'container': (poses.CONTAINER, 1.4, 12.0)}
"""Model: size, and bounds of the mean point error [m] and of the mean normal error [deg]. The
shipped weights reach 0.53 m and 7.4°, 0.006 m and 0.11°, 0.49 m and 6.4°, 1.27 m and 7.7°."""


def make(name):
    size = MODELS[name][0]
    model = 'paper' if name == 'container' else name
    return ContactSolver(size, size, model=model), ContactSolver(size, size, model='exact'), size


def touching(size, n=4000, depth=0.0, seed=9):
    """Pairs of equal boxes in any orientation, `depth` [m] deep along SAT's normal."""
    rng = np.random.default_rng(seed)
    exact = ContactSolver(size, size, model='exact')
    a = np.concatenate([rng.uniform(-9, 9, (n, 3)), poses.unit_quaternions(rng, n)], axis=1)
    within = poses.rotate(a[:, 3:], rng.uniform(-0.5, 0.5, (n, 3)) * size)
    turn = poses.unit_quaternions(rng, n)
    within_b = poses.rotate(turn, rng.uniform(-0.5, 0.5, (n, 3)) * size)
    b = np.concatenate([a[:, :3] + within - within_b, turn], axis=1)
    found = exact.batch(a, b)
    assert found.colliding.all()
    b[:, :3] += (-found.separation - depth)[:, None] * found.normal
    return a, b


@pytest.mark.parametrize('name', MODELS)
def test_error_on_touching_boxes(name):
    """Against `exact`, whose point at touch is the paper's impact point."""
    solver, exact, size = make(name)
    a, b = touching(np.array(size), depth=1e-9)
    truth, found = exact.batch(a, b), solver.batch(a, b)
    error = np.linalg.norm(found.point - truth.point, axis=1)
    cosine = np.clip(np.sum(found.normal * truth.normal, axis=1), -1, 1)
    _, metres, degrees = MODELS[name]
    assert error.mean() < metres
    assert np.degrees(np.arccos(cosine)).mean() < degrees
    assert np.array_equal(found.separation, truth.separation)


@pytest.mark.parametrize('name', MODELS)
def test_contracts(name):
    """Finite, unit normal, verdict and separation of SAT, point on the touching box's surface.

    Rows are as single calls.
    """
    solver, exact, size = make(name)
    a, b = touching(np.array(size), n=300, depth=0.05)
    b[::3, :3] += 20.0
    truth, found = exact.batch(a, b), solver.batch(a, b)
    assert np.array_equal(found.colliding, truth.colliding)
    assert np.array_equal(found.separation, truth.separation)
    touch = found.colliding
    assert 0.5 < touch.mean() < 0.8
    assert np.isfinite(found.point[touch]).all() and np.isnan(found.point[~touch]).all()
    assert np.abs(np.linalg.norm(found.normal[touch], axis=1) - 1).max() < 1e-12
    for i in range(0, 300, 5):
        one = solver(a[i], b[i])
        assert np.array_equal(one.point, found.point[i], equal_nan=True)
        assert np.array_equal(one.normal, found.normal[i], equal_nan=True)


@pytest.mark.parametrize('name', MODELS)
def test_point_is_in_the_middle_of_the_depth(name):
    """|point(δ) − (point(0) − δ/2 · normal)| ≤ 1e-4 of the size, where B has moved by −δ · normal.

    The networks know touching boxes only, so the depth δ changes neither the normal nor the rest.
    """
    solver, exact, size = make(name)
    a, b = touching(np.array(size), n=2000, depth=1e-9)
    deep, delta = b.copy(), 0.05
    before = exact.batch(a, b)
    deep[:, :3] -= delta * before.normal
    after = exact.batch(a, deep)
    same = np.sum(before.normal * after.normal, axis=1) > 1 - 1e-12  # no other axis has won
    assert same.mean() > 0.9
    first, second = solver.batch(a, b), solver.batch(a, deep)
    error = np.linalg.norm(second.point - (first.point - 0.5 * delta * before.normal), axis=1)
    # A fold may choose the other side when an offset or an angle is zero but for rounding.
    assert np.quantile(error[same], 0.99) < 1e-4 * max(size)
    assert np.quantile(np.linalg.norm(second.normal - first.normal, axis=1)[same], 0.99) < 1e-4


@pytest.mark.parametrize('name', MODELS)
def test_the_first_refused_row_is_named(name):
    """And other rows do not matter."""
    solver, _, size = make(name)
    a, b = touching(np.array(size), n=6, depth=0.05)
    b[2, 3:] = 0.0
    a[4, 0] = np.nan
    with pytest.raises(ValueError, match=r'poses_b\[2\] quaternion .* has zero length'):
        solver.batch(a, b)


@pytest.mark.parametrize('name', MODELS)
def test_covariance(name):
    """Moved rigidly, the answer moves along (float32 network: 1e-4 of the size)."""
    solver, _, size = make(name)
    a, b = touching(np.array(size), n=500, depth=0.05)
    rng = np.random.default_rng(1)
    turn, shift = poses.unit_quaternions(rng, 500), rng.uniform(-5, 5, (500, 3))
    one = solver.batch(a, b)
    two = solver.batch(poses.moved(a, shift, turn), poses.moved(b, shift, turn))
    error = np.linalg.norm(poses.rotate(turn, one.point) + shift - two.point, axis=1)
    # A fold may choose the other side when an offset or an angle is zero but for rounding.
    assert np.quantile(error, 0.99) < 1e-4 * max(size)


@pytest.mark.parametrize('name', ['paper', 'paper-continuous', 'paper-committee'])
def test_cubes_of_any_edge(name):
    """Scaled by 2^k, so is the point, to the bit."""
    solver, _, size = make(name)
    a, b = touching(np.array(size), n=200, depth=0.05)
    for factor in (2.0**-6, 2.0**6):
        other = ContactSolver([EDGE * factor] * 3, [EDGE * factor] * 3, model=name)
        scaling = np.array([factor] * 3 + [1] * 4)
        one, two = solver.batch(a, b), other.batch(a * scaling, b * scaling)
        assert np.array_equal(one.point * factor, two.point)
        assert np.array_equal(one.normal, two.normal)


@pytest.mark.parametrize('name', MODELS)
def test_calls_and_batches_stay_in_the_core(name, monkeypatch):
    """Arrays are answered without Python, in any number of threads; only refusals go there."""
    solver, exact, size = make(name)
    a, b = touching(np.array(size), n=1200, depth=0.05)

    def refuse(self, *args, **keywords):
        raise AssertionError('the call went to Python')

    for method in ('converted', 'converted_batch'):
        monkeypatch.setattr(ContactSolver, method, refuse)
    sizes = np.tile(size, (1200, 1))
    one, many = solver(a[0], b[0]), solver.batch(a, b, size_a=sizes, size_b=sizes, threads=2)
    assert np.array_equal(one.point, many.point[0]) and np.isnan(one.volume)
    assert np.array_equal(many.point, solver.batch(a, b).point)
    assert np.array_equal(many.axis, exact.batch(a, b).axis)
    with pytest.raises(AssertionError, match='went to Python'):
        solver.batch(a, b, size_a=sizes, size_b=sizes * 1.001)


def test_a_committee_is_the_weighted_mean_of_its_experts(tmp_path):
    """Experts that point along ±x, y and z on top, and a classifier of constants.

    The mean's direction leaves the box; a negative weight counts as none; where all are negative,
    the likeliest expert answers alone.
    """
    pytest.importorskip('safetensors')
    card = load_weights(resource_path('weights', 'paper-committee.safetensors')).card
    a, b = poses.IDENTITY, np.array([0.2, 0.1, 1.99, 0.01, 0.02, 0.3, 1.0])

    def constant(*outputs):
        widths = (6, 20, 18, len(outputs))
        layers = [(np.zeros((n, m)), np.zeros(n)) for m, n in zip(widths, widths[1:])]
        return [*layers[:-1], (layers[-1][0], np.array(outputs))]

    def answer(*weights):
        path = tmp_path / 'committee.safetensors'
        up = np.pi / 2
        save_weights(path, {'classifier': constant(*weights), 'vertex': constant(0, 0, 0, 0),
                            'edge': constant(up, 0, up, 0), 'face': constant(0, up, 0, up)}, card)
        solver = ContactSolver(poses.CUBE, poses.CUBE, model='paper-committee', weights=str(path))
        return solver(a, b).normal

    assert answer(0.6, 0.0, 0.8) == pytest.approx([0.6, 0.0, 0.8], abs=1e-6)
    assert answer(-5.0, 0.3, 0.4) == pytest.approx([0.0, 0.6, 0.8], abs=1e-6)
    assert answer(-5.0, -3.0, -4.0) == pytest.approx([0.0, 1.0, 0.0], abs=1e-6)


def test_numbers_that_are_no_networks_are_refused():
    """Cut short, too long, other layers, widths and folds: nothing beyond the numbers is read."""
    def accepts(numbers):
        try:
            native.PairSolver(KERNEL, poses.CUBE, poses.CUBE,
                              None if numbers is None else numbers.astype(np.float32))
        except ValueError as error:
            assert "not one of this kernel's" in str(error)
            return False
        return True

    size = np.array([poses.CUBE])
    for name in ('paper', 'paper-continuous', 'paper-committee'):
        good = build_model(name, size, size, None).network
        assert accepts(good)
        assert not any(accepts(good[:count]) for count in (0, 4, 5, 12, len(good) // 2,
                                                           len(good) - 1))
        assert not accepts(np.append(good, 0.0)) and not accepts(None)
        for place, values in ((4, (-1.0, 1.0, 1e4)), (5, (0.0, 7.0)), (6, (-3.0, 0.5, 1e3)),
                              (8, (0.0, 5.0))):
            for value in values:
                assert not accepts(np.concatenate([good[:place], [value], good[place + 1:]]))
    assert not accepts(np.concatenate([[FEATURES], build_model(
        'paper', size, size, None).network[1:]]))


def test_continuous_covers_both_subsets():
    """The sweep above reaches faces of A, faces of B and edges."""
    solver, exact, size = make('paper-continuous')
    a, b = touching(np.array(size), n=500)
    normals = exact.batch(a, b).normal
    cosines = [np.einsum('nij,ni->nj', rotation_matrix(p[:, 3:]), normals) for p in (a, b)]
    face = [np.abs(cosine).max(axis=1) > 1 - 1e-9 for cosine in cosines]
    shares = face[0].mean(), face[1].mean(), (~(face[0] | face[1])).mean()
    assert min(shares) > 0.1


@pytest.mark.parametrize('model, sizes, words', [
    ('paper', ((2, 2, 2), (3, 3, 3)), 'two boxes of one size'),
    ('paper', ((1, 2, 3), (1, 2, 3)), "no weights for boxes of size 1 × 2 × 3 m.*model 'exact'"),
    ('paper-continuous', ((1, 2, 3), (1, 2, 3)), "no weights for boxes of size.*model 'exact'")])
def test_other_sizes_are_refused(model, sizes, words):
    with pytest.raises(ValueError, match=words):
        ContactSolver(*sizes, model=model)


def test_other_sizes_in_a_batch_are_refused():
    solver = ContactSolver(poses.CUBE, poses.CUBE, model='paper')
    two = np.tile(poses.IDENTITY, (2, 1))
    for sizes, words in ((([2, 2, 2], [2, 2, 3]), 'for two boxes of one size'),
                         (([1, 2, 3], [1, 2, 3]), 'are for cubes, not for size 1 × 2 × 3 m')):
        with pytest.raises(ValueError, match=words):
            solver.batch(two, two, size_a=sizes[0], size_b=sizes[1])


def test_weights_for_something_else_are_refused():
    cubes = str(resource_path('weights', 'paper.safetensors'))
    with pytest.raises(ValueError, match='are for cubes, not for size'):
        ContactSolver(poses.CONTAINER, poses.CONTAINER, model='paper', weights=cubes)
    with pytest.raises(WeightsError, match="has no network 'vertex_face'"):
        ContactSolver(poses.CUBE, poses.CUBE, model='paper-continuous', weights=cubes)
    with pytest.raises(WeightsError, match='does not exist'):
        ContactSolver(poses.CUBE, poses.CUBE, model='paper', weights='nowhere.safetensors')


def rotations(n, seed=2):
    rng = np.random.default_rng(seed)
    return rng, rng.normal(size=(n, 3)), rotation_matrix(poses.unit_quaternions(rng, n))


def test_arrays_that_do_not_fit_are_refused():
    _, offsets, turns = rotations(3)
    with pytest.raises(ValueError, match='rotation has the wrong shape'):
        fold(OCTANT, offsets, turns[:2], axis=np.zeros(3), normal=offsets)
    with pytest.raises(ValueError, match='NO_FOLD, OCTANT or FEATURES'):
        fold(3, offsets, turns, axis=np.zeros(3), normal=offsets)

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Model `paper` on whole boxes, in any pose."""
from __future__ import annotations

import numpy as np
import poses
import pytest

from box_contact_ros import ContactSolver, make_model
from box_contact_ros.core import native
from box_contact_ros.models.networks import PaperWeights, mlp_numbers
from box_contact_ros.models.weights_file import WeightsError, load_weights
from box_contact_ros.resources import resource_path

numpy_model = pytest.importorskip('benchmarks.paper.numpy_model')

EDGE = 2.0
MODELS = {'cubes': poses.CUBE, 'containers': poses.CONTAINER}
"""Sizes that have weights. Those of containers are for swaying ones: test_paper_weights.py."""


def make(name):
    size = MODELS[name]
    paper = ContactSolver(size, size, model=make_model('paper'))
    return paper, ContactSolver(size, size), size


def test_error_on_touching_boxes():
    """Against `exact`, whose point at touch is the paper's impact point: 0.53 m and 7.4°."""
    solver, exact, size = make('cubes')
    a, b = poses.at_depth(size, depth=1e-9)
    truth, found = exact.batch(a, b), solver.batch(a, b)
    error = np.linalg.norm(found.point - truth.point, axis=1)
    cosine = np.clip(np.sum(found.normal * truth.normal, axis=1), -1, 1)
    assert error.mean() < 0.6
    assert np.degrees(np.arccos(cosine)).mean() < 12.0
    assert np.array_equal(found.separation, truth.separation)


@pytest.mark.parametrize('file', ['paper', 'paper-12.192x2.438x2.591'])
def test_it_is_numpys_model(file):
    """In float64 but for the network: differences of float32, and of angles to 1e-5."""
    weights = load_weights(resource_path('weights', f'{file}.safetensors'))
    size = np.array(weights.card['sizes'][0])
    model = make_model('paper', weights=weights.path)
    a, b = poses.at_depth(size, n=10_000, depth=0.01 * size.min())
    found, wanted = (ContactSolver(size, size, model=one).batch(a, b)
                     for one in (model, numpy_model.NumpyPaper(weights, size)))
    for difference in ((found.point - wanted.point) / size.max(), found.normal - wanted.normal):
        lengths = np.linalg.norm(difference, axis=1)
        assert np.quantile(lengths, 0.999) < 1e-4 and lengths.max() < 1e-3
    one, refused = model.solve(a, b, size[None], size[None])
    assert refused == -1 and np.array_equal(one.point, found.point)


def test_garbage_for_weights_stays_finite():
    """Weights as large as a loader believes: directions stay directions."""
    weights = load_weights(resource_path('weights', 'paper.safetensors'))
    numbers = PaperWeights(weights).numbers.copy()
    numbers[7:] = 1e4 * np.sign(np.random.default_rng(4).normal(size=len(numbers) - 7))
    a, b = poses.at_depth(poses.CUBE, n=1000, depth=0.02)
    solver = native.PairSolver(native.Paper(numbers), poses.CUBE, poses.CUBE)
    found = solver.batch(a, b)
    assert np.isfinite(found.point).all()
    assert np.abs(np.linalg.norm(found.normal, axis=1) - 1).max() < 1e-12


@pytest.mark.parametrize('name', MODELS)
def test_contracts(name):
    """Finite, unit normal, verdict and separation of SAT, point on the touching box's surface.

    Rows are as single calls.
    """
    solver, exact, size = make(name)
    a, b = poses.at_depth(size, n=300, depth=0.05)
    b[::3, :3] += 20.0
    truth, found = exact.batch(a, b), solver.batch(a, b)
    assert np.array_equal(found.colliding, truth.colliding)
    assert np.array_equal(found.separation, truth.separation)
    touch = found.colliding
    assert 0.5 < touch.mean() < 0.8
    assert np.isfinite(found.point[touch]).all() and np.isnan(found.point[~touch]).all()
    assert np.abs(np.linalg.norm(found.normal[touch], axis=1) - 1).max() < 1e-12
    for i in range(0, 300, 5):
        poses.assert_same_bits(solver(a[i], b[i]), found[i])


@pytest.mark.parametrize('name', MODELS)
def test_point_is_in_the_middle_of_the_depth(name):
    """|point(δ) − (point(0) − δ/2 · normal)| ≤ 1e-4 of the size, where B has moved by −δ · normal.

    The networks know touching boxes only, so the depth δ changes neither the normal nor the rest.
    """
    solver, exact, size = make(name)
    a, b = poses.at_depth(size, n=2000, depth=1e-9)
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
    a, b = poses.at_depth(size, n=6, depth=0.05)
    b[2, 3:] = 0.0
    a[4, 0] = np.nan
    with pytest.raises(ValueError, match=r'poses_b\[2\] quaternion .* has zero length'):
        solver.batch(a, b)


@pytest.mark.parametrize('name', MODELS)
def test_covariance(name):
    """Moved rigidly, the answer moves along (float32 network: 1e-4 of the size)."""
    solver, _, size = make(name)
    a, b = poses.at_depth(size, n=500, depth=0.05)
    rng = np.random.default_rng(1)
    turn, shift = poses.unit_quaternions(rng, 500), rng.uniform(-5, 5, (500, 3))
    one = solver.batch(a, b)
    two = solver.batch(poses.moved(a, shift, turn), poses.moved(b, shift, turn))
    error = np.linalg.norm(poses.rotate(turn, one.point) + shift - two.point, axis=1)
    # A fold may choose the other side when an offset or an angle is zero but for rounding.
    assert np.quantile(error, 0.99) < 1e-4 * max(size)


def test_cubes_of_any_edge():
    """Scaled by 2^k, so is the point, to the bit."""
    solver, _, size = make('cubes')
    a, b = poses.at_depth(size, n=200, depth=0.05)
    for factor in (2.0**-6, 2.0**6):
        other = ContactSolver([EDGE * factor] * 3, [EDGE * factor] * 3, model=make_model('paper'))
        scaling = np.array([factor] * 3 + [1] * 4)
        one, two = solver.batch(a, b), other.batch(a * scaling, b * scaling)
        assert np.array_equal(one.point * factor, two.point)
        assert np.array_equal(one.normal, two.normal)


@pytest.mark.parametrize('name', MODELS)
def test_sizes_and_places_of_rows(name):
    """Rows with sizes, or by their places among the boxes, are as rows without; axes are SAT's."""
    solver, exact, size = make(name)
    a, b = poses.at_depth(size, n=200, depth=0.05)
    sizes = np.tile(size, (200, 1))
    many = solver.batch(a, b)
    assert np.array_equal(many.axis, exact.batch(a, b).axis)
    listed = solver.batch(np.concatenate([a, b]), sizes=np.tile(size, (400, 1)),
                          pairs=np.arange(400).reshape(2, 200).T)
    for other in (solver.batch(a, b, size_a=sizes, size_b=sizes, threads=2), listed):
        assert np.array_equal(other.point, many.point)
        assert np.array_equal(other.normal, many.normal)


def test_each_row_by_the_weights_for_its_size():
    """Cubes and containers in one batch; and no rows at all, whatever their size."""
    solver = ContactSolver(model=make_model('paper'))
    parts = [(*poses.at_depth(size, n=50, depth=0.05), np.tile(size, (50, 1)))
             for size in MODELS.values()]
    a, b, sizes = map(np.concatenate, zip(*parts))
    found = solver.batch(a, b, size_a=sizes, size_b=sizes)
    for rows, (a, b, size) in zip((slice(50), slice(50, 100)), parts):
        alone = solver.batch(a, b, size_a=size[0], size_b=size)
        assert np.array_equal(found.point[rows], alone.point)
        assert np.array_equal(found.normal[rows], alone.normal)
    assert not len(solver.batch(a[:0], b[:0], size_a=(1, 2, 3), size_b=(1, 2, 3)))


@pytest.mark.parametrize('sizes, words', [
    (((2, 2, 2), (3, 3, 3)), 'no weights for boxes of 2 × 2 × 2 m and 3 × 3 × 3 m'),
    (((1, 2, 3), (1, 2, 3)), "no weights for boxes of 1 × 2 × 3 m and .*model 'exact'")])
def test_other_sizes_are_refused(sizes, words):
    with pytest.raises(ValueError, match=words):
        ContactSolver(*sizes, model=make_model('paper'))


def test_other_sizes_in_a_batch_are_refused():
    """The first row that is refused is named, whether for its pose or for its size."""
    solver = ContactSolver(poses.CUBE, poses.CUBE, model=make_model('paper'))
    two = np.tile(poses.IDENTITY, (2, 1))
    for sizes, words in ((([2, 2, 2], [2, 2, 3]), 'for boxes of 2 × 2 × 2 m and 2 × 2 × 3 m'),
                         (([1, 2, 3], [1, 2, 3]), 'for boxes of 1 × 2 × 3 m and 1 × 2 × 3 m')):
        with pytest.raises(ValueError, match=words):
            solver.batch(two, two, size_a=sizes[0], size_b=sizes[1])
    rows = np.array([[2.0, 2, 2], [2, 2, 3]])
    with pytest.raises(ValueError, match=r'2 × 2 × 2 m and 2 × 2 × 3 m'):
        solver.batch(two, two, size_b=rows)
    with pytest.raises(ValueError, match=r'poses_a\[0\]'):
        solver.batch(two * [[0], [1]], two, size_b=rows)


def test_weights_for_something_else_are_refused():
    cubes = str(resource_path('weights', 'paper.safetensors'))
    with pytest.raises(ValueError, match='are for two cubes of one size'):
        ContactSolver(poses.CONTAINER, poses.CONTAINER, model=make_model('paper', weights=cubes))
    with pytest.raises(WeightsError, match='does not exist'):
        make_model('paper', weights='nowhere.safetensors')
    with pytest.raises(WeightsError, match="no network 'contact' with 6 inputs and 4 outputs"):
        make_model('paper', weights=resource_path('weights', 'mlp.safetensors'))
    with pytest.raises(ValueError, match='the network does not fit'):
        native.Paper(mlp_numbers(resource_path('weights', 'mlp.safetensors')))

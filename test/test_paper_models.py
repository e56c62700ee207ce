"""Models `paper` and `paper-continuous` on whole boxes, in any pose."""
from __future__ import annotations

import numpy as np
import poses
import pytest

from box_contact_ros import ContactSolver
from box_contact_ros.network import WeightsError
from box_contact_ros.pose import rotation_matrix
from box_contact_ros.resources import resource_path
from box_contact_ros.symmetry import (
    EDGE_EDGE,
    FOLD_SIZE,
    VERTEX_FACE,
    euler_angles,
    fold_features,
    fold_octant,
    folded,
    unfold,
)

EDGE = 2.0
MODELS = {'paper': (poses.CUBE, 0.6, 12.0), 'paper-continuous': (poses.CUBE, 0.008, 0.15),
          'container': (poses.CONTAINER, 1.4, 12.0)}
"""Model: size, and bounds of the mean point error [m] and of the mean normal error [deg]. The
shipped weights reach 0.48 m and 8.9°, 0.006 m and 0.11°, 1.17 m and 9.2°."""


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


@pytest.mark.parametrize('name', ['paper', 'paper-continuous'])
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


def test_fold_octant_reaches_the_domain():
    """The fold has t' ≥ 0, R' proper with angles in [−π/2, π/2], and unfold undoes it."""
    rng, offsets, turns = rotations(2000)
    fold = np.zeros(FOLD_SIZE)
    for t, r in zip(offsets, turns):
        fold_octant(t, r.ravel(), fold)
        turned = fold[21:30].reshape(3, 3)
        assert np.all(fold[18:21] >= 0)
        assert abs(np.linalg.det(turned) - 1) < 1e-12
        assert np.abs(euler_angles(fold)).max() <= np.pi / 2
        assert np.allclose(np.abs(fold[18:21]), np.abs(t))
        assert np.allclose(unfold(fold, *folded(fold, *t)), t)
        assert np.allclose(np.abs(turned), np.abs(r))


@pytest.mark.parametrize('axis', [0, 1, 2, *range(6, 15)])
def test_fold_features_reaches_the_reference_features(axis):
    """The face becomes +x and the corner that looks at it (−, −, −).

    Or the edges become those of z at (+, +) and y at (−, −); angles stay within ±π/2.
    """
    rng, offsets, turns = rotations(500)
    fold = np.zeros(FOLD_SIZE)
    for t, r in zip(offsets, turns):
        if axis < 3:
            n = np.eye(3)[axis]
        else:
            n = np.cross(np.eye(3)[(axis - 6) // 3], r[:, (axis - 6) % 3])
            n /= np.linalg.norm(n)
        n = n * rng.choice([-1.0, 1.0])
        subset = fold_features(t, r.ravel(), axis, n, fold)
        turned = fold[21:30].reshape(3, 3)
        normal = np.array(folded(fold, *n))
        on_b = turned.T @ normal
        assert abs(np.linalg.det(turned) - 1) < 1e-12
        assert np.abs(euler_angles(fold)).max() <= np.pi / 2
        if axis < 3:
            assert subset == VERTEX_FACE
            assert np.allclose(normal, (1, 0, 0))
            assert np.all(on_b >= 0)
        else:
            assert subset == EDGE_EDGE
            assert abs(normal[2]) < 1e-12 and normal[0] >= normal[1] >= -1e-12
            assert abs(on_b[1]) < 1e-12 and on_b[0] >= on_b[2] >= -1e-12

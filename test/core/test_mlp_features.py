# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The MLP from the overlap's bounds on: features, forward pass and point, by a slow reference."""
from __future__ import annotations

import itertools

import numpy as np
import poses
import pytest

from box_contact_ros.core import (
    CENTROID_REACH,
    FEATURES,
    OUTPUTS,
    POINT_OUTPUTS,
    SITES,
    Stages,
    native,
    stages,
)
from box_contact_ros.resources import resource_path
from box_contact_ros.scene.pose_sets import SETS, Pairs
from box_contact_ros.solver.mlp import FEATURE_NAMES, UNITS_MAX, core_numbers
from box_contact_ros.solver.weights_file import Network, load_weights

SHIPPED = load_weights(resource_path('weights', 'mlp.safetensors')).networks['point']
N = 100
ROUNDING = 2e-5
"""Of float32 sums of some ten numbers about one, with weights up to some ten."""
FLUSH = 2.0**-46
"""By which faces are wider [of the size], as in the bounds."""
ANSWERS = ('answer', 'answer_volume', 'answer_covariance')
NAMES = tuple(name for name in Stages._fields if name not in ANSWERS)
UNIT = (1.0, 1.0, 1.0)


def random_network(rng: np.random.Generator, units: int) -> Network:
    """Weights of a size that leaves units about one."""
    widths = (FEATURES, units, OUTPUTS)
    layers = []
    for inputs, outputs in zip(widths, widths[1:]):
        drawn = rng.normal(size=(inputs + 1) * outputs) / np.sqrt(inputs)
        weight, bias = np.split(drawn.astype(np.float32), [inputs * outputs])
        layers.append((weight.reshape(outputs, inputs), bias))
    return Network(layers)


NETWORKS = {'shipped': SHIPPED, 'random': random_network(np.random.default_rng(3), 20),
            'five units': random_network(np.random.default_rng(4), 5),
            'most units': random_network(np.random.default_rng(6), UNITS_MAX),
            'one unit': random_network(np.random.default_rng(8), 1)}


@pytest.fixture(params=NETWORKS)
def network(request: pytest.FixtureRequest) -> Network:
    return NETWORKS[request.param]


def first_rows(pairs: Pairs, count: int) -> Pairs:
    return Pairs(*(part[:count] for part in pairs))


@pytest.fixture(params=SETS)
def pairs(request: pytest.FixtureRequest) -> Pairs:
    return first_rows(SETS[request.param](np.random.default_rng(12), 2 * N), N)


def cuts_of(found: Stages) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return unit normals (n, 3, 3) in the cube, and cuts of the upper and lower faces (n, 3)."""
    normal = found.other_axes * found.bounds_half[:, None, :]
    width = np.abs(normal).sum(axis=2)
    half = found.other_half + FLUSH * found.size[:, None]
    upper, lower = (np.clip(1.0 - (half - sign * found.other_offset) / width, 0.0, 2.0)
                    for sign in (1, -1))
    return normal / width[:, :, None], upper, lower


def described(normal: np.ndarray, upper: np.ndarray, lower: np.ndarray,
              ) -> tuple[np.ndarray, np.ndarray]:
    """Return features (3, 3, 12) and vectors (3, 3, 3) of one overlap: loops over all sites."""
    features, vectors = np.empty((3, 3, FEATURES)), np.empty((3, 3, POINT_OUTPUTS))
    cut, push = upper + lower, (lower - upper)[:, None] * normal
    slanted = np.abs(normal) * cut[:, None]
    for f, q in itertools.product(range(3), range(3)):
        others = [g for g in range(3) if g != f]
        beside = [r for r in range(3) if r != q]
        along = sum(normal[f] @ push[g] for g in others)  # the others' push along these faces
        features[f, q] = [
            slanted[f, q], abs(push[f, q]), push[f, q] * sum(push[g, q] for g in others),
            slanted[f, beside].max(),
            cut[f], np.abs(push[f]).sum(), (lower - upper)[f] * along, cut.sum(),
            slanted[:, q].sum(), abs(push[:, q].sum()), slanted.sum(axis=0)[beside].max(),
            np.abs(push.sum(axis=0)).sum()]
        passed = sum(normal[g, q] * cut[g] * (normal[g] @ push[f]) for g in others)
        vectors[f, q] = [push[f, q], normal[f, q] * cut[f] * along, passed]
    return features, vectors


def reference(network: Network, normal: np.ndarray, upper: np.ndarray, lower: np.ndarray,
              ) -> tuple[np.ndarray, float, np.ndarray]:
    """Return centroid (3,), volume and covariance (3, 3) of one overlap in its bounds.

    By the words of core/src/mlp/cut_cube.hpp, in float64.
    """
    (first, bias), (last, last_bias) = ([part.astype(float) for part in layer]
                                        for layer in network.layers)
    features, vectors = described(normal, upper, lower)
    hidden = np.maximum(features @ first.T + bias, 0.0)
    outputs = hidden @ last.T + last_bias
    cut, push = upper + lower, (lower - upper)[:, None] * normal
    slanted = np.abs(normal) * cut[:, None]
    stretch = np.clip((slanted * outputs[:, :, 4]).sum(axis=0), 0.0, 6.0)
    coupling = np.clip(normal * outputs[:, :, 5], -12.0, 12.0)
    pushed = np.clip((push * outputs[:, :, 6]).sum(axis=0), -12.0, 12.0)
    precision = np.diag(3.0 * np.exp(stretch)) + np.outer(pushed, pushed)
    for f in range(3):
        precision += cut[f] * np.outer(coupling[f], coupling[f])
    share = np.exp(np.clip((slanted * outputs[:, :, 3]).sum(), -80.0, 0.0))
    return ((outputs[:, :, :3] * vectors).sum(axis=(0, 2)), float(share),
            np.linalg.inv(precision))


def placed(found: Stages, row: int, answer: np.ndarray, own: np.ndarray,
           ) -> tuple[np.ndarray, float]:
    """Return the point (3,) for an answer, in A's frame, and how far it is outside the other box.

    own: half extents (3,) of the box of the bounds' frame. The answer is cut to its reach, then
    moved twice to the nearest point of the other box and back to that of its own.
    """
    axes, middle = found.other_axes[row], found.bounds_middle[row]
    other = found.other_half[row]
    reach = np.clip(answer, -CENTROID_REACH, CENTROID_REACH) * found.bounds_half[row]
    point = np.clip(middle + reach, -own, own)
    for _ in range(2):
        at = found.other_offset[row] + axes @ (point - middle)
        point = np.clip(point + axes.T @ (np.clip(at, -other, other) - at), -own, own)
    beyond = np.abs(found.other_offset[row] + axes @ (point - middle)) - other
    if found.frame_b[row]:
        point = found.pressed_offset_a[row] + found.rotation[row] @ point
    return point, float(beyond.max())


def test_features_and_vectors_are_the_references(pairs: Pairs) -> None:
    found = stages(*pairs, names=NAMES)
    assert found.features.shape == (N, SITES, FEATURES) == (N, 9, len(FEATURE_NAMES))
    assert found.features.dtype == found.vectors.dtype == np.float32
    for row, cuts in enumerate(zip(*cuts_of(found))):
        features, vectors = described(*cuts)
        np.testing.assert_allclose(found.features[row].reshape(3, 3, -1), features, atol=3e-6)
        np.testing.assert_allclose(found.vectors[row].reshape(3, 3, -1), vectors, atol=3e-6)


def test_the_answer_is_the_references(pairs: Pairs, network: Network) -> None:
    found = stages(*pairs, names=(*NAMES, *ANSWERS), network=core_numbers(network))
    for row, cuts in enumerate(zip(*cuts_of(found))):
        truth, volume, covariance = reference(network, *cuts)
        np.testing.assert_allclose(found.answer[row], truth,
                                   atol=ROUNDING * max(1.0, np.abs(truth).max()))
        np.testing.assert_allclose(found.answer_volume[row], volume, rtol=20 * ROUNDING)
        np.testing.assert_allclose(found.answer_covariance[row], covariance, atol=ROUNDING)


def test_the_answer_comes_from_the_features(pairs: Pairs, network: Network) -> None:
    """What training sees as features and vectors is what the forward pass uses."""
    found = stages(*pairs, names=(*NAMES, 'answer'), network=core_numbers(network))
    (first, bias), (last, last_bias) = network.layers
    outputs = np.maximum(found.features @ first.T + bias, 0.0) @ last.T + last_bias
    answers = (outputs[..., :POINT_OUTPUTS] * found.vectors).reshape(N, 3, 3, -1).sum(axis=(1, 3))
    largest = np.maximum(1.0, np.abs(answers).max(axis=1, keepdims=True))
    assert np.all(np.abs(answers - found.answer) <= ROUNDING * largest)


def test_points_are_the_references(pairs: Pairs, network: Network) -> None:
    """Those of a batch and, with the same bits, those of single calls."""
    numbers = core_numbers(network)
    found = stages(*pairs, names=NAMES, network=numbers)
    assert found.in_range.all()
    answers, _ = native.PairSolver('mlp', UNIT, UNIT, numbers).solve(*pairs, 1)
    colliding, _, _, points, *_ = answers
    assert colliding.all()
    by_network = 0
    for row, cuts in enumerate(zip(*cuts_of(found))):
        own = 0.5 * (pairs.size_b if found.frame_b[row] else pairs.size_a)[row]
        local, beyond = placed(found, row, reference(network, *cuts)[0], own)
        if beyond > 1e-6 * found.size[row]:  # a point that is left outside is the exact one
            local = found.centroid[row]
        elif beyond > 1e-16 * found.size[row]:
            continue  # rounding decides
        else:
            by_network += 1
        point = pairs.pose_a[row, :3] + poses.rotate(pairs.pose_a[row:row + 1, 3:], local[None])[0]
        allowed = ROUNDING * found.bounds_half[row].max() + 2e-15 * found.size[row]
        assert np.abs(points[row] - point).max() <= 8.0 * allowed
        one = native.PairSolver('mlp', tuple(pairs.size_a[row]), tuple(pairs.size_b[row]), numbers)
        assert np.array_equal(one(pairs.pose_a[row], pairs.pose_b[row]).point, points[row])
    assert by_network > N / 10


def test_the_reference_has_all_symmetries() -> None:
    """The cube's 48, any order of the faces, and each pair of faces counted from either side."""
    rng = np.random.default_rng(5)
    normal = rng.normal(size=(3, 3))
    normal /= np.abs(normal).sum(axis=1, keepdims=True)
    upper, lower = rng.uniform(0.0, 1.0, (2, 3))
    for network in NETWORKS.values():
        truth = reference(network, normal, upper, lower)
        centroid, volume, covariance = truth
        for order in itertools.permutations(range(3)):
            for signs in itertools.product((1.0, -1.0), repeat=3):
                found = reference(network, normal[:, order] * signs, upper, lower)
                turned = covariance[np.ix_(order, order)] * np.outer(signs, signs)
                for one, wanted in zip(found, (centroid[list(order)] * signs, volume, turned)):
                    np.testing.assert_allclose(one, wanted, atol=1e-12)
                side = np.array(signs) < 0.0
                found = reference(network, (normal * np.array(signs)[:, None])[list(order)],
                                  np.where(side, lower, upper)[list(order)],
                                  np.where(side, upper, lower)[list(order)])
                for one, wanted in zip(found, truth):
                    np.testing.assert_allclose(one, wanted, atol=1e-12)


def test_a_symmetric_overlap_is_answered_with_its_middle(network: Network) -> None:
    """Whatever the weights: cubes turned about a common vertical axis, or crossing upright."""
    turn = poses.small_rotations(np.tile([0.0, 0.0, 1.0], (N, 1)), np.linspace(0.01, 1.5, N))
    b = np.column_stack([np.zeros((N, 2)), np.full(N, 0.999), turn])
    size = np.ones((N, 3))
    found = stages(np.tile(poses.IDENTITY, (N, 1)), b, size, size, names=('answer',),
                   network=core_numbers(network))
    assert np.abs(found.answer).max() < ROUNDING


def test_used_up_symmetries_leave_no_steps(network: Network) -> None:
    """Over a tie of two faces, and of two sides of one pair of faces, the answer is continuous."""
    rng = np.random.default_rng(8)
    tiny = 1e-9
    for _ in range(50):
        normal = rng.normal(size=(3, 3))
        normal /= np.abs(normal).sum(axis=1, keepdims=True)
        upper, lower = rng.uniform(0.0, 1.0, (2, 3))
        upper[0] = lower[0]
        upper[1], lower[1] = upper[2] + lower[2], 0.0
        for change in (tiny, -tiny):
            moved = upper + np.array([change, -change, change])
            for one, other in zip(reference(network, normal, moved, lower),
                                  reference(network, normal, upper, lower)):
                np.testing.assert_allclose(one, other, atol=1e-6)


@pytest.mark.parametrize('names, words', [
    (('corner',), "names .'corner'. are not fields"), (('answer',), "'answer' needs a network")])
def test_stages_that_cannot_be_had(names: tuple[str, ...], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        stages([poses.IDENTITY], [poses.IDENTITY], [UNIT], [UNIT], names=names)


def test_stages_name_the_row_that_is_refused() -> None:
    pair = np.tile(poses.IDENTITY, (5, 1))
    bad = pair.copy()
    bad[3, 3:] = 0.0
    for poses_b, size in ((bad, [UNIT]), (pair, [UNIT] * 3 + [(1.0, 0.0, 1.0)] + [UNIT])):
        with pytest.raises(ValueError, match='row 3 '):
            stages(pair, poses_b, [UNIT], size, names=('normal',))


def test_stages_that_are_not_asked_for_are_empty() -> None:
    found = stages([poses.IDENTITY] * 4, [poses.IDENTITY] * 4, [UNIT], [UNIT], names=('axis',))
    assert found.axis.shape == (4,) and found.axis.dtype == np.int64
    assert all(values.size == 0 for name, values in found._asdict().items() if name != 'axis')


def test_stages_are_those_of_a_batch(pairs: Pairs) -> None:
    """Bit for bit: verdict, separation, normal and the exact point, in A's frame."""
    found = stages(*pairs, names=NAMES)
    one = native.PairSolver('exact', UNIT, UNIT)
    at_origin = np.zeros_like(pairs.pose_a)
    at_origin[:, 6] = 1.0
    turn = pairs.pose_a[:, 3:] * (-1, -1, -1, 1)
    b = np.concatenate([poses.rotate(turn, pairs.pose_b[:, :3] - pairs.pose_a[:, :3]),
                        poses.multiply(turn, pairs.pose_b[:, 3:])], axis=1)
    again = stages(at_origin, b, *pairs[2:], names=NAMES)
    (colliding, separation, normal, point, *_), _ = one.solve(at_origin, b, *pairs[2:], 1)
    assert np.array_equal(again.colliding, colliding)
    assert np.array_equal(again.separation, separation)
    assert np.array_equal(again.normal, normal)
    assert np.array_equal(again.centroid, point)
    assert np.abs(again.separation - found.separation).max() < 1e-13
    assert np.all(again.face < 6) and np.all(again.axis < 15)
    assert np.all(again.axis[again.axis < 6] == again.face[again.axis < 6])

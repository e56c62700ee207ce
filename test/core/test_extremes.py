# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Numbers at both ends of what is accepted, and beyond: answers keep their promises or are refused.

Model `mlp` has random weights here: what it promises, it does whatever its weights are.
"""
from __future__ import annotations

import numpy as np
import poses
import pytest
from poses import Pairs

from benchmarks.weights import mlp_shapes
from box_contact_ros import ContactSolver
from box_contact_ros.core import LENGTH_MAX, LENGTH_MIN, native
from box_contact_ros.models.networks import core_numbers
from box_contact_ros.models.weights_file import Network
from box_contact_ros.solver.contact import Contacts

UNIT = (1.0, 1.0, 1.0)
N = 20_000
ASPECT_KNOWN = 1e8
"""Longest by shortest extent up to which points are in both boxes. From 1e9 on, the shortest extent
nears the rounding of the longest, and points are outside by up to 1e-8 of the longest."""


def random_network(rng: np.random.Generator) -> np.ndarray:
    """Return weights of up to 1 or 1e4, one in eight of them zero, as the core reads them."""
    most, hidden = rng.choice([1.0, 1e4]), rng.integers(1, 25, 2)

    def drawn(*shape: int) -> np.ndarray:
        return rng.uniform(-most, most, shape) * (rng.random(shape) > 1 / 8)

    return core_numbers(Network([(drawn(*shape), drawn(shape[0])) for shape in mlp_shapes(hidden)]))


def solver(model: str, rng: np.random.Generator) -> native.Exact | native.Mlp:
    """Return a model, `mlp` with a random network."""
    return native.Mlp(random_network(rng)) if model == 'mlp' else native.Exact()


def accepted(pairs: Pairs) -> np.ndarray:
    good = np.ones(len(pairs.pose_a), bool)
    with np.errstate(all='ignore'):
        for pose in pairs[:2]:
            length = np.sqrt((pose[:, 3:]**2).sum(axis=1))
            good &= (np.abs(pose[:, :3]) <= LENGTH_MAX).all(axis=1)
            good &= (length >= native.QUATERNION_MIN) & (length <= native.QUATERNION_MAX)
        for size in pairs[2:]:
            good &= ((size >= LENGTH_MIN) & (size <= LENGTH_MAX)).all(axis=1)
    return good


@pytest.mark.parametrize('model', ['exact', 'mlp'])
def test_no_volume_is_negative(model: str) -> None:
    """Of parallel boxes that touch, of extents a volume of which rounding leaves nothing."""
    rng = np.random.default_rng(8)
    size_a, size_b = 10.0 ** rng.uniform(-50.0, 50.0, (2, N, 3))
    size_b = np.where(rng.random((N, 1)) < 0.5, size_a, size_b)
    a = np.tile(poses.IDENTITY, (N, 1))
    b = a.copy()
    b[:, :3] = 0.5 * (size_a + size_b) * rng.choice([-1.0, 0.0, 0.5, 1.0, 1.0 - 1e-10], (N, 3))
    found = ContactSolver(model=model).batch(a, b, size_a=size_a, size_b=size_b)
    assert found.colliding.mean() > 0.5
    assert np.all(found.volume >= 0.0)


def outside(pose: np.ndarray, size: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Return by how much points (n, 3) are outside boxes (n,) [m]."""
    turn = pose[:, 3:] / np.abs(pose[:, 3:]).max(axis=1, keepdims=True)
    turn = turn / np.linalg.norm(turn, axis=1, keepdims=True) * (-1, -1, -1, 1)
    return (np.abs(poses.rotate(turn, point - pose[:, :3])) - 0.5 * size).max(axis=1)


@pytest.mark.parametrize('seed', range(2))
@pytest.mark.parametrize('model', ['exact', 'mlp'])
def test_contacts_keep_their_promises(model: str, seed: int) -> None:
    """Bad rows alone are refused. All is finite, normals are unit, exact points in both boxes."""
    rng = np.random.default_rng([17, seed])
    pairs = poses.extreme_pairs(rng, N)
    good = accepted(pairs)
    assert 0.05 < 1.0 - good.mean() < 0.2
    answers, refused = solver(model, rng).solve(*pairs, 2)
    assert refused == np.argmin(good)
    assert not answers.colliding[~good].any() and np.isnan(answers.separation[~good]).all()
    found = answers[good]
    pairs = Pairs(*(part[good] for part in pairs))
    touching, separation = found.colliding, found.separation
    assert 0.4 < touching.mean() < 0.95
    assert np.isfinite(separation).all() and (separation[~touching] > 0.0).all()
    assert np.isnan(np.hstack([found.normal, found.point])[~touching]).all()
    assert not found.volume[~touching].any() and np.isnan(found.covariance[~touching]).all()
    assert np.isfinite(found.point[touching]).all()
    assert np.abs((found.normal[touching]**2).sum(axis=1) - 1.0).max() <= 1e-12
    sizes = np.hstack(pairs[2:])
    reach = np.abs(np.hstack([pairs.pose_a[:, :3], pairs.pose_b[:, :3]])).max(axis=1)
    size = sizes.max(axis=1)
    pressed = np.where(separation > -1e-9 * size, 3e-9 * size, 0.0)
    rows = touching & (size <= ASPECT_KNOWN * sizes.min(axis=1)) & (model == 'exact')
    for pose, extents in ((pairs.pose_a, pairs.size_a), (pairs.pose_b, pairs.size_b)):
        beyond = outside(pose[rows], extents[rows], found.point[rows])
        assert np.all(beyond <= (2.0**-43 * (size + reach) + pressed)[rows])


@pytest.mark.parametrize('model', ['exact', 'mlp'])
def test_a_row_is_its_single_call(model: str) -> None:
    """In batches of each length up to two blocks of lanes and one more."""
    rng = np.random.default_rng(19)
    pairs, number = poses.extreme_pairs(rng, 3000), solver(model, rng)
    alone = [number.solve(*(part[row:row + 1] for part in pairs), 1) for row in range(3000)]
    assert np.array_equal([refused == 0 for _, refused in alone], ~accepted(pairs))
    first, count = 0, 1
    while first + count <= 3000:
        rows = slice(first, first + count)
        many, _ = number.solve(*(part[rows] for part in pairs), 1)
        good = accepted(Pairs(*(part[rows] for part in pairs)))
        singles = Contacts.of([answer[0] for answer, _ in alone[rows]])
        poses.assert_same_bits(many[good], singles[good], where=first)
        first, count = first + count, count % (2 * native.lanes + 1) + 1


@pytest.mark.parametrize('seed', range(8))
def test_mlp_is_sound(seed: int) -> None:
    """Volumes are above zero, and no eigenvalue is below."""
    rng = np.random.default_rng([23, seed])
    pairs = poses.extreme_pairs(rng, N)
    pairs = Pairs(*(part[accepted(pairs)] for part in pairs))
    found = solver('mlp', rng).solve(*pairs, 1)[0]
    rows = found.colliding
    assert rows.mean() > 0.1 and np.isfinite(found.point[rows]).all()
    assert (found.volume[rows] > 0.0).all()
    covariance = found.covariance[rows]
    scaled = covariance / np.trace(covariance, axis1=1, axis2=2)[:, None, None]
    assert np.array_equal(scaled, scaled.transpose(0, 2, 1))
    assert np.linalg.eigvalsh(scaled)[:, 0].min() >= -1e-14

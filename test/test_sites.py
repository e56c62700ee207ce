"""The MLP: its symmetries, against a slow reference, with any weights."""
from __future__ import annotations

import itertools

import numpy as np
import poses
import pytest

from box_contact_ros import sites
from box_contact_ros.block import (
    CENTROID,
    HALF,
    LANES,
    NORMALS,
    OFFSETS,
    OTHER,
    new_work,
)
from box_contact_ros.network import Network, load_weights, unpacked
from box_contact_ros.outline import outline_block
from box_contact_ros.overlap import press
from box_contact_ros.pose import load_block
from box_contact_ros.posesets import SETS, Pairs
from box_contact_ros.resources import resource_path
from box_contact_ros.sat import query_block

SHIPPED = load_weights(resource_path('weights', 'mlp.safetensors')).networks['point']
ROUNDING = 2e-5
"""Of float32 sums of some ten numbers about one, with weights up to some ten."""


def random_network(rng: np.random.Generator, units: int) -> Network:
    """Weights of a size that leaves units about one."""
    widths = (sites.INPUTS, units, sites.OUTPUTS)
    packed = np.concatenate([rng.normal(size=a * b + b) / np.sqrt(a)
                             for a, b in zip(widths, widths[1:])])
    return Network('point', widths, packed.astype(np.float32))


NETWORKS = {'shipped': SHIPPED, 'random': random_network(np.random.default_rng(3), 20),
            'five units': random_network(np.random.default_rng(4), 5)}


@pytest.fixture(params=NETWORKS)
def network(request: pytest.FixtureRequest) -> Network:
    return NETWORKS[request.param]


@pytest.fixture(params=SETS)
def work(request: pytest.FixtureRequest) -> np.ndarray:
    """A block of contacts, up to where the network is asked."""
    pairs = SETS[request.param](np.random.default_rng(12), 2 * LANES)
    return outlined(Pairs(*(part[:LANES] for part in pairs)))


def outlined(pairs: Pairs) -> np.ndarray:
    work = new_work()
    count = len(pairs.pose_a)
    load_block(*(np.ascontiguousarray(part) for part in pairs), 0, count, work)
    query_block(LANES, work)
    for i in range(count):
        press(work, i)
    outline_block(LANES, work)
    return work


def rows(work: np.ndarray, first: int, count: int) -> np.ndarray:
    """(LANES, count) of a block."""
    return work[first:first + count * LANES].reshape(count, LANES).T.copy()


def cuts_of(work: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit normals (LANES, 3, 3) in the cube, and cuts of the upper and lower faces (LANES, 3)."""
    sites.describe_block(work, np.zeros(sites.ROWS * LANES, dtype=np.float32))
    normal = rows(work, NORMALS, 9).reshape(-1, 3, 3) * rows(work, HALF, 3)[:, None, :]
    width = np.abs(normal).sum(axis=2)
    offset, half = rows(work, OFFSETS, 3), rows(work, OTHER, 3)
    upper, lower = (np.clip(1.0 - (half - sign * offset) / width, 0.0, 2.0) for sign in (1, -1))
    return normal / width[:, :, None], upper, lower


def reference(network: Network, normal: np.ndarray, upper: np.ndarray, lower: np.ndarray,
              ) -> np.ndarray:
    """(3,) the answer for one overlap, by the words of the module: float64, loops over all."""
    (first, bias), (last, last_bias) = ([part.astype(float) for part in layer]
                                        for layer in unpacked(network))
    cut, push = upper + lower, (lower - upper)[:, None] * normal
    slanted = np.abs(normal) * cut[:, None]
    answer = np.zeros(3)
    for f, q in itertools.product(range(3), range(3)):
        others = [g for g in range(3) if g != f]
        beside = [r for r in range(3) if r != q]
        along = sum(normal[f] @ push[g] for g in others)  # the others' push along these faces
        inputs = [slanted[f, q], abs(push[f, q]), push[f, q] * sum(push[g, q] for g in others),
                  slanted[f, beside].max(),
                  cut[f], np.abs(push[f]).sum(), (lower - upper)[f] * along, cut.sum(),
                  slanted[:, q].sum(), abs(push[:, q].sum()), slanted.sum(axis=0)[beside].max(),
                  np.abs(push.sum(axis=0)).sum()]
        hidden = first @ np.array(inputs) + bias
        outputs = last @ np.maximum(hidden, 0.0) + last_bias
        passed = sum(normal[g, q] * cut[g] * (normal[g] @ push[f]) for g in others)
        answer[q] += outputs @ [push[f, q], normal[f, q] * cut[f] * along, passed]
    return answer


def test_the_kernel_is_the_reference(work: np.ndarray, network: Network) -> None:
    normal, upper, lower = cuts_of(work)
    sites.centroid_block(work, sites.site_numbers(network))
    found = rows(work, CENTROID, 3)
    for i in range(LANES):
        truth = reference(network, normal[i], upper[i], lower[i])
        np.testing.assert_allclose(found[i], truth, atol=ROUNDING * max(1.0, np.abs(truth).max()))


def test_the_reference_has_all_symmetries() -> None:
    """The cube's 48, any order of the faces, and each couple counted from either side."""
    rng = np.random.default_rng(5)
    normal = rng.normal(size=(3, 3))
    normal /= np.abs(normal).sum(axis=1, keepdims=True)
    upper, lower = rng.uniform(0.0, 1.0, (2, 3))
    for network in NETWORKS.values():
        truth = reference(network, normal, upper, lower)
        for order in itertools.permutations(range(3)):
            for signs in itertools.product((1.0, -1.0), repeat=3):
                found = reference(network, normal[:, order] * signs, upper, lower)
                np.testing.assert_allclose(found, truth[list(order)] * signs, atol=1e-12)
                side = np.array(signs) < 0.0
                found = reference(network, (normal * np.array(signs)[:, None])[list(order)],
                                  np.where(side, lower, upper)[list(order)],
                                  np.where(side, upper, lower)[list(order)])
                np.testing.assert_allclose(found, truth, atol=1e-12)


def test_a_single_pair_has_the_bits_of_a_block(work: np.ndarray, network: Network) -> None:
    block, numbers = work.copy(), sites.site_numbers(network)
    sites.centroid_block(block, numbers)
    for i in range(LANES):
        one = np.zeros_like(work)
        lanes = work[:len(work) // LANES * LANES].reshape(-1, LANES)
        one[:lanes.size].reshape(-1, LANES)[:, 0] = lanes[:, i]
        sites.centroid_one(one, numbers)
        assert np.array_equal(rows(one, CENTROID, 3)[0], rows(block, CENTROID, 3)[i]), i


def test_a_symmetric_overlap_is_answered_with_its_middle(network: Network) -> None:
    """Whatever the weights: cubes turned about a common vertical axis, or crossing upright."""
    turn = poses.small_rotations(np.tile([0.0, 0.0, 1.0], (LANES, 1)),
                                 np.linspace(0.01, 1.5, LANES))
    b = np.column_stack([np.zeros((LANES, 2)), np.full(LANES, 0.999), turn])
    size = np.ones((LANES, 3))
    work = outlined(Pairs(np.tile(poses.IDENTITY, (LANES, 1)), b, size, size))
    sites.centroid_block(work, sites.site_numbers(network))
    assert np.abs(rows(work, CENTROID, 3)).max() < ROUNDING


def test_used_up_symmetries_leave_no_steps(network: Network) -> None:
    """Over a tie of two faces, and of two sides of one couple, the answer is continuous."""
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
            np.testing.assert_allclose(reference(network, normal, moved, lower),
                                       reference(network, normal, upper, lower), atol=1e-6)

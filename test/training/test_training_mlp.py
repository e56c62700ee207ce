# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Training of model `mlp`: its samples, its network and errors beside the core's, the program."""
from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

torch = pytest.importorskip('torch')

from benchmarks.pose_sets import SETS, Pairs
from benchmarks.weights import save_weights
from box_contact_ros import ContactSolver
from box_contact_ros.core import BRACKET_LIMIT, FEATURES, SPREAD_LIMIT, UPPER_LIMIT
from box_contact_ros.solver.mlp import NETWORK, load_mlp
from box_contact_ros.solver.weights_file import load_weights
from training import __main__ as train
from training import recipe, samples
from training.fit import ShareNetwork, errors_of, fit, loss_of, tensors
from training.samples import BEYOND, OPEN, MlpSamples, describe

PAIRS = 40_000


@pytest.fixture(scope='module')
def pairs() -> Pairs:
    return samples.mixture(np.random.default_rng(5), PAIRS)


@pytest.fixture(scope='module')
def data(pairs: Pairs) -> MlpSamples:
    return describe(pairs)[0]


def drawn(seed: int, hidden: int) -> ShareNetwork:
    """Return a network whose answers are spread over 0 to 1, with units on both sides of zero."""
    torch.manual_seed(seed)
    network = ShareNetwork(hidden)
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.copy_(torch.randn(parameter.shape))
    return network


def solver_of(network: ShareNetwork, path: Path) -> ContactSolver:
    card = load_mlp().card
    save_weights(path, {NETWORK: network.layers()},
                 {**card, 'architecture': [FEATURES, network.hidden.out_features, 1]})
    return ContactSolver((1, 1, 1), (1, 1, 1), model='mlp', weights=str(path))


# --- samples --------------------------------------------------------------------------------------


def test_samples_are_open_and_near_the_limits(pairs: Pairs, data: MlpSamples) -> None:
    """By the formulas of `take_off`, in units of the columns' volume and of the true radius."""
    assert 0.01 * PAIRS < len(data) < 0.5 * PAIRS
    uncertain = data.cut * (data.most - data.least)
    assert OPEN < uncertain.sum(axis=1).min()
    assert uncertain.sum(axis=1).max() < BEYOND * BRACKET_LIMIT
    assert data.cut.sum(axis=1).max() < BEYOND * UPPER_LIMIT
    spread = np.einsum('nk,nkp,nkpi->n', uncertain, data.carries, data.points**2)
    assert (spread / np.trace(data.columns_covariance, axis1=1, axis2=2)).max() < (
        BEYOND * SPREAD_LIMIT * (1.0 + 1e-9))
    for array in vars(data).values():
        assert np.isfinite(array).all() and len(array) == len(data)


def test_samples_beyond_a_limit_are_left_to_exact() -> None:
    """Those have the bits of `exact`; the second moments decide about some of them alone."""
    pairs = samples.mixture(np.random.default_rng(6), 8 * PAIRS)
    data, rows = describe(pairs)
    uncertain = data.cut * (data.most - data.least)
    spread = np.einsum('nk,nkp,nkpi->n', uncertain, data.carries, data.points**2)
    trace = np.trace(data.columns_covariance, axis1=1, axis2=2)
    volume = 1.0 - data.cut.sum(axis=1)
    by_limit = np.array([uncertain.sum(axis=1) / volume / BRACKET_LIMIT,
                         data.cut.sum(axis=1) / UPPER_LIMIT,
                         spread / trace / volume / SPREAD_LIMIT])
    assert np.count_nonzero((by_limit[2] > 1.1) & (by_limit[:2] < 0.95).all(axis=0)) > 3
    chosen = pairs.rows(np.flatnonzero(rows)[(by_limit > 1.1).any(axis=0)])
    np.testing.assert_array_equal(
        chosen.contacts(ContactSolver((1, 1, 1), (1, 1, 1))).volume, chosen.contacts().volume)


def test_samples_are_the_exact_overlap(pairs: Pairs, data: MlpSamples) -> None:
    """Eigenvalues and volumes of model `exact`; the truth is between the brackets."""
    rows = describe(pairs)[1]
    exact = pairs.rows(rows).contacts()
    trace = np.trace(exact.covariance, axis1=1, axis2=2)[:, None]
    np.testing.assert_allclose(np.linalg.eigvalsh(data.covariance),
                               np.linalg.eigvalsh(exact.covariance) / trace, atol=1e-12)
    np.testing.assert_allclose(
        data.whitening @ data.covariance @ data.whitening.swapaxes(1, 2),
        np.broadcast_to(np.eye(3), data.covariance.shape), atol=1e-6)
    least, most = (1.0 - (data.cut * share).sum(axis=1) for share in (data.most, data.least))
    assert (data.volume > least - 2e-4).all() and (data.volume < most + 2e-4).all()


# --- network and errors ---------------------------------------------------------------------------


@pytest.mark.parametrize(('seed', 'hidden'), [(2, 3), (4, 8)])
def test_errors_are_those_of_the_core(pairs: Pairs, tmp_path: Path, seed: int, hidden: int,
                                      ) -> None:
    """Of a network of drawn weights: the fit's errors are those of the compiled model."""
    network, truth = drawn(seed, hidden), pairs.contacts()
    found = pairs.contacts(solver_of(network, tmp_path / 'mlp.safetensors'))
    data, rows = describe(pairs)
    with torch.no_grad():
        answers = network(tensors(data).features)
        errors = [part.numpy() for part in errors_of(network, tensors(data))]
        active = (network.hidden(tensors(data).features) > 0.0).float().mean()
    assert answers.min() < 0.05 and answers.max() > 0.95 and 0.1 < active < 0.9
    own = (found.volume != truth.volume)[rows]
    assert own.sum() > 0.3 * len(data)
    found, truth = (type(one)(*(part[rows][own] for part in one)) for one in (found, truth))
    radius = np.sqrt(np.trace(truth.covariance, axis1=1, axis2=2))
    whitening = np.linalg.inv(np.linalg.cholesky(truth.covariance))
    wrong = whitening @ (found.covariance - truth.covariance) @ whitening.swapaxes(1, 2)
    expected = (np.linalg.norm(found.point - truth.point, axis=1) / radius,
                np.abs(found.volume / truth.volume - 1.0), np.linalg.norm(wrong, axis=(1, 2)))
    assert expected[1].max() > 1e-3
    for of_fit, of_core in zip(errors, expected):
        np.testing.assert_allclose(of_fit[own], of_core, rtol=2e-3, atol=1e-4)


def test_the_fit_lowers_the_loss_and_follows_the_seed(data: MlpSamples) -> None:
    def losses(seed: int) -> list[float]:
        torch.manual_seed(seed)
        return [loss.item() for loss in fit(
            ShareNetwork(8), data, steps=150, batch=1024, rate=1e-2,
            generator=torch.Generator().manual_seed(seed))]

    first = losses(1)
    assert np.mean(first[-30:]) < 0.8 * np.mean(first[:3])
    assert first == losses(1) != losses(2)


# --- the program ----------------------------------------------------------------------------------


@pytest.fixture(scope='module')
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('quick')
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recipe, 'HARD_START', 20_000)
        patch.setattr(recipe, 'HARD_COUNT', 500)
        assert train.main(['mlp', '--quick', '--hidden', '6', '--seed', '3', '--out',
                           str(folder)]) == 0
    return folder / 'mlp-6.safetensors'


def test_quick_training(quick: Path) -> None:
    """Weights that load, the spread of all seeds, metrics that are true."""
    card: dict[str, Any] = load_mlp(str(quick)).card
    assert [path.name for path in quick.parent.iterdir()] == ['mlp-6.safetensors']
    assert card['architecture'] == [FEATURES, 6, 1] and card['sizes'] == []
    assert card['data']['hard'] > 0 < card['data']['contacts']
    assert len(card['spread']) == recipe.QUICK['networks'] == 2
    assert card['spread'][0] != card['spread'][1]
    assert card['seed'] in (3, 4)  # that of the network which is written
    medians = [sum(entry['p99'] for entry in one.values()) for one in card['spread']]
    assert medians[card['seed'] - 3] == sorted(medians)[len(medians) // 2]
    for one in card['spread']:
        assert 0.0 < one['volume']['mean'] < one['volume']['p99'] < one['volume']['worst'] <= (
            100.0 * BEYOND * BRACKET_LIMIT * 1.1)
    assert card['metrics'].keys() == SETS.keys()
    assert card['metrics'] == recipe.measured(quick, 3, recipe.QUICK['metric_pairs'])
    assert all(entry['point']['worst'] < 1.0 for entry in card['metrics'].values())


def test_what_is_learned_is_better_than_the_middle(quick: Path, data: MlpSamples) -> None:
    """The loss is less than with the middle of the brackets, which a network of zeros says."""
    middle = ShareNetwork(6)
    layers = load_weights(quick).networks[NETWORK].layers
    learned = ShareNetwork(6)
    with torch.no_grad():
        for parameter in middle.parameters():
            parameter.zero_()
        for parameter, array in zip(learned.parameters(), (part for layer in layers
                                                           for part in layer)):
            parameter.copy_(torch.from_numpy(array.copy()))
        one, other = (errors_of(network, tensors(data)) for network in (learned, middle))
    assert loss_of(one) < loss_of(other)

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Training of model `mlp`: its samples, its network and errors beside the core's, the program."""
from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from benchmarks.errors import contact_errors
from benchmarks.mlp_samples import MlpSamples, describe, mixture
from benchmarks.pose_sets import LOADS, SETS, Pairs
from benchmarks.weights import save_weights
from box_contact_ros import ContactSolver, make_model
from box_contact_ros.core import FEATURES, OUTPUTS
from box_contact_ros.models.networks import network_of
from box_contact_ros.models.weights_file import load_weights
from box_contact_ros.resources import resource_path
from training import __main__ as train
from training import recipe
from training.fit import PatchNetwork, errors_of, fit, loss_of, tensors

pytestmark = pytest.mark.training
PAIRS = 20_000
SHIPPED = load_weights(resource_path('weights', 'mlp.safetensors'))


@pytest.fixture(scope='module')
def pairs() -> Pairs:
    return mixture(np.random.default_rng(5), PAIRS)


@pytest.fixture(scope='module')
def data(pairs: Pairs) -> MlpSamples:
    return describe(pairs)[0]


def test_samples_are_the_exact_overlap(pairs: Pairs, data: MlpSamples) -> None:
    """Traces and volumes of model `exact`; its centroid is between the bounds."""
    exact = pairs.rows(describe(pairs)[1]).contacts()
    assert len(data) > 0.8 * PAIRS
    for array in vars(data).values():
        assert np.isfinite(array).all() and len(array) == len(data)
    thick, pressed = data.half.min(axis=1) > 1e-4, data.half.min(axis=1) < 1e-7
    assert np.abs(data.mean[~pressed]).max() < 1.01 and np.all(data.volume[thick] <= 1.01)
    edge = pairs.edge[describe(pairs)[1]]
    scale = data.half * edge[:, None]
    np.testing.assert_allclose(8.0 * scale.prod(axis=1) * data.volume, exact.volume, rtol=1e-9)
    variances = np.einsum('nii,ni->n', data.covariance, scale**2)
    np.testing.assert_allclose(variances, np.trace(exact.covariance, axis1=1, axis2=2), rtol=1e-6)


@pytest.mark.parametrize('hidden', [(3, 5), (8, 16)])
def test_errors_are_those_of_the_core(pairs: Pairs, tmp_path: Path, hidden: tuple[int, int],
                                      ) -> None:
    """Of a network of drawn weights: the fit's errors are those of the compiled model."""
    torch.manual_seed(2)
    network = PatchNetwork(hidden)
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.copy_(torch.randn(parameter.shape))
    save_weights(tmp_path / 'mlp.safetensors', {'patch': network.layers()},
                 {**SHIPPED.card, 'architecture': [FEATURES, *hidden, OUTPUTS]})
    solver = ContactSolver(model=make_model('mlp', weights=tmp_path / 'mlp.safetensors'))
    data, rows = describe(pairs)
    asked = pairs.rows(rows)
    expected = contact_errors(asked.contacts(solver), asked.contacts(), asked.edge)
    with torch.no_grad():
        errors = errors_of(network, tensors(data))
    assert np.median(expected.volume) > 10.0
    (fitted, found), *others = ((100.0 * of_fit.numpy(), of_core)
                                for of_fit, of_core in zip(errors, expected))
    for of_fit, of_core in others:
        np.testing.assert_allclose(of_fit, of_core, rtol=5e-3, atol=0.02)
    # The core moves points into both boxes, which brings them closer to all that is there.
    assert np.all(found <= 1.005 * fitted + 0.02)
    assert np.mean(np.abs(found - fitted) < 0.02) > 0.2


def test_the_fit_lowers_the_loss_and_follows_the_seed(data: MlpSamples) -> None:
    batches = tensors(data)

    def losses(seed: int) -> list[float]:
        torch.manual_seed(seed)
        return [loss.item() for loss in fit(
            PatchNetwork((8, 8)), batches, steps=150, batch=1024, rate=1e-2,
            generator=torch.Generator().manual_seed(seed))]

    first = losses(1)
    assert np.mean(first[-30:]) < 0.8 * np.mean(first[:3])
    assert first == losses(1) != losses(2)


@pytest.fixture(scope='module')
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('quick')
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recipe, 'HARD_START', 20_000)
        patch.setattr(recipe, 'HARD_COUNT', 500)
        assert train.main(['mlp', '--quick', '--hidden', '6', '5', '--seed', '3', '--out',
                           str(folder)]) == 0
    return folder / 'mlp-6-5.safetensors'


def test_quick_training(quick: Path, data: MlpSamples) -> None:
    """Weights that load, the spread of all seeds, true metrics, an error that has fallen."""
    weights = load_weights(quick)
    assert network_of(weights, 'mlp').widths[0] == FEATURES
    card: dict[str, Any] = weights.card
    assert [path.name for path in quick.parent.iterdir()] == ['mlp-6-5.safetensors']
    assert card['architecture'] == [FEATURES, 6, 5, OUTPUTS] and card['sizes'] == []
    assert card['data']['hard'] > 0 < card['data']['contacts']
    assert len(card['spread']) == recipe.QUICK['networks'] == 2
    assert card['spread'][0] != card['spread'][1]
    assert card['seed'] in (3, 4)  # that of the network which is written
    assert card['metrics'].keys() == {*SETS, *LOADS, 'settled'}
    assert card['metrics'] == recipe.measured(quick, 3, recipe.QUICK['metric_pairs'])
    body, learned = PatchNetwork((6, 5)), PatchNetwork((6, 5))
    layers = [part for layer in weights.networks['patch'].layers for part in layer]
    with torch.no_grad():
        for parameter, zero, array in zip(learned.parameters(), body.parameters(), layers):
            parameter.copy_(torch.from_numpy(array.copy()))
            zero.zero_()
        one, other = (errors_of(network, tensors(data)) for network in (learned, body))
    assert loss_of(one) < loss_of(other)


def test_another_size_goes_beside_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Under its own name, and the compiled-in weights stay as they are."""
    trained: dict[str, tuple[int, int]] = {}

    def train_one(path: Path, *, hidden: tuple[int, int], **_: object) -> dict[str, Any]:
        trained[path.name] = hidden
        assert path.parent == tmp_path
        return {**SHIPPED.card, 'training': {'minutes': 0.0}}

    monkeypatch.setattr(recipe, 'train', train_one)
    monkeypatch.setattr(train, 'OTHER_WEIGHTS', tmp_path)
    monkeypatch.setattr(train, 'SHIPPED_HEADER', tmp_path / 'unwritten.hpp')
    assert train.main(['mlp', '--hidden', '3', '5']) == 0
    assert trained == {'mlp-3-5.safetensors': (3, 5)}
    assert not list(tmp_path.iterdir())

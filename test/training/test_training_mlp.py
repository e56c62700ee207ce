# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Training of model `mlp`: its samples, its network and errors beside the core's, the program."""
from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from benchmarks import settled
from benchmarks.errors import contact_errors
from benchmarks.mlp_samples import (
    MIRRORED,
    NEAR_FLIP,
    MlpSamples,
    describe,
    mixture,
    with_mirror_images,
)
from benchmarks.pose_sets import LOADS, SETS, Pairs, symmetric
from benchmarks.weights import mlp_shapes, save_weights
from box_contact_ros import ContactSolver, make_model
from box_contact_ros.core import FEATURES, OUTPUTS
from box_contact_ros.models.networks import network_of
from box_contact_ros.models.weights_file import load_weights
from box_contact_ros.resources import resource_path
from training import __main__ as train
from training import recipe
from training.fit import PatchNetwork, errors_of, fit, tensors

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
    network = PatchNetwork(hidden, torch.from_numpy(describe(pairs)[0].features).float())
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
            PatchNetwork((8, 8), batches.features), batches, steps=150, batch=1024, rate=1e-2,
            generator=torch.Generator().manual_seed(seed))]

    first = losses(1)
    assert np.mean(first[-30:]) < 0.8 * np.mean(first[:3])
    assert first == losses(1) != losses(2)


def trained_on(samples: MlpSamples) -> PatchNetwork:
    """Return a network after ten steps on these samples alone."""
    torch.manual_seed(1)
    network = PatchNetwork((8, 8), tensors(samples).features)
    for _ in fit(network, tensors(samples), steps=10, batch=256, rate=1e-3,
                 generator=torch.Generator().manual_seed(1)):
        pass
    return network


def test_contacts_of_half_a_nanometre_are_learnt_from(data: MlpSamples) -> None:
    """Squares of such half extents have no float32: the gradient was NaN, and so the network."""
    tiny = data.each(lambda array: array[:500].copy())
    tiny.half[:] *= 5e-10 / tiny.half.max(axis=1, keepdims=True)
    assert all(torch.isfinite(weight).all() for weight in trained_on(tiny).parameters())


def test_what_is_not_finite_ends_the_training(data: MlpSamples) -> None:
    """By an error that names the step; a network of NaN was trained to the end, and written."""
    planted = data.each(lambda array: array[:500].copy())
    planted.features[123, 7] = np.nan
    with pytest.raises(FloatingPointError, match=r'^step \d of 10: the loss is nan'):
        trained_on(planted)


def test_mirror_images_are_what_the_core_sees_of_a_mirrored_pair() -> None:
    """Of contacts near a flip, a part has an image, the sample of the mirrored contact.

    There, coordinates of the axis change their signs, and so do the features that are odd in it.
    """
    data = describe(symmetric(np.random.default_rng(2), 4000))[0]
    both = with_mirror_images(data)
    assert len(data) < len(both) < 2 * len(data)
    images = both.part(slice(len(data), None))
    assert np.isfinite(images.features).all()
    # A mirrored sample that is mirrored again is in the data: of the x axis, 0, here.
    near = np.flatnonzero(np.abs(data.features[:, 0]) < NEAR_FLIP)[::MIRRORED]
    sources, image = data.part(near), images.part(slice(len(near)))
    np.testing.assert_array_equal(image.features[:, 11:15], sources.features[:, 15:])
    np.testing.assert_array_equal(image.features[:, 8:10], -sources.features[:, 8:10])
    np.testing.assert_array_equal(image.features[:, 10], sources.features[:, 10])
    np.testing.assert_array_equal(image.mean, sources.mean * (-1.0, 1.0, 1.0))
    np.testing.assert_array_equal(image.covariance[:, 0, 1], -sources.covariance[:, 0, 1])


@pytest.fixture(scope='module')
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('quick')
    assert train.main(['mlp', '--quick', '--hidden', '6', '5', '--seed', '3', '--out',
                       str(folder)]) == 0
    return folder / 'mlp-6-5.safetensors'


def test_quick_training(quick: Path, data: MlpSamples) -> None:
    """Weights that load, the errors of all seeds, true metrics, an error that has fallen."""
    weights = load_weights(quick)
    assert network_of(weights, 'mlp').widths[0] == FEATURES
    card: dict[str, Any] = weights.card
    assert [path.name for path in quick.parent.iterdir()] == ['mlp-6-5.safetensors']
    assert card['architecture'] == [FEATURES, 6, 5, OUTPUTS] and card['sizes'] == []
    assert card['data']['mirror images'] > 0 < card['data']['contacts']
    losses = [network['loss'] for network in card['networks']]
    assert len(losses) == recipe.QUICK['networks'] == 2
    assert card['seed'] == 3 + int(np.argmin(losses))  # that of the network which is written
    assert card['metrics'].keys() == {*SETS, *LOADS, 'settled'}
    assert card['metrics'] == recipe.measured(quick, 3, recipe.QUICK['metric_pairs'])
    constant = recipe.measured(with_zeros(quick.with_name('zeros.safetensors')), 3, 2_000)
    for name, errors in card['metrics'].items():
        assert errors['volume']['mean'] < constant[name]['volume']['mean'], name


def with_zeros(path: Path) -> Path:
    """Return a weights file whose network says the same of all contacts: nothing."""
    save_weights(path, {'patch': [(np.zeros(shape), np.zeros(shape[0]))
                                  for shape in mlp_shapes((6, 5))]},
                 {**SHIPPED.card, 'architecture': [FEATURES, 6, 5, OUTPUTS]})
    return path


def test_a_minute_of_training_comes_near(tmp_path: Path) -> None:
    """To 1.5 times the shipped point error in 99 of 100 contacts at rest."""
    path = tmp_path / 'mlp.safetensors'
    planned = recipe.MlpRecipe(pairs=400_000, steps=6_000, networks=1, metric_pairs=20_000)
    recipe.train(path, planned, seed=11, commit='')
    pairs = settled.at_rest(np.random.default_rng(1), 20_000)
    truth = pairs.contacts()
    mine, shipped = (np.percentile(contact_errors(
        pairs.contacts(ContactSolver(model=make_model('mlp', weights=weights))), truth,
        pairs.edge).point, 99) for weights in (path, SHIPPED.path))
    assert mine <= 1.5 * shipped


def test_another_size_goes_beside_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Under its own name, and the compiled-in weights stay as they are."""
    trained: dict[str, tuple[int, int]] = {}

    def train_one(path: Path, _: recipe.MlpRecipe, *, hidden: tuple[int, int], **__: object,
                  ) -> dict[str, Any]:
        trained[path.name] = hidden
        assert path.parent == tmp_path
        return {**SHIPPED.card, 'training': {'minutes': 0.0}}

    monkeypatch.setattr(recipe, 'train', train_one)
    monkeypatch.setattr(train, 'OTHER_WEIGHTS', tmp_path)
    monkeypatch.setattr(train, 'SHIPPED_HEADER', tmp_path / 'unwritten.hpp')
    assert train.main(['mlp', '--hidden', '3', '5']) == 0
    assert trained == {'mlp-3-5.safetensors': (3, 5)}
    assert not list(tmp_path.iterdir())

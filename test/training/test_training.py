# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Backpropagation with momentum for many networks at once, and the program."""
from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import torch

from benchmarks.paper import dataset
from benchmarks.paper.errors import (
    errors_of,
    figures,
    predict,
    wrapped,
)
from benchmarks.paper.fit import Ensemble, PaperSettings, Scaling, fit, tensors
from benchmarks.paper.jobs import JOBS, SHIPPED, PaperJob
from box_contact_ros.models.weights_file import load_weights
from training import __main__ as train
from training import paper

pytestmark = pytest.mark.training
SMALL = PaperSettings((6, 9, 7, 4), networks=3, epochs=12, batch=50, rate=0.05)


@pytest.fixture(scope='module')
def sets() -> dict[str, dataset.Patterns]:
    return dataset.paper(5, counts=(600, 400, 500))


def run(sets: dict[str, dataset.Patterns], **changes: object):
    return fit(sets['training'], sets['cross-validation'], dataclasses.replace(SMALL, **changes))


def outputs_of(networks: Ensemble, patterns: dataset.Patterns, scaling: Scaling) -> torch.Tensor:
    x, _ = tensors(patterns, scaling)
    return networks(x)


def test_one_step_is_the_papers_formula(sets: dict[str, dataset.Patterns]) -> None:
    """Δw = −α ∂J/∂w + μ Δw of the step before: two epochs of one batch, by differences of J.

    J is half the mean over the patterns of the sum of the squared errors, wrapped.
    """
    def fitted(**changes: object):
        # All patterns in one batch. The rate falls along a cosine, to half in the second of two.
        return fit(sets['training'], sets['training'], dataclasses.replace(
            SMALL, **{'epochs': 1, 'batch': 600, 'networks': 1, 'rate': 1e-3, **changes}))

    rest = fitted(rate=0.0)
    layers = [(weight.astype(np.float64), bias) for weight, bias in rest.networks.layers(0)]
    x = (sets['training'].inputs - rest.scaling.mean) / rest.scaling.deviation

    def loss(change: float) -> float:
        value = x
        for number, (weight, bias) in enumerate(layers):
            moved = weight.copy()
            if number == 1:
                moved[2, 3] += change
            value = value @ moved.T + bias
            value = np.tanh(value) if number < 2 else value
        return 0.5 * (wrapped(value - sets['training'].outputs)**2).sum(axis=1).mean()

    def weight(**changes: object) -> float:
        return fitted(**changes).networks.layers(0)[1][0][2, 3]

    gradient = (loss(1e-4) - loss(-1e-4)) / 2e-4
    first = weight() - layers[1][0][2, 3]
    assert abs(first) > 1e-6
    assert first == pytest.approx(-1e-3 * gradient, rel=1e-2)
    with_momentum, without = (weight(epochs=2, momentum=momentum) for momentum in (0.9, 0.0))
    assert with_momentum - without == pytest.approx(0.9 * first, rel=1e-2)


def test_same_seed_same_weights(sets: dict[str, dataset.Patterns]) -> None:
    first, again, other = run(sets), run(sets), run(sets, seed=1)
    for (a, _), (b, _), (c, _) in zip(*(one.networks.layers(2) for one in (first, again, other))):
        np.testing.assert_array_equal(a, b)
        assert not np.array_equal(a, c)


def test_best_weights_by_cross_validation_are_kept(sets: dict[str, dataset.Patterns]) -> None:
    """Of the epoch with the least error, also where training goes on to diverge."""
    fitted = run(sets, rate=[0.05, 0.8, 1e3], epochs=60)
    history = torch.stack(fitted.history).numpy()
    np.testing.assert_array_equal(fitted.error, np.nanmin(history, axis=0))
    assert not history[-1, 2] <= fitted.error[2] or fitted.epoch[2] == 60
    np.testing.assert_allclose(fitted.errors(sets['cross-validation'])[:2], fitted.error[:2],
                               rtol=1e-5)


def test_normalisation_is_folded_into_the_first_layer(sets: dict[str, dataset.Patterns],
                                                      tmp_path: Path) -> None:
    """The exported network takes metres and radians and says what the trained one says."""
    fitted = run(sets)
    want = outputs_of(fitted.networks, sets['external'], fitted.scaling)[fitted.error.argmin()]
    value = sets['external'].inputs
    for number, (weight, bias) in enumerate(fitted.export()):
        value = value @ weight.T + bias
        value = np.tanh(value) if number < 2 else value
    np.testing.assert_allclose(value, want.detach(), atol=1e-5)


@pytest.fixture(scope='module')
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('weights')
    assert train.main([*JOBS, '--quick', '--seed', '3', '--out', str(folder)]) == 0
    return folder


def one_answer(job: PaperJob, network: str) -> bool:
    """Whether the inputs tell the outputs: not where boxes interpenetrate, hardly of a class."""
    return not job.kept and network != 'classifier'


@pytest.mark.parametrize('job', JOBS.values(), ids=lambda job: job.name)
def test_quick_training(quick: Path, job: PaperJob) -> None:
    """A file that loads, with a card whose metrics are true, better than the mean as an answer."""
    weights = load_weights(quick / f'{job.name}.safetensors')
    card = weights.card
    assert (card['seed'], card['model'], card['name']) == (3, job.model, job.name)
    assert card['sizes'] == [[2.0, 2.0, 2.0]] * 2
    for name, sets in dataset.of_card(card).items():
        external = sets['external']
        assert len(external) == train.QUICK_COUNTS[2]
        errors = errors_of(weights.networks[name], external.inputs, external.outputs,
                           job.settings.wrap)
        assert card['metrics'][name]['external']['all'] == pytest.approx(figures(errors))
        constant = external.outputs - external.outputs.mean(axis=0)
        assert figures(errors)['RMSE'] < (0.6 if one_answer(job, name) else 0.9) * figures(
            constant)['RMSE']
        assert np.all(np.isfinite(predict(weights.networks[name], external.inputs)))


@pytest.mark.parametrize(('job', 'folded'), [('paper', True), ('table-1-dropped', False)])
def test_one_job_is_folded_and_one_as_drawn(job: str, folded: bool, quick: Path) -> None:
    card = load_weights(quick / f'{JOBS[job].name}.safetensors').card
    assert card['data']['folded_in'] is folded
    network, = card['inputs']
    assert all((entry['min'] >= 0.0) is folded for entry in card['inputs'][network][:3])
    assert card['training'][network]['starts'] == train.QUICK_STARTS


def test_a_loss_that_is_not_wrapped_sees_the_turn(sets: dict[str, dataset.Patterns]) -> None:
    """Outputs moved by 2π: the wrapped loss learns the same, the other learns them as they are."""
    moved = {name: dataset.Patterns(one.inputs, one.outputs + 2 * np.pi)
             for name, one in sets.items()}
    wrap, plain = (run(moved, wrap=wrap) for wrap in (True, False))
    np.testing.assert_allclose(wrap.error, run(sets).error, rtol=1e-3)
    with torch.no_grad():
        near, far = (outputs_of(one.networks, moved['external'], one.scaling).mean().item()
                     for one in (wrap, plain))
    assert far - near == pytest.approx(2 * np.pi, abs=1.0)


def test_folded_weights_are_what_a_loader_accepts(sets: dict[str, dataset.Patterns],
                                                  monkeypatch: pytest.MonkeyPatch) -> None:
    """However fast it learns, and whatever the deviations and means of the inputs are."""
    monkeypatch.setattr('benchmarks.paper.fit.WEIGHT_LIMIT', 3.0)
    scales = np.array([1e-4, 1.0, 1.0, 1.0, 1e-4, 1.0])
    training, checking = (dataset.Patterns(patterns.inputs * scales + 5.0, patterns.outputs)
                          for patterns in (sets['training'], sets['cross-validation']))
    fitted = fit(training, checking, SMALL)
    weight, bias = fitted.export()[0]
    own_bias = fitted.networks.layers(int(fitted.error.argmin()))[0][1]
    assert np.abs(weight).max() == pytest.approx(0.5 * 3.0 / 6 / 5.0, rel=1e-2)
    assert np.abs(bias - own_bias).max() <= 1.5


@pytest.mark.parametrize('scene', ['random cubes', 'stacks'])
def test_quick_training_for_a_scene(scene: str, tmp_path: Path) -> None:
    """Weights that the solver takes by its size; the point's error has fallen.

    The tilts of stacks are 1e-4 rad, all other inputs about 1.
    """
    assert train.main(['paper', '--scene', scene, '--quick', '--out', str(tmp_path)]) == 0
    path, = tmp_path.iterdir()
    card = load_weights(path).card
    assert path.stem == 'paper'
    assert card['sizes'] == [[2.0, 2.0, 2.0]] * 2 and card['data']['scene'] == scene
    assert card['metrics']['p50'] < 40.0
    with pytest.raises(ValueError, match='boxes of several sizes'):
        paper.train(tmp_path, 'random sizes', seed=1, commit='', counts=(9, 9, 9))


def test_a_scene_of_cubes_leaves_the_shipped_network(tmp_path: Path,
                                                     monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(paper, 'SHIPPED', tmp_path)
    with pytest.raises(ValueError, match='scene .stacks. has cubes.*another folder by --out'):
        paper.train(tmp_path, 'stacks', seed=1, commit='', counts=(9, 9, 9),
                    networks=1, epochs=1)
    assert not list(tmp_path.iterdir())


def test_each_file_has_its_folder() -> None:
    """What the package ships is in weights/, what the tables alone need beside them."""
    assert {job.name for job in JOBS.values() if job.folder == SHIPPED} == {'paper'}
    assert {path.stem for path in SHIPPED.iterdir()} == {
        'mlp', 'paper', 'paper-12.192x2.438x2.591'}
    for job in JOBS.values():
        assert (job.folder / f'{job.name}.safetensors').exists()


@pytest.mark.parametrize(('arguments', 'message'), [
    (['mlp', '--hidden', '65', '8'], '--hidden: must lie in 1 to 64'),
    (['mlp', '--scene', 'containers'], '--scene is of paper alone'),
    (['paper', '--scene', 'yard'], "invalid choice: 'yard'"),
    (['papers'], "invalid choice: 'papers'"),
    (['paper', '--seed', '-1'], 'must be at least 0, got -1'),
])
def test_refused_arguments(arguments: list[str], message: str,
                           capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        train.main(arguments)
    assert ended.value.code == 2
    assert message in capsys.readouterr().err

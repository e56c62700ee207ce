"""Backpropagation with momentum for many networks at once, and the program `train`."""
from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip('torch')

from box_contact_ros.solver.weights_file import load_weights
from box_contact_ros.training import train
from box_contact_ros.training.paper_recipe import dataset
from box_contact_ros.training.paper_recipe.errors import errors_of, figures, predict
from box_contact_ros.training.paper_recipe.fit import Settings, fit, gradients, outputs_of, wrapped

SMALL = Settings((6, 9, 7, 4), networks=3, epochs=12, batch=50, rate=0.05)


@pytest.fixture(scope='module')
def sets() -> dict[str, dataset.Patterns]:
    return dataset.paper(5, counts=(600, 400, 500))


def run(sets: dict[str, dataset.Patterns], **changes: object):
    return fit(sets['training'], sets['cross-validation'], dataclasses.replace(SMALL, **changes))


def test_gradients_are_the_derivatives() -> None:
    """Against automatic differentiation, in float64, with errors that wrap."""
    generator = torch.Generator().manual_seed(0)
    widths, networks, patterns = (6, 5, 4, 4), 3, 11

    def draw(*shape: int) -> torch.Tensor:
        return torch.randn(shape, generator=generator, dtype=torch.float64)

    weights = [draw(networks, a, b).requires_grad_() for a, b in zip(widths, widths[1:])]
    biases = [draw(networks, 1, b).requires_grad_() for b in widths[1:]]
    x, y = draw(patterns, 6), 3.0 * draw(patterns, 4)
    value = x.expand(networks, -1, -1)
    for number, (weight, bias) in enumerate(zip(weights, biases)):
        value = value @ weight + bias
        value = value.tanh() if number < 2 else value
    difference = value - y
    assert (difference.abs() > np.pi).any()
    loss = 0.5 * wrapped(difference).square().sum(dim=2).mean(dim=1).sum()
    loss.backward()
    with torch.no_grad():
        activations = outputs_of(weights, biases, x)
        by_weight, by_bias = gradients(weights, activations, wrapped(activations[-1] - y))
    for found, parameter in zip(by_weight + by_bias, weights + biases):
        torch.testing.assert_close(found, parameter.grad)


def test_one_step_is_the_papers_formula(sets: dict[str, dataset.Patterns]) -> None:
    """Δw = −α ∂J/∂w + μ Δw of the step before: two epochs of one batch, by hand."""
    def fitted(**changes: object):
        # All patterns in one batch. The rate falls along a cosine, to half in the second of two.
        return fit(sets['training'], sets['training'], dataclasses.replace(
            SMALL, **{'epochs': 1, 'batch': 600, 'networks': 1, 'rate': 1e-3, **changes}))

    rest = fitted(rate=0.0)
    start = rest.weights[1][0].numpy()
    x = (sets['training'].inputs - rest.mean) / rest.deviation
    layers = outputs_of(rest.weights, rest.biases, torch.tensor(x, dtype=torch.float32))
    right = torch.tensor(sets['training'].outputs, dtype=torch.float32)
    gradient = gradients(rest.weights, layers, wrapped(layers[-1] - right))[0][1][0].numpy()
    first = fitted().weights[1][0].numpy() - start
    assert np.abs(first).max() > 1e-5
    np.testing.assert_allclose(first, -1e-3 * gradient, atol=1e-7)
    with_momentum = fitted(epochs=2, momentum=0.9).weights[1][0].numpy()
    without = fitted(epochs=2, momentum=0.0).weights[1][0].numpy()
    np.testing.assert_allclose(with_momentum - without, 0.9 * first, atol=1e-6)


def test_networks_of_a_batch_have_their_own_settings(sets: dict[str, dataset.Patterns]) -> None:
    """Learning rate, momentum and initial range per network; a network at rest stays at rest."""
    together = run(sets, rate=[0.0, 0.05, 0.05], momentum=[0.9, 0.0, 0.9], initial=[1.0, 1.0, 0.0])
    assert np.ptp(together.history[:, 0]) == 0.0
    assert np.ptp(together.history[:, 1]) > 0.01
    # Without any asymmetry to start from, hidden units cannot come apart: only biases learn.
    assert float(together.weights[0][2].abs().max()) == 0.0
    alone = run(sets, rate=0.05, momentum=[0.5, 0.0, 0.1])
    np.testing.assert_allclose(alone.history[:, 1], together.history[:, 1], rtol=1e-5)


def test_same_seed_same_weights(sets: dict[str, dataset.Patterns]) -> None:
    first, again, other = run(sets), run(sets), run(sets, seed=1)
    for a, b, c in zip(first.weights, again.weights, other.weights):
        assert torch.equal(a, b)
        assert not torch.equal(a, c)


def test_best_weights_by_cross_validation_are_kept(sets: dict[str, dataset.Patterns]) -> None:
    """Of the epoch with the least error, also where training goes on to diverge."""
    fitted = run(sets, rate=[0.05, 0.8, 1e3], epochs=60)
    assert np.all(fitted.error == np.nanmin(fitted.history, axis=0))
    assert not fitted.history[-1, 2] <= fitted.error[2] or fitted.epoch[2] == 60
    x = (sets['cross-validation'].inputs - fitted.mean) / fitted.deviation
    said = outputs_of(fitted.weights, fitted.biases, torch.tensor(x, dtype=torch.float32))[-1]
    right = torch.tensor(sets['cross-validation'].outputs, dtype=torch.float32)
    error = wrapped(said - right).square().mean(dim=(1, 2)).sqrt().numpy()
    np.testing.assert_allclose(error[:2], fitted.error[:2], rtol=1e-5)


def test_normalisation_is_folded_into_the_first_layer(sets: dict[str, dataset.Patterns],
                                                      tmp_path: Path) -> None:
    """The exported network takes metres and radians and says what the trained one says."""
    fitted = run(sets)
    best = int(np.argmin(fitted.error))
    x = (sets['external'].inputs - fitted.mean) / fitted.deviation
    want = outputs_of(fitted.weights, fitted.biases,
                      torch.tensor(x, dtype=torch.float32))[-1][best].numpy()
    value = sets['external'].inputs
    for number, (weight, bias) in enumerate(fitted.export()):
        value = value @ weight.T + bias
        value = np.tanh(value) if number < 2 else value
    np.testing.assert_allclose(value, want, atol=1e-5)


@pytest.fixture(scope='module')
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('weights')
    assert train.main(['all', '--quick', '--seed', '3', '--out', str(folder)]) == 0
    return folder


@pytest.mark.parametrize('job', train.JOBS.values(), ids=lambda job: job.name)
def test_quick_training(quick: Path, job: train.Job) -> None:
    """A file that loads, with a card whose metrics are true, better than the mean as an answer."""
    weights = load_weights(quick / f'{job.name}.safetensors')
    card = weights.card
    assert (card['seed'], card['model'], card['name']) == (3, job.model, job.name)
    assert card['sizes'] == [list(job.size)] * 2
    for name, sets in dataset.of_card(card).items():
        external = sets['external']
        assert len(external) == train.QUICK_COUNTS[2]
        errors = errors_of(weights.networks[name], external.inputs, external.outputs)
        assert card['metrics'][name]['external']['all'] == pytest.approx(figures(errors))
        constant = external.outputs - external.outputs.mean(axis=0)
        assert figures(errors)['RMSE'] < 0.6 * figures(constant)['RMSE']
        assert np.all(np.isfinite(predict(weights.networks[name], external.inputs)))


def test_train_again_is_the_same_file_but_for_the_clock(quick: Path, tmp_path: Path) -> None:
    assert train.main(['paper', '--quick', '--seed', '3', '--out', str(tmp_path)]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ['paper.safetensors']
    first, again = (load_weights(folder / 'paper.safetensors').card for folder in (quick, tmp_path))
    assert first['sha256'] == again['sha256']
    assert first['metrics'] == again['metrics']


def test_folded_on_request(tmp_path: Path) -> None:
    arguments = ['paper', '--quick', '--fold', '--epochs', '2', '--starts', '1']
    assert train.main([*arguments, '--out', str(tmp_path)]) == 0
    card = load_weights(tmp_path / 'paper.safetensors').card
    assert card['data']['folded_in'] is True
    assert all(entry['min'] >= 0.0 for entry in card['inputs']['contact'][:3])
    assert card['training']['contact']['starts'] == 1


def test_a_folder_that_cannot_be_written_is_said_at_once(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / 'file').write_text('')
    with pytest.raises(SystemExit):
        train.main(['--out', str(tmp_path / 'file' / 'weights')])
    assert 'cannot write to' in capsys.readouterr().err


@pytest.mark.parametrize(('arguments', 'message'), [
    (['--quick'], 'name a folder with --out'),
    *([] if torch.cuda.is_available() else [
        (['paper', '--out', '.', '--device', 'cuda'], '--device: cuda: PyTorch finds no GPU')]),
    (['papers'], "'papers' is not one of paper, paper-continuous, containers, mlp, all"),
    (['paper', '--starts', '0'], '--starts 0 is too small'),
    (['paper', '--seed', '-1'], "'-1' is no whole number from 0"),
])
def test_refused_arguments(arguments: list[str], message: str,
                           capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        train.main(arguments)
    assert ended.value.code == 2
    assert message in capsys.readouterr().err

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Training of the MLP for all boxes, and for a scene's; how a solver uses the latter."""
from __future__ import annotations

import dataclasses
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

torch = pytest.importorskip('torch')

from box_contact_ros import ContactSolver
from box_contact_ros.core import stages
from box_contact_ros.scene.pose import rotation_matrix
from box_contact_ros.scene.pose_sets import Pairs, containers, cubes, size_pairs, tilted
from box_contact_ros.solver.mlp import UNITS_MAX, core_numbers
from box_contact_ros.solver.weights_file import (
    Network,
    WeightsError,
    load_weights,
    save_weights,
)
from box_contact_ros.training import mlp_fit, mlp_recipe, samples, train
from box_contact_ros.training.ensemble import Ensemble, Scaling
from box_contact_ros.training.mlp_fit import SiteNetwork, fit, losses_of, random_batches, started
from box_contact_ros.training.samples import MlpSamples, scene_sizes

SCENE = """\
boxes:
  spreader: {size: [12.192, 2.438, 0.8], pose_topic: /crane/spreader/pose}
  load: {size: [12.192, 2.438, 2.591]}
  stack_1: {size: [12.192, 2.438, 2.591], pose: [0, 0, 0, 0, 0, 0, 1]}
  stack_2: {size: [2.438, 12.192, 2.591], pose: [0, 20, 0, 0, 0, 0, 1]}
pairs:
  - {id: 0, name: load_stack_1, a: load, b: stack_1}
  - {id: 1, name: load_stack_2, a: load, b: stack_2}
  - {id: 2, name: spreader_load, a: spreader, b: load}
  - {id: 3, name: stack_1_spreader, a: stack_1, b: spreader}
"""
CONTAINER, SPREADER = (12.192, 2.591, 2.438), (12.192, 2.438, 0.8)


def error_of(pairs: Pairs, weights: Path) -> float:
    return float(mlp_recipe.solver_errors(pairs, weights).point.mean())


@pytest.fixture(scope='module')
def data() -> MlpSamples:
    return samples.draw_samples(samples.mixture, [5], 6000)


@pytest.fixture(scope='module')
def scaling(data: MlpSamples) -> Scaling:
    return Scaling.of(data.features.swapaxes(1, 2))


def network_of(units: int, seed: int = 0, hidden: tuple[int, ...] = ()) -> SiteNetwork:
    return started(units, torch.Generator().manual_seed(seed), hidden=hidden)


def trained(network, data: MlpSamples, scaling: Scaling, steps: int, rate: float = 3e-3,
            size: int = 512) -> float:
    """Train, always on the same batches; return the last loss."""
    batches = random_batches(data, scaling, np.random.default_rng(1), size=size, count=steps)
    return [loss.sum().item() for loss in fit(network, batches, steps=steps, rate=rate)][-1]


# --- the fit --------------------------------------------------------------------------------------


def answers_of(network: SiteNetwork, scaling: Scaling, some: MlpSamples, k: int,
               ) -> tuple[np.ndarray, float, np.ndarray]:
    """Centroid (3,), volume and covariance (3, 3) of contact k, by loops in float64."""
    (first, bias), (last, last_bias) = scaling.folded(network.layers())
    centroid, stretch, pushed, log_volume = np.zeros(3), np.zeros(3), np.zeros(3), 0.0
    precision = np.zeros((3, 3))
    for f in range(3):
        coupling = np.zeros(3)
        for q in range(3):
            site, slant, cut = 3 * f + q, some.slant[f, q, k], some.cut[f, k]
            hidden = np.maximum(first @ some.features[site, :, k] + bias, 0.0)
            outputs = last @ hidden + last_bias
            centroid[q] += outputs[:3] @ some.vectors[site, :, k]
            log_volume += abs(slant) * cut * outputs[3]
            stretch[q] += abs(slant) * cut * outputs[4]
            coupling[q] = slant * outputs[5]
            pushed[q] += some.vectors[site, 0, k] * outputs[6]
        precision += cut * np.outer(coupling, coupling)
    precision += np.diag(3.0 * np.exp(np.clip(stretch, 0.0, 6.0))) + np.outer(pushed, pushed)
    return centroid, float(np.exp(min(log_volume, 0.0))), np.linalg.inv(precision)


def test_loss_is_the_formula(data: MlpSamples, scaling: Scaling) -> None:
    """All terms of `losses_of`, by loops in float64, for a network as it starts."""
    network = network_of(6)
    some = data.part(slice(0, 50))
    terms = np.zeros((50, 7))
    for k in range(50):
        centroid, volume, covariance = answers_of(network, scaling, some, k)
        error = centroid - some.offsets[:, k]
        squared = ((error * some.scale[:, k])**2).sum()
        of_volume = min(volume / some.volume[k] - 1.0, mlp_fit.LARGEST_VOLUME_ERROR)**2
        truth = np.zeros((3, 3))
        truth[samples.ROW, samples.COLUMN] = some.covariance[:, k]
        truth[samples.COLUMN, samples.ROW] = some.covariance[:, k]
        of_covariance = (((covariance - truth) * np.outer(some.spread[:, k], some.spread[:, k]))**2
                         ).sum()
        terms[k] = ((error**2).mean(), squared, squared**2, of_volume, of_volume**2,
                    of_covariance, of_covariance**2)
    volume, covariance = mlp_fit.VOLUME_WEIGHT, mlp_fit.COVARIANCE_WEIGHT
    tail = mlp_fit.PATCH_TAIL
    weights = (1.0, mlp_fit.POINT_WEIGHT, mlp_fit.TAIL_WEIGHT, volume, volume * tail, covariance,
               covariance * tail)
    batch = mlp_fit.tensors(some, scaling)
    found = losses_of(network(batch), batch).detach().numpy()
    np.testing.assert_allclose(found, terms @ weights, rtol=1e-3)


def test_the_network_is_the_cores() -> None:
    """What is trained beside core/src/mlp/, with hidden units on both sides of zero."""
    pairs = size_pairs(np.random.default_rng(6), 1000)
    module = network_of(8)
    network = Network(module.layers())
    core = stages(*pairs, names=('features', 'vectors', 'slant', 'cut', 'answer', 'answer_volume',
                                 'answer_covariance'), network=core_numbers(network))
    batch = SimpleNamespace(**{name: torch.tensor(getattr(core, name)).movedim(0, -1)
                               for name in ('features', 'vectors', 'slant', 'cut')})
    with torch.no_grad():
        active = (mlp_fit.at_sites(module.hidden, batch.features) > 0.0).float().mean()
        assert 0.2 < float(active) < 0.8
        found = module(batch)
    np.testing.assert_allclose(found.offsets.T, core.answer, atol=1e-6)
    np.testing.assert_allclose(found.log_volume.exp(), core.answer_volume, atol=1e-6)
    np.testing.assert_allclose(
        found.covariance.T, core.answer_covariance[:, samples.ROW, samples.COLUMN], atol=1e-6)


def test_samples_are_the_exact_overlap() -> None:
    """The covariance is seen from the bounds' frame: moved back, it is that of model `exact`."""
    pairs = size_pairs(np.random.default_rng(6), 500)
    data = samples.describe(pairs)
    found = stages(*pairs, names=('bounds_half', 'frame_b'))
    exact = pairs.contacts(ContactSolver((1, 1, 1), (1, 1, 1), model='exact'))
    assert 50 < found.frame_b.sum() < 450
    for k in range(500):
        half = found.bounds_half[k]
        covariance = np.zeros((3, 3))
        covariance[samples.ROW, samples.COLUMN] = data.covariance[:, k]
        covariance[samples.COLUMN, samples.ROW] = data.covariance[:, k]
        covariance *= np.outer(half, half)
        axes = rotation_matrix((pairs.pose_b if found.frame_b[k] else pairs.pose_a)[k, 3:])
        trace = np.trace(exact.covariance[k])
        np.testing.assert_allclose(axes @ covariance @ axes.T, exact.covariance[k],
                                   atol=1e-6 * trace)
        assert data.volume[k] * 8.0 * half.prod() == pytest.approx(exact.volume[k], rel=1e-6)
        np.testing.assert_allclose(data.spread[:, k], half / np.sqrt(trace), rtol=1e-6)


def test_adam_steps_fall_along_a_cosine(data: MlpSamples, scaling: Scaling) -> None:
    """The first step moves each weight by the rate; the last of many moves it hardly."""
    network = network_of(6)
    before = [p.detach().clone() for p in network.parameters()]
    batches = random_batches(data, scaling, np.random.default_rng(1), size=512, count=40)
    moved = []
    for _ in fit(network, batches, steps=40, rate=1e-3):
        moved.append(max(float((p - q).detach().abs().max())
                         for p, q in zip(network.parameters(), before)))
        before = [p.detach().clone() for p in network.parameters()]
    assert moved[0] == pytest.approx(1e-3, rel=1e-3)
    assert max(moved[-2:]) < 2e-5


def test_networks_of_an_ensemble_learn_as_if_alone(data: MlpSamples, scaling: Scaling) -> None:
    """Each with a learning rate of its own."""
    rates = (3e-3, 3e-2)
    ensemble = Ensemble([network_of(8, seed) for seed in range(2)], units=rates)
    trained(ensemble, data, scaling, 5, rate=1.0)
    for number, rate in enumerate(rates):
        alone = network_of(8, number)
        trained(alone, data, scaling, 5, rate)
        for one, other in zip(alone.layers(), ensemble.layers(number)):
            for a, b in zip(one, other):
                np.testing.assert_allclose(a, b, atol=0.1 * rate)  # of 5 steps
    both = mlp_fit.point_errors(ensemble, data, scaling)
    assert both.shape == (2, len(data))
    np.testing.assert_allclose(
        both[1], mlp_fit.point_errors(alone, data, scaling), atol=1e-4)


def test_units_that_are_not_drawn_stay_away(data: MlpSamples, scaling: Scaling) -> None:
    """A network of four units in a wider one is a network of four units."""
    wide, narrow = network_of(12, hidden=(4,)), network_of(4)
    narrow.load([(wide.layers()[0][0][:4].copy(), wide.layers()[0][1][:4].copy()),
                 (wide.layers()[1][0][:, :4].copy(), wide.layers()[1][1].copy())])
    assert trained(wide, data, scaling, 30) == pytest.approx(trained(narrow, data, scaling, 30),
                                                             rel=1e-3)
    (first, bias), (last, _) = wide.layers()
    assert not first[4:].any() and not bias[4:].any() and not last[:, 4:].any()
    assert first[:4].all() and last[:, :4].all()


def test_normalisation_is_folded_in_and_out(data: MlpSamples, scaling: Scaling) -> None:
    """`folded` serves raw inputs, and `unfolded` undoes it."""
    layers = network_of(8).layers()
    weight, bias = scaling.folded(layers)[0]
    features = data.features.swapaxes(1, 2)
    normalised = (features - scaling.mean) / scaling.deviation
    np.testing.assert_allclose(features @ weight.T + bias,
                               normalised @ layers[0][0].T + layers[0][1], atol=1e-3)
    for one, other in zip(layers, scaling.unfolded(scaling.folded(layers))):
        for a, b in zip(one, other):
            np.testing.assert_allclose(a, b, rtol=1e-5, atol=1e-5)


def test_hard_rounds_bring_what_the_network_errs_in(data: MlpSamples, scaling: Scaling) -> None:
    """Four rounds, each after its part of the steps; a fifth of the samples are hard ones."""
    network = network_of(4)
    asked = []

    def make(rng: np.random.Generator, n: int) -> Pairs:
        asked.append(taken)
        return samples.mixture(rng, n)

    recipe = mlp_recipe.MlpRecipe(pairs=6000, steps=40, batch=8, rate=1e-3, pool=3000)
    taken = 0
    for taken, batch in enumerate(mlp_recipe.harder_batches(  # noqa: B007 (the closure reads it)
            network, data, scaling, recipe, make, 0), start=1):
        assert len(batch) == 8
    assert taken == 40
    assert asked == [16, 22, 28, 34]
    errors, hard = (mlp_fit.point_errors(network, some, scaling)
                    for some in (data, mlp_recipe.hardest(network, data, scaling)))
    assert len(hard) == round(0.01 * len(data))
    np.testing.assert_allclose(np.sort(hard), np.sort(errors)[-len(hard):], rtol=1e-5)


def test_errors_while_training_are_the_solvers(data: MlpSamples, scaling: Scaling,
                                               tmp_path: Path) -> None:
    """`point_errors` beside the written file behind `ContactSolver`."""
    network = network_of(8)
    trained(network, data, scaling, 200, size=1024)
    path = tmp_path / 'mlp.safetensors'
    recipe = mlp_recipe.MlpRecipe(pairs=6000, steps=200, rate=3e-3, pool=0)
    card = mlp_recipe.model_card(path, network, recipe, {})
    save_weights(path, {'point': scaling.folded(network.layers())},
                 {**card, 'seed': 0, 'commit': 'none', 'sizes': []})
    pairs = size_pairs(np.random.default_rng(3), 500)
    said = mlp_fit.point_errors(network, samples.describe(pairs), scaling)
    solved = 0.01 * mlp_recipe.solver_errors(pairs, path).point
    # The solver also moves answers into the other box, which seldom harms.
    assert np.mean(np.abs(said - solved) < 1e-4) > 0.3
    assert np.mean(solved <= said + 1e-4) > 0.95
    assert solved.mean() <= said.mean() * (1.0 + 1e-5)  # float32


@pytest.mark.parametrize('count', [1, 63, 65, 129])
def test_description_does_not_depend_on_the_block(count: int) -> None:
    """Also where a block has one pair: some were described as nothing, one in two million NaN."""
    pairs = tilted(np.random.default_rng(1), 200)
    whole = samples.describe(pairs)
    part = samples.describe(Pairs(*(column[:count] for column in pairs)))
    for field in dataclasses.fields(MlpSamples):
        np.testing.assert_array_equal(getattr(part, field.name),
                                      getattr(whole, field.name)[..., :count])


# --- the program ----------------------------------------------------------------------------------


@pytest.fixture(scope='module')
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('quick')
    assert train.main(['mlp', '--quick', '--seed', '3', '--out', str(folder)]) == 0
    return folder / 'mlp.safetensors'


def test_quick_training(quick: Path, tmp_path: Path) -> None:
    """Its error is a fraction of the middle's, which a network of zeros answers with."""
    card = load_weights(quick).card
    assert (card['seed'], card['model'], card['sizes']) == (3, 'mlp', [])
    assert card['architecture'] == [12, mlp_recipe.HIDDEN, 7]
    pairs = cubes(np.random.default_rng(8), 2000)
    nothing = tmp_path / 'nothing.safetensors'
    save_weights(nothing, {'point': [(np.zeros((b, a)), np.zeros(b)) for a, b in (
        (12, 4), (4, 7))]}, {**card, 'architecture': [12, 4, 7]})
    assert error_of(pairs, quick) < 0.5 * error_of(pairs, nothing)
    for name, quantities in card['metrics'].items():
        assert set(quantities) == {'point', 'volume', 'covariance'}
        for figures in quantities.values():
            assert 0.0 <= figures['mean'] <= figures['p99'] <= figures['worst'] < 80.0, name


def test_same_seed_same_weights(quick: Path, tmp_path: Path) -> None:
    for seed in ('3', '4'):
        assert train.main(['mlp', '--quick', '--seed', seed, '--out', str(tmp_path)]) == 0
        card = load_weights(tmp_path / 'mlp.safetensors').card
        first = load_weights(quick).card
        assert (card['sha256'] == first['sha256']) == (seed == '3')
        assert (card['metrics'] == first['metrics']) == (seed == '3')


def test_hidden_units_on_request(tmp_path: Path) -> None:
    arguments = ['mlp', '--quick', '--hidden', '12', '--steps', '100', '--out',
                 str(tmp_path)]
    assert train.main(arguments) == 0
    weights = load_weights(tmp_path / 'mlp-12.safetensors')
    assert weights.card['training']['steps'] == 100
    assert weights.networks['point'].widths == (12, 12, 7)


@pytest.mark.parametrize(('arguments', 'message'), [
    (['mlp', '--hidden', str(UNITS_MAX + 1)], f'--hidden: must lie in 1 to {UNITS_MAX}'),
    (['mlp', '--scene', 'x.yaml'], "leave out 'mlp'"),
    (['--scene', 'x.yaml', '--hidden', '8'], 'leave out --hidden'),
    (['--scene', 'x.yaml', '--steps', '8'], 'leave out --steps'),
    (['--scene', 'no_such.yaml'], "'no_such.yaml' cannot be read: No such file"),
])
def test_refused_arguments(arguments: list[str], message: str, tmp_path: Path,
                           capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        train.main([*arguments, '--quick', '--out', str(tmp_path)])
    assert ended.value.code == 2
    assert message in capsys.readouterr().err


# --- the shipped weights --------------------------------------------------------------------------


@pytest.mark.parametrize(('make', 'mean', 'p99', 'worst'), [
    (cubes, 0.3, 2.5, 8.0), (size_pairs, 0.3, 2.5, 10.0), (tilted, 0.8, 3.0, 8.0),
    (containers, 0.6, 3.5, 8.0)])
def test_shipped_weights_keep_their_limits(make, mean: float, p99: float, worst: float) -> None:
    """In % of the smaller box's longest edge, on poses of another seed than the card's."""
    errors = mlp_recipe.solver_errors(make(np.random.default_rng(77), 10_000), None).point
    assert errors.mean() < mean
    assert np.quantile(errors, 0.99) < p99
    assert errors.max() < worst


# --- scenes ---------------------------------------------------------------------------------------


def write(folder: Path, text: str) -> Path:
    path = folder / 'yard.yaml'
    path.write_text(text, 'utf-8')
    return path


def test_the_example_in_the_docs(tmp_path: Path) -> None:
    """docs/tutorials: three pairs of sizes, all within the range."""
    folder = Path(__file__).parents[2] / 'docs' / 'tutorials'
    page = (folder / 'train_for_your_boxes.md').read_text('utf-8')
    text = re.search(r'^```yaml\n(.*?)^```$', page, re.MULTILINE | re.DOTALL).group(1)
    sizes = scene_sizes(write(tmp_path, text))
    assert len(sizes) == 3 and all(map(mlp_recipe.in_range, sizes))


def test_distinct_pairs_of_sizes(tmp_path: Path) -> None:
    """Swapped boxes and other names for the axes are the same; boxes in no pair do not count."""
    path = write(tmp_path, SCENE + '# end\n')
    assert scene_sizes(path) == [(CONTAINER, CONTAINER), (CONTAINER, SPREADER)]


@pytest.mark.parametrize(('before', 'after', 'message'), [
    ('boxes:', 'box:', "'box' was unexpected"),
    ('[12.192, 2.438, 0.8]', '[12.192, 0.0, 0.8]', 'boxes.spreader.size[1]: 0.0 is not positive'),
    ('[12.192, 2.438, 0.8]', '[12.192, 2.438]', 'boxes.spreader.size: must be 3 numbers'),
    ('[12.192, 2.438, 0.8]', '[12.192, 2.438, high]',
     "boxes.spreader.size[2]: 'high' is not a number"),
    ('{size: [12.192, 2.438, 2.591]}', '{}', 'boxes.load: needs one of: size; type; stack'),
    (', b: stack_1', '', 'pairs[0]: needs one of: a and b; moving and fixed'),
    ('pairs:\n', 'pairs: []\nmore:\n', "'more' was unexpected"),
    ('pairs:\n', 'pairs: {}\nmore:\n', "'more' was unexpected"),
    ('a: spreader', 'a: spreder', "pairs[2].a: 'spreder' is none of the boxes"),
    ('boxes:', 'boxes: [', 'not YAML'),
])
def test_bad_scenes_are_refused_with_file_and_field(
        tmp_path: Path, capsys: pytest.CaptureFixture[str], before: str, after: str, message: str,
        ) -> None:
    assert before in SCENE
    path = write(tmp_path, SCENE.replace(before, after, 1))
    with pytest.raises(SystemExit):
        train.main(['--scene', str(path), '--quick', '--out', str(tmp_path)])
    error = capsys.readouterr().err
    assert f'{path}' in error and message in error


def test_pairs_out_of_range_are_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str],
                                         ) -> None:
    """A plate of 1:40 is always answered exactly; with nothing else there is nothing to train."""
    path = write(tmp_path, 'boxes: {plate: {size: [4, 4, 0.1]}, cube: {size: [1, 1, 1]}}\n'
                 'pairs: [{id: 0, name: p, a: plate, b: cube}]\n')
    with pytest.raises(SystemExit):
        train.main(['--scene', str(path), '--quick', '--out', str(tmp_path)])
    printed = capsys.readouterr()
    assert 'answers them exactly: 1 × 1 × 1 on 4 × 4 × 0.1' in printed.out.replace(
        '4 × 4 × 0.1 on 1 × 1 × 1', '1 × 1 × 1 on 4 × 4 × 0.1')
    assert 'no pair of sizes is within the range' in printed.err


@pytest.fixture(scope='module')
def expert(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('scene')
    path = write(folder, SCENE)
    assert train.main(['--scene', str(path), '--quick', '--out', str(folder)]) == 0
    return folder / 'mlp-yard.safetensors'


def test_scene_says_what_it_saves_and_how_to_use_it(
        tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch,
        ) -> None:
    """Written to the current folder; a row per pair of sizes."""
    path = write(tmp_path, SCENE)
    monkeypatch.chdir(tmp_path)
    assert train.main(['--scene', str(path), '--quick']) == 0
    printed = capsys.readouterr().out
    assert f'-p weights:={tmp_path}/mlp-yard.safetensors' in printed
    for pair in ('12.192 × 2.591 × 2.438 on 12.192 × 2.591 × 2.438',
                 '12.192 × 2.591 × 2.438 on 12.192 × 2.438 × 0.8'):
        row = next(line for line in printed.splitlines() if line.strip().startswith(pair))
        assert 'general' in row and ': saved ' in row and row.count('%') == 3


def test_scene_card(expert: Path) -> None:
    card = load_weights(expert).card
    assert card['sizes'] == [[list(CONTAINER)] * 2, [list(CONTAINER), list(SPREADER)]]
    assert card['architecture'] == load_weights(mlp_recipe.resource_path(
        'weights', 'mlp.safetensors')).card['architecture']


def poses(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Containers in contact."""
    pairs = containers(np.random.default_rng(0), n)
    return pairs.pose_a, pairs.pose_b


def solver(weights: Path | None, size_a=CONTAINER, size_b=CONTAINER) -> ContactSolver:
    return ContactSolver(size_a, size_b, model='mlp', weights=weights and str(weights))


ALL_THE_SAME = [(CONTAINER, CONTAINER), ((2.438, 12.192, 2.591), CONTAINER),
                (SPREADER, CONTAINER), (CONTAINER, SPREADER),
                (CONTAINER, tuple(np.float32(SPREADER).tolist()))]


@pytest.mark.parametrize(('size_a', 'size_b'), ALL_THE_SAME)
def test_sizes_of_the_scene_are_for_the_network(expert: Path, size_a, size_b) -> None:
    """In either order, whatever the axes are called, and through float32."""
    some = solver(expert, size_a, size_b)
    found = some.batch(*poses(200))
    assert found.colliding.any()
    some(*(pose[0] for pose in poses(1)))
    exact_ones = some.exact_answers
    general = solver(None, size_a, size_b)
    general.batch(*poses(200))
    general(*(pose[0] for pose in poses(1)))
    assert exact_ones == general.exact_answers  # those that are too deep


@pytest.mark.parametrize(('size_a', 'size_b'), [
    (SPREADER, SPREADER), ((12.192, 2.438, 2.6), CONTAINER), ((6.058, 2.438, 2.591), CONTAINER)])
def test_other_sizes_are_answered_exactly_and_counted(expert: Path, size_a, size_b) -> None:
    """Two spreaders too: each is in the scene, but they never meet."""
    some, exact = solver(expert, size_a, size_b), ContactSolver(size_a, size_b, model='exact')
    a, b = poses(200)
    found, right = some.batch(a, b), exact.batch(a, b)
    touching = int(right.colliding.sum())
    assert touching > 10
    np.testing.assert_array_equal(found.point, right.point)
    assert some.exact_answers == touching
    row = int(np.flatnonzero(right.colliding)[0])
    np.testing.assert_allclose(some(a[row], b[row]).point, right.point[row], atol=1e-12)
    assert some.exact_answers == touching + 1


def test_rows_of_all_kinds_in_one_batch(expert: Path) -> None:
    """Every row as if alone: by the network, exactly, or refused."""
    a, b = poses(300)
    a = np.concatenate([a, a])
    b = np.concatenate([b, b])
    listed = np.arange(len(a)) % 3 != 0
    size_b = np.where(listed[:, None], CONTAINER, (12.192, 2.438, 2.7))
    size_a = np.tile(CONTAINER, (len(a), 1))
    some = solver(expert)
    found = some.batch(a, b, size_a=size_a, size_b=size_b)
    by_network = solver(expert).batch(a, b)
    exact = ContactSolver(CONTAINER, (12.192, 2.438, 2.7), model='exact').batch(a, b)
    for whole, one, other in zip(found, by_network, exact):
        np.testing.assert_array_equal(whole[listed], one[listed])
        np.testing.assert_array_equal(whole[~listed], other[~listed])
    assert some.exact_answers >= exact.colliding[~listed].sum() > 0
    size_b[4] = (1.0, -1.0, 1.0)
    with pytest.raises(ValueError, match=r'size_b\[4\]|size_b .*not positive'):
        some.batch(a, b, size_a=size_a, size_b=size_b)


def test_sizes_changed_in_place_are_looked_up_again(expert: Path) -> None:
    """A caller's array is not remembered by its identity."""
    a, b = poses(1)
    some, size = solver(expert), np.array([CONTAINER])
    some.batch(a, b, size_a=size, size_b=size)
    assert some.exact_answers == 0
    size[0, 2] = 2.7
    assert some.batch(a, b, size_a=size, size_b=size).colliding[0]
    assert some.exact_answers == 1


@pytest.mark.parametrize('sizes', [[1.0], [[[1, 1, 1]]], [[[1, 1, 1], [1, 1]]], 'all',
                                   [[[1, 1, 1], [1, 0, 1]]]])
def test_a_card_with_bad_sizes_is_refused(expert: Path, tmp_path: Path, sizes) -> None:
    weights = load_weights(expert)
    path = tmp_path / 'bad.safetensors'
    save_weights(path, {'point': weights.networks['point'].layers},
                 {**weights.card, 'sizes': sizes})
    with pytest.raises(WeightsError, match='no pairs of three extents'):
        solver(path)

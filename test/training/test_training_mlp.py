"""Training of the MLP for all boxes, and for a scene's; how a solver uses the latter."""
from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip('torch')

from box_contact_ros import ContactSolver
from box_contact_ros.core import stages
from box_contact_ros.scene.pose_sets import Pairs, containers, cubes, size_pairs, tilted
from box_contact_ros.solver.mlp import UNITS_MAX, core_numbers
from box_contact_ros.solver.weights_file import (
    Network,
    WeightsError,
    load_weights,
    save_weights,
    unpacked,
)
from box_contact_ros.training import mlp_fit, mlp_recipe, samples, scene_sizes, train
from box_contact_ros.training.samples import MlpSamples

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
    return float(mlp_recipe.point_errors(pairs, weights).mean())


@pytest.fixture(scope='module')
def data() -> MlpSamples:
    return samples.draw_samples(samples.mixture, [5], 6000)


# --- the fit --------------------------------------------------------------------------------------


def test_gradients_are_the_derivatives(data: MlpSamples) -> None:
    """One step of Adam's first moment is a tenth of the gradient: against autograd of the loss.

    To the rounding of float32.
    """
    fit = mlp_fit.Fit(data, mlp_fit.Settings(hidden=[(6, 5)], steps=10, batch=len(data)))
    before = [p.clone().requires_grad_() for p in fit.parameters]
    value = fit.inputs.clone()
    for layer in range(3):
        value = value @ before[layer][0] + before[3 + layer][0, 0]
        value = torch.nn.functional.relu(value) if layer < 2 else value
    answer = torch.stack([(value[:, q::3] * fit.vectors[:, q::3]).sum(dim=(1, 2))
                          for q in range(3)], dim=1)  # sites are 3 f + q
    error = answer - fit.offsets
    squared = (error.square() * fit.squared_scale).sum(dim=-1)
    loss = (error.square().mean() + mlp_fit.POINT_WEIGHT * squared.mean()
            + mlp_fit.TAIL_WEIGHT * squared.square().mean())
    loss.backward()
    assert fit.run(1)[0] == pytest.approx(loss.item(), rel=1e-4)
    for moment, parameter in zip(fit._first, before):
        largest = float(parameter.grad.abs().max())
        torch.testing.assert_close(10.0 * moment, parameter.grad, rtol=1e-3, atol=1e-3 * largest)


def test_the_network_is_the_cores() -> None:
    """What is trained beside core/mlp.hpp, with hidden units on both sides of zero."""
    pairs = size_pairs(np.random.default_rng(6), 1000)
    widths = (12, 8, 3)
    layers = mlp_fit.drawn(np.random.default_rng(1), widths)
    network = Network('point', widths, np.concatenate([part.ravel() for layer in layers
                                                       for part in layer]))
    core = stages(*pairs, names=('features', 'vectors', 'answer'), network=core_numbers(network))
    (first, bias), (last, last_bias) = (map(torch.tensor, layer) for layer in layers)
    sums = torch.tensor(core.features).reshape(-1, 12) @ first.T + bias
    assert 0.2 < float((sums > 0.0).float().mean()) < 0.8
    outputs = (mlp_fit.relu(sums) @ last.T + last_bias)[None]
    found = mlp_fit.Fit.answers(outputs, torch.tensor(core.vectors))[0].numpy()
    np.testing.assert_allclose(found, core.answer, atol=1e-6)


def test_a_narrow_network_beside_a_wide_one_is_the_narrow_one(data: MlpSamples) -> None:
    """Units that only fill up the matrices stay at zero: trained alone, the network is the same."""
    start = [mlp_fit.drawn(np.random.default_rng(k), (12, *hidden, 3))
             for k, hidden in enumerate([(8, 4), (12, 16)])]
    common = {'steps': 30, 'batch': 512, 'rate': 3e-3}
    alone = mlp_fit.Fit(data, mlp_fit.Settings(hidden=[(8, 4)], **common), start=start[:1])
    both = mlp_fit.Fit(data, mlp_fit.Settings(hidden=[(8, 4), (12, 16)], **common), start=start)
    alone.run(30)
    both.run(30)
    assert both.parameters[1].shape[1:] == (12, 16)
    assert float(both.parameters[1][0, 8:].abs().max()) == 0.0
    assert float(both.parameters[1][0, :, 4:].abs().max()) == 0.0
    for one, other in zip(alone.networks()[0], both.networks()[0]):
        for a, b in zip(one, other):
            np.testing.assert_allclose(a, b, atol=2e-5)
    np.testing.assert_allclose(alone.point_errors(data)[0], both.point_errors(data)[0], atol=1e-5)


def test_normalisation_is_folded_in_and_out(data: MlpSamples) -> None:
    """`folded` serves raw inputs, and `unfolded` undoes it."""
    mean, deviation = mlp_fit.normalisation(data.features)
    layers = mlp_fit.drawn(np.random.default_rng(0), (12, 8, 8, 3))
    weight, bias = mlp_fit.folded(layers, mean, deviation)[0]
    np.testing.assert_allclose(data.features @ weight.T + bias,
                               (data.features - mean) / deviation @ layers[0][0].T + layers[0][1],
                               atol=1e-3)
    again = mlp_fit.unfolded(mlp_fit.folded(layers, mean, deviation), mean, deviation)
    for one, other in zip(layers, again):
        for a, b in zip(one, other):
            np.testing.assert_allclose(a, b, rtol=1e-5, atol=1e-5)


def test_errors_while_training_are_the_solvers(data: MlpSamples, tmp_path: Path) -> None:
    """`Fit.point_errors` beside the written file behind `ContactSolver`."""
    fit = mlp_fit.Fit(data, mlp_fit.Settings(hidden=[(8,)], steps=200, batch=1024))
    fit.run(200)
    path = tmp_path / 'mlp.safetensors'
    card = mlp_recipe._card(path, (8,), 0, 'none', [], fit, {})
    save_weights(path, {'point': fit.export(0)}, card)
    pairs = size_pairs(np.random.default_rng(3), 500)
    trained = fit.point_errors(samples.describe(pairs))[0]
    solved = mlp_recipe.point_errors(pairs, path)
    # The solver also moves answers into the other box, which seldom harms.
    assert np.mean(np.abs(trained - solved) < 1e-4) > 0.3
    assert np.mean(solved <= trained + 1e-4) > 0.95
    assert solved.mean() <= trained.mean() * (1.0 + 1e-5)  # float32


@pytest.mark.parametrize('count', [1, 63, 65, 129])
def test_description_does_not_depend_on_the_block(count: int) -> None:
    """Also where a block has one pair: some were described as nothing, one in two million NaN."""
    pairs = tilted(np.random.default_rng(1), 200)
    whole = samples.describe(pairs)
    part = samples.describe(Pairs(*(column[:count] for column in pairs)))
    for field in dataclasses.fields(MlpSamples):
        np.testing.assert_array_equal(getattr(part, field.name),
                                      getattr(whole, field.name)[:count])


def test_hard_contacts_are_those_with_the_largest_errors(data: MlpSamples) -> None:
    fit = mlp_fit.Fit(data, mlp_fit.Settings(hidden=[(8,)], steps=1, batch=1024))
    hard = mlp_recipe._hardest(fit, data, 0.02)
    errors = fit.point_errors(data)[0]
    assert len(hard) == round(0.02 * len(data))
    assert fit.point_errors(hard)[0].min() >= np.sort(errors)[-len(hard)] - 1e-6
    fit.feed(MlpSamples.joined([data, hard]))
    assert len(fit.inputs) == len(data) + len(hard)
    np.testing.assert_allclose(fit.point_errors(data)[0], errors, atol=1e-6)


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
    assert card['architecture'] == [12, *mlp_recipe.HIDDEN, 3]
    pairs = cubes(np.random.default_rng(8), 2000)
    nothing = tmp_path / 'nothing.safetensors'
    save_weights(nothing, {'point': [(np.zeros((b, a)), np.zeros(b)) for a, b in (
        (12, 4), (4, 3))]}, {**card, 'architecture': [12, 4, 3]})
    assert error_of(pairs, quick) < 0.5 * error_of(pairs, nothing)
    for name, figures in card['metrics'].items():
        assert 0.0 <= figures['mean'] <= figures['p99'] <= figures['worst'] < 60.0, name


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
    assert weights.networks['point'].widths == (12, 12, 3)


@pytest.mark.parametrize(('arguments', 'message'), [
    (['mlp', '--hidden', str(UNITS_MAX + 1)], f'--hidden {UNITS_MAX + 1} is not between 1'),
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
    errors = 100.0 * mlp_recipe.point_errors(make(np.random.default_rng(77), 10_000), None)
    assert errors.mean() < mean
    assert np.quantile(errors, 0.99) < p99
    assert errors.max() < worst


# --- scenes ---------------------------------------------------------------------------------------


def write(folder: Path, text: str) -> Path:
    path = folder / 'yard.yaml'
    path.write_text(text, 'utf-8')
    return path


def test_the_example_in_the_docs(tmp_path: Path) -> None:
    """docs/training.md: three pairs of sizes, all within the range."""
    page = (Path(__file__).parents[2] / 'docs' / 'training.md').read_text('utf-8')
    text = re.search(r'^```yaml\n(.*?)^```$', page, re.MULTILINE | re.DOTALL).group(1)
    sizes = scene_sizes.size_pairs(write(tmp_path, text))
    assert len(sizes) == 3 and all(map(mlp_recipe.in_range, sizes))


def test_distinct_pairs_of_sizes(tmp_path: Path) -> None:
    """Swapped boxes and other names for the axes are the same; boxes in no pair do not count."""
    path = write(tmp_path, SCENE + '# end\n')
    assert scene_sizes.size_pairs(path) == [(CONTAINER, CONTAINER), (CONTAINER, SPREADER)]


@pytest.mark.parametrize(('before', 'after', 'message'), [
    ('boxes:', 'box:', "'box' was unexpected"),
    ('[12.192, 2.438, 0.8]', '[12.192, 0.0, 0.8]', 'boxes.spreader.size[1]: 0.0 is not positive'),
    ('[12.192, 2.438, 0.8]', '[12.192, 2.438]', 'boxes.spreader.size: must be 3 numbers'),
    ('[12.192, 2.438, 0.8]', '[12.192, 2.438, high]',
     "boxes.spreader.size[2]: 'high' is not a number"),
    ('{size: [12.192, 2.438, 2.591]}', '{}', "boxes.load: 'size' is a required property"),
    (', b: stack_1', '', "pairs[0]: 'b' is a required property"),
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
    save_weights(path, {'point': unpacked(weights.networks['point'])},
                 {**weights.card, 'sizes': sizes})
    with pytest.raises(WeightsError, match='no pairs of three extents'):
        solver(path)

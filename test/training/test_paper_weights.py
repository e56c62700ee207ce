# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The paper's networks as shipped: what their cards say, and the tables made from them."""
from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from test_weights_file import layers, tensors, write

from benchmarks.errors import point_errors
from benchmarks.paper import __main__ as program
from benchmarks.paper import dataset
from benchmarks.paper.errors import (
    errors_of,
    figures,
    predict,
    wrapped,
)
from benchmarks.paper.models import weights_path
from benchmarks.pose_sets import SETS
from box_contact_ros import ContactSolver, make_model
from box_contact_ros.models.weights_file import load_weights


@pytest.fixture
def good(tmp_path: Path) -> Path:
    return write(tmp_path / 'good.safetensors', tensors())


def test_forward_is_the_formula(good: Path) -> None:
    """Against float64 NumPy, to the accuracy of float32."""
    network = load_weights(good).networks['n']
    inputs = np.random.default_rng(1).normal(size=(200, 6))
    value = inputs
    for number, (weight, bias) in enumerate(layers()):
        value = value @ weight.T.astype(np.float64) + bias
        if number < 2:
            value = np.tanh(value)
    np.testing.assert_allclose(predict(network, inputs), value, rtol=0, atol=1e-5)
    many = predict(network, inputs)
    for row in (0, 7, 199):  # alone, to the bit
        assert np.array_equal(predict(network, inputs[row:row + 1])[0], many[row])


def test_errors_are_wrapped() -> None:
    """−π and π are one direction; the sign of a small error stays."""
    errors = wrapped(np.array([0.0, 2 * np.pi, -2 * np.pi, np.pi, -np.pi, 3.0 - -3.0, -0.1, 0.1]))
    np.testing.assert_allclose(
        errors, [0, 0, 0, -np.pi, -np.pi, 6.0 - 2 * np.pi, -0.1, 0.1], atol=1e-15)
    assert figures(np.array([[3.0, -4.0], [0.0, 0.0]])) == {'ME': -0.25, 'MAE': 1.75, 'RMSE': 2.5}


# --- what is shipped ------------------------------------------------------------------------------


@pytest.mark.parametrize('name', [
    'paper', pytest.param('table-2-by-signs', marks=pytest.mark.training)])
def test_shipped_weights_are_what_their_card_says(name: str) -> None:
    """All sets made again from the seed give the card's figures; inputs lie in its ranges."""
    weights = load_weights(weights_path(name))
    assert weights.card['name'] == name
    made = dataset.of_card(weights.card)
    assert set(made) == set(weights.networks) == set(weights.card['metrics'])
    for network, sets in made.items():
        assert set(sets) == set(dataset.SETS)
        for set_name, patterns in sets.items():
            errors = errors_of(weights.networks[network], patterns.inputs, patterns.outputs,
                               weights.card['data'].get('wrap', True))
            want = weights.card['metrics'][network][set_name]
            assert figures(errors) == pytest.approx(want['all'], abs=1e-6)
            for k, entry in enumerate(weights.card['inputs'][network]):
                assert entry['min'] - 1e-9 <= patterns.inputs[:, k].min()
                assert patterns.inputs[:, k].max() <= entry['max'] + 1e-9


def test_the_errors_on_the_card_of_paper_meet_their_bounds() -> None:
    """External validation, on the paper's number of patterns; the test above makes them anew."""
    card = load_weights(weights_path('paper')).card
    assert list(card['data']['counts'].values()) == [8000, 5000, 75000]
    jumps = card['metrics']['contact']['external']['all']
    assert jumps['MAE'] <= 0.30 and jumps['RMSE'] <= 0.56


def test_the_scene_of_containers_is_what_its_card_says() -> None:
    """The point's errors on swaying containers, drawn anew [% of the longest edge]."""
    path = weights_path('paper-12.192x2.438x2.591')
    card = load_weights(path).card
    assert (card['data']['scene'], card['data']['counts']['training']) == ('containers', 8000)
    assert card['architecture']['contact'][:3] == [6, 20, 18]
    pairs = SETS['containers'](np.random.default_rng(11), 20_000)
    size = pairs.size_a[0]
    found = pairs.contacts(ContactSolver(size, size, model=make_model('paper', weights=path)))
    errors = point_errors(found.point, pairs.contacts().point, pairs.edge)
    measured = dict(zip(('p50', 'p99'), np.percentile(errors, (50, 99))))
    assert measured['p50'] < 6.0 and measured['p99'] < 30.0
    for name, value in measured.items():
        assert value == pytest.approx(card['metrics'][name], rel=0.1)


# --- the tables -----------------------------------------------------------------------------------


def cells(page: str) -> list[str]:
    """All cells of the page's tables."""
    return [cell.strip(' *') for line in page.splitlines() if line.startswith('|')
            for cell in line.split('|')]


@pytest.mark.training
def test_tables_in_the_docs_are_the_shipped_weights(tmp_path: Path) -> None:
    """The first tables of docs/results/paper_tables.md, 1 and 2, are the shipped weights'.

    Figures may differ by their rounding. (The other tables hold times: see test_paper_tables.)
    """
    docs = Path(__file__).parents[2] / 'docs' / 'results' / 'paper_tables.md'
    assert program.main(['--table', '1', '--table', '2', '--out', str(tmp_path)]) == 0
    old, new = cells(docs.read_text()), cells((tmp_path / 'paper_tables.md').read_text())
    assert len(old) > len(new) > 100
    for before, after in zip(old, new):
        for one, other in zip(before.split(' ± '), after.split(' ± '), strict=True):
            try:
                last = 10.0**-len(one.partition('.')[2])
                assert abs(float(one) - float(other)) < 1.5 * last
            except ValueError:
                assert one == other

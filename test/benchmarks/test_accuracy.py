# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report `accuracy`: contact classes by the definition, rows and their limits."""
from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import poses
import pytest

from benchmarks import accuracy, searched
from benchmarks.accuracy import CLASSES, AccuracyRow, Summary
from benchmarks.contestant import Solved, ours
from benchmarks.errors import ContactErrors, contact_errors
from benchmarks.pose_sets import CUBE, LOADS, SETS, Pairs


def on_a_cube(turn: np.ndarray, depth: float = 1e-3) -> Pairs:
    """Return a cube, turned, that comes down on the middle of another's top face."""
    corners = poses.rotate(turn[None], np.array(list(np.ndindex(2, 2, 2))) - 0.5)
    height = 0.5 * CUBE[2] - CUBE[2] * corners[:, 2].min() - depth
    b = np.concatenate([[0.1, 0.2, height], turn])
    size = np.array([CUBE])
    return Pairs(np.array([[0.0, 0, 0, 0, 0, 0, 1]]), b[None], size, size)


def turned(axis: tuple[float, float, float], angle: float) -> np.ndarray:
    unit = np.array(axis) / np.linalg.norm(axis)
    return np.append(np.sin(0.5 * angle) * unit, np.cos(0.5 * angle))


@pytest.mark.parametrize(('turn', 'expected'), [
    (turned((1, 1, 0), 0.7), 'vertex-face'), (turned((1, 0, 0), 0.5), 'edge-face'),
    (turned((0, 0, 1), 0.4), 'face-face'), (turned((1, 0, 0), 1e-5), 'face-face')])
def test_features_that_meet_a_face(turn: np.ndarray, expected: str) -> None:
    """Swapped, too: the reference face is then one of B's."""
    pairs = on_a_cube(turn)
    swapped = Pairs(pairs.pose_b, pairs.pose_a, pairs.size_b, pairs.size_a)
    for one in (pairs, swapped):
        classes, winners = accuracy.classify(one)
        assert CLASSES[classes[0]] == expected
        assert winners[0] == 0


def test_crossing_edges() -> None:
    """Two cubes, each on an edge, at right angles to each other."""
    lower, upper = turned((1, 0, 0), np.pi / 4), turned((0, 1, 0), np.pi / 4)
    size = np.array([CUBE])
    height = 2.0 * np.sqrt(0.5) * CUBE[2] - 1e-3
    pairs = Pairs(np.concatenate([[0, 0, 0], lower])[None],
                  np.concatenate([[0.1, 0.2, height], upper])[None], size, size)
    classes, winners = accuracy.classify(pairs)
    assert CLASSES[classes[0]] == 'edge-edge' and winners[0] == 1


# --- rows and limits ------------------------------------------------------------------------------


def row_of(**changes: object) -> AccuracyRow:
    """Return a row of model `mlp` on containers without an error, but for what is changed."""
    none = {name: {'all': Summary(200, *[0.0] * 4)} for name in ContactErrors._fields}
    return AccuracyRow(**{'model': 'mlp', 'set': 'containers', 'errors': none, 'pairs': 200,
                          'fallback_share': 0.0, 'outside': 0.0, **changes})


@pytest.mark.parametrize(('name', 'value'), [
    ('fallback_share', 0.021), ('outside', 1e-12), ('outside', np.nan)])
def test_a_broken_limit_is_named(name: str, value: float) -> None:
    assert row_of().broken() == []
    text, = row_of(**{name: value}).broken()
    assert text.startswith('mlp, containers: ')
    assert row_of(**{name: value, 'model': 'paper'}).broken() == []


@pytest.mark.parametrize('quantity', ContactErrors._fields)
@pytest.mark.parametrize('name', ['containers', 'landings', 'touching', 'random sizes'])
def test_limits_of_errors_break(quantity: str, name: str) -> None:
    """At the 99th percentile, and of a NaN; loads have narrower ones than boxes in any pose."""
    limit = accuracy.limit_of(quantity, name)
    assert limit == getattr(accuracy.ANY_POSE_LIMIT if name in accuracy.ANY_POSE
                            else accuracy.LOAD_LIMIT, quantity)
    for p99, holds in ((0.999 * limit, True), (1.001 * limit, False), (np.nan, False)):
        errors = {**row_of().errors, quantity: {'all': Summary(200, 0.0, 0.0, p99, p99)}}
        broken = row_of(set=name, errors=errors).broken()
        assert (broken == []) is holds and all(quantity in text for text in broken)


def test_in_plane_eigenvalues_are_those_across_the_normal() -> None:
    """A covariance that grows along the normal has no error in the plane; in the plane it has."""
    pairs = SETS['containers'](np.random.default_rng(5), 50)
    truth = pairs.contacts()
    n = truth.normal
    along = np.einsum('ni,nj->nij', n, n)
    across = (np.eye(3) - along) @ truth.covariance @ (np.eye(3) - along)
    trace = np.trace(truth.covariance, axis1=1, axis2=2)[:, None, None]
    for change, expected in ((0.1 * trace * along, 0.0), (0.1 * across, 10.0)):
        found = truth._replace(covariance=truth.covariance + change)
        errors = contact_errors(found, truth, pairs.edge)
        np.testing.assert_allclose(errors.in_plane, expected, atol=1e-6)
        assert (errors.covariance > 0.1).all() and not errors.point.any()


@pytest.fixture(scope='module')
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip('tqdm')
    pytest.importorskip('matplotlib')
    folder = tmp_path_factory.mktemp('accuracy')
    assert accuracy.main(['--quick', '--out', str(folder)]) == 0
    return folder


def test_quick_run(quick: Path) -> None:
    assert 'All limits of `mlp` hold.' in (quick / 'accuracy.md').read_text('utf-8')
    assert (quick / 'accuracy.png').stat().st_size > 10_000
    with (quick / 'accuracy.csv').open() as file:
        rows = [row for row in csv.DictReader(file) if row['part'] == 'all']
    assert [(row['set'], row['quantity']) for row in rows] == [
        (name, quantity) for name in SETS | LOADS for quantity in ContactErrors._fields]
    for row in rows:
        assert float(row['p99']) <= float(row['limit_p99'])
        if row['quantity'] == 'point':
            assert float(row['outside']) <= accuracy.OUTSIDE
            assert float(row['fallback_share']) <= (0.12 if row['set'] == 'crossed bars' else 0.02)


def test_searched_for_the_worst(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On one set with every network; a planted miss is named."""
    pytest.importorskip('tqdm')
    for name, value in (('SETS', {'containers': SETS['containers']}), ('LOADS', {}),
                        ('DRAWN', 3_000), ('PATHS', 5)):
        monkeypatch.setattr(searched, name, value)
    assert searched.main(['--minutes', '0.02', '--out', str(tmp_path)]) == 0
    with (tmp_path / 'searched.csv').open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 2 * 3 * 3  # seeds, networks, quantities
    shipped, garbage = ({row['quantity']: float(row['worst']) for row in rows
                         if row['network'] == network} for network in ('shipped', 'least within'))
    assert 0.0 < shipped['volume'] <= garbage['volume'] <= 3.0 * searched.LIMITS['volume']
    monkeypatch.setitem(searched.LIMITS, 'volume', 1e-6)
    assert searched.main(['--minutes', '0.01', '--out', str(tmp_path)]) == 1
    assert 'Goals missed: mlp, containers' in (tmp_path / 'searched.md').read_text('utf-8')


def test_points_and_depths_of_a_known_contestant_have_known_errors() -> None:
    """Points 1 cm off a cube of 2 m: 0.5 % of its edge, in every class."""
    exact = ours('exact')

    def shifted(pairs: Pairs) -> Solved:
        contacts = exact.solve(pairs).contacts
        return Solved(contacts._replace(point=contacts.point + [0.0, 0.01, 0.0]), 7)

    pairs = SETS['random cubes'](np.random.default_rng(1), 100)
    row = accuracy.measure(replace(exact, name='mlp', solve=shifted), 'random cubes', pairs,
                           pairs.contacts())
    for errors in row.errors['point'].values():
        assert errors[1:] == pytest.approx((0.5,) * 4, rel=1e-9)
    assert row.errors['point']['all'].pairs == len(pairs.size)
    assert row.errors['volume']['all'].worst == row.errors['covariance']['all'].worst == 0.0
    assert row.fallback_share == pytest.approx(7 / len(pairs.size))
    assert [text.split()[3] for text in row.broken()] == ['point,', 'points', 'left']
    assert 'point, p99 0.5 > 0.15' in row.broken()[0]


# --- a model of your own --------------------------------------------------------------------------


def test_a_class_is_measured_like_a_model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The example's middle of the centres is no centroid; its depth is the exact one."""
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / 'docs' / 'examples')
    status = accuracy.main(['--model', 'own_model:Between', '--pairs', '200', '--quick',
                            '--out', str(tmp_path)])
    with (tmp_path / 'accuracy.csv').open() as file:
        rows = [row for row in csv.DictReader(file) if row['part'] == 'all']
    assert status == 0 and {row['set'] for row in rows} == set(SETS | LOADS)
    assert {row['quantity'] for row in rows} == {'point'}
    assert float({row['set']: row for row in rows}['tilted stacks']['mean']) > 1.0


@pytest.mark.parametrize('name', ['nowhere:Class', 'json:Nothing'])
def test_a_class_that_cannot_be_imported(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match='2'):
        accuracy.main(['--model', name])
    assert name in capsys.readouterr().err

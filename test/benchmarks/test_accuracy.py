# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report `accuracy`: contact classes by the definition, rows and their errors."""
from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import poses
import pytest

from benchmarks import accuracy, searched
from benchmarks.accuracy import CLASSES
from benchmarks.contestant import ours
from benchmarks.errors import ContactErrors, contact_errors
from benchmarks.pose_sets import CUBE, SETS, THROUGH, Pairs
from box_contact_ros import Contacts, ContactSolver

pytestmark = pytest.mark.reports


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
        assert CLASSES[accuracy.classify(one)[0]] == expected


def test_crossing_edges() -> None:
    """Two cubes, each on an edge, at right angles to each other."""
    lower, upper = turned((1, 0, 0), np.pi / 4), turned((0, 1, 0), np.pi / 4)
    size = np.array([CUBE])
    height = 2.0 * np.sqrt(0.5) * CUBE[2] - 1e-3
    pairs = Pairs(np.concatenate([[0, 0, 0], lower])[None],
                  np.concatenate([[0.1, 0.2, height], upper])[None], size, size)
    assert CLASSES[accuracy.classify(pairs)[0]] == 'edge-edge'


# --- rows -----------------------------------------------------------------------------------------


@pytest.fixture(scope='module')
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip('tqdm')
    pytest.importorskip('matplotlib')
    folder = tmp_path_factory.mktemp('accuracy')
    assert accuracy.main(['--quick', '--out', str(folder)]) == 0
    return folder


P99 = {'point': 4.0, 'volume': 12.0, 'covariance': 18.0}
"""Largest 99th percentile of `mlp` [%]."""
P99_DEEP = {**P99, 'volume': 15.0}


def test_quick_run(quick: Path) -> None:
    assert (quick / 'accuracy.png').stat().st_size > 10_000
    with (quick / 'accuracy.csv').open() as file:
        rows = [row for row in csv.DictReader(file) if row['part'] == 'all']
    assert [(row['set'], row['quantity']) for row in rows] == [
        (name, quantity) for name in accuracy.MEASURED for quantity in ContactErrors._fields]
    for row in rows:
        limits = P99_DEEP if row['set'] == 'deep' else P99
        if row['set'] not in THROUGH:  # it has not learnt these
            assert float(row['p99']) <= limits[row['quantity']], row['set']


def test_searched_for_the_worst(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The page says for how long. The worst of a search is no less than that of the draw."""
    pytest.importorskip('tqdm')
    for name, value in (('SETS', {'containers': SETS['containers']}), ('LOADS', {}),
                        ('DRAWN', 3_000), ('PATHS', 5)):
        monkeypatch.setattr(searched, name, value)
    assert searched.main(['--minutes', '0.02', '--seed', '3', '--out', str(tmp_path)]) == 0
    with (tmp_path / 'searched.csv').open() as file:
        rows = list(csv.DictReader(file))
    worst = {row['quantity']: float(row['worst']) for row in rows if row['set'] == 'containers'}
    assert [row['worst'] for row in rows if row['set'] == searched.MIRROR] == [''] * 3
    pairs = SETS['containers'](np.random.default_rng([3, 0]), 3_000)
    found = pairs.contacts(ContactSolver(model='mlp'))
    errors = contact_errors(found, pairs.contacts(), pairs.edge)
    for quantity, value in worst.items():
        assert value >= 0.999 * getattr(errors, quantity).max()
        assert value <= {'point': 20.0, 'volume': 150.0, 'covariance': 175.0}[quantity]
    page = (tmp_path / 'searched.md').read_text('utf-8')
    assert '0.02 minutes on one core: 1 s on each set' in page


def test_points_and_depths_of_a_known_contestant_have_known_errors() -> None:
    """Points 1 cm off a cube of 2 m: 0.5 % of its edge, in every class."""
    exact = ours('exact')

    def shifted(pairs: Pairs) -> Contacts:
        contacts = exact.solve(pairs)
        return replace(contacts, point=contacts.point + [0.0, 0.01, 0.0])

    pairs = SETS['random cubes'](np.random.default_rng(1), 100)
    row = accuracy.measure(replace(exact, name='mlp', solve=shifted), 'random cubes', pairs,
                           pairs.contacts())
    for errors in row.errors['point'].values():
        assert errors[1:] == pytest.approx((0.5,) * 4, rel=1e-9)
    assert row.errors['point']['all'].pairs == len(pairs.size)
    assert row.errors['volume']['all'].worst == row.errors['covariance']['all'].worst == 0.0


# --- a model of your own --------------------------------------------------------------------------


def test_a_class_is_measured_like_a_model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The example's middle of the centres is no centroid; its depth is the exact one."""
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / 'docs' / 'examples')
    status = accuracy.main(['--model', 'own_model:Between', '--pairs', '200', '--quick',
                            '--out', str(tmp_path)])
    with (tmp_path / 'accuracy.csv').open() as file:
        rows = [row for row in csv.DictReader(file) if row['part'] == 'all']
    assert status == 0 and {row['set'] for row in rows} == set(accuracy.MEASURED)
    assert {row['quantity'] for row in rows} == {'point'}
    assert float({row['set']: row for row in rows}['tilted stacks']['mean']) > 1.0


@pytest.mark.parametrize('name', ['nowhere:Class', 'json:Nothing'])
def test_a_class_that_cannot_be_imported(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match='2'):
        accuracy.main(['--model', name])
    assert name in capsys.readouterr().err

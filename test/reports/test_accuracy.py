# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report `accuracy`: contact classes by the definition, and points that had to be moved in."""
from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import poses
import pytest

from box_contact_ros.reports import accuracy
from box_contact_ros.reports.accuracy import CLASSES
from box_contact_ros.resources import resource_path
from box_contact_ros.scene.pose_sets import CUBE, SETS, Pairs
from box_contact_ros.solver.weights_file import load_weights, save_weights

SHIPPED = resource_path('weights', 'mlp.safetensors')


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


@pytest.mark.parametrize('name', SETS)
def test_points_that_were_moved_in(name: str, tmp_path: Path) -> None:
    """None of the shipped network's; many of a network whose weights are drawn at random."""
    pairs = SETS[name](np.random.default_rng(4), 2000)
    assert accuracy.share_corrected(pairs, SHIPPED) < 0.001
    weights = load_weights(SHIPPED)
    rng = np.random.default_rng(1)
    drawn = [(rng.normal(0.0, 30.0, weight.shape), rng.normal(0.0, 30.0, bias.shape))
             for weight, bias in weights.networks['point'].layers]
    save_weights(tmp_path / 'drawn.safetensors', {'point': drawn}, weights.card)
    assert accuracy.share_corrected(pairs, tmp_path / 'drawn.safetensors') > 0.05


def test_quick_run(tmp_path: Path) -> None:
    assert accuracy.main(['--quick', '--out', str(tmp_path)]) == 0
    assert 'All limits hold.' in (tmp_path / 'accuracy.md').read_text('utf-8')
    assert (tmp_path / 'accuracy.png').stat().st_size > 10_000
    head, *rows = (tmp_path / 'accuracy.csv').read_text('utf-8').splitlines()
    assert head.startswith('model,set,part') and {row.split(',')[1] for row in rows} == set(SETS)


# --- a model of your own, and the sets as files ---------------------------------------------------


def test_a_class_is_measured_like_a_model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The example's middle of the bounding boxes is no centroid; its depth is the exact one."""
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / 'docs' / 'examples')
    monkeypatch.setattr(accuracy, 'MODELS', accuracy.MODELS.copy())
    monkeypatch.setattr('box_contact_ros.solver.models.MODELS', accuracy.MODELS)
    status = accuracy.main(['--model', 'own_model:Middle', '--pairs', '200', '--quick',
                            '--out', str(tmp_path)])
    with (tmp_path / 'accuracy.csv').open() as file:
        rows = [row for row in csv.DictReader(file) if row['part'] == 'all']
    assert status == 0 and {row['set'] for row in rows} == set(SETS)
    assert {row['quantity'] for row in rows} == {'point'}
    assert float({row['set']: row for row in rows}['tilted stacks']['mean']) > 1.0
    assert all(float(row['separation_difference']) == 0.0 for row in rows)


@pytest.mark.parametrize('name', ['nowhere:Class', 'json:Nothing'])
def test_a_class_that_cannot_be_imported(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match='2'):
        accuracy.main(['--model', name])
    assert name in capsys.readouterr().err


def test_exported_sets_are_those_of_the_report(tmp_path: Path) -> None:
    """Poses, sizes and the exact contacts of every set, ready for another program."""
    assert accuracy.main(['--export', str(tmp_path), '--pairs', '30']) == 0
    files = {path.stem.replace('_', ' '): np.load(path) for path in tmp_path.iterdir()}
    assert files.keys() == SETS.keys()
    for file in files.values():
        pairs = Pairs(*(file[field] for field in Pairs._fields))
        for field, values in pairs.contacts()._asdict().items():
            np.testing.assert_array_equal(file[field], values)

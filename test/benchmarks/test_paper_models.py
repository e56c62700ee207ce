# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Model `paper-committee`: its errors, and what weights its experts."""
from __future__ import annotations

from pathlib import Path

import numpy as np
import poses
import pytest

from benchmarks.paper.models import Committee, committee, weights_path
from benchmarks.paper.numpy_model import NumpyPaper
from benchmarks.weights import save_weights
from box_contact_ros import ContactSolver
from box_contact_ros.models.weights_file import WeightsError, load_weights
from box_contact_ros.resources import resource_path

pytestmark = pytest.mark.reports

EXACT = ContactSolver(poses.CUBE, poses.CUBE, model='exact')


def solver_of(model: NumpyPaper) -> ContactSolver:
    return ContactSolver(poses.CUBE, poses.CUBE, model=model)


def test_error_on_touching_boxes() -> None:
    """Mean errors against `exact`: 0.49 m and 6.4° are reached; rows are as single calls."""
    solver = solver_of(committee())
    a, b = poses.at_depth(poses.CUBE, depth=1e-9)
    truth, found = EXACT.batch(a, b), solver.batch(a, b)
    cosine = np.clip(np.sum(found.normal * truth.normal, axis=1), -1, 1)
    assert np.linalg.norm(found.point - truth.point, axis=1).mean() < 0.55
    assert np.degrees(np.arccos(cosine)).mean() < 10.0
    assert np.array_equal(found.separation, truth.separation)
    for row in range(0, len(a), 50):
        one = solver(a[row], b[row])
        assert np.array_equal(one.point, found.point[row])
        assert np.array_equal(one.normal, found.normal[row])


def test_a_committee_is_the_weighted_mean_of_its_experts(tmp_path: Path) -> None:
    """Experts that point along ±x, y and z on top, and a classifier of constants.

    The mean's direction leaves the box; a negative weight counts as none; where all are negative,
    the likeliest expert answers alone.
    """
    card = load_weights(weights_path('paper-committee')).card
    a, b = poses.IDENTITY, np.array([0.2, 0.1, 1.99, 0.01, 0.02, 0.3, 1.0])

    def constant(*outputs: float) -> list[tuple[np.ndarray, np.ndarray]]:
        widths = (6, 20, 18, len(outputs))
        layers = [(np.zeros((n, m)), np.zeros(n)) for m, n in zip(widths, widths[1:])]
        return [*layers[:-1], (layers[-1][0], np.array(outputs))]

    def answer(*weights: float) -> np.ndarray:
        path = tmp_path / 'committee.safetensors'
        up = np.pi / 2
        save_weights(path, {'classifier': constant(*weights), 'vertex': constant(0, 0, 0, 0),
                            'edge': constant(up, 0, up, 0), 'face': constant(0, up, 0, up)}, card)
        return solver_of(Committee(load_weights(path)))(a, b).normal

    assert answer(0.6, 0.0, 0.8) == pytest.approx([0.6, 0.0, 0.8], abs=1e-6)
    assert answer(-5.0, 0.3, 0.4) == pytest.approx([0.0, 0.6, 0.8], abs=1e-6)
    assert answer(-5.0, -3.0, -4.0) == pytest.approx([0.0, 1.0, 0.0], abs=1e-6)


def test_it_is_for_cubes_and_needs_its_networks() -> None:
    with pytest.raises(ValueError, match='is for two cubes of one size, not for 1 × 2 × 3 m'):
        ContactSolver((1, 2, 3), (1, 2, 3), model=committee())
    with pytest.raises(WeightsError, match="has no network 'classifier'"):
        Committee(load_weights(resource_path('weights', 'paper.safetensors')))

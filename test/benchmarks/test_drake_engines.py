# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Drake's hydroelastic surface: its centroid, and its centre of pressure."""
from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip('pydrake')

from benchmarks import trials  # noqa: E402
from benchmarks.engines import drake_engines  # noqa: E402
from benchmarks.pose_sets import SETS  # noqa: E402

pytestmark = pytest.mark.reports


def planted(corners: np.ndarray, pressures: list[float]) -> SimpleNamespace:
    """Return a surface of one face with these corners (n, 3) and pressures."""
    face = SimpleNamespace(num_vertices=lambda: len(corners), vertex=lambda i: i)
    mesh = SimpleNamespace(num_elements=lambda: 1, element=lambda _: face,
                           vertex=lambda i: corners[i])
    return SimpleNamespace(
        poly_mesh_W=lambda: mesh, centroid=lambda: corners.mean(axis=0),
        poly_e_MN=lambda: SimpleNamespace(EvaluateAtVertex=lambda i: pressures[i]))


@pytest.mark.parametrize('pressures, along', [
    ([1, 1, 1, 1], 2.0), ([0, 2, 2, 0], 8.0 / 3.0), ([0, 0, 0, 0], 2.0)])
def test_the_centre_of_pressure(pressures: list[float], along: float) -> None:
    """A plate of 4 by 2 m: even pressure, pressure that grows along x, and none at all."""
    corners = np.array([[0.0, 0, 1], [4, 0, 1], [4, 2, 1], [0, 2, 1]])
    found = drake_engines.centre_of_pressure(planted(corners, pressures))
    np.testing.assert_allclose(found, [along, 1, 1], atol=1e-12)


@pytest.mark.parametrize('name', ['containers', 'stacks'])
def test_the_centre_of_pressure_is_nearer_than_the_centroid(name: str) -> None:
    pairs = SETS[name](np.random.default_rng(4), 150)
    answers = trials.ask(drake_engines.surface(), pairs, trials.FULL)
    pairs = pairs.rows(slice(len(answers.colliding)))
    centroid, pressure = (
        trials.judge(pairs, answers.colliding, answers.normals, answers.points[choice])
        for choice in ('its point', 'centre of pressure'))
    assert 0.05 < centroid.points['all'].p50 < 2.0  # [%]
    assert pressure.points['all'].p50 < 0.05 and pressure.points['all'].worst < 0.5
    assert centroid.missed == centroid.invented == 0

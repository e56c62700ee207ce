# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Model `fcl`: FCL's conventions, and what stays SAT's."""
from __future__ import annotations

import subprocess
import sys

import numpy as np
import poses
import pytest

pytest.importorskip('fcl')

from box_contact_ros import ContactSolver

CUBES = ContactSolver(poses.CUBE, poses.CUBE, model='fcl')
IDENTITY = poses.IDENTITY


@pytest.mark.parametrize('axis', range(3))
@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_the_normal_points_from_a_to_b(axis, sign):
    """B 1.9 m beside A along an axis: the normal is that axis, with its sign, and the depth 0.1."""
    b = IDENTITY.copy()
    b[axis] = sign * 1.9
    for first, second, way in ((IDENTITY, b, 1.0), (b, IDENTITY, -1.0)):
        contact = CUBES(first, second)
        assert contact.normal == pytest.approx(way * sign * np.eye(3)[axis])
        assert contact.separation == pytest.approx(-0.1)


def test_the_point_is_the_deepest_corner():
    """B, 0.1 m deep in A's top, is tipped by 0.01 rad about y.

    Of the patch's corners those at +x are deepest, whereas the exact point is well inside.
    """
    size = poses.CONTAINER
    b = np.array([0.0, 0.0, size[2] - 0.1, 0.0, np.sin(0.005), 0.0, np.cos(0.005)])
    deepest = ContactSolver(size, size, model='fcl')(IDENTITY, b)
    exact = ContactSolver(size, size, model='exact')(IDENTITY, b)
    assert deepest.point[0] == pytest.approx(size[0] / 2, abs=0.05)
    assert abs(deepest.point[1]) == pytest.approx(size[1] / 2, abs=0.01)
    assert abs(exact.point[0]) < 2.0
    assert deepest.separation == pytest.approx(exact.separation, rel=1e-6)


def test_verdicts_and_refusals_are_sats():
    """Apart: SAT's gap, NaN point; exact touch counts; bad poses are refused with their words."""
    apart = CUBES(IDENTITY, [0, 0, 2.5, 0, 0, 0, 1])
    assert apart.colliding is False and apart.separation == 0.5
    assert np.isnan(apart.point).all() and np.isnan(apart.normal).all()
    touch = CUBES(IDENTITY, [0, 0, 2.0, 0, 0, 0, 1])
    assert touch.colliding and np.isfinite([*touch.point, *touch.normal]).all()
    with pytest.raises(ValueError, match='pose_b'):
        CUBES(IDENTITY, [0, 0, np.nan, 0, 0, 0, 1])


def test_without_python_fcl_only_this_model_is_missing():
    """The core imports without it; the model raises ModuleNotFoundError, which programs explain."""
    code = ('import sys; sys.modules["fcl"] = None\n'
            'from box_contact_ros import ContactSolver\n'
            'ContactSolver((1, 1, 1), (1, 1, 1))\n'
            'try: ContactSolver((1, 1, 1), (1, 1, 1), model="fcl")\n'
            'except ModuleNotFoundError as error: print(error.name)')
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == 'fcl'

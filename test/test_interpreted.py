"""Kernels as plain Python (NUMBA_DISABLE_JIT=1) answer like the compiled ones.

They are the same lines, run by two machines. `make coverage` counts lines with the slow one.
"""
from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import poses
import pytest

from box_contact_ros import ContactSolver
from box_contact_ros.posesets import unit_quaternions
from box_contact_ros.stability import families

EVERY = 12
"""Of the stored hard poses; a pose takes milliseconds."""


def answers(model: str) -> np.ndarray:
    """(n, 8) verdict, separation, normal, point: hard poses, moderate ones, and single calls."""
    cases = [family.pairs for family in families.load().values()]
    columns = [np.concatenate([part[number % EVERY::EVERY] for number, part in enumerate(parts)])
               for parts in zip(*((case.size_a, case.size_b, case.pose_a, case.pose_b)
                                  for case in cases))]
    rng = np.random.default_rng(7)
    place = rng.uniform(-1, 1, (150, 3)) * (1.9, 1.9, 1.9)
    b = np.concatenate([place, unit_quaternions(rng, 150)], axis=1)
    a = np.tile(poses.IDENTITY, (150, 1))
    solver = ContactSolver(poses.CUBE, poses.CUBE, model=model)
    rows = []
    for found in (solver.batch(columns[2], columns[3], size_a=columns[0], size_b=columns[1]),
                  solver.batch(a, b)):
        rows.append(np.column_stack([found.colliding, found.separation, found.normal,
                                     found.point]))
    rows.append(np.array([[c.colliding, c.separation, *c.normal, *c.point]
                          for c in (solver(one, other) for one, other in zip(a, b))]))
    return np.concatenate(rows)


@pytest.mark.parametrize('model', ['exact', 'mlp'])
def test_plain_python_gives_the_same(model: str, tmp_path: Path) -> None:
    """Verdicts to the bit, the rest up to rounding.

    Rounding differs where the compiler joins a multiplication and an addition, or a network's sums
    are taken in another order.
    """
    compiled = answers(model)
    file = tmp_path / 'answers.npy'
    code = (f'import numpy, test_interpreted; '
            f'numpy.save({str(file)!r}, test_interpreted.answers({model!r}))')
    done = subprocess.run(
        [sys.executable, '-W', 'ignore::RuntimeWarning', '-c', code], cwd=Path(__file__).parent,
        env=os.environ | {'NUMBA_DISABLE_JIT': '1'}, timeout=240, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    assert done.returncode == 0, done.stdout
    plain = np.load(file)
    assert np.array_equal(plain[:, 0], compiled[:, 0])
    assert 100 < plain[:, 0].sum() < len(plain) - 100
    np.testing.assert_allclose(plain[:, 1:5], compiled[:, 1:5], rtol=1e-9, atol=1e-12)
    size = np.nanmax(np.abs(compiled[:, 5:]), axis=1, keepdims=True, initial=1.0)
    np.testing.assert_allclose(plain[:, 5:] / size, compiled[:, 5:] / size, atol=1e-5)

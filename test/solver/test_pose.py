# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rotation matrices agree with quaternions."""
from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from poses import multiply

from box_contact_ros.solver.pose import rotation_matrix

quaternions = st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(
    lambda q: np.hypot(*q[:2]) > 0.1).map(np.array)


@settings(max_examples=200)
@given(quaternions, quaternions)
def test_products(p, q):
    """A product of quaternions is the product of their rotation matrices, of any length."""
    matrix = rotation_matrix(q)
    assert np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(matrix) == pytest.approx(1.0)
    assert np.allclose(rotation_matrix(multiply(p[None], q[None])[0]), rotation_matrix(p) @ matrix,
                       atol=1e-14)


def test_a_quarter_about_z_turns_x_to_y():
    assert rotation_matrix([0, 0, 1, 1]) @ (1, 0, 0) == pytest.approx([0, 1, 0])
    assert np.array_equal(rotation_matrix([0, 0, -1, -1]), rotation_matrix([0, 0, 1, 1]))

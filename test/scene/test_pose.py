"""Quaternions and rotation matrices agree with each other."""
from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from box_contact_ros.scene.pose import quaternion_from_matrix, quaternion_multiply, rotation_matrix


@settings(max_examples=200, deadline=None)
@given(st.lists(st.floats(-1, 1), min_size=4, max_size=4).filter(lambda q: np.hypot(*q[:2]) > 0.1))
def test_quaternion_helpers(values):
    """Matrix and back, and the product, agree with each other."""
    q = np.array(values) / np.linalg.norm(values)
    again = quaternion_from_matrix(rotation_matrix(q))
    assert min(np.abs(again - q).max(), np.abs(again + q).max()) < 1e-14
    assert np.allclose(rotation_matrix(quaternion_multiply(q, again)),
                       rotation_matrix(q) @ rotation_matrix(again), atol=1e-14)

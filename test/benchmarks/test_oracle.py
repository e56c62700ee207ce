# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The oracle itself, against closed forms and against sampling."""
from __future__ import annotations

import numpy as np
import oracle
import poses
import pytest
from gmpy2 import mpfr


def test_axis_aligned_overlap():
    """Boxes 2×2×2 and 2×2×2, offset (0.5, 0.3, 1.9): overlap 1.5 × 1.7 × 0.1, axis z."""
    a = oracle.make_box(poses.IDENTITY, (2, 2, 2))
    b = oracle.make_box((0.5, 0.25, 1.875, 0, 0, 0, 1), (2, 2, 2))
    assert oracle.separation(a, b) == -0.125
    volume, centroid, covariance = oracle.moments(a, b)
    extents = [mpfr('1.5'), mpfr('1.75'), mpfr('0.125')]
    assert abs(volume - extents[0] * extents[1] * extents[2]) < 1e-50
    assert np.allclose(oracle.as_array(centroid), (0.25, 0.125, 0.9375), atol=1e-16)
    for j, row in enumerate(covariance):
        for k, entry in enumerate(row):
            assert abs(entry - (extents[j]**2 / 12 if j == k else 0)) < 1e-50


def test_corner_pyramid():
    """A cube standing on its corner, pressed by d into a face, cuts off a corner.

    The centroid of that tetrahedron lies at d/4 from the face, its volume is d³ √3/2. Its variances
    are 3/80 d² along the height and 12/80 d² across.
    """
    turn = poses.multiply(poses.small_rotations(np.array([[1.0, -1, 0]]),
                                                np.array([np.arccos(1 / np.sqrt(3))])),
                          np.array([[0.0, 0, 0, 1]]))[0]
    d = 0.125
    a = oracle.make_box(poses.IDENTITY, (4, 4, 2))
    b = oracle.make_box((0, 0, 1 + np.sqrt(3) - d, *turn), (2, 2, 2))
    volume, centroid, covariance = oracle.moments(a, b)
    assert float(volume) == pytest.approx(d**3 * np.sqrt(3) / 2, rel=1e-12)
    assert oracle.as_array(centroid) == pytest.approx((0, 0, 1 - d / 4), abs=1e-12)
    found = np.array([oracle.as_array(row) for row in covariance])
    assert found == pytest.approx(np.diag([12, 12, 3]) / 80 * d * d, abs=1e-14)


def test_overlap_against_sampling():
    """Volume, centroid and covariance of random pairs agree with 200,000 points drawn in A."""
    rng = np.random.default_rng(5)
    a, b, size_a, size_b = poses.random_pairs(rng, 12)
    hits = 0
    for i in range(12):
        box_a = oracle.make_box(a[i], size_a[i])
        box_b = oracle.make_box(b[i], size_b[i])
        volume, centroid, covariance = oracle.moments(box_a, box_b)
        local = rng.uniform(-0.5, 0.5, (200_000, 3)) * size_a[i]
        points = poses.rotate(np.tile(a[i, 3:], (len(local), 1)), local) + a[i, :3]
        inverse = np.tile(b[i, 3:] * (-1, -1, -1, 1), (len(local), 1))
        inside = np.all(np.abs(poses.rotate(inverse, points - b[i, :3])) <= 0.5 * size_b[i], axis=1)
        share = inside.mean()
        assert float(volume) == pytest.approx(share * np.prod(size_a[i]),
                                              abs=5 * np.sqrt(2 * share / 2e5 + 1e-9)
                                              * np.prod(size_a[i]))
        if share > 0.01:
            hits += 1
            error = points[inside].mean(axis=0) - oracle.as_array(centroid)
            assert np.all(np.abs(error) < 5 * points[inside].std(axis=0) / np.sqrt(inside.sum()))
            spread = np.array([oracle.as_array(row) for row in covariance])
            drawn = np.cov(points[inside].T)
            assert np.abs(drawn - spread).max() < 10 * np.trace(spread) / np.sqrt(inside.sum())
        assert (volume > 0) == (oracle.separation(box_a, box_b) < 0)
    assert hits >= 4

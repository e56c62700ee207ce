# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The streams of poses: seeded, and what their names promise."""
from __future__ import annotations

import numpy as np

from box_contact_ros import ContactSolver
from box_contact_ros.bench.pose_streams import STREAMS, make_streams


def test_streams_are_the_same_for_the_same_seed():
    streams, again, others = (make_streams(60, rate=200.0, seed=seed) for seed in (5, 5, 6))
    assert len(streams) == STREAMS
    for stream, same, other in zip(streams, again, others):
        assert stream.poses_a.shape == stream.poses_b.shape == (60, 7)
        assert np.array_equal(stream.poses_b, same.poses_b)
        assert not np.array_equal(stream.poses_b, other.poses_b)


def test_most_pairs_touch_and_some_are_apart():
    """Depths are at most as stated, and no two pairs have the same."""
    for stream, deepest in zip(make_streams(2000, rate=200.0), (0.02, 1e-3)):
        contacts = ContactSolver(stream.size, stream.size, model='exact').batch(
            stream.poses_a, stream.poses_b)
        assert 0.02 < np.mean(~contacts.colliding) < 0.3
        assert contacts.separation.min() >= -deepest * (1.0 + 1e-9)
        assert np.diff(np.sort(contacts.separation)).min() > 0.0
        assert np.allclose(np.linalg.norm(stream.poses_b[:, 3:], axis=1), 1.0)


def test_containers_sway_smoothly():
    """From tick to tick, a container moves sideways by millimetres, and turns by less than 1°."""
    containers = make_streams(500, rate=200.0)[0]
    steps = np.abs(np.diff(containers.poses_b, axis=0))
    assert 0.0 < steps[:, :2].max() < 2e-3
    assert 0.0 < steps[:, 3:].max() < np.radians(1.0) / 2.0

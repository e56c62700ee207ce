# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The pose stream: seeded, always touching, smooth, and of a depth of its own in each tick."""
from __future__ import annotations

import numpy as np

from box_contact_ros import ContactSolver
from box_contact_ros.bench.poses import DEPTHS, swaying_containers
from box_contact_ros.scene.boxes import CONTAINER


def test_the_stream_is_the_same_for_the_same_seed():
    streams = [swaying_containers(60, rate=200.0, seed=seed)[1] for seed in (5, 5, 6)]
    assert streams[0].shape == (60, 7)
    assert np.array_equal(streams[0], streams[1]) and not np.array_equal(streams[0], streams[2])


def test_all_pairs_touch_each_at_a_depth_of_its_own():
    poses = swaying_containers(5000, rate=200.0)
    contacts = ContactSolver(CONTAINER, CONTAINER, model='exact').batch(*poses)
    assert contacts.colliding.all()
    assert contacts.separation.min() >= -DEPTHS[1] * (1.0 + 1e-9)
    assert np.diff(np.sort(contacts.separation)).min() > 0.0
    assert np.allclose(np.linalg.norm(poses[1][:, 3:], axis=1), 1.0)


def test_containers_sway_smoothly():
    """From tick to tick, a container moves sideways by millimetres, and turns by less than 1°."""
    steps = np.abs(np.diff(swaying_containers(500, rate=200.0)[1], axis=0))
    assert 0.0 < steps[:, :2].max() < 2e-3
    assert 0.0 < steps[:, 3:].max() < np.radians(1.0) / 2.0

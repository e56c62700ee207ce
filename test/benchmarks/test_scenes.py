# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report on thousands of boxes: the same pairs as MuJoCo."""
from __future__ import annotations

import numpy as np
import pytest

from benchmarks import scenes

pytestmark = pytest.mark.reports


def test_bricks_touch_their_neighbours_alone():
    """In a wall: one beside, and two of the layer above."""
    boxes = scenes.bricks(640)
    answer = scenes.SceneSolver(scenes.scene_of(boxes), model='exact')(boxes.pose)
    assert answer.touching == 2 * (20 * 15 + 19 * 31)
    assert np.bincount(answer.pairs.ravel()).max() == 6


def test_the_same_pairs_as_mujoco():
    pytest.importorskip('mujoco')
    for boxes in (scenes.bricks(100), scenes.pallets(1)):
        for row in scenes.compare('a scene', boxes, rounds=1):
            assert row.only_ours == row.only_mujoco == 0 and row.touching > 100
    assert [row.boxes for row in scenes.grow([50, 60], rounds=1)] == [50, 60]

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The reports on thousands of boxes: the same pairs as MuJoCo, and nothing lost over ROS."""
from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from benchmarks import scenes

ROOT = Path(__file__).resolve().parents[2]


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


def test_two_thousand_boxes_over_ros(monkeypatch):
    """75 arrays, two of them on their way at most: all are answered, with all contacts."""
    pytest.importorskip('rclpy')
    from benchmarks import scene_node

    # The echo node is in benchmarks, which no installation has; what is installed comes first.
    paths = (os.environ.get('PYTHONPATH'), str(ROOT))
    monkeypatch.setenv('PYTHONPATH', os.pathsep.join(filter(None, paths)))
    contact, echo = scene_node.streams(2000, 50.0, 1.5, ahead=2)
    assert contact.lost == echo.lost == 0 and contact.sent == echo.sent == 75
    boxes = scenes.bricks(2000)
    answer = scenes.SceneSolver(scenes.scene_of(boxes), model='exact')(boxes.pose)
    assert contact.touching == answer.touching > 5000

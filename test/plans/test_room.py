# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rooms: what reaches beyond the inner space of a container."""
from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from box_contact_ros.plans.inspect_plan import inspect_plan
from box_contact_ros.plans.plan import Plan
from box_contact_ros.plans.read_plan import read_plan
from box_contact_ros.plans.room import are_walls, walls

SOLUTION = Path(__file__).resolve().parents[2] / 'docs/examples/files/solution.csv'


def test_rooms() -> None:
    """Of all boxes or each; what is fixed is never outside, and a turned box by its corners."""
    turn = (0, 0, np.sin(np.pi / 8), np.cos(np.pi / 8))
    plan = Plan.from_corners([(-9, -9, -1), (0, 0, 0), (2, 0, 0)],
                             [(20, 20, 1), (1, 1, 1), (1, 1, 1)], ground=0,
                             room=((0, 0, 0), (3, 1, 1)))
    assert inspect_plan(plan).sound
    turned = plan.poses.copy()
    turned[1, 3:] = turn
    found = inspect_plan(replace(plan, poses=turned))
    reach = (np.sqrt(2.0) - 1.0) / 2.0
    assert np.argwhere(found.outside).tolist() == [[1, 0, 0], [1, 0, 1], [1, 1, 1]]
    assert found.outside[1, 0, 0] == pytest.approx(reach)
    assert found.verdicts.tolist() == ['ground', 'outside', 'sound'] and not found.sound
    assert inspect_plan(plan, tolerance=0.2).sound
    room = np.array([((-9,) * 3, (9,) * 3)] * 3)
    assert inspect_plan(replace(plan, poses=turned, room=room)).sound
    for bad, words in ((((0, 0, 0), (1, 0, 1)), r'room\[0\] must be a least and a greatest'),
                       ((0, 1), 'room must be corners'), (np.full((2, 3), np.nan), r'room\[0\]')):
        with pytest.raises(ValueError, match=words):
            replace(plan, room=bad)


def test_walls_touch_and_leave_no_gap() -> None:
    """They are around the room, and a box in a corner touches three."""
    least, greatest = np.array([1.0, 2.0, 3.0]), np.array([2.0, 4.0, 6.0])
    names, sizes, places = zip(*walls(least, greatest))
    assert names == ('floor', 'wall -x', 'wall +x', 'wall -y', 'wall +y')
    low, high = np.array(places) - np.array(sizes) / 2, np.array(places) + np.array(sizes) / 2
    for n in range(5):
        for other in [*range(n), None]:
            a, b = (least, greatest) if other is None else (low[other], high[other])
            meets = np.minimum(high[n], b) - np.maximum(low[n], a)
            assert meets.min() == pytest.approx(0.0, abs=1e-12) or {n, other} in ({1, 2}, {3, 4})
    plan = Plan.from_corners([*low, least], [*sizes, (0.5, 0.5, 0.5)], ground=range(5),
                             room=(least, greatest))
    assert are_walls(plan).tolist() == [False, True, True, True, True, False]
    found = inspect_plan(plan, sides=True)
    assert found.sound and found.carried_by[found.carried_by == 5].size == 3
    plan = Plan.from_corners([*low, least - (0.012, 0, 0)], [*sizes, (0.5, 0.5, 0.5)],
                             ground=range(5), room=(least, greatest))
    found = inspect_plan(plan)
    assert [str(row) for row in found.rows()] == ['outside               5  12.0 mm beyond -x']


def test_walls_are_not_drawn() -> None:
    """They would hide what is in the container."""
    pytest.importorskip('matplotlib')
    plan = read_plan(SOLUTION, unit='mm')
    drawn, _ = inspect_plan(plan).plot().axes[0].collections
    assert len(plan) == 12 and len(drawn.get_facecolor()) == 3 * 8  # of each its seen faces

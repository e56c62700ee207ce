# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What people type from memory: it works, or ends in a line that says how."""
from __future__ import annotations

import pytest

from box_contact_ros import (
    Box,
    ContactSolver,
    Pair,
    Plan,
    Scene,
    SceneSolver,
    Sweep,
    inspect_plan,
)

CONTAINER = (12.192, 2.438, 2.591)
STACK, LOAD, FAR = ((0, 0, z, 0, 0, 0, 1) for z in (0, 2.581, 99))  # centres [m]
SOLVER = ContactSolver(CONTAINER, CONTAINER)


def test_answers_have_no_truth_value() -> None:
    """`if answer:` would be True for boxes that are apart and for a plan that is not sound."""
    boxes = {'a': Box(CONTAINER), 'b': Box(CONTAINER, STACK)}
    scene = SceneSolver(Scene(boxes, [Pair('', 'a', 'b')]))
    down, still = Sweep([FAR], [LOAD]), Sweep([STACK], [STACK])
    for answer, words in (
            (SOLVER.batch([FAR], [STACK]), 'ask .colliding, .colliding.any'),
            (SOLVER.distance_batch([FAR], [STACK]), 'ask .colliding, .colliding.any'),
            (SOLVER.time_of_impact_batch(down, still), 'ask .time'),
            (SOLVER.time_of_impact_batch(down, still)[0], 'ask whether .time is NaN'),
            (inspect_plan(Plan([CONTAINER] * 2, [STACK, LOAD])), 'ask .sound or .verdict'),
            (scene.check_path([[FAR], [LOAD]]), 'ask .is_free')):
        with pytest.raises(TypeError, match=f'{type(answer).__name__} has no truth value: {words}'):
            bool(answer)

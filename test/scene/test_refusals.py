# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the public API refuses: one table, of a call, and the field and the value that it names."""
from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from box_contact_ros import (
    Box,
    Contact,
    Contacts,
    ContactSolver,
    Pair,
    Scene,
    SceneSolver,
    read_scene,
)

UNIT = (1.0, 1.0, 1.0)
POSE = np.array([0.0, 0, 0, 0, 0, 0, 1])
POSES = np.tile(POSE, (2, 1))
SOLVER = ContactSolver(UNIT, UNIT)
BOXES = {name: Box(name, UNIT) for name in 'ab'}
PAIR = Pair.between('a', 'b')
SCENE = SceneSolver(Scene(BOXES, (PAIR,)))
NAN = math.nan


def scene(boxes: Any = BOXES, pairs: Any = (PAIR,), **more: Any) -> Scene:
    return Scene(boxes, pairs, **more)


TABLE: list[tuple[Callable[[], object], str, str]] = [
    (lambda: ContactSolver((1, 2, -1), UNIT), 'size_a', '(1, 2, -1)'),
    (lambda: ContactSolver(UNIT, (1, 2)), 'size_b', '(2,)'),
    (lambda: ContactSolver(UNIT, UNIT, model='mpl'), 'model', "'mpl'"),
    (lambda: ContactSolver(UNIT, UNIT, margin='far'), 'margin', "'far'"),
    (lambda: ContactSolver(UNIT, UNIT, margin=NAN), 'margin', 'nan'),
    (lambda: ContactSolver(UNIT, UNIT, weights=5), 'weights', '5'),
    (lambda: SOLVER(POSE, 'pose'), 'pose_b', "'pose'"),
    (lambda: SOLVER(POSE[:6], POSE), 'pose_a', '(6,)'),
    (lambda: SOLVER.batch(POSES, POSES * NAN), 'poses_b[0]', 'nan'),
    (lambda: SOLVER.batch(POSES, POSES[:1]), 'poses_a and poses_b', '2 and 1'),
    (lambda: SOLVER.batch(POSES, POSES, size_a=(1, '2', 3)), 'size_a', "(1, '2', 3)"),
    (lambda: SOLVER.batch(POSES, pairs=[(0, 2)]), 'pairs[0]', '(0, 2)'),
    (lambda: SOLVER.batch(POSES, pairs=[(0.0, 1.0)]), 'pairs', '(0.0, 1.0)'),
    (lambda: SOLVER.batch(POSES, POSES, patch='no'), 'patch', "'no'"),
    (lambda: Contact(True, 'deep', UNIT, UNIT, 1.0, np.eye(3)), 'separation', "'deep'"),
    (lambda: Contact(True, -1.0, ('x', 0, 0), UNIT, 1.0, np.eye(3)), 'normal', "('x', 0, 0)"),
    (lambda: Contacts.of([None]), 'contacts[0]', 'None'),

    (lambda: Box('a', (1, 2, -1)), 'boxes.a.size', '(1, 2, -1)'),
    (lambda: Box('a', ('1', '2', '3')), 'boxes.a.size', "('1', '2', '3')"),
    (lambda: Box('a', UNIT, (0,) * 7), 'boxes.a.pose', 'w=0'),
    (lambda: Box('a', UNIT, pose_topic=5), 'boxes.a.pose_topic', '5'),
    (lambda: scene(boxes=[BOXES['a']]), 'boxes', "name='a'"),
    (lambda: scene(boxes={'a': None}), 'boxes.a', 'None'),
    (lambda: scene(pairs=None), 'pairs', 'None'),
    (lambda: scene(pairs=(('a', 'b'),)), 'pairs[0]', "('a', 'b')"),
    (lambda: scene(pairs=(Pair('p', 'a', 'c'),)), 'pairs[0].b', "'c'"),
    (lambda: scene(patterns=('*',)), 'patterns[0]', "'*'"),
    (lambda: scene(frame_id=5), 'frame_id', '5'),
    (lambda: scene(pose_array='no'), 'pose_array', "'no'"),
    (lambda: SceneSolver(None), 'scene', 'None'),
    (lambda: SceneSolver(scene(), margin='x'), 'margin', "'x'"),
    (lambda: SceneSolver(scene(), most_near=1.5), 'most_near', '1.5'),
    (lambda: SCENE(None), 'poses', 'None'),
    (lambda: SCENE([POSE]), 'poses', '1'),
    (lambda: SCENE([POSE, 'x']), 'pose of b', "'x'"),
    (lambda: SCENE(POSES * 0), 'pose of a', 'w=0'),
    (lambda: read_scene(5), 'path', '5'),
    (lambda: read_scene('no.yaml'), 'scene', "'no.yaml'"),
    (lambda: read_scene('a\0b'), 'path', "'a\\x00b'"),
]


def test_a_refusal_names_field_and_value() -> None:
    """Whatever is refused is a ValueError of one line."""
    missing = []
    for call, field, value in TABLE:
        with pytest.raises(ValueError) as refusal:
            call()
        text = str(refusal.value)
        if not (field in text and value in text and '\n' not in text):
            missing.append((field, value, text))
    assert not missing

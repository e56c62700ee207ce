# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Boxes that come, go, land and are lifted: a solver that is changed answers as a new one does."""
from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
from poses import CUBE, IDENTITY

from box_contact_ros import SceneSolver
from box_contact_ros.scene import changes
from box_contact_ros.scene.scene import Box, Frame, Pair, Scene, SceneError
from box_contact_ros.scene.scene_solver import Answer

FIELDS = ('colliding', 'separation', 'normal', 'point', 'volume', 'covariance', 'axis')
PATTERNS = (('*', 'stack*'), ('crane*', '*'), ('spreader', '*'))


def random_pose(rng: np.random.Generator, spread: float = 4.0) -> tuple[float, ...]:
    quaternion = rng.normal(size=4)
    return (*rng.uniform(-spread, spread, 3), *(quaternion / np.linalg.norm(quaternion)))


def yard(rng: np.random.Generator) -> Scene:
    """Return boxes that move and that stand, a body that moves, and a listed pair."""
    boxes = {f'stack{n}': Box(rng.uniform(0.5, 2, 3), random_pose(rng)) for n in range(20)}
    boxes |= {f'crane{n}': Box(rng.uniform(0.5, 2, 3)) for n in range(3)}
    boxes |= {f'part{n}': Box(CUBE, random_pose(rng, 1.0), body='spreader') for n in range(2)}
    return Scene(boxes, (Pair('own', 'stack3', 'crane1'),), patterns=PATTERNS, pose_array=True,
                 bodies={'spreader': Frame()})


def assert_same(answer: Answer, wanted: Answer) -> None:
    """Compare all that two answers tell, by name and to the bit."""
    names, others = ([pair for pair, _ in each.named()] for each in (answer, wanted))
    assert names == others
    assert answer.named_stale() == wanted.named_stale()
    for field in FIELDS:
        np.testing.assert_array_equal(getattr(answer.contacts, field),
                                      getattr(wanted.contacts, field))


def pair_count(scene: Scene) -> int:
    return sum(1 for _ in scene.every_pair())


@pytest.mark.parametrize('margin', [0.0, 0.5])
def test_a_changed_scene_is_answered_as_a_new_one(margin: float) -> None:
    """Whatever came, went, landed and was lifted: by a scene that a dictionary of boxes makes.

    Rows of poses keep their order. What moves no more has a row that is not read.
    """
    rng = np.random.default_rng(7)
    scene = yard(rng)
    solver, boxes, found = SceneSolver(scene, margin=margin), dict(scene.boxes), 0
    for revision in range(1, 60):
        free = [name for name, box in boxes.items()
                if not box.body and name not in ('stack3', 'crane1')]
        chosen = rng.permutation([*free, *(f'stack{revision}{n}' for n in range(3))])[:6].tolist()
        fixed = {name: Box(rng.uniform(0.5, 2, 3), random_pose(rng)) for name in chosen[:2]}
        moving = {name: Box(rng.uniform(0.5, 2, 3)) for name in chosen[2:4]}
        absent = [name for name in chosen[4:] if name in boxes and len(boxes) > 20]
        before = solver.moving
        assert solver.set_boxes(fixed=fixed, moving=moving, absent=absent) == revision
        boxes |= fixed | moving
        for name in absent:
            del boxes[name]
        assert solver.moving[:len(before)] == before and set(moving) <= set(solver.moving)
        whole = Scene(boxes, scene.pairs, patterns=PATTERNS, pose_array=True, bodies=scene.bodies)
        assert solver.scene == whole and solver.scene.names == whole.names
        assert solver.scene.pair_count == pair_count(whole)
        poses = {name: random_pose(rng) if rng.random() < 0.8 else None for name in solver.moving}
        answer = solver([poses[name] for name in solver.moving])
        assert answer.revision == revision
        assert_same(answer, SceneSolver(whole, margin=margin)([poses[n] for n in whole.moving]))
        found += len(answer.pairs)
    assert found > 150
    assert_same(pickle.loads(pickle.dumps(solver))([poses[name] for name in solver.moving]), answer)


def test_a_lift() -> None:
    """From the yard to a lorry: fixed, moving, fixed again, in one row of the poses."""
    boxes = {'ground': Box((50, 50, 1), (0, 0, -0.5, 0, 0, 0, 1)), 'hook': Box((1, 1, 1)),
             'c1': Box(CUBE, (0, 0, 1, 0, 0, 0, 1))}
    solver = SceneSolver(Scene(boxes, patterns=(('*', '*'),), pose_array=True))
    away = (0, 0, 20, 0, 0, 0, 1)
    assert len(solver([away]).pairs) == 0
    for _ in range(3):
        solver.set_boxes(moving={'c1': Box(CUBE)})
        assert solver.moving == ('hook', 'c1')
        assert [pair.label for pair, _ in solver([away, (9, 9, 0.9, 0, 0, 0, 1)]).named()] == [
            'ground_c1']
        solver.set_boxes(fixed={'c1': Box(CUBE, (9, 9, 1, 0, 0, 0, 1))})
        for row in (None, IDENTITY):  # not read
            assert [pair.label for pair, _ in solver([(9, 9, 2.4, 0, 0, 0, 1), row]).named()] == [
                'hook_c1']
    solver.set_boxes(absent=['c1'])
    assert len(solver([(9, 9, 2.4, 0, 0, 0, 1), None]).pairs) == 0 and solver.revision == 7


FIXED = Box(CUBE, IDENTITY)


@pytest.mark.parametrize('change, words', [
    ({'fixed': {'new': Box(CUBE)}}, 'fixed.new: a fixed box needs a pose'),
    ({'fixed': {'new': CUBE}}, 'fixed.new: must be a Box, not '),
    ({'fixed': [FIXED]}, 'fixed: must be boxes by name'),
    ({'fixed': {7: FIXED}}, 'must be a name, not 7'),
    ({'fixed': {'': FIXED}}, 'is an empty name'),
    ({'fixed': {'n' * 256: FIXED}}, 'has 256 bytes, more than 255'),
    ({'fixed': {'part0': FIXED}}, 'fixed.part0: is of a body, and bodies stay as they are'),
    ({'fixed': {'spreader': FIXED}}, 'is of a body'),
    ({'fixed': {'new': Box(CUBE, IDENTITY, body='b')}}, 'has neither a body nor a pose_topic'),
    ({'moving': {'new': FIXED}}, 'moving.new: a box that moves has no pose'),
    ({'moving': {'new': Box(CUBE)}, 'fixed': {'new': FIXED}}, 'moving.new: is in fixed, too'),
    ({'absent': 'stack1'}, "absent: must be names, not 'stack1'"),
    ({'absent': ['stak1']}, "absent[0]: 'stak1' is none of the boxes (did you mean stack1?)"),
    ({'absent': ['stack1', 'stack1']}, "absent[1]: 'stack1' is changed by the same request"),
    ({'absent': ['stack1'], 'fixed': {'stack1': FIXED}}, "absent[0]: 'stack1' is changed by"),
    ({'absent': ['stack3']}, "absent[0]: 'stack3' is a box of a listed pair, which stays"),
    ({'fixed': {'crane1': FIXED}}, "pairs[0]: 'stack3' and 'crane1' are both fixed"),
])
def test_a_change_is_refused_whole(change: dict[str, Any], words: str) -> None:
    """With field and value; the scene stays, also what the same change asks for rightly."""
    solver = SceneSolver(yard(np.random.default_rng(1)))
    scene, moving = solver.scene, solver.moving
    with pytest.raises(SceneError) as refused:
        solver.set_boxes(**{'fixed': {'good': FIXED}, **change})
    assert words in str(refused.value)
    assert (solver.scene, solver.moving, solver.revision) == (scene, moving, 0)


def test_boxes_that_move_by_topics_stay_as_they_are() -> None:
    """Fixed ones come and go; a load whose last partner goes waits for the next one."""
    boxes = {'load': Box(CUBE), 'idle': Box(CUBE), 'floor': Box((9, 9, 1), IDENTITY)}
    solver = SceneSolver(Scene(boxes, patterns=(('load', 'floor*'),)))
    assert solver.moving == ('load',)
    for change, words in (
            ({'moving': {'new': Box(CUBE)}}, 'moving.new: has no topic'),
            ({'fixed': {'load': FIXED}}, 'fixed.load: moves by a topic of its own'),
            ({'absent': ['load']}, "'load' moves by a topic of its own")):
        with pytest.raises(SceneError, match=words):
            solver.set_boxes(**change)
    for _ in range(2):
        solver.set_boxes(fixed={'floor2': Box((9, 9, 1), (20, 0, 0, 0, 0, 0, 1))})
        assert [pair.label for pair, _ in solver([(20, 0, 1.4, 0, 0, 0, 1)]).named()] == [
            'load_floor2']
        solver.set_boxes(absent=['floor2', *(name for name in ('floor',)
                                             if name in solver.scene.boxes)])
        assert len(solver([(20, 0, 1.4, 0, 0, 0, 1)]).pairs) == 0
        assert solver.moving == ('load',) and not solver.scene.moving


def test_a_scene_that_changes_has_a_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """And keeps at least one box."""
    monkeypatch.setattr(changes, 'MOST_BOXES', 3)
    solver = SceneSolver(Scene({'a': Box(CUBE), 'b': Box(CUBE)}, patterns=(('*', '*'),),
                               pose_array=True))
    with pytest.raises(SceneError, match='fixed: 4 boxes are more than 3'):
        solver.set_boxes(fixed={'c': FIXED, 'd': FIXED})
    with pytest.raises(SceneError, match='absent: a scene needs at least one box'):
        solver.set_boxes(absent=['a', 'b'])
    solver.set_boxes(fixed={'c': FIXED}, absent=['a'])
    assert list(solver.scene.boxes) == ['b', 'c']

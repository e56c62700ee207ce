# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Boxes that come, go, land and are lifted: a solver that is changed answers as a new one does."""
from __future__ import annotations

import pickle
from dataclasses import fields as fields_of
from typing import Any

import numpy as np
import pytest
from answers import stale_pairs
from poses import CUBE, IDENTITY

from box_contact_ros import SceneSolver
from box_contact_ros.scene import changes
from box_contact_ros.scene.boxes import Box, Frame, SceneError
from box_contact_ros.scene.scene import Pair, Scene
from box_contact_ros.scene.scene_solver import Answer

FIELDS = ('colliding', 'separation', 'normal', 'point', 'volume', 'covariance', 'axis')
PATTERNS = (('*', 'stack*'), ('crane*', '*'), ('spreader', '*'))


def random_pose(rng: np.random.Generator, spread: float = 4.0) -> tuple[float, ...]:
    quaternion = rng.normal(size=4)
    return (*rng.uniform(-spread, spread, 3), *(quaternion / np.linalg.norm(quaternion)))


def a_yard(rng: np.random.Generator) -> Scene:
    """Return boxes that move and that stand, a body that moves, and a listed pair."""
    boxes = {f'stack{n}': Box(rng.uniform(0.5, 2, 3), random_pose(rng)) for n in range(20)}
    boxes |= {f'crane{n}': Box(rng.uniform(0.5, 2, 3)) for n in range(3)}
    boxes |= {f'part{n}': Box(CUBE, random_pose(rng, 1.0), body='spreader') for n in range(2)}
    return Scene(boxes, (Pair('own', 'stack3', 'crane1'),), patterns=PATTERNS, poses='named',
                 bodies={'spreader': Frame()})


def assert_same(answer: Answer, wanted: Answer) -> None:
    """Compare all that two answers tell, by name and to the bit."""
    names, others = ([pair for pair, _ in each.named()] for each in (answer, wanted))
    assert names == others
    assert stale_pairs(answer) == stale_pairs(wanted)
    for field in FIELDS:
        np.testing.assert_array_equal(getattr(answer.contacts, field),
                                      getattr(wanted.contacts, field))


def pair_count(scene: Scene) -> int:
    return sum(1 for _ in scene.every_pair())


class Yard:
    """Plays a yard at random: boxes and bodies come, go, are lifted, land, join and come off."""

    def __init__(self, scene: Scene, rng: np.random.Generator) -> None:
        self.scene, self.rng = scene, rng
        self.boxes, self.bodies = dict(scene.boxes), dict(scene.bodies)
        self.first = {name: number for number, name in enumerate(scene.boxes)}

    def box(self, pose: Any = None, body: str = '') -> Box:
        return Box(self.rng.uniform(0.5, 2, 3), pose, body=body)

    def change(self, number: int) -> dict[str, Any]:
        """Make a change, and return the arguments of `set_boxes`."""
        rng = self.rng
        free = [name for name in self.first if name not in ('stack3', 'crane1')]
        names = rng.permutation([*free, *(f'stack{number}{n}' for n in range(3))])[:8].tolist()
        body = str(rng.choice(['spreader', 'crane_lorry', 'lorry']))
        change: dict[str, Any] = {
            'fixed': {name: self.box(random_pose(rng)) for name in names[:2]},
            'moving': {name: self.box() for name in names[2:4]},
            'parts': {name: self.box(random_pose(rng, 1.0), body) for name in names[4:6]},
            'bodies': {body: Frame(random_pose(rng) if rng.random() < 0.5 else None)},
            'absent': [name for name in names[6:] if name in self.boxes]}
        lorry = {name for name, box in self.boxes.items() if box.body == 'lorry'}
        if lorry and lorry.isdisjoint(names) and body != 'lorry' and rng.random() < 0.3:
            change['absent'].append('lorry')
            self.boxes = {name: box for name, box in self.boxes.items() if name not in lorry}
        self.boxes |= change['fixed'] | change['moving'] | change['parts']
        self.bodies |= change['bodies']
        for name in change['absent']:
            self.boxes.pop(name, None)
        for name in self.boxes:
            self.first.setdefault(name, len(self.first))
        used = {box.body for box in self.boxes.values()}
        self.bodies = {name: frame for name, frame in self.bodies.items() if name in used}
        return change

    def whole(self) -> Scene:
        """Return the scene as a new one: boxes in the order in which they came."""
        fields = {each.name: getattr(self.scene, each.name) for each in fields_of(Scene)
                  if each.init}
        return Scene.as_changed(**fields | {
            'boxes': dict(self.boxes), 'bodies': self.bodies})


@pytest.mark.parametrize('margin', [0.0, 0.5])
def test_a_changed_scene_is_answered_as_a_new_one(margin: float) -> None:
    """Whatever came, went and was joined: by a scene that a dictionary of boxes makes."""
    rng = np.random.default_rng(7)
    yard = Yard(a_yard(rng), rng)
    solver, found, fixed_bodies = SceneSolver(yard.scene, margin=margin), 0, 0
    for revision in range(1, 120):
        assert solver.set_boxes(**yard.change(revision)) == revision
        whole = yard.whole()
        assert solver.scene == whole and solver.scene.names == whole.names
        assert list(solver.scene.bodies) == list(whole.bodies)
        assert solver.moving == whole.moving
        assert solver.scene.pair_count == pair_count(whole)
        paired = {name for pair in whole.every_pair() for name in (pair.a, pair.b)}
        assert [*solver.scene.is_paired] == [name in paired for name in whole.names]
        poses = [random_pose(rng) if rng.random() < 0.8 else None for _ in solver.moving]
        answer = solver(poses)
        assert answer.revision == revision
        assert_same(answer, SceneSolver(whole, margin=margin)(poses))
        found += len(answer.pairs)
        fixed_bodies += sum(frame.pose is not None for frame in whole.bodies.values())
    assert found > 500 and fixed_bodies > 50
    assert_same(pickle.loads(pickle.dumps(solver))(poses), answer)


def test_a_lift() -> None:
    """From the yard to a lorry: attached to the hook, moved with it, and detached."""
    boxes = {'ground': Box((50, 50, 1), (0, 0, -0.5, 0, 0, 0, 1)),
             'hook': Box((1, 1, 1), body='crane'), 'c1': Box(CUBE, (0, 0, 1, 0, 0, 0, 1))}
    solver = SceneSolver(Scene(boxes, patterns=(('*', '*'),), poses='named',
                               bodies={'crane': Frame()}))
    away = (0, 0, 20, 0, 0, 0, 1)
    assert len(solver([away]).pairs) == 0
    for _ in range(3):
        solver.set_boxes(parts={'c1': Box(CUBE, (0, 0, -1.4, 0, 0, 0, 1), body='crane')})
        assert solver.moving == ('crane',)
        assert [pair.label for pair, _ in solver([(9, 9, 2.3, 0, 0, 0, 1)]).named()] == [
            'c1_ground']
        solver.set_boxes(fixed={'c1': Box(CUBE, (9, 9, 1, 0, 0, 0, 1))})
        assert [pair.label for pair, _ in solver([(9, 9, 2.4, 0, 0, 0, 1)]).named()] == [
            'c1_hook']
    solver.set_boxes(moving={'c1': Box(CUBE)})
    assert solver.moving == ('c1', 'crane')
    solver.set_boxes(absent=['c1'])
    assert len(solver([(9, 9, 2.4, 0, 0, 0, 1)]).pairs) == 0 and solver.revision == 8


def test_a_box_that_comes_back_is_called_as_before() -> None:
    """Pairs are called by the order of names, whichever box came first."""
    boxes = {name: Box(CUBE) for name in ('load', 'c1', 'c2')}
    solver = SceneSolver(Scene(boxes, patterns=(('*', '*'),), poses='named'))
    for gone in (['load'], ['c2'], ['c1', 'load'], ['c1']):
        solver.set_boxes(absent=gone)
        solver.set_boxes(moving={name: Box(CUBE) for name in gone})
        assert {pair.label for pair in solver.scene.every_pair()} == {
            'c1_load', 'c2_load', 'c1_c2'}
    solver.set_boxes(moving={'c0': Box(CUBE), 'ß': Box(CUBE)}, absent=['c1', 'c2'])
    assert solver.scene.names == ('load', 'c0', 'ß')
    assert {pair.label for pair in solver.scene.every_pair()} == {'c0_load', 'load_ß', 'c0_ß'}


FIXED = Box(CUBE, IDENTITY)


@pytest.mark.parametrize('change, words', [
    ({'fixed': {'new': Box(CUBE)}}, 'fixed.new: a fixed box needs a pose'),
    ({'fixed': {'new': CUBE}}, 'fixed.new: must be a Box, not '),
    ({'fixed': [FIXED]}, 'fixed: must be boxes by name'),
    ({'fixed': {7: FIXED}}, 'must be a name, not 7'),
    ({'fixed': {'': FIXED}}, 'is an empty name'),
    ({'fixed': {'n' * 256: FIXED}}, 'has 256 bytes, more than 255'),
    ({'fixed': {'spreader': FIXED}}, 'fixed.spreader: is the name of a body, too'),
    ({'fixed': {'lorry': FIXED}, 'bodies': {'lorry': Frame()}}, 'is the name of a body, too'),
    ({'bodies': {'stack1': Frame()}}, 'bodies.stack1: is the name of a box, too'),
    ({'bodies': {'lorry': Frame()}}, "bodies.lorry: no box is a part of 'lorry'"),
    ({'bodies': {'lorry': FIXED}}, 'bodies.lorry: must be a Frame, not '),
    ({'bodies': {'lorry': Frame(pose_topic='a')}}, 'a body that comes has no pose_topic'),
    ({'bodies': [Frame()]}, 'bodies: must be Frames by name'),
    ({'parts': {'new': FIXED}}, 'parts.new: a part needs a body'),
    ({'parts': {'new': Box(CUBE, body='spreder')}},
     "parts.new: 'spreder' is none of the bodies (did you mean spreader?)"),
    ({'parts': {'new': Box(CUBE, body='spreader')}, 'fixed': {'new': FIXED}},
     'parts.new: is in fixed, too'),
    ({'parts': {'stack3': Box(CUBE, body='b'), 'crane1': Box(CUBE, body='b')},
      'bodies': {'b': Frame()}}, "pairs[0]: 'stack3' and 'crane1' are parts of one body"),
    ({'absent': ['spreader', 'part0']}, "absent[1]: 'part0' is changed by the same request"),
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
    solver = SceneSolver(a_yard(np.random.default_rng(1)))
    scene, moving = solver.scene, solver.moving
    with pytest.raises(SceneError) as refused:
        solver.set_boxes(**{'fixed': {'good': FIXED}, **change})
    assert words in str(refused.value)
    assert (solver.scene, solver.moving, solver.revision) == (scene, moving, 0)


def test_what_moves_stays_unless_poses_have_names() -> None:
    """Fixed boxes and bodies come and go; a load whose last partner goes waits for the next one."""
    boxes = {'load': Box(CUBE), 'hook': Box(CUBE, body='crane'),
             'floor': Box((9, 9, 1), IDENTITY)}
    solver = SceneSolver(Scene(boxes, patterns=(('load', 'floor*'), ('hook', 'floor*')),
                               bodies={'crane': Frame()}))
    moving, away = ('load', 'crane'), (0, 0, 30, 0, 0, 0, 1)
    assert solver.moving == moving
    alone = 'what moves comes and goes in scenes with poses: named alone'
    for change, words in (
            ({'moving': {'new': Box(CUBE)}}, f'moving.new: would move: {alone}'),
            ({'fixed': {'load': FIXED}}, f'fixed.load: moves, and stays as it is: {alone}'),
            ({'parts': {'load': Box(CUBE, body='crane')}}, 'parts.load: moves, and stays'),
            ({'bodies': {'new': Frame()}, 'parts': {'a': Box(CUBE, body='new')}},
             f'bodies.new: would move: {alone}'),
            ({'bodies': {'crane': Frame(IDENTITY)}}, f'bodies.crane: would stop: {alone}'),
            ({'fixed': {'hook': FIXED}}, f'bodies.crane: its last box goes, but {alone}'),
            ({'absent': ['crane']}, f'bodies.crane: its last box goes, but {alone}'),
            ({'absent': ['load']}, "'load' moves, and stays as it is")):
        with pytest.raises(SceneError) as refused:
            solver.set_boxes(**change)
        assert words in str(refused.value)
    for _ in range(2):
        solver.set_boxes(parts={'floor2': Box((9, 9, 1), body='lorry')},
                         bodies={'lorry': Frame((20, 0, 0, 0, 0, 0, 1))})
        assert [pair.label for pair, _ in solver([(20, 0, 1.4, 0, 0, 0, 1), away]).named()] == [
            'load_floor2']
        gone = [name for name in ('floor',) if name in solver.scene.boxes]
        solver.set_boxes(absent=['lorry', *gone])
        assert len(solver([(20, 0, 1.4, 0, 0, 0, 1), away]).pairs) == 0
        assert solver.moving == moving
    solver.set_boxes(fixed={'floor3': FIXED}, bodies={'crane': Frame()},
                     parts={'floor3b': Box(CUBE, (0, 0, -2, 0, 0, 0, 1), body='crane')})
    assert [pair.label for pair, _ in solver([(0, 0, 3.9, 0, 0, 0, 1), away]).named()] == []
    assert [pair.label for pair, _ in solver([away, (0, 0, 1.9, 0, 0, 0, 1)]).named()] == [
        'hook_floor3']
    assert solver([(0, 0, 0, 0, 0, 0, 1), (0, 0, 3.9, 0, 0, 0, 1)]).named()[-1][0].label == (
        'load_floor3b')


def test_a_scene_that_changes_has_a_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """And keeps at least one box."""
    monkeypatch.setattr(changes, 'MOST_BOXES', 3)
    solver = SceneSolver(Scene({'a': Box(CUBE), 'b': Box(CUBE)}, patterns=(('*', '*'),),
                               poses='named'))
    with pytest.raises(SceneError, match='fixed: 4 boxes are more than 3'):
        solver.set_boxes(fixed={'c': FIXED, 'd': FIXED})
    with pytest.raises(SceneError, match='absent: a scene needs at least one box'):
        solver.set_boxes(absent=['a', 'b'])
    solver.set_boxes(fixed={'c': FIXED}, absent=['a'])
    assert list(solver.scene.boxes) == ['b', 'c']

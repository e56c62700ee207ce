# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Bodies of several boxes: one pose each, and the answers of the same boxes placed by hand."""
from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import poses
import pytest
from answers import stale_pairs

from box_contact_ros import Body, PatchForces
from box_contact_ros.core import native
from box_contact_ros.scene.boxes import Box, Frame
from box_contact_ros.scene.scene import ALONE, EVERY_PAIR, Pair, Scene
from box_contact_ros.scene.scene_solver import SceneSolver

UNIT = (1.0, 1.0, 1.0)

def placed(frames, local):
    """Poses (n, 7) in the common frame, of poses in frames (n, 7)."""
    turn = frames[:, 3:] / np.linalg.norm(frames[:, 3:], axis=1, keepdims=True)
    return np.hstack((poses.rotate(turn, local[:, :3]) + frames[:, :3],
                      poses.multiply(turn, local[:, 3:])))


@pytest.mark.parametrize('margin', [0.0, 0.5])
@pytest.mark.parametrize('patterns', [True, False])
def test_the_answers_are_those_of_boxes_placed_by_hand(patterns, margin):
    """Random bodies, one of them fixed, one away, and loose boxes; quaternions of any length."""
    rng = np.random.default_rng(2)
    count = 0
    for _ in range(10):
        frames = np.hstack((rng.uniform(-1, 1, (5, 3)), rng.normal(size=(5, 4))))
        of = rng.permutation(np.r_[np.repeat(np.arange(5), 8), [ALONE] * 8])
        n, away = len(of), 3
        local = np.hstack((rng.uniform(-1, 1, (n, 3)), rng.normal(size=(n, 4))))
        sizes = np.exp(rng.uniform(-1, 0, (n, 3)))
        names = [f'b{box}' for box in range(n)]
        bodies = {f'body{k}': Frame(frames[k] if k == 0 else None) for k in range(5)}
        boxes = {name: Box(size, pose, body=f'body{k}') if k != ALONE else Box(size)
                 for name, size, pose, k in zip(names, sizes, local, of)}
        where = np.where(of[:, None] != ALONE, placed(frames[of], local), local)
        by_hand = {name: Box(size, pose if k == 0 else None)
                   for name, size, pose, k in zip(names, sizes, where, of)}
        pairs = tuple(Pair.between(f'b{i}', f'b{j}') for i in range(n) for j in range(i)
                      if (of[i] != of[j] or of[i] == ALONE) and rng.random() < 0.3)
        scene = Scene(boxes, pairs, patterns=EVERY_PAIR * patterns, bodies=bodies)
        plain = Scene(by_hand, pairs, patterns=EVERY_PAIR * patterns)
        given = {**dict(zip(names, where)), **{f'body{k}': frames[k] for k in range(5)}}
        answer = SceneSolver(scene, margin=margin)(
            [None if name == f'body{away}' else given[name] for name in scene.moving])
        wanted = SceneSolver(plain, margin=margin)(
            [None if of[int(name[1:])] == away else given[name] for name in plain.moving])
        asked = (of[wanted.pairs] == ALONE).any(axis=1) | (of[wanted.pairs[:, 0]] !=
                                                           of[wanted.pairs[:, 1]])
        assert np.array_equal(answer.pairs, wanted.pairs[asked])
        assert np.array_equal(answer.stale, wanted.stale)
        for mine, theirs in zip(*map(poses.fields, (answer.contacts, wanted.contacts[asked]))):
            assert np.allclose(mine, theirs, rtol=1e-9, atol=1e-9, equal_nan=True)
        assert scene.pair_count == len(list(scene.every_pair()))
        count += answer.touching
    assert count > 200


def test_a_model_of_41_boxes_has_no_pair_of_its_own():
    """Of a truck on a floor: each part may meet the floor, and no other part."""
    parts = {f'part{n}': Box(UNIT, (0.5 * n, 0, 0, 0, 0, 0, 1), body='truck') for n in range(41)}
    scene = Scene({'floor': Box((50, 50, 1), (0, 0, -0.5, 0, 0, 0, 1)), **parts},
                  patterns=EVERY_PAIR, bodies={'truck': Frame()})
    assert scene.pair_count == 41 and scene.moving == ('truck',)
    answer = SceneSolver(scene)([[0, 0, 0.4, 0, 0, 0, 1]])
    assert answer.candidates == answer.touching == 41 and (answer.pairs[:, 0] == 0).all()
    assert SceneSolver(scene)([None]).stale.tolist() == [[box, ALONE] for box in range(1, 42)]


def test_a_box_at_its_body_keeps_the_bits_of_the_pose():
    """Of each number: also of zeros below zero, of a quaternion of any length, and of NaN."""
    for pose in ([-0.0, 1 / 3, -0.0, -0.0, 0.1, -0.0, 0.7], [1e5, 0, 0, 3e50, -0.0, 0, 4e50],
                 [math.nan] * 7):
        rows = np.array([[0.0] * 7, pose])
        assert native.place_boxes(rows, np.array([1]), np.array([[0.0] * 6 + [1]])) == -1
        assert rows[0].tobytes() == rows[1].tobytes() == np.array(pose).tobytes()


def test_a_part_without_a_pose_is_where_its_body_is():
    """To the bit: it answers as a box of that name that moves alone."""
    rng = np.random.default_rng(3)
    floor = Box((3.0, 3.0, 1.0), (0.1, -0.2, -0.4, 0.0, 0.1, 0.0, 1.0))
    part = Scene({'part': Box(UNIT, body='hook'), 'floor': floor}, patterns=EVERY_PAIR,
                 poses='named', bodies={'hook': Frame()})
    alone = Scene({'part': Box(UNIT), 'floor': floor}, patterns=EVERY_PAIR, poses='named')
    for pose in np.hstack((rng.uniform(-0.4, 0.4, (20, 3)), rng.normal(size=(20, 4)))):
        found, wanted = (SceneSolver(scene)([pose]).contacts for scene in (part, alone))
        assert len(wanted) == 1
        poses.assert_same_bits(found, wanted)


def test_a_rotation_moves_what_is_beside():
    """A quarter turn about z, of a box that is turned a quarter about x in the body's frame."""
    half = math.sqrt(0.5)
    scene = Scene({'a': Box(UNIT), 'b': Box(UNIT, (2, 0, 1, half, 0, 0, half), body='body')},
                  (Pair.between('a', 'b'),), bodies={'body': Frame((5, 6, 7, 0, 0, 2, 2))})
    pose = scene.fixed_poses()[1]
    assert pose[:3] == pytest.approx([5, 8, 8])
    assert pose[3:] / np.linalg.norm(pose[3:]) == pytest.approx([0.5, 0.5, 0.5, 0.5])


def test_own_contacts_of_bodies_are_those_of_a_scene():
    """To the bit: forces put boxes where a tick of a scene puts them."""
    rng = np.random.default_rng(3)
    local = np.hstack((rng.uniform(-1, 1, (8, 3)), poses.unit_quaternions(rng, 8)))
    body = np.repeat([0, 1], 4)
    boxes = {f'b{k}': Box(UNIT, local[k], body='uv'[body[k]]) for k in range(8)}
    scene = Scene(boxes, patterns=EVERY_PAIR, bodies={'u': Frame(), 'v': Frame()})
    sizes, at_body = np.ones((8, 3)), np.array([box.pose for box in boxes.values()])
    touching = 0
    for _ in range(20):
        frames = np.hstack((rng.uniform(-1, 1, (2, 3)), poses.unit_quaternions(rng, 2)))
        answer = SceneSolver(scene)(list(frames))
        after = []
        for contacts in (answer.contacts, None):
            forces = PatchForces([Body.of_box(UNIT, 1.0)] * 2)
            forces.set_boxes(sizes, body=body, poses=at_body)
            forces.hold(answer.pairs, contacts, None if contacts is None else frames)
            after.append(forces.advance(0.001, frames, np.zeros((2, 6))))
        assert all(np.array_equal(one, other) for one, other in zip(*after))
        touching += answer.touching
    assert touching > 50


BODIES = Scene({'a': Box(UNIT), 'b1': Box(UNIT, body='b'),
                'b2': Box(UNIT, (1, 0, 0, 0, 0, 0, 1), body='b')},
               patterns=(('a', 'b'),), bodies={'b': Frame()})


@pytest.mark.parametrize('pose, words', [
    ([math.nan, 0, 0, 0, 0, 0, 1], 'position'), ([0] * 7, 'zero length'),
    ([0, 0, 0, math.nan, 0, 0, 1], 'is not finite'), ([1e60, 0, 0, 0, 0, 0, 1], 'exceeds')])
def test_a_bad_pose_of_a_body_is_refused_by_its_name(pose, words):
    """A quaternion with one NaN would make seven of a box, which is not there."""
    with pytest.raises(ValueError, match=f'pose of b: .*{words}'):
        SceneSolver(BODIES)([poses.IDENTITY, pose])
    assert BODIES.moving == ('a', 'b')
    assert [pair.label for pair in stale_pairs(SceneSolver(BODIES)([poses.IDENTITY, None]))] == [
        'b1', 'b2']


def test_a_box_that_its_body_carries_too_far_is_refused():
    """By its own name: the body's pose is one."""
    scene = replace(BODIES, boxes={**BODIES.boxes, 'b2': Box(
        UNIT, (1e50, 0, 0, 0, 0, 0, 1), body='b')})
    with pytest.raises(ValueError, match='pose of b2: position .* exceeds'):
        SceneSolver(scene)([poses.IDENTITY, [1e50, 0, 0, 0, 0, 0, 1]])

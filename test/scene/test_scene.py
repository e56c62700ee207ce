# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scenes: what a tick computes against every pair by itself, and files that are refused."""
from __future__ import annotations

import copy
import math
import pickle
import time
from dataclasses import replace

import numpy as np
import poses
import pytest
from answers import near_pairs, stale_pairs

from box_contact_ros import ContactSolver, make_model
from box_contact_ros.core import native
from box_contact_ros.scene.boxes import Box, SceneError
from box_contact_ros.scene.scene import EVERY_PAIR, Pair, Scene, two_boxes
from box_contact_ros.scene.scene_file import read_scene
from box_contact_ros.scene.scene_solver import SceneSolver

IDENTITY = (0, 0, 0, 0, 0, 0, 1)


def yard(columns=10, rows=20, tiers=5):
    """Containers in a yard, and one that hangs: 1,000 pairs. Columns 12.7 m, rows 2.7 m apart."""
    boxes = {'load': Box(poses.CONTAINER, pose_topic='load/pose')}
    for n, (i, j, k) in enumerate(np.ndindex(columns, rows, tiers)):
        boxes[f's{n}'] = Box(poses.CONTAINER, (12.7 * i, 2.7 * j, 2.591 * k, 0, 0, 0, 1))
    return Scene(boxes, tuple(Pair(f'load_s{n}', f's{n}', 'load')
                              for n in range(len(boxes) - 1)))


def alone(scene, given_poses, model='exact'):
    """Contacts of each pair by a solver of its own."""
    found = {}
    where = {name: box.pose for name, box in scene.boxes.items()} | given_poses
    for pair in scene.pairs:
        a, b = where[pair.a], where[pair.b]
        if a is None or b is None:
            continue
        contact = ContactSolver(scene.boxes[pair.a].size, scene.boxes[pair.b].size,
                                model=model)(a, b)
        if contact.colliding:
            found[pair] = contact
    return found


def assert_same(answer, wanted):
    assert {pair for pair, _ in answer.named()} == set(wanted)
    for pair, contact in answer.named():
        other = wanted[pair]
        assert contact.separation == other.separation
        assert np.allclose(contact.normal, other.normal, rtol=0, atol=1e-15)
        assert np.allclose(contact.point, other.point, rtol=4e-16, atol=1e-15)


@pytest.mark.parametrize('model', ['exact', 'mlp'])
@pytest.mark.parametrize('origin', [0.0, 5e6])
def test_a_tick_is_every_pair_alone(model, origin):
    """Random boxes, a third of them fixed, half of the pairs listed, near and far.

    The same contacts as one solver per pair, whatever the conservative test leaves out.
    """
    rng = np.random.default_rng(1)
    contacts = stale = left_out = 0
    for _ in range(20):
        n = 9
        sizes = np.exp(rng.uniform(-1, 1, (n, 3)))
        where = np.hstack((origin + rng.uniform(-1.8, 1.8, (n, 3)), poses.unit_quaternions(rng, n)))
        boxes = {f'b{i}': Box(tuple(sizes[i]), tuple(where[i]) if i % 3 == 0 else None,
                              '' if i % 3 == 0 else f'b{i}/pose') for i in range(n)}
        pairs = tuple(Pair(f'p{i}{j}', f'b{i}', f'b{j}') for i in range(n)
                      for j in range(i) if (i % 3 or j % 3) and rng.random() < 0.5)
        scene = Scene(boxes, pairs)
        solver = SceneSolver(scene, model=model)
        missing = f'b{rng.choice([1, 2, 4])}'
        given_poses = {name: None if name == missing else where[int(name[1:])]
                       for name in scene.moving}
        answer = solver([given_poses[name] for name in scene.moving])
        assert_same(answer, alone(scene, given_poses, model))
        assert stale_pairs(answer) == [pair for pair in pairs if missing in (pair.a, pair.b)]
        contacts += answer.touching
        stale += len(answer.stale)
        left_out += len(pairs) - len(answer.stale) - answer.candidates
    assert contacts > 50 and stale > 30 and left_out > 50


@pytest.mark.parametrize('patterns', [(), EVERY_PAIR])
@pytest.mark.parametrize('origin', [0.0, 5e6])
def test_close_pairs_are_those_within_the_margin(patterns, origin):
    """Of every pair alone: apart, by a distance up to the margin. Those in contact stay."""
    rng = np.random.default_rng(5)
    close = 0
    for margin in (0.1, 0.5, 1.0):
        n = 40
        sizes = np.exp(rng.uniform(-1, 1, (n, 3)))
        where = np.hstack((origin + rng.uniform(-6, 6, (n, 3)), poses.unit_quaternions(rng, n)))
        boxes = {f'b{i}': Box(tuple(sizes[i]), pose_topic=f'b{i}/pose') for i in range(n)}
        pairs = tuple(Pair.between(f'b{i}', f'b{j}') for i in range(n) for j in range(i))
        scene = Scene(boxes, () if patterns else pairs, patterns=patterns)
        solver = SceneSolver(scene, model='exact', margin=margin)
        answer, plain = solver(where), SceneSolver(scene, model='exact')(where)
        assert not len(plain.near) and not answer.near.colliding.any()
        assert np.array_equal(answer.pairs, plain.pairs)
        found = {frozenset(pair[1:]): nearest.distance for pair, nearest in near_pairs(answer)}
        wanted = {}
        for pair in pairs:
            a, b = int(pair.a[1:]), int(pair.b[1:])
            nearest = ContactSolver(sizes[a], sizes[b]).distance(where[a], where[b])
            if not nearest.colliding and nearest.distance <= margin:
                wanted[frozenset(pair[1:])] = nearest.distance
        assert found.keys() == wanted.keys()
        assert found == pytest.approx(wanted, rel=1e-9, abs=1e-8 if origin else 1e-15)
        close += len(found)
    assert close > 20


def test_the_only_pair_is_close_up_to_the_margin():
    """To the bit of the margin."""
    scene = two_boxes(poses.CUBE, poses.CUBE)
    for gap, listed in ((0.25, 1), (np.nextafter(2.25, 3) - 2.0, 0), (0.0, 0)):
        answer = SceneSolver(scene, model='exact', margin=0.25)(
            [poses.IDENTITY, np.array([2.0 + gap, 0, 0, 0, 0, 0, 1])])
        assert len(answer.near) == listed
        assert answer.touching == (gap == 0.0)
    with pytest.raises(ValueError, match='margin must lie within 0 and 1e.50 m, not -1'):
        SceneSolver(scene, margin=-1.0)


def test_a_yard_leaves_few_pairs():
    """1,000 pairs: a load that hangs clear is near none, one that is set down near its stack."""
    scene = yard()
    solver = SceneSolver(scene, model='exact')
    high = np.array([63.0, 27.0, 20.0, 0, 0, 0, 1.0])
    assert solver([high]).candidates == 0
    down = np.array([63.5, 27.0, 4.5 * 2.591 + 0.5 * 2.591 - 0.01, 0, 0, 0, 1.0])
    answer = solver([down])
    assert 0 < answer.candidates < 10
    assert_same(answer, alone(scene, {'load': down}))
    assert answer.touching == 1


def test_a_hundred_thousand_boxes():
    """They become a scene in seconds: the time goes with their number, not with its square."""
    n, begin = 100_000, time.process_time()
    boxes = {f'box{k}': Box((1.0, 1.0, 1.0), (2.0 * k, 0, 0, 0, 0, 0, 1) if k % 2 else None)
             for k in range(n)}
    scene = Scene(boxes, patterns=EVERY_PAIR, poses='named')
    SceneSolver(scene)
    fixed = n // 2
    assert scene.pair_count == n * (n - 1) // 2 - fixed * (fixed - 1) // 2
    assert time.process_time() - begin < 15.0


def test_one_pair_with_a_fixed_box():
    scene = Scene({'floor': Box((10, 10, 1), (0, 0, -0.5, 0, 0, 0, 1)),
                   'load': Box((1, 1, 1), pose_topic='load/pose')},
                  (Pair('down', 'floor', 'load'),))
    solver = SceneSolver(scene, model='exact')
    (pair, contact), = solver([np.array([1.0, 2.0, 0.4, 0, 0, 0, 1])]).named()
    assert pair.name == 'down' and contact.normal.tolist() == [0, 0, 1]
    assert contact.separation == pytest.approx(-0.1)
    assert contact.point == pytest.approx([1, 2, -0.05])
    assert stale_pairs(solver([None])) == [pair]


@pytest.mark.parametrize('pose, words', [
    ((math.nan, 5, 0, 0, 0, 0, 1), 'is not finite'), ((1e60, 0, 0, 0, 0, 0, 1), 'exceeds'),
    ((0, 0, 0, 0, 0, 0, 0), 'zero length')])
def test_numbers_that_are_no_pose_are_refused(pose, words):
    """With many pairs as with one; NaN was near nothing, and so "no contact"."""
    scene = yard()
    solver = SceneSolver(scene, model='exact')
    with pytest.raises(ValueError, match=f'pose of load: .*{words}'):
        solver([np.array(pose, dtype=float)])
    assert len(solver([None]).stale) == len(scene.pairs)
    assert solver([np.array([63.0, 27.0, 20.0, 0, 0, 0, 1.0])]).candidates == 0


@pytest.mark.parametrize('bad', [
    5.0, [1.0], '1', [True] * 7, ['0'] * 7, [1j] * 7, [10**400] * 7, np.ones((1, 7)), np.ones(8),
    np.array(1.0), np.ones((7, 3)),
    np.array(['2020'] * 7, 'datetime64[Y]')], ids=repr)
@pytest.mark.parametrize('pairs', [1, 2])
def test_what_is_no_pose_is_refused(bad, pairs):
    """With many pairs as with one: nothing is broadcast, and text is no number."""
    boxes = {name: Box((1.0, 1.0, 1.0), pose_topic=name) for name in 'abc'[:pairs + 1]}
    scene = Scene(boxes, (Pair('ab', 'a', 'b'), Pair('bc', 'b', 'c'))[:pairs])
    with pytest.raises(ValueError, match='pose'):
        SceneSolver(scene, model='exact')([bad] + [poses.IDENTITY] * pairs)


def test_a_name_is_no_longer_than_ros_takes():
    """Made names of pairs may be: they are two names."""
    def scene(a, name, frame_id=''):
        return Scene({each: Box((1, 1, 1)) for each in (a, 'b')}, (Pair(name, a, 'b'),),
                     frame_id)

    assert scene('a' * 255, f'{"a" * 255}_b').pairs[0].label.endswith('a_b')
    for arguments, words in ((('a' * 256, ''), r"boxes: 'aaa.* has 256 bytes, more than 255"),
                             (('a', 'p' * 256), r"pairs\[0\].name: 'ppp"),
                             (('a', '', 'ö' * 128), "frame_id: 'ööö")):
        with pytest.raises(ValueError, match=words):
            scene(*arguments)


class Table:
    """Rows of numbers that are neither an array nor a list, as pandas has them."""

    def __array__(self, *_, **__):
        return np.array([IDENTITY, IDENTITY], float)


def test_a_tick_takes_what_numpy_reads():
    """Each row is a pose."""
    solver = SceneSolver(two_boxes((1, 1, 1), (1, 1, 1)))
    poses.assert_same_bits(solver(Table()).contacts, solver([IDENTITY] * 2).contacts)


@pytest.mark.parametrize('size, pose', [
    ((1, 2, 3), (0, 0, 0, 0, 0, 0, 1)), ([1.0, 2.0, 3.0], [0, 0, 0, 0, 0, 0, 1]),
    (np.array([1, 2, 3]), np.array([0, 0, 0, 0, 0, 0, 1], np.float32))])
def test_a_box_takes_numbers_of_any_kind(size, pose):
    """And keeps its own."""
    box = Box(size, pose)
    assert box == Box((1.0, 2.0, 3.0), (0.0,) * 6 + (1.0,)) and hash(box)
    assert Box(size).pose is None


@pytest.mark.parametrize('key, value, reason', [
    ('size', (1, 2, -3), '(1, 2, -3) is not positive'), ('size', (1, 2), 'must be full extents'),
    ('size', ('1', '1', '1'), 'must be full extents'), ('size', (1, 2, 10**60), 'is outside'),
    ('pose', (0,) * 7, 'has zero length'), ('pose', (0,) * 6, 'must be a pose'),
    ('pose', '0000001', 'must be a pose')])
def test_a_scene_file_refuses_a_box_in_the_words_of_box(tmp_path, key, value, reason):
    """But for what the schema refuses first: kinds and lengths."""
    with pytest.raises(SceneError) as refused:
        Box(**{'size': (1, 1, 1)} | {key: value})
    fault = refused.value
    assert fault.path == (key,) and reason in fault.reason
    assert str(fault) == f'{key}: {fault.reason}'
    assert str(pickle.loads(pickle.dumps(fault))) == str(fault)
    path = tmp_path / 'scene.yaml'
    entry = {'size': [1, 1, 1]} | {key: list(value)}
    path.write_text(f'boxes: {{a: {{size: [1, 1, 1]}}, b: {entry}}}\npairs: all')
    with pytest.raises(SceneError) as of_file:
        read_scene(path)
    assert of_file.value.path[:3] == ('boxes', 'b', key)
    if not fault.reason.startswith('must') and min(value) >= 0:
        assert str(of_file.value) == f'{path}: boxes.b.{key}: {fault.reason}'


def test_two_boxes_is_the_solver():
    rng = np.random.default_rng(2)
    solver = SceneSolver(two_boxes(poses.CUBE, poses.CONTAINER))
    single = ContactSolver(poses.CUBE, poses.CONTAINER)
    for a, b in zip(*poses.random_pairs(rng, 200)[:2]):
        answer, wanted = solver([a, b]), single(a, b)
        assert answer.touching == wanted.colliding
        if wanted.colliding:
            assert np.array_equal(answer.contacts.point[0], wanted.point)


class Upwards:
    """A model of a user's own: the answers of exact, every normal upwards."""

    def solve(self, a, b, size_a, size_b, threads=1):
        exact = native.Exact()
        contacts, refused = exact.solve(a, b, size_a, size_b, threads)
        return replace(contacts, normal=np.tile([0.0, 0, 1], (len(a), 1))), refused


def test_a_model_object_answers_a_scene():
    scene = Scene({name: Box(poses.CUBE) for name in 'abc'}, patterns=EVERY_PAIR)
    answer = SceneSolver(scene, model=Upwards())(
        [poses.IDENTITY, np.array([1.9, 0, 0, 0, 0, 0, 1]), None])
    assert answer.pairs.tolist() == [[0, 1]] and answer.contacts.normal.tolist() == [[0, 0, 1]]


def test_a_solver_can_be_copied_and_pickled():
    scene = Scene({name: Box(poses.CUBE) for name in 'ab'}, patterns=EVERY_PAIR)
    solver = SceneSolver(scene, model='exact', margin=1.0)
    where = [poses.IDENTITY, np.array([2.5, 0, 0, 0, 0, 0, 1])]
    for twin in (copy.deepcopy(solver), pickle.loads(pickle.dumps(solver))):
        assert near_pairs(twin(where))[0][1].distance == solver(where).near.distance[0] == 0.5


def test_models_that_do_not_know_a_size_refuse_the_scene():
    with pytest.raises(ValueError, match='model'):
        SceneSolver(yard(1, 2, 2), model='nothing')
    with pytest.raises(ValueError, match="use model 'exact'"):
        SceneSolver(two_boxes((1, 2, 3), (1, 2, 3)), model=make_model('paper'))

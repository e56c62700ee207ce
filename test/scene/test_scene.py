# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scenes: what a tick computes against every pair by itself, and files that are refused."""
from __future__ import annotations

import json
import math
import os
import time
from pathlib import Path

import numpy as np
import poses
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from box_contact_ros import ContactSolver
from box_contact_ros.core import native
from box_contact_ros.scene import scene_solver
from box_contact_ros.scene.files import scene_file
from box_contact_ros.scene.files.scene_file import SceneError, parse_scene, read_scene
from box_contact_ros.scene.scene_solver import Box, Pair, Scene, SceneSolver, two_boxes
from box_contact_ros.solver.checks import SHOWN

IDENTITY = (0, 0, 0, 0, 0, 0, 1)


def yard(columns=10, rows=20, tiers=5):
    """Containers in a yard, and one that hangs: 1,000 pairs. Columns 12.7 m, rows 2.7 m apart."""
    boxes = {'load': Box('load', poses.CONTAINER, pose_topic='load/pose')}
    for n, (i, j, k) in enumerate(np.ndindex(columns, rows, tiers)):
        boxes[f's{n}'] = Box(f's{n}', poses.CONTAINER, (12.7 * i, 2.7 * j, 2.591 * k, 0, 0, 0, 1))
    return Scene(boxes, tuple(Pair(n, f'load_s{n}', f's{n}', 'load')
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
            found[pair.id] = contact
    return found


def assert_same(answer, wanted):
    assert {pair.id for pair, _ in answer.touching} == set(wanted)
    for pair, contact in answer.touching:
        other = wanted[pair.id]
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
        boxes = {f'b{i}': Box(f'b{i}', tuple(sizes[i]), tuple(where[i]) if i % 3 == 0 else None,
                              '' if i % 3 == 0 else f'b{i}/pose') for i in range(n)}
        pairs = tuple(Pair(10 * i + j, f'p{i}{j}', f'b{i}', f'b{j}') for i in range(n)
                      for j in range(i) if (i % 3 or j % 3) and rng.random() < 0.5)
        scene = Scene(boxes, pairs)
        solver = SceneSolver(scene, model=model)
        missing = f'b{rng.choice([1, 2, 4])}'
        given_poses = {name: None if name == missing else where[int(name[1:])]
                       for name in scene.moving}
        answer = solver([given_poses[name] for name in scene.moving])
        assert_same(answer, alone(scene, given_poses, model))
        assert answer.stale == [pair for pair in pairs if missing in (pair.a, pair.b)]
        contacts += len(answer.touching)
        stale += len(answer.stale)
        left_out += len(pairs) - len(answer.stale) - answer.near
    assert contacts > 50 and stale > 30 and left_out > 50


@pytest.mark.parametrize('swept_from', [0, 64])
@pytest.mark.parametrize('origin', [0.0, 5e6])
def test_close_pairs_are_those_within_the_margin(swept_from, origin, monkeypatch):
    """Of every pair alone: apart, and by at most the margin. Pairs in contact stay as they are."""
    monkeypatch.setattr(scene_solver, 'SWEPT_FROM', swept_from)
    rng = np.random.default_rng(5)
    close = 0
    for margin in (0.1, 0.5, 1.0):
        n = 40
        sizes = np.exp(rng.uniform(-1, 1, (n, 3)))
        where = np.hstack((origin + rng.uniform(-6, 6, (n, 3)), poses.unit_quaternions(rng, n)))
        boxes = {f'b{i}': Box(f'b{i}', tuple(sizes[i]), pose_topic=f'b{i}/pose') for i in range(n)}
        pairs = tuple(Pair.between(f'b{i}', f'b{j}') for i in range(n) for j in range(i))
        solver = SceneSolver(Scene(boxes, pairs), model='exact', margin=margin)
        answer, plain = solver(where), SceneSolver(Scene(boxes, pairs), model='exact')(where)
        assert [pair for pair, _ in answer.touching] == [pair for pair, _ in plain.touching]
        found = {pair.name: contact.separation for pair, contact in answer.close}
        assert all(abs(np.linalg.norm(contact.normal) - 1) < 1e-12 for _, contact in answer.close)
        wanted = {}
        for pair in pairs:
            a, b = int(pair.a[1:]), int(pair.b[1:])
            contact = ContactSolver(sizes[a], sizes[b], model='exact')(where[a], where[b])
            if not contact.colliding and contact.separation <= margin:
                wanted[pair.name] = contact.separation
        assert found.keys() == wanted.keys()
        assert found == pytest.approx(wanted, rel=1e-9, abs=1e-8 if origin else 1e-15)
        close += len(found)
    assert close > 20 and not plain.close


def test_the_only_pair_is_close_up_to_the_margin():
    """To the bit of the margin; a scene of one pair has a shorter way."""
    scene = two_boxes(poses.CUBE, poses.CUBE)
    for gap, listed in ((0.25, 1), (np.nextafter(2.25, 3) - 2.0, 0), (0.0, 0)):
        answer = SceneSolver(scene, model='exact', margin=0.25)(
            [poses.IDENTITY, np.array([2.0 + gap, 0, 0, 0, 0, 0, 1])])
        assert len(answer.close) == listed and len(answer.touching) == (gap == 0.0)
    with pytest.raises(ValueError, match='margin must lie within 0 and 1e.50 m, not -1'):
        SceneSolver(scene, margin=-1.0)


def test_no_touching_pair_is_left_out():
    """All stored hard poses, exact touch included: what touches by SAT is near."""
    hard_poses = pytest.importorskip('benchmarks.hard_poses')
    touching = 0
    for entry in hard_poses.load().values():
        cases = entry.pairs
        n = len(cases.pose_a)
        where = np.empty((2 * n, 7))
        size = np.empty((2 * n, 3))
        where[0::2], where[1::2] = cases.pose_a, cases.pose_b
        size[0::2], size[1::2] = cases.size_a, cases.size_b
        near, unknown = np.empty((2, n), dtype=np.int64)
        count, none = native.near_pairs(
            where, size, np.arange(2 * n), np.empty((2 * n, 3)), np.empty((2 * n, 3)),
            np.ones(2 * n, dtype=bool), np.arange(0, 2 * n, 2), np.arange(1, 2 * n, 2), near,
            unknown)
        found = ContactSolver((1, 1, 1), (1, 1, 1), model='exact').batch(
            cases.pose_a, cases.pose_b, size_a=cases.size_a, size_b=cases.size_b)
        assert none == 0
        assert set(np.flatnonzero(found.colliding)) <= set(near[:count])
        touching += found.colliding.sum()
    assert touching > 500


def test_a_yard_leaves_few_pairs():
    """1,000 pairs: a load that hangs clear is near none, one that is set down near its stack."""
    scene = yard()
    solver = SceneSolver(scene, model='exact')
    high = np.array([63.0, 27.0, 20.0, 0, 0, 0, 1.0])
    assert solver([high]).near == 0
    down = np.array([63.5, 27.0, 4.5 * 2.591 + 0.5 * 2.591 - 0.01, 0, 0, 0, 1.0])
    answer = solver([down])
    assert 0 < answer.near < 10
    assert_same(answer, alone(scene, {'load': down}))
    assert len(answer.touching) == 1


def test_one_pair_with_a_fixed_box():
    scene = Scene({'floor': Box('floor', (10, 10, 1), (0, 0, -0.5, 0, 0, 0, 1)),
                   'load': Box('load', (1, 1, 1), pose_topic='load/pose')},
                  (Pair(7, 'down', 'floor', 'load'),))
    solver = SceneSolver(scene, model='exact')
    (pair, contact), = solver([np.array([1.0, 2.0, 0.4, 0, 0, 0, 1])]).touching
    assert pair.id == 7 and contact.normal.tolist() == [0, 0, 1]
    assert contact.separation == pytest.approx(-0.1)
    assert contact.point == pytest.approx([1, 2, -0.05])
    assert solver([None]).stale == [pair]


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
    assert solver([np.array([63.0, 27.0, 20.0, 0, 0, 0, 1.0])]).near == 0


@pytest.mark.parametrize('bad', [
    5.0, [1.0], '1', [True] * 7, ['0'] * 7, [1j] * 7, [10**400] * 7, np.ones((1, 7)), np.ones(8),
    np.array(1.0), np.ones((7, 3)),
    np.array(['2020'] * 7, 'datetime64[Y]')], ids=repr)
@pytest.mark.parametrize('pairs', [1, 2])
def test_what_is_no_pose_is_refused(bad, pairs):
    """With many pairs as with one: nothing is broadcast, and text is no number."""
    boxes = {name: Box(name, (1.0, 1.0, 1.0), pose_topic=name) for name in 'abc'[:pairs + 1]}
    scene = Scene(boxes, (Pair(0, 'ab', 'a', 'b'), Pair(1, 'bc', 'b', 'c'))[:pairs])
    with pytest.raises(ValueError, match='pose'):
        SceneSolver(scene, model='exact')([bad] + [poses.IDENTITY] * pairs)


def test_numbers_as_json_writes_them(tmp_path):
    """1e-05, which YAML 1.1 takes for a word; and a file may be named by a Path."""
    text = json.dumps({'boxes': {'a': {'size': [1e16, 1.5e-3, 1]}, 'b': {
        'size': [1, 1, 1], 'pose': [0, -1e-05, 1e22, 0, 0, 0, 1]}},
        'pairs': [{'id': 0, 'name': 'ab', 'a': 'a', 'b': 'b'}]})
    assert 'e-05' in text and 'e+16' in text
    (tmp_path / 'scene.json').write_text(text)
    for scene in (parse_scene(text), read_scene(tmp_path / 'scene.json')):
        assert scene.boxes['a'].size == (1e16, 1.5e-3, 1.0)
        assert scene.boxes['b'].pose == (0, -1e-05, 1e22, 0, 0, 0, 1)


@pytest.mark.parametrize(('text', 'extent'), [
    ('010', 10.0), ('0x10', 16.0), ('0o17', 15.0), ('+2.5e1', 25.0), ('.5', 0.5)])
def test_numbers_are_those_of_yaml_1_2(text, extent):
    """In YAML 1.1, 010 is eight."""
    scene = read_scene(GOOD.replace('[6, 2.4, 0.5]', f'[{text}, 2.4, 0.5]'))
    assert extent in {box.size[0] for box in scene.boxes.values()}


@pytest.mark.parametrize('text', ['1:30', '1_000', 'no', '1' * 5000, '2001-01-01', '.nan'])
def test_what_is_no_number_in_yaml_1_2_is_refused(text):
    """1:30 is ninety in YAML 1.1, and takes time that is quadratic in its length."""
    with pytest.raises(SceneError, match='size'):
        read_scene(GOOD.replace('[6, 2.4, 0.5]', f'[{text}, 2.4, 0.5]'))


def test_a_text_of_millions_of_values_is_refused_soon():
    """Megabytes of zeros: they took a minute and gigabytes."""
    started = time.monotonic()
    with pytest.raises(SceneError, match='more than 1200000 values'):
        parse_scene('{boxes: [' + 7_000_000 * '0,' + '0]}')
    assert time.monotonic() - started < 20.0


@pytest.mark.parametrize('pairs', [1, 2])
def test_as_many_poses_as_boxes_that_move(pairs):
    boxes = {name: Box(name, (1.0, 1.0, 1.0), pose_topic=name) for name in 'abc'[:pairs + 1]}
    scene = Scene(boxes, (Pair(0, 'ab', 'a', 'b'), Pair(1, 'bc', 'b', 'c'))[:pairs])
    solver = SceneSolver(scene, model='exact')
    assert len(solver([None] * (pairs + 1)).stale) == pairs
    for count in (pairs, pairs + 2):
        with pytest.raises(ValueError, match=f"{count} poses, but {pairs + 1} boxes move: .'a'"):
            solver([poses.IDENTITY] * count)


def test_a_pair_that_is_listed_twice_is_refused():
    pair = Pair.between('a', 'b')
    with pytest.raises(ValueError, match=r"pairs\[1\].id: the same id as that of 'a' and 'b'"):
        Scene({name: Box(name, (1, 1, 1)) for name in 'ab'}, (pair, pair))


def test_two_boxes_is_the_solver():
    rng = np.random.default_rng(2)
    solver = SceneSolver(two_boxes(poses.CUBE, poses.CONTAINER))
    single = ContactSolver(poses.CUBE, poses.CONTAINER)
    for a, b in zip(*poses.random_pairs(rng, 200)[:2]):
        answer, wanted = solver([a, b]), single(a, b)
        assert len(answer.touching) == wanted.colliding
        if wanted.colliding:
            assert np.array_equal(answer.touching[0][1].point, wanted.point)


def test_models_that_do_not_know_a_size_refuse_the_scene():
    with pytest.raises(ValueError, match='model'):
        SceneSolver(yard(1, 2, 2), model='nothing')
    with pytest.raises(ValueError, match="use model 'exact'"):
        SceneSolver(two_boxes((1, 2, 3), (1, 2, 3)), model='paper')


# --- files ----------------------------------------------------------------------------------------

GOOD = """\
frame_id: map
boxes:
  load: {size: [12.192, 2.438, 2.591]}
  spreader:
    size: [6, 2.4, 0.5]
    pose_topic: /crane/spreader
  s1:
    size: [12.192, 2.438, 2.591]
    pose: [0, 0, 1.2955, 0, 0, 0, 1]
pairs:
  - {id: 0, name: load_s1, a: load, b: s1}
  - {id: 4, name: grip, a: spreader, b: load}
"""


def test_a_good_file(tmp_path):
    path = tmp_path / 'scene.yaml'
    path.write_text(GOOD)
    scene = read_scene(str(path))
    assert scene == read_scene(GOOD)  # as text
    assert scene == read_scene(json.dumps({
        'frame_id': 'map', 'pairs': [{'id': 0, 'name': 'load_s1', 'a': 'load', 'b': 's1'},
                                     {'id': 4, 'name': 'grip', 'a': 'spreader', 'b': 'load'}],
        'boxes': {'load': {'size': [12.192, 2.438, 2.591]},
                  'spreader': {'size': [6, 2.4, 0.5], 'pose_topic': '/crane/spreader'},
                  's1': {'size': [12.192, 2.438, 2.591],
                         'pose': [0, 0, 1.2955, 0, 0, 0, 1]}}}))
    assert scene.moving == ('load', 'spreader') and scene.frame_id == 'map'
    assert scene.boxes['load'].pose_topic == 'load/pose'
    assert scene.boxes['s1'].pose == (0, 0, 1.2955, 0, 0, 0, 1)
    assert scene.pairs[1] == Pair(4, 'grip', 'spreader', 'load')


def test_a_box_in_no_pair_is_not_listened_to():
    scene = parse_scene(GOOD.replace('  - {id: 4, name: grip, a: spreader, b: load}\n', ''))
    assert scene.moving == ('load',)


@pytest.mark.parametrize('old, new, words', [
    ('[6, 2.4, 0.5]', '[6, 2.4, -0.5]', ':5: boxes.spreader.size[2]: -0.5 is not positive'),
    ('[6, 2.4, 0.5]', '[6, 2.4]', ':5: boxes.spreader.size: must be 3 numbers, not [6, 2.4]'),
    ('[6, 2.4, 0.5]', '[6, 2.4, .nan]', ':5: boxes.spreader.size: (6, 2.4, nan) is not finite'),
    ('[6, 2.4, 0.5]', '[6, 2.4, wide]', ":5: boxes.spreader.size[2]: 'wide' is not a number"),
    ('[6, 2.4, 0.5]', '[6, 2.4, true]', ':5: boxes.spreader.size[2]: True is not a number'),
    ('[6, 2.4, 0.5]', f'[6, 2.4, {"9" * 400}]', ':4: boxes.spreader: a number is too large'),
    ('[0, 0, 1.2955, 0, 0, 0, 1]', '[0, 0, 1, 0, 0, 0, 0]', ':9: boxes.s1.pose: quaternion'),
    ('pose_topic: /crane/spreader', 'pose_topic: 2 crane', ':6: boxes.spreader.pose_topic: '),
    ('pose_topic: /crane/spreader', 'colour: red', ':4: boxes.spreader: Additional properties'),
    ('    pose_topic: /crane/spreader\n', '    pose_topic: a\n    pose: [0, 0, 0, 0, 0, 0, 1]\n',
     ':4: boxes.spreader: has both pose'),
    ('pose_topic: /crane/spreader', 'size: [1, 1, 1]', ':6: boxes.spreader.size: is there twice'),
    ('size: [6, 2.4, 0.5]', 'size: &s [6, 2.4, 0.5]\n    pose: *s', 'anchors and aliases'),
    ('size: [6, 2.4, 0.5]', 'size: [&s 6, 2.4, 0.5]', 'anchors and aliases'),
    ('size: [6, 2.4, 0.5]', 'size: [!!float 6, 2.4, 0.5]', 'tag'),
    ('size: [6, 2.4, 0.5]', 'size: [!!int "", 2.4, 0.5]', 'tag'),
    ('size: [6, 2.4, 0.5]', 'size: [!!bool foo, 2.4, 0.5]', 'tag'),
    ('size: [6, 2.4, 0.5]', 'size: !!python/tuple [6, 2.4, 0.5]', ':5: '),
    ('a: spreader', 'a: lorry', ":12: pairs[1].a: 'lorry' is none of the boxes"),
    ('a: spreader', 'a: load', ":12: pairs[1].b: 'load' is the same box as a"),
    ('id: 4', 'id: 0', ":12: pairs[1].id: the same id as that of 'load' and 's1'"),
    ('id: 4', 'id: 4294967296', ':12: pairs[1].id: 4294967296'),
    ('id: 4', 'id: four', ":12: pairs[1].id: 'four' is not a whole number"),
    ('name: grip', 'name: load_s1', ":12: pairs[1].name: the same name as that of 'load'"),
    ('name: grip', 'name: "grip\\n"', ":12: pairs[1].name: 'grip\\n' is no name"),
    ('name: grip', 'name: load/s1', ":12: pairs[1].name: 'load/s1' is no name"),
    ('a: spreader, b: load', 'a: s1, b: load', ':12: pairs[1]: the same pair of boxes as that'),
    ('  load: {size: [12.192, 2.438, 2.591]}', '  load: {size: [1, 1, 1], pose: '
     '[0, 0, 9, 0, 0, 0, 1]}', ":11: pairs[0]: 'load' and 's1' are both fixed"),
    ('frame_id: map', 'frame_id: 7', ':1: frame_id: 7 is not a string'),
    ('boxes:', 'bodies:', "'bodies' was unexpected"),
    ('boxes:', 'boxes: [', 'not YAML'),
    (GOOD, '', ': is empty'), (GOOD, '7\n', '7 is not a mapping'),
    (GOOD, 'boxes: {b: {size: [1, 1, 1]}}\npairs: []\n', ':2: pairs: '),
    (GOOD, '\n' + '[' * 100_000, ':2: nested too deeply')])
def test_a_refusal_names_line_and_field(old, new, words, tmp_path):
    assert old in GOOD
    path = tmp_path / 'scene.yaml'
    path.write_text(GOOD.replace(old, new, 1))
    with pytest.raises(SceneError) as refused:
        read_scene(str(path))
    assert words in str(refused.value) and str(refused.value).startswith(str(path))
    assert len(str(refused.value)) < 3 * SHOWN + len(str(path))


@pytest.mark.parametrize('pairs, words', [
    ((), 'pairs: a scene needs at least one pair'),
    ((Pair(2**32, 'p', 'a', 'b'),), r'pairs\[0\].id: 4294967296 is outside 0 to 4294967295'),
    ((Pair(0, 'p', 'a', 'c'),), r"pairs\[0\].b: 'c' is none of the boxes")])
def test_a_scene_made_in_python_is_checked_too(pairs, words):
    boxes = {name: Box(name, poses.CUBE, pose_topic=f'{name}/pose') for name in 'ab'}
    with pytest.raises(ValueError, match=words):
        Scene(boxes, pairs)


def test_files_that_cannot_be_read(tmp_path, monkeypatch):
    (tmp_path / 'latin').write_bytes(b'boxes: \xff')
    fifo = tmp_path / 'fifo'  # opening it would wait for a writer
    os.mkfifo(fifo)
    for source, words in ((tmp_path / 'none.yaml', 'cannot be read: No such file'),
                          (tmp_path, 'cannot be read: Is a directory'),
                          (tmp_path / 'latin', 'not UTF-8 at byte 7'),
                          ('a\0b', 'cannot be read'), ('x' * 10_000, 'cannot be read'),
                          (fifo, 'no regular file'), ('{\ud800}', 'not UTF-8')):
        with pytest.raises(SceneError, match=words):
            read_scene(str(source))
    monkeypatch.setattr(scene_file, 'LARGEST_FILE', 6)
    with pytest.raises(SceneError, match='larger than 6 bytes'):
        read_scene(str(tmp_path / 'latin'))


SHORT_FORMS = """\
{poses: array, types: {t: {size: [1, 1, 1]}}, boxes: {m: {type: t, count: 3}, s: {stack: {type: t,
rows: 2, columns: 5, tiers: [1, 3], gap: 0.1, origin: [0, 0, 6]}}},
pairs: [{moving: all, fixed: s}]}
"""
SHORT = ['array', '{t: {size: [1, 1, 1]}}', '[1, 1, 1]', '3', '2', '5', '[1, 3]', '0.1',
         '[0, 0, 6]', 'all', 'fixed: s', '{moving', 'type: t', 't']
JSON = st.recursive(st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=8),
                    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(
                        st.sampled_from(['boxes', 'pairs', 'size', 'pose', 'id', 'name', 'a', 'b',
                                         'types', 'type', 'stack', 'rows', 'tiers', 'count',
                                         'moving', 'fixed', 'poses', 'gap', 'origin']),
                        inner, max_size=4), max_leaves=12)


@settings(deadline=None)
@given(st.one_of(st.text(max_size=200), JSON.map(json.dumps),
                 st.tuples(st.integers(0, len(GOOD)), st.text(max_size=5)).map(
                     lambda edit: GOOD[:edit[0]] + edit[1] + GOOD[edit[0]:]),
                 st.tuples(st.sampled_from(SHORT), JSON).map(
                     lambda edit: SHORT_FORMS.replace(edit[0], json.dumps(edit[1])))))
def test_any_text_is_a_scene_or_refused(text):
    """Nothing but SceneError comes out, and what is a scene can be computed."""
    try:
        scene = parse_scene(text)
    except SceneError:
        return
    assert scene.pairs and set(scene.moving) <= set(scene.boxes)


def test_shipped_scenes_are_good():
    """config/scenes: each can be computed."""
    for path in (Path(__file__).parents[2] / 'config' / 'scenes').glob('*.yaml'):
        SceneSolver(read_scene(str(path)), model='exact')

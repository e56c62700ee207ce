# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Short forms of scene files: what they mean, what is refused, and scenes written to files."""
from __future__ import annotations

import resource
import time
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from box_contact_ros.scene.files import short_forms
from box_contact_ros.scene.files.limits import FOREIGN, MOST_STREAMS, OWN
from box_contact_ros.scene.files.scene_check import meaning
from box_contact_ros.scene.files.scene_file import (
    SceneError,
    parse_scene,
    read_scene,
    write_scene,
)
from box_contact_ros.scene.scene_solver import LARGEST_ID, Box, Pair, Scene, SceneSolver, two_boxes

LISTED = Path(__file__).with_name('listed_yard_bay.yaml')
"""The shipped yard bay without short forms; its pairs are those that the load can reach."""
FLEET = """\
types: {crate: {size: [1, 2, 3]}}
boxes:
  crane: {size: [4, 4, 4]}
  m: {type: crate, count: 3}
  s: {stack: {type: crate, rows: 2, columns: 2, tiers: [2, 1], gap: 0.5, origin: [10, 20, 30]}}
pairs:
  - {moving: all, fixed: all}
"""


def contacts(solver, pose, names):
    """Return what a load in a pose touches, by the pair's name."""
    return {pair.name: (contact.separation, *contact.normal, *contact.point)
            for pair, contact in solver([pose]).touching if pair.name in names}


def test_the_short_yard_bay_means_the_listed_one():
    """Boxes are the same to the bit, and the listed pairs have the same contacts.

    The pattern has further pairs: containers below others, which the broad phase leaves out.
    """
    listed, short = read_scene(LISTED), read_scene('config/scenes/yard_bay.yaml')
    assert list(short.boxes.items()) == list(listed.boxes.items())
    assert (short.frame_id, short.moving) == (listed.frame_id, listed.moving)
    names = {pair.name: (pair.a, pair.b) for pair in listed.pairs}
    assert names.items() <= {pair.name: (pair.a, pair.b) for pair in short.pairs}.items()
    assert len(short.pairs) == 50
    solvers = [SceneSolver(scene, model='exact') for scene in (listed, short)]
    rng = np.random.default_rng(22)
    touched = set()
    for row, height in enumerate((5, 4, 5, 3, 4, 5, 4, 3, 5, 4, 5, 3)):
        for _ in range(10):
            pose = np.array([*rng.uniform(-0.6, 0.6, 2), 0, *rng.normal(0, 1e-3, 3), 1])
            pose[1:3] += 2.838 * row, 2.591 * (height + 0.5) - 0.01
            one, other = (contacts(solver, pose, names) for solver in solvers)
            assert one == other
            touched |= one.keys()
    assert touched == names.keys()


def test_names_sizes_and_places():
    scene = parse_scene(FLEET)
    assert list(scene.boxes) == ['crane', 'm01', 'm02', 'm03', 's01_c01_t1', 's01_c01_t2',
                                 's01_c02_t1', 's01_c02_t2', 's02_c01_t1', 's02_c02_t1']
    assert {box.size for name, box in scene.boxes.items() if name != 'crane'} == {(1, 2, 3)}
    assert scene.boxes['m02'].pose_topic == 'm02/pose'
    place = {name: box.pose[:3] for name, box in scene.boxes.items() if box.pose}
    assert place['s01_c01_t1'] == (10, 20, 31.5) and place['s01_c02_t2'] == (11.5, 20, 34.5)
    assert place['s02_c01_t1'] == (10, 22.5, 31.5)
    assert [(pair.a, pair.b) for pair in scene.pairs] == [
        (a, b) for a in ('crane', 'm01', 'm02', 'm03') for b in place]


def test_a_stack_that_grows_renames_no_box():
    """And no pair: ids follow from names, whatever else the scene has."""
    small = parse_scene(FLEET)
    large = parse_scene(FLEET.replace('rows: 2, columns: 2, tiers: [2, 1]',
                                      'rows: 101, columns: 3, tiers: 2').replace('t: 3', 't: 101'))
    assert set(small.pairs) <= set(large.pairs) and set(small.boxes) <= set(large.boxes)
    for pair in small.pairs:
        assert pair == Pair.between(pair.a, pair.b)
        assert pair.id == zlib.crc32(f'{pair.a}_{pair.b}'.encode())


@pytest.mark.parametrize('pairs, wanted', [
    ("{a: '*', b: '*'}", 'ab ac ad bc bd'), ("{a: '?', b: a}", 'ba ca da'),
    ("{moving: '*', fixed: all}", 'ac ad bc bd'), ("{moving: b, fixed: '[d-z]'}", 'bd'),
    ("{a: a, b: b}, {a: '*', b: '*'}", 'ab ac ad bc bd'),
    ("{a: '*', b: '*'}, {a: d, b: a, name: da, id: 3}", 'ab ac bc bd da'),
    ('{moving: a, fixed: all}, {moving: all, fixed: d}', 'ac ad bd')])
def test_patterns(pairs, wanted):
    """Every pair once, none of two fixed boxes; a pair that is listed keeps its name and order."""
    fixed = 'size: [1, 1, 1], pose: [0, 0, 0, 0, 0, 0, 1]'
    scene = parse_scene('{boxes: {a: {size: [1, 1, 1]}, b: {size: [1, 1, 1]}, '
                        f'c: {{{fixed}}}, d: {{{fixed}}}}}, pairs: [{pairs}]}}')
    assert sorted(pair.a + pair.b for pair in scene.pairs) == wanted.split()
    assert {pair.id for pair in scene.pairs if pair.name == 'da'} <= {3}


def test_names_of_one_checksum_get_two_ids(monkeypatch):
    """In the order of the file, and beside the ids that it gives; 2^32 is followed by 0."""
    monkeypatch.setattr(short_forms, 'id_of', lambda name: LARGEST_ID)
    scene = parse_scene(FLEET.replace('moving: all', 'moving: crane')
                        + '  - {a: crane, b: m01, id: 0}\n')
    assert [pair.id for pair in scene.pairs] == [LARGEST_ID, 1, 2, 3, 4, 5, 0]


@pytest.mark.parametrize('old, new, words', [
    ('type: crate, count', 'type: box, count', ":4: boxes.m.type: 'box' is none of the types"),
    ('type: crate, count: 3', 'type: crate, count: 3, pose_topic: a',
     ':4: boxes.m: has both pose_topic and count'),
    ('type: crate, count: 3', 'type: crate, size: [1, 1, 1]',
     ':4: boxes.m: needs one of: size; type; stack'),
    ('type: crate, count: 3', 'count: 3', ':4: boxes.m: needs one of: size; type; stack'),
    ('count: 3', 'count: 0', ':4: boxes.m.count: 0 is less than the minimum of 1'),
    ('crane: {', 's01_c01_t1: {', ":5: boxes.s: a box called 's01_c01_t1' is there twice"),
    ('[2, 1]', '[2, 1, 1]', ':5: boxes.s.stack.tiers: 3 numbers, but 2 rows'),
    ('[2, 1]', '-1', ':5: boxes.s.stack.tiers: -1 is less'),
    ('gap: 0.5', 'gap: -0.5', ':5: boxes.s.stack.gap: -0.5 is less'),
    ('gap: 0.5', 'gap: .inf', ':5: boxes.s.stack: a number is not finite'),
    ('gap: 0.5', f'gap: {"9" * 400}', ':5: boxes.s: a number is too large'),
    ('[10, 20, 30]', '[10, 20, 1e60]', ':5: boxes.s.pose: position'),
    ('[10, 20, 30]', '[10, 20]', ':5: boxes.s.stack.origin: must be 3 numbers, not [10, 20]'),
    ('[1, 2, 3]', '[1, 2, 1e60]', ':4: boxes.m.size: (1, 2, 1e+60) is outside'),
    ('moving: all', 'moving: lorry', ":7: pairs[0].moving: 'lorry' is none of the boxes"),
    ('moving: all', "moving: 's*'", ":7: pairs[0].moving: 's*' is the name of no moving box"),
    ('moving: all', "a: 'x*'", ':7: pairs[0]: needs one of: a and b; moving and fixed'),
    ('moving: all, fixed: all', "a: 'x*', b: m01", ":7: pairs[0].a: 'x*' is the name of no box"),
    ('moving: all, fixed: all', "a: 's*', b: 's*'", ':7: pairs[0]: no two boxes of this pattern'),
    ('moving: all, fixed: all', 'a: all, b: m01', ":7: pairs[0].a: 'all' is none of the boxes"),
    ('fixed: all', 'fixed: all, b: m01', ':7: pairs[0]: has both b and fixed'),
    ('fixed: all', 'fixed: all, id: 7', ':7: pairs[0].id: a pattern of pairs has no id'),
    ('boxes:', 'poses: list\nboxes:', ":2: poses: 'list' is not one of"),
    ('boxes:\n  crane: {', 'poses: array\nboxes:\n  crane: {pose_topic: a, ',
     ':4: boxes.crane.pose_topic: with poses: array'),
    ('boxes:\n  crane: {', 'poses: array\nboxes:\n  crane: {frame: a, ',
     ':4: boxes.crane.frame: with poses: array'),
    ('crane: {', 'crane: {frame: hook, ', ':3: boxes.crane.frame: the scene needs a frame_id'),
    ('boxes:\n  crane: {', 'frame_id: a\nboxes:\n  crane: {frame: a, ',
     ":4: boxes.crane.frame: 'a' is the frame_id of the scene: give the box a pose"),
    ('boxes:\n  crane: {', 'frame_id: a\nboxes:\n  crane: {frame: /b, ',
     ":4: boxes.crane.frame: '/b': names of frames in /tf begin with no slash"),
    ('boxes:\n  crane: {', 'frame_id: /a\nboxes:\n  crane: {frame: b, ',
     ":2: frame_id: '/a': names of frames in /tf begin with no slash"),
    ('crane: {', "crane: {frame: '', ", ":3: boxes.crane.frame: ''"),
    ('type: crate, count: 3', 'type: crate, count: 3, frame: a',
     ':4: boxes.m: has both frame and count'),
    ('crane: {', 'crane: {frame: a, pose_topic: a, ',
     ':3: boxes.crane: has both frame and pose_topic'),
    ('crane: {', 'crane: {frame: a, pose: [0, 0, 0, 0, 0, 0, 1], ',
     ':3: boxes.crane: has both frame and pose'),
    ('s: {stack', 's: {frame: a, stack', ':5: boxes.s: has both stack and frame')])
def test_a_refusal_of_a_short_form_names_line_and_field(old, new, words):
    assert old in FLEET
    with pytest.raises(SceneError) as refused:
        parse_scene(FLEET.replace(old, new, 1))
    assert str(refused.value).startswith(f'scene{words}')


def test_a_frame_in_tf(tmp_path):
    """Its box moves, has no topic, and is written and told as it was read."""
    scene = parse_scene('{frame_id: map, boxes: {a: {size: [1, 1, 1], frame: crane/hook}, '
                        'b: {size: [1, 1, 1]}, c: {size: [1, 1, 1], frame: unused}}, '
                        'pairs: [{a: a, b: b}]}')
    assert scene.moving == scene.streams == ('a', 'b')
    assert (scene.frames, scene.sources) == ({'a': 'crane/hook'}, {'b': 'b/pose'})
    write_scene(scene, tmp_path / 'scene.yaml')
    assert read_scene(tmp_path / 'scene.yaml') == scene
    told = list(meaning(scene))
    assert 'box a: 1 x 1 x 1 m, moves: frame crane/hook in /tf' in told
    assert 'topics in: 1 (b/pose)' in told
    assert 'frames in /tf: 1, which need tf2_ros' in told


def test_pairs_whose_names_run_together_are_refused():
    """(a, b_c) and (a_b, c) would both be a_b_c."""
    with pytest.raises(SceneError, match=r":1: pairs\[0\].name: the same name as that of 'a' and"):
        parse_scene('{boxes: {' + ', '.join(f'{name}: {{size: [1, 1, 1]}}' for name in (
            'a', 'b_c', 'a_b', 'c')) + "}, pairs: [{a: 'a*', b: '*c'}]}")


ONE = '{boxes: {m: {size: [1, 1, 1]}, s: {stack: {size: [1, 1, 1], '
NAMES = ', '.join(f'n{n}{"a" * 90}: {{size: [1, 1, 1]}}' for n in range(200))


@pytest.mark.parametrize('text, words', [
    (ONE + 'rows: 1000, columns: 1000, tiers: 1000}}}, pairs: [{a: m, b: "s*"}]}',
     'boxes: 1000000001 boxes are more than 100000'),
    (ONE + 'rows: 2, columns: 60000, tiers: [1, 1]}}}, pairs: [{a: m, b: "s*"}]}',
     'boxes: 120001 boxes'),
    ('{boxes: {m: {size: [1, 1, 1], count: 9000}}, pairs: [{a: "*", b: "*"}]}',
     'pairs: patterns of 81000000 pairs of boxes'),
    ('{boxes: {m: {size: [1, 1, 1], count: 900}}, pairs: ['
     + ', '.join(['{a: "*", b: "*"}'] * 99) + ']}', 'pairs: patterns of 80190000 pairs'),
    ('{boxes: {m: {size: [1, 1, 1], count: 9000}}, pairs: ['
     + ', '.join(f'{{a: "m{"?" * n}*", b: m01}}' for n in range(90) for _ in range(20)) + ']}',
     'is the name of no box'),
    (f'{{boxes: {{{NAMES}}}, pairs: [{{a: "{"*a" * 45}b", b: n1}}]}}', 'is the name of no box')],
    ids=['stack', 'rows', 'pairs', 'repeated', 'patterns', 'stars'])
def test_what_grows_without_bound_is_refused_before_it_is_built(text, words):
    """In seconds of this process, and without a list of all that was asked for."""
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    started = time.process_time()
    with pytest.raises(SceneError, match=words):
        parse_scene(text)
    assert time.process_time() - started < 10.0
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - memory < 100_000  # KiB


def test_comparisons_have_a_limit():
    with pytest.raises(SceneError, match=r'pairs\[1\].moving: more than 20 names'):
        parse_scene(FLEET + "  - {moving: 'm*', fixed: all}\n",
                    limits=replace(OWN, comparisons=20))


def fleet_of(count, *, array=False, pairs='{a: a01, b: a02}'):
    return (f'{{boxes: {{a: {{size: [1, 1, 1], count: {count}}}}}, '
            f'{"poses: array, " if array else ""}pairs: [{pairs}]}}')


def test_streams_have_a_limit():
    """A line asked every listener for a hundred thousand subscriptions."""
    many, all_of_them = MOST_STREAMS + 1, "{a: 'a*', b: a01}"
    assert len(parse_scene(fleet_of(MOST_STREAMS, pairs=all_of_them)).sources) == MOST_STREAMS
    with pytest.raises(SceneError, match=f'{many} boxes have a topic .* set poses: array'):
        parse_scene(fleet_of(many, pairs=all_of_them))
    assert len(parse_scene(fleet_of(many, pairs=all_of_them, array=True)).moving) == many
    frames = ', '.join(f'b{n}: {{size: [1, 1, 1], frame: f{n}}}' for n in range(many))
    with pytest.raises(SceneError, match=f'{many} boxes have a topic or a frame'):
        parse_scene(f"{{frame_id: map, boxes: {{{frames}}}, pairs: [{{a: 'b*', b: b0}}]}}")


@pytest.mark.parametrize('text, words', [
    ('{boxes: {' + ','.join(f'"k{n}":{{}}' for n in range(390_000)) + '}, pairs: []}',
     'more than 50000 values and brackets'),
    ('{boxes: [' + 1_190_000 * '1,' + '1], pairs: []}', 'more than 50000 values'),
    (fleet_of(100_000, array=True), 'boxes: 100000 boxes are more than 10000'),
    (fleet_of(1000, array=True, pairs="{a: 'a*', b: 'a*'}"),
     'patterns of 1000000 pairs of boxes: more than 40000')],
    ids=['keys', 'numbers', 'boxes', 'pairs'])
def test_a_scene_of_a_stranger_is_refused_within_a_second(text, words):
    """Each of these took its reader ten seconds or hundreds of megabytes, and now a share."""
    started = time.process_time()
    with pytest.raises(SceneError, match=words):
        parse_scene(text, limits=FOREIGN)
    assert time.process_time() - started < 1.0


# --- scenes written to files ----------------------------------------------------------------------

NAME = st.from_regex(r'\A[A-Za-z_][A-Za-z0-9_]{0,8}\Z')
LENGTH = st.floats(1e-3, 1e6)
COORDINATE = st.floats(-1e6, 1e6)


@st.composite
def scenes(draw):
    """Draw a scene of some boxes, the first of which moves; names may be words of YAML."""
    names = draw(st.lists(NAME | st.sampled_from(['yes', 'null', 'on', 'y', 'e1']), min_size=2,
                          max_size=5, unique=True))
    array, boxes = draw(st.booleans()), {}
    for number, name in enumerate(names):
        pose = draw(st.none() | st.tuples(*[COORDINATE] * 3).map(
            lambda place: (*place, 0.0, 0.6, 0.0, 0.8))) if number else None
        topic = '' if pose or array else draw(st.sampled_from(['', '/a/b'])) or f'{name}/pose'
        boxes[name] = Box(name, draw(st.tuples(*[LENGTH] * 3)), pose, topic)
    others = draw(st.lists(st.sampled_from(names[1:]), min_size=1, unique=True))
    ids = draw(st.lists(st.integers(0, LARGEST_ID), min_size=len(others), max_size=len(others),
                        unique=True))
    pairs = tuple(Pair(key, f'p{number}', names[0], other)
                  for number, (key, other) in enumerate(zip(ids, others)))
    return Scene(boxes, pairs, draw(st.sampled_from(['', 'map', 'a "b"\n: é'])), array)


@settings(max_examples=60, deadline=None)
@given(scenes())
def test_a_scene_that_is_written_is_read_as_itself(tmp_path_factory, scene):
    path = tmp_path_factory.getbasetemp() / 'scene.yaml'
    write_scene(scene, path)
    text = path.read_text('utf-8')
    assert parse_scene(text) == scene
    assert list(parse_scene(text).boxes) == list(scene.boxes)
    write_scene(parse_scene(text), path)
    assert path.read_text('utf-8') == text


def test_shipped_scenes_are_written_and_read(tmp_path):
    for name in ('yard_bay', 'two_boxes', 'spreader_container_stack'):
        scene = read_scene(f'config/scenes/{name}.yaml')
        write_scene(scene, tmp_path / 'scene.yaml')
        assert read_scene(tmp_path / 'scene.yaml') == scene


def test_a_scene_that_no_file_can_describe(tmp_path):
    """The default scene, whose pair has no name."""
    with pytest.raises(ValueError, match='not all'):
        write_scene(two_boxes((1, 1, 1), (1, 1, 1)), tmp_path / 'scene.yaml')
    assert not list(tmp_path.iterdir())


def test_boxes_without_topics_get_those_of_any_file(tmp_path):
    """The simplest scene that a program makes was refused."""
    scene = Scene({name: Box(name, (1, 1, 1)) for name in 'ab'}, (Pair.between('a', 'b'),))
    write_scene(scene, tmp_path / 'scene.yaml')
    found = read_scene(tmp_path / 'scene.yaml')
    assert found.sources == {'a': 'a/pose', 'b': 'b/pose'} and found.pairs == scene.pairs


@pytest.mark.parametrize('box, words', [
    (Box('a', (1.0, 1.0)), r'boxes.a.size: must be a tuple of 3 numbers, not \(1.0, 1.0\)'),
    (Box('a', (1.0, 1.0, 1.0), ()), 'boxes.a.pose: must be a tuple of 7 numbers'),
    (Box('a', (1.0, 1.0, 1.0), np.eye(7)[6]), 'boxes.a.pose: must be a tuple of 7 numbers')])
def test_a_box_of_other_shapes_is_refused(box, words):
    with pytest.raises(ValueError, match=words):
        Scene({'a': box, 'b': Box('b', (1.0, 1.0, 1.0))}, (Pair.between('a', 'b'),))


def test_two_pairs_of_one_label_are_refused():
    """Messages would call both the same, and one of them would be lost."""
    boxes = {name: Box(name, (1.0, 1.0, 1.0)) for name in 'abc'}
    with pytest.raises(ValueError, match='the same name'):
        Scene(boxes, (Pair(0, '', 'a', 'b'), Pair(1, 'a_b', 'a', 'c')))

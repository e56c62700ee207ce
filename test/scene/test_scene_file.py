# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Scene files: what is a scene, and the words in which the rest is refused."""
from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from box_contact_ros.scene import scene_file
from box_contact_ros.scene.boxes import SceneError
from box_contact_ros.scene.scene import Pair
from box_contact_ros.scene.scene_file import read_scene
from box_contact_ros.scene.scene_solver import SceneSolver
from box_contact_ros.stream.streams import partners_of, topics_of

ROOT = Path(__file__).resolve().parents[2]
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
  - {name: load_s1, a: load, b: s1}
  - {name: grip, a: spreader, b: load}
"""
BODIES = """\
boxes:
  load: {size: [12.192, 2.438, 2.591]}
  stack: {size: [12.192, 2.438, 2.591], pose: [0, 0, 1.2955, 0, 0, 0, 1]}
bodies:
  spreader:
    pose_topic: /crane/spreader
    boxes:
      frame: {size: [12.192, 2.3, 0.6]}
      twistlock_1: {size: [0.1, 0.1, 0.15], pose: [5.9, 1.1, -0.3, 0, 0, 0, 1]}
  goods:
    pose: [20, 0, 1, 0, 0, 0, 1]
    boxes:
      left: {size: [1, 1, 1], pose: [0, 2, 0, 0, 0, 0, 1]}
      right: {size: [1, 1, 1], pose: [0, -2, 0, 0, 0, 0, 1]}
  truck:
    boxes:
      bed: {size: [14, 2.5, 0.3]}
pairs:
  - {a: load, b: spreader}
  - {name: landing, a: load, b: truck_bed}
  - {a: 'goods*', b: load}
"""


@pytest.fixture
def scene_of(tmp_path):
    def read(text):
        (tmp_path / 'scene.yaml').write_text(text)
        return read_scene(tmp_path / 'scene.yaml')
    return read


def test_a_good_file(scene_of):
    """As YAML and as JSON."""
    scene = scene_of(GOOD)
    assert scene == scene_of(json.dumps(yaml.safe_load(GOOD)))
    assert scene.moving == ('load', 'spreader') and scene.frame_id == 'map'
    assert topics_of(scene) == {'load': 'load/pose', 'spreader': '/crane/spreader'}
    assert scene.boxes['s1'].pose == (0, 0, 1.2955, 0, 0, 0, 1)
    assert scene.pairs[1] == Pair('grip', 'spreader', 'load')


def test_a_box_in_no_pair_is_not_listened_to(scene_of):
    scene = scene_of(GOOD.replace('  - {name: grip, a: spreader, b: load}\n', ''))
    assert scene.moving == ('load',)


def test_patterns_stand_for_pairs_of_which_one_box_moves(scene_of):
    """Listed ones, which keep their names, then those of patterns in the order of the boxes."""
    boxes = GOOD.partition('pairs:')[0] + '  s2: {size: [1, 1, 1], pose: [9, 0, 0, 0, 0, 0, 1]}\n'
    listed = '  - {name: grip, a: spreader, b: load}\n'
    for pairs, wanted in (
            ('pairs: all', ['load_spreader', 'load_s1', 'load_s2', 's1_spreader', 's2_spreader']),
            ("pairs:\n  - {a: load, b: 's?'}", ['load_s1', 'load_s2']),
            ("pairs:\n  - {a: 's[1-9]', b: load}\n" + listed, ['grip', 's1_load', 's2_load']),
            ('pairs:\n' + listed + "  - {a: '*', b: '*'}",
             ['grip', 'load_s1', 'load_s2', 's1_spreader', 's2_spreader'])):
        assert [pair.name for pair in scene_of(boxes + pairs).every_pair()] == wanted


def test_a_file_with_bodies(scene_of):
    """Boxes of a body have its name before theirs; boxes come first, then bodies."""
    scene = scene_of(BODIES)
    assert scene.names == ('load', 'stack', 'spreader_frame', 'spreader_twistlock_1', 'goods_left',
                           'goods_right', 'truck_bed')
    assert scene.moving == ('load', 'spreader', 'truck')
    assert topics_of(scene) == {'load': 'load/pose', 'spreader': '/crane/spreader',
                             'truck': 'truck/pose'}
    assert [pair.name for pair in scene.every_pair()] == [
        'landing', 'load_spreader_frame', 'load_spreader_twistlock_1', 'goods_left_load',
        'goods_right_load']
    assert scene.is_fixed.tolist() == [False, True, False, False, True, True, False]
    assert partners_of(scene, 'spreader') == {'load'}
    assert partners_of(scene, 'load') == {'load'}  # the goods are there already
    landing = '  - {name: landing, a: load, b: truck_bed}\n'
    named = scene_of('poses: named\n' + BODIES.replace(landing, ''))
    assert named.moving == ('load', 'spreader', 'truck') and topics_of(named) == {
        'all boxes': 'poses'}


def test_a_scene_of_bodies_alone(scene_of):
    """Without `boxes`; each two bodies are as many pairs as their boxes."""
    text = BODIES[BODIES.index('bodies:'):BODIES.index('pairs:')]
    scene = scene_of(text + 'pairs: all\n')
    assert scene.pair_count == 2 * 2 + 2 * 1 + 2 * 1
    assert scene_of(text + 'pairs: [{a: goods, b: truck}]\n').pair_count == 2


@pytest.mark.parametrize('number', ['1e-05', '1e+16', '2.5e-07', '1E5', '1.5E0', '2.50e3'])
def test_numbers_are_read_as_json_writes_them(scene_of, number):
    """YAML 1.1 wants a point in each float, and a sign in each exponent."""
    text = GOOD.replace('[6, 2.4, 0.5]', f'[6, 2.4, {number}]')
    assert scene_of(text).boxes['spreader'].size[2] == json.loads(number)


@pytest.mark.parametrize('old, new, words', [
    ('[6, 2.4, 0.5]', '[6, 2.4, -0.5]', 'boxes.spreader.size[2]: -0.5 is less than or equal'),
    ('[6, 2.4, 0.5]', '[6, 2.4]', 'boxes.spreader.size: [6, 2.4] is too short'),
    ('[6, 2.4, 0.5]', '[6, 2.4, wide]', "boxes.spreader.size[2]: 'wide' is not of type 'number'"),
    ('[6, 2.4, 0.5]', '[6, 2.4, 1e60]', 'boxes.spreader.size'),
    *(('[6, 2.4, 0.5]', f'[{number}, 2.4, 0.5]', f"'{number}' is not a plain number")
      for number in ('010', '0x10', '1:30', '1_000', '.nan', '.inf', '1:30.5')),
    ('[6, 2.4, 0.5]', f'[{"1" * 10_000}, 2.4, 0.5]', "1' is not a plain number in"),
    ('[6, 2.4, 0.5]', f'[{"1" * 400}, 2.4, 0.5]', "1' is not a plain number in"),
    ('[6, 2.4, 0.5]', '[6, 2.4, 2026-02-31]', "boxes.spreader.size[2]: '2026-02-31' is not of"),
    ('[6, 2.4, 0.5]', '!!float [6]', "a tag, 'tag:yaml.org,2002:float' in"),
    ('  spreader:', '  load: {size: [1, 1, 1]}\n  spreader:',
     "'load' is defined twice in \"<unicode string>\", line 4, column 3"),
    ('    pose_topic:', '    size: [1, 1, 1]\n    pose_topic:', "'size' is defined twice in"),
    ('  spreader:', '  &one one: {size: [1, 1, 1]}\n  *one : {size: [2, 2, 2]}\n  spreader:',
     "'one' is defined twice in"),
    (GOOD, '[' * 100_000, 'more than 16 collections are within each other in'),
    (GOOD, '{"a": ' * 100_000, 'more than 16 collections are within each other in'),
    (GOOD, 'a0: &a0 [1]\n' + ''.join(f'a{i}: &a{i} [{f"*a{i - 1}, " * 10}]\n'
                                     for i in range(1, 30)),
     'aliases stand for more than 67108864 nodes in'),
    ('[0, 0, 1.2955, 0, 0, 0, 1]', '[0, 0, 1, 0, 0, 0, 0]', 'boxes.s1.pose: quaternion'),
    ('pose_topic: /crane/spreader', 'pose_topic: 2 crane', 'boxes.spreader.pose_topic: '),
    ('pose_topic: /crane/spreader', 'colour: red', 'boxes.spreader: Additional properties'),
    ('    pose_topic: /crane/spreader\n', '    pose_topic: a\n    pose: [0, 0, 0, 0, 0, 0, 1]\n',
     "boxes.spreader.pose_topic: 'a': a box with a pose never moves"),
    ('size: [6, 2.4, 0.5]', 'size: !!python/tuple [6, 2.4, 0.5]', 'python/tuple'),
    ('a: spreader', 'a: lorry', "pairs[1].a: 'lorry' is none of the boxes"),
    ('a: spreader', 'a: load', "pairs[1].b: 'load' is the same box as a"),
    ('name: grip', 'name: load_s1', "pairs[1].name: the same name as that of 'load'"),
    ('name: grip', 'name: load/s1', "pairs[1].name: 'load/s1' does not match"),
    ('name: grip, a: spreader, b: load', "a: 'x*', b: load", "pairs[1].a: 'x*' is the name of no"),
    ('a: spreader, b: load', "a: 's*', b: load", 'pairs[1].name: pairs by a pattern or a body'),
    ('name: grip, a: spreader, b: load', "a: 's1', b: 's?'", 'pairs[1]: no two boxes of this'),
    ('a: spreader, b: load', 'a: s1, b: load', 'pairs[1]: the same pair of boxes as that'),
    ('  load: {size: [12.192, 2.438, 2.591]}', '  load: {size: [1, 1, 1], pose: '
     '[0, 0, 9, 0, 0, 0, 1]}', "pairs[0]: 'load' and 's1' are both fixed"),
    ('frame_id: map', f'frame_id: {"ö" * 128}', 'has 256 bytes, more than 255'),
    ('name: grip', f'name: {"g" * 256}', 'is too long'),
    ('load: {', f'{"l" * 256}: {{', 'is too long'),
    ('frame_id: map', 'poses: array',
     "poses: 'array' is not one of ['topics', 'named']: write named"),
    ('frame_id: map', 'frame_id: 7', "frame_id: 7 is not of type 'string'"),
    ('boxes:', 'bodies:', 'bodies'), ('boxes:', 'boxes: [', 'line'),
    (GOOD, '7\n', "7 is not of type 'object'"),
    (GOOD, 'boxes: {b: {size: [1, 1, 1]}}\npairs: []\n', 'pairs: [] '),
    # The rest is of bodies.
    ('pose: [5.9, 1.1, -0.3, 0, 0, 0, 1]', 'pose: [5.9, 1.1, -0.3, 0, 0, 0, 0]',
     'bodies.spreader.boxes.twistlock_1.pose: quaternion'),
    ('[0.1, 0.1, 0.15]', '[0.1, 0.1]', 'bodies.spreader.boxes.twistlock_1.size: [0.1, 0.1] is too'),
    ('pose: [20, 0, 1, 0, 0, 0, 1]', 'pose: [20, 0, 1, 0, 0, 0, 0]', 'bodies.goods.pose: quater'),
    ('pose: [20, 0, 1, 0, 0, 0, 1]', 'pose: [20, 0, 1, 0, 0, 0, 1]\n    pose_topic: a',
     "bodies.goods.pose_topic: 'a': a body with a pose never moves"),
    ('left: {', 'left: {pose_topic: a, ', 'bodies.goods.boxes.left: Additional properties'),
    ('    boxes:\n      bed: {size: [14, 2.5, 0.3]}', '    {}', 'bodies.truck'),
    ('      bed: {size: [14, 2.5, 0.3]}', '      {}', 'bodies.truck.boxes: {} '),
    ('stack: {', 'truck_bed: {', "bodies.truck.boxes.bed: 'truck_bed' is the name of another box"),
    ('stack: {', 'truck: {', "bodies.truck: 'truck' is the name of a box, too"),
    ('truck:', f'{"t" * 255}:', ' bytes, more than 255'),
    ('a: load, b: spreader', 'name: up, a: load, b: spreader',
     'pairs[0].name: pairs by a pattern or a body have no name'),
    ('a: load, b: spreader', 'a: spreader, b: spreader', 'pairs[0]: no two boxes of this pattern'),
    ('a: load, b: truck_bed', 'a: spreader_frame, b: spreader_twistlock_1',
     "pairs[1]: 'spreader_frame' and 'spreader_twistlock_1' are parts of one body"),
    ('a: load, b: truck_bed', 'a: goods_left, b: stack',
     "pairs[1]: 'goods_left' and 'stack' are both fixed"),
    ('a: load, b: truck_bed', 'a: load, b: truck_wheel', "pairs[1].b: 'truck_wheel' is none of")])
def test_a_refusal_names_file_and_field(old, new, words, scene_of):
    text = GOOD if old in GOOD else BODIES
    assert old in text
    with pytest.raises(SceneError) as refused:
        scene_of(text.replace(old, new, 1))
    assert words in str(refused.value) and 'scene.yaml: ' in str(refused.value)


def test_aliases_are_read(scene_of):
    """Also one within another; what is merged may be overridden."""
    text = GOOD.replace('load: {size: [12.192, 2.438, 2.591]}', 'load: &load {size: &container '
                        '[12.192, 2.438, 2.591]}').replace(
                            '    size: [12.192, 2.438, 2.591]\n', '    <<: *load\n')
    assert text.count('*') == 1 and scene_of(text) == scene_of(GOOD)
    assert scene_of(text.replace('*load\n', '*load\n    size: [1, 1, 1]\n')
                    ).boxes['s1'].size == (1, 1, 1)


def test_a_refusal_of_a_long_value_is_short(scene_of):
    with pytest.raises(SceneError) as refused:
        scene_of(f'boxes: "{"x" * 100_000}"\npairs: all\n')
    assert "is not of type 'object'" in str(refused.value) and len(str(refused.value)) < 1000


def test_files_that_cannot_be_read(tmp_path):
    (tmp_path / 'latin').write_bytes(b'boxes: \xff')
    os.mkfifo(tmp_path / 'pipe')
    with (tmp_path / 'large').open('wb') as file:
        file.truncate(2**26 + 1)
    for path, words in ((tmp_path / 'none.yaml', 'cannot be read: No such file'),
                        (tmp_path, 'cannot be read: it is not a regular file'),
                        (tmp_path / 'pipe', 'cannot be read: it is not a regular file'),
                        (tmp_path / 'large', 'cannot be read: it has more than 67108864 bytes'),
                        (tmp_path / 'null\0', 'path: must be that of a file'),
                        (tmp_path / 'latin', "codec can't decode byte")):
        with pytest.raises(SceneError, match=words):
            read_scene(path)


def test_more_topics_than_a_scene_may_have(scene_of, monkeypatch):
    monkeypatch.setattr(scene_file, 'MOST_STREAMS', 1)
    with pytest.raises(SceneError, match='2 boxes and bodies have a topic of.*set poses: named'):
        scene_of(GOOD)
    assert scene_of('poses: named\n' + GOOD).poses == 'named'


JSON = st.recursive(st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=8),
                    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(
                        st.sampled_from(['boxes', 'pairs', 'size', 'pose', 'name', 'a', 'b',
                                         'poses']), inner, max_size=4), max_leaves=12)


@given(st.one_of(st.text(max_size=200), JSON.map(json.dumps),
                 st.tuples(st.integers(0, len(GOOD)), st.text(max_size=5)).map(
                     lambda edit: GOOD[:edit[0]] + edit[1] + GOOD[edit[0]:])))
def test_any_text_is_a_scene_or_refused(tmp_path_factory, text):
    """Nothing but SceneError comes out, and what is a scene can be computed."""
    path = tmp_path_factory.getbasetemp() / 'any.yaml'
    path.write_bytes(text.encode('utf-8', 'surrogatepass'))
    try:
        scene = read_scene(path)
    except SceneError:
        return
    assert scene.pair_count and set(scene.moving) <= set(scene.boxes)


@pytest.mark.parametrize('path', sorted((ROOT / 'config' / 'scenes').glob('*.yaml')),
                         ids=lambda path: path.stem)
def test_shipped_scenes_are_good(path):
    """Each can be computed, and is found by its path below the package's data."""
    scene = read_scene(f'config/scenes/{path.name}')
    SceneSolver(scene, model='exact')
    assert scene == read_scene(path)


def test_a_path_may_begin_at_home(tmp_path, monkeypatch):
    """As a parameter has it, in which no shell has replaced the `~`."""
    monkeypatch.setenv('HOME', str(tmp_path))
    (tmp_path / 'yard.yaml').write_text(GOOD)
    assert read_scene('~/yard.yaml') == read_scene(tmp_path / 'yard.yaml')
    with pytest.raises(SceneError, match='~nobody-of-this-name/yard.yaml'):
        read_scene('~nobody-of-this-name/yard.yaml')


def test_a_box_may_be_a_part_under_its_own_name(scene_of):
    """As a yard is saved, in which a box was attached to a body."""
    scene = scene_of("""
poses: named
boxes:
  hook: {size: [1, 1, 1], body: crane}
  c1: {size: [2, 2, 2], body: crane, pose: [0, 0, -1.5, 0, 0, 0, 1]}
  ground: {size: [9, 9, 1], pose: [0, 0, 0, 0, 0, 0, 1]}
bodies:
  crane: {}
pairs: all
""")
    assert scene.moving == ('crane',) and scene.names == ('hook', 'c1', 'ground')
    assert scene.boxes['c1'].body == 'crane' and [pair.label for pair in scene.every_pair()] == [
        'ground_hook', 'c1_ground']
    with pytest.raises(SceneError, match="boxes.c1.body: 'crane' is none of the bodies"):
        scene_of('boxes: {c1: {size: [1, 1, 1], body: crane}}\npairs: all')


def test_names_may_be_those_of_containers(scene_of):
    """No topic has such a name, and the node refuses to make one."""
    scene = scene_of("""
poses: named
boxes: {MSKU-123: {size: [1, 1, 1]}, 20ft_1: {size: [1, 1, 1]}}
pairs: all
""")
    assert [pair.label for pair in scene.every_pair()] == ['20ft_1_MSKU-123']
    for name in ('a/b', 'a b', "''", 'ö', 'a~'):
        with pytest.raises(SceneError):
            scene_of(f'boxes: {{{name}: {{size: [1, 1, 1]}}, b: {{size: [1, 1, 1]}}}}\npairs: all')

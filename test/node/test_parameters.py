# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is accepted as a parameter's value, without a node."""
from __future__ import annotations

from collections import Counter
from types import SimpleNamespace

import pytest

pytest.importorskip('rclpy')

from box_contact_ros.node import declared_parameters, parameters
from box_contact_ros.node.topics.qos_events import QosEvents


@pytest.mark.parametrize('check, value, words', [
    (parameters.number(0.0, 1.0), 'fast', "p must be a number, not 'fast'"),
    (parameters.number(0.0, 1.0), True, 'p must be a number, not True'),
    (parameters.number(0.0, 1.0), 1.5, 'p must lie within 0 and 1, not 1.5'),
    (parameters.whole_number(1, 9), 2.0, 'p must be a whole number from 1 to 9, not 2.0'),
    (parameters.flag, 1, 'p must be true or false, not 1'),
    (parameters.text, 7, 'p must be a string, not 7'),
    (parameters.one_of(['a', 'b']), 'c', "p 'c' is not one of: a, b"),
    (parameters.numbers(2), [1.0, float('nan')], 'p must be 2 finite numbers'),
    (parameters.size, [1.0, 0.0, 1.0], r'p \(1, 0, 1\) is not positive')])
def test_a_refusal_names_the_parameter_and_the_value(check, value, words):
    with pytest.raises(ValueError, match=words):
        check('p', value)


def test_only_a_near_name_is_proposed():
    """A file for several nodes has names that are none of this one's."""
    known = ('size_a', 'serialization', 'files_from')
    assert parameters.unknown_name('parameter', 'sizea', known).endswith('(did you mean size_a?)')
    for name in ('robot_description', 'robot', ''):
        assert parameters.unknown_name('parameter', name, known) == f'unknown parameter {name!r}'


def test_integers_are_as_good_as_floats():
    assert parameters.number(0.0, 3.0)('p', 2) == 2.0
    assert parameters.numbers(2)('p', [1, 2.5]) == (1.0, 2.5)


def test_a_descriptor_shows_range_choices_and_what_is_for_the_start():
    """Doubles and whole numbers have ranges of their own; choices and counts are words."""
    def described(default, check, fixed=False):
        setting = parameters.Setting(default, 'a test', check)
        return declared_parameters._descriptor(setting, read_only=fixed)
    one, = described(0.5, parameters.number(0, 3)).floating_point_range
    assert (one.from_value, one.to_value) == (0.0, 3.0)
    one, = described(5, parameters.whole_number(1, 9)).integer_range
    assert (one.from_value, one.to_value) == (1, 9)
    found = described('a', parameters.one_of(['a', 'b']), fixed=True)
    assert found.additional_constraints == 'one of: a, b' and found.read_only
    assert described((1.0, 2.0), parameters.numbers(2)).additional_constraints == '2 finite numbers'
    assert not described('a', parameters.text).floating_point_range


@pytest.mark.parametrize('args, refused', [
    (['-p', 'modle:=exact'], 'modle'), (['--param', 'contact:modle:=exact'], 'modle'),
    (['-p', 'model:=a:=b', '-p', 'use_sim_time:=true'], ''),
    (['-p', 'qos_overrides./a.publisher.depth:=5'], ''),
    (['-p', 'modle:=exact', '--', '--shared-parameters'], ''),
    (['--params-file', 'modle:=exact'], '')])
def test_an_unknown_parameter_after_p_ends_the_program(args, refused, capsys):
    """With status 2 and the nearest name, unless the caller shares its parameters among nodes."""
    settings = {'model': parameters.Setting('mlp', 'a test', parameters.text)}
    if not refused:
        return parameters.answer_help('node', 'Test.', settings, ['--ros-args', *args])
    with pytest.raises(SystemExit, match='2'):
        parameters.answer_help('node', 'Test.', settings, ['--ros-args', *args])
    assert f"unknown parameter '{refused}' (did you mean model?)" in capsys.readouterr().err


@pytest.mark.parametrize('args, words', [
    (['--model', 'exact'], 'parameters follow --ros-args: --ros-args -p model:=VALUE'),
    (['--ros-args', '-p', 'model=exact'], "'model=exact' is not NAME:=VALUE")])
def test_a_parameter_that_is_typed_in_another_way_gets_a_hint(args, words, capsys):
    settings = {'model': parameters.Setting('mlp', 'a test', parameters.text)}
    with pytest.raises(SystemExit, match='2'):
        parameters.answer_help('node', 'Test.', settings, args)
    assert words in capsys.readouterr().err


def test_a_list_with_blanks_gets_a_hint(capsys):
    """A shell cuts `-p size_a:=[1, 2, 3]` in three."""
    settings = {'size_a': parameters.Setting((1.0,), 'a test', parameters.size)}
    with pytest.raises(SystemExit, match='2'):
        parameters.answer_help('node', 'Test.', settings,
                               ['--ros-args', '-p', 'size_a:=[1,', '2,', '3]'])
    assert 'write it without blanks, as in size_a:=[1,2,3]' in capsys.readouterr().err


@pytest.mark.parametrize('change, lost', [(2, 2), (0, 0), (-1, 0)])
def test_publishers_that_show_no_life_are_counted(change, lost):
    """Publishers that came back are none that are lost."""
    said, counts = [], Counter()
    node = SimpleNamespace(get_logger=lambda: SimpleNamespace(warning=said.append))
    event = QosEvents(node, counts).callbacks('load', deadline=False).liveliness
    event(SimpleNamespace(not_alive_count_change=change))
    assert counts['liveliness lost'] == lost
    assert said == ['load: a publisher of its poses shows no life'] * bool(lost)

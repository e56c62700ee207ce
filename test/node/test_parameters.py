# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is accepted as a parameter's value, and on a node's command line."""
from __future__ import annotations

import math

import pytest
from rclpy.parameter import Parameter
from ros_client import serving

from box_contact_ros import arguments
from box_contact_ros.models.make_model import MOST_SOUP_DIVISIONS
from box_contact_ros.node import parameters, run_contact_node
from box_contact_ros.node.contact_node import ContactNode

SETTINGS = {'model': parameters.Setting('mlp', 'a test', parameters.text),
            'size_a': parameters.Setting((1.0, 2.5, 3.0), 'a test', parameters.size)}


@pytest.mark.parametrize('check, value, words', [
    (parameters.number(0.0, 1.0), 'fast', "p must be a number, not 'fast'"),
    (parameters.number(0.0, 1.0), True, 'p must be a number, not True'),
    (parameters.number(0.0, 1.0), 1.5, 'p must lie within 0 and 1, not 1.5'),
    (parameters.number(0.0, 1.0), math.nan, 'p must lie within 0 and 1, not nan'),
    (parameters.whole_number(1, 9), 2.0, 'p must be a whole number from 1 to 9, not 2.0'),
    (parameters.flag, 1, 'p must be true or false, not 1'),
    (parameters.text, 7, 'p must be a string, not 7'),
    (parameters.one_of(['a', 'b']), 'c', "p 'c' is not one of: a, b"),
    (parameters.size, [1.0, 2.0, math.nan], r'p \(1, 2, nan\) is not finite'),
    (parameters.size, [True] * 3, 'p must be 3 numbers'),
    (parameters.size, '222', "p must be 3 numbers, not \\['2', '2', '2'\\]"),
    (parameters.size, [1.0, 2.0], 'p must be 3 numbers'),
    (parameters.size, None, 'p must be 3 numbers, not None'),
    (parameters.size, [1.0, 0.0, 1.0], r'p \(1, 0, 1\) is not positive'),
    (parameters.size, [2.0, 2.0, 1e200], 'p .* is outside')])
def test_a_refusal_names_the_parameter_and_the_value(check, value, words):
    with pytest.raises(ValueError, match=words):
        check('p', value)


def test_an_unknown_name_is_logged_with_the_nearest_one(capfd):
    """And ignored: a file may be meant for several nodes, with names that are none of this one's.

    So is a quality of service of a topic that the node does not have, but not those that it has.
    """
    given = {'size_a': [1, 2, 3], 'sizea': 1.0, 'robot_description': '', 'use_sim_time': False,
             'qos_overrides./contacts.publisher.depth': 5,
             'qos_overrides./contact.publisher.depth': 5}
    with serving(ContactNode, **given) as node:
        told = capfd.readouterr().err
        assert node.get_parameter('qos_overrides./contacts.publisher.depth').value == 5
        node.trigger_deactivate()
        node.trigger_cleanup()
        node.trigger_configure()  # again, with parameters that are declared
    assert "unknown parameter 'sizea' (did you mean size_a?)" in told
    assert "unknown parameter 'robot_description'; it is ignored" in told
    assert "unknown parameter 'qos_overrides./contact.publisher.depth'" in told
    assert told.count('unknown parameter') == 3


def test_help_lists_all_parameters_with_their_defaults(capsys):
    with pytest.raises(SystemExit) as ended:
        run_contact_node.main(['--help'])
    assert ended.value.code == 0
    printed = capsys.readouterr().out
    for name in parameters.CONTACT_PARAMETERS:
        assert f'\n  {name} ' in printed
    assert '[12.192,2.438,2.591]' in printed and 'default: none' in printed


@pytest.mark.parametrize('args, words', [
    (['--model', 'exact'], 'unrecognized arguments: --model exact'),
    (['-p', 'rate:=1'], 'unrecognized arguments: -p rate:=1'),
    (['--ros-args', '-p', 'model:=exact', '--', '--fast'], 'unrecognized arguments: --fast')])
def test_options_outside_ros_args_are_refused(args, words, capsys):
    """With status 2; the line of usage has --ros-args."""
    with pytest.raises(SystemExit) as ended:
        arguments.parse_command_line('node', 'Test.', SETTINGS, args)
    assert ended.value.code == 2 and words in capsys.readouterr().err


def test_a_word_that_ros_does_not_know_ends_the_program(capsys, signal_handlers):
    """With one line and status 1: -p is easily forgotten."""
    arguments.parse_command_line('node', 'Test.', SETTINGS, ['--ros-args', '-p', 'model:=exact'])
    assert run_contact_node.main(['--ros-args', 'model:=exact']) == 1
    assert capsys.readouterr().err == (
        "error: after --ros-args, ROS does not know ['model:=exact']: a parameter is "
        '-p NAME:=VALUE, a name is remapped by -r FROM:=TO\n')


def test_ranges_and_choices_are_described():
    """As `ros2 param describe` shows them; what is outside is refused in the node's words."""
    with serving(ContactNode) as node:
        told = {name: node.describe_parameter(name) for name in parameters.CONTACT_PARAMETERS}
        refused, = node.set_parameters([Parameter('tolerance', value=-1.0)])
        assert 'tolerance' in refused.reason and not refused.successful
        assert node.set_parameters([Parameter('max_age', value=2)])[0].successful
    interval, = told['margin'].floating_point_range
    assert (interval.from_value, interval.to_value) == (0.0, 1e50)
    assert told['pairing'].additional_constraints == 'one of: stamp, latest'
    assert told['model'].additional_constraints.startswith('one of: exact, mlp')
    assert told['size_a'].additional_constraints == 'three numbers > 0'
    divisions, = parameters.describe(
        parameters.SOUP_PARAMETERS['divisions'], read_only=True).integer_range
    assert (divisions.from_value, divisions.to_value, divisions.step) == (1, MOST_SOUP_DIVISIONS, 1)

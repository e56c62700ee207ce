# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""launch/ and config/ name what exists: programs, parameters, boxes.

PyPI has neither `launch` nor `launch_ros` (its `launch` is another project). Where ROS's own
packages are, launch files run in them, as `ros2 launch` runs them. Elsewhere those tests skip.
"""
from __future__ import annotations

import importlib.util
import json
import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from box_contact_ros.cli import PROGRAMS
from box_contact_ros.demo.crane_parameters import PARAMETERS as CRANE_PARAMETERS
from box_contact_ros.node.contact_node import PARAMETERS
from box_contact_ros.node.launch_arguments import CONTACT_NODE, descriptions, value_of
from box_contact_ros.scene.files.scene_file import read_scene
from box_contact_ros.scene.scene_solver import Scene

ROOT = Path(__file__).resolve().parents[2]

# --- launch arguments -----------------------------------------------------------------------------


@pytest.mark.parametrize('name, text, value', [
    ('max_age', '2', 2.0), ('size_a', '[1,2,3.5]', (1.0, 2.0, 3.5)), ('respawn', 'True', True),
    ('model', 'exact', 'exact'), ('namespace', '7', '7'), ('use_sim_time', 'false', False)])
def test_an_argument_s_text_is_read_as_its_type(name: str, text: str, value: Any) -> None:
    found = value_of(name, text, CONTACT_NODE[name])
    assert found == value and type(found) is type(value)


@pytest.mark.parametrize('name, text, words', [
    ('max_age', 'fast', "max_age must be a number, not 'fast'"),
    ('size_a', '[1,', 'size_a must be 3 finite numbers'),
    ('respawn', '2', 'respawn must be true or false, not 2'),
    ('log_level', 'loud', "log_level 'loud' is not one of: debug, info, warn"),
    ('params_file', '/no/such.yaml', "params_file: there is no file '/no/such.yaml'"),
    ('model', 'exakt', 'exakt')])
def test_a_bad_argument_is_refused_by_name_and_value(name: str, text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        value_of(name, text, CONTACT_NODE[name])


def test_arguments_tell_what_holds_if_they_are_left_out() -> None:
    assert set(descriptions(CONTACT_NODE)) > set(PARAMETERS)
    assert descriptions(CONTACT_NODE)['model'].endswith('; if left out: mlp')


# --- launch files, by ROS's own launch ------------------------------------------------------------

needs_launch = pytest.mark.skipif(
    importlib.util.find_spec('ros2launch') is None,
    reason='no ros2launch here: PyPI has no wheels of ROS launch')
RUN = 'import sys; from ros2launch.api import launch_a_launch_file as launch; ' \
      'sys.exit(launch(launch_file_path=sys.argv[1], launch_file_arguments=sys.argv[2:]))'
SHOWN_START = shlex.join([sys.executable, str(ROOT / 'test' / 'helpers' / 'shown_start.py')])
PARENT = """
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, GroupAction, IncludeLaunchDescription
from launch_ros.actions import PushRosNamespace, SetParameter

def generate_launch_description():
    return LaunchDescription([
        DeclareLaunchArgument('robot', default_value='mule'),
        GroupAction([
            PushRosNamespace('bay'),
            SetParameter('max_age', 0.25),
            SetParameter('use_sim_time', True),
            IncludeLaunchDescription(FILE, launch_arguments=ARGUMENTS.items())])])
"""


@pytest.fixture
def prefix(tmp_path: Path) -> Path:
    """Make a package prefix whose programs run this package."""
    (tmp_path / 'share/ament_index/resource_index/packages').mkdir(parents=True)
    (tmp_path / 'share/ament_index/resource_index/packages/box_contact_ros').touch()
    (tmp_path / 'lib/box_contact_ros').mkdir(parents=True)
    for program in PROGRAMS:
        file = tmp_path / 'lib/box_contact_ros' / program
        file.write_text(f'#!/bin/sh\nexec {sys.executable} -m box_contact_ros {program} "$@"\n')
        file.chmod(0o755)
    return tmp_path


def start(prefix: Path, file: str | Path, *arguments: str) -> subprocess.Popen[str]:
    """Start what `ros2 launch FILE ARGUMENTS` starts, in a process group of its own."""
    paths = [str(prefix), *filter(None, os.environ.get('AMENT_PREFIX_PATH', '').split(':'))]
    return subprocess.Popen(
        [sys.executable, '-c', RUN, str(ROOT / 'launch' / file), *arguments], text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True,
        env=os.environ | {'AMENT_PREFIX_PATH': ':'.join(paths), 'ROS_LOG_DIR': str(prefix),
                          'PYTHONUNBUFFERED': '1'})


def output(prefix: Path, file: str | Path, *arguments: str) -> tuple[int, str]:
    """Return exit status and output of a launch file that ends by itself."""
    with start(prefix, file, *arguments) as launch:
        try:
            told, _ = launch.communicate(timeout=60)
        finally:
            if launch.poll() is None:
                os.killpg(launch.pid, signal.SIGKILL)
    return launch.returncode, told


def starts(prefix: Path, file: str | Path, *arguments: str) -> dict[str, Any]:
    """Return what each program of a launch file would start with."""
    _, told = output(prefix, file, f'launch-prefix:={SHOWN_START}', *arguments)
    found = [json.loads(line[line.index('{'):]) for line in told.splitlines() if '{"prog' in line]
    assert found, told
    return {one['program']: one for one in found}


def parent_of(prefix: Path, arguments: dict[str, str]) -> Path:
    """Write a launch file that includes the contact node's with some arguments."""
    file = str(ROOT / 'launch' / 'contact_node.launch.py')
    path = prefix / 'parent.launch.py'
    path.write_text(f'FILE = {file!r}\nARGUMENTS = {arguments}\n{PARENT}', 'utf-8')
    return path


@needs_launch
def test_the_shipped_file_holds_where_nothing_is_given(prefix: Path) -> None:
    node = starts(prefix, 'contact_node.launch.py')['contact_node']
    shipped = yaml.safe_load((ROOT / 'config' / 'contact_node.yaml').read_text('utf-8'))
    assert node['parameters'] == shipped['/**']['ros__parameters']
    assert node['name'] == '/contact_node' and node['levels'] == []


@needs_launch
def test_arguments_override_the_params_file_and_nothing_else_does(prefix: Path) -> None:
    file = prefix / 'mine.yaml'
    file.write_text('/yard/contact_node: {ros__parameters: {model: exact, max_age: 0.5}}')
    node = starts(prefix, 'contact_node.launch.py', f'params_file:={file}', 'model:=fcl',
                  'use_sim_time:=true', 'tolerance:=1', 'namespace:=yard', 'log_level:=warn',
                  'use_lifecycle_manager:=true', 'scene:=12')['contact_node']
    assert node['parameters'] == {'model': 'fcl', 'max_age': 0.5, 'use_sim_time': True,
                                  'tolerance': 1.0, 'autostart': False, 'scene': '12'}
    assert node['name'] == '/yard/contact_node' and node['levels'] == ['warn']


@needs_launch
def test_an_including_launch_file_keeps_its_parameters_and_its_own_arguments(prefix: Path) -> None:
    """Its SetParameter is overridden by a given argument alone; its arguments are its own."""
    parent = parent_of(prefix, {'model': 'exact', 'name': 'judge'})
    node = starts(prefix, parent, 'robot:=horse')['contact_node']
    given = node['parameters']
    assert (given['max_age'], given['use_sim_time'], given['model']) == (0.25, True, 'exact')
    assert node['name'] == '/bay/judge'
    assert node['arguments'] == ['--shared-parameters']  # SetParameter may be of other nodes' names
    parent = parent_of(prefix, {'max_age': '2'})
    assert starts(prefix, parent)['contact_node']['parameters']['max_age'] == 2.0
    status, told = output(prefix, parent_of(prefix, {'modle': 'exact'}))
    assert status == 1
    assert "unknown launch argument 'modle' (did you mean model?)" in told


@needs_launch
@pytest.mark.parametrize('file, argument, words', [
    ('contact_node', 'modle:=exact', "unknown launch argument 'modle' (did you mean model?)"),
    ('contact_node', 'max_age:=fast', "max_age must be a number, not 'fast'"),
    ('contact_node', 'use_lifecycle_manager:=true autostart:=true', 'so leave autostart out'),
    ('crane', 'modle:=exact', "unknown launch argument 'modle' (did you mean model?)")])
def test_a_wrong_argument_starts_nothing(
        prefix: Path, file: str, argument: str, words: str) -> None:
    status, told = output(prefix, f'{file}.launch.py', *argument.split())
    assert status == 1 and words in told and 'process started' not in told


@needs_launch
def test_the_crane_is_launched_with_what_was_given(prefix: Path) -> None:
    """Alone with a contact node, or with all four; every program gets what is its own."""
    nodes = starts(prefix, 'crane.launch.py')
    assert set(nodes) == {'contact_node', 'crane'}
    assert nodes['crane']['parameters'] == {'wait': 30.0}
    nodes = starts(prefix, 'crane.launch.py', 'soup:=true', 'view:=true', 'model:=exact',
                   'rate:=500', 'seed:=3', 'closed_loop:=true', 'namespace:=/yard')
    assert set(nodes) == {'contact_node', 'crane', 'soup_node', 'view'} <= set(PROGRAMS)
    assert {node['name'].rpartition('/')[0] for node in nodes.values()} == {'/yard'}
    assert nodes['contact_node']['parameters']['model'] == 'exact'
    given = nodes['crane']['parameters']
    assert given == {'wait': 30.0, 'rate': 500.0, 'seed': 3, 'closed_loop': True}
    assert {name: CRANE_PARAMETERS[name].check(name, value) for name, value in given.items()
            } == given
    assert nodes['view']['arguments'] == ['--attach']  # else it starts a scene of its own


@needs_launch
def test_a_killed_node_is_started_anew_and_one_ctrl_c_ends_all(prefix: Path) -> None:
    """By `respawn`; the second process is another one."""
    pids: list[int] = []
    told = ''
    with start(prefix, 'contact_node.launch.py', 'respawn:=true') as launch:
        try:
            for line in launch.stdout or ():
                told += line
                if 'process started with pid' in line:
                    pids.append(int(line.partition('pid [')[2].partition(']')[0]))
                if 'ready' in line and len(pids) == 1:
                    os.kill(pids[0], signal.SIGKILL)
                elif 'ready' in line:
                    launch.send_signal(signal.SIGINT)
            launch.wait(20)
        finally:
            if launch.poll() is None:
                os.killpg(launch.pid, signal.SIGKILL)
    assert len(set(pids)) == 2 and told.count('process has finished cleanly') == 1, told
    assert not any(Path(f'/proc/{pid}').exists() for pid in pids)


# --- parameters -----------------------------------------------------------------------------------


def test_parameter_file_is_complete() -> None:
    """Every parameter of the node is in it, with its default, and no other."""
    file = yaml.safe_load((ROOT / 'config' / 'contact_node.yaml').read_text('utf-8'))
    values = file['/**']['ros__parameters']
    assert {name: setting.check(name, values[name]) for name, setting in PARAMETERS.items()} == {
        name: setting.default for name, setting in PARAMETERS.items()}
    assert set(values) == set(PARAMETERS)


def test_node_starts_with_the_parameter_file(program: Any, tmp_path: Path) -> None:
    """Also under another name; and the file's values are the ones that count."""
    text = (ROOT / 'config' / 'contact_node.yaml').read_text('utf-8')
    file = tmp_path / 'contact_node.yaml'
    file.write_text(text.replace('model: mlp', 'model: exact'), 'utf-8')
    node = program('contact_node', '--ros-args', '--params-file', str(file), '-r', '__ns:=/yard')
    assert "model 'exact'" in node.wait_for_output('ready', 120)


# --- scenes ---------------------------------------------------------------------------------------


def scene(name: str) -> Scene:
    return read_scene(str(ROOT / 'config' / 'scenes' / f'{name}.yaml'))


def test_two_boxes_are_the_node_s_default() -> None:
    """The file shows how the default would be written: its boxes, and where their poses come."""
    boxes = scene('two_boxes').boxes
    assert {name: (box.size, box.pose_topic) for name, box in boxes.items()} == {
        f'box_{letter}': (PARAMETERS[f'size_{letter}'].default, f'box_{letter}/pose')
        for letter in 'ab'}
    assert scene('two_boxes').frame_id == CRANE_PARAMETERS['frame_id'].default

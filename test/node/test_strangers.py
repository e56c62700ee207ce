# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Strangers on the network attack a contact node, with its own services and nothing else.

DDS without security lets anybody on the network set parameters and ask for transitions. What they
may not do by it: read a file, probe the disk, hang or fill the node, and change one that is locked.
"""
from __future__ import annotations

import os
import time
from pathlib import Path

import pytest
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from raw_client import APART, ORIGIN
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters, SetParametersAtomically
from stranger import Stranger

from box_contact_ros.node.named_files import LARGEST_TEXT
from box_contact_ros.resources import OpenFiles, resource_path

SECRET = 'hunter2'
CUBES = ('-p', 'size_a:=[2.0, 2.0, 2.0]', '-p', 'size_b:=[2.0, 2.0, 2.0]', '-p', 'model:=exact')
SCENE = """\
boxes: {load: {size: [2, 2, 2]}, lorry: {size: [2, 2, 2]}}
pairs: [{id: 0, name: load_lorry, a: load, b: lorry}]
"""


@pytest.fixture
def stranger():
    client = Stranger()
    yield client
    client.close()


@pytest.fixture
def start(program, stranger, monkeypatch, tmp_path):
    """Start a contact node in a folder of its own, `home`."""
    home = tmp_path / 'home'
    home.mkdir()

    def start(*parameters, within=()):
        monkeypatch.chdir(home)
        words = [word for parameter in parameters for word in ('-p', parameter)]
        boxes = [] if any(one.startswith('scene:=') for one in parameters) else CUBES
        running = program('contact_node', '--ros-args', *boxes, *words, within=within)
        running.home = home
        return running
    return start


@pytest.fixture
def node(start, stranger):
    running = start()
    running.wait_for_output('ready', 120)
    stranger.offer_until_answered(ORIGIN, APART)
    return running


def files_that_do_not_serve(folder):
    """Files by what is wrong with them; most hold the secret."""
    files = {name: folder / f'{name} file' for name in (
        'scene', 'line', 'key', 'value', 'json', 'bytes', 'unreadable', 'huge')}
    files['scene'].write_text(SCENE.replace('size: [2, 2, 2]', f'{SECRET}: [2, 2, 2]'))
    files['line'].write_text(f'{SECRET}\n')
    files['key'].write_text(f'{SECRET}: 1\nboxes: {{}}\npairs: []\n')
    files['value'].write_text(SCENE.replace('id: 0', f'id: {SECRET}'))
    files['json'].write_bytes((len(SECRET) + 4).to_bytes(8, 'little') + b'{"%b"}' % SECRET.encode())
    files['bytes'].write_bytes(SECRET.encode() + b'\xff')
    files['unreadable'].write_text(SECRET)
    files['unreadable'].chmod(0)
    with files['huge'].open('wb') as file:
        file.truncate(2**31)
    os.mkfifo(folder / 'fifo file')
    (folder / 'loop file').symlink_to('loop file')
    return [*files.values(), folder / 'fifo file', folder / 'loop file', folder / 'no file', folder]


def test_files_are_neither_quoted_nor_told_apart(node, stranger, tmp_path):
    """Inside the directories that are open and outside, whatever is there: one answer.

    The log on the machine has the reason.
    """
    outside = tmp_path / 'outside'
    outside.mkdir()
    (node.home / 'way out').symlink_to(outside)
    files_that_do_not_serve(outside)
    paths = [str(path) for path in files_that_do_not_serve(node.home)]
    paths += [path.replace(str(node.home), str(outside)) for path in paths]
    paths += [f'way out/{Path(path).name}' for path in paths[-12:]]
    paths += ['../outside/line file', 'line file', '/etc/passwd', '/dev/zero', '/proc/self/environ',
              '/nowhere', 'x' * 5000, 'nul\0', '/dev/stdin', '~/line file', 'no_bay',
              '../scenes/no_bay']
    for name, other in (('scene', {}), ('weights', {'model': 'mlp'})):
        for path in paths:
            result = stranger.set(**{name: path}, **other)
            assert not result.successful
            shown = result.reason.removeprefix(f'{name} ')
            assert shown.endswith(' refused: the log on the machine of the node says why'), path
            assert SECRET not in result.reason and 'root' not in result.reason.replace(path, '')
    assert SECRET in node.output  # the local log quotes
    assert not any(SECRET in line for line in stranger.heard_logs)
    stranger.assert_answered()


def test_a_refused_file_is_not_told_by_a_transition(start, stranger):
    """A node that is not configured takes a path at once; the refusal comes with the transition."""
    running = start('autostart:=false')
    running.wait_for_output('unconfigured', 120)
    (running.home / 'scene').write_text(f'boxes: {SECRET}')
    assert stranger.set(scene='scene').successful
    assert not stranger.ask_for(Transition.TRANSITION_CONFIGURE)
    assert stranger.spin(lambda: any('refused' in line for line in stranger.heard_logs))
    assert not any(SECRET in line for line in stranger.heard_logs)
    assert SECRET in running.output and stranger.state() == 'unconfigured'


def test_texts_are_quoted_and_have_a_limit(node, stranger):
    """Who sends a scene as text knows what it holds; its length is checked before it is read."""
    result = stranger.set(scene=SCENE.replace('id: 0', f'id: {SECRET}'))
    assert not result.successful and f'{SECRET!r} is not a whole number' in result.reason
    started = time.monotonic()
    result = stranger.set(scene=SCENE + '#' * LARGEST_TEXT)
    assert not result.successful and f'at most {LARGEST_TEXT}' in result.reason
    for bad in ('boxes: {}\npairs: [' + '{},' * (LARGEST_TEXT // 4) + ']',
                '\n'.join(f'k{i}: 1' for i in range(LARGEST_TEXT // 12))):
        result = stranger.set(scene=bad)
        assert not result.successful and len(result.reason) <= 1000
        stranger.assert_answered()
    assert time.monotonic() - started < 10.0


def test_files_that_are_open(start, stranger, tmp_path):
    """Below the working directory, the package's own, and those that the start named."""
    named, other = tmp_path / 'named.yaml', tmp_path / 'other.yaml'
    for path in (named, other):
        path.write_text(SCENE)
    running = start(f'scene:={named}')
    running.wait_for_output('ready', 120)
    (running.home / 'here.yaml').write_text(SCENE)
    for path, opened in ((named, True), (other, False), ('here.yaml', True),
                         ('../named.yaml', True), ('../other.yaml', False)):
        assert stranger.set(scene=str(path)).successful is opened, path
    assert stranger.set(scene='', model='mlp', weights=str(
        resource_path('weights', 'mlp.safetensors'))).successful


def test_open_directories(tmp_path, monkeypatch):
    """They are what they were at the start; / is open only by its name."""
    (tmp_path / 'a' / 'b').mkdir(parents=True)
    (tmp_path / 'link').symlink_to('a')
    (tmp_path / 'a' / 'way out').symlink_to('/etc')
    monkeypatch.chdir(tmp_path)
    files = OpenFiles(['link', 'gone'], ['one'])
    (tmp_path / 'link').unlink()
    (tmp_path / 'link').symlink_to('/etc')
    monkeypatch.chdir('/')
    a = tmp_path / 'a'
    for name, opened in ((a / 'x', True), (a / 'b' / 'x', True), (tmp_path / 'ab', False),
                         (tmp_path / 'one', True), (tmp_path / 'one' / 'x', False),
                         (tmp_path / 'gone' / 'x', True), (tmp_path / 'link' / 'passwd', False),
                         (a / '..' / 'x', False), (a / 'way out' / 'passwd', False),
                         ('config/scenes/two_boxes.yaml', True),
                         ('config/../setup.py', False), ('weights/x', False)):
        if opened:
            assert Path(files.find(str(name))).is_absolute()
        else:
            with pytest.raises(ValueError, match='is not below the directories of files_from'):
                files.find(str(name))
    with pytest.raises(ValueError, match='is not below'):
        OpenFiles(['.', ''], []).find('/etc/passwd')
    assert OpenFiles(['/'], []).find('/etc/passwd') == '/etc/passwd'


def test_a_locked_node_takes_no_changes(start, stranger):
    """No parameter, not even those of rclpy, and no transition; it answers on, and can be read."""
    running = start('locked:=true')
    running.wait_for_output('ready', 120)
    stranger.offer_until_answered(ORIGIN, APART)
    for values in ({'model': 'mlp'}, {'scene': SCENE}, {'use_sim_time': True}, {'locked': False},
                   {'files_from': '/'}, {'start_type_description_service': False}):
        assert not stranger.set(**values).successful, values
    unreadable = Parameter(name='scene', value=ParameterValue(type=77))
    for asked in (Parameter(name='model', value=ParameterValue(
            type=ParameterType.PARAMETER_STRING, string_value='exact')), unreadable):
        results = stranger.call(SetParameters, 'set_parameters', parameters=[asked] * 2).results
        result = stranger.call(SetParametersAtomically, 'set_parameters_atomically',
                               parameters=[asked]).result
        assert [one.reason for one in (*results, result)] == 3 * [
            'the node is locked: nothing can be changed after its start']
    for transition in (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP,
                       Transition.TRANSITION_ACTIVE_SHUTDOWN):
        assert not stranger.ask_for(transition)
        assert stranger.state() == 'active'
    assert not stranger.call(ChangeState, 'change_state',
                             transition=Transition(label='deactivate')).success
    values = stranger.call(GetParameters, 'get_parameters', names=['model', 'use_sim_time']).values
    assert values[0].string_value == 'exact' and not values[1].bool_value
    assert not stranger.node.get_subscriptions_info_by_topic('/clock')
    stranger.assert_answered()


@pytest.mark.skipif(not os.path.isdir('/proc/self/net'), reason='no /proc: not Linux')
@pytest.mark.parametrize('setting, is_open', [
    ({'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}, True),
    ({'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET', 'FASTRTPS_DEFAULT_PROFILES_FILE': str(
        resource_path('config', 'this_machine.xml'))}, False)], ids=['no discovery', 'profile'])
def test_sockets(program, setting, is_open):
    """Without discovery the ports are open to all hosts; by the profile they are on loopback."""
    running = program('contact_node', env=setting)
    running.wait_for_output('ready', 120)
    process = Path('/proc', str(running.process.pid))
    mine = {os.readlink(file) for file in (process / 'fd').iterdir()}
    hosts = []
    for protocol in ('udp', 'udp6', 'tcp', 'tcp6'):
        for line in (process / 'net' / protocol).read_text().splitlines()[1:]:
            local, inode = line.split()[1], line.split()[9]
            if f'socket:[{inode}]' in mine:
                hosts.append(bytes.fromhex(local.partition(':')[0])[::-1])  # as x86 and ARM have it
    assert hosts  # 127.0.0.1, and the multicast group on the loopback interface
    assert any(host[0] not in (127, 239) for host in hosts) is is_open
    running.end()
    assert running.process.returncode == 0


def test_a_lock_and_no_start(start):
    """The two contradict each other: a node that nobody may start."""
    running = start('locked:=true', 'autostart:=false')
    assert running.wait() == 1
    assert 'error: locked: a node that does not start itself' in running.output

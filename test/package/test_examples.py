# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The programs of docs/examples: each runs, and prints what its docstring shows."""
from __future__ import annotations

import ast
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path

import pytest
from patience import PATIENCE
from test_help import alone

pytestmark = pytest.mark.reports

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / 'docs' / 'examples'
CLIENTS = ('check_client.py', 'lockstep_client.py', 'forces_client.py', 'lift.py',
           'save_yard.py', 'crane_lift.py')
"""Of a contact node."""
LIFT = f'{ROOT}/config/scenes/lift.yaml'
PARAMETERS = dict.fromkeys(('lift.py', 'save_yard.py', 'crane_lift.py'),
                           (f'scene:={LIFT}', 'pair_topics:=false'))
ARGUMENTS = {'save_yard.py': ('/tmp/yard.yaml',)}
RUNS = {'lift.py': 10, 'lockstep_client.py': 2}
"""A simulator that is started anew repeats the stamps of its last run, and finds what it left."""
NEEDS = {'mujoco_loop.py': 'mujoco', 'container_stack.py': 'mujoco',
         'mujoco_plan.py': 'mujoco',
         'dask_plans.py': 'distributed',
         'tf_to_pose.py': 'tf2_ros'} | dict.fromkeys(CLIENTS, 'box_contact_msgs.msg')
QUICK = {'vectorised_env.py': 'main(100)'}
"""Shorter runs, whose figures are not those of the docstring."""


def shown(name: str) -> list[str]:
    """Return the lines that the docstring of an example shows."""
    words = ast.get_docstring(ast.parse((EXAMPLES / name).read_text('utf-8')))
    lines = re.findall('^    (.+)$', words.partition('It prints:')[2], re.MULTILINE)
    assert lines, f'{name} does not show what it prints'
    return lines


@pytest.mark.parametrize(('name', 'model'), [
    *((path.name, 'exact') for path in sorted(EXAMPLES.glob('*.py'))
      if path.name != 'record.py'),  # of the test below
    ('crane_lift.py', 'mlp')])
def test_example(name: str, model: str, program, tmp_path: Path) -> None:
    """Figures agree to the printed digits; shorter runs print as many lines in the same words."""
    pytest.importorskip(NEEDS.get(name, 'numpy'))
    if name in CLIENTS:
        given = (f'model:={model}', *PARAMETERS.get(name, ()))
        program('contact_node', '--ros-args', *(word for value in given for word in (
            '-p', value))).wait_for_output('ready')
    command = [str(EXAMPLES / name), *ARGUMENTS.get(name, ())]
    if name in QUICK:
        module = name.removesuffix('.py')
        command = ['-c', f'import {module}\nif __name__ == "__main__": {module}.{QUICK[name]}']
    for _ in range(RUNS.get(name, 1)):
        done = subprocess.run(
            [sys.executable, *command], cwd=tmp_path, capture_output=True, text=True,
            timeout=PATIENCE, env=os.environ | {'PYTHONPATH': os.pathsep.join(
                [str(EXAMPLES), os.environ.get('PYTHONPATH', '')])})
        assert done.returncode == 0, done.stderr
    printed, expected = done.stdout.splitlines(), shown(name)
    if name in QUICK:
        printed, expected = ([re.sub(r'[-\d.,]+', '#', line) for line in lines]
                             for lines in (printed, expected))
    assert printed == expected


@pytest.mark.parametrize('name', sorted(
    path.name for path in EXAMPLES.glob('*.py') if 'require(' in path.read_text('utf-8')))
def test_an_example_without_its_extra_names_it(name: str) -> None:
    """In one line, as programs do; also where it would wait for a node."""
    done = alone(f'docs/examples/{name}')
    assert (done.returncode, done.stderr.count('\n')) == (1, 1), done.stderr
    assert "pip install -c constraints.txt -e '.[" in done.stderr


@pytest.mark.parametrize('name', ['record.py', 'save_yard.py'])
def test_arguments_come_before_the_wait(name: str) -> None:
    """Without its argument, and with --help."""
    pytest.importorskip('rosbags' if name == 'record.py' else 'rclpy')
    for words, status in (([], 2), (['--help'], 0)):
        done = subprocess.run([sys.executable, EXAMPLES / name, *words], capture_output=True,
                              text=True, timeout=PATIENCE)
        assert done.returncode == status and f'usage: {name}' in done.stdout + done.stderr


def refused(client: Sequence[str | Path], program) -> bool:
    """Whether a client of ~/check says that a node refuses its frame, and ends with status 1."""
    program('contact_node', '--ros-args', '-p', f'scene:={ROOT}/config/scenes/load_on_chassis.yaml',
            '-p', 'model:=exact').wait_for_output('ready')
    done = subprocess.run(client, capture_output=True, text=True, timeout=PATIENCE)
    return done.returncode == 1 and not done.stdout and 'header.frame_id: ' in done.stderr


def test_refused(program) -> None:
    """A refused question is not taken for an answer without contacts."""
    pytest.importorskip('box_contact_msgs.msg')
    assert refused([sys.executable, EXAMPLES / 'check_client.py'], program)


def test_record(program, tmp_path: Path) -> None:
    """What the lockstep client sends and is answered, read again; the printed counts are true."""
    pytest.importorskip('box_contact_msgs.msg')
    rosbag2 = pytest.importorskip('rosbags.rosbag2')
    program('contact_node', '--ros-args', '-p', 'model:=exact').wait_for_output('ready')
    log = tmp_path / 'log'
    with log.open('w') as errors:
        recorder = subprocess.Popen([sys.executable, EXAMPLES / 'record.py', tmp_path / 'run'],
                                    stdout=subprocess.PIPE, stderr=errors, text=True)
    deadline = time.monotonic() + PATIENCE
    try:
        # The recorder may not have met all publishers at first.
        hears_all = False
        while not hears_all and time.monotonic() < deadline:
            hears_all = log.read_text().count('hears') == 3  # and is sent a whole run
            subprocess.run([sys.executable, EXAMPLES / 'lockstep_client.py'], check=True,
                           timeout=PATIENCE)
    finally:
        recorder.send_signal(signal.SIGINT)
        output, _ = recorder.communicate(timeout=PATIENCE)
    assert recorder.returncode == 0 and 'Traceback' not in log.read_text()
    with rosbag2.Reader(tmp_path / 'run') as bag:
        counts = {c.topic: c.msgcount for c in bag.connections}
        sizes = [len(data) for c, _, data in bag.messages() if c.topic == '/contacts']
    assert sizes[-5] < sizes[-1]  # of the last run: no contact at first, one in the end
    assert output.splitlines() == [f'{count} of {topic}' for topic, count in counts.items()]
    assert set(counts) == {'/box_a/pose', '/box_b/pose', '/contacts'}
    assert min(counts.values()) >= 1


ASK_ONCE = """
import numpy, rclpy
from lockstep_client import LockstepClient, PoseStamped
from rclpy.serialization import deserialize_message
from typed_messages import unset
from box_contact_msgs.msg import Contacts
stamps = set()
class Client(LockstepClient):
    def receive(self, data):
        super().receive(data)
        self.data = data
        stamps.add(self.answer.stamp)
rclpy.init()
client = Client()
while not (client.poses[0].get_subscription_count() and client.count_publishers('contacts')):
    rclpy.spin_once(client, timeout_sec=0.05)
for _ in range(10):  # the node may not have met this client yet
    client.poses[0].publish(PoseStamped())  # box B has no pose
    rclpy.spin_once(client, timeout_sec=0.05)
stack = numpy.array([0, 0, 0, 0, 0, 0, 1])
answer = client.ask(10**9, stack + numpy.array([0, 0, 2.581, 0, 0, 0, 0]), stack)
print(answer.names[0][0], round(-answer.contacts.separation[0], 6), stamps)
client.ask(2 * 10**9, [0.3, 0.2, 1.9, 0.2, 0.1, 0.4, 1], [0, 0, 0, 0.1, 0.2, 0.3, 0.9])
print('left at 0:', unset(deserialize_message(client.data, Contacts).contacts))
"""


LOAD = """
import sys, rclpy
from composition_interfaces.srv import LoadNode
rclpy.init()
node = rclpy.create_node('loader')
load = node.create_client(LoadNode, 'ComponentManager/_container/load_node')
load.wait_for_service()
future = load.call_async(LoadNode.Request(
    package_name='box_contact_examples', plugin_name='BoxContactNode'))
rclpy.spin_until_future_complete(node, future)
sys.exit(future.result().error_message or 0)
"""


@pytest.fixture(scope='module')
def cpp_with_ros(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Return where the C++ examples are installed with ROS; processes find their libraries."""
    prefixes = [sys.prefix, *os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)]
    cmake = shutil.which('cmake')
    if not cmake or not any(Path(p, 'share/rclcpp_components/cmake').is_dir() for p in prefixes):
        pytest.skip('rclcpp is not installed')
    built = tmp_path_factory.mktemp('built')
    installed = tmp_path_factory.mktemp('installed')
    for words in (['-S', EXAMPLES / 'cpp', '-B', built, f'-DCMAKE_INSTALL_PREFIX={installed}'],
                  ['--build', built], ['--install', built]):
        subprocess.run([cmake, *words], check=True, timeout=PATIENCE)
    with pytest.MonkeyPatch.context() as patch:
        for name, place in (('LD_LIBRARY_PATH', f'{sys.prefix}/lib'),
                            ('LD_LIBRARY_PATH', f'{installed}/lib'),
                            ('AMENT_PREFIX_PATH', str(installed))):
            patch.setenv(name, place, prepend=os.pathsep)
        yield installed / 'lib/box_contact_examples'


@pytest.mark.parametrize('name', ['ros_node', 'component_container'])
def test_cpp_node(cpp_with_ros: Path, name: str) -> None:
    """The node in C++ answers as a contact node does: as a program, and in a container."""
    places = os.environ['AMENT_PREFIX_PATH'].split(os.pathsep)
    programs = [cpp_with_ros / name, *(Path(p, 'lib/rclcpp_components', name) for p in places)]
    with subprocess.Popen([next(filter(Path.exists, programs))]) as node:
        try:
            if name == 'component_container':
                subprocess.run([sys.executable, '-c', LOAD], check=True, timeout=PATIENCE)
            asked = subprocess.run(
                [sys.executable, '-c', ASK_ONCE], check=True, stdout=subprocess.PIPE, text=True,
                env=os.environ | {'PYTHONPATH': os.pathsep.join(
                    [str(EXAMPLES), str(ROOT / 'test' / 'helpers'),
                     os.environ.get('PYTHONPATH', '')])}, timeout=PATIENCE)
        finally:
            node.terminate()
    assert asked.stdout == 'box_a_box_b 0.01 {1000000000}\nleft at 0: []\n'


@pytest.mark.parametrize('events', ['true', 'false'])
def test_cpp_node_pairs_streams_that_drift_apart(cpp_with_ros: Path, events: str) -> None:
    """By its parameters, in both executors: three poses of A before those of B lose no tick."""
    from ros_client import Client  # only here: an extra

    values = ('size_a:=[2.0, 2.0, 2.0]', 'size_b:=[2.0, 2.0, 2.0]', 'margin:=0.5',
              f'events_executor:={events}')
    with closing(Client()) as client, subprocess.Popen(
            [cpp_with_ros / 'ros_node', '--ros-args',
             *(word for value in values for word in ('-p', value))]) as node:
        try:
            client.offer_until_answered((0, 0, 0, 0, 0, 0, 1), (0, 0, 1.9, 0, 0, 0, 1))
            stamps = [client.next_stamp() for _ in range(3)]
            for side in ((0, 0, 0, 0, 0, 0, 1), None), (None, (0, 0, 2.4, 0, 0, 0, 1)):
                for stamp in stamps:
                    client.send(*side, stamps=(stamp, stamp))
            assert client.are_answered(stamps)
            assert [client.contacts[stamp].near[0].distance for stamp in stamps] == pytest.approx(
                [0.4] * 3)
            assert client.points and client.normals
        finally:
            node.terminate()


def test_cpp_client(cpp_with_ros: Path, program) -> None:
    """The client of ~/check and ~/check_path prints what it says."""
    program('contact_node', '--ros-args', '-p', 'model:=exact').wait_for_output('ready')
    printed = subprocess.run([cpp_with_ros / 'check_client'], check=True, capture_output=True,
                             text=True, timeout=PATIENCE).stdout
    told = ''.join(f'//   {line}\n' for line in printed.splitlines())
    assert printed.count('\n') == 2
    assert told in (EXAMPLES / 'cpp/check_client.cpp').read_text('utf-8')


def test_cpp_client_refused(cpp_with_ros: Path, program) -> None:
    """A refused question is not taken for an answer without contacts."""
    assert refused([cpp_with_ros / 'check_client'], program)


def test_cpp_client_without_node(cpp_with_ros: Path) -> None:
    """Ctrl-C ends a client that waits for its node, with status 1."""
    with subprocess.Popen([cpp_with_ros / 'check_client'], stderr=subprocess.PIPE) as client:
        try:
            assert b'waits' in client.stderr.readline()
            time.sleep(1.0)  # rclcpp aborts if its context ends while it begins to wait
            client.send_signal(signal.SIGINT)
            assert client.wait(PATIENCE) == 1, client.stderr.read()
        finally:
            client.kill()

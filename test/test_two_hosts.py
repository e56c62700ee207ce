"""Two hosts, as network namespaces joined by a cable: simulator on one, contact node on the other.

ROS 2's own distribution (DDS) does all of it; this shows that nothing here stands in its way.
"""
from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import uuid

import pytest

CUBES = ('-p', 'size_a:=[2.0, 2.0, 2.0]', '-p', 'size_b:=[2.0, 2.0, 2.0]')
SUBNET = {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET'}
SCENE = """\
boxes:
  box_a: {{size: [2, 2, 2]}}
  box_b: {{size: [2, 2, 2]}}
  floor: {{size: [50, 50, 1], pose: [0, 0, -0.5, 0, 0, 0, 1]}}
pairs:
  - {{id: {id}, name: {name}, a: {a}, b: {b}}}
"""


def ip(*words):
    return subprocess.run(['ip', *words], capture_output=True, text=True)


@pytest.fixture
def hosts():
    """Command prefixes of two hosts, joined by a virtual cable."""
    if not shutil.which('ip'):
        pytest.skip('two hosts need `ip` (iproute2)')
    tag = uuid.uuid4().hex[:6]
    names = [f'bcr{side}{tag}' for side in 'ab']
    made = [name for name in names if ip('netns', 'add', name).returncode == 0]
    try:
        if len(made) < 2:
            pytest.skip('network namespaces are not permitted here')
        ends = [f'v{side}{tag}' for side in 'ab']
        joined = ip('link', 'add', ends[0], 'type', 'veth', 'peer', 'name', ends[1])
        if joined.returncode:
            pytest.skip(f'virtual cables are not permitted here: {joined.stderr.strip()}')
        for number, (name, end) in enumerate(zip(names, ends), 1):
            for words in (['link', 'set', end, 'netns', name],
                          ['-n', name, 'addr', 'add', f'10.77.0.{number}/24', 'dev', end],
                          ['-n', name, 'link', 'set', end, 'up'],
                          ['-n', name, 'link', 'set', 'lo', 'up'],
                          ['-n', name, 'route', 'add', '224.0.0.0/4', 'dev', end]):
                done = ip(*words)
                assert done.returncode == 0, done.stderr
        yield [['ip', 'netns', 'exec', name] for name in names], ends
    finally:
        for name in made:
            ip('netns', 'delete', name)


def impair(host, end, *words):
    """Loss and delay on one end of the cable; skips where the kernel knows none."""
    done = subprocess.run([*host, 'tc', 'qdisc', 'add', 'dev', end, 'root', 'netem', *words],
                          capture_output=True, text=True)
    if done.returncode:
        pytest.skip(f'tc netem is not available here: {done.stderr.strip()}')


def numbers_of(line):
    """All whole numbers in a line."""
    return [int(word) for word in ''.join(c if c.isdigit() else ' ' for c in line).split()]


def test_simulator_and_node_on_two_hosts(program, hosts):
    """A crane on one host, the node on the other: all of 1,000 evaluations come back (else the
    crane's status is not 0)."""
    (here, there), _ = hosts
    node = program('contact_node', '--ros-args', *CUBES, env=SUBNET, within=there)
    node.wait_for_output('ready', 120)
    crane = program('crane', '--ros-args', *CUBES, '-p', 'duration:=5', '-p', 'wait:=20',
                    env=SUBNET, within=here)
    assert crane.wait(120) == 0, crane.output
    assert 'messages lost .......... 0' in crane.output
    node.signal(signal.SIGTERM)
    assert node.wait(5) == 0


def test_a_bad_cable(program, hosts):
    """2 % loss and 5 ms delay each way: poses are lost, since they are sent best effort and one
    that is late is worth nothing; every contact that is found is delivered, since those are
    reliable; and what is not answered is told as lost, not made up."""
    (here, there), ends = hosts
    node = program('contact_node', '--ros-args', *CUBES, env=SUBNET, within=there)
    node.wait_for_output('ready', 120)
    impair(here, ends[0], 'loss', '2%', 'delay', '5ms')
    impair(there, ends[1], 'loss', '2%', 'delay', '5ms')
    crane = program('crane', '--ros-args', *CUBES, '-p', 'duration:=8', '-p', 'wait:=20',
                    '-p', 'report:=true', env=SUBNET, within=here)
    crane.wait(120)
    lost, = (line for line in crane.output.splitlines() if 'messages lost' in line)
    _, evaluations, contacts = numbers_of(lost)
    assert 0 < evaluations < 200  # of 1,600; 4 % of them lack one pose or the other
    assert contacts == 0
    assert 'wrong verdicts ......... 0' in crane.output


def test_a_scene_shared_by_two_nodes(program, hosts, tmp_path):
    """Each of two nodes on two hosts has its share of a scene's pairs, and both hear the same
    poses: that is how a scene grows past one machine."""
    (here, there), _ = hosts
    nodes = []
    for number, (host, a, b) in enumerate(((there, 'box_a', 'box_b'), (here, 'floor', 'box_a'))):
        path = tmp_path / f'share_{number}.yaml'
        path.write_text(SCENE.format(id=number, name=f'pair_{number}', a=a, b=b))
        nodes.append(program('contact_node', '--ros-args', '-p', f'scene:={path}',
                             '-r', f'__node:=share_{number}', env=SUBNET, within=host))
    for node in nodes:
        node.wait_for_output('ready', 120)
    listener = subprocess.run(
        [*here, sys.executable, '-c', LISTEN],
        env=os.environ | SUBNET, capture_output=True, text=True, timeout=120)
    assert listener.returncode == 0, listener.stdout + listener.stderr
    assert 'pairs {0, 1}' in listener.stdout


LISTEN = """
import time
import rclpy
from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2
from box_contact_ros.nodes.messages import make_header, read_cloud
from box_contact_ros.nodes.runtime import make_executor
context = rclpy.Context()
rclpy.init(context=context)
node = Node('listener', context=context)
executor = make_executor(context)
executor.add_node(node)
pairs = set()
node.create_subscription(PointCloud2, 'contacts',
                         lambda m: pairs.update(int(row['pair']) for row in read_cloud(m)), 10)
boxes = [node.create_publisher(PoseStamped, f'box_{box}/pose', 10) for box in 'ab']
deadline = time.monotonic() + 30
while pairs != {0, 1} and time.monotonic() < deadline:
    header = make_header(time.time_ns(), 'map')
    for publisher, height in zip(boxes, (0.9, 2.8)):
        message = PoseStamped(header=header)
        message.pose.position.z = height
        publisher.publish(message)
    executor.spin_once(timeout_sec=0.05)
print('pairs', pairs)
executor.shutdown()
node.destroy_node()
context.try_shutdown()
"""

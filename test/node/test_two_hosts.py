# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Two hosts, as network namespaces joined by a cable: simulator on one, contact node on the other.

ROS 2's own distribution (DDS) does all of it; this shows that nothing here stands in its way.
"""
from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import uuid
from pathlib import Path

import numpy as np
import pytest

HELPERS = Path(__file__).resolve().parents[1] / 'helpers'
CUBES = ('-p', 'size_a:=[2.0, 2.0, 2.0]', '-p', 'size_b:=[2.0, 2.0, 2.0]')
SUBNET = {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET'}


def ip(*words):
    return subprocess.run(['ip', *words], capture_output=True, text=True)


@pytest.fixture
def unjoined():
    """Names of two hosts, and of the network devices that will join them."""
    if not shutil.which('ip'):
        pytest.skip('two hosts need `ip` (iproute2)')
    tag = uuid.uuid4().hex[:6]
    names = [f'bcr{side}{tag}' for side in 'ab']
    made = [name for name in names if ip('netns', 'add', name).returncode == 0]
    try:
        if len(made) < 2:
            pytest.skip('network namespaces are not permitted here')
        yield names, [f'v{side}{tag}' for side in 'ab']
    finally:
        for name in made:
            ip('netns', 'delete', name)


def join(names, ends):
    """Give each host its end of a cable; returns the hosts' command prefixes."""
    for number, (name, end) in enumerate(zip(names, ends), 1):
        for words in (['link', 'set', end, 'netns', name],
                      ['-n', name, 'addr', 'add', f'10.77.0.{number}/24', 'dev', end],
                      ['-n', name, 'link', 'set', end, 'up'],
                      ['-n', name, 'link', 'set', 'lo', 'up'],
                      ['-n', name, 'route', 'add', '224.0.0.0/4', 'dev', end]):
            done = ip(*words)
            assert done.returncode == 0, done.stderr
    return [['ip', 'netns', 'exec', name] for name in names]


def virtual_cable(ends):
    """Return a cable that loses nothing."""
    made = ip('link', 'add', ends[0], 'type', 'veth', 'peer', 'name', ends[1])
    if made.returncode:
        pytest.skip(f'virtual cables are not permitted here: {made.stderr.strip()}')


@pytest.fixture
def hosts(unjoined):
    """Command prefixes of two hosts, joined by a virtual cable."""
    names, ends = unjoined
    virtual_cable(ends)
    return join(names, ends)


LOSS, DELAY = 0.02, 0.005


@pytest.fixture
def far_hosts(unjoined):
    """Two hosts joined by a cable with LOSS and DELAY [s] each way.

    By `tc` where the kernel has netem, else by a process that carries the frames.
    """
    names, ends = unjoined
    virtual_cable(ends)
    hosts = join(names, ends)
    netem = ['root', 'netem', 'loss', f'{100 * LOSS:g}%', 'delay', f'{1000 * DELAY:g}ms']
    if shutil.which('tc') and all(subprocess.run(
            [*host, 'tc', 'qdisc', 'add', 'dev', end, *netem], capture_output=True).returncode == 0
            for host, end in zip(hosts, ends)):
        yield hosts
        return
    ip('-n', names[0], 'link', 'delete', ends[0])
    carrier = subprocess.Popen(
        [sys.executable, HELPERS / 'cable.py', *ends, str(LOSS), str(DELAY)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        if carrier.stdout.readline() != 'ready\n':
            carrier.kill()
            pytest.skip('neither netem nor TAP devices here: '
                        f'{carrier.stderr.read().strip().splitlines()[-1]}')
        yield join(names, ends)
    finally:
        carrier.kill()
        carrier.communicate()


def numbers_of(line):
    """All whole numbers in a line."""
    return [int(word) for word in ''.join(c if c.isdigit() else ' ' for c in line).split()]


def test_simulator_and_node_on_two_hosts(program, hosts):
    """A crane on one host, the node on the other: all of 1,000 evaluations come back.

    Else the crane's status is not 0.
    """
    here, there = hosts
    node = program('contact_node', '--ros-args', *CUBES, env=SUBNET, within=there)
    node.wait_for_output('ready', 120)
    crane = program('crane', '--ros-args', *CUBES, '-p', 'duration:=5', '-p', 'wait:=20',
                    env=SUBNET, within=here)
    assert crane.wait(120) == 0, crane.output
    assert 'messages lost .......... 0' in crane.output
    node.signal(signal.SIGTERM)
    assert node.wait() == 0


def test_a_bad_cable(program, far_hosts):
    """2 % loss and 5 ms delay each way: what is not answered is told as lost, not made up.

    Poses are lost, since they are sent best effort and one that is late is worth nothing. Point and
    normal, of which 4 in 100 would lack one, are sent again, as long as they are among the last
    ten, which here is 200 ms.
    """
    here, there = far_hosts
    node = program('contact_node', '--ros-args', *CUBES, env=SUBNET, within=there)
    node.wait_for_output('ready', 120)
    crane = program('crane', '--ros-args', *CUBES, '-p', 'duration:=12', '-p', 'wait:=20',
                    '-p', 'rate:=50', '-p', 'report:=true', env=SUBNET, within=here)
    crane.wait(120)
    lost, = (line for line in crane.output.splitlines() if 'messages lost' in line)
    _, evaluations, contacts = numbers_of(lost)
    assert 0 < evaluations < 100  # of 800; 4 % lack one pose or the other, 2 % the cloud
    assert contacts < 9  # of some 435, of which 4 in 100 are 17; measured 2 to 4
    assert 'wrong verdicts ......... 0' in crane.output


def test_a_yard_shared_by_two_hosts(program, hosts, tmp_path):
    """1,000 pairs of a load and a yard, half of them with a node on each host.

    The nodes hear the same poses: together they answer every tick as one node with all of the pairs
    would. That is how a scene grows past one machine.
    """
    here, there = hosts
    size = [12.192, 2.438, 2.591]
    boxes = {'load': {'size': size}} | {
        f's{n}': {'size': size, 'pose': [12.7 * i, 2.7 * j, 2.591 * k, 0, 0, 0, 1]}
        for n, (i, j, k) in enumerate(np.ndindex(10, 20, 5))}
    pairs = [{'id': n, 'name': f'load_s{n}', 'a': f's{n}', 'b': 'load'} for n in range(1000)]
    nodes = []
    for number, host in enumerate((here, there)):
        path = tmp_path / f'share_{number}.yaml'
        path.write_text(json.dumps({'boxes': boxes, 'pairs': pairs[number::2]}))
        nodes.append(program('contact_node', '--ros-args', '-p', f'scene:={path}',
                             '-p', 'pair_topics:=false', '-r', f'__node:=share_{number}',
                             env=SUBNET, within=host))
    whole = tmp_path / 'whole.yaml'
    whole.write_text(json.dumps({'boxes': boxes, 'pairs': pairs}))
    for node in nodes:
        node.wait_for_output('ready', 120)
    script = HELPERS / 'shared_scene.py'
    played = subprocess.run([*here, sys.executable, script, whole, '2', '600'],
                            env=os.environ | SUBNET, capture_output=True, text=True, timeout=180)
    print(played.stdout)
    assert played.returncode == 0, played.stdout + played.stderr

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

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
from pathlib import Path

import pytest
from patience import PATIENCE

HELPERS = Path(__file__).resolve().parents[1] / 'helpers'
SUBNET = {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET'}
SIMULATOR = """
import time
from raw_client import APART, ORIGIN, TOUCHING
from ros_client import Client
client, stamps = Client(), []
client.offer_until_answered(ORIGIN, APART)
for _ in range(300):
    stamps.append(client.send(ORIGIN, TOUCHING))
    client.keep_up(stamps)
    client.spin(lambda: False, 0.004)
assert client.are_answered(stamps)
assert client.spin(lambda: all(stamp in client.points for stamp in stamps))
client.close()
"""


def ip(*words):
    return subprocess.run(['ip', *words], capture_output=True, text=True)


@pytest.fixture
def hosts():
    """Return command prefixes of two hosts that are joined by a virtual cable."""
    if not shutil.which('ip'):
        pytest.skip('two hosts need `ip` (iproute2)')
    tag = uuid.uuid4().hex[:6]
    names, ends = ([f'{start}{side}{tag}' for side in 'ab'] for start in ('bcr', 'v'))
    made = [name for name in names if ip('netns', 'add', name).returncode == 0]
    try:
        if len(made) < 2:
            pytest.skip('network namespaces are not permitted here')
        cable = ip('link', 'add', ends[0], 'type', 'veth', 'peer', 'name', ends[1])
        if cable.returncode:
            pytest.skip(f'virtual cables are not permitted here: {cable.stderr.strip()}')
        for number, (name, end) in enumerate(zip(names, ends), 1):
            for words in (['link', 'set', end, 'netns', name],
                          ['-n', name, 'addr', 'add', f'10.77.0.{number}/24', 'dev', end],
                          ['-n', name, 'link', 'set', end, 'up'],
                          ['-n', name, 'link', 'set', 'lo', 'up'],
                          ['-n', name, 'route', 'add', '224.0.0.0/4', 'dev', end]):
                done = ip(*words)
                assert done.returncode == 0, done.stderr
        yield [['ip', 'netns', 'exec', name] for name in names]
    finally:
        for name in made:
            ip('netns', 'delete', name)


def test_simulator_and_node_on_two_hosts(program, hosts):
    """All of 300 ticks come back."""
    here, there = hosts
    node = program('contact_node', '--ros-args', '-p', 'size_a:=[2.0, 2.0, 2.0]',
                   '-p', 'size_b:=[2.0, 2.0, 2.0]', env=SUBNET, within=there)
    node.wait_for_output('ready')
    paths = os.pathsep.join(filter(None, (str(HELPERS), os.environ.get('PYTHONPATH'))))
    simulator = subprocess.run(
        [*here, sys.executable, '-c', SIMULATOR], capture_output=True, text=True, timeout=PATIENCE,
        env={**os.environ, **SUBNET, 'PYTHONPATH': paths})
    assert simulator.returncode == 0, simulator.stderr
    node.signal(signal.SIGTERM)
    assert node.wait() == 0

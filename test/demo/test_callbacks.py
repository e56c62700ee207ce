# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Callbacks that raise, in every program: logged with topic and cause, and the program goes on."""
from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

from box_contact_ros.node.runtime import LOG_SECONDS

pytest.importorskip('rosbags')
pytest.importorskip('mujoco')

APPS = Path(__file__).resolve().parents[2] / 'box_contact_ros'
SECONDS = 2.5
PROGRAM = f"""
import sys, time
from pathlib import Path
from types import SimpleNamespace
from geometry_msgs.msg import PointStamped, PoseStamped
from rclpy.parameter import Parameter
from box_contact_ros.bench.bench_drive import BenchNode
from box_contact_ros.bench.echo_node import EchoNode
from box_contact_ros.demo.crane_node import CraneNode
from box_contact_ros.view.recording.record import RecordNode
from box_contact_ros.node.ros_client import ANSWERS
from box_contact_ros.view.listener import ViewNode
from box_contact_ros.view.markers import MarkersNode
from box_contact_ros.view.scene_driver import SceneDriver
from box_contact_ros.node.contact_node import ContactNode
from box_contact_ros.node.evaluator import Evaluator
from box_contact_ros.node.runtime import CONTACT_QOS, GuardedNode, joined, spin_for
from box_contact_ros.scene.scene_solver import two_boxes

TWO = two_boxes((1, 1, 1), (1, 1, 1))

def fails(*_, **__):
    raise KeyError('planted')

for kind, name in ((BenchNode, '_keep'), (CraneNode, '_on_answer'),
                   (RecordNode, '_keep'), (ViewNode, 'listen_to'),
                   (MarkersNode, 'heard'), (SceneDriver, '_publish'), (Evaluator, '_answer')):
    setattr(kind, name, fails)

class Source(GuardedNode):
    def __init__(self, context):
        super().__init__('source', context=context)
        self.out = [self.create_publisher(kind, topic, CONTACT_QOS) for kind, topic in (
            (PoseStamped, 'box_a/pose'), (PoseStamped, 'box_b/pose'), (PointStamped,
            'contact/point'), ANSWERS['cloud'], (PointStamped,
            'echo/contact/point'))]
        self.create_timer(0.02, self.publish)

    def publish(self):
        message = PoseStamped()
        message.header.stamp = self.get_clock().now().to_msg()
        message.pose.orientation.w = 1.0
        for publisher in self.out:
            publisher.publish(message if publisher.msg_type is PoseStamped
                              else publisher.msg_type())

def nodes(context):
    return [Source(context), BenchNode(context, {{'echo': 'for_echo/'}}),
            CraneNode(context), EchoNode(context),
            RecordNode(context, Path(sys.argv[1]), ['box_a/pose'], {{}}),
            ContactNode(context), ViewNode(context, 'contact_node'), MarkersNode(context),
            SceneDriver(context, TWO, 50.0)]

with joined(Source) as (source, executor):
    others = nodes(source.context)
    others[3]._answers = [(SimpleNamespace(publish=fails), bytes(16))]
    for node in others:
        executor.add_node(node)
    until = time.monotonic() + {SECONDS}
    while time.monotonic() < until:
        spin_for(source, executor, 0.5)
    print('went on', flush=True)
    for node in others[:4] + others[5:]:
        node.destroy_node()
"""


@pytest.fixture(scope='module')
def printed(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Run a node of every program whose callbacks raise at 50 Hz; return what it printed."""
    done = subprocess.run([sys.executable, '-c', PROGRAM, tmp_path_factory.mktemp('bag') / 'run'],
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=120)
    assert done.returncode == 0 and 'went on' in done.stdout, done.stdout
    return done.stdout


@pytest.mark.parametrize('node, what', [
    ('bench', 'echo/contact/point'), ('crane', 'contact/point'), ('echo_node', 'box_b/pose'),
    ('record', 'box_a/pose'), ('markers', 'box_[ab]/pose'),
    ('view', 'parameters of the contact node'), ('scene_driver', 'fails'),
    ('contact_node', '')])
def test_a_callback_that_raises(printed, node, what):
    """The program goes on; the line names topic and cause, at most once a second."""
    lines = [line for line in printed.splitlines() if f'[{node}]: ' in line and 'planted' in line]
    assert 1 <= len(lines) <= SECONDS / LOG_SECONDS + 1
    cause = re.compile(rf"\]: {what}{': ' * bool(what)}KeyError: 'planted'; ")
    assert all(cause.search(line) for line in lines)


def test_all_nodes_of_the_programs_are_guarded():
    """Also those that come: no class of apps/ derives from rclpy's node itself."""
    for file in APPS.rglob('*.py'):
        for node in ast.walk(ast.parse(file.read_text('utf-8'))):
            if isinstance(node, ast.ClassDef):
                assert not any(isinstance(base, ast.Name) and base.id in ('Node', 'LifecycleNode')
                               for base in node.bases), f'{file}: {node.name}'

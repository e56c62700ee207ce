# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Callbacks that raise: logged with topic and cause, and the program goes on."""
from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

from box_contact_ros.node.runtime import LOG_SECONDS

pytest.importorskip('mujoco')

PACKAGE = Path(__file__).resolve().parents[2] / 'box_contact_ros'
SECONDS = 2.5
PROGRAM = f"""
import time
from box_contact_msgs.msg import Contacts
from box_contact_ros.demo.crane_node import CraneNode
from box_contact_ros.node.runtime import GuardedNode, running_node, spin_for

def fails(*_):
    raise KeyError('planted')

class Source(GuardedNode):
    def __init__(self, context):
        super().__init__('source', context=context)
        self.out = self.create_publisher(Contacts, 'contacts', 10)
        self.create_timer(0.02, self.publish)
        self.create_timer(0.02, fails)

    def publish(self):
        self.out.publish(Contacts())

CraneNode._on_contacts = fails
with running_node(Source) as (source, executor):
    crane = CraneNode(source.context)
    executor.add_node(crane)
    until = time.monotonic() + {SECONDS}
    while time.monotonic() < until:
        spin_for(source, executor, 0.5)
    print('went on', flush=True)
    crane.destroy_node()
"""


@pytest.fixture(scope='module')
def printed() -> str:
    """Run two nodes whose callbacks raise at 50 Hz; return what was printed."""
    done = subprocess.run([sys.executable, '-c', PROGRAM], stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True, timeout=120)
    assert done.returncode == 0 and 'went on' in done.stdout, done.stdout
    return done.stdout


@pytest.mark.parametrize('node, what', [('crane', 'contacts'), ('source', 'fails')])
def test_a_callback_that_raises(printed, node, what):
    """The program goes on; the line names topic and cause, at most once a second."""
    lines = [line for line in printed.splitlines() if f'[{node}]: ' in line and 'planted' in line]
    assert 1 <= len(lines) <= SECONDS / LOG_SECONDS + 1
    cause = re.compile(rf"\]: {what}: KeyError: 'planted'; ")
    assert all(cause.search(line) for line in lines)


def test_all_nodes_of_the_programs_are_guarded():
    """A class that derives from rclpy's node derives from GuardedNode first."""
    for file in PACKAGE.rglob('*.py'):
        for node in ast.walk(ast.parse(file.read_text('utf-8'))):
            if isinstance(node, ast.ClassDef) and node.name != 'GuardedNode':
                bases = [base.id for base in node.bases if isinstance(base, ast.Name)]
                assert bases[:1] == ['GuardedNode'] or not {'Node', 'LifecycleNode'} & set(bases), (
                    f'{file}: {node.name}')

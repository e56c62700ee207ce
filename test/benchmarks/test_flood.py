# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The floods of strangers: a second of them, and what the exit status tells."""
from __future__ import annotations

import math
import os
import subprocess
import sys

import pytest

pytest.importorskip('mujoco')

from benchmarks.flood import ANSWERED, GROWTH_LIMIT, PER_HOUR, passed

GOOD = {'contact': ['floods', ANSWERED], 'echo': ['floods', ANSWERED]}


@pytest.mark.parametrize('growth, told, expected', [
    (GROWTH_LIMIT - 1.0, GOOD, True), (-1.0, GOOD, True), (GROWTH_LIMIT + 1.0, GOOD, False),
    (math.nan, GOOD, False), (0.0, GOOD | {'contact': []}, False),
    (0.0, GOOD | {'echo': ['NO REQUEST IS ANSWERED']}, False)],
    ids=['less', 'shrunk', 'more', 'ended', 'nothing printed', 'deaf'])
def test_status(growth, told, expected):
    """Success needs a bounded memory of the contact node, and answers of both."""
    assert passed({'contact': growth, 'echo': 1000.0}, told) is expected


def test_a_second_of_floods():
    """Both nodes are flooded, answer afterwards, and the contact node has not grown."""
    done = subprocess.run(
        [sys.executable, '-m', 'benchmarks.flood', '--seconds', '2',
         '--domain', os.environ['ROS_DOMAIN_ID']],
        capture_output=True, text=True, timeout=280)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count(ANSWERED) == 2
    assert all(done.stdout.count(f'{name} ') == 2 for name in PER_HOUR)

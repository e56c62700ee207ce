# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""ament's linters, as a ROS package runs them: skipped where they are not installed."""
from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest
from patience import PATIENCE

ROOT = Path(__file__).parents[2]
SOURCES = [str(ROOT / name) for name in
           ('box_contact_msgs', 'box_contact_ros', 'launch', 'setup.py')]
"""What is installed. ruff, which has most of these rules, reads the tests too."""

CONFIG = str(Path(__file__).with_name('flake8.ini'))
NOT_FOLLOWED = ['D213']
"""Rule of ament's pep257 that the package does not follow: PEP 257 itself lets a summary stand on
the first line or on the second."""


def run(linter: str, *words: str) -> None:
    """Run a linter in a process of its own: flake8 forks, and other tests have left threads."""
    if not importlib.util.find_spec(linter):
        pytest.skip(f'{linter} is not installed')
    done = subprocess.run([sys.executable, '-m', f'{linter}.main', *words], text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=PATIENCE)
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
def test_flake8() -> None:
    run('ament_flake8', '--config', CONFIG, *SOURCES)


@pytest.mark.slow
def test_pep257() -> None:
    run('ament_pep257', '--add-ignore', *NOT_FOLLOWED, '--', *SOURCES)

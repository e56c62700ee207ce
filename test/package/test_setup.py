# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The set-up behind make's targets: what it refuses, and what the demo compiles."""
from __future__ import annotations

import os
import runpy
import shutil
import subprocess
from pathlib import Path

import pytest

from box_contact_ros.core import instruction_sets

ROOT = Path(__file__).resolve().parents[2]


def test_the_demo_builds_the_best_instruction_set_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """And the baseline, which every machine can run."""
    monkeypatch.setenv('BOX_CONTACT_BUILD', 'best')
    monkeypatch.setattr('setuptools.setup', lambda **given: None)
    monkeypatch.chdir(ROOT)
    built = list(runpy.run_path('setup.py')['INSTRUCTION_SETS'])
    assert built == [*dict.fromkeys(['baseline', instruction_sets()[-1]])]


def test_a_python_that_is_not_there_is_named(tmp_path: Path) -> None:
    """With how to get one; nothing is created."""
    (tmp_path / '.ci').mkdir()
    shutil.copy(ROOT / '.ci' / 'setup', tmp_path / '.ci')
    done = subprocess.run([tmp_path / '.ci' / 'setup', 'demo'], capture_output=True, text=True,
                          env=os.environ | {'PYTHON': '/no/such/python'}, timeout=60)
    assert done.returncode == 1
    assert done.stderr.startswith(
        'error: Python 3.11 to 3.14 is needed (/no/such/python: not found). Install one (apt')
    assert not (tmp_path / '.venv').exists()

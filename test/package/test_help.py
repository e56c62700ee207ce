# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every program prints its help where no extra is installed, and names the extra when it runs."""
from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from conftest import EXTRAS, PROGRAMS
from patience import PATIENCE

from box_contact_ros import extras

ROOT = Path(__file__).resolve().parents[2]
ABSENT = {name for modules in EXTRAS.values() for name in modules} - {'safetensors'}
ALONE = f"""
import runpy, sys
from importlib.machinery import PathFinder
find = PathFinder.find_spec
PathFinder.find_spec = classmethod(lambda cls, name, *rest: (
    None if name.partition('.')[0] in {ABSENT} else find(name, *rest)))
program, *arguments = sys.argv[1:]
sys.orig_argv, sys.argv = ['python', '-m', *sys.argv[1:]], [program, *arguments]
sys.path += [{str(ROOT)!r}, {str(ROOT / 'docs' / 'figures')!r}]
run = runpy.run_path if program.endswith('.py') else runpy.run_module
run(program, run_name='__main__')
"""
REPORTS = {f'benchmarks.{path.stem}' for path in ROOT.glob('benchmarks/*.py')
           if "__name__ == '__main__'" in path.read_text('utf-8')}
INSTALLED = {f'box_contact_ros.{module}' for module in (*PROGRAMS.values(), 'demo.demo')}
CHECKOUT = REPORTS | {'benchmarks.paper', 'benchmarks.paper.search', 'training',
                      *(f'docs/figures/make_{what}.py' for what in ('figures', 'tilt_gif'))}


def alone(*words: str) -> subprocess.CompletedProcess[str]:
    """Run a program as in an environment without extras, and the package as it is installed."""
    return subprocess.run([sys.executable, '-P', '-c', ALONE, *words], cwd=ROOT,
                          capture_output=True, text=True, timeout=PATIENCE)


@pytest.mark.parametrize('program', [*sorted(INSTALLED), *(
    pytest.param(program, marks=pytest.mark.reports) for program in sorted(CHECKOUT))])
def test_help_needs_no_extra(program: str) -> None:
    done = alone(program, '--help')
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith('usage: ') and '--help' in done.stdout


@pytest.mark.reports
@pytest.mark.parametrize('program', sorted(CHECKOUT))
def test_a_program_names_its_extra_before_the_work(program: str, tmp_path: Path) -> None:
    """In one line, with pip's command; nothing is written."""
    out = [] if program in ('benchmarks.service', 'benchmarks.searched') else [
        '--out', str(tmp_path)]
    done = alone(program, *out)
    assert (done.returncode, done.stderr.count('\n')) == (1, 1), done.stderr
    assert "pip install -c constraints.txt -e '.[" in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_each_module_of_an_extra_is_known() -> None:
    """A module that our programs import, but that no table has, would end in a traceback."""
    assert extras.EXTRA_OF.keys() >= ABSENT - {
        'catkin_pkg', 'coal', 'hypothesis', 'pybullet', 'rosbags'}


def test_view_without_ros_asks_for_a_file() -> None:
    done = alone('box_contact_ros.view.view')
    assert (done.returncode, done.stderr.count('\n')) == (1, 1)
    assert done.stderr.endswith('; or name a FILE to see its plan\n') and '.[ros]' in done.stderr
    assert 'view FILE' in alone('box_contact_ros.view.view', '--help').stdout

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Programs print their help where no extra is installed, and name the extra when they run."""
from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from conftest import PROGRAMS
from patience import PATIENCE

from box_contact_ros.extras import EXTRA_OF, MODULES

ROOT = Path(__file__).resolve().parents[2]
HELP = """
import sys
from importlib import import_module


class CoreAlone:
    @staticmethod
    def find_spec(name, path=None, target=None):
        root = name.partition('.')[0]
        if root not in {*sys.stdlib_module_names, 'box_contact_ros', 'numpy', 'yaml', '_yaml'}:
            raise ModuleNotFoundError(f'No module named {name!r}', name=name)


sys.meta_path.insert(0, CoreAlone)
for word in sys.argv[1:]:
    program, module = word.split('=')
    sys.argv = [f'bin/box_contact_{program}', '--help']
    try:
        import_module(f'box_contact_ros.{module}').main()
    except SystemExit as end:
        print('ended', end.code)
"""
ALONE = f"""
import runpy, sys
from importlib.machinery import PathFinder
find = PathFinder.find_spec
PathFinder.find_spec = classmethod(lambda cls, name, *rest: (
    None if name.partition('.')[0] in {set(EXTRA_OF)} else find(name, *rest)))
program, *arguments = sys.argv[1:]
sys.argv = [program, *arguments]
sys.path += [{str(ROOT)!r}, {str(ROOT / 'docs' / 'figures')!r}]
run = runpy.run_path if program.endswith('.py') else runpy.run_module
run(program, run_name='__main__')
"""
REPORTS = {f'benchmarks.{path.stem}' for path in ROOT.glob('benchmarks/*.py')
           if "__name__ == '__main__'" in path.read_text('utf-8')}
CHECKOUT = REPORTS | {'benchmarks.paper', 'benchmarks.paper.search', 'training',
                      *(f'docs/figures/make_{what}.py' for what in ('figures', 'tilt_gif'))}


def alone(*words: str) -> subprocess.CompletedProcess[str]:
    """Run a program as in an environment without extras, and the package as it is installed."""
    return subprocess.run([sys.executable, '-P', '-c', ALONE, *words], cwd=ROOT,
                          capture_output=True, text=True, timeout=PATIENCE)


def test_help_needs_the_core_alone() -> None:
    """Of the programs that are installed, and of the demo; all in one process."""
    programs = PROGRAMS | {'demo': 'demo.demo'}
    done = subprocess.run([sys.executable, '-P', '-c', HELP, *map('='.join, programs.items())],
                          cwd=ROOT, capture_output=True, text=True, timeout=PATIENCE)
    assert done.returncode == 0, done.stderr
    *pages, end = done.stdout.split('ended 0\n')
    usages = [page.partition('[')[0] for page in pages]
    assert usages == [f'usage: box_contact_{program} ' for program in programs] and not end


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


def test_the_extras_are_those_of_setup(setup_arguments: dict[str, Any]) -> None:
    """`docs` and `dist` have programs alone."""
    assert MODULES.keys() == setup_arguments['extras_require'].keys() - {'docs', 'dist'}


def test_view_without_ros_asks_for_a_file() -> None:
    done = alone('box_contact_ros.view.view')
    assert (done.returncode, done.stderr.count('\n')) == (1, 1)
    assert '.[ros,view]' in done.stderr
    assert done.stderr.endswith('; or name a FILE to see its plan\n')
    assert 'view FILE' in alone('box_contact_ros.view.view', '--help').stdout

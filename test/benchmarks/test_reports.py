# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What all reports share: `make reports`, which runs them, and readable numbers."""
from __future__ import annotations

import importlib.util
import math
import os
import re
import shutil
import subprocess
import time
from pathlib import Path

import pytest
from patience import PATIENCE

from benchmarks import output

pytestmark = pytest.mark.reports

ROOT = Path(__file__).resolve().parents[2]
STAND_IN = """#!/bin/sh
echo "$@" >>called
case "$*" in *speed*) exit 3;; esac
"""
"""Takes the place of Python: writes down how it was called, and fails where speed is measured."""


def listed() -> list[str]:
    """Return the programs that `make reports` runs."""
    return re.findall(r'(?m)^\trun (benchmarks[.\w]+) ', (ROOT / 'Makefile').read_text('utf-8'))


def make_reports(folder: Path, *arguments: str) -> tuple[subprocess.CompletedProcess, list[str]]:
    """Run `make reports` with stand-ins for all that it calls; return how Python was called."""
    (folder / '.ci').mkdir()
    shutil.copy(ROOT / 'Makefile', folder)
    for path, text in ((folder / '.ci' / 'setup', '#!/bin/sh\n'), (folder / 'python', STAND_IN)):
        path.write_text(text)
        path.chmod(0o755)
    env = {name: value for name, value in os.environ.items()
           if not name.startswith(('MAKE', 'MFLAGS'))}  # `make test` may be what runs this
    done = subprocess.run(['make', 'reports', 'PY=./python', 'CMAKE=true', *arguments], cwd=folder,
                          env=env, capture_output=True, text=True, timeout=PATIENCE)
    return done, (folder / 'called').read_text().splitlines()


def test_a_report_that_fails_is_named_and_the_others_run(tmp_path: Path) -> None:
    done, calls = make_reports(tmp_path)
    assert done.returncode == 2 and 'failed: benchmarks.speed\n' in done.stderr
    assert [call.split()[1] for call in calls if 'benchmarks' in call] == listed()
    assert calls[-1] == 'docs/tables.py'


def test_a_quick_run_leaves_the_results_alone(tmp_path: Path) -> None:
    done, calls = make_reports(tmp_path, 'ARGS=--quick')
    assert len(calls) > len(listed())
    assert all('--quick' in call or '--out quick-results' in call for call in calls)
    assert not any('docs' in call for call in calls)


def test_every_program_is_listed() -> None:
    """The search for the worst case and the limits of services are run alone."""
    programs = {f'benchmarks.{path.stem}' for path in (ROOT / 'benchmarks').glob('*.py')
                if "__name__ == '__main__'" in path.read_text('utf-8')}
    alone = {'benchmarks.searched', 'benchmarks.service', 'benchmarks.yard_clients',
             'benchmarks.yard_growth'}
    assert programs - alone <= set(listed())


@pytest.mark.parametrize('name', [
    pytest.param(name, marks=[pytest.mark.training] * (name == 'benchmarks.paper.search'))
    for name in listed()])
def test_a_listed_report_is_a_program(name: str, tmp_path: Path) -> None:
    """A module, or a folder with `__main__`; its `main` takes --quick and --out."""
    folder = importlib.util.find_spec(name).submodule_search_locations
    module = importlib.import_module(f'{name}.__main__' if folder else name)
    assert "__name__ == '__main__'" in Path(module.__file__).read_text('utf-8')
    with pytest.raises(SystemExit, match='0'):
        module.main(['--quick', '--out', 'folder', '--help'])
    (tmp_path / 'file').write_text('mine')  # is refused before the work
    with pytest.raises(SystemExit, match='2'):
        module.main(['--quick', '--out', str(tmp_path / 'file')])
    assert (tmp_path / 'file').read_text() == 'mine'


def test_a_page_says_how_long_its_program_took(tmp_path: Path,
                                               monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(output, 'BEGIN', time.monotonic() - 440.0)
    text = output.write_page(tmp_path, 'stacks', ['--quick'], machine='M', rest='', both='',
                             pushed='', engines='', missing='', times='', ways='', box3d='',
                             scenes=54,
                             cheaper=34)
    assert 'Made by `python -m benchmarks.stacks --quick` in 7 minutes on M' in text
    monkeypatch.setattr(output, 'BEGIN', time.monotonic() - 12.0)
    assert output.took() == '12 s'


def test_numbers_are_readable() -> None:
    values = (math.nan, 0.0, 1e-9, 0.0123, 1.2345, 98.76, 1234.5)
    assert [output.number(value) for value in values] == [
        '–', '0', '<0.001', '0.0123', '1.23', '98.8', '1,234']

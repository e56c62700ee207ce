# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The set-up behind make's targets: the lock, what a second call does, and what is refused."""
from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
import tomllib

ROOT = Path(__file__).resolve().parents[2]

PYTHON = """#!/bin/bash
# In the place of Python and uv: each writes what it is asked for into the file `calls`.
case "$0 $*" in
    *'-m venv'*) mkdir -p .venv/bin; for name in python uv; do cp "$0" .venv/bin/$name; done ;;
    *uv*compile*) echo "$*" >compiled; touch .venv/roots.txt; exit ;;
    *' -e '*) echo built >box_contact_ros/core.so
        if [ -e saved ]; then mv saved box_contact_ros/core.hpp; fi ;;
esac
case "$*" in *install*|*'-m venv'*) echo "$*" >>calls; sleep "${SLOW:-0}" ;; esac
"""
NEW = ['-m venv', 'tools', 'roots', 'box-contact-ros']
"""What a first set-up asks for: an environment, tools, packages, the package itself."""


def versions(path: str) -> list[str]:
    """Return the lines of a lock that pin a version, each without hashes."""
    return re.findall(r'^[a-z].*?(?= *\\?$)', (ROOT / path).read_text(), re.MULTILINE)


def test_the_lock_pins_all_that_is_asked_for(setup_arguments: dict[str, Any]) -> None:
    """Once, with hashes; constraints.txt and the tools of isolated builds have its versions."""
    lock = versions('.ci/lock.txt')
    assert versions('constraints.txt') == lock
    assert (ROOT / '.ci/lock.txt').read_text().count(' \\\n    --hash=sha256:') >= len(lock) > 200
    requires = tomllib.loads((ROOT / 'pyproject.toml').read_text())['build-system']['requires']
    assert set(requires) <= set(lock)
    asked = [*setup_arguments['install_requires'],
             *sum(setup_arguments['extras_require'].values(), [])]
    names = {line.partition('==')[0] for line in lock}
    assert {re.match('[a-z0-9-]+', line)[0] for line in asked} <= names


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """Return a folder, with a blank in its path, that has what .ci/setup reads."""
    folder = tmp_path / 'a clone'
    for name in ('.ci/setup', '.ci/lock.txt', 'CMakeLists.txt', 'setup.py', 'setup.cfg',
                 'pyproject.toml', 'box_contact_msgs/pyproject.toml'):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, folder / name)
    (folder / 'box_contact_ros').mkdir()
    (folder / 'box_contact_ros' / 'core.hpp').write_text('header')
    (folder / 'python').write_text(PYTHON)
    (folder / 'python').chmod(0o755)
    return folder


def start(clone: Path, target: str = 'demo', python: str = './python', slow: str = '0',
          ) -> subprocess.Popen[str]:
    return subprocess.Popen([clone / '.ci' / 'setup', target], text=True, stderr=subprocess.STDOUT,
                            stdout=subprocess.PIPE, start_new_session=True,
                            env={'PATH': '/usr/bin:/bin', 'PYTHON': python, 'SLOW': slow})


def set_up(clone: Path, target: str = 'demo') -> list[str]:
    """Set up a target; return what was asked for since the last call."""
    process = start(clone, target)
    output, _ = process.communicate()
    assert process.returncode == 0, output
    return calls(clone)


def calls(clone: Path) -> list[str]:
    if not (clone / 'calls').exists():
        return []
    text = (clone / 'calls').read_text()
    (clone / 'calls').unlink()
    return re.findall('-m venv|tools|roots|box-contact-ros', text)


def test_a_second_call_does_what_is_missing_alone(clone: Path) -> None:
    """Contents count, not times, and a target that needs more installs more."""
    header = clone / 'box_contact_ros' / 'core.hpp'
    assert set_up(clone) == NEW
    assert set_up(clone) == []
    header.touch()
    assert set_up(clone) == []
    header.write_text('another header')
    assert set_up(clone) == ['box-contact-ros']
    header.with_suffix('.so').unlink()
    assert set_up(clone) == ['box-contact-ros']
    assert set_up(clone, 'test') == ['tools', 'roots']
    assert set_up(clone) == set_up(clone, 'test') == []
    (clone / '.ci' / 'lock.txt').write_text('# an older lock')
    assert set_up(clone) == ['tools', 'roots', 'box-contact-ros']
    assert set_up(clone, 'test') == ['tools', 'roots']


def test_what_is_saved_during_a_build_is_built_next(clone: Path) -> None:
    (clone / 'saved').write_text('a header that was saved while the compiler ran')
    assert set_up(clone) == NEW
    assert set_up(clone) == ['box-contact-ros']
    assert set_up(clone) == []


def test_pytorch_is_for_training_alone(clone: Path) -> None:
    for target, asked in (('test', False), ('training', True), ('reports', True)):
        set_up(clone, target)
        assert ('--extra=train' in (clone / 'compiled').read_text().split()) == asked, target


def test_a_killed_set_up_begins_anew_and_a_second_one_waits(clone: Path) -> None:
    killed = start(clone, slow='0.5')
    while 'roots.txt' not in ((clone / 'calls').read_text() if (clone / 'calls').exists() else ''):
        assert killed.poll() is None, killed.communicate()
    killed.kill()
    killed.communicate()
    calls(clone)
    first, second = start(clone, slow='0.1'), start(clone, slow='0.1')
    outputs = [process.communicate()[0] for process in (first, second)]
    assert [first.returncode, second.returncode] == [0, 0], outputs
    assert any('another make' in output for output in outputs)
    assert calls(clone) == NEW
    shutil.move(clone, clone.with_name('moved'))
    assert set_up(clone.with_name('moved')) == NEW


def test_what_is_not_there_or_not_ours_is_named(clone: Path) -> None:
    """Nothing is created, nor deleted."""
    refused = start(clone, python='/no/such/python')
    output, _ = refused.communicate()
    assert refused.returncode == 1
    assert output.startswith('error: Python 3.11 to 3.14 is needed, and is not here as /no/such/py')
    assert not (clone / '.venv').exists()
    (clone / '.venv' / 'mine').mkdir(parents=True)
    refused = start(clone)
    output, _ = refused.communicate()
    assert refused.returncode == 1
    assert output.startswith('error: .venv exists, and is no environment of Python 3.11 to 3.14')
    assert (clone / '.venv' / 'mine').exists()


@pytest.mark.parametrize('shared', ['false', 'true'])
def test_an_environment_made_by_hand_is_used(clone: Path, shared: str) -> None:
    """As README says to make it; but not one that sees the packages of the machine."""
    subprocess.run(['./python', '-m', 'venv'], cwd=clone, check=True)
    calls(clone)
    (clone / '.venv' / 'pyvenv.cfg').write_text(f'include-system-site-packages = {shared}\n')
    (clone / '.venv' / 'mine').touch()
    if shared == 'true':
        refused = start(clone)
        assert 'error: .venv exists' in refused.communicate()[0]
        assert refused.returncode == 1 and calls(clone) == []
    else:
        assert set_up(clone) == NEW[1:]
        assert set_up(clone) == []
    assert (clone / '.venv' / 'mine').exists()


@pytest.mark.parametrize('name', ['PYTHONDONTWRITEBYTECODE', 'PYTHONPATH', 'RMW_IMPLEMENTATION'])
def test_settings_of_another_environment_stay_out(name: str) -> None:
    """Programs of make would load other packages, or compile their own at each start."""
    done = subprocess.run(['make', '-s', '--eval', 'shown: ; @env', 'shown'], cwd=ROOT, text=True,
                          env={'PATH': '/usr/bin:/bin', name: 'foreign'}, capture_output=True)
    assert 'PATH=' in done.stdout and 'foreign' not in done.stdout, done.stderr

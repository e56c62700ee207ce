# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The four kinds of installation: pip, pip -e, colcon build, colcon build --symlink-install.

Each is made once, from a copy of the tracked files, in a temporary folder, without the network.
Of a plain one the sources are deleted before it is looked at: nothing may reach back to them.
All are built by one compiler, which does not optimise and compiles the same text once.
"""
from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import venv
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from box_contact_ros.cli import PROGRAMS
from box_contact_ros.core import instruction_sets

ROOT = Path(__file__).resolve().parents[2]
NAME = 'box_contact_ros'
DATA = ('weights', 'msg_schemas', 'launch', 'config')
# Also those that are about to be added.
TRACKED = subprocess.run(['git', 'ls-files', '-z', '--cached', '--others', '--exclude-standard'],
                         cwd=ROOT, capture_output=True, text=True).stdout.split('\0')[:-1]
# PYTHONPATH and the ament index must show the installation alone, not what runs the tests.
CLEAN = {name: value for name, value in os.environ.items()
         if not name.startswith(('PYTHONPATH', 'AMENT', 'COLCON', 'CMAKE_PREFIX'))}

pytestmark = pytest.mark.skipif(not TRACKED, reason='not a git checkout: what would be copied?')

COMPILER = f"""#!{sys.executable}
import hashlib, os, pathlib, shlex, shutil, subprocess, sys

compiler, words = shlex.split({os.environ.get('CXX', 'g++')!r}), sys.argv[1:]
if '-c' not in words:
    os.execvp(compiler[0], compiler + words)
at = words.index('-o')
output = words[at + 1]
del words[at:at + 2]
text = subprocess.run([*compiler, *words, '-E', '-P'], stdout=subprocess.PIPE, check=True).stdout
flags = [word for word in words if not word.startswith('-I') and not word.endswith('.cpp')]
found = pathlib.Path(__file__).with_name(hashlib.sha256(repr(flags).encode() + text).hexdigest())
if not found.exists():
    subprocess.run([*compiler, *words, '-O0', '-o', found], check=True)
shutil.copy(found, output)
"""
"""As the compiler: an object is made once for the same flags and the same preprocessed text."""


@pytest.fixture(scope='module', autouse=True)
def one_compiler(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Build all installations with one memory of objects."""
    compiler = tmp_path_factory.mktemp('compiler') / 'c++'
    compiler.write_text(COMPILER)
    compiler.chmod(0o755)
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(CLEAN, 'CXX', str(compiler))
        yield


def run(*words: str | Path, cwd: Path, timeout: float = 180.0) -> str:
    """Output of a command in the clean environment; fails unless its status is 0."""
    done = subprocess.run([str(word) for word in words], cwd=cwd, env=CLEAN, text=True,
                          timeout=timeout, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    assert done.returncode == 0, f'{words}: {done.stdout}'
    return done.stdout


@dataclass(frozen=True)
class Installation:
    """One that has been made below `folder`; `enter` stands before any command run in it."""

    folder: Path
    python: Path
    enter: tuple[str, ...] = ()

    def ask(self, code: str, *args: str) -> dict:
        """Run Python code in it, away from any sources; the JSON object that the code prints."""
        return json.loads(run(*self.enter, self.python, '-c', code, *args, cwd=self.folder.parent))


def copy_sources(to: Path) -> Path:
    for name in TRACKED:
        if (ROOT / name).is_file():
            (to / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, to / name)
    return to


def pip_install(folder: Path, *options: str) -> Installation:
    """Into a virtual environment that borrows the dependencies, and nothing else, from this one."""
    sources = copy_sources(folder / 'sources')
    venv.create(folder / 'venv', symlinks=True)
    python = folder / 'venv' / 'bin' / 'python'
    site_packages = Path(run(python, '-c', 'import sysconfig; print(sysconfig.get_path("purelib"))',
                             cwd=folder).strip())
    # A .pth in a borrowed folder is not read, so an editable install of this package stays out.
    (site_packages / 'borrowed.pth').write_text(sysconfig.get_path('purelib'))
    run(sys.executable, '-m', 'pip', '--python', python, 'install', '--no-index', '--no-deps',
        '--no-build-isolation', *options, sources, cwd=folder)
    if not options:
        shutil.rmtree(sources)
    return Installation(folder, python)


def colcon(workspace: Path, *words: str) -> str:
    pytest.importorskip('colcon_core', reason='colcon is not installed: pip install .[test]')
    return run(Path(sys.executable).with_name('colcon'), '--log-base', workspace / 'log', *words,
               cwd=workspace)


def colcon_build(workspace: Path, *options: str) -> Installation:
    """In a workspace that is then sourced, as a user does."""
    copy_sources(workspace / 'src' / NAME)
    colcon(workspace, 'build', *options)
    if not options:
        shutil.rmtree(workspace / 'src')
        shutil.rmtree(workspace / 'build')
    return Installation(workspace, Path(sys.executable), (
        'bash', '-c', f'source {workspace}/install/setup.bash && exec "$@"', 'in'))


INSTALL: dict[str, Callable[[Path], Installation]] = {
    'pip': pip_install,
    'pip -e': lambda folder: pip_install(folder, '-e'),
    'colcon': colcon_build,
    'colcon --symlink-install': lambda folder: colcon_build(folder, '--symlink-install'),
}


@pytest.fixture(scope='module')
def installed(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory,
              ) -> Installation:
    return INSTALL[request.param](tmp_path_factory.mktemp('installed'))


all_kinds = pytest.mark.parametrize('installed', INSTALL, indirect=True)
under_colcon = pytest.mark.parametrize('installed', [kind for kind in INSTALL if 'colcon' in kind],
                                       indirect=True)


@all_kinds
def test_data_files_are_there_and_load(installed: Installation) -> None:
    """Every data file of the repository is found, and none of another installation.

    Weights and schemas can be read.
    """
    found = installed.ask("""
import json, sys
import box_contact_ros
from box_contact_ros.solver.weights_file import load_weights
from box_contact_ros.resources import resource_path
files = {}
for folder in sys.argv[1:]:
    top = resource_path(folder)
    files[folder] = sorted(str(path.relative_to(top)) for path in top.rglob('*')
                           if path.is_file() and path.suffix != '.pyc')
for name in files['weights']:
    if name.endswith('.safetensors'):
        load_weights(resource_path('weights', name))
for name in files['msg_schemas']:
    if name.endswith('.json'):
        json.loads(resource_path('msg_schemas', name).read_text('utf-8'))
places = [box_contact_ros.__file__, *(str(resource_path(folder)) for folder in files)]
print(json.dumps({'files': files, 'places': places}))
""", *DATA)
    assert found['files'] == {
        folder: sorted(str(Path(name).relative_to(folder)) for name in TRACKED
                       if Path(name).parts[0] == folder) for folder in DATA}
    assert all(Path(place).is_relative_to(installed.folder) for place in found['places'])


@all_kinds
def test_contacts_can_be_asked_for(installed: Installation) -> None:
    """The default model, with the weights of the installation."""
    answer = installed.ask("""
import json
from box_contact_ros import ContactSolver
contact = ContactSolver((2, 2, 2), (2, 2, 2))([0, 0, 0, 0, 0, 0, 1], [0, 0, 1.9, 0, 0, 0, 1])
print(json.dumps({'separation': contact.separation, 'point': contact.point.tolist()}))
""")
    assert answer['separation'] == pytest.approx(-0.1)
    assert answer['point'] == pytest.approx([0.0, 0.0, 0.95], abs=1e-6)


@all_kinds
def test_every_instruction_set_is_built(installed: Installation) -> None:
    """The core's extensions are those of the installation, as many as this machine can run."""
    found = installed.ask("""
import json
from box_contact_ros import core
print(json.dumps({'sets': core.instruction_sets(), 'file': core.native.__file__}))
""")
    assert tuple(found['sets']) == instruction_sets()
    assert Path(found['file']).is_relative_to(installed.folder)


@all_kinds
def test_cmake_finds_the_library(installed: Installation, tmp_path: Path) -> None:
    """After colcon by the workspace's environment, after pip by `--cmakedir`; the example runs."""
    for name in ('cmake', 'g++'):
        if not shutil.which(name):
            pytest.skip(f'{name} is not installed')
    enter, ask = installed.enter, (*installed.enter, installed.python, '-m', NAME)
    folder = run(*ask, '--cmakedir', cwd=tmp_path).strip()
    assert Path(folder).is_relative_to(installed.folder)
    told = () if enter else (f'-D{NAME}_DIR={folder}',)
    run(*enter, 'cmake', '-S', ROOT / 'docs' / 'examples' / 'cpp', '-B', tmp_path, *told,
        cwd=tmp_path)
    run('cmake', '--build', tmp_path, cwd=tmp_path)
    assert 'batch: 1 0, volumes 0.030 0.000 m3' in run(tmp_path / 'first_contact', cwd=tmp_path)


@pytest.mark.parametrize('installed', ['pip', 'pip -e'], indirect=True)
def test_pip_puts_the_programs_into_bin(installed: Installation) -> None:
    """Under prefixed names, where a shell finds them."""
    bin_ = installed.folder / 'venv' / 'bin'
    assert {path.name for path in bin_.glob('box_contact_*')} == {
        f'box_contact_{name}' for name in PROGRAMS}
    assert 'usage' in run(bin_ / 'box_contact_accuracy', '--help', cwd=installed.folder)


def test_the_source_distribution_is_the_checkout(tmp_path: Path) -> None:
    """It holds all that git tracks, and beside that only what setuptools adds."""
    sources = copy_sources(tmp_path / 'sources')
    run(sys.executable, 'setup.py', '-q', 'sdist', '--dist-dir', tmp_path, cwd=sources)
    archive, = tmp_path.glob('*.tar.gz')
    with tarfile.open(archive) as file:
        names = {member.name.partition('/')[2] for member in file if member.isfile()}
    assert names - {'PKG-INFO'} - {name for name in names if '.egg-info/' in name} == set(TRACKED)


def test_colcon_knows_the_package_type(tmp_path: Path) -> None:
    """What catkin_pkg rejects would be listed as plain `python`."""
    copy_sources(tmp_path / 'src' / NAME)
    assert colcon(tmp_path, 'list').split() == [NAME, f'src/{NAME}', '(ros.ament_python)']


@under_colcon
def test_ros2_run_finds_the_programs(installed: Installation) -> None:
    """`ros2 run` and `ros2 launch` find their files by way of the ament index.

    `ros2 run` asks it for the package's prefix, and takes an executable file of the program's name
    in its lib/<package>; `ros2 launch` and others ask for the share folder.
    """
    pytest.importorskip('ament_index_python')
    index = installed.ask("""
import json
from ament_index_python.packages import get_package_prefix, get_package_share_directory
print(json.dumps({'prefix': get_package_prefix('box_contact_ros'),
                  'share': get_package_share_directory('box_contact_ros')}))
""")
    prefix = installed.folder / 'install' / NAME
    assert index == {'prefix': str(prefix), 'share': str(prefix / 'share' / NAME)}
    folder = prefix / 'lib' / NAME
    assert {path.name for path in folder.iterdir() if os.access(path, os.X_OK)} == set(PROGRAMS)
    assert all((prefix / 'share' / NAME / data).is_dir() for data in DATA)
    assert (prefix / 'share' / NAME / 'LICENSE').is_file()


@under_colcon
def test_a_node_runs(installed: Installation) -> None:
    """The executable that `ros2 run box_contact_ros contact_node` would start says 'ready'."""
    pytest.importorskip('rclpy')
    node = installed.folder / 'install' / NAME / 'lib' / NAME / 'contact_node'
    with subprocess.Popen([*installed.enter, node], cwd=installed.folder, env=CLEAN, text=True,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:
        try:
            lines: list[str] = []
            while 'ready' not in ''.join(lines[-1:]):
                lines.append(process.stdout.readline())
                assert lines[-1], ''.join(lines)  # it ended
        finally:
            process.kill()

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The package as a thing to install: data files, programs, metadata, what an import costs."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

import box_contact_ros
from box_contact_ros import __main__ as command_line
from box_contact_ros import cli, resources
from box_contact_ros.resources import resource_path

ROOT = Path(__file__).resolve().parents[2]


def _touch(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch()
    return path


# --- data files -----------------------------------------------------------------------------------


@pytest.fixture
def places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Path]:
    """Point every place that is searched below tmp_path; return the data folder of each."""
    prefix = tmp_path / 'prefix'
    package = prefix / 'lib' / 'python3.12' / 'site-packages' / 'box_contact_ros'
    package.mkdir(parents=True)
    monkeypatch.setattr(resources, '_PACKAGE', package)
    monkeypatch.setattr(sys, 'prefix', str(tmp_path / 'python'))
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'{tmp_path / "overlay"}:{tmp_path / "underlay"}')
    share = Path('share', 'box_contact_ros')
    return {
        'checkout': package.parent,
        'own prefix': prefix / share,
        'ament overlay': tmp_path / 'overlay' / share,
        'ament underlay': tmp_path / 'underlay' / share,
        'sys.prefix': tmp_path / 'python' / share,
    }


@pytest.mark.parametrize('place', ['own prefix', 'ament overlay', 'ament underlay', 'sys.prefix'])
def test_resource_is_found_in_every_kind_of_install(places: dict[str, Path], place: str) -> None:
    """A file that only one kind of install has is found there, and so is its folder."""
    weights = _touch(places[place] / 'weights' / 'x.safetensors')
    assert resource_path('weights', 'x.safetensors') == weights
    assert resource_path('weights') == weights.parent


def test_checkout_wins_over_installed_data(places: dict[str, Path]) -> None:
    """Beside a package.xml the package is a checkout: edited weights count, not installed ones."""
    for place in places.values():
        _touch(place / 'weights' / 'x.safetensors')
    _touch(places['checkout'] / 'package.xml')
    assert resource_path('weights') == places['checkout'] / 'weights'


def test_neighbour_in_site_packages_is_not_taken_for_a_checkout(places: dict[str, Path]) -> None:
    """Without a package.xml, `weights` beside the package is somebody else's Python package."""
    _touch(places['checkout'] / 'weights' / 'x.safetensors')
    with pytest.raises(FileNotFoundError):
        resource_path('weights', 'x.safetensors')


def test_own_prefix_wins_over_an_overlay(places: dict[str, Path]) -> None:
    """The weights belong to the code that reads them, not to another version in the workspace."""
    for place in ('own prefix', 'ament overlay', 'sys.prefix'):
        _touch(places[place] / 'weights' / 'x.safetensors')
    assert resource_path('weights') == places['own prefix'] / 'weights'


@pytest.mark.parametrize('parts', [(), ('/etc/passwd',)])
def test_resource_path_outside_the_data_folders(parts: tuple[str, ...]) -> None:
    """An absolute part would make every place the same."""
    with pytest.raises(ValueError, match='below the data folders'):
        resource_path(*parts)


@pytest.mark.skipif(Path(cli.__file__).parents[1] != ROOT, reason='the package is installed')
def test_resources_of_this_checkout() -> None:
    """Where the checkout is what is imported, the real resolver finds the repository."""
    assert resource_path('package.xml') == ROOT / 'package.xml'


# --- programs -------------------------------------------------------------------------------------


def _run(*command: str, **env: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *command],
        cwd=ROOT,
        env={**os.environ, **env},
        capture_output=True,
        text=True,
        timeout=120,
    )


@pytest.mark.parametrize('name', cli.PROGRAMS)
def test_program_table_is_complete(name: str) -> None:
    """Every program has a module that gets installed, a description and known extras."""
    program = cli.PROGRAMS[name]
    path = ROOT.joinpath(*program.module.split('.')).with_suffix('.py')
    assert path.is_file()
    assert path.with_name('__init__.py').is_file()  # find_packages leaves out a folder without it
    assert program.description and '\n' not in program.description
    assert set(program.extras) <= set(cli.MODULES_OF_EXTRA)
    assert callable(getattr(cli.start, name))


@pytest.mark.parametrize('arguments', [(), ('--help',), ('-h',)])
def test_help_lists_the_programs(arguments: tuple[str, ...]) -> None:
    """Asking for help is not an error, and neither is typing nothing."""
    done = _run('-m', 'box_contact_ros', *arguments)
    assert (done.returncode, done.stderr) == (0, '')
    for name, program in cli.PROGRAMS.items():
        assert name in done.stdout and program.description in done.stdout


def test_unknown_program() -> None:
    """A typing error is answered with what was meant, status 2 as from argparse."""
    done = _run('-m', 'box_contact_ros', 'contactnode')
    assert (done.returncode, done.stdout) == (2, '')
    assert done.stderr == (
        "box_contact_ros: there is no program 'contactnode': did you mean contact_node?\n"
    )
    assert 'one of contact_node, crane' in _run('-m', 'box_contact_ros', 'zzz').stderr


@pytest.fixture
def probe(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Add a program `probe` that prints its arguments as JSON and returns their number."""
    (tmp_path / 'probe_program.py').write_text(
        'import json\n'
        'def main(args=None):\n'
        '    print(json.dumps(args))\n'
        '    return len(args)\n'
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(
        cli.PROGRAMS, 'probe', cli.Program('probe_program', (), 'a test')
    )


@pytest.mark.parametrize('arguments', [[], ['--ros-args', '-p', 'model:=exact', '--', '--help']])
def test_arguments_reach_main_unchanged(
    probe: None,
    arguments: list[str],
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """`python -m` and the console scripts pass the same list, and pass on the same status."""
    assert command_line.main(['probe', *arguments]) == len(arguments)
    assert json.loads(capfd.readouterr().out) == arguments
    monkeypatch.setattr(sys, 'argv', ['/usr/bin/box_contact_probe', *arguments])
    assert cli._from_command_line('probe') == len(arguments)
    assert json.loads(capfd.readouterr().out) == arguments


@pytest.mark.parametrize(
    ('name', 'module', 'extras'),
    [
        ('contact_node', 'rclpy', 'ros'),
        ('contact_node', 'rclpy.node', 'ros'),
        ('contact_node', 'torch', 'ros,train'),
        ('crane', 'mujoco', 'ros,sim'),
        ('record', 'rosbags.rosbag2', 'ros,bag'),
        ('bench', 'rosbags', 'ros,sim,soup,report,bag'),
        ('train', 'torch', 'train'),
        ('train', 'tqdm', 'train'),
        ('paper', 'matplotlib.pyplot', 'report'),
        ('paper', 'fcl', 'report,soup'),
    ],
)
def test_missing_extra_is_one_line_that_names_it(
    name: str,
    module: str,
    extras: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A module missing at import, or only when main runs, gives pip's command, and no traceback."""

    def main(args: list[str]) -> int:
        raise ModuleNotFoundError(f'No module named {module!r}', name=module)

    fake = type(sys)('fake')
    fake.main = main
    monkeypatch.setattr(cli.importlib, 'import_module', lambda _: fake)
    monkeypatch.setattr(cli.importlib.util, 'find_spec', lambda _: None)
    assert cli.run(name, []) == 1
    message = capsys.readouterr().err
    assert message.count('\n') == 1
    assert f"pip install -c constraints.txt -e '.[{extras}]'" in message
    assert ('apt install ros-jazzy-ros-base' in message) == module.startswith('rclpy')
    # Where there is a ROS, perhaps apt's, its wheels are not recommended.
    monkeypatch.setattr(cli.importlib.util, 'find_spec', lambda _: object())
    cli.run(name, [])
    assert f"'.[{extras.removeprefix('ros,')}]'" in capsys.readouterr().err


HELP_WITHOUT_EXTRAS = """
import contextlib, importlib.machinery, io, json, sys
from box_contact_ros import cli

absent = {name for names in cli.MODULES_OF_EXTRA.values() for name in names}

class Installed(importlib.machinery.PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        if name.partition('.')[0] not in absent:
            return importlib.machinery.PathFinder.find_spec(name, path, target)

sys.meta_path = [Installed if finder is importlib.machinery.PathFinder else finder
                 for finder in sys.meta_path]
found = {}
for name in cli.PROGRAMS:
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        try:
            status = cli.run(name, ['--help'])
        except SystemExit as end:
            status = end.code
    found[name] = [status or 0, printed.getvalue()]
print(json.dumps(found))
"""


def test_help_needs_no_extra() -> None:
    """A newcomer learns of every program, before installing what it needs."""
    done = _run('-c', HELP_WITHOUT_EXTRAS)
    assert done.returncode == 0 and done.stderr == '', done.stderr
    found = json.loads(done.stdout)
    assert found.keys() == cli.PROGRAMS.keys()
    for name, (status, text) in found.items():
        assert status == 0 and text.startswith(f'usage: {name}'), name
        # Either its options, or what it does and what to install for them.
        assert 'options:' in text or (
            cli.PROGRAMS[name].description in text and 'pip install' in text), name
    assert '(default: [12.192,2.438,2.591])' in found['contact_node'][1]
    assert sum('options:' in text for _, text in found.values()) >= 7


def test_missing_module_of_our_own_keeps_its_traceback(
    probe: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No extra would help: hiding where it happened would only hide the fault."""
    monkeypatch.setitem(
        cli.PROGRAMS, 'probe', cli.Program('box_contact_ros.no_such', (), 'a test')
    )
    with pytest.raises(ModuleNotFoundError, match='no_such'):
        cli.run('probe', [])


def test_a_reader_that_ends_early_is_no_error() -> None:
    """As in `| head -1`: no traceback, and the status that a shell reports for SIGPIPE."""
    env = {name: value for name, value in os.environ.items() if name != 'PYTHONUNBUFFERED'}
    for arguments in ('--help', 'contact_node --help'):
        done = subprocess.run(
            ['bash', '-c', f'set -o pipefail; "$1" -m box_contact_ros {arguments} | true', 'bash',
             sys.executable], capture_output=True, text=True, timeout=120, check=False, env=env)
        assert done.stderr == '' and done.returncode in (0, 141), done


def test_parameters_before_ros_args_are_explained() -> None:
    done = _run('-m', 'box_contact_ros', 'contact_node', '-p', 'model:=exact')
    assert done.returncode == 2
    assert '(parameters follow --ros-args: --ros-args -p model:=VALUE)' in done.stderr


# --- metadata -------------------------------------------------------------------------------------


def test_versions_agree() -> None:
    """The release tools of catkin rewrite both, so both are written out; here they are compared."""
    manifest = ElementTree.parse(ROOT / 'package.xml').getroot()
    done = _run('setup.py', '--name', '--version')
    name, version = manifest.findtext('name'), manifest.findtext('version')
    assert done.stdout.split() == [name, version]
    for file in ('CITATION.cff', 'msg_schemas/asyncapi.yaml'):
        assert f'version: {version}\n' in (ROOT / file).read_text('utf-8'), file
    changelog = (ROOT / 'CHANGELOG.rst').read_text('utf-8')
    assert re.search(rf'^{version} \(\d{{4}}-\d\d-\d\d\)\n-+\n', changelog, re.MULTILINE)


def test_manifest_is_valid() -> None:
    """What catkin_pkg rejects, colcon silently builds as plain Python, out of reach of ros2 run."""
    catkin_package = pytest.importorskip('catkin_pkg.package')
    warned: list[str] = []
    manifest = catkin_package.parse_package(str(ROOT / 'package.xml'), warnings=warned)
    manifest.validate()
    assert warned == []
    assert manifest.get_build_type() == 'ament_python'


@pytest.mark.parametrize(
    ('env', 'prefix'), [({}, ''), ({'PIP_BUILD_TRACKER': '/tmp'}, 'box_contact_')]
)
def test_program_names_under_colcon_and_pip(env: dict[str, str], prefix: str) -> None:
    """Bare names in lib/box_contact_ros for colcon, the prefixed ones in bin/ for pip."""
    done = _run(
        '-c',
        'import json\n'
        'import setuptools\n'  # before distutils: Python 3.12 has only the one it lends
        'from distutils.core import run_setup\n'
        'dist = run_setup("setup.py", stop_after="config")\n'
        'print(json.dumps([dist.entry_points["console_scripts"],'
        ' dist.get_option_dict("develop").get("script_dir"),'
        ' dist.get_option_dict("install").get("install_scripts")]))',
        **env,
    )
    assert done.returncode == 0, done.stderr
    scripts, develop, install = json.loads(done.stdout)
    assert scripts == cli.entry_points(prefix)
    assert [script.partition(' = ')[0] for script in scripts] == [
        prefix + name for name in cli.PROGRAMS
    ]
    folder = '$base/lib/box_contact_ros'
    assert [entry and entry[1] for entry in (develop, install)] == (
        [None, None] if prefix else [folder, folder]
    )


@pytest.mark.parametrize('code', ['import box_contact_ros', 'from box_contact_ros import *'])
def test_import_stays_small(code: str) -> None:
    """The core is for everybody: NumPy comes with it, and YAML once scenes are used."""
    done = _run('-c', f'import sys; before = set(sys.modules); {code}\n'
                      'print(*{name.partition(".")[0] for name in sys.modules.keys() - before})')
    assert done.returncode == 0, done.stderr
    loaded = {name for name in set(done.stdout.split()) - sys.stdlib_module_names
              if 'cython' not in name}  # registered by YAML's Cython extension
    assert loaded == {'box_contact_ros', 'numpy'} | ({'yaml'} if '*' in code else set())


def test_exported_names_are_what_dir_lists() -> None:
    """A misspelt name fails as in any module."""
    assert set(box_contact_ros.__all__) <= set(dir(box_contact_ros))
    with pytest.raises(AttributeError, match='SceneSolvr'):
        _ = box_contact_ros.SceneSolvr


def test_a_build_without_a_compiler_names_it() -> None:
    """One line at the end says what is missing, and how it is installed."""
    done = _run('setup.py', 'build_ext', CXX='/no/such/compiler -O3')
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == (
        'error: box_contact_ros needs a C++17 compiler, and /no/such/compiler is not here '
        '(Debian, Ubuntu: apt install g++)')

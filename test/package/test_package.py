# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The package as a thing to install: data files, programs, metadata, what an import costs."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from conftest import PROGRAMS
from patience import PATIENCE

import box_contact_ros
from box_contact_ros import extras, resources
from box_contact_ros.arguments import program_parser
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
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'{tmp_path / "overlay"}:{tmp_path / "underlay"}')
    share = Path('share', 'box_contact_ros')
    return {
        'checkout': package.parent,
        'own prefix': prefix / share,
        'ament overlay': tmp_path / 'overlay' / share,
        'ament underlay': tmp_path / 'underlay' / share,
    }


@pytest.mark.parametrize('place', ['own prefix', 'ament overlay', 'ament underlay'])
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
    for place in ('own prefix', 'ament overlay'):
        _touch(places[place] / 'weights' / 'x.safetensors')
    assert resource_path('weights') == places['own prefix'] / 'weights'


@pytest.mark.parametrize('parts', [(), ('/etc/passwd',)])
def test_resource_path_outside_the_data_folders(parts: tuple[str, ...]) -> None:
    """An absolute part would make every place the same."""
    with pytest.raises(ValueError, match='below the data folders'):
        resource_path(*parts)


@pytest.mark.skipif(Path(resources.__file__).parents[1] != ROOT, reason='the package is installed')
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
        timeout=PATIENCE,
    )


def test_a_missing_extra_is_one_line_that_names_it() -> None:
    """Pip's command instead of a traceback; a module of our own keeps its traceback."""
    code = ('import importlib.util as util, sys; from box_contact_ros import extras\n'
            'extras.find_spec = lambda name: None if name == "viser" else util.find_spec(name)\n'
            'extras.require("view")')
    done = _run('-c', code)
    assert (done.returncode, done.stderr.count('\n')) == (1, 1)
    assert "pip install -c constraints.txt -e '.[view]'" in done.stderr
    done = _run('-c', code.replace('extras.require("view")', 'import box_contact_ros.no_such'))
    assert 'Traceback' in done.stderr and 'no_such' in done.stderr


@pytest.mark.parametrize('module', PROGRAMS.values())
def test_a_program_without_extras_ends_in_one_line(module: str) -> None:
    """Before it imports what it misses. Of a plan, only some files need an extra."""
    arguments = ['docs/examples/files/ship.edi'] if module == 'plans.inspect_files' else []
    done = _run('-c', f'import sys; sys.modules.update(dict.fromkeys({[*extras.EXTRA_OF]}))\n'
                      f'import box_contact_ros.{module} as program\n'
                      f'sys.exit(program.main({arguments}))')
    status = 2 if module == 'plans.inspect_files' else 1  # there 1 is a plan that is not sound
    assert (done.returncode, done.stderr.count('\n')) == (status, 1), done.stderr
    assert 'pip install' in done.stderr


# --- metadata -------------------------------------------------------------------------------------


def test_the_version_is_that_of_the_manifest(tmp_path: Path) -> None:
    """setup.py and CMake read package.xml, so a release changes one line."""
    for name in ('setup.py', 'README.md', 'package.xml', 'CMakeLists.txt'):
        shutil.copy(ROOT / name, tmp_path)
    manifest = tmp_path / 'package.xml'
    text = manifest.read_text('utf-8')
    manifest.write_text(re.sub('<version>.*</version>', '<version>9.8.7</version>', text))
    done = subprocess.run([sys.executable, 'setup.py', '--name', '--version'], cwd=tmp_path,
                          capture_output=True, text=True)
    assert done.stdout.split() == ['box_contact_ros', '9.8.7'], done.stderr
    lines = (ROOT / 'CMakeLists.txt').read_text('utf-8').splitlines()
    project = next(n for n, line in enumerate(lines) if line.startswith('project('))
    (tmp_path / 'version.cmake').write_text('\n'.join(
        [line for line in lines[:project] if 'VERSION' in line and 'minimum' not in line]
        + ['message(NOTICE "${VERSION}")']))
    done = subprocess.run(['cmake', '-P', 'version.cmake'], cwd=tmp_path, capture_output=True,
                          text=True)
    assert done.stderr.strip() == '9.8.7'


def test_versions_agree() -> None:
    """What cannot read package.xml has its version: messages, schemas, the newest change log."""
    version = _version_of(ROOT)
    assert _version_of(ROOT / 'box_contact_msgs') == version
    schema = (ROOT / 'msg_schemas' / 'asyncapi.yaml').read_text('utf-8')
    assert f'\n  version: {version}\n' in schema
    changelog = (ROOT / 'CHANGELOG.rst').read_text('utf-8')
    titles = re.findall(r'^(.+)\n-+$', changelog, re.MULTILINE)
    released = [title for title in titles if title != 'Forthcoming']
    assert titles[:-len(released)] in ([], ['Forthcoming'])
    assert re.fullmatch(rf'{version} \(\d{{4}}-\d\d-\d\d\)', released[0])


def _version_of(package: Path) -> str:
    return ElementTree.parse(package / 'package.xml').getroot().findtext('version')


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
    assert scripts == [f'{prefix}{program} = box_contact_ros.{module}:main'
                       for program, module in PROGRAMS.items()]
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


def _documented() -> Iterator[Any]:
    """Yield what the reference of the Python API documents, and members that it names."""
    page = (ROOT / 'docs' / 'reference' / 'python_api.md').read_text('utf-8')
    for name, options in re.findall(r':: box_contact_ros\.(\w+)\n((?:   :.*\n)*)', page):
        yield (thing := getattr(box_contact_ros, name))
        names = re.findall(r'\w+', options.replace(':members:\n', ' '.join(vars(thing))))
        members = [vars(thing).get(name) for name in names
                   if name == '__call__' or not name.startswith('_')]
        yield from (getattr(part, '__func__', getattr(part, 'fget', part)) for part in members)


def test_what_is_returned_or_raised_can_be_imported() -> None:
    """Each class of ours in an annotation of a documented result or field, or behind `Raises`.

    But for those of fields that begin with an underscore.
    """
    ours = {name for path in ROOT.glob('box_contact_ros/**/*.py')
            for name in re.findall(r'^class (\w+)', path.read_text('utf-8'), re.MULTILINE)}
    told: set[str] = set()
    for thing in _documented():
        hints = {name: hint for name, hint in getattr(thing, '__annotations__', {}).items()
                 if name == 'return' or not name.startswith('_')}
        if not isinstance(thing, type):
            hints = {'return': hints.get('return')}
        words = [*(hint for hint in map(str, hints.values()) if 'ClassVar' not in hint),
                 *re.findall(r'[Rr]aises? `?\w+', getattr(thing, '__doc__', None) or '')]
        told |= ours.intersection(re.findall(r'\w+', ' '.join(words)))
    assert told >= {'Answer', 'Assembly', 'Loads', 'Motion', 'SceneError', 'TooManyNear'}
    assert told <= {*dir(box_contact_ros)}


def test_a_build_without_a_compiler_names_it() -> None:
    """One line at the end says what is missing, and how it is installed."""
    done = _run('setup.py', 'build_ext', CXX='/no/such/compiler -O3')
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == (
        'error: box_contact_ros is built with /no/such/compiler, which is not here '
        '(Debian, Ubuntu: apt install g++)')


@pytest.mark.parametrize('path, typed', [
    ('/usr/bin/box_contact_view', 'box_contact_view'),
    ('/ws/install/lib/box_contact_ros/view', 'ros2 run box_contact_ros view'),
    ('/src/box_contact_ros/view/view.py', 'view')])
def test_help_names_a_program_as_it_is_typed(monkeypatch, path, typed):
    monkeypatch.setattr(sys, 'argv', [path])
    assert program_parser('view', '').format_usage().startswith(f'usage: {typed} [')

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""box_contact_msgs: its definitions, and the wheel that pip builds of it from the ROS wheels."""
from __future__ import annotations

import importlib
import json
import math
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from zipfile import ZipFile

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ROOT / 'box_contact_msgs'
DEFINITIONS = sorted(SOURCES.glob('msg/*.msg'))
SHARE = 'share/box_contact_msgs'
INDEX = 'share/ament_index/resource_index'

FIELDS = {
    'Contact': {
        'pair': 'string', 'box_a': 'string', 'box_b': 'string', 'point': 'geometry_msgs/Point',
        'normal': 'geometry_msgs/Vector3', 'depth': 'float64', 'volume': 'float64',
        'area': 'float64', 'covariance': 'float64[6]'},
    'Contacts': {'header': 'std_msgs/Header', 'contacts': 'Contact[]', 'stale': 'string[]'},
}
"""Recordings are read by these names, types and order."""
UNITS = {'point': '[m]', 'normal': 'Unit vector', 'depth': '[m]', 'volume': '[m^3]',
         'area': '[m^2]', 'covariance': '[m^2]'}


# --- the definitions ------------------------------------------------------------------------------


def fields(definition: Path) -> dict[str, tuple[str, str]]:
    """Return the type of each field, and the comment right above the field."""
    found, comment = {}, ''
    for line in definition.read_text('utf-8').splitlines():
        if line.startswith('#'):
            comment += line
        else:
            if line:
                kind, name = line.split()
                found[name] = kind, comment
            comment = ''
    return found


@pytest.mark.parametrize('definition', DEFINITIONS, ids=lambda path: path.stem)
def test_every_field_has_a_comment_with_its_unit(definition: Path) -> None:
    found = fields(definition)
    expected = FIELDS[definition.stem]
    assert [(name, kind) for name, (kind, _) in found.items()] == list(expected.items())
    for name, (kind, comment) in found.items():
        assert UNITS.get(name, '') in comment, name
        assert comment or (kind == 'string' and name == 'box_b'), name  # the comment of both boxes


def test_colcon_builds_every_definition() -> None:
    listed = re.findall(r'^  (msg/\S+)$', (SOURCES / 'CMakeLists.txt').read_text('utf-8'), re.M)
    assert listed == [path.relative_to(SOURCES).as_posix() for path in DEFINITIONS]


def test_the_manifest_is_valid() -> None:
    """What catkin_pkg rejects, colcon takes for a package of another kind."""
    catkin = pytest.importorskip('catkin_pkg.package', reason='catkin-pkg is not installed')
    package = catkin.parse_package(str(SOURCES / 'package.xml'))
    package.validate()
    assert package.get_build_type() == 'ament_cmake'
    assert [group.name for group in package.member_of_groups] == ['rosidl_interface_packages']
    assert package.version == ElementTree.parse(ROOT / 'package.xml').findtext('version')


# --- the wheel ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Unpacked:
    """A wheel that was built of the checkout, unpacked: modules, and what goes to PREFIX."""

    modules: Path
    prefix: Path

    def start(self, code: str, *words: str) -> subprocess.Popen[str]:
        """Start Python with the wheel's modules and libraries."""
        env = {**os.environ, 'PYTHONPATH': str(self.modules), 'LD_LIBRARY_PATH': ':'.join(
            [str(self.prefix / 'lib'), os.environ.get('LD_LIBRARY_PATH', '')])}
        return subprocess.Popen([sys.executable, '-c', code, *words], env=env, text=True,
                                stdout=subprocess.PIPE, stderr=subprocess.PIPE)


@pytest.fixture(scope='module')
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Unpacked:
    """Build by pip, as a user does, from a copy that must stay as it is."""
    pytest.importorskip('rclpy', reason='the ROS wheels are not installed')
    folder = tmp_path_factory.mktemp('wheel')
    sources = shutil.copytree(SOURCES, folder / 'sources', ignore=shutil.ignore_patterns('__*'))
    before = sorted(sources.rglob('*'))
    done = subprocess.run([sys.executable, '-m', 'pip', 'wheel', '--no-deps', '--no-index',
                           '--no-build-isolation', '-w', folder, sources],
                          text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    assert done.returncode == 0, done.stdout
    assert [path for path in sorted(sources.rglob('*')) if '__pycache__' not in path.parts
            ] == before
    (file,) = folder.glob('*.whl')
    with ZipFile(file) as archive:
        archive.extractall(folder / 'modules')
    (prefix,) = (folder / 'modules').glob('*.data/data')
    return Unpacked(folder / 'modules', prefix)


def libraries(wheel: Unpacked) -> list[Path]:
    """Return all libraries of the wheel: five for PREFIX/lib, and three modules."""
    found = sorted(wheel.modules.rglob('*.so'))
    assert len(found) == 8
    assert len([path for path in found if path.parent == wheel.prefix / 'lib']) == 5
    return found


SENT = {
    'header': {'stamp': {'sec': 1_700_000_000, 'nanosec': 999_999_999}, 'frame_id': 'yard'},
    'contacts': [{
        'pair': 'load_stack', 'box_a': 'load', 'box_b': 'stack/ü',
        'point': {'x': 1.0, 'y': -2.5, 'z': 1e-9}, 'normal': {'x': 0.0, 'y': 0.6, 'z': -0.8},
        'depth': 0.01, 'volume': 0.125, 'area': 29.7,
        'covariance': [12.0, 0.1, -0.2, 0.5, 0.3, 8e-6],
    }, {
        'pair': 'load_wall', 'box_a': 'load', 'box_b': 'wall',
        'point': dict.fromkeys('xyz', math.nan), 'normal': dict.fromkeys('xyz', math.nan),
        'depth': -0.3, 'volume': 0.0, 'area': math.nan, 'covariance': [math.nan] * 6}],
    'stale': ['crane_lorry', 'lorry_wall'],
}
EXCHANGE = """
import json, sys, time
import rclpy
from box_contact_msgs.msg import Contact, Contacts


def fill(message, values):
    for name, value in values.items():
        if name == 'contacts':
            message.contacts = [fill(Contact(), one) for one in value]
        elif isinstance(value, dict):
            fill(getattr(message, name), value)
        else:
            setattr(message, name, value)
    return message


def plain(value):
    if hasattr(value, 'get_fields_and_field_types'):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if hasattr(value, 'tolist'):
        return value.tolist()
    return [plain(one) for one in value] if isinstance(value, list) else value


rclpy.init()
node = rclpy.create_node('node')
if len(sys.argv) > 1:
    publisher = node.create_publisher(Contacts, 'contacts', 10)
    message = fill(Contacts(), json.loads(sys.argv[1]))
    while True:
        publisher.publish(message)
        time.sleep(0.05)
heard = []
node.create_subscription(Contacts, 'contacts', heard.append, 10)
while not heard:
    rclpy.spin_once(node, timeout_sec=1.0)
print(json.dumps(plain(heard[0])))
"""


def test_a_message_goes_from_one_process_to_another(wheel: Unpacked) -> None:
    """All fields arrive, in the order of the definitions."""
    publisher, subscriber = wheel.start(EXCHANGE, json.dumps(SENT)), wheel.start(EXCHANGE)
    try:
        heard, errors = subscriber.communicate(timeout=60.0)
    finally:
        for process in (publisher, subscriber):
            process.kill()
            process.communicate()
    assert heard.strip() == json.dumps(SENT), errors  # as text: NaN is not equal to NaN


def test_every_type_support_loads(wheel: Unpacked) -> None:
    """Python resolves all symbols of a module and its libraries when it imports the module."""
    names = [path.name.partition('.')[0] for path in libraries(wheel)
             if path.parent.name == 'box_contact_msgs']
    process = wheel.start('import importlib, sys, rclpy\nfor name in sys.argv[1:]:'
                          '\n    importlib.import_module(f"box_contact_msgs.{name}")', *names)
    assert (process.communicate(timeout=60.0)[1], process.returncode) == ('', 0)


def test_ament_finds_the_definitions(wheel: Unpacked) -> None:
    """By the index markers, as `ros2 interface show` does."""
    listed = (wheel.prefix / INDEX / 'rosidl_interfaces' / SOURCES.name).read_text().split('\n')
    assert listed == sorted(f'msg/{path.stem}.{kind}' for path in DEFINITIONS
                            for kind in ('idl', 'msg'))
    assert all((wheel.prefix / SHARE / name).is_file() for name in listed)
    assert (wheel.prefix / INDEX / 'packages' / SOURCES.name).is_file()
    for name in ('package.xml', *(path.relative_to(SOURCES) for path in DEFINITIONS)):
        assert (wheel.prefix / SHARE / name).read_bytes() == (SOURCES / name).read_bytes()


def test_nothing_reaches_back_to_the_machine_that_built(wheel: Unpacked) -> None:
    """No file names a folder of the machine, and no library has a search path of its own."""
    places = {str(ROOT), sys.prefix, tempfile.gettempdir(), sysconfig.get_path('include')}
    for path in wheel.modules.rglob('*'):
        if path.is_file() and path.parent.name != '__pycache__':  # which importing them here makes
            content = path.read_bytes()
            assert not [place for place in places if place.encode() in content], path
    if not shutil.which('readelf'):
        pytest.skip('readelf is not installed')
    for path in libraries(wheel):
        section = subprocess.run(['readelf', '-d', path], capture_output=True, text=True).stdout
        assert 'NEEDED' in section and not re.search('R(UN)?PATH', section), section


def test_what_is_installed_is_of_this_checkout() -> None:
    """`make` builds the messages again after a change of their definitions."""
    share = Path(sys.prefix, SHARE)
    if not share.is_dir():
        pytest.skip(f'{SOURCES.name} is not installed by pip: run .ci/setup test')
    for path in (SOURCES / 'package.xml', *DEFINITIONS):
        name = path.relative_to(SOURCES)
        assert (share / name).read_bytes() == path.read_bytes(), f'{name}: run .ci/setup test'


# --- refusals -------------------------------------------------------------------------------------


@pytest.fixture
def backend(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Return the build backend, as pip imports it."""
    monkeypatch.syspath_prepend(SOURCES)
    return importlib.import_module('message_wheel')


@pytest.mark.parametrize('missing, wheel_name', [
    ('rosidl_adapter', 'ros-rosidl-adapter'), ('std_msgs', 'ros-std-msgs'),
    ('rosidl_typesupport_fastrtps_c', 'ros-rosidl-typesupport-fastrtps-c')])
def test_a_missing_wheel_is_named(backend: ModuleType, tmp_path: Path, missing: str,
                                  wheel_name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    package = backend.read_package(SOURCES)
    (tmp_path / INDEX / 'packages').mkdir(parents=True)
    for name in ('rosidl_adapter', backend.DESCRIPTION, *backend.GENERATORS, *package.depends):
        if name != missing:
            (tmp_path / INDEX / 'packages' / name).touch()
    monkeypatch.setattr(backend, 'PREFIX', tmp_path)
    with pytest.raises(SystemExit) as refused:
        backend.build_wheel(str(tmp_path))
    assert f'{wheel_name} is not in {tmp_path}' in str(refused.value)
    assert 'pip install ros-jazzy-' in str(refused.value)
    (tmp_path / INDEX / 'packages' / missing).touch()
    backend.check_machine(package)


def test_a_missing_compiler_or_header_is_named(
        backend: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip('rclpy', reason='the ROS wheels are not installed')
    package = backend.read_package(SOURCES)
    monkeypatch.setattr(backend.sysconfig, 'get_path', lambda name: str(tmp_path))
    with pytest.raises(SystemExit, match=r'Python\.h is not here .*apt install python3\.\d+-dev'):
        backend.check_machine(package)
    monkeypatch.setenv('CXX', 'no-such-compiler -O1')
    with pytest.raises(SystemExit, match='no-such-compiler is not here .*apt install g'):
        backend.check_machine(package)

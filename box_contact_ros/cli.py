"""The programs of this package, and the one way in which all of them are started.

A program can be started in three ways, which behave alike because all three end in `run`:

- `ros2 run box_contact_ros PROGRAM`   an entry point in lib/box_contact_ros (built with colcon)
- `box_contact_PROGRAM`                an entry point in bin/ (installed with pip)
- `python -m box_contact_ros PROGRAM`

`PROGRAMS` is the only list of them. setup.py loads this file by its path, at a time when nothing
but the standard library can be relied on, so import nothing else at the top of it.

A program is a function `main(args=None) -> int` that returns the exit status. `args` is what
stands after the program's name, in the manner of `sys.argv[1:]` (without the name), unchanged:
`rclpy.init(args=args)` finds `--ros-args ...` in it, and `rclpy.utilities.remove_ros_args(args)`
gives what is left for argparse.
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
    """Where a program is found, what it does, and which extras of setup.py it needs."""

    target: str  # 'module:function'
    description: str
    extras: tuple[str, ...]


PROGRAMS = {
    'contact_node': Program(
        'box_contact_ros.node.contact_node:main',
        'the ROS 2 node: two box poses in, contact point and normal out',
        ('ros',),
    ),
    'crane': Program(
        'box_contact_ros.apps.crane.crane_node:main',
        'a MuJoCo crane that lowers one container onto another and publishes both poses',
        ('ros', 'sim'),
    ),
    'soup_node': Program(
        'box_contact_ros.node.soup_node:main',
        'the same node on a polygon soup, under soup/: what the source paper compares with',
        ('ros', 'soup'),
    ),
    'view': Program(
        'box_contact_ros.apps.viewer.view:main',
        'a page in the browser: the crane, the boxes, the contact and its figures, live',
        ('ros', 'sim', 'view'),
    ),
    'markers': Program(
        'box_contact_ros.apps.viewer.markers:main',
        'draw boxes and contacts as markers for RViz',
        ('ros',),
    ),
    'bench': Program(
        'box_contact_ros.apps.bench.bench:main',
        'drive contact, soup and echo node with streams of poses: latency, losses, errors',
        ('ros', 'sim', 'soup', 'report'),
    ),
    'record': Program(
        'box_contact_ros.apps.recording.record:main',
        'write poses and contacts of running nodes to a bag (MCAP) for Foxglove and ros2 bag',
        ('ros', 'bag'),
    ),
    'soak': Program(
        'box_contact_ros.apps.bench.soak:main',
        'ten minutes at 1 kHz: losses, mispairs, memory, latency beside echo nodes',
        ('ros', 'sim', 'report'),
    ),
    'train': Program(
        'box_contact_ros.training.train:main',
        'make the data sets, fit the networks, write weights/',
        ('train',),
    ),
    'search': Program(
        'box_contact_ros.training.experiments.search:main',
        'train thousands of networks at once to find the size and settings that they should have',
        ('train', 'report'),
    ),
    'accuracy': Program(
        'box_contact_ros.reports.accuracy:main',
        'point error of a model against the exact one, per set of poses and contact class',
        ('report',),
    ),
    'frontier': Program(
        'box_contact_ros.reports.frontier:main',
        'speed against error of every model and of the engines beside them, as table and picture',
        ('report',),
    ),
    'fuzz': Program(
        'box_contact_ros.verification.fuzz:main',
        'millions of random pairs, judged by an independent test; gates at zero',
        ('report', 'fuzz'),
    ),
    'stability': Program(
        'box_contact_ros.reports.stability:main',
        'what each model makes of families of hard poses',
        ('report', 'soup'),
    ),
    'paper': Program(
        'box_contact_ros.reports.paper_tables:main',
        "redo the source paper's tables, its figures beside ours",
        ('report',),
    ),
}

# What each extra brings, by top-level module. A module that is missing and not listed here is a
# fault of the package, not of the user's installation, and keeps its traceback.
MODULES_OF_EXTRA = {
    'ros': (
        'rclpy',
        'builtin_interfaces',
        'diagnostic_msgs',
        'geometry_msgs',
        'rcl_interfaces',
        'sensor_msgs',
        'std_msgs',
        'visualization_msgs',
    ),
    'sim': ('mujoco', 'rich'),
    'bag': ('rosbags',),
    'soup': ('fcl',),
    'view': ('viser',),
    'train': ('safetensors', 'torch', 'tqdm'),
    'report': ('matplotlib', 'tqdm'),
    'peers': ('coal', 'pybullet'),
    'fuzz': ('mpmath',),
}


def run(name: str, args: Sequence[str]) -> int:
    """Start program `name` with the arguments after its name; return its exit status.

    A module that is missing because an extra was not installed is answered with one line on stderr
    and status 1; a name that is no program with one line and status 2, as argparse does.
    """
    if name not in PROGRAMS:
        print(_unknown(name), file=sys.stderr)
        return 2
    module, _, function = PROGRAMS[name].target.partition(':')
    if 'ros' in PROGRAMS[name].extras and not _shared_memory_has_room():
        return 1
    # argparse takes the program's name from here: the same one in usage lines, however started.
    sys.argv = [name, *args]
    try:
        try:
            status = getattr(importlib.import_module(module), function)(list(args))
        finally:  # --help, too, which leaves by SystemExit
            sys.stdout.flush()
    except ModuleNotFoundError as error:
        message = _missing_module(name, error.name or '')
        if message is None:
            raise
        if {'-h', '--help'} & set(args):
            print(f'{name}: {PROGRAMS[name].description}\n')
        print(message, file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130  # what a shell reports for a program ended by Ctrl-C
    except BrokenPipeError:
        return reader_is_gone()
    return int(status or 0)


def reader_is_gone() -> int:
    """The status of a program whose output nobody reads to the end, such as `| head`.

    What is left of it goes nowhere.
    """
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 141  # what a shell reports for a program ended by SIGPIPE


SHARED_MEMORY = '/dev/shm'
LEAST_ROOM = 64 * 2**10
"""Bytes: ROS 2's libraries write some pages of shared memory as they are loaded (for tracing), and
where there are none they are killed by SIGBUS."""
USUAL_ROOM = 4 * 2**20
"""Bytes: Fast DDS allocates 0.7 MB as a process joins, or is killed in the same way. What it has,
it keeps: shared memory that fills up later does no harm."""
TRANSPORTS = 'FASTDDS_BUILTIN_TRANSPORTS'
"""Environment variable of Fast DDS."""


def _shared_memory_has_room() -> bool:
    """Whether ROS 2 can start; where there is little room, Fast DDS is told to do without."""
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


def usage() -> str:
    """Return the help text: how to start a program, and all of them with their descriptions."""
    width = max(map(len, PROGRAMS))
    lines = [f'  {name:<{width}}  {program.description}' for name, program in PROGRAMS.items()]
    return '\n'.join(
        [
            'usage: python -m box_contact_ros PROGRAM [ARGUMENT ...]',
            '',
            'programs:',
            *lines,
            '',
            'The same programs start as `box_contact_PROGRAM` where this package was installed',
            'with pip, and as `ros2 run box_contact_ros PROGRAM` where it was built with colcon.',
        ]
    )


def entry_points(prefix: str = '') -> list[str]:
    """Return the console scripts as setup.py wants them, each name with `prefix` before it."""
    return [f'{prefix}{name} = box_contact_ros.cli:start.{name}' for name in PROGRAMS]


def _from_command_line(name: str) -> int:
    return run(name, sys.argv[1:])


# What the console scripts call. A generated script can pass no arguments, so there is a callable
# per program; the name does not come from sys.argv[0], which a link or a copy would change.
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
        f"in the checkout, pip install -c constraints.txt '.[{listed}]'"
    )
    if 'ros' in bring_it:
        text += ', or apt install ros-jazzy-ros-base and source /opt/ros/jazzy/setup.bash'
    return text

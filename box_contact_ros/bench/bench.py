# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The bench: compares the latency of contact node, soup node and two echo nodes on the same poses.

The echo nodes compute nothing. The second one, floor, sends as many messages as the contact node,
which cannot be faster.

Each node is a process of its own. Only this host hears them, in the ROS domain ROS_DOMAIN_ID, or in
one drawn at random. The bench sends pairs of poses of equal stamp: a container that sways on top of
another one. Blocks of half a second go to one node after the other, in an order that is drawn for
each block.

The nodes run alone (quiet), or while loops take time and do nothing else. With nice, a loop of low
priority runs on each of the nodes' cores. With busy, a loop runs on each core of the machine.

The first lines of the report say how many times as long a node takes as another one, with 95 %
intervals. A table has latencies, and answers that are lost or differ from the exact contacts.
With --out, they are a page, too, under a picture of the latencies in the first surroundings. The
page of a void run has that in its title. An interrupted run writes none.

The exit status is 0 only if contact and echo node lost nothing, no answer was wrong, and the run is
not void. It is void if, in quiet surroundings, the bench itself was late by more than a period in
over 1 % of the pairs. Loops make it late by themselves.
"""
from __future__ import annotations

import argparse
import contextlib
import gc
import os
import platform
import re
import sys
import tempfile
from collections.abc import Iterator, Sequence
from functools import partial
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from ..arguments import model_name, outside_ros_args, program_main, program_parser, within
from ..core import native
from ..extras import require
from ..models.make_model import MODELS
from ..processes import asked_to_end, keep_to_this_host, program, running
from .poses import swaying_containers
from .report import NODES, comparison, draw, figures, table, void_reason

RATE, SECONDS, LONGEST = 200.0, 60.0, 3600.0  # [Hz], [s], [s]
QUIET, NICE, BUSY = SURROUNDINGS = ('quiet', 'nice', 'busy')
NICENESS = {NICE: 10, BUSY: 0}  # of loops


@program_main
def main(args: Sequence[str] | None = None) -> int:
    """Run the bench; return its exit status."""
    args = sys.argv[1:] if args is None else list(args)
    options = _options(outside_ros_args(args))
    require('ros')
    from ..node.runtime import exit_on_refusal
    return exit_on_refusal(_run)(options, args)


def _run(options: argparse.Namespace, args: Sequence[str]) -> int:
    from ..node.runtime import running_node
    from .drive import BenchNode

    names = list(dict.fromkeys(options.nodes))
    if 'soup' in names and not find_spec('fcl'):
        print('without the soup node: python-fcl is not installed (extra: soup)')
        names.remove('soup')
    keep_to_this_host()
    cores = os.sched_getaffinity(0)
    own = {max(cores)} if len(cores) > 1 else cores
    theirs = cores - own or cores
    gc.disable()  # `BenchNode` collects between blocks
    about = _about(options, own, theirs)
    print(about, flush=True)
    poses = swaying_containers(max(2, round(options.rate * options.duration / len(names))),
                               rate=options.rate)
    with asked_to_end() as signals, contextlib.ExitStack() as ending:
        os.sched_setaffinity(0, theirs)  # the nodes inherit it
        nodes = {name: ending.enter_context(running([
            *program(NODES[name][0], **NODES[name][2],
                     **({'model': options.model} if name == 'contact' else {})),
            '-r', f'__ns:=/bench/{name}'])) for name in names}
        os.sched_setaffinity(0, own)  # before rclpy starts its threads
        bench, executor = ending.enter_context(running_node(partial(
            BenchNode, nodes=nodes, poses=poses, rate=options.rate, signals=signals), args))
        logs = {}
        for surroundings in options.beside:
            with loops(surroundings, theirs if surroundings == NICE else cores):
                logs[surroundings] = bench.run(executor)
        faults = [f'the {name} node ended early, status {node.returncode}'
                  for name, node in nodes.items() if node.poll() is not None]
    rows = [{'beside': beside, **row} for beside in logs for row in figures(logs[beside])]
    compared = '\n'.join(f'{beside}: {comparison(logs[beside], block=bench.block)}'
                         for beside in logs)
    void = void_reason([row for row in rows if row['beside'] == QUIET], options.rate)
    stopped = 'interrupted: figures are of what was sent before' if signals else ''
    results = '\n\n'.join(filter(None, (void, compared, table(rows), *faults, stopped)))
    print(f'\n{results}', flush=True)
    if options.out and not stopped:
        picture = options.out.with_suffix('.png')
        draw(picture, logs[options.beside[0]], model=options.model, block=bench.block)
        options.out.write_text(
            f'# Bench of `{options.model}` at {options.rate:g} Hz{", void" if void else ""}\n\n'
            f'![Latencies of each node]({picture.name})\n\n'
            f'{about}\n\n{results}\n', 'utf-8')
    faulty = any(row['wrong'] or row['lost'] and row['node'] != 'soup' for row in rows)
    return 128 + signals[0] if signals else int(faulty or bool(faults) or bool(void))


@contextlib.contextmanager
def loops(surroundings: str, cores: set[int]) -> Iterator[None]:
    """Keep a loop running on each of some cores, of the priority that the surroundings have."""
    with contextlib.ExitStack() as ending:
        for core in () if surroundings == QUIET else cores:
            loop = ending.enter_context(running(['-c', 'while True: pass']))
            os.sched_setaffinity(loop.pid, {core})
            os.setpriority(os.PRIO_PROCESS, loop.pid, NICENESS[surroundings])
        yield


def _options(args: Sequence[str]) -> argparse.Namespace:
    parser = program_parser('bench', __doc__)
    parser.add_argument('--rate', type=within(1.0, 4000.0), default=RATE, metavar='HZ',
                        help='pairs of poses sent per second (default: %(default)g)')
    parser.add_argument('--duration', type=within(1.0, LONGEST), default=SECONDS, metavar='S',
                        help='time in which poses are sent, split evenly over the nodes (default: '
                             '%(default)g)')
    parser.add_argument('--model', type=model_name, default='exact', metavar='NAME',
                        help=f'of the contact node: {", ".join(MODELS)} (default: %(default)s)')
    parser.add_argument('--nodes', nargs='+', choices=NODES, default=list(NODES), metavar='NAME',
                        help=f'that take turns, contact among them: {", ".join(NODES)} (default: '
                             'all)')
    parser.add_argument('--beside', nargs='+', choices=SURROUNDINGS, default=[QUIET],
                        metavar='NAME', help=f'surroundings, one after the other, each for the '
                        f'whole time: {", ".join(SURROUNDINGS)} (default: {QUIET})')
    parser.add_argument('--out', type=Path, metavar='FILE.md',
                        help='file for the report; its picture, which needs the extra report, is '
                             'FILE.png (default: none)')
    options = parser.parse_args(list(args))
    if 'contact' not in options.nodes:
        parser.error('argument --nodes: the contact node must be among them')
    if options.out:
        try:
            options.out.parent.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=options.out.parent).close()
        except OSError as error:
            parser.error(f'cannot write to {options.out.parent} ({error.strerror})')
        require('report')
    return options


def _about(options: argparse.Namespace, own: set[int], nodes: set[int]) -> str:
    """Return where and how the bench runs, a line of a Markdown list for each fact."""
    fields = r'^(model name|cpu family|model)\s*: (.*)'
    cpu = dict(re.findall(fields, Path('/proc/cpuinfo').read_text(), re.MULTILINE))
    return '\n'.join([
        f'- machine: {cpu.get("model name", platform.machine())} (family '
        f'{cpu.get("cpu family", "unknown")}, model {cpu.get("model", "unknown")}), '
        f'{native.instruction_set}, {os.cpu_count()} cores; load {os.getloadavg()[0]:.2f}',
        f'- Python {platform.python_version()}, numpy {version("numpy")}, rclpy '
        f'{version("rclpy")}, compiler {native.compiler}',
        f'- cores: bench on {own}, nodes on {nodes}',
        f'- model {options.model}, {options.rate:g} pairs per second for {options.duration:g} s'])


if __name__ == '__main__':
    sys.exit(main())

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The bench: compares the latency of contact node, soup node and echo node on the same poses.

Each node is a process of its own, in a ROS domain of its own on this host. The bench sends pairs of
poses of equal stamp: swaying containers, then touching cubes. Blocks of half a second go to one
node after the other, in an order that is drawn for each block. With --side-by-side all nodes answer
the same poses at the same time, and compete for the cores.

Reports latencies, their ratios with 95 % intervals, lost and wrong answers by comparison with the
exact contacts, and what the nodes take of processor and memory. A long run finds memory that grows:
--rate 1000 --duration 600.

The exit status is 0 only if contact and echo node lost nothing, no answer was wrong, and the run is
not void. It is void if the bench itself was late by more than a period in over 1 % of the pairs.
"""
from __future__ import annotations

import argparse
import os
import platform
import sys
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path

from ..core import native
from ..node.contact_node import PARAMETERS
from ..node.parameters import outside_ros_args
from ..node.processes import add_domain
from ..node.runtime import refusals_end
from ..output import machine, make_folder
from ..solver.arguments import add_models, program_parser, within
from .bench_drive import open_bench
from .bench_report import all_figures, ratio_line, table, void_reason, write_report
from .measured_node import PREFIXES
from .pose_streams import STREAMS, make_streams

RATE, SECONDS, LONGEST = 200.0, 60.0, 3600.0  # [Hz], [s], [s]
PACKAGES = ('numpy', 'rclpy', 'ros-fastrtps')  # whose versions are named


@refusals_end
def main(args: Sequence[str] | None = None) -> int:
    """Run the bench; return its exit status."""
    args = sys.argv[1:] if args is None else list(args)
    options = _options(outside_ros_args(args))
    names = [name for name in PREFIXES if name in options.nodes]
    if 'soup' in names and not find_spec('fcl'):
        print('without the soup node: python-fcl is not installed (extra: soup)')
        names.remove('soup')
    if not names:
        return 1
    inputs = {name: '' if options.side_by_side else f'for_{name}/' for name in names}
    with open_bench(inputs, args, domain=options.domain, model=options.model, rate=options.rate,
                    seed=options.seed) as bench:
        about = _about(options, bench.cores)
        print('\n'.join(f'{name}: {value}' for name, value in about.items()), flush=True)
        turns = len(set(inputs.values()))
        count = max(2, round(options.rate * options.duration / (STREAMS * turns)))
        logs = [log for stream in make_streams(count, rate=options.rate, seed=options.seed)
                if not bench.stop.is_set() for log in bench.run(stream)]
    rows = all_figures(logs, block=bench.block)
    void = void_reason(rows, options.rate)
    stopped = 'interrupted: figures are of what was sent before' if bench.stop.is_set() else ''
    lines = [line for line in (ratio_line(rows), *bench.faults, void, stopped) if line]
    print(f'\n{table(rows)}\n')
    print('\n'.join(lines), flush=True)
    if options.out and rows:
        write_report(options.out, logs, rows, lines, about)
    faulty = any(row['wrong'] or row['lost'] and row['node'] != 'soup' for row in rows)
    return bench.stop.status or int(faulty or bool(bench.faults) or bool(void))


def _options(args: Sequence[str]) -> argparse.Namespace:
    parser = program_parser('bench', __doc__, seed=1)
    parser.add_argument('--rate', type=within(1.0, 4000.0), default=RATE, metavar='HZ',
                        help='pairs of poses sent per second (default: %(default)g)')
    parser.add_argument('--duration', type=within(1.0, LONGEST), default=SECONDS, metavar='S',
                        help='time in which poses are sent, split evenly over streams, and over '
                             'nodes unless they are side by side (default: %(default)g)')
    parser.add_argument('--nodes', nargs='+', choices=PREFIXES, default=list(PREFIXES),
                        metavar='NODE',
                        help=f'nodes to drive, of {", ".join(PREFIXES)} (default: all)')
    add_models(parser, '--model', PARAMETERS['model'].default)
    parser.add_argument('--side-by-side', action='store_true',
                        help='send all nodes the same poses at the same time')
    parser.add_argument('--out', type=Path, metavar='DIR',
                        help='folder for bench.md, bench.csv and bench.png (default: none)')
    add_domain(parser)
    options = parser.parse_args(list(args))
    if options.out:
        make_folder(parser, options.out)
    return options


def _about(options: argparse.Namespace, node_cores: set[int]) -> dict[str, str]:
    """Return where and how the bench runs, for the page and each row of the CSV file."""
    own = ' '.join(map(str, sorted(os.sched_getaffinity(0))))
    cores = ' '.join(map(str, sorted(node_cores)))
    return {'machine': f'{platform.node()}: {machine(native, PACKAGES)}, {os.cpu_count()} cores',
            'cores': f'bench on {own}, nodes on {cores}',
            'load at start': f'{os.getloadavg()[0]:.2f}',
            'nodes run': 'side by side' if options.side_by_side else 'in turn',
            'model': options.model,
            'set rate [Hz]': f'{options.rate:g}',
            'sending [s]': f'{options.duration:g}'}


if __name__ == '__main__':
    sys.exit(main())

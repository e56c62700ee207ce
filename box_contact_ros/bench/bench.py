# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The bench: drives the nodes with named streams of poses at a set rate, and measures the answers.

Contact node, soup node and an echo node run as processes of their own, in a ROS domain of their
own on this host. Each stream goes to one of them after the other, so that they do not compete for
cores. Every answer is paired by stamp with what was sent, and compared with the exact contact. The
streams for cubes come first; for the containers the nodes are restarted, with the other sizes.
With --boxes N one contact node alone gets a pose array of N moving boxes a tick, five pairs a box.
Prints what was lost or wrong, the node's share of its core, and latencies; writes no files.
With --replay the stream is a recording's pairs of poses of equal stamp, sent at --rate. Prints two
tables and writes bench.csv, bench.md and bench.png.
With --soak a contact node runs at 1 kHz for ten minutes, in turn with a bare echo node and one that
is served alike. Detects answers that mix poses of two ticks, and memory that grows. Prints a table
and writes soak.csv and soak.md.

The exit status is 0 only if every node answered and the counts add up (sent = answered + lost).
The contact node must lose nothing, and give no wrong verdict and no answer twice. In a soak its
memory must grow by less than 1 MB after the first ten seconds.
"""
from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from tqdm import tqdm

from benchmarks.soak import soak
from box_contact_ros.bench.answer_log import StreamResult
from box_contact_ros.demo.processes import add_domain
from box_contact_ros.node.contact_program import PARAMETERS
from box_contact_ros.node.parameters import outside_ros_args
from box_contact_ros.node.runtime import refusals_end
from box_contact_ros.output import make_folder, percentiles
from box_contact_ros.scene.scene_solver import SceneSolver
from box_contact_ros.solver.arguments import add_models, program_parser, within
from box_contact_ros.view.recording.stream import Replay, Stream

from ..soup.entries import MOST_SOUP_DIVISIONS, SOUP_DIVISIONS
from .bench_drive import (
    Bench,
    MeasuredNode,
    about_the_machine,
    adds_up,
    drive_array,
    echo_node,
    open_bench,
    solver_node,
)
from .bench_report import all_latencies, bullets, draw, error_table, latency_table, write_results
from .pose_streams import STREAMS, by_sizes, crowd, make_stream

NODES = ('contact', 'soup', 'echo')
SECONDS, SOAK_SECONDS, LONGEST = 60.0, 600.0, 86_400.0
"""Of sending, in all: the defaults, and what is accepted."""
RATE, SOAK_RATE = 200.0, 1000.0  # [Hz]
QUICK_SECONDS, SOAK_QUICK = 0.5, 2.0  # of every stream, and of a soak, with --quick


@refusals_end
def main(args: Sequence[str] | None = None) -> int:
    """Run the bench; 0 only if all nodes answered, all adds up, the contact node is faultless."""
    args = list(args or ())
    options = _options(outside_ros_args(args))
    if options.boxes:
        return _bench_array(options, args)
    if options.soak:
        return soak(options, args)
    with open_bench(_nodes(options), args, rate=options.rate, domain=options.domain) as bench:
        streams = _streams(options)
        truths = {stream.name: stream.contacts('exact') for stream in streams}
        about = _about(options, streams, bench.node_cores)
        print('\n'.join(f'{name}: {value}' for name, value in about.items()), flush=True)

        def play(stream: Stream) -> None:
            for turn in bench.turns():
                bench.play(stream, truths[stream.name], turn)

        bench.run(by_sizes(streams), play)
    passed = _report(options, bench, about)
    return bench.stop.status or (0 if passed else 1)


def _options(args: Sequence[str]) -> argparse.Namespace:
    parser = program_parser(
        'bench', __doc__, seed=1, quick=f'{QUICK_SECONDS:g} s per stream, to see that it works',
        epilog='streams:\n' + '\n'.join(
            f'  {name:<14} {source.description}' for name, source in STREAMS.items())
        + '\n\nWhat follows --ros-args is for the bench itself, not for the nodes.')
    parser.add_argument('--rate', type=within(1.0, 4000.0), metavar='HZ',
                        help=f'pairs of poses sent per second (default: {RATE:g}; of a soak '
                             f'{SOAK_RATE:g})')
    parser.add_argument('--duration', type=within(0.1, LONGEST), metavar='S',
                        help='time in which poses are sent, split evenly over streams and nodes; '
                             'of a soak, to the contact node, and each echo node takes half as '
                             f'long in addition (default: {SECONDS:g}; of a soak '
                             f'{SOAK_SECONDS:g}, of a replay all of it)')
    _add_source(parser)
    parser.add_argument('--nodes', nargs='+', choices=NODES, default=list(NODES), metavar='NODE',
                        help=f'nodes to drive, of {", ".join(NODES)} (default: all)')
    add_models(parser, '--model', PARAMETERS['model'].default)
    parser.add_argument('--divisions', type=within(1, MOST_SOUP_DIVISIONS), default=SOUP_DIVISIONS,
                        metavar='N', help='divisions of an edge in the polygon soup (default: '
                                          '%(default)s)')
    parser.add_argument('--side-by-side', action='store_true',
                        help='one input for all nodes at the same time, as they would run next to '
                             'a simulator; they then compete for cores, and the floor with them '
                             '(default: each stream goes to one node after the other)')
    parser.add_argument('--out', type=Path, default=Path('bench-results'), metavar='FOLDER',
                        help='folder for the files (default: %(default)s/)')
    add_domain(parser)
    options = parser.parse_args(list(args))
    if options.replay is None:
        if options.size_a or options.size_b:
            parser.error('--size-a and --size-b are of a --replay: streams have their sizes')
        if options.pair:
            parser.error('--pair is of a --replay')
        if options.duration is None:
            options.duration = SOAK_SECONDS if options.soak else SECONDS
    options.rate = options.rate or (SOAK_RATE if options.soak else RATE)
    options.streams = [name for name in STREAMS if name in options.streams and not options.replay]
    options.nodes = [name for name in NODES if name in options.nodes]
    if options.quick:
        quick = SOAK_QUICK if options.soak else QUICK_SECONDS * max(1, len(options.streams))
        options.duration = min(options.duration or quick, quick)
    make_folder(parser, options.out)
    return options


def _add_source(parser: argparse.ArgumentParser) -> None:
    """Add the options of what is sent: streams, or a recording."""
    source = parser.add_mutually_exclusive_group()
    source.add_argument('--streams', nargs='+', choices=STREAMS, default=list(STREAMS),
                        metavar='NAME', help='streams to send, of those below (default: all)')
    source.add_argument('--replay', type=Path, metavar='BAG',
                        help='a recording instead of the streams: the folder of a rosbag2 bag, or '
                             'an .mcap file')
    source.add_argument('--boxes', type=within(8, 10_000), default=0, metavar='N',
                        help='moving boxes, all in one message, instead of the streams')
    source.add_argument('--soak', action='store_true',
                        help='the long form: contact node and echo nodes in turn, ten minutes')
    parser.add_argument('--pair', default='', metavar='NAME',
                        help='pair of the recorded scene to replay (default: its first)')
    for box in 'ab':
        parser.add_argument(f'--topic-{box}', default='', metavar='NAME',
                            help=f'topic of the poses of box {box.upper()} to replay (default: '
                                 f'that of the pair, or box_{box}/pose if no scene was recorded)')
        parser.add_argument(f'--size-{box}', type=float, nargs=3, metavar=('X', 'Y', 'Z'),
                            help=f'full extents of box {box.upper()} in the replay [m] '
                                 '(default: as the recording says)')


def _nodes(options: argparse.Namespace) -> list[MeasuredNode]:
    """Return the nodes that were asked for; side by side, they listen to the same topics."""
    poses = {name: '' if options.side_by_side else f'for_{name}/' for name in NODES}
    nodes = {
        'contact': solver_node('contact', options.model, poses=poses['contact'],
                               model=options.model),
        'soup': solver_node('soup', f'soup-{options.divisions}', poses=poses['soup'],
                            prefix='soup/', divisions=options.divisions),
        'echo': echo_node('echo', poses=poses['echo']),
    }
    return [nodes[name] for name in options.nodes]


def _streams(options: argparse.Namespace) -> list[Stream]:
    shares = max(1, len(options.streams)) * (1 if options.side_by_side else len(options.nodes))
    count = options.duration and max(2, round(options.rate * options.duration / shares))
    if options.replay:
        from box_contact_ros.view.recording.bag_file import (
            read_replay,  # only here: rosbags is an extra
        )

        replay = read_replay(options.replay, options.topic_a, options.topic_b,
                             pair=options.pair, size_a=options.size_a, size_b=options.size_b)
        return [replay.thinned(count)]
    return [make_stream(name, count, options.seed)
            for name in tqdm(options.streams, desc='make streams', disable=None, leave=False)]


def _about(options: argparse.Namespace, streams: list[Stream], node_cores: set[int],
           ) -> dict[str, str]:
    """Return where and how it ran, for the output and every row of the CSV."""
    replay = [stream.described for stream in streams if isinstance(stream, Replay)]
    return about_the_machine(node_cores) | {
        'nodes run': 'side by side' if options.side_by_side else 'in turn',
        'set rate [Hz]': f'{options.rate:g}',
        'seed': str(options.seed),
    } | ({'replay': f'{options.replay}: {replay[0]}'} if replay else {})


def _report(options: argparse.Namespace, bench: Bench, about: Mapping[str, str]) -> bool:
    """Print and write the results; return whether the bench passed."""
    # A replay has a name that is not in the list, and is the only stream.
    order = {name: number for number, name in enumerate(STREAMS)}
    results = sorted((result for node in bench.nodes for result in node.log.results()),
                     key=lambda r: (order.get(r.stream, 0), options.nodes.index(r.node)))
    if bench.stop.is_set() and not results:
        print('\ninterrupted before the first stream had been answered: no results')
        return False
    lines = _findings(bench, results)
    text = ('latency [ms], from the stamp of the poses to the answer\n\n'
            f'{latency_table(results)}\n\n'
            'error against the exact contact: point [mm], normal [deg]\n\n'
            f'{error_table(results)}\n')
    print(f'\n{text}')
    print('\n'.join(lines), flush=True)
    if results:
        write_results(options.out / 'bench.csv', results, about)
        (options.out / 'bench.md').write_text(
            f'# Bench\n\n{bullets(about)}\n\n{text}\n{bullets(lines)}\n', 'utf-8')
        draw(options.out / 'bench.png', results,
             f'{options.rate:g} Hz, nodes {about["nodes run"]}\n{about["machine"]}')
        print(f'results: {options.out}/bench.csv, bench.md, bench.png', flush=True)
    faulty = any(r.faults for r in results if r.node == 'contact')
    return (bool(results) and adds_up(bench) and not bench.notes and not faulty
            and not bench.stop.is_set())


def _findings(bench: Bench, results: Sequence[StreamResult]) -> list[str]:
    """Return what stands below the tables: faults, sums by node, and how late the bench was."""
    lines = list(bench.notes)
    if bench.stop.is_set():
        lines.append('interrupted: figures are of the streams that ended before')
    lines += [f'{node.name}: {_sum(node.name, results)}' for node in bench.nodes]
    lines.append('sent = answered + lost: ' + ('yes' if adds_up(bench) else 'NO'))
    late = [1e3 * np.array(percentiles(r.lateness, 99, 100)) for r in results]
    if late and np.max(late) > 0.0:
        p99, most = np.max(late, axis=0)
        lines.append(f'the bench itself was late by p99 {p99:.3f} ms, at most {most:.3f} ms')
    return lines


def _sum(name: str, results: Sequence[StreamResult]) -> str:
    mine = [r for r in results if r.node == name]
    sent, answered = sum(r.sent for r in mine), sum(r.answered for r in mine)
    faults = [f'{r.stream}: {", ".join(r.faults)}' for r in mine if r.faults]
    text = f'sent {sent}, answered {answered}, lost {sum(r.lost for r in mine)}'
    latencies = all_latencies(results, name)
    if latencies.size:
        p50, p99 = percentiles(latencies, 50, 99)
        text += f', p50 {p50:.3f} ms, p99 {p99:.3f} ms'
    return f'{text} ({"; ".join(faults)})' if faults else text


def _bench_array(options: argparse.Namespace, args: Sequence[str]) -> int:
    """Drive one contact node with pose arrays; 0 only if nothing was lost or wrong."""
    scene, poses = crowd(options.boxes, options.seed)
    solver = SceneSolver(scene, model=options.model)
    truths = [{pair.id for pair, _ in solver(tick).touching} for tick in poses]
    found = drive_array(scene, poses, args, model=options.model, rate=options.rate,
                        seconds=options.duration, domain=options.domain)
    wrong = sum(ids != truths[number % len(truths)] for number, ids in found.ids.items())
    lost = found.sent - len(found.ids)
    latencies = percentiles(1e3 * np.array(found.latencies), 50, 99, 99.9, 100)
    for name, value in (found.about | {
            'scene': f'{options.boxes} moving boxes, {len(scene.pairs)} pairs, '
                     f'{np.mean([*map(len, truths)]):.0f} contacts a tick',
            'sent': f'{found.sent} at {options.rate:g} Hz, {lost} lost, {wrong} wrong',
            'CPU of the node': f'{100.0 * found.cpu_share:.1f} % of one core',
            'latency [ms]': 'p50 {:.2f}, p99 {:.2f}, p99.9 {:.2f}, max {:.2f}'.format(*latencies),
    }).items():
        print(f'{name}: {value}')
    return 0 if found.sent and not lost and not wrong else 1

"""The soak: a contact node at 1 kHz for ten minutes, with echo nodes in between.

There are two, which compute nothing: a bare one, and one served as the contact node is, with the
middleware's threads kept from interrupting it. All run as processes of their own, in a ROS domain
of their own on this host. Blocks of a few seconds go to the one and then to the others, so that
what disturbs the machine disturbs all. Every answer is held against what the same model says of the
same two poses: an answer that was put together from poses of two ticks is found. Prints a table,
and writes soak.csv and soak.md.

The exit status is 0 only if nothing was lost, mispaired, answered twice or wrong, and the contact
node's memory grew by less than 1 MB after its first block.
"""
from __future__ import annotations

import argparse
import dataclasses
import math
import random
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rclpy.utilities import remove_ros_args

from ...node.contact_node import PARAMETERS
from ...node.runtime import REFUSALS
from ...solver.arguments import check_ranges, make_folder
from ...solver.contact import Contacts
from ...solver.contact_solver import ContactSolver
from ...solver.models import MODELS
from ..processes import DOMAINS
from .bench_drive import Bench, Subject, about_the_machine, open_bench
from .bench_log import (
    CONTACT_MESSAGES,
    ECHO_MESSAGES,
    NodeLog,
    StreamLog,
    StreamResult,
    markdown,
    write_csv,
)
from .pose_streams import Stream, make_stream

BLOCK_SECONDS = 10.0
ECHO_SHARE = 0.25
"""Of a block, for each echo node."""
SAME_POINT = 1e-9
"""How far [m] the node's point may lie from the one that the model gives here: another processor
may round differently. Poses of the streams that follow each other differ by millimetres and more.
"""
GROWTH_LIMIT = 1.0
"""Of the contact node's resident memory after its first block [MB]."""
P50_LIMIT, P99_LIMIT, START_LIMIT = 1.25, 1.5, 2.5
"""Aims: ratios to the latencies of the echo node that is served alike, and seconds from start to
first answer."""
STREAMS = ('containers', 'crane')
"""Played in turn: unrelated poses, and a motion. For boxes of one size, so that nobody restarts."""


class SoakBench(Bench):
    """A bench that sends some nodes less, and looks at their memory after every block."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.memory: list[float] = []
        """Of the contact node after each block [MB]."""
        self.first_answer = math.nan
        """Seconds from the start of the node to its first answer, to a tenth."""

    def _play(self, stream: Stream, truth: Contacts, turn: list[Subject]) -> None:
        if turn[0].name != 'contact':
            rows = slice(0, round(ECHO_SHARE * len(stream)))
            stream = dataclasses.replace(
                stream, pose_a=stream.pose_a[rows], pose_b=stream.pose_b[rows])
            truth = Contacts(*(column[rows] for column in truth))
        super()._play(stream, truth, turn)
        for running in self._running:
            if running.subject is turn[0] and turn[0].name == 'contact':
                self.memory.append(resident(running.process.pid))

    def _start(self, stream: Stream) -> None:
        self._started = time.monotonic()
        super()._start(stream)

    def _decode(self) -> int:
        count = super()._decode()
        if math.isnan(self.first_answer) and self.subjects[0].log.offers_answered:
            self.first_answer = time.monotonic() - self._started
        return count


def resident(pid: int) -> float:
    """Resident memory of a process [MB], NaN where it is not told."""
    try:
        for line in Path(f'/proc/{pid}/status').read_text().splitlines():
            if line.startswith('VmRSS:'):
                return int(line.split()[1]) / 1024
    except OSError:
        pass
    return float('nan')


def main(args: Sequence[str] | None = None) -> int:
    """Run the soak; 0 only if all was right."""
    args = list(args or ())
    options = _options(remove_ros_args(args))
    subjects = [_contact(options), _echo('bare echo', 'bare/', '--bare'), _echo('echo', 'served/')]
    try:
        blocks, truths = _blocks(options)
        # Once by itself, so that no other node starts on the same core.
        with open_bench([_contact(options)], args, rate=options.rate, domain=options.domain,
                        kind=SoakBench) as first:
            first.run([blocks[:1]], truths, play=False)
        if first.stop.is_set():
            return first.stop.status
        with open_bench(subjects, args, rate=options.rate, domain=options.domain,
                        kind=SoakBench) as bench:
            about = about_the_machine(bench.node_cores) | {
                'set rate [Hz]': f'{options.rate:g}', 'model': options.model}
            print('\n'.join(f'{name}: {value}' for name, value in about.items()), flush=True)
            bench.run([blocks], truths)
    except REFUSALS as error:
        print(f'error: {error}', file=sys.stderr)
        return 1
    passed = _report(options, subjects, bench, first.first_answer, about)
    return bench.stop.status or (0 if passed else 1)


def _contact(options: argparse.Namespace) -> Subject:
    return Subject('contact', ['-m', 'box_contact_ros', 'contact_node', '--ros-args',
                               '-p', f'model:={options.model}'],
                   NodeLog('contact', options.model, CONTACT_MESSAGES), poses='for_contact/')


def _echo(name: str, prefix: str, *options: str) -> Subject:
    return Subject(name, ['-m', 'box_contact_ros.apps.bench.echo_node', *options, '--ros-args',
                          '-r', f'echo:={prefix}echo'],
                   NodeLog(name, '', ECHO_MESSAGES), prefix, poses=f'for_{prefix}', has_sizes=False)


def _options(args: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog='soak', description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--minutes', type=float, default=10.0, metavar='MIN',
                        help='of poses to the contact node; each echo node takes a quarter as long '
                             'beside (default: %(default)g)')
    parser.add_argument('--rate', type=float, default=1000.0, metavar='HZ',
                        help='pairs of poses sent per second (default: %(default)g)')
    parser.add_argument('--model', default=PARAMETERS['model'].default, choices=MODELS,
                        metavar='NAME', help=f'one of: {", ".join(MODELS)} (default: %(default)s)')
    parser.add_argument('--out', type=Path, default=Path('soak-results'), metavar='FOLDER',
                        help='for soak.csv and soak.md (default: %(default)s/)')
    parser.add_argument('--quick', action='store_true', help='two blocks of a second')
    parser.add_argument('--domain', type=int, default=random.choice(DOMAINS), metavar='ID',
                        help=f'ROS domain, 0 to {DOMAINS[-1]} (default: drawn at random)')
    options = parser.parse_args(list(args))
    check_ranges(parser, options, minutes=(0.02, 24 * 60), rate=(1, 4000),
                 domain=(0, DOMAINS[-1]))
    make_folder(parser, options.out)
    options.seconds = 2.0 if options.quick else 60.0 * options.minutes
    return options


def _blocks(options: argparse.Namespace) -> tuple[list[Stream], dict[str, Contacts]]:
    """The blocks in the order they are played, and what the model answers to each."""
    count = max(2, round(options.seconds / BLOCK_SECONDS))
    rows = round(options.rate * options.seconds / count)
    streams = [make_stream(name, rows) for name in STREAMS]
    solver = ContactSolver(*streams[0].sizes, model=options.model)
    answers = [solver.batch(stream.pose_a, stream.pose_b) for stream in streams]
    blocks, truths = [], {}
    for number in range(count):
        which = number % len(streams)
        name = f'{number:03d} {streams[which].name}'
        blocks.append(dataclasses.replace(streams[which], name=name))
        truths[name] = answers[which]
    return blocks, truths


def _report(options: argparse.Namespace, subjects: list[Subject], bench: SoakBench,
            first_answer: float, about: dict[str, str]) -> bool:
    """Print and write what was found; whether all was right."""
    results = {subject.name: subject.log.results() for subject in subjects}
    contact, bare, echo = (results[name] for name in ('contact', 'bare echo', 'echo'))
    if not (contact and bare and echo):
        print('\n'.join(['nothing was sent', *bench.notes]))
        return False
    growth = float(max(bench.memory) - bench.memory[0]) if bench.memory else float('nan')
    mispaired = sum(mispairs(subjects[0].log))
    counts = {'lost': sum(r.lost for r in contact),
              'mispaired or wrong': mispaired + sum(r.wrong_verdicts for r in contact),
              'answered twice, or to no pose': sum(r.duplicates + r.strangers for r in contact),
              'contradictions between cloud, point and normal': sum(
                  r.contradictions for r in contact)}
    mine, plain, floor = (1e3 * np.concatenate([r.latencies for r in of])
                          for of in (contact, bare, echo))
    clouds = 1e3 * np.concatenate([without_contact(log) for log in subjects[0].log.streams])
    table = [['latency [ms]', 'contact node', 'of it, no contact: one message',
              'echo, served alike', 'contact / echo', 'aim', 'bare echo', 'contact / bare echo']]
    for name, percent, aim in (('p50', 50, P50_LIMIT), ('p99', 99, P99_LIMIT), ('p99.9', 99.9, 0),
                               ('worst', 100, 0)):
        one, other, lone, echoed = (float(np.percentile(of, percent)) if of.size else math.nan
                                    for of in (mine, clouds, plain, floor))
        table.append([name, f'{one:.3f}', f'{other:.3f}', f'{echoed:.3f}', f'{one / echoed:.2f}',
                      f'{aim:g}' if aim else '', f'{lone:.3f}', f'{one / lone:.2f}'])
    lines = [f'sent: {sum(r.sent for r in contact)} to the contact node, '
             f'{sum(r.sent for r in echo)} to each echo node']
    lines += [f'{name}: {value}' for name, value in counts.items()]
    lines.append(f'memory: {bench.memory[0]:.1f} MB after the first block, grown by at most '
                 f'{growth:.2f} MB (limit {GROWTH_LIMIT:g})')
    lines.append(f'start of the contact node to its first answer: {first_answer:.1f} s '
                 f'(aim {START_LIMIT:g}, from warm caches)')
    for name, of in (('bare echo', bare), ('echo', echo)):
        p50, p99 = _ratio_by_block(contact, of)
        lines.append(f'block by block, contact / {name} is {p50:.2f} at p50 and {p99:.2f} at p99 '
                     f'(median of {len(of)} blocks)')
    lines.append(f'the soak itself was late by at most '
                 f'{1e3 * max(r.lateness_max for r in contact):.1f} ms')
    lines += bench.notes
    text = '\n'.join(f'- {line}' for line in lines)
    print(f'\n{markdown(table, left=1)}\n\n{text}', flush=True)
    write_csv(options.out / 'soak.csv', [*contact, *bare, *echo],
              {name: value for name, value in about.items() if name != 'model'})  # a column already
    where = '\n'.join(f'- {name}: {value}' for name, value in about.items())
    (options.out / 'soak.md').write_text(
        '# Soak\n\nMade by `python -m box_contact_ros soak`: blocks of poses to the contact node '
        'and to two echo nodes in turn,\na bare one and one whose threads are scheduled as the '
        "contact node's are. Latencies run from the stamp of the\nposes to the later of point and "
        'normal. The aims are for the ratio to the echo node served alike. Errors in soak.csv are\n'
        f"against the same model's answers.\n\n{where}\n\n{markdown(table, left=1)}\n\n{text}\n",
        'utf-8')
    print(f'results: {options.out}/soak.csv, soak.md')
    faultless = not any(counts.values())
    adds_up = (all(r.adds_up for r in [*contact, *bare, *echo])
               and all(s.log.adds_up for s in subjects))
    return faultless and adds_up and not bench.notes and not growth >= GROWTH_LIMIT


def _ratio_by_block(ours: Sequence[StreamResult], theirs: Sequence[StreamResult],
                    ) -> tuple[float, float]:
    """Medians of the ratios of p50 and of p99, of blocks that were sent one after the other."""
    ours_theirs = [[np.percentile(r.latencies, (50, 99)) if r.answered else (np.nan, np.nan)
                    for r in of] for of in (ours, theirs)]
    p50, p99 = np.nanmedian([a / b for a, b in zip(*map(np.asarray, ours_theirs))], axis=0)
    return float(p50), float(p99)


def without_contact(stream: StreamLog) -> np.ndarray:
    """Latencies [s] of the answers that are a cloud without rows, and nothing else."""
    rows = len(stream.stamps)
    received = stream.received['cloud'][:rows]
    alone = (received > 0) & ~stream.touching[:rows] & ~stream.refused[:rows]
    return 1e-9 * (received - np.array(stream.stamps, dtype=np.int64))[alone]


def mispairs(log: NodeLog) -> list[int]:
    """Answers of each stream whose point is not the model's for the two poses of that stamp."""
    found = []
    for stream in log.streams:
        rows = len(stream.stamps)
        here = (stream.received['point'][:rows] > 0) & stream.truth.colliding[:rows]
        apart = np.linalg.norm(stream.values['point'][:rows] - stream.truth.point[:rows], axis=1)
        depth = np.abs(stream.values['cloud'][:rows, 6] + stream.truth.separation[:rows])
        found.append(int(np.count_nonzero(
            here & ~((apart <= SAME_POINT) & (depth <= SAME_POINT)))))
    return found

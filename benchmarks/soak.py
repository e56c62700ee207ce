# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The long form of the bench: a contact node at 1 kHz for ten minutes, echo nodes in between.

The two echo nodes compute nothing. One is bare, and one is served as the contact node is, with the
middleware's threads kept from interrupting it. Blocks of a second go to the contact node and then
to the others, so that what disturbs the machine disturbs all. Every answer is compared with the
same model's for the same two poses, which detects answers that mix poses of two ticks.

All is right only if nothing was lost, mispaired, answered twice or wrong. The contact node's memory
must grow by less than 1 MB after its first ten blocks.
"""
from __future__ import annotations

import argparse
import dataclasses
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from box_contact_ros.bench.answer_log import AnswerLog, StreamLog, StreamResult
from box_contact_ros.bench.bench_drive import (
    Bench,
    MeasuredNode,
    about_the_machine,
    adds_up,
    echo_node,
    open_bench,
    solver_node,
)
from box_contact_ros.bench.bench_report import bullets, write_results
from box_contact_ros.bench.pose_streams import make_stream
from box_contact_ros.output import markdown_table, percentiles
from box_contact_ros.solver.contact import Contacts
from box_contact_ros.view.recording.stream import Stream

from .errors import distances

BLOCK_SECONDS = 1.0
ECHO_SHARE = 0.5  # of a block, for each echo node
SAME_POINT = 1e-9
"""How far [m] the node's point may lie from the one that the model gives here: another processor
may round differently. Poses of the streams that follow each other differ by millimetres and more.
"""
WARM_BLOCKS = 10  # after which the contact node's memory is what it needs
GROWTH_LIMIT = 1.0  # of its resident memory from then on [MB]
P50_LIMIT, P99_LIMIT, START_LIMIT = 1.25, 1.5, 2.5
"""Aims: ratios to the latencies of the echo node that is served alike, and seconds from start to
first answer."""
STREAMS = ('containers', 'crane')
"""Played in turn: unrelated poses, and a motion. For boxes of one size, so that nobody restarts."""
HEAD = """\
# Soak

Made by `python -m box_contact_ros bench --soak`. Blocks of poses go to the contact node and
to two echo nodes in turn. One echo node is bare, and the threads of the other are scheduled as the
contact node's are. Latencies run from the stamp of the poses to the later of point and normal.
Ratios are medians over the blocks. The aims are for the ratio to the echo node served alike.
Errors in soak.csv are against the same model's answers.
"""


def resident(pid: int) -> float:
    """Resident memory of a process [MB], NaN where it is not told."""
    try:
        pages = int(Path(f'/proc/{pid}/statm').read_text().split()[1])
    except OSError:
        return math.nan
    return pages * os.sysconf('SC_PAGE_SIZE') / 2**20


def soak(options: argparse.Namespace, args: Sequence[str]) -> int:
    """Run the soak with the bench's options; 0 only if all was right. args: for rclpy."""
    nodes = [_contact(options),
             echo_node('bare echo', poses='for_bare/', prefix='bare/', bare=True),
             echo_node('echo', poses='for_served/', prefix='served/')]
    blocks, truths = _blocks(options)
    first_answer, status = _time_start(options, args, blocks[0])
    if status:
        return status
    with open_bench(nodes, args, rate=options.rate, domain=options.domain) as bench:
        about = about_the_machine(bench.node_cores) | {
            'set rate [Hz]': f'{options.rate:g}', 'model': options.model}
        print('\n'.join(f'{name}: {value}' for name, value in about.items()), flush=True)
        memory = _play(bench, blocks, truths)
    passed = _report(options, bench, memory, first_answer, about)
    return bench.stop.status or (0 if passed else 1)


def _time_start(options: argparse.Namespace, args: Sequence[str], stream: Stream,
                ) -> tuple[float, int]:
    """Start a contact node by itself, so that no other one starts on the same core.

    Return the seconds to its first answer, and the exit status if a signal came.
    """
    node = _contact(options)
    with open_bench([node], args, rate=options.rate, domain=options.domain) as bench:
        started = bench.clock()
        bench.run([[stream]], lambda _: None)
    return (node.log.first_answer - started) * 1e-9, bench.stop.status


def _play(bench: Bench, blocks: list[Stream], truths: Mapping[str, Contacts]) -> list[float]:
    """Play blocks, shorter ones to the echo nodes; return the memory after each [MB]."""
    memory = []

    def play(block: Stream) -> None:
        for turn in bench.turns():
            if turn[0].name == 'contact':
                bench.play(block, truths[block.name], turn)
                if turn[0].process:
                    memory.append(resident(turn[0].process.pid))
            else:
                rows = slice(0, round(ECHO_SHARE * len(block)))
                bench.play(dataclasses.replace(
                    block, pose_a=block.pose_a[rows], pose_b=block.pose_b[rows]), None, turn)

    bench.run([blocks], play)
    return memory or [math.nan]


def _contact(options: argparse.Namespace) -> MeasuredNode:
    return solver_node('contact', options.model, poses='for_contact/', model=options.model)


def _blocks(options: argparse.Namespace) -> tuple[list[Stream], dict[str, Contacts]]:
    """Return the blocks in the order they are played, and what the model answers to each."""
    count = max(2, round(options.duration / BLOCK_SECONDS))
    rows = round(options.rate * options.duration / count)
    streams = [make_stream(name, rows, options.seed) for name in STREAMS]
    answers = [stream.contacts(options.model) for stream in streams]
    blocks, truths = [], {}
    for number in range(count):
        which = number % len(streams)
        name = f'{number:03d} {streams[which].name}'
        blocks.append(dataclasses.replace(streams[which], name=name))
        truths[name] = answers[which]
    return blocks, truths


def _report(options: argparse.Namespace, bench: Bench, memory: Sequence[float],
            first_answer: float, about: Mapping[str, str]) -> bool:
    """Print and write what was found; return whether all was right."""
    contact, bare, echo = results = [node.log.results() for node in bench.nodes]
    log = bench.nodes[0].log
    if not all(results):
        print('\n'.join(['nothing was sent', *bench.notes]))
        return False
    warm = memory[:WARM_BLOCKS][-1]
    growth = max(memory[WARM_BLOCKS:], default=warm) - warm
    counts = {'lost': sum(r.lost for r in contact),
              'mispaired or wrong': (sum(map(mispairs, log.streams))
                                     + sum(r.wrong_verdicts for r in contact)),
              'answered twice, or to no pose': sum(r.duplicates + r.strangers for r in contact),
              'contradictions between cloud, point and normal': sum(
                  r.contradictions for r in contact)}
    table = _latency_table(log, contact, bare, echo)
    lines = [f'sent: {sum(r.sent for r in contact)} to the contact node, '
             f'{sum(r.sent for r in echo)} to each echo node',
             *(f'{name}: {value}' for name, value in counts.items()),
             f'memory: {warm:.1f} MB after ten blocks, grown by at most {growth:.2f} MB '
             f'(limit {GROWTH_LIMIT:g})',
             f'start of the contact node to its first answer: {first_answer:.1f} s '
             f'(aim {START_LIMIT:g}, from warm caches)']
    lines.append('the soak itself was late by at most '
                 f'{1e3 * max(r.lateness.max() for r in contact):.1f} ms')
    text = bullets([*lines, *bench.notes])
    print(f'\n{table}\n\n{text}', flush=True)
    write_results(options.out / 'soak.csv', sum(results, []),
                  {name: value for name, value in about.items() if name != 'model'})
    (options.out / 'soak.md').write_text(
        f'{HEAD}\n{bullets(about)}\n\n{table}\n\n{text}\n', 'utf-8')
    print(f'results: {options.out}/soak.csv, soak.md')
    return (not any(counts.values()) and adds_up(bench) and not bench.notes
            and not growth >= GROWTH_LIMIT)


def _latency_table(log: AnswerLog, contact: Sequence[StreamResult], bare: Sequence[StreamResult],
                   echo: Sequence[StreamResult]) -> str:
    """Return latencies of the contact node, and ratios to those of both echo nodes."""
    head = ['latency [ms]', 'contact node', 'of it, no contact: one message',
            'echo, served alike', 'bare echo', 'contact / echo, by block', 'aim',
            'contact / bare echo, by block']
    whole = [np.concatenate([r.latencies for r in of]) for of in (contact, echo, bare)]
    whole.insert(1, np.concatenate([without_contact(stream) for stream in log.streams]))
    rows = [[name, *(f'{1e3 * percentiles(of, share)[0]:.3f}' for of in whole)]
            for name, share in (('p50', 50), ('p99', 99), ('p99.9', 99.9), ('worst', 100))]
    # Ratios of what is rare would say nothing.
    for row, aim, by_echo, by_bare in zip(rows, (P50_LIMIT, P99_LIMIT), by_block(contact, echo),
                                          by_block(contact, bare)):
        row += [by_echo, f'{aim:g}', by_bare]
    return markdown_table(head, [row + [''] * (len(head) - len(row)) for row in rows], padded=True)


def by_block(ours: Sequence[StreamResult], theirs: Sequence[StreamResult]) -> list[str]:
    """Return medians of the ratios of p50 and p99, of blocks sent one after the other."""
    mine, other = (np.array([percentiles(r.latencies, 50, 99) for r in of])
                   for of in (ours, theirs))
    rows = min(len(mine), len(other))
    return [f'{ratio:.2f}' for ratio in np.nanmedian(mine[:rows] / other[:rows], axis=0)]


def without_contact(stream: StreamLog) -> np.ndarray:
    """Return latencies [s] of the answers that are a cloud without rows, and nothing else."""
    return stream.latencies[~stream.contacts]


def mispairs(stream: StreamLog) -> int:
    """Count the answers whose point is not the model's for that stamp's poses."""
    rows, truth = slice(0, len(stream.stamps)), stream.truth
    here = (stream.received['point'][rows] > 0) & truth.colliding[rows]
    apart = distances(stream.values['point'][rows], truth.point[rows])
    depth = np.abs(stream.values['cloud'][rows, 6] + truth.separation[rows])
    return np.count_nonzero(here & ~((apart <= SAME_POINT) & (depth <= SAME_POINT)))

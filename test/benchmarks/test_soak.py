# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The soak: a short one, and that it would find what it is there to find."""
from __future__ import annotations

import csv
import os
import time
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip('mujoco')

from benchmarks.soak import by_block, mispairs, without_contact
from box_contact_ros import ContactSolver
from box_contact_ros.bench.answer_log import AnswerLog
from box_contact_ros.bench.pose_streams import make_stream
from box_contact_ros.core import native

MS = 1_000_000  # ns


def test_a_short_soak(program, tmp_path):
    """Two seconds at 1 kHz: nothing lost, mispaired or wrong, and a table beside the echo nodes."""
    for _ in range(3):  # a machine that stands still for a moment loses some, so another try
        running = program('bench', '--soak', '--quick', '--domain', os.environ['ROS_DOMAIN_ID'],
                          '--out', str(tmp_path))
        ended = running.wait(90)
        assert 'mispaired or wrong: 0' in running.output
        if ended == 0:
            break
    assert ended == 0, running.output
    for line in ('lost: 0', 'mispaired or wrong: 0', 'sent: 2000'):
        assert line in running.output
    assert 'memory: ' in (tmp_path / 'soak.md').read_text()
    with (tmp_path / 'soak.csv').open() as file:
        rows = list(csv.DictReader(file))
    assert [row['node'] for row in rows] == [
        name for name in ('contact', 'bare echo', 'echo') for _ in range(2)]
    assert all(row['lost'] == '0' for row in rows if row['node'] == 'contact')
    assert all(f', {native.instruction_set}, ' in row['machine'] for row in rows)


@pytest.mark.parametrize('shift', [0, 1])
def test_answers_of_other_poses_are_found(shift):
    """A node that takes B's pose of the tick before: every contact is seen to be mispaired."""
    stream = make_stream('containers', 200)
    solver = ContactSolver(*stream.sizes)
    truth = solver.batch(stream.pose_a, stream.pose_b)
    answers = solver.batch(stream.pose_a, np.roll(stream.pose_b, shift, axis=0))
    log = AnswerLog('contact', 'mlp')
    opened = log.open('containers', 200, truth)
    start = time.time_ns()
    for row in range(200):
        stamp = start + row * MS
        log.sent(stamp)
        values = [*answers.point[row], *answers.normal[row], -answers.separation[row]]
        if answers.colliding[row]:
            log.answer('point', stamp, stamp + MS, values[:3])
            log.answer('normal', stamp, stamp + MS, values[3:6])
        log.answer('cloud', stamp, stamp + MS, values if answers.colliding[row] else ())
    found = mispairs(opened)
    both = int(np.count_nonzero(answers.colliding & truth.colliding))
    assert found == (both if shift else 0) and both > 20
    assert len(without_contact(opened)) == np.count_nonzero(~answers.colliding)


def test_ratios_are_those_of_blocks():
    """A block at twice, thrice and five times its echo: the median, not the ratio of all."""
    ours, theirs = ([SimpleNamespace(latencies=np.full(10, latency)) for latency in latencies]
                    for latencies in ((2.0, 9.0, 5.0), (1.0, 3.0, 1.0)))
    assert by_block(ours, theirs) == ['3.00', '3.00']
    assert by_block(ours, theirs[:1]) == ['2.00', '2.00']

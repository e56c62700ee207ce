# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The bench's book-keeping and figures, without ROS: every planted fault shows up."""
from __future__ import annotations

import math

import numpy as np
import pytest

from box_contact_ros.bench.report import (
    AnswerLog,
    comparison,
    draw,
    figures,
    ratio,
    table,
    void_reason,
)
from box_contact_ros.solver.contact import Contacts

MS = 1_000_000  # ns
START = 1_700_000_000_000_000_000  # ns: stamps as large as real ones
PAIRS = 100
BLOCK = 20  # pairs
DEPTH = 2e-3  # of all pairs [m]


def exact() -> Contacts:
    """Return the truth: all pairs touch at a point of their own, at one depth."""
    points = np.stack([0.01 * np.arange(PAIRS), np.ones(PAIRS), np.zeros(PAIRS)], axis=1)
    return Contacts(np.ones(PAIRS, bool), np.full(PAIRS, -DEPTH),
                    np.tile([0.0, 0.0, -1.0], (PAIRS, 1)), points, np.full(PAIRS, np.nan),
                    np.full((PAIRS, 3, 3), np.nan), np.full(PAIRS, -1, np.int32))


def played(node: str = 'contact', *, delay: int = MS) -> AnswerLog:
    """Return the log of a node that answers every pair rightly.

    The point comes after half the delay [ns], the normal after all of it, then the contacts.
    """
    log = AnswerLog(node, exact())
    log.stamps[:] = START + 5 * MS * np.arange(PAIRS)
    log.lateness[:] = 1e-4
    for kind, later in (('point', delay // 2), ('normal', delay), ('contacts', delay + MS)):
        if kind in log.received:
            log.received[kind][:] = log.stamps + later
    if log.computes:
        log.points[:], log.depths[:] = log.truth.point, DEPTH
    return log


def counts(log: AnswerLog) -> tuple[int, int]:
    """Return how many answers were lost, and how many are wrong."""
    return int(log.lost.sum()), int(log.wrong.sum())


@pytest.mark.parametrize('node', ['contact', 'echo', 'floor'])
def test_a_faultless_run(node):
    """The latency is that of the normal, not that of the contacts."""
    log = played(node)
    assert counts(log) == (0, 0)
    assert log.latencies == pytest.approx(1e-3, abs=1e-12)


@pytest.mark.parametrize('kind', ['point', 'normal', 'contacts'])
def test_an_answer_without_one_of_its_messages_is_lost(kind):
    log = played()
    log.received[kind][10] = 0
    assert counts(log) == (1, 0)
    assert math.isnan(log.latencies[10]) and not np.isnan(log.latencies[11])


def test_what_was_not_sent_is_not_lost():
    assert counts(AnswerLog('contact', exact())) == (0, 0)


@pytest.mark.parametrize('depth, wrong', [
    (math.nan, 1), (DEPTH + 1e-8, 1), (-DEPTH, 1), (DEPTH + 1e-12, 0)])
def test_a_missing_contact_and_the_depth_of_another_tick_are_wrong(depth, wrong):
    log = played()
    log.depths[10] = depth
    assert counts(log) == (0, wrong)


def test_percentiles_are_over_all_answers():
    """Of a hundred answers of which ten are slow, p99 and maximum are those of a slow one."""
    log = played()
    log.received['normal'][90:] += 7 * MS
    log.points[3, 2] += 0.005
    row, = figures([log])
    assert (row['p50 [ms]'], row['p99 [ms]']) == pytest.approx((1.0, 8.0))
    assert (row['sent'], row['lost'], row['wrong']) == (PAIRS, 0, 0)
    assert (row['worst [ms]'], row['worst point error [mm]']) == ('8 of 100', '5 of 100')
    log.received['normal'][3] = 0
    assert figures([log])[0]['worst [ms]'] == '8 of 99'  # lost ones are no answers


def test_ratios_are_paired_by_pose():
    """Each pair takes a time of its own, and the contact node 1.5 times as long: no spread."""
    echo, contact = played('echo'), played()
    for log, factor in ((echo, 2), (contact, 3)):
        log.received['normal'][:] = log.stamps + factor * MS * (1 + np.arange(PAIRS))
    assert ratio(contact, echo, block=BLOCK) == pytest.approx((1.5, 1.5, 1.5), rel=1e-6)
    assert ratio(echo, echo, block=BLOCK) == (1.0, 1.0, 1.0)
    soup = played('soup', delay=3 * MS)
    soup.received['normal'][:] = soup.stamps + 6 * MS * (1 + np.arange(PAIRS))
    assert comparison([echo, contact, soup], block=BLOCK) == (
        'contact / echo 1.50 [1.50, 1.50], p50 1.50, p99 1.50; '
        'soup / contact 2.00 [2.00, 2.00], p50 2.00, p99 2.00')
    floor = played('floor')
    floor.received['normal'][:] = floor.stamps + MS * (1 + np.arange(PAIRS))
    assert comparison([floor, contact], block=BLOCK) == (
        'contact / floor 3.00 [3.00, 3.00], p50 3.00, p99 3.00')


def test_the_interval_of_a_ratio_spans_its_blocks():
    """Four blocks at twice, one at three times the baseline: 2, and nothing beyond 3."""
    echo, contact = played('echo'), played(delay=2 * MS)
    contact.received['normal'][80:] += MS
    middle, low, high = ratio(contact, echo, block=BLOCK)
    assert middle == pytest.approx(2.0) and low == pytest.approx(2.0)
    assert 2.0 <= high <= 3.0 + 1e-9


def test_a_late_bench_is_void():
    """One late pair of a hundred is not enough, three are: late by more than a period."""
    log = played()
    for late, void in ((0, False), (1, False), (3, True)):
        log.lateness[:late] = 0.2
        assert bool(reason := void_reason(figures([log]), 200.0)) == void
    assert reason.startswith('void: ') and '200.00 ms, at a period of 5.00 ms' in reason
    assert not void_reason([], 200.0)  # beside loops alone, which make it late


def test_a_dead_node_has_a_report():
    """All lost, no latency: empty cells, and a ratio that is no number."""
    dead = AnswerLog('contact', exact())
    dead.stamps[:] = START
    logs = [played('echo'), dead]
    rows = figures(logs)
    assert (rows[1]['lost'], rows[1]['wrong']) == (PAIRS, 0)
    lines = table(rows).splitlines()
    assert len({len(line) for line in lines}) == 1 and 'nan' not in lines[3]
    assert comparison(logs, block=BLOCK) == (
        'contact / echo nan [nan, nan], p50 nan, p99 nan')


def test_the_picture_is_as_wide_as_a_page(tmp_path):
    """With a row for each node, also for one that never answered."""
    image = pytest.importorskip('matplotlib.image')
    dead = AnswerLog('soup', exact())
    heights = []
    for logs in ([played('echo'), played()], [played('echo'), played(delay=3 * MS), dead]):
        draw(tmp_path / 'bench.png', logs, model='exact', block=BLOCK)
        height, width, _ = image.imread(tmp_path / 'bench.png').shape
        assert width == 700
        heights.append(height)
    assert 200 < heights[0] < heights[1] < 500

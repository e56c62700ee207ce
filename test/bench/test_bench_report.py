# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The bench's figures of known samples: percentiles, ratios, and what makes a run void."""
from __future__ import annotations

import math

import numpy as np
import pytest
from test_answer_log import MS, PAIRS, played, stamp_of

from box_contact_ros.bench.bench_report import (
    ALL,
    all_figures,
    draw,
    ratio,
    ratio_line,
    table,
    void_reason,
    write_report,
)

BLOCK = 20  # pairs


def test_percentiles_are_pooled_over_streams():
    """Of a fast and a slow stream, the p99 is that of the slow one, not a mean or a median."""
    fast, slow = played(delay=MS, stream='fast'), played(delay=8 * MS, stream='slow')
    pooled, *single = all_figures([fast, slow], block=BLOCK)
    assert [row['stream'] for row in (pooled, *single)] == [ALL, 'fast', 'slow']
    assert [row['latency_p99 [s]'] for row in single] == pytest.approx([1e-3, 8e-3], abs=1e-12)
    assert pooled['latency_p50 [s]'] == pytest.approx(4.5e-3, abs=1e-12)
    assert pooled['latency_p99 [s]'] == pooled['latency_max [s]'] == pytest.approx(8e-3, abs=1e-12)
    assert (pooled['sent'], pooled['lost'], pooled['wrong']) == (2 * PAIRS, 0, 0)


def test_ratios_are_paired_by_pose():
    """Each pair takes a time of its own, and the contact node 1.5 times as long: no spread."""
    logs = [played(node, lambda row: {}) for node in ('echo', 'contact')]
    for log, factor in zip(logs, (2, 3)):
        for row in range(PAIRS):
            log.received['normal'][row] = stamp_of(row) + factor * (1 + row) * MS
    assert ratio(logs, 'contact', 'echo', block=BLOCK) == pytest.approx((1.5, 1.5, 1.5), rel=1e-6)
    assert ratio_line(all_figures(logs, block=BLOCK)) == 'contact / echo 1.50 [1.50, 1.50]'


def test_the_interval_of_a_ratio_spans_its_blocks():
    """Four blocks at twice, one at three times the baseline: 2, and nothing beyond 3."""
    logs = [played('echo'), played('contact', delay=2 * MS)]
    for row in range(80, PAIRS):
        logs[1].received['normal'][row] = stamp_of(row) + 3 * MS
    middle, low, high = ratio(logs, 'contact', 'echo', block=BLOCK)
    assert middle == pytest.approx(2.0) and low == pytest.approx(2.0)
    assert 2.0 <= high <= 3.0 + 1e-9
    logs[1].received['normal'][:] = 0  # nothing answered
    assert all(map(math.isnan, ratio(logs, 'contact', 'echo', block=BLOCK)))


def test_a_late_bench_is_void():
    """One late pair of a hundred is not enough, three are: late by more than a period."""
    log = played()
    assert void_reason(all_figures([log], block=BLOCK), 200.0) == ''
    log.lateness[:1] = 0.2
    assert void_reason(all_figures([log], block=BLOCK), 200.0) == ''
    log.lateness[:3] = 0.2
    reason = void_reason(all_figures([log], block=BLOCK), 200.0)
    assert reason.startswith('void: ') and '200.00 ms, at a period of 5.00 ms' in reason


def test_a_dead_node_has_a_report(tmp_path):
    """All lost, no latency: empty cells, and page, CSV file and picture still come."""
    pytest.importorskip('matplotlib')
    dead = played('contact', lambda row: {'lost': ('point', 'normal', 'contacts')})
    rows = all_figures([played('echo'), dead], block=BLOCK)
    assert (rows[1]['lost'], rows[1]['wrong']) == (PAIRS, 0)
    assert 'nan' not in table(rows)
    write_report(tmp_path, [played('echo'), dead], rows, ['a line'], {'machine': 'one, two'})
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        'bench.csv', 'bench.md', 'bench.png']
    assert '- machine: one, two' in (tmp_path / 'bench.md').read_text()
    draw(tmp_path / 'none.png', [dead])
    assert all_figures([type(dead)('echo', 'unsent', dead.truth)], block=BLOCK) == []
    assert np.isnan(rows[1]['latency_p50 [s]'])

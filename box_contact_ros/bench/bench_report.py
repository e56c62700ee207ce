# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The results of the bench: figures, ratios, page, CSV file and picture. No ROS."""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..output import figure, markdown_table, percentiles, write_csv
from .answer_log import AnswerLog

ALL = 'all streams'
RESAMPLES = 2000  # of the bootstrap
COLORS = {'contact': 'tab:blue', 'soup': 'tab:red', 'echo': 'tab:gray'}
HEAD = ('stream', 'node', 'sent', 'lost', 'wrong', 'p50 [ms]', 'p99 [ms]', 'max [ms]',
        'point error [mm]', 'CPU [%]', 'memory [MB]')
NOTES = """\
- *Latency*: from the stamp of the poses to the arrival of the later of point and normal.
- *All streams*: percentiles over all answers of a node, not means over streams.
- *Point error*: the largest distance from the exact point.
- *CPU*: processor time divided by the time in which poses were sent.
- *Memory*: growth of the resident memory in the second half of the run.
- *Ratios*: median over blocks of the median ratio of latencies for the same poses, with a 95 %
  interval that comes from drawing the blocks anew."""


def ratio(logs: Sequence[AnswerLog], node: str, baseline: str, *, block: int,
          ) -> tuple[float, float, float]:
    """Return how many times as long a node's answers take as another's, and a 95 % interval.

    Latencies are paired by pose. The ratio is the median over blocks of their median ratios. The
    interval comes from drawing the blocks anew, as neighbouring answers share what disturbs them.
    NaN without answers.

    block: pairs per block.
    """
    medians = []
    for stream in dict.fromkeys(log.stream for log in logs):
        latencies = {log.node: log.latencies for log in logs if log.stream == stream}
        ratios = latencies[node] / latencies[baseline]
        blocks = np.split(ratios, range(block, len(ratios), block))
        medians += [np.nanmedian(ratios) for ratios in blocks if not np.isnan(ratios).all()]
    if not medians:
        return math.nan, math.nan, math.nan
    drawn = np.random.default_rng(1).choice(medians, (RESAMPLES, len(medians)))
    low, high = percentiles(np.median(drawn, axis=1), 2.5, 97.5)
    return float(np.median(medians)), low, high


def node_figures(logs: Sequence[AnswerLog]) -> dict[str, Any]:
    """Return the figures of one node as columns of the CSV file, pooled over the logs of streams.

    Times are in s, lengths in m, NaN where nothing was answered.
    """
    sent = [np.count_nonzero(log.stamps) for log in logs]
    row: dict[str, Any] = {
        'stream': logs[0].stream if len(logs) == 1 else ALL, 'node': logs[0].node,
        'sent': sum(sent), 'lost': sum(int(log.lost.sum()) for log in logs),
        'wrong': sum(int(log.wrong.sum()) for log in logs)}
    for name, unit, values in (('latency', 's', [log.latencies for log in logs]),
                               ('lateness', 's', [log.lateness for log in logs]),
                               ('point_error', 'm', [log.point_errors for log in logs])):
        pooled = np.concatenate(values)
        spread = percentiles(pooled[~np.isnan(pooled)], 50, 99, 100)
        row |= {f'{name}_{part} [{unit}]': value
                for part, value in zip(('p50', 'p99', 'max'), spread)}
    return row | {'cpu': float(np.average([log.cpu for log in logs], weights=sent)),
                  'memory_growth [B]': max(log.growth for log in logs)}


def all_figures(logs: Sequence[AnswerLog], *, block: int) -> list[dict[str, Any]]:
    """Return the figures of each node over all streams, then those of each stream by node.

    Each node but the first has its ratio to the node before it. A log in which nothing was sent has
    no row. block: pairs per block.
    """
    logs = [log for log in logs if log.stamps.any()]
    streams = list(dict.fromkeys(log.stream for log in logs))
    rows = []
    for group in [streams] * (len(streams) > 1) + [[stream] for stream in streams]:
        grouped = [log for log in logs if log.stream in group]
        nodes = list(dict.fromkeys(log.node for log in grouped))
        for place, node in enumerate(nodes):
            rows.append(node_figures([log for log in grouped if log.node == node]))
            if place:
                values = ratio(grouped, node, nodes[place - 1], block=block)
                rows[-1] |= {'ratio_to': nodes[place - 1],
                             **dict(zip(('ratio', 'ratio_low', 'ratio_high'), values))}
    return rows


def ratio_line(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the ratios of the first group of rows in a line."""
    return ', '.join(
        f'{row["node"]} / {row["ratio_to"]} {row["ratio"]:.2f} '
        f'[{row["ratio_low"]:.2f}, {row["ratio_high"]:.2f}]'
        for row in rows if 'ratio' in row and row['stream'] == rows[0]['stream'])


def void_reason(rows: Sequence[Mapping[str, Any]], rate: float) -> str:
    """Return why a run is void, '' if it is not.

    It is void where the bench itself was later than a period in more than one of 100 pairs.
    """
    lateness = max((row['lateness_p99 [s]'] for row in rows), default=0.0)
    if lateness <= 1.0 / rate:
        return ''
    return (f'void: the bench itself was late by p99 {1e3 * lateness:.2f} ms, at a period of '
            f'{1e3 / rate:.2f} ms')


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the figures as a Markdown table that reads well in a terminal, too."""
    return markdown_table(HEAD, [[
        row['stream'], row['node'], row['sent'], row['lost'],
        '' if row['node'] == 'echo' else row['wrong'],
        *(_cell(row[f'latency_{part} [s]'], 1e3, '.3f') for part in ('p50', 'p99', 'max')),
        _cell(row['point_error_max [m]'], 1e3, '.3g'), _cell(row['cpu'], 100.0, '.1f'),
        _cell(row['memory_growth [B]'], 1e-6, '.1f')] for row in rows], words=2, padded=True)


def _cell(value: float, factor: float, form: str) -> str:
    return '' if math.isnan(value) else format(factor * value, form)


def write_report(folder: Path, logs: Sequence[AnswerLog], rows: Sequence[Mapping[str, Any]],
                 lines: Sequence[str], about: Mapping[str, str]) -> None:
    """Write bench.md and bench.csv, and bench.png where matplotlib is installed."""
    listed = [f'- {name}: {value}' for name, value in about.items()]
    (folder / 'bench.md').write_text('\n'.join([
        '# Bench', '', 'Made by `python -m box_contact_ros.bench.bench`.', '', *listed, '',
        table(rows), '', *(f'- {line}' for line in lines), '', NOTES, '']), 'utf-8')
    write_csv(folder / 'bench.csv', [{**row, **about} for row in rows], digits=9)
    try:
        draw(folder / 'bench.png', logs)
    except ModuleNotFoundError as error:
        print(f'no picture: {error.name} is not installed (extra: report)')


def draw(path: Path, logs: Sequence[AnswerLog]) -> None:
    """Draw, for each node, which share of its answers takes at least how long."""
    drawing = figure((7.0, 4.5))
    axis = drawing.subplots()
    axis.set(xscale='log', yscale='log', xlabel='latency [ms]',
             ylabel='share of answers that take at least as long')
    for node in dict.fromkeys(log.node for log in logs):
        latencies = np.sort(np.concatenate([log.latencies for log in logs if log.node == node]))
        latencies = 1e3 * latencies[~np.isnan(latencies)]
        # The i-th answer itself is counted, so the share is never zero.
        share = np.arange(latencies.size, 0, -1) / max(1, latencies.size)
        axis.step(latencies, share, where='post', color=COLORS[node], label=f'{node} node')
    axis.grid(alpha=0.3)
    axis.legend()
    drawing.savefig(path)

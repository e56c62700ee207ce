# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What came back from each node, its figures as text, and a picture of them. No ROS.

Stamps and times of receipt are nanoseconds of one clock. A pair is answered once all messages of
its stamp have come: point, normal and contacts, from the echo node point and normal. Its latency
runs from the stamp to the later of point and normal. A pair that was sent and not answered is lost.
An answer is wrong if its depth differs from the exact one, or if it has no contact.
"""
from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..solver.contact import Contacts

DEPTH_TOLERANCE = 1e-9
"""Largest difference of a right depth from the exact one [m]; all models take it from the same
separating-axis test. The depths of two ticks differ by a thousand times more."""
NODES: dict[str, tuple[str, str, dict[str, object]]] = {
    'echo': ('bench.echo_node', 'echo/', {}),
    'floor': ('bench.echo_node', 'echo/', {'contacts': True}),
    'contact': ('node.run_contact_node', '', {}), 'soup': ('node.run_soup_node', 'soup/', {})}
"""Module of each node, what precedes the topics that it answers on, and its parameters. All topics
of a node are in the namespace bench/NAME."""
RESAMPLES = 2000  # of the bootstrap
PERCENTILES = {'p50': 50, 'p99': 99}
LATE = 'bench late p99 [ms]'  # the column by which a run is void
COMPARED = (('contact', 'echo'), ('contact', 'floor'), ('soup', 'contact'))
"""Which nodes are compared, as far as they run."""
COLOURS = {'echo': '0.6', 'floor': '0.4', 'contact': '#e6146e', 'soup': '#4678aa'}  # of the picture


class AnswerLog:
    """What was sent to one node, and what came back; rows are pairs of poses that touch."""

    def __init__(self, node: str, truth: Contacts) -> None:
        """Make room for answers to the pairs whose exact contacts are `truth`."""
        self.node, self.truth = node, truth
        rows = len(truth.colliding)
        self.stamps = np.zeros(rows, np.int64)  # [ns], 0: not sent
        self.lateness = np.full(rows, np.nan)  # of the bench itself [s]
        self.computes = node not in ('echo', 'floor')
        kinds = ('point', 'normal') if node == 'echo' else ('point', 'normal', 'contacts')
        self.received = {kind: np.zeros(rows, np.int64) for kind in kinds}  # [ns], 0: not yet
        self.points = np.full((rows, 3), np.nan)
        self.depths = np.full(rows, np.nan)  # [m], NaN: no contact

    @property
    def answered(self) -> np.ndarray:
        """Which pairs were answered; shape (rows,)."""
        return np.all([times > 0 for times in self.received.values()], axis=0)

    @property
    def lost(self) -> np.ndarray:
        """Which pairs were sent and not answered (rows,)."""
        return (self.stamps > 0) & ~self.answered

    @property
    def latencies(self) -> np.ndarray:
        """Return the time from stamp to answer of each row [s], NaN without an answer."""
        last = np.maximum(self.received['point'], self.received['normal'])
        return np.where(self.answered, 1e-9 * (last - self.stamps), np.nan)

    @property
    def wrong(self) -> np.ndarray:
        """Return for each row whether its answer is not that of `exact`."""
        right = np.abs(self.depths + self.truth.separation) <= DEPTH_TOLERANCE
        if not self.computes:
            return np.zeros(len(right), bool)
        return (self.received.get('contacts', np.zeros(1)) > 0) & ~right


def ratio(log: AnswerLog, baseline: AnswerLog, *, block: int) -> tuple[float, float, float]:
    """Return how many times as long a node's answers take as another's, and a 95 % interval.

    Latencies are paired by pose. The ratio is the median over blocks of their median ratios. The
    interval comes from drawing the blocks anew, as neighbouring answers share what disturbs them.
    NaN without answers.

    block: pairs per block.
    """
    ratios = log.latencies / baseline.latencies
    blocks = np.split(ratios, range(block, len(ratios), block))
    medians = [np.nanmedian(part) for part in blocks if not np.isnan(part).all()]
    if not medians:
        return math.nan, math.nan, math.nan
    drawn = np.random.default_rng(1).choice(medians, (RESAMPLES, len(medians)))
    low, high = np.percentile(np.median(drawn, axis=1), (2.5, 97.5))
    return float(np.median(medians)), float(low), float(high)


def comparison(logs: Sequence[AnswerLog], *, block: int) -> str:
    """Return the ratios of nodes that are COMPARED: those of `ratio`, and of p50 and p99.

    Such as `contact / echo 1.18 [1.15, 1.22], p50 1.19, p99 1.30`.
    """
    texts, log_of = [], {log.node: log for log in logs}
    for node, other in COMPARED:
        if node not in log_of or other not in log_of:
            continue
        log, before = log_of[node], log_of[other]
        middle, low, high = ratio(log, before, block=block)
        texts.append(', '.join([f'{node} / {other} {middle:.2f} [{low:.2f}, {high:.2f}]', *(
            f'{name} {_percentile(log.latencies, p) / _percentile(before.latencies, p):.2f}'
            for name, p in PERCENTILES.items())]))
    return '; '.join(texts)


def figures(logs: Sequence[AnswerLog]) -> list[dict[str, Any]]:
    """Return a row of the table for each node; NaN where nothing was answered."""
    return [{
        'node': log.node, 'sent': np.count_nonzero(log.stamps), 'lost': int(log.lost.sum()),
        'wrong': int(log.wrong.sum()),
        **{f'{name} [ms]': 1e3 * _percentile(log.latencies, p) for name, p in PERCENTILES.items()},
        'worst [ms]': _worst(1e3 * log.latencies),
        'worst point error [mm]': _worst(
            1e3 * np.linalg.norm(log.points - log.truth.point, axis=1)),
        **{f'bench late {name} [ms]': 1e3 * _percentile(log.lateness, p)
           for name, p in PERCENTILES.items()}} for log in logs]


def _worst(values: np.ndarray) -> str:
    """Return the largest of those values that are not NaN, and how many there are; '' of none."""
    values = values[~np.isnan(values)]
    return f'{values.max():.3g} of {len(values):,}' if len(values) else ''


def _percentile(values: np.ndarray, percent: float) -> float:
    """Return a percentile of those values that are not NaN; NaN of none."""
    values = values[~np.isnan(values)]
    return float(np.percentile(values, percent)) if len(values) else math.nan


def void_reason(rows: Sequence[Mapping[str, Any]], rate: float) -> str:
    """Return why a run is void, '' if it is not: the bench was late by more than a period.

    One late pair of a hundred is let pass.
    """
    lateness, period = max((float(row[LATE]) for row in rows), default=0.0), 1e3 / rate
    return '' if not lateness > period else (
        f'void: the bench itself was late by p99 {lateness:.2f} ms, at a period of {period:.2f} ms')


def table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the figures as a Markdown table that reads well in a terminal, too."""
    lines = [list(rows[0]), *([_cell(value) for value in row.values()] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*lines)]
    lines.insert(1, ['-' * (width - 1) + ':' for width in widths])
    return '\n'.join(
        '| ' + ' | '.join(cell.rjust(width) for cell, width in zip(line, widths)) + ' |'
        for line in lines)


def _cell(value: object) -> str:
    if not isinstance(value, float):
        return str(value)
    return '' if math.isnan(value) else f'{value:.3g}'


def draw(path: Path, logs: Sequence[AnswerLog], *, model: str, block: int) -> None:
    """Write a PNG, 700 pixels wide: how long each node took to answer. Needs matplotlib.

    model: of the contact node. block: pairs per block, as of `ratio`.
    """
    from matplotlib.figure import Figure  # only here: an extra
    from matplotlib.ticker import LogLocator

    figure = Figure(figsize=(7.0, 1.2 + 0.8 * len(logs)), dpi=100, layout='constrained')
    axes = figure.subplots(len(logs), sharex=True, squeeze=False)[:, 0]
    answered = [1e3 * log.latencies[~np.isnan(log.latencies)] for log in logs]
    every = np.concatenate([*answered, [0.1]])
    bins = np.geomspace(0.9 * every.min(), 1.1 * every.max(), 80)
    for axis, log, times in zip(axes, logs, answered):
        axis.hist(times, bins, color=COLOURS[log.node])
        axis.set(xscale='log', yticks=[])
        axis.spines[['left', 'top', 'right']].set_visible(False)
        words = 'no answer' if not len(times) else '\n'.join(
            f'{name} {_percentile(times, p):.3g} ms' for name, p in PERCENTILES.items())
        axis.set_ylabel(f'{log.node}\n{words}', rotation=0, horizontalalignment='right',
                        verticalalignment='center')
    axes[-1].xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes[-1].xaxis.set_major_formatter('{x:g}')
    axes[-1].set_xlabel('time from the stamp of the poses to the answer [ms]')
    log_of = {log.node: log for log in logs}
    for node, other in COMPARED:  # the title is the first that ran
        if node in log_of and other in log_of:
            times_as_long = ratio(log_of[node], log_of[other], block=block)[0]
            figure.suptitle(
                f'With model {model}, the {node} node takes {times_as_long:.2f} times as long as '
                f'the {other} node\n(median of the ratios of blocks in turn)', fontsize=11)
            break
    figure.savefig(path)

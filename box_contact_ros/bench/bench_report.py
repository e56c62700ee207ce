# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The results of the bench as tables, page, CSV file and picture. No ROS."""
from __future__ import annotations

import dataclasses
import math
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import LogFormatter

from box_contact_ros.bench.answer_log import StreamResult
from box_contact_ros.output import log_errors, markdown_table, percentiles, subplots, write_csv

ERRORS = (1e-6, 1e5)
"""Point errors that are drawn to scale [mm]; 0 has a band of its own below."""
COLORS = {'contact': 'tab:blue', 'soup': 'tab:red', 'echo': 'tab:gray'}
MARKERS = 'osD^vP*X<>hpd8'
TITLE_WIDTH = 90  # characters of a title's line: a longer one is clipped
DIGITS = 9  # significant digits of a figure in the CSV file
COUNTS = [entry.name for entry in dataclasses.fields(StreamResult) if entry.type in ('str', 'int')]


def bullets(lines: Iterable[str] | Mapping[str, str]) -> str:
    """Return a Markdown list, of lines or of names with values."""
    if isinstance(lines, Mapping):
        lines = (f'{name}: {value}' for name, value in lines.items())
    return '\n'.join(f'- {line}' for line in lines)


def write_results(path: Path, results: Iterable[StreamResult], about: Mapping[str, str]) -> None:
    """Write a row per node and stream, units in the column names, `about` in every row."""
    write_csv(path, [columns(result) | dict(about) for result in results], digits=DIGITS)


def columns(result: StreamResult) -> dict[str, object]:
    """Return a result as the columns of the CSV file; times in s, NaN where there is no figure."""
    spreads = (('latency', 's', result.latency), ('point_error', 'm', result.point_error),
               ('normal_error', 'deg', result.normal_error))
    p99, most = percentiles(result.lateness, 99, 100)
    return ({name: getattr(result, name) for name in COUNTS}
            | {f'{name}_{figure} [{unit}]': value for name, unit, figures in spreads
               for figure, value in figures.items()}
            | {'rate [Hz]': result.rate, 'lateness_p99 [s]': p99, 'lateness_max [s]': most})


def latency_table(results: Sequence[StreamResult]) -> str:
    """Return counts and latencies [ms], Markdown; in the words of `ros2 topic delay`."""
    head = ['stream', 'node', 'sent', 'answered', 'lost', 'dupl.', 'wrong', 'mean', 'min', 'max',
            'std dev', 'window', 'p50', 'p99', 'p99.9']
    rows = []
    for r in results:
        *spread, p50, p99, p999 = (_cell(1e3 * value, '.3f') for value in r.latency.values())
        wrong = '' if r.node == 'echo' else r.wrong_verdicts
        rows.append([r.stream, r.node, r.sent, r.answered, r.lost, r.duplicates, wrong, *spread,
                     len(r.latencies), p50, p99, p999])
    return markdown_table(head, rows, words=2, padded=True)


def error_table(results: Sequence[StreamResult]) -> str:
    """Return errors of contacts, Markdown; points in mm, normals in degrees."""
    head = ['stream', 'node', 'model', 'contacts', 'point median', 'p99', 'max', 'normal median',
            'p99', 'max']
    rows = [[r.stream, r.node, r.model, r.contacts,
             *(_cell(1e3 * value, '.3g') for value in r.point_error.values()),
             *(_cell(value, '.3g') for value in r.normal_error.values())]
            for r in results if r.node != 'echo' and r.contacts]
    return markdown_table(head, rows, words=3, padded=True)


def _cell(value: float, form: str) -> str:
    return '' if math.isnan(value) else format(value, form)


def all_latencies(results: Iterable[StreamResult], node: str) -> np.ndarray:
    """Return the latencies [ms] of a node in all its streams."""
    return 1e3 * np.concatenate([r.latencies for r in results if r.node == node] or [np.zeros(0)])


def draw(path: Path, results: Sequence[StreamResult], title: str) -> None:
    """Draw latency distributions, latencies by stream, and errors over latencies."""
    figure, axes = subplots(3, 1, (8.0, 11.0))
    nodes = list(dict.fromkeys(result.node for result in results))
    colors = {node: COLORS.get(node, f'C{i}') for i, node in enumerate(nodes)}
    for axis, drawn in zip(axes[:, 0], (_draw_tails, _draw_streams, _draw_errors)):
        drawn(axis, results, colors)
        axis.grid(alpha=0.3, axis='x' if drawn is _draw_streams else 'both')
    figure.suptitle('\n'.join(piece for line in title.splitlines()
                              for piece in textwrap.wrap(line, TITLE_WIDTH)))
    figure.savefig(path)


# The scales are set before anything is plotted: empty axes cannot be made logarithmic any more.

def _draw_tails(axis: Axes, results: Sequence[StreamResult], colors: Mapping[str, str]) -> None:
    axis.set(xscale='log', yscale='log', xlabel='latency [ms]', title='all streams',
             ylabel='share of answers that take at least as long')
    for node, color in colors.items():
        latencies = np.sort(all_latencies(results, node))
        if latencies.size:
            # Share of the answers that took longer than the i-th, itself counted: never zero.
            share = np.arange(latencies.size, 0, -1) / latencies.size
            axis.step(latencies, share, where='post', color=color, label=node)
    if axis.lines:
        axis.legend()


def _draw_streams(axis: Axes, results: Sequence[StreamResult], colors: Mapping[str, str]) -> None:
    names = list(dict.fromkeys(result.stream for result in results))
    axis.set(xscale='log', xlabel='latency [ms]', title='min to p99.9; dots: p50, p99',
             yticks=[-row for row in range(len(names))], yticklabels=names)
    for result in results:
        if not result.answered:
            continue
        row = list(colors).index(result.node)
        height = -names.index(result.stream) + 0.2 * (len(colors) / 2 - row)
        least, p50, p99, p999 = percentiles(1e3 * result.latencies, 0, 50, 99, 99.9)
        axis.plot([least, p999], [height] * 2, color=colors[result.node])
        axis.plot([p50, p99], [height] * 2, 'o', markersize=4, color=colors[result.node])


def _draw_errors(axis: Axes, results: Sequence[StreamResult], colors: Mapping[str, str]) -> None:
    height = log_errors(axis, *ERRORS, zero='0')
    axis.set(xscale='log', xlabel='latency, p50 [ms]', ylabel='point error, median to p99 [mm]',
             title='error against latency')
    markers = dict(zip(dict.fromkeys(result.stream for result in results), MARKERS))
    for result in results:
        if result.node == 'echo' or not result.point_errors.size:
            continue
        color, latency = colors[result.node], 1e3 * result.latency['p50']
        low, high = map(height, percentiles(1e3 * result.point_errors, 50, 99))
        axis.plot([latency] * 2, [low, high], color=color, alpha=0.4)
        axis.plot(latency, low, markers.get(result.stream, 'o'), color=color)
    for name, marker in markers.items():  # the shape tells the stream, whatever the node
        axis.plot([], [], marker, color='black', label=name)
    floor = all_latencies(results, 'echo')
    if floor.size:
        axis.axvline(float(np.median(floor)), color=colors['echo'], linestyle='--', label='echo')
    axis.xaxis.set_minor_formatter(LogFormatter(minor_thresholds=(1.0, 0.4)))
    axis.legend(fontsize='small', loc='center left', bbox_to_anchor=(1.0, 0.5))

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the page has to read: figures, the deepest contacts, the legend, as HTML. No ROS."""
from __future__ import annotations

import html
import math

from ..style import LEGEND, LISTED, patch_areas
from ..view_log import Snapshot, ViewFigures

NAMES_SHOWN = 3
"""Of the pairs that are stale, as many are named."""


def read_out(snapshot: Snapshot | None, figures: ViewFigures | None, model: str) -> str:
    """Return the figures as an HTML table; each value has its name as id."""
    if snapshot is None or figures is None:
        return _table('read-out', [('verdict', 'verdict', 'waiting for poses')])
    answer, edge = snapshot.answer, figures.edge
    verdict, pairs = 'no answer', len(snapshot.scene.labels)
    error = math.nan
    if answer is not None:
        verdict = 'contact' if len(answer.pairs) else 'no contact'
        error = max(answer.point_errors, default=math.nan)
    rows = [('verdict', 'verdict', verdict)]
    if pairs > 1 and answer is not None:
        rows.append(('pairs', 'pairs in contact', f'{len(answer.pairs)} of {pairs}'))
    return _table('read-out', [
        *rows,
        ('separation', 'separation' + (', least' if pairs > 1 else ''),
         f'{_text(1e3 * snapshot.separation, "+.2f")} mm'),
        ('error', f'point error of {model}', _share(error, edge)),
        ('error-p99', '&emsp;p99', _share(figures.point_error_p99, edge)),
        ('latency', 'latency, median', f'{_text(1e3 * figures.latency_median, ".2f")} ms'),
        ('latency-p99', '&emsp;p99', f'{_text(1e3 * figures.latency_p99, ".2f")} ms'),
        ('rate', 'answers', f'{figures.rate:g} /s'),
        ('lost', 'lost', f'{figures.lost} of {figures.answered + figures.lost}'),
    ])


def deepest_contacts(snapshot: Snapshot | None) -> str:
    """Return the deepest contacts with volume and area of their patch, then stale pairs in grey."""
    answer = snapshot.answer if snapshot else None
    if snapshot is None or answer is None:
        return ''
    labels, contacts = snapshot.scene.labels, answer.contacts
    areas = patch_areas(answer.semi_axes)
    lines = ''.join(
        f'<tr><td>{html.escape(labels[answer.pairs[row]])}</td>' + ''.join(
            f'<td style="text-align:right">{_text(value, form)}</td>' for value, form in (
                (1e3 * contacts['depth'][row], '.2f'), (contacts['volume'][row], '.3g'),
                (areas[row], '.3g'))) + '</tr>'
        for row in answer.deepest[:LISTED])
    more = len(answer.pairs) - LISTED
    if more > 0:
        lines += f'<tr><td colspan="4" style="opacity:0.6">and {more} more</td></tr>'
    if len(answer.stale):
        named = ', '.join(labels[row] for row in answer.stale[:NAMES_SHOWN])
        rest = len(answer.stale) - NAMES_SHOWN
        lines += ('<tr id="stale" style="color:#8a8a8a"><td colspan="4">stale: '
                  f'{html.escape(named)}{f" and {rest} more" if rest > 0 else ""}</td></tr>')
    return ('<table id="deepest" style="width:100%;padding:0 0.6em 0.4em;font-size:0.8em;'
            'line-height:1.4;font-variant-numeric:tabular-nums"><tr style="opacity:0.6">'
            '<td>deepest contacts</td><td style="text-align:right">depth [mm]</td>'
            '<td style="text-align:right">volume [m³]</td>'
            f'<td style="text-align:right">patch [m²]</td></tr>{lines}</table>')


def legend() -> str:
    """Return what each colour of the drawing means."""
    return '<div id="legend" style="padding:0 0.7em 0.6em;font-size:0.78em;line-height:1.5">' + (
        ''.join(f'<span style="white-space:nowrap;margin-right:0.9em"><span style="display:'
                f'inline-block;width:0.75em;height:0.75em;margin-right:0.35em;border-radius:2px;'
                f'background:rgb{colour}"></span>{text}</span> ' for colour, text in LEGEND)
        + '</div>')


def line(name: str, text: str, *, bad: bool) -> str:
    """Return a line of text with an id, red where it is bad news."""
    return (f'<div id="{name}" style="padding:0 0.7em 0.7em;font-size:0.85em;'
            f'{"color:#c00020" if bad else "opacity:0.7"}">{html.escape(text)}</div>')


def report(text: str) -> str:
    """Return a program's report as it stands."""
    return (f'<pre style="margin:0;padding:0.4em 0.6em;font-size:0.68em;line-height:1.35;'
            f'white-space:pre-wrap">{html.escape(text)}</pre>')


def _table(name: str, rows: list[tuple[str, str, str]]) -> str:
    cells = ''.join(
        f'<tr><td style="opacity:0.7">{label}</td><td id="{key}" style="text-align:right;'
        f'font-variant-numeric:tabular-nums"><b>{text}</b></td></tr>' for key, label, text in rows)
    return (f'<table id="{name}" style="width:100%;padding:0.6em;font-size:0.9em;'
            f'line-height:1.3">{cells}</table>')


def _text(value: float, form: str) -> str:
    return '–' if math.isnan(value) else format(value, form)


def _share(length: float, edge: float) -> str:
    """Return a length [m] in mm and as a share of an edge."""
    if math.isnan(length):
        return '–'
    return f'{1e3 * length:.1f} mm = {100.0 * length / edge:.2f} %'

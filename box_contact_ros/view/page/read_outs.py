# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the page has to read: figures, the deepest contacts, the legend, as HTML. No ROS.

All of it is put together by `tag`, which escapes: names and models come from other machines.
"""
from __future__ import annotations

import html
import math

from ..style import CONTACT, LEGEND, LISTED, patch_areas
from ..view_log import Snapshot, ViewFigures

LONGEST = 20_000
"""Characters of a text that are shown: a model's name may have megabytes, a report has 2,000."""
NAMES_SHOWN = 3
"""Of the pairs that are stale, as many are named."""


class Html(str):
    """Text that is HTML; any other is plain text."""


def tag(kind: str, *content: str, **attributes: str) -> Html:
    """Return an element; content is escaped and cut at LONGEST, unless it is Html."""
    names = ''.join(f' {name}="{html.escape(value)}"' for name, value in attributes.items())
    inside = ''.join(part if isinstance(part, Html) else html.escape(part[:LONGEST])
                     for part in content)
    return Html(f'<{kind}{names}>{inside}</{kind}>')


def read_out(snapshot: Snapshot | None, figures: ViewFigures | None, model: str) -> Html:
    """Return a line in plain words, and figures as an HTML table; each value has its name as id."""
    words = tag('div', in_words(snapshot), id='verdict',
                style='padding:0.5em 0.6em 0;font-size:1.15em;font-weight:600')
    if snapshot is None or figures is None:
        return words
    answer, edge = snapshot.answer, figures.edge
    pairs, rows, error = len(snapshot.scene.labels), [], math.nan
    if answer is not None:
        error = max(answer.point_errors, default=math.nan)
    if pairs > 1 and answer is not None:
        rows.append(('pairs', 'pairs in contact', f'{len(answer.pairs)} of {pairs}'))
    return Html(words + _table('read-out', [
        *rows,
        ('separation', 'separation' + (', least' if pairs > 1 else ''),
         f'{_text(1e3 * snapshot.separation, "+.2f")} mm'),
        ('error', f'point error of {model}', _share(error, edge)),
        ('error-p99', '\N{EM SPACE}p99', _share(figures.point_error_p99, edge)),
        ('latency', 'latency, median', f'{_text(1e3 * figures.latency_median, ".2f")} ms'),
        ('latency-p99', '\N{EM SPACE}p99', f'{_text(1e3 * figures.latency_p99, ".2f")} ms'),
        ('rate', 'answers', f'{figures.rate:g} /s'),
        ('lost', 'lost', f'{figures.lost} of {figures.answered + figures.lost}'),
        *([('refused', 'refused', f'{figures.refused}')] if figures.refused else []),
    ]))


def in_words(snapshot: Snapshot | None) -> str:
    """Return in words whether there is contact, and how deep; of several contacts the deepest."""
    if snapshot is None:
        return 'waiting for poses'
    if snapshot.answer is None:
        return 'no answer'
    if len(snapshot.answer.pairs):
        return f'contact, {_length(float(snapshot.answer.contacts["depth"].max()))} deep'
    gap = snapshot.separation
    return f'no contact, {_length(gap)} apart' if gap > 0.0 else 'no contact'


def _length(metres: float) -> str:
    return f'{metres:.2f} m' if metres >= 1.0 else f'{1e3 * metres:.1f} mm'


def highlight(number: int | None) -> Html:
    """Return the style that fills one button of the group that comes next; None: of none."""
    chosen = '' if number is None else (
        f'div:has(> #highlight) + div button:nth-of-type({number + 1}) '
        f'{{background: rgb{CONTACT}; color: white}}')
    return Html(f'<style id="highlight">{chosen}</style>')


def deepest_contacts(snapshot: Snapshot | None) -> Html:
    """Return the deepest contacts with volume and area of their patch, then stale pairs in grey."""
    answer = snapshot.answer if snapshot else None
    if snapshot is None or answer is None:
        return Html()
    labels, contacts = snapshot.scene.labels, answer.contacts
    areas = patch_areas(answer.semi_axes)
    lines = [tag('tr', tag('td', labels[answer.pairs[row]]), *(
        tag('td', _text(value, form), style='text-align:right') for value, form in (
            (1e3 * contacts['depth'][row], '.2f'), (contacts['volume'][row], '.3g'),
            (areas[row], '.3g')))) for row in answer.deepest[:LISTED]]
    more = len(answer.pairs) - LISTED
    if more > 0:
        lines.append(tag('tr', tag('td', f'and {more} more', colspan='4', style='opacity:0.6')))
    if len(answer.stale):
        named = ', '.join(labels[row] for row in answer.stale[:NAMES_SHOWN])
        rest = len(answer.stale) - NAMES_SHOWN
        lines.append(tag('tr', tag('td', f'stale: {named}{f" and {rest} more" if rest > 0 else ""}',
                                   colspan='4'), id='stale', style='color:#8a8a8a'))
    head = tag('tr', tag('td', 'deepest contacts'), *(
        tag('td', text, style='text-align:right')
        for text in ('depth [mm]', 'volume [m³]', 'patch [m²]')), style='opacity:0.6')
    return tag('table', head, *lines, id='deepest', style='width:100%;padding:0 0.6em 0.4em;'
               'font-size:0.8em;line-height:1.4;font-variant-numeric:tabular-nums')


def legend() -> Html:
    """Return what each colour of the drawing means."""
    return tag('div', *(part for colour, text in LEGEND for part in (tag(
        'span', tag('span', style='display:inline-block;width:0.75em;height:0.75em;'
                    f'margin-right:0.35em;border-radius:2px;background:rgb{colour}'), text,
        style='white-space:nowrap;margin-right:0.9em'), ' ')),
        id='legend', style='padding:0 0.7em 0.6em;font-size:0.78em;line-height:1.5')


def line(name: str, text: str, *, bad: bool) -> Html:
    """Return a line of text with an id, red where it is bad news."""
    return tag('div', text, id=name, style='padding:0 0.7em 0.7em;font-size:0.85em;'
               + ('color:#c00020' if bad else 'opacity:0.7'))


def report(text: str) -> Html:
    """Return a program's report as it stands."""
    return tag('pre', text, style='margin:0;padding:0.4em 0.6em;font-size:0.68em;line-height:1.35;'
               'white-space:pre-wrap')


def _table(name: str, rows: list[tuple[str, str, str]]) -> Html:
    return tag('table', *(tag('tr', tag('td', label, style='opacity:0.7'), tag(
        'td', tag('b', text), id=key, style='text-align:right;white-space:nowrap;'
        'font-variant-numeric:tabular-nums'))
        for key, label, text in rows), id=name,
        style='width:100%;padding:0.6em;font-size:0.9em;line-height:1.3')


def _text(value: float, form: str) -> str:
    return '–' if math.isnan(value) else format(value, form)


def _share(length: float, edge: float) -> str:
    """Return a length [m] in mm and as a share of an edge."""
    if math.isnan(length):
        return '–'
    return f'{1e3 * length:.1f} mm = {100.0 * length / edge:.2f} %'

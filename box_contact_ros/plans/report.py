# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What an inspection found, as lines, and as JSON and CSV."""
from __future__ import annotations

import dataclasses
import math
from typing import Any, NamedTuple

import numpy as np

from .inspection import CAUSES, UNSOUND_FAULTS, Inspection

MOST_NAMES = 3
"""Names that a line shows of a fault with more."""
LEFT_OUT = ('slot', 'size type', 'pose', 'dimension')
"""Faults for which a box is not in the plan."""


class Row(NamedTuple):
    """Something that is wrong: its kind, the boxes that are concerned, and what it is."""

    kind: str
    names: tuple[str, ...]
    text: str

    def __str__(self) -> str:
        """Return a line; what no terminal shows is a question mark."""
        names = '  '.join(self.names[:MOST_NAMES])
        if len(self.names) > MOST_NAMES:
            names += f' and {len(self.names) - MOST_NAMES:,} more'
        return ''.join(mark if mark.isprintable() else '?' for mark in
                       f'{self.kind:<20}  {names}{"  " if names else ""}{self.text}')


def rows_of(found: Inspection) -> list[Row]:
    """Return what is wrong with a plan, the worst first; a box is in one row, its worst."""
    plan, names = found.plan, found.plan.names
    told = [Row(fault.kind, fault.names, fault.text) for fault in plan.faults]
    rows = [row for kind in UNSOUND_FAULTS for row in told if row.kind == kind]
    for n in np.argsort(-found.depths, kind='stable').tolist():
        a, b = found.overlaps[n].tolist()
        rows.append(Row('overlap', (names[a], names[b]), f'{1e3 * found.depths[n]:.1f} mm deep'))
    seen = {name for row in rows for name in row.names}
    on_top = found.load / np.linalg.norm(found.acceleration)
    for cause in CAUSES:
        worst = -on_top if cause == 'overloaded' else found.margin
        boxes = np.flatnonzero(found.cause == cause)
        for box in boxes[np.argsort(worst[boxes], kind='stable')].tolist():
            text = (f'{on_top[box]:.0f} kg on top' if cause == 'overloaded' else
                    f'share {found.share[box]:.2f}, centre {_side(found.margin[box])}')
            if cause == 'tips under its load':
                text += f', under its load {_side(found.loaded_margin[box])}'
            if names[box] not in seen:
                rows.append(Row(cause, (names[box],), text))
    return rows + [row for row in told if row.kind not in UNSOUND_FAULTS]


def summary_of(found: Inspection) -> str:
    """Return one line on the whole plan."""
    plan = found.plan
    boxes = len(plan) - len(plan.ground)
    words = [f'{boxes:,} box' if boxes == 1 else f'{boxes:,} boxes']
    if plan.masses is not None and np.isfinite(found.mass) and found.mass > 0.0:
        words.append(f'{found.mass / 1e3:,.0f} t' if found.mass >= 1e4 else f'{found.mass:,.1f} kg')
        if np.isfinite(found.centre_of_mass).all():
            words.append('centre of mass {:.3f} {:.3f} {:.3f} m'.format(*found.centre_of_mass))
    lost = {name for fault in plan.faults if fault.kind in LEFT_OUT for name in fault.names}
    if lost := lost.difference(plan.names):
        words.append(f'{len(lost):,} left out')
    if len(plan) < 2 or not boxes:
        words.append('nothing can touch')
    return f'{", ".join(words)}: {"sound" if found.sound else "not sound"}'


def as_json(found: Inspection) -> dict[str, Any]:
    """Return all that was found, as msg_schemas/inspection.json has it; NaN and infinity are null.

    Boxes are named in the pairs, and in the order of `names` elsewhere.
    """
    plan = found.plan
    fields = {field.name: getattr(found, field.name) for field in dataclasses.fields(found)}
    del fields['plan']
    for pairs in ('overlaps', 'carried_by'):
        fields[pairs] = [[plan.names[a], plan.names[b]] for a, b in fields[pairs].tolist()]
    return {'sound': found.sound, 'names': list(plan.names), 'ground': plan.ground.tolist(),
            'faults': [row._asdict() for row in rows_of(found)],
            **{name: _plain(value) for name, value in fields.items()}}


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list):
        return [_plain(part) for part in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _side(margin: float) -> str:
    if not np.isfinite(margin):
        return 'on nothing'
    return f'{1e3 * abs(margin):.0f} mm {"inside" if margin > 0.0 else "outside"}'

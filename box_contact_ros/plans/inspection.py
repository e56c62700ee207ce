# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is wrong with a plan, and what each of its boxes carries: the answer of `inspect_plan`."""
from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..solver.checks import printable
from .plan import LACKS, VERDICTS, Plan

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CAUSES = ('hangs', 'unsupported', 'tips under its load', 'slides', 'goes with what falls',
          'overloaded')
"""What may be wrong with a box, the worst first."""
MOST_NAMES = 3
"""Names that a line shows of a fault with more."""


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
        return printable(f'{self.kind:<20}  {names}{"  " if names else ""}{self.text}')


@dataclass(frozen=True, eq=False)
class Inspection:
    """What is wrong with a plan of n boxes, and what each of them carries.

    Of boxes without masses, loads, pressures and loaded margins are NaN. Of those on the ground,
    shares are 1 and margins infinity.
    """

    plan: Plan
    tolerance: float
    """[m]."""
    acceleration: np.ndarray
    """(3,) that the boxes feel, gravity included [m/s²]."""
    overlaps: np.ndarray
    """(o, 2) pairs of boxes that overlap by more than the tolerance, by index."""
    depths: np.ndarray
    """(o,) how deep [m]."""
    stands: np.ndarray
    """(n,) bool."""
    cause: np.ndarray
    """(n,) why a box does not stand, or is overloaded; '' for the others."""
    share: np.ndarray
    """(n,) area by which a box is carried, divided by that of its base."""
    margin: np.ndarray
    """(n,) how far the centre of mass is inside the hull of what carries the box [m]; below 0:
    outside it. That of its body, if the box is a part of one."""
    loaded_margin: np.ndarray
    """(n,) the same of the centre of pressure below the box, with what is on top [m]."""
    load: np.ndarray
    """(n,) on top of each box [N]."""
    pressure: np.ndarray
    """(n,) the greatest on top of each box [Pa]; NaN where corners bear."""
    carried_by: np.ndarray
    """(k, 2) the lower and the upper box of each patch."""
    loads: np.ndarray
    """(k,) on each patch, along its normal [N]."""
    corners: np.ndarray
    """(k, 4, 3) of the rectangle around each patch, in turn [m]."""
    corner_loads: np.ndarray
    """(k, 4) the parts of `loads` at the corners: bilinear, never below 0 [N]."""
    mass: float
    """Of all boxes [kg]."""
    centre_of_mass: np.ndarray
    """(3,) [m]."""

    @property
    def verdict(self) -> str:
        """Return 'not sound' for what is certainly wrong, else 'not all judged', or 'sound'."""
        faults = {fault.verdict for fault in self.plan.faults}
        if len(self.overlaps) or (self.cause != '').any():
            faults.add('not sound')
        return next((verdict for verdict in VERDICTS if verdict in faults), 'sound')

    @property
    def sound(self) -> bool:
        """Whether all was judged, all boxes stand, and none overlaps or is overloaded."""
        return self.verdict == 'sound'

    @property
    def verdicts(self) -> np.ndarray:
        """Return a word (n,) for each box: 'ground', else 'overlap', its cause, or 'sound'."""
        words = np.where(self.cause == '', 'sound', self.cause).astype('U24')
        words[self.overlaps.ravel()] = 'overlap'
        words[self.plan.ground] = 'ground'
        return words

    def __str__(self) -> str:
        """Return a line for each fault, the worst first, and one for the whole plan."""
        return '\n'.join((*map(str, self.rows()), self.summary()))

    def rows(self) -> list[Row]:
        """Return what is wrong with a plan, the worst first; a box is in one row, its worst."""
        plan, names = self.plan, self.plan.names
        told = {verdict: [Row(fault.kind, fault.names, fault.text) for fault in plan.faults
                          if fault.verdict == verdict] for verdict in VERDICTS}
        rows = told['not sound']
        for n in np.argsort(-self.depths, kind='stable').tolist():
            a, b = self.overlaps[n].tolist()
            rows.append(Row('overlap', (names[a], names[b]), f'{1e3 * self.depths[n]:.1f} mm deep'))
        seen = {name for row in rows for name in row.names}
        on_top = self.load / np.linalg.norm(self.acceleration)
        for cause in CAUSES:
            worst = -on_top if cause == 'overloaded' else self.margin
            boxes = np.flatnonzero(self.cause == cause)
            for box in boxes[np.argsort(worst[boxes], kind='stable')].tolist():
                text = (f'{on_top[box]:.0f} kg on top' if cause == 'overloaded' else
                        f'share {self.share[box]:.2f}, centre {_side(self.margin[box])}')
                if cause == 'tips under its load':
                    text += f', under its load {_side(self.loaded_margin[box])}'
                if names[box] not in seen:
                    rows.append(Row(cause, (names[box],), text))
        return rows + told['not all judged'] + told['sound']

    def summary(self) -> str:
        """Return one line on the whole plan."""
        plan = self.plan
        boxes = len(plan) - len(plan.ground)
        words = [f'{boxes:,} box' if boxes == 1 else f'{boxes:,} boxes']
        if plan.masses is not None and np.isfinite(self.mass) and self.mass > 0.0:
            words.append(
                f'{self.mass / 1e3:,.0f} t' if self.mass >= 1e4 else f'{self.mass:,.1f} kg')
            if np.isfinite(self.centre_of_mass).all():
                words.append('centre of mass {:.3f} {:.3f} {:.3f} m'.format(*self.centre_of_mass))
        if len(plan) < 2 or not boxes:
            words.append('nothing can touch')
        verdict, lacks = self.verdict, ', '.join(self._lacks())
        if verdict == 'not all judged':
            verdict += '; what was read is sound'
            lacks = lacks and f', but {lacks}'
        else:
            lacks = lacks and f'; {lacks}'
        return f'{", ".join(words)}: {verdict}{lacks}'

    def _lacks(self) -> Iterator[str]:
        """Yield how many boxes or parts of the file lack what a verdict needs."""
        counts: Counter[str | None] = Counter()
        for fault in self.plan.faults:
            counts[fault.lacks] += max(1, len(fault.names))
        for lack, (one, more) in LACKS.items():
            if lack and counts[lack]:
                yield one if counts[lack] == 1 else more.format(counts[lack])

    def plot(self) -> Figure:
        """Return a figure of the plan, coloured by verdict, with the load on each box in kN.

        It needs Matplotlib, the extra `report`.
        """
        from .plot import plot
        return plot(self.plan, self.verdicts, self.load, self.summary())


def _side(margin: float) -> str:
    if not np.isfinite(margin):
        return 'on nothing'
    return f'{1e3 * abs(margin):.0f} mm {"inside" if margin > 0.0 else "outside"}'

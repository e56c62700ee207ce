# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is wrong with a plan, and what each of its boxes carries: the answer of `inspect_plan`."""
from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..solver.checks import printable
from ..solver.rows import NoTruth
from .plan import LACKS, VERDICTS, Plan
from .plot import picture
from .room import SIDES
from .verdict import CAUSES, GOES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HINTS = 'origin', 'tolerance'
"""Kinds that come first: what the file seems to mean, and the option that says so."""
LEFT_OUT = ('place', 'part', 'shape')
"""What rows lack that come first: others may fall because these are left out."""
OVER = 1e-6  # by how much a load may exceed its limit [1]: rounding
MOST_LINES = 40  # lines that are printed of what is wrong, if not all are asked for
MOST_NAMES = 3  # names that a line shows of a fault with more


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


class Fall(NamedTuple):
    """A box that does not stand from a step of loading on."""

    step: int
    """The number in the plan's order."""
    box: int
    """By index."""
    cause: str
    """One of CAUSES, as it falls first."""
    until: int | None
    """The step from which on it stands; None: it never does."""


@dataclass(frozen=True, eq=False)
class Inspection(NoTruth):
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
    outside: np.ndarray
    """(n, 2, 3) how far each box reaches beyond the least and the greatest corner of its room [m];
    0 up to its tolerance."""
    stands: np.ndarray
    """(n,) bool."""
    cause: np.ndarray
    """(n,) why a box does not stand, or is overloaded; '' for the others."""
    goes_with: np.ndarray
    """(n,) the box with which a box falls, by index; −1: it does not go with another."""
    height: np.ndarray
    """(n,) of a box that hangs, above what is below it [m]; NaN for others, infinity above nothing.
    """
    share: np.ndarray
    """(n,) area by which a box is carried, divided by that of its base; at most 1."""
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
    steps: tuple[Fall, ...] = ()
    """What falls while the plan is loaded, by step; empty without an order."""
    friction: float = np.nan
    """Coulomb's μ of ground, walls and boxes of which the plan has none."""
    loaded_from: str | None = None
    """Where boxes come from; None: their ways are not judged."""
    ways: np.ndarray = field(default_factory=lambda: np.zeros((0, 2), int))
    """(w, 2) a box and another that blocks its way, by index: by steps, and by what it meets first.
    """

    _instead = '.sound or .verdict'

    @property
    def verdict(self) -> str:
        """Return 'not sound' for what is certainly wrong, else 'not all judged', or 'sound'."""
        faults = {fault.verdict for fault in self.plan.faults}
        if self._wrong().any():
            faults.add('not sound')
        return next((verdict for verdict in VERDICTS if verdict in faults), 'sound')

    @property
    def sound(self) -> bool:
        """Whether all was judged, all boxes stand, and none overlaps, is outside or overloaded."""
        return self.verdict == 'sound'

    @property
    def verdicts(self) -> np.ndarray:
        """Return a word (n,) for each box: 'ground', 'overlap', its cause, or 'sound'.

        'outside': beyond its room, and without an overlap. 'step', 'way': it stands in the whole
        plan, but not at each step, or its way is blocked. 'not judged': whether it stands is not
        known.
        """
        words = np.where(self.cause == '', np.where(self.stands, 'sound', 'not judged'),
                         self.cause).astype('U24')
        for word, boxes in (('way', self.ways[:, 0]), ('step', [fall.box for fall in self.steps])):
            boxes = np.array(boxes, int)
            words[boxes[self.cause[boxes] == '']] = word
        words[self.outside.any(axis=(1, 2))] = 'outside'
        words[self.overlaps.ravel()] = 'overlap'
        ground = self.plan.ground
        words[ground] = np.where(self.cause[ground] == '', 'ground', self.cause[ground])
        return words

    def __str__(self) -> str:
        """Return lines on what is wrong, as `text` has them."""
        return self.text()

    def text(self, most: int | None = MOST_LINES) -> str:
        """Return a line for each row, at most so many (None: all), and one for the whole plan.

        Before several rows a line counts them by kind. Each container has a line of its own.
        """
        rows = self.rows()
        lines = [str(row) for row in rows]
        if most is not None and len(rows) > most:
            goes = [n for n, row in enumerate(rows) if row.kind == GOES]
            others = np.setdiff1d(np.arange(len(rows)), goes).tolist()
            shown = sorted((others + goes)[:most])
            more = max(0, len(others) - most)
            rest = len(rows) - most - more
            hidden = [f'{more:,} more'] * (more > 0) + [f'{rest:,} that go with these'] * (rest > 0)
            lines = [lines[n] for n in shown] + [f'and {" and ".join(hidden)}']
        if len(rows) > 1:
            counts = Counter(row.kind for row in rows if row.kind not in (*HINTS, 'ignored'))
            lines.insert(0, ', '.join(f'{kind}: {count:,}' for kind, count in counts.items()))
        return '\n'.join((*lines, *self._of_supports(), *self._of_stacks(), self.summary()))

    def _of_supports(self) -> Iterator[str]:
        """Yield what each fixed box with a limit carries, as axles do."""
        plan = self.plan
        on_top = self.load / np.linalg.norm(self.acceleration)
        for box in plan.ground[np.isfinite(plan.limits[plan.ground])].tolist():
            if np.isfinite(on_top[box]):
                yield printable(f'{plan.names[box]} carries {on_top[box]:,.0f} kg of '
                                f'{plan.limits[box]:,.0f} kg')

    def _of_stacks(self) -> Iterator[str]:
        """Yield the verdict of each container, of several."""
        plan = self.plan
        free = ~np.isin(np.arange(len(plan)), plan.ground)
        for stack, name in enumerate(plan.stacks if len(plan.stacks) > 1 else ()):
            boxes = self._boxes((plan.stack == stack) & free)
            yield printable(f'{name}: {boxes}: {self.verdicts_of_stacks[stack]}')

    @cached_property
    def verdicts_of_stacks(self) -> list[str]:
        """Return the verdict of the boxes of each of the plan's `stacks`."""
        plan = self.plan
        stack_of = dict(zip(plan.names, plan.stack.tolist())) | {
            name: stack for stack, name in enumerate(plan.stacks)}
        found: dict[int, set[str]] = {stack: set() for stack in range(len(plan.stacks))}
        for fault in plan.faults:
            of = {stack_of.get(name, -1) for name in fault.names} or {-1}
            for stack in found if -1 in of else of & found.keys():
                found[stack].add(fault.verdict)
        wrong = self._wrong()
        wrong[plan.ground] = False
        for stack in {*plan.stack[wrong].tolist()} & found.keys():
            found[stack].add('not sound')
        return [next((verdict for verdict in VERDICTS if verdict in some), 'sound')
                for some in found.values()]

    def _wrong(self) -> np.ndarray:
        """Return which boxes (n,) have something that is certainly wrong."""
        wrong = (self.cause != '') | self.outside.any(axis=(1, 2))
        wrong[self.overlaps.ravel()] = True
        wrong[self.ways[:, 0]] = True
        wrong[[fall.box for fall in self.steps]] = True
        return wrong

    @staticmethod
    def _boxes(which: np.ndarray) -> str:
        count = np.count_nonzero(which)
        return f'{count:,} box' if count == 1 else f'{count:,} boxes'

    def rows(self) -> list[Row]:
        """Return what is wrong: first hints and what was left out, then the worst.

        What goes with a box that falls comes after it. A box has a row for each of its faults.
        """
        plan, names = self.plan, self.plan.names
        told: dict[str, list[Row]] = {word: [] for word in ('hints', 'left out', *VERDICTS)}
        for fault in plan.faults:
            word = 'hints' if fault.kind in HINTS else (
                'left out' if fault.lacks in LEFT_OUT else fault.verdict)
            told[word].append(Row(fault.kind, fault.names, fault.text))
        rows = told['hints'] + told['left out'] + told['not sound']
        for n in np.argsort(-self.depths, kind='stable').tolist():
            a, b = self.overlaps[n].tolist()
            rows.append(Row('overlap', (names[a], names[b]), f'{1e3 * self.depths[n]:.1f} mm deep'))
        for n in np.flatnonzero(self.outside.any(axis=(1, 2))).tolist():
            sides = zip(np.ravel(SIDES), self.outside[n].ravel())
            rows.append(Row('outside', (names[n],), ', '.join(
                f'{1e3 * reach:.1f} mm beyond {side}' for side, reach in sides if reach)))
        rows += self._falls()
        rows += (*self._steps(), *self._ways())
        on_top = self.load / np.linalg.norm(self.acceleration)
        over = np.flatnonzero(on_top > (1.0 + OVER) * plan.limits)
        rows += [Row('overloaded', (names[box],), f'{on_top[box]:.0f} kg on top')
                 for box in over[np.argsort(-on_top[over], kind='stable')].tolist()]
        return rows + told['not all judged'] + told['sound']

    def _falls(self) -> Iterator[Row]:
        """Yield rows of the boxes that fall, each before those that go with it."""
        names = self.plan.names
        since = {fall.box: fall.step for fall in self.steps if fall.until is None}
        order = np.argsort(self.margin, kind='stable').tolist()
        goes: dict[int, list[int]] = {}
        for box in order:
            if self.cause[box] == GOES:
                goes.setdefault(int(self.goes_with[box]), []).append(box)
        for cause in CAUSES[:CAUSES.index(GOES)]:
            for box in order:
                if self.cause[box] == cause:
                    yield Row(cause, (names[box],), self._why(box, since))
                    for other in goes.get(box, ()):
                        yield Row(GOES, (names[other],), f'with {names[box]}')
        for other in goes.get(-1, ()):
            yield Row(GOES, (names[other],), 'and with others')

    def _why(self, box: int, since: Mapping[int, int]) -> str:
        end = f', from step {since[box]} on' if box in since else ''
        if self.cause[box] == 'hangs':
            height = self.height[box]
            return (f'{1e3 * height:.1f} mm above what is below' if np.isfinite(height) else
                    'above nothing' if np.isinf(height) else 'by an unknown height') + end
        margin = self.margin[box]
        side = (f'{1e3 * abs(margin):.0f} mm {"inside" if margin > 0.0 else "outside"}'
                if np.isfinite(margin) else 'on nothing')
        return f'share {self.share[box]:.2f}, centre {side}{end}'

    def _steps(self) -> Iterator[Row]:
        """Yield rows of what falls while the plan is loaded, and not in the whole of it."""
        plan = self.plan
        for step, box, cause, until in self.steps:
            end = '' if until is None else f' until {self._who_comes(until, plan.stack[box])}'
            if end or self.cause[box] in ('', 'overloaded'):
                yield Row('step', (plan.names[box],), f'step {step}: {plan.names[box]} '
                          f'{"is " if cause == "unsupported" else ""}{cause}{end}')

    def _ways(self) -> Iterator[Row]:
        """Yield rows of the boxes whose ways are blocked."""
        names, order = self.plan.names, self.plan.order
        for box, pairs in groupby(self.ways.tolist(), key=lambda pair: pair[0]):
            assert order is not None
            first, *others = (names[other] for _, other in pairs)
            yield Row('way', (names[box],), f'step {order[box]}: the way of {names[box]} from '
                      f'{self.loaded_from} is blocked by {first}'
                      f'{f" and {len(others):,} more" if others else ""}')

    def _who_comes(self, step: int, stack: int) -> str:
        plan = self.plan
        come = np.flatnonzero((plan.order == step) & (plan.stack == stack))
        first, *others = np.setdiff1d(come, plan.ground).tolist()
        return plan.names[first] + (f' and {len(others):,} more come' if others else ' comes')

    def summary(self) -> str:
        """Return one line on the whole plan."""
        plan = self.plan
        words = [self._boxes(~np.isin(np.arange(len(plan)), plan.ground))]
        if plan.masses is not None and np.isfinite(self.mass) and self.mass > 0.0:
            words.append(
                f'{self.mass / 1e3:,.0f} t' if self.mass >= 1e4 else f'{self.mass:,.1f} kg')
            if np.isfinite(self.centre_of_mass).all():
                words.append('centre of mass {:.3f} {:.3f} {:.3f} m'.format(*self.centre_of_mass))
            known = plan.friction[~np.isnan(plan.friction)]
            least, most = min((self.friction, *known)), max((self.friction, *known))
            words.append(f'friction {least:g}' + (f' to {most:g}' if most > least else ''))
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

    def plot(self, file: str | Path | None = None) -> Figure:
        """Return a figure of the plan, coloured by verdict; the worst boxes have their names.

        file: where the picture is written to, too. It needs Matplotlib, the extra `report`.
        """
        figure = picture(self.plan, self.verdicts, self.rows(), self.summary())
        if file is not None:
            figure.savefig(file, dpi=120)
        return figure

    def to_json(self, **first: str) -> str:
        """Return all that was found as a line of JSON, as msg_schemas/inspection.json has it.

        NaN and infinity are null. Boxes are named in pairs, and in the order of `names` elsewhere.
        first: what comes before it.
        """
        plan = self.plan
        values = {one.name: getattr(self, one.name) for one in fields(self) if one.name != 'plan'}
        for pairs in ('overlaps', 'carried_by', 'ways'):
            values[pairs] = [[plan.names[a], plan.names[b]] for a, b in values[pairs].tolist()]
        values['steps'] = [{'step': step, 'name': plan.names[box], 'cause': cause, 'until': until}
                           for step, box, cause, until in self.steps]
        return json.dumps({
            **first, 'verdict': self.verdict, 'sound': self.sound, 'names': list(plan.names),
            'ground': plan.ground.tolist(), 'faults': [row._asdict() for row in self.rows()],
            'containers': [{'name': name, 'verdict': verdict}
                           for name, verdict in zip(plan.stacks, self.verdicts_of_stacks)],
            **{name: _plain(value) for name, value in values.items()}})


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, list):
        return [_plain(part) for part in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value

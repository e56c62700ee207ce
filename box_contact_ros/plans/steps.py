# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Does a plan stand at each step of its loading? Each prefix of its order is judged.

A step keeps the loads that were found, and carries down the weight of what comes. Its group alone
is solved where that fails, or where something that falls is touched. All else stays as it is: what
is missing is then still the least that the first programme of statics.py asks for.
"""
from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import groupby

import numpy as np

from .inspection import Fall
from .kept_loads import VISIT, KeptLoads
from .meetings import Meetings, beds_of
from .plan import Plan
from .statics import Bodies, Work, settle
from .verdict import verdict_of

ROW = 500.0  # work of a patch among which a group is looked for, in the unit of `Work`


def falls_of(plan: Plan, meet: Meetings, bodies: Bodies, work: Work,
             ) -> tuple[tuple[Fall, ...], list[int]]:
    """Return what falls at which step, and the boxes of which this is not always known.

    meet: all patches that may bear. Where the work is done, later steps are not judged.
    """
    if plan.order is None or not meet.fixed.any():
        return (), []
    loading = _Loading(plan, meet, bodies, work)
    first = np.unique(plan.body, return_index=True)[1]
    stack, order = plan.stack[first], plan.order[first]
    free = np.flatnonzero(~meet.fixed)
    come = free[np.lexsort((order[free], stack[free]))].tolist()
    for (label, step), new in groupby(come, key=lambda body: (stack[body], order[body])):
        if work.left <= 0.0:
            loading.is_unknown |= ~meet.fixed & (stack >= label)
            break
        loading.come([*new], int(step))
    falls = [Fall(step, box, cause, until) for body, step, cause, until in loading.falls()
             for box in np.flatnonzero(plan.body == body).tolist()]
    return (tuple(sorted(falls, key=lambda fall: fall[:2])),
            np.flatnonzero(loading.is_unknown[plan.body]).tolist())


class _Loading:
    """The bodies that have come, and which of them stand."""

    def __init__(self, plan: Plan, meet: Meetings, bodies: Bodies, work: Work) -> None:
        self._plan, self._meet, self._bodies, self._work = plan, meet, bodies, work
        self._here, self._stands = meet.fixed.tolist(), meet.fixed.tolist()
        self._fixed = meet.fixed.tolist()
        count = len(self._here)
        self.is_unknown = np.zeros(count, bool)
        self._since: dict[int, tuple[int, str]] = {}
        self._over: list[tuple[int, int, str, int | None]] = []
        self._ends = plan.body[meet.pairs].tolist()
        self._below: list[list[int]] = [[] for _ in range(count)]
        self._above: list[list[int]] = [[] for _ in range(count)]
        self._beside: list[list[int]] = [[] for _ in range(count)]
        stack = plan.stack[meet.pairs]
        together = meet.fixed[plan.body[meet.pairs]].any(axis=1) | (stack[:, 0] == stack[:, 1])
        for row in np.flatnonzero(together).tolist():
            lower, upper = self._ends[row]
            if meet.carries[row]:
                self._below[upper].append(row)
                self._above[lower].append(row)
            else:
                self._beside[lower].append(row)
                self._beside[upper].append(row)
        self._loads = KeptLoads(meet, plan.body[meet.pairs], self._below, bodies,
                                work, weighed=plan.masses is not None)

    def come(self, new: list[int], step: int) -> None:
        """Take the bodies that come at a step."""
        for body in new:
            self._here[body] = True
        if self._meet_what_stands({*new}) and self._loads.hold(new, self._here, self._stands):
            for body in new:
                self._stands[body] = True
        else:
            self._solve(self._group(new), step)

    def falls(self) -> Iterator[tuple[int, int, str, int | None]]:
        """Yield body, step, cause, and the step at which it stands again, of what falls."""
        yield from self._over
        for body, (step, cause) in self._since.items():
            yield body, step, cause, None

    def _meet_what_stands(self, new: set[int]) -> bool:
        """Return whether new bodies carry no other, and touch none that falls."""
        for body in new:
            for row in self._above[body]:
                upper = self._ends[row][1]
                if self._here[upper] and upper not in new:
                    return False
            for row in self._below[body] + self._beside[body]:
                for other in self._ends[row]:
                    if self._here[other] and not self._stands[other] and other not in new:
                        return False
        return True

    def _group(self, new: list[int]) -> list[int]:
        """Return the bodies that have come, and that patches join with new ones."""
        group, todo = {*new}, [*new]
        while todo:
            body = todo.pop()
            for row in self._below[body] + self._above[body] + self._beside[body]:
                for other in self._ends[row]:
                    if self._here[other] and not self._fixed[other] and other not in group:
                        group.add(other)
                        todo.append(other)
        self._work.left -= VISIT * len(group)
        return sorted(group)

    def _solve(self, group: list[int], step: int) -> None:
        """Judge a group anew, and keep its loads."""
        plan, members = self._plan, np.array(group)
        if self.is_unknown[members].any():  # a group that takes too much only grows
            self.is_unknown[members] = True
            return
        self._work.left -= ROW * len(self._ends)
        is_member = np.zeros(len(self._here), bool)
        is_member[members] = True
        part = self._meet.among(plan.body, self._meet.fixed | is_member)
        bodies = replace(self._bodies, fixed=~is_member, need=part.need(plan.body))
        rest = None
        if plan.masses is not None:
            rest = settle(bodies, beds_of(plan, part), self._work)
        verdict = verdict_of(plan, part, bodies, rest)
        if rest is not None:
            rows = part.carries
            self._loads.take(members, part.row[rows], rest.load[rows] * (
                part.normal[rows] @ part.frame[2]), rest.centre[rows])
        self.is_unknown |= verdict.unknown & is_member
        for body in group:
            self._stands[body] = bool(verdict.stands[body])
            if verdict.unknown[body]:
                continue
            if not self._stands[body]:
                self._since.setdefault(body, (step, str(verdict.cause[body])))
            elif body in self._since:
                self._over.append((body, *self._since.pop(body), step))

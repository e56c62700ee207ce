# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random plans: what falls by `inspect_plan`, and by independent linear programmes.

`python -m benchmarks.fuzz --plans 1000` draws plans of KINDS in turn. All boxes of a group stand,
or no loads exist for it, with friction or without (upright_statics.py). It is wrong that all stand
if patches as they are have no loads. It is wrong that one falls if patches that are pulled in by
what a box needs, and by RIM more, have some; it is told where by ROBUST more they still have.

Lengths in m, masses in kg.
"""
from __future__ import annotations

import csv
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from dataclasses import replace
from functools import cache, partial
from itertools import compress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from box_contact_ros import Plan, inspect_plan, read_plan
from box_contact_ros.extras import require
from box_contact_ros.plans.baplie import read_baplie

from .upright_statics import INSCRIBED, Upright

ROOT = Path(__file__).parents[1]
ORDERS = ROOT / 'docs/examples/pallets/packing_plans.json'
SHIP = ROOT / 'test/plans/stowage_plan.csv'
BOXES = (3, 24)
SIZES, LAYER, SPREAD = (100, 900), 200, (240, 900)  # [mm]
HEIGHTS = (100, 200, 300)  # of goods [mm]
MASSES, LOADED = (1.0, 40.0), (2e3, 30e3)
LEFT = 0.95  # of the boxes of real plans
FRICTION, FRICTIONS, MOST_FELT = 0.5, (0.1, 0.9), 0.3
NEED = 1e-4
"""The tolerance of `inspect_plan`: its boxes stand by more."""
RIM, ROBUST = 1e-4, 5e-3
"""How much more patches are pulled in, where a fall is wrong, and where it is plainly so."""


class Found(NamedTuple):
    """How plans were judged."""

    groups: int = 0
    falling: int = 0
    """Groups in which a box falls."""
    on_rim: int = 0
    """Groups that the programme judges otherwise, on a rim."""
    faults: tuple[str, ...] = ()
    """The others that it judges otherwise."""


def draw(seed: int, number: int) -> Plan:
    """Draw the plan of a number, on a floor or on slabs."""
    kind = list(KINDS)[number % len(KINDS)]
    return KINDS[kind](np.random.default_rng([seed, number]))


def _piled(heights: Callable[[np.random.Generator, int], np.ndarray], rng: np.random.Generator,
           ) -> Plan:
    """Return boxes in whole millimetres that are let down on each other, and a floor, box 0."""
    count, spread = rng.integers(*BOXES, endpoint=True), rng.integers(*SPREAD)
    size = rng.integers(*SIZES, (count, 3))
    size[:, 2] = heights(rng, count)
    corner = rng.integers(-spread, spread, (count, 3)) - size // 2
    for n in range(count):
        meets = ((corner[:n] < corner[n] + size[n]) & (corner[n] < (corner + size)[:n]))[:, :2]
        corner[n, 2] = (corner + size)[:n, 2][meets.all(axis=1)].max(initial=0)
    place = np.vstack(((0, 0, -0.5), (corner + size / 2) / 1e3))
    return Plan(np.vstack(((6, 6, 1), size / 1e3)),
                np.hstack((place, np.tile([0.0, 0, 0, 1], (count + 1, 1)))),
                [0, *rng.uniform(*MASSES, count)], ground=0)


def _order(rng: np.random.Generator) -> Plan:
    """Return most boxes of a real pallet, with other masses."""
    plan = read_plan(ORDERS)
    order = np.array([name.split('/')[0] for name in plan.names])
    return _most(plan, order == rng.choice(np.unique(np.delete(order, plan.ground))), MASSES, rng)


def _bay(rng: np.random.Generator) -> Plan:
    """Return most containers of some bays of a real ship, with masses."""
    plan = _ship()
    bay = np.array([(int(name[:3]) + 1) // 4 if name[:3].isdigit() else -1 for name in plan.names])
    return _most(plan, bay == rng.choice(np.unique(bay[bay >= 0])), LOADED, rng)


@cache
def _ship() -> Plan:
    with SHIP.open() as file:
        boxes = [f"LOC+147+{int(row['bay']):03}{int(row['row']):02}{int(row['tier']):02}::5'"
                 f"EQD+CN++{row['iso_type'].replace('5EGB', '4EGB')}'"
                 for row in csv.DictReader(file)]
    return read_baplie(f"UNH+1+BAPLIE:D:95B:UN:SMDG22'{''.join(boxes)}")


def _most(plan: Plan, chosen: np.ndarray, masses: tuple[float, float], rng: np.random.Generator,
          ) -> Plan:
    """Return most of the chosen boxes, with what is fixed."""
    kept = chosen & (rng.random(len(plan)) < LEFT)
    kept[plan.ground] = True
    is_fixed = np.isin(np.flatnonzero(kept), plan.ground)
    return Plan(plan.sizes[kept], plan.poses[kept], rng.uniform(*masses, kept.sum()),
                ground=np.flatnonzero(is_fixed))


KINDS: dict[str, Callable[[np.random.Generator], Plan]] = {
    'heaps': partial(_piled, lambda rng, count: rng.integers(*SIZES, count)),
    'layers': partial(_piled, lambda rng, count: np.full(count, LAYER)),
    'goods': partial(_piled, lambda rng, count: rng.choice(HEIGHTS, count)),
    'orders': _order, 'bays': _bay}
"""Boxes of any height, of one, and of few, as real goods have; then a real pallet and ship."""


def compare(plan: Plan, felt: tuple[float, float] = (0.0, 0.0)) -> Found:
    """Judge a plan of upright boxes by both; felt: beside gravity, along x and y [of gravity]."""
    stands = inspect_plan(plan, friction=FRICTION, acceleration=9.81 * np.array(
        [*felt, -1.0])).stands
    fixed = np.isin(np.arange(len(plan)), plan.ground)
    as_it_is, beyond, robust = (
        Upright(plan.sizes, plan.poses, plan.masses, fixed, plan.frictions(FRICTION), felt,
                sooner=by) for by in (0.0, NEED + RIM, NEED + ROBUST))
    groups = as_it_is.groups()
    stand = [boxes for boxes in groups if stands[boxes].all()]
    fall = [boxes for boxes in groups if not stands[boxes].all()]
    faults = [f'boxes {boxes} stand, and have no loads'
              for boxes in compress(stand, ~as_it_is.holds(stand, 1.0))]
    held = beyond.holds(fall, INSCRIBED)
    for boxes in compress(fall, held):
        much = robust.holds([boxes], INSCRIBED).all()
        faults.append(f'boxes {boxes}: {stands[boxes].sum()} of them stand, and there are loads'
                      f'{", robustly" if much else ""}')
    on_rim = np.count_nonzero(as_it_is.holds(fall) & ~held)
    return Found(len(groups), len(fall), on_rim, tuple(faults))


def examine(seed: int, number: int) -> Found:
    """Draw and judge the plan of a number; each third has a friction of each box, and brakes."""
    plan = draw(seed, number)
    if number % 3:
        return compare(plan)
    rng = np.random.default_rng([seed, number, 3])
    felt = rng.uniform(-MOST_FELT, MOST_FELT, 2)
    return compare(replace(plan, friction=rng.uniform(*FRICTIONS, len(plan))),
                   (float(felt[0]), float(felt[1])))


def fuzz(total: int, *, seed: int = 1, workers: int = 1) -> int:
    """Judge so many plans, print what is wrong, and return how many groups are."""
    require('plans')
    from tqdm import tqdm

    with ProcessPoolExecutor(workers) if workers > 1 else nullcontext() as pool:
        run = partial(examine, seed)
        found = list(tqdm((pool.map(run, range(total), chunksize=10) if pool else
                           map(run, range(total))), total=total, desc='plans', unit='plan',
                          mininterval=1.0))
    for number, each in enumerate(found):
        for fault in each.faults:
            print(f'benchmarks.random_plans.examine({seed}, {number})  # {fault}')
    groups, falling, on_rim = (sum(each[n] for each in found) for n in range(3))
    faults = sum(len(each.faults) for each in found)
    print(f'{total:,} plans, {groups:,} groups, of which {falling:,} fall: {on_rim} on a rim, '
          f'{faults} judged otherwise, seed {seed}')
    return faults

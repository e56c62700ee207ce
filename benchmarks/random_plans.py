# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random plans: what falls by `inspect_plan`, and by an independent linear programme.

`python -m benchmarks.fuzz --plans 1000` draws piles of boxes of any size, and layers in which each
box has many carriers. All boxes of a group stand, or the programme finds no loads for it
(upright_statics.py). The two may differ on a rim alone: where patches that end RIM sooner change
what the programme finds for patches that end RIM later.

Lengths in m, masses in kg.
"""
from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from functools import partial
from typing import NamedTuple

import numpy as np

from box_contact_ros import Plan, inspect_plan
from box_contact_ros.extras import require

from .upright_statics import Upright

BOXES = (3, 24)
SIZES, LAYER, SPREAD = (100, 900), 200, (240, 900)  # [mm]
MASSES = (1.0, 40.0)
RIM = 1e-4
"""The tolerance of `inspect_plan`: its boxes stand by more."""


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
    """Draw the plan of a number: in whole millimetres, on a floor, which is box 0."""
    rng = np.random.default_rng([seed, number])
    count, spread = rng.integers(*BOXES, endpoint=True), rng.integers(*SPREAD)
    size = rng.integers(*SIZES, (count, 3))
    if number % 2:
        size[:, 2] = LAYER
    corner = rng.integers(-spread, spread, (count, 3)) - size // 2
    for n in range(count):  # let it down
        meets = ((corner[:n] < corner[n] + size[n]) & (corner[n] < (corner + size)[:n]))[:, :2]
        corner[n, 2] = (corner + size)[:n, 2][meets.all(axis=1)].max(initial=0)
    place = np.vstack(((0, 0, -0.5), (corner + size / 2) / 1e3))
    return Plan(np.vstack(((6, 6, 1), size / 1e3)),
                np.hstack((place, np.tile([0.0, 0, 0, 1], (count + 1, 1)))),
                [0, *rng.uniform(*MASSES, count)], ground=0)


def compare(plan: Plan) -> Found:
    """Judge a plan of upright boxes by both."""
    stands = inspect_plan(plan).stands
    programme, sooner, later = (Upright(
        plan.sizes, plan.poses, plan.masses, np.isin(np.arange(len(plan)), plan.ground), sooner=by)
        for by in (0.0, RIM, -RIM))
    groups = programme.groups()
    odd = [boxes for boxes in groups if stands[boxes].all() != programme.holds(boxes)]
    faults = [boxes for boxes in odd if sooner.holds(boxes) == later.holds(boxes)]
    return Found(len(groups), sum(not stands[boxes].all() for boxes in groups),
                 len(odd) - len(faults), tuple(
                     f'boxes {boxes}: {stands[boxes].sum()} of them stand, and what loads lack is '
                     f'{programme.missing(boxes):.2g} of the weight' for boxes in faults))


def examine(seed: int, number: int) -> Found:
    """Draw and judge the plan of a number."""
    return compare(draw(seed, number))


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
    print(f'{total:,} plans, {groups:,} groups, of which {falling:,} fall: {on_rim} judged '
          f'otherwise on a rim, {faults} elsewhere, seed {seed}')
    return faults

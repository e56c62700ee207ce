# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random orders of random plans: what falls by the steps of `inspect_plan`, and by a slow loop.

`python -m benchmarks.fuzz --orders 500` draws plans as `--plans` does, and orders of ORDERS. The
loop inspects each prefix of an order as a plan of its own.
"""
from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from box_contact_ros import Plan, inspect_plan
from box_contact_ros.extras import require

from . import random_plans

SWAPS = 3
TOGETHER = 3  # boxes that come at a step, on average
STACKED = 0.2  # of the plans have two stacks
SLOPE = 0.05  # by which boxes may come before those below them [m]


class Found(NamedTuple):
    """How the steps of plans were judged."""

    steps: int = 0
    falling: int = 0
    """Steps at which a box falls."""
    faults: tuple[str, ...] = ()
    """Steps that the loop judges otherwise."""


def _from_below(plan: Plan, rng: np.random.Generator) -> np.ndarray:
    low = plan.poses[:, 2] - plan.sizes[:, 2] / 2.0
    return np.argsort(np.argsort(low + rng.uniform(0.0, SLOPE, len(plan))))


def _swapped(plan: Plan, rng: np.random.Generator) -> np.ndarray:
    order = _from_below(plan, rng)
    for pair in rng.integers(len(plan), size=(SWAPS, 2)):
        order[pair] = order[pair[::-1]]
    return order


ORDERS: dict[str, Callable[[Plan, np.random.Generator], np.ndarray]] = {
    'any': lambda plan, rng: rng.permutation(len(plan)),
    'from below': _from_below, 'swapped': _swapped,
    'together': lambda plan, rng: rng.integers(len(plan) // TOGETHER + 1, size=len(plan))}
OPTIONS: tuple[dict[str, Any], ...] = (
    {}, {}, {'sides': True}, {'bears': 'corners'}, {'acceleration': (2.0, 0.5, -9.81)},
    {'masses': None})
"""Of `inspect_plan`, and plans without masses."""


def draw(seed: int, number: int) -> tuple[Plan, dict[str, Any]]:
    """Draw the plan of a number, with an order and its options."""
    rng = np.random.default_rng([seed, number, 1])
    plan = random_plans.draw(seed, number)
    order = list(ORDERS.values())[number % len(ORDERS)](plan, rng)
    stack = rng.integers(2, size=len(plan)) if rng.random() < STACKED else None
    options = {**OPTIONS[number // len(random_plans.KINDS) % len(OPTIONS)]}
    masses = options.pop('masses', plan.masses)
    return replace(plan, order=order, stack=stack, masses=masses), options


def falling(plan: Plan, options: dict[str, Any]) -> dict[tuple[int, int], frozenset[int]]:
    """Return which boxes fall at each step of each stack, by a plan of each prefix."""
    assert plan.order is not None
    fixed = np.isin(np.arange(len(plan)), plan.ground)
    found = {}
    for stack, step in sorted({*zip(plan.stack[~fixed].tolist(), plan.order[~fixed].tolist())}):
        here = np.flatnonzero(fixed | (plan.stack == stack) & (plan.order <= step))
        part = Plan(plan.sizes[here], plan.poses[here],
                    None if plan.masses is None else plan.masses[here],
                    ground=np.flatnonzero(fixed[here]))
        found[stack, step] = frozenset(here[~inspect_plan(part, **options).stands].tolist())
    return found


def compare(plan: Plan, options: dict[str, Any]) -> Found:
    """Judge each step of a plan by both."""
    wanted, steps = falling(plan, options), inspect_plan(plan, **options).steps
    faults = []
    for (stack, step), boxes in wanted.items():
        got = frozenset(fall.box for fall in steps if plan.stack[fall.box] == stack
                        and fall.step <= step and (fall.until is None or step < fall.until))
        if got != boxes:
            faults.append(f'stack {stack}, step {step}: {sorted(got)} fall, and by the loop '
                          f'{sorted(boxes)}')
    return Found(len(wanted), sum(map(bool, wanted.values())), tuple(faults))


def examine(seed: int, number: int) -> Found:
    """Draw and judge the plan of a number."""
    return compare(*draw(seed, number))


def fuzz(total: int, *, seed: int = 1, workers: int = 1) -> int:
    """Judge so many plans, print what is wrong, and return how many steps are."""
    require('plans')
    from tqdm import tqdm

    with ProcessPoolExecutor(workers) if workers > 1 else nullcontext() as pool:
        run = partial(examine, seed)
        found = list(tqdm((pool.map(run, range(total)) if pool else map(run, range(total))),
                          total=total, desc='orders', unit='plan', mininterval=1.0))
    for number, each in enumerate(found):
        for fault in each.faults:
            print(f'benchmarks.random_orders.examine({seed}, {number})  # {fault}')
    steps, falls = (sum(each[n] for each in found) for n in range(2))
    faults = sum(len(each.faults) for each in found)
    print(f'{total:,} orders, {steps:,} steps, of which {falls:,} have a box that falls: {faults} '
          f'judged otherwise, seed {seed}')
    return faults

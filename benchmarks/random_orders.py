# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Random orders of random plans: steps and ways by `inspect_plan`, and by slow loops.

`python -m benchmarks.fuzz --orders 500` draws plans as `--plans` does, and orders of ORDERS. One
loop inspects each prefix of an order as a plan of its own. The other asks of each two boxes whether
one meets the other on its way, in plans whose boxes are turned at random, too.
"""
from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from box_contact_ros import ContactSolver, Plan, Sweep, inspect_plan
from box_contact_ros.core import DEPTH_FLOOR
from box_contact_ros.extras import require
from box_contact_ros.plans.ways import SIDES
from box_contact_ros.solver.pose import rotation_matrix

from . import random_plans
from .pose_sets import unit_quaternions

SWAPS = 3
TOGETHER = 3  # boxes that come at a step, on average
STACKED = 0.2  # of the plans have two stacks
TURNED = 0.3  # of the boxes of plans with turned ones
CLOSE = 1e-5  # to touching, where both may be right [m]
SLOPE = 0.05  # by which boxes may come before those below them [m]


class Found(NamedTuple):
    """How the steps of plans were judged."""

    steps: int = 0
    falling: int = 0
    """Steps at which a box falls."""
    blocked: int = 0
    """Pairs of a box and another that blocks its way."""
    faults: tuple[str, ...] = ()
    """Steps and ways that the loops judge otherwise."""


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
    """Judge each step of a plan by both, but for boxes that take too much."""
    wanted, inspected = falling(plan, options), inspect_plan(plan, **options)
    steps, faults = inspected.steps, []
    left_out = {name for fault in inspected.plan.faults if fault.kind == 'support'
                for name in fault.names}  # steps that take too much are not judged
    unknown = frozenset(n for n, name in enumerate(plan.names) if name in left_out)
    for (stack, step), boxes in wanted.items():
        got = frozenset(fall.box for fall in steps if plan.stack[fall.box] == stack
                        and fall.step <= step and (fall.until is None or step < fall.until))
        if got - unknown != boxes - unknown:
            faults.append(f'stack {stack}, step {step}: {sorted(got)} fall, and by the loop '
                          f'{sorted(boxes)}')
    return Found(len(wanted), sum(map(bool, wanted.values())), 0, tuple(faults))


def turned(plan: Plan, rng: np.random.Generator) -> Plan:
    """Return a plan with boxes that are turned at random, half of them about z alone."""
    poses, rows = plan.poses.copy(), np.flatnonzero(rng.random(len(plan)) < TURNED)
    rows = np.setdiff1d(rows, plan.ground)
    poses[rows, 3:] = unit_quaternions(rng, len(rows))
    upright = rows[rng.random(len(rows)) < 0.5]
    poses[upright, 3:5] = 0.0
    return replace(plan, poses=poses)


def met(plan: Plan, side: str, by: float) -> set[tuple[int, int]]:
    """Return which boxes meet which on their ways, smaller by so much more, of each two [m]."""
    found, fixed = inspect_plan(plan), np.isin(np.arange(len(plan)), plan.ground)
    assert plan.order is not None
    solver, overlaps = ContactSolver(), {*map(tuple, found.overlaps.tolist())}
    towards = np.array(SIDES[side])
    box, other = np.nonzero(~fixed[:, None] & (fixed | (plan.stack[:, None] == plan.stack) & (
        plan.order < plan.order[:, None])))
    deepest = DEPTH_FLOOR * plan.sizes.max(axis=1)
    every = np.argwhere(~np.eye(len(plan), dtype=bool) & ~(fixed[:, None] & fixed))
    depth = -solver.batch(plan.poses, sizes=plan.sizes, pairs=every).separation
    np.maximum.at(deepest, every[:, 0], np.minimum(depth, random_plans.NEED))
    sizes = plan.sizes - 2.0 * (random_plans.NEED + deepest + by)[:, None]
    starts = plan.poses.copy()
    for n in np.flatnonzero(~fixed):  # just outside of its stack
        most = max(_reach(plan.poses[k], plan.sizes[k], towards) for k in np.flatnonzero(
            ~fixed & (plan.stack == plan.stack[n])))
        starts[n, :3] += (most + _reach(plan.poses[n], sizes[n], -towards)) * towards
    when = solver.time_of_impact_batch(
        Sweep(starts[box], plan.poses[box]), Sweep(plan.poses[other], plan.poses[other]),
        size_a=sizes[box], size_b=plan.sizes[other], tolerance=1e-7).time
    return {pair for pair, time in zip(zip(box.tolist(), other.tolist()), when.tolist())
            if time == time and tuple(sorted(pair)) not in overlaps}


def _reach(pose: np.ndarray, size: np.ndarray, towards: np.ndarray) -> float:
    """Return how far the corners of a box reach along a direction [m]."""
    corners = np.array([*product((-0.5, 0.5), repeat=3)]) * size
    return float((((corners @ rotation_matrix(pose[3:]).T) + pose[:3]) @ towards).max())


def compare_ways(plan: Plan, side: str) -> Found:
    """Judge the way of each box by both; what is close to touching may be either."""
    ways = {*map(tuple, inspect_plan(plan, loaded_from=side).ways.tolist())}
    least, most = (met(plan, side, by) for by in (CLOSE, -CLOSE))
    faults = [f'from {side}: {box} is blocked by {other}: {(box, other) in ways}, and by the loop '
              f'{(box, other) in most}' for box, other in sorted((least - ways) | (ways - most))]
    return Found(0, 0, len(ways), tuple(faults))


def examine_ways(seed: int, number: int) -> Found:
    """Draw the plan of a number, every second one with turned boxes, and judge its ways."""
    plan, _ = draw(seed, number)
    if number % 2:
        plan = turned(plan, np.random.default_rng([seed, number, 2]))
    kinds = len(random_plans.KINDS)
    return compare_ways(replace(plan, masses=None),
                        list(SIDES)[(number + number // kinds) % len(SIDES)])


def examine(seed: int, number: int) -> Found:
    """Draw the plan of a number, and judge its steps and its ways."""
    steps, ways = compare(*draw(seed, number)), examine_ways(seed, number)
    return Found(steps.steps, steps.falling, ways.blocked, steps.faults + ways.faults)


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
    steps, falls, ways = (sum(each[n] for each in found) for n in range(3))
    faults = sum(len(each.faults) for each in found)
    print(f'{total:,} orders, {steps:,} steps, of which {falls:,} have a box that falls, {ways:,} '
          f'boxes on the way of another: {faults} judged otherwise, seed {seed}')
    return faults

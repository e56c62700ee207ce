# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The worst that a search finds of model `mlp`: its errors, its steps, and what swapping changes.

`accuracy --search MINUTES` asks this. From the worst of fresh draws of each set, pairs climb to the
largest error of point, volume or covariance. Sizes climb too where the set draws sizes. The
same is done with two networks without units, that always choose the one bracket or the other.
"""
from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from box_contact_ros.core import native
from box_contact_ros.solver.contact import Contacts
from box_contact_ros.solver.contact_solver import ContactSolver
from box_contact_ros.solver.mlp import NETWORK, core_numbers, load_mlp
from training.worst_case import RESTART, climb, worst_start

from . import output
from .errors import contact_errors
from .pose_sets import LOADS, SETS, Pairs
from .steps import drawn_paths, largest_steps

DRAWN, CLIMBING = 20_000, 500
"""Pairs that are drawn, and pairs that climb from the worst of them."""
PATHS, TURN = 60, 0.05
"""Paths on which steps are searched, and how far each turns [rad]."""
QUANTITIES = ('point', 'volume', 'covariance')
LIMITS = {'point': 1.0, 'volume': 5.0, 'covariance': 15.0}
"""Largest error that a search may find [%]; by garbage for weights three times that."""
STEP_LIMITS = {'point': 0.1, 'volume': 1.0}
FREE = ('random sizes',)  # sets whose sizes climb too
UNIT = (1.0, 1.0, 1.0)


def networks() -> dict[str, np.ndarray]:
    """Return the shipped network as the core reads it, and those that choose one bracket."""
    return {'shipped': core_numbers(load_mlp().networks[NETWORK]),
            'all within': np.array([4.0], np.float32), 'least within': np.array([-4.0], np.float32)}


@dataclass(frozen=True, kw_only=True)
class Searched:
    """What a search with one seed has found on one set, in %."""

    set: str
    seed: int
    worst: Mapping[str, Mapping[str, float]]  # by network, then by quantity
    steps: Mapping[str, float]  # by quantity
    swapped: int  # pairs of which swapping the boxes changes a bit

    def broken(self) -> list[str]:
        """Return the limits that do not hold, in words."""
        found = [(f'{quantity}, {network}', value, times * LIMITS[quantity])
                 for (network, by), times in zip(self.worst.items(), (1, 3, 3), strict=True)
                 for quantity, value in by.items()]
        found += [(f'step of the {quantity}', self.steps[quantity], most)
                  for quantity, most in STEP_LIMITS.items()]
        found += [('pairs that swapping changes', self.swapped, 0)]
        return [f'mlp, {self.set}, seed {self.seed}: {what} {value:.3g} > {most:g}'
                for what, value, most in found if not value <= most]


def worst_of(numbers: np.ndarray, quantity: str, pairs: Pairs, rng: np.random.Generator,
             seconds: float, free_sizes: bool) -> float:
    """Return the largest error that climbing for that long finds [%]."""
    solver = native.PairSolver('mlp', UNIT, UNIT, numbers)

    def score(asked: Pairs) -> np.ndarray:
        found, truth = Contacts(*solver.solve(*asked, 1)[0]), asked.contacts()
        with np.errstate(invalid='ignore', divide='ignore'):  # pairs apart, and slivers
            errors = getattr(contact_errors(found, truth, asked.edge), quantity)
        return np.where(truth.colliding & found.colliding, np.nan_to_num(errors, nan=-1.0), -1.0)

    end = time.monotonic() + seconds
    pairs = worst_start(pairs, score, CLIMBING)
    most = float(score(pairs).max())
    while time.monotonic() < end:
        pairs, scores = climb(rng, pairs, score, generations=RESTART, free_sizes=free_sizes)
        most = float(scores[0])
    return most


def swapped(pairs: Pairs) -> int:
    """Return of how many pairs swapping A and B changes point, volume or covariance."""
    solver = ContactSolver(UNIT, UNIT)
    one = pairs.contacts(solver)
    other = Pairs(pairs.pose_b, pairs.pose_a, pairs.size_b, pairs.size_a).contacts(solver)
    same = [(getattr(one, name) == getattr(other, name)).reshape(len(one.volume), -1).all(axis=1)
            for name in QUANTITIES]
    return int((one.colliding & ~np.logical_and.reduce(same)).sum())


def search(minutes: float, seeds: Sequence[int]) -> list[Searched]:
    """Search every set for that long in all, with each seed."""
    from tqdm import tqdm

    every = SETS | LOADS
    asked = networks()
    seconds = 60.0 * minutes / (len(every) * len(asked) * len(QUANTITIES))
    found = []
    with tqdm(total=len(seeds) * len(every) * len(asked), desc='search', unit='climb') as bar:
        for seed in seeds:
            for number, (name, make) in enumerate(every.items()):
                rng = np.random.default_rng([seed, number])
                pairs = make(rng, DRAWN)
                worst = {}
                for network, numbers in asked.items():
                    bar.set_postfix_str(f'{name}, {network}')
                    worst[network] = {quantity: worst_of(numbers, quantity, pairs, rng, seconds,
                                                         name in FREE) for quantity in QUANTITIES}
                    bar.update()
                touching = pairs.rows(pairs.contacts().colliding)
                paths = drawn_paths(rng, touching.rows(slice(PATHS)), TURN, flat=name not in SETS)
                steps = largest_steps(ContactSolver(UNIT, UNIT), paths)
                found.append(Searched(
                    set=name, seed=seed, worst=worst, swapped=swapped(pairs),
                    steps={quantity: float(values.max())
                           for quantity, values in zip(QUANTITIES, steps)}))
    return found


def table(rows: Sequence[Searched]) -> str:
    """Return a line for each set: the worst of all seeds."""
    lines = []
    for name in dict.fromkeys(row.set for row in rows):
        of_set = [row for row in rows if row.set == name]
        cells = [' / '.join(f'{max(row.worst[network][quantity] for row in of_set):.2g}'
                            for quantity in QUANTITIES) for network in of_set[0].worst]
        steps = ' / '.join(f'{max(row.steps[quantity] for row in of_set):.2g}'
                           for quantity in QUANTITIES)
        lines.append([name, *cells, steps, str(sum(row.swapped for row in of_set))])
    return output.markdown_table(
        ['set', 'shipped', *(f'garbage, {name}' for name in list(rows[0].worst)[1:]), 'steps',
         'changed by swapping'], lines)


def csv_rows(rows: Sequence[Searched]) -> list[dict[str, object]]:
    """Return a row per set, seed, network and quantity."""
    return [{'set': row.set, 'seed': row.seed, 'network': network, 'quantity': quantity,
             'worst': value, 'step': row.steps[quantity] if network == 'shipped' else '',
             'swapped': row.swapped if network == 'shipped' else ''}
            for row in rows for network, by in row.worst.items()
            for quantity, value in by.items()]

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Program `searched`: the worst that a search finds of model `mlp`.

`python -m benchmarks.searched` writes searched.md and searched.csv. From the worst of fresh draws
of each set, pairs climb to the largest error of point, volume or covariance. Sizes climb too where
the set draws sizes. The same is done with two networks without units, that always choose the one
bracket or the other. The exit status is 1 if a limit is broken.
"""
from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from box_contact_ros.core import native
from box_contact_ros.solver.arguments import within
from box_contact_ros.solver.contact import Contacts
from box_contact_ros.solver.contact_solver import ContactSolver
from box_contact_ros.solver.mlp import NETWORK, core_numbers, load_mlp

from . import output
from .accuracy import over
from .arguments import report_parser
from .errors import contact_errors
from .pose_sets import LOADS, SETS, Generator, Pairs
from .steps import drawn_paths, largest_steps
from .worst_case import RESTART, climb, worst_start

DRAWN, CLIMBING = 20_000, 500
"""Pairs that are drawn, and pairs that climb from the worst of them."""
PATHS, TURN = 60, 0.05
"""Paths on which steps are searched, and how far each turns [rad]."""
MINUTES, QUICK_MINUTES = 10.0, 0.1  # of a seed
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

    def broken(self) -> list[str]:
        """Return the limits that do not hold, in words."""
        found = {f'{quantity}, {network}': (value, times * LIMITS[quantity])
                 for (network, by), times in zip(self.worst.items(), (1, 3, 3), strict=True)
                 for quantity, value in by.items()}
        found |= {f'step of the {quantity}': (self.steps[quantity], most)
                  for quantity, most in STEP_LIMITS.items()}
        return over(f'mlp, {self.set}, seed {self.seed}', found)


def worst_of(numbers: np.ndarray, quantity: str, pairs: Pairs, rng: np.random.Generator,
             seconds: float, free_sizes: bool) -> float:
    """Return the largest error that climbing for that long finds [%]."""
    solver = native.PairSolver('mlp', UNIT, UNIT, numbers)

    def score(asked: Pairs) -> np.ndarray:
        contacts, truth = Contacts(*solver.solve(*asked, 1)[0]), asked.contacts()
        with np.errstate(invalid='ignore', divide='ignore'):  # pairs apart, and slivers
            errors = getattr(contact_errors(contacts, truth, asked.edge), quantity)
        touching = truth.colliding & contacts.colliding
        return np.where(touching, np.nan_to_num(errors, nan=-1.0), -1.0)

    end = time.monotonic() + seconds
    pairs = worst_start(pairs, score, CLIMBING)
    most = float(score(pairs).max())
    while time.monotonic() < end:
        pairs, scores = climb(rng, pairs, score, generations=RESTART, free_sizes=free_sizes)
        most = float(scores[0])
    return most


def search(name: str, make: Generator, seed: Sequence[int], seconds: float) -> Searched:
    """Search a set, each network and quantity for that long."""
    rng = np.random.default_rng(seed)
    pairs = make(rng, DRAWN)
    worst = {network: {quantity: worst_of(numbers, quantity, pairs, rng, seconds, name in FREE)
                       for quantity in QUANTITIES} for network, numbers in networks().items()}
    touching = pairs.rows(pairs.contacts().colliding)
    paths = drawn_paths(rng, touching.rows(slice(PATHS)), TURN, flat=name not in SETS)
    steps = largest_steps(ContactSolver(UNIT, UNIT, model='mlp'), paths)
    return Searched(set=name, seed=seed[0], worst=worst, steps={
        quantity: float(values.max()) for quantity, values in zip(QUANTITIES, steps)})


def table(rows: Sequence[Searched]) -> str:
    """Return a line for each set: the worst of all seeds."""
    def cell(found: Sequence[Mapping[str, float]]) -> str:
        return ' / '.join(f'{max(one[quantity] for one in found):.2g}' for quantity in QUANTITIES)

    lines = []
    for name in dict.fromkeys(row.set for row in rows):
        mine = [row for row in rows if row.set == name]
        lines.append([name, *(cell([row.worst[network] for row in mine])
                              for network in mine[0].worst), cell([row.steps for row in mine])])
    return output.markdown_table(
        ['set', 'shipped', *(f'garbage, {name}' for name in list(rows[0].worst)[1:]), 'steps'],
        lines)


def csv_rows(rows: Sequence[Searched]) -> Iterator[dict[str, object]]:
    """Yield a row per set, seed, network and quantity."""
    for row in rows:
        for network, by in row.worst.items():
            for quantity, value in by.items():
                yield {'set': row.set, 'seed': row.seed, 'network': network, 'quantity': quantity,
                       'worst': value,
                       'step': row.steps[quantity] if network == 'shipped' else None}


def main(args: Sequence[str] | None = None) -> int:
    """Search, print, write; 1 if a limit is broken."""
    from tqdm import tqdm

    parser = report_parser('searched', __doc__, quick=f'{QUICK_MINUTES:g} minutes for each seed',
                           seed=2, out='searched.md, searched.csv')
    parser.add_argument('--minutes', type=within(0.0), default=MINUTES,
                        help='for each of two seeds (default: %(default)g)')
    options = parser.parse_args(args)
    folder = output.results_folder(parser, options)
    minutes = min(options.minutes, QUICK_MINUTES) if options.quick else options.minutes
    seeds, sets = (options.seed, options.seed + 1), SETS | LOADS
    seconds = 60.0 * minutes / (len(sets) * len(networks()) * len(QUANTITIES))
    rows = [search(name, make, [seed, place], seconds) for seed in seeds for place, (name, make)
            in enumerate(tqdm(sets.items(), desc=f'searched, seed {seed}', unit='set'))]
    broken = [text for row in rows for text in row.broken()]
    output.write_csv(folder / 'searched.csv', csv_rows(rows), about=output.machine(native))
    (folder / 'searched.md').write_text(output.page(
        'benchmarks/pages/searched', command=output.command_line('benchmarks.searched', args),
        machine=output.machine(native), seeds=' and '.join(map(str, seeds)), minutes=minutes,
        verdict=f'Goals missed: {"; ".join(broken)}.' if broken else 'All limits hold.',
        table=table(rows)), encoding='utf-8')
    print(table(rows))
    for text in broken:
        print(f'searched: goal missed: {text}', file=sys.stderr)
    return 1 if broken else 0


if __name__ == '__main__':
    sys.exit(main())

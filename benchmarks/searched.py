# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Program `searched`: the worst errors of model `mlp` that a search finds.

`python -m benchmarks.searched` writes searched.md and searched.csv. From the worst of fresh draws
of each set, pairs climb to the largest error of point, volume or covariance. Sizes climb too where
the set draws sizes. Pairs with a mirror are searched for steps alone, where an axis flips.
"""
from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from box_contact_ros.arguments import within
from box_contact_ros.extras import require
from box_contact_ros.solver.contact_solver import ContactSolver

from . import output
from .errors import contact_errors
from .pose_sets import LOADS, SETS, Generator, Pairs, symmetric
from .steps import drawn_paths, flip_steps, largest_steps
from .worst_case import DEPTHS, RESTART, climb, worst_start

DRAWN, CLIMBING = 20_000, 500
"""Pairs that are drawn, and pairs that climb from the worst of them."""
PATHS, TURN = 60, 0.05
"""Paths on which steps are searched, and how far each turns [rad]."""
MINUTES, QUICK_MINUTES = 3.0, 0.05  # of a quantity, on all sets
QUANTITIES = ('point', 'volume', 'covariance')
FREE = ('random sizes', 'deep')  # sets whose sizes climb too
DEEP = {'deep': (DEPTHS[1], 0.7)}
"""Depths of sets that have others than `DEPTHS` [shortest edge]."""
MIRROR = 'with a mirror'


@dataclass(frozen=True, kw_only=True)
class Searched:
    """What a search has found on one set, by quantity in %."""

    set: str
    worst: Mapping[str, float]
    steps: Mapping[str, float]


def worst_of(solver: ContactSolver, quantity: str, pairs: Pairs, rng: np.random.Generator,
             seconds: float, *, free_sizes: bool,
             depths: tuple[float, float] = DEPTHS) -> float:
    """Return the largest error that climbing for that long finds [%]."""
    def score(asked: Pairs) -> np.ndarray:
        contacts, truth = asked.contacts(solver), asked.contacts()
        with np.errstate(invalid='ignore', divide='ignore'):  # pairs apart, and slivers
            errors = getattr(contact_errors(contacts, truth, asked.edge), quantity)
        touching = truth.colliding & contacts.colliding
        return np.where(touching, np.nan_to_num(errors, nan=-1.0), -1.0)

    end = time.monotonic() + seconds
    pairs = worst_start(pairs, score, CLIMBING)
    most = float(score(pairs).max())
    while time.monotonic() < end:
        pairs, scores = climb(rng, pairs, score, generations=RESTART, free_sizes=free_sizes,
                              depths=depths)
        most = float(scores[0])
    return most


def search(name: str, make: Generator, seed: Sequence[int], seconds: float) -> Searched:
    """Search a set, each quantity for that long."""
    solver, rng = ContactSolver(model='mlp'), np.random.default_rng(seed)
    pairs = make(rng, DRAWN)
    worst = {quantity: worst_of(solver, quantity, pairs, rng, seconds, free_sizes=name in FREE,
                                depths=DEEP.get(name, DEPTHS)) for quantity in QUANTITIES}
    touching = pairs.rows(pairs.contacts().colliding)
    paths = drawn_paths(rng, touching.rows(slice(PATHS)), TURN, flat=name not in SETS)
    return Searched(set=name, worst=worst, steps={
        quantity: float(values.max())
        for quantity, values in zip(QUANTITIES, largest_steps(solver, paths))})


def search_flips(seed: Sequence[int]) -> Searched:
    """Return the largest steps of pairs with a mirror, where rounding flips an axis."""
    rng = np.random.default_rng(seed)
    pairs = symmetric(rng, DRAWN)
    pairs = pairs.rows(pairs.contacts().colliding)
    steps = flip_steps(rng, ContactSolver(model='mlp'), pairs).max(axis=0)
    return Searched(set=MIRROR, worst={}, steps=dict(zip(QUANTITIES, map(float, steps))))


def table(rows: Sequence[Searched]) -> str:
    """Return a line for each set."""
    titles = [f'{words}{quantity}' for words in ('', 'step of the ') for quantity in QUANTITIES]
    return output.markdown_table(['set', *titles], [
        [row.set, *(f'{by[quantity]:.2g}' if by else '–' for by in (row.worst, row.steps)
                    for quantity in QUANTITIES)] for row in rows])


def csv_rows(rows: Sequence[Searched], seconds: float) -> Iterator[dict[str, object]]:
    """Yield a row per set and quantity."""
    for row in rows:
        for quantity in QUANTITIES:
            yield {'set': row.set, 'quantity': quantity, 'worst': row.worst.get(quantity),
                   'step': row.steps[quantity], 'seconds': seconds}


def main(args: Sequence[str] | None = None) -> int:
    """Search, print, write."""
    from tqdm import tqdm

    parser = output.report_parser(
        'searched', __doc__, quick=f'{QUICK_MINUTES:g} minutes per quantity', seed=2,
        out='searched.md, searched.csv')
    parser.add_argument('--minutes', type=within(0.0), default=MINUTES,
                        help='per quantity, shared by all sets (default: %(default)g)')
    options = parser.parse_args(args)
    folder = output.results_folder(parser, options)
    require('report')
    minutes = min(options.minutes, QUICK_MINUTES) if options.quick else options.minutes
    sets = SETS | LOADS
    seconds = 60.0 * minutes / len(sets)
    rows = [search(name, make, [options.seed, place], seconds) for place, (name, make)
            in enumerate(tqdm(sets.items(), desc='searched', unit='set'))]
    rows.append(search_flips([options.seed, len(sets)]))
    output.write_csv(folder / 'searched.csv', csv_rows(rows, seconds), about=output.machine())
    output.write_page(folder, 'searched', args, machine=output.machine(), seed=options.seed,
                      minutes=minutes, seconds=seconds, table=table(rows))
    print(table(rows))
    return 0


if __name__ == '__main__':
    sys.exit(main())

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Millions of random pairs, judged by code that shares nothing with the solver.

`python -m benchmarks.fuzz` draws pairs of boxes by class of size, in poses of the kinds that break
collision tests. Each model answers all of them. Every gate is zero: contacts missed or invented,
wrong depths, axes that are not the shallowest, points outside the boxes (`mlp`: outside the bounds
of the overlap), NaN, negative eigenvalues, bits that swapping the boxes changes, rows that differ
from their single calls, and exceptions. What is too near exact touch for float64 is judged in 60
digits. With `--random-weights`, `mlp` has random weights: its gates hold whatever the weights are.

A broken gate prints the pose, ready to be pasted into a test; the exit status is then 1. fuzz.csv
has a digest of all verdicts and separations. Runs of equal seed and number have equal digests for
every instruction set (BOX_CONTACT_INSTRUCTION_SET), and before and after a change of the core that
keeps these bits.

With `--heaps N`, N random heaps of boxes are moved by `PatchForces` instead (benchmarks/heaps.py).
With `--plans N`, a linear programme judges what falls in N random plans (random_plans.py), and with
`--orders N` slow loops the loading of N (random_orders.py).
"""
from __future__ import annotations

import hashlib
import os
import sys
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from box_contact_ros.arguments import within
from box_contact_ros.core import DEPTH_FLOOR, UNITS_MAX, native
from box_contact_ros.extras import require
from box_contact_ros.models.networks import core_numbers
from box_contact_ros.models.weights_file import Network
from box_contact_ros.solver.contact import FIELDS, Contacts
from box_contact_ros.solver.contact_solver import ContactSolver
from box_contact_ros.solver.pose import rotation_matrix

from . import heaps, judge, output, probes, random_orders, random_plans
from .pose_sets import (
    CONTAINER,
    HIGH_CUBE,
    TWENTY,
    Pairs,
    log_uniform,
    quaternion_multiply,
    right_angles,
    turns,
    unit_quaternions,
)
from .weights import mlp_shapes

PAIRS, QUICK_PAIRS = 10_000_000, 60_000
PIECE = 50_000  # pairs that are drawn and judged at a time
SHOWN = 3  # faults of a class and model that are printed
MODELS = ('mlp', 'exact')
ALONE = 50  # one row of so many is asked once more, alone
UNIT = (1.0, 1.0, 1.0)
SCALES = (1e-2, 1e4)  # of random weights
SMOOTH = 2.0**-46
"""How far below zero an eigenvalue of `mlp` may be [of the trace]: roundings."""
EXACT = 1e-9
"""The same of `exact`, whose sums cancel; or SLIVER times size by depth, if that is more."""
SLIVER = 1e-15
OUTSIDE, INEXACT = 2.0**-43, 2.0**-21
"""How far a point may be outside the bounds, of the size and the coordinates: roundings. Across the
normal the bounds of `mlp` are float32: INEXACT of the size more, along it of the depth."""

SWAP, SINGLE = 1 << 20, 1 << 21
GATES = judge.GATES | {SWAP: 'changed by a swap', SINGLE: 'not its single call'}
"""Faults by bit."""

Sizes = Callable[[np.random.Generator, int], tuple[np.ndarray, np.ndarray]]


def _cube(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Draw equal cubes, 1 cm to 10 m."""
    size = np.repeat(log_uniform(rng, 0.01, 10.0, n)[:, None], 3, axis=1)
    return size, size.copy()


def _container(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Draw ISO containers: 20 and 40 ft, standard and high cube."""
    kinds = np.array([TWENTY, CONTAINER, (6.058, 2.438, 2.896), HIGH_CUBE])
    return kinds[rng.integers(0, 4, n)], kinds[rng.integers(0, 4, n)]


def _slab(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Draw boxes with two wide extents, one of a tenth to a hundredth; the other is anything."""
    flat = np.stack([log_uniform(rng, 1, 3, n), log_uniform(rng, 1, 3, n),
                     log_uniform(rng, 0.01, 0.1, n)], axis=1)
    return rng.permuted(flat, axis=1), np.exp(rng.uniform(-1.5, 1.0, (n, 3)))


def _needle(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Draw boxes with one long extent and two of a twentieth to a thousandth; both boxes."""
    sizes = []
    for _ in range(2):
        thin = log_uniform(rng, 1e-3, 0.05, (n, 2))
        sizes.append(rng.permuted(np.column_stack([log_uniform(rng, 0.5, 2, n), thin]), axis=1))
    return sizes[0], sizes[1]


def _card(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Draw sheets 0.35 mm and thicker, to 1:10,000; both boxes."""
    sizes = []
    for _ in range(2):
        wide = log_uniform(rng, 0.05, 3.5, (n, 2))
        sizes.append(rng.permuted(np.column_stack([wide, log_uniform(rng, 3.5e-4, 2e-3, n)]),
                                  axis=1))
    return sizes[0], sizes[1]


def _small_on_large(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Draw boxes of size ratios of 100 to 1,000,000."""
    small = np.exp(rng.uniform(-1, 1, (n, 3)))
    large = np.exp(rng.uniform(-1, 1, (n, 3))) * log_uniform(rng, 1e2, 1e6, n)[:, None]
    turned = rng.random(n) < 0.5
    return np.where(turned[:, None], large, small), np.where(turned[:, None], small, large)


CLASSES: dict[str, Sizes] = {'cube': _cube, 'container': _container, 'slab': _slab,
                             'needle': _needle, 'card': _card, 'small on large': _small_on_large}
"""Size classes by name."""


def draw(name: str, rng: np.random.Generator, n: int) -> Pairs:
    """Draw n pairs of a class.

    Orientations: a third anything; a third one of the 24 right-angled ones, tilted by 0 or 1e-16 to
    0.1 rad; a third with one edge direction in common. A third of the places is anywhere near; the
    others are `_brought_together`. Half of the pairs are then moved rigidly, a fifth of those far
    from the origin.
    """
    size_a, size_b = CLASSES[name](rng, n)
    turn = unit_quaternions(rng, n)
    kind = rng.integers(0, 3, n)
    right = np.array(right_angles())[rng.integers(0, 24, n)]
    tilt = log_uniform(rng, 1e-16, 0.1, n) * (rng.random(n) < 0.9)
    tilted = quaternion_multiply(turns(_axes(rng, n), tilt), right)
    shared = quaternion_multiply(
        right, turns(np.eye(3)[rng.integers(0, 3, n)], rng.uniform(-4, 4, n)))
    turn = np.where((kind == 1)[:, None], tilted, np.where((kind == 2)[:, None], shared, turn))
    place = _brought_together(rng, rotation_matrix(turn), size_a, size_b)
    anywhere = rng.random(n) < 1.0 / 3.0
    reach = 0.5 * (size_a + np.abs(rotation_matrix(turn) * size_b[:, None]).sum(axis=2))
    place = np.where(anywhere[:, None], reach * rng.uniform(-1.05, 1.05, (n, 3)), place)

    moved = rng.random(n) < 0.5
    rigid = np.where(moved[:, None], unit_quaternions(rng, n), [0.0, 0.0, 0.0, 1.0])
    far = np.where(rng.random(n) < 0.2, log_uniform(rng, 1e2, 1e7, n), 10.0) * moved
    shift = rng.uniform(-1, 1, (n, 3)) * far[:, None]
    a = np.concatenate([shift, rigid], axis=1)
    b = np.concatenate([np.einsum('nij,nj->ni', rotation_matrix(rigid), place) + shift,
                        quaternion_multiply(rigid, turn)], axis=1)
    # Quaternions as programs send them: either sign, and a length off by rounding or by drift.
    for pose in (a, b):
        pose[:, 3:] *= (rng.choice([-1.0, 1.0], n) * (1.0 + rng.choice(
            [0.0, 0.0, 1e-15, 1e-7, 1e-3], n)))[:, None]
    return Pairs(a, b, size_a, size_b)


def _brought_together(rng: np.random.Generator, axes: np.ndarray, size_a: np.ndarray,
                      size_b: np.ndarray) -> np.ndarray:
    """Draw places (n, 3) of B, turned by axes (n, 3, 3), where features of both boxes meet.

    Corners, middles of edges or faces meet up to a gap or overlap of 1e-13 to 0.3 of the size. The
    gap is along one of the fifteen axes or anywhere. Most have a smaller step across too. One in a
    hundred has a gap of 0 or 1e-16 to 1e-13 instead, which takes 60 digits to judge.
    """
    n = len(axes)
    at_a = 0.5 * rng.integers(-1, 2, (n, 3)) * size_a
    at_b = np.einsum('nij,nj->ni', axes, 0.5 * rng.integers(-1, 2, (n, 3)) * size_b)
    # Along: an axis of A, of B, a cross product, or anything.
    which = rng.integers(0, 4, n)
    along = _axes(rng, n)
    along[which == 0] = np.eye(3)[rng.integers(0, 3, n)][which == 0]
    of_b = np.take_along_axis(axes, rng.integers(0, 3, (n, 1, 1)), axis=2)[:, :, 0]
    along[which == 1] = of_b[which == 1]
    crossed = np.cross(np.eye(3)[rng.integers(0, 3, n)], of_b)
    length = np.linalg.norm(crossed, axis=1)
    rows = (which == 2) & (length > 1e-3)
    along[rows] = crossed[rows] / length[rows, None]
    size = np.maximum(size_a, size_b).max(axis=1)
    least = np.minimum(size_a.min(axis=1), size_b.min(axis=1))
    close = rng.random(n) < 0.01
    step = np.where(close, log_uniform(rng, 1e-16, 1e-13, n) * (rng.random(n) < 0.5),
                    log_uniform(rng, 1e-13, 0.3, n)) * rng.choice([-1.0, 1.0], n)
    place = at_a - at_b + along * (step * np.where(rng.random(n) < 0.5, size, least))[:, None]
    # A step within a plane of contact leaves it as it is: mostly another one comes across.
    across = log_uniform(rng, 1e-12, 1e-2, n) * (rng.random(n) < 0.9) * ~close
    return place + _axes(rng, n) * (across * least)[:, None]


def _axes(rng: np.random.Generator, n: int) -> np.ndarray:
    axes = rng.normal(size=(n, 3))
    return axes / np.linalg.norm(axes, axis=1, keepdims=True)


# --- faults of volumes and covariances ------------------------------------------------------------

def patch_faults(pairs: Pairs, found: Contacts) -> np.ndarray:
    """Return sums (n,) of the faults of any model's patches; none where it gives no patch."""
    faults = np.zeros(len(found.colliding), dtype=np.int64)
    rows = np.flatnonzero(found.colliding)
    if not np.isfinite(found.volume[rows]).any():
        return faults
    finite = (np.isfinite(found.volume[rows])
              & np.isfinite(found.covariance[rows]).all(axis=(1, 2)))
    faults[rows[~finite]] = judge.NOT_FINITE
    rows = rows[finite]
    slack = np.maximum(EXACT, SLIVER * _size_by_depth(pairs, found, rows))
    faults[rows[(_least(found, rows) < -slack) | (found.volume[rows] <= 0.0)]] = judge.NEGATIVE
    return faults


def mlp_faults(pairs: Pairs, found: Contacts) -> np.ndarray:
    """Return sums (n,) of the faults of the patches of `mlp`.

    Its point is within the bounds of the overlap, and its volume is at most theirs. These bounds
    are the patch box (core/src/mlp/patch_box.hpp).
    """
    rows = np.flatnonzero(found.colliding)
    axes, middle, half, _ = probes.patch_boxes(pairs.rows(rows))
    off = np.abs(np.einsum('nji,nj->ni', axes, found.point[rows] - middle))
    size = pairs.size[rows]
    deep = np.maximum(half[:, 2], -found.separation[rows])
    inexact = INEXACT * np.stack([size, size, deep], axis=1)
    inexact += OUTSIDE * (size + np.abs(found.point[rows]).max(axis=1))[:, None]
    within = np.all(off <= half + inexact, axis=1)
    within &= found.volume[rows] <= (1.0 + INEXACT) * np.prod(2.0 * half, axis=1)
    faults = np.zeros(len(found.colliding), dtype=np.int64)
    faults[rows] = (np.where(within, 0, judge.OUT_OF_BOUNDS)
                    | np.where(_least(found, rows) >= -SMOOTH, 0, judge.NEGATIVE))
    return faults


def _size_by_depth(pairs: Pairs, found: Contacts, rows: np.ndarray) -> np.ndarray:
    return 1.0 / np.maximum(DEPTH_FLOOR, -found.separation[rows] / pairs.size[rows])


def _least(found: Contacts, rows: np.ndarray) -> np.ndarray:
    """Return the least eigenvalue of covariances [of their trace]."""
    covariance = found.covariance[rows]
    return np.linalg.eigvalsh(covariance)[:, 0] / np.trace(covariance, axis1=1, axis2=2)


# --- models and tallies ---------------------------------------------------------------------------


class RandomMlp:
    """Model `mlp` with hidden layers of random widths, and weights of a random scale."""

    def __init__(self, *seed: int) -> None:
        rng = np.random.default_rng(seed)
        scale = float(log_uniform(rng, *SCALES, 1)[0])
        network = Network([(rng.uniform(-scale, scale, shape), rng.uniform(-scale, scale, shape[0]))
                           for shape in mlp_shapes(rng.integers(1, UNITS_MAX, 2, endpoint=True))])
        self._solver = native.Mlp(core_numbers(network))

    def batch(self, pose_a: np.ndarray, pose_b: np.ndarray, *, size_a: np.ndarray,
              size_b: np.ndarray) -> Contacts:
        """Return the contacts of poses (n, 7) and full extents (n, 3), as `ContactSolver` does."""
        return self._solver.solve(pose_a, pose_b, size_a, size_b, 1)[0]


Solver = ContactSolver | RandomMlp


@dataclass
class Tally:
    """What was found for one class and model."""

    name: str
    model: str
    pairs: int = 0
    contacts: int = 0
    near_touch: int = 0  # pairs that were judged in 60 digits
    worst_depth: float = 0.0  # largest depth error, by its tolerance
    digest: str = ''  # of all verdicts and separations
    faults: Counter[str] = field(default_factory=lambda: Counter(dict.fromkeys(
        (*GATES.values(), 'exception'), 0)))
    poses: list[str] = field(default_factory=list)  # the first faults, as code

    def add(self, piece: Tally) -> None:
        """Take in the next piece."""
        for name in ('pairs', 'contacts', 'near_touch'):
            setattr(self, name, getattr(self, name) + getattr(piece, name))
        self.worst_depth = max(self.worst_depth, piece.worst_depth)
        self.digest = hashlib.sha256((self.digest + piece.digest).encode()).hexdigest()[:16]
        self.faults.update(piece.faults)
        self.poses = (self.poses + piece.poses)[:SHOWN]

    def __str__(self) -> str:
        wrong = ', '.join(f'{count} {name}' for name, count in self.faults.items() if count)
        return (f'{self.name:<15} {self.model:<10} {self.pairs:>11,} pairs {self.contacts:>11,} '
                f'contacts {self.near_touch:>8,} near touch  worst depth error '
                f'{self.worst_depth:.2g} of its tolerance  {wrong or "no fault"}')


def examine(pairs: Pairs, name: str, solvers: Mapping[str, Solver]) -> list[Tally]:
    """Ask each model for the pairs of a class, and judge the answers."""
    gap = cache(lambda row: judge.exact_gap(*(part[row] for part in pairs)))  # for all models
    tallies = []
    for model, solver in solvers.items():
        tally = Tally(name, model, pairs=len(pairs.pose_a))
        tallies.append(tally)
        try:
            found = pairs.contacts(solver)
            changed = changed_bits(pairs, found, solver)
        except Exception as error:
            tally.faults['exception'] += 1
            tally.poses.append(f'# {model}, exception: {error!r}')
            continue
        verdict = judge.judge(*pairs, found)
        verdict.settle(found, gap)
        faults = verdict.faults | patch_faults(pairs, found) | changed
        if model == 'mlp':
            faults = faults & ~judge.OUTSIDE | mlp_faults(pairs, found)
        tally.contacts = int(found.colliding.sum())
        tally.near_touch = int(verdict.doubtful.sum())
        tally.worst_depth = float(np.nanmax(verdict.depth_error, initial=0.0))
        tally.digest = hashlib.sha256(
            found.colliding.tobytes() + found.separation.tobytes()).hexdigest()
        for bit, words in GATES.items():
            tally.faults[words] = int(np.count_nonzero(faults & bit))
        for row in np.flatnonzero(faults)[:SHOWN]:
            words = ', '.join(text for bit, text in GATES.items() if faults[row] & bit)
            tally.poses.append(_pasted(words, model, [part[row] for part in pairs]))
    return tallies


def changed_bits(pairs: Pairs, found: Contacts, solver: Solver) -> np.ndarray:
    """Return SWAP and SINGLE (n,) where B against A, or a row alone, has other bits."""
    swapped = Pairs(pairs.pose_b, pairs.pose_a, pairs.size_b, pairs.size_a).contacts(solver)
    changed = np.where((swapped.colliding != found.colliding)
                       | (swapped.separation != found.separation), SWAP, 0)
    for row in range(0, len(found.colliding), ALONE):
        alone = pairs.rows(slice(row, row + 1)).contacts(solver)
        if not all(np.array_equal(getattr(alone, name)[0], getattr(found, name)[row],
                                  equal_nan=True) for name in FIELDS):
            changed[row] |= SINGLE
    return changed


def _pasted(words: str, model: str, pair: Sequence[np.ndarray]) -> str:
    """Return a pair as Python, every digit."""
    values = [', '.join(map(repr, part.tolist())) for part in pair]
    return (f'# {words}\nContactSolver(({values[2]}), ({values[3]}), model={model!r})(\n'
            f'    ({values[0]}),\n    ({values[1]}))')


def _piece(job: tuple[str, int, int, int, tuple[str, ...], bool]) -> list[Tally]:
    """Draw and judge one piece of a class, for all models; the seed is the piece's own."""
    name, seed, number, count, models, random_weights = job
    own = seed, list(CLASSES).index(name), number
    solvers: dict[str, Solver] = {model: ContactSolver(model=model) for model in models}
    if random_weights and 'mlp' in solvers:
        solvers['mlp'] = RandomMlp(*own)
    found = examine(draw(name, np.random.default_rng(own), count), name, solvers)
    if random_weights:
        for tally in found:
            tally.poses = [f'# mlp is RandomMlp{own}\n{pose}' for pose in tally.poses]
    return found


def fuzz(total: int, *, seed: int = 1, classes: Sequence[str] = tuple(CLASSES),
         models: Sequence[str] = MODELS, random_weights: bool = False, workers: int = 1,
         ) -> dict[tuple[str, str], Tally]:
    """Return tallies by class and model, of `total` pairs spread evenly over the classes.

    random_weights: each piece has a `RandomMlp` of its own as `mlp`.
    """
    from tqdm import tqdm

    each = -(-total // len(classes))
    counts = [min(PIECE, each - drawn) for drawn in range(0, each, PIECE)]
    jobs = [(name, seed, number, count, tuple(models), random_weights)
            for name in classes for number, count in enumerate(counts)]
    tallies = {(name, model): Tally(name, model) for name in classes for model in models}
    with (tqdm(total=sum(job[3] for job in jobs), desc='fuzz', unit='pair', unit_scale=True,
               mininterval=1.0) as bar,
          ProcessPoolExecutor(workers) if workers > 1 else nullcontext() as pool):
        for found in pool.map(_piece, jobs) if pool else map(_piece, jobs):
            for tally in found:
                tallies[tally.name, tally.model].add(tally)
            bar.update(found[0].pairs)
    return tallies


def main(args: Sequence[str] | None = None) -> int:
    """Fuzz, print a line per class and model; 1 if a gate is broken."""
    parser = output.report_parser(
        'fuzz', __doc__, quick=f'{QUICK_PAIRS:,} pairs', seed=1, out='the table')
    parser.add_argument('--pairs', type=within(1), default=PAIRS,
                        help='pairs in all (default: %(default)s)')
    parser.add_argument('--models', nargs='+', choices=MODELS, default=MODELS, metavar='MODEL',
                        help='of mlp and exact (default: both)')
    parser.add_argument('--random-weights', action='store_true',
                        help=f'mlp has other random weights in each piece of {PIECE:,} pairs; the '
                        'table is fuzz_random_weights.csv')
    parser.add_argument('--heaps', type=within(1), metavar='N',
                        help='run N heaps of boxes by the forces, and no pairs')
    parser.add_argument('--plans', type=within(1), metavar='N',
                        help='judge N plans of boxes by a linear programme, and no pairs')
    parser.add_argument('--orders', type=within(1), metavar='N',
                        help='judge the loading of N plans by slow loops, and no pairs')
    parser.add_argument('--workers', type=within(1), default=os.cpu_count() or 1,
                        help='processes at once')
    options = parser.parse_args(args)
    if options.heaps:
        return int(heaps.fuzz(options.heaps, seed=options.seed, workers=options.workers) > 0)
    if options.plans:
        return int(random_plans.fuzz(options.plans, seed=options.seed,
                                     workers=options.workers) > 0)
    if options.orders:
        return int(random_orders.fuzz(options.orders, seed=options.seed,
                                      workers=options.workers) > 0)
    folder = output.results_folder(parser, options)
    require('fuzz', 'report')
    tallies = fuzz(QUICK_PAIRS if options.quick else options.pairs, seed=options.seed,
                   models=options.models, random_weights=options.random_weights,
                   workers=options.workers).values()
    print(*tallies, sep='\n')
    for pose in (pose for tally in tallies for pose in tally.poses):
        print(f'\n{pose}')
    file = 'fuzz_random_weights.csv' if options.random_weights else 'fuzz.csv'
    output.write_csv(folder / file, [
        {'class': t.name, 'model': t.model, 'pairs': t.pairs, 'contacts': t.contacts,
         'near_touch': t.near_touch,
         'worst_depth_by_tolerance': t.worst_depth, 'digest': t.digest, **t.faults}
        for t in tallies], digits=3, about=output.machine())
    broken = sum(tally.faults.total() for tally in tallies)
    print(f'\n{broken} faults, seed {options.seed}, {output.machine()}')
    return int(broken > 0)


if __name__ == '__main__':
    sys.exit(main())

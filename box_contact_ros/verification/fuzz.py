"""Fuzz: millions of random pairs, judged by code that shares nothing with the solver's.

`python -m box_contact_ros fuzz` draws pairs of boxes by class of size, in poses of the kinds that
break collision tests, and asks each model for all of them. Every gate stands at zero: contacts
missed or invented, depths wrong, an axis that is not the shallowest, a point outside, NaN, an
exception. What is too near exact touch for float64 is judged in 60 digits. A broken gate prints the
pose, ready to be pasted into a test; the exit status is then 1.
"""
from __future__ import annotations

import argparse
import csv
import os
import platform
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..solver.arguments import check_ranges, make_room, model_name, seed_number
from ..solver.contact_solver import ContactSolver
from .judge import GATES, exact_gap, judge

PAIRS, QUICK_PAIRS = 10_000_000, 60_000
PIECE = 50_000
"""Pairs that are drawn and judged at a time."""
MODELS = ('exact', 'mlp')
TOUCH_ULPS = 8.0
"""A gap of up to so many units in the last place of the largest coordinate or size is a touch:
the package's convention, which the judge has to know."""
SHOWN = 3
"""Faults of a class and model that are printed."""

Sizes = Callable[[np.random.Generator, int], tuple[np.ndarray, np.ndarray]]


# --- what is drawn --------------------------------------------------------------------------------


def _log_uniform(rng: np.random.Generator, low: float, high: float, n: int | tuple[int, ...],
                 ) -> np.ndarray:
    return np.exp(rng.uniform(np.log(low), np.log(high), n))


def _cube(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Equal cubes, 1 cm to 10 m."""
    size = np.repeat(_log_uniform(rng, 0.01, 10.0, n)[:, None], 3, axis=1)
    return size, size.copy()


def _container(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """ISO containers: 20 and 40 ft, standard and high cube."""
    kinds = np.array([[6.058, 2.438, 2.591], [12.192, 2.438, 2.591], [6.058, 2.438, 2.896],
                      [12.192, 2.438, 2.896]])
    return kinds[rng.integers(0, 4, n)], kinds[rng.integers(0, 4, n)]


def _slab(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Two wide extents, one of a tenth to a hundredth; the other box is anything."""
    flat = np.stack([_log_uniform(rng, 1, 3, n), _log_uniform(rng, 1, 3, n),
                     _log_uniform(rng, 0.01, 0.1, n)], axis=1)
    return _shuffled(rng, flat), np.exp(rng.uniform(-1.5, 1.0, (n, 3)))


def _needle(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """One long extent, two of a twentieth to a thousandth; both boxes."""
    sizes = []
    for _ in range(2):
        thin = _log_uniform(rng, 1e-3, 0.05, (n, 2))
        sizes.append(_shuffled(rng, np.column_stack([_log_uniform(rng, 0.5, 2, n), thin])))
    return sizes[0], sizes[1]


def _card(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Sheets 0.35 mm and thicker, to 1:10,000; both boxes."""
    sizes = []
    for _ in range(2):
        wide = _log_uniform(rng, 0.05, 3.5, (n, 2))
        sizes.append(_shuffled(rng, np.column_stack([wide, _log_uniform(rng, 3.5e-4, 2e-3, n)])))
    return sizes[0], sizes[1]


def _small_on_large(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Ratios of 100 to 1,000,000."""
    small = np.exp(rng.uniform(-1, 1, (n, 3)))
    large = np.exp(rng.uniform(-1, 1, (n, 3))) * _log_uniform(rng, 1e2, 1e6, n)[:, None]
    turned = rng.random(n) < 0.5
    return np.where(turned[:, None], large, small), np.where(turned[:, None], small, large)


def _shuffled(rng: np.random.Generator, sizes: np.ndarray) -> np.ndarray:
    return rng.permuted(sizes, axis=1)


CLASSES: dict[str, Sizes] = {'cube': _cube, 'container': _container, 'slab': _slab,
                             'needle': _needle, 'card': _card, 'small on large': _small_on_large}
"""Size classes by name."""


def draw(name: str, rng: np.random.Generator, n: int) -> tuple[np.ndarray, ...]:
    """Pairs of a class, n of them: pose_a, pose_b (n, 7), size_a, size_b (n, 3).

    Orientations: a third anything; a third one of the 24 right-angled ones, tilted by 0 or 1e-16 to
    0.1 rad; a third with one edge direction in common. Places: a third anywhere near; the others
    with features of both boxes (corner, middle of an edge or a face) brought together to a gap or
    overlap of 1e-13 to 0.3 of the size, along one of the fifteen axes or anywhere, and mostly a
    smaller one across; one in a hundred to 0 or 1e-16 to 1e-13: those take 60 digits to judge. Half
    of the pairs are then moved rigidly, a fifth of those far from the origin.
    """
    size_a, size_b = CLASSES[name](rng, n)
    size = np.maximum(size_a, size_b).max(axis=1)
    turn = _quaternions(rng, n)
    kind = rng.integers(0, 3, n)
    right = _RIGHT_ANGLES[rng.integers(0, 24, n)]
    tilt = _log_uniform(rng, 1e-16, 0.1, n) * (rng.random(n) < 0.9)
    tilted = _product(_turns(_axes(rng, n), tilt), right)
    shared = _product(right, _turns(np.eye(3)[rng.integers(0, 3, n)], rng.uniform(-4, 4, n)))
    turn = np.where((kind == 1)[:, None], tilted, np.where((kind == 2)[:, None], shared, turn))

    axes = _matrices(turn)
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
    least = np.minimum(size_a.min(axis=1), size_b.min(axis=1))
    close = rng.random(n) < 0.01
    step = np.where(close, _log_uniform(rng, 1e-16, 1e-13, n) * (rng.random(n) < 0.5),
                    _log_uniform(rng, 1e-13, 0.3, n)) * rng.choice([-1.0, 1.0], n)
    place = at_a - at_b + along * (step * np.where(rng.random(n) < 0.5, size, least))[:, None]
    # A step within a plane of contact leaves it as it is: mostly another one comes across.
    across = _log_uniform(rng, 1e-12, 1e-2, n) * (rng.random(n) < 0.9) * ~close
    place += _axes(rng, n) * (across * least)[:, None]
    anywhere = rng.random(n) < 1.0 / 3.0
    reach = 0.5 * (size_a + np.abs(np.einsum('nij,nj->nij', axes, size_b)).sum(axis=2))
    place = np.where(anywhere[:, None], reach * rng.uniform(-1.05, 1.05, (n, 3)), place)

    a = np.concatenate([np.zeros((n, 3)), np.tile([0.0, 0, 0, 1], (n, 1))], axis=1)
    b = np.concatenate([place, turn], axis=1)
    moved = rng.random(n) < 0.5
    rigid = np.where(moved[:, None], _quaternions(rng, n), a[:, 3:])
    far = np.where(rng.random(n) < 0.2, _log_uniform(rng, 1e2, 1e7, n), 10.0) * moved
    shift = rng.uniform(-1, 1, (n, 3)) * far[:, None]
    frame = _matrices(rigid)
    a = np.concatenate([shift, rigid], axis=1)
    b = np.concatenate([np.einsum('nij,nj->ni', frame, b[:, :3]) + shift, _product(rigid, turn)],
                       axis=1)
    # Quaternions as programs send them: either sign, and a length off by rounding or by drift.
    for pose in (a, b):
        pose[:, 3:] *= (rng.choice([-1.0, 1.0], n) * (1.0 + rng.choice(
            [0.0, 0.0, 1e-15, 1e-7, 1e-3], n)))[:, None]
    return a, b, size_a, size_b


def _axes(rng: np.random.Generator, n: int) -> np.ndarray:
    axes = rng.normal(size=(n, 3))
    return axes / np.linalg.norm(axes, axis=1, keepdims=True)


def _quaternions(rng: np.random.Generator, n: int) -> np.ndarray:
    q = rng.normal(size=(n, 4))
    return q / np.linalg.norm(q, axis=1, keepdims=True)


def _turns(axes: np.ndarray, angles: np.ndarray) -> np.ndarray:
    return np.concatenate([axes * np.sin(0.5 * angles)[:, None], np.cos(0.5 * angles)[:, None]],
                          axis=1)


def _product(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    u, w, v, s = p[:, :3], p[:, 3:], q[:, :3], q[:, 3:]
    return np.concatenate([w * v + s * u + np.cross(u, v),
                           w * s - np.sum(u * v, axis=1, keepdims=True)], axis=1)


def _matrices(q: np.ndarray) -> np.ndarray:
    x, y, z, w = q.T
    return np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w),
                     2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
                     2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
                    axis=1).reshape(-1, 3, 3)


def _right_angles() -> np.ndarray:
    """The 24 orientations that map axes on axes, as quaternions."""
    half = np.sqrt(0.5)
    quarter = np.concatenate([half * np.eye(3), np.full((3, 1), half)], axis=1)
    found = [np.array([0.0, 0.0, 0.0, 1.0])]
    for q in found:  # grows while it is gone through
        for turn in quarter:
            new = _product(q[None], turn[None])[0]
            if all(min(np.abs(new - old).max(), np.abs(new + old).max()) > 1e-6 for old in found):
                found.append(new)
    return np.array(found)


_RIGHT_ANGLES = _right_angles()


# --- the judgement --------------------------------------------------------------------------------


@dataclass
class Tally:
    """What was found for one class and model."""

    name: str
    model: str
    pairs: int = 0
    contacts: int = 0
    near_touch: int = 0
    """Pairs that were judged in 60 digits."""
    exact_answers: int = 0
    worst_depth: float = 0.0
    """Largest depth error, by its tolerance."""
    faults: dict[str, int] = field(default_factory=lambda: dict.fromkeys(
        (*GATES.values(), 'exception'), 0))
    poses: list[str] = field(default_factory=list)
    """The first faults, as code."""

    @property
    def broken(self) -> int:
        """Faults of all kinds."""
        return sum(self.faults.values())

    def add(self, other: Tally) -> None:
        """Take in what another piece found."""
        for name in ('pairs', 'contacts', 'near_touch', 'exact_answers'):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        self.worst_depth = max(self.worst_depth, other.worst_depth)
        for name, count in other.faults.items():
            self.faults[name] += count
        self.poses = (self.poses + other.poses)[:SHOWN]

    def __str__(self) -> str:
        wrong = ', '.join(f'{count} {name}' for name, count in self.faults.items() if count)
        return (f'{self.name:<15} {self.model:<10} {self.pairs:>11,} pairs {self.contacts:>11,} '
                f'contacts {self.near_touch:>8,} near touch  worst depth error '
                f'{self.worst_depth:.2g} of its tolerance  {wrong or "no fault"}')


def examine(pairs: tuple[np.ndarray, ...], name: str, solvers: dict[str, ContactSolver],
            ) -> list[Tally]:
    """Ask each model for pairs (pose_a, pose_b, size_a, size_b), and judge its answers."""
    a, b, size_a, size_b = pairs
    gaps: dict[int, float] = {}

    def gap(row: int) -> float:
        """In 60 digits, and once for all models."""
        if row not in gaps:
            gaps[row] = exact_gap(a[row], b[row], size_a[row], size_b[row])
        return gaps[row]

    tallies = []
    for model, solver in solvers.items():
        tally = Tally(name, model, pairs=len(a))
        tallies.append(tally)
        before = solver.exact_answers
        try:
            found = solver.batch(a, b, size_a=size_a, size_b=size_b)
        except Exception as error:
            tally.faults['exception'] += 1
            tally.poses.append(f'# {model}, exception: {error!r}')
            continue
        verdict = judge(a, b, size_a, size_b, found)
        for row in np.flatnonzero(verdict.doubtful):
            verdict.settle(row, gap(row), found, touch=TOUCH_ULPS * _last_place(pairs, row))
        faults = verdict.faults
        tally.contacts = int(found.colliding.sum())
        tally.near_touch = int(verdict.doubtful.sum())
        tally.exact_answers = solver.exact_answers - before
        tally.worst_depth = float(np.nanmax(verdict.depth_error, initial=0.0))
        for bit, words in GATES.items():
            tally.faults[words] = int(np.count_nonzero(faults & bit))
        for row in np.flatnonzero(faults)[:SHOWN]:
            words = ', '.join(text for bit, text in GATES.items() if faults[row] & bit)
            tally.poses.append(_pasted(words, model, [part[row] for part in pairs]))
    return tallies


def _last_place(pairs: tuple[np.ndarray, ...], row: int) -> float:
    """A unit in the last place of the largest coordinate or size."""
    a, b, size_a, size_b = (part[row] for part in pairs)
    return float(np.spacing(max(np.abs(a[:3]).max(), np.abs(b[:3]).max(), size_a.max(),
                                size_b.max())))


def _pasted(words: str, model: str, pair: Sequence[np.ndarray]) -> str:
    """A pair as Python, every digit."""
    values = [', '.join(map(repr, part.tolist())) for part in pair]
    return (f'# {words}\nContactSolver(({values[2]}), ({values[3]}), model={model!r})(\n'
            f'    ({values[0]}),\n    ({values[1]}))')


def _piece(job: tuple[str, int, int, int, tuple[str, ...]]) -> list[Tally]:
    """One piece of a class, for all models. Seeded by itself, whoever runs it."""
    name, seed, number, count, models = job
    rng = np.random.default_rng([seed, list(CLASSES).index(name), number])
    return examine(draw(name, rng, count), name, {model: _solver(model) for model in models})


_solvers: dict[str, ContactSolver] = {}


def _solver(model: str) -> ContactSolver:
    """One per process: loading weights takes longer than a piece."""
    if model not in _solvers:
        _solvers[model] = ContactSolver((1, 1, 1), (1, 1, 1), model=model)
    return _solvers[model]


def fuzz(total: int, *, seed: int = 1, classes: Sequence[str] = tuple(CLASSES),
         models: Sequence[str] = MODELS, workers: int = 1, progress: bool = True,
         ) -> dict[tuple[str, str], Tally]:
    """Tallies by class and model, of `total` pairs spread evenly over the classes."""
    from tqdm import tqdm

    jobs = []
    for name in classes:
        left = -(-total // len(classes))
        for number in range(-(-left // PIECE)):
            jobs.append((name, seed, number, min(PIECE, left - number * PIECE), tuple(models)))
    tallies = {(name, model): Tally(name, model) for name in classes for model in models}
    with tqdm(total=sum(job[3] for job in jobs), desc='fuzz', unit='pair', unit_scale=True,
              mininterval=1.0, disable=not progress) as bar:
        for found in _mapped(jobs, workers):
            for tally in found:
                tallies[tally.name, tally.model].add(tally)
            bar.set_postfix(faults=sum(t.broken for t in tallies.values()), refresh=False)
            bar.update(found[0].pairs)
    return tallies


def _mapped(jobs: Sequence[tuple], workers: int) -> Iterator[list[Tally]]:
    if workers == 1:
        yield from map(_piece, jobs)
        return
    with ProcessPoolExecutor(workers) as pool:
        yield from pool.map(_piece, jobs)


def write_csv(path: Path, tallies: dict[tuple[str, str], Tally]) -> None:
    """A row per class and model."""
    with path.open('w', newline='') as file:
        writer = csv.writer(file, lineterminator='\n')
        gates = list(next(iter(tallies.values())).faults)
        writer.writerow(['class', 'model', 'pairs', 'contacts', 'near_touch', 'exact_answers',
                         'worst_depth_by_tolerance', *gates])
        for t in tallies.values():
            writer.writerow([t.name, t.model, t.pairs, t.contacts, t.near_touch, t.exact_answers,
                             f'{t.worst_depth:.3g}', *t.faults.values()])


def main(args: Sequence[str] | None = None) -> int:
    """Fuzz, print a line per class and model; 1 if a gate is broken."""
    parser = argparse.ArgumentParser(prog='fuzz', description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--pairs', type=int, default=PAIRS, help='in all (default: %(default)s)')
    parser.add_argument('--quick', action='store_true', help=f'{QUICK_PAIRS:,} pairs')
    parser.add_argument('--seed', type=seed_number, default=1, help='default: %(default)s')
    parser.add_argument('--classes', nargs='+', choices=list(CLASSES), default=list(CLASSES),
                        metavar='CLASS', help=f'of {", ".join(CLASSES)} (default: all)')
    parser.add_argument('--models', nargs='+', type=model_name, default=list(MODELS),
                        metavar='MODEL',
                        help='default: %(default)s')
    parser.add_argument('--workers', type=int, default=os.cpu_count() or 1, help='processes')
    parser.add_argument('--out', type=Path, metavar='FILE', help='CSV with the tallies')
    options = parser.parse_args(args)
    check_ranges(parser, options, pairs=(1, None), workers=(1, None))
    if options.out:
        make_room(parser, options.out)
    began = time.monotonic()
    tallies = fuzz(QUICK_PAIRS if options.quick else options.pairs, seed=options.seed,
                   classes=options.classes, models=options.models, workers=options.workers)
    for tally in tallies.values():
        print(tally)
    for tally in tallies.values():
        for pose in tally.poses:
            print(f'\n{pose}')
    if options.out:
        write_csv(options.out, tallies)
    broken = sum(tally.broken for tally in tallies.values())
    print(f'\n{"BROKEN: " + str(broken) + " faults" if broken else "all gates at zero"} after '
          f'{(time.monotonic() - began) / 60:.1f} minutes, seed {options.seed}, '
          f'Python {platform.python_version()}')
    return 1 if broken else 0


if __name__ == '__main__':
    sys.exit(main())

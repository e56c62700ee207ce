# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Program `native`: libbox_contact and other engines, C against C.

`python -m benchmarks.native` compiles native_calls/, which calls all in turn, and writes native.md
and native.csv. It runs copies of the program, each with its own copy of the library, as times
depend on where code lies in memory. A full run ends at once, with status 2, where a rival is
missing that `--leave-out` does not name.
"""
from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from box_contact_ros.core import instruction_sets
from box_contact_ros.extras import require
from box_contact_ros.models.networks import SHIPPED_PAPERS, PaperWeights, mlp_numbers
from box_contact_ros.models.weights_file import load_weights
from box_contact_ros.resources import resource_path

from . import native_picture, output, settled
from .contestant import MLP_SIZES
from .engines import add_leave_out
from .native_calls import FULL, TITLES, Effort, Program, Ratio, compiled_for, of_copies
from .output import markdown_table, percentiles
from .pose_sets import FLUSH, LOADS, SETS, Pairs, drawn
from .timing import pinned, usable_cores

QUICK = Effort(2, 1_000, 1, 200)
CONTACTS, PASSES = 100_000, 30
"""Contacts of all sets, each timed alone in every pass; its time is the least of the passes."""
QUICK_CONTACTS, QUICK_PASSES = 2_000, 3
EACH = ('exact', 'mlp')
PERCENTS = {'p50': 50, 'p99.9': 99.9, 'slowest': 100}
GOALS = {'slowest': 1.5, 'p99.9': 1.3}
"""Of all contacts by `mlp`: at most so many times the median one."""
MIXED = 'containers, 20 % touching'
UNIT = 'mjc_BoxBox, single'
OURS = tuple(f'exact {finds}, {way}' for way in ('single', 'batch')
             for finds in ('volume', 'covariance'))
RIVALS = ('mj', *TITLES.values())
"""How the names of engines' contestants begin; they are the last columns."""
CLEAR = 1e-6
"""Least gap or depth, of the size, at which verdicts are compared: engines have tolerances."""
MOST_WRONG, MOST_OFF = 0.02, 0.01
"""Share of wrong verdicts, and median depth error [%], above which the call itself must be wrong.
The most of any engine are .0088 and .0032."""


class Times(NamedTuple):
    """One contestant on one set."""

    nanoseconds: np.ndarray  # (copies, rounds), of a pair
    missed: int
    invented: int
    judged: int  # pairs farther than `CLEAR` from touch
    depth_errors: tuple[float, float, float]  # median, p99, worst against `exact`, of the size [%]


OnSet = Mapping[str, Times]  # by contestant


def networks_for(pairs: Pairs) -> bytes:
    """Return the networks that answer for these pairs, as native_calls/ reads them.

    They are the other sizes of `mlp`, and the paper's where both boxes have a size that it knows.
    """
    networks = {name: mlp_numbers(path) for name, path in MLP_SIZES.items()}
    for name in SHIPPED_PAPERS:
        paper = PaperWeights(load_weights(resource_path('weights', f'{name}.safetensors')))
        if paper.fits(pairs.size_a, pairs.size_b).all():
            networks['paper'] = paper.numbers
    return b''.join(np.array([len(name), len(numbers)]).tobytes() + name.encode()
                    + numbers.tobytes() for name, numbers in networks.items())


def sets(count: int) -> dict[str, Pairs]:
    """Return recorded pairs of goods at rest, and `count` pairs of each drawn set.

    Last, containers, a fifth of them in contact.
    """
    recorded = {name: pairs.rows(slice(count))
                for name, pairs in settled.by_engine(settled.read()).items()}
    by_name = {name: drawn(make, np.random.default_rng([3, place]), count)
               for place, (name, make) in enumerate((SETS | LOADS | FLUSH).items())}
    mixed = by_name['containers']
    apart = np.random.default_rng(3).random(len(mixed.pose_b)) < 0.8
    pose_b = mixed.pose_b.copy()
    pose_b[apart, :3] *= 1.5
    return {**recorded, **by_name, MIXED: mixed._replace(pose_b=pose_b)}


def each_contact(program: Program, by_set: Mapping[str, Pairs], instruction_set: str, count: int,
                 passes: int) -> dict[str, np.ndarray]:
    """Return the times (2, n) of `exact` and `mlp` for n contacts of each set, one by one [ns].

    There are at most `count` contacts in all. A time is the least of all passes, so what disturbs
    one pass does not count, and an empty reading of the clock is subtracted.
    """
    share = count // len(by_set)
    touching = {name: pairs.rows(rows[:share]) for name, pairs in by_set.items()
                if len(rows := np.flatnonzero(pairs.contacts().colliding))}
    asked = Pairs(*(np.concatenate(columns) for columns in zip(*touching.values())))
    lines = program.run('each', asked, instruction_set, passes)
    times = np.array([line.split('\t') for line in lines], dtype=float).T
    ends = np.cumsum([len(pairs.size) for pairs in touching.values()])[:-1]
    return dict(zip(touching, np.split(times, ends, axis=1)))


def timed(program: Program, pairs: Pairs, instruction_set: str, effort: Effort) -> OnSet:
    """Return times and errors of all contestants on one set, in one process.

    The times are those of one copy, (1, rounds).
    """
    networks = program.path.with_name('networks')
    networks.write_bytes(networks_for(pairs))
    answers = program.answers(pairs, instruction_set, effort.rounds, effort.calls, networks)
    return {name: judged(name, *found, pairs) for name, found in answers.items()}


def judged(name: str, nanoseconds: np.ndarray, separation: np.ndarray, pairs: Pairs) -> Times:
    """Compare signed separations (n,) of the first n pairs with those of `exact`.

    Raises `RuntimeError` where so many verdicts are wrong that the call must be.
    """
    first = pairs.rows(slice(len(separation)))
    truth, size = first.contacts().separation, first.size
    clear = np.abs(truth) > CLEAR * size
    missed, invented = ((separation > 0.0) & (truth < 0.0) & clear,
                        (separation <= 0.0) & (truth > 0.0) & clear)
    both = (separation <= 0.0) & (truth < 0.0)
    errors = 100.0 * np.abs(separation - truth)[both] / size[both]
    p50, p99, worst = percentiles(errors, 50, 99, 100)
    if (missed | invented).sum() > MOST_WRONG * len(truth) or p50 > MOST_OFF:
        raise RuntimeError(f'{name} misses {missed.sum()} and invents {invented.sum()} contacts of '
                           f'{len(truth)} pairs; its median depth error is {p50:.3g} % of the size')
    return Times(nanoseconds, int(missed.sum()), int(invented.sum()), int(clear.sum()),
                 (p50, p99, worst))


def sets_table(by_set: Mapping[str, OnSet], way: str) -> str:
    """Return a row per set: the time of `UNIT`, and the ratios of contestants to it.

    way: of those contestants, single or batch. Engines have the last columns.
    """
    every = sorted(dict.fromkeys(name for times in by_set.values() for name in times
                                 if name != UNIT and name.endswith(f', {way}')),
                   key=lambda name: name.startswith(RIVALS))
    return markdown_table(
        ['', '`mjc_BoxBox` [ns]', *(name.removesuffix(f', {way}') for name in every)],
        [[of_set, f'{np.median(times[UNIT].nanoseconds):.0f}',
          *(str(Ratio.of(times, name, UNIT)) if name in times else '–' for name in every)]
         for of_set, times in by_set.items()])


def models_table(by_set: Mapping[str, OnSet]) -> str:
    """Return a row per set: the ratios of `mlp` to `exact`."""
    return markdown_table(['', *(name.replace('exact ', '') for name in OURS)], [
        [of_set, *(str(Ratio.of(times, name.replace('exact', 'mlp'), name)) for name in OURS)]
        for of_set, times in by_set.items()])


def scenes_table(by_scene: Mapping[str, Pairs], times: Mapping[str, OnSet]) -> str:
    """Return a row per recorded scene: the ratios to `UNIT` of calls and batches of `exact`."""
    return markdown_table(['scene', 'contacts', *OURS], [
        [name, f'{len(by_scene[name].size)}', *(str(Ratio.of(here, one, UNIT)) for one in OURS)]
        for name, here in times.items()])


def slowest_table(times: Mapping[str, np.ndarray]) -> str:
    """Return a row per set: the times of single contacts, and the slowest by the median of all."""
    of_all = np.concatenate(list(times.values()), axis=1)
    lines = []
    for name, both in {**times, 'all': of_all}.items():
        line = [name, f'{both.shape[1]:,}']
        for mine, others in zip(both, of_all):
            values = percentiles(mine, *PERCENTS.values())
            line += [*(f'{value:.0f}' for value in values),
                     f'{values[-1] / np.median(others):.2f}']
        lines.append(line)
    return markdown_table(['', 'contacts', *(f'`{model}`: {name}' for model in EACH for name in (
        *PERCENTS, 'slowest / p50 of all'))], lines)


def goals(times: Mapping[str, np.ndarray]) -> str:
    """Return what `GOALS` names of the times of single contacts, and which goals are missed."""
    of_all = np.concatenate([both[EACH.index('mlp')] for both in times.values()])
    found = {name: float(np.percentile(of_all, PERCENTS[name]) / np.median(of_all))
             for name in GOALS}
    return ', '.join(f'{name} {found[name]:.2f} (at most {most:g}: '
                     f'{"met" if found[name] <= most else "goal missed"})'
                     for name, most in GOALS.items())


def contact_rows(found: Mapping[str, Mapping[str, np.ndarray]]) -> Iterator[dict[str, object]]:
    """Yield a row per instruction set, set and model: the times of single contacts."""
    for instruction_set, by_set in found.items():
        for name, both in by_set.items():
            for model, times in zip(EACH, both):
                yield {'instruction_set': instruction_set, 'set': name,
                       'contestant': f'{model} covariance, each contact', 'judged': len(times),
                       **{f'{column}_ns': value for column, value in zip(
                           PERCENTS, percentiles(times, *PERCENTS.values()))}}


def csv_rows(found: Mapping[str, Mapping[str, OnSet]]) -> Iterator[dict[str, object]]:
    """Yield a row per instruction set, set and contestant."""
    for instruction_set, by_set in found.items():
        for name, times in by_set.items():
            for contestant, one in times.items():
                yield {'instruction_set': instruction_set, 'set': name, 'contestant': contestant,
                       'min_ns': one.nanoseconds.min(), 'p50_ns': float(np.median(one.nanoseconds)),
                       **Ratio.of(times, contestant, UNIT).columns('by_unit'),
                       'judged': one.judged, 'missed': one.missed, 'invented': one.invented,
                       **dict(zip(('depth_p50', 'depth_p99', 'depth_worst'), one.depth_errors)),
                       **(Ratio.of(times, contestant, contestant.replace('mlp', 'exact'))
                          .columns('by_exact') if contestant.startswith('mlp ') else {})}


def main(args: Sequence[str] | None = None) -> int:
    """Compile, measure, print, write; 2 where the program cannot be made."""
    from tqdm import tqdm

    parser = output.report_parser(
        'native', __doc__, quick='few pairs and rounds, to try it out',
        out='native.md, native.csv, native.png')
    add_leave_out(parser)
    options = parser.parse_args(args)
    folder = output.results_folder(parser, options)
    require('report', 'sim')
    effort = QUICK if options.quick else FULL
    most, passes = (QUICK_CONTACTS, QUICK_PASSES) if options.quick else (CONTACTS, PASSES)
    names = [name for name in instruction_sets() if name != 'baseline']
    best = names[-1]
    found: dict[str, dict[str, OnSet]] = {name: {} for name in names}
    with tempfile.TemporaryDirectory() as made:
        program = compiled_for('native', options, Path(made), 'contact', names)
        if program is None:
            return 2
        copies = [program.copied(Path(made, f'copy {number}')) for number in range(effort.copies)]
        with pinned({usable_cores()[-1]}):
            by_set = sets(effort.pairs)
            for of_set, chosen in tqdm(by_set.items(), desc='native', unit='set'):
                # Copies outside, so that instruction sets take turns.
                runs = [{name: timed(copy, chosen, name, effort) for name in names}
                        for copy in copies]
                for name in names:
                    found[name][of_set] = of_copies([run[name] for run in runs])
            by_scene = settled.by_scene(settled.read())
            scenes = {of_scene: of_copies([timed(copy, chosen, best, effort) for copy in copies])
                      for of_scene, chosen in tqdm(by_scene.items(), desc='scenes', unit='scene')}
            del by_set[MIXED]  # its contacts are those of containers
            contacts = {name: each_contact(program, by_set, name, most, passes) for name in names}
    tables = {way: sets_table(found[best], way) for way in ('single', 'batch')}
    output.write_page(
        folder, 'native', args, machine=output.machine(), **effort._asdict(), best=best, **tables,
        models=models_table(found[best]), scenes=scenes_table(by_scene, scenes),
        slowest=slowest_table(contacts[best]), goals=goals(contacts[best]), passes=passes,
        code=program.calls_shown(), engines=program.engines(), missing=program.left_out())
    found[best].update(scenes)
    output.write_csv(folder / 'native.csv', [*csv_rows(found), *contact_rows(contacts)],
                     about=output.machine())
    drawn_sets = [*settled.by_engine(settled.read()), *SETS, *LOADS, *FLUSH]
    native_picture.draw(folder / 'native.png', folder / 'native.csv', best, drawn_sets)
    print(tables['single'], tables['batch'], sep='\n\n')
    return 0


if __name__ == '__main__':
    sys.exit(main())

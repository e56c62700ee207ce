# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The paper's search for its two networks, by training thousands at once.

Learning rate, momentum, hidden units and range of the initial weights are searched by successive
halving (Jamieson and Talwalkar 2016), with the settings in use among them. All candidates are in
the first rung. The better part goes on to a rung of more epochs. In each rung a network starts anew
and its learning rate falls to zero, so finished trainings are compared.

`python -m benchmarks.paper.search` takes 8 minutes on one core. It writes a page, a CSV of all
candidates and a plot.
"""
from __future__ import annotations

import math
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from tqdm import tqdm

from box_contact_ros.arguments import within

from ..output import (
    command_line,
    machine,
    markdown_table,
    page,
    read_csv,
    report_parser,
    results_folder,
    subplots,
    write_csv,
)
from ..pose_sets import log_uniform
from . import dataset
from .fit import PaperSettings, fit
from .jobs import JOBS, MIXTURE, PaperJob

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PACKAGES = ('numpy', 'torch')  # whose versions are named
NAME = 'search_paper'  # of the files

_CANDIDATES = 1001  # stream of random numbers
QUICK_COUNTS = (400, 200, 200)  # patterns per set
GROUP = 64  # candidates that are trained at once
SHOWN = 1.5  # errors up to which networks are drawn [rad]: some diverge
SHOWN_BEST = 4  # finalists on the page

Scores = dict[str, float]
"""What is known of a network after a rung; 'error' is what candidates are ranked by."""


@dataclass(frozen=True)
class Candidate:
    """Settings of one training."""

    number: int
    hidden: tuple[int, ...]
    rate: float
    momentum: float
    initial: float
    shipped: bool = False  # the settings in use: they go on to the end, to be compared with


@dataclass(frozen=True)
class Rung:
    """A stage: how many candidates are in it, and for how many epochs each is trained."""

    candidates: int
    epochs: int


class Search:
    """The search for one of the paper's networks."""

    def __init__(self, name: str, job: PaperJob, sets: dict[str, dataset.Patterns], *, seed: int,
                 count: int, quick: bool) -> None:
        self.name, self.sets, self.settings = name, sets, job.settings
        # Other candidates for every network.
        self.seed = int(np.random.SeedSequence([seed, *name.encode()]).generate_state(1)[0])
        self.rungs = ([Rung(count, 1), Rung(max(count // 4, 4), 2)] if quick else
                      [Rung(count, 8), Rung(max(count // 4, 16), 32),
                       Rung(max(count // 16, 8), 120)])
        self.candidates = self._drawn()
        self.done: list[dict[int, Scores]] = []
        """For each rung, the scores by the candidates' numbers."""

    def _drawn(self) -> list[Candidate]:
        """Draw settings over the ranges in which trainings of this kind are made."""
        s = self.settings
        found = [Candidate(0, s.widths[1:3], s.rate, s.momentum, s.initial, shipped=True)]
        for number in range(1, self.rungs[0].candidates):
            rng = np.random.default_rng([self.seed, _CANDIDATES, number])
            hidden = (int(rng.integers(6, 25)), int(rng.integers(6, 25)))
            rate, friction, initial = (float(log_uniform(rng, *ends, ())) for ends in (
                (3e-3, 1.0), (0.03, 1.0), (0.1, 3.0)))
            found.append(Candidate(number, hidden, rate, 1.0 - friction, initial))
        return found

    def cost(self, candidate: Candidate) -> int:
        """Return the multiply-adds of a candidate's network."""
        widths = (self.settings.widths[0], *candidate.hidden, self.settings.widths[-1])
        return sum(a * b for a, b in pairwise(widths))

    def run(self) -> None:
        """Go through all rungs. Every group of candidates of like cost has a seed of its own."""
        alive = self.candidates
        for number, rung in enumerate(self.rungs):
            if number:
                alive = survivors(alive, self.done[-1], rung.candidates)
            ordered = sorted(alive, key=lambda one: (self.cost(one), one.number))
            groups = [ordered[k:k + GROUP] for k in range(0, len(ordered), GROUP)]
            scores: dict[int, Scores] = {}
            for place, group in enumerate(tqdm(
                    groups, mininterval=1.0, unit='group',
                    desc=f'{self.name}, rung {number + 1} of {len(self.rungs)}')):
                seed = np.random.SeedSequence([self.seed, number, place]).generate_state(1)[0]
                scores |= self._train(rung, group, int(seed))
            self.done.append(scores)

    def _train(self, rung: Rung, group: Sequence[Candidate], seed: int) -> dict[int, Scores]:
        """Train by backpropagation with momentum; the error is the cross-validation RMSE [rad].

        Finalists also get their error on the external set.
        """
        s = self.settings
        fitted = fit(self.sets['training'], self.sets['cross-validation'], PaperSettings(
            (s.widths[0], *map(max, zip(*(one.hidden for one in group))), s.widths[-1]),
            networks=len(group), epochs=rung.epochs, batch=s.batch,
            rate=[one.rate for one in group], momentum=[one.momentum for one in group],
            initial=[one.initial for one in group], hidden=[one.hidden for one in group],
            wrap=s.wrap, seed=seed))
        errors = {'error': fitted.error.tolist()}
        if rung == self.rungs[-1]:
            errors['external'] = fitted.errors(self.sets['external']).tolist()
        return {one.number: dict(zip(errors, values))
                for one, *values in zip(group, *errors.values())}

    def settings_of(self, one: Candidate) -> dict[str, float]:
        """Return the settings that the search varies, by their names on the page."""
        return {'multiply-adds': self.cost(one), 'learning rate': one.rate,
                'momentum': one.momentum, 'initial range': one.initial}


def ranking(candidates: Sequence[Candidate], scores: Mapping[int, Scores]) -> list[Candidate]:
    """Return candidates in the order of their errors; networks that diverged come last."""
    def order(one: Candidate) -> tuple[bool, float, int]:
        error = scores[one.number]['error']
        return not math.isfinite(error), error, one.number

    return sorted(candidates, key=order)


def survivors(candidates: Sequence[Candidate], scores: Mapping[int, Scores], count: int,
              ) -> list[Candidate]:
    """Return the settings in use, and the best of the others, `count` in all."""
    shipped = [one for one in candidates if one.shipped]
    others = ranking([one for one in candidates if not one.shipped], scores)
    return shipped + others[:count - len(shipped)]


def searches(*, seed: int, count: int, quick: bool) -> list[Search]:
    """Return one for the network with discontinuities, and one for a subset of that without.

    Both are on the patterns of Tables 1 and 2, each with half of the candidates.
    """
    counts, subset_counts = ((QUICK_COUNTS,) * 2 if quick else
                             (dataset.PAPER_COUNTS, dataset.CONTINUOUS_COUNTS))
    whole = dataset.paper(seed, counts=counts, folded_in=False, kept=MIXTURE)
    subsets = dataset.by_signs(seed, counts=subset_counts, kept=MIXTURE)
    return [Search(name, JOBS[job], sets, seed=seed, count=count // 2, quick=quick)
            for name, job, sets in (
                ('with discontinuities', 'table-1-mixture', whole),
                ('without, signs +++', 'table-2-by-signs', subsets['+++']))]


def section(search: Search) -> str:
    """Return a search's rungs, its best finalists and the rank of the settings in use."""
    last = search.done[-1]
    ranked = ranking([one for one in search.candidates if one.number in last], last)
    rank = next(place for place, one in enumerate(ranked, start=1) if one.shipped)
    shown = [one for place, one in enumerate(ranked) if place < SHOWN_BEST or one.shipped]
    rows = [['-'.join(map(str, one.hidden)) + (', in use' if one.shipped else ''),
             *(f'{value:.4g}' for value in (*search.settings_of(one).values(),
                                            *last[one.number].values()))] for one in shown]
    rungs = ', '.join(f'{rung.candidates:,} for {rung.epochs}' for rung in search.rungs)
    found = markdown_table(['hidden units', *search.settings_of(ranked[0]), *last[0]], rows,
                           words=0)
    return (f'\n## {search.name}\n\nCandidates and epochs, by rung: {rungs}. A batch has '
            f'{search.settings.batch} patterns. The best finalists:\n\n{found}\n\n'
            f'The settings in use are {rank} of {len(ranked)} finalists. The best has '
            f'{last[ranked[0].number]["error"]:.4g}, they have {last[0]["error"]:.4g}.\n')


def write_table(path: Path, results: Sequence[Search]) -> None:
    """Write all candidates of all searches, with the scores of their last rung."""
    rows = []
    for search in results:
        for one in search.candidates:
            entry = asdict(one)
            scores = [rung[one.number] for rung in search.done if one.number in rung]
            units = {f'hidden_{k}': width for k, width in enumerate(entry.pop('hidden'), start=1)}
            rows.append({'search': search.name, 'number': entry.pop('number'), **units,
                         'multiply_adds': search.cost(one), **entry, 'rungs': len(scores),
                         **scores[-1]})
    write_csv(path, rows, about=machine(PACKAGES))


def plot(path: Path, table: Path) -> None:
    """Draw, from the CSV, the error of each network that converged over its size."""
    rows = [row for row in read_csv(table) if row['error'] and float(row['error']) < SHOWN]
    names = list(dict.fromkeys(row['search'] for row in rows))
    figure, panels = subplots(1, len(names), (3.3 * len(names), 3.6), sharey=True)
    above = []  # errors of the settings in use, divided by the least ones
    for panel, name in zip(panels[0], names):
        of_search = [row for row in rows if row['search'] == name]
        shipped = next(row for row in of_search if row['shipped'] == 'True')
        above.append(float(shipped['error']) / min(
            float(row['error']) for row in of_search if row['rungs'] == shipped['rungs']))
        for rungs in sorted({row['rungs'] for row in of_search}):
            _scatter(panel, [row for row in of_search if row['rungs'] == rungs], s=5, linewidths=0,
                     color=f'C{rungs}', label=f'left in round {rungs}')
        _scatter(panel, [shipped], s=110, marker='*', color='black', label='in use')
        panel.set(title=name.replace('signs +++', 'roll, pitch, yaw > 0'),
                  xlabel='multiply-adds of the network')
    panels[0, 0].set_ylabel('RMSE over the angles [rad]')
    panels[0, 0].legend(fontsize=8, loc='upper right')
    figure.suptitle('The error of the settings in use is at most '
                    f'{100.0 * (max(above) - 1.0):.1f} % above that of the best network',
                    fontsize=11)
    figure.savefig(path, metadata={'Software': None})


def _scatter(panel: Axes, rows: Sequence[Mapping[str, str]], **style: Any) -> None:
    panel.scatter([float(row['multiply_adds']) for row in rows],
                  [float(row['error']) for row in rows], **style)


def main(args: Sequence[str] | None = None) -> int:
    """Search, and write what was found."""
    parser = report_parser('python -m benchmarks.paper.search', __doc__, seed=1,
                           out='page, table and plot',
                           quick='little data and two short rungs, to try it out in seconds')
    parser.add_argument('--candidates', type=within(16), default=2048, metavar='N',
                        help='networks to begin with (default 2048); the time grows with them')
    options = parser.parse_args(args)
    folder = results_folder(parser, options)
    torch.set_num_threads(1)  # matrices this small gain little from more
    began = time.monotonic()
    results = searches(seed=options.seed, count=options.candidates, quick=options.quick)
    for search in results:
        search.run()
    made = (f'Made by `{command_line("benchmarks.paper.search", args)}` in '
            f'{(time.monotonic() - began) / 60.0:.1f} minutes on '
            f'{machine(PACKAGES)}.')
    text = page('benchmarks/paper/pages/search', made=made,
                total=sum(len(search.candidates) for search in results), external=' and '.join(
            f'{len(search.sets["external"]):,} patterns' for search in results))
    text += ''.join(map(section, results))
    text += f'\nAll candidates: [{NAME}.csv]({NAME}.csv).\n'
    (folder / f'{NAME}.md').write_text(text, 'utf-8')
    write_table(folder / f'{NAME}.csv', results)
    plot(folder / f'{NAME}.png', folder / f'{NAME}.csv')
    print(text)
    return 0


if __name__ == '__main__':
    sys.exit(main())

# Copyright 2026 The box_contact_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The paper's search for its two networks, by training thousands at once.

It searches learning rate, momentum, hidden units and range of the initial weights, by successive
halving, and ranks the settings in use, too. It writes a page of Markdown, a CSV of all candidates
and a plot.
"""
from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch

from box_contact_ros.core import native
from box_contact_ros.solver.arguments import within

from ..arguments import report_parser
from ..output import (
    command_line,
    machine,
    markdown_table,
    page,
    results_folder,
    subplots,
    write_csv,
)
from ..pose_sets import log_uniform
from . import dataset
from .fit import PaperSettings
from .fit import fit as fit_paper
from .halving import Candidate, CheckpointError, Rung, Rungs, Scores, Search, ranking
from .jobs import JOBS, MIXTURE, PaperJob

PACKAGES = ('numpy', 'torch')  # whose versions are named

_CANDIDATES = 1001  # stream of random numbers
QUICK_COUNTS = (400, 200, 200)  # patterns per set
SHOWN = 1.5  # errors up to which networks are drawn [rad]: some diverge


class PaperSearch(Search):
    """The paper's search, for one of its networks."""

    def __init__(self, name: str, job: PaperJob, sets: dict[str, dataset.Patterns], *, seed: int,
                 count: int, quick: bool) -> None:
        self.name, self.sets = name, sets
        # Other candidates for every network.
        self.seed = int(np.random.SeedSequence([seed, *name.encode()]).generate_state(1)[0])
        self.settings = job.settings
        plan = ([(count, 1), (max(count // 4, 4), 2)] if quick else
                [(count, 8), (max(count // 4, 16), 32), (max(count // 16, 8), 120)])
        self.rungs = [Rung(*entry, job.settings.batch, group=64) for entry in plan]

    def cost(self, candidate: Candidate) -> int:
        """Return the multiply-adds of its network."""
        widths = (self.settings.widths[0], *candidate.hidden, self.settings.widths[-1])
        return sum(a * b for a, b in zip(widths, widths[1:]))

    def candidates(self) -> list[Candidate]:
        """Return settings over the ranges in which trainings of this kind are made."""
        s = self.settings
        found = [Candidate(0, s.widths[1:3], s.rate, s.momentum, s.initial, shipped=True)]
        for number in range(1, self.rungs[0].candidates):
            rng = np.random.default_rng([self.seed, _CANDIDATES, number])
            hidden = (int(rng.integers(6, 25)), int(rng.integers(6, 25)))
            rate, friction, initial = (float(log_uniform(rng, *ends, ())) for ends in (
                (3e-3, 1.0), (0.03, 1.0), (0.1, 3.0)))
            found.append(Candidate(number, hidden, rate, 1.0 - friction, initial))
        return found

    def train(self, rung: Rung, group: Sequence[Candidate], seed: int) -> list[Scores]:
        """Train by backpropagation with momentum; the error is the cross-validation RMSE [rad].

        Finalists also get their error on the external set.
        """
        inputs, outputs = self.settings.widths[0], self.settings.widths[-1]
        fitted = fit_paper(self.sets['training'], self.sets['cross-validation'], PaperSettings(
            (inputs, *map(max, zip(*(one.hidden for one in group))), outputs),
            networks=len(group), epochs=rung.effort, batch=rung.batch,
            rate=[one.rate for one in group], momentum=[one.momentum for one in group],
            initial=[one.initial for one in group], hidden=[one.hidden for one in group],
            wrap=self.settings.wrap, seed=seed))
        scores = [{'error': error} for error in fitted.error.tolist()]
        if rung == self.rungs[-1]:
            for score, error in zip(scores, fitted.errors(self.sets['external']).tolist()):
                score['external'] = error
        return scores


def paper_searches(*, seed: int, count: int, quick: bool) -> list[PaperSearch]:
    """Return one for the network with discontinuities, and one for a subset of that without.

    Both are on the patterns of Tables 1 and 2, each with half of the candidates.
    """
    common: dict[str, Any] = {'seed': seed, 'quick': quick, 'count': count // 2}
    counts, subset_counts = ((QUICK_COUNTS,) * 2 if quick else
                             (dataset.PAPER_COUNTS, dataset.CONTINUOUS_COUNTS))
    whole = dataset.paper(seed, counts=counts, folded_in=False, kept=MIXTURE)
    subsets = dataset.by_subset(seed, dataset.NO_FOLD, counts=subset_counts, kept=MIXTURE)
    return [PaperSearch('with discontinuities', JOBS['table-1-mixture'], whole, **common),
            PaperSearch('without, signs +++', JOBS['table-2-by-signs'], subsets['+++'], **common)]


def settings_of(search: Search, one: Candidate) -> dict[str, float]:
    """Return the settings that the search varies, by their names on the page."""
    return {'multiply-adds': search.cost(one), 'learning rate': one.rate,
            'momentum': one.momentum, 'initial range': one.initial}


def section(search: Search, done: Rungs) -> str:
    """Return a search's rungs, its best finalists and the rank of the settings in use."""
    last = done[-1]
    ranked = ranking([one for one in search.candidates() if one.number in last], last)
    rank = next(place for place, one in enumerate(ranked, start=1) if one.shipped)
    shown = [one for place, one in enumerate(ranked) if place < 8 or one.shipped]
    rows = [['-'.join(map(str, one.hidden)) + (', in use' if one.shipped else ''),
             *(f'{value:.4g}' for value in (*settings_of(search, one).values(),
                                            *last[one.number].values()))] for one in shown]
    rungs = markdown_table(['rung', 'candidates', 'steps or epochs', 'batch'], [
        [number, f'{rung.candidates:,}', f'{rung.effort:,}', rung.batch]
        for number, rung in enumerate(search.rungs, start=1)], words=0)
    found = markdown_table(['hidden units', *settings_of(search, ranked[0]), *last[0]], rows,
                           words=0)
    return (f'\n## {search.name}\n\n{rungs}\n\nThe best finalists.\n\n{found}\n\n'
            f'The settings in use are {rank} of {len(ranked)} finalists. The best has '
            f'{last[ranked[0].number]["error"]:.4g}, they have {last[0]["error"]:.4g}.\n')


def write_table(path: Path, results: Sequence[tuple[Search, Rungs]]) -> None:
    """Write all candidates of all searches, with the scores of their last rung."""
    rows = []
    for search, done in results:
        for one in search.candidates():
            entry, scores = asdict(one), [rung[one.number] for rung in done if one.number in rung]
            units = {f'hidden_{k}': width for k, width in enumerate(entry.pop('hidden'), start=1)}
            rows.append({'search': search.name, 'number': entry.pop('number'), **units,
                         'multiply_adds': search.cost(one), **entry, 'rungs': len(scores),
                         **scores[-1]})
    write_csv(path, rows, about=machine(native, PACKAGES))


def plot(path: Path, results: Sequence[tuple[Search, Rungs]]) -> None:
    """Draw the error of each network after its last rung against its size, where it converged."""
    name = 'multiply-adds'
    figure, panels = subplots(1, len(results), (3.3 * len(results), 3.3), sharey=True)
    for panel, (search, done) in zip(panels[0], results):
        some = search.candidates()
        for number, rung in enumerate(done, start=1):
            left = [one for one in some if one.number in rung and rung[one.number]['error'] < SHOWN
                    and not (number < len(done) and one.number in done[number])]
            panel.scatter([settings_of(search, one)[name] for one in left],
                          [rung[one.number]['error'] for one in left], s=5, linewidths=0,
                          color=f'C{number}', label=f'last rung: {number}')
        panel.plot(settings_of(search, some[0])[name], done[-1][0]['error'], 'k*', markersize=11,
                   label='in use')
        panel.set(title=search.name, xlabel=f'{name} of the network')
    panels[0, 0].set_ylabel('RMSE over the angles [rad]')
    panels[0, 0].legend(fontsize=8)
    figure.savefig(path)


def _options(args: Sequence[str] | None) -> argparse.Namespace:
    parser = report_parser(
        'python -m benchmarks.paper.search',
        'Train thousands of networks at once, keep the best, train those longer.\n\n'
        'Measured on one core: 8 minutes.\n\n'
        'Stopped, it goes on from its checkpoint file when it is started again with the same\n'
        'options, and ends with the same result.', seed=1,
        out='page, table, plot and, until the end, the checkpoint',
        quick='little data and two short rungs, to try it out in seconds')
    parser.add_argument('--candidates', type=within(16), default=2048, metavar='N',
                        help='networks to begin with (default 2048); the time grows with them')
    options = parser.parse_args(args)
    options.out = results_folder(parser, options)
    return options


def main(args: Sequence[str] | None = None) -> int:
    """Search, and write what was found."""
    options = _options(args)
    import matplotlib  # noqa: F401  (if it is missing, that is said now)
    torch.set_num_threads(1)  # matrices this small gain little from more
    began = time.monotonic()
    searches = paper_searches(seed=options.seed, count=options.candidates, quick=options.quick)
    name = 'search_paper'
    checkpoints = [options.out / f'{name}_{k}.checkpoint' for k in range(len(searches))]
    results: list[tuple[Search, Rungs]] = []
    for search, checkpoint in zip(searches, checkpoints):
        if checkpoint.exists():
            print(f'going on from {checkpoint}')
        try:
            results.append((search, search.run(checkpoint)))
        except CheckpointError as error:
            print(f'search: {error}', file=sys.stderr)
            return 1
    made = (f'Made by `{command_line("benchmarks.paper.search", args)}` in '
            f'{(time.monotonic() - began) / 60.0:.1f} minutes on '
            f'{machine(native, PACKAGES)}.')
    text = page('benchmarks/paper/pages/search', made=made,
                total=sum(len(done[0]) for _, done in results), external=' and '.join(
            f'{len(search.sets["external"]):,} patterns' for search in searches))
    text += f'\n![Settings and errors]({name}.png)\n' + ''.join(
        section(*result) for result in results)
    text += f'\nAll candidates: [{name}.csv]({name}.csv).\n'
    (options.out / f'{name}.md').write_text(text, 'utf-8')
    write_table(options.out / f'{name}.csv', results)
    plot(options.out / f'{name}.png', results)
    for path in checkpoints:
        path.unlink()
    print(text)
    return 0


if __name__ == '__main__':
    sys.exit(main())
